"""Edits by which a machine is assembled as it was drawn: guesses, or the other branch."""

from __future__ import annotations

import numpy as np

from mechanism_sim.editor.document import Document
from mechanism_sim.editor.layout import placed
from mechanism_sim.editor.motion import Turn
from mechanism_sim.editor.picture import DocumentPicture, pictured
from mechanism_sim.editor.rounding import degrees
from mechanism_sim.editor.sketch import GONE, Edit, Poses
from mechanism_sim.errors import InputError
from mechanism_sim.scene import Machine

_FAR = 0.2  # [rad], or sizes of the machine: more is another way to close the loops


def choices(document: Document, edits: list[Edit], picture: DocumentPicture) -> list[Edit]:
    """Guesses, or the other branch, if the scene alone would be assembled differently."""
    if picture.turn is None:
        return []
    scene = document.scene(edits)
    try:
        turn = Turn(Machine(document.name, scene))
    except InputError:
        turn = None
    tree = picture.turn.mechanism
    slides = [c in tree.displacements for c in tree.coordinates]
    if turn is not None:
        off = turn.q[:, 0] - picture.turn.q[:, 0]
        turned = np.remainder(off + np.pi, 2.0 * np.pi) - np.pi
        off = np.where(slides, off / picture.turn.scale, turned)
        if np.abs(off).max(initial=0.0) < _FAR:
            return []
    content = document.whole(edits)  # which may have written a four-bar out
    if content.get('mechanism') == 'four_bar':
        crossed = content.get('branch') != 'crossed'
        return [Edit(('branch',), 'crossed' if crossed else GONE)]
    q = dict(zip(tree.coordinates, picture.turn.q[:, 0].tolist(), strict=True))
    return [
        Edit(('guess', c), f'{x:.3g} m' if c in tree.displacements else degrees(x))
        for c, x in q.items()
        if c in picture.scene.links and c not in picture.turn.machine.plan.laws
    ]


def as_drawn(
    document: Document, edits: list[Edit], picture: DocumentPicture, poses: Poses
) -> list[Edit]:
    """Guesses, if the scene would be assembled differently from the drawing."""
    try:
        scene = document.scene(edits)
        seen = pictured(document.name, scene, picture, placed(scene, poses))
        return choices(document, edits, seen)
    except InputError:
        return []  # not yet a machine
