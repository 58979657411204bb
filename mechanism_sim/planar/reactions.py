"""Forces in the joints and torques of the drives, once accelerations are known.

Newton's law link by link, from the outermost link inwards: ``m (p_G'' - g)`` is the force of the
carrying joint and of everything that hangs on the link.
"""

from __future__ import annotations

from collections.abc import Mapping

import heyoka as hy

from mechanism_sim.numerics.symbolic import Term, Vector, add, dot, mul, neg
from mechanism_sim.planar.equations import Equations

Force = tuple[Term, Term]


def tree_reactions(
    equations: Equations, a: Mapping[str, Term], cut_forces: Mapping[str, Force]
) -> dict[str, Force]:
    """Force of the first-named on the second-named link in every joint [N].

    Parameters
    ----------
    a : accelerations by coordinate [rad/s^2]
    cut_forces : the same force in the joints that are cut [N]
    """
    mechanism = equations.mechanism
    forces = dict(cut_forces)
    for name, carrier in reversed(mechanism.tree_joints.items()):
        body = mechanism.body(name)
        mass = equations.parameters(f'{body.name}.mass', body.mass)
        point = mechanism.point(body.name, body.cog)
        position = equations.frames.position(point, f'{body.name}.cog')
        needed: list[Term] = []
        for axis, (jet, g) in enumerate(zip(position, mechanism.gravity, strict=True)):
            gravity = equations.parameters(f'gravity.{axis}', g)
            p = add(*(mul(s, a[n]) for n, s in jet.gradient.items()), jet.curvature, neg(gravity))
            needed.append(mul(mass, p))
        for joint in mechanism.joints:
            if joint.name in forces and body.name in (joint.first, joint.second):
                sign = neg if joint.second == body.name else _same
                needed = [add(n, sign(f)) for n, f in zip(needed, forces[joint.name], strict=True)]
        if carrier.second != body.name:
            needed = [neg(n) for n in needed]
        forces[carrier.name] = (needed[0], needed[1])
    return {joint.name: forces[joint.name] for joint in mechanism.joints}


def generalized_forces(equations: Equations, a: Mapping[str, Term]) -> Vector:
    """``M a + bias``: what drives, gaps and relations must supply, by coordinate [N m]."""
    acceleration = [a[c] for c in equations.coordinates]
    return [
        add(dot(row, acceleration), bias)
        for row, bias in zip(equations.M, equations.bias, strict=True)
    ]


def energies(equations: Equations) -> tuple[Term, Term]:
    """Kinetic and potential energy [J]."""
    v: list[Term] = [equations.frames.v[c] for c in equations.coordinates]
    kinetic = dot(v, [dot(row, v) for row in equations.M])
    potential: list[Term] = []
    for body in equations.mechanism.bodies:
        point = equations.mechanism.point(body.name, body.cog)
        position = equations.frames.position(point, f'{body.name}.cog')
        mass = equations.parameters(f'{body.name}.mass', body.mass)
        for axis, (jet, g) in enumerate(zip(position, equations.mechanism.gravity, strict=True)):
            gravity = equations.parameters(f'gravity.{axis}', g)
            potential.append(neg(mul(mul(mass, gravity), jet.value)))
    return mul(hy.expression(0.5), kinetic), add(*potential)


def _same(term: Term) -> Term:
    return term
