"""Delivery: slow subscribers, late joiners, machines side by side, on every back end."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from middleware_network import eventually
from running import TIMEOUT, environment, run_json, script, start

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.messages import Clock
from mechanism_sim.nodes import middleware
from mechanism_sim.nodes.crank_drive import CrankDrive
from mechanism_sim.nodes.middleware import SingleThreadedExecutor
from mechanism_sim.nodes.qos import CLOCK
from mechanism_sim.recording.reader import read_bag

pytestmark = pytest.mark.network

MESSAGES, FEW = 2000, 300
PAUSE = 3e-3  # [s] of the subscriber after each message

MEMORY = """
import os
COUNT = int(os.environ['MESSAGES'])
def held():
    text = open('/proc/self/status').read()
    return int(text.partition('VmRSS:')[2].split()[0]) / 1024  # [MiB]
"""

SOURCE = (
    MEMORY
    + """
import struct, time
from benchmarks.traffic import End, RESULTS, motion
from mechanism_sim.messages import Motion, serialize
end = End('source')
publisher = end.node.create_publisher(Motion, 'motion', RESULTS)
data = bytearray(serialize(motion(0, 192)))
end.expect(publisher.get_subscription_count)
before, began = held(), time.process_time()
for i in range(COUNT):
    struct.pack_into('<I', data, 20, i)  # its run
    publisher.publish(bytes(data))
spent = (time.process_time() - began) / COUNT
end.done(spent=spent, size=COUNT * len(data) / 2**20, grown=held() - before)
"""
)

SLOW = (
    MEMORY
    + f"""
import time
from benchmarks.traffic import End, RESULTS
from mechanism_sim.messages import Motion
end, got, most = End('slow'), [], [0.0]
def take(message):
    got.append(int(message.run))
    most[0] = max(most[0], held())
    time.sleep({PAUSE})
end.node.create_subscription(Motion, 'motion', take, RESULTS)
before = held()
print('listening', flush=True)
end.until(lambda: len(got) == COUNT)
end.done(in_order=got == list(range(COUNT)), grown=most[0] - before)
"""
)


@contextmanager
def program(path: Path, text: str, env: dict[str, str]) -> Iterator[subprocess.Popen[str]]:
    """A script in the background, ended at last."""
    process = subprocess.Popen(
        [sys.executable, str(script(path, text))], env=env, stdout=subprocess.PIPE, text=True
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.slow
@pytest.mark.parametrize('count', [FEW, pytest.param(MESSAGES, marks=pytest.mark.slow)])
def test_a_burst_of_motion_reaches_a_far_slower_subscriber_in_bounded_memory(
    backend, tmp_path, count
):
    env = environment() | {'MESSAGES': str(count)}
    with program(tmp_path / 'slow.py', SLOW, env) as slow:
        assert slow.stdout
        assert slow.stdout.readline() == 'listening\n'
        with program(tmp_path / 'source.py', SOURCE, env) as source:
            sent = json.loads(source.communicate(timeout=TIMEOUT)[0])
            taken = json.loads(slow.communicate(timeout=TIMEOUT)[0])
    assert sent['spent'] < PAUSE / 4.0  # of CPU; a tenth where nothing else runs
    assert taken['in_order']
    assert sent['size'] > 0.09 * count  # MiB
    assert sent['grown'] < 20.0
    if count == MESSAGES and backend == 'zenoh':  # DDS keeps in its process what waits there
        assert taken['grown'] < 100.0


LATE = """
import json
from benchmarks.traffic import End
from mechanism_sim.messages import MarkerArray, Progress, String
from mechanism_sim.nodes.qos import LATCHED, RESULTS
end, heard, seen = End('late'), {}, []
node = end.node
node.create_subscription(Progress, 'progress', lambda m: seen.append(m.time), RESULTS)
end.expect(lambda: seen and seen[-1] > 0.2)
def listen(kind, topic, tell):
    node.create_subscription(kind, topic, lambda m: heard.update({topic: tell(m)}), LATCHED)
listen(String, 'scene', lambda m: json.loads(m.data))
listen(String, 'robot_description', lambda m: m.data)
listen(MarkerArray, 'markers', lambda m: len(m.markers))
end.expect(lambda: len(heard) == 3)
end.done(**heard)
"""


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_who_joins_a_run_under_way_gets_the_descriptions(tmp_path):
    env = environment()
    running = start(
        'run', 'four_bar_clearance', '--display', '--duration', '600', '--realtime-factor', '1',
        env=env,
    )  # fmt: skip
    try:
        with program(tmp_path / 'late.py', LATE, env) as late:
            found = json.loads(late.communicate(timeout=TIMEOUT)[0])
    finally:
        running.send_signal(signal.SIGINT)
        _, said = running.communicate(timeout=TIMEOUT)
    assert running.returncode == 130, said
    assert found['scene']['name'] == 'four_bar_clearance'
    links = ms.load_scene('four_bar_clearance').plan.links
    assert all(f'<link name="{link}">' in found['robot_description'] for link in links)
    assert found['markers'] >= len(links)


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_machines_in_two_namespaces_do_not_disturb_each_other(tmp_path):
    """They run at once in one domain, and with them one that is in no namespace."""
    env, machines = environment(), {'left': '300 rpm', 'right': '350 rpm', '': '320 rpm'}
    running = {}
    for side, speed in machines.items():
        home = ['--namespace', side] if side else []
        running[side] = start(
            'run', 'four_bar_clearance', '--set', f'drive.speed={speed}', '--duration', '0.5',
            '--record', str(tmp_path / f'{side}.mcap'), *home, env=env,
        )  # fmt: skip
    for side, speed in machines.items():
        _, said = running[side].communicate(timeout=TIMEOUT)
        assert running[side].returncode == 0, said
        args = ['--set', f'drive.speed={speed}', '--duration', '0.5']
        bag, prefix = tmp_path / f'{side}.mcap', f'{side}/' if side else ''
        assert analyze(bag).digest == run_json('solve', 'four_bar_clearance', *args)['digest']
        found = read_bag(bag)
        frames = [t for _, m, _ in found.messages('/tf') for t in m.transforms]
        links = {f'{prefix}{link}' for link in ms.load_scene('four_bar_clearance').plan.links}
        assert {t.child_frame_id for t in frames} == links
        assert {t.header.frame_id for t in frames} == {f'{prefix}world'}
        own = {topic for topic in found.topics if topic not in ('/tf', '/clock', '/diagnostics')}
        assert all(topic.startswith(f'/{prefix}') for topic in own)


@pytest.mark.parametrize(('home', 'count'), [('/', 1), ('/left', 0)])
def test_a_machine_in_a_namespace_leaves_the_clock_alone(monkeypatch, home, count):
    for name, value in environment().items():
        monkeypatch.setenv(name, value)
    middleware.init(['--ros-args', '-r', f'__ns:={home}'])
    node = CrankDrive()
    try:
        assert node.count_publishers('/clock') == count
    finally:
        middleware.leave([node])


@pytest.mark.usefixtures('network')
def test_a_second_clock_is_told(capfd):
    """Nodes with use_sim_time heard both times in turn, and nobody said why."""
    other, executor = middleware.Node('player', namespace='/left'), SingleThreadedExecutor()
    other.create_publisher(Clock, '/clock', CLOCK)
    drive = CrankDrive()
    try:
        assert eventually(lambda: drive.count_publishers('/clock') == 2)
        executor.add_node(drive)
        assert eventually(lambda: executor.spin_once(timeout_sec=0.01) or drive.ready)
    finally:
        executor.remove_node(drive)
        for node in (drive, other):
            node.destroy_node()
    assert '/left/player publishes /clock, too: nodes with use_sim_time' in capfd.readouterr().err


SLEEPER = """
from benchmarks.traffic import End, RESULTS
from mechanism_sim.messages import Motion
end = End('sleeper')
end.node.create_subscription(Motion, 'motion', lambda message: None, RESULTS)
print('listening', flush=True)
end.until(lambda: False)
"""

BLOCKED = """
import time
from mechanism_sim import process_exit
process_exit.begin()
from benchmarks.traffic import End, RESULTS, motion
from mechanism_sim.messages import Motion, serialize
end = End('source')
publisher = end.node.create_publisher(Motion, 'motion', RESULTS)
data = bytes(serialize(motion(0, 192)))
end.expect(publisher.get_subscription_count)
print('publishing', flush=True)
with process_exit.working():
    while True:
        publisher.publish(data)
"""


@pytest.mark.slow
def test_a_subscriber_that_does_not_read_is_named_and_the_run_can_be_ended(tmp_path):
    """One line after two seconds says which topic waits for which node; SIGINT ends the run."""
    env = environment()
    with program(tmp_path / 'sleeper.py', SLEEPER, env) as sleeper:
        assert sleeper.stdout
        assert sleeper.stdout.readline() == 'listening\n'
        source = subprocess.Popen(
            [sys.executable, str(script(tmp_path / 'blocked.py', BLOCKED))],
            env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        try:
            assert source.stdout
            assert source.stderr
            assert source.stdout.readline() == 'publishing\n'
            sleeper.send_signal(signal.SIGSTOP)
            line = source.stderr.readline()
            assert line.startswith("mechanism-sim: topic '/motion' has waited 2 s for a sub")
            assert '/sleeper' in line
            source.send_signal(signal.SIGINT)
            assert source.wait(TIMEOUT) == 130
            assert source.stderr.read() == 'mechanism-sim: interrupted\n'
        finally:
            sleeper.send_signal(signal.SIGCONT)
            source.kill()
            source.communicate()
