"""Programs beside a run: one that operates it, one that hears it by Zenoh alone."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from running import TIMEOUT, environment, script, start

import mechanism_sim as ms

CONTROL = """
import json
from mechanism_sim.messages import action_class, message_class, service_class
from mechanism_sim.nodes.middleware import (
    ActionClient, Node, Parameter, QoSProfile, init, shutdown, spin_until_future_complete)

PACKAGE = 'simulation_interfaces'
State = message_class(f'{PACKAGE}/msg/SimulationState')
init()
node = Node('operator')

def wait(future):
    spin_until_future_complete(node, future, timeout_sec=300)
    return future.result()

clients = {}
def call(short, name, /, **fields):
    package = 'rcl_interfaces' if short == 'GetParameters' else PACKAGE
    kind = service_class(f'{package}/srv/{short}')
    client = clients.setdefault(name, node.create_client(kind, name))
    assert client.wait_for_service(300)
    return wait(client.call_async(kind.Request(**fields)))

def step(n):
    answer = call('StepSimulation', 'step_simulation', steps=n).result
    return [answer.result, answer.error_message]

def go(state):
    answer = call('SetSimulationState', 'set_simulation_state', state=State(state=state)).result
    return [answer.result, answer.error_message]

def state():
    return call('GetSimulationState', 'get_simulation_state').state.state

def set_(owner, name, value):
    kind = service_class('rcl_interfaces/srv/SetParameters')
    client = node.create_client(kind, f'{owner}/set_parameters')
    assert client.wait_for_service(300)
    request = kind.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    answer = wait(client.call_async(request)).results[0]
    return [answer.successful, answer.reason]

found = {}
step(1)  # also before the nodes have found each other
"""


def operate(tmp_path: Path, text: str, *args: str, given: Sequence[str] = ()) -> tuple[Any, Path]:
    """Run a scene paused and a program that operates it; what that prints, and the bag.

    What the run says at its end is beside its bag, in ``run.txt``.
    """
    env, bag = environment(), tmp_path / 'run.mcap'
    running = start('run', *args, '--paused', '--hold', '--record', str(bag), env=env)
    try:
        operator = subprocess.run(
            [sys.executable, str(script(tmp_path / 'operate.py', text)), *given],
            env=env, capture_output=True, text=True, timeout=TIMEOUT, check=False,
        )  # fmt: skip
        assert operator.returncode == 0, operator.stderr
        assert running.wait(TIMEOUT) == 0, running.communicate()[1]
    finally:
        running.kill()
        said, _ = running.communicate()
    bag.with_suffix('.txt').write_text(said)
    return json.loads(operator.stdout.splitlines()[-1]), bag


def by_hand(count: int) -> np.ndarray:
    """Speeds [rad/s] of the controlled crank at so many samples, in one process.

    The state at the beginning of a period gives the torque of the next.
    """
    machine = ms.load_scene('four_bar_governed')
    run, law, integral, last = machine.start(), machine.drive.law, 0.0, None
    speeds = []
    for n in range(1, count + 1):
        run.advance(n * 0.005, final=n == count)
        known, *_ = run.drain()
        ahead = run.preview(n * 0.005)
        parts = [p for p in (known, ahead) if p is not None and len(p)]
        curve = parts[0].joined(parts).curve
        now = (n - 1) * 0.005
        k, dt = curve.find(np.array([now]))
        v = float(curve.at(k, dt, 1)[0, 0])
        speeds.append(v)
        step = 0.0 if last is None else now - last
        error = 36.65 - v
        asked = 1.0 * error + integral + 10.0 * error * step
        effort = min(max(asked, -20.0), 20.0)
        integral += 10.0 * error * step if effort == asked else 0.0
        last = now
        if n < count:
            slopes = law.coefficients[1:]
            run.change_law(replace(law, coefficients=(effort, *slopes), valid_from=n * 0.005))
    return np.array(speeds)


FOREIGN = """
import struct, sys, time, zenoh
config = zenoh.Config()
config.insert_json5('mode', '"client"')
config.insert_json5('connect/endpoints', '["%s"]')
session = zenoh.open(config)
domain = %s
tokens, joints = set(), []
watch = session.liveliness().declare_subscriber(
    f'@ros2_lv/{domain}/**', lambda s: tokens.add(str(s.key_expr)), history=True)
def hear(sample):
    data = bytes(sample.payload)
    assert data[:4] == bytes([0, 1, 0, 0])
    assert len(bytes(sample.attachment)) == 33
    sec, nanosec, size = struct.unpack_from('<iII', data, 4)
    at = 16 + size + (-size) %% 4
    (names,) = struct.unpack_from('<I', data, at)
    at += 4
    words = []
    for _ in range(names):
        (length,) = struct.unpack_from('<I', data, at)
        words.append(data[at + 4:at + 3 + length].decode())
        at += 4 + length + (-length) %% 4
    (count,) = struct.unpack_from('<I', data, at)
    at += 4
    at += (4 - at) %% 8
    joints.append((sec + 1e-9 * nanosec, words, struct.unpack_from(f'<{count}d', data, at)))
states = session.declare_subscriber(f'{domain}/joint_states/**', hear)
print('listening', flush=True)
while len(joints) < 20:
    time.sleep(0.05)
kinds = sorted({key.split('/')[5] for key in tokens})
nodes = sorted({key.split('/')[8] for key in tokens if key.split('/')[5] == 'NN'})
print(repr((kinds, nodes, joints[:20])), flush=True)
session.close()
"""
