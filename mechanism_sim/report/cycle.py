"""A cycle as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from mechanism_sim import strict_json
from mechanism_sim.report.sections import Section, text
from mechanism_sim.report.summary import (
    describe_no_limits,
    no_limits_to_json,
    undetermined_to_json,
)
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.ranges import Extreme
from mechanism_sim.results.strokes import Swing
from mechanism_sim.scene import Machine
from mechanism_sim.scene.load import RAMP
from mechanism_sim.units import counted, for_people

_SHORT = 0.05  # share of the cycle
_SWING = ('size', 'turns', 'period', 'rising', 'falling', 'standing', 'time_ratio', 'ripple')

_NOTHING = 1e-8  # share of the other end of a range, printed with six digits


def where(cycle: Cycle, extreme: Extreme) -> str:
    """The position of the drive at an extreme, within the turns that bring all again."""
    if cycle.drive in cycle.machine.mechanism.displacements:
        unit, scale = for_people('m', cycle.machine.mechanism.size)
        return f'{scale * extreme.drive:.4f} {unit}'
    again = 360.0 * cycle.machine.drive.repetition.turns
    angle = math.degrees(extreme.drive) % again
    return f'{0.0 if angle > again - 5e-5 else angle:.4f} deg'


def render(cycle: Cycle) -> str:
    """Return the text that the command line shows."""
    return text(sections(cycle))


def sections(cycle: Cycle) -> Iterator[Section]:
    """Extremes, strokes and means of a cycle."""
    yield extremes(cycle)
    limits = describe_no_limits(cycle.machine, cycle.no_limits)
    notes = [*_peaks(cycle), *_swings(cycle), *_drive(cycle), *limits, *_range(cycle)]
    yield Section(notes=notes)


def position(machine: Machine, value: float, found: Mapping[str, float]) -> Section:
    """Quantities of a machine at one position of its drive [rad, m]."""
    known, main = catalogue(machine), machine.plan.main
    shown, scale = for_people(known[f'position.{main}'].unit, abs(value))
    rows = []
    for name, x in found.items():
        unit, factor = _unit(known[name].unit, x)
        rows.append((name, unit, f'{factor * x:z.9g}' if math.isfinite(x) else 'not determined'))
    head = ('', 'unit', 'value')
    return Section(f'at {main} = {scale * value:.9g} {shown}', table=[head, *rows], left=2)


def _unit(unit: str, *values: float) -> tuple[str, float]:
    """Lengths are in the unit of their size; all else of a kind is compared in one unit."""
    return for_people(unit, max(map(abs, values)) if unit == 'm' else 0.0)


def _range(cycle: Cycle) -> Iterator[str]:
    """Describe the motion of the drive between limits, and quantities unbounded there."""
    if not cycle.ranges:
        return
    yield (
        f'{cycle.drive} goes from one of its limits to the other; it accelerates and brakes '
        f'there within {100.0 * RAMP:g} % of the way: at constant speed the speeds of links '
        'would be infinite there'
    )
    if cycle.unbounded:
        yield f'tend to infinity at a limit: {", ".join(sorted(cycle.unbounded))}'


def extremes(cycle: Cycle) -> Section:
    """Least and greatest values, and where; people read sizes, JSON has components, too."""
    span = f'{cycle.t[0]:.6g} s to {cycle.t[-1]:.6g} s'
    title = f'{cycle.machine.name}: {len(cycle.t)} samples from {span}'
    rows, known = [], catalogue(cycle.machine)
    for name, ends in cycle.extremes().items():
        if known.is_component(name):
            continue
        both = ends.least, ends.greatest
        shown, scale = _unit(known[name].unit, *(x.value for x in both))
        # a step in rates is found a little beside its zero: what that leaves is nothing
        nothing = max(ends.rounding, _NOTHING * max(abs(x.value) for x in both))
        low, high = (f'{scale * x.value:.6g}' if abs(x.value) > nothing else '0' for x in both)
        if ends.constant:
            rows.append((name, shown, low, 'always', '', ''))
        else:
            rows.append(
                (name, shown, low, where(cycle, ends.least), high, where(cycle, ends.greatest))
            )
    head = ('', 'unit', 'least', f'at {cycle.drive}', 'greatest', f'at {cycle.drive}')
    return Section(title, table=[head, *rows], left=2)


def _peaks(cycle: Cycle) -> Iterator[str]:
    """Peaks that are short relative to the cycle, with a misleading height."""
    for name, shape in cycle.peaks().items():
        if shape.whole and shape.duration <= _SHORT * cycle.duration:
            yield (
                f'{name} is above half of its peak for {shape.duration:.4g} s, which carries '
                f'{shape.impulse:.4g} {catalogue(cycle.machine)[name].unit} s'
            )


def _swings(cycle: Cycle) -> Iterator[str]:
    machine = cycle.machine
    for name, swing in cycle.swings().items():
        shown, scale = for_people(catalogue(machine)[f'position.{name}'].unit, swing.size)
        if swing.turns:
            line = f'{name} makes {counted(swing.turns, "full turn")}'
            back = sum(abs(x.way) for x in swing.strokes if x.way * swing.turns < 0.0)
            line += f' and goes back {scale * back:.6g} {shown} on the way' if back else ''
            yield line + _dwells(swing, shown, scale)
            continue
        line = f'{name} goes over {scale * swing.size:.6g} {shown}'
        if swing.period is None or not (swing.comes_back or swing.standing):
            yield f'{line} in {cycle.duration:.6g} s'
            continue
        if swing.time_ratio is not None:
            line += (
                f', up in {swing.rising:.6g} s and down in {swing.falling:.6g} s: '
                f'time ratio {swing.time_ratio:.5g}'
            )
        elif swing.strokes:
            line += f' in {len(swing.strokes)} strokes: ' + ', '.join(
                f'{"up" if x.way > 0.0 else "down"} {scale * abs(x.way):.6g} in {x.duration:.6g} s'
                for x in swing.strokes
            )
        elif not swing.comes_back:
            count = round(cycle.duration / swing.period)
            moving = swing.period - (swing.standing or 0.0)
            line += f' in {f"{count} moves of " if count > 1 else ""}{moving:.6g} s'
        yield line + _dwells(swing, shown, scale)


def _dwells(swing: Swing, unit: str, scale: float) -> str:
    if not swing.dwells or not swing.size:
        return ''
    within = f' within {scale * swing.ripple:.3g} {unit}' if swing.ripple else ''
    return f'; stands{within} ' + ', '.join(
        f'at {scale * x.position:.6g} {unit} for {x.duration:.6g} s' for x in swing.dwells
    )


def _drive(cycle: Cycle) -> Iterator[str]:
    machine = cycle.machine
    if not machine.physics.has_forces:
        return
    for name in cycle.drive_torques:
        if name in cycle.unbounded and cycle.ranges:
            continue
        yield f'{name}: root mean square {cycle.rms(name):.6g} {catalogue(machine)[name].unit}'
    power = cycle.mean_power
    if abs(power) <= 1e-12 * cycle.rms('drive_power'):
        power = 0.0  # supplied energy is returned
    yield f'mean power of the drive {power:.6g} W'
    if (efficiency := cycle.efficiency) is not None:
        yield f'efficiency {efficiency:.6g}: the rest is friction in ideal joints'
    elif power > 0.0 and any(name.startswith('friction_loss.') for name in cycle.names):
        yield 'efficiency: none, for loads drive the machine, too: friction takes more'


def to_json(cycle: Cycle) -> dict[str, object]:
    """A cycle in SI units, and the unit of each column; JSON has no infinity: null."""
    machine = cycle.machine
    forces = machine.physics.has_forces
    return {
        'scene': machine.name,
        'level': machine.level.value,
        'drive': cycle.drive,
        'start': float(cycle.t[0]),
        'end': float(cycle.t[-1]),
        'samples': len(cycle.t),
        'units': cycle.units(),
        'extremes': {
            name: strict_json.plain({'least': ends.least, 'greatest': ends.greatest})
            for name, ends in cycle.extremes().items()
        },
        'peaks': {
            name: x._asdict() | {'duration': x.duration} for name, x in cycle.peaks().items()
        },
        'swings': {name: _swing(swing) for name, swing in cycle.swings().items()},
        'rms': {name: strict_json.plain(cycle.rms(name)) for name in cycle.drive_torques},
        'mean_power': strict_json.plain(cycle.mean_power) if forces else None,
        'efficiency': cycle.efficiency if forces else None,
        'no_limits': no_limits_to_json(cycle.no_limits),
        **undetermined_to_json(machine),
        'unbounded': sorted(cycle.unbounded),
    }


def _swing(swing: Swing) -> dict[str, object]:
    return {key: getattr(swing, key) for key in _SWING} | {
        'strokes': [x._asdict() for x in swing.strokes],
        'dwells': [x._asdict() for x in swing.dwells],
    }
