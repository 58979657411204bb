"""Jams with friction in ideal joints: all modes of contacts and joints are tried.

That friction grows with forces that it is a part of. Here each combination of modes is a set of
equations with roots of squares, which SciPy solves from several places; the engine follows its own
friction from step to step instead, or looks for it by Newton's method from none.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import heyoka as hy
import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.system import System
from mechanism_sim.numerics.symbolic import add, dense, dot
from mechanism_sim.tolerances import TOLERANCES

_SWITCHES = TOLERANCES.switches

_STARTS = 0.0, 1.0, -1.0, 1e3, -1e3  # [N, N m]
_SOLVED, _SLACK = 1e-9, 1e-7  # of the largest force, and of the largest acceleration

Modes = Sequence[str | float]


class JointForces:
    """Forces x (n,) of all rows of contacts, then of friction in joints, at one state.

    Attributes
    ----------
    rows, normals, frictions : how many rows there are, of these normals, and frictions
    slips : (rubs,) rates at which joints slide, exactly zero where they are at rest
    """

    def __init__(self, run: EventLoop, system: System) -> None:
        d, frames = system.dynamics, system.equations.frames
        struck = [hy.make_vars(f'struck{k}') for k in range(len(d.contacts.rows))]
        x = [*struck, *(joint.T for joint in d.frictional_joints)]
        solved = d.struck(struck)
        carried = system.set_valued.reactions(solved)
        bounds = [
            joint.friction.pressed(frames, carried[joint.friction.name])
            for joint in d.frictional_joints
        ]
        self._terms = [[(len(p.components), p.wall) for p in b] for b in bounds]
        parts = [
            dense(add(a, dot(line, struck)))
            for a, line in zip(d.free_acceleration, d.reduced.contacts.compliance, strict=True)
        ]
        parts += [
            system.set_valued._rate(dense(joint.slip.rate), solved.a)
            for joint in d.frictional_joints
        ]
        parts += [dense(c) for b in bounds for p in b for c in p.components]
        outputs = [*parts, *(hy.diff(y, z) for y in parts for z in x)]
        outputs += [dense(joint.slip.rate) for joint in d.frictional_joints]
        outputs += [dense(p.coefficient) for b in bounds for p in b]
        none = dict.fromkeys(x, hy.expression(0.0))
        seen = run._present.evaluate(system.run.compile_now(hy.subs(outputs, none)))
        size = len(parts)
        self._start, slopes, rest = np.split(seen, [size, size * (1 + len(x))])
        self._slopes = slopes.reshape(size, len(x))
        self.rows, self.normals, self.frictions = (
            len(struck),
            len(d.contacts.normal),
            len(d.frictional_joints),
        )
        self.slips, self._mu = np.split(rest, [self.frictions])
        self.slips[np.abs(self.slips) < _SWITCHES.rest] = 0.0

    def accelerations(self, x: Array) -> Array:
        """Of all rows, then of the slips of joints."""
        n = self.rows + self.frictions
        found: Array = self._start[:n] + self._slopes[:n] @ x
        return found

    def bounds(self, x: Array) -> Array:
        """Largest frictions (rubs,) that joints have under such forces."""
        n = self.rows + self.frictions
        c, found, i, j = self._start[n:] + self._slopes[n:] @ x, np.zeros(self.frictions), 0, 0
        for k, terms in enumerate(self._terms):
            for size, wall in terms:
                own = c[i : i + size]
                pressed = max(wall * own[0], 0.0) if wall else np.linalg.norm(own)
                found[k] += self._mu[j] * pressed
                i, j = i + size, j + 1
        return found

    def laws(self, x: Array, modes: Modes, touching: Sequence[int], friction: Array) -> Array:
        """Residuals of the laws in some modes of touching contacts, then of joints."""
        left, a, b = x.copy(), self.accelerations(x), self.bounds(x)
        scale = max(1.0, float(np.abs(self._start[: self.rows]).max(initial=0.0)))
        for i, mode, mu in zip(touching, modes, friction, strict=False):
            t = self.normals + i
            if mode == 'open':
                continue
            left[i] = a[i] / scale
            if t < self.rows:
                left[t] = a[t] / scale if mode == 'stick' else x[t] + float(mode) * mu * x[i]
        for k, mode in enumerate(modes[len(touching) :]):
            r = self.rows + k
            left[r] = a[r] / scale if mode == 'stick' else x[r] + float(mode) * b[k]
        return left


def no_forces(f: JointForces, touching: Sequence[int], rates: Array, friction: Array) -> bool:
    """True if no forces obey Newton, Signorini and Coulomb.

    Parameters
    ----------
    touching : m gaps
    rates : (m,) of their slips, exactly zero where they are at rest
    friction : (m,) Coulomb's coefficients
    """
    m = len(touching)
    contacts: list[Modes] = [
        ('open', *((float(s),) if s else (1.0, -1.0, 'stick'))) for s in np.sign(rates)
    ]
    joints: list[Modes] = [(float(s),) if s else (1.0, -1.0, 'stick') for s in np.sign(f.slips)]
    for modes in product(*contacts, *joints):
        for start in _STARTS:
            x = scipy.optimize.root(
                f.laws,
                np.full(f.rows + f.frictions, start),
                (modes, touching, friction),
                tol=1e-13,
            ).x
            most = max(1.0, float(np.abs(x).max()))
            solved = np.abs(f.laws(x, modes, touching, friction)).max() <= _SOLVED * most
            if solved and _obeys(f, x, modes, touching, friction, [*rates, *f.slips]):
                return False
    return m > 0 or f.frictions > 0


def _obeys(
    f: JointForces,
    x: Array,
    modes: Modes,
    touching: Sequence[int],
    friction: Array,
    slips: Sequence[float],
) -> bool:
    """True if forces of some modes satisfy the inequalities of contact and friction."""
    a, b, m = f.accelerations(x), f.bounds(x), len(touching)
    small, weak = _SLACK * np.abs(a).max(initial=1.0), _SLACK * np.abs(x).max(initial=1e-6)
    for k, mode in enumerate(modes):
        joint = k - m
        t = f.rows + joint if joint >= 0 else f.normals + touching[k]
        if mode == 'open':
            good = a[touching[k]] >= -small
        else:
            most = b[joint] if joint >= 0 else friction[k] * x[touching[k]]
            good = joint >= 0 or x[touching[k]] >= -weak
            if mode == 'stick':
                good = good and (t >= len(x) or abs(x[t]) <= most + weak)
            elif not slips[k]:
                good = good and float(mode) * a[t] >= -small
        if not good:
            return False
    return True
