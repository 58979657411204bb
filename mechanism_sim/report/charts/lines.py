"""Quantities over time, or over the angle of the drive turn upon turn, as panels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim.analysis.series import Series
from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import GROUND, index
from mechanism_sim.report.charts.bands import Spells, modes
from mechanism_sim.report.charts.chart import (
    NOTHING,
    PANEL,
    SMALL,
    TIME,
    Axis,
    Chart,
    Curve,
    Panel,
)
from mechanism_sim.report.charts.thinning import Envelope
from mechanism_sim.results.solution import Piece
from mechanism_sim.units import for_people

TOGETHER = 4
"""Lines that a panel holds; more are put beside each other by what they are of."""

TURNS = 3
"""Turns drawn one upon the other; of more, the last one and the range of all."""

_BESIDE = 6  # panels above each other, more are in two columns
_KINDS = 2  # quantities that an axis names
_SLACK = 1e-7  # [deg]
_WHOLE = 350.0  # [deg] of a turn that counts as one
_MARKS = 1500  # places along a panel at which impacts can be told apart


class Abscissa(NamedTuple):
    """What is plotted over: its axis, and where times (N,) [s] are on it.

    Attributes
    ----------
    turns : whether it is an angle [deg], drawn within a turn
    """

    axis: Axis
    at: Callable[[Array], Array]
    turns: bool = False


OVER_TIME = Abscissa(TIME, lambda t: t)


def over_angle(piece: Piece, drive: str) -> Abscissa:
    """Over the angle of a coordinate of a run."""
    i = piece.physics.coordinates.index(drive)
    return over_turns(drive, lambda t: np.asarray(np.degrees(piece.motion.curve(t)[:, i])))


def over_turns(drive: str, at: Callable[[Array], Array]) -> Abscissa:
    """Over the angle of a drive, which `at` gives [deg] at times (N,) [s]."""
    return Abscissa(turn_of(drive), at, True)


def turn_of(drive: str) -> Axis:
    """The angle of a drive within a turn."""
    return Axis(f'angle of the {drive}', 'deg', 0.0, 360.0, every=45.0)


class Drawn(NamedTuple):
    """A quantity to be drawn.

    Attributes
    ----------
    colour : number in the palette
    item : what it is of: small multiples have a panel for each
    reach : places [deg], least and greatest values (3, N) there of all turns, SI
    """

    series: Series
    label: str
    colour: int
    item: str = ''
    reach: Array | None = None


def colours(names: Iterable[str], numbers: Mapping[str, int]) -> Iterator[int]:
    """The colour of each line: that of the link or joint that it is of; the others the next ones.

    Parameters
    ----------
    names : ``velocity.crank``, ``reaction.crank_coupler.x``
    numbers : of links and joints
    """
    others = count()
    for name in names:
        known = next((numbers[part] for part in name.split('.') if part in numbers), None)
        yield next(others) if known is None else known


def panels(
    drawn: Sequence[Drawn], over: Abscissa, words: str, unit: str, struck: Array = NOTHING
) -> list[Panel]:
    """Lines of one unit: in a panel, or of many one for each link or joint, of the same scale."""
    items: dict[str, list[Drawn]] = {}
    for d in drawn:
        items.setdefault(d.item or d.label, []).append(d)
    together = len({d.series.name for d in drawn}) <= TOGETHER or len(items) == 1
    shown, scale = for_people(unit)
    found = []
    for some in [drawn] if together else items.values():
        named, lines = (words, some) if words else _named(some)
        curves = tuple(_curves(lines, over, scale))
        alone = not together and len({c.label for c in curves if c.label}) == 1
        found.append(
            Panel(
                over.axis, Axis(named, shown), curves, lines[0].label if alone else '',
                height=PANEL if together else SMALL, scale='' if together else f'[{unit}]',
            )
        )  # fmt: skip
    found[0] = replace(found[0], struck=marks(over, struck))
    return found


def _named(drawn: Sequence[Drawn]) -> tuple[str, list[Drawn]]:
    """What the lines of a panel are, and their labels, by the names of their series."""
    kinds = list(dict.fromkeys(_parts(d.series.name)[0] for d in drawn))
    words = ', '.join(kind.replace('_', ' ') for kind in kinds) if len(kinds) <= _KINDS else ''
    return words, [
        d._replace(label=(len(kinds) == 1 and _parts(d.series.name)[1]) or d.series.name)
        for d in drawn
    ]


def marks(over: Abscissa, t: Array) -> Array:
    """Where impacts at times (N,) [s] are marked; no two where they cannot be told apart."""
    x = over.at(t) if len(t) else NOTHING
    x = np.mod(x, 360.0) if over.turns else x
    if len(x) <= _MARKS:
        return x
    span = float(np.ptp(x)) or 1.0
    return np.asarray(x[np.unique(np.round(x / span * _MARKS), return_index=True)[1]])


def columns(found: Sequence[Panel]) -> int:
    """How many panels are side by side: two of many."""
    return 2 if len(found) > _BESIDE and not any(p.y.names for p in found) else 1


def _curves(drawn: Sequence[Drawn], over: Abscissa, scale: float) -> Iterator[Curve]:
    """Ranges beneath, then ideal machines, turns before the last, and the last."""
    used: Counter[int] = Counter()
    dashes: dict[str, int] = {}
    for d in drawn:
        if d.series.name not in dashes:
            dashes[d.series.name] = used[index(d.colour)]
            used[index(d.colour)] += 1
    found: list[Curve] = []
    offsets: dict[str, float] = {}
    for d in sorted(drawn, key=lambda d: d.series.ideal):  # the own ones say where angles begin
        found += _of(d, over, scale, dashes[d.series.name], offsets)
    order = {'range': 0, 'ideal': 1, 'earlier': 2, '': 3}
    yield from sorted(found, key=lambda c: order[c.look])
    if any(d.series.ideal for d in drawn):
        yield Curve(NOTHING, NOTHING, 'ideal machine', colour=GROUND, look='ideal')


def _of(
    d: Drawn, over: Abscissa, scale: float, dash: int, offsets: dict[str, float]
) -> Iterator[Curve]:
    s = d.series
    same: dict[str, Any] = {'of': s.name, 'colour': d.colour}
    x, y = over.at(s.t), scale * s.values
    if s.ideal:
        same |= {'look': 'ideal'}
    else:
        same |= {'label': d.label}
    if s.events:
        x = np.mod(x, 360.0) if over.turns else x
        yield Curve(x, y, form='dots', marker='circle-open', **same)
        return
    if not over.turns:
        yield Curve(x, y, dash=0 if s.ideal else dash, **same)
        return
    pieces = _pieces(x, y, s.t)
    whole = [k for k, (x, *_) in enumerate(pieces) if np.ptp(x) > _WHOLE]
    newest = whole[-1] if whole else 0
    reach = d.reach
    if reach is None and len(pieces) > TURNS and whole and not s.ideal:
        reach = Envelope.of(x, s.values)
    if s.unit == 'rad':
        pieces = _within(pieces, newest, offsets, s.name)
    if reach is not None and s.unit != 'rad':
        at, low, high = reach
        quiet = same | {'look': 'range', 'label': ''}
        yield Curve(at, scale * high, low=scale * low, form='area', **quiet)
    elif newest and not s.ideal:
        quiet = same | {'look': 'earlier', 'label': ''}
        yield _curve(pieces[max(0, newest - TURNS + 1) : newest], dash=dash, **quiet)
    only = bool(whole) and (s.ideal or len(pieces) > TURNS)
    shown = pieces[newest : newest + 1] if only else pieces[newest:]
    yield _curve(shown, dash=0 if s.ideal else dash, **same)


Turn = tuple[Array, Array, Array]


def _pieces(x: Array, y: Array, t: Array) -> list[Turn]:
    """Angles within a turn [deg], values and times, turn by turn.

    Parameters
    ----------
    x : (N,) angles [deg], rising or falling; where they pass a whole turn a place is put in
    """
    nearest = 360.0 * np.round(x / 360.0)
    x = np.where(np.abs(x - nearest) < _SLACK, nearest, x)
    turn = np.floor(x / 360.0)
    ends = np.flatnonzero(np.diff(turn) != 0.0) + 1
    found = []
    for a, b in zip([0, *ends], [*ends, len(x)], strict=True):
        rows = np.array([x[a:b], y[a:b], t[a:b]])
        low = 360.0 * turn[a]
        if b < len(x):
            rows = np.append(rows, _crossing(x, y, t, b, turn), axis=1)
        if a > 0:
            rows = np.append(_crossing(x, y, t, a, turn), rows, axis=1)
        if np.ptp(rows[0]) > 10.0 * _SLACK or len(ends) == 0:
            found.append((np.clip(rows[0] - low, 0.0, 360.0), rows[1], rows[2]))
    return found


def _crossing(x: Array, y: Array, t: Array, k: int, turn: Array) -> Array:
    """The place (3, 1) between two others where one turn ends and the next begins."""
    at = 360.0 * max(turn[k - 1], turn[k])
    share = (at - x[k - 1]) / (x[k] - x[k - 1])
    return np.array([[at], *([z[k - 1] + share * (z[k] - z[k - 1])] for z in (y, t))])


def _within(pieces: list[Turn], newest: int, offsets: dict[str, float], name: str) -> list[Turn]:
    """Angles [deg] less the whole turns that bring each turn nearest to the newest one."""
    start = float(pieces[newest][1][0])
    offset = offsets.setdefault(name, start - 360.0 * round(start / 360.0))
    return [(x, y - 360.0 * round((y[0] - offset) / 360.0), t) for x, y, t in pieces]


def _curve(pieces: list[Turn], **same: Any) -> Curve:
    """Turns as one curve that breaks between them."""
    gap = np.full((3, 1), np.nan)
    rows = [part for piece in pieces for part in (gap, np.array(piece))][1:]
    x, y, t = np.concatenate(rows, axis=1)
    return Curve(x, y, when=t, **same)


def chart(
    series: Sequence[Series], title: str, over: Abscissa, numbers: Mapping[str, int],
    impacts: Array,
) -> Chart:  # fmt: skip
    """Lines over a common abscissa: those of one unit share a panel, modes of contact are bands.

    Parameters
    ----------
    numbers : of links and joints, for their colours
    impacts : (N,) times that are marked [s]
    """
    bands = [] if over.turns else [s for s in series if s.name.startswith('mode.')]
    units: dict[str, list[Series]] = {}
    for s in series:
        if s not in bands:
            units.setdefault(s.unit, []).append(s)
    found: list[Panel] = []
    for unit, lines in units.items():
        names = list(dict.fromkeys(s.name for s in lines))
        shades = dict(zip(names, colours(names, numbers), strict=True))
        drawn = [Drawn(s, s.name, shades[s.name], _item(s, numbers)) for s in lines]
        found += panels(drawn, over, '', unit, NOTHING if found else impacts)
    if bands:
        found.append(modes({_parts(s.name)[1]: Spells.of(s) for s in bands}))
    if not over.turns:
        ends = [over.at(s.t[[0, -1]]) for s in series if len(s.t)]
        axis = replace(over.axis, low=float(np.min(ends)), high=float(np.max(ends)))
        found = [replace(p, x=axis) for p in found]
    return Chart('', title, tuple(found), 'angle' if over.turns else 'time',
                 columns=columns(found))  # fmt: skip


def _item(s: Series, numbers: Mapping[str, int]) -> str:
    """The link or joint that a series is of."""
    known = next((part for part in s.name.split('.') if part in numbers), '')
    return known or (s.name[:-2] if s.name.endswith(('.x', '.y')) else s.name)


def _parts(name: str) -> tuple[str, str]:
    """What a series is, and of what: of a path the last field, and its item."""
    if '/' not in name and '[' not in name and '{' not in name:
        kind, _, rest = name.partition('.')
        return kind, rest
    kind = name.rpartition('.')[2].partition('[')[0].partition('{')[0]
    items = [part.partition(']')[0] for part in name.split('[')[1:]]
    return kind, ' '.join(x for x in items if x != ':')
