"""Strain gauges: how much a fibre of an elastic link is stretched."""

from __future__ import annotations

from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.keys.quantities import Offset
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene.sensor_keys import SENSORS, AnalogueKeys, OnLinkKeys
from mechanism_sim.sensing.channel import DirectSource


class Gauge(DirectSource):
    """A source: the strain of a fibre, a sum of the elastic coordinates.

    Parameters
    ----------
    mechanism : the machine
    link : its elastic link
    x, y : [m] along the axis, and from it
    """

    def __init__(self, mechanism: Mechanism, link: str, x: float, y: float) -> None:
        self._shares = mechanism.having(Beam)[link].strain(x, y)
        self._used = mechanism.amplitudes(link)

    def reading(self, q: Array) -> Array:
        """Strain (N,)."""
        return np.asarray(self._shares @ q[self._used])


@SENSORS.add('strain_gauge')
class StrainKeys(OnLinkKeys, AnalogueKeys):
    """A strain gauge along an elastic link, of no length of its own."""

    at: Offset = 0.0
    """Along the link, on its left side; or as [x, y] in its frame, y off its axis."""

    reads = 'strain'

    def _fibre(self, machine: Any) -> tuple[float, float]:
        """Position along the axis, and distance from it [m]."""
        if isinstance(self.at, tuple):
            return self.at
        fibre = machine.mechanism.having(Beam)[self.link].outer_fibre(self.at)
        return self.at, float(fibre or 0.0)

    def source(self, machine: Any) -> Gauge:
        """The strain of its fibre."""
        return Gauge(machine.mechanism, str(self.link), *self._fibre(machine))

    def place(self, machine: Any) -> str:
        """Place of the sensor in words: along the link, and from its axis."""
        x, y = self._fibre(machine)
        return f'on the {self.link}, {x:g} m from its origin, {y:g} m left of its axis'

    def check(self, machine: Any, where: str) -> None:
        """Refuse rigid links, and places that are not on the beam."""
        super().check(machine, where)
        beams = machine.mechanism.having(Beam)
        if self.link not in beams:
            raise InputError(
                f"{where}.link: the link '{self.link}' is rigid: a strain gauge needs one with "
                f"'elastic'; those are: {', '.join(beams) or 'none'}"
            )
        beam = beams[self.link]
        if beam.fibre is None and not isinstance(self.at, tuple):
            raise InputError(
                f'{where}.at: give [x, y], or links.{self.link}.elastic.outer_fibre: how far from '
                'the axis the gauge sits is not known'
            )
        x, y = self._fibre(machine)
        if not 0.0 <= x <= beam.length:
            raise InputError(
                f'{where}.at = {x:g} m is not on the {self.link}: it must be from 0 to '
                f'{beam.length:g} m'
            )
        if beam.fibre is not None and abs(y) > (fibre := float(beam.outer_fibre(x))):
            raise InputError(
                f'{where}.at: y = {y:g} m lies outside of the {self.link}, whose outer fibres are '
                f'{fibre:g} m from its axis'
            )
