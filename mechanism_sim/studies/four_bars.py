"""Four-bars whose coupler takes positions (rigid-body guidance), or a point of it a path.

Two points of the body that stay on circles in all positions make a four-bar (Burmester; McCarthy
and Soh, Geometric Design of Linkages, 2nd ed. 2011, ch. 5). Such pairs of a point and a centre are
found by Gauss and Newton from many places at once: for five positions there are four of them at
most, for fewer they lie on curves, for more they are near to circles only. Every two of them are
a linkage. It is kept if its crank turns, so that it has one circuit; if it takes all positions on
one branch, and in their order. More than five positions are fitted by least squares from there.
"""

from __future__ import annotations

import math
from collections import Counter
from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mechanism_sim.arguments import public
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.linkages.four_bar import Branch, FourBar
from mechanism_sim.linkages.grashof import full_turns, transmission_range
from mechanism_sim.output import path_of
from mechanism_sim.results.path_distance import TargetPath, read_path
from mechanism_sim.studies.synthesis import (
    KEPT,
    PathFourBar,
    path_four_bars,
    unlike,
    worst_transmission,
)
from mechanism_sim.units import argument

_STARTS, _STEPS = 1 << 11, 40
_REACH = 8.0  # greatest distance of points and centres from the first position, in sizes of all
_SAME = 1e-5
_DYADS, _NEAR = 48, 10  # points that are combined, if exact and if near to circles only
_EXACT = 1e-9
_TURN = 2.0 * math.pi


@public
def find_four_bars(
    path: str | Path | TargetPath | ArrayLike, transmission: float | str = '20 deg'
) -> list[PathFourBar]:
    """Four-bars with a turning crank whose coupler takes points or positions, the best first.

    >>> import math, mechanism_sim as ms
    >>> turns = [2.0 * math.pi * k / 12 for k in range(12)]
    >>> oval = [(0.2 * math.cos(a), 0.1 * math.sin(a)) for a in turns]
    >>> ms.find_four_bars(oval)[0].rms < 1e-3
    True

    Parameters
    ----------
    path : a file with columns as ``x [mm]``, ``y [mm]``, and ``angle [deg]`` of the crank or
        ``orientation [deg]`` of the body whose positions they are; or x, y [m] and perhaps
        orientation [rad] of n points, (n, 2) or (n, 3)
    transmission : least angle between coupler and rocker

    Returns
    -------
    `PathFourBar.scene` makes a scene of one.
    """
    least = argument('transmission', transmission, 'rad')
    if isinstance(path, str | Path):
        path = read_path(path_of(path), 'path')
    elif not isinstance(path, TargetPath):
        try:
            points = np.asarray(path, dtype=float)
        except (TypeError, ValueError):
            points = np.zeros(0)
        if points.ndim != 2 or points.shape[1] not in (2, 3) or not np.isfinite(points).all():
            raise InputError('path: give points (n, 2) of x, y, or (n, 3) with an orientation')
        path = TargetPath(tuple(map(tuple, points.tolist())), '', ())
    if len(path.points[0]) == 3:
        return _guided(np.array(path.points), least)
    return path_four_bars(path, least)


class _Dyads(NamedTuple):
    """Points of the body and centres (D,), complex, with the pins (D, n) that they give."""

    point: Array
    centre: Array
    pins: Array


def _pins(z: Array, turned: Array, point: Array) -> Array:
    """Places (D, n) of points (D,) of the body in all positions."""
    return z + turned * point[:, None]


def _dyads(z: Array, turned: Array) -> _Dyads:
    """Points of the body that stay on a circle in all positions, of unit size."""
    cube = scipy.stats.qmc.Sobol(4, rng=np.random.default_rng(1)).random(_STARTS)
    x = _REACH / 2.0 * (2.0 * cube - 1.0)  # point and centre, each by x and y
    for _ in range(_STEPS):
        arm = _pins(z, turned, x[:, 0] + 1j * x[:, 1]) - (x[:, 2] + 1j * x[:, 3])[:, None]
        length = np.maximum(np.abs(arm), 1e-12)
        unit = arm / length
        along = unit.conj() * turned
        slopes = np.stack([along.real, -along.imag, -unit.real, -unit.imag], axis=-1)
        slopes = slopes - slopes.mean(axis=1, keepdims=True)
        off = length - length.mean(axis=1, keepdims=True)
        squares = np.einsum('dni,dnj->dij', slopes, slopes) + 1e-10 * np.eye(4)
        step = np.linalg.solve(squares, np.einsum('dni,dn->di', slopes, off)[..., None])[..., 0]
        x = x - step * np.minimum(1.0, 1.0 / np.maximum(np.abs(step).max(axis=1), 1e-9))[:, None]
    point, centre = x[:, 0] + 1j * x[:, 1], x[:, 2] + 1j * x[:, 3]
    pins = _pins(z, turned, point)
    length = np.abs(pins - centre[:, None])
    left = length.std(axis=1)
    near = (np.abs(x).max(axis=1) < _REACH) & (length.min(axis=1) > 1e-3) & np.isfinite(left)
    if len(z) <= 5:
        near &= left < _EXACT
    order = np.flatnonzero(near)
    order = order[np.argsort(left[order], kind='stable')] if len(z) > 5 else order
    kept: list[int] = []
    for k in order:
        if all(np.abs(x[k] - x[i]).max() > _SAME ** (1.0 if len(z) > 4 else 0.1) for i in kept):
            kept.append(int(k))
        if len(kept) == (_DYADS if len(z) <= 5 else _NEAR):
            break
    return _Dyads(point[kept], centre[kept], pins[kept])


def _guided(poses: Array, transmission: float) -> list[PathFourBar]:
    """Four-bars whose coupler takes positions (n, 3) of a body: x, y and orientation."""
    if len(poses) < 3:
        raise InputError('positions of a body: there must be at least 3 of them')
    z, orientation = poses[:, 0] + 1j * poses[:, 1], poses[:, 2]
    middle = z.mean()
    size = math.sqrt(float((np.abs(z - middle) ** 2).mean()))
    if not size:
        raise InputError('positions of a body: a turn about one point needs no four-bar')
    task = _Task((z - middle) / size, orientation, size, middle)
    dyads = _dyads(task.z, np.exp(1j * orientation))
    refused: Counter[str] = Counter()
    found: list[PathFourBar] = []
    for a, b in permutations(range(len(dyads.point)), 2):
        lengths = _lengths(dyads.centre[[a, b]], dyads.pins[[a, b]])
        why = _defect(lengths, dyads.pins[[a, b]], dyads.centre[[a, b]], transmission)
        if why:
            refused[why] += 1
            continue
        places = np.array([dyads.point[a], dyads.point[b], dyads.centre[a], dyads.centre[b]])
        if (one := task.placed(places, lengths, transmission)) is not None:
            found.append(one)
        else:
            refused['are wrong after the fit'] += 1
    if not found:
        reasons = ', '.join(f'{n} {why}' for why, n in refused.most_common())
        raise InputError(
            f'no four-bar with a turning crank takes these positions: {len(dyads.point)} points '
            f'stay on circles; of {sum(refused.values())} linkages {reasons or "none is left"}'
        )
    return unlike(sorted(found, key=lambda one: one.worth(size)))[:KEPT]


def _lengths(centres: Array, pins: Array) -> Array:
    """Lengths of ground, crank, coupler and rocker, as means over the positions."""
    arms = np.abs(pins - centres[:, None]).mean(axis=1)
    return np.array([
        abs(centres[1] - centres[0]), arms[0], np.abs(pins[1] - pins[0]).mean(), arms[1],
    ])  # fmt: skip


def _side(pins: Array, centre: complex) -> Array:
    """Sines (n,) of the angle from the coupler to the rocker, whose sign is the branch."""
    return np.asarray(((pins[1] - pins[0]).conj() * (centre - pins[1])).imag)


def _defect(lengths: Array, pins: Array, centres: Array, transmission: float) -> str:
    """Defect of a four-bar: of circuit, branch, order or transmission; empty if none."""
    if lengths.min() < 1e-3 * lengths.max() or not full_turns(lengths)[0]:
        return 'have no turning crank'
    if abs(np.sign(_side(pins, centres[1])).sum()) < pins.shape[1]:
        return 'change their branch between positions'
    steps = np.mod(np.diff(np.angle(pins[0] - centres[0])), _TURN)
    if min(steps.sum(), (_TURN - steps).sum()) >= _TURN:
        return 'take them in another order'
    if worst_transmission(transmission_range(FourBar(*lengths.tolist()))) < transmission:
        return 'have too small a transmission angle'
    return ''


class _Task(NamedTuple):
    """Positions of unit size about their middle, and both in the world."""

    z: Array
    orientation: Array
    size: float
    middle: complex

    def linkage(self, places: Array, lengths: Array) -> tuple[FourBar, float]:
        """The four-bar, and the angle of its ground."""
        pins = _pins(self.z, np.exp(1j * self.orientation), places[:2])
        ground, crank, coupler, rocker = lengths.tolist()
        branch: Branch = 'open' if _side(pins, places[3])[0] < 0.0 else 'crossed'
        four = FourBar(ground, crank, coupler, rocker, branch)
        return four, float(np.angle(places[3] - places[2]))

    def off(
        self, four: FourBar, turned: float, places: Array, angles: Array
    ) -> tuple[Array, Array]:
        """Distances (n,), complex, and turns (n,) of the body from its positions."""
        coupler = four.positions(angles - turned)[0] + turned
        body = coupler - np.angle(places[1] - places[0])
        at = places[2] + four.crank * np.exp(1j * angles) - places[0] * np.exp(1j * body)
        return at - self.z, np.angle(np.exp(1j * (body - self.orientation)))

    def fitted(self, places: Array, lengths: Array, angles: Array) -> tuple[Array, Array, Array]:
        """Places, lengths and crank angles that miss the positions least."""
        four, _ = self.linkage(places, lengths)
        count = len(angles)

        def read(x: Array) -> tuple[FourBar, float, Array, Array]:
            where = x[:4] + 1j * x[4:8]
            own = (abs(where[3] - where[2]), x[8], abs(where[1] - where[0]), x[9])
            return FourBar(*own, four.branch), float(np.angle(where[3] - where[2])), where, x[10:]

        def rest(x: Array) -> Array:
            off, turns = self.off(*read(x))
            both = np.concatenate([off.real, off.imag, turns])
            return np.asarray(np.nan_to_num(both, nan=10.0))

        start = np.concatenate([places.real, places.imag, lengths[[1, 3]], angles])
        if 3 * count < len(start):
            return places, lengths, angles
        x = scipy.optimize.least_squares(rest, start, method='lm', max_nfev=200 * len(start)).x
        best, _, where, turned = read(x)
        return where, np.array(best.lengths), turned

    def placed(self, places: Array, lengths: Array, transmission: float) -> PathFourBar | None:
        """A solution in the world; none if the fit has lost what was right."""
        angles = np.angle(_pins(self.z, np.exp(1j * self.orientation), places[:1])[0] - places[2])
        if len(self.z) > 5:
            places, lengths, angles = self.fitted(places, lengths, angles)
            pins = _pins(self.z, np.exp(1j * self.orientation), places[:2])
            if _defect(lengths, pins, places[2:], transmission):
                return None
        four, turned = self.linkage(places, lengths)
        off, turns = self.off(four, turned, places, angles)
        if not np.isfinite(off).all():
            return None
        bar = places[1] - places[0]
        point = (
            -places[0] / bar * abs(bar) * self.size
        )  # the origin of the body, from the crank pin
        pivot = complex(self.middle + self.size * places[2])
        distance = self.size * np.abs(off)
        steps = np.mod(np.diff(angles), _TURN)
        angle = transmission_range(FourBar(*four.lengths))
        sizes = (self.size * np.array(four.lengths)).tolist()
        return PathFourBar(
            tuple(sizes), four.branch, (pivot.real, pivot.imag), turned,
            (float(point.real), float(point.imag)), float(angles[0]),
            bool(steps.sum() < (_TURN - steps).sum()),
            float(np.sqrt((distance**2).mean())), float(distance.max()),
            (angle.least, angle.greatest), float(-np.angle(bar)),
            float(np.abs(turns).max()),
        )  # fmt: skip
