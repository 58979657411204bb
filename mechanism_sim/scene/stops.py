"""Stops that drives cannot pass: what is refused before anything moves."""

from __future__ import annotations

import math

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.joints.joint_keys import bounds_of
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.scene.equations import moving
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.plan import announce
from mechanism_sim.scene.start import check_apart

_ROUNDING = 1e-9
"""Of the size of the machine: by so much nothing overlaps."""
_PLAYS = 10.0
"""Plays of loose joints, all together, by which they may give way."""
_INSTANTS = 2001
_TURNS = 16
"""Of a steady drive, whose way is tried."""


def check_stops(machine: Machine, duration: float) -> None:
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
    if known:  # play gives way to the drive a little
        room += _PLAYS * sum(play.radial for play in plan.clearances.values())
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
    """As much of a run [s] as need be tried."""
    plan = machine.plan
    laws = (law for c in plan.prescribed for law in plan.laws_until(c, duration))
    last = max(law.valid_from for law in laws)
    return min(duration, last + _TURNS * machine.drive.period)


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
        for law in machine.plan.laws_until(c, float(times[-1])):
            assert isinstance(law, DriveLaw)  # noqa: S101 - it is prescribed
            now = times >= law.valid_from
            moved = np.polynomial.polynomial.polyval(
                times[now] - law.reference_time, law.coefficients
            )
            q[frames.coordinates.index(c), now] = moved + 2.0 * math.pi * law.turns
    return times, q
