"""Gear trains from a list of meshes: speeds, degrees of freedom, torques, power ([V] 5.9, 5.10).

Seen from its carrier, a mesh is a pair on fixed shafts (Willis): with the speeds w and numbers of
teeth N of two gears and their carrier c,

    N1 (w1 - wc) + N2 (w2 - wc) = 0        [V] eq. 5.61; minus for internal teeth, eq. 5.62

All meshes and joints make a matrix A with A w = 0. By virtual power the torques on the members are
then in balance if tau + A^T lambda = 0, without losses.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.errors import InputError

Array = NDArray[np.float64]

#: rows are scaled to one, and teeth are integers: what is smaller is rounding
RANK_TOLERANCE = 1e-10


@dataclass(frozen=True)
class Mesh:
    """Two gears in mesh.

    Parameters
    ----------
    first, second : names of the gears
    carrier : link that carries their shafts; None for the frame
    internal : both turn the same way, seen from the carrier: one has internal teeth, or it is a
        bevel gear whose axis is counted that way
    """

    first: str
    second: str
    carrier: str | None = None
    internal: bool = False

    @property
    def name(self) -> str:
        """As it stands in sentences."""
        return f'{self.first}-{self.second}'


class Flow(NamedTuple):
    """Torques and power without losses."""

    torque: dict[str, float]  #: from outside on each member [N m]
    power: dict[str, float]  #: into the train at each member [W]
    rolling: dict[str, float]  #: through each mesh, first to second, seen from its carrier [W]


@dataclass(frozen=True)
class Train:
    """Gears, carriers and their meshes.

    Parameters
    ----------
    teeth : number of teeth of each gear, by name
    meshes : which gear runs with which
    joined : pairs of members on one shaft
    square : planets whose axis is at right angles to that of their carrier (bevel); their speed is
        that about their own axis, to which the carrier adds nothing

    Raises
    ------
    InputError
        If a mesh names a gear without teeth, one twice, or a planet in `square` has no carrier.
    """

    teeth: Mapping[str, int]
    meshes: tuple[Mesh, ...]
    joined: tuple[tuple[str, str], ...] = ()
    square: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        for name, count in self.teeth.items():
            if count < 1:
                raise InputError(f'gear {name} has {count} teeth')
        for one, other in self.joined:
            if one == other:
                raise InputError(f'{one} is joined to itself')
        for mesh in self.meshes:
            if len({mesh.first, mesh.second, mesh.carrier}) < 3:
                raise InputError(f'the mesh {mesh.name} names a member twice')
            for gear in (mesh.first, mesh.second):
                if gear not in self.teeth:
                    raise InputError(f'the mesh {mesh.name} needs the teeth of {gear}')
                if gear in self.square and mesh.carrier is None:
                    raise InputError(f'the planet {gear} needs a carrier in the mesh {mesh.name}')

    @property
    def members(self) -> tuple[str, ...]:
        """Gears, carriers and shafts, in the order of their first mention."""
        carriers = (mesh.carrier for mesh in self.meshes if mesh.carrier is not None)
        shafts = (name for pair in self.joined for name in pair)
        return tuple(dict.fromkeys((*self.teeth, *carriers, *shafts)))

    @property
    def constraints(self) -> Array:
        """A of A w = 0, (meshes + joined, members): torque of a mesh per unit lambda, in teeth."""
        place = {name: i for i, name in enumerate(self.members)}
        rows = np.zeros((len(self.meshes) + len(self.joined), len(place)))
        for row, mesh in zip(rows, self.meshes, strict=False):
            for gear, sign in ((mesh.first, 1), (mesh.second, -1 if mesh.internal else 1)):
                row[place[gear]] = sign * self.teeth[gear]
                if mesh.carrier is not None and gear not in self.square:
                    row[place[mesh.carrier]] -= sign * self.teeth[gear]
        for row, (first, second) in zip(rows[len(self.meshes) :], self.joined, strict=True):
            row[place[first]] += 1.0
            row[place[second]] -= 1.0
        return rows

    @property
    def freedom(self) -> int:
        """Degrees of freedom with nothing held: members less the rank of A."""
        return len(self.members) - _rank(_scaled(self.constraints))

    def speeds(self, given: Mapping[str, float]) -> dict[str, float]:
        """Speeds of all members [rad/s, or any one unit] from those that are driven or held (0).

        Raises
        ------
        InputError
            If a name is unknown, the speeds given contradict the teeth, or leave some open.
        """
        names = self.members
        self._check_members(given)
        if not all(map(math.isfinite, given.values())):
            raise InputError('speeds are finite numbers')
        held = np.array([[float(name == g) for name in names] for g in given])
        rows = np.concatenate([_scaled(self.constraints), held.reshape(len(given), len(names))])
        right = np.concatenate([np.zeros(len(rows) - len(given)), list(given.values())])
        free = _null_space(rows)
        loose = [
            n for n, row in zip(names, free, strict=True) if np.abs(row).max(initial=0) > 1e-8
        ]
        found = np.linalg.lstsq(rows, right, rcond=RANK_TOLERANCE)[0]
        size = float(np.abs(right).max(initial=0.0))
        if np.abs(rows @ found - right).max(initial=0.0) > 1e-9 * size:
            raise InputError(
                f'the teeth do not let {", ".join(given)} turn at these speeds together'
            )
        if loose:
            raise InputError(f'the speeds given leave open that of {", ".join(loose)}')
        return dict(zip(names, found.tolist(), strict=True))

    def ratio(self, driver: str, driven: str, held: Iterable[str] = ()) -> float:
        """Speed of `driver` over that of `driven`, with signs, with some members held.

        Raises
        ------
        InputError
            As `speeds`; or if the driven member stands still.
        """
        speeds = self.speeds({driver: 1.0, **dict.fromkeys(held, 0.0)})
        self._check_members((driven,))
        if abs(speeds[driven]) < RANK_TOLERANCE:
            raise InputError(f'{driven} stands still')
        return 1.0 / speeds[driven]

    def flow(
        self, speeds: Mapping[str, float], torques: Mapping[str, float], supports: Iterable[str]
    ) -> Flow:
        """Torques in balance, and where the power goes.

        Parameters
        ----------
        speeds : that fix all others, as in `speeds`
        torques : from outside, by member [N m]; members that are not named carry none
        supports : members whose torque is to be found: the frame holds them, or they give power

        Raises
        ------
        InputError
            If nothing balances the torques given, or several torques would.
        """
        names, moving = self.members, self.speeds(speeds)
        supports = tuple(dict.fromkeys(supports))
        self._check_members((*torques, *supports))
        if both := sorted(set(torques) & set(supports)):
            raise InputError(f'the torque of {", ".join(both)} is both given and looked for')
        if not all(map(math.isfinite, torques.values())):
            raise InputError('torques are finite numbers')
        scaled = _scaled(self.constraints)
        free = np.array([[float(n == s) for s in supports] for n in names])
        columns = np.concatenate([scaled.T, free.reshape(len(names), len(supports))], axis=1)
        outside = np.array([torques.get(name, 0.0) for name in names])
        found = np.linalg.lstsq(columns, -outside, rcond=RANK_TOLERANCE)[0]
        size = float(np.abs(outside).max(initial=0.0))
        if np.abs(columns @ found + outside).max(initial=0.0) > 1e-9 * size:
            raise InputError('the torques given are not in balance: more members need a support')
        loose = _null_space(columns)
        if np.abs(loose).max(initial=0.0) > 1e-8:
            raise InputError(
                'several torques are possible: fewer supports, or meshes that repeat each other'
            )
        forces, held = found[: len(scaled)], found[len(scaled) :]
        torque = {n: float(outside[i]) for i, n in enumerate(names)}
        torque.update(zip(supports, held.tolist(), strict=True))
        rolling = {}
        for i, mesh in enumerate(self.meshes):
            still = mesh.carrier is None or mesh.first in self.square
            carried = 0.0 if still else moving[str(mesh.carrier)]
            on_first = float(forces[i] * scaled[i, names.index(mesh.first)])
            # the first gear gives what the mesh takes from it
            rolling[mesh.name] = -on_first * (moving[mesh.first] - carried)
        return Flow(torque, {n: torque[n] * moving[n] for n in names}, rolling)

    def _check_members(self, named: Iterable[str]) -> None:
        if unknown := [name for name in named if name not in self.members]:
            raise InputError(
                f'no member {", ".join(unknown)}; there are {", ".join(self.members)}'
            )


def _scaled(rows: Array) -> Array:
    size = np.abs(rows).max(axis=1, initial=0.0, keepdims=True)
    return rows / np.where(size > 0.0, size, 1.0)


def _rank(rows: Array) -> int:
    return int(np.linalg.matrix_rank(rows, tol=RANK_TOLERANCE)) if rows.size else 0


def _null_space(matrix: Array) -> Array:
    """Orthonormal columns that the matrix cancels, (columns, columns - rank)."""
    right = np.linalg.svd(matrix)[2]
    return right[_rank(matrix) :].T
