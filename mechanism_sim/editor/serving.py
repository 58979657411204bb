"""Serving of the editor until it is ended: its page, its document and its worker.

This process holds the document and speaks with pages; it computes nothing that takes long.
"""

from __future__ import annotations

import copy
import os
import queue
import secrets
import time
import webbrowser
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from contextlib import suppress
from multiprocessing.connection import wait
from typing import Any

from mechanism_sim import process_exit, strict_json
from mechanism_sim.catalogue import scene_names
from mechanism_sim.editor import palette
from mechanism_sim.editor.background import Background
from mechanism_sim.editor.document import Document
from mechanism_sim.editor.files_beside import FORMATS, FilesBeside
from mechanism_sim.editor.recovery import UnsavedEdits
from mechanism_sim.editor.worker import Worker
from mechanism_sim.pages.assets import contents_of, embedded
from mechanism_sim.pages.server import PORT, Server
from mechanism_sim.terminal import print_notice

MODULES = (
    'html', 'svg', 'stage', 'lens', 'player', 'curves', 'wire', 'canvas', 'fields', 'wear', 'edit',
)  # fmt: skip

PAUSE = 0.1
"""[s] without an edit after which the document is checked and run, as it is dragged."""

SLOW = 0.4
"""[s] of work after which pages are told that something is computed."""

_LOOK = 0.05  # [s] polling interval of running tasks
_COMMAND = 400_000  # bytes: a whole document, its quotes escaped
_WAITING = 2_000, 16_000_000  # most queued messages of pages, and bytes; then a page is cut off
_ANEW = 'text', 'open', 'import', 'undo', 'redo'  # requests that replace the text
_FOLLOWED = 'drag', 'pull'  # only the last of a series counts


def edit(document: Document, port: int | None, browse: bool, opened: Callable[[str], None]) -> int:
    """Serve the page of a document until a signal ends it; exit code 0.

    Parameters
    ----------
    port : TCP port; None for 8080 or any free one
    opened : callback with the address of the page
    """
    key = secrets.token_urlsafe(16)
    desk = Desk(document)
    files = FilesBeside(desk.say)

    def put(message: Any) -> bool:
        return files.takes(message, desk.document) or desk.put(message)

    server = Server(
        contents_of('edit', MODULES, __package__, scenes=scene_names(),
                    tools=embedded(palette.to_json()), formats=[*FORMATS]),
        None if port == PORT else port, lambda: desk.greeting, put,
        read=lambda data: data if isinstance(data, dict) else None, key=key, largest=_COMMAND,
        name='edit',
    )  # fmt: skip
    try:
        opened(f'{server.address}?key={key}')
        if browse:
            webbrowser.open(f'{server.address}?key={key}')
        with process_exit.working():
            desk.serve(server.send_text)
    except KeyboardInterrupt:
        said = desk.keep()
        if desk.document.changed:
            kept = said or 'the next edit of this file brings it back'
            print_notice(f'the last changes are not saved; {kept}')
        return 0
    finally:
        files.close()
        server.close()
    return 0


class Desk:
    """Queue between the pages of an editor and the processes that draw and run its document."""

    def __init__(self, document: Document) -> None:
        self._todo: deque[tuple[str, Any]] = deque()
        self._came: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()
        self._waiting = 0  # approximate bytes of pending messages
        self._awake, self._wake = os.pipe()
        for end in (self._awake, self._wake):
            os.set_blocking(end, False)
        self._recovery = UnsavedEdits()
        self._keeper = ThreadPoolExecutor(1)  # a slow disk must not block
        self._keeping: Future[str] | None = None
        self._kept: tuple[Any, ...] | None = None
        self._found: dict[str, str] = {}
        self._number = -1
        self._busy = False
        self._since = time.monotonic()
        self._asked = self._paused = -1
        self._ran: tuple[int, Any] = -1, None
        self._notice = self._given_back(document)
        self._first = document
        self._worker: Worker | None = None

    @property
    def document(self) -> Document:
        """The document after the edits carried out so far."""
        return self._worker.document if self._worker else self._first

    @property
    def greeting(self) -> list[str]:
        """Messages for a page that has just been opened."""
        busy = [_busy(True)] if self._busy else []
        texts = self._notice, self._worker.trouble if self._worker else ''
        said = [strict_json.dumps({'type': 'said', 'text': x}) for x in texts if x]
        return [*self._found.values(), *busy, *said]

    def put(self, message: Any) -> bool:
        """Take a message of a page, from any thread; False if there are too many."""
        size = 200 + len(str(message))
        if self._came.qsize() > _WAITING[0] or self._waiting + size > _WAITING[1]:
            return False
        self._waiting += size
        self._came.put(('page', (size, message)))
        self._ring()
        return True

    def say(self, text: str) -> None:
        """Send a sentence to all pages, from any thread."""
        self._came.put(('said', text))
        self._ring()

    def keep(self) -> str:
        """Store unsaved edits on exit; a sentence if this fails."""
        self._keeper.shutdown()
        return self._recovery.keep(self.document)

    def serve(self, send: Callable[[str], None]) -> None:
        """Carry out requests of pages, and run the document when they pause."""
        self._send = send
        self._worker = worker = Worker(self._first, self._tell, self._opened)
        runs = Background(self._ran_so_far)
        try:
            while True:
                wait([*worker.links, self._awake], _LOOK)
                worker.take()
                self._sort()
                worker.look(any(m.get('type') in _ANEW for k, m in self._todo if k == 'page'))
                self._work(worker, runs)
                runs.look(lambda: worker.job)
                self._show_whether_busy(worker)
        finally:
            runs.close()
            worker.close()

    def _ring(self) -> None:
        with suppress(BlockingIOError):
            os.write(self._wake, b'.')

    def _ran_so_far(self, *found: Any) -> None:
        self._came.put(('found', found))
        self._ring()

    def _sort(self) -> None:
        """Queue received messages: only the last of successive drags or texts."""
        with suppress(BlockingIOError):
            os.read(self._awake, 4096)
        while not self._came.empty():
            kind, item = self._came.get()
            if kind == 'said':
                self._say(item)
                continue
            if kind == 'page':
                size, item = item
                self._waiting -= size
                self._since = time.monotonic()
                last = self._todo[-1] if self._todo else ('', {})
                same = last[0] == 'page' and last[1].get('type') == item.get('type')
                if same and item.get('type') in (*_FOLLOWED, 'text'):
                    self._todo.pop()
            self._todo.append((kind, item))
        while len(self._todo) > _WAITING[0]:  # the oldest are dropped
            self._todo.popleft()

    def _work(self, worker: Worker, runs: Background) -> None:
        """Give the worker the next request; if there is none, run or store the document."""
        if worker.busy:
            return
        if worker.grown and not self._drags:
            worker.renew()
            return
        if self._todo:
            kind, item = self._todo.popleft()
            if kind == 'page' and item.get('type') == 'wear':
                self._asked = -1  # unchanged document, new run
            worker.ask(kind, item)
            return
        job = worker.job
        if job is not None and self._ran != (job.number, job.worn) and job.number == worker.number:
            self._ran = job.number, job.worn
            runs.submit(job)
        if time.monotonic() < self._since + PAUSE:
            return
        self._keep_meanwhile()
        if self._asked != worker.number:
            self._asked = worker.number
            worker.ask('job')
        elif self._paused != worker.number:
            self._paused = worker.number
            worker.ask('pause')

    @property
    def _drags(self) -> bool:
        """True if a drag continues: another process would have to begin it anew."""
        return (
            bool(self._todo)
            and self._todo[0][0] == 'page'
            and (self._todo[0][1].get('type') in (*_FOLLOWED, 'drop'))
        )

    def _keep_meanwhile(self) -> None:
        """Save unsaved changes in a thread; report a failure of the last time."""
        if self._keeping:
            if not self._keeping.done():
                return
            if said := self._keeping.result():
                self._say(said)
            self._keeping = None
        document = self.document
        now = document.file, document.text, document.changed
        if now != self._kept:
            with suppress(RuntimeError):  # no thread available: try again later
                self._keeping = self._keeper.submit(self._recovery.keep, copy.copy(document))
                self._kept = now

    def _tell(self, kind: str, number: int, text: str) -> None:
        """Send a message of the worker to all pages, also to those opened later."""
        if kind == 'state':
            if number != self._number:
                self._found.clear()
                self._number = number
            self._found = {'state': text, **{k: x for k, x in self._found.items() if k != kind}}
        elif kind in ('checked', 'progress', 'run', 'worn', 'problem', 'forces'):
            self._found[kind] = text
        self._send(text)

    def _say(self, text: str) -> None:
        self._send(strict_json.dumps({'type': 'said', 'text': text}))

    def _show_whether_busy(self, worker: Worker) -> None:
        if 'state' in self._found and self._busy != (worker.busy > SLOW):
            self._busy = not self._busy
            self._send(_busy(self._busy))

    def _opened(self, document: Document) -> None:
        """Begin with another document that a page has opened."""
        if self._keeping:
            wait_for([self._keeping])  # belongs to the previous document
        text, self._notice = self._recovery.give_back(document)
        if text:
            self._todo.appendleft(('page', {'type': 'text', 'text': text}))
        if self._notice:
            self._say(self._notice)

    def _given_back(self, document: Document) -> str:
        """Restore unsaved edits of a document; a sentence if there are any."""
        text, said = self._recovery.give_back(document)
        if text:
            document.replace(text)
        return said


def _busy(whether: bool) -> str:
    return strict_json.dumps({'type': 'busy', 'busy': whether})
