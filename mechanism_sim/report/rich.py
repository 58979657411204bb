"""What notebooks show of machines, runs and cycles: a picture, and a table of what matters."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from io import BytesIO
from typing import Any

from mechanism_sim.analysis.record import Record
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.packages import refusal
from mechanism_sim.report.cycle import where
from mechanism_sim.report.facts import facts
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.solution import Piece
from mechanism_sim.scene import Machine
from mechanism_sim.scene.check import check
from mechanism_sim.units import for_people

_WIDTH = 420  # [pixels] of a picture
_ROWS = 40  # of a table
_LARGEST = 60_000  # bytes of a picture


def html(shown: Any) -> str:
    """HTML of a machine, a solution or a part of one, or a cycle; some tens of kilobytes."""
    if isinstance(shown, Cycle):
        return _page(repr(shown), _drawing(shown.machine), _extremes(shown))
    if isinstance(shown, Piece):
        rows = [*facts(Record(shown.machine, shown, {}))] if len(shown.motion) else []
        return _page(repr(shown), _plot(shown), rows)
    if isinstance(shown, Machine):
        return _page(f'{shown.name}: {shown.scene.title}', _drawing(shown), _machine(shown))
    return f'<pre>{escape(repr(shown))}</pre>'


def _page(title: str, picture: str, rows: Sequence[Sequence[str]]) -> str:
    lines = [
        f'<tr>{"".join(f"<td>{escape(cell)}</td>" for cell in row)}</tr>' for row in rows[:_ROWS]
    ]
    more = len(rows) - _ROWS
    note = f'<p>and {more} more rows</p>' if more > 0 else ''
    title = escape(title.strip('<>'))
    return f'<div><b>{title}</b><br>{picture}<table>{"".join(lines)}</table>{note}</div>'


def _machine(machine: Machine) -> list[tuple[str, ...]]:
    """Level, links and joints of a machine, and what `check` remarks."""
    report = check(machine)
    rows: list[tuple[str, ...]] = [('level', machine.level.value)]
    rows.append(('coordinates', ', '.join(machine.physics.coordinates)))
    rows.append(('joints', ', '.join(machine.physics.joints)))
    if machine.clearances:
        rows.append(('with clearance', ', '.join(machine.clearances)))
    rows += [('', note) for note in report.notes]
    return rows


def _extremes(cycle: Cycle) -> list[tuple[str, ...]]:
    """Least and greatest values, and where."""
    at = f'at {cycle.drive}'
    rows: list[tuple[str, ...]] = [('', 'unit', 'least', at, 'greatest', at)]
    for name, ends in cycle.extremes().items():
        if catalogue(cycle.machine).is_component(name):
            continue
        unit, scale = for_people(cycle.units().get(name, ''))
        low, high = (f'{scale * x.value:.6g}' for x in (ends.least, ends.greatest))
        rows.append((name, unit, low, where(cycle, ends.least), high, where(cycle, ends.greatest)))
    return rows


def _drawing(machine: Machine) -> str:
    try:
        from mechanism_sim.report.shown import draw  # noqa: PLC0415 - it imports pictures

        return _image(draw(machine))
    except Exception as error:
        if isinstance(error, InputError | RunError):  # it cannot be put together, and says so
            return f'<p>{escape(str(error))}</p>'
        return _without(error)


def _plot(run: Piece) -> str:
    try:
        return _image(run.plot()) if len(run.motion) else ''
    except Exception as error:
        return _without(error)


def _without(error: Exception) -> str:
    """What stands for a picture where the extra for pictures is missing, or cannot be used."""
    refused = refusal(error)
    if refused is None:
        raise error
    return f'<p>no picture: {escape(str(refused))}</p>'


def _image(figure: Any) -> str:
    """A picture of a bounded size."""
    for scale in (1.0, 0.6):
        buffer = BytesIO()
        density = scale * _WIDTH / figure.get_size_inches()[0]
        figure.savefig(buffer, format='png', dpi=density)
        if buffer.tell() <= _LARGEST:
            break
    data = base64.b64encode(buffer.getvalue()).decode('ascii')
    return f'<img width="{_WIDTH}" src="data:image/png;base64,{data}">'
