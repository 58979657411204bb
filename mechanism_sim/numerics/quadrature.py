"""Integrals over many intervals of many functions at once, with an error that is estimated.

An interval is integrated by the Gauss-Legendre rule of 8 nodes, exact to the degree 15. The same
8 values give the interpolant of degree 7 in Legendre polynomials, whose last coefficients show
without any further evaluation how well the function is resolved: those of degree k fall as
``rho^-k``, the error of the rule of n nodes as ``rho^-2n`` (Trefethen, Approximation Theory and
Approximation Practice, ch. 8 and 19). Where they are too large the interval is split, and again;
the parts also show how far off the whole was. On an interval at whose ends a function behaves as
a power the double exponential rule takes the place of Gauss's, compared with itself at half of its
nodes.

What lies between the 8 nodes of an interval and does not reach any of them remains unseen: the
intervals must be short where the functions vary, as the steps of an integrator are.

Whether an interval is split depends on that interval, on the one function, and on what came
*before* in time, never on which other intervals or functions are handed over together: results do
not depend on how a motion is cut into batches, nor on what else is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array, IndexArray, Mask, joined, some
from mechanism_sim.numerics.polynomials import (
    Nodes,
    PiecewisePolynomial,
    Times,
    double_exponential_nodes,
    gauss_nodes,
)
from mechanism_sim.tolerances import TOLERANCES

_QUADRATURE = TOLERANCES.quadrature
_ROUNDING = TOLERANCES.rounding

Values = Callable[[IndexArray, Times], Array]
"""Functions (C, K n) in K segments at times (K, n) [s] after their starts, or at n `Nodes`."""


_SPLIT = [2, 4, *[8] * 15]
"""Number of parts into which unresolved intervals are split, round by round.

What one round has not resolved is mostly a jump or a corner: fewer rounds take fewer calls of the
functions. In the end an interval of 2^-48 of a segment is a point, where a function jumps.
"""
_BLOCK = 512  # segments at once, so that they stay in a processor's cache
_TINY = float(np.finfo(float).tiny)


class Integrals(NamedTuple):
    """Integrals of C functions over m intervals."""

    value: Array  #: (C, m) integrals; NaN where a function is not finite on a whole part
    error: Array  #: (C, m) estimated errors, infinite where unknown
    largest: Array  #: (C,) mean magnitudes of the functions in an interval so far
    size: Array  #: (C, m) integrals of the magnitudes
    running: Array  #: (C, m) `largest` at each interval


class Parts(NamedTuple):
    """m intervals, each within one segment of a motion."""

    segment: IndexArray  #: (m,) indices of the segments
    begin: Array  #: (m,) start [s] since that of the segment
    end: Array  #: (m,) end [s] since the start of the segment
    whole: Mask  #: (m,) whether the interval is the whole segment


def parts_of(curve: PiecewisePolynomial, since: float = -np.inf, until: float = np.inf) -> Parts:
    """Part of each segment in the time from `since` to `until` [s].

    Times count from the starts of segments: after a long run a step may be no longer than what
    the time itself rounds away.
    """
    begin = np.maximum((since - curve.start) - curve.start_low, 0.0)
    end = np.minimum((until - curve.start) - curve.start_low, curve.duration)
    k = np.flatnonzero(begin < end)
    whole = (begin[k] == 0.0) & (end[k] == curve.duration[k])
    return Parts(k, begin[k], end[k], whole)


_SEEN = np.linspace(0.0, 1.0, 9)


def where_steep(argument: Values, name: str, parts: Parts) -> Parts:
    """Parts so short that their nodes resolve a steep function of an argument.

    An argument is as smooth as the motion is; a function of it may be a pulse of any width.

    Parameters
    ----------
    argument : (1, K n) argument of the function at positions on the parts
    name : exp, tanh, or 'over' for its reciprocal
    """
    done: list[Parts] = []
    for _ in range(_QUADRATURE.halvings):
        width = parts.end - parts.begin
        places = parts.begin[:, None] + width[:, None] * _SEEN
        with np.errstate(invalid='ignore', over='ignore', divide='ignore'):
            u = argument(parts.segment, places).reshape(places.shape)
            step = np.abs(np.diff(u, axis=1)).max(axis=1)  # beyond its samples it goes no farther
            low, high = u.min(axis=1), u.max(axis=1)
            near = np.maximum(np.maximum(low, -high) - step, 0.0)  # the least of its sizes
            if name == 'over':
                steep = np.maximum(-low, high) > _QUADRATURE.steady * near
            else:
                varies = high + step > -_QUADRATURE.exp_zero
                varies &= low - step < _QUADRATURE.exp_infinite
                steep = varies if name == 'exp' else near < _QUADRATURE.tanh_constant
                steep = steep & (high - low > _QUADRATURE.steady)
        done.append(some(parts, np.flatnonzero(~steep)))
        parts = some(parts, np.flatnonzero(steep))
        if not len(parts.segment):
            break
        middle, none = 0.5 * (parts.begin + parts.end), np.zeros(2 * len(parts.begin), bool)
        parts = Parts(
            np.tile(parts.segment, 2),
            np.append(parts.begin, middle),
            np.append(middle, parts.end),
            none,
        )
    every = joined([*done, parts])
    return some(every, np.lexsort((every.begin, every.segment)))


class Rule(NamedTuple):
    """A quadrature over an interval, with an error estimate from the same values."""

    places: Nodes
    weights: Array  #: (K,) shares of the length, zero for values that serve the error only
    tail: Array  #: (K, r) matrix from values to the numbers that estimate the error


def _smooth(count: int) -> Rule:
    """Gauss's rule; its last six coefficients in Legendre polynomials."""
    nodes, weights = gauss_nodes(count)
    degrees = np.arange(count - 6, count)
    at_nodes = np.polynomial.legendre.legvander(2.0 * nodes - 1.0, count - 1)[:, degrees]
    tail = (2 * degrees + 1) * weights[:, None] * at_nodes
    return Rule(Nodes(tuple(nodes.tolist())), weights, tail)


def _powers() -> Rule:
    """The double exponential rule; its error is the difference from every second node."""
    nodes, weights = double_exponential_nodes(20)
    half = np.where(np.arange(len(nodes)) % 2, 0.0, 2.0) * weights
    return Rule(Nodes(tuple(nodes.tolist())), weights, (weights - half)[:, None])


SMOOTH = _smooth(8)
"""Rule for functions with a series about every point of an interval, its ends included."""

SECOND = _smooth(9)
"""A rule with none of its nodes: what one of the two misses the other one may see."""


def _watched(rule: Rule) -> Rule:
    """A rule with values at both ends, which the interpolant has to meet.

    The ends stand a millionth inside, where nothing else begins; a corner that is nearer to an
    end than that adds less than rounding. One between an end and the node next to it is off by at
    most half of what the end is missed by, over this distance.
    """
    inside = 1e-6
    nodes, count = np.array(rule.places.fractions), len(rule.weights)
    places = np.concatenate([[inside], nodes, [1.0 - inside]])
    at_places = np.polynomial.legendre.legvander(2.0 * places - 1.0, count - 1)
    # values at the nodes to coefficients, and these to the ends
    coefficients = (2 * np.arange(count) + 1) * rule.weights[:, None] * at_places[1:-1]
    missed = np.zeros((count + 2, 2))
    missed[1:-1] = coefficients @ at_places[[0, -1]].T
    missed[[0, -1], [0, 1]] = -1.0
    tail = np.column_stack([np.pad(rule.tail, ((1, 1), (0, 0))), nodes[0] * missed])
    return Rule(Nodes(tuple(places.tolist())), np.pad(rule.weights, 1), tail)


WATCHED = _watched(SMOOTH)
"""Rule for functions with corners: `SMOOTH` misses those beside the ends of an interval."""

POWERS = _powers()
"""Rule for functions that behave as any power of the distance from an end."""


class Assumptions(NamedTuple):
    """Assumptions on functions and intervals that save evaluations, or require more."""

    #: whether intervals are consecutive, so that earlier ones give the scale of rounding
    in_order: bool = True
    #: whether functions are of one kind, so that the largest gives the scale for all
    alike: bool = False
    #: whether functions vary on the scale of the motion's steps only, so that their coefficients
    #: keep the known rate of decay
    foretold: bool = False
    #: whether functions may have small corners within intervals, as the magnitude of a force that
    #: changes sign: then other nodes must agree
    corners: bool = False
    smooth: Rule = SMOOTH  #: rule of smooth functions: `SMOOTH` or `SECOND`


ASSUMED = Assumptions()


def integrate(
    values: Values,
    parts: Parts,
    powers: Mask | None = None,
    largest: Array | None = None,
    beside: Array | None = None,
    assumed: Assumptions = ASSUMED,
) -> Integrals:
    """Integrals of functions over intervals.

    Parameters
    ----------
    values : functions; they may differ by rounding at `Nodes` of whole segments
    powers : (m,) mask of intervals where functions may behave as powers at the ends
    largest : (C,) `Integrals.largest` of the intervals before these
    beside : (m,) mean magnitudes so far of functions to which errors are relative

    Examples
    --------
    A motion that comes in pieces::

        found = integrate(values, parts_of(curve), largest=found.largest)
    """
    in_order, alike, foretold, corners, smooth = assumed
    smooth = WATCHED if corners and smooth is SMOOTH else smooth
    powers = np.zeros(len(parts.segment), bool) if powers is None else np.asarray(powers)
    if not len(powers):
        largest = np.zeros(0) if largest is None else largest
        none = np.zeros((len(largest), 0))
        return Integrals(none, none, largest, none, none)
    relative = _QUADRATURE.foretold if foretold else _QUADRATURE.relative
    width = parts.end - parts.begin
    whole = _apply(values, parts, powers, smooth)
    if foretold:
        whole = whole.sharper(foretold)
    before = np.zeros(len(whole.value)) if largest is None else largest
    running = np.column_stack([before, whole.mean])
    running = (np.maximum.accumulate(running, axis=1) if in_order else running)[:, 1:]
    # most batches are smooth everywhere: they end here, without any bookkeeping of parts
    if not corners and (whole.error <= relative * whole.size).all():
        value, error, size = whole.value, whole.error + _ROUNDING.sum * whole.size, whole.size
        return Integrals(value, error, running[:, -1], size, running)
    scale = np.broadcast_to(running.max(axis=0), running.shape) if alike else running
    scale = scale if beside is None else np.maximum(scale, beside)

    def allowed(x: _Applied, interval: IndexArray, share: Array, width: Array) -> Array:
        own = relative * x.size + _QUADRATURE.negligible * scale[:, interval] * width
        return np.asarray(own + _QUADRATURE.corner * relative * share[:, interval])

    every, size = np.arange(len(width)), whole.size
    limit = allowed(whole, every, size, width)
    if corners:
        whole = _confirmed(whole, values, parts, powers, smooth, limit)
    elif not foretold:
        sharper = np.where(whole.error <= limit, whole.error, whole.sharper().error)
        whole = whole._replace(error=sharper)
    # intervals whose errors are too large, or not numbers, are split; the others are final
    wanted = ~(whole.error <= limit)
    value, error, refined = *(np.where(wanted, 0.0, x) for x in (whole.value, whole.error)), wanted
    begin, interval, parent = parts.begin, every, whole
    for k, n in enumerate(_SPLIT):
        chosen = np.flatnonzero(wanted.any(axis=0))
        if not len(chosen):
            break
        parent, first = some(parent, chosen), interval[chosen]
        wanted, width = np.tile(wanted[:, chosen], n), np.tile(width[chosen] / n, n)
        begin, interval = np.tile(begin[chosen], n), np.tile(first, n)
        begin += np.repeat(np.arange(n), len(chosen)) * width
        shorter = Parts(parts.segment[interval], begin, begin + width, np.zeros(len(begin), bool))
        now = _apply(values, shorter, powers[interval], smooth)
        now = now._replace(error=now.tail) if corners else now.sharper(foretold)
        size = np.fmax(size, _gathered(interval, np.where(wanted, now.size, 0.0), size.shape))
        # what the parts say the whole was off by is more than what they are off by themselves
        joint = parent._replace(size=_joined(now.size, n))
        limit = allowed(joint, first, size, n * width[: len(chosen)])
        with np.errstate(invalid='ignore'):
            differ = np.abs(_joined(now.value, n) - parent.value)
        # wholes and parts that do not see a corner at an end agree about it
        agrees = np.tile(np.maximum(differ, _joined(now.missed, n)) <= limit, n)
        off = np.where(agrees, np.fmin(now.error, np.tile(limit / n, n)), now.error)
        settled = agrees | (now.error <= allowed(now, interval, size, width))
        # parts of the last split, or without a number, count as they are, with their errors
        settled |= np.isnan(now.error) | (k == len(_SPLIT) - 1)
        pending = _gathered(interval, wanted & ~settled, size.shape)
        settled |= pending[:, interval] > _QUADRATURE.parts
        rows, columns = np.nonzero(wanted & settled)
        for sums, x in ((value, now.value), (error, off)):
            np.add.at(sums, (rows, interval[columns]), x[rows, columns])
        wanted, parent = wanted & ~settled, now
    error += (_ROUNDING.sum + _QUADRATURE.believed * relative * refined) * size
    error = np.where(np.isfinite(value), error, np.inf)
    return Integrals(value, error, running[:, -1], size, running)


def _confirmed(
    whole: _Applied,
    values: Values,
    parts: Parts,
    powers: Mask,
    smooth: Rule,
    limit: Array,
) -> _Applied:
    """The rule's results where other nodes agree; infinite errors where they do not.

    That the coefficients that are left out are small follows from how those that are known fall,
    unless a small corner lies on a smooth function that is large: its coefficients do not fall
    so. A rule of other nodes, which misses it otherwise, shows it.
    """
    sharper = np.where(whole.error <= limit, whole.error, whole.sharper().error)
    hoped = (whole.tail > limit) & (sharper <= limit)
    chosen = np.flatnonzero(hoped.any(axis=0))
    if not len(chosen):
        return whole
    other = SMOOTH if smooth is SECOND else SECOND
    again = _apply(values, some(parts, chosen), powers[chosen], other)
    differ = np.full(limit.shape, np.inf)
    differ[:, chosen] = np.abs(again.value - whole.value[:, chosen])
    agree = np.where(differ <= limit, np.maximum(sharper, differ), np.inf)
    return whole._replace(error=np.where(hoped, agree, whole.error))


class _Applied(NamedTuple):
    """A rule applied to C functions on K intervals, each array (C, K)."""

    value: Array
    size: Array  #: integral of the magnitude
    mean: Array  #: mean of the magnitude
    error: Array  #: estimated error; infinite where a value is not finite, NaN where none is
    tail: Array  #: unresolved part, as large as the function where nothing is resolved
    first: Array  #: coefficients of the lowest degrees, then of the next, of Gauss's rule
    middle: Array
    missed: Array  #: error by the misfit of the interpolant at the ends, of watched rules

    def sharper(self, foretold: bool = False) -> _Applied:
        """Rule with smaller errors where coefficients decay geometrically.

        Then their logarithms fall as straight or steeper lines, and those that are left out are
        less than those of a power of the degree by at least ``(E_6 / E_2)^1.4``; half of that is
        believed, see `_applied`. Where it is `foretold` that they fall so, those from 16 on are
        ten degrees beyond E_6, at the rate of the last two degrees, or of the last four.
        """
        with np.errstate(divide='ignore', invalid='ignore'):
            if foretold:
                four, two = self.tail / self.first, self.tail / self.middle
                fall = np.fmin(four * np.sqrt(four), two * np.square(np.square(two)) / four)
            else:
                later, earlier = np.log(self.tail / self.middle), np.log(self.middle / self.first)
                steep = np.clip((later - 0.65 * earlier) / (0.2 * earlier), 0.0, 1.0)
                fall = (self.tail / self.first) ** (0.7 * steep)
        sharp = self.error * np.where(fall < 1.0, fall, 1.0)
        return self._replace(error=np.maximum(sharp, self.missed))


def _apply(values: Values, parts: Parts, powers: Mask, smooth: Rule) -> _Applied:
    """Apply its own rule to each interval."""
    found: list[tuple[IndexArray, _Applied]] = []
    for rule, of_rule in ((smooth, ~powers), (POWERS, powers)):
        for at_nodes in (True, False):
            every = np.flatnonzero(of_rule & (parts.whole == at_nodes))
            for first in range(0, len(every), _BLOCK):
                which = every[first : first + _BLOCK]
                own = some(parts, which)
                width = own.end - own.begin
                places: Times = rule.places
                if not at_nodes:
                    inside = width[:, None] * np.array(rule.places.fractions)
                    places = own.begin[:, None] + inside
                with np.errstate(invalid='ignore', over='ignore'):
                    x = np.asarray(values(own.segment, places), float)
                    found.append((which, _applied(x, width, rule)))
    if len(found) == 1:
        return found[0][1]
    order = np.concatenate([which for which, _ in found])
    applied = joined([x for _, x in found])
    return some(applied, order.argsort()) if (order[1:] < order[:-1]).any() else applied


def _applied(x: Array, width: Array, rule: Rule) -> _Applied:
    """A rule applied to values (C, K n) at its nodes on intervals of some width (K,).

    Let E_2, E_4, E_6 be the larger coefficients of degrees 2 and 3, 4 and 5, 6 and 7 (of the rule
    of 8 nodes). Where they fall as any power of the degree, those from 16 on, of which the error
    consists, are about ``E_6 (E_6 / E_2)``. The double exponential rule is taken to be as much
    better than at half of its nodes as that is than nothing.
    """
    shape = len(x), len(width)
    x = x.reshape(-1, len(rule.weights))
    mean = np.abs(x) @ rule.weights
    known = None if np.isfinite(mean).all() else np.isfinite(x)
    if known is not None:
        mean = np.where(known, np.abs(x), 0.0) @ rule.weights
    # only decisions depend on what a matrix product rounds by how many intervals there are
    left = np.abs(rule.tail.T @ x.T)
    missed = np.zeros(len(x))
    if rule is POWERS:
        tail = left[0]
        middle = first = np.maximum(mean, tail) + _TINY
    else:
        if len(left) > 6:
            missed = np.maximum(left[6], left[7])
        tail = np.maximum(np.maximum(left[4], left[5]), missed)
        middle = np.maximum(np.maximum(left[2], left[3]), tail) + _TINY
        first = np.maximum(np.maximum(left[0], left[1]), middle)
    error = np.maximum(_QUADRATURE.safety * tail * (tail / first), missed)
    if known is not None:
        error = np.where(known.all(axis=1), error, np.where(known.any(axis=1), np.inf, np.nan))
        missed = np.where(np.isfinite(missed), missed, 0.0)
    value = np.zeros(len(x))
    for weight, row in zip(rule.weights, x.T, strict=True):
        value += weight * row
    mean = mean.reshape(shape)
    rest = (width * a.reshape(shape) for a in (error, tail, first, middle, missed))
    return _Applied(width * value.reshape(shape), width * mean, mean, *rest)


def _gathered(interval: IndexArray, x: NDArray[Any], shape: tuple[int, ...]) -> Array:
    """Sums (C, m) over the parts (C, K) of each interval."""
    found = np.zeros((shape[1], shape[0]))
    np.add.at(found, interval, x.T)
    return found.T


def _joined(x: Array, n: int) -> Array:
    """Sums (C, K) of all first parts of n, then of all second ones and so on (C, n K)."""
    return np.asarray(x.reshape(len(x), n, -1).sum(axis=1))
