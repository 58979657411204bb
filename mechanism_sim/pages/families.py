"""Pages with a slider through runs: values of a key, points of a bifurcation diagram, a life."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim.analysis.collectors import measured
from mechanism_sim.analysis.record import Record
from mechanism_sim.analysis.series import Series, drawn
from mechanism_sim.export.stage import packed
from mechanism_sim.pages import report
from mechanism_sim.pages.charts import brief, places
from mechanism_sim.pages.recorded import recorded, together
from mechanism_sim.report import bifurcation as responses
from mechanism_sim.report import life as lives
from mechanism_sim.report.charts.chart import ChartSection
from mechanism_sim.report.charts.thinning import SampledLine, thin
from mechanism_sim.results.run import Piece, Runner
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene
from mechanism_sim.studies.bifurcation import Bifurcation, Response
from mechanism_sim.studies.continuation import ResponseBranch
from mechanism_sim.studies.life import Life
from mechanism_sim.units import for_people, typeset

_MOST = 40  # runs of a page
_TURNS = 4  # shown turns of an aperiodic motion
_LONGEST = 8  # shown turns of a periodic motion, at most
_NOTHING = 1e-12  # rounding errors, over the machine's size

Say = Callable[[str], None]


class Member(NamedTuple):
    """A run of a family."""

    value: str  #: value of the run with its unit, as its label
    record: Record  #: the run, from when on it is shown
    #: (x, heights) on charts over the value; none where there is no such chart
    place: tuple[float, list[float]] | None = None


def family_page(
    label: str,
    members: Sequence[Member],
    quantities: Sequence[str] = (),
    parts: Sequence[ChartSection] = (),
) -> str:
    """Page with a slider through runs, as HTML.

    Parameters
    ----------
    label : label of the slider
    quantities : quantities charted over time: of the catalogue, or names of sensors
    parts : charts below; those over the value show where the slider is, and move it
    """
    curves = [_curves([m.record for m in members], name) for name in quantities]
    runs = together(*(recorded(m.record) for m in members))
    spots = [m.place for m in members if m.place]
    family = report.Family(label, [m.value for m in members], runs, curves, spots)
    return report.page(runs[0], parts, family=family)


def _curves(records: Sequence[Record], quantity: str) -> dict[str, Any]:
    """A quantity of all runs over time, as plain data; see `curves.js`."""
    series = [_series(record, quantity) for record in records]
    lines = [thin(SampledLine(s.t, s.values)) for s in series]
    unit, scale = for_people(series[0].unit, max(abs(line.values).max() for line in lines))
    return {
        'label': series[0].words,
        'unit': typeset(unit),
        'runs': [
            {'at': packed(places(line.at)), 'values': packed(brief(scale * line.values))}
            for line in lines
        ],
    }


def _series(record: Record, quantity: str) -> Series:
    if quantity in record.machine.scene.sensors:
        signal = measured(record.machine, record.history, quantity)
        t, x = np.concatenate(signal.times), np.concatenate(signal.runs)
        return Series(quantity, signal.unit, t, x, words=quantity).within(record.start, record.end)
    (series,) = drawn(record.piece, [quantity], record.start, record.end)
    if series.unit == 'm':  # closed contacts have rounding errors only
        rounding = np.abs(series.values) < _NOTHING * record.machine.mechanism.size
        series = replace(series, values=np.where(rounding, 0.0, series.values))
    return series


# --- responses over a parameter ------------------------------------------------------------------


def bifurcation_page(
    found: Bifurcation, branches: Sequence[ResponseBranch] = (), say: Say | None = None
) -> str:
    """Page of a bifurcation diagram: its slider plays the motion at each point.

    Values are left out where there are more than a page can hold.
    """
    kinds = {(r.value, r.number): r for r in reversed(found.responses) if r.state}
    kinds |= {(r.value, r.number): r for r in reversed(found.responses) if r.state and r.settled}
    points = [kinds[key] for key in sorted(kinds)]
    if len(points) > _MOST:
        chosen = np.linspace(0, len(points) - 1, _MOST).round().astype(int)
        points = [points[k] for k in chosen]
    scales = responses.scales(found)
    members = []
    for k, point in enumerate(points):
        if say:
            say(f'motion {k + 1} of {len(points)}')
        period = f'period {point.period}' if point.period else 'no period'
        period = period if point.settled else 'not settled'
        value = f'{found.scale * point.value:.5g} {found.unit}, {period}'
        heights = [scales[0][1] * float(x) for x in point.points[:, 0]]
        record = Record(*_played(found, point), {})
        members.append(Member(value, record, (found.scale * point.value, heights)))
    title = found.machine.scene.title
    text = 'Choose a point, or a value with the slider: the machine above moves as it does there.'
    chart = responses.chart(found, title, branches)
    own = [x for x in found.plan.of if not found.plan.joint]
    return family_page(
        found.parameter.path,
        members,
        own,
        [ChartSection('responses', 'Responses', text, (chart,))],
    )


def _played(found: Bifurcation, point: Response) -> tuple[Machine, Piece]:
    """Turns of a response, from the state in which its section ended."""
    machine, state = found.machine, point.state
    assert state is not None  # noqa: S101 - it is a response
    given = {found.parameter.path: point.value}
    machine = build(machine.name, check_scene(machine.name, machine.scene.to_document(), given))
    engine = machine.start(state=replace(state, turns=(0,) * len(state.turns)))
    turns = min(point.period or _TURNS, _LONGEST)
    pieces = list(Runner(machine, engine).to(max(turns, 2) * machine.drive.period))
    return machine, Piece.joined(pieces)


# --- the life of bearings ------------------------------------------------------------------------


def life_page(found: Life, say: Say | None = None) -> str:
    """Page of a life: its slider plays the machine as worn as it is then.

    Loads of the worn bearings and signals of the scene's sensors are drawn of all stages.
    """
    stages, skip = found.stages, found.plan.skip
    chosen = np.unique(np.linspace(0, len(stages) - 1, _MOST).round().astype(int))
    members: list[Member] = []
    known: dict[str, Any] = {}
    _, scale = for_people('m', max(float(x) for stage in stages for x in stage.clearance))
    for k, stage in enumerate(stages[i] for i in chosen):
        if say:
            say(f'motion {k + 1} of {len(chosen)}')
        name = found.machine.name
        scene = found.scene(stage)
        if not members or scene != known:  # bearings that do not wear move as they did
            known, machine = scene, build(name, check_scene(name, scene))
            run = simulate(machine, revolutions=skip + 2)
            record = Record(machine, run, {}).between(skip * machine.drive.period, run.duration)
        heights = [scale * float(x) for x in stage.clearance]
        members.append(Member(f'{stage.cycles:.3g}', record, (stage.cycles, heights)))
    charts = lives.charts(found, found.machine.scene.title)
    end = '' if math.isnan(found.cycles) else f' The life ends after {found.cycles:.4g} cycles.'
    text = f'Choose a stage, or cycles with the slider.{end}'
    parts = [ChartSection('life', 'Wear', text, tuple(c for c in charts if c.panels))]
    loads = [f'normal_force.{joint}' for joint in found.joints]
    return family_page('cycles', members, [*loads, *found.machine.scene.sensors], parts)
