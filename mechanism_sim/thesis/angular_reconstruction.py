"""Angular motion of a link rebuilt from its sensors, as [SB] 7.2 and by better methods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.sensing.chain import Instrument
from mechanism_sim.thesis import reconstruction as angular
from mechanism_sim.thesis.frequency_weights import band_pass, both, fade, invert
from mechanism_sim.thesis.reconstruction import Error, error

LINKS = 'coupler', 'rocker'
_TOP = 0.45  # of the sampling rate: above, nothing is worth keeping


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A reconstruction of a quantity (N,), and the best that could have come of the instrument.

    Attributes
    ----------
    shown : (N,) the true quantity through the same chain without noise, and treated likewise
    """

    values: Array
    shown: Array
    truth: Array

    @property
    def error(self) -> Error:
        """Against the truth."""
        return error(self.values, self.truth)

    @property
    def error_of_shown(self) -> Error:
        """Against what the instrument could show at all."""
        return error(self.values, self.shown)


class Rebuilt:
    """The methods on one link.

    Parameters
    ----------
    linkage : the mechanism without clearance
    link : one of `LINKS`
    at : places of one or two sensors across it, from its joint [m]
    gravity : that the sensors feel [m/s^2]
    instrument : the chain of both, without noise
    angle, speed : of crank, coupler and rocker of the mechanism without clearance (3, N)
    """

    def __init__(
        self,
        linkage: FourBar,
        link: str,
        at: list[float],
        gravity: tuple[float, float],
        instrument: Instrument,
        angle: Array,
        speed: Array,
    ) -> None:
        self._at, self._gravity = at, gravity
        self._angle = angle[1 + LINKS.index(link)]
        self._joint = (
            angular.crank_pin(linkage.crank, angle[0], speed[0]) if link == 'coupler' else None
        )
        self._rate = rate = instrument.sample_rate
        self._crank = float(np.abs(speed[0]).mean()) / TWO_PI
        filtered = instrument.anti_alias.frequency if instrument.anti_alias else rate
        self._top = min(filtered, _TOP * rate)
        self._turn = max(2, round(rate / self._crank))
        band = band_pass(0.5 * self._crank, self._top, 0.25 * self._crank)
        self._undo = both(invert(instrument.transfer()), band)

    def accelerations(
        self, readings: list[Array], heard: Array, truth: Array
    ) -> dict[str, Reconstruction]:
        """Angular accelerations [rad/s^2] by method."""
        first = readings[0]
        faded = self._turn_by_turn(first)
        undone, best = self._undone(first), self._undone(heard)
        found = {
            'thesis': Reconstruction(self._one(faded, False), self._turn_by_turn(heard), truth),
            'corrected': Reconstruction(
                _swinging(self._one(faded, True)), self._turn_by_turn(heard), truth
            ),
            'undone': Reconstruction(_swinging(self._one(undone, True)), best, truth),
        }
        if len(readings) > 1:
            two = angular.by_two(first, readings[1], *self._at)
            found['two'] = Reconstruction(
                self._turn_by_turn(two), self._turn_by_turn(heard), truth
            )
            found['two, undone'] = Reconstruction(self._undone(two), best, truth)
        return found

    def velocities(
        self, accelerations: Mapping[str, Reconstruction], nominal: Array, truth: Array
    ) -> dict[str, Reconstruction]:
        """Angular velocities [rad/s] by method, from the angular acceleration of another."""
        thesis = accelerations['thesis']
        best = accelerations.get('two, undone', accelerations['undone'])
        rate, low, mean = self._rate, 0.5 * self._crank, float(nominal.mean())

        def each(values: Array, closed: bool) -> Array:
            starts = range(0, len(values), self._turn)
            pieces = [
                angular.by_whole_cycles(part, rate, float(nominal[i : i + self._turn].mean()))
                if closed
                else angular.by_trapezoids(part, rate, nominal[i])
                for i in starts
                if len(part := values[i : i + self._turn])
            ]
            return np.concatenate(pieces)

        return {
            'thesis': Reconstruction(each(thesis.values, False), each(thesis.shown, False), truth),
            'closed': Reconstruction(each(thesis.values, True), each(thesis.shown, True), truth),
            'spectrum': Reconstruction(
                angular.by_spectrum(best.values, rate, low, mean),
                angular.by_spectrum(best.shown, rate, low, mean),
                truth,
            ),
            'filter': Reconstruction(
                angular.by_filter(best.values, rate, 0.4 * low, 2, mean),
                angular.by_filter(best.shown, rate, 0.4 * low, 2, mean),
                truth,
            ),
        }

    def _one(self, reading: Array, weighed: bool) -> Array:
        """By the outermost sensor, as [SB]; gravity is taken off if `weighed`."""
        gravity = self._gravity if weighed else (0.0, 0.0)
        return angular.angular_acceleration(
            reading, self._at[0], self._angle, self._joint, gravity
        )

    def _turn_by_turn(self, values: Array) -> Array:
        """Faded above the band under a rectangular window of one turn, as [SB]."""
        return fade(values, self._rate, band_pass(0.0, self._top), self._turn)

    def _undone(self, values: Array) -> Array:
        """Gain and delay of the instrument taken out of the whole record."""
        return fade(values, self._rate, self._undo)


def _swinging(acceleration: Array) -> Array:
    """The mean taken off: that of a link that rocks is zero, and no such chain passes it."""
    return np.asarray(acceleration - acceleration.mean())
