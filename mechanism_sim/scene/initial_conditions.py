"""Where a machine starts: its pins at the centre of their bushings, or pressed against them."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.clock import take_off_turns
from mechanism_sim.hybrid.snapshot import State
from mechanism_sim.hybrid.system import Array
from mechanism_sim.linkages.bearing import BearingClearance
from mechanism_sim.linkages.bearing_ends import AxialStop, BearingEnd
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.configuration import converted
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.mechanism import Revolute
from mechanism_sim.planar.protocols import Gap
from mechanism_sim.scene.assembly import Assembly, closed_near, nearest_rates, opening
from mechanism_sim.scene.dynamic_model import DynamicModel
from mechanism_sim.scene.elastic_start import smooth_start
from mechanism_sim.scene.start_configuration import leaning_seats, seats

_SOFT = 1e-3
"""Weight of a pin's way from its seat, in clearances, against a size that ideal joints open."""
_ROUNDS = 30
_SEATED = 1e-16

Values = dict[str, float]


def initial_state(machine: DynamicModel) -> State:
    """Where the equations of motion start.

    ``centred``: the nominal mechanism, pins at the centre, in flight. ``seated``: each pin rests
    on its bushing in the direction of the nominal force of the first-named on the second-named
    link; nominal rates. Coordinates given in `initial` replace those, exactly; then all gaps
    count as open at first.
    """
    q, v = _placed(machine)
    system = machine.system
    turns = dict.fromkeys(system.free, 0)
    for c in {*system.free}.difference(machine.mechanism.displacements):
        whole, q[c] = take_off_turns(q[c])
        turns[c] = whole + machine.turned.get(c, 0)
    seated = machine.scene.start == 'seated' and not machine.placed_outright
    values = np.array([[q[c]] for c in system.coordinates])
    _check_inside(machine, values, seated)
    return State(
        Fraction(0),
        tuple(turns[c] for c in system.free),
        tuple(q[c] for c in system.free),
        tuple(v[c] for c in system.free),
        tuple(
            seated and _starts_closed(machine, gap, value)
            for gap, value in zip(system.gaps, machine.observer.gap_values(values), strict=True)
        ),
    )


def _starts_closed(machine: DynamicModel, gap: Gap, value: Array) -> bool:
    """Pins are on their bushings but in oil, and what can only lift off is in contact."""
    play = machine.clearances[gap.joint]
    if not isinstance(gap, BearingClearance) or play.film:
        return play.radial == 0.0
    near = max(1e-9 * play.radial, 1e-14 * machine.mechanism.size)
    return not isinstance(gap, BearingEnd) or float(gap.distance(value)[0]) <= near


def _placed(machine: DynamicModel) -> tuple[Values, Values]:
    """Values and rates of the coordinates."""
    plan, start = machine.plan, _started(machine)
    if not machine.clearances:
        names = plan.ideal.coordinates
        return dict(zip(names, start.q.tolist(), strict=True)), dict(
            zip(names, start.v.tolist(), strict=True)
        )
    loose = machine.mechanism
    given = tuple({c: x for c, x in part.items() if _alike(machine, c)} for part in plan.given)
    for kind, whole, part in zip(('position', 'velocity'), plan.given, given, strict=True):
        if lost := [c for c in whole if c not in part]:
            link = lost[0]
            places = [c for c in loose.coordinates if c in (f'{link}.x', f'{link}.y')]
            own = ', '.join([f'{link}, an angle', *(f'{c}, a displacement' for c in places)])
            raise InputError(
                f'{machine.name}: initial.{kind}.{link} cannot be set: with its loose joints '
                f'the machine is not carried by the guide of {link}; what can be given of it is '
                f'{own}'
            )
    given = given[0] | plan.floating[0], given[1] | plan.floating[1]
    near, _ = converted(plan.ideal, loose, start.q, start.v)
    held = [c for c in loose.coordinates if c in plan.begins or c in plan.prescribed]
    placed = _places(machine, start, near, held, given[0])
    v = _rates(machine, start, placed, held, given[1])
    names = loose.coordinates
    return dict(zip(names, placed.tolist(), strict=True)), dict(
        zip(names, v.tolist(), strict=True)
    )


def _started(machine: DynamicModel) -> Assembly:
    """Where the machine without clearance starts."""
    smooth = machine.scene.initial.elastic == 'smooth'
    return smooth_start(machine) if smooth else machine.assembly


def _alike(machine: DynamicModel, c: str) -> bool:
    """Whether a coordinate means the same with clearance as without."""
    ideal, loose = machine.plan.ideal, machine.mechanism
    slides = [m.tree_joints.get(c) if c in m.sliding else None for m in (ideal, loose)]
    return slides[0] == slides[1]


def _places(
    machine: DynamicModel, start: Assembly, near: Array, held: Sequence[str], given: Values
) -> Array:
    """Coordinates of the loose mechanism: pins at their seats, unless given ones move them.

    Where they do, ideal joints stay closed, and the pins are as little off their seats as can be,
    measured in their clearances.
    """
    loose = machine.mechanism
    names = loose.coordinates
    guess = np.array([given.get(c, x) for c, x in zip(names, near, strict=True)])
    fixed = [c for c in names if c in held or c in given]
    every = Kinematics(loose, closures(loose, loose.cut), fixed)
    targets = np.zeros(len(every.rows))
    pressed: dict[str, Array] = {}
    if machine.scene.start == 'seated' and machine.system.gaps:
        columns = [x[:, None] for x in (start.q, start.v)]
        a = np.zeros_like(columns[0])
        if not (machine.torque_driven or machine.starts_singular):
            _, _, a, _ = machine.ideal.motion(columns[0], *_driven_rates(machine))
        pressed = seats(machine, columns[0], columns[1], a)
        for name, Q in pressed.items():
            targets[[i for i, row in enumerate(every.rows) if row == name]] = Q
    if not given and not targets.any():
        return guess  # the loops of the ideal mechanism are closed
    try:
        closed = closed_near(machine.name, every, guess, targets)
        for _ in range(_ROUNDS):  # where axes lean, the seat turns with the links
            before = targets.copy()
            for name, Q in leaning_seats(machine, pressed, closed).items():
                targets[[i for i, row in enumerate(every.rows) if row == name]] = Q
            if np.abs(targets - before).max(initial=0.0) <= _SEATED * loose.size:
                break
            closed = closed_near(machine.name, every, closed, targets)
        return closed
    except InputError as error:
        if not given:
            centred = "; or write 'start: centred'" if targets.any() else ''
            raise InputError(f'{error}{centred}') from error
    soft = np.array([row in machine.clearances for row in every.rows])
    play = [machine.clearances[row].radial if row in machine.clearances else 0.0
            for row in every.rows]  # fmt: skip
    weight = np.where(soft, _SOFT * loose.size / np.where(play, play, loose.size), 1.0)
    for _ in range(_ROUNDS):
        off, J = every.closure(guess[:, None])
        left = weight * (off[0] - targets)
        step = np.linalg.lstsq(weight[:, None] * J[0][:, every.sought], -left, rcond=1e-12)[0]
        guess[every.sought] += step * min(1.0, 0.5 / max(float(np.abs(step).max(initial=0)), 0.5))
    firm = [j for j in loose.cut if j not in machine.clearances]
    kinematics = Kinematics(loose, closures(loose, firm), fixed)
    return closed_near(machine.name, kinematics, guess, np.zeros(len(kinematics.rows)))


def _rates(
    machine: DynamicModel, start: Assembly, q: Array, held: Sequence[str], given: Values
) -> Array:
    """Rates of the loose mechanism: those of the ideal one, and those given.

    Links keep turning as they would without clearance while ideal joints can stay closed so.
    """
    plan, loose = machine.plan, machine.mechanism
    _, rates = converted(plan.ideal, loose, start.q, start.v)
    near = dict(zip(loose.coordinates, rates.tolist(), strict=True))
    firm = [j for j in loose.cut if j not in machine.clearances]
    kinematics = Kinematics(loose, closures(loose, firm), held)
    driven = {c: machine.held[c][1] for c in held if c not in plan.assumed[1]}
    driven |= {c: near[c] for c in loose.deformations}
    fixed = {**driven, **given}
    turning = {c: near[c] for c in loose.coordinates if c not in loose.displacements}
    for known in ({**turning, **fixed}, fixed):
        v = nearest_rates(kinematics, q, loose.coordinates, known, near)
        joint, speed = opening(kinematics, q, v)
        if speed <= 1e-9 * float(np.abs(v).max(initial=0.0)) * loose.size:
            return v
    if not given:
        return nearest_rates(kinematics, q, loose.coordinates, {**turning, **fixed}, near)
    said = ', '.join(f'{c} at {rate:g}' for c, rate in given.items())
    raise InputError(
        f'{machine.name}: initial.velocity cannot be: with {said} the joint {joint}, which has no '
        f'clearance, would open at {speed:.4g} m/s; leave one of them out'
    )


def _driven_rates(machine: DynamicModel) -> tuple[Array, Array]:
    """Rates and accelerations (p, 1) of the prescribed coordinates at the start."""
    found = []
    for i in machine.ideal.driven:
        law = machine.plan.laws[machine.ideal.coordinates[i]][0]
        assert isinstance(law, DriveLaw)  # noqa: S101 - it is prescribed
        _, local = law.about(Fraction(0))
        _, rate, half, *_ = *local, 0.0, 0.0
        found.append((rate, 2.0 * half))
    rates = np.array(found).T[:, :, None]
    return rates[0], rates[1]


def _check_inside(machine: DynamicModel, q: Array, seated: bool) -> None:
    for gap, value in zip(machine.system.gaps, machine.observer.gap_values(q), strict=True):
        radial = machine.clearances[gap.joint].radial
        clearance = gap.play if isinstance(gap, AxialStop) else radial
        distance = float(gap.distance(value)[0])
        rounding = 1e-12 * machine.mechanism.size
        if distance < -max(1e-6 * clearance, rounding) and not (seated and gap.law):
            if not isinstance(machine.mechanism.joint(gap.joint), Revolute):
                raise InputError(
                    f'{machine.name}: initial.position puts {gap.joint} {-distance:.6g} m into '
                    'its wall'
                )
            if isinstance(gap, AxialStop):
                raise InputError(
                    f'{machine.name}: at the start the links of {gap.joint} are {-distance:.6g} m '
                    f'into each other at {gap.name}: give more axial play, or another '
                    "'initial.position'"
                )
            if isinstance(gap, BearingEnd):
                raise InputError(
                    f'{machine.name}: initial.position puts the pin of {gap.joint} '
                    f'{-distance:.6g} m into its bushing, at the end {gap.name}'
                )
            raise InputError(
                f'{machine.name}: initial.position puts the pin of {gap.name} '
                f'{clearance - distance:.6g} m from the centre of its bushing; the radial '
                f'clearance is {clearance:g} m'
            )
