"""The stiffness of a shaft in its supports, for its disks and the heavy supports.

The shaft is a beam of Euler and Bernoulli without mass, so that its own places follow from those
of the disks and of the supports that have a mass (static condensation, exact here).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array

ROUNDING = 1e-12  # of a stiffness


@dataclass(frozen=True)
class Bearing:
    """A support of a shaft in one plane."""

    along: float  #: position from the first disk [m]
    stiffness: float = np.inf  #: [N/m]; infinite for a rigid support
    kept: bool = False  #: whether its displacement stays a coordinate
    clamped: bool = False  #: whether the shaft cannot tilt there


def shaft_rigidity(modulus: float, diameter: float) -> float:
    """E I of a round shaft [N m^2], from E [Pa] and its diameter [m]."""
    return modulus * np.pi * diameter**4 / 64.0


def beam(rigidity: float, length: float) -> Array:
    """Stiffness (4, 4) of a beam for its ends' deflections and slopes, w1, s1, w2, s2.

    Parameters
    ----------
    rigidity : E I [N m^2]
    """
    L = length
    return (rigidity / L**3) * np.array([
        [12.0, 6.0 * L, -12.0, 6.0 * L],
        [6.0 * L, 4.0 * L**2, -6.0 * L, 2.0 * L**2],
        [-12.0, -6.0 * L, 12.0, -6.0 * L],
        [6.0 * L, 2.0 * L**2, -6.0 * L, 4.0 * L**2],
    ])  # fmt: skip


def condensed(
    rigidity: float,
    bearings: Sequence[Bearing],
    disks: Sequence[tuple[float, bool]],
    sections: Sequence[tuple[float, float, float]] = (),
) -> tuple[Array, list[Array]] | None:
    """Stiffness for the deflections of disks, their slopes, and the supports that are kept.

    Parameters
    ----------
    rigidity : E I [N m^2]
    disks : positions of the disks [m], each with whether the slope there is a coordinate
    sections : starts and ends of sections [m] with another E I, and its value

    Returns
    -------
    (p, p) [N/m, N m/rad], without the stiffness of the supports that are kept; of each support the
    row (p,) of minus its force on the shaft, zero where it is kept. None if the supports do not
    hold the shaft.
    """
    loaded = {*(z for z, _ in disks), *(b.along for b in bearings)}
    steps = {z for begin, end, _ in sections for z in (begin, end)}
    places = sorted(loaded | {z for z in steps if min(loaded) < z < max(loaded)})
    at = {z: 2 * i for i, z in enumerate(places)}
    K = np.zeros((2 * len(places), 2 * len(places)))
    for (z, i), (after, _) in zip(at.items(), list(at.items())[1:], strict=False):
        own = [EI for begin, end, EI in sections if begin <= z and after <= end]
        K[i : i + 4, i : i + 4] += beam(own[0] if own else rigidity, after - z)
    shaft = K.copy()
    kept, fixed = [at[z] + k for z, tilts in disks for k in range(1 + tilts)], []
    for b in bearings:
        if b.kept:
            kept.append(at[b.along])
        elif np.isinf(b.stiffness):
            fixed.append(at[b.along])
        else:
            K[at[b.along], at[b.along]] += b.stiffness
        if b.clamped:
            fixed.append(at[b.along] + 1)
    rest = [i for i in range(len(K)) if i not in kept and i not in fixed]
    inner = K[np.ix_(rest, rest)]
    if rest:
        size = np.sqrt(np.diag(inner))
        if np.linalg.eigvalsh(inner / np.outer(size, size)).min() < ROUNDING:
            return None
    moves = np.zeros((len(K), len(kept)))  # all places, from those that are kept
    moves[kept, range(len(kept))] = 1.0
    moves[rest] = -np.linalg.solve(inner, K[np.ix_(rest, kept)])
    found = moves.T @ K @ moves
    stiff = np.sqrt(np.diag(K)[kept])
    found[np.abs(found) < ROUNDING * np.outer(stiff, stiff)] = 0.0
    rows = []
    for b in bearings:
        i = at[b.along]
        if b.kept:
            rows.append(np.zeros(len(kept)))
        elif np.isinf(b.stiffness):
            rows.append(-(shaft[i] @ moves))
        else:
            rows.append(b.stiffness * moves[i])
    return (found + found.T) / 2.0, rows
