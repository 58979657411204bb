"""One cycle of a machine: columns, extremes, means, tables and plots."""

from __future__ import annotations

import csv
import itertools
import math
import pickle
import re

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from builders import made, without_work
from running import run, run_json
from scipy.integrate import quad

import mechanism_sim as ms
from mechanism_sim.cli import main
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.extremes import ExtremeSearch
from mechanism_sim.report import cycle as report
from mechanism_sim.report import figures, plots
from mechanism_sim.results.cycle import measures_of
from mechanism_sim.results.measure_accumulators import EXACT
from mechanism_sim.scene.frame_forces import JointForces

LINKS = ('crank', 'coupler', 'rocker')
STENCIL = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0  # sixth order
STEP = 1e-4  # [s]


@pytest.fixture(scope='module')
def nominal():
    return ms.cycle(
        ms.load_scene('four_bar_nominal'), points=['coupler.end', 'rocker.end'], local=True
    )


@pytest.mark.parametrize('scene', ['differential', 'torsional_shaft', 'unbalanced_machine'])
def test_a_cycle_is_a_turn_of_a_steady_shaft_whatever_else_is_free(scene):
    """Not as long as the scene's run is."""
    machine = ms.load_scene(scene)
    assert machine.scene.duration > 2.0 * machine.drive.period
    assert ms.cycle(machine).duration == pytest.approx(machine.drive.period, rel=1e-12)


def test_a_cycle_goes_over_the_names_of_its_table(nominal):
    """It asked for the column 0."""
    assert list(nominal) == list(nominal.table())
    assert 'drive_torque' in nominal
    assert 'drive_torqe' not in nominal
    nominal.rms('drive_torque')
    assert pickle.loads(pickle.dumps(nominal)).rms('drive_torque') == nominal.rms('drive_torque')


def slope(function, t):
    """Time derivative by central differences of sixth order; function(t) is (..., N)."""
    return (
        sum(w * function(t + k * STEP) for k, w in zip(range(-3, 4), STENCIL, strict=True)) / STEP
    )


def locations(cycle, t):
    """Mass centres (b, 2, N) and angles (b, N) of all links, without the compiled functions."""
    mechanism, x = cycle.machine.mechanism, without_work(cycle.solution, t)
    q = [{c: x[f'position.{c}'][i] for c in mechanism.coordinates} for i in range(len(x['t']))]
    at = [[mechanism.locate(b.name, each, b.cog) for each in q] for b in mechanism.bodies]
    angles = [[mechanism.angle(b.name, each) for each in q] for b in mechanism.bodies]
    return np.array(at).swapaxes(1, 2), np.array(angles)


def test_columns_are_those_of_the_solution_and_more(nominal):
    expected = ms.simulate(nominal.machine).sample(nominal.t)
    for name, column in expected.items():
        np.testing.assert_array_equal(nominal[name], column, err_msg=name)
    assert len(nominal.t) == 361
    assert nominal.duration == pytest.approx(nominal.machine.drive.period, rel=1e-14)


def test_extremes_of_the_rocker_are_where_crank_and_coupler_are_in_line(nominal):
    l = nominal.machine.nominal.linkage  # noqa: E741 - the lengths
    ends = nominal.extremes()['position.rocker']
    limits = {}
    for name, reach, turn in (
        ('greatest', l.coupler - l.crank, np.pi),
        ('least', l.coupler + l.crank, 0.0),
    ):
        rocker = np.arccos((l.ground**2 + l.rocker**2 - reach**2) / (2.0 * l.ground * l.rocker))
        crank = np.arccos((l.ground**2 + reach**2 - l.rocker**2) / (2.0 * l.ground * reach))
        limits[name] = np.pi - rocker, crank + turn
    for name, (rocker, crank) in limits.items():
        found = getattr(ends, name)
        assert found.value == pytest.approx(rocker, abs=1e-14)
        assert found.drive == pytest.approx(crank, abs=1e-8)
    swing = nominal.swings()['rocker']
    assert swing.size == pytest.approx(limits['greatest'][0] - limits['least'][0], abs=1e-14)
    rising = limits['greatest'][1] - limits['least'][1]
    assert swing.time_ratio == pytest.approx(
        max(rising, 2.0 * np.pi - rising) / min(rising, 2.0 * np.pi - rising), abs=1e-8
    )
    assert nominal.swings()['crank'].turns == 1


def test_extremes_do_not_depend_on_the_samples(nominal):
    coarse = ms.cycle(nominal.machine, samples=97).extremes()
    for name, ends in nominal.extremes().items():
        if name not in coarse:
            continue
        for fine, rough in (
            (ends.least, coarse[name].least),
            (ends.greatest, coarse[name].greatest),
        ):
            assert rough.value == pytest.approx(fine.value, rel=1e-12, abs=1e-12), name
    at = nominal.extremes()['reaction.coupler_rocker.size']
    assert np.degrees(at.greatest.drive) == pytest.approx(32.0, abs=0.5)  # known of this machine
    assert at.greatest.value == pytest.approx(13.90, abs=0.005)
    assert np.degrees(at.least.drive) == pytest.approx(336.0, abs=0.5)


def shaken_as_momentum_says(cycle):
    """A second route: no joint force, but the momentum of all links, by finite differences."""
    mechanism = cycle.machine.mechanism
    m = np.array([b.mass for b in mechanism.bodies])
    inertia = np.array([b.inertia for b in mechanism.bodies])
    t = cycle.t[20:-20:40]

    def momentum(times):
        velocity = slope(lambda s: locations(cycle, s)[0], times)
        rate = slope(lambda s: locations(cycle, s)[1], times)
        (x, y), (vx, vy) = locations(cycle, times)[0].swapaxes(0, 1), velocity.swapaxes(0, 1)
        return np.array([m @ vx, m @ vy, m @ (x * vy - y * vx) + inertia @ rate])

    (gx, gy), (x, y) = mechanism.gravity, locations(cycle, t)[0].swapaxes(0, 1)
    weight = np.array([m.sum() * gx + 0.0 * t, m.sum() * gy + 0.0 * t, m @ (x * gy - y * gx)])
    found = cycle.at(t)
    on_frame = [found[n] for n in ('shaking_force.x', 'shaking_force.y', 'shaking_moment')]
    np.testing.assert_allclose(on_frame, weight - slope(momentum, t), atol=1e-5)
    force = np.array([found['acceleration.mass_centre.x'], found['acceleration.mass_centre.y']])
    np.testing.assert_allclose(weight[:2] - m.sum() * force, on_frame[:2], atol=1e-10)


def test_force_and_moment_on_the_frame_are_the_rates_of_momentum(nominal):
    shaken_as_momentum_says(nominal)


def test_the_frame_feels_its_joints_and_its_drive(nominal):
    """A second route: forces of inverse dynamics in the joints, and the torque of the drive."""
    machine, motion, t = nominal.machine, nominal.solution.motion, nominal.t[5:-5:50]
    found = nominal.at(t)
    joints = JointForces(machine, ['ground_crank', 'rocker_ground'])
    on_frame = joints.read(motion, *motion.curve.find(t))
    on_frame[2] -= found['drive_torque']
    for name, x in zip(('force.x', 'force.y', 'moment'), on_frame, strict=True):
        np.testing.assert_allclose(found[f'shaking_{name}'], x, atol=1e-10)


def test_the_frame_feels_joints_and_drive_of_links_that_lean_out_of_the_plane():
    """To the fourth order of the tilt, which equations leave out; it was 0.2 %."""
    run = ms.simulate('four_bar_misaligned', duration=0.04)
    names = 'reaction.rocker_ground.y', 'drive_torque', 'shaking_moment'
    seen = run.sample(np.linspace(0.002, 0.04, 51), *names)
    moment = 0.387 * seen['reaction.rocker_ground.y'] - seen['drive_torque']
    np.testing.assert_allclose(seen['shaking_moment'], moment, atol=1e-7 * np.abs(moment).max())


def test_steady_shafts_at_an_angle_shake_the_frame_by_their_loads_alone():
    """The teeth press on bearings, whose forces are in no plane: the brake is all that is left."""
    run = ms.simulate('bevel_pair', duration=0.02)
    found = run.sample(np.linspace(0.0, 0.02, 5), 'shaking_moment', 'velocity.wheel')
    np.testing.assert_allclose(found['shaking_moment'], -0.2 * found['velocity.wheel'], rtol=1e-9)


def test_power_is_the_rate_of_energy(nominal):
    t = nominal.t[10:-10:25]

    def energy(times):
        x = nominal.solution.sample(times, 'energy.kinetic', 'energy.potential')
        return x['energy.kinetic'] + x['energy.potential']

    np.testing.assert_allclose(nominal.at(t)['drive_power'], slope(energy, t), atol=1e-7)
    np.testing.assert_allclose(
        nominal['drive_power'], nominal['drive_torque'] * nominal['velocity.crank'], atol=1e-12
    )


def test_points_move_as_the_links_that_they_belong_to(nominal):
    t = nominal.t[10:-10:25]
    for axis in 'xy':
        for kind in ('position', 'velocity', 'acceleration'):
            a, b = (nominal[f'{kind}.{link}.end.{axis}'] for link in ('coupler', 'rocker'))
            np.testing.assert_allclose(a, b, atol=1e-10 if kind == 'acceleration' else 1e-13)
        for low, high in itertools.pairwise(('position', 'velocity', 'acceleration')):
            name = f'coupler.end.{axis}'
            rate = slope(lambda s, c=f'{low}.{name}': nominal.at(s)[c], t)
            np.testing.assert_allclose(nominal.at(t)[f'{high}.{name}'], rate, rtol=1e-7, atol=1e-7)


def test_local_components_are_the_same_force_on_both_links(nominal):
    for joint in nominal.machine.mechanism.joints:
        for link, sign in ((joint.first, -1.0), (joint.second, 1.0)):
            if link == 'ground':
                continue
            turn = np.exp(-1j * nominal[f'position.{link}'])
            force = nominal[f'reaction.{joint.name}.x'] + 1j * nominal[f'reaction.{joint.name}.y']
            local = sign * force * turn
            along, across = (
                nominal[f'reaction.{joint.name}.{link}.{part}'] for part in ('along', 'across')
            )
            np.testing.assert_allclose(along, local.real, atol=1e-12)
            np.testing.assert_allclose(across, local.imag, atol=1e-12)


def test_means_are_integrals_over_time(nominal):
    def square(t):
        return float(nominal.at(np.array([t]))['drive_torque'][0] ** 2)

    integral, _ = quad(square, 0.0, nominal.duration, epsabs=1e-10, limit=100)
    assert nominal.rms('drive_torque') ** 2 == pytest.approx(integral / nominal.duration, rel=1e-8)
    assert nominal.mean_power == pytest.approx(0.0, abs=1e-12)
    assert nominal.mean('drive_power') == pytest.approx(nominal.mean_power, abs=1e-12)


@pytest.mark.parametrize('speed', ['350 rpm', '-350 rpm'])
def test_a_cycle_begins_where_it_is_told(speed):
    machine = ms.load_scene('four_bar_nominal', {'drive.speed': speed})
    found = ms.cycle(machine, samples=8, start=np.radians(30.0), periods=2)
    crank = np.degrees(found['position.crank'])
    assert crank[0] % 360.0 == pytest.approx(30.0, abs=1e-10)
    np.testing.assert_allclose(np.abs(np.diff(crank)), 45.0, atol=1e-9)
    assert len(found.t) == 17
    assert abs(found.swings()['crank'].turns) == 2


def test_a_loose_machine_has_a_cycle_too():
    found = ms.cycle(ms.load_scene('four_bar_clearance'), samples=90)
    assert found['gap.coupler_rocker'].max() <= 0.254e-3
    assert found.extremes()['normal_force.coupler_rocker'].least.value >= -1e-9
    assert found.mean_power == pytest.approx(
        found['energy.drive_work'][-1] / found.duration, rel=1e-12
    )


def test_what_is_printed_needs_no_table():
    """Its columns of work take a quadrature up to each sample, a quarter of many turns' time."""
    found = ms.cycle('four_bar_clearance', samples=90)
    assert 'mean power' in report.render(found)
    assert '_table' not in vars(found)
    assert found.units() == found.table().units
    work = found['energy.drive_work']
    assert found.mean_power == (work[-1] - work[0]) / found.duration


def test_without_masses_there_is_motion_alone():
    found = ms.cycle(ms.load_scene('four_bar_nominal', {'outputs.forces': False}), samples=12)
    assert not any(name.startswith(('reaction', 'drive', 'energy')) for name in found.table())
    assert {c.key for c in plots.charts(found)} == {'motion', 'phase'}
    assert report.to_json(found)['mean_power'] is None
    assert 'rocker goes over' in report.render(found)


def test_a_torque_driven_machine_needs_a_duration():
    scene = {'drive.speed': '100 rpm', 'drive.torque.constant': '0.1 N m'}
    machine = ms.load_scene('four_bar_nominal', scene)
    with pytest.raises(InputError, match='duration in seconds'):
        ms.cycle(machine)
    with pytest.raises(InputError, match='start angle'):
        ms.cycle(machine, start=0.0, duration=0.1)
    found = ms.cycle(machine, samples=10, duration=0.1)
    assert found.t[-1] == 0.1
    assert not found.repeats
    assert found.swings()['rocker'].time_ratio is None


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('--points', 'coupler.ned'), "did you mean 'coupler.end'"),
        (('--at', '30'), "write for example '30 deg'"),
        (('--at', '30 mm'), "'30 mm' is not a quantity with a unit"),
        (
            ('--at', '3.6e15 deg'),
            "--at = '3.6e15 deg' is so many turns that it is rounded",
        ),
        (('--samples', '1'), 'at least 2 samples'),
        (('--revolutions', '2', '--duration', '1'), 'periods or a duration, not both'),
        (('--output', 'table.txt'), 'the ending must be .parquet, .csv, .xlsx, .mat or .npz'),
        (('--plots', 'nowhere/x.png'), 'there is no directory'),
        (('--plots', 'x.gif'), 'the ending must be .png'),
    ],
)
def test_bad_input_is_one_sentence(arguments, words, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(['cycle', 'four_bar_nominal', *arguments])
    assert stopped.value.code == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count('\n') == 1


@pytest.mark.slow
def test_the_command_writes_the_table_and_the_summary(tmp_path):
    files = {suffix: tmp_path / f'table.{suffix}' for suffix in ('csv', 'npz', 'parquet')}
    options = ('cycle', 'four_bar_nominal', '--samples', '24', '--at', '90 deg', '--points',
               'coupler.cog')  # fmt: skip
    for file in files.values():
        found = run_json(*options, '--output', str(file))
    with files['csv'].open(encoding='utf-8') as text:
        heads = next(csv.reader(text))
    rows = np.loadtxt(files['csv'], delimiter=',', skiprows=1)
    parquet, npz = pq.read_table(files['parquet']), np.load(files['npz'])
    names, units = list(npz), found['units']
    assert parquet.column_names == names == list(units)
    assert heads == [f'{name} [{u}]' if (u := units[name]) else name for name in names]
    for i, name in enumerate(names):
        np.testing.assert_array_equal(rows[:, i], npz[name])
        np.testing.assert_array_equal(rows[:, i], parquet[name].to_numpy())
    assert found['units']['position.coupler.cog.x'] == 'm'
    assert found['units']['velocity.coupler'] == 'rad/s'
    assert found['units']['drive_torque'] == 'N m'
    assert found['extremes']['velocity.rocker']['greatest']['value'] > 0.0
    before = files['csv'].read_bytes()
    files['csv'].write_bytes(b'of another machine')
    assert run(*options, '--output', str(files['csv'])).returncode == 0
    assert files['csv'].read_bytes() == before  # replaced, as pictures are
    for refused in ('--samples', '1'), ('--revolutions', '0'):
        assert run(*options, '--output', str(files['csv']), *refused).returncode == 2
        assert files['csv'].read_bytes() == before
    text = run(*options).stdout
    assert 'time ratio 1.05' in text
    assert 'mean power of the drive 0 W' in text


def test_plots_have_labels_with_units(nominal):
    drawn = {chart.key: figures.paint(chart) for chart in plots.charts(nominal)}
    assert set(drawn) == {'motion', 'phase', 'forces', 'hodographs', 'drive', 'paths'}
    for name, figure in drawn.items():
        assert figure.axes
        for axes in figure.axes:
            assert axes.lines, name
            text = axes.get_title() if axes.name == 'polar' else axes.get_ylabel()
            assert '[' in text, name
        below = [axes for axes in figure.axes if axes.name != 'polar']
        if below:
            assert '[' in below[-1].get_xlabel(), name
    round_ones = drawn['hodographs'].axes
    assert round_ones[2].get_title() == 'coupler_rocker: coupler on rocker\n[N]'
    assert not any(axes.get_legend() for axes in round_ones)  # each has one line, which is said
    force = round_ones[2].lines[0]
    np.testing.assert_array_equal(force.get_ydata(), nominal['reaction.coupler_rocker.size'])


def test_rounding_is_drawn_as_a_line_at_zero():
    cycle = ms.cycle('windshield_wiper')
    name = 'velocity.rocker_coupler'
    assert cycle[name].any()  # of 1e-15 rad/s: it is led in a parallelogram
    curves = [c for chart in plots.charts(cycle) for p in chart.panels for c in p.curves]
    assert not next(c.y for c in curves if c.of == name).any()


def test_moments_that_are_rounding_beside_forces_are_not_searched_for_extremes(monkeypatch):
    """A piston in line with its pin: moments of 1e-14 N m beside 4 kN took 14 s."""
    looked, examine = [], ExtremeSearch._examine

    def counted(self, functions, x):
        looked.append(len(x.a))
        return examine(self, functions, x)

    monkeypatch.setattr(ExtremeSearch, '_examine', counted)
    cycle = ms.cycle(ms.load_scene('rotary_engine', {'drive.speed': '-1200 rpm'}))
    moment = cycle.extremes()['reaction.cylinder_piston.moment']
    assert moment.constant
    assert abs(moment.greatest.value) < moment.rounding < 1e-8
    assert sum(looked) < 500


def test_what_forces_on_the_frame_leave_of_each_other_is_nothing():
    """It was 1e-16 N m, as a difference of moments of forces."""
    lifter = made({
        'mechanism': 'linkage',
        'gravity': [0, '-9.81 m/s^2'],
        'links': {'ground': {}, 'cam': {'mass': '4 kg', 'inertia': '0.012 kg m^2'},
                  'lifter': {'mass': '1.8 kg'}},
        'joints': {
            'shaft': {'revolute': ['ground', 'cam']},
            'guide': {'prismatic': ['ground', 'lifter'], 'axis': '90 deg'},
            'contact': {'cam': ['cam', 'lifter'], 'follower': 'roller', 'roller': '12 mm',
                        'base_radius': '45 mm', 'law': {'segments': [
                            {'from': '0 deg', 'to': '180 deg', 'rise': '40 mm'},
                            {'from': '180 deg', 'to': '360 deg', 'rise': '-40 mm'}]}},
        },
        'drive': {'coordinate': 'cam', 'speed': '120 rpm'},
    })  # fmt: skip
    cycle = ms.cycle(lifter)
    assert not cycle['shaking_moment'].any()
    curves = [c for chart in plots.charts(cycle) for p in chart.panels for c in p.curves]
    shown = {c.of: c.y for c in curves if len(c.y) > 1}
    assert not shown['shaking_moment'].any()
    np.testing.assert_array_equal(shown['drive_torque'], cycle['drive_torque'])


def test_a_boxer_is_balanced_to_the_last_bit_wherever_it_is_asked_for():
    """In samples, measures and extremes alike; of 3 kN in the rods."""
    crank, w = 0.045, 100.0 * math.pi
    links = {
        'ground': {},
        'crank': {'length': 2.0 * crank, 'points': {'a': [crank, 0], 'b': [-crank, 0]},
                  'cog': 0, 'mass': 8, 'inertia': 0.01},
    }  # fmt: skip
    joints, guess = {'main': {'revolute': ['ground', 'crank']}}, {}
    for side, axis in (('a', '0 deg'), ('b', '180 deg')):
        rod, piston = f'rod_{side}', f'piston_{side}'
        links |= {rod: {'length': 0.15, 'mass': 0}, piston: {'mass': 0.5}}
        joints |= {
            f'big_{side}': {'revolute': [f'crank.{side}', rod]},
            f'small_{side}': {'revolute': [f'{rod}.end', piston]},
            f'bore_{side}': {'prismatic': ['ground', piston], 'axis': axis},
        }
        guess |= {rod: axis, piston: '150 mm'}
    boxer = made({
        'mechanism': 'linkage', 'links': links, 'joints': joints, 'guess': guess,
        'drive': {'coordinate': 'crank', 'speed': w},
    })  # fmt: skip
    cycle = ms.cycle(boxer)
    assert cycle['reaction.small_a.size'].max() == pytest.approx(0.5 * w**2 * crank * 1.3)
    for name in ('shaking_force.x', 'shaking_force.y', 'shaking_moment'):
        assert not cycle[name].any()
    solution = ms.simulate(boxer, revolutions=1)
    t, name = np.linspace(0.0, 0.019, 2001), 'shaking_moment'
    assert not solution.sample(t, name)[name].any()
    texts = ('largest(shaking_force)', 'mean(drive_power)')
    assert [found.value for found in ms.measure(solution, texts)] == [0.0, 0.0]


@pytest.mark.slow
@pytest.mark.sample(1)
@pytest.mark.parametrize('place', ['plots', 'all.pdf', 'some.svg'])
def test_plots_go_where_they_are_told(nominal, tmp_path, place):
    path = figures.check_picture('--plots', str(tmp_path / place), folder_too=True)
    files = figures.save_all(plots.charts(nominal), path)
    assert all(file.stat().st_size > 3000 for file in files)
    if place == 'all.pdf':
        assert len(re.findall(rb'/Type /Page\b', files[0].read_bytes())) == 6
    else:
        assert {file.suffix for file in files} == {'.svg' if '.' in place else '.png'}
        assert len(files) == 6


MASS = {'mass': '0.5 kg', 'inertia': '300 kg mm^2', 'cog': ['20 mm', '3 mm']}
TURNING = {'coordinate': 'crank', 'speed': '300 rpm', 'start_angle': '30 deg'}
GENERAL = {
    'slider-crank with springs to the frame': {
        'links': {
            'ground': {'points': {'guide': ['0 mm', '20 mm'], 'wall': ['330 mm', '90 mm']}},
            'crank': {'length': '50 mm', **MASS},
            'rod': {'length': '200 mm', **MASS},
            'piston': {'mass': '0.8 kg', 'cog': ['5 mm', '7 mm']},
        },
        'joints': {
            'ground_crank': {'revolute': ['ground', 'crank']},
            'crank_rod': {'revolute': ['crank.end', 'rod']},
            'rod_piston': {'revolute': ['rod.end', 'piston']},
            'piston_ground': {'prismatic': ['ground.guide', 'piston'], 'axis': '10 deg'},
        },
        'drive': TURNING,
        'guess': {'rod': '-10 deg', 'piston': '240 mm'},
        'springs': {
            'straight': {'between': ['ground.wall', 'piston'], 'stiffness': '200 N/m',
                         'free_length': '100 mm', 'damping': '5 N s/m'},
            'torsion': {'between': ['ground', 'rod'], 'stiffness': '3 N m/rad',
                        'free_angle': '90 deg', 'damping': '0.1 N m s/rad'},
        },
    },
    'Scotch yoke': {
        'links': {
            'ground': {},
            'crank': {'length': '50 mm', **MASS},
            'yoke': {'mass': '0.8 kg', 'cog': ['40 mm', '7 mm']},
        },
        'joints': {
            'ground_crank': {'revolute': ['ground', 'crank']},
            'ground_yoke': {'prismatic': ['ground', 'yoke']},
            'crank_yoke': {'slot': ['crank.end', 'yoke'], 'axis': '80 deg'},
        },
        'drive': TURNING,
    },
    'block on a turning guide': {
        'links': {
            'ground': {'points': {'pivot': ['0 mm', '-90 mm']}},
            'crank': {'length': '40 mm', **MASS},
            'block': MASS,
            'lever': {'length': '200 mm', **MASS},
        },
        'joints': {
            'ground_crank': {'revolute': ['ground', 'crank']},
            'crank_block': {'revolute': ['crank.end', 'block']},
            'lever_block': {'prismatic': ['lever', 'block']},
            'lever_ground': {'revolute': ['lever', 'ground.pivot']},
        },
        'drive': TURNING,
        'guess': {'lever': '70 deg', 'block': '70 deg'},
    },
    'five-bar with two cranks': {
        'links': {
            'ground': {'length': '120 mm'},
            'crank': {'length': '30 mm', **MASS},
            'left': {'length': '130 mm', **MASS},
            'right': {'length': '130 mm', **MASS},
            'second': {'length': '30 mm', **MASS},
        },
        'joints': {
            'ground_crank': {'revolute': ['ground', 'crank']},
            'crank_left': {'revolute': ['crank.end', 'left']},
            'left_right': {'revolute': ['left.end', 'right.end']},
            'second_right': {'revolute': ['second.end', 'right']},
            'ground_second': {'revolute': ['ground.end', 'second']},
        },
        'drive': TURNING,
        'drives': {'second': {'speed': '-600 rpm', 'start_angle': '90 deg'}},
        'guess': {'left': '60 deg', 'right': '120 deg'},
    },
    'cylinder that lifts an arm': {
        'links': {
            'ground': {'points': {'foot': ['300 mm', '0 mm']}},
            'barrel': {'length': '200 mm', **MASS},
            'piston': {'length': '200 mm', **MASS},
            'arm': {'length': '400 mm', 'points': {'lug': ['200 mm', '-30 mm']}, **MASS},
        },
        'joints': {
            'ground_arm': {'revolute': ['ground', 'arm']},
            'ground_barrel': {'revolute': ['ground.foot', 'barrel']},
            'barrel_piston': {'prismatic': ['barrel', 'piston']},
            'piston_arm': {'revolute': ['piston.end', 'arm.lug']},
        },
        'drive': {'coordinate': 'piston', 'speed': '0.3 m/s', 'start_position': '100 mm'},
        'guess': {'arm': '60 deg', 'barrel': '120 deg'},
    },
    'piston that drives a crank': {
        'links': {
            'ground': {},
            'crank': {'length': '50 mm', **MASS},
            'rod': {'length': '120 mm', **MASS},
            'piston': {'mass': '0.8 kg', 'cog': ['5 mm', '7 mm']},
        },
        'joints': {
            'ground_crank': {'revolute': ['ground', 'crank']},
            'crank_rod': {'revolute': ['crank.end', 'rod']},
            'rod_piston': {'revolute': ['rod.end', 'piston']},
            'ground_piston': {'prismatic': ['ground', 'piston']},
        },
        'drive': {'coordinate': 'piston', 'speed': '0.5 m/s', 'start_position': '100 mm'},
        'guess': {'crank': '120 deg', 'rod': '-30 deg'},
    },
}  # fmt: skip


def general_machine(title, folder):
    gravity = ['1 m/s^2', '-9.81 m/s^2']
    scene = GENERAL[title] | {'title': title, 'mechanism': 'linkage', 'gravity': gravity}
    file = folder / 'machine.yaml'
    file.write_text(yaml.safe_dump(scene), encoding='utf-8')
    return ms.load_scene(str(file))


@pytest.fixture(scope='module', params=GENERAL)
def general(request, tmp_path_factory):
    machine = general_machine(request.param, tmp_path_factory.mktemp('scene'))
    duration = None if machine.plan.main == 'crank' else 0.1
    return ms.cycle(machine, samples=200, duration=duration, local=True)


@pytest.mark.sample(1)
def test_any_machine_shakes_its_frame_by_the_rates_of_its_momentum(general):
    shaken_as_momentum_says(general)


@pytest.mark.slow
@pytest.mark.sample(1)
def test_any_machine_is_told_and_drawn(general, tmp_path):
    text = report.render(general)
    assert 'goes over' in text
    units = report.to_json(general)['units']
    assert {units[f'reaction.{joint}.size'] for joint in general.machine.physics.joints} == {'N'}
    for name in general.machine.mechanism.displacements:
        assert general.units()[f'velocity.{name}'] == 'm/s'
    drawn = list(plots.charts(general))
    files = figures.save_all(drawn, tmp_path / 'plots.pdf')
    assert {'motion', 'phase', 'forces', 'hodographs', 'drive'} == {c.key for c in drawn}
    assert all(file.stat().st_size > 3000 for file in files)
    assert general.repeats == (general.machine.plan.main == 'crank')
    assert {units[name] for name in general.drive_torques} == (
        {'N m'} if general.machine.plan.main == 'crank' else {'N'}
    )
    work = sum(
        general[name] * general[f'velocity.{name.partition(".")[2] or general.drive}']
        for name in general.drive_torques
    )
    np.testing.assert_allclose(work, general['drive_power'], atol=1e-9)


def test_the_stroke_of_a_slider_crank_is_known(tmp_path):
    tilt, crank, rod = np.radians(10.0), 0.05, 0.2
    foot = 0.02 * np.cos(tilt)  # of the offset, across the guide
    far, near = (np.sqrt(r * r - foot * foot) for r in (rod + crank, rod - crank))
    machine = general_machine('slider-crank with springs to the frame', tmp_path)
    swing = ms.cycle(machine, samples=90).swings()['piston']
    assert swing.size == pytest.approx(far - near, abs=1e-12)
    there, back = (np.arcsin(foot / r) for r in (rod + crank, rod - crank))
    turn = np.pi + back - there
    ratio = max(turn, 2.0 * np.pi - turn) / min(turn, 2.0 * np.pi - turn)
    assert swing.time_ratio == pytest.approx(ratio, rel=1e-8)


def test_static_forces_are_those_of_a_machine_that_hardly_moves():
    fast = ms.cycle(ms.load_scene('slider_crank'), 24, static=True)
    slow = ms.cycle(ms.load_scene('slider_crank', {'drive.speed': '0.3 rpm'}), 24)
    for name in ('drive_torque', 'reaction.crank_rod.x', 'reaction.crank_rod.y',
                 'reaction.ground_piston.y', 'reaction.ground_piston.moment'):  # fmt: skip
        assert fast[name] == pytest.approx(slow[name], rel=1e-5, abs=1e-4)
    assert fast.mean_power == pytest.approx(0.0, abs=1e-9)  # gravity gives back what it takes
    assert 'energy.kinetic' not in fast.table()


def test_static_forces_of_the_book_follow_from_the_moment_alone():
    """[V] 3.25, 3.30, 3.31: without weights, F32 = M2/(r2 sin(th3 - th2)), and what P4 then is."""
    links = {f'links.{x}.mass': '1e-30 kg' for x in ('crank', 'rod', 'piston')}
    load = {'loads.work': {'at': 'piston', 'force': ['-400 N', '0 N']}}
    cycle = ms.cycle(ms.load_scene('slider_crank', links | load | {'gravity': [0, 0]}), 36,
                     static=True)  # fmt: skip
    th2, th3 = cycle['position.crank'], cycle['position.rod']
    F32 = 400.0 / np.cos(th3)
    r2 = ms.load_scene('slider_crank').scene.links['crank'].length
    assert cycle['drive_torque'] == pytest.approx(F32 * r2 * np.sin(th3 - th2), abs=1e-9)
    assert cycle['reaction.rod_piston.x'] == pytest.approx(np.full(37, 400.0), rel=1e-9)
    guide = cycle['reaction.ground_piston.y']
    assert guide == pytest.approx(-F32 * np.sin(th3), abs=1e-9)


def test_static_forces_keep_what_depends_on_speed():
    """Without weights the drive supplies what the loads take: torque times speed is their power.

    The wiper's blades drag with 3 N s/m; a slider is held back on its way out only. Evaluated at
    rest the first torque would be 0 and the second half of what it is.
    """
    wiper = ms.cycle(ms.load_scene('windshield_wiper', {'gravity': [0, 0]}), 24, static=True)
    drag = sum(3.0 * (0.45 * wiper[f'velocity.{side}_rocker']) ** 2 for side in ('left', 'right'))
    assert wiper['drive_torque'] * wiper['velocity.crank'] == pytest.approx(drag, abs=1e-12)
    assert drag.max() > 10.0
    load = {'loads.work': {'at': 'piston', 'force': ['-200*(1 + tanh(1000*vx))', '0 N']}}
    pump = ms.cycle(ms.load_scene('slider_crank', {'gravity': [0, 0], **load}), 36, static=True)
    r, l, th, w = 0.05, 0.2, pump['position.crank'], 20.0 * np.pi  # noqa: E741 - as in the energy balance
    slope = -r * np.sin(th) - r * r * np.sin(th) * np.cos(th) / np.sqrt(
        l**2 - (r * np.sin(th)) ** 2
    )
    held = 200.0 * (1.0 + np.tanh(1000.0 * w * slope))
    assert pump['drive_torque'] == pytest.approx(held * slope, abs=1e-9)


def test_static_forces_need_an_ideal_machine():
    with pytest.raises(InputError, match='static forces need masses'):
        ms.cycle(ms.load_scene('four_bar_clearance'), static=True)


def test_measures_of_a_cycle_count_nothing_of_the_run_before_it():
    """Of a turn from 60 deg on: closed forms of a crank of 50 mm and a rod of 200 mm there."""
    begin, period = 1.0 / 60.0, 0.1
    found = ms.cycle('slider_crank', start=math.radians(60.0))
    texts = [
        'initial(position.piston, from 0 s)', 'integral(velocity.crank, from 0 s)',
        'highest(position.piston, to 0.5 revolutions)', 'mean(position.piston)',
    ]  # fmt: skip
    initial, turned, highest, mean = measures_of(found, texts)
    x, y = 0.05 * math.cos(math.pi / 3.0), 0.05 * math.sin(math.pi / 3.0)
    there = x + math.sqrt(0.2**2 - y**2)
    assert initial.value == pytest.approx(there, rel=1e-9)
    assert initial.resolution == f'from {begin:.6g} s on, where what was run begins'
    assert turned.value == pytest.approx(2.0 * math.pi, rel=1e-9)  # one turn, no more
    assert highest.value == pytest.approx(there, rel=1e-9)  # at 0 deg, before it, 250 mm
    # NumPy adds what lies in memory otherwise in another order
    assert mean.value == pytest.approx(found.mean('position.piston'), rel=1e-15, abs=0.0)
    assert mean.resolution == EXACT
    assert (found.t[0], found.t[-1]) == pytest.approx((begin, begin + period))


def test_measures_of_a_static_cycle_are_those_of_its_columns():
    found = ms.cycle('slider_crank', static=True)
    (rms,) = measures_of(found, ['rms(drive_torque)'])
    assert rms.value == found.rms('drive_torque')
    moving = ms.cycle('slider_crank')
    assert rms.value < 0.1 * moving.rms('drive_torque')  # it moves by inertia above all


@pytest.mark.parametrize('scene', ['geneva', 'linear_intermittent'])
def test_slots_without_forces_have_a_cycle_of_their_motion(scene):
    machine = ms.load_scene(scene, {'outputs.forces': False})
    found = ms.cycle(machine, start='30 deg', samples=36)
    assert not [name for name in found.names if 'torque' in name or 'force' in name]
    assert all(np.isfinite(x).all() for x in found.table().values())
    driven = machine.plan.links[-1]
    ends = found.extremes()[f'position.{driven}']
    assert ends.greatest.value - ends.least.value == pytest.approx(found.swings()[driven].size)
