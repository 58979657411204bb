"""Tools of the palette, and tools of each kind of joint, load and sensor.

Files of `mechanism_sim.editor.tools` register them; kinds do not depend on the editor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from mechanism_sim.editor.sketch import Edit, Sketch, Spot

Draw = Callable[[Sketch, Spot, Spot], list[Edit]]
"""From a sketch and the places where a gesture begins and ends to edits; raises InputError if the
part cannot be there: what it needs."""

_Refit = Callable[[Sketch, str, Any], list[Edit]]
"""Function from a sketch whose links were moved, a joint's name and keys to refitting edits."""


@dataclass(frozen=True)
class Tool:
    """Tool that draws a part."""

    name: str  #: name in the palette
    key: str  #: shortcut, as ``B`` or ``Shift+B``
    icon: str  #: path data of an SVG of 16 by 16
    hint: str  #: instruction for the user
    draw: Draw  #: function that makes the edits of the part
    #: ``band`` between two positions, ``click``, or ``now`` for none
    gesture: Literal['band', 'click', 'now'] = 'click'

    def to_json(self) -> dict[str, str]:
        """Tool for the page."""
        return {x: getattr(self, x) for x in ('name', 'key', 'icon', 'hint', 'gesture')}


TOOLS: dict[str, tuple[Tool, ...]] = {}
"""The tools that draw parts of a kind, by its name, or by the section of its loads."""

REFITS: dict[str, _Refit] = {}
"""Functions that fit joints to links that were moved, of those kinds that must fit."""


def draws(
    kind: str,
    name: str,
    key: str,
    icon: str,
    hint: str,
    gesture: Literal['band', 'click', 'now'] = 'click',
) -> Callable[[Draw], Draw]:
    """Decorator of the function of a tool, which follows those of this kind in the palette."""

    def enter(draw: Draw) -> Draw:
        TOOLS[kind] = (*TOOLS.get(kind, ()), Tool(name, key, icon, hint, draw, gesture))
        return draw

    return enter


def refits(kind: str) -> Callable[[_Refit], _Refit]:
    """Decorator of the function that fits joints of a kind to links that were moved."""

    def enter(refit: _Refit) -> _Refit:
        REFITS[kind] = refit
        return refit

    return enter
