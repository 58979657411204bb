"""Freewheels and ratchets."""
