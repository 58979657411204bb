"""Derivatives of scenes of the package against differences of whole runs.

Through ten impacts or more, where there are that many, else over five turns of the drive.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.derivatives.numeric_keys import numeric_keys

SCENES = [
    ('adjustable_stroke_drive', ['drive.speed', 'links.rod.mass']),
    ('andrews_squeezer', ['links.K4.mass', 'links.K4.length']),
    ('bearing_run_up', ['links.coupler.mass', 'links.coupler.length']),
    ('belt_drive', ['links.fan.mass', 'drive.motor.stall_torque']),
    ('bevel_pair', ['drive.speed', 'links.wheel.mass']),
    ('catapult', ['links.carriage.mass', 'links.link.length']),
    ('compound_planetary', ['drive.speed', 'links.third.mass']),
    ('constant_velocity_slider', ['drive.speed', 'links.second_crank.mass']),
    ('detent', ['links.head.mass', 'links.arm.length']),
    ('differential', ['drive.speed', 'links.left.mass']),
    ('double_rocker_tracing', ['drive.speed', 'links.connecting_link.mass']),
    ('double_toggle_punch', ['drive.speed', 'links.upper_toggle.mass']),
    ('eccentric_cam', ['drive.speed', 'links.follower.mass']),
    ('four_bar_elastic', ['drive.speed', 'links.coupler.mass']),
    ('four_bar_measured', ['drive.speed', 'links.coupler.mass']),
    ('four_bar_misaligned', ['drive.speed', 'links.coupler.mass']),
    ('four_bar_on_frame', ['drive.speed', 'links.coupler.mass']),
    ('gear_rattle', ['drive.speed', 'links.wheel.mass']),
    ('locking_pliers', ['links.handle.mass', 'links.handle.length']),
    ('valve_train', ['drive.speed', 'links.valve.mass']),
    ('watched_compressor', ['drive.speed', 'links.rod.mass']),
    ('whole_machine', ['drive.speed', 'links.coupler.mass']),
]


def _end(machine: ms.Machine) -> float:
    """[s] In the longest flight after the eleventh to thirteenth impact."""
    period = machine.drive.period if machine.drive else math.inf
    end = 5.0 * period if period and math.isfinite(period) else machine.scene.duration or 1.0
    struck = np.array(sorted({i.t for i in ms.simulate(machine, duration=end).impacts}))
    if len(struck) <= 14:
        return float(end)
    flights = np.diff(struck)[10:13]
    return float(struck[10 + flights.argmax()] + 0.5 * flights.max())


@pytest.mark.slow
@pytest.mark.parametrize(('scene', 'paths'), SCENES, ids=[name for name, _ in SCENES])
def test_derivatives_are_those_of_whole_runs(scene: str, paths: list[str]) -> None:
    machine = ms.load_scene(scene)
    end = _end(machine)
    run = ms.simulate(machine, duration=end, derivatives=paths)
    columns = [f'{k}.{c}' for k in ('position', 'velocity') for c in machine.physics.coordinates]

    def seen(other: ms.Machine) -> np.ndarray:
        found = ms.simulate(other, duration=end).sample(end, *columns)
        return np.array([found[c][0] for c in columns]).reshape(2, -1)

    for key in numeric_keys(machine, paths):
        known = run.derivatives[key.path]
        assert known.end is None
        steps = 2e-4 * abs(key.value) * 0.5 ** np.arange(3)
        rows = [
            (seen(key.at(key.value + h)) - seen(key.at(key.value - h))) / (2.0 * h) for h in steps
        ]
        first, second = ((4.0 * b - a) / 3.0 for a, b in pairwise(rows))
        wanted = (16.0 * second - first) / 15.0
        own = np.array([known.sample(end, *columns)[c][0] for c in columns]).reshape(2, -1)
        for x, y, error in zip(own, wanted, np.abs(wanted - second), strict=True):
            assert np.isfinite(x).all()
            size = np.abs(y).max()
            assert np.abs(x - y).max() <= max(2e-6 * size, 10.0 * error.max(), 1e-12), key.path
