"""Reference for the thesis four-bar without clearance: kinematics, forces and crank torque.

50-digit arithmetic with `mpmath`. The angles solve the loop closure by Newton's method; rates and
accelerations come from its derivatives; forces and torque from the nine Newton-Euler equations
of three free bodies in Cartesian form, with the nine unknowns solved together. The extremes of
the bearing force are refined from a scan of one revolution.

`python make_nominal.py` writes `nominal.json` to benchmarks/references.
"""

from __future__ import annotations

import json
import platform
from datetime import date
from pathlib import Path

import mpmath as mp

mp.mp.dps = 50
REFERENCES = Path(__file__).parents[2] / 'benchmarks' / 'references'

# Table 6.1 in SI, crank = 2, coupler = 3, rocker = 4, frame = 1; S: joint to mass centre
PARAMETERS = {
    'l1': '0.387',
    'l2': '0.064',
    'l3': '0.309',
    'l4': '0.312',
    'S2': '0.009',
    'S3': '0.185',
    'S4': '0.134',
    'm2': '0.6095',
    'm3': '0.2439',
    'm4': '0.2334',
    'IG2': '0.002645',
    'IG3': '0.002950',
    'IG4': '0.003176',
    'w2': '36.6519',
    'g': '9.8145',
}
l1, l2, l3, l4, S2, S3, S4, m2, m3, m4, IG2, IG3, IG4, w2, g = map(mp.mpf, PARAMETERS.values())

# as printed or as found before, for comparison: (crank angle in degrees, key): value
KNOWN = {
    (0, 'th3'): '1.031746592',
    (0, 'th4'): '2.125711822',
    (0, 'w3'): '-7.262295975',
    (0, 'w4'): '-7.262295975',
    (0, 'a3'): '-197.6936693',
    (0, 'a4'): '190.7571146',
    (0, 'force_x'): '0.236389605',
    (0, 'force_y'): '-7.946370284',
    (0, 'torque'): '-0.725288922',
    (90, 'th3'): '0.729165459',
    (90, 'th4'): '2.096503057',
    (90, 'force_x'): '-3.368383662',
    (90, 'force_y'): '-2.432377659',
    (90, 'torque'): '0.661945992',
}


def u(th):
    return mp.matrix([mp.cos(th), mp.sin(th)])


def v(th):
    return mp.matrix([-mp.sin(th), mp.cos(th)])


def kinematics(th2):
    """Angles, rates and accelerations of coupler and rocker (open branch), crank speed w2."""

    def closure(th3, th4):
        return list(l2 * u(th2) + l3 * u(th3) - l4 * u(th4) - mp.matrix([l1, 0]))

    th3, th4 = mp.findroot(closure, (0.9, 2.1), tol=mp.mpf('1e-90'))
    assert mp.sin(th4 - th3) > 0  # open branch
    J = mp.matrix([[l3 * v(th3)[i], -l4 * v(th4)[i]] for i in (0, 1)])
    w3, w4 = mp.lu_solve(J, -l2 * w2 * v(th2))
    a3, a4 = mp.lu_solve(J, l2 * w2**2 * u(th2) + l3 * w3**2 * u(th3) - l4 * w4**2 * u(th4))
    return th3, th4, w3, w4, a3, a4


def newton_euler(th2):
    """Joint forces and crank torque from the nine equations of three free bodies.

    Unknowns: force of the frame on the crank at O2, of the crank on the coupler at A, of the
    coupler on the rocker at B, of the frame on the rocker at O4 (x and y each), crank torque.
    """
    th3, th4, w3, w4, a3, a4 = kinematics(th2)
    acc2 = -S2 * w2**2 * u(th2)
    acc3 = -l2 * w2**2 * u(th2) + S3 * (a3 * v(th3) - w3**2 * u(th3))
    acc4 = S4 * (a4 * v(th4) - w4**2 * u(th4))
    grav = mp.matrix([0, -g])
    O2, A = mp.matrix([0, 0]), l2 * u(th2)
    O4, B = mp.matrix([l1, 0]), A + l3 * u(th3)
    G2, G3, G4 = S2 * u(th2), A + S3 * u(th3), O4 + S4 * u(th4)
    bodies = [  # mass, inertia, centre, its acceleration, angular acceleration, (joint, sign, at)
        (m2, IG2, G2, acc2, 0, [(0, 1, O2), (1, -1, A)]),
        (m3, IG3, G3, acc3, a3, [(1, 1, A), (2, -1, B)]),
        (m4, IG4, G4, acc4, a4, [(2, 1, B), (3, 1, O4)]),
    ]
    M, rhs = mp.zeros(9), mp.zeros(9, 1)
    for i, (m, inertia, G, acc, alpha, joints) in enumerate(bodies):
        for joint, sign, point in joints:
            r = point - G
            M[3 * i, 2 * joint] = M[3 * i + 1, 2 * joint + 1] = sign
            M[3 * i + 2, 2 * joint], M[3 * i + 2, 2 * joint + 1] = -sign * r[1], sign * r[0]
        rhs[3 * i], rhs[3 * i + 1] = m * (acc - grav)
        rhs[3 * i + 2] = inertia * alpha
    M[2, 8] = 1
    return mp.lu_solve(M, rhs)


def row(degrees):
    th2 = mp.mpf(degrees) * mp.pi / 180
    x = newton_euler(th2)
    keys = ('th3', 'th4', 'w3', 'w4', 'a3', 'a4', 'force_x', 'force_y', 'torque')
    return dict(zip(keys, (*kinematics(th2), x[4], x[5], x[8]), strict=True))


def extreme(sign):
    """Crank angle in degrees and size of the largest (+1) or smallest (-1) bearing force."""

    def size(degrees):
        x = newton_euler(degrees * mp.pi / 180)
        return mp.hypot(x[4], x[5])

    a = max(range(360), key=lambda i: sign * size(mp.mpf(i)))
    lo, hi, golden = mp.mpf(a - 1), mp.mpf(a + 1), (mp.sqrt(5) - 1) / 2
    for _ in range(110):
        p, q = hi - golden * (hi - lo), lo + golden * (hi - lo)
        lo, hi = (lo, q) if sign * size(p) > sign * size(q) else (p, hi)
    return lo, size(lo)


def drive_work():
    """Work of the crank over one turn, which must vanish: the motion is periodic."""
    n = 256  # the mid-point rule is spectrally accurate for a periodic torque
    return 2 * mp.pi / n * sum(newton_euler(2 * mp.pi * i / n)[8] for i in range(n))


def main():
    rows = {d: row(d) for d in range(0, 360, 45)}
    for (d, key), known in KNOWN.items():
        places = len(known.split('.')[1])
        assert abs(rows[d][key] - mp.mpf(known)) <= mp.mpf(10) ** -places, (d, key)
    work = drive_work()
    data = {
        'provenance': {
            'method': 'closure by Newton, forces by dense Newton-Euler with nine unknowns',
            'decimal_digits': mp.mp.dps,
            'work_of_the_crank_over_a_turn': mp.nstr(work, 3),
            'agrees_with_known_figures': len(KNOWN),
            'script': Path(__file__).name,
            'date': str(date.today()),
            'python': platform.python_version(),
            'mpmath': mp.__version__,
        },
        'units': 'SI, radians, crank angle in degrees; force of the coupler on the rocker; '
        'digits are decimal strings',
        'parameters': PARAMETERS | {'gravity': ['0', '-9.8145']},
        'crank_angle': [str(d) for d in rows],
        **{k: [mp.nstr(r[k], 20, strip_zeros=False) for r in rows.values()] for k in rows[0]},
    }
    for name, sign in (('smallest', -1), ('largest', 1)):
        degrees, size = extreme(sign)
        data[f'{name}_bearing_force'] = {
            'crank_angle': mp.nstr(degrees, 15),
            'force': mp.nstr(size, 20),
        }
    path = REFERENCES / 'nominal.json'
    path.write_text(json.dumps(data, indent=1) + '\n')
    print(f'{path.name}: work over a turn {mp.nstr(work, 3)} J')


if __name__ == '__main__':
    main()
