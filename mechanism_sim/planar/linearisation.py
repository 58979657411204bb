"""The equations of motion of a mechanism with ideal joints, linearised by exact derivatives.

Near a state (q, v, a) the residual ``F = M a + bias - Q(q, v) - J(q)^T lambda`` changes by
``M da + C dv + K dq - J^T dlambda``, with ``C = dF/dv``, and ``K = dF/dq`` in which the forces
lambda of the closures are constant. All derivatives are symbolic.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import heyoka as hy
import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.symbolic import Term, add, dense, dot, mul, neg
from mechanism_sim.planar.drive import TorqueLaw
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.motor import Motor
from mechanism_sim.planar.points import LinkPoint
from mechanism_sim.planar.protocols import ForceElement, Load, Relation
from mechanism_sim.planar.reactions import generalized_forces, tree_reactions
from mechanism_sim.planar.steep_loads import SteepLoads
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.planar.virtual_work import generalised
from mechanism_sim.tolerances import TOLERANCES

_MECHANISM = TOLERANCES.mechanism
_ROUNDING = 4.0 * float(np.finfo(float).eps)


class Excitation(NamedTuple):
    """Unit force or moment as excitation of a response."""

    point: LinkPoint
    direction: tuple[float, float] | None  #: unit vector in the world; None for a moment

    def load(self, size: hy.expression) -> Load:
        """Load of a magnitude [N, N m]."""
        if self.direction is None:
            return Load('excitation', *self.point, moment=size)
        x, y = self.direction
        return Load('excitation', *self.point, (x * size, y * size))


class Point(NamedTuple):
    """A state about which equations are linearised: n coordinates, c closure equations."""

    q: Array  #: (n,) coordinates [rad, m]
    v: Array  #: (n,) their rates
    forces: Array  #: (c,) forces of the closures [N]
    outside: Array  #: (k,) values of the inputs `Linearisation.outside`


class Linear(NamedTuple):
    """Equations of n coordinates near a point; rows and columns are in their order."""

    F: Array  #: (n,) residual with the forces of the closures [N m, N]
    closure: Array  #: (c,) residual of the closures [m]
    J: Array  #: (c, n) constraint Jacobian
    M: Array  #: (n, n) mass matrix
    C: Array  #: (n, n) damping and gyroscopic terms
    K: Array  #: (n, n) stiffness
    input: Array  #: (n,) generalised forces per unit of the excitation


class Linearisation:
    """The derivatives of a mechanism's equations of motion.

    Searches for points end in a FloatingPointError where forces or their slopes are not finite.

    Parameters
    ----------
    mechanism : the tree of links, n coordinates
    relations : its closures
    driven : coordinates whose motion is given
    torques : laws of the coordinates that a torque or a force moves
    elements : springs, dampers and loads
    motors : motors of coordinates among those in `torques`
    excitation : an external force, for `Linear.input`

    Attributes
    ----------
    free : indices of the coordinates that are not driven
    """

    def __init__(
        self,
        mechanism: Mechanism,
        relations: Sequence[Relation],
        driven: Sequence[str],
        torques: Sequence[TorqueLaw] = (),
        elements: Sequence[ForceElement] = (),
        motors: Sequence[Motor] = (),
        excitation: Excitation | None = None,
    ) -> None:
        self.coordinates = mechanism.coordinates
        self.free = [i for i, c in enumerate(self.coordinates) if c not in driven]
        self.scale = np.array(
            [mechanism.size if c in mechanism.displacements else 1.0 for c in self.coordinates]
        )
        self._relations, self._elements = tuple(relations), tuple(elements)
        self._torques, self._motors = tuple(torques), tuple(motors)
        self._size = hy.make_vars('excitation')
        self.equations = Equations(mechanism, relations=relations)
        self._forces, self._cut = self.equations.transmitted()
        frames = self.equations.frames
        self._loads = [x for e in self._elements for x in e.loads(frames)]
        if excitation:
            self._loads.append(excitation.load(self._size))

    @property
    def outside(self) -> tuple[str, ...]:
        """Names of inputs beside the motion: ``time``, ``COORDINATE.turns``."""
        self._function  # noqa: B018 - asks for all that is outside
        return tuple(self.equations.frames.outside)

    def _variables(self) -> list[hy.expression]:
        frames = self.equations.frames
        return [
            *frames.q.values(), *frames.v.values(), *frames.a.values(), *self._forces, self._size,
            *frames.outside.values(),
        ]  # fmt: skip

    @cached_property
    def _residual(self) -> list[Term]:
        """``M a + bias - Q - J^T lambda``, without the efforts of the driven coordinates."""
        eq = self.equations
        frames, applied = eq.frames, generalised(self._loads, eq.frames, eq.mechanism)
        for law in self._torques:
            constant, per_angle, per_speed = (
                frames.parameters(f'drives:{law.coordinate}.torque.{k}', x)
                for k, x in enumerate(law.coefficients)
            )
            c = law.coordinate
            torque = add(constant, mul(per_angle, frames.q[c]), mul(per_speed, frames.v[c]))
            applied[c] = add(applied.get(c), torque)
        for motor in self._motors:
            c = motor.coordinate
            applied[c] = add(applied.get(c), motor.torque(frames))
        rows = [jet.row(eq.coordinates) for jet in eq.relation_jets]
        closing = [dot([row[i] for row in rows], self._forces) for i in range(len(eq.coordinates))]
        needed = generalized_forces(eq, dict(frames.a))
        return [
            add(x, neg(applied.get(c)), neg(y))
            for c, x, y in zip(eq.coordinates, needed, closing, strict=True)
        ]

    @cached_property
    def _function(self) -> SwitchedFunction:
        eq, F = self.equations, self._residual
        frames = eq.frames
        groups = [
            F,
            [jet.value for jet in eq.relation_jets],
            eq.rows,
            *(_slopes(F, [*x.values()]) for x in (frames.a, frames.v, frames.q)),
            _slopes(F, [self._size]),
        ]
        return SwitchedFunction(frames, groups, self._variables())

    def _inputs(self, at: Point, a: Array) -> Array:
        return np.concatenate([at.q, at.v, a, at.forces, [0.0], at.outside])[:, None]

    def __call__(self, at: Point, a: Array | None = None) -> Linear:
        """Matrices at a point, where the accelerations are `a` (n,), or zero."""
        n = len(self.coordinates)
        none = np.zeros(n)
        found = self._function(self._inputs(at, none if a is None else a))
        F, closure, J, M, C, K, b = (x[:, 0] for x in found)
        return Linear(
            F, closure, J.reshape(-1, n), M.reshape(n, n), C.reshape(n, n), K.reshape(n, n), -b
        )

    @cached_property
    def _motion_function(self) -> SwitchedFunction:
        eq, F = self.equations, self._residual
        return SwitchedFunction(eq.frames, [F, eq.rows], self._variables())

    def _motion_inputs(self, at: Point, q: Array, v: Array, a: Array, t: Array) -> Array:
        fixed = np.concatenate([at.forces * 0.0, [0.0], at.outside])
        inputs = np.concatenate([q, v, a, np.repeat(fixed[:, None], q.shape[1], axis=1)])
        if 'time' in self.outside:
            inputs[len(inputs) - len(self.outside) + self.outside.index('time')] = t
        return inputs

    def along(self, at: Point, q: Array, v: Array, a: Array, t: Array) -> tuple[Array, Array]:
        """Residuals (n, N) without forces of closures, and J (N, c, n), along a motion.

        Parameters
        ----------
        at : point with all other values, taken as constant
        q, v, a : (n, N) coordinates, rates and accelerations
        t : (N,) [s]
        """
        F, rows = self._motion_function(self._motion_inputs(at, q, v, a, t))
        return F, rows.reshape(-1, len(q), q.shape[1]).transpose(2, 0, 1)

    @cached_property
    def steep(self) -> SteepLoads | None:
        """Loads by formulas, which may be steep somewhere; None without any."""
        self._motion_function  # noqa: B018 - asks for all switches
        eq = self.equations
        torques = [motor.torque(eq.frames) for motor in self._motors]
        if not (eq.frames.formulas or torques):
            return None
        return SteepLoads(eq.mechanism, eq.frames, self._elements, torques)

    def switches_along(self, at: Point, q: Array, v: Array, a: Array, t: Array) -> Array:
        """Values (k, N) of the switches of forces, along a motion as in `along`."""
        return self._motion_function.rows(self._motion_inputs(at, q, v, a, t))

    def point(self, q: Array, v: Array, outside: Array | None = None) -> Point:
        """Point without closure forces, at time and turns zero unless `outside` gives them."""
        given = np.zeros(len(self.outside)) if outside is None else outside
        return Point(q, v, np.zeros(len(self._forces)), given)

    def basis(self, J: Array) -> tuple[Array, list[int]]:
        """Basis of motions in the independent coordinates, with driven coordinates at rest.

        Returns
        -------
        B (n, f), and indices of the f independent coordinates, chosen for a well-conditioned B
        """
        n, free = len(self.coordinates), self.free
        scaled = J[:, free] * self.scale[free]
        if not (len(scaled) and free):
            return np.eye(n)[:, free], list(free)
        _, R, order = scipy.linalg.qr(scaled, mode='economic', pivoting=True)
        size = np.abs(np.diag(R))
        rank = int((size > 1e-10 * size[0]).sum())
        dependent = [free[i] for i in order[:rank]]
        independent = sorted(free[i] for i in order[rank:])
        B = np.eye(n)[:, independent]
        B[dependent] = -np.linalg.lstsq(J[:, dependent], J[:, independent])[0]
        return B, independent

    def equilibrium(self, at: Point) -> Point | None:
        """Point of equilibrium near another: no acceleration, driven coordinates unchanged.

        By Newton's method, downhill where the potential is not convex, so that what is found is
        stable if the forces have a potential. Rates stay too. None if there is no such point.
        """
        for _ in range(_MECHANISM.equilibrium):
            at, linear = self._finite(at)
            B, _ = self.basis(linear.J)
            g, K = B.T @ linear.F, reduced(linear.K, B)
            scale = 1.0 / np.abs(B / self.scale[:, None]).max(axis=0, initial=1e-300)
            g, K = scale * g, scale[:, None] * K * scale
            values, vectors = np.linalg.eigh((K + K.T) / 2.0)
            held = np.abs(values) > _MECHANISM.unheld * np.abs(values).max(initial=0.0)
            along = vectors.T @ g
            if (held & (values > 0.0)).all():
                step = -np.linalg.solve(K, g)
            else:
                along[~held] = 0.0
                step = -vectors @ (along / np.where(held, np.abs(values), 1.0))
            size = np.abs(step).max(initial=0.0)
            q = at.q + B @ (scale * step) * min(1.0, 0.5 / max(size, 1e-300))
            at = at._replace(q=q)
            if size <= 1e-14:
                break
        else:
            if size > _MECHANISM.force:
                return None
        at = self._closed(at)
        linear = self(at)
        left, parts = self.basis(linear.J)[0].T @ linear.F, self._largest_force(at, linear)
        return at if np.abs(left / parts).max(initial=0.0) <= _MECHANISM.force else None

    def towed(self, at: Point) -> Point:
        """Point whose driven coordinates rotate steadily, and with them those coupled by springs.

        These keep all forces as they are. Unchanged where no rates do.
        """
        if not at.v.any():
            return at
        _, linear = self._finite(at._replace(v=0.0 * at.v))
        K, B = linear.K, self.basis(linear.J)[0]
        left, size = B.T @ K @ at.v, np.abs(K).max(initial=0.0) * np.abs(at.v).max()
        if np.abs(left).max(initial=0.0) <= _MECHANISM.unheld * size:
            return at
        v = at.v - B @ np.linalg.lstsq(B.T @ K @ B, left, rcond=1e-12)[0]
        return at._replace(v=v) if np.abs(K @ v).max() <= _MECHANISM.force * size else at

    def turning(self, at: Point, main: int) -> Array:
        """Rates (n,) of a rotation that changes no force, with the rate of one coordinate 1.

        If there is none, the nearest: of all links coupled by springs and closures.
        """
        linear = self(self._closed(at))
        B, _ = self.basis(linear.J)
        size = np.abs(B / self.scale[:, None]).max(axis=0, initial=1e-300)
        unit = B / size
        K = unit.T @ linear.K @ unit
        K /= np.abs(K).max(initial=0.0) or 1.0
        rows, right = np.vstack([K, unit[main]]), np.zeros(len(K) + 1)
        right[-1] = 1.0
        rates = unit @ np.linalg.lstsq(rows, right, rcond=1e-12)[0]
        return np.asarray(rates / rates[main] if rates[main] else rates)

    def steady(self, at: Point, turned: Array) -> Point | None:
        """Point and speed of a steady rotation near given ones.

        By Newton's method. None if there is no such rotation.

        Parameters
        ----------
        at : initial guess; its rates are the initial speed times `turned`
        turned : (n,) rates at unit speed
        """
        for _ in range(_MECHANISM.equilibrium):
            at, linear = self._finite(at)
            B, _ = self.basis(linear.J)
            size = np.abs(B / self.scale[:, None]).max(axis=0, initial=1e-300)
            pace = max(1.0, float(np.abs(at.v).max()))
            unit = B / size
            slopes = np.column_stack([linear.K @ unit, pace * linear.C @ turned])
            step = -np.linalg.lstsq(unit.T @ slopes, unit.T @ linear.F, rcond=1e-12)[0]
            step *= min(1.0, 0.5 / max(np.abs(step).max(), 1e-300))
            at = at._replace(q=at.q + unit @ step[:-1], v=at.v + pace * step[-1] * turned)
            if np.abs(step).max() <= 1e-14:
                break
        at = self._closed(at)
        linear = self(at)
        B, _ = self.basis(linear.J)
        force = max(self._largest_force(at, linear), float(np.abs(linear.C @ at.v).max()))
        left = np.abs(B.T @ linear.F).max(initial=0.0)
        # turned on, it must stay what it is
        along = np.abs(B.T @ linear.K @ turned).max(initial=0.0)
        stiff = float(np.abs(linear.K).max(initial=0.0)) + force
        apart = np.abs(linear.J @ turned).max(initial=0.0)
        found = (
            left <= _MECHANISM.force * force
            and along <= _MECHANISM.force * stiff
            and apart <= _MECHANISM.force
        )
        return at if found else None

    def _largest_force(self, at: Point, linear: Linear) -> float:
        """Scale of generalised forces: the largest of stiffness and closures."""
        inertia = float(np.abs(linear.M).max(initial=0.0))
        stiff = float(np.abs(linear.K * self.scale).max(initial=0.0))
        held = float(np.abs(linear.J.T @ at.forces).max(initial=0.0))
        return max(stiff, held, inertia * 1e-3, 1e-300)

    def _finite(self, at: Point) -> tuple[Point, Linear]:
        """The nearest point with closed loops, and the equations there, if they are finite."""
        at = self._closed(at)
        linear = self(at)
        if not all(np.isfinite(x).all() for x in linear):
            raise FloatingPointError
        return at, linear

    def _closed(self, at: Point) -> Point:
        """The nearest point with closed loops, and the forces of the closures there."""
        if not self._relations:
            return at
        q = at.q.copy()
        for _ in range(_MECHANISM.equilibrium):
            linear = self(at._replace(q=q))
            step = np.linalg.lstsq(linear.J[:, self.free] * self.scale[self.free],
                                   -linear.closure)[0]  # fmt: skip
            q[self.free] += self.scale[self.free] * step
            if np.abs(step).max(initial=0.0) <= 1e-15:
                break
        bare = self(at._replace(q=q, forces=np.zeros_like(at.forces)))
        forces = np.linalg.lstsq(bare.J[:, self.free].T, bare.F[self.free])[0]
        return at._replace(q=q, forces=np.asarray(forces, np.float64))

    def reaction(self, joint: str, at: Point) -> tuple[Array, Array, Array, Array, Array]:
        """Derivatives of a joint's force (x, y) [N] by q, v, a (2, n), closures and excitation.

        The force is that of the first-named on the second-named link.
        """
        eq = self.equations
        frames = eq.frames
        wrench = tree_reactions(eq, dict(frames.a), self._cut, self._loads)[joint]
        groups = [
            _slopes([wrench.x, wrench.y], by)
            for by in (
                [*frames.q.values()], [*frames.v.values()], [*frames.a.values()], self._forces,
                [self._size],
            )
        ]  # fmt: skip
        found = SwitchedFunction(frames, groups, self._variables())(
            self._inputs(at, np.zeros(len(self.coordinates)))
        )
        q, v, a, f, size = (x[:, 0].reshape(2, -1) for x in found)
        return q, v, a, f, size


def reduced(matrix: Array, B: Array) -> Array:
    """``B^T matrix B``, 0 where its parts cancel, as of a spring beside a rigid joint."""
    found, parts = B.T @ matrix @ B, np.abs(B).T @ np.abs(matrix) @ np.abs(B)
    return np.where(np.abs(found) <= len(B) * _ROUNDING * parts, 0.0, found)


def _slopes(terms: Sequence[Term], by: Sequence[hy.expression]) -> list[Term]:
    """Derivatives of each term by each symbol, structural zeros as such."""
    found: list[Term] = []
    for term in terms:
        known = set() if term is None else set(hy.get_variables(dense(term)))
        found += [hy.diff(term, x) if str(x) in known else None for x in by]
    return found
