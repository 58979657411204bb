"""Machines with elastic links of any section, modes and ends, with loose and rubbing joints."""

from __future__ import annotations

from typing import Any

from mechanism_sim.bench.grid import four_bars as bars
from mechanism_sim.bench.grid.case import Draft, Family, Random, variant
from mechanism_sim.bench.grid.machines import WAYS, rub

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
    """What a scene says of an elastic link of some 0.1 m: no load of these machines bends it far.

    Its stiffness is that of bars of some mm; with its mass its modes are 5 times as fast as the
    drive, or more.
    """
    modulus, stiffness = 1e11, bars.decades(random, 1.0, 2.5)  # [Pa], [N m^2]
    return {
        'youngs_modulus': modulus,
        'area': bars.decades(random, -5.0, -4.0),
        'second_moment': stiffness / modulus,
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


FAMILIES = (Family('elastic', 48, _elastic, bars.NOT_SEATED),)
