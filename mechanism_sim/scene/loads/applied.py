"""Forces and torques on links: constant, by formulas of motion and time, or by tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import ClassVar, Literal

from pydantic import Field

from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import AnyPosition, Part
from mechanism_sim.linkages.forces import AppliedForce, CycleRange, DriveEffort, UnknownForce
from mechanism_sim.linkages.formulas import FormulaScope
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import LinkPoint
from mechanism_sim.scene.formula_keys import (
    ForceOrFormula,
    TorqueOrFormula,
    check_formula,
    scope_of,
)
from mechanism_sim.scene.load_keys import LOADS, ElementKeys, Elements
from mechanism_sim.units import QuantityValue


class DuringPart(Part):
    """A part of the cycle of a coordinate."""

    coordinate: str
    """The link whose angle or displacement it is."""
    begin: AnyPosition | None = Field(None, alias='from')
    """Where it begins; of an angle always needed, of a displacement its least value if any."""
    end: AnyPosition | None = Field(None, alias='to')
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

    other_words: ClassVar[Mapping[str, str]] = {
        'moment': "'torque'",
        **dict.fromkeys(('point', 'link', 'body'), "'at', the LINK.POINT"),
    }

    def read(self, places: Names, name: str, tree: Mechanism) -> Elements:
        """An applied force, or one whose size follows from the motion."""
        where = f'loads.{name}'
        point = places.find(f'{where}.at', self.at)
        other = places.find(f'{where}.reaction', self.reaction) if self.reaction else None
        if other and other[0] == point[0]:
            raise InputError(f'{where}: at and reaction name one link, {other[0]}')
        if self.unknown:
            unknown = _unknown(name, self, point, other, scope_of(places, tree))
            return lambda mechanism: [unknown(mechanism)]
        for part, unit in zip((*self.force, self.torque), ('N', 'N', 'N m'), strict=True):
            if isinstance(part, str):
                check_formula(places, where, part, unit, tree)
        during = _range(places, f'{where}.during', self.during, tree) if self.during else None
        scope, in_link = scope_of(places, tree), self.frame == 'link'
        return lambda mechanism: [
            AppliedForce(
                where, scope(mechanism), point, self.force, self.torque, in_link, during, other
            )
        ]


@LOADS.add('loads')
class Loads(Part):
    """The loads of a scene."""

    loads: dict[str, LoadPart] = Field({})
    """Forces and torques on links, by name."""


def _unknown(
    name: str,
    load: LoadPart,
    point: LinkPoint,
    other: LinkPoint | None,
    scope: Callable[[Mechanism], FormulaScope],
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
        key, scope(mechanism), point, force, math.copysign(1.0, torque) if torque else 0.0,
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
    scope = scope_of(places, tree)
    return lambda mechanism: DriveEffort(where, scope(mechanism), (link, (0.0, 0.0)), torque=size)


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
