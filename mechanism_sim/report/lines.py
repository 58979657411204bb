"""Plots of anything over time, or over the angle of the drive; axes say their units."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.patches import Patch
from matplotlib.ticker import MultipleLocator

from mechanism_sim.analysis.record import Record
from mechanism_sim.analysis.series import Series, chosen, instants, sampled, with_extremes
from mechanism_sim.arrays import Array
from mechanism_sim.cycles.cycle import Cycle
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.events import Mode
from mechanism_sim.hybrid.solution import Piece
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.report import figures
from mechanism_sim.report.cycle import for_people
from mechanism_sim.report.picture import Picture

_MOST = 100  # lines that axes and legend have room for
_LETTERS = 110  # in a line of a legend
_WIDTH, _PANEL, _ROW, _REST = 8.0, 1.9, 0.28, 0.9  # [in]
_SHADES = {
    Mode.FREE_FLIGHT: '0.15', Mode.FOLLOWING: '0.80', Mode.STICKING: '0.60',
    Mode.SLIDING_FORWARD: '0.72', Mode.SLIDING_BACKWARD: '0.88', Mode.UNKNOWN: '1.0',
    Mode.RECOVERING: '0.35',
}  # fmt: skip

_IDEAL = {'color': '0.80', 'lw': 3.2}


class Abscissa(NamedTuple):
    """What is plotted over: its words with the unit, and where times (N,) [s] are on it."""

    label: str
    at: Callable[[Array], Array]
    wraps: bool = False


TIME = Abscissa('time [s]', lambda t: t)


def over_angle_of(record: Record) -> Abscissa:
    """Over the angle of the main drive of a recorded run.

    Raises
    ------
    InputError
        If it has none.
    """
    return _over_angle_of(record.piece, record.machine.main)


def draw(series: Sequence[Series], title: str, over: Abscissa = TIME) -> Picture:
    """Lines over a common abscissa: those of one unit share axes, modes of contact are bands.

    Raises
    ------
    InputError
        If there are more lines than can be told apart.
    """
    if len(series) > _MOST:
        raise InputError(
            f'{len(series)} lines, {series[0].name} to {series[-1].name}, are more than the '
            f'{_MOST} that can be told apart: ask for some of them'
        )
    with figures.style():
        bands = [] if over.wraps else [s for s in series if s.name.startswith('mode.')]
        panels: dict[str, list[Series]] = {}
        for s in series:
            if s not in bands:
                panels.setdefault(s.unit, []).append(s)
        heights = [_PANEL] * len(panels) + [_ROW * (len(bands) + 1)] * bool(bands)
        figure = Picture((_WIDTH, sum(heights) + _REST), layout='constrained')
        figure.suptitle(title, fontsize=10.0)
        grid = figure.subplots(
            len(heights), 1, sharex=True, squeeze=False, gridspec_kw={'height_ratios': heights}
        )[:, 0]
        for axes, (unit, lines) in zip(grid, panels.items(), strict=False):
            _panel(axes, unit, lines, over)
        if bands:
            _bands(grid[-1], bands)
        grid[-1].set_xlabel(over.label)
        if over.wraps:
            grid[-1].set_xlim(0.0, 360.0)
            grid[-1].xaxis.set_major_locator(MultipleLocator(45.0))
        else:
            ends = [over.at(s.t[[0, -1]]) for s in series if len(s.t)]
            low, high = np.min(ends), np.max(ends)
            if high > low:
                grid[-1].set_xlim(low, high)
        figure.align_ylabels(list(grid[: len(panels)]))
    return figure


def _panel(axes: Any, unit: str, lines: Sequence[Series], over: Abscissa) -> None:
    """Lines of one unit."""
    shown, scale = for_people(unit)
    kinds = {_parts(s.name)[0] for s in lines}
    names = list(dict.fromkeys(s.name for s in lines))
    strokes = dict(zip(names, figures.strokes(len(names)), strict=True))
    for s in lines:
        stroke = strokes[s.name]
        x, y = over.at(s.t), scale * s.values
        label = (len(kinds) == 1 and _parts(s.name)[1]) or s.name
        if s.events:
            axes.plot(x, y, 'o', ms=3.2, mfc='white', mec=stroke['color'], mew=0.8, label=label)
            continue
        if over.wraps:  # no stroke back from one turn to the next
            ends = np.flatnonzero(np.abs(np.diff(x)) > 180.0) + 1
            x, y = np.insert(x, ends, np.nan), np.insert(y, ends, np.nan)
        if s.ideal:
            label, stroke = f'{label}, ideal', {**stroke, **_IDEAL}
        axes.plot(x, y, label=label, **stroke)
    words = kinds.pop().replace('_', ' ') if len(kinds) == 1 else ''
    axes.set_ylabel(f'{words} [{shown.replace("^2", "²")}]'.strip() if unit else words)
    if len(lines) > 1 or not words:
        longest = max(len(text) for text in axes.get_legend_handles_labels()[1])
        axes.legend(
            loc='lower left', bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, frameon=False,
            fontsize=7.5, ncols=max(1, _LETTERS // (longest + 8)), handlelength=2.6,
        )  # fmt: skip


def _parts(name: str) -> tuple[str, str]:
    """What a series is, and of what: of a path the last field, and its item."""
    if '/' not in name and '[' not in name and '{' not in name:
        kind, _, rest = name.partition('.')
        return kind, rest
    kind = name.rpartition('.')[2].partition('[')[0].partition('{')[0]
    items = [part.partition(']')[0] for part in name.split('[')[1:]]
    return kind, ' '.join(x for x in items if x != ':')


def _bands(axes: Any, bands: Sequence[Series]) -> None:
    """The mode of each joint as a band along time."""
    seen: dict[Mode, str] = {}
    for row, s in enumerate(bands):
        starts = np.flatnonzero(np.diff(s.values, prepend=np.nan) != 0.0)
        ends = np.append(s.t[starts[1:]], s.t[-1])
        spans: dict[Mode, list[tuple[float, float]]] = {}
        for start, end, mode in zip(s.t[starts], ends, s.values[starts], strict=True):
            spans.setdefault(Mode(int(mode)), []).append((start, end - start))
        for mode, places in spans.items():
            axes.broken_barh(places, (row - 0.35, 0.7), color=_SHADES[mode], lw=0.0)
            seen.setdefault(mode, mode.name.replace('_', ' ').lower())
    axes.set_yticks(range(len(bands)), [s.name.partition('.')[2] for s in bands])
    axes.set_ylim(-0.5, len(bands) - 0.5 + 0.9)
    axes.tick_params(axis='y', length=0.0)
    axes.grid(visible=False)
    keys = [Patch(color=_SHADES[mode], label=text) for mode, text in sorted(seen.items())]
    axes.legend(handles=keys, loc='upper right', ncols=len(keys), frameon=False, fontsize=7.5,
                borderpad=0.0, borderaxespad=0.1)  # fmt: skip


def plot(
    run: Piece | Cycle,
    *names: str,
    against: Literal['time', 'angle', ''] = '',
    start: float | None = None,
    end: float | None = None,
) -> Picture:
    """Plot quantities of a run by their names.

    Parameters
    ----------
    names : of `Piece.sample` or `Cycle`, or the first part of several, such as ``normal_force``;
        without any an overview: angles, gaps with their modes, forces, torque
    against : ``'time'``, or ``'angle'`` of the first drive; of a cycle that repeats its angle
        unless told
    start, end : [s] of the run; all of it unless told

    Raises
    ------
    InputError
        If there is no such quantity, or no such part of the run.
    """
    if against not in ('time', 'angle', ''):
        raise InputError(f"against '{against}': choose 'time' or 'angle'")
    piece = run.solution if isinstance(run, Cycle) else run
    first, last = float(piece.motion.curve.start[0]), piece.motion.curve.end
    if isinstance(run, Cycle):
        first, last = run.t[0], run.t[-1]
    begin, finish = (first if start is None else start), (last if end is None else end)
    if not first <= begin < finish <= last * (1.0 + 1e-12):
        raise InputError(
            f'from {begin:g} s to {finish:g} s is no part of the run, which goes from {first:g} s '
            f'to {last:g} s'
        )
    t = instants(piece, float(begin), min(finish, last))
    wanted = names or _usual(piece)
    if isinstance(run, Cycle):
        columns = with_extremes(piece, run.at, wanted, t)
        series, title = chosen(piece, columns, wanted), run.machine.scene.title
        against = against or ('angle' if run.repeats else 'time')
    else:
        series, title = sampled(piece, wanted, t), getattr(run, 'scene', '')
    if not names:
        series = list(_overview(series))
    if against != 'angle':
        return draw(series, title)
    drive = (*piece.physics.driven, *piece.physics.coordinates)[0]
    return draw(series, title, _over_angle_of(piece, drive))


def _over_angle_of(piece: Piece, drive: str) -> Abscissa:
    if drive in piece.physics.displacements:
        raise InputError(f'{drive} is driven straight, it has no angle')
    i = piece.physics.coordinates.index(drive)

    def at(t: Array) -> Array:
        return np.asarray(np.degrees(np.mod(piece.motion.curve(t)[:, i], TWO_PI)))

    return Abscissa(f'angle of the {drive} [deg]', at, True)


def _usual(piece: Piece) -> list[str]:
    """What is worth seeing of a run."""
    loose = ['gap', 'mode', 'normal_force'] if piece.physics.clearances else []
    forces = ['drive_torque'] if piece.physics.has_forces else []
    if forces and not loose:
        forces = [*(f'reaction.{joint}' for joint in piece.physics.joints), *forces]
    return [*(f'position.{c}' for c in piece.physics.coordinates), *loose, *forces]


def _overview(series: Sequence[Series]) -> Iterator[Series]:
    """Angles within a turn, and of forces their sizes."""
    by_name = {s.name: s for s in series}
    for s in series:
        _, _, joint = s.name.removesuffix('.x').partition('.')
        if not s.name.startswith('reaction.'):
            yield _in_turn(s)
        elif s.name.endswith('.x'):
            y = by_name[f'reaction.{joint}.y']
            yield Series(f'reaction.{joint}', s.unit, s.t, np.hypot(s.values, y.values))


def _in_turn(s: Series) -> Series:
    """An angle that makes turns, within a turn."""
    if s.unit != 'rad' or np.ptp(s.values) < TWO_PI + 1e-6:
        return s
    angle = np.mod(s.values, TWO_PI)
    ends = np.flatnonzero(np.abs(np.diff(angle)) > 0.5 * TWO_PI) + 1
    return Series(s.name, s.unit, np.insert(s.t, ends, s.t[ends]), np.insert(angle, ends, np.nan))
