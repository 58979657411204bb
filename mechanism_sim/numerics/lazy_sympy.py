"""heyoka without sympy, whose import takes twice the CPU time of all else of heyoka.

Only printed equations need sympy. heyoka looks its functions up while it is imported itself, and
calls them when it translates: meanwhile it has a stand-in, whose functions import sympy when they
are called. ``heyoka.to_sympy`` works as ever; who needs ``heyoka.from_sympy``, which compares
types, imports sympy or heyoka before this package.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any


class _Later:
    """Object of sympy, reached by a way of attributes (text) and calls (tuples of arguments)."""

    def __init__(self, *way: str | tuple[Any, ...]) -> None:
        self._way = way

    def __getattr__(self, name: str) -> _Later:
        if name.startswith('__'):  # sympy asks for marks of its own objects
            raise AttributeError(name)
        return _Later(*self._way, name)

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        if self._way == ('Function',):
            return _Later(*self._way, arguments)
        return self._sympy_()(*arguments, **options)

    def _sympy_(self) -> Any:
        """The object itself; sympy asks for it where a constant such as pi is an argument."""
        found: Any = import_module('sympy')
        for step in self._way:
            found = getattr(found, step) if isinstance(step, str) else found(*step)
        return found


class _Sympy(ModuleType):
    """Stands in for sympy."""

    def __getattr__(self, name: str) -> _Later:
        return _Later(name)


class _Finder(MetaPathFinder):
    """Finds heyoka, and gives it the stand-in while it is imported."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name != 'heyoka' or 'sympy' in sys.modules:
            return None
        spec, sympy = PathFinder.find_spec(name, path, target), PathFinder.find_spec('sympy')
        if spec is None or spec.loader is None or sympy is None:
            return None
        load = spec.loader.exec_module

        def exec_module(module: ModuleType) -> None:
            sys.modules['sympy'] = _Sympy('sympy')
            sys.modules['sympy'].__spec__ = sympy
            try:
                load(module)
            finally:
                del sys.modules['sympy']

        spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec


def postpone_sympy() -> None:
    """Let heyoka, imported from now on, import sympy when it is needed."""
    sys.meta_path.insert(0, _Finder())
