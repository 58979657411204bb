"""Studies: what takes many runs of a machine to say."""
