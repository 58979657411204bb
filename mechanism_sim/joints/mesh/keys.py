"""Meshes of gears and other transmissions of a scene, and how the teeth stand at the start."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from mechanism_sim.errors import InputError
from mechanism_sim.joints.contact_keys import ClearanceSpec, Contact, Friction, clearance_spec_of
from mechanism_sim.joints.joint_keys import KINDS, JointKeys, Joints, Reference
from mechanism_sim.joints.mesh.compliance import Elasticity, middle, touching
from mechanism_sim.joints.mesh.constraint import GearMesh
from mechanism_sim.joints.mesh.involute import rounded_up
from mechanism_sim.joints.mesh.pair import Pair, sliding_arm
from mechanism_sim.joints.mesh.placement import Harmonic, Teeth
from mechanism_sim.joints.mesh.sheet import MeshParts
from mechanism_sim.joints.mesh.wheels import Placed, Wheel, place, read_wheel
from mechanism_sim.keys.gear_keys import GearPart
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Coefficient, Displacement, Hypothesis, Length, Part, si
from mechanism_sim.keys.quantities import Friction as FrictionCoefficient
from mechanism_sim.planar.joint_friction import TeethFriction
from mechanism_sim.planar.mechanism import Mechanism


def _shares(value: Any) -> Any:
    """Check the shares of a stiffness's harmonics, or ``contact_ratio``."""
    numbers = isinstance(value, list | tuple) and all(isinstance(x, float | int) for x in value)
    if not numbers and value != 'contact_ratio':
        raise ValueError("must be 'contact_ratio' or a list of numbers such as [0.2, 0.1]")
    return value


_Variation = Annotated[tuple[float, ...] | Literal['contact_ratio'], BeforeValidator(_shares)]
_Stiffness = Annotated[float, si('N/m'), Field(gt=0.0)]
_Damping = Annotated[float, si('N s/m'), Field(ge=0.0)]


class BacklashPart(Part):
    """Free travel of the teeth, and what happens at its ends."""

    width: Length | None = None
    """Free way along the working pitch circle; else what the centre distance leaves. Of a
    transmission of links that slide, that of the second."""
    angle: Annotated[float, si('rad'), Field(gt=0.0)] | None = None
    """Of a transmission of links that turn: free angle of the second from stop to stop."""
    restitution: Coefficient | None = None
    """Coefficient of restitution: 0 without rebound, 1 without loss."""
    hypothesis: Hypothesis = 'newton'
    """Hypothesis of restitution: the ratio of velocities, of impulses or of energies."""
    friction: FrictionCoefficient = 0.0
    """Coefficient of friction of rigid flanks, at the mean distance from the pitch point."""
    contact: Contact | None = None
    """A contact force law instead of rigid teeth."""


class ElasticityPart(Part):
    """Stiffness and damping of the teeth along the line of action."""

    stiffness: _Stiffness
    """Along the line of action."""
    damping: _Damping = 0.0
    """Along the line of action."""
    variation: _Variation = ()
    """Harmonics of the tooth frequency over the mean, or `contact_ratio`."""


class ErrorPart(Part):
    """Transmission error along the line of action, zero at the start."""

    amplitude: Displacement = 0.0
    """Of a harmonic of the tooth frequency."""
    order: Annotated[int, Field(ge=1, le=100)] = 1
    """Which harmonic it is."""
    eccentricity: tuple[Displacement, Displacement] = (0.0, 0.0)
    """Of both gears: an error once a turn of each."""


@KINDS.add('mesh')
class MeshKeys(JointKeys):
    """Gears in mesh."""

    mesh: Reference | None = None
    """Two gears, by their names; a rack is named second."""
    backlash: BacklashPart | None = None
    """Backlash of teeth, or between the stops of a transmission, as of dogs on coaxial shafts;
    without it they stay in contact."""
    elasticity: ElasticityPart | None = None
    """Compliance of the teeth."""
    error: ErrorPart | None = None
    """Transmission error along the line of action, zero at the start."""

    firm = "the clearance of teeth is their 'backlash'"
    parts = MeshParts
    friction_keys = (), False
    friction_when_loose = last = True

    def read(self, names: Names, name: str) -> GearMesh:
        """Two gears in mesh; their phase is set by `assembled`."""
        where = f'joints.{name}'
        one, two = (read_wheel(names, gear) for gear in self.points)
        if one.part.rack:
            raise InputError(f'{where}.mesh: name the gear first, then the rack')
        if one.link == two.link:
            raise InputError(f'{where}.mesh: {one.name} and {two.name} are fixed to one link')
        for key, unit, scale in (
            ('module', 'mm', 1e-3),
            ('pressure_angle', 'deg', math.pi / 180.0),
        ):
            a, b = getattr(one.part, key), getattr(two.part, key)
            if a != b:
                raise InputError(
                    f'{where}.mesh: {one.name} and {two.name} do not mesh: their '
                    f'{key.replace("_", " ")}s are {a / scale:g} {unit} and {b / scale:g} {unit}'
                )
        if abs(one.part.helix_angle) != abs(two.part.helix_angle):
            raise InputError(
                f'{where}.mesh: {one.name} and {two.name} do not mesh: helical gears on parallel '
                'shafts have equal helix angles, of opposite hands'
            )
        try:
            placed = place(names, one, two)
            play = self._play(placed, one.gear.base_pitch)
            elasticity = self._elasticity(one, placed)
        except InputError as error:
            raise InputError(f'{where}: {error}') from error
        return GearMesh(
            name, one.link, two.link, one.at, two.at, placed.carrier, placed.waves,
            one.gear.base_pitch, placed.pressure_angle, placed.towards, placed.reach,
            placed.facing, placed.guide, bearings=placed.bearings, play=play,
            errors=self._errors(where, placed, one.gear.base_pitch), elasticity=elasticity,
            wheels=(Teeth(one.name, one.gear),
                    Teeth(two.name, one.gear if two.part.rack else two.gear, two.part.rack)),
            sliding_arm=sliding_arm(placed.path, one.gear.base_pitch),
            contact_ratio=(placed.path.end - placed.path.start) / one.gear.base_pitch,
            helix_angle=math.atan(abs(math.tan(one.part.helix_angle)) * abs(placed.reach)
                                  / one.gear.pitch_radius),
            hand=-1 if one.part.helix_angle < 0.0 else 1, along=(one.part.along, two.part.along),
        )  # fmt: skip

    def clearance_spec(self, joint: GearMesh) -> ClearanceSpec | None:
        """Backlash as a clearance; elastic teeth have one of zero width at least."""
        if joint.elastic:
            return ClearanceSpec(radial=joint.play, restitution=0.0)
        return clearance_spec_of(self.backlash, joint.play) if self.backlash else None

    @classmethod
    def check_all(cls, names: Names, joints: Joints, closing: Collection[str]) -> None:
        """Refuse wrong gears that mesh with none, and shafts that are no joints of the tree."""
        for gear in names.scene.gears:
            read_wheel(names, gear)
        for mesh in (j for j in joints if isinstance(j, GearMesh)):
            if torn := [n for n in mesh.bearings if n in closing]:
                raise InputError(
                    f'joints.{mesh.name}: the shafts of gears form a closed loop, of which '
                    f'{torn[0]} is one: leave out a mesh of that loop, or make it a transmission'
                )

    @classmethod
    def assembled(
        cls, names: Names, joints: Joints, tree: Mechanism, start: Mapping[str, float]
    ) -> Joints:
        """Joints with the teeth of all gears placed in spaces at the start.

        Every gear may be fixed to its link at any angle. Where meshes close a ring, as those of
        two planets between sun and ring gear do, the last one may not fit.
        """
        q = {c: start.get(c, 0.0) for c in tree.coordinates}
        teeth: dict[str, float] = {}  # by gear: angle of a tooth in its link [rad], of a rack [m]
        placed: dict[str, GearMesh] = {}
        waiting = [j for j in joints if isinstance(j, GearMesh)]
        while waiting:
            near = [j for j in waiting if {*names.scene.joints[j.name].points} & teeth.keys()]
            mesh = near[0] if near else waiting[0]
            waiting.remove(mesh)
            one, two = names.scene.joints[mesh.name].points
            at = mesh.places(tree, q)
            phase = sum(w * x for w, x in zip(mesh.waves, at, strict=True))
            (w, v), (here, there) = mesh.waves, mesh.facing
            # a tooth of the one on the line of centres faces a space of the other
            both = phase - math.pi
            if one not in teeth:
                known = both - v * (there - teeth[two]) if two in teeth else w * here
                teeth[one] = here - known / w
            first = w * (here - teeth[one])
            if two not in teeth:
                teeth[two] = there - (both - first) / v
            second = v * (there - teeth[two])
            off = math.remainder(first + second - both, 2.0 * math.pi) / (2.0 * math.pi)
            if abs(off) > 1e-6:
                raise InputError(
                    f'joints.{mesh.name}: the train cannot be assembled: the teeth of {one} and '
                    f'{two} are {abs(off):.3g} pitches off, as other meshes fix both; change '
                    'the angle between the planets, or the numbers of teeth'
                )
            elasticity = mesh.elasticity and replace(mesh.elasticity, tooth=first)
            errors = tuple(replace(e, start=at[e.member]) for e in mesh.errors)
            wheels = tuple(x._replace(tooth=teeth[x.name]) for x in mesh.wheels)
            placed[mesh.name] = replace(
                mesh, phase=phase, elasticity=elasticity, errors=errors, wheels=wheels
            )
        return tuple(placed.get(j.name, j) for j in joints)

    def frictions(self, given: Friction, joint: Any, mechanism: Mechanism) -> list[TeethFriction]:
        """Mean friction of the teeth."""
        arm, share = joint.sliding_arm, joint.friction_share
        return [TeethFriction(joint.name, mechanism, given.coefficient, arm, share)]

    def _play(self, placed: Placed, base_pitch: float) -> float:
        """Free travel of the teeth to either side, along the line of action [m]."""
        backlash = self.backlash
        if backlash is None:
            if placed.backlash:
                raise InputError(
                    f'the teeth have a backlash of {placed.backlash:.3g} m: take {placed.tight}, '
                    "or give them a 'backlash'"
                )
            return 0.0
        if backlash.angle is not None:
            raise InputError("'backlash.angle' is of a transmission: teeth have a 'width'")
        width = backlash.width if backlash.width is not None else placed.backlash
        if not width:
            raise InputError(
                'backlash.width is missing, and the distance of the centres leaves no play: give '
                'a width, or set the gears further apart'
            )
        if not self.elasticity and backlash.restitution is None:
            raise InputError("'backlash.restitution' is missing: the teeth are rigid")
        if self.elasticity and (
            backlash.contact or backlash.friction or backlash.restitution is not None
        ):
            raise InputError(
                'elastic teeth rebound by their stiffness and have no friction: leave out '
                'backlash.restitution, backlash.contact and backlash.friction'
            )
        largest = 0.5 * base_pitch / math.cos(placed.pressure_angle)
        if width >= largest:
            raise InputError(
                f'backlash.width is {width:.3g} m, as much as a tooth is thick: it must be less '
                f'than {largest:.3g} m'
            )
        return 0.5 * width * math.cos(placed.pressure_angle)

    def _elasticity(self, one: Wheel, placed: Placed) -> Elasticity | None:
        given = self.elasticity
        if given is None:
            return None
        pitch = one.gear.base_pitch
        asked = given.variation
        variation = touching(placed.path, pitch) if isinstance(asked, str) else asked
        lead = placed.half - middle(placed.path, pitch)
        return Elasticity(given.stiffness, given.damping, variation, 0.0, lead)

    def _errors(self, where: str, placed: Placed, base_pitch: float) -> tuple[Harmonic, ...]:
        error = self.error
        if error is None:
            return ()
        if error.amplitude + sum(error.eccentricity) > 0.25 * base_pitch:
            raise InputError(
                f'{where}.error is more than half the thickness of a tooth: all of it must be '
                f'less than {0.25 * base_pitch:.3g} m'
            )
        found = []
        if error.amplitude:
            found.append(Harmonic(0, error.order * placed.waves[0], error.amplitude))
        for member, size in enumerate(error.eccentricity):
            if size and member and placed.guide:
                raise InputError(f'{where}.error.eccentricity: a rack has none: give [X, 0]')
            if size:
                found.append(Harmonic(member, 1.0, size))
        return tuple(found)

    def notes(self, machine: Any, joint: GearMesh) -> list[str]:
        """Remarks on gears beside their ratio."""
        ideal = machine.plan.ideal
        start = dict(zip(ideal.coordinates, machine.assembly.q.tolist(), strict=True))
        rates = dict(zip(ideal.coordinates, machine.assembly.v.tolist(), strict=True))
        now, later = (
            joint.places(ideal, {c: x + t * rates[c] for c, x in start.items()})[0]
            for t in (0.0, 1.0)
        )
        frequency = abs(joint.waves[0] * (later - now)) / (2.0 * math.pi)
        play = f', play {joint.play:.4g} m to either side' if joint.play else ''
        soft = f', elastic{play}' if joint.elastic else ''
        return [
            *_undercut(machine.scene.gears, joint),
            f'{joint.name}: pressure angle {math.degrees(joint.pressure_angle):.6g} deg, contact '
            f'ratio {joint.contact_ratio:.4g}, tooth frequency {frequency:.6g} Hz at the '
            f'start{soft}',
        ]


def _undercut(gears: Mapping[str, GearPart], mesh: GearMesh) -> Iterator[str]:
    """Rest of undercut teeth, and the profile shifts that end it.

    A shift of one gear alone widens its teeth, so that they jam at the same centre distance: the
    mate gives as much, as far as it is not undercut itself; what is left needs a larger distance.
    """
    for own, mate in (mesh.wheels, mesh.wheels[::-1]):
        if own.rack or not own.gear.undercut:
            continue
        part, other = gears[own.name], gears[mate.name]
        c = math.cos(part.helix_angle)
        shift = rounded_up(own.gear.least_shift / c)
        yield (
            f'{mesh.name}: {own.name} is undercut: its involute begins at a radius of '
            f'{own.gear.form_radius:.6g} m instead of {own.gear.base_radius:.6g} m; '
        ) + _cure(own, mate, (part.shift, other.shift), shift, c)


def _cure(own: Teeth, mate: Teeth, now: tuple[float, float], shift: float, cosine: float) -> str:
    """Profile shifts that end the undercut of a gear, in modules of the rack, and the distance."""
    cured = replace(own.gear, shift=shift * cosine)
    if mate.rack:
        away = cured.pitch_radius + cured.shift * cured.module
        return f'a shift of {shift:g} ends it, its rack {away:.9g} m from its centre'
    change = shift - now[0]
    other = round(now[1] + (change if mate.gear.internal else -change), 9)
    if not mate.gear.internal:
        other = max(other, rounded_up(mate.gear.least_shift / cosine))
    try:
        gears = cured, replace(mate.gear, shift=other * cosine)
        before, after = (
            Pair(*(x[::-1] if x[0].internal else x)).centre_distance
            for x in ((own.gear, mate.gear), gears)
        )
    except InputError:
        return 'take more teeth'
    same = abs(after - before) <= 1e-9 * before
    where = 'the same centre distance' if same else f'a centre distance of {after:.9g} m'
    return f'shifts of {shift:g} for it and {other:g} for {mate.name} end it at {where}'
