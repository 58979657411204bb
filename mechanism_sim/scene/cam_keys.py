"""What a scene file says of a cam and its follower."""

from __future__ import annotations

from mechanism_sim.scene.schema import Part


class CamKeys(Part):
    """The keys of a joint between a cam and its follower."""
