"""Choices and poses that an editor keeps beside the text of a document while it is open."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mechanism_sim.editor import turn_chart, wear
from mechanism_sim.editor.motion import UNSOLVED, Turn
from mechanism_sim.editor.sketch import Edit, Poses, Sketch
from mechanism_sim.errors import InputError
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.schema import Scene


class BesideDocument:
    """State beside a document: poses of unconstrained links, colours, the charted quantity."""

    def __init__(self) -> None:
        #: ``joint`` and ``radial`` clearance [m] of the pin with wear in a second run, if any
        self.pin: dict[str, Any] = {}
        #: poses of links by text of the document, those of the undo history included
        self.lain: dict[str, Poses] = {}
        self._quantity = ''
        self._colours: dict[str, int] = {}

    def colours(self, scene: Scene) -> Mapping[str, int]:
        """Numbers of the colours of links: each link keeps its own when others change."""
        links = [link for link in scene.links if link != GROUND]
        for link in links:
            taken = {self._colours[x] for x in links if x in self._colours}
            free = next(k for k in range(len(links) + 1) if k not in taken)
            self._colours.setdefault(link, free)
        return self._colours

    def rename(self, old: str, new: str, poses: Poses, text: str) -> None:
        """A link has another name from this text on."""
        self._colours[new] = self._colours[old]
        self.lain[text] = {new if link == old else link: pose for link, pose in poses.items()}

    def choose(self, quantity: str) -> None:
        """Chart a quantity, as of `turn_chart.names`; of another name none."""
        self._quantity = quantity

    def wear(self, message: Mapping[str, Any], scene: Scene) -> None:
        """Set a worn radial clearance [m] of a pin for a second run; 0 for none."""
        joint, radial = str(message['joint']), float(message['radial'])
        if joint not in wear.joints(scene):
            raise InputError(f'{joint} does not wear here: choose a pin of two links')
        size = min(max(radial, wear.LEAST), wear.MOST)
        self.pin = {'joint': joint, 'radial': size} if radial > 0.0 else {}

    def worn(self, sketch: Sketch) -> list[Edit]:
        """Edits that wear the pin; none where none is worn."""
        if self.pin.get('joint') not in sketch.scene.joints:
            return []
        return wear.edits(sketch, **self.pin)

    def chart(self, turn: Turn | None) -> dict[str, Any] | None:
        """The quantity of a machine that is charted; None if there is none."""
        try:
            return turn_chart.chart(turn, self._quantity)
        except UNSOLVED:
            return None
