"""Every kind of page, narrow and wide, light and dark: what axe-core finds, and what overlaps.

``make evidence`` keeps screenshots of all of them in build/evidence.
"""

from __future__ import annotations

import csv
import time
import tomllib
from contextlib import ExitStack
from importlib.metadata import version
from types import SimpleNamespace

import numpy as np
import pytest
from browsing import Firefox, Tab, boxes, firefox, overlapping, violations
from builders import simulated
from editing import Hand, editing
from live_pages import Acted, motion_messages
from middleware_network import eventually
from packaging.requirements import Requirement
from running import ROOT

import mechanism_sim as ms
from mechanism_sim import output
from mechanism_sim.pages import report
from mechanism_sim.pages.assets import contents_of
from mechanism_sim.pages.charts import sections
from mechanism_sim.pages.recorded import recorded
from mechanism_sim.pages.server import Command, Server
from mechanism_sim.pages.view import MODULES
from mechanism_sim.pages.writing import write_comparison

REPORT = (
    '.facts > div', '.controls > *', '#lens p', '.contents li', '.report h2',
    'figure.machine, #lens > *, #machine > .controls',
)  # fmt: skip
SITE = ROOT / 'build' / 'site'
TEXTS = {
    'report': REPORT,
    'compare': (
        '.facts > div',
        '.controls > *',
        '#lens p',
        '#lens-other p',
        '#lens > *, .beside > *',
    ),
    'explore': ('.family > label, .family > output', '.family text', '.controls > *'),
    'live': ('.controls > *', '.slider', '.strips figure', '#lens p', '.live header > *'),
    'waiting': ('.live header > *', '.waiting p, .waiting pre'),
    'edit': ('header > h1, header .file > *', '#palette button', '.tabs button', 'footer > *'),
    **{
        f'report/{scene}': REPORT
        for scene in (
            'valve_train',
            'planetary',
            'geneva',
            'elastic_slider_crank',
            'rotor_run_up',
            'bevel_pair',
            'four_bar_on_frame',
            'slider_with_play',
            'ten_links',
            'mass_on_spring',
        )
    },
    'site/index.html': ('article h1', 'article h2, article table'),
    'site/runs/geneva.html': ('.controls > *', '.contents li', '.back, .kind b, .report h1'),
    'site/docs/physics.html': ('article h2, article p', 'article mtable, article p'),
    'site/docs/lessons/README.html': (
        'article h1, article section > p',
        'article section > p, article table',
    ),
    'site/docs/mechanisms.html': ('a.plays', 'article h2', 'button.motion, article h1'),
    'site/docs/lessons/05_cams.html': ('article h2, article p', 'article iframe, article p'),
    'site/docs/tutorial.html': ('article h2, article pre', 'article iframe, article p'),
}
"""Pages, and of each what must not overlap what else is chosen by the same words."""
SCROLL = ('#palette button',)
"""Whose parent scrolls where it is too narrow."""
QUICK = 'live', 1440, 'dark'
"""That of reports is in their own tests."""
RADIAL = 'joints.coupler_rocker.clearance.radial'
HIGH = {1440: 900, 390: 844}
LOOKS = [(1440, 'light'), (390, 'dark'), (390, 'light'), (1440, 'dark')]


@pytest.fixture(scope='module')
def pages(tmp_path_factory):
    """The files of pages that are files, made when they are asked for first."""
    folder, made = tmp_path_factory.mktemp('pages'), {}

    def text(kind):
        if kind == 'explore':
            values = ['0.1 mm', '0.254 mm']
            path = 'joints.coupler_rocker.clearance.radial'
            return ms.explore('four_bar_clearance', path, values, 'gap.coupler_rocker').page
        if scene := kind.partition('/')[2]:
            run = recorded(simulated(scene))
            return report.page(run, sections(run.record))
        run = simulated('four_bar_clearance', revolutions=2)
        if kind == 'report':
            return report.page(recorded(run), sections(run))
        worn = simulated('four_bar_clearance', {'drive.speed': '300 rpm'}, revolutions=2)
        write_comparison([run, worn], ['a', 'b'], folder / 'compare.html')
        return (folder / 'compare.html').read_text(encoding='utf-8')

    def file(kind):
        if kind.startswith('site/'):
            found = SITE / kind.removeprefix('site/')
            if not found.exists():
                pytest.skip('the site has not been built: make docs')
            return found
        if kind not in made:
            made[kind] = folder / f'{kind.replace("/", "_")}.html'
            output.write_text(made[kind], text(kind))
        return made[kind]

    return file


def show(kind, tab, request, pages, after) -> bool:
    """Open a page of a kind; whether it is a file. `after` closes what serves it."""
    if kind == 'live':
        run = Acted(tab, 'whole_machine', 0.05)
        after.callback(run.server.close)
        run.tell()
    elif kind == 'waiting':
        told = {'type': 'waiting', 'starting': False}
        server = Server(contents_of('live', MODULES), 0, lambda: [told], print)
        after.callback(server.close)
        tab.page.goto(server.address)
    elif kind == 'edit':
        Hand(tab, request.getfixturevalue('editor'))
    else:
        tab.page.goto(pages(kind).as_uri())
        return True
    return False


@pytest.fixture(params=[
    pytest.param((kind, *look), marks=[] if (kind, *look) == QUICK else [pytest.mark.slow],
                 id=f'{kind}-{look[0]}-{look[1]}')
    for kind in TEXTS for look in LOOKS
])  # fmt: skip
def opened(request, browser, pages, tmp_path):
    """A page in a size and a scheme, without its policy, for axe-core is no part of it."""
    kind, width, scheme = request.param
    context = browser.new_context(
        viewport={'width': width, 'height': HIGH[width]}, color_scheme=scheme, bypass_csp=True
    )
    tab = Tab(context.new_page(), tmp_path)
    with ExitStack() as after:
        after.callback(context.close)
        if show(kind, tab, request, pages, after):
            ready = (
                'article' if kind.startswith(('site/docs', 'site/index')) else 'html[data-ready]'
            )
            tab.page.wait_for_selector(ready, state='attached')
        tab.page.wait_for_timeout(300)
        yield SimpleNamespace(kind=kind, width=width, scheme=scheme, page=tab.page, tab=tab)


@pytest.fixture(scope='module')
def editor(tmp_path_factory):
    """The address of an editor of a scene, in a folder of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp('edit'))
        with editing('four_bar_clearance') as address:
            yield address


def test_a_page_is_in_order_for_everybody(opened):
    """axe-core finds nothing; nothing overlaps, sticks out, complains or asks for a network."""
    page = opened.page
    for selector in TEXTS[opened.kind]:
        found = boxes(page, selector)
        assert overlapping(found) == [], selector
        if not opened.kind.startswith('site') and selector not in SCROLL:
            assert all(box[0] >= 0.0 and box[2] <= opened.width + 0.5 for box in found), selector
    assert page.evaluate('document.documentElement.scrollWidth') <= opened.width
    if page.locator('.report #machine').count():
        covers_nothing(page, opened)
    assert violations(page) == []
    assert opened.tab.complaints == []
    local = ('file:', 'http://127.0.0.1:', 'ws://127.0.0.1:')
    assert all(request.startswith(local) for request in opened.tab.requests)
    name = opened.kind.removesuffix('.html').replace('/', '_')
    opened.tab.shoot(f'page_{name}_{opened.width}_{opened.scheme}')


def covers_nothing(page, opened):
    """The machine, its lens and its player are in sight together, and stand beside the rest."""
    page.locator('#machine').scroll_into_view_if_needed()
    for selector in ('#stage', '#lens > *', '.beside > *', '.controls > *'):
        for _, top, _, bottom in boxes(page, selector):
            assert top >= -0.5, selector
            assert bottom <= HIGH[opened.width] + 0.5, selector
    if opened.width > 900:
        rest = boxes(page, 'body > header, body > nav, main')
        assert overlapping([*boxes(page, '#machine'), *rest]) == []


HERE = 'file:', 'data:', 'blob:', 'about:', 'http://127.0.0.1:', 'ws://127.0.0.1:'
SAVED = 'Save as PNG', 'Save as SVG', 'Save as CSV'
BUTTONS = {*SAVED, 'Zoom', 'Pan', 'Reset axes'}
OFTEN = ('report',)
"""Kinds whose network is watched in the quick tests too."""


@pytest.fixture(params=[
    pytest.param(kind, marks=[] if kind in OFTEN else [pytest.mark.slow]) for kind in TEXTS
])  # fmt: skip
def watched(request, browser, pages, tmp_path):
    """A page as people have it, with its policy, and all that it asks of any network."""
    kind, context = request.param, browser.new_context(viewport={'width': 1200, 'height': 800})
    asked, opened = [], []
    with ExitStack() as after:
        after.callback(context.close)
        tab = Tab(context.new_page(), tmp_path)
        context.on('request', lambda r: asked.append(r.url))
        context.on('page', lambda page: opened.append(page.url))
        tab.page.on('websocket', lambda socket: asked.append(socket.url))
        if show(kind, tab, request, pages, after):
            tab.page.wait_for_load_state('networkidle')
        yield SimpleNamespace(kind=kind, page=tab.page, asked=asked, opened=opened)


@pytest.mark.slow
def test_nothing_leaves_the_machine(watched):
    """No request, window or link goes elsewhere; charts have these buttons only, which save."""
    page = watched.page
    for chart in page.locator('figure.chart').all():
        chart.scroll_into_view_if_needed()
        chart.locator('.modebar').wait_for(state='attached')
        buttons = [b.get_attribute('data-title') for b in chart.locator('.modebar-btn').all()]
        assert set(buttons) <= BUTTONS
        assert set(SAVED) <= set(buttons)
        assert chart.locator('.modebar a[href], .modebar form').count() == 0
    for button in page.locator('figure.chart .modebar').first.locator('.modebar-btn').all():
        page.locator('figure.chart').first.hover()
        if button.get_attribute('data-title') in SAVED:
            with page.expect_download() as saved:
                button.click()
            assert saved.value.url.startswith('blob:')
        else:
            button.click()
    for name in ('iframe, script, img, source, video, audio, embed', 'form'):
        links = page.locator(name).evaluate_all('all => all.map(x => x.src || x.action || "")')
        assert [x for x in links if x and not x.startswith(HERE)] == []
    if not watched.kind.startswith(('site/docs', 'site/index')):  # which link to what they cite
        links = page.locator('a').evaluate_all('all => all.map(x => x.href)')
        assert [x for x in links if x and not x.startswith(HERE)] == []
    assert watched.asked
    assert [x for x in watched.asked if not x.startswith(HERE)] == []
    assert watched.opened == []


@pytest.mark.slow
def test_a_chart_is_saved_as_pictures_and_as_its_numbers(browser, pages, tmp_path):
    """The file has the numbers of the curves, and pictures are on paper, also in the dark."""
    context = browser.new_context(color_scheme='dark')
    page = context.new_page()
    page.goto(pages('report').as_uri())
    page.wait_for_selector('html[data-ready]', state='attached')
    chart = page.locator('figure.chart[data-axis=time]').first
    chart.scroll_into_view_if_needed()
    chart.hover()
    files = {}
    for kind in ('PNG', 'SVG', 'CSV'):
        with page.expect_download() as saved:
            chart.locator(f'[data-title="Save as {kind}"]').click()
        files[kind] = tmp_path / saved.value.suggested_filename
        saved.value.save_as(files[kind])
    context.close()
    assert files['PNG'].read_bytes().startswith(b'\x89PNG')
    picture = files['SVG'].read_text(encoding='utf-8')
    assert picture.startswith('<svg')
    assert 'rgb(255, 255, 255)' in picture
    assert files['CSV'].name.startswith('four_bar_clearance_')
    with files['CSV'].open(newline='', encoding='utf-8') as lines:
        heading, *rows = csv.reader(lines)
    assert heading[:2] == ['time [s]', 'coupler_rocker: gap [mm]']
    t, gap = np.array([row[:2] for row in rows if row[0]], float).T
    run = simulated('four_bar_clearance', revolutions=2)
    exact = 1e3 * run.piece.sample(t, 'gap.coupler_rocker')['gap.coupler_rocker']
    assert np.abs(gap - exact).max() < 1e-4 * np.abs(exact).max()  # times have seven digits


def test_an_unknown_version_of_plotly_is_not_taken():
    """Minor versions have brought buttons that upload: one is taken after it was looked at."""
    project = tomllib.loads((ROOT / 'pyproject.toml').read_text(encoding='utf-8'))['project']
    (allowed,) = (r for x in project['dependencies'] if (r := Requirement(x)).name == 'plotly')
    assert version('plotly') in allowed.specifier
    assert not any(x in allowed.specifier for x in ('7.2.0', '7.3', '8.0'))


@pytest.fixture(scope='module')
def foreign(tmp_path_factory):
    """Firefox, in place of Chromium."""
    if firefox() is None:
        pytest.skip('no Firefox here: install the package firefox-esr')
    with Firefox(tmp_path_factory.mktemp('profile')) as found:
        yield found


def foreign_boxes(page, selector):
    """As `boxes` of a page in Firefox."""
    box = 'r => [r.left, r.top, r.right, r.bottom]'
    return page.evaluate(
        f'JSON.stringify([...document.querySelectorAll({selector!r})]'
        f'.map(x => x.getBoundingClientRect()).filter(b => b.width && b.height).map({box}))'
    )


@pytest.mark.browser
@pytest.mark.slow
@pytest.mark.parametrize('width', [1440, 390])
def test_firefox_shows_the_live_view_and_is_obeyed(foreign, width):
    """It follows the motion, asks for what is clicked, and no box covers another."""
    foreign.complaints.clear()
    foreign.requests.clear()
    foreign.resize(width, 900)
    run = Acted(foreign.tab, 'whole_machine', 0.05, 0.1)
    try:
        run.tell()
        for selector in TEXTS['live']:
            found = foreign_boxes(foreign, selector)
            assert found
            assert overlapping(found) == [], selector
            assert all(x[0] >= 0.0 and x[2] <= width + 0.5 for x in found), selector
        place = "document.querySelector('#stage [data-link][transform*=rotate]').outerHTML"
        before = foreign.evaluate(f'JSON.stringify({place})')
        for message in motion_messages(run.machine, [0.05, 0.1, 0.3])[2:]:
            run.live.take(message)
        run.server.send(run.live.batch())
        assert eventually(lambda: foreign.evaluate(f'JSON.stringify({place})') != before)
        foreign.evaluate("document.getElementById('play').click()")
        assert run.command() == Command('pause')
        slider = f'document.querySelector(\'input[data-path="{RADIAL}"]\')'
        foreign.evaluate(
            f'{slider}.value = 700; for (const kind of ["input", "change"])'
            f' {slider}.dispatchEvent(new Event(kind));'
        )
        assert run.command().path == RADIAL
        said = foreign.evaluate(
            f'JSON.stringify({slider}.parentElement.querySelector("small").innerText)'
        )
        assert said == 'restarting …'
        assert foreign.complaints == []
        home = run.server.address
        assert all(
            x.startswith((home, home.replace('http', 'ws'), 'data:')) for x in foreign.requests
        )
        assert foreign.shoot(f'firefox_live_{width}').stat().st_size > 10_000
    finally:
        foreign.goto('about:blank')  # it would look for its server again and again
        run.server.close()
        foreign.resize(1440, 900)


FILES = [x for x in TEXTS if x not in ('live', 'waiting', 'edit')]


@pytest.mark.browser
@pytest.mark.slow
@pytest.mark.parametrize('kind', FILES)
def test_firefox_shows_and_plays_the_same(foreign, pages, kind):
    """No error on its console, no network, machines that move; boxes apart as in Chromium."""
    foreign.complaints.clear()
    foreign.requests.clear()
    foreign.goto(pages(kind).as_uri())
    for selector in TEXTS[kind]:
        assert overlapping(foreign_boxes(foreign, selector)) == [], selector
    # machines of lessons are in frames
    moves = foreign.evaluate("!!document.querySelector('a.plays, #stage')")
    place = (
        "[...document.querySelectorAll('svg.stage [data-link]')]"
        ".map(x => x.getAttribute('transform')).join() || null"
    )
    foreign.evaluate("document.querySelector('a.plays, #stage')?.scrollIntoView()")
    foreign.evaluate("document.getElementById('play')?.click()")
    seen = set()
    for _ in range(100):
        seen.add(foreign.evaluate(f'JSON.stringify({place})'))
        if len(seen - {None}) > 2 or not moves:
            break
        time.sleep(0.05)
    assert len(seen - {None}) > 2 or not moves
    assert foreign.complaints == []
    assert all(request.startswith(('file:', 'data:', 'blob:')) for request in foreign.requests)
    name = kind.removesuffix('.html').replace('/', '_')
    assert foreign.shoot(f'firefox_{name}').stat().st_size > 10_000


@pytest.mark.slow
def test_every_scene_plays_on_its_card_and_opens_its_report(tab):
    """Each card of the gallery moves once it is in view, and leads to a page that is there."""
    if not (SITE / 'docs' / 'mechanisms.html').exists():
        pytest.skip('the site has not been built: make docs')
    tab.page.goto((SITE / 'docs' / 'mechanisms.html').as_uri())
    cards = tab.page.locator('a.plays')
    seen = {}
    for k in range(cards.count()):
        card = cards.nth(k)
        card.scroll_into_view_if_needed()
        card.locator('svg.stage').wait_for()
        assert card.get_attribute('data-moves') == '1'
        seen[card.get_attribute('href').rpartition('/')[2]] = card.locator('[data-link]').count()
    assert seen.keys() == {f'{name}.html' for name in ms.scene_names()}
    assert all((SITE / 'runs' / name).exists() for name in seen)
    assert min(seen.values()) > 1
    before = "x => getComputedStyle(x, '::before').content"
    assert tab.page.locator('tr:has(a.plays) td').last.evaluate(before) == 'none'
    assert tab.complaints == []
