"""Who draws runs: a room far above this one, which the package makes known here.

The engine knows nothing of pictures, and yet ``solution.plot()`` is where people look for them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Plot = Callable[..., Any]

_finders: list[Callable[[], Plot]] = []


def register_plot(find: Callable[[], Plot]) -> None:
    """Make known what finds, when it is first needed, the function that draws runs."""
    _finders[:] = [find]


def plot(run: Any, *names: str, **how: Any) -> Any:
    """Draw a run; see `mechanism_sim.report.lines.plot`."""
    return _finders[0]()(run, *names, **how)
