"""Cams and gear trains made by chance, as scenes, and what a cam's follower asks for.

Cams stand anywhere, turn either way, and lift in any direction; trains have any numbers of teeth.
"""

from __future__ import annotations

import math

import numpy as np
from absolute import cross, turned

from mechanism_sim.cams.followers import Oscillating, OscillatingFlat
from mechanism_sim.cams.pair import CamPair

CURVES = (
    'cycloidal', 'harmonic', 'four_spline', 'modified_trapezoid', 'modified_sine',
    'polynomial_345', 'polynomial_4567', 'spline',
)  # fmt: skip
SPLINE = [[0, 0], [0.3, 0.2], [0.6, 0.75], [1, 1]]
# what the program is right to refuse
UNFIT = (
    'undercut', 'cusp', 'cut away', 'swings back faster', 'past the line of centres',
    'below the camshaft', 'does not reach the base circle', 'cut off',
)  # fmt: skip


def law(random, lift):
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
    segments = []
    for i, rise in enumerate(np.diff(levels).tolist()):
        part = {'from': float(starts[2 * i]), 'to': float(ends[2 * i]), 'rise': rise,
                'curve': str(random.choice(CURVES))}  # fmt: skip
        if part['curve'] == 'spline':
            part['points'] = SPLINE
        segments.append(part)
    return {'segments': segments}


def cam(random, contact=None):
    """A scene as a dictionary: a camshaft at constant speed and one follower.

    `contact` are keys of the joint such as `lift_off`.
    """
    base = float(random.uniform(0.02, 0.04))
    centre, direction = random.uniform(-0.1, 0.1, 2), float(random.uniform(-3.0, 3.0))
    sense = int(random.choice([1, -1]))
    groove = 'groove' in (contact or {})
    kind = 'roller' if groove else str(random.choice(['knife', 'roller', 'flat']))
    swings, own = random.random() < 0.5, random.uniform(-0.02, 0.02, 2)
    joint = {
        'cam': ['shaft.axis', 'follower.tip'], 'follower': kind, 'base_radius': base,
        'phase': float(random.uniform(-4.0, 4.0)), **(contact or {}),
        'sense': 'counterclockwise' if sense == 1 else 'clockwise',
    }  # fmt: skip
    if kind == 'roller':
        joint['roller'] = float(random.uniform(0.005, 0.01))
    guess, axis = {}, random.uniform(-0.01, 0.01, 2).tolist()

    def world(x, y):
        return turned(direction, (x, -sense * y))

    if swings:
        side = int(random.choice([1, -1]))
        joint['side'] = 'left' if (side == 1) == (sense == 1) else 'right'
        reach = base + joint.get('roller', 0.0)
        a = float(random.uniform(2.5, 4.0)) * reach
        arm = math.sqrt(a * a - reach * reach) * float(random.uniform(0.95, 1.0))
        arm_angle = float(random.uniform(-3.0, 3.0))
        if kind == 'flat':
            joint['face'] = float(random.uniform(-0.3, 0.3)) * base
        joint['law'] = law(random, float(random.uniform(0.1, 0.3)))
        pivot = centre + world(a, 0.0)
        tip = own + turned(arm_angle, (arm, 0.0))
        guide = {'revolute': ['ground.guide', 'follower.pin']}
        place = 0.9 * math.atan2(reach, a)
        guess['follower'] = float(
            math.remainder(-sense * side * place - arm_angle + direction + math.pi, 2.0 * math.pi)
        )
    else:
        if kind == 'flat':
            joint['tilt'] = float(random.uniform(-0.3, 0.3)) * (random.random() < 0.5)
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


def pressed(scene, spring, damping=0.0):
    """The scene with a force that presses the follower against its cam (N or N m, 1/place)."""
    scene = {**scene, 'loads': {**scene['loads']}}
    if 'revolute' in scene['joints']['guide']:
        joint = scene['joints']['contact']
        out = (1 if joint['side'] == 'left' else -1) * -1
        text = f'{out * -spring} - {damping}*follower_rate'
        scene['loads']['press'] = {'at': 'follower', 'torque': text}
    else:
        d = turned(scene['joints']['guide']['axis'], (1.0, 0.0)).tolist()
        force = f'(-{spring} - {damping}*follower_rate)'
        scene['loads']['press'] = {
            'at': 'follower.pin', 'force': [f'{force}*{d[0]!r}', f'{force}*{d[1]!r}']
        }  # fmt: skip
    return scene


def asked_for(machine, angle, speed):
    """What the follower of `cam` does and needs at an angle of its shaft turning at a speed.

    From its law, its pressure angle and virtual power alone.

    Returns
    -------
    place, velocity and acceleration of the follower; the cam's force on it [N] and its moment
    about its point; the torque of the drive
    """
    plan = machine.plan
    pair = next(j for j in plan.joints if isinstance(j, CamPair))
    body = next(b for b in plan.bodies if b.name == 'follower')
    load = machine.scene.loads['push'].force
    x = pair.sense * angle + pair.phase
    u, u1, u2 = (float(pair.cam.law(x, k)) for k in range(3))
    rate = speed * pair.sense
    touch = pair.cam.at(x)
    centre = np.array(pair.centre)

    def world(v):
        return np.array(pair.world(tuple(v)))

    pitch, contact = (world(turned(-x, p[:, 0])) for p in (touch.pitch, touch.profile))
    follower, gravity = pair.cam.follower, np.array(plan.gravity)
    guide = next(j for j in plan.joints if j.name == 'guide')
    if isinstance(follower, Oscillating | OscillatingFlat):
        sign = pair.swing
        lowest = follower.lowest(pair.cam.base_radius)
        place = sign * (lowest + u) - pair.arm_angle + pair.direction + math.pi
        pivot = np.array(guide.on_first)
        own = np.array(guide.on_second)
        cog, tip = (turned(place, np.array(p) - own) for p in (body.cog, pair.on_second))
        inertia = body.inertia + body.mass * float(cog @ cog)
        moment = inertia * sign * (u2 * rate**2)
        moment -= body.mass * cross(cog, gravity) + cross(tip, load)
        arm = centre + pitch - pivot
        way = sign * np.array([-arm[1], arm[0]])
        needed, size = sign * moment, math.hypot(*arm)
        way, point = way / size, pivot + tip
    else:
        sign, size = 1.0, 1.0
        way = world((1.0, 0.0))
        turn = guide.angle
        tip = turned(turn, np.array(pair.on_second) - np.array(guide.on_second))
        place = float(way @ (centre + pitch - np.array(guide.on_first) - tip))
        if not getattr(follower, 'roller', None) and hasattr(follower, 'tilt'):
            # the face passes through the point of contact, the point of the follower is beside
            at = np.array(guide.on_first) + tip
            n = world((math.cos(follower.tilt), math.sin(follower.tilt)))
            place = float(n @ (centre + contact - at)) / float(n @ way)
        needed = body.mass * u2 * rate**2 - float(way @ (body.mass * gravity + np.array(load)))
        point = np.array(guide.on_first) + tip + place * way
    pressure = float(touch.pressure_angle[0])
    normal = turned(pair.mirror * pressure, way)
    force = needed / size / math.cos(pressure) * normal
    about = cross(centre + contact - point, force)
    return (
        (place, sign * u1 * rate, sign * u2 * rate**2),
        (*force, about),
        needed * u1 * pair.sense,
    )
