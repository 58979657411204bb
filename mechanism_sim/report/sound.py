"""Sound of a run as a WAV file, with a description."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import wavfile

from mechanism_sim import output
from mechanism_sim.errors import InputError
from mechanism_sim.sensing.sound import Listener, Strike, level, pressure

RATE = 44100  #: [Hz] of the file
TAIL = 0.1  # [s] of the file, after the run


@dataclass(frozen=True)
class Sound:
    """A sound that was written.

    impacts: that are heard; peak: largest pressure [Pa], which is full scale in the file;
    peak_level: its level [dB re 20 uPa]; mean_level: of the whole run [dB re 20 uPa];
    realtime_factor: seconds of the machine in a second of sound; duration: of the file [s].
    """

    file: str
    impacts: int
    peak: float
    peak_level: float
    mean_level: float
    realtime_factor: float
    duration: float


def write(
    train: Sequence[Strike],
    end: float,
    file: Path,
    listener: Listener,
    pulse: float | None = None,
    realtime_factor: float = 1.0,
) -> Sound:
    """Write the sound of impacts, 16 bit at 44.1 kHz, its peak at full scale.

    Parameters
    ----------
    train : impacts of a run that lasts up to `end` [s]
    pulse : [s], see `mechanism_sim.sensing.sound.pressure`
    realtime_factor : 0.25 plays a second of the machine in 4 s
    """
    if not realtime_factor > 0.0:
        raise InputError(f'--realtime-factor {realtime_factor:g}: must be more than 0')
    rate = RATE / realtime_factor  # samples in a second of the machine
    p = pressure(train, rate, end + TAIL * realtime_factor, listener, pulse)
    peak = float(np.abs(p).max())
    if peak == 0.0:
        raise InputError('there is no sound: the run has no impacts')
    with output.beside(file) as part:
        wavfile.write(part, RATE, np.round(p * (32767.0 / peak)).astype(np.int16))
    mean = float(np.sqrt((p**2).sum() / (rate * end)))  # what follows is still of its impacts
    levels = level(peak), level(mean)
    return Sound(str(file), len(train), peak, *levels, realtime_factor, len(p) / RATE)


def render(sound: Sound) -> str:
    """Text on the written sound."""
    factor = sound.realtime_factor
    pace = f', at {factor:g} times real time' if factor != 1.0 else ''
    return (
        f'{sound.file}: {sound.duration:.3g} s{pace}\n'
        f'impacts    {sound.impacts}\n'
        f'peak       {sound.peak:.3g} Pa ({sound.peak_level:.1f} dB), full scale in the file\n'
        f'mean       {sound.mean_level:.1f} dB over the run'
    )
