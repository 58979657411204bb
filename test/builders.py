"""Machines and runs that several tests take."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml

import mechanism_sim as ms
from mechanism_sim.analysis.record import Record
from mechanism_sim.joints.cam.constraint import CamPair
from mechanism_sim.numerics import compiled
from mechanism_sim.results.quantity import Shown
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene, find_scene, read_yaml
from mechanism_sim.scene.schema import Scene

PLAY = 'joints.coupler_rocker.clearance'
"""Of the scene four_bar_clearance."""
ROUGH = {f'{PLAY}.friction': 0.05, f'{PLAY}.pin_radius': '6 mm', f'{PLAY}.restitution': 0.7,
         'start': 'centred'}  # fmt: skip
"""Overrides of four_bar_clearance: impacts, sliding and following."""
EVERY_KIND = (
    'four_bar_clearance', 'bearing_run_up', 'ten_links', 'whole_machine', 'planetary', 'loader',
    'geneva', 'linear_intermittent', 'valve_train', 'rack_and_pinion', 'scotch_yoke', 'pendulum',
    'four_bar_on_frame', 'locking_pliers',
)  # fmt: skip
"""Scenes that have all kinds of joints, drives and levels among them."""
LINKAGE = """
title: The four-bar of the template, written out
mechanism: linkage
links:
  ground: {points: {pivot: [387 mm, 0 mm]}}
  crank: {length: 64 mm, mass: 1 kg, inertia: 0.001, cog: 32 mm}
  coupler: {length: 309 mm, mass: 1 kg, inertia: 0.01, cog: 150 mm}
  rocker: {length: 312 mm, mass: 1 kg, inertia: 0.01, cog: 150 mm}
joints:
  ground_crank: {revolute: [ground, crank]}
  crank_coupler: {revolute: [crank.end, coupler]}
  coupler_rocker:
    {revolute: [coupler.end, rocker.end], clearance: {radial: 2 mm, restitution: 0.5}}
  rocker_ground: {revolute: [rocker, ground.pivot]}
drive: {speed: 10 rad/s}
guess: {coupler: 60 deg, rocker: 120 deg}
"""


def simulated(scene: str, overrides: Any = (), **length: float) -> Record:
    """A run of a scene of the package, as it would be read from a bag."""
    machine = ms.load_scene(scene, overrides)
    return Record(machine, ms.simulate(machine, **length), {})


def digest_of(scene: str, overrides: Any = (), duration: float | None = None) -> str:
    """Of the motion without nodes."""
    return ms.simulate(ms.load_scene(scene, overrides=overrides), duration=duration).digest()


def made(scene: Mapping[str, Any] | str, name: str = 'made', **overrides: object) -> ms.Machine:
    """The machine of a scene: its keys and values, or their YAML; a linkage if it does not say."""
    content = yaml.safe_load(scene) if isinstance(scene, str) else scene
    content = {'title': name, 'mechanism': 'linkage', **content}
    return build(name, check_scene(name, content, overrides))


def read_scene(name: str, overrides: Any = ()) -> tuple[str, Scene]:
    """Name and content of a scene, checked, in SI units, of which no machine was built."""
    path = find_scene(name)
    return path.stem, check_scene(path.name, read_yaml(path, 'scene'), overrides)


def without_work(run: Any, t: Any) -> Any:
    """Samples of a run but for works and losses, which cost ten times as much as all others."""
    names = run.catalogue.shown(Shown.RUN)
    return run.sample(t, *(name for name in names if not name.startswith('energy.d')))


def weightless(**parts: object) -> ms.Machine:
    """The machine of a linkage without gravity."""
    return made({'gravity': [0.0, 0.0], **parts})


def cam_pair(machine: ms.Machine) -> CamPair:
    """The first pair of a cam and its follower."""
    return next(j for j in machine.plan.joints if isinstance(j, CamPair))


def placed(machine: ms.Machine, link: str, q: Any, points: Any) -> Any:
    """Points (2, N) of a link of the ideal machine in the world [m]."""
    x, y = machine.plan.ideal.locate(link, q)
    a = machine.plan.ideal.angle(link, q)
    c, s = math.cos(a), math.sin(a)
    return np.array([[x], [y]]) + np.array([[c, -s], [s, c]]) @ points


def compilations() -> int:
    """Number of expressions compiled in this process."""
    return sum(f.cache_info().misses for f in (compiled._function, compiled._integrator))
