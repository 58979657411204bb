"""Equations of motion of a tree of links, with the Jacobians of its relations and gaps.

``M(q) a + bias(q, v) = J_gaps^T N + J_relations^T lambda + torques``

Every position is a sum of vectors that turn with one link each, ``p = sum_f R(theta_f) d_f``, so
``p'' = sum_f (R'(theta_f) d_f a_f - R(theta_f) d_f v_f^2)`` and d'Alembert's principle gives M and
bias with the constants ``sum_b m_b d_bf . d_bg`` collected beforehand. The displacement s of a
floating link adds s d to a position, and d s'' to its acceleration.
"""

from __future__ import annotations

from collections.abc import Sequence

from mechanism_sim.numerics.symbolic import Term, add, mul, neg
from mechanism_sim.planar.frames import Frames, Parameters, rotate_quarter
from mechanism_sim.planar.mechanism import GROUND, Mechanism, Vector2
from mechanism_sim.planar.protocols import Gap, Relation


class Equations:
    """The symbols of a mechanism and the terms of its equations of motion.

    Attributes
    ----------
    M : (n, n) mass matrix, [kg m^2] for angles
    bias : (n,) velocity products and gravity, on the left-hand side, [N m] for angles
    gap_jets : (m,) gaps with their derivatives [m]
    relation_jets : every component of every relation, likewise
    """

    def __init__(
        self,
        mechanism: Mechanism,
        gaps: Sequence[Gap] = (),
        relations: Sequence[Relation] = (),
    ) -> None:
        self.mechanism = mechanism
        self.gaps = tuple(gaps)
        self.relations = tuple(relations)
        self.parameters = Parameters()
        self.coordinates = mechanism.coordinates
        self.frames = Frames(self.coordinates, self.parameters, mechanism.displacements)
        self._arms = {b.name: mechanism.point(b.name, b.cog) for b in mechanism.bodies}
        self.M = [[self._inertia(f, g) for g in self.coordinates] for f in self.coordinates]
        self.bias = [add(self._velocity_product(f), self._weight(f)) for f in self.coordinates]
        self.gap_jets = [gap.value(self.frames) for gap in self.gaps]
        self.relation_jets = [v for r in self.relations for v in r.values(self.frames)]

    def _tangent(self, body: str, c: str) -> tuple[str, Vector2] | None:
        """How the centre of gravity of a body moves with a coordinate: frame, vector in it."""
        arm = self._arms[body].get(c)
        if arm is None:
            return None
        return (GROUND, arm) if c in self.mechanism.displacements else (c, rotate_quarter(arm))

    def _product(
        self, name: str, f: str, g: str, terms: Sequence[tuple[float, Vector2, Vector2]]
    ) -> Term:
        """``sum_b m_b a_b . c_b`` of vectors a in frame f and c in frame g."""
        inner = outer = 0.0
        for mass, a, c in terms:
            inner += mass * (a[0] * c[0] + a[1] * c[1])
            outer += mass * (a[0] * c[1] - a[1] * c[0])
        p = self.parameters
        return self.frames.product(f, g, p(name, inner), p(name + '.cross', outer))

    def _inertia(self, f: str, g: str) -> Term:
        if self.coordinates.index(f) > self.coordinates.index(g):
            f, g = g, f
        terms = []
        frames = (f, g)
        for body in self.mechanism.bodies:
            tangents = self._tangent(body.name, f), self._tangent(body.name, g)
            if tangents[0] and tangents[1]:
                frames = (tangents[0][0], tangents[1][0])
                terms.append((body.mass, tangents[0][1], tangents[1][1]))
            if f == g == body.name:
                # about the centre of gravity, as if of a mass at the radius of gyration
                terms.append((body.inertia, (1.0, 0.0), (1.0, 0.0)))
        return self._product(f'inertia.{f}.{g}', *frames, terms)

    def _velocity_product(self, f: str) -> Term:
        """``sum_g v_g^2 sum_b m_b t_bf . (-R d_bg)``, the centripetal terms of row f."""
        rows = []
        for g in self.coordinates:
            if g == f or g in self.mechanism.displacements:
                continue
            terms = []
            frame = f
            for body in self.mechanism.bodies:
                tangent, arm = self._tangent(body.name, f), self._arms[body.name].get(g)
                if tangent and arm:
                    frame = tangent[0]
                    terms.append((body.mass, tangent[1], arm))
            arm_length = self._product(f'centripetal.{f}.{g}', frame, g, terms)
            rate = self.frames.v[g]
            rows.append(neg(mul(mul(arm_length, rate), rate)))
        return add(*rows)

    def _weight(self, f: str) -> Term:
        """Minus the generalised force of gravity on coordinate f."""
        terms = []
        frame = f
        for body in self.mechanism.bodies:
            tangent = self._tangent(body.name, f)
            if tangent:
                frame = tangent[0]
                terms.append((-body.mass, self.mechanism.gravity, tangent[1]))
        return self._product(f'weight.{f}', GROUND, frame, terms)
