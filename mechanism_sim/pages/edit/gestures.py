"""What gestures make of a scene: a point is moved, a part is drawn, a part is removed."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

from mechanism_sim.errors import InputError
from mechanism_sim.pages.edit.document import GONE, Edit
from mechanism_sim.pages.edit.drawing import Handle
from mechanism_sim.pages.edit.layout import Pose, Poses, point, points_of
from mechanism_sim.pages.edit.quantities import degrees, place, rounded
from mechanism_sim.planar.mechanism import GROUND, Vector2, rotate
from mechanism_sim.scene.schema import DrivePart, Scene

_ON_AXIS = 0.02
"""Of the frame's length: a joint so near its axis stays on it."""

BAR = 1.0
"""[kg/m] of links that are given a mass by their length."""


class Grid(NamedTuple):
    """How fine things are placed: a step [m] and the unit in which lengths are written."""

    step: float
    unit: str

    def snapped(self, at: Vector2) -> Vector2:
        """The nearest point of the grid."""
        x, y = (round(v / self.step) * self.step for v in at)
        return x, y


class Spot(NamedTuple):
    """Where a gesture begins or ends: in the world, and on what."""

    at: Vector2
    handle: Handle | None = None
    link: str = ''  #: under the pointer, where there is no handle


class Moved(NamedTuple):
    """A point that was moved: what it changes, and where links lie then."""

    edits: list[Edit]
    poses: Poses


def move(
    scene: Scene, poses: Mapping[str, Pose], handle: Handle, to: Vector2, grid: Grid, short: bool
) -> Moved:
    """A handle moved: its links change their lengths, and all other joints stay where they are.

    Parameters
    ----------
    short : whether the scene is a four-bar in short, whose joints lie where its lengths put them
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
    # the origin and the x axis of the frame lie fast: the joint gets a point of its own
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
        if other in joined:  # it stays where it is
            within = poses[link].within(pose.place(place_of))
            text = place(within, grid.step, grid.unit)
            edits.append(Edit(('links', link, 'points', other), text))
    return edits


def _joined(scene: Scene, link: str) -> set[str]:
    """Names of a link's points at which there are joints."""
    found = (point(scene, reference) for j in scene.joints.values() for reference in j.points)
    return {x[1] for x in found if x and x[0] == link}


def _guesses(scene: Scene, before: Mapping[str, Pose], after: Mapping[str, Pose]) -> list[Edit]:
    """Rough angles of links that turned, where a scene has them."""
    return [
        Edit(('guess', c), degrees(after[c].angle))
        for c, rough in scene.guess.items()
        if c in after and after[c].angle != before[c].angle and rough.unit != 'm'
    ]


def starts(
    scene: Scene, found: Mapping[str, float], straight: Collection[str], grid: Grid
) -> list[Edit]:
    """Where drives begin, if that is not where their links are found to lie [rad, m]."""
    drives: dict[str, tuple[tuple[str, ...], DrivePart]] = {
        c: (('drives', c), drive) for c, drive in scene.drives.items()
    }
    if scene.drive:
        drives[scene.drive.coordinate or 'crank'] = (('drive',), scene.drive)
    edits = []
    for c, (path, drive) in drives.items():
        if c not in found:
            continue
        guess = scene.guess[c].value if c in scene.guess else 0.0
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


# --- what is drawn ------------------------------------------------------------------------------


def draw(scene: Scene, poses: Poses, what: str, start: Spot, end: Spot, grid: Grid) -> list[Edit]:
    """A part drawn from one place to another.

    Raises
    ------
    InputError
        If it cannot be there: what it needs.
    """
    makers: dict[str, Callable[[_Draft, Spot, Spot], list[Edit]]] = {
        'link': _link, 'cylinder': _cylinder, 'spring': _spring, 'ground': _ground,
        'point': _point, 'slider': _slider, 'drive': _drive, 'clearance': _clearance,
        'masses': _masses,
    }  # fmt: skip
    if what not in makers:
        raise InputError(f"there is no '{what}' to be drawn")
    return makers[what](_Draft(scene, dict(poses), grid), start, end)


class _Draft:
    """A scene to which parts are added."""

    def __init__(self, scene: Scene, poses: Poses, grid: Grid) -> None:
        self.scene, self.poses, self.grid = scene, poses, grid
        self._taken = {*scene.links, *scene.joints, *scene.springs}
        self._points: dict[str, set[str]] = {}

    def name(self, stem: str, plain: bool = False) -> str:
        """A name that is free: the stem, or with the first number that is."""
        k = 0 if plain else 1
        while (found := f'{stem}_{k}' if k else stem) in self._taken:
            k += 1
        self._taken.add(found)
        return found

    def where(self, spot: Spot) -> Vector2:
        """A place: of the handle, or on the grid."""
        return spot.handle.at if spot.handle else self.grid.snapped(spot.at)

    def reference(self, spot: Spot) -> tuple[str, list[Edit]]:
        """LINK.POINT of a place on a link or on the ground, and the point if it is new."""
        if spot.handle:
            link, name = spot.handle.members[-1]
            return f'{link}.{name}' if name != 'start' or link == GROUND else link, []
        link, at = spot.link or GROUND, self.where(spot)
        known = points_of(self.scene.links.get(link)).keys() | self._points.setdefault(link, set())
        k = 1
        while (name := f'p{k}') in known:
            k += 1
        self._points[link].add(name)
        local = place(self.poses[link].within(at), self.grid.step, self.grid.unit)
        return f'{link}.{name}', [Edit(('links', link, 'points', name), local)]

    def joint(self, reference: str, link: str) -> list[Edit]:
        """A pin between a point and a link that is drawn to it."""
        name = self.name(f'{reference.partition(".")[0]}_{link.partition(".")[0]}', plain=True)
        return [Edit(('joints', name), {'revolute': [reference, link]})]


def _link(draft: _Draft, start: Spot, end: Spot) -> list[Edit]:
    """A bar, with a pin where it begins or ends on another link or on a point of the ground."""
    a, b = draft.where(start), draft.where(end)
    if math.dist(a, b) < draft.grid.step:
        raise InputError('a link is drawn from one point to another: press, and drag')
    name, grid = draft.name('link'), draft.grid
    length = rounded(math.dist(a, b), grid.step, grid.unit)
    edits = [
        Edit(('links', name), {'length': length}),
        Edit(('guess', name), degrees(math.atan2(b[1] - a[1], b[0] - a[0]))),
    ]
    for spot, own in ((start, name), (end, f'{name}.end')):
        if spot.handle or spot.link:
            reference, more = draft.reference(spot)
            edits += [*more, *draft.joint(reference, own)]
    return edits


def _cylinder(draft: _Draft, start: Spot, end: Spot) -> list[Edit]:
    """A cylinder with its rod, pinned at both ends; the rod is driven."""
    a, b = draft.where(start), draft.where(end)
    if math.dist(a, b) < draft.grid.step:
        raise InputError('a cylinder is drawn from one point to another: press, and drag')
    k, grid = 1, draft.grid
    while f'cylinder_{k}' in draft.scene.links or f'rod_{k}' in draft.scene.links:
        k += 1
    body, rod = f'cylinder_{k}', f'rod_{k}'
    edits = [Edit(('links', body), {}), Edit(('links', rod), {})]
    for spot, link in ((start, body), (end, rod)):
        reference, more = draft.reference(spot)
        edits += [*more, *draft.joint(reference, link)]
    edits.insert(-1, Edit(('joints', f'{body}_{rod}', 'prismatic'), [body, rod]))
    long = math.dist(a, b)
    drive = {
        'speed': rounded(0.1 * long, 10.0 ** math.floor(math.log10(0.1 * long)), 'mm/s', 'm/s'),
        'start_position': rounded(long, grid.step, grid.unit),
    }
    edits.append(Edit(('guess', body), degrees(math.atan2(b[1] - a[1], b[0] - a[0]))))
    edits.append(Edit(('drives', rod), drive))
    if draft.scene.duration is None:
        edits.append(Edit(('duration',), '1 s'))
    return edits


def _spring(draft: _Draft, start: Spot, end: Spot) -> list[Edit]:
    """A spring between two points, relaxed where it is drawn."""
    (one, new), (two, newer) = draft.reference(start), draft.reference(end)
    if one.partition('.')[0] == two.partition('.')[0]:
        raise InputError('a spring is between points of two links, or of a link and the ground')
    free = rounded(
        math.dist(draft.where(start), draft.where(end)), draft.grid.step, draft.grid.unit
    )
    values = {'between': [one, two], 'stiffness': '1000 N/m', 'free_length': free}
    return [*new, *newer, Edit(('springs', draft.name('spring')), values)]


def _ground(draft: _Draft, start: Spot, _end: Spot) -> list[Edit]:
    """A point of the frame: with a pin where there is a point of a link."""
    if start.handle and any(link == GROUND for link, _ in start.handle.members):
        raise InputError(f'{start.handle.key} is on the ground already')
    reference, edits = draft.reference(Spot(draft.where(start)))
    if start.handle:
        link, name = start.handle.members[0]
        own = link if name == 'start' else f'{link}.{name}'
        edits += draft.joint(reference, own)
    return edits


def _point(draft: _Draft, start: Spot, _end: Spot) -> list[Edit]:
    """A point of a link, whose path is drawn."""
    if start.handle or not start.link:
        raise InputError('a point is put on a link: press on a bar')
    return draft.reference(start)[1]


def _slider(draft: _Draft, start: Spot, end: Spot) -> list[Edit]:
    """A block on a rail of the frame, pinned to a point of a link; drawn along the rail."""
    if start.handle is None or start.handle.joint:
        raise InputError('a slider is put on the free end of a link: press there, drag its way')
    at, (u, v) = draft.where(start), end.at
    axis = math.atan2(v - at[1], u - at[0]) if math.dist(at, end.at) > draft.grid.step else 0.0
    axis = math.radians(round(math.degrees(axis)))
    block = draft.name('slider')
    # the rail passes through the origin if that lies on it
    way = rotate((1.0, 0.0), axis)
    edits: list[Edit] = []
    if abs(way[0] * at[1] - way[1] * at[0]) < 0.5 * draft.grid.step:
        base, along = GROUND, at[0] * way[0] + at[1] * way[1]
    else:
        base, edits = draft.reference(Spot(at))
        along = 0.0
    link, name = start.handle.members[0]
    own = link if name == 'start' else f'{link}.{name}'
    turned = {'axis': f'{math.degrees(axis):g} deg'} if axis else {}
    return [
        Edit(('links', block), {}),
        *edits,
        *draft.joint(own, block),
        Edit(('joints', f'{GROUND}_{block}'), {'prismatic': [base, block], **turned}),
        Edit(('guess', block), rounded(along, draft.grid.step, draft.grid.unit)),
    ]


def _drive(draft: _Draft, start: Spot, _: Spot) -> list[Edit]:
    """What turns at a constant speed: the link on which it is put."""
    scene, link = draft.scene, start.link
    if not link and start.handle:
        link = next((x for x, _ in start.handle.members if x != GROUND), '')
    if not link or link == GROUND:
        raise InputError('a drive is put on a link that turns or slides: press on it')
    if link in scene.drives or (scene.drive and (scene.drive.coordinate or 'crank') == link):
        raise InputError(f'{link} is driven already')
    slides = any(
        j.kind == 'prismatic' and (x := point(scene, j.points[1])) and x[0] == link
        for j in scene.joints.values()
    )
    speed = {'speed': '100 mm/s' if slides else '60 rpm'}
    start_value = scene.guess.get(link)
    if not slides:
        angle = start_value.value if start_value else draft.poses[link].angle
        speed['start_angle'] = degrees(angle)
    edits = [Edit(('guess', link), GONE)] if start_value and not slides else []
    if scene.drive or scene.drives:
        return [*edits, Edit(('drives', link), speed)]
    return [*edits, Edit(('drive',), {'coordinate': link, **speed})]


def _clearance(draft: _Draft, start: Spot, _: Spot) -> list[Edit]:
    """Play in a pin; links without mass get one, for a pin that flies needs it."""
    if start.handle is None or not start.handle.joint:
        raise InputError('clearance is put on a joint: press on a pin')
    if draft.scene.joints[start.handle.key].clearance:
        raise InputError(f'{start.handle.key} has a clearance already')
    play = {'radial': '0.1 mm', 'restitution': 0.5}
    return [Edit(('joints', start.handle.key, 'clearance'), play), *_masses(draft, start, start)]


def _masses(draft: _Draft, *_: Spot) -> list[Edit]:
    """Masses of slender bars of 1 kg/m for all links without; of others 1 kg."""
    edits = []
    for link, given in draft.scene.links.items():
        if link == GROUND or given.mass is not None or given.elastic:
            continue
        long = given.length or 0.0
        mass = BAR * long if long else 1.0
        values: dict[str, Any] = {'mass': f'{mass:.3g} kg'}
        values['inertia'] = f'{mass * long**2 / 12.0 or 0.001:.3g} kg m^2'
        if long:
            values['cog'] = rounded(0.5 * long, 0.1 * draft.grid.step, draft.grid.unit)
        edits += [Edit(('links', link, key), value) for key, value in values.items()]
    return edits


# --- what is removed ----------------------------------------------------------------------------


def remove(scene: Scene, path: tuple[str, ...]) -> list[Edit]:
    """A part removed, with what cannot be without it."""
    edits = [Edit(path, GONE)]
    if path[0] != 'links' or len(path) not in (2, 4):
        return edits
    link, lost = path[1], path[3] if len(path) == 4 else None

    def gone(reference: str) -> bool:
        on, _, name = reference.partition('.')
        return on == link and (lost is None or name == lost)

    for name, joint in scene.joints.items():
        if any(map(gone, joint.points)):
            edits.append(Edit(('joints', name), GONE))
    for section in ('springs', 'masses', 'sensors', 'loads', 'gears'):
        for name, part in getattr(scene, section, {}).items():
            named = [getattr(part, key, None) for key in ('at', 'link', 'on')]
            named += list(getattr(part, 'between', ()))
            if any(isinstance(x, str) and gone(x) for x in named):
                edits.append(Edit((section, name), GONE))
    if lost is None:
        edits += [Edit((key, link), GONE) for key in ('guess', 'drives')]
        if scene.drive and (scene.drive.coordinate or 'crank') == link:
            edits.append(Edit(('drive',), GONE))
    return edits
