"""Basins of attraction: the response to which a start, or a pair of parameters, leads."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mechanism_sim.arguments import check_options, public
from mechanism_sim.errors import InputError
from mechanism_sim.scene import Machine, Source, load_scene
from mechanism_sim.scene.files import check_scene
from mechanism_sim.studies.bifurcation import (
    START,
    TURNS,
    Response,
    follow,
    read_response,
    same,
    section,
    varied,
)
from mechanism_sim.studies.parameters import Parameter, Vary, read_counted
from mechanism_sim.studies.runs import Call, Show, Workers
from mechanism_sim.tables import Column, Tabular
from mechanism_sim.units import unrounded

_NUMBER = re.compile(r'[-+]?\d[\d.]*(e[-+]?\d+)?')
"""Reasons why there is no response are one kind, whatever the numbers in them."""


@dataclass(frozen=True, eq=False, repr=False)
class Basins(Tabular):
    """The response at every place of a grid over two keys.

    Attributes
    ----------
    parameters : the keys, and `written` the unit of each and the size of 1 in it
    cells : (value of the first key, value of the second, response, its kind), in SI units; kinds
        are numbered from 0 in the order in which they are found
    """

    parameters: tuple[Parameter, Parameter]
    written: tuple[tuple[str, float], tuple[str, float]]
    cells: tuple[tuple[float, float, Response, int], ...]

    @property
    def kinds(self) -> dict[int, Response]:
        """A response of each kind."""
        found: dict[int, Response] = {}
        for _, _, response, kind in self.cells:
            found.setdefault(kind, response)
        return found

    def columns(self) -> list[Column]:
        """The columns of the table, a row for each place."""
        (a, (unit_a, in_a)), (b, (unit_b, in_b)) = zip(self.parameters, self.written, strict=True)
        first = Column(
            a.path, [unrounded(in_a * cell[0]) for cell in self.cells], unit_a, 'varied'
        )
        second = Column(
            b.path, [unrounded(in_b * cell[1]) for cell in self.cells], unit_b, 'varied'
        )
        return [
            first, second,
            Column('response', [cell[3] for cell in self.cells], '', 'kind of response'),
            Column('period', [cell[2].period for cell in self.cells], '',
                   'turns of the drive; 0: none found'),
            Column('impacts', [cell[2].impacts for cell in self.cells], '', 'per turn'),
        ]  # fmt: skip


@public
def basins(
    scene: Source,
    vary: Vary,
    *,
    at_impacts: str | None = None,
    workers: int | Workers | None = 1,
    show: Show | None = None,
    **when: int,
) -> Basins:
    """Run a machine from the starts, or with the parameters, of a grid over two keys.

    Where both keys are of ``initial`` the machine is the same everywhere, and responses are told
    apart by their sections; elsewhere by their periods.

    >>> import mechanism_sim as ms
    >>> e = 'joints.coupler_rocker.clearance.restitution'
    >>> vary = {'drive.speed': ('100 rpm', '110 rpm', 2), e: (0.4, 0.5, 2)}
    >>> found = ms.basins('four_bar_clearance', vary, transient=2, keep=4)
    >>> len(found.cells)
    4

    Parameters
    ----------
    vary : lowest and highest value, and their number, by dotted path, also as text
        ``'40 mm:60 mm:21'``; or texts ``PATH=LOW:HIGH:NUMBER``; two of them
    at_impacts, when : section, as for `bifurcation`
    """
    when = check_options(basins, when, TURNS)
    machine = load_scene(scene)
    ranges = read_counted('vary', vary)
    if len(ranges) != 2:
        raise InputError(f'basins: two keys are varied, not {len(ranges)}')
    (a, along_a, written_a), (b, along_b, written_b) = varied(machine, ranges)
    plan, _, _ = section(machine, (), at_impacts, when)
    content = machine.scene.to_document()
    places = [[{a.path: x, b.path: y} for y in along_b] for x in along_a]
    _check(machine.name, content, places)
    tasks = [
        Call(repr(x), follow, (machine.name, content, row, b.path, plan, START))
        for x, row in zip(along_a, places, strict=True)
    ]
    with Workers.of(workers) as makers:
        rows = makers.do_all(tasks, show)
    alike = all(path.startswith('initial.') for path in ranges)
    cells = [
        (x, y, read_response(each, len(plan.of)))
        for x, row in zip(along_a, rows, strict=True)
        for y, each in zip(along_b, row['responses'], strict=True)
    ]
    numbers = _kinds([cell[2] for cell in cells], alike)
    numbered = tuple((*cell, k) for cell, k in zip(cells, numbers, strict=True))
    return Basins((a, b), (written_a, written_b), numbered)


def _check(
    name: str, content: Mapping[str, Any], places: Sequence[Sequence[Mapping[str, float]]]
) -> None:
    """Refuse a grid of which neither the corners nor the middle can be, before anything runs."""
    middle = places[len(places) // 2]
    corners = [row[k] for row in (places[0], places[-1]) for k in (0, -1)]
    refused = []
    for change in [*corners, middle[len(middle) // 2]]:
        try:
            Machine(name, check_scene(name, content, change)).initial_state()
            return
        except InputError as error:
            refused.append(error)
    raise refused[0]


def _kinds(found: Sequence[Response], alike: bool) -> list[int]:
    """The kind of each response: of one machine by its section, of others by its period."""
    kinds: list[Response] = []
    numbers = []
    for response in found:
        number = next((k for k, x in enumerate(kinds) if _alike(x, response, alike)), len(kinds))
        if number == len(kinds):
            kinds.append(response)
        numbers.append(number)
    return numbers


def _alike(kind: Response, response: Response, one_machine: bool) -> bool:
    if kind.note or response.note:
        return _NUMBER.sub('', kind.note) == _NUMBER.sub('', response.note)
    if one_machine and response.period:
        return same(kind, response)
    return (kind.period, kind.settled) == (response.period, response.settled)
