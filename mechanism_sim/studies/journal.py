"""Rows that a study has computed so far, on disk.

Beside the table that it makes lies a journal: one line of JSON for every finished run, written
through to the disk before the next is taken, so that whatever ends it costs the unfinished runs
only.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Collection
from importlib.metadata import version
from pathlib import Path
from typing import Any, Self

from mechanism_sim import output, process_exit, strict_json
from mechanism_sim.errors import InputError
from mechanism_sim.studies.runs import FinishedRows, RunResult, has_failed
from mechanism_sim.units import counted

_RULING = ('mechanism_sim', 'heyoka', 'numpy')
"""Packages whose version may change the last digit, and with it the impacts of a long run."""


class StudyInterrupted(KeyboardInterrupt):
    """End of a study by SIGINT or SIGTERM; the text contains how to resume it."""


class Journal(FinishedRows):
    """The finished runs of a study, on disk; `StudyInterrupted` of an interrupt in its block.

    Parameters
    ----------
    table : file of the table that the study makes; the journal is beside it
    plan : fingerprint of what is to be computed
    restart : forget what is there
    study : name of the study in messages
    size : number of its runs, where it is known before
    keys : keys of all its runs, if it continues from a journal of some of them, of any plan
    """

    def __init__(
        self,
        table: Path,
        plan: str,
        restart: bool = False,
        study: str = 'sweep',
        size: int | None = None,
        keys: Collection[str] | None = None,
    ) -> None:
        super().__init__()
        self._study, self._size = study, size
        self.path = journal_of(table)
        fresh = not self.path.exists() or restart
        if fresh and table.exists() and not restart:
            raise InputError(
                f"the table '{table}' exists already and has no journal to continue from: choose "
                'another name, or give --restart to replace it'
            )
        with output.errors_as_sentences(self.path):
            self._file = self.path.open('a+b')
        try:
            self._begin(plan, restart, keys)
        except InputError:
            self._file.close()
            raise

    def _begin(self, plan: str, restart: bool, keys: Collection[str] | None) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(f"another {self._study} is writing '{self.path}'") from error
        self._file.seek(0)
        whole, _, torn = (b'' if restart else self._file.read()).rpartition(b'\n')
        lines = whole.splitlines()
        if torn or restart:  # a line that was being written when all ended
            self._file.truncate(len(whole) + bool(whole))
        head = {'sweep': plan, **{name: version(name) for name in _RULING}}
        if not lines:
            self._append(head)
            return
        entries = [self._parse(line, n) for n, line in enumerate(lines, 1)]
        rows = {entry['key']: entry['row'] for entry in entries[1:]}
        known = entries[0].get('sweep') == plan or (keys is not None and rows.keys() <= {*keys})
        if entries[0] | {'sweep': plan} != head or not known:
            what = 'of another version of the software' if known else f'of another {self._study}'
            raise InputError(
                f"'{self.path}' is {what}: choose another name for the table, or give --restart "
                'to begin anew'
            )
        self.rows = {k: row for k, row in rows.items() if keys is None or k in keys}
        self.failed = sum(map(has_failed, self.rows.values()))

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
        """Store a finished run permanently."""
        self._append({'key': finished.key, 'cpu': finished.cpu, 'row': finished.row})
        super().add(finished)

    def _append(self, entry: dict[str, Any]) -> None:
        with output.errors_as_sentences(self.path):
            self._file.write(strict_json.dumps(entry).encode() + b'\n')
            self._file.flush()
            os.fsync(self._file.fileno())

    def __enter__(self) -> Self:
        process_exit.say_when_interrupted(self._kept)
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        process_exit.say_when_interrupted(None)
        with output.errors_as_sentences(self.path):
            self._file.close()
        if isinstance(error, KeyboardInterrupt):
            raise StudyInterrupted(self._kept()) from None

    def _kept(self) -> str:
        count = len(self.rows)
        runs = f'{count} of {self._size} runs' if self._size else counted(count, 'run')
        return (
            f"interrupted after {runs}, kept in '{self.path}'; the same command goes on from there"
        )


def journal_of(table: Path) -> Path:
    """The journal beside a table."""
    return table.with_name(f'{table.name}.journal')
