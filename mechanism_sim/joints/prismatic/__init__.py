"""Prismatic joints: a block in its guide."""
