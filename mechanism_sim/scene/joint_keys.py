"""What every kind of joint registers: its keys, how it is read, what can be said of it.

A kind is a file in `mechanism_sim.scene.kinds`; whatever lists kinds or keys finds it there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from mechanism_sim.planar.joint_friction import JointFriction
from mechanism_sim.planar.mechanism import Joint, Mechanism
from mechanism_sim.planar.rotor import Rotor
from mechanism_sim.scene.contact_keys import Clearance, Friction, Play
from mechanism_sim.scene.names import Names
from mechanism_sim.scene.quantities import Part

Reference = Annotated[list[str], Field(min_length=2, max_length=2)]
"""Two points, ``LINK.POINT``, or names of what a joint connects."""


class JointKeys(Part):
    """The keys of joints of every kind."""

    clearance: Clearance | None = None
    """Pin on the first-named link, loose in the second; without it the joint is ideal."""
    friction: Friction | None = None
    """Of an ideal joint; a loose one has its own in its clearance."""

    @property
    def kind(self) -> str:
        """Name of the kind: the key that says what the joint connects."""
        return next(kind for kind in KINDS if getattr(self, kind, None) is not None)

    @property
    def points(self) -> list[str]:
        """What it connects."""
        points: list[str] = getattr(self, self.kind)
        return points


def _clearance(joint: JointKeys) -> Play | None:
    return joint.clearance


def _walls_only(given: Clearance) -> str:
    """What a pair without a law of contact cannot have."""
    known = {'radial', 'restitution', 'hypothesis', 'friction', 'pin_radius'}
    wrong = sorted(key for key in given.model_fields_set - known if getattr(given, key))
    return (
        f'has a clearance with {wrong[0]}: here it has {", ".join(sorted(known))} only'
        if wrong
        else ''
    )


@dataclass(frozen=True)
class JointKind:
    """A kind of joints.

    Attributes
    ----------
    name : the key whose value is what such a joint connects; a field of `keys`
    keys : all that a joint of this kind may say
    read : from a scene's names, the joint's name and its keys to the joint; raises InputError
    play : how loose a joint is, if it is
    wrong_play : what is wrong with a clearance of it, or nothing
    firm : why it can have no ``clearance``; empty if it can
    notes : what can be said of a joint of a machine without moving it
    mounted : a joint as it is put together where coordinates have rough values [rad, m], and
        whole turns beside
    friction : those of an ideal joint, of its name, its keys and the mechanism; None if none
    rubs_by : the keys that its friction may have beside the coefficient, and whether the first,
        which says where friction acts, must be given
    slips : whether a joint is loose because friction alone holds it
    rotor : if it lets the axis of a link give way: that link, and how
    """

    name: str
    keys: type[JointKeys]
    read: Callable[[Names, str, Any], Joint]
    play: Callable[[Any], Play | None] = _clearance
    wrong_play: Callable[[Clearance], str] = _walls_only
    firm: str = ''
    notes: Callable[[Any, Any], list[str]] = lambda machine, joint: []  # noqa: ARG005
    mounted: Callable[[Any, Mapping[str, float], Mapping[str, int]], Joint] = (
        lambda joint, start, turned: joint  # noqa: ARG005
    )
    friction: Callable[[str, Friction, Mechanism], Sequence[JointFriction]] | None = None
    rubs_by: tuple[Sequence[str], bool] = ((), False)
    slips: bool = False
    rotor: Callable[[Names, str, Any], tuple[str, Rotor]] | None = None


KINDS: dict[str, JointKind] = {}
"""All kinds of joints by name."""


def keys_of(joint: JointKeys) -> list[str]:
    """The keys that have a meaning in a joint of this kind, what it connects first."""
    kind = KINDS[joint.kind]
    own = kind.keys.__annotations__
    keys = dict.fromkeys([kind.name, *own, *kind.keys.model_fields])
    absent = {'clearance'} if kind.firm else set()
    absent |= set() if kind.friction else {'friction'}
    return [key for key in keys if key not in absent]


def register(kind: JointKind) -> None:
    """Make a kind of joints known."""
    KINDS[kind.name] = kind
