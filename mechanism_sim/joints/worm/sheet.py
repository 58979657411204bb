"""Figures of a worm and its wheel."""

from __future__ import annotations

from mechanism_sim.joints.sheets import JointParts, PartFigure, Sheet


class WormParts(JointParts):
    """A worm and its wheel."""

    has_friction = True

    def sheet(self, gear: str | None, friction: float) -> Sheet:
        """Their sizes, and their efficiency for a coefficient of friction."""
        joint, pair = self.joint, self.joint.worm
        title = f'{self.machine.name}: worm of {joint.first} and wheel of {joint.second}'
        figures = [
            PartFigure('ratio', pair.teeth / pair.threads),
            PartFigure('lead', pair.lead, 'm'),
            PartFigure('lead_angle', pair.lead_angle, 'rad'),
            PartFigure('wheel_helix_angle', pair.lead_angle, 'rad'),
            PartFigure('worm_diameter', pair.diameter, 'm'),
            PartFigure('wheel_diameter', pair.wheel_diameter, 'm'),
            PartFigure('centre_distance', pair.centre_distance, 'm'),
            PartFigure('efficiency', pair.efficiency(friction)),
            PartFigure('self_locking_friction', pair.locking_friction),
        ]
        if pair.self_locking(friction):
            remark = f'at a friction of {friction:g} it is self-locking: its wheel cannot drive it'
            return Sheet(title, tuple(figures), remarks=(remark,))
        driven = pair.efficiency(friction, wheel_drives=True)
        return Sheet(title, (*figures, PartFigure('efficiency_wheel_drives', driven)))
