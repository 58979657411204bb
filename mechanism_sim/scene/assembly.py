"""Putting a mechanism together: the configuration nearest to a guess in which all loops close."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.linkages.four_bar import Branch, FourBarLoop, whole_four_bar
from mechanism_sim.linkages.grashof import change_points
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.mechanism import Mechanism, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.plan import ScenePlan
from mechanism_sim.scene.singular_start import begin, neighbours
from mechanism_sim.scene.start_points import rates
from mechanism_sim.tolerances import TOLERANCES

_BRANCHES = TOLERANCES.branches

_TRIES = 256
_RANK = 1e-9
_OPENING = 1e-9  # share of the largest rate times the size by which rounding may open a loop


class Assembly(NamedTuple):
    """A mechanism without clearance at the start."""

    q: Array  #: (n,) coordinates [rad, m]
    v: Array  #: (n,) their rates
    freedom: int  #: degrees of freedom with all drives at rest
    overdriven: int  #: drives that contradict others
    redundant: int  #: closure equations that follow from the others, elastic joints left out
    slope: Array | None = None  #: (n,) direction of the motion, if the position is singular
    loop: FourBarLoop | None = None  #: the four-bar that it is, if its motion has a closed form
    dependent: int = 0  #: like `redundant`, with ideal joints for elastic and loose ones


def assemble(plan: ScenePlan) -> Assembly:
    """Assemble a machine without clearance at its start.

    Drives, and coordinates set by `initial`, are where they should be; the rest lies near `guess`.
    """
    four_bar = _closed_four_bar(plan)
    if four_bar and _follows(plan):
        return _assembled(plan, four_bar)
    ideal, held = plan.ideal, plan.held
    known = dict(plan.guess)
    known |= {c: x for c, (x, _) in plan.begins.items()}
    known |= plan.given[0] | {c: x for c, (x, _) in held.items()}
    guess = np.array([known.get(c, 0.0) for c in ideal.coordinates])
    kinematics, q = _placed(plan, guess)
    if kinematics.edges:
        try:
            kinematics.edges.check(q[:, None])
        except RunError as error:
            raise InputError(f'at the start {error}') from error
    prescribed = plan.prescribed
    driven = [*prescribed, *(c for c in plan.powered if c in plan.begins)]
    moving = plan.kinematics(prescribed)
    soft = (*plan.elastic, *plan.clearances)
    ranks, hard = _ranks(moving, q, soft), sum(r not in soft for r in moving.rows)
    if ranks[0] < len(moving.sought) or ranks[1] > ranks[0] or ranks[2] < hard:
        # at this position only, if the rank is higher nearby
        beside = [_ranks(moving, x, soft) for x in neighbours(moving, q).T]
        ranks = np.max([ranks, *beside], axis=0)
        spare = len(moving.sought) - len(moving.rows)  # by Kutzbach
        if driven and len(moving.sought) - ranks[0] > max(spare, len(driven) - len(prescribed)):
            # links lie on one another, as in a folded rhombus: they may lie apart, too
            for x in _around(kinematics, guess).T:
                if (others := _ranks(moving, x, soft))[0] == len(moving.rows):
                    q, ranks = guess + _wrapped(kinematics, (x - guess)[:, None])[:, 0], others
                    break
    freedom, overdriven = len(moving.sought) - int(ranks[0]), int(ranks[1] - ranks[0])
    v, slope = _started(plan, moving, q), None
    along = plan.kinematics(driven)
    decided = driven and freedom == len(driven) - len(prescribed)
    singular = decided and along.independence(q[:, None])[0] < _BRANCHES.singular
    # at a dead point of the drive only its own column is missing, and no branches meet
    if singular and plan.kinematics(()).independence(q[:, None])[0] < _BRANCHES.singular:
        drive = np.array([[*held[c], 0.0] for c in driven]).T
        pace = 1.0
        if len(driven) == 1:  # then it is the parameter itself
            pace, drive[1] = drive[1, 0], 1.0
        if pace and drive[1].any():
            q, slope = begin(plan, along, q, guess, drive, pace)
            v = pace * slope
        elif freedom and not plan.clearances:
            raise InputError(
                f'{", ".join(driven)} starts at rest in a singular position: it is undetermined '
                'which way the links go: start beside it, or with a speed'
            )
    q, v = _hung(plan, q, v)
    dependent = len(moving.rows) - int(ranks[1])
    return Assembly(q, v, freedom, overdriven, hard - int(ranks[2]), slope, four_bar, dependent)


def _hung(plan: ScenePlan, q: Array, v: Array) -> tuple[Array, Array]:
    """The start with links that hang on bushings alone where the points of these coincide.

    What the scene says of their places stays.
    """
    ideal, q, v = plan.ideal, q.copy(), v.copy()
    index = {c: i for i, c in enumerate(ideal.coordinates)}
    left = [*ideal.floating]
    for _ in ideal.floating:  # one depends on the other
        for bushing in plan.scene.bushings.values():
            ends = [plan.find('bushings', point) for point in bushing.between]
            for held, (link, at) in (ends, ends[::-1]):
                if link not in left or held[0] in left:
                    continue
                left.remove(link)
                states = (
                    ideal.trace(place, q[:, None], v[:, None])[:, :, 0]
                    for place in (held, (link, at))
                )
                shift = np.subtract(*states)
                for axis, (place, rate) in zip('xy', shift.T, strict=True):
                    c = f'{link}.{axis}'
                    if c not in plan.guess.keys() | plan.given[0].keys():
                        q[index[c]] += place
                    if c not in plan.given[1]:
                        v[index[c]] += rate
    return q, v


def rates_of_points(plan: ScenePlan) -> dict[str, float]:
    """Rates of coordinates by those that the scene gives of points at the start."""
    known = {c: plan.held[c][1] for c in plan.prescribed} | plan.given[1]
    loops = plan.kinematics(plan.prescribed)
    return rates(loops, plan.given[2], assemble(plan).q, known)


def _apart(loop: FourBarLoop, angle: float) -> str:
    """Reason why a four-bar cannot be assembled with its crank at an angle [rad]."""
    sides = dict(zip((GROUND, *loop.links), loop.linkage.lengths, strict=True))
    longest = max(sides, key=lambda link: sides[link])
    others = sum(sides.values()) - sides[longest]
    if sides[longest] >= others:
        return (
            f': {longest} ({sides[longest]:g} m) is not shorter than the three other links '
            f'together ({others:g} m)'
        )
    crank, coupler, rocker = loop.links
    return (
        f' with {crank} at {math.degrees(angle):.6g} deg: the far joints of {crank} and ground '
        f'are out of reach of {coupler} and {rocker}'
    )


def _ranks(kinematics: Kinematics, q: Array, soft: Sequence[str]) -> Array:
    """Ranks (3,) of the closures: by sought coordinates, by all, and without some joints."""
    _, J = kinematics.closure(q[:, None])
    # free of units: rows in the longest link, displacements too
    scaled = J[0] * kinematics.scale / kinematics.mechanism.size
    hard = scaled[[row not in soft for row in kinematics.rows]]
    parts = scaled[:, kinematics.sought], scaled, hard
    sizes = (np.linalg.svd(x, compute_uv=False) if x.size else np.zeros(0) for x in parts)
    return np.array([int((x > _RANK).sum()) for x in sizes])


def _closed_four_bar(plan: ScenePlan) -> FourBarLoop | None:
    """The four-bar that a machine is, on the branch nearest to its guess; None if it is none.

    Closed forms know two branches of a four-bar; through a change point neither goes on.
    """
    rigid = len(plan.laws) == 1 and not plan.ideal.deformations
    loop = whole_four_bar(plan.ideal, plan.main) if rigid else None
    if loop is None or change_points(loop.linkage):
        return None
    near = plan.guess | plan.given[0]
    angle = plan.held.get(plan.main, (near.get(plan.main, 0.0),))[0]
    guess = np.array([near.get(link, 0.0) for link in loop.links[1:]])

    def off(branch: Branch) -> float:
        found = loop.on(branch).positions(angle)
        return float(np.abs(np.exp(1j * np.array(found)) - np.exp(1j * guess)).sum())

    return loop.on('crossed' if off('crossed') < off('open') else 'open')


def _follows(plan: ScenePlan) -> bool:
    """True if the ideal mechanism's start follows from its main drive alone."""
    main = plan.main
    if main not in plan.held or main in plan.given[1]:
        return False
    loose = plan.clearances and main not in plan.assumed[0]
    return bool(loose) or not plan.placed_outright


def _assembled(plan: ScenePlan, loop: FourBarLoop) -> Assembly:
    """A four-bar at the start."""
    angle, speed = plan.held[plan.main]
    # In extended precision: after a few dozen impacts the last digit of the start counts.
    crank = np.array([[angle], [speed], [0.0]], dtype=np.longdouble)
    q, v, _ = (x[:, 0].astype(float) for x in loop.motion(*crank))
    if np.isnan(q).any():
        raise InputError(f'the mechanism cannot be assembled{_apart(loop, angle)}')
    order = [loop.links.index(c) for c in plan.ideal.coordinates]
    return Assembly(q[order], v[order], len(plan.powered), 0, 0, None, loop)


def _placed(plan: ScenePlan, guess: Array) -> tuple[Kinematics, Array]:
    """Coordinates that close all loops, with the drives and what is given where they should be.

    Loose joints allow more to be given than the mechanism without clearance can have: then it has
    what it can, in the order of the scene.
    """

    def close(held: Collection[str]) -> tuple[Kinematics, Array]:
        kinematics = plan.kinematics([c for c in plan.ideal.coordinates if c in held])
        return kinematics, closed_near(kinematics, guess)

    said = [c for c in plan.begins if c not in plan.assumed[0]]
    all_of_them = [*dict.fromkeys((*plan.prescribed, *plan.begins, *plan.given[0]))]
    try:
        return close(all_of_them)
    except InputError:
        if not plan.given[0] or not (plan.clearances or plan.assumed[0]):
            raise
    held = [*dict.fromkeys((*plan.prescribed, *said))]
    for c in (*plan.given[0], *plan.begins):
        if c not in held:
            try:
                close([*held, c])
            except InputError:
                if c in plan.given[0] and not plan.clearances:
                    raise
            else:
                held.append(c)
    return close(held)


def _started(plan: ScenePlan, kinematics: Kinematics, q: Array) -> Array:
    """Rates with which all loops stay closed; those of drives and those given are kept."""
    coordinates = plan.ideal.coordinates
    rates = {c: plan.held[c][1] for c in plan.prescribed}
    for c, rate in plan.given[1].items():
        if c in rates and abs(rate - rates[c]) > 1e-12 * max(abs(rate), abs(rates[c])):
            raise InputError(
                f'initial.velocity.{c} is {rate:g}, but its drive begins with {rates[c]:g}; leave '
                'one of them out'
            )
    begun = {c: w for c, (_, w) in plan.begins.items() if c not in plan.given[1]}
    for c, rate in {**plan.given[1], **begun}.items():
        if c in rates:
            continue
        v = nearest_rates(kinematics, q, coordinates, {**rates, c: rate}, {})
        joint, speed = opening(kinematics, q, v)
        if speed <= _OPENING * (np.abs(v).max(initial=0.0) * plan.ideal.size):
            rates[c] = rate
        elif c in plan.given[1] and not plan.clearances:  # the rest follows from the others
            paces = ', '.join(f'{x} at {w:g}' for x, w in (rates | {c: rate}).items())
            raise InputError(
                f'initial.velocity is not possible: with {paces} the loop closed by {joint} '
                f'would open at {speed:.4g} m/s; leave one of them out'
            )
    return nearest_rates(kinematics, q, coordinates, rates, {})


def opening(kinematics: Kinematics, q: Array, v: Array) -> tuple[str, float]:
    """The joint whose closure opens fastest at rates (n,), and its rate [m/s]."""
    _, J = kinematics.closure(q[:, None])
    speeds = np.abs(J[0] @ v)
    worst = int(np.argmax(speeds)) if speeds.size else 0
    return (kinematics.rows[worst], float(speeds[worst])) if speeds.size else ('', 0.0)


def closed_near(kinematics: Kinematics, guess: Array, targets: Array | None = None) -> Array:
    """Coordinates (n,) that close all loops, near a guess whose held ones count.

    Where Newton's method fails from the guess itself, it starts from others around it, and the
    nearest of its results is taken. Without `targets` links must face each other there as their
    joints say: the closure of a Geneva wheel also vanishes half a slot off, that of a guide half
    a turn.
    """
    q, left = kinematics.positions(guess[:, None], targets)
    if not _fits(kinematics, q, left, targets)[0]:
        found = _around(kinematics, guess, targets, (q, left))
        q = found[:, :1]
    return guess + _wrapped(kinematics, q - guess[:, None])[:, 0]


def _fits(kinematics: Kinematics, q: Array, left: Array, targets: Array | None) -> Mask:
    """Mask (N,) of results of `Kinematics.positions` that close the loops as the joints say."""
    return np.asarray((left == 0.0) & (kinematics.faces(q) if targets is None else True))


def _around(
    kinematics: Kinematics,
    guess: Array,
    targets: Array | None = None,
    first: tuple[Array, Array] | None = None,
) -> Array:
    """Coordinates (n, N) that Newton's method reaches from around a guess, the nearest first.

    `first` is its result from the guess itself, for the message if there are none.
    """
    spread = np.random.default_rng(1).standard_normal((len(guess), _TRIES))
    slides = [c in kinematics.mechanism.displacements for c in kinematics.coordinates]
    spread *= np.where(slides, kinematics.mechanism.size, 1.0)[:, None]
    spread *= np.linspace(0.05, 2.0, _TRIES)
    spread[kinematics.held] = 0.0
    q, left = kinematics.positions(guess[:, None] + spread, targets)
    far = np.abs(_wrapped(kinematics, q - guess[:, None])).max(axis=0)
    good = _fits(kinematics, q, left, targets)
    if not good.any() and first:
        best = int(np.argmin(left))
        near, miss = (q[:, best], left[best])
        if left[best] >= first[1][0]:
            near, miss = first[0][:, 0], first[1][0]
        raise _refusal(kinematics, near, float(miss), targets)
    order = np.argsort(np.where(good, far, np.inf), kind='stable')
    return q[:, order[: good.sum()]]


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
        scale = kinematics.scale[rest]
        v[rest] += scale * np.linalg.lstsq(J[0][:, rest] * scale, right, rcond=None)[0]
    return v


def _wrapped(kinematics: Kinematics, shift: Array) -> Array:
    """Differences of coordinates without whole turns of those sought."""
    names = kinematics.mechanism.displacements
    turning = [i for i in kinematics.sought if kinematics.coordinates[i] not in names]
    shift[turning] -= TWO_PI * np.round(shift[turning] / TWO_PI)
    return shift


def _refusal(kinematics: Kinematics, q: Array, miss: float, targets: Array | None) -> InputError:
    off = kinematics.closure(q[:, None])[0][0] - (0.0 if targets is None else targets)
    loops = {joint: _sides(kinematics.mechanism, joint) for joint in kinematics.rows}
    torn = {
        j: sides for j, sides in loops.items() if 2.0 * max(sides.values()) > sum(sides.values())
    }
    joint = next(iter(torn), kinematics.rows[int(np.argmax(np.abs(off)))])
    placed = _positions_text(kinematics, q, range(len(q)))
    if torn:
        sides = torn[joint]
        longest = max(sides, key=lambda link: sides[link])
        advice = (
            f'{longest} is {sides[longest]:.4g} m long between its joints, more than the others '
            f'of the loop together ({sum(sides.values()) - sides[longest]:.4g} m)'
        )
    else:
        advice = _advice(kinematics, q, targets)
    return InputError(
        f'the mechanism cannot be assembled: the loop closed by the joint {joint} '
        f'({", ".join(loops[joint])}) stays open by {miss:.4g} m, nearest with {placed}; {advice}'
    )


def _advice(kinematics: Kinematics, q: Array, targets: Array | None) -> str:
    """Advice where no link is too long."""
    freedom = len(q) - len(kinematics.rows)
    held = [kinematics.coordinates[i] for i in kinematics.held]
    if len(held) > freedom:
        return (
            f'Kutzbach counts a freedom of {freedom}, given are {", ".join(held) or "none"}: is '
            'there a drive or a joint too many?'
        )
    free, left = kinematics.released().positions(q[:, None], targets)
    if held and not left[0]:
        near = _positions_text(kinematics, free[:, 0], kinematics.held)
        return (
            f'the nearest that can be assembled has {near}: start the drive there, or check the '
            'lengths'
        )
    return "check the lengths of that loop, or give a better 'guess'"


def _positions_text(kinematics: Kinematics, q: Array, which: Iterable[int]) -> str:
    straight = kinematics.mechanism.displacements
    return ', '.join(
        f'{c} = {q[i]:.4g} m' if c in straight else f'{c} = {np.degrees(q[i]):.4g} deg'
        for i, c in ((i, kinematics.coordinates[i]) for i in which)
    )


def _sides(mechanism: Mechanism, closing: str) -> dict[str, float]:
    """The links of a loop, with the distances of their joints [m].

    No numbers if any slides, or where loose joints leave a part of the loop on no tree.
    """
    last, carried = mechanism.joint(closing), mechanism.tree_joints

    def way(link: str) -> list[str]:
        return [link, *way(mechanism.parent(link))] if link in carried else [link]

    up, down = way(last.first), way(last.second)
    top = next((i for i, link in enumerate(up) if link in down), None)
    if top is None:
        return dict.fromkeys((*up, *down), math.nan)
    down = down[: down.index(up[top])][::-1]
    joints = [last, *(carried[link] for link in (*up[:top], *down)), last]
    turning = all(isinstance(j, Revolute) for j in joints)
    return {
        link: math.dist(a.on(link), b.on(link)) if turning else math.nan
        for link, (a, b) in zip((*up[: top + 1], *down), pairwise(joints), strict=True)
    }
