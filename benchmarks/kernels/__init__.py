"""Compiled code of the peers; importing a module of it needs numba."""
