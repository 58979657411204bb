"""Two runs beside each other: their differences by readers and formulas of others."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
import scipy
from bags import messages_of, write_bag
from browsing import Tab, browsing
from builders import PLAY, simulated
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.analysis.comparison import compare, run_names
from mechanism_sim.analysis.record import read_record
from mechanism_sim.errors import InputError
from mechanism_sim.pages.charts import sections
from mechanism_sim.report.charts.overlay import overlaid

TURN = 2.0 * math.pi / 36.6519
SENSOR = 'rocker_accelerometer'
WORN = 'joints.coupler_rocker.clearance.restitution=0.8'


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    folder = tmp_path_factory.mktemp('compare')
    files = folder / 'fresh.mcap', folder / 'worn.mcap'
    for file, more in zip(files, ([], ['--set', WORN]), strict=True):
        done = run('run', 'four_bar_clearance', '--revolutions', '3', '--record', str(file), *more)
        assert done.returncode == 0, done.stderr
    return files


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    record = simulated('four_bar_clearance', duration=0.1)
    return write_bag(tmp_path_factory.mktemp('compare') / 'short.mcap', record)


@pytest.fixture(scope='module')
def compared(bags, tmp_path_factory):
    file = tmp_path_factory.mktemp('page') / 'both.html'
    return file, run_json('report', *map(str, bags), '-o', str(file))


@pytest.mark.network
@pytest.mark.slow
def test_differences_are_those_that_another_reader_finds_in_the_bags(bags, compared):
    """Impacts message by message; the signal by scipy's own estimate of its spectrum."""
    found = {(d['subject'], d['name']): d for d in compared[1]['differences']}
    for which, bag in zip(('first', 'second'), bags, strict=True):
        impacts = messages_of(bag, '/impacts')
        value = {key: d[which] for key, d in found.items()}
        assert value['impacts', 'count'] == len(impacts) > 20
        assert value['impacts', 'count per turn'] == pytest.approx(len(impacts) / 3)
        for name, field, of in (
            ('hardest', 'normal_impulse', max), ('sum of impulses', 'normal_impulse', math.fsum),
            ('energy loss', 'energy_loss', math.fsum),
            ('fastest approach', 'approach_speed', max),
        ):  # fmt: skip
            wanted = of(getattr(m, field) for m in impacts)
            assert value['impacts', name] == pytest.approx(wanted, rel=1e-14)
            assert value['impacts', f'coupler_rocker {name}'] == value['impacts', name]
        blocks = messages_of(bag, f'/accelerometer/{SENSOR}')
        x, rate = np.concatenate([m.samples for m in blocks]), blocks[0].sample_rate
        assert value['sensors', f'{SENSOR} rms'] == pytest.approx(np.sqrt(np.mean(x**2)))
        assert value['sensors', f'{SENSOR} peak'] == np.abs(x).max()
        assert value['sensors', f'{SENSOR} kurtosis'] == pytest.approx(
            scipy.stats.kurtosis(x, fisher=False)
        )
        f, p = scipy.signal.periodogram(x[: round(3 * TURN * rate)], rate)  # whole turns
        inside = (f >= 10.0) & (f <= 1000.0)
        speed = np.sqrt((p[inside] / (2 * np.pi * f[inside]) ** 2).sum() * f[1])
        assert value['severity', f'{SENSOR} velocity, rms'] == pytest.approx(speed, rel=1e-9)
        parts = scipy.signal.welch(x - x.mean(), rate, 'hann', 512, detrend=False)
        for middle, nominal, (g, q) in ((125.0, '125', (f, p)), (1000.0, '1000', parts)):
            inside = (g >= middle / math.sqrt(2)) & (g < middle * math.sqrt(2))
            assert value['spectra', f'{SENSOR} octave at {nominal} Hz'] == pytest.approx(
                math.sqrt(q[inside].sum() * g[1]), rel=1e-9
            )
        ends = read_record(bag).piece.sample(np.array([0.0, 3 * TURN]))  # energy is conserved
        gain = sum(np.diff(ends[f'energy.{kind}'])[0] for kind in ('kinetic', 'potential'))
        work, lost = (value['energy', x] for x in ('work of drives', 'dissipated'))
        assert work - lost == pytest.approx(gain, rel=1e-6)
    assert found['impacts', 'count']['change'] > 20


@pytest.mark.slow
def test_octaves_weigh_all_of_a_run_alike():
    """As lines of whole turns do; a window as long as the run had 22 % too much at 2 kHz.

    The half second at either end, which the segments weigh less, is little of so long a run.
    """
    record = ms.open_run(ms.simulate('four_bar_clearance', revolutions=300))
    value = {(d.subject, d.name): d.values[0] for d in compare(record, record)}
    x = record.signal(SENSOR).longest[: round(300 * TURN * 1e4)]
    f, p = scipy.signal.periodogram(x, 1e4)
    for nominal in (125, 250, 500, 1000, 2000):
        inside = (f >= nominal / math.sqrt(2)) & (f < nominal * math.sqrt(2))
        size = math.sqrt(p[inside].sum() * f[1])
        name = f'{SENSOR} octave at {nominal} Hz'
        assert value['spectra', name] == pytest.approx(size, rel=0.03)


@pytest.mark.parametrize('turns', [2, pytest.param(5, marks=pytest.mark.slow)])
def test_few_turns_have_the_severity_and_the_octaves_of_many(turns):
    """Of a crosshead at 25 Hz, by its Fourier series; Hann's window had 20 % too much of two."""
    sensors = {'head': {'link': 'piston', 'axis': 'along', 'sample_rate': '10 kHz'}}
    scene = ms.load_scene('slider_crank', {'sensors': sensors, 'drive.speed': '1500 rpm'})
    record = ms.open_run(ms.simulate(scene, revolutions=turns))
    value = {(d.subject, d.name): d.values[0] for d in compare(record, record)}
    r, rod, angle = 0.05, 0.2, np.arange(1024) * math.tau / 1024
    way = r * np.cos(angle) + np.sqrt(rod**2 - (r * np.sin(angle)) ** 2)
    w, k = math.tau * 25.0, np.arange(1, 9)
    rms = np.abs(np.fft.rfft(way)[k]) / 512.0 / math.sqrt(2.0)
    speed = math.sqrt(((k * w * rms) ** 2).sum())
    assert value['severity', 'head velocity, rms'] == pytest.approx(speed, rel=1e-6)
    for nominal, order in (('31.5', 1), ('63', 2)):
        size = rms[order - 1] * (order * w) ** 2
        assert value['spectra', f'head octave at {nominal} Hz'] == pytest.approx(size, rel=1e-6)


@pytest.mark.network
@pytest.mark.slow
def test_an_ideal_bag_differs_from_a_worn_one_as_another_reader_finds(bags, tmp_path):
    """Impacts, signal, and the forces of the messages, which the largest ones come up to."""
    ideal, (_, worn) = tmp_path / 'ideal.mcap', bags
    fine = ['--set', 'outputs.joint_reactions=5 kHz']
    done = run('run', 'four_bar_nominal', '--revolutions', '3', '--record', str(ideal), *fine)
    assert done.returncode == 0, done.stderr
    said = run_json('report', str(ideal), str(worn), '-o', str(tmp_path / 'both.html'))
    found = {(d['subject'], d['name']): d for d in said['differences']}
    hits = messages_of(worn, '/impacts')
    assert messages_of(ideal, '/impacts') == []
    for name, wanted in (
        ('count', len(hits)), ('sum of impulses', math.fsum(m.normal_impulse for m in hits)),
        ('energy loss', math.fsum(m.energy_loss for m in hits)),
    ):  # fmt: skip
        difference = found['impacts', f'coupler_rocker {name}']
        assert difference['first'] == 0.0
        assert difference['second'] == difference['change'] == pytest.approx(wanted, rel=1e-14)
    rms = []
    for which, bag in (('first', ideal), ('second', worn)):
        signal = np.concatenate([m.samples for m in messages_of(bag, f'/accelerometer/{SENSOR}')])
        rms.append(np.sqrt(np.mean(signal**2)))
        assert found['sensors', f'{SENSOR} rms'][which] == pytest.approx(rms[-1])
        reactions = messages_of(bag, '/joint_reactions')
        for k, joint in enumerate(reactions[0].joints):
            largest = max(math.hypot(m.force_x[k], m.force_y[k]) for m in reactions)
            told = found['peaks', f'{joint} largest force'][which]
            assert told >= largest * (1.0 - 1e-12)
            if which == 'first':  # smooth: 800 messages in a turn come near it
                assert told == pytest.approx(largest, rel=1e-4)
    assert found['sensors', f'{SENSOR} rms']['change'] == pytest.approx(rms[1] - rms[0])


@pytest.mark.slow
def test_an_ideal_machine_has_no_impacts_beside_a_worn_one():
    one, two = (
        simulated(scene, revolutions=2) for scene in ('four_bar_nominal', 'four_bar_clearance')
    )
    found = {(d.subject, d.name): d for d in compare(one, two)}
    hits = found['impacts', 'coupler_rocker count']
    assert hits.values == (0.0, len(two.piece.impacts))
    assert math.isnan(hits.ratio)
    force = found['peaks', 'coupler_rocker largest force']
    x, y = (ms.cycle(one.machine)[f'reaction.coupler_rocker.{axis}'] for axis in 'xy')
    assert force.values[0] == pytest.approx(np.hypot(x, y).max(), rel=1e-3)
    back = {(d.subject, d.name): d for d in compare(two, one)}
    for key, d in found.items():
        if math.isfinite(d.change):
            assert back[key].change == -d.change, key


def test_a_run_does_not_differ_from_itself():
    record = simulated('valve_train', duration=0.05)
    assert [d for d in compare(record, record) if d.values[0] == d.values[0] and d.change] == []


def test_work_that_is_rounding_of_the_energy_is_none():
    """An ideal machine has its energy again after each turn: there is no ratio to its work."""
    one, two = (
        simulated(scene, revolutions=5) for scene in ('four_bar_nominal', 'four_bar_clearance')
    )
    work = next(d for d in compare(one, two) if d.name == 'work of drives')
    view = two.piece.view(np.array([two.start, two.end]))
    assert work.values == (0.0, np.ptp(view.drive_work) * np.sign(np.diff(view.drive_work)[0]))
    assert math.isnan(work.ratio)


def test_work_that_is_not_known_is_not_none():
    """A bag does not say which of several drives gave the impulse in an impact."""
    part = simulated('four_bar_clearance', {'start': 'centred'}, duration=0.1).between(0.0, 0.09)
    lacking = [impact._replace(drive_work=math.nan) for impact in part.piece.impacts]
    balance = part.piece.balance._replace(impacts=lacking)
    found = compare(replace(part, piece=replace(part.piece, balance=balance)), part)
    work, lost = (next(d for d in found if d.name == x) for x in ('work of drives', 'dissipated'))
    assert math.isnan(work.values[0])
    assert work.values[1] != 0.0
    assert lost.values[0] == lost.values[1] > 0.0


def test_charts_have_the_lines_of_both_runs():
    one, two = (
        simulated(scene, revolutions=2) for scene in ('four_bar_nominal', 'four_bar_clearance')
    )
    first, second = sections(one), sections(two)
    found = overlaid([first, second], ['ideal', 'worn'])
    both = {chart.key: chart for s in found for chart in s.charts}
    assert len(both) == sum(len(s.charts) for s in found)  # keys are unique
    (speeds,) = (c for s in second for c in s.charts if c.key == 'motion-velocity-turning')
    own = {c.label: c for c in speeds.panels[0].curves if not c.look}
    panels = both['motion-velocity-turning'].panels
    assert [p.title for p in panels] == ['crank', 'coupler', '', 'rocker', '']
    assert [c.label for c in panels[0].curves if not len(c.x)] == ['ideal', 'worn']
    for name, panel, below in zip(('coupler', 'rocker'), panels[1::2], panels[2::2], strict=True):
        ideal, worn = panel.curves
        assert worn.y is own[name].y
        assert (ideal.group, worn.group) == ('ideal', 'worn')
        assert ideal.dash != worn.dash
        assert ideal.colour != worn.colour
        (less,) = below.curves
        assert (less.group, less.dash, below.y.title) == ('worn', worn.dash, 'difference [rad/s]')
        for angle in (12.3, 123.4, 234.5):  # by interpolation of my own
            a, b, c = (float(np.interp(angle, x.x, x.y)) for x in (ideal, worn, less))
            assert c == pytest.approx(b - a, abs=1e-3)
    assert 'forces' in both
    assert any(key.endswith('-1') for key in both)  # of contacts, which the ideal one has not


@pytest.mark.slow
def test_runs_are_named_by_what_differs_in_their_scenes(tmp_path):
    values = '0.1 mm', '0.2 mm', '0.4 mm'
    changes = [f'{PLAY}.radial={value}' for value in values]
    several = '--compare', f'{PLAY}.radial={",".join(values)}', '-o', str(tmp_path / 'x.html')
    said = run_json('report', 'four_bar_clearance', '--revolutions', '1', *several)
    assert said['runs'] == [f'four_bar_clearance with {change}' for change in changes]
    assert said['scenes'] == [{'path': f'{PLAY}.radial', 'values': list(values)}]
    page = (tmp_path / 'x.html').read_text(encoding='utf-8')
    assert all(f'<b>radial {value}</b>' in page for value in values)
    alone = [simulated('four_bar_clearance', {f'{PLAY}.radial': x}, revolutions=1) for x in values]
    for row in said['differences']:
        if row['name'] == 'count':
            assert row['values'] == [len(record.piece.impacts) for record in alone]
    assert run_names({'drive.speed': ('300 rpm', '400 rpm')}, ['a', 'b']) == (
        'speed 300 rpm', 'speed 400 rpm')  # fmt: skip
    many = {f'key_{i}': ('1 mm', '2 mm') for i in range(9)}
    assert run_names(many, ['a.yaml', 'b.yaml']) == ('a.yaml', 'b.yaml')
    assert run_names({}, ['a', 'a']) == ('run 1', 'run 2')


def test_a_run_without_a_key_is_named_by_its_source():
    """An ideal joint has no clearance: `radial –` says less than the name of its scene."""
    found = {'start': ('–', 'seated'), f'{PLAY}.radial': ('–', '0.254 mm')}
    assert run_names(found, ['ideal', 'worn.mcap']) == ('ideal', 'worn.mcap')
    assert run_names(found, ['a', 'a']) == ('start –, radial –', 'start seated, radial 0.254 mm')


@pytest.mark.slow
def test_a_variant_of_a_scene_is_compared_with_it(tmp_path):
    file = tmp_path / 'variant.html'
    said = run_json(
        'report', 'slider_crank', '--revolutions', '1', '--set-other', 'drive.speed=600 rpm', '-o',
        str(file),
    )  # fmt: skip
    assert said['runs'] == ['slider_crank', 'slider_crank with drive.speed=600 rpm']
    data = json.loads(re.search(r'<script[^>]*id="data">(.*?)</script>', file.read_text())[1])
    assert data['others'][0]['stage']['bounds'] == data['stage']['bounds']
    assert {d['subject'] for d in said['differences']} >= {'peaks', 'energy'}


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('report', 'pendulum', 'gear_pair', '--duration', '0.1'), 'there is nothing to compare'),
        (('report', '{0}', '{1}', '--set', WORN), 'a bag is shown as it was recorded'),
        (('report', '{0}', '--set-other', WORN), 'a bag is shown as it was recorded'),
        (('report', '{0}', 'four_bar_clearence'), "did you mean 'four_bar_clearance'"),
        (('report', '{0}', '{1}', '-o', 'x.pdf'), 'the ending must be'),
    ],
)
def test_bad_input_is_one_sentence(arguments, words, bag, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(*(x.format(bag, bag) for x in arguments))
    assert done.returncode == 2, done.stderr
    assert words in done.stderr
    assert done.stderr.count('\n') == 1


def test_no_common_name_is_refused():
    one, two = (simulated(scene, duration=0.02) for scene in ('pendulum', 'gear_pair'))
    with pytest.raises(InputError, match='nothing to compare'):
        compare(one, two)


@pytest.mark.network
@pytest.mark.slow
@pytest.mark.parametrize('width', [1440, 390])
def test_the_page_shows_both_machines(compared, tmp_path, width):
    file, _ = compared
    with browsing() as browser:
        if browser is None:
            pytest.skip('no browser')
        tab = Tab(browser.new_page(viewport={'width': width, 'height': 900}), tmp_path)
        tab.page.goto(f'file://{file}')
        tab.page.wait_for_selector('html[data-ready]', timeout=60_000)
        tab.page.evaluate(
            "document.getElementById('scrub').value = 0.6;"
            "document.getElementById('scrub').dispatchEvent(new Event('input'))"
        )
        boxes = [tab.page.locator(x).bounding_box() for x in ('#stage', '.ghost')]
        for side in ('x', 'y', 'width', 'height'):
            assert boxes[0][side] == pytest.approx(boxes[1][side], abs=1.0)
        moved = [
            tab.page.locator(f'{x} g[data-link=rocker]').first.get_attribute('transform')
            for x in ('#stage', '.ghost')
        ]
        assert None not in moved
        lenses = [
            [float(tab.page.locator(f'{x} .journal').get_attribute(f'data-{a}')) for a in 'xy']
            for x in ('#lens', '.beside')
        ]
        assert lenses[0] != lenses[1]  # they have parted since
        assert tab.page.locator('#differences tbody tr').count() > 20
        assert tab.page.evaluate('document.documentElement.scrollWidth') <= width
        assert tab.complaints == []
        assert all(request.startswith('file:') for request in tab.requests)
        tab.shoot(f'compare_{width}')
