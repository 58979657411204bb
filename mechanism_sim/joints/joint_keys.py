"""Kinds of joints: their keys, how they are read, what can be said of them.

A kind is a folder of this room whose `keys.py` has a class that `KINDS.add` makes known; whatever
lists kinds or keys finds it there.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np
from pydantic import Field

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.joints.contact_keys import Clearance, ClearanceSpec, Contact, Friction
from mechanism_sim.joints.sheets import JointParts
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Coefficient, Hypothesis, Part
from mechanism_sim.keys.registry import Registry
from mechanism_sim.planar.gaps import walls
from mechanism_sim.planar.joint_friction import JointFriction
from mechanism_sim.planar.mechanism import Joint, Mechanism
from mechanism_sim.planar.protocols import ForceElement, Gap, MotionBound
from mechanism_sim.planar.rotor import Rotor

Joints: TypeAlias = tuple[Joint, ...]
Contacts: TypeAlias = tuple[Sequence[Gap], Sequence[ForceElement]]
Place: TypeAlias = Mapping[str, float] | None
"""Coordinates, where they are known already."""

Reference = Annotated[list[str], Field(min_length=2, max_length=2)]
"""Two points, ``LINK.POINT``, or names of what a joint connects."""


class JointKeys(Part):
    """The keys of joints of every kind, and how they are read."""

    clearance: Clearance | None = None
    """Pin on the first-named link, loose in the second; without it the joint is ideal."""
    friction: Friction | None = None
    """Of an ideal joint; a loose one has its own in its clearance."""

    #: the reason why it can have no ``clearance``; empty if it can
    firm: ClassVar[str] = ''
    #: the keys that its friction may have beside the coefficient, and whether the first, which
    #: says where friction acts, must be given; None of joints without friction
    friction_keys: ClassVar[tuple[tuple[str, ...], bool] | None] = None
    #: its contacts come after those of other kinds in the order of gaps
    last: ClassVar[bool] = False
    #: its friction acts although it is loose
    friction_when_loose: ClassVar[bool] = False
    #: where the contacts of `touches` are given, and the key of their law of force
    touches_by: ClassVar[tuple[str, str]] = '.stops', 'contact'
    #: what touches in it, if that has figures and an outline
    parts: ClassVar[type[JointParts] | None] = None
    #: lets the axis of a link give way, see `rotor_of`
    gives_way: ClassVar[bool] = False

    @property
    def kind(self) -> str:
        """Name of the kind: the key that says what the joint connects."""
        return next(kind for kind in KINDS if getattr(self, kind, None) is not None)

    @property
    def kind_keys(self) -> JointKeys:
        """Keys and methods of its kind alone, with its values."""
        return self.as_kind(KINDS[self.kind])

    @property
    def points(self) -> list[str]:
        """References of both ends, of points or of gears; the outer two of a rope."""
        points: list[str] = getattr(self, self.kind)
        return [points[0], points[-1]]

    def read(self, names: Names, name: str) -> Joint:
        """The joint of that name of a mechanism."""
        raise NotImplementedError

    def clearance_spec(self, joint: Any) -> ClearanceSpec | None:
        """Clearance of the joint of a mechanism, if it is loose."""
        return self.clearance

    def touches(self, name: str) -> ClearanceSpec | None:
        """Contacts of the joint of that name beside its constraint or clearance, such as stops."""
        return None

    @classmethod
    def check_all(cls, names: Names, joints: Joints, closing: Collection[str]) -> None:
        """Refuse what does not fit together of all joints, of which `closing` are cut."""

    @classmethod
    def assembled(
        cls, names: Names, joints: Joints, tree: Mechanism, start: Mapping[str, float]
    ) -> Joints:
        """The joints, those of this kind as they fit together at the start.

        Parameters
        ----------
        start : coordinates; others are zero
        """
        return joints

    def clearance_objection(self, given: Clearance) -> str:
        """An objection to a clearance of it; empty if there is none."""
        known = {'radial', 'restitution', 'hypothesis'}
        known |= {'friction', 'pin_radius'} if self.friction_keys else set()
        wrong = sorted(key for key in given.model_fields_set - known if getattr(given, key))
        said = f'here it has {", ".join(sorted(known))} only'
        return f'has a clearance with {wrong[0]}: {said}' if wrong else ''

    def mounted(self, joint: Any, start: Mapping[str, float], turned: Mapping[str, int]) -> Joint:
        """Joint as it is assembled at rough values [rad, m] and whole turns of coordinates."""
        mounted: Joint = joint
        return mounted

    def frictions(
        self, given: Friction, joint: Any, mechanism: Mechanism
    ) -> Sequence[JointFriction]:
        """Friction of the ideal joint of a mechanism."""
        return ()

    def contacts(self, spec: ClearanceSpec, joint: Any, mechanism: Mechanism) -> Contacts:
        """The gaps of a loose joint; what it has instead where it is elastic or full of oil."""
        gaps = () if joint.elastic else walls(
            joint.closure(mechanism), spec.radial, spec.pin_radius, **spec.behaviour()
        )  # fmt: skip
        return gaps, joint.elements(mechanism)

    def seat(
        self, spec: ClearanceSpec, joint: Any, m: Mechanism, force: Array, place: Place
    ) -> Array:
        """Initial offset (r,) [m] of a loose joint at rest, along the rows of its closure.

        Under a force (2,) [N] of the first on the second link, the links being at a place.
        """
        law = spec.law()
        return np.array([-(law.resting_depth(float(np.hypot(*force))) if law else 0.0)])

    def describe(self, joint: Any) -> str:
        """Describe the contacts of the joint in words."""
        raise NotImplementedError

    def bounds(
        self, spec: ClearanceSpec, joint: Any, mechanism: Mechanism
    ) -> Sequence[MotionBound]:
        """The gaps of these contacts."""
        return ()

    def rotor_of(self, names: Names, name: str) -> tuple[str, Rotor]:
        """Link with a compliant axis, and its rotor."""
        raise NotImplementedError

    def notes(self, machine: Any, joint: Any) -> list[str]:
        """Remarks on the joint of a machine at rest."""
        return []

    def plausibility_warnings(self, machine: Any, joint: Any) -> list[str]:
        """Warnings about implausible keys, which every command repeats."""
        return []


class TouchingKeys(JointKeys):
    """Joints that are nothing but a contact, such as discs, or a rope that tightens."""

    restitution: Coefficient = 0.0
    """Of a contact, ratchet or rope, its coefficient of restitution, 0 without a bounce, 1 loses
    nothing."""
    hypothesis: Hypothesis | None = None
    """Of the same, quantities that the coefficient relates: speeds (without it), impulses or
    works."""
    compliance: Contact | None = None
    """Of the same, a law of force instead of rigid surfaces; of a rope, how it stretches."""

    touches_by = '', 'compliance'

    def touches(self, name: str) -> ClearanceSpec:
        """Contact of the surfaces."""
        if self.compliance and self.compliance.law == 'film':
            raise InputError(f'joints.{name}.compliance.law = film is for pins in bushings')
        return ClearanceSpec(
            radial=0.0, restitution=self.restitution, hypothesis=self.hypothesis or 'newton',
            friction=self.friction.coefficient if self.friction else 0.0, contact=self.compliance,
        )  # fmt: skip


KINDS = Registry[type[JointKeys]]()
"""All kinds of joints by name: the key whose value is what such a joint connects."""


def contacts_of(
    joints: Mapping[str, JointKeys], mechanism: Mechanism, clearances: Mapping[str, ClearanceSpec]
) -> tuple[list[Gap], list[ForceElement]]:
    """The gaps and the force elements of all loose joints of a mechanism."""
    gaps: list[Gap] = []
    elements: list[ForceElement] = []
    for name, spec in clearances.items():
        keys = joints[name]
        found = keys.kind_keys.contacts(spec, mechanism.joint(name), mechanism)
        gaps += found[0]
        elements += found[1]
    return gaps, elements


def bounds_of(
    joints: Mapping[str, JointKeys], mechanism: Mechanism, touching: Mapping[str, ClearanceSpec]
) -> list[MotionBound]:
    """The gaps of joints of a mechanism that have some beside their constraint or clearance."""
    return [
        gap
        for name, spec in touching.items()
        for keys in [joints[name]]
        for gap in keys.kind_keys.bounds(spec, mechanism.joint(name), mechanism)
    ]


def keys_of(joint: JointKeys) -> list[str]:
    """The keys that have a meaning in a joint of this kind, what it connects first."""
    kind = KINDS[joint.kind]
    fields = kind.model_fields
    keys = dict.fromkeys([joint.kind, *(k for k in kind.__annotations__ if k in fields), *fields])
    absent = {'clearance'} if kind.firm else set()
    absent |= set() if kind.friction_keys else {'friction'}
    return [key for key in keys if key not in absent]
