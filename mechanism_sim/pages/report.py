"""The page of a run: one self-contained HTML file with its playback and charts."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from mechanism_sim.analysis.comparison import Difference, texts
from mechanism_sim.catalogue import installed_version
from mechanism_sim.pages.assets import embedded, import_map, render, styles
from mechanism_sim.pages.charts import NIGHT, figure
from mechanism_sim.pages.recorded import AWAY, Recorded
from mechanism_sim.report.charts.chart import ChartSection
from mechanism_sim.report.sections import SummaryRow
from mechanism_sim.report.summary import head
from mechanism_sim.units import typeset

MODULES = (
    'html', 'svg', 'stage', 'lens', 'player', 'saving', 'charts', 'curves', 'keys', 'zoom',
    'report',
)  # fmt: skip
_OFTEN = 0.02  # share of the time


class Family(NamedTuple):
    """Runs of one machine that differ in one value, chosen by a slider."""

    label: str  #: label of the value
    values: Sequence[str]  #: values with their units, one for each run
    runs: Sequence[Recorded]  #: the first is that of the page
    curves: Sequence[dict[str, Any]]  #: curves of all runs over time, see `curves.js`
    #: positions of the runs, x and heights, on charts over the value
    places: Sequence[tuple[float, list[float]]] = ()


class ComparisonPage(NamedTuple):
    """Other runs that a page compares its own with."""

    runs: Sequence[Recorded]
    names: tuple[str, ...]  #: names of all runs
    scenes: Mapping[str, tuple[str, ...]]  #: keys that differ, and their values in all
    differences: Sequence[Difference]


def page(
    run: Recorded, parts: Sequence[ChartSection] = (), source: str = '', digest: str = '',
    beside: ComparisonPage | None = None, family: Family | None = None, library: str = '',
    back: str = '',
) -> str:  # fmt: skip
    """The page of a run as HTML.

    Parameters
    ----------
    parts : the charts, section by section
    source : the file it was recorded in
    digest : digest of the whole run, if this is a part of one
    beside : further runs; their machines are dashed, and `parts` have the lines of all
    family : runs of which a slider chooses
    library : address of plotly.js, which pages of a site share; else the page holds it
    back : address of the page from which this one is opened
    """
    record = run.record
    scene = record.machine.scene
    runs = [run, *beside.runs] if beside else [run]
    loose = [j.name for x in runs for joints in (x.stage.bearings, x.stage.plays) for j in joints]
    bearings = list(dict.fromkeys(loose))
    data = {**run.to_json(), 'turn': turn(run), 'bearings': bearings, 'dark': NIGHT}
    if beside:
        data['others'] = [other.to_json() for other in beside.runs]
        data['names'] = beside.names
    if family:
        data['curves'], data['places'] = family.curves, family.places
        data['family'] = [x.to_json() for x in family.runs[1:]]
    charts = {chart.key: figure(chart) for part in parts for chart in part.charts}
    return render(
        'page.html.jinja',
        version=installed_version(),
        title=' and '.join(dict.fromkeys(x.record.machine.scene.title for x in runs)),
        scene=record.machine.name,
        description=scene.description.strip(),
        facts=[] if beside else _facts(run, source, digest),
        sections=parts,
        heights={key: drawn['layout']['height'] for key, drawn in charts.items()},
        bearings=bearings,
        names=beside.names if beside else (),
        scenes=_scenes(beside) if beside else (),
        differences=_rows(beside) if beside else (),
        forces=bool(run.stage.joints),
        points=any(s.kind == 'point' and s.number >= 0 for s in run.stage.skeleton.shapes),
        style=styles('stage', 'style'),
        modules=Markup(import_map(MODULES)),  # noqa: S704 - ours
        data=embedded(data),
        family=family,
        library=library,
        back=back,
        charts=embedded(charts),
        plotly=_packed(get_plotlyjs()) if charts and not library else '',
    )


def _scenes(beside: ComparisonPage) -> list[tuple[str, ...]]:
    """Rows of the table of keys that differ between the scenes."""
    head = 'key of the scene', *beside.names
    return [head, *((path, *values) for path, values in beside.scenes.items())]


def _rows(beside: ComparisonPage) -> list[tuple[str, ...]]:
    """Rows of the table: figure with unit, its values, and of two their difference and ratio."""
    rows: list[tuple[str, ...]] = [('figure', *beside.names)]
    if len(beside.names) == 2:
        rows[0] += 'difference', 'ratio'
    for d in beside.differences:
        unit, *values = texts(d)
        name = f'{d.subject}: {d.name.replace("_", " ")}'
        rows.append((f'{name} [{typeset(unit)}]' if unit else name, *values))
    return rows


def turn(run: Recorded) -> float | None:
    """Mean duration of a turn of the main drive [s], or of its way there and back."""
    record = run.record
    moved = run.frames.drive
    way = 2.0 * float(np.ptp(moved)) if record.slides else 2.0 * np.pi
    passed = float(np.abs(np.diff(moved)).sum())
    return (record.end - record.start) * way / passed if passed > 0.25 * way else None


def _facts(run: Recorded, source: str, digest: str) -> list[SummaryRow]:
    """Facts in the header; a digest is cut, with the whole as hover text."""
    rows = [*head(run.record, digest, len(run.impacts) if run.left_out else None)]
    if run.away > _OFTEN:
        near, often = (f'{100 * x:.0f} %' for x in (AWAY, run.away))
        words = (
            f'pins are off by more than {near} of the clearance for {often} of the time: --from '
            'and --to give a part all of its instants'
        )
        rows.append(SummaryRow('instants', f'{len(run.frames.t)}', words=words))
    if source:
        rows.append(
            SummaryRow('recorded in', source if run.record.complete else f'{source}, cut short')
        )
    return rows


def _packed(text: str) -> str:
    """A text that is long and rarely read, compressed and in base64."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode('ascii')
