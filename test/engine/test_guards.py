"""Guards of friction and of soft walls: modes at the times of closed forms, in few steps."""

from __future__ import annotations

import numpy as np
import pytest
from builders import weightless
from compliant_impacts import impact_duration
from scipy.integrate import quad
from scipy.optimize import brentq

from mechanism_sim.engine.contact.compliant import Hertz
from mechanism_sim.engine.events import Mode
from test.hard.bodies import Floor, ThrownBody

MASS, PRESS, MU = 2.0, 10.0, 0.5
PULL, PACE = 8.0, 3.0  # [N], [rad/s]
RADIAL = 1e-3


def shoe():
    """Under a plate that presses it, pulled to and fro."""
    return weightless(
        links={'shoe': {'mass': MASS}, 'plate': {'mass': 3.0}},
        joints={
            'rail': {'prismatic': ['ground', 'shoe']},
            'guide': {'prismatic': ['ground', 'plate'], 'axis': '90 deg'},
            'pad': {
                'slot': ['shoe', 'plate'],
                'clearance': {'radial': RADIAL, 'restitution': 0.0, 'friction': MU},
            },
        },
        loads={
            'press': {'at': 'plate', 'force': [0.0, -PRESS]},
            'pull': {'at': 'shoe', 'force': [f'{PULL}*sin({PACE}*t)', 0.0]},
        },
        initial={'position': {'plate': -RADIAL, 'shoe': 0.0}, 'velocity': {'plate': 0.0}},
    )


def test_what_sticks_gives_way_the_way_it_is_pulled_and_sticks_again_when_it_stops():
    """``m v' = F sin(w t) - mu N sign(v)``: each slip in closed form, once either way."""
    begin = np.arcsin(MU * PRESS / PULL) / PACE

    def speed(t):
        gained = PULL / PACE * (np.cos(PACE * begin) - np.cos(PACE * t))
        return (gained - MU * PRESS * (t - begin)) / MASS

    end = brentq(speed, begin + 0.5, begin + 1.0, xtol=1e-15)
    run = shoe().start()
    run.advance(2.0, final=True, most=100)
    assert run.time == 2.0
    motion, impacts, changes = run.drain()
    assert not impacts
    place = motion.curve(np.array([begin, end, begin + np.pi / PACE]))[:, 0]
    assert place == pytest.approx([0.0, *2 * [quad(speed, begin, end)[0]]], abs=1e-9)
    half, found = np.pi / PACE, [(x.t, x.mode) for x in changes if x.joint == 'pad_left']
    assert [mode for _, mode in found] == [
        Mode.STICKING, Mode.SLIDING_BACKWARD, Mode.STICKING, Mode.SLIDING_FORWARD,
    ]  # fmt: skip
    assert [t for t, _ in found] == pytest.approx([0.0, begin, end, begin + half], abs=1e-9)


def test_a_soft_floor_is_left_when_its_force_has_ended():
    law = Hertz(1e9)
    ball = ThrownBody(
        [Floor('body', 1.0, law=law)], (0.0, 0.0, 0.01), (0.0, 0.0, -1.0), gravity=(0.0, 0.0)
    )
    ball.run.advance(0.02, final=True, most=100)
    assert ball.run.time == 0.02
    modes = [Mode.FREE_FLIGHT, Mode.FOLLOWING, Mode.FREE_FLIGHT]
    times = [0.0, 0.01, 0.01 + impact_duration(law, 1.0, 1.0)]
    changes = ball.run.drain()[2]
    assert [x.mode for x in changes] == modes
    assert [x.t for x in changes] == pytest.approx(times, rel=1e-9)
