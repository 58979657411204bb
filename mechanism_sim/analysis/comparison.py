"""Differences of two runs: impacts, peaks, energy, what sensors read; ideal beside worn."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mechanism_sim import text_table
from mechanism_sim.analysis.record import Record
from mechanism_sim.errors import InputError
from mechanism_sim.planar.play import joint_of_gap
from mechanism_sim.results.ranges import LoadPeaks
from mechanism_sim.sensing.indicators import indicators
from mechanism_sim.sensing.spectra import power
from mechanism_sim.strict_json import plain
from mechanism_sim.units import number

SEVERITY = 10.0, 1000.0
"""[Hz] Band of the severity of vibration: rms of the velocity, ISO 20816-1:2016, 4.3."""

_OCTAVES = 31.5, 63, 125, 250, 500, 1000, 2000, 4000, 8000, 16000  # [Hz] IEC 61260-1, nominal


@dataclass(frozen=True)
class Difference:
    """A figure of both runs, in SI units; nan in the run that has no such thing."""

    subject: str
    name: str
    unit: str
    first: float
    second: float

    @property
    def change(self) -> float:
        """Second less first."""
        return self.second - self.first

    @property
    def ratio(self) -> float:
        """Second over first; not a number where the first is 0."""
        return self.second / self.first if self.first else math.nan


def compare(first: Record, second: Record) -> list[Difference]:
    """Differences of two runs, each all over its own length."""
    one, two = _figures(first), _figures(second)
    if not any(key in two for key in one if key[1]):
        raise InputError(
            f'{first.machine.name} and {second.machine.name} have no joint, drive or sensor of '
            'the same name: there is nothing to compare'
        )
    impacts = bool(first.piece.impacts or second.piece.impacts)
    found = []
    for key in {**one, **two}:
        subject, _, _, unit = key
        # a machine without play, or in which nothing strikes, has none, rather than unknown ones
        missing = 0.0 if subject == 'impacts' else math.nan
        if subject != 'impacts' or impacts:
            name = ' '.join(x for x in key[1:3] if x)
            found.append(
                Difference(subject, name, unit, one.get(key, missing), two.get(key, missing))
            )
    order = list(dict.fromkeys(d.subject for d in found))
    return sorted(found, key=lambda d: order.index(d.subject))


Key = tuple[str, str, str, str]
"""Subject, of what, which figure, unit."""


def _figures(record: Record) -> dict[Key, float]:
    return {**_impacts(record), **_peaks(record), **_energy(record), **dict(_sensors(record))}


def _impacts(record: Record) -> dict[Key, float]:
    """Of all joints together, and of each that is struck."""
    found: dict[Key, float] = {}
    turns = math.nan
    if not record.slides:
        first, last = record.turned(np.array([record.start, record.end])).tolist()
        turns = abs(last - first)
    mechanism = record.machine.mechanism
    gaps = {i.joint for i in record.piece.impacts}
    of_gap = {gap: joint_of_gap(mechanism, gap).name for gap in gaps}
    for joint in ('', *sorted(set(of_gap.values()))):
        own = [i for i in record.piece.impacts if joint in ('', of_gap[i.joint])]
        found['impacts', joint, 'count', ''] = float(len(own))
        if not joint and turns > 0.0:
            found['impacts', joint, 'count per turn', ''] = len(own) / turns
        normal = [i.normal_impulse for i in own]
        found['impacts', joint, 'hardest', 'N s'] = max(normal, default=0.0)
        found['impacts', joint, 'sum of impulses', 'N s'] = math.fsum(normal)
        found['impacts', joint, 'energy loss', 'J'] = math.fsum(i.energy_loss for i in own)
        speed = max((i.approach_speed for i in own), default=0.0)
        found['impacts', joint, 'fastest approach', 'm/s'] = speed
    return found


def _peaks(record: Record) -> dict[Key, float]:
    """The largest force in each joint and effort of each drive, between impacts, and how long."""
    peaks = LoadPeaks(record.machine, record.start, shapes=True)
    peaks.add(record.piece.motion)
    straight = record.piece.physics.displacements
    found = {
        ('peaks', joint, 'largest force', 'N'): peak.value for joint, peak in peaks.forces.items()
    }
    for drive, peak in peaks.torques.items():
        word, unit = ('force', 'N') if drive in straight else ('torque', 'N m')
        found['peaks', drive, f'largest {word} of the drive', unit] = abs(peak.value)
    for name, shape in peaks.shapes().items():
        if shape.whole:
            of = name.partition('.')[2].removesuffix('.size')
            found['peaks', of, 'above half of it for', 's'] = shape.duration
    return found


def _energy(record: Record) -> dict[Key, float]:
    physics = record.piece.physics
    if not physics.has_forces:
        return {}
    samples = record.piece.view(np.array([record.start, record.end]))
    return {
        ('energy', '', word, 'J'): float(values[-1] - values[0])
        for word, values in (
            ('work of drives', samples.drive_work), ('dissipated', samples.dissipated)
        )
    }  # fmt: skip


def _sensors(record: Record) -> Iterator[tuple[Key, float]]:
    """Indicators, severity and octave bands of each sensor."""
    for name in record.sampled_sensors:
        signal = record.signal(name)
        seen = indicators(np.concatenate(signal.runs))
        for word, value, unit in (
            ('rms', seen.rms, signal.unit), ('peak', seen.peak, signal.unit),
            ('crest factor', seen.crest, ''), ('kurtosis', seen.kurtosis, ''),
        ):  # fmt: skip
            yield ('sensors', name, word, unit), math.nan if value is None else value
        spectrum = power(signal.runs, signal.rate, len(signal.longest))
        f, energy = spectrum.frequency, spectrum.values * spectrum.step
        if signal.unit == 'm/s^2':
            inside = (f >= SEVERITY[0]) & (f <= SEVERITY[1])
            speed = energy[inside] / (2.0 * np.pi * f[inside]) ** 2
            yield ('severity', name, 'velocity, rms', 'm/s'), math.sqrt(speed.sum())
        edges = 1000.0 * 2.0 ** (np.arange(len(_OCTAVES) + 1) - 5.5)
        for middle, (low, high) in zip(_OCTAVES, pairwise(edges), strict=True):
            if f[1] < low and high <= 0.5 * signal.rate:
                part = energy[(f >= low) & (f < high)].sum()
                yield ('spectra', name, f'octave at {middle:g} Hz', signal.unit), math.sqrt(part)


def to_json(found: list[Difference]) -> list[dict[str, object]]:
    """SI units; what is not known is null."""
    return [plain(d) | plain({'change': d.change, 'ratio': d.ratio}) for d in found]


def render(found: list[Difference], names: tuple[str, str]) -> str:
    """For people: a row for each figure."""
    rows = [['', '', 'unit', *names, 'change', 'ratio']]
    rows += [[d.subject, d.name, d.unit, *texts(d)] for d in found]
    return '\n'.join(text_table.lines(rows, left=3, indent=''))


def texts(d: Difference) -> Iterator[str]:
    """First, second, change and ratio as they are printed."""
    for x, sign in ((d.first, ''), (d.second, ''), (d.change, '+'), (d.ratio, '')):
        yield number(x, 4, sign) if math.isfinite(x) else '–'
