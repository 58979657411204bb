"""Motion of a document's machine without clearance, fast enough to follow a hand.

Loops are closed from the previous picture, at all instants of a turn at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.polynomial import polynomial

from mechanism_sim.arrays import Array
from mechanism_sim.editor.layout import coordinates
from mechanism_sim.editor.sketch import ORIGIN, Pose, Poses
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.export.stage import joints_json
from mechanism_sim.planar.configuration import poses as poses_of
from mechanism_sim.planar.drive import DriveLaw, Law
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.joint_view import JointView
from mechanism_sim.units import for_people

INSTANTS = 73
"""Number of instants of a turn, or of a run, both ends included."""

_STEPS = 12  # towards a place, of a machine that is pulled

UNSOLVED = InputError, RunError, ArithmeticError, np.linalg.LinAlgError
"""Errors where a machine cannot be assembled, or has no forces."""

_LEAP = 0.6
"""[rad], or sizes of the machine, by which no coordinate goes from one instant to the next."""


class IdealForces(NamedTuple):
    """Forces of J ideal joints at K instants, J' of them without a fixed point of action."""

    joints: list[dict[str, Any]]  #: as in `Stage.to_json`
    forces: Array  #: (K, J, 2) [N] force of the first on the second link
    feet: Array  #: (K, J', 2) [m] points on the lines of action


class _Known(NamedTuple):
    """Physics of an ideal machine, as required by a `JointView`."""

    coordinates: tuple[str, ...]
    joints: tuple[str, ...]
    undetermined: Mapping[str, frozenset[str]]
    has_forces: bool = True


class Turn:
    """A machine over a turn of its drive, or over its run, with closed loops.

    Parameters
    ----------
    near : initial guess of the poses; without it, the machine is assembled from its scene
    before : motion of a slightly different machine, as initial guess
    loops : loop closures of the machine, if already made
    """

    def __init__(
        self,
        machine: Machine,
        near: Mapping[str, Pose] | None = None,
        before: Turn | None = None,
        loops: Kinematics | None = None,
    ) -> None:
        self.machine = machine
        loops = loops or machine.plan.kinematics(())
        self.mechanism = loops.mechanism  #: spanning tree of the coordinates
        self._held = self._ways()
        self._kinematics = loops.holding([*self._held])
        if near is None:
            first = machine.assembly.q.copy()
        else:
            first = self._closed(coordinates(self.mechanism, near))
        #: (n, N) coordinates, first column at the start; fewer columns if the motion is blocked
        self.q = self._followed(first, before)

    @cached_property
    def start(self) -> Poses:
        """Poses of all links at the start."""
        return self.poses_at(0)

    def poses_at(self, k: int) -> Poses:
        """Poses of all links at one of the instants."""
        return self.poses_of(self.q[:, k])

    def reached(self, q: Array, link: str, at: Vector2, to: Vector2) -> Array:
        """Coordinates (n,) with closed loops, near others, with a point nearest to a target.

        Gauss-Newton iteration in the null space of the closures' Jacobian; other free
        coordinates change as little as possible.

        Parameters
        ----------
        at : point in the frame of the link [m]
        to : target in the world [m]
        """
        loops, tree = self._kinematics.released(), self.mechanism
        n, scale = len(q), loops.scale
        for _ in range(_STEPS):
            _, J = loops.closure(q[:, None])
            _, sizes, rows = np.linalg.svd(J[0] * scale)
            free = rows[int((sizes > 1e-9 * sizes.max(initial=0.0)).sum()) :].T
            beside = q[:, None] + 1e-7 * np.column_stack([np.zeros(n), np.diag(scale)])
            places = tree.locate_all(link, beside, at)
            slope = (places[:, 1:] - places[:, :1]) / 1e-7
            off = np.array(to) - places[:, 0]
            step = scale * (free @ (np.linalg.pinv(slope @ free, rcond=1e-3) @ off))
            step *= min(1.0, 0.3 / max(float(np.abs(step / scale).max(initial=0.0)), 1e-300))
            closed, left = loops.positions((q + step)[:, None])
            if left[0] or not np.isfinite(closed).all():
                break
            before, q = q, closed[:, 0]
            if np.abs((q - before) / scale).max(initial=0.0) < 1e-6:
                break
        return q

    def poses_of(self, values: Array) -> Poses:
        """Poses of all links at coordinates (n,)."""
        q = dict(zip(self.mechanism.coordinates, values.tolist(), strict=True))
        links = [body.name for body in self.mechanism.bodies]
        rows = poses_of(self.mechanism, q).tolist()
        found = {link: Pose(*row) for link, row in zip(links, rows, strict=True)}
        return {GROUND: ORIGIN, **found}

    @property
    def moves(self) -> bool:
        """True if the machine has a motion beyond the start."""
        return bool(self.q.shape[1] > 1)

    @property
    def scale(self) -> Array:
        """Scale of each coordinate (n,): the size of the machine [m], or 1 rad."""
        return self._kinematics.scale

    @property
    def along(self) -> tuple[str, Array]:
        """Name of the variable of a turn with its unit, and its values (N,) [°, `length`, s]."""
        count = self.q.shape[1]
        if len(self._held) > 1:
            return 'time [s]', self._times[:count]
        ((c, way),) = self._held.items()
        slides = c in self.mechanism.displacements
        unit, scale = self.length if slides else ('°', 180.0 / np.pi)
        return f'{c} [{unit}]', scale * way[:count]

    @property
    def length(self) -> tuple[str, float]:
        """Unit of lengths of a machine of this size, and by what metres are multiplied."""
        return for_people('m', self.mechanism.size)

    @property
    def timed(self) -> bool:
        """True if the motion is a function of time, so that rates exist."""
        prescribed = [c for c in self.machine.plan.prescribed if c in self._held]
        return self.moves and len(prescribed) == len(self._held)

    @property
    def weighed(self) -> bool:
        """True if the motion determines the forces of ideal joints."""
        machine, plan = self.machine, self.machine.plan
        rigid = not (machine.without_forces or plan.ideal.deformations)
        return plan.weighed and self.timed and rigid

    def motion(self, order: int, count: int = INSTANTS) -> Array:
        """Coordinates (n, N), their rates or accelerations, under the prescribed drives."""
        plan, q = self.machine.plan, self.q[:, :count]
        if not order:
            return q
        t = self._times[: q.shape[1]]
        laws = [plan.laws_until(c, t[-1])[0] for c in plan.prescribed if c in self._held]
        rate, second = (np.array([_values(x, t, order) for x in laws]) for order in (1, 2))
        v = self._kinematics.rates(q, rate)
        return v if order == 1 else self._kinematics.accelerations(q, v, second)

    def forces(self, count: int = INSTANTS) -> IdealForces | None:
        """Forces of the ideal joints at the first instants; None if motion leaves them open.

        Inverse dynamics under the prescribed drives: rates and accelerations of all coordinates
        follow from those of the drives, forces from both.
        """
        machine = self.machine
        if not self.weighed:
            return None
        t = self._times[: self.q[:, :count].shape[1]]
        q, v, a = (self.motion(order, count) for order in (0, 1, 2))
        dynamics = machine.nominal.inverse_dynamics
        outside = np.array([t if x == 'time' else 0.0 * t for x in dynamics.outside])
        o = dynamics(q, v, a, outside.reshape(len(dynamics.outside), len(t)))
        tree = dynamics.mechanism
        names = tuple(joint.name for joint in tree.joints)
        known = cast(Any, _Known(tree.coordinates, names, machine.nominal.undetermined))
        none = np.zeros((0, len(t)), np.uint8)
        views = [JointView(tree, joint, known, o, none) for joint in tree.joints]
        feet = [view.foot for view in views if isinstance(view.joint, HigherPair)]
        found = np.nan_to_num([view.force for view in views], nan=0.0, posinf=0.0, neginf=0.0)
        at = np.nan_to_num(np.array(feet).reshape(len(feet), 2, len(t)))
        shown = joints_json(tree.joints)
        return IdealForces(shown, found.transpose(2, 0, 1), at.transpose(2, 0, 1))

    def _ways(self) -> dict[str, Array]:
        """Values (N,) of the driven coordinates over a turn."""
        machine, plan = self.machine, self.machine.plan
        self._times = np.zeros(INSTANTS)
        moved = plan.prescribed
        if not moved:  # a single link under torque is rotated by hand
            c = next(iter(plan.laws), None)
            turns = c is not None and c in plan.begins and c not in self.mechanism.displacements
            if len(plan.powered) != 1 or not turns:
                return {}
            angle, speed = plan.begins[str(c)]
            way = np.copysign(2.0 * np.pi, speed or 1.0)
            return {str(c): angle + np.linspace(0.0, way, INSTANTS)}
        straight = machine.plan.main in self.mechanism.displacements
        duration = machine.drive.period
        if straight or not np.isfinite(duration):
            duration = machine.scene.duration or (duration if np.isfinite(duration) else 0.0)
        laws = {c: plan.laws_until(c, duration) for c in moved}
        duration = min(end for _, end in laws.values())
        t = self._times = np.linspace(0.0, duration, INSTANTS)
        return {c: _values(each, t) for c, (each, _) in laws.items()}

    def _closed(self, guess: Array) -> Array:
        for c, way in self._held.items():
            guess[self.mechanism.coordinates.index(c)] = way[0]
        q, left = self._kinematics.positions(guess[:, None])
        if left[0] or not np.isfinite(q).all():
            raise InputError(
                f'{self.machine.name}: the mechanism cannot be assembled: a loop stays open by '
                f'{left[0]:.4g} m'
            )
        return q[:, 0]

    def _followed(self, first: Array, before: Turn | None) -> Array:
        held = [self.mechanism.coordinates.index(c) for c in self._held]
        ways = np.array([*self._held.values()])
        loops = len(self._kinematics.rows)
        if not held or loops != len(first) - len(held) or not np.ptp(ways, axis=1).any():
            return first[:, None]  # motion not determined by the drives
        if not np.isclose(first[held], ways[:, 0]).all():
            ways = ways + (first[held] - ways[:, 0])[:, None]
        size = self.scale
        alike = before is not None and before.mechanism.coordinates == self.mechanism.coordinates
        if before is not None and alike and before.q.shape[1] == INSTANTS:
            guess = before.q + (first - before.q[:, 0])[:, None]
            guess[held] = ways
            q, left = self._kinematics.positions(guess)
            leaps = np.abs(np.diff(q, axis=1)).max(axis=1) / size
            same = np.abs(q[:, 0] - first) / size
            if not left.any() and leaps.max() < _LEAP and same.max() < 1e-6:
                return q
        columns = [first]
        for k in range(1, INSTANTS):
            guess = columns[-1] + (columns[-1] - columns[-2] if k > 1 else self._step(first, ways))
            guess[held] = ways[:, k]
            q, left = self._kinematics.positions(guess[:, None])
            if left[0] or (np.abs(q[:, 0] - columns[-1]) / size).max() > 2.0 * _LEAP:
                break
            columns.append(q[:, 0])
        return np.array(columns).T

    def _step(self, first: Array, ways: Array) -> Array:
        """First step (n,) from the rates at the start: gears mesh at many angles."""
        step = self._kinematics.rates(first[:, None], ways[:, 1:2] - ways[:, :1])[:, 0]
        return step if np.isfinite(step).all() else np.zeros(len(first))


def _values(laws: tuple[Law, ...], t: Array, order: int = 0) -> Array:
    """Prescribed values at times (N,) [s], up to whole turns; or a derivative."""
    known = [law for law in laws if isinstance(law, DriveLaw)]
    found = np.empty_like(t)
    for law in known:
        now = t >= law.valid_from if law is not known[0] else t >= t[0]
        way = polynomial.polyder(law.coefficients, order)
        found[now] = polynomial.polyval(t[now] - law.reference_time, way)
    return found if known[0].straight or order else np.unwrap(found)
