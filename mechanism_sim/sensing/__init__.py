"""Instruments: what a sensor on a machine reads."""
