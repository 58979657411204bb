"""The signals of the sensors in the numbers of machine monitoring."""

from __future__ import annotations

from collections import Counter
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
        self._sensors: dict[str, tuple[SignalCollector, Moments]] = {}
        self._overloads: Counter[str] = Counter()

    def add(self, message: Any) -> None:
        """Enter the block that follows."""
        name = message.sensor
        if name not in self._sensors:
            self._sensors[name] = SignalCollector(_KEPT), Moments()
        signal, moments = self._sensors[name]
        moments.add(signal.add(message))
        self._overloads[name] += int(getattr(message, 'overloads', 0))

    def summary(self, turned: Callable[[Array], Array]) -> tuple[SensorSummary, ...]:
        """The sensors in alphabetical order, those without a sample left out.

        Parameters
        ----------
        turned : revolutions of the crank by times (N,) [s]; nan where they are not known
        """
        found = []
        for name, (collector, moments) in sorted(self._sensors.items()):
            if (signal := collector.signal()) is None:
                continue
            turns = signal.over_turns(turned)
            found.append(
                SensorSummary(
                    **vars(moments.indicators()),
                    sensor=name,
                    link=signal.link,
                    quantity=signal.quantity,
                    unit=signal.unit,
                    sample_rate=signal.rate,
                    missing=collector.missing,
                    overloads=self._overloads[name],
                    orders=tuple(order_spectrum(turns).strongest(3)) if turns else (),
                )
            )
        return tuple(found)
