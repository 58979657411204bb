"""Length as a dimension of the grid: far starts, many revolutions and slow drives of any machine.

What a machine does depends on how often it has turned and on how late it is only where its loads
ask for that. So a run that stands at 12 days and 100,000 turns goes on bit by bit as it does from
the start; and many revolutions of an ideal machine, or a slow drive, leave its loops closed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

import numpy as np

from mechanism_sim.engine.audit import Audit
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.snapshot import Snapshot
from mechanism_sim.errors import InputError
from mechanism_sim.planar.drive import DriveLaw, Law
from mechanism_sim.results.simulate import stream
from mechanism_sim.scene import Machine, run_length
from mechanism_sim.scene.machine import Run

LATE = Fraction(2**20)
"""[s] Some twelve days: a time since then, added to it, loses 20 of its digits in a float."""

OFTEN = 100_000
"""Turns."""

STEPS = 400
"""Of a run that is compared with the same far from its start."""

REVOLUTIONS, PIECES = 40, 1500
"""Of an ideal machine under a steady drive: fewer where loads vary so fast that a revolution has
more pieces."""

SLOW = 1e-4  # [rad/s]
_CLOSED = 1e-12  # of the size: how far loops may be open after that


def far_from_start(machine: Machine, time: Fraction = LATE, turns: int = OFTEN) -> Run:
    """A run of a machine that stands where it starts, but at another time and after turns.

    All angles have made the same number of whole turns. What depends neither on the time nor on
    the count of turns goes on as it began.
    """
    run = machine.start()
    run.restore(moved(run.snapshot(), machine, time, turns))
    return run


def moved(snapshot: Snapshot, machine: Machine, time: Fraction, turns: int) -> Snapshot:
    """A snapshot later by a time [s], which has to be a float, and by whole turns."""
    angles = {c for c in snapshot.turns if c not in machine.mechanism.displacements}

    def later(law: Law) -> Law:
        law = replace(law, valid_from=law.valid_from + float(time))
        if not isinstance(law, DriveLaw):
            return law
        at = law.reference_time + float(time)
        return replace(law, reference_time=at, turns=law.turns + turns * (not law.straight))

    return replace(
        snapshot,
        base=snapshot.base + time,
        turns={c: n + turns * (c in angles) for c, n in snapshot.turns.items()},
        laws=tuple(later(law) for law in snapshot.laws),
        coming=tuple(later(law) for law in snapshot.coming),
        last_event=snapshot.last_event + float(time),
    )


def defects(machine: Machine, duration: float) -> Iterator[str]:
    """Yield defects of a machine far from its start, after many turns, or driven slowly.

    Parameters
    ----------
    duration : for which it can go its way [s]
    """
    time, turns = _shifts(machine)
    if time or turns:
        starts = machine.start(), far_from_start(machine, time, turns)
        near, far = (_steps(run, duration) for run in starts)
        a, b = near.curve, far.curve
        same = a.coefficients.shape == b.coefficients.shape and np.array_equal(
            a.coefficients, b.coefficients
        )
        if not (same and np.array_equal(a.duration, b.duration)):
            yield f'it moves otherwise {float(time):g} s and {turns} turns later'
    if not machine.level.dynamic and _steady(machine):
        bound = _CLOSED * max(machine.mechanism.size, machine.mechanism.reach)
        once = stream(machine, duration=machine.drive.period).finish()
        turns = min(REVOLUTIONS, 1 + PIECES // once.engine.steps)
        long = stream(machine, duration=turns * machine.drive.period).finish()
        slow, law = Audit(machine.physics), machine.drive.law
        assert isinstance(law, DriveLaw)
        run = machine.nominal.run([replace(law, coefficients=_slowed(machine))])
        slow.add(_steps(run, 2.0**20), [])
        for words, x in (
            (f'after {turns} revolutions', long.max_closure_error),
            (f'at {SLOW:g} rad/s', slow.max_closure_error),
        ):
            if not x <= bound:
                yield f'loops are open by {x:.3g} m {words}, allowed {bound:.3g} m'


def _shifts(machine: Machine) -> tuple[Fraction, int]:
    """By what a run may be moved [s, turns] without any other motion."""
    if machine.level.dynamic:
        outside = {*machine.equations.system.outside}
    else:
        outside = (
            {*machine.nominal.inverse_dynamics.outside} if machine.physics.has_forces else set()
        )
    laws = [law for laws in machine.plan.laws.values() for law in laws]
    by_time = 'time' in outside or len(laws) > len(machine.plan.laws)
    springs = any(not isinstance(law, DriveLaw) and law.coefficients[1] for law in laws)
    by_turns = springs or bool(outside - {'time'})
    return Fraction(0) if by_time else LATE, 0 if by_turns else OFTEN


def _steady(machine: Machine) -> bool:
    """True if one drive turns the machine evenly, for ever."""
    law = machine.drive.law
    alone = len(machine.plan.laws) == 1 and len(machine.drive.laws) == 1
    if not (alone and isinstance(law, DriveLaw) and law.degree == 1 and not law.straight):
        return False
    try:
        run_length(machine, 1.0, None)
    except InputError:
        return False
    return True


def _slowed(machine: Machine) -> tuple[float, float]:
    angle, speed = machine.drive.start
    return angle, float(np.copysign(SLOW, speed))


def _steps(run: Run, duration: float) -> Motion:
    """The first steps of a run, within a time [s] that adds up without rounding."""
    run.advance(run.time + math.floor(duration * 2.0**20) / 2.0**20, most=STEPS)
    return run.drain()[0]
