"""Steps of low order between events that follow each other soon."""

from __future__ import annotations

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.engine import event_loop
from mechanism_sim.engine.short_steps import ShortSteps

JOINTS = 'ground_crank', 'crank_coupler', 'coupler_rocker', 'rocker_ground'


def test_a_run_with_short_steps_is_that_without_them(monkeypatch: pytest.MonkeyPatch) -> None:
    loose = {'radial': '0.1 mm', 'restitution': 0.5, 'friction': 0.1}
    overrides = {f'joints.{j}.clearance': loose for j in JOINTS} | {'start': 'centred'}
    machine = ms.load_scene('four_bar_clearance', overrides)
    taken: list[float | None] = []
    step = ShortSteps.step

    def counted(self: ShortSteps, tau: float, longest: float) -> float | None:
        taken.append(step(self, tau, longest))
        return taken[-1]

    monkeypatch.setattr(ShortSteps, 'step', counted)
    monkeypatch.setattr(event_loop, '_STEPS', event_loop._STEPS._replace(short_from=1))
    found = ms.simulate(machine, duration=0.05)
    assert sum(h is not None for h in taken) > 5
    monkeypatch.setattr(ShortSteps, 'step', lambda *_: None)
    known = ms.simulate(machine, duration=0.05)
    assert [i.joint for i in found.impacts] == [i.joint for i in known.impacts]
    for name in ('t', 'normal_impulse', 'tangential_impulse'):
        a, b = ([getattr(i, name) for i in run.impacts] for run in (found, known))
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-9)
    t = np.linspace(0.0, 0.05, 51)
    gaps = [run.sample(t, 'gap.coupler_rocker')['gap.coupler_rocker'] for run in (found, known)]
    np.testing.assert_allclose(*gaps, atol=1e-10)


@pytest.mark.slow
def test_a_run_goes_on_with_short_steps_as_if_there_had_been_no_pause(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They begin at an event that a snapshot counts, before it or after."""
    loose = {'radial': '0.1 mm', 'restitution': 0.5}
    overrides = {f'joints.{j}.clearance': loose for j in JOINTS} | {'start': 'centred'}
    machine = ms.load_scene('four_bar_clearance', overrides)
    monkeypatch.setattr(event_loop, '_STEPS', event_loop._STEPS._replace(short_from=20))
    whole = ms.simulate(machine, duration=0.08)
    assert whole.stats.switches > 30
    for pause in (0.02, 0.06):
        before = ms.stream(machine, duration=pause)
        for _ in before:
            pass
        after = ms.simulate(machine, duration=0.08, resume=before.snapshot)
        ends = [run.motion.curve.coefficients[-1].tobytes() for run in (whole, after)]
        assert ends[0] == ends[1]
