"""Exudyn's answers to the scenes `spinning_beam` and `elastic_slider_crank`: see elastic.md.

``python docs/exudyn_beams.py`` where exudyn is installed. Rods are its cables by absolute nodal
coordinates; hub and crank pin follow the drive.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface as items  # noqa: N813

Course = Callable[[float], float]


class Rod:
    """A row of cables along the x axis at the start, `start` to `start + length`.

    Parameters
    ----------
    spin : of the rod [rad/s] at the start
    rise : velocity [m/s] of its start along y
    held : what its start's x, y and the slopes there follow, by the number of the coordinate
    """

    def __init__(
        self, start: float, length: float, cables: int, matter: dict[str, float],
        held: dict[int, Course], spin: float = 0.0, rise: float = 0.0,
    ) -> None:  # fmt: skip
        self.container = exu.SystemContainer()
        self.system = self.container.AddSystem()
        self.nodes = [
            self.system.AddNode(items.NodePoint2DSlope1(
                referenceCoordinates=[start + x, 0.0, 1.0, 0.0],
                initialVelocities=[0.0, rise + spin * x, 0.0, spin],
            ))
            for x in np.linspace(0.0, length, cables + 1)
        ]  # fmt: skip
        for pair in zip(self.nodes[:-1], self.nodes[1:], strict=True):
            self.system.AddObject(items.ObjectANCFCable2D(
                nodeNumbers=list(pair), physicsLength=length / cables, **matter
            ))  # fmt: skip
        for coordinate, course in held.items():
            self.tie(self.end(self.nodes[0], coordinate), course=course)

    def end(self, node: int, coordinate: int) -> int:
        """A coordinate of a node, to tie."""
        return int(self.system.AddMarker(
            items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate)
        ))  # fmt: skip

    def tie(self, one: int, other: int | None = None, course: Course | None = None) -> None:
        """Keep a coordinate at another, at its start, or on a course."""
        if other is None:
            other = self.end(self.system.AddNode(items.NodePointGround()), 0)
        more: dict[str, Any] = {}
        if course is not None:
            more['offsetUserFunction'] = lambda _system, t, _item, _offset: course(t)
        self.system.AddObject(items.ObjectConnectorCoordinate(markerNumbers=[other, one], **more))

    def run(self, end: float, steps: int, seen: list[int]) -> tuple[Any, list[Any], float]:
        """Times (N,), places (N, 2) of nodes, and CPU time [s]."""
        sensors = [
            self.system.AddSensor(items.SensorNode(
                nodeNumber=node, storeInternal=True,
                outputVariableType=exu.OutputVariableType.Position,
            ))
            for node in seen
        ]  # fmt: skip
        self.system.Assemble()
        settings = exu.SimulationSettings()
        settings.timeIntegration.numberOfSteps = steps
        settings.timeIntegration.endTime = end
        settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
        settings.timeIntegration.verboseMode = 0
        settings.solutionSettings.writeSolutionToFile = False
        settings.solutionSettings.sensorsWritePeriod = end / 500
        began = time.process_time()
        self.system.SolveDynamic(settings)
        cpu = time.process_time() - began
        rows = [self.system.GetSensorStoredData(sensor) for sensor in sensors]
        return rows[0][:, 0], [row[:, 1:3] for row in rows], cpu


def matter(modulus: float, area: float, moment: float, density: float) -> dict[str, float]:
    """Of a cable."""
    return {
        'physicsMassPerLength': density * area,
        'physicsBendingStiffness': modulus * moment,
        'physicsAxialStiffness': modulus * area,
    }


def turned(t: float) -> float:
    """Angle [rad] of the hub of `spinning_beam`."""
    s = min(t / 15.0, 1.0)
    return 90.0 * (s**3 - 0.5 * s**4) + 6.0 * max(t - 15.0, 0.0)


def spinning_beam(cables: int, steps: int) -> tuple[Any, Any, float]:
    """Times, deflection of the tip [m] across the hub's direction, CPU time [s]."""
    slopes = {2: lambda t: math.cos(turned(t)) - 1.0, 3: lambda t: math.sin(turned(t))}
    still = {0: lambda _: 0.0, 1: lambda _: 0.0}
    rod = Rod(0.0, 10.0, cables, matter(70e9, 4e-4, 2e-7, 3000.0), still | slopes)
    t, (tip,), cpu = rod.run(20.0, steps, rod.nodes[-1:])
    hub = np.array([turned(x) for x in t])
    return t, tip[:, 1] * np.cos(hub) - tip[:, 0] * np.sin(hub), cpu


def slider_crank(cables: int, steps: int) -> tuple[Any, Any, float]:
    """Times, deflection of the rod's middle [m] off the line through its ends, CPU time [s]."""
    crank, length, speed, side = 0.15, 0.3, 150.0, 8e-3
    pin = {
        0: lambda t: crank * (math.cos(speed * t) - 1.0),
        1: lambda t: crank * math.sin(speed * t),
    }
    rise = crank * speed
    steel = matter(2e11, side**2, side**4 / 12.0, 7870.0)
    rod = Rod(crank, length, cables, steel, pin, -rise / length, rise)
    rod.tie(rod.end(rod.nodes[-1], 1))
    slider = rod.system.AddNode(items.NodePoint2D(referenceCoordinates=[crank + length, 0.0]))
    rod.system.AddObject(items.ObjectMassPoint2D(physicsMass=0.075552, nodeNumber=slider))
    rod.tie(rod.end(slider, 1))
    rod.tie(rod.end(slider, 0), rod.end(rod.nodes[-1], 0))
    t, (a, b, c), cpu = rod.run(0.05, steps, [rod.nodes[i] for i in (0, cables // 2, -1)])
    along, off = c - a, b - a
    return t, (along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0]) / np.hypot(*along.T), cpu


def main() -> None:
    """Print what elastic.md compares with."""
    for answer, settings in (
        (spinning_beam, ((16, 16000), (8, 4000))),
        (slider_crank, ((8, 50000), (4, 2000), (8, 4000), (8, 16000))),
    ):
        finest = None
        for cables, steps in settings:
            _, w, cpu = answer(cables, steps)
            finest = w if finest is None else finest
            print(
                f'{answer.__name__}, {cables} cables, {steps} steps: {cpu:.2f} s, at most '
                f'{np.abs(w).max():.6g} m, off {np.abs(w - finest).max():.2g} m'
            )


if __name__ == '__main__':
    main()
