"""Lyapunov exponents: how fast neighbouring motions part, by exact derivatives through impacts.

G. Benettin et al., Meccanica 15 (1980) 9: directions are carried along by the derivatives of the
motion and made orthogonal again once a turn; their growth is averaged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.batch_means import BATCHES, ratio
from mechanism_sim.scene import Source, load_scene
from mechanism_sim.studies.periodic import PoincareMap

_DIGITS = 16.0
"""With which a run begins."""
_ALIGNING = 10
"""Turns until any directions have turned to those that grow most."""


@dataclass(frozen=True)
class LyapunovExponents:
    """The largest exponents, in falling order.

    Attributes
    ----------
    revolutions, skipped : in the mean, and before it
    period : of the drive [s]
    values : [1/s]; minus infinity where closed contacts leave a direction nothing at all
    half_widths : of their 95 % intervals [1/s]
    """

    revolutions: int
    skipped: int
    period: float
    values: tuple[float, ...]
    half_widths: tuple[float, ...]

    @property
    def horizon(self) -> float:
        """Time [s] after which no digit of a run is that of the machine; infinite if it is stable.

        A run begins with 16 digits, and loses ``exponent / ln 10`` of them in a second.
        """
        largest = self.values[0]
        return _DIGITS * math.log(10.0) / largest if largest > 0.0 else math.inf


def lyapunov(
    scene: Source,
    revolutions: int = 200,
    skip: int = 20,
    count: int = 1,
    show: Callable[[float, int], None] | None = None,
) -> LyapunovExponents:
    """The largest Lyapunov exponents of a machine under a drive at constant speed.

    >>> import mechanism_sim as ms
    >>> found = ms.lyapunov('four_bar_clearance', revolutions=20, skip=0)
    >>> len(found.values), found.revolutions
    (1, 20)

    Parameters
    ----------
    scene : all that `load_scene` takes
    revolutions, skip : that are averaged over; until the motion has settled, and ten more
    count : of exponents
    show : called with the time [s] of the run so far, and 0

    Raises
    ------
    RunError
        Where derivatives do not exist, such as at a grazing contact.
    """
    machine = load_scene(scene)
    section = PoincareMap(machine)
    most = 2 * len(machine.equations.system.free)
    if not 1 <= count <= most:
        raise InputError(f'{machine.name}: it has {most} exponents, not {count}')
    if skip < 0 or revolutions < BATCHES:
        raise InputError(f'exponents need at least {BATCHES} revolutions, and skip at least 0')
    state = machine.initial_state()
    if skip:
        state, _, _ = section.map(state, skip, audited=True)
    directions = np.linalg.qr(np.random.default_rng(0).standard_normal((most, count)))[0]
    growth: Array = np.empty((revolutions, count))
    for k in range(-_ALIGNING, revolutions):
        J, state = section.growth(state, 1)
        directions, R = np.linalg.qr(J @ directions)
        if k >= 0:
            with np.errstate(divide='ignore'):
                growth[k] = np.log(np.abs(np.diag(R)))
        if show:
            show((skip + k + 1) * machine.drive.period, 0)
    period = machine.drive.period
    found = []
    for column in growth.T:
        if np.isfinite(column).all():
            found.append(ratio(column, np.full(revolutions, period)))
        else:
            found.append((-math.inf, 0.0))
    values, halves = zip(*found, strict=True)
    return LyapunovExponents(revolutions, skip, period, tuple(values), tuple(halves))
