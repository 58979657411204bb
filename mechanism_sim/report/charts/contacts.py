"""Loose joints: their gaps, and when they follow, fly, stick and slide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mechanism_sim.planar.play import joint_of_gap
from mechanism_sim.report.charts.bands import Spells, modes
from mechanism_sim.report.charts.chart import Chart, ChartSection
from mechanism_sim.report.charts.course import ChartedRun, ChartWindow
from mechanism_sim.report.charts.curves import over_time

_SHUT = 1e-9  # [mm], never opened


def contacts(course: ChartedRun) -> ChartSection | None:
    """Gap and mode of every joint with clearance."""
    gaps = gaps_of(course)
    if not gaps:
        return None
    charts = [
        _chart(course, window, joint, names, f'{joint}: gap over {when}', key)
        for joint, names in gaps.items()
        for window, when, key in course.windows(f'gap-{joint}')
    ]
    text = (
        'The gap is zero while the contact is closed. The band below shows the contact mode; '
        'where intervals are too short to be told apart, the share of time of each mode.'
    )
    return ChartSection('contact', 'Contact', text, tuple(charts))


def gaps_of(course: ChartedRun) -> dict[str, list[str]]:
    """The gaps of each loose joint: of one with two walls there are two."""
    machine = course.record.machine
    found: dict[str, list[str]] = {}
    for name in machine.physics.clearances:
        found.setdefault(joint_of_gap(machine.mechanism, name).name, []).append(name)
    return found


def _chart(
    course: ChartedRun, window: ChartWindow, joint: str, names: list[str], title: str, key: str
) -> Chart:
    found = over_time(course, key, title, [f'gap.{name}' for name in names], joint, window)
    panel = found.panels[0]
    shut = max(np.abs(c.y).max(initial=0.0) for c in panel.curves) < _SHUT
    # do not make a picture of rounding
    y = replace(panel.y, low=0.0, high=1e-3 if shut else None)
    clearances = course.record.machine.physics.clearances
    rows = {
        name.removeprefix(joint)[1:] if len(names) > 1 else '':
        spells(window, clearances.index(name))
        for name in names
    }  # fmt: skip
    return replace(found, panels=(replace(panel, y=y), modes(rows, panel.x)))


def spells(window: ChartWindow, gap: int) -> Spells:
    """The modes of a gap in a window, exact to the last digit: steps end where modes change."""
    motion = window.record.piece.motion
    first, last = motion.curve.locate(np.array([window.start, window.end]))
    modes = motion.modes[first : last + 1, gap]
    new = np.flatnonzero(np.diff(modes.astype(int), prepend=-1))
    starts = np.maximum(motion.curve.start[first : last + 1][new], window.start)
    return Spells(np.append(starts, window.end), modes[new])
