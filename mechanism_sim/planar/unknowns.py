"""Loads whose sizes are unknown, in a machine whose motion and drive efforts are given ([V] 3).

With the generalised forces Q of loads of size one, and the effort E given of as many drives,
``J^T lambda + torques + Q f = s`` has a solution for the sizes f beside that for the joint forces.
By superposition: with the torques T that balance s alone, and those T_Q that balance Q, the given
drives have ``T - T_Q f = E``. T_Q is the virtual power of the loads per rate of the drives: where
it vanishes they do no work, and their sizes are not determined.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.symbolic import Term, mul
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import Load
from mechanism_sim.planar.virtual_work import generalised
from mechanism_sim.tolerances import TOLERANCES

_MECHANISM = TOLERANCES.mechanism


class UnknownLoad(Protocol):
    """A load of size one."""

    @property
    def label(self) -> str:
        """Name in messages and columns."""

    @property
    def unit(self) -> str:
        """Unit of the load's size, ``N`` or ``N m``."""

    def loads(self, frames: Frames) -> list[Load]:
        """Loads on links when its size is one."""


class Effort(Protocol):
    """Effort that a drive supplies while its motion is prescribed."""

    def effort(self, frames: Frames) -> Term:
        """[N m] of one that turns, [N] of one that slides."""


class Unknowns:
    """The unknown loads of a mechanism whose drives `driven` are prescribed.

    Parameters
    ----------
    loads : u of them
    efforts : of u driven coordinates

    Attributes
    ----------
    units : of the sizes, by name
    sizes : (u,) symbols
    acting : the loads at these sizes
    """

    def __init__(
        self,
        mechanism: Mechanism,
        frames: Frames,
        loads: Sequence[UnknownLoad],
        efforts: Mapping[str, Effort],
        driven: Sequence[str],
    ) -> None:
        self._mechanism, self._frames = mechanism, frames
        self.units = {load.label: load.unit for load in loads}
        self.sizes = [hy.make_vars(f'size{k}') for k in range(len(loads))]
        self._single = [load.loads(frames) for load in loads]
        self.acting = [
            Load(x.name, x.link, x.at, (mul(s, x.force[0]), mul(s, x.force[1])), mul(s, x.moment))
            for s, each in zip(self.sizes, self._single, strict=True)
            for x in each
        ]
        self._efforts = [effort.effort(frames) for effort in efforts.values()]
        self._given, self._drives = [driven.index(c) for c in efforts], len(driven)
        length = mechanism.size
        pace = [length if c in mechanism.displacements else 1.0 for c in efforts]
        reach = [length if load.unit == 'N' else 1.0 for load in loads]
        self._scale = np.array(pace)[:, None] / np.array(reach)

    @property
    def terms(self) -> list[Term]:
        """Generalised forces of each load at size one, by coordinate; then the given efforts."""
        found: list[Term] = []
        for loads in self._single:
            forces = generalised(loads, self._frames, self._mechanism)
            found += [forces.get(c) for c in self._mechanism.coordinates]
        return found + self._efforts

    def solve(self, matrix: Array, balancing: Array, terms: Array) -> tuple[Array, Array]:
        """Forces of closures and torques of drives (n, N), and sizes (u, N), NaN without work.

        Parameters
        ----------
        matrix : (N, n, n) of the forces of closures and the torques
        balancing : (n, N) these if the loads were zero
        terms : values (u n + u, N) of `terms`
        """
        response, leverage = self._response(matrix, terms)
        count, n = matrix.shape[:2]
        rows, given = self._rows(n), terms[len(self.sizes) * n :]
        known = np.abs(np.linalg.det(leverage * self._scale)) > _MECHANISM.no_work
        sizes = np.full((count, len(self.sizes)), np.nan)
        if known.any():
            missing = (balancing[rows] - given).T[known, :, None]
            sizes[known] = np.linalg.solve(leverage[known], missing)[:, :, 0]
        found = balancing - (response @ sizes[:, :, None])[:, :, 0].T
        found[rows] = given
        return found, sizes.T

    def power(self, v: Array, sizes: Array, terms: Array) -> Array:
        """Power of the loads (N,) [W] at rates v (n, N) and sizes (u, N)."""
        forces = terms[: len(sizes) * len(v)].reshape(-1, *v.shape)
        return np.asarray(np.einsum('unN,nN,uN->N', forces, v, sizes))

    def work(self, matrix: Array, terms: Array) -> Array:
        """Determinant (N,) of virtual powers, without dimension: zero where they do no work."""
        return np.asarray(np.linalg.det(self._response(matrix, terms)[1] * self._scale))

    def _response(self, matrix: Array, terms: Array) -> tuple[Array, Array]:
        """Forces (N, n, u) of closures and drives that balance unit loads; the given part."""
        count, n = matrix.shape[:2]
        columns = terms[: len(self.sizes) * n].reshape(len(self.sizes), n, count)
        response: Array = np.linalg.solve(matrix, columns.transpose(2, 1, 0)).astype(float)
        return response, response[:, self._rows(n)]

    def _rows(self, n: int) -> list[int]:
        """Rows of the given torques among n unknown forces and torques."""
        return [n - self._drives + k for k in self._given]
