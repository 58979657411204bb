"""The web server of the live view: its page, and messages both ways, on this machine only.

Whoever sends what no page of ours would, or more than a hand can ask for, is cut off; the run and
the other pages do not notice.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
from collections.abc import Callable, Mapping, Sequence
from hmac import compare_digest
from http import HTTPStatus
from threading import Lock, Thread
from typing import Any, NamedTuple

from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

from mechanism_sim import strict_json
from mechanism_sim.errors import InputError
from mechanism_sim.terminal import print_notice

PORT = 8080
HOST = '127.0.0.1'
_SOCKET = '/live'
SLOW = 2_000_000
"""Bytes that wait for a page from which on it gets no more frames until it has taken them."""
STUCK = 4 * SLOW
"""Bytes that wait for a page from which on it is cut off."""
PAGES = 50
"""Greatest number of open pages."""
LARGEST = 10_000
"""Bytes of a command."""
_BURST, RATE = 300.0, 100.0
"""Commands a page may send at once, and [1/s] from then on: all sliders move at once at 20 Hz."""
_LARGEST_VALUE = 1e30
KINDS = 'play', 'pause', 'step', 'reset', 'set'

_POLICY = "default-src 'none'; script-src 'self' 'unsafe-inline'; style-src 'unsafe-inline'; "
_POLICY += "connect-src 'self'; img-src data: blob:; frame-ancestors 'none'; "
_POLICY += "base-uri 'none'; form-action 'none'"

Content = tuple[str, str]
"""Type and text of what is served at a path."""


class Command(NamedTuple):
    """Request of a page: one of `KINDS`; of ``set`` which control, and its value."""

    type: str
    path: str = ''
    value: float = 0.0


class Mailbox:
    """Commands that wait: of those that undo each other the newest only."""

    def __init__(self) -> None:
        self._waiting: dict[str, Command] = {}
        self._lock = Lock()

    def put(self, command: Command) -> None:
        """Add a command, from any thread."""
        subject = command.path or {'pause': 'play'}.get(command.type, command.type)
        with self._lock:
            self._waiting.pop(subject, None)
            self._waiting[subject] = command
            if len(self._waiting) > _BURST:
                del self._waiting[next(iter(self._waiting))]

    def take(self) -> Command | None:
        """The command that has waited longest; None if there is none."""
        with self._lock:
            first = next(iter(self._waiting), None)
            return None if first is None else self._waiting.pop(first)


class Server:
    """Serves a page and speaks with those who have it open, in a thread of its own.

    Parameters
    ----------
    contents : contents of the pages by path
    port : TCP port; 0 for any; None for 8080, or another with a notice if that is in use
    greet : messages for a page that has just been opened, or their texts
    hear : called, in the server's thread, with every command of a page; whatever it raises, or if
        it gives back False, the page is cut off
    read : the command that a message is, None if it is none
    key : required end ``?key=`` of the address of a page, if any
    largest : bytes of a command
    name : name of the command, for messages
    """

    def __init__(
        self,
        contents: Mapping[str, Content],
        port: int | None,
        greet: Callable[[], Sequence[dict[str, Any] | str]],
        hear: Callable[[Any], object],
        read: Callable[[Any], Any] | None = None,
        key: str = '',
        largest: int = LARGEST,
        name: str = 'view',
    ) -> None:
        self._contents, self._greet, self._hear = contents, greet, hear
        self._read, self._key, self._largest = read or _command_of, key, largest
        self._socket = _listening(port, name)
        self.port: int = self._socket.getsockname()[1]  #: port on which it listens
        self._pages: set[ServerConnection] = set()
        self._loop = asyncio.new_event_loop()
        self._end: asyncio.Event = asyncio.Event()
        self._thread = Thread(target=self._loop.run_until_complete, args=[self._serve()])
        self._thread.daemon = True
        self._thread.start()

    @property
    def address(self) -> str:
        """Address of the page for a browser."""
        return f'http://{HOST}:{self.port}/'

    @property
    def pages(self) -> int:
        """Number of open pages."""
        return len(self._pages)

    def send(self, message: dict[str, Any], may_drop: bool = False) -> None:
        """Send to all pages; `may_drop`: not to those with unsent earlier messages."""
        if self._pages:
            self.send_text(strict_json.dumps(message), may_drop)

    def send_text(self, text: str, may_drop: bool = False) -> None:
        """Send a message that is written already."""
        if self._pages:
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
            max_size=self._largest,
            close_timeout=1.0,
            logger=_silent(),
        ):
            await self._end.wait()

    def _answer(self, _connection: ServerConnection, request: Request) -> Response | None:
        path, _, query = request.path.partition('?')
        known = not self._key or compare_digest(query.encode(), f'key={self._key}'.encode())
        if path == _SOCKET and known and len(self._pages) < PAGES:
            return None
        kind, text = self._contents.get(path, ('text/plain', ''))
        status = HTTPStatus.OK if path in self._contents else HTTPStatus.NOT_FOUND
        if path == _SOCKET:
            status, text = HTTPStatus.SERVICE_UNAVAILABLE, f'{PAGES} pages are open already.\n'
            if not known:
                status, text = HTTPStatus.FORBIDDEN, 'Open the address that was printed.\n'
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
                text = message if isinstance(message, str) else strict_json.dumps(message)
                await page.send(text)
            await self._listen(page)
        except ConnectionClosed:
            pass  # as pages are, without a word
        finally:
            self._pages.discard(page)

    async def _listen(self, page: ServerConnection) -> None:
        """Receive messages of a page, until it goes or is sent away."""
        left, last = _BURST, self._loop.time()
        async for text in page:
            now = self._loop.time()
            left, last = min(_BURST, left + (now - last) * RATE) - 1.0, now
            if left < 0.0:
                await page.close(CloseCode.POLICY_VIOLATION, 'too many commands')
                return
            try:
                command = self._read(strict_json.loads(text))
            except ValueError:
                await page.close(CloseCode.INVALID_DATA, 'no JSON')
                return
            if command is None:
                await page.close(CloseCode.POLICY_VIOLATION, f'no command; known: {KINDS}')
                return
            try:
                heard = self._hear(command)
            except Exception:  # a page ends no server
                heard = False
            if heard is False:
                await page.close(CloseCode.POLICY_VIOLATION, 'too many commands')
                return

    def _send(self, text: str, may_drop: bool) -> None:
        waiting = {page: page.transport.get_write_buffer_size() for page in self._pages}
        for page, size in waiting.items():
            if size > STUCK:
                page.transport.abort()
        broadcast([page for page, size in waiting.items() if not may_drop or size < SLOW], text)


def _command_of(message: Any) -> Command | None:
    """The command that a message of a page is, if any."""
    if not isinstance(message, dict) or message.get('type') not in KINDS:
        return None
    kind = message['type']
    if kind != 'set':
        return Command(kind)
    path, value = message.get('path'), message.get('value')
    if not isinstance(path, str) or isinstance(value, bool) or not isinstance(value, int | float):
        return None
    if abs(value) > _LARGEST_VALUE:
        return None
    return Command(kind, path, float(value))


def _silent() -> logging.Logger:
    """Logger that discards complaints about malformed requests."""
    logger = logging.getLogger(__name__)
    logger.addHandler(logging.NullHandler())
    logger.propagate = False
    return logger


def _listening(wanted: int | None, name: str) -> socket.socket:
    """A socket on a port of this machine; None is `PORT`, or another if that is taken."""
    port = PORT if wanted is None else wanted
    if not 0 <= port <= 65535:
        raise InputError(
            f'{name}: the port must be between 0 and 65535, not {port}; 0 is any free'
        )
    try:
        return socket.create_server((HOST, port))
    except PermissionError as error:
        raise InputError(f'{name}: port {port} is for privileged programs: use 1024 on') from error
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise InputError(f'{name}: port {port} of {HOST}: {error.strerror}') from error
        if wanted is not None:
            raise InputError(
                f'{name}: port {port} of {HOST} is taken: choose another; 0 is any free'
            ) from error
        print_notice(f'port {port} is taken: another was chosen')
        return socket.create_server((HOST, 0))
