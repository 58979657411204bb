"""An event loop for the loose four-bar alone, as fast as numba makes it.

* Flight: the angles of coupler and rocker, which are independent.
* Following: the *contact angle* eta is the one coordinate; coupler and rocker follow from the
  closed loop by algebra (no inverse functions), so that nothing drifts.
* Events are looked for on the dense output, at eight points and in the minima between them; the
  step is then taken again to end at the event, where the dense output is not as good as the step.
* Chatter ends by a height: what is left of it displaces nothing by more than the tolerance.

Links: crank 2, coupler 3, rocker 4, frame 1, as in the thesis.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

import numpy as np
from numba import njit

from mechanism_sim.bench.kernels.dop853 import ROWS, stepper

LOOK = 8  #: points of a step at which a guard is looked at
SHARP = 100.0  #: error allowed in the contact angle, in units of that of the links


@njit(fastmath=True)
def fly(t, y, p, out):
    """Rates of (th3, th4, w3, w4) in flight. The guard is no use here."""
    _, _, _, _, _, w2, start, _, _, swing, fall3, fall4, _, _ = p
    out[0], out[1] = y[2], y[3]
    out[2] = swing * sin(w2 * t + start - y[0]) - fall3 * cos(y[0])
    out[3] = -fall4 * cos(y[1])
    return 0.0


@njit(fastmath=True)
def close_loop(t, eta, we, p):
    """Sines and cosines of th2, eta, th3, th4, then w3, w4 and ``sin(th4 - th3)``."""
    l1, l2, l3, l4, c, w2, start, _, _, _, _, _, _, _ = p
    s2, c2, se, ce = sin(w2 * t + start), cos(w2 * t + start), sin(eta), cos(eta)
    x, y = l1 + c * ce - l2 * c2, c * se - l2 * s2
    d = x * x + y * y
    a = (l3 * l3 + d - l4 * l4) / (2.0 * l3 * d)
    b = sqrt(1.0 / d - a * a)
    c3, s3 = a * x - b * y, a * y + b * x
    c4, s4 = (l3 * c3 - x) / l4, (l3 * s3 - y) / l4
    S = c3 * s4 - s3 * c4
    rx, ry = l2 * w2 * s2 - c * we * se, c * we * ce - l2 * w2 * c2
    w3, w4 = (rx * c4 + ry * s4) / (l3 * S), (rx * c3 + ry * s3) / (l4 * S)
    return s2, c2, se, ce, s3, c3, s4, c4, w3, w4, S


@njit(fastmath=True)
def follow(t, y, p, out):
    """Rates of (eta, eta'); returns the contact force [N].

    The acceleration of the closed loop is affine in eta''; d'Alembert's principle along eta, in
    which the contact force does no work, gives eta'', and the coupler's and rocker's moments the
    force.
    """
    _, l2, l3, l4, c, w2, _, I3, I4, swing, fall3, fall4, _, _ = p
    we = y[1]
    s2, c2, se, ce, s3, c3, s4, c4, w3, w4, S = close_loop(t, y[0], we, p)
    q2, q3, q4, qe = l2 * w2 * w2, l3 * w3 * w3, l4 * w4 * w4, c * we * we
    x = q2 * c2 + q3 * c3 - q4 * c4 - qe * ce
    z = q2 * s2 + q3 * s3 - q4 * s4 - qe * se
    free3, free4 = swing * (s2 * c3 - c2 * s3) - fall3 * c3, -fall4 * c4
    short3, short4 = free3 - (x * c4 + z * s4) / (l3 * S), free4 - (x * c3 + z * s3) / (l4 * S)
    p3, p4 = c * (ce * s4 - se * c4) / (l3 * S), c * (ce * s3 - se * c3) / (l4 * S)
    ae = (I3 * p3 * short3 + I4 * p4 * short4) / (I3 * p3 * p3 + I4 * p4 * p4)
    k3, k4 = l3 * (se * c3 - ce * s3), l4 * (se * c4 - ce * s4)
    out[0], out[1] = we, ae
    moment3, moment4 = I3 * (short3 - p3 * ae), I4 * (short4 - p4 * ae)
    return (k3 * moment3 - k4 * moment4) / (k3 * k3 + k4 * k4)


@njit(fastmath=True)
def gap(t, th3, th4, p):
    """Gap [m]."""
    l1, l2, l3, l4, c, w2, start, _, _, _, _, _, _, _ = p
    th2 = w2 * t + start
    x = l2 * cos(th2) + l3 * cos(th3) - l1 - l4 * cos(th4)
    y = l2 * sin(th2) + l3 * sin(th3) - l4 * sin(th4)
    return c - sqrt(x * x + y * y)


@njit
def bearing(t, y, p):
    """Pin in bushing: components of Q, |Q|, normal and tangential rate, k3, k4, effective mass."""
    l1, l2, l3, l4, _, w2, start, I3, I4, _, _, _, _, _ = p
    th2 = w2 * t + start
    s2, c2, s3, c3, s4, c4 = sin(th2), cos(th2), sin(y[0]), cos(y[0]), sin(y[1]), cos(y[1])
    x, z = l2 * c2 + l3 * c3 - l1 - l4 * c4, l2 * s2 + l3 * s3 - l4 * s4
    r = sqrt(x * x + z * z)
    vx = -l2 * w2 * s2 - l3 * y[2] * s3 + l4 * y[3] * s4
    vz = l2 * w2 * c2 + l3 * y[2] * c3 - l4 * y[3] * c4
    k3, k4 = l3 * (z * c3 - x * s3) / r, l4 * (z * c4 - x * s4) / r
    mass = 1.0 / (k3 * k3 / I3 + k4 * k4 / I4)
    return x, z, r, (vx * x + vz * z) / r, (vz * x - vx * z) / r, k3, k4, mass


@njit
def pull(t, y, p):
    """Second derivative of the gap in flight [m/s^2]."""
    _, l2, l3, l4, _, w2, start, _, _, swing, fall3, fall4, _, _ = p
    x, z, r, _, slide, k3, k4, _ = bearing(t, y, p)
    th2 = w2 * t + start
    a3, a4 = swing * sin(th2 - y[0]) - fall3 * cos(y[0]), -fall4 * cos(y[1])
    q2, q3, q4 = l2 * w2 * w2, l3 * y[2] ** 2, l4 * y[3] ** 2
    ax = q4 * cos(y[1]) - q2 * cos(th2) - q3 * cos(y[0])
    az = q4 * sin(y[1]) - q2 * sin(th2) - q3 * sin(y[0])
    return -(k3 * a3 - k4 * a4 + (ax * x + az * z) / r + slide * slide / r)


_fly_step, _fly_densify, _fly_dense = stepper(fly, 4)
_follow_step, _follow_densify, _follow_dense = stepper(follow, 2)


@njit
def _gap_at(x, t, h, y, F, p, z):
    _fly_dense(y, F, x, z)
    return gap(t + x * h, z[0], z[1], p)


@njit
def _force_at(x, t, h, y, F, p, z):
    _follow_dense(y, F, x, z[:2])
    return follow(t + x * h, z[:2], p, z[2:])


def _finder(guard):
    """Compiled search for the first fall of a guard through zero on a dense output."""

    @njit
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

    @njit
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


@njit
def resize(h, error):
    """Next step size, as SciPy's."""
    if error == 0.0:
        return 10.0 * h
    return h * min(10.0, max(0.2, 0.9 * error**-0.125))


@njit
def revolve(p, start, following, end, rtol, times):
    """Run from t = 0 to `end` [s].

    `p` holds l1, l2, l3, l4, c, w2, start angle, IA3, IO4, m3 S3 l2 w2^2/IA3, m3 S3 g/IA3,
    m4 S4 g/IO4, restitution and size [m]; `start` (th3, th4, w3, w4); `times` (n,) takes the
    times of the first n impacts. Returns th3, th4, steps, impacts.
    """
    c, e, size = p[4], p[12], p[13]
    height = max(rtol * (1.0 - e), 8.0 * 2.3e-16) * size
    y, new, z = start.copy(), np.empty(4), np.empty(4)
    K, F, values = np.empty((ROWS, 4)), np.empty((7, 4)), np.empty(LOOK + 1)
    u, unew, Ku, Fu = np.empty(2), np.empty(2), np.empty((ROWS, 2)), np.empty((7, 2))
    atol, atolu = np.full(4, 0.1 * rtol), np.empty(2)
    sharp = SHARP * rtol
    atolu[0], atolu[1] = sharp, sharp * p[5]
    t, steps, impacts = 0.0, 0, 0
    h_fly = h_follow = 1e-3 / p[5]
    if following:
        x, w, _, _, slide, _, _, _ = bearing(t, y, p)
        u[0], u[1] = atan2(w, x), slide / c
    while t < end:
        if following:
            h = min(h_follow, end - t)
            lowest = follow(t, u, p, Ku[0])
            while True:
                error, low, high, last = _follow_step(t, u, h, Ku, p, sharp, atolu, unew)
                steps += 1
                if error > 1.0:
                    h = resize(h, error)
                    lowest = min(lowest, low)
                    continue
                h_follow = resize(h, error)
                at = 2.0
                if low < 0.4 * high or low < 0.0:
                    values[0] = follow(t, u, p, Ku[0])
                    _follow_densify(t, u, h, Ku, p, unew, Fu)
                    at = _first_force(t, h, u, Fu, p, z, values, False)
                if at <= 1.0:
                    follow(t, u, p, Ku[0])
                    h_follow = h
                    before = _force_at(max(at - 0.01, 0.0), t, h, u, Fu, p, z)
                    slope = (0.0 - before) / (min(0.01, at) * h)
                    h *= at
                    _, _, _, last = _follow_step(t, u, h, Ku, p, sharp, atolu, unew)
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
            if h_fly < h_follow:
                h_fly = h_follow
            continue
        h = min(h_fly, end - t)
        fly(t, y, p, K[0])
        rising = touching if t > 0.0 else False
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
            y[2] -= impulse * k3 / p[7]
            y[3] += impulse * k4 / p[8]
            touching = True
            if following:
                x, w, _, _, slide, _, _, _ = bearing(t, y, p)
                u[0], u[1] = atan2(w, x), slide / c
            elif back < 0.0:
                h_fly = min(h_fly, -2.4 * speed / back)
            break
    return y[0], y[1], steps, impacts
