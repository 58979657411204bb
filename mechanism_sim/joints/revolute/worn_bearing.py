"""Revolute joints with clearance whose pin or bushing is worn, dry or in oil."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.engine.contact.film import FilmShape, JournalMotion, Vector
from mechanism_sim.joints.revolute.bearing import BearingClearance, FilmBearing
from mechanism_sim.joints.revolute.worn import FilmProfile, WornShape, WornSurface, product
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.frames import Frames, Jet, JetPair, Parameters
from mechanism_sim.planar.gaps import with_turning
from mechanism_sim.planar.points import LinkPoint
from mechanism_sim.planar.protocols import Wrench

_ROUND = WornShape(0.0, None, None)


class _Pressed(NamedTuple):
    """Contact of a worn bearing, in the world."""

    gap: Jet  #: gap [m]
    place: JetPair  #: position of the pin from the bushing's centre [m]
    normal: JetPair  #: from bushing to pin: values and rates
    on_bushing: tuple[Term, Term]  #: part of the normal with a moment about the bushing's centre


@dataclass(frozen=True)
class WornBearing(BearingClearance):
    """A bearing of which bushing, pin or both are worn."""

    shape: WornShape = _ROUND

    @property
    def _worn(self) -> list[tuple[WornSurface, LinkPoint, str]]:
        """The surfaces that are worn, the points of their links, names of their parameters."""
        points, shape = self.mechanism.joint(self.joint).points, self.shape
        given = (shape.pin, points[0], 'pin'), (shape.bushing, points[1], 'bushing')
        return [(s, at, f'{self.name}.{part}') for s, at, part in given if s is not None]

    def _pressed(self, frames: Frames) -> _Pressed:
        none = Jet(None, {}, None, None)
        x, y = self._pin_in_bushing(frames)
        gap, normal, on_bushing = none, (none, none), (None, None)
        for surface, (link, at), name in self._worn:
            ux, uy = frames.position(self.mechanism.direction(link, 0.0, at), name)
            seen = ux * x + uy * y, ux * y - uy * x
            touch = surface.touch(frames, name, *seen)
            both = list(zip(touch.slope, touch.slope_rate, seen, strict=True))
            gap += Jet(
                touch.value,
                {c: add(*(mul(slope, jet.gradient.get(c)) for slope, _, jet in both))
                 for c in {**seen[0].gradient, **seen[1].gradient}},
                add(*(mul(slope, jet.rate) for slope, _, jet in both)),
                add(*(mul(slope, jet.curvature) for slope, _, jet in both),
                    *(mul(bend, jet.rate) for _, bend, jet in both)),
            )  # fmt: skip
            gx, gy = (Jet(-slope, {}, -bend, None) for slope, bend, _ in both)
            own = ux * gx - uy * gy, uy * gx + ux * gy
            normal = normal[0] + own[0], normal[1] + own[1]
            if surface is self.shape.bushing:
                on_bushing = own[0].value, own[1].value
        if len(self._worn) == 2:  # the circle of both counts once
            mean = dense(frames.parameters(f'{self.name}.mean', self.shape.mean))
            gap += (x.half_square() + y.half_square()) / mean - 0.5 * mean
            normal = normal[0] - x / mean, normal[1] - y / mean
        return _Pressed(gap, (x, y), normal, on_bushing)

    def value(self, frames: Frames) -> Jet:
        """Gap between both surfaces as `WornSurface` measures it [m]."""
        return self._pressed(frames).gap

    def normal(self, frames: Frames) -> JetPair:
        """Normal of both surfaces, from bushing to pin: of length 1 where they touch."""
        return self._pressed(frames).normal

    def slip(self, frames: Frames) -> Jet:
        """``Q'.t + rp w1 - (rp + Q.n) w2`` [m/s]: as of a circle, whose Q.n is c.

        The pin's surface is taken at rp from its centre: of a worn one off by depth over radius.
        """
        _, (x, y), (nx, ny), _ = self._pressed(frames)
        if self.law is not None:
            inverse = self.stretched(frames)[1]
            nx, ny = nx * inverse, ny * inverse
        along = Jet(
            None,
            {c: add(mul(nx.value, y.gradient.get(c)), neg(mul(ny.value, x.gradient.get(c))))
             for c in {**x.gradient, **y.gradient}},
            add(mul(nx.value, y.rate), neg(mul(ny.value, x.rate))),
            add(mul(nx.value, y.curvature), neg(mul(ny.value, x.curvature)),
                mul(nx.rate, y.rate), neg(mul(ny.rate, x.rate))),
        )  # fmt: skip
        points, radius = self.mechanism.joint(self.joint).points, self.pin_radius
        slip = with_turning(along, frames, self.mechanism, self.name, points, (radius, -radius))
        depth: Jet = nx * x + ny * y
        return with_turning(slip, frames, self.mechanism, self.name, points[1:], (-depth,))

    def wrench(self, frames: Frames, N: Term, T: Term) -> Wrench:
        """Wrench on the bushing's link, about the bushing's centre."""
        _, (x, y), normal, (bx, by) = self._pressed(frames)
        depth = add(mul(normal[0].value, x.value), mul(normal[1].value, y.value))
        if self.law is not None:
            depth = mul(depth, self.stretched(frames)[1].value)
        arm = add(frames.parameters(f'{self.name}.pin_radius', self.pin_radius), depth)
        force = self.pressing(frames, normal, (N, T), arm)
        across = add(mul(x.value, by), neg(mul(y.value, bx)))
        return force._replace(moment=add(force.moment, mul(across, N)))

    @property
    def room(self) -> float:
        """``-c`` of the widest circle [m]."""
        return -self.shape.widest

    def touch(self, q: Array) -> tuple[Array, Array | float, Array | float]:
        """The normal of the surfaces as they are, ``Q.n``, and the gradient's length, nearly 1."""
        x, y = self.mechanism.trace(self.apart, q)[0]
        outward = -self._measure(q)[1]
        length = np.abs(outward)
        normal = np.array([outward.real, outward.imag]) / length
        return normal, normal[0] * x + normal[1] * y, length

    def gap(self, q: Array) -> Array:
        """Distance of the walls (N,) [m] at coordinates (n, N)."""
        return self.distance(self._measure(q)[0])

    def _measure(self, q: Array) -> tuple[Array, ComplexArray]:
        """Value and gradient of the gap at coordinates (n, N)."""
        x, y = self.mechanism.trace(self.apart, q)[0]
        ways = [self.mechanism.trace(self.mechanism.direction(link, 0.0, at), q)[0]
                for _, (link, at), _ in self._worn]  # fmt: skip
        return self.shape.measure(x + 1j * y, [ux + 1j * uy for ux, uy in ways])


@dataclass(frozen=True, eq=False)
class WornFilm(FilmBearing):
    """The film of a bearing of which bushing, pin or both are worn, as thick as it is anywhere."""

    wall: WornBearing | None = None
    profile: FilmProfile | None = None

    def thickness(self, q: Array) -> float:
        """Least thickness of the film [m]; `q` (n, 1)."""
        assert self.wall  # noqa: S101 - given
        return self.roughness + float(self.wall.gap(q)[0])

    def _acts(self, frames: Frames) -> tuple[Vector, Vector, JournalMotion]:
        profile, motion = self.profile, self._motion(frames)
        assert profile and self.wall  # noqa: S101, PT018 - given
        ends = zip(self.mechanism.joint(self.name).points, ('pin', 'bushing'), strict=True)
        ways = [
            frames.position(self.mechanism.direction(link, 0.0, at), f'{self.name}.{part}')
            for (link, at), part in ends
        ]
        ux, uy = (dense(u.value) for u in ways[profile.place])
        ox, oy = (dense(u.value) for u in ways[1 - profile.place])
        own = motion._replace(
            x=ux * motion.x + uy * motion.y,
            y=ux * motion.y - uy * motion.x,
            vx=ux * motion.vx + uy * motion.vy,
            vy=ux * motion.vy - uy * motion.vx,
            shape=self._shape(frames.parameters, profile, (ox * ux + oy * uy, oy * ux - ox * uy)),
        )
        if self.soft:  # no nearer than where walls touch, along their normal
            closed = frames.parameters.reserve(f'{self.name}.closed')
            depth = self.wall.depth(dense(self.wall.value(frames).value))
            nx, ny = (dense(n.value) for n in self.wall.normal(frames))
            along = nx * motion.x + ny * motion.y + (1.0 - closed) * self.film.clearance
            own = own._replace(share=1.0 - closed * depth / along)
        fx, fy = self.film.force(own)
        return (ux * fx - uy * fy, uy * fx + ux * fy), self.film.moments(own), motion

    def _shape(self, p: Parameters, profile: FilmProfile, angle: tuple[Term, Term]) -> FilmShape:
        """Shape of both walls seen from one, with the other turned by an angle (cos, sin)."""
        sign = 1.0 if profile.place else -1.0
        own = [
            [[p.reserve(f'{self.name}.{part}{k}', x)] for k, x in enumerate(values)]
            for part, values in zip(('depth', 'slope'), profile.along(), strict=True)
        ]
        power, back = (hy.expression(1.0), hy.expression(0.0)), (angle[0], -angle[1])
        for k, c in enumerate(profile.other, 1):
            power = product(power, back)
            known = (p.reserve(f'{self.name}.{part}{k}', x)
                     for part, x in (('x', c.real), ('y', c.imag)))  # fmt: skip
            a, b = product(tuple(known), power)
            for j, at in enumerate(2.0 * np.pi * k / profile.count * np.arange(profile.count)):
                u, v = float(np.cos(at)), float(np.sin(at))
                own[0][j].append(u * a - v * b)
                own[1][j].append((v * a + u * b) * k)  # less its slope
        depth, slope = ([hy.sum(terms) for terms in part] for part in own)
        steepest = p.reserve(f'{self.name}.steepest', profile.steepest)
        return FilmShape(depth, [sign * x for x in slope], steepest, profile.blur)
