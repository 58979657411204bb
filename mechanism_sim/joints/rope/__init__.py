"""Ropes over pulleys."""
