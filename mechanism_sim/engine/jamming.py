"""Loose joints that a drive forces past a change point.

Where the links of a loop come into one line, a loose joint leaves them hardly any room, and what
moves in it gains energy as a ball does between walls that draw together. A drive that holds its
speed gives whatever that takes. Without friction nothing takes it up again: the pin whirls in its
bushing thousands of times in a degree of the drive, and a run would go on in ever shorter steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mechanism_sim.engine.audit import Audit
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.events import Impact
from mechanism_sim.engine.physics import Physics
from mechanism_sim.errors import RunError
from mechanism_sim.tolerances import TOLERANCES

_AUDIT = TOLERANCES.audit


class JamWatch:
    """Ends a run in which a loose joint jams: all steps short, no event, and energy from nowhere.

    Windows of some thousand steps are told apart by the mean length of a step. Regular ones, with
    chatter too, give the energy by which that of the others is measured.

    Parameters
    ----------
    longest : [s] step
    """

    def __init__(self, physics: Physics, longest: float) -> None:
        self._physics, self._longest = physics, longest
        self._regular = 0.0  # [J] kinetic energy up to the last window with regular steps
        self._calm = 0  # windows in a row with short steps and no event
        self._begin()

    def _begin(self) -> None:
        self._steps, self._span, self._events = 0, 0.0, False
        self._held = np.ones(len(self._physics.clearances), dtype=bool)

    def add(self, motion: Motion, impacts: Sequence[Impact], audit: Audit) -> None:
        """Enter segments, once `audit` has them.

        Raises
        ------
        RunError
            If a joint with clearance jams.
        """
        if not len(motion):
            return
        self._steps += len(motion)
        self._span += float(motion.curve.duration.sum())
        self._events |= bool(impacts) or bool(np.diff(motion.modes, axis=0).any())
        self._held &= motion.closed.all(axis=0)
        if self._steps < _AUDIT.jam_steps:
            return
        step, held = self._span / self._steps, self._held
        calm = step < _AUDIT.jam_step * self._longest
        if not calm:
            self._regular = audit.largest_kinetic
        self._calm = self._calm + 1 if calm and held.any() and not self._events else 0
        known = max(self._regular, audit.other_energy)
        if self._calm > 1 and audit.largest_kinetic > _AUDIT.jam_gain * known:
            joints = [j for j, own in zip(self._physics.clearances, held, strict=True) if own]
            raise self._jam(joints, motion, audit, step)
        self._begin()

    def _jam(self, joints: list[str], motion: Motion, audit: Audit, step: float) -> RunError:
        """Error that says which joints jam, where, and what to do."""
        curve, last = motion.curve, np.array([len(motion) - 1])
        main = self._physics.driven[0] if self._physics.driven else self._physics.coordinates[0]
        place = float(
            curve.local(last, curve.duration[-1:])[0, self._physics.coordinates.index(main)]
        )
        if main in self._physics.displacements:
            at = f'{1e3 * place:.6g} mm'
        else:
            at = f'{math.degrees(place) % 360.0:.6g} deg'
        return RunError(
            f'{" and ".join(joints)} {"jams" if len(joints) == 1 else "jam"}: at '
            f't = {curve.end:.9g} s, {main} at {at}, the drive has held its speed past a '
            'change point, where links in one line leave a loose joint no room, and '
            f'given the links {audit.largest_kinetic:.3g} J so far, by forces up to '
            f'{audit.largest_force:.3g} N in steps of {step:.2g} s; give that joint friction or '
            "'contact', which take energy up, change a length (check names change points), or "
            'keep the drive away from there'
        )
