"""An event loop for one coordinate between walls, as fast as numba makes it.

Flights by DOP853; events are looked for on the dense output at eight points and where the way
turns back between them, and the step is then taken again to end there. In contact nothing is
integrated.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import njit

from benchmarks.kernels.dop853 import ROWS, STAGES, resize, stepper

LOOK = 8  #: points of a step at which the way is looked at


@cache
def bouncer(pull: Callable[..., float]) -> Any:
    """Compiled run of a coordinate whose acceleration is ``pull(t, z, v, p)``."""
    pull = njit(error_model='numpy')(pull)

    @njit(error_model='numpy')
    def rate(t, y, p, out):
        out[0], out[1] = y[1], pull(t, y[0], y[1], p)
        return 0.0

    step, densify, dense = stepper(rate, 2)

    @njit(error_model='numpy')
    def root(a, fa, b, fb, y, F, z, wall, side):
        """Zero of the distance from a wall, between a and b, by the Illinois rule."""
        last = 0
        x = b
        for _ in range(60):
            x = (a * fb - b * fa) / (fb - fa)
            dense(y, F, x, z)
            f = side * (z[0] - wall)
            if f <= 0.0:
                fa = 0.5 * fa if last == -1 else fa
                b, fb, last = x, f, -1
            else:
                fb = 0.5 * fb if last == 1 else fb
                a, fa, last = x, f, 1
            if b - a <= 1e-14 or abs(f) < 1e-19:
                break
        return x

    @njit(error_model='numpy')
    def first_touch(h, y, F, z, low, high, leaving):
        """Fraction of the step at which a wall is touched first, and its side; 2 if none is.

        `leaving`: the side of the wall from which the step starts, 0 if it starts from none.
        """
        a, za, va = 0.0, y[0], y[1]
        for i in range(1, LOOK + 1):
            b = i / LOOK
            dense(y, F, b, z)
            zb, vb = z[0], z[1]
            for side in (1, -1):
                wall = low if side == 1 else high
                ga, gb = side * (za - wall), side * (zb - wall)
                dips = side * va < 0.0 < side * vb and ga + side * va * h / LOOK < 0.0
                if gb > 0.0 and dips:  # it may have come and gone
                    lo, hi = a, b
                    for _ in range(40):
                        m = 0.5 * (lo + hi)
                        dense(y, F, m, z)
                        gm = side * (z[0] - wall)
                        if gm <= 0.0:
                            return root(a, ga, m, gm, y, F, z, wall, side), side
                        lo, hi = (m, hi) if side * z[1] < 0.0 else (lo, m)
                if gb <= 0.0:
                    at, gat = a, ga
                    if i == 1 and leaving == side:  # step away from the root it started from
                        for _ in range(40):
                            at = 0.5 * b
                            dense(y, F, at, z)
                            gat = side * (z[0] - wall)
                            if gat > 0.0:
                                break
                            b, gb = at, gat
                    return root(at, gat, b, gb, y, F, z, wall, side), side
            a, za, va = b, zb, vb
        return 2.0, 0

    @njit(error_model='numpy')
    def release(t, stop, longest, wall, side, p):
        """Time at which contact with a wall ends, or `stop`."""
        a, fa = t, side * pull(t, wall, 0.0, p)
        while a < stop:
            b = min(a + longest, stop)
            fb = side * pull(b, wall, 0.0, p)
            if fb > 0.0:
                last = 0
                for _ in range(60):
                    x = (a * fb - b * fa) / (fb - fa)
                    f = side * pull(x, wall, 0.0, p)
                    if f <= 0.0:
                        fb = 0.5 * fb if last == -1 else fb
                        a, fa, last = x, f, -1
                    else:
                        fa = 0.5 * fa if last == 1 else fa
                        b, fb, last = x, f, 1
                    if b - a <= 4e-16 * b or f == 0.0:
                        break
                return b
            a, fa = b, fb
        return stop

    @njit(error_model='numpy')
    def run(p, low, high, e, seated, stops, longest, size, rtol, times, speeds):
        """Run from t = 0 to the last of `stops`; writes times and speeds of impacts.

        Returns steps, impacts.
        """
        height = max(0.1 * rtol * (1.0 - e) * size, 1e-18)
        y, new, z = np.empty(2), np.empty(2), np.empty(2)
        K, F, atol = np.empty((ROWS, 2)), np.empty((7, 2)), np.empty(2)
        atol[0], atol[1] = rtol * size, rtol * size / longest
        y[0], y[1] = (low if seated else 0.5 * (low + high)), 0.0
        t, h, steps, impacts = 0.0, longest, 0, 0
        side, leaving, fresh = (1 if seated else 0), 0, False
        for stop in stops:
            while t < stop:
                if side:
                    wall = low if side == 1 else high
                    t = release(t, stop, longest, wall, side, p)
                    if t < stop:
                        y[0], y[1] = wall, 0.0
                        leaving, side, fresh, h = side, 0, True, 0.05 * longest
                    continue
                rate(t, y, p, K[0])
                h = min(h, stop - t)
                error, _, _, _ = step(t, y, h, K, p, rtol, atol, new)
                steps += 1
                if error > 1.0:
                    h = resize(h, error)
                    continue
                at, hit = 2.0, 0
                if not fresh:  # what starts with no speed and no acceleration strikes later
                    densify(t, y, h, K, p, new, F)
                    at, hit = first_touch(h, y, F, z, low, high, leaving)
                fresh, leaving = False, 0
                if at > 1.0:
                    t = stop if h == stop - t else t + h
                    y[:] = new
                    h = resize(h, error)
                    continue
                wall = low if hit == 1 else high
                before = h
                h *= at
                step(t, y, h, K, p, rtol, atol, new)
                shift = (wall - new[0]) / new[1]
                t += h + shift
                approach = -hit * (new[1] + shift * K[STAGES, 1])
                if impacts < times.size:
                    times[impacts], speeds[impacts] = t, approach
                impacts += 1
                back, away = e * approach, hit * pull(t, wall, 0.0, p)
                y[0], y[1], leaving, h = wall, hit * back, hit, before
                if away < 0.0:
                    if back * back <= -2.0 * away * height:
                        side, leaving = hit, 0
                    h = min(h, -2.4 * back / away)
        return steps, impacts

    return run
