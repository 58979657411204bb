"""Session of an editor in a process of its own, whose failure leaves the document intact.

To draw a machine is to compile its closures, in milliseconds for most, and in minutes for a chain
of hundreds of links. The process that serves pages holds the document and waits for none of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

from mechanism_sim import process_exit, strict_json
from mechanism_sim.editor.document import Document
from mechanism_sim.editor.processes import LARGEST, cpu_time, crowded, work_unseen
from mechanism_sim.memory import resident
from mechanism_sim.packages import reason

PATIENCE = 15.0
"""[s] of CPU time for what a page asks for; then its process is ended, and that is not drawn."""

_BUSY = 4.0  # [s] of a busy machine, for a second of CPU time

_OUTDATED = 1.0  # [s] after which a picture is given up for one of a newer document

RETRY = 2.0
"""[s] until a process that could not be started is tried again."""

_NOT_STARTED = (
    'the drawing is not updated: its process cannot be started ({}); this is tried again, and '
    'later edits are drawn then'
)
_TOO_LONG = (
    f'it is not drawn: that takes longer than {PATIENCE:g} s; remove parts, or use the commands '
    'check and solve, which have no time limit'
)
_CANCELLED = 'it is not drawn: another document has replaced it'

Send = Callable[[str, int, str], None]


class Worker:
    """Worker that carries out the requests of pages one after the other.

    Parameters
    ----------
    document : copy of the session's document, updated with each of its changes
    send : callback with kind, state number and JSON text of a message to all pages
    opened : callback after another document has been opened
    """

    def __init__(self, document: Document, send: Send, opened: Callable[[Document], None]) -> None:
        self.document, self._send, self._opened = document, send, opened
        self.number = 0  #: state number of the document, as in `Session`
        self.job = None  #: last job reported by the session, to be checked and run
        self._heavy: dict[str, str] = {}  # reason by text that is not drawn
        self._since: float | None = None
        self._asked: tuple[str, Any] | None = None  # pending request, without any effect yet
        self._retried: tuple[str, Any] | None = None
        self._tried = False
        self.trouble = ''  #: reason why no process could be started; else empty
        self._chosen: Any = None  # selection and traced points of the session
        self._small = 0.0  # [MiB] memory of the new process
        self._process: Any = None
        self._link: Any = None
        self._start()

    @property
    def links(self) -> list[Connection]:
        """Connections that become readable when `take` has messages to read."""
        return [self._link] if self._link else []

    @property
    def busy(self) -> float:
        """Time for which the present task has been running [s]; 0 while the worker is idle."""
        return 0.0 if self._since is None else max(time.monotonic() - self._since, 1e-9)

    @property
    def grown(self) -> bool:
        """True if the process is idle and holds much more memory than when it was new."""
        if self.busy or self._process is None:
            return False
        size = resident(self._process.pid)
        self._small = self._small or size
        return size > max(LARGEST, 1.5 * self._small)

    def renew(self) -> None:
        """Replace the process; the new one continues with the present document."""
        self._again('')

    def ask(self, kind: str, item: Any = None) -> None:
        """Send a request to the process, which must be idle.

        Parameters
        ----------
        kind : ``page`` with a message of a page, ``found`` with the arguments of `Session.found`,
            ``pause``, ``job``
        """
        self._since, self._before = time.monotonic(), cpu_time(self._process.pid) or 0.0
        self._asked = kind, item
        try:
            self._link.send((kind, item))
        except OSError:
            self._again('', retry=True)

    def take(self) -> None:
        """Receive the messages of the process."""
        try:
            while self._link and self._link.poll():
                self._hear(*self._link.recv())
        except (EOFError, OSError):  # the process crashed or ran out of memory
            self._again(
                'it is not drawn: the drawing process has ended; the machine may be too large',
                True,
            )

    def look(self, outdated: bool) -> None:
        """End a request that takes too long or is outdated."""
        if self._process is None and self.busy > RETRY:
            self._start()
        if not self._begun:
            return
        if self.busy > PATIENCE and self._spends() > PATIENCE:
            self._again(_TOO_LONG)
        elif outdated and self.busy > _OUTDATED:
            self._again(_CANCELLED)

    def _spends(self) -> float:
        """CPU time [s] of the present request; at least a fraction of its elapsed time."""
        spent = cpu_time(self._process.pid)
        return self.busy / _BUSY if spent is None else max(spent - self._before, self.busy / _BUSY)

    def close(self) -> None:
        """End the process."""
        if self._process and self._link:
            self._process.kill()
            self._process.join()
            self._link.close()

    def _start(self) -> None:
        self._since, self._before, self._begun = time.monotonic(), 0.0, False
        self._process, self._link, self._small = None, None, 0.0
        context = get_context('spawn')
        ours: list[Connection] = []
        # The document is sent once the process reads: before that nothing reads, and a document
        # with its undo history is more than a pipe holds.
        # not a daemon in multiprocessing's sense, which `process_exit.follow` makes of it
        try:
            ours += context.Pipe()
            process = context.Process(target=_work, args=(ours[1],), daemon=True)
            with process_exit.signals_held():
                process.start()
        except OSError as error:  # no memory, processes or files: may be temporary
            for end in ours:
                end.close()
            before, self.trouble = self.trouble, _NOT_STARTED.format(reason(error))
            if not before:
                self._send('said', -1, strict_json.dumps({'type': 'said', 'text': self.trouble}))
            return
        self._process, self._link, self.trouble = process, ours[0], ''
        ours[1].close()

    def _again(self, why: str, retry: bool = False) -> None:
        """Restart the process with the last received document.

        `retry` : repeat the pending request of a page, if it had no effect yet
        """
        process, link = self._process, self._link
        process.kill()
        process.join()
        self._retried = None
        try:
            while link.poll():
                self._hear(*link.recv())
        except (EOFError, OSError):
            pass  # no further messages
        link.close()
        self.number += 1
        if why:
            self._heavy = {self.document.text: why}
        if retry and not self._tried and self._asked and self._asked[0] == 'page':
            self._retried = self._asked
        self._asked, self._tried = None, False
        self._start()

    def _hear(self, kind: str, *items: Any) -> None:
        if kind == 'page':
            self._send(*items)
        elif kind == 'document':
            self._asked = None
            change, value = items
            if change == 'opened':
                self.document = value
                self._opened(value)
            else:
                self.document.follow(change, value)
        elif kind == 'job':
            (self.job,) = items
        elif kind == 'begun':  # modules are loaded; the process is ready
            self._since, self._begun = time.monotonic(), True
            heavy = {text: why for text, why in self._heavy.items() if text == self.document.text}
            self._link.send((self.document, self.number, heavy, self._chosen))
        else:
            self.number, self._chosen = items
            self._since = self._asked = None
            again, self._retried = self._retried, None
            self._tried = again is not None
            if again:
                self.ask(*again)


def _work(link: Connection) -> None:
    """Carry out requests until the connection ends."""
    from mechanism_sim.editor.session import Session  # noqa: PLC0415 - here it is loaded
    from mechanism_sim.numerics.compiled import forget  # noqa: PLC0415

    work_unseen('draw')

    def send(message: dict[str, Any]) -> None:
        text = strict_json.dumps(message)
        link.send(('page', message['type'], message.get('number', -1), text))

    try:
        link.send(('begun',))
        document, number, heavy, chosen = link.recv()
        document.watch = lambda change, value: link.send(('document', change, value))
        session = Session(document, send, number, heavy, chosen)
        for message in session.greeting:
            send(message)
        for kind, item in _requests(link, session):
            try:
                if kind == 'page':
                    session.handle(item)
                elif kind == 'found':
                    number, what, text = item
                    session.found(number, what, strict_json.loads(text))
                elif kind == 'pause':
                    session.pause()
                    if crowded():
                        forget()
                else:
                    link.send(('job', session.job()))
            except (BrokenPipeError, EOFError):
                raise
            except Exception as error:
                send({'type': 'said', 'text': f'that cannot be shown ({reason(error)})'})
    except (BrokenPipeError, EOFError):
        return


def _requests(link: Connection, session: Any) -> Iterator[tuple[str, Any]]:
    while True:
        link.send(('idle', session.number, session.chosen))
        yield link.recv()
