"""Plots of anything over time, or over the angle of the drive; axes say their units."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.patches import Patch
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from mechanism_sim.analysis.record import Record
from mechanism_sim.analysis.series import Series, chosen, instants, sampled, with_extremes
from mechanism_sim.arrays import Array
from mechanism_sim.cycles.cycle import Cycle
from mechanism_sim.errors import InputError
from mechanism_sim.export.palette import numbers
from mechanism_sim.hybrid.events import Mode
from mechanism_sim.hybrid.solution import Piece
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.report import figures
from mechanism_sim.report.cycle import for_people
from mechanism_sim.report.picture import Picture
from mechanism_sim.units import typeset

_MOST = 100  # lines that axes and legend have room for
_TOGETHER = 4  # lines that axes hold; more are put beside each other by what they are of
_WIDTH, _PANEL, _SMALL, _ROW, _REST = 8.0, 1.9, 1.15, 0.28, 0.9  # [in]
_TURNS = 3  # drawn one upon the other; of more, the last one and a band around all
_STEPS = 721  # places in a turn of such a band
_SHADES = {
    Mode.FREE_FLIGHT: '#1d372a', Mode.FOLLOWING: '#e6a065', Mode.STICKING: '#a8500f',
    Mode.SLIDING_FORWARD: '#f0c896', Mode.SLIDING_BACKWARD: '#cf7d33', Mode.UNKNOWN: '1.0',
    Mode.RECOVERING: '#c3bfe0',
}  # fmt: skip
_IDEAL = {'alpha': 0.3, 'lw': 4.0}
_STRUCK = '#b35900'


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


def draw(
    series: Sequence[Series], title: str, over: Abscissa = TIME,
    numbers: Mapping[str, int] | None = None, impacts: Sequence[float] = (),
) -> Picture:  # fmt: skip
    """Lines over a common abscissa: those of one unit share axes, modes of contact are bands.

    More than a few of a unit get axes for each link or joint, of the same scale.

    Parameters
    ----------
    numbers : of links and joints, for their colours
    impacts : times that are marked [s]

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
        panels = _panels([s for s in series if s not in bands], numbers or {})
        heights = [_PANEL if alone else _SMALL for alone, _ in panels]
        heights += [_ROW * (len(bands) + 1)] * bool(bands)
        figure = Picture((_WIDTH, sum(heights) + _REST), layout='constrained')
        figure.suptitle(title, fontsize=10.0)
        grid = figure.subplots(
            len(heights), 1, sharex=True, squeeze=False, gridspec_kw={'height_ratios': heights}
        )[:, 0]
        same: dict[str, Any] = {}
        for axes, (alone, lines) in zip(grid, panels, strict=False):
            _panel(axes, lines[0].unit, lines, over, numbers or {})
            if not alone:
                axes.sharey(same.setdefault(lines[0].unit, axes))
        if len(impacts):
            _marks(grid[0], over.at(np.array(impacts)))
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


def _panels(
    series: Sequence[Series], numbers: Mapping[str, int]
) -> list[tuple[bool, list[Series]]]:
    """What shares axes, and whether it is all of its unit."""
    units: dict[str, list[Series]] = {}
    for s in series:
        units.setdefault(s.unit, []).append(s)
    found = []
    for lines in units.values():
        items: dict[str, list[Series]] = {}
        for s in lines:
            known = [part for part in s.name.split('.') if part in numbers]
            plain = s.name[:-2] if s.name.endswith(('.x', '.y')) else s.name
            items.setdefault(known[0] if known else plain, []).append(s)
        alone = len({s.name for s in lines}) <= _TOGETHER or len(items) == 1
        found += [(True, lines)] if alone else [(False, some) for some in items.values()]
    return found


def _panel(
    axes: Any, unit: str, lines: Sequence[Series], over: Abscissa, numbers: Mapping[str, int]
) -> None:
    """Lines of one unit."""
    shown, scale = for_people(unit)
    kinds = {_parts(s.name)[0] for s in lines}
    names = list(dict.fromkeys(s.name for s in lines))
    strokes = dict(zip(names, figures.strokes(names, numbers), strict=True))
    for s in lines:
        stroke = strokes[s.name]
        x, y = over.at(s.t), scale * s.values
        label = (len(kinds) == 1 and _parts(s.name)[1]) or s.name
        if s.events:
            axes.plot(x, y, 'o', ms=3.2, mfc='white', mec=stroke['color'], mew=0.8, label=label)
            continue
        if over.wraps:  # no stroke back from one turn to the next
            ends = np.flatnonzero(np.abs(np.diff(x)) > 180.0) + 1
            if len(ends) > _TURNS:
                grid, low, high = _envelope(x, y, ends)
                axes.fill_between(grid, low, high, color=stroke['color'], alpha=0.25, lw=0.0)
                whole = [(a, b) for a, b in pairwise([*ends, len(x)]) if np.ptp(x[a:b]) > 350.0]
                first, last = whole[-1]
                x, y, ends = x[first:last], y[first:last], ends[:0]
            x, y = np.insert(x, ends, np.nan), np.insert(y, ends, np.nan)
        if s.ideal:
            label, stroke = f'{label}, ideal', {**stroke, **_IDEAL}
        axes.plot(x, y, label=label, **stroke)
    words = kinds.pop().replace('_', ' ') if len(kinds) == 1 else ''
    axes.set_ylabel(f'{words} [{typeset(shown)}]'.strip() if unit else words)
    if len(lines) > 1 or not words:
        figures.legend(axes)


def _envelope(x: Array, y: Array, ends: NDArray[np.intp]) -> tuple[Array, Array, Array]:
    """Angles [deg] of a turn, and the least and the greatest there of all turns.

    Parameters
    ----------
    x, y : (N,) angles within a turn [deg], and values
    ends : where turns begin, other than the first
    """
    grid = np.linspace(0.0, 360.0, _STEPS)
    turns = []
    for angle, value in zip(np.split(x, ends), np.split(y, ends), strict=True):
        order = np.argsort(angle, kind='stable')
        turns.append(np.interp(grid, angle[order], value[order], left=np.nan, right=np.nan))
    low, high = np.fmin.reduce(turns), np.fmax.reduce(turns)
    near = np.rint(x / 360.0 * (_STEPS - 1)).astype(int)
    np.fmin.at(low, near, y)  # peaks between the angles of the grid
    np.fmax.at(high, near, y)
    return grid, low, high


def _marks(axes: Any, x: Array) -> None:
    """Impacts, at the upper edge of axes."""
    axes.plot(
        x, np.full(len(x), 0.97), '|', transform=axes.get_xaxis_transform(), color=_STRUCK,
        ms=5.0, mew=0.7, label='impact', zorder=5,
    )  # fmt: skip
    figures.legend(axes)


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
    physics, over = piece.physics, TIME
    if against == 'angle':
        over = _over_angle_of(piece, (*physics.driven, *physics.coordinates)[0])
    own = {name: k for x in (physics.joints, physics.coordinates) for k, name in enumerate(x)}
    if isinstance(run, Cycle):
        own = numbers(run.machine.mechanism)
    struck = [i.t for i in piece.impacts if begin <= i.t <= finish]
    return draw(series, title, over, own, struck)


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
