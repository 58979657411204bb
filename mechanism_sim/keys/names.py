"""The names of a scene: its links, their points, its coordinates, and quantities by name."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from mechanism_sim.errors import InputError, check_known
from mechanism_sim.planar.points import GROUND, LinkPoint, Vector2
from mechanism_sim.units import QuantityValue, resolved

RESERVED = ('t', 'x', 'y', 'vx', 'vy', 'pi')
"""Names in formulas of loads beside those of links."""


class SceneError(InputError):
    """An error whose message begins with the name of its scene."""


@contextmanager
def scene_errors(name: str) -> Iterator[None]:
    """Prefix the messages of errors inside with the name of the scene."""
    try:
        yield
    except SceneError:
        raise
    except InputError as error:
        raise SceneError(f'{name}: {error}') from error


def check_link_name(link: str) -> None:
    """Refuse invalid names of links, and those with a meaning in formulas."""
    if not link.isidentifier() or link in RESERVED:
        raise InputError(
            f"links.{link}: the name '{link}' cannot be used; names are letters, digits "
            f'and _, but not {", ".join(RESERVED)}, which formulas name'
        )


class Names:
    """The references of a scene; `where` is the key that refers.

    Attributes
    ----------
    scene : the scene
    links : names of the moving links
    points : named points by link, in its frame [m]
    """

    def __init__(self, scene: Any) -> None:
        self.scene = scene
        for link in scene.links:
            check_link_name(link)
        self.links = [link for link in scene.links if link != GROUND]
        if not self.links:
            raise InputError('links: there is no moving link; add one beside the ground')
        self.points = {link: self._points_of(link) for link in [GROUND, *self.links]}

    def _points_of(self, link: str) -> dict[str, Vector2]:
        given = self.scene.links.get(link)
        points: dict[str, Vector2] = {'start': (0.0, 0.0)}
        if given and given.length is not None:
            points['end'] = (given.length, 0.0)
        for name in given.points if given else ():
            if name in points:
                raise InputError(
                    f"links.{link}.points.{name}: '{name}' is the link's "
                    f'{"origin" if name == "start" else "far end"} already; choose another name'
                )
        return points | given.points if given else points

    def find(self, where: str, reference: str) -> LinkPoint:
        """A link and a point in its frame, from ``LINK.POINT`` or ``LINK``."""
        link, _, point = reference.partition('.')
        check_known(link, self.points, f"{where}: there is no link '{link}'", 'links:')
        points = self.points[link]
        wrong = f"{where}: the link {link} has no point '{point}'"
        check_known(point or 'start', points, wrong, 'its points:')
        return link, points[point or 'start']

    def connected(self, name: str) -> tuple[LinkPoint, LinkPoint]:
        """The two points, of any links, that a joint of that name connects."""
        first, second = (self.find(f'joints.{name}', p) for p in self.scene.joints[name].points)
        return first, second

    def ends(self, name: str) -> tuple[LinkPoint, LinkPoint]:
        """The points of two links that a joint of that name connects."""
        joint = self.scene.joints[name]
        where = f'joints.{name}.{joint.kind}'
        first, second = (self.find(where, p) for p in joint.points)
        if first[0] == second[0]:
            raise InputError(
                f'{where} ties the link {first[0]} to itself: give points of two links'
            )
        return first, second

    def pivot(self, where: str, link: str) -> tuple[Vector2, Vector2]:
        """The pivot of a link on the ground, in the world and in its own frame [m]."""
        return self.shaft(where, link)[1:]

    def shaft(self, where: str, link: str, on: str = GROUND) -> tuple[str, Vector2, Vector2]:
        """The revolute joint of a link on another, and its points on that and on itself [m]."""
        for name, joint in self.scene.joints.items():
            if not joint.revolute:
                continue
            ends = dict(self.connected(name))
            if ends.keys() == {on, link}:
                if joint.clearance:
                    raise InputError(
                        f'{where}: {link} turns in the loose joint {name}, so that its centre is '
                        'not fixed: it needs an ideal one'
                    )
                return name, ends[on], ends[link]
        other = 'the ground' if on == GROUND else on
        raise InputError(f'{where}: {link} must turn on {other}: add a revolute joint of both')

    def coordinate(self, where: str, name: str) -> str:
        """The name of a coordinate, equal to that of a moving link."""
        link, _, axis = name.partition('.')
        if link in self.links and axis in ('x', 'y'):
            raise InputError(
                f"{where}: '{name}' is the position of a link between loose joints, which is for "
                f"'initial' only: write '{link}'"
            )
        wrong, those = f"{where}: there is no coordinate '{name}'", 'the moving links:'
        check_known(name, self.links, wrong, f'coordinates are named after {those}')
        return name

    def measure(
        self, where: str, measure: QuantityValue, straight: bool, units: tuple[str, str]
    ) -> float:
        """A quantity in the first unit for an angle, else in the second."""
        wanted = units[straight]
        if measure.unit not in ('', wanted):
            raise InputError(
                f'{where} is given in {measure.unit}, but it is {kind_of(straight)}, in {wanted}'
            )
        if not math.isfinite(measure.value):
            raise InputError(f'{where} = {measure.value} must be finite')
        try:
            return resolved(measure.value) if wanted == 'rad' else measure.value
        except ValueError as error:
            raise InputError(f'{where} {error}') from error


def kind_of(straight: bool) -> str:
    """A coordinate's kind, in words."""
    return 'a displacement' if straight else 'an angle'
