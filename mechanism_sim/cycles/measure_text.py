"""The language of measures: ``largest(reaction.pin)``, ``rms(motor.torque, from 2 s)``.

A measure is arithmetic on figures, and a figure is a function of an expression: of what is known
at every instant (`OVER_TIME`), or of every event or sample (`OF_EVENTS`). Expressions are those of
formulas of loads, with dotted names, conditions as numbers 0 and 1, and quantities with their
units; a bare number is in SI units. After the expression there may stand ``from TIME``,
``to TIME`` and ``per revolution``, where a time is in seconds or in revolutions.

Nothing is executed: the text is read by `mechanism_sim.numerics.formula.parse`.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest, quoted
from mechanism_sim.numerics import formula
from mechanism_sim.units import COMMON, alike, product, read_common, to_si

OVER_TIME = {
    'highest': 'greatest value',
    'lowest': 'least value',
    'largest': 'greatest size, without sign',
    'range': 'greatest less least value',
    'mean': 'mean over time, or over events',
    'rms': 'root of the mean square',
    'percentile': 'value that p percent of the time, or of the events, do not exceed: (X, p)',
    'integral': 'over time',
    'share': 'share of the time in which a condition holds',
    'change': 'value at the end less that at the beginning',
    'initial': 'value at the beginning',
    'final': 'value at the end',
    'work': 'of drive_torque or drive_torque.COORDINATE: integral of its power',
}
OF_EVENTS = {
    'count': 'how many events there are, or for how many a condition holds',
    'sum': 'over events',
}
FUNCTIONS = {**OVER_TIME, **OF_EVENTS}
"""Functions that make a figure, and what it is."""

EXTREMES = 'highest', 'lowest', 'largest', 'range'
_EVENTS_TOO = {*EXTREMES, 'mean', 'rms', 'percentile', *OF_EVENTS}
SERIES = 'impacts', 'losses', 'modes', 'sensors'
"""First words of names of events and samples."""

_NUMBER = r'\d+\.?\d*(?:[eE][-+]?\d+)?'
_ONE = rf'(?:{"|".join(sorted(COMMON, key=len, reverse=True))})(?![A-Za-z_(.])(?:\^-?\d)?'
_QUANTITY = re.compile(rf'(?<![\w.])({_NUMBER})\s*((?:{_ONE})(?:(?:\s*/\s*|\s+){_ONE})*)')
_TIME = rf'({_NUMBER}\s*[A-Za-z]*)'
_WINDOW = re.compile(
    rf',\s*(?:from\s+{_TIME}\s*(?:,?\s*to\s+{_TIME})?|to\s+{_TIME}|per\s+(\w+))\s*(?=[,)])'
)
_SMOOTH: dict[str, Callable[[Any], Any]] = {name: getattr(np, name) for name in formula.FUNCTIONS}
_KNOWN = (*formula.FUNCTIONS, *formula.CORNERED, 'hypot')
_COMPARE: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Gt: np.greater, ast.GtE: np.greater_equal, ast.Lt: np.less, ast.LtE: np.less_equal,
}  # fmt: skip


class Value(NamedTuple):
    """What an expression is: a number or an array, and its SI unit; `bare` numbers fit any."""

    x: Any
    unit: str = ''
    bare: bool = False


class Bound(NamedTuple):
    """A time: [s], or in revolutions of the drive from the start of the run."""

    value: float
    revolutions: bool = False


@dataclass(frozen=True)
class Figure:
    """A function of an expression.

    Attributes
    ----------
    function : one of `FUNCTIONS`
    argument : the expression, as text
    names : the dotted names in it
    percent : of a percentile
    since, until : the window; none is that of the run
    per_revolution : mean over whole revolutions of the figure in each
    """

    function: str
    argument: str
    names: tuple[str, ...]
    percent: float | None = None
    since: Bound | None = None
    until: Bound | None = None
    per_revolution: bool = False

    @property
    def of_events(self) -> bool:
        """Whether it is of events or samples."""
        return any(name.partition('.')[0] in SERIES for name in self.names)

    @cached_property
    def steep(self) -> list[tuple[str, ast.expr]]:
        """What may make peaks that are narrower than those of the motion, innermost first.

        Names and arguments of exp and tanh, and divisors that vary, as 'over'.
        """
        found: list[tuple[str, ast.expr]] = []

        def walk(node: ast.AST) -> None:
            for child in ast.iter_child_nodes(node):
                walk(child)
            match node:
                case ast.Call(func=ast.Name(id='exp' | 'tanh' as name), args=[x]):
                    found.append((name, x))
                case ast.BinOp(op=ast.Div(), right=x):
                    found.append(('over', x))

        walk(ast.parse(self.argument, mode='eval'))
        return [(name, x) for name, x in found if any(_names(x))]

    def evaluate(self, value_of: Callable[[str], Value]) -> Value:
        """The expression, by what its names stand for."""
        return evaluate(ast.parse(self.argument, mode='eval').body, value_of, self.argument)

    @property
    def _compared(self) -> list[tuple[ast.expr, ast.expr]]:
        """Both sides of every comparison in the expression."""
        nodes = ast.walk(ast.parse(self.argument, mode='eval'))
        found = [(n.left, *n.comparators) for n in nodes if isinstance(n, ast.Compare)]
        return [pair for sides in found for pair in pairwise(sides)]

    @property
    def comparisons(self) -> int:
        """How many comparisons there are in the expression."""
        return len(self._compared)

    def difference(self, i: int) -> ast.expr:
        """The left less the right side of a comparison, whose sign it depends on."""
        left, right = self._compared[i]
        return ast.BinOp(left, ast.Sub(), right)


@dataclass(frozen=True)
class Measure:
    """A measure as it is written.

    Attributes
    ----------
    name : of a column; the text if it has none
    text : as it is written
    """

    name: str
    text: str
    _tree: ast.expr
    figures: tuple[Figure, ...]

    def value(self, found: Callable[[Figure], Value]) -> Value:
        """The measure, by the values of its figures."""
        return evaluate(self._tree, lambda key: found(self.figures[int(key[1:])]), self.text)


def read(text: str, name: str = '') -> Measure:
    """A measure as people write it."""
    times: list[str] = []
    words = _WINDOW.sub(lambda match: _as_keywords(match, times), text)
    words = _QUANTITY.sub(lambda m: f"_quantity('{m[1]} {' '.join(m[2].split())}')", words)
    try:
        tree = formula.parse(words.strip())
    except ValueError as error:
        said = str(error).replace(quoted(words.strip()), quoted(text))
        raise InputError(
            f"{said}: write FUNCTION(EXPRESSION), as in 'largest(reaction.pin)' or "
            "'rms(drive_torque, from 2 s)'"
        ) from error
    figures: list[Figure] = []

    def taken(node: ast.expr) -> ast.expr:
        """The tree with a name instead of each figure."""
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if node.func.id in FUNCTIONS:
                figures.append(_figure(node, text, times))
                return ast.Name(f'_{len(figures) - 1}')
            if node.func.id not in _KNOWN and node.func.id != '_quantity':
                raise InputError(
                    f"'{node.func.id}' in {quoted(text)} is not a function known here"
                    f'{nearest(node.func.id, [*FUNCTIONS, *_KNOWN])}; functions: '
                    f'{", ".join(FUNCTIONS)}'
                )
            if node.func.id == '_quantity':
                return node
            return ast.Call(node.func, [taken(x) for x in node.args], [])
        if isinstance(node, ast.BinOp):
            return ast.BinOp(taken(node.left), node.op, taken(node.right))
        if isinstance(node, ast.UnaryOp):
            return ast.UnaryOp(node.op, taken(node.operand))
        if isinstance(node, ast.Constant):
            return node
        what = ast.unparse(node)
        raise InputError(
            f"'{what}' in {quoted(text)} is no figure: write for example 'largest({what})'; "
            f'functions: {", ".join(FUNCTIONS)}'
        )

    tree = taken(tree)
    if not figures:
        known = [*FUNCTIONS]
        called = next((n.func.id for n in ast.walk(tree) if isinstance(n, ast.Call)
                       and isinstance(n.func, ast.Name)), '')  # fmt: skip
        raise InputError(
            f'{quoted(text)} has no figure{nearest(called, known)}; functions: {", ".join(known)}'
        )
    evaluate(tree, lambda _: Value(1.0, bare=True), text)  # what cannot be evaluated
    return Measure(name or ' '.join(text.split()), ' '.join(text.split()), tree, tuple(figures))


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
    match = re.fullmatch(r'\s*([A-Za-z_]\w*)\s*=(?!=)\s*(.+)', text, re.DOTALL)
    return (match[1], match[2]) if match else ('', text)


def _as_keywords(match: re.Match[str], times: list[str]) -> str:
    """What stands after an expression, as Python has it; the words themselves go to `times`."""
    since, until, only_until, per = match.groups()
    given = {'since': since, 'until': until or only_until, 'per': per}
    words = ''
    for key, value in given.items():
        if value:
            words += f', {key}={len(times)}'
            times.append(value)
    return words


def _figure(node: ast.Call, text: str, times: list[str]) -> Figure:
    function = node.func.id  # type: ignore[attr-defined]
    places = 2 if function == 'percentile' else 1
    if len(node.args) != places:
        form = f'{function}(EXPRESSION, PERCENT)' if places == 2 else f'{function}(EXPRESSION)'
        raise InputError(f'{function} in {quoted(text)} must be of the form {form}')
    given: dict[str, Any] = {}
    for word in node.keywords:
        place = getattr(word.value, 'value', None)
        if word.arg in given or not isinstance(place, int) or place >= len(times):
            raise InputError(
                f"after the expression in {quoted(text)} may stand 'from TIME', 'to TIME' and "
                "'per revolution', each once"
            )
        given[str(word.arg)] = times[place]
    if given.get('per') not in (None, 'revolution'):
        raise InputError(f"'per {given['per']}' in {quoted(text)}: it may be per revolution only")
    percent = None
    if places == 2:
        percent = getattr(node.args[1], 'value', None)
        if not isinstance(percent, int | float) or not 0.0 <= percent <= 100.0:
            raise InputError(
                f'percentile in {quoted(text)} needs a number from 0 to 100 as its second'
            )
    argument = node.args[0]
    names = tuple(dict.fromkeys(_names(argument)))
    since, until = (_bound(given.get(key), text) for key in ('since', 'until'))
    if since and until and since.revolutions == until.revolutions and since.value >= until.value:
        raise InputError(
            f"the window 'from {given['since']} to {given['until']}' in {quoted(text)} ends "
            'before it begins'
        )
    figure = Figure(function, ast.unparse(argument), names, percent, since, until, 'per' in given)
    first = {name.partition('.')[0] for name in names}
    of_events = first & set(SERIES)
    if of_events and (len({_series_of(n) for n in names}) > 1 or function not in _EVENTS_TOO):
        raise InputError(
            f'{function} in {quoted(text)} must be of one kind of events or samples, and events '
            f'have {", ".join(sorted(_EVENTS_TOO))}'
        )
    if not of_events and function in OF_EVENTS:
        raise InputError(
            f"{function} in {quoted(text)} must be of events, as in 'count(impacts.JOINT)'"
        )
    if not names:
        raise InputError(f'{function} in {quoted(text)} names no quantity')
    evaluate(argument, lambda _: Value(np.ones(1), bare=True), text)  # what cannot be evaluated
    return figure


def _series_of(name: str) -> str:
    """What events or samples a name is of: ``impacts.JOINT.KEY`` of ``impacts.JOINT``."""
    return '.'.join(name.split('.')[:2])


def _bound(text: str | None, where: str) -> Bound | None:
    if text is None:
        return None
    match = re.fullmatch(rf'({_NUMBER})\s*(\w*)', text.strip())
    if match and match[2] in ('rev', 'revolution', 'revolutions'):
        turns = float(match[1])
        if not turns <= formula.LARGEST:
            raise InputError(f'the time {quoted(text)} is larger than {formula.LARGEST:g} turns')
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


def _names(node: ast.AST) -> Iterator[str]:
    """Dotted names in an expression, in the order in which they stand there."""
    if isinstance(node, ast.Attribute | ast.Name):
        name = ast.unparse(node)
        if name != 'pi':
            yield name
    elif isinstance(node, ast.Call):
        for x in node.args:
            yield from _names(x)
    else:
        for child in ast.iter_child_nodes(node):
            yield from _names(child)


@np.errstate(all='ignore')  # what has no value is NaN, and said so
def evaluate(node: ast.expr, value_of: Callable[[str], Value], text: str) -> Value:
    """An expression of numbers or arrays, with its unit.

    Parameters
    ----------
    value_of : what a dotted name stands for
    text : of which this is a part, for messages
    """

    def of(node: ast.expr) -> Value:
        return evaluate(node, value_of, text)

    match node:
        case ast.Constant(value=int() | float() as x) if not isinstance(x, bool):
            if not abs(x) <= formula.LARGEST:  # 1e400 is infinite to Python
                raise InputError(f'a number in {quoted(text)} is larger than {formula.LARGEST:g}')
            return Value(float(x), '', True)
        case ast.Name(id='pi'):
            return Value(math.pi, '', True)
        case ast.Name() | ast.Attribute():
            return value_of(ast.unparse(node))
        case ast.Call(func=ast.Name(id='_quantity'), args=[ast.Constant(value=str() as written)]):
            number, _, unit = written.partition(' ')
            try:
                read = Value(*read_common(number, unit))
                if not abs(read.x) <= formula.LARGEST:
                    raise ValueError(f'{quoted(number)} is larger than {formula.LARGEST:g}')
                return read
            except (ValueError, ArithmeticError) as error:
                raise InputError(f'{quoted(text)}: {error}') from error
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            value = of(operand)
            return value._replace(x=-value.x)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return of(operand)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return Value(1.0 - (of(operand).x != 0.0))
        case ast.BoolOp(op=op, values=values):
            flags = [np.asarray(of(x).x) != 0.0 for x in values]
            join = np.logical_and if isinstance(op, ast.And) else np.logical_or
            return Value(reduce(join, flags) * 1.0)
        case ast.Compare(left=left, ops=ops, comparators=others) if all(
            type(op) in _COMPARE for op in ops
        ):
            sides = [of(x) for x in (left, *others)]
            flags = []
            for relation, a, b in zip(ops, sides, sides[1:], strict=False):
                _common((a, b), 'compared', text)
                flags.append(_COMPARE[type(relation)](a.x, b.x))
            return Value(reduce(np.logical_and, flags) * 1.0)
        case ast.IfExp(test=test, body=body, orelse=other):
            a, b = of(body), of(other)
            unit, bare = _common((a, b), 'chosen between', text)
            return Value(np.where(np.asarray(of(test).x) != 0.0, a.x, b.x), unit, bare)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as op, right=right):
            a, b = of(left), of(right)
            unit, bare = _common((a, b), 'added', text)
            return Value(a.x + b.x if isinstance(op, ast.Add) else a.x - b.x, unit, bare)
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as op, right=right):
            a, b = of(left), of(right)
            power = 1 if isinstance(op, ast.Mult) else -1
            with np.errstate(divide='ignore', invalid='ignore'):
                x = a.x * b.x if power > 0 else np.divide(a.x, b.x)
            return Value(x, product(a.unit, b.unit, power), a.bare and b.bare)
        case ast.BinOp(left=base, op=ast.Pow(), right=ast.Constant(value=2 | 3 | 4 as exponent)):
            a = of(base)
            power = int(exponent)  # type: ignore[arg-type]
            return Value(a.x**power, product('', a.unit, power), a.bare)
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            return _called(name, [of(x) for x in args], text)
    raise InputError(
        f'{quoted(text)} is not made of numbers, names, + - * /, powers 2 to 4, comparisons and '
        'functions'
    )


def _called(name: str, args: list[Value], text: str) -> Value:
    if name in ('min', 'max', 'hypot') and len(args) >= 2:
        unit, bare = _common(args, f'in {name}', text)
        join = {'min': np.minimum, 'max': np.maximum, 'hypot': np.hypot}[name]
        return Value(reduce(join, [a.x for a in args]), unit, bare)
    if name not in _KNOWN:
        raise InputError(
            f"'{name}' in {quoted(text)} is not a function of expressions"
            f'{nearest(name, _KNOWN)}; known are {", ".join(_KNOWN)}'
        )
    if len(args) != 1 or name in ('min', 'max', 'hypot'):
        raise InputError(f'{name} in {quoted(text)} cannot have {len(args)} arguments')
    (a,) = args
    if name == 'abs':
        return a._replace(x=np.abs(a.x))
    if name == 'sign':
        return Value(np.sign(a.x))
    if name == 'sqrt':
        return Value(np.sqrt(a.x), _root(a.unit, text), a.bare)
    if not alike(a.unit, ''):
        raise InputError(f'{name} in {quoted(text)} needs a plain number, not one in {a.unit}')
    return Value(_SMOOTH[name](a.x))


def _common(values: tuple[Value, ...] | list[Value], what: str, text: str) -> tuple[str, bool]:
    """The unit of several values that must have the same one."""
    given = [v for v in values if not v.bare]
    for v in given[1:]:
        if not alike(given[0].unit, v.unit):
            a, b = (u or 'a plain number' for u in (given[0].unit, v.unit))
            raise InputError(f'{a} and {b} are {what} in {quoted(text)}: they are no like units')
    return (given[0].unit if given else ''), not given


def _root(unit: str, text: str) -> str:
    """The unit whose square this is."""
    powers = [(n, int(p or 1), o) for o, n, p in re.findall(r'(/?)\s*([A-Za-z]+)\^?(\d?)', unit)]
    if any(power % 2 for _, power, _ in powers):
        raise InputError(f'the root of {unit} in {quoted(text)} has no unit')
    found = ''
    for name, power, over in powers:
        found = product(found, name, (-1 if over else 1) * power // 2)
    return found


def as_float(x: Any) -> float:
    """A number, or the only one of an array."""
    return float(np.asarray(x).reshape(-1)[0])


def as_row(x: Any, count: int) -> Array:
    """Values (count,) of what may be one number."""
    return np.broadcast_to(np.asarray(x, float), (count,))
