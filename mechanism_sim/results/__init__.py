"""Runs, and what can be told of them by name."""
