"""State transition matrices."""

from __future__ import annotations

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.derivatives.flow import Flows
from mechanism_sim.engine.snapshot import State
from mechanism_sim.studies.periodic import PoincareMap, find_periodic
from test.builders import PLAY


def test_flights_keep_the_volume_of_states_and_impacts_shrink_it() -> None:
    """Liouville: masses are constant in absolute angles, and a blow scales one rate by -e."""
    overrides = {f'{PLAY}.restitution': 0.9, 'start': 'centred'}
    machine = ms.load_scene('four_bar_clearance', overrides)
    run = ms.simulate(machine, duration=0.02834)
    matrix, limits = Flows.by_state(machine, run.duration).transition(run.motion, run.impacts)
    assert len(run.impacts) == 20
    assert not limits
    # each blow mirrors a position and a rate: e^2 of its volume is left
    assert np.linalg.det(matrix) == pytest.approx(0.9 ** (2 * 20), rel=1e-8)


def test_a_pendulum_has_the_matrix_of_its_differences() -> None:
    machine = ms.load_scene('pendulum')
    run = ms.simulate(machine, duration=0.7)
    matrix, _ = Flows.by_state(machine, 0.7).transition(run.motion, [])

    def end(path: str, value: float) -> np.ndarray:
        other = ms.simulate(ms.load_scene(machine, {path: value}), duration=0.7)
        found = other.sample(0.7, 'position.bar', 'velocity.bar')
        return np.array([found['position.bar'][0], found['velocity.bar'][0]])

    start, h = machine.initial_state(), 1e-3
    columns = []
    for path, value in zip(
        ('initial.position.bar', 'initial.velocity.bar'), (start.q[0], start.v[0]), strict=True
    ):
        first, second = (
            (end(path, value + x) - end(path, value - x)) / (2.0 * x) for x in (h, 0.5 * h)
        )
        columns.append((4.0 * second - first) / 3.0)
    assert np.abs(matrix - np.array(columns).T).max() < 1e-9


OSCILLATOR = """
title: Oscillator shaken by a load that follows a crank, with a stop that it never reaches
mechanism: linkage
links: {crank: {length: 10 mm, mass: 1 kg, inertia: 1e-3 kg m^2}, m: {mass: 1 kg}}
joints:
  gc: {revolute: [ground, crank]}
  g: {prismatic: [ground, m], axis: 0 deg, stops: {upper: 50 mm, restitution: 0.5}}
springs: {sp: {coordinate: m, stiffness: 400 N/m, damping: 6 N s/m}}
loads: {f: {at: m, force: ['3*cos(crank)', 0]}}
drive: {coordinate: crank, speed: 12 rad/s}
"""


@pytest.mark.parametrize('speed', [10.0, 11.0, 12.0, 13.0, 15.0])
def test_steps_as_long_as_a_part_of_a_turn_end_with_it(speed: float) -> None:
    """Rounding puts the end of an eighth of a turn, eight times, just before or after it."""
    machine = ms.load_scene(OSCILLATOR, {'drive.speed': f'{speed} rad/s'})
    found = find_periodic(machine)
    assert found is not None
    assert found.period == 1
    decay = np.exp(-3.0 * 2.0 * np.pi / speed)
    assert [*map(abs, found.multipliers)] == pytest.approx([decay, decay], rel=1e-9)
    place = 3.0 / (400.0 - speed**2 + 6.0j * speed)
    assert found.state.q[0] == pytest.approx(place.real, rel=1e-9)
    assert found.state.v[0] == pytest.approx((1j * speed * place).real, rel=1e-9)


LAG = 0.2  # [s]


def filtered(scale: float, speed: float = 12.0) -> ms.Machine:
    """The oscillator, whose load is behind a filter of first order."""
    rate = f'(3*cos(crank) - push)/{LAG}'
    states = {'push': {'start': 0.0, 'rate': rate, 'scale': scale}}
    load = {'f': {'at': 'm', 'force': ['push', 0.0]}}
    return ms.load_scene(
        OSCILLATOR, {'states': states, 'loads': load, 'drive.speed': f'{speed} rad/s'}
    )


def steady(w: float) -> np.ndarray:
    """Place and rate of its block, and its filter, where its crank points along x."""
    push = 3.0 / (1.0 + 1.0j * w * LAG)
    place = push / (400.0 - w**2 + 6.0j * w)
    return np.array([place, 1.0j * w * place, push]).real


@pytest.mark.parametrize('scale', [1e-3, 1.0, 1e4])
def test_states_of_first_order_are_of_what_repeats_whatever_their_scale(scale: float) -> None:
    w, h = 12.0, 1e-4
    machine = filtered(scale)
    found = find_periodic(machine)
    assert found is not None
    (state,) = machine.equations.system.states
    assert [*found.state.q, *found.state.v, *np.array(found.state.states) * state.scale] == (
        pytest.approx(steady(w), rel=1e-7)
    )
    turn = 2.0 * np.pi / w
    decays = np.exp([-3.0 * turn, -3.0 * turn, -turn / LAG])
    assert np.abs(found.multipliers) == pytest.approx(decays, rel=1e-9)
    section = PoincareMap(machine, ['drive.speed'])
    M, by, _ = section.sensitivity(found.state, 1)
    moved = np.linalg.solve(np.eye(3) - M, by)[:, 0] * section.scale
    assert moved == pytest.approx((steady(w + h) - steady(w - h)) / (2.0 * h), rel=1e-5)
    exponents = ms.lyapunov(machine, revolutions=20, skip=2, count=3).values
    # those of the pair change places within a turn
    assert np.sum(exponents[:2]) == pytest.approx(-6.0, rel=1e-6)
    assert exponents[2] == pytest.approx(-1.0 / LAG, rel=1e-6)


@pytest.mark.slow
def test_a_branch_is_followed_with_states_of_first_order() -> None:
    found = ms.bifurcation(filtered(1e3), {'drive.speed': (10.0, 13.0, 2)}, transient=12, keep=8)
    (branch,) = ms.branches(found)
    assert branch.points[0].value == pytest.approx(10.0)
    assert branch.points[-1].value == pytest.approx(13.0)
    for point in branch.points:
        assert point.points[0, 0] == pytest.approx(steady(point.value)[1], rel=1e-6)
        turn = 2.0 * np.pi / point.value
        decays = np.exp([-3.0 * turn, -3.0 * turn, -turn / LAG])
        assert np.abs(point.multipliers) == pytest.approx(decays, rel=1e-6)


@pytest.mark.slow
def test_multipliers_are_known_to_their_last_digits() -> None:
    machine = ms.load_scene('four_bar_clearance', {'drive.speed': '480 rpm'})
    response = find_periodic(machine)
    assert response is not None
    assert response.period == 2
    assert response.spread < 1e-9


@pytest.mark.slow
def test_a_filter_that_only_listens_adds_its_decay_to_the_multipliers() -> None:
    """Of a motion with 158 impacts in its two turns."""
    states = {'slow': {'start': 0.0, 'rate': '(rocker_rate - slow)/0.2'}}
    alone, heard = (
        find_periodic(ms.load_scene('four_bar_clearance', {'drive.speed': '480 rpm', **more}))
        for more in ({}, {'states': states})
    )
    assert alone is not None
    assert heard is not None
    expected = [np.exp(-2.0 * 0.125 / 0.2), *np.abs(alone.multipliers)]
    assert np.abs(heard.multipliers) == pytest.approx(expected, rel=1e-8)


@pytest.mark.slow
def test_fixed_points_move_with_keys_as_those_of_other_machines() -> None:
    values = {'drive.speed': (480.0 * np.pi / 30.0, 1e-3), f'{PLAY}.radial': (0.254e-3, 1e-10)}
    machine = ms.load_scene('four_bar_clearance', {'drive.speed': '480 rpm'})
    response = find_periodic(machine)
    assert response is not None
    section = PoincareMap(machine, list(values))
    M, by, _ = section.sensitivity(response.state, response.period)
    moved = np.linalg.solve(np.eye(len(M)) - M, by)
    sizes = sorted(np.abs(np.linalg.eigvals(M)))
    assert sizes[-2:] == pytest.approx(np.abs(response.multipliers), rel=1e-6)

    def fixed(path: str, value: float) -> State:
        text = f'{value!r} rad/s' if path == 'drive.speed' else value
        other = PoincareMap(ms.load_scene(machine, {path: text}))
        state = response.state
        for _ in range(4):  # Newton's method, as every state is brought into contact
            M, end = other.growth(state := other.start(state), response.period)
            off = other.difference(state, end)
            state = other.displace(state, np.linalg.solve(np.eye(len(M)) - M, off))
        return other.start(state)

    for column, (path, (value, h)) in zip(moved.T, values.items(), strict=True):
        difference = section.difference(fixed(path, value - h), fixed(path, value + h)) / (2.0 * h)
        assert np.abs(column - difference).max() < 1e-4 * np.abs(difference).max()
