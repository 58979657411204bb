"""Kinds of joints, loads and sensors, each in a file of its own that registers it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from pkgutil import iter_modules
from typing import TypeVar

Kind = TypeVar('Kind')


class Registry(dict[str, Kind]):
    """Kinds by name, in alphabetical order."""

    def add(self, name: str) -> Callable[[Kind], Kind]:
        """Register a class of keys under the name of its kind."""

        def known(keys: Kind) -> Kind:
            self[name] = keys
            return keys

        return known

    def load(
        self, package: str, path: Iterable[str], module: str = '', *, backwards: bool = False
    ) -> None:
        """Import files of a package, or `module` of its folders, which register kinds."""
        for found in iter_modules(path):
            if found.ispkg or not module:
                import_module('.'.join(filter(None, (package, found.name, module))))
        for name in sorted(self, reverse=backwards):
            self[name] = self.pop(name)
