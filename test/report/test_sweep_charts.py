"""Pictures of sweeps: units as they are given, repetitions, surfaces, tornados, best runs."""

from __future__ import annotations

import math
import re
from itertools import pairwise

import numpy as np
import pytest

from mechanism_sim.errors import InputError
from mechanism_sim.report.figures import paint, save_all
from mechanism_sim.report.sweep import SweepCharts, pareto_front, response_surface, unit_of
from mechanism_sim.studies.plan import read_plan
from mechanism_sim.studies.runs import DONE
from mechanism_sim.units import digits_apart

GRID = """
scene: four_bar_nominal
grid:
  drive.speed: [250 rpm, 350 rpm]
  links.rocker.length: [0.31 m, 312 mm, 314 mm]
repeat: 2
measures: {peak: largest(reaction.coupler_rocker), torque: rms(drive_torque)}
revolutions: 1
"""


@pytest.fixture(scope='module')
def sweep(tmp_path_factory):
    """A plan, and rows by formulas of my own in place of runs: peak = (speed / 10)^2 + length."""
    file = tmp_path_factory.mktemp('sweep') / 'grid.yaml'
    file.write_text(GRID.replace('0.31 m', '310 mm'), encoding='utf-8')
    plan = read_plan(str(file))
    rows = []
    for run in plan.runs:
        speed, length = run.values['drive.speed'], run.values['links.rocker.length']
        again = 0.01 * run.values['repeat']
        rows.append({'status': DONE, 'torque': 1e-3 * length * (1.0 + again),
                     'peak': 1e4 * ((speed / 10.0) ** 2 + length + again)})  # fmt: skip
    return plan, rows


def chart(sweep, key, **asked):
    found = {c.key: c for c in SweepCharts(*sweep).charts(asked.get('over'), asked.get('p', ()))}
    return found[key]


def test_axes_have_the_units_of_the_sweep(sweep):
    panel = chart(sweep, 'over').panels[0]
    assert (panel.x.title, panel.y.title) == ('rocker length [mm]', 'peak [kN]')
    assert panel.x.names == ('310', '312', '314')
    lines = [c for c in panel.curves if c.label]
    assert [c.label for c in lines] == ['drive speed 250 rpm', 'drive speed 350 rpm']
    unit, by = unit_of(sweep[0], 'drive.speed')
    assert (unit, by) == ('rpm', pytest.approx(30.0 / np.pi))
    assert chart(sweep, 'over', over='drive.speed').panels[0].x.title == 'drive speed [rpm]'


def test_repetitions_are_dots_beside_their_mean_and_no_factor(sweep):
    plan, rows = sweep
    panel = chart(sweep, 'over').panels[0]
    mean, dots = (c for c in panel.curves if c.colour == 0)
    assert (len(mean.x), len(dots.x), dots.form) == (3, 6, 'dots')
    assert mean.y == pytest.approx(dots.y.reshape(3, 2).mean(axis=1))
    own = [row['peak'] for run, row in zip(plan.runs, rows, strict=True)
           if run.given['drive.speed'] == '250 rpm']  # fmt: skip
    assert np.sort(dots.y) == pytest.approx(np.sort(own) / 1e3)
    factors = {c.of for p in chart(sweep, 'effects').panels for c in p.curves}
    assert factors == {'drive.speed', 'links.rocker.length'}


def test_a_tornado_has_the_means_at_both_ends_the_largest_on_top(sweep):
    panel = chart(sweep, 'tornado-peak').panels[0]
    assert panel.y.names[-1] == 'drive speed: 250 rpm to 350 rpm'
    low, high = (c for c in panel.curves if c.of == 'drive.speed')
    speeds = np.array([250.0, 350.0]) * np.pi / 30.0
    ends = 10.0 * ((speeds / 10.0) ** 2 + 0.312 + 0.005)
    assert (low.x[1], high.x[1]) == pytest.approx(tuple(ends), rel=1e-9)
    assert panel.marks[0].at == pytest.approx(ends.mean(), rel=1e-9)


def test_a_quadratic_function_is_its_own_response_surface():
    rng = np.random.default_rng(2)
    u = rng.uniform(-1.0, 1.0, (60, 3)) * [2.0, 0.1, 5.0] + [7.0, 0.3, -1.0]
    truth = lambda a, b, c: 3.0 + a * b - 2.0 * b**2 + 0.5 * c + a**2  # noqa: E731
    x, y, z = response_surface(u, truth(*u.T), 0, 1)
    wanted = truth(x[None, :], y[:, None], u[:, 2].mean())
    assert z == pytest.approx(wanted, rel=1e-9)
    assert response_surface(u[:9], truth(*u[:9].T), 0, 1) is None  # fewer than it has terms
    grid = np.array([[a, b] for a in (1.0, 2.0, 5.0) for b in (0.0, 1.0)])
    x, y, z = response_surface(grid, grid[:, 0] + 10.0 * grid[:, 1], 0, 1)
    assert (x.tolist(), y.tolist()) == ([1.0, 2.0, 5.0], [0.0, 1.0])
    assert z.tolist() == [[1.0, 2.0, 5.0], [11.0, 12.0, 15.0]]


def test_no_run_is_better_in_both_than_those_of_the_front(sweep):
    x, y = np.random.default_rng(5).normal(size=(2, 200))
    x[7] = np.nan
    front = pareto_front(x, y)
    for k in range(200):
        beaten = ((x <= x[k]) & (y <= y[k]) & ((x < x[k]) | (y < y[k]))).any()
        assert (k in front) == (not beaten and k != 7)
    with pytest.raises(InputError, match="no measure 'pek'; did you mean 'peak'"):
        chart(sweep, 'pareto', p=('pek', 'torque'))
    shown = chart(sweep, 'pareto', p=('-peak', 'torque')).panels[0].curves[1]
    assert shown.x.max() == pytest.approx(max(row['peak'] for row in sweep[1]) / 1e3)


@pytest.mark.slow
def test_labels_break_between_words_only_and_all_is_drawn(sweep, tmp_path):
    drawn = paint(chart(sweep, 'effects'))
    for axes in drawn.axes:
        for line in axes.get_xlabel().split('\n'):
            assert line in 'rocker length [mm] drive speed [rpm]'
    files = save_all(SweepCharts(*sweep).charts(None, ('peak', 'torque')), tmp_path / 'c.svg')
    names = {file.stem.removeprefix('c_') for file in files}
    assert {'over', 'effects', 'pareto', 'tornado-peak', 'surface-peak'} <= names


def _tolerances(tmp_path):
    """Lengths within 0.1 mm and the sum of them as the measure, in place of runs."""
    file = tmp_path / 'tolerances.yaml'
    file.write_text(
        'scene: four_bar_nominal\n'
        'vary:\n  links.rocker.length: 312 mm +0.1/-0.05\n  links.coupler.length: 340 mm +- 0.05'
        ' mm\ndesign: {kind: latin_hypercube, samples: 24, seed: 1}\n'
        'measures: {reach: largest(position.rocker)}\nrevolutions: 1\n',
        encoding='utf-8',
    )
    plan = read_plan(str(file))
    paths = 'links.rocker.length', 'links.coupler.length'
    return plan, [
        {'status': DONE, 'reach': sum(run.values[path] for path in paths)} for run in plan.runs
    ]


def test_values_that_differ_little_are_told_apart(tmp_path):
    charts = {c.key: c for c in SweepCharts(*_tolerances(tmp_path)).charts(None)}
    lines = [c for c in charts['surface-reach'].panels[0].curves if any(c.texts)]
    said = [float(text) for c in lines for text in c.texts if text]
    assert len(set(said)) == len(said) == 9
    # the value on a line (an angle) is the sum there, to a tenth of the distance of lines
    for c, number in zip(lines, said, strict=True):
        assert math.radians(number) == pytest.approx(1e-3 * np.mean(c.x + c.y), abs=2e-6)
    for name in charts['tornado-reach'].panels[0].y.names:
        low, high = re.findall(r'([\d.]+) mm', name)
        assert 0.08 > float(high) - float(low) > 0.03
    over = charts['over'].panels[0].curves
    assert [len(c.x) for c in over] == [24]  # none of a rounded length joins what differs


@pytest.mark.parametrize(('values', 'digits'), [
    ((), 4), ((5.0,), 4), ((1.0, 2.0), 4), ((360.01, 360.02, 365.0), 7),
    ((0.1, 0.1 + 1e-17), 4), ((1.0, 1.0 + 1e-15), 4), ((math.nan, 1.0), 4),
])  # fmt: skip
def test_digits_that_tell_values_apart(values, digits):
    assert digits_apart(values) == digits


def test_numbers_at_ticks_are_whole_and_do_not_touch(tmp_path):
    chart = {c.key: c for c in SweepCharts(*_tolerances(tmp_path)).charts(None)}['effects']
    figure = paint(chart)
    figure.canvas.draw()
    for axes in figure.axes:
        assert not axes.xaxis.get_offset_text().get_text()
        low, high = axes.get_xlim()
        shown = [t for t in axes.get_xticklabels() if low <= t.get_position()[0] <= high]
        boxes = sorted((t.get_window_extent() for t in shown), key=lambda box: box.x0)
        assert all(a.x1 + 2.0 < b.x0 for a, b in pairwise(boxes))
        assert shown
        assert all(300.0 < float(t.get_text()) < 400.0 for t in shown)
