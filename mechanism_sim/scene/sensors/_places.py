"""The angle of a link on another, which encoders and tachometers read."""

from __future__ import annotations

from typing import Any

from mechanism_sim.errors import InputError
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.sensor_keys import check_link


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
    known = [GROUND, *machine.plan.links]
    if sensor.relative_to not in known:
        raise InputError(
            f"{where}.relative_to: there is no link '{sensor.relative_to}'; links: "
            f'{", ".join(known)}'
        )
    frames = [machine.mechanism.frame(x)[0] for x in (sensor.link, sensor.relative_to)]
    if frames[0] == frames[1]:
        raise InputError(
            f'{where}: {sensor.link} does not turn on {sensor.relative_to}: {does} the angle '
            'between two links'
        )
