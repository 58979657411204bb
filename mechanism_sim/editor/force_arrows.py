"""Arrows of the forces in ideal joints, of all instants at rest and of the first in a drag."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from mechanism_sim.editor.motion import UNSOLVED, IdealForces, Turn

_BUDGET = 0.012
"""[s] of a frame, of 17 ms; where forces take it beyond, they come with one frame in `_SOME`."""

_SOME = 4

_LENGTH = 0.3  # length of the arrow of the largest force, as share of the machine's size


class ForceArrows:
    """Arrows drawn in a common scale."""

    def __init__(self) -> None:
        self._scale = 0.0  # [m/N]
        self._frames, self._each = 0, 1  # frames of drags; one in `_each` has forces

    def of_turn(self, turn: Turn | None, symbol: float) -> dict[str, Any] | None:
        """Force arrows of all instants of a turn, in a new common scale; None without forces.

        Parameters
        ----------
        symbol : size of a symbol [m], a sixtieth of the machine's
        """
        self._scale = 0.0
        try:
            known = turn.forces() if turn else None
        except Exception:  # no forces to show
            return None
        if known is None:
            return None
        largest = float(np.hypot(*known.forces.transpose(2, 0, 1)).max(initial=0.0))
        self._scale = _LENGTH * 60.0 * symbol / largest if largest else 0.0
        return self._to_json(known) if self._scale else None

    def of_drag(self, turn: Turn | None, begun: float) -> dict[str, Any]:
        """Force arrows for a frame begun at `begun` [s]; if slow, for some frames only."""
        self._frames += 1
        if not self._scale or self._frames % self._each:
            return {} if self._scale and turn else {'forces': None}
        try:
            known = turn.forces(1) if turn else None
        except UNSOLVED:
            known = None
        self._each = 1 if time.thread_time() < begun + _BUDGET else _SOME
        return {'forces': self._to_json(known) if known else None}

    def _to_json(self, known: IdealForces) -> dict[str, Any]:
        """Arrows for JSON, rounded beyond what is visible."""
        return {
            'joints': known.joints,
            'force_scale': self._scale,
            'forces': [[[float(f'{x:.4g}') for x in f] for f in row] for row in known.forces],
            'feet': np.round(known.feet, 7).tolist(),
        }
