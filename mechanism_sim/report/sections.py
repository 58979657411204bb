"""Summaries as data, and their painters: sections of rows, a table and sentences.

A terminal, a notebook and a page show the same sections, so that a figure has one name and one
unit wherever people read it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import NamedTuple

from mechanism_sim import text_table
from mechanism_sim.text_table import Cell
from mechanism_sim.units import for_people, number

_MOST = 40  # rows of a section in a notebook


class SummaryRow(NamedTuple):
    """A figure of a summary."""

    label: str
    #: value and unit for the reader
    value: str
    unit: str = ''
    words: str = ''  #: text beside the value; may be empty

    @property
    def text(self) -> str:
        """The value with its unit and words."""
        value = f'{self.value} {self.unit}'.rstrip()
        return f'{value} ({self.words})' if self.words else value


def amount(label: str, value: float, unit: str, digits: int = 6, words: str = '') -> SummaryRow:
    """Row of a quantity, in a unit suitable for its magnitude."""
    shown, scale = for_people(unit, abs(value))
    return SummaryRow(label, number(scale * value, digits), shown, words)


@dataclass(frozen=True)
class Section:
    """Part of a summary."""

    title: str = ''  #: a line; empty if the section continues the one before
    rows: Sequence[SummaryRow] = ()  #: figures below each other
    table: Sequence[Sequence[Cell]] = ()  #: cells, the head first
    notes: Sequence[str] = ()  #: sentences
    left: int | Sequence[int] = 1  #: number or indices of left-aligned columns of the table

    def lines(self) -> Iterator[str]:
        """Lines of text."""
        if self.title:
            yield self.title
        yield from text_table.lines([(row.label, row.text) for row in self.rows], 2)
        yield from text_table.lines(self.table, self.left)
        yield from (f'  {note}' if self.title else note for note in self.notes)


def text(sections: Iterable[Section]) -> str:
    """Sections for a terminal, with an empty line before each title."""
    lines: list[str] = []
    for section in sections:
        lines += [''] * bool(section.title and lines) + [*section.lines()]
    return '\n'.join(lines)


def html(sections: Iterable[Section]) -> str:
    """Sections as tables for a notebook; of long ones the first rows."""
    parts = []
    for s in sections:
        cells = [*((row.label, row.text) for row in s.rows), *s.table]
        lines = [
            f'<tr>{"".join(f"<td>{escape(str(cell))}</td>" for cell in row)}</tr>'
            for row in cells[:_MOST]
        ]
        more = len(cells) - _MOST
        notes = [*s.notes, *([f'and {more} more rows'] if more > 0 else [])]
        said = ''.join(f'<p>{escape(note)}</p>' for note in notes)
        parts.append(f'<table>{"".join(lines)}</table>{said}')
    return ''.join(parts)
