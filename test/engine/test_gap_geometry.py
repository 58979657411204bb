"""Rates of gaps against the pin's place in the complex plane, in the middle of a bushing, too."""

from __future__ import annotations

import numpy as np
import pytest
from four_bars import loose

MACHINE = loose()
RADIAL = MACHINE.plan.clearances['coupler_rocker'].radial
SPEED = 3.0  # [rad/s] of coupler and rocker, which move the pin at about 1 m/s


def moving(off):
    """Coordinates and rates (3, N), the pin at this share of the clearance, on all sides."""
    places, ways = (x.ravel() for x in np.meshgrid(np.arange(0.0, 6.3, 0.7), [0.2, 1.9, 4.5]))
    x, y = off * RADIAL * np.array([np.cos(places), np.sin(places)])
    l, crank = MACHINE.nominal.linkage, np.full_like(x, 0.4)  # noqa: E741 - the lengths
    closed = l.close(l.ground - l.crank * np.cos(crank) + x, y - l.crank * np.sin(crank))
    v = SPEED * np.array([0.0 * ways, np.cos(ways), np.sin(ways)])
    return np.array([crank, *closed]), v


def arms(q):
    """Of the chain from the bushing's centre to the pin's, but for the ground (3, N) [m]."""
    l = MACHINE.nominal.linkage  # noqa: E741
    return np.array([[l.crank], [l.coupler], [-l.rocker]]) * np.exp(1j * q)


@pytest.mark.parametrize('off', [1e-4, 0.3, 0.999])
def test_a_gap_opens_as_fast_as_the_pin_comes_nearer_to_the_centre(off):
    q, v = moving(off)
    Q, rate = arms(q).sum(axis=0) - MACHINE.nominal.linkage.ground, (1j * v * arms(q)).sum(axis=0)
    opens = -(Q.conj() * rate).real / np.abs(Q)
    rounding = 1e-14 / (off * RADIAL)
    found = MACHINE.equations.observer.gaps.rates(q, v)[0]
    np.testing.assert_allclose(found, opens, rtol=1e-12, atol=rounding)


@pytest.mark.parametrize('off', [0.0, 1e-12, 1e-9])
def test_from_the_middle_a_gap_closes_by_the_pins_whole_speed_whichever_way_it_goes(off):
    """Against distances after steps far longer than that from the centre."""
    q, v = moving(off)
    h = 1e-2 * RADIAL / SPEED  # [s]
    seen, none = MACHINE.equations.observer.gaps, np.zeros((0, q.shape[1]))
    before, after = (seen.distances(seen.values(x, none))[0] for x in (q, q + h * v))
    assert before == pytest.approx(RADIAL)
    np.testing.assert_allclose(seen.rates(q, v)[0], (after - before) / h, rtol=2e-6)
