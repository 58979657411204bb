"""Differences of runs: keys of their scenes, impacts, peaks, energy, signals of sensors."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from mechanism_sim import text_table
from mechanism_sim.analysis.collectors import Signal
from mechanism_sim.analysis.record import Record
from mechanism_sim.errors import InputError
from mechanism_sim.planar.gaps import joint_of_gap
from mechanism_sim.results.ranges import LoadPeaks
from mechanism_sim.scene.facts import as_written
from mechanism_sim.scene.schema import Scene
from mechanism_sim.sensing.indicators import indicators
from mechanism_sim.sensing.spectra import LineSpectrum, power, severity, severity_spectrum
from mechanism_sim.strict_json import plain
from mechanism_sim.units import for_people, given, number

_BRIEF = 48  # letters of the name of a run
_FEW = 32  # lines below a band
_NONE = '–'
_ROUNDING = 1e-12  # share of the greatest of its kind, as for a cycle
_OCTAVES = 31.5, 63, 125, 250, 500, 1000, 2000, 4000, 8000, 16000  # [Hz] IEC 61260-1, nominal


@dataclass(frozen=True)
class Difference:
    """A figure of all runs, in SI units; nan in a run that has no such thing."""

    subject: str
    name: str
    unit: str
    values: tuple[float, ...]

    @property
    def change(self) -> float:
        """Second less first."""
        return self.values[1] - self.values[0]

    @property
    def ratio(self) -> float:
        """Second over first; not a number where the first is 0."""
        return self.values[1] / self.values[0] if self.values[0] else math.nan


def compare(*records: Record) -> list[Difference]:
    """Differences of runs, each all over its own length."""
    figures = [
        {**_impacts(record), **_peaks(record), **_energy(record), **dict(_sensors(record))}
        for record in records
    ]
    for record, own in zip(records[1:], figures[1:], strict=True):
        if not any(key in own for key in figures[0] if key[1]):
            raise InputError(
                f'{records[0].machine.name} and {record.machine.name} have no joint, drive or '
                'sensor of the same name: there is nothing to compare'
            )
    impacts = any(record.piece.impacts for record in records)
    found = []
    for key in dict.fromkeys(key for own in figures for key in own):
        subject, _, _, unit = key
        # without clearance or impacts there are none, rather than unknown ones
        missing = 0.0 if subject == 'impacts' else math.nan
        if subject != 'impacts' or impacts:
            name = ' '.join(x for x in key[1:3] if x)
            values = tuple(own.get(key, missing) for own in figures)
            found.append(Difference(subject, name, unit, values))
    order = list(dict.fromkeys(d.subject for d in found))
    return sorted(found, key=lambda d: order.index(d.subject))


Key = tuple[str, str, str, str]
"""Subject, of what, which figure, unit."""


def _impacts(record: Record) -> dict[Key, float]:
    """Figures of the impacts of all joints together, and of each joint with impacts."""
    found: dict[Key, float] = {}
    turns = math.nan
    if not record.slides:
        first, last = record.turned(np.array([record.start, record.end])).tolist()
        turns = abs(last - first)
    mechanism = record.machine.mechanism
    struck = record.piece.impacts
    of_gap = {gap: joint_of_gap(mechanism, gap).name for gap in set(struck.names.tolist())}
    for joint in ('', *sorted(set(of_gap.values()))):
        gaps = [gap for gap, name in of_gap.items() if joint in ('', name)]
        own = struck.where(np.isin(struck.names, gaps))
        found['impacts', joint, 'count', ''] = float(len(own))
        if not joint and turns > 0.0:
            found['impacts', joint, 'count per turn', ''] = len(own) / turns
        normal = own.column('normal_impulse')
        found['impacts', joint, 'hardest', 'N s'] = float(normal.max(initial=0.0))
        found['impacts', joint, 'sum of impulses', 'N s'] = math.fsum(normal)
        found['impacts', joint, 'energy loss', 'J'] = math.fsum(own.column('energy_loss'))
        speed = own.column('approach_speed').max(initial=0.0)
        found['impacts', joint, 'fastest approach', 'm/s'] = float(speed)
    return found


def _peaks(record: Record) -> dict[Key, float]:
    """The largest force of each joint and effort of each drive, between impacts; durations."""
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
    works = {'work of drives': samples.drive_work, 'dissipated': samples.dissipated}
    held = samples.observed.kinetic_energy, samples.observed.potential_energy
    nothing = _ROUNDING * float(np.nanmax(np.abs([*held, *works.values()])))
    amounts = {word: float(values[-1] - values[0]) for word, values in works.items()}
    return {('energy', '', w, 'J'): 0.0 if abs(x) <= nothing else x for w, x in amounts.items()}


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
        # segments that overlap weigh all of the run alike, which one window of its length does not
        faded = power(signal.runs, signal.rate)
        turns = _of_whole_turns(record, signal)
        whole = turns or power(signal.runs, signal.rate, len(signal.longest))
        if signal.unit == 'm/s^2':
            known = turns or severity_spectrum(signal.runs, signal.rate)
            yield ('severity', name, 'velocity, rms', 'm/s'), severity(known)
        edges = 1000.0 * 2.0 ** (np.arange(len(_OCTAVES) + 1) - 5.5)
        for middle, (low, high) in zip(_OCTAVES, pairwise(edges), strict=True):
            # under Hann's window an order lies on three lines, of which a low band may lose one
            lines = whole if low < _FEW * faded.step else faded
            f = lines.frequency
            if f[1] < low and high <= 0.5 * signal.rate:
                part = lines.values[(f >= low) & (f < high)].sum() * lines.step
                yield ('spectra', name, f'octave at {middle:g} Hz', signal.unit), math.sqrt(part)


def _of_whole_turns(record: Record, signal: Signal) -> LineSpectrum | None:
    """Spectrum of turns that bring all again: an order lies on one line. None without any."""
    machine, drive, x = record.machine, record.machine.drive, signal.longest
    if record.slides or machine.torque_driven or drive.commands or not drive.steady:
        return None
    span = drive.repetition.turns * drive.period * signal.rate
    whole = int((len(x) + 0.5) / span)
    if not whole:  # as for a drive at rest
        return None
    x = x[: round(span * whole)]
    return power([x], signal.rate, len(x), 'boxcar')


def to_json(found: Sequence[Difference]) -> list[dict[str, object]]:
    """SI units; what is not known is null. Of two runs with change and ratio."""
    rows = []
    for d in found:
        row = {'subject': d.subject, 'name': d.name, 'unit': d.unit}
        if len(d.values) == 2:
            pair = {'first': d.values[0], 'second': d.values[1]}
            rows.append(plain({**row, **pair, 'change': d.change, 'ratio': d.ratio}))
        else:
            rows.append(plain({**row, 'values': d.values}))
    return rows


def render(found: Sequence[Difference], names: Sequence[str]) -> str:
    """Format the differences as a text table with a row for each figure."""
    rows = [['', '', 'unit', *names, *(['change', 'ratio'] if len(names) == 2 else [])]]
    rows += [[d.subject, d.name, *texts(d)] for d in found]
    return '\n'.join(text_table.lines(rows, left=3, indent=''))


def texts(d: Difference) -> Iterator[str]:
    """Unit, values, and of two change and ratio, as they are printed."""
    known = [abs(x) for x in d.values if math.isfinite(x)]
    unit, scale = for_people(d.unit, max(known, default=0.0))
    yield unit
    pair = [(d.change, scale, '+'), (d.ratio, 1.0, '')] if len(d.values) == 2 else []
    for x, by, sign in (*((x, scale, '') for x in d.values), *pair):
        yield number(by * x, 4, sign) if math.isfinite(x) else _NONE


def scene_differences(scenes: Sequence[Scene]) -> dict[str, tuple[str, ...]]:
    """Values, as written, of keys that differ between scenes, by path."""
    leaves = [dict(_leaves(as_written(scene))) for scene in scenes]
    found = {}
    for path in dict.fromkeys(path for own in leaves for path in own):
        values = tuple(own.get(path, _NONE) for own in leaves)
        if len(set(values)) > 1 and path not in ('title', 'description'):
            found[path] = values
    return found


def run_names(found: Mapping[str, tuple[str, ...]], sources: Sequence[str]) -> tuple[str, ...]:
    """Names of runs by what differs in their scenes; by their sources where that is much.

    So where a scene has no value of a key, as an ideal joint has no clearance.
    """
    brief = [', '.join(f'{_last(path)} {values[k]}' for path, values in found.items())
             for k in range(len(sources))]  # fmt: skip
    lacking = any(_NONE in values for values in found.values())
    for names in (sources, brief) if lacking else (brief, sources):
        if all(names) and len(set(names)) == len(names) and max(map(len, names)) <= _BRIEF:
            return tuple(names)
    return tuple(f'run {k + 1}' for k in range(len(sources)))


def _last(path: str) -> str:
    return path.rpartition('.')[2].replace('_', ' ')


def _leaves(value: Any, path: str = '') -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _leaves(item, f'{path}.{key}' if path else str(key))
        return
    yield path, given(value) if isinstance(value, str) else str(value)
