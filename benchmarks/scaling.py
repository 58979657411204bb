"""Cost of this package over the size of the machine, of its output, and of the run."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np

from benchmarks.chains import SPEED, chain
from mechanism_sim import process_exit
from mechanism_sim.errors import RunError
from mechanism_sim.results.run import prepare
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine, load_scene

RATES = (1e3, 1e4, 1e5)
SENSORS = (0, 1, 2, 4, 8)
DYADS = (1, 2, 3, 4, 6, 9)
TURNS = 3
LENGTHS = (10, 100, 500)
STREAMED = (20, 100)
REPEATS = 3
CLEARANCE = {'radial': 2.54e-4, 'restitution': 0.5}
MODES = (1, 2, 4, 6)
LOOSE = ('coupler_rocker', 'crank_coupler', 'rocker_ground', 'ground_crank')


@dataclass(frozen=True)
class Cost:
    """One point of a family.

    Attributes
    ----------
    family : what varies
    size : of it
    cpu_per_unit : [s]
    unit : what the time counts
    peak_memory : [B] that Python and NumPy held at most, or that a process held at most in the
        families that run nodes
    """

    family: str
    size: float
    cpu_per_unit: float
    unit: str
    peak_memory: int | None = None


def scaling(show: Callable[[str], None] = lambda _: None) -> list[Cost]:
    """All families, one after the other."""
    found = []
    for family in (_links, _elastic, _sample_rates, _sensors, _lengths, _streams):
        for cost in family():
            show(f'{cost.family} {cost.size:g}: {cost.cpu_per_unit:.3g} s per {cost.unit}')
            found.append(cost)
    return found


def _cpu(work: Callable[[], Any]) -> float:
    """Least CPU time of a few repeats [s]."""
    times = []
    for _ in range(REPEATS):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return min(times)


def _loose() -> Machine:
    machine = load_scene('four_bar_clearance')
    prepare(machine)
    return machine


def _links() -> Iterator[Cost]:
    """CPU time of a revolution, and of getting ready, by the number of links with the ground.

    Where a machine gets ready, its equations are built and compiled, here without the code that
    heyoka keeps on disk: so dear it is only the first time on a computer.
    """
    free = {'drive': {'speed': SPEED, 'torque': {}}}
    from_disk = hy.llvm_state.get_diskcache_enabled()
    hy.llvm_state.set_diskcache_enabled(False)
    for name, change in (
        ('positions only', {'outputs': {'forces': False}}),
        ('all forces', {}),
        ('equations of motion, free crank', free),
        ('equations of motion, one loose joint', None),
    ):
        ready: list[Cost] = []
        for dyads in DYADS:
            last = f'coupler_{dyads}_rocker_{dyads}'
            hy.llvm_state.clear_memcache()
            began = time.process_time()
            machine = chain(dyads, **({} if change is None else change))
            if change is None:
                content = machine.scene.to_document(exclude_unset=True)
                joint = {**content['joints'][last], 'clearance': CLEARANCE}
                machine = chain(dyads, joints=content['joints'] | {last: joint})
            prepare(machine)
            ready.append(Cost(f'links, {name}: getting ready', 2 * dyads + 2,
                              time.process_time() - began, 'machine'))  # fmt: skip
            duration = TURNS * machine.drive.period
            cpu = _cpu(lambda m=machine, t=duration: simulate(m, duration=t))  # type: ignore[misc]
            yield Cost(f'links, {name}', 2 * dyads + 2, cpu / TURNS, 'revolution')
        yield from ready
    hy.llvm_state.set_diskcache_enabled(from_disk)


def _elastic() -> Iterator[Cost]:
    """CPU time of a revolution by the modes of coupler and rocker, and by loose joints."""
    rubbing = CLEARANCE | {'friction': 0.1, 'pin_radius': 6e-3}
    for n in MODES:
        cpu = _bent(n, dict.fromkeys(LOOSE[:1], CLEARANCE))
        yield Cost('modes of two elastic links each, one loose joint', n, cpu, 'revolution')
    for n in range(1, len(LOOSE) + 1):
        cpu = _bent(2, dict.fromkeys(LOOSE[:n], rubbing))
        yield Cost('loose joints with friction, two modes of two links', n, cpu, 'revolution')


def _bent(modes: int, loose: Mapping[str, Any]) -> float:
    """CPU time of a revolution [s]."""
    changes = {f'links.{link}.elastic.modes': modes for link in ('coupler', 'rocker')}
    machine = load_scene(
        'four_bar_elastic', changes | {f'joints.{x}.clearance': play for x, play in loose.items()}
    )
    prepare(machine)
    return _cpu(lambda: simulate(machine, revolutions=TURNS)) / TURNS


def _sample_rates() -> Iterator[Cost]:
    """CPU time of sampling everything over a revolution, beyond that of solving."""
    solution = simulate(_loose(), revolutions=1)
    for rate in RATES:
        t = np.arange(0.0, solution.duration, 1.0 / rate)
        cpu = _cpu(lambda t=t: solution.sample(t))  # type: ignore[misc]
        yield Cost('sample rate [Hz], all columns of solve --output', rate, cpu,
                   'revolution')  # fmt: skip


def _lengths() -> Iterator[Cost]:
    """CPU time of a revolution and peak memory of a run that keeps all of its motion."""
    machine = _loose()
    for revolutions in LENGTHS:
        cpu = simulate(machine, revolutions=revolutions).stats.cpu_time
        tracemalloc.start()
        simulate(machine, revolutions=revolutions)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        yield Cost('revolutions, all motion kept', revolutions, cpu / revolutions, 'revolution',
                   peak)  # fmt: skip


def _nodes(revolutions: int, *options: str) -> tuple[float, int]:
    """CPU time [s] and peak memory [B] of a process that runs the scene as nodes."""
    with socket.socket() as free:
        free.bind(('127.0.0.1', 0))
        router = f'tcp/127.0.0.1:{free.getsockname()[1]}'
    command = [sys.executable, '-m', 'mechanism_sim', 'run', 'four_bar_clearance', '--json',
               '--revolutions', str(revolutions), *options]  # fmt: skip
    env = os.environ | {'MECHANISM_SIM_ROUTER': router}
    child = process_exit.start(command, stdout=subprocess.DEVNULL, env=env)
    peak = 0
    while True:
        peak = max(peak, peak_memory(child.pid))
        done, status, used = os.wait4(child.pid, os.WNOHANG)
        if done:
            break
        time.sleep(0.02)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise RunError(f'{" ".join(command)} ended with code {child.returncode}')
    return used.ru_utime + used.ru_stime, peak


def peak_memory(pid: int) -> int:
    """Peak memory of a running process [B]; its rusage would count ours before exec."""
    status = Path(f'/proc/{pid}/status').read_text(encoding='utf-8')
    sizes = [line.split()[1] for line in status.splitlines() if line.startswith('VmHWM')]
    return 1024 * int(sizes[0]) if sizes else 0


def _sensors() -> Iterator[Cost]:
    """CPU time of a revolution as nodes, by accelerometers at 10 kHz; start-up left out."""
    for count in SENSORS:
        sensors = {
            f'a{i}': {'link': 'rocker', 'at': f'{100 + 20 * i} mm', 'axis': 'across',
                      'sample_rate': '10 kHz'}
            for i in range(count)
        }  # fmt: skip
        option = ('--set', f'sensors={json.dumps(sensors)}')
        short, long = (_nodes(n, *option) for n in STREAMED)
        cpu = (long[0] - short[0]) / (STREAMED[1] - STREAMED[0])
        yield Cost('accelerometers at 10 kHz, as nodes', count, cpu, 'revolution', long[1])


def _streams() -> Iterator[Cost]:
    """CPU time of a revolution and peak memory of a run as nodes, which keeps nothing."""
    for revolutions in STREAMED:
        cpu, peak = _nodes(revolutions)
        yield Cost('revolutions, as nodes, start-up included', revolutions, cpu / revolutions,
                   'revolution', peak)  # fmt: skip
