"""Equations of motion solved for the free coordinates, with the closures taken out.

Closures are eliminated once, so that contact and impact see one small matrix; minimal coordinates
instead would have to pass a singular point somewhere. ``M + m G^T G`` in the place of M, with the
constraint mass m, changes the forces of closures only, by ``m G a``, which is known: so links
without mass, whose M is singular, can be solved for.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import heyoka as hy

from mechanism_sim.numerics.symbolic import (
    Matrix,
    Term,
    Vector,
    add,
    dense,
    div,
    dot,
    factorise,
    mul,
    neg,
    solve_symmetric,
)
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.frames import Jet
from mechanism_sim.planar.protocols import Relation


class FreeMotion(NamedTuple):
    """Motion without contact forces."""

    a: Vector  #: accelerations of the free coordinates
    closing_forces: Vector  #: of the closures


class UnitResponse(NamedTuple):
    """Effects of unit impulses of some rows, with all loops closed."""

    response: Matrix  #: rates of the free coordinates, by row
    compliance: Matrix  #: of every row of contacts, then of joint friction
    drive_response: Matrix  #: impulses of the drives, by row


class Reduction:
    """Equations of motion with the closures taken out.

    Parameters
    ----------
    equations : of all coordinates
    prescribed : names of the coordinates whose law a drive gives
    rows : jets of contacts
    slips : jets of joint friction
    applied : of every coordinate, generalised forces
    accelerations : of the prescribed coordinates
    alpha : rate of Baumgarte's stabilisation
    constraint_mass : [kg] added along the closures, or None

    Attributes
    ----------
    J : the rows on the free coordinates
    contacts, joints : by unit impulses of contacts, and of friction in ideal joints
    closings : forces of the closures per unit impulse of each row of contacts
    exact : motion without contact forces and without stabilisation
    """

    def __init__(
        self,
        equations: Equations,
        prescribed: Sequence[str],
        rows: Sequence[Jet],
        slips: Sequence[Jet],
        applied: Sequence[Sequence[Term]],
        accelerations: Vector,
        alpha: hy.expression,
        constraint_mass: Term,
    ) -> None:
        self._equations = eq = equations
        names = eq.coordinates
        self._free = free = [i for i, c in enumerate(names) if c not in prescribed]
        self._driven = driven = [names.index(c) for c in prescribed]
        self._a_p, self._alpha = accelerations, alpha
        self._constraint_mass, self._rows = constraint_mass, rows
        rhs: Vector = [
            add(*applied[i], neg(add(eq.bias[i], dot([eq.M[i][j] for j in driven], self._a_p))))
            for i in free
        ]
        self.J: Matrix = [self._free_row(jet) for jet in rows]
        self._G: Matrix = [self._free_row(jet) for jet in eq.relation_jets]
        J = [*self.J, *map(self._free_row, slips)]
        # one factorisation of the mass matrix serves the loads, all contact rows and all closures
        solved = solve_symmetric(self._mass(), [rhs, *J, *self._G])
        self._unconstrained, W = solved[0], solved[1 : 1 + len(J)]
        self._W_G = solved[1 + len(J) :]
        self._S = [[dot(row, w) for w in self._W_G] for row in self._G]
        # closure forces that cancel what a unit impulse does to the closures: ``S lambda = -G w``
        kept: Matrix = [[] for _ in W]
        if self._G:
            kept = solve_symmetric(self._S, [[neg(dot(row, w)) for row in self._G] for w in W])
        # responses that keep the closures; their products with the rows are the compliance
        response = [self.shifted(w, kept[k]) for k, w in enumerate(W)]
        self.exact = self.free_motion(stabilised=False)
        drives = [
            self._on_drives(jet, response[k], kept[k]) for k, jet in enumerate([*rows, *slips])
        ]
        count = len(self.J)
        self.closings = kept[:count]
        own, of_joints = response[:count], response[count:]
        # symmetric: to write each entry once halves what it costs in a step
        half = [[dot(row, w) for w in own[: k + 1]] for k, row in enumerate(self.J)]
        compliance = [[half[max(r, c)][min(r, c)] for c in range(count)] for r in range(count)]
        self.contacts = UnitResponse(own, compliance, drives[:count])
        along = [[dot(row, w) for w in of_joints] for row in J]
        self.joints = UnitResponse(of_joints, along, drives[count:])

    def _mass(self) -> Matrix:
        """Mass matrix of the free coordinates, with the constraint mass along the closures."""
        M = [[self._equations.M[i][j] for j in self._free] for i in self._free]
        if self._constraint_mass is None:
            return M
        for i, line in enumerate(M):
            for j in range(len(M)):
                closures = dot([g[i] for g in self._G], [g[j] for g in self._G])
                line[j] = add(line[j], mul(self._constraint_mass, closures))
        return M

    def _on_drives(self, jet: Jet, response: Vector, closing: Vector) -> Vector:
        """Impulses of the drives per unit impulse of a row."""
        eq, own, found = self._equations, self.driven_row(jet), []
        for n, i in enumerate(self._driven):
            pairs = zip(eq.relation_jets, closing, strict=True)
            reaction = add(*(mul(self.driven_row(r)[n], x) for r, x in pairs))
            inertia = dot([eq.M[i][j] for j in self._free], response)
            found.append(add(inertia, neg(own[n]), neg(reaction)))
        return found

    def _free_row(self, jet: Jet) -> Vector:
        row = jet.row(self._equations.coordinates)
        return [row[i] for i in self._free]

    def driven_row(self, jet: Jet) -> Vector:
        """Coefficients of the prescribed coordinates' rates in the rate of a jet."""
        row = jet.row(self._equations.coordinates)
        return [row[i] for i in self._driven]

    def shifted(self, start: Vector, factors: Vector, columns: Matrix | None = None) -> Vector:
        """Add columns, those of the closures if no others are given, times factors."""
        columns = self._W_G if columns is None else columns
        return [
            add(x, *(mul(column[i], f) for column, f in zip(columns, factors, strict=True)))
            for i, x in enumerate(start)
        ]

    def distances(self, relations: Sequence[Relation]) -> list[Term]:
        """Measures of the independence of each loop closure of those before it, 0 to 1.

        The pivot of a row of ``G M^-1 G^T`` over the sum of the diagonal of its joint's rows. It
        vanishes quadratically where G is not of full rank: at a singular position.
        """
        found: list[Term] = []
        for relation in relations:
            first = len(found)
            rows = range(first, first + len(relation.values(self._equations.frames)))
            size = add(*(self._S[k][k] for k in rows))
            found += [div(self._pivots[k], size) for k in rows]
        return found

    @cached_property
    def _pivots(self) -> Vector:
        return factorise(self._S)[1]

    def closing_shift(self, off: Vector) -> Vector:
        """The shift of the free coordinates that takes `off` from the values of the closures."""
        none: Vector = [None] * len(self._free)
        if not self._G:
            return none
        return self.shifted(none, solve_symmetric(self._S, [[neg(x) for x in off]])[0])

    def _stabilising_term(self, jet: Jet, stabilised: bool) -> Term:
        """Baumgarte's term, which draws a closed gap back to zero within about a step.

        Its rate alpha is set by the event loop to the reciprocal of the last step, up to a bound:
        alpha^2 times the rounding of a gap must not rule the accelerations, for then steps get
        shorter, alpha grows, and so on to no step at all.
        """
        if not stabilised:
            return None
        # no projection after every step instead: it would make the published motion jump
        alpha = self._alpha
        if jet.value is None:  # only a rate
            return mul(alpha, jet.rate)
        return mul(alpha, add(2.0 * jet.rate, mul(alpha, jet.value)))

    def free_motion(self, stabilised: bool) -> FreeMotion:
        """Accelerations without contact forces, and the forces of the closures."""
        a = self._unconstrained
        if not self._G:
            return FreeMotion(a, [])
        wanted = [  # of G a
            neg(
                add(
                    dot(self.driven_row(jet), self._a_p),
                    jet.curvature,
                    self._stabilising_term(jet, stabilised),
                )
            )
            for jet in self._equations.relation_jets
        ]
        off = [add(x, neg(dot(row, a))) for row, x in zip(self._G, wanted, strict=True)]
        factors = solve_symmetric(self._S, [off])[0]
        forces = [
            add(f, neg(mul(self._constraint_mass, x)))
            for f, x in zip(factors, wanted, strict=True)
        ]
        return FreeMotion(self.shifted(a, factors), forces)

    def second_derivatives(self, a: Vector, stabilised: bool = False) -> Vector:
        """Second derivatives of the rows of contacts under accelerations `a`."""
        return [
            add(
                dot(row, a),
                dot(self.driven_row(jet), self._a_p),
                jet.curvature,
                self._stabilising_term(jet, stabilised),
            )
            for row, jet in zip(self.J, self._rows, strict=True)
        ]

    def pushed(self, motion: FreeMotion, factors: Vector) -> FreeMotion:
        """Motion with forces, or impulses, of all rows of contacts."""
        closing = motion.closing_forces
        return FreeMotion(
            self.shifted(motion.a, factors, self.contacts.response),
            self.shifted(closing, factors, self.closings) if closing else [],
        )

    def distance(self, relations: Sequence[Relation]) -> Term:
        """Harmonic sum of `distances`; None without closures."""
        if not self._G:
            return None
        return 1.0 / dense(add(*(1.0 / dense(x) for x in self.distances(relations))))
