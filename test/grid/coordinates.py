"""Machines between limits, with a joint too many, or started by their points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mechanism_sim.results.cycle import cycle
from mechanism_sim.results.run import Solution
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene
from test.grid.case import Draft, Family, Random, Scene

_G = [0.0, -9.81]


def _body(random: Random, length: float) -> Scene:
    mass = float(random.uniform(0.5, 3.0))
    return {'length': length, 'mass': mass, 'inertia': mass * length**2 / 12, 'cog': length / 2}


def _four_bar(random: Random) -> tuple[Scene, np.ndarray, float]:
    """A linkage none of whose links turns round, its lengths, and a crank angle within."""
    while True:
        lengths = random.uniform(0.3, 1.0, 4)
        order = np.sort(lengths)
        spare = order[1] + order[2] - order[0] - order[3]
        if spare < -0.02 and order[3] < 0.95 * order[:3].sum():
            break
    ground, crank, coupler, rocker = lengths.tolist()
    low, high = _limits(lengths)
    start = low + (high - low) * float(random.uniform(0.2, 0.8))
    scene: Scene = {
        'title': 'between limits',
        'mechanism': 'linkage',
        'gravity': _G,
        'links': {
            'ground': {'points': {'far': [ground, 0.0]}},
            'crank': _body(random, crank),
            'coupler': _body(random, coupler),
            'rocker': _body(random, rocker),
        },
        'joints': {
            'a': {'revolute': ['ground', 'crank']},
            'b': {'revolute': ['crank.end', 'coupler']},
            'c': {'revolute': ['coupler.end', 'rocker.end']},
            'd': {'revolute': ['rocker', 'ground.far']},
        },
        'drive': {'coordinate': 'crank', 'speed': 1.0, 'start_angle': start},
    }
    return scene, lengths, start


def _limits(lengths: np.ndarray) -> tuple[float, float]:
    """Crank angles by the law of cosines, between which it goes through 0 or 180 deg."""
    ground, crank, coupler, rocker = lengths
    ends = []
    for side in (abs(coupler - rocker), coupler + rocker):
        cosine = (ground**2 + crank**2 - side**2) / (2.0 * ground * crank)
        ends.append(math.acos(min(1.0, max(-1.0, cosine))))
    near, far = ends
    if near == 0.0:
        return -far, far
    return near, 2.0 * math.pi - near if far == math.pi else far


def _placed(scene: Scene, lengths: np.ndarray, start: float, side: float) -> Scene:
    """Its branch told by where the far end of the coupler is."""
    ground, crank, coupler, rocker = lengths
    pin = crank * np.array([math.cos(start), math.sin(start)])
    line = np.array([ground, 0.0]) - pin
    far = math.hypot(*line)
    along = (far**2 + coupler**2 - rocker**2) / (2.0 * far)
    across = side * math.sqrt(max(coupler**2 - along**2, 0.0))
    end = pin + along * line / far + across * np.array([-line[1], line[0]]) / far
    return {**scene, 'guess': {'coupler.end': end.round(4).tolist()}}


def _redundant(random: Random, k: int) -> Scene:
    """A crank, a rod and a block in two or three guides alike; driven or by a torque."""
    crank, rod = float(random.uniform(0.05, 0.2)), float(random.uniform(0.3, 0.6))
    lean, turned = random.uniform(-1.0, 1.0, 2)
    points = {f'p{i}': random.uniform(-0.2, 0.2, 2).tolist() for i in range(1 + k % 2)}
    drive: Scene = {'coordinate': 'crank', 'start_angle': float(random.uniform(0.3, 1.2))}
    drive |= {'torque': {'constant': 1.5}} if k % 4 < 2 else {'speed': 9.0}
    axis = np.array([math.cos(lean), math.sin(lean)])
    across = np.array([-axis[1], axis[0]])
    ground, joints = {'rail': (0.02 * across).tolist()}, {}
    for name, at in points.items():
        # where the guide holds the block turned, its points keep their distance from the first
        c, s = math.cos(lean + turned), math.sin(lean + turned)
        off = np.array([c * at[0] - s * at[1], s * at[0] + c * at[1]])
        ground[f'rail{name}'] = (np.array(ground['rail']) + off).tolist()
        joints[f'guide{name}'] = {
            'prismatic': [f'ground.rail{name}', f'block.{name}'], 'axis': lean,
            'angle': lean + turned,
        }  # fmt: skip
    reach = crank * math.cos(drive['start_angle'] - lean) + rod
    return {
        'title': 'guides',
        'mechanism': 'linkage',
        'gravity': _G,
        'links': {
            'ground': {'points': ground},
            'crank': _body(random, crank),
            'rod': _body(random, rod),
            'block': {'points': points, 'mass': 2.0, 'inertia': 0.02},
        },
        'joints': {
            'a': {'revolute': ['ground', 'crank']},
            'b': {'revolute': ['crank.end', 'rod']},
            'c': {'revolute': ['rod.end', 'block']},
            'guide': {
                'prismatic': ['ground.rail', 'block'], 'axis': lean, 'angle': lean + turned,
            },
            **joints,
        },
        'drive': drive,
        'guess': {'rod': lean, 'block': reach},
    }  # fmt: skip


def _arms(random: Random) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Two links free to move, started by place and rate of their end; angles and rates."""
    a, b = random.uniform(0.3, 1.0, 2).tolist()
    q = np.array([random.uniform(-3.0, 3.0), 0.0])
    q[1] = q[0] + float(random.choice([-1.0, 1.0])) * random.uniform(0.4, 2.6)
    v = random.uniform(-2.0, 2.0, 2)
    arm = np.array([a, b])
    place = [float(arm @ np.cos(q)), float(arm @ np.sin(q))]
    rate = [float(-arm @ (np.sin(q) * v)), float(arm @ (np.cos(q) * v))]
    scene: Scene = {
        'title': 'arms',
        'mechanism': 'linkage',
        'gravity': _G,
        'links': {'a': _body(random, a), 'b': _body(random, b)},
        'joints': {'p': {'revolute': ['ground', 'a']}, 'q': {'revolute': ['a.end', 'b']}},
        'guess': dict(zip('ab', (q + random.uniform(-0.1, 0.1, 2)).tolist(), strict=True)),
        'initial': {'position': {'b.end': place}, 'velocity': {'b.end': rate}},
    }
    return scene, q, v


def _drawn(random: Random, k: int) -> Draft:
    if k % 3 == 0:
        scene, lengths, start = _four_bar(random)
        scene = _placed(scene, lengths, start, float(random.choice([-1.0, 1.0])))
        low, high = _limits(lengths)
        return Draft(scene, duration=0.5 * min(start - low, high - start))
    if k % 3 == 1:
        return Draft(_redundant(random, k), duration=0.3)
    return Draft(_arms(random)[0], duration=0.5)


def _judge(random: Random, k: int, machine: Machine, solution: Solution) -> dict[str, float]:
    """Limits by closed form, motion and torque without the redundant guide, start by hand."""
    if k % 3 == 0:
        _, lengths, _ = _four_bar(random)
        found = machine.nominal.drive_range
        assert found is not None
        low, high = _limits(lengths)
        turned = 2.0 * math.pi * machine.plan.turned.get('crank', 0)
        worst = max(abs(found.low + turned - low), abs(found.high + turned - high))
        assert worst < 1e-9, worst
        ends = cycle(machine, samples=12)['position.crank'][[0, -1]]
        assert np.abs(ends - [low, high]).max() < 1e-9
        return {'limit': worst}
    if k % 3 == 1:
        scene = _redundant(random, k)
        scene['joints'] = {n: j for n, j in scene['joints'].items() if not n.startswith('guidep')}
        plain = build('plain', check_scene('plain', scene))
        assert machine.nominal.undetermined
        t = np.linspace(0.0, 0.3, 13)
        one, two = solution.sample(t), simulate(plain, duration=0.3).sample(t)
        names = [n for n in two if n.startswith(('position', 'reaction.a', 'reaction.c'))]
        off = {n: float(np.abs(one[n] - two[n]).max() / np.abs(two[n]).max()) for n in names}
        worst = max(off.values())
        assert worst < 1e-9, off
        return {'beside': worst}
    _, q, v = _arms(random)
    at: Any = machine.assembly
    worst = float(max(np.abs(np.angle(np.exp(1j * (at.q - q)))).max(), np.abs(at.v - v).max()))
    assert worst < 1e-9, worst
    return {'start': worst}


FAMILIES = (Family('coordinates', 60, _drawn, judge=_judge),)
