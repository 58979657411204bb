"""A whole run: the nodes of a scene, in this process or each in its own, and their monitor."""

from __future__ import annotations

import glob
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mechanism_sim import process_exit
from mechanism_sim.messages.part_states import integrator_of, kinds_of
from mechanism_sim.messages.topics import topics_of
from mechanism_sim.nodes.classes import node_class
from mechanism_sim.nodes.middleware import Parameter, backend
from mechanism_sim.nodes.pace import BEHIND
from mechanism_sim.nodes.process import report_end, run_nodes
from mechanism_sim.nodes.qos import PROFILES, RESULTS, policies
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.recording.runs import next_bag, realtime_factor
from mechanism_sim.scene import Machine
from mechanism_sim.units import counted

if TYPE_CHECKING:
    import subprocess

Show = Callable[[float, float, int], None]
"""Called with simulated time [s], real-time factor and number of impacts so far."""

MONITOR = 'monitor'
"""The node of a run that shows how far it is."""

_START_PATIENCE = 120.0
"""[s] nodes wait for each other if this process has started them: it notices failures."""

_END_PATIENCE = 15.0
"""[s] other processes get to end by themselves once one has failed or the run is interrupted."""

LOOK = 0.02
"""[s] between looks whether processes still run."""


@dataclass(frozen=True)
class NodePlan:
    """Plan of a run."""

    machine: Machine
    scene: str  #: name or path of the scene, as given
    overrides: Sequence[str]  #: ``PATH=VALUE`` each
    duration: float  #: length of the run [s]
    record: str | None = None  #: bag to write, if any
    overwrite: bool = False
    realtime_factor: float = 0.0
    paused: bool = False  #: begin paused, to be played or stepped by services of the drive
    hold: bool = False  #: pause at the end instead of ending
    #: ``--ros-args ...``: names, remaps and parameters in the syntax of ROS
    ros_args: Sequence[str] = ()
    display: bool = False  #: publish topics for viewers
    listeners: Sequence[str] = ()  #: other nodes that must receive all messages

    @property
    def nodes(self) -> list[str]:
        """Names of the nodes the scene needs."""
        integrator = integrator_of(self.machine)
        parts = [name for name in kinds_of(self.machine) if name != integrator]
        names = ['crank_drive', integrator, *parts]
        names += ['oscillator'] if self.machine.scene.oscillators else []
        names += ['sensors'] if self.machine.scene.sensors else []
        names += ['display'] if self.display else []
        return [*names, 'recorder'] if self.record else names

    def options(self, node: str) -> dict[str, Any]:
        """Parameters of a node of this run; others are left to files of parameters."""
        options = {
            'scene': self.scene,
            'duration': self.duration,
            'partners': [n for n in self.nodes if n != node],
            'partner_timeout': _START_PATIENCE,
        }
        asked: dict[str, Any] = {
            'overrides': list(self.overrides),
            'listeners': list(self.listeners),
        }
        if node == 'crank_drive':
            asked |= {name: getattr(self, name) for name in ('realtime_factor', 'paused', 'hold')}
        if node == 'recorder':
            asked |= {'file': self.record, 'overwrite': self.overwrite}
        return options | {name: value for name, value in asked.items() if value}

    def to_json(self) -> dict[str, object]:
        """The nodes with their parameters, and the topics with their quality of service."""
        topics = topics_of(self.machine, self.display)
        profiles = {topic.name: PROFILES[topic.delivery] for topic in topics}
        qualities = {name: policies(x) for name, x in (profiles | {'progress': RESULTS}).items()}
        return {
            'duration': self.duration,
            'nodes': {node: self.options(node) for node in self.nodes},
            'topics': {
                name: {
                    'history': qos.history,
                    'depth': qos.depth,
                    'reliability': qos.reliability,
                    'durability': qos.durability,
                }
                for name, qos in qualities.items()
            },
        }

    def parameters(self, node: str) -> list[Parameter]:
        """Options of a node as parameters of the middleware."""
        return [Parameter(key, value=value) for key, value in self.options(node).items()]


@dataclass(frozen=True)
class Outcome:
    """Result of a run with nodes."""

    code: int
    scene: str
    level: str
    duration: float  #: simulated time [s]; this and all below of the last run after resets
    wall_time: float  #: wall time [s] from the start of the first process to the end of the last
    run_time: float  #: wall time [s] from the first message to the last: by the bag, if any
    realtime_factor: float  #: simulated time over `run_time`
    realtime_factor_asked: float  #: requested factor; 0 for no limit
    impacts: int
    sent: dict[str, int]  #: messages by topic, counted by all nodes but the recorder
    bag: str | None  #: path of the bag of the last run
    earlier_bags: list[str]  #: paths of bags of runs ended by a reset
    middleware: str  #: 'rclpy' or 'zenoh'

    def to_json(self) -> dict[str, object]:
        """Result as a plain dictionary."""
        return asdict(self)

    def text(self) -> str:
        """The closing lines of a run."""
        asked = self.realtime_factor_asked
        behind = f'instead of {asked:g} ' if self.realtime_factor < BEHIND * asked else ''
        lines = [
            f'{self.scene} ({self.level}): {self.duration:.6g} s simulated in '
            f'{self.run_time:.3g} s, {self.realtime_factor:.3g} x real time '
            f'{behind}({self.wall_time:.3g} s including start-up and shutdown)',
            f'  {counted(self.impacts, "impact")}, {counted(sum(self.sent.values()), "message")}',
        ]
        if self.bag:
            lines.append(f'  recorded in {self.bag}')
        if self.earlier_bags:
            lines.append(f'  runs before the last reset: {", ".join(self.earlier_bags)}')
        return '\n'.join(lines)


def run(plan: NodePlan, processes: bool, show: Show | None = None) -> Outcome:
    """Carry out a run; `processes`: each node in a process of its own."""
    made = {} if processes else {name: node_class(name) for name in plan.nodes}
    began = time.monotonic()
    first = Path(plan.record) if plan.record else None
    taken: set[Path] = set()  # names not available for bags of later runs
    if first and not plan.overwrite:
        taken |= {*first.parent.glob(f'{glob.escape(first.stem)}-*')}
    monitors: list[Monitor] = []

    def watch() -> Monitor:
        # First the network, with its router, then its nodes.
        monitors.append(Monitor(plan.parameters(MONITOR), show))
        # Nodes of another run could be taken for these before these are present.
        while not monitors[0].partners.came_first():
            time.sleep(LOOK)
        return monitors[0]

    if processes:
        code = _in_processes(plan, watch)
    else:
        code = run_nodes(
            lambda: [watch(), *(node(plan.parameters(name)) for name, node in made.items())],
            ros_args=plan.ros_args,
        )
    monitor = monitors[0] if monitors else None
    sent: dict[str, int] = {}
    for message in monitor.partners.reports.values() if monitor else ():
        if message.node == 'recorder':
            continue  # the recorder's own reports, which are in no bag
        for topic, count in zip(message.topics, message.counts, strict=True):
            sent[topic] = sent.get(topic, 0) + int(count)
    simulated, took = (monitor.time, monitor.run_time) if monitor else (0.0, 0.0)
    bags = [first] if first else []
    for number in range(1, monitor.run + 1 if first and monitor else 1):
        bags.append(next_bag(bags[0], number, taken.__contains__))
        taken.add(bags[-1])
    if bags and code == 0:
        from mechanism_sim.recording.reader import read_bag  # noqa: PLC0415 - a run may have no bag

        took = read_bag(bags[-1]).wall_time or took
    return Outcome(
        code,
        plan.machine.name,
        plan.machine.level.value,
        simulated,
        time.monotonic() - began,
        took,
        realtime_factor(simulated, took) or 0.0,
        plan.realtime_factor,
        monitor.impacts if monitor else 0,
        sent,
        str(bags[-1]) if bags else None,
        [str(bag) for bag in bags[:-1]],
        backend(),
    )


class _Children:
    """The processes of the nodes."""

    def __init__(self, plan: NodePlan) -> None:
        self.code, self._bag = 0, Path(plan.record) if plan.record else None
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        for name in plan.nodes:
            command = [sys.executable, '-m', 'mechanism_sim', 'node', name]
            # The monitor is no partner, but must receive the end of each node.
            listeners = [*plan.listeners, f'{MONITOR}:progress']
            for key, value in (plan.options(name) | {'listeners': listeners}).items():
                option = f'--{key.replace("_", "-")}'
                if key == 'overrides':
                    command += [part for text in plan.overrides for part in ('--set', text)]
                elif value is True:
                    command.append(option)
                elif value is not False:
                    command += [option, ','.join(value) if isinstance(value, list) else str(value)]
            self._processes[name] = process_exit.start([*command, *plan.ros_args])
        self._deadline: float | None = None
        self._next_look = 0.0

    def running(self) -> bool:
        """True if any still runs; the failure of one ends all others."""
        now = time.monotonic()
        if now < self._next_look:
            return True
        self._next_look = now + LOOK
        codes = {name: process.poll() for name, process in self._processes.items()}
        failed = {name: code for name, code in codes.items() if code}
        if failed and not self.code:
            self.interrupt(report_end(*next(iter(failed.items())), self._bag))
        if self._deadline is not None and now > self._deadline:
            for process in self._processes.values():
                process.kill()
        return None in codes.values()

    def interrupt(self, code: int) -> None:
        """Signal all to end, for a reason with this exit code."""
        self.code = self.code or code
        self._deadline = self._deadline or time.monotonic() + _END_PATIENCE
        for process in self._processes.values():
            if process.poll() is None:
                process.terminate()

    def wait(self) -> None:
        """Wait until all have ended."""
        while self.running():
            time.sleep(LOOK)


def _in_processes(plan: NodePlan, watch: Callable[[], Monitor]) -> int:
    monitors: list[Monitor] = []
    children: list[_Children] = []

    def make() -> list[Monitor]:
        monitors.append(watch())
        children.append(_Children(plan))
        return monitors

    def running() -> bool:
        return children[0].running() or not monitors[0].idle()

    def stop(code: int) -> None:
        for started in children:
            started.interrupt(code)

    code = run_nodes(make, running, plan.ros_args, stop)
    for started in children:
        started.wait()
        code = code or started.code
    return code


class Monitor(SimulationNode):
    """Monitor of the progress of all partners; no node waits for it."""

    def __init__(self, parameters: Sequence[Parameter] = (), show: Show | None = None) -> None:
        super().__init__('monitor', parameters)
        self.time = 0.0  #: time reached by every partner [s]
        self.impacts = 0  #: number of impacts published so far
        self.run_time = 0.0  #: wall time since the first progress of the run [s]
        self._show = show
        self._shown = 0.0
        self._heard = time.monotonic()
        self.partners.show_start()
        self.join()

    def on_progress(self, message: Any) -> None:
        """Show the progress of a partner."""
        if message.run > self.run:
            self.begin_run(message.run)
            self.impacts = 0
        self._heard = now = time.monotonic()
        self.run_time = now - (self.first_heard or now)
        self.time = min(self.partners.time, self.duration)
        counts = dict(zip(message.topics, message.counts, strict=True))
        impacts = self.resolve_topic_name('impacts')
        self.impacts = int(counts.get(impacts, self.impacts))
        self.done = self.partners.finished and not self.partners.another_follows
        if self._show and (self.done or now - self._shown > 0.1):
            self._shown = now
            factor = realtime_factor(self.time, self.run_time) or 0.0
            self._show(self.time, factor, self.impacts)

    def idle(self) -> bool:
        """True if no more reports are expected: all received, or none for 1 s."""
        return self.done or time.monotonic() - self._heard > 1.0
