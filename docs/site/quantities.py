"""The reference of quantities: the kinds in machines of the package."""

from __future__ import annotations

from typing import Any

from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.quantity import Quantity
from mechanism_sim.scene import load_scene, scene_names

PAGE = 'docs/quantities'


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx: the table is appended to its page."""
    app.connect('source-read', _append)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _append(_app: Any, page: str, source: list[str]) -> None:
    if page == PAGE:
        source[0] += table()


def table() -> str:
    """Table with a row for each kind of quantity: an example and its scene."""
    found: dict[tuple[str, str, int], tuple[Quantity, str]] = {}
    units: dict[tuple[str, str, int], dict[str, None]] = {}
    for scene in scene_names():
        for quantity in catalogue(load_scene(scene)).values():
            part = 'x' if quantity.part == 'y' else quantity.part
            key = quantity.kind, part, quantity.name.count('.')
            found.setdefault(key, (quantity, scene))
            units.setdefault(key, {})[quantity.unit] = None
    rows = []
    for key, (quantity, scene) in sorted(found.items()):
        unit, name, words = (
            ' or '.join(filter(None, units[key])),
            f'`{quantity.name}`',
            quantity.words,
        )
        if quantity.part == 'x':
            name, words = f'{name}, `.y`', words.removesuffix(', x')
        rows.append(f'| {name} | {unit} | {words} | {scene} |')
    return '\n'.join(['| for example | unit | | of scene |', '|---|---|---|---|', *rows, ''])
