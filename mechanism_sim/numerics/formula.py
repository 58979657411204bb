"""Formulas that people write, as expressions: ``-0.2*rate + 3*sin(20*t) if t > 2 else 0``.

Only arithmetic, comparisons and the functions below are read: nothing is executed. Where a formula
has a corner or a step (``min``, ``max``, ``abs``, ``sign``, a condition), it is made of flags that
are 1 where something is positive and 0 elsewhere: who builds it says what a flag is, so that an
integrator can locate the instants at which they change.
"""

from __future__ import annotations

import ast
import operator
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

import heyoka as hy

from mechanism_sim.errors import nearest, quoted

FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    'sin': hy.sin,
    'cos': hy.cos,
    'tan': hy.tan,
    'exp': hy.exp,
    'log': hy.log,
    'sqrt': hy.sqrt,
    'tanh': hy.tanh,
}
"""Smooth ones of one argument."""

CORNERED = 'abs', 'sign', 'min', 'max'
"""Those with a corner or a step."""

LARGEST = 1e30
"""Of the numbers in a formula: beyond, products leave the range of floating-point numbers."""

LONGEST = 1000
"""Characters of a formula."""

DEEPEST = 200
"""Operations in each other: a sum of so many terms is as deep."""

_PERIODIC = 'sin', 'cos', 'tan'
"""Those that repeat after a turn of their argument."""

_POWERS: dict[Any, int] = {2: 2, 3: 3, 4: 4}
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


def parse(text: str) -> ast.expr:
    """The tree of a formula.

    Raises
    ------
    ValueError
        One sentence: what cannot be read.
    """
    if len(text) > LONGEST:
        raise ValueError(f'{quoted(text)} is no formula: it is longer than {LONGEST} characters')
    try:
        with warnings.catch_warnings():  # of what Python may refuse one day, as 2else
            warnings.simplefilter('ignore', SyntaxWarning)
            tree = ast.parse(text, mode='eval').body
    except (SyntaxError, ValueError) as error:  # the latter of numbers with too many digits
        said = error.msg if isinstance(error, SyntaxError) else str(error)
        raise ValueError(f'{quoted(text)} is not a formula: {said}') from error
    except (RecursionError, MemoryError):
        raise ValueError(f'{quoted(text)} is not a formula: it is nested too deep') from None
    if _depth(tree) > DEEPEST:
        raise ValueError(
            f'{quoted(text)} is no formula: it is nested deeper than {DEEPEST} levels'
        )
    return tree


def _depth(tree: ast.expr) -> int:
    depth, level = 0, [tree]
    while level:
        depth += 1
        level = [
            c for node in level for c in ast.iter_child_nodes(node) if isinstance(c, ast.expr)
        ]
    return depth


def names(text: str) -> set[str]:
    """Names of the variables in a formula, not those of functions.

    Raises
    ------
    ValueError
        If it cannot be read.
    """
    tree = parse(text)
    called = [n.func for n in ast.walk(tree) if isinstance(n, ast.Call)]
    found = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and n not in called}
    return found - {'pi'}


def functions(text: str) -> set[str]:
    """Names of what a formula calls.

    Raises
    ------
    ValueError
        If it cannot be read.
    """
    calls = [n.func for n in ast.walk(parse(text)) if isinstance(n, ast.Call)]
    return {f.id for f in calls if isinstance(f, ast.Name)}


def flag_of(guard: hy.expression) -> hy.expression:
    """1 where an expression is positive, 0 elsewhere: for formulas that are only evaluated."""
    return hy.select(hy.gt(guard, hy.expression(0.0)), hy.expression(1.0), hy.expression(0.0))


def _coefficients(node: ast.expr, angles: Collection[str]) -> dict[str, float] | None:
    """By which numbers a sum contains some of the names; None if it is no such sum."""
    match node:
        case ast.Name(id=name) if name in angles:
            return {name: 1.0}
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as op, operand=operand):
            found = _coefficients(operand, angles)
            return _scaled(found, -1.0 if isinstance(op, ast.USub) else 1.0)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as op, right=right):
            one, two = (_coefficients(x, angles) for x in (left, right))
            two = _scaled(two, -1.0 if isinstance(op, ast.Sub) else 1.0)
            if one is None or two is None:
                return None
            return {name: one.get(name, 0.0) + two.get(name, 0.0) for name in one | two}
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            for factor, other in ((left, right), (right, left)):
                if isinstance(factor, ast.Constant) and isinstance(factor.value, int | float):
                    return _scaled(_coefficients(other, angles), float(factor.value))
    inside = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
    return None if inside & {*angles} else {}


def _scaled(found: dict[str, float] | None, by: float) -> dict[str, float] | None:
    return None if found is None else {name: by * x for name, x in found.items()}


@dataclass(frozen=True)
class Words:
    """What the words of a formula stand for.

    Attributes
    ----------
    variables : expressions by the names that a formula may hold
    number : makes expressions of its numbers in the order in which they are written; exponents,
        which shape the expression, are constants
    flag : makes the expression that is 1 where another one is positive, and 0 elsewhere
    tables : functions of one argument beside the usual ones
    angles : further names: the expressions of an angle without whole turns, and with them
    cyclic : which of the tables repeat after a turn
    """

    variables: Mapping[str, hy.expression]
    number: Callable[[float], hy.expression] = hy.expression
    flag: Callable[[hy.expression], hy.expression] = flag_of
    tables: Mapping[str, Callable[[hy.expression], hy.expression]] = field(default_factory=dict)
    angles: Mapping[str, tuple[hy.expression, Callable[[], hy.expression]]] = field(
        default_factory=dict
    )
    cyclic: Collection[str] = ()


def expression(text: str, words: Words) -> hy.expression:
    """A formula as an expression.

    Raises
    ------
    ValueError
        If it cannot be read, or names or calls what is not known.
    """
    return hy.expression(0.0) + _Builder(words, text).value(parse(text))


class _Builder:
    """Makes expressions of the nodes of a formula's tree."""

    def __init__(self, words: Words, text: str) -> None:
        self._words, self._text = words, text
        self._variables = {'pi': hy.pi, **words.variables}
        self._without_turns = False

    def value(self, node: ast.expr) -> Any:
        """The expression of a node."""
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                if not abs(value) <= LARGEST:  # 1e400 is infinite to Python
                    raise ValueError(
                        f'a number in {quoted(self._text)} is larger than {LARGEST:g}'
                    )
                return self._words.number(float(value))
            case ast.Name(id=name):
                if name in self._variables:
                    return self._variables[name]
                if name in self._words.angles:
                    local, total = self._words.angles[name]
                    return local if self._without_turns else total()
                raise ValueError(
                    f"'{name}' in {quoted(self._text)} is not known; known are "
                    f'{", ".join([*self._variables, *self._words.angles])}'
                )
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -self.value(operand)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.value(operand)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                return _BINARY[type(op)](self.value(left), self.value(right))
            case ast.BinOp(left=base, op=ast.Pow(), right=right):
                exponent = getattr(right, 'value', None)
                if exponent in _POWERS:
                    return reduce(operator.mul, [self.value(base)] * _POWERS[exponent])
                raise ValueError(f'the power in {quoted(self._text)} must be 2, 3 or 4')
            case ast.IfExp(test=test, body=body, orelse=other):
                flag = self._condition(test)
                return flag * self.value(body) + (1.0 - flag) * self.value(other)
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
                return self._call(name, self._arguments(name, args))
        raise ValueError(
            f'{quoted(self._text)} is not a formula of numbers, names, + - * /, functions and '
            "'A if X > Y else B'"
        )

    def _arguments(self, name: str, nodes: Sequence[ast.expr]) -> list[Any]:
        """Arguments of a function; of one that repeats after a turn without those of angles.

        ``sin(60*crank)`` is the same without the whole turns of the crank, which would cost it
        digits; ``sin(crank/2)`` is not.
        """
        before = self._without_turns
        if name in _PERIODIC or name in self._words.cyclic:
            turns = [_coefficients(node, self._words.angles.keys()) for node in nodes]
            if all(x is not None and all(map(float.is_integer, x.values())) for x in turns):
                self._without_turns = True
        found = [self.value(node) for node in nodes]
        self._without_turns = before
        return found

    def _call(self, name: str, args: list[Any]) -> Any:
        text = quoted(self._text)
        if name in ('min', 'max'):
            if len(args) < 2:
                raise ValueError(f'{name} in {text} needs at least two arguments')
            sign = 1.0 if name == 'max' else -1.0
            return reduce(lambda a, b: b + self._positive(sign * (a - b), a, b) * (a - b), args)
        known = {*FUNCTIONS, *CORNERED, *self._words.tables}
        if name not in known:
            raise ValueError(
                f"'{name}' in {text} is not a function known here{nearest(name, known)}; known "
                f'are {", ".join(sorted(known))}'
            )
        if len(args) != 1:
            raise ValueError(f'{name} in {text} needs one argument, but has {len(args)}')
        (x,) = args
        if name in ('abs', 'sign'):
            sign = 2.0 * self._positive(x, x) - 1.0
            return sign if name == 'sign' else sign * x
        return {**FUNCTIONS, **self._words.tables}[name](x)

    def _condition(self, node: ast.expr) -> Any:
        """The flag of a condition."""
        match node:
            case ast.Compare(left=left, ops=ops, comparators=others) if all(
                isinstance(op, ast.Gt | ast.GtE | ast.Lt | ast.LtE) for op in ops
            ):
                sides = [self.value(x) for x in (left, *others)]
                flags = []
                for op, a, b in zip(ops, sides, sides[1:], strict=False):
                    rising = isinstance(op, ast.Gt | ast.GtE)
                    flags.append(self._positive(a - b if rising else b - a, a, b))
                return reduce(operator.mul, flags)
            case ast.BoolOp(op=ast.And(), values=values):
                return reduce(operator.mul, [self._condition(x) for x in values])
            case ast.BoolOp(op=ast.Or(), values=values):
                return 1.0 - reduce(operator.mul, [1.0 - self._condition(x) for x in values])
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return 1.0 - self._condition(operand)
        raise ValueError(
            f"a condition in {quoted(self._text)} must be made of < and >, 'and', 'or' and 'not'"
        )

    def _positive(self, difference: Any, *sides: Any) -> Any:
        """The flag of a difference, in the measure of what is compared.

        Divided by it, large forces are compared as well as small displacements.
        """
        measure = reduce(operator.add, [x * x for x in sides], hy.expression(1.0))
        return self._words.flag(difference / hy.sqrt(measure))
