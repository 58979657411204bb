"""Values that are possible, but look as if their unit were wrong: a thousand times off.

Nothing is refused here. Bounds are far from what machines are made of, so that a note means a
question worth an answer.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator

from mechanism_sim.planar.mechanism import GROUND
from mechanism_sim.scene.machine import Machine

_GYRATION = 30.0
"""Radius of gyration over the size of a link, and of size over radius: a bar has 0.29."""
_ODD = 300.0
"""Of masses and sizes over their medians, either way."""
_LEAST_PLAY, _MOST_PLAY = 1e-7, 0.1
"""Radial clearance [m], and over the size of the machine."""
_GRAVITY = 1.0, 30.0
"""[m/s^2] between that of the moon and that of Jupiter."""
_FASTEST = 3e4
"""[rad/s]: turbochargers."""


def doubts(machine: Machine) -> list[str]:
    """A question for every value that is about a thousand times off."""
    return [*_inertias(machine), *_masses(machine), *_plays(machine), *_others(machine)]


def _sizes(machine: Machine) -> dict[str, float]:
    """The largest distance between points of each moving link [m]; 0 of one with one point."""
    sizes = {}
    for link, points in machine.plan.points.items():
        if link != GROUND:
            places = [*points.values(), (0.0, 0.0)]
            sizes[link] = max(math.dist(a, b) for a in places for b in places)
    return sizes


def _inertias(machine: Machine) -> Iterator[str]:
    sizes = _sizes(machine)
    for name, link in machine.links.items():
        size = sizes.get(name, 0.0)
        if not (link.mass and link.inertia and size):
            continue
        radius = math.sqrt(link.inertia / link.mass)
        if not size / _GYRATION < radius < _GYRATION * size:
            yield (
                f'links.{name}.inertia = {link.inertia:g} kg m^2: its radius of gyration is '
                f'{_length(radius)} on a link of {_length(size)}: is the unit right?'
            )


def _masses(machine: Machine) -> Iterator[str]:
    for key, unit, values in (
        ('mass', 'kg', {n: link.mass for n, link in machine.links.items() if link.mass}),
        ('size', 'm', {n: size for n, size in _sizes(machine).items() if size}),
    ):
        if len(values) < 3:
            continue
        middle = statistics.median(values.values())
        for name, value in values.items():
            if not middle / _ODD < value < middle * _ODD:
                what = f'links.{name}.mass' if key == 'mass' else f'size of links.{name}'
                yield (
                    f'{what} = {value:g} {unit}: those of the other links are about {middle:g} '
                    f'{unit}: is the unit right?'
                )


def _plays(machine: Machine) -> Iterator[str]:
    size = machine.mechanism.size
    for joint, play in machine.clearances.items():
        radial = play.radial
        if radial and not _LEAST_PLAY <= radial <= _MOST_PLAY * size:
            yield (
                f'joints.{joint}.clearance.radial = {_length(radial)} in a machine of '
                f'{_length(size)}: is the unit right?'
            )


def _others(machine: Machine) -> Iterator[str]:
    gravity = math.hypot(*machine.scene.gravity)
    if gravity and not _GRAVITY[0] <= gravity <= _GRAVITY[1]:
        yield f'gravity = {gravity:g} m/s^2, on Earth it is 9.81 m/s^2: is the unit right?'
    if machine.main not in machine.mechanism.displacements and machine.fastest > _FASTEST:
        yield (
            f'{machine.main} turns at {machine.fastest * 30.0 / math.pi:g} rpm: is the unit right?'
        )


def _length(x: float) -> str:
    return f'{x:.3g} m' if x >= 1.0 else f'{1e3 * x:.3g} mm'
