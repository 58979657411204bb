"""The context of a process: one Zenoh session, shared by its nodes, and their common state.

**Router.** Peers find each other through a router and then talk directly. If none answers, the
first process opens one; whoever comes second connects to it. When that process ends, the links
between the others stay, and one of them opens a new router within a second or two, which the
others find: clients of a router, and whoever comes later, need one.

**Nothing is lost at the end.** ``close`` first stops to take in samples, then asks every other
process of this package for a sign of life that travels behind everything published so far, and
ends when all have answered: what was published has then been put into the queues of all their
subscriptions. Nodes of ROS cannot be asked; for them counts what Zenoh does at closing.
"""

import time
from contextlib import suppress
from itertools import count
from threading import Event, Thread
from typing import Any, Protocol

import zenoh

from ros_interfaces.definitions import type_hash
from ros_interfaces.refusals import Refusals, Warn
from zenoh_rclpy import config, wire
from zenoh_rclpy.arguments import Arguments
from zenoh_rclpy.callbacks import direct
from zenoh_rclpy.errors import MiddlewareError
from zenoh_rclpy.graph import Graph
from zenoh_rclpy.local import Local
from zenoh_rclpy.waits import Waits

FAREWELL = '@mechanism_sim'
ROUTER_PATIENCE = 5.0  # [s] for a router that accepts a connection to say who it is
FLUSH_PATIENCE = 60.0  # [s]
ROUTER_LOOK = 0.5  # [s] after which it is looked whether there is a router still
ASK_AGAIN = 5.0  # [s]: who left while he was asked never answers, and is not asked again


class Closable(Protocol):
    """A resource that a context closes when it ends."""

    def close(self) -> None:
        """Take in nothing more and let go whoever waits."""


class Context:
    """Session, graph and counters of a process. Raises MiddlewareError if there is no network."""

    def __init__(self, domain: int | None = None, arguments: Arguments | None = None) -> None:
        self.arguments = arguments or Arguments()
        self.domain = config.domain_id() if domain is None else domain
        router, self.session = _join()
        self._router = RouterKeeper(self.session, router)
        self.zid = str(self.session.zid())
        self.graph = Graph()
        self.is_open = True
        self.received = 0  # messages of other processes
        self.inboxes: set[Closable] = set()
        self.local = Local()
        self.refusals = Refusals()
        #: functions of the nodes that log warnings from Zenoh's threads
        self.warn_functions: list[Warn] = []
        self._kept: list[Any] = []
        self.waits = Waits(self._readers)
        self._hashed = config.has_type_hashes()
        self._ids = count()
        self._tokens: dict[str, zenoh.LivelinessToken] = {}
        self._sign = f'{FAREWELL}/{self.domain}/{self.zid}'
        self._farewell = self.session.declare_queryable(self._sign, direct(self._answer))
        self._watch = self.session.liveliness().declare_subscriber(
            f'{wire.TOKENS}/{self.domain}/**',
            direct(self._on_token),
            history=True,
        )

    def _readers(self, topic: str) -> list[str]:
        """Nodes of other processes that subscribe to a topic."""
        tokens = self.graph.find(wire.SUBSCRIPTION, topic).values()
        return sorted({token.node_name for token in tokens if token.session != self.zid})

    def next_id(self) -> int:
        """Id of a node or endpoint: one counter for the session, from 0."""
        return next(self._ids)

    def key(self, name: str, type_name: str) -> str:
        """Key of the data of a topic or service."""
        return wire.data_key(self.domain, name, type_name, self.hash_of(type_name))

    def hash_of(self, type_name: str) -> str:
        """Type hash as keys and tokens carry it."""
        return type_hash(type_name) if self._hashed else wire.NO_HASH

    def announce(self, token: wire.Token) -> str:
        """Declare the token of a node or endpoint; gives its key."""
        key = wire.token_key(self.domain, token)
        self._tokens[key] = self.session.liveliness().declare_token(key)
        self.graph.add(key)
        return key

    def retract(self, key: str) -> None:
        """Take a token back."""
        token = self._tokens.pop(key, None)
        if token is not None:
            self.undeclare(token)
        self.graph.remove(key)

    def undeclare(self, entity: Any) -> None:
        """Take an entity of the session off the network, unless the session has ended."""
        if self.is_open:
            entity.undeclare()

    def drop_at_the_end(self, publisher: Any) -> None:
        """Keep a publisher with a heartbeat until the session has ended.

        To undeclare it takes Python's lock and waits, up to 10 s, for a thread of Zenoh, which may
        wait for the lock to call us (eclipse-zenoh 1.10). Without a session it calls nobody.
        """
        self._kept.append(publisher)

    def flush(self, timeout: float = FLUSH_PATIENCE) -> bool:
        """Wait until every other process has in its queues what was published here.

        False if ``timeout`` [s] passes first.
        """
        end = time.monotonic() + timeout
        while True:
            left = max(0.0, end - time.monotonic())
            answers = self.session.get(
                f'{FAREWELL}/{self.domain}/*',
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                congestion_control=zenoh.CongestionControl.BLOCK,
                timeout=min(left, ASK_AGAIN),
            )
            found = [answer.ok for answer in answers]
            if None not in found:
                return True
            if left <= ASK_AGAIN:
                return False
            there = {self.zid, *(str(x.key_expr).rpartition('/')[2] for x in found if x)}
            silent = sorted({t.node_name for t in self.graph.nodes() if t.session not in there})
            self.waits.say_unread(', '.join(silent) or 'a program without nodes')

    def close(self, timeout: float = FLUSH_PATIENCE) -> bool:
        """End: no more samples in, what was published out (see ``flush``), session closed."""
        if not self.is_open:
            return True
        self._router.stop()
        self.waits.close()
        for inbox in list(self.inboxes):
            inbox.close()
        try:
            flushed = self.flush(timeout)
        finally:
            self.is_open = False
            ended = _close(self.session)
            if ended:
                self._kept.clear()
            if self._router.own is not None:
                _close(self._router.own)
        if not ended:
            raise MiddlewareError('the session cannot be closed: a process on the network hangs')
        return flushed

    def refuse(self, topic: str, kind: str, reason: str, warn: Warn | None = None) -> None:
        """Count what is dropped, and log a warning if it is time to."""
        warn_functions = [warn] if warn else self.warn_functions[:1]
        for function in warn_functions:
            self.refusals.count(topic, kind, reason, function)

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            query.reply(self._sign, b'')

    def _on_token(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        if sample.kind == zenoh.SampleKind.PUT:
            if not self.graph.add(key):
                self.refuse(f'{wire.TOKENS}/{self.domain}', 'token', f'{key[:200]!r} is no token')
        else:
            self.graph.remove(key)


class RouterKeeper:
    """Opens a router on this machine where that of another process has gone.

    Parameters
    ----------
    session : session of this process, with its known routers
    own : router of this process, if it has one; an attribute, too
    """

    def __init__(self, session: zenoh.Session, own: zenoh.Session | None) -> None:
        self._session, self.own = session, own
        self._stopped = Event()
        self._thread = Thread(target=self._look, daemon=True)
        if config.opens_router():
            self._thread.start()

    def stop(self) -> None:
        """Open none from now on."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join()

    def _look(self) -> None:
        while not self._stopped.wait(ROUTER_LOOK):
            # another process was faster, or no router can be had here: the links stay
            with suppress(zenoh.ZError, MiddlewareError):
                if self.own or self._session.info.routers_zid():
                    continue
                if not config.answers(config.router_endpoint()):
                    self.own = zenoh.open(config.router_config())


def _close(session: Any) -> bool:
    """Close a session; False if a peer that does not read held it up for 10 s."""
    try:
        session.close()
    except zenoh.ZError:
        return False
    return True


def _join() -> tuple[zenoh.Session | None, zenoh.Session]:
    """Own router, if one had to be opened, and session."""
    attempts = config.router_attempts()
    if config.connects_elsewhere() or (attempts is not None and attempts < 0):
        return None, _open()
    for _ in range(3):
        router = _find_or_open_router(config.router_endpoint(), attempts)
        session = _open()
        end = time.monotonic() + ROUTER_PATIENCE
        while time.monotonic() < end:
            if session.info.routers_zid():
                return router, session
            time.sleep(0.001)
        _close(session)
    raise MiddlewareError(f'The router at {config.router_endpoint()} comes and goes')


def _open() -> zenoh.Session:
    try:
        return zenoh.open(config.session_config())
    except zenoh.ZError as error:
        raise MiddlewareError(f'No Zenoh session can be opened: {error}') from error


def _find_or_open_router(endpoint: str, attempts: int | None) -> zenoh.Session | None:
    """Router opened here, None if one was there; waits for one as ``attempts`` says."""
    looked = 0
    while not _is_router(endpoint):
        looked += 1
        if attempts == 0 or (attempts is not None and looked < attempts):
            time.sleep(1.0)
            continue
        if not config.is_loopback(endpoint):
            raise MiddlewareError(
                f'No router answers at {endpoint}: start one there, or unset MECHANISM_SIM_ROUTER'
                ' to have one opened on this machine'
            )
        try:
            return zenoh.open(config.router_config())
        except zenoh.ZError as error:
            # Another process was faster, unless the port cannot be had at all.
            if not config.answers(endpoint):
                raise MiddlewareError(f'No router can be opened at {endpoint}: {error}') from error
    return None


def _is_router(endpoint: str) -> bool:
    """True if a router answers; MiddlewareError if something else does."""
    if not config.answers(endpoint):
        return False
    try:
        _close(zenoh.open(config.probe_config(ROUTER_PATIENCE)))
    except zenoh.ZError:
        if not config.answers(endpoint):
            return False
        raise MiddlewareError(
            f'{endpoint} is in use by something that is not a Zenoh router: stop it, or set'
            ' MECHANISM_SIM_ROUTER to another port, such as tcp/127.0.0.1:7448'
        ) from None
    return True
