"""Compiled functions of many columns at once."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import numpy as np

from mechanism_sim.arrays import Array

COLUMNS = 1024
"""Evaluated at once: inputs, parameters and results then stay in a processor's cache."""


class Evaluation:
    """A compiled function whose parameters are the same for all columns.

    heyoka wants the parameters of every column; they are repeated once and kept.

    Parameters
    ----------
    function : of heyoka, of v variables
    parameters : values of ``par[]``; what the function does not use may follow
    sizes : of the groups into which its results are split
    """

    def __init__(self, function: Any, parameters: Sequence[float], sizes: Sequence[int]) -> None:
        self._function = function
        self._parameters = np.array(parameters[: function.nparams])[:, None]
        self._repeated = np.repeat(self._parameters, COLUMNS, axis=1)
        self._rows = sum(sizes)
        ends = list(accumulate(sizes))
        self._groups = [slice(e - size, e) for e, size in zip(ends, sizes, strict=True)]

    def __call__(self, inputs: Array) -> list[Array]:
        """The groups of results, (size, N) each, at `inputs` (v, N)."""
        count = inputs.shape[1]
        out = np.empty((self._rows, count))
        for first in range(0, count, COLUMNS):
            block = np.ascontiguousarray(inputs[:, first : first + COLUMNS])
            out[:, first : first + COLUMNS] = self._function(block, pars=self._pars(block))
        return [out[group] for group in self._groups]

    def _pars(self, block: Array) -> Array:
        width = block.shape[1]
        return self._repeated if width == COLUMNS else np.repeat(self._parameters, width, axis=1)
