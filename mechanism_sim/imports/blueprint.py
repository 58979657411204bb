"""Planar machines at their start, as described by files of other programs, and their scenes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from mechanism_sim.documents import flow
from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import RESERVED
from mechanism_sim.planar.mechanism import Prismatic
from mechanism_sim.planar.points import GROUND, Vector2, rotate
from mechanism_sim.scene.files import check_scene
from mechanism_sim.scene.plan import ScenePlan
from mechanism_sim.units import to_si, unrounded

Pose = tuple[float, float, float]
"""Pose of a frame at the start: x, y and angle [rad]."""

_WIDTH = 99
_ROUNDING = 1e-14  # tolerance of lengths, in any unit
_TURNED = 1e-15  # [rad] tolerance of angles


@dataclass
class BlueprintLink:
    """A link."""

    #: pose of its frame in the world; lengths in the unit of the blueprint
    pose: Pose = (0.0, 0.0, 0.0)
    points: dict[str, Vector2] = field(default_factory=dict)  #: coordinates in its frame, by name
    #: further keys of the link in the scene, as mass
    keys: dict[str, Any] = field(default_factory=dict)

    def at(self, point: str) -> Vector2:
        """A point in the world."""
        x, y = rotate(self.points.get(point, (0.0, 0.0)), self.pose[2])
        return self.pose[0] + x, self.pose[1] + y

    def local(self, place: Vector2) -> Vector2:
        """A point of the world in the frame of the link."""
        return rotate((place[0] - self.pose[0], place[1] - self.pose[1]), -self.pose[2])


@dataclass
class Blueprint:
    """A machine to be written as a scene."""

    title: str
    unit: str = 'm'  #: unit of all lengths
    links: dict[str, BlueprintLink] = field(default_factory=lambda: {GROUND: BlueprintLink()})
    #: joints and further keys, in the form of the scene
    joints: dict[str, dict[str, Any]] = field(default_factory=dict)
    keys: dict[str, Any] = field(default_factory=dict)
    #: areas of drawn links, negative for holes
    outlines: dict[str, list[Any]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)  #: sentences on differences from the file

    def length(self, value: float) -> str:
        """Text of a length with its unit, to 15 digits; rounding errors become 0."""
        shown = unrounded(value) if abs(value) > _ROUNDING else 0.0
        return f'{shown!r} {self.unit}'

    def vector(self, place: Iterable[float]) -> list[str]:
        """Texts of both coordinates of a point, with their unit."""
        return [self.length(x) for x in place]

    def through(self, link: str, places: Mapping[str, Vector2]) -> None:
        """Add a link through world points: origin at the first, x axis towards the second."""
        origin, *others = places.values()
        away = [at for at in others if math.dist(at, origin) > 0.0]
        angle = math.atan2(away[0][1] - origin[1], away[0][0] - origin[0]) if away else 0.0
        made = self.links[link] = BlueprintLink((*origin, angle))
        for name, at in places.items():
            if at == origin:
                made.points[name] = (0.0, 0.0)
            elif away and at == away[0]:
                made.points[name] = (math.dist(at, origin), 0.0)
            else:
                made.points[name] = made.local(at)

    def join(
        self, name: str, kind: str, first: tuple[str, str], second: tuple[str, str], **more: Any
    ) -> None:
        """Add a joint between points of two links, under a free name."""
        name, number = named(name), 1
        wanted = f'{name}_joint' if name in self.links else name
        while wanted in self.joints:
            number += 1
            wanted = f'{name}_{number}'
        self.joints[wanted] = {kind: [first, second], **more}

    def drive(self, link: str, **keys: str) -> None:
        """Add a drive of a link; the first is the main one."""
        given = {'coordinate': link, **keys}
        if 'drive' in self.keys:
            self.keys.setdefault('drives', {})[link] = given
        else:
            self.keys['drive'] = given

    def scene(self) -> dict[str, Any]:
        """Keys and values of the scene; the start poses of links are its guess."""
        data: dict[str, Any] = {'title': self.title, 'mechanism': 'linkage'}
        data['links'] = {}
        for name, link in self.links.items():
            points = {point: self.vector(at) for point, at in link.points.items() if any(at)}
            data['links'][name] = ({'points': points} if points else {}) | link.keys
        data['joints'] = {name: dict(self._joint(joint)) for name, joint in self.joints.items()}
        data |= self.keys
        if guess := dict(self._guess(data)):
            data['guess'] = guess
        return data

    def _joint(self, joint: dict[str, Any]) -> Iterator[tuple[str, Any]]:
        """A joint in the form of a scene; the origin of a link has the link's name."""
        for key, value in joint.items():
            ends = isinstance(value, list)
            yield key, [self.reference(*end) for end in value] if ends else value

    def reference(self, link: str, point: str) -> str:
        """``LINK.POINT``, or the link alone for its origin."""
        return f'{link}.{point}' if any(self.links[link].points.get(point, ())) else link

    def _guess(self, data: dict[str, Any]) -> Iterator[tuple[str, str]]:
        """Angles and displacements of links at the start, by the coordinates of the plan."""
        tree = ScenePlan(check_scene(self.title, data)).ideal
        driven = data.get('drive', {})
        for link in tree.coordinates:
            joint = tree.tree_joints.get(link)
            if link == driven.get('coordinate') and 'start_angle' in driven:
                continue
            if isinstance(joint, Prismatic):
                yield link, self.length(self.displacement(joint.name))
            elif link in self.links:
                yield link, angle(math.remainder(self.links[link].pose[2], 2.0 * math.pi))

    def displacement(self, name: str) -> float:
        """Displacement at the start of the second link of a guide relative to the first."""
        joint = self.joints[name]
        (first, on_first), (second, on_second) = joint['prismatic']
        (ax, ay), (bx, by) = self.links[first].at(on_first), self.links[second].at(on_second)
        axis = float(str(joint.get('axis', '0')).removesuffix(' rad'))
        x, y = rotate((1.0, 0.0), self.links[first].pose[2] + axis)
        return x * (bx - ax) + y * (by - ay)


def unit_of(where: str, stated: str, told: str | None) -> str:
    """The unit of lengths of a file: as stated, else as given by the user; else ''.

    Parameters
    ----------
    where : source of the stated unit, for the message if the given one differs
    """
    if told:
        try:
            length = to_si(f'1 {told}', 'm')
        except ValueError as error:
            raise InputError(f'--unit {error}') from error
        if stated and not math.isclose(length, to_si(f'1 {stated}', 'm'), rel_tol=1e-12):
            raise InputError(f'{where} states lengths in {stated}: --unit {told} contradicts it')
    return stated or told or ''


def angle(value: float) -> str:
    """Text of an angle with its unit; rounding errors become 0."""
    return f'{value if abs(value) > _TURNED else 0.0!r} rad'


def named(text: str) -> str:
    """A valid name of a scene: letters, digits and _."""
    name = re.sub(r'\W+', '_', text).strip('_') or 'part'
    return f'{name}_' if name in RESERVED else name if name.isidentifier() else f'n{name}'


def names_of(texts: Iterable[str], what: str) -> dict[str, str]:
    """The names of several parts; InputError if two would be equal."""
    found = {text: named(text) for text in texts}
    if len({*found.values()}) < len(found):
        raise InputError(f'two {what} would have the same name: {", ".join(found)}')
    return found


def to_yaml(data: Mapping[str, Any]) -> str:
    """A scene as text: a line for each link, joint and other part."""
    lines: list[str] = []
    for key, value in data.items():
        if key in ('links', 'joints', 'springs') and isinstance(value, dict):
            lines.append(f'{key}:')
            for name, part in value.items():
                lines += _lines(name, part, '  ')
        else:
            lines += _lines(key, value, '')
    return '\n'.join(lines) + '\n'


def _lines(key: str, value: Any, indent: str) -> list[str]:
    """Lines of a key with its value, or of a key and each of its own keys."""
    line = f'{indent}{key}: {flow(value)}'
    if len(line) <= _WIDTH or not isinstance(value, dict):
        return [line]
    return [f'{indent}{key}:', *(x for k, v in value.items() for x in _lines(k, v, indent + '  '))]
