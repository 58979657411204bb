"""Playback of a machine in a notebook, and of a family of machines by a slider."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

from mechanism_sim.analysis.open_run import check_run_of, is_run
from mechanism_sim.analysis.record import Record
from mechanism_sim.arguments import public
from mechanism_sim.errors import InputError
from mechanism_sim.pages import report
from mechanism_sim.pages.charts import sections
from mechanism_sim.pages.families import Member, family_page
from mechanism_sim.pages.recorded import recorded
from mechanism_sim.pages.writing import record_of
from mechanism_sim.recording.reader import Bag
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.run import Piece
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Source, load_scene
from mechanism_sim.units import argument, plain


class Player:
    """The page of a run, in a frame of its own.

    Attributes
    ----------
    page : the HTML of the page
    height : height of the frame [pixels]
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


@public
def play(
    scene: Source | Piece | Cycle | Bag,
    run: Piece | None = None,
    *,
    start: float | str | None = None,
    end: float | str | None = None,
    charts: bool = False,
    height: int = 560,
) -> Player:
    """Play a machine in a notebook: slower, faster, bearings magnified, forces, as in `report`.

    >>> import mechanism_sim as ms
    >>> ms.play('slider_crank', end='50 ms')
    <Slider-crank, the crank drives, to be played>

    Parameters
    ----------
    scene : all that `load_scene` takes, or a solution, a cycle, a bag or its path
    run : its run, such as a solution; default: the scene's own, up to `end` if given
    start, end : part of it [s]
    charts : add all charts of the report, some megabytes; else the machine alone
    height : [pixels]
    """
    start, end = argument('start', start, 's'), argument('end', end, 's')
    if run is None:
        record = record_of(scene, None, None, None if is_run(scene) else end)
    else:
        machine = load_scene(scene)  # type: ignore[arg-type]
        check_run_of(machine, run)
        record = Record(machine, run, {})
    first = record.start if start is None else start
    record = record.between(first, record.end if end is None else end)
    parts = sections(record) if charts else ()
    return Player(report.page(recorded(record), parts), height, record.machine.scene.title)


@public
def explore(
    scene: Source,
    path: str,
    values: Iterable[float | str],
    quantity: str,
    *,
    overrides: Mapping[str, Any] | str | Iterable[str] = (),
    revolutions: float | None = None,
    duration: float | str | None = None,
    height: int = 780,
) -> Player:
    """Play a machine with a slider through values of its scene, and chart a quantity of each.

    All runs are made at once and kept in the frame, which needs no program any more.

    >>> import mechanism_sim as ms
    >>> lengths = '0.15 m', '0.3 m'
    >>> ms.explore('slider_crank', 'links.rod.length', lengths, 'position.piston')
    <Slider-crank, the crank drives, to be played>

    Parameters
    ----------
    scene : all that `load_scene` takes
    path : path of the varied value, such as ``links.rocker.length``
    values : its values, with their units
    quantity : quantity of the catalogue (``mechanism-sim quantities SCENE``)
    overrides : overrides of other values of the scene
    revolutions, duration : length of each run; the scene's own if neither is given
    height : height of the frame [pixels]
    """
    several = [values] if isinstance(values, str) else plain(values)
    if not isinstance(several, Iterable) or not (several := [*several]):
        raise InputError(f'explore: {path}: no values are given')
    scene, members = load_scene(scene, overrides), []
    for value in several:
        machine = load_scene(scene, {path: value})
        solution = simulate(machine, revolutions=revolutions, duration=duration)
        members.append(Member(str(value), Record(machine, solution, {})))
    page = family_page(path, members, [catalogue(machine).find(quantity).name])
    return Player(page, height, members[0].record.machine.scene.title)
