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

from mechanism_sim.engine.reduction import Reduction
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
    factorise,
    forward,
    mul,
    neg,
    solve_dragged,
    solve_symmetric,
)
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.frames import Jet
from mechanism_sim.planar.joint_friction import FrictionalJoint, JointFriction, frictional_joints
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.motor import Motor
from mechanism_sim.planar.protocols import (
    FirstOrderState,
    ForceElement,
    ForceLaw,
    Gap,
    Relation,
)
from mechanism_sim.planar.reactions import generalized_forces
from mechanism_sim.planar.virtual_work import generalised
from mechanism_sim.tolerances import TOLERANCES

_IMPACTS = TOLERANCES.impacts


_CRAMER = 3  # number of contacts up to which forces are solved by minors

_YIELDS = 1e40  # compliance [1/kg] of inactive rows: that of any links is below its rounding


class Solved(NamedTuple):
    """Accelerations of the free coordinates and the forces that belong to them."""

    a: Vector
    N: Vector  #: (m,) normal forces [N]
    T: Vector  #: (m,) friction forces [N]; both on the first-named links, along the rows
    closing_forces: Vector  #: forces of the loop closures on the first-named links [N]
    #: determinant of the equations of the normal forces over that without friction of sliding
    #: contacts; 0 where that friction jams
    jam_margin: Term = None
    sticks: bool = True  #: whether contacts may stick


class ModeFlags(NamedTuple):
    """Runtime parameters for the modes: which contacts carry force, and how."""

    closed: list[hy.expression]  #: (m,) 1 for a closed gap
    sticks: dict[int, hy.expression]  #: 1 for sticking, by index of the gaps with friction
    slips: dict[int, hy.expression]  #: sign of the slip, by index of the gaps with friction
    approach: list[hy.expression]  #: speeds of initial contact of compliant contacts [m/s]
    presses: list[hy.expression]  #: 1 for a closed compliant contact that carries force
    margin: hy.expression  #: [m/s] hysteresis of their loss of force and recovery


class Drives(NamedTuple):
    """Torques of the powered coordinates [N m, N]."""

    coefficients: list[hy.expression]  #: three of the torque law of every coordinate
    characteristics: Vector  #: torques of the motors' characteristics
    torques: Vector  #: sums of the torques of law and motor of every coordinate


class ContactRows(NamedTuple):
    """Rows of m gaps: all normals and, if any gap has friction, the tangents of all."""

    normal: list[Jet]  #: (m,) gaps
    tangent: dict[int, Jet]  #: slips, by index of the gaps with friction
    rows: list[Jet]  #: all normals, then all tangents
    laws: list[ForceLaw | None]  #: (m,) force laws; None for a rigid contact
    friction: list[float]  #: (m,) coefficients of friction
    mu: dict[int, Term]  #: the coefficients as parameters, by index of the gaps with friction
    engaged: dict[int, hy.expression]  #: flags of the parts of the cycle with friction
    active: Vector  #: flags of the rows: closed for a normal, sticking for a tangent
    softness: Vector  #: compliances [1/kg] of the rows while others of a joint hold the same

    @property
    def frictional(self) -> list[int]:
        """Indices of the gaps with friction."""
        return [i for i, mu in enumerate(self.friction) if mu > 0.0]

    @property
    def compliant(self) -> bool:
        """True if contacts are compliant: their normal force follows a force law."""
        return any(law is not None for law in self.laws)


class AppliedForces(NamedTuple):
    """Applied forces other than contact forces."""

    elements: Sequence[ForceElement] = ()  #: force elements between links
    motors: Sequence[Motor] = ()  #: motors of coordinates, added to the drives' torques
    frictions: Sequence[JointFriction] = ()  #: friction in ideal joints


class Dynamics:
    """The terms of a system with m gaps as expressions.

    Parameters
    ----------
    degree : degree of the laws of the prescribed coordinates
    constraint_mass : [kg] mass added along the closures, see `engine.reduction`; 0 for none

    Attributes
    ----------
    gaps, elements, relations : gaps, force elements and loop closures as given
    free, prescribed, powered : names of coordinates
    flags, contacts, drives : see `ModeFlags`, `ContactRows`, `Drives`
    frictional_joints : friction in ideal joints
    state_rates : derivatives of the states of first order
    depths : depths of compliant contacts [m], by the symbols that stand for them
    reduced : the equations without contact forces
    exact, stabilised : the solution without and with Baumgarte's terms
    free_acceleration : second derivatives of the rows without contact forces
    """

    def __init__(
        self,
        mechanism: Mechanism,
        gaps: Sequence[Gap],
        prescribed: Sequence[str],
        degree: int,
        relations: Sequence[Relation],
        powered: Sequence[str],
        applied: AppliedForces = AppliedForces(),  # noqa: B008 - a tuple does not change
        constraint_mass: float = 0.0,
    ) -> None:
        self.equations = eq = Equations(mechanism, gaps, relations)
        p, frames, names = eq.parameters, eq.frames, eq.coordinates
        mass = p('closures.constraint_mass', constraint_mass)
        self.gaps, self.elements = tuple(gaps), tuple(applied.elements)
        self.relations, self.degree = tuple(relations), degree
        self.prescribed, self.powered = tuple(prescribed), tuple(powered)
        self.free = tuple(c for c in names if c not in prescribed)
        # parameters are numbered in the order in which they are reserved
        friction = [min(gap.friction, _IMPACTS.rough) for gap in gaps]
        frictional = [i for i, mu in enumerate(friction) if mu > 0.0]
        mu: dict[int, Term] = {i: p(f'{gaps[i].name}.friction', friction[i]) for i in frictional}
        engaged = {
            i: flag
            for i in frictional
            if (flag := getattr(gaps[i], 'engaged', lambda _: None)(frames)) is not None
        }
        closed = [p.reserve(f'{g.name}.closed') for g in gaps]
        sticks = {i: p.reserve(f'{gaps[i].name}.sticks') for i in frictional}
        slips = {i: p.reserve(f'{gaps[i].name}.slips') for i in frictional}
        alpha = p.reserve('stabilisation')
        self.drives = self._drives(applied.motors)
        laws = [gap.law for gap in gaps]
        if any(laws) and None in laws:
            raise ValueError('either all contacts of a system are compliant or none is')
        approach = [p.reserve(f'{g.name}.approach', 1.0) for g in gaps if g.law]
        presses = [p.reserve(f'{g.name}.presses') for g in gaps if g.law]
        margin = p.reserve('release.margin') if any(laws) else hy.expression(0.0)
        self.flags = ModeFlags(closed, sticks, slips, approach, presses, margin)
        tangent = {i: gaps[i].slip(frames) for i in frictional}
        self.contacts = self._contact_rows(
            laws, friction, {i: mul(mu[i], engaged[i]) if i in engaged else mu[i] for i in mu},
            engaged, tangent,
        )  # fmt: skip
        loads = [load for element in applied.elements for load in element.loads(frames)]
        self.frictional_joints: list[FrictionalJoint] = frictional_joints(
            applied.frictions, frames
        )
        self.depths: dict[hy.expression, hy.expression] = {}
        loads += [load for joint in self.frictional_joints for load in joint.loads]
        self._pushes = generalised(loads, frames, mechanism)
        torque = dict(zip(powered, self.drives.torques, strict=True))
        for number in range(len(self.states)):
            frames.state(number)
        self.state_rates = [x.rate(frames) for x in self.states]
        self.reduced = Reduction(
            eq,
            prescribed,
            self.contacts.rows,
            [joint.slip for joint in self.frictional_joints],
            [(torque.get(c), self._pushes.get(c)) for c in names],
            [frames.a[c] if degree > 1 else None for c in prescribed],
            alpha,
            mass,
        )
        # the integrator steps the stabilised equations; forces are those of the exact ones
        self.exact = self._solve(stabilised=False)
        self.stabilised = self._solve(stabilised=True)
        self.free_acceleration = self.reduced.second_derivatives(self.reduced.exact.a)

    @property
    def states(self) -> list[FirstOrderState]:
        """The states of first order among the elements."""
        return [x for x in self.elements if isinstance(x, FirstOrderState)]

    def _drives(self, motors: Sequence[Motor]) -> Drives:
        p, frames = self.equations.parameters, self.equations.frames
        symbols = [p.reserve(f'drives:{c}.torque.{k}') for c in self.powered for k in range(3)]
        own = {m.coordinate: m.torque(frames) for m in motors}
        torques: Vector = []
        for n, c in enumerate(self.powered):
            k0, k1, k2 = symbols[3 * n : 3 * n + 3]
            torques.append(add(k0 + k1 * frames.q[c] + k2 * frames.v[c], own.get(c)))
        return Drives(symbols, [*own.values()], torques)

    def _contact_rows(
        self,
        laws: list[ForceLaw | None],
        friction: list[float],
        mu: dict[int, Term],
        engaged: dict[int, hy.expression],
        tangent: dict[int, Jet],
    ) -> ContactRows:
        every, normal = range(len(self.gaps)), self.equations.gap_jets
        none = Jet(None, {}, None, None)
        rows = [*normal, *([tangent.get(i, none) for i in every] if tangent else [])]
        # no compliant gap is kept closed
        active: Vector = [hy.expression(0.0) for _ in every] if any(laws) else [*self.flags.closed]
        if tangent:
            active += [self.flags.sticks.get(i, hy.expression(0.0)) for i in every]
        softness: Vector = [None] * len(every) + [self._softness(i) for i in every]
        return ContactRows(normal, tangent, rows, laws, friction, mu, engaged, active, softness)

    def _softness(self, i: int) -> Term:
        """Compliance of the tangent of a gap, while others of its joint stick."""
        own, gaps = getattr(self.gaps[i], 'softness', 0.0), enumerate(self.gaps)
        others = [k for k, gap in gaps if k != i and gap.joint == self.gaps[i].joint]
        stuck = add(*(self.flags.sticks.get(k) for k in others))
        return mul(hy.expression(own), stuck) if own else None

    @property
    def distances(self) -> list[Term]:
        """Measures of each loop closure's independence of those before, see `Reduction`."""
        return self.reduced.distances(self.relations)

    @property
    def distance(self) -> Term:
        """The harmonic sum of `distances`; None without closures."""
        return self.reduced.distance(self.relations)

    @cached_property
    def sliding(self) -> Solved:
        """The stabilised solution while nothing sticks, with far fewer operations."""
        return self._solve(stabilised=True, sticks=False)

    def _solve(self, stabilised: bool, sticks: bool = True) -> Solved:
        """All forces: ``N`` of closed gaps, ``T`` of those that stick; ``-mu slip N`` slides."""
        m, contacts = len(self.gaps), self.contacts
        motion = self.reduced.free_motion(True) if stabilised else self.reduced.exact
        if not m:
            return Solved(motion.a, [], [], motion.closing_forces)
        b = self.reduced.second_derivatives(motion.a, stabilised)
        pressed = [neg(mul(s, x)) for s, x in zip(self.flags.closed, b, strict=False)]
        friction: Vector = [None] * m
        margin: Term = None
        if contacts.compliant:
            N, friction = self._pushed(b[m:])
        elif not contacts.frictional:
            N = solve_symmetric(self._masked_compliance(range(m), range(m)), [pressed])[0]
        else:
            N, friction, margin = self._pressed(pressed, b[m:], sticks)
        factors = [*N, *(friction if contacts.frictional else [])]
        a, closing = self.reduced.pushed(motion, factors)
        return Solved(a, N, friction, closing, margin, sticks)

    def _masked_compliance(self, rows: Sequence[int], columns: Sequence[int]) -> Matrix:
        """Compliance of the active rows, and the identity for the others."""
        K: Matrix = []
        for r in rows:
            line: Vector = []
            for c in columns:
                entry = self.reduced.contacts.compliance[r][c]
                if r == c and self.contacts.softness[r] is not None:
                    entry = mul(entry, 1.0 + dense(self.contacts.softness[r]))
                entry = mul(
                    self.contacts.active[r], mul(1.0 if r == c else self.contacts.active[c], entry)
                )
                line.append(add(entry, 1.0 - self.contacts.active[r]) if r == c else entry)
            K.append(line)
        return K

    def _yielding(self, r: int, c: int) -> Term:
        """Compliance of two rows; that of inactive rows is made huge instead of masked.

        Its force is zero but for some 1e-40 then, with far fewer operations than a mask has.
        """
        entry = self.reduced.contacts.compliance[r][c]
        if r != c:
            return entry
        if self.contacts.softness[r] is not None:
            entry = mul(entry, 1.0 + dense(self.contacts.softness[r]))
        return add(entry, _YIELDS * (1.0 - self.contacts.active[r]))

    def _dragged(self, rows: Sequence[int], c: int) -> Vector:
        """Accelerations of the kept rows by friction of a sliding contact, per normal force."""
        share = [
            mul(self.contacts.mu[c], self.reduced.contacts.compliance[r][len(self.gaps) + c])
            for r in rows
        ]
        return [
            mul(self.contacts.active[r], mul(self.flags.slips[c], x))
            for r, x in zip(rows, share, strict=True)
        ]

    def _pressed(
        self, right: Vector, tangential: Vector, sticks: bool
    ) -> tuple[Vector, Vector, Term]:
        """Normal forces, friction and the margin to a jam.

        Sticking is eliminated first, which can be done always. Only then come the normal forces of
        what slides: their matrix S is not symmetric and may be singular.
        """
        m = len(self.gaps)
        if m > _CRAMER:
            return self._pressed_by_contact(right, tangential, sticks)
        normal, held = range(m), [m + i for i in self.contacts.frictional if sticks]
        L, D = factorise(self._masked_compliance(held, held))
        free = forward(L, [neg(mul(self.contacts.active[r], tangential[r - m])) for r in held])
        block = self._masked_compliance(held, normal)
        each = [forward(L, [line[c] for line in block]) for c in normal]
        scaled = [[div(x, d) for x, d in zip(y, D, strict=True)] for y in each]
        smooth = self._masked_compliance(normal, normal)  # without the friction of what slides
        for i in normal:
            for k in range(i + 1):
                smooth[i][k] = smooth[k][i] = add(smooth[i][k], neg(dot(scaled[i], each[k])))
        S = [list(row) for row in smooth]
        for c in self.contacts.frictional:
            dragged = forward(L, self._dragged(held, c))
            for i, x in enumerate(self._dragged(normal, c)):
                S[i][c] = add(S[i][c], neg(x), dot(scaled[i], dragged))
            each[c] = [add(x, neg(y)) for x, y in zip(each[c], dragged, strict=True)]
        # what sticking leaves of the normal equations; their forces then give those of sticking
        left = [add(x, neg(dot(row, free))) for x, row in zip(right, scaled, strict=True)]
        N, det = cramer(S, left)
        margin = reduce(truediv, map(dense, factorise(smooth)[1]), dense(det))
        rest = [
            add(x, *(neg(mul(column[k], n)) for column, n in zip(each, N, strict=True)))
            for k, x in enumerate(free)
        ]
        friction = self._slid(N)
        for r, force in zip(held, backward(L, D, rest), strict=True):
            friction[r - m] = add(force, friction[r - m])
        return N, friction, margin

    def _slid(self, N: Vector) -> Vector:
        """Friction of what slides."""
        slips, mu = self.flags.slips, self.contacts.mu
        return [neg(mul(slips.get(i), mul(mu.get(i), n))) for i, n in enumerate(N)]

    def _pressed_by_contact(
        self, right: Vector, tangential: Vector, sticks: bool
    ) -> tuple[Vector, Vector, Term]:
        """Forces of many contacts: one after the other, few of which share a link."""
        m, contacts = len(self.gaps), self.contacts
        compliance, held = self.reduced.contacts.compliance, contacts.mu if sticks else {}
        rows = [r for i in self._order() for r in (m + i, i) if r < m or i in held]
        drags = {
            k: mul(self.flags.slips[r], contacts.mu[r])
            for k, r in enumerate(rows)
            if r in contacts.mu
        }
        found, margin = solve_dragged(
            [[self._yielding(r, c) for c in rows] for r in rows],
            [right[r] if r < m else neg(tangential[r - m]) for r in rows],
            drags,
            [contacts.active[r] for r in rows],
            {} if sticks else {k: [compliance[r][m + rows[k]] for r in rows] for k in drags},
        )
        forces = dict(zip(rows, found, strict=True))
        N = [forces[i] for i in range(m)]
        return N, [forces.get(m + i) for i in range(m)] if sticks else self._slid(N), margin

    def _order(self) -> list[int]:
        """The contacts by how many others they are coupled to when those before are eliminated."""
        m = len(self.gaps)
        rest = {
            i: {
                k
                for k in range(m)
                if k != i
                and any(
                    x is not None for r in self.reduced.contacts.compliance[i::m] for x in r[k::m]
                )
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
        """Free motion with impulses of all rows, including friction in ideal joints."""
        m, rubbing = len(self.gaps), self.contacts.frictional
        T = [impulses[m + i] if i in rubbing else None for i in range(m)]
        a, closing = self.reduced.pushed(self.reduced.exact, list(impulses))
        return Solved(a, list(impulses[:m]), T, closing)

    def compressed(self, i: int) -> tuple[Term, Term, Term]:
        """Depth of a closed compliant contact, its rate, and ``|dy/d distance|``.

        Open contacts count as 1 m deep: no power of zero has a Taylor series.
        """
        s, jet = self.flags.closed[i], self.contacts.normal[i]
        value = s * jet.value
        stretch = self.gaps[i].stretch(value)
        depth = self.gaps[i].depth(value) + (1.0 - s)
        symbol = hy.make_vars(f'depth{i}')  # in long expressions only symbols are found again
        self.depths[symbol] = depth
        return symbol, neg(mul(s, jet.rate)) / stretch, stretch

    def relief(self, i: int) -> hy.expression:
        """Term with the sign of the force of a closed compliant contact [m/s]."""
        law = self.contacts.laws[i]
        if law is None:
            raise ValueError('a compliant contact has a law')
        return dense(law.relief(self.compressed(i)[1], self.flags.approach[i]))

    def held(self, i: int) -> hy.expression:
        """Positive while the mode of a closed compliant contact, force or recovery, lasts.

        It falls through zero with the depth, and where the force vanishes or sets in again.
        """
        sign = 2.0 * self.flags.presses[i] - 1.0
        return self.compressed(i)[0] * (
            (self.flags.margin + sign * self.relief(i)) / self.flags.approach[i]
        )

    def _pushed(self, tangential: Vector) -> tuple[Vector, Vector]:
        """Forces of compliant contacts along their rows, and Coulomb's friction.

        ``T = -mu N sign(v)`` where they slide; where they stick, what keeps ``dv/dt = 0`` with the
        second derivatives `tangential` of the slips without contact forces.
        """
        m = len(self.gaps)
        N: Vector = []
        T: Vector = [None] * m
        for i, law in enumerate(self.contacts.laws):
            if law is None:
                raise ValueError('a compliant contact has a law')
            depth, rate, stretch = self.compressed(i)
            force = law.normal_force(depth, rate, self.flags.approach[i])
            force = self.flags.closed[i] * (self.flags.presses[i] * force)
            N.append(force / stretch)
            if i in self.flags.slips:
                T[i] = neg(mul(self.flags.slips[i], mul(self.contacts.mu[i], force)))
        if self.contacts.frictional:
            held = [m + i for i in self.contacts.frictional]
            left = [
                add(tangential[r - m], dot(self.reduced.contacts.compliance[r], [*N, *T]))
                for r in held
            ]
            right = [neg(mul(self.contacts.active[r], x)) for r, x in zip(held, left, strict=True)]
            stuck = solve_symmetric(self._masked_compliance(held, held), [right])[0]
            for i, force in zip(self.contacts.frictional, stuck, strict=True):
                T[i] = add(T[i], force)
        return N, T

    @property
    def acceleration(self) -> Vector:
        """Second derivatives of the rows with the forces of the closed gaps."""
        forces = [*self.exact.N, *(self.exact.T if self.contacts.frictional else [])]
        return [
            add(free, dot(line, forces))
            for free, line in zip(
                self.free_acceleration, self.reduced.contacts.compliance, strict=True
            )
        ]

    def drive_torques(self, solved: Solved) -> Vector:
        """Torques of the drives that hold their law [N m, N]."""
        supplied = generalized_forces(self.equations, self.accelerations(solved))
        return [
            add(supplied[self.equations.coordinates.index(c)], neg(self.on_prescribed(k, solved)))
            for k, c in enumerate(self.prescribed)
        ]

    def on_prescribed(self, k: int, solved: Solved) -> Term:
        """Generalised force of contacts and closures on the k-th prescribed coordinate."""
        forces = [*solved.N, *(solved.T if self.contacts.frictional else [])]
        return add(
            self._pushes.get(self.prescribed[k]),
            *(
                mul(self.reduced.driven_row(j)[k], f)
                for j, f in zip(self.contacts.rows, forces, strict=True)
            ),
            *(
                mul(self.reduced.driven_row(j)[k], f)
                for j, f in zip(self.equations.relation_jets, solved.closing_forces, strict=True)
            ),
        )
