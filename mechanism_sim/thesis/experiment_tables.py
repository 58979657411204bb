"""The tables of the thesis's experiment, as Markdown, as JSON, and on a page.

A table stands between ``<!-- experiment: NAME -->`` and ``<!-- /experiment -->``. NAME is that of
a table, or ``summary``; ``NAME; COLUMN = VALUE`` selects rows with this value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from mechanism_sim import output
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.strict_json import plain
from mechanism_sim.thesis.claims import (
    Claim,
    claims,
    spans_of_turns,
)
from mechanism_sim.thesis.experiment import (
    CONFIDENCE,
    QUANTITIES,
    Condition,
    Errors,
    Experiment,
    Interval,
    Repeats,
    Trial,
    mm,
    pace,
    rpm,
)
from mechanism_sim.thesis.swing import LINKS, MESHES

_MARKED = re.compile(
    r'^(?P<begin><!-- experiment: (?P<name>[^\n]+?) -->\n).*?^(?P<end><!-- /experiment -->)$',
    re.M | re.S,
)
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
_AGAINST = {'of_shown': 'what the instrument could show', 'of_truth': 'the truth'}


class ExperimentTable(NamedTuple):
    """A table with a heading, and its name for pages."""

    name: str
    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]

    def markdown(self) -> str:
        """Table as Markdown, with all columns aligned but the last, which may be long."""
        lines = [self.columns, *self.rows]
        widths = [max(len(line[k]) for line in lines) for k in range(len(self.columns))]
        widths[-1] = 0
        text = [
            '| ' + ' | '.join(f'{c:{w}}' for c, w in zip(line, widths, strict=True)) + ' |'
            for line in lines
        ]
        rule = '|' + '|'.join('-' * max(w + 2, 3) for w in widths) + '|'
        return '\n'.join([text[0], rule, *text[1:]])


def tables(found: Experiment) -> list[ExperimentTable]:
    """All tables of an experiment with runs for them."""
    made = [
        _bearings(found), _steps(found), _course(found), _severity(found), _claims(found),
        *_other_places(found), *_errors(found), _limits(found), _orders(found),
    ]  # fmt: skip
    return [table for table in made if table.rows]


def render(found: Experiment) -> str:
    """The tables as text."""
    parts = [f'### {table.title}\n\n{table.markdown()}' for table in tables(found)]
    return '\n\n'.join([summary(found), *parts])


def summary(found: Experiment) -> str:
    """Summary of the runs, of the compared ones, and of the reasons."""
    counts = sorted({len(group.trials) for group in found.groups})
    if counts == [1]:
        starts = (
            'batches of turns: each condition has one start, so there is none of other figures'
        )
    else:
        alone = ', that of impacts of a single start over its turns' if counts[0] == 1 else ''
        starts = f'{" or ".join(map(str, counts))} starts{alone}'
    lines = [
        f'{len(found.trials)} runs of {len(found.groups)} conditions; '
        f'"+-" is the {100.0 * CONFIDENCE:g} % confidence interval of means over {starts}',
        f'measured is the bearing that most of the runs have, {found.counted[found.bearing]} of '
        f'{len(found.trials)}: {found.bearing}',
        f'it is compared at {found.reference.condition.place}: {_WHY_REFERENCE} '
        f'({_bags(found.reference)})',
    ]
    if found.assumed is found.reference:
        lines.append('no other machine was run there: no alpha')
    else:
        lines += [
            f'with {found.assumed.condition.bearing}, {_WHY_ASSUMED} ({_bags(found.assumed)})',
            f'alpha = {figure(found.alpha())}: the deviation of the coupler there, in the first '
            f'turns with impacts, as means over {MESHES[-1]:g} deg, over what the instrument '
            'shows of the measured machine later',
        ]
    if cut := sum(x.overloads for x in found.trials):
        lines.append(f'{cut} samples of all runs were cut at the range of their converters')
    return '\n'.join(f'- {line}' for line in lines)


_WHY_REFERENCE = 'the highest speed of the measured bearing, and there its largest clearance'
_WHY_ASSUMED = (
    'of the bearings run there the nearest to what [SB] assumes: dry, the least friction, then '
    'the highest restitution'
)


def _bags(group: Repeats) -> str:
    names = [x.bag.name for x in group.trials]
    return names[0] if len(names) == 1 else f'{names[0]} to {names[-1]}'


def figure(x: Interval, scale: float = 1.0) -> str:
    """A mean to three digits, and half the width of its interval to the same decimal.

    The width is rounded up, so that overlapping intervals do so in print; it is 0 if less
    than a hundredth of the last place.
    """
    mean, half = scale * x.mean, scale * x.half_width
    if not math.isfinite(mean):
        return 'none'
    places = 2 - _decade(mean)
    if not math.isfinite(half):
        return _rounded(mean, places)
    places = min(places, 1 - _decade(half)) if half else places
    unit = 10.0**-places
    half = math.ceil(half / unit - 1e-9) * unit if half > 0.01 * unit else 0.0
    return f'{_rounded(mean, places)} +- {_rounded(half, places)}'


def _decade(x: float) -> int:
    return math.floor(math.log10(abs(x))) if x else 2


def _rounded(x: float, places: int) -> str:
    return f'{round(x, places):.{max(places, 0)}f}'


def _place(c: Condition) -> tuple[str, str]:
    """Speed [rpm] and clearance [mm]."""
    return rpm(c.speed), mm(c.radial)


def _severity(found: Experiment) -> ExperimentTable:
    rows = [
        (
            *_place(group.condition),
            figure(group.impacts('count')),
            figure(group.impacts('impulse'), 1e3),
            figure(group.impacts('I_n'), 1e3),
            *(figure(group.shown(link)) for link in LINKS),
        )
        for group in found.measured.values()
    ]
    columns = (
        'rpm', 'clearance [mm]', 'impacts a turn', 'sum of impulses [mN s]', 'I_n [mN s]',
        'coupler [rad/s^2]', 'rocker [rad/s^2]',
    )  # fmt: skip
    title = 'Impacts, and the deviation of the accelerations as the instrument shows it'
    return ExperimentTable('severity', title, columns, rows)


def _bearings(found: Experiment) -> ExperimentTable:
    rows = []
    for group in found.bearings:
        early = [x.severity_at_first['coupler'] for x in group.trials]
        late = [x.severity['coupler'] for x in group.trials]
        columns = [
            [x.heard for x in early],
            *zip(*(x.by_mesh for x in early), strict=True),
            [x.between for x in late],
            [x.heard for x in late],
            *zip(*(x.by_mesh for x in late), strict=True),
        ]
        cells = [figure(Interval.over(column)) for column in columns]
        b = group.condition.bearing
        if b.viscosity:
            bearing = '', '', f'{1e3 * b.viscosity:.4g}'
        else:
            bearing = f'{b.restitution:g}', f'{b.friction:g}', ''
        rows.append((*bearing, *cells, figure(found.alpha(group))))
    meshes = [f'over {mesh:g} deg' for mesh in MESHES]
    heads = (
        'restitution', 'friction', 'oil [mPa s]', 'at first: shown', *meshes,
        'later: between impacts', 'shown', *meshes, 'alpha',
    )  # fmt: skip
    title = (
        f'Deviation of the acceleration of the coupler by bearing, rms [rad/s^2], at '
        f'{found.reference.condition.place}'
    )
    return ExperimentTable('bearings', title, heads, rows)


def _steps(found: Experiment) -> ExperimentTable:
    """Table of steps from the machine assumed by [SB] to the possible measured ones."""
    if found.assumed is found.reference:
        return ExperimentTable('steps', '', (), [])
    assumed, reference = found.assumed, found.reference

    def step(
        name: str, group: Repeats, of: Any, before: Repeats, of_before: Any
    ) -> tuple[str, str, str]:
        return name, figure(group.mean(of)), figure(before.times(of_before, group, of))

    def means(x: Trial) -> float:
        return x.severity_at_first['coupler'].by_mesh[-1]

    def at_first(x: Trial) -> float:
        return x.severity_at_first['coupler'].heard

    def later(x: Trial) -> float:
        return x.severity['coupler'].heard

    rows = [
        (
            f'{assumed.condition.bearing}, at first, means over {MESHES[-1]:g} deg',
            figure(assumed.mean(means)),
            '',
        ),
        step('the same through the instrument', assumed, at_first, assumed, means),
        step(f'{reference.condition.bearing}, at first', reference, at_first, assumed, at_first),
        step('the same later', reference, later, reference, at_first),
    ]
    rows += [
        step(f'instead, {group.condition.bearing}', group, later, reference, later)
        for group in found.bearings
        if group.condition.bearing.friction or group.condition.bearing.viscosity
    ]
    return ExperimentTable(
        'steps',
        'Deviation of the coupler, from the assumed machine to measured ones, rms [rad/s^2]',
        ('step', 'deviation', 'divides by'),
        rows,
    )


def _course(found: Experiment) -> ExperimentTable:
    """Impacts of the assumed and of the measured machine over time."""
    groups = list(dict.fromkeys([found.assumed, found.reference]))
    rows = [
        (
            f'{span[0]} to {span[1]}',
            *(
                figure(group.impacts(name, span), scale)
                for group in groups
                for name, scale in (('count', 1.0), ('impulse', 1e3))
            ),
        )
        for span in spans_of_turns(found)
    ]
    heads = [
        f'{what}, {group.condition.bearing}'
        for group in groups
        for what in ('impacts', 'impulse [mN s]')
    ]
    title = 'Impacts and sum of impulses a turn, from the first turn with an impact'
    return ExperimentTable('course', title, ('turns', *heads), rows)


def _claims(found: Experiment) -> ExperimentTable:
    """Verdicts, and the comparisons by their outcome; their figures are those of other tables."""
    rows = []
    for claim in claims(found):
        by_outcome: dict[str, list[str]] = {}
        for c in claim.comparisons:
            alone = len(claim.comparisons) == 1 or not c.where
            by_outcome.setdefault(c.found, []).append(' to '.join(c.ends) if alone else c.where)
        seen = '; '.join(f'{outcome}: {", ".join(where)}' for outcome, where in by_outcome.items())
        rows.append((claim.text, claim.figure, claim.verdict, seen))
    title = 'What [SB] concludes, by intervals that do not overlap'
    return ExperimentTable('claims', title, ('[SB]', 'judged by', 'here', 'comparisons'), rows)


def _other_places(found: Experiment) -> Iterator[ExperimentTable]:
    """Other bearings with runs at several speeds and clearances."""
    for bearing in found.counted:
        places = found.places(bearing)
        if bearing == found.bearing or len(places) < 2:
            continue
        clearances = sorted({radial for _, radial in places})
        rows = [
            (
                rpm(speed),
                *(
                    figure(places[speed, c].shown()) if (speed, c) in places else ''
                    for c in clearances
                ),
            )
            for speed in dict.fromkeys(speed for speed, _ in places)
        ]
        most = max(x.impacts('count').mean for x in places.values())
        yield ExperimentTable(
            f'places of {bearing}',
            f'Deviation of the coupler as shown [rad/s^2], {bearing}; at most {most:.3g} impacts '
            'a turn',
            ('rpm', *(f'{mm(c)} mm' for c in clearances)),
            rows,
        )


def _errors(found: Experiment) -> Iterator[ExperimentTable]:
    """Relative rms errors [%]."""
    for of in product(QUANTITIES, LINKS):
        methods = list(found.reference.first.errors[of])
        for key, against in _AGAINST.items():
            rows = [
                (
                    *_place(group.condition),
                    *(
                        figure(Interval.over([_relative(x.errors[of][m], key) for x in runs]))
                        for m in methods
                    ),
                )
                for group in found.measured.values()
                for runs in [group.trials]
            ]
            what = f'{of[0]} of the {of[1]} against {against}'
            columns = 'rpm', 'clearance [mm]', *(_METHODS[m] for m in methods)
            yield ExperimentTable(what, f'Angular {what}, rms [%]', columns, rows)


def _relative(errors: Errors, against: str) -> float:
    return 100.0 * float(getattr(errors, against).relative)


def _limits(found: Experiment) -> ExperimentTable:
    """Effect of the lower limit of the amplifiers on the method of [SB]."""
    rows = []
    for (limit, condition), errors in sorted(
        (found.limits or {}).items(), key=lambda item: (pace(item[0][1].speed), -item[0][0])
    ):
        cells = [
            figure(Interval.over([_relative(e[quantity, link]['thesis'], key) for e in errors]))
            for quantity, key in zip(QUANTITIES, _AGAINST, strict=True)
            for link in LINKS
        ]
        rows.append((*_place(condition), f'{limit:g}', *cells))
    columns = (
        'rpm', 'clearance [mm]', 'lower limit [Hz]',
        *(f'{quantity}, {link}' for quantity in QUANTITIES for link in LINKS),
    )  # fmt: skip
    title = (
        'Errors of what [SB] did under both lower limits of the amplifier, rms [%]: accelerations '
        'against what the instrument could show, velocities against the truth'
    )
    return ExperimentTable('limits', title, columns, rows)


def _orders(found: Experiment) -> ExperimentTable:
    rows = [(str(n), figure(x)) for n, x in enumerate(found.orders or (), 1)]
    title = 'Alpha by multiple of the speed of the crank, assumed over measured, both later'
    return ExperimentTable('orders', title, ('order', 'alpha'), rows)


def to_json(found: Experiment) -> dict[str, object]:
    """All numbers, in SI units."""
    alone = found.assumed is found.reference
    return {
        **found.bearing._asdict(),
        'confidence': CONFIDENCE,
        'why': f'{found.counted[found.bearing]} of {len(found.trials)} runs have this bearing',
        'alpha': None if alone else _interval(found.alpha()),
        'alpha_by_order': [_interval(x) for x in found.orders or ()],
        'reference': _compared(found.reference, _WHY_REFERENCE),
        'assumed': _compared(found.assumed, _WHY_ASSUMED),
        'conditions': [
            {
                **_flat(group.condition),
                'bags': [x.bag.name for x in group.trials],
                'starts': [x.start for x in group.trials],
                'impacts': {
                    name: _interval(group.impacts(name)) for name in ('count', 'impulse', 'I_n')
                },
                'deviation': {link: _interval(group.shown(link)) for link in LINKS},
            }
            for group in found.groups
        ],
        'claims': [] if alone and len(found.measured) < 2 else [_claim(c) for c in claims(found)],
        'limits': [
            {
                'lower_limit': limit,
                **_flat(condition),
                'errors': [_error_rows(one) for one in errors],
            }
            for (limit, condition), errors in (found.limits or {}).items()
        ],
        'trials': [
            {
                'bag': trial.bag.name,
                **_flat(trial.condition),
                'start': trial.start,
                'turns': list(trial.turns),
                'turns_at_first': list(trial.at_first),
                'overloads': trial.overloads,
                'impacts': {
                    name: dict(zip(('mean', 'half_width', 'deviation'), plain(mean), strict=True))
                    for name, mean in trial.impacts.means.items()
                },
                'deviation': {link: x._asdict() for link, x in trial.severity.items()},
                'deviation_at_first': {
                    link: x._asdict() for link, x in trial.severity_at_first.items()
                },
                'errors': _error_rows(trial.errors),
            }
            for trial in found.trials
        ],
    }


def _interval(x: Interval) -> Any:
    return plain(x._asdict())


def _flat(condition: Condition) -> dict[str, float]:
    return {
        'speed': condition.speed,
        'radial': condition.radial,
        **condition.bearing._asdict(),
    }


def _compared(group: Repeats, why: str) -> dict[str, object]:
    return {
        **_flat(group.condition),
        'bags': [x.bag.name for x in group.trials],
        'why': why,
    }


def _claim(claim: Claim) -> dict[str, object]:
    return {
        'text': claim.text,
        'judged_by': claim.figure,
        'verdict': claim.verdict,
        'comparisons': [
            {
                'where': c.where,
                'from': c.ends[0],
                'to': c.ends[1],
                'expected': c.expected or None,
                'found': c.found,
                'before': _interval(c.before),
                'after': _interval(c.after),
            }
            for c in claim.comparisons
        ],
    }


def _error_rows(found: Mapping[tuple[str, str], Mapping[str, Errors]]) -> list[dict[str, object]]:
    return [
        {
            'quantity': quantity,
            'link': link,
            'method': method,
            'of_shown': plain(e.of_shown._asdict()),
            'of_truth': plain(e.of_truth._asdict()),
        }
        for (quantity, link), methods in found.items()
        for method, e in methods.items()
    ]


def read_page(option: str, path: str) -> tuple[Path, str]:
    """Read a page with marks; InputError if it cannot be written."""
    file = output.check_path(option, path, '.md')
    try:
        text = file.read_text(encoding='utf-8')
    except (OSError, UnicodeError) as error:
        raise InputError(f"{option} '{path}' cannot be read: {error}") from error
    if not _MARKED.search(text):
        raise InputError(
            f"{option} '{path}' has no place for a table: write lines '<!-- experiment: bearings "
            "-->' and '<!-- /experiment -->' where it shall stand"
        )
    return file, text


def renewed(text: str, found: Experiment) -> str:
    """The text of a page with renewed tables."""
    known = {t.name: t for t in tables(found)}

    def made(mark: re.Match[str]) -> str:
        name, _, rows = mark['name'].partition('; ')
        if name not in known and mark['name'] != 'summary':
            names = ['summary', *known]
            raise InputError(
                f"the page asks for '{name}', a table that these runs do not give"
                f'{nearest(name, names)}; they give: {", ".join(names)}'
            )
        part = summary(found) if name == 'summary' else _chosen(known[name], rows).markdown()
        return f'{mark["begin"]}\n{part}\n\n{mark["end"]}'

    return _MARKED.sub(made, text)


def _chosen(table: ExperimentTable, rows: str) -> ExperimentTable:
    """A table with the rows selected by a page; all by default."""
    column, _, value = rows.rpartition(' = ')
    if not rows:
        return table
    if column not in table.columns:
        raise InputError(
            f"the page asks for rows of '{table.name}' by '{rows}': write 'COLUMN = VALUE'; the "
            f'columns are {", ".join(table.columns)}'
        )
    k = table.columns.index(column)
    if chosen := [row for row in table.rows if row[k] == value]:
        return table._replace(rows=chosen)
    raise InputError(f"'{table.name}' has no row with {rows}, which the page asks for")
