"""The motion of an ideal linkage whose drives are known: in closed form, or by Newton's method."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mechanism_sim.errors import RunError
from mechanism_sim.linkages.four_bar import Array, FourBar
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.known import Edges


class IdealMotion(Protocol):
    """Positions, rates and accelerations of all n coordinates from those of p driven ones."""

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of all coordinates."""

    @property
    def driven(self) -> list[int]:
        """Which of them are driven."""

    @property
    def sliding(self) -> list[int]:
        """Which of them are displacements."""

    @property
    def edges(self) -> Edges | None:
        """Where its closures change; None if they do not."""

    def follow(self, last: Array, driven: Array) -> Array:
        """Coordinates (n, N) a little after `last` (n,), for driven ones (p, N).

        Raises
        ------
        RunError
            If the loops cannot be closed there.
        """

    def motion(
        self, near: Array, v: Array, a: Array, rows: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """The same with rates and accelerations, for those of the driven coordinates (p, N).

        `rows` are the values of the switches, if not those at these places.

        Raises
        ------
        RunError
            If the loops cannot be closed there.
        """

    def left_open(self, q: Array) -> float:
        """Largest distance [m] by which loops are open at coordinates (n, N)."""


class FourBarMotion:
    """A four-bar, in closed form."""

    coordinates = ('crank', 'coupler', 'rocker')
    driven = [0]  # noqa: RUF012 - a list, because it is an index
    sliding: list[int] = []  # noqa: RUF012
    edges = None

    def __init__(self, linkage: FourBar) -> None:
        self.linkage = linkage

    def follow(self, last: Array, driven: Array) -> Array:
        """Coordinates (3, N) a little later, by whole turns next to those before."""
        q = np.array([driven[0], *self.linkage.positions(driven[0])])
        joined = np.unwrap(np.column_stack([last[1:], q[1:]]), axis=1)
        return np.vstack([driven, joined[:, 1:]])

    def motion(
        self, near: Array, v: Array, a: Array, rows: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """The same with rates and accelerations."""
        q, rates, accelerations = self.linkage.motion(near[0], v[0], a[0])
        q[1:] += TWO_PI * np.round((near[1:] - q[1:]) / TWO_PI)
        return q, rates, accelerations

    def left_open(self, q: Array) -> float:
        """How far the coupler's end is from the rocker's [m]."""
        th2, th3, th4 = q
        l = self.linkage  # noqa: E741 - the lengths
        x = l.crank * np.cos(th2) + l.coupler * np.cos(th3) - l.rocker * np.cos(th4) - l.ground
        y = l.crank * np.sin(th2) + l.coupler * np.sin(th3) - l.rocker * np.sin(th4)
        return float(np.hypot(x, y).max(initial=0.0))


class LinkageMotion:
    """Any linkage, by Newton's method on its closures."""

    def __init__(self, kinematics: Kinematics) -> None:
        self.kinematics = kinematics
        self.coordinates = kinematics.coordinates
        self.driven = kinematics.held
        names = kinematics.mechanism.displacements
        self.sliding = [i for i, c in enumerate(self.coordinates) if c in names]

    @property
    def edges(self) -> Edges | None:
        """Where its closures change."""
        return self.kinematics.edges

    def follow(self, last: Array, driven: Array) -> Array:
        """Coordinates (n, N) a little later, from where the last ones point."""
        shift = driven - last[self.driven, None]
        slopes = self.kinematics.rates(
            np.repeat(last[:, None], len(self.driven), axis=1), np.eye(len(self.driven))
        )
        near = last[:, None] + slopes @ shift
        near[self.driven] = driven
        return self._closed(near)

    def _closed(self, near: Array) -> Array:
        """Coordinates (n, N) that close all loops, near others."""
        q, left = self.kinematics.positions(near)
        if left.any():
            k = int(np.argmax(left))
            driven = ', '.join(
                f'{self.coordinates[i]} = {near[i, k]:.6g} m' if i in self.sliding
                else f'{self.coordinates[i]} = {np.degrees(near[i, k]):.6g} deg'
                for i in self.driven
            )  # fmt: skip
            off = np.abs(self.kinematics.closure(q[:, k : k + 1])[0][0])
            joint = self.kinematics.rows[int(np.argmax(off))]
            raise RunError(
                f'the mechanism cannot follow its drive to {driven}: the loop stays open by '
                f'{left[k]:.3g} m at {joint}; it may be at a dead point'
            )
        return q

    def motion(
        self, near: Array, v: Array, a: Array, rows: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """The same with rates and accelerations."""
        q = self._closed(near)
        rates = self.kinematics.rates(q, v, rows)
        return q, rates, self.kinematics.accelerations(q, rates, a, rows)

    def left_open(self, q: Array) -> float:
        """Largest distance from zero of a closure [m]."""
        return float(np.abs(self.kinematics.closure(q)[0]).max(initial=0.0))
