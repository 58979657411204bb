"""Welds."""
