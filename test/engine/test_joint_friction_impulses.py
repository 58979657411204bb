"""Friction in ideal joints during impacts obeys Coulomb's law beside every other friction."""

from __future__ import annotations

import numpy as np
import pytest

from mechanism_sim.engine.contact.joint_friction import JointFrictionProblem, friction_impulses


@pytest.mark.parametrize('k', [1, 2, 3])
def test_each_friction_ends_its_slip_or_is_at_its_bound_against_what_is_left(k):
    """Of k joints that act on each other, each pressed by its own force in two components."""
    rng = np.random.default_rng(k)
    stuck = slid = 0
    for _ in range(50):
        J = rng.normal(size=(1 + k, 2 * k + 2))
        A = J @ J.T  # rates of a contact and of k slips per unit impulse
        x, rate = np.array([rng.uniform(0.5, 1.0)]), rng.normal(size=k)
        forces = rng.normal(size=(2 * k, 1 + k))
        forces[:, 1:] *= 0.1  # they press on each other, a little
        mu = rng.uniform(0.1, 1.0, k)
        ends, owner = 2 * np.arange(1, k + 1), np.arange(k)
        none = np.zeros((k, 0))
        walls = np.zeros(k, dtype=int)
        friction = JointFrictionProblem(rate, none, A[:, 1:], none, forces, mu, ends, owner, walls)
        T = friction_impulses(friction, x, np.zeros(k))
        slip = rate + A[1:, 0] * x[0] + A[1:, 1:] @ T
        pressed = (forces @ np.concatenate([x, T])).reshape(k, 2)
        bound = mu * np.hypot(*pressed.T)
        assert (np.abs(T) <= bound * (1.0 + 1e-9)).all()
        holds = np.abs(slip) < 1e-9
        assert T[~holds] == pytest.approx(-bound[~holds] * np.sign(slip[~holds]), rel=1e-9)
        stuck, slid = stuck + holds.sum(), slid + (~holds).sum()
    assert min(stuck, slid) > 5


def test_a_wall_that_is_not_pressed_does_not_rub():
    """Of a guide's two walls, whose force has one component, the one against which it points."""
    rng = np.random.default_rng(4)
    idle = 0
    for _ in range(50):
        force, mu, rate = rng.normal(), rng.uniform(0.1, 1.0), 10.0
        none, one = np.zeros((1, 0)), np.ones(1)
        for wall in (-1, 1):
            friction = JointFrictionProblem(
                np.array([rate]), none, np.array([[0.0], [1.0]]), none, np.array([[force, 0.0]]),
                np.array([mu]), np.array([1]), np.array([0]), np.array([wall]),
            )  # fmt: skip
            (T,) = friction_impulses(friction, one, np.zeros(1))
            assert pytest.approx(-mu * max(wall * force, 0.0), abs=1e-15) == T
            idle += T == 0.0
    assert idle == 50
