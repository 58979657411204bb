"""A machine whose motion is known: forces, energies and gaps along it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
import scipy

from mechanism_sim.arrays import Array, IndexArray
from mechanism_sim.engine.crossings import Crossings
from mechanism_sim.engine.dense_output import Motion, instants
from mechanism_sim.engine.events import drawn_in, ends_meet, leaves_pulley
from mechanism_sim.engine.observer import Instants, Observer, TouchTerms
from mechanism_sim.numerics.polynomials import TWO_PI, Nodes, PiecewisePolynomial, Times
from mechanism_sim.planar.frames import STATE
from mechanism_sim.planar.inverse_dynamics import Account, NoLimit, Observation
from mechanism_sim.planar.joint_friction import JointFriction
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import Directed, EndGap, WrappedGap
from mechanism_sim.planar.switched_functions import Edges
from mechanism_sim.planar.switches import HOLDS
from mechanism_sim.tolerances import TOLERANCES

_MEET = TOLERANCES.steps.meet
_LOOKS = Nodes((0.0, 0.25, 0.5, 0.75, 1.0))
"""Positions within a step at which the ends of a spring are compared for a passage."""


class Physics(ABC):
    """Forces, energies and gaps of a machine of any level along its motion."""

    joints: tuple[str, ...]  #: names of all joints
    clearances: tuple[str, ...] = ()  #: names of the joints with clearance
    tilting: tuple[str, ...] = ()  #: joints that take moments out of the plane, or forces
    driven: tuple[str, ...]
    """Names of the coordinates with a drive, in the order of ``Observation.drive_torque``."""
    unknowns: Mapping[str, str] = MappingProxyType({})
    """Units of the loads whose sizes follow from the motion, by name."""
    undetermined: Mapping[str, frozenset[str]]
    """Parts of the forces in joints that redundant constraints leave open, by joint.

    Among ``x``, ``y`` and ``moment``; an `Observation` has some value of them.
    """
    frictions: Mapping[str, JointFriction]  #: friction in ideal joints, by joint
    has_forces: bool = True  #: true if forces and energies are known, not only motion
    size: float  #: size of the mechanism [m], to which the rounding of positions is relative
    lifting_energy: float  #: [J] of the terms of a potential energy, see `Mechanism`
    lifting_power: float  #: [W], see `Mechanism`

    def __init__(self, mechanism: Mechanism, undetermined: Mapping[str, frozenset[str]]) -> None:
        self.undetermined, self.coordinates = undetermined, mechanism.coordinates
        self.joints = tuple(joint.name for joint in mechanism.joints)
        self.displacements = mechanism.displacements
        self.size, self.lifting_energy = mechanism.size, mechanism.lifting_energy
        self.lifting_power = mechanism.lifting_power

    def observe(self, motion: Motion, segments: IndexArray, dt: Times) -> Observation:
        """The machine at times `dt` after the start of `segments`.

        `segments` (N,) with `dt` (N,) [s] are N instants; with `dt` (N, K) or `Nodes` K in each.
        """
        seen = self._observe(motion, segments, dt)
        return seen.with_turns(motion.curve.turns_at(segments, dt).T)

    @abstractmethod
    def _observe(self, motion: Motion, segments: IndexArray, dt: Times) -> Observation:
        """Observation without whole turns."""

    @abstractmethod
    def moved(self, motion: Motion, segments: IndexArray, dt: Times) -> tuple[Array, Array]:
        """Coordinates without whole turns and rates (n, N), as observed, independent of forces."""

    def open_gaps(self, motion: Motion, segments: IndexArray, dt: Times) -> Array:
        """Gaps (m, N) [m] independent of forces, infinite where closed."""
        return np.zeros((0, motion.closed_at(segments, dt).shape[1]))

    @abstractmethod
    def account(self, motion: Motion, segments: IndexArray, dt: Times) -> Account:
        """Terms of the energy balance; powers and forces count only where `has_forces`.

        `closure_error` is the largest distance [m] from zero: of closed gaps, and of what is left
        open where loops close.
        """

    @property
    @abstractmethod
    def takes_power(self) -> bool:
        """True if springs, dampers, films or loads take any power."""

    @abstractmethod
    def load_power(self, motion: Motion, segments: IndexArray, dt: Times) -> Array:
        """Power (N,) [W] that springs, dampers, films and loads take, if they do.

        It follows from positions and rates alone; where it may be steep, it is no part of
        `account`.
        """

    def check_directions(self, motion: Motion) -> None:  # noqa: B027
        """Refuse a motion in which ends of a spring meet, or a rope leaves a pulley.

        Without forces there is nothing to refuse.
        """

    @property
    @abstractmethod
    def steep(self) -> bool:
        """True if powers may vary too steeply within a segment for a Taylor series."""

    @property
    def corners(self) -> bool:
        """True if powers have corners within segments, where friction's normal force is zero.

        Integrated steps end there.
        """
        return False

    def switch_parts(self, motion: Motion, segments: IndexArray, dt: Times) -> dict[str, Array]:
        """Part (N,) of each load that depends on rates, by its switch; none if prescribed."""
        return {}

    @abstractmethod
    def no_limits(self, motion: Motion) -> list[NoLimit]:
        """Instants of unbounded forces, at which they are NaN: those at singular positions."""


def is_force_open(undetermined: Mapping[str, frozenset[str]], joint: str) -> bool:
    """True if redundant constraints leave open a joint's force itself, not its moment alone."""
    return not {'x', 'y'}.isdisjoint(undetermined.get(joint, ()))


def known_wrench(physics: Physics, observed: Observation, joint: str) -> Array:
    """Force x, y [N] and moment [N m] in a joint (3, N), as observed; NaN where not known."""
    if not physics.has_forces:
        return np.full((3, observed.position.shape[1]), np.nan)
    i, open_ = physics.joints.index(joint), physics.undetermined.get(joint, ())
    wrench = np.vstack([observed.reaction[i], observed.reaction_moment[i]])
    wrench[[part in open_ for part in ('x', 'y', 'moment')]] = np.nan
    return wrench


class DynamicPhysics(Physics):
    """Equations of motion: accelerations and forces follow from state and mode of contact."""

    def __init__(
        self,
        observer: Observer,
        undetermined: Mapping[str, frozenset[str]] = MappingProxyType({}),
        main: str | None = None,
    ) -> None:
        """Physics of a system; `main` is the coordinate whose position observations have."""
        super().__init__(observer.system.mechanism, undetermined)
        self.observer = observer
        self.system = system = observer.system
        self.driven = (*system.prescribed, *system.powered)
        rubbing = [joint.friction for joint in system.dynamics.frictional_joints]
        self.frictions = {friction.name: friction for friction in rubbing}
        self._main = system.coordinates.index(main or (*self.driven, *system.coordinates)[0])
        self.clearances = tuple(gap.name for gap in system.gaps)
        self._directed = [e for e in system.elements if isinstance(e, Directed) and e.jumps]
        self._wrapped = [gap for gap in system.gaps if isinstance(gap, WrappedGap)]
        self.tilting = tuple(
            dict.fromkeys(gap.joint for gap in system.gaps if isinstance(gap, EndGap))
        )

    def _observe(self, motion: Motion, segments: IndexArray, dt: Times) -> Observation:
        """Observation without whole turns; near singular positions with the limits of forces."""
        seen = self.observer.observe(self.inputs(motion, segments, dt))
        crossings = self._crossings(motion, segments)
        if not crossings or not crossings.segments.size:
            return seen
        each, since = each_instant(motion.curve, segments, dt)
        near = np.flatnonzero(crossings.near(each, since))
        if near.size:
            found = crossings.limits(each[near], since[near], lambda k, t: _stacked(
                self.observer.observe(self.inputs(motion, k, t))
            ))  # fmt: skip
            sizes = [np.size(x[..., 0]) for x in _limited(seen)]
            for field, rows in zip(
                _limited(seen), np.split(found, np.cumsum(sizes)[:-1]), strict=True
            ):
                field[..., near] = rows.reshape(*field.shape[:-1], near.size)
        power = (seen.drive_torque * seen.velocity[self.system.driven_index]).sum(axis=0)
        return seen._replace(drive_power=power)

    def _crossings(self, motion: Motion, segments: IndexArray) -> Crossings | None:
        """Crossings of singular positions in the segments; None without loop closures."""
        system = self.system
        if not system.relations:
            return None
        free = [system.coordinates.index(c) for c in system.free]
        return Crossings(
            motion,
            segments,
            free,
            lambda k, t: self.observer.gaps.closure_distance(motion.curve.local(k, t).T)[0][0],
        )

    def account(self, motion: Motion, segments: IndexArray, dt: Times) -> Account:
        """Terms of the energy balance."""
        return self.observer.account(self.inputs(motion, segments, dt))

    def check_directions(self, motion: Motion) -> None:
        """Refuse a motion in which ends of a spring meet that must not, or a rope leaves a pulley.

        A series does not end where the length is zero: it continues to negative lengths.
        """
        if not (self._directed or self._wrapped) or not len(motion):
            return
        curve = motion.curve
        q, v = self.moved(motion, np.arange(len(motion)), _LOOKS)
        for gap in self._wrapped:
            self._check_rope(gap, curve, q, v)
        for e in self._directed:
            x, y = e.between(q).reshape(2, len(motion), len(_LOOKS))
            past = x[:, 1:] * x[:, :-1] + y[:, 1:] * y[:, :-1] <= 0.0
            for k, look in np.argwhere(past).tolist():
                before, since = (
                    float(curve.duration[k] * part) for part in _LOOKS.fractions[look : look + 2]
                )
                line = curve, k, e, np.array([x[k, look], y[k, look]])
                # else they meet at this very look, but for rounding
                if _ahead(since, *line) < 0.0:
                    since = scipy.optimize.brentq(_ahead, before, since, line)
                x0, y0 = e.between(curve.local(np.array([k]), np.array([since])).T)[:, 0].tolist()
                if math.hypot(x0, y0) < _MEET * self.system.mechanism.size:  # else beside it
                    raise ends_meet(e.name, float(curve.start[k]) + since)

    def _check_rope(self, gap: WrappedGap, curve: PiecewisePolynomial, q: Array, v: Array) -> None:
        """Refuse a stretch of negative length, and a pulley that turns no rope.

        As the root of a square, a length that falls below zero would seem to rise again.
        """
        shape = len(curve.duration), len(_LOOKS)
        ahead = 1e-4 * np.repeat(curve.duration, len(_LOOKS))
        now, least = gap.lengths(q), _MEET * self.system.mechanism.size
        falls = (gap.lengths(q + ahead * v) < now).reshape(-1, *shape)
        for stretch, k, look in np.argwhere(falls[:, :, :-1] & ~falls[:, :, 1:]).tolist():
            within = curve.duration[k] * np.array(_LOOKS.fractions[look : look + 2])

            def length(dt: float, k: int = k, stretch: int = stretch) -> float:
                return float(gap.lengths(curve.local(np.array([k]), np.array([dt])).T)[stretch, 0])

            found = scipy.optimize.minimize_scalar(
                length, bounds=within, method='bounded', options={'xatol': 1e-9 * within[1]}
            )
            if found.fun < least:
                raise drawn_in(gap.name, float(curve.start[k] + found.x))
        for _, k, look in np.argwhere(now.reshape(falls.shape) < least)[:1].tolist():
            since = curve.duration[k] * _LOOKS.fractions[look]
            raise drawn_in(gap.name, float(curve.start[k] + since))
        for pulley, arc in gap.arcs(q).items():
            leaps = np.abs(np.diff(arc.reshape(shape), axis=1)) > math.pi
            for k, look in np.argwhere(leaps)[:1].tolist():
                since = curve.duration[k] * _LOOKS.fractions[look]
                raise leaves_pulley(gap.name, pulley, float(curve.start[k] + since))

    @property
    def takes_power(self) -> bool:
        """True if springs, dampers, films or loads take any power."""
        return self.observer.takes_power

    @property
    def steep(self) -> bool:
        """True if loads or contacts may be steep within a step."""
        return self.observer.steep

    def load_power(self, motion: Motion, segments: IndexArray, dt: Times) -> Array:
        """Power (N,) [W] that springs, dampers, films and loads take."""
        return self.observer.load_power(self.inputs(motion, segments, dt))

    def touch(self, motion: Motion, segments: IndexArray, dt: Times) -> TouchTerms:
        """Compliant contacts at times `dt` after the start of `segments`."""
        return self.observer.touch(self.inputs(motion, segments, dt))

    def moved(self, motion: Motion, segments: IndexArray, dt: Times) -> tuple[Array, Array]:
        """Coordinates without whole turns, and rates (n, N)."""
        curve = motion.curve
        if isinstance(dt, Nodes):
            return curve.at_nodes(segments, dt)
        position, rate = curve.locals(segments, dt, (0, 1))
        return position.T, rate.T

    def inputs(self, motion: Motion, segments: IndexArray, dt: Times) -> Instants:
        """Instants as `Observer.observe` takes them, angles without their whole turns."""
        curve, driven = motion.curve, self.system.prescribed_index
        q, v = self.moved(motion, segments, dt)
        names = self.system.outside
        steady = self.system.degree <= 1
        powered = self.system.driven_index[len(driven) :]
        torque = np.zeros((0, q.shape[1]))
        if powered:
            constant, per_angle, per_speed = motion.torques_at(segments, dt).transpose(1, 0, 2)
            angle = q[powered] + TWO_PI * curve.turns_at(segments, dt).T[powered]
            torque = constant + per_angle * angle + per_speed * v[powered]
        none = np.zeros((len(driven), q.shape[1]))
        return Instants(
            q,
            v,
            none if steady else curve.local(segments, dt, 2).T[driven],
            motion.modes_at(segments, dt),
            torque,
            motion.approach_at(segments, dt),
            outside(names, self.coordinates, curve, segments, dt, motion.state_curve),
            self._rows(motion, segments, dt),
            self._sides(motion, segments, dt),
        )

    def _rows(self, motion: Motion, segments: IndexArray, dt: Times) -> Array | None:
        """Values of the switches: those of rates as they were, others by their places."""
        curve, states = motion.curve, motion.state_curve
        found = rows(self.system.edges, self.coordinates, curve, segments, dt, states)
        if found is not None and motion.acting.size:
            flags, holds = self.system.set_valued.holding_rows
            acting = np.repeat(motion.acting[segments, : len(flags)], instants(dt), axis=0).T
            found[flags], found[holds] = acting % HOLDS, acting == HOLDS
        return found

    def _sides(self, motion: Motion, segments: IndexArray, dt: Times) -> Array:
        """Signs (k, N) of the normal forces of joints with friction."""
        count = len(self.system.parameters.sides)
        if not count:
            return np.zeros((0, len(segments) * instants(dt)))
        own = motion.acting[segments, -count:].astype(float)
        found: Array = 2.0 * np.repeat(own, instants(dt), axis=0).T - 1.0
        return found

    def open_gaps(self, motion: Motion, segments: IndexArray, dt: Times) -> Array:
        """The gaps (m, N) [m] at times `dt` in `segments`, infinite where closed."""
        curve, (q, _) = motion.curve, self.moved(motion, segments, dt)
        edges, states = self.system.edges, motion.state_curve
        known = rows(edges, self.coordinates, curve, segments, dt, states)
        beside = outside(self.system.outside, self.coordinates, curve, segments, dt, states)
        gaps = self.observer.gaps.distances(self.observer.gaps.values(q, beside, known))
        return np.where(motion.closed_at(segments, dt), np.inf, gaps)

    def switch_parts(self, motion: Motion, segments: IndexArray, dt: Times) -> dict[str, Array]:
        """Part (N,) of each load that depends on rates, by the name of its switch."""
        names = [*self.system.equations.frames.switches]
        if not self.system.set_valued.holding:
            return {}
        parts = self.observer.parts(self.inputs(motion, segments, dt))
        return dict(zip([names[k] for k in self.system.set_valued.holding], parts, strict=True))

    def no_limits(self, motion: Motion) -> list[NoLimit]:
        """Instants of unbounded forces: those at singular positions."""
        crossings = self._crossings(motion, np.arange(len(motion)))
        if not crossings or not crossings.segments.size:
            return []
        segments, dt = crossings.segments, crossings.touch
        seen = self.observe(motion, segments, dt)
        found = []
        for k, (segment, since) in enumerate(zip(segments, dt, strict=True)):
            forces = zip(self.joints, seen.reaction[:, :, k], strict=True)
            joints = tuple(j for j, force in forces if not np.isfinite(force).all())
            if joints and since <= motion.curve.duration[segment]:
                drive = float(seen.position[self._main, k])
                found.append(NoLimit(float(motion.curve.start[segment] + since), drive, joints))
        return found


def _ahead(dt: float, curve: PiecewisePolynomial, k: int, line: Directed, way: Array) -> float:
    """Lead of the second end of a line over the first, times an earlier vector [m^2]."""
    q = curve.local(np.array([k]), np.array([dt])).T
    return float(way @ line.between(q)[:, 0])


def _limited(seen: Observation) -> tuple[Array, ...]:
    """Fields that are not determined at singular positions."""
    return (
        seen.acceleration, seen.normal_force, seen.friction_force, seen.reaction,
        seen.reaction_moment, seen.drive_torque,
    )  # fmt: skip


def _stacked(seen: Observation) -> Array:
    """Stack the fields of an observation that have limits in rows (M, N)."""
    return np.concatenate([x.reshape(-1, x.shape[-1]) for x in _limited(seen)])


def each_instant(
    curve: PiecewisePolynomial, segments: IndexArray, dt: Times
) -> tuple[IndexArray, Array]:
    """The segment of every instant, and the time since its start [s], in the order of samples."""
    if isinstance(dt, Nodes):
        dt = np.outer(curve.duration[segments], dt.fractions)
    return np.repeat(segments, instants(dt)), dt.ravel()


def rows(
    edges: Edges | None,
    coordinates: Sequence[str],
    curve: PiecewisePolynomial,
    segments: IndexArray,
    dt: Times,
    states: PiecewisePolynomial | None = None,
) -> Array | None:
    """Values (k, N) of the switches, constant over the whole segment of an instant.

    Where an instant lies on an edge, its place could not tell; the instants are those of
    ``curve.at(segments, dt)``, `coordinates` its columns. None without switches.
    """
    if edges is None:
        return None
    zero, half = np.zeros(len(segments)), 0.5 * curve.duration[segments]
    begun = curve.coefficients[segments, :, :2]  # values and rates at the start
    start, middle = (
        np.concatenate([*moved, outside(edges.outside, coordinates, curve, segments, t, states)])
        for moved, t in (
            ((begun[:, :, 0].T, begun[:, :, 1].T), zero),
            ([x.T for x in curve.locals(segments, half, (0, 1))], half),
        )
    )
    found = edges.within(start, middle)
    return np.repeat(found, instants(dt), axis=1)


def outside(
    names: Sequence[str],
    coordinates: Sequence[str],
    curve: PiecewisePolynomial,
    segments: IndexArray,
    dt: Times,
    states: PiecewisePolynomial | None = None,
) -> Array:
    """Rows (k, N) of the quantities of loads beside the coordinates, see `Frames.outside`.

    The instants are those of ``curve.at(segments, dt)``.
    """
    each, since = each_instant(curve, segments, dt)
    rows, values = [], None
    for name in names:
        if name.startswith(STATE) and states is not None:
            values = states.local(segments, dt).T if values is None else values
            rows.append(values[int(name.removeprefix(STATE))])
        elif name == 'time':
            rows.append(curve.start[each] + since)
        else:
            index = list(coordinates).index(name.rpartition('.')[0])
            rows.append(curve.turns[each, index].astype(float))
    return np.array(rows).reshape(len(rows), since.size)
