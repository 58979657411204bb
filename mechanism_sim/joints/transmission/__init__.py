"""Two links whose angles keep a ratio."""
