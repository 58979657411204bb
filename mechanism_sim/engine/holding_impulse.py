"""Impulses of switches that hold a motion which an impact has moved by roundings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.present_state import PresentState


class ImpulseWork(NamedTuple):
    """Impulse and work of the driven coordinates' drives, and the loss."""

    drive_impulse: float = 0.0  #: sum of the drives' impulses [N m s, N s]
    drive_work: float = 0.0  #: work of these impulses [J]
    loss: float = 0.0  #: dissipated energy [J]: that work less the gain of kinetic energy


def stop(now: PresentState, held: Sequence[int], places: Sequence[float]) -> ImpulseWork:
    """Bring the functions of holding switches to zero by impulses of their own loads.

    Parameters
    ----------
    now : present state, its rates changed in place
    held : indices of the holding switches
    places : values of the functions of all switches
    """
    kept, functions = now.parameters.copy(), now.system.functions
    own = [[*now.system.set_valued.holding].index(k) for k in held]

    def seen(acting: int | None) -> tuple[Array, Array, Array]:
        for k in held:
            now.set(now.system.parameters.switches[k], (float(k == acting), 0.0))
        rates = now.evaluate(functions.holding_rates)[own]
        moved = now.evaluate(functions.accelerations)[: now.free]
        return rates, moved.copy(), now.evaluate(functions.supplied)[:-1]

    still, a, torque = seen(None)
    ways = [seen(k) for k in held]
    now.parameters[:] = kept
    before, drives = float(now.evaluate(functions.supplied)[-1]), np.zeros(len(torque))
    steps = np.column_stack([rates - still for rates, *_ in ways])
    shares = np.linalg.lstsq(steps, -np.array(places)[list(held)])[0]
    for x, (_, way, driven) in zip(shares.tolist(), ways, strict=True):
        now.v[:] += x * (way - a)
        drives += x * (driven - torque)
    now.project()
    gained = float(now.evaluate(functions.supplied)[-1]) - before
    work = float(drives @ now.drive_rates)
    return ImpulseWork(float(drives.sum()), work, work - gained)
