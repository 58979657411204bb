"""Confirmation of jams at the end of a run: every mode of every contact is tried.

The engine solves complementarity problems by pivoting. Here each combination of modes is a set of
linear equations, whose solution is held against the inequalities of Coulomb and Signorini: first
for forces, then for an impact without collision and the forces after it (Glocker, Pfeiffer 1995,
Nonlinear Dyn. 7:471); beside friction in ideal joints for forces only, see `joint_jams`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.errors import RunError
from mechanism_sim.joints.rope.constraint import Rope
from mechanism_sim.numerics.symbolic import dense
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from test.grid.joint_jams import JointForces, no_forces

_NEAR = 1e-9  # of the size, and of the fastest speed: what touches, and what does not slip
_BEFORE = 1e-9  # of the time: how long before the jam the state is taken
_BEHIND = 1e-7  # of the time: how long behind it, along its rates, no forces go on
_SINGULAR = 0.1  # of what the least eigenvalue was a hundredth of the time before
_SHORT, _EARLIER = 1e-6, 1e-4  # of the time: how long before a rope is straight it is looked at
_SOON = 0.01  # of the time: so long it may take from there, as fast as it goes
_SLACK = 1e-9  # of the largest term: rounding of an inequality


def confirm_jam(machine: Machine, error: RunError) -> bool:
    """True if no mode of contact is consistent where a run ended because contacts jam."""
    said = re.search(r'jams .*?at t = ([-+.\de]+) s', str(error))
    if not said or not machine.level.dynamic:
        return False
    run = machine.start()
    if not isinstance(run, EventLoop):
        return False
    at = float(said[1])
    run.advance(at - _BEFORE * max(at, 1e-3), final=True)
    terms, count = run._gaps.terms(), len(machine.equations.system.gaps)
    near, speed = _NEAR * machine.mechanism.size, machine.drive.fastest * machine.mechanism.size
    touching = [i for i in range(count) if run.state.closed[i] or abs(terms.value[i]) < near]
    friction = np.minimum(terms.friction[touching], 1e4)
    rows = [*touching, *(count + i for i in touching)]
    frictional = bool(machine.equations.system.dynamics.frictional_joints)

    def rates() -> tuple[Array, JointForces | None]:
        terms = run._gaps.terms()
        v = np.array([terms.rate[r] if r < len(terms.rate) else 0.0 for r in rows])
        v[np.abs(v) < _NEAR * max(speed, 1.0)] = 0.0
        return v, JointForces(run, machine.equations.system) if frictional else None

    def ends(v: Array, joints: JointForces | None) -> bool:
        if joints:
            return no_forces(joints, touching, v[len(touching) :], friction)
        terms = run._gaps.terms()
        A = np.array([[terms.compliance[r][c] for c in rows] for r in rows])
        b = np.array([terms.free_acceleration[r] for r in rows])
        return jams(A, b, v, friction.tolist())

    before, joints_before = rates()
    if ends(before, joints_before):
        return True
    # forces may exist up to the jam, where two solutions become one or grow without bound: behind
    # it, at the same rates, there are none; what rests before it rests there, too
    moved = run.state
    ahead = _BEHIND * max(at, 1e-3)
    q = [x + ahead * v for x, v in zip(moved.q, moved.v, strict=True)]
    run._state[: len(q)] = q
    run._ta.time += ahead
    v, joints = rates()
    v[before == 0.0] = 0.0
    if joints and joints_before:
        joints.slips[joints_before.slips == 0.0] = 0.0
    return ends(v, joints)


def confirm_bending(machine: Machine, error: RunError) -> bool:
    """True if a run of elastic links broke down where their mass matrix became singular.

    Their kinetic energy is of second order in bends and their rates: it is positive only while
    these are small. It is so here by the expressions of the matrix, from which no step was made.
    """
    said = re.search(r'broke down at t = ([-+.\de]+) s', str(error))
    if not said or not machine.level.dynamic or not machine.mechanism.having(Beam):
        return False
    at = float(said[1])
    near, before = (_definite(machine, at * (1.0 - share)) for share in (1e-6, 1e-2))
    return near < _SINGULAR * before


def confirm_straight(machine: Machine, error: RunError) -> bool:
    """True if a rope is about to be straight where an error says that it leaves its pulley.

    There the pulley's rim touches the line between the points beside it, which is drawn here from
    the places of these points alone, of the motion that came before.
    """
    said = re.search(
        r'(\S+) leaves its pulley .*point (\d+) of .* after t = ([-+.\de]+) s', str(error)
    )
    ropes = {joint.name: joint for joint in machine.mechanism.joints if isinstance(joint, Rope)}
    if not said or said[1] not in ropes:
        return False
    before, pulley, after = ropes[said[1]].pulleys[int(said[2]) - 2 : int(said[2]) + 1]
    at = float(said[3]) * np.array([1.0 - _EARLIER, 1.0 - _SHORT])
    curve = simulate(machine, duration=float(at[-1])).motion.curve
    q = curve(np.minimum(at, curve.end)).T
    first, centre, last = (machine.mechanism.trace(p.place, q)[0] for p in (before, pulley, after))
    along, off = last - first, centre - first
    aside = (along[0] * off[1] - along[1] * off[0]) / np.hypot(*along)
    left = abs(pulley.radius) - math.copysign(1.0, pulley.radius) * aside
    falls = (left[0] - left[1]) / (at[1] - at[0])
    points = before.radius == after.radius == 0.0
    return bool(points and left[1] > 0.0 and left[1] < _SOON * at[1] * falls)


def _definite(machine: Machine, at: float) -> float:
    """Least eigenvalue of the mass matrix of free coordinates at a time, scaled to ones."""
    run, system = machine.start(), machine.equations.system
    assert isinstance(run, EventLoop)
    run.advance(at, final=True)
    free = [system.coordinates.index(c) for c in system.free]
    M = system.equations.M
    terms = [dense(M[i][k]) for i in free for k in free]
    seen = run._present.evaluate(system.run.compile_now(terms)).reshape(len(free), -1)
    scale = 1.0 / np.sqrt(np.abs(np.diag(seen)))
    return float(np.linalg.eigvalsh(seen * scale * scale[:, None])[0])


def jams(A: Array, b: Array, v: Array, friction: Sequence[float]) -> bool:
    """True if neither forces nor an impact without collision free m touching contacts.

    Parameters
    ----------
    A : (2m, 2m) rates of normals, then tangents, per unit impulse [1/kg]
    b : (2m,) their accelerations without contact forces [m/s^2]
    v : (2m,) their rates [m/s]
    friction : (m,) Coulomb's coefficients
    """
    m = len(friction)
    slip = np.sign(v[m:])
    if any(True for _ in solutions(A, b, slip, friction)):
        return False
    for impulse in solutions(A, v, np.zeros(m), friction):
        after = v + A @ impulse
        after[np.abs(after) < _SLACK * max(1e-300, np.abs(v).max())] = 0.0
        if impulse[:m].max() > 0.0 and any(
            True for _ in solutions(A, b, np.sign(after[m:]), friction)
        ):
            return False
    return True


def solutions(A: Array, b: Array, slip: Array, friction: Sequence[float]) -> Iterator[Array]:
    """All forces (2m,) for which ``A f + b`` obeys Signorini and Coulomb, mode by mode.

    A contact without slip may stick, or begin to slide either way against its friction.
    """
    m = len(friction)
    choices = [('open', 1.0, -1.0, 'stick') if not s else ('open', s) for s in slip]
    for modes in product(*choices):
        M, right = np.eye(2 * m), np.zeros(2 * m)
        for i, mode in enumerate(modes):
            if mode == 'open':
                continue
            M[i], right[i] = A[i], -b[i]
            if mode == 'stick':
                M[m + i], right[m + i] = A[m + i], -b[m + i]
            else:
                M[m + i, i] = float(mode) * friction[i]
        try:
            f: Array = np.linalg.solve(M, right).astype(np.float64)
        except np.linalg.LinAlgError:
            continue
        if _obeys(A @ f + b, f, modes, slip, friction, np.abs(A) @ np.abs(f) + np.abs(b)):
            yield f


def _obeys(
    a: Array, f: Array, modes: Sequence[str | float], slip: Array, friction: Sequence[float],
    terms: Array,
) -> bool:  # fmt: skip
    m = len(friction)
    small, weak = _SLACK * terms, _SLACK * np.abs(f).max(initial=0.0)
    for i, mode in enumerate(modes):
        t = m + i
        if mode == 'open':
            good = a[i] >= -small[i]
        elif mode == 'stick':
            good = f[i] >= -weak and abs(f[t]) <= friction[i] * f[i] + weak
        else:
            good = f[i] >= -weak and (bool(slip[i]) or float(mode) * a[t] >= -small[t])
        if not good:
            return False
    return True
