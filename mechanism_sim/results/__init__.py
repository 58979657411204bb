"""Runs, and the quantities to be had of them by name."""
