"""Reproduction of the thesis [SB], used by nothing else in the package.

Its experiment (chapters 7 and 8) on recorded runs, the reconstruction of angular motion from its
sensors, criteria of contact loss (3.5) beside simulated losses, search for a start (6.1).
"""
