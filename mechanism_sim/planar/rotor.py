"""Rotors: a link on a shaft or in compliant supports, whose axis moves and tilts a little.

The axis is that of a shaft without mass, square to the plane of the machine. Its coordinates
come in pairs, along x and y: the centre of each disk, the slope of the axis there (out of the
direction in which it rests, towards x and y), and each support that has a mass. All disks turn
with the link, for the shaft does not twist. With the pairs as complex numbers ``r = x + i y``, the
spin W and the diametral and polar moments of inertia ``I_d``, ``I_p`` their equations are

    M r'' + C r' + C_i (r' - i W r) + K r - i W sum I_p e e^T r' = forces

with e the unit vectors of the slopes, and K and C of their own along x and y. External damping C
acts against the motion in the ground, internal damping ``C_i`` in the shaft against that in a
frame that turns with it, so that it feeds a whirl slower than the spin; the disk's spin pays for
it. The gyroscopic moment does no work. All is of the first order in the tilt (G. Genta, Dynamics
of Rotating Systems, 2005, sections 2.4, 2.5 and 4.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, TypeAlias

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.symbolic import Term, add, mul, neg
from mechanism_sim.planar.bodies import Body, LinkExtension
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.points import GROUND, Point

Rows: TypeAlias = tuple[tuple[float, ...], ...]
SLOPE = 'tilt'


@dataclass(frozen=True)
class Support:
    """Force of a support on the shaft, by pair: minus ``stiffness r + damping r'``."""

    stiffness: Rows  #: (2, p) along x and along y [N/m, N/rad]
    damping: Rows  #: (2, p) [N s/m, N s/rad]
    rigid: bool = False  #: whether it is the force of the shaft, with its internal damping


def disk_of(pair: str) -> str:
    """The disk whose slope a pair of coordinates is; empty for the link's own."""
    return pair.removesuffix(SLOPE).removesuffix('_')


class Lump(NamedTuple):
    """A mass on the axis, or beside it: of a support, or of a disk beside that of the link."""

    mass: float  #: [kg]
    shares: tuple[float, ...]  #: (p,) displacement per unit of each pair
    cog: tuple[float, float] = (0.0, 0.0)  #: eccentricity in the frame of the link [m]
    polar: float = 0.0  #: moment of inertia [kg m^2]


@dataclass(frozen=True)
class Rotor(LinkExtension):
    """Compliance of a rotor's shaft and supports; p pairs of coordinates."""

    #: names of the pairs; that of the centre of the link's own disk is empty
    pairs: tuple[str, ...]
    #: (2, p, p) along x and along y
    stiffness: tuple[Rows, Rows]
    damping: tuple[Rows, Rows]
    internal: Rows  #: (p, p) damping in the shaft
    #: (p,) moments of inertia tilted by slopes [kg m^2]; 0 for other pairs
    diametral: tuple[float, ...]
    polar: tuple[float, ...]
    lumps: tuple[Lump, ...]  #: masses beside the link's own disk
    supports: tuple[tuple[str, Support], ...]
    place: tuple[float, float] = (0.0, 0.0)  #: position of the undeformed axis in the world [m]
    relaxation: float = 0.0  #: internal damping of the shaft over its stiffness [s]

    flexible: ClassVar[bool] = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates: ``x``, ``y``, ``tilt_x``, ``tilt_y``, ``DISK_x`` and so on."""
        return tuple(f'{pair}_{axis}' if pair else axis for pair in self.pairs for axis in 'xy')

    @property
    def angles(self) -> tuple[str, ...]:
        """Coordinates that are angles."""
        slopes = (pair for pair, tilts in zip(self.pairs, self.diametral, strict=True) if tilts)
        return tuple(f'{pair}_{axis}' for pair in slopes for axis in 'xy')

    @property
    def tilting_spins(self) -> dict[tuple[str, str], float]:
        """Polar moments of inertia of the disks that tilt [kg m^2], by their slopes."""
        disks = zip(self.pairs, self.diametral, self.polar, strict=True)
        return {(f'{pair}_x', f'{pair}_y'): polar for pair, tilts, polar in disks if tilts}

    @property
    def mass(self) -> float:
        """Mass of supports and further disks [kg]."""
        return sum(lump.mass for lump in self.lumps)

    @property
    def inertia(self) -> float:
        """Polar moment of inertia of further disks [kg m^2]."""
        return sum(lump.polar for lump in self.lumps)

    def extent(self, body: Body) -> float:
        """The disk's radius."""
        return body.disk_radius

    def moved(self, link: str, shares: Sequence[float] = (1.0,)) -> Point:
        """Displacement of a point of the axis by shares of the pairs; of the disk's centre."""
        found: Point = {}
        for pair, share in zip(self.pairs, shares, strict=False):
            if share:
                x, y = (f'{link}.{pair}_{a}' if pair else f'{link}.{a}' for a in 'xy')
                found |= {(GROUND, x): (share, 0.0), (GROUND, y): (0.0, share)}
        return found

    def masses(self, body: Body, place: Callable[..., Point]) -> Iterator[tuple[float, Point]]:
        """The link's own disk, then what is beside it.

        Masses of a tilt are points of the axis a metre from the disk, which have together neither
        a mass nor a momentum.
        """
        link, axis = body.name, Point({(GROUND, None): self.place})
        yield body.mass - self.mass, place(body.cog)
        for lump in self.lumps:
            off: Point = {(link, None): lump.cog} if any(lump.cog) else {}
            yield lump.mass, axis | self.moved(link, lump.shares) | off
        for k, inertia in enumerate(self.diametral):
            for share, along in ((0.5, 1.0), (0.5, -1.0), (-1.0, 0.0)) if inertia else ():
                tilt = [along * (j == k) for j in range(len(self.pairs))]
                yield share * inertia, axis | self.moved(link, tilt)

    def forces(self, link: str, frames: Frames) -> RotorForces:
        """Forces on its coordinates."""
        return RotorForces(self, link, frames)

    def support_force(self, name: str, q: Array, v: Array, spin: Array) -> Array:
        """Force (2, N) [N] of a support on the shaft.

        Parameters
        ----------
        q, v : coordinates and their rates (2 p, N), in the order of `names`
        spin : angular velocity of the disk (N,) [rad/s]
        """
        support = dict(self.supports)[name]
        r, dr = (u.reshape(len(self.pairs), 2, -1).swapaxes(0, 1) for u in (q, v))
        if support.rigid:
            r = r + self.relaxation * (dr - spin * np.array([-r[1], r[0]]))
        parts = zip(support.stiffness, r, support.damping, dr, strict=True)
        return -np.array([np.asarray(k) @ x + np.asarray(c) @ u for k, x, c, u in parts])


class RotorForces:
    """The forces of a rotor as symbols, on the left-hand side of its equations of motion.

    Attributes
    ----------
    elastic, other : forces of stiffness, and those that depend on rates, by coordinate
    energy, loss : strain energy [J], dissipated power [W]
    """

    def __init__(self, rotor: Rotor, link: str, frames: Frames) -> None:
        p, v = frames.parameters, frames.v
        names = [
            [f'{link}.{pair}_{axis}' if pair else f'{link}.{axis}' for pair in rotor.pairs]
            for axis in 'xy'
        ]
        self.elastic: dict[str, Term] = {}
        self.other: dict[str, Term] = {}
        self.energy: Term = None
        self.loss: Term = None
        spin, half = v[link], hy.expression(0.5)
        slips: list[list[Term]] = []
        for own, crossed, sign in ((names[0], names[1], 1.0), (names[1], names[0], -1.0)):
            slips.append([
                add(v[a], mul(hy.expression(sign), mul(spin, frames.q[b])))
                for a, b in zip(own, crossed, strict=True)
            ])  # fmt: skip
        torque: Term = None
        for axis in (0, 1):
            for i, c in enumerate(names[axis]):
                key = f'links:{c}'
                held, damped, inner = None, None, None
                for j, other in enumerate(names[axis]):
                    k = p(f'{key}.stiffness.{j}', rotor.stiffness[axis][i][j])
                    d = p(f'{key}.damping.{j}', rotor.damping[axis][i][j])
                    held = add(held, mul(k, frames.q[other]))
                    damped = add(damped, mul(d, v[other]))
                    damping = p(f'{key}.internal_damping.{j}', rotor.internal[i][j])
                    inner = add(inner, mul(damping, slips[axis][j]))
                self.elastic[c], self.other[c] = held, add(damped, inner)
                self.energy = add(self.energy, mul(half, mul(held, frames.q[c])))
                self.loss = add(self.loss, mul(damped, v[c]), mul(inner, slips[axis][i]))
                lever = mul(inner, frames.q[names[1 - axis][i]])
                torque = add(torque, lever if axis == 0 else neg(lever))
        self.other[link] = torque
        for k, polar in enumerate(rotor.polar):
            if not rotor.diametral[k]:
                continue
            x, y = names[0][k], names[1][k]
            disk = disk_of(rotor.pairs[k])
            name = f'links:{link}.{disk}' if disk else f'links:{link}'
            gyroscopic = mul(p(f'{name}.polar_inertia', polar), spin)
            self.other[x] = add(self.other[x], mul(gyroscopic, v[y]))
            self.other[y] = add(self.other[y], neg(mul(gyroscopic, v[x])))
