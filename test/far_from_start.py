"""Runs that stand far from their start, without the cost of having got there."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from mechanism_sim.hybrid.snapshot import Snapshot
from mechanism_sim.planar.drive import DriveLaw, Law
from mechanism_sim.scene import Machine
from mechanism_sim.scene.machine import Run

LATE = Fraction(2**20)
"""[s] Some twelve days: a time since then added to it loses 20 of its digits in a float."""
OFTEN = 100_000
"""Turns."""


def far_from_start(machine: Machine, time: Fraction = LATE, turns: int = OFTEN) -> Run:
    """A run of a machine that stands where it starts, but at another time and after turns.

    All angles have made the same number of whole turns, as all of a machine have that turns
    about an axis. What depends neither on time nor on the count of turns goes on as it began.
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
        whole = 0 if law.straight else turns
        at = law.reference_time + float(time)
        return replace(law, reference_time=at, turns=law.turns + whole)

    return replace(
        snapshot,
        base=snapshot.base + time,
        turns={c: n + turns * (c in angles) for c, n in snapshot.turns.items()},
        laws=tuple(later(law) for law in snapshot.laws),
        coming=tuple(later(law) for law in snapshot.coming),
        last_event=snapshot.last_event + float(time),
    )
