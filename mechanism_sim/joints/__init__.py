"""Joints: one folder a kind, with its keys, constraint, contacts, readings and theory."""
