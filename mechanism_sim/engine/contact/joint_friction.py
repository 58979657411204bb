"""Friction in ideal joints during impacts.

The force in a joint is an impulse there, and so is its friction: Coulomb's law holds between the
two, and the slip at the end of the impact, as J. J. Moreau has it of contacts (Unilateral contact
and dry friction in finite freedom dynamics, 1988).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.contact.problem import ContactProblem
from mechanism_sim.numerics.complementarity import Indices
from mechanism_sim.numerics.kernels import entry
from mechanism_sim.tolerances import TOLERANCES

_JOINT_IMPULSES = TOLERANCES.joint_impulses


class JointFrictionProblem(NamedTuple):
    """The k frictions at one state, beside r rows of contacts."""

    rate: Array  #: (k,) their slips [rad/s, m/s]
    response: Array  #: (k, f) rates of the free coordinates per unit impulse of each
    compliance: Array  #: (r + k, k) rates of all rows, then of the slips, likewise
    drive_response: Array  #: (k, p)
    forces: Array  #: (c, r + k) components of what presses per unit impulse of all
    coefficients: Array  #: (t,) of every term of all bounds
    ends: Indices  #: (t,) how many components there are up to that of a term
    owner: Indices  #: (t,) whose bound a term belongs to
    walls: Indices  #: (t,) 1 or -1 if it is of forces of that sign only, else 0


def joint_friction_problem(
    terms: Array, sizes: list[list[tuple[int, int]]], rows: int, free: int, drives: int
) -> JointFrictionProblem:
    """Views of the terms (N, ...) in one row, or of their derivatives."""
    k, each = len(sizes), [x for own in sizes for x, _ in own]
    shapes = (k,), (k, free), (rows + k, k), (k, drives), (sum(each), rows + k), (len(each),)
    ends = np.cumsum([math.prod(shape) for shape in shapes])[:-1]
    slip, response, compliance, drive, forces, coefficients = (
        x.reshape(*s, *x.shape[1:]) for x, s in zip(np.split(terms, ends), shapes, strict=True)
    )
    owner = np.array([i for i, own in enumerate(sizes) for _ in own])
    last, walls = np.cumsum(each), np.array([wall for own in sizes for _, wall in own])
    return JointFrictionProblem(
        slip, response, compliance, drive, forces, coefficients, last, owner, walls
    )


@entry
def friction_impulses(friction: JointFrictionProblem, x: Array, start: Array) -> Array:
    """Impulses (k,) of friction beside impulses (r,) of contacts, by projected Gauss-Seidel.

    Each ends its slip, or is as large as its bound and against the slip that is left.
    """
    compliance, forces, owner = friction.compliance, friction.forces, friction.owner
    k, r, size, before, step = len(friction.rate), len(x), 0.0, math.inf, 1.0
    every = np.concatenate((x, start))
    free = friction.rate.copy()
    for j in range(k):
        for i in range(r):
            free[j] += compliance[i, j] * x[i]
    for _ in range(_JOINT_IMPULSES.sweeps):
        change = size = 0.0
        for j in range(k):
            bound, first = 0.0, 0
            for t in range(len(owner)):
                if owner[t] == j:
                    square, force = 0.0, 0.0
                    for c in range(first, friction.ends[t]):
                        force = 0.0
                        for i in range(r + k):
                            force += forces[c, i] * every[i]
                        square += force * force
                    if friction.walls[t] * force >= 0.0:
                        bound += friction.coefficients[t] * math.sqrt(square)
                first = friction.ends[t]
            # slip under all present impulses, and the impulse that ends it, cut to its bound
            slip = free[j]
            for i in range(k):
                slip += compliance[r + j, i] * every[r + i]
            own, now = compliance[r + j, j], every[r + j]
            wanted = now - slip / own if own > 0.0 else -math.inf * slip if slip != 0.0 else 0.0
            every[r + j] += step * (min(max(wanted, -bound), bound) - now)
            change = max(change, abs(every[r + j] - now))
            size = max(size, bound)
        if change <= _JOINT_IMPULSES.settled * size:
            break
        if (
            change > _JOINT_IMPULSES.grows * before
        ):  # bounds that grow much with their own friction
            step = max(0.5 * step, _JOINT_IMPULSES.least_step)
        before = change
    return every[r:]


def with_friction(
    c: ContactProblem, friction: JointFrictionProblem, x: Array, start: Array
) -> Array:
    """Add the friction that impulses (r,) of contacts cause in joints, in proportion to them.

    Its impulses grow with theirs: what one of these does is from now on done with its share.

    Parameters
    ----------
    c : the contacts alone; its terms are changed in place
    start : (k,) impulses of friction from where they are looked for

    Returns
    -------
    They (k,) themselves.
    """
    found: Array = friction_impulses(friction, x, start)
    share = np.outer(found, x / (x @ x))
    rows = len(x)
    c.response[:] += share.T @ friction.response
    c.compliance[:] += friction.compliance[:rows] @ share
    c.drive_response[:] += share.T @ friction.drive_response
    return found


def loss(friction: JointFrictionProblem, x: Array, T: Array) -> float:
    """Energy [J] that impulses (k,) of friction dissipate beside those (r,) of contacts."""
    gained = friction.compliance[: len(x)].T @ x + friction.compliance[len(x) :] @ T
    return float(-(friction.rate + 0.5 * gained) @ T)
