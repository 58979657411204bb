"""The thesis mechanism with ideal bearings: motion, all joint forces and the crank's torque."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.four_bar import LooseFourBar, reference
from benchmarks.problem import OURS, Answer, Method, Outcome, Problem, Run
from mechanism_sim.scene import load_scene

SAMPLES = 2**14
REFERENCE_ANGLES = 8  #: crank angles of the reference, evenly around the turn
CRANK: Answer = np.arange(SAMPLES, dtype=np.float64) * (2.0 * np.pi / SAMPLES)


def error(answer: Answer) -> float:
    """Largest error of the force of the coupler on the rocker (2, 8) [N]."""
    right = reference('nominal')
    return float(np.abs(answer - np.array([right['force_x'], right['force_y']], float)).max())


def select_samples(force: Answer) -> Answer:
    """The forces (2, N) at the angles of the reference."""
    return force[:, :: SAMPLES // REFERENCE_ANGLES]


def ours(_: float) -> Run:
    """Closed-form kinematics and inverse dynamics, as `simulate` uses them."""
    machine = load_scene('four_bar_nominal')
    joint = [j.name for j in machine.mechanism.joints].index('coupler_rocker')
    speed, rest = np.full(SAMPLES, machine.drive.start[1]), np.zeros(SAMPLES)
    linkage, forces = machine.nominal.linkage, machine.nominal.inverse_dynamics

    def run() -> Callable[[], Outcome]:
        observed = forces(*linkage.motion(CRANK, speed, rest))
        return lambda: Outcome(select_samples(observed.reaction[joint]))

    return run


def newton_euler(_: float) -> Run:
    """Loop closure, and the nine equations of three free bodies solved together."""
    f = LooseFourBar.thesis()

    def u(angle: Answer) -> Answer:
        return np.array([np.cos(angle), np.sin(angle)])

    def v(angle: Answer) -> Answer:
        return np.array([-np.sin(angle), np.cos(angle)])

    def run() -> Callable[[], Outcome]:
        w2 = f.crank_speed
        u2 = u(CRANK)
        d = np.array([[f.ground], [0.0]]) - f.crank * u2
        length = np.hypot(d[0], d[1])
        cosine = (f.coupler**2 + length**2 - f.rocker**2) / (2.0 * f.coupler * length)
        th3 = np.arctan2(d[1], d[0]) + np.arccos(cosine)
        u3, v3 = u(th3), v(th3)
        u4 = (f.coupler * u3 - d) / f.rocker
        v4 = np.array([-u4[1], u4[0]])
        s = u3[0] * u4[1] - u3[1] * u4[0]
        r = -f.crank * w2 * v(CRANK)
        w3, w4 = (r * u4).sum(axis=0) / (f.coupler * s), (r * u3).sum(axis=0) / (f.rocker * s)
        r = f.crank * w2**2 * u2 + f.coupler * w3**2 * u3 - f.rocker * w4**2 * u4
        a3, a4 = (r * u4).sum(axis=0) / (f.coupler * s), (r * u3).sum(axis=0) / (f.rocker * s)
        # accelerations of the centres of gravity, less gravity
        lift = np.array([[0.0], [f.gravity]])
        c2 = -f.crank_cog * w2**2 * u2 + lift
        c3 = -f.crank * w2**2 * u2 + f.coupler_cog * (a3 * v3 - w3**2 * u3) + lift
        c4 = f.rocker_cog * (a4 * v4 - w4**2 * u4) + lift
        A, b = np.zeros((SAMPLES, 9, 9)), np.zeros((SAMPLES, 9))
        bodies = (
            (f.crank_mass, f.crank_inertia, c2, 0.0 * a3, u2, f.crank_cog, f.crank, (0, 1), 1),
            (f.coupler_mass, f.coupler_inertia, c3, a3, u3, f.coupler_cog, f.coupler, (1, 2), 1),
            (f.rocker_mass, f.rocker_inertia, c4, a4, u4, f.rocker_cog, f.rocker, (3, 2), -1),
        )
        for i, (mass, inertia, c, alpha, along, cog, end, (near, far), sign) in enumerate(bodies):
            for joint, on, arm in ((near, 1, -cog), (far, -sign, end - cog)):
                A[:, 3 * i, 2 * joint] = A[:, 3 * i + 1, 2 * joint + 1] = on
                A[:, 3 * i + 2, 2 * joint] = -on * arm * along[1]
                A[:, 3 * i + 2, 2 * joint + 1] = on * arm * along[0]
            b[:, 3 * i : 3 * i + 2], b[:, 3 * i + 2] = mass * c.T, inertia * alpha
        A[:, 2, 8] = 1.0
        forces = np.asarray(np.linalg.solve(A, b[:, :, None])[:, :, 0], np.float64)
        return lambda: Outcome(select_samples(forces[:, 4:6].T))

    return run


PROBLEM = Problem(
    'four_bar_nominal',
    'Ideal four-bar: motion, forces in all joints and torque of the crank',
    'sample',
    float(SAMPLES),
    'N',
    'Force of the coupler on the rocker at eight crank angles, in 50 digits '
    '(test/references/make_nominal.py).',
    error,
    (
        Method(
            OURS,
            (float(SAMPLES),),
            'samples',
            ours,
            'Loop closure in closed form, inverse dynamics in compiled expressions, vectorised; '
            'energies are computed too.',
        ),
        Method(
            'NumPy Newton-Euler 9x9',
            (float(SAMPLES),),
            'samples',
            newton_euler,
            'Vectorised loop closure, then `numpy.linalg.solve` on nine equations a sample.',
        ),
    ),
    1e-12,
)
