"""Runs that are paused, stepped, reset and commanded, by programs outside."""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest
from builders import PLAY
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from operating import CONTROL, by_hand, operate
from running import FOLLOW, ROOT, TIMEOUT, environment, ros_found, run_json, script

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.errors import InputError
from mechanism_sim.messages.events import law_of
from mechanism_sim.planar.drive import TWO_PI, DriveLaw
from mechanism_sim.recording.reader import read_bag

SCENE = 'four_bar_clearance'
JOINT = f'{PLAY}.restitution'


STEPS = (
    CONTROL
    + """
features = call('GetSimulatorFeatures', 'get_simulator_features').features.features
found['features'] = sorted(int(f) for f in features)
found['steps'] = [step(1) for _ in range(99)]
found['play at the end'] = go(1)
found['beyond'] = step(1)
found['state'] = state()
found['reset'] = call('ResetSimulation', 'reset_simulation', scope=0).result.result
found['half a reset'] = call('ResetSimulation', 'reset_simulation', scope=1).result.result
kind = action_class(f'{PACKAGE}/action/SimulateSteps')
deep = QoSProfile(depth=100)  # whoever is slow to hear loses none
action = ActionClient(node, kind, 'simulate_steps', feedback_sub_qos_profile=deep)
assert action.wait_for_server(300)
heard = []
goal = wait(action.send_goal_async(
    kind.Goal(steps=30),
    feedback_callback=lambda m: heard.append(
        (int(m.feedback.completed_steps), int(m.feedback.remaining_steps)))))
done = wait(goal.get_result_async())
found['action'] = [goal.accepted, int(done.status), int(done.result.result.result)]
found['feedback'] = heard
found['play'] = go(1)
found['play again'] = go(1)
found['pause'] = go(2)
found['stop'] = go(0)
found['stopped'] = state()
found['quit'] = go(3)
print(json.dumps(found))
shutdown()
"""
)


@pytest.mark.usefixtures('backend')
def test_a_hundred_single_steps_equal_one_run_to_the_bit(tmp_path):
    found, bag = operate(tmp_path, STEPS, SCENE, '--duration', '0.1')
    known = {0, 1, 8, 10, 11, 12, 14, 20, 21, 22, 23, 24, 25, 26, 31, 32, 33, 40, 44, 45, 50}
    assert known == set(found['features'])
    assert found['steps'] == [[1, '']] * 99  # the first made the operator's loop end
    assert found['play at the end'][0] == 102
    assert 'at its end, at 0.1 s: reset it first' in found['play at the end'][1]
    assert found['beyond'][0] == 4
    assert 'steps end at 0.101 s, the run at 0.1 s' in found['beyond'][1]
    assert (found['state'], found['reset'], found['half a reset']) == (2, 1, 0)
    assert found['action'] == [True, 4, 1]
    assert found['feedback'] == [[n, 30 - n] for n in range(1, 31)]
    assert found['play'] == [1, '']
    assert found['play again'][0] in (101, 102)  # playing still, or at its end
    assert found['stop'] == [1, '']
    assert (found['stopped'], found['quit']) == (0, [1, ''])
    alone = run_json('solve', SCENE, '--duration', '0.1')
    assert analyze(bag).digest == alone['digest']
    # The run after the reset ends where it was paused, and is what `run` tells of at its end.
    told = bag.with_suffix('.txt').read_text().splitlines()
    assert ': 0 s simulated in ' in told[0]
    assert told[-2] == f'  recorded in {bag.with_name("run-3.mcap")}'
    assert told[-1].endswith(f': {bag}, {bag.with_name("run-2.mcap")}')
    # The run after the reset begins a bag of its own, with the description of the scene.
    second = read_bag(bag.with_name('run-2.mcap'))
    assert second.complete
    assert len(list(second.messages('/scene'))) == 1
    steps = [m for _, m, _ in second.messages('/joint_states')]
    assert len(steps) >= 3
    solution = ms.simulate(ms.load_scene(SCENE), duration=0.1)
    t = np.array([m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in steps])
    crank = solution.sample(t, 'position.coupler')['position.coupler']
    assert np.abs(crank - [m.position[1] for m in steps]).max() < 1e-12


END = """
import json
from mechanism_sim.messages import Float64, Progress, action_class, service_class
from mechanism_sim.nodes.middleware import (
    ActionClient, Node, Parameter, SingleThreadedExecutor, init, leave)
from mechanism_sim.nodes.crank_drive import CrankDrive
from mechanism_sim.nodes.qos import RESULTS

init()
found = []
for paused, short, name, fields in (
    (False, 'ResetSimulation', 'reset_simulation', {}),
    (True, 'StepSimulation', 'step_simulation', {'steps': 20}),
):
    partner, executor = Node('linkage'), SingleThreadedExecutor()
    partner.create_subscription(Progress, 'progress', lambda _: None, RESULTS)
    progress = partner.create_publisher(Progress, 'progress', RESULTS)
    commands = partner.create_publisher(Float64, 'command/velocity', RESULTS)
    given = {'partners': 'linkage', 'duration': 0.02, 'paused': paused,
             'overrides': 'drive.commands={acceleration: 100 rad/s^2, fastest: 60 rad/s}'}
    drive = CrankDrive([Parameter(key, value=value) for key, value in given.items()])
    for node in (partner, drive):
        executor.add_node(node)
    kind = service_class(f'simulation_interfaces/srv/{short}')
    client = partner.create_client(kind, name)
    while not (drive.ready and client.service_is_ready()):
        executor.spin_once(timeout_sec=0.1)
    if paused:
        commands.publish(Float64(data=50.0))
        while len(drive._laws) < 2:
            executor.spin_once(timeout_sec=0.1)
        drive.set_parameters([drive.get_parameter('velocity')])
    answer = client.call_async(kind.Request(**fields))
    while not drive.final or not (paused or answer.done()):
        executor.spin_once(timeout_sec=0.1)
    progress.publish(Progress(node='linkage', time=0.02, finished=True))
    while not drive.done:
        executor.spin_once(timeout_sec=0.1)
    steady = drive.law.degree == 1
    executor.remove_node(drive)  # as where it has a process of its own
    executor.spin_until_future_complete(answer, timeout_sec=300)
    result = answer.result().result if answer.done() else None
    found.append(result and [result.result, result.error_message, steady])
    executor.remove_node(partner)
    drive.destroy_node()
    partner.destroy_node()
# Steps that take long, because the partner does, are ended by a pause.
partner, executor = Node('linkage'), SingleThreadedExecutor()
partner.create_subscription(Progress, 'progress', lambda _: None, RESULTS)
progress = partner.create_publisher(Progress, 'progress', RESULTS)
given = {'partners': 'linkage', 'duration': 10.0, 'paused': True}
drive = CrankDrive([Parameter(key, value=value) for key, value in given.items()])
for node in (partner, drive):
    executor.add_node(node)
step, state = (service_class(f'simulation_interfaces/srv/{short}')
               for short in ('StepSimulation', 'SetSimulationState'))
ask = partner.create_client(step, 'step_simulation')
stop = partner.create_client(state, 'set_simulation_state')
while not (drive.ready and ask.service_is_ready() and stop.service_is_ready()):
    executor.spin_once(timeout_sec=0.1)
steps = ask.call_async(step.Request(steps=5000))
while drive.announced < 3.0:
    executor.spin_once(timeout_sec=0.1)
second = ask.call_async(step.Request(steps=1))
executor.spin_until_future_complete(second, timeout_sec=300)
request = state.Request()
request.state.state = 2
paused = stop.call_async(request)
for _ in range(20):
    executor.spin_once(timeout_sec=0.02)
early = [steps.done(), paused.done()]
progress.publish(Progress(node='linkage', time=3.0))
for answer in (steps, paused):
    executor.spin_until_future_complete(answer, timeout_sec=300)
found.append([early] + [
    [a.result().result.result, a.result().result.error_message] for a in (second, steps, paused)
] + [drive.announced])
# So are those of an action, each of which is announced by itself.
kind = action_class('simulation_interfaces/action/SimulateSteps')
action = ActionClient(partner, kind, 'simulate_steps')
while not action.server_is_ready():
    executor.spin_once(timeout_sec=0.1)
goal = action.send_goal_async(kind.Goal(steps=3))
executor.spin_until_future_complete(goal, timeout_sec=300)
ended = goal.result().get_result_async()
while drive.announced == 3.0:
    executor.spin_once(timeout_sec=0.1)
paused = stop.call_async(request)
for _ in range(20):
    executor.spin_once(timeout_sec=0.02)
progress.publish(Progress(node='linkage', time=3.001))
executor.spin_until_future_complete(paused, timeout_sec=300)
while not ended.done() and drive.announced == 3.001:
    executor.spin_once(timeout_sec=0.1)
found.append([ended.done(), drive.announced, paused.result().result.result])
if ended.done():
    found[-1] += [ended.result().status, ended.result().result.result.error_message]
# A partner that cannot take other values of the scene keeps the run from being reset.
drive.set_parameters([Parameter('overrides', value='drive.speed=300 rpm')])
kind = service_class('simulation_interfaces/srv/ResetSimulation')
reset = partner.create_client(kind, 'reset_simulation')
while not reset.service_is_ready():
    executor.spin_once(timeout_sec=0.1)
answer = reset.call_async(kind.Request())
executor.spin_until_future_complete(answer, timeout_sec=300)
result = answer.result().result
found.append([result.result, result.error_message, drive.announced, drive.run])
for node in (partner, drive):
    executor.remove_node(node)
    node.destroy_node()
leave()
print(json.dumps(found))
"""


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_who_asks_for_something_at_the_end_of_a_run_is_answered(tmp_path):
    """Of a run whose end is announced nobody can take that back, and the last step is answered.

    On the way a parameter takes back what a topic commanded, although its value stays the same.
    """
    ended = subprocess.run(
        [sys.executable, str(script(tmp_path / 'end.py', END))],
        env=environment(), capture_output=True, text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    reset, steps, paused, goal, refused = json.loads(ended.stdout.splitlines()[-1])
    assert reset[0] == 4
    assert 'the run ends by itself at 0.02 s' in reset[1]
    assert steps == [1, '', True]
    assert paused == [
        [False, False],
        [4, 'steps under way: wait for the end'],
        [4, 'paused meanwhile, at 3 s'],
        [1, ''],
        3.0,
    ]
    assert goal == [True, 3.001, 1, 6, 'paused meanwhile, at 3.001 s']
    assert refused[0] == 4
    assert "'linkage' cannot begin a run with other values of the scene" in refused[1]
    assert refused[2:] == [3.001, 0]


PARAMETERS = (
    CONTROL
    + """
drive, linkage = '/crank_drive', '/linkage'
JOINT = 'joints.coupler_rocker.clearance.restitution'
from mechanism_sim.messages import DiagnosticArray
from mechanism_sim.nodes.middleware import spin_once
statuses = {}
def hear(message):
    for status in message.status:
        known = {pair.key: pair.value for pair in status.values}
        level = int.from_bytes(bytes([status.level]) if isinstance(status.level, int)
                               else status.level, 'little')
        statuses[status.name] = [level, status.message, status.hardware_id, known]
node.create_subscription(DiagnosticArray, '/diagnostics', hear, 10)
found['steps'] = step(299)
def there(name, key):
    return name in statuses and statuses[name][3].get(key) == '0.3'
while not (len(statuses) == 5 and there('linkage', 'time [s]')
           and there('crank_drive', 'announced [s]')):
    spin_once(node, timeout_sec=0.1)
found['statuses'] = json.loads(json.dumps(statuses))  # later ones say more
def parameter(owner, name):
    kind = service_class('rcl_interfaces/srv/GetParameters')
    client = node.create_client(kind, f'{owner}/get_parameters')
    assert client.wait_for_service(300)
    (value,) = wait(client.call_async(kind.Request(names=[name]))).values
    return [int(value.type), bool(value.bool_value), int(value.integer_value)]
found['sim time'] = parameter(linkage, 'use_sim_time')
found['depth'] = parameter(linkage, 'qos_overrides./joint_states.publisher.depth')
found['too much'] = set_(linkage, JOINT, 1.5)
found['no number'] = set_(linkage, JOINT, float('nan'))
found['wrong type'] = set_(linkage, JOINT, 'much')
found['read only'] = set_(linkage, 'partners', 'nobody')
found['another bag'] = set_('/recorder', 'file', 'other.mcap')
found['restitution'] = set_(linkage, JOINT, 0.9)
found['too fast'] = set_(drive, 'velocity', 80.0)
found['faster'] = set_(drive, 'velocity', 50.0)
found['pace'] = set_(drive, 'realtime_factor', -1.0)
found['play'] = go(1)
while state() == 1:
    pass
found['quit'] = go(3)
print(json.dumps(found))
shutdown()
"""
)


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_parameters_are_refused_with_a_reason_or_hold_from_the_time_that_is_announced(tmp_path):
    commands = 'drive.commands={acceleration: 100 rad/s^2, fastest: 60 rad/s}'
    # A clock that stands still while the run is paused must not stop the nodes.
    ros = 'use_sim_time:=true', 'qos_overrides./joint_states.publisher.depth:=50'
    args = [SCENE, '--duration', '1', '--set', commands, '--ros-args']
    args += [part for text in ros for part in ('-p', text)] + ['--']
    found, bag = operate(tmp_path, PARAMETERS, *args)
    for case, reason in {
        'too much': 'outside', 'wrong type': 'STRING', 'read only': 'read', 'too fast': 'outside',
        'pace': 'outside', 'no number': JOINT, 'another bag': 'read',
    }.items():  # fmt: skip
        assert not found[case][0]
        assert reason in found[case][1] or 'range' in found[case][1].lower(), found[case]
    assert found['restitution'] == found['faster'] == [True, '']
    assert found['sim time'][:2] == [1, True]
    assert found['depth'] == [2, False, 50]
    nodes = {'crank_drive', 'linkage', 'sensors', 'recorder', 'monitor'}
    assert set(found['statuses']) == nodes
    for level, message, scene, values in found['statuses'].values():
        assert (level, scene, values['run']) == (0, SCENE, '0')
        assert message in ('running', 'paused')
    assert found['statuses']['crank_drive'][3]['announced [s]'] == '0.3'
    assert found['statuses']['recorder'][3]['bag'] == str(bag)
    balance = found['statuses']['linkage'][3]
    assert abs(float(balance['residual of the energy balance [J]'])) < 1e-9
    with bag.open('rb') as file:  # read by another's reader
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        messages = [(c.topic, m) for _, c, _, m in reader.iter_decoded_messages()]
    (change,) = [m for topic, m in messages if topic == '/scene_changes']
    assert (change.path, change.value, change.time) == (JOINT, 0.9, 0.3)
    impacts = [m for topic, m in messages if topic == '/impacts' and not m.ends_chatter]
    for early in (True, False):
        some = [m for m in impacts if early == (m.time < 0.3)]
        e = {round(m.rebound_speed / m.approach_speed, 9) for m in some}
        assert e == {0.5 if early else 0.9}
    # The crank: 36.65 rad/s up to 0.3 s, then 100 rad/s^2 up to 50 rad/s.
    states = [m for topic, m in messages if topic == '/joint_states']
    t = np.array([m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in states])
    speed = np.clip(36.6519 + 100.0 * (t - 0.3), 36.6519, 50.0)
    assert np.abs(speed - [m.velocity[0] for m in states]).max() < 1e-9
    # The laws of the bag, given to the library, make the same motion bit by bit.
    laws = {}
    for topic, m in messages:
        if topic == '/drive':
            laws[m.law_id] = law_of(m, ())
    machine = ms.load_scene(SCENE, [commands])
    run = machine.start(laws.pop(1))
    run.advance(0.3)
    run.change_restitution('coupler_rocker', 0.9)
    for law in laws.values():
        run.change_law(law)
    run.advance(1.0, final=True)
    digest = MotionDigest()
    motion, struck, _ = run.drain()
    digest.add(motion, struck)
    assert analyze(bag).digest == digest.hexdigest()


COMMANDS = 'drive.commands={acceleration: 100 rad/s^2, fastest: 60 rad/s}'
VALUES = (
    CONTROL
    + """
import sys
drive, linkage = '/crank_drive', '/linkage'
commands, PLAY = sys.argv[1], 'joints.coupler_rocker.clearance'
def ask(*values):
    return set_(drive, 'overrides', '\\n'.join([commands, *values]))
def get(owner, name):
    kind = service_class('rcl_interfaces/srv/GetParameters')
    client = node.create_client(kind, f'{owner}/get_parameters')
    assert client.wait_for_service(300)
    (value,) = wait(client.call_async(kind.Request(names=[name]))).values
    return value.string_value or '\\n'.join(value.string_array_value) or value.double_value
def reset():
    answer = call('ResetSimulation', 'reset_simulation', scope=0).result
    return [answer.result, answer.error_message]
def to_the_end():
    go(1)
    while state() == 1:
        pass
found['refused'] = [ask(text) for text in (
    PLAY, PLAY + '.radial=-1 mm', 'drive.sped=300 rpm', 'links.coupler.length=1 mm',
    'joints.crank_coupler.clearance={radial: 0.1 mm, restitution: 0.5}', 'sensors={}')]
found['refused'] += [set_(drive, 'overrides', ''), set_(linkage, 'overrides', 'gravity=down')]
found['set'] = [ask(PLAY + '.radial=0.3 mm')]
found['overrides'] = [get(linkage, 'overrides')]
to_the_end()
found['reset'] = [reset()]
found['overrides'] += [get(linkage, 'overrides')]
to_the_end()
set_(linkage, PLAY + '.restitution', 0.3)
set_(drive, 'velocity', 20.0)
found['set'] += [ask(PLAY + '.radial=0.4 mm', 'drive.speed=400 rpm', PLAY + '.restitution=0.8')]
found['reset'] += [reset()]
found['parameters'] = [get(drive, 'velocity'), get(linkage, PLAY + '.restitution')]
to_the_end()
found['set'] += [ask()]
found['reset'] += [reset()]
found['parameters'] += [get(drive, 'velocity'), get(linkage, PLAY + '.restitution')]
to_the_end()
found['quit'] = go(3)
print(json.dumps(found))
shutdown()
"""
)


@pytest.mark.usefixtures('backend')
def test_the_next_run_has_the_values_of_the_scene_that_are_asked_for(tmp_path):
    """Each run moves as `solve` has it with these values, and its bag tells them."""
    args = [SCENE, '--duration', '0.1', '--set', COMMANDS, '--display']
    found, bag = operate(tmp_path, VALUES, *args, given=[COMMANDS])
    assert not any(done for done, _ in found['refused'])
    reasons = (
        'PATH=VALUE', 'must be more than 0', "did you mean 'speed'?", 'cannot be assembled',
        'the joints with clearance cannot change from one run to the next (now coupler_rocker; '
        'asked for crank_coupler, coupler_rocker): end this run and start another',
        'the sensors cannot change', 'commands', 'gravity',
    )  # fmt: skip
    for (_, said), reason in zip(found['refused'], reasons, strict=True):
        assert reason in said
    assert found['set'] == [[True, '']] * 3
    assert found['reset'] == [[1, '']] * 3
    assert found['overrides'] == [COMMANDS, f'{COMMANDS}\n{PLAY}.radial=0.3 mm']
    speed = 400.0 * 2.0 * math.pi / 60.0
    assert found['parameters'] == pytest.approx([speed, 0.8, 36.6519, 0.5])
    values = {
        '': [],
        '-2': [f'{PLAY}.radial=0.3 mm'],
        '-3': [f'{PLAY}.radial=0.4 mm', 'drive.speed=400 rpm', f'{PLAY}.restitution=0.8'],
        '-4': [],
    }
    for number, overrides in values.items():
        file = bag.with_name(f'run{number}.mcap')
        sets = [part for text in [COMMANDS, *overrides] for part in ('--set', text)]
        alone = run_json('solve', SCENE, '--duration', '0.1', *sets)
        assert analyze(file).digest == alone['digest']
        recorded = read_bag(file)
        assert recorded.complete
        (scene,) = [json.loads(m.data)['scene'] for _, m, _ in recorded.messages('/scene')]
        asked = ms.load_scene(SCENE, [COMMANDS, *overrides]).scene
        assert scene == json.loads(asked.model_dump_json(by_alias=True))
        for topic in ('/markers', '/robot_description'):
            assert len(list(recorded.messages(topic))) == 1
        samples = [m for _, m, _ in recorded.messages('/accelerometer/rocker_accelerometer')]
        assert sum(len(m.samples) for m in samples) == 1000


@pytest.mark.slow
def test_a_controller_outside_holds_the_speed_and_every_run_is_the_same(backend, tmp_path):
    """PI control of the crank, one command for each sample, against the same loop by hand."""
    if backend == 'zenoh' and ros_found():
        pytest.skip('the controller takes rclpy where that is installed')
    env, program = environment(), ROOT / 'docs' / 'speed_controller.py'
    text = f"{FOLLOW}from runpy import run_path; run_path({str(program)!r}, run_name='__main__')"
    controller = subprocess.Popen([sys.executable, '-c', text], env=env)
    args = ['--duration', '0.5', '--ros-args', '-p', 'crank_drive:command_period:=0.005', '--']
    try:
        bags = [tmp_path / 'first.mcap', tmp_path / 'second.mcap']
        for bag in bags:
            run_json('run', 'four_bar_governed', '--record', str(bag), *args, env=env)
    finally:
        controller.send_signal(signal.SIGTERM)
        assert controller.wait(TIMEOUT) == 0
    first, second = (analyze(bag).digest for bag in bags)
    assert first == second
    states = [m for _, m, _ in read_bag(bags[0]).messages('/joint_states')]
    speed = np.array([m.velocity[0] for m in states])
    assert len(speed) == 100
    assert speed[0] == pytest.approx(15.70796327)
    assert np.abs(speed[40:] - 36.65).max() < 2.0
    assert np.abs(by_hand(100) - speed).max() < 1e-6


@pytest.mark.parametrize('scene', [SCENE, 'four_bar_nominal', 'slider_crank_piston_driven'])
def test_what_is_seen_ahead_is_what_comes(scene):
    """Samples from the beginning of a step that is held back are those of the step, bit by bit."""
    machine = ms.load_scene(scene)
    whole = machine.start()
    end = known = 0.2
    while whole.time <= end:  # of a slow drive a step may be longer than that
        known *= 2.0
        whole.advance(known)
    motion, *_ = whole.drain()
    run, ahead = machine.start(), 0
    rng = np.random.default_rng(8)
    for until in np.sort(rng.uniform(0.0, end, 40)):
        run.advance(until)
        run.drain()
        seen = run.preview(until)
        if seen is None:
            continue
        ahead += 1
        assert seen.curve.end == pytest.approx(until, abs=1e-15)
        k, _ = motion.curve.find(seen.curve.start)
        assert (motion.curve.start[k] == seen.curve.start).all()
        assert (motion.curve.coefficients[k] == seen.curve.coefficients).all()
    assert ahead > 20


@pytest.mark.parametrize('turns', [0, 3_000_000])
def test_a_ramp_to_another_speed_loses_no_digits(turns):
    law = DriveLaw('crank', (0.25, 36.0), turns=turns)
    at = 0.7
    ramp, steady = law.towards(50.0, at, 100.0)
    assert ramp.continues(law)
    assert steady.continues(ramp)
    # Exactly: angle before, and the area under a ramp of 100 rad/s^2.
    t = Fraction(2)
    T = Fraction(14, 100)
    exact = Fraction(0.25) + 36 * Fraction(at) + 36 * T + 50 * T * T + 50 * (t - Fraction(at) - T)
    whole, (angle, speed) = steady.about(t)
    assert speed == 50.0
    assert whole == turns + int(exact / TWO_PI)
    assert abs(float(exact - int(exact / TWO_PI) * TWO_PI) - angle) < 1e-13


@pytest.mark.parametrize(
    ('setting', 'words'),
    [
        ('drive.commands={acceleration: 1 rad/s^2}', 'fastest'),
        ('drive={speed: 1 rpm, torque: {}, commands: {acceleration: 1 rad/s^2, fastest: 1 rpm}}',
         'effort without this key'),
        ('drive.commands={acceleration: -1 rad/s^2, fastest: 1 rpm}', 'more than 0'),
    ],
)  # fmt: skip
def test_commands_that_make_no_sense_are_refused(setting, words):
    with pytest.raises(InputError, match=words):
        ms.load_scene(SCENE, [setting]).plan  # noqa: B018
