"""Measured signals in files: instants, values and unit of a channel.

=========  ==================================================================================
``.csv``   a column of time (``t``, ``time``, ``stamp_ns``) and channels, with units in brackets,
           after a slash or at the ends of names; cells that are empty are samples that are missing
``.txt``   the same
``.wav``   channels ``1``, ``2``, parts of the full scale, which must be given of whole numbers
``.uff``   data sets 58 that are functions of time (also ``.unv``), by ``pyuff``
``.tdms``  channels ``GROUP/CHANNEL``, scaled as the file says, by ``npTDMS``
=========  ==================================================================================

Instants are those of the file: they may be uneven.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any
from warnings import catch_warnings, filterwarnings, simplefilter

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.csv_tables import CsvTable, assume, named_unit, read_csv
from mechanism_sim.errors import InputError, check_known, nearest_file, quoted
from mechanism_sim.output import path_of
from mechanism_sim.packages import needed
from mechanism_sim.tables import ENDINGS
from mechanism_sim.units import QuantityValue, parted, to_si

_LARGER = 128  # as tables of scenes
_SHOWN = 300  # characters in a sentence
_TIMES = 't', 'time', 'times', 'timestamp', 'stamp', 'x-axis', 'zeit'
_JITTER = 1e-3
"""Share of the sampling interval by which evenly taken samples are off in a file."""
_COARSEST = 0.2
"""Share of that interval to which times may be rounded: else samples coincide."""
_DIGITS = re.compile(r'[-+]?\d*(?:\.(\d*))?(?:[eE]([-+]?\d+))?')
_DATE = re.compile(r'\s*(\d{1,4}([-/. ])(\d{1,2}|[A-Za-z]{3,9})\2\d{1,4}(?!\d)|\d{1,2}:\d\d)')
_LOOKS = 1000  # cells in which digits are counted
GRAVITY = QuantityValue(9.80665, 'm/s^2')
GRAVITIES = 'g', 'gn', 'g_0'
"""Units of acceleration in g; 'g' is a gram otherwise."""
_PURPOSE = 'this kind of signal'


@dataclass(frozen=True, eq=False)
class ChannelSamples:
    """A channel of a file.

    Attributes
    ----------
    name : name of the channel
    times : (N,) [s], rising
    values : (N,) in `unit`
    unit : as the file has it; empty if it has none
    digit : last printed place of times [s]; 0 if they are not printed
    """

    name: str
    times: Array
    values: Array
    unit: str = ''
    digit: float = 0.0

    @property
    def rate(self) -> float | None:
        """Sampling rate [Hz], of which samples may be missing; None if it is uneven."""
        return self._sampling[0]

    @property
    def rate_error(self) -> float | None:
        """Uncertainty of the rate [Hz], if times are rounded by more than their jitter."""
        return self._sampling[1]

    @cached_property
    def _sampling(self) -> tuple[float | None, float | None]:
        gaps, count = np.diff(self.times), self._intervals
        mean = float(gaps.sum() / count.sum()) if count.sum() else 0.0
        if not mean or not count.all():  # or two samples at one time, but for rounding
            return None, None
        if np.abs(gaps - count * mean).max() <= _JITTER * mean:
            return 1.0 / mean, None
        # all may be off by half a digit, the first and the last, between which the grid lies, too
        rounded = self.digit + 2.0 * float(np.spacing(np.abs(self.times).max()))
        grid = self.times[0] + mean * np.append(0.0, np.cumsum(count))
        if rounded > _COARSEST * mean or np.abs(self.times - grid).max() > rounded:
            return None, None
        return 1.0 / mean, rounded / (mean * (self.times[-1] - self.times[0]))

    @property
    def missing(self) -> int:
        """Samples that are missing between others, at an even rate."""
        return int((self._intervals - 1.0).sum()) if self.rate else 0

    @property
    def runs(self) -> list[Array]:
        """Values between which none is missing."""
        return np.split(self.values, np.flatnonzero(self._intervals > 1.0) + 1)

    @property
    def parted(self) -> tuple[Array, Array]:
        """Times and values, with one that is not a number wherever samples are missing."""
        if not self.missing:
            return self.times, self.values
        before = np.flatnonzero(self._intervals > 1.0)
        times = np.insert(self.times, before + 1, self.times[before])
        return times, np.insert(self.values, before + 1, np.nan)

    @property
    def _intervals(self) -> Array:
        """Numbers of sampling intervals between samples (N - 1,): 1 where none is missing."""
        gaps = np.diff(self.times)
        if not len(gaps):
            return gaps
        # the median of rounded gaps is one of them, their mean is not
        median = np.median(gaps)
        single = gaps[np.rint(gaps / median) == 1.0]
        return np.rint(gaps / (single.mean() if len(single) else median))

    def since(self, t: float) -> ChannelSamples:
        """The samples from a time [s] on."""
        later = self.times >= t
        return replace(self, times=self.times[later], values=self.values[later])

    def in_unit(self, unit: str) -> Array:
        """Values (N,) in an SI unit; those without a unit are in it already."""
        known = self.unit
        if known in GRAVITIES and unit == GRAVITY.unit:
            return GRAVITY.value * self.values
        if not known:
            return self.values
        try:
            return to_si(f'1 {known}', unit) * self.values
        except (ValueError, KeyError) as error:
            raise InputError(f"channel '{self.name}' is in '{known}', but '{unit}' is measured: "
                             'write its unit in the file') from error  # fmt: skip


def rate_text(rate: float | None, error: float | None) -> str:
    """A rate of sampling [Hz] to the digits that are known, of which an error tells."""
    if rate is None:
        return 'uneven'
    if not error:
        return f'{rate:.6g}'
    return f'{rate:.{max(0, math.ceil(-math.log10(error)))}f} +- {error:.1g}'


def choose(
    path: Path | str, found: Mapping[str, ChannelSamples], channel: str | None
) -> ChannelSamples:
    """A channel of those of a file, or the only one."""
    if channel is None and len(found) > 1:
        raise InputError(
            f'{path} has several channels ({", ".join(found)}): choose one by --channel'
        )
    name = channel or next(iter(found))
    check_known(name, found, f"{path} has no channel '{name}'", 'it has:')
    return found[name]


def read_signals(
    path: Path | str, full_scale: str = '', scaled: bool = True, rate: str = ''
) -> dict[str, ChannelSamples]:
    """All channels of a file by name.

    Parameters
    ----------
    full_scale : quantity with a unit of the largest number of a WAV, as ``'50 m/s^2'``
    scaled : True if whole numbers of a WAV are refused without it
    rate : quantity with a unit of a table without times, as ``'12 kHz'``
    """
    path = path_of(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f'{path} is no file of signals: expected {", ".join(READERS)}')
    if not path.is_file():
        raise InputError(f'{path} does not exist{nearest_file(path, [*READERS])}')
    if full_scale and reader is not _wav:
        raise InputError(f'{path} has units of its own: a full scale is for WAV')
    rated = reader in (_table, _tdms)
    if rate and not rated:
        raise InputError(f'{path} has times of its own: a sampling rate is for tables without')
    channels = (
        reader(path, full_scale, scaled) if reader is _wav
        else reader(path, rate) if rated
        else reader(path)
    )  # fmt: skip
    found = {c.name: checked(path, c) for c in channels}
    if not found:
        raise InputError(f'{path} has no channel that is a function of time')
    return found


def is_signal_file(path: Path | str) -> bool:
    """True if a file is of a kind that `read_signals` reads, by its ending."""
    return Path(path).suffix.lower() in READERS


def refuse_signals(path: Path | str, kind: str) -> None:
    """Refuse a file of signals, or another table, where another `kind` is wanted."""
    if is_signal_file(path) and path_of(path).is_file():
        table = kind == 'scene' and path_of(path).suffix.lower() == '.csv'
        joints = ", and 'mechanism-sim import' makes a scene of a table of joints" if table else ''
        raise InputError(
            f"'{path}' is a file of signals, not a {kind}: 'mechanism-sim analyze' and "
            f"'mechanism-sim plot' read it{joints}"
        )


def checked(path: Path, channel: ChannelSamples) -> ChannelSamples:
    """The channel without samples that are missing; InputError if its times do not rise."""
    t, y = (np.asarray(x, dtype=float).ravel() for x in (channel.times, channel.values))
    known = np.isfinite(t) & np.isfinite(y)
    t, y = t[known], y[known]
    if len(t) < 2:
        raise InputError(f"{path}: channel '{channel.name}' has {len(t)} samples: at least 2 are "
                         'needed')  # fmt: skip
    if back := np.flatnonzero(np.diff(t) <= 0.0).tolist():
        raise InputError(f"{path}: times of channel '{channel.name}' must increase, but "
                         f'{t[back[0] + 1]:.15g} s follows {t[back[0]]:.15g} s')  # fmt: skip
    return replace(channel, times=t, values=y)


def _table(path: Path, rate: str = '') -> list[ChannelSamples]:
    table = read_csv(path, 'signal', _LARGER)
    named = {c: named_unit(c.lower(), ['s']) for c in table.cells}
    bare = {c: c.lower().removesuffix(f'_{unit}') for c, unit in named.items()}
    exact = (c for c in named if c.lower() in _TIMES)
    time = next(exact, next((c for c in named if bare[c] in _TIMES), None))
    if time is None and not rate:
        single = ', '.join(f'{name} = {x:g}' for name, x in table.single.items())[:_SHOWN]
        raise InputError(
            f"{table.where} has no column of time: name one 't [s]', or give --sample-rate, as "
            f"'12 kHz'; its first line is {quoted(table.heading)}"
            f'{f", its single numbers are {single}" if single else ""}'
        )
    if time is None:
        t, digit = np.arange(len(table.lines)) / _of_rate(rate), 0.0
    else:
        t, digit = _times(table, time, table.units[time] or named[time])
        if rate:
            raise InputError(f"{table.where} has times in '{time}': leave out --sample-rate")
    return [
        ChannelSamples(
            name, t, table.numbers(name, gaps=True)[:, 0], unit or _unit_of(name), digit
        )
        for name, unit in table.units.items()
        if name != time and not table.is_text(name)  # but labels
    ]


def _of_rate(text: str) -> float:
    try:
        rate = to_si(text, 'Hz')
    except ValueError as error:
        raise InputError(f"--sample-rate '{text}' {error}") from error
    if not 0.0 < rate < np.inf:
        raise InputError(f"--sample-rate '{text}' must be positive")
    return rate


def _times(table: CsvTable, time: str, unit: str) -> tuple[Array, float]:
    """Times of the samples, and the size of their last digit [s]."""
    _refuse_dates(str(next(iter(table.column(time)), '')), f"{table.where}: column '{time}'")
    if not unit:
        assume(f"{table.where}: column '{time}' has no unit: it is read in seconds")
    try:
        seconds = to_si(f'1 {unit or "s"}', 's')
    except ValueError as error:
        raise InputError(f"{table.where}: column '{time}' {error}") from error
    return seconds * table.numbers(time)[:, 0], seconds * _last_digit(table.column(time))


def _last_digit(cells: Sequence[str] | Array) -> float:
    """One of the last place of numbers as they are printed; zeros there may be left out.

    Those that are not printed have none.
    """
    if isinstance(cells, np.ndarray):
        return 0.0
    some = cells[:: max(1, len(cells) // _LOOKS)]
    found = [x for x in map(_DIGITS.fullmatch, map(str.strip, some)) if x]
    return min((10.0 ** (int(x[2] or 0) - len(x[1] or '')) for x in found), default=0.0)


def _unit_of(name: str) -> str:
    """The unit that a name ends with; of a quantity's, as ``position.bar_W``, none is told."""
    return '' if '.' in name else named_unit(name)


def _refuse_dates(first: str, where: str) -> None:
    """Refuse dates and times of day as times of samples, by the first of them."""
    if _DATE.match(first):
        raise InputError(
            f"{where} has dates, as '{first.strip()}': write seconds from the first sample, or "
            "from the start of the machine, on, with the heading 't [s]'"
        )


def _wav(path: Path, full_scale: str, scaled: bool) -> list[ChannelSamples]:
    from scipy.io import wavfile  # noqa: PLC0415 - slow to load

    try:
        with catch_warnings():
            simplefilter('ignore', wavfile.WavFileWarning)  # of chunks that are no samples
            filterwarnings('error', '.*EOF', wavfile.WavFileWarning)
            rate, data = wavfile.read(path)
    except wavfile.WavFileWarning as error:
        raise InputError(f'{path} cannot be read: it ends before its last sample') from error
    except (ValueError, OSError, struct.error) as error:
        raise InputError(f'{path} cannot be read: {error}') from error
    values, unit = np.atleast_2d(data.T).astype(float), ''
    whole = data.dtype.kind in 'iu'
    if (whole and scaled) or full_scale:
        number, unit = parted(full_scale) or ('', '')
        largest = float(number) if unit else np.nan
        if not 0.0 < largest < np.inf:
            what = f"not '{full_scale}'" if full_scale else 'as it has whole numbers'
            raise InputError(f"{path}: give what the largest number is, {what}: write for example "
                             "--full-scale '50 m/s^2'")  # fmt: skip
        bits = 8 * data.dtype.itemsize if whole else 1  # of floats the largest is 1
        middle = 2.0 ** (bits - 1) if data.dtype.kind == 'u' else 0.0
        values = (values - middle) * (largest / 2.0 ** (bits - 1))
    t = np.arange(values.shape[1]) / rate
    return [ChannelSamples(str(k + 1), t, y, unit) for k, y in enumerate(values)]


def _uff(path: Path) -> list[ChannelSamples]:
    pyuff = needed('pyuff', _PURPOSE)
    try:
        sets = pyuff.UFF(str(path)).read_sets()
    except Exception as error:  # it raises whatever a broken line leads to
        raise InputError(f'{path} cannot be read: {error}') from error
    found: list[ChannelSamples] = []
    for k, one in enumerate(sets if isinstance(sets, list) else [sets]):
        time = one.get('abscissa_spec_data_type') in (0, 17) and not np.iscomplexobj(one['data'])
        if one.get('type') == 58 and one.get('func_type') in (0, 1) and time:
            name = str(one.get('id1', '')).strip()
            name = name if name and name != 'NONE' else str(one.get('rsp_ent_name', '')).strip()
            taken = {c.name for c in found}
            name = name if name and name not in taken else f'{name or "set"} {k + 1}'
            unit = str(one.get('ordinate_axis_units_lab', '')).strip()
            unit = '' if unit in ('NONE', 'NO_UNITS') else unit
            found.append(ChannelSamples(name, one['x'], one['data'], unit))
    return found


def _tdms(path: Path, rate: str = '') -> list[ChannelSamples]:
    nptdms = needed('nptdms', _PURPOSE)
    try:
        groups = nptdms.TdmsFile.read(path).groups()
        return [c for group in groups for c in _tdms_group(path, group, rate)]
    except InputError:
        raise
    except Exception as error:  # it raises whatever a broken file leads to
        raise InputError(f'{path} cannot be read: {error}') from error


def _tdms_group(path: Path, group: Any, rate: str) -> list[ChannelSamples]:
    """Channels with a waveform's interval, beside a channel of time, or of a given rate."""
    time = next((c for c in group.channels() if c.name.lower() in _TIMES), None)
    if time is not None and len(time):
        _refuse_dates(str(time[0]), f"{path}: channel '{time.name}'")
    found = []
    for c in group.channels():
        if c is time or not len(c) or np.asarray(c[:]).dtype.kind not in 'iuf':
            continue
        t = (
            c.time_track() if c.properties.get('wf_increment')
            else time[:] if time is not None and len(time) == len(c)
            else None
        )  # fmt: skip
        if rate and t is not None:
            raise InputError(f"{path}: channel '{c.name}' has times: leave out --sample-rate")
        if not rate and t is None:
            raise InputError(
                f"{path}: channel '{c.name}' has neither an interval (wf_increment) nor a channel "
                "of time beside it: give --sample-rate, as '12 kHz'"
            )
        if t is None:
            t = np.arange(len(c)) / _of_rate(rate)
        unit = str(c.properties.get('unit_string', '')).strip()
        found.append(ChannelSamples(f'{group.name}/{c.name}', t, c[:], unit))
    return found


READERS: dict[str, Callable[..., list[ChannelSamples]]] = {
    '.csv': _table, '.txt': _table, '.wav': _wav, '.uff': _uff, '.unv': _uff, '.tdms': _tdms,
    **dict.fromkeys(ENDINGS, _table),
}  # fmt: skip
"""Readers by the ending of a file."""
