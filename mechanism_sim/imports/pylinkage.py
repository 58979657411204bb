"""Linkages of pylinkage as JSON: its mechanisms of joints and links, and its older joints.

Source: `mechanism/serialization.py` and, before version 0.8, `linkage/serialization.py` of
https://github.com/HugoFara/pylinkage. It has no units: lengths are metres unless told otherwise.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mechanism_sim.imports.joint_table import JointRow, JointTable
from mechanism_sim.imports.sketch import Sketch
from mechanism_sim.planar.points import GROUND


def read(path: Path, text: str, unit: str | None) -> Sketch:
    """A linkage of either form."""
    data = json.loads(text)
    older = 'links' not in data
    rows, order, speed = _older(data) if older else _mechanism(data)
    title = str(data.get('name') or path.stem)
    made = JointTable(title, unit or 'm', rows, order, speed, 'rad/s').sketch()
    made.notes.append(f'without units in the file, lengths are in {unit or "m"}')
    if older:
        made.notes.append('a step of its crank is taken as a second')
    return made


def _mechanism(data: dict[str, Any]) -> tuple[list[JointRow], dict[str, list[str]], float]:
    order = {x['id']: list(x['joints']) for x in data['links'] if x['type'] != 'ground'}
    held = {j for x in data['links'] if x['type'] == 'ground' for j in x['joints']}
    driver = next((x for x in data['links'] if x['type'] in ('driver', 'arc_driver')), {})
    rows = []
    for joint in data['joints']:
        name, (x, y) = joint['id'], joint['position']
        if joint['type'] == 'tracker':
            ends = {joint['ref_joint1_id'], joint['ref_joint2_id']}
            owner = next(link for link, own in order.items() if ends <= {*own})
            order[owner].append(name)
        own = [link for link, joints in order.items() if name in joints]
        at, ground = (float(x), float(y)), joint['type'] == 'ground' or name in held
        if joint['type'] == 'prismatic':
            rows += _block(name, at, own, math.atan2(joint['axis'][1], joint['axis'][0]), '')
        else:
            turns = ground and driver.get('motor_joint') == name
            own.sort(key=lambda link: link != driver.get('id'))
            rows.append(JointRow(name, at, tuple(own), ground=ground, input=turns))
    return rows, order, float(driver.get('angular_velocity', 1.0))


def _older(data: dict[str, Any]) -> tuple[list[JointRow], dict[str, list[str]], float]:
    """Joints by what places them; a bar for each distance, a plate for three fixed joints."""
    joints = {j['name']: j for j in data['joints']}
    inline = [
        j[key] for j in data['joints'] for key in _PARENTS if (j.get(key) or {}).get('inline')
    ]
    joints |= {j['name']: {**j, 'type': 'Static'} for j in inline}
    members: dict[str, list[str]] = {GROUND: [n for n, j in joints.items() if _is(j, 'Static')]}
    guides: dict[str, tuple[str, float]] = {}
    motors: list[dict[str, Any]] = []
    for name, joint in joints.items():
        a, b, c = (_parent(joint, key) for key in _PARENTS)
        if _is(joint, 'Crank'):
            members[f'{a}_{name}'] = [a, name]
            motors.append({**joint, 'of': a})
        elif _is(joint, 'Fixed'):
            owner = next((x for x, own in members.items() if {a, b} <= {*own}), f'{a}_{b}_{name}')
            members.setdefault(owner, [a, b]).append(name)
        elif _is(joint, 'Revolute'):
            members |= {f'{end}_{name}': [end, name] for end in (a, b)}
        elif _is(joint, 'Linear'):
            members[f'{a}_{name}'] = [a, name]
            carrier = next(x for x, own in members.items() if {b, c} <= {*own})
            along = [float(joints[c][k]) - float(joints[b][k]) for k in 'xy']
            guides[name] = carrier, math.atan2(along[1], along[0])
    rows: list[JointRow] = []
    for name, joint in joints.items():
        at = float(joint['x']), float(joint['y'])
        own = [x for x, held in members.items() if name in held and x != GROUND]
        if name in guides:
            carrier, angle = guides[name]
            rows += _block(name, at, own, angle, '' if carrier == GROUND else carrier)
        else:
            turns = any(motor['of'] == name for motor in motors)
            rows.append(
                JointRow(name, at, tuple(own), ground=name in members[GROUND], input=turns)
            )
    speed = float(motors[0].get('angle') or 1.0) if motors else 1.0
    return rows, {x: own for x, own in members.items() if x != GROUND}, speed


_PARENTS = 'joint0', 'joint1', 'joint2'


def _is(joint: dict[str, Any], kind: str) -> bool:
    return str(joint['type']).rpartition('.')[2] == kind


def _parent(joint: dict[str, Any], key: str) -> str:
    found = joint.get(key) or {}
    return str(found.get('ref') or found.get('name') or '')


def _block(
    name: str, at: tuple[float, float], links: list[str], angle: float, carrier: str
) -> Iterator[JointRow]:
    """A pin on a block, and the guide of the block."""
    block = f'{name}_block'
    yield JointRow(name, at, (*links, block))
    guide = (carrier, block) if carrier else (block,)
    yield JointRow(f'{name}_guide', at, guide, 'P', not carrier, angle)
