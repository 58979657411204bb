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

from math import atan2, cos, floor, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

from mechanism_sim.bench.kernels.dop853 import ROWS, stepper

LOOK = 8  #: points of a step at which a guard is looked at
SHARP = 1000.0  #: error allowed in the contact angle, in units of that of the links
SWAY = 1000.0  #: [rad/s] what its rate may be wrong by for an error of 1 rad, tried out


class Constants(NamedTuple):
    """Lengths [m], crank speed [rad/s] and angle [rad], and what the moment equations need."""

    l1: float
    l2: float
    l3: float
    l4: float
    c: float
    w2: float
    start: float
    I3: float  #: [kg m^2] coupler about its joint with the crank
    I4: float  #: [kg m^2] rocker about its joint with the frame
    swing: float  #: m3 S3 l2 w2^2/I3 [rad/s^2]
    fall3: float  #: m3 S3 g/I3 [rad/s^2]
    fall4: float  #: m4 S4 g/I4 [rad/s^2]
    e: float
    size: float  #: [m]


@njit(error_model='numpy')
def sincos(x):
    """Sine and cosine together, the polynomials of fdlibm: half the time of two calls."""
    k = floor(x * 0.6366197723675814 + 0.5)
    r = (x - k * 1.5707963267341256) - k * 6.077100506506192e-11
    z = r * r
    w = z * z
    s = -1.66666666666666324348e-01 + z * 8.33333333332248946124e-03
    s += w * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06)
    s += (w * w) * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    s = r + r * z * s
    c = 4.16666666666666019037e-02 + z * -1.38888888888741095749e-03
    c += w * (2.48015872894767294178e-05 + z * -2.75573143513906633035e-07)
    c += (w * w) * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
    c = 1.0 - (0.5 * z - w * c)
    quarter = int(k) & 3
    if quarter & 1:
        s, c = c, -s
    return (-s, -c) if quarter & 2 else (s, c)


@njit(fastmath=True, error_model='numpy')
def fly(t, y, p, out):
    """Rates of (th3, th4, w3, w4) in flight. The guard is no use here."""
    s23, _ = sincos(p.w2 * t + p.start - y[0])
    _, c3 = sincos(y[0])
    _, c4 = sincos(y[1])
    out[0], out[1] = y[2], y[3]
    out[2], out[3] = p.swing * s23 - p.fall3 * c3, -p.fall4 * c4
    return 0.0


@njit(fastmath=True, error_model='numpy')
def close_loop(t, eta, we, p):
    """Sines and cosines of th2, eta, th3, th4, then w3, w4 and ``S = sin(th4 - th3)``."""
    s2, c2 = sincos(p.w2 * t + p.start)
    se, ce = sincos(eta)
    x, y = p.l1 + p.c * ce - p.l2 * c2, p.c * se - p.l2 * s2
    d = x * x + y * y
    m = p.l3 * p.l3 - p.l4 * p.l4 + d
    area = sqrt(4.0 * p.l3 * p.l3 * d - m * m)  # four times that of the triangle l3, l4, sqrt(d)
    S, over = area * (0.5 / (p.l3 * p.l4)), (2.0 * p.l3 * p.l4) / area
    a = 0.5 / (p.l3 * d)
    c3, s3 = a * (m * x - area * y), a * (m * y + area * x)
    c4, s4 = (p.l3 * c3 - x) * (1.0 / p.l4), (p.l3 * s3 - y) * (1.0 / p.l4)
    v2, ve = p.l2 * p.w2, p.c * we
    rx, ry = v2 * s2 - ve * se, ve * ce - v2 * c2
    w3 = (rx * c4 + ry * s4) * over * (1.0 / p.l3)
    w4 = (rx * c3 + ry * s3) * over * (1.0 / p.l4)
    return s2, c2, se, ce, s3, c3, s4, c4, w3, w4, S


@njit(fastmath=True, error_model='numpy')
def follow(t, y, p, out):
    """Rates of (eta, eta'); returns a positive multiple of the contact force.

    The acceleration of the closed loop is affine in eta''; d'Alembert's principle along eta, in
    which the contact force does no work, gives eta'', and the moments of coupler and rocker the
    force. All is multiplied by S, which is positive on this branch.
    """
    we = y[1]
    s2, c2, se, ce, s3, c3, s4, c4, w3, w4, S = close_loop(t, y[0], we, p)
    q2, q3, q4, qe = p.l2 * p.w2 * p.w2, p.l3 * w3 * w3, p.l4 * w4 * w4, p.c * we * we
    x = q2 * c2 + q3 * c3 - q4 * c4 - qe * ce
    z = q2 * s2 + q3 * s3 - q4 * s4 - qe * se
    free3, free4 = p.swing * (s2 * c3 - c2 * s3) - p.fall3 * c3, -p.fall4 * c4
    short3 = free3 * S - (x * c4 + z * s4) * (1.0 / p.l3)
    short4 = free4 * S - (x * c3 + z * s3) * (1.0 / p.l4)
    p3, p4 = (ce * s4 - se * c4) * (p.c / p.l3), (ce * s3 - se * c3) * (p.c / p.l4)
    m3, m4 = p.I3 * p3, p.I4 * p4
    ae = (m3 * short3 + m4 * short4) * (1.0 / (m3 * p3 + m4 * p4))
    out[0], out[1] = we, ae
    k3, k4 = p.l3 * (se * c3 - ce * s3), p.l4 * (se * c4 - ce * s4)
    return k3 * (p.I3 * short3 - m3 * ae) - k4 * (p.I4 * short4 - m4 * ae)


@njit(fastmath=True, error_model='numpy')
def gap(t, th3, th4, p):
    """Gap [m]."""
    s2, c2 = sincos(p.w2 * t + p.start)
    s3, c3 = sincos(th3)
    s4, c4 = sincos(th4)
    x = p.l2 * c2 + p.l3 * c3 - p.l1 - p.l4 * c4
    y = p.l2 * s2 + p.l3 * s3 - p.l4 * s4
    return p.c - sqrt(x * x + y * y)


@njit(error_model='numpy')
def bearing(t, y, p):
    """Pin in bushing: components of Q, |Q|, normal and tangential rate, k3, k4, effective mass."""
    s2, c2 = sincos(p.w2 * t + p.start)
    s3, c3 = sincos(y[0])
    s4, c4 = sincos(y[1])
    v2, v3, v4 = p.l2 * p.w2, p.l3 * y[2], p.l4 * y[3]
    x, z = p.l2 * c2 + p.l3 * c3 - p.l1 - p.l4 * c4, p.l2 * s2 + p.l3 * s3 - p.l4 * s4
    r = sqrt(x * x + z * z)
    vx, vz = v4 * s4 - v2 * s2 - v3 * s3, v2 * c2 + v3 * c3 - v4 * c4
    k3, k4 = p.l3 * (z * c3 - x * s3) / r, p.l4 * (z * c4 - x * s4) / r
    mass = 1.0 / (k3 * k3 / p.I3 + k4 * k4 / p.I4)
    return x, z, r, (vx * x + vz * z) / r, (vz * x - vx * z) / r, k3, k4, mass


@njit(error_model='numpy')
def pull(t, y, p):
    """Second derivative of the gap in flight [m/s^2]."""
    x, z, r, _, slide, k3, k4, _ = bearing(t, y, p)
    th2 = p.w2 * t + p.start
    a3 = p.swing * sin(th2 - y[0]) - p.fall3 * cos(y[0])
    a4 = -p.fall4 * cos(y[1])
    q2, q3, q4 = p.l2 * p.w2 * p.w2, p.l3 * y[2] ** 2, p.l4 * y[3] ** 2
    ax = q4 * cos(y[1]) - q2 * cos(th2) - q3 * cos(y[0])
    az = q4 * sin(y[1]) - q2 * sin(th2) - q3 * sin(y[0])
    return -(k3 * a3 - k4 * a4 + (ax * x + az * z) / r + slide * slide / r)


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
def resize(h, error):
    """Next step size, as SciPy's."""
    if error == 0.0:
        return 10.0 * h
    return h * min(10.0, max(0.2, 0.9 * error**-0.125))


@njit(error_model='numpy')
def revolve(p, start, following, end, rtol, times):
    """Run from t = 0 to `end` [s].

    `start` holds th3, th4, w3, w4 [rad, rad/s]; `times` (n,) takes the
    times of the first n impacts. Returns th3, th4, steps, impacts.
    """
    c, e = p.c, p.e
    height = max(0.1 * rtol * (1.0 - e), 8.0 * 2.3e-16) * p.size
    y, new, z = start.copy(), np.empty(4), np.empty(4)
    K, F, values = np.empty((ROWS, 4)), np.empty((7, 4)), np.empty(LOOK + 1)
    u, unew, Ku, Fu = np.empty(2), np.empty(2), np.empty((ROWS, 2)), np.empty((7, 2))
    atol, atolu = np.full(4, 0.1 * rtol), np.empty(2)
    sharp = SHARP * rtol
    atolu[0], atolu[1] = sharp, sharp * SWAY
    t, steps, impacts = 0.0, 0, 0
    h_fly = h_follow = 1e-3 / p.w2
    if following:
        x, w, _, _, slide, _, _, _ = bearing(t, y, p)
        u[0], u[1] = atan2(w, x), slide / c
    while t < end:
        if following:
            h = min(h_follow, end - t)
            lowest = follow(t, u, p, Ku[0])
            while True:
                error, low, high, last = _follow_step(t, u, h, Ku, p, 0.0, atolu, unew)
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
