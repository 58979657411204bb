"""Rotors: disks on a compliant shaft and supports."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.joints.joint_keys import KINDS, JointKeys, Reference
from mechanism_sim.keys.elastic_keys import MATERIALS
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import (
    POSITIVE,
    AddedInertia,
    LinkMass,
    Mass,
    Offset,
    Part,
    Position,
    Time,
    one_or_two,
    si,
)
from mechanism_sim.planar.mechanism import Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.rotor import SLOPE, Lump, Rotor, Rows, Support
from mechanism_sim.vibration.shafts import Bearing, condensed, shaft_rigidity

_Stiffness = Annotated[float | tuple[float, float], one_or_two('N/m', 'a pair along x and y', 0.0)]
_Damping = Annotated[float | tuple[float, float], one_or_two('N s/m', 'a pair along x and y', 0.0)]
_HELD = 1e-12  # least stiffness against the largest, free of units


class SupportPart(Part):
    """A support of a rotor's shaft."""

    along: Position = 0.0
    """Position along the shaft, from the link's own disk."""
    stiffness: _Stiffness | None = None
    """In all directions, or along x and along y; without it the support is rigid."""
    damping: _Damping = 0.0
    """In all directions, or along x and along y."""
    mass: LinkMass = 0.0
    """Mass that moves with the shaft there."""
    clamped: bool = False
    """True if the shaft cannot tilt there."""


class DiskPart(Part):
    """A further disk on the shaft of a rotor, which turns with the link."""

    along: Position
    """Position along the shaft, from the link's own disk."""
    mass: Mass
    """Its own."""
    inertia: AddedInertia = 0.0
    """Its polar moment of inertia."""
    cog: Offset = 0.0
    """Its centre of gravity in the frame of the link, from the axis."""
    diametral_inertia: AddedInertia | None = None
    """About a diameter; without it the disk's tilt has no inertia."""
    external_damping: _Damping = 0.0
    """At the disk."""


class ShaftSectionPart(Part):
    """A part of a shaft of another diameter."""

    begin: Position
    """Where it begins, from the link's own disk."""
    end: Position
    """Its end."""
    diameter: Annotated[float, si('m'), POSITIVE]
    """Diameter."""


class RotorShaftPart(Part):
    """A round shaft that bends; its own mass is left out."""

    diameter: Annotated[float, si('m'), POSITIVE]
    """Diameter."""
    sections: dict[str, ShaftSectionPart] = Field({})
    """Where it has another diameter, by name."""
    material: str | None = None
    """Whose Young's modulus is taken where none is given."""
    youngs_modulus: Annotated[float, si('Pa'), POSITIVE] | None = None
    """Instead of a material's."""
    relaxation: Time = 0.0
    """Internal damping over stiffness: it turns with the shaft."""


@KINDS.add('rotor')
class RotorKeys(JointKeys):
    """Disks on a compliant shaft or supports."""

    rotor: Reference | None = None
    """The ground where the axis is at rest, and the disk's middle."""
    supports: dict[str, SupportPart] = Field({})
    """Of a rotor, by name; required."""
    shaft: RotorShaftPart | None = None
    """Of a rotor that bends; without it the shaft is rigid."""
    disks: dict[str, DiskPart] = Field({})
    """Of a rotor, those beside the link's own, by name."""
    diametral_inertia: AddedInertia | None = None
    """Of a rotor's disk about a diameter; without it the disk's tilt has no inertia."""
    external_damping: _Damping = 0.0
    """Of a rotor, at the disk."""

    firm = "the compliance of a rotor is in its 'shaft' and its 'supports'"
    gives_way = True

    def read(self, names: Names, name: str) -> Revolute:
        """The revolute joint of the undeformed shaft."""
        (a, on_a), (b, on_b) = names.ends(name)
        if a != GROUND:
            raise InputError(
                f'joints.{name}.rotor: name the ground first: the supports of a rotor are in the '
                f'ground, not in {a}'
            )
        return Revolute(name, a, b, on_a, on_b)

    def rotor_of(self, names: Names, name: str) -> tuple[str, Rotor]:
        """Link of the disks, and the compliance of its shaft and supports."""
        where = f'joints.{name}'
        (_, place), (link, _) = names.ends(name)
        polar = names.scene.links[link].inertia or 0.0
        if not self.supports:
            raise InputError(f'{where}.supports is missing: a rotor needs one or more')
        disks = [_Disk('', 0.0, polar, self.diametral_inertia, self.external_damping)]
        for key, d in self.disks.items():
            cog = d.cog if isinstance(d.cog, tuple) else (d.cog, 0.0)
            disks.append(_Disk(
                key, d.along, d.inertia, d.diametral_inertia, d.external_damping, d.mass, cog
            ))  # fmt: skip
        for disk in disks:
            at = f'{where}.disks.{disk.name}' if disk.name else where
            if disk.diametral is not None and not (
                max(0.5 * disk.polar, 1e-300) <= disk.diametral * (1.0 + 1e-12)
            ):
                raise InputError(
                    f'{at}.diametral_inertia = {disk.diametral:g} kg m^2: a body has at least '
                    f'half of its polar inertia of {disk.polar:g} kg m^2 about a diameter, and '
                    'more than 0'
                )
        for key, support in self.supports.items():
            _check(f'{where}.supports.{key}', self, support)
        _check_names(where, disks, self)
        for part, along in (
            ('supports', {key: s.along for key, s in self.supports.items()}),
            ('disks', {disk.name or 'that of the link': disk.along for disk in disks}),
        ):
            seen: dict[float, str] = {}
            for key, z in along.items():
                if z in seen:
                    raise InputError(
                        f'{where}.{part}: {seen[z]} and {key} are at one place ({z:g} m): make '
                        'them one'
                    )
                seen[z] = key
        terms = (_bending if self.shaft else _stiff)(where, self, disks)
        for k in terms.K:
            size = np.sqrt(np.diag(k))
            if not size.all() or np.linalg.eigvalsh(k / np.outer(size, size)).min() < _HELD:
                raise _loose(where)
        supports = tuple(
            (
                key,
                Support(
                    _listed([x[key] for x in terms.rows]),
                    _listed([x[key] for x in terms.damped]),
                    s.stiffness is None,
                ),
            )
            for key, s in self.supports.items()
        )
        return link, Rotor(
            tuple(terms.pairs),
            (_listed(terms.K[0]), _listed(terms.K[1])),
            (_listed(terms.C[0]), _listed(terms.C[1])),
            _listed(terms.internal),
            tuple(terms.diametral),
            tuple(terms.polar),
            tuple(terms.lumps),
            supports,
            place,
            self.shaft.relaxation if self.shaft else 0.0,
        )


def _both(given: float | tuple[float, float]) -> tuple[float, float]:
    return given if isinstance(given, tuple) else (given, given)


class _Disk(NamedTuple):
    """A disk of a rotor; the name of the link's own is empty."""

    name: str
    along: float
    polar: float
    diametral: float | None
    damping: float | tuple[float, float]
    mass: float = 0.0
    cog: tuple[float, float] = (0.0, 0.0)

    @property
    def pairs(self) -> list[str]:
        """Names of the pairs of coordinates of a shaft that bends."""
        slope = f'{self.name}_{SLOPE}' if self.name else SLOPE
        return [self.name] if self.diametral is None else [self.name, slope]


class _ShaftTerms(NamedTuple):
    """Matrices of n pairs of coordinates along x and along y, and masses on them."""

    pairs: list[str]
    K: list[Array]  #: (n, n) [N/m]
    C: list[Array]  #: (n, n) [N s/m]
    rows: list[dict[str, Array]]  #: (n,) of K by support: its force by the pairs
    damped: list[dict[str, Array]]  #: likewise of C
    internal: Array  #: (n, n) [N s/m] damping that turns with the shaft
    diametral: list[float]  #: [kg m^2] of each pair
    polar: list[float]
    lumps: list[Lump]


def _check_names(where: str, disks: Sequence[_Disk], joint: RotorKeys) -> None:
    """Refuse names that coordinates cannot have, or of which two would be alike."""
    taken = {'', SLOPE}
    for part, key, pairs in (
        *(('disks', d.name, [d.name, f'{d.name}_{SLOPE}']) for d in disks if d.name),
        *(('supports', key, [key]) for key in joint.supports),
    ):
        if not key.isidentifier() or taken & {*pairs}:
            raise InputError(
                f'{where}.{part}.{key}: a name is of letters, digits and _, not {SLOPE}, and no '
                f'other disk or support has it, alone or with _{SLOPE}'
            )
        taken |= {*pairs}


def _check(where: str, joint: RotorKeys, support: SupportPart) -> None:
    """Refuse supports that cannot be, one by one."""
    rigid, damped = support.stiffness is None, any(_both(support.damping))
    loaded = support.along in {0.0, *(disk.along for disk in joint.disks.values())}
    if rigid and (damped or support.mass):
        raise InputError(f"{where}: without 'stiffness' it is rigid, and has no damping nor mass")
    if not joint.shaft and (rigid or support.clamped):
        raise InputError(
            f"{where}: a rigid shaft needs a 'stiffness' in every support and clamps none; or "
            "give the joint a 'shaft' that bends"
        )
    if joint.shaft and loaded and (rigid or support.mass):
        raise InputError(
            f'{where} is in the middle of a disk: there it needs a stiffness, and its mass '
            "belongs to the disk; or set it 'along' the shaft"
        )
    if joint.shaft and damped and not support.mass:
        raise InputError(
            f"{where}.damping needs a 'mass' of what moves in the support, between the shaft that "
            "bends and the damper; or take 'external_damping' at the disk"
        )
    if joint.shaft and joint.shaft.relaxation and not (rigid or support.mass):
        raise InputError(
            f"{where}: internal damping of the shaft needs a 'mass' in compliant supports"
        )


def _bending(where: str, joint: RotorKeys, disks: Sequence[_Disk]) -> _ShaftTerms:
    """A rotor whose shaft bends."""
    shaft, supports = joint.shaft, joint.supports
    assert shaft  # noqa: S101 - it bends
    if shaft.youngs_modulus is None and shaft.material not in MATERIALS:
        raise InputError(
            f"{where}.shaft needs 'youngs_modulus' or a material of {', '.join(MATERIALS)}"
        )
    modulus = shaft.youngs_modulus or MATERIALS[shaft.material or ''][0]
    rigidity = shaft_rigidity(modulus, shaft.diameter)
    sections = _sections(where, shaft, modulus)
    heavy = {key: s for key, s in supports.items() if s.mass}
    pairs = [*(pair for disk in disks for pair in disk.pairs), *heavy]
    n, each = len(pairs), dict(zip(pairs, np.eye(len(pairs)), strict=True))
    found = _ShaftTerms(pairs, [], [], [], [], np.zeros((n, n)), [0.0] * n, [0.0] * n, [])
    for axis in (0, 1):
        bearings = [
            Bearing(
                s.along, np.inf if s.stiffness is None else _both(s.stiffness)[axis],
                bool(s.mass), s.clamped,
            )
            for s in supports.values()
        ]  # fmt: skip
        at = [(disk.along, disk.diametral is not None) for disk in disks]
        bent = condensed(rigidity, bearings, at, sections)
        if bent is None:
            raise _loose(where)
        k, c = bent[0].copy(), np.zeros((n, n))
        rows = dict(zip(supports, bent[1], strict=True))
        damped = dict.fromkeys(supports, np.zeros(n))
        for disk in disks:
            i = pairs.index(disk.name)
            c[i, i] = _both(disk.damping)[axis]
        for key, s in heavy.items():
            i, stiffness = pairs.index(key), _both(s.stiffness or 0.0)[axis]
            k[i, i] += stiffness
            c[i, i] = _both(s.damping)[axis]
            rows[key], damped[key] = each[key] * stiffness, each[key] * c[i, i]
        found.K.append(k)
        found.C.append(c)
        found.rows.append(rows)
        found.damped.append(damped)
        found = found._replace(internal=shaft.relaxation * bent[0])
    for disk in disks:
        if disk.diametral:
            i = pairs.index(disk.pairs[-1])
            found.diametral[i], found.polar[i] = disk.diametral, disk.polar
    found.lumps.extend(
        Lump(d.mass, tuple(each[d.name].tolist()), d.cog, d.polar) for d in disks[1:]
    )
    found.lumps.extend(Lump(s.mass, tuple(each[key].tolist())) for key, s in heavy.items())
    return found


def _sections(
    where: str, shaft: RotorShaftPart, modulus: float
) -> list[tuple[float, float, float]]:
    """Sections of the shaft with another E I: begin, end and E I [m, m, N m^2]."""
    found, before = [], ('', -np.inf)
    for key, s in sorted(shaft.sections.items(), key=lambda item: item[1].begin):
        if not s.end > s.begin:
            raise InputError(
                f'{where}.shaft.sections.{key}.end = {s.end:g} m: must be beyond its begin, '
                f'{s.begin:g} m'
            )
        if s.begin < before[1]:
            raise InputError(
                f'{where}.shaft.sections.{key}.begin = {s.begin:g} m: within the section '
                f'{before[0]}, which ends at {before[1]:g} m'
            )
        before = key, s.end
        found.append((s.begin, s.end, shaft_rigidity(modulus, s.diameter)))
    return found


def _stiff(where: str, joint: RotorKeys, disks: Sequence[_Disk]) -> _ShaftTerms:
    """A rotor whose shaft is rigid."""
    supports = joint.supports
    tilts = joint.diametral_inertia is not None
    apart = len({s.along for s in supports.values()}) > 1
    if not tilts and apart and any(any(_both(s.damping)) or s.mass for s in supports.values()):
        raise InputError(
            f'{where}.diametral_inertia is missing: the disk tilts in supports beside it that '
            'have a damping or a mass'
        )
    if not tilts and joint.disks:
        raise InputError(
            f'{where}.diametral_inertia is missing: further disks on a rigid shaft move with its '
            'tilt'
        )
    n, z = 1 + tilts, np.array([s.along for s in supports.values()])
    lumps = [Lump(s.mass, (1.0, s.along)[:n]) for s in supports.values() if s.mass]
    lumps += [Lump(d.mass, (1.0, d.along), d.cog, d.polar) for d in disks[1:]]
    diametral = [0.0, sum(disk.diametral or 0.0 for disk in disks)][:n]
    polar = [0.0, sum(disk.polar for disk in disks)][:n]
    found = _ShaftTerms(['', SLOPE][:n], [], [], [], [], np.zeros((n, n)), diametral, polar, lumps)
    for axis in (0, 1):
        k = np.array([_both(s.stiffness or 0.0)[axis] for s in supports.values()])
        c = np.array([_both(s.damping)[axis] for s in supports.values()])
        shares = np.stack([np.ones_like(z), z])[:n]
        if not tilts and apart:  # the slope that leaves no moment
            if not (k * z**2).any():
                raise _loose(where)
            shares = (1.0 - z * (k @ z) / (k @ z**2))[None]
        found.K.append(shares * k @ shares.T)
        found.C.append(shares * c @ shares.T)
        for disk in disks:
            arm = np.array([1.0, disk.along][:n])
            found.C[-1] += _both(disk.damping)[axis] * np.outer(arm, arm)
        found.rows.append(dict(zip(supports, (shares * k).T, strict=True)))
        found.damped.append(dict(zip(supports, (shares * c).T, strict=True)))
    return found


def _loose(where: str) -> InputError:
    return InputError(
        f'{where}.supports do not hold the shaft along x and y, and against tilting: set two '
        "apart, each with a stiffness in both directions, or one that is 'clamped'"
    )


def _listed(matrix: Array | Sequence[Array]) -> Rows:
    return tuple(tuple(row.tolist()) for row in matrix)
