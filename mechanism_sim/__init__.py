"""Simulator of real (loose, rattling, vibrating) planar machines."""
