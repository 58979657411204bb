"""Quantities of a machine, a module for each of their sources.

Each has functions ``of_SOMETHING(machine)``, which `mechanism_sim.results.catalogue.SOURCES` lists
in the order of tables.
"""
