"""Accelerations and contact forces as expressions of state and flags.

``M a + bias = torques + G^T lambda + J_n^T N + J_t^T T`` with loops that stay closed, gaps that
are closed where their flag says so, and Coulomb's friction in them. The prescribed coordinates are
known; everything is solved for the free ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, reduce
from operator import truediv
from typing import NamedTuple

import heyoka as hy

from mechanism_sim.numerics.symbolic import (
    Matrix,
    Term,
    Vector,
    add,
    backward,
    cramer,
    dense,
    div,
    dot,
    eliminate,
    factorise,
    forward,
    mul,
    neg,
    solve_symmetric,
)
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.jet import Jet
from mechanism_sim.planar.joint_friction import JointFriction, Rub, rubs
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.motor import Motor
from mechanism_sim.planar.protocols import ForceElement, Gap, Relation
from mechanism_sim.planar.virtual_work import generalised
from mechanism_sim.tolerances import TOLERANCES

_IMPACTS = TOLERANCES.impacts


_CRAMER = 6  # contacts up to which there are not too many minors


class Solved(NamedTuple):
    """Accelerations of the free coordinates and the forces that belong to them."""

    a: Vector
    N: Vector  #: (m,) normal forces [N]
    T: Vector  #: (m,) friction forces on the first-named links [N]; both along the rows
    closing_forces: Vector  #: of the closures on the first-named links [N]


class Dynamics:
    """The terms of a system with m gaps as expressions.

    Rows are the normals of all gaps and, if any gap has friction, the tangents of all gaps.

    ``M + lent G^T G`` in the place of M changes the forces of closures only, by ``lent G a``,
    which is known: so links without mass, whose M is singular, can be solved for.

    Parameters
    ----------
    lent : [kg] to the rows of the closures; 0 for none

    Attributes
    ----------
    normal, tangent : jets of the gaps, and of their slip where there is friction
    relation : jets of the closures
    rows : jets of all rows
    J : the rows on the free coordinates
    response : M^-1 J^T with all loops closed
    compliance : J M^-1 J^T with all loops closed
    free_acceleration : second derivatives of the rows without contact forces
    drive_response : impulse of the drives per unit impulse, by row
    closed, sticks, slips : flags of the gaps; the latter by index of those that have them
    approach, presses : of compliant contacts, the speed of their touch and whether it is they that
        carry force while closed
    gaps, elements, relations : as given
    free, prescribed, powered : names of coordinates; degree : of the laws of the prescribed
    margin : [m/s] by which compliant contacts are late to let go, and to press again
    friction, mu : coefficients of all gaps; as parameters, by index of those that have friction
    active : flag of every row: closed for a normal, sticking for a tangent
    jam_margin : determinant of the equations of the normal forces over that without the friction
        of what slides; where it is 0, that friction jams
    exact, stabilised : the solution without and with Baumgarte's terms
    loads : forces and moments of the elements, and of friction in ideal joints
    rubs : that friction
    depths : of compliant contacts, by the symbols that stand for them beside such friction
    rub_response, rub_closing, rub_drive_response : as of rows, by unit impulses of that friction
    rub_compliance : of all rows, then of these slips, likewise
    torques : of every powered coordinate the three coefficients of its law
    characteristics : torques of motors [N m, N]
    drive_torques : of every powered coordinate that of its law and of its motor [N m, N]
    """

    def __init__(
        self,
        mechanism: Mechanism,
        gaps: Sequence[Gap],
        prescribed: Sequence[str],
        degree: int,
        relations: Sequence[Relation],
        powered: Sequence[str],
        elements: Sequence[ForceElement] = (),
        motors: Sequence[Motor] = (),
        frictions: Sequence[JointFriction] = (),
        lent: float = 0.0,
    ) -> None:
        self.equations = eq = Equations(mechanism, gaps, relations)
        p = eq.parameters
        self._lent = p('closures.lent', lent)
        self.gaps, self.elements = tuple(gaps), tuple(elements)
        self.prescribed, self.powered = tuple(prescribed), tuple(powered)
        self.degree = degree
        self.free = tuple(c for c in eq.coordinates if c not in prescribed)
        self._free = [eq.coordinates.index(c) for c in self.free]
        self._driven = [eq.coordinates.index(c) for c in prescribed]
        self.friction = [min(gap.friction, _IMPACTS.rough) for gap in gaps]
        self.frictional = [i for i, mu in enumerate(self.friction) if mu > 0.0]
        self.mu = {i: p(f'{gaps[i].name}.friction', self.friction[i]) for i in self.frictional}
        #: of contacts that rub in a part of their cycle only: flags of these parts
        self.engaged = {
            i: flag
            for i in self.frictional
            if (flag := getattr(gaps[i], 'engaged', lambda _: None)(eq.frames)) is not None
        }
        self.mu |= {i: mul(self.mu[i], flag) for i, flag in self.engaged.items()}
        self.closed = [p.reserve(f'{g.name}.closed') for g in gaps]
        self.sticks = {i: p.reserve(f'{gaps[i].name}.sticks') for i in self.frictional}
        self.slips = {i: p.reserve(f'{gaps[i].name}.slips') for i in self.frictional}
        self._alpha = p.reserve('stabilisation')
        self.torques = [p.reserve(f'drives:{c}.torque.{k}') for c in powered for k in range(3)]
        own = {m.coordinate: m.torque(eq.frames) for m in motors}
        self.characteristics = [*own.values()]
        self.drive_torques: Vector = []
        for n, c in enumerate(powered):
            k0, k1, k2 = self.torques[3 * n : 3 * n + 3]
            law = k0 + k1 * eq.frames.q[c] + k2 * eq.frames.v[c]
            self.drive_torques.append(add(law, own.get(c)))
        self.normal = eq.gap_jets
        self.laws = [gap.law for gap in gaps]
        self.compliant = any(law is not None for law in self.laws)
        if self.compliant and None in self.laws:
            raise ValueError('either all contacts of a system are compliant or none is')
        self.approach = [p.reserve(f'{g.name}.approach', 1.0) for g in gaps if g.law]
        self.presses = [p.reserve(f'{g.name}.presses') for g in gaps if g.law]
        self.margin = p.reserve('release.margin') if self.compliant else hy.expression(0.0)
        self.tangent = {i: gaps[i].slip(eq.frames) for i in self.frictional}
        self.relations = tuple(relations)
        self.relation = eq.relation_jets
        none = Jet(None, {}, None, None)
        tangents = [self.tangent.get(i, none) for i in range(len(gaps))]
        self.rows = [*self.normal, *(tangents if self.frictional else [])]
        self.active: Vector = [*self.closed]
        if self.frictional:
            self.active += [self.sticks.get(i, hy.expression(0.0)) for i in range(len(gaps))]
        if self.compliant:  # no gap is kept closed
            self.active[: len(gaps)] = [hy.expression(0.0)] * len(gaps)
        #: of every row, the share by which it yields while others of its joint hold the same
        self.softness: Vector = [None] * len(gaps) + [self._softness(i) for i in range(len(gaps))]
        self.loads = [load for element in elements for load in element.loads(eq.frames)]
        self.rubs: list[Rub] = rubs(frictions, eq.frames)
        self.depths: dict[hy.expression, hy.expression] = {}
        self.loads += [load for rub in self.rubs for load in rub.loads]
        self._pushes = generalised(self.loads, eq.frames, mechanism)
        self._reduce(powered)
        self.jam_margin: Term = None
        self.exact = self._solve(stabilised=False)
        self.stabilised = self._solve(stabilised=True)
        self.free_acceleration = self._second_derivatives(self.exact_free)

    def _softness(self, i: int) -> Term:
        """Of the tangent of a gap, while others of its joint stick."""
        own, gaps = getattr(self.gaps[i], 'softness', 0.0), enumerate(self.gaps)
        others = [k for k, gap in gaps if k != i and gap.joint == self.gaps[i].joint]
        stuck = add(*(self.sticks.get(k) for k in others))
        return mul(hy.expression(own), stuck) if own else None

    def _free_row(self, jet: Jet) -> Vector:
        row = jet.row(self.equations.coordinates)
        return [row[i] for i in self._free]

    def _driven_row(self, jet: Jet) -> Vector:
        row = jet.row(self.equations.coordinates)
        return [row[i] for i in self._driven]

    def _reduce(self, powered: Sequence[str]) -> None:
        """Solve with the mass matrix once, then take out the closures."""
        eq = self.equations
        frames = eq.frames
        free, driven = self._free, self._driven
        self._a_p: Vector = [
            frames.a[eq.coordinates[i]] if self.degree > 1 else None for i in driven
        ]
        index = [eq.coordinates.index(c) for c in powered]
        torque: dict[int, Term] = dict(zip(index, self.drive_torques, strict=True))
        rhs: Vector = [
            add(
                torque.get(i),
                self._pushes.get(eq.coordinates[i]),
                neg(add(eq.bias[i], dot([eq.M[i][j] for j in driven], self._a_p))),
            )
            for i in free
        ]
        self.J: Matrix = [self._free_row(jet) for jet in self.rows]
        G = [self._free_row(jet) for jet in self.relation]
        M = [[eq.M[i][j] for j in free] for i in free]
        if self._lent is not None:
            for i, line in enumerate(M):
                for j in range(len(M)):
                    line[j] = add(
                        line[j], mul(self._lent, dot([g[i] for g in G], [g[j] for g in G]))
                    )
        slips = [rub.slip for rub in self.rubs]
        J = [*self.J, *map(self._free_row, slips)]
        solved = solve_symmetric(M, [rhs, *J, *G])
        self._unconstrained, W = solved[0], solved[1 : 1 + len(J)]
        self._W_G = solved[1 + len(J) :]
        # closures are eliminated once, so that contact and impact see one small matrix; minimal
        # coordinates instead would have to pass a singular point somewhere
        self._S = [[dot(row, w) for w in self._W_G] for row in G]
        self._G = G
        count = len(self.J)
        kept = (
            solve_symmetric(self._S, [[neg(dot(row, w)) for row in G] for w in W])
            if G else [[] for _ in W]
        )  # fmt: skip
        self._closing, self.rub_closing = kept[:count], kept[count:]
        response = [self._with(w, self._W_G, kept[k]) for k, w in enumerate(W)]
        self.response: Matrix = response[:count]
        self.compliance: Matrix = [[dot(row, w) for w in self.response] for row in self.J]
        self.rub_response: Matrix = response[count:]
        self.rub_compliance: Matrix = [[dot(row, w) for w in self.rub_response] for row in J]
        self.exact_free, self._exact_closing = self._free_motion(stabilised=False)
        M_p = [[eq.M[i][j] for j in free] for i in driven]
        drives = []
        for k, jet in enumerate([*self.rows, *slips]):
            own = self._driven_row(jet)
            closing = kept[k]
            reaction = [
                add(*(mul(self._driven_row(r)[n], x)
                      for r, x in zip(self.relation, closing, strict=True)))
                for n in range(len(driven))
            ]  # fmt: skip
            drives.append(
                [
                    add(dot(M_p[n], response[k]), neg(own[n]), neg(reaction[n]))
                    for n in range(len(driven))
                ]
            )
        self.drive_response: Matrix = drives[:count]
        self.rub_drive_response: Matrix = drives[count:]

    @staticmethod
    def _with(start: Vector, columns: Matrix, factors: Vector) -> Vector:
        return [
            add(x, *(mul(column[i], f) for column, f in zip(columns, factors, strict=True)))
            for i, x in enumerate(start)
        ]

    @cached_property
    def distances(self) -> list[Term]:
        """How far each loop closure is from depending on those before it, 0 to 1.

        The pivot of a row of ``G M^-1 G^T`` over the sum of the diagonal of its joint's rows. It
        vanishes quadratically where G is not of full rank: at a singular position.
        """
        _, pivots = factorise(self._S)
        found: list[Term] = []
        for relation in self.relations:
            first = len(found)
            rows = range(first, first + len(relation.values(self.equations.frames)))
            size = add(*(self._S[k][k] for k in rows))
            found += [div(pivots[k], size) for k in rows]
        return found

    @property
    def distance(self) -> Term:
        """The harmonic sum of `distances`; None without closures."""
        if not self.relation:
            return None
        return 1.0 / dense(add(*(1.0 / dense(x) for x in self.distances)))

    def closing(self, off: Vector) -> Vector:
        """The shift of the free coordinates that takes `off` from what the closures say."""
        if not self.relation:
            return [None] * len(self._free)
        factors = solve_symmetric(self._S, [[neg(x) for x in off]])[0]
        return self._with([None] * len(self._free), self._W_G, factors)

    @staticmethod
    def along(row: Vector, shift: Vector) -> Term:
        """How much a row changes by a shift of the free coordinates."""
        return dot(row, shift)

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

    def _free_motion(self, stabilised: bool) -> tuple[Vector, Vector]:
        """Accelerations without contact forces, and the forces of the closures."""
        a = self._unconstrained
        if not self.relation:
            return a, []
        wanted = [  # of G a
            neg(
                add(
                    dot(self._driven_row(jet), self._a_p),
                    jet.curvature,
                    self._stabilising_term(jet, stabilised),
                )
            )
            for jet in self.relation
        ]
        off = [add(x, neg(dot(row, a))) for row, x in zip(self._G, wanted, strict=True)]
        factors = solve_symmetric(self._S, [off])[0]
        forces = [add(f, neg(mul(self._lent, x))) for f, x in zip(factors, wanted, strict=True)]
        return self._with(a, self._W_G, factors), forces

    def _second_derivatives(self, a: Vector, stabilised: bool = False) -> Vector:
        return [
            add(
                dot(row, a),
                dot(self._driven_row(jet), self._a_p),
                jet.curvature,
                self._stabilising_term(jet, stabilised),
            )
            for row, jet in zip(self.J, self.rows, strict=True)
        ]

    def _solve(self, stabilised: bool) -> Solved:
        """All forces: ``N`` of closed gaps, ``T`` of those that stick; ``-mu slip N`` slides."""
        m = len(self.normal)
        a, closing = self._free_motion(stabilised) if stabilised else (
            self.exact_free, self._exact_closing,
        )  # fmt: skip
        if not m:
            return Solved(a, [], [], closing)
        b = self._second_derivatives(a, stabilised)
        pressed = [neg(mul(s, x)) for s, x in zip(self.closed, b, strict=False)]
        friction: Vector = [None] * m
        if self.compliant:
            N, friction = self._pushed(b[m:])
        elif not self.frictional:
            N = solve_symmetric(self._masked_compliance(range(m), range(m)), [pressed])[0]
        else:
            N, stuck = self._pressed(pressed, b[m:])
            for i, force in zip(self.frictional, stuck, strict=True):
                friction[i] = add(force, neg(mul(self.slips[i], mul(self.mu[i], N[i]))))
        factors = [*N, *(friction if self.frictional else [])]
        a = self._with(a, self.response, factors)
        closing = self._with(closing, self._closing, factors) if self.relation else []
        return Solved(a, N, friction, closing)

    def _masked_compliance(self, rows: Sequence[int], columns: Sequence[int]) -> Matrix:
        """Compliance of what is kept, and the identity for what is not."""
        K: Matrix = []
        for r in rows:
            line: Vector = []
            for c in columns:
                entry = self.compliance[r][c]
                if r == c and self.softness[r] is not None:
                    entry = mul(entry, 1.0 + dense(self.softness[r]))
                entry = mul(self.active[r], mul(1.0 if r == c else self.active[c], entry))
                line.append(add(entry, 1.0 - self.active[r]) if r == c else entry)
            K.append(line)
        return K

    def _dragged(self, rows: Sequence[int], c: int) -> Vector:
        """Rates that friction of a sliding contact takes off the kept rows, by its force."""
        share = [mul(self.mu[c], self.compliance[r][len(self.normal) + c]) for r in rows]
        return [
            mul(self.active[r], mul(self.slips[c], x)) for r, x in zip(rows, share, strict=True)
        ]

    def _pressed(self, right: Vector, tangential: Vector) -> tuple[Vector, Vector]:
        """Normal forces, and friction of what sticks.

        Sticking is eliminated first, which can be done always. Only then come the normal forces of
        what slides: their matrix S is not symmetric and may be singular.
        """
        m = len(self.normal)
        if m > _CRAMER:
            return self._pressed_by_contact(right, tangential)
        normal, held = range(m), [m + i for i in self.frictional]
        L, D = factorise(self._masked_compliance(held, held))
        free = forward(L, [neg(mul(self.active[r], tangential[r - m])) for r in held])
        columns = zip(*self._masked_compliance(held, normal), strict=True)
        each = [forward(L, column) for column in columns]
        scaled = [[div(x, d) for x, d in zip(y, D, strict=True)] for y in each]
        smooth = self._masked_compliance(normal, normal)  # without the friction of what slides
        for i in normal:
            for k in range(i + 1):
                smooth[i][k] = smooth[k][i] = add(smooth[i][k], neg(dot(scaled[i], each[k])))
        S = [list(row) for row in smooth]
        for c in self.frictional:
            dragged = forward(L, self._dragged(held, c))
            for i, x in enumerate(self._dragged(normal, c)):
                S[i][c] = add(S[i][c], neg(x), dot(scaled[i], dragged))
            each[c] = [add(x, neg(y)) for x, y in zip(each[c], dragged, strict=True)]
        left = [add(x, neg(dot(row, free))) for x, row in zip(right, scaled, strict=True)]
        N, det = cramer(S, left)
        if self.jam_margin is None:
            pivots = factorise(smooth)[1]
            self.jam_margin = reduce(truediv, map(dense, pivots), dense(det))
        rest = [
            add(x, *(neg(mul(column[k], n)) for column, n in zip(each, N, strict=True)))
            for k, x in enumerate(free)
        ]
        return N, backward(L, D, rest)

    def _pressed_by_contact(self, right: Vector, tangential: Vector) -> tuple[Vector, Vector]:
        """Forces of many contacts: one after the other, few of which share a link."""
        m = len(self.normal)
        left = [
            *right,
            *(neg(mul(a, x)) for a, x in zip(self.active[m:], tangential, strict=True)),
        ]
        rows = [r for i in self._order() for r in (m + i, i) if r < m or i in self.mu]
        kept = self._masked_compliance(rows, rows)
        A = [list(row) for row in kept]
        for k, c in enumerate(rows):
            if c in self.mu:
                for row, x in zip(A, self._dragged(rows, c), strict=True):
                    row[k] = add(row[k], neg(x))
        found, det = eliminate(A, [left[r] for r in rows])
        if self.jam_margin is None:
            self.jam_margin = reduce(truediv, map(dense, factorise(kept)[1]), dense(det))
        forces = dict(zip(rows, found, strict=True))
        return [forces[i] for i in range(m)], [forces[m + i] for i in self.frictional]

    def _order(self) -> list[int]:
        """The contacts by how many others they are coupled to when those before are eliminated."""
        m = len(self.normal)
        rest = {
            i: {
                k
                for k in range(m)
                if k != i and any(x is not None for r in self.compliance[i::m] for x in r[k::m])
            }
            for i in range(m)
        }
        order = []
        while rest:
            order.append(min(rest, key=lambda i: (len(rest[i]), i)))
            near = rest.pop(order[-1])
            for k in near:
                rest[k] = (rest[k] | near) - {k, order[-1]}
        return order

    def accelerations(self, solved: Solved) -> dict[str, Term]:
        """Accelerations of all coordinates, by name."""
        a: dict[str, Term] = dict(zip(self.free, solved.a, strict=True))
        of_laws = self.equations.frames.a
        return a | {c: of_laws[c] if self.degree > 1 else None for c in self.prescribed}

    def struck(self, impulses: Sequence[Term]) -> Solved:
        """Free motion with impulses of all rows, of whose loads friction in joints is one."""
        count, m = len(self.rows), len(self.normal)
        N, T = impulses[:m], impulses[m:count] if self.frictional else [None] * m
        a, closing = self.exact_free, self._exact_closing
        return Solved(
            self._with(a, self.response, list(impulses)),
            list(N),
            list(T),
            self._with(closing, self._closing, list(impulses)) if closing else [],
        )

    def compressed(self, i: int) -> tuple[Term, Term, Term]:
        """Depth of a closed compliant contact, its rate, and ``|dy/d distance|``.

        Open contacts count as 1 m deep: no power of zero has a Taylor series.
        """
        s, jet = self.closed[i], self.normal[i]
        value = s * jet.value
        stretch = self.gaps[i].stretch(value)
        depth = self.gaps[i].depth(value) + (1.0 - s)
        if self.rubs:  # in long expressions only symbols are found again
            symbol = hy.make_vars(f'depth{i}')
            self.depths[symbol] = depth
            depth = symbol
        return depth, neg(mul(s, jet.rate)) / stretch, stretch

    def relief(self, i: int) -> hy.expression:
        """Of a closed compliant contact, what has the sign of its force [m/s]."""
        law = self.laws[i]
        if law is None:
            raise ValueError('a compliant contact has a law')
        return dense(law.relief(self.compressed(i)[1], self.approach[i]))

    def held(self, i: int) -> hy.expression:
        """Positive while a closed compliant contact presses on, or recovers on.

        It falls through zero with the depth, and where the force changes between there and not.
        """
        sign = 2.0 * self.presses[i] - 1.0
        return self.compressed(i)[0] * ((self.margin + sign * self.relief(i)) / self.approach[i])

    def _pushed(self, tangential: Vector) -> tuple[Vector, Vector]:
        """Forces of compliant contacts along their rows, and Coulomb's friction.

        ``T = -mu N sign(v)`` where they slide; where they stick, what keeps ``dv/dt = 0`` with the
        second derivatives `tangential` of the slips without contact forces.
        """
        m = len(self.normal)
        N: Vector = []
        T: Vector = [None] * m
        for i, law in enumerate(self.laws):
            if law is None:
                raise ValueError('a compliant contact has a law')
            depth, rate, stretch = self.compressed(i)
            force = law.normal_force(depth, rate, self.approach[i])
            force = self.closed[i] * (self.presses[i] * force)
            N.append(force / stretch)
            if i in self.slips:
                T[i] = neg(mul(self.slips[i], mul(self.mu[i], force)))
        if self.frictional:
            held = [m + i for i in self.frictional]
            left = [add(tangential[r - m], dot(self.compliance[r], [*N, *T])) for r in held]
            right = [neg(mul(self.active[r], x)) for r, x in zip(held, left, strict=True)]
            stuck = solve_symmetric(self._masked_compliance(held, held), [right])[0]
            for i, force in zip(self.frictional, stuck, strict=True):
                T[i] = add(T[i], force)
        return N, T

    @property
    def acceleration(self) -> Vector:
        """Second derivatives of the rows with the forces of the closed gaps."""
        forces = [*self.exact.N, *(self.exact.T if self.frictional else [])]
        return [
            add(free, dot(line, forces))
            for free, line in zip(self.free_acceleration, self.compliance, strict=True)
        ]

    def on_prescribed(self, k: int, solved: Solved) -> Term:
        """Generalised force of contacts and closures on the k-th prescribed coordinate."""
        forces = [*solved.N, *(solved.T if self.frictional else [])]
        return add(
            self._pushes.get(self.equations.coordinates[self._driven[k]]),
            *(mul(self._driven_row(j)[k], f) for j, f in zip(self.rows, forces, strict=True)),
            *(
                mul(self._driven_row(j)[k], f)
                for j, f in zip(self.relation, solved.closing_forces, strict=True)
            ),
        )
