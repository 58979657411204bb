"""Plots of recorded and simulated runs: their lines against what others read and compute."""

from __future__ import annotations

import csv
import io
import re

import numpy as np
import pandas
import pytest
import scipy
from bags import messages_of
from matplotlib.colors import same_color
from mcap_ros2.writer import Writer
from PIL import Image
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.analysis.details import SignalSpectrum
from mechanism_sim.analysis.open_run import Asked
from mechanism_sim.analysis.series import parse
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import InputError
from mechanism_sim.export.palette import LINKS
from mechanism_sim.messages import JointState, own_messages, serialize
from mechanism_sim.messages.units import units, units_of
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter
from mechanism_sim.report import lines
from mechanism_sim.report.charts.chart import Axis, Chart, ChartCurve, Panel
from mechanism_sim.report.charts.charted_run import ChartedRun
from mechanism_sim.report.charts.curves import over_drive
from mechanism_sim.report.charts.lines import against, against_recorded, chart
from mechanism_sim.report.charts.motion import over
from mechanism_sim.report.charts.subjects import orders
from mechanism_sim.report.figures import paint
from mechanism_sim.sensing.spectra import LineSpectrum
from ros_interfaces.definitions import field_descriptions

JOINT, POINT = 'coupler_rocker', 'coupler.cog'


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    file = tmp_path_factory.mktemp('plot') / 'run.mcap'
    done = run('run', 'four_bar_clearance', '--revolutions', '2', '--record', str(file))
    assert done.returncode == 0, done.stderr
    return file


@pytest.fixture(scope='module')
def solution():
    return ms.simulate(ms.load_scene('four_bar_clearance'), revolutions=2)


def drawn(bag, *names, **span):
    """The lines (label, x, y) of a plot of a bag, and the labels of its axes."""
    figure = lines.draw(chart(Asked(read_bag(bag)).series(names, **span), 'title'))
    found = [(x.get_label(), *x.get_data()) for axes in figure.axes for x in axes.lines]
    return found, [axes.get_ylabel() for axes in figure.axes]


@pytest.mark.slow
@pytest.mark.network
def test_lines_are_the_messages_that_others_read(bag):
    (gap, force), words = drawn(bag, 'linkage_state.gaps[0]', '/linkage_state.normal_forces')
    states = messages_of(bag, '/linkage_state')
    assert len(states) > 10
    for line in (gap, force):
        np.testing.assert_array_equal(line[1], [m.time for m in states])
    np.testing.assert_allclose(gap[2], [1e6 * m.gaps[0] for m in states], rtol=1e-15)
    np.testing.assert_array_equal(force[2], [m.normal_forces[0] for m in states])
    assert words == ['gaps [µm]', 'normal forces [N]']


@pytest.mark.slow
@pytest.mark.network
def test_filters_choose_messages_and_items_of_arrays(bag):
    (hard, place), words = drawn(
        bag, 'impacts{normal_impulse>1e-3}.normal_impulse',
        'tf.transforms{child_frame_id==coupler}.transform.translation.x',
    )  # fmt: skip
    impacts = [m for m in messages_of(bag, '/impacts') if m.normal_impulse > 1e-3]
    assert 0 < len(impacts) < len(messages_of(bag, '/impacts'))
    np.testing.assert_array_equal(hard[1], [m.time for m in impacts])
    np.testing.assert_array_equal(hard[2], [1e3 * m.normal_impulse for m in impacts])
    frames = [
        (m.transforms[0].header.stamp, t.transform.translation.x)
        for m in messages_of(bag, '/tf')
        for t in m.transforms
        if t.child_frame_id == 'coupler'
    ]
    np.testing.assert_allclose(place[2], [1e3 * x for _, x in frames], rtol=1e-15)
    np.testing.assert_allclose(place[1], [s.sec + 1e-9 * s.nanosec for s, _ in frames], atol=1e-9)
    assert words == ['normal impulse [mN·s]', 'x [mm]']


@pytest.mark.network
def test_blocks_of_samples_are_spread_over_time(bag):
    ((_, t, y),), words = drawn(bag, 'accelerometer/rocker_accelerometer.samples')
    blocks = messages_of(bag, '/accelerometer/rocker_accelerometer')
    np.testing.assert_array_equal(y, np.concatenate([m.samples for m in blocks]))
    due = [m.time + k / m.sample_rate for m in blocks for k in range(len(m.samples))]
    np.testing.assert_allclose(t, due, rtol=1e-15)
    assert words == ['samples [m/s²]']
    ((_, again, same),), _ = drawn(bag, 'rocker_accelerometer')
    np.testing.assert_allclose(again, t, rtol=1e-12)
    np.testing.assert_array_equal(same, y)


@pytest.mark.network
def test_quantities_of_a_bag_are_those_of_the_solution(bag, solution):
    """Of the polynomials, on both sides of impacts; one unit, one axes."""
    found, words = drawn(bag, 'velocity.rocker', f'normal_force.{JOINT}', 'reaction', start=0.1)
    assert len(found) == 2 + 8
    assert words == ['angular velocity [rad/s]', 'normal force [N]', *['force [N]'] * 4]
    for name, (_, t, y) in zip(('velocity.rocker', f'normal_force.{JOINT}'), found, strict=False):
        np.testing.assert_array_equal(y, solution.sample(t, name)[name])
        assert t[0] == 0.1
        assert t[-1] == solution.duration
    hits = [i.t for i in solution.impacts if i.t > 0.1]
    assert np.isin(hits, found[0][1]).all()


@pytest.mark.network
def test_numbers_go_to_a_file(bag, tmp_path):
    csv, picture = tmp_path / 'numbers.csv', tmp_path / 'picture.png'
    said = run_json(
        'plot', str(bag), '-o', str(csv), 'impacts.time', 'linkage_state.drive_work', '--output',
        str(picture), '--to', '0.3',
    )  # fmt: skip
    assert said['files'] == [str(csv), str(picture)]
    assert [s['unit'] for s in said['series']] == ['s', 'J']
    table = np.genfromtxt(csv, delimiter=',', names=True, deletechars='', replace_space=' ')
    impacts = [m.time for m in messages_of(bag, '/impacts') if m.time <= 0.3]
    states = [(m.time, m.drive_work) for m in messages_of(bag, '/linkage_state') if m.time <= 0.3]
    got = table['/impacts.time [s]']
    np.testing.assert_array_equal(got[np.isfinite(got)], impacts)
    got = table['/linkage_state.drive_work [J]']
    rows = np.isfinite(got)
    np.testing.assert_array_equal(np.stack([table['t [s]'][rows], got[rows]], axis=1), states)
    assert np.all(np.diff(table['t [s]']) >= 0.0)
    assert picture.read_bytes().startswith(b'\x89PNG')


def test_a_table_beside_the_ideal_machine_has_values_of_both_in_every_row(tmp_path):
    """Without clearance there is no force of contact; the torques are those of either machine."""
    file, names = tmp_path / 'both.csv', ('drive_torque', 'normal_force.coupler_rocker')
    done = run('plot', 'four_bar_clearance', *names, '--ideal', '-o', str(file))
    assert done.returncode == 0, done.stderr
    with file.open() as lines_of_file:
        heading = next(lines_of_file).strip().split(',')
        rows = np.loadtxt(lines_of_file, delimiter=',')
    assert heading[1:3] == ['ideal.drive_torque [N m]', 'drive_torque [N m]']
    assert len(rows) > 1000
    assert np.isfinite(rows).all()
    nominal = ms.cycle(ms.load_scene('four_bar_nominal'))
    expected = nominal.at(rows[::50, 0], ['drive_torque'])['drive_torque']
    np.testing.assert_allclose(rows[::50, 1], expected, rtol=1e-9, atol=1e-12)
    done = run('plot', 'four_bar_clearance', names[1], '--ideal', '-o', str(tmp_path / 'x.csv'))
    assert (done.returncode, done.stderr) == (
        2, f'mechanism-sim: --ideal: without clearance there is no {names[1]}\n'
    )  # fmt: skip


@pytest.mark.network
def test_over_the_angle_of_the_drive(bag, tmp_path):
    """Messages over the angle the crank then has, which turns at a constant speed."""
    asked = Asked(read_bag(bag))
    series = asked.series(['linkage_state.kinetic_energy'])
    figure = lines.draw(chart(series, '', against(asked.record.piece, 'angle')))
    x, y = np.concatenate([line.get_data() for line in figure.axes[0].lines], axis=1)
    states, machine = messages_of(bag, '/linkage_state'), ms.load_scene('four_bar_clearance')
    angle, speed = machine.drive.start
    true = np.degrees(np.array([angle + speed * m.time for m in states])) % 360.0
    energy = np.array([m.kinetic_energy for m in states])
    apart = np.abs((x[:, None] - true + 180.0) % 360.0 - 180.0)
    assert (apart.min(axis=0) < 1e-6).all()
    assert y[apart.argmin(axis=0)] == pytest.approx(energy, rel=0.02)  # two states may be at one
    between = np.isfinite(x) & (apart.min(axis=1) > 1e-6)  # where a turn ends and the next begins
    assert set(np.round(x[between], 9)) <= {0.0, 360.0}
    assert figure.axes[0].get_xlabel() == 'angle of the crank [deg]'
    file = tmp_path / 'angle.svg'
    done = run('plot', str(bag), '--against', 'angle', 'drive_torque', '-o', str(file))
    assert done.stdout.strip() == str(file)


def test_against_another_quantity(solution):
    """Both of the same instants; a path is true to scale, a force over its direction round."""
    speed = solution.plot('velocity.rocker', against='position.rocker').axes[0]
    line, dot = (x.get_data() for x in speed.lines)
    t = np.linspace(0.0, solution.duration, 500)
    told = solution.sample(t)
    for angle, rate in zip(told['position.rocker'], told['velocity.rocker'], strict=True):
        far = np.hypot((line[0] - np.degrees(angle)) / 30.0, (line[1] - rate) / 10.0)
        assert far.min() < 0.02
    assert (dot[0][0], dot[1][0]) == (line[0][0], line[1][0])
    assert (speed.get_xlabel(), speed.get_ylabel()) == (
        'angle of rocker [deg]', 'angular velocity [rad/s]')  # fmt: skip
    names = f'position.{POINT}.y', f'position.{POINT}.x'
    path = solution.plot(names[0], against=names[1]).axes[0]
    assert path.get_aspect() == 1.0
    far = np.hypot(*(1e-3 * np.array(path.lines[0].get_data())))
    told = solution.sample(t, *names)
    assert far.max() == pytest.approx(np.hypot(*told.values()).max(), rel=1e-3)
    force = f'reaction.{JOINT}'
    polar = solution.plot(f'{force}.size', against=f'{force}.direction').axes[0]
    assert polar.name == 'polar'
    angle, size = polar.lines[0].get_data()
    told = solution.sample(t, f'{force}.x', f'{force}.y')
    assert size.max() >= np.hypot(*told.values()).max()
    low = np.min(size * np.sin(angle))
    assert low <= told[f'{force}.y'].min() + 1e-9


@pytest.mark.network
def test_the_command_plots_against_a_quantity_alike_for_a_bag_and_a_scene(bag, tmp_path):
    files = tmp_path / 'bag.svg', tmp_path / 'scene.svg'
    names = 'position.coupler.cog.y', 'drive_torque', '--against', 'position.coupler.cog.x'
    drawn = []
    for source, file in zip((str(bag), 'four_bar_clearance'), files, strict=True):
        done = run('plot', source, *names, '--revolutions', '2', '-o', str(file))
        assert done.returncode == 0, done.stderr
        paths = re.findall(r'<path d="([^"]{2000,})"', file.read_text())
        assert len(paths) == 2
        drawn.append([float(x) for path in paths for x in re.findall(r'[\d.]+', path)])
    assert drawn[0] == pytest.approx(drawn[1], abs=0.01)  # but for the room of their titles
    done = run('plot', str(bag), 'gap', '--against', 'gap', '--ideal')
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)
    assert '--against angle' in done.stderr


@pytest.mark.network
def test_tables_have_quantities_where_sensors_are_sampled_and_what_they_are_against(bag, tmp_path):
    file = tmp_path / 'signal.csv'
    names = 'rocker_accelerometer', 'position.rocker'
    done = run('plot', str(bag), *names, '--against', 'angle', '-o', str(file))
    assert done.returncode == 0, done.stderr
    heads, *rows = csv.reader(file.open(encoding='utf-8'))
    assert heads == [
        't [s]', 'angle [rad]', 'rocker_accelerometer [m/s^2]', 'position.rocker [rad]'
    ]  # fmt: skip
    t, angle, signal, rocker = np.array(rows, float).T
    record = ms.open_run(bag)
    np.testing.assert_array_equal(signal, np.concatenate(record.signal(names[0]).runs))
    told = record.piece.sample(t, names[1], 'position.crank')
    np.testing.assert_array_equal(rocker, told[names[1]])
    np.testing.assert_allclose(angle, told['position.crank'], rtol=1e-12)


@pytest.mark.slow
@pytest.mark.network
def test_charts_of_the_report_are_drawn_by_their_keys(bag, tmp_path):
    names = 'forces', f'gap-{JOINT}-run'
    said = run_json('plot', str(bag), '--charts', *names, '-o', str(tmp_path / 'run.svg'))
    assert said['files'] == [str(tmp_path / f'run_{name}.svg') for name in names]
    done = run('plot', str(bag), '--charts', 'force')
    assert done.returncode == 2
    assert "no chart 'force'; did you mean 'forces'?" in done.stderr


@pytest.mark.network
def test_bags_of_others_count_from_their_start(tmp_path):
    """An inertial unit on the clock of the wall, written by another program."""
    file = tmp_path / 'foreign.mcap'
    start = 1_700_000_000
    vector = 'float64 x\nfloat64 y\nfloat64 z\n'
    text = f'std_msgs/Header header\ngeometry_msgs/Vector3 vector\n{"=" * 80}\n'
    text += f'MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{"=" * 80}\n'
    text += f'MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n{"=" * 80}\n'
    text += f'MSG: geometry_msgs/Vector3\n{vector}'
    with file.open('wb') as stream, Writer(stream) as writer:
        schema = writer.register_msgdef('geometry_msgs/msg/Vector3Stamped', text)
        for k in range(5):
            stamp = {'sec': start + 1, 'nanosec': 100_000_000 * k}
            message = {'header': {'stamp': stamp}, 'vector': {'x': 0.5 * k, 'y': 0.0, 'z': 0.0}}
            writer.write_message('/wind', schema, message, log_time=(start + k) * 10**9)
    ((_, t, y),), words = drawn(file, 'wind.vector.x')
    np.testing.assert_allclose(t, 1.0 + 0.1 * np.arange(5), atol=1e-6)
    np.testing.assert_array_equal(y, 0.5 * np.arange(5))
    assert words == ['x']
    assert {'name': '/wind.vector.x', 'unit': ''} in run_json('plot', str(file))
    done = run('plot', str(file), 'gap')
    assert done.returncode == 2
    assert "has no scene with a quantity 'gap'; it has /wind.vector.x" in done.stderr


def test_a_bag_of_one_instant_is_drawn_without_a_word(tmp_path):
    file = tmp_path / 'others.mcap'
    with file.open('wb') as stream:
        writer = Writer(stream)
        schema = writer.register_msgdef('std_msgs/msg/Float64', 'float64 data')
        writer.write_message('/temperature', schema, {'data': 20.0}, 10**9, 10**9)
        writer.finish()
    done = run('plot', str(file), '/temperature.data', '-o', str(tmp_path / 'one.svg'))
    assert (done.returncode, done.stderr) == (0, '')


def test_units_come_from_the_definitions():
    assert units('mechanism_sim/msg/LinkageState')['gaps'] == ('m',)
    assert units('mechanism_sim/msg/LinkageState')['position'] == ('rad', 'm')
    assert units_of('tf2_msgs/msg/TFMessage', ['transforms', 'transform', 'translation', 'x'])
    assert units_of('sensor_msgs/msg/Imu', ['linear_acceleration', 'y']) == ('m/s^2',)
    counts = {
        'overloads', 'triggered', 'mode', 'previous_mode', 'modes', 'engaged', 'index', 'run',
        'ends_chatter', 'segments', 'degree', 'turns', 'kind', 'law_id', 'final', 'again',
        'finished', 'counts', 'value', 'coefficients', 'torque_laws', 'samples',
        'load_switches',
    }  # fmt: skip
    for name in own_messages():
        kind = f'mechanism_sim/msg/{name}'
        for field, described in field_descriptions(kind):
            text = 'string' in repr(described) or field == 'header'
            assert text or field in counts or units(kind)[field], f'{kind}.{field}'


@pytest.mark.parametrize(
    ('path', 'values'),
    [
        ('t.position', [1.0, 2.0, 3.0]),
        ('t.position[1]', [2.0]),
        ('t.position[-1]', [3.0]),
        ('t.position[:]', [1.0, 2.0, 3.0]),
        ('t.position[0:1]', [1.0, 2.0]),  # both ends, as Foxglove has it
        ('t.position[-2:]', [2.0, 3.0]),
        ('t.position[b]', [2.0]),
        ('t.position[rig/c d]', [3.0]),
        ("t{header.frame_id=='f'}.position[0]", [1.0]),
        ('t{header.frame_id!="f"}.position[0]', []),
        ('t{header.frame_id==f}{header.stamp.sec>=2}.position[0]', [1.0]),
        ('t{header.stamp.sec>2}.position[0]', []),
    ],
)
def test_paths_mean_what_foxglove_means(path, values):
    message = ms.messages.JointState(name=['a', 'b', 'rig/c d'], position=[1.0, 2.0, 3.0])
    message.header.frame_id, message.header.stamp.sec = 'f', 2
    assert [value for value, _ in parse(path).values(message)] == values


@pytest.mark.parametrize('text', ['t.', 't.x[', 't.x[1', 't{a}', 't{a=1}.x', '.x', '', 't.x y'])
def test_what_is_no_path_is_none(text):
    assert parse(text) is None


@pytest.mark.slow
def test_an_overview_of_a_solution(solution):
    figure = solution.plot()
    words = [axes.get_ylabel() for axes in figure.axes]
    assert words == ['angle [deg]', 'gap [mm]', 'normal force [N]', 'drive torque [N·m]', '']
    gap = figure.axes[1].lines[0]
    np.testing.assert_array_equal(
        gap.get_ydata(), 1e3 * solution.sample(gap.get_xdata(), f'gap.{JOINT}')[f'gap.{JOINT}']
    )
    crank = figure.axes[0].lines[0].get_ydata()
    assert 0.0 <= np.nanmin(crank) <= np.nanmax(crank) <= 360.0
    flights = [c.t for c in solution.modes if c.mode is Mode.FREE_FLIGHT]
    bars = [bar for bar in figure.axes[-1].collections if bar.get_facecolor()[0, 0] < 0.2]
    begun = [path.vertices[:, 0].min() for bar in bars for path in bar.get_paths()]
    np.testing.assert_array_equal(begun, flights)
    image = Image.open(io.BytesIO(figure._repr_png_()[0]))  # as a notebook asks for it
    assert image.size[0] > 1000


@pytest.mark.network
def test_colours_say_of_what_lines_are_and_impacts_are_marked(solution):
    """Those of the links in the drawing; components by dashes; small multiples share a scale."""
    machine = ms.load_scene('four_bar_clearance')
    figure = solution.plot('velocity', 'reaction')
    speeds, *reactions = figure.axes
    shades = {x.get_label(): x.get_color() for x in speeds.lines if x.get_label() != 'impact'}
    patches = ms.draw(machine).axes[0].patches
    for k, link in enumerate(('crank', 'coupler', 'rocker')):
        (drawn,) = (x for x in patches if x.get_gid() == f'link-{link}')
        assert same_color(shades[link], LINKS[k])
        assert same_color(drawn.get_edgecolor(), shades[link])
    assert len(reactions) == 4
    for axes in reactions:
        x, y = axes.lines
        assert x.get_color() == y.get_color()
        assert x.get_linestyle() != y.get_linestyle()
        assert axes.get_ylim() == reactions[0].get_ylim()
    (marks,) = (x for x in speeds.lines if x.get_label() == 'impact')
    np.testing.assert_array_equal(marks.get_xdata(), [i.t for i in solution.impacts])


def test_turns_that_overlap_are_a_band_around_all_and_the_last_whole_one():
    solution = ms.simulate(ms.load_scene('four_bar_clearance'), revolutions=6.5)
    axes = solution.plot('velocity.rocker', against='angle').axes[0]
    (band,) = axes.collections
    edge = band.get_paths()[0].vertices
    t = np.linspace(0.0, solution.duration, 50_001)
    speed = 2.0 * np.pi * 6.5 / solution.duration
    angle, values = (
        np.degrees(speed * t) % 360.0,
        solution.sample(t, 'velocity.rocker')['velocity.rocker'],
    )
    for low in np.arange(0.0, 360.0, 20.0):  # a second way: least and greatest of a stretch
        inside = (angle >= low) & (angle <= low + 20.0)
        on = edge[(edge[:, 0] >= low) & (edge[:, 0] <= low + 20.0), 1]
        assert on.min() == pytest.approx(values[inside].min(), abs=0.1)
        assert on.max() == pytest.approx(values[inside].max(), abs=0.1)
    x, y = next(line for line in axes.lines if line.get_label() != 'impact').get_data()
    assert (np.diff(x) >= 0.0).all()
    begun = 5.0 * solution.duration / 6.5
    once = np.diff(x, prepend=-1.0) > 1e-9  # after an impact there is a second value
    once[[0, -1]] = False  # where the turn begins and ends it is between two instants
    true = solution.sample(begun + np.radians(x[once]) / speed, 'velocity.rocker')[
        'velocity.rocker'
    ]
    np.testing.assert_allclose(y[once], true, rtol=1e-6, atol=1e-6)


@pytest.mark.network
def test_angles_begin_anew_with_every_turn(solution):
    """The crank over its own angle is that angle; the rocker stays where it was."""
    axes = solution.plot('position', against='angle').axes[0]
    for shade, low, high in ((LINKS[0], 0.0, 360.0), (LINKS[2], 110.0, 145.0)):
        drawn = [x.get_data() for x in axes.lines if same_color(x.get_color(), shade)]
        assert len(drawn) == 2  # turns
        for x, y in drawn:
            assert low - 1e-6 <= np.nanmin(y) < np.nanmax(y) <= high + 1e-6
            if shade == LINKS[0]:
                np.testing.assert_allclose(y, x, atol=1e-6)


def four_stroke():
    """An engine whose force on the piston comes again after two turns."""
    points = [[f'{x} deg', f'{p} N'] for x, p in ((0, 900), (200, 100), (540, 50), (720, 900))]
    return ms.load_scene('slider_crank', {
        'tables': {'gas': {'points': points, 'periodic': True}},
        'loads': {'gas': {'at': 'piston', 'force': ['-gas(crank)', '0 N']}},
        'drive.start_angle': '90 deg',
    })  # fmt: skip


@pytest.mark.parametrize(
    ('revolutions', 'said'),
    [(1, 'The last full turn of the crank.'), (2, 'The last 2 full turns of the crank.'),
     (5, 'The last 2 full turns of the crank.')],
)  # fmt: skip
def test_pages_show_as_many_turns_as_bring_all_again(revolutions, said):
    """It was the last one alone, without the force of the other stroke."""
    solution = ms.simulate(four_stroke(), revolutions=revolutions)
    charted = ChartedRun(ms.open_run(solution))
    chart = over_drive(charted, 'forces', '', ['reaction.rod_piston.size'])
    assert chart.panels[0].x.high == 360.0 * charted.again
    assert over(charted) == said
    peak = np.nanmax(np.concatenate([c.y for c in chart.panels[0].curves]))
    t = np.linspace(0.0, solution.duration, 4001)
    sizes = solution.sample(t, 'reaction.rod_piston.size')['reaction.rod_piston.size']
    assert peak == pytest.approx(sizes.max(), rel=1e-4)


@pytest.mark.parametrize(('revolutions', 'end'), [(1, 360.0), (2, 720.0), (5, 720.0)])
def test_what_comes_again_after_two_turns_is_drawn_over_both(revolutions, end):
    """As one line; of one turn alone there is no more than that."""
    engine = four_stroke()
    solution = ms.simulate(engine, revolutions=revolutions)
    axes = solution.plot('drive_torque', against='angle').axes[0]
    assert axes.get_xlim() == (0.0, end)
    shown = [line for line in axes.lines if len(line.get_xdata()) > 1]
    x, y = max(shown, key=lambda line: np.ptp(line.get_xdata())).get_data()
    for angle in np.radians([100.0, 200.0, 300.0] + [400.0, 700.0] * (revolutions > 1)):
        begun = (angle - np.pi / 2) % np.radians(end) / engine.drive.start[1]
        wanted = solution.sample(begun, 'drive_torque')['drive_torque'][0]
        known = np.isfinite(x)
        order = np.argsort(x[known])
        found = np.interp(np.degrees(angle), x[known][order], y[known][order])
        assert found == pytest.approx(wanted, abs=1e-3 * np.ptp(y[known]))


def test_a_power_of_ten_beside_an_axis_is_not_under_its_legend():
    t = np.linspace(0.0, 1.0, 9)
    curve = ChartCurve(t, 1e-7 * t, 'small')
    (axes,) = lines.draw(Chart('x', '', (Panel(Axis('t'), Axis('y'), (curve,)),))).axes
    axes.figure.savefig(io.BytesIO(), format='png')
    ten, legend = axes.yaxis.get_offset_text(), axes.get_legend()
    assert ten.get_text()
    assert not ten.get_window_extent().overlaps(legend.get_window_extent())


def test_the_axis_of_orders_has_words_of_its_drive():
    line = SignalSpectrum(LineSpectrum(np.arange(5.0), np.arange(5.0)), 'm/s^2')
    (panel,) = orders('acc', line, 'crank').panels
    assert panel.x.title == 'order of the crank [cycles per turn]'


def test_cycles_are_plotted_over_the_angle():
    found = ms.cycle(ms.load_scene('four_bar_nominal'), points=['coupler.cog'])
    figure = found.plot('drive_torque', 'position.coupler.cog')
    assert [axes.get_ylabel() for axes in figure.axes] == ['drive torque [N·m]', 'position [mm]']
    x, y = figure.axes[0].lines[0].get_data()
    at = (found.t[0] + np.radians(x - x[0]) / (2.0 * np.pi) * found.duration).clip(
        *found.t[[0, -1]]
    )
    inside = slice(1, -2)
    np.testing.assert_allclose(y[inside], found.at(at[inside])['drive_torque'], rtol=1e-6)
    assert found.plot().axes[-1].get_xlabel() == 'angle of the crank [deg]'
    assert found.plot('energy', against='time').axes[0].get_xlabel() == 'time [s]'


@pytest.mark.parametrize(
    ('scene', 'panels'),
    [('loader', 3), ('valve_train', 5), ('planetary', 3), ('four_bar_on_frame', 4), ('geneva', 3)],
)
def test_every_kind_of_machine_has_an_overview(scene, panels):
    machine = ms.load_scene(scene)
    figure = ms.simulate(machine, duration=0.05).plot()
    assert len(figure.axes) >= panels
    assert all(axes.get_ylabel().endswith(']') for axes in figure.axes if axes.lines)


@pytest.mark.network
def test_all_that_can_be_plotted_is_listed_with_units(bag):
    listed = {x['name']: x['unit'] for x in run_json('plot', str(bag))}
    assert listed[f'gap.{JOINT}'] == 'm'
    assert listed['rocker_accelerometer'] == 'm/s^2'
    assert listed['/impacts.normal_impulse'] == 'N s'
    assert listed['/linkage_state.velocity'] == 'rad/s or m/s'
    assert '/progress.run' in listed
    done = run('plot', 'four_bar_nominal')
    assert ['drive_torque', 'N', 'm'] in [line.split() for line in done.stdout.splitlines()]


@pytest.mark.network
@pytest.mark.parametrize(
    ('what', 'words'),
    [
        (['gapp'], "there is no 'gapp'; did you mean 'gap'?"),
        (['impact.normal_impulse'], "did you mean '/impacts.normal_impulse'?"),
        (['impacts.normal_impuls'], "did you mean 'normal_impulse'?"),
        (['linkage_state.gaps[coupler]'], "did you mean 'coupler_rocker'?"),
        (['linkage_state.gaps[1]'], 'the array has 1 items'),
        (['impacts{joint=="x"}.time'], 'no value with joint=="x" on /impacts'),
        (['scene.data'], 'is text, not a number'),
        (['impacts.header'], 'is a message: choose one of stamp, frame_id'),
        (['impacts.time.x'], "a number has no field 'x'"),
        (['impacts.time[0]'], 'is not an array'),
        (['gap', '--from', '5'], 'is not within the run'),
        (['impacts.time', '--from', '5'], 'there are no values of impacts.time between'),
        (['gap', '--set', 'drive.speed=1 rpm'], 'as it was recorded'),
        (['other.mcap', 'gap'], 'other.mcap does not exist'),
        (['other.mcap'], 'is to be plotted'),
        (['other.csv', 'gap', '--ideal'], '--ideal does not apply to several runs in one plot'),
        (['gap', '-o', 'x.bmp'], 'the ending must be .png, .svg or .pdf'),
    ],
)
def test_bad_input_is_one_sentence(bag, what, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run('plot', str(bag), *what)
    assert done.returncode == 2
    assert words in done.stderr
    assert done.stderr.count('\n') == 1
    assert not list(tmp_path.iterdir())


def test_from_python_bad_names_are_bad_input(solution):
    with pytest.raises(InputError, match=r"did you mean 'velocity\.crank'"):
        solution.plot('velocity.crnk')
    with pytest.raises(InputError, match='not within the run'):
        solution.plot(start=2.0)
    with pytest.raises(InputError, match='there is no quantity'):
        solution.plot(against='crnk')
    with pytest.raises(InputError, match='expected the name of a quantity, got 3'):
        solution.plot(3)


def test_names_may_be_in_lists(solution):
    listed, one_by_one = (
        ms.plot(solution, ['gap', 'drive_torque']),
        solution.plot('gap', 'drive_torque'),
    )
    pairs = zip(listed.axes, one_by_one.axes, strict=True)
    assert all(np.array_equal(a.lines[0].get_ydata(), b.lines[0].get_ydata()) for a, b in pairs)


@pytest.mark.network
def test_messages_are_plotted_over_messages_of_the_own_bag(bag):
    """Places that the same message has, and those of others straight between two."""
    asked = Asked(read_bag(bag))
    over = asked.recorded('/linkage_state.position[rocker]')
    series = asked.series(['/linkage_state.velocity[crank]', '/impacts.normal_impulse'])
    axes = lines.draw(chart(series, '', against_recorded(over, series))).axes
    states, impacts = (messages_of(bag, x) for x in ('/linkage_state', '/impacts'))
    angle = np.degrees([m.position[2] for m in states])
    x, y = axes[0].lines[0].get_data()
    np.testing.assert_allclose(x, angle, rtol=1e-12)
    np.testing.assert_allclose(y, [m.velocity[0] for m in states], rtol=1e-12)
    between = np.interp([m.time for m in impacts], [m.time for m in states], angle)
    np.testing.assert_allclose(axes[1].lines[0].get_xdata(), between, rtol=1e-9)


@pytest.mark.parametrize(('what', 'name', 'aspect'), [
    ('reaction.rocker_ground.x', 'reaction.rocker_ground.y', 1.0),
    ('reaction.crank_coupler.crank.across', 'reaction.crank_coupler.crank.along', 1.0),
    ('position.coupler.cog.x', 'position.coupler.cog.y', 1.0),
    ('reaction.rocker_ground.x', 'reaction.rocker_ground.x', 'auto'),
    ('position.coupler.cog.x', 'velocity.coupler.cog.y', 'auto'),
])  # fmt: skip
def test_components_of_a_vector_against_each_other_are_true_to_scale(solution, what, name, aspect):
    (axes,) = solution.plot(name, against=what).axes
    assert axes.get_aspect() == aspect


@pytest.mark.parametrize(('factor', 'said'), [(1.0, {'40', '100', '400'}), (1e-8, set())])
def test_powers_of_ten_stand_at_a_logarithmic_axis_only_far_from_one(factor, said):
    x = factor * np.array([38.0, 150.0, 420.0])
    panel = Panel(Axis('flywheel', 'kg', log=True), Axis('y'), (ChartCurve(x, x),))
    figure = paint(Chart('', '', (panel,)))
    figure.canvas.draw()
    (axes,) = figure.axes
    ticks = [*axes.get_xticklabels(), *axes.get_xticklabels(minor=True)]
    texts = {t.get_text() for t in ticks} - {''}
    assert said <= texts
    assert all(('10^' in text) != bool(said) for text in texts)


def test_parts_of_runs_have_times_with_units_and_no_length(solution):
    """A length was not taken into account without a word."""
    (axes,) = ms.plot(solution, 'position.rocker', start='10 ms', end='50 ms').axes
    (line, *_) = axes.lines
    assert (line.get_xdata()[0], line.get_xdata()[-1]) == pytest.approx((0.01, 0.05))
    for name, length in (('revolutions', 2), ('duration', '1 s')):
        with pytest.raises(InputError, match=f'plot: {name} does not apply to a run'):
            ms.plot(solution, 'position.rocker', **{name: length})
    with pytest.raises(InputError, match="end = '5 mm' has the unit 'mm'"):
        ms.plot(ms.cycle('slider_crank'), 'position.piston', end='5 mm')


def test_files_of_signals_have_their_scale_and_rate_in_python(tmp_path):
    """As the command has --full-scale and --sample-rate, which its sentences name."""
    scipy.io.wavfile.write(tmp_path / 'a.wav', 8000, np.array([0, 16384, -32768], np.int16))
    wave = ms.plot(tmp_path / 'a.wav', full_scale='50 m/s^2').axes[0].lines[0]
    assert wave.get_ydata() == pytest.approx([0.0, 25.0, -50.0])
    np.savez(tmp_path / 'b.npz', acc=[1.0, 2.0, 4.0], fs=2000.0)
    for rate in ('2 kHz', 2000, np.float64(2000.0)):
        line = ms.plot(tmp_path / 'b.npz', sample_rate=rate).axes[0].lines[0]
        assert line.get_xdata() == pytest.approx([0.0, 0.0005, 0.001])
    with pytest.raises(InputError, match=r'give --sample-rate, .* single numbers are fs = 2000'):
        ms.plot(tmp_path / 'b.npz')
    with pytest.raises(InputError, match='plot: full_scale does not apply to a scene or a run'):
        ms.plot('slider_crank', full_scale='50 m/s^2')
    with pytest.raises(InputError, match='plot: duration does not apply to a file of signals'):
        ms.plot(tmp_path / 'b.npz', duration=1.0)


def test_durations_in_columns_of_tables_are_times(tmp_path):
    """They were left out without a word."""
    frame = pandas.DataFrame({'time': pandas.to_timedelta([0, 1, 2], unit='ms'), 'a': [1.0, 2, 4]})
    frame.to_parquet(tmp_path / 'a.parquet')
    line = ms.plot(tmp_path / 'a.parquet').axes[0].lines[0]
    assert line.get_xdata() == pytest.approx([0.0, 0.001, 0.002])


def test_a_bag_of_others_that_was_opened_is_plotted_and_needs_no_machine(tmp_path):
    path = tmp_path / 'a.mcap'
    with BagWriter(path) as bag:
        bag.add_topic('/joint_states', 'sensor_msgs/msg/JointState', Qos())
        for k in range(5):
            bag.write('/joint_states', serialize(JointState(name=['a'], position=[2.0 * k])), k)
    run = ms.open_run(path)
    assert ms.open_run(run) is run
    both = [ms.plot(x, 'position.a').axes[0].lines[0] for x in (run, path)]
    assert both[0].get_ydata().tolist() == both[1].get_ydata().tolist() == [0, 2, 4, 6, 8]
    for call in (ms.play, ms.report, lambda x: ms.measure(x, 'mean(position.a)')):
        with pytest.raises(InputError, match=r'a.mcap: .* needs the machine, and this bag has'):
            call(run)
