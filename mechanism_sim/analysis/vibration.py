"""The signals of the sensors in the numbers of machine monitoring."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mechanism_sim.analysis.signals import SignalCollector
from mechanism_sim.arrays import Array
from mechanism_sim.sensing.indicators import Indicators, Moments
from mechanism_sim.sensing.orders import order_spectrum

_KEPT = 2**18  # samples of each sensor, the last ones, of which the strongest orders are sought


@dataclass(frozen=True)
class SensorSummary(Indicators):
    """The signal of one sensor, with its indicators.

    orders: the strongest lines over the crank's orders as (order, amplitude), of the last quarter
    of a million samples or fewer; empty where no whole turn is recorded.
    """

    sensor: str
    link: str
    quantity: str
    unit: str
    sample_rate: float  #: [Hz]
    missing: int  #: samples between blocks that should meet and do not
    overloads: int  #: samples cut at the end of the range
    orders: tuple[tuple[float, float], ...]


class VibrationCollector:
    """Gathers SensorBlock messages by sensor."""

    def __init__(self) -> None:
        self._moments: dict[str, Moments] = {}
        self._signals: dict[str, SignalCollector] = {}
        self._overloads: dict[str, int] = {}

    def add(self, message: Any) -> None:
        """Add the block that follows."""
        name = message.sensor
        values = self._signals.setdefault(name, SignalCollector(_KEPT)).add(message)
        self._moments.setdefault(name, Moments()).add(values)
        self._overloads[name] = self._overloads.get(name, 0) + int(
            getattr(message, 'overloads', 0)
        )

    def summary(self, turned: Callable[[Array], Array]) -> tuple[SensorSummary, ...]:
        """Return the sensors in alphabetical order, those without a sample left out.

        Args:
            turned: Revolutions of the crank by times (N,) [s]; nan where they are not known.

        """
        found = []
        for name, collector in sorted(self._signals.items()):
            signal = collector.signal()
            if signal is None:
                continue
            turns = signal.over_turns(turned)
            found.append(
                SensorSummary(
                    sensor=name,
                    link=signal.link,
                    quantity=signal.quantity,
                    unit=signal.unit,
                    sample_rate=signal.rate,
                    missing=collector.missing,
                    overloads=self._overloads[name],
                    orders=tuple(order_spectrum(turns).strongest(3)) if turns else (),
                    **vars(self._moments[name].indicators()),
                )
            )
        return tuple(found)
