"""Equations of motion of a tree of links, with the Jacobians of its relations and gaps.

``M(q) a + bias(q, v) = J_gaps^T N + J_relations^T lambda + torques``

Every position is a sum of vectors that turn with one angle each, some of them as long as a
displacement: ``p = sum_k s_k R(theta_k) d_k`` with ``s_k = 1`` for arms of fixed length. So

``p'' = sum_k R (E d s theta'' - d s theta'^2 + d s'' + 2 E d s' theta')`` (E turns by 90 degrees)

and d'Alembert's principle gives M and bias with the constants ``sum_b m_b d_bk . d_bl`` collected
beforehand.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from mechanism_sim.numerics.symbolic import Term, add, mul
from mechanism_sim.planar.frames import Frames, Parameters, rotate_quarter
from mechanism_sim.planar.mechanism import GROUND, Mechanism, Vector2
from mechanism_sim.planar.protocols import Gap, Relation


class Equations:
    """The symbols of a mechanism and the terms of its equations of motion.

    Attributes
    ----------
    M : (n, n) mass matrix, [kg m^2] for angles
    weight : (n,) minus the generalised forces of gravity, [N m] for angles
    bias : (n,) velocity products and weight, on the left-hand side, likewise
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
        self.weight = [self._weight(f) for f in self.coordinates]
        self.bias = [
            add(self._velocity_product(f), weight)
            for f, weight in zip(self.coordinates, self.weight, strict=True)
        ]
        self.gap_jets = [gap.value(self.frames) for gap in self.gaps]
        self.relation_jets = [v for r in self.relations for v in r.values(self.frames)]

    def _tangents(self, body: str, c: str) -> list[_Vector]:
        """How the centre of gravity of a body moves with a coordinate."""
        found = []
        for (frame, slide), d in self._arms[body].items():
            if slide == c:
                found.append(_Vector(frame, None, d))
            elif frame == c:
                found.append(_Vector(frame, slide, rotate_quarter(d)))
        return found

    def _accelerated(self, body: str) -> list[tuple[_Vector, tuple[str, str]]]:
        """Its acceleration at constant rates: vectors, each with two rates that multiply it."""
        found = []
        for (frame, slide), (x, y) in self._arms[body].items():
            if frame != GROUND:
                found.append((_Vector(frame, slide, (-x, -y)), (frame, frame)))
                if slide is not None:
                    found.append((_Vector(frame, None, (-2.0 * y, 2.0 * x)), (slide, frame)))
        return found

    def _products(self, name: str, pairs: Iterable[tuple[float, _Vector, _Vector]]) -> Term:
        """``sum m a . b``, with the constants of equal frames and displacements collected."""
        sums: dict[tuple[str, str, tuple[str, ...]], tuple[float, float]] = {}
        for mass, a, b in pairs:
            slides = tuple(sorted(x.slide for x in (a, b) if x.slide))
            key = (a.frame, b.frame, slides)
            inner, outer = sums.get(key, (0.0, 0.0))
            inner += mass * (a.d[0] * b.d[0] + a.d[1] * b.d[1])
            outer += mass * (a.d[0] * b.d[1] - a.d[1] * b.d[0])
            sums[key] = inner, outer
        p, found = self.parameters, []
        for k, ((f, g, slides), (inner, outer)) in enumerate(sums.items()):
            label = name if k == 0 else f'{name}.{k}'
            term = self.frames.product(f, g, p(label, inner), p(label + '.cross', outer))
            for slide in slides:
                term = mul(term, self.frames.q[slide])
            found.append(term)
        return add(*found)

    def _inertia(self, f: str, g: str) -> Term:
        if self.coordinates.index(f) > self.coordinates.index(g):
            f, g = g, f
        pairs = []
        for body in self.mechanism.bodies:
            pairs += [
                (body.mass, a, b)
                for a in self._tangents(body.name, f)
                for b in self._tangents(body.name, g)
            ]
            if f == g == self.mechanism.frame(body.name)[0]:
                # about the centre of gravity, as if of a mass at the radius of gyration
                unit = _Vector(f, None, (1.0, 0.0))
                pairs.append((body.inertia, unit, unit))
        return self._products(f'inertia.{f}.{g}', pairs)

    def _velocity_product(self, f: str) -> Term:
        """``sum_b m_b t_bf . p''`` at constant rates: centripetal and Coriolis terms of row f."""
        pairs: dict[tuple[str, str], list[tuple[float, _Vector, _Vector]]] = {}
        for body in self.mechanism.bodies:
            for tangent in self._tangents(body.name, f):
                for vector, rates in self._accelerated(body.name):
                    if rates != (f, f):  # arms that turn together: nothing along the tangent
                        pairs.setdefault(rates, []).append((body.mass, tangent, vector))
        order = {c: i for i, c in enumerate(self.coordinates)}
        rows = []
        for (a, b), products in sorted(pairs.items(), key=lambda x: [order[c] for c in x[0]]):
            name = f'centripetal.{f}.{b}' if a == b else f'coriolis.{f}.{a}.{b}'
            term = self._products(name, products)
            rows.append(mul(mul(term, self.frames.v[a]), self.frames.v[b]))
        return add(*rows)

    def _weight(self, f: str) -> Term:
        """Minus the generalised force of gravity on coordinate f."""
        gravity = _Vector(GROUND, None, self.mechanism.gravity)
        return self._products(
            f'weight.{f}',
            (
                (-body.mass, gravity, tangent)
                for body in self.mechanism.bodies
                for tangent in self._tangents(body.name, f)
            ),
        )


class _Vector(NamedTuple):
    """``s R(theta) d``."""

    frame: str
    slide: str | None
    d: Vector2
