"""Equations of the loose four-bar, compiled: flight in two angles, following in the contact angle.

Links: crank 2, coupler 3, rocker 4, frame 1, as in the thesis; eta is the contact angle.
"""

from __future__ import annotations

from math import cos, floor, sin, sqrt
from typing import NamedTuple

from numba import njit


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
