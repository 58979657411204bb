"""Tests, the hard cases and the grid of random machines; not installed.

A package so that ``python -m test.hard`` and ``python -m test.grid`` find it from the root of the
repository, where the one of that name in Python's own library would be found otherwise.
"""
