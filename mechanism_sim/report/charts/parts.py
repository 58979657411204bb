"""Cams, gears, Geneva drives and frames on springs: what their readings say."""

from __future__ import annotations

import numpy as np

from mechanism_sim.analysis.published import PARTS
from mechanism_sim.messages.part_states import kinds_of
from mechanism_sim.report.charts.chart import Chart, ChartSection
from mechanism_sim.report.charts.course import ChartedRun
from mechanism_sim.report.charts.curves import over_time, quantities
from mechanism_sim.report.charts.motion import over


def parts(course: ChartedRun) -> list[ChartSection]:
    """A section for each kind of parts that the machine has."""
    machine, known, found = course.record.machine, course.run.quantities, []
    for node, kind in kinds_of(machine).items():
        charts: list[Chart] = []
        for joint in kind.joints(machine):
            for title, fields in joint.charts.items():
                names = [f'{field}.{joint.name}' for field in fields]
                if not known.keys() >= set(names):
                    continue  # a force, where masses are not known
                key = f'{node}-{joint.name}-{next(iter(fields))}'.replace('_', '-')
                charts += quantities(course, key, f'{joint.name}: {title}', names, joint.name)
        title = PARTS[kind.topic].title
        if charts:
            title = title[:1].upper() + title[1:]
            found.append(ChartSection(node.replace('_', '-'), title, over(course), tuple(charts)))
    if machine.scene.oscillators:
        found.append(_oscillators(course))
    return found


def _oscillators(course: ChartedRun) -> ChartSection:
    charts = []
    for name in course.record.machine.scene.oscillators:
        for title, fields in (
            ('displacement', 'xy'), ('force on the ground', ('force_x', 'force_y')),
        ):  # fmt: skip
            names = [f'oscillator.{name}.{field}' for field in fields]
            names = [x for x in names if np.any(course.run.lines[x].values)]
            if not names:
                continue
            key = f'oscillator-{name}-{title.partition(" ")[0]}'
            charts += [
                over_time(course, own, f'{name}: {title} over {when}', names, name, window)
                for window, when, own in course.windows(key)
            ]
    text = (
        'Displacement of each frame from its static position, and force of its mounts on the '
        'ground without its weight.'
    )
    return ChartSection('oscillators', 'Frames on springs', text, tuple(charts))
