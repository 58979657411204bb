"""Reproduction of the thesis [SB]: parts that nothing else asks for.

Its experiment (chapters 7 and 8) on recorded runs, the reconstruction of angular motion from its
sensors, criteria of contact loss (3.5) beside what happens, and the search for a start (6.1).
"""
