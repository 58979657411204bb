"""Cams as wholes: flaws of their profiles, and how small they may be ([V] 4.5, 4.6)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.errors import InputError
from mechanism_sim.joints.cam.followers import Follower, Oscillating, Translating
from mechanism_sim.joints.cam.laws import Jump, Law, check_smoothness, spelled
from mechanism_sim.joints.cam.touch import CamTouch
from mechanism_sim.numerics.extremes import ExtremeSearch

#: points of a piece of a law at which an extreme is looked for first
SAMPLES = 181
_SAME = 1e-9  # [m] between points that are one; both limits at a break are drawn if they differ
_BLURRED = 4.0  # times the rounding of values: what is as high as the greatest
_HALVED = 50  # times, from a piece of a law down to rounding
_WIDER = 1.25  # factor between base radii that are looked at, up to 750 times as large or small
_SEARCHED = 30
_ANY = 'any base radius keeps the pressure angle within its limit'


@dataclass(frozen=True)
class Cam:
    """A disk cam, or a reciprocating one if its law is that of one.

    Parameters
    ----------
    law : law of the follower
    follower : follower in contact with the cam
    base_radius : the least distance of the profile from the camshaft, on the base circle, or from
        the line that takes its place [m]
    law_on : law of the same shape on another base circle [m]; None if it is the same
    """

    law: Law
    follower: Follower
    base_radius: float
    law_on: Callable[[float], Law] | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not 0 < self.base_radius < math.inf:
            raise InputError('a base radius is positive')
        self.at(drawing_angles(self.law, extent(self.law) / 360))

    def at(self, angle: ArrayLike) -> CamTouch:
        """Contact at cam angles (N,) [rad] or displacements [m]."""
        return self.follower.touch(self.law, self.base_radius, angle)

    @cached_property
    def corners(self) -> list[Jump]:
        """Jumps of the follower's velocity, which no finite force can produce."""
        return [jump for jump in check_smoothness(self.law, 1) if jump.order == 1]

    @property
    def largest_pressure_angle(self) -> float:
        """The largest absolute value over a turn [rad]."""
        return greatest(self.law, lambda x: np.abs(self.at(x).pressure_angle))[1]

    def smallest_base_radius(self, pressure_angle: float) -> float:
        """The smallest base radius [m] that keeps the pressure angle within a limit [rad].

        Where the law depends on it, the one nearest to that of the cam at which the limit is just
        kept.
        """
        if self.law_on is None:
            return smallest_base_radius(self.law, self.follower, pressure_angle)
        return _smallest_of_shape(self, self.law_on, pressure_angle)

    def groove(self, angle: ArrayLike, clearance: float = 0.0) -> tuple[Array, Array]:
        """Inner and outer wall, (2, N) [m], of a groove in which the roller has this clearance."""
        touch, half = self.at(angle), _roller(self.follower) + 0.5 * clearance
        return touch.pitch - half * touch.normal, touch.pitch + half * touch.normal


@dataclass(frozen=True)
class Flaw:
    """A part of a profile that the follower cannot follow.

    Parameters
    ----------
    kind : 'cusp' where the radius of curvature just falls to zero
    wall : side of the roller or face; only grooves have an outer wall
    start, end : cam angles between which the profile is cut away, to the distance of samples [rad]
    worst : cam angle of the worst point [rad]
    reciprocating : True if the cam slides; all three are then in metres
    """

    kind: Literal['undercut', 'cusp']
    wall: Literal['inner', 'outer']
    start: float
    end: float
    worst: float
    reciprocating: bool = False

    def __str__(self) -> str:
        worst = spelled(self.worst, reciprocating=self.reciprocating)
        if self.kind == 'cusp':
            return f'the {self.wall} profile has a cusp at {worst}'
        ends = spelled(self.start, self.end, reciprocating=self.reciprocating)
        return f'the {self.wall} profile is undercut from {ends}, most at {worst}'


def find_flaws(cam: Cam, clearance: float | None = None) -> list[Flaw]:
    """Find undercut and cusps of the profile by its curvature.

    A roller needs a pitch curve that nowhere bulges more sharply than it does itself, a face a
    profile that bulges everywhere. What is lost of the profile by it, by corners or by parts far
    away, `interference.find_cut_away` shows.

    Parameters
    ----------
    clearance : clearance of the roller in a groove [m]; None without an outer wall
    """
    radius = getattr(cam.follower, 'roller', None)

    def inner(x: Array) -> Array:
        touch = cam.at(x)
        if radius is None:
            return np.asarray(-touch.curvature_radius / cam.base_radius)
        return np.asarray((radius + 0.5 * (clearance or 0.0)) * touch.curvature - 1.0)

    flaws = _flaws(cam.law, inner, 'inner')
    if clearance is not None:
        half = _roller(cam.follower) + 0.5 * clearance
        flaws += _flaws(cam.law, lambda x: -half * cam.at(x).curvature - 1.0, 'outer')
    return flaws


def smallest_base_radius(law: Law, follower: Follower, pressure_angle: float) -> float:
    """The smallest base radius [m] under a given law that keeps the pressure angle within a limit.

    With prime radius and lowest position as in `followers`: for a translating follower
    ``tan(phi) = (offset - u')/(s + u)`` bounds the height s from below; for an oscillating one
    ``tan(phi) = side (a cos(psi) - b (1 + side u'))/(a sin(psi))`` bounds its angle psi on both
    sides.

    Parameters
    ----------
    pressure_angle : the limit, between 0 and a right angle [rad]
    """
    if law.reciprocating:
        raise InputError('a reciprocating cam has no base circle')
    if not isinstance(follower, Translating | Oscillating):
        raise InputError('base circles are proposed for knife edges and rollers, not for faces')
    if not 0 < pressure_angle < 0.5 * math.pi:
        raise InputError('a limit of the pressure angle is between 0 and 90 deg')
    if isinstance(follower, Translating):
        slope, f = math.tan(pressure_angle), follower.offset
        s = greatest(law, lambda x: np.abs(law(x, 1) - f) / slope - law(x))[1]
        radius = math.hypot(max(s, 0.0), f) - follower.roller
    else:
        radius = _smallest_oscillating(law, follower, pressure_angle)
    if radius <= 0:
        raise InputError(_ANY)
    return radius


def _smallest_of_shape(cam: Cam, law_on: Callable[[float], Law], limit: float) -> float:
    """Base radius of a cam whose law depends on it, by a search from its own on."""

    def excess(radius: float) -> float:
        other = replace(cam, law=law_on(radius), base_radius=radius)
        return other.largest_pressure_angle - limit

    inside = excess(cam.base_radius) <= 0.0
    last = cam.base_radius
    for _ in range(_SEARCHED):
        radius = last / _WIDER if inside else last * _WIDER
        try:
            found = excess(radius)
        except InputError as told:  # the shape ends there, as where flanks miss the nose
            raise InputError(
                f'no base circle of this shape has {math.degrees(limit):g} deg as its largest '
                'pressure angle'
            ) from told
        if (found <= 0.0) != inside:
            return float(scipy.optimize.brentq(excess, *sorted((last, radius)), xtol=1e-15))
        last = radius
    raise InputError(_ANY if inside else _none(limit))


def _none(limit: float) -> str:
    return (
        'no base circle keeps the pressure angle of this follower within '
        f'{math.degrees(limit):g} deg'
    )


def _smallest_oscillating(law: Law, follower: Oscillating, limit: float) -> float:
    a, b = follower.pivot_distance, follower.arm

    def reach(x: Array) -> Array:
        cosine = b * (1.0 + follower.side * law(x, 1)) / a * math.cos(limit)
        return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))

    least = greatest(law, lambda x: np.abs(reach(x) - limit) - law(x))[1]
    most = math.pi - greatest(law, lambda x: np.abs(math.pi - limit - reach(x)) + law(x))[1]
    sharpest = greatest(law, lambda x: np.abs(1.0 + follower.side * law(x, 1)))[1]
    if sharpest * b * math.cos(limit) > a or least > most:
        raise InputError(_none(limit))
    return math.sqrt(a**2 + b**2 - 2.0 * a * b * math.cos(least)) - follower.roller


def extent(law: Law) -> float:
    """A turn [rad], or the stroke of a reciprocating cam [m]."""
    return float(law.breaks[-1] - law.breaks[0])


def drawing_angles(law: Law, step: float) -> Array:
    """Angles (n,) of a turn or stroke to draw a profile from, both sides of all breaks among them.

    Parameters
    ----------
    step : largest distance [rad] or [m]
    """
    pieces = _pieces(law)
    counts = [math.ceil((end - start) / step) + 1 for start, end in pieces]
    return np.concatenate(
        [np.linspace(*p, max(n, 2)) for p, n in zip(pieces, counts, strict=True)]
    )


def outline_angles(law: Law) -> Array:
    """Angles (n,) of the corners of a drawn profile, which keep a radius of 100 mm to 0.05 um."""
    return drawing_angles(law, extent(law) / 3600)


def distinct(points: Array, closed: bool) -> Array:
    """Points (2, n) without those that repeat the one before, as at the breaks of a law."""
    moved = np.hypot(*np.diff(points, prepend=points[:, -1:])) > _SAME
    moved[0] |= not closed
    return points[:, moved]


def greatest(law: Law, function: Callable[[Array], Array]) -> tuple[float | None, float]:
    """Angle and value of the greatest value over a turn or stroke; of a constant no angle.

    The angle of several is the first, and of a stretch where the value stays, its beginning.

    Parameters
    ----------
    function : function of angles (N,), smooth between the breaks of the law; limits at breaks
        count, from both sides
    """
    search = ExtremeSearch(['value'])
    search.add(lambda x: function(x.ravel())[None], *np.array(_pieces(law)).T)
    found, top = float(search.greatest_time[0]), float(search.greatest[0])
    return _place(law, function, found, top - _BLURRED * float(search.rounding[0])), top


def _place(
    law: Law, function: Callable[[Array], Array], found: float, level: float
) -> float | None:
    """The angle of a greatest value, found to the rounding of values, as closely as it is known.

    Near it the function stays above a level just below for an interval that is far wider than
    rounding of angles, as it is flat there: a break in that interval is the angle, as those of
    dwells and symmetric diagrams are, or else its middle.
    """
    if not math.isfinite(found):
        return None
    pieces = _pieces(law)
    if all((function(np.linspace(*ends, SAMPLES)) >= level).all() for ends in pieces):
        return None
    k = int(np.clip(np.searchsorted(law.breaks, found, 'right') - 1, 0, len(pieces) - 1))
    ends = []
    for end, at_break in zip(pieces[k], law.breaks[k : k + 2], strict=True):
        near, far = 0.0, 1.0  # of the way to the end, where it is above the level and below
        steps = np.append(0.5 ** np.arange(_HALVED, 0, -1), 1.0)
        for _ in range(4):  # each time 180 times as close
            above = function(found + steps * (end - found)) >= level
            if above.all():
                near = far
                break
            first = int(np.argmin(above))
            near, far = (steps[first - 1] if first else near), steps[first]
            steps = np.linspace(near, far, SAMPLES)[1:]
        if near == 1.0:
            return float(at_break)
        ends.append(found + near * (end - found))
    return 0.5 * (ends[0] + ends[1])


def _pieces(law: Law) -> list[tuple[float, float]]:
    """Between breaks; so little inside that a limit is met to nearly all digits."""
    breaks = law.breaks
    inset = 1e-12 * np.diff(breaks)
    ends = zip(breaks[:-1] + inset, breaks[1:] - inset, strict=True)
    return [(float(a), float(b)) for a, b in ends]


def _sampled(function: Callable[[Array], Array], start: float, end: float) -> Array:
    """Angles and values (2, n) on an interval, the greatest value being found more closely."""
    x = np.linspace(start, end, SAMPLES)
    y = function(x)
    i = int(np.argmax(y))
    if 0 < i < SAMPLES - 1:
        best = scipy.optimize.minimize_scalar(
            lambda a: -float(function(np.array([a]))[0]),
            bounds=(x[i - 1], x[i + 1]),
            method='bounded',
            options={'xatol': 1e-9 * min(end - start, 1.0)},
        )
        k = i + int(best.x > x[i])
        x, y = np.insert(x, k, best.x), np.insert(y, k, -best.fun)
    return np.array([x, y])


def _flaws(
    law: Law, excess: Callable[[Array], Array], wall: Literal['inner', 'outer']
) -> list[Flaw]:
    """Runs of angles in which a number is not below zero; pieces of a law stay apart."""
    flaws = []
    for first, last in _pieces(law):
        x, y = _sampled(excess, first, last)
        for start, end, worst, most in runs_of(x, y, y >= -1e-9):
            kind: Literal['undercut', 'cusp'] = 'cusp' if most <= 1e-9 else 'undercut'
            flaws.append(Flaw(kind, wall, start, end, worst, law.reciprocating))
    return flaws


def runs_of(x: Array, values: Array, chosen: Mask) -> Iterator[tuple[float, float, float, float]]:
    """Runs of chosen places (n,): first and last, where the value is largest, and that value."""
    places = np.flatnonzero(chosen)
    for run in np.split(places, np.flatnonzero(np.diff(places) > 1) + 1):
        if len(run):
            worst = run[np.argmax(values[run])]
            yield float(x[run[0]]), float(x[run[-1]]), float(x[worst]), float(values[worst])


def _roller(follower: Follower) -> float:
    radius = getattr(follower, 'roller', 0.0)
    if radius <= 0:
        raise InputError('a groove needs a follower with a roller')
    return float(radius)
