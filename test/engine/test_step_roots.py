"""The first fall of a guard in a step: the bits of heyoka's own, and the root of the series."""

from __future__ import annotations

import ctypes
import math

import heyoka as hy
import numpy as np
import pytest

from mechanism_sim.engine.clock import rounded_sum
from mechanism_sim.engine.step_roots import NO_FALL, UNSURE, first_fall, root_arrays
from mechanism_sim.numerics.kernels import foreign_code


class Oscillator:
    """A Duffing oscillator with a guard that moves, integrated by heyoka."""

    def __init__(self, tolerance: float) -> None:
        x, v = hy.make_vars('x', 'v')
        guard = x - hy.par[2] + hy.par[3] * hy.sin(hy.par[4] * hy.time)
        fall = hy.t_event(
            guard,
            direction=hy.event_direction.negative,
            cooldown=0.0,
            callback=lambda *_: False,
        )
        self.ta = hy.taylor_adaptive(
            [(x, v), (v, -hy.par[0] * x - hy.par[1] * v**3)],
            [0.0, 0.0],
            pars=[0.0] * 5,
            tol=tolerance,
            t_events=[fall],
        )
        self.code = foreign_code(self.ta.llvm_state.object_code, 'step_e')
        assert self.code
        step = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 6)
        self._step = step(self.code.addresses[0])

    def series(self, most: float) -> tuple[np.ndarray, float]:
        """Taylor series of the guard from the present state, and the length of a step [s]."""
        ta, jets = self.ta, np.zeros((3, self.ta.order + 1))
        h, time, largest = np.array([most]), np.array([ta.time]), np.zeros(1)
        state, pars = ta.state.copy(), ta.pars.copy()
        given = (jets, state, pars, time, h, largest)
        self._step(*(x.ctypes.data for x in given))
        return jets[2], float(h[0])


@pytest.mark.parametrize('tolerance', [1e-4, 1e-10, 1e-16])
def test_a_fall_has_the_bits_of_heyokas(tolerance):
    """Steps that begin anywhere, or within a rounding of a root, as flights do."""
    rng, heyoka = np.random.default_rng(5), Oscillator(tolerance)
    ta, work = heyoka.ta, root_arrays(heyoka.ta.order + 1)
    falls = none = unsure = 0
    for k in range(1500):
        pars = [*rng.uniform(0.1, 30.0, 1), *rng.normal(size=3), rng.uniform(0.1, 20.0)]
        pars[3] *= rng.choice([0.0, 0.1, 1.0])
        ta.state[:], ta.time = rng.normal(size=2) * (1.0, 3.0), rng.uniform(-5.0, 5.0)
        if k % 3 == 0:
            at = ta.state[0] + pars[3] * math.sin(pars[4] * ta.time)
            pars[2] = at - rng.choice([1e-18, -1e-18, 1e-17, -1e-16, 1e-9, -1e-9])
        ta.pars[:] = pars
        ta.reset_cooldowns()
        most = float(rng.choice([0.05, 0.3, 2.0]))
        guard, h = heyoka.series(most)
        outcome, taken = ta.step(most)
        fell = -100 < int(outcome) < 0
        found = first_fall(guard, h, work)
        if found == UNSURE:
            unsure += 1
        elif found == NO_FALL:
            assert not fell
            none += 1
        else:
            assert fell
            assert found == taken
            roots = np.polynomial.polynomial.polyroots(guard * h ** np.arange(len(guard)))
            real = np.sort(roots[abs(roots.imag) < 1e-7].real) * h
            assert abs(real - found).min() < 1e-6 * h
            falls += 1
    assert falls > 60
    assert none > 1000
    assert unsure < 0.3 * 1500


def test_what_begins_at_a_root_or_touches_one_is_left_to_heyoka():
    work = root_arrays(4)
    assert first_fall(np.array([0.0, -1.0, 0.0, 0.0]), 0.5, work) == UNSURE
    assert first_fall(np.array([0.0625, -0.5, 1.0, 0.0]), 0.5, work) == UNSURE  # (x - 1/4)^2
    assert first_fall(np.array([math.nan, 1.0, 0.0, 0.0]), 0.5, work) == UNSURE
    assert first_fall(np.array([-1e-18, 1.0, 0.0, 0.0]), 0.5, work) == NO_FALL
    up_and_down = first_fall(np.array([-1e-18, 1.0, -3.0, 0.0]), 0.5, work)
    assert up_and_down == pytest.approx(1.0 / 3.0, rel=1e-15)
    down, up = np.array([0.02, -0.3, 1.0, 0.0]), np.array([-0.02, 0.3, -1.0, 0.0])
    assert first_fall(down, 0.5, work) == pytest.approx(0.1, rel=1e-14)
    assert first_fall(up, 0.5, work) == pytest.approx(0.2, rel=1e-14)


def test_the_time_of_an_event_is_rounded_once():
    """As `math.fsum` does it; a sum that it cannot tell is said to be none."""
    rng, told = np.random.default_rng(8), 0
    for _ in range(20_000):
        high = rng.uniform(0.0, 1e4) * 10.0 ** rng.integers(-3, 4)
        low = 0.5 * rng.uniform(-1.0, 1.0) * math.ulp(high)
        tau = rng.uniform(0.0, 1.0) * 10.0 ** rng.integers(-18, 1)
        found = rounded_sum(high, low, tau)
        told += found == math.fsum((high, low, tau))
        assert found == math.fsum((high, low, tau)) or math.isnan(found)
    assert told > 19_900
    half, bit = 0.5 * math.ulp(1.0), 2.0**-160
    for low, tau in ((bit, half), (-bit, half), (bit, 3.0 * half), (-bit, 3.0 * half)):
        found = rounded_sum(1.0, low, tau)
        assert math.isnan(found) or found == math.fsum((1.0, low, tau))
    assert rounded_sum(0.0, 0.0, 0.3) == 0.3
