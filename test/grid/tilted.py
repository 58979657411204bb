"""Bearings out of line by nothing to almost all they have room for, and links that lean."""

from __future__ import annotations

import math
from typing import Any

from mechanism_sim.units import to_si
from test.grid.case import Draft, Family, Random, Scene, variant
from test.grid.four_bars import LAWS, NOT_SEATED, clearance, decades, drive, pick
from test.grid.machines import WAYS

# the links that may lean, and pins that may be loose
MACHINES = (
    ('four_bar_clearance', ('coupler', 'rocker'), ('coupler_rocker', 'rocker_ground')),
    ('slider_crank', ('rod', 'crank'), ('crank_rod', 'rod_piston')),
    ('four_bar_nominal', ('coupler', 'rocker', 'crank'), ('crank_coupler',)),
)
SHARES = (0.0, 1e-7, 0.999, 1e-3, 0.1, 0.5)
"""Of the room for misalignment; the second is less than what counts as in line."""


def _tilted(random: Random, k: int) -> Draft:
    name, links, pins = MACHINES[k % len(MACHINES)]
    keys, extent = drive(random, WAYS[k // len(MACHINES) % 5], (0.3, 1.2))
    scene = variant(name, {'gravity': [0.0, pick(random, (0.0, -9.81))]})
    known = {'coordinate': 'crank'} if 'coordinate' in scene['drive'] else {}
    scene['drive'] = known | keys
    joints = scene.setdefault('joints', {})
    for joint in pins:
        if joint in joints:
            joints[joint].pop('clearance', None)
    leaning = random.permutation(links)[: int(random.integers(0, 3))].tolist()
    for joint in random.permutation(pins)[: 1 + (k % 7 == 6)].tolist():
        play = clearance(random, friction=k % 3 == 1, finest=-4.5)
        play['restitution'] = min(play['restitution'], 0.9)
        play['length'] = decades(random, -2.3, -1.3)
        play['misalignment'] = misalignment(random, play['radial'], play['length'])
        if leaning:
            play['along'] = pick(random, (0.0, float(random.uniform(-0.6, 0.6)) * play['length']))
        if k % 5 == 4:
            play |= {'restitution': max(0.1, play['restitution']), 'hypothesis': 'newton'}
            play = {key: x for key, x in play.items() if key not in ('friction', 'pin_radius')}
            play['contact'] = {'law': LAWS[k % 4], 'stiffness': decades(random, 7.5, 9.5)}
        joints.setdefault(joint, {})['clearance'] = play
    scene['start'] = pick(random, ('seated', 'centred'))
    for link in leaning:
        scene['links'][link]['tilt'] = lean(
            random, to_si(scene['links'][link]['inertia'], 'kg m^2')
        )
    if leaning and k % 2:
        stop(random, scene, leaning)
    return Draft(scene, **extent)


def stop(random: Random, scene: Scene, leaning: list[str]) -> None:
    """Stops along the axes in the loose joints of links that lean, and weight along them."""
    scene['axial_gravity'] = pick(random, (0.0, 0.0, -9.81, 30.0))
    for joint, keys in scene['joints'].items():
        play, links = keys.get('clearance'), {*joint.split('_')} & {*leaning}
        if not play or not links:
            continue
        radius = pick(random, (0.0, decades(random, -2.7, -1.7)))
        off = sum(axis['angle'] for axis in play['misalignment'].values())
        axial = {'play': 1.01 * radius * off + decades(random, -5.0, -3.0)}
        if radius:
            axial |= {'face_radius': radius, 'crown': decades(random, -7.0, -5.0)}
        if random.random() < 0.5:
            axial['restitution'] = pick(random, (0.2, 0.9) if 'contact' in play else (0.0, 0.9))
        play['axial'] = axial
        for link in links:
            scene['links'][link]['tilt']['axial_stiffness'] = pick(random, (0.0, 1e3, 1e5))


def misalignment(random: Random, radial: float, length: float) -> dict[str, Any]:
    """Of pin, bushing or both; these alike or not."""
    room = pick(random, SHARES) * min(2.0 * radial / length, 0.09)
    share = pick(random, (0.0, 1.0, 0.5, float(random.random())))
    direction = float(random.uniform(-math.pi, math.pi))
    other = pick(random, (direction, direction + math.pi, float(random.uniform(-3.0, 3.0))))
    return {
        'pin': {'angle': share * room, 'direction': direction},
        'bushing': {'angle': (1.0 - share) * room, 'direction': other},
    }


def lean(random: Random, normal: float) -> dict[str, Any]:
    """Keys of a link that tilts, with its moment of inertia about its normal."""
    along, thick = normal * random.uniform(0.02, 0.98), normal * decades(random, -3.0, 0.0)
    return {
        'stiffness': decades(random, 1.7, 3.5),  # less, and forces topple it
        'inertia': [float(normal - along + thick), float(along + thick)],
        'damping': pick(random, (0.0, 0.05)),
    }


FAMILIES = (Family('tilted', 60, _tilted, NOT_SEATED),)
