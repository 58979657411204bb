"""Samples of a run as a file, written while it runs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Self

import numpy as np

from mechanism_sim import output, tables
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.numerics.polynomials import first_due
from mechanism_sim.results.run import Piece


def check_rate(rate: float | None) -> float:
    """The rate of samples [Hz], refused unless it is positive."""
    if rate is None or not 0.0 < rate < math.inf:
        raise InputError('--output needs a positive --sample-rate in Hz')
    return rate


class SampleWriter:
    """Writes the pieces of a run, sampled at an even rate, as a table that grows.

    Columns are those of `Solution.sample`. A run that fails leaves no file.

    Parameters
    ----------
    file : to write, see `tables.check_file`
    rate : [Hz]
    """

    def __init__(self, file: str, rate: float) -> None:
        self._file, self._rate = Path(file), rate
        self._place = tables.opened(self._file)
        self._piece: Piece | None = None
        self._count = 0

    def __enter__(self) -> Self:
        self._write_rows = self._place.__enter__()
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        incomplete: RunError | None = RunError('it is not complete')
        try:
            if kind is None:
                if self._piece:
                    end = self._piece.motion.curve.end
                    last = int(np.floor(end * self._rate * (1.0 + 1e-12)))
                    self._write(self._piece, np.minimum(self._times(last + 1), end))
                incomplete = None
        finally:
            # the end of the run is not an error of the file
            self._place.__exit__(type(incomplete) if incomplete else None, incomplete, None)

    def add(self, piece: Piece) -> None:
        """Write the piece before, up to the start of this one, whose values hold there."""
        if not len(piece.motion):
            return
        begin = float(piece.motion.curve.start[0])
        if self._piece:
            self._write(self._piece, self._times(first_due(begin, self._rate)))
        else:
            self._count = first_due(begin, self._rate)
        self._piece = piece

    def _times(self, before: int) -> Array:
        return np.arange(self._count, before) / self._rate

    def _write(self, piece: Piece, t: Array) -> None:
        if not t.size:
            return
        self._count += len(t)
        columns = piece.sample(t).columns()
        with output.errors_as_sentences(self._file):
            # a column is of one type in all pieces
            self._write_rows([c._replace(values=np.asarray(c.values, float)) for c in columns])
