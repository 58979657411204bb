"""Random cams as scenes: they stand anywhere, turn either way, and lift in any direction."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from test.grid.case import Draft, Family, Random, Scene, rotate, variant
from test.grid.four_bars import LAWS, RESTITUTIONS, RIGID, decades, drive, pick

CURVES = (
    'cycloidal', 'harmonic', 'four_spline', 'modified_trapezoid', 'modified_sine',
    'polynomial_345', 'polynomial_4567', 'spline',
)  # fmt: skip
KINDS = {
    'knife': ('knife', False), 'roller': ('roller', False), 'flat': ('flat', False),
    'tilted': ('flat', False), 'swinging roller': ('roller', True),
    'swinging face': ('flat', True),
}  # fmt: skip
"""Followers: what touches the cam, and whether it swings."""
SPLINE = [[0, 0], [0.3, 0.2], [0.6, 0.75], [1, 1]]
# what the program is right to refuse
UNFIT = (
    'undercut', 'cusp', 'cut away', 'swings back faster', 'past the line of centres',
    'below the camshaft', 'does not reach the base circle', 'cut off',
)  # fmt: skip
UNFIT_SHAPES = 'too concave', 'does not reach', 'misses the profile', 'do not touch both'


def law(random: Random, lift: float) -> Scene:
    """Keys of a law: rises, dwells and returns of all curves, or points, round a whole turn."""
    first = float(random.uniform(0.0, 6.0))
    if random.random() < 0.2:
        count = int(random.integers(12, 40))
        x = np.arange(count) * 2.0 * math.pi / count
        k = int(random.integers(1, 3))
        y = lift * (0.5 - 0.5 * np.cos(k * x) + 0.05 * np.sin(x + 1.0))
        return {'points': [[float(a + 0.01), float(b)] for a, b in zip(x, y, strict=True)]}
    count = int(random.integers(2, 6))
    shares = random.uniform(0.5, 1.0, 2 * count)
    shares[1::2] *= random.random(count) < 0.5
    ends = first + 2.0 * math.pi * np.cumsum(shares) / shares.sum()
    starts = np.concatenate([[first], ends[:-1]])
    levels = np.append(random.uniform(0.0, lift, count), 0.0)
    levels[0] = levels[-1] = 0.0
    if count == 2:
        levels[1] = lift
    segments: list[Scene] = []
    for i, rise in enumerate(np.diff(levels).tolist()):
        part = {'from': float(starts[2 * i]), 'to': float(ends[2 * i]), 'rise': rise,
                'curve': str(random.choice(CURVES))}  # fmt: skip
        if part['curve'] == 'spline':
            part['points'] = SPLINE
        segments.append(part)
    return {'segments': segments}


def cam(
    random: Random, contact: Scene | None = None, kind: str | None = None, sense: int | None = None
) -> Scene:
    """A scene as a dictionary: a camshaft at constant speed and one follower.

    `contact` are keys of the joint such as `lift_off`; `kind`, of `KINDS`, and `sense`, 1 for
    counterclockwise and -1, are drawn if they are not given.
    """
    base = float(random.uniform(0.02, 0.04))
    centre, direction = random.uniform(-0.1, 0.1, 2), float(random.uniform(-3.0, 3.0))
    drawn = int(random.choice([1, -1]))
    sense = drawn if sense is None else sense
    groove = 'groove' in (contact or {})
    follower = 'roller' if groove else str(random.choice(['knife', 'roller', 'flat']))
    swings, own = random.random() < 0.5, random.uniform(-0.02, 0.02, 2)
    if kind is not None:
        follower, swings = KINDS[kind]
    joint: Scene = {
        'cam': ['shaft.axis', 'follower.tip'], 'follower': follower, 'base_radius': base,
        'phase': float(random.uniform(-4.0, 4.0)), **(contact or {}),
        'sense': 'counterclockwise' if sense == 1 else 'clockwise',
    }  # fmt: skip
    if follower == 'roller':
        joint['roller'] = float(random.uniform(0.005, 0.01))
    guess, axis = {}, random.uniform(-0.01, 0.01, 2).tolist()

    def world(x: float, y: float) -> NDArray[np.float64]:
        return rotate(direction, (x, -sense * y))

    if swings:
        side = int(random.choice([1, -1]))
        joint['side'] = 'left' if (side == 1) == (sense == 1) else 'right'
        reach = base + joint.get('roller', 0.0)
        a = float(random.uniform(2.5, 4.0)) * reach
        arm = math.sqrt(a * a - reach * reach) * float(random.uniform(0.95, 1.0))
        arm_angle = float(random.uniform(-3.0, 3.0))
        if follower == 'flat':
            joint['face'] = float(random.uniform(-0.3, 0.3)) * base
        joint['law'] = law(random, float(random.uniform(0.1, 0.3)))
        pivot = centre + world(a, 0.0)
        tip = own + rotate(arm_angle, (arm, 0.0))
        guide: Scene = {'revolute': ['ground.guide', 'follower.pin']}
        place = 0.9 * math.atan2(reach, a)
        guess['follower'] = float(
            math.remainder(-sense * side * place - arm_angle + direction + math.pi, 2.0 * math.pi)
        )
    else:
        if follower == 'flat':
            tilt, tilts = float(random.uniform(-0.3, 0.3)), random.random() < 0.5
            joint['tilt'] = tilt * (tilts if kind is None else kind == 'tilted')
        joint['law'] = law(random, 0.5 * base)
        beside = float(random.uniform(-0.4, 0.4)) * base
        turn = float(random.uniform(-3.0, 3.0))
        pivot, tip = centre + world(0.0, beside), own
        guide = {'prismatic': ['ground.guide', 'follower.pin'], 'axis': direction, 'angle': turn}
        guess['follower'] = 1.2 * base
    return {
        'title': 'by chance',
        'mechanism': 'linkage',
        'links': {
            'ground': {'points': {'axis': centre.tolist(), 'guide': pivot.tolist()}},
            'shaft': {'mass': 1.0, 'inertia': 1e-3, 'points': {'axis': axis}, 'cog': axis},
            'follower': {
                'points': {'pin': own.tolist(), 'tip': tip.tolist()},
                'mass': float(random.uniform(0.1, 0.5)), 'inertia': 2e-4,
                'cog': random.uniform(-0.03, 0.03, 2).tolist(),
            },
        },
        'joints': {'bearing': {'revolute': ['ground.axis', 'shaft.axis']}, 'guide': guide,
                   'contact': joint},
        'gravity': random.uniform(-10.0, 10.0, 2).tolist(),
        'drive': {'coordinate': 'shaft', 'speed': float(random.choice([1, -1]) * 20.0),
                  'start_angle': float(random.uniform(-3.0, 3.0))},
        'loads': {'push': {'at': 'follower.tip', 'force': random.uniform(-5.0, 5.0, 2).tolist()}},
        'guess': guess,
    }  # fmt: skip


def press_follower(scene: Scene, spring: float, damping: float = 0.0) -> Scene:
    """The scene with a force that presses the follower against its cam (N or N m, 1/place)."""
    scene = {**scene, 'loads': {**scene['loads']}}
    if 'revolute' in scene['joints']['guide']:
        joint = scene['joints']['contact']
        out = (1 if joint['side'] == 'left' else -1) * -1
        text = f'{out * -spring} - {damping}*follower_rate'
        scene['loads']['press'] = {'at': 'follower', 'torque': text}
    else:
        d = rotate(scene['joints']['guide']['axis'], (1.0, 0.0)).tolist()
        force = f'(-{spring} - {damping}*follower_rate)'
        scene['loads']['press'] = {
            'at': 'follower.pin', 'force': [f'{force}*{d[0]!r}', f'{force}*{d[1]!r}']
        }  # fmt: skip
    return scene


def driven(random: Random, scene: Scene, k: int) -> Draft:
    """The scene with its shaft at another speed, on a ramp, or moved by a torque."""
    factor = float(10.0 ** random.uniform(-1.0, 1.0))
    speed = scene['drive']['speed'] * factor
    way = ('constant', 'constant', 'ramp', 'torque')[k % 4]
    if way == 'torque':
        scene['drive'] |= {
            'speed': speed, 'flywheel': 0.01,
            'torque': {'constant': float(np.copysign(0.05, speed)), 'per_speed': -0.0005},
        }  # fmt: skip
    elif way == 'ramp':
        turn = 2.0 * math.pi / abs(speed)
        del scene['drive']['speed']
        scene['drive']['profile'] = {'points': [[0.0, 0.1 * speed], [turn, speed]]}
    else:
        scene['drive']['speed'] = speed
        return Draft(scene, revolutions=2.3)
    return Draft(scene, duration=4.0 * math.pi / abs(speed))


def _ideal(random: Random, k: int) -> Draft:
    return driven(random, cam(random), k)


def pressed(random: Random, scene: Scene) -> Scene:
    """The scene with a random force that presses the follower against its cam."""
    swings = 'revolute' in scene['joints']['guide']
    force = random.uniform(0.05, 2.0) if swings else random.uniform(2.0, 40.0)
    return press_follower(scene, float(force), float(pick(random, (0.0, 0.01 if swings else 1.0))))


def _lift_off(random: Random, k: int) -> Draft:
    keys = {'restitution': pick(random, RESTITUTIONS), 'hypothesis': pick(random, RIGID)}
    return driven(random, pressed(random, cam(random, {'lift_off': keys})), k)


def _soft_lift_off(random: Random, k: int) -> Draft:
    law = LAWS[k % 4]
    keys = {
        'restitution': float(random.uniform(0.1, 1.0)),
        'contact': {'law': law, 'stiffness': decades(random, 7.0, 9.5), 'exponent': 1.5},
    }
    return driven(random, pressed(random, cam(random, {'lift_off': keys})), 0)


def _groove(random: Random, k: int) -> Draft:
    keys = {'clearance': decades(random, -6.0, -3.3), 'restitution': pick(random, RESTITUTIONS)}
    if k % 4 == 3:
        keys['contact'] = {'law': LAWS[k // 4 % 4], 'stiffness': decades(random, 7.0, 9.0)}
        keys['restitution'] = max(keys['restitution'], 0.1)
    return driven(random, cam(random, {'groove': keys}), 0 if k % 4 == 3 else k)


def _valve(random: Random, k: int) -> Draft:
    """The package's valve from far below its lift-off to three times that speed, and both ways."""
    keys, extent = drive(random, ('constant', 'constant', 'ramp', 'smooth')[k % 4], (1.5, 3.0))
    return Draft(
        variant('valve_train', {
            'drive': {'coordinate': 'camshaft', **keys},
            'joints.contact.lift_off': {'restitution': pick(random, RESTITUTIONS)},
            'joints.contact.law.segments': [
                {'from': 0.0, 'to': 1.5, 'rise': 0.006, 'curve': CURVES[k % 7]},
                {'from': float(random.uniform(1.5, 2.5)), 'to': 4.2, 'rise': -0.006,
                 'curve': CURVES[(k + 3) % 7]},
            ],
            'joints.contact.base_radius': 0.05, 'springs.spring.free_length': 0.15,
            'springs.spring.stiffness': f'{decades(random, 3.0, 4.5)} N/m',
            'links.ground.points.seat': [0.0, 0.2],
        }),
        **extent,
    )  # fmt: skip


def _shape_law(random: Random, k: int, joint: Scene, swings: bool) -> Scene:
    """A law by the shape of its cam, by conditions, or by a long table."""
    base, face = joint['base_radius'], joint['follower'] == 'flat'
    nose = {'nose': base * float(random.uniform(0.3, 0.7)),
            'lift': base * float(random.uniform(0.1, 0.4)),
            'at': float(random.uniform(-3.0, 3.0))}  # fmt: skip
    if k % 8 == 0 and not face:
        return {'tangent': nose}
    if k % 8 < 3:
        hollow = k % 8 == 2 and joint['follower'] == 'roller'
        flank = -decades(random, 0.5, 2.0) if hollow else decades(random, 0.6, 2.0)
        return {'arcs': nose | {'flank': flank * base}}
    off = base * random.uniform(-0.2, 0.2, 2)
    if k % 8 == 3:
        del joint['base_radius']
        return {'profile': {'edges': [{'arc': off.tolist(), 'radius': 1.2 * base}]}}
    count = int(random.integers(90, 360))
    x = 2.0 * math.pi * np.arange(count) / count
    wave = np.sin(x) + 0.1 * np.sin(2.0 * x + 1.0)
    if k % 8 == 4:
        del joint['base_radius']
        return {'profile': {'points': [*zip(x.tolist(), (base + 0.15 * base * wave).tolist(),
                                            strict=True)]}}  # fmt: skip
    lift = float(random.uniform(0.1, 0.2)) if swings else 0.3 * base
    if k % 8 == 5:
        rest = {'velocity': 0.0, 'acceleration': 0.0}
        ends = [{'at': 0.0, **rest}, {'at': 3.0, **rest}, {'at': 1.6, 'lift': 0.5 * lift}]
        return {'segments': [
            {'from': 0.0, 'to': 3.0, 'rise': lift, 'curve': 'polynomial', 'conditions': ends},
            {'from': 3.2, 'to': 6.0, 'rise': -lift, 'curve': 'constant_acceleration'},
        ]}  # fmt: skip
    law: Scene = {'degree': int(pick(random, (3, 5, 7)))}
    noise = 1e-4 * lift * (k % 8 == 7)
    if noise:
        law['error'] = noise
    y = 0.5 * lift * wave + random.normal(0.0, noise, count)
    return law | {'points': [*zip(x.tolist(), y.tolist(), strict=True)]}


def _shape(random: Random, k: int) -> Draft:
    keys = {'lift_off': {'restitution': pick(random, RESTITUTIONS)}} if k % 3 == 2 else {}
    scene = cam(random, keys)
    joint = scene['joints']['contact']
    joint['law'] = _shape_law(random, k, joint, 'revolute' in scene['joints']['guide'])
    return driven(random, pressed(random, scene) if keys else scene, k // 8)


FAMILIES = (
    Family('cam_shapes', 60, _shape, (*UNFIT, *UNFIT_SHAPES)),
    Family('cam', 32, _ideal, UNFIT),
    Family('cam_lift_off', 48, _lift_off, UNFIT),
    Family('cam_valve', 40, _valve, UNFIT, 4),
    Family('cam_groove', 32, _groove, UNFIT),
    Family('cam_compliant', 16, _soft_lift_off, UNFIT),
)
