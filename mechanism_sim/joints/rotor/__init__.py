"""Shafts that give way."""
