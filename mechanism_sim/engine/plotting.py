"""Drawing of runs by a package of a higher layer, which is registered here.

The engine knows nothing of pictures, and yet ``solution.plot()`` is where people look for them,
and notebooks ask objects themselves how to show them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import fields
from pkgutil import resolve_name
from typing import Any

_places: dict[str, str] = {}


def register(**places: str) -> None:
    """Register functions that draw runs, show objects and write pages, found when first needed.

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


def report() -> Callable[..., Any]:
    """Function that writes the page of a run, `mechanism_sim.pages.writing.report`."""
    found: Callable[..., Any] = resolve_name(_places['report'])
    return found


def progress(label: str, total: float) -> Callable[..., None] | None:
    """Function that shows the progress of long work in a notebook's cell; None elsewhere."""
    known = 'ipykernel' in sys.modules and 'progress' in _places
    return _call('progress', label, total) if known else None


class Rich:
    """A dataclass that notebooks show (`mechanism_sim.report.rich`) and pickles hold.

    A pickle or a copy has its fields only; what follows from them is made again when asked for:
    compiled equations stay in their process.
    """

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: vars(self)[f.name] for f in fields(self)}  # type: ignore[arg-type]

    def _repr_html_(self) -> str | None:
        """HTML, a few tens of kilobytes; None if no function for it is registered."""
        return str(_call('html', self)) if 'html' in _places else None
