"""Solving for forces that step against a motion while they hold it, friction in joints included.

Every such force has a switch on a rate. Off that rate's zero its part is known; at zero, where it
holds, it is what keeps the rate there. A load acts by a part of 0 to 1 of its step. Friction in an
ideal joint acts by its T, see `planar.joint_friction`: where it slides, T depends on the joint's
force, and that on every T. All are found at once, by Newton's method from no friction at all; with
only loads the equations are linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import heyoka as hy

from mechanism_sim.numerics.symbolic import Term, add, dense, substitute
from mechanism_sim.planar.joint_friction import Pressed
from mechanism_sim.planar.switches import Switch
from mechanism_sim.tolerances import TOLERANCES

_JOINT_FRICTION = TOLERANCES.joint_friction


class Acting(NamedTuple):
    """Set-valued forces as expressions of the motion and of the rows of switches."""

    values: dict[
        hy.expression, hy.expression
    ]  #: by the flag of a load, and by the T of a friction
    parts: list[hy.expression]  #: of every switch, 0 to 1: of its flag
    residual: list[hy.expression]  #: of every friction that slides, what is left of its law
    pressed: list[hy.expression]  #: [N] of every side, what it is the sign of
    carried: list[list[hy.expression]]  #: [N] the components of every other term
    jam_margin: Term  #: 1 without friction; at 0 what slides jams; None if nothing rubs


def acting(
    switches: Sequence[Switch],
    rates: Sequence[hy.expression],
    forces: Sequence[hy.expression | None],
    bounds: Sequence[Sequence[Pressed]],
) -> Acting:
    """Solve for what acts.

    Parameters
    ----------
    switches : k that may hold
    rates : (k,) of their functions, linear in each flag of a load, and in every T
    forces : (k,) the T of a friction, None of a load
    bounds : (k,) their terms, likewise linear; none of a load
    """
    unknowns = [s.flag if T is None else T for s, T in zip(switches, forces, strict=True)]
    components = [dense(c) for b in bounds for p in b for c in p.components]
    every = [*rates, *components]
    n = len(unknowns)
    frictional = any(T is not None for T in forces)
    none = dict.fromkeys(unknowns, hy.expression(0.0))
    factors = _factors(switches, rates, unknowns)
    none |= {x: (1.0 - z) * x for x, z in factors.items()}  # known where they do not hold
    if frictional:
        # flanks of teeth bear as they would without
        share = {x: factors.get(x, hy.expression(1.0)) for x in unknowns}
        each = [share[T] * hy.diff(x, T) for x in every for T in unknowns]
        A = substitute([*every, *each], none)  # at once: one by one they would share no parts
        slopes = [A[k : k + n] for k in range(len(every), len(A), n)]
    else:  # the same of shorter expressions, whose roundings are those of long ago
        most = {x: none[x] + factors.get(x, hy.expression(1.0)) for x in unknowns}
        A = substitute(every, none)
        B = [substitute(every, none | {x: most[x]}) for x in unknowns]
        slopes = [[b[k] - A[k] for b in B] for k in range(len(every))]
    # bounds with more than one component are roots of squares: a fixed number of Newton steps,
    # each a linear solution about the last, keeps all of it one expression without branches
    found: list[hy.expression] = [hy.expression(0.0)] * n
    jam: Term = None
    curved = any(p.side is None for b in bounds for p in b)
    for _ in range(_JOINT_FRICTION.newton if curved else 1):
        rows, at = [], n
        for k, (s, T) in enumerate(zip(switches, forces, strict=True)):
            z: Term = s.holds
            # a switch that holds keeps its function's rate at zero, else its flag is unchanged
            if T is None:
                row = [z * x for x in slopes[k]]
                row[k] = row[k] - (1.0 - z)
                rows.append([*row, -z * A[k] - (1.0 - z) * s.flag])
                continue
            # friction holds likewise; sliding, ``T = way * bound`` with the tangent of the bound
            own = slice(at, at + sum(len(p.components) for p in bounds[k]))
            at = own.stop
            way: Term = (1.0 - z) * (1.0 - 2.0 * s.flag)
            off, slope = _tangent(bounds[k], A[own], slopes[own], found, way)
            row = [z * x - y for x, y in zip(slopes[k], slope, strict=True)]
            row[k] = row[k] + (1.0 - z)
            rows.append([*row, off - z * A[k]])
        found, pivots = _eliminated(rows)
        # a pivot of sliding friction that vanishes: the force has no bound, the joint jams
        if frictional:
            jam = hy.prod(
                [
                    dense(s.holds) + (1.0 - dense(s.holds)) * p
                    for s, p, T in zip(switches, pivots, forces, strict=True)
                    if T is not None
                ]
            )
    parts, residual, at = [], [], n
    for k, (s, T) in enumerate(zip(switches, forces, strict=True)):
        if T is None:
            parts.append(found[k])
            continue
        own = slice(at, at + sum(len(p.components) for p in bounds[k]))
        at = own.stop
        b = _bound(bounds[k], A[own], slopes[own], found)
        held: Term = s.holds
        floor = _JOINT_FRICTION.coefficient
        least = hy.sum([(p.coefficient + floor) * p.resolution for p in bounds[k]])
        # both may vanish at once; and of one that slides, the series of a quotient by a bound that
        # passes through zero grows beyond all numbers: it is nothing before it is divided
        share = held * found[k] * b / (b * b + least * least)
        parts.append((1.0 - held) * s.flag + 0.5 * (held * (1.0 - share)))
        left = found[k] - (1.0 - 2.0 * s.flag) * b
        residual.append((1.0 - held) * (left / (b + _JOINT_FRICTION.bound * least)))
    pressed, carried, at = [], [], n
    for p in (p for b in bounds for p in b):
        own = slice(at, at + len(p.components))
        at = own.stop
        forces_of = [_linear(a, x, found) for a, x in zip(A[own], slopes[own], strict=True)]
        if p.side is None:
            carried.append(forces_of)
        else:
            pressed += forces_of
    values = dict(zip(unknowns, found, strict=True))
    return Acting(values, parts, residual, pressed, carried, jam)


def _factors(
    switches: Sequence[Switch], rates: Sequence[hy.expression], unknowns: Sequence[hy.expression]
) -> dict[hy.expression, hy.expression]:
    """Flags that stand in slopes of other unknowns, with whether they hold.

    Such as of a brake on what is fast enough: the product of two conditions.
    """
    flags = [s for s in switches if s.flag in unknowns]
    if not flags or len(unknowns) < 2:
        return {}
    named = {v for x in rates for y in unknowns for v in hy.get_variables(hy.diff(x, y))}
    return {s.flag: dense(s.holds) for s in flags if str(s.flag) in named}


def _tangent(
    terms: Sequence[Pressed],
    start: Sequence[hy.expression],
    slopes: Sequence[Sequence[hy.expression]],
    at: Sequence[hy.expression],
    way: hy.expression,
) -> tuple[hy.expression, list[hy.expression]]:
    """A bound times `way`, linear about some values of the unknowns: at none of them, by each.

    A size is homogeneous but for the resolution: its tangent at ``c = start + slopes at`` is
    ``(c start + resolution^2)/size`` and ``c slopes/size``.
    """
    off: list[Term] = []
    slope: list[list[Term]] = [[] for _ in at]
    i = 0
    for p in terms:
        own = range(i, i + len(p.components))
        i = own.stop
        if p.side is not None:
            weights = [way * (p.coefficient * p.side)]
            least = way * (p.coefficient * (_JOINT_FRICTION.off_zero * p.resolution))
        else:
            c = [_linear(start[k], slopes[k], at) for k in own]
            weight = way * p.coefficient / _size(c, p)
            weights = [weight * x for x in c]
            least = weight * (p.resolution * p.resolution)
        off += [least, *(w * start[k] for w, k in zip(weights, own, strict=True))]
        for w, k in zip(weights, own, strict=True):
            for j, x in enumerate(slopes[k]):
                slope[j].append(w * x)
    return dense(add(*off)), [dense(add(*x)) for x in slope]


def _bound(
    terms: Sequence[Pressed],
    start: Sequence[hy.expression],
    slopes: Sequence[Sequence[hy.expression]],
    at: Sequence[hy.expression],
) -> hy.expression:
    """A bound at some values of the unknowns."""
    bound: list[Term] = []
    i = 0
    for p in terms:
        own = range(i, i + len(p.components))
        i = own.stop
        c = [_linear(start[k], slopes[k], at) for k in own]
        least = _JOINT_FRICTION.off_zero * p.resolution
        size = p.side * c[0] + least if p.side is not None else _size(c, p)
        bound.append(p.coefficient * size)
    return dense(add(*bound))


def _size(components: Sequence[hy.expression], p: Pressed) -> hy.expression:
    return hy.sqrt(hy.sum([*(x * x for x in components), p.resolution * p.resolution]))


def _linear(
    start: hy.expression, slope: Sequence[hy.expression], at: Sequence[hy.expression]
) -> hy.expression:
    return hy.sum([start, *(x * y for x, y in zip(slope, at, strict=True))])


def _eliminated(
    rows: list[list[hy.expression]],
) -> tuple[list[hy.expression], list[hy.expression]]:
    """Solve linear equations, the right side behind each row, by pivots on the diagonal.

    Returns
    -------
    The solution, and the pivots.
    """
    n = len(rows)
    for k in range(n):
        for i in range(k + 1, n):
            factor = rows[i][k] / rows[k][k]
            rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k], strict=True)]
    found: list[hy.expression] = []
    for k in reversed(range(n)):
        known = [rows[k][k + 1 + j] * x for j, x in enumerate(found)]
        found.insert(0, (rows[k][n] - hy.sum([hy.expression(0.0), *known])) / rows[k][k])
    return found, [rows[k][k] for k in range(n)]
