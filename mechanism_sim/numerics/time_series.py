"""A formula of the time as polynomials, piece by piece, exact to rounding at any time.

Terms that are polynomials in t, and those in the sines, cosines and tangents of others, are moved
to the middle of a piece in exact arithmetic, so that no digits are lost after however long. The
rest is the Taylor series of a heyoka expression there. Where a condition of the formula changes
(``min``, ``max``, ``abs``, ``sign``, ``if``), a piece ends.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import heyoka as hy
import numpy as np
from numpy.polynomial import polynomial

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.errors import InputError, quoted
from mechanism_sim.numerics import compiled, formula
from mechanism_sim.numerics.expressions import ExpressionNode

#: pi to 60 digits
PI = Fraction('3.14159265358979323846264338327950288419716939937510582097494')

DEGREE = 12
"""Degree of the polynomials; linkages without clearance have 15 nodes on a piece."""
_KNOWN = DEGREE + 3
_TOLERANCE = math.exp(-2.0 * (_KNOWN - 0.5))  # of heyoka, which makes its order `_KNOWN` + 1
_TAIL = 2.0**-55  # first terms left out over the change in a piece: an acceleration then has 1e-13
_LEAST = 2.0**-62  # negligible magnitude [rad, m, and their rates] of terms left out
_HALVES = np.array([x * 2.0**-k for k in range(24) for x in (0.5, 0.375)])
"""Half lengths of pieces [s], short numbers; a change within the last one is a step."""
_SAMPLES = np.linspace(-1.0, 1.0, 33)
_ZERO = 1e-12
"""Below it a guard, which is a difference relative to what is compared, is at its zero."""
_PERIODS, _ALIKE = 12, 1e-9
"""Most periods of the slowest sine in that of all; tolerance of the ratios of rates."""

Powers = tuple[Fraction, ...]
"""Coefficients of a polynomial in t, rising."""


class SeriesPiece(NamedTuple):
    """``f(t) = sum_k exact[k] (t - middle)^k + sum_k series[k] (t - middle)^k`` up to `end`."""

    middle: float  #: time of the middle [s]
    end: float  #: time of the end [s]
    exact: Powers
    series: Array


class TimeSeries:
    """A formula of the time ``t`` [s] alone.

    Attributes
    ----------
    text : text as written
    exact : polynomial terms
    whole : True if all terms are polynomials
    """

    def __init__(self, tree: ExpressionNode, text: str) -> None:
        self.text = text
        self.exact: Powers = (Fraction(0),)
        rest: list[ExpressionNode] = []
        for sign, term in summands(tree):
            if (powers := _powers(term)) is None:
                rest.append(term if sign > 0 else ExpressionNode('negative', (term,)))
            else:
                self.exact = _sum(self.exact, powers, sign)
        self.whole = not rest
        self._phases: list[Powers] = []
        self._again = False
        if rest:
            terms = [self._with_phases(term) for term in rest]
            self._again = not any('t' in term.names for term in terms)
            self._compile(terms)

    @property
    def period(self) -> float | None:
        """Period of all but the polynomials [s]; None if it is unknown."""
        if not self._again or any(len(powers) > 2 for powers in self._phases):
            return None
        rates = [abs(powers[1]) for powers in self._phases]
        slowest = min(rates)
        ratios = [(x / slowest).limit_denominator(_PERIODS) for x in rates]
        if any(abs(x / slowest - y) > _ALIKE * y for x, y in zip(rates, ratios, strict=True)):
            return None
        return float(2 * PI / slowest) * math.lcm(*(ratio.denominator for ratio in ratios))

    def _with_phases(self, node: ExpressionNode) -> ExpressionNode:
        """A term with names for the polynomials whose sine, cosine or tangent it contains."""
        powers = _powers(node.args[0]) if node.name in formula.PERIODIC else None
        if node.kind == 'call' and powers is not None and len(powers) > 1:
            self._phases.append(powers)
            name = ExpressionNode('name', name=f'phase {len(self._phases) - 1}')
            return replace(node, args=(name,))
        return replace(node, args=tuple(map(self._with_phases, node.args)))

    def _compile(self, rest: Sequence[ExpressionNode]) -> None:
        """Integrator with the series of the terms and of the guards of conditions."""
        known, count = {'t': hy.par[0] + hy.time}, 1
        for k, powers in enumerate(self._phases):
            value = hy.expression(0.0)
            for i in reversed(range(len(powers))):
                value = value * hy.time + hy.par[count + i]
            known[f'phase {k}'] = value
            count += len(powers)
        guards: list[hy.expression] = []

        def flag(guard: hy.expression) -> hy.expression:
            guards.append(guard)
            return hy.par[count + len(guards) - 1]

        words = formula.Words(known, flag=flag)
        value = sum((formula.of_tree(x, words, self.text) for x in rest), hy.expression(0.0))
        self._flags = len(guards)
        last = count + len(guards)
        rates = [value, *guards]
        states = [(hy.make_vars(f'integral {k}'), x) for k, x in enumerate(rates)]
        tiny = (hy.make_vars('last'), hy.par[last] * 0.0 + 0.0 * hy.time + hy.par[last])
        self._series = compiled.integrator(
            compiled.TaylorEquations([*states, tiny], []), _TOLERANCE, True, last, self
        )
        local = hy.make_vars('local')
        values = compiled.function(hy.subs([value], {hy.time: local}), [local])

        def of(at: Array, pars: Array) -> Array:
            repeated = np.repeat(pars[: values.nparams, None], len(at), axis=1)
            return np.asarray(values(at[None], **({'pars': repeated} if len(repeated) else {}))[0])

        self._values = of

    # --- pieces ---------------------------------------------------------------------------------

    @lru_cache(maxsize=64)  # noqa: B019 - laws are asked for in turn, by several
    def piece(self, start: float) -> SeriesPiece:
        """Piece from a time [s] on, which depends on that time alone."""
        if self.whole:
            return SeriesPiece(start, math.inf, _moved(self.exact, Fraction(start)), np.zeros(1))
        flags, terms = self._flags_from(start)
        fitting = np.flatnonzero(self._ends(terms, _HALVES))
        first = max(0, int(fitting[0]) - 2) if len(fitting) else 0  # longer ones may fit, too
        for half in _HALVES[first:].tolist():
            middle = start + half
            terms = self._about(middle, flags)
            if self._ends(terms, np.array([half])).all() and self._is_whole(terms, half):
                break
        else:
            raise InputError(
                f'{quoted(self.text)} has no value or no derivative at t = {start:.6g} s'
            )
        end = self._change(terms[1:], half, flags)
        exact = _moved(self.exact, Fraction(middle))
        return SeriesPiece(middle, middle + end, exact, terms[0, : DEGREE + 1])

    def _set(self, t: float, flags: Sequence[float]) -> None:
        """Parameters of the expression, for times counted from `t` [s]."""
        found = [t]
        for powers in self._phases:
            moved = _moved(powers, Fraction(t))
            found += [float(moved[0] % (2 * PI)), *map(float, moved[1:])]
        self._series.pars[:] = [*found, *flags, 0.0]

    def _about(self, t: float, flags: Sequence[float]) -> Array:
        """Taylor coefficients (1 + guards, `_KNOWN`) at a time [s]."""
        self._set(t, flags)
        series = self._series
        series.time = 0.0
        series.state[:] = 0.0
        series.step(max_delta_t=1.0, write_tc=True)
        orders = np.arange(1.0, _KNOWN + 1.0)
        return np.asarray(series.tc[:-1, 1 : _KNOWN + 1] * orders)

    def _flags_from(self, t: float) -> tuple[list[float], Array]:
        """Flags of the guards, 1 if positive just after a time [s], and the series there.

        A guard may depend on flags of others.
        """
        flags = [0.0] * self._flags
        for _ in range(self._flags + 1):
            terms = self._about(t, flags)
            before, flags = flags, [_sign(row) for row in terms[1:]]
            if flags == before:
                break
        return flags, terms

    def _ends(self, terms: Array, halves: Array) -> Mask:
        """True where series (1 + guards, `_KNOWN`) converge within durations (k,) [s]."""
        if not np.isfinite(terms).all():
            return np.zeros(len(halves), bool)
        sizes = np.abs(terms) * halves[:, None, None] ** np.arange(_KNOWN)
        going, tails = sizes[..., 1:].max(axis=2), sizes[..., DEGREE + 1 :].max(axis=2)
        shares = np.array([_TAIL, *[_ZERO] * self._flags])
        return np.asarray((tails <= np.maximum(shares * going, _floor(sizes[..., 0]))).all(axis=1))

    def _is_whole(self, terms: Array, half: float) -> bool:
        """True if the series equals the formula over a duration to either side [s].

        A pulse far from the middle leaves no trace in the series there. The parameters are still
        those of the middle.
        """
        at = half * _SAMPLES
        found = self._values(at, self._series.pars)
        off = np.abs(found - polynomial.polyval(at, terms[0, : DEGREE + 1]))
        going = np.abs(terms[0, 1:] * half ** np.arange(1, _KNOWN)).max()
        floor = 16.0 * float(_floor(np.abs(terms[0, :1]))[0])
        return bool((off <= 1e-13 * np.abs(found) + 1e-12 * going + floor).all())

    def _change(self, guards: Array, half: float, flags: Sequence[float]) -> float:
        """Time from the middle [s] at which the first flag changes; `half` if none does."""
        found = half
        for row, flag in zip(guards, flags, strict=True):
            if np.abs(row * half ** np.arange(_KNOWN)).max() <= _ZERO:
                continue  # both sides are the same throughout
            roots = polynomial.polyroots(np.trim_zeros(row * half ** np.arange(_KNOWN), 'b'))
            real = roots[np.abs(roots.imag) <= 1e-7].real
            inner = np.sort(real[(real > -1.0 + 1e-9) & (real < 1.0)])
            ends = [-1.0, *inner.tolist(), 1.0]
            for a, b in pairwise(ends[1:]):  # before its first zero it has its flag
                value = polynomial.polyval(0.5 * (a + b) * half, row)
                if (value > 0.0) != bool(flag) and abs(value) > _ZERO**2:
                    found = min(found, a * half)
                    break
        return found


def _floor(sizes: Array) -> Array:
    """Rounding error beside values of given magnitudes."""
    return np.asarray(np.maximum(_LEAST, 2.0**-3 * np.spacing(sizes)))


def _sign(row: Array) -> float:
    """Flag of a guard by its Taylor coefficients: 1 if positive just after, else 0."""
    first = next((x for x in row if abs(x) > _ZERO), 0.0)
    return float(first > 0.0)


def summands(node: ExpressionNode, sign: int = 1) -> Iterator[tuple[int, ExpressionNode]]:
    """The terms of a sum with their signs."""
    if node.kind in ('+', '-'):
        yield from summands(node.args[0], sign)
        yield from summands(node.args[1], sign if node.kind == '+' else -sign)
    elif node.kind == 'negative':
        yield from summands(node.args[0], -sign)
    else:
        yield sign, node


def _powers(node: ExpressionNode) -> Powers | None:
    """A term as a polynomial in t; None if it is none of low degree."""
    match node.kind:
        case 'number':
            return (Fraction(node.value),)
        case 'pi':
            return (PI,)
        case 'name':
            return (Fraction(0), Fraction(1))
        case 'negative' | '+' | '-' | '*' | '/' | '**':
            parts = [_powers(x) for x in node.args]
        case _:
            return None
    known = [x for x in parts if x is not None]
    if len(known) < len(parts):
        return None
    a, b = known[0], known[-1]
    if node.kind == 'negative':
        return tuple(-x for x in a)
    if node.kind in ('+', '-'):
        return _sum(a, b, 1 if node.kind == '+' else -1)
    if node.kind == '*':
        found = _product(a, b)
    elif node.kind == '**':
        if b[0].denominator > 1 or not 0 < b[0] <= DEGREE:
            return None
        found = a
        for _ in range(int(b[0]) - 1):
            found = _product(found, a)
    else:
        found = tuple(x / b[0] for x in a) if len(b) == 1 and b[0] else ()
    return found if 0 < len(found) <= DEGREE else None


def _sum(a: Powers, b: Powers, sign: int) -> Powers:
    n = max(len(a), len(b))
    wide = ((*x, *[Fraction(0)] * (n - len(x))) for x in (a, b))
    return tuple(x + sign * y for x, y in zip(*wide, strict=True))


def _product(a: Powers, b: Powers) -> Powers:
    found = [Fraction(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            found[i + j] += x * y
    return tuple(found)


def _moved(powers: Powers, by: Fraction) -> Powers:
    """The polynomial in powers of the time since `by` [s]."""
    found = list(powers)
    for i in range(len(found)):
        for j in reversed(range(i, len(found) - 1)):
            found[j] += by * found[j + 1]
    return tuple(found)
