"""Forces from motion: reactions and drive torques of a mechanism whose motion is known."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
import scipy
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.errors import RunError
from mechanism_sim.numerics.compiled import COLUMNS
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.numerics.symbolic import Term, add, dense, dot, neg
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.joint_friction import (
    JointFriction,
    frictional_joints,
    solve_friction,
    with_friction,
)
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import ForceElement, Relation
from mechanism_sim.planar.reactions import energies, generalized_forces, tree_reactions
from mechanism_sim.planar.steep_loads import SteepLoads
from mechanism_sim.planar.switched_functions import Edges, SwitchedFunction
from mechanism_sim.planar.unknowns import Effort, UnknownLoad, Unknowns
from mechanism_sim.planar.virtual_work import generalised
from mechanism_sim.tolerances import TOLERANCES

_JOINT_FRICTION, _SWITCHES = TOLERANCES.joint_friction, TOLERANCES.switches


class Observation(NamedTuple):
    """A machine at N instants: n coordinates, j joints of which m have clearance, p drives."""

    position: Array  #: (n, N) coordinates [rad, m]
    velocity: Array  #: (n, N) [rad/s, m/s]
    acceleration: Array  #: (n, N) [rad/s^2, m/s^2]
    gap: Array  #: (m, N) [m]
    normal_force: Array  #: (m, N) [N]
    friction_force: Array  #: (m, N) [N] on the first-named link, along the tangent
    friction_power: Array  #: (N,) dissipation by sliding [W]
    reaction: Array  #: (j, 2, N) force of the first-named on the second-named link [N]
    reaction_moment: Array  #: (j, N) moment [N m], about the joint's point on the latter
    drive_torque: Array  #: (p, N) [N m, N] prescribed drives first
    drive_power: Array  #: (N,) [W]
    kinetic_energy: Array  #: (N,) [J]
    potential_energy: Array  #: (N,) [J]
    load: Array = np.zeros((0, 1))  #: (u, N) [N, N m] magnitudes of unknown loads
    without_turns: Array = np.zeros((0, 1))  #: (n, N) position less whole turns, if it has any

    @property
    def local(self) -> Array:
        """The position (n, N) without whole turns, from which positions and forces follow.

        An angle loses digits with every turn that it contains.
        """
        return self.without_turns if len(self.without_turns) else self.position

    @property
    def turns(self) -> Array:
        """Whole turns (n, N) that `local` leaves out."""
        turns: Array = np.round((self.position - self.local) / TWO_PI)
        return turns

    def with_turns(self, turns: NDArray[np.int64]) -> Observation:
        """Copy with whole turns (n, N) added to the position."""
        if not turns.any():
            return self
        return self._replace(position=self.position + TWO_PI * turns, without_turns=self.position)


class NoLimit(NamedTuple):
    """An instant of unbounded forces, or from which on they are not known."""

    t: float  #: [s]
    drive: float  #: position of the main drive [rad, m]
    joints: tuple[str, ...]  #: joints with unbounded forces
    rests: bool = False  #: whether drive or load rest for a while: forces are not determined
    loads: tuple[str, ...] = ()  #: loads without work there, whose sizes are not determined

    def is_at(self, t: float) -> bool:
        """True if the instant equals a time to rounding."""
        return abs(self.t - t) <= 1e-9 * max(abs(t), 1e-3)


class Account(NamedTuple):
    """Terms of the energy balance, at N instants: m joints with clearance."""

    normal_force: Array  #: (m, N) [N]
    friction_power: Array  #: (N,) dissipation in joints and contacts [W]
    drive_power: Array  #: (N,) [W]
    kinetic_energy: Array  #: (N,) [J]
    potential_energy: Array  #: (N,) [J]
    closure_error: float  #: [m] largest deviation of closed gaps and closures from zero
    load_power: Array | None = None
    """(N,) [W] that springs, dampers, films and loads take; None if none do, or where they are
    steep: see `Physics.load_power`"""


class InverseDynamics:
    """Joint forces and drive torques of a mechanism with ideal joints.

    ``M a + bias - Q = J^T lambda + torques`` with the generalised forces Q of loads is linear in
    the forces ``lambda`` of the joints that close loops and in the torques of the driven
    coordinates; the other joints follow link by link. Of closures that follow from one another the
    smallest forces are taken: what the equations determine does not depend on that.

    Parameters
    ----------
    mechanism : the tree of links
    relations : its cut joints
    driven : names of the coordinates with a drive
    elements : springs, dampers and loads
    frictions : friction in ideal joints
    inertia : True if ``M a`` and the velocity products count; statics leaves out these only, and
        keeps weights and speed-dependent loads
    unknowns : loads whose sizes follow from the efforts of as many drives
    efforts : given efforts of these drives, by coordinate
    """

    def __init__(
        self,
        mechanism: Mechanism,
        relations: Sequence[Relation],
        driven: Sequence[str],
        elements: Sequence[ForceElement] = (),
        frictions: Sequence[JointFriction] = (),
        inertia: bool = True,
        unknowns: Sequence[UnknownLoad] = (),
        efforts: Mapping[str, Effort] | None = None,
    ) -> None:
        self.mechanism = mechanism
        self._inertia = inertia
        self.relations = tuple(relations)
        self.elements = tuple(elements)
        self._driven = [mechanism.coordinates.index(c) for c in driven]
        self.equations = Equations(mechanism, relations=relations)
        frames = self.equations.frames
        self._loads = [x for e in elements for x in e.loads(frames)]
        self.unknowns = Unknowns(mechanism, frames, unknowns, efforts or {}, driven)
        supplied = [e for e in (efforts or {}).values() if isinstance(e, ForceElement)]
        self._given = [*elements, *supplied]
        self.frictions = {friction.name: friction for friction in frictions}
        self._frictional_joints = frictional_joints(frictions, frames)
        self._loads += [load for joint in self._frictional_joints for load in joint.loads]

    @property
    def outside(self) -> tuple[str, ...]:
        """Names of inputs beside the motion: ``time``, ``COORDINATE.turns``."""
        return tuple(self.equations.frames.outside)

    @property
    def formulas(self) -> set[str]:
        """Names of the loads that formulas give, which may be out of their range."""
        return self.equations.frames.formulas

    @cached_property
    def steep(self) -> SteepLoads | None:
        """Loads and given efforts that may be steep somewhere; None without any."""
        if not self.formulas:
            return None
        found = SteepLoads(self.mechanism, self.equations.frames, self._given)
        return found if found.enclosure.count else None

    @cached_property
    def edges(self) -> Edges | None:
        """Finder of changes of closures and loads along a motion; None without changes."""
        frames = self.equations.frames
        return Edges(frames) if frames.switches else None

    @cached_property
    def _taken(self) -> Term:
        return add(*(x.power_lost(self.equations.frames) for x in self.elements))

    @property
    def takes_power(self) -> bool:
        """True if springs, dampers or loads take any power."""
        return self._taken is not None

    @property
    def loses_more(self) -> bool:
        """True if friction in joints, or unknown loads, take further power."""
        return bool(self._frictional_joints or self.unknowns.sizes)

    @cached_property
    def _load_power(self) -> SwitchedFunction:
        frames = self.equations.frames
        motion = [*frames.q.values(), *frames.v.values(), *frames.outside.values()]
        return SwitchedFunction(frames, [[self._taken]], motion)

    def load_power(self, q: Array, v: Array, outside: Array, rows: Array | None = None) -> Array:
        """Power (N,) [W] that springs, dampers and loads take."""
        found: Array = self._load_power(np.concatenate([q, v, outside]), rows)[0][0]
        return found

    @cached_property
    def _functions(self) -> tuple[SwitchedFunction, SwitchedFunction]:
        """Functions: required efforts with closure rows; joint forces from closure forces."""
        eq = self.equations
        frames, a = eq.frames, dict(eq.frames.a)
        accelerated = a if self._inertia else None
        applied = generalised(self._loads, frames, self.mechanism)
        supplied = [
            add(x, neg(applied.get(c)))
            for c, x in zip(eq.coordinates, generalized_forces(eq, accelerated), strict=True)
        ]
        closing, cut = eq.transmitted()
        sizes = self.unknowns.sizes
        loads = [*self._loads, *self.unknowns.acting]
        carried = tree_reactions(eq, accelerated, cut, loads)
        wrenches = with_friction(self._frictional_joints, carried, frames).values()
        forces = [x for w in wrenches for x in (w.x, w.y)]
        moments = [w.moment for w in wrenches]
        kinetic, potential = energies(eq)
        potential = add(potential, *(e.energy(frames) for e in self.elements))
        lost = add(
            *(x.power_lost(frames) for x in self.elements),
            *(x.power_lost for x in self._frictional_joints),
        )
        motion = [*frames.q.values(), *frames.v.values(), *a.values(), *frames.outside.values()]
        motion += [joint.T for joint in self._frictional_joints]
        groups = [supplied, eq.rows, self.unknowns.terms] if sizes else [supplied, eq.rows]
        first = SwitchedFunction(frames, groups, motion)
        balance = [kinetic, potential, lost]
        groups = [forces, moments, balance]
        if self._frictional_joints:
            bounds = [
                r.friction.pressed(frames, carried[r.friction.name])
                for r in self._frictional_joints
            ]
            self._sizes = [[(len(p.components), p.wall) for p in bound] for bound in bounds]
            groups += [
                [x for bound in bounds for p in bound for x in p.components],
                [x for bound in bounds for p in bound for x in (p.coefficient, p.resolution)],
                [1.0 - 2.0 * dense(joint.switch.flag) for joint in self._frictional_joints],
                [joint.slip.rate for joint in self._frictional_joints],
                [
                    add(r.slip.curvature, dot(r.slip.row(eq.coordinates), [*a.values()]))
                    for r in self._frictional_joints
                ],
            ]
        second = SwitchedFunction(frames, groups, [*motion, *closing, *sizes])
        return first, second

    @cached_property
    def _damping(self) -> SwitchedFunction:
        frames = self.equations.frames
        loads = [x for e in self.elements for x in e.loads(frames)]
        forces = generalised(loads, frames, self.mechanism)
        terms = [dense(neg(forces.get(c))) for c in self.mechanism.coordinates]
        slopes = [hy.diff(x, v) for x in terms for v in frames.v.values()]
        motion = [*frames.q.values(), *frames.v.values(), *frames.outside.values()]
        return SwitchedFunction(frames, [slopes], motion)

    def damping(self, q: Array, v: Array) -> Array:
        """Damping matrix of springs, dampers and loads, (n, n, N) ``-dQ/dv``.

        Only for forces Q that depend on the motion alone.

        Parameters
        ----------
        q, v : (n, N) angles [rad] or displacements [m], and rates
        """
        none = np.zeros((len(self.outside), q.shape[1]))
        (found,) = self._damping(np.concatenate([q, v, none]))
        return found.reshape(len(q), len(q), -1)

    def __call__(
        self,
        q: Array,
        v: Array,
        a: Array,
        outside: Array | None = None,
        rows: Array | None = None,
    ) -> Observation:
        """Forces and energies at N instants; forces are NaN at a singular position.

        Parameters
        ----------
        q, v, a : (n, N) angles [rad] or displacements [m], rates, accelerations
        outside : (k, N) values of the inputs `outside`
        rows : (k, N) values of the switches; by default those at these positions
        """
        count = q.shape[1]
        given = np.zeros((len(self.outside), count)) if outside is None else outside
        if count > COLUMNS:
            blocks = [slice(i, i + COLUMNS) for i in range(0, count, COLUMNS)]
            parts = [
                self(q[:, b], v[:, b], a[:, b], given[:, b], None if rows is None else rows[:, b])
                for b in blocks
            ]
            return Observation(*(np.concatenate(x, axis=-1) for x in zip(*parts, strict=True)))
        motion = np.concatenate([q, v, a, given])
        T = (
            self._friction_forces(motion, rows)
            if self._frictional_joints
            else np.zeros((0, count))
        )
        unknown, sizes, (forces, moments, balance, *_) = self._solved(motion, T, rows)
        closures = len(self.equations.relation_jets)
        joints = len(self.mechanism.joints)
        none = np.zeros((0, count))
        torque = np.asarray(unknown[closures:], np.float64)
        supplying = power(torque, v[self._driven])
        return Observation(
            q,
            v,
            a,
            none,
            none,
            none,
            balance[2],
            forces.reshape(joints, 2, count),
            moments,
            torque,
            supplying,
            balance[0],
            balance[1],
            sizes,
        )

    def _solved(
        self, motion: Array, T: Array, rows: Array | None
    ) -> tuple[Any, Array, list[Array]]:
        """Forces of closures and drives, sizes of loads, and more, under frictions T (m, N)."""
        first, second = self._functions
        n, count = len(self.mechanism.coordinates), motion.shape[1]
        motion = np.concatenate([motion, T])
        supplied, closing, *terms = first(motion, rows)
        matrix = self._matrix(closing, count)
        unknown = _balanced(matrix, supplied.T)
        sizes = np.zeros((0, count))
        if terms:
            unknown, sizes = self.unknowns.solve(matrix, unknown, *terms)
        closures = matrix.shape[2] - len(self._driven)
        known = [motion, unknown[:closures], sizes]
        found = second(np.concatenate(known), rows)
        if terms:
            v = motion[n : 2 * n]
            fed = self.unknowns.power(v, sizes, *terms)
            supplying = power(unknown[closures:], v[self._driven])
            balanced = (v * supplied).sum(axis=0) - supplying  # where they have no size
            found[2][2] -= np.where(np.isnan(fed), balanced, fed)
        return unknown, sizes, found

    def _friction_forces(self, motion: Array, rows: Array | None) -> Array:
        """Every T (m, N): ``-b sign(rate)``, zero where a joint rests for longer than an instant.

        Raises
        ------
        RunError
            Where the friction is so large that no forces keep up the motion.
        """
        m, count = len(self._frictional_joints), motion.shape[1]
        none = np.zeros((m, count))
        *_, (*_, start, numbers, ways, rates, onward) = self._solved(motion, none, rows)
        size = self.mechanism.size
        turns = np.array([x.friction.unit == 'N m' for x in self._frictional_joints])[:, None]
        rest = _SWITCHES.rest * np.where(turns, 1.0, size)
        ways = np.where((np.abs(rates) <= rest) & (np.abs(onward) <= rest), 0.0, ways)
        known = np.isfinite(start).all(axis=0)
        largest = np.abs(start, where=known, out=np.zeros_like(start)).max(axis=0)
        # small forces of links that are heavy, or have no mass, make friction as all others do
        least = np.where(largest > 0.0, _JOINT_FRICTION.resolution * largest, np.inf)
        numbers[1::2] = np.minimum(numbers[1::2], least)
        # forces are linear in T: differences by one as large as they are lose no digits
        steps = np.ldexp(1.0, np.frexp(np.where(turns, size, 1.0) * largest)[1])
        slopes = []
        for k in range(m):
            unit = none.copy()
            unit[k] = steps[k]
            slopes.append((self._solved(motion, unit, rows)[2][3] - start) / steps[k])
        T, sound = solve_friction(
            start[:, known], np.array(slopes)[:, :, known], numbers[:, known], ways[:, known],
            self._sizes,
        )  # fmt: skip
        if not sound.all():
            worst = motion[self._driven[0], np.flatnonzero(known)[sound.argmin()]]
            joints = ', '.join(
                dict.fromkeys(joint.friction.name for joint in self._frictional_joints)
            )
            name = self.mechanism.coordinates[self._driven[0]]
            place = (
                f'{1e3 * worst:.6g} mm'
                if name in self.mechanism.displacements
                else f'{math.degrees(worst) % 360.0:.6g} deg'
            )
            raise RunError(
                f'friction locks the machine, {name} at {place}: in {joints} no finite forces '
                'can maintain the motion; reduce the friction, or drive another link'
            )
        every = np.full((m, count), np.nan)
        every[:, known] = T
        return every

    def required(
        self, q: Array, v: Array, a: Array, outside: Array, rows: Array | None = None
    ) -> Array:
        """Generalised forces (n, N) that closures and drives together must supply."""
        none = np.zeros((len(self._frictional_joints), q.shape[1]))
        supplied: Array = self._functions[0](np.concatenate([q, v, a, outside, none]), rows)[0]
        return supplied

    def self_stresses(self, q: Array, rank: float) -> Array:
        """Forces x, y [N] and moments [N m] (k, j, 3) that joints may have without any load.

        One set for each closure that follows from others, the largest about one; beside forces
        between teeth those in the bearings of the wheels, of which a closure of angles says
        nothing.

        Parameters
        ----------
        q : (n,) position
        rank : share of the largest singular value below which closures are dependent
        """
        first, second = self._functions
        n, closures = len(q), len(self.equations.relation_jets)
        motion = np.zeros((3 * n + len(self.outside) + len(self._frictional_joints), 1))
        motion[:n, 0] = q
        transposed = self._matrix(first(motion)[1], 1)[0, :, :closures]
        slides = [c in self.mechanism.displacements for c in self.mechanism.coordinates]
        transposed *= np.where(slides, self.mechanism.size, 1.0)[:, None]
        null = scipy.linalg.null_space(transposed, rcond=rank)
        count = null.shape[1]
        sizes = np.zeros((len(self.unknowns.sizes), 1 + count))
        unknown = np.hstack([np.zeros((closures, 1)), null])
        every = np.concatenate([np.tile(motion, (1, 1 + count)), unknown, sizes])
        forces, moments, *_ = second(every)
        found = np.concatenate([forces.reshape(-1, 2, 1 + count), moments[:, None]], axis=1)
        found = (found[..., 1:] - found[..., :1]).transpose(2, 0, 1)
        weights = np.array([1.0, 1.0, 1.0 / self.mechanism.size])
        largest = np.abs(found * weights).max(axis=(1, 2), keepdims=True)
        return np.asarray(found / np.maximum(largest, 1e-300))

    def work_of_unknowns(
        self, q: Array, v: Array, a: Array, outside: Array, rows: Array | None = None
    ) -> Array:
        """See `Unknowns.work`, (N,)."""
        none = np.zeros((len(self._frictional_joints), q.shape[1]))
        motion = np.concatenate([q, v, a, outside, none])
        _, closing, terms = self._functions[0](motion, rows)
        matrix = self._matrix(closing, q.shape[1])
        singular = np.linalg.det(matrix) == 0.0
        matrix[singular] = np.eye(len(q))
        return np.where(singular, np.inf, self.unknowns.work(matrix, terms))

    def _matrix(self, rows: Array, count: int) -> Array:
        """``J^T`` beside the columns of the drives, (N, n, r + p) for r closures and p drives."""
        n = len(self.mechanism.coordinates)
        closures = len(self.equations.relation_jets)
        matrix = np.zeros((count, n, closures + len(self._driven)))
        matrix[:, :, :closures] = rows.reshape(closures, n, count).transpose(2, 1, 0)
        for k, i in enumerate(self._driven):
            matrix[:, i, closures + k] = 1.0
        return matrix


def _balanced(matrix: Array, supplied: Array) -> Any:
    """``A x = b`` (m, N) for N matrices (n, m), m >= n: the shortest; NaN if A is singular."""
    n, m = matrix.shape[1:]
    if n < m:  # A^T = Q R: of all solutions, that without a part across the rows of A
        q, r = np.linalg.qr(matrix.transpose(0, 2, 1))
        singular = np.abs(np.diagonal(r, axis1=1, axis2=2)).min(axis=1, initial=1.0) == 0.0
        r[singular] = np.eye(n)
        found = q @ np.linalg.solve(r.transpose(0, 2, 1), supplied[:, :, None])
    else:
        with suppress(np.linalg.LinAlgError):
            return np.linalg.solve(matrix, supplied[:, :, None])[:, :, 0].T
        singular = np.linalg.det(matrix) == 0.0
        matrix[singular] = np.eye(n)
        found = np.linalg.solve(matrix, supplied[:, :, None])
    unknown: Any = found[:, :, 0].T
    unknown[:, singular] = np.nan
    return unknown


def power(torque: Array, speed: Array) -> Array:
    """Power (N,) of drives (p, N) [W]: none at rest, even if the torque is not determined."""
    none = np.zeros(np.broadcast_shapes(torque.shape, speed.shape))
    return np.asarray(np.multiply(torque, speed, out=none, where=speed != 0.0).sum(axis=0))
