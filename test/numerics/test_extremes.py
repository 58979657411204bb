"""Extremes: every one that is reported against dense sampling, and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from bags import write_bag
from builders import simulated
from running import run_json

import mechanism_sim as ms
from mechanism_sim.numerics.extremes import ExtremeSearch
from mechanism_sim.results.ranges import LoadPeaks
from mechanism_sim.studies.plan import Extent
from mechanism_sim.studies.row import SweepTask
from mechanism_sim.studies.runs import compute

POINTS = 1_000_000
CHUNK = 20_000

SOFT = {
    'joints.coupler_rocker.clearance.contact.law': 'hunt_crossley',
    'joints.coupler_rocker.clearance.contact.stiffness': 1e8,
    'joints.coupler_rocker.clearance.restitution': 0.9,
    'start': 'centred',
}
SCENES = {
    'four_bar_nominal': ({}, None),  # prescribed, in closed form
    'windshield_wiper': ({}, None),  # prescribed, six links; forces that come close to zero
    'geneva': ({}, None),  # prescribed, with pieces
    'pendulum': ({}, 0.5),  # smooth
    'slider_crank_engine': ({}, 0.06),  # smooth, gas forces; forces through zero
    'four_bar_clearance': ({}, None),  # impacts
    'bearing_run_up': ({}, 3.0),  # impacts, friction, many turns
    'four_bar_clearance, soft': (SOFT, None),  # compliant
    'valve_train': ({}, None),  # cam that is left
    'gear_rattle': ({}, None),  # gear with backlash
}
"""The samples of ten scenes take 20 s of CPU time together: they are what the proof costs."""


QUICK = {'four_bar_clearance'}


@pytest.mark.slow
@pytest.mark.parametrize(
    'name', [pytest.param(n, marks=[pytest.mark.slow] * (n not in QUICK)) for n in SCENES]
)
def test_extremes_against_dense_sampling(name):
    """No sample of 1e6 lies outside of a reported range, and the ends are met when it says."""
    overrides, duration = SCENES[name]
    cycle = ms.cycle(ms.load_scene(name.partition(',')[0], overrides), duration=duration)
    found = cycle.extremes()
    low, high = (dict.fromkeys(found, x) for x in (np.inf, -np.inf))

    done = [n for n in found if cycle.solution.catalogue[n].cumulative]

    def enter(t, names):
        for column, x in cycle.at(t, names).items():
            if not np.isnan(x).any():
                low[column] = min(low[column], x.min())
                high[column] = max(high[column], x.max())

    for t in np.array_split(np.linspace(*cycle.t[[0, -1]], POINTS), POINTS // CHUNK):
        enter(t, [n for n in found if n not in done])
        enter(t[:: CHUNK // 100], done)  # they cost nine times as much
    ends = [(e, x.t, x.value) for e in found for x in (found[e].least, found[e].greatest)]
    there = cycle.at(np.array([t for _, t, _ in ends]))
    for i, (column, _, value) in enumerate(ends):
        assert there[column][i] == pytest.approx(value, rel=0.0, abs=found[column].rounding), (
            column
        )
    for column, x in found.items():
        assert x.least.value <= low[column] + x.rounding, column
        assert x.greatest.value >= high[column] - x.rounding, column


def test_a_peak_between_samples_is_not_missed():
    """The largest force of a run-up is not beside the largest of its 361 samples."""
    cycle = ms.cycle(ms.load_scene('bearing_run_up'), duration=3.0)
    force = 'reaction.coupler_rocker.size'
    assert cycle.extremes()[force].greatest.value > 1.2 * cycle[force].max()


def test_cycle_bag_and_sweep_agree(tmp_path):
    """The largest forces of one run, wherever they are reported."""
    machine = ms.load_scene('four_bar_clearance')
    ends = ms.cycle(machine, periods=2).extremes()
    bag = tmp_path / 'run.mcap'
    write_bag(bag, simulated(machine.name, revolutions=2))
    loads = run_json('analyze', str(bag))['loads']
    assert loads['samples'] is None
    for peak in loads['joints']:
        top = ends[f'reaction.{peak["name"]}.size'].greatest
        assert (peak['value'], peak['time']) == pytest.approx((top.value, top.t), rel=1e-9)
    torque = ends['drive_torque']
    largest = max(-torque.least.value, torque.greatest.value)
    assert abs(loads['drive_torque']['value']) == pytest.approx(largest, rel=1e-9)
    row = compute(SweepTask('', machine.name, machine.scene, Extent(2, None, 0))).row
    most = max(peak['value'] for peak in loads['joints'])
    assert row['largest_force'] == pytest.approx(most, rel=1e-9)


def test_peaks_do_not_depend_on_batches():
    """The same motion in one piece, or in pieces as a sweep reads it."""
    machine = ms.load_scene('gear_rattle')
    whole, parts = LoadPeaks(machine), LoadPeaks(machine)
    whole.add(ms.simulate(machine, revolutions=3).motion)
    run, end = machine.start(), machine.drive.time_of(3)
    while run.time < end:
        run.advance(end, final=True, most=7)
        parts.add(run.drain()[0])
    for one, other in zip(whole.forces.values(), parts.forces.values(), strict=True):
        assert one == pytest.approx(other, rel=1e-10)


def searched(function, edges, **more):
    """The least and greatest value of one function on intervals, and when."""
    calls = []

    def functions(t):
        calls.append(t.size)
        return function(t.ravel())[None]

    search = ExtremeSearch(['x'], **more)
    search.add(functions, np.asarray(edges[:-1]), np.nextafter(edges[1:], -np.inf))
    (low,), (high,) = search.least, search.greatest
    return low, search.least_time[0], high, search.greatest_time[0], sum(calls)


def test_extremes_of_known_functions():
    edges = np.linspace(0.0, 5.0, 41)
    low, at_low, high, at_high, _ = searched(np.sin, edges)
    assert (low, high) == (-1.0, 1.0)
    assert (at_low, at_high) == pytest.approx((1.5 * np.pi, 0.5 * np.pi), abs=3e-8)
    # a peak as wide as a thirtieth of its interval
    _, _, high, at_high, _ = searched(lambda t: 1.0 / (1.0 + (300.0 * (t - 1.7)) ** 2), edges)
    assert (high, at_high) == pytest.approx((1.0, 1.7), abs=1e-12)
    # a corner
    low, at_low, *_ = searched(lambda t: np.abs(t - 2.345), edges)
    assert (low, at_low) == pytest.approx((0.0, 2.345), abs=1e-12)
    # a size that comes close to zero between nodes
    low, at_low, *_ = searched(lambda t: np.hypot(t - 2.345, 1e-9), edges, positive=[True])
    assert (low, at_low) == pytest.approx((1e-9, 2.345), abs=1e-11)


def test_both_limits_at_a_jump_count():
    """A saw tooth rises to each event, and falls there."""
    edges = np.arange(6.0)
    low, at_low, high, at_high, _ = searched(lambda t: (t - np.floor(t)) * np.floor(t), edges)
    assert (low, at_low) == (0.0, 0.0)
    assert (high, at_high) == pytest.approx((4.0, 5.0), rel=1e-15)
    assert at_high < 5.0


def test_what_is_equal_but_for_rounding_costs_little():
    """A constant with noise, and a hundred equal peaks of which the first is reported."""
    edges = np.linspace(0.0, 100.0, 1001)
    noise = np.random.default_rng(1)
    low, _, high, _, calls = searched(lambda t: 3.0 + 1e-15 * noise.standard_normal(len(t)), edges)
    assert (low, high) == pytest.approx((3.0, 3.0), rel=1e-14)
    assert calls < 10 * len(edges)
    _, _, high, at, calls = searched(lambda t: np.cos(2.0 * np.pi * (t - 0.35)), edges)
    assert (high, at) == pytest.approx((1.0, 0.35), abs=1e-8)
    assert calls < 12 * len(edges)


def test_intervals_that_are_alike_are_looked_into_once():
    """Four hundred turns cost 5 evaluations an interval, and hide no function that differs."""
    edges = np.arange(0.0, 100.125, 0.25)
    alike = np.arange(400) % 4
    kinds = {
        'repeats': lambda t: np.cos(2.0 * np.pi * (t - 0.35)),
        'grows': lambda t: np.cos(2.0 * np.pi * (t - 0.35)) + 1e-6 * np.floor(t),
    }
    found = {}
    for name, function in kinds.items():
        calls = 0

        def counted(t, function=function):
            nonlocal calls
            calls += t.size
            return function(t.ravel())[None]

        search = ExtremeSearch(['value'])
        search.add(counted, edges[:-1], np.nextafter(edges[1:], -np.inf), alike=alike)
        found[name] = search.greatest[0], search.greatest_time[0], calls / len(alike)
    assert found['repeats'] == pytest.approx((1.0, 0.35, 5.3), abs=0.3)
    assert found['grows'][:2] == pytest.approx((1.0 + 99e-6, 99.35), abs=1e-8)


def test_turns_of_a_steady_drive_are_alike():
    """The pieces of twenty turns fall into those of two, and the last has the extremes of one."""
    many = ms.cycle('four_bar_nominal', periods=20)
    motion = many.solution.motion
    pieces = motion.alike(np.arange(len(motion)))
    assert len(set(pieces.tolist())) < len(pieces) / 10
    one = ms.cycle('four_bar_nominal').extremes()
    for name, ends in many.extremes().items():
        if name not in {'position.crank', 'energy.dissipated'}:
            assert ends.least.value == pytest.approx(one[name].least.value, rel=1e-9, abs=1e-9)
            assert ends.greatest.value == pytest.approx(
                one[name].greatest.value, rel=1e-9, abs=1e-9
            )
    assert many.extremes()['position.crank'].greatest.value == pytest.approx(40.0 * np.pi)


def test_the_farther_end_alone_costs_less_and_is_the_same():
    """Of ``a + sin t`` and its like, from either side; values near zero are not looked for."""
    shifts = np.array([-0.3, 0.0, 0.2, 2.0])[:, None]
    edges = np.linspace(0.0, 20.0, 60)

    def found(magnitudes):
        asked = []

        def values(t):
            asked.append(t.size)
            size = np.abs(shifts + np.sin(t.ravel()))
            return np.concatenate([shifts + np.sin(t.ravel()), np.hypot(size, 1e-3)])

        search = ExtremeSearch([0] * 8, positive=[False] * 4 + [True] * 4, magnitudes=magnitudes)
        search.add(values, edges[:-1], edges[1:])
        return np.maximum(-search.least, search.greatest), sum(asked)

    (both, dear), (farther, cheap) = found(None), found([True] * 8)
    np.testing.assert_array_equal(farther, both)
    largest = 1.0 + np.abs(shifts[:, 0])
    np.testing.assert_allclose(farther, [*largest, *np.hypot(largest, 1e-3)], rtol=1e-15)
    assert cheap < 0.6 * dear
