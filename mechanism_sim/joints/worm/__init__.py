"""Worms and their wheels."""
