"""A scene written out for people, or begun from another: keys with meaning, unit and default."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field, TypeAdapter

from mechanism_sim import output
from mechanism_sim.documents import flow
from mechanism_sim.errors import InputError
from mechanism_sim.joints.joint_keys import JointKeys, keys_of
from mechanism_sim.keys.quantities import Part, meanings
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.build import build
from mechanism_sim.scene.facts import Facts, as_written, facts_of
from mechanism_sim.scene.files import (
    as_given,
    check_scene,
    content_of,
    find_scene,
    overridden,
    titled,
)
from mechanism_sim.scene.four_bar import FourBarScene
from mechanism_sim.scene.schema import AnyScene, LinkPart, Scene

TEMPLATES = {'four_bar': 'four_bar_clearance', 'linkage': 'slider_crank_engine'}
"""The scenes that show the two forms of scenes, by the names of the forms."""

SCHEMA = 'mechanism_sim.schema.json'
"""Schema that editors read, if it lies beside the scene."""
WIDTH, COLUMN = 99, 40
"""Width of the file, and column of comments."""

_UNBROKEN = '\N{NO-BREAK SPACE}'

HEAD = """\
# A key behind a # shows its default; remove the # to change it. A key without a value
# has no default, or keys of its own; the required ones of these must be filled in.
# Quantities take any unit, as 64 mm or 2.5 inch; without one they are in that in brackets.
"""


class Entry(NamedTuple):
    """A line of YAML, and its comment."""

    text: str
    note: str = ''


def commented(data: Mapping[str, Any], scene: AnyScene) -> str:
    """A scene with comments, as text of a YAML file.

    Every key is explained where it comes first; keys that are not given stand behind a ``#`` with
    what holds without them, so that to uncomment them changes nothing.

    Parameters
    ----------
    data : keys and values as a file gives them
    scene : checked scene
    """
    lines = _SceneWriter(_parts_in(scene)).part(type(scene), data, scene)
    return HEAD + '\n' + '\n'.join(row for line in lines for row in _rows(line)) + '\n'


@dataclass
class _SceneWriter:
    given: set[type[Part]]
    """Parts that are in the file, so that there is a better place to explain them."""
    told: set[tuple[type[Part], str]] = field(default_factory=set)

    def part(self, kind: type[Part], data: Mapping[str, Any], value: Part) -> Iterator[Entry]:
        """All keys of a part that is in the file."""
        for key in _keys(kind, value):
            about = kind.model_fields[key]
            name, facts = about.alias or key, facts_of(about)
            new = (kind, key) not in self.told
            note = _note(meanings(kind)[name], facts) if new else ''
            self.told.add((kind, key))
            if data.get(name) is not None:
                yield from self.present(name, data[name], getattr(value, key), facts, note)
            elif new:
                yield from self.absent(name, getattr(value, key), facts, note)

    def present(
        self, name: str, data: Any, value: Any, facts: Facts, note: str
    ) -> Iterator[Entry]:
        """A key that is in the file."""
        inner: list[Entry]
        if facts.part is None or not isinstance(data, Mapping | list) or not data:
            yield from _entry(name, data, note)
            return
        if facts.many == 'dict' and isinstance(data, Mapping):
            inner = [
                line for key, item in data.items() for line in self.named(key, item, value[key])
            ]
        elif facts.many == 'list':
            inner = [
                line
                for item, found in zip(data, value, strict=True)
                for line in self.item(item, facts.part, found)
            ]
        else:
            yield from self.named(name, data, value, note)
            return
        yield Entry(f'{name}:', note)
        yield from _indented(inner)

    def named(self, name: str, data: Any, value: Part, note: str = '') -> Iterator[Entry]:
        """A part with its name; in one line if it has no comment."""
        data = data or {}
        frame = name == GROUND and isinstance(value, LinkPart)  # most keys are for what moves
        inner = (
            [line for key, item in data.items() for line in _entry(key, item, '')]
            if frame
            else list(self.part(type(value), data, value))
        )
        short = f'{name}: {flow(data)}'
        if not any(line.note for line in inner) and len(short) < WIDTH - 8:
            yield Entry(short, note)
        else:
            yield Entry(f'{name}:', note)
            yield from _indented(inner)

    def item(self, data: Any, kind: type[Part], value: Part) -> Iterator[Entry]:
        """A part in a list."""
        inner = list(self.part(kind, data, value))
        if not any(line.note for line in inner):
            inner = [Entry(flow(data))]
        first, *rest = inner
        yield Entry(f'- {first.text}', first.note)
        yield from _indented(rest)

    def absent(self, name: str, value: Any, facts: Facts, note: str) -> Iterator[Entry]:
        """A key that is not in the file, behind a ``#``."""
        for line in self.example(name, value, facts, note):
            yield Entry(f'# {line.text}', line.note)

    def example(self, name: str, value: Any, facts: Facts, note: str) -> Iterator[Entry]:
        """A key that could be in the file, and what holds without it."""
        if facts.part is None:
            yield from _entry(name, as_written(value, facts), note)
            return
        if isinstance(value, Part) and value != facts.part():  # what an instrument stands for
            yield from _entry(name, as_written(value, every=True), note)
            return
        yield Entry(f'{name}:', note)
        if facts.part in self.given:
            return
        inner = self.keys(facts.part, value if isinstance(value, Part) else None)
        if facts.many == 'dict':
            inner = iter([Entry('NAME:'), *_indented(inner)])
        elif facts.many == 'list':
            inner = (
                Entry(('  ' if i else '- ') + line.text, line.note) for i, line in enumerate(inner)
            )
        yield from _indented(inner)

    def keys(self, kind: type[Part], value: Part | None) -> Iterator[Entry]:
        """All keys of a part that could be in the file, where they come first."""
        for key, about in kind.model_fields.items():
            if (kind, key) in self.told:
                continue
            self.told.add((kind, key))
            facts = facts_of(about)
            found = about.get_default(call_default_factory=True) if value is None else None
            if value is not None:
                found = getattr(value, key)
            elif about.is_required():
                found = None
            name = about.alias or key
            note = _note(meanings(kind)[name], facts, about.is_required())
            yield from self.example(name, found, facts, note)


def _keys(kind: type[Part], value: Part) -> Iterable[str]:
    """The keys that have a meaning here: what a part adds to its bases first, but titles."""
    if isinstance(value, JointKeys):
        return keys_of(value)
    own = [key for key in kind.__annotations__ if key in kind.model_fields]
    order = [key for key in ('title', 'description') if key in kind.model_fields]
    return dict.fromkeys([*order, *own, *kind.model_fields])


def _parts_in(value: Any) -> set[type[Part]]:
    """The kinds of the given parts."""
    if isinstance(value, Part):
        inner = [getattr(value, key) for key in value.model_fields_set]
        return {type(value)}.union(*map(_parts_in, inner))
    if isinstance(value, dict):
        value = tuple(value.values())
    return set().union(*map(_parts_in, value)) if isinstance(value, tuple | list) else set()


def _note(meaning: str, facts: Facts, needed: bool = False) -> str:
    """A meaning, its unit or choices in brackets, and whether the key must be there."""
    about = '; '.join(filter(None, [facts.render(), 'needed' if needed else '']))
    if len(about) < WIDTH - COLUMN - 4:
        about = about.replace(' ', _UNBROKEN)
    return f'{meaning.rstrip(".")} [{about}]' if about else meaning.rstrip('.')


def _entry(name: str, data: Any, note: str) -> Iterator[Entry]:
    """A key and a plain value; a long text in several lines."""
    body = data.removesuffix('\n') if isinstance(data, str) else ''
    if (body != data or len(body) > WIDTH) and body and ' '.join(body.split()) == body:
        yield Entry(f'{name}: {">-" if body == data else ">"}', note)
        # a break stands for a space, and may be nowhere else
        lines = textwrap.wrap(body, WIDTH - 3, break_long_words=False, break_on_hyphens=False)
        yield from _indented(map(Entry, lines))
        return
    text = f'{name}: {flow(data)}'.rstrip()
    if len(text) < WIDTH or not isinstance(data, list | dict):
        yield Entry(text, note)
        return
    yield Entry(f'{name}:', note)
    rows = data.items() if isinstance(data, dict) else data
    yield from _indented(
        Entry(f'{row[0]}: {flow(row[1])}' if isinstance(data, dict) else f'- {flow(row)}')
        for row in rows
    )


def _indented(lines: Iterable[Entry]) -> Iterator[Entry]:
    return (Entry(f'  {line.text}', line.note) for line in lines)


def _rows(line: Entry) -> Iterator[str]:
    """A line, and its note beside it or, without room, below."""
    if not line.note:
        yield line.text
        return
    rows = textwrap.wrap(line.note, WIDTH - COLUMN - 2)
    notes = [f'# {row.replace(_UNBROKEN, " ")}' for row in rows]
    if len(line.text) + 2 > COLUMN:
        yield line.text
    else:
        yield f'{line.text:{COLUMN}}{notes.pop(0)}'
    yield from (' ' * COLUMN + note for note in notes)


def json_schema() -> dict[str, Any]:
    """JSON schema of scenes, which editors read."""
    either = Annotated[FourBarScene | Scene, Field(discriminator='mechanism')]
    schema: dict[str, Any] = TypeAdapter[Any](either).json_schema()
    return {'$schema': 'https://json-schema.org/draft/2020-12/schema', **schema}


def new_scene(name: str, source: str, overrides: Mapping[str, Any] | Iterable[str] = ()) -> Path:
    """Write a commented scene; returns its path.

    Parameters
    ----------
    name : name of the scene; its file is ``NAME.yaml``, in an existing folder
    source : a scene of the package or a path
    overrides : values by dotted path, or texts ``path=value``
    """
    file = Path(name if name.endswith(('.yaml', '.yml')) else f'{name}.yaml')
    if file.stem.startswith('.') or not Path(name).name or name.endswith('/'):
        raise InputError(f"'{name}' is not a scene name: write for example my_machine")
    with output.errors_as_sentences(file):
        there = file.exists()
    if there:
        raise InputError(f"'{file}' exists already; choose another name")
    overrides = overrides if isinstance(overrides, Mapping) else [*overrides]
    path = find_scene(source)
    source_data = content_of(path, overrides=overrides).data
    data = overridden(path.name, source_data, overrides, path.parent)
    if data.get('title') == source_data.get('title'):
        data = titled(file.name, {k: x for k, x in data.items() if k != 'title'})
    build(path.stem, check_scene(path.name, data))
    text = commented(data, as_given(path.name, data))
    if (file.parent / SCHEMA).is_file():
        text = f'# yaml-language-server: $schema={SCHEMA}\n{text}'
    output.write_text(file, text)
    return file
