"""Rotors: a disk on a shaft and supports that give way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.planar.mechanism import GROUND, Revolute
from mechanism_sim.planar.rotor import SLOPE, Rotor, Rows, Support
from mechanism_sim.scene.elastic_keys import MATERIALS
from mechanism_sim.scene.joint_keys import JointKeys, JointKind, Names, Reference, register
from mechanism_sim.scene.quantities import (
    AddedInertia,
    LinkMass,
    Part,
    Position,
    Time,
    one_or_two,
    si,
)
from mechanism_sim.scene.sketch import Edit, Sketch, Spot, Tool
from mechanism_sim.vibration.rotors import shaft_rigidity
from mechanism_sim.vibration.shafts import Bearing, condensed

_NOT_NEGATIVE = Field(ge=0.0, allow_inf_nan=False)
_Stiffness = Annotated[float | tuple[float, float], one_or_two('N/m', 'a pair along x and y', 0.0)]
_Damping = Annotated[float | tuple[float, float], one_or_two('N s/m', 'a pair along x and y', 0.0)]
_POSITIVE = Field(gt=0.0, allow_inf_nan=False)
_HELD = 1e-12  # least stiffness against the largest, free of units


class SupportPart(Part):
    """A support of a rotor's shaft."""

    along: Position = 0.0
    """Where it is along the shaft, from the disk."""
    stiffness: _Stiffness | None = None
    """In all directions, or along x and along y; without it the support is rigid."""
    damping: _Damping = 0.0
    """In all directions, or along x and along y."""
    mass: LinkMass = 0.0
    """What moves with the shaft there."""
    clamped: bool = False
    """Whether the shaft cannot tilt there."""


class RotorShaftPart(Part):
    """A round shaft that bends; its own mass is left out."""

    diameter: Annotated[float, si('m'), _POSITIVE]
    """How thick it is."""
    material: str | None = None
    """Whose Young's modulus is taken where none is given."""
    youngs_modulus: Annotated[float, si('Pa'), _POSITIVE] | None = None
    """Instead of a material's."""
    relaxation: Time = 0.0
    """Internal damping over stiffness: it turns with the shaft."""


class RotorKeys(JointKeys):
    """A disk on a shaft that gives way."""

    rotor: Reference | None = None
    """The ground where the axis is at rest, and the disk's middle."""
    supports: dict[str, SupportPart] = Field({})
    """Of a rotor, by name; required."""
    shaft: RotorShaftPart | None = None
    """Of a rotor that bends; without it the shaft is rigid."""
    diametral_inertia: AddedInertia | None = None
    """Of a rotor's disk about a diameter; without it the disk's tilt has no inertia."""
    external_damping: _Damping = 0.0
    """Of a rotor, at the disk."""


def _both(given: float | tuple[float, float]) -> tuple[float, float]:
    return given if isinstance(given, tuple) else (given, given)


def _read(places: Names, name: str, joint: RotorKeys) -> Revolute:
    """The revolute joint of the undeformed shaft.

    Raises
    ------
    InputError
        If it is not in the ground.
    """
    (a, on_a), (b, on_b) = places.ends(name, joint)
    if a != GROUND:
        raise InputError(
            f'{places.name}: joints.{name}.rotor: name the ground first: the supports of a rotor '
            f'are in the ground, not in {a}'
        )
    return Revolute(name, a, b, on_a, on_b)


def _rotor(places: Names, name: str, joint: RotorKeys) -> tuple[str, Rotor]:
    """The disk's link, and how it gives way.

    Raises
    ------
    InputError
        If the supports do not hold it, or something would move that has no mass.
    """
    where = f'{places.name}: joints.{name}'
    (_, place), (link, _) = places.ends(name, joint)
    polar = places.scene.links[link].inertia or 0.0
    if not joint.supports:
        raise InputError(f'{where}.supports is missing: a rotor needs one or more')
    if joint.diametral_inertia is not None and not (
        max(0.5 * polar, 1e-300) <= joint.diametral_inertia * (1.0 + 1e-12)
    ):
        raise InputError(
            f'{where}.diametral_inertia = {joint.diametral_inertia:g} kg m^2: a body has at least '
            f'half of its polar inertia of {polar:g} kg m^2 about a diameter, and more than 0'
        )
    for key, support in joint.supports.items():
        _check(f'{where}.supports.{key}', key, joint, support)
    seen: dict[float, str] = {}
    for key, support in joint.supports.items():
        if support.along in seen:
            raise InputError(
                f'{where}.supports: {seen[support.along]} and {key} are at one place '
                f'({support.along:g} m): make them one'
            )
        seen[support.along] = key
    return link, (_bending if joint.shaft else _stiff)(where, joint, polar, place)


def _check(where: str, key: str, joint: RotorKeys, support: SupportPart) -> None:
    """Refuse supports that cannot be, one by one."""
    rigid, damped = support.stiffness is None, any(_both(support.damping))
    if not key.isidentifier() or key == SLOPE:
        raise InputError(f'{where}: a name is of letters, digits and _, and not {SLOPE}')
    if rigid and (damped or support.mass):
        raise InputError(f"{where}: without 'stiffness' it is rigid, and has no damping nor mass")
    if not joint.shaft and (rigid or support.clamped):
        raise InputError(
            f"{where}: a rigid shaft needs a 'stiffness' in every support and clamps none; or "
            "give the joint a 'shaft' that bends"
        )
    if joint.shaft and support.along == 0.0 and (rigid or support.mass):
        raise InputError(
            f'{where} is in the middle of the disk: there it needs a stiffness, and its mass '
            "belongs to the disk; or set it 'along' the shaft"
        )
    if joint.shaft and damped and not support.mass:
        raise InputError(
            f"{where}.damping needs a 'mass' of what moves in the support, between the shaft that "
            "bends and the damper; or take 'external_damping' at the disk"
        )
    if joint.shaft and joint.shaft.relaxation and not (rigid or support.mass):
        raise InputError(
            f"{where}: internal damping of the shaft needs a 'mass' in supports that give way"
        )


def _bending(where: str, joint: RotorKeys, polar: float, place: tuple[float, float]) -> Rotor:
    """A rotor whose shaft bends."""
    shaft = joint.shaft
    assert shaft  # noqa: S101 - it bends
    if shaft.youngs_modulus is None and shaft.material not in MATERIALS:
        raise InputError(
            f"{where}.shaft needs 'youngs_modulus' or a material of {', '.join(MATERIALS)}"
        )
    modulus = shaft.youngs_modulus or MATERIALS[shaft.material or ''][0]
    rigidity = shaft_rigidity(modulus, shaft.diameter)
    tilts = joint.diametral_inertia is not None
    heavy = [key for key, s in joint.supports.items() if s.mass]
    pairs = ['', *([SLOPE] if tilts else []), *heavy]
    K, C, rows, inner = [], [], [], np.zeros((len(pairs), len(pairs)))
    for axis in (0, 1):
        bearings = [
            Bearing(
                s.along, np.inf if s.stiffness is None else _both(s.stiffness)[axis],
                bool(s.mass), s.clamped,
            )
            for s in joint.supports.values()
        ]  # fmt: skip
        found = condensed(rigidity, bearings, tilts)
        if found is None:
            raise _loose(where)
        inner = shaft.relaxation * found[0]
        k, c = found[0].copy(), np.zeros_like(inner)
        c[0, 0] = _both(joint.external_damping)[axis]
        for key in heavy:
            i, support = pairs.index(key), joint.supports[key]
            k[i, i] += _both(support.stiffness or 0.0)[axis]
            c[i, i] = _both(support.damping)[axis]
        own = dict(zip(joint.supports, found[1], strict=True))
        for key in heavy:
            own[key] = (
                np.eye(len(pairs))[pairs.index(key)]
                * _both(joint.supports[key].stiffness or 0.0)[axis]
            )
        K.append(k)
        C.append(c)
        rows.append(own)
    lumps = [(joint.supports[key].mass, np.eye(len(pairs))[pairs.index(key)]) for key in heavy]
    none = np.zeros(len(pairs))
    damped = [
        {
            key: np.eye(len(pairs))[pairs.index(key)] * _both(s.damping)[axis] if s.mass else none
            for key, s in joint.supports.items()
        }
        for axis in (0, 1)
    ]
    return _made(where, joint, polar, place, pairs, K, C, inner, lumps, rows, damped)


def _stiff(where: str, joint: RotorKeys, polar: float, place: tuple[float, float]) -> Rotor:
    """A rotor whose shaft is rigid."""
    supports = joint.supports
    tilts = joint.diametral_inertia is not None
    apart = len({s.along for s in supports.values()}) > 1
    if not tilts and apart and any(any(_both(s.damping)) or s.mass for s in supports.values()):
        raise InputError(
            f'{where}.diametral_inertia is missing: the disk tilts in supports beside it that '
            'have a damping or a mass'
        )
    K, C, rows, damped = [], [], [], []
    for axis in (0, 1):
        k = np.array([_both(s.stiffness or 0.0)[axis] for s in supports.values()])
        c = np.array([_both(s.damping)[axis] for s in supports.values()])
        z = np.array([s.along for s in supports.values()])
        shares = np.stack([np.ones_like(z), z]) if tilts else np.ones((1, len(z)))
        if not tilts and apart:  # the slope that leaves no moment
            if not (k * z**2).any():
                raise _loose(where)
            shares = (1.0 - z * (k @ z) / (k @ z**2))[None]
        K.append(shares * k @ shares.T)
        C.append(shares * c @ shares.T)
        C[-1][0, 0] += _both(joint.external_damping)[axis]
        rows.append(dict(zip(supports, (shares * k).T, strict=True)))
        damped.append(dict(zip(supports, (shares * c).T, strict=True)))
    arms = [np.array([1.0, s.along] if tilts else [1.0]) for s in supports.values()]
    lumps = [(s.mass, arm) for s, arm in zip(supports.values(), arms, strict=True) if s.mass]
    pairs = ['', SLOPE] if tilts else ['']
    return _made(where, joint, polar, place, pairs, K, C, np.zeros_like(K[0]), lumps, rows, damped)


def _loose(where: str) -> InputError:
    return InputError(
        f'{where}.supports do not hold the shaft along x and y, and against tilting: set two '
        "apart, each with a stiffness in both directions, or one that is 'clamped'"
    )


def _made(
    where: str,
    joint: RotorKeys,
    polar: float,
    place: tuple[float, float],
    pairs: Sequence[str],
    K: Sequence[Array],
    C: Sequence[Array],
    inner: Array,
    lumps: Sequence[tuple[float, Array]],
    rows: Sequence[dict[str, Array]],
    damped: Sequence[dict[str, Array]],
) -> Rotor:
    """The rotor, if its stiffness holds it."""
    for k in K:
        size = np.sqrt(np.diag(k))
        if not size.all() or np.linalg.eigvalsh(k / np.outer(size, size)).min() < _HELD:
            raise _loose(where)

    def listed(matrix: Array) -> Rows:
        return tuple(tuple(row) for row in matrix.tolist())

    relaxation = joint.shaft.relaxation if joint.shaft else 0.0
    return Rotor(
        tuple(pairs),
        (listed(K[0]), listed(K[1])),
        (listed(C[0]), listed(C[1])),
        listed(inner),
        joint.diametral_inertia or 0.0,
        polar,
        tuple((mass, tuple(arm.tolist())) for mass, arm in lumps),
        tuple(
            (
                key,
                Support(
                    listed(np.array([x[key] for x in rows])),
                    listed(np.array([x[key] for x in damped])),
                    s.stiffness is None,
                ),
            )
            for key, s in joint.supports.items()
        ),
        place,
        relaxation,
    )


def _draw(sketch: Sketch, start: Spot, _end: Spot) -> list[Edit]:
    """A disk of 10 kg, a millimetre off its axis, on one support."""
    base, edits = sketch.point(GROUND, sketch.where(start))
    disk = sketch.name('disk')
    joint = {'rotor': [base, disk], 'supports': {'bearings': {'stiffness': '50 N/mm'}}}
    values = {'mass': '10 kg', 'inertia': '0.04 kg m^2', 'cog': '1 mm'}
    made = [Edit(sketch.named(base, disk), joint), Edit(('links', disk), values), *edits]
    return [*made, *sketch.masses(), *sketch.driven(disk)]


_TOOL = Tool(
    'rotor', 'Z', 'M7 1h2v14H7zM1 7h14v2H1zm3-3h8v8H4z',
    'Click: an unbalanced disk on a support that gives way', _draw,
)  # fmt: skip

register(
    JointKind(
        'rotor', RotorKeys, _read, rotor=_rotor,
        firm="what gives way of a rotor is its 'shaft' and its 'supports'", tools=(_TOOL,),
    )
)  # fmt: skip
