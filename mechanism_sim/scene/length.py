"""How long a run is, as it is asked for."""

from __future__ import annotations

import math

from mechanism_sim.errors import InputError
from mechanism_sim.scene.gate import admit
from mechanism_sim.scene.machine import Machine


def span(machine: Machine, revolutions: float | None, duration: float | None) -> float:
    """The duration [s] asked for, as revolutions of the crank or in seconds.

    If none is asked for, that of the scene, or else one revolution.
    """
    if revolutions is not None and duration is not None:
        raise InputError('give either revolutions or a duration, not both')
    asked = revolutions if revolutions is not None else duration
    if asked is not None and not (asked > 0.0 and math.isfinite(asked)):
        raise InputError(f'the length of a run must be positive and finite, not {asked:g}')
    if asked is None:
        duration = machine.scene.duration
    if duration is None:
        duration = machine.time_of(1.0 if revolutions is None else revolutions)
    return duration


def run_length(machine: Machine, revolutions: float | None, duration: float | None) -> float:
    """The same for commands and nodes, which refuse what cannot be run for so long."""
    end = span(machine, revolutions, duration)
    admit(machine, end)
    return end
