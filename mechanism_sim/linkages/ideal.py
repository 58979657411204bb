"""The motion of an ideal linkage whose drives are known: in closed form, or by Newton's method."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from mechanism_sim.arrays import Array, IndexArray, Mask
from mechanism_sim.errors import RunError
from mechanism_sim.linkages.four_bar import FourBarLoop
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar import branch
from mechanism_sim.planar.branch import SAMPLES, Branch, crossing, determinants, limits
from mechanism_sim.planar.inverse_dynamics import Observation, power
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.switched_functions import Edges
from mechanism_sim.tolerances import TOLERANCES

_SHORTER = 4  # halvings of the time in which forces are compared beside a singular position
_BRANCHES = TOLERANCES.branches


_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Passage:
    """Instants near a singular position, and the branch of the motion there."""

    kinematics: Kinematics
    index: IndexArray  #: (K,) indices of the instants
    branch: Branch  #: (K,) branches through their positions, where known
    #: (K,) rate and acceleration of the branch's parameter
    pace: Array
    bend: Array

    def __getitem__(self, chosen: IndexArray) -> Passage:
        return replace(
            self, index=self.index[chosen], branch=self.branch[chosen],
            pace=self.pace[chosen], bend=self.bend[chosen],
        )  # fmt: skip

    @property
    def independence(self) -> Array:
        """Independence of the constraints at the instants (K,)."""
        return self.kinematics.independence(self.branch.middle)

    @property
    def duration(self) -> Array:
        """Time (K,) [s] to either side in which the branch is known."""
        return self.branch.width / np.maximum(np.abs(self.pace), 1e-300)

    @property
    def root(self) -> Array:
        """Offset of the branch's parameter (K,) to the singular position."""
        return crossing(self.kinematics, self.branch)

    def states(self, times: Array, driven: Array) -> tuple[Array, Array, Array]:
        """Coordinates, rates and accelerations (n, K S) at S times beside each instant.

        Parameters
        ----------
        times : (K, S) [s] from the instants on
        driven : (3, p, K, S) driven coordinates at these times, their rates and accelerations
        """
        shift, pace, bend = times, np.ones_like(times), np.zeros_like(times)
        held = self.kinematics.held
        if len(held) == 1:
            first = self.branch.at(np.zeros_like(times[:, :1]))[0][held[0]]
            shift, pace, bend = driven[0, 0] - first, driven[1, 0], driven[2, 0]
        q, slope, curvature = self.branch.at(shift)
        v, a = slope * pace, curvature * pace**2 + slope * bend
        n = len(q)
        return q.reshape(n, -1), v.reshape(n, -1), a.reshape(n, -1)


def with_limits(
    seen: Observation,
    sampled: Callable[[Passage, IndexArray, float], Observation] | None,
    required: Array,
    passage: Passage,
) -> Observation:
    """An observation with the limits of forces, along their branches, near singular positions.

    Forces without a limit are NaN, and so are those where no branch is known.

    Parameters
    ----------
    sampled : the machine at `SAMPLES` beside some (M,) of the instants, in a share of the width;
        without it only the torque of a single drive is exact
    required : (n, K) generalised forces of closures and drives together
    """
    count = len(passage.index)
    found = np.full((len(_stacked(seen)), count), np.inf)
    left, share = np.flatnonzero(passage.branch.found), 1.0
    for _ in range(_SHORTER):
        if sampled is None or not left.size:
            break
        around = sampled(passage[left], left, share)
        shape = len(left), len(SAMPLES)
        independence = passage.kinematics.independence(around.position).reshape(shape)
        determinant = determinants(passage.kinematics, around.position)
        found[:, left] = limits(_stacked(around).reshape(-1, *shape), determinant, independence)
        left = left[np.isinf(found[:, left]).any(axis=0)]
        share *= 0.5
    # where nothing smooth is found a solve must do, but not at the position itself
    beside = passage.branch.found & (passage.independence > _BRANCHES.singular)
    solved = np.where(beside, _stacked(seen)[:, passage.index], np.nan)
    found = np.where(np.isinf(found), solved, found)
    joints, held = len(seen.reaction), passage.kinematics.held
    force, moment, torque, load = np.split(found, [2 * joints, 3 * joints, 3 * joints + len(held)])
    if len(held) == 1 and not len(load):  # closures do no work along the branch
        _, slope, _ = passage.branch.at(np.zeros((count, 1)))
        torque = (slope[:, :, 0] * required).sum(axis=0)[None]
        torque[:, ~passage.branch.found] = np.nan
    seen.reaction[:, :, passage.index] = force.reshape(joints, 2, -1)
    seen.reaction_moment[:, passage.index] = moment
    seen.drive_torque[:, passage.index] = torque
    seen.load[:, passage.index] = load
    return seen._replace(drive_power=power(seen.drive_torque, seen.velocity[held]))


def _stacked(seen: Observation) -> Array:
    """Forces, moments, torques and unknown loads in rows."""
    rows = seen.reaction.reshape(-1, seen.reaction.shape[-1])
    return np.concatenate([rows, seen.reaction_moment, seen.drive_torque, seen.load])


class FourBarMotion:
    """Motion of a four-bar in closed form, with the interface of `LinkageMotion`."""

    sliding: list[int] = []  # noqa: RUF012 - a list, because it is an index
    edges = None

    def __init__(self, loop: FourBarLoop, coordinates: Sequence[str]) -> None:
        self.loop = loop
        self.coordinates = tuple(coordinates)
        self._links = [self.coordinates.index(link) for link in loop.links]
        self.driven = self._links[:1]
        self.turning = _turning(len(self.coordinates), self.driven)

    def follow(
        self, last: Array, times: Array, driven: Array, now: Array, slope: Array | None
    ) -> tuple[Array, Array | None]:
        """Coordinates (3, N) a little later, by whole turns next to those before."""
        _, coupler, rocker = self._links
        q = np.empty((3, len(times)))
        q[self.driven] = driven
        q[coupler], q[rocker] = self.loop.positions(driven[0])
        joined = np.unwrap(np.column_stack([last, q]), axis=1)[:, 1:]
        joined[self.driven] = driven
        return joined, None

    def follow_apart(self, last: Array, driven: Array) -> Array | None:
        """Solve each instant by itself, as `follow` does with the closed form."""
        return self.follow(last, driven[0], driven, driven, None)[0]

    def branches_meet(self, q: Array) -> Mask:
        """False (N,): change points are not for closed forms."""
        return np.zeros(q.shape[1], dtype=bool)

    def motion(
        self,
        near: Array,
        v: Array,
        a: Array,
        along: tuple[Array, Array] | None = None,
        rows: Array | None = None,
    ) -> tuple[Array, Array, Array, Passage | None]:
        """Coordinates, rates and accelerations, by whole turns next to others (n, N)."""
        found = np.empty((3, *near.shape))
        found[:, self._links] = self.loop.motion(near[self._links[0]], v[0], a[0])
        q, rates, accelerations = found
        turns = np.round((near - q) / TWO_PI)
        turns[self.driven] = 0.0
        if along is not None:
            _, th3, th4 = self._angles(q)
            limit = np.abs(np.sin(th3 - th4)) < _BRANCHES.limit
            rates = np.where(limit, along[0], rates)
            accelerations = np.where(limit, along[1], accelerations)
        return q + TWO_PI * turns, rates, accelerations, None

    def rates(self, q: Array, v: Array) -> Array:
        """Rates (n, N) at coordinates (n, N) from that of the crank (1, N)."""
        found = np.empty_like(q)
        found[self._links] = self.loop.motion(q[self._links[0]], v[0], np.zeros_like(v[0]))[1]
        return found

    def _angles(self, q: Array) -> Array:
        """Angles of crank, coupler and rocker (3, N), from the line of the ground joints [rad]."""
        return np.asarray(q[self._links] + np.array(self.loop.turned)[:, None])

    def rounding(self, q: Array) -> float:
        """Residual of rounding, by the angle between coupler and rocker."""
        _, th3, th4 = self._angles(q)
        return _rounding(np.abs(np.sin(th3 - th4)))

    def left_open(self, q: Array) -> float:
        """Largest distance of the coupler's end from the rocker's [m]."""
        th2, th3, th4 = self._angles(q)
        l = self.loop.linkage  # noqa: E741 - the lengths
        x = l.crank * np.cos(th2) + l.coupler * np.cos(th3) - l.rocker * np.cos(th4) - l.ground
        y = l.crank * np.sin(th2) + l.coupler * np.sin(th3) - l.rocker * np.sin(th4)
        return float(np.hypot(x, y).max(initial=0.0))


class LinkageMotion:
    """Positions, rates and accelerations of all n coordinates from those of p driven ones.

    Of any linkage, by Newton's method on its closures.

    Attributes
    ----------
    driven, sliding : indices of the driven coordinates, and of displacements
    turning : (n,) mask of dependent angles, whose whole turns are taken off
    """

    def __init__(self, kinematics: Kinematics) -> None:
        self.kinematics = kinematics
        self.coordinates = kinematics.coordinates
        self.driven = kinematics.held
        names = kinematics.mechanism.displacements
        self.sliding = [i for i, c in enumerate(self.coordinates) if c in names]
        self.turning = _turning(len(self.coordinates), [*self.driven, *self.sliding])

    @property
    def edges(self) -> Edges | None:
        """Finder of the changes of closures along a motion; None without changes."""
        return self.kinematics.edges

    def follow(
        self, last: Array, times: Array, driven: Array, now: Array, slope: Array | None
    ) -> tuple[Array, Array | None]:
        """Coordinates (n, N) a little later: from a prediction, or on the branch of the last.

        Parameters
        ----------
        last : (n,)
        times : (N,) times [s] since then
        driven : (p, N) driven coordinates at these times
        now : (3, p) driven coordinates, their rates and accelerations at `last`
        slope : (n,) direction at `last` from an earlier call

        Returns
        -------
        q (n, N), and near a singular position the direction (n,) of the branch at the last one.

        Raises
        ------
        RunError
            If the loops cannot be closed, or the last position is singular and no slope is given.
        """
        try:
            # coordinates (n, N) that close the loops, from where the last ones (n,) point
            q, failed = self._closed(self._pointed(last, driven)), None
            seen = np.column_stack([last, q])
        except RunError as error:
            q, failed, seen = last[:, None], error, last[:, None]
        if not self.branches_meet(seen).any():
            if failed:
                raise failed
            return q, None
        drive = self._parameter(now[:, :, None])[0]
        shift = times if len(now[0]) > 1 else driven[0] - now[0]
        if slope is None and self.kinematics.independence(last[:, None])[0] > _BRANCHES.singular:
            slope = self.kinematics.rates(last[:, None], drive[1])[:, 0]
            stays = not failed and self._stays(seen)
            if stays and self._continues(last, q, slope * shift[0]):
                return q, None
        if slope is not None:
            reach = np.abs(shift).max(keepdims=True)
            found = branch.follow(self.kinematics, last[:, None], slope[:, None], drive, reach)
            place, rates, _ = (x[:, 0] for x in found.at(shift[None]))
            place[self.driven] = driven
            open_by = self.kinematics.open_beyond_rounding(place, _BRANCHES.open)
            if found.found[0] and not open_by.any():
                return place, rates[:, -1]
        ends = self.kinematics.independence(q[:, -1:])[0] > _BRANCHES.singular
        known = slope is not None and ends and self._continues(last, q, slope * shift[0])
        if failed or not known:
            raise failed or RunError(
                f'the mechanism reaches a singular position at {self._positions_text(now[0])}, '
                'and the branch of its further motion is not determined'
            )
        return q, None

    def branches_meet(self, q: Array) -> Mask:
        """True if positions (n, N) are nearly singular, as where two branches meet.

        At a limit of the drive all closures together are independent: the motion turns back there,
        and no curve over the drive leads through.
        """
        near = self.kinematics.nearly_singular(q, _BRANCHES.near)
        if near.any():
            every = self.kinematics.released()
            near[near] = every.independence(q[:, near]) < _BRANCHES.near
        return near

    def follow_apart(self, last: Array, driven: Array) -> Array | None:
        """Coordinates (n, N) a little later, each found apart from the others.

        None near a singular position, or if the loops cannot be closed: see `follow`.
        """
        q, left = self.kinematics.positions(self._pointed(last, driven), apart=True)
        seen = np.column_stack([last, q])
        near = self.kinematics.nearly_singular(seen, _BRANCHES.near)
        return None if left.any() or near.any() else q

    def _stays(self, q: Array) -> bool:
        """True if positions (n, N) come neither nearer to a singular one nor farther by an octave.

        A branch is looked for once in each: beside positions that are only nearly singular there
        is none, however many pieces the motion has there.
        """
        octave = np.floor(np.log2(np.maximum(self.kinematics.independence(q), _BRANCHES.singular)))
        return bool((octave == octave[0]).all())

    def _continues(self, last: Array, q: Array, way: Array) -> bool:
        """True if the first of positions (n, N) lies in the direction of the last one's motion.

        Newton's method may find another branch than that on which it came.
        """
        scale = self.kinematics.scale
        off = np.linalg.norm((q[:, 0] - last - way) / scale)
        return bool(off <= 0.5 * np.linalg.norm(way / scale) + 1e-9)

    def _pointed(self, last: Array, driven: Array) -> Array:
        """First-order prediction of the coordinates (n, N) from the last ones (n,)."""
        shift = driven - last[self.driven, None]
        slopes = self.kinematics.rates(
            np.repeat(last[:, None], len(self.driven), axis=1), np.eye(len(self.driven))
        )
        near = last[:, None] + np.nan_to_num(slopes) @ shift
        near[self.driven] = driven
        return near

    def _parameter(self, driven: Array) -> tuple[Array, Array, Array]:
        """Branches are followed along it: the driven coordinate; time, if there are several.

        Parameters
        ----------
        driven : (3, p, N) the driven coordinates, their rates and accelerations

        Returns
        -------
        The same (3, p, N) by the parameter, and its own rate and acceleration (N,).
        """
        if len(self.driven) > 1:
            return driven, np.ones(driven.shape[2]), np.zeros(driven.shape[2])
        still = np.zeros_like(driven[0])
        return np.array([driven[0], still + 1.0, still]), driven[1, 0], driven[2, 0]

    def _closed(self, near: Array) -> Array:
        """Coordinates (n, N) that close all loops, near others."""
        q, left = self.kinematics.positions(near)
        if left.any():
            k = int(np.argmax(left))
            driven = self._positions_text(near[self.driven, k])
            off = np.abs(self.kinematics.closure(q[:, k : k + 1])[0][0])
            joint = self.kinematics.rows[int(np.argmax(off))]
            raise RunError(
                f'the mechanism cannot follow its drive to {driven}: the loop stays open by '
                f'{left[k]:.3g} m at {joint}; it may be at a dead point'
            )
        return q

    def _positions_text(self, driven: Array) -> str:
        """Text of the driven coordinates (p,) for messages."""
        return ', '.join(
            f'{self.coordinates[i]} = {x:.6g} m' if i in self.sliding
            else f'{self.coordinates[i]} = {np.degrees(x):.6g} deg'
            for i, x in zip(self.driven, driven, strict=True)
        )  # fmt: skip

    def motion(
        self,
        near: Array,
        v: Array,
        a: Array,
        along: tuple[Array, Array] | None = None,
        rows: Array | None = None,
    ) -> tuple[Array, Array, Array, Passage | None]:
        """Coordinates, rates and accelerations (n, N), by Newton's method or on their branch.

        Parameters
        ----------
        near : (n, N) coordinates
        v, a : (p, N) rates and accelerations of the driven coordinates
        along : rates and accelerations (n, N) of all, near enough to tell branches apart where
            the position is singular
        rows : (k, N) values of the switches; by default those at these positions
        """
        kinematics, passage = self.kinematics, None
        q, rates, accelerations = near.copy(), np.empty_like(near), np.empty_like(near)
        rest = np.ones(near.shape[1], dtype=bool)
        near_singular = self.branches_meet(near)
        if along is not None and near_singular.any():
            index = np.flatnonzero(near_singular)
            drive, pace, bend = self._parameter(
                np.array([near[self.driven][:, index], v[:, index], a[:, index]])
            )
            slope = _slope(along[0][:, index], along[1][:, index], pace, bend)
            found = branch.follow(kinematics, near[:, index], slope, drive)
            # where no branch is known, and none is needed: at rest
            lost = kinematics.independence(near[:, index]) < _BRANCHES.singular
            kept = found.found | lost
            index, found, pace, bend = index[kept], found[kept], pace[kept], bend[kept]
            if index.size:
                place, first, second = (x[:, :, 0] for x in found.at(np.zeros((len(index), 1))))
                exact = place, first * pace, second * pace**2 + first * bend
                fitted = near[:, index], along[0][:, index], along[1][:, index]
                for into, x, y in zip((q, rates, accelerations), exact, fitted, strict=True):
                    into[:, index] = np.where(found.found, x, y)
                rest[index] = False
                passage = Passage(kinematics, index, found, pace, bend)
        if rest.any():
            q[:, rest] = self._closed(near[:, rest])
            held = None if rows is None else rows[:, rest]
            rates[:, rest] = kinematics.rates(q[:, rest], v[:, rest], held)
            accelerations[:, rest] = kinematics.accelerations(
                q[:, rest], rates[:, rest], a[:, rest], held
            )
        if (
            along is not None
            and (limit := ~near_singular & kinematics.nearly_singular(near, _BRANCHES.limit)).any()
        ):
            rates[:, limit], accelerations[:, limit] = (x[:, limit] for x in along)
        return q, rates, accelerations, passage

    def rates(self, q: Array, v: Array) -> Array:
        """Rates (n, N) at closed coordinates (n, N) from those of the driven ones (p, N)."""
        return self.kinematics.rates(q, v)

    def rounding(self, q: Array) -> float:
        """Rounding error of the coordinates (n, N) [rad, or parts of the mechanism's size]."""
        return _rounding(self.kinematics.independence(q))

    def left_open(self, q: Array) -> float:
        """Largest distance from zero of a closure [m]."""
        return float(np.abs(self.kinematics.closure(q)[0]).max(initial=0.0))


def _turning(count: int, others: Sequence[int]) -> Mask:
    """Mask of all of `count` coordinates but some."""
    turning = np.ones(count, dtype=bool)
    turning[list(others)] = False
    return turning


IdealMotion: TypeAlias = FourBarMotion | LinkageMotion


def _rounding(independence: Array) -> float:
    """Rounding error of coordinates from constraints: rounding over their independence (N,)."""
    return _EPS / max(float(independence.min(initial=1.0)), _BRANCHES.singular)


def _slope(rates: Array, accelerations: Array, pace: Array, bend: Array) -> Array:
    """Derivatives (n, N) by a parameter from those by time, also where it turns round."""
    moving = pace**2 >= 1e-8 * np.abs(bend)
    with np.errstate(divide='ignore', invalid='ignore'):
        return np.where(moving, rates / pace, accelerations / bend)
