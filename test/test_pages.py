"""Every kind of page, narrow and wide, light and dark: what axe-core finds, and what overlaps."""

from __future__ import annotations

import importlib.util
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from blocks import ROOT
from browsing import Firefox, Tab, boxes, firefox, overlapping
from test_report import simulated
from test_view import Acted

import mechanism_sim as ms
from mechanism_sim import output
from mechanism_sim.analysis.comparison import compare
from mechanism_sim.pages import report
from mechanism_sim.pages.charts import sections
from mechanism_sim.pages.recorded import recorded, together
from mechanism_sim.report.charts.overlay import overlaid

SITE = ROOT / 'build' / 'site'
TEXTS = {
    'report': ('.facts > div', '.controls > *', '#lens text', '.contents li', '.report h2'),
    'compare': ('.facts > div', '.controls > *', '#lens text', '#lens-other text', '.which'),
    'explore': ('.family > label, .family > output', '.family text', '.controls > *'),
    'live': ('.controls > *', '.slider', '.strips figure', '#lens text', '.live header > *'),
    'site/docs/mechanisms.html': ('a.plays', 'article h2', 'button.motion, article h1'),
    'site/docs/lessons/05_cams.html': ('article h2, article p', 'article iframe, article p'),
    'site/docs/tutorial.html': ('article h2, article pre', 'article iframe, article p'),
}
"""Pages, and of each what must not overlap what else is chosen by the same words."""
LOOKS = [(1440, 'light'), (390, 'dark'), (390, 'light'), (1440, 'dark')]


@pytest.fixture(scope='module')
def axe():
    """The program axe-core."""
    found = importlib.util.find_spec('axe_playwright_python')
    if found is None:
        pytest.skip('no axe-core here: pip install axe-playwright-python')
    return Path(found.origin).with_name('axe.min.js').read_text(encoding='utf-8')


@pytest.fixture(scope='module')
def pages(tmp_path_factory):
    """The files of pages that are files, made when they are asked for first."""
    folder, made = tmp_path_factory.mktemp('pages'), {}

    def text(kind):
        if kind == 'explore':
            values = ['0.1 mm', '0.254 mm']
            path = 'joints.coupler_rocker.clearance.radial'
            return ms.explore('four_bar_clearance', path, values, 'gap.coupler_rocker').page
        run = simulated('four_bar_clearance', revolutions=2)
        if kind == 'report':
            return report.page(recorded(run), sections(run))
        worn = simulated('four_bar_clearance', {'drive.speed': '300 rpm'}, revolutions=2)
        one, two = together(recorded(run), recorded(worn))
        beside = report.Beside(two, ('a', 'b'), compare(run, worn))
        return report.page(one, overlaid(sections(run), sections(worn)), beside=beside)

    def file(kind):
        if kind.startswith('site/'):
            found = SITE / kind.removeprefix('site/')
            if not found.exists():
                pytest.skip('the site has not been built: make docs')
            return found
        if kind not in made:
            made[kind] = folder / f'{kind}.html'
            output.write_text(made[kind], text(kind))
        return made[kind]

    return file


@pytest.fixture(params=[
    pytest.param((kind, *look), marks=[] if k % 4 == n and k in (0, 3) else [pytest.mark.deep],
                 id=f'{kind}-{look[0]}-{look[1]}')
    for k, kind in enumerate(TEXTS) for n, look in enumerate(LOOKS)
])  # fmt: skip
def opened(request, browser, pages, tmp_path):
    """A page in a size and a scheme, without its policy, for axe-core is no part of it."""
    kind, width, scheme = request.param
    context = browser.new_context(
        viewport={'width': width, 'height': 900}, color_scheme=scheme, bypass_csp=True
    )
    tab = Tab(context.new_page(), tmp_path)
    run = None
    if kind == 'live':
        run = Acted(tab, 'whole_machine', 0.05)
        run.tell()
    else:
        tab.page.goto(pages(kind).as_uri())
        ready = {'site': 'article'}.get(kind.partition('/')[0], 'html[data-ready="1"]')
        tab.page.wait_for_selector(ready, state='attached')
    tab.page.wait_for_timeout(300)
    yield SimpleNamespace(kind=kind, width=width, scheme=scheme, page=tab.page, tab=tab)
    if run:
        run.server.close()
    context.close()


def test_a_page_is_in_order_for_everybody(opened, axe):
    """axe-core finds nothing; nothing overlaps, sticks out, complains or asks for a network."""
    page = opened.page
    for selector in TEXTS[opened.kind]:
        found = boxes(page, selector)
        assert overlapping(found) == [], selector
        if not opened.kind.startswith('site'):
            assert all(box[0] >= 0.0 and box[2] <= opened.width + 0.5 for box in found), selector
    assert page.evaluate('document.documentElement.scrollWidth') <= opened.width
    page.evaluate(axe)
    found = page.evaluate('axe.run({ iframes: false, preload: false })')['violations']
    said = [(v['id'], v['nodes'][0]['target'], v['nodes'][0]['failureSummary']) for v in found]
    assert said == []
    assert opened.tab.complaints == []
    local = ('file:', 'http://127.0.0.1:', 'ws://127.0.0.1:')
    assert all(request.startswith(local) for request in opened.tab.requests)
    opened.tab.shoot(f'page_{Path(opened.kind).stem}_{opened.width}_{opened.scheme}')


@pytest.fixture(scope='module')
def foreign(tmp_path_factory):
    """Firefox, in place of Chromium."""
    if firefox() is None:
        pytest.skip('no Firefox here: install the package firefox-esr')
    with Firefox(tmp_path_factory.mktemp('profile')) as found:
        yield found


@pytest.mark.deep
@pytest.mark.parametrize(
    'kind', ['report', 'compare', 'explore', *(x for x in TEXTS if x.startswith('site'))]
)
def test_firefox_shows_and_plays_the_same(foreign, pages, kind):
    """No error on its console, no network, machines that move; boxes apart as in Chromium."""
    foreign.complaints.clear()
    foreign.requests.clear()
    foreign.goto(pages(kind).as_uri())
    box = 'r => [r.left, r.top, r.right, r.bottom]'
    for selector in TEXTS[kind]:
        found = foreign.evaluate(
            f'JSON.stringify([...document.querySelectorAll({selector!r})]'
            f'.map(x => x.getBoundingClientRect()).filter(b => b.width && b.height).map({box}))'
        )
        assert overlapping(found) == [], selector
    moves = kind != 'site/docs/lessons/05_cams.html'  # its machines are in frames
    place = "document.querySelector('svg.stage [data-link][transform*=rotate]')?.outerHTML"
    foreign.evaluate("document.querySelector('a.plays, #stage')?.scrollIntoView()")
    foreign.evaluate("document.getElementById('play')?.click()")
    seen = set()
    for _ in range(100):
        seen.add(foreign.evaluate(f'JSON.stringify({place} ?? null)'))
        if len(seen - {None}) > 2 or not moves:
            break
        time.sleep(0.05)
    assert len(seen - {None}) > 2 or not moves
    assert foreign.complaints == []
    assert all(request.startswith(('file:', 'data:', 'blob:')) for request in foreign.requests)
    assert foreign.shoot(f'firefox_{Path(kind).stem}').stat().st_size > 10_000
