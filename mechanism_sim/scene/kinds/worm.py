"""Worms and their wheels."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, Literal

from mechanism_sim.errors import InputError
from mechanism_sim.gears.forces import WormPair
from mechanism_sim.gears.spatial import WormDrive
from mechanism_sim.planar.joint_friction import FlankFriction
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene.contact_keys import Friction
from mechanism_sim.scene.joint_keys import JointKind, Reference, register
from mechanism_sim.scene.kinds.bevel import SpatialKeys, needed, placed, pressure_angle_of
from mechanism_sim.scene.kinds.transmission import carrier_of
from mechanism_sim.scene.names import Names
from mechanism_sim.scene.quantities import Angle, Length


class WormKeys(SpatialKeys):
    """A worm and its wheel on shafts at 90 degrees."""

    worm: Reference | None = None
    """Links of a worm and of its wheel."""
    diameter: Length | None = None
    """Pitch diameter of a worm; required."""
    lead_angle: Angle | None = None
    """Of a worm's thread, which is the helix angle of its wheel; required."""
    hand: Literal['right', 'left'] | None = None
    """Of a worm, right without it: then its wheel turns the same way, each seen on its axis."""


def _read(places: Names, name: str, joint: WormKeys) -> WormDrive:
    """A worm and its wheel."""
    needed(name, joint, 'teeth', 'diameter', 'lead_angle')
    (a, on_a), (b, on_b) = places.ends(name)
    threads, teeth = joint.teeth or (1, 1)
    try:
        sizes = WormPair(
            threads,
            teeth,
            joint.diameter or 0.0,
            joint.lead_angle or 0.0,
            pressure_angle_of(joint),
        )
    except InputError as error:
        raise InputError(f'joints.{name}: {error}') from error
    hand = -1 if joint.hand == 'left' else 1
    return WormDrive(
        name, a, b, on_a, on_b, Fraction(hand * threads, teeth), joint.phase,
        carrier_of(places, name, joint), *placed(joint), sizes, hand,
        joint.friction.coefficient if joint.friction else 0.0,
    )  # fmt: skip


def _friction(name: str, given: Friction, mechanism: Mechanism) -> list[FlankFriction]:
    """Along the thread, [V] eqs. 5.52 to 5.59."""
    pair = mechanism.joint(name)
    assert isinstance(pair, WormDrive)  # noqa: S101 - of this kind
    lead, press, (r2, r3) = pair.worm.lead_angle, pair.worm.pressure_angle, pair.radii
    return [FlankFriction(
        name, mechanism, given.coefficient,
        (r2 * math.cos(lead), pair.hand * r3 * math.sin(lead)),
        r3 * math.cos(press) * math.cos(lead), pair.carrier,
    )]  # fmt: skip


def _notes(machine: Any, pair: WormDrive) -> list[str]:
    """The friction that it could bear."""
    given = machine.scene.joints[pair.name].friction
    return [
        f'{pair.name}: {"its" if given else "without friction; a"} coefficient of friction '
        f'{f"is {given.coefficient:g}; " if given else ""}'
        f'from {pair.worm.locking_friction:.4g} on the wheel cannot drive the worm'
    ]


register(
    JointKind(
        'worm',
        WormKeys,
        _read,
        firm='a worm has no play here',
        notes=_notes,
        friction=_friction,
    )
)
