"""Stages of a measurement chain as state equations: the second route to what instruments show."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from mechanism_sim.arrays import Array


class State(NamedTuple):
    """``x' = A x + B u``, ``y = C x + D u`` with one input and one output."""

    A: Array  #: (n, n)
    B: Array  #: (n,)
    C: Array  #: (n,)
    D: float


def resonator(frequency: float, damping: float) -> State:
    """``y'' + 2 zeta w y' + w^2 y = w^2 u``."""
    w = 2.0 * math.pi * frequency
    A = np.array([[0.0, w], [-w, -2.0 * damping * w]])
    return State(A, np.array([0.0, w]), np.array([1.0, 0.0]), 0.0)


def lag(frequency: float) -> State:
    """``y' = w (u - y)``."""
    w = 2.0 * math.pi * frequency
    return State(np.array([[-w]]), np.array([w]), np.ones(1), 0.0)


def lead(frequency: float) -> State:
    """Complement of a lag: the input less its output."""
    A, B, C, _ = lag(frequency)
    return State(A, B, -C, 1.0)


def integral(frequency: float) -> State:
    """``y' = u - w y``."""
    return State(np.array([[-2.0 * math.pi * frequency]]), np.ones(1), np.ones(1), 0.0)


def low_pass(frequency: float, order: int) -> list[State]:
    """Butterworth of even order: resonators of damping ``sin((2 k - 1) pi / 2 n)``."""
    angles = (np.arange(1, order, 2)) * math.pi / (2 * order)
    return [resonator(frequency, float(zeta)) for zeta in np.sin(angles)]


def connect_in_series(stages: Sequence[State]) -> State:
    """Each behind the one before; without any what goes in comes out."""
    A, B, C, D = np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    for a, b, c, d in stages:
        n = len(A)
        A = block_diag(A, a)
        A[n:, :n] = np.outer(b, C)
        B, C, D = np.append(B, b * D), np.append(d * C, c), d * D
    return State(A, B, C, D)
