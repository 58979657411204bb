"""Belts and chains."""
