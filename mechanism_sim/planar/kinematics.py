"""Positions, velocities and accelerations of a closed mechanism whose drives are known.

The closures ``Phi(q) = 0`` of the tree are solved by Newton's method, all instants at once; rates
and accelerations follow from ``J v = 0`` and ``J a = -(dJ/dt) v``. It serves any mechanism, also
loops that depend on each other, which dyads do not cover; a linkage with a closed form may do
better (`mechanism_sim.linkages.four_bar`, twice as fast).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from functools import cached_property

import numpy as np

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import Relation
from mechanism_sim.planar.switched_functions import Edges, SwitchedFunction
from mechanism_sim.tolerances import TOLERANCES

_MECHANISM = TOLERANCES.mechanism
_ROUNDING = TOLERANCES.rounding


class _Closures:
    """The expressions of closures, compiled when first needed."""

    def __init__(self, mechanism: Mechanism, relations: Sequence[Relation]) -> None:
        self._relations = relations
        self._frames = Frames(mechanism.coordinates, Parameters())
        values = [(relation.name, relation.values(self._frames)) for relation in relations]
        self.rows = [name for name, jets in values for _ in jets]
        self._jets = [jet for _, jets in values for jet in jets]

    @cached_property
    def position(self) -> SwitchedFunction:
        """Values and Jacobian, of coordinates."""
        frames = self._frames
        values = [jet.value for jet in self._jets]
        slopes = [x for jet in self._jets for x in jet.row(frames.coordinates)]
        return SwitchedFunction(frames, [values, slopes], [*frames.q.values()])

    @cached_property
    def curvature(self) -> SwitchedFunction:
        """Second time derivatives without accelerations, of coordinates and rates."""
        frames, curvatures = self._frames, [jet.curvature for jet in self._jets]
        return SwitchedFunction(frames, [curvatures], [*frames.q.values(), *frames.v.values()])

    @cached_property
    def facing(self) -> SwitchedFunction | None:
        """Values positive where links have the orientation of their joints; None without any."""
        frames = self._frames
        found = [x for relation in self._relations for x in relation.facing(frames)]
        return SwitchedFunction(frames, [found], [*frames.q.values()]) if found else None

    @cached_property
    def edges(self) -> Edges | None:
        """See `Kinematics.edges`."""
        return Edges(self._frames) if self._frames.switches else None


class Kinematics:
    """The closures of a mechanism as numbers.

    Parameters
    ----------
    mechanism : the tree of links, n coordinates
    relations : its closures, r equations
    held : given coordinates: driven, or chosen at a start
    """

    def __init__(
        self, mechanism: Mechanism, relations: Sequence[Relation], held: Sequence[str]
    ) -> None:
        self.mechanism = mechanism
        self.coordinates = mechanism.coordinates
        self._closures = _Closures(mechanism, relations)
        slides = [c in mechanism.displacements for c in self.coordinates]
        self.scale = np.where(slides, mechanism.size, 1.0)  # [m], [rad]
        self._hold(held)

    def _hold(self, held: Sequence[str]) -> None:
        self.held = [self.coordinates.index(c) for c in held]
        self.sought = [i for i in range(len(self.coordinates)) if i not in self.held]

    def holding(self, held: Sequence[str]) -> Kinematics:
        """Copy of these closures with other coordinates held; compiled functions serve both."""
        other = copy(self)
        other._hold(held)
        return other

    def released(self) -> Kinematics:
        """Copy of these closures with no coordinate held."""
        return self.holding(())

    @property
    def rows(self) -> list[str]:
        """The joint of every equation."""
        return self._closures.rows

    @property
    def edges(self) -> Edges | None:
        """Finder of the changes of closures along a motion; None without changes."""
        return self._closures.edges

    def closure(self, q: Array, rows: Array | None = None) -> tuple[Array, Array]:
        """Residual (N, r) [m] and the Jacobian (N, r, n) at coordinates q (n, N).

        `rows` are the values of the switches; by default those at these positions.
        """
        n, count = q.shape
        if not self.rows:
            return np.zeros((count, 0)), np.zeros((count, 0, n))
        values, slopes = self._closures.position(q, rows)
        return values.T, slopes.reshape(len(self.rows), n, count).transpose(2, 0, 1)

    def faces(self, q: Array) -> Mask:
        """Mask (N,) of closed loops that are not half a turn, or half a slot, off."""
        facing = self._closures.facing
        return facing(q)[0].min(axis=0) > 0.0 if facing else np.ones(q.shape[1], bool)

    def positions(
        self, guess: Array, targets: Array | None = None, apart: bool = False
    ) -> tuple[Array, Array]:
        """Coordinates that close all loops, near a guess; held coordinates stay.

        Where more coordinates are sought than there are equations, the nearest.

        Parameters
        ----------
        guess : (n, N)
        targets : (r,) or (N, r) values of the closures [m] instead of zero
        apart : True if each position is left as it is once it is found, so that it does not depend
            on the others

        Returns
        -------
        q (n, N) as far as it came, and what is left open (N,) [m]: rounding, or the loops cannot
        be closed.
        """
        q = np.array(guess, dtype=float)
        goal = 0.0 if targets is None else targets
        least, since = np.full(q.shape[1], np.inf), np.zeros(q.shape[1], dtype=int)
        done = np.zeros(q.shape[1], dtype=bool)
        for k in range(_MECHANISM.closing):
            off, J = self.closure(q)
            off = off - goal
            if not (np.isfinite(off).all() and np.isfinite(J).all()):
                break
            step = self._solve(J[:, :, self.sought], -off)
            if not np.isfinite(step).all():
                break
            # no step turns a link by more than half a radian: it would leave its branch
            reach = np.abs(step / self.scale[self.sought]).max(axis=1, initial=0.0)
            if apart:
                step[done] = 0.0
            q[self.sought] += (step * np.minimum(1.0, 0.5 / np.maximum(reach, 1e-300))[:, None]).T
            size = np.abs(off).max(axis=1, initial=0.0)
            halved = size <= 0.5 * least
            least, since = np.where(halved, size, least), np.where(halved, k, since)
            found = (reach <= 1e-9) | (k - since >= _MECHANISM.patience)
            done = done | found if apart else found
            if done.all():
                break
        return q, self.open_beyond_rounding(q, targets=targets)

    def open_beyond_rounding(
        self,
        q: Array,
        times: float = 1.0,
        targets: Array | None = None,
        closure: tuple[Array, Array] | None = None,
    ) -> Array:
        """Constraint violation (N,) [m] at coordinates (n, N); zero within rounding.

        A closure rounds by the lengths that it adds up, which are within the reach of the
        mechanism, and by the coordinates themselves: a gear that has turned by the angle a leaves
        its pitch radius times the rounding of a, a rack that of its displacement.

        Parameters
        ----------
        times : allowed multiple of the rounding of its terms
        targets : as in `positions`
        closure : residual and Jacobian there, if known
        """
        off, J = closure or self.closure(q)
        off = np.abs(off if targets is None else off - targets)
        terms = self.mechanism.reach + np.einsum('krn,nk->kr', np.abs(J), np.abs(q))
        return np.asarray(
            np.where(off <= times * _ROUNDING.closure * terms, 0.0, off).max(axis=1, initial=0.0)
        )

    def left_open(self, q: Array) -> Array:
        """Largest distance (N,) of a closure from zero [m] at coordinates (n, N)."""
        return np.asarray(np.abs(self.closure(q)[0]).max(axis=1, initial=0.0))

    def independence(self, q: Array) -> Array:
        """Measure (N,) of how well the closures determine the sought coordinates, 1 to 0.

        The least singular value of their Jacobian with columns of length one: with two unknown
        angles, about the sine of half the angle between their links.
        """
        A = self.directions(q)
        return np.asarray(np.linalg.svd(A, compute_uv=False).min(axis=1, initial=1.0))

    def nearly_singular(self, q: Array, below: float) -> Mask:
        """True if (N,) their `independence` is below a bound.

        The squares of all singular values add up to their number: if one of them is s, their
        product is at most s sqrt(e). That is quicker to know.
        """
        A = self.directions(q)
        if A.shape[1] < A.shape[2]:
            return np.zeros(len(A), dtype=bool)
        product = np.sqrt(np.abs(np.linalg.det(A.transpose(0, 2, 1) @ A)))
        close = product <= 1.7 * below
        if close.any():
            close[close] = self.independence(q[:, close]) < below
        return np.asarray(close)

    def directions(self, q: Array) -> Array:
        """The Jacobian (N, r, u) of the sought coordinates, columns of length one.

        Those that vanish do not count as a hundredth of the mechanism's size.
        """
        _, J = self.closure(q)
        A = (J * (self.scale / self.mechanism.size))[:, :, self.sought]
        directions: Array = A / np.maximum(np.linalg.norm(A, axis=1, keepdims=True), 0.01)
        return directions

    def rates(self, q: Array, held: Array, rows: Array | None = None) -> Array:
        """Rates (n, N) of all coordinates from those of the held ones (p, N).

        NaN at a singular position: there the closures do not determine them.
        """
        _, J = self.closure(q, rows)
        return self._together(held, J, -np.einsum('krp,pk->kr', J[:, :, self.held], held))

    def accelerations(self, q: Array, v: Array, held: Array, rows: Array | None = None) -> Array:
        """Accelerations (n, N) of all coordinates from those of the held ones (p, N)."""
        _, J = self.closure(q, rows)
        right = -np.einsum('krp,pk->kr', J[:, :, self.held], held)
        if self.rows:
            right = right - self._closures.curvature(np.concatenate([q, v]), rows)[0].T
        return self._together(held, J, right)

    def _together(self, held: Array, J: Array, right: Array) -> Array:
        found = np.empty((len(self.coordinates), held.shape[1]))
        found[self.held] = held
        A = J[:, :, self.sought]
        if A.shape[1] == A.shape[2]:
            with suppress(np.linalg.LinAlgError):
                found[self.sought] = np.linalg.solve(A, right[:, :, None])[:, :, 0].T
                return found
            singular = np.linalg.det(A) == 0.0
            A = np.where(singular[:, None, None], np.eye(A.shape[1]), A)
            right = np.where(singular[:, None], np.nan, right)
        found[self.sought] = self._solve(A, right).T
        return found

    def _solve(self, A: Array, b: Array) -> Array:
        """``A x = b`` (N, u) for N matrices (r, u); the shortest of many, the nearest of none."""
        if A.shape[1] == A.shape[2]:
            try:
                return np.asarray(np.linalg.solve(A, b[:, :, None])[:, :, 0])
            except np.linalg.LinAlgError:
                pass
        scale = self.scale[self.sought]
        shortest = np.linalg.pinv(A * scale, rcond=1e-12) @ b[:, :, None]
        return np.asarray(scale * shortest[:, :, 0])
