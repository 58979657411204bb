"""Intermittent motion: a driving pin moves a slotted follower, which is locked in between.

Slots repeat, so their distance from the pin is written as a periodic function: with N slots on a
wheel, a sine of N times the pin's direction in the wheel's frame ([V] 2.6). A switch tells whether
the pin is in a slot. Nothing is counted, so that 10^6 turns lose no digit. Where it enters and
leaves, the distance from the slot and that from the locked position agree, and the pin moves along
the slot: the motion goes on without an impact.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, ClassVar, NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.numerics.symbolic import Term, add, dense, div, mul, neg
from mechanism_sim.planar.closures import HigherClosure
from mechanism_sim.planar.frames import Frames, Jet, JetPair, lift
from mechanism_sim.planar.mechanism import HigherPair, Mechanism
from mechanism_sim.planar.points import GROUND, LinkPoint
from mechanism_sim.planar.protocols import Wrench
from mechanism_sim.planar.touch import Touch
from mechanism_sim.planar.view import (
    SLOT,
    Draft,
    PairView,
    Told,
    complex_of,
    points_of,
)

DRIVEN: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        'velocity of what is driven': ('driven_velocity',),
        'its acceleration': ('driven_acceleration',),
        'effort on what is driven': ('driven_effort',),
    }
)
"""Readings shown in charts, by the chart's title."""


class GenevaReading(NamedTuple):
    """An intermittent drive at N instants; forces are NaN where masses are not known."""

    engaged: Annotated[Mask, Told('', 'pin in a slot: 1, else 0')]
    driver_angle: Annotated[Array, Told('rad', 'angle of {first}', repeats=True)]
    driver_speed: Annotated[Array, Told('rad/s', 'speed of {first}', repeats=True)]
    driver_acceleration: Annotated[Array, Told('rad/s^2', 'acceleration of {first}', repeats=True)]
    driven_position: Annotated[Array, Told('rad or m', 'position of {second}', repeats=True)]
    driven_velocity: Annotated[Array, Told('rad/s or m/s', 'speed of {second}', repeats=True)]
    driven_acceleration: Annotated[
        Array, Told('rad/s^2 or m/s^2', 'acceleration of {second}', repeats=True)
    ]
    force_x: Annotated[Array, Told('N', 'force of {first} on {second}, x')]
    force_y: Annotated[Array, Told('N', 'force of {first} on {second}, y')]
    driven_effort: Annotated[Array, Told('N m or N', 'effort on {second}')]
    driver_torque: Annotated[Array, Told('N m', 'torque on {first}')]


@dataclass(frozen=True)
class IndexingPair(HigherPair):
    """A driving pin of `first`, and slots of `second` that it visits one after another."""

    node: ClassVar[str] = 'geneva'
    reads: ClassVar[type] = GenevaReading
    charts: ClassVar[Mapping[str, tuple[str, ...]]] = DRIVEN

    @abstractmethod
    def reading(self, view: PairView) -> GenevaReading:
        """Reading: position of the pin in a slot, motions of both links, forces."""

    def _read(self, view: PairView, engaged: Mask, centre: Array, effort: Array) -> GenevaReading:
        driver, driven = view.turning(self.first), view.trajectory(self.second)
        (fx, fy), torque = view.force, view.moment_on_first(centre)
        return GenevaReading(
            engaged, driver.total, *driver[1:3], driven.total, *driven[1:3], fx, fy, effort, torque
        )

    def touch(self, mechanism: Mechanism, radius: float = 0.0) -> Touch:
        """Contact of the pin with its slot, as friction needs it."""
        return Touch(self.closure(mechanism), f'{self.name}.friction', radius, at_pin=True)


@dataclass(frozen=True)
class Geneva(IndexingPair):
    """A driving pin of `first` and a Geneva wheel `second`, both pivoted on the ground.

    While the pin is out of the slots, the wheel is locked by the crank's arc. `on_first` is the
    pin, `on_second` the wheel's centre.
    """

    slots: int
    towards: float  #: [rad] direction from the wheel's centre to the crank's, in the world
    distance: float  #: distance of the two centres [m]
    entry: float  #: radius from the wheel's centre to the mouth of a slot [m]

    @property
    def alike(self) -> tuple[str, ...]:
        """The wheel, whose constraint repeats with its slots."""
        return (self.second,)

    def reading(self, view: PairView) -> GenevaReading:
        """The pin is in a slot while nearer to the centre than the slots' mouths."""
        centre = view.place(self.second, self.on_second)
        x, y = view.place(self.first, self.on_first) - centre
        engaged = x * x + y * y < self.entry**2
        way = self.distance * np.array([[math.cos(self.towards)], [math.sin(self.towards)]])
        return self._read(view, engaged, centre + way, view.moment)

    def draw(self, draft: Draft) -> None:
        """A pin and a locking disc, and a wheel: open slots, between them hollows for the disc."""
        pin, d, mouth, n = (self.first, self.on_first), self.distance, self.entry, self.slots
        draft.pin(pin, self.name)
        crank = math.sqrt(d * d - mouth * mouth)
        hollow = 0.5 * (crank + d - mouth)
        half = SLOT * draft.symbol
        bottom = d - crank + half * np.exp(1j * np.linspace(1.5, 0.5, 13) * np.pi)
        edge = math.asin(min(half / mouth, 1.0))
        aside = np.linspace(edge - math.pi / n, math.pi / n - edge, 49)
        across = d * np.sin(aside)
        depth = d * np.cos(aside) - np.sqrt(np.maximum(hollow**2 - across**2, 0.0))
        radii = np.where(np.abs(across) < hollow, np.minimum(depth, mouth), mouth)
        rim = radii * np.exp(1j * (aside + math.pi / n))
        sectors = np.exp(2j * math.pi * np.arange(n) / n)
        wheel = np.outer(sectors, np.concatenate([bottom, rim])).ravel()
        draft.add('wheel', self.second, points_of(wheel) + self.on_second)
        # the disc holds the wheel as soon as the pin has left it
        middle = draft.at((self.second, self.on_second))[:, 0]
        middle = middle + d * np.array([math.cos(self.towards), math.sin(self.towards)])
        centre = draft.within(self.first, (GROUND, (float(middle[0]), float(middle[1]))))[:, 0]
        out, free = complex_of(self.on_first - centre), math.acos(min(crank / d, 1.0))
        lock = 0.98 * hollow * np.exp(1j * np.linspace(free, 2.0 * math.pi - free, 73))
        clear = 0.96 * (d - mouth) * np.exp(1j * np.linspace(-free, free, 25))
        disc = np.concatenate([lock, clear]) * out / abs(out)
        draft.add('wheel', self.first, points_of(disc) + centre)

    def discs(self) -> Sequence[tuple[LinkPoint, float]]:
        """Disc of the wheel up to the slots' mouths."""
        return [((self.second, self.on_second), self.entry)]

    def closure(self, mechanism: Mechanism) -> GenevaClosure:
        """Closure without clearance."""
        return GenevaClosure(self, mechanism)


@dataclass(frozen=True)
class GenevaClosure(HigherClosure[Geneva]):
    """A Geneva wheel without clearance."""

    def _pin(self, frames: Frames) -> JetPair:
        """Vector from the wheel's centre to the pin, in the world [m]."""
        return frames.position(self.mechanism.separation(self.name), self.name)

    def engaged(self, frames: Frames) -> Term:
        """1 while the pin is in a slot: nearer to the wheel's centre than the slots' mouths."""
        x, y = self._pin(frames)
        square = frames.parameters(f'{self.name}.entry.square', self.joint.entry**2)
        inside = add(square, neg(mul(x.value, x.value)), neg(mul(y.value, y.value)))
        return frames.switch(self.name, dense(inside) / self.joint.entry**2)

    def values(self, frames: Frames) -> list[Jet]:
        """Offset of the pin, or of the locked wheel at the slot's mouth, from closure [m].

        ``(r/N) sin(N (phi - psi))`` with the pin at polar coordinates r, phi about the wheel's
        centre; ``(R/N) sin(N (psi - towards))`` with the slots' mouths at R.
        """
        radius, beside, turned = self._off(frames)
        slot = radius * sine(beside, self.joint.slots)
        entry = lift(dense(frames.parameters(f'{self.name}.entry', self.joint.entry)))
        locked = sine(turned, self.joint.slots) * entry
        return [either(self.engaged(frames), slot, locked)]

    def _off(self, frames: Frames) -> tuple[Jet, Jet, Jet]:
        """Radius r [m]; angles of the pin off a slot, and of the wheel off its locked position."""
        wheel = frames.angle(self.mechanism.frame(self.joint.second)[0])
        radius, angle = _polar(*self._pin(frames))
        towards = lift(dense(frames.parameters(f'{self.name}.towards', self.joint.towards)))
        return radius, angle - wheel, wheel - towards

    def facing(self, frames: Frames) -> list[Term]:
        """Cosines whose sines are the offset: on a slot, or, locked, in the middle of two."""
        n, (_, *off), on = self.joint.slots, self._off(frames), self.engaged(frames)
        slot, locked = (hy.cos(n * x.value) for x in off)
        return [on * slot - (1.0 - on) * locked]

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """The pin presses across the slot; the crank's arc through the crank's centre.

        With clearance the slot is not quite along the pin's direction: a part of the force is
        towards the wheel's centre, by the offset over the pin's distance.
        """
        joint, on, (force,), (offset,) = (
            self.joint, self.engaged(frames), forces, self.values(frames),
        )  # fmt: skip
        moment = mul(force, offset.gradient[self.mechanism.frame(joint.second)[0]])
        x, y = self._pin(frames)
        r = hy.sqrt(dense((x * x + y * y).value))
        off = 1.0 - on
        p, t = frames.parameters, joint.towards
        distance = dense(p(f'{self.name}.distance', joint.distance))
        sx, cx = p(f'{self.name}.towards.y', math.sin(t)), p(f'{self.name}.towards.x', math.cos(t))
        # across the slot lies the pin's direction turned by 90 degrees
        across, arc = mul(on, moment) / r, mul(off, moment) / distance
        along = neg(mul(on, mul(force, offset.value))) / r
        return Wrench(
            add(
                neg(mul(across, dense(y.value) / r)),
                mul(along, dense(x.value) / r),
                neg(mul(arc, sx)),
            ),
            add(mul(across, dense(x.value) / r), mul(along, dense(y.value) / r), mul(arc, cx)),
            moment,
        )


def _polar(x: Jet, y: Jet) -> JetPair:
    """Radius and angle of a vector that does not vanish."""
    half = x.half_square() + y.half_square()
    r = hy.sqrt(2.0 * half.value)
    square, turning = r * r, x.across(y)
    angle = Jet(
        hy.atan2(dense(y.value), dense(x.value)),
        {n: div(g, square) for n, g in turning.gradient.items()},
        div(turning.rate, square),
        add(
            div(turning.curvature, square),
            neg(mul(div(turning.rate, square), 2.0 * half.rate / square)),
        ),
    )
    return half.chain(r, 1.0 / r, -1.0 / (square * r)), angle


def sine(x: Jet, n: int | hy.expression) -> Jet:
    """``sin(n x)/n``."""
    c, s = hy.cos(n * dense(x.value)), hy.sin(n * dense(x.value))
    return x.chain(s / n, c, -(n * s))


def either(flag: Term, a: Jet, b: Jet) -> Jet:
    """First jet where a flag is 1, second where it is 0; the flag is constant."""
    return a * lift(flag) + b * lift(1.0 - flag)
