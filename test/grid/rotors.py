"""Rotors on supports and shafts that give way, alone and as cranks, degenerate ones among them."""

from __future__ import annotations

from typing import Any

from test.grid.case import Draft, Family, Random, Scene, variant
from test.grid.four_bars import NOT_SEATED, clearance, decades, drive, pick
from test.grid.machines import WAYS


def _rotor(random: Random, k: int) -> Draft:
    """Every fourth is the crank of a compressor, half of these with a loose pin."""
    crank = k % 4 == 3
    keys, extent = drive(random, WAYS[k // 4 % 5], (1.0, 1.8) if crank else (0.5, 2.5))
    gravity = [0.0, pick(random, (0.0, -9.81))]
    if crank:
        scene = variant('slider_crank', {'gravity': gravity})
        scene['drive'] = {'coordinate': 'crank', **keys}
        scene['joints']['ground_crank'] = _joint(random, 'crank', 700e-6, 1e6)
        if k % 8 == 7:
            scene['joints']['crank_rod']['clearance'] = clearance(random, friction=False)
        return Draft(scene, **extent)
    polar = decades(random, -3.0, -1.0)
    off = pick(random, (0.0, 1.0)) * decades(random, -5.0, -3.0)
    scene = {
        'title': 'Rotor',
        'mechanism': 'linkage',
        'links': {'disk': {'mass': decades(random, -0.3, 1.3), 'inertia': polar, 'cog': off}},
        'joints': {'shaft': _joint(random, 'disk', polar, 1e5)},
        'gravity': gravity,
        'drive': {'coordinate': 'disk', **keys},
    }
    return Draft(scene, **extent)


def _joint(random: Random, link: str, polar: float, stiffness: float) -> Scene:
    """Supports alike or not, the disk between them, in their middle or beyond, damped or not."""
    alike, damped = random.random() < 0.5, random.random() < 0.7

    def pair(size: float) -> Any:
        x = size * decades(random, -0.3, 0.3)
        return x if alike else [x, x * float(random.uniform(0.5, 2.0))]

    first = float(random.uniform(0.05, 0.4))
    second = pick(random, (first, float(random.uniform(0.05, 0.4)), -first - 0.2))
    one = {'stiffness': pair(stiffness), 'damping': pair(1e-4 * stiffness) if damped else 0.0}
    found: Scene = {'rotor': ['ground', link], 'supports': {}}
    tilts, bends = random.random() < 0.8, random.random() < 0.6
    for name, along in (('left', -first), ('right', second)):
        if not alike:
            one = one | {'stiffness': pair(stiffness)}
        heavy = {'mass': decades(random, -0.3, 0.5)} if bends or random.random() < 0.3 else {}
        rigid = bends and random.random() < 0.3
        found['supports'][name] = {'along': along} if rigid else {'along': along, **one, **heavy}
    if not tilts and not bends:
        found['supports'] = {'both': dict(one)}
    if tilts:
        found['diametral_inertia'] = polar * pick(random, (0.5, 1.0, 3.0))
    if bends:
        relaxation = pick(random, (0.0, 1e-6)) * damped
        found['shaft'] = {'diameter': 0.02, 'youngs_modulus': 2.1e11, 'relaxation': relaxation}
    if damped:
        found['external_damping'] = pair(1e-4 * stiffness)
    if tilts and random.random() < 0.5:
        found['disks'] = {f'disk_{n}': _disk(random, n) for n in range(random.integers(1, 4))}
    if bends and random.random() < 0.3:
        found['shaft']['sections'] = {'thick': {'begin': -0.1, 'end': 0.05, 'diameter': 0.03}}
    return found


def _disk(random: Random, n: int) -> Scene:
    """Beside the others, that tilts or not, out of balance or not."""
    polar = pick(random, (0.0, decades(random, -4.0, -2.0)))
    found = {
        'along': pick(random, (-1, 1)) * (0.03 + 0.06 * n),
        'mass': decades(random, -1.0, 1.0),
    }
    found |= {'inertia': polar, 'cog': [pick(random, (0.0, 1e-4)), pick(random, (0.0, -1e-4))]}
    if polar and random.random() < 0.6:
        found['diametral_inertia'] = polar * pick(random, (0.5, 0.7))
    return found


FAMILIES = (Family('rotor', 60, _rotor, NOT_SEATED),)
