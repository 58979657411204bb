"""Putting a mechanism together: the configuration nearest to a guess in which all loops close."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.errors import InputError
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.kinematics import Kinematics

if TYPE_CHECKING:
    from mechanism_sim.scene.machine import Machine

Array = NDArray[np.float64]

_TRIES = 256
_RANK = 1e-9


class Assembly(NamedTuple):
    """A mechanism without clearance at the start."""

    q: Array  #: (n,) coordinates [rad, m]
    v: Array  #: (n,) their rates
    freedom: int  #: motions left when all drives stand still
    overdriven: int  #: drives that contradict others
    redundant: int  #: closure equations that follow from the others


def assemble(machine: Machine) -> Assembly:
    """Where a machine without clearance is at the start.

    Drives, and coordinates set by `initial`, are where they should be; the rest lies near `guess`.

    Raises
    ------
    InputError
        If the loops cannot be closed: which is open by how much, near which configuration.
    """
    plan, ideal = machine.plan, machine.plan.ideal
    held = {**plan.begins, **{c: (x, 0.0) for c, x in plan.given[0].items()}}
    for c in plan.prescribed:
        law = plan.laws[c][0]
        if isinstance(law, DriveLaw):
            _, local = law.about(Fraction(0))
            held[c] = (local[0], local[1] if len(local) > 1 else 0.0)
    known = plan.guess | {c: x for c, (x, _) in held.items()}
    guess = np.array([known.get(c, 0.0) for c in ideal.coordinates])
    kinematics = machine.kinematics([c for c in ideal.coordinates if c in held])
    q = closed_near(machine.name, kinematics, guess)
    moving = machine.kinematics(plan.prescribed)
    _, J = moving.closure(q[:, None])
    rank, full = (_rank(x, ideal.size) for x in (J[0][:, moving.sought], J[0]))
    rates = {c: w for c, (_, w) in held.items()} | plan.given[1]
    v = nearest_rates(kinematics, q, ideal.coordinates, rates)
    return Assembly(q, v, len(moving.sought) - rank, full - rank, J.shape[1] - full)


def closed_near(
    name: str, kinematics: Kinematics, guess: Array, targets: Array | None = None
) -> Array:
    """Coordinates (n,) that close all loops, near a guess whose held ones count.

    Where Newton's method fails from the guess itself, it starts from others around it, and the
    nearest of its results is taken.

    Raises
    ------
    InputError
        If none closes the loops.
    """
    q, left = kinematics.positions(guess[:, None], targets)
    if left[0]:
        spread = np.random.default_rng(1).standard_normal((len(guess), _TRIES))
        slides = [c in kinematics.mechanism.displacements for c in kinematics.coordinates]
        spread *= np.where(slides, kinematics.mechanism.size, 1.0)[:, None]
        spread *= np.linspace(0.05, 2.0, _TRIES)
        spread[kinematics.held] = 0.0
        first, missed = q, left
        q, left = kinematics.positions(guess[:, None] + spread, targets)
        if left.all():
            best = int(np.argmin(left))
            near, miss = (
                (q[:, best], left[best]) if left[best] < missed[0] else (first[:, 0], missed[0])
            )
            _refuse(name, kinematics, near, float(miss), targets)
        far = np.abs(_wrapped(kinematics, q - guess[:, None])).max(axis=0)
        q = q[:, [int(np.argmin(np.where(left > 0.0, np.inf, far)))]]
    return guess + _wrapped(kinematics, q - guess[:, None])[:, 0]


def nearest_rates(
    kinematics: Kinematics, q: Array, coordinates: Sequence[str], given: Mapping[str, float]
) -> Array:
    """Rates (n,) that keep all loops closed, nearest to those given; the held ones are kept."""
    v = np.array([given.get(c, 0.0) for c in coordinates])
    _, J = kinematics.closure(q[:, None])
    if J.shape[1]:
        rest = [i for i in kinematics.sought if coordinates[i] not in given]
        right = -(J[0] @ v)
        v[rest] += np.linalg.lstsq(J[0][:, rest], right, rcond=None)[0]
    return v


def _wrapped(kinematics: Kinematics, shift: Array) -> Array:
    """Differences of coordinates without whole turns of those sought."""
    names = kinematics.mechanism.displacements
    turning = [i for i in kinematics.sought if kinematics.coordinates[i] not in names]
    shift[turning] -= TWO_PI * np.round(shift[turning] / TWO_PI)
    return shift


def _rank(J: Array, size: float) -> int:
    if not J.size:
        return 0
    return int((np.linalg.svd(J, compute_uv=False) > _RANK * max(size, 1.0)).sum())


def _refuse(
    name: str, kinematics: Kinematics, q: Array, miss: float, targets: Array | None
) -> None:
    off = kinematics.closure(q[:, None])[0][0] - (0.0 if targets is None else targets)
    joint = kinematics.rows[int(np.argmax(np.abs(off)))]
    placed = ', '.join(
        f'{c} = {x:.4g} m' if c in kinematics.mechanism.displacements
        else f'{c} = {np.degrees(x):.4g} deg'
        for c, x in zip(kinematics.coordinates, q, strict=True)
    )  # fmt: skip
    raise InputError(
        f'{name}: the mechanism cannot be assembled: the loop closed by the joint {joint} stays '
        f'open by {miss:.4g} m, nearest with {placed}; check the lengths of that loop, or give a '
        "better 'guess'"
    )
