"""Rattling gears by SciPy and events of our own; here the solution is held against formulas.

Nothing here is chaotic: an error of the start shrinks at every impact, and the gears come to rest
on their flanks twice a cycle of the load.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from event_solution import LOWEST_BOUNCE, solve
from rattling import GearRattle

MOTOR = {'pinion_inertia': 1e-3, 'stall_torque': 5.0, 'no_load_speed': 52.0}
GEARS = {
    'load': GearRattle(),
    'hard gears': GearRattle(load=0.2, restitution=0.7),
    'ripple': GearRattle(load=0.2, swing=0.0, ripple=3.0),
    'motor': GearRattle(**MOTOR, drag=1e-3),
}
CYCLE = 2 * math.pi / 100.0
cases = pytest.mark.parametrize('name', GEARS)


@cache
def rattle(gears, cycles=4, rtol=1e-13):
    return solve(gears.machine, *gears.start, cycles * CYCLE, rtol=rtol)


def lead(gears, t, x, v, since):
    """x and x' by the integrated equation, for a pinion on a prescribed way and no drag."""
    b1, b2 = gears.base_radii
    w, J = gears.frequency, gears.wheel_inertia
    # x'' = A + B cos(w t) + C sin(w t)
    A, B, C = b2 * gears.load / J, b1 * gears.ripple * w, b2 * gears.swing / J

    def integrals(s):
        turned = math.cos(w * s), math.sin(w * s)
        return (
            A * s + (B * turned[1] - C * turned[0]) / w,
            A * s * s / 2 - (B * turned[0] + C * turned[1]) / w**2,
        )

    (rate, place), (rate0, place0) = integrals(t), integrals(since)
    return x + place - place0 + (v - rate0) * (t - since), v + rate - rate0


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', ['load', 'hard gears', 'ripple'])
def test_every_flight_is_the_integrated_equation_from_impact_to_impact(name):
    gears = GEARS[name]
    motion, half = rattle(gears), gears.normal_play / 2
    t, x, v = 0.0, 0.0, 0.0
    touched = {c.t for c in motion.changes if c.touches}
    released = [c for c in motion.changes if not c.touches]
    for impact in motion.impacts:
        sign = 1.0 if impact.wall == 'drive' else -1.0
        between = [lead(gears, s, x, v, t)[0] for s in np.linspace(t, impact.t, 51)[1:-1]]
        assert np.abs(between).max() < half + 1e-14
        place, rate = lead(gears, impact.t, x, v, t)
        assert place == pytest.approx(sign * half, abs=1e-14)
        assert sign * rate == pytest.approx(impact.approach, abs=1e-11)
        t, x, v = impact.t, sign * half, -gears.restitution * rate
        if impact.t in touched and released:
            # contact ends where x'' falls through zero
            t, v = released.pop(0).t, 0.0
            assert gears.mesh_force(t) == pytest.approx(0.0, abs=1e-9)
    assert len(motion.impacts) > 40
    assert {i.wall for i in motion.impacts} == {'drive', 'coast'}


@pytest.mark.sample(1)
@cases
def test_impacts_stay_where_they_are_at_a_coarser_tolerance(name):
    fine, coarse = rattle(GEARS[name]), rattle(GEARS[name], rtol=1e-11)
    assert [i.wall for i in fine.impacts] == [i.wall for i in coarse.impacts]
    apart = [abs(a.t - b.t) for a, b in zip(fine.impacts, coarse.impacts, strict=True)]
    assert max(apart) < 1e-9


@pytest.mark.sample(2)
@cases
def test_a_small_error_of_the_start_shrinks(name):
    gears = GEARS[name]
    (th1, th2), v = gears.start
    other = solve(gears.machine, (th1, th2 + 1e-8), v, 4 * CYCLE)
    times = [
        np.array([i.t for i in m.impacts if i.approach > 1e-3]) for m in (rattle(gears), other)
    ]
    apart = np.abs(times[0] - times[1])
    assert 0.0 < apart[0] < 1e-6
    assert apart[times[0] > 3 * CYCLE].max() < 1e-10


@cases
def test_energy_is_work_of_drive_and_load_less_losses(name):
    gears = GEARS[name]
    motion = rattle(gears)
    inertia = np.array([gears.pinion_inertia, gears.wheel_inertia])
    free = np.isfinite(inertia)
    start, end = motion.sample([0.0, motion.steps[-1].end])[2:].T

    def power(t, q, v, *_):
        return (inertia[free, None] * gears.acceleration(t, q, v)[free] * v[free]).sum(axis=0)

    gained = (inertia[free] * (end[free] ** 2 - start[free] ** 2) / 2).sum()
    drive = 0.0 if free[0] else motion.drive_work(0)
    assert motion.loss > 1e-3
    assert gained == pytest.approx(motion.integral(power) + drive - motion.loss, abs=1e-11)


def test_elastic_gears_without_load_strike_at_equal_times():
    gears = GearRattle(
        restitution=1.0, load=0.0, swing=0.0, pinion_inertia=1e-3, no_load_speed=math.inf
    )
    b1, b2 = gears.base_radii
    ahead = 1.3
    motion = solve(gears.machine, (0, 0), (50.0 + ahead, -25.0), 0.1)
    between = gears.normal_play / (b1 * ahead)
    for n, impact in enumerate(motion.impacts):
        assert impact.t == pytest.approx((n + 0.5) * between, abs=1e-12)
        assert impact.wall == ('drive', 'coast')[n % 2]
        mass = 1 / (b1**2 / 1e-3 + b2**2 / 2e-3)
        assert impact.impulse == pytest.approx(2 * mass * b1 * ahead, rel=1e-9)
    assert len(motion.impacts) == math.floor(0.1 / between + 0.5)


def test_bounces_on_one_flank_shrink_by_the_restitution():
    gears = GearRattle(swing=0.0)
    motion = solve(gears.machine, *gears.start, 0.1)
    b2, e = gears.base_radii[1], gears.restitution
    pull = b2 * gears.load / gears.wheel_inertia
    first = math.sqrt(gears.normal_play / pull)
    times = [first]
    for n in range(1, 9):
        times.append(times[-1] + 2 * e**n * first)
    assert [i.t for i in motion.impacts[:9]] == pytest.approx(times, abs=1e-13)
    # the sum of the series, but for bounces that are too low
    (seated,) = motion.changes
    cut = first * (1 + 2 * e / (1 - e)) - seated.t
    assert 0.0 < cut < 2 * math.sqrt(2 * LOWEST_BOUNCE / pull) / (1 - e)
    assert motion.sample([0.1])[3, 0] == pytest.approx(-25.0, abs=1e-12)


@pytest.mark.sample(1)
@pytest.mark.parametrize('gears', [GEARS['load'], GearRattle(**MOTOR)], ids=['load', 'motor'])
def test_without_backlash_the_ideal_pair_comes_back(gears):
    """Where x'' falls through zero the play j is crossed as t^3: rates are off by j^(2/3)."""
    b2 = gears.base_radii[1]
    times = np.linspace(CYCLE, 3 * CYCLE, 400)
    fastest = []
    for play in (1e-5, 1e-6, 1e-7):
        close = replace(gears, play=play)
        motion = solve(close.machine, *close.start, 3 * CYCLE)
        fastest.append(max(i.approach for i in motion.impacts if i.t > CYCLE))
        off = np.abs(motion.sample(times)[3] - ideal_rate(close, times)).max()
        assert off < 1.1 * fastest[-1] / b2
    assert np.array(fastest[:-1]) / fastest[1:] == pytest.approx(10 ** (2 / 3), rel=0.05)


def ideal_rate(gears, t):
    """Of gear 2 without play; a motor's speed from its linear equation J w' = A - d w - s sin."""
    k = gears.base_radii[0] / gears.base_radii[1]
    if math.isinf(gears.pinion_inertia):
        return -k * gears.speed + 0.0 * t
    d, w = gears.stall_torque / gears.no_load_speed, gears.frequency
    J = gears.pinion_inertia + k**2 * gears.wheel_inertia
    mean = (gears.stall_torque - k * gears.load) / d
    forced = k * gears.swing / (d + 1j * w * J)
    swing = np.imag(forced * np.exp(1j * w * t))
    rest = gears.speed - mean + forced.imag
    return -k * (mean - swing + rest * np.exp(-d / J * t))


def test_the_impulse_of_a_cycle_is_that_of_the_ideal_mesh():
    """Gear 2 neither gains nor loses speed over a cycle, whatever the flights."""
    gears = GEARS['load']
    motion = rattle(gears)
    change = motion.changes[-1].t  # well into the periodic motion
    end = [c.t for c in motion.changes if not c.touches and c.wall == 'drive']
    start, stop = end[-2], end[-1]
    assert change >= start
    struck = sum(
        i.impulse * (1 if i.wall == 'drive' else -1) for i in motion.impacts if start < i.t < stop
    )
    nodes, weights = np.polynomial.legendre.leggauss(8)
    for step in motion.steps:
        if step.wall is not None and start < (step.start + step.end) / 2 < stop:
            t = step.start + (step.end - step.start) * (nodes + 1) / 2
            sign = 1 if step.wall.name == 'drive' else -1
            force = motion.machine.force(step.wall, t, *np.split(step.dense(t), 2))
            assert sign * gears.mesh_force(t) == pytest.approx(force, abs=1e-9)
            struck += sign * weights @ force * (step.end - step.start) / 2
    assert stop - start == pytest.approx(CYCLE, abs=1e-10)
    assert struck == pytest.approx(gears.load * CYCLE / gears.base_radii[1], rel=1e-9)


def test_there_are_five_to_twenty_hard_impacts_a_cycle():
    for name in ('load', 'hard gears', 'motor'):
        motion = rattle(GEARS[name])
        hardest = max(i.impulse for i in motion.impacts)
        last = [i for i in motion.impacts if i.t > 3 * CYCLE and i.impulse > 0.1 * hardest]
        assert 5 <= len(last) <= 20
        assert all(a.t < b.t for a, b in pairwise(motion.impacts))
