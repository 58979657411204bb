"""Numbers of teeth for a wanted ratio: every choice of integers, the best first ([V] 5.9.2)."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import NamedTuple

from mechanism_sim.errors import InputError
from mechanism_sim.units import counted

#: more steps of the search would take minutes
MOST_STEPS = 1_000_000

#: a search over more numbers of teeth than this takes too much memory
_MOST_COUNTS = 1_000

_MOST_STAGES = 10

#: with fewer teeth hardly any pair has a contact ratio of one
FEWEST = 8

#: more trains than this are no choice
_MOST_FOUND = 100_000

_MICROMETRE = 1e-6
_ROUNDING = 1e-12  # a ratio given as a float is not exact


class ToothStage(NamedTuple):
    """One pair of a train."""

    driver: int  #: teeth
    driven: int
    module: float | None  #: [m]; None where any will do

    def __str__(self) -> str:
        module = '' if self.module is None else f' ({1e3 * self.module:g} mm)'
        return f'{self.driver}:{self.driven}{module}'


class Choice(NamedTuple):
    """Teeth of a whole train."""

    stages: tuple[ToothStage, ...]
    ratio: Fraction  #: speed of the first driver over that of the last driven gear, without sign
    error: float  #: relative, of the ratio; negative if it is too small

    @property
    def teeth(self) -> int:
        """Total number of teeth."""
        return sum(s.driver + s.driven for s in self.stages)


def ratio_of(text: str) -> Fraction:
    """A ratio as it is written: ``3.5`` or ``7/2``."""
    try:
        # a number with a huge exponent would be a fraction without end
        if '/' in text or math.isfinite(float(text)):
            ratio = Fraction(text)
            if float(ratio) > 0.0:
                return ratio
    except (ValueError, OverflowError, ZeroDivisionError):
        pass
    raise InputError(f"'{text}' is not a ratio: write a positive number such as 3.5 or 7/2")


@dataclass(frozen=True)
class TrainSearch:
    """All trains of external pairs that come near a ratio.

    Parameters
    ----------
    ratio : N_driven/N_driving over all stages ([V] eqs. 5.53, 5.7), without sign
    stages : pairs in series
    tolerance : largest relative error of the ratio
    teeth : smallest and largest number of teeth of a gear; 18 are free of undercut ([V] 5.7)
    centre_distance : C [m] of every stage, C = m (N2 + N3)/2 to a micrometre ([V] eq. 5.59)
    modules : possible modules [m]
    """

    ratio: float | Fraction
    stages: int = 1
    tolerance: float = 0.0
    teeth: tuple[int, int] = (18, 120)
    centre_distance: float | None = None
    modules: Sequence[float] = ()

    def __post_init__(self) -> None:
        fewest, most = self.teeth
        if not 0 < self.ratio < math.inf:
            raise InputError(f'a ratio must be positive and finite, not {float(self.ratio):g}')
        if self.stages < 1:
            raise InputError(f'a train has at least 1 stage, not {self.stages}')
        if not 1 <= fewest <= most:
            raise InputError(f'teeth go from few to many, as 18:120, not from {fewest} to {most}')
        if not self.tolerance >= 0.0:
            raise InputError(
                f'the tolerance of the ratio must be at least 0, not {self.tolerance:g}'
            )
        if self.stages > _MOST_STAGES:
            raise InputError(f'{self.stages} stages are too many: {_MOST_STAGES} at most')
        if most - fewest >= _MOST_COUNTS:
            raise InputError(f'the range of teeth is too wide: {_MOST_COUNTS} numbers at most')
        if (self.centre_distance is None) != (not self.modules):
            raise InputError('a centre distance and the modules for it belong together')

    @cached_property
    def found(self) -> list[Choice]:
        """Ranked by error, then by the number of teeth (fewer are larger), then in order."""
        wanted, tolerance = Fraction(self.ratio), max(self.tolerance, _ROUNDING)
        pairs = list(self._pairs(*self.teeth))
        if not pairs:
            raise InputError('no gears of these modules and teeth have this centre distance')
        if len(pairs) ** (self.stages - 1) > MOST_STEPS:
            raise InputError(
                f'{len(pairs)} pairs in {self.stages} stages are too many: narrow the range of '
                'teeth'
            )
        pairs.sort(key=_of)
        ratios = [_of(pair) for pair in pairs]
        floats = [float(r) for r in ratios]
        low, high = float(wanted) * (1.0 - tolerance), float(wanted) * (1.0 + tolerance)
        found, nearest = [], math.inf
        for first in product(pairs, repeat=self.stages - 1):
            done = math.prod(map(_of, first), start=Fraction(1))
            # a margin for rounding; the exact comparison follows
            begin = bisect_left(floats, low / float(done) * (1.0 - 1e-12))
            end = bisect_right(floats, high / float(done) * (1.0 + 1e-12))
            for last, step in zip(pairs[begin:end], ratios[begin:end], strict=True):
                error = done * step / wanted - 1
                if abs(error) <= tolerance:
                    found.append(Choice((*first, last), done * step, float(error)))
            if len(found) > _MOST_FOUND:
                raise InputError(
                    f'more than {_MOST_FOUND} trains: lower the tolerance or narrow the range'
                )
            if not found:
                around = floats[max(begin - 1, 0) : end + 1]
                near = [float(done) * r for r in around]
                nearest = min([*near, nearest], key=lambda r: abs(r - float(wanted)))
        if not found:
            raise InputError(
                f'no teeth give the ratio {float(wanted):g} within {self.limits}; the nearest is '
                f'{nearest:g}' + (f'; just outside: {self.outside}' if self.outside else '')
            )
        return sorted(found, key=lambda c: (abs(c.error), c.teeth, c.stages))

    @property
    def limits(self) -> str:
        """Limits of the search, in words."""
        (few, many), n, tolerance = self.teeth, self.stages, self.tolerance
        said = [f'{few} to {many} teeth a gear', counted(n, 'stage')]
        exact = tolerance <= _ROUNDING
        said.append('no error of the ratio' if exact else f'errors of {tolerance:g} of the ratio')
        if self.centre_distance is not None:
            sizes = ', '.join(f'{1e3 * m:g}' for m in self.modules)
            distance = f'{1e3 * self.centre_distance:g} mm'
            said.append(f'modules of {sizes} mm at a centre distance of {distance}')
        return ', '.join(said)

    @cached_property
    def outside(self) -> ToothStage | None:
        """The pair with the ratio that needs the smallest step beyond the range of teeth.

        Its numbers are from `FEWEST` to twice the most. None if there is none, or of more stages.
        """
        wanted, most = Fraction(self.ratio), 2 * self.teeth[1]
        if self.stages > 1:
            return None
        if self.centre_distance is not None:
            pairs = self._pairs(FEWEST, most)
        else:
            counts = ((a, round(a * wanted)) for a in range(FEWEST, most + 1))
            pairs = (ToothStage(a, b, None) for a, b in counts if FEWEST <= b <= most)

        def beyond(pair: ToothStage) -> tuple[int, float, int]:
            few, many = sorted(pair[:2])
            step = max(self.teeth[0] - few, many - self.teeth[1])
            return step, abs(float(_of(pair) / wanted) - 1.0), few

        near = (p for p in pairs if abs(_of(p) / wanted - 1) <= max(self.tolerance, _ROUNDING))
        return min((p for p in near if beyond(p)[0] > 0), key=beyond, default=None)

    def _pairs(self, fewest: int, most: int) -> Iterator[ToothStage]:
        counts = range(fewest, most + 1)
        if self.centre_distance is None:
            yield from (ToothStage(a, b, None) for a in counts for b in counts)
            return
        for module in self.modules:
            if not module > 0.0:
                raise InputError('a module is positive')
            total = round(2.0 * self.centre_distance / module)
            if abs(total * module / 2.0 - self.centre_distance) <= _MICROMETRE:
                yield from (
                    ToothStage(a, total - a, module) for a in counts if total - a in counts
                )


def _of(stage: ToothStage) -> Fraction:
    return Fraction(stage.driven, stage.driver)
