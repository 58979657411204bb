"""The nodes over the real middleware, in processes of their own, and the bags they leave."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from operating import FOREIGN
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from running import TIMEOUT, command, environment, run, run_json, script, start

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.messages import Progress, uint64_array
from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.nodes.run import Monitor, Outcome
from mechanism_sim.recording.reader import read_bag

# what nodes do is compared with runs of this process
pytestmark = pytest.mark.optimised

SCENE = 'four_bar_clearance'
TURNS = '3'


@pytest.fixture(scope='module')
def solved() -> dict:
    return run_json('solve', SCENE, '--revolutions', TURNS)


@pytest.mark.parametrize(
    ('processes', 'rate'),
    [
        pytest.param(False, '50 Hz', marks=pytest.mark.slow),
        pytest.param(False, '500 Hz', marks=pytest.mark.slow),
        pytest.param(True, '50 Hz', marks=pytest.mark.slow),
        pytest.param(True, '500 Hz', marks=pytest.mark.slow),
    ],
)
def test_motion_and_impacts_are_bit_identical_however_they_are_published(
    backend, tmp_path, solved, processes, rate
):
    bag = tmp_path / 'run.mcap'
    settings = [f'outputs.{topic}={rate}' for topic in ('joint_states', 'linkage_state')]
    args = [part for text in settings for part in ('--set', text)]
    args += ['--processes'] if processes else []
    outcome = run_json('run', SCENE, '--revolutions', TURNS, '--record', str(bag), *args)
    assert (outcome['code'], outcome['middleware']) == (0, backend)
    summary = analyze(bag)
    assert summary.digest == solved['digest']
    assert outcome['impacts'] == len(solved['impacts'])


JOINT = 'joints.{}.clearance={{radial: 0.254 mm, restitution: 0.5, {}}}'
DRIVES = {
    'profile': ['drive={profile: {points: [[0 s, 100 rpm], [0.2 s, 350 rpm]], ramp: smooth}}'],
    'torque': ['drive={speed: 350 rpm, torque: {constant: 0.1 N m}, flywheel: 0.01 kg m^2}'],
    'motor and friction in two joints': [
        'drive={speed: 350 rpm, motor: {stall_torque: 2 N m, no_load_speed: 400 rpm}}',
        JOINT.format('coupler_rocker', 'friction: 0.2, pin_radius: 5 mm, hypothesis: poisson'),
        JOINT.format('crank_coupler', 'friction: 0.3, hypothesis: stronge'),
    ],
}


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
@pytest.mark.parametrize(
    'name', ['torque', *(pytest.param(n, marks=pytest.mark.slow) for n in DRIVES if n != 'torque')]
)
def test_every_drive_moves_the_nodes_as_it_moves_the_solution(tmp_path, name):
    args = [part for text in DRIVES[name] for part in ('--set', text)]
    args += ['--duration', '0.4']
    alone = run_json('solve', SCENE, *args)
    bag = tmp_path / 'run.mcap'
    outcome = run_json('run', SCENE, *args, '--record', str(bag))
    assert outcome['code'] == 0
    assert analyze(bag).digest == alone['digest']
    laws = [message for _, message, _ in read_bag(bag).messages('/drive')]
    assert {law.kind for law in laws} == {1 if name == 'profile' else 2}
    assert max(law.law_id for law in laws) == (2 if name == 'profile' else 1)


@pytest.mark.slow
def test_the_digest_tells_different_runs_apart(solved):
    other = run_json('solve', SCENE, '--revolutions', TURNS, '--rtol', '1e-11')
    assert other['digest'] != solved['digest']


@pytest.fixture(scope='module')
def recorded(backend, tmp_path_factory) -> tuple[Path, dict]:
    bag = tmp_path_factory.mktemp('bags') / 'run.mcap'
    outcome = run_json('run', SCENE, '--revolutions', TURNS, '--processes', '--record', str(bag))
    assert outcome['middleware'] == backend
    return bag, outcome


def test_nodes_in_processes_of_their_own_move_as_the_solution_to_the_bit(recorded, solved):
    bag, outcome = recorded
    assert outcome['code'] == 0
    assert analyze(bag).digest == solved['digest']
    assert outcome['impacts'] == len(solved['impacts'])


def test_foreign_readers_decode_every_message_and_count_what_was_sent(recorded):
    bag, outcome = recorded
    lossy, found = {'/clock'}, read_bag(bag)
    by_mcap: Counter[str] = Counter()
    with bag.open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            assert message is not None
            by_mcap[channel.topic] += 1
    by_rosbags: Counter[str] = Counter()
    typestore = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([bag], default_typestore=typestore) as reader:
        for connection, _, raw in reader.messages():
            assert reader.deserialize(raw, connection.msgtype) is not None
            by_rosbags[connection.topic] += 1
    assert by_mcap == by_rosbags
    sent = Counter(outcome['sent'])
    for topic in set(sent) - lossy:
        assert by_mcap[topic] == sent[topic], topic
    # run, analyze and bag info count the same, and where it is not all it is said
    whole = f'{by_mcap.total()} on {len(found.topics)} topics'
    said = f'{whole}; run and analyze count {sent.total()}: those of /clock may get lost'
    assert said in run('bag', 'info', str(bag)).stdout
    assert f'messages: all {sent.total()} that were sent' in run('analyze', str(bag)).stdout
    assert {'/motion', '/impacts', '/joint_states', '/linkage_state', '/scene'} <= set(sent)


def test_recorded_samples_are_those_of_the_solution(recorded):
    bag, _ = recorded
    solution = ms.simulate(ms.load_scene(SCENE), revolutions=float(TURNS))
    states = [m for _, m, _ in read_bag(bag).messages(['/linkage_state'])]
    columns = solution.sample(np.array([m.time for m in states]))
    for i, link in enumerate(('crank', 'coupler', 'rocker')):
        for name in ('position', 'velocity', 'acceleration'):
            published = np.array([getattr(m, name)[i] for m in states])
            expected = columns[f'{name}.{link}']
            assert np.array_equal(published, expected), (link, name)
    work = np.array([m.drive_work for m in states])
    assert np.abs(work - columns['energy.drive_work']).max() < 1e-12
    total = columns['energy.kinetic'] + columns['energy.potential']
    balance = total - total[0] - work + np.array([m.dissipated for m in states])
    assert np.abs(balance).max() < 1e-11


def test_the_accelerometer_reads_what_differences_of_the_position_say(recorded):
    bag, _ = recorded
    blocks = [m for _, m, _ in read_bag(bag).messages(['/accelerometer/rocker_accelerometer'])]
    reading = np.concatenate([np.asarray(b.samples) for b in blocks])
    assert blocks[0].time == 0.0
    solution = ms.simulate(ms.load_scene(SCENE), revolutions=float(TURNS))
    n = len(reading)
    assert n == int(np.ceil(solution.duration * 10_000.0))
    # Before the first loss of contact the motion is smooth: differentiate the position twice.
    k = np.arange(100, 1700, 37)
    h = 2e-5
    weights = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / (180.0 * h * h)
    shifts = h * np.arange(-3, 4)

    def tip(t: np.ndarray) -> np.ndarray:
        angle = solution.sample(t, 'position.rocker')['position.rocker']
        return 0.2 * np.array([np.cos(angle), np.sin(angle)])

    a = sum(w * tip(k / 1e4 + s) for w, s in zip(weights, shifts, strict=True))
    angle = solution.sample(k / 1e4, 'position.rocker')['position.rocker']
    across = -np.sin(angle) * a[0] + np.cos(angle) * a[1]
    assert np.abs(across - reading[k]).max() < 1e-4 * np.abs(reading).max()


SLOW = """
import sys, time
from mechanism_sim.nodes.middleware import Node, init, shutdown, spin_once
from mechanism_sim.messages import Impact, Progress
from mechanism_sim.nodes.qos import RESULTS
init()
node = Node('slow_listener')
got, finished = [], []
def hear(message):
    got.append(message.index)
    time.sleep(0.01)
node.create_subscription(Impact, 'impacts', hear, RESULTS)
def done(message):
    if message.node == 'linkage' and message.finished:
        finished.append(dict(zip(message.topics, map(int, message.counts)))['/impacts'])
node.create_subscription(Progress, 'progress', done, RESULTS)
print('listening', flush=True)
while not (finished and len(got) >= finished[0]):
    spin_once(node, timeout_sec=0.1)
print(finished[0], len(got), got == list(range(len(got))), flush=True)
shutdown()
"""


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_a_slow_subscriber_loses_nothing(tmp_path):
    env = environment()
    listener = subprocess.Popen(
        [sys.executable, str(script(tmp_path / 'slow.py', SLOW))],
        env=env, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert listener.stdout is not None
    assert listener.stdout.readline() == 'listening\n'
    done = run('run', SCENE, '--revolutions', TURNS, '--processes', env=env)
    assert done.returncode == 0, done.stderr
    assert listener.wait(TIMEOUT) == 0
    sent, received, in_order = listener.stdout.read().split()
    assert sent == received
    assert int(sent) > 50
    assert in_order == 'True'


@pytest.mark.network
@pytest.mark.slow
def test_a_program_with_nothing_but_zenoh_sees_the_graph_and_decodes_joint_states(tmp_path):
    env = environment()
    text = FOREIGN % (env['MECHANISM_SIM_ROUTER'], env['ROS_DOMAIN_ID'])
    # The foreign program is a client: the router has to be there before it.
    running = start(
        'run', SCENE, '--revolutions', '100000', '--processes', '--realtime-factor', '1', env=env
    )
    try:
        path = script(tmp_path / 'foreign.py', text)
        foreign = None
        while foreign is None and running.poll() is None:
            attempt = subprocess.run(
                [sys.executable, str(path)], env=env, capture_output=True, text=True,
                timeout=TIMEOUT, check=False,
            )  # fmt: skip
            foreign = attempt.stdout if attempt.returncode == 0 else None
        assert foreign, attempt.stderr
    finally:
        running.send_signal(signal.SIGINT)
        running.wait(TIMEOUT)
    kinds, nodes, joints = eval(foreign.splitlines()[-1])
    assert {'NN', 'MP', 'MS', 'SS'} <= set(kinds)
    assert {'crank_drive', 'linkage', 'sensors'} <= set(nodes)
    for t, words, position in joints:
        assert words == ['crank', 'coupler', 'rocker']
        assert abs(position[0] - 36.6519 * t) < 1e-7


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_a_killed_recorder_leaves_a_readable_file(tmp_path):
    env, bag = environment(), tmp_path / 'killed.mcap'
    running = start(
        'run', SCENE, '--revolutions', '100000', '--processes', '--realtime-factor', '1',
        '--record', str(bag), env=env,
    )  # fmt: skip
    pid = _wait_for_child(running, 'recorder')
    wait_for_file(bag, 400_000, running)  # half a second of motion
    os.kill(pid, signal.SIGKILL)
    assert running.wait(TIMEOUT) == 1
    stderr = running.stderr.read() if running.stderr else ''
    assert "'recorder' was killed by signal 9" in stderr
    found = read_bag(bag)
    assert not found.complete
    times = [t for _, _, t in found.messages(['/motion'])]
    last = max(m.time for _, m, _ in found.messages(['/progress']) if m.node == 'linkage')
    assert len(times) > 2
    assert 0.0 < last < max(times) / 1e9 + 1.0


def _wait_for_child(parent: subprocess.Popen[str], node: str) -> int:
    while parent.poll() is None:
        for entry in Path('/proc').glob('[0-9]*/cmdline'):
            try:
                words = entry.read_bytes().decode().split('\0')
                stat = (entry.parent / 'stat').read_text().split()
            except OSError:  # ended meanwhile
                continue
            if int(stat[3]) == parent.pid and words[3:5] == ['node', node]:
                return int(entry.parent.name)
        time.sleep(0.05)
    raise AssertionError(f'{node} never started')


def wait_for_file(path: Path, size: int, process: subprocess.Popen[str]) -> None:
    """Until what a process writes has so many bytes."""
    while not path.exists() or path.stat().st_size < size:
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
@pytest.mark.parametrize(
    ('processes', 'number'),
    [pytest.param(True, signal.SIGINT, marks=pytest.mark.slow), (False, signal.SIGTERM)],
)
def test_a_signal_ends_the_run_with_the_bag_finished(tmp_path, processes, number):
    env, bag = environment(), tmp_path / 'run.mcap'
    args = ['--processes'] if processes else []
    running = start('run', SCENE, '--revolutions', '100000', '--record', str(bag), *args, env=env)
    wait_for_file(bag, 20_000, running)
    running.send_signal(number)
    assert running.wait(TIMEOUT) == 130
    found = read_bag(bag)
    assert found.complete
    assert found.topics['/motion'].count > 0


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_a_partner_that_never_comes_is_named():
    done = run(
        'node', 'linkage', '--scene', SCENE, '--partners', 'crank_drive', '--partner-timeout', '.2'
    )
    assert done.returncode == 1
    assert "waited 0.2 s for 'crank_drive'" in done.stderr
    assert 'Traceback' not in done.stderr


@pytest.mark.usefixtures('backend')
@pytest.mark.parametrize(
    'given', ['recorder --file x.mcap --hold', 'linkage --force-scale 2', 'display --lead 3']
)
def test_an_option_of_another_node_is_refused(given, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name, *options = given.split()
    done = run('node', name, '--scene', SCENE, *options, refused=True)
    assert done.returncode == 2
    wrong = next(o for o in options if o in ('--hold', '--force-scale', '--lead'))
    assert f'{wrong} does not apply to the node {name}' in done.stderr


PROGRESS = """
from mechanism_sim.messages import Progress
from mechanism_sim.nodes.middleware import Node, init, ok, shutdown, spin_once
from mechanism_sim.nodes.qos import RESULTS
init()
node = Node('watcher')
heard = []
node.create_subscription(Progress, 'progress', lambda m: heard.append(m.node), RESULTS)
print('listening', flush=True)
while ok() and 'linkage' not in heard:
    spin_once(node, timeout_sec=0.1)
shutdown()
"""


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_a_partner_that_leaves_is_named(tmp_path):
    env = environment()
    watcher = subprocess.Popen(
        [sys.executable, str(script(tmp_path / 'watch.py', PROGRESS))],
        env=env, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert watcher.stdout is not None
    assert watcher.stdout.readline() == 'listening\n'
    drive = start(
        'node', 'crank_drive', '--scene', SCENE, '--partners', 'linkage', '--duration', '1e5',
        '--realtime-factor', '1', env=env,
    )  # fmt: skip
    linkage = start(
        'node', 'linkage', '--scene', SCENE, '--partners', 'crank_drive', '--duration', '1e5',
        env=env,
    )  # fmt: skip
    assert watcher.wait(TIMEOUT) == 0  # the linkage has begun: it has seen the drive
    assert drive.poll() is None
    drive.kill()
    _, stderr = linkage.communicate(timeout=TIMEOUT)
    assert linkage.returncode == 1
    assert "'crank_drive' left before the run was finished" in stderr
    drive.communicate()


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_two_runs_on_one_network_are_kept_apart(tmp_path):
    env, bag = environment(), tmp_path / 'run.mcap'
    first = start(
        'run', SCENE, '--revolutions', '100000', '--realtime-factor', '1', '--record', str(bag),
        env=env,
    )  # fmt: skip
    wait_for_file(bag, 1, first)
    try:
        second = run('run', SCENE, env=env)
    finally:
        first.send_signal(signal.SIGINT)
        first.wait(TIMEOUT)
    assert second.returncode == 1
    assert 'is running in this domain' in second.stderr


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
@pytest.mark.parametrize('more', [(), ('--processes',)])
def test_of_runs_that_start_together_one_goes_on(more):
    """Each sees the others; who began first waits until they have left."""
    env = environment()
    started = [start('run', SCENE, '--duration', '0.01', *more, env=env) for _ in range(3)]
    said = [process.communicate(timeout=TIMEOUT)[1] for process in started]
    assert sorted(process.returncode for process in started) == [0, 1, 1], said
    assert sum('is running in this domain' in text for text in said) == 2


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
@pytest.mark.parametrize('there', [False, True])
def test_a_run_stopped_before_all_nodes_are_there_says_that_it_has_no_bag(tmp_path, there):
    bag = tmp_path / 'run.mcap'
    if there:
        bag.write_text('precious')
    args = command(
        'run', SCENE, '--record', str(bag), '--overwrite', '--listeners', 'nobody'
    )  # what `start` starts leaves what is said of its end to this process
    running = subprocess.Popen(args, env=environment(), stderr=subprocess.PIPE, text=True)
    assert running.stderr
    while 'waiting for nobody' not in (line := running.stderr.readline()):
        assert line, running.poll()
    running.send_signal(signal.SIGINT)
    said = running.communicate(timeout=TIMEOUT)[1]
    assert running.returncode == 130
    kept = 'is as it was' if there else 'is not written'
    assert f"before all nodes were there: nothing is recorded, '{bag}' {kept}\n" in said
    assert [path.read_text() for path in tmp_path.iterdir()] == ['precious'] * there


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_the_nominal_mechanism_runs_as_nodes_too(tmp_path):
    bag = tmp_path / 'nominal.mcap'
    outcome = run_json('run', 'four_bar_nominal', '--processes', '--record', str(bag))
    assert outcome['level'] == 'inverse dynamics'
    solved = run_json('solve', 'four_bar_nominal')
    assert analyze(bag).digest == solved['digest']


@pytest.mark.usefixtures('backend')
@pytest.mark.parametrize(
    'scene',
    [
        *(
            pytest.param(scene, marks=pytest.mark.slow)
            for scene in ('loader', 'geneva', 'slider_crank_piston_driven')
        ),
        'pendulum',
    ],
)  # fmt: skip
def test_linkages_run_as_nodes_bit_by_bit_as_without(tmp_path, scene):
    """Two drives that slide, one, a drive with switches, and none."""
    bag = tmp_path / 'run.mcap'
    outcome = run_json('run', scene, '--record', str(bag))
    solved = run_json('solve', scene)
    found = analyze(bag)
    assert outcome['duration'] == solved['duration']
    assert found.digest == solved['digest']
    slides = scene in ('loader', 'slider_crank_piston_driven')
    assert (found.motion.revolutions is None) == slides
    states = [m for _, m, _ in read_bag(bag).messages('/joint_states')]
    assert list(states[0].name) == solved['coordinates']
    frames = {t.child_frame_id for _, m, _ in read_bag(bag).messages('/tf') for t in m.transforms}
    assert frames == set(ms.load_scene(scene).plan.links)


@pytest.mark.slow
@pytest.mark.network
def test_a_paced_run_is_not_faster_than_its_clock():
    outcome = run_json('run', SCENE, '--duration', '1', '--realtime-factor', '1')
    assert outcome['duration'] == pytest.approx(1.0, abs=1e-12)
    assert outcome['wall_time'] > 0.85


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_parameters_that_are_nearly_right_are_named():
    """ROS passes over what a node does not know; those meant for other nodes are not named."""
    given = 'crank_drive:leed:=0.1', 'sceen:=geneva', 'lead:=0.2', 'crank_drve:lead:=0.1'
    more = [part for text in given for part in ('-p', text)]
    done = run('run', 'slider_crank', '--duration', '0.1', '--ros-args', *more, '--')
    assert done.returncode == 0
    assert "[crank_drive]: there is no parameter 'leed'; did you mean 'lead'?" in done.stderr
    assert "[crank_drive]: there is no parameter 'sceen'; did you mean 'scene'?" in done.stderr
    assert "'lead';" not in done.stderr
    assert "the run has no node 'crank_drve'; did you mean 'crank_drive'?" in done.stderr
    assert done.stderr.count('the run has no node') == 1


@pytest.mark.usefixtures('network')
def test_impacts_are_those_of_the_last_run():
    monitor = Monitor([Parameter('scene', value=SCENE), Parameter('partners', value='linkage')])
    for number, counts in ((0, {'/impacts': 5}), (1, {'/motion': 1})):
        monitor.on_progress(
            Progress(
                node='linkage', run=number, topics=list(counts),
                counts=uint64_array(list(counts.values())),
            )
        )  # fmt: skip
        assert monitor.impacts == counts.get('/impacts', 0)
    monitor.destroy_node()


def test_a_run_that_does_not_keep_its_pace_says_so():
    outcome = Outcome(0, 'x', 'smooth', 1.0, 3.0, 2.0, 0.5, 1.0, 0, {}, None, [], 'zenoh')
    assert '1 s simulated in 2 s, 0.5 x real time instead of 1 (3 s' in outcome.text()
    assert 'instead' not in replace(outcome, realtime_factor_asked=0.0).text()
    assert 'instead' not in replace(outcome, realtime_factor=0.99).text()
