"""Forces in the joints and torques of the drives, once accelerations are known.

Newton's and Euler's laws link by link, from the outermost link inwards: ``m (p_G'' - g)`` and
``I theta''`` are due to the carrying joint, to everything that hangs on the link, and to loads.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import heyoka as hy

from mechanism_sim.numerics.symbolic import Term, Vector, add, dot, mul, neg
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.mechanism import Prismatic, Weld
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.planar.protocols import Load, Wrench, moment_of, together


def tree_reactions(
    equations: Equations,
    a: Mapping[str, Term] | None,
    cut: Mapping[str, Wrench],
    loads: Sequence[Load] = (),
) -> dict[str, Wrench]:
    """Wrench of the first-named link on the second-named one in every joint.

    Parameters
    ----------
    a : accelerations by coordinate [rad/s^2, m/s^2]; None leaves inertia out
    cut : wrenches in the cut joints; of other joints, those of their stops
    loads : loads on the links
    """
    mechanism = equations.mechanism
    tree = {joint.name for joint in mechanism.tree_joints.values()}
    beside = [joint.name for joint in mechanism.joints if joint.name not in tree]
    found = {name: cut.get(name, Wrench(None, None)) for name in beside}
    loads = [*loads, *(load for w in cut.values() for load in w.others or ())]
    for link, carrier in reversed(mechanism.tree_joints.items()):
        needed = _inertia_force(equations, a, link)
        hanging: list[tuple[str, Vector2, str, Wrench]] = []
        for joint in mechanism.joints:
            if joint.name in found and link in (joint.first, joint.second):
                w, sign = found[joint.name], neg if joint.first == link else _same
                if w.others is not None and joint.first == link:
                    continue
                wrench = Wrench(sign(w.x), sign(w.y), sign(w.moment))
                hanging.append((joint.second, joint.on_second, f'{joint.name}.second', wrench))
        hanging += [
            (link, load.at, load.name, Wrench(*load.force, load.moment))
            for load in loads
            if load.link == link
        ]
        force = (
            add(needed[0], *(neg(w.x) for *_, w in hanging)),
            add(needed[1], *(neg(w.y) for *_, w in hanging)),
        )
        sign = neg if carrier.first == link else _same
        moment: Term = None
        if isinstance(carrier, Prismatic | Weld):
            moment = sign(_moment_missing(equations, a, link, needed, hanging))
        elif carrier.name in cut:  # a pin passes on no other moment than that of its stops
            moment = cut[carrier.name].moment
        found[carrier.name] = Wrench(sign(force[0]), sign(force[1]), moment)
    for joint in mechanism.tree_joints.values():
        if isinstance(joint, Prismatic):
            # wrench of a guide by itself: along its line there is but the force of a drive
            total = found[joint.name]
            frames = equations.frames
            normal = equations.mechanism.direction(joint.first, joint.axis + 0.5 * math.pi)
            x, y = frames.position(normal, f'{joint.name}.normal')
            size = add(mul(total.x, x.value), mul(total.y, y.value))
            across = Wrench(mul(size, x.value), mul(size, y.value), total.moment)
            stopped = cut.get(joint.name)
            found[joint.name] = together(across, stopped) if stopped else across
    return {joint.name: found[joint.name] for joint in mechanism.joints}


def _inertia_force(
    equations: Equations, a: Mapping[str, Term] | None, link: str
) -> tuple[Term, Term]:
    """``m (p_G'' - g)`` of a link, ``-m g`` without inertia [N]."""
    mechanism, body = equations.mechanism, equations.mechanism.body(link)
    mass = equations.parameters(f'links:{link}.mass', body.mass)
    position = equations.frames.position(mechanism.centre(link), f'links:{link}.cog')
    found = []
    for axis, (jet, g) in enumerate(zip(position, mechanism.gravity, strict=True)):
        gravity = equations.parameters(f'gravity:{axis}', g)
        p = neg(gravity)
        if a is not None:
            p = add(*(mul(s, a[n]) for n, s in jet.gradient.items()), jet.curvature, p)
        found.append(mul(mass, p))
    return found[0], found[1]


def _moment_missing(
    equations: Equations,
    a: Mapping[str, Term] | None,
    link: str,
    inertia_force: tuple[Term, Term],
    hanging: Sequence[tuple[str, Vector2, str, Wrench]],
) -> Term:
    """The moment [N m] that a guide or weld supplies about its point on the second-named link."""
    mechanism, frames = equations.mechanism, equations.frames
    carrier, body = mechanism.tree_joints[link], mechanism.body(link)

    def from_joint(other: str, at: Vector2, label: str) -> tuple[Term, Term]:
        x, y = frames.position(mechanism.point(other, at), label)
        return x.value, y.value

    pivot = from_joint(carrier.second, carrier.on_second, f'{carrier.name}.second')

    def arm(other: str, at: Vector2, label: str) -> tuple[Term, Term]:
        if (other, at) == (carrier.second, carrier.on_second):
            return None, None
        x, y = from_joint(other, at, label)
        return add(x, neg(pivot[0])), add(y, neg(pivot[1]))

    frame = mechanism.frame(link)[0]
    spin: Term = None
    if frame != GROUND and a is not None:
        spin = mul(equations.parameters(f'links:{link}.inertia', body.inertia), a[frame])
    supplied = []
    for other, at, label, w in hanging:
        supplied += [w.moment, moment_of(arm(other, at, label), (w.x, w.y))]
    return add(
        spin,
        moment_of(arm(link, body.cog, f'links:{link}.cog'), inertia_force),
        *(neg(x) for x in supplied),
    )


def generalized_forces(equations: Equations, a: Mapping[str, Term] | None) -> Vector:
    """``M a + bias``: required sum of efforts, loads, contacts and closures [N m, N].

    Without inertia (`a` is None) that is minus the generalised force of gravity.
    """
    if a is None:
        return equations.weight
    acceleration = [a[c] for c in equations.coordinates]
    return [
        add(dot(row, acceleration), bias)
        for row, bias in zip(equations.M, equations.bias, strict=True)
    ]


def energies(equations: Equations) -> tuple[Term, Term]:
    """Kinetic and potential energy [J]."""
    v: list[Term] = [equations.frames.v[c] for c in equations.coordinates]
    kinetic = dot(v, [dot(row, v) for row in equations.M])
    potential: list[Term] = [equations.strain_energy]
    for body in equations.mechanism.bodies:
        point = equations.mechanism.centre(body.name)
        position = equations.frames.position(point, f'links:{body.name}.cog')
        mass = equations.parameters(f'links:{body.name}.mass', body.mass)
        for axis, (jet, g) in enumerate(zip(position, equations.mechanism.gravity, strict=True)):
            gravity = equations.parameters(f'gravity:{axis}', g)
            potential.append(neg(mul(mul(mass, gravity), jet.value)))
        rises = equations.mechanism.rise(body.name, body.cog)
        for way in (equations.frames.q[c] for c, slope in rises.items() if slope):
            gravity = equations.parameters('gravity:2', equations.mechanism.axial_gravity)
            potential.append(neg(mul(mul(mass, gravity), way)))
    return mul(hy.expression(0.5), kinetic), add(*potential)


def _same(term: Term) -> Term:
    return term
