"""Confidence intervals of means: of turns of one run, which depend on each other, and of runs."""

from __future__ import annotations

import math

import numpy as np
import scipy

from mechanism_sim.arrays import Array

BATCHES = 20
"""Greatest number of batches; means of long ones are nearly independent."""
_FEWEST = 10  # batches, where there are so many values


def batches(n: int) -> tuple[int, int]:
    """Number of batches for n values, and number of values in each.

    Up to 20 each is a batch; of more, 10 to 20 batches of equal size take in as many as they can.
    """
    if n <= BATCHES:
        return n, 1
    count = max(range(_FEWEST, BATCHES + 1), key=lambda count: (n - n % count, count))
    return count, n // count


def ratio(x: Array, per: Array, confidence: float = 0.95) -> tuple[float, float]:
    """``sum(x) / sum(per)`` and half the width of its confidence interval.

    The intervals are put together into `batches` of equal number, but for the first ones if some
    are left; the spread of these about their ratio gives the width (the ratio estimator of
    regenerative simulation).

    Parameters
    ----------
    x, per : (n,) values in n equal intervals

    Returns
    -------
    The ratio and the half width; not a number where `per` is zero or there is but one batch.
    """
    count, size = batches(len(x))
    X, D = (v[len(v) - size * count :].reshape(count, size).sum(axis=1) for v in (x, per))
    if not D.sum():
        return math.nan, math.nan
    R, own = x.sum() / per.sum(), X.sum() / D.sum()
    if count == 1:
        return float(R), math.nan
    spread = np.sqrt(((X - own * D) ** 2).sum() / (count - 1) / count)
    half = scipy.special.stdtrit(count - 1, 0.5 + 0.5 * confidence) * spread / D.mean()
    return float(R), float(half)


def quotient(x: Array, y: Array, confidence: float = 0.95) -> tuple[float, float]:
    """Mean of x over mean of y, of independent samples, and half of its confidence interval.

    To first order in the errors of both means, with the degrees of freedom of Welch (1947). A
    sample of one value counts as known.

    Parameters
    ----------
    x, y : (n,) and (m,) independent values

    Returns
    -------
    The quotient and the half width; not a number where the mean of y is zero or n = m = 1.
    """
    if not y.mean():
        return math.nan, math.nan
    R = float(x.mean() / y.mean())
    sizes = np.array([len(x), len(y)])
    if sizes.max() == 1:
        return R, math.nan
    # variances of both means, of y as it enters R
    parts = np.array([
        scale**2 * v.var(ddof=1) / len(v) if len(v) > 1 else 0.0
        for v, scale in ((x, 1.0), (y, R))
    ])  # fmt: skip
    total = parts.sum()
    if not total:
        return R, 0.0
    freedom = total**2 / (parts**2 / np.maximum(sizes - 1, 1)).sum()
    half = scipy.special.stdtrit(freedom, 0.5 + 0.5 * confidence) * math.sqrt(total)
    return R, float(half / abs(y.mean()))
