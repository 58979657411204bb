"""Scenes of compound mechanisms: what their sources state, by closed form or by other programs."""

from __future__ import annotations

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.bench.problems.andrews_squeezer import LINKS, relative_angles
from mechanism_sim.bench.problems.andrews_squeezer import error as squeezer_error
from mechanism_sim.bench.problems.andrews_squeezer import scipy as squeezer_by_scipy

SQUEEZER = (
    15.81077119629904, -15.75637105984298, 0.04082224013073101, -0.5347301163226948,
    0.5244099658805304, 0.5347301163226948, 1.048080741042263,
)  # fmt: skip
"""Angles of Andrews' squeezer at 30 ms as the Test Set for IVP Solvers publishes them [rad]."""


def test_andrews_squeezer_ends_where_the_test_set_says():
    solution = ms.simulate(ms.load_scene('andrews_squeezer'), duration=0.03)
    seen = solution.sample([0.0, 0.03])
    start, end = relative_angles(np.array([seen[f'position.{link}'] for link in LINKS])).T
    given = (0.4552798191630704, 0.2226683901658859, 0.4873649795438426,
             -0.2226683901658859, 1.2305474445498212)  # fmt: skip
    assert start == pytest.approx([-0.06171389001427645, 0.0, *given], abs=1e-13)
    assert end == pytest.approx(SQUEEZER, abs=1e-8)  # theirs is 1.4e-9 off
    assert squeezer_error(end) < 1e-12
    assert abs(solution.energy.residual) < 1e-12


def test_andrews_squeezer_by_an_index_1_formulation():
    """The equations of the test set, which share nothing with the scene, give the same."""
    answer = squeezer_by_scipy('DOP853')(1e-12)()().answer
    assert squeezer_error(answer) < 1e-11
    assert answer == pytest.approx(SQUEEZER, abs=1e-8)
