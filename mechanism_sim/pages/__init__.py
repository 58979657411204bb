"""Pages in a browser: that of a recorded run, and the live view."""
