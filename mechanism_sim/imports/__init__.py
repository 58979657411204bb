"""Machines from files of other programs: each format a file of this room."""

from mechanism_sim.imports.formats import Imported, import_machine, is_importable

__all__ = ['Imported', 'import_machine', 'is_importable']
