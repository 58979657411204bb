"""Random mechanisms: links anywhere, joints where the links happen to be.

Every link gets a pose; joints are put between them there, so that whatever is tied together can be
assembled, and the poses are the guess. No dimension is special.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.errors import InputError
from mechanism_sim.planar.mechanism import Prismatic
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene import schema
from mechanism_sim.scene.plan import ScenePlan
from test.grid.case import Draft, Family, Random, Scene, rotate
from test.grid.four_bars import NOT_SEATED, clearance
from test.grid.machines import rub

SPAN = 0.3  # [s] of a run
REFUSED = 'too many', 'cannot move', 'follow from the others', 'cannot follow its drive'

Poses = dict[str, NDArray[np.float64]]
"""Place and angle (x, y, angle) of every link."""

FORMULAS = (
    '2*sin(7*t)', '-0.5*vx', '-0.5*vy - 0.1*vy**3', '1 - 3*x', '0.3/(1 + y*y)', 'exp(-x)',
    '-0.2*{c}_rate', 'cos({c})', 'tanh(3*{d}_rate)', '0.5*{d}',
)  # fmt: skip


def linkage(random: Random, size: float = 1.0) -> tuple[Scene, Poses, int]:
    """A scene as a dictionary without drives, and the poses (x, y, angle) of its links.

    Parameters
    ----------
    random : generator
    size : [m] of the links
    """
    count = int(random.integers(2, 7))
    poses = {GROUND: np.zeros(3)}
    links: Scene = {GROUND: {'points': {}}}
    for i in range(count):
        poses[f'l{i}'] = np.array([*random.uniform(-size, size, 2), random.uniform(-3.0, 3.0)])
        inertia = float(random.uniform(0.02, 0.3)) * size**2
        links[f'l{i}'] = {
            'points': {},
            'mass': float(random.uniform(0.5, 3.0)),
            'inertia': inertia,
            'cog': random.uniform(-0.5 * size, 0.5 * size, 2).tolist(),
        }
    joints: Scene = {}

    def point(link: str, world: NDArray[np.float64]) -> str:
        x, y, angle = poses[link]
        points = links[link]['points']
        points[f'p{len(points)}'] = rotate(-angle, world - np.array([x, y])).tolist()
        return f'{link}.p{len(points) - 1}'

    def tie(a: str, b: str, kind: str) -> None:
        at = 0.5 * (poses[a][:2] + poses[b][:2]) + random.uniform(-0.7 * size, 0.7 * size, 2)
        along = float(random.uniform(-3.0, 3.0))
        shift = size * random.uniform(-1.0, 1.0) * np.array([np.cos(along), np.sin(along)])
        if kind == 'revolute':
            joints[f'j{len(joints)}'] = {kind: [point(a, at), point(b, at)]}
        elif kind == 'prismatic':
            joints[f'j{len(joints)}'] = {
                kind: [point(a, at), point(b, at + shift)],
                'axis': along - poses[a][2],
                'angle': poses[b][2] - poses[a][2],
            }
        else:
            joints[f'j{len(joints)}'] = {
                kind: [point(a, at), point(b, at + shift)],
                'axis': along - poses[b][2],
            }

    kinds, shares = ['revolute', 'prismatic'], [0.7, 0.3]
    names = list(links)
    for i in range(1, len(names)):
        # sooner to a link than to the ground: longer loops
        ends = [names[int(random.integers(0, i))], names[i]]
        random.shuffle(ends)
        tie(ends[0], ends[1], str(random.choice(kinds, p=shares)))
    freedom = count
    while freedom > 1 and random.random() < 0.8:
        kind = random.choice(['slot', *kinds], p=[0.3, 0.5, 0.2])
        if kind != 'slot' and freedom == 2:
            kind = 'slot'
        pair = [str(x) for x in random.choice(names, 2, replace=False)]
        if any({p.split('.')[0] for p in j[next(iter(j))]} == {*pair} for j in joints.values()):
            if random.random() < 0.3:
                break
            continue
        tie(pair[0], pair[1], str(kind))
        freedom -= 1 if kind == 'slot' else 2
    scene: Scene = {
        'title': 'by chance',
        'mechanism': 'linkage',
        'links': links,
        'joints': joints,
        'gravity': random.uniform(-10.0, 10.0, 2).tolist(),
        'springs': {},
        'loads': {},
    }
    if random.random() < 0.5:
        a, b = (str(x) for x in random.choice(names, 2, replace=False))
        ends = [point(x, random.uniform(-size, size, 2)) for x in (a, b)]
        scene['springs']['straight'] = {
            'between': ends,
            'stiffness': f'{random.uniform(1.0, 50.0) / size} N/m',
            'damping': f'{random.uniform(0.0, 2.0)} N s/m',
            'free_length': float(random.uniform(0.0, size)),
        }
    if random.random() < 0.5:
        a, b = (str(x) for x in random.choice(names, 2, replace=False))
        scene['springs']['torsional'] = {
            'between': [a, b],
            'stiffness': f'{random.uniform(0.1, 5.0) * size} N m/rad',
            'damping': f'{random.uniform(0.0, 0.5) * size} N m s/rad',
            'free_angle': float(random.uniform(-3.0, 3.0)),
        }
    for k in range(int(random.integers(0, 3))):
        link = str(random.choice(names[1:]))

        def formula() -> str:
            c, d = random.choice(names[1:], 2)
            return str(random.choice(FORMULAS)).format(c=c, d=d)

        scene['loads'][f'load{k}'] = {
            'at': point(link, poses[link][:2] + random.uniform(-0.5 * size, 0.5 * size, 2)),
            'force': [formula(), float(random.uniform(-2.0, 2.0))],
            'torque': formula(),
            'frame': str(random.choice(['world', 'link'])),
        }
    return scene, poses, freedom


def add_gears(
    random: Random, scene: Scene, poses: Poses, freedom: int
) -> tuple[Scene, Poses, int]:
    """Scene with gears, or a gear and a rack, on links that have a common carrier."""
    sliding: list[Any] = []
    turning: list[Any] = []
    for joint in scene['joints'].values():
        kind, (one, other) = next(iter(joint.items()))
        for carrier, moved in ((one, other), (other, one)):
            ends = carrier.split('.')[0], moved
            if kind == 'revolute':
                turning.append(ends)
            elif kind == 'prismatic' and carrier == one:
                sliding.append((*ends, joint['axis']))
    gears: Scene = {}

    def world(reference: str) -> NDArray[np.float64]:
        link, name = reference.split('.')
        return poses[link][:2] + rotate(poses[link][2], scene['links'][link]['points'][name])

    pairs = [
        (a, b) for i, a in enumerate(turning) for b in (*turning[i + 1 :], *sliding)
        if a[0] == b[0] and len({a[0], *(x[1].split('.')[0] for x in (a, b))}) == 3
    ]  # fmt: skip
    joints = dict(scene['joints'])
    for i in random.permutation(len(pairs)):
        if freedom < 2:
            break
        (carrier, one), (_, other, *axis) = pairs[i]
        away = world(other) - world(one)
        if axis:
            along = poses[carrier][2] + axis[0]
            distance = abs(away @ [-np.sin(along), np.cos(along)])
        else:
            distance = float(np.hypot(*away))
        n = [int(x) for x in random.integers(18, 80, 2)]
        module = 2.0 * distance / (n[0] + (0 if axis else n[1]))
        second = {'rack': True} if axis else {'teeth': n[1]}
        gears[f'a{i}'] = {'at': one, 'teeth': n[0], 'module': module}
        gears[f'b{i}'] = {'at': other, 'module': module, **second}
        joints[f'm{i}'] = {'mesh': [f'a{i}', f'b{i}']}
        freedom -= 1
    return {**scene, 'joints': joints, 'gears': gears}, poses, freedom


def add_drives(random: Random, scene: Scene, poses: Poses, freedom: int) -> Scene:
    """Scene with drives: as many prescribed ones as there are freedoms, or fewer.

    Others are moved by a torque or a force, or by nothing.
    """
    names = [link for link in scene['links'] if link != GROUND]
    values = _coordinates(scene, poses)
    prescribed = freedom if random.random() < 0.5 else int(random.integers(0, freedom))
    chosen = [str(x) for x in random.permutation(names)[: max(prescribed, 1)]]
    drives: Scene = {}
    for k, c in enumerate(chosen):
        straight = values[c][1]
        rate = float(random.uniform(-2.0, 2.0))
        drive: Scene = {'speed': f'{rate} m/s' if straight else f'{rate} rad/s'}
        if k >= prescribed:
            drive['force' if straight else 'torque'] = {
                'constant': float(random.uniform(-1.0, 1.0)),
                'per_position' if straight else 'per_angle': float(random.uniform(-1.0, 0.0)),
                'per_speed': float(random.uniform(-1.0, 0.0)),
            }
        drives[c] = drive
    try:
        values = _coordinates({**scene, 'drives': drives}, poses)
    except InputError:  # driven so, links hang on other joints, and turn instead of sliding
        drives = {}
    scene, guess = {**scene, 'drives': drives}, {}
    for c, (value, straight) in values.items():
        guess[c] = f'{value} m' if straight else f'{value} rad'
        if c in drives:
            drives[c]['start_position' if straight else 'start_angle'] = value
    return {**scene, 'guess': guess}


def _coordinates(scene: Scene, poses: Poses) -> dict[str, tuple[float, bool]]:
    """The coordinates of the tree that the program finds, at the poses; which are straight."""
    tree = ScenePlan(schema.Scene.model_validate(scene)).ideal
    found = {}
    for c in tree.coordinates:
        j = tree.tree_joints[c]
        if not isinstance(j, Prismatic):
            found[c] = float(poses[c][2]), False
            continue
        places = [poses[link][:2] + rotate(poses[link][2], at) for link, at in j.points]
        way = rotate(poses[j.first][2] + j.axis, (1.0, 0.0))
        found[c] = float((places[1] - places[0]) @ way), True
    return found


def _prescribed_or_free(random: Random, k: int) -> Draft:
    scene, poses, freedom = linkage(
        random, size=1.0 if k % 3 else float(10.0 ** random.uniform(-2.0, 1.0))
    )
    return _draft(add_drives(random, scene, poses, freedom))


def _draft_geared(random: Random, _k: int) -> Draft:
    return _draft(add_drives(random, *add_gears(random, *linkage(random))))


def _loose(random: Random, k: int) -> Draft:
    scene = add_drives(random, *linkage(random))
    pins = [n for n, j in scene['joints'].items() if 'revolute' in j]
    if pins:
        chosen = [str(n) for n in random.permutation(pins)[: 1 if k % 2 else 2]]
        for n in chosen:
            scene['joints'][n] = {
                **scene['joints'][n],
                'clearance': clearance(random, friction=k % 4 == 3, finest=-5.0),
            }
    scene['start'] = 'seated' if k % 3 else 'centred'
    return _draft(scene)


def _rubbing(random: Random, _k: int) -> Draft:
    scene = add_drives(random, *linkage(random))
    rub(random, scene, 0.05)
    return _draft(scene)


def _draft(scene: Scene) -> Draft:
    """So that `check` looks whether the drives can go on for as long as the run."""
    return Draft({**scene, 'duration': SPAN}, duration=SPAN)


def _arcs(random: Random, k: int) -> Draft:
    """Linkages whose slots are arcs."""
    scene, poses, freedom = linkage(random)
    for joint in scene['joints'].values():
        if 'slot' not in joint:
            continue
        ends = joint.pop('slot')
        del joint['axis']
        pin, centre = (
            poses[link][:2] + rotate(poses[link][2], scene['links'][link]['points'][at])
            for link, at in (end.split('.') for end in ends)
        )
        joint |= {'arc_slot': ends, 'radius': float(np.hypot(*(pin - centre)))}
        if k % 3 == 2:
            joint['friction'] = {'coefficient': 0.05}
    return _draft(add_drives(random, scene, poses, freedom))


FAMILIES = (
    Family('linkage', 48, _prescribed_or_free, REFUSED),
    Family('linkage_gears', 24, _draft_geared, REFUSED),
    Family('linkage_rubbing', 36, _rubbing, REFUSED),
    Family('linkage_arcs', 24, _arcs, REFUSED),
    Family('linkage_loose', 36, _loose, (*REFUSED, *NOT_SEATED)),
)
