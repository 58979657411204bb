"""Studies by many runs of a machine."""
