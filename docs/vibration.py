"""The pictures of docs/vibration.md: ``python docs/vibration.py`` writes docs/pictures/*.svg."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mechanism_sim.report import figures
from mechanism_sim.vibration.shafts import shaft_rigidity

sys.path.insert(0, str(Path(__file__).parent / 'books'))
from oscillator import Oscillator
from rotors import DiskRotor, Rotor, influence_coefficients

FOLDER = Path(__file__).parent / 'pictures'
GREYS = ('0.0', '0.35', '0.6')


def responses() -> Figure:
    """One oscillator: free vibration at three dampings, and forced near its natural frequency."""
    figure = Figure(figsize=(8.0, 2.8), layout='constrained')
    left, right = figure.subplots(1, 2)
    t = np.linspace(0.0, 3.0, 600)
    for xi, grey, line in zip((0.2, 1.0, 1.2), GREYS, ('-', '--', ':'), strict=True):
        y = Oscillator.of_ratio(10.0, xi).free(t, 0.01, 0.05).displacement
        left.plot(t, 1e3 * y, line, color=grey, lw=1.4, label=f'damping ratio {xi:g}')
    left.set(xlabel='time [s]', ylabel='displacement [mm]', xlim=(0.0, 3.0))
    left.legend(frameon=False)
    t = np.linspace(0.0, 8.0, 1000)
    for ratio, grey, line in zip((1.0, 0.9, 0.5), GREYS, ('-', '--', '-'), strict=True):
        y = Oscillator(10.0).forced(t, -100j, 10.0 * ratio).displacement
        right.plot(t, y, line, color=grey, lw=0.9, label=f'{ratio:g} of the natural frequency')
    right.set(xlabel='time [s]', ylabel='displacement over\nthe static one', xlim=(0.0, 8.0))
    right.set_ylim(-45.0, 75.0)
    right.legend(frameon=False, loc='upper left')
    return figure


def rotors() -> Figure:
    """Orbits of a rotor on unequal supports, and the two-disk rotor of [V] 6.14.4."""
    figure = Figure(figsize=(8.0, 3.6), layout='constrained')
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    orbits(left)
    disks(right)
    return figure


def orbits(axes: Axes) -> None:
    """Orbits below, between and above the critical speeds; dots at rotor angles 0 and 60 deg."""
    e = 1e-3
    rotor = Rotor(2.0, e, (200.0, 450.0), (1.2, 1.2))
    turn = np.linspace(0.0, 2.0 * np.pi, 400)
    for speed, grey, line in zip((7.0, 12.0, 30.0), GREYS, ('-', '--', ':'), strict=True):
        orbit = rotor.whirl(speed)
        way = 'forward' if orbit.semi_axes[1] > 0.0 else 'backward'
        label = f'{speed:g} rad/s, {way}'
        axes.plot(*orbit.points(turn) / e, line, color=grey, lw=1.3, label=label)
        start, later = (orbit.points(np.radians(a)) / e for a in (0.0, 60.0))
        axes.plot(*start, 'o', color=grey, ms=5)
        axes.plot(*later, 'o', color=grey, mfc='white', ms=5)
    axes.set_aspect('equal', adjustable='datalim')
    axes.set(xlabel='x over eccentricity', ylabel='y over eccentricity')
    axes.legend(frameon=False, loc='upper left')


def disks(axes: Axes) -> None:
    """Radii of whirl of both disks against the speed."""
    stiffness = np.linalg.inv(
        influence_coefficients([0.325, 0.675], 1.2, shaft_rigidity(200e9, 0.05))
    )
    masses = np.full(2, 7860.0 * np.pi * 0.25**2 / 4.0 * 0.05)
    still = DiskRotor(masses, np.zeros(2), stiffness, np.zeros((2, 2)))
    damping = np.full((2, 2), 0.02 * masses[0] * still.critical_speeds[0] / np.pi)
    rotor = DiskRotor(masses, np.array([35e-6, 46e-6]), stiffness, damping)
    speed = np.linspace(1.0, 1400.0, 700)
    speed = np.unique(
        np.concatenate([speed, *(c + np.linspace(-20, 20, 200) for c in rotor.critical_speeds)])
    )
    radius = np.abs(rotor.amplitudes(speed))
    axes.semilogy(speed, 1e3 * radius[:, 0], color='0.0', lw=1.2, label='first disk')
    axes.semilogy(speed, 1e3 * radius[:, 1], '--', color='0.45', lw=1.2, label='second disk')
    for critical in rotor.critical_speeds:
        axes.axvline(critical, color='0.7', lw=0.7)
        axes.text(critical + 15.0, 8.0, f'{critical:.1f}', color='0.3')
    axes.set(xlabel='speed [rad/s]', ylabel='radius of whirl [mm]', xlim=(0.0, 1400.0))
    axes.set_ylim(1e-4, 20.0)
    axes.legend(frameon=False, loc='lower right')


def main() -> None:
    """Write both pictures."""
    with figures.style(), mpl.rc_context({'svg.fonttype': 'none'}):
        for name, figure in (('responses', responses()), ('rotors', rotors())):
            figures.save(figure, FOLDER / f'vibration_{name}.svg')


if __name__ == '__main__':
    main()
