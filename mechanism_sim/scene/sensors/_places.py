"""Links and joints that sensors are mounted on: whether there are such."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Literal

from mechanism_sim.errors import InputError, nearest
from mechanism_sim.scene.sketch import Edit, Sketch, Spot, Tool


def check_link(machine: Any, where: str, link: str, frames: Iterable[str] = ()) -> None:
    """Refuse a sensor on a link that does not move, or on no frame of these.

    Raises
    ------
    InputError
    """
    known = [*machine.links, *frames]
    if link not in known:
        raise InputError(
            f"{where}.link: there is no moving link '{link}'{nearest(link, known)}; links: "
            f'{", ".join(known)}'
        )


def check_joint(where: str, joint: str, known: Iterable[str], what: str) -> None:
    """Refuse a sensor in a joint that is none of those `known`, which are `what`.

    Raises
    ------
    InputError
    """
    known = list(known)
    if joint not in known:
        raise InputError(
            f"{where}.joint: '{joint}' is no {what}{nearest(joint, known)}; those are: "
            f'{", ".join(known) or "none"}'
        )


def tool_on_link(
    name: str,
    key: str,
    icon: str,
    values: Mapping[str, Any],
    seat: Literal['point', 'along', ''] = 'point',
) -> Tool:
    """What puts a sensor on a link, with some of its keys.

    Parameters
    ----------
    seat : whether it is at a ``point``, or some way ``along`` an elastic link; else on all of it
    """

    def draw(sketch: Sketch, start: Spot, _: Spot) -> list[Edit]:
        at, edits = sketch.on_link(start, f'a sensor ({name}) is')
        link, _dot, named = at.partition('.')
        where: dict[str, Any] = {'link': link}
        if seat == 'point' and named:
            where['at'] = at
        elif seat == 'along' and not sketch.scene.links[link].elastic:
            raise InputError(f"a sensor ({name}) needs a link with 'elastic', not {link}")
        elif seat == 'along':
            where['at'] = sketch.long(sketch.poses[link].within(sketch.where(start))[0])
        sensor = Edit(('sensors', sketch.name(name)), {**values, **where})
        return [sensor, *(edits if seat == 'point' else [])]

    return Tool(name, key, icon, f'Click on a link{", or on a point of it" * bool(seat)}', draw)


def tool_in_joint(
    name: str,
    key: str,
    icon: str,
    values: Mapping[str, Any],
    play: Mapping[str, Any] | None = None,
) -> Tool:
    """What puts a sensor into a joint, with some of its keys; `play` if that must be loose."""

    def draw(sketch: Sketch, start: Spot, _: Spot) -> list[Edit]:
        if start.handle is None or not start.handle.joint:
            raise InputError(f'a sensor ({name}) is in a joint: press on a pin')
        joint = start.handle.key
        edits = [Edit(('sensors', sketch.name(name)), {**values, 'joint': joint})]
        if play and not sketch.scene.joints[joint].clearance:
            edits.append(Edit(('joints', joint, 'clearance'), dict(play)))
        return [*edits, *sketch.masses()]

    return Tool(name, key, icon, 'Click on a pin', draw)
