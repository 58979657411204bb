"""One cycle of a machine: everything over a turn of its drive, extremes, means, strokes."""
