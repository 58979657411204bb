"""Designs of sweeps, effects and tables, on a machine whose figures have closed forms.

A bar turns about its end at speed w under its weight and a brake of 0.5 N m s/rad: its drive's
torque is ``0.5 w + m g a cos(q)``, and the highest of it ``0.5 w + m g a``.
"""

from __future__ import annotations

import csv
import json
import math
import sys
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest
import scipy
import yaml
from running import ROOT

import mechanism_sim as ms
from mechanism_sim import tables
from mechanism_sim.cli import main
from mechanism_sim.errors import InputError
from mechanism_sim.report.sweep import _index
from mechanism_sim.studies.design import factor, points
from mechanism_sim.studies.effects import _independent, effects, exceedances
from mechanism_sim.studies.plan import MeasureLimits, read_plan
from mechanism_sim.studies.sweep import run_plan

G, MASS = 9.81, 2.0
SCENE = """
title: A bar under its weight
mechanism: linkage
links: {bar: {mass: 2 kg, inertia: 0.05 kg m^2, cog: 250 mm}}
joints: {O: {revolute: [ground, bar]}}
gravity: [0, -9.81 m/s^2]
drive: {coordinate: bar, speed: 12 rad/s}
loads: {brake: {at: bar, torque: -0.5*bar_rate}}
"""
SWEEP = """
scene: bar.yaml
measures: {peak: highest(drive_torque)}
revolutions: 1
"""
UNIFORM = 'vary: {drive.speed: [10 rad/s, 20 rad/s], links.bar.cog: [200 mm, 600 mm]}\n'

pytestmark = pytest.mark.usefixtures('in_this_process')


def plan_of(folder, text):
    (folder / 'bar.yaml').write_text(SCENE, encoding='utf-8')
    (folder / 'study.yaml').write_text(SWEEP + text, encoding='utf-8')
    return read_plan(str(folder / 'study.yaml'))


def made(folder, text, name='t.parquet'):
    plan = plan_of(folder, text)
    return plan, run_plan(plan, folder / name)[1]


def test_every_run_has_the_closed_form_as_its_measure(tmp_path):
    plan, rows = made(tmp_path, UNIFORM + 'design: {samples: 5}\n')
    for run, row in zip(plan.runs, rows, strict=True):
        speed, arm = run.values['drive.speed'], run.values['links.bar.cog']
        assert row['peak'] == pytest.approx(0.5 * speed + MASS * G * arm, rel=1e-10)
        assert row['largest_torque.bar'] == pytest.approx(row['peak'], rel=1e-10)
        assert row['largest_force.O'] == pytest.approx(
            MASS * (G + speed**2 * arm), rel=1e-10
        )  # at the bottom, where weight and centrifugal force add up
    assert plan.units == {'drive.speed': 'rad/s', 'links.bar.cog': 'm'}


def test_every_sensor_has_its_columns(tmp_path):
    """It reads centrifugal acceleration and the part of the weight along the bar."""
    end = '{link: bar, at: 500 mm, sample_rate: 10 kHz, axis: along, gravity: true}'
    read = f'sensors: {{end: {end}}}\n'
    (tmp_path / 'felt.yaml').write_text(SCENE + read, encoding='utf-8')
    text = 'scene: felt.yaml\nrevolutions: 2\nmeasures: {known: rms(sensors.end)}\n'
    (tmp_path / 's.yaml').write_text(
        text + 'grid: {drive.speed: [10 rad/s, 20 rad/s]}\n', encoding='utf-8'
    )
    plan, said = read_plan(str(tmp_path / 's.yaml'), [], (counted := []).append), counted
    assert said == ['0 of 2 runs', '1 of 2 runs']
    units = {c.name: c.unit for c in plan.own}
    assert units['largest(sensors.end)'] == 'm/s^2'
    assert 'rms(sensors.end)' not in units  # asked for by another name
    for speed, row in zip((10.0, 20.0), run_plan(plan, tmp_path / 't.parquet')[1], strict=True):
        felt = speed**2 * 0.5
        assert row['known'] == pytest.approx(math.hypot(felt, G / math.sqrt(2.0)), rel=2e-3)
        assert row['largest(sensors.end)'] == pytest.approx(felt + G, rel=2e-3)


def test_measures_of_the_scene_are_columns(tmp_path):
    """Those of the sweep by the same name are taken instead."""
    own = 'measures: {top: largest(drive_torque), half: 0.5 * largest(drive_torque)}\n'
    (tmp_path / 'weighed.yaml').write_text(SCENE + own, encoding='utf-8')
    text = 'scene: weighed.yaml\nrevolutions: 1\ngrid: {drive.speed: [10 rad/s, 20 rad/s]}\n'
    (tmp_path / 's.yaml').write_text(
        text + 'measures: {half: 2 * largest(drive_torque)}\nlimits: {top: 15 N m}\n',
        encoding='utf-8',
    )
    plan = read_plan(str(tmp_path / 's.yaml'))
    assert {c.name: c.unit for c in plan.measured} == {'half': 'N m', 'top': 'N m'}
    assert plan.limits == {'top': (-math.inf, 15.0)}
    for row in run_plan(plan, tmp_path / 't.parquet')[1]:
        assert row['top'] == pytest.approx(row['largest_torque.bar'], rel=1e-12)
        assert row['half'] == pytest.approx(2.0 * row['top'], rel=1e-12)
    scene = tmp_path / 'weighed.yaml'
    found = ms.ensemble(scene, [{'drive.speed': '10 rad/s'}], revolutions=1)
    assert found['half'][0] == pytest.approx(0.5 * found['top'][0], rel=1e-12)
    scene.write_text(scene.read_text(encoding='utf-8').replace('top:', 'impacts:'), 'utf-8')
    with pytest.raises(InputError, match="of weighed: a column 'impacts' is there already"):
        ms.ensemble(scene, [{'drive.speed': '10 rad/s'}], revolutions=1)


def test_an_index_without_an_interval_has_none():
    """It is the same in all resamples where a factor has no influence."""
    assert _index((0.0, math.nan, math.nan)) == '0.000'
    assert _index((0.25, 0.125, 0.5)) == '0.250 (0.12 to 0.50)'


def test_what_slides_or_swings_has_figures_of_the_whole_window():
    """A mass between two stops, and a pendulum: neither makes revolutions to divide by."""
    mass = {
        'title': 'Mass between two stops',
        'mechanism': 'linkage',
        'links': {'m': {'mass': 2.0}},
        'joints': {
            'g': {
                'prismatic': ['ground', 'm'],
                'stops': {'lower': 0.0, 'upper': 0.05, 'restitution': 0.5},
            }
        },
        'initial': {'velocity': {'m': 1.0}},
        'gravity': [0.0, 0.0],
    }
    found = ms.ensemble(mass, [{'links.m.mass': 2.0}], duration=0.3)
    run = ms.simulate(mass, duration=0.3)
    assert found['impacts'][0] == pytest.approx(len(run.impacts))
    assert found['impulse'][0] == pytest.approx(sum(i.normal_impulse for i in run.impacts))
    assert found['dissipated'][0] == pytest.approx(run.energy.dissipated)
    assert np.isnan(float(found['revolutions'][0]))
    swung = ms.ensemble('pendulum', [{'gravity': [0.0, -9.81]}], duration=6.0)
    assert np.isnan(float(swung['revolutions'][0]))
    turned = ms.ensemble('slider_crank', [{'gravity': [0.0, -9.81]}], duration=1.0)
    assert turned['revolutions'][0] == pytest.approx(10.0)


def test_a_latin_hypercube_has_one_sample_in_every_class():
    factors = [factor('a', [0.0, 1.0]), factor('b', {'normal': [5.0, 2.0]})]
    found = points(factors, 'latin_hypercube', 50, 7)
    for one, column in zip(factors, found.T, strict=True):
        classes = np.floor(50 * one.distribution.cdf(column)).astype(int)
        assert sorted(classes.tolist()) == list(range(50))
    assert np.array_equal(found, points(factors, 'latin_hypercube', 50, 7))
    assert not np.array_equal(found, points(factors, 'latin_hypercube', 50, 8))


@pytest.mark.parametrize('kind', ['sobol', 'latin_hypercube'])
def test_designs_integrate_better_than_chance(kind):
    """The mean of a smooth function over the cube, to well below ``1 / sqrt(n)``."""
    factors = [factor(name, [0.0, 1.0]) for name in 'abc']
    x = points(factors, kind, 256, 1)
    assert np.exp(x).sum(axis=1).mean() == pytest.approx(3.0 * (math.e - 1.0), abs=0.01)


def test_tolerances_are_three_standard_deviations_and_are_kept():
    one = factor('links.bar.cog', '250 mm +- 3 mm')
    x = points([one], 'random', 20_000, 1)[:, 0]
    assert np.abs(x - 0.25).max() <= 0.003
    inside = scipy.stats.truncnorm(-3, 3).std()
    assert x.std() == pytest.approx(0.001 * inside, rel=0.03)
    assert factor('x', '250 +- 3 mm').distribution.mean() == pytest.approx(0.25)


def study(factors, kind, samples, figure, limits=None):
    """A sweep whose figure is a function, and its rows."""
    factors = [factor(name, given) for name, given in factors.items()]
    x = points(factors, kind, samples, 1)
    names = tuple(f.path for f in factors)
    runs = [SimpleNamespace(values=dict(zip(names, row, strict=True))) for row in x.tolist()]
    plan = SimpleNamespace(
        measure_names=['y'], columns=names, runs=runs, factors=factors,
        design=SimpleNamespace(kind=kind, samples=samples), limits=limits or {},
    )  # fmt: skip
    return plan, [{'y': figure(*row)} for row in x.tolist()]


def test_indices_are_those_of_ishigamis_function():
    """Their closed forms: Sobol and Levitan, Computer Physics Communications 117 (1999) 52-61."""
    whole = [-math.pi, math.pi]
    plan, rows = study(
        dict.fromkeys('abc', whole), 'sobol_indices', 1024,
        lambda a, b, c: math.sin(a) + 7.0 * math.sin(b) ** 2 + 0.1 * c**4 * math.sin(a),
    )  # fmt: skip
    parts = 0.5 * (1.0 + 0.1 * math.pi**4 / 5.0) ** 2, 49.0 / 8.0, 0.0
    mixed = 0.01 * math.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    total = sum(parts) + mixed
    both = parts[0] + mixed, parts[1], mixed
    for one, first, whole in zip(effects(plan, rows), parts, both, strict=True):
        assert one.first[0] == pytest.approx(first / total, abs=0.03)
        assert one.total[0] == pytest.approx(whole / total, abs=0.03)
        assert one.first[1] <= one.first[0] <= one.first[2]


def test_main_effects_are_differences_of_means_and_shares_of_variance():
    """Of ``3 a + b``, whose variance is nine parts of a and one of b; c does nothing."""
    plan, rows = study(
        {name: [0.0, 1.0] for name in 'abc'},
        'latin_hypercube',
        400,
        lambda a, b, _: 3.0 * a + b,
    )
    a, b, c = effects(plan, rows)
    classes = 1.0 - 1.0 / 8.0  # between the middles of the first and of the last class
    assert a.effect == pytest.approx(3.0 * classes, rel=0.1)
    assert a.share == pytest.approx(0.9, abs=0.03)
    assert b.share == pytest.approx(0.1, abs=0.04)
    assert c.share < 0.03
    assert [level.runs for level in a.levels] == [50] * 8


@pytest.mark.slow
def test_what_chance_shows_of_a_value_without_effect_is_said():
    """One of 20 designs shows more; of a grid, where all classes are alike, nothing is said."""
    shown = []
    for seed in range(300):
        random = np.random.default_rng(seed)
        plan, rows = study({name: [0.0, 1.0] for name in 'ab'}, 'random', 60, lambda *x: x[1])
        for row, noise in zip(rows, random.normal(size=60), strict=True):
            row['y'] = noise
        effect = effects(plan, rows)[0]
        shown.append(effect.effect > effect.chance)
    assert 0.02 < np.mean(shown) < 0.09
    plan, rows = study({'a': [0.0, 1.0]}, 'random', 6, lambda a: a)
    plan.design = None
    assert effects(plan, rows)[0].chance is None


def test_levels_of_a_grid_are_its_values():
    plan, rows = study({'a': [0.0, 1.0]}, 'random', 6, lambda a: a)
    for k, run in enumerate(plan.runs):
        run.values['a'] = ('seated', 'centred')[k % 2]
        rows[k]['y'] = float(k % 2)
    (found,) = effects(plan, rows)
    assert {level.x: level.mean for level in found.levels} == {'seated': 0.0, 'centred': 1.0}
    assert (found.effect, found.share) == (1.0, 1.0)


def test_the_share_beyond_a_limit_is_that_of_the_distribution():
    """One machine in six is beyond one standard deviation."""
    normal = {'a': {'normal': [5.0, 2.0]}}
    (found,) = exceedances(
        *study(normal, 'latin_hypercube', 400, lambda a: a, {'y': MeasureLimits(-math.inf, 7.0)})
    )
    assert found.share == pytest.approx(scipy.stats.norm.sf(1.0), abs=0.003)  # in classes
    assert found.low < scipy.stats.norm.sf(1.0) < found.high
    assert found.capability == pytest.approx(1.0 / 3.0, abs=0.005)
    (alike,) = exceedances(*study(normal, 'random', 7, lambda _: 0.1, {'y': MeasureLimits(0, 1)}))
    assert alike.capability is None
    both = study(normal, 'latin_hypercube', 400, lambda a: a, {'y': MeasureLimits(1.0, 9.0)})
    (found,) = exceedances(*both)
    assert found.share == pytest.approx(2.0 * scipy.stats.norm.sf(2.0), abs=0.003)
    assert (found.least, found.limit) == (1.0, 9.0)


def test_the_interval_of_a_share_is_that_of_independent_runs():
    """Of a figure of one value of six most runs of a design for indices say the same again."""
    uniform = {name: [0.0, 1.0] for name in 'abcdef'}
    limits = {'y': MeasureLimits(-math.inf, 0.9)}
    plan, rows = study(uniform, 'sobol_indices', 64, lambda a, *_: a, limits)
    (found,) = exceedances(plan, rows)
    drawn = np.array([row['y'] for row in rows])[:128]  # A and B; the pages b to f are A again
    assert len(rows) == 64 * 8
    assert len(set(drawn)) == len({row['y'] for row in rows}) == 128
    assert (found.runs, found.beyond) == (128, (drawn > 0.9).sum())
    # closed form: ends at which as many, or as few, have a chance of 2.5 %
    assert scipy.stats.binom.sf(found.beyond - 1, 128, found.low) == pytest.approx(0.025)
    assert scipy.stats.binom.cdf(found.beyond, 128, found.high) == pytest.approx(0.025)
    assert found.low < 0.1 < found.high


def test_independent_runs_of_lists_that_are_repeated():
    """Of each scene and of each repetition the points A and B."""
    plan, _ = study({'a': [0.0, 1.0]}, 'sobol_indices', 2, lambda a: a)
    drawn = [run.values for run in plan.runs]
    plan.runs = [
        SimpleNamespace(values=values | {'repeat': k})
        for values in [*drawn, *drawn]
        for k in range(3)
    ]
    chosen = np.flatnonzero(_independent(plan))
    assert chosen.tolist() == [*range(12), *range(18, 30)]


@pytest.mark.parametrize(
    ('text', 'low', 'high', 'unit'),
    [
        ('50 mm +0.2/-0.1', 0.0499, 0.0502, 'm'),
        ('50 +0.2/-0.1 mm', 0.0499, 0.0502, 'm'),
        ('50 mm +0.2 mm/-0.1 mm', 0.0499, 0.0502, 'm'),
        ('50 mm + 0.2 mm / - 100 um', 0.0499, 0.0502, 'm'),
        ('50 mm -0.1/-0.2', 0.0498, 0.0499, 'm'),
        ('50 mm 0/-0.05', 0.04995, 0.05, 'm'),
        ('50 mm +0.05 0', 0.05, 0.05005, 'm'),
        ('-3 N m +1/-2', -5.0, -2.0, 'N m'),
        ('2e3 N/m +5e2/-1e2', 1900.0, 2500.0, 'N/m'),
        ('0.5 +.1/-.2', 0.3, 0.6, ''),
        ('20 N/mm +1 N/mm/-2 N/mm', 18e3, 21e3, 'N/m'),
        ('50 mm 0.00/-0.10', 0.0499, 0.05, 'm'),
        ('50 mm +0.2/-100 um', 0.0499, 0.0502, 'm'),
        ('1e-10 m +1e-12/-1e-12', 0.99e-10, 1.01e-10, 'm'),
        ('50 mm ±0.2', 0.0498, 0.0502, 'm'),
        ('220 +- 0.2 mm', 0.2198, 0.2202, 'm'),
        ('300 1/min +- 30 1/min', 9.0 * math.pi, 11.0 * math.pi, 'rad/s'),
        ('300 1/min +30/-15', 9.5 * math.pi, 11.0 * math.pi, 'rad/s'),
        ('300 /min +- 30 rpm', 9.0 * math.pi, 11.0 * math.pi, 'rad/s'),
    ],
)
def test_deviations_are_written_as_on_drawings(text, low, high, unit):
    """Normal about the middle of the two ends, which are three deviations away."""
    found = factor('x', text)
    assert found.distribution.support() == pytest.approx((low, high), rel=1e-12)
    assert found.distribution.mean() == pytest.approx(0.5 * (low + high), rel=1e-12)
    assert found.distribution.std() == pytest.approx((high - low) / 6.0, rel=0.02)
    assert found.unit == unit


@pytest.mark.parametrize(
    ('text', 'low', 'high'),
    [
        ('3 N m', -math.inf, 3.0),
        ("'< 3000 N mm'", -math.inf, 3.0),
        ("'>= 2 N m'", 2.0, math.inf),
        ('[2 N m, 3 N m]', 2.0, 3.0),
        ('[2 N m, null]', 2.0, math.inf),
    ],
)
def test_limits_are_upper_lower_or_both(tmp_path, text, low, high):
    plan = plan_of(tmp_path, f'limits: {{peak: {text}}}')
    assert plan.limits['peak'] == pytest.approx((low, high))


def read(file):
    """Columns of a table by name and their units, by readers of others."""
    if file.suffix == '.parquet':
        table = pq.read_table(file)
        units = {f.name: (f.metadata or {}).get(b'unit', b'').decode() for f in table.schema}
        return {n: table[n].to_pylist() for n in table.column_names}, units
    if file.suffix == '.csv':
        with file.open(encoding='utf-8', newline='') as lines:
            head, *rows = csv.reader(lines)
    elif file.suffix == '.xlsx':
        openpyxl = pytest.importorskip('openpyxl')
        head, *rows = openpyxl.load_workbook(file)['table'].iter_rows(values_only=True)
    else:
        data = scipy.io.loadmat(file, squeeze_me=True, simplify_cells=True)
        names = data['names']
        return {names[k]: data[k] for k in names}, {names[k]: data['units'][k] for k in names}
    names = [h.partition(' [')[0] for h in head]
    units = {n: h.partition(' [')[2].rstrip(']') for n, h in zip(names, head, strict=True)}
    return dict(zip(names, zip(*rows, strict=True), strict=True)), units


@pytest.mark.slow
def test_a_number_of_a_vector_is_a_value_with_its_unit_and_its_effect(tmp_path):
    plan, rows = made(tmp_path, 'grid: {gravity.1: [-9.81, 0 m/s^2], links.bar.cog: [0 m, 1 m]}\n')
    first = plan.labels()[1]
    assert (first.values, first.unit) == ([-9.81, -9.81, 0.0, 0.0], 'm/s^2')
    assert {e.factor for e in effects(plan, rows)} == {'gravity.1', 'links.bar.cog'}
    by_letter = plan_of(tmp_path, 'vary: {gravity.y: [-9.81 m/s^2, 0 m/s^2]}\n').labels()[1]
    assert by_letter.unit == 'm/s^2'
    assert min(by_letter.values) < -9.0


def test_a_list_of_parts_is_a_text(tmp_path):
    moves = 'moves: {speed: 2 rad/s, acceleration: 8 rad/s^2, steps: [{by: 1 rad}]}'
    (tmp_path / 'moved.yaml').write_text(SCENE.replace('speed: 12 rad/s', moves), encoding='utf-8')
    (tmp_path / 's.yaml').write_text(
        'scene: moved.yaml\nduration: 1 s\n'
        'grid: {drive.moves.steps: [[{by: 1 rad}], [{by: 1 rad}, {dwell: 1 s}]]}\n',
        encoding='utf-8',
    )
    values = read_plan(str(tmp_path / 's.yaml')).labels()[1].values
    assert [len(json.loads(x)) for x in values] == [1, 2]


@pytest.mark.parametrize('ending', ['.parquet', '.csv', '.xlsx', '.mat'])
def test_tables_say_units_in_every_format(tmp_path, ending):
    if ending == '.xlsx':
        pytest.importorskip('openpyxl')
    text = 'grid: {drive.speed: [600 rpm, 20 rad/s]}\n'
    _, rows = made(tmp_path, text, f't{ending}')
    columns, units = read(tmp_path / f't{ending}')
    assert [float(x) for x in columns['peak']] == pytest.approx([row['peak'] for row in rows])
    assert [float(x) for x in columns['drive.speed']] == pytest.approx([20.0 * math.pi, 20.0])
    assert list(columns['status']) == ['done', 'done']
    assert units['peak'] == 'N m'
    assert units['drive.speed'] == 'rad/s'
    assert units['largest_force.O'] == 'N'


@pytest.mark.slow
def test_a_table_without_its_library_is_refused_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'openpyxl', None)
    with pytest.raises(InputError, match=r'openpyxl.*mechanism_sim\[tables\]'):
        run_plan(plan_of(tmp_path, UNIFORM), tmp_path / 't.xlsx')
    assert not list(tmp_path.glob('t.*'))


def test_names_of_matlab_are_unique_and_short():
    names = ['a.b', 'a_b', '2 x', 'units', 'x' * 80, 'x' * 81]
    found = tables._identifiers(names)
    assert len(set(found)) == len(names)
    assert all(name.isidentifier() and len(name) <= 63 for name in found)


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('vary: {drive.speed: 3}', 'is not a distribution'),
        ('vary: {drive.speed: {cauchy: [1, 2]}}', 'is not a distribution'),
        ('vary: {drive.speed: [1, 2, 3]}', "single values are those of 'grid'"),
        ('vary: {drive.speed: [20 rad/s, 10 rad/s]}', 'must rise'),
        ('vary: {drive.speed: [1 rad/s, 2 mm]}', 'mixes units'),
        ('vary: {drive.speed: {normal: [1, 0]}}', 'must be positive'),
        ('vary: {links.bar.cog: 3 mm +- x}', 'is not a number with a unit'),
        ('vary: {links.bar.cg: [1 mm, 2 mm]}', "did you mean 'cog'"),
        ('vary: {drive.speed: [1, 2]}\nset: {drive.speed: 1}', "both 'set' and 'vary'"),
        ('vary: {drive.speed: [1, 2]}\ndesign: {kind: lhs}', 'latin_hypercube'),
        ('vary: {drive.speed: [1, 2]}\ndesign: {kind: sobol_indices, samples: 9}', 'power of 2'),
        ('design: {samples: 9}', "needs 'vary'"),
        ('limits: {peek: 3 N m}', "did you mean 'peak'"),
        ('limits: {peak: 3 N}', "not a unit of 'N m'"),
        ('limits: {peak: [3 N m, 2 N m]}', 'numbers that rise'),
        ('limits: {peak: [3 N m]}', "write HIGH, '> LOW'"),
        ("limits: {peak: '> x'}", 'is not a number'),
        ('vary: {links.bar.cog: 3 mm +1 N/-1 mm}', 'mixes units'),
        ('vary: {links.bar.cog: 3 mm +1/+1}', 'must differ'),
        ('vary: {links.bar.cog: 50 mm +0.2}', 'is not a distribution'),
        ('vary: {links.bar.cog: 50 mm -0.1 mm}', 'is not a distribution'),
        ('vary: {links.bar.cog: 50 mm/-0.1}', 'is not a distribution'),
        ('vary: {links.bar.cog: 1e-1 m +1e-3}', 'is not a distribution'),
        ('limits: {peak: .nan}', 'must be'),
        (
            'vary:\n  links.bar.cog: 3 mm +0,2/-0,1',
            r"'\+0,2 mm' has a decimal comma.* as in \+0.2",
        ),
        ('vary:\n  links.bar.cog: 3,5 +- 0.2 mm', "'3,5 mm' has a decimal comma"),
        (
            'vary:\n  links.bar.cog: +,5/-,2 mm',
            r"'\+,5/-,2 mm' has a decimal comma, .* as in \+.5",
        ),
        ('vary:\n  links.bar.cog: 3 mm +,5/-,2', r"'\+,5 mm' has a decimal comma, .* as in \+.5"),
        ('vary: {drive.speed: 5 mm +- 1 mm}', "has the unit 'm'"),
        ('vary: {drive.speed: 5 Hz +- 1 Hz}', "'5 Hz \\+- 1 Hz' has the unit 'Hz'"),
        ('vary: {links.bar.cog: 30 rpm +- 1 rpm}', "has the unit 'rad/s'"),
        ("limits: {peak: '>< 3 N m'}", 'is not a number'),
    ],
)
def test_bad_designs_are_refused_in_one_sentence(tmp_path, text, said):
    with pytest.raises(InputError, match=said) as refused:
        plan_of(tmp_path, text)
    assert len(str(refused.value).splitlines()) == 1


def test_measures_that_cannot_be_are_refused_before_anything_runs(tmp_path):
    (tmp_path / 'bar.yaml').write_text(SCENE, encoding='utf-8')
    for measure, said in (
        ('impacts = mean(drive_torque)', 'is there already'),
        ('mean(drive_torqe)', "did you mean 'drive_torque'"),
        ('peak = mean(drive_torque)', 'is there already'),
    ):
        (tmp_path / 'study.yaml').write_text(SWEEP + UNIFORM, encoding='utf-8')
        with pytest.raises(InputError, match=said):
            read_plan(str(tmp_path / 'study.yaml'), [measure])


@pytest.mark.slow
def test_the_command_prints_effects_and_draws_them(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plan_of(tmp_path, UNIFORM + 'design: {samples: 12}\nlimits: {peak: 15 N m}\n')
    asked = ['sweep', 'study.yaml', '-o', 't.csv']
    with pytest.raises(SystemExit):
        main([*asked, '--effects', 'e.svg'])
    said = capsys.readouterr().out
    assert 'main effects' in said
    assert 'peak > 15 N m: ' in said
    assert 'links.bar.cog  peak  N m' in said
    with pytest.raises(SystemExit):
        main([*asked, '--json'])
    found = json.loads(capsys.readouterr().out)
    assert found['units']['peak'] == 'N m'
    assert {e['factor'] for e in found['effects']} == {'drive.speed', 'links.bar.cog'}
    assert (tmp_path / 'e.svg').stat().st_size > 10_000


@pytest.mark.slow
def test_the_sweep_of_the_tutorial_is_the_one_of_the_package():
    text = (ROOT / 'docs' / 'tutorial.md').read_text(encoding='utf-8')
    shown = yaml.safe_load(text.partition('```yaml\n')[2].partition('```')[0])
    kept = yaml.safe_load((ROOT / 'config' / 'sweeps' / 'press_tolerances.yaml').read_text())
    assert shown == {k: v for k, v in kept.items() if k not in ('title', 'description')}
    plan = read_plan('press_tolerances')
    assert plan.size == 200
    assert plan.limits == {'ram_peak': (-math.inf, 400e3)}
    radial = np.array([r.values['joints.ram_pin.clearance.radial'] for r in plan.runs])
    assert np.abs(radial - 50e-6).max() <= 30e-6
    assert radial.std() == pytest.approx(9.87e-6, rel=0.02)


def test_points_have_tolerances_by_components():
    guide = 'links.ground.points.guide'
    plan = {'scene': 'slider_crank_offset', 'revolutions': 1, 'design': {'samples': 4}}
    plan |= {'measures': {'top': 'highest(position.slider)'}}
    whole = read_plan(plan | {'vary': {guide: ['0 mm', '60 mm ± 0.5 %']}})
    alone = read_plan(plan | {'vary': {f'{guide}.y': '60 mm +- 0.3 mm'}, 'set': {f'{guide}.x': 0}})
    assert whole.columns == alone.columns == (f'{guide}.y',)
    assert [run.values for run in whole.runs] == [run.values for run in alone.runs]
    assert {run.scene.links['ground'].points['guide'][0] for run in whole.runs} == {0.0}
    both = read_plan(plan | {'vary': {guide: ['0 mm +- 0.1 mm', '60 mm +0.1/-0.2']}})
    assert both.columns == (f'{guide}.x', f'{guide}.y')
    even = read_plan(plan | {'vary': {f'{guide}.y': ['59 mm', '61 mm']}})  # low and high
    assert even.columns == (f'{guide}.y',)
