"""The graph: which nodes, publishers, subscriptions, services and clients there are.

A set of tokens, fed by one liveliness subscriber. A node declares an endpoint before the token
that announces it, and its endpoints one after the other: who sees a token can reach that endpoint
and every earlier one of its node.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable
from threading import Condition
from time import monotonic

from zenoh_rclpy.wire import NODE, Token, parse_token


class Graph:
    """Tokens alive, by kind and name. Safe to use from any thread."""

    def __init__(self) -> None:
        self._tokens: dict[str, Token] = {}
        self._named: dict[tuple[str, str], dict[str, Token]] = defaultdict(dict)
        self._changed = Condition()

    def add(self, key: str) -> bool:
        """Take in the token of a key; False if it is none."""
        token = parse_token(key)
        if token is None:
            return False
        with self._changed:
            self._tokens[key] = token
            self._named[token.kind, token.name][key] = token
            self._changed.notify_all()
        return True

    def remove(self, key: str) -> None:
        """Forget a token."""
        with self._changed:
            token = self._tokens.pop(key, None)
            if token is not None:
                named = self._named[token.kind, token.name]
                named.pop(key, None)
                if not named:
                    del self._named[token.kind, token.name]
                self._changed.notify_all()

    def find(self, kind: str, name: str) -> dict[str, Token]:
        """Endpoints of a kind on a topic or service, by their keys."""
        with self._changed:
            return dict(self._named.get((kind, name), {}))

    def count(self, kind: str, name: str, type_name: str | None = None) -> int:
        """Number of endpoints of a kind on a topic or service, of one type if it is given."""
        found = self.find(kind, name).values()
        return sum(type_name in {None, token.type} for token in found)

    def nodes(self) -> list[Token]:
        """Every node."""
        return list(self.find(NODE, '').values())

    def names_and_types(
        self, kinds: Iterable[str], of: Callable[[Token], bool] = lambda _: True
    ) -> list[tuple[str, list[str]]]:
        """Names of topics or services with their types, sorted."""
        wanted = set(kinds)
        found: dict[str, set[str]] = defaultdict(set)
        with self._changed:
            for token in self._tokens.values():
                if token.kind in wanted and of(token):
                    found[token.name].add(token.type)
        return [(name, sorted(types)) for name, types in sorted(found.items())]

    def wait_for(self, condition: Callable[[], bool], timeout: float | None) -> bool:
        """Wait until a condition on the graph holds; False if ``timeout`` [s] passes first."""
        end = None if timeout is None else monotonic() + timeout
        with self._changed:
            while not condition():
                left = None if end is None else end - monotonic()
                if left is not None and left <= 0:
                    return False
                # Bounded, because a condition may depend on more than the graph.
                self._changed.wait(0.05 if left is None else min(left, 0.05))
            return True
