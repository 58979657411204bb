"""Exudyn as a peer for elastic links: cables by absolute nodal coordinates, generalised alpha.

J. Gerstmayr, Multibody System Dynamics 60 (2024); its ObjectANCFCable2D bends without limits and
stretches. What drives a rod are user functions on the coordinates of its start.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks import flexible_slider_crank as simeon
from benchmarks.problem import Answer, Method, Outcome, Run, missing

Course = Callable[[float], float]

_DAMPED = 0.9  # spectral radius of generalised alpha: of what is too fast for the steps


class Rod:
    """A row of cables along the x axis at the start, from `start` on.

    Parameters
    ----------
    places : [m] of the nodes along it
    matter : of every cable, by Exudyn's names
    state : of each node: shift [m] and slope beside the straight rod along x and y, and rates
    held : what its start's x, y and the slopes there follow, by the number of the coordinate
    """

    def __init__(
        self, start: float, places: Answer, matter: dict[str, float],
        state: Sequence[tuple[list[float], list[float]]], held: dict[int, Course],
    ) -> None:  # fmt: skip
        import exudyn as exu  # noqa: PLC0415 - an optional package
        from exudyn import itemInterface as items  # noqa: N813, PLC0415

        self.exu, self.items = exu, items
        self.container = exu.SystemContainer()
        self.system = self.container.AddSystem()
        self.nodes = [
            self.system.AddNode(
                items.NodePoint2DSlope1(
                    referenceCoordinates=[start + x, 0.0, 1.0, 0.0],
                    initialCoordinates=shift,
                    initialVelocities=rate,
                )
            )
            for x, (shift, rate) in zip(places, state, strict=True)
        ]
        for k, length in enumerate(np.diff(places).tolist()):
            self.system.AddObject(
                items.ObjectANCFCable2D(nodeNumbers=self.nodes[k : k + 2], length=length, **matter)
            )
        for coordinate, course in held.items():
            self.tie(self.end(self.nodes[0], coordinate), course=course)

    def end(self, node: int, coordinate: int) -> int:
        """A coordinate of a node, to tie."""
        marker = self.items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate)
        return int(self.system.AddMarker(marker))

    def tie(self, one: int, other: int | None = None, course: Course | None = None) -> None:
        """Keep a coordinate at another, at its start, or on a course."""
        if other is None:
            other = self.end(self.system.AddNode(self.items.NodePointGround()), 0)
        more: dict[str, Any] = {}
        if course is not None:
            more['offsetUserFunction'] = lambda _system, t, _item, _offset: course(t)
        self.system.AddObject(
            self.items.ObjectConnectorCoordinate(markerNumbers=[other, one], **more)
        )

    def run(
        self, end: float, steps: int, answer: Callable[[Callable[[int], Answer]], Answer]
    ) -> Run:
        """A run to a time [s]; `answer` takes what gives the place of a node (2,) [m]."""
        self.system.Assemble()
        settings = self.exu.SimulationSettings()
        settings.timeIntegration.numberOfSteps = steps
        settings.timeIntegration.endTime = end
        settings.timeIntegration.generalizedAlpha.spectralRadius = _DAMPED
        settings.timeIntegration.verboseMode = 0
        settings.solution.file.write = False
        position = self.exu.OutputVariableType.Position

        def run() -> Callable[[], Outcome]:
            self.system.SolveDynamic(settings)
            found = answer(lambda node: np.array(self.system.GetNodeOutput(node, position))[:2])
            return lambda: Outcome(found, steps)

        return run


def matter(modulus: float, area: float, moment: float, density: float) -> dict[str, float]:
    """Material properties of a cable."""
    return {
        'massPerLength': density * area,
        'bendingStiffness': modulus * moment,
        'axialStiffness': modulus * area,
    }


def prepare_slider_crank(cables: int, steps: float) -> Run:
    """Slider's place and deflection of the rod's middle off its chord (2,) [m]."""
    crank, length, speed = simeon.L1, simeon.L2, simeon.SPEED
    begun = simeon.closed_start()
    (middle, end), spin, bends = begun[5:7], begun[8], begun[10:12]
    places, state = np.linspace(0.0, length, cables + 1), []
    for t in (places / length).tolist():
        u, slope = 4 * middle * t * (1 - t) + end * t * (2 * t - 1), 4 * middle * (1 - 2 * t)
        slope = (slope + end * (4 * t - 1)) / length
        k = np.pi * np.array([1.0, 2.0])
        rise = crank * speed + spin * (length * t + u) + np.sin(k * t) @ bends
        turn = spin * (1.0 + slope) + (k * np.cos(k * t)) @ bends / length
        state.append(([u, 0.0, slope, 0.0], [0.0, float(rise), 0.0, float(turn)]))
    pin: dict[int, Course] = {
        0: lambda t: crank * (math.cos(speed * t) - 1.0),
        1: lambda t: crank * math.sin(speed * t),
    }
    steel = matter(simeon.E, simeon.AREA, simeon.SIDE**4 / 12.0, simeon.DENSITY)
    rod = Rod(crank, places, steel, state, pin)
    rod.tie(rod.end(rod.nodes[-1], 1))
    slider = rod.system.AddNode(
        rod.items.NodePoint2D(
            referenceCoordinates=[crank + length, 0.0], initialCoordinates=[end, 0.0]
        )
    )
    mass = rod.items.ObjectMassPoint2D(mass=simeon.M3, nodeNumber=slider)
    rod.system.AddObject(mass)
    rod.tie(rod.end(slider, 1))
    rod.tie(rod.end(slider, 0), rod.end(rod.nodes[-1], 0))

    def answer(place: Callable[[int], Answer]) -> Answer:
        a, b, c = (place(rod.nodes[i]) for i in (0, cables // 2, -1))
        (x, y), off = c - a, b - a
        return np.array([c[0], (x * off[1] - y * off[0]) / math.hypot(x, y)])

    return rod.run(simeon.END, int(steps), answer)


def prepare_spinning_beam(end: float, cables: int, steps: float) -> Run:
    """Deflection of the tip (1,) [m] of Kane's beam across the direction of its hub."""

    def turned(t: float) -> float:
        s = min(t / 15.0, 1.0)
        return 90.0 * (s**3 - 0.5 * s**4) + 6.0 * max(t - 15.0, 0.0)

    held: dict[int, Course] = {
        0: lambda _: 0.0,
        1: lambda _: 0.0,
        2: lambda t: math.cos(turned(t)) - 1.0,
        3: lambda t: math.sin(turned(t)),
    }
    none = [0.0] * 4
    rod = Rod(
        0.0, np.linspace(0.0, 10.0, cables + 1), matter(70e9, 4e-4, 2e-7, 3000.0),
        [(none, none)] * (cables + 1), held,
    )  # fmt: skip

    def answer(place: Callable[[int], Answer]) -> Answer:
        x, y = place(rod.nodes[-1])
        return np.array([y * math.cos(turned(end)) - x * math.sin(turned(end))])

    return rod.run(end, int(steps), answer)


def method(prepare: Callable[[int, float], Run], cables: int, steps: Sequence[float]) -> Method:
    """Method for a problem, with a number of cables."""
    return Method(
        f'Exudyn ({cables} cables)',
        tuple(steps),
        'steps',
        lambda setting: prepare(cables, setting),
        f'{cables} elements ObjectANCFCable2D, which bend without limits and shorten thereby, as '
        f'linear theory has it not; generalised alpha with a spectral radius of {_DAMPED:g}.',
        lambda: missing('exudyn'),
    )
