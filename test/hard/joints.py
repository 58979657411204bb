"""Several loose joints at once, and friction in them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mechanism_sim.engine.events import Mode, gains
from mechanism_sim.results.run import Solution
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from test.hard.bodies import TURN, residual, thesis
from test.hard.case import Figure, hard_case

JOINTS = ('coupler_rocker', 'crank_coupler', 'rocker_ground', 'ground_crank')


def loose(joints: Sequence[str], c: float = 2.54e-4, **more: Any) -> Machine:
    """The thesis scene with these joints loose; `more` goes into each clearance."""
    clearance = {'radial': c, 'restitution': 0.5} | more
    overrides = {f'joints__{joint}__clearance': clearance for joint in joints}
    return thesis(**overrides)


def _gap(solution: Solution) -> float:
    """Deepest violation, open or closed [m]."""
    return max(solution.max_penetration, solution.max_closure_error)


@hard_case(
    'Two and four loose joints over 100 revolutions: every impact shakes all of them.',
    'The balance of energy, and gaps from the finished polynomials.',
)
def four_loose_joints() -> list[Figure]:
    """Gaps and balance with two and with four loose joints."""
    figures = []
    for n in (2, 4):
        solution = simulate(loose(JOINTS[:n]), revolutions=100)
        balance = solution.energy
        exchanged = sum(i.normal_impulse * i.approach_speed for i in solution.impacts)
        whole = exchanged + (balance.initial if balance else 0.0)
        figures += [
            Figure(f'deepest gap, {n} joints', _gap(solution), 1e-12, 'm'),
            Figure(f'relative energy residual, {n} joints', abs(residual(balance)) / whole, 1e-9),
            Figure(f'impacts, {n} joints', len(solution.impacts)),
        ]
    return figures


@hard_case(
    'The clearance of three of four loose joints goes to zero: ever faster small motions remain.',
    'The machine with one loose joint alone is the limit, approached in proportion to the '
    'clearance of the others.',
)
def other_clearances_vanish() -> list[Figure]:
    """Order of the difference from one loose joint, before contact is first lost."""
    alone = simulate(thesis(), revolutions=0.5)
    t = np.linspace(0.0, 0.5, 200) * TURN
    reference = alone.sample(t, 'position.rocker')['position.rocker']
    sizes, differences = (1e-5, 1e-6, 1e-7), []
    clearance = {'radial': 2.54e-4, 'restitution': 0.5}
    for c in sizes:
        others = {f'joints__{joint}__clearance': clearance | {'radial': c} for joint in JOINTS[1:]}
        solution = simulate(thesis(**others), revolutions=0.5)
        found = solution.sample(t, 'position.rocker')['position.rocker']
        differences.append(float(np.abs(found - reference).max()))
    order = float(np.polyfit(np.log(sizes), np.log(differences), 1)[0])
    return [
        Figure('order of the difference, less 1', order - 1.0, 0.05),
        Figure('difference at 1e-7 m', differences[-1], 1e-5, 'rad'),
    ]


@hard_case(
    'Friction in all four joints, sticking, sliding and detaching in turn.',
    'The energy balance, loss by sliding from a quadrature; energy never rises at an impact.',
)
def friction_in_four_joints() -> list[Figure]:
    """Energy residual, gaps and changes of mode over 20 revolutions."""
    machine = loose(JOINTS, friction=0.1, pin_radius=0.005, hypothesis='poisson')
    solution = simulate(machine, revolutions=20)
    modes = {m.mode for m in solution.modes}
    made = max(0.0, *gains(solution.impacts))
    missing = set(Mode) - {*modes, Mode.UNKNOWN, Mode.FOLLOWING, Mode.RECOVERING}
    return [
        Figure('energy residual', residual(solution.energy), 1e-9, 'J'),
        Figure('deepest gap', _gap(solution), 1e-12, 'm'),
        Figure('modes that never occurred', len(missing), 0.0),
        Figure('largest gain at an impact', made, 1e-14, 'J'),
        Figure('changes of mode', len(solution.modes)),
    ]


@hard_case(
    "Newton's restitution with friction, where sliding stops or turns within the impact: it makes "
    "energy, as Poisson's and Stronge's cannot (Kane's paradox).",
    'The sum over the impacts of impulse times mean velocity, which is the change of energy '
    'exactly.',
)
def kane_in_a_bearing() -> list[Figure]:
    """Energy made at impacts by each hypothesis over random starts of the thesis scene."""
    made = dict.fromkeys(('newton', 'poisson', 'stronge'), 0.0)
    count = dict.fromkeys(made, 0)
    largest = 0.0
    rng = np.random.default_rng(5)
    for angle in rng.uniform(0.0, 2.0 * np.pi, 6):
        for law in made:
            machine = thesis(
                law=law, e=1.0, mu=0.5, start='centred', drive__start_angle=float(angle)
            )
            solution = simulate(machine, revolutions=1.0)
            made[law] = max([made[law], *gains(solution.impacts)])
            count[law] += len(solution.impacts)
            largest = max(largest, abs(residual(solution.energy)))
    return [
        Figure('largest gain by Poisson', made['poisson'], 1e-15, 'J'),
        Figure('largest gain by Stronge', made['stronge'], 1e-15, 'J'),
        Figure('largest gain by Newton', made['newton'], unit='J'),
        Figure('Newton made none at all', float(made['newton'] <= 0.0), 0.0),
        Figure('impacts', sum(count.values())),
        Figure('energy residual', largest, 1e-11, 'J'),
    ]
