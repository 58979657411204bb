"""Parts that touch in a joint, cams or gears: their figures, and their outlines for a workshop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.tables import Table


@dataclass(frozen=True)
class Polygon:
    """A polygon, on a layer of its name."""

    name: str
    points: Array  #: (2, n) [m]
    closed: bool = True  #: the last point is joined to the first


@dataclass(frozen=True)
class Circle:
    """A circle, on a layer of its name."""

    name: str
    radius: float  #: [m]
    centre: tuple[float, float] = (0.0, 0.0)  #: [m]


@dataclass(frozen=True)
class Outline:
    """Parts seen along their shafts."""

    edges: tuple[Polygon, ...]  #: lines to be cut
    guides: tuple[Polygon | Circle, ...]  #: pitch curves, base circles
    shafts: tuple[tuple[float, float], ...] = ((0.0, 0.0),)  #: [m]

    @property
    def box(self) -> Array:
        """Lower left and upper right corner, the shafts being inside, (2, 2) [m]."""
        corners = [np.array(self.shafts).T]
        for part in (*self.edges, *self.guides):
            if isinstance(part, Circle):
                around = part.radius * np.array([[-1.0, 1.0], [-1.0, 1.0]])
                corners.append(np.array(part.centre)[:, None] + around)
            else:
                corners.append(part.points)
        everything = np.concatenate(corners, axis=1)
        return np.array([everything.min(axis=1), everything.max(axis=1)])

    def placed(self, place: Callable[[Array], Array]) -> Outline:
        """Outline in another frame: `place` takes points (2, n) [m] there without distortion."""

        def one(point: tuple[float, float]) -> tuple[float, float]:
            x, y = place(np.array(point)[:, None])[:, 0].tolist()
            return x, y

        return Outline(
            tuple(replace(edge, points=place(edge.points)) for edge in self.edges),
            tuple(
                replace(part, centre=one(part.centre))
                if isinstance(part, Circle)
                else replace(part, points=place(part.points))
                for part in self.guides
            ),
            tuple(one(shaft) for shaft in self.shafts),
        )


class PartFigure(NamedTuple):
    """One line of a table."""

    name: str
    value: float
    unit: str = ''  #: SI; empty for a number
    at: float | None = None  #: angle [rad] of the cam, or its displacement [m]


@dataclass(frozen=True)
class Sheet:
    """Facts of the parts."""

    title: str
    figures: tuple[PartFigure, ...]  #: those of one gear are named ``GEAR.NAME``
    outline: Outline | None = None  #: None of parts that have none in the plane
    remarks: tuple[str, ...] = ()
    place_unit: str = 'rad'  #: of `PartFigure.at`; m of a cam that slides


@dataclass(frozen=True)
class JointParts(ABC):
    """The parts that touch in a joint; a kind that has some names its class in its keys."""

    #: the reason why none of them can be drawn alone; empty if they are gears
    whole: ClassVar[str] = 'no outline in the plane'

    machine: Any
    joint: Any  #: of its mechanism without clearance

    @property
    def has_friction(self) -> bool:
        """True if some of their figures depend on friction."""
        return False

    @abstractmethod
    def sheet(self, gear: str | None, friction: float) -> Sheet:
        """Figures and outline, of one gear only if it is named; speeds are those at the start."""

    def table(self) -> Table:
        """A cam over its turn or stroke, (N,) by name; empty of others."""
        return Table({})

    def speed(self, link: str) -> float:
        """Speed of a link at the start [rad/s], or [m/s] if it slides."""
        ideal = self.machine.plan.ideal
        frame = link if link in ideal.sliding else ideal.frame(link)[0]
        rates = dict(zip(ideal.coordinates, self.machine.assembly.v.tolist(), strict=True))
        return float(rates.get(frame, 0.0))
