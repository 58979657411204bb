"""Friction that jams contacts: impacts without collision, one and several contacts."""

from __future__ import annotations

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.contact.impact import jam, shock
from mechanism_sim.hybrid.events import gains


def test_a_single_shock_is_the_painleve_impact():
    Ann, Ant, Att, mu, vt = 1.0, 0.9, 1.2, 1.5, 0.3
    (blow,) = shock([[Ann, Ant], [Ant, Att]], [0.0, vt], [-1.0, 0.0], [mu])
    assert blow[:2] == pytest.approx(jam(Ann, Ant, Att, vt, mu)[:2], rel=1e-12)
    p, q, _ = blow
    # vn stays at zero, the slip ends, and friction keeps to its cone
    assert Ann * p + Ant * q == pytest.approx(0.0, abs=1e-15)
    assert vt + Ant * p + Att * q == pytest.approx(0.0, abs=1e-15)
    assert abs(q) <= mu * p


@pytest.mark.parametrize('m', [2])
def test_shocks_of_several_contacts_keep_to_the_laws_and_never_make_energy(m):
    rng = np.random.default_rng(m)
    found = 0
    for _ in range(40):
        J = rng.normal(size=(2 * m, 2 * m + 1))
        A = J @ J.T
        slip = rng.normal(size=m)
        friction = rng.uniform(0.5, 3.0, m)
        # of which one is known to jam
        friction[0] = np.inf
        rate = np.concatenate([np.zeros(m), slip])
        acceleration = np.concatenate([-rng.uniform(0.5, 2.0, m), rng.normal(size=m)])
        try:
            blows = shock(A.tolist(), rate.tolist(), acceleration.tolist(), friction.tolist())
        except ArithmeticError:
            continue
        found += 1
        p, q = (np.array([b[k] for b in blows]) for k in (0, 1))
        x = np.concatenate([p, q])
        after = rate + A @ x
        size = 1e-8 * np.abs(rate).max()
        assert p.min() >= 0.0
        assert after[:m].min() >= -size
        assert np.abs(p * after[:m]).max() <= size * max(1.0, p.max())
        limited = np.isfinite(friction)
        assert (np.abs(q) <= friction * p * (1.0 + 1e-3) + size)[limited].all()
        assert x @ (rate + after) <= 1e-9 * np.abs(x).max() * np.abs(rate).max()
    assert found > 5


def test_sliding_whose_force_grows_without_end_stops_by_a_shock():
    """A joint of the ten links, at mu = 0.3: it ended with a hundredth of its energy missing."""
    clearance = {
        'radial': 2.54e-4, 'restitution': 0.5, 'friction': 0.3, 'hypothesis': 'stronge',
        'pin_radius': 0.0,
    }  # fmt: skip
    overrides = {
        'joints.drag_link_crank.clearance': clearance, 'start': 'centred', 'drive.speed': 6.28,
    }  # fmt: skip
    solution = ms.simulate(ms.load_scene('ten_links', overrides), duration=0.15)
    shocks = [i for i in solution.impacts if i.approach_speed < 1e-9 and i.energy_loss > 1e-5]
    assert [i.t for i in shocks] == pytest.approx([0.135438], abs=1e-5)
    assert max(gains(solution.impacts)) < 1e-15
    energy = solution.energy
    exchanged = abs(energy.initial) + abs(energy.drive_work) + energy.dissipated
    assert abs(energy.residual) < 1e-8 * exchanged
