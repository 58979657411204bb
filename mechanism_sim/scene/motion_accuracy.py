"""Largest accelerations of drives whose motion is given over time, and how far they may be off."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.polynomial import polynomial

from mechanism_sim.numerics.sampled_data import SampledDerivative, sampled_derivative
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
        said = f'{key}: largest acceleration {abs(size):.6g} {_unit(machine, c)} at t = {at:.6g} s'
        if (found := _sampled(course)) is None:
            yield said
        elif math.isinf(found.between):
            yield f'{said}; so few points do not say how far it may be off'
        else:
            rounded = f' and {found.rounding:.3g} by their rounding' if found.step else ''
            yield f'{said}, which may be off by {found.between:.3g} between the points{rounded}'


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
        found = _sampled(course)
        if found is None or found.determined or math.isinf(found.off):
            continue
        cure = 'they are too far apart: give more points, or a formula'
        if found.rounding > found.between:
            cure = 'they are rounded: give more digits, fewer points, or a formula'
        yield (
            f'{key}: its points do not determine the acceleration, {abs(found.largest):.4g} '
            f'{_unit(machine, c)}, which may be off by {found.off:.3g}; {cure}'
        )


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


def _sampled(course: CoursePart | None) -> SampledDerivative | None:
    """How well points determine an acceleration; None of formulas, moves and ramps."""
    if course is None or not course.given:
        return None
    if isinstance(course, SpeedPart) and course.interpolation in (None, 'linear'):
        return None
    t, y = np.array([(t, x.value) for t, x in course.given]).T
    order, how = 2 - isinstance(course, SpeedPart), course.interpolation or 'cubic'
    units = (1.0, math.radians(1.0)) if order == 2 else (1.0, math.radians(1.0), math.pi / 30.0)
    return sampled_derivative(t, y, order, how, course.periodic, units)


def _largest(machine: Machine, c: str) -> tuple[float, float]:
    """The largest acceleration of a prescribed coordinate, with its sign, and when [s]."""
    duration = machine.scene.duration or _AHEAD
    best = 0.0, 0.0
    for law, begin, end in ends(machine.plan.laws_until(c, duration), duration):
        second = polynomial.polyder(law.coefficients, 2)
        at = np.linspace(begin, end, _IN_PIECE) - law.reference_time
        values = polynomial.polyval(at, second)
        k = int(np.abs(values).argmax())
        if abs(values[k]) < abs(best[0]):
            continue
        places = at[k : k + 1]
        if len(second) > 2:  # refined where its own derivative is zero
            roots = polynomial.polyroots(polynomial.polyder(second))
            real = roots[np.abs(roots.imag) < 1e-9].real
            places = np.append(places, real[(real > at[0]) & (real < at[-1])])
        sizes = polynomial.polyval(places, second)
        k = int(np.abs(sizes).argmax())
        best = max(
            best, (float(sizes[k]), float(places[k] + law.reference_time)), key=lambda x: abs(x[0])
        )
    return best
