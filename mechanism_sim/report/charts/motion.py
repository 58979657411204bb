"""Charts of motion, of drives and of joint forces over the drive's angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mechanism_sim.analysis.series import sampled
from mechanism_sim.engine.physics import is_force_open
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.mechanism import Prismatic
from mechanism_sim.planar.rotor import Rotor
from mechanism_sim.report.charts.chart import Chart, ChartCurve, ChartSection, polar
from mechanism_sim.report.charts.charted_run import ChartedRun
from mechanism_sim.report.charts.curves import over_drive, over_time, quantities
from mechanism_sim.report.charts.lines import hodograph

_NOTHING = 1e-9  # share of the largest of its kind below which a value is rounding

_FLAT = 50.0
"""Times of the largest value of what varies from which on a constant hides it."""

_KINDS = {
    'position': ('Angles', 'Displacements'),
    'velocity': ('Angular velocities', 'Velocities'),
    'acceleration': ('Angular accelerations', 'Accelerations'),
}


def over(charted: ChartedRun) -> str:
    """Caption of the turns that are shown."""
    if charted.turns is None:
        return f'Over time, as the {charted.record.machine.plan.main} makes no full turn.'
    first, last = charted.turns
    main, count, again = charted.record.machine.plan.main, round(last - first), charted.again
    shown = again if charted.run.reach else count
    turns = 'The last full turn' if shown == 1 else f'The last {shown} full turns'
    found = f'{turns} of the {main}'
    if charted.run.reach:
        found += '; the pale band is the range over all turns'
    elif count > again:
        found += ', the one before the last faint' if again == 1 else f', all but {again} faint'
    if charted.ideal is not None:
        found += '; the thick pale line is the machine with ideal joints'
    return f'{found}.'


def motion(charted: ChartedRun) -> ChartSection:
    """Angles, rates and accelerations of all coordinates but those of elastic links."""
    machine = charted.record.machine
    physics, rotors, charts = machine.physics, machine.mechanism.having(Rotor), []
    for kind, titles in _KINDS.items():
        for straight, title in zip((False, True), titles, strict=True):
            names = [
                f'{kind}.{c}'
                for c in physics.coordinates
                if (c in physics.displacements) == straight
                and (c not in machine.mechanism.deformations or c.partition('.')[0] in rotors)
            ]
            if kind == 'position' and charted.turns:
                names = [name for name in names if name != f'position.{machine.plan.main}']
            if kind == 'acceleration':  # of a drive at constant speed there is none
                names = [name for name in names if _varies(charted, name)]
            names = _seen_together(charted, names)
            if names:
                key = f'motion-{kind}-{"straight" if straight else "turning"}'
                charts.append(over_drive(charted, key, title, names))
    speed = f'velocity.{machine.plan.main}'
    if charted.turns and charted.long and _varies(charted, speed):
        title = f'Speed of the {machine.plan.main} over {charted.whole}'
        charts.append(over_time(charted, 'motion-speed-run', title, [speed]))
    return ChartSection('motion', 'Motion', over(charted), tuple(charts))


def _seen_together(charted: ChartedRun, names: Sequence[str]) -> list[str]:
    """Names of a chart, none if nothing varies.

    Constants, such as the speed of a drive, go where what varies would be a flat line beside them.
    """
    size = {name: np.abs(charted.detail.lines[name].values).max() for name in names}
    varying = [name for name in names if _varies(charted, name)]
    largest = max((size[name] for name in varying), default=0.0)
    return [n for n in names if n in varying or size[n] < _FLAT * largest] if varying else []


def _varies(charted: ChartedRun, name: str) -> bool:
    values = charted.detail.lines[name].values
    return bool(np.ptp(values) > _NOTHING * np.abs(values).max())


def elastic(charted: ChartedRun) -> ChartSection | None:
    """Deflection and stress of elastic links."""
    beams = charted.record.machine.mechanism.having(Beam)
    known, charts = charted.run.quantities, []
    for kind, title in (('deflection', 'Deflection in the middle'), ('stress', 'Largest stress')):
        names = [name for link in beams if (name := f'{kind}.{link}') in known]
        charts += quantities(charted, f'elastic-{kind}', title, names)
    text = 'Deflection is across the link; stress is that at the outer fibres.'
    return ChartSection('elastic', 'Elastic links', text, tuple(charts)) if charts else None


def forces(charted: ChartedRun) -> ChartSection | None:
    """Forces in all joints: their size, and as vectors."""
    physics = charted.record.machine.physics
    if not physics.has_forces:
        return None
    joints = [j for j in physics.joints if not is_force_open(physics.undetermined, j)]
    sizes = [f'reaction.{joint}.size' for joint in joints]
    charts = quantities(charted, 'forces', 'Force in each joint', sizes, run=True)
    if not charts:
        return None
    lines = charted.detail.lines
    moments = [name for joint in joints if (name := f'bearing_moment.{joint}.size') in lines]
    if moments:
        title = 'Moment of each bearing that holds its pin by both ends'
        charts.append(over_drive(charted, 'bearing-moments', title, moments))
    largest = {joint: lines[f'reaction.{joint}.size'].values.max() for joint in joints}
    charts += [
        _hodograph(charted, joint)
        for joint in joints
        if largest[joint] > _NOTHING * max(largest.values())
    ]
    text = (
        'Polar charts show the force of the first link on the second as a vector in the fixed '
        'frame, without the impulses of impacts.'
    )
    return ChartSection('forces', 'Joint forces', text, tuple(charts))


def _hodograph(charted: ChartedRun, joint: str) -> Chart:
    """The force of a joint over its direction, beneath it that of the ideal machine."""
    name, curves = f'reaction.{joint}.size', list[ChartCurve]()
    for window in (charted.ideal, charted.detail):
        if window is not None and name in window.quantities:
            piece = window.record.piece
            (size,) = sampled(piece, [name], np.unique(window.lines[name].at))
            curves += hodograph(piece, replace(size, ideal=window is charted.ideal)).curves
    pair = charted.record.machine.mechanism.joint(joint)
    title = f'{joint}: {pair.first} on {pair.second}'
    return polar(f'forces-{joint}', title, 'N', curves, joint, 'force')


def drive(charted: ChartedRun) -> ChartSection | None:
    """Torque or force of every drive."""
    machine = charted.record.machine
    physics, main = machine.physics, machine.plan.main
    if not physics.has_forces or not physics.driven:
        return None
    charts: list[Chart] = []
    for straight, word in ((False, 'torque'), (True, 'force')):
        names = [
            'drive_torque' if c == main else f'drive_torque.{c}'
            for c in physics.driven
            if (c in physics.displacements) == straight
        ]
        if names:
            charts += quantities(charted, f'drive-{word}', f'Drive {word}', names, run=True)
    return ChartSection('drive', 'Drive', '', tuple(charts))


def guides(charted: ChartedRun) -> ChartSection | None:
    """Forces and moments that guides and slots transmit."""
    machine = charted.record.machine
    lines = (j for j in machine.mechanism.joints if j.line)
    open_ = machine.physics.undetermined
    joints = [j for j in lines if not is_force_open(open_, j.name)]
    if not machine.physics.has_forces or not joints:
        return None
    title, text = 'Force across each guide and slot', ''
    charts = quantities(
        charted, 'guides-force', title, [f'reaction.{j.name}.size' for j in joints]
    )
    names = [f'reaction.{j.name}.moment' for j in joints if j.name not in open_]
    if charts and names and any(isinstance(j, Prismatic) for j in joints):
        charts.append(over_drive(charted, 'guides-moment', 'Moment in each guide', names))
        text = 'The moment is that of the first link on the second, about the sliding point.'
    return ChartSection('guides', 'Guides and slots', text, tuple(charts)) if charts else None
