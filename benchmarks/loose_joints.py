"""Cost of machines with loose joints: whole runs, by the number of these.

Beside other simulators a run can only be so long as its end is well defined: after many impacts a
difference in the last digit has grown to anything, and where one pin strikes while another rests
in its bushing, an impact law has to say what passes between them. So all start with their pins in
the middle, and end as soon as any contact stays closed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from benchmarks.peers import exudyn, mujoco
from benchmarks.problem import OURS, Answer
from benchmarks.tree import Tree
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import RunError
from mechanism_sim.results.run import Solution
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine, load_scene

JOINTS = ('coupler_rocker', 'crank_coupler', 'rocker_ground', 'ground_crank')
CLEARANCE = {'radial': 2.54e-4, 'restitution': 0.5}
FINE = {'radial': 1e-4, 'restitution': 0.5}
FRICTION = {'friction': 0.1, 'pin_radius': 5e-3}


@dataclass(frozen=True)
class LooseCost:
    """Whole calls of `simulate`, with their set-up and audit, of a machine that is compiled.

    Attributes
    ----------
    machine : scene
    loose : how many of its joints
    friction : whether they have any
    cpu : [s] of a revolution
    impacts, events, steps : in a revolution
    """

    machine: str
    loose: int
    friction: bool
    cpu: float
    impacts: float
    events: float
    steps: float

    @property
    def cpu_per_event(self) -> float:
        """CPU time [s] of all that happens between one event and the next."""
        return self.cpu / max(self.events, 1.0)


def _machine(
    scene: str, loose: int, friction: bool, more: Mapping[str, object] = MappingProxyType({})
) -> Machine:
    play = (FINE if scene == 'ten_links' else CLEARANCE) | (FRICTION if friction else {})
    joints: Sequence[str] = JOINTS
    if scene != 'four_bar_clearance':
        content = load_scene(scene).scene.to_document(exclude_unset=True)
        joints = [name for name, joint in content['joints'].items() if 'revolute' in joint]
    overrides = {f'joints.{name}.clearance': play for name in joints[:loose]}
    return load_scene(scene, {**overrides, **more})


PERIODS = {
    'four_bar_clearance': 2.0 * math.pi / 36.6519,
    'slider_crank_engine': 0.02,
    'ten_links': 1.0,
}
"""Of a revolution [s], of the engine at its first speed."""

#: scene, how many joints are loose, revolutions
RUNS = (
    *(('four_bar_clearance', count, 10.0) for count in (1, 2, 3, 4)),
    ('slider_crank_engine', 3, 2.0),
    *(('ten_links', count, 1.0) for count in (4, 8, 13)),
)


def loose_joints(
    repeats: int,
    show: Callable[[str], None] = lambda _: None,
    runs: Sequence[tuple[str, int, float]] = RUNS,
) -> list[LooseCost]:
    """All machines in turn, repeat by repeat; of each the repeat that took least CPU time."""
    machines = {
        (scene, loose, friction): (_machine(scene, loose, friction), revolutions)
        for scene, loose, revolutions in runs
        for friction in (False, True)
    }
    best: dict[tuple[str, int, bool], LooseCost] = {}
    for repeat in range(-1, repeats):
        for key, (machine, revolutions) in machines.items():
            show(f'{key[0]}, {key[1]} loose joints{", friction" * key[2]}')
            began = time.process_time()
            solution = simulate(machine, duration=revolutions * PERIODS[key[0]])
            cpu = (time.process_time() - began) / revolutions
            if repeat < 0 or (key in best and cpu >= best[key].cpu):
                continue  # the first compiles
            best[key] = LooseCost(
                *key, cpu, len(solution.impacts) / revolutions,
                solution.stats.switches / revolutions, solution.stats.steps / revolutions,
            )  # fmt: skip
    return list(best.values())


@dataclass(frozen=True)
class StretchCost:
    """A method on a machine from its start until a contact stays closed.

    Attributes
    ----------
    machine, loose, friction : as of `LooseCost`
    duration, impacts : of the stretch [s], and in it
    method, setting : `OURS` with its rtol, or a peer with that of its settings that errs least
    error : largest of the place of any joint at the end [m]; not a number where it failed
    cpu : [s]
    limited : whether its next setting was left out because it takes more than `LIMIT`
    failure : why there is no answer
    """

    machine: str
    loose: int
    friction: bool
    duration: float
    impacts: int
    method: str
    setting: float
    error: float
    cpu: float
    limited: bool = False
    failure: str = ''


PEERS = (
    (exudyn.PEER, exudyn.prepare_machine, tuple(10.0**k for k in range(6, 15))),
    (mujoco.PEER, mujoco.prepare_machine, (4e3, 20e3, 100e3, 500e3, 2.5e6, 12.5e6)),
)
"""With the settings that are tried."""

LIMIT = 20.0  #: [s] of CPU time that a peer may use at a setting
GROWTH = 4.0  #: how much more the next setting is expected to take
RTOL = 1e-9  #: of our run; the reference has less
REFERENCE, CHECK = 1e-12, 1e-10
DOUBT = 1e-12  #: [m] between the two, at most


def stretches(
    repeats: int,
    show: Callable[[str], None] = lambda _: None,
    runs: Sequence[tuple[str, int, float]] = RUNS,
) -> tuple[list[StretchCost], dict[str, str]]:
    """Every machine by this package and the peers; and which peers are left out, and why.

    Nothing is run if there is no peer.
    """
    skipped = {peer.name: reason for peer, *_ in PEERS if (reason := peer.missing())}
    if len(skipped) == len(PEERS):
        return [], skipped
    found = []
    for scene, loose, _ in runs:
        for friction in (False, True):
            found += Stretch(scene, loose, friction).costs(repeats, show)
    return found, skipped


@dataclass(frozen=True)
class Stretch:
    """A machine from its start until a contact stays closed."""

    scene: str
    loose: int
    friction: bool = False

    def machine(self, rtol: float) -> Machine:
        """Machine with a relative tolerance."""
        more = {'start': 'centred', 'solver.rtol': rtol}
        return _machine(self.scene, self.loose, self.friction, more)

    @cached_property
    def tree(self) -> Tree:
        """The machine as the peers take it."""
        return Tree(self.machine(REFERENCE))

    @cached_property
    def end(self) -> float:
        """Time at which the first contact stays closed [s]."""
        end = self.tree.machine.drive.period / 256.0
        while True:
            modes = simulate(self.tree.machine, duration=end).modes
            closed = [change.t for change in modes if change.mode > Mode.FREE_FLIGHT]
            if closed:
                return min(closed)
            end *= 2.0

    @cached_property
    def reference(self) -> Solution:
        """Our run, which another of less accuracy confirms.

        Raises
        ------
        RunError
            If it does not.
        """
        solution = simulate(self.tree.machine, duration=self.end)
        other = simulate(self.machine(CHECK), duration=self.end)
        doubt = _farthest(self.places(solution) - self.places(other))
        if doubt > DOUBT:
            raise RunError(f'{self.scene}: the reference is uncertain by {doubt:.1e} m')
        return solution

    def places(self, solution: Solution) -> Answer:
        """Positions of all joints at the end of a run (2 joints, 2) [m]."""
        q = solution.sample(self.end)
        names = self.tree.mechanism.coordinates
        return self.tree.places({c: float(q[f'position.{c}'][0]) for c in names})

    def error(self, answer: Answer) -> float:
        """Largest error of any joint's position, of coordinates at the end (n,) [m]."""
        q = dict(zip(self.tree.mechanism.coordinates, answer.tolist(), strict=True))
        return _farthest(self.tree.places(q) - self.places(self.reference))

    def costs(self, repeats: int, show: Callable[[str], None]) -> list[StretchCost]:
        """Costs of this package, and of the peers that are installed."""
        name = f'{self.scene}, {self.loose} loose joints{", friction" * self.friction}'
        show(f'{name}: {OURS}')
        here = (
            self.scene, self.loose, self.friction, self.end, len(self.reference.impacts),
        )  # fmt: skip
        machine, cpu = self.machine(RTOL), math.inf
        for repeat in range(-1, repeats):
            began = time.process_time()
            solution = simulate(machine, duration=self.end)
            if repeat >= 0:  # the first compiles
                cpu = min(cpu, time.process_time() - began)
        error = _farthest(self.places(solution) - self.places(self.reference))
        found = [StretchCost(*here, OURS, RTOL, error, cpu)]
        for peer, prepare, settings in PEERS:
            if peer.missing():
                continue
            tried: list[StretchCost] = []
            limited, failure = False, ''
            for setting in settings:
                limited = bool(tried) and GROWTH * tried[-1].cpu > LIMIT
                if limited:
                    break
                show(f'{name}: {peer.name}, {peer.setting} {setting:g}')
                try:
                    run = prepare(self.tree, self.end, setting)
                    began = time.process_time()
                    tell = run()
                    cpu = time.process_time() - began
                except RunError as failed:
                    failure = str(failed)
                    break
                error = self.error(tell().answer)
                tried.append(StretchCost(*here, peer.name, setting, error, cpu))
            none = StretchCost(*here, peer.name, math.nan, math.nan, math.nan)
            best = min(tried, key=lambda x: x.error, default=none)
            found.append(replace(best, limited=limited, failure=failure))
        return found


def _farthest(off: Answer) -> float:
    """The longest of vectors (n, 2)."""
    return float(np.hypot(*off.T).max())
