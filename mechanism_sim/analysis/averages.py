"""Any quantity of a recorded run over the angle of the drive: cycle averages and orders."""

from __future__ import annotations

import numpy as np

from mechanism_sim.analysis.record import Record
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.sensing.orders import TurnSegments

_BLOCK = 8192  # instants at once


def over_turns(
    record: Record, quantity: str, samples: int | None = None, skip: int = 0
) -> TurnSegments:
    """A quantity at equal angles of the main drive, in whole turns from angle zero on.

    What `Piece.sample` names is taken from the motion's polynomials at exactly these angles. The
    signal of a sensor is interpolated (`mechanism_sim.sensing.orders.at_equal_angles`).

    Parameters
    ----------
    quantity : a name of `Piece.sample`, such as ``acceleration.coupler``, or of a sensor
    samples : angles in a turn; 360 unless told, of a sensor as many as it has samples in a turn
    skip : whole turns at the start that are left out
    """
    first, end = record.whole_turns(skip)
    if quantity in record.sensors:
        found = record.signal(quantity).over_turns(record.turned, samples)
        if found is None or not (kept := found.first >= first).any():
            raise InputError(f'the signal of {quantity} covers no whole turn')
        return TurnSegments(found.values[kept], found.first[kept])
    n = samples or 360
    turns = np.arange(first, end)
    t = record.times_at((turns[:, None] + np.arange(n) / n).ravel())
    return TurnSegments(sampled(record, quantity, t).reshape(-1, n), turns)


def sampled(record: Record, quantity: str, t: Array) -> Array:
    """A quantity of the run's machine at times (N,) [s]."""
    name = _found(record, quantity)
    parts = [t[k : k + _BLOCK] for k in range(0, len(t), _BLOCK)]
    return np.concatenate([record.piece.sample(part, name)[name] for part in parts])


def unit(record: Record, quantity: str) -> str:
    """SI unit of a quantity of `Piece.sample` or of a sensor; empty for a number."""
    if quantity in record.sensors:
        return record.signal(quantity).unit
    return record.piece.catalogue[_found(record, quantity)].unit


def _found(record: Record, quantity: str) -> str:
    """The full name of a quantity of a run."""
    try:
        return record.piece.catalogue.find(quantity).name
    except InputError as error:
        sensors = f'; its sensors: {", ".join(record.sensors)}' if record.sensors else ''
        raise InputError(f'{error}{sensors}') from None
