"""The charts of a report: their numbers by a second route, their extremes, their units."""

import base64
import json
import math
import re
import warnings
from itertools import pairwise

import numpy as np
import pytest
from builders import simulated
from hypothesis import given
from hypothesis import strategies as st
from running import one_of

import mechanism_sim as ms
from mechanism_sim.analysis.collectors import ModeShares
from mechanism_sim.analysis.record import Record
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import InputError
from mechanism_sim.export.palette import GROUND
from mechanism_sim.pages.charts import NIGHT, figure, sections
from mechanism_sim.report.charts import bands, impacts
from mechanism_sim.report.charts import charted_run as charted_run_module
from mechanism_sim.report.charts.chart import TIME, Axis, Chart, ChartCurve, Panel
from mechanism_sim.report.charts.charted_run import ChartedRun
from mechanism_sim.report.charts.curves import quantities
from mechanism_sim.report.charts.thinning import MOST, SampledLine, thin, thinned

JOINT = 'coupler_rocker'


def charts_of(found):
    return {chart.key: chart for section in found for chart in section.charts}


def curves(chart, name=None, look=''):
    """The curves of a label, or of a quantity; all without a name."""
    return [
        c for p in chart.panels for c in p.curves
        if c.look == look and len(c.x) and (name is None or name in (c.label, c.of))
    ]  # fmt: skip


@pytest.fixture(scope='module')
def loose():
    """Ten revolutions of the thesis scene: so long that lines are thinned."""
    return simulated('four_bar_clearance', revolutions=10)


@pytest.fixture(scope='module')
def found(loose):
    return sections(loose)


@pytest.fixture(scope='module')
def charts(found):
    return charts_of(found)


def test_lines_over_the_angle_are_the_motion_at_that_angle(loose, charts):
    """The last turn; and of many, the range that all of them keep within."""
    for key, column, scale in (
        ('motion-position-turning', 'position.rocker', math.degrees(1.0)),
        ('motion-velocity-turning', 'velocity.coupler', 1.0),
        ('drive-torque', 'drive_torque', 1.0),
    ):
        (c,) = curves(charts[key], column)
        assert (c.x[0], c.x[-1]) == pytest.approx((0.0, 360.0), abs=1e-6)
        # without events: a line has two values there
        before, after = np.diff(c.when, prepend=-1.0), np.diff(c.when, append=9.0)
        smooth = np.flatnonzero((before > 2e-6) & (after > 2e-6))
        exact = scale * loose.piece.sample(loose.times_at(9 + c.x[smooth] / 360.0), column)[column]
        near = np.abs(c.y[smooth] - exact) < 1e-4 * np.abs(exact).max()
        assert near.mean() > 0.99  # but for what rounding puts on the other side of an event
        at = np.mod(
            loose.piece.sample(c.when, 'position.crank')['position.crank'] - np.radians(c.x) + 1.0,
            2 * np.pi,
        )
        assert at == pytest.approx(np.ones(len(at)), abs=1e-3)
        (reach,) = curves(charts[key], column, 'range')
        for turn in range(10):
            angle = np.arange(0.25, 360.0, 7.5)
            times = loose.times_at(turn + angle / 360.0)
            exact = scale * loose.piece.sample(times, column)[column]
            slack = 0.02 * np.ptp(reach.y)
            assert (np.interp(angle, reach.x, reach.y) > exact - slack).mean() > 0.97
            assert (np.interp(angle, reach.x, reach.low) < exact + slack).mean() > 0.97


def test_the_range_over_all_turns_holds_every_one():
    """Of a shaft that sways anew in each turn; between samples of a turn, too."""
    record = simulated('two_disk_rotor', duration=0.3)
    charts = charts_of(sections(record))
    for key, column, scale in (
        ('motion-position-straight', 'position.disk.x', 1.0),
        ('motion-position-turning', 'position.disk.tilt_x', math.degrees(1.0)),
    ):
        (reach,) = curves(charts[key], column, 'range')
        assert not curves(charts[key], column, 'earlier')
        turns = np.arange(0.0, 9.99, 1.0 / 144.0)
        exact = scale * record.piece.sample(record.times_at(turns), column)[column]
        at, slack = 360.0 * np.mod(turns, 1.0), 1e-3 * np.ptp(exact)
        assert (np.interp(at, reach.x, reach.y) > exact - slack).all()
        assert (np.interp(at, reach.x, reach.low) < exact + slack).all()
        assert reach.y.max() < exact.max() + slack
        assert reach.low.min() > exact.min() - slack


def test_angles_of_links_that_turn_round_have_no_range():
    """A second gear at another ratio has another angle in every turn."""
    record = simulated('gear_pair', revolutions=5)
    chart = charts_of(sections(record))['motion-position-turning']
    assert not [c for p in chart.panels for c in p.curves if c.look == 'range']


def test_beneath_lies_the_ideal_four_bar(loose, charts):
    """By intersecting circles about the ends of crank and rocker."""
    (c,) = curves(charts['motion-position-turning'], 'position.rocker', 'ideal')
    crank, rocker = np.radians(c.x), c.y
    f = loose.machine.nominal.linkage
    tip = f.crank * np.exp(1j * crank)
    apart = tip - f.ground
    d = np.abs(apart)
    cosine = (d**2 + f.rocker**2 - f.coupler**2) / (2.0 * d * f.rocker)
    both = [np.degrees(np.angle(apart * np.exp(1j * s * np.arccos(cosine)))) for s in (1, -1)]
    assert min(np.abs(rocker - x).max() for x in both) < 2e-3


def test_a_turn_may_begin_at_any_angle():
    record = simulated(
        'valve_train', revolutions=1.1
    )  # from 200 deg on: no turn from zero to zero
    chart = charts_of(sections(record))['motion-position-straight']
    for look in ('', 'ideal'):
        (c,) = curves(chart, 'position.valve', look)
        (cut,) = np.flatnonzero(np.isnan(c.x))
        ends = [c.x[k] for k in (0, cut - 1, cut + 1, -1)]
        assert ends == pytest.approx([236.0, 360.0, 0.0, 236.0], abs=0.01)
    (c,) = curves(chart, 'valve')
    known = np.isfinite(c.x)
    exact = record.piece.sample(c.when[known], 'position.valve')['position.valve']
    assert c.y[known] == pytest.approx(exact, abs=1e-6)


def test_there_is_no_ideal_of_a_drive_that_was_commanded_otherwise(loose):
    assert ChartedRun(loose).ideal is not None
    faster = ms.load_scene('four_bar_clearance', {'drive.speed': '36.7 rad/s'})
    assert ChartedRun(Record(faster, loose.piece, {})).ideal is None
    assert ChartedRun(simulated('pendulum')).ideal is None
    assert ChartedRun(simulated('four_bar_nominal', revolutions=2)).ideal is None


def test_forces_are_vectors_in_the_world(loose, charts):
    c = curves(charts[f'forces-{JOINT}'])[0]
    r, theta, t = c.y, c.x, c.when
    chosen = np.abs(t[:, None] - [i.t for i in loose.piece.impacts]).min(axis=1) > 1e-5
    exact = loose.piece.sample(t[chosen])
    force = r[chosen] * np.exp(1j * np.radians(theta[chosen]))
    expected = exact[f'reaction.{JOINT}.x'] + 1j * exact[f'reaction.{JOINT}.y']
    assert np.quantile(np.abs(force - expected), 0.99) < 1e-4 * np.abs(expected).max()


@pytest.mark.slow
def test_extremes_of_a_long_run_are_in_its_charts(loose, charts):
    dense = {}
    for t in np.array_split(np.linspace(loose.start, loose.end, 100_000), 10):
        for name, x in loose.piece.sample(t).items():
            low, high = dense.get(name, (np.inf, -np.inf))
            dense[name] = min(low, x.min()), max(high, x.max())
    for key, name, column in (
        ('drive-torque-run', 'crank', 'drive_torque'),
        (f'gap-{JOINT}-run', f'gap.{JOINT}', f'gap.{JOINT}'),
        ('energy', 'kinetic', 'energy.kinetic'),
    ):
        (c,) = curves(charts[key], name)
        y, (low, high) = c.y, dense[column]
        assert len(y) <= MOST + 2
        slack = 2e-3 * (high - low)
        assert y.min() == pytest.approx(low, abs=slack)
        assert y.max() == pytest.approx(high, abs=slack)
        assert np.all(np.diff(c.x) >= 0.0)


@given(st.data())
def test_thinned_lines_keep_the_extremes_of_every_bin(data):
    values = np.array(data.draw(st.lists(st.integers(-9, 9), min_size=21, max_size=120)), float)
    steps = data.draw(st.lists(st.integers(0, 5), min_size=len(values), max_size=len(values)))
    at = np.cumsum(steps).astype(float)
    if at[0] == at[-1]:
        return
    cuts = sorted(data.draw(st.sets(st.integers(1, len(at) - 1), max_size=5)))
    rows = np.array([values, values[::-1]])
    parts = zip(np.split(at, cuts), np.split(rows, cuts, axis=1), strict=True)
    lines = thinned(parts, len(at), (at[0], at[-1]), most=20)
    bins = np.minimum(((at - at[0]) * (10 / (at[-1] - at[0]))).astype(int), 9)
    for line, row in zip(lines, rows, strict=True):
        assert len(line.at) <= 22
        assert (line.at[0], line.at[-1]) == (at[0], at[-1])
        assert np.all(np.diff(line.at) >= 0.0)
        assert set(zip(*line, strict=True)) <= set(zip(at, row, strict=True))
        mine = np.minimum(((line.at - at[0]) * (10 / (at[-1] - at[0]))).astype(int), 9)
        for k in np.unique(bins):
            for extreme in (np.min, np.max):
                assert extreme(row[bins == k]) == extreme(line.values[mine == k])


def test_a_line_that_is_short_stays_as_it_is():
    line = SampledLine(np.arange(5.0), np.arange(5.0))
    assert thin(line) is line


def test_a_line_of_turns_that_cannot_be_told_apart_says_what_is_drawn(loose, monkeypatch):
    """Else a block looks like a signal: here each extreme is of half a turn."""
    assert ChartedRun(loose).whole == 'the whole run'
    monkeypatch.setattr(charted_run_module, 'MOST', 2 * 20)
    charted = ChartedRun(loose)
    words = f'the whole run: least and largest of each {1e3 * 0.5 / loose.rate:.3g} ms'
    assert [when for _, when, _ in charted.windows('gap')] == ['the last turns', words]
    name = 'reaction.coupler_rocker.size'
    found = quantities(charted, 'force', 'Force', [name], run=True)
    assert [chart.title for chart in found] == ['Force', f'Force over {words}']
    stems = impacts.impacts(charted, 0).charts[1]
    assert stems.title == 'Impacts in the whole run'  # of which the hardest are drawn


def test_there_is_a_stem_for_every_impact(loose, charts):
    start, end = loose.times_at(np.array([8.0, 10.0]))
    for key, since, until in (('impacts', start, end), ('impacts-run', 0.0, loose.end)):
        struck = [i for i in loose.piece.impacts if since <= i.t <= until]
        (c,) = curves(charts[key], JOINT)
        assert (c.form, c.x.tolist()) == ('stems', [i.t for i in struck])
        assert c.y == pytest.approx([i.normal_impulse for i in struck], rel=1e-12)
        assert charts[key].panels[0].y.unit == 'N s'


@pytest.mark.slow
def test_a_run_is_looked_at_in_blocks_that_do_not_grow_with_it(monkeypatch):
    """Of places, for long segments have many; the lines are those of any other blocks."""
    record, found = simulated('slider_crank', revolutions=12), []
    for most in (256, 10**6):
        monkeypatch.setattr(charted_run_module, '_BLOCK', most)
        window, sizes = ChartedRun(record).run, []
        blocks = window._blocks
        window._blocks = lambda *a, f=blocks, n=sizes: (n.append(len(b[0])) or b for b in f(*a))
        found.append((window.lines, sum(sizes), max(sizes)))
    (few, places, largest), (whole, same, every) = found
    assert places == same == every > 4000
    assert largest < 256 + 100
    for name, line in whole.items():
        size = np.nanmax(np.abs(line.values), initial=0.0)
        assert few[name].values == pytest.approx(line.values, abs=1e-12 * size, nan_ok=True)


def test_of_many_impacts_the_hardest_are_drawn(loose, monkeypatch):
    monkeypatch.setattr(impacts, 'STEMS', 30)
    charted = ChartedRun(loose)
    section = impacts.impacts(charted, 0)
    (c,) = curves(section.charts[1], JOINT)
    assert len(c.x) <= 30
    hardest = max(i.normal_impulse for i in loose.piece.impacts)
    assert c.y.max() == pytest.approx(hardest, rel=1e-12)
    assert 'the hardest in each of 30 intervals' in section.text


def test_the_band_shows_how_long_the_pin_flies(loose, monkeypatch):
    collector = ModeShares()
    collector.add(loose.piece.modes)
    (told,) = collector.summary(loose.start, loose.end)
    for single in (10**6, 0):
        monkeypatch.setattr(bands, '_SINGLE', single)
        panel = charts_of([impacts.contacts(ChartedRun(loose))])[f'gap-{JOINT}-run'].panels[1]
        found = {c.label: c for c in panel.curves}
        high = 2.0 * bands._HALF
        for mode, words in ((Mode.FREE_FLIGHT, 'free flight'), (Mode.FOLLOWING, 'following')):
            c = found[words]
            width, heights = np.diff(c.x), c.y - c.low
            area = np.nansum(width * 0.5 * (heights[1:] + heights[:-1])) / high
            share = told.share[mode.name.lower()]
            assert area == pytest.approx(share * loose.end, rel=1e-3)


def test_energy_and_solver_agree_with_the_solution(loose, found, charts):
    solution = loose.piece
    (missing,) = curves(charts['energy-missing'])
    assert missing.y[-1] == pytest.approx(solution.energy.residual, abs=1e-12)
    (work,) = curves(charts['energy'], 'energy.drive_work')
    assert work.y[-1] == pytest.approx(solution.energy.drive_work, rel=1e-6)
    rows = dict(next(s for s in found if s.key == 'solver').rows)
    assert rows['digest'] == solution.digest()
    assert rows['steps'] == f'{solution.stats.steps}'
    assert rows['impacts'] == f'{len(solution.impacts)}'
    assert rows['largest error of a closure'] == f'{solution.max_closure_error:.3g} m'
    told = float(rows['energy error at the end'].removesuffix(' J'))
    assert told == pytest.approx(solution.energy.residual, abs=1e-15)


def test_a_sensor_has_its_peak_and_its_orders(loose, charts):
    signal = loose.signal('rocker_accelerometer').longest
    (c,) = curves(charts['sensor-rocker_accelerometer-run'])
    assert np.abs(c.y).max() == np.abs(signal).max()
    (orders,) = curves(charts['sensor-rocker_accelerometer-orders'])
    assert orders.x[np.argmax(orders.y)] == pytest.approx(1.0, abs=1e-3)
    marks = charts['sensor-rocker_accelerometer-density'].panels[0].marks
    rate = loose.machine.drive.start[1] / (2.0 * np.pi)
    assert marks[0].at == pytest.approx(max(1, math.ceil(marks[0].at / rate - 0.5)) * rate)


def test_what_a_sensor_measures_is_written_as_words():
    gyroscope = {'kind': 'gyroscope', 'link': 'rod', 'sample_rate': '1 kHz'}
    record = simulated('slider_crank', {'sensors.rate': gyroscope}, revolutions=0.5)
    (panel,) = charts_of(sections(record))['sensor-rate-run'].panels
    assert panel.y.title == 'angular velocity [rad/s]'


@pytest.mark.slow
def test_turns_at_the_start_can_be_left_out(loose):
    begin = loose.times_at(np.array([5.0]))[0]
    for chart in charts_of(sections(loose, skip=5)).values():
        if chart.over == 'time':
            assert min(np.nanmin(c.x) for c in curves(chart)) >= begin - 1e-6
    with pytest.raises(InputError, match='whole turns'):
        sections(loose, skip=10)


@pytest.mark.slow
def test_sensors_and_frames_of_a_part_are_those_of_the_whole(loose):
    """They do not begin anew where the part begins."""
    part = loose.between(0.7 * loose.end, 0.8 * loose.end)
    (sensor,) = part.sampled_sensors
    (run,), (t,) = part.signal(sensor).runs, part.signal(sensor).times
    (all_of_it,) = loose.signal(sensor).runs
    first = round((t[0] - loose.signal(sensor).starts[0]) * part.signal(sensor).rate)
    assert part.start <= t[0] < t[-1] <= part.end
    assert run.tolist() == all_of_it[first : first + len(run)].tolist()
    whole = simulated('four_bar_on_frame', revolutions=1.5)
    (name,) = whole.machine.scene.oscillators
    line = ChartedRun(whole.between(0.5 * whole.end)).run.lines[f'oscillator.{name}.y']
    frame = whole.machine.oscillator(name).take(whole.piece.motion)
    assert np.ptp(line.values) > 0.0
    assert line.values == pytest.approx(frame(line.at).position[1], rel=1e-9, abs=1e-15)


@pytest.mark.slow
def test_a_cam_and_a_gear_show_lift_off_and_backlash():
    charts = charts_of(sections(simulated('valve_train', revolutions=2.5)))
    (law,), (follower,) = (
        curves(charts['cam-contact-lift'], name)
        for name in ('lift.contact', 'follower_position.contact')
    )
    (gap,) = curves(charts['gap-contact'], 'gap.contact')
    assert (follower.y - law.y).max() == pytest.approx(gap.y.max(), rel=1e-4)  # a flat face
    assert (
        curves(charts['cam-contact-contact-force'], look='ideal')[0].y.min() < 0.0
    )  # ideal: held
    charts = charts_of(sections(simulated('gear_rattle', revolutions=2.5)))
    (left,), (right,) = (
        curves(charts['gap-mesh'], f'gap.mesh_{side}') for side in ('left', 'right')
    )
    error = curves(charts['gear-train-mesh-transmission-error'], 'transmission_error.mesh')[-1]
    assert np.ptp(error.y) == pytest.approx(left.y.max(), rel=1e-3)
    assert left.y.max() == pytest.approx(right.y.max(), rel=1e-6)


@pytest.mark.parametrize(
    ('t', 'y', 'digits'),
    [
        ((0.0, 1.0), (45.6e3, 45.6e3 + 1e-3), ('.6f', '.12g')),  # a micrometre at 45 m
        ((0.0, 1e-6), (1e9, 1e9 + 20.0), ('.10f', '.12g')),
        ((3600.0, 3600.0 + 1e-4), (0.0, 12.3), ('.8f', '.5g')),
        ((0.0, 1.0), (36.65, 36.65 + 1e-13), ('.6f', '.5g')),  # constant but for rounding
    ],
)
def test_a_page_tells_small_changes_of_large_values(t, y, digits):
    at, values = np.linspace(*t, 50), np.linspace(*y, 50)
    axes = Axis('time', 's'), Axis('position', 'mm')
    written = figure(Chart('key', 'title', (Panel(*axes, (ChartCurve(at, values),)),)))
    (trace,) = written['data']
    read = {k: np.frombuffer(base64.b64decode(trace[k]['bdata']), trace[k]['dtype']) for k in 'xy'}
    for known, shown in ((at, read['x']), (values, read['y'])):
        changes = np.ptp(known) if np.ptp(known) > 1e-9 * known.max() else known.max()
        assert np.abs(known - shown).max() < 1e-4 * changes
    assert trace['hovertemplate'].startswith(f'%{{x:{digits[0]}}} s<br>%{{y:{digits[1]}}} mm')
    if digits[1] == '.5g':
        assert read['y'].dtype == np.float32


def test_a_machine_of_micrometres_has_the_charts_of_a_large_one():
    """Of similar machines without weight forces are as the fourth power of the length."""
    shapes, ratio = [], 1e-4
    for s in (1.0, ratio):
        lengths = {'ground': 387, 'crank': 64, 'coupler': 309, 'rocker': 312}
        similar = {f'links.{link}.length': s * 1e-3 * x for link, x in lengths.items()}
        for link, (cog, mass, inertia) in {
            'crank': (9, 0.6, 2645), 'coupler': (185, 0.24, 2950), 'rocker': (134, 0.23, 3176)
        }.items():  # fmt: skip
            similar |= {
                f'links.{link}.cog': s * 1e-3 * cog, f'links.{link}.mass': s**3 * mass,
                f'links.{link}.inertia': s**5 * 1e-6 * inertia,
            }  # fmt: skip
        similar |= {'gravity': [0, 0], 'sensors': {}}
        run = simulated('four_bar_nominal', similar, revolutions=1)
        shapes.append(charts_of(sections(run)))
    large, small = shapes
    assert [*small] == [*large]
    for key, power in (('forces', 4), ('drive-torque', 5)):
        for own, other in zip(curves(small[key]), curves(large[key]), strict=True):
            assert own.y.max() == pytest.approx(ratio**power * other.y.max(), rel=1e-6)


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', one_of(3, ms.scene_names()))
def test_every_scene_has_its_charts(name):
    machine = ms.load_scene(name)
    span = {} if machine.scene.duration else {'revolutions': 1.3}
    record = Record(machine, ms.simulate(machine, **span), {})
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        found = sections(record)
    keys = [section.key for section in found]
    if name != 'spinning_beam':  # which turns steadily in the end
        assert keys[0] == 'motion'
    assert keys[-1] == 'solver'
    assert ('contact' in keys) == bool(machine.physics.clearances)
    assert ('energy' in keys) == machine.physics.has_forces
    table = record.piece.sample(np.linspace(record.start, record.end, 23))
    loads = [np.abs(x).max() for n, x in table.items() if re.fullmatch(r'reaction\..*\.[xy]', n)]
    assert ('forces' in keys) == (max(loads, default=0.0) > 1e-9)
    assert ('oscillators' in keys) == bool(machine.scene.oscillators)
    assert len(charts_of(found)) == sum(len(section.charts) for section in found)
    for chart in charts_of(found).values():
        assert any(len(c.x) for panel in chart.panels for c in panel.curves), chart.key
        for panel in chart.panels:
            for axis in (panel.x, panel.y):
                if not axis.names and 'gauge' not in chart.key:  # strains have no unit
                    assert re.search(r'\w \[.+\]$', axis.title), (chart.key, axis)
            for c in panel.curves:
                assert len(c.x) == len(c.y) <= 3 * MOST
                assert not len(c.x) or np.isfinite(c.y).any(), chart.key
        written = figure(chart)
        json.dumps(written, allow_nan=False)
        assert written['layout']['height'] < 4000


def test_panels_beside_each_other_are_above_each_other_where_it_is_narrow():
    """All that differs are places: no panel lies on another, and lines keep their axes."""
    at = np.array([0.0, 1.0])
    curve = ChartCurve(at, at)
    row = [Panel(Axis('angle', 'deg'), Axis('force', 'N'), (curve,), f'{k}') for k in range(5)]
    single = figure(Chart('key', 'title', tuple(row)))
    assert single['narrow'] == {}
    written = figure(Chart('key', 'title', tuple(row), columns=2))
    wide, narrow = written['layout'], written['layout'] | written['narrow']
    assert wide.keys() == narrow.keys()
    assert wide['yaxis']['domain'] == wide['yaxis2']['domain']
    domains = [narrow[f'yaxis{k or ""}']['domain'] for k in ('', 2, 3, 4, 5)]
    assert all(low > high for (low, _), (_, high) in pairwise(domains))
    assert {tuple(narrow[x]['domain']) for x in ('xaxis', 'xaxis2')} == {(0.0, 1.0)}
    assert narrow['height'] > wide['height']


def test_pale_lines_have_a_colour_on_dark_ground():
    """That of the ideal machine stayed dark there."""
    at = np.array([0.0, 1.0])
    pale = ChartCurve(at, at, colour=GROUND, look='ideal')
    band = ChartCurve(at, at, low=at, form='area', look='range')
    written = figure(Chart('key', 'title', (Panel(TIME, Axis('force', 'N'), (pale, band)),)))
    line, area = written['data']
    for shade in (line['line']['color'], area['fillcolor']):
        assert shade[:7] in NIGHT
        assert len(shade) == 9  # and how pale it is
