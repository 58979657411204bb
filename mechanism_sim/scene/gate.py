"""The gate of all commands and nodes: what `check` refuses none runs, what it accepts all run.

Whether a machine can go the way that its drives prescribe is a matter of geometry: the cost does
not depend on how long the run is, nor on how slow the drive.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.polynomial import polynomial

from mechanism_sim.errors import InputError, RunError
from mechanism_sim.keys.names import scene_errors
from mechanism_sim.linkages.grashof import crank_limits
from mechanism_sim.linkages.loops import FourBarLoop
from mechanism_sim.linkages.nominal import NominalRun
from mechanism_sim.planar.drive import DriveLaw, Law
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.assembly import closed_near
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.motion_notes import between
from mechanism_sim.scene.stops import check_stops

TURN = 2.0 * math.pi
_PACE = 2.0 * TURN
"""[rad/s] of the drive where it is tried out; in sizes of the machine if it slides."""

_MOST = 16
"""Turns from the start that are tried of a machine that need not come back after one."""

_STEP = 0.05
"""[rad], or sizes of the machine, after which it is tried whether loops can still be closed."""

_STEPS = 400
"""So often at most."""

Way = tuple[float, float]
"""Least and greatest value of a coordinate [rad, m]."""


def admit(machine: Machine, duration: float | None = None) -> Machine:
    """The machine, if it can start where it should and go its way for so long [s].

    That it can for a turn, or for as long as its scene says, was found when it was built.
    """
    with scene_errors(machine.name):
        try:
            if machine.level.dynamic:
                machine.initial_state()
        except ZeroDivisionError as error:  # of the mass matrix: what adds to it is rounded off
            masses = {name: link.mass for name, link in machine.scene.links.items() if link.mass}
            least = min(masses, key=lambda name: masses[name], default='')
            which = f"; 'links.{least}.mass' is {masses[least]:g} kg, the least" if least else ''
            raise InputError(
                f'something could move without moving any mass{which}: give it more'
            ) from error
        if duration is not None:
            check_way(machine, duration)
    return machine


def check_scenes_way(machine: Machine) -> None:
    """Refuse drives that it cannot follow for a turn, or for as long as the scene says."""
    law = machine.drive.law
    steady = (
        isinstance(law, DriveLaw)
        and not law.straight
        and len(machine.drive.laws) == 1
        and not machine.rigid.torque_driven
    )
    duration = machine.scene.duration or (machine.drive.period if steady else math.inf)
    if duration < math.inf:
        check_way(machine, duration)


def check_way(machine: Machine, duration: float) -> None:
    """Refuse prescribed drives that the machine without clearance cannot follow for so long.

    The way of one drive is tried once from the start to either end, a turn of it at most where
    all is as before after one. Several drives are tried together, at their own pace.
    """
    machine = machine.rigid
    check_stops(machine, duration)
    if machine.torque_driven:
        if machine.plan.prescribed and duration not in machine.ways:
            machine.ways.add(duration)
            _try_loops(machine, duration)
        return
    plan, tried = machine.plan, machine.ways
    moving = {c: w for c in plan.prescribed if (w := way_of(plan.laws[c], duration))[0] < w[1]}
    if len(moving) > 1 or (moving and len(plan.prescribed) > 1):
        if duration not in tried:
            laws = list(plan.laws.values())
            run = machine.nominal.run([each[0] for each in laws])
            for later in (law for each in laws for law in each[1:]):
                run.change_law(later)
            _advance(run, min(duration, _MOST * machine.drive.period))
            tried.add(duration)
        return
    for c, way in moving.items():
        start = _value(plan.laws[c][0], 0.0)
        reach = math.inf
        if c not in plan.ideal.displacements:
            again = not any(isinstance(j, HigherPair) for j in plan.joints)
            reach = TURN if again else _MOST * TURN
        ends = max(way[0], start - reach), min(way[1], start + reach)
        if loop := machine.assembly.loop:
            _check_four_bar(loop, ends)
            continue
        for end in ends:
            if end != start and (start, end) not in tried:
                straight = c in plan.ideal.displacements
                pace = _PACE * (plan.ideal.size if straight else 1.0)
                pace = math.copysign(pace, end - start)
                run = machine.nominal.run([DriveLaw(c, (start, pace), straight=straight)])
                _advance(run, (end - start) / pace)
                tried.add((start, end))


def way_of(laws: Sequence[Law], duration: float) -> Way:
    """Where prescribed laws lead from the start of a run to its end."""
    seen = []
    for law, later in zip(laws, [*laws[1:], None], strict=True):
        begin, end = law.valid_from, min(duration, later.valid_from if later else math.inf)
        if isinstance(law, DriveLaw) and begin <= end:
            rate = np.trim_zeros(polynomial.polyder(law.coefficients), 'b')
            turning = polynomial.polyroots(rate) if len(rate) > 1 else np.zeros(0)
            real = law.reference_time + turning[np.abs(turning.imag) < 1e-9].real
            at = [begin, end, *(t for t in real.tolist() if begin < t < end)]
            seen += [_value(law, t) for t in at]
    return min(seen), max(seen)


def _value(law: Law, t: float) -> float:
    """Where a prescribed coordinate is [rad, m]."""
    assert isinstance(law, DriveLaw)  # noqa: S101 - it is prescribed
    value = float(polynomial.polyval(t - law.reference_time, law.coefficients))
    return value + law.turns * TURN


def _check_four_bar(loop: FourBarLoop, way: Way) -> None:
    """Refuse a crank that with the ground leaves no triangle to coupler and rocker on its way."""
    linkage, crank = loop.linkage, loop.links[0]
    low, high = crank_limits(linkage)
    way = way[0] + loop.turned[0], way[1] + loop.turned[0]
    for middle, half in ((0.0, low), (math.pi, math.pi - high)):
        # the first forbidden part at or after the least angle of the way
        first = middle + TURN * math.ceil((way[0] - half - middle) / TURN)
        if half > 0.0 and first - half <= way[1]:
            limits = between(math.degrees(low), math.degrees(high))
            named = zip((GROUND, *loop.links), linkage.lengths, strict=True)
            said = ', '.join(f'{n} {x:g} m' for n, x in named)
            raise InputError(
                f'the {crank} cannot make a full turn at constant speed ({said}): ground and '
                f'{crank} in line must leave a triangle with {loop.links[1]} and {loop.links[2]}; '
                f'shorten the {crank}, or keep it between {limits} deg from the line of the '
                "ground joints by a 'profile' and 'duration'"
            )


def _try_loops(machine: Machine, duration: float) -> None:
    """Refuse drives along which loops without clearance cannot close, wherever other links go."""
    mechanism, laws = machine.mechanism, machine.plan.laws
    prescribed = machine.plan.prescribed
    loops = machine.plan.loops(prescribed)
    if not loops.rows:
        return
    known = dict(zip(machine.equations.system.free, machine.initial_state().q, strict=True))
    q = np.array([[known.get(c, 0.0)] for c in mechanism.coordinates])
    ways = [way_of(laws[c], duration) for c in prescribed]
    scale = loops.scale[loops.held]
    count = math.ceil(
        sum((high - low) / (_STEP * x) for (low, high), x in zip(ways, scale, strict=True))
    )
    for k in range(min(count, _STEPS) + 1):
        t = duration * k / max(count, 1)
        law = [next(x for x in reversed(laws[c]) if x.valid_from <= t) for c in prescribed]
        q[loops.held, 0] = [_value(x, t) for x in law]
        q, left = loops.positions(q)
        if not left[0]:
            continue
        try:
            q = closed_near(loops, q[:, 0])[:, None]
        except InputError as error:
            raise InputError(
                f'the machine cannot follow its drive beyond t = {t:.6g} s: {error}; change the '
                "lengths, or keep the drive within limits by a 'profile' and 'duration'"
            ) from error


def _advance(run: NominalRun, duration: float) -> None:
    try:
        run.motion(duration)
    except RunError as error:
        raise InputError(
            f"{error}; change the lengths, or keep the drive within limits by a 'profile' and "
            "'duration'"
        ) from error
