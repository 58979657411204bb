"""Enclosures of formulas over parts of a motion: what cannot hide between samples.

A sample tells what a formula is at one place. An enclosure tells what it is at most and at least
in a whole part of a motion (R. E. Moore, "Interval Analysis", 1966). Where both agree, nothing is
hidden between the samples; where they do not, the part is halved. So a pulse of any width is
found, in as many halvings as its width asks for.

A formula is smooth but for its switches, which have guards of their own. What makes it steep at
one place and flat at another are its functions: exp, tanh, powers, quotients. They are what is
enclosed, each by itself, so that no pulse drowns in a larger load beside it. Sums and products of
functions that are known in all parts hide nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.expressions import ExpressionNode, numbers, tree_of
from mechanism_sim.numerics.kernels import kernel
from mechanism_sim.tolerances import TOLERANCES

_ENCLOSURE = TOLERANCES.enclosure

_FAR = {'sin': 2.0, 'cos': 2.0, 'exp': 1.5, 'tanh': 0.7, 'atan': 0.5}
"""Largest deviation of arguments from the middle of a piece whose series resolves the function:
well within the distance of the next pole, and of a function without poles a change of a few."""
_ENTIRE = 'sin', 'cos', 'exp'


class Ball(NamedTuple):
    """Interval of all numbers within a radius of a middle; exact without a radius."""

    middle: Any
    radius: Any = None

    @property
    def size(self) -> Any:
        """The largest absolute value in it."""
        return _abs(self.middle) if self.radius is None else _abs(self.middle) + self.radius

    @property
    def least(self) -> Any:
        """The smallest absolute value in it."""
        size = _abs(self.middle)
        return size if self.radius is None else hy.relu(size - self.radius)

    @property
    def ends(self) -> tuple[Any, Any]:
        """The least and the largest number in it."""
        if self.radius is None:
            return self.middle, self.middle
        return self.middle - self.radius, self.middle + self.radius


def _abs(x: Any) -> Any:
    return hy.select(hy.lt(x, hy.expression(0.0)), -x, x)


def _between(low: Any, high: Any) -> Ball:
    return Ball(0.5 * (low + high), _abs(0.5 * (high - low)))


def _rising(f: Callable[[Any], Any]) -> Callable[[Ball], Ball]:
    """Enclosure of a monotonic function."""

    def enclosed(x: Ball) -> Ball:
        return Ball(f(x.middle)) if x.radius is None else _between(*map(f, x.ends))

    return enclosed


def _wave(f: Callable[[Any], Any], slope: Callable[[Any], Any]) -> Callable[[Ball], Ball]:
    """Enclosure of sine and cosine: ``|f(m + d) - f(m)| <= |f'(m)| |d| + d^2/2``, at most 2."""

    def enclosed(x: Ball) -> Ball:
        if x.radius is None:
            return Ball(f(x.middle))
        r = x.radius
        change = _abs(slope(x.middle)) * r + 0.5 * r * r
        most = hy.expression(2.0)
        return Ball(f(x.middle), hy.select(hy.lt(change, most), change, most))

    return enclosed


def _tangent(x: Ball) -> Ball:
    """Enclosure of the tangent: without limit if a pole may be within."""
    if x.radius is None:
        return Ball(hy.tan(x.middle))
    low, high = x.ends
    straight = hy.logical_and([
        hy.gt(hy.cos(low) * hy.cos(high), hy.expression(0.0)),
        hy.lt(x.radius, hy.expression(1.5)),
    ])  # fmt: skip
    found = _between(hy.tan(low), hy.tan(high))
    limitless = hy.expression(_ENCLOSURE.limitless)
    return Ball(found.middle, hy.select(straight, found.radius, limitless))


def _above_zero(f: Callable[[Any], Any]) -> Callable[[Ball], Ball]:
    """Enclosure of a rising function of a value not negative, but for overestimation."""

    def enclosed(x: Ball) -> Ball:
        if x.radius is None:
            return Ball(f(x.middle))
        low, high = x.ends
        return _between(f(hy.relu(low)), f(high))

    return enclosed


def _power(x: Ball, n: float) -> Ball:
    def f(y: Any) -> Any:
        return y**n

    if x.radius is None:
        return Ball(f(x.middle))
    if n < 0.0:
        low, high = x.ends
        found = _between(f(low), f(high))
        sure = hy.gt(x.least, hy.expression(0.0))
        limitless = hy.expression(_ENCLOSURE.limitless)
        if n % 2.0 == 0.0:
            found = _between(f(x.size), f(x.least))
        return Ball(
            hy.select(sure, found.middle, hy.expression(0.0)),
            hy.select(sure, found.radius, limitless),
        )
    if n % 2.0 == 0.0:
        return _between(f(x.least), f(x.size))
    return _rising(f)(x) if n % 2.0 == 1.0 else _above_zero(f)(x)


def _direction(y: Ball, x: Ball) -> Ball:
    """Enclosure of the angle of the point (x, y): a disk about it spans an arc."""
    angle = hy.atan2(y.middle, x.middle)
    radii = [r * r for r in (y.radius, x.radius) if r is not None]
    if not radii:
        return Ball(angle)
    share = hy.sqrt(hy.sum(radii) / (y.middle * y.middle + x.middle * x.middle))
    inside = hy.lt(share, hy.expression(1.0))  # else the origin may be in the disk
    arc = hy.asin(hy.select(inside, share, hy.expression(1.0)))
    return Ball(angle, hy.select(inside, arc, hy.pi))


_UNARY: dict[str, tuple[Callable[[Ball], Ball], Callable[[Ball], Any]]] = {
    'sin': (_wave(hy.sin, hy.cos), lambda _: hy.expression(1.0)),
    'cos': (_wave(hy.cos, hy.sin), lambda _: hy.expression(1.0)),
    'tan': (_tangent, lambda x: 1.0 + _tangent(x).size ** 2),
    'exp': (_rising(hy.exp), lambda x: hy.exp(x.ends[1])),
    'log': (_above_zero(hy.log), lambda x: 1.0 / x.least),
    'sqrt': (_above_zero(hy.sqrt), lambda x: 0.5 / hy.sqrt(x.least)),
    'tanh': (_rising(hy.tanh), lambda x: 1.0 - hy.tanh(x.least) * hy.tanh(x.least)),
    'atan': (_rising(hy.atan), lambda x: 1.0 / (1.0 + x.least * x.least)),
}
"""Enclosures of functions by name, and their largest slopes within."""


class _Operation(NamedTuple):
    kind: str
    args: tuple[int, ...]
    exponent: float = 0.0


class _Program:
    """Expressions as elementary operations, each on the results of those before it."""

    def __init__(
        self, expressions: Sequence[hy.expression], variables: Sequence[hy.expression]
    ) -> None:
        self.leaves: dict[int, hy.expression] = {}
        self.operations: list[_Operation] = []
        self._known = {str(x): self._leaf(x) for x in variables}
        named = len(variables)
        self._known |= {f'u_{k}': self._known[str(x)] for k, x in enumerate(variables)}
        parts = hy.cfunc(list(expressions), vars=list(variables), opt_level=0).dc
        for k, part in enumerate(parts[named : len(parts) - len(expressions)], named):
            self._known[f'u_{k}'] = self._read(tree_of(str(part)))
        ends = parts[len(parts) - len(expressions) :]
        self.roots = [self._read(tree_of(str(x))) for x in ends]

    def _leaf(self, x: hy.expression) -> int:
        self.leaves[len(self.operations)] = x
        return self._add('leaf')

    def _add(self, kind: str, *args: int, exponent: float = 0.0) -> int:
        self.operations.append(_Operation(kind, args, exponent))
        return len(self.operations) - 1

    def _read(self, node: ExpressionNode) -> int:
        name, args = node.name, [] if node.kind == '**' else [*map(self._read, node.args)]
        match name.removeprefix('combined_') if node.kind == 'call' else node.kind:
            case 'number':
                return self._leaf(hy.expression(node.value))
            case 'pi':
                return self._leaf(hy.pi)
            case 'name':
                if name not in self._known and name[0] == 'p' and name[1:].isdigit():
                    self._known[name] = self._leaf(hy.par[int(name[1:])])
                return self._known[name]
            case '**':
                return self._add(
                    'power', self._read(node.args[0]), exponent=numbers(node.args[1], {})
                )
            case '+':
                return self._add('sum', *args)
            case '-' | 'sub':
                return self._add('sum', args[0], self._add('negative', args[1]))
            case '*':
                return self._product(*args)
            case '/' | 'div':
                return self._product(args[0], self._add('power', args[1], exponent=-1.0))
            case 'negative' | 'atan2' as kind:
                return self._add(kind, *args)
            case kind if kind in _UNARY and len(args) == 1:  # combined: sin and cos of the same
                return self._add(kind, *args)
        raise NotImplementedError(f'no enclosure of {node.text}')

    def _product(self, a: int, b: int) -> int:
        return self._add('power', a, exponent=2.0) if a == b else self._add('product', a, b)


def _forward(program: _Program, moving: dict[str, Any]) -> list[Ball]:
    """The enclosure of each operation; `moving` are the radii of variables by name."""
    found: list[Ball] = []
    for k, (kind, args, exponent) in enumerate(program.operations):
        if kind == 'leaf':
            leaf = program.leaves[k]
            found.append(Ball(leaf, moving.get(str(leaf))))
            continue
        a, *rest = (found[i] for i in args)
        if kind == 'negative':
            ball = Ball(-a.middle, a.radius)
        elif kind == 'power':
            ball = _power(a, exponent)
        elif kind == 'sum':
            radii = [x.radius for x in (a, *rest) if x.radius is not None]
            ball = Ball(a.middle + rest[0].middle, hy.sum(radii) if radii else None)
        elif kind == 'product':
            b = rest[0]
            radii = []
            if b.radius is not None:
                radii.append(a.size * b.radius)
            if a.radius is not None:
                radii.append(_abs(b.middle) * a.radius)
            ball = Ball(a.middle * b.middle, hy.sum(radii) if radii else None)
        elif kind == 'atan2':
            ball = _direction(a, rest[0])
        else:
            ball = _UNARY[kind][0](a)
        found.append(ball)
    return found


def _backward(
    program: _Program, balls: list[Ball], seeds: dict[int, list[Any]]
) -> list[list[Any]]:
    """Bounds on the effect of each operation on the seeded results, times the seeds."""
    felt: list[list[Any]] = [[] for _ in program.operations]
    for root, known in seeds.items():
        felt[root] += known
    for k in range(len(program.operations) - 1, -1, -1):
        kind, args, n = program.operations[k]
        if not felt[k] or kind == 'leaf':
            continue
        own = hy.sum(felt[k])
        a = balls[args[0]]
        if kind in ('sum', 'negative'):
            slopes = [None] * len(args)
        elif kind == 'product':
            slopes = [balls[args[1]].size, a.size]
        elif kind == 'power':
            slopes = [abs(n) * (a.size if n >= 1.0 else a.least) ** (n - 1.0)]
        elif kind == 'atan2':
            # over the least distance of the point from the origin
            y, x = a.least, balls[args[1]].least
            slopes = [1.0 / hy.sqrt(y * y + x * x)] * 2
        else:
            slopes = [_UNARY[kind][1](a)]
        for i, slope in zip(args, slopes, strict=True):
            if balls[i].radius is not None:
                felt[i].append(own if slope is None else own * slope)
    return felt


def _steep(program: _Program, balls: list[Ball]) -> list[int]:
    """The operations that may be steep: functions, and polynomials of high degree.

    Others are polynomials of what is known, of which a Taylor series foretells all.
    """
    degrees: list[float] = []
    found = []
    for k, (kind, args, n) in enumerate(program.operations):
        own = [degrees[i] for i in args]
        if kind == 'leaf' or balls[k].radius is None:
            degree = float(balls[k].radius is not None)
        elif kind in ('sum', 'negative'):
            degree = max(own)
        elif kind == 'product':
            degree = sum(own)
        elif kind in ('sin', 'cos') and program.operations[args[0]].kind == 'leaf':
            degree = 1.0  # of an angle of a link
        else:
            whole = kind == 'power' and n > 0.0 and n % 1.0 == 0.0
            degree = n * own[0] if whole else math.inf
        if degree > _ENCLOSURE.degree:
            found.append(k)
            degree = 1.0
        degrees.append(degree)
    return found


def _bend(operation: _Operation, balls: list[Ball]) -> Any:
    """Radius of a function's argument, relative to what its power series tolerates."""
    x, least = balls[operation.args[0]], _FAR.get(operation.kind)
    if least is not None:
        return x.radius * (1.0 / least)
    if operation.kind in ('log', 'sqrt') or (
        operation.kind == 'power' and operation.exponent < 1.0
    ):
        return x.radius / (_ENCLOSURE.pole * x.least)
    # poles, and polynomials of high degree, are looked at
    return hy.expression(_ENCLOSURE.limitless)


def _doubts(
    program: _Program,
    balls: list[Ball],
    felt: list[list[Any]],
    chosen: Sequence[int],
    length: Any,
) -> list[Any]:
    """Sums over functions beyond what a series alone, and beyond what few samples resolve.

    One whose change is not felt does not count.
    """
    one, zero = hy.expression(1.0), hy.expression(0.0)
    near, far = [zero], [zero]
    for k in chosen:
        operation = program.operations[k]
        bend = _bend(operation, balls)
        nearer = 1.0 if operation.kind in _ENTIRE else _ENCLOSURE.nearer
        unfelt = hy.lte(2.0 * balls[k].radius * hy.sum(felt[k]) * length, one)
        for counted, most in ((near, nearer), (far, 1.0)):
            known = hy.logical_or([hy.lte(bend, hy.expression(most)), unfelt])
            counted.append(hy.select(known, zero, one))
    return [hy.sum(near), hy.sum(far)]


class Enclosed(NamedTuple):
    """Enclosures of K functions in N parts of a motion, or at N places."""

    middle: Array  #: (K, N) middles of the enclosures
    radius: Array  #: (K, N) radii of the enclosures
    weight: Array  #: (K, N) largest change of any load, over its scale, per unit of each


class MotionSeries(NamedTuple):
    """Variables of formulas over a piece of motion, whose length is 1, as power series."""

    series: Array  #: (v, n) coefficients of rising powers of the moving variables
    length: float  #: duration [s]
    fixed: Array  #: (w,) constant variables
    parameters: Array  #: values of ``par[]``


class Enclosure:
    """Enclosures of the functions that steep formulas are made of, compiled.

    Parameters
    ----------
    loads : formulas, whose changes below a scale of each are negligible
    guards : formulas of interest near their zeros
    moving : v symbols that have a radius in a part
    fixed : w symbols that have none

    Attributes
    ----------
    count : number of the functions
    guards : number of the guards
    doubted : compiled numbers of `doubts_at`, see `doubt_of`
    """

    def __init__(
        self,
        loads: Sequence[hy.expression],
        guards: Sequence[hy.expression],
        moving: Sequence[hy.expression],
        fixed: Sequence[hy.expression],
    ) -> None:
        program = _program((*loads, *guards), (*moving, *fixed))
        radii = {str(x): hy.make_vars(f'radius{k}') for k, x in enumerate(moving)}
        scales = [hy.make_vars(f'scale{k}') for k in range(len(loads) + len(guards))]
        balls = _forward(program, radii)
        seeds: dict[int, list[Any]] = {}
        for root, scale in zip(program.roots, scales, strict=False):
            seeds.setdefault(root, []).append(1.0 / scale)
        for root, scale in zip(program.roots[len(loads) :], scales[len(loads) :], strict=True):
            near = hy.lte(balls[root].least, hy.expression(0.0))
            seeds.setdefault(root, []).append(hy.select(near, 1.0 / scale, hy.expression(0.0)))
        felt = _backward(program, balls, seeds)
        chosen = [k for k in _steep(program, balls) if felt[k]]
        self.count, self.guards = len(chosen), len(guards)
        outputs = [balls[k].middle for k in chosen]
        outputs += [balls[k].radius for k in chosen]
        outputs += [hy.sum(felt[k]) for k in chosen]
        inputs = [*moving, *radii.values(), *fixed, *scales]
        self._terms = outputs, inputs
        if chosen:
            length = hy.make_vars('length')
            self.doubted = compiled.function(
                _doubts(program, balls, felt, chosen, length), [*inputs, length]
            )

    @cached_property
    def enclosed(self) -> hy.cfunc_dbl:
        """Middles, radii and weights, see `Enclosed`.

        Of moving variables, their radii, constant variables and scales.
        """
        outputs, inputs = self._terms
        return compiled.function([hy.expression(0.0) + x for x in outputs], inputs)

    def doubts(self, motion: MotionSeries, scales: Array) -> int:
        """Level of sampling needed to verify the functions on a piece of motion's series.

        `NONE` where they bend so little that they are as known as the motion itself, `LITTLE`
        where `FEW` samples tell whether they are, `MUCH` where they must be enclosed.
        """
        if not self.count:
            return NONE
        about = np.zeros(2 * len(motion.series))
        about_middle(motion.series, about)
        return self.doubts_at(
            np.concatenate([about, motion.fixed, scales, (motion.length,)]), motion.parameters
        )

    def doubts_at(self, given: Array, parameters: Array) -> int:
        """`doubts` of a piece by moving variables, see `about_middle`, and constant ones."""
        found = self.doubted(given, pars=parameters[: self.doubted.nparams])
        return int(doubt_of(found))

    def __call__(
        self, motion: MotionSeries, scales: Array, middle: Array, radius: Array
    ) -> Enclosed:
        """Enclosures for moving variables within radii of their middles, each (v, N).

        Parameters
        ----------
        scales : negligible products of change and length [s] of a part, of loads, then guards
        """
        count = middle.shape[1]
        known = motion.parameters[: self.enclosed.nparams, None]
        fixed = np.concatenate([motion.fixed, scales])[:, None]
        given = np.concatenate([middle, radius, np.repeat(fixed, count, axis=1)])
        found = self.enclosed(given, pars=np.repeat(known, count, axis=1))
        return Enclosed(*found.reshape(3, self.count, count))


class FunctionRanges:
    """Enclosures of expressions themselves: by their balls, and by their slopes about middles.

    Parameters
    ----------
    moving : v symbols that have a radius in a part
    fixed : w symbols that have none
    """

    def __init__(
        self,
        expressions: Sequence[hy.expression],
        moving: Sequence[hy.expression],
        fixed: Sequence[hy.expression],
    ) -> None:
        rates = [hy.make_vars(f'slope{k}') for k in range(len(moving))]
        slopes = [
            hy.sum([hy.expression(0.0), *(hy.diff(x, z) * dz for z, dz in zip(moving, rates))])  # noqa: B905
            for x in expressions
        ]
        moves = [*moving, *rates]
        program = _program((*expressions, *slopes), (*moves, *fixed))
        radii = {str(x): hy.make_vars(f'radius{k}') for k, x in enumerate(moves)}
        balls = [_forward(program, radii)[k] for k in program.roots]
        outputs = [x.middle for x in balls]
        outputs += [hy.expression(0.0) if x.radius is None else x.radius for x in balls]
        inputs = [*moves, *radii.values(), *fixed]
        self._function = compiled.function([hy.expression(0.0) + x for x in outputs], inputs)
        self._count = len(expressions)

    def __call__(
        self, motion: MotionSeries, begin: Array, width: float
    ) -> tuple[Array, Array, Mask]:
        """Values in the middles of parts, lower bounds in them, and masks of monotonic parts.

        Each (g, N), of parts of a width from 0 to 1. The bound is below all values; it lies at
        an end where the expression rises or falls all the way.
        """
        series, _, fixed, parameters = motion
        v, order = len(series), series.shape[1] - 1
        both = np.zeros((2 * v, order + 1))
        both[:v] = series
        both[v:, :-1] = series[:, 1:] * np.arange(1, order + 1)
        count = len(begin)
        given = np.zeros((4 * v + len(fixed), 2 * count))  # of parts, then of their middles
        if width == 1.0:
            halves, rest = _halves(order + 1)
            middle, radius = (both @ halves)[:, None], (np.abs(both) @ rest)[:, None]
        else:
            shift = _shift(order, begin + 0.5 * width)
            middle, radius = _on_parts(both, shift, 0.5 * width)
        given[: 2 * v, :count] = given[: 2 * v, count:] = middle
        given[2 * v : 4 * v, :count] = radius
        given[4 * v :] = fixed[:, None]
        known = np.repeat(parameters[: self._function.nparams, None], 2 * count, axis=1)
        found = self._function(given, pars=known).reshape(4, -1, 2 * count)
        middle, slope, reach, spread = found[:, :, :count]
        values = found[0, :, count:]
        with np.errstate(all='ignore'):
            least = np.fmax(middle - reach, values - 0.5 * width * (np.abs(slope) + spread))
            return values, least, np.abs(slope) > spread


def falls(ranges: FunctionRanges, motion: MotionSeries) -> list[float]:
    """Positions from 0 to 1 where an expression positive at both ends is below zero.

    At least one in the first stretch where that is so, if there is any that is not a point.
    """
    begin, width = _ENDS[:1], 1.0
    found: list[float] = []
    for _ in range(_ENCLOSURE.halvings):
        values, least, straight = ranges(motion, begin, width)
        below = (values < 0.0).any(axis=0)
        found += (begin + 0.5 * width)[below].tolist()
        first = min(found, default=np.inf)
        unsure = ~((least >= 0.0) | straight).all(axis=0) & ~below & (begin < first)
        if not unsure.any():
            break
        width *= 0.5
        begin = np.stack([begin[unsure], begin[unsure] + width], axis=1).ravel()
        begin = begin[: _ENCLOSURE.parts]
    return sorted(found)


@lru_cache(maxsize=64)
def _program(
    expressions: tuple[hy.expression, ...], variables: tuple[hy.expression, ...]
) -> _Program:
    return _Program(expressions, variables)


# --- parts of a motion ---------------------------------------------------------------------------

_FIRST = 8  # parts, in which most motions are known at once
NONE, LITTLE, MUCH = range(3)
FEW = np.array([0.25, 0.5, 0.75, 1.0])
"""Sample positions where nothing is steep."""
_ENDS = np.linspace(0.0, 1.0, _FIRST + 1)


@lru_cache(maxsize=16)
def _binomials(order: int) -> Array:
    """``[k, j] = j over k``."""
    index = range(order + 1)
    return np.array([[math.comb(j, k) for j in index] for k in index], dtype=np.float64)


def _shift(order: int, middle: Array) -> Array:
    """Powers of x, by those of the distance from middles (N,): (order + 1, order + 1, N)."""
    power = np.arange(order + 1)
    raised = np.maximum(power - power[:, None], 0)
    found: Array = _binomials(order)[:, :, None] * middle ** raised[:, :, None]
    return found


@lru_cache(maxsize=16)
def _first_shift(order: int) -> Array:
    """`_shift` to the middles of the first parts."""
    return _shift(order, _ENDS[:-1] + 0.5 / _FIRST)


@lru_cache(maxsize=16)
def _halves(count: int) -> tuple[Array, Array]:
    """First powers of 1/2, and largest deviations of those of x from them, x from 0 to 1."""
    halves: Array = np.power(0.5, np.arange(count))
    return halves, np.maximum(halves, 1.0 - halves) * (np.arange(count) > 0)


@kernel
def about_middle(series: Array, given: Array) -> None:
    """Values (v,) of polynomials (v, n) at 1/2, then radii (v,) of their range on 0 to 1."""
    count = len(series)
    for k in range(count):
        half, middle, radius = 1.0, series[k, 0], 0.0
        for j in range(1, series.shape[1]):
            half *= 0.5
            middle += series[k, j] * half
            radius += abs(series[k, j]) * (1.0 - half)
        given[k], given[count + k] = middle, radius


@kernel
def doubt_of(counts: Array) -> int:
    """Level of sampling by the numbers of functions beyond a series, and beyond few samples."""
    return MUCH if counts[1] > 0.0 else LITTLE if counts[0] > 0.0 else NONE


def _on_parts(series: Array, shift: Array, radius: float) -> tuple[Array, Array]:
    """Polynomials (v, n) on parts: their values in the middles (v, N), and radii around them.

    In powers of the distance from the middle little is overestimated.
    """
    n, count = len(shift), shift.shape[2]
    local = (series @ shift.transpose(1, 0, 2).reshape(n, -1)).reshape(-1, n, count)
    reach = (np.abs(local[:, 1:]) * radius ** np.arange(1, n)[:, None]).sum(axis=1)
    return local[:, 0], reach


class Reach(NamedTuple):
    """Part of a piece of motion, whose length is 1, that is known from its beginning on."""

    sound: float  #: last position before the first fault that is far from one; 0 if none is
    fault: float | None  #: position of the first fault, or end of resolved samples; None


WHOLE = Reach(1.0, None)


def reach_of(
    enclosure: Enclosure,
    motion: MotionSeries,
    scales: Array,
    defect: Callable[[Array], Array],
    doubts: int | None = None,
) -> Reach:
    """Part of a piece of motion over which its samples resolve all formulas, without fault.

    Parts in which a function may go beyond its samples are halved, and sampled again. Behind the
    first fault nothing is looked at any more.

    Parameters
    ----------
    scales : negligible products of change and length [s] of a part, of loads, then guards
    defect : function of positions (N,) from 0 to 1 that returns defects (N,); above 1 is a fault
    doubts : level of `Enclosure.doubts`, if known
    """
    doubts = enclosure.doubts(motion, scales) if doubts is None else doubts
    if doubts == NONE:
        return WHOLE
    if doubts == LITTLE:
        found = defect(FEW)
        if (found <= 1.0).all():
            return WHOLE
        fault = float(FEW[~(found <= 1.0)].min())
        sound_places = FEW[(found <= _ENCLOSURE.sound) & (fault > FEW)]
        return Reach(float(sound_places.max(initial=0.0)), fault)
    order = motion.series.shape[1] - 1
    begin, width, shift = _ENDS[:-1], 1.0 / _FIRST, _first_shift(order)
    ends = np.zeros((enclosure.count, 2, _FIRST))  # values where parts begin and end
    lowest, highest = np.inf, -np.inf
    sound: list[Array] = []  # places
    fault = np.inf
    for depth in range(_ENCLOSURE.halvings):
        middles = begin + 0.5 * width
        places = np.concatenate([middles, _ENDS]) if depth == 0 else middles
        parts, values = _enclosed(enclosure, motion, scales, shift, width, places)
        count = len(begin)
        if depth == 0:
            ends[:, 0], ends[:, 1] = values[:, count:-1], values[:, count + 1 :]
        own = np.stack([ends[:, 0], values[:, :count], ends[:, 1]])
        lowest = np.fmin(lowest, np.fmin.reduce(values, axis=1))
        highest = np.fmax(highest, np.fmax.reduce(values, axis=1))
        # the start itself is as it is
        places = places[places > 0.0]
        found = defect(places)
        fault = min(fault, places[~(found <= 1.0)].min(initial=np.inf))
        sound.append(places[found <= _ENCLOSURE.sound])
        size = np.maximum(np.abs(lowest), np.abs(highest))[:, None]
        with np.errstate(all='ignore'):  # what is not finite is not known
            span = (highest - lowest)[:, None]
            off = _off(own, parts, span)
            known = off <= _ENCLOSURE.of_range * span + _ENCLOSURE.of_size * size
            known |= off * parts.weight * (width * motion.length) <= 1.0
        known |= ~np.isfinite(own).all(axis=0)  # no halving tells more of what is no number
        unknown = ~known.all(axis=0) & (begin < fault)
        if not unknown.any():
            break
        if unknown.sum() > _ENCLOSURE.parts:
            unknown = unknown & (np.cumsum(unknown) <= _ENCLOSURE.parts)
            fault = min(fault, begin[np.flatnonzero(unknown)[-1]])
        width *= 0.5
        begin, ends = _halved(begin[unknown], width, own[:, :, unknown])
        shift = _shift(order, begin + 0.5 * width)
    else:
        fault = min(fault, float(begin[0]))
    if np.isinf(fault):
        return WHOLE
    every = np.concatenate(sound)
    return Reach(float(every[every < fault].max(initial=0.0)), float(fault))


def _off(own: Array, parts: Enclosed, span: Array) -> Array:
    """Deviations (K, N) of functions in parts from their samples.

    The largest of: excess over all samples, curvature between them, and the change in the part if
    that is half of the change in the whole piece.

    Parameters
    ----------
    own : (3, K, N) values where parts begin, in their middles and at their ends
    span : (K, 1) change in the whole piece
    """
    least, most = own.min(axis=0), own.max(axis=0)
    found = np.maximum(parts.middle + parts.radius - most, least - parts.middle + parts.radius)
    found = np.maximum(found, np.abs(own[1] - 0.5 * (own[0] + own[2])))
    steps = np.where(most - least > _ENCLOSURE.in_part * span, most - least, 0.0)
    return np.asarray(np.maximum(found, steps))


def _halved(begin: Array, width: float, own: Array) -> tuple[Array, Array]:
    """Parts of half the width in their order, and values (K, 2, N) at their ends.

    Parameters
    ----------
    own : (3, K, N) values where parts begin, in their middles and at their ends
    """
    both = np.stack([begin, begin + width], axis=1).ravel()
    ends = np.stack([own[:2], own[1:]], axis=-1)  # (2, K, N, halves)
    return both, ends.transpose(1, 0, 2, 3).reshape(own.shape[1], 2, -1)


def _enclosed(
    enclosure: Enclosure,
    motion: MotionSeries,
    scales: Array,
    shift: Array,
    width: float,
    places: Array,
) -> tuple[Enclosed, Array]:
    """Enclosures in parts, and values (K, N) at positions."""
    middle, radius = _on_parts(motion.series, shift, 0.5 * width)
    at = motion.series @ places ** np.arange(len(shift))[:, None]
    count = middle.shape[1]
    parts = enclosure(
        motion,
        scales,
        np.concatenate([middle, at], axis=1),
        np.concatenate([radius, np.zeros_like(at)], axis=1),
    )
    values = parts.middle[:, count:]
    values[~np.isfinite(values)] = np.nan
    return Enclosed(*(x[:, :count] for x in parts)), values
