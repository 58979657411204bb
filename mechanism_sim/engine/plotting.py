"""Drawing of runs by a room far above this one, which the package makes known here.

The engine knows nothing of pictures, and yet ``solution.plot()`` is where people look for them,
and notebooks ask objects themselves how to show them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import fields
from typing import Any

Plot = Callable[..., Any]

_finders: dict[str, Callable[[], Plot]] = {}


def register(**finders: Callable[[], Plot]) -> None:
    """Make known what finds, when first needed, what draws runs, shows objects, writes pages.

    Parameters
    ----------
    finders : by ``plot``, ``html``, ``report``, ``progress``
    """
    _finders.update(finders)


def plot(run: Any, *names: Any, **how: Any) -> Any:
    """Draw a run; see `mechanism_sim.report.lines.plot`."""
    return _finders['plot']()(run, *names, **how)


def report() -> Plot:
    """Function that writes the page of a run, `mechanism_sim.pages.writing.report`."""
    return _finders['report']()


def progress(label: str, total: float) -> Callable[..., None] | None:
    """Shows how far long work is, in the cell of a notebook; None elsewhere."""
    known = 'ipykernel' in sys.modules and 'progress' in _finders
    return _finders['progress']()(label, total) if known else None


class Rich:
    """A dataclass that notebooks show (`mechanism_sim.report.rich`) and pickles hold.

    A pickle or a copy has its fields only; what follows from them is made again when asked for:
    compiled equations stay in their process.
    """

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: vars(self)[f.name] for f in fields(self)}  # type: ignore[arg-type]

    def _repr_html_(self) -> str | None:
        """HTML, a few tens of kilobytes; none where no room is known that makes it."""
        return str(_finders['html']()(self)) if 'html' in _finders else None
