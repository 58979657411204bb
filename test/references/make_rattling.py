"""References for the scenes `valve_train` and `gear_rattle`, without any integrator.

Both have one free coordinate, whose motion between impacts is known in closed form: the valve is
a harmonic oscillator above a cycloidal cam, the wheel turns under a sine of time and a linear drag
against a pinion of constant speed. So a flight ends at the first root of a function in closed
form, found in 50 digits with `mpmath`; in contact the motion is given, and contact ends at a root
of the force. Bounces are followed until they are less than 1e-30 m high.

`python make_rattling.py` writes `valve_train.json` and `gear_rattle.json` to
benchmarks/references.
"""

from __future__ import annotations

import json
import platform
from datetime import date
from functools import partial
from pathlib import Path
from typing import ClassVar

import mpmath as mp

REFERENCES = Path(__file__).parents[2] / 'benchmarks' / 'references'
REVOLUTIONS = 5
LOWEST = mp.mpf('1e-30')  # [m] bounces that count as contact
mp.mp.dps = 50


class Valve:
    """Its height u above the base circle, and the cam's lift below it."""

    parameters: ClassVar = {
        'mass': '0.15', 'stiffness': '20000', 'preload': '201.4715', 'lift': '0.008',
        'lift_angle': 'pi/2', 'speed': '120 pi', 'start_angle': '10 pi/9', 'restitution': '0.3',
    }  # fmt: skip
    m, k, preload = mp.mpf('0.15'), mp.mpf(20000), mp.mpf('201.4715')
    lift, span = mp.mpf('0.008'), mp.pi / 2
    speed, start = 120 * mp.pi, 10 * mp.pi / 9
    restitution = mp.mpf('0.3')
    walls = (1,)
    seated = 1
    period = 2 * mp.pi / speed
    breaks = (0, span, 2 * span)

    def cam(self, t):
        """Lift, speed and acceleration of the cam's face."""
        x = mp.fmod(self.speed * t + self.start, 2 * mp.pi)
        if x >= 2 * self.span:
            return mp.mpf(0), mp.mpf(0), mp.mpf(0)
        s, sign = (x / self.span, 1) if x < self.span else ((2 * self.span - x) / self.span, -1)
        turned, rate = 2 * mp.pi * s, self.speed / self.span
        return (
            self.lift * (s - mp.sin(turned) / (2 * mp.pi)),
            sign * rate * self.lift * (1 - mp.cos(turned)),
            rate**2 * self.lift * 2 * mp.pi * mp.sin(turned),
        )

    def wall(self, t, _):
        """Position of the follower's contact, and its rate."""
        return self.cam(t)[:2]

    def pull(self, t, side):
        """Acceleration away from the wall of what just touches it."""
        u, _, a = self.cam(t)
        return -(self.preload + self.k * u) / self.m - a

    def flight(self, t0, u, v):
        """Height and speed as functions of time."""
        w, rest = mp.sqrt(self.k / self.m), -self.preload / self.k
        a, b = u - rest, v / w

        def at(t):
            c, s = mp.cos(w * (t - t0)), mp.sin(w * (t - t0))
            return rest + a * c + b * s, w * (b * c - a * s)

        return at


class Wheel:
    """The pinion's lead x along the line of action, between the flanks at -c and c."""

    parameters: ClassVar = {
        'teeth': '20, 40', 'module': '0.002', 'pressure_angle': '20 deg', 'backlash': '0.0001',
        'inertia': '0.0015', 'speed': '20 pi', 'swing': '3', 'frequency': '40 pi',
        'drag': '0.02', 'restitution': '0.6',
    }  # fmt: skip
    b1 = 20 * mp.mpf('0.002') / 2 * mp.cos(mp.pi / 9)
    b2 = 2 * b1
    c = mp.mpf('0.0001') * mp.cos(mp.pi / 9) / 2
    inertia, swing, drag = mp.mpf('0.0015'), mp.mpf(3), mp.mpf('0.02')
    speed, frequency = 20 * mp.pi, 40 * mp.pi
    restitution = mp.mpf('0.6')
    walls = (1, -1)
    seated = 0
    period = 2 * mp.pi / speed
    breaks = ()

    def wall(self, _, side):
        return -side * self.c, mp.mpf(0)

    def pull(self, t, side):
        rate = -self.b1 * self.speed / self.b2
        torque = self.swing * mp.sin(self.frequency * t) - self.drag * rate
        return side * self.b2 * torque / self.inertia

    def flight(self, t0, x, v):
        """``x'' = b2 (T sin(W t) - d w2)/I`` with ``w2 = (x' - b1 w1)/b2``: it is linear in x'."""
        d, W = self.drag / self.inertia, self.frequency
        steady, force = self.b1 * self.speed, self.b2 * self.swing / self.inertia
        size = force / (d * d + W * W)

        def forced(t):  # of v' = -d (v - steady) + force sin(W t)
            return steady + size * (d * mp.sin(W * t) - W * mp.cos(W * t))

        def way(t):  # its integral
            return steady * t - size * (d * mp.cos(W * t) + W * mp.sin(W * t)) / W

        off = v - forced(t0)

        def at(t):
            fade = mp.exp(-d * (t - t0))
            return x + way(t) - way(t0) + off * (1 - fade) / d, forced(t) + off * fade

        return at


def root(function, a, b):
    return mp.findroot(function, (a, b), solver='anderson', tol=mp.mpf('1e-80'), verify=False)


def distance(machine, at, side, t):
    """From a wall."""
    return at(t)[0] - machine.wall(t, side)[0]


def run(machine):
    """Times and speeds of all impacts; times at which contact begins and ends."""
    end, longest = REVOLUTIONS * machine.drive.period, machine.drive.period / 500
    t, side = mp.mpf(0), machine.seated
    x, v = machine.wall(t, side) if side else (mp.mpf(0), mp.mpf(0))
    impacts, seatings, releases = [], [], []
    step = longest / 1000
    while t < end:
        if side:
            while t < end and machine.pull(t + longest, side) < 0:
                t += longest
            if t >= end:
                break
            if machine.pull(t, side) < 0:
                t = root(partial(machine.pull, side=side), t, t + longest)
            releases.append(t)
            x, v = machine.wall(t, side)
            side, step = 0, longest / 1000
        at, a, struck = machine.flight(t, x, v), t, None
        while a < end:
            b = a + step
            fallen = [w for w in machine.walls if w * (at(b)[0] - machine.wall(b, w)[0]) <= 0]
            if fallen:
                struck = fallen[0]
                break
            a, step = b, min(longest, step * mp.mpf('1.3'))
        if struck is None:
            break
        t = root(partial(distance, machine, at, struck), a, b)
        (_, v), (x, face) = at(t), machine.wall(t, struck)
        approach = struck * (face - v)
        impacts.append((t, approach))
        back, pull = machine.restitution * approach, machine.pull(t, struck)
        if pull < 0 and back * back < -2 * pull * LOWEST:
            side = struck
            seatings.append(t)
            continue
        v = face + struck * back
        step = min(longest, -back / (4 * pull)) if pull < 0 else longest
    return [i for i in impacts if i[0] < end], seatings, releases


def main():
    for name, machine in (('valve_train', Valve()), ('gear_rattle', Wheel())):
        impacts, seatings, releases = run(machine)
        fastest = max(v for _, v in impacts)
        hard = [(t, v) for t, v in impacts if v > fastest / 100]
        data = {
            'provenance': {
                'method': 'flights in closed form, their ends by bracketed roots',
                'decimal_digits': mp.mp.dps,
                'script': Path(__file__).name,
                'date': str(date.today()),
                'python': platform.python_version(),
                'mpmath': mp.__version__,
            },
            'units': 'SI; digits are decimal strings; impacts faster than 1/100 of the fastest',
            'parameters': machine.parameters,
            'revolutions': REVOLUTIONS,
            'duration': mp.nstr(REVOLUTIONS * machine.drive.period, 25),
            'impacts': {
                't': [mp.nstr(t, 25) for t, _ in hard],
                'approach_speed': [mp.nstr(v, 25) for _, v in hard],
            },
            'seated': [mp.nstr(t, 25) for t in seatings],
            'released': [mp.nstr(t, 25) for t in releases],
        }
        path = REFERENCES / f'{name}.json'
        path.write_text(json.dumps(data, indent=1) + '\n')
        print(f'{path.name}: {len(impacts)} impacts, {len(hard)} of them hard')


if __name__ == '__main__':
    main()
