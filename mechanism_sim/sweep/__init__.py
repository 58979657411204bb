"""Sweeps: many runs of scenes that differ in a few values, as one table with a row for each."""
