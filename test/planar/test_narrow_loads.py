"""Figures of loads that are narrow or oscillate: beside closed forms and SciPy's quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builders import made
from scipy.integrate import quad

import mechanism_sim as ms
from mechanism_sim.analysis.measure import measure
from mechanism_sim.results.cycle import cycle
from mechanism_sim.results.measures import EXACT

TURN = 2.0 * math.pi


def crank(torque, **load):
    """A crank at 20 rad/s; its drive supplies the opposite of the torque on it, and no more."""
    return made(
        {
            'title': 'crank',
            'links': {'cr': {'length': '1 m', 'cog': 0.0, 'mass': 1.0, 'inertia': 1.0}},
            'joints': {'pin': {'revolute': ['ground', 'cr']}},
            'drive': {'coordinate': 'cr', 'speed': '20 rad/s'},
            'loads': {'l': {'at': 'cr', 'torque': torque, **load}},
        },
        'narrow',
    )


def figures(machine, *texts):
    solution = ms.simulate(machine, revolutions=1)
    found = measure(machine, solution, *texts)
    assert {m.resolution for m in found} == {EXACT}
    return solution, [m.value for m in found]


@pytest.mark.sample(2)
@pytest.mark.parametrize('width', [1e-4, 0.001, 0.01, 0.05])
def test_a_narrow_load_is_seen_whole(width):
    machine = crank(f'-500*exp(-((cr-2.0)/{width})**2)')
    solution, (mean, rms, highest, share, upper) = figures(
        machine,
        'mean(drive_torque)', 'rms(drive_torque)', 'highest(drive_torque)',
        'share(drive_torque > 100)', 'percentile(drive_torque, 99.99)',
    )  # fmt: skip
    work = 500.0 * width * math.sqrt(math.pi)
    assert solution.energy.drive_work == pytest.approx(work, rel=1e-10)
    assert solution.energy.dissipated == pytest.approx(work, rel=1e-10)
    assert abs(solution.energy.residual) < 1e-9 * work
    assert mean == pytest.approx(work / TURN, rel=1e-10)
    square = 500.0**2 * width * math.sqrt(math.pi / 2.0) / TURN
    assert rms == pytest.approx(math.sqrt(square), rel=1e-10)
    assert highest == pytest.approx(500.0, rel=1e-9)
    half = width * math.sqrt(math.log(5.0))  # where it is 100 N m
    assert share == pytest.approx(2.0 * half / TURN, rel=1e-9)
    away = 1e-4 * TURN / 2.0  # where it is exceeded for 1e-4 of the turn
    assert upper == pytest.approx(500.0 * math.exp(-((away / width) ** 2)), rel=1e-7)


def test_a_load_of_many_orders():
    """``-10 (1 + sin 60 x)^2``: mean 15, mean square ``100 (1 + 6/2 + 3/8)``."""
    _, (mean, rms, work, highest, lowest) = figures(
        crank('-10*(1+sin(60*cr))**2'),
        'mean(drive_torque)', 'rms(drive_torque)', 'work(drive_torque)',
        'highest(drive_torque)', 'lowest(drive_torque)',
    )  # fmt: skip
    assert mean == pytest.approx(15.0, rel=1e-10)
    assert work == pytest.approx(15.0 * TURN, rel=1e-10)
    assert rms == pytest.approx(10.0 * math.sqrt(1.0 + 3.0 + 3.0 / 8.0), rel=1e-10)
    assert highest == pytest.approx(40.0, rel=1e-9)
    assert lowest == pytest.approx(0.0, abs=1e-9)


def test_a_cycle_agrees_about_a_narrow_load():
    one = cycle(crank('-500*exp(-((cr-2.0)/0.01)**2)'))
    assert one.mean_power == pytest.approx(20.0 * 5.0 * math.sqrt(math.pi) / TURN, rel=1e-9)
    square = 500.0**2 * 0.01 * math.sqrt(math.pi / 2.0) / TURN
    assert one.rms('drive_torque') == pytest.approx(math.sqrt(square), rel=1e-9)
    assert one.extremes()['drive_torque'].greatest.value == pytest.approx(500.0, rel=1e-9)


@pytest.mark.sample(1)
@pytest.mark.parametrize('width', [0.002, 0.02])
def test_the_work_of_a_load_on_the_crank_of_a_loose_machine(width):
    """The crank turns at constant speed: what the load takes is an integral over its angle."""
    torque = f'-20*exp(-((crank-1.0)/{width})**2)'
    loaded = ms.load_scene(
        'four_bar_clearance', {'loads': {'l': {'at': 'crank', 'torque': torque}}}
    )
    plain = ms.load_scene('four_bar_clearance')
    start, _ = loaded.drive.start
    right = quad(
        lambda angle: 20.0 * math.exp(-(((angle - 1.0) / width) ** 2)),
        start, start + TURN, points=[1.0], epsabs=1e-13, limit=500,
    )[0]  # fmt: skip
    with_load, without = (ms.simulate(m, revolutions=1).energy for m in (loaded, plain))
    assert with_load.drive_work - without.drive_work == pytest.approx(right, rel=1e-8)
    assert abs(with_load.residual) < 1e-9 * with_load.exchanged


def test_a_percentile_is_weighted_by_time():
    """Half of the time of a slow fast crank: nodes of short steps do not count for more."""
    machine = crank('-10*(1+sin(60*cr))**2')
    _, found = figures(machine, *(f'percentile(drive_torque, {p})' for p in (0, 25, 50, 75, 100)))
    # 10 (1 + s)^2 <= y where s <= sqrt(y/10) - 1, a share 1/2 + asin(.)/pi of the time
    right = [10.0 * (1.0 - math.cos(math.pi * p)) ** 2 for p in (0.0, 0.25, 0.5, 0.75, 1.0)]
    np.testing.assert_allclose(found, right, rtol=1e-8, atol=1e-8)


def test_shares_of_conditions_that_are_joined():
    """``sin`` between two levels, and where one of two conditions holds."""
    _, (between, either, narrow) = figures(
        crank('-10*sin(3*cr)'),
        'share(5 < drive_torque < 8)',
        'share(drive_torque > 5 or drive_torque < -8)',
        'share(drive_torque > 9.99999)',
    )
    above = {x: 0.5 - math.asin(x / 10.0) / math.pi for x in (5.0, 8.0, 9.99999)}
    assert between == pytest.approx(above[5.0] - above[8.0], rel=1e-9)
    assert either == pytest.approx(above[5.0] + above[8.0], rel=1e-9)
    assert narrow == pytest.approx(above[9.99999], rel=1e-6)


def test_a_figure_that_has_no_value_says_so():
    machine = ms.load_scene('four_bar_nominal')
    solution = ms.simulate(machine, revolutions=1)
    mean, root, upper = measure(
        machine, solution,
        'mean(1/(velocity.rocker - velocity.rocker))', 'rms(sqrt(sin(position.rocker) - 2))',
        'mean(1/velocity.rocker)',
    )  # fmt: skip
    for m in (mean, root):
        assert not math.isfinite(m.value)
        assert m.resolution == 'it is not finite for a part of the time'
    assert 'its error may be up to' in upper.resolution


@pytest.mark.parametrize('width', [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize('begin', [1.0, 6.28])
def test_a_load_during_a_narrow_part_of_the_cycle_is_seen_whole(begin, width):
    """Its work is the torque times the angle; of cosines no digits are left at a width of 1e-6."""
    machine = crank(-10.0, during={'coordinate': 'cr', 'from': begin, 'to': begin + width})
    work = ms.simulate(machine, revolutions=1).energy.drive_work
    assert work == pytest.approx(10.0 * ((begin + width) - begin), rel=1e-9)


@pytest.mark.parametrize('ramp', ['linear', 'smooth'])
def test_a_drive_that_changes_its_speed_within_a_microsecond(ramp):
    """By a law of degree 1 or ``3 u^2 - 2 u^3``: torque is inertia times its derivative."""
    width, inertia = 1e-6, 0.01
    points = [[0, 10.0], [0.05, 10.0], [0.05 + width, 12.0], [0.1, 12.0]]
    scene = {
        'title': 'a wheel', 'gravity': [0, 0],
        'links': {'ground': {}, 'wheel': {'mass': 1.0, 'inertia': inertia, 'cog': 0.0}},
        'joints': {'O': {'revolute': ['ground', 'wheel']}},
        'drive': {'coordinate': 'wheel', 'start_angle': 0.0, 'profile': {
            'ramp': ramp, 'points': [[t, f'{w} rad/s'] for t, w in points]}},
        'duration': 0.1,
    }  # fmt: skip
    machine = made(scene, 'wheel')
    solution, one = ms.simulate(machine), cycle(machine)
    steep, square = (1.0, 1.0) if ramp == 'linear' else (1.5, 1.2)
    T = inertia * 2.0 / width
    peak, rms, mean = T * steep, T * math.sqrt(square * width / 0.1), T * width / 0.1
    work = 0.5 * inertia * (12.0**2 - 10.0**2)
    assert solution.energy.drive_work == pytest.approx(work, rel=1e-12)
    names = 'work', 'highest', 'rms', 'mean'
    found = measure(machine, solution, *(f'{name}(drive_torque)' for name in names))
    # the ends of the ramp are known to 7e-18 s
    assert [m.value for m in found] == pytest.approx([work, peak, rms, mean], rel=1e-10)
    assert one.rms('drive_torque') == pytest.approx(rms, rel=1e-10)
    assert one.mean('drive_torque') == pytest.approx(mean, rel=1e-10)
    assert one.extremes()['drive_torque'].greatest.value == pytest.approx(peak, rel=1e-10)
