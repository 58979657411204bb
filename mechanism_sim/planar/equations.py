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
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.numerics.symbolic import Term, add, mul
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, Spread, factors
from mechanism_sim.planar.protocols import Gap, Relation, Wrench
from mechanism_sim.tolerances import TOLERANCES

_ROUNDING = TOLERANCES.rounding


class Equations:
    """The symbols of a mechanism and the terms of its equations of motion.

    Attributes
    ----------
    M : (n, n) mass matrix, [kg m^2] for angles
    weight : (n,) minus the generalised forces of gravity and elasticity, [N m] for angles
    bias : (n,) velocity products, weight and damping in links on the left-hand side [N m, N]
    strain_energy, strain_loss : of elastic links and shafts [J], [W]
    gap_jets : (m,) gaps with their derivatives [m]
    relation_jets : every component of every relation with its derivatives [m]
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
        self._spread = {b.name: mechanism.spread(b.name) for b in mechanism.bodies}
        self._extensions = _Extensions(mechanism, self.frames)
        self.M = [[self._inertia(f, g) for g in self.coordinates] for f in self.coordinates]
        self.weight = [self._weight(f) for f in self.coordinates]
        self.bias = [
            add(self._velocity_product(f), weight, self._extensions.damping(f))
            for f, weight in zip(self.coordinates, self.weight, strict=True)
        ]
        self.strain_energy, self.strain_loss = self._extensions.energy, self._extensions.loss
        self.gap_jets = [gap.value(self.frames) for gap in self.gaps]
        self.relation_jets = [v for r in self.relations for v in r.values(self.frames)]

    @property
    def rows(self) -> list[Term]:
        """The Jacobian of all relations, row by row (r n,)."""
        return [x for jet in self.relation_jets for x in jet.row(self.coordinates)]

    def transmitted(self) -> tuple[list[hy.expression], dict[str, Wrench]]:
        """Symbols of the forces along these rows, and the wrenches of the joints by them."""
        forces: list[hy.expression] = []
        wrenches = {}
        for k, relation in enumerate(self.relations):
            count = len(relation.values(self.frames))
            own = [hy.make_vars(f'force{k}_{i}') for i in range(count)]
            wrenches[relation.name] = relation.wrench(self.frames, own)
            forces += own
        return forces, wrenches

    @staticmethod
    def _tangents(point: Spread, c: str) -> list[_Vector]:
        """Derivative of a point's position with respect to a coordinate."""
        found = []
        for (frame, slide), (x, y) in point.items():
            scale = factors(slide)
            if c in scale:
                k, n = scale.index(c), scale.count(c)
                found.append(_Vector(frame, scale[:k] + scale[k + 1 :], (n * x, n * y)))
            elif frame == c:
                found.append(_Vector(frame, scale, (-y, x)))
        return found

    @staticmethod
    def _accelerated(point: Spread) -> list[tuple[_Vector, tuple[str, str]]]:
        """Acceleration of a point at constant rates: vectors, each with its two rates."""
        found = []
        for (frame, slide), (x, y) in point.items():
            scale = factors(slide)
            if frame != GROUND:
                found.append((_Vector(frame, scale, (-x, -y)), (frame, frame)))
                for k, c in enumerate(scale):
                    rest = scale[:k] + scale[k + 1 :]
                    found.append((_Vector(frame, rest, (-2.0 * y, 2.0 * x)), (c, frame)))
            for k, c in enumerate(scale):
                for m, other in enumerate(scale[:k]):
                    rest = scale[:m] + scale[m + 1 : k] + scale[k + 1 :]
                    found.append((_Vector(frame, rest, (2.0 * x, 2.0 * y)), (other, c)))
        return found

    def _products(self, name: str, pairs: Iterable[tuple[Any, _Vector, _Vector]]) -> Term:
        """``sum m a . b``, with the constants of equal frames and displacements collected."""
        total = np.sum if self.mechanism.deformations else float
        sums: dict[tuple[str, str, tuple[str, ...]], tuple[float, float]] = {}
        sizes: dict[tuple[str, str, tuple[str, ...]], float] = {}
        order = self.coordinates
        for mass, a, b in pairs:
            slides = tuple(sorted((*a.scale, *b.scale), key=order.index))
            key = (a.frame, b.frame, slides)
            inner, outer = sums.get(key, (0.0, 0.0))
            inner += total(mass * (a.d[0] * b.d[0] + a.d[1] * b.d[1]))
            outer += total(mass * (a.d[0] * b.d[1] - a.d[1] * b.d[0]))
            sums[key] = inner, outer
            if self.mechanism.deformations:
                size = np.sum(np.abs(mass) * np.hypot(*a.d) * np.hypot(*b.d))
                sizes[key] = sizes.get(key, 0.0) + float(size)
        for key, size in sizes.items():  # what orthogonal shapes leave of integrals is rounding
            inner, outer = (
                float(x) if abs(x) > _ROUNDING.value * size else 0.0 for x in sums[key]
            )
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
            mass, point = self._spread[body.name]
            pairs += [
                (mass, a, b)
                for a in self._tangents(point, f)
                for b in self._tangents(point, g)
                if self._extensions.counts((f, g), a, b)
            ]
            if f == g == self.mechanism.frame(body.name)[0]:
                # about the centre of gravity, as if of a mass at the radius of gyration
                unit = _Vector(f, (), (1.0, 0.0))
                own = body.extension
                pairs.append((own.spin_of(body) if own else body.inertia, unit, unit))
            if f == g and body.extension and f.startswith(f'{body.name}.'):
                own_way = body.extension.rising.get(f.partition('.')[2], 0.0)
                unit = _Vector(GROUND, (), (1.0, 0.0))
                pairs += [(own_way, unit, unit)] if own_way else []
        return self._products(f'inertia:{f}:{g}', pairs)

    def _velocity_product(self, f: str) -> Term:
        """``sum_b m_b t_bf . p''`` at constant rates: centripetal and Coriolis terms of row f."""
        pairs: dict[tuple[str, str], list[tuple[Any, _Vector, _Vector]]] = {}
        for mass, point in self._spread.values():
            accelerated = self._accelerated(point)
            for tangent in self._tangents(point, f):
                for vector, rates in accelerated:
                    # arms that turn together: nothing along the tangent
                    if rates != (f, f) and self._extensions.counts((f, *rates), tangent, vector):
                        pairs.setdefault(rates, []).append((mass, tangent, vector))
        order = {c: i for i, c in enumerate(self.coordinates)}
        rows = []
        for (a, b), products in sorted(pairs.items(), key=lambda x: [order[c] for c in x[0]]):
            name = f'centripetal:{f}:{b}' if a == b else f'coriolis:{f}:{a}:{b}'
            term = self._products(name, products)
            rows.append(mul(mul(term, self.frames.v[a]), self.frames.v[b]))
        return add(*rows)

    def _weight(self, f: str) -> Term:
        """Minus the generalised force of gravity and elasticity on coordinate f."""
        gravity = _Vector(GROUND, (), self.mechanism.gravity)
        weight = self._products(
            f'weight:{f}',
            (
                (-mass, gravity, tangent)
                for mass, point in self._spread.values()
                for tangent in self._tangents(point, f)
            ),
        )
        link, _, name = f.partition('.')
        body = self.mechanism.body(link)
        if name and self.mechanism.rise(link, body.cog).get(f):
            along = -body.mass * self.mechanism.axial_gravity
            weight = self.parameters(f'weight:{f}.along', along)
        return add(weight, self._extensions.stiffness(f))


class _Vector(NamedTuple):
    """``s R(theta) d``."""

    frame: str
    scale: tuple[str, ...]
    d: tuple[Any, Any]  #: one vector, or (2, K) at the K particles of an elastic link


class _Extensions:
    """Terms that extensions of links add: strain energy, damping, gyroscopic moments.

    `counts` tells which terms are of too high an order.
    """

    def __init__(self, mechanism: Mechanism, frames: Frames) -> None:
        self._elastic = frozenset(mechanism.deformations)
        q, v = frames.q, frames.v
        p, half = frames.parameters, hy.expression(0.5)
        self._forces: dict[str, Term] = {}
        self._losses: dict[str, Term] = {}
        for link, own in mechanism.extensions.items():
            for name, (stiffness, damping) in own.springs.items():
                c = f'{link}.{name}'
                self._forces[c] = mul(p(f'links:{c}.stiffness', stiffness), q[c])
                self._losses[c] = mul(p(f'links:{c}.damping', damping), v[c])
        self.energy: Term = add(*(mul(half, mul(f, q[c])) for c, f in self._forces.items()))
        self.loss: Term = add(*(mul(f, v[c]) for c, f in self._losses.items()))
        for link, own in mechanism.extensions.items():
            found = own.forces(link, frames)
            if found is None:
                continue
            self._forces |= found.elastic
            self._losses |= found.other
            self.energy, self.loss = add(self.energy, found.energy), add(self.loss, found.loss)

    def counts(self, coordinates: Iterable[str], a: _Vector, b: _Vector) -> bool:
        """True if a term of the equation of the first of `coordinates` is kept.

        Kinetic energy is taken up to the second order in elastic coordinates and their rates.
        """
        if not self._elastic:
            return True
        return sum(c in self._elastic for c in (*coordinates, *a.scale, *b.scale)) <= 2

    def stiffness(self, c: str) -> Term:
        """Minus the elastic force on a coordinate [N]."""
        return self._forces.get(c)

    def damping(self, c: str) -> Term:
        """Minus the rate-dependent force on a coordinate [N, N m]."""
        return self._losses.get(c)
