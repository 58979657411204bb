"""Reference for Andrews' squeezer mechanism of the Test Set for IVP Solvers, without any ODE.

The mechanism has one degree of freedom and starts at rest, so the energy integral
``J(beta) beta'^2/2 + V(beta) - V(beta0) = mom (beta - beta0)`` gives the speed at every angle of
the crank and ``t = integral of d beta/beta'``. With ``beta = beta0 + s^2`` the integrand is
smooth; it is integrated by Gauss-Legendre in 40 digits, and the angle at the end of the run is
found by Newton's method. Positions come from circles that intersect: a four-bar, then two dyads.

`python make_andrews_squeezer.py` writes `andrews_squeezer.json` to benchmarks/references.
"""

from __future__ import annotations

import json
import platform
from datetime import date
from pathlib import Path

import mpmath as mp

mp.mp.dps = 40
DURATION = '0.03'
PARAMETERS = {
    'm1': '.04325', 'm2': '.00365', 'm3': '.02373', 'm4': '.00706', 'm5': '.07050',
    'm6': '.00706', 'm7': '.05498', 'i1': '2.194e-6', 'i2': '4.410e-7', 'i3': '5.255e-6',
    'i4': '5.667e-7', 'i5': '1.169e-5', 'i6': '5.667e-7', 'i7': '1.912e-5', 'xa': '-.06934',
    'ya': '-.00227', 'xb': '-.03635', 'yb': '.03273', 'xc': '.014', 'yc': '.072', 'c0': '4530',
    'd': '28e-3', 'da': '115e-4', 'e': '2e-2', 'ea': '1421e-5', 'rr': '7e-3', 'ra': '92e-5',
    'l0': '7785e-5', 'ss': '35e-3', 'sa': '1874e-5', 'sb': '1043e-5', 'sc': '18e-3', 'sd': '2e-2',
    'ta': '2308e-5', 'tb': '916e-5', 'u': '4e-2', 'ua': '1228e-5', 'ub': '449e-5', 'zf': '2e-2',
    'zt': '4e-2', 'fa': '1421e-5', 'mom': '33e-3',
    'beta0': '-0.0617138900142764496358948458001',
}  # fmt: skip
K = {name: mp.mpf(digits) for name, digits in PARAMETERS.items()}
A, B, C = mp.mpc(K['xa'], K['ya']), mp.mpc(K['xb'], K['yb']), mp.mpc(K['xc'], K['yc'])


def dyad(first, second, near, far, side):
    """Unit vectors of two links, from `first` and `second`, that meet on `side` of the line."""
    line = second - first
    r = abs(line)
    cosine = (near**2 + r**2 - far**2) / (2 * near * r)
    a = line / r * mp.mpc(cosine, side * mp.sqrt(1 - cosine**2))
    return a, (first + near * a - second) / far


def spins(a, b, near, far, v):
    """Rates of two links that meet; the start of the first moves with `v`, the other rests."""
    # v + i near wa a = i far wb b
    cross = (mp.conj(a) * b).imag
    return -(mp.conj(b) * v).real / (near * cross), -(mp.conj(a) * v).real / (far * cross)


def state(beta):
    """Unit vectors of the links K1 to K7, and their rates over that of K1."""
    u1 = mp.expj(beta)
    tip, v = K['rr'] * u1, mp.mpc(0, 1) * K['rr'] * u1
    u2, u3 = dyad(tip, B, K['d'], K['ss'], 1)
    w2, w3 = spins(u2, u3, K['d'], K['ss'], v)
    pin, v = tip + K['d'] * u2, v + mp.mpc(0, 1) * K['d'] * w2 * u2
    u4, u5 = dyad(pin, A, K['e'], K['zt'], -1)
    w4, w5 = spins(u4, u5, K['e'], K['zt'], v)
    u6, u7 = dyad(pin, A, K['zf'], K['u'], 1)
    w6, w7 = spins(u6, u7, K['zf'], K['u'], v)
    return (u1, u2, u3, -u4, u5, -u6, u7), (1, w2, w3, w4, w5, w6, w7)


def inertia(u, w):
    """Moment of inertia felt at K1."""
    k, turned = K, mp.mpc(0, 1)
    far4, far6 = k['e'] - k['ea'], k['zf'] - k['fa']
    speeds = (
        k['ra'],
        abs(turned * (k['rr'] * u[0] + k['da'] * w[1] * u[1])),
        mp.hypot(k['sa'], k['sb']) * w[2],
        abs(k['zt'] * w[4] * u[4] + far4 * w[3] * u[3]),
        mp.hypot(k['ta'], k['tb']) * w[4],
        abs(k['u'] * w[6] * u[6] + far6 * w[5] * u[5]),
        mp.hypot(k['ua'], k['ub']) * w[6],
    )
    return sum(
        k[f'm{i}'] * v**2 + k[f'i{i}'] * x**2
        for i, (v, x) in enumerate(zip(speeds, w, strict=True), 1)
    )


def potential(u):
    """Energy of the spring."""
    longer = abs(B + u[2] * mp.mpc(K['sc'], K['sd']) - C) - K['l0']
    return K['c0'] * longer**2 / 2


REST = potential(state(K['beta0'])[0])


def speed(beta):
    u, w = state(beta)
    return mp.sqrt(2 * (K['mom'] * (beta - K['beta0']) + REST - potential(u)) / inertia(u, w))


def time(beta, pieces_per_radian=3):
    end = mp.sqrt(beta - K['beta0'])
    n = int((beta - K['beta0']) * pieces_per_radian) + 1
    points = [end * mp.sqrt(mp.mpf(i) / n) for i in range(n + 1)]
    return mp.quad(lambda s: 2 * s / speed(K['beta0'] + s**2), points, method='gauss-legendre')


def test_set_angles(beta):
    """beta, Theta, gamma, phi, delta, Omega, epsilon, as the test set counts them."""
    (_, u2, u3, u4, u5, u6, u7), _ = state(beta)
    turned = mp.mpc(0, 1)
    theta, gamma, delta, epsilon = (
        mp.arg(-u2) - beta,
        mp.arg(turned * u3),
        mp.arg(u5),
        mp.arg(turned * u7),
    )
    theta += 2 * mp.pi * mp.nint((-beta - theta) / (2 * mp.pi))  # beta + Theta never turns round
    return beta, theta, gamma, mp.arg(turned * u4) - delta, delta, mp.arg(u6) - epsilon, epsilon


def main():
    end, beta = mp.mpf(DURATION), mp.mpf('15.8')
    for _ in range(40):
        step = (time(beta) - end) * speed(beta)
        beta -= step
        if abs(step) < mp.mpf('1e-30'):
            break
    check = abs(time(beta, 4) - end)
    names = ('beta', 'Theta', 'gamma', 'phi', 'delta', 'Omega', 'epsilon')
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
        'parameters': PARAMETERS,
        'duration': DURATION,
        'start': [mp.nstr(x, 25) for x in test_set_angles(K['beta0'])],
        **{k: mp.nstr(x, 25) for k, x in zip(names, test_set_angles(beta), strict=True)},
    }
    folder = Path(__file__).parents[2] / 'benchmarks/references'
    (folder / 'andrews_squeezer.json').write_text(json.dumps(data, indent=1) + '\n')
    print(f'andrews_squeezer.json: beta = {mp.nstr(beta, 20)} rad, check {mp.nstr(check, 2)} s')


if __name__ == '__main__':
    main()
