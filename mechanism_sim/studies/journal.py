"""What a sweep has computed so far, and the table it ends as.

Beside the table lies a journal: one line of JSON for every finished run, written through to the
disk before the next is taken, so that whatever ends a sweep costs the unfinished runs only.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, Self

from mechanism_sim import output, strict_json, tables
from mechanism_sim.errors import InputError
from mechanism_sim.studies.figures import FIGURES
from mechanism_sim.studies.labels import label_columns
from mechanism_sim.studies.plan import Plan
from mechanism_sim.studies.row import RunResult, Value
from mechanism_sim.tables import Column

_RULING = ('mechanism_sim', 'heyoka', 'numpy')
"""Packages whose version may change the last digit, and with it the impacts of a long run."""


class Journal:
    """The finished runs of a sweep, on disk.

    Parameters
    ----------
    table : file of the table that the sweep makes; the journal is beside it
    plan : the sweep
    restart : forget what is there

    Attributes
    ----------
    rows : figures of the finished runs by key
    """

    def __init__(self, table: Path, plan: Plan, restart: bool = False) -> None:
        self.path = journal_of(table)
        self.rows: dict[str, dict[str, Value]] = {}
        fresh = not self.path.exists() or restart
        if fresh and table.exists() and not restart:
            raise InputError(
                f"the table '{table}' exists already and has no journal to go on from: choose "
                'another name, or give --restart to replace it'
            )
        with output.errors_as_sentences(self.path):
            self._file = self.path.open('a+b')
        try:
            self._begin(plan, restart)
        except InputError:
            self._file.close()
            raise

    def _begin(self, plan: Plan, restart: bool) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(f"another sweep is writing '{self.path}'") from error
        self._file.seek(0)
        whole, _, torn = (b'' if restart else self._file.read()).rpartition(b'\n')
        lines = whole.splitlines()
        if torn or restart:  # a line that was being written when all ended
            self._file.truncate(len(whole) + bool(whole))
        head = {'sweep': plan.fingerprint, **{name: version(name) for name in _RULING}}
        if not lines:
            self._append(head)
            return
        entries = [self._parse(line, n) for n, line in enumerate(lines, 1)]
        if entries[0] != head:
            same = entries[0].get('sweep') == head['sweep']
            what = 'of another version of the software' if same else 'of another sweep'
            raise InputError(
                f"'{self.path}' is {what}: choose another name for the table, or give --restart "
                'to begin anew'
            )
        self.rows = {entry['key']: entry['row'] for entry in entries[1:]}

    def _parse(self, line: bytes, number: int) -> dict[str, Any]:
        try:
            entry = strict_json.loads(line)
            if isinstance(entry, dict) and (number == 1 or {'key', 'row'} <= entry.keys()):
                return entry
        except ValueError:
            pass
        raise InputError(
            f"line {number} of '{self.path}' is damaged: give --restart to begin anew"
        )

    def add(self, finished: RunResult) -> None:
        """Keep a finished run, whatever happens from now on."""
        self._append({'key': finished.key, 'cpu': finished.cpu, 'row': finished.row})
        self.rows[finished.key] = finished.row

    def _append(self, entry: dict[str, Any]) -> None:
        with output.errors_as_sentences(self.path):
            self._file.write(strict_json.dumps(entry).encode() + b'\n')
            self._file.flush()
            os.fsync(self._file.fileno())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_failure: object) -> None:
        with output.errors_as_sentences(self.path):
            self._file.close()


def journal_of(table: Path) -> Path:
    """The journal beside a table."""
    return table.with_name(f'{table.name}.journal')


def write_table(file: Path, plan: Plan, rows: Sequence[dict[str, Value]]) -> None:
    """Write the table, a row for each run in the order of the plan, all at once.

    Columns: ``run``, the swept values, the figures of `FIGURES`, those of the scene's own joints,
    drives and measures, ``steps``, ``digest``, ``status``, with units and meanings.
    """
    figures = [
        Column(c.name, [row.get(c.name) for row in rows], c.unit, c.meaning)
        for c in (*FIGURES, *plan.own)
    ]
    last = [Column(n, [row.get(n) for row in rows]) for n in ('steps', 'digest', 'status')]
    about = {'sweep': plan.name, 'title': plan.title}
    tables.write(file, [*label_columns(plan), *figures, *last], about)
