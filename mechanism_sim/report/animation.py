"""A recorded or simulated run as a film: the machine moving, and a bearing under a lens."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mechanism_sim.analysis.record import Record
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.report import figures
from mechanism_sim.report.screen import FilmParts, Screen
from mechanism_sim.report.video import Target

_TURN = 3.0  # [s] of film for a turn of the drive
_WHOLE = 6.0  # [s] of film for a run without turns
_MOST = 20_000  # frames


@dataclass(frozen=True)
class Film:
    """Film to be written: so many frames of a part of a run.

    Attributes
    ----------
    t : (N,) [s] of the frames
    start, end : [s] of the run; the frame at the end is left out, so that turns go on and on
    speed : simulated seconds in a second of film
    fps : frames a second
    """

    target: Target
    record: Record
    t: Array
    start: float
    end: float
    speed: float
    fps: float

    def write(
        self,
        shown: FilmParts,
        size: int | tuple[int, int] | None = None,
        show: Callable[[int, int], None] = lambda *_: None,
    ) -> tuple[list[Path], tuple[int, int]]:
        """Make and write all frames; gives back the files, and the size of frames [pixels].

        Parameters
        ----------
        size : longer side, or width and height [pixels]
        show : called after each frame with their number, and 0
        """
        with figures.style():
            screen = Screen(self.record, self.t, shown, self.speed, size or self.target.usual_size)
            with self.target.writing(screen.figure, self.fps, len(self.t)) as grab:
                for i in screen.frames():
                    grab()
                    show(i + 1, 0)
        return self.target.files, screen.size


def film(
    record: Record, target: Target, start: float | None = None, end: float | None = None,
    fps: float | None = None, speed: float | None = None,
) -> Film:  # fmt: skip
    """Choose the instants of a film.

    Parameters
    ----------
    start, end : [s] of the run; all of it unless told
    fps : frames a second
    speed : simulated seconds in a second of film; unless told a turn of the drive takes 3 s, or a
        run that has none 6 s
    """
    start, end = record.part(start, end)
    fps = target.usual_rate if fps is None else fps
    for name, value in (('frames a second', fps), ('speed', speed)):
        if value is not None and not (value > 0.0 and math.isfinite(value)):
            raise InputError(f'the {name} of a film must be positive and finite, not {value:g}')
    target.check_rate(fps)
    speed = speed or _pace(record, end - start)
    count = max(1, math.ceil((end - start) / speed * fps - 1e-6))
    if count > _MOST:
        raise InputError(
            f'that would be {count} frames, more than {_MOST}: choose a shorter part of the run, '
            f'or a greater speed than {speed:.3g}'
        )
    t = np.clip(start + np.arange(count) * (speed / fps), record.start, record.end)
    return Film(target, record, t, start, end, speed, fps)


def _pace(record: Record, length: float) -> float:
    """Simulated seconds in a second of film that show a turn, or a part without turns, well."""
    turns = 0.0 if record.slides else record.rate * (record.end - record.start)
    return 1.0 / (_TURN * record.rate) if turns > 0.9 else length / _WHOLE
