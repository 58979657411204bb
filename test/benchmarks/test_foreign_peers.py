"""Simulators of others on the loose four-bar: the same machine, with the errors of their methods.

Free flight needs no model of contact, so there a peer must meet the reference to the accuracy of
its integrator. Over the whole revolution the way to the reference is the proof: smaller steps or a
stiffer contact come closer.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.four_bar import LooseFourBar, Peer
from benchmarks.peers import drake, drake_events, exudyn, mujoco, siconos

PEERS = {
    'mujoco': mujoco.PEER,
    'exudyn': exudyn.PEER,
    'drake': drake.PEER,
    'drake_events': drake_events.PEER,
    'siconos': siconos.PEER,
}
FLIGHT = LooseFourBar.thesis(revolutions=1 / 64)  # the first impact comes after 0.01806
REVOLUTION = LooseFourBar.thesis()
PLASTIC = LooseFourBar.thesis(e=0.1)
SEATED = LooseFourBar.thesis('seated')


def installed(name: str) -> Peer:
    peer = PEERS[name]
    reason = peer.missing()
    if reason:
        pytest.skip(reason)
    return peer


def angles(name: str, four_bar: LooseFourBar, setting: float) -> np.ndarray:
    return installed(name).prepare(four_bar, setting)()().answer


def error(name: str, four_bar: LooseFourBar, setting: float) -> float:
    return four_bar.error(angles(name, four_bar, setting))


@pytest.mark.parametrize(
    ('name', 'setting', 'bound'),
    [
        ('mujoco', 80e3, 2e-6),
        ('exudyn', 1e8, 1e-11),
        ('drake', 1e8, 1e-8),
        ('drake_events', 1e-8, 1e-12),
        ('siconos', 20e3, 5e-10),
    ],
)
def test_free_flight_is_that_of_the_reference(name: str, setting: float, bound: float) -> None:
    assert error(name, FLIGHT, setting) < bound


@pytest.mark.parametrize(('name', 'order'), [('mujoco', 1), ('siconos', 2)])
def test_free_flight_converges_with_the_order_of_the_method(name: str, order: int) -> None:
    coarse, fine = (error(name, FLIGHT, steps) for steps in (64e2, 64e3))
    assert np.log10(coarse / fine) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize(
    ('name', 'setting', 'bound'),
    [
        ('mujoco', 20e3, 1e-4),
        ('exudyn', 1e9, 8e-5),
        ('drake', 1e8, 3e-4),
        ('drake_events', 1e-8, 3e-9),
        ('siconos', 20e3, 1e-4),
    ],
)
def test_the_revolution_ends_near_the_reference(name: str, setting: float, bound: float) -> None:
    run = installed(name).prepare(REVOLUTION, setting)
    first, second = run()(), run()()
    assert REVOLUTION.error(first.answer) < bound
    np.testing.assert_array_equal(first.answer, second.answer)  # each run starts afresh
    assert (first.steps or 0) > 1000


@pytest.mark.parametrize(
    ('name', 'setting', 'plastic', 'seated'),
    [
        ('mujoco', 20e3, 1e-4, 1e-4),
        ('exudyn', 1e9, 5e-5, 2e-4),
        ('drake', 1e7, 1e-3, 1e-3),
        ('drake_events', 1e-6, 1e-6, 1e-5),
        ('siconos', 20e3, 5e-4, 1e-3),
    ],
)
def test_other_restitution_and_start(
    name: str, setting: float, plastic: float, seated: float
) -> None:
    assert installed(name).any_restitution
    assert error(name, PLASTIC, setting) < plastic
    assert error(name, SEATED, setting) < seated


@pytest.mark.parametrize(
    ('name', 'settings', 'gain'),
    [
        ('mujoco', (5e3, 80e3), 6.0),  # first order, but single runs scatter
        ('exudyn', (1e7, 1e9), 7.0),  # the root of the stiffness
        ('drake_events', (1e-5, 1e-8), 300.0),
        ('siconos', (5e3, 80e3), 6.0),
    ],
)
def test_more_work_comes_closer(name: str, settings: tuple[float, float], gain: float) -> None:
    coarse, fine = (
        np.sqrt(np.mean([error(name, REVOLUTION, near * s) ** 2 for near in (1.0, 1.04, 1.09)]))
        for s in settings
    )
    assert coarse > gain * fine


def test_one_law_of_contact_in_two_simulators(monkeypatch: pytest.MonkeyPatch) -> None:
    """At one stiffness, Drake and Exudyn are further from rigid impacts than from each other."""
    monkeypatch.setattr(exudyn, 'LONGEST_STEP', 0.4)  # the impact well resolved
    by_drake, by_exudyn = (angles(name, REVOLUTION, 1e8) for name in ('drake', 'exudyn'))
    assert np.abs(by_drake - by_exudyn).max() < 0.02 * REVOLUTION.error(by_drake)


@pytest.mark.parametrize('e', [0.1, 0.3, 0.5, 0.9])
def test_the_contact_law_gives_back_the_share_of_speed(e: float) -> None:
    number = exudyn.damping(e)

    def motion(_: float, state: np.ndarray) -> tuple[float, float]:
        return state[1], -state[0] * (1.0 + number * state[1])

    def parted(_: float, state: np.ndarray) -> float:
        return float(state[0])

    parted.terminal, parted.direction = True, -1.0  # type: ignore[attr-defined]
    end = solve_ivp(
        motion, (0.0, 100.0), (1e-13, 1.0), 'DOP853', events=parted, rtol=1e-11, atol=1e-13
    )
    assert -end.y[1, -1] == pytest.approx(e, rel=1e-8)


def test_the_equations_of_the_hybrid_peer_are_those_of_its_geometry() -> None:
    """Rate and acceleration of the gap against differences along a motion."""
    bar = drake_events.Bar(REVOLUTION)
    t, h, state = 0.01, 1e-5, [0.7, 2.1, -5.0, 3.0]

    def later(dt: float) -> drake_events.Motion:
        (b, c, vb, vc), (ab, ac) = state, bar.at(t, state).flight
        moved = [b + dt * vb + dt * dt / 2 * ab, c + dt * vc + dt * dt / 2 * ac]
        return bar.at(t + dt, [*moved, vb + dt * ab, vc + dt * ac])

    before, now, after = later(-h), later(0.0), later(h)
    assert now.rate == pytest.approx((after.gap - before.gap) / (2 * h), rel=1e-6)
    assert now.acceleration == pytest.approx((after.rate - before.rate) / (2 * h), rel=1e-6)


def test_siconos_says_which_interpreter_it_misses(monkeypatch: pytest.MonkeyPatch) -> None:
    siconos.interpreter.cache_clear()
    monkeypatch.setenv('MECHANISM_SIM_SICONOS_PYTHON', 'no-such-python')
    assert 'siconos' in (siconos.missing() or '')
    siconos.interpreter.cache_clear()
