"""The motion of an ideal four-bar under a prescribed crank, as polynomials like any other motion.

The closed form is exact at every instant; for topics and sensors it is interpolated on pieces of a
sixty-fourth of a turn.
"""

from __future__ import annotations

import math
from collections import deque
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.hybrid.events import Impact, ModeChange
from mechanism_sim.hybrid.snapshot import Snapshot
from mechanism_sim.hybrid.tape import Motion
from mechanism_sim.linkages.four_bar import Array, FourBar
from mechanism_sim.numerics.polynomials import (
    TWO_PI,
    Nodes,
    PiecewisePolynomial,
    chebyshev_nodes,
    fit_powers,
    shift_powers,
)
from mechanism_sim.planar.drive import DriveLaw, Law
from mechanism_sim.planar.inverse_dynamics import Account, InverseDynamics, Observation
from mechanism_sim.planar.mechanism import Mechanism

_NODES = chebyshev_nodes(15)
_PIECES_PER_TURN = 64


class NominalRun:
    """Advances an ideal four-bar piece by piece; the same surface as the event loop's.

    Attributes
    ----------
    steps, events : pieces made, and none
    time : [s] up to which the motion is known
    """

    def __init__(self, linkage: FourBar, law: DriveLaw, start: float = 0.0) -> None:
        self.steps = 0
        self.events = 0
        self.time = start
        self._linkage = linkage
        self._law = law
        self._coming: deque[DriveLaw] = deque()
        self._pieces: list[tuple[float, float, int, Array]] = []
        self._previous: Array | None = None

    def change_law(self, law: Law) -> None:
        """Let a law replace the present one from ``law.valid_from`` on.

        Raises
        ------
        ValueError
            If the motion is already known beyond that time, or the law is a torque's.
        """
        if not isinstance(law, DriveLaw):
            raise ValueError('a torque needs equations of motion, not closed forms')
        if law.valid_from < self.time:
            raise ValueError(
                f'a law valid from {law.valid_from:.9g} s comes too late: the motion is known '
                f'up to {self.time:.9g} s'
            )
        self._coming = deque(sorted((*self._coming, law), key=lambda x: x.valid_from))

    def advance(self, until: float, final: bool = False, most: int | None = None) -> None:
        """Add every piece that ends not later than `until` [s]; with `final` up to `until`."""
        added = 0
        while most is None or added < most:
            added += 1
            end = self.time + self._width()
            if self._coming and self._coming[0].valid_from <= min(end, until):
                self._add(self._coming[0].valid_from)
                self._law = self._coming.popleft()
                continue
            if end > until:
                if final:
                    self._add(until)
                return
            self._add(end)

    def _width(self) -> float:
        _, local = self._law.about(Fraction(self.time))
        rate = abs(local[1]) if len(local) > 1 else 0.0
        return min(2.0 * np.pi / rate / _PIECES_PER_TURN, 0.1) if rate else 0.1

    def _add(self, end: float) -> None:
        h = end - self.time
        if h <= 0.0:
            return
        turns, local = self._law.about(Fraction(self.time))
        crank = np.array([local])
        th2 = shift_powers(np.repeat(crank, len(_NODES), axis=0), h * _NODES)[:, 0]
        angles = np.array(self._linkage.positions(th2))
        if self._previous is None:
            self._previous = angles[:, 0]
        joined = np.unwrap(np.column_stack([self._previous, angles]), axis=1)[:, 1:]
        self._previous = joined[:, -1]
        coefficients = np.zeros((3, len(_NODES)))
        coefficients[0, : len(local)] = local
        coefficients[1:] = fit_powers(joined, h)
        self._pieces.append((self.time, h, turns, coefficients))
        self.steps += 1
        self.time = end

    def snapshot(self) -> Snapshot:
        """What it takes to go on."""
        angles = () if self._previous is None else tuple(self._previous.tolist())
        return Snapshot(
            '', Fraction(0), self.time, {}, angles, (), 0, (), (), 0.0, math.inf, 0.0,
            (self._law,), tuple(self._coming), -math.inf, 0, 0,
        )  # fmt: skip

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self.time = snapshot.tau
        self._law, *_ = (law for law in snapshot.laws if isinstance(law, DriveLaw))
        self._coming = deque(law for law in snapshot.coming if isinstance(law, DriveLaw))
        self._previous = np.array(snapshot.state) if snapshot.state else None
        self._pieces.clear()

    def drain(self) -> tuple[Motion, list[Impact], list[ModeChange]]:
        """Motion since the last call; there are no events."""
        pieces, self._pieces = self._pieces, []
        count = len(pieces)
        turns = np.zeros((count, 3), dtype=np.int64)
        turns[:, 0] = [p[2] for p in pieces]
        curve = PiecewisePolynomial(
            np.array([p[0] for p in pieces]),
            np.zeros(count),
            np.array([p[1] for p in pieces]),
            turns,
            np.array([p[3] for p in pieces]).reshape(count, 3, len(_NODES)),
        )
        none = np.zeros((count, 0))
        return Motion(curve, np.zeros((count, 0), np.uint8), none, np.zeros((count, 0, 3))), [], []


class NominalPhysics:
    """An ideal four-bar: exact kinematics, and forces where masses are known."""

    clearances: tuple[str, ...] = ()

    def __init__(
        self, linkage: FourBar, mechanism: Mechanism, forces: InverseDynamics | None
    ) -> None:
        self.coordinates = mechanism.coordinates
        self.joints = tuple(joint.name for joint in mechanism.joints)
        self.has_forces = forces is not None
        self._linkage = linkage
        self._forces = forces

    def observe(
        self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes
    ) -> Observation:
        """The machine at times `dt` (N,) after the start of `segments` (N,)."""
        fitted = motion.curve.at(segments, dt).T
        crank = [fitted[0], *(motion.curve.at(segments, dt, d).T[0] for d in (1, 2))]
        q, v, a = self._linkage.motion(*crank)
        q[1:] += TWO_PI * np.round((fitted[1:] - q[1:]) / TWO_PI)
        if self._forces is not None:
            return self._forces(q, v, a)
        count = q.shape[1]
        none, unknown = np.zeros((0, count)), np.full(count, np.nan)
        forces = np.zeros((0, 2, count))
        return Observation(
            q, v, a, none, none, none, np.zeros(count), forces, none, unknown, unknown, unknown
        )

    def open_gaps(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """There are none: (0, N)."""
        return np.zeros((0, motion.closed_at(segments, dt).shape[1]))

    def account(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Account:
        """What books are kept of, and how far the interpolated motion leaves the loop open."""
        seen = self.observe(motion, segments, dt)
        th2, th3, th4 = motion.curve.local(segments, dt).T
        l = self._linkage  # noqa: E741 - the lengths
        x = l.crank * np.cos(th2) + l.coupler * np.cos(th3) - l.rocker * np.cos(th4) - l.ground
        y = l.crank * np.sin(th2) + l.coupler * np.sin(th3) - l.rocker * np.sin(th4)
        left = float(np.hypot(x, y).max(initial=0.0))
        return Account(seen.normal_force, seen.friction_power, seen.drive_power, left)
