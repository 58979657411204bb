"""Machines with elastic links of any section, modes and ends, with joints of all kinds."""

from __future__ import annotations

from typing import Any

import numpy as np

from test.grid import four_bars as bars
from test.grid.case import Draft, Family, Random, Scene, variant
from test.grid.machines import WAYS, rub

# links that may bend, the driven one first, and pins that may be loose
MACHINES = (
    ('slider_crank', ('crank', 'rod'), ('crank_rod', 'rod_piston')),
    ('four_bar_nominal', ('crank', 'coupler', 'rocker'), ('coupler_rocker', 'rocker_ground')),
    ('slider_crank_offset', ('crank', 'rod'), ('crank_rod',)),
    ('four_bar_clearance', ('crank', 'coupler', 'rocker'), ('coupler_rocker',)),
)


def _elastic(random: Random, k: int) -> Draft:
    name, links, pins = MACHINES[k % len(MACHINES)]
    keys, extent = bars.drive(random, WAYS[k // len(MACHINES) % 5], (1.0, 1.8))
    scene = variant(name, {'gravity': [0.0, bars.pick(random, (0.0, -9.81))]})
    known = {'coordinate': 'crank'} if 'coordinate' in scene['drive'] else {}
    scene['drive'] = known | keys | {'flywheel': bars.decades(random, -3.5, -2.0)}
    chosen = random.permutation(links)[: 1 + int(random.integers(0, len(links)))].tolist()
    for link in chosen:
        scene['links'][link] = {
            'length': scene['links'][link]['length'],
            'mass': float(random.uniform(0.2, 0.6)),
            'elastic': beam(random, link == 'crank'),
        }
    kind = k // 2 % 4
    joints = scene.setdefault('joints', {})
    for joint in pins if name == 'four_bar_clearance' and kind == 0 else ():
        joints.pop(joint, None)
    if kind in (1, 2):
        play = bars.clearance(random, friction=kind == 2, finest=-5.0)
        play['restitution'] = min(play['restitution'], 0.95)
        joints.setdefault(bars.pick(random, pins), {})['clearance'] = play
    elif kind == 3 and k % 3 == 0:
        contact = {'law': bars.LAWS[k % 4], 'stiffness': bars.decades(random, 7.5, 9.5)}
        joints.setdefault(pins[0], {})['clearance'] = {
            'radial': bars.decades(random, -5.0, -3.5), 'contact': contact,
            'restitution': max(0.1, bars.pick(random, bars.RESTITUTIONS[:-1])),
        }  # fmt: skip
    elif scene['mechanism'] == 'linkage':
        rub(random, scene, 0.01)
    return Draft(scene, **extent)


def beam(random: Random, driven: bool) -> dict[str, Any]:
    """Keys of an elastic link of some 0.1 m, which no load of these machines bends far.

    Its stiffness is that of bars of some mm; with its mass its modes are 5 times as fast as the
    drive, or more.
    """
    modulus, stiffness = 1e11, bars.decades(random, 1.0, 2.5)  # [Pa], [N m^2]
    area = bars.decades(random, -5.0, -4.0)
    section: Scene = {'area': area, 'second_moment': stiffness / modulus}
    if random.random() < 0.4:
        section = {'section': {'points': _taper(random, section)}}
    return {
        'youngs_modulus': modulus,
        **section,
        'modes': int(random.integers(1, 4)),
        'stretch': int(random.random() < 0.2),
        'ends': 'clamped' if driven else bars.pick(random, ('pinned', 'clamped')),
        'functions': bars.pick(random, ('modal', 'polynomial')),
        'damping': bars.pick(random, (0.0, 0.01, 0.1)),
        'rayleigh': {
            'mass': bars.pick(random, (0.0, 5.0)),
            'stiffness': bars.pick(random, (0.0, 1e-5)),
        },
        'foreshortening': bool(random.random() < 0.9),
    }


def _taper(random: Random, section: Scene) -> list[Any]:
    """Points of a link of some 0.1 m, at any places: corners, steps, sections that do not change.

    Of a few of them one lies before the link, or beyond it.
    """
    places = np.sort(random.uniform(-0.02, 0.3, int(random.integers(2, 5))))
    if random.random() < 0.3:
        places[1] = places[0]
    if random.random() < 0.3:
        places[0] = 0.0
    size = (64.0 * section['second_moment'] / np.pi) ** 0.25
    even, round_ = random.random() < 0.2, random.random() < 0.5
    found = []
    for x in np.sort(places).tolist():
        share = 1.0 if even else float(random.uniform(0.7, 1.4))
        own = {'diameter': share * size}
        found.append([x, own if round_ else {key: share * y for key, y in section.items()}])
    return found


def _joined(random: Random, k: int) -> Draft:
    """Slots and guides along elastic links and at cross-sections, gears, belts, and followers."""
    kind = k % len(_JOINED)
    keys, extent = bars.drive(random, WAYS[k // len(_JOINED) % 5], (0.8, 1.4))
    keys |= {'coordinate': 'crank', 'flywheel': bars.decades(random, -3.0, -2.0)}
    elastic = {'mass': float(random.uniform(0.2, 0.6)), 'elastic': beam(random, False)}
    scene = _JOINED[kind](random, elastic)
    scene = {'title': 'elastic', 'mechanism': 'linkage', 'drive': keys} | scene
    scene['gravity'] = [0.0, bars.pick(random, (0.0, -9.81))]
    return Draft(scene, **extent)


def _play(random: Random, block: bool) -> Scene:
    """Of a slot or a guide, or none."""
    if random.random() < 0.5:
        return {}
    play = {
        'radial': bars.decades(random, -4.5, -3.3),
        'restitution': bars.pick(random, (0.0, 0.3, 0.5, 0.8)),
        'hypothesis': bars.pick(random, bars.RIGID),
    }
    if random.random() < 0.5:
        play |= {'friction': bars.pick(random, (0.05, 0.2)), 'hypothesis': 'stronge'}
    if block:
        play |= {'length': 0.02, 'height': 0.01}
    return {'clearance': play}


def _crank(radius: float) -> Scene:
    return {'length': radius, 'cog': 0.3 * radius, 'mass': 0.5, 'inertia': 4e-4}


def _quick_return(random: Random, elastic: Scene) -> Scene:
    """A pin or a block that runs along an elastic arm, on or beside its axis."""
    radius, apart = float(random.uniform(0.04, 0.08)), float(random.uniform(0.12, 0.16))
    beside = bars.pick(random, (0.0, 0.0, 0.01))
    links = {
        'ground': {'points': {'shaft': [0.0, apart]}},
        'crank': _crank(radius),
        'arm': {'length': apart + 1.2 * radius, 'points': {'line': [0.0, beside]}, **elastic},
    }
    joints: Scene = {
        'a': {'revolute': ['ground.shaft', 'crank']}, 'b': {'revolute': ['ground', 'arm']},
    }  # fmt: skip
    if random.random() < 0.5:
        joints['line'] = {'slot': ['crank.end', 'arm.line'], **_play(random, False)}
    else:
        links['block'] = {'mass': 0.1, 'inertia': 1e-5}
        joints['p'] = {'revolute': ['crank.end', 'block']}
        joints['line'] = {'prismatic': ['arm.line', 'block'], **_play(random, True)}
    guess = {link: '90 deg' for link in links if link in ('arm', 'block')}
    return {'links': links, 'joints': joints, 'guess': guess}


def _yoke(random: Random, elastic: Scene) -> Scene:
    """An elastic yoke: fixed to a block in a guide, with a slot along it."""
    radius, length = float(random.uniform(0.03, 0.05)), 0.14
    middle = bars.pick(random, (0.5, 0.4)) * length
    links = {
        'crank': _crank(radius),
        'yoke': {'length': length, 'points': {'block': [middle, 0.0]}, **elastic},
    }
    joints = {
        'a': {'revolute': ['ground', 'crank']},
        'guide': {'prismatic': ['ground', 'yoke.block'], 'angle': '90 deg'},
        'slot': {'slot': ['crank.end', 'yoke'], **_play(random, False)},
    }
    return {'links': links, 'joints': joints, 'guess': {'yoke': '90 deg'}}


def _wheel(random: Random, elastic: Scene) -> Scene:
    """An elastic arm that turns with a wheel at its start, or anywhere along it."""
    at = bars.pick(random, (0.0, 0.05))
    ground = {'points': {'shaft': [0.06, 0.0]}}
    arm = {'length': 0.15, 'points': {'hub': [at, 0.0]}, **elastic}
    joint = bars.pick(random, (
        {'mesh': ['small', 'large']},
        {'mesh': ['small', 'large'], 'elasticity': {'stiffness': 1e7, 'damping': 50.0}},
        {'mesh': ['small', 'large'], 'friction': {'coefficient': 0.05}},
        {'mesh': ['small', 'large'], 'backlash': {'width': 1e-4, 'restitution': 0.5}},
        {'belt': ['crank', 'arm.hub'], 'radii': [0.02, 0.03]},
        {'belt': ['crank', 'arm.hub'], 'radii': [0.02, 0.03], 'stiffness': 1e5, 'damping': 20.0},
        {'transmission': ['crank', 'arm.hub'], 'ratio': '2/3'},
    ))  # fmt: skip
    return {
        'links': {'ground': ground, 'crank': {'mass': 0.5, 'inertia': 2e-4}, 'arm': arm},
        'gears': {
            'small': {'at': 'crank', 'module': 2e-3, 'teeth': 20},
            'large': {'at': 'arm.hub', 'module': 2e-3, 'teeth': 40},
        },
        'joints': {'a': {'revolute': ['ground', 'crank']},
                   'b': {'revolute': ['ground.shaft', 'arm.hub']}, 'j': joint},
    }  # fmt: skip


def _follower(random: Random, elastic: Scene) -> Scene:
    """An elastic arm with a roller on a cam, which it may leave."""
    arm = {'length': 0.08, **elastic, 'mass': 0.1}
    scene = variant('oscillating_roller', {'links.arm': arm})
    for part in ('links', 'joints', 'springs'):  # the driven link's name is that of the others
        scene[part] = {name.replace('cam', 'crank'): x for name, x in scene[part].items()}
    contact, shaft = scene['joints']['contact'], scene['joints']['bearing']
    contact['cam'], shaft['revolute'] = ['crank', 'arm.end'], ['ground', 'crank']
    if random.random() < 0.5:
        del contact['lift_off']
    return {key: scene[key] for key in ('links', 'joints', 'springs', 'guess')}


_JOINED = _quick_return, _yoke, _wheel, _follower


def _drawn(random: Random, k: int) -> Draft:
    return _elastic(random, k) if k < _REVOLUTE else _joined(random, k)


_REVOLUTE = 48
"""Cases whose elastic links have revolute joints only."""

FAMILIES = (Family('elastic', _REVOLUTE + 40, _drawn, bars.NOT_SEATED),)
