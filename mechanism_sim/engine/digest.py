"""A fingerprint of a run: equal if and only if motion and impacts are equal, bit by bit."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.events import Impact, Impacts

_BLOCK = 8192  # segments that are packed at once
_LENGTH, _EIGHT = struct.Struct('<q'), struct.Struct('<8d')
_NUMBERS = (
    't', 'normal_angle', 'approach_speed', 'rebound_speed', 'normal_impulse',
    'tangential_impulse', 'energy_loss', 'drive_impulse',
)  # fmt: skip


class MotionDigest:
    """SHA-256 over the motion and the impacts of a run, however they were batched.

    Two streams are hashed apart, so that it does not matter how segments and impacts interleave,
    and their digests are hashed together. All numbers are little-endian.

    - a segment of n coordinates and states: start, start_low, duration (float64), turns
      (n int64), d + 1 (int64), coefficients (n (d + 1) float64), modes (r uint8); d is the
      highest degree that occurs in it, so that padding with zeros makes no difference
    - an impact: length of the joint's name (int64), the name (UTF-8), the eight numbers of
      `add_impact` in their order (float64)
    """

    def __init__(self) -> None:
        self._segments = hashlib.sha256()
        self._impacts = hashlib.sha256()

    def add(self, motion: Motion, impacts: Iterable[Impact]) -> None:
        """Add the motion and the impacts of a part of a run."""
        for part in motion.parts(_BLOCK):
            c, modes = part.rows, part.modes
            self.add_segments(c.start, c.start_low, c.duration, c.turns, c.coefficients, modes)
        known = Impacts.of(impacts)
        names = [_named(joint) for joint in known.joints]
        rows = np.stack([known.column(x) for x in _NUMBERS], axis=1).astype('<f8').tobytes()
        size, parts = _EIGHT.size, list[bytes]()
        for k, gap in enumerate(known.gaps.tolist()):
            parts += names[gap], rows[k * size : (k + 1) * size]
        self._impacts.update(b''.join(parts))

    def add_segments(
        self,
        start: ArrayLike,
        start_low: ArrayLike,
        duration: ArrayLike,
        turns: ArrayLike,
        coefficients: ArrayLike,
        modes: ArrayLike,
    ) -> None:
        """Add m segments of motion in the order of time.

        Args:
            start: Shape (m,) [s].
            start_low: Shape (m,) [s], what `start` rounds away.
            duration: Shape (m,) [s].
            turns: Shape (m, n), whole turns.
            coefficients: Shape (m, n, d + 1) [rad/s^j].
            modes: Shape (m, r), as in ModeChange.

        """
        times = np.column_stack([np.asarray(x, '<f8') for x in (start, start_low, duration)])
        counts = np.asarray(turns, '<i8')
        powers = np.asarray(coefficients, '<f8')
        states = np.asarray(modes, 'u1')
        # Columns in use: up to the last power that is not zero for every coordinate.
        used = np.any(powers != 0, axis=1)
        widths = np.where(used.any(axis=1), used.shape[1] - np.argmax(used[:, ::-1], axis=1), 0)
        # Runs of equal width are hashed in one go, as rows of a packed structure.
        for first, last in _runs(widths):
            width, n = int(widths[first]), counts.shape[1]
            kinds = [('<f8', (3,)), ('<i8', (n,)), ('<i8',), ('<f8', (n, width))]
            names = [(f'f{k}', *kind) for k, kind in enumerate([*kinds, ('u1', states.shape[1:])])]
            block, rows = np.empty(last - first, names), slice(first, last)
            columns = times[rows], counts[rows], width, powers[rows, :, :width], states[rows]
            for name, column in zip(block.dtype.names or (), columns, strict=True):
                block[name] = column
            self._segments.update(block.data if block.nbytes else b'')

    def add_impact(self, joint: str, values: Sequence[float]) -> None:
        """Add the next impact.

        Args:
            joint: Its name.
            values: Time, angle of the normal, speeds of approach and rebound, normal and
                tangential impulse, loss of energy, impulse of the drives; units of the message
                Impact.

        """
        self._impacts.update(_named(joint) + _EIGHT.pack(*values))

    def hexdigest(self) -> str:
        """Return the digest of what was added so far, as 64 hexadecimal digits."""
        both = b'motion' + self._segments.digest() + b'impacts' + self._impacts.digest()
        return hashlib.sha256(both).hexdigest()


def _named(joint: str) -> bytes:
    """Bytes of an impact's joint."""
    name = joint.encode()
    return _LENGTH.pack(len(name)) + name


def _runs(values: NDArray[Any]) -> list[tuple[int, int]]:
    """Return (first, last + 1) of the runs of equal values."""
    if not len(values):
        return []
    edges = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    return list(pairwise(edges))
