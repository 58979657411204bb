"""Where the pins of a loose machine rest at the start: where the ideal machine's forces press."""

from __future__ import annotations

import numpy as np

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.observer import Instants
from mechanism_sim.hybrid.system import Array
from mechanism_sim.linkages.bearing_ends import seat
from mechanism_sim.planar.mechanism import Revolute
from mechanism_sim.planar.points import rotate
from mechanism_sim.scene.clearances import leaning
from mechanism_sim.scene.dynamic_model import DynamicModel


def seats(machine: DynamicModel, q: Array, v: Array, a: Array) -> dict[str, Array]:
    """Where the pins rest (2,) [m], from the centres of their bushings, by joint.

    Of a pair that can only lift off, how deep its compliant contact is (1,) [m], negative.

    Parameters
    ----------
    q, v, a : (n, 1) of the ideal mechanism
    """
    found: dict[str, Array] = {}
    pressed = [
        name
        for name, c in machine.clearances.items()
        if not c.film
        if isinstance(machine.mechanism.joint(name), Revolute) or not c.radial
    ]
    if not pressed:
        return found  # pins start in the middle of their slots
    names = [j.name for j in machine.mechanism.joints]
    try:
        forces = dict(zip(names, joint_forces(machine, q, v, a), strict=True))
    except ZeroDivisionError:  # no equation for some of them
        forces = dict.fromkeys(names, np.full(2, np.nan))
    for name in pressed:
        clearance = machine.clearances[name]
        pin = isinstance(machine.mechanism.joint(name), Revolute)
        force = forces[name]
        if not np.isfinite(force).all():
            if machine.placed_outright:
                continue  # at the centre, if it is not said otherwise
            raise InputError(
                f'{machine.name}: start = seated, but without clearance the force in {name} is '
                "not determined; write 'start: centred'"
            )
        if pin and not force.any():
            raise InputError(
                f'{machine.name}: start = seated, but no force presses the pin of {name} on its '
                "bushing; write 'start: centred'"
            )
        size = float(np.hypot(*force))
        contact = clearance.contact
        soft = contact.stiffness if contact and not machine.placed_outright else None
        leans = leaning(machine.mechanism, name, clearance)
        alone = leans and any((*leans.pin, *leans.bushing))  # one end of two takes it all
        soft = 0.5 * soft if soft and alone else soft
        depth = (size / soft) ** (1.0 / contact.exponent) if contact and soft else 0.0
        if pin:
            found[name] = (clearance.radial + depth) * force / size
        else:  # what can only lift off
            found[name] = np.array([-depth])
    return found


def leaning_seats(machine: DynamicModel, found: dict[str, Array], q: Array) -> dict[str, Array]:
    """The same where pin and bushing are out of line, at coordinates (n,) of the loose machine."""
    mechanism = machine.mechanism
    place = dict(zip(mechanism.coordinates, q.tolist(), strict=True))
    seated = {}
    for name, centred in found.items():
        if leans := leaning(mechanism, name, machine.clearances[name]):
            joint, axes = mechanism.joint(name), (leans.pin, leans.bushing)
            angles = (mechanism.angle(link, place) for link in (joint.first, joint.second))
            first, second = (np.array(rotate(x, a)) for x, a in zip(axes, angles, strict=True))
            off = 0.5 * leans.length * (first - second)
            room = float(np.hypot(*centred))
            seated[name] = seat(room, centred / room, off) if off.any() else centred
    return seated


def joint_forces(machine: DynamicModel, q: Array, v: Array, a: Array) -> Array:
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
        dynamics = machine.inverse_dynamics
        outside = machine.outside_at_start(dynamics.outside)
        return dynamics(q, v, a, outside).reaction[:, :, 0]
    observer = machine.ideal_observer
    none, modes = np.zeros((len(machine.plan.prescribed), 1)), np.zeros((0, 1), np.uint8)
    outside = machine.outside_at_start(observer.system.outside)
    torques = machine.torques(q, v)
    seen = observer.observe(Instants(q, v, none, modes, torques, outside=outside))
    return seen.reaction[:, :, 0]
