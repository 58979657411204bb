"""A page whose tables of the thesis's experiment are made by the command.

A table stands between ``<!-- experiment: NAME -->`` and ``<!-- /experiment -->``. NAME is that of
a table, or ``summary``. Of a long one, ``NAME; COLUMN = VALUE`` has the rows with this value.
"""

from __future__ import annotations

import re
from pathlib import Path

from mechanism_sim import output
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.thesis.experiment import Experiment
from mechanism_sim.thesis.experiment_tables import ExperimentTable, summary, tables

_MARKED = re.compile(
    r'^(?P<begin><!-- experiment: (?P<name>[^\n]+?) -->\n).*?^(?P<end><!-- /experiment -->)$',
    re.M | re.S,
)


def read_page(option: str, path: str) -> tuple[Path, str]:
    """A page with marks, and that it can be written."""
    file = output.check_path(option, path, '.md')
    try:
        text = file.read_text(encoding='utf-8')
    except (OSError, UnicodeError) as error:
        raise InputError(f"{option} '{path}' cannot be read: {error}") from error
    if not _MARKED.search(text):
        raise InputError(
            f"{option} '{path}' has no place for a table: write lines '<!-- experiment: bearings "
            "-->' and '<!-- /experiment -->' where it shall stand"
        )
    return file, text


def renewed(text: str, found: Experiment) -> str:
    """The text of a page with its tables made anew."""
    known = {t.name: t for t in tables(found)}

    def made(mark: re.Match[str]) -> str:
        name, _, rows = mark['name'].partition('; ')
        if name not in known and mark['name'] != 'summary':
            names = ['summary', *known]
            raise InputError(
                f"the page asks for '{name}', a table that these runs do not give"
                f'{nearest(name, names)}; they give: {", ".join(names)}'
            )
        part = summary(found) if name == 'summary' else _chosen(known[name], rows).markdown()
        return f'{mark["begin"]}\n{part}\n\n{mark["end"]}'

    return _MARKED.sub(made, text)


def _chosen(table: ExperimentTable, rows: str) -> ExperimentTable:
    """A table with the rows that a page asks for: all if it does not say."""
    column, _, value = rows.rpartition(' = ')
    if not rows:
        return table
    if column not in table.columns:
        raise InputError(
            f"the page asks for rows of '{table.name}' by '{rows}': write 'COLUMN = VALUE'; the "
            f'columns are {", ".join(table.columns)}'
        )
    k = table.columns.index(column)
    if chosen := [row for row in table.rows if row[k] == value]:
        return table._replace(rows=chosen)
    raise InputError(f"'{table.name}' has no row with {rows}, which the page asks for")
