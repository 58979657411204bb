"""The loose bearing of the thesis: elastic impacts, chatter, loss of contact, clearance, speed."""

from __future__ import annotations

import math

import numpy as np

from mechanism_sim.engine.audit import Energy
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import RunError
from mechanism_sim.results.run import Solution
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import load_scene
from test.hard.bodies import SPEED, TURN, relative_residual, thesis
from test.hard.case import Figure, hard_case

FIRST_LOSS = 1.77569122303540473e-01 / TURN
"""Revolutions until a seated pin first lets go; by a 256-bit computation of other formulation
(test/references/four_bar_seated_e05.json)."""


def _first_loss(solution: Solution) -> float:
    """Time of the first loss of contact [s]."""
    return next((m.t for m in solution.modes[1:] if m.mode == Mode.FREE_FLIGHT), math.nan)


@hard_case(
    'Nothing is lost in 100 revolutions of elastic impacts: an error of a part in a million would '
    'show as energy.',
    'The energy balance: final energy less initial is the work of the drive, by quadrature and '
    'impulses.',
)
def elastic_hundred_revolutions() -> list[Figure]:
    """Energy residual and gaps with e = 1."""
    solution = simulate(thesis(start='centred', e=1.0), revolutions=100)
    balance = solution.energy or Energy(math.nan, 0.0, 0.0, math.nan)
    return [
        Figure('relative energy residual', relative_residual(solution), 1e-11),
        Figure('energy lost in impacts', balance.dissipated, 1e-12, 'J'),
        Figure('penetration', solution.max_penetration, 1e-12, 'm'),
        Figure('impacts', len(solution.impacts)),
    ]


@hard_case(
    'Chatter in a bearing that moves, for restitutions from 0.1 to 0.95.',
    'The same run at a tolerance 100 times smaller: times at which the pin comes to rest, each '
    'with what its last impact says was left out.',
)
def chatter_in_a_bearing() -> list[Figure]:
    """Change of the time of rest and of the impulse by the tolerance."""
    time = share = impulse = 0.0
    for e in (0.1, 0.3, 0.5, 0.7, 0.9, 0.95):
        rests, totals, cut = [], [], 0.0
        for rtol in (1e-11, 1e-13):
            solution = simulate(thesis(start='centred', e=e, solver__rtol=rtol), revolutions=0.7)
            last = next((i for i in solution.impacts if i.ends_chatter), None)
            if last is None:
                raise RunError(f'the pin never comes to rest with a restitution of {e}')
            rests.append(last.t + last.chatter_time)
            cut = max(cut, last.chatter_time)
            # what presses during the bounces left out is the following force
            N = float(
                solution.sample(last.t, 'normal_force.coupler_rocker')[
                    'normal_force.coupler_rocker'
                ][0]
            )
            done = sum(i.normal_impulse for i in solution.impacts if i.t <= last.t)
            totals.append(done + N * last.chatter_time)
        time = max(time, abs(rests[1] - rests[0]))
        share = max(share, abs(rests[1] - rests[0]) / cut)
        impulse = max(impulse, abs(totals[1] / totals[0] - 1.0))
    return [
        Figure('change of the time of rest', time, 1e-8, 's'),
        Figure('the same over the time cut', share, 1e-2),
        Figure('relative change of the impulse', impulse, 1e-6),
    ]


@hard_case(
    'Contact is lost once, after more than a revolution; a coarse step may jump over it.',
    'The instant known from a 256-bit computation of another formulation.',
)
def loss_of_contact_at_every_tolerance() -> list[Figure]:
    """The first loss at rtol 1e-4 to 1e-13."""
    worst = fine = 0.0
    for exponent in range(4, 14):
        solution = simulate(thesis(solver__rtol=10.0**-exponent), revolutions=2.25)
        error = abs(_first_loss(solution) / TURN - FIRST_LOSS)
        worst = max(worst, error / 10.0**-exponent)
        if exponent >= 12:
            fine = max(fine, error)
    return [
        Figure('error in revolutions over rtol', worst, 1.0),
        Figure('error at 1e-12 and below', fine, 1e-11, 'revolutions'),
    ]


def _loses_contact(speed: float) -> bool:
    solution = simulate(thesis(drive__speed=speed), revolutions=1.0)
    return not math.isnan(_first_loss(solution))


@hard_case(
    'A contact force that touches zero without crossing, and one that dips below it for a moment '
    'far shorter than a step.',
    'Bisection over the speed: the smallest force below the limit is positive and vanishes at it.',
)
def force_that_touches_zero() -> list[Figure]:
    """Smallest force just below the speed at which contact is first lost, and the flight above."""
    low, high = SPEED, 1.5 * SPEED
    for _ in range(44):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _loses_contact(middle) else (middle, high)
    below = simulate(thesis(drive__speed=low), revolutions=1.0)
    above = simulate(thesis(drive__speed=high), revolutions=1.0)
    t = np.linspace(0.0, below.duration, 20001)
    smallest = float(
        below.sample(t, 'normal_force.coupler_rocker')['normal_force.coupler_rocker'].min()
    )
    begins = _first_loss(above)
    ends = next(i.t for i in above.impacts if i.t > begins)
    around = np.linspace(-1e-4, 1e-4, 20001) + begins
    smallest = min(
        smallest,
        float(
            below.sample(around, 'normal_force.coupler_rocker')[
                'normal_force.coupler_rocker'
            ].min()
        ),
    )
    return [
        Figure('smallest force just below the limit', smallest, 1e-6, 'N'),
        Figure('pull below the limit', min(smallest, 0.0), 1e-9, 'N'),
        Figure('flight just above the limit', ends - begins, 1e-3, 's'),
        Figure('penetration above', above.max_penetration, 1e-14, 'm'),
    ]


@hard_case(
    'Clearances of 1 micrometre to 1 mm in a machine of 0.4 m.',
    'The energy balance; and while the pin follows, links deviate from the ideal mechanism in '
    'proportion to the clearance.',
)
def clearance_from_a_micrometre() -> list[Figure]:
    """Energy residual, gaps, and the exponent with which the motion approaches the ideal one."""
    residual = depth = closure = 0.0
    ideal = simulate(load_scene('four_bar_nominal'), revolutions=0.5)
    t = np.linspace(0.0, 0.5 * TURN, 400)
    reference = ideal.sample(t, 'position.rocker')['position.rocker']
    clearances = (1e-6, 1e-5, 1e-4, 2.54e-4, 1e-3)
    deviations = []
    for c in clearances:
        solution = simulate(thesis(c=c), revolutions=0.5)
        away = np.abs(solution.sample(t, 'position.rocker')['position.rocker'] - reference)
        deviations.append(float(away.max()))
        longer = simulate(thesis(c=c), revolutions=3.0)
        residual = max(residual, abs(relative_residual(longer)))
        depth = max(depth, longer.max_penetration)
        closure = max(closure, longer.max_closure_error)
    order = float(np.polyfit(np.log(clearances), np.log(deviations), 1)[0])
    return [
        Figure('relative energy residual', residual, 1e-10),
        Figure('penetration', depth, 1e-12, 'm'),
        Figure('closure error', closure, 1e-12, 'm'),
        Figure('order of the deviation from the ideal mechanism, less 1', order - 1.0, 0.05),
    ]


@hard_case(
    'Crank speeds from 10 to 2500 rpm, both ways.',
    'The energy balance; and without gravity time scales with the speed: the same impacts at the '
    'same crank angles.',
)
def speeds_from_10_to_2500_rpm() -> list[Figure]:
    """Energy residual and gaps over all speeds, and the scaling of impacts."""
    residual = depth = 0.0
    angles = []
    for rpm in (10.0, 100.0, 350.0, 1000.0, 2500.0):
        for sign in (1.0, -1.0):
            speed = sign * rpm * math.pi / 30.0
            solution = simulate(thesis(drive__speed=speed, start='centred'), revolutions=2.0)
            residual = max(residual, abs(relative_residual(solution)))
            depth = max(depth, solution.max_penetration)
        solution = simulate(
            thesis(drive__speed=speed, start='centred', gravity=[0, 0]), revolutions=0.3
        )
        angles.append([i.t * abs(speed) for i in solution.impacts if not i.ends_chatter][:8])
    spread = max(float(np.ptp(column)) for column in zip(*angles, strict=False))
    return [
        Figure('relative energy residual', residual, 1e-10),
        Figure('penetration', depth, 1e-12, 'm'),
        Figure('spread of the crank angles of 8 impacts without gravity', spread, 1e-10, 'rad'),
        Figure('impacts compared', min(map(len, angles))),
    ]


@hard_case(
    'Almost a change point: ground and crank in line leave the coupler and rocker almost in line.',
    'The balance of energy; margins of 1e-2 to 1e-4 of the ground.',
)
def near_a_change_point() -> list[Figure]:
    """Energy residual and gaps beside the singular configuration."""
    residual = depth = 0.0
    largest = 0.0
    for margin in (1e-2, 1e-3, 1e-4):
        # reach of coupler and rocker is just longer than ground and crank together
        ground = 0.309 + 0.312 - 0.064 - margin * 0.387
        solution = simulate(thesis(links__ground__length=ground), revolutions=2.0)
        residual = max(residual, abs(relative_residual(solution)))
        depth = max(depth, solution.max_penetration)
        largest = max([largest, *(i.normal_impulse for i in solution.impacts)])
    return [
        Figure('relative energy residual', residual, 1e-9),
        Figure('penetration', depth, 1e-11, 'm'),
        Figure('largest impulse', largest, unit='N s'),
    ]


@hard_case(
    'A pin that starts exactly on the boundary, a rounding inside, or a rounding outside of it.',
    'All of them are seated: the same first loss of contact.',
)
def seated_on_the_boundary() -> list[Figure]:
    """Spread of the first loss over starts that differ by roundings."""
    machine = thesis()
    times = []
    state = machine.initial_state()
    for step in (-4, -1, 0, 1, 4):
        angle = state.q[0]
        for _ in range(abs(step)):
            angle = math.nextafter(angle, math.inf if step > 0 else -math.inf)
        keys = {
            'initial__position__coupler': angle,
            'initial__position__rocker': state.q[1],
            'initial__velocity__coupler': state.v[0],
            'initial__velocity__rocker': state.v[1],
        }
        solution = simulate(thesis(**keys), revolutions=1.1)
        flights = [m.t for m in solution.modes if m.mode == Mode.FREE_FLIGHT and m.t > 0.5 * TURN]
        times.append(flights[0] / TURN if flights else math.nan)
    return [
        Figure('spread of the first loss', float(np.ptp(times)), 1e-9, 'revolutions'),
        Figure('error of the first loss', times[2] - FIRST_LOSS, 1e-10, 'revolutions'),
    ]
