"""The tables of the thesis's experiment, as Markdown and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from mechanism_sim.analysis.angular_reconstruction import LINKS, Estimate
from mechanism_sim.analysis.experiment import Experiment, Trial
from mechanism_sim.analysis.swing import MESHES
from mechanism_sim.strict_json import plain

_METHODS = {
    'thesis': 'as [SB]',
    'corrected': 'gravity and mean off',
    'undone': 'instrument undone',
    'two': 'two sensors',
    'two, undone': 'two, undone',
    'closed': 'trapezoids, closed',
    'spectrum': 'by spectrum',
    'filter': 'by filter',
}


class Table(NamedTuple):
    """A table with a heading."""

    title: str
    columns: tuple[str, ...]
    rows: list[tuple[str, ...]]

    def markdown(self) -> str:
        """As Markdown, with the columns in line."""
        lines = [self.columns, *self.rows]
        widths = [max(len(line[k]) for line in lines) for k in range(len(self.columns))]
        text = [
            '| ' + ' | '.join(f'{c:{w}}' for c, w in zip(line, widths, strict=True)) + ' |'
            for line in lines
        ]
        rule = '|' + '|'.join('-' * (w + 2) for w in widths) + '|'
        return '\n'.join([f'### {self.title}', '', text[0], rule, *text[1:]])


def tables(found: Experiment) -> list[Table]:
    """All tables of an experiment."""
    return [_severity(found), _bearings(found), _course(found), *_errors(found)]


def render(found: Experiment) -> str:
    """The tables for people."""
    restitution, friction = found.bearing
    head = [
        f'{len(found.trials)} runs; measured is the machine of restitution {restitution:g} and '
        f'friction {friction:g}',
    ]
    if found.assumed is found.reference:
        head.append(
            'no other machine was run at its highest speed and largest clearance: no alpha'
        )
    else:
        head.append(
            f'alpha = {found.alpha:.3g}: {_condition(found.assumed)} in its first turns with '
            'impacts '
            f'({found.assumed.bag}), as means over {MESHES[-1]:g} deg, over what the instrument '
            f'shows of {_condition(found.reference)} ({found.reference.bag})'
        )
    cut = sum(swing.overloads for t in found.trials for swing in t.swings.values())
    if cut:
        head.append(f'{cut} samples of all runs were cut at the range of their converters')
    return '\n\n'.join(['\n'.join(head), *(table.markdown() for table in tables(found))])


def _condition(trial: Trial) -> str:
    return f'restitution {trial.condition.restitution:g}, friction {trial.condition.friction:g}'


def _place(trial: Trial) -> tuple[str, str]:
    """Speed [rpm] and clearance [mm]."""
    c = trial.condition
    return f'{c.speed * 30.0 / math.pi:.0f}', f'{1e3 * c.radial:.4g}'


def _severity(found: Experiment) -> Table:
    rows = []
    for trial in found.measured.values():
        means = trial.impacts.means
        heard = [f'{trial.swings[link].severity.heard:.0f}' for link in LINKS]
        rows.append((*_place(trial), *_impacts(means), *heard))
    columns = (
        'rpm', 'clearance [mm]', 'impacts a turn', 'sum of impulses [mN s]', 'I_n [mN s]',
        'coupler [rad/s^2]', 'rocker [rad/s^2]',
    )  # fmt: skip
    return Table(
        'Impacts, and the deviation of the accelerations as the instrument shows it', columns, rows
    )


def _impacts(means: Mapping[str, tuple[float, float, float]]) -> tuple[str, str, str]:
    scales = ('count', 1.0), ('impulse', 1e3), ('I_n', 1e3)
    count, impulse, index = (
        f'{scale * means[name][0]:.3g} +- {scale * means[name][1]:.2g}' for name, scale in scales
    )
    return count, impulse, index if math.isfinite(means['I_n'][0]) else 'none'


def _bearings(found: Experiment) -> Table:
    rows = []
    for trial in found.bearings:
        coupler = trial.swings['coupler']
        late, early = coupler.severity, coupler.severity_at_first
        figures = [early.heard, *early.by_mesh, late.between, late.heard, *late.by_mesh]
        reference = found.assumed.swings['coupler'].severity_at_first.by_mesh[-1]
        rows.append(
            (
                f'{trial.condition.restitution:g}',
                f'{trial.condition.friction:g}',
                *(f'{x:.0f}' for x in figures),
                f'{reference / late.heard:.3g}',
            )
        )
    meshes = [f'mean over {mesh:g} deg' for mesh in MESHES]
    columns = (
        'restitution', 'friction', 'at first: shown', *(f'at first: {m}' for m in meshes),
        'later: between impacts', 'later: shown', *(f'later: {m}' for m in meshes), 'alpha',
    )  # fmt: skip
    title = 'Deviation of the acceleration of the coupler by bearing, rms [rad/s^2]'
    return Table(title, columns, rows)


def _course(found: Experiment) -> Table:
    """What becomes of the assumed machine and the measured one in time."""
    rows = []
    trials = [found.assumed, found.reference]
    count = min(len(trial.every.count) for trial in trials)
    begin, end = 0, 1
    while begin < count:
        end = min(end, count)
        cells = [
            cell
            for trial in trials
            for cell in (
                f'{trial.every.count[begin:end].mean():.1f}',
                f'{1e3 * trial.every.impulse[begin:end].mean():.4g}',
            )
        ]
        rows.append((f'{begin} to {end}', *cells))
        begin, end = end, 2 * end
    heads = [f'{what}, {_condition(t)}' for t in trials for what in ('impacts', 'impulse [mN s]')]
    return Table('Impacts and sum of impulses a turn, from the start', ('turns', *heads), rows)


def _errors(found: Experiment) -> Iterator[Table]:
    """Relative rms errors [%], the largest in units of the rms of the truth in brackets."""
    for quantity in ('acceleration', 'velocity'):
        for link in LINKS:
            for against in ('what the instrument could show', 'the truth'):
                rows = []
                names: list[str] = []
                for trial in found.measured.values():
                    swing = trial.swings[link]
                    estimates = (
                        swing.accelerations if quantity == 'acceleration' else swing.velocities
                    )
                    names = list(estimates)
                    rows.append(
                        (*_place(trial), *(_error(e, against) for e in estimates.values()))
                    )
                title = f'Angular {quantity} of the {link} against {against}, rms (largest) [%]'
                yield Table(title, ('rpm', 'clearance [mm]', *(_METHODS[n] for n in names)), rows)


def _error(estimate: Estimate, against: str) -> str:
    off = estimate.error if against == 'the truth' else estimate.error_of_shown
    return f'{100.0 * off.relative:.3g} ({100.0 * off.largest * off.relative / off.rms:.3g})'


def to_json(found: Experiment) -> dict[str, object]:
    """All numbers, in SI units."""
    return {
        'restitution': found.bearing[0],
        'friction': found.bearing[1],
        'alpha': found.alpha if found.assumed is not found.reference else None,
        'assumed': found.assumed.bag,
        'reference': found.reference.bag,
        'trials': [_trial(trial) for trial in found.trials],
    }


def _trial(trial: Trial) -> dict[str, object]:
    return {
        'bag': trial.bag,
        **trial.condition._asdict(),
        'turns': list(trial.turns),
        'turns_at_first': list(trial.at_first),
        'impacts': {
            name: dict(zip(('mean', 'half_width', 'deviation'), plain(mean), strict=True))
            for name, mean in trial.impacts.means.items()
        },
        'links': {
            link: {
                'overloads': swing.overloads,
                'deviation': swing.severity._asdict(),
                'deviation_at_first': swing.severity_at_first._asdict(),
                'acceleration': _estimates(swing.accelerations),
                'velocity': _estimates(swing.velocities),
            }
            for link, swing in trial.swings.items()
        },
    }


def _estimates(found: Mapping[str, Estimate]) -> dict[str, object]:
    return {
        name: {
            'error': plain(e.error._asdict()),
            'error_of_shown': plain(e.error_of_shown._asdict()),
        }
        for name, e in found.items()
    }
