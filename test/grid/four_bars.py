"""Four-bars at every level: laws of contact, friction, clearances, drives and starts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from mechanism_sim.linkages.four_bar import FourBar
from test.grid.case import Draft, Family, Random, Scene, variant

JOINTS = ('ground_crank', 'crank_coupler', 'coupler_rocker', 'rocker_ground')
DRIVES = ('constant', 'ramp', 'smooth', 'torque', 'motor', 'free')
RIGID = ('newton', 'poisson', 'stronge')
FRICTIONS: tuple[float | str, ...] = (0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 1.0, 3.0, 'rough')
RESTITUTIONS = (0.0, 0.05, 0.3, 0.5, 0.7, 0.9, 1.0)
PIN_RADII = (0.0, 1e-3, 5e-3, 15e-3)
LAWS = ('hertz', 'hunt_crossley', 'lankarani_nikravesh', 'flores')
# exponent and powers of ten of the stiffness [N/m^exponent]; softer ones leave the bushing
SOFT = (
    (1.0, (6.0, 10.0)), (1.2, (6.0, 10.0)), (1.5, (6.5, 10.0)), (1.5, (7.0, 10.0)),
    (2.0, (8.5, 10.0)), (3.0, (11.0, 13.0)),
)  # fmt: skip
NOT_SEATED = ('no force presses', "or write 'start: centred'", 'without clearance the force in')


_WHIRLS = 1000
_DRAG = 3e3  # of a film's journal at the centre, over pi [N s/m]


def pick(random: Random, values: Sequence[Any]) -> Any:
    """One of the values, as it is."""
    return values[int(random.integers(len(values)))]


def decades(random: Random, low: float, high: float) -> float:
    """A number between two powers of ten, of any magnitude alike."""
    return float(10.0 ** random.uniform(low, high))


def drive(random: Random, kind: str, speeds: tuple[float, float] = (0.0, 2.3)) -> tuple[Any, Any]:
    """Keys of a drive of the crank, and how long it runs (in revolutions, or in seconds).

    Parameters
    ----------
    speeds : powers of ten of the speed [rad/s]
    """
    speed = decades(random, *speeds) * pick(random, (1.0, -1.0))
    keys: Scene = {'start_angle': float(random.uniform(-math.pi, math.pi))}
    turn = 2.0 * math.pi / abs(speed)
    if kind == 'constant':
        return keys | {'speed': speed}, {'revolutions': float(random.uniform(1.0, 2.5))}
    if kind in ('ramp', 'smooth'):
        slow = speed * decades(random, -2.0, 0.0)
        first, last = (slow, speed) if random.random() < 0.7 else (speed, slow)
        if random.random() < 0.2:
            last = -last
        points = [[0.1 * turn, first], [float(random.uniform(0.8, 2.0)) * turn, last]]
        if random.random() < 0.3:
            points.append([points[1][0] + turn, 0.0])
        profile = {'points': points, 'ramp': 'smooth' if kind == 'smooth' else 'linear'}
        return keys | {'profile': profile}, {'duration': points[-1][0] + 0.5 * turn}
    keys['speed'] = speed if random.random() < 0.7 else 0.0
    if random.random() < 0.5:
        keys['flywheel'] = decades(random, -4.0, -1.0)
    if kind == 'torque':
        keys['torque'] = {
            'constant': float(random.uniform(0.5, 5.0)) * math.copysign(1.0, speed),
            'per_speed': -decades(random, -3.0, -1.0),
            'per_angle': float(pick(random, (0.0, 0.0, -0.2))),
        }
    elif kind == 'motor':
        keys['motor'] = {
            'stall_torque': math.copysign(decades(random, 0.0, 1.3), speed),
            'no_load_speed': 1.2 * speed,
        }
    else:
        keys['torque'] = {}
    return keys, {'duration': min(1.5 * turn, 1.0)}


def base(random: Random) -> Scene:
    """Overrides of lengths and masses: a crank-rocker, that of the thesis one time in three."""
    found: Scene = {}
    if random.random() < 0.67:
        length = {
            'ground': random.uniform(0.33, 0.4), 'crank': random.uniform(0.03, 0.08),
            'coupler': random.uniform(0.28, 0.35), 'rocker': random.uniform(0.28, 0.35),
        }  # fmt: skip
        found |= {f'links.{n}.length': float(x) for n, x in length.items()}
        for n in ('crank', 'coupler', 'rocker'):
            found[f'links.{n}.cog'] = float(random.uniform(0.0, 0.9) * length[n])
            found[f'links.{n}.mass'] = decades(random, -1.0, 0.5)
            found[f'links.{n}.inertia'] = decades(random, -3.3, -2.0)
    if random.random() < 0.4:
        found['gravity'] = [0.0, 0.0]
    found['start'] = pick(random, ('seated', 'seated', 'centred'))
    return found


def add_drive(random: Random, found: Scene, kind: str, **how: Any) -> Draft:
    """The package's loose four-bar with these overrides and a drive."""
    keys, extent = drive(random, kind, **how)
    return Draft(variant('four_bar_clearance', found | {'drive': keys}), **extent)


def clearance(
    random: Random, friction: bool = False, finest: float = -6.0, most: float = 1.0
) -> Scene:
    """A rigid clearance: restitution up to `most`, hypothesis, 1 um to 2 mm of play, friction."""
    keys: Scene = {
        'radial': pick(random, (10.0**finest, 2e-3, *[decades(random, finest, -2.7)] * 4)),
        'restitution': min(most, pick(random, RESTITUTIONS)),
        'hypothesis': pick(random, RIGID),
    }
    if keys['restitution'] == 1.0:  # it bounces for ever, the more often the less play there is
        keys['radial'] = max(keys['radial'], 1e-4)
    if friction:
        keys['friction'] = pick(random, FRICTIONS)
        keys['pin_radius'] = pick(random, PIN_RADII)
    return keys


def compliant(random: Random, law: str, friction: bool) -> Scene:
    """A compliant clearance; an oil film for the law ``film``."""
    e = float(pick(random, (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)))
    if law == 'film':
        contact = {
            'law': law, 'viscosity': decades(random, -1.5, -0.7),
            'width': float(random.uniform(0.01, 0.03)),
            'radius': float(random.uniform(5e-3, 0.015)),
        }  # fmt: skip
        return {'radial': decades(random, -4.2, -3.7), 'restitution': e, 'contact': contact}
    exponent, stiffness = pick(random, SOFT)
    contact = {'law': law, 'stiffness': decades(random, *stiffness), 'exponent': exponent}
    keys = {
        'radial': decades(random, -5.0, -2.7),
        'restitution': max(e, 0.1) if law == 'flores' else e,
        'contact': contact,
    }
    if friction:
        keys['friction'] = pick(random, FRICTIONS[:8])
        keys['pin_radius'] = pick(random, PIN_RADII)
    return keys


def _loosen(clearances: Scene) -> Scene:
    """Overrides that make these joints loose, and no other."""
    return {'joints': {joint: {'clearance': keys} for joint, keys in clearances.items()}}


def _ideal(random: Random, k: int) -> Draft:
    kind = DRIVES[k % len(DRIVES)]
    found = base(random) | {'joints': None, 'branch': pick(random, ('open', 'crossed'))}
    if kind in ('constant', 'ramp', 'smooth') and random.random() < 0.3:
        found['outputs.forces'] = False
    return add_drive(random, found, kind)


def _rigid(random: Random, k: int) -> Draft:
    joint, kind = JOINTS[k // 6 % 4], DRIVES[k % 6]
    return add_drive(random, base(random) | _loosen({joint: clearance(random)}), kind)


def _frictional(random: Random, k: int) -> Draft:
    joint, kind = JOINTS[k // 6 % 4], DRIVES[k % 6]
    found = base(random) | _loosen({joint: clearance(random, friction=True)})
    return _limit_whirl(add_drive(random, found, kind))


def _limit_whirl(draft: Draft) -> Draft:
    """A run in which pins that friction lets roll go round their bushings not too often.

    They whirl ``R/c`` times as fast as the links turn, R being the radius of the pin.
    """
    plays = [joint['clearance'] for joint in draft.scene['joints'].values()]
    pins = [p['radial'] / max(p['pin_radius'], 1e-9) for p in plays if 'friction' in p]
    turns = _WHIRLS * min(pins, default=math.inf)
    if draft.revolutions is not None:
        return draft._replace(revolutions=min(draft.revolutions, turns))
    drive = draft.scene['drive']
    speeds = [rate for _, rate in drive.get('profile', {}).get('points', [])]
    fastest = max(map(abs, [*speeds, drive.get('speed', 0.0), 1.0]))
    duration = min(draft.duration or math.inf, 2.0 * math.pi / fastest * turns)
    return draft._replace(duration=duration)


def _several(random: Random, k: int) -> Draft:
    loose = ((0, 1), (1, 2), (2, 3), (0, 2), (1, 2, 3), (0, 1, 2, 3))[k // 4 % 6]
    kind, friction = DRIVES[0 if k % 4 < 3 else 3], k % 2 == 1
    # among others that rest, one without loss bounces for ever, however low
    play = {JOINTS[i]: clearance(random, friction, finest=-5.0, most=0.95) for i in loose}
    return _limit_whirl(add_drive(random, base(random) | _loosen(play), kind, speeds=(0.3, 1.9)))


def _soft(random: Random, k: int) -> Draft:
    law, friction = LAWS[k % 4], k // 4 % 3 == 2
    joint = JOINTS[2] if k % 3 else pick(random, JOINTS)
    kind = DRIVES[0] if k // 4 % 4 < 3 else pick(random, DRIVES)
    play = {joint: compliant(random, law, friction)}
    return add_drive(random, base(random) | _loosen(play), kind, speeds=(0.3, 2.0))


def _soft_several(random: Random, k: int) -> Draft:
    loose = ((1, 2), (2, 3), (0, 1, 2, 3))[k % 3]
    law = LAWS[k // 3 % 4]
    play = {JOINTS[i]: compliant(random, law, k % 2 == 0) for i in loose}
    return add_drive(random, base(random) | _loosen(play), 'constant', speeds=(0.5, 1.7))


def _film(random: Random, k: int) -> Draft:
    joint, kind = JOINTS[k % 4], DRIVES[(0, 1, 3)[k // 4 % 3]]
    play = compliant(random, 'film', friction=False)
    found = base(random) | _loosen({joint: play})
    draft = add_drive(random, found, kind, speeds=(0.7, 1.8))
    _supply(random, [draft.scene['joints'][joint]['clearance']])
    return draft


def _supply(random: Random, plays: Iterable[Scene]) -> None:
    """Pressures of the oil that films of half of the cases are fed with."""
    for play in plays:
        contact = play.get('contact', {})
        if contact.get('law') == 'film' and contact.get('cavitation') != 'none':
            rupture = pick(random, (0.0, 0.0, -1e5))
            above = pick(random, (0.0, 0.0, 0.0, 1e-3, decades(random, 2.0, 7.0), 1e12))
            contact['supply_pressure'] = rupture + above
            contact['cavitation_pressure'] = rupture


def _film_on_walls(random: Random, k: int) -> Draft:
    """Thin films whose rough walls touch, rigid or not; beside a dry joint, or others of oil.

    Steps of an explicit method go with ``viscosity radius (width/radial)^3`` [N s/m], which is
    bounded here: thin films are those of small bearings and thin oil.
    """
    soft, others = k % 3 == 2, k // 3 % 3
    known = random.permutation(len(JOINTS)).tolist()
    play = {}
    for i in known[: 2 if others == 2 else 1]:
        width, radius = float(random.uniform(0.005, 0.03)), float(random.uniform(2e-3, 0.015))
        viscosity = decades(random, -2.5, -0.7)
        radial = (viscosity * radius * width**3 / _DRAG) ** (1.0 / 3.0) * decades(random, 0.0, 0.7)
        contact: Scene = {
            'law': 'film', 'viscosity': viscosity, 'width': width, 'radius': radius,
            'roughness': radial * pick(random, (0.05, 0.1, 0.5, 0.9)),
            'cavitation': pick(random, ('guembel', 'guembel', 'none')),
        }  # fmt: skip
        if soft:
            contact |= {'stiffness': decades(random, 8.0, 10.0)}
        play[JOINTS[i]] = {
            'radial': radial,
            'restitution': pick(random, RESTITUTIONS[:-1]),
            'contact': contact,
            'friction': pick(random, (0.0, 0.1, 0.3)),
        }
    if others == 1:
        dry = JOINTS[known[2]]
        e = (
            compliant(random, pick(random, LAWS), friction=False)
            if soft
            else clearance(random, False)
        )
        play[dry] = e | {'restitution': min(e['restitution'], 0.9)}
    found = base(random) | _loosen(play)
    draft = add_drive(random, found, DRIVES[(0, 0, 1, 3)[k % 4]], speeds=(0.7, 1.8))
    _supply(random, (draft.scene['joints'][joint]['clearance'] for joint in play))
    return draft


def _start_in_bushing(random: Random, k: int) -> Draft:
    """A pin that starts anywhere in its bushing, at rates of its own."""
    found = base(random) | {'start': 'centred'}
    keys, extent = drive(random, DRIVES[0 if k % 3 else 3], speeds=(0.5, 2.0))
    play = clearance(random, friction=k % 2 == 1, finest=-4.5)
    scene = variant('four_bar_clearance', found | {'drive': keys})
    length = {n: _metres(link['length']) for n, link in scene['links'].items()}
    four_bar = FourBar(length['ground'], length['crank'], length['coupler'], length['rocker'])
    crank = (np.array([x]) for x in (keys['start_angle'], keys['speed'], 0.0))
    angles, rates, _ = four_bar.motion(*crank)
    position = dict(zip(('coupler', 'rocker'), angles[1:, 0].tolist(), strict=True))
    moved = pick(random, ('coupler', 'rocker'))
    off = float(random.uniform(-0.95, 0.95)) * play['radial'] / length[moved]
    initial: Scene = {'position': position | {moved: position[moved] + off}}
    if random.random() < 0.6:
        # a pin without friction goes round its bushing for ever: not many times in a run
        turns = 30.0 * play['radial'] / extent.get('duration', 0.5)
        initial['velocity'] = {
            n: float(rates[i, 0] + random.uniform(-turns, turns) / length[n])
            for i, n in enumerate(('coupler', 'rocker'), 1)
        }
    scene['joints'] = {'coupler_rocker': {'clearance': play}}
    scene['initial'] = initial
    return Draft(scene, **extent)


def _metres(value: float | str) -> float:
    return float(value.split()[0]) * 1e-3 if isinstance(value, str) else value


FAMILIES = (
    Family('four_bar_ideal', 60, _ideal, (), 6),
    Family('four_bar_rigid', 168, _rigid, NOT_SEATED, 24),
    Family('four_bar_friction', 168, _frictional, NOT_SEATED, 24),
    Family('four_bar_joints', 72, _several, NOT_SEATED, 24),
    Family('four_bar_compliant', 144, _soft, NOT_SEATED),
    Family('four_bar_compliant_joints', 24, _soft_several, NOT_SEATED),
    Family('four_bar_film', 24, _film, NOT_SEATED, 12),
    Family('four_bar_film_walls', 36, _film_on_walls, NOT_SEATED, 12),
    Family('four_bar_placed', 36, _start_in_bushing, (), 6),
)
