"""Largest accelerations of drives whose motion is given over time, and how far they may be off."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.polynomial import polynomial

from mechanism_sim.numerics.sampled import (
    SampledPeak,
    acceleration_peaks,
    describe_peaks,
    determined,
)
from mechanism_sim.planar.endless_laws import ends
from mechanism_sim.scene.drives import drive_key
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.motion_keys import CoursePart, SpeedPart

_AHEAD = 10.0
"""[s] that are looked at of a motion without end."""
_CURVE = 8
"""Points between which a speed goes on, of a curve rather than of ramps one after the other."""
_IN_PIECE = 33
"""Places in a piece at which accelerations are compared."""


def acceleration_notes(machine: Machine) -> Iterator[str]:
    """The largest acceleration of each drive that is given over time."""
    for c, key, course in _courses(machine):
        size, at = _largest(machine, c)
        yield f'{key}: largest acceleration {abs(size):.6g} {_unit(machine, c)} at t = {at:.6g} s'
        if (peaks := _peaks(course)) and determined(peaks):
            yield f'{key}: {describe_peaks(peaks, _unit(machine, c))}'


def undetermined_accelerations(machine: Machine) -> Iterator[str]:
    """A question for each drive whose acceleration its points do not determine."""
    for c, key, course in _courses(machine):
        if isinstance(course, SpeedPart) and course.ramp == 'smooth':
            rises = np.diff([x.value for _, x in course.given])
            if (stops := int((rises[1:] * rises[:-1] > 0.0).sum())) >= _CURVE:
                yield (
                    f'{key}.ramp: smooth takes the acceleration to zero at {stops} points between '
                    "which the speed goes on: through points of a curve take 'interpolation: "
                    "cubic'"
                )
        if (peaks := _peaks(course)) and not determined(peaks):
            yield f'{key}: {describe_peaks(peaks, _unit(machine, c))}'


def _unit(machine: Machine, c: str) -> str:
    return 'm/s^2' if c in machine.mechanism.displacements else 'rad/s^2'


def _courses(machine: Machine) -> Iterator[tuple[str, str, CoursePart | None]]:
    """Coordinates whose motion is given over time, by which key, and its course, if no moves."""
    for c in machine.plan.prescribed:
        drive, key = machine.scene.drives.get(c, machine.scene.drive), drive_key(machine.plan, c)
        assert drive is not None  # noqa: S101 - it is prescribed
        if drive.moves:
            yield c, f'{key}.moves', None
        for name in ('position', 'speed', 'profile'):
            if isinstance(course := getattr(drive, name), CoursePart):
                yield c, f'{key}.{name}', course


def _peaks(course: CoursePart | None) -> tuple[SampledPeak, SampledPeak] | None:
    """Extreme accelerations by points; None of formulas, moves and ramps."""
    if course is None or not course.given:
        return None
    rate = isinstance(course, SpeedPart)
    how = course.interpolation or ('linear' if rate else 'cubic')
    if how == 'linear':
        return None
    t, y = np.array([(t, x.value) for t, x in course.given]).T
    if course.periodic:  # what turns on has the same accelerations without its turns
        y = y - (y[-1] - y[0]) * (t - t[0]) / (t[-1] - t[0])
        y[-1] = y[0]
    degree = {'cubic': 3, 'quintic': 5}[how]
    return acceleration_peaks(t, y, degree, course.periodic, order=2 - rate)


def _largest(machine: Machine, c: str) -> tuple[float, float]:
    """The largest acceleration of a prescribed coordinate, with its sign, and when [s]."""
    duration = machine.scene.duration or _AHEAD
    best = 0.0, 0.0
    for law, begin, end in ends(machine.plan.laws_until(c, duration), duration):
        second = polynomial.polyder(law.coefficients, 2)
        at = np.linspace(begin, end, _IN_PIECE) - law.reference_time
        values = np.abs(polynomial.polyval(at, second))
        if values.max() < abs(best[0]):
            continue
        places = at[values.argmax()][None]
        if len(second) > 2:  # refined where its own derivative is zero
            roots = polynomial.polyroots(polynomial.polyder(second))
            real = roots[np.abs(roots.imag) < 1e-9].real
            places = np.append(places, real[(real > at[0]) & (real < at[-1])])
        sizes = polynomial.polyval(places, second)
        k = int(np.abs(sizes).argmax())
        if abs(sizes[k]) > abs(best[0]):
            best = float(sizes[k]), float(places[k] + law.reference_time)
    return best
