"""What a scene file says of gears and how they mesh."""

from __future__ import annotations

from mechanism_sim.scene.schema import Part


class GearKeys(Part):
    """The keys of a joint between two gears, or of a transmission by other means."""
