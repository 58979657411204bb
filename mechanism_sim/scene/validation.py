"""Validation for all commands and nodes: what `check` refuses none runs, what it accepts all run.

Whether a machine can go the way that its drives prescribe is a matter of geometry: the cost does
not depend on how long the run is, nor on how slow the drive.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.polynomial import polynomial

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.joints.joint_keys import bounds_of
from mechanism_sim.keys.names import scene_errors
from mechanism_sim.linkages.drive_range import DriveRange
from mechanism_sim.linkages.four_bar import FourBarLoop
from mechanism_sim.linkages.grashof import crank_limits
from mechanism_sim.linkages.nominal import NominalRun
from mechanism_sim.planar.drive import DriveLaw, Law, ends
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.scene.assembly import closed_near
from mechanism_sim.scene.equations import moving
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.motion_notes import between
from mechanism_sim.scene.plan import announce
from mechanism_sim.scene.start import check_apart
from mechanism_sim.units import for_people

_ROUNDING = 1e-9  # share of the machine's size within which nothing overlaps
_PLAYS = 10.0  # plays of loose joints, all together, by which they may give way
_INSTANTS = 2001
_TURNS = 16  # turns of a steady drive that are tried
TURN = 2.0 * math.pi
_PACE = 2.0 * TURN
"""[rad/s] of the drive where it is tried out; in sizes of the machine if it slides."""

_MOST = 16  # turns of the drive for which several drives are tried together

_STEP = 0.05
"""[rad], or sizes of the machine, after which it is tried whether loops can still be closed."""

_STEPS = 400  # so often at most

Way = tuple[float, float]
"""Least and greatest value of a coordinate [rad, m]."""


def validate(machine: Machine, duration: float | None = None) -> Machine:
    """The machine, if it can start as required and move for a duration [s].

    That it can for a turn, or for as long as its scene says, was found when it was built.
    """
    with scene_errors(machine.name):
        try:
            if machine.level.dynamic:
                machine.initial_state()
        except ZeroDivisionError as error:  # of the mass matrix: its terms are lost by rounding
            masses = {name: link.mass for name, link in machine.scene.links.items() if link.mass}
            least = min(masses, key=lambda name: masses[name], default='')
            which = f"; 'links.{least}.mass' is {masses[least]:g} kg, the least" if least else ''
            raise InputError(
                f'something could move without moving any mass{which}: give it more'
            ) from error
        if duration is not None:
            _check_way(machine, duration)
    return machine


def check_scenes_way(machine: Machine) -> None:
    """Refuse drives that the machine cannot follow for a turn, or for the scene's duration.

    A scene that says no duration is for a machine in all its positions, too: if its drive cannot
    turn round, only a run that asks it to is refused.
    """
    duration = machine.scene.duration or (
        machine.drive.period if _turns_steadily(machine) else math.inf
    )
    if duration < math.inf and not between_limits(machine):
        _check_way(machine, duration)


def validate_turning(machine: Machine, duration: float) -> None:
    """Refuse a run of a drive that cannot turn round beyond its limits, which are both told."""
    if _turns_steadily(machine) and between_limits(machine):
        validate(machine, duration)


def validate_loose(machine: Machine, what: str) -> None:
    """Refuse a machine without clearance, or whose main drive does not turn steadily.

    Parameters
    ----------
    what : request with its verb: ``statistics need``
    """
    steady = _turns_steadily(machine) and machine.drive.fastest and not machine.torque_driven
    if not (steady and machine.plan.clearances):
        raise InputError(f'{machine.name}: {what} clearance and a crank at constant speed')


def _turns_steadily(machine: Machine) -> bool:
    """True if the main drive rotates at constant speed, with any further drives; all follows."""
    return _rotates(machine) and not machine.rigid.torque_driven


def _rotates(machine: Machine) -> bool:
    return machine.plan.main not in machine.mechanism.displacements and machine.drive.steady


def turns_round(machine: Machine) -> bool:
    """True if the main drive turns at constant speed, and can for a turn; all else may be free."""
    if not _rotates(machine):
        return False
    try:
        _check_way(machine, machine.drive.period)
    except InputError:
        return False
    return True


def between_limits(machine: Machine) -> DriveRange | None:
    """The limits of a machine whose only drive, at constant speed, comes to one on either side.

    They are those of its links without clearance. None where the scene says how long it runs:
    then it stays within, or is refused.
    """
    drive, nominal = machine.drive, machine.rigid.nominal
    alone = len(machine.plan.laws) == 1 and not machine.rigid.torque_driven
    if machine.scene.duration or not alone or not (drive.steady and drive.start[1]):
        return None
    if turns_round(machine):
        return None
    found = nominal.drive_range
    return found if found and math.isfinite(found.low) and math.isfinite(found.high) else None


def limits_text(machine: Machine) -> str:
    """Sentence on the limits of a machine with a single drive; else empty."""
    machine = machine.rigid
    found, main = machine.nominal.drive_range, machine.plan.main
    if not found or not found.limited:
        return ''
    turns = main not in machine.plan.ideal.displacements
    turned = TURN * machine.plan.turned.get(main, 0) if turns else 0.0
    shown, scale = for_people('rad' if turns else 'm', machine.mechanism.size)
    low, high = (f'{scale * (x + turned):.9g} {shown}' for x in (found.low, found.high))
    if not math.isfinite(found.low):
        return f'{main} reaches a limit at {high}, and none before'
    if not math.isfinite(found.high):
        return f'{main} reaches a limit at {low}, and none beyond'
    return f'{main} moves from {low} to {high}'


def _check_way(machine: Machine, duration: float) -> None:
    """Refuse prescribed drives that the ideal machine cannot follow for a duration.

    The way of one drive is tried once from the start to either end, a turn of it at most where
    all is as before after one. Several drives are tried together, at their own pace.
    """
    machine = machine.rigid
    # called in every run: a duration already tested is not repeated
    if duration not in machine.drive.ways_tried:
        _try_way(machine, duration)
        machine.drive.ways_tried[duration] = ''


def _try_way(machine: Machine, duration: float) -> None:
    """Refuse a way that cannot be followed, see `_check_way`; its tried ends are entered."""
    tried = machine.drive.ways_tried
    _check_stops(machine, duration)
    if machine.torque_driven:
        if machine.plan.prescribed:
            _try_loops(machine, duration)
        return
    plan = machine.plan
    moving = {
        c: w for c in plan.prescribed if (w := way_of(*plan.laws_until(c, duration)))[0] < w[1]
    }
    if len(moving) > 1 or (moving and len(plan.prescribed) > 1):
        run = machine.nominal.run([each[0] for each in plan.laws.values()])
        announce(plan, run, plan.laws)
        _advance(run, min(duration, _MOST * machine.drive.period))
        return
    for c, way in moving.items():
        start = _value(plan.laws[c][0], 0.0)
        straight = c in plan.ideal.displacements
        reach = math.inf if straight else machine.nominal.reach
        ends = max(way[0], start - reach), min(way[1], start + reach)
        if loop := machine.assembly.loop:
            _check_four_bar(machine, loop, ends)
            continue
        for end in ends:
            if end == start:
                continue
            if (start, end) not in tried:
                pace = _PACE * (plan.ideal.size if straight else 1.0)
                pace = math.copysign(pace, end - start)
                run = machine.nominal.run([DriveLaw(c, (start, pace), straight=straight)])
                tried[start, end] = _stopped(machine, run, (end - start) / pace)
            if tried[start, end]:
                raise InputError(tried[start, end])


def way_of(laws: Sequence[Law], duration: float) -> Way:
    """Least and greatest value of prescribed laws from the start of a run to its end."""
    seen = []
    for law, begin, end in ends(laws, duration):
        if begin <= end:
            rate = np.trim_zeros(polynomial.polyder(law.coefficients), 'b')
            turning = polynomial.polyroots(rate) if len(rate) > 1 else np.zeros(0)
            real = law.reference_time + turning[np.abs(turning.imag) < 1e-9].real
            at = [begin, end, *(t for t in real.tolist() if begin < t < end)]
            seen += [_value(law, t) for t in at]
    return min(seen), max(seen)


def _value(law: Law, t: float) -> float:
    """Value of a prescribed coordinate at a time [rad, m]."""
    assert isinstance(law, DriveLaw)  # noqa: S101 - it is prescribed
    value = float(polynomial.polyval(t - law.reference_time, law.coefficients))
    return value + law.turns * TURN


def _check_four_bar(machine: Machine, loop: FourBarLoop, way: Way) -> None:
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
            own = f'; {limits_text(machine)}' if loop.turned[0] else ''
            raise InputError(
                f'the {crank} cannot make a full turn at constant speed ({said}): ground and '
                f'{crank} in line must leave a triangle with {loop.links[1]} and {loop.links[2]}; '
                f'shorten the {crank}, or keep it between {limits} deg from the line of the '
                f"ground joints by a 'profile' and 'duration'{own}"
            )


def _try_loops(machine: Machine, duration: float) -> None:
    """Refuse drives along which loops without clearance cannot close, wherever other links go."""
    mechanism, plan = machine.mechanism, machine.plan
    prescribed = plan.prescribed
    laws = {c: plan.laws_until(c, duration) for c in prescribed}
    duration = min(end for _, end in laws.values())
    loops = machine.plan.loops(prescribed)
    if not loops.rows:
        return
    known = dict(zip(machine.equations.system.free, machine.initial_state().q, strict=True))
    q = np.array([[known.get(c, 0.0)] for c in mechanism.coordinates])
    ways = [way_of(laws[c][0], duration) for c in prescribed]
    scale = loops.scale[loops.held]
    count = math.ceil(
        sum((high - low) / (_STEP * x) for (low, high), x in zip(ways, scale, strict=True))
    )
    for k in range(min(count, _STEPS) + 1):
        t = duration * k / max(count, 1)
        law = [next(x for x in reversed(laws[c][0]) if x.valid_from <= t) for c in prescribed]
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


def _stopped(machine: Machine, run: NominalRun, duration: float) -> str:
    """Reason why a single drive cannot move for a duration, with its limits; else empty."""
    try:
        _advance(run, duration)
    except InputError as error:
        limits = limits_text(machine)
        return f'{error}; {limits}' if limits else str(error)
    return ''


def _advance(run: NominalRun, duration: float) -> None:
    try:
        run.motion(duration)
    except RunError as error:
        raise InputError(
            f"{error}; change the lengths, or keep the drive within limits by a 'profile' and "
            "'duration'"
        ) from error


def _check_stops(machine: Machine, duration: float) -> None:
    """Refuse drives that take links beyond stops, or into each other, whatever forces do.

    That is so where closed loops say all of the motion, but for some play, or a stop is between
    driven links.
    """
    plan = machine.plan
    if not plan.touching:
        return
    known = not machine.torque_driven
    mechanism = plan.ideal if known else plan.loose
    frames = Frames(mechanism.coordinates, Parameters())
    gaps = [
        gap
        for gap in bounds_of(machine.scene.joints, mechanism, plan.touching)
        if known or moving(gap, frames) <= {*plan.prescribed}
    ]
    if not gaps:
        return
    if rated := [gap.joint for gap in gaps if gap.value(frames).value is None]:
        raise InputError(
            f'joints.{rated[0]} holds one way, but drives and closed loops determine all of the '
            'motion between its links: leave it out, or one of the drives'
        )
    if machine.drive.commands:
        raise InputError(
            f'the drive takes commands of speed, so that it may take {gaps[0].overlap}: give it a '
            "'torque' or a 'motor', or leave out the stops"
        )
    times, q = _motion(machine, duration) if known else _driven(machine, frames, duration)
    values = SwitchedFunction(
        frames,
        [[gap.value(frames).value for gap in gaps]],
        [*frames.q.values(), *frames.outside.values()],
    )
    inputs = np.concatenate([q, np.zeros((len(frames.outside), q.shape[1]))])  # q has all turns
    distances = [gap.distance(x) for gap, x in zip(gaps, values(inputs)[0], strict=True)]
    room = _ROUNDING * mechanism.size
    if known:  # clearances allow the drive some more
        room += _PLAYS * sum(spec.radial for spec in plan.clearances.values())
    else:
        for gap, distance in zip(gaps, distances, strict=True):
            check_apart(gap, float(distance[0]), mechanism.size)
    found = []
    for gap, distance in zip(gaps, distances, strict=True):
        arm = max(1.0, getattr(gap, 'radius', 0.0) / mechanism.size)
        beyond = np.flatnonzero(distance < -room * arm)
        found += [(times[beyond[0]], gap)] if beyond.size else []
    if found:
        t, gap = min(found, key=lambda x: x[0])
        raise InputError(
            f'the drive takes {gap.overlap}, before t = {t:.6g} s: keep it within by a '
            f"'profile' and 'duration', give it a 'torque', or change 'joints.{gap.joint}'"
        )


def _span(machine: Machine, duration: float) -> float:
    """Part of a run to be tried [s]."""
    plan = machine.plan
    looked = [plan.laws_until(c, duration) for c in plan.prescribed]
    last = max(law.valid_from for laws, _ in looked for law in laws)
    return min(last + _TURNS * machine.drive.period, *(end for _, end in looked))


def _motion(machine: Machine, duration: float) -> tuple[Array, Array]:
    """Times (N,) and coordinates (n, N) of the mechanism without clearance."""
    plan = machine.plan
    run = machine.nominal.run([each[0] for each in plan.laws.values()])
    announce(plan, run, plan.laws)
    curve = run.motion(_span(machine, duration)).curve
    nodes = np.linspace(0.0, 1.0, 17)
    times = np.unique(curve.start[:, None] + curve.duration[:, None] * nodes)
    return times, curve(times).T


def _driven(machine: Machine, frames: Frames, duration: float) -> tuple[Array, Array]:
    """Times (N,) and coordinates (n, N), of which all but the driven ones are zero."""
    times = np.linspace(0.0, _span(machine, duration), _INSTANTS)
    q = np.zeros((len(frames.coordinates), len(times)))
    for c in machine.plan.prescribed:
        for law in machine.plan.laws_until(c, float(times[-1]))[0]:
            assert isinstance(law, DriveLaw)  # noqa: S101 - it is prescribed
            now = times >= law.valid_from
            moved = np.polynomial.polynomial.polyval(
                times[now] - law.reference_time, law.coefficients
            )
            q[frames.coordinates.index(c), now] = moved + 2.0 * math.pi * law.turns
    return times, q
