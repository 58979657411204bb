"""Drawing of runs by a room far above this one, which the package makes known here.

The engine knows nothing of pictures, and yet ``solution.plot()`` is where people look for them,
and notebooks ask objects themselves how to show them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pkgutil import resolve_name
from typing import Any

_places: dict[str, str] = {}


def register(**places: str) -> None:
    """Make known where to find, when first needed, what draws runs, shows objects, writes pages.

    Parameters
    ----------
    places : ``MODULE:FUNCTION`` by ``plot``, ``html``, ``report``, ``progress``
    """
    _places.update(places)


def _call(name: str, *given: Any, **how: Any) -> Any:
    return resolve_name(_places[name])(*given, **how)


def plot(run: Any, *names: Any, **how: Any) -> Any:
    """Draw a run; see `mechanism_sim.report.lines.plot`."""
    return _call('plot', run, *names, **how)


def report(*sources: Any, **how: Any) -> Any:
    """Write the page of a run; see `mechanism_sim.pages.writing.report`."""
    return _call('report', *sources, **how)


def progress(label: str, total: float) -> Callable[..., None] | None:
    """Shows how far long work is, in the cell of a notebook; None elsewhere."""
    known = 'ipykernel' in sys.modules and 'progress' in _places
    return _call('progress', label, total) if known else None


class Rich:
    """A table and a picture of an object for notebooks (`mechanism_sim.report.rich`)."""

    def _repr_html_(self) -> str | None:
        """HTML, a few tens of kilobytes; none where no room is known that makes it."""
        return str(_call('html', self)) if 'html' in _places else None
