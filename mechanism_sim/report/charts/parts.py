"""Cams, gears, Geneva drives and frames on springs: what their readings say."""

from __future__ import annotations

import numpy as np

from mechanism_sim.analysis.published import PARTS
from mechanism_sim.messages.part_states import kinds_of
from mechanism_sim.report.charts.chart import Chart, Section
from mechanism_sim.report.charts.course import Course
from mechanism_sim.report.charts.curves import Curve, over_time, quantities
from mechanism_sim.report.charts.motion import over


def parts(course: Course) -> list[Section]:
    """A section for each kind of parts that the machine has."""
    machine, found = course.record.machine, []
    for node, kind in kinds_of(machine).items():
        charts: list[Chart] = []
        for joint in kind.joints(machine):
            slides = joint.second in machine.mechanism.sliding
            for title, labels, words, unit, force in joint.charts(slides=slides):
                if force and not machine.physics.has_forces:
                    continue
                curves = [
                    Curve(f'{field}.{joint.name}', label, 2 * i)
                    for i, (field, label) in enumerate(labels.items())
                ]
                key = f'{node}-{joint.name}-{next(iter(labels))}'.replace('_', '-')
                name = f'{joint.name}: {title}'
                charts += quantities(course, key, name, curves, words, unit, joint.name)
        title = PARTS[kind.topic].title
        if charts:
            title = title[:1].upper() + title[1:]
            found.append(Section(node.replace('_', '-'), title, over(course), tuple(charts)))
    if machine.scene.oscillators:
        found.append(_oscillators(course))
    return found


def _oscillators(course: Course) -> Section:
    charts = []
    for name in course.record.machine.scene.oscillators:
        for title, fields, words, unit in (
            ('displacement', 'xy', 'displacement', 'm'),
            ('force on the ground', ('force_x', 'force_y'), 'force', 'N'),
        ):
            curves = [
                Curve(f'oscillator.{name}.{f}', f[-1], 2 * i)
                for i, f in enumerate(fields)
                if np.any(course.run.lines[f'oscillator.{name}.{f}'].values)
            ]
            if not curves:
                continue
            key, head = f'oscillator-{name}-{words}', f'{name}: {title}'
            about = words, unit, name
            if course.long:
                found = over_time(
                    course, key, f'{head} in the last turns', curves, *about, course.detail
                )
                charts.append(found)
            head = f'{head} over the whole run'
            charts.append(over_time(course, f'{key}-run', head, curves, *about))
    text = (
        'How far each frame is from where its mounts carry it alone, and what its mounts transmit '
        'to the ground, less its own weight.'
    )
    return Section('oscillators', 'Frames on springs', text, tuple(charts))
