"""Films: their instants, and the files they go to: MP4 by ffmpeg, GIF by Pillow, numbered SVG."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from subprocess import CalledProcessError
from typing import Any, cast

import matplotlib as mpl
import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter
from PIL import Image

from mechanism_sim import output
from mechanism_sim.analysis.record import Record
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.export.palette import ACCENT, GROUND, LINKS, rgb
from mechanism_sim.packages import needed
from mechanism_sim.report import figures
from mechanism_sim.report.screen import DENSITY, FilmParts, Screen

_TURN = 3.0  # [s] of film for a turn of the drive
_WHOLE = 6.0  # [s] of film for a run without turns
_MOST = 20_000  # frames
_USUAL = {'.mp4': (30.0, 960), '.gif': (20.0, 560), '': (25.0, 960)}
"""Default frames a second and longer side [pixels]."""

_SHADES = 32  # number of shades of grey, and of the accent

_Grab = Callable[[], None]

# the same frames are the same file; the index goes first, so that browsers begin at once
_EXACT = ['-crf', '18', '-fflags', '+bitexact', '-flags:v', '+bitexact', '-movflags', '+faststart']


class Target:
    """File or folder of a moving picture, checked before anything is computed.

    Parameters
    ----------
    name : name of an .mp4 or .gif file, of an .svg to be numbered, or of a folder for SVG frames

    Attributes
    ----------
    kind : ``.mp4``, ``.gif``, or empty for SVG frames
    files : files written so far
    usual_rate, usual_size : default frames a second and longer side [pixels]
    """

    def __init__(self, name: str, option: str = '--output') -> None:
        path = Path(name)
        folder = name.endswith('/') or path.is_dir() or not path.suffix
        if not folder and path.suffix not in ('.mp4', '.gif', '.svg'):
            raise InputError(
                f'{option} {name}: the ending must be .mp4, .gif or .svg, or none for a folder of '
                'SVG frames'
            )
        output.check_path(option, name, path.suffix)
        self.path, self.kind = path, '' if folder or path.suffix == '.svg' else path.suffix
        self.usual_rate, self.usual_size = _USUAL[self.kind]
        self.files: list[Path] = []
        self._stem = path / 'frame' if folder else path.with_suffix('')
        self._program = _ffmpeg() if self.kind == '.mp4' else ''

    def check_rate(self, fps: float) -> None:
        """Refuse a number of frames a second that the file cannot hold."""
        hundredths = 100.0 / fps
        if self.kind == '.gif' and abs(hundredths - max(1, round(hundredths))) > 1e-6:
            near = 100.0 / max(2, round(hundredths))
            raise InputError(
                f'a GIF shows each frame for whole hundredths of a second: {fps:g} frames a '
                f'second cannot be, {near:.6g} can'
            )

    @contextmanager
    def writing(self, figure: Any, fps: float, count: int) -> Iterator[_Grab]:
        """Context of a function that adds the present figure as the next of a number of frames."""
        try:
            if self.kind:
                with self._film(figure, fps) as grab:
                    yield grab
            else:
                with output.errors_as_sentences(self._stem.parent):
                    self._stem.parent.mkdir(exist_ok=True)
                yield self._numbered(figure, len(str(count)))
        except CalledProcessError as error:
            raise RunError(f"ffmpeg failed to write '{self.path}'") from error

    @contextmanager
    def _film(self, figure: Any, fps: float) -> Iterator[_Grab]:
        """The file gets its name when it is complete."""
        movie, rate = self.kind == '.mp4', cast('int', fps)  # so its stubs; any number will do
        writer = FFMpegWriter(rate, 'h264', extra_args=_EXACT) if movie else _GifWriter(rate)
        program: dict[Any, Any] = {'animation.ffmpeg_path': self._program} if movie else {}
        with (
            output.beside(self.path) as part,
            mpl.rc_context(program),
            writer.saving(figure, str(part), DENSITY),
        ):
            yield writer.grab_frame
        self.files.append(self.path)

    def _numbered(self, figure: Any, digits: int) -> _Grab:
        def grab() -> None:
            number = f'{len(self.files):0{max(4, digits)}d}'
            file = self._stem.with_name(f'{self._stem.name}_{number}.svg')
            figures.save(figure, file)
            self.files.append(file)

        return grab


class _GifWriter(AbstractMovieWriter):
    """All frames in the colours of our pictures: greys, the accent, and those of links.

    Matplotlib's own chooses other colours for each frame and dithers, which is ten times as large.
    """

    def setup(self, fig: Any, outfile: Any, dpi: float | None = None) -> None:
        super().setup(fig, outfile, dpi)
        self._frames: list[Image.Image] = []
        self._colours = Image.new('P', (1, 1))
        # red, green and blue of each colour, 0 to 255
        shares, accent = np.linspace(0.0, 1.0, _SHADES)[:, None], np.array(rgb(ACCENT))
        part = np.linspace(0.15, 1.0, 12)[:, None]
        # none so near to white that white would be taken for it
        mixed = [shares * np.ones(3), accent + shares[:-4] * (1.0 - accent), shares[8:] * accent]
        mixed += [1.0 - part * (1.0 - np.array(rgb(x))) for x in (GROUND, *LINKS)]
        self._colours.putpalette([int(x) for x in np.rint(255.0 * np.concatenate(mixed)).ravel()])

    def grab_frame(self, **_: Any) -> None:
        buffer = BytesIO()
        self.fig.savefig(buffer, format='rgba', dpi=self.dpi)
        shown = Image.frombytes('RGBA', self.frame_size, buffer.getvalue()).convert('RGB')
        self._frames.append(shown.quantize(palette=self._colours, dither=Image.Dither.NONE))

    def finish(self) -> None:
        first, *others = self._frames
        first.save(
            self.outfile, save_all=True, append_images=others, loop=0,
            duration=round(1000.0 / self.fps),
        )  # fmt: skip


def _ffmpeg() -> str:
    """The program ffmpeg of this machine, or that of the extra ``video``."""
    if found := shutil.which('ffmpeg'):
        return found
    try:
        return str(needed('imageio_ffmpeg').get_ffmpeg_exe())
    except (InputError, RuntimeError) as error:
        raise InputError(
            'MP4 needs the program ffmpeg: install it, or pip install '
            "'mechanism_sim[video]'; .gif and SVG frames need nothing more"
        ) from error


@dataclass(frozen=True)
class Film:
    """Film to be written: a number of frames of a part of a run."""

    target: Target
    record: Record
    t: Array  #: (N,) [s] of the frames
    #: [s] of the run; the frame at the end is left out, so that turns go on and on
    start: float
    end: float
    speed: float  #: simulated seconds in a second of film
    fps: float  #: frames a second

    def write(
        self,
        shown: FilmParts,
        size: int | tuple[int, int] | None = None,
        show: Callable[[int, int], None] = lambda *_: None,
    ) -> tuple[list[Path], tuple[int, int]]:
        """Make and write all frames; returns the files, and the size of frames [pixels].

        Parameters
        ----------
        size : longer side, or width and height [pixels]
        show : callback after each frame with their number, and 0
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
    start, end : range of the run [s]; default: all of it
    fps : frames a second
    speed : simulated seconds per second of film; default: a turn of the drive takes 3 s, or a
        run without turns 6 s
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
