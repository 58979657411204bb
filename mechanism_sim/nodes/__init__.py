"""The simulation service: one file per node, thin; nodes know topics, not middleware."""
