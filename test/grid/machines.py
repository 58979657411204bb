"""Machines of the package: Geneva wheels, racks, slots, springs and loads, loose joints."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mechanism_sim.catalogue import scene_names
from mechanism_sim.units import to_si
from test.grid.case import Draft, Family, Random, Scene, variant
from test.grid.four_bars import (
    LAWS,
    NOT_SEATED,
    RESTITUTIONS,
    clearance,
    decades,
    drive,
    pick,
)

WAYS = ('constant', 'ramp', 'smooth', 'torque', 'motor')
# pins that may be loose, with a speed [rad/s] of the drive that suits the machine
LOOSE = (
    ('slider_crank', ('crank_rod', 'rod_piston', 'ground_crank'), 60.0),
    ('slider_crank_offset', ('crank_rod',), 40.0),
    ('quick_return', ('arm_rod', 'rod_ram'), 8.0),
    ('windshield_wiper', ('crank_coupler', 'coupler_left_rocker', 'ground_right_rocker'), 10.0),
    ('film_advance', ('crank_coupler', 'coupler_rocker'), 100.0),
)


def wheel(random: Random, k: int) -> Draft:
    """A wheel of three to eight slots, its pin ideal or with play."""
    slots, radius = 3 + k % 6, 0.05
    keys, extent = drive(random, WAYS[k // 6 % 5], (0.5, 1.8))
    keys['start_angle'] = math.pi + float(random.uniform(-0.3, 0.3))
    scene = variant('geneva', {
        'links.ground.points.wheel_centre': [radius / math.sin(math.pi / slots), 0.0],
        'joints.crank_wheel.slots': slots, 'drive': keys,
        'guess.wheel': math.pi - math.pi / slots,
        'gravity': [0.0, pick(random, (0.0, -9.81))],
    })  # fmt: skip
    if k % 2:
        scene['joints']['crank_wheel']['clearance'] = _play(random)
        scene['start'] = pick(random, ('seated', 'centred'))
    return Draft(scene, **extent)


def rack(random: Random, k: int) -> Draft:
    """A slotted rack, its pin ideal or with play."""
    keys, extent = drive(random, WAYS[k % 5], (0.3, 1.5))
    keys['start_angle'] = math.pi / 2.0
    scene = variant('linear_intermittent', {'drive': keys})
    if k % 2:
        scene['joints']['crank_rack']['clearance'] = _play(random)
    return Draft(scene, **extent)


def _slot(random: Random, k: int) -> Draft:
    """A Scotch yoke or a quick return, its pin ideal or with play in its slot."""
    name, joint = (('scotch_yoke', 'crank_yoke'), ('quick_return', 'crank_arm'))[k // 2 % 2]
    keys, extent = drive(random, WAYS[k // 4 % 5], (0.5, 2.0))
    scene = variant(name, {'drive': keys, 'gravity': [0.0, pick(random, (0.0, -9.81))]})
    if k % 2:
        play = scene['joints'][joint]['clearance'] = _play(random)
        scene['start'] = pick(random, ('seated', 'centred'))
        if k % 8 > 4:
            play['friction'] = decades(random, -2.0, -0.3)
            play['pin_radius'] = decades(random, -3.0, -2.0)
    return Draft(scene, **extent)


def _play(random: Random) -> Scene:
    return {'radial': decades(random, -5.5, -3.3), 'restitution': pick(random, RESTITUTIONS[:-1])}


def loose(random: Random, k: int) -> Draft:
    """A package machine, one or two of its pins loose: rigid, with friction, or compliant."""
    name, pins, speed = LOOSE[k // 12 % len(LOOSE)]
    scene = variant(name, {'gravity': [0.0, pick(random, (0.0, -9.81))]})
    small = 1e-2 if name == 'film_advance' else 1.0
    for joint in [str(x) for x in random.permutation(pins)[: 1 + (k % 4 == 3)]]:
        keys = clearance(random, friction=k % 3 == 1, finest=-5.0)
        if k % 3 == 2:
            keys = {
                'radial': keys['radial'], 'restitution': max(0.1, keys['restitution']),
                'contact': {'law': LAWS[k // 3 % 4], 'stiffness': decades(random, 7.5, 10.0)},
            }  # fmt: skip
        keys['radial'] *= small
        # elastic bounces that loads damp get ever smaller without an end
        keys['restitution'] = min(keys['restitution'], 0.95)
        if 'pin_radius' in keys:
            keys['pin_radius'] *= small
        scene['joints'][joint]['clearance'] = keys
    scene['start'] = pick(random, ('seated', 'centred'))
    pace = speed * decades(random, -0.7, 0.3) * pick(random, (1.0, -1.0))
    scene['drive'] = {k: x for k, x in scene['drive'].items() if k not in ('speed', 'torque')}
    scene['drive']['speed'] = pace
    return Draft(scene, revolutions=1.2)


def _loads(random: Random, k: int) -> Draft:
    """A slider-crank under loads that begin and end, formulas, springs and dampers."""
    keys, extent = drive(random, WAYS[k % 5], (0.5, 2.0))
    begin = float(random.uniform(-3.0, 3.0))
    torque = f'{random.uniform(0.0, 1.0)}*sin({random.uniform(5.0, 60.0)}*t)'
    loads: dict[str, Any] = {
        'stroke': {
            'at': 'piston', 'force': [float(random.uniform(-300.0, 300.0)), 0.0],
            'during': {'coordinate': 'crank', 'from': begin,
                       'to': begin + float(random.uniform(0.1, 3.0))},
        },
        'drag': {'at': 'piston', 'force': [f'-{random.uniform(0.0, 30.0)}*vx', 0.0]},
        'shaking': {
            'at': 'rod', 'torque': torque,
            'force': ['2*cos(crank)', f'-{random.uniform(0.0, 3.0)}*vy'],
            'frame': pick(random, ('world', 'link')),
        },
    }  # fmt: skip
    springs = {
        'return': {
            'between': ['ground.hook', 'piston'], 'stiffness': f'{decades(random, 1.0, 3.5)} N/m',
            'damping': f'{random.uniform(0.0, 5.0)} N s/m',
            'free_length': float(random.uniform(0.05, 0.3)),
        },
    }  # fmt: skip
    scene = variant('slider_crank', {
        'drive': {'coordinate': 'crank', **keys}, 'loads': loads, 'springs': springs,
        'links.ground': {'points': {'hook': [0.6, 0.05]}},
    })  # fmt: skip
    if k % 3 == 2:
        scene['joints']['rod_piston']['clearance'] = clearance(random, finest=-5.0)
    return Draft(scene, **extent)


def _steps(random: Random, k: int) -> Draft:
    """A slider-crank under loads with corners and steps, tables, friction; motors of all kinds."""
    keys, extent = drive(random, WAYS[k % 5], (0.5, 2.0))
    speed = float(random.uniform(20.0, 60.0)) * pick(random, (1.0, -1.0))
    torque = math.copysign(decades(random, 0.0, 1.3), speed)
    if k % 4 == 2:
        rated = speed * float(random.uniform(0.8, 0.98))
        keys = {'speed': 0.0, 'motor': {
            'inertia': decades(random, -4.0, -2.0),
            'induction': {'synchronous_speed': speed, 'rated_speed': rated, 'rated_torque': torque,
                          'breakdown_torque': torque * float(random.uniform(1.1, 4.0))},
        }}  # fmt: skip
    elif k % 4 == 3:
        falling = [[0.0, torque], [0.7 * speed, 1.2 * torque], [speed, 0.0]]
        points = falling if speed > 0.0 else falling[::-1]
        keys = {'motor': {'curve': {'points': points, 'ramp': pick(random, ('linear', 'smooth'))}}}
    if k % 4 >= 2:
        extent = {'duration': 0.5}
    places = np.sort(random.uniform(0.1, 0.4, 5)).tolist()
    way = pick(random, MOVING)  # against it, or a loose pin would be driven without bounds
    forces = (random.uniform(0.0, 100.0, 7) * (-1.0 if way == 'forward' else 1.0)).tolist()
    around = [float(x) for x in (0.0, *np.sort(random.uniform(0.1, 6.2, 3)), 2.0 * math.pi)]
    couples = random.uniform(-2.0, 2.0, 4).tolist()
    smooth = pick(random, ('linear', 'smooth'))
    tables = {
        'work': {'ramp': smooth, 'points': [
            *zip(places[:3], forces, strict=False), *zip(places[2:], forces[3:], strict=False)]},
        'turn': {'ramp': smooth, 'cyclic': True,
                 'points': list(zip(around, [*couples, couples[0]], strict=True))},
    }  # fmt: skip
    size = decades(random, 0.0, 2.0)
    begin, end = np.sort(random.uniform(0.15, 0.35, 2)).tolist()
    known: dict[str, Any] = {
        'rub': {'at': 'piston', 'force': [f'-{size}*sign(vx)', 0.0]},
        'work': {'at': 'piston', 'force': ['work(piston)', 0.0],
                 'during': {'coordinate': 'piston', 'moving': way}},
        'turn': {'at': 'crank', 'torque': 'turn(crank)'},
        'stop': {'at': 'piston', 'force': [f'-{100.0 * size}*max(0, piston - {begin})', 0.0]},
        'drag': {'at': 'piston', 'force': [f'-min({size}, abs(5*vx))*sign(vx)', 0.0]},
        'late': {'at': 'rod', 'torque': '1 if t > 0.03 and not crank_rate < 0 else -0.5'},
        'pin': {'at': 'rod', 'reaction': 'crank',
                'torque': f'-{0.01 * size}*sign(rod_rate - crank_rate)'},
        'press': {'at': 'piston', 'force': [-size, 0.0], 'during': {
            'coordinate': 'piston', 'from': begin, 'to': end + 0.01,
            'moving': pick(random, (None, 'forward'))}},
    }  # fmt: skip
    chosen = random.choice([*known], int(random.integers(1, 5)), replace=False).tolist()
    scene = variant('slider_crank', {
        'drive': {'coordinate': 'crank', **keys}, 'tables': tables,
        'loads': {name: known[name] for name in chosen},
    })  # fmt: skip
    if k % 3 == 2:
        scene['joints']['rod_piston']['clearance'] = clearance(random, finest=-5.0, most=0.9)
    return Draft(scene, **extent)


RUBBING = (
    'slider_crank', 'quick_return', 'scotch_yoke', 'windshield_wiper', 'pendulum', 'geneva',
    'linear_intermittent', 'gear_pair', 'eccentric_cam', 'offset_roller_cam',
)  # fmt: skip
RUB = {'revolute', 'prismatic', 'slot', 'geneva', 'rack', 'cam', 'mesh'}


def _rubbing(random: Random, k: int) -> Draft:
    """A package machine, some of its ideal joints with friction."""
    name = RUBBING[k % len(RUBBING)]
    keys, extent = drive(random, WAYS[k // len(RUBBING) % 5], (0.5, 2.0))
    scene = variant(name, {'gravity': [0.0, pick(random, (0.0, -9.81))]})
    if name != 'pendulum':
        old = {k: scene['drive'][k] for k in ('coordinate', 'start_angle') if k in scene['drive']}
        scene['drive'] = {**keys, **old}
    if k // len(RUBBING) % 2:
        scene['joints'] = {n: {x: y for x, y in j.items() if x != 'lift_off'}
                           for n, j in scene['joints'].items()}  # fmt: skip
    rub(random, scene, 0.02, 0.1)
    return Draft(scene, duration=1.5) if name == 'pendulum' else Draft(scene, **extent)


def rub(random: Random, scene: Scene, radius: float, length: float = 0.0) -> None:
    """Give some joints friction, of journals up to a radius and blocks from a length [m]."""
    able = [n for n, j in scene['joints'].items() if RUB & j.keys() and 'clearance' not in j]
    for name in random.permutation(able)[: int(random.integers(1, 1 + len(able)))].tolist():
        joint = scene['joints'][name]
        keys: Scene = {'coefficient': decades(random, -2.0, -0.5)}
        if 'roller' in joint:
            keys['radius'] = 1e-3
        elif 'revolute' in joint:
            keys['radius'] = radius * decades(random, -1.0, 0.0)
        elif 'prismatic' in joint and length and random.random() < 0.5:
            keys['length'] = length * decades(random, 0.0, 0.5)
        if 'lift_off' in joint:
            own = {'friction': keys['coefficient'], 'pin_radius': keys.get('radius', 0.0)}
            scene['joints'][name] = {**joint, 'lift_off': {**joint['lift_off'], **own}}
            continue
        scene['joints'][name] = {**joint, 'friction': keys}


def _rubbing_loose(random: Random, k: int) -> Draft:
    """A package machine with loose pins, some of its other joints with friction."""
    draft = loose(random, k if k % 12 < 11 else k - 3)  # two elastic pins of one link whirl
    for joint in draft.scene['joints'].values():
        if 'friction' in (play := joint.get('clearance', {})):  # more jams with that of others
            play['friction'] = 0.5 if play['friction'] == 'rough' else min(play['friction'], 0.5)
    rub(random, draft.scene, 2e-4 if 'film' in draft.scene['title'].lower() else 0.02)
    return draft


GUIDED = ('slider_crank', 'slider_crank_offset', 'slider_crank_engine', 'punch')


def _guide(random: Random, k: int) -> Draft:
    """A slider-crank whose slider has play in its guide, rigid walls or compliant ones."""
    name = GUIDED[k % len(GUIDED)]
    keys, extent = drive(random, WAYS[k // len(GUIDED) % 5], (0.3, 1.2))
    scene = variant(name, {'gravity': [0.0, pick(random, (0.0, -9.81))], 'start': 'centred'})
    old = {k: scene['drive'][k] for k in ('coordinate', 'start_angle') if k in scene['drive']}
    scene['drive'] = {**keys, **old}
    joint = next(n for n, j in scene['joints'].items() if 'prismatic' in j)
    length = float(random.uniform(0.03, 0.1))
    play = {
        'radial': decades(random, -5.0, -3.0), 'restitution': pick(random, RESTITUTIONS[:-1]),
        'length': length, 'height': length * float(random.uniform(0.2, 1.0)),
        'friction': pick(random, (0.0, decades(random, -2.0, -0.7))),
    }  # fmt: skip
    if k % 3 == 2:
        play['restitution'] = max(0.1, min(0.9, play['restitution']))
        play['contact'] = {'law': LAWS[k // 3 % 4], 'stiffness': decades(random, 7.5, 9.0)}
    scene['joints'][joint] = {**scene['joints'][joint], 'clearance': play}
    block = scene['joints'][joint]['prismatic'][1].partition('.')[0]
    scene['links'][block] = {**scene['links'][block], 'inertia': decades(random, -5.0, -3.0)}
    return Draft(scene, **extent)


MOVING = 'forward', 'backward'
SHOWN = tuple(n for n in scene_names() if n != 'thesis')


def _package(random: Random, k: int) -> Draft:
    """A scene of the package as it is, or with its drive at another speed."""
    name = SHOWN[k % len(SHOWN)]
    scene = variant(name, {})
    if k < len(SHOWN) or 'drive' not in scene or not isinstance(scene['drive'].get('speed'), str):
        return Draft(scene)
    if {'torque', 'force', 'motor'} & scene['drive'].keys():
        return Draft(scene)
    number, _, unit = scene['drive']['speed'].partition(' ')
    factor = decades(random, -1.0, 0.5)
    scene['drive'] = {**scene['drive'], 'speed': f'{float(number) * factor!r} {unit}'}
    duration = scene.pop('duration', None)
    if duration and unit.endswith('m/s'):  # without revolutions; it goes as far
        scene['duration'] = f'{to_si(duration, "s") / factor!r} s'
    return Draft(scene)


FAMILIES = (
    Family('geneva', 36, wheel),
    Family('rack', 15, rack),
    Family('slot', 40, _slot, (), 20),
    Family('ranges', 30, _loads, NOT_SEATED),
    Family('steps', 60, _steps, NOT_SEATED),
    Family('rubbing', 100, _rubbing, (), len(RUBBING)),
    Family('guide', 40, _guide, (), len(GUIDED)),
    Family('loose', 60, loose, NOT_SEATED),
    Family('rubbing_loose', 60, _rubbing_loose, NOT_SEATED),
    Family('package', 2 * len(SHOWN), _package),
)
