"""The editor until somebody ends it: its page, its document, and runs in the background."""

from __future__ import annotations

import queue
import secrets
import sys
import time
import webbrowser
from collections.abc import Callable
from typing import Any

from mechanism_sim import ending, strict_json
from mechanism_sim.catalogue import scene_names
from mechanism_sim.errors import InputError
from mechanism_sim.pages.assets import contents_of, embedded
from mechanism_sim.pages.edit import palette
from mechanism_sim.pages.edit.background import Background
from mechanism_sim.pages.edit.document import Document
from mechanism_sim.pages.edit.session import Session
from mechanism_sim.pages.server import HOST, Server

MODULES = 'svg', 'stage', 'lens', 'player', 'canvas', 'fields', 'edit'
PORT = 8080

PAUSE = 0.1
"""[s] without an edit after which the document is checked and run, as it is dragged."""

_LOOK = 0.05  # [s] between looks at what runs
_COMMAND = 400_000  # bytes: a whole document, its quotes escaped


def edit(document: Document, port: int | None, browse: bool, opened: Callable[[str], None]) -> int:
    """Serve the page of a document until a signal ends it; exit code 0.

    Parameters
    ----------
    port : of this machine; None for 8080 or any other that is free
    opened : called with the address of the page

    Raises
    ------
    InputError
        If the port is out of range, not allowed or taken.
    """
    waiting: queue.Queue[tuple[str, Any]] = queue.Queue()
    key = secrets.token_urlsafe(16)
    greeting: list[dict[str, Any]] = []
    server = Server(
        contents_of('edit', MODULES, scenes=scene_names(),
                    tools=embedded(palette.to_json())),
        PORT if port is None else port, lambda: [*greeting],
        lambda message: waiting.put(('page', message)),
        read=lambda data: data if isinstance(data, dict) else None, key=key, largest=_COMMAND,
        name='edit',
    )  # fmt: skip
    try:
        if port and server.port != port:
            raise InputError(
                f'edit: port {port} of {HOST} is taken: choose another; 0 is any free'
            )
        runs = Background(lambda *found: waiting.put(('run', found)))
        session = Session(document, server.send)
        greeting[:] = session.greeting
        opened(f'{server.address}?key={key}')
        if browse:
            webbrowser.open(f'{server.address}?key={key}')
        with ending.working():
            _serve(session, runs, waiting, greeting)
    except KeyboardInterrupt:
        if session.document.changed:
            print('mechanism-sim: what was changed last is not saved', file=sys.stderr)
        return 0
    finally:
        server.close()
    return 0


def _serve(
    session: Session,
    runs: Background,
    waiting: queue.Queue[tuple[str, Any]],
    greeting: list[dict[str, Any]],
) -> None:
    """Do what pages ask for, and run the document whenever they pause."""
    ran, since = 0, time.monotonic()
    try:
        while True:
            try:
                kind, item = waiting.get(timeout=_LOOK)
            except queue.Empty:
                kind, item = '', None
            if kind == 'page':
                session.handle(_newest(item, waiting))
                since = time.monotonic()
            elif kind == 'run':
                number, what, text = item
                session.found(number, what, strict_json.loads(text))
            if kind:
                greeting[:] = session.greeting
            if not kind:
                session.pause()
                greeting[:] = session.greeting
            if session.number != ran and time.monotonic() > since + PAUSE:
                ran = session.number
                if job := session.job():
                    runs.submit(job)
            runs.look(session.job)
    finally:
        runs.close()


def _newest(message: dict[str, Any], waiting: queue.Queue[tuple[str, Any]]) -> dict[str, Any]:
    """A message of a page, or the last of those like it that follow at once: of drags."""
    while message.get('type') in ('drag', 'pull') and waiting.queue:
        kind, after = waiting.queue[0]
        if kind != 'page' or after.get('type') != message['type']:
            break
        message = waiting.get()[1]
    return message
