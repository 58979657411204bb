"""Wear of a bearing, by direction on bushing and pin: impulses, sliding work, load times way.

Archard's law: the volume worn off is in proportion to the integral of normal force times the way
slid (J. F. Archard, Contact and rubbing of flat surfaces, J. Appl. Phys. 24 (1953) 981). Where the
contact follows, the integrals run over the motion's polynomials; impacts come on top.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechanism_sim.analysis.record import Record, loose_bearing
from mechanism_sim.analysis.roses import impact_rose
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.joints.revolute.bearing import BearingClearance
from mechanism_sim.joints.revolute.worn_bearing import WornBearing
from mechanism_sim.numerics.quadrature import SMOOTH
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.play import joint_of_gap
from mechanism_sim.sensing.joint_view import JointView

_BLOCK = 512  # segments at once


@dataclass(frozen=True, eq=False)
class WearMap:
    """Sums over a run by direction in the frame of a link, in n sectors.

    Attributes
    ----------
    link : whose frame it is
    edges : (n + 1,) of the sectors [rad], from -pi to pi
    impulse : (n,) normal impulses of impacts [N s]
    load : (n,) integral of the normal force over time in following [N s]
    load_way : (n,) integral of normal force times slip speed: Archard's measure of wear [N m]
    work : (n,) integral of friction force times slip speed: heat [J]
    """

    link: str
    edges: Array
    impulse: Array
    load: Array
    load_way: Array
    work: Array

    @property
    def middles(self) -> Array:
        """Of the sectors (n,) [rad]."""
        return np.asarray(0.5 * (self.edges[1:] + self.edges[:-1]))


def wear_maps(
    record: Record,
    joint: str,
    sectors: int = 72,
    pin_radius: float | None = None,
    skip: int = 0,
) -> tuple[WearMap, WearMap]:
    """Wear of the bushing and of the pin of a joint.

    Normal force, slip and direction are those at 8 Gauss nodes of every step; the sums over all
    sectors are exact to the tolerance of the run, but for steps within which sliding without
    friction turns back, and each node counts in the sector where it lies.

    Parameters
    ----------
    sectors : into which the circle is divided
    pin_radius : [m]; that of the scene unless told. Of a pin without friction it does not change
        the motion, but it does how far surfaces slide
    skip : whole turns at the start that are left out

    Returns
    -------
    Of the bushing and of the pin.
    """
    loose_bearing(record, joint)
    play = record.machine.plan.clearances[joint_of_gap(record.machine.mechanism, joint).name]
    radius = play.pin_radius if pin_radius is None else pin_radius
    if play.friction and radius != play.pin_radius:
        raise InputError(
            f'{record.machine.name}: the pin of {joint} has friction and a radius of '
            f'{play.pin_radius:g} m in the scene; it cannot be taken to be {radius:g} m afterwards'
        )
    if sectors < 1 or radius < 0.0:
        raise InputError('a wear map needs at least one sector, and a pin of no negative radius')
    edges = np.linspace(-np.pi, np.pi, sectors + 1)
    sums = np.zeros((2, 4, sectors))  # bushing and pin; impulse, load, load_way, work
    rose = impact_rose(record, joint, skip)
    for own, angle in zip(sums, (rose.on_bushing, rose.on_pin), strict=True):
        own[0] = _binned(angle, rose.normal_impulse, sectors)
    motion, physics = record.piece.motion, record.machine.physics
    gap = physics.clearances.index(joint)
    closed = np.flatnonzero(motion.closed[:, gap])
    closed = closed[motion.curve.start[closed] >= record.begin(skip)]
    for first in range(0, len(closed), _BLOCK):
        segments = closed[first : first + _BLOCK]
        duration = motion.curve.duration[segments, None]
        seen = physics.observe(motion, segments, duration * SMOOTH.places.fractions)
        weights = (duration * SMOOTH.weights).ravel()
        normal, tangential = seen.normal_force[gap], seen.friction_force[gap]
        angles, slip = _contact(record, joint, seen, play.radial, radius)
        shares = normal, normal * np.abs(slip), np.abs(tangential * slip)
        for own, angle in zip(sums, angles, strict=True):
            own[1:] += [_binned(angle, weights * share, sectors) for share in shares]
    links = rose.bushing, rose.pin
    bushing, pin = (WearMap(link, edges, *own) for link, own in zip(links, sums, strict=True))
    return bushing, pin


def _contact(
    record: Record, joint: str, seen: Observation, clearance: Array | float, radius: float
) -> tuple[tuple[Array, Array], Array]:
    """Where the contact lies on bushing and pin (N,) [rad], and the slip (N,) [m/s].

    The slip is that of `BearingClearance.slip`: ``Q'.t + rp w1 - (rp + c) w2``; of a worn bearing
    the normal is its own, and ``Q.n`` takes the place of c.
    """
    machine = record.machine
    pair = joint_of_gap(machine.mechanism, joint)
    gap = machine.equations.system.gaps[machine.physics.clearances.index(joint)]
    assert isinstance(gap, BearingClearance)  # noqa: S101 - it is a bearing
    view = JointView(machine.mechanism, pair, machine.physics, seen, np.zeros((0, 0), np.uint8))
    (x, y), (vx, vy), _ = view.trace(gap.apart)
    if isinstance(gap, WornBearing):
        nx, ny = gap.normals(seen.position)
        clearance = nx * x + ny * y
    else:
        nx, ny = (x, y) / np.hypot(x, y)
    first, second = view.turning(pair.first), view.turning(pair.second)
    slip = nx * vy - ny * vx + radius * first.velocity - (radius + clearance) * second.velocity
    on_bushing = np.arctan2(y + radius * ny, x + radius * nx)
    return (on_bushing - second.position, np.arctan2(ny, nx) - first.position), slip


def _binned(angle: Array, values: Array, sectors: int) -> Array:
    """Sums of values by the sector in which angles (N,) [rad] lie, from -pi on: (sectors,)."""
    k = np.floor((angle / (2.0 * np.pi) + 0.5) * sectors).astype(np.int64) % sectors
    return np.asarray(np.bincount(k, values, minlength=sectors), np.float64)
