"""Expressions that people write as heyoka expressions, for loads.

Where a formula has a corner or a step (``min``, ``max``, ``abs``, ``sign``, a condition), it is
made of flags that are 1 where something is positive and 0 elsewhere: who builds it says what a
flag is, so that an integrator can locate the instants at which they change.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import pairwise
from typing import Any

import heyoka as hy

from mechanism_sim.errors import InputError, quoted
from mechanism_sim.numerics import expressions
from mechanism_sim.numerics.expressions import CORNERED, SMOOTH, ExpressionNode, parse
from mechanism_sim.tolerances import TOLERANCES

FUNCTIONS: dict[str, Callable[[Any], Any]] = {name: getattr(hy, name) for name in SMOOTH}
"""Smooth functions of one argument."""

PERIODIC = 'sin', 'cos', 'tan'
"""Functions with a period of a turn of their argument."""

_POINT = 1e-9  # length [SI] of a vector of zeros, see `_length`

_EMPTY = 10.0 * TOLERANCES.switches.margin
"""Of the size of a state and of the terms of x: up to there ``sqrt(max(x, 0))`` in the rate of a
state is 0. At 0 its slope is infinite, and what it brings there would not be seen to arrive."""

_BINARY: dict[str, Callable[[Any, Any], Any]] = {
    '+': operator.add, '-': operator.sub, '*': operator.mul, '/': operator.truediv,
}  # fmt: skip


def _flag_of(guard: hy.expression) -> hy.expression:
    """Flag of an expression, 1 where positive: for formulas that are only evaluated."""
    return hy.select(hy.gt(guard, hy.expression(0.0)), hy.expression(1.0), hy.expression(0.0))


def coefficients(node: ExpressionNode, angles: Collection[str]) -> dict[str, float] | None:
    """Coefficients of the names in a linear sum; None if it is no such sum."""
    if not {*node.names} & {*angles}:
        return {}
    match node.kind, node.args:
        case 'name', _:
            return {node.name: 1.0}
        case 'negative', (x,):
            terms = [(-1.0, x)]
        case '+' | '-' as sign, (a, b):
            terms = [(1.0, a), (1.0 if sign == '+' else -1.0, b)]
        case '*', (ExpressionNode(kind='number') as factor, x) | (
            x,
            ExpressionNode(kind='number') as factor,
        ):
            terms = [(factor.value, x)]
        case '/', (x, ExpressionNode(kind='number', value=divisor)) if divisor:
            terms = [(1.0 / divisor, x)]
        case _:
            return None
    found: dict[str, float] = {}
    for weight, part in terms:
        own = coefficients(part, angles)
        if own is None:
            return None
        found |= {name: found.get(name, 0.0) + weight * x for name, x in own.items()}
    return found


@dataclass(frozen=True)
class Words:
    """Meanings of the words of a formula."""

    variables: Mapping[str, hy.expression]  #: expressions by the names allowed in a formula
    #: function that returns expressions of its numbers in their order; exponents, which shape the
    #: expression, are constants
    number: Callable[[float], hy.expression] = hy.expression
    #: function that returns the expression that is 1 where another one is positive, else 0
    flag: Callable[[hy.expression], hy.expression] = _flag_of
    #: further functions of one argument
    tables: Mapping[str, Callable[[hy.expression], hy.expression]] = field(default_factory=dict)
    #: further names: the expressions of an angle without whole turns, and with them
    angles: Mapping[str, tuple[hy.expression, Callable[[], hy.expression]]] = field(
        default_factory=dict
    )
    #: period in turns of the argument, by periodic table
    cyclic: Mapping[str, float] = field(default_factory=dict)
    size: float = 0.0  #: scale of the state of which it is the rate; 0 for other formulas


def read(text: str, tables: Collection[str] = ()) -> ExpressionNode:
    """The tree of a formula that may call tables beside the usual functions."""
    own = dict.fromkeys((name for name in tables if name not in CORNERED), 1)
    return parse(text, {**expressions.FUNCTIONS, **own})


def expression(text: str, words: Words) -> hy.expression:
    """A formula as an expression; `InputError` if it names or calls what is not known."""
    return of_tree(read(text, words.tables), words, text)


def of_tree(tree: ExpressionNode, words: Words, text: str) -> hy.expression:
    """A tree, or a part of one, as an expression; `text` is the whole formula, for messages."""
    return hy.expression(0.0) + _Builder(words, text).value(tree)


def _terms(node: ExpressionNode) -> list[ExpressionNode]:
    """Terms of a node's sum or choice, whose magnitudes determine its rounding."""
    if node.kind in ('+', '-', 'negative'):
        return [t for x in node.args for t in _terms(x)]
    return [t for x in node.args[1:] for t in _terms(x)] if node.kind == 'if' else [node]


def _squared(node: ExpressionNode) -> list[ExpressionNode]:
    """Bases of a sum of squares, as ``vx**2 + vy*vy``; empty for all else."""
    match node.kind, node.args:
        case '+', (a, b) if (left := _squared(a)) and (right := _squared(b)):
            return left + right
        case '**', (base, power) if power.value == 2.0:
            return [base]
        case '*', (a, b) if a == b:
            return [a]
    return []


def _length(sides: Sequence[Any]) -> Any:
    """Root of a sum of squares, with a slope where all are zero: drag of a body at rest.

    A Taylor series has none at a root of 0: there it is the root of ``_POINT**2``, which is lost
    in rounding from 0.1 m/s on.
    """
    return hy.sqrt(reduce(operator.add, [x * x for x in sides], hy.expression(_POINT**2)))


class _Builder:
    """Makes expressions of the nodes of a formula's tree."""

    def __init__(self, words: Words, text: str) -> None:
        self._words, self._text = words, text
        self._without_turns = False

    def value(self, node: ExpressionNode) -> Any:
        """The expression of a node."""
        words, args = self._words, node.args
        match node.kind:
            case 'number':
                return words.number(node.value)
            case 'pi':
                return hy.pi
            case 'name' if node.name in words.variables:
                return words.variables[node.name]
            case 'name' if node.name in words.angles:
                local, total = words.angles[node.name]
                return local if self._without_turns else total()
            case 'name':
                raise InputError(
                    f"'{node.name}' in {quoted(self._text)} is not known; known are "
                    f'{", ".join(["pi", *words.variables, *words.angles])}'
                )
            case 'negative':
                return -self.value(args[0])
            case '+' | '-' | '*' | '/':
                return _BINARY[node.kind](self.value(args[0]), self.value(args[1]))
            case '**' if 0.0 < args[1].value < 1.0 and (inner := self._at_least_none(args[0])):
                return self._root(inner, args[1].value)
            case '**' if args[1].value == 0.5 and (sides := _squared(args[0])):
                return _length([self.value(x) for x in sides])
            case '**':
                return self._power(self.value(args[0]), args[1].value)
            case 'if':
                flag = self._condition(args[0])
                return flag * self.value(args[1]) + (1.0 - flag) * self.value(args[2])
            case 'call':
                return self._call(node)
        raise InputError(
            f"the condition '{node.text}' in {quoted(self._text)} is not a value: write 'A if X "
            "> Y else B'"
        )

    @staticmethod
    def _power(base: Any, power: float) -> Any:
        """Products where the power is whole: they hold at and below zero, too."""
        if power != int(power):
            return base**power
        if not power:
            return hy.expression(1.0)
        whole = reduce(operator.mul, [base] * abs(int(power)))
        return whole if power > 0.0 else 1.0 / whole

    def _at_least_none(self, node: ExpressionNode) -> ExpressionNode | None:
        """The other argument of ``max(x, 0)`` in the rate of a state; None of other nodes."""
        left = [x for x in node.args if (x.kind, x.value) != ('number', 0.0)]
        some = 0 < len(left) < len(node.args)
        if not self._words.size or (node.kind, node.name) != ('call', 'max') or not some:
            return None
        return left[0] if len(left) == 1 else replace(node, args=tuple(left))

    def _root(self, node: ExpressionNode, power: float) -> Any:
        """A root of what is positive, 0 elsewhere: there it is a root of 1, which has a slope."""
        x, terms = self.value(node), [self.value(t) for t in _terms(node)]
        least = hy.expression(self._words.size**2)
        size = hy.sqrt(reduce(operator.add, [t * t for t in terms], least))
        flag = self._words.flag(x / size - _EMPTY)
        within = flag * x + (1.0 - flag)
        return flag * (hy.sqrt(within) if power == 0.5 else within**power)

    def _call(self, node: ExpressionNode) -> Any:
        """A function; of one that repeats after a turn without those of angles.

        ``sin(60*crank)`` is the same without the whole turns of the crank, which would cost it
        digits; ``sin(crank/2)`` is not.
        """
        name, before = node.name, self._without_turns
        if name in PERIODIC or name in self._words.cyclic:
            often = self._words.cyclic.get(name, 1.0)
            turns = [coefficients(x, self._words.angles.keys()) for x in node.args]
            if all(
                x is not None and all(float.is_integer(often * n) for n in x.values())
                for x in turns
            ):
                self._without_turns = True
        args = [self.value(x) for x in node.args]
        self._without_turns = before
        x = args[0]
        if name == 'sqrt' and (inner := self._at_least_none(node.args[0])):
            return self._root(inner, 0.5)
        if name in ('min', 'max'):
            sign = 1.0 if name == 'max' else -1.0
            return reduce(lambda a, b: b + self._positive(sign * (a - b), a, b) * (a - b), args)
        if name in ('abs', 'sign'):
            sign = 2.0 * self._positive(x, x) - 1.0
            return sign if name == 'sign' else sign * x
        if name in self._words.tables:
            return self._words.tables[name](x)
        if name == 'hypot':
            return _length(args)
        if name == 'sqrt' and (sides := _squared(node.args[0])):
            return _length([self.value(x) for x in sides])
        return FUNCTIONS[name](x)

    def _condition(self, node: ExpressionNode) -> Any:
        """The flag of a condition."""
        match node.kind:
            case 'compare':
                flags = []
                sides = pairwise([self.value(x) for x in node.args])
                for sign, (a, b) in zip(node.name.split(), sides, strict=True):
                    rising = sign.startswith('>')
                    flags.append(self._positive(a - b if rising else b - a, a, b))
                return reduce(operator.mul, flags)
            case 'and':
                return reduce(operator.mul, [self._condition(x) for x in node.args])
            case 'or':
                return 1.0 - reduce(operator.mul, [1.0 - self._condition(x) for x in node.args])
            case 'not':
                return 1.0 - self._condition(node.args[0])
        raise InputError(
            f"a condition in {quoted(self._text)} must be made of < and >, 'and', 'or' and 'not'"
        )

    def _positive(self, difference: Any, *sides: Any) -> Any:
        """Flag of a difference, relative to the compared terms.

        Divided by it, large forces are compared as well as small displacements.
        """
        measure = reduce(operator.add, [x * x for x in sides], hy.expression(1.0))
        return self._words.flag(difference / hy.sqrt(measure))
