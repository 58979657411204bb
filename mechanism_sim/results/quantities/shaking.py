"""Forces and moments of a machine on its frame."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.symbolic import add, dense
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.mechanism import Prismatic
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.protocols import moment_of
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.planar.unknowns import Unknowns
from mechanism_sim.planar.virtual_work import located
from mechanism_sim.results.quantities.motion import tracks
from mechanism_sim.results.quantity import Quantity, Shown, View, vector
from mechanism_sim.scene import Machine


def of_frame(machine: Machine) -> Iterator[Quantity]:
    """``shaking_force.x``, ``.y``, ``.size``, ``.direction``; ``shaking_moment`` at the origin."""
    if not machine.physics.has_forces:
        return
    shaking = _Shaking(machine)

    def rows(view: View) -> Array:
        return view.once('shaking', lambda: shaking(view))

    words = 'shaking force on the frame'
    yield from vector('shaking_force', 'N', words, '', rows, Shown.CYCLE)
    yield Quantity(
        'shaking_force.size', 'N', words, '', lambda view: np.hypot(*rows(view)[:2]),
        Shown.CYCLE, 'size',
    )  # fmt: skip
    yield Quantity(
        'shaking_force.direction', 'rad', f'direction of the {words}', '',
        lambda view: np.arctan2(*rows(view)[1::-1]), Shown.ASKED, 'direction',
    )  # fmt: skip
    yield Quantity(
        'shaking_moment', 'N m', 'shaking moment on the frame about the origin', '',
        lambda view: rows(view)[2], Shown.CYCLE,
    )  # fmt: skip


class _Shaking:
    """Force and moment about the origin that all links and springs put on the frame.

    The torque of a drive acts between frame and link; the force of one that slides between the
    links of its guide, along it.
    """

    def __init__(self, machine: Machine) -> None:
        self._mechanism = mechanism = machine.mechanism
        self._driven = machine.physics.driven
        self._on_frame = [
            (i, joint)
            for i, joint in enumerate(mechanism.joints)
            if GROUND in (joint.first, joint.second)
        ]
        self._held = tracks(
            mechanism, [(joint.second, joint.on_second) for _, joint in self._on_frame]
        )
        self._machine = machine
        self._springs: _OnGround | None = None

    def __call__(self, view: View) -> Array:
        """Force x, y [N] and moment [N m], (3, N)."""
        o = view.observed
        self._springs = self._springs or _OnGround(self._machine)
        fx, fy, moment = self._springs(view)
        thrust: dict[str, Array] = {}
        for name, torque in zip(self._driven, o.drive_torque, strict=True):
            if name in self._mechanism.displacements:
                thrust[self._mechanism.tree_joints[name].name] = torque
            else:
                moment = moment - torque
        for (i, joint), (x, y) in zip(self._on_frame, self._held(view)[:, 0], strict=True):
            sign = 1.0 if joint.second == GROUND else -1.0
            px, py = sign * o.reaction[i]
            if isinstance(joint, Prismatic) and joint.name in thrust:
                angle = self._mechanism.frame(joint.first)[1] + joint.axis
                px = px + sign * thrust[joint.name] * np.cos(angle)
                py = py + sign * thrust[joint.name] * np.sin(angle)
            fx, fy = fx + px, fy + py
            moment = moment + x * py - y * px + sign * o.reaction_moment[i]
        return np.array([fx, fy, moment])


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
        self._outside = tuple(frames.outside)
        known = [
            *frames.q.values(), *frames.v.values(), *frames.outside.values(), *unknowns.sizes
        ]  # fmt: skip
        self._function = SwitchedFunction(frames, [terms], known)

    def __call__(self, view: View) -> Array:
        """Force x, y [N] and moment [N m], (3, N)."""
        o = view.observed
        outside = view.outside(self._outside)
        (found,) = self._function(np.concatenate([o.local, o.velocity, outside, *o.load[:, None]]))
        return found
