"""Links and joints that sensors are mounted on: whether there are such."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from mechanism_sim.errors import InputError, nearest


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
