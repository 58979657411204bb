"""Reports, pictures, tables, drawings and films of a document, made by the commands for them."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable
from itertools import count
from pathlib import Path
from subprocess import PIPE, Popen
from threading import Thread
from typing import Any

from mechanism_sim import process_exit, strict_json
from mechanism_sim.catalogue import TABLE_FOLDERS
from mechanism_sim.editor.document import Document
from mechanism_sim.errors import InputError

FORMATS = {
    'report': ('.html', 'report'), 'page with sliders': ('_sliders.html', 'export'),
    'PNG': ('.png', 'draw'), 'SVG': ('.svg', 'draw'), 'CSV of a turn': ('.csv', 'cycle'),
    'DXF': ('.dxf', 'export'), 'film': ('.mp4', 'animate'),
}  # fmt: skip
"""Ends of names of files, and commands that write them."""


class FilesBeside:
    """Queue of files that are made in sequence, beside that of the document.

    Parameters
    ----------
    say : callback from another thread, with a sentence on a finished or failed file
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._process: Popen[str] | None = None

    def takes(self, message: Any, document: Document) -> bool:
        """Begin with the file that a message of a page requests; False if it requests none."""
        if message.get('type') != 'make':
            return False
        what = str(message.get('what'))
        try:
            self._make(document, what)
            self._say(f'{what}: it is being written …')
        except InputError as error:
            self._say(str(error))
        return True

    def _make(self, document: Document, what: str) -> None:
        if what not in FORMATS:
            raise InputError(f"there is no '{what}' to be made; there are: {', '.join(FORMATS)}")
        if self._process and self._process.poll() is None:
            raise InputError('the previous file is still being written: wait until it is done')
        end, command = FORMATS[what]
        folder = document.file.parent.resolve() if document.file else Path.cwd()
        names = (f'{document.name}{f"_{k}" if k else ""}{end}' for k in count())
        file = next(folder / name for name in names if not (folder / name).exists())
        text = strict_json.dumps(document.whole())  # with the tables to which it refers
        Thread(target=self._made, args=(command, document.name, text, file), daemon=True).start()

    def close(self) -> None:
        """End the command that is running."""
        if self._process:
            self._process.kill()

    def _made(self, command: str, name: str, text: str, file: Path) -> None:
        with tempfile.TemporaryDirectory() as folder:
            scene = Path(folder) / f'{name}.yaml'
            scene.write_text(text, 'utf-8')
            told = [command, '-o', str(file), '--', scene.name]
            # files of points that measures name are still found in the folder where this runs
            allowed = ['', *os.environ.get(TABLE_FOLDERS, '').split(os.pathsep)]
            env = os.environ | {TABLE_FOLDERS: os.pathsep.join(map(os.path.abspath, allowed))}
            self._process = process_exit.start(
                [sys.executable, '-m', 'mechanism_sim', *told],
                cwd=folder, env=env, stdout=PIPE, stderr=PIPE, text=True,
            )  # fmt: skip
            _, said = self._process.communicate()
        last = said.strip().rpartition('\n')[2].removeprefix('mechanism-sim: ')
        self._say(f'saved: {file}' if self._process.returncode == 0 else last)
