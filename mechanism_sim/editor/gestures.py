"""Gestures on a scene: a point is moved, a part is drawn, a part is removed."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

from mechanism_sim.documents import texts_of
from mechanism_sim.editor.rounding import degrees, place, rounded
from mechanism_sim.editor.sketch import (
    GONE,
    Edit,
    Grid,
    Handle,
    Pose,
    Poses,
    Sketch,
    drives_of,
    point,
)
from mechanism_sim.editor.tools import REFITS
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.scene.schema import Scene

_ON_AXIS = 0.02  # share of the frame's length: a joint so near its axis stays on it


class Moved(NamedTuple):
    """Edits made by moving a point, and the poses of links after it."""

    edits: list[Edit]
    poses: Poses


def move(
    scene: Scene, poses: Mapping[str, Pose], handle: Handle, to: Vector2, grid: Grid, short: bool
) -> Moved:
    """A handle moved: its links change their lengths, and all other joints stay where they are.

    Parameters
    ----------
    short : True for a four-bar in short form, whose lengths define the positions of joints
    """
    to = grid.snapped(to)
    found = dict(poses)
    edits: list[Edit] = []
    for link, name in handle.members:
        if link == GROUND:
            moved, to = _on_ground(scene, handle, name, to, grid, short)
            edits += moved
    for link, name in handle.members:
        if link != GROUND:
            edits += _on_link(scene, found, link, name, to, grid)
    _aim(scene, found)
    return Moved(edits if short else edits + _guesses(scene, poses, found), found)


def _aim(scene: Scene, poses: Poses) -> None:
    """Turn cylinders and rods that are pinned at their origins towards each other."""
    for joint in scene.joints.values():
        if joint.kind != 'prismatic':
            continue
        one, two = (point(scene, reference) for reference in joint.points)
        if one and two and GROUND not in (one[0], two[0]) and one[1] == two[1] == 'start':
            a, b = (poses[x[0]].place((0.0, 0.0)) for x in (one, two))
            if math.dist(a, b) > 0.0:
                angle = math.atan2(b[1] - a[1], b[0] - a[0]) - joint.axis
                poses[one[0]] = Pose(*a, angle)
                poses[two[0]] = Pose(*b, angle + joint.angle)


def _on_ground(
    scene: Scene, handle: Handle, name: str, to: Vector2, grid: Grid, short: bool
) -> tuple[list[Edit], Vector2]:
    given = scene.links.get(GROUND)
    if name == 'end' and given and given.length:
        if short or abs(to[1]) < _ON_AXIS * given.length:
            to = max(to[0], grid.step), 0.0
            return [Edit(('links', GROUND, 'length'), rounded(to[0], grid.step, grid.unit))], to
    elif name == 'start' and (short or to == (0.0, 0.0)):
        return [], (0.0, 0.0)
    if name not in ('start', 'end'):
        return [Edit(('links', GROUND, 'points', name), place(to, grid.step, grid.unit))], to
    # the origin and x axis of the frame are fixed: the joint gets a point of its own
    edits = [Edit(('links', GROUND, 'points', handle.key), place(to, grid.step, grid.unit))]
    joint = scene.joints[handle.key]
    references = [
        f'{GROUND}.{handle.key}' if (x := point(scene, r)) and x[:2] == (GROUND, name) else r
        for r in joint.points
    ]
    return [*edits, Edit(('joints', handle.key, joint.kind), references)], to


def _on_link(
    scene: Scene, poses: Poses, link: str, name: str, to: Vector2, grid: Grid
) -> list[Edit]:
    given, pose = scene.links[link], poses[link]
    if name not in ('start', 'end'):
        at = place(pose.within(to), grid.step, grid.unit)
        return [Edit(('links', link, 'points', name), at)]
    edits = []
    if name == 'start' and given.length is None:
        poses[link] = Pose(*to, pose.angle)
    else:
        ends = [pose.place((0.0, 0.0)), pose.place((given.length or 0.0, 0.0))]
        ends[name == 'end'] = to
        (x, y), (u, v) = ends
        length = max(math.dist(*ends), grid.step)
        poses[link] = Pose(x, y, math.atan2(v - y, u - x))
        edits.append(Edit(('links', link, 'length'), rounded(length, grid.step, grid.unit)))
    joined = _joined(scene, link)
    for other, place_of in given.points.items():
        if other in joined:  # its position is kept
            within = poses[link].within(pose.place(place_of))
            text = place(within, grid.step, grid.unit)
            edits.append(Edit(('links', link, 'points', other), text))
    return edits


def _joined(scene: Scene, link: str) -> set[str]:
    """Names of a link's points with joints."""
    found = (point(scene, reference) for j in scene.joints.values() for reference in j.points)
    return {x[1] for x in found if x and x[0] == link}


def _guesses(scene: Scene, before: Mapping[str, Pose], after: Mapping[str, Pose]) -> list[Edit]:
    """Approximate angles of rotated links, if the scene states them."""
    return [
        Edit(('guess', c), degrees(after[c].angle))
        for c, rough in scene.rough.items()
        if c in after and after[c].angle != before[c].angle and rough.unit != 'm'
    ]


def fitting(scene: Scene, poses: Poses, grid: Grid) -> list[Edit]:
    """Edits of joints whose parts must match after their links have been moved."""
    sketch, edits = None, []
    for name, joint in scene.joints.items():
        if refit := REFITS.get(joint.kind):
            sketch = sketch or Sketch(scene, poses, grid)
            edits += refit(sketch, name, joint)
    return edits


def starts(
    scene: Scene, found: Mapping[str, float], straight: Collection[str], grid: Grid
) -> list[Edit]:
    """Edits of the start positions of drives [rad, m] whose links were moved."""
    edits = []
    for c, (path, drive) in drives_of(scene).items():
        if c not in found:
            continue
        guess = scene.rough[c].value if c in scene.rough else 0.0
        if c in straight:
            old = guess if drive.start_position is None else drive.start_position
            if abs(found[c] - old) > 0.5 * grid.step:
                text = rounded(found[c], grid.step, grid.unit)
                edits.append(Edit((*path, 'start_position'), text))
        else:
            old = guess if drive.start_angle is None else drive.start_angle
            if abs(math.remainder(found[c] - old, 2.0 * math.pi)) > 1e-4:
                edits.append(Edit((*path, 'start_angle'), degrees(found[c], 2)))
    return edits


# --- removal ------------------------------------------------------------------------------------


def remove(scene: Scene, content: Mapping[str, Any], path: tuple[str, ...]) -> list[Edit]:
    """A part removed, with what cannot be without it: of gears what only they mesh for."""
    gone = [path]
    for lost in gone:  # the list grows meanwhile
        more = [part for part in _parts(scene, content) if _needs(scene, content, part, lost)]
        if lost[0] == 'joints' and len(lost) == 2 and scene.joints[lost[1]].kind == 'mesh':
            left = {
                gear
                for name, joint in scene.joints.items()
                if joint.kind == 'mesh' and ('joints', name) not in gone
                for gear in joint.points
            }
            more += [('gears', gear) for gear in scene.joints[lost[1]].points if gear not in left]
        gone += [part for part in more if part not in gone]
    edits = [Edit(part, GONE) for part in gone]
    if path[0] == 'links' and len(path) == 2:
        edits += [Edit((key, path[1]), GONE) for key in ('guess', 'drives')]
        edits += [Edit(('initial', key, path[1]), GONE) for key in ('position', 'velocity')]
        if scene.drive and (scene.drive.coordinate or 'crank') == path[1]:
            edits.append(Edit(('drive',), GONE))
    return edits


_NAMING = 'springs', 'masses', 'loads', 'sensors', 'gears', 'measures'
"""Sections of parts that name others, beside joints."""


def _parts(scene: Scene, content: Mapping[str, Any]) -> list[tuple[str, str]]:
    found = [('joints', name) for name in scene.joints]
    return found + [(key, str(name)) for key in _NAMING for name in content.get(key) or {}]


def _needs(
    scene: Scene, content: Mapping[str, Any], part: tuple[str, str], lost: tuple[str, ...]
) -> bool:
    """True if a part refers to a removed one: a link, a point of one, a joint or a gear."""
    section, name = part
    if section == 'joints':
        joint = scene.joints[name]
        texts = [*joint.points, str(getattr(joint, 'carrier', None) or '')]
        if (lost[0] == 'gears') != (joint.kind == 'mesh'):
            return False
    else:
        texts = [text for _, text in texts_of({name: content[section][name]}, ('kind',))]
    word = re.escape(lost[-1])
    if section == 'measures':
        pattern = rf'(?<!\w){word}(?!\w)'
    elif lost[0] == 'links' and len(lost) == 4:
        pattern = rf'^{re.escape(lost[1])}\.{word}$'
    elif lost[0] == 'links' and len(lost) == 2:
        pattern = rf'(?<![\w.]){word}(_rate)?(?!\w)'
    elif (lost[0], section) in (('joints', 'sensors'), ('gears', 'joints')):
        pattern = rf'^{word}$'
    else:
        return False
    return any(re.search(pattern, text) for text in texts)


def written_out(scene: Scene, content: Mapping[str, Any]) -> list[Edit]:
    """Edits that expand a four-bar in short form to its linkage."""
    if content.get('mechanism') != 'four_bar':
        return []
    edits = [Edit(('mechanism',), 'linkage')]
    edits += [Edit(('branch',), GONE)] if 'branch' in content else []
    for name, joint in scene.joints.items():
        edits.append(Edit(('joints', name, 'revolute'), list(joint.points)))
    for key, value in (('coordinate', 'crank'), ('start_angle', '0 deg')):
        if key not in content.get('drive', {}):
            edits.append(Edit(('drive', key), value))
    for link, angle in scene.rough.items():
        edits.append(Edit(('guess', link), degrees(angle.value)))
    return edits
