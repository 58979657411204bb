"""The page of a run in a browser: it plays, seeks and prints, and shows what the bag says."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from bags import angle_at, messages_of, write_bag
from browsing import Tab, boxes, open_page, overlapping, scrub, time_of, violations
from builders import EVERY_KIND, ROUGH, simulated

import mechanism_sim as ms
from mechanism_sim import output
from mechanism_sim.analysis.comparison import compare, run_names, scene_differences
from mechanism_sim.analysis.record import read_record
from mechanism_sim.pages import recorded as module
from mechanism_sim.pages import report
from mechanism_sim.pages.charts import sections
from mechanism_sim.pages.recorded import NEAR, recorded
from mechanism_sim.report.charts.chart import (
    DIRECTION,
    Axis,
    Chart,
    ChartCurve,
    ChartSection,
    Panel,
)

LENGTHS = {'ground': 0.387, 'crank': 0.064, 'coupler': 0.309, 'rocker': 0.312}
CLEARANCE = 0.254e-3


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    record = simulated('four_bar_clearance', ROUGH, revolutions=3)
    return write_bag(tmp_path_factory.mktemp('pages') / 'rough.mcap', record)


@pytest.fixture(scope='module')
def record(bag):
    return read_record(bag)


@pytest.fixture(scope='module')
def file(bag, record):
    path = bag.with_suffix('.html')
    output.write_text(path, report.page(recorded(record), sections(record), bag.name))
    return path


@pytest.fixture(scope='module')
def shared(browser, file, tmp_path_factory):
    """The page, opened once."""
    context = browser.new_context(viewport={'width': 1200, 'height': 800})
    tab = Tab(context.new_page(), tmp_path_factory.mktemp('shots'))
    open_page(tab, file)
    yield tab
    context.close()


@pytest.fixture
def opened(shared, file):
    """The page as it was when it opened, but for charts that have been seen."""
    shared.page.evaluate('window.scrollTo(0, 0)')
    shared.page.check('#forces')
    scrub(shared.page, 0.0)
    yield shared.page
    shared.page.emulate_media(media='screen')
    assert shared.complaints == []
    assert shared.requests == [file.as_uri()]


def when(page, condition):
    """Wait for it; the page forbids the evaluation of text, by which Playwright itself waits."""
    page.evaluate(
        f"""() => new Promise(done => {{
            const look = () => ({condition} ? done() : requestAnimationFrame(look));
            look();
        }})"""
    )


def drawn_boxes(page):
    """Of each path of the machine, by points along it: the browser's own are of turned boxes."""
    return page.locator('#stage .machine g path').evaluate_all(
        """all => all.map(path => {
            const to = path.getScreenCTM(), far = path.getTotalLength();
            const at = Array.from({ length: 65 }, (_, i) =>
                path.getPointAtLength(far * i / 64).matrixTransform(to));
            const [x, y] = [at.map(p => p.x), at.map(p => p.y)];
            return [Math.min(...x), Math.min(...y), Math.max(...x), Math.max(...y)];
        })"""
    )


def show(tab, folder, scene, overrides=(), **length):
    """Run a scene and open its page without charts; the run as it is shown."""
    run = recorded(simulated(scene, overrides, **length))
    file = folder / f'{scene}.html'
    output.write_text(file, report.page(run))
    open_page(tab, file)
    return run


def test_it_plays_and_stops(opened):
    assert time_of(opened) == 0.0
    places = {opened.locator('#stage g[data-kind=link]').last.get_attribute('transform')}
    opened.click('#play')
    when(opened, 'document.documentElement.dataset.time > 0.005')
    assert opened.locator('#play').get_attribute('aria-label') == 'pause'
    opened.evaluate('document.activeElement.blur()')  # a button has the space bar for itself
    opened.keyboard.press(' ')
    stopped = time_of(opened)
    places.add(opened.locator('#stage g[data-kind=link]').last.get_attribute('transform'))
    opened.evaluate('() => new Promise(done => setTimeout(done, 120))')
    assert time_of(opened) == stopped
    assert len(places) == 2
    said = opened.locator('#time').inner_text()
    assert float(said.removesuffix(' s')) == pytest.approx(stopped, abs=1e-5)
    assert opened.get_attribute('#scrub', 'aria-valuetext') == said


@pytest.mark.slow
def test_it_plays_in_a_cell_of_a_notebook(browser, tmp_path):
    machine = ms.load_scene('four_bar_clearance')
    player = ms.play(machine, ms.simulate(machine, duration=0.1), end=0.08)
    assert len(player._repr_html_()) < 300_000
    file = tmp_path / 'cell.html'
    file.write_text(f'<!doctype html><title>cell</title>{player._repr_html_()}', encoding='utf-8')
    tab = Tab(browser.new_page(), tmp_path)
    tab.page.goto(file.as_uri())
    inside = next(frame for frame in tab.page.frames if frame != tab.page.main_frame)
    inside.wait_for_selector('html[data-ready="1"]', state='attached')
    inside.click('#play')
    when(inside, 'document.documentElement.dataset.time > 0.005')
    assert inside.locator('#stage g[data-kind=link]').count() == 3
    assert not tab.complaints
    assert tab.requests == [file.as_uri()]
    tab.page.close()


def test_a_turn_takes_some_seconds_of_ours(opened, record):
    speed = float(opened.locator('#speed').input_value())
    assert 2.5 < 1.0 / (record.rate * speed) < 6.4


def test_keys_step_from_instant_to_instant(opened, record):
    t = recorded(record).frames.t
    apart = 1e-9 * t[-1]  # before and after an impact count as one
    t = t[np.append(True, np.diff(t) > apart)]
    opened.keyboard.press('End')
    assert time_of(opened) == t[-1]
    opened.keyboard.press('ArrowLeft')
    assert time_of(opened) == pytest.approx(t[-2], abs=apart)
    opened.keyboard.press('Home')
    for k in (1, 2, 3):
        opened.keyboard.press('ArrowRight')
        assert time_of(opened) == pytest.approx(t[k], abs=apart)
    opened.keyboard.press('ArrowLeft')
    assert time_of(opened) == pytest.approx(t[2], abs=apart)


@pytest.mark.slow
def test_the_lens_shows_the_pin_where_the_bag_has_it(opened, bag):
    """Loop closure with the angles of the recorded polynomials, read by another reader."""
    motions, seen = messages_of(bag, '/motion'), set()
    for share in (0.0, 0.07, 0.13, 0.21, 0.34, 0.48, 0.551, 0.6, 0.77, 0.893, 1.0):
        t = scrub(opened, share)
        angle = {link: angle_at(motions, link, t) for link in ('crank', 'coupler', 'rocker')}
        arms = [LENGTHS[link] * np.exp(1j * a) for link, a in angle.items()]
        wanted = arms[0] + arms[1] - LENGTHS['ground'] - arms[2]
        pin = opened.locator('#lens .journal')
        shown = complex(float(pin.get_attribute('data-x')), float(pin.get_attribute('data-y')))
        assert abs(shown - wanted) < 1.1 * NEAR * CLEARANCE
        # and as it is drawn: the middle of the pin from that of the bore, in their own scale
        bore, body, limit = (
            boxes(opened, f'#lens {x}')[0] for x in ('.bore', '.journal .body', '.limit')
        )
        middle = [0.5 * (b[0] + b[2]) - 0.5j * (b[1] + b[3]) for b in (bore, body)]
        scale = CLEARANCE / (0.5 * (limit[2] - limit[0]))
        assert abs((middle[1] - middle[0]) * scale - wanted) < 0.01 * CLEARANCE  # a pixel is 0.02
        seen.add(opened.locator('#lens .mode').text_content())
    assert {'free flight', 'sliding forward'} & seen
    assert len(seen) > 1


def test_arrows_are_the_forces_of_the_run(opened, record):
    t = scrub(opened, 0.3)
    data = json.loads(opened.locator('#data').text_content())['stage']
    told = record.piece.sample([t])
    unit = data['symbol'] / 10.0
    drawn = opened.locator('#stage .forces path').evaluate_all(
        'x => x.map(p => p.getAttribute("d"))'
    )
    for joint, path in zip(data['joints'], drawn, strict=True):
        corners = [complex(*map(float, p.split())) for p in re.findall(r'[-\d.]+ [-\d.]+', path)]
        foot, tip = 0.5 * (corners[0] + corners[-1]), corners[3]
        force = (tip - foot).conjugate() * unit / data['force_scale']
        name = f'reaction.{joint["name"]}'
        wanted = complex(told[f'{name}.x'][0], told[f'{name}.y'][0])
        assert abs(force - wanted) < 0.03 * abs(wanted) + 0.02 * unit / data['force_scale']
    opened.uncheck('#forces')
    assert boxes(opened, '#stage .forces path') == []


@pytest.mark.slow
def test_a_click_on_an_impact_goes_there(opened, record):
    chart = next(c.key for s in sections(record) for c in s.charts if c.key == 'impacts-run')
    place = opened.locator(f'[data-chart="{chart}"] .plot')
    place.scroll_into_view_if_needed()
    opened.wait_for_selector(f'[data-chart="{chart}"] .plot.js-plotly-plot')
    hardest = max(record.piece.impacts, key=lambda i: i.normal_impulse)
    x, y = place.evaluate(
        """(plot, t) => {
            const trace = plot._fullData.find(d => d.mode === 'markers');
            const i = Array.from(trace.x).findIndex(x => Math.abs(x - t) < 1e-9);
            const { xaxis, yaxis } = plot._fullLayout, box = plot.getBoundingClientRect();
            return [box.left + xaxis._offset + xaxis.l2p(trace.x[i]),
                    box.top + yaxis._offset + yaxis.l2p(yaxis.d2l(trace.y[i]))];
        }""",
        hardest.t,
    )
    opened.mouse.move(x - 2.0, y)
    opened.mouse.move(x, y)
    place.locator('.hovertext').wait_for()
    opened.mouse.click(x, y)
    when(opened, 'document.documentElement.dataset.time > 0')
    assert time_of(opened) == pytest.approx(hardest.t, abs=1e-9)
    (cursor,) = boxes(opened, f'[data-chart="{chart}"] .cursor')
    assert abs(0.5 * (cursor[0] + cursor[2]) - x) < 1.5


def test_a_click_over_the_angle_goes_to_when_the_drive_was_there(opened, record):
    place = opened.locator('figure.chart[data-axis=angle] .plot').first
    place.scroll_into_view_if_needed()
    opened.wait_for_selector('figure.chart[data-axis=angle] .plot.js-plotly-plot')
    x, y, angle = place.evaluate(
        """plot => {
            const traces = plot._fullData.filter(d => d.customdata);
            const trace = traces.filter(d => d.hoverinfo !== 'skip').at(-1);
            const i = trace.x.length >> 1, box = plot.getBoundingClientRect();
            const { xaxis, yaxis } = plot._fullLayout;
            return [box.left + xaxis._offset + xaxis.l2p(trace.x[i]),
                    box.top + yaxis._offset + yaxis.l2p(trace.y[i]), trace.x[i]];
        }"""
    )
    opened.mouse.move(x - 2.0, y)
    opened.mouse.move(x, y)
    place.locator('.hovertext').first.wait_for()
    opened.mouse.click(x, y)
    when(opened, 'document.documentElement.dataset.time > 0')
    shown = np.degrees(record.angle(np.array([time_of(opened)]))[0])
    assert shown == pytest.approx(angle, abs=2.0)
    assert float(opened.locator('#drive').inner_text().strip(' \u2007°')) == pytest.approx(
        shown, abs=0.1
    )


def chart_over(page, axis):
    """The first chart over that axis, drawn."""
    place = page.locator(f'figure.chart[data-axis={axis}] .plot').first
    place.scroll_into_view_if_needed()
    page.wait_for_selector(f'figure.chart[data-axis={axis}] .plot.js-plotly-plot')
    return place


@pytest.mark.slow
def test_the_machine_stays_beside_its_charts_and_follows_the_pointer(opened):
    """It is in sight however far down one reads; hovering over a curve takes it there."""
    chart_over(opened, 'time')
    ((_, top, _, bottom),) = boxes(opened, '#stage')
    assert 0.0 <= top < bottom <= 800.0
    place = chart_over(opened, 'angle')
    assert overlapping([*boxes(opened, '#machine'), *boxes(opened, 'main')]) == []
    x, y, t, name = place.evaluate(
        """plot => {
            const traces = plot._fullData.filter(d => d.customdata);
            const trace = traces.filter(d => d.hoverinfo !== 'skip').at(-1);
            const i = trace.x.length >> 2, box = plot.getBoundingClientRect();
            const { xaxis, yaxis } = plot._fullLayout;
            return [box.left + xaxis._offset + xaxis.l2p(trace.x[i]),
                    box.top + yaxis._offset + yaxis.l2p(trace.y[i]),
                    trace.customdata[i], trace.name];
        }"""
    )
    before = opened.locator('#stage g[data-kind=link]').last.get_attribute('transform')
    opened.mouse.move(x - 2.0, y)
    opened.mouse.move(x, y)
    when(opened, "document.querySelector('#stage.lit') !== null")
    assert time_of(opened) == pytest.approx(t, abs=0.01)
    assert opened.locator('#stage g[data-kind=link]').last.get_attribute('transform') != before
    lit = opened.locator('#stage g.lit').evaluate_all('all => all.map(x => x.dataset.link)')
    assert name in lit
    opened.mouse.move(5.0, 5.0)
    when(opened, "document.querySelector('#stage.lit') === null")


def test_a_joint_under_the_pointer_lights_its_curves(opened):
    chart_over(opened, 'angle')
    opened.locator('#stage g[data-kind=link][data-label=rocker] path').hover()
    shades = """() => Object.fromEntries([...document.querySelectorAll('.js-plotly-plot')]
        .flatMap(plot => plot._fullData.map(trace => [trace.legendgroup || trace.name,
            plot.querySelector(`.trace${trace.uid}`)?.style.opacity])))"""
    seen = opened.evaluate(shades)
    assert seen['position.rocker'] == ''
    assert seen['position.coupler'] == '0.12'
    opened.mouse.move(700.0, 5.0)
    assert set(opened.evaluate(shades).values()) <= {'', None}


@pytest.mark.slow
def test_no_entry_of_a_legend_is_under_the_buttons_of_its_chart(opened):
    """A click switches a line also where its entry is the last of a row."""
    chart = 'figure[data-chart=forces]'
    place = opened.locator(f'{chart} .plot')
    place.scroll_into_view_if_needed()
    opened.wait_for_selector(f'{chart} .legendtoggle')
    entries = boxes(opened, f'{chart} .legendtoggle')
    assert len(entries) == 5
    assert overlapping([*entries, *boxes(opened, f'{chart} .modebar')]) == []
    k = max(range(5), key=lambda i: entries[i][2])
    hidden = 'place => place._fullData.filter(x => x.visible !== true).map(x => x.name)'
    assert place.evaluate(hidden) == []
    entry = place.locator('.legendtoggle').nth(k)
    for count, by_key in ((1, False), (0, True), (1, True), (0, False)):
        opened.wait_for_timeout(400)  # two clicks would be a double one
        if by_key:
            entry.focus()
            opened.keyboard.press('Enter')
        else:
            entry.click()
        when(opened, f"{count} === document.querySelector('{chart} .plot')"
             "._fullData.filter(x => x.showlegend && x.visible !== true).length")  # fmt: skip
        assert entry.get_attribute('aria-pressed') == ('false' if count else 'true')
        assert entry.get_attribute('aria-label') == 'rocker_ground'


@pytest.mark.slow
def test_numbers_around_round_charts_are_not_cut(tab, tmp_path, record):
    chart = []
    for free, size in ((22.5, 0.25), (157.5, 0.4), (202.5, 0.25), (337.5, 0.4)):
        x = free + 45.0 * np.arange(1, 8)
        curve = ChartCurve(x, np.full(7, size), of='one')
        panel = Panel(DIRECTION, Axis('work', 'mN m', low=0.0), (curve,), form='polar')
        assert panel.free == free
        chart.append(Chart(f'{free:g}', 'Work', (panel,), 'polar'))
    file = tmp_path / 'round.html'
    part = ChartSection('round', 'Round', '', chart)
    output.write_text(file, report.page(recorded(record.between(0.0, 0.05)), [part]))
    tab.page.set_viewport_size({'width': 1280, 'height': 800})
    open_page(tab, file)
    tab.page.locator('figure.chart').last.scroll_into_view_if_needed()
    tab.page.wait_for_selector('figure[data-chart="337.5"] .plot.js-plotly-plot')
    cut = tab.page.locator('.plot').evaluate_all(
        """all => all.flatMap(plot => {
            const out = plot.getBoundingClientRect();
            return [...plot.querySelectorAll('.polarlayer text')].filter(text => {
                const box = text.getBoundingClientRect();
                return box.width && (box.left < out.left || box.right > out.right);
            }).map(text => text.textContent);
        })"""
    )
    assert cut == []
    seen = tab.page.locator('.radial-axis text').all_text_contents()
    assert sum(text.endswith(' mN·m') for text in seen) == 4
    assert tab.complaints == []


@pytest.mark.slow
def test_long_names_of_runs_go_on_a_phone(tab, tmp_path):
    other = {'start': 'centred', 'joints.coupler_rocker.clearance': {
        'radial': '0.1 mm', 'restitution': 0.3}}  # fmt: skip
    runs = [simulated('four_bar_clearance', x, duration=0.02) for x in ({}, other)]
    keys = scene_differences([x.machine.scene for x in runs])
    names = run_names(keys, ['a', 'b'])
    assert max(map(len, names)) > 40
    beside = report.ComparisonPage([recorded(runs[1])], names, keys, compare(*runs))
    text = report.page(recorded(runs[0]), [ChartSection('a', 'A', '', ())], beside=beside)
    file = tmp_path / 'two.html'
    output.write_text(file, text)
    for width in (390, 320):
        tab.page.set_viewport_size({'width': width, 'height': 844})
        open_page(tab, file)
        assert tab.page.evaluate('document.documentElement.scrollWidth') <= width
        assert tab.page.locator('.magnified > div').evaluate_all(
            'all => all.every(x => x.scrollWidth <= x.clientWidth)'
        )
    assert tab.complaints == []


@pytest.mark.slow
def test_no_number_of_a_table_is_parted_from_its_unit(tab, tmp_path, record):
    often = '99.9 % of the time at most'
    table = (
        ('joint', 'largest', 'at [s]', 'camshaft', 'above half for', 'impulse', often),
        ('contact', '651.1 N', '0.00849041', '23.39 deg', '1.815 ms', '971.4 mN s', '651.1 N'),
        ('drive', '4.794 N m', '0.00893783', '33.06 deg', '1.29 ms', '5.052 mN m s', '4.794 N m'),
    )
    part = ChartSection('loads', 'Loads', '', (), table=table)
    file = tmp_path / 'loads.html'
    output.write_text(file, report.page(recorded(record.between(0.0, 0.05)), [part]))
    tab.page.set_viewport_size({'width': 1280, 'height': 800})
    open_page(tab, file)
    assert tab.page.evaluate('document.documentElement.scrollWidth') <= 1280
    assert tab.page.locator('.figures thead').is_visible()
    lines = tab.page.locator('.figures tbody tr > *').evaluate_all(
        """all => all.map(cell => {
            const range = document.createRange();
            range.selectNodeContents(cell);
            return range.getClientRects().length === 1;
        })"""
    )
    assert lines == [True] * 14


@pytest.mark.slow
def test_no_pin_is_drawn_beyond_its_wall(tab, tmp_path, record, monkeypatch):
    """Also where cubics through few instants go there."""
    monkeypatch.setattr(module, 'MOST', 60)
    run = recorded(record)
    assert run.away > 0.1
    file = tmp_path / 'coarse.html'
    output.write_text(file, report.page(run))
    open_page(tab, file)
    far = tab.page.evaluate(
        """async () => {
            const { Recording } = await import('player');
            const run = new Recording(JSON.parse(document.getElementById('data').textContent));
            return Array.from({ length: 2000 }, (_, k) => (
                Math.hypot(...run.at(run.start + k / 2000 * (run.end - run.start)).pins[0])));
        }"""
    )
    assert 0.99 * CLEARANCE < max(far) <= CLEARANCE * (1.0 + 1e-6)
    assert tab.complaints == []


@pytest.mark.slow
def test_an_interval_that_is_brushed_is_played_over_and_over(opened, record):
    place = chart_over(opened, 'time')
    box = place.bounding_box()
    y = box['y'] + 0.5 * box['height']
    opened.mouse.move(box['x'] + 0.40 * box['width'], y)
    opened.mouse.down()
    opened.mouse.move(box['x'] + 0.45 * box['width'], y, steps=4)
    opened.mouse.up()
    when(opened, "!document.getElementById('loop').hidden")
    low, high = map(float, re.findall(r'[\d.]+', opened.locator('#loop').inner_text()))
    assert record.start < low < high < record.end
    assert high - low < 0.2 * (record.end - record.start)
    assert time_of(opened) == pytest.approx(low, abs=1e-4)
    opened.select_option('#speed', '0.2')
    opened.click('#play')
    seen = opened.evaluate(
        """() => new Promise(done => {
            const seen = [], look = () => {
                seen.push(Number(document.documentElement.dataset.time));
                if (seen.length < 90) requestAnimationFrame(look); else done(seen);
            };
            look();
        })"""
    )
    opened.click('#play')
    assert min(seen) >= low - 1e-4
    assert max(seen) <= high + 1e-4
    assert (np.diff(seen) < 0.0).any()  # it began again
    opened.evaluate('document.activeElement.blur()')
    opened.keyboard.press('Escape')
    assert opened.locator('#loop').is_hidden()
    opened.keyboard.press('End')
    assert time_of(opened) == pytest.approx(record.end)


@pytest.mark.slow
def test_at_night_text_and_lines_stand_out(browser, file, tmp_path):
    """WCAG 2.2: 4.5 for text, 3 for lines, by the colours that the browser computes; axe-core."""
    size = {'width': 1440, 'height': 900}
    context = browser.new_context(viewport=size, color_scheme='dark', bypass_csp=True)
    tab = Tab(context.new_page(), tmp_path)
    open_page(tab, file)
    chart_over(tab.page, 'angle')
    found = tab.page.evaluate(
        """() => {
            const canvas = document.createElement('canvas')
                .getContext('2d', { willReadFrequently: true });
            const light = (colour) => {
                canvas.fillStyle = colour; canvas.fillRect(0, 0, 1, 1);
                const [r, g, b] = [...canvas.getImageData(0, 0, 1, 1).data].map(x => x / 255)
                    .map(x => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4));
                return 0.2126 * r + 0.7152 * g + 0.0722 * b;
            };
            const all = (select, key) => [...document.querySelectorAll(select)]
                .map(x => light(getComputedStyle(x)[key]));
            return {
                ground: light(getComputedStyle(document.documentElement).backgroundColor),
                text: [...all('h1, h2, .text, dd, dt, figcaption, .contents a', 'color'),
                       ...all('.js-plotly-plot .xtick text, .js-plotly-plot .legendtext', 'fill')],
                lines: [...all('.js-plotly-plot .trace:last-child .js-line', 'stroke'),
                        ...all('#stage .body, #stage .line', 'stroke')],
            };
        }"""
    )
    assert found['ground'] < 0.02
    for kind, least in (('text', 4.5), ('lines', 3.0)):
        assert len(found[kind]) > 5
        assert min((x + 0.05) / (found['ground'] + 0.05) for x in found[kind]) >= least
    assert violations(tab.page) == []
    tab.page.click('h1')
    rings = []
    while len(rings) < 40 and 'BUTTON modebar-btn' not in [name for name, _ in rings]:
        tab.page.keyboard.press('Tab')
        rings.append(tab.page.evaluate(
            """() => [`${document.activeElement.tagName} ${document.activeElement.className}`,
                getComputedStyle(document.activeElement).outlineColor]"""
        ))  # fmt: skip
    assert rings[-1] == ['BUTTON modebar-btn', 'rgb(109, 179, 242)']
    assert {colour for _, colour in rings} == {'rgb(109, 179, 242)'}
    assert tab.complaints == []
    tab.shoot('report_dark')
    context.close()


@pytest.mark.slow
def test_paper_has_every_chart_and_no_controls(opened, record):
    count = sum(len(section.charts) for section in sections(record))
    drawn = opened.locator('.plot.js-plotly-plot')
    assert drawn.count() < count  # the rest waits until it comes into view
    opened.evaluate("window.addEventListener('afterprint', () => { window.printed = 1; })")
    paper = opened.pdf(format='A4')
    assert paper.startswith(b'%PDF')
    assert drawn.count() == count == opened.locator('figure.chart').count() > 10
    opened.emulate_media(media='print')
    assert not opened.locator('.controls').is_visible()
    assert not opened.locator('.contents').is_visible()
    assert opened.locator('#stage .callout').count() == 1
    assert not opened.locator('#stage .callout').is_visible()
    assert opened.locator('#lens .title').is_visible()  # which says of what it is
    assert opened.locator('#shown').inner_text().startswith('Shown at 0.0')


@pytest.mark.sample(1)
@pytest.mark.parametrize('width', [1200, 400])
def test_nothing_overlaps_or_sticks_out(tab, file, width):
    tab.page.set_viewport_size({'width': width, 'height': 800})
    open_page(tab, file)
    tab.page.check('#names')
    for share in (0.1, 0.35, 0.6, 0.85):
        scrub(tab.page, share)
        assert overlapping(boxes(tab.page, '#stage .names text')) == []
        assert overlapping(boxes(tab.page, '#lens p')) == []
    assert overlapping(boxes(tab.page, '.facts > div')) == []
    assert overlapping(boxes(tab.page, '.controls > *')) == []
    for selector in ('#stage', '#lens', '.facts > div', '.controls > *', '.report h1'):
        for left, _, right, _ in boxes(tab.page, selector):
            assert 0.0 <= left < right <= width, selector
    assert tab.page.evaluate('document.documentElement.scrollWidth') <= width
    tab.shoot(f'report_{width}')


@pytest.mark.slow
def test_every_kind_of_scene_is_drawn(tab, tmp_path):
    """As many shapes as its skeleton has, all within the picture."""
    for scene in EVERY_KIND:
        run = show(tab, tmp_path, scene, duration=0.05)
        scrub(tab.page, 0.4)
        drawn = tab.page.locator('#stage g[data-kind]').evaluate_all(
            'all => all.map(x => x.dataset.kind)'
        )
        wanted = [shape.kind for shape in run.stage.skeleton.shapes]
        assert sorted(drawn) == sorted(wanted)
        (stage,) = boxes(tab.page, '#stage')
        for box in drawn_boxes(tab.page):
            assert box[0] > stage[0] - 1.0, scene
            assert box[1] > stage[1] - 1.0, scene
            assert box[2] < stage[2] + 1.0, scene
            assert box[3] < stage[3] + 1.0, scene
        loose = run.stage.bearings or run.stage.plays
        assert tab.page.locator('#lens').count() == bool(loose)
        tab.shoot(f'report_{scene}')
    assert tab.complaints == []
    assert all(request.startswith('file:') for request in tab.requests)


@pytest.mark.slow
def test_each_of_several_bearings_has_its_lens(tab, tmp_path):
    second = {'joints.crank_coupler.clearance': {'radial': '0.1 mm', 'restitution': 0.3}}
    run = show(tab, tmp_path, 'four_bar_clearance', second, duration=0.05)
    titles = []
    for index in range(2):
        tab.page.select_option('#bearing', str(index))
        scrub(tab.page, 0.9)
        titles.append(tab.page.locator('#lens .title').text_content())
        shown = tab.page.locator('#lens .journal')
        at = math.hypot(*(float(shown.get_attribute(f'data-{x}')) for x in 'xy'))
        play = run.record.machine.plan.clearances[run.stage.bearings[index].name]
        assert at <= play.radial * (1.0 + 1e-6)
        assert f'{1e6 * play.radial:g} µm' in tab.page.locator('#lens .note').text_content()
    assert titles == ['crank_coupler', 'coupler_rocker']
    assert tab.complaints == []


@pytest.mark.slow
def test_teeth_and_cams_have_lenses_with_a_line_to_where_they_are(tab, tmp_path):
    run = show(tab, tmp_path, 'whole_machine', duration=0.1)
    for k, play in enumerate(run.stage.to_json()['plays']):
        tab.page.select_option('#bearing', str(len(run.stage.bearings) + k))
        t = scrub(tab.page, 0.7)
        told = run.record.piece.sample(np.array([t]))
        shown = float(tab.page.locator('#lens .journal').get_attribute('data-x'))
        if play['walls'] == 2:
            left, right = (told[f'gap.{play["joint"]}_{side}'][0] for side in ('left', 'right'))
            assert shown == pytest.approx(0.5 * (left - right), abs=1e-3 * play['width'])
        else:
            assert shown == pytest.approx(told[f'gap.{play["joint"]}'][0], abs=1e-9)
        assert overlapping(boxes(tab.page, '#stage .callout, #lens svg'))
        assert overlapping(boxes(tab.page, '#lens p')) == []
        tab.shoot(f'lens_{play["joint"]}')
    assert tab.complaints == []


@pytest.mark.slow
def test_a_block_in_its_guide_leans_as_its_corners_do(tab, tmp_path):
    """Its corners, as they are drawn, are as far from the walls as the gaps of the run."""
    leaning = {'links.slider.cog': ['15 mm', '10 mm']}
    run = show(tab, tmp_path, 'slider_with_play', leaning, duration=0.1)
    wide, least = 2e-3, []
    for share in (0.15, 0.4, 0.55, 0.7, 0.85):
        t = scrub(tab.page, share)
        told = run.record.piece.sample(np.array([t]))
        corners = tab.page.locator('#lens .journal').evaluate(
            """rect => [['x', 'y'], ['X', 'y'], ['x', 'Y'], ['X', 'Y']].map(([x, y]) => {
                const of = rect.getBBox(), at = new DOMPoint(
                    x === 'x' ? of.x : of.x + of.width, y === 'y' ? of.y : of.y + of.height);
                const to = at.matrixTransform(rect.getScreenCTM());
                return to.x; })"""
        )
        walls = sorted(boxes(tab.page, '#lens .part:not(.journal)'))
        inner = walls[0][2], walls[1][0]
        half = 0.5 * (corners[1] - corners[0])
        metre = (inner[1] - inner[0] - 2.0 * half) / wide
        for name, x, wall in zip(
            ('front_left', 'front_right', 'rear_left', 'rear_right'),
            corners,
            inner * 2,
            strict=True,
        ):
            gap = abs(x - wall) / metre
            assert gap == pytest.approx(told[f'gap.guide_{name}'][0], abs=0.02 * wide)
        least.append(abs(corners[2] - corners[0]) / metre)
    assert max(least) > 0.05 * wide
    assert overlapping(boxes(tab.page, '#lens p')) == []
    tab.shoot('lens_guide')
    assert tab.complaints == []


@pytest.mark.slow
def test_paths_of_points_and_scales_are_those_of_the_machine(tab, tmp_path):
    """The toe's path by `cycle`; a bar and an arrow as long as they say."""
    run = show(tab, tmp_path, 'ten_links', revolutions=1)
    stage, told = run.stage, run.stage.to_json()
    unit = stage.skeleton.symbol / 10.0
    (path,) = tab.page.locator('#stage .paths path').evaluate_all(
        'all => all.map(x => x.getAttribute("d"))'
    )
    numbers = np.array(re.findall(r'[-\d.]+', path), float).reshape(-1, 2)
    seen = np.stack([stage.low[0] + unit * numbers[:, 0], stage.high[1] - unit * numbers[:, 1]])
    found = ms.cycle(run.record.machine, samples=2001, points=['foot.toe'])
    true = np.stack([found[f'position.foot.toe.{axis}'] for axis in 'xy'])
    far = [np.hypot(*(true - at[:, None])).min() for at in seen.T]
    assert max(far) < 0.1 * stage.skeleton.symbol  # of the path, whose points are so far apart
    assert np.ptp(seen, axis=1) == pytest.approx(np.ptp(true, axis=1), rel=1e-2)
    bar, arrow = (
        tab.page.locator(f'#stage .rule{x} path').first.evaluate('x => x.getBBox().width')
        for x in (':not(.of-forces)', '.of-forces')
    )
    assert bar * unit == pytest.approx(told['scale']['length'], rel=1e-2)
    assert arrow * unit == pytest.approx(told['force'] * told['force_scale'], rel=1e-2)
    assert overlapping(boxes(tab.page, '#stage .rule text')) == []
    tab.page.uncheck('#paths')
    assert not tab.page.locator('#stage .paths path').is_visible()


@pytest.mark.slow
def test_a_frame_on_springs_sways_as_much_as_the_scale_bar_says(tab, tmp_path):
    """Its picture, less the magnification, is what the frame's own equations give then."""
    run = show(tab, tmp_path, 'four_bar_on_frame', revolutions=1)
    (times,) = run.stage.skeleton.sways.values()
    rule = tab.page.locator('#stage .rule:not(.of-forces) text').text_content()
    assert rule.endswith(f'; sway {times:g} times larger')
    frame = run.record.machine.oscillator('frame').take(run.record.history)
    part = run.record.machine.scene.oscillators['frame']
    unit = run.stage.skeleton.symbol / 10.0
    seen = []
    for share in (0.2, 0.5, 0.8):
        t = scrub(tab.page, share)
        drawn = tab.page.locator('#stage g[data-kind=frame]').get_attribute('transform')
        x, y, angle = (float(n) for n in re.findall(r'-?[\d.]+(?:e-?\d+)?', drawn)[:3])
        place = run.stage.low[0] + unit * x, run.stage.high[1] - unit * y
        true = frame(t).position[:, 0]
        moved = [*(np.array(place) - part.cog), -math.radians(angle)]
        assert moved == pytest.approx((times * true).tolist(), rel=2e-2, abs=1e-6)
        seen.append(moved[1])
    assert np.ptp(seen) > 0.1 * run.stage.skeleton.symbol
    assert tab.complaints == []


@pytest.mark.slow
def test_the_keyboard_goes_through_the_page_as_it_is_read(opened):
    """Contents, machine, lens, player; each seen to have the focus, none twice."""
    opened.click('h1')  # from here on
    seen = []
    for _ in range(40):
        opened.keyboard.press('Tab')
        seen.append(opened.evaluate(
            """() => {
                const at = document.activeElement, box = at.getBoundingClientRect();
                const ring = getComputedStyle(at).outlineStyle;
                return [at.id || at.getAttribute('href') || at.tagName, box.width > 0, ring];
            }"""
        ))  # fmt: skip
        if seen[-1][0] == 'forces':
            break
    names = [name for name, *_ in seen]
    count = opened.locator('.contents a').count()
    assert count > 5
    assert all(name.startswith('#section-') for name in names[:count])
    wanted = ['machine', 'back', 'play', 'on', 'scrub', 'speed', 'names', 'forces']
    assert names[count:] == wanted
    assert all(shown and ring != 'none' for _, shown, ring in seen)


@pytest.mark.slow
def test_a_minute_is_a_page_like_any_other(tab, tmp_path):
    """350 turns, 17,000 impacts: less than 10 MB, opened like one of a second, all of it there."""
    pages = [_page_of(seconds, tmp_path) for seconds in (1.0, 60.0)]
    assert pages[1].stat().st_size < 10e6
    short, minute = np.min([[_cost(tab, file) for file in pages] for _ in range(3)], axis=0)
    assert minute < 1.5 * short  # 0.95 to 1.1 measured
    tab.page.keyboard.press('End')
    assert time_of(tab.page) == pytest.approx(60.0, abs=1e-9)
    assert tab.complaints == []


def _page_of(seconds: float, folder: Path) -> Path:
    run = recorded(simulated('four_bar_clearance', duration=seconds))
    file = folder / f'{seconds:g}.html'
    output.write_text(file, report.page(run, sections(run.record)))
    return file


def _cost(tab: Tab, file: Path) -> float:
    """CPU time [s] of a page from its address to its first chart."""
    session = tab.page.context.new_cdp_session(tab.page)
    session.send('Performance.enable', {'timeDomain': 'threadTicks'})
    open_page(tab, file)
    tab.page.wait_for_selector('.js-plotly-plot .trace', state='attached')
    told = {x['name']: x['value'] for x in session.send('Performance.getMetrics')['metrics']}
    session.detach()
    return float(told['TaskDuration'])


@pytest.mark.slow
@pytest.mark.parametrize('speed', [-30.0, -1.0])
def test_the_lens_says_how_far_a_follower_parts_if_it_does(tab, tmp_path, speed):
    valve = simulated('valve_train', {'drive.speed': speed}, duration=0.2)
    path = tmp_path / 'valve.html'
    output.write_text(path, report.page(recorded(valve), sections(valve), 'valve'))
    open_page(tab, path)
    said = tab.page.inner_text('#lens .note')
    far = valve.piece.sample(np.linspace(0.0, 0.2, 2001))['gap.contact'].max()
    if far > 1e-9:
        told = float(re.match(r'at most ([\d.]+) mm, \d', said)[1])
        assert 1e-3 * told == pytest.approx(far, rel=0.02)
    else:
        assert far < 1e-12
        assert re.match(r'space drawn [\d.]+ µm, [\d.]+ × true size', said)
