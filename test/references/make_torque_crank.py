"""Reference for the ideal thesis four-bar with a constant torque on its crank, without any ODE.

The energy integral ``J(th2) w2^2/2 + V(th2) - T th2 = E`` gives the crank's speed at every angle,
so the time to an angle is a quadrature, ``t = integral of d th2/w2``. It is done by Gauss-Legendre
in 40 digits with `mpmath`, and the angle at the end of the run is found by Newton's method on it.

`python make_torque_crank.py` writes `torque_crank.json` to benchmarks/references.
"""

from __future__ import annotations

import json
import platform
from datetime import date
from pathlib import Path

import mpmath as mp

from make_nominal import IG2, IG3, IG4, PARAMETERS, REFERENCES, S2, S3, S4  # isort: skip
from make_nominal import g, l1, l2, l3, l4, m2, m3, m4, w2  # isort: skip

mp.mp.dps = 40
TORQUE, DURATION = '0.1', '0.5'


def angles(th2):
    """Coupler and rocker on the open branch."""
    x, y = l1 - l2 * mp.cos(th2), -l2 * mp.sin(th2)
    d = mp.hypot(x, y)
    th3 = mp.atan2(y, x) + mp.acos((l3**2 + d**2 - l4**2) / (2 * l3 * d))
    th4 = mp.atan2(l3 * mp.sin(th3) - y, l3 * mp.cos(th3) - x)
    return th3, th4


def inertia(th2):
    """Moment of inertia felt at the crank."""
    th3, th4 = angles(th2)
    r3 = -l2 * mp.sin(th2 - th4) / (l3 * mp.sin(th3 - th4))
    r4 = l2 * mp.sin(th3 - th2) / (l4 * mp.sin(th3 - th4))
    middle = l2**2 + (S3 * r3) ** 2 + 2 * l2 * S3 * r3 * mp.cos(th3 - th2)
    return IG2 + m2 * S2**2 + m3 * middle + IG3 * r3**2 + (IG4 + m4 * S4**2) * r4**2


def potential(th2):
    th3, th4 = angles(th2)
    height = m2 * S2 * mp.sin(th2) + m3 * (l2 * mp.sin(th2) + S3 * mp.sin(th3))
    return g * (height + m4 * S4 * mp.sin(th4))


ENERGY = inertia(mp.mpf(0)) * w2**2 / 2 + potential(mp.mpf(0))


def speed(th2):
    return mp.sqrt(2 * (ENERGY + mp.mpf(TORQUE) * th2 - potential(th2)) / inertia(th2))


def time(th2, pieces_per_radian=2):
    n = int(th2 * pieces_per_radian) + 1
    points = [th2 * i / n for i in range(n + 1)]
    return mp.quad(lambda x: 1 / speed(x), points, method='gauss-legendre')


def main():
    end = mp.mpf(DURATION)
    th2 = w2 * end
    for _ in range(40):
        step = (time(th2) - end) * speed(th2)
        th2 -= step
        if abs(step) < mp.mpf('1e-32'):
            break
    check = abs(time(th2, 3) - end)
    values = (th2, *angles(th2), speed(th2))
    data = {
        'provenance': {
            'method': 'energy integral and quadrature of 1/speed, Newton on the final angle',
            'decimal_digits': mp.mp.dps,
            'difference_in_time_with_other_pieces': mp.nstr(check, 2),
            'script': Path(__file__).name,
            'date': str(date.today()),
            'python': platform.python_version(),
            'mpmath': mp.__version__,
        },
        'units': 'SI, radians; digits are decimal strings',
        'parameters': PARAMETERS | {'torque': TORQUE},
        'duration': DURATION,
        **{k: mp.nstr(x, 25) for k, x in zip(('th2', 'th3', 'th4', 'w2'), values, strict=True)},
    }
    path = REFERENCES / 'torque_crank.json'
    path.write_text(json.dumps(data, indent=1) + '\n')
    print(f'{path.name}: th2 = {mp.nstr(th2, 20)} rad, check {mp.nstr(check, 2)} s')


if __name__ == '__main__':
    main()
