"""A chart on paper and on the page: both show the numbers of its description, and no others."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from builders import PLAY, simulated
from matplotlib.colors import same_color

import mechanism_sim as ms
from mechanism_sim.analysis.details import Wanted, everything, find_details
from mechanism_sim.export.palette import IMPACT
from mechanism_sim.pages.charts import figure
from mechanism_sim.report import condition, plots, vibrations
from mechanism_sim.report.charts.chart import (
    DASHES,
    LOOKS,
    TIME,
    Axis,
    Chart,
    ChartCurve,
    Panel,
)
from mechanism_sim.report.charts.overlay import overlaid
from mechanism_sim.report.charts.subjects import sections
from mechanism_sim.report.figures import paint
from mechanism_sim.studies.modes import about


def of_a_run(name, **span):
    return [chart for s in sections(simulated(name, **span)) for chart in s.charts]


def of_two_runs():
    worn = simulated('four_bar_clearance', {f'{PLAY}.restitution': 0.8}, revolutions=2)
    runs = sections(simulated('four_bar_clearance', revolutions=4)), sections(worn)
    both = overlaid(runs, ['fresh', 'worn'])
    return [chart for s in both for chart in s.charts]


def of_a_bag():
    record = simulated('four_bar_clearance', revolutions=4)
    details = find_details(record, everything(record, Wanted()))
    return list(condition.charts(details))


def of_a_cycle():
    return list(plots.charts(ms.cycle(ms.load_scene('slider_crank'), points=['rod.cog'])))


def of_vibrations():
    table = vibrations.ModeTable('x', [about(ms.load_scene('half_car'))])
    return [vibrations.modes_chart(table, 'modes')]


KINDS = {
    'turns': lambda: of_a_run('four_bar_clearance', revolutions=4),
    'multiples': lambda: of_a_run('ten_links', revolutions=1),
    'cam': lambda: of_a_run('valve_train', revolutions=1.1),
    'frame': lambda: of_a_run('four_bar_on_frame', revolutions=1.2),
    'two': of_two_runs, 'bag': of_a_bag, 'cycle': of_a_cycle, 'modes': of_vibrations,
}  # fmt: skip


def unpacked(given):
    if isinstance(given, dict):
        return np.frombuffer(base64.b64decode(given['bdata']), given['dtype']).astype(float)
    return np.array([x for x in given if x is not None], float)


def outline(curve):
    """The corners of an area, run by run: over its upper edge and back over its lower."""
    known = np.isfinite(curve.x) & np.isfinite(curve.y)
    runs = np.split(np.arange(len(known)), np.flatnonzero(~known))
    for run in (r[known[r]] for r in runs):
        yield from zip(curve.x[run], curve.y[run], strict=True)
        yield from zip(curve.x[run][::-1], curve.low[run][::-1], strict=True)


def near(found, wanted):
    found, wanted = np.asarray(found, float), np.asarray(wanted, float)
    assert found.shape == wanted.shape
    scale = np.nanmax(np.abs(wanted), initial=0.0)
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-7 * scale)


def dashes_of(line):
    """Strokes and gaps in widths of the line, as Matplotlib has them."""
    _, pattern = line._unscaled_dash_pattern
    return tuple(pattern or ())


def unlike(charts):
    """Charts of which no two have the same kinds of panels and curves."""
    shape = {
        tuple(
            (p.form, len(p.impact_times) > 0, *((c.form, c.look) for c in p.curves))
            for p in c.panels
        ): c
        for c in charts
    }
    return list(shape.values())


@pytest.mark.parametrize(
    'kind',
    ['turns', 'bag', *(pytest.param(x, marks=pytest.mark.slow) for x in ('multiples', 'two'))],
)
def test_paper_and_page_show_the_curves_of_a_chart(kind):
    check(unlike(KINDS[kind]()))


@pytest.mark.slow
@pytest.mark.parametrize('kind', KINDS)
def test_paper_and_page_show_all_curves_of_all_charts(kind):
    check(KINDS[kind]())


def check(charts):
    assert charts
    for chart in charts:
        on_paper, on_page = paint(chart), figure(chart)
        assert len(on_paper.axes) == len(chart.panels)
        panels = chart.readable().panels
        for k, (panel, axes) in enumerate(zip(panels, on_paper.axes, strict=True)):
            traces = [t for t in on_page['data'] if t['meta'][0] == k]
            check_axes(panel, axes, on_page['layout'], traces)
            for i, curve in enumerate(panel.curves):
                name = f'{chart.key or "chart"}-{k}-{i}'
                drawn = [a for a in axes.get_children() if a.get_gid() == name]
                mine = [t for t in traces if t['meta'][1] == i]
                check_paper(panel, curve, drawn)
                check_page(panel, curve, mine)
            check_marks(panel, axes, on_page['layout'], traces)


def check_axes(panel, axes, layout, traces):
    legend = axes.get_legend()
    texts = [t.get_text() for t in legend.get_texts()] if legend else []
    assert texts == panel.entries
    shown = [t['name'] for t in traces if t['showlegend']]
    assert shown == panel.entries
    if panel.form == 'polar':
        assert panel.y.unit in axes.get_title().replace('·', ' ')
        return
    place = {t['xaxis']: t['yaxis'] for t in traces if t['meta'][1] != 'struck'}
    ((x, y),) = place.items()
    for axis, name, title in (
        (panel.x, f'x{x[1:]}', ''), (panel.y, f'y{y[1:]}', axes.get_ylabel()),
    ):  # fmt: skip
        text = layout[f'{name[0]}axis{name[1:]}']['title']['text']
        assert text.replace('<br>', ' ') == axis.title
        if title:
            assert title.replace('\n', ' ') == axis.title
    below = axes.get_shared_x_axes().get_siblings(axes)
    assert {a.get_xlabel() for a in below} - {''} == {panel.x.title}
    if panel.x.low is not None and panel.x.high is not None and not panel.x.log:
        assert axes.get_xlim() == (panel.x.low, panel.x.high)
        assert layout[f'xaxis{x[1:]}']['range'] == [panel.x.low, panel.x.high]


def check_paper(panel, curve, drawn):
    turn = np.radians if panel.form == 'polar' else np.asarray
    if curve.form == 'area':
        (area,) = drawn
        corners = {tuple(np.round(v, 9)) for p in area.get_paths() for v in p.vertices}
        wanted = {tuple(np.round((float(turn(a)), b), 9)) for a, b in outline(curve)}
        assert wanted <= corners
        assert same_color(area.get_facecolor()[0][:3], curve.shade)
        return
    *rays, line = drawn
    near(line.get_xdata(), turn(curve.x))
    near(line.get_ydata(), curve.y)
    assert same_color(line.get_color(), curve.shade)
    if curve.form == 'stems':
        near(rays[0].get_ydata()[1::3], curve.y)
    elif curve.form != 'dots':
        assert line.get_linewidth() == LOOKS[curve.look].width
        assert dashes_of(line) == DASHES[curve.dash % len(DASHES)]


def check_page(panel, curve, mine):
    x, y = ('theta', 'r') if panel.form == 'polar' else ('x', 'y')
    if not len(curve.x):
        return
    if curve.form == 'area':
        (area,) = mine
        corners = np.stack([unpacked(area[x]), unpacked(area[y])], axis=1)
        near(corners[np.isfinite(corners[:, 0])], list(outline(curve)))
        return
    trace = mine[-1]
    near(unpacked(trace[x]), curve.x)
    near(unpacked(trace[y]), curve.y)
    if curve.when is not None:
        near(unpacked(trace['customdata']), curve.when)
    if curve.form == 'stems':
        near(unpacked(mine[0][y])[1::3], curve.y)
    elif curve.form != 'dots' and curve.look != 'ideal':
        assert trace['line']['color'] == curve.shade
        dash, pattern = trace['line']['dash'], DASHES[curve.dash % len(DASHES)]
        if pattern:
            parts = [float(p.removesuffix('px')) for p in dash.split(',')]
            assert parts == pytest.approx(np.multiply(pattern, trace['line']['width']), rel=0.05)
        else:
            assert dash == 'solid'


def check_marks(panel, axes, layout, traces):
    struck = [a for a in axes.lines if a.get_gid() and a.get_gid().endswith('struck')]
    on_page = [t for t in traces if t['meta'][1] == 'struck']
    assert len(struck) == len(on_page) == bool(len(panel.impact_times))
    for line, trace in zip(struck, on_page, strict=True):
        near(line.get_xdata(), panel.impact_times)
        near(unpacked(trace['x']), panel.impact_times)
        assert line.get_color() == trace['marker']['line']['color'] == IMPACT
    for mark in panel.marks:
        name = 'y0' if mark.level else 'x0'
        assert any(s.get(name) == mark.at for s in layout['shapes'])
        data = [line.get_ydata() if mark.level else line.get_xdata() for line in axes.lines]
        assert any(list(d) == [mark.at, mark.at] for d in data)


def test_large_and_small_values_are_drawn_in_the_units_of_tables():
    """One unit for all axes that have one, along x of lengths and of what is compared with y."""

    def panel(unit, y, x=TIME, **more):
        values = np.array(y)
        return Panel(x, Axis('size', unit, high=y[-1]), (ChartCurve(values, values),), **more)

    made = [panel('N', [0.0, -2e4, 3.0]), panel('N', [0.0, 1.0, 5.0]), panel('J', [0.0, 2e-3])]
    made += [panel('deg', [0.0, 2e5]), panel('N', [0.0, 2e4], Axis('x', 'N'), form='equal')]
    shown = Chart('k', 't', tuple(made)).readable().panels
    assert [p.y.unit for p in shown] == ['kN', 'kN', 'mJ', 'deg', 'kN']
    assert [p.x.unit for p in shown] == ['s', 's', 's', 's', 'kN']
    assert [p.curves[0].y[-1] for p in shown] == [3e-3, 5e-3, 2.0, 2e5, 20.0]
    assert [p.curves[0].x[-1] for p in shown] == [3.0, 5.0, 2e-3, 2e5, 20.0]
    assert [p.y.high for p in shown] == [3e-3, 5e-3, 2.0, 2e5, 20.0]


@pytest.mark.parametrize(
    ('size', 'unit', 'shown'),
    [(300.0, 'm', 300.0), (0.3, 'mm', 300.0), (3e-6, 'µm', 3.0), (2e-8, 'µm', 0.02)],
)
def test_lengths_have_the_unit_of_their_size(size, unit, shown):
    """Of a machine of 100 m they are in m, of one etched in silicon in µm, along x as well."""
    values = np.array([0.0, size])
    panel = Panel(Axis('x', 'm'), Axis('gap', 'm'), (ChartCurve(values, values),))
    (found,) = Chart('k', 't', (panel,)).readable().panels
    assert (found.x.unit, found.y.unit) == (unit, unit)
    assert [found.curves[0].x[-1], found.curves[0].y[-1]] == pytest.approx([shown, shown])
