"""A machine in another place: turned, shifted, seen in a mirror, every key changed as it must be.

For tests that compare both. What a scene counts in the world (places, angles, gravity, forces)
moves with the machine, what it counts in the frame of a link only turns over in a mirror.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

from mechanism_sim.scene import Machine

Scene: TypeAlias = dict[str, Any]

GROUND = 'ground'
ORIGIN = 'moved_origin'
END = 'moved_end'
"""Points of the ground in the place of its start and its end."""

_TURNED = {'clockwise': 'counterclockwise', 'counterclockwise': 'clockwise',
           'left': 'right', 'right': 'left', 'above': 'below', 'below': 'above'}  # fmt: skip
_JOINED = 'revolute', 'prismatic', 'slot', 'arc_slot', 'fixed', 'contact', 'geneva', 'rack', 'cam'
_MOTOR = 'stall_torque', 'no_load_speed', 'ratio'


class Isometry(NamedTuple):
    """Rotation by an angle of the machine, or of its image in the x axis, then a shift."""

    angle: float = 0.0  #: [rad]
    sense: int = 1  #: -1 in a mirror
    shift: tuple[float, float] = (0.0, 0.0)  #: [m]

    def vector(self, v: Any) -> list[float]:
        """Of a vector of the world."""
        x, y = (number(part) for part in v)
        c, s, y = math.cos(self.angle), math.sin(self.angle), self.sense * y
        return [c * x - s * y, s * x + c * y]

    def point(self, p: Any) -> list[float]:
        """Of a place in the world [m]."""
        x, y = self.vector(p)
        return [x + self.shift[0], y + self.shift[1]]

    def own(self, v: Any) -> list[float]:
        """Of a vector in the frame of a link."""
        return [number(v[0]), self.sense * number(v[1])]

    def turned(self, angle: Any) -> float:
        """Of an angle against the world [rad]."""
        return self.sense * number(angle) + self.angle


def number(x: Any) -> float:
    """A number of a document, without its unit."""
    return float(x[0]) if is_quantity(x) else float(x)


def is_quantity(x: Any) -> bool:
    """True of a number with its unit."""
    return (
        isinstance(x, list | tuple) and len(x) == 2 and isinstance(x[0], float)
        and isinstance(x[1], str) and not re.search(r'[-+*(]', x[1])
    )  # fmt: skip


def substituted(formula: str, names: Mapping[str, str]) -> str:
    """A formula with other terms in the place of names, but for functions."""
    name = r'[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*(?![\w.]*\()'
    return re.sub(name, lambda found: names.get(found[0], found[0]), formula)


def moved(machine: Machine, by: Isometry) -> Scene:
    """The scene of a machine in another place; without its measures."""
    return _Mover(machine, by).scene


class _Mover:
    """The sections of a scene, one after the other."""

    def __init__(self, machine: Machine, by: Isometry) -> None:
        document = machine.scene.to_document(exclude_none=True)
        self._by, plan = by, machine.plan
        mechanisms = machine.mechanism, plan.ideal
        straight = {c for m in mechanisms for c in (*m.displacements, *m.deformations)}
        self._angles = {c for m in mechanisms for c in m.coordinates} - straight
        self._names = {f'{c}_rate': f'({by.sense}*{c}_rate)' for c in self._angles}
        self._names |= {c: f'({by.sense}*({c} - ({by.angle!r})))' for c in self._angles}
        self.scene = document | {'gravity': by.vector(document['gravity']), 'measures': {}}
        self._links(self.scene['links'])
        for joint in self.scene['joints'].values():
            self._joint(joint)
        for gear in self.scene['gears'].values():
            gear['at'] = self._place(gear['at'])
            gear['helix_angle'] *= by.sense
        for load in self.scene['loads'].values():
            self._load(load)
        for spring in self.scene['springs'].values():
            self._spring(spring)
        for state in self.scene['states'].values():
            state['rate'] = self._formula(state['rate'])
        self.scene['sensors'] = {}
        guess = dict.fromkeys(self._angles, by.angle) | self._places(self.scene['guess'])
        initial = self.scene['initial']
        initial['position'] = self._places(initial['position'])
        initial['velocity'] = {
            c: x if c not in self._angles else by.sense * number(x)
            for c, x in initial['velocity'].items()
        }
        for drive in [self.scene['drive']] if 'drive' in self.scene else []:
            self._drive(drive, plan.main, guess)
        for link, drive in self.scene['drives'].items():
            self._drive(drive, link, guess)
        self.scene['guess'] = guess
        self.scene = _written(self.scene)

    def _place(self, point: str) -> str:
        """The name of a point."""
        others = {GROUND: ORIGIN, f'{GROUND}.start': ORIGIN, f'{GROUND}.end': END}
        return f'{GROUND}.{others[point]}' if point in others else point

    def _places(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Angles, displacements and places of points."""
        found: dict[str, Any] = {}
        for name, x in values.items():
            if isinstance(x, list | tuple) and not is_quantity(x):
                found[self._place(name)] = self._by.point(x)
            else:
                found[name] = self._by.turned(x) if name in self._angles else x
        return found

    def _formula(self, x: Any, more: Mapping[str, str] = {}) -> Any:
        return f'({substituted(x, {**self._names, **more})})' if isinstance(x, str) else number(x)

    def _links(self, links: Scene) -> None:
        ground = links.setdefault(GROUND, {})
        ground['points'] = {n: self._by.point(p) for n, p in ground.get('points', {}).items()}
        ground['points'] |= {ORIGIN: self._by.point([0.0, 0.0])}
        if 'length' in ground:
            ground['points'][END] = self._by.point([ground.pop('length'), 0.0])
        for name, link in links.items():
            if name != GROUND:
                link['points'] = {n: self._by.own(p) for n, p in link['points'].items()}
                if isinstance(link.get('cog'), list | tuple):
                    link['cog'] = self._by.own(link['cog'])

    def _joint(self, joint: Scene) -> None:
        kind = next((k for k in _JOINED if k in joint), None)
        if kind is None:
            return
        first, second = (end.split('.')[0] for end in joint[kind])
        joint[kind] = [self._place(end) for end in joint[kind]]
        by = self._by
        between = by.angle * ((first == GROUND) - (second == GROUND))
        if kind in ('prismatic', 'fixed'):
            joint['angle'] = by.sense * number(joint['angle']) + between
        if kind in ('prismatic', 'slot'):
            carrier = first if kind == 'prismatic' else second
            joint['axis'] = by.sense * number(joint['axis']) + by.angle * (carrier == GROUND)
        if kind == 'cam':
            self._cam(joint, first)
        for lean in ((joint.get('clearance') or {}).get('misalignment') or {}).values():
            lean['direction'] = by.sense * number(lean['direction'])
        if kind == 'revolute' and 'stops' in joint:
            stops = joint['stops']
            ends = {n: stops.pop(n) for n in ('lower', 'upper') if n in stops}
            other = {'lower': 'upper', 'upper': 'lower'} if by.sense < 0 else {}
            stops |= {other.get(n, n): by.sense * number(x) + between for n, x in ends.items()}

    def _cam(self, joint: Scene, link: str) -> None:
        """Its law goes over the angle of its link in the world."""
        if link not in self._angles:
            return
        sense = joint.get('sense', 'counterclockwise')
        forward = 1 if sense == 'counterclockwise' else -1
        joint['phase'] = number(joint['phase']) - self._by.sense * forward * self._by.angle
        if self._by.sense < 0:
            joint['sense'] = _TURNED[sense]
            joint |= {'side': _TURNED[joint['side']]} if 'side' in joint else {}

    def _load(self, load: Scene) -> None:
        by, (dx, dy) = self._by, self._by.shift
        c, s = math.cos(by.angle), math.sin(by.angle)
        own = {  # the names of the point's place and rates where it was
            'vx': f'({c!r}*vx + ({s!r})*vy)',
            'vy': f'({by.sense}*({c!r}*vy - ({s!r})*vx))',
            'x': f'({c!r}*(x - ({dx!r})) + ({s!r})*(y - ({dy!r})))',
            'y': f'({by.sense}*({c!r}*(y - ({dy!r})) - ({s!r})*(x - ({dx!r}))))',
        }
        load['at'] = self._place(load['at'])
        x, y = (self._formula(part, own) for part in load['force'])
        if load['frame'] == 'link':
            c, s = 1.0, 0.0
        load['force'] = [
            f'({c!r})*({x}) + ({-s * by.sense!r})*({y})',
            f'({s!r})*({x}) + ({c * by.sense!r})*({y})',
        ]
        load['torque'] = f'{by.sense}*({self._formula(load["torque"], own)})'
        during = load.get('during')
        if during and during['coordinate'] in self._angles:
            ends = [by.turned(during[n]) for n in ('from', 'to')]
            during['from'], during['to'] = ends[:: by.sense]

    def _spring(self, spring: Scene) -> None:
        if 'rad' not in str(spring['stiffness']):
            spring['between'] = [self._place(p) for p in spring['between']]
            return
        first, second = spring['between']
        between = self._by.angle * ((first == GROUND) - (second == GROUND))
        spring['free_angle'] = self._by.sense * number(spring.get('free_angle', 0.0)) + between

    def _drive(self, drive: Scene, link: str, guess: dict[str, Any]) -> None:
        if link not in self._angles:
            return
        sense = self._by.sense
        if 'speed' in drive:
            drive['speed'] = sense * number(drive['speed'])
        if 'profile' in drive:
            points = drive['profile']['points']
            drive['profile']['points'] = [[t, sense * number(x)] for t, x in points]
        if 'torque' in drive:
            drive['torque']['constant'] *= sense
        motor = drive.get('motor', {})
        factors = {'ratio'} if 'induction' in motor else {*_MOTOR[:2]}
        motor |= {n: sense * motor[n] for n in factors if n in motor}
        if 'start_angle' in drive:
            drive['start_angle'] = self._by.turned(drive['start_angle'])
            guess.pop(link, None)


def _written(x: Any) -> Any:
    """A document in which quantities are text."""
    if isinstance(x, dict):
        return {key: _written(value) for key, value in x.items()}
    if is_quantity(x):
        return f'{x[0]!r} {x[1]}'.strip()
    return [_written(value) for value in x] if isinstance(x, list | tuple) else x
