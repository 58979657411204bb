"""Machines from files of other programs, a module for each format."""

from mechanism_sim.imports.formats import Imported, import_machine, is_importable

__all__ = ['Imported', 'import_machine', 'is_importable']
