"""Figures of bevel gears."""

from __future__ import annotations

from mechanism_sim.joints.sheets import JointParts, PartFigure, Sheet


class BevelParts(JointParts):
    """Two bevel gears; what is of each has the name of its link."""

    def sheet(self, gear: str | None, friction: float) -> Sheet:
        """Their sizes."""
        pair = self.joint
        figures = [
            PartFigure('ratio', 1.0 / float(pair.ratio)),
            PartFigure('shaft_angle', sum(pair.cones), 'rad'),
            PartFigure('pressure_angle', pair.pressure_angle, 'rad'),
        ]
        for link, radius, cone in zip(pair.links, pair.mean_radii, pair.cones, strict=True):
            figures.append(PartFigure(f'{link}.pitch_angle', cone, 'rad'))
            figures.append(PartFigure(f'{link}.mean_radius', radius, 'm'))
        title = f'{self.machine.name}: bevel gears of {pair.first} and {pair.second}'
        return Sheet(title, tuple(figures))
