"""Forces and torques on links: constant, by formulas of motion and time, or by tables."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Annotated, Any, Literal

import heyoka as hy
from pydantic import Field

from mechanism_sim.errors import InputError, nearest, quoted
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Part, UnitValue, si_of
from mechanism_sim.linkages.forces import (
    AppliedForce,
    CycleRange,
    DriveEffort,
    LinkPoint,
    UnknownForce,
)
from mechanism_sim.numerics import formula
from mechanism_sim.numerics.expressions import parse, unit_hint, unit_of
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene.load_keys import LOADS, ElementKeys, Elements
from mechanism_sim.units import QuantityValue, alike, to_si, to_si_of

Place = Annotated[QuantityValue, si_of('rad', 'm')]


def or_formula(*units: str) -> UnitValue:
    """A quantity, or a formula such as ``-5*vx + 3*sin(20*t)``.

    Of one of several units it is a `QuantityValue`.
    """

    def read(value: Any) -> float | QuantityValue | str:
        try:
            return to_si(value, *units) if len(units) == 1 else to_si_of(value, units)
        except ValueError as error:
            if not isinstance(value, str):
                raise
            try:
                tree = parse(value, None)
            except InputError as other:
                number = re.match(r'\s*[-+]?[\d.]+[^(*+,=^]*$', value) and ' if ' not in value
                raise (error if number else ValueError(f'cannot be read: {other}')) from other
            if all(n.kind in ('number', 'negative') for n in tree.walk()):
                raise
            return value

    return UnitValue(read, units, 'a formula')


ForceOrFormula = Annotated[float | str, or_formula('N')]
TorqueOrFormula = Annotated[float | str, or_formula('N m')]
EffortOrFormula = Annotated[QuantityValue | str, or_formula('N m', 'N')]


class DuringPart(Part):
    """A part of the cycle of a coordinate."""

    coordinate: str
    """The link whose angle or displacement it is."""
    begin: Place | None = Field(None, alias='from')
    """Where it begins; of an angle always needed, of a displacement its least value if any."""
    end: Place | None = Field(None, alias='to')
    """Where it ends: of an angle, counterclockwise from there; of a displacement its largest."""
    moving: Literal['forward', 'backward'] | None = None
    """Only while the coordinate increases, or only while it decreases; else both."""


class LoadPart(ElementKeys):
    """A force at a point of a link, a torque on it, or both."""

    at: str
    """LINK.POINT on which it acts."""
    force: tuple[ForceOrFormula, ForceOrFormula] = (0.0, 0.0)
    """Along x and y; quantities, or formulas such as "-5*vx + 3*sin(20*t)"."""
    torque: TorqueOrFormula = 0.0
    """Counterclockwise; a quantity or a formula."""
    reaction: str | None = None
    """LINK.POINT on which the opposite force and torque act; without it they act outside."""
    frame: Literal['world', 'link'] = 'world'
    """Frame in which the force keeps its direction: the world, or the link."""
    during: DuringPart | None = None
    """The part of a cycle in which it acts; else always."""
    unknown: bool = False
    """Only the direction is given, by `force` or `torque`, and the size is to be found."""

    def read(self, places: Names, name: str, tree: Mechanism) -> Elements:
        """An applied force, or one whose size follows from the motion."""
        where = f'loads.{name}'
        point = places.find(f'{where}.at', self.at)
        other = places.find(f'{where}.reaction', self.reaction) if self.reaction else None
        if other and other[0] == point[0]:
            raise InputError(f'{where}: at and reaction name one link, {other[0]}')
        if self.unknown:
            unknown = _unknown(name, self, point, other)
            return lambda mechanism: [unknown(mechanism)]
        for part, unit in zip((*self.force, self.torque), ('N', 'N', 'N m'), strict=True):
            if isinstance(part, str):
                check_formula(places, where, part, unit, tree)
        during = _range(places, f'{where}.during', self.during, tree) if self.during else None
        guided = {c: tree.tree_joints[c].name for c in tree.sliding}
        tables = {n: table.curve for n, table in places.scene.tables.items()}

        return lambda mechanism: [
            AppliedForce(
                where, mechanism, point, self.force, self.torque, self.frame == 'link', during,
                guided, tables, other,
            )
        ]  # fmt: skip


@LOADS.add('loads')
class Loads(Part):
    """The loads of a scene."""

    loads: dict[str, LoadPart] = Field({})
    """Forces and torques on links, by name."""


def _unknown(
    name: str, load: LoadPart, point: LinkPoint, other: LinkPoint | None
) -> Callable[[Mechanism], UnknownForce]:
    """A load whose size is to be found."""
    key = f'loads.{name}'
    where = f'{key}'
    if any(isinstance(part, str) for part in (*load.force, load.torque)):
        raise InputError(
            f'{where} is unknown: its force or torque is a direction, in numbers, not a formula'
        )
    x, y, torque = (float(part) for part in (*load.force, load.torque))
    size = math.hypot(x, y)
    if bool(size) == bool(torque):
        raise InputError(
            f"{where} is unknown: give either 'force', as [1, 0], or 'torque', as 1, by which its "
            f'direction is known; it has {"both" if size else "none"}'
        )
    if load.during:
        raise InputError(
            f"{where} is unknown and has 'during': an unknown load acts always, for without it "
            'nothing would balance what the drive supplies'
        )
    force = (x / size, y / size) if size else (0.0, 0.0)
    return lambda mechanism: UnknownForce(
        key, mechanism, point, force, math.copysign(1.0, torque) if torque else 0.0,
        load.frame == 'link', reaction=other,
    )  # fmt: skip


def read_effort(
    places: Names, where: str, link: str, effort: QuantityValue | str, tree: Mechanism
) -> Callable[[Mechanism], DriveEffort]:
    """Torque or force of a drive while the motion of its link is prescribed."""
    if isinstance(effort, str):
        check_formula(places, where, effort, 'N' if link in tree.sliding else 'N m', tree)
        size: float | str = effort
    else:
        size = places.measure(where, effort, link in tree.displacements, ('N m', 'N'))
    guided = {c: tree.tree_joints[c].name for c in tree.sliding}
    tables = {n: table.curve for n, table in places.scene.tables.items()}
    return lambda mechanism: DriveEffort(
        where, mechanism, (link, (0.0, 0.0)), torque=size, guided=guided, tables=tables
    )


def check_formula(places: Names, where: str, text: str, unit: str, tree: Mechanism) -> None:
    """Refuse a formula that names or calls what is not known, or that is not in `unit`.

    Without any unit in its text but of angles all is taken to be in SI units.
    """
    units: dict[str, str | None] = {'t': 's', 'x': 'm', 'y': 'm', 'vx': 'm/s', 'vy': 'm/s'}
    for link in places.links:
        units[link] = of = 'm' if link in tree.sliding else 'rad'
        units[f'{link}_rate'] = f'{of}/s'
    tables = places.scene.tables
    try:
        root = formula.read(text, tables)
        for other in root.names:
            if other not in units:
                raise InputError(
                    f"the formula {quoted(text)} names '{other}'"
                    f'{unit_hint(other) or nearest(other, units)}; it may name t, x, y, vx, vy, '
                    'a link, or LINK_rate'
                )
            if other.endswith('_rate') and {other, other.removesuffix('_rate')} <= {*places.links}:
                raise InputError(
                    f"'{other}' in the formula {quoted(text)} may be the link {other} or the rate "
                    f'of {other.removesuffix("_rate")}; call one of the links otherwise'
                )
        symbols = {x: hy.expression(x) for x in units}
        formula.expression(text, formula.Words(symbols, tables=dict.fromkeys(tables, lambda x: x)))
        if not all(alike(n.unit or '', '') for n in root.walk()):  # degrees are plain numbers
            units |= {f'{n}()': table.points[0][1].unit or None for n, table in tables.items()}
            found = unit_of(root, units, text)
            if found is not None and not alike(found, unit):
                raise InputError(f'{quoted(text)} is in {found or "no unit"}, not in {unit}')
    except InputError as error:
        raise InputError(f'{where}: {error}') from error


def _range(places: Names, where: str, given: DuringPart, tree: Mechanism) -> CycleRange:
    """The part of a cycle in which a load acts."""
    c = places.coordinate(f'{where}.coordinate', given.coordinate)
    straight = tree.frame(c) != (c, 0.0)
    ends = [
        None if x is None else places.measure(f'{where}.{key}', x, straight, ('rad', 'm'))
        for key, x in (('from', given.begin), ('to', given.end))
    ]
    begin, end = ends
    if begin is None and end is None and given.moving is None:
        raise InputError(f"{where} needs 'from' and 'to', or 'moving'")
    if not straight and (begin is None) != (end is None):
        raise InputError(f"{where}: of an angle give both 'from' and 'to'")
    if begin is not None and end is not None:
        if straight and not begin < end:
            raise InputError(f"{where}: 'from' = {begin:g} m must be less than 'to' = {end:g} m")
        if not straight and abs(math.remainder(end - begin, 2.0 * math.pi)) < 1e-9:
            raise InputError(
                f"{where}: 'from' and 'to' are the same direction; for a load that "
                "acts in the whole cycle leave out 'during'"
            )
    way = {None: 0, 'forward': 1, 'backward': -1}[given.moving]
    return CycleRange(c, begin, end, straight, way)
