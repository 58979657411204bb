"""Mechanisms of pylinkage as JSON.

Source: `mechanism/serialization.py` of https://github.com/HugoFara/pylinkage, version 1.3. It has
no units: lengths are metres unless a unit is given.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mechanism_sim.errors import InputError
from mechanism_sim.imports.blueprint import Blueprint
from mechanism_sim.imports.joint_table import JointRow, JointTable


def read(path: Path, text: str, unit: str | None) -> Blueprint:
    """A mechanism of joints and links."""
    data = json.loads(text)
    if not isinstance(data, dict) or not {'joints', 'links'} <= data.keys():
        raise InputError(
            f'{path.name} has no joints and links, as mechanisms of pylinkage have: write those '
            'by its mechanism_to_json; its graphs have no lengths'
        )
    # joints, their order on each link, and the driven link
    order = {x['id']: list(x['joints']) for x in data['links'] if x['type'] != 'ground'}
    held = {j for x in data['links'] if x['type'] == 'ground' for j in x['joints']}
    driver: dict[str, Any] = next(
        (x for x in data['links'] if x['type'] in ('driver', 'arc_driver')), {}
    )
    rows: list[JointRow] = []
    for joint in data['joints']:
        name, (x, y) = joint['id'], joint['position']
        if joint['type'] == 'tracker':
            ends = {joint['ref_joint1_id'], joint['ref_joint2_id']}
            owner = next(link for link, own in order.items() if ends <= {*own})
            order[owner].append(name)
        own = [link for link, joints in order.items() if name in joints]
        at, ground = (float(x), float(y)), joint['type'] == 'ground' or name in held
        if joint['type'] == 'prismatic':
            rows += _block(name, at, own, math.atan2(joint['axis'][1], joint['axis'][0]))
        else:
            turns = ground and driver.get('motor_joint') == name
            own.sort(key=lambda link: link != driver.get('id'))
            rows.append(JointRow(name, at, tuple(own), ground=ground, input=turns))
    title = str(data.get('name') or path.stem)
    speed = float(driver.get('angular_velocity', 1.0))
    table = JointTable(title, unit or 'm', rows, order, speed, 'rad/s')
    if driver.get('type') == 'arc_driver':
        table.swing = _swing(driver, speed)
    made = table.blueprint()
    made.notes.append(
        f'without units in the file, lengths are in {unit or "m"}, and a step is a second'
    )
    if table.swing:
        made.notes.append(
            f'{driver["id"]} swings as a cosine in the same time: at the ends of its arc it would '
            'turn back at once, which no drive can follow'
        )
    return made


def _swing(driver: dict[str, Any], speed: float) -> str:
    """The angle of a link that oscillates over an arc, at this mean speed [rad/s]."""
    low, high = float(driver['arc_start']), float(driver['arc_end'])
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    start = low if (angle := driver.get('initial_angle')) is None else float(angle)
    if not (half > 0.0 and abs(start - middle) <= half * (1.0 + 1e-9)):
        raise InputError(
            f'{driver["id"]}: its initial_angle {start:g} is not within an arc that goes from '
            f'arc_start {low:g} up to arc_end {high:g} rad'
        )
    begin = math.acos(min(max((middle - start) / half, -1.0), 1.0))
    rate = 0.5 * math.pi * speed / half
    return f'{middle!r} rad - {half!r} rad*cos({rate!r} rad/s*t + {begin!r} rad)'


def _block(
    name: str, at: tuple[float, float], links: list[str], angle: float
) -> Iterator[JointRow]:
    """A pin on a block, and the guide of the block on the ground."""
    block = f'{name}_block'
    yield JointRow(name, at, (*links, block))
    yield JointRow(f'{name}_guide', at, (block,), 'P', ground=True, angle=angle)
