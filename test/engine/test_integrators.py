"""Steps by the cheapest equations that serve: of low order, or without sticking."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builders import weightless

import mechanism_sim as ms
from mechanism_sim.engine import integrators
from mechanism_sim.engine.events import Mode
from mechanism_sim.engine.integrators import Integrators
from mechanism_sim.engine.system import System
from mechanism_sim.numerics import compiled
from mechanism_sim.results.run import prepare

JOINTS = 'ground_crank', 'crank_coupler', 'coupler_rocker', 'rocker_ground'


@pytest.mark.slow
def test_a_run_with_short_steps_is_that_without_them(monkeypatch: pytest.MonkeyPatch) -> None:
    loose = {'radial': '0.1 mm', 'restitution': 0.5, 'friction': 0.1}
    overrides = {f'joints.{j}.clearance': loose for j in JOINTS} | {'start': 'centred'}
    machine = ms.load_scene('four_bar_clearance', overrides)
    taken: list[float | None] = []
    step = Integrators.short_step

    def counted(self: Integrators, longest: float) -> float | None:
        taken.append(step(self, longest))
        return taken[-1]

    monkeypatch.setattr(Integrators, 'short_step', counted)
    monkeypatch.setattr(integrators, '_STEPS', integrators._STEPS._replace(short_from=1))
    found = ms.simulate(machine, duration=0.05)
    assert sum(h is not None for h in taken) > 5
    monkeypatch.setattr(Integrators, 'short_step', lambda *_: None)
    known = ms.simulate(machine, duration=0.05)
    assert [i.joint for i in found.impacts] == [i.joint for i in known.impacts]
    for name in ('t', 'normal_impulse', 'tangential_impulse'):
        a, b = ([getattr(i, name) for i in run.impacts] for run in (found, known))
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-9)
    t = np.linspace(0.0, 0.05, 51)
    gaps = [run.sample(t, 'gap.coupler_rocker')['gap.coupler_rocker'] for run in (found, known)]
    np.testing.assert_allclose(*gaps, atol=1e-10)


def test_a_run_whose_contacts_mostly_slide_is_that_by_equations_in_which_they_may_stick(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    loose = {'radial': '0.254 mm', 'restitution': 0.5, 'friction': 0.1, 'pin_radius': '5 mm'}
    overrides = {f'joints.{j}.clearance': loose for j in JOINTS}
    machine = ms.load_scene('four_bar_clearance', overrides)
    stuck: list[bool] = []
    step = Integrators.step

    def counted(self: Integrators, longest: float) -> float:
        stuck.append(self._stuck)
        return step(self, longest)

    monkeypatch.setattr(Integrators, 'step', counted)
    found = ms.simulate(machine, duration=0.15)
    assert 0 < sum(stuck) < 0.2 * found.stats.steps
    monkeypatch.setattr(System, 'slides', False)
    known = ms.simulate(machine, duration=0.15)
    assert len(found.modes) > 20
    assert [m[1:] for m in found.modes] == [m[1:] for m in known.modes]
    times = [[m.t for m in run.modes] for run in (found, known)]
    np.testing.assert_allclose(*times, atol=1e-10)
    t = np.linspace(0.0, 0.15, 51)
    names = 'reaction.coupler_rocker.size', 'drive_torque', 'gap.rocker_ground'
    for name in names:
        np.testing.assert_allclose(
            *(run.sample(t, name)[name] for run in (found, known)), atol=1e-6
        )


@pytest.mark.parametrize(('height', 'speed'), [(2e-7, -1e-3), (-1e-13, 1e-6), (-1e-9, 1e-4)])
def test_a_gap_that_begins_below_zero_falls_when_it_closes_again(height, speed) -> None:
    """Of a ball above a floor, in closed form; heyoka sees no zero of what never was positive."""
    g = 9.81
    machine = weightless(
        gravity=[0.0, -g],
        links={'ball': {'mass': 1.0}},
        joints={
            'guide': {'prismatic': ['ground', 'ball'], 'axis': '90 deg', 'stops': {'lower': 0.0}}
        },
        initial={'position': {'ball': 0.1}},
    )
    run = machine.start()
    falls = (speed + math.sqrt(speed**2 + 2.0 * g * height)) / g if height > 0.0 else speed / g
    run._state[:] = height, speed
    run._ta.time = 0.0
    run._ta.reset_cooldowns()
    h = 3.0 * falls
    run._integrators.main.step(h, True)
    assert run._steps._time_of_fall(0, h) == pytest.approx(falls, rel=1e-9)
    assert run._steps._time_of_fall(0, 0.9 * falls) is None


def test_an_event_that_no_series_shows_is_come_near_by_ever_shorter_steps() -> None:
    """Of a compliant guide, whose guards are products: a step that passed one lost 1e-7 J."""
    gap = {'radial': 3.04e-5, 'restitution': 0.9, 'length': 0.0418, 'height': 0.0382}
    law = {'friction': 0.128, 'contact': {'law': 'lankarani_nikravesh', 'stiffness': 7.09e7}}
    overrides = {
        'links.piston': {'mass': 0.5, 'inertia': 1.15e-4},
        'joints.ground_piston.clearance': gap | law,
        'drive': {'start_angle': -1.5573060309984386, 'speed': -5.011763178648218},
        'start': 'centred',
    }
    found = ms.simulate(ms.load_scene('slider_crank', overrides), revolutions=1.7)
    assert found.energy is not None
    assert abs(found.energy.residual) < 1e-10 * found.energy.exchanged


@pytest.mark.slow
def test_nothing_is_compiled_in_a_run_that_was_prepared() -> None:
    loose = {'radial': '0.254 mm', 'restitution': 0.5, 'friction': 0.12, 'pin_radius': '5 mm'}
    overrides = {f'joints.{j}.clearance': loose for j in JOINTS[1:]}
    machine = ms.load_scene('four_bar_clearance', overrides)
    prepare(machine)
    made = compiled._integrator.cache_info().misses
    stuck = [m.joint for m in ms.simulate(machine, duration=0.15).modes if m.mode == Mode.STICKING]
    assert stuck
    assert compiled._integrator.cache_info().misses == made


@pytest.mark.slow
def test_a_run_goes_on_with_short_steps_as_if_there_had_been_no_pause(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They begin at an event that a snapshot counts, before it or after."""
    loose = {'radial': '0.1 mm', 'restitution': 0.5}
    overrides = {f'joints.{j}.clearance': loose for j in JOINTS} | {'start': 'centred'}
    machine = ms.load_scene('four_bar_clearance', overrides)
    monkeypatch.setattr(integrators, '_STEPS', integrators._STEPS._replace(short_from=20))
    whole = ms.simulate(machine, duration=0.08)
    assert whole.stats.switches > 30
    for pause in (0.02, 0.06):
        before = ms.stream(machine, duration=pause)
        for _ in before:
            pass
        after = ms.simulate(machine, duration=0.08, resume=before.snapshot)
        ends = [run.motion.curve.coefficients[-1].tobytes() for run in (whole, after)]
        assert ends[0] == ends[1]
