"""A machine that plays in a notebook."""

from __future__ import annotations

from html import escape

from mechanism_sim.analysis.record import Record
from mechanism_sim.hybrid.solution import Piece
from mechanism_sim.pages import report
from mechanism_sim.pages.charts import sections
from mechanism_sim.pages.recorded import recorded
from mechanism_sim.scene import Machine, simulate


class Player:
    """The page of a run, in a frame of its own.

    Attributes
    ----------
    page : the HTML of the page
    height : of the frame [pixels]
    """

    def __init__(self, page: str, height: int, title: str) -> None:
        self.page, self.height, self._title = page, height, title

    def __repr__(self) -> str:
        return f'<{self._title}, to be played>'

    def _repr_html_(self) -> str:
        """A frame that holds the page: nothing of it comes from or goes to elsewhere."""
        return (
            f'<iframe title="{escape(self._title)}" srcdoc="{escape(self.page)}" '
            f'style="width:100%;height:{self.height}px;border:0"></iframe>'
        )


def play(
    machine: Machine,
    run: Piece | None = None,
    *,
    start: float | None = None,
    end: float | None = None,
    charts: bool = False,
    height: int = 560,
) -> Player:
    """Play a machine in a notebook: slower, faster, bearings magnified, forces, as in `report`.

    Parameters
    ----------
    run : what it does, such as a solution; the scene's own run if not
    start, end : part of it [s]
    charts : with all charts of the report, some megabytes; else the machine alone
    height : [pixels]

    Raises
    ------
    InputError
        If there is no such part.
    RunError
        If the run fails.
    """
    record = Record(machine, run or simulate(machine), {})
    first = record.start if start is None else start
    record = record.between(first, record.end if end is None else end)
    parts = sections(record) if charts else ()
    return Player(report.page(recorded(record), parts), height, machine.scene.title)
