"""Points of links by name."""

from __future__ import annotations

from collections.abc import Iterable

from mechanism_sim.errors import InputError, nearest
from mechanism_sim.planar.points import LinkPoint
from mechanism_sim.scene import Machine


def named_points(machine: Machine) -> dict[str, LinkPoint]:
    """The points that have a name, ``LINK.POINT``; of moving links the ``cog`` too."""
    cogs = {f'{b.name}.cog': (b.name, b.cog) for b in machine.mechanism.bodies}
    return cogs | {
        f'{link}.{name}': (link, at)
        for link, points in machine.plan.points.items()
        for name, at in points.items()
    }


def choose(machine: Machine, names: Iterable[str]) -> dict[str, LinkPoint]:
    """The points of these names, in this order."""
    known = named_points(machine)
    for name in names:
        if name not in known:
            raise InputError(
                f"{machine.name} has no point '{name}'{nearest(name, known)}; a point is "
                f'LINK.POINT: {", ".join(known)}'
            )
    return {name: known[name] for name in names}
