"""What machines cost whose joints are loose: whole runs, by how many of them are."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

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


def _machine(scene: str, loose: int, friction: bool) -> Machine:
    play = (FINE if scene == 'ten_links' else CLEARANCE) | (FRICTION if friction else {})
    joints: Sequence[str] = JOINTS
    if scene != 'four_bar_clearance':
        content = load_scene(scene).scene.model_dump(exclude_unset=True)
        joints = [name for name, joint in content['joints'].items() if 'revolute' in joint]
    overrides = {f'joints.{name}.clearance': play for name in joints[:loose]}
    return load_scene(scene, overrides)


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
