"""Quantities that a machine can tell, a module for each of their sources.

Each has a function ``quantities(machine)``; `SOURCES` lists them in the order of tables.
"""
