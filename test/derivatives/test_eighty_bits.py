"""Derivatives of twelve kinds of machines against differences of runs in 80 bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import mechanism_sim as ms
from test.builders import PLAY
from test.routes.eighty_bits import F, Repeated

CENTRED = {f'{PLAY}.restitution': 0.9, 'start': 'centred'}
ROUGH = {f'{PLAY}.restitution': 0.8, f'{PLAY}.friction': 0.2, f'{PLAY}.pin_radius': '6 mm'}
SPINS = """
title: A spinning bar whose only bearing is loose
mechanism: linkage
start: centred
links:
  bar: {length: 300 mm, cog: 20 mm, mass: 0.8 kg, inertia: 900 kg mm^2}
joints:
  bearing:
    revolute: [ground, bar]
    clearance: {radial: 0.2 mm, restitution: 0.9, friction: 0.15, pin_radius: 8 mm}
gravity: [0 m/s^2, -9.81 m/s^2]
initial: {velocity: {bar: 20 rad/s}}
duration: 1 s
"""
CASES: dict[str, tuple[str, dict[str, Any], float, int, list[str]]] = {
    'rigid': ('four_bar_clearance', CENTRED, 0.02834, 20, [f'{PLAY}.radial', 'drive.speed']),
    'frictional': (
        'four_bar_clearance', CENTRED | ROUGH, 0.0179, 20,
        [f'{PLAY}.friction', f'{PLAY}.restitution'],
    ),
    'compliant': (
        'four_bar_clearance',
        CENTRED | {f'{PLAY}.contact': {'law': 'hunt_crossley', 'stiffness': 1e8}}, 0.016, 4,
        ['links.coupler.mass', 'drive.speed'],
    ),
    'cam': (
        'valve_train', {'joints.contact.lift_off.restitution': 0.95}, 0.03, 7,
        ['links.valve.mass', 'springs.spring.stiffness'],
    ),
    'gears': (
        'gear_rattle', {'joints.mesh.backlash.restitution': 0.95}, 0.03, 22,
        ['links.wheel.inertia', 'drive.speed'],
    ),
    'film': (
        'four_bar_clearance',
        {f'{PLAY}.contact': {'law': 'film', 'viscosity': 0.05, 'width': 0.02, 'radius': 0.008}},
        0.05, 0, ['links.coupler.mass', 'drive.speed'],
    ),
    'elastic link': ('elastic_slider_crank', {}, 0.02, 0, ['links.rod.elastic.density']),
    'stepped load': ('slider_crank_engine', {}, 0.1, 0, ['links.crank.length', 'drive.speed']),
    'torque drive': (
        'four_bar_governed', {}, 0.4, 0, ['drive.torque.per_speed', 'links.coupler.length'],
    ),
    'motor and follower': (
        'oscillating_roller', {}, 0.3, 0, ['links.arm.length', 'drive.motor.stall_torque'],
    ),
    'free flight with spin': (SPINS, {}, 0.12, 18, ['links.bar.mass', 'initial.velocity.bar']),
    'several loose joints': (
        'four_bar_clearance',
        CENTRED | {'joints.crank_coupler.clearance': {'radial': 2e-4, 'restitution': 0.9}},
        0.012, 18, ['joints.crank_coupler.clearance.radial', 'links.rocker.mass'],
    ),
    'states of first order': (
        'hydraulic_arm', {}, 0.5, 0, ['states.pushing.start', 'links.arm.cog'],
    ),
}  # fmt: skip
QUICK = {'gears'}


@pytest.mark.parametrize(
    'name', [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in CASES]
)
def test_derivatives_are_those_of_80_bits(name: str) -> None:
    scene, overrides, end, impacts, paths = CASES[name]
    machine = ms.load_scene(scene, overrides)
    run = ms.simulate(machine, duration=1.0001 * end, derivatives=paths)
    assert sum(i.t < end for i in run.impacts) >= impacts
    other = Repeated(machine, run, end)
    names = [f'{kind}.{c}' for kind in ('position', 'velocity') for c in other.free]
    for path in paths:
        wanted = other.derivative(path)[: len(names)].astype(float)
        known = run.derivatives[path]
        assert known.end is None
        own = known.sample(end, *names)
        found = np.array([own[n][0] for n in names])
        for x, y in zip(found.reshape(2, -1), wanted.reshape(2, -1), strict=True):
            assert np.abs(x - y).max() < 1e-8 * np.abs(y).max(), path


def _closed(numbers: np.ndarray, t: Any) -> np.ndarray:
    """Angles of coupler and rocker, then their rates, of a closed four-bar in 80 bits."""
    ground, crank, coupler, rocker, speed = numbers
    at, q = speed * t, np.array([F('1.03'), F('2.12')])
    for angle in np.repeat(np.arange(1, 9), 6) * at / 8:  # from the start to t
        x = crank * np.cos(angle) + coupler * np.cos(q[0]) - ground - rocker * np.cos(q[1])
        y = crank * np.sin(angle) + coupler * np.sin(q[0]) - rocker * np.sin(q[1])
        q = q - _solved(_arms(q, coupler, rocker), np.array([x, y]))
    pin = crank * speed * np.array([-np.sin(at), np.cos(at)])
    return np.concatenate([q, _solved(_arms(q, coupler, rocker), -pin)])


def _arms(q: np.ndarray, coupler: Any, rocker: Any) -> np.ndarray:
    columns = [
        coupler * np.array([-np.sin(q[0]), np.cos(q[0])]),
        rocker * np.array([np.sin(q[1]), -np.cos(q[1])]),
    ]
    return np.array(columns).T


def _solved(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    det = A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
    return np.array([A[1, 1] * b[0] - A[0, 1] * b[1], A[0, 0] * b[1] - A[1, 0] * b[0]]) / det


def test_an_ideal_linkage_has_the_derivatives_of_its_closed_loop() -> None:
    paths = [f'links.{n}.length' for n in ('ground', 'crank', 'coupler', 'rocker')]
    paths.append('drive.speed')
    end = 0.02
    run = ms.simulate('four_bar_nominal', duration=end, derivatives=paths)
    numbers = np.array([F('0.387'), F('0.064'), F('0.309'), F('0.312'), F('36.6519')])
    for k, path in enumerate(paths):
        h = F('1e-4') * numbers[k] * (np.arange(5) == k)
        total = sum(
            weight * (_closed(numbers + n * h, F(end)) - _closed(numbers - n * h, F(end)))
            for n, weight in ((1, F(3) / 4), (2, F(-3) / 20), (3, F(1) / 60))
        )
        wanted = (total / h[k]).astype(float)
        final = run.derivatives[path].final
        found = [final[c][x] for x in ('position', 'velocity') for c in ('coupler', 'rocker')]
        for x, y in zip(np.reshape(found, (2, -1)), wanted.reshape(2, -1), strict=True):
            assert np.abs(x - y).max() < 1e-8 * np.abs(y).max(), path
