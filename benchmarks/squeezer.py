"""Andrews' squeezer mechanism as the Test Set for IVP Solvers writes it, for any solver.

Plain functions of floats and arrays, which numba compiles as they are; nothing of this package.
The angles are beta, Theta, gamma, phi, delta, Omega and epsilon of the test set.
"""

from __future__ import annotations

from collections import namedtuple
from math import cos, hypot, sin

import numpy as np

from benchmarks.problem import Answer

Squeezer = namedtuple(
    'Squeezer',
    'm1 m2 m3 m4 m5 m6 m7 i1 i2 i3 i4 i5 i6 i7 xa ya xb yb xc yc c0 d da e ea rr ra l0 ss sa sb '
    'sc sd ta tb u ua ub zf zt fa mom',
)
"""Parameters of the mechanism [SI], by the names of the test set."""


def rates(_: float, y: Answer, p: Squeezer, out: Answer) -> float:
    """Write the rates of the seven angles and of their rates `y` (14,) to `out`: index 1.

    Accelerations and multipliers solve ``M a + G^T l = f, G a = -(dG/dt) v`` together; nothing but
    the accuracy of the method keeps the loops closed. Returns 1, a guard without events.
    """
    be, th, ga, ph, de, om, ep = y[0], y[1], y[2], y[3], y[4], y[5], y[6]
    bep, thp, gap, php, dep, omp, epp = y[7], y[8], y[9], y[10], y[11], y[12], y[13]
    far4, far6 = p.e - p.ea, p.zf - p.fa
    m2, m4, m6, da, rr, d, ss = p.m2, p.m4, p.m6, p.da, p.rr, p.d, p.ss
    e, zt, zf, u = p.e, p.zt, p.zf, p.u
    A, b = np.zeros((13, 13)), np.zeros(13)
    A[0, 0] = p.m1 * p.ra**2 + m2 * (rr**2 - 2 * da * rr * cos(th) + da**2)
    A[0, 0] += p.i1 + p.i2
    A[0, 1] = A[1, 0] = m2 * (da**2 - da * rr * cos(th)) + p.i2
    A[1, 1] = m2 * da**2 + p.i2
    A[2, 2] = p.m3 * (p.sa**2 + p.sb**2) + p.i3
    A[3, 3] = m4 * far4**2 + p.i4
    A[3, 4] = A[4, 3] = m4 * (far4**2 + zt * far4 * sin(ph)) + p.i4
    A[4, 4] = m4 * (zt**2 + 2 * zt * far4 * sin(ph) + far4**2)
    A[4, 4] += p.m5 * (p.ta**2 + p.tb**2) + p.i4 + p.i5
    A[5, 5] = m6 * far6**2 + p.i6
    A[5, 6] = A[6, 5] = m6 * (far6**2 - u * far6 * sin(om)) + p.i6
    A[6, 6] = m6 * (far6**2 - 2 * u * far6 * sin(om) + u**2)
    A[6, 6] += p.m7 * (p.ua**2 + p.ub**2) + p.i6 + p.i7
    sc, sd = p.sc, p.sd
    x = p.xb + sd * cos(ga) + sc * sin(ga) - p.xc
    z = p.yb + sd * sin(ga) - sc * cos(ga) - p.yc
    pull = -p.c0 * (1.0 - p.l0 / hypot(x, z))
    b[0] = p.mom - m2 * da * rr * thp * (thp + 2 * bep) * sin(th)
    b[1] = m2 * da * rr * bep**2 * sin(th)
    b[2] = pull * (x * (sc * cos(ga) - sd * sin(ga)) + z * (sd * cos(ga) + sc * sin(ga)))
    b[3] = m4 * zt * far4 * dep**2 * cos(ph)
    b[4] = -m4 * zt * far4 * php * (php + 2 * dep) * cos(ph)
    b[5] = -m6 * u * far6 * epp**2 * cos(om)
    b[6] = m6 * u * far6 * omp * (omp + 2 * epp) * cos(om)
    s12, c12, w12 = sin(be + th), cos(be + th), bep + thp
    s45, c45, w45 = sin(ph + de), cos(ph + de), php + dep
    s67, c67, w67 = sin(om + ep), cos(om + ep), omp + epp
    sin_be, cos_be, sin_ga, cos_ga = sin(be), cos(be), sin(ga), cos(ga)
    sin_de, cos_de, sin_ep, cos_ep = sin(de), cos(de), sin(ep), cos(ep)
    G = A[7:, :7]
    G[0::2, 0], G[1::2, 0] = -rr * sin_be + d * s12, rr * cos_be - d * c12
    G[0::2, 1], G[1::2, 1] = d * s12, -d * c12
    G[0, 2], G[1, 2] = -ss * cos_ga, -ss * sin_ga
    G[2, 3], G[3, 3] = -e * c45, -e * s45
    G[2, 4], G[3, 4] = -e * c45 + zt * sin_de, -e * s45 - zt * cos_de
    G[4, 5], G[5, 5] = zf * s67, -zf * c67
    G[4, 6], G[5, 6] = zf * s67 - u * cos_ep, -zf * c67 - u * sin_ep
    A[:7, 7:] = G.T
    b[7::2] = rr * cos_be * bep**2 - d * c12 * w12**2
    b[8::2] = rr * sin_be * bep**2 - d * s12 * w12**2
    b[7] -= ss * sin_ga * gap**2
    b[8] += ss * cos_ga * gap**2
    b[9] -= e * s45 * w45**2 + zt * cos_de * dep**2
    b[10] += e * c45 * w45**2 - zt * sin_de * dep**2
    b[11] -= zf * c67 * w67**2 + u * sin_ep * epp**2
    b[12] -= zf * s67 * w67**2 - u * cos_ep * epp**2
    out[:7], out[7:] = y[7:], np.linalg.solve(A, b)[:7]
    return 1.0
