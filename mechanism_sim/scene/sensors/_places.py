"""Links and joints that sensors are mounted on: whether there are such."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from mechanism_sim.errors import InputError, nearest
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND


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


def check_between(machine: Any, where: str, sensor: Any, does: str) -> None:
    """Refuse a sensor of the angle between two links, if there is none; what it `does` with it."""
    check_link(machine, where, sensor.link)
    known = [GROUND, *machine.links]
    if sensor.relative_to not in known:
        raise InputError(
            f"{where}.relative_to: there is no link '{sensor.relative_to}'; links: "
            f'{", ".join(known)}'
        )
    frames = [machine.mechanism.frame(x)[0] for x in (sensor.link, sensor.relative_to)]
    if frames[0] == frames[1]:
        raise InputError(
            f'{where}: {sensor.link} does not turn on {sensor.relative_to}: {does} the '
            'angle between two links'
        )


def check_link(machine: Any, where: str, link: str, frames: Iterable[str] = ()) -> None:
    """Refuse a sensor on a link that does not move, or on no frame of these."""
    known = [*machine.links, *frames]
    if link not in known:
        raise InputError(
            f"{where}.link: there is no moving link '{link}'{nearest(link, known)}; links: "
            f'{", ".join(known)}'
        )


def check_joint(where: str, joint: str, known: Iterable[str], what: str) -> None:
    """Refuse a sensor in a joint that is none of those `known`, which are `what`."""
    known = list(known)
    if joint not in known:
        raise InputError(
            f"{where}.joint: '{joint}' is no {what}{nearest(joint, known)}; those are: "
            f'{", ".join(known) or "none"}'
        )
