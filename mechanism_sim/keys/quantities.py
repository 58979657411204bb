"""Quantities in files: units, bounds, and the base of all parts.

Values are read with units (``64 mm``) and stored in SI units.
"""

from __future__ import annotations

import ast
import inspect
import math
import re
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, TypeVar, get_args, get_origin

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    model_validator,
)
from pydantic_core import CoreSchema, core_schema

from mechanism_sim.errors import InputError
from mechanism_sim.units import EXAMPLES, QuantityValue, plain, resolved, to_si, to_si_of


@dataclass(frozen=True)
class UnitValue:
    """An annotation of fields: values with units are converted before validation."""

    read: Callable[[Any], Any]  #: function that converts a value of a file to a number
    units: tuple[str, ...]  #: possible SI units; empty for a plain number
    other: str = ''  #: description of other allowed values
    pair: bool = False  #: True if a list of two is allowed

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(
        self, _: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        one = {'type': ['number', 'string'], 'examples': [EXAMPLES[unit] for unit in self.units]}
        if not self.pair:
            return one
        return {'anyOf': [one, {'type': 'array', 'items': one, 'minItems': 2, 'maxItems': 2}]}


def si(unit: str) -> UnitValue:
    """Conversion of text with a unit, or of a number, to a number in `unit`."""
    return UnitValue(lambda value: to_si(value, unit), (unit,))


def si_of(*units: str) -> UnitValue:
    """A quantity of one of several kinds, depending on its context."""
    return UnitValue(lambda value: to_si_of(value, units), units)


_FINITE = Field(allow_inf_nan=False)
POSITIVE = Field(gt=0.0, allow_inf_nan=False)
NOT_NEGATIVE = Field(ge=0.0, allow_inf_nan=False)

Length = Annotated[float, si('m'), POSITIVE]
Position = Annotated[float, si('m'), _FINITE]


def one_or_two(unit: str, other: str, least: float = -math.inf) -> UnitValue:
    """One quantity in `unit`, or a pair of them, each finite and at least `least`."""

    def read(value: Any) -> float | tuple[float, ...]:
        value = plain(value)
        alone = not isinstance(value, list | tuple)
        numbers = tuple(to_si(x, unit) for x in ([value] if alone else value))
        if not alone and len(numbers) != 2:
            raise ValueError(f'must be one quantity or two: write {other}')
        if not all(least <= x < math.inf for x in numbers):
            raise ValueError(f'must be finite{"" if least else " and at least 0"}')
        return numbers[0] if alone else numbers

    return UnitValue(read, (unit,), other, pair=True)


def si_or_point(point: str, *units: str) -> UnitValue:
    """A quantity as in `si_of`, or [x, y] of a point in another unit."""

    def read(value: Any) -> Any:
        said = value if isinstance(value, QuantityValue) else plain(value)
        alone = isinstance(said, QuantityValue) or not isinstance(said, list | tuple)
        if alone or (len(said) == 2 and said[1] in ('', *units)):  # a quantity in JSON
            return to_si_of(said, units)
        if len(said) != 2:
            raise ValueError('must be one quantity, or the two of a point: write [x, y]')
        numbers = tuple(to_si(x, point) for x in said)
        if not all(math.isfinite(x) for x in numbers):
            raise ValueError('must be finite')
        return numbers

    return UnitValue(read, units, f'[x, y] of a point in {point}', pair=True)


Offset = Annotated[float | tuple[float, float], one_or_two('m', 'a pair [x, y]')]
"""A place on a link: along it from its origin, or a pair [x, y] in its frame."""
AnyPosition = Annotated[QuantityValue, si_of('rad', 'm')]
"""An angle of what turns, or a displacement of what slides."""
Mass = Annotated[float, si('kg'), POSITIVE]
LinkMass = Annotated[float, si('kg'), NOT_NEGATIVE]
Inertia = Annotated[float, si('kg m^2'), POSITIVE]
Angle = Annotated[float, UnitValue(lambda value: resolved(to_si(value, 'rad')), ('rad',)), _FINITE]
Speed = Annotated[float, si('rad/s'), _FINITE]
Acceleration = Annotated[float, si('m/s^2'), _FINITE]
AngularAcceleration = Annotated[float, si('rad/s^2'), POSITIVE]
Rate = Annotated[float, si('Hz'), POSITIVE]
Tolerance = Annotated[float, si(''), Field(ge=1e-16, le=1e-4)]
Displacement = Annotated[float, si('m'), NOT_NEGATIVE]
Time = Annotated[float, si('s'), NOT_NEGATIVE]
Duration = Annotated[float, si('s'), POSITIVE]
Torque = Annotated[float, si('N m'), _FINITE]
TorquePerAngle = Annotated[float, si('N m/rad'), _FINITE]
TorquePerSpeed = Annotated[float, si('N m s/rad'), _FINITE]
AddedInertia = Annotated[float, si('kg m^2'), NOT_NEGATIVE]
Radius = Annotated[float, si('m'), NOT_NEGATIVE]
Friction = Annotated[
    float,
    UnitValue(lambda x: float('inf') if x == 'rough' else to_si(x, ''), ('',), 'rough'),
    Field(ge=0.0),
]
"""Coulomb's coefficient, or the word ``rough`` for contacts that never slip."""
Coefficient = Annotated[float, si(''), Field(ge=0.0, le=1.0)]
Hypothesis = Literal['newton', 'poisson', 'stronge']


Gravity = tuple[Acceleration, Acceleration]


def _describe(schema: dict[str, Any], model: Any) -> None:
    for key, text in meanings(model).items():
        schema['properties'][key]['description'] = text


FROM_FILE = 'file', 'columns', 'units'
"""Keys by which a file gives points."""


def named_file(value: object) -> str:
    """Advice on how to refer to a file, if a value is the name of one; else empty."""
    named = isinstance(value, str) and re.search(r'\.(csv|txt|tsv|dat|dxf)$', value, re.IGNORECASE)
    return f': write {{file: {value}}}' if named else ''


Kind = TypeVar('Kind', bound='Part')


class Part(BaseModel):
    """Base of all parts of a scene: unknown keys are refused.

    A key without a value has no effect.
    """

    #: keys and values here by terms of other books and programs
    other_words: ClassVar[Mapping[str, str]] = {}
    #: True if a name without a value is a part of this kind, as for a link
    by_name_alone: ClassVar[bool] = False
    #: keys of files with its points or edges, see `scene.table_keys.with_files`
    of_files: ClassVar[tuple[str, ...]] = ()

    # only that of a whole scene is built, on first use: a fifth of the start of a process
    model_config = ConfigDict(
        extra='forbid', frozen=True, json_schema_extra=_describe, defer_build=True
    )

    @model_validator(mode='before')
    @classmethod
    def _without_empty_keys(cls, data: Any) -> Any:
        if data is None:
            return {}
        if not isinstance(data, dict):
            return data
        data = {key: plain(value) for key, value in data.items()}
        empty = [  # `in` would compare arrays elementwise
            k for k, v in data.items()
            if v is None or (type(v) is dict and any(x is None for x in v.values()))
        ]  # fmt: skip
        if not empty:
            return data
        fields = {field.alias or name: field for name, field in cls.model_fields.items()}
        for key in set(empty) & fields.keys():
            if data[key] is None:
                del data[key]
            else:
                data[key] = _without_empty_names(data[key], fields[key].annotation)
        return data

    @classmethod
    def keys_for(cls, data: Any) -> list[str]:
        """The keys allowed beside those of `data`: those of its kind, if there are several."""
        return [field.alias or name for name, field in cls.model_fields.items()]

    def __setattr__(self, name: str, value: Any) -> None:
        raise InputError(
            f'{type(self).__name__}: {name} cannot be set, for parts of a scene stay as they are: '
            'make another one, or load the scene with an override'
        )

    def as_kind(self, kind: type[Kind]) -> Kind:
        """A copy as a part of a single kind, from a class that extends all kinds.

        In that class methods of kinds could override each other, and `super` is the next kind.
        """
        own = {key: getattr(self, key) for key in kind.model_fields}
        return kind.model_construct(self.model_fields_set & own.keys(), **own)

    def to_document(self, **which: Any) -> dict[str, Any]:
        """Keys and values in SI units in the form of a file, so that they can be read again.

        All writers of parts of a scene use this method: the keys of a file are
        not always the names of fields (``from`` is no name in Python).

        Parameters
        ----------
        which : `include`, `exclude` or `exclude_unset` of pydantic
        """
        return self.model_dump(by_alias=True, **which)


def _without_empty_names(named: dict[str, Any], kind: Any) -> dict[str, Any]:
    """Values by name without empty ones, except parts with a meaning by name alone."""
    of = get_args(kind)[-1] if get_origin(kind) is dict else Any
    if of is Any:  # paths of overrides have no values behind them
        return named
    if isinstance(of, type) and issubclass(of, Part) and of.by_name_alone:
        return named
    return {name: value for name, value in named.items() if value is not None}


@cache
def meanings(part: type[Part]) -> dict[str, str]:
    """Meanings of the keys of a part, from the text below each in the source.

    Pydantic could read them, too (``use_attribute_docstrings``), but at every start.
    """
    found: dict[str, str] = {}
    for base in reversed([c for c in part.__mro__ if issubclass(c, Part) and c is not Part]):
        body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0]
        assert isinstance(body, ast.ClassDef)  # noqa: S101 - the source of a class
        for field, below in zip(body.body, body.body[1:], strict=False):
            if not isinstance(field, ast.AnnAssign) or not isinstance(below, ast.Expr):
                continue
            name = ast.unparse(field.target)
            found[part.model_fields[name].alias or name] = inspect.cleandoc(
                ast.literal_eval(below.value)
            )
    return found
