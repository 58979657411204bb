"""Formulas of loads: where they have no value, and numbers without a unit beside units."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from builders import made

import mechanism_sim as ms
from mechanism_sim.errors import InputError, RunError


def pushed(torque):
    """An arm on whose shaft a formula acts."""
    return made(f"""
links: {{arm: {{mass: 1 kg, inertia: 0.1 kg m^2}}}}
joints: {{pivot: {{revolute: [ground, arm]}}}}
drive: {{coordinate: arm, torque: 1 N m}}
loads: {{push: {{at: arm, torque: "{torque}"}}}}
duration: 2 s
""")


@pytest.mark.parametrize(
    ('torque', 'time', 'said'),
    [
        ('log(arm_rate)', 0, 'has no value'),
        ('(t-1)^(1/3)', 0, 'has no value'),
        ('1/(t-1)', 1, 'has no value'),
        ('sqrt(1-t)', 1, 'has no value'),
        ('t^0.5', 0, 'is at the end of its range'),
        ('5*sqrt(max(5-arm, 0))', None, 'is at the end of its range'),
    ],
)
def test_a_run_says_whose_formula_ends_and_when(torque, time, said):
    with pytest.raises(RunError) as error:
        ms.simulate(pushed(torque))
    found = str(error.value)
    assert f"loads.push.torque: the formula '{torque}' {said} at t = " in found
    at = float(re.search(r't = (\S+) s', found)[1])
    assert time is None or at == pytest.approx(time, abs=1e-9)


@pytest.mark.parametrize(
    'speed', ['hypot(vx, vy)', 'sqrt(vx^2 + vy^2)', '(vx*vx + vy*vy)^0.5', 'hypot(vy, 0, vx)']
)
def test_drag_by_the_square_of_the_speed_begins_at_rest(speed):
    """Of a ball that falls: ``h = v^2/g ln cosh(g t/v)`` with its final speed v."""
    ball = made(f"""
gravity: [0, -9.81 m/s^2]
links: {{carriage: {{mass: 0}}, ball: {{mass: 2 kg}}}}
joints:
  across: {{prismatic: [ground, carriage]}}
  down: {{prismatic: [carriage, ball], axis: -90 deg}}
loads: {{drag: {{at: ball, force: ["-0.3*{speed}*vx", "-0.3*{speed}*vy"]}}}}
""")
    t = np.linspace(0.0, 3.0, 31)
    fallen = ms.simulate(ball, duration=3.0).sample(t, 'position.ball')['position.ball']
    final = math.sqrt(2.0 * 9.81 / 0.3)
    expected = final**2 / 9.81 * np.log(np.cosh(9.81 * t / final))
    assert fallen == pytest.approx(expected, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize(
    ('torque', 'part'), [('1/0', '1/0'), ('2 + t*log(-1)', 'log(-1)'), ('0^-1', '0^-1')]
)
def test_what_has_no_value_at_any_time_is_refused(torque, part):
    said = f"loads.push: '{part}' in the formula '{torque}' has no value"
    with pytest.raises(InputError, match=re.escape(said)):
        pushed(torque)


@pytest.mark.parametrize(
    ('torque', 'written'),
    [
        ('2000 N mm + 3', '3 N m'),
        ('min(2 N m, 3)', '3 N m'),
        ('-4 - 2 N m*t/1 s', '-4 N m'),
        ('3 N m if t < 0.5 else 1 N m', '0.5 s'),
        ('3 N m if t < 0.5 s else 1', '1 N m'),
        ('2 N m if arm_rate > 2*3 else 0', '(2*3)*1 rad/s'),
    ],
)
def test_a_number_without_a_unit_beside_units_is_told_how_it_is_written(torque, written):
    with pytest.raises(InputError, match=rf'has no unit beside .*: write {re.escape(written)}$'):
        pushed(torque)
    number = written.split(')*1')[0].strip('(').split(' ')[0]
    parts = torque.rpartition(number)
    pushed(f'{parts[0]}{written}{parts[2]}')


@pytest.mark.parametrize(
    'torque',
    ['3 N m if arm < 1 else 0', '2 N m*(1 + sin(30 deg + 20 rad/s*t + 1))', '3 + 2*t',
     'max(0, 2 N m - 1 N m s/rad*arm_rate)', '(3 + 2)*1 N m'],
)  # fmt: skip
def test_zero_factors_angles_and_texts_without_units_need_none(torque):
    assert pushed(torque)
