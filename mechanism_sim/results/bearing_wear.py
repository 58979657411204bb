"""Measures of a bearing's wear, summed by direction on bushing and pin, and by parts of a run.

Archard's law: the volume worn off is in proportion to the integral of normal force times the way
slid (J. F. Archard, Contact and rubbing of flat surfaces, J. Appl. Phys. 24 (1953) 981). Where the
contact follows, the integrals run over the motion's polynomials; an impact adds its impulse times
the way slid in a unit of time, in the mean of before and after.
"""

from __future__ import annotations

import math

import numpy as np

from mechanism_sim.arrays import Array, IndexArray
from mechanism_sim.numerics.quadrature import SMOOTH
from mechanism_sim.planar.gaps import joint_of_gap
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.protocols import BearingGap
from mechanism_sim.results.run import Piece
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.joint_view import JointView

_BLOCK = 2048  # parts of segments at once
LOAD, LOAD_SLIP, WORK, IMPACT_SLIP, IMPACT_WORK = range(5)
"""Rows: integrals of normal force [N s], of it times slip speed [N m], of friction times slip
speed [J]; of impacts, sums of normal impulse times slip speed [N m], and of friction [J]."""


def wear_sums(
    machine: Machine, piece: Piece, joint: str, count: int, times: Array, radius: float,
    *, first: float = 0.0,
) -> Array:  # fmt: skip
    """Sums (2, 5, B, count) of bushing and pin, in parts of a run, at even places of the circle.

    Normal force, slip and direction are those at 8 Gauss nodes of every step, or of each part of
    one in which links turn by the distance of two places; a node counts at both places beside it,
    by how near they are. So the direction of a force is kept wherever it points, and the sum of a
    place is continuous in where nodes lie: of 72 places it holds to some 0.3 %, of 180 to 1.4 %
    where the contact goes round and the links do not; nodes that count where they lie err by
    several.

    Parameters
    ----------
    times : (B + 1,) limits of the parts [s]
    radius : radius of the pin [m]
    first : angle of the first direction [rad]
    """
    motion, physics, parts = piece.motion, machine.physics, len(times) - 1
    gap = physics.clearances.index(joint)
    sums = np.zeros((2, 5, parts * count))

    def enter(
        part: Array | IndexArray, places: tuple[Array, Array], rows: dict[int, Array]
    ) -> None:
        for own, angle in zip(sums, places, strict=True):
            for row, values in rows.items():
                own[row] += shared(angle, values, count, first, part, parts)

    slides = machine.mechanism.displacements
    angles = [i for i, c in enumerate(physics.coordinates) if c not in slides]
    start = motion.curve.start
    end = start + motion.curve.duration
    for part in range(parts):
        k = np.flatnonzero(motion.closed[:, gap] & (end > times[part]) & (start < times[part + 1]))
        low = np.maximum(times[part] - start[k], 0.0)
        high = np.minimum(times[part + 1] - start[k], motion.curve.duration[k])
        turned = np.abs(motion.curve.local(k, high) - motion.curve.local(k, low))[:, angles]
        cuts = np.ceil(turned.max(axis=1, initial=0.0) * count / (2.0 * math.pi))
        order = np.argsort(-cuts, kind='stable')  # those of a block are cut as the first of them
        while order.size:
            finer = max(1, int(cuts[order[0]]))
            block, order = np.split(order, [max(1, _BLOCK // finer)])
            fractions = (np.arange(finer)[:, None] + SMOOTH.places.fractions).ravel() / finer
            width = (high - low)[block, None]
            seen = physics.observe(motion, k[block], low[block, None] + width * fractions)
            weights = (width * np.tile(SMOOTH.weights, finer) / finer).ravel()
            places, slip, length = _touch(machine, joint, seen, radius)
            normal = length * seen.normal_force[gap]
            tangential = length * seen.friction_force[gap]
            rows = {
                LOAD: normal, LOAD_SLIP: normal * np.abs(slip), WORK: np.abs(tangential * slip),
            }  # fmt: skip
            enter(
                np.full(len(weights), part), places,
                {row: weights * values for row, values in rows.items()},
            )  # fmt: skip
    struck = piece.impacts.of_joint(joint)
    struck = struck.where((times[0] <= struck.column('t')) & (struck.column('t') < times[-1]))
    if struck and len(motion):
        fields = 't', 'normal_impulse', 'tangential_impulse'
        t, normal, tangential = map(struck.column, fields)
        begun = motion.curve.begun_by(t)
        before, after = np.maximum(begun - 1, 0), np.minimum(begun, len(motion) - 1)
        ended = np.where(begun, motion.curve.duration[before], 0.0)
        ends = (before, ended), (after, np.where(begun < len(motion), 0.0, ended))
        both = [_touch(machine, joint, physics.observe(motion, k, dt), radius) for k, dt in ends]
        way = 0.5 * (np.abs(both[0][1]) + np.abs(both[1][1]))
        normal, tangential = both[0][2] * normal, both[0][2] * tangential
        part_of = np.searchsorted(times, t, 'right') - 1
        enter(
            part_of, both[0][0], {IMPACT_SLIP: normal * way, IMPACT_WORK: np.abs(tangential) * way}
        )
    return sums.reshape(2, 5, parts, count)


def _touch(
    machine: Machine, joint: str, seen: Observation, radius: float
) -> tuple[tuple[Array, Array], Array, Array | float]:
    """Contact angles on bushing and pin (N,) [rad], slip (N,) [m/s], force over N.

    The slip is ``n x Q' + rp w1 - (rp + Q.n) w2``, Q from the bushing's centre to the pin's, n the
    normal.
    """
    pair = joint_of_gap(machine.mechanism, joint)
    gap = machine.equations.system.gaps[machine.physics.clearances.index(joint)]
    assert isinstance(gap, BearingGap)  # noqa: S101 - nothing else is asked for
    view = JointView(machine.mechanism, pair, machine.physics, seen, np.zeros((0, 0), np.uint8))
    (x, y), (vx, vy), _ = view.trace(gap.apart)
    (nx, ny), clearance, length = gap.touch(seen.position)
    first, second = view.turning(pair.first), view.turning(pair.second)
    slip = nx * vy - ny * vx + radius * first.velocity - (radius + clearance) * second.velocity
    on_bushing = np.arctan2(y + radius * ny, x + radius * nx)
    return (on_bushing - second.position, np.arctan2(ny, nx) - first.position), slip, length


def shared(
    angle: Array,
    values: Array,
    count: int,
    first: float,
    part: Array | IndexArray | int = 0,
    parts: int = 1,
) -> Array:
    """Sums (parts * count,) of values (N,) at evenly spaced directions from an angle on.

    Each value is shared by the two directions beside its angle (N,) [rad], linearly.
    """
    at = (angle - first) / (2.0 * np.pi) * count
    low = np.floor(at).astype(np.int64)
    pairs = (low, low + 1.0 - at), (low + 1, at - low)
    sums = (
        np.bincount(count * part + place % count, share * values, minlength=parts * count)
        for place, share in pairs
    )
    return np.asarray(sum(sums), np.float64)
