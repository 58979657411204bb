"""Kinds of sensors: their keys, what they are mounted on, what can be said of them.

A kind is a file in `mechanism_sim.scene.sensors` with a class of keys that `SENSORS.add` makes
known; whatever lists kinds or keys finds it there. The parts of the chain behind a sensor are in
`mechanism_sim.sensing.chain`.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

from mechanism_sim.errors import InputError, check_known, nearest
from mechanism_sim.keys.quantities import Angle, Duration, Part, Rate
from mechanism_sim.keys.registry import Registry
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.level import Level
from mechanism_sim.sensing.chain import Amplifier, AntiAlias, Converter, Noise, Trigger
from mechanism_sim.sensing.channel import SensorSource


class SensorKeys(Part):
    """The keys of sensors of every kind, and how they are read."""

    kind: str = 'accelerometer'
    """Kind of sensor."""
    sample_rate: Rate = 10000.0
    """In simulated time."""
    trigger: Trigger | None = None
    """Blocks that begin at an angle of the drive; {} is enough."""

    #: keys that must be given
    needs: ClassVar[tuple[str, ...]] = ()
    #: the quantity that it measures, one of `QUANTITIES`; empty if its keys say so
    reads: ClassVar[str] = ''

    def source(self, machine: Any) -> SensorSource:
        """Input of its chain."""
        raise NotImplementedError

    def carrier(self, machine: Any) -> str:
        """The link or frame that carries it."""
        raise NotImplementedError

    def place(self, machine: Any) -> str:
        """Place of the sensor in words."""
        raise NotImplementedError

    def trigger_in(self, machine: Any) -> int:
        """Index of the coordinate that triggers it, if any does."""
        return machine.mechanism.coordinates.index(machine.plan.main) if self.trigger else 0

    def check(self, machine: Any, where: str) -> None:
        """Refuse what no machine has."""


class AnalogueKeys(SensorKeys):
    """A sensor with an amplifier, a filter and a converter behind it."""

    amplifier: Amplifier = Amplifier()
    """Its filters."""
    anti_alias: AntiAlias | None = None
    """The filter before sampling."""
    adc: Converter = Converter()
    """Analogue-to-digital converter."""
    noise: Noise = Noise()
    """Noise added to the samples."""


class ShockKeys(AnalogueKeys):
    """A sensor that impacts reach as impulses."""

    impact_pulse: Duration | None = None
    """Duration of an impact, as half a sine; impulses if not given."""


class OnLinkKeys(SensorKeys):
    """A sensor on a link."""

    link: str | None = None
    """Required: the moving link that carries it; of an accelerometer also a frame on springs."""

    needs: ClassVar[tuple[str, ...]] = ('link',)

    def carrier(self, machine: Any) -> str:
        """Link that carries the sensor."""
        return str(self.link)

    def check(self, machine: Any, where: str) -> None:
        """Refuse a sensor on a link that does not move."""
        check_link(machine, where, self.link)


class InJointKeys(SensorKeys):
    """A sensor in a joint."""

    joint: str | None = None
    """Required: the joint it is in."""
    direction: Angle = 0.0
    """Of what it reads, in the frame of the joint's second link; 0: along that link."""

    needs: ClassVar[tuple[str, ...]] = ('joint',)

    def carrier(self, machine: Any) -> str:
        """The second link of its joint."""
        return str(machine.mechanism.joint(self.joint).second)

    def place(self, machine: Any) -> str:
        """Joint and direction."""
        link = machine.mechanism.joint(self.joint).second
        return f'in {self.joint}, at {self.direction:g} rad in the frame of the {link}'


def check_link(machine: Any, where: str, link: str | None, frames: Iterable[str] = ()) -> None:
    """Refuse a sensor on a link that does not move, or on no frame of these."""
    known = [*machine.plan.links, *frames]
    check_known(link, known, f"{where}.link: there is no moving link '{link}'", 'links:')


def check_impulses(machine: Any) -> None:
    """Refuse impacts beside friction in ideal joints: steps do not tell one from the other."""
    given = {name: joint.friction for name, joint in machine.scene.joints.items()}
    held = dict.fromkeys(friction.name for friction in machine.plan.frictions(machine.mechanism))
    rubbing = [name for name in held if (own := given[name]) and own.coefficient]
    if rubbing and machine.level is Level.NONSMOOTH:
        raise InputError(
            f'joints.{rubbing[0]}.friction: beside rigid contacts with clearance impulses in '
            'joints are not known, which load cells and the joints of frames ask for; leave out '
            'the friction, or give the clearances a contact with a stiffness'
        )


def check_joint(where: str, joint: str | None, known: Iterable[str], what: str) -> None:
    """Refuse a sensor in a joint that is none of those `known`, which are `what`."""
    known = list(known)
    check_known(joint, known, f"{where}.joint: '{joint}' is not a {what}", 'those are:')


def _named(data: dict[str, Any], key: str, kind: type = object) -> list[tuple[str, Any]]:
    """Names and what they mean, as far as a file says such a thing."""
    given = data.get(key)
    found = given.items() if isinstance(given, dict) else ()
    return [(name, x) for name, x in found if isinstance(x, kind)]


def seated(data: Any) -> Any:
    """A scene, as it was given, whose sensors at named points have their links and offsets.

    Raises
    ------
    ValueError
        If a link has no such point.
    """
    places = {
        f'{link}.{point}': place
        for link, x in _named(data, 'links', dict)
        for point, place in [('start', 0.0), ('end', x.get('length')), *_named(x, 'points')]
        if place is not None
    }
    found = {}
    for name, sensor in _named(data, 'sensors', dict):
        at = sensor.get('at')
        if not isinstance(at, str) or not at.rpartition('.')[2].isidentifier():
            continue
        own, point = at.rpartition('.')[::2]
        place = f'{own or sensor.get("link")}.{point}'
        if place not in places and f'{at}.start' in places:
            place = f'{at}.start'  # a link by itself is its origin, as of loads
        link = place.rpartition('.')[0]
        if place not in places or sensor.get('link', link) != link:
            raise ValueError(
                f"sensors.{name}.at = '{at}' is not a point of the sensor's "
                f'link{nearest(place, places)}; write LINK.POINT, for example rocker.end, a '
                "distance along the link, '64 mm', or [x, y]"
            )
        found[name] = {**sensor, 'link': link, 'at': places[place]}
    return {**data, 'sensors': {**data['sensors'], **found}} if found else data


SENSORS = Registry[type[SensorKeys]]()
"""All kinds of sensors by name, the value of ``kind``."""


def sensor_keys_of(sensor: SensorKeys) -> list[str]:
    """The keys that have a meaning in a sensor of this kind, those that must be given first."""
    keys = SENSORS[sensor.kind]
    own = [key for key in keys.__annotations__ if key in keys.model_fields]
    return list(dict.fromkeys(['kind', *keys.needs, *own, *keys.model_fields]))


def angle_between(
    mechanism: Mechanism, link: str, relative_to: str
) -> tuple[dict[int, float], float]:
    """The angle of a link on another: coordinates' factors by index, and what is added [rad]."""
    columns, added = {}, 0.0
    for sign, name in ((1.0, link), (-1.0, relative_to)):
        frame, offset = mechanism.frame(name)
        added += sign * offset
        if frame != GROUND:
            columns[mechanism.coordinates.index(frame)] = sign
    return columns, added


class BetweenKeys(OnLinkKeys):
    """A sensor of the angle between two links."""

    relative_to: str = GROUND
    """The link that carries its head."""

    #: with that angle, in words
    does: ClassVar[str]

    def check(self, machine: Any, where: str) -> None:
        """Refuse links that do not turn on each other."""
        super().check(machine, where)
        known = [GROUND, *machine.plan.links]
        if self.relative_to not in known:
            raise InputError(
                f"{where}.relative_to: there is no link '{self.relative_to}'; links: "
                f'{", ".join(known)}'
            )
        frames = [machine.mechanism.frame(x)[0] for x in (self.link, self.relative_to)]
        if frames[0] == frames[1]:
            raise InputError(
                f'{where}: {self.link} does not turn on {self.relative_to}: {self.does} the angle '
                'between two links'
            )
