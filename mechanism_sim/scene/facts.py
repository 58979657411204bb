"""Facts of a key by its schema: unit, bounds, choices."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

from pydantic.fields import FieldInfo

from mechanism_sim.keys.quantities import Part, UnitValue

_BOUNDS = {'gt': '>', 'ge': '>=', 'lt': '<', 'le': '<='}


class Facts(NamedTuple):
    """Of one key.

    Attributes
    ----------
    part : the kind of part it holds, if it holds parts
    many : whether these are in a ``list``, or by name in a ``dict``
    quantities : what numbers it holds, in order
    bounds : in words
    choices : what may stand there, if little may
    """

    part: type[Part] | None
    many: Literal['', 'list', 'dict']
    quantities: tuple[UnitValue, ...]
    bounds: tuple[str, ...]
    choices: tuple[str, ...]

    def render(self) -> str:
        """Unit, bounds and choices, as in ``m, > 0``; empty if there is nothing to say."""
        units = dict.fromkeys(' or '.join(filter(None, q.units)) for q in self.quantities)
        text = ', '.join([*filter(None, units), *self.bounds])
        others = list(dict.fromkeys(q.other for q in self.quantities if q.other))
        *most, last = self.choices or others or ['']
        choices = f'{", ".join(most)} or {last}' if most else last if others else ''
        return f'{text} or {choices}' if text and choices else text or choices


def facts_of(field: FieldInfo) -> Facts:
    """Unit, bounds and choices of a field of a schema."""
    kinds, notes = [], []
    for kind, note in _walk(field.annotation, field.metadata):
        kinds.append(kind)
        notes.append(note)
    parts = [k for k in kinds if isinstance(k, type) and issubclass(k, Part)]
    several = {list, tuple, dict} & set(kinds)
    bounds = {
        sign: f'{getattr(note, name):g}'
        for note in notes
        for name, sign in _BOUNDS.items()
        if getattr(note, name, None) is not None and not several
    }
    whole = ['whole number'] if int in kinds and not several else []
    choices = [str(value) for k in kinds if get_origin(k) is Literal for value in get_args(k)]
    return Facts(
        parts[0] if parts else None,
        '' if not (parts and several) else 'dict' if dict in several else 'list',
        tuple(note for note in notes if isinstance(note, UnitValue)),
        (*whole, *_range(bounds)),
        (*choices, *(['true', 'false'] if bool in kinds else [])),
    )


def _range(bounds: Mapping[str, str]) -> list[str]:
    """Bounds in words."""
    if bounds.keys() == {'>=', '<='}:
        return [f'{bounds[">="]} to {bounds["<="]}']
    return [f'{sign} {bound}' for sign, bound in bounds.items()]


def _walk(kind: Any, notes: Iterable[Any] = ()) -> Iterator[tuple[Any, Any]]:
    """All types within a type, and what is noted on them."""
    for note in notes:
        if isinstance(note, FieldInfo):
            yield from ((None, inner) for inner in note.metadata)
        else:
            yield None, note
    if get_origin(kind) is Annotated:
        inner, *more = get_args(kind)
        yield from _walk(inner, more)
    elif get_origin(kind) is Literal:
        yield kind, None
    else:
        yield get_origin(kind) or kind, None
        for inner in get_args(kind):
            yield from _walk(inner)
