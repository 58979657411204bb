"""One end of a line between two nodes: a process that `middleware` starts and reads.

``python -m benchmarks.traffic ROLE ...`` joins the network as its environment says and
writes what it measured to standard output, as JSON.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from mechanism_sim.errors import RunError
from mechanism_sim.messages import (
    DriveLaw,
    JointState,
    Motion,
    Progress,
    SensorBlock,
    String,
    float64_array,
    int64_array,
    serialize,
)
from mechanism_sim.nodes.middleware import (
    HistoryPolicy,
    Node,
    QoSProfile,
    SingleThreadedExecutor,
    backend,
    init,
    leave,
)

RESULTS = QoSProfile(history=HistoryPolicy.KEEP_ALL, depth=1000)
"""As the nodes publish results: reliable, and the publisher waits."""

PATIENCE = 60.0
"""[s] for anything that has to happen."""

STEP = 1e-3
"""[s] by which the law of a drive is extended in each round of credit."""


def joint_states(i: int) -> Any:
    """JointState of four joints, 200 B."""
    names = ['crank', 'coupler', 'rocker', 'follower']
    message = JointState(name=names)
    message.header.stamp.sec = i
    for field in ('position', 'velocity', 'effort'):
        setattr(message, field, float64_array(np.full(4, float(i))))
    return message


def motion(i: int, m: int = 64) -> Any:
    """Motion of m segments of three coordinates of degree 19; 64 of them are 32 kB."""
    n, d = 3, 19
    message = Motion(run=i, coordinates=['crank', 'coupler', 'rocker'], segments=m, degree=d)
    message.coefficients = float64_array(np.full(m * n * (d + 1), float(i)))
    message.turns = int64_array(np.full(m * n, i))
    for field in ('start', 'start_low', 'duration'):
        setattr(message, field, float64_array(np.full(m, float(i))))
    return message


def block(i: int) -> Any:
    """SensorBlock of 256 samples, 2 kB."""
    return SensorBlock(time=float(i), samples=float64_array(np.full(256, float(i))))


STREAMS: dict[str, tuple[Any, bool, Callable[[int], Any], Callable[[Any], int]]] = {
    'bytes': (JointState, True, lambda i: serialize(joint_states(i)), lambda _: -1),
    'JointState': (JointState, False, joint_states, lambda m: m.header.stamp.sec),
    'SensorBlock': (SensorBlock, False, block, lambda m: int(m.time)),
    'Motion': (Motion, False, motion, lambda m: int(m.run)),
}
"""What is sent: type, whether both ends take bytes, how the ith is made, and its number."""


class End:
    """A node with an executor, and what it has spent."""

    def __init__(self, name: str) -> None:
        init([])
        self.node = Node(name)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)

    def until(self, condition: Callable[[], bool]) -> bool:
        """Spin until a condition comes true, looked at after each callback; False: in vain."""
        end = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > end:
                return False
            self._executor.spin_once(0.1)
        return True

    def expect(self, condition: Callable[[], object]) -> None:
        """Spin until the others are there. RunError if they never are."""
        if not self.until(lambda: bool(condition())):
            raise RunError('the other end never came')

    def done(self, **found: object) -> None:
        """Tell what was found, and leave."""
        print(json.dumps({'method': _label()} | found), flush=True)
        leave([self.node])


def _label() -> str:
    """The back end, and what lies under it."""
    if backend() == 'zenoh':
        return 'zenoh'
    from rclpy.utilities import get_rmw_implementation_identifier  # noqa: PLC0415 - is in ROS

    return f'rclpy on {get_rmw_implementation_identifier()}'


def source(name: str, count: int, repeats: int) -> None:
    """Publish `repeats` bursts of `count` messages; the next once the last is taken in."""
    kind, _, make, _ = STREAMS[name]
    end, taken = End('source'), list[Any]()
    end.node.create_subscription(String, 'taken', taken.append, RESULTS)
    publisher = end.node.create_publisher(kind, 'data', RESULTS)
    end.expect(publisher.get_subscription_count)
    cpu, first = [], make(0)
    size = len(first if isinstance(first, bytes) else serialize(first))
    for burst in range(repeats):
        messages = [make(i) for i in range(count)]
        began = time.process_time()
        for message in messages:
            publisher.publish(message)
        end.until(lambda burst=burst: len(taken) > burst)  # type: ignore[misc]
        cpu.append((time.process_time() - began) / count)
    end.done(cpu=cpu, size=size)


def sink(name: str, count: int, repeats: int) -> None:
    """Take in what `source` publishes: rates, CPU times, and how many were not the next."""
    kind, raw, _, number = STREAMS[name]
    end, times, wrong = End('sink'), list[tuple[float, float]](), [0]

    def take(message: Any) -> None:
        n = number(message)
        wrong[0] += n not in (-1, len(times) % count)
        times.append((time.perf_counter(), time.process_time()))

    end.node.create_subscription(kind, 'data', take, RESULTS, raw=raw)
    publisher = end.node.create_publisher(String, 'taken', RESULTS)
    rates, cpu = [], []
    for burst in range(1, repeats + 1):
        end.until(lambda burst=burst: len(times) >= burst * count)  # type: ignore[misc]
        part = np.array(times[(burst - 1) * count : burst * count])
        if len(part) > 1:
            wall, spent = (part[-1] - part[0]) / (len(part) - 1)
            rates.append(1.0 / wall)
            cpu.append(spent)
        publisher.publish(String(data=str(burst)))
    end.done(rates=rates, cpu=cpu, lost=count * repeats - len(times), disorder=wrong[0])


def ping(count: int) -> None:
    """Send 200 B to and fro, one message at a time, twice: the second time counts."""
    end, back = End('ping'), list[bytes]()
    end.node.create_subscription(JointState, 'pong', back.append, RESULTS, raw=True)
    publisher = end.node.create_publisher(JointState, 'ping', RESULTS)
    end.expect(lambda: publisher.get_subscription_count() and end.node.count_publishers('pong'))
    data, times = serialize(joint_states(0)), []
    for i in range(2 * count):
        if i == count:
            began = time.process_time()
        sent = time.perf_counter()
        publisher.publish(data)
        end.until(lambda i=i: len(back) > i)  # type: ignore[misc]
        times.append(time.perf_counter() - sent)
    cpu = (time.process_time() - began) / count
    end.done(times=times[count:], cpu=cpu, lost=2 * count - len(back))


def echo(count: int) -> None:
    """Send back what comes."""
    end, spent = End('echo'), []

    def answer(data: bytes) -> None:
        spent.append(time.process_time())
        publisher.publish(data)

    publisher = end.node.create_publisher(JointState, 'pong', RESULTS)
    end.node.create_subscription(JointState, 'ping', answer, RESULTS, raw=True)
    end.until(lambda: len(spent) == 2 * count)
    end.done(cpu=(spent[-1] - spent[count]) / (count - 1))


def credit(scene: str, count: int) -> None:
    """Be the drive of a real integrator: extend the law by `STEP`, and wait for the motion.

    Told beside it are the times [s] that the integration takes by itself.
    """
    # The other ends need no machine, and start sooner without.
    from mechanism_sim.messages.events import drive_law  # noqa: PLC0415
    from mechanism_sim.scene import load_scene  # noqa: PLC0415

    machine, end = load_scene(scene), End('crank_drive')
    node, law = end.node, machine.drive.laws[0]
    motions, seen = list[Any](), list[Any]()
    node.create_subscription(Motion, 'motion', motions.append, RESULTS)
    node.create_subscription(Progress, 'progress', seen.append, RESULTS)
    drive = node.create_publisher(DriveLaw, 'drive', RESULTS)
    progress = node.create_publisher(Progress, 'progress', RESULTS)
    run, alone, times = machine.start(law), [], []
    for i in range(1, count + 1):
        began = time.perf_counter()
        run.advance(i * STEP, i == count)
        run.drain()
        alone.append(time.perf_counter() - began)
    end.expect(lambda: node.count_publishers('progress') > 1 and drive.get_subscription_count())
    for i in range(1, count + 1):
        until, sent = i * STEP, time.perf_counter()
        drive.publish(drive_law(law, 1, until, i == count, until - STEP))
        end.until(lambda i=i: len(motions) >= i)  # type: ignore[misc]
        times.append(time.perf_counter() - sent)
    end.expect(lambda: any(m.finished for m in seen))
    progress.publish(Progress(node='crank_drive', time=until, finished=True))
    end.done(times=times, alone=alone, lost=count - len(motions))


ROLES: dict[str, Callable[..., None]] = {
    'source': source, 'sink': sink, 'ping': ping, 'echo': echo, 'credit': credit,
}  # fmt: skip

if __name__ == '__main__':
    role, *arguments = sys.argv[1:]
    ROLES[role](*(int(text) if text.isdigit() else text for text in arguments))
