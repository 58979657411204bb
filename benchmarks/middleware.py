"""Cost of nodes on every middleware found here: messages, round trips and whole runs.

Each measurement has real processes on loopback, with a router port and a domain of their own;
`traffic` is what runs in them.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from mechanism_sim.errors import RunError

SCENE = 'four_bar_clearance'
BURSTS = {'bytes': 20_000, 'JointState': 10_000, 'SensorBlock': 5_000, 'Motion': 2_000}
"""Messages of each burst."""

ROUNDS = 3_000
CREDITS, STEP = 500, 1e-3
REVOLUTIONS = 20, 220
RUNS = 3
"""At most so many repeats of a whole run."""

TRAFFIC = 'benchmarks.traffic'
_ROOT = str(Path(__file__).parents[1])  # where processes find it: it is not installed

WAIT = 600.0
"""[s] after which a measurement has failed."""


@dataclass(frozen=True)
class Stream:
    """Throughput of one kind of message between two processes.

    Attributes
    ----------
    method : the back end
    rate, fastest : messages per second, the median of the repeats and the best
    cpu_source, cpu_sink : CPU time of each process per message [s], the least of the repeats
    error : messages that were lost or out of order
    """

    method: str
    message: str
    size: int  #: [B]
    count: int  #: of each repeat
    rate: float
    fastest: float
    cpu_source: float
    cpu_sink: float
    error: int


@dataclass(frozen=True)
class Delay:
    """Time of a message to another process, and of the answer back.

    Attributes
    ----------
    median, p99 : wall time [s]
    alone : [s] median of what the work in the other process takes by itself
    cpu_per_unit : [s] CPU time of both processes, if it was measured
    """

    method: str
    what: str
    count: int
    median: float
    p99: float
    alone: float
    cpu_per_unit: float | None
    error: int


@dataclass(frozen=True)
class WholeRun:
    """A run of the scene.

    Attributes
    ----------
    arrangement : of the nodes in processes
    cpu, wall : of the shorter run, start of all processes included [s]: least and median
    cpu_per_unit : CPU time of a revolution [s], by the difference of two lengths
    realtime_factor : simulated seconds per second of wall time, by the same difference
    sent : messages of the shorter run; 0 for the library
    error : messages that are missing in the bag; None without one
    digest : of the shorter run's motion and impacts; None without a bag
    """

    method: str
    arrangement: str
    revolutions: int
    cpu: float
    wall: float
    cpu_per_unit: float
    realtime_factor: float
    sent: int
    error: int | None
    digest: str | None


Figure = Stream | Delay | WholeRun

ARRANGEMENTS: dict[str, tuple[str, ...]] = {
    'all in one process': (),
    'all in one process, recorded': ('--record',),
    'the same, joint_states at 1 kHz': ('--record', '--set', 'outputs.joint_states=1 kHz'),
    'a process each': ('--processes',),
    'a process each, recorded': ('--processes', '--record'),
    'a process each, recorded and displayed': ('--processes', '--record', '--display'),
}


def backends() -> list[str]:
    """Values of ``MECHANISM_SIM_MIDDLEWARE`` for the back ends that are found."""
    ros = all(find_spec(name) for name in ('rclpy', 'mechanism_sim.msg'))
    return ['zenoh', 'rclpy'] if ros else ['zenoh']


def network(backend: str) -> dict[str, str]:
    """Environment of processes on a network of their own."""
    with socket.socket() as free:
        free.bind(('127.0.0.1', 0))
        port = free.getsockname()[1]
    return {
        **os.environ,
        'MECHANISM_SIM_MIDDLEWARE': backend,
        'MECHANISM_SIM_ROUTER': f'tcp/127.0.0.1:{port}',
        'ROS_DOMAIN_ID': str(1 + port % 100),
        'PYTHONPATH': os.pathsep.join(filter(None, (_ROOT, os.environ.get('PYTHONPATH')))),
    }


def middleware(repeats: int, show: Callable[[str], None] = lambda _: None) -> list[Figure]:
    """All figures, on one back end after the other.

    Raises
    ------
    RunError
        If a process of a measurement fails.
    """
    found: list[Figure] = []
    for backend in backends():
        for name, count in BURSTS.items():
            show(f'middleware: {name} on {backend}')
            found.append(stream(backend, name, count, repeats))
        show(f'middleware: round trips on {backend}')
        found += [round_trip(backend, ROUNDS), credit_round(backend, CREDITS)]
    found += whole_runs(min(repeats, RUNS), show)
    return found


def stream(backend: str, name: str, count: int, repeats: int) -> Stream:
    """Bursts of messages from one process to another."""
    sent, taken = _run_processes(
        backend, *((TRAFFIC, role, name, count, repeats) for role in ('source', 'sink'))
    )
    rates = taken['rates']
    return Stream(
        sent['method'], name, sent['size'], count, median(rates), max(rates), min(sent['cpu']),
        min(taken['cpu']), taken['lost'] + taken['disorder'],
    )  # fmt: skip


def round_trip(backend: str, count: int) -> Delay:
    """200 B to another process and back."""
    found, other = _run_processes(backend, (TRAFFIC, 'ping', count), (TRAFFIC, 'echo', count))
    low, high = np.quantile(found['times'], [0.5, 0.99])
    cpu = found['cpu'] + other['cpu']
    return Delay(found['method'], '200 B and back', count, low, high, 0.0, cpu, found['lost'])


def credit_round(backend: str, count: int) -> Delay:
    """Delay from a law of the drive to the motion that a linkage elsewhere makes of it."""
    linkage = ('mechanism_sim', 'node', 'linkage', '--scene', SCENE, '--partners', 'crank_drive')
    found, _ = _run_processes(
        backend, (TRAFFIC, 'credit', SCENE, count), (*linkage, '--duration', count * STEP)
    )
    low, high = np.quantile(found['times'], [0.5, 0.99])
    alone = median(found['alone'])
    return Delay(found['method'], 'law to motion', count, low, high, alone, None, found['lost'])


def whole_runs(repeats: int, show: Callable[[str], None] = lambda _: None) -> Iterator[WholeRun]:
    """The scene by the library alone, and as nodes in all arrangements on all back ends.

    Raises
    ------
    RunError
        If a run fails.
    """
    show('middleware: the library alone')
    zenoh = network('zenoh')
    yield _whole_run('no middleware', 'library alone', repeats, ('solve', '--no-events'), zenoh)
    for backend in backends():
        for arrangement, options in ARRANGEMENTS.items():
            show(f'middleware: {arrangement}, on {backend}')
            yield _whole_run(backend, arrangement, repeats, ('run', *options), network(backend))


def _whole_run(
    method: str, arrangement: str, repeats: int, words: Sequence[str], env: dict[str, str]
) -> WholeRun:
    command, *options = words
    short, long = REVOLUTIONS
    times: dict[int, list[tuple[float, float]]] = {short: [], long: []}
    results: dict[str, Any] = {}
    with TemporaryDirectory() as folder:
        bag = str(Path(folder) / 'run.mcap')
        if '--record' in options:
            options += ['--overwrite']
            options.insert(options.index('--record') + 1, bag)
        for _ in range(repeats):
            for revolutions in (long, short):  # the bag that stays is that of the short one
                line = (command, SCENE, '--json', '--revolutions', str(revolutions), *options)
                *taken, results = _time_command(line, env)
                times[revolutions].append((taken[0], taken[1]))
        read: dict[str, Any] = {}
        if '--record' in options:
            *_, read = _time_command(('analyze', bag, '--json'), env)
    cpu = {n: min(t[0] for t in pairs) for n, pairs in times.items()}
    wall = median(t[1] for t in times[short])
    took = min(t[1] for t in times[long]) - min(t[1] for t in times[short])
    simulated = results['duration'] / short * (long - short)
    return WholeRun(
        results.get('middleware', method), arrangement, short, cpu[short], wall,
        (cpu[long] - cpu[short]) / (long - short), simulated / took,
        sum(results.get('sent', {}).values()),
        read['ledger']['lost'] if read else None,
        read['digest'] if read else results.get('digest'),
    )  # fmt: skip


def _time_command(
    words: Sequence[str], env: dict[str, str]
) -> tuple[float, float, dict[str, Any]]:
    """CPU and wall time [s] of a command with its children, and the JSON that it prints."""
    began = time.perf_counter()
    child = _start(('mechanism_sim', *words), env)
    assert child.stdout is not None  # noqa: S101 - it is a pipe
    with child.stdout as out:
        text = out.read()
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    wall = time.perf_counter() - began
    if child.returncode:
        raise RunError(f'{" ".join(map(str, words))} ended with code {child.returncode}')
    return used.ru_utime + used.ru_stime, wall, json.loads(text)


def _run_processes(backend: str, *ends: Sequence[object]) -> list[dict[str, Any]]:
    """Run processes on one network; the JSON that each prints, nothing if it is none."""
    env = network(backend)
    children = [_start(words, env) for words in ends]
    try:
        results = [child.communicate(timeout=WAIT)[0] for child in children]
    except subprocess.TimeoutExpired as late:
        raise RunError(f'a measurement on {backend} did not end within {WAIT:g} s') from late
    finally:
        for child in children:
            child.kill()
    for child, words in zip(children, ends, strict=True):
        if child.returncode:
            raise RunError(f'{" ".join(map(str, words))} on {backend} failed')
    return [json.loads(text) if text.startswith('{') else {} for text in results]


def _start(words: Sequence[object], env: dict[str, str]) -> subprocess.Popen[str]:
    module, *rest = map(str, words)
    return subprocess.Popen(  # noqa: S603 - our own modules
        [sys.executable, '-m', module, *rest], env=env, stdout=subprocess.PIPE, text=True
    )
