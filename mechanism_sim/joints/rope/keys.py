"""Ropes over pulleys."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from mechanism_sim.errors import InputError, check_known
from mechanism_sim.joints.contact_keys import ClearanceSpec
from mechanism_sim.joints.joint_keys import KINDS, Joints, TouchingKeys
from mechanism_sim.joints.rope.constraint import Drum, Pulley, Rope, Slack
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Length, Part
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import MotionBound
from mechanism_sim.planar.switched_functions import SwitchedFunction

_STRAIGHT = 1e-9
"""Sine of the turn at a pulley below which nothing says on which side the rope passes."""


class PulleyPart(Part):
    """A pulley at a point of a rope, or a drum at its end."""

    radius: Length
    """Radius to the middle of the rope."""
    passes: Literal['counterclockwise', 'clockwise'] | None = None
    """How the rope goes round, from its first point on; without it as it bends at the start.
    Required of a drum."""


@KINDS.add('rope')
class RopeKeys(TouchingKeys):
    """A rope."""

    rope: Annotated[list[str], Field(min_length=2)] | None = None
    """A rope through points in this order: fixed to the first and the last, free in between. It
    pulls, or hangs slack, and tightens with an impact."""
    length: Length | None = None
    """Of a rope; without it that of its way at the start."""
    pulleys: dict[str, PulleyPart] | None = None
    """Of a rope: pulleys at its points, by their names, or drums at its ends, on which it is wound
    as their links turn; others have no radius."""
    firm = 'it has no play: give its length'

    def read(self, names: Names, name: str) -> Rope:
        """Points, and pulleys whose sides are chosen by `assembled`."""
        where, given, pulleys = f'joints.{name}', self.rope or [], self.pulleys or {}
        places = [names.find(f'{where}.rope', reference) for reference in given]
        for reference in pulleys:
            wrong = f'{where}.pulleys.{reference}: the rope has no such point'
            check_known(reference, given, wrong, 'its points:')
        for k, (one, two) in enumerate(pairwise(places)):
            if one == two:
                raise InputError(
                    f'{where}.rope goes from {given[k]} to {given[k + 1]}, which are one point'
                )
        (first, on_first), *others = places
        apart = [place for place in others if place[0] != first]
        if not apart:
            raise InputError(f'{where}.rope has points of {first} only: name those of two links')
        route = tuple(
            Pulley(place, pulleys[x].radius if x in pulleys else 0.0)
            for x, place in zip(given, places, strict=True)
        )
        second, on_second = apart[-1]
        return Rope(name, first, second, on_first, on_second, route, self.length or 0.0)

    def mounted(self, joint: Any, start: Mapping[str, float], turned: Mapping[str, int]) -> Rope:
        """Drums remember the turns that they begin with."""
        pulleys = tuple(
            p._replace(drum=p.drum._replace(turns=turned.get(p.place[0], 0))) if p.drum else p
            for p in joint.pulleys
        )
        mounted: Rope = replace(joint, pulleys=pulleys)
        return mounted

    def describe(self, joint: Any) -> str:
        """Describe the length and the pulleys of the rope in words."""
        over = f' over {len(joint.pulleys) - 2} points' if joint.pulleys[2:] else ''
        return f'rope of {joint.length:g} m from {joint.first}{over}, which may hang slack'

    def bounds(self, spec: ClearanceSpec, joint: Any, mechanism: Mechanism) -> list[MotionBound]:
        """The slack that it has left."""
        return [Slack(joint.closure(mechanism), 'left', 0.0, **spec.behaviour())]

    @classmethod
    def assembled(
        cls, names: Names, joints: Joints, tree: Mechanism, start: Mapping[str, float]
    ) -> Joints:
        """Ropes on their pulleys; a missing length is that of the path at the start."""
        q = {c: start.get(c, 0.0) for c in tree.coordinates}
        return tuple(_laid(names, j, tree, q) if isinstance(j, Rope) else j for j in joints)


def _laid(names: Names, rope: Rope, tree: Mechanism, q: Mapping[str, float]) -> Rope:
    given, where = names.scene.joints[rope.name], f'joints.{rope.name}'
    places = [complex(*tree.locate(link, q, at)) for (link, at), *_ in rope.pulleys]
    stretches = [b - a for a, b in pairwise(places)]
    pulleys = []
    for k, reference in enumerate(given.rope):
        pulley = rope.pulleys[k]
        if pulley.radius:
            key = f'{where}.pulleys.{reference}.passes'
            said, turn = given.pulleys[reference].passes, 0.0
            if said is None:
                if not 0 < k < len(stretches):
                    raise InputError(
                        f'{key} is missing: how the rope goes round the drum, counterclockwise or '
                        'clockwise, from its first point on'
                    )
                bend = stretches[k - 1].conjugate() * stretches[k]
                turn = bend.imag
                if abs(turn) <= _STRAIGHT * abs(bend):
                    raise InputError(
                        f'{key} is missing: at the start the rope is straight there: '
                        'counterclockwise or clockwise, from its first point on'
                    )
            left = turn > 0.0 if said is None else said == 'counterclockwise'
            pulley = pulley._replace(radius=pulley.radius if left else -pulley.radius)
        pulleys.append(pulley)
    for k in (0, -1):
        if pulleys[k].radius:  # along = (l + i (r2 - r1)) d
            along, near = stretches[k], (pulleys[0], pulleys[1]) if k == 0 else pulleys[-2:]
            off = near[1].radius - near[0].radius
            free = math.sqrt(max(abs(along) ** 2 - off**2, 0.0))
            way = cmath.phase(along / complex(free, off)) if along else 0.0
            drum = Drum(way, tree.angle(pulleys[k].place[0], q))
            pulleys[k] = pulleys[k]._replace(drum=drum)
    rope = replace(rope, pulleys=tuple(pulleys))
    if not rope.length and not closures(tree, tree.cut):
        rope = replace(rope, length=_way(rope, tree, q))
    if not rope.length:
        raise InputError(
            f'{where}.length is missing: in a machine with closed loops it does not follow from '
            'the start'
        )
    return rope


def _way(rope: Rope, tree: Mechanism, q: Mapping[str, float]) -> float:
    """Length of the path of a rope at coordinates [m]."""
    frames = Frames(tree.coordinates, Parameters())
    (way,) = rope.closure(tree).values(frames)
    function = SwitchedFunction(
        frames, [[way.value]], [*frames.q.values(), *frames.outside.values()]
    )
    known = [*(q[c] for c in tree.coordinates), *(0.0 for _ in frames.outside)]
    length = float(function(np.array(known)[:, None])[0][0, 0])
    if not math.isfinite(length) or length <= 0.0:
        raise InputError(
            f'joints.{rope.name}.rope: at the start its pulleys overlap, or its points coincide'
        )
    return length
