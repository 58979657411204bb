"""What follows from the forces of a machine: on its links, on its frame, and its mass centre."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics.symbolic import add, dense
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.loads import moment_of
from mechanism_sim.planar.mechanism import Prismatic
from mechanism_sim.planar.paths import Paths, Poses
from mechanism_sim.planar.points import GROUND, LinkPoint
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.planar.unknowns import Unknowns
from mechanism_sim.planar.virtual_work import located
from mechanism_sim.scene import Machine

Array = NDArray[np.float64]


class Forces:
    """Columns that follow from an observation of a machine with forces.

    Parameters
    ----------
    local : forces along and across each link too
    """

    def __init__(self, machine: Machine, local: bool) -> None:
        self._local = local
        self._mechanism = machine.mechanism
        self._driven = [*machine.plan.prescribed, *machine.plan.powered]
        self._masses = np.array([body.mass for body in self._mechanism.bodies])
        self._on_frame = [
            (i, joint)
            for i, joint in enumerate(self._mechanism.joints)
            if GROUND in (joint.first, joint.second)
        ]
        cogs = [self._mechanism.centre(body.name) for body in self._mechanism.bodies]
        held: list[LinkPoint] = [(joint.second, joint.on_second) for _, joint in self._on_frame]
        self._paths = Paths(self._mechanism, [*cogs, *held])
        self._springs = _OnGround(machine)
        names = [joint.name for joint in self._mechanism.joints]
        self._rubs = {names.index(f.name): f for f in machine.plan.frictions(self._mechanism)}

    def columns(self, t: Array, o: Observation) -> dict[str, Array]:
        """Arrays (N,) by name, see `Cycle`."""
        found: dict[str, Array] = {'drive_power': o.drive_power}
        if len(self._driven) > 1:
            for name, row in zip(self._driven, o.drive_torque, strict=True):
                found[f'drive_torque.{name}'] = row
        for i, joint in enumerate(self._mechanism.joints):
            x, y = o.reaction[i]
            found[f'reaction.{joint.name}.size'] = np.hypot(x, y)
            found[f'reaction.{joint.name}.direction'] = np.arctan2(y, x)
            if isinstance(joint, Prismatic):
                found[f'reaction.{joint.name}.moment'] = o.reaction_moment[i]
        for i, friction in self._rubs.items():
            found[f'friction_loss.{friction.name}'] = friction.loss(
                o.reaction[i], o.reaction_moment[i], o.local, o.velocity
            )
        if self._local:
            found |= self._along_and_across(o)
        paths = self._paths(o.local, o.velocity, o.acceleration)
        cogs, held = paths[: len(self._masses)], paths[len(self._masses) :, 0]
        if self._masses.any():
            centre = np.tensordot(self._masses, cogs, 1) / self._masses.sum()
            for kind, pair in zip(('position', 'velocity', 'acceleration'), centre, strict=True):
                found[f'{kind}.mass_centre.x'], found[f'{kind}.mass_centre.y'] = pair
        return found | self._shaking(t, o, held)

    def _along_and_across(self, o: Observation) -> dict[str, Array]:
        """Force on each moving link in every joint, in the link's frame."""
        along = Poses(self._mechanism, o.local).along
        found = {}
        for joint, force in zip(self._mechanism.joints, o.reaction, strict=True):
            for link, sign in ((joint.first, -1.0), (joint.second, 1.0)):
                if link == GROUND:
                    continue
                (ux, uy), (x, y) = along[link], sign * force
                found[f'reaction.{joint.name}.{link}.along'] = ux * x + uy * y
                found[f'reaction.{joint.name}.{link}.across'] = ux * y - uy * x
        return found

    def _shaking(self, t: Array, o: Observation, held: Array) -> dict[str, Array]:
        """Force and moment about the origin that all links and springs put on the frame.

        The torque of a drive acts between frame and link; the force of one that slides between the
        links of its guide, along it.
        """
        fx, fy, moment = self._springs(t, o)
        thrust: dict[str, Array] = {}
        for name, torque in zip(self._driven, o.drive_torque, strict=True):
            if name in self._mechanism.displacements:
                thrust[self._mechanism.tree_joints[name].name] = torque
            else:
                moment = moment - torque
        for (i, joint), (x, y) in zip(self._on_frame, held, strict=True):
            sign = 1.0 if joint.second == GROUND else -1.0
            px, py = sign * o.reaction[i]
            if isinstance(joint, Prismatic) and joint.name in thrust:
                angle = self._mechanism.frame(joint.first)[1] + joint.axis
                px = px + sign * thrust[joint.name] * np.cos(angle)
                py = py + sign * thrust[joint.name] * np.sin(angle)
            fx, fy = fx + px, fy + py
            moment = moment + x * py - y * px + sign * o.reaction_moment[i]
        return {
            'shaking_force.x': fx,
            'shaking_force.y': fy,
            'shaking_force.size': np.hypot(fx, fy),
            'shaking_moment': moment,
        }


class _OnGround:
    """Force and moment about the origin of all springs and dampers that end at the frame."""

    def __init__(self, machine: Machine) -> None:
        mechanism, parameters = machine.mechanism, Parameters()
        frames = Frames(mechanism.coordinates, parameters)
        unknowns = Unknowns(mechanism, frames, machine.plan.unknowns(mechanism), {}, [])
        acting = [x for e in machine.plan.elements(mechanism) for x in e.loads(frames)]
        loads = [load for load in [*acting, *unknowns.acting] if load.link == GROUND]
        terms = [
            add(*(load.force[0] for load in loads)),
            add(*(load.force[1] for load in loads)),
            add(
                *(load.moment for load in loads),
                *(
                    moment_of((dense(x.value), dense(y.value)), load.force)
                    for load in loads
                    for x, y in [located(load, frames, mechanism)]
                ),
            ),
        ]
        self._coordinates, self._outside = mechanism.coordinates, tuple(frames.outside)
        known = [
            *frames.q.values(), *frames.v.values(), *frames.outside.values(), *unknowns.sizes
        ]  # fmt: skip
        self._function = SwitchedFunction(frames, [terms], known)

    def __call__(self, t: Array, o: Observation) -> Array:
        """Force x, y [N] and moment [N m], (3, N)."""
        turns = dict(zip(self._coordinates, o.turns, strict=True))
        outside = [
            t if name == 'time' else turns[name.removesuffix('.turns')] for name in self._outside
        ]
        (found,) = self._function(
            np.concatenate([o.local, o.velocity, *(x[None] for x in outside), *o.load[:, None]])
        )
        return found
