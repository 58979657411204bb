"""Bounces that follow each other ever faster until they end, and touches that are none."""

from __future__ import annotations

import math

from mechanism_sim.engine.events import Mode
from test.hard.bodies import GRAVITY, SIZE, Floor, ThrownBody, residual
from test.hard.case import Figure, hard_case


@hard_case(
    'Infinitely many bounces in a finite time, for restitutions from 0.1 to 0.95.',
    'A ball thrown up at v comes to rest at 2 v/(g (1 - e)) exactly, with m v (1 + e)/(1 - e) of '
    'impulse in all.',
)
def bouncing_ball() -> list[Figure]:
    """Time of rest and sum of impulses, the largest relative error over all restitutions."""
    time = impulse = depth = energy = 0.0
    v = 1.0
    for e in (0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95):
        ball = ThrownBody([Floor('body', e)], (0.0, 0.0, 1e-15), (0.0, 0.0, v))
        rest = 2.0 * v / (GRAVITY * (1.0 - e))
        ball.until(1.1 * rest)
        last = ball.impacts[-1]
        ended = [m.t for m in ball.modes if m.mode == Mode.FOLLOWING] == [last.t]
        left = last.chatter_time
        time = max(time, abs((last.t + left) / rest - 1.0) if ended else math.inf)
        # while the bounces left out would have lasted, the floor carries the weight instead
        total = sum(i.normal_impulse for i in ball.impacts) + GRAVITY * left
        exact = v * (1.0 + e) / (1.0 - e)
        impulse = max(impulse, abs(total / exact - 1.0))
        depth = max(depth, ball.audit.max_penetration)
        energy = max(energy, abs(residual(ball.audit.energy)))
    return [
        Figure('relative error of the time of rest', time, 1e-9),
        Figure('relative error of the sum of impulses', impulse, 1e-9),
        Figure('penetration', depth, 1e-14, 'm'),
        Figure('energy residual', energy, 1e-12, 'J'),
    ]


@hard_case(
    'The same at tolerances from 1e-4 to 1e-13: how much of the chatter is cut.',
    'The time of rest 2 v/(g (1 - e)); bounces are cut that rise less than h = rtol L (1 - e), '
    'which would have lasted 2 sqrt(2 h/g)/(1 - e).',
)
def bouncing_tolerances() -> list[Figure]:
    """Error of the time of rest, and what was cut beside what the rule allows."""
    worst = short = 0.0
    v, e = 1.0, 0.8
    rest = 2.0 * v / (GRAVITY * (1.0 - e))
    for exponent in range(4, 14):
        rtol = 10.0**-exponent
        ball = ThrownBody([Floor('body', e)], (0.0, 0.0, 1e-15), (0.0, 0.0, v), rtol)
        ball.until(1.1 * rest)
        error = ball.impacts[-1].t + ball.impacts[-1].chatter_time - rest
        cut = math.sqrt(8.0 * rtol * SIZE / (GRAVITY * (1.0 - e)))
        short = max(short, ball.impacts[-1].chatter_time / max(cut, 1e-6))
        worst = max(worst, abs(error) / rest)
    return [
        Figure('relative error of the time of rest', worst, 1e-9),
        Figure('time cut over sqrt(8 rtol L/(g (1 - e)))', short, 1.0 + 1e-9),
    ]


@hard_case(
    'A touch without crossing: a path whose lowest point misses the floor by a hair, or does not.',
    'The parabola: a ball in a field that points up at first passes the floor at a height known '
    'in closed form; above it no impact may be found, below it exactly one.',
)
def grazing_touch() -> list[Figure]:
    """Impacts counted where there are none, and missed where there is one."""
    wrong = 0
    slowest = 0.0
    for miss in (1e-6, 1e-9, 1e-12, 1e-14):
        for sign in (1.0, -1.0):
            # thrown down at 1 m/s in a field that pulls up: the vertex lies at h - v^2/(2 g)
            start = 0.5 / GRAVITY + sign * miss
            ball = ThrownBody(
                [Floor('body', 0.5)], (0.0, 0.0, start), (0.0, 0.0, -1.0), gravity=(0.0, GRAVITY)
            )
            ball.until(0.3)
            wrong += len(ball.impacts) != (0 if sign > 0.0 else 1)
            if sign < 0.0 and ball.impacts:
                exact = math.sqrt(2.0 * GRAVITY * miss)
                error = abs(ball.impacts[0].approach_speed / exact - 1.0) * miss
                slowest = max(slowest, error)
    return [
        Figure('wrong counts of 8', wrong, 0.0),
        Figure('error of the approach speed, as a height', slowest, 1e-15, 'm'),
    ]


@hard_case(
    'Sliding that turns into rolling, and rolling that must not slide again.',
    'A disc of m r^2/2 set down at v without spin rolls after v/(3 mu g), at 2 v/3.',
)
def sliding_to_rolling() -> list[Figure]:
    """Time at which sliding ends, speed afterwards, and the energy that friction took."""
    mu, v, r = 0.3, 2.0, 0.5
    disc = ThrownBody(
        [Floor('body', 0.5, mu, r)],
        (0.0, 0.0, r),
        (0.0, v, 0.0),
        inertia=0.5 * r * r,
        closed=True,
    )
    disc.until(1.0)
    t = v / (3.0 * mu * GRAVITY)
    stuck = [m.t for m in disc.modes if m.mode == Mode.STICKING]
    speed = float(disc.at(0.9, 1)[1])
    balance = disc.audit.energy
    lost = balance.dissipated if balance else math.inf
    return [
        Figure('changes to rolling', len(stuck) - 1, 0.0),
        Figure('time of rolling', stuck[0] - t if stuck else math.inf, 1e-12, 's'),
        Figure('speed afterwards', speed - 2.0 * v / 3.0, 1e-12, 'm/s'),
        Figure('loss by friction', lost - v * v / 6.0, 1e-12, 'J'),
    ]


@hard_case(
    'A block on an incline whose slope is the friction itself, a hair more, or a hair less.',
    'Coulomb: it stays at rest up to tan(slope) = mu; beyond it slides at g (sin - mu cos).',
)
def block_on_an_incline() -> list[Figure]:
    """Displacement within one second where it should rest, and error where it slides."""
    mu = 0.4
    moved = slid = 0.0
    for excess in (-0.1, -1e-6, -1e-12, 1e-6, 1e-3, 0.1):
        slope = math.atan(mu) + excess
        field = (GRAVITY * math.sin(slope), -GRAVITY * math.cos(slope))
        block = ThrownBody(
            [Floor('body', 0.0, mu)], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), gravity=field, closed=True
        )
        block.until(1.0)
        x = float(block.at(1.0)[1])
        if excess < 0.0:
            moved = max(moved, abs(x))
        else:
            exact = 0.5 * GRAVITY * (math.sin(slope) - mu * math.cos(slope))
            slid = max(slid, abs(x - exact))
    return [
        Figure('way where it should rest', moved, 1e-13, 'm'),
        Figure('error of the way where it slides', slid, 1e-12, 'm'),
    ]
