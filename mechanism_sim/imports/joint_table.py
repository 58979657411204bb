"""Mechanisms from coordinates of their joints: CSV tables, and addresses of PMKS+.

PMKS+ (https://github.com/PMKS-Web/PMKSWeb) lists for each joint its links. In present
addresses numbers are in base 64 and thousandths; addresses before July 2023 are the tables
themselves.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from urllib.parse import parse_qs, unquote, urlsplit

from mechanism_sim.csv_tables import read_csv
from mechanism_sim.errors import InputError
from mechanism_sim.imports.blueprint import Blueprint, names_of, unit_of
from mechanism_sim.packages import reason
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.units import to_si

_YES, _NO = ('t', 'true', 'yes', 'y', '1', 'x'), ('', 'f', 'false', 'no', 'n', '0', '-')
_DIGITS = '0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_-'
_UNITS = {'0': 'inch', '1': 'cm', '2': 'm'}  # of PMKS+
_COLUMNS = {
    'joint': ('joint id', 'joint', 'id', 'name', 'point'), 'x': ('x',), 'y': ('y',),
    'links': ('links', 'link'), 'kind': ('joint types', 'joint type', 'type'),
    'ground': ('ground', 'grounded', 'fixed'), 'angle': ('angle',), 'input': ('input', 'driver'),
}  # fmt: skip


class JointRow(NamedTuple):
    """A joint of a table: its position, and the links that it connects."""

    name: str
    at: Vector2
    links: tuple[str, ...]
    kind: str = 'R'  #: or P for a guide, RP for a pin of the first link in a slot of the second
    ground: bool = False
    angle: float = 0.0  #: direction of a guide or slot in the world [rad]
    input: bool = False
    carrier: str = ''  #: link with the guide, if not the ground


@dataclass
class JointTable:
    """A mechanism defined by its joints."""

    title: str
    unit: str
    rows: list[JointRow]
    #: names of joints by link, if the file has an order of its own
    order: Mapping[str, list[str]]
    #: speed of the input and its unit; sliding inputs in lengths per second
    speed: float = 10.0
    pace: str = 'rpm'
    swing: str = ''  #: formula of the input angle, instead of a speed

    def blueprint(self) -> Blueprint:
        """The machine. Links begin at the ground, or at their first joint."""
        made = Blueprint(self.title, self.unit)
        rows = {row.name: row for row in self.rows}
        members: dict[str, list[str]] = {}
        for row in self.rows:
            for link in row.links:
                members.setdefault(link, []).append(row.name)
        members.pop(GROUND, None)
        links, joints = names_of(members, 'links'), names_of(rows, 'joints')
        for link, own in members.items():
            order = self.order.get(link, own)
            order = sorted(order, key=lambda name: not _grounded(rows[name]))
            made.through(links[link], {joints[name]: rows[name].at for name in order})
            if len(own) == 1:
                made.notes.append(f'link {link} has one joint, {own[0]}: is the table complete?')
        for name, row in rows.items():
            self._join(made, joints[name], row, [links[x] for x in row.links if x != GROUND])
        return made

    def _join(self, made: Blueprint, joint: str, row: JointRow, links: list[str]) -> None:
        grounded = _grounded(row)
        if grounded:
            made.links[GROUND].points[joint] = row.at
            links = [GROUND, *links]
        first, *others = links
        for other in others:
            if row.kind == 'R':
                made.join(joint, 'revolute', (first, joint), (other, joint))
            elif row.kind == 'RP':
                pin, slot = (other, first) if grounded else (first, other)
                axis = row.angle - made.links[slot].pose[2]
                made.join(joint, 'slot', (pin, joint), (slot, joint), axis=f'{axis!r} rad')
            else:
                # a block with a single point has the direction of its guide
                block = made.links[other]
                if not any(map(any, block.points.values())):
                    block.pose = (*block.pose[:2], made.links[first].pose[2])
                angle = block.pose[2] - made.links[first].pose[2]
                axis = row.angle - made.links[first].pose[2]
                made.join(
                    joint, 'prismatic', (first, joint), (other, joint), axis=f'{axis!r} rad',
                    **({'angle': f'{angle!r} rad'} if angle else {}),
                )  # fmt: skip
        if row.input and grounded and others:
            if row.kind == 'P':
                made.drive(others[0], speed=f'{self.speed!r} {self.unit}/s')
            elif self.swing:
                made.drive(others[0], position=self.swing)
            else:
                start = f'{made.links[others[0]].pose[2]!r} rad'
                made.drive(others[0], speed=f'{self.speed!r} {self.pace}', start_angle=start)
        elif row.input and not grounded:
            made.notes.append(f'the input {row.name} turns two moving links: drives here turn one')


def _grounded(row: JointRow) -> bool:
    return row.ground or GROUND in row.links


def read_table(path: Path, _text: str, unit: str | None) -> Blueprint:
    """A table of joints as CSV: columns by name, with units in brackets behind them."""
    table = read_csv(path, 'import')
    place = {key: name for key, names in _COLUMNS.items() for name in table.cells
             if name.lower() in names}  # fmt: skip
    if missing := [key for key in ('joint', 'x', 'y', 'links') if key not in place]:
        raise InputError(
            f'{path.name}: there is no column {", ".join(missing)}; a table of joints begins as: '
            'Joint,X [mm],Y [mm],Links,Ground,Input'
        )
    own = [table.units[place[key]] for key in ('x', 'y')]
    for key, stated in zip(('x', 'y'), own, strict=True):
        where = f'{path.name}: column {place[key]}'
        try:
            to_si(f'1 {stated or "m"}', 'm')
        except ValueError as error:
            raise InputError(f'{where} {error}') from error
        unit_of(where, stated, unit)
    given = own[0] or own[1] or unit or ('cm' if 'Joint ID' in table.cells else '')
    if not given:
        raise InputError(f"{path.name}: the unit is missing: write 'X [mm]', or give --unit mm")
    size = to_si(f'1 {own[1] or given}', 'm') / to_si(f'1 {given}', 'm')
    empty = ('',) * len(table.lines)
    words = {key: table.column(place[key]) if key in place else empty for key in _COLUMNS}
    angle = [0.0] * len(empty)
    if any(x.strip(' 0.') for x in words['angle']):
        turn = to_si(f'1 {table.units[place["angle"]] or "deg"}', 'rad')
        angle = (table.numbers(place['angle'])[:, 0] * turn).tolist()

    def marked(key: str, k: int) -> bool:
        word = words[key][k].strip()
        if word.lower() not in (*_YES, *_NO):
            raise InputError(
                f"{path.name}, line {table.lines[k]}: {place[key]} = '{word}': yes or no"
            )
        return word.lower() in _YES

    rows = [
        JointRow(
            words['joint'][k].strip(), (x, y * size), _links(words['links'][k]),
            _kind(words['kind'][k]), marked('ground', k), angle[k], marked('input', k),
        )
        for k, (x, y) in enumerate(table.numbers(place['x'], place['y']).tolist())
    ]  # fmt: skip
    made = _checked(path.name, JointTable(path.stem, given, rows, {})).blueprint()
    others = [name for name in table.cells if name and name not in place.values()]
    made.notes += [f'column {name} is left out' for name in others]
    return made


def read_address(address: str, unit: str | None) -> Blueprint:
    """An address of PMKS+."""
    query = urlsplit(address.strip()).query
    fields = parse_qs(query, keep_blank_values=True)
    try:
        table = _listed(fields) if 'j' in fields else _packed(unquote(query))
    except (LookupError, ValueError) as error:
        raise InputError(
            f'this is not an address of a mechanism of PMKS+ ({reason(error)})'
        ) from error
    table.unit = unit_of('the address', table.unit, unit) or 'cm'
    made = _checked('the address', table).blueprint()
    made.notes.append('masses and forces of PMKS+ are left out')
    return made


_KINDS = {'': 'R', 'REVOLUTE': 'R', 'PIN': 'R', 'PRISMATIC': 'P', 'SLIDER': 'P', 'SLOT': 'RP'}


def _kind(text: str) -> str:
    kind = text.strip().upper()
    return _KINDS.get(kind, kind)


def _checked(where: str, table: JointTable) -> JointTable:
    known: set[str] = set()
    for row in table.rows:
        if row.kind not in ('R', 'P', 'RP'):
            raise InputError(
                f'{where}: joint {row.name} is of type {row.kind!r}, not R (revolute), '
                'P (prismatic) or RP (slot)'
            )
        if row.name in known:
            raise InputError(f'{where}: two joints have the name {row.name}')
        known.add(row.name)
        if not row.name or not row.links or not all(map(math.isfinite, (*row.at, row.angle))):
            raise InputError(f'{where}: the joint {row.name!r} needs a name, links and a place')
    if not any(len(row.links) + row.ground > 1 for row in table.rows):
        raise InputError(f'{where}: no joint connects two links')
    return table


def _links(text: str) -> tuple[str, ...]:
    """Links of a joint, with any separators."""
    found = tuple(x for x in re.split(r'[|;,/+\s]+', text) if x)
    return tuple(GROUND if x.lower() == GROUND else x for x in found)


def _listed(fields: dict[str, list[str]]) -> JointTable:
    """``j=ID,x,y,LINK|LINK,type,ground,angle,...,input``, a joint a line; ``l=`` lists links."""
    rows = []
    for line in filter(None, fields['j'][0].split('\n')):
        name, x, y, links, kind, ground, angle, *rest = line.split(',')
        flag = next((word for word in reversed(rest) if word), '')
        rows.append(
            JointRow(
                name, (float(x), float(y)), _links(links), kind, ground in _YES,
                float(angle or 0), flag in _YES,
            )
        )  # fmt: skip
    speed, clockwise, _, unit, *_ = [*fields.get('s', [''])[0].split(','), '', '', '', '']
    turning = float(speed or 10.0) * (-1.0 if clockwise == 'true' else 1.0)
    return JointTable('PMKS+ mechanism', unit, rows, {}, turning)


def _packed(query: str) -> JointTable:
    """``FLAGS.SCALE.SPEED,STEP.UNITS.JOINT.JOINT..LINK.LINK..FORCE..``, in base 64."""
    head, *lists = query.split('..')
    flags, _, numbers, units, *joints = head.split('.')
    clockwise = _integer(f'1{flags}') & 1  # first bit
    table = {}
    for joint in joints:
        name, _, x, y, turn, *slot = joint.split(',')
        bits = _DIGITS.index(name[0])
        place = _integer(x) / 1000.0, _integer(y) / 1000.0
        kind = 'P' if bits & 1 else 'R'
        table[name[1:]] = JointRow(
            name[1:], place, (), kind, bool(bits & 4), _integer(turn) / 1000.0, bool(bits & 2),
            *slot[:1],
        )  # fmt: skip
        if len(slot) >= 3:  # the slot has the direction between two joints of the link
            table[name[1:]] = table[name[1:]]._replace(input=False, links=tuple(slot[1:3]))
    order: dict[str, list[str]] = {}
    for link in filter(None, lists[0].split('.')):
        name, _, _, _, _, _, _, *rest = link.split(',')
        if name[0] == 'Y':  # others are parts of welded links
            order[name[2:]] = rest[: rest.index('')]
    rows = []
    for name, row in table.items():
        links = tuple(link for link, own in order.items() if name in own)
        angle = row.angle
        if row.carrier:
            a, b = (table[end].at for end in row.links)
            angle = math.atan2(b[1] - a[1], b[0] - a[0])
            order[row.carrier].append(name)
            links = (row.carrier, *links)
        rows.append(row._replace(links=links, angle=angle))
    speed = float(_integer(numbers.split(',')[0])) * (-1.0 if clockwise else 1.0)
    return JointTable('PMKS+ mechanism', _UNITS[units[0]], rows, order, speed)


def _integer(text: str) -> int:
    """A number in base 64; a leading 0 is a minus sign."""
    value = 0
    for digit in text:
        value = 64 * value + _DIGITS.index(digit)
    return -value if text[:1] == '0' else value
