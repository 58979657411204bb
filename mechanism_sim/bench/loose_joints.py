"""What machines cost whose joints are loose: whole runs, by how many of them are.

Beside other simulators a run can only be so long as its end is well defined: after many impacts a
difference in the last digit has grown to anything, and where one pin strikes while another rests
in its bushing, an impact law has to say what passes between them. So all start with their pins in
the middle, and end as soon as any contact stays closed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mechanism_sim.bench.peers import exudyn, mujoco
from mechanism_sim.bench.peers.tree import Tree
from mechanism_sim.bench.problem import OURS, Answer
from mechanism_sim.errors import RunError
from mechanism_sim.hybrid.events import Mode
from mechanism_sim.hybrid.solution import Solution
from mechanism_sim.scene import Machine, load_scene, simulate

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


def _machine(scene: str, loose: int, friction: bool, **more: object) -> Machine:
    play = (FINE if scene == 'ten_links' else CLEARANCE) | (FRICTION if friction else {})
    joints: Sequence[str] = JOINTS
    if scene != 'four_bar_clearance':
        content = load_scene(scene).scene.model_dump(exclude_unset=True)
        joints = [name for name, joint in content['joints'].items() if 'revolute' in joint]
    overrides = {f'joints.{name}.clearance': play for name in joints[:loose]}
    return load_scene(scene, overrides | more)


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
    *(('ten_links', count, 0.2) for count in (4, 8, 13)),
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
            found += _stretch(scene, loose, friction, repeats, show)
    return found, skipped


def _stretch(
    scene: str, loose: int, friction: bool, repeats: int, show: Callable[[str], None]
) -> list[StretchCost]:
    """One machine by all."""
    name = f'{scene}, {loose} loose joints{", friction" * friction}'
    show(f'{name}: {OURS}')
    exact, check, ours = (
        _machine(scene, loose, friction, start='centred', **{'solver.rtol': rtol})
        for rtol in (REFERENCE, CHECK, RTOL)
    )
    tree, end = Tree(exact), _closes(exact)
    reference = simulate(exact, duration=end)
    truth = _places(tree, reference)

    def error(places: Answer) -> float:
        return float(np.hypot(*(places - truth).T).max())

    doubt = error(_places(tree, simulate(check, duration=end)))
    if doubt > DOUBT:
        raise RunError(f'{scene}: the reference is uncertain by {doubt:.1e} m')
    simulate(ours, duration=end)  # compiles
    cpu = math.inf
    for _ in range(repeats):
        began = time.process_time()
        solution = simulate(ours, duration=end)
        cpu = min(cpu, time.process_time() - began)
    here = scene, loose, friction, end, len(reference.impacts)
    found = [StretchCost(*here, OURS, RTOL, error(_places(tree, solution)), cpu)]
    for peer, prepare, settings in PEERS:
        if peer.missing():
            continue
        tried: list[StretchCost] = []
        limited, failure = False, ''
        for setting in settings:
            costs = [x.cpu for x in tried[-2:]]
            limited = len(costs) == 2 and costs[1] ** 2 > LIMIT * costs[0]
            if limited:
                break
            show(f'{name}: {peer.name}, {peer.setting} {setting:g}')
            try:
                run = prepare(tree, end, setting)
                began = time.process_time()
                tell = run()
                cpu = time.process_time() - began
            except RunError as failed:
                failure = str(failed)
                break
            q = dict(zip(tree.mechanism.coordinates, tell().answer.tolist(), strict=True))
            tried.append(StretchCost(*here, peer.name, setting, error(tree.places(q)), cpu))
        none = StretchCost(*here, peer.name, math.nan, math.nan, math.nan)
        best = min(tried, key=lambda x: x.error, default=none)
        found.append(replace(best, limited=limited, failure=failure))
    return found


def _closes(machine: Machine) -> float:
    """When the first contact stays closed [s]."""
    end = machine.period / 256.0
    while True:
        solution = simulate(machine, duration=end)
        closed = [change.t for change in solution.modes if change.mode > Mode.FREE_FLIGHT]
        if closed:
            return min(closed)
        end *= 2.0


def _places(tree: Tree, solution: Solution) -> Answer:
    """Of all joints at the end of a run [m]."""
    q = solution.sample(solution.motion.curve.end)
    return tree.places({c: float(q[f'position.{c}'][0]) for c in tree.mechanism.coordinates})
