"""Series as panels: over time, over the angle of a drive turn upon turn, or over another quantity.

Words, units, colours and dashes follow from the names of the quantities and from the catalogue.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim.analysis.series import Items, Series, parse, sampled
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.export import palette
from mechanism_sim.export.palette import GROUND, index
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.report.charts.bands import Spells, modes
from mechanism_sim.report.charts.chart import (
    DIRECTION,
    NOTHING,
    PANEL,
    ROUND,
    SMALL,
    TIME,
    Axis,
    Chart,
    ChartCurve,
    Over,
    Panel,
    rim,
)
from mechanism_sim.report.charts.thinning import Envelope, SampledLine, tallest, thin
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.run import Piece
from mechanism_sim.scene import Machine
from mechanism_sim.signal_files import GRAVITIES, GRAVITY
from mechanism_sim.units import QuantityValue, for_people, to_si_text

TOGETHER = 4
"""Lines that a panel holds; more are put beside each other by what they are of."""

TURNS = 3
"""Turns drawn one upon the other; of more, the last one and the range of all."""

_BESIDE = 6  # panels above each other, more are in two columns
_KINDS = 2  # quantities that an axis names
_SLACK = 1e-7  # [deg]
_SWING = 180.0  # [deg] that a link which swings turns at most
_WHOLE = 0.97  # share of a turn that counts as a whole one
_MARKS = 1500  # distinguishable positions of impacts along a panel
_MANY = 40_000  # points of a line, more are thinned
_ACROSS = {'x': 'y', 'y': 'x', 'along': 'across', 'across': 'along'}  # components of a vector
_TRUE = 4.0  # [in] height of a path that is true to scale


class Abscissa(NamedTuple):
    """Abscissa of a plot: its axis, and where times (N,) [s] are on it."""

    axis: Axis
    at: Callable[[Array], Array]
    span: float = 0.0  #: drawn range of an angle [deg]: a turn, or a whole period in turns
    of: str = ''  #: the quantity, where it is neither time nor the angle of the drive

    @property
    def kind(self) -> Over:
        """Kind of abscissa, as charts name it."""
        if self.axis is DIRECTION:
            return 'polar'
        return 'angle' if self.span else 'other' if self.of else 'time'


OVER_TIME = Abscissa(TIME, lambda t: t)


def against(run: Piece | Cycle, what: str) -> Abscissa:
    """Abscissa: ``time``, the ``angle`` of the main drive, or a quantity of the run.

    Over the direction of a vector charts are round.
    """
    piece = run.solution if isinstance(run, Cycle) else run
    main, physics, curve = run.machine.plan.main, piece.physics, piece.motion.curve
    check_abscissa(run.machine, what)
    if what == 'time':
        return OVER_TIME
    if what == 'angle':
        i = physics.coordinates.index(main)
        turns, ends = run.machine.drive.repetition.turns, np.array([curve.start[0], curve.end])
        if abs(np.diff(curve(ends)[:, i])[0]) < _WHOLE * turns * TWO_PI:
            turns = 1
        return over_turns(main, lambda t: np.asarray(np.degrees(curve(t)[:, i])), turns)
    found = catalogue(run.machine).find(what)
    unit, scale = _in_degrees(found.unit)
    axis = DIRECTION if found.part == 'direction' else Axis(found.words, unit)

    def at(t: Array) -> Array:
        inside = np.clip(t, curve.start[0], curve.end)
        return scale * sampled(run, [found.name], inside)[0].values

    return Abscissa(axis, at, of=found.name)


def against_recorded(s: Series, series: Sequence[Series]) -> Abscissa:
    """Abscissa of recorded values, for series that have instants within theirs."""
    if all(np.isnan(s.at(x.t)).all() for x in series):
        raise InputError(f'{s.name} has no value at the instants of {series[0].name}')
    unit, scale = _in_degrees(s.unit)
    words, labels = named([s])
    owner = '' if labels[s.name] == s.name else f' of {labels[s.name]}'
    return Abscissa(Axis(f'{words}{owner}', unit), lambda t: scale * s.at(t), of=s.name)


def check_abscissa(machine: Machine, what: str) -> None:
    """Refuse what a run of the machine cannot be drawn against."""
    if what == 'angle' and machine.plan.main in machine.physics.displacements:
        raise InputError(f'{machine.plan.main} slides: it has no angle')
    if what not in ('time', 'angle'):
        catalogue(machine).find(what)


def over_turns(drive: str, at: Callable[[Array], Array], turns: int = 1) -> Abscissa:
    """Abscissa of the angle of a drive, which `at` gives [deg] at times (N,) [s]."""
    return Abscissa(turn_of(drive, turns), at, 360.0 * turns)


def turn_of(drive: str, turns: int = 1) -> Axis:
    """The angle of a drive within a turn, or as many as bring all again."""
    return Axis(f'angle of the {drive}', 'deg', 0.0, 360.0 * turns, every=45.0 * turns)


def colours(names: Iterable[str], numbers: Mapping[str, int]) -> Iterator[int]:
    """The colour of each line: that of the link or joint that it is of; the others the next ones.

    Parameters
    ----------
    names : ``velocity.crank``, ``reaction.crank_coupler.x``
    numbers : colour numbers of links and joints
    """
    others = count()
    for name in names:
        known = next((numbers[part] for part in name.split('.') if part in numbers), None)
        yield next(others) if known is None else known


def panels(
    series: Sequence[Series], over: Abscissa, numbers: Mapping[str, int],
    impact_times: Array = NOTHING, reach: Mapping[str, Array] = MappingProxyType({}),
) -> list[Panel]:  # fmt: skip
    """Lines of one unit: in a panel, or of many one for each link or joint, of the same scale.

    Parameters
    ----------
    numbers : colour numbers of links and joints
    impact_times : (N,) times that are marked [s]
    reach : (3, N) by name: angles [deg], least and greatest values there over all turns, SI
    """
    owners = {s.line: f'{s.name}.{s.of}' for s in series}
    shades = dict(zip(owners, colours(owners.values(), numbers), strict=True))
    items: dict[str, list[Series]] = {}
    for s in series:
        items.setdefault(_item(s, numbers), []).append(s)
    together = len(owners) <= TOGETHER or len(items) == 1
    unit, scale = _in_degrees(series[0].unit)
    found = []
    for some in [series] if together else items.values():
        words, labels = named(some)
        told = {s.line: ', '.join(filter(None, (labels[s.name], s.run))) for s in some}
        lines = [Drawn(s, told[s.line], shades[s.line]) for s in some]
        curves = tuple(_curves(lines, over, scale, reach))
        alone = not together and len({c.label for c in curves if c.label}) == 1
        panel = Panel(
            over.axis, Axis(words, unit), curves, next(iter(labels.values())) if alone else '',
            height=PANEL if together else SMALL, scale='' if together else f'[{unit}]',
        )  # fmt: skip
        found.append(_shaped(panel, over, [s.name for s in series]))
    if not over.of:
        found[0] = replace(found[0], impact_times=marks(over, impact_times))
    return found


def hodograph(run: Piece | Cycle, size: Series) -> Panel:
    """The size of a vector of a run over its direction, without a legend."""
    over = against(run, f'{size.name.removesuffix("size")}direction')
    (panel,) = panels([size], over, palette.numbers(run.machine.mechanism))
    return replace(panel, curves=tuple(replace(c, label='') for c in panel.curves if len(c.x)))


def _shaped(panel: Panel, over: Abscissa, names: Sequence[str]) -> Panel:
    """Round over a direction; true to scale if it shows a path, or a vector by its components."""
    if over.axis is DIRECTION:
        y = replace(panel.y, low=0.0, high=rim(panel.curves))
        return replace(panel, y=y, form='polar', height=ROUND, scale='')
    kind, part = over.of.partition('.')[0], over.of.rpartition('.')[2]
    other, units = _ACROSS.get(part), {panel.x.unit, panel.y.unit}
    if (
        other
        and len(units) == 1
        and all(n.partition('.')[0] == kind and n.rpartition('.')[2] == other for n in names)
    ):
        return replace(panel, form='equal', height=_TRUE, scale='')
    return panel


def named(series: Sequence[Series]) -> tuple[str, dict[str, str]]:
    """Words for the lines of a panel, and their labels by name."""
    parts = {s.name: _parts(s) for s in series}
    titles = {s.name: s.words or parts[s.name][0].replace('_', ' ') for s in series}
    kinds = list(dict.fromkeys(kind for kind, _ in parts.values()))
    said = list(dict.fromkeys(titles.values()))
    if len(kinds) == 1 and len(said) > 1:
        said = [kinds[0].replace('_', ' ')]
    words = ', '.join(said) if len(said) <= _KINDS else ''
    if len(kinds) == 1:
        rest = {s.name: parts[s.name][1].removesuffix('.size') for s in series}
        labels = {s.name: rest[s.name] or s.of or s.name for s in series}
    elif len({s.of for s in series}) == 1 and len(set(titles.values())) == len(titles):
        labels = titles  # several quantities of one thing
    else:
        labels = {name: name for name in titles}
    return words, labels


def marks(over: Abscissa, t: Array) -> Array:
    """Abscissas of the marks of impacts at times (N,) [s], only distinct ones."""
    x = over.at(t) if len(t) else NOTHING
    x = np.mod(x, over.span) if over.span else x
    return np.asarray(x[tallest(x, np.zeros(len(x)), _MARKS)])


def columns(found: Sequence[Panel]) -> int:
    """Number of panels side by side: two of many."""
    return 2 if len(found) > _BESIDE and not any(p.y.names for p in found) else 1


class Drawn(NamedTuple):
    """A series to be drawn, with its label and the number of its colour."""

    series: Series
    label: str
    colour: int


def _curves(
    drawn: Sequence[Drawn], over: Abscissa, scale: float, reach: Mapping[str, Array]
) -> Iterator[ChartCurve]:
    """Ranges beneath, then ideal machines, turns before the last, and the last."""
    used: Counter[int] = Counter()
    dashes: dict[str, int] = {}
    for d in drawn:
        if d.series.line not in dashes:
            dashes[d.series.line] = used[index(d.colour)]
            used[index(d.colour)] += 1
    found: list[ChartCurve] = []
    offsets: dict[str, float] = {}
    for d in sorted(drawn, key=lambda d: d.series.ideal):  # the own ones say where angles begin
        wide = None if d.series.ideal else reach.get(d.series.name)
        found += _of(d, over, scale, dashes[d.series.line], offsets, wide)
    order = {'range': 0, 'ideal': 1, 'earlier': 2, '': 3}
    yield from sorted(found, key=lambda c: order[c.look])
    if any(d.series.ideal for d in drawn):
        yield ChartCurve(NOTHING, NOTHING, 'ideal machine', colour=GROUND, look='ideal')


def _of(
    d: Drawn, over: Abscissa, scale: float, dash: int, offsets: dict[str, float],
    reach: Array | None,
) -> Iterator[ChartCurve]:  # fmt: skip
    s = d.series
    same: dict[str, Any] = {'of': s.name, 'colour': d.colour}
    x, y = over.at(s.t), scale * s.values
    if s.ideal:
        same |= {'look': 'ideal'}
    else:
        same |= {'label': d.label}
    if s.events:
        x = np.mod(x, over.span) if over.span else x
        yield ChartCurve(x, y, form='dots', marker='circle-open', **same)
        return
    if over.of:
        line = ChartCurve(x, y, dash=0 if s.ideal else dash, when=s.t, **same)
        yield from [line] if s.ideal else [line, line.start()]
        return
    if not over.span:
        yield ChartCurve(*_thinned(x, y), dash=0 if s.ideal else dash, **same)
        return
    pieces = _pieces(x, y, s.t, over.span)
    whole = [k for k, (x, *_) in enumerate(pieces) if np.ptp(x) > _WHOLE * over.span]
    newest = whole[-1] if whole else 0
    known = reach is not None
    if not known and len(pieces) > TURNS and whole and not s.ideal:
        reach = Envelope.of(x, s.values, over.span)
    shift = 0.0
    if s.unit == 'rad':
        # angles [deg] less the whole turns that bring each turn nearest to the newest one
        start = float(pieces[newest][1][0])
        offset = offsets.setdefault(s.name, start - 360.0 * round(start / 360.0))
        pieces = [(x, y - 360.0 * round((y[0] - offset) / 360.0), t) for x, y, t in pieces]
        shift = 360.0 * round((start - offset) / 360.0)
    swings = s.unit != 'rad'  # angles of links that turn round have no range
    if reach is not None:
        at, low, high = reach
        low, high = scale * low - shift, scale * high - shift
        swings = swings or bool(high.max() - low.min() < _SWING)
    if reach is not None and swings:
        quiet = same | {'look': 'range', 'label': ''}
        yield ChartCurve(at, high, low=low, form='area', **quiet)
    elif newest and not s.ideal and not known:
        quiet = same | {'look': 'earlier', 'label': ''}
        yield _curve(pieces[max(0, newest - TURNS + 1) : newest], dash=dash, **quiet)
    only = bool(whole) and (s.ideal or len(pieces) > TURNS)
    shown = pieces[newest : newest + 1] if only else pieces[newest:]
    yield _curve(shown, dash=0 if s.ideal else dash, **same)


def _thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """Thin a line to as many points as are drawn; it stays broken where values are missing."""
    known = np.isfinite(y)
    if len(x) <= _MANY or not known.any():
        return x, y
    at, values = thin(SampledLine(x[known], y[known]), _MANY)
    behind = np.unique(np.searchsorted(at, x[~known], 'right'))
    return np.insert(at, behind, at[behind - 1]), np.insert(values, behind, np.nan)


Turn = tuple[Array, Array, Array]


def _pieces(x: Array, y: Array, t: Array, span: float) -> list[Turn]:
    """Angles within a turn [deg], values and times, turn by turn.

    Parameters
    ----------
    x : (N,) angles [deg], rising or falling; where they pass a whole turn a place is put in
    """
    nearest = span * np.round(x / span)
    x = np.where(np.abs(x - nearest) < _SLACK, nearest, x)
    turn = np.floor(x / span)
    ends = np.flatnonzero(np.diff(turn) != 0.0) + 1
    found = []
    for a, b in zip([0, *ends], [*ends, len(x)], strict=True):
        rows = np.array([x[a:b], y[a:b], t[a:b]])
        low = span * turn[a]
        if b < len(x):
            rows = np.append(rows, _crossing(x, y, t, b, span), axis=1)
        if a > 0:
            rows = np.append(_crossing(x, y, t, a, span), rows, axis=1)
        if np.ptp(rows[0]) > 10.0 * _SLACK or len(ends) == 0:
            found.append((np.clip(rows[0] - low, 0.0, span), rows[1], rows[2]))
    return found


def _crossing(x: Array, y: Array, t: Array, k: int, span: float) -> Array:
    """The place (3, 1) between two others where one turn ends and the next begins."""
    at = span * np.floor(max(x[k - 1], x[k]) / span)
    share = (at - x[k - 1]) / (x[k] - x[k - 1])
    return np.array([[at], *([z[k - 1] + share * (z[k] - z[k - 1])] for z in (y, t))])


def _curve(pieces: list[Turn], **same: Any) -> ChartCurve:
    """Turns as one curve that breaks between them."""
    gap = np.full((3, 1), np.nan)
    rows = [part for piece in pieces for part in (gap, np.array(piece))][1:]
    x, y, t = np.concatenate(rows, axis=1)
    return ChartCurve(x, y, when=t, **same)


def chart(
    series: Sequence[Series], title: str, over: Abscissa = OVER_TIME,
    numbers: Mapping[str, int] = MappingProxyType({}), impacts: Sequence[float] | Array = (),
) -> Chart:  # fmt: skip
    """Lines over a common abscissa: those of one unit share a panel, modes of contact are bands.

    Parameters
    ----------
    numbers : colour numbers of links and joints
    impacts : (N,) times that are marked [s]
    """
    bands = [] if over.kind != 'time' else [s for s in series if s.name.startswith('mode.')]
    # in SI units; beside accelerations, and no masses, g is one of gravity
    si = {unit: in_si(unit) for unit in {s.unit for s in series}}
    others = {x.unit for unit, x in si.items() if unit not in GRAVITIES}
    if GRAVITY.unit in others and 'kg' not in others:
        si |= dict.fromkeys(si.keys() & GRAVITIES, GRAVITY)
    units: dict[str, list[Series]] = {}
    for s in series:
        if s not in bands:
            units.setdefault(si[s.unit].unit, []).append(s)
    found: list[Panel] = []
    impact_times = np.asarray(impacts, np.float64)
    for lines in units.values():
        found += panels(_in_one_unit(lines, si), over, numbers, NOTHING if found else impact_times)
    if bands:
        found.append(modes({replace(s, name=_parts(s)[1]).line: Spells.of(s) for s in bands}))
    if over.kind == 'time':
        ends = [over.at(s.t[[0, -1]]) for s in series if len(s.t)]
        axis = replace(over.axis, low=float(np.min(ends)), high=float(np.max(ends)))
        found = [replace(p, x=axis) for p in found]
    wide = 6.0 if found[0].form != 'plain' else 8.0
    return Chart('', title, tuple(found), over.kind, columns=columns(found), width=wide)


def _in_degrees(unit: str) -> tuple[str, float]:
    """Angles are in degrees; the unit of all else depends on its size (`Chart.readable`)."""
    return for_people(unit) if unit == 'rad' else (unit, 1.0)


def in_si(unit: str) -> QuantityValue:
    """One of a unit, in the SI unit that it leads to; itself where that is not known."""
    try:
        return to_si_text(f'1 {unit}') if unit else QuantityValue(1.0, '')
    except ValueError:
        return QuantityValue(1.0, unit)


def _in_one_unit(lines: Sequence[Series], si: Mapping[str, QuantityValue]) -> Sequence[Series]:
    """Lines of one kind: as they are where all have one unit, else in SI units."""
    if len({s.unit for s in lines}) == 1:
        return lines
    return [replace(s, unit=si[s.unit].unit, values=si[s.unit].value * s.values) for s in lines]


def _item(s: Series, numbers: Mapping[str, int]) -> str:
    """The link or joint that a series is of."""
    known = next((part for part in f'{s.name}.{s.of}'.split('.') if part in numbers), '')
    return known or (s.name[:-2] if s.name.endswith(('.x', '.y')) else s.name)


def _parts(s: Series) -> tuple[str, str]:
    """Quantity of a series and its owner: of a path the last field, and its items."""
    kind, _, rest = s.name.partition('.')
    if rest == s.of or not any(x in s.name for x in '/[{'):
        return kind, rest
    path = parse(s.name)
    if path is None or not path.fields:  # of a topic that is none of ROS
        return s.name.rpartition('.')[2], ''
    items = [step.text for step in path.steps if isinstance(step, Items)]
    return path.fields[-1], ' '.join(x for x in items if x != ':')
