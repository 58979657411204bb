"""Record of the threads that wait for other processes."""

import time
from threading import get_ident

STUCK = 0.1  # [s] after which a call counts as waiting for others


class Waits:
    """``with waits:`` around every call that may wait for another process."""

    def __init__(self) -> None:
        self._since: dict[int, float] = {}

    def __enter__(self) -> None:
        self._since[get_ident()] = time.monotonic()

    def __exit__(self, *_: object) -> None:
        self._since.pop(get_ident(), None)

    def here(self) -> bool:
        """Whether it is this thread that calls: what it does now happens inside that call."""
        return get_ident() in self._since

    def long(self) -> bool:
        """Whether some thread has been waiting for a while."""
        now = time.monotonic()
        return any(now - since > STUCK for since in list(self._since.values()))
