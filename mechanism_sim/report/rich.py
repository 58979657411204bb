"""Machines, runs and cycles in notebooks: a picture and a summary."""

from __future__ import annotations

import base64
from html import escape
from io import BytesIO
from typing import Any

from mechanism_sim.analysis.record import Record
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.packages import refusal
from mechanism_sim.report import cycle, sections
from mechanism_sim.report.sections import Section, SummaryRow
from mechanism_sim.report.summary import facts
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.run import Piece
from mechanism_sim.scene import Machine
from mechanism_sim.scene.check import check

_WIDTH = 420  # [pixels] of a picture
_LARGEST = 60_000  # bytes of a picture


def html(shown: Any) -> str:
    """HTML of a machine, a run or a part of one, or a cycle; some tens of kilobytes."""
    if isinstance(shown, Cycle):
        return _page(repr(shown), _drawing(shown.machine), cycle.extremes(shown))
    if isinstance(shown, Piece):
        rows = facts(Record(shown.machine, shown, {})) if len(shown.motion) else ()
        return _page(repr(shown), _plot(shown), Section(rows=rows))
    if isinstance(shown, Record):
        return _page(repr(shown), _plot(shown.piece), Section(rows=facts(shown)))
    if isinstance(shown, Machine):
        known = [
            SummaryRow('level', shown.level.value),
            SummaryRow('coordinates', ', '.join(shown.physics.coordinates)),
            SummaryRow('joints', ', '.join(shown.physics.joints)),
        ]
        if shown.plan.clearances:
            known.append(SummaryRow('with clearance', ', '.join(shown.plan.clearances)))
        if shown.touching:
            known.append(SummaryRow('with stops or contacts', ', '.join(shown.touching)))
        return _page(
            f'{shown.name}: {shown.scene.title}',
            _drawing(shown),
            Section(rows=known, notes=check(shown).notes),
        )
    return f'<pre>{escape(repr(shown))}</pre>'


def _page(title: str, picture: str, *summary: Section) -> str:
    return f'<div><b>{escape(title.strip("<>"))}</b><br>{picture}{sections.html(summary)}</div>'


def _drawing(machine: Machine) -> str:
    try:
        from mechanism_sim.report.shown import draw  # noqa: PLC0415 - it imports pictures

        return _image(draw(machine))
    except Exception as error:
        if isinstance(error, InputError | RunError):  # it cannot be assembled
            return f'<p>{escape(str(error))}</p>'
        return _without(error)


def _plot(run: Piece) -> str:
    try:
        return _image(run.plot()) if len(run.motion) else ''
    except Exception as error:
        return _without(error)


def _without(error: Exception) -> str:
    """Text for a picture where the extra for pictures is missing, or cannot be used."""
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
