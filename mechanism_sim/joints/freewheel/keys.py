"""Freewheels, and ratchets with teeth."""

from __future__ import annotations

from typing import Any, Literal

from mechanism_sim.errors import InputError
from mechanism_sim.joints.bevel.keys import Teeth
from mechanism_sim.joints.contact_keys import ClearanceSpec
from mechanism_sim.joints.freewheel.constraint import Freewheel, Overrun
from mechanism_sim.joints.joint_keys import KINDS, Reference, TouchingKeys
from mechanism_sim.joints.transmission.keys import PhaseKeys, guides_of
from mechanism_sim.keys.names import Names
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.protocols import MotionBound
from mechanism_sim.planar.view import Side


class OneWayKeys(PhaseKeys):
    """Joints that drive one way and are overrun the other way."""

    drives: Literal['counterclockwise', 'clockwise'] | None = None
    """Of a freewheel or ratchet: how the first turns where it takes the second along,
    counterclockwise without it. Of links that slide that is along their guides."""

    firm = 'it has no play; that of a ratchet is in its teeth'
    touches_by = '', 'compliance'

    def read(self, names: Names, name: str) -> Freewheel:
        """Two links on one axis."""
        where = f'joints.{name}'
        (a, on_a), (b, on_b) = names.ends(name)
        guides, teeth = guides_of(names, where, (a, b), GROUND), getattr(self, 'teeth', None)
        if teeth and guides:
            raise InputError(f'{where}.teeth are on a turn, but {a} and {b} slide')
        if self.phase and not teeth:
            raise InputError(f'{where}.phase has no meaning: a freewheel holds at any angle')
        sense = -1.0 if self.drives == 'clockwise' else 1.0
        return Freewheel(
            name, a, b, on_a, on_b, phase=self.phase, guides=guides, sense=sense,
            teeth=teeth or 0,
        )  # fmt: skip

    def touches(self, _: str) -> ClearanceSpec:
        """Contact without restitution."""
        return ClearanceSpec(radial=0.0, restitution=0.0)

    def describe(self, joint: Any) -> str:
        """Describe the effect of the clutch in words."""
        way = 'clockwise' if joint.sense < 0.0 else 'counterclockwise'
        kind = f'ratchet of {joint.teeth} teeth' if joint.teeth else 'freewheel'
        return f'{kind}: {joint.first} takes {joint.second} along {way}'

    def bounds(self, spec: ClearanceSpec, joint: Any, mechanism: Mechanism) -> list[MotionBound]:
        """The one that holds."""
        side: Side = 'right' if joint.sense > 0.0 else 'left'
        return [Overrun(joint.closure(mechanism), side, 0.0, **spec.behaviour())]


@KINDS.add('freewheel')
class FreewheelKeys(OneWayKeys):
    """A freewheel."""

    freewheel: Reference | None = None
    """Two links on one axis: the first takes the second along one way, and is overrun by it."""


@KINDS.add('ratchet')
class RatchetKeys(TouchingKeys, OneWayKeys):
    """A ratchet."""

    ratchet: Reference | None = None
    """Two links on one axis, as of a freewheel, that hold each other by teeth and a pawl."""
    teeth: Teeth | None = None
    """Of a bevel pair; of a worm pair threads of the worm and teeth of the wheel; of a ratchet one
    number, those on a turn. Required."""

    def read(self, names: Names, name: str) -> Freewheel:
        """Read a ratchet with its teeth."""
        if self.teeth is None:
            raise InputError(f'joints.{name}.teeth is missing: how many on a turn, such as 24')
        if not isinstance(self.teeth, int) or self.teeth < 3:
            raise InputError(
                f'joints.{name}.teeth = {self.teeth} must be one number of at least 3: those of '
                'the wheel on a turn, such as 24'
            )
        return OneWayKeys.read(self, names, name)
