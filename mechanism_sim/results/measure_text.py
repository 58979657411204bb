"""Measures in text: ``largest(reaction.pin)``, ``rms(motor.torque, from 2 s)``.

A measure is an expression (`mechanism_sim.numerics.expressions`) of figures, and a figure is a
function of an expression: of what is known at every instant (`OVER_TIME`), or of every event or
sample (`_OF_EVENTS`). After the expression there may stand ``from TIME``, ``to TIME`` and
``per revolution``, where a time is in seconds or in revolutions.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, quoted
from mechanism_sim.numerics import expressions
from mechanism_sim.numerics.expressions import ExpressionNode
from mechanism_sim.results.path_distance import TargetPath, names_of, read_path
from mechanism_sim.scene.table_keys import allowed_file
from mechanism_sim.units import to_si

EXTREMES = 'highest', 'lowest', 'largest', 'range'
OVER_TIME = (
    *EXTREMES, 'mean', 'rms', 'percentile', 'integral', 'share', 'change', 'initial', 'final',
    'work', 'distance', 'largest_distance',
)  # fmt: skip
_DISTANCES = 'distance', 'largest_distance'
"""Distances of a path from points of a file: root mean square, and largest."""
INDICATORS = 'crest', 'kurtosis', 'skewness'
"""Indicators of `sensing.indicators`."""
_OF_EVENTS = 'count', 'sum', *INDICATORS
FUNCTIONS = *OVER_TIME, *_OF_EVENTS
"""Functions of a figure."""

ALIASES = {
    **dict.fromkeys(('max', 'maximum', 'greatest'), 'highest'),
    **dict.fromkeys(('min', 'minimum', 'least'), 'lowest'), 'average': 'mean',
    'crest_factor': 'crest',
}  # fmt: skip
"""Other names of them that are understood; max and min of one expression only."""

_EVENTS_TOO = {*EXTREMES, 'mean', 'rms', 'percentile', *_OF_EVENTS}
SERIES = 'impacts', 'losses', 'modes', 'sensors'
"""First words of names of events and samples."""

_TIME = re.compile(r'([\d_]*\.?\d*(?:[eE][-+]?\d+)?)\s*(\w*)')


class Bound(NamedTuple):
    """A time: [s], or revolutions of the drive since the start of the run."""

    value: float
    revolutions: bool = False


@dataclass(frozen=True)
class Figure:
    """A function of an expression."""

    function: str  #: one of `FUNCTIONS`
    argument: str  #: the expression, as text
    names: tuple[str, ...]  #: dotted names in the expression
    percent: float | None  #: percentage of a percentile
    #: window; None for that of the run
    since: Bound | None
    until: Bound | None
    per_revolution: bool  #: True if it is the mean over whole revolutions of the figure in each
    tree: ExpressionNode = field(compare=False, repr=False)  #: tree of the expression
    path: TargetPath | None = None  #: points of the file of a distance

    @property
    def of_events(self) -> bool:
        """True for a figure of events or samples."""
        return any(name.partition('.')[0] in SERIES for name in self.names)

    @cached_property
    def steep(self) -> list[tuple[str, ExpressionNode]]:
        """Functions whose peaks may be narrower than those of the motion, innermost first.

        Names and arguments of exp and tanh; divisors that vary, those of tan and of the slope of
        atan among them, as 'over'.
        A log goes to its pole so slowly that it is seen from afar.
        """
        found: list[tuple[str, ExpressionNode]] = []
        for node in self.tree.walk():
            match node.name if node.kind == 'call' else node.kind:
                case 'exp' | 'tanh' as name:
                    found.append((name, node.args[0]))
                case '/':
                    found.append(('over', node.args[1]))
                case 'tan':
                    found.append(('over', ExpressionNode('call', node.args, 'cos')))
                case 'atan':
                    one = ExpressionNode('number', value=1.0)
                    square = ExpressionNode('*', (*node.args, *node.args))
                    found.append(('over', ExpressionNode('+', (one, square))))
        return [(name, x) for name, x in found if x.names]

    @cached_property
    def compared(self) -> list[ExpressionNode]:
        """Left less right side of every comparison, on whose signs the expression depends."""
        found = [n.args for n in self.tree.walk() if n.kind == 'compare']
        return [ExpressionNode('-', pair) for sides in found for pair in pairwise(sides)]

    @cached_property
    def corners(self) -> list[ExpressionNode]:
        """Expressions at whose zeros this one has a corner, or jumps."""
        calls = [n for n in self.tree.walk() if n.kind == 'call']
        found = [n.args[0] for n in calls if n.name in ('abs', 'sign')]
        found += [ExpressionNode('-', n.args) for n in calls if n.name in ('min', 'max')]
        return [node for node in [*found, *self.compared] if node.names]

    def unit(self, units: Mapping[str, str]) -> str:
        """The SI unit of the expression, by those of its names."""
        return expressions.unit_of(self.tree, units, self.argument) or ''


@dataclass(frozen=True)
class Measure:
    """A measure as it is written."""

    name: str  #: name of the column; by default the text
    text: str  #: text as written
    _tree: ExpressionNode
    figures: tuple[Figure, ...]

    def value(self, found: Callable[[Figure], float]) -> float:
        """The measure, by the values of its figures."""
        known = {k: found(f) for k, f in enumerate(self.figures)}
        return float(expressions.numbers(self._tree, known))

    def unit(self, found: Callable[[Figure], str]) -> str:
        """SI unit of the measure, from those of its figures."""
        units = {k: found(f) for k, f in enumerate(self.figures)}
        return expressions.unit_of(self._tree, units, self.text) or ''


def read(text: str, name: str = '') -> Measure:
    """Measure from its text."""
    tree = expressions.parse(text, figures={**{f: f for f in FUNCTIONS}, **ALIASES})
    figures = [n for n in tree.walk() if n.kind == 'figure']
    inside = {id(x) for figure in figures for x in figure.walk()}
    for node in tree.walk():
        if node.kind == 'name' and id(node) not in inside:
            hint = (
                expressions.unit_hint(node.name) or f": write for example 'largest({node.name})'"
            )
            known = f'functions: {", ".join(FUNCTIONS)}'
            raise InputError(f"'{node.name}' in {quoted(text)} is not a measure{hint}; {known}")
    if not figures:
        raise InputError(f'{quoted(text)} has no measure; functions: {", ".join(FUNCTIONS)}')
    short = ' '.join(text.split())
    return Measure(name or short, short, tree, tuple(_figure(n, text) for n in figures))


def read_all(given: dict[str, str] | list[str] | tuple[str, ...], where: str) -> list[Measure]:
    """Measures by name, or a list of texts ``NAME = TEXT`` or ``TEXT``."""
    pairs = [*given.items()] if isinstance(given, dict) else [_named(text) for text in given]
    found = []
    for name, text in pairs:
        try:
            found.append(read(str(text), name))
        except InputError as error:
            raise InputError(f'{where}{f".{name}" if name else ""}: {error}') from error
        if [m.name for m in found].count(found[-1].name) > 1:
            raise InputError(f"{where}: there are two measures '{found[-1].name}'")
    return found


def _named(text: str) -> tuple[str, str]:
    named = expressions.sides(text)
    return (named[0], named[2]) if named and named[0].isidentifier() else ('', text)


def _figure(node: ExpressionNode, text: str) -> Figure:
    function, places = node.name, 2 if node.name in ('percentile', *_DISTANCES) else 1
    if len(node.args) != places:
        second = '' if places == 1 else ', PERCENT' if node.name == 'percentile' else ', FILE.csv'
        form = f'{function}(EXPRESSION{second})'
        raise InputError(f'{function} in {quoted(text)} must be of the form {form}')
    given = dict(node.window)
    if len(given) < len(node.window):
        raise InputError(expressions.AFTER.format(quoted(text)))
    if given.get('per') not in (None, 'revolution'):
        raise InputError(f"'per {given['per']}' in {quoted(text)}: it may be per revolution only")
    argument, percent, path = node.args[0], None, None
    if function == 'percentile':
        percent = node.args[1].value
        if node.args[1].kind != 'number' or node.args[1].unit is not None or not percent <= 100.0:
            raise InputError(
                f'percentile in {quoted(text)} needs a number from 0 to 100 as its second'
            )
    names = tuple(argument.names)
    if function in _DISTANCES:
        path = read_path(allowed_file('distance', Path.cwd(), node.args[1].text), 'distance')
        names = names_of(argument.text, path)
        argument = replace(argument, kind='name', args=(), name=names[0])
    since, until = (_bound(given.get(key), text) for key in ('from', 'to'))
    if since and until and since.revolutions == until.revolutions and since.value >= until.value:
        raise InputError(
            f"the window 'from {given['from']} to {given['to']}' in {quoted(text)} ends "
            'before it begins'
        )
    figure = Figure(
        function, argument.text, names, percent, since, until, 'per' in given, argument, path
    )
    of_events = figure.of_events
    kinds = {tuple(n.split('.')[:2]) for n in names}  # ``impacts.JOINT.KEY`` is of impacts.JOINT
    if of_events and (len(kinds) > 1 or function not in _EVENTS_TOO):
        raise InputError(
            f'{function} in {quoted(text)} must be of one kind of events or samples, and events '
            f'have {", ".join(sorted(_EVENTS_TOO))}'
        )
    if not of_events and function in _OF_EVENTS:
        raise InputError(
            f'{function} in {quoted(text)} must be of events or samples, as in '
            "'count(impacts.JOINT)' or 'kurtosis(sensors.NAME)'"
        )
    if not names:
        raise InputError(f'{function} in {quoted(text)} names no quantity')
    return figure


def _bound(text: str | None, where: str) -> Bound | None:
    if text is None:
        return None
    match = _TIME.fullmatch(text)
    if match and match[2] in ('rev', 'revolution', 'revolutions'):
        turns = float(match[1])
        if not turns <= expressions.LARGEST:
            most = f'{expressions.LARGEST:g}'
            raise InputError(f'the time {quoted(text)} is larger than {most} turns')
        return Bound(turns, True)
    if match and match[2]:
        try:
            return Bound(to_si(text, 's'))
        except ValueError as error:
            raise InputError(f"the time '{text}' in {quoted(where)} {error}") from error
    raise InputError(
        f"the time '{text}' in {quoted(where)} needs a unit: write for example '2 s' or "
        "'3 revolutions'"
    )


def as_row(x: Any, count: int) -> Array:
    """Values (count,) of an array or a single number."""
    return np.broadcast_to(np.asarray(x, float), (count,))
