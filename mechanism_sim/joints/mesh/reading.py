"""Readings of gears in mesh, and of other means of transmission."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.joints.mesh.placement import PlacedMesh
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.points import Vector2
from mechanism_sim.planar.view import PairView, Told


class MeshMode(IntEnum):
    """Flanks that carry load, with the numbers of GearState.msg."""

    UNKNOWN = 0
    LEFT = 1
    RIGHT = 2
    FREE = 3
    MESHED = 4


class GearReading(NamedTuple):
    """Two gears at N instants; forces are NaN where masses are not known.

    Positions and torques are those of the links; of a rack displacement and force. The error is
    how far the first is ahead.
    """

    first_position: Annotated[Array, Told('rad or m', 'angle of {first}', 'first', repeats=True)]
    first_velocity: Annotated[
        Array, Told('rad/s or m/s', 'speed of {first}', 'first', repeats=True)
    ]
    second_position: Annotated[Array, Told('rad or m', 'angle of {second}', repeats=True)]
    second_velocity: Annotated[Array, Told('rad/s or m/s', 'speed of {second}', repeats=True)]
    transmission_error: Annotated[Array, Told('m', 'transmission error', difference=True)]
    tooth_force: Annotated[Array, Told('N', 'force normal to the teeth')]
    tangential_force: Annotated[Array, Told('N', 'force on {second} along the pitch line')]
    radial_force: Annotated[Array, Told('N', 'force that parts the gears')]
    axial_force: Annotated[Array, Told('N', 'axial force of the teeth')]
    first_torque: Annotated[Array, Told('N m or N', 'torque on {first}', 'first')]
    second_torque: Annotated[Array, Told('N m or N', 'torque on {second}')]
    mesh_frequency: Annotated[Array, Told('Hz', 'mesh frequency')]
    mode: NDArray[np.uint8]  #: (N,) values of `MeshMode`


def read_mesh(joint: PlacedMesh, view: PairView) -> GearReading:
    """Teeth in mesh: ideal, with backlash or elastic."""
    sides = joint.points
    (first, rate), (second, _) = (_place(joint, view, *side) for side in sides)
    u = joint.waves[0] * first + joint.waves[1] * second
    ahead = np.remainder(u - joint.phase + math.pi, 2.0 * math.pi) - math.pi
    towards = view.turning(joint.carrier).position + joint.towards
    (x, y), (fx, fy) = (np.cos(towards), np.sin(towards)), view.force
    tangential = x * fy - y * fx
    force = _Force(
        tangential,
        joint.sign * (x * fx + y * fy),
        np.abs(tangential) * math.tan(joint.helix_angle),
    )
    efforts = [view.moment_on_first(view.place(joint.first, joint.on_first)), view.moment]
    if joint.guide is not None:
        way = view.turning(joint.carrier).position + joint.guide.axis
        efforts[1] = fx * np.cos(way) + fy * np.sin(way)
    # errors and stiffness that change with an angle add couples to the force along the row
    along = -joint.sign * tangential / math.cos(joint.pressure_angle)  # see `MeshClosure.wrench`
    offset = joint.per_phase * ahead
    for harmonic in joint.errors:
        error, slope = harmonic.at((first, second))
        offset = offset + error
        efforts[harmonic.member] = efforts[harmonic.member] + along * slope
    if joint.elasticity is not None:
        turned = joint.waves[0] * first
        change = joint.waves[0] * joint.elasticity.energy_slope(turned, offset, joint.play)
        efforts[0] = efforts[0] - change
    passing = np.abs(joint.waves[0] * rate) / (2.0 * math.pi)
    flanks = _flanks(joint, view, tangential)
    torques = efforts[0], efforts[1]
    return _reading(joint, view, joint.per_phase * ahead, force, torques, passing, flanks)


def read_ratio(joint: HigherPair, efforts: tuple[Array, Array], view: PairView) -> GearReading:
    """A ratio without teeth, of which the efforts on both (N,) [N m, N] are known."""
    unknown = np.full(view.count, np.nan)
    mode = _walls(view)
    if mode is None:
        mode = np.full(view.count, MeshMode.MESHED, np.uint8)
    none = _Force(unknown, unknown, unknown)
    return _reading(joint, view, unknown, none, efforts, unknown, mode)


class _Force(NamedTuple):
    """Components of the force between teeth (N,) [N]."""

    tangential: Array
    radial: Array
    axial: Array


def _reading(
    joint: HigherPair,
    view: PairView,
    error: Array,
    force: _Force,
    efforts: tuple[Array, Array],
    passing: Array,
    mode: NDArray[np.uint8],
) -> GearReading:
    first = view.trajectory(joint.first, joint.on_first)
    second = view.trajectory(joint.second, joint.on_second)
    total = np.sqrt(force.tangential**2 + force.radial**2 + force.axial**2)
    return GearReading(
        first.total, first.velocity, second.total, second.velocity,
        error, total, *force, *efforts, passing, mode,
    )  # fmt: skip


def _place(joint: PlacedMesh, view: PairView, link: str, at: Vector2) -> tuple[Array, Array]:
    """Angle [rad] of a gear against the carrier, or displacement [m] of a rack; and its rate."""
    carrier, guide = view.turning(joint.carrier), joint.guide
    if guide is None or guide.second != link:
        turn = view.turning(link, at)
        return turn.position - carrier.position, turn.velocity - carrier.velocity
    way = carrier.position + guide.axis
    c, s = np.cos(way), np.sin(way)
    arm = view.path(link, guide.on_second) - view.path(guide.first, guide.on_first)
    place, rate = (c * x + s * y for x, y in arm[:2])
    across = c * arm[0, 1] - s * arm[0, 0]
    return place, rate + carrier.velocity * across


def _flanks(joint: PlacedMesh, view: PairView, tangential: Array) -> NDArray[np.uint8]:
    """Flanks that carry load: by the walls of rigid teeth, by the force of elastic ones."""
    if (found := _walls(view)) is not None:
        return found
    if joint.elasticity is None:
        return np.full(len(tangential), MeshMode.MESHED, np.uint8)
    row = -joint.sign * tangential
    return _one_of(row < 0.0, row > 0.0)


def _walls(view: PairView) -> NDArray[np.uint8] | None:
    """Stops of teeth or dogs that carry load; None without stops."""
    left, right = view.gap('left'), view.gap('right')
    return _one_of(left[1], right[1]) if left and right else None


def _one_of(left: Mask, right: Mask) -> NDArray[np.uint8]:
    mode = np.full(len(left), MeshMode.FREE, np.uint8)
    mode[left], mode[right] = MeshMode.LEFT, MeshMode.RIGHT
    return mode
