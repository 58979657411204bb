"""A machine with loose joints as a tree of links, in plain numbers that any simulator takes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import heyoka as hy
import numpy as np

from benchmarks.problem import Answer
from mechanism_sim.joints.contact_keys import ClearanceSpec
from mechanism_sim.linkages.forces import AppliedForce
from mechanism_sim.numerics.formula import Words, expression, read
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.mechanism import Mechanism, Prismatic, Revolute
from mechanism_sim.planar.points import GROUND, Vector2, rotate
from mechanism_sim.scene import Machine

FLYWHEEL = 1e9  #: [kg m^2] on what is driven: its speed stays the same to 1e-10 rad/s

SLIDE_X, SLIDE_Y, HINGE = 'PrismaticX', 'PrismaticY', 'RevoluteZ'


@dataclass(frozen=True)
class Link:
    """A link, and how its parent carries it.

    Its frame lies at the joint that carries it, with x along a guide; that of a link that no joint
    carries lies at its centre of gravity, and has two displacements before its angle.

    Attributes
    ----------
    parent : name of the link that carries it, or `GROUND`
    at, turn : where the joint lies in the frame of the parent [m], [rad]
    axes : `SLIDE_X`, `SLIDE_Y`, `HINGE`: what it can do there, one after the other
    start, rates : of these at time zero [m, rad], [m/s, rad/s]
    mass, inertia, cog : [kg], [kg m^2] about the centre of gravity, [m] in its frame; the inertia
        of what does not turn is any, but large
    flywheel, damping : on its hinge [kg m^2], [N m s/rad]
    """

    name: str
    parent: str
    at: Vector2
    turn: float
    axes: tuple[str, ...]
    start: tuple[float, ...]
    rates: tuple[float, ...]
    mass: float
    inertia: float
    cog: Vector2
    flywheel: float = 0.0
    damping: float = 0.0


@dataclass(frozen=True)
class Pin:
    """A pin on a link at a point [m] of its frame, in a bushing on another; ideal without play."""

    name: str
    links: tuple[str, str]
    points: tuple[Vector2, Vector2]
    play: ClearanceSpec | None


class Push(NamedTuple):
    """A force [N] along a guide, as a function of angles of links (n,) [rad]."""

    angles: tuple[str, ...]
    force: Callable[[Answer], Answer]


@dataclass(frozen=True)
class Tree:
    """The machine at its start.

    Parameters
    ----------
    machine : of revolute joints, guides on the ground, drives of constant speed or of a torque
    """

    machine: Machine

    @property
    def mechanism(self) -> Mechanism:
        """Cut at its loose joints."""
        return self.machine.mechanism

    @cached_property
    def _origins(self) -> dict[str, tuple[Vector2, float]]:
        """Places [m] and angles [rad] of the frames here in those of the links."""
        m = self.mechanism
        found: dict[str, tuple[Vector2, float]] = {GROUND: ((0.0, 0.0), 0.0)}
        found |= {link: (m.body(link).cog, 0.0) for link in m.floating}
        for link, j in m.tree_joints.items():
            if isinstance(j, Prismatic):
                if j.second != link:
                    raise NotImplementedError(f'{j.name}: the first link slides on the second')
                found[link] = j.on_second, j.axis - j.angle
            else:
                found[link] = j.on_first if j.first == link else j.on_second, 0.0
        return found

    def local(self, link: str, at: Vector2) -> Vector2:
        """A point of a link [m] in its frame here."""
        (x, y), turn = self._origins[link]
        return rotate((at[0] - x, at[1] - y), -turn)

    @cached_property
    def links(self) -> dict[str, Link]:
        """All links, parents first."""
        m, machine = self.mechanism, self.machine
        state, held = machine.initial_state(), machine.plan.held
        q = {c: x for c, (x, _) in held.items()} | dict(
            zip(machine.equations.system.free, state.q, strict=True)
        )
        v = {c: x for c, (_, x) in held.items()} | dict(
            zip(machine.equations.system.free, state.v, strict=True)
        )
        powered = {c: machine.plan.laws[c][0] for c in machine.plan.powered}
        ramps = [law for c in machine.plan.prescribed for law in machine.plan.laws[c]]
        if any(any(law.coefficients[:2]) for law in powered.values()) or any(
            isinstance(law, DriveLaw) and law.degree > 1 for law in ramps
        ):
            raise NotImplementedError('drives keep their speed or are braked in proportion to it')
        found = {}
        for link in (*m.floating, *m.tree_joints):
            body, parent, at, turn = m.body(link), GROUND, (0.0, 0.0), 0.0
            axes: tuple[str, ...] = (HINGE,)
            if link in m.floating:
                axes, names = (SLIDE_X, SLIDE_Y, HINGE), (f'{link}.x', f'{link}.y', link)
                start, rates = (tuple(x[c] for c in names) for x in (q, v))
            else:
                j, parent = m.tree_joints[link], m.parent(link)
                at = self.local(parent, j.on_second if j.first == link else j.on_first)
                turn = -self._origins[parent][1]
                if isinstance(j, Prismatic):
                    axes, turn = (SLIDE_X,), turn + j.axis
                    start, rates = (q[link],), (v[link],)
                else:
                    frame, _ = m.frame(parent)
                    start = (m.angle(link, q) - m.angle(parent, q) + turn,)
                    rates = (v[link] - v.get(frame, 0.0),)
            law = powered.get(link)
            found[link] = Link(
                link, parent, at, turn, axes, start, rates, body.mass,
                body.inertia if HINGE in axes else FLYWHEEL, self.local(link, body.cog),
                FLYWHEEL if link in machine.plan.prescribed else 0.0,
                -law.coefficients[2] if law else 0.0,
            )  # fmt: skip
        return found

    @cached_property
    def pins(self) -> tuple[Pin, ...]:
        """The loose joints, and those that close loops."""
        found = []
        for name in self.mechanism.cut:
            j = self.mechanism.joint(name)
            if not isinstance(j, Revolute):
                raise NotImplementedError(f'{name}: only revolute joints are loose here')
            points = self.local(j.first, j.on_first), self.local(j.second, j.on_second)
            found.append(
                Pin(name, (j.first, j.second), points, self.machine.plan.clearances.get(name))
            )
        return tuple(found)

    @cached_property
    def pushes(self) -> dict[str, Push]:
        """The forces along guides."""
        found = {}
        for load in self.machine.plan.elements(self.mechanism):
            guide = self.mechanism.tree_joints.get(getattr(load, 'point', [''])[0])
            if not isinstance(load, AppliedForce) or not isinstance(guide, Prismatic):
                raise NotImplementedError('only forces on guided links are known here')
            texts = [part for part in load.force if isinstance(part, str)]
            used = sorted({x for text in texts for x in read(text).names})
            known = {name: hy.expression(name) for name in used}
            x, y = (expression(str(part), Words(known)) for part in load.force)
            axis = rotate((1.0, 0.0), guide.axis)
            force = hy.cfunc([axis[0] * x + axis[1] * y], [*known.values()])
            found[guide.second] = Push(tuple(used), force)
        return found

    @property
    def loose(self) -> dict[Pin, ClearanceSpec]:
        """The joints with clearance."""
        return {pin: pin.play for pin in self.pins if pin.play}

    @property
    def lightest(self) -> float:
        """Least mass that an impact can set in motion [kg], whatever the position.

        Links are taken as free: with joints they are heavier.
        """

        def mobility(link: str, at: Vector2) -> float:
            x = self.links[link]
            return 1.0 / x.mass + math.dist(at, x.cog) ** 2 / max(x.inertia, x.flywheel)

        return 1.0 / max(
            sum(
                mobility(link, at)
                for link, at in zip(pin.links, pin.points, strict=True)
                if link != GROUND
            )
            for pin in self.loose
        )

    def coordinates(self, values: Mapping[str, tuple[float, ...]]) -> dict[str, float]:
        """The coordinates of the mechanism from what every link does at its joint."""
        found: dict[str, float] = {}
        m = self.mechanism
        for name, link in self.links.items():
            *displacements, last = values[name]
            if len(link.axes) > 1:
                found |= {f'{name}.x': displacements[0], f'{name}.y': displacements[1]}
            turned = m.angle(link.parent, found) - link.turn if link.axes == (HINGE,) else 0.0
            found[name] = turned + last
        return found

    def answer(self, values: Mapping[str, tuple[float, ...]]) -> Answer:
        """Coordinates in the order of the mechanism (n,)."""
        q = self.coordinates(values)
        return np.array([q[c] for c in self.mechanism.coordinates])

    def places(self, q: Mapping[str, float]) -> Answer:
        """Positions of all joints, as points of both their links (2 joints, 2) [m]."""
        m = self.mechanism
        ends = [(j.first, j.on_first) for j in m.joints]
        ends += [(j.second, j.on_second) for j in m.joints]
        return np.array([m.locate(link, q, at) for link, at in ends])
