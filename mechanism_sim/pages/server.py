"""The web server of the live view: its page, and messages both ways, on this machine only."""

from __future__ import annotations

import asyncio
import errno
import json
import logging
import socket
from collections.abc import Callable, Mapping
from http import HTTPStatus
from threading import Thread
from typing import Any

from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from mechanism_sim.errors import InputError

HOST = '127.0.0.1'
SOCKET = '/live'
SLOW = 2_000_000
"""Bytes that wait for a page from which on it gets no more frames until it has taken them."""

_POLICY = "default-src 'none'; script-src 'self' 'unsafe-inline'; style-src 'unsafe-inline'; "
_POLICY += "connect-src 'self'; img-src data:; frame-ancestors 'none'"

Content = tuple[str, str]
"""Type and text of what is served at a path."""


class Server:
    """Serves a page and speaks with those who have it open, in a thread of its own.

    Parameters
    ----------
    contents : by path
    port : 0 for any; if it is taken, any other
    greet : messages for a page that has just been opened
    hear : called, in the server's thread, with every message of a page

    Attributes
    ----------
    port : on which it listens

    Raises
    ------
    InputError
        If the port is out of range or not allowed.
    """

    def __init__(
        self,
        contents: Mapping[str, Content],
        port: int,
        greet: Callable[[], list[dict[str, Any]]],
        hear: Callable[[dict[str, Any]], None],
    ) -> None:
        self._contents, self._greet, self._hear = contents, greet, hear
        self._socket = _listening(port)
        self.port: int = self._socket.getsockname()[1]
        self._pages: set[ServerConnection] = set()
        self._loop = asyncio.new_event_loop()
        self._end: asyncio.Event = asyncio.Event()
        self._thread = Thread(target=self._loop.run_until_complete, args=[self._serve()])
        self._thread.daemon = True
        self._thread.start()

    @property
    def address(self) -> str:
        """Where a browser finds the page."""
        return f'http://{HOST}:{self.port}/'

    @property
    def pages(self) -> int:
        """How many pages are open."""
        return len(self._pages)

    def send(self, message: dict[str, Any], may_drop: bool = False) -> None:
        """Send to all pages; `may_drop`: not to those that have not taken what came before."""
        if self._pages:
            text = json.dumps(message, allow_nan=False)
            self._loop.call_soon_threadsafe(self._send, text, may_drop)

    def close(self) -> None:
        """End it, and wait until it has ended."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._end.set)
            self._thread.join(5.0)

    async def _serve(self) -> None:
        own = [f'http://{name}:{self.port}' for name in (HOST, 'localhost')]
        async with serve(
            self._speak,
            sock=self._socket,
            # Another site's page may not command the machine; programs, which name none, may.
            origins=[*own, None],  # type: ignore[list-item]
            process_request=self._answer,
            compression=None,
            max_size=100_000,
            close_timeout=1.0,
            logger=_silent(),
        ):
            await self._end.wait()

    def _answer(self, _connection: ServerConnection, request: Request) -> Response | None:
        path = request.path.partition('?')[0]
        if path == SOCKET:
            return None
        kind, text = self._contents.get(path, ('text/plain', ''))
        status = HTTPStatus.OK if path in self._contents else HTTPStatus.NOT_FOUND
        body = text.encode() or b'There is nothing here.\n'
        headers = Headers(
            {
                'Content-Type': f'{kind}; charset=utf-8',
                'Content-Length': str(len(body)),
                'Content-Security-Policy': _POLICY,
                'X-Content-Type-Options': 'nosniff',
                'Cache-Control': 'no-store',
                'Connection': 'close',
            }
        )
        return Response(status.value, status.phrase, headers, body)

    async def _speak(self, page: ServerConnection) -> None:
        self._pages.add(page)
        try:
            for message in self._greet():
                await page.send(json.dumps(message, allow_nan=False))
            async for text in page:
                if heard := _read(text):
                    self._hear(heard)
        except ConnectionClosed:
            pass  # as pages are, without a word
        finally:
            self._pages.discard(page)

    def _send(self, text: str, may_drop: bool) -> None:
        waiting = {page: page.transport.get_write_buffer_size() for page in self._pages}
        broadcast([page for page, size in waiting.items() if not may_drop or size < SLOW], text)


def _read(text: str | bytes) -> dict[str, Any]:
    """What a page says; nothing where it is no message. Numbers are floats, however long."""
    try:
        message = json.loads(text, parse_int=float)
    except (ValueError, RecursionError):
        return {}
    return message if isinstance(message, dict) else {}


def _silent() -> logging.Logger:
    """For what strangers send who are no browser."""
    logger = logging.getLogger(__name__)
    logger.addHandler(logging.NullHandler())
    logger.propagate = False
    return logger


def _listening(port: int) -> socket.socket:
    """A socket on a port of this machine, or on another if that is taken."""
    if not 0 <= port <= 65535:
        raise InputError(f'view: the port must be between 0 and 65535, not {port}; 0 is any free')
    try:
        return socket.create_server((HOST, port))
    except PermissionError as error:
        raise InputError(f'view: port {port} is for privileged programs: use 1024 on') from error
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise InputError(f'view: port {port} of {HOST}: {error.strerror}') from error
        return socket.create_server((HOST, 0))
