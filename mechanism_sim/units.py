"""Quantities in and out: text with units becomes SI once, on input.

The conversion is decimal: `2645 kg mm^2` is the float nearest to 0.002645. Common units are in a
table; pint reads the rest, and takes 0.3 s to load. What reads a quantity raises `ValueError`: one
clause that says what is wrong and what would do.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from datetime import timedelta
from decimal import Decimal
from functools import cache, lru_cache
from itertools import pairwise
from typing import Any, NamedTuple, overload

from mechanism_sim.errors import InputError, quoted

_NUMBER = re.compile(r'\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)\s*')

_UNIT = re.compile(r'[\w^*/·().° -]+')
_NO_UNIT = re.compile(r'\d{3}|(\^|\*\*)\s*-?\d+\s*(\^|\*\*)|\)\s*(\^|\*\*)')
"""Powers that grow: of three digits, of powers, of products."""

_PLAIN_TYPES = {str, int, float, bool, dict, list, type(None)}

_LONGEST = 60
"""Characters of a quantity."""

LARGEST, SMALLEST = 1e30, 1e-30
"""Magnitudes in SI units: beyond them products leave the range of floating-point numbers."""

_FINEST = 1e-9
"""[rad] by which an angle may be rounded: some 1.3 million turns are."""

_BEYOND = (
    f'is out of bounds: in SI units its size must be between {SMALLEST:g} and {LARGEST:g}, or 0'
)

EXAMPLES = {
    'm': '64 mm',
    'kg': '0.61 kg',
    'kg m^2': '2645 kg mm^2',
    'rad': '30 deg',
    'rad/s': '350 rpm',
    'rad/s^2': '20 rad/s^2',
    'rad/s^3': '500 rad/s^3',
    'm/s^2': '9.81 m/s^2',
    'm/s^3': '20 m/s^3',
    'm/s': '1 mm/s',
    'Pa s': '0.03 Pa s',
    'Pa': '210 GPa',
    'kg/m^3': '7850 kg/m^3',
    'm^2': '64 mm^2',
    'm^4': '341 mm^4',
    'Hz': '500 Hz',
    's': '20 ms',
    'N': '10 N',
    'N/m': '200 N/m',
    'N s/m': '5 N s/m',
    'N m': '0.1 N m',
    'N m/rad': '0.1 N m/rad',
    'N m s/rad': '0.01 N m s/rad',
    'N m/rad/s': '50 N m/rad/s',
    'N/m/s': '200 N/m/s',
    'm^3': '2 dm^3',
    'm^3/(N m)': '1e-7 mm^3/(N m)',
    'A': '2 A',
    'V': '24 V',
    'K': '293 K',
    'W': '50 W',
    '': '0.5',
}

_KNOWN = {
    'm': (Decimal(1), 'm'),
    'kg': (Decimal(1), 'kg'),
    's': (Decimal(1), 's'),
    'rad': (Decimal(1), 'rad'),
    'Hz': (Decimal(1), 'Hz'),
    'N': (Decimal(1), 'N'),
    'Pa': (Decimal(1), 'Pa'),
    'J': (Decimal(1), 'J'),
    'kJ': (Decimal(1000), 'J'),
    'W': (Decimal(1), 'W'),
    'kW': (Decimal(1000), 'W'),
    'mW': (Decimal('1e-3'), 'W'),
    'PS': (Decimal('735.49875'), 'W'),
    'mJ': (Decimal('1e-3'), 'J'),
    'km': (Decimal(1000), 'm'),
    'dm': (Decimal('1e-1'), 'm'),
    'cm': (Decimal('1e-2'), 'm'),
    'mm': (Decimal('1e-3'), 'm'),
    'um': (Decimal('1e-6'), 'm'),
    't': (Decimal(1000), 'kg'),
    'g': (Decimal('1e-3'), 'kg'),
    'ms': (Decimal('1e-3'), 's'),
    'us': (Decimal('1e-6'), 's'),
    'min': (Decimal(60), 's'),
    'kHz': (Decimal(1000), 'Hz'),
    'kN': (Decimal(1000), 'N'),
    'MN': (Decimal(1_000_000), 'N'),
    'daN': (Decimal(10), 'N'),
    'mN': (Decimal('1e-3'), 'N'),
    'kPa': (Decimal(1000), 'Pa'),
    'bar': (Decimal(100_000), 'Pa'),
    'MPa': (Decimal(1_000_000), 'Pa'),
    'GPa': (Decimal(1_000_000_000), 'Pa'),
    'deg': (Decimal('0.01745329251994329576923690768'), 'rad'),
    'mrad': (Decimal('1e-3'), 'rad'),
    'rpm': (Decimal('0.1047197551196597746154214461'), 'rad/s'),
    'mPa': (Decimal('1e-3'), 'Pa'),
    'in': (Decimal('0.0254'), 'm'),
    'inch': (Decimal('0.0254'), 'm'),
    'ft': (Decimal('0.3048'), 'm'),
    'lb': (Decimal('0.45359237'), 'kg'),
    'lbf': (Decimal('4.4482216152605'), 'N'),
    'kgf': (Decimal('9.80665'), 'N'),
    'g_0': (Decimal('9.80665'), 'm/s^2'),
}
"""Common units: factors to SI as pint has them, and the SI units that these lead to."""

_POWERS = {
    'm': (1, 0, 0), 'kg': (0, 1, 0), 's': (0, 0, 1), 'rad': (0, 0, 0), 'rad/s': (0, 0, -1),
    'Hz': (0, 0, -1), 'N': (1, 1, -2), 'Pa': (-1, 1, -2), 'J': (2, 1, -2), 'W': (2, 1, -3),
    'm/s^2': (1, 0, -2),
}  # fmt: skip
"""Dimensions in metre, kilogram and second."""

_ANGULAR, _HERTZ = ('rad', 'mrad', 'deg', 'rpm'), ('Hz', 'kHz')

_PER_MINUTE = re.compile(r'1?\s*/\s*min|min\s*(?:\^|\*\*)\s*-\s*1|min⁻¹', re.IGNORECASE)
"""Units that catalogues of motors and machines write where they mean revolutions per minute.

Taken by its dimension alone, ``1/min`` would be 1/60 rad/s.
"""
_OVER_PER_MINUTE = re.compile(r'/\s*(?:\(\s*1\s*/\s*min\s*\)|\(?min\^-1\)?)')
"""Units of damping per 1/min, as in ``N m/(1/min)``."""

_SIGNS = str.maketrans('·⋅∙•−', '****-')
_RAISED = str.maketrans('⁻⁰¹²³⁴⁵⁶⁷⁸⁹', '-0123456789')
_TRADE: tuple[tuple[re.Pattern[str], Any], ...] = (
    (re.compile('[⁻¹²³⁴]+'), lambda found: '^' + found[0].translate(_RAISED)),
    (re.compile(r'(?<=[A-Za-z])-(?=[A-Za-z])'), ' '),  # ft-lb, N-m
    (re.compile(r'(?<=[A-Za-z])([234])(?![\w^*])'), r'^\1'),  # kgm2
    # min-1; not of angles: 90 deg-1 in a formula is a difference of two angles
    (re.compile(r'(?<![A-Za-z])(min|[mu]?s|[cmu]?m|k?g|k?N|K|A|V)(-[1-4])(?![\w^*.])'), r'\1^\2'),
    (re.compile(r'(?<![A-Za-z])([mkM]?N|kgf?|kp)(mm|cm|m)(s?)(?![A-Za-z])'), r'\1 \2 \3'),  # Nm
    (re.compile(r'(?<![A-Za-z])(g)(mm|cm)(?![A-Za-z])'), r'\1 \2'),  # gmm, of unbalance
    (re.compile(r'(?<![A-Za-z])([mk]?N|m?Pa)(s)(?![A-Za-z])'), r'\1 \2'),  # Ns, Pas
    (re.compile(r'(?<![A-Za-z])(?:t?r|U|rev)\s*/\s*min\s*(?:\^|\*\*)\s*2(?!\d)', re.I), 'rpm/min'),
    (
        re.compile(
            r'(?<![a-z])(?:RPM|r\.p\.m\.?|(?:t?r|U|rev)\s*/\s*min)(?!\s*\*\*|[a-z^])', re.I
        ),
        'rpm',
    ),
    (re.compile(r'(?:deg|°)\s*(?:CA|KW)(?![A-Za-z])'), 'deg'),  # of the crank of an engine
    (re.compile(r'(?<![A-Za-z])lbm(?![A-Za-z])'), 'lb'),
    (re.compile(r'(?<![A-Za-z])kp(?![A-Za-z])'), 'kgf'),
    (re.compile(r'\s+(?=[*/^)]|$)|(?<=[*/(])\s+'), ''),
)
"""Spellings of products of units in workshops and catalogues, and those of the libraries."""

_BY_WEIGHT = re.compile(r'(?<![A-Za-z])(lb|lbs|pounds?|oz|ounces?)(?![A-Za-z])')
"""Units of mass that are forces where a force is wanted, as in ft-lb and oz in."""
_FORCES = {'l': 'lbf', 'p': 'lbf', 'o': 'ozf'}
_GERMAN_DEGREE = re.compile(r'(?<![A-Za-z])Grad(?![A-Za-z])')
"""German word for degrees, which as a unit would be a thousand million radians."""
_TON = re.compile(r'(?<![A-Za-z_])tons?(?![A-Za-z_])')
"""To pint 2000 pounds, to most people who write it 1000 kilograms."""
_KILOGRAM = re.compile(r'(?<![A-Za-z])kg(?![A-Za-z])')

_OPERATION = re.compile(r'\*|/\d')
"""Start of an operation, as in ``0.5*bar_rate`` and ``7/41``, with which no unit begins."""

_FRACTION = re.compile(r'\s*(?:(\d+)[\s-]\s*)?(\d+)\s*/\s*(0*[1-9]\d*)\s*([A-Za-z]+)\s*')
"""Fractions of inches: in a formula they would be one over them."""

_GRADE = re.compile(r'\s*(ISO[\s-]*)?(VG|SAE)', re.IGNORECASE)

_COMMA = re.compile(r'\s*[-+]?[\d.]*\d?,\d[\d.,]*')
_ROTATION = 'rad/s', 'rad/s^2', 'rad/s^3'
"""Wanted units whose angle has to be written: ``1/s`` may be a radian or a revolution a second."""

_FACTOR = re.compile(r'(\s+|\s*[*/]\s*|^)(g_0|[A-Za-z]+)(?:(?:\^|\*\*)(-?\d))?')


class _UnitFactor(NamedTuple):
    factor: Decimal  # [SI]
    powers: list[int]
    angular: float  #: power of angles
    hertz: bool


def _powers(text: str) -> list[tuple[str, int]]:
    """The units in a product, and their powers."""
    return [
        (name, int(exponent or 1) * (-1 if operator.strip() == '/' else 1))
        for operator, name, exponent in _FACTOR.findall(text)
    ]


def _respelled(unit: str) -> str:
    """A unit as the table and pint spell it: ``Nm`` is ``N m``, ``ft-lb`` is ``ft lb``."""
    unit = unit.translate(_SIGNS)
    for found, spelling in _TRADE:
        unit = found.sub(spelling, unit)
    return unit


def plain(value: Any) -> Any:
    """Numbers, arrays and data frames as those of Python, quantities of pint as text with units.

    All are known by what they can do, so that pint and pandas need not be there. As text
    quantities go the way of all others: frequencies are no rotations, decimal numbers stay exact.
    Durations are such as well.
    """
    if type(value) in _PLAIN_TYPES:
        return value
    if hasattr(value, 'dimensionality') and hasattr(value, 'to_base_units'):
        return _with_unit(plain(value.magnitude), f'{value.units:~C}')
    if isinstance(value, timedelta):  # one of pandas, too
        return _with_unit(value.total_seconds(), 's')
    if hasattr(value, 'to_numpy'):
        value = value.to_numpy()
    if (dtype := getattr(value, 'dtype', None)) is not None and dtype.kind == 'm':
        return _with_unit(durations(value).tolist(), 's')
    return value.tolist() if hasattr(value, 'tolist') else value


def durations(values: Any) -> Any:
    """Time differences of NumPy as its numbers [s]."""
    try:
        return values / values.dtype.type(1, 's')
    except TypeError:  # NumPy has no days of a month
        raise InputError(f'a time in months or years has no length in seconds: {values}') from None


def _with_unit(numbers: Any, unit: str) -> Any:
    if isinstance(numbers, list):
        return [_with_unit(x, unit) for x in numbers]
    return f'{float(numbers)!r} {unit}'.strip()


@lru_cache
def _common_unit(text: str) -> _UnitFactor | None:
    """A product of different common units, without pint; none for anything else."""
    factors = _powers(text)
    names = {name for name, _ in factors}
    if _FACTOR.sub('', text) or len(names) < len(factors) or not names <= _KNOWN.keys():
        return None
    product, powers = Decimal(1), [0, 0, 0]
    for name, power in factors:
        factor, si = _KNOWN[name]
        product *= factor**power
        powers = [total + power * p for total, p in zip(powers, _POWERS[si], strict=True)]
    angular = sum(power for name, power in factors if name in _ANGULAR)
    return _UnitFactor(product, powers, angular, not names.isdisjoint(_HERTZ))


def to_si_like(value: object, unit: str) -> float:
    """A quantity in any SI unit, as `to_si`; a plain number also in percent."""
    match = _NUMBER.fullmatch(value) if isinstance(value, str) else None
    if match and not unit and match[2].strip() == '%':  # as shares are shown
        return to_si(match[1], '') / 100.0
    if unit in EXAMPLES or not match or not match[2].strip():
        return to_si(value, unit if unit in EXAMPLES else '')
    found = read_common(match[1], _respelled(match[2].strip()))
    if not alike(found.unit, unit):
        raise ValueError(f"has the unit '{match[2].strip()}', which is not a unit of '{unit}'")
    return found.value


def to_si_text(value: object) -> QuantityValue:
    """A quantity in any product of common units; a bare number has none."""
    value = plain(value)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return QuantityValue(to_si(value, ''), '')
    if isinstance(value, str):
        _refuse_comma(value, "write for example '64 mm'")
    match = _NUMBER.fullmatch(value) if isinstance(value, str) else None
    if not match:
        raise ValueError("is not a number with a unit: write for example '64 mm'")
    unit = _respelled(match[2].strip())
    return read_common(match[1], unit) if unit else QuantityValue(float(match[1]), '')


def parted(text: str) -> tuple[str, str] | None:
    """The number and the unit of a quantity as they are written; None of another text."""
    found = _NUMBER.fullmatch(text)
    return (found[1], found[2].strip()) if found else None


def as_revolutions(value: Any) -> Any:
    """A text in ``1/min`` as one in rpm, which it is where a rotational speed is wanted."""
    match = _NUMBER.fullmatch(value) if isinstance(value, str) else None
    if match and _PER_MINUTE.fullmatch(_respelled(match[2].strip())):
        return f'{match[1]} rpm'
    return value


def alike(a: str, b: str) -> bool:
    """True if quantities in two SI units can be added; angles count as plain numbers."""
    first, second = _common_unit(a), _common_unit(b)
    return (first and first.powers) == (second and second.powers)


@lru_cache
def common(unit: str) -> str:
    """A product of common units as `read_common` reads it, ``N m`` of ``Nm``; else nothing."""
    spelled = _respelled(unit)
    names = [name for name, _ in _powers(spelled)]
    known = names and not _FACTOR.sub('', spelled) and _KNOWN.keys() >= {*names}
    return spelled if known else ''


def read_common(number: str, unit: str) -> QuantityValue:
    """A quantity in a product of common units, in SI units; ``1 kN mm`` is 1 N m."""
    known = _common_unit(unit)
    if known is None:
        raise ValueError(f"'{unit}' is not a product of different units: {', '.join(_KNOWN)}")
    si = ''
    for name, power in _powers(unit):
        si = product(si, _KNOWN[name][1], power)
    return QuantityValue(float(Decimal(number) * known.factor), si)


def product(a: str, b: str, power: int = 1) -> str:
    """The SI unit of a quantity in `a` times one in `b` to a power; angles give way to others."""
    powers: Counter[str] = Counter()
    for text, sign in ((a, 1), (b, power)):
        for factor, own in _powers(text):
            powers[factor] += sign * own
    if {name for name, n in powers.items() if n} - {'rad', 's'}:
        del powers['rad']
    name = _PLAIN.get(frozenset((name, n) for name, n in powers.items() if n))
    if name is not None:
        return name
    above, below = (
        [
            f'{name}^{abs(n)}' if abs(n) > 1 else name
            for name, n in sorted(powers.items(), key=lambda item: (item[0] != 'N', item[0]))
            if n * sign > 0
        ]
        for sign in (1, -1)
    )
    return '/'.join([' '.join(above) or '1' * bool(below), *below])


def power_hint(text: str) -> str:
    """A clause on ``600 s-1``, which as a formula is a difference; else nothing."""
    unit = re.fullmatch(r'[-+.\deE]+ *([A-Za-z][A-Za-z /]*)(-[1-4])', text.strip())
    return f"; a power of a unit is written with ^, as '{unit[1]}^{unit[2]}'" if unit else ''


def root(unit: str) -> str | None:
    """The unit whose square this is; none of an odd power."""
    found = ''
    for name, power in _powers(unit):
        if power % 2:
            return None
        found = product(found, name, power // 2)
    return found


_PLAIN = {
    frozenset((('N', 1), ('m', 1), ('s', -1))): 'W',
    frozenset((('J', 1), ('s', -1))): 'W',
    frozenset((('W', 1), ('s', 1))): 'J',
    frozenset((('s', -1),)): 'Hz',
}
"""Products that have a name of their own."""


@cache
def _registry() -> Any:
    import pint  # noqa: PLC0415 - costs 0.3 s, and the common units need none of it

    # Decimal makes 2645 kg mm^2 the float nearest to 0.002645 kg m^2.
    ureg: Any = pint.UnitRegistry(non_int_type=Decimal, cache_folder=None)
    ureg.define('@alias revolution = rev')
    return ureg


def typeset(unit: str) -> str:
    """A unit as it is printed: products with a dot, powers raised."""
    raised = str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹')
    powers = re.sub(r'\^(-?\d+)', lambda found: found[1].translate(raised), unit)
    return re.sub(r'(?<! or)(?<! per) (?!or |per )', '·', powers)


_FOR_PEOPLE = {'rad': ('deg', math.degrees(1.0)), 'm': ('mm', 1e3)}

_LARGE = {
    'N': (1e4, 'kN', 1e-3), 'N m': (1e4, 'kN m', 1e-3), 'J': (1e4, 'kJ', 1e-3),
    'W': (1e4, 'kW', 1e-3), 'Pa': (1e5, 'MPa', 1e-6), 'm': (10.0, 'm', 1.0),
}  # fmt: skip
_SMALL = {
    'N s': (1.0, 'mN s'), 'N m s': (1.0, 'mN m s'), 's': (0.1, 'ms'), 'J': (0.1, 'mJ'),
    'N': (0.1, 'mN'), 'N m': (0.1, 'mN m'), 'W': (0.1, 'mW'), 'm': (0.01, 'mm'),
}  # fmt: skip


def for_people(unit: str, size: float = 0.0) -> tuple[str, float]:
    """The unit in which people read a quantity, and by what its SI value is multiplied.

    Parameters
    ----------
    size : largest of the values that are read together, in the SI unit; large forces are in kN,
        large stresses in MPa, small impulses in mN s, short times in ms, lengths in m from 10 m
        on and in µm below 0.01 mm; 0 if it is not known
    """
    least, large, factor = _LARGE.get(unit, (math.inf, '', 1.0))
    if least <= size < math.inf:
        return large, factor
    below, small = _SMALL.get(unit, (0.0, ''))
    for step, prefix in enumerate('mµnp', 1):
        if below * 1e-3**step <= size < below:
            return f'{prefix}{small[1:]}', 1e3**step
    return _FOR_PEOPLE.get(unit, (unit, 1.0))


def number(value: float, digits: int = 4, sign: str = '') -> str:
    """A number as it is printed: without a power of ten unless it is far from 1."""
    text = f'{value:{sign}.{digits}g}'
    if 'e' not in text:
        return text
    mantissa, power = text.split('e')
    return f'{Decimal(text):{sign}f}' if abs(int(power)) < 6 else f'{mantissa}e{int(power)}'


def digits_apart(values: Iterable[float], least: int = 4) -> int:
    """Significant digits, of a float at most, of which two tell the closest values apart."""
    at = sorted({unrounded(x) for x in values if math.isfinite(x)})
    steps = [b - a for a, b in pairwise(at)]
    if not steps:
        return least
    return min(15, max(least, math.ceil(math.log10(max(map(abs, at)) / min(steps))) + 2))


def counted(count: int, noun: str, form: str = 'd') -> str:
    """Format a count with its noun: 1 impact, 12 impacts."""
    return f'{count:{form}} {noun}{"s" * (abs(count) != 1)}'


def unrounded(value: float) -> float:
    """The number of 15 digits that is nearest: without what conversion of units has rounded."""
    return float(f'{value:.15g}')


def instant(time: float, digits: int = 9) -> str:
    """A time [s] as it is printed; of one that counts from 1970, say, to the microsecond."""
    if abs(time) < 10.0 ** (digits - 3):
        return f'{time:.{digits}g}'
    return f'{time:.6f}'.rstrip('0').rstrip('.')


_USUAL = {
    'm': ('mm', 'm', 'um'), 'rad/s': ('rpm', 'rad/s'), 'rad': ('deg', 'rad'), 'kg': ('kg', 'g'),
    's': ('s', 'ms', 'us'), 'N': ('N', 'kN'), 'N/m': ('N/m', 'N/mm', 'kN/mm'),
    'Pa': ('MPa', 'GPa', 'Pa'), 'kg m^2': ('kg m^2', 'kg mm^2'),
}  # fmt: skip
"""Units in which values of a scene are given, by that in SI."""


def given(text: str) -> str:
    """A quantity in SI units as people give it: 0.000254 m as 0.254 mm."""
    try:
        value, unit = to_si_text(text)
    except ValueError:
        return text
    for usual in _USUAL.get(unit, ()):
        size = value / to_si(f'1 {usual}', unit)
        shown = f'{size:.6g} {usual}'
        if 1e-3 <= abs(size) < 1e4 and math.isclose(to_si(shown, unit), value, rel_tol=1e-12):
            return shown
    return text


def written(value: float, unit: str, digits: int = 4) -> str:
    """A quantity as people read it: 12.9 kN, 3.1 µs."""
    shown, scale = for_people(unit, abs(value))
    return f'{number(scale * value, digits)} {shown}'.rstrip()


def to_si(value: object, unit: str) -> float:
    """A quantity in SI units.

    Parameters
    ----------
    value : text such as ``'64 mm'``, or a number, which is taken to be in `unit`; NumPy's and
        pint's are like them
    unit : the SI unit wanted, one of the keys of `EXAMPLES`
    """
    hint = f"write for example '{EXAMPLES[unit]}'"
    value = plain(value)
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f'is not a quantity: {hint}')
    if isinstance(value, int) and abs(value) > LARGEST:  # may be more than a float can be
        raise ValueError(_BEYOND)
    number = float(value) if isinstance(value, int | float) else _text_to_si(value, unit, hint)
    if LARGEST < abs(number) < math.inf or 0.0 < abs(number) < SMALLEST:
        raise ValueError(_BEYOND)
    return number


def resolved(angle: float) -> float:
    """An angle [rad], refused if it counts so many turns that floating point loses its place."""
    if _FINEST < (rounding := 0.5 * math.ulp(angle)) < math.inf:
        raise ValueError(
            f'is so many turns that it is rounded by {rounding:.1g} rad: take off whole turns'
        )
    return angle


_PER_LENGTH = re.compile(r'(.+?)/\s*(\w+?)\s*(?:(?:\^|\*\*)\s*\(?(3/2|\d*\.?\d+)\)?)?')


def to_stiffness(value: object, exponent: float) -> float:
    """A stiffness of contact in N/m^exponent, as ``2 GN/m^1.5`` or ``60 kN/mm^1.5``."""
    hint = f"write for example '2e9 N/m^{exponent:g}'"
    value = plain(value)
    match = _NUMBER.fullmatch(value) if isinstance(value, str) else None
    if not isinstance(value, str) or not match or not match[2].strip():
        return to_si(value, '')
    _refuse_comma(value, hint)
    unit = match[2].strip()
    parts = _PER_LENGTH.fullmatch(_respelled(unit))
    wrong = f"has the unit '{unit}', which is not a force per length: {hint}"
    if not parts:
        raise ValueError(wrong)
    power = 1.5 if parts[3] == '3/2' else float(parts[3] or 1.0)
    if power != exponent:
        raise ValueError(
            f"has the unit '{unit}', but the exponent is {exponent:g}: {hint}, or give 'exponent'"
        )
    try:
        force, length = to_si(f'1 {parts[1]}', 'N'), to_si(f'1 {parts[2]}', 'm')
    except ValueError as error:
        raise ValueError(wrong) from error
    scale = Decimal(repr(force)) / Decimal(repr(length)) ** Decimal(repr(power))
    return float(Decimal(match[1]) * scale)


@overload
def argument(name: str, value: None, unit: str) -> None: ...


@overload
def argument(name: str, value: float | str, unit: str) -> float: ...
def argument(name: str, value: float | str | None, unit: str) -> float | None:
    """An argument of a function in SI units; None stays None."""
    if value is None:
        return None
    try:
        number = to_si(value, unit)
        if math.isnan(number):
            raise ValueError('is not a number')
        return resolved(number) if unit == 'rad' else number
    except ValueError as error:
        raise InputError(f'{name} = {quoted(value)} {error}') from error


class QuantityValue(NamedTuple):
    """A number in an SI unit, which is empty for a bare number."""

    value: float
    unit: str


def to_si_of(value: object, units: tuple[str, ...]) -> QuantityValue:
    """A quantity in the first of several SI units that it fits; a bare number fits any."""
    if isinstance(value, QuantityValue):
        return value
    value = plain(value)
    if isinstance(value, list | tuple) and len(value) == 2 and value[1] in ('', *units):
        return QuantityValue(to_si(value[0], value[1]), value[1])  # as JSON has it
    said = []
    for unit in units:
        try:
            found = to_si(value, unit)
        except ValueError as error:
            if str(error) == _BEYOND:
                raise
            said.append(str(error).partition(': write for example')[0])
            continue
        bare = unit != units[-1] and not (isinstance(value, str) and _NUMBER.sub(r'\2', value))
        return QuantityValue(found, '' if bare else unit)
    examples = ' or '.join(f"'{EXAMPLES[unit]}'" for unit in units)
    others = ''.join(f" or '{unit}'" for unit in units[1:]) if ' not a unit of ' in said[0] else ''
    raise ValueError(f'{said[0]}{others}: write for example {examples}')


def _text_to_si(value: str, unit: str, hint: str) -> float:
    found = _read(value, unit, hint)
    if isinstance(found, str):
        raise ValueError(found)
    return found


@lru_cache(maxsize=4096)
def _read(value: str, unit: str, hint: str) -> float | str:
    """A text in SI units, or why it is none: a sweep reads the same ones for every run."""
    try:
        return _parsed(value, unit, hint)
    except ValueError as error:
        return str(error)


def _parsed(value: str, unit: str, hint: str) -> float:
    if len(value) > _LONGEST:
        raise ValueError(f'is longer than {_LONGEST} characters: {hint}')
    _refuse_comma(value, hint)
    match = _NUMBER.fullmatch(value)
    if unit == 'Pa s' and _GRADE.match(value):
        raise ValueError(
            'is a grade of oil, not its viscosity (an ISO VG is kinematic, in mm^2/s at 40 deg C: '
            f'multiply it by the density): {hint}'
        )
    if unit == 'm' and (fraction := _FRACTION.fullmatch(value)):
        whole, above, below, given = fraction.groups()
        decimal = int(whole or 0) + int(above) / int(below)
        raise ValueError(
            f'has a fraction where a decimal number belongs, as in {decimal:.10g} {given}: {hint}'
        )
    if not match:
        raise ValueError(f'is not a number{" with a unit" if unit else ""}: {hint}')
    number, given = match[1], match[2].strip()
    written = abs(float(number))
    if written == math.inf or (not written and re.search('[1-9]', number.lower().split('e')[0])):
        raise ValueError(_BEYOND)
    if not given:
        return float(number)
    if not unit:
        raise ValueError(f"has the unit '{given}' where a plain number belongs: {hint}")
    read = _respelled(given)
    if not _UNIT.fullmatch(read) or _NO_UNIT.search(given):
        raise ValueError(f"has the unknown unit '{given}': {hint}")
    if unit == 'rad/s' and _PER_MINUTE.fullmatch(read):
        read = 'rpm'
    elif unit == 'N m s/rad':
        read = _OVER_PER_MINUTE.sub('/rpm', read)
    elif unit == 'm/s^2' and read in ('g', 'G'):
        read = 'g_0'
    try:
        return _converted(number, read, given, unit, hint)
    except ValueError:
        as_force = _BY_WEIGHT.sub(lambda found: _FORCES[found[1][0]], read)
        if as_force != read:
            with suppress(ValueError):
                return _converted(number, as_force, given, unit, hint)
        raise


def _converted(number: str, read: str, given: str, unit: str, hint: str) -> float:
    """A number in a unit, `given` as it is written and `read` as libraries spell it."""
    written_in, wanted = _common_unit(read), _common_unit(unit)
    if written_in is None or wanted is None:
        if _OPERATION.match(read):  # loading pint, which says so too, takes most of a second
            raise ValueError(f"has the unknown unit '{given}': {hint}")
        return _converted_by_pint(number, read, given, unit, hint)
    fits = written_in.powers == wanted.powers
    if not fits or _mixed(unit, written_in.angular, written_in.hertz):
        raise ValueError(_other(given, unit, hint, fits))
    return float(Decimal(number) * written_in.factor)


def has_decimal_comma(text: str) -> bool:
    """True if a text begins as ``1,5 mm``, as neither a quantity nor a formula may."""
    return bool(_COMMA.match(text))


def _refuse_comma(value: str, hint: str) -> None:
    """Refuse ``1,5 mm``, and say how it is written with a point."""
    if not (found := _COMMA.match(value)):
        return
    number = found[0].strip()
    whole, _, decimals = number.rpartition(',')
    if '.' in decimals or ',' in whole:  # 1,500.5 and 1,500,000
        said = number.replace(',', '')
    else:
        said = f'{whole.replace(".", "")}.{decimals}'
        if len(decimals) == 3 and '.' not in whole and whole.lstrip('+-') != '0':
            said += f' or {whole}{decimals}'
    raise ValueError(f'has a decimal comma, {number}, where a point belongs, as in {said}: {hint}')


def _mixed(unit: str, angular: float, hertz: bool) -> bool:
    """True if a unit of the right dimension counts something else than the wanted one.

    A frequency is not an angular velocity, although both are 1/s; nor is the square of one an
    angular acceleration.
    """
    if unit in _ROTATION:
        return hertz or angular != 1
    return bool(angular) if unit == 'Hz' else 'rad' in unit and hertz


def _other(given: str, unit: str, hint: str, fits: bool) -> str:
    said = ' (it may mean rev/s or rad/s)' if fits and unit == 'rad/s' else ''
    if unit == 'Pa s' and not fits:
        with suppress(ValueError):
            _converted('1', _respelled(given), given, 'm^2/s', '')
            said = ' (it is one of kinematic viscosity: multiply by the density)'
    if unit == 'm' and given == 'mil':  # to pint an angle
        said = " (a thousandth of an inch is a 'thou')"
    weight = _KILOGRAM.sub('kgf', _respelled(given))
    if not fits and weight != _respelled(given):
        with suppress(ValueError):
            _converted('1', weight, weight, unit, '')
            said = f" (a mass; its weight is in '{weight}')"
    return f"has the unit '{given}', which is not a unit of '{unit}'{said}: {hint}"


def _converted_by_pint(number: str, read: str, given: str, unit: str, hint: str) -> float:
    if _GERMAN_DEGREE.search(read):
        raise ValueError(
            f"has the unit '{given}', in which Grad is 1e9 radians: degrees are 'deg': {hint}"
        )
    if _TON.search(read):
        raise ValueError(
            f"has the unit '{given}', in which a ton may be 1000 kg, 't', or 907.18474 kg, "
            f"'short_ton': {hint}"
        )
    ureg = _registry()
    try:
        quantity = ureg.Quantity(Decimal(number), read)
    except Exception as error:  # pint raises many kinds: unknown units, syntax, tokens
        raise ValueError(f"has the unknown unit '{given}': {hint}") from error
    wanted = ureg.Unit('1/s' if unit == 'Hz' else unit)
    angles = re.compile('rad|deg|rev|turn|arc')
    angular = sum(power for name, power in quantity.unit_items() if angles.search(name))
    fits = bool(quantity.is_compatible_with(wanted))
    if not fits or _mixed(unit, angular, 'hertz' in str(quantity.units)):
        raise ValueError(_other(given, unit, hint, fits))
    return float(quantity.to(wanted).magnitude)
