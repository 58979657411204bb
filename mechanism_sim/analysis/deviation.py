"""Deviation of a machine from its ideal, and the ratio of two deviations: alpha of [SB] 8.1.

[SB] calls alpha the factor between what the simulated and what the measured response have beyond
the response of the mechanism without clearance. It took the root of the mean square over some
instants, and recommended spectra under a good window: both are here, and alpha order by order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.analysis.record import Record
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.polynomials import TWO_PI, exact_sum
from mechanism_sim.results.cycle import is_steady
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import build
from mechanism_sim.scene.load import without_clearance
from mechanism_sim.sensing.chain import Converter, Noise
from mechanism_sim.sensing.spectra import TurnSegments, power

_SAMPLES = 1024  # angles in a turn
_SEGMENT = 4  # turns under the window, if there are as many


@dataclass(frozen=True, eq=False)
class Deviation:
    """A quantity of a run, beside that of the ideal mechanism under the same drive."""

    quantity: str
    #: (K, n) values over the angle of the drive
    own: TurnSegments
    ideal: TurnSegments

    @property
    def values(self) -> Array:
        """Own less ideal, (K, n)."""
        return np.asarray(self.own.values - self.ideal.values)

    @property
    def rms(self) -> float:
        """Root of the mean square of the difference."""
        return float(np.sqrt(np.mean(self.values**2)))

    def modified(self, alpha: float) -> TurnSegments:
        """The ideal response and the deviation over alpha: the modified response of [SB] 8.1."""
        return replace(self.own, values=self.ideal.values + self.values / alpha)

    @property
    def segment(self) -> int:
        """Turns under the window of spectra: four, or as many as follow each other."""
        longest = max(map(len, TurnSegments(self.values, self.own.first).series()))
        return int(min(_SEGMENT, longest // self.own.values.shape[1]))

    def order_power(self, segment: int) -> Array:
        """Mean square (n / 4,) of the difference in bands of one order about 1, 2, ...

        By Welch's method with Hann windows of `segment` turns.
        """
        n = self.own.values.shape[1]
        series = TurnSegments(self.values, self.own.first).series()
        found = power(series, float(n), segment * n)
        order = np.floor(found.frequency + 0.5).astype(np.int64)
        sums = np.zeros(order[-1] + 1)
        np.add.at(sums, order, found.values * found.step)
        return sums[1 : n // 4 + 1]


@dataclass(frozen=True, eq=False)
class Alpha:
    """Ratio of two deviations from the ideal machine."""

    rms: float  #: ratio of the roots of the mean squares
    spectrum: float  #: ratio of the mean amplitudes of all orders
    order: NDArray[np.int64]  #: (F,) 1, 2, ...
    by_order: Array  #: (F,) ratio of amplitudes in each


def ideal_machine(machine: Machine) -> Machine:
    """A machine with every joint ideal and rigid.

    Its sensors keep their filters, but have no noise, converter or trigger.
    """
    if machine.plan.powered or not machine.plan.prescribed:
        raise InputError(
            f'{machine.name}: the motion without clearance is known only where drives prescribe it'
        )
    clean = {'noise': Noise(), 'adc': Converter(), 'trigger': None}
    sensors = machine.scene.sensors.items()
    quiet = {name: sensor.model_copy(update=clean) for name, sensor in sensors}
    ideal = without_clearance(machine, rigid=True)
    return build(machine.name, ideal.scene.model_copy(update={'sensors': quiet}))


def ideal_record(record: Record, since: float | None = None) -> Record:
    """Run of the same machine with ideal joints up to the end of a run.

    It begins when the machine starts; of one that repeats itself under a constant speed whole
    repetitions before a time are left out, but for one.

    Parameters
    ----------
    since : start of the range [s]; default: that of the run
    """
    ideal = ideal_machine(record.machine)
    again, period = ideal.drive.repetition, ideal.drive.period
    steady = not ideal.level.dynamic and is_steady(ideal) and again.found
    often = int((record.start if since is None else since) / (again.turns * period)) - 1
    if not steady or often < 1:
        return Record(ideal, simulate(ideal, duration=record.end), {})
    skipped = often * again.turns * period
    run = simulate(ideal, duration=max(record.end - skipped, again.turns * period))
    # the motion some repetitions later: angles by whole turns
    curve, slides = run.motion.curve, run.physics.displacements
    first, last = curve(np.array([0.0, skipped / often]))
    angles = ~np.isin(run.physics.coordinates, [*slides])
    turns = often * np.where(angles, np.round((last - first) / TWO_PI), 0.0).astype(np.int64)
    start, low = exact_sum(np.full(len(curve), skipped), curve.start_low, curve.start)
    moved = replace(curve, start=start, start_low=low, turns=curve.turns + turns)
    later = replace(run.motion, curve=moved)
    return Record(ideal, replace(run, motion=later), {})


def deviation(
    record: Record, quantity: str, samples: int | None = None, skip: int = 0
) -> Deviation:
    """A quantity of a run beside that of the ideal machine, which is simulated for it.

    Parameters
    ----------
    quantity : a name of `Piece.sample`, such as ``acceleration.coupler``, or of a sensor, whose
        ideal signal comes through the same instrument without its noise
    samples : number of angles in a turn; default: 1024, for a sensor its samples in a turn
    skip : whole turns at the start that are left out
    """
    n = samples or (None if quantity in record.sensors else _SAMPLES)
    own = record.over_turns(quantity, n, skip)
    beside = ideal_record(record).over_turns(quantity, own.values.shape[1])
    both = np.isin(own.first, beside.first)  # the last turn may end but for rounding
    own = replace(own, values=own.values[both], first=own.first[both])
    ideal = replace(own, values=beside.values[own.first - beside.first[0]])
    return Deviation(quantity, own, ideal)


def alpha(one: Deviation, other: Deviation, highest: int | None = None) -> Alpha:
    """Ratio of the first deviation to the second.

    The spectra are those of Welch's method with Hann windows of four turns, or as many as both
    runs have, in bands of one order each.

    Parameters
    ----------
    highest : highest order considered; by default half the highest that both resolve
    """
    if not other.rms:
        raise InputError(f'{other.quantity} does not deviate from the ideal: there is no ratio')
    segment = min(one.segment, other.segment)
    powers = [d.order_power(segment) for d in (one, other)]
    count = min(*map(len, powers), highest or len(powers[0]))
    a, b = (np.sqrt(p[:count]) for p in powers)
    return Alpha(one.rms / other.rms, float(a.sum() / b.sum()), np.arange(1, count + 1), a / b)
