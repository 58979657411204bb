"""First looks at steps with steep formulas: the answers of `StepCheck` without machine code."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy
from builders import LINKAGE, made

import mechanism_sim as ms
from mechanism_sim.engine.step_check import StepCheck

PENDULUM = """
links: {bar: {length: 1 m, cog: 500 mm, mass: 1.2 kg, inertia: 0.1 kg m^2}}
joints: {pivot: {revolute: [ground, bar]}}
gravity: [0, -9.81 m/s^2]
initial: {position: {bar: -30 deg}}
"""
DRAG = '{at: %s, force: ["-%s*hypot(vx, vy)*vx", "-%s*hypot(vx, vy)*vy"]}'
CASES = {
    'drag': (f'{PENDULUM}loads: {{drag: {DRAG % ("bar.end", 0.3, 0.3)}}}', 3.0),
    'stiction': (f'{PENDULUM}loads: {{rub: {{at: bar, torque: "-tanh(bar_rate/0.02)"}}}}', 6.0),
    'pulse': (f'{PENDULUM}loads: {{push: {{at: bar, torque: "exp(-((t-2.02)/0.001)^2)"}}}}', 4.0),
    'in flight': (f'{LINKAGE}loads: {{drag: {DRAG % ("rocker.end", 0.9, 0.9)}}}', 0.6),
    'held': (f'{LINKAGE}loads: {{push: {{at: crank, torque: "exp(-((crank-1)/0.01)^2)"}}}}', 0.6),
}


@pytest.mark.usefixtures('plain_kernels')
@pytest.mark.parametrize(
    'case', ['drag', *(pytest.param(x, marks=pytest.mark.slow) for x in list(CASES)[1:])]
)
def test_first_looks_find_what_closer_looks_find(case, compiled_kernels, monkeypatch):
    content, duration = CASES[case]
    machine = made(content)
    plain = ms.simulate(machine, duration=duration)
    compiled_kernels()
    answers, reach, look = [], StepCheck.reach, StepCheck._closer_look
    closer = []

    def both(check, time, tau, h):
        check._now[3] = 0.0
        found = reach(check, time, tau, h)
        if doubts := int(check._now[3]):
            answers.append((found, look(check, tau, h, doubts)))
        return found

    monkeypatch.setattr(StepCheck, 'reach', both)
    monkeypatch.setattr(StepCheck, '_closer_look', lambda *x: closer.append(x) or look(*x))
    assert ms.simulate(machine, duration=duration).digest() == plain.digest()
    assert len(answers) > 3
    assert all(one == other for one, other in answers)
    assert len(closer) < len(answers)  # of pulses first looks tell little


def test_a_pendulum_turns_where_drag_by_the_square_of_its_speed_lets_it():
    """Squares of its speed over the angle follow a linear equation, ``u' + a u = -g cos q``."""
    content, duration = CASES['drag'][0], 3.0
    run = ms.simulate(made(content), duration=duration)

    def sampled(name, t):
        return run.sample([t], name)[name][0]

    inertia = 0.1 + 1.2 * 0.25
    pull, drag = 1.2 * 9.81 * 0.5 / inertia, 2.0 * 0.3 / inertia
    t = np.linspace(0.0, duration, 121)[1:]
    v = run.sample(t, 'velocity.bar')['velocity.bar']
    place, sign, turns = -math.pi / 6.0, -1.0, 0
    for before, after in zip(
        t[:-1][v[:-1] * v[1:] < 0.0], t[1:][v[:-1] * v[1:] < 0.0], strict=True
    ):
        when = scipy.optimize.brentq(
            lambda t: sampled('velocity.bar', t), before, after, xtol=1e-14
        )
        a = sign * drag
        known = pull / (1.0 + a**2) * np.array([-a, -1.0])

        def squared(q, a=a, known=known, place=place):
            here, there = (known @ [math.cos(x), math.sin(x)] for x in (q, place))
            return here - there * math.exp(-a * (q - place))

        place = scipy.optimize.brentq(squared, place + sign * 0.1, place + sign * 3.0, xtol=1e-14)
        assert sampled('position.bar', when) == pytest.approx(place, abs=1e-11)
        sign, turns = -sign, turns + 1
    assert turns > 2
