"""Vibrations where the formulas of textbooks divide nothing by nothing."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from oscillator import Oscillator
from torsional import disks

from test.hard.case import Figure, hard_case

ROUNDING = 2.0**-53
TERMS = 110  # of power series: 24^110/110! < 1e-26


def series(wn: float, a: float, w: float, start: tuple[float, float], t: float) -> float:
    """``y(t)`` of ``y'' + 2 a y' + wn^2 y = Re e^(i w t)``, or 0 if w < 0, without rounding."""
    square, twice, time = Fraction(wn) ** 2, 2 * Fraction(a), Fraction(t)
    y, push = [Fraction(start[0]), Fraction(start[1])], Fraction(w >= 0.0)
    for k in range(TERMS):
        force = push if k % 2 == 0 else 0
        y.append((force - twice * (k + 1) * y[k + 1] - square * y[k]) / ((k + 1) * (k + 2)))
        if k % 2:
            push *= -(Fraction(w) ** 2) / (k * (k + 1))
    return float(sum(c * time**k for k, c in enumerate(y)))


@hard_case(
    'Critical damping, and damping ratios 1e-16 to 1e-1 off it on both sides: the two solutions '
    'of the book become one, and their quotients lose all digits.',
    'The power series of the solution in fractions, without rounding.',
)
def critical_damping() -> list[Figure]:
    """Largest relative error, of free and forced vibration."""
    free = forced = 0.0
    for d in (0.0, *(s * 10.0**-k for k in range(1, 17, 3) for s in (-1.0, 1.0))):
        oscillator = Oscillator(3.0, 3.0 * (1.0 + d))
        for t in (0.01, 0.3, 1.0, 4.0):
            found = float(oscillator.free(t, 0.7, -2.0).displacement)
            exact = series(3.0, 3.0 * (1.0 + d), -1.0, (0.7, -2.0), t)
            free = max(free, abs(found / exact - 1.0))
            found = float(oscillator.forced(t, 1.0, 1.5).displacement)
            exact = series(3.0, 3.0 * (1.0 + d), 1.5, (0.0, 0.0), t)
            forced = max(forced, abs(found / exact - 1.0))
    return [
        Figure('relative error, free', free, 1e-13),
        Figure('relative error, forced', forced, 1e-13),
    ]


@hard_case(
    'A force at the natural frequency, or 1e-16 to 1e-2 off it, on an oscillator without damping '
    'or all but: both terms of the answer are infinite, their difference is not.',
    'The power series in fractions for a few periods; at resonance ``t sin(w t)/(2 m w)`` for '
    '1e6 s. The phase w t is rounded, so the error grows as eps w t.',
)
def resonance() -> list[Figure]:
    """Errors over eps (1 + w t) and the amplitude of resonance."""
    worst = 0.0
    for off in (0.0, *(s * 10.0**-k for k in range(2, 17, 2) for s in (-1.0, 1.0))):
        for ratio in (0.0, 1e-14, 1e-4):
            w, a = 5.0 * (1.0 + off), 5.0 * ratio
            oscillator = Oscillator(5.0, a)
            for t in (0.05, 1.0, 4.0):
                found = float(oscillator.forced(t, 1.0, w).displacement)
                away = abs(found - series(5.0, a, w, (0.0, 0.0), t))
                worst = max(worst, away / (ROUNDING * (1.0 + w * t) * min(t / (2.0 * w), t * t)))
    long = 0.0
    for t in (1e2, 1e4, 1e6):
        found = float(Oscillator(5.0).forced(t, 1.0, 5.0).displacement)
        away = abs(found - 0.1 * t * math.sin(5.0 * t))
        long = max(long, away / (ROUNDING * (1.0 + 5.0 * t) * 0.1 * t))
    return [
        Figure('error in its units, near resonance', worst, 20.0),
        Figure('error in its units, at resonance for 1e6 s', long, 20.0),
    ]


@hard_case(
    'A shaft with disks that nothing holds: a mode of frequency zero that turns for ever beside '
    'those that vibrate, with damping and without.',
    'The mean of the angles, weighed with the inertias, is start plus rate times t exactly.',
)
def free_shaft() -> list[Figure]:
    """Frequency of the rigid-body mode, and the mean angle after 1e6 s."""
    inertias, stiffnesses, start = [3.0, 1.0, 2.0], [50.0, 20.0], np.array([0.1, -0.2, 0.3])
    rates, t = np.array([1.0, 2.0, -1.0]), np.array([1.0, 1e3, 1e6])
    frequency = error = 0.0
    for damping in (0.0, 1e-6, 0.3, 30.0):
        system = disks(inertias, stiffnesses, [damping * k / 50.0 for k in stiffnesses])
        frequency = max(frequency, float(system.modes.frequencies[0]))
        turned = np.average(system.free(t, start, rates).displacement, axis=0, weights=inertias)
        exact = np.average(start, weights=inertias) + np.average(rates, weights=inertias) * t
        error = max(error, float(np.abs(turned / exact - 1.0).max()))
    return [
        Figure('frequency of the rigid-body mode', frequency, 0.0, 'rad/s'),
        Figure('relative error of the mean angle', error, 1e-11),
    ]
