"""Polygons with holes as triangles, by ear clipping.

G. H. Meisters, "Polygons have ears", Am. Math. Monthly 82 (1975); holes are joined to the outer
curve by a bridge (D. Eberly, "Triangulation by ear clipping", 2002). No library for it comes
with the packages of a ROS distribution.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.export.shapes import area, encloses


def triangles(curves: Sequence[Array]) -> Array:
    """Counterclockwise triangles (n, 3, 2) that fill closed curves without crossings.

    Parameters
    ----------
    curves : (k, 2) each; outer ones counterclockwise, holes clockwise
    """
    outer = [curve for curve in curves if area(curve) > 0.0]
    holes = [curve for curve in curves if area(curve) < 0.0]
    found = []
    for curve in outer:
        whole = curve
        own = [hole for hole in holes if _smallest_around(hole, outer) is curve]
        for hole in sorted(own, key=lambda x: -x[:, 0].max()):
            # a single curve around a hole: in and out between the nearest visible corners
            h = int(hole[:, 0].argmax())
            at = hole[h]
            order = np.argsort(np.hypot(*(whole - at).T), kind='stable')
            k = next(int(i) for i in order if not _crossed(at, whole[i], (whole, hole)))
            inner = np.roll(hole, -h, axis=0)
            whole = np.concatenate([whole[: k + 1], inner, inner[:1], whole[k:]])
        found.append(_clipped(whole))
    return np.concatenate(found) if found else np.zeros((0, 3, 2))


def _smallest_around(hole: Array, outer: Sequence[Array]) -> Array | None:
    around = [curve for curve in outer if encloses(curve, hole[:2].mean(axis=0))]
    return min(around, key=area, default=None)


def _crossed(a: Array, b: Array, curves: Sequence[Array]) -> bool:
    """True if a line crosses curves other than at its ends."""

    def side(p: Array, q: Array, r: Array) -> Array:
        (px, py), (qx, qy), (rx, ry) = p.T, q.T, r.T
        return np.asarray((qx - px) * (ry - py) - (qy - py) * (rx - px))

    for curve in curves:
        c, d = curve, np.roll(curve, -1, axis=0)
        if ((side(a, b, c) * side(a, b, d) < 0.0) & (side(c, d, a) * side(c, d, b) < 0.0)).any():
            return True
    return False


def _clipped(curve: Array) -> Array:
    """Triangles (n, 3, 2) of a curve without holes."""
    left, found = list(range(len(curve))), []
    k = stuck = 0
    while len(left) > 3:
        n = len(left)
        i, j, m = left[(k - 1) % n], left[k % n], left[(k + 1) % n]
        ear = curve[[i, j, m]]
        turn = area(ear)
        # cut off: collinear corners, and any convex one if rounding leaves none free
        if turn >= 0.0 and (turn == 0.0 or stuck > n or _free(ear, curve[left])):
            if turn > 0.0:
                found.append(ear)
            del left[k % n]
            k, stuck = k % n - 1, 0
        else:
            k, stuck = k + 1, stuck + 1
            if stuck > 2 * n:
                break
    return np.array([*found, curve[left[:3]]])


def _free(ear: Array, points: Array) -> bool:
    """True if no point of a curve other than the corners is inside a triangle."""
    low, high = ear.min(axis=0), ear.max(axis=0)
    near = points[((points >= low) & (points <= high)).all(axis=1)]
    way = np.roll(ear, -1, axis=0) - ear
    to = near[:, None] - ear
    within = (way[:, 0] * to[..., 1] - way[:, 1] * to[..., 0] >= 0.0).all(axis=1)
    corner = (near[:, None] == ear).all(axis=2).any(axis=1)
    return not bool((within & ~corner).any())
