"""Reference for Kane's beam that spins up: chains of rigid segments with springs between them.

No beam, no modes, no foreshortening. The error of a chain falls as the square of its segments'
length, and is extrapolated away twice (Richardson). `python make_spinning_beam.py` writes
`spinning_beam.json` to benchmarks/references.
"""

from __future__ import annotations

import json
import platform
from datetime import date

import numpy as np
import scipy
from scipy.integrate import solve_ivp

SEGMENTS, END = (12, 16, 24), 8.0


def chain_tip(count, t, rtol=1e-9):
    """Tip deflection (N,) [m] of Kane's beam as so many rigid segments, the first one half."""
    h = 10.0 / count
    lengths = np.array([0.5 * h, *[h] * (count - 1), 0.5 * h])
    mass = 1.2 * lengths
    beyond = np.append(np.cumsum(mass[::-1])[::-1][1:], 0.0)
    P = np.empty((count + 1, count + 1))
    for i in range(count + 1):
        for j in range(count + 1):
            k = max(i, j)
            P[i, j] = lengths[i] * lengths[j] * beyond[k]
            if i == j:
                P[i, j] += mass[i] * lengths[i] ** 2 / 3.0
            else:
                P[i, j] += 0.5 * mass[k] * lengths[k] * lengths[min(i, j)]
    spring = 1.4e4 / h

    def hub(time):
        s = time / 15.0
        return 90.0 * (s**3 - 0.5 * s**4), 6.0 * (3 * s**2 - 2 * s**3), 2.4 * (s - s**2)

    def rates(time, y):
        angle, w, push = hub(time)
        th = np.concatenate([[angle], y[:count]])
        v = np.concatenate([[w], y[count:]])
        apart = th[:, None] - th
        moments = -(P * np.sin(apart)) @ v**2
        bends = spring * np.diff(th)
        moments[:-1] += bends
        moments[1:] -= bends
        A = P * np.cos(apart)
        return np.concatenate([
            y[count:], np.linalg.solve(A[1:, 1:], moments[1:] - A[1:, 0] * push)
        ])  # fmt: skip

    start = np.zeros(2 * count)
    found = solve_ivp(rates, (0.0, t[-1]), start, 'DOP853', t, rtol=rtol, atol=1e-2 * rtol)
    angle = np.array([hub(x)[0] for x in t])
    relative = np.vstack([np.zeros_like(t), found.y[:count] - angle])
    return lengths @ np.sin(relative)


def extrapolated(counts, tips):
    """To infinitely many segments, in even powers of their length."""
    powers = np.array([[n ** (-2.0 * k) for k in range(len(counts))] for n in counts])
    return np.linalg.solve(powers, tips)[0]


def main():
    """Integrate and write."""
    from make_nominal import REFERENCES  # noqa: PLC0415 - beside this file

    tips = [chain_tip(n, np.array([END]), 1e-10)[0] for n in SEGMENTS]
    limit, check = extrapolated(SEGMENTS, tips), extrapolated(SEGMENTS[1:], tips[1:])
    data = {
        'provenance': {
            'method': 'chains of rigid segments by DOP853, extrapolated in their number',
            'segments': [*SEGMENTS],
            'deflections': [f'{x:.12g}' for x in tips],
            'difference_without_the_coarsest': f'{abs(limit - check):.1g}',
            'script': 'make_spinning_beam.py',
            'date': date.today().isoformat(),
            'python': platform.python_version(),
            'scipy': scipy.__version__,
        },
        'units': 'SI',
        'duration': f'{END}',
        'deflection': f'{limit:.9g}',
    }
    path = REFERENCES / 'spinning_beam.json'
    path.write_text(json.dumps(data, indent=1) + '\n')
    print(data)


if __name__ == '__main__':
    main()
