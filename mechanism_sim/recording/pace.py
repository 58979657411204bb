"""How fast a run was; needs no library of bags."""

from __future__ import annotations


def realtime_factor(simulated: float, wall_time: float | None) -> float | None:
    """Simulated seconds per second.

    Args:
        simulated: How long the run is [s].
        wall_time: How long it took [s], from its first message to its last; None if not known.

    """
    return simulated / wall_time if wall_time else None
