"""Levels of mechanics: from kinematics to compliant contact."""

from __future__ import annotations

from enum import Enum


class Level(Enum):
    """Level of mechanics that a scene needs; the value is its text for the user."""

    KINEMATIC = 'kinematic'
    INVERSE_DYNAMICS = 'inverse dynamics'
    SMOOTH = 'smooth dynamics'
    NONSMOOTH = 'nonsmooth dynamics'
    COMPLIANT = 'compliant contact'

    @property
    def dynamic(self) -> bool:
        """True if the motion comes from equations of motion."""
        return self in (Level.SMOOTH, Level.NONSMOOTH, Level.COMPLIANT)
