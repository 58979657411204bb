"""Friction of walls with play, of grooves, teeth and followers that lift off; belts that slip."""

from __future__ import annotations

from test.grid import cams, machines, trains
from test.grid.case import Draft, Family, Random, Scene, rotate
from test.grid.four_bars import RESTITUTIONS, RIGID, decades, drive, pick

WAYS = ('constant', 'ramp', 'smooth', 'torque', 'motor', 'free')


def _walls(random: Random, k: int) -> Draft:
    """A wheel, a rack, a groove, a cam or a mesh whose walls rub while they are touched."""
    mu, least = decades(random, -2.0, -0.3), 1.0 if k % 5 else 0.0
    return (_wheel, _rack, _groove, _lift_off, _teeth)[k % 5](random, k // 5, mu * least)


def _wheel(random: Random, k: int, mu: float) -> Draft:
    draft = machines.wheel(random, 2 * k + 1)
    return _in_slot(random, draft, 'crank_wheel', mu)


def _rack(random: Random, k: int, mu: float) -> Draft:
    return _in_slot(random, machines.rack(random, 2 * k + 1), 'crank_rack', mu)


def _in_slot(random: Random, draft: Draft, joint: str, mu: float) -> Draft:
    play = draft.scene['joints'][joint]['clearance']
    play |= {'friction': mu, 'pin_radius': pick(random, (0.0, 2e-3, 5e-3)) if mu else 0.0}
    play |= {'hypothesis': pick(random, RIGID), 'restitution': min(0.95, play['restitution'])}
    return draft


def _groove(random: Random, k: int, mu: float) -> Draft:
    """An ideal groove, or one with play."""
    loose = k % 2
    keys: Scene = {'clearance': decades(random, -5.5, -3.3) if loose else 0.0}
    if loose:
        keys |= {'restitution': pick(random, RESTITUTIONS[:-1]), 'hypothesis': pick(random, RIGID)}
    scene = cams.cam(random, {'groove': keys})
    contact = scene['joints']['contact']
    pin = contact['roller'] * float(random.uniform(0.05, 0.9))
    if loose:
        keys |= {'friction': mu, 'pin_radius': pin}
    else:
        contact['friction'] = {'coefficient': mu, 'radius': pin}
    return cams.driven(random, scene, k // 2)


def _lift_off(random: Random, k: int, mu: float) -> Draft:
    keys: Scene = {'restitution': pick(random, RESTITUTIONS[:-1]), 'friction': mu,
                   'hypothesis': pick(random, RIGID)}  # fmt: skip
    scene = cams.pressed(random, cams.cam(random, {'lift_off': keys}))
    if roller := scene['joints']['contact'].get('roller'):
        keys['pin_radius'] = roller * float(random.uniform(0.05, 0.9))
    return cams.driven(random, scene, k)


def _teeth(random: Random, _k: int, mu: float) -> Draft:
    scene = trains.train(random, 'loose')
    for joint in scene['joints'].values():
        if 'backlash' in joint:
            joint['backlash'] |= {'friction': mu, 'hypothesis': pick(random, RIGID)}
    return Draft(scene, duration=0.2)


def _belt(random: Random, k: int) -> Draft:
    """Two pulleys anywhere, on the ground or an arm; flat and V-belts that slip, and chains."""
    radii = [decades(random, -1.7, -0.7) for _ in range(2)] if k % 4 else [0.05, 0.05]
    crossed = bool(k // 2 % 2)
    apart = sum(radii) * float(random.uniform(1.01, 4.0))
    away = rotate(float(random.uniform(-3.0, 3.0)), (apart, 0.0)).tolist()
    on = 'arm' if k % 3 == 2 else 'ground'
    links: Scene = {'ground': {'points': {}}, 'a': trains.body(random), 'b': trains.body(random)}
    joints: Scene = {}
    if on == 'arm':
        links['arm'] = {'points': {}, **trains.body(random)}
        joints['arm_shaft'] = {'revolute': ['ground', 'arm']}
    links[on]['points']['far'] = away
    joints |= {'one': {'revolute': [on, 'a']}, 'two': {'revolute': [f'{on}.far', 'b']}}
    belt: Scene = {'belt': ['a', 'b'], 'radii': [round(r, 4) for r in radii], 'crossed': crossed}
    if on == 'arm':
        belt['carrier'] = 'arm'
    slips = k % 5 != 4
    if slips:
        friction: Scene = {'coefficient': pick(random, (0.0, *(decades(random, -1.5, 0.3),) * 9))}
        if random.random() < 0.4:
            friction['groove'] = float(random.uniform(0.4, 1.2))
        belt |= {'friction': friction, 'pretension': decades(random, -1.0, 3.0)}
    else:
        belt['friction'] = {'efficiency': pick(random, (1.0, float(random.uniform(0.7, 1.0))))}
    joints['belt'] = belt
    for joint in ('one', 'two'):
        if random.random() < 0.4:
            keys = {
                'coefficient': decades(random, -2.0, -0.7),
                'radius': decades(random, -3.0, -2),
            }
            joints[joint]['friction'] = keys
    loads: Scene = {
        c: {'at': c, 'torque': f'{decades(random, -1.0, 1.0)}*sin({random.uniform(5.0, 90.0)}*t)'
                               f' - {decades(random, -3.0, -0.5)}*{c}_rate'}
        for c in links if c not in ('ground', 'a')
    }  # fmt: skip
    keys, extent = drive(random, WAYS[k % 6], (0.5, 1.8))
    scene: Scene = {
        'title': 'by chance', 'mechanism': 'linkage', 'links': links, 'joints': joints,
        'loads': loads, 'gravity': random.uniform(-10.0, 10.0, 2).tolist(),
        'drive': {'coordinate': 'a', **keys},
    }  # fmt: skip
    if slips and k % 7 == 3:
        scene['initial'] = {'velocity': {'b': float(random.uniform(-50.0, 50.0))}}
    return Draft(scene, **extent)


FAMILIES = (
    Family('walls_rubbing', 60, _walls, (*cams.UNFIT, *trains.UNFIT)),
    Family('belt', 40, _belt),
)
