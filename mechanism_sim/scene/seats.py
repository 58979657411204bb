"""Where the pins of a loose machine rest at the start: where the ideal machine's forces press."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.system import Array
from mechanism_sim.planar.mechanism import Revolute

if TYPE_CHECKING:
    from mechanism_sim.scene.machine import Machine


def seats(machine: Machine, q: Array, v: Array, a: Array) -> dict[str, Array]:
    """Where the pins rest (2,) [m], from the centres of their bushings, by joint.

    Of a pair that can only lift off, how deep its compliant contact is (1,) [m], negative.

    Parameters
    ----------
    q, v, a : (n, 1) of the ideal mechanism

    Raises
    ------
    InputError
        If no force presses a pin anywhere.
    """
    forces = dict(
        zip(
            [j.name for j in machine.mechanism.joints], joint_forces(machine, q, v, a), strict=True
        )
    )
    found = {}
    for name, clearance in machine.clearances.items():
        pin = isinstance(machine.mechanism.joint(name), Revolute)
        if not pin and clearance.radial:
            continue  # pins start in the middle of their slots
        force = forces[name]
        if pin and not force.any():
            raise InputError(
                f'{machine.name}: start = seated, but no force presses the pin of {name} on its '
                "bushing; write 'start: centred'"
            )
        size = float(np.hypot(*force))
        contact = clearance.contact
        soft = contact.stiffness if contact else None
        depth = (size / soft) ** (1.0 / contact.exponent) if contact and soft else 0.0
        if pin:
            found[name] = (clearance.radial + depth) * force / size
        else:  # what can only lift off
            found[name] = np.array([-depth])
    return found


def joint_forces(machine: Machine, q: Array, v: Array, a: Array) -> Array:
    """Forces in the joints of the ideal mechanism (j, 2) [N], first-named on second-named link.

    `a` counts only where the drives are prescribed; a torque sets its own acceleration.
    """
    if not machine.torque_driven:
        if machine.starts_singular:
            raise InputError(
                f'{machine.name}: start = seated, but the forces that press pins on bushings are '
                'not determined: the start is a singular position, such as a dead point; write '
                "'start: centred', or start beside it"
            )
        return machine.inverse_dynamics(q, v, a).reaction[:, :, 0]
    system = machine.ideal_system
    rows = []
    for c in machine.plan.powered:
        i = system.coordinates.index(c)
        law = machine.plan.laws[c][0]
        constant, per_angle, per_speed = law.coefficients
        rows.append(constant + per_angle * q[i] + per_speed * v[i])
    none, modes = np.zeros((len(machine.plan.prescribed), 1)), np.zeros((0, 1), np.uint8)
    seen = system.observe(q, v, none, modes, np.reshape(rows, (-1, 1)))
    return seen.reaction[:, :, 0]
