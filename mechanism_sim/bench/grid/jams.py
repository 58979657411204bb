"""Whether a run that ended in a jam had to: the second route."""

from __future__ import annotations

from mechanism_sim.errors import RunError
from mechanism_sim.scene import Machine


def confirmed(machine: Machine, error: RunError) -> bool:
    """Whether no mode of contact is consistent where a run ended because contacts jam."""
    return False
