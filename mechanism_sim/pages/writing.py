"""Pages of runs in files: of one, or of two that are compared."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mechanism_sim import output
from mechanism_sim.analysis import comparison
from mechanism_sim.analysis.open_run import is_run, run_of_machine
from mechanism_sim.analysis.record import Record
from mechanism_sim.arguments import listed, public
from mechanism_sim.errors import InputError
from mechanism_sim.pages import report as pages
from mechanism_sim.pages.charts import sections
from mechanism_sim.pages.recorded import recorded, together
from mechanism_sim.recording.reader import Bag
from mechanism_sim.report import measured
from mechanism_sim.report.charts.chart import ChartSection
from mechanism_sim.report.charts.overlay import overlaid
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.measure_text import Measure
from mechanism_sim.results.measures import Measured, Measurement
from mechanism_sim.results.run import Piece
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Source, load_scene, span
from mechanism_sim.units import argument


@public
def report(
    source: Source | Piece | Cycle | Bag,
    file: str | Path | None = None,
    *,
    other: Source | Piece | Cycle | Bag | Sequence[Source | Piece | Cycle | Bag] | None = None,
    measures: str | Sequence[str] = (),
    start: float | str | None = None,
    skip: int = 0,
    revolutions: float | None = None,
    duration: float | str | None = None,
) -> Path:
    """Write a page that plays a run and charts it, or compares several: one HTML file.

    >>> import mechanism_sim as ms
    >>> run = ms.simulate('slider_crank', revolutions=1)
    >>> print(ms.report(run, 'crank.html', measures=['rms(drive_torque)']))
    crank.html

    Parameters
    ----------
    source : a solution, a cycle, a bag or its path, or all that `load_scene` takes
    file : an .html file; named after the machine if not given
    other : a second run, or a list of runs, which the first is compared with
    measures : further figures; not for several runs
    start : start of the shown part [s]
    skip : full turns of the drive that are left out at the beginning, instead
    revolutions, duration : length; without either all of a run, or that of the scene
    """
    measures = listed(measures, 'measures')
    if other is not None and measures:
        raise InputError('measures apply to a single run: leave them out of a comparison')
    if skip < 0:
        raise InputError(f'report: skip = {skip} must be at least 0')
    beside = [] if other is None else [*other] if isinstance(other, list | tuple) else [other]
    length = argument('start', start, 's'), revolutions, duration
    sources = [source, *beside]
    records = [record_of(each, *length) for each in sources]
    if skip:
        records = [each.between(each.begin(skip), each.end) for each in records]
    names = [str(x) if isinstance(x, str | Path) and '\n' not in str(x) else r.machine.name
             for x, r in zip(sources, records, strict=True)]  # fmt: skip
    path = output.check_path(
        'file', file or f'{"_".join(Path(name).stem for name in names)}.html', '.html', '.htm'
    )
    if beside:
        write_comparison(records, names, path)
    else:
        write_page(records[0], path, measures=measures)
    return path


def record_of(
    source: Any, start: float | None, revolutions: float | None, duration: float | str | None
) -> Record:
    """The run of a source, or the requested part of it."""
    if is_run(source):
        record = run_of_machine(source, 'a report')
        first = record.start if start is None else start
        if revolutions is None and duration is None:
            return record.between(first, record.end)
        return record.between(first, first + span(record.machine, revolutions, duration))
    machine, first = load_scene(source), start or 0.0
    end = first + span(machine, revolutions, duration)
    return Record(machine, simulate(machine, duration=end), {}).between(first, end)


def write_page(
    record: Record,
    file: Path,
    source: str = '',
    digest: str = '',
    measures: Sequence[str] | Sequence[Measure] = (),
    show: Callable[[float, int], None] | None = None,
) -> tuple[int, list[Measured]]:
    """Write the page of a run; its size [bytes], and the measures.

    Parameters
    ----------
    source : the file it was recorded in
    digest : digest of the whole run, if this is a part of one
    show : callback with the progress of the player's data
    """
    shown, parts = recorded(record, show), sections(record)
    found: list[Measured] = []
    if measures:
        taken = Measurement(record.machine, measures, record.start, record.end)
        taken.add(record.piece, record.history)
        found = taken.found()
        rows = tuple((row.label, row.text) for row in measured.rows(found))
        parts = [ChartSection('measures', 'Measures', '', (), rows), *parts]
    text = pages.page(shown, parts, source, digest)
    output.write_text(file, text)
    return len(text.encode()), found


_MOST = 6  # runs that can be distinguished


def write_comparison(
    records: Sequence[Record], sources: Sequence[str], file: Path
) -> pages.ComparisonPage:
    """Write the page of several runs, which are named by what differs in their scenes.

    Parameters
    ----------
    sources : names of the runs if their scenes are equal
    """
    if len(records) > _MOST:
        raise InputError(f'{len(records)} runs: at most {_MOST} can be distinguished')
    found = comparison.compare(*records)
    scenes = comparison.scene_differences([record.machine.scene for record in records])
    names = comparison.run_names(scenes, sources)
    first, *others = together(*map(recorded, records))
    parts = overlaid([sections(record) for record in records], names)
    beside = pages.ComparisonPage(others, names, scenes, found)
    output.write_text(file, pages.page(first, parts, beside=beside))
    return beside
