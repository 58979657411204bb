"""Strain gauges: how much a fibre of an elastic link is stretched."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.numerics.rational import Array, Modes, Rational
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene.quantities import Offset
from mechanism_sim.scene.sensor_keys import (
    AnalogueKeys,
    OnLinkKeys,
    SensorKind,
    register,
)
from mechanism_sim.scene.sensors._places import check_link


class StrainKeys(OnLinkKeys, AnalogueKeys):
    """A strain gauge along an elastic link, of no length of its own."""

    at: Offset = 0.0
    """Along the link, on its left side; or as [x, y] in its frame, y off its axis."""


class Gauge:
    """A source: the strain of a fibre, a sum of the elastic coordinates.

    Parameters
    ----------
    mechanism : the machine
    link : its elastic link
    x, y : [m] along the axis, and from it
    """

    inputs = 1

    def __init__(self, mechanism: Mechanism, link: str, x: float, y: float) -> None:
        self._shares = mechanism.beams[link].strain(x, y)
        self._used = mechanism.amplitudes(link)

    def through(self, chain: Rational) -> Modes:
        """The system from what is read here to what comes out of a chain."""
        return chain.modes()

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Strain (1, N) at instants as those of ``motion.curve.at(segments, dt)``."""
        return np.asarray(self._shares @ motion.curve.local(segments, dt).T[self._used])[None]

    def impulses(self, motion: Motion) -> Array:
        """None (m, 1): a strain has no impulses."""
        return np.zeros((len(motion), 1))


def _fibre(machine: Any, sensor: Any) -> tuple[float, float]:
    """Along the axis, and from it [m]."""
    if isinstance(sensor.at, tuple):
        return float(sensor.at[0]), float(sensor.at[1])
    fibre = machine.mechanism.beams[sensor.link].outer_fibre(sensor.at)
    return float(sensor.at), float(fibre or 0.0)


def _place(machine: Any, sensor: Any) -> str:
    x, y = _fibre(machine, sensor)
    return f'on the {sensor.link}, {x:g} m from its origin, {y:g} m left of its axis'


def _check(machine: Any, sensor: Any, where: str) -> None:
    check_link(machine, where, sensor.link)
    beams = machine.mechanism.beams
    if sensor.link not in beams:
        raise InputError(
            f"{where}.link: the link '{sensor.link}' is rigid: a strain gauge needs one with "
            f"'elastic'; those are: {', '.join(beams) or 'none'}"
        )
    beam = beams[sensor.link]
    if beam.fibre is None and not isinstance(sensor.at, tuple):
        raise InputError(
            f'{where}.at: give [x, y], or links.{sensor.link}.elastic.outer_fibre: how far from '
            'the axis the gauge sits is not known'
        )
    x, y = _fibre(machine, sensor)
    if not 0.0 <= x <= beam.length:
        raise InputError(
            f'{where}.at = {x:g} m is not on the {sensor.link}: it must be from 0 to '
            f'{beam.length:g} m'
        )
    if beam.fibre is not None and abs(y) > (fibre := float(beam.outer_fibre(x))):
        raise InputError(
            f'{where}.at: y = {y:g} m lies outside of the {sensor.link}, whose outer fibres are '
            f'{fibre:g} m from its axis'
        )


register(
    SensorKind(
        'strain_gauge',
        StrainKeys,
        needs=('link',),
        quantity='strain',
        source=lambda machine, sensor: Gauge(
            machine.mechanism, sensor.link, *_fibre(machine, sensor)
        ),
        carrier=lambda machine, sensor: str(sensor.link),  # noqa: ARG005
        place=_place,
        check=_check,
    )
)
