"""One way to ask a bag, another program's bag, a solution and a cycle."""

from __future__ import annotations

import copy
import itertools
import pickle
import struct
from dataclasses import replace

import numpy as np
import pytest
from bags import write_bag
from builders import simulated
from mcap.writer import Writer as JsonWriter
from mcap_ros2.writer import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore
from running import run as command
from running import run_json

import mechanism_sim as ms
from mechanism_sim.analysis.collectors import field_ranges
from mechanism_sim.analysis.measurements import measurements
from mechanism_sim.analysis.series import Series
from mechanism_sim.errors import InputError
from mechanism_sim.messages import JointState, serialize
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter
from mechanism_sim.report.charts.lines import chart
from ros_interfaces.stamps import stamp

NAMES = 'reaction.coupler_rocker.size', 'position.coupler.cog.x'


def foreign(path, velocities, unknown=()):
    """A bag of a pendulum's angle as any program may write it, its rate unknown at times."""
    with BagWriter(path) as bag:
        bag.add_topic('/joint_states', 'sensor_msgs/msg/JointState', Qos())
        for t in np.linspace(0.0, 2.0, 81):
            message = JointState(name=['rod', 'slide'], position=[np.sin(3.0 * t), t])
            if velocities:
                rate = np.nan if t in unknown else 3.0 * np.cos(3.0 * t)
                message.velocity = [rate, 1.0]
            message.header.stamp = stamp(t)
            bag.write('/joint_states', serialize(message), int(t * 1e9))
    return path


def test_a_long_bag_is_opened_without_reading_it_and_its_names_in_one_pass(tmp_path, monkeypatch):
    bag, handed = read_bag(foreign(tmp_path / 'states.mcap', velocities=True)), []
    messages = bag.messages

    def counted(topics=None):
        for found in messages(topics):
            handed.append(found)
            yield found

    monkeypatch.setattr(bag, 'messages', counted)
    run = ms.open_run(bag)
    assert len(handed) <= 1
    assert run.names()[:4] == ['position.rod', 'position.slide', 'velocity.rod', 'velocity.slide']
    assert len(handed) <= 81 + 2


def test_all_sources_give_the_same_numbers(tmp_path):
    record = simulated('four_bar_clearance', duration=0.05)
    bag = write_bag(tmp_path / 'run.mcap', record)
    t = np.linspace(0.0, 0.05, 20)
    given = record.piece.sample(t, *NAMES)
    for source in (bag, str(bag), record.piece):
        found = ms.open_run(source).columns(NAMES, t)
        assert found.units['reaction.coupler_rocker.size'] == 'N'
        for name in NAMES:
            assert np.array_equal(found[name], given[name])
    cycle = ms.cycle(ms.load_scene('four_bar_nominal'), samples=8)
    found = ms.open_run(cycle).columns(['drive_torque'], cycle.t)
    assert np.array_equal(found['drive_torque'], cycle['drive_torque'])


@pytest.mark.parametrize(
    ('source', 'words'),
    [
        (ms.load_scene('slider_crank'), 'slider_crank is a machine that has not run yet'),
        ({}, '{} is not a run: expected a solution'),
        (None, 'null is not a run'),
        (3.5, '3.5 is not a run'),
    ],
)
def test_what_is_no_run_is_refused(source, words):
    with pytest.raises(InputError, match=words):
        ms.open_run(source)


def test_one_name_needs_no_list(tmp_path):
    record, t = ms.open_run(ms.simulate('slider_crank', duration=0.1)), np.array([0.05])
    for run, name in (
        (record, 'position.piston'),
        (ms.open_run(foreign(tmp_path / 'other.mcap', True)), 'position.rod'),
    ):
        assert run.columns(name, t) == run.columns([name], t)
    cycle = ms.cycle('slider_crank', samples=4, points='rod.end')
    assert [*cycle.at(t, 'position.rod.end.x')] == ['position.rod.end.x']
    machine = ms.load_scene('slider_crank', 'drive.speed=60 rpm')
    assert [*ms.simulate(machine, duration=0.1, derivatives='drive.speed').derivatives] == [
        'drive.speed'
    ]
    sweep = {'revolutions': 1, 'grid': {'drive.speed': ['60 rpm']}}
    measure = 'top = highest(velocity.piston)'
    assert 'top' in ms.sweep(sweep, scene=machine, measures=measure)
    assert ms.report(record.piece, tmp_path / 'run.html', measures=measure).is_file()
    found = ms.ensemble(machine, {'drive.speed': [6.0]}, revolutions=1, columns='impacts')
    assert 'impacts' in found


@pytest.mark.parametrize('again', [lambda x: pickle.loads(pickle.dumps(x)), copy.deepcopy])
def test_machines_and_runs_come_back_from_a_pickle(tmp_path, again):
    """As `multiprocessing`, joblib and Dask hand them on; what was compiled is made again."""
    solution = ms.simulate('gear_pair', revolutions=1, derivatives=['drive.speed'])
    machine, record = solution.machine, ms.open_run(solution)
    bag = write_bag(tmp_path / 'run.mcap', record)
    assert 'plan' in vars(machine)
    assert vars(again(machine)).keys() == {'name', 'scene', 'questions'}
    assert ms.simulate(again(machine), revolutions=1).digest() == solution.digest()
    for run in (solution, record, ms.open_run(bag), record.between(0.0, 0.5 * record.end)):
        found = again(run)
        assert found.digest() == run.digest()
    assert again(ms.open_run(bag)).audited.energy == ms.open_run(bag).audited.energy
    t, found = np.array([0.1]), again(solution)
    slopes = [run.derivatives['drive.speed'].sample(t, 'position') for run in (solution, found)]
    assert slopes[0].keys() == slopes[1].keys()
    assert all(np.array_equal(slopes[0][name], slopes[1][name]) for name in slopes[0])
    cycle = ms.cycle('slider_crank', samples=8)
    table = again(cycle).table()
    assert table.units == cycle.units()
    assert all(np.array_equal(table[name], x, equal_nan=True) for name, x in cycle.table().items())
    messages = ms.open_run(foreign(tmp_path / 'other.mcap', velocities=True))
    columns = [run.columns(['position.rod'], t) for run in (messages, again(messages))]
    assert columns[0]['position.rod'] == columns[1]['position.rod']


def test_an_angle_of_the_drive_may_be_asked_for():
    run = ms.open_run(ms.simulate(ms.load_scene('four_bar_nominal'), revolutions=2))
    turns = np.array([0.5, 1.25])
    found = run.columns(['position.crank'], turns=turns)
    assert found['position.crank'] == pytest.approx(2.0 * np.pi * turns, rel=1e-12)
    with pytest.raises(InputError, match='either times or turns'):
        run.columns(['position.crank'])
    for beyond in ([-0.1], [0.5, 2.1], [float('nan')]):
        with pytest.raises(InputError, match='turns must be from 0 to 2, as the run has them'):
            run.columns(['position.crank'], turns=beyond)


@pytest.mark.parametrize(('velocities', 'error'), [(True, 8.3e-8), (False, 7.1e-4)])
def test_joint_states_of_another_program_are_a_run(tmp_path, velocities, error):
    """Between instants by Hermite's polynomials where there are velocities, else straight.

    Their errors are at most h^4 max|x''''| / 384 and h^2 max|x''| / 8.
    """
    run = ms.open_run(foreign(tmp_path / 'other.mcap', velocities))
    t = np.linspace(0.1, 1.9, 301)
    found = run.columns(['position.rod', 'position.slide'], t)
    off = np.abs(found['position.rod'] - np.sin(3.0 * t)).max()
    assert error / 10.0 < off < error
    assert found['position.slide'] == pytest.approx(t, abs=1e-12)
    assert ('velocity.rod' in run.series) == velocities
    with pytest.raises(InputError, match="did you mean 'position\\.rod'"):
        run.columns(['position.rods'], t)
    with pytest.raises(InputError, match='is recorded from 0 s to 2 s'):
        run.columns(['position.rod'], np.array([3.0]))


JOINTS = 'crank', 'left/arm', 'rig/mass joint', 'a-b', 'a[1]', 'b]c', '3', '0:1'


HEADER = (
    f'{"=" * 80}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n'
    f'{"=" * 80}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n'
)
ARRAYS = ''.join(f'float64[] {x}\n' for x in ('position', 'velocity', 'effort'))
STATES = f'std_msgs/Header header\nstring[] name\n{ARRAYS}{HEADER}'


@pytest.fixture
def rig(tmp_path):
    """A bag of another author's writer: joints of any names, joint j at j t^2, and a scalar."""
    file = tmp_path / 'rig.mcap'
    with file.open('wb') as stream, Writer(stream) as writer:
        state = writer.register_msgdef('sensor_msgs/msg/JointState', STATES)
        number = writer.register_msgdef('std_msgs/msg/Float64', 'float64 data\n')
        for k in range(256):
            at = {'sec': k // 100, 'nanosec': k % 100 * 10_000_000}
            message = {
                'header': {'stamp': at, 'frame_id': ''}, 'name': [*JOINTS], 'velocity': [],
                'position': [j * (0.01 * k) ** 2 for j in range(len(JOINTS))], 'effort': [],
            }  # fmt: skip
            writer.write_message('/joint_states', state, message, log_time=k * 10**7)
            tone = {'data': 3.0 * np.sin(2.0 * np.pi * 12.5 * 0.01 * k)}
            writer.write_message('/tone', number, tone, log_time=k * 10**7)
    return file


@pytest.mark.parametrize('form', ['/joint_states.position[{}]', 'position.{}'])
def test_every_name_that_is_told_can_be_asked_for(rig, form):
    run, names = ms.open_run(rig), [form.format(joint) for joint in JOINTS]
    analyzed = [f['quantity'] for f in run_json('analyze', str(rig))['fields']]
    assert {*names} <= {*analyzed, *run.names()}
    found = run.columns(names, [0.1, '200 ms'])
    for j, name in enumerate(names):
        assert found[name] == pytest.approx([j * 0.01, j * 0.04])
    done = command('plot', str(rig), names[2], '-o', str(rig.with_suffix('.csv')))
    assert done.returncode == 0, done.stderr
    t, x = np.loadtxt(rig.with_suffix('.csv'), delimiter=',', skiprows=1).T
    assert x == pytest.approx(2.0 * t**2)


def test_names_of_keys_that_are_told_can_be_asked_for(tmp_path):
    file = tmp_path / 'keys.mcap'
    with file.open('wb') as stream:
        writer = JsonWriter(stream)
        writer.start()
        channel = writer.register_channel('/log', 'json', 0)
        for k in range(3):
            writer.add_message(
                channel, k * 10**9, f'{{"oil temp/C": {k * k}}}'.encode(), k * 10**9
            )
        writer.finish()
    (field,) = run_json('analyze', str(file))['fields']
    assert ms.open_run(file).one(field['quantity']).values.tolist() == [0, 1, 4]


@pytest.mark.parametrize('lacks', [{'repeat_channels': False}, {'repeat_schemas': False}])
def test_a_summary_need_not_repeat_channels_and_constants_are_no_numbers(tmp_path, lacks):
    file, kind = tmp_path / 'other.mcap', b'uint8 LARGE=1\nuint8 kind\nfloat64 size\n'
    with file.open('wb') as stream:
        writer = JsonWriter(stream, **lacks)
        writer.start(profile='ros2', library='other')
        schema = writer.register_schema('my_pkg/msg/Item', 'ros2msg', kind)
        channel = writer.register_channel('/item', 'cdr', schema)
        for k in range(3):
            data = struct.pack('<4sB7xd', b'\0\1\0\0', 1, 0.5 * k)
            writer.add_message(channel, k * 10**9, data, k * 10**9)
        writer.finish()
    fields = run_json('analyze', str(file))['fields']
    assert [f['quantity'] for f in fields] == ['/item.kind', '/item.size']
    assert ms.open_run(file).one('/item.size').values.tolist() == [0.0, 0.5, 1.0]


def test_joint_states_are_fitted_by_the_names_that_are_told(rig):
    (found,) = measurements(
        [rig], ['four_bar_nominal'], sensor='position.crank',
        channel='/joint_states.position[rig/mass joint]',
    )  # fmt: skip
    assert found.samples == pytest.approx(2.0 * (0.01 * np.arange(256)) ** 2)


def test_joint_states_and_messages_are_plotted_by_the_names_of_the_run(rig):
    names = 'position.rig/mass joint', '/joint_states.position[a-b]'
    figure = ms.plot(rig, *names, against='/joint_states.position[left/arm]', end=1.0)
    lines = {x.get_label(): x.get_data() for x in figure.axes[0].lines}
    x, y = lines['rig/mass joint']
    assert y == pytest.approx(2.0 * x)
    assert lines['a-b'][1] == pytest.approx(3.0 * x)
    assert (figure.axes[0].get_xlabel(), x[-1]) == ('position of left/arm [rad or m]', 1.0)
    assert len(ms.plot(rig, 'position').axes) == len(JOINTS)
    (tone,) = ms.plot(str(rig), ['/tone.data']).axes[0].lines
    assert np.abs(tone.get_ydata()).max() == pytest.approx(3.0)
    with pytest.raises(InputError, match=r"a quantity 'position\.crnk'; did you mean"):
        ms.plot(rig, 'position.crnk')


def test_several_runs_are_lines_of_one_plot(rig, tmp_path):
    """Each has its file's name and its own instants, in the picture and in the table."""
    other, table = foreign(tmp_path / 'other.mcap', False), tmp_path / 'both.csv'
    tones = tmp_path / 'tones.csv'
    tones.write_text('t [s],position.rod [rad]\n0,1\n0.5,2\n')
    files, picture = [str(other), str(tones)], tmp_path / 'both.svg'
    said = run_json('plot', *files, 'position.rod', '-o', str(table), '-o', str(picture))
    assert [s['samples'] for s in said['series']] == [81, 2]
    heading, *rows = table.read_text().splitlines()
    assert heading.split(',')[1:] == [
        f'{other}: position.rod [rad or m]', f'{tones}: position.rod [rad]',
    ]  # fmt: skip
    found = np.genfromtxt(rows, delimiter=',')
    known = np.isfinite(found[:, 1])
    assert found[known, 1] == pytest.approx(np.sin(3.0 * found[known, 0]), abs=1e-12)
    assert found[np.isfinite(found[:, 2]), ::2].tolist() == [[0.0, 1.0], [0.5, 2.0]]
    series = [replace(ms.open_run(x).one('position.crank'), run=x.name) for x in (rig, rig)]
    series[1] = replace(series[1], run='again')
    (panel,) = chart(series, '').panels
    assert [c.label for c in panel.curves] == ['crank, rig.mcap', 'crank, again']
    assert panel.curves[0].shade != panel.curves[1].shade
    done = command('plot', 'four_bar_nominal', str(rig), 'position')
    assert (done.returncode, "'four_bar_nominal' is not recorded" in done.stderr) == (2, True)


def test_a_number_in_messages_has_a_spectrum(rig):
    """The line of a tone, and its mean square."""
    found = run_json('analyze', str(rig), '--spectrum', '/tone.data')
    spectrum = found['details']['spectra']['/tone.data']['spectrum']
    frequency, values = np.array(spectrum['frequency']), np.array(spectrum['values'])
    assert frequency[values.argmax()] == pytest.approx(12.5)
    assert values.sum() * frequency[1] == pytest.approx(4.5, rel=1e-2)
    done = command('analyze', str(rig), '--spectrum', '/tone.dat')
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)
    done = command('analyze', str(rig), '--spectrum', '/tone.data', '--skip', '1')
    assert (done.returncode, '--skip needs a run' in done.stderr) == (2, True)


def test_runs_say_what_they_are(rig):
    stream = ms.stream('four_bar_clearance', duration=0.05)
    assert repr(stream) == '<Stream of four_bar_clearance: 0 s of 0.05 s, 0 impacts>'
    stream.finish()
    assert repr(stream).startswith('<Stream of four_bar_clearance: 0.05 s of 0.05 s, ')
    assert repr(stream.totals).startswith(f'<Totals: {stream.totals.impacts} impacts of ')
    told = '<MessageRun of {}: messages: 256 of /joint_states, 256 of /tone>'
    assert repr(ms.open_run(rig)) == told.format(rig)
    solution = ms.simulate('four_bar_clearance', duration=0.05)
    assert repr(ms.open_run(solution)) == f'<Record of four_bar_clearance: {solution!r}>'


def test_a_bag_with_topics_and_no_message_is_refused(tmp_path):
    """Of another author, who writes the greatest time as the start of such a bag."""
    types = get_typestore(Stores.ROS2_HUMBLE)
    with RosbagsWriter(tmp_path / 'zero', version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        bag.add_connection('/joint_states', JointState.__msgtype__, typestore=types)
    (tmp_path / 'nothing.mcap').touch()
    for path in (tmp_path / 'zero', tmp_path / 'nothing.mcap'):
        for what in (['analyze'], ['plot', 'gap'], ['report', '-o', str(tmp_path / 'x.html')]):
            done = command(what[0], str(path), *what[1:])
            assert (done.returncode, done.stdout) == (2, '')
            assert 'holds no message' in done.stderr
    assert run_json('bag', 'info', str(tmp_path / 'zero'))['start'] == 0.0


def test_values_that_are_no_numbers_leave_others_alone(tmp_path):
    """Positions go straight beside an unknown rate; what is beside an unknown value is unknown."""
    run = ms.open_run(foreign(tmp_path / 'other.mcap', True, unknown=(0.5, 1.0)))
    t = np.array([0.475, 0.49, 0.5, 0.51, 0.74])
    off = np.abs(run.columns('position.rod', t)['position.rod'] - np.sin(3.0 * t))
    assert off[[0, 2]] == pytest.approx(0.0, abs=1e-12)
    assert off[4] < 8.3e-8
    assert off[[1, 3]].min() > 1e-5
    assert np.isnan(run.columns('velocity.rod', t)['velocity.rod']).tolist() == [0, 1, 1, 1, 0]


@pytest.fixture
def shared(tmp_path):
    """A bag of 1970 on: two drivers on one topic, one without stamps; stamps begin anew at 2 s."""
    begin, file = 1_700_000_000 * 10**9, tmp_path / 'shared.mcap'
    with file.open('wb') as stream, Writer(stream) as writer:
        state = writer.register_msgdef('sensor_msgs/msg/JointState', STATES)
        number = writer.register_msgdef('std_msgs/msg/Float64', 'float64 data\n')
        for k in range(8):
            at, effort = {'sec': 100 + k % 4, 'nanosec': 0}, [2.0 * k] if k % 2 else []
            for topic, name in (('/arm', 'wrist'), ('/arm', 'grip'), ('/other', 'x')):
                message = {
                    'header': {'stamp': at, 'frame_id': ''}, 'name': [name],
                    'position': [k], 'velocity': [], 'effort': effort,
                }  # fmt: skip
                writer.write_message(topic, state, message, log_time=begin + k * 10**9)
            writer.write_message('/load', number, {'data': k}, log_time=begin + k * 10**9)
    return file


def test_what_some_messages_have_not_is_read_from_the_others(shared):
    run = ms.open_run(shared)
    assert run.one('/arm.position[grip]').values.tolist() == [*range(8)]
    assert run.one('/arm.effort[wrist]').values.tolist() == [2.0, 6.0, 10.0, 14.0]
    for path in ('/arm.position[gripp]', '/arm.effort[3]'):
        with pytest.raises(InputError, match=r"there is no 'gripp'|the array has 1 items"):
            run.one(path)


def test_runs_one_after_another_are_rows_one_after_another(shared, tmp_path):
    table = tmp_path / 'both.csv'
    done = command('plot', str(shared), '/arm.position[grip]', '-o', str(table))
    assert done.stderr.endswith('times of /arm go back, first from 103 s to 100 s\n')
    t, x = np.loadtxt(table, delimiter=',', skiprows=1).T
    assert (t.tolist(), x.tolist()) == ([100, 101, 102, 103] * 2, [*range(8)])


@pytest.mark.parametrize('others', [['/other.position[x]'], ['/load.data']])
def test_times_of_several_clocks_are_told(shared, others, tmp_path):
    names = ['/arm.position[wrist]', *others]
    done = command('plot', str(shared), *names, '-o', str(tmp_path / 'both.csv'))
    assert ('they may not fit together' in done.stderr) is (others == ['/load.data'])


@pytest.mark.parametrize('unit', ['V', 'rad or m'])
def test_a_table_over_a_quantity_has_units_that_are_not_known(tmp_path, unit):
    """Volts of a file, and positions of joints of which nobody says whether they turn or slide."""
    table = tmp_path / 'over.csv'
    if unit == 'V':
        file = tmp_path / 'rig.csv'
        file.write_text('t [s],y [V],x [mm]\n0,1,2\n1,3,4\n2,5,6\n', encoding='utf-8')
        what = str(file), 'x', '--against', 'y'
    else:
        bag = foreign(tmp_path / 'other.mcap', True)
        what = str(bag), 'velocity.rod', '--against', 'position.rod'
    done = command('plot', *what, '-o', str(table))
    assert done.returncode == 0, done.stderr
    assert table.read_text(encoding='utf-8').split(',')[1] == f'{what[3]} [{unit}]'


def test_samples_without_a_value_are_counted(tmp_path):
    found = field_ranges(read_bag(foreign(tmp_path / 'other.mcap', True, unknown=(0.5, 1.0))))
    known = {f.quantity: (f.samples, f.unknown) for f in found}
    assert known['/joint_states.velocity[rod]'] == (81, 2)
    assert known['/joint_states.position[rod]'] == (81, 0)


def test_times_of_a_clock_are_exact_to_the_nanosecond(tmp_path):
    """A float of seconds since 1970 has steps of 0.2 us; all count from the start of the bag."""
    begin = 1_700_000_000_123_456_789
    path = tmp_path / 'clock.mcap'
    with BagWriter(path) as bag:
        bag.add_topic('/joint_states', 'sensor_msgs/msg/JointState', Qos())
        for k in range(5):
            t = begin + 10_000_000 * k
            message = JointState(name=['rod'], position=[0.1 * k])
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(t, 10**9)
            bag.write('/joint_states', serialize(message), t)
    run = ms.open_run(path)
    assert run.series['position.rod'].t.tolist() == [0.0, 0.01, 0.02, 0.03, 0.04]
    done = command('analyze', str(path))
    assert 'time   0 s to 0.04 s (from 2023-11-14 22:13:20 UTC on)' in done.stdout


@pytest.mark.parametrize(
    ('names', 'stamps', 'said', 'shown'),
    [
        (['a', 'a'], 1, "'name' of sensor_msgs/msg/JointState repeats names of 'position'", ''),
        (['a', 'b', 'c'], 1, 'has 3 for 2 items', ''),
        (['a', 'b'], 0, 'all 4 messages of /arm have no stamp', ''),
        (['a', 'b'], 2, '', 'these times are stamps: they differ from when'),
        (['a', 'b'], 1, '', ''),
    ],
)
def test_names_and_stamps_that_are_not_what_they_seem_are_told(
    tmp_path, names, stamps, said, shown
):
    """Two positions of other numbers of names, or of one twice; no stamps, or of another pace."""
    begin, path = 1_700_000_000 * 10**9, tmp_path / 'other.mcap'
    with path.open('wb') as stream, Writer(stream) as writer:
        kind = writer.register_msgdef('sensor_msgs/msg/JointState', STATES)
        for k in range(4):
            sec, nanosec = divmod(begin + stamps * k * 10**7 if stamps else 0, 10**9)
            message = {
                'header': {'stamp': {'sec': sec, 'nanosec': nanosec}, 'frame_id': ''},
                'name': names, 'position': [0.1 * k, -0.1 * k], 'velocity': [], 'effort': [],
            }  # fmt: skip
            writer.write_message('/arm', kind, message, log_time=begin + k * 10**7)
    done = command('analyze', str(path))
    assert (said in done.stderr) if said else not done.stderr
    assert ('these times are stamps' in done.stdout) is bool(shown)
    fields = {'a', 'b'} if names == ['a', 'b'] else {'0', '1'}
    assert all(f'/arm.position[{field}]' in done.stdout for field in fields)


@pytest.mark.parametrize('wrong', [4.0e8, 0.24])
def test_a_stamp_that_is_wrong_costs_no_more_than_its_message(wrong, tmp_path):
    """Positions are 0 to 49 rad, a hundred a second; all behind the wrong one was left out."""
    path = tmp_path / 'states.mcap'
    with BagWriter(path) as writer:
        writer.add_topic('/joint_states', 'sensor_msgs/msg/JointState', Qos())
        for n in range(50):
            state = JointState(name=['a'], position=[float(n)])
            state.header.stamp = stamp(1.7e9 + (wrong if n == 10 else 0.01 * n))
            writer.write('/joint_states', serialize(state), 17 * 10**17 + n * 10**7)
    found = ms.open_run(path).columns('position.a', np.array([0.105, 0.245, 0.485]))
    np.testing.assert_allclose(found['position.a'], [10.5, 24.5, 48.5], rtol=1e-4)


def test_of_times_that_go_back_the_most_rise():
    """By all subsets; where a clock was set back, what it repeats is left out."""
    rng = np.random.default_rng(7)
    for _ in range(50):
        t = rng.integers(0, 8, rng.integers(1, 9)).astype(float)
        found = Series('x', '', t, t).rising
        most = max(
            sum(chosen)
            for chosen in itertools.product((0, 1), repeat=len(t))
            if (np.diff(t[np.array(chosen) == 1]) > 0.0).all()
        )
        assert len(found) == most
        assert (np.diff(found) > 0).all()
        assert (np.diff(t[found]) > 0.0).all()
    back = np.r_[np.arange(25.0), np.arange(5.0, 30.0)]
    assert Series('x', '', back, back).rising.tolist() == [*range(25), *range(45, 50)]
