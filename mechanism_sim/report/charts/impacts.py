"""Charts of loose joints: gaps and modes; impacts by time, size and place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mechanism_sim.analysis.roses import Rose, impact_rose, wear_maps
from mechanism_sim.arrays import Array
from mechanism_sim.engine.events import Impacts
from mechanism_sim.planar.gaps import joint_of_gap
from mechanism_sim.report.charts.bands import Spells, modes
from mechanism_sim.report.charts.chart import (
    TIME,
    Axis,
    Chart,
    ChartCurve,
    ChartSection,
    Panel,
    polar,
)
from mechanism_sim.report.charts.charted_run import ChartedRun, ChartWindow
from mechanism_sim.report.charts.curves import over_time
from mechanism_sim.report.charts.thinning import tallest
from mechanism_sim.units import counted, written

_SHUT = 1e-12  # [m], never opened
STEMS = 1500
"""Impacts that a chart shows one by one: of more, the hardest in each of so many bins of time."""

_RAYS = 600  # impacts that a rose shows: of more, the hardest


def impacts(charted: ChartedRun, skip: int) -> ChartSection | None:
    """Impacts over time, by direction, and what wears the bearings."""
    record = charted.record
    struck = record.piece.impacts
    struck = struck.where(struck.column('t') >= charted.begin)
    if not struck:
        return None
    t, charts = struck.column('t'), list[Chart]()
    for window, when, key in charted.windows('impacts'):
        if some := struck.where((window.start <= t) & (t <= window.end)):
            title = f'Impacts in {when.partition(":")[0]}'  # of these the hardest
            charts.append(_stems(charted, some, window, title, key))
    for joint in record.loose_joints:
        if joint in struck.names:
            rose = impact_rose(record, joint, skip)
            charts += [
                rose_chart(rose, on_pin, *_joint(charted, joint)) for on_pin in (True, False)
            ]
        if record.machine.physics.has_forces:
            charts += _wear(charted, joint, skip)
    return ChartSection('impacts', 'Impacts', _text(charted, struck), tuple(charts))


def _text(charted: ChartedRun, struck: Impacts) -> str:
    impulse, lost = struck.column('normal_impulse'), struck.column('energy_loss').sum()
    hardest = struck[int(impulse.argmax())]
    many, total = counted(len(struck), 'impact', ','), written(impulse.sum(), 'N s')
    text = (
        f'{many} with an impulse of {total} and a loss of {written(lost, "J")} in all; the '
        f'hardest, {written(hardest.normal_impulse, "N s")}, in {hardest.joint} at '
        f'{hardest.t:.6g} s.'
    )
    if np.bincount(struck.gaps).max() > STEMS:
        text += f' Of the whole run the hardest in each of {STEMS} intervals are drawn.'
    if np.isin(struck.names, charted.record.loose_joints).any():
        text += (
            ' In polar charts each impact is a line to the place it strikes, in the frame of the '
            'part that is struck; the hardest are marked by their rank.'
        )
    return text


def _stems(
    charted: ChartedRun, struck: Impacts, window: ChartWindow, title: str, key: str
) -> Chart:
    curves = []
    # the gaps with the number of their joint's colour, and whether it is the joint's second
    joints = charted.record.machine.physics.joints
    for name, number, twin in [
        (name, joints.index(joint), i > 0)
        for joint, names in gaps_of(charted).items()
        for i, name in enumerate(names)
    ]:
        own = struck.of_joint(name)
        t, size = own.column('t'), own.column('normal_impulse')
        if len(k := tallest(t, size, STEMS)):
            curves.append(ChartCurve(
                t[k], size[k], name, name, number, form='stems',
                marker='circle-open' if twin else 'circle',
                notes=[f'approach {v:.4g} m/s' for v in own.column('approach_speed')[k]],
            ))  # fmt: skip
    x = replace(TIME, low=window.start, high=window.end)
    panel = Panel(x, Axis('normal impulse', 'N s', low=0.0), tuple(curves))
    return Chart(key, title, (panel,), 'time')


def rose_chart(rose: Rose, on_pin: bool, joint: str, number: int) -> Chart:
    """[SB] 8.11: every impact as a line towards its contact point, the six hardest marked."""
    part, link = ('pin', rose.pin) if on_pin else ('bushing', rose.bushing)
    degrees = np.degrees(rose.on_pin if on_pin else rose.on_bushing)
    impulse = rose.normal_impulse
    chosen = np.argsort(-impulse, kind='stable')[:_RAYS]
    y = rose.largest
    curves = (
        ChartCurve(
            degrees[chosen], impulse[chosen], of=joint, colour=number, form='stems', look='fine'
        ),
        ChartCurve(
            degrees[y], impulse[y], of=joint, colour=number, form='dots', marker='circle',
            when=rose.time[y], texts=_labels(impulse[y], np.radians(degrees[y])),
            notes=[_rank(i) for i in range(len(y))],
        ),
    )  # fmt: skip
    title = f'{rose.joint}: impacts on the {part}, seen from the {link}'
    key = f'rose-{rose.joint}-{part}'
    return polar(key, title, 'N s', curves, joint, 'normal impulse')


def _labels(size: Array, direction: Array) -> list[str]:
    """Ranks; where some would lie on one another, one label for all of them: 2nd to 4th, 6th."""
    place = size * np.exp(1j * direction)
    groups: list[list[int]] = []
    for i, here in enumerate(place):
        near = [g for g in groups if _overlap(here - place[g[0]], size.max())]
        if near:
            near[0].append(i)
        else:
            groups.append([i])
    found = [''] * len(place)
    for group in groups:
        begins = [i for i in group if i - 1 not in group]
        ends = [i for i in group if i + 1 not in group]
        spans = (
            f'{_rank(a)} to {_rank(b)}' if b > a + 1 else ', '.join(map(_rank, range(a, b + 1)))
            for a, b in zip(begins, ends, strict=True)
        )
        found[group[0]] = ', '.join(spans)
    return found


def _overlap(apart: complex, largest: float) -> bool:
    """True of labels that lie on one another, so far apart: they are wide and low."""
    low = abs(apart.real) <= 0.7 * largest and abs(apart.imag) <= 0.1 * largest
    return low or abs(apart) <= 0.22 * largest


def _rank(i: int) -> str:
    return ('hardest', '2nd', '3rd')[i] if i < 3 else f'{i + 1}th'


def _wear(charted: ChartedRun, gap: str, skip: int) -> list[Chart]:
    """Archard's measure of wear by direction on bushing and pin."""
    maps = wear_maps(charted.record, gap, skip=skip)
    joint, number = _joint(charted, gap)
    if not any(m.load_way.any() for m in maps):
        return []
    found = []
    for part, wear in zip(('bushing', 'pin'), maps, strict=True):
        title = f'{gap}: wear of the {part} on {wear.link}, normal force times sliding distance'
        about = wear.edges, wear.load_way, 'N m', joint, number
        found.append(wear_chart(f'wear-{gap}-{part}', title, *about))
    return found


def wear_chart(
    key: str, title: str, edges: Array, sums: Array, unit: str, joint: str, number: int
) -> Chart:
    """Sums (n,) over sectors between edges (n + 1,) [rad]."""
    high = np.repeat(sums, 2)
    x = np.degrees(np.repeat(edges, 2)[1:-1])
    curve = ChartCurve(x, high, of=joint, colour=number, form='area', look='wear', low=0.0 * high)
    return polar(key, title, unit, [curve], joint, 'sum')


def _joint(charted: ChartedRun, gap: str) -> tuple[str, int]:
    """The joint of a gap, and the number of its colour."""
    name = joint_of_gap(charted.record.machine.mechanism, gap).name
    return name, charted.record.machine.physics.joints.index(name)


def contacts(charted: ChartedRun) -> ChartSection | None:
    """Gap and mode of every joint with clearance."""
    gaps = gaps_of(charted)
    if not gaps:
        return None
    charts = []
    for joint, names in gaps.items():
        for window, when, key in charted.windows(f'gap-{joint}'):
            title = f'{joint}: gap over {when}'
            found = over_time(
                charted, key, title, [f'gap.{name}' for name in names], joint, window
            )
            panel = found.panels[0]
            shut = max(np.abs(c.y).max(initial=0.0) for c in panel.curves) < _SHUT
            if shut:  # do not make a picture of rounding
                panel = replace(panel, curves=tuple(replace(c, y=0.0 * c.y) for c in panel.curves))
            y = replace(panel.y, low=0.0, high=1e-6 if shut else None)
            clearances = charted.record.machine.physics.clearances
            rows = {
                name.removeprefix(joint)[1:] if len(names) > 1 else '':
                spells(window, clearances.index(name))
                for name in names
            }  # fmt: skip
            charts.append(replace(found, panels=(replace(panel, y=y), modes(rows, panel.x))))
    text = (
        'The gap is zero while the contact is closed. The band below shows the contact mode; '
        'where intervals are too short to be distinguished, the share of time of each mode.'
    )
    return ChartSection('contact', 'Contact', text, tuple(charts))


def gaps_of(charted: ChartedRun) -> dict[str, list[str]]:
    """The gaps of each loose joint: of one with two walls there are two."""
    machine = charted.record.machine
    found: dict[str, list[str]] = {}
    for name in machine.physics.clearances:
        found.setdefault(joint_of_gap(machine.mechanism, name).name, []).append(name)
    return found


def spells(window: ChartWindow, gap: int) -> Spells:
    """The modes of a gap in a window, exact to the last digit: steps end where modes change."""
    motion = window.record.piece.motion
    first, last = motion.curve.locate(np.array([window.start, window.end]))
    modes = motion.modes[first : last + 1, gap]
    new = np.flatnonzero(np.diff(modes.astype(int), prepend=-1))
    starts = np.maximum(motion.curve.start[first : last + 1][new], window.start)
    return Spells(np.append(starts, window.end), modes[new])
