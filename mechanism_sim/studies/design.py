"""Designs of sweeps: which values factors take, each from its own distribution.

Points of the unit cube come from `scipy.stats.qmc`; the quantile function of each distribution
makes values of them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, quoted
from mechanism_sim.scene.facts import COMPONENTS
from mechanism_sim.units import (
    QuantityValue,
    alike,
    as_revolutions,
    has_decimal_comma,
    product,
    to_si,
    to_si_text,
)

_LATIN_HYPERCUBE, _SOBOL, RANDOM, INDICES = 'latin_hypercube', 'sobol', 'random', 'sobol_indices'
KINDS = {
    _LATIN_HYPERCUBE: 'every factor evenly in as many classes as there are samples',
    _SOBOL: "Sobol's sequence, scrambled",
    RANDOM: 'independent draws, as of machines in production',
    INDICES: 'samples times (factors + 2) runs, for indices of Sobol, first and total',
}
SIGMAS = 3.0
"""Standard deviations in T of `A +- T`, which is normal and cut off at A - T and A + T."""

_TOLERANCE = re.compile(r'\s*(.+?)\s*(?:\+-|\+/-|±)\s*(.+?)\s*')
_NUMBER = r'(?:\d+(?:[.,]\d+)*\.?|[.,]\d+)(?:[eE][+-]?\d+)?'  # decimal commas are refused later
_SIDE = re.compile(rf'(?<!\d[eE])(?<!\^)[+-]\s*{_NUMBER}|(?<=[\s/])0(?:[.,]0*)?(?=[\s/]|$)')
"""A deviation as on a drawing, of which 0 has no sign: in ``50 mm +0.2/-0.1`` there are two."""
_PART = re.compile(rf'([+-]?\s*{_NUMBER})\s*(.*)')
_SHARE = re.compile(r'(.*\d\.?)\s*%')
_FORMS = (
    "[LOW, HIGH] (uniform), 'A +- T' (normal, T is three standard deviations), 'A +T/-S' (the "
    'same about the middle of both ends), '
    '{normal: [MEAN, DEVIATION]}, {uniform: [LOW, HIGH]} or {triangular: [LOW, MODE, HIGH]}'
)


class Factor(NamedTuple):
    """A value that is varied."""

    path: str  #: dotted
    text: str  #: distribution as text
    unit: str
    distribution: Any  #: frozen, of `scipy.stats`, in SI units

    def check_unit(self, units: Sequence[str]) -> None:
        """Refuse another unit than those of the key that is varied, if they are known."""
        wrong = None
        for unit in units if self.unit else ():
            try:
                to_si(f'1 {self.unit}', unit)
            except ValueError as error:
                wrong = wrong or error
            else:
                return
        if wrong:
            raise InputError(f'vary.{self.path}: {quoted(self.text)} {wrong}') from wrong


def factor(path: str, given: Any) -> Factor:
    """A factor as a sweep file has it."""
    stats = scipy.stats
    kind, values = 'uniform', given
    if isinstance(given, str) and (found := _deviations(given)):
        kind, values = 'sides', found
    elif isinstance(given, str) and (match := _TOLERANCE.fullmatch(given)):
        kind, values = 'tolerance', _parts(match[1], match[2]) or [match[1], match[2]]
    elif isinstance(given, Mapping) and len(given) == 1:
        ((kind, values),) = given.items()
    count = {'uniform': 2, 'normal': 2, 'tolerance': 2, 'sides': 3, 'triangular': 3}.get(kind)
    if not isinstance(values, list | tuple) or len(values) != count:
        if isinstance(given, str) and has_decimal_comma(given):
            _read(path, given)
        cure = "; single values are those of 'grid'" if isinstance(given, list | tuple) else ''
        raise InputError(
            f'vary.{path}: {quoted(given)} is not a distribution: write {_FORMS}{cure}'
        )
    numbers, units = list[float](), list[str]()
    for value in values:
        share = _SHARE.fullmatch(value) if isinstance(value, str) and numbers else None
        if share and kind in ('tolerance', 'sides'):
            number, unit = abs(numbers[0]) * to_si(share[1], '') / 100.0, units[0]
        else:
            number, unit = _read(path, value)
        numbers.append(number)
        units.append(unit)
    if not all(alike(units[0], unit) for unit in units):
        raise InputError(f'vary.{path}: {quoted(given)} mixes units: {", ".join(units)}')
    a, b = numbers[0], numbers[-1]
    if kind == 'sides':
        low, high = sorted((a + numbers[1], a + b))
        if low == high:
            raise InputError(f'vary.{path}: {quoted(given)}: the deviations must differ')
        kind, a, b = 'tolerance', 0.5 * (low + high), 0.5 * (high - low)
    if kind in ('normal', 'tolerance'):
        if b <= 0.0:
            raise InputError(f'vary.{path}: {quoted(given)}: the deviation must be positive')
        found = (
            stats.norm(a, b)
            if kind == 'normal'
            else stats.truncnorm(-SIGMAS, SIGMAS, a, b / SIGMAS)
        )
    else:
        if not a < b or not all(a <= x <= b for x in numbers):
            raise InputError(f'vary.{path}: {quoted(given)}: the values must rise')
        shape = (numbers[1] - a) / (b - a)
        found = stats.uniform(a, b - a) if kind == 'uniform' else stats.triang(shape, a, b - a)
    text = given if isinstance(given, str) else f'{kind} {", ".join(map(str, values))}'
    return Factor(path, text, product(units[0], ''), found)


def by_component(vary: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split what is varied by components of points with tolerances, and what stays.

    ``{p: ['180 mm +- 0.1 mm', '0 mm']}`` varies ``p.x`` and leaves ``p.y`` at 0 mm.
    """
    factors, fixed = dict[str, Any](), dict[str, Any]()
    for path, given in vary.items():
        pair = given if isinstance(given, list | tuple) and len(given) == len(COMPONENTS) else []
        if not any(map(_is_tolerance, pair)):
            factors[path] = given
            continue
        for name, one in zip(COMPONENTS, pair, strict=True):
            (factors if _is_tolerance(one) else fixed)[f'{path}.{name}'] = one
    return factors, fixed


def _is_tolerance(given: Any) -> bool:
    """True of a text with a size and its deviations, and of a distribution by name."""
    if isinstance(given, Mapping):
        return True
    return isinstance(given, str) and bool(_deviations(given) or _TOLERANCE.fullmatch(given))


def _read(path: str, value: Any) -> QuantityValue:
    """A number of a distribution; 1/min are revolutions, as a scene has them."""
    try:
        return to_si_text(as_revolutions(value))
    except ValueError as error:
        raise InputError(f'vary.{path}: {quoted(value)} {error}') from error


def _parts(*texts: str) -> list[str] | None:
    """A size and its deviations: of those without a unit that of the size, else of another."""
    found = [_PART.fullmatch(text.strip(' /')) for text in texts]
    if None in found:
        return None
    numbers, units = zip(*(x.groups() for x in found if x), strict=True)
    known = next(filter(None, units), '')
    pairs = zip(numbers, units, strict=True)
    return [f'{n.replace(" ", "")} {unit or known}'.strip() for n, unit in pairs]


def _deviations(text: str) -> list[str] | None:
    """Size and both deviations of ``50 mm +0.2/-0.1``; None of another text."""
    text = text.strip()
    sides = [x.start() for x in _SIDE.finditer(text) if x.start()]  # the first is of the size
    if len(sides) != 2:
        return None
    one, two = sides
    return _parts(text[:one], text[one:two], text[two:])


def points(factors: list[Factor], kind: str, samples: int, seed: int) -> Array:
    """Values (N, d) of d factors in SI units.

    Of `INDICES` there are the n points A, then B, then for each factor A with that one from B
    (Saltelli et al., Computer Physics Communications 181 (2010) 259-270).
    """
    qmc, d = scipy.stats.qmc, len(factors)
    if kind == INDICES and samples & (samples - 1):
        raise InputError(f'design: samples = {samples} must be a power of 2 for {INDICES}')
    width = 2 * d if kind == INDICES else d
    rng = np.random.default_rng(seed)
    if kind == _LATIN_HYPERCUBE:
        cube = qmc.LatinHypercube(width, rng=rng).random(samples)
    elif kind == RANDOM:
        cube = rng.random((samples, width))
    else:
        sequence = qmc.Sobol(width, rng=rng)
        cube = sequence.random(1 << (samples - 1).bit_length())[:samples]

    def values(part: Array) -> Array:
        columns = [f.distribution.ppf(u) for f, u in zip(factors, part.T, strict=True)]
        return np.column_stack(columns)

    if kind != INDICES:
        return values(cube)
    a, b = values(cube[:, :d]), values(cube[:, d:])
    pages = [a, b]
    for i in range(d):
        page = a.copy()
        page[:, i] = b[:, i]
        pages.append(page)
    return np.concatenate(pages)
