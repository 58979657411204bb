"""Where a machine starts: its pins at the centre of their bushings, or pressed against them."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.snapshot import State
from mechanism_sim.hybrid.system import Array
from mechanism_sim.linkages.bearing import BearingClearance
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.mechanism import Mechanism, Prismatic, Revolute
from mechanism_sim.planar.protocols import Gap
from mechanism_sim.scene.assembly import closed_near, nearest_rates
from mechanism_sim.scene.four_bar_start import four_bar
from mechanism_sim.scene.seats import seats

if TYPE_CHECKING:
    from mechanism_sim.scene.machine import Machine


def initial_state(machine: Machine) -> State:
    """Where the equations of motion start.

    ``centred``: the nominal mechanism, pins at the centre, in flight. ``seated``: each pin rests
    on its bushing in the direction of the nominal force of the first-named on the second-named
    link; nominal rates. Coordinates given in `initial` replace those.

    Raises
    ------
    InputError
        If it cannot be assembled, or given coordinates put a pin outside of its bushing.
    """
    q, v = four_bar(machine) if machine.plan.four_bar else _linkage(machine)
    system, given = machine.system, machine.plan.given
    seated = machine.scene.start == 'seated' and not (given[0].keys() | given[1]) - {machine.main}
    values = np.array([[q[c]] for c in system.coordinates])
    _check_inside(machine, values, seated)
    return State(
        Fraction(0),
        (0,) * len(system.free),
        tuple(q[c] for c in system.free),
        tuple(v[c] for c in system.free),
        tuple(seated and _starts_closed(machine, gap) for gap in system.gaps),
    )


def _starts_closed(machine: Machine, gap: Gap) -> bool:
    """Pins are on their bushings, and what can only lift off is in contact."""
    return machine.clearances[gap.joint].radial == 0.0 or isinstance(gap, BearingClearance)


Values = dict[str, float]


def _linkage(machine: Machine) -> tuple[Values, Values]:
    """Values and rates of the coordinates of any linkage."""
    plan, start = machine.plan, machine.assembly
    if not machine.clearances:
        names = plan.ideal.coordinates
        return dict(zip(names, start.q.tolist(), strict=True)), dict(
            zip(names, start.v.tolist(), strict=True)
        )
    loose = machine.mechanism
    q = _converted(plan.ideal, loose, start.q)
    held = [c for c in loose.coordinates if c in plan.begins or c in plan.prescribed]
    kinematics = Kinematics(loose, closures(loose, loose.cut), held)
    targets = np.zeros(len(kinematics.rows))
    if machine.scene.start == 'seated' and machine.system.gaps:
        columns = [x[:, None] for x in (start.q, start.v)]
        a = np.zeros_like(columns[0])
        if not machine.torque_driven:
            _, _, a, _ = machine.ideal.motion(columns[0], *_driven_rates(machine))
        for name, Q in seats(machine, columns[0], columns[1], a).items():
            targets[[i for i, row in enumerate(kinematics.rows) if row == name]] = Q
    placed = closed_near(machine.name, kinematics, q, targets)
    known = dict(zip(plan.ideal.coordinates, start.v.tolist(), strict=True))
    turning = [c for c in loose.coordinates if c not in loose.displacements]
    given = {c: known.get(plan.ideal.frame(c)[0], 0.0) for c in turning}
    given |= {c: known[c] for c in held}
    alike = {
        c: known[c]
        for c in loose.sliding
        if c in plan.ideal.sliding and loose.tree_joints[c] == plan.ideal.tree_joints[c]
    }
    rates = nearest_rates(kinematics, placed, loose.coordinates, given, alike)
    names = loose.coordinates
    return dict(zip(names, placed.tolist(), strict=True)), dict(
        zip(names, rates.tolist(), strict=True)
    )


def _driven_rates(machine: Machine) -> tuple[Array, Array]:
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


def _converted(ideal: Mechanism, loose: Mechanism, q: Array) -> Array:
    """The coordinates of the loose mechanism from those of the ideal one."""
    known = dict(zip(ideal.coordinates, q.tolist(), strict=True))
    found = []
    for name in loose.coordinates:
        link, _, axis = name.partition('.')
        if axis:
            place = ideal.locate(link, known, loose.body(link).cog)
            found.append(place['xy'.index(axis)])
        elif name in loose.displacements:
            j = loose.tree_joints[link]
            assert isinstance(j, Prismatic)  # noqa: S101 - it carries a displacement
            a, b = (
                ideal.locate(j.first, known, j.on_first),
                ideal.locate(j.second, known, j.on_second),
            )
            way = ideal.angle(j.first, known) + j.axis
            found.append((b[0] - a[0]) * np.cos(way) + (b[1] - a[1]) * np.sin(way))
        else:
            found.append(ideal.angle(link, known))
    return np.array(found)


def _check_inside(machine: Machine, q: Array, seated: bool) -> None:
    for gap, value in zip(machine.system.gaps, machine.system.gap_values(q), strict=True):
        clearance = machine.clearances[gap.joint].radial
        distance = float(gap.distance(value)[0])
        rounding = 1e-12 * machine.mechanism.size
        if distance < -max(1e-6 * clearance, rounding) and not (seated and gap.law):
            if not isinstance(machine.mechanism.joint(gap.joint), Revolute):
                raise InputError(
                    f'{machine.name}: initial.position puts {gap.joint} {-distance:.6g} m into '
                    'its wall'
                )
            raise InputError(
                f'{machine.name}: initial.position puts the pin of {gap.name} '
                f'{clearance - distance:.6g} m from the centre of its bushing; the radial '
                f'clearance is {clearance:g} m'
            )
