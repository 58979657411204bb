"""An event loop for the loose four-bar alone, as fast as numba makes it.

* Flight: the angles of coupler and rocker, which are independent.
* Following: the *contact angle* eta is the one coordinate; coupler and rocker follow from the
  closed loop by algebra (no inverse functions), so that nothing drifts.
* Events are looked for on the dense output, at eight points and in the minima between them; the
  step is then taken again to end at the event, where the dense output is not as good as the step.
* Chatter ends by a height: what is left of it displaces nothing by more than the tolerance.
"""

from __future__ import annotations

from math import atan2

import numpy as np
from numba import njit

from benchmarks.kernels.dop853 import ROWS, resize, stepper
from benchmarks.kernels.loose_equations import (
    bearing,
    close_loop,
    fly,
    follow,
    gap,
    pull,
)  # fmt: skip

LOOK = 8  #: points of a step at which a guard is looked at
SHARP = 1000.0  #: error allowed in the contact angle, in units of that of the links
SWAY = 1000.0  #: [rad/s] what its rate may be wrong by for an error of 1 rad, tried out

_fly_step, _fly_densify, _fly_dense = stepper(fly, 4)
_follow_step, _follow_densify, _follow_dense = stepper(follow, 2)


@njit(error_model='numpy')
def _gap_at(x, t, h, y, F, p, z):
    _fly_dense(y, F, x, z)
    return gap(t + x * h, z[0], z[1], p)


@njit(error_model='numpy')
def _force_at(x, t, h, y, F, p, z):
    _follow_dense(y, F, x, z[:2])
    return follow(t + x * h, z[:2], p, z[2:])


def _finder(guard):
    """Compiled search for the first fall of a guard through zero on a dense output."""

    @njit(error_model='numpy')
    def root(a, fa, b, fb, t, h, y, F, p, z):
        """Between a, where the guard is positive, and b, by the Illinois rule."""
        side = 0
        for _ in range(60):
            x = (a * fb - b * fa) / (fb - fa)
            f = guard(x, t, h, y, F, p, z)
            if f <= 0.0:
                fa = 0.5 * fa if side == -1 else fa
                b, fb, side = x, f, -1
            else:
                fb = 0.5 * fb if side == 1 else fb
                a, fa, side = x, f, 1
            if b - a <= 1e-14 or abs(f) < 1e-19:
                break
        return x

    @njit(error_model='numpy')
    def first_fall(t, h, y, F, p, z, values, rising):
        """Fraction of the step at which the guard first falls through zero; 2 if it does not.

        `rising`: the guard starts at zero, and rises.
        """
        for i in range(1, LOOK + 1):
            values[i] = guard(i / LOOK, t, h, y, F, p, z)
            a, b = (i - 1) / LOOK, i / LOOK
            if values[i] <= 0.0:
                fa = values[i - 1]
                if i == 1 and rising:  # step away from the root it started from
                    a, fa = 0.5 * b, guard(0.5 * b, t, h, y, F, p, z)
                    for _ in range(40):
                        if fa > 0.0:
                            break
                        b, values[i] = a, fa
                        a *= 0.5
                        fa = guard(a, t, h, y, F, p, z)
                return root(a, fa, b, values[i], t, h, y, F, p, z)
            if i >= 2 and values[i - 1] < min(values[i], values[i - 2]):
                # a parabola through three points tells whether it may dip below zero between
                slope = 0.5 * (values[i] - values[i - 2])
                bend = values[i] - 2.0 * values[i - 1] + values[i - 2]
                lowest = values[i - 1] - slope * slope / (2.0 * bend)
                if lowest < 0.5 * values[i - 1]:
                    lo, hi = (i - 2) / LOOK, b
                    for _ in range(40):  # golden section would save little
                        m1, m2 = lo + 0.382 * (hi - lo), hi - 0.382 * (hi - lo)
                        f1 = guard(m1, t, h, y, F, p, z)
                        f2 = guard(m2, t, h, y, F, p, z)
                        if min(f1, f2) <= 0.0:
                            m, f = (m1, f1) if f1 <= 0.0 else (m2, f2)
                            return root((i - 2) / LOOK, values[i - 2], m, f, t, h, y, F, p, z)
                        lo, hi = (lo, m2) if f1 < f2 else (m1, hi)
        return 2.0

    return first_fall


_first_gap, _first_force = _finder(_gap_at), _finder(_force_at)


@njit(error_model='numpy')
def revolve(p, start, following, end, rtol, times):
    """Run from t = 0 to `end` [s].

    `start` holds th3, th4, w3, w4 [rad, rad/s]; `times` (n,) takes the times of the first n
    impacts. Returns th3, th4, steps, impacts.
    """
    c, e = p.c, p.e
    height = max(0.1 * rtol * (1.0 - e), 8.0 * 2.3e-16) * p.size
    y, new, z = start.copy(), np.empty(4), np.empty(4)
    K, F, values = np.empty((ROWS, 4)), np.empty((7, 4)), np.empty(LOOK + 1)
    u, unew, Ku, Fu = np.empty(2), np.empty(2), np.empty((ROWS, 2)), np.empty((7, 2))
    atol, atolu = np.full(4, 0.1 * rtol), np.empty(2)
    sharp = SHARP * rtol
    atolu[0], atolu[1] = sharp, sharp * SWAY
    t, steps, impacts, touching = 0.0, 0, 0, False
    h_fly = h_follow = 1e-3 / p.w2
    if following:
        x, w, _, _, slide, _, _, _ = bearing(t, y, p)
        u[0], u[1] = atan2(w, x), slide / c
    while t < end:
        if following:
            h = min(h_follow, end - t)
            follow(t, u, p, Ku[0])
            while True:
                error, low, high, last = _follow_step(t, u, h, Ku, p, 0.0, atolu, unew)
                steps += 1
                if error > 1.0:
                    h = resize(h, error)
                    continue
                h_follow = resize(h, error)
                at = 2.0
                if low < 0.4 * high or low < 0.0:
                    values[0] = follow(t, u, p, Ku[0])
                    _follow_densify(t, u, h, Ku, p, unew, Fu)
                    at = _first_force(t, h, u, Fu, p, z, values, False)
                if at <= 1.0:
                    h_follow = h
                    before = _force_at(max(at - 0.01, 0.0), t, h, u, Fu, p, z)
                    slope = (0.0 - before) / (min(0.01, at) * h)
                    h *= at
                    _, _, _, last = _follow_step(t, u, h, Ku, p, 0.0, atolu, unew)
                    shift = -last / slope
                    t += h + shift
                    for k in range(2):
                        u[k] = unew[k] + shift * Ku[12, k]
                    following = False
                else:
                    t = end if h == end - t else t + h
                    u[:] = unew
                    if t < end:
                        Ku[0] = Ku[12]
                        h = min(h_follow, end - t)
                        continue
                break
            _, _, _, _, s3, c3, s4, c4, w3, w4, _ = close_loop(t, u[0], u[1], p)
            y[0], y[1], y[2], y[3] = atan2(s3, c3), atan2(s4, c4), w3, w4
            touching = True
            h_fly = max(h_fly, h_follow)
            continue
        h = min(h_fly, end - t)
        fly(t, y, p, K[0])
        rising = touching
        while True:
            error, _, _, _ = _fly_step(t, y, h, K, p, rtol, atol, new)
            steps += 1
            if error > 1.0:
                h = resize(h, error)
                continue
            h_fly = resize(h, error)
            values[0] = 0.0 if rising else gap(t, y[0], y[1], p)
            _fly_densify(t, y, h, K, p, new, F)
            at = _first_gap(t, h, y, F, p, z, values, rising)
            rising = False
            if at > 1.0:
                t = end if h == end - t else t + h
                y[:] = new
                if t < end:
                    K[0] = K[12]
                    h = min(h_fly, end - t)
                    continue
                break
            h_fly = h
            h *= at
            _fly_step(t, y, h, K, p, rtol, atol, new)
            _, _, r, approach, _, _, _, _ = bearing(t + h, new, p)
            shift = (c - r) / approach
            t += h + shift
            for k in range(4):
                y[k] = new[k] + shift * K[12, k]
            x, w, _, approach, slide, k3, k4, mass = bearing(t, y, p)
            if impacts < times.size:
                times[impacts] = t
            impacts += 1
            back = pull(t, y, p)
            speed = e * approach
            following = back < 0.0 and speed * speed <= -2.0 * back * height
            impulse = (1.0 + (0.0 if following else e)) * mass * approach
            y[2] -= impulse * k3 / p.I3
            y[3] += impulse * k4 / p.I4
            touching = True
            if following:
                x, w, _, _, slide, _, _, _ = bearing(t, y, p)
                u[0], u[1] = atan2(w, x), slide / c
            elif back < 0.0:
                h_fly = min(h_fly, -2.4 * speed / back)
            break
    return y[0], y[1], steps, impacts
