"""Equations of motion of a tree of links, with the Jacobians of its relations and gaps.

``M(q) a + bias(q, v) = J_gaps^T N + J_relations^T lambda + torques``

Every position is a sum of vectors that turn with one link each, ``p = sum_f R(theta_f) d_f``, so
``p'' = sum_f (R'(theta_f) d_f a_f - R(theta_f) d_f v_f^2)`` and d'Alembert's principle gives M and
bias with the constants ``sum_b m_b d_bf . d_bg`` collected beforehand.
"""

from __future__ import annotations

from collections.abc import Sequence

import heyoka as hy

from mechanism_sim.numerics.symbolic import add
from mechanism_sim.planar.frames import Frames, Parameters, rotate_quarter
from mechanism_sim.planar.mechanism import GROUND, Mechanism, Vector2
from mechanism_sim.planar.protocols import Gap, Relation


class Equations:
    """The symbols of a mechanism and the terms of its equations of motion.

    Attributes
    ----------
    M : (n, n) mass matrix [kg m^2]
    bias : (n,) velocity products and gravity [N m], on the left-hand side
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
        self.frames = Frames(self.coordinates, self.parameters)
        self._arms = {b.name: mechanism.point(b.name, b.cog) for b in mechanism.bodies}
        self.M = [[self._inertia(f, g) for g in self.coordinates] for f in self.coordinates]
        self.bias = [add(self._velocity_product(f), self._weight(f)) for f in self.coordinates]
        self.gap_jets = [gap.value(self.frames) for gap in self.gaps]
        self.relation_jets = [v for r in self.relations for v in r.values(self.frames)]

    def _sum_of_products(self, f: str, g: str, turn: bool) -> tuple[float, float]:
        """``sum_b m_b d_bf . d_bg`` and the cross product, d_bf turned by 90 degrees if asked."""
        inner = outer = 0.0
        for body in self.mechanism.bodies:
            arm = self._arms[body.name]
            if f in arm and g in arm:
                a: Vector2 = rotate_quarter(arm[f]) if turn else arm[f]
                b = arm[g]
                inner += body.mass * (a[0] * b[0] + a[1] * b[1])
                outer += body.mass * (a[0] * b[1] - a[1] * b[0])
        return inner, outer

    def _inertia(self, f: str, g: str) -> hy.expression | None:
        if self.coordinates.index(f) > self.coordinates.index(g):
            f, g = g, f
        inner, outer = self._sum_of_products(f, g, turn=False)
        if f == g:
            inner += next(b.inertia for b in self.mechanism.bodies if b.name == f)
        name = f'inertia.{f}.{g}'
        p = self.parameters
        return self.frames.product(f, g, p(name, inner), p(name + '.cross', outer))

    def _velocity_product(self, f: str) -> hy.expression | None:
        """``-sum_g v_g^2 sum_b m_b (R' d_bf) . (R d_bg)``, the centripetal terms of row f."""
        terms = []
        for g in self.coordinates:
            if g == f:
                continue
            inner, outer = self._sum_of_products(f, g, turn=True)
            name = f'centripetal.{f}.{g}'
            p = self.parameters
            arm = self.frames.product(f, g, p(name, inner), p(name + '.cross', outer))
            square = self.frames.v[g] * self.frames.v[g]
            terms.append(None if arm is None else -(arm * square))
        return add(*terms)

    def _weight(self, f: str) -> hy.expression | None:
        """Minus the moment of gravity on coordinate f."""
        gx, gy = self.mechanism.gravity
        mx = my = 0.0
        for body in self.mechanism.bodies:
            x, y = rotate_quarter(self._arms[body.name].get(f, (0.0, 0.0)))
            mx += body.mass * x
            my += body.mass * y
        inner, outer = -(gx * mx + gy * my), -(gx * my - gy * mx)
        p = self.parameters
        return self.frames.product(
            GROUND, f, p(f'weight.{f}', inner), p(f'weight.{f}.cross', outer)
        )
