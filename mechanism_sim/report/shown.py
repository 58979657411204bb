"""Pictures and films of machines in one line of Python."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mechanism_sim.analysis.open_run import (
    Asked,
    AskedSignals,
    check_run_of,
    is_run,
    open_run,
    run_of_machine,
)
from mechanism_sim.analysis.record import Record
from mechanism_sim.arguments import as_annotated, check_options, public
from mechanism_sim.errors import InputError
from mechanism_sim.recording.reader import Bag
from mechanism_sim.report import drawing, figures, lines
from mechanism_sim.report.picture import Picture
from mechanism_sim.report.screen import FilmParts
from mechanism_sim.report.video import Target, film
from mechanism_sim.results.cycle import Cycle, instant
from mechanism_sim.results.run import Piece
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Source, load_scene
from mechanism_sim.signal_files import is_signal_file
from mechanism_sim.units import argument, plain

_OF_CYCLE = {'points': '', 'duration': ''}
_TO_FILE = dict.fromkeys(('file', 'filename', 'output'), 'savefig(FILE) of the picture')


@public
def draw(
    scene: Source, angle: float | str | None = None, t: float | str | None = None, **how: Any
) -> Picture:
    """A picture of a machine when its drive is at an angle [rad], or at a time [s].

    >>> import mechanism_sim as ms
    >>> picture = ms.draw('slider_crank', angle='60 deg')
    >>> picture.savefig('crank.svg')

    Parameters
    ----------
    scene : all that `load_scene` takes
    how : ``positions``, ``labels`` as `mechanism_sim.report.drawing.draw` has them; ``points``,
        names ``LINK.POINT`` whose paths are drawn, and ``duration`` [s] of drives without a period
    """
    if isinstance(angle, str | Path) and Path(angle).suffix in figures.SUFFIXES:
        raise InputError(
            f"draw gives a picture back, which writes itself: draw(...).savefig('{angle}')"
        )
    how = check_options(draw, how, drawing.draw, _OF_CYCLE, words=_TO_FILE)
    if how.get('positions', 1) < 1:
        raise InputError('draw: positions must be at least 1')
    points, duration = how.pop('points', ()), how.pop('duration', None)
    still = how.get('positions', 1) == 1 and not points
    found, at = instant(load_scene(scene), angle, t, duration, points, still)
    with figures.style():
        return drawing.draw(found, at, **how)


@public
def plot(
    source: Source | Piece | Cycle | Bag | Record,
    *names: str | Sequence[str],
    revolutions: float | None = None,
    duration: float | str | None = None,
    full_scale: str = '',
    sample_rate: float | str = '',
    **how: Any,
) -> Picture:
    """Plot quantities of a run, or of a scene, which is run first.

    >>> import mechanism_sim as ms
    >>> ms.plot('slider_crank', 'velocity.piston', revolutions=1).savefig('piston.png')

    Parameters
    ----------
    source : all that `load_scene` takes, or a solution, a cycle, a run that `open_run` opened, a
        bag, or the path of one or of a file of signals
    names : names of quantities, single or in lists; without any an overview
    revolutions, duration : length of the run of a scene
    full_scale, sample_rate : of a file of signals, if it does not say so itself: quantity of the
        largest number of a .wav, as ``'50 m/s^2'``, and sampling rate of a table [Hz]
    how : ``against``, ``start``, ``end`` as `mechanism_sim.report.lines.plot` has them
    """
    how = check_options(plot, how, lines.plot, words=_TO_FILE)
    if isinstance(source, str | Path) and is_signal_file(source):
        _refuse('a file of signals', revolutions=revolutions, duration=duration)
        asked: Any = AskedSignals(source, full_scale, rate=str(sample_rate))
        return lines.plot_recorded(asked, *names, **how)
    _refuse('a scene or a run', full_scale=full_scale, sample_rate=sample_rate)
    if not is_run(source):
        return lines.plot(simulate(source, revolutions, duration), *names, **how)  # type: ignore[arg-type]
    _refuse('a run, which has a start and an end', revolutions=revolutions, duration=duration)
    if isinstance(source, Cycle):
        return lines.plot(source, *names, **how)
    run = open_run(source)  # type: ignore[arg-type]
    if isinstance(run, Record):
        return lines.plot(run.piece, *names, **how)
    return lines.plot_recorded(Asked(run.bag, namespace=run.namespace), *names, **how)


def _refuse(what: str, **given: Any) -> None:
    for name, value in given.items():
        if value is not None and str(value):
            raise InputError(f'plot: {name} does not apply to {what}')


@public
def animate(
    scene: Source | Piece | Cycle | Bag | Record,
    file: str | Path,
    run: Piece | None = None,
    *,
    start: float | str | None = None,
    end: float | str | None = None,
    fps: float | str | None = None,
    speed: float | str | None = None,
    size: int | tuple[int, int] | None = None,
    **shown: Any,
) -> list[Path]:
    """Write a film of a machine; returns the files.

    >>> import mechanism_sim as ms
    >>> len(ms.animate('slider_crank', 'frames', end='0.1 s', fps='20 Hz', speed=1))
    2

    Parameters
    ----------
    scene : all that `load_scene` takes, or a solution, a cycle, a bag or its path
    file : .mp4, .gif, .svg to be numbered, or a folder for SVG frames
    run : its run, such as a solution; default: the scene's own run
    start, end, fps, speed : as `mechanism_sim.report.video.film` has them
    size : longer side, or width and height [pixels]
    shown : ``lens``, ``forces``, ``paths``, ``labels`` of `mechanism_sim.report.screen.FilmParts`
    """
    shown = check_options(animate, shown, FilmParts)
    target = Target(str(file))
    start, end = argument('start', start, 's'), argument('end', end, 's')
    fps, speed = argument('fps', fps, 'Hz'), argument('speed', speed, '')
    if run is None and is_run(scene):
        record = run_of_machine(scene, 'a film')  # type: ignore[arg-type]
    else:
        machine = load_scene(scene)  # type: ignore[arg-type]
        run = simulate(machine) if run is None else run
        check_run_of(machine, run)
        record = Record(machine, run, {})
    chosen = film(record, target, start, end, fps, speed)
    pair = plain(size)
    sides = pair if isinstance(pair, list | tuple) and len(pair) == 2 else [pair]
    kind = 'int' if len(sides) > 1 else 'int | None'
    sides = [as_annotated('animate: size', side, kind) for side in sides]
    return chosen.write(FilmParts(**shown), tuple(sides) if len(sides) > 1 else sides[0])[0]
