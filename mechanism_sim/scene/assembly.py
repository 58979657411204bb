"""Putting a mechanism together: the configuration nearest to a guess in which all loops close."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.errors import InputError, RunError
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.grashof import change_points
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar.branch import SINGULAR
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.mechanism import Joint, Mechanism, Revolute, Vector2
from mechanism_sim.scene.singular_start import begin, neighbours

if TYPE_CHECKING:
    from mechanism_sim.scene.machine import Machine

Array = NDArray[np.float64]

_TRIES = 256
_RANK = 1e-9
_AT = 1e-3  # [rad] nearer to a change point than this its branches are not told apart
_AHEAD = 0.05  # [rad] from there they are


class Assembly(NamedTuple):
    """A mechanism without clearance at the start."""

    q: Array  #: (n,) coordinates [rad, m]
    v: Array  #: (n,) their rates
    freedom: int  #: motions left when all drives stand still
    overdriven: int  #: drives that contradict others
    redundant: int  #: closure equations that follow from the others, elastic joints left out
    slope: Array | None = None  #: (n,) direction of the motion, if the position is singular


def assemble(machine: Machine) -> Assembly:
    """Where a machine without clearance is at the start.

    Drives, and coordinates set by `initial`, are where they should be; the rest lies near `guess`.

    Raises
    ------
    InputError
        If the loops cannot be closed: which is open by how much, near which configuration; or if
        a cam starts beyond its law.
    """
    plan, ideal = machine.plan, machine.plan.ideal
    held = {**plan.begins, **{c: (x, 0.0) for c, x in plan.given[0].items()}}
    for c in plan.prescribed:
        law = plan.laws[c][0]
        if isinstance(law, DriveLaw):
            _, local = law.about(Fraction(0))
            held[c] = (local[0], local[1] if len(local) > 1 else 0.0)
    known = plan.guess | {c: x for c, (x, _) in held.items()}
    if plan.four_bar:
        known |= _four_bar_guess(plan.four_bar, *held['crank'])
    guess = np.array([known.get(c, 0.0) for c in ideal.coordinates])
    kinematics = machine.kinematics([c for c in ideal.coordinates if c in held])
    q = closed_near(machine.name, kinematics, guess)
    if kinematics.edges:
        try:
            kinematics.edges.check(q[:, None])
        except RunError as error:
            raise InputError(f'{machine.name}: at the start {error}') from error
    moving = machine.kinematics(plan.prescribed)
    ranks, hard = _ranks(moving, q, plan.elastic), sum(r not in plan.elastic for r in moving.rows)
    if ranks[0] < len(moving.sought) or ranks[1] > ranks[0] or ranks[2] < hard:
        # at this position only, if there is more to them beside it
        beside = [_ranks(moving, x, plan.elastic) for x in neighbours(moving, q).T]
        ranks = np.max([ranks, *beside], axis=0)
    freedom, overdriven = len(moving.sought) - int(ranks[0]), int(ranks[1] - ranks[0])
    rates = {c: w for c, (_, w) in held.items()} | plan.given[1]
    v, slope = nearest_rates(kinematics, q, ideal.coordinates, rates, {}), None
    driven = [*plan.prescribed, *(c for c in plan.powered if c in plan.begins)]
    along = machine.kinematics(driven)
    decided = driven and freedom == len(driven) - len(plan.prescribed)
    if decided and along.independence(q[:, None])[0] < SINGULAR:
        drive = np.array([[*held[c], 0.0] for c in driven]).T
        pace = 1.0
        if len(driven) == 1:  # then it is the parameter itself
            pace, drive[1] = drive[1, 0], 1.0
        if pace and drive[1].any():
            q, slope = begin(machine, along, q, guess, drive, pace)
            v = pace * slope
        elif freedom and not machine.clearances:
            raise InputError(
                f'{machine.name}: {", ".join(driven)} starts at rest in a singular position: '
                'nothing decides which way the links go on: start beside it, or with a speed'
            )
    return Assembly(q, v, freedom, overdriven, hard - int(ranks[2]), slope)


def _ranks(kinematics: Kinematics, q: Array, elastic: Sequence[str]) -> Array:
    """Ranks (3,) of the closures: by sought coordinates, by all, and without elastic joints."""
    _, J = kinematics.closure(q[:, None])
    # free of units: rows in the longest link, displacements too
    scaled = J[0] * kinematics.scale / kinematics.mechanism.size
    hard = scaled[[row not in elastic for row in kinematics.rows]]
    return np.array([_rank(x) for x in (scaled[:, kinematics.sought], scaled, hard)])


def _four_bar_guess(linkage: FourBar, angle: float, speed: float) -> dict[str, float]:
    """Coupler and rocker on the branch of the scene; at a change point on that which follows."""
    if any(abs(math.remainder(angle - x, TWO_PI)) < _AT for x in change_points(linkage)):
        angle += math.copysign(_AHEAD, speed)
    th3, th4 = linkage.positions(np.array(angle))
    return {'coupler': float(th3), 'rocker': float(th4)}


def closed_near(
    name: str, kinematics: Kinematics, guess: Array, targets: Array | None = None
) -> Array:
    """Coordinates (n,) that close all loops, near a guess whose held ones count.

    Where Newton's method fails from the guess itself, it starts from others around it, and the
    nearest of its results is taken.

    Raises
    ------
    InputError
        If none closes the loops.
    """
    q, left = kinematics.positions(guess[:, None], targets)
    if left[0]:
        spread = np.random.default_rng(1).standard_normal((len(guess), _TRIES))
        slides = [c in kinematics.mechanism.displacements for c in kinematics.coordinates]
        spread *= np.where(slides, kinematics.mechanism.size, 1.0)[:, None]
        spread *= np.linspace(0.05, 2.0, _TRIES)
        spread[kinematics.held] = 0.0
        first, missed = q, left
        q, left = kinematics.positions(guess[:, None] + spread, targets)
        if left.all():
            best = int(np.argmin(left))
            near, miss = (
                (q[:, best], left[best]) if left[best] < missed[0] else (first[:, 0], missed[0])
            )
            _refuse(name, kinematics, near, float(miss), targets)
        far = np.abs(_wrapped(kinematics, q - guess[:, None])).max(axis=0)
        q = q[:, [int(np.argmin(np.where(left > 0.0, np.inf, far)))]]
    return guess + _wrapped(kinematics, q - guess[:, None])[:, 0]


def nearest_rates(
    kinematics: Kinematics,
    q: Array,
    coordinates: Sequence[str],
    given: Mapping[str, float],
    near: Mapping[str, float],
) -> Array:
    """Rates (n,) that keep all loops closed: of those not given, the nearest to others."""
    v = np.array([given.get(c, near.get(c, 0.0)) for c in coordinates])
    _, J = kinematics.closure(q[:, None])
    if J.shape[1]:
        rest = [i for i in kinematics.sought if coordinates[i] not in given]
        right = -(J[0] @ v)
        v[rest] += np.linalg.lstsq(J[0][:, rest], right, rcond=None)[0]
    return v


def _wrapped(kinematics: Kinematics, shift: Array) -> Array:
    """Differences of coordinates without whole turns of those sought."""
    names = kinematics.mechanism.displacements
    turning = [i for i in kinematics.sought if kinematics.coordinates[i] not in names]
    shift[turning] -= TWO_PI * np.round(shift[turning] / TWO_PI)
    return shift


def _rank(J: Array) -> int:
    if not J.size:
        return 0
    return int((np.linalg.svd(J, compute_uv=False) > _RANK).sum())


def _refuse(
    name: str, kinematics: Kinematics, q: Array, miss: float, targets: Array | None
) -> None:
    off = kinematics.closure(q[:, None])[0][0] - (0.0 if targets is None else targets)
    loops = {joint: _sides(kinematics.mechanism, joint) for joint in kinematics.rows}
    torn = {
        j: sides for j, sides in loops.items() if 2.0 * max(sides.values()) > sum(sides.values())
    }
    joint = next(iter(torn), kinematics.rows[int(np.argmax(np.abs(off)))])
    placed = _said(kinematics, q, range(len(q)))
    if torn:
        sides = torn[joint]
        longest = max(sides, key=lambda link: sides[link])
        advice = (
            f'{longest} is {sides[longest]:.4g} m long between its joints, more than the others '
            f'of the loop together ({sum(sides.values()) - sides[longest]:.4g} m)'
        )
    else:
        advice = _advice(kinematics, q, targets)
    raise InputError(
        f'{name}: the mechanism cannot be assembled: the loop closed by the joint {joint} '
        f'({", ".join(loops[joint])}) stays open by {miss:.4g} m, nearest with {placed}; {advice}'
    )


def _advice(kinematics: Kinematics, q: Array, targets: Array | None) -> str:
    """What to look at where no link is too long."""
    freedom = len(q) - len(kinematics.rows)
    held = [kinematics.coordinates[i] for i in kinematics.held]
    if len(held) > freedom:
        return (
            f'Kutzbach counts a freedom of {freedom}, given are {", ".join(held) or "none"}: is '
            'there a drive or a joint too many?'
        )
    free, left = kinematics.released().positions(q[:, None], targets)
    if held and not left[0]:
        near = _said(kinematics, free[:, 0], kinematics.held)
        return (
            f'the nearest that can be assembled has {near}: start the drive there, or check the '
            'lengths'
        )
    return "check the lengths of that loop, or give a better 'guess'"


def _said(kinematics: Kinematics, q: Array, which: Iterable[int]) -> str:
    straight = kinematics.mechanism.displacements
    return ', '.join(
        f'{c} = {q[i]:.4g} m' if c in straight else f'{c} = {np.degrees(q[i]):.4g} deg'
        for i, c in ((i, kinematics.coordinates[i]) for i in which)
    )


def _sides(mechanism: Mechanism, closing: str) -> dict[str, float]:
    """The links of a loop, with the distances of their joints [m]; no numbers if any slides."""
    last, carried = mechanism.joint(closing), mechanism.tree_joints

    def way(link: str) -> list[str]:
        return [link, *way(mechanism.parent(link))] if link in carried else [link]

    up, down = way(last.first), way(last.second)
    top = next(i for i, link in enumerate(up) if link in down)
    down = down[: down.index(up[top])][::-1]
    joints = [last, *(carried[link] for link in (*up[:top], *down)), last]
    turning = all(isinstance(j, Revolute) for j in joints)
    return {
        link: math.dist(_end(a, link), _end(b, link)) if turning else math.nan
        for link, (a, b) in zip((*up[: top + 1], *down), pairwise(joints), strict=True)
    }


def _end(joint: Joint, link: str) -> Vector2:
    """Where a joint is on a link [m]."""
    return joint.on_first if joint.first == link else joint.on_second
