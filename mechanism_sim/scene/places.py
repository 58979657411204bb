"""The names of a linkage: its links, their points, its coordinates, and quantities by name."""

from __future__ import annotations

import math
from collections.abc import Mapping

from mechanism_sim.errors import InputError, nearest
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, LinkPoint, Vector2
from mechanism_sim.scene.joint_keys import JointKeys
from mechanism_sim.scene.schema import Scene
from mechanism_sim.units import Measure

RESERVED = ('t', 'x', 'y', 'vx', 'vy', 'pi')
"""What formulas of loads name beside links."""


class Places:
    """What the references of one scene mean; every refusal begins with the scene's name.

    Attributes
    ----------
    name, scene : the scene
    links : the moving ones
    points : named points of all links, in their frames [m]
    """

    def __init__(self, name: str, scene: Scene) -> None:
        self.name = name
        self.scene = scene
        for link in scene.links:
            if link != GROUND and (not link.isidentifier() or link in RESERVED):
                raise InputError(
                    f"{name}: links.{link}: the name '{link}' cannot be used; names are letters, "
                    f'digits and _, but not {", ".join(RESERVED)}, which formulas name'
                )
        self.links = [link for link in scene.links if link != GROUND]
        if not self.links:
            raise InputError(f'{name}: links: there is no moving link; add one beside the ground')
        self.points = {link: self._points_of(link) for link in [GROUND, *self.links]}

    def _points_of(self, link: str) -> dict[str, Vector2]:
        given = self.scene.links.get(link)
        points: dict[str, Vector2] = {'start': (0.0, 0.0)}
        if given and given.length is not None:
            points['end'] = (given.length, 0.0)
        if given:
            for name in given.points:
                if name in points:
                    raise InputError(
                        f"{self.name}: links.{link}.points.{name}: '{name}' is the link's "
                        f'{"origin" if name == "start" else "far end"} already; choose another '
                        'name'
                    )
            points |= given.points
        return points

    def find(self, where: str, reference: str) -> tuple[str, Vector2]:
        """A link and a point in its frame, from ``LINK.POINT`` or ``LINK``."""
        link, _, point = reference.partition('.')
        if link not in self.points:
            raise InputError(
                f"{self.name}: {where}: there is no link '{link}'"
                f'{nearest(link, self.points)}; links: {", ".join(self.points)}'
            )
        points = self.points[link]
        if (point or 'start') not in points:
            raise InputError(
                f"{self.name}: {where}: the link {link} has no point '{point}'"
                f'{nearest(point, points)}; its points: {", ".join(points)}'
            )
        return link, points[point or 'start']

    def ends(self, name: str, joint: JointKeys) -> tuple[LinkPoint, LinkPoint]:
        """The two points that a joint connects."""
        first, second = (self.find(f'joints.{name}.{joint.kind}', p) for p in joint.points)
        if first[0] == second[0]:
            raise InputError(
                f'{self.name}: joints.{name}.{joint.kind} ties the link {first[0]} to itself: '
                'give points of two links'
            )
        return first, second

    def pivot(self, where: str, link: str) -> tuple[Vector2, Vector2]:
        """Where a link turns on the ground, in the world and in its own frame [m]."""
        return self.shaft(where, link)[1:]

    def shaft(self, where: str, link: str, on: str = GROUND) -> tuple[str, Vector2, Vector2]:
        """The joint in which a link turns on another, and where on that and on itself [m]."""
        for name, joint in self.scene.joints.items():
            if not joint.revolute:
                continue
            ends = dict(self.find(f'joints.{name}', p) for p in joint.points)
            if ends.keys() == {on, link}:
                if joint.clearance:
                    raise InputError(
                        f'{self.name}: {where}: {link} turns in the loose joint {name}, so that '
                        'its centre is nowhere fixed: it needs an ideal one'
                    )
                return name, ends[on], ends[link]
        other = 'the ground' if on == GROUND else on
        raise InputError(
            f'{self.name}: {where}: {link} must turn on {other}: add a revolute joint of both'
        )

    def coordinate(self, where: str, name: str) -> str:
        """The name of a coordinate, which is that of a moving link."""
        link, _, axis = name.partition('.')
        if link in self.links and axis in ('x', 'y'):
            raise InputError(
                f"{self.name}: {where}: '{name}' is the place of a link between loose joints, "
                f"which only 'initial' gives: write '{link}'"
            )
        if name not in self.links:
            raise InputError(
                f"{self.name}: {where}: there is no coordinate '{name}'"
                f'{nearest(name, self.links)}; coordinates are named after the moving links: '
                f'{", ".join(self.links)}'
            )
        return name

    def values(
        self, where: str, given: Mapping[str, Measure], tree: Mechanism, units: tuple[str, str]
    ) -> dict[str, float]:
        """Quantities by coordinate, in the first of the units for angles, else in the second."""
        return {
            c if '.' in c and c in tree.coordinates else self.coordinate(where, c): self.measure(
                f'{where}.{c}', m, c in tree.displacements, units
            )
            for c, m in given.items()
            if not (where.startswith('initial') and self.floats(c, m, tree))
        }

    def floats(self, name: str, measure: Measure, tree: Mechanism) -> bool:
        """Whether a quantity is one of a link that hangs on loose joints, and of `tree` is none.

        That is its place, ``LINK.x`` and ``LINK.y``, or the angle of a link that a guide of
        `tree` carries.
        """
        link, _, axis = name.partition('.')
        if axis:
            return link in self.links and axis in ('x', 'y') and name not in tree.coordinates
        return name in tree.displacements and measure.unit.startswith('rad')

    def floating(
        self,
        where: str,
        given: Mapping[str, Measure],
        tree: Mechanism,
        loose: Mechanism,
        unit: str,
    ) -> dict[str, float]:
        """Quantities of the coordinates that only the machine with its clearances has.

        Parameters
        ----------
        tree, loose : the machine without and with its clearances
        unit : of displacements
        """
        found = {}
        for c, measure in given.items():
            if not self.floats(c, measure, tree):
                continue
            if c not in loose.coordinates or (c in self.links and c in loose.displacements):
                link = c.partition('.')[0]
                raise InputError(
                    f'{self.name}: {where}.{c} cannot be set: {link} hangs on a joint without '
                    f"clearance, so that its only coordinate is '{link}', "
                    f'{kind_of(link in loose.displacements)}'
                )
            found[c] = (
                self.measure(f'{where}.{c}', measure, True, ('', unit))
                if '.' in c
                else measure.value
            )
        return found

    def measure(
        self, where: str, measure: Measure, straight: bool, units: tuple[str, str]
    ) -> float:
        """A quantity that must be of the kind of its coordinate."""
        wanted = units[straight]
        if measure.unit not in ('', wanted):
            raise InputError(
                f'{self.name}: {where} is given in {measure.unit}, but it is {kind_of(straight)}, '
                f'in {wanted}'
            )
        if not math.isfinite(measure.value):
            raise InputError(f'{self.name}: {where} = {measure.value} must be finite')
        return measure.value


def kind_of(straight: bool) -> str:
    """What a coordinate is, in words."""
    return 'a displacement' if straight else 'an angle'
