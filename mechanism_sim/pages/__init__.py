"""What a browser shows of a machine: the page of a recorded run, and the live view."""
