"""Keys of motions over time: by a formula, by points in a scene or a file, by moves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest, other_word, quoted
from mechanism_sim.keys.quantities import (
    FROM_FILE,
    AnyPosition,
    Duration,
    Part,
    Time,
    UnitValue,
    named_file,
    si_of,
)
from mechanism_sim.numerics import formula
from mechanism_sim.numerics.curves import Interpolation, spline
from mechanism_sim.numerics.expressions import (
    FUNCTIONS,
    OTHER_WORDS,
    ExpressionNode,
    check_bare_numbers,
    parse,
    unit_hint,
    unit_of,
)
from mechanism_sim.numerics.time_series import TimeSeries
from mechanism_sim.planar.drive import FormulaLaws, curve_laws
from mechanism_sim.scene.formula_keys import or_formula
from mechanism_sim.units import QuantityValue, alike, power_hint, to_si_of

Pace = Annotated[QuantityValue, si_of('rad/s', 'm/s')]
AnyAcceleration = Annotated[QuantityValue, si_of('rad/s^2', 'm/s^2')]
_AnyJerk = Annotated[QuantityValue, si_of('rad/s^3', 'm/s^3')]


_OTHER_WORDS = OTHER_WORDS | dict.fromkeys(
    ('step', 'step5', 'havsin'), "'points' with 'ends: rest', cubic or quintic, or 'moves'"
)


def _positive(value: QuantityValue) -> QuantityValue:
    if not 0.0 < value.value < math.inf:
        raise ValueError('is out of bounds: it must be more than 0')
    return value


_POSITIVE_VALUE = AfterValidator(_positive)


class MotionProfile(Part):
    """A quantity over time: a formula, or points in the scene or in a file."""

    of_files: ClassVar[tuple[str, ...]] = FROM_FILE
    _usual: ClassVar[Interpolation | None] = None  # interpolation, where none is given

    formula: str | None = None
    """Of the time t, as "90 deg + 60 deg*sin(pi*t)"; it may stand by itself instead of these keys.
    A speed must not step, a position not even its speed.
    """
    interpolation: Interpolation | None = None
    """Between points; the default of positions is cubic. Its acceleration does not jump, nor do
    three derivatives more of a quintic; linear is for speeds.
    """
    periodic: bool = False
    """The points are those of a period, which repeats: it ends with the value with which it
    begins, a position also whole turns on.
    """
    ends: Literal['free', 'rest'] = 'free'
    """At the first and the last point: as the points have it, or at rest."""

    @model_validator(mode='before')
    @classmethod
    def _formula_alone(cls, data: Any) -> Any:
        """A formula, or a quantity, instead of keys."""
        if isinstance(data, str | int | float) and not isinstance(data, bool):
            return {'formula': str(data)}
        return data

    @property
    def given(self) -> Sequence[tuple[float, QuantityValue]]:
        """The points, if there are any."""
        return getattr(self, 'points', None) or ()

    @classmethod
    def units(cls) -> tuple[str, str]:
        """Units of a rotation and of a displacement."""
        raise NotImplementedError

    @model_validator(mode='after')
    def _is_profile(self) -> MotionProfile:
        points = self.given
        if (self.formula is None) == (not points):
            both = 'both' if points else 'none'
            raise ValueError(f"has {both} of 'formula' and 'points': give one of them")
        if self.formula is not None:
            beside = sorted(self.model_fields_set - {'formula'})
            if beside and any(
                getattr(self, k) != type(self).model_fields[k].default for k in beside
            ):
                raise ValueError(f"has a formula and '{beside[0]}', which applies to points")
            self.tree()
            return self
        if not all(math.isfinite(t) and math.isfinite(x.value) for t, x in points):
            raise ValueError('has points that are not finite')
        if len(units := {x.unit for _, x in points if x.unit}) > 1:  # bare numbers fit any
            raise ValueError(f'has points in {" and in ".join(sorted(units))}: give all in one')
        if self.periodic and self.ends == 'rest':
            raise ValueError("is periodic and has 'ends: rest': keep one")
        if self.ends == 'rest' and (self.interpolation or self._usual) in (None, 'linear'):
            raise ValueError(
                "has 'ends: rest', which applies to points with cubic or quintic interpolation"
            )
        self._check_points(points)
        return self

    def _check_points(self, points: Sequence[tuple[float, QuantityValue]]) -> None:
        """Refuse points through which no course leads."""

    def check_rising(self) -> None:
        """Raise a ValueError if the times do not rise."""
        for (before, _), (after, _) in pairwise(self.given):
            if after <= before:
                raise ValueError(
                    f'has points whose times must increase, but {after:g} s follows {before:g} s'
                )

    def spline(self) -> tuple[Array, Array]:
        """Breaks and rows of `numerics.curves.spline` through the points, with its ValueError."""
        self.check_rising()
        x, y = np.array([(t, value.value) for t, value in self.given]).T
        how = self.interpolation or 'cubic'
        return spline(x, y, how, self.periodic, self.ends == 'rest')

    @property
    def unit(self) -> str:
        """Unit in which the quantity is given; empty if it is open."""
        if self.given:
            return next((x.unit for _, x in self.given if x.unit), '')
        wanted = [
            u
            for u in self.units()
            if alike(_unit_of_formula(self.tree(), str(self.formula), self.units()) or '', u)
        ]
        written = any(n.unit and not alike(n.unit, 's') for n in self.tree().walk())
        return wanted[0] if len(wanted) == 1 and written else ''

    @property
    def words(self) -> str:
        """The kind of motion, in words."""
        what = 'positions' if self.units()[0] == 'rad' else 'speeds'
        if self.formula is not None:
            return f'{what[:-1]} {self.formula}'
        how = self.interpolation or self._usual
        again = ', periodic' if self.periodic else ''
        return f'{len(self.given)} {what}{f", {how}" if how else " with ramps"}{again}'

    def tree(self) -> ExpressionNode:
        """The formula, checked."""
        text = str(self.formula)
        try:
            for called in (n.name for n in parse(text, None).walk() if n.kind == 'call'):
                if called not in FUNCTIONS:
                    hint = other_word(called, _OTHER_WORDS) or nearest(called, FUNCTIONS)
                    raise ValueError(
                        f"calls '{called}'{hint}, which is not a function of formulas of "
                        "motions: points of a table stand here themselves, as 'points' or "
                        "'file'"
                    )
            root = formula.read(text)
            for name in root.names:
                if name != 't':
                    hint = (
                        named_file(text)
                        or unit_hint(name)
                        or nearest(name, ['t', 'pi', *FUNCTIONS])
                    )
                    raise ValueError(f"names '{name}'{hint}; it may name the time t, and pi")
            _unit_of_formula(root, text, self.units())
        except InputError as error:
            raise ValueError(f'cannot be read: {error}') from error
        return root


def _unit_of_formula(root: ExpressionNode, text: str, units: tuple[str, str]) -> str | None:
    """Unit of a formula of t, which is in seconds, or a bare number beside bare numbers."""
    said: InputError | None = None
    for time in ('s', None):
        try:
            found = unit_of(root, {'t': time}, text)
        except InputError as error:
            said = error
            continue
        if found is None or any(alike(found, unit) for unit in units):
            check_bare_numbers(root, {'t': time}, text)
            return found
        said = InputError(
            f'{quoted(text)} is in {found or "no unit"}, not in {" or ".join(units)}'
            f'{power_hint(text)}'
        )
    if all(alike(n.unit or '', '') for n in root.walk()):  # degrees are plain numbers
        return None
    assert said is not None  # noqa: S101 - a way failed
    raise said


class PositionPart(MotionProfile):
    """A position over time: a formula, or points in the scene or in a file."""

    _usual: ClassVar[Interpolation | None] = 'cubic'

    points: list[tuple[Time, AnyPosition]] | None = Field(None, min_length=2)
    """List of [time, position] with rising times; before the first and after the last the speed
    stays. Instead of it `file` names a file of comma-separated values beside the scene, and
    `columns` two of its columns, else the first two; headings may have units in brackets.
    """

    @classmethod
    def units(cls) -> tuple[str, str]:
        """Units of a rotation and of a displacement."""
        return 'rad', 'm'

    def _check_points(self, points: Sequence[tuple[float, QuantityValue]]) -> None:
        first, last = points[0][1].value, points[-1][1].value
        turns = last - first
        off = turns if self.unit == 'm' else math.remainder(turns, 2.0 * math.pi)
        if self.periodic and abs(off) > 1e-9 * max(abs(first), abs(last), abs(turns)):
            raise ValueError(
                f'is periodic, but begins at {first:g} and ends at {last:g} {self.unit}: end '
                'where it begins'
                f'{"" if self.unit == "m" else ", or whole turns further"}'
            )
        if self.interpolation == 'linear' and len(points) > 2:
            raise ValueError(
                'has linear interpolation of positions, whose speed would jump at every point, '
                'which takes infinite forces: choose cubic or quintic'
            )
        self.spline()

    @property
    def at_start(self) -> tuple[float, float]:
        """Position and speed at time zero, but for whole periods [rad, m]."""
        if self.formula is not None:
            law = FormulaLaws('', TimeSeries(self.tree(), self.formula), True, False).first()
        else:
            law = curve_laws('', *self.spline(), None, True)[0]
        value, speed, *_ = *law.about(Fraction(0))[1], 0.0
        return value, speed


class SpeedPart(MotionProfile):
    """Speeds over time: a formula, or points joined by ramps or by a spline."""

    points: list[tuple[Time, Pace]] | None = Field(None, min_length=1)
    """List of [time, speed] with rising times; before the first and after the last the speed
    stays. Or `file` and `columns`, as of positions.
    """
    ramp: Literal['linear', 'smooth'] | None = None
    """Between two points, as from one steady speed to another; smooth begins and ends without
    acceleration at every point; through points of a curve take `interpolation`.
    """

    @classmethod
    def units(cls) -> tuple[str, str]:
        """Units of a rotation and of a displacement."""
        return 'rad/s', 'm/s'

    def _check_points(self, points: Sequence[tuple[float, QuantityValue]]) -> None:
        if self.ramp and self.interpolation:
            raise ValueError("has 'ramp' and 'interpolation': keep one")
        first, last = points[0][1].value, points[-1][1].value
        if self.periodic and (len(points) < 2 or abs(last - first) > 1e-9 * abs(first)):
            raise ValueError(
                f'is periodic, but begins at {first:g} and ends at {last:g} {self.unit}: end with '
                'the speed with which it begins'
            )


def _read_speed(value: Any) -> Any:
    """A quantity, or the keys of a `SpeedPart`."""
    if isinstance(value, dict | SpeedPart):
        return value
    found = _QUANTITY.read(value)
    if not isinstance(found, str):
        return found
    if (names := parse(found, None).names) and 't' not in names:
        to_si_of(value, _QUANTITY.units)  # which says what a quantity is
    return {'formula': found}


_QUANTITY = or_formula('rad/s', 'm/s')

Speed = Annotated[
    Annotated[QuantityValue, Tag('quantity')] | Annotated[SpeedPart, Tag('course')],
    Discriminator(lambda x: 'course' if isinstance(x, dict | SpeedPart) else 'quantity'),
    UnitValue(_read_speed, ('rad/s', 'm/s'), 'a formula of t, or points'),
]
"""A constant speed, or one over time."""


class MovePart(Part):
    """A move from rest to rest, or a dwell; its own limits go before those of all moves."""

    to: AnyPosition | None = None
    """Its end."""
    by: AnyPosition | None = None
    """Displacement, with its sign."""
    dwell: Duration | None = None
    """Duration of a dwell instead."""
    speed: Annotated[Pace, _POSITIVE_VALUE] | None = None
    """Largest speed."""
    acceleration: Annotated[AnyAcceleration, _POSITIVE_VALUE] | None = None
    """Largest acceleration."""
    jerk: Annotated[_AnyJerk, _POSITIVE_VALUE] | None = None
    """Largest rate of the acceleration."""

    @model_validator(mode='after')
    def _one_step(self) -> MovePart:
        kinds = [k for k in ('to', 'by', 'dwell') if getattr(self, k) is not None]
        if len(kinds) != 1:
            found = ' and '.join(kinds) or 'none'
            raise ValueError(f"has {found}: it needs one of 'to', 'by' and 'dwell'")
        return self


class MovesPart(Part):
    """Moves from rest to rest in the least time that limits allow, one after the other."""

    steps: list[MovePart] = Field(min_length=1)
    """Moves and dwells, as [{to: 90 deg}, {dwell: 0.5 s}, {by: -30 deg}]."""
    speed: Annotated[Pace, _POSITIVE_VALUE]
    """Largest speed."""
    acceleration: Annotated[AnyAcceleration, _POSITIVE_VALUE]
    """Largest acceleration."""
    jerk: Annotated[_AnyJerk, _POSITIVE_VALUE] | None = None
    """Largest rate of the acceleration; without it the acceleration steps."""
    repeat: bool = False
    """Repeat the moves; then the last one must end where the first begins, or whole turns on."""


class SwingPart(Part):
    """Oscillation between the limits of the linkage of a single drive."""

    period: Duration
    """Period of the oscillation."""
    margin: Annotated[AnyPosition, _POSITIVE_VALUE] | None = None
    """Distance that it keeps from each limit; without it a hundredth of the way between them."""
