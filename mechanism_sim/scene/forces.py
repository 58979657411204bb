"""The springs, dampers and loads of a linkage that is written out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import heyoka as hy

from mechanism_sim.errors import InputError, nearest, quoted
from mechanism_sim.linkages.forces import AppliedForce, CycleRange, Spring, TorsionSpring
from mechanism_sim.numerics import formula
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import ForceElement
from mechanism_sim.scene.places import Places
from mechanism_sim.scene.schema import LoadPart
from mechanism_sim.units import Measure

Elements = Callable[[Mechanism], list[ForceElement]]


def read_forces(places: Places, tree: Mechanism) -> Elements:
    """What makes the force elements for a tree of the mechanism.

    Parameters
    ----------
    tree : the ideal mechanism; the displacements of its links are what formulas name

    Raises
    ------
    InputError
        If a spring or a load does not fit together, or a formula cannot be read.
    """
    for name, spring in places.scene.springs.items():
        _check_spring(places, name, spring.between, spring.stiffness, spring.damping)
    for name, load in places.scene.loads.items():
        _check_load(places, name, load, tree)
    guided = {c: tree.tree_joints[c].name for c in tree.sliding}
    return lambda mechanism: _elements(places, mechanism, guided)


def _check_spring(
    places: Places, name: str, between: list[str], stiffness: Measure, damping: Measure
) -> None:
    ends = [places.find(f'springs.{name}.between', p)[0] for p in between]
    if ends[0] == ends[1]:
        raise InputError(f'{places.name}: springs.{name}.between names one link twice')
    kinds = {m.unit.endswith('rad') for m in (stiffness, damping) if m.unit}
    if len(kinds) != 1:
        raise InputError(
            f'{places.name}: springs.{name}: give stiffness and damping both per length '
            "('200 N/m', '5 N s/m') or both per angle ('3 N m/rad', '0.1 N m s/rad')"
        )
    spring = places.scene.springs[name]
    if kinds == {True} and spring.free_length is not None:
        raise InputError(f'{places.name}: springs.{name}: a torsion spring has a free_angle')
    if kinds == {False} and spring.free_angle is not None:
        raise InputError(f'{places.name}: springs.{name}: a straight spring has a free_length')
    if min(stiffness.value, damping.value) < 0.0:
        raise InputError(
            f'{places.name}: springs.{name}: stiffness and damping cannot be negative'
        )


def _check_load(places: Places, name: str, load: LoadPart, tree: Mechanism) -> None:
    where = f'loads.{name}'
    places.find(f'{where}.at', load.at)
    known = {'t', 'x', 'y', 'vx', 'vy', *places.links, *(f'{x}_rate' for x in places.links)}
    symbols = {x: hy.expression(x) for x in known}
    for part in (*load.force, load.torque):
        if isinstance(part, str):
            for used in formula.names(part) - known:
                raise InputError(
                    f"{places.name}: {where}: the formula {quoted(part)} names '{used}'"
                    f'{nearest(used, known)}; it may name t, x, y, vx, vy, a link, or '
                    'LINK_rate'
                )
            for link in places.links:
                if (rate := f'{link}_rate') in places.links and rate in formula.names(part):
                    raise InputError(
                        f"{places.name}: {where}: '{rate}' in the formula {quoted(part)} may be "
                        f'the link {rate} or the rate of {link}; call one of the links otherwise'
                    )
            try:
                formula.expression(part, symbols)
            except ValueError as error:
                raise InputError(f'{places.name}: {where}: {error}') from error
    if load.during:
        c = places.coordinate(f'{where}.during.coordinate', load.during.coordinate)
        if tree.frame(c) != (c, 0.0):
            raise InputError(
                f'{places.name}: {where}.during.coordinate: {c} is a displacement; a range is '
                'one of angles'
            )
        if abs(math.remainder(load.during.end - load.during.begin, 2.0 * math.pi)) < 1e-9:
            raise InputError(
                f"{places.name}: {where}.during: 'from' and 'to' are the same direction; for a "
                "load that acts in the whole cycle leave out 'during'"
            )


def _elements(
    places: Places, mechanism: Mechanism, guided: Mapping[str, str]
) -> list[ForceElement]:
    found: list[ForceElement] = []
    for name, s in places.scene.springs.items():
        a, b = (places.find(f'springs.{name}.between', p) for p in s.between)
        if (s.stiffness.unit or s.damping.unit).endswith('rad'):
            found.append(
                TorsionSpring(f'springs.{name}', mechanism, a[0], b[0], s.stiffness.value,
                              s.free_angle or 0.0, s.damping.value)
            )  # fmt: skip
        else:
            found.append(
                Spring(f'springs.{name}', mechanism, a, b, s.stiffness.value,
                       s.free_length or 0.0, s.damping.value)
            )  # fmt: skip
    for name, load in places.scene.loads.items():
        during = None
        if load.during:
            d = load.during
            during = CycleRange(d.coordinate, d.begin, d.end)
        found.append(
            AppliedForce(
                f'loads.{name}', mechanism, places.find(f'loads.{name}.at', load.at),
                load.force, load.torque, load.frame == 'link', during, guided,
            )
        )  # fmt: skip
    return found
