"""What the accelerometers heard, in the three numbers of machine monitoring."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class SensorSummary:
    """The signal of one accelerometer.

    kurtosis: fourth central moment over the squared variance: 3 for Gaussian noise, 1.5 for a
    sine, more the more a signal consists of shocks; None for a signal that does not change.
    """

    sensor: str
    link: str
    sample_rate: float  #: [Hz]
    samples: int
    missing: int  #: samples between blocks that should meet and do not
    rms: float  #: [m/s^2]
    peak: float  #: [m/s^2] magnitude
    kurtosis: float | None


class Moments:
    """Central moments of a stream, block by block.

    Source: P. Pebay, Formulas for robust, one-pass parallel computation of covariances and
    arbitrary-order statistical moments, SAND2008-6212, eqs. 2.1 and 3.1 for p = 2, 3, 4.
    """

    def __init__(self) -> None:
        self.count = 0
        self.mean = self.m2 = self.m3 = self.m4 = 0.0

    def add(self, values: ArrayLike) -> None:
        """Take in a block of samples, shape (N,)."""
        x = np.asarray(values, np.float64)
        nb, na = len(x), self.count
        if not nb:
            return
        mean = float(np.mean(x))
        d = x - mean
        b2, b3, b4 = (float(np.sum(d**p)) for p in (2, 3, 4))
        a2, a3, n, delta = self.m2, self.m3, na + nb, mean - self.mean
        self.m4 += (
            b4
            + delta**4 * na * nb * (na * na - na * nb + nb * nb) / n**3
            + 6 * delta**2 * (na * na * b2 + nb * nb * a2) / n**2
            + 4 * delta * (na * b3 - nb * a3) / n
        )
        self.m3 += b3 + delta**3 * na * nb * (na - nb) / n**2 + 3 * delta * (na * b2 - nb * a2) / n
        self.m2 += b2 + delta**2 * na * nb / n
        self.mean += delta * nb / n
        self.count = n

    @property
    def rms(self) -> float:
        """Root of the mean square, about zero."""
        return math.sqrt(self.m2 / self.count + self.mean**2)

    @property
    def kurtosis(self) -> float | None:
        """Kurtosis; None where the variance is rounding only."""
        if self.m2 <= self.count * (1e-14 * self.mean) ** 2:
            return None
        return self.count * self.m4 / self.m2**2


class VibrationCollector:
    """Gathers AccelerometerBlock messages by sensor."""

    def __init__(self) -> None:
        self._moments: dict[str, Moments] = {}
        self._peak: dict[str, float] = {}
        self._about: dict[str, tuple[str, float]] = {}
        self._next: dict[str, float] = {}
        self._missing: dict[str, int] = {}

    def add(self, message: Any) -> None:
        """Add the block that follows."""
        name, rate = message.sensor, float(message.sample_rate)
        values = np.asarray(message.acceleration, np.float64)
        time = float(message.time)
        lost = round((time - self._next.get(name, time)) * rate)
        self._missing[name] = self._missing.get(name, 0) + max(0, lost)
        self._next[name] = time + (len(values) / rate if rate > 0 else 0.0)
        self._about[name] = (message.link, rate)
        self._moments.setdefault(name, Moments()).add(values)
        peak = float(np.max(np.abs(values), initial=0.0))
        self._peak[name] = max(self._peak.get(name, 0.0), peak)

    def summary(self) -> tuple[SensorSummary, ...]:
        """Return the sensors in alphabetical order, those without a sample left out."""
        return tuple(
            SensorSummary(
                sensor=name,
                link=self._about[name][0],
                sample_rate=self._about[name][1],
                samples=moments.count,
                missing=self._missing[name],
                rms=moments.rms,
                peak=self._peak[name],
                kurtosis=moments.kurtosis,
            )
            for name, moments in sorted(self._moments.items())
            if moments.count
        )
