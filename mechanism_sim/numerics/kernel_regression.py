"""Regression of a number on many, from few samples, with an estimate of its error.

Kernel ridge regression with a Gaussian kernel. What a regression without sample i says is known in
closed form, for all i at once (Rasmussen and Williams, Gaussian Processes for Machine Learning,
2006, sect. 5.4.2); intervals are those of R. F. Barber, E. J. Candes, A. Ramdas and R. J.
Tibshirani, Predictive inference with the jackknife+, Annals of Statistics 49 (2021) 486.
"""

from __future__ import annotations

import math

import numpy as np

from mechanism_sim.arrays import Array, IndexArray

_LENGTHS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)  # over the median distance of two samples
_RIDGES = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)
_CONSTANT = 100.0  # variance of the unknown mean, over that of y


class KernelRegression:
    """y as a function of p inputs, from n samples.

    Inputs are scaled by their spread, and weighted by how much of their variance a parabola in y
    explains: of a hundred inputs few may know about y. Length of the kernel and ridge are those
    with the smallest errors on the samples left out.

    Parameters
    ----------
    x : (n, p) inputs
    y : (n,) outputs

    Attributes
    ----------
    residuals : (n,) of y, each by the regression without that sample
    """

    def __init__(self, x: Array, y: Array) -> None:
        self._middle, self._spread = x.mean(axis=0), x.std(axis=0)
        self._spread[self._spread == 0.0] = math.inf
        self._scale = float(y.std()) or 1.0
        self._origin = float(y.mean())
        target = (y - self._origin) / self._scale
        scaled = (x - self._middle) / self._spread
        self._weights = explained(scaled, target)
        self._x = scaled * self._weights
        distances = _squares(self._x, self._x)
        typical = float(np.median(distances)) or 1.0
        best = math.inf
        for length in _LENGTHS:
            kernel = np.exp(-distances / (2.0 * typical * length)) + _CONSTANT
            values, vectors = np.linalg.eigh(kernel)
            for ridge in _RIDGES:
                inverse = (vectors / (np.maximum(values, 0.0) + ridge)) @ vectors.T
                alpha = inverse @ target
                residuals = alpha / np.diag(inverse)
                error = float(np.mean(residuals**2))
                if error < best:
                    best, self._width = error, 2.0 * typical * length
                    self._alpha, self._inverse, self._left = alpha, inverse, residuals
        self.residuals = self._left * self._scale

    def left_out(self, x: Array) -> Array:
        """Prediction at x (p,) by each of the n regressions without one sample: (n,)."""
        place = np.clip((x - self._middle) / self._spread, -10.0, 10.0) * self._weights
        k = np.exp(-_squares(place[None], self._x)[0] / self._width) + _CONSTANT
        predicted = k @ self._alpha - (k @ self._inverse) * self._left
        return np.asarray(self._origin + self._scale * predicted)

    def interval(
        self, x: Array, level: float = 0.95, among: IndexArray | None = None
    ) -> tuple[float, float]:
        """Interval of y at x (p,) with the true value in a share `level` of cases (jackknife+).

        Proven for cases drawn as the samples were: at least ``2 level - 1``, whatever they are
        like; as good as `level` unless the regression hangs on single samples. `among` are indices
        of the samples whose errors count: those like x, where errors differ from place to place.
        """
        chosen = slice(None) if among is None else among
        predicted, size = self.left_out(x)[chosen], np.abs(self.residuals[chosen])
        n = len(size)
        rank = min(math.ceil(level * (n + 1)), n) - 1
        low = np.sort(predicted - size)[n - 1 - rank]
        return float(low), float(np.sort(predicted + size)[rank])


def explained(x: Array, y: Array) -> Array:
    """Share of the variance of each column of x (n, p) that a parabola in y (n,) explains."""
    parabola = np.vander(y, 3)
    fitted = parabola @ np.linalg.lstsq(parabola, x, rcond=None)[0]
    left, variance = (x - fitted).var(axis=0), x.var(axis=0)
    share = np.divide(left, variance, out=np.ones_like(left), where=variance > 0.0)
    return np.asarray(np.clip(1.0 - share, 0.0, 1.0))


def _squares(a: Array, b: Array) -> Array:
    """Squared distances (n, m) of rows of a (n, p) and b (m, p)."""
    products = 2.0 * a @ b.T
    return np.asarray(np.maximum((a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - products, 0.0))
