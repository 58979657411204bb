"""Analyses of a bag beyond its summary: spectra, orders, impacts, wear, deviations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from mechanism_sim.analysis.deviation import Alpha, Deviation, alpha, deviation
from mechanism_sim.analysis.record import Record
from mechanism_sim.analysis.roses import (
    ImpactCycles,
    Rose,
    WearMap,
    impact_cycles,
    impact_rose,
    wear_maps,
)
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, check_known
from mechanism_sim.sensing.spectra import (
    LineSpectrum,
    TurnSegments,
    band_share,
    envelope_spectrum,
    order_spectrum,
    power,
    quickly_transformed,
    shock_band,
)
from mechanism_sim.signal_files import ChannelSamples
from mechanism_sim.strict_json import plain

ORDERS = 40
"""Number of orders of the drive in a chart."""
_FEWEST = 16  # samples of a spectrum


@dataclass(frozen=True)
class Wanted:
    """Request: names of sensors, of quantities and of joints."""

    #: names of sensors
    spectra: Sequence[str] = ()
    orders: Sequence[str] = ()
    envelopes: Sequence[str] = ()
    averages: Sequence[str] = ()  #: names of sensors, or of `Piece.sample`
    #: names of joints
    impacts: Sequence[str] = ()
    wear: Sequence[str] = ()
    deviations: Sequence[str] = ()  #: names of sensors, or of `Piece.sample`
    #: band of the envelopes [Hz]; by default that of the largest spectral kurtosis
    band: tuple[float, float] | None = None
    skip: int = 0  #: whole turns of the drive at the start that are left out
    #: radius of the pin for wear maps [m], instead of the scene's
    pin_radius: float | None = None

    def __bool__(self) -> bool:
        """True if anything is named."""
        return any(
            (self.spectra, self.orders, self.envelopes, self.averages, self.impacts, self.wear,
             self.deviations)
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class SignalSpectrum:
    """A spectrum of one signal, and the unit of its values."""

    spectrum: LineSpectrum
    unit: str
    band: tuple[float, float] | None = None  #: band of an envelope [Hz]
    share: float | None = None  #: share of the signal's power in the band
    signal_unit: str = ''  #: unit of the signal itself

    def significant_part(self, rate: float | None) -> tuple[float, Array, Array]:
        """Part worth drawing of orders or of an envelope: its end, places and values (N,).

        Parameters
        ----------
        rate : frequency of the drive's first order [Hz]; None if unknown
        """
        x, values = self.spectrum.frequency, self.spectrum.values
        end = min(float(x[-1]), ORDERS * (rate or np.inf))
        if self.band:  # squared, the envelope holds no frequency above the width of its band
            end = min(end, self.band[1] - self.band[0])
        shown = (x > 0.0) & (x <= end)
        return end, x[shown], values[shown]


@dataclass(frozen=True, eq=False)
class Average:
    """A quantity over the angle of the drive, in as many turns as bring all again."""

    turns: TurnSegments
    unit: str


@dataclass(frozen=True, eq=False)
class ImpactDetails:
    """The impacts of a joint, one by one and turn by turn."""

    rose: Rose
    cycles: ImpactCycles | None  #: None without a whole turn of the drive in the run


@dataclass(frozen=True, eq=False)
class Beside:
    """A deviation from the ideal machine, and its ratio to that of another bag."""

    deviation: Deviation
    unit: str
    against: str | None = None  #: name of the other run's scene
    alpha: Alpha | None = None


@dataclass(frozen=True, eq=False)
class Details:
    """Results of a request, by name."""

    drive: str  #: coordinate whose angle orders the turns
    drive_rate: float | None  #: mean turns a second [Hz]; None if the drive reverses
    spectra: dict[str, SignalSpectrum] = field(default_factory=dict)
    orders: dict[str, SignalSpectrum] = field(default_factory=dict)
    envelopes: dict[str, SignalSpectrum] = field(default_factory=dict)
    averages: dict[str, Average] = field(default_factory=dict)
    impacts: dict[str, ImpactDetails] = field(default_factory=dict)
    wear: dict[str, tuple[WearMap, WearMap]] = field(default_factory=dict)  #: bushing, pin
    deviations: dict[str, Beside] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Results as dictionaries, lists and numbers, in SI units."""
        return {
            'drive': self.drive,
            'drive_rate': self.drive_rate,
            **{
                kind: plain(getattr(self, kind))
                for kind in ('spectra', 'orders', 'envelopes', 'impacts')
            },
            'averages': {name: _average(a.turns, a.unit) for name, a in self.averages.items()},
            'wear': {
                name: {'bushing': plain(bushing), 'pin': plain(pin)}
                for name, (bushing, pin) in self.wear.items()
            },
            'deviations': {
                name: {
                    'rms': b.deviation.rms,
                    'own': _average(b.deviation.own, b.unit),
                    'ideal': _average(b.deviation.ideal, b.unit),
                    'against': b.against,
                    'alpha': plain(b.alpha),
                }
                for name, b in self.deviations.items()
            },
        }


def _average(turns: TurnSegments, unit: str) -> dict[str, Any]:
    columns = {'angle': turns.angle, 'mean': turns.mean, 'spread': turns.spread}
    count = len(turns.values) * turns.turns
    return {'unit': unit, 'turns': count, 'repetition': turns.turns, **plain(columns)}


def everything(record: Record, wanted: Wanted) -> Wanted:
    """Request for all analyses of a run: of each sensor and bearing."""
    sensors = [x for x in record.sampled_sensors if len(record.signal(x).longest) >= _FEWEST]
    joints = record.loose_joints
    turning = sensors if record.has_turns else ()
    return replace(
        wanted,
        spectra=sensors,
        orders=turning,
        envelopes=sensors,
        averages=turning,
        impacts=joints,
        wear=joints if record.machine.physics.has_forces else (),
    )


def find_details(
    record: Record, wanted: Wanted, against: Record | None = None,
    channels: Mapping[str, ChannelSamples] = MappingProxyType({}),
) -> Details:  # fmt: skip
    """Results of a request to a run.

    Parameters
    ----------
    against : another run, whose deviations the deviations are divided by
    channels : requested numbers in messages, besides signals of sensors, by name
    """
    skip = wanted.skip
    begin, rate = record.begin(skip), record.rate if record.has_turns else None
    turn = 1.0 / rate if rate else math.inf

    def signal(name: str) -> _Samples:
        if name in channels:
            return _samples_of(name, channels, begin)
        found = record.signal(name).since(begin)
        return _Samples(name, found.runs, found.rate, found.unit)

    return Details(
        record.machine.plan.main,
        rate,
        {name: _spectrum(signal(name)) for name in wanted.spectra},
        {
            name: SignalSpectrum(
                order_spectrum(record.over_turns(name, skip=skip)), record.unit(name)
            )
            for name in wanted.orders
        },
        {name: _envelope(signal(name), wanted.band, turn) for name in wanted.envelopes},
        {
            name: Average(_repetitions(record, name, skip), record.unit(name))
            for name in wanted.averages
        },
        {name: _impact_details(record, name, skip) for name in wanted.impacts},
        {
            name: wear_maps(record, name, pin_radius=wanted.pin_radius, skip=skip)
            for name in wanted.wear
        },
        {name: _beside(record, name, skip, against) for name in wanted.deviations},
    )


def channel_details(channels: Mapping[str, ChannelSamples], wanted: Wanted) -> Details:
    """Results of a request to a file of signals, without a machine."""
    of_runs = {
        'orders': wanted.orders, 'average': wanted.averages, 'impacts-on': wanted.impacts,
        'wear': wanted.wear, 'deviation': wanted.deviations,
    }  # fmt: skip
    if asked := next((name for name, given in of_runs.items() if given), None):
        raise InputError(
            f'--{asked} needs a run: a file of signals has --spectrum, --envelope and --plots'
        )

    of = _samples_of
    return Details(
        '', None, {name: _spectrum(of(name, channels)) for name in wanted.spectra},
        envelopes={name: _envelope(of(name, channels), wanted.band) for name in wanted.envelopes},
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Samples:
    """Samples of one signal, without a gap in each of the runs; refused where too few."""

    name: str
    runs: Sequence[Array]
    rate: float  #: [Hz]
    unit: str

    def __post_init__(self) -> None:
        if len(self.longest) < _FEWEST:
            raise InputError(
                f'the longest run of samples of {self.name} has {len(self.longest)} of them: a '
                f'spectrum needs at least {_FEWEST}'
            )

    @property
    def longest(self) -> Array:
        """The run with the most samples."""
        return max(self.runs, key=len)


def _samples_of(
    name: str, channels: Mapping[str, ChannelSamples], start: float = -math.inf
) -> _Samples:
    """Samples of an evenly sampled channel from a time [s] on."""
    check_known(name, channels, f"the file has no channel '{name}'", 'it has:')
    channel = channels[name].since(start)
    if channel.rate is None:
        gaps = np.diff(channel.times)
        raise InputError(
            f"channel '{name}' is sampled unevenly, every {gaps.min():.3g} s to "
            f'{gaps.max():.3g} s: it has no spectrum: take its values at even instants first, '
            'as by numpy.interp'
        )
    return _Samples(name, channel.runs, channel.rate, channel.unit)


def _spectrum(signal: _Samples) -> SignalSpectrum:
    lines, unit = power(signal.runs, signal.rate), signal.unit
    return SignalSpectrum(lines, f'({unit or 1})^2/Hz', signal_unit=unit)


def _repetitions(record: Record, name: str, skip: int) -> TurnSegments:
    """A quantity over as many turns as bring all again: two of a four-stroke engine."""
    again, turns = record.machine.drive.repetition.turns, record.over_turns(name, skip=skip)
    if (found := turns.together(again)) is None:
        raise InputError(
            f'{record.machine.name} is as before after {again} turns of '
            f'{record.machine.plan.main}: the run has no such turns, the first of them a multiple '
            f'of {again}'
        )
    return found


def _envelope(
    signal: _Samples, band: tuple[float, float] | None, turn: float = math.inf
) -> SignalSpectrum:
    """Envelope spectrum of a signal in a band [Hz], by default that of its shocks."""
    if band and not 0.0 <= band[0] < band[1] <= 0.5 * signal.rate:
        raise InputError(
            f'the band {band[0]:g} Hz to {band[1]:g} Hz does not lie between 0 and half the '
            f'sampling rate of {signal.name}, {0.5 * signal.rate:g} Hz'
        )
    samples = quickly_transformed(signal.longest)
    band = band or shock_band(samples, signal.rate, turn)
    found = envelope_spectrum(samples, signal.rate, band)
    share = band_share(samples, signal.rate, band)
    return SignalSpectrum(found, f'({signal.unit or 1})^2', band, share, signal.unit)


def _impact_details(record: Record, joint: str, skip: int) -> ImpactDetails:
    rose = impact_rose(record, joint, skip)
    return ImpactDetails(rose, impact_cycles(record, rose, skip) if record.has_turns else None)


def _beside(record: Record, quantity: str, skip: int, against: Record | None) -> Beside:
    own = deviation(record, quantity, skip=skip)
    if against is None:
        return Beside(own, record.unit(quantity))
    ratio = alpha(own, deviation(against, quantity, skip=skip))
    return Beside(own, record.unit(quantity), against.machine.name, ratio)
