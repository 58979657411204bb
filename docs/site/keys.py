"""The reference of the keys of scenes and sweeps, generated from their schemas."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

from mechanism_sim.keys.quantities import Part, UnitValue, meanings
from mechanism_sim.scene.four_bar import FourBarScene, Link
from mechanism_sim.scene.schema import Scene
from mechanism_sim.studies.schema import SweepFile
from mechanism_sim.units import QuantityValue

PAGE = 'docs/keys'
TITLES = {
    Scene: 'A scene', FourBarScene: 'A four-bar', Link: 'Link of a four-bar', SweepFile: 'A sweep',
}  # fmt: skip
BOUNDS = {'gt': '> {}', 'ge': '>= {}', 'lt': '< {}', 'le': '<= {}'}


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx: the tables are appended to their page."""
    app.connect('source-read', _append)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _append(_app: Any, page: str, source: list[str]) -> None:
    if page == PAGE:
        source[0] += reference()


def reference() -> str:
    """All parts of scenes and sweeps as Markdown, a section each."""
    return ''.join(_section(part) for part in parts())


def parts() -> list[type[Part]]:
    """Every part that a scene or a sweep may hold, the scene itself first."""
    found: list[type[Part]] = []
    waiting: list[type[Part]] = [Scene, FourBarScene, SweepFile]
    while waiting:
        part = waiting.pop(0)
        if part not in found:
            found.append(part)
            for field in part.model_fields.values():
                waiting += [x for x in _atoms(field.annotation) if _is_part(x)]
    return found


def title(part: type[Part]) -> str:
    """Title of the section of a part."""
    return TITLES.get(part, part.__name__.removesuffix('Part'))


def _section(part: type[Part]) -> str:
    lines = ['', f'## {title(part)}', '', _text(part), '']
    groups = [c for c in part.__mro__ if issubclass(c, Part) and inspect.get_annotations(c)]
    several = part.__name__ in ('JointPart', 'SensorPart')  # of kinds, each with keys of its own
    for group in reversed(groups) if several else [part]:
        own = inspect.get_annotations(group)
        names = [n for n in part.model_fields if not several or n in own]
        if not names:
            continue
        if several:
            lines += [f'**{_text(group)}**', '']
        lines += ['| key | value | default | meaning |', '|---|---|---|---|']
        lines += [_row(part, name) for name in names] + ['']
    return '\n'.join(lines)


def _text(part: type[Part]) -> str:
    return inspect.cleandoc(part.__doc__ or '').split('\n\n')[0].replace('\n', ' ')


def _row(part: type[Part], name: str) -> str:
    field = part.model_fields[name]
    key = field.alias or name
    default = '' if field.is_required() else _default(field.get_default(call_default_factory=True))
    default = 'required' if field.is_required() else default
    meaning = ' '.join(meanings(part)[key].split())
    value = ', '.join(dict.fromkeys([*_values(field.annotation), *_values_of(field.metadata)]))
    return f'| `{key}` | {_cell(value)} | {default} | {_cell(meaning)} |'


def _default(value: Any) -> str:
    if value is None or isinstance(value, Part) or value in ({}, (), ''):
        return ''
    if isinstance(value, QuantityValue):
        return f'`{value.value:g}`'
    if isinstance(value, tuple):
        return f'`[{", ".join(map(str, value))}]`'
    return f'`{str(value).lower() if isinstance(value, bool) else value}`'


def _values(annotation: Any) -> Iterator[str]:
    """Description of the values allowed for a key."""
    for atom in _atoms(annotation):
        if isinstance(atom, str):
            yield f'`{atom}`'
        elif _is_part(atom):
            yield f'[{title(atom)}](#{title(atom).lower().replace(" ", "-")})'
        elif atom is bool:
            yield '`true`, `false`'
        elif atom is str:
            yield 'text'
        elif atom is int:
            yield 'whole number'
        else:
            yield from _values_of([atom])


def _values_of(metadata: list[Any]) -> Iterator[str]:
    for it in metadata:
        if isinstance(it, UnitValue):
            yield ' or '.join(unit or 'number' for unit in it.units)
            if it.other:
                yield it.other
        for name, text in BOUNDS.items():
            bound = getattr(it, name, None)
            if bound is not None:
                yield text.format(f'{bound:g}' if isinstance(bound, float) else bound)
        yield from _values_of(getattr(it, 'metadata', None) or [])


def _atoms(annotation: Any) -> Iterator[Any]:
    """Parts of an annotation: classes, literals, and notes such as units and bounds."""
    if get_origin(annotation) is Literal:
        yield from (a for a in get_args(annotation) if isinstance(a, str))
        return
    inner = [a for a in get_args(annotation) if a is not type(None) and a is not Ellipsis]
    if not inner:
        yield annotation
    for a in inner[1:] if get_origin(annotation) is dict else inner:  # names are free
        yield from _atoms(a)
    yield from getattr(annotation, '__metadata__', ())


def _is_part(it: Any) -> bool:
    return isinstance(it, type) and issubclass(it, Part)


def _cell(text: str) -> str:
    for mark, escaped in (('|', '\\|'), ('<', '\\<'), ('``', '`')):
        text = text.replace(mark, escaped)
    return text
