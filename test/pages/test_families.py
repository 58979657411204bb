"""Pages with a slider through runs: points of a bifurcation diagram, stages of a life."""

import numpy as np
import pytest
from bouncing_ball import ball, speed
from browsing import open_page
from running import run

import mechanism_sim as ms
from mechanism_sim import output
from mechanism_sim.pages.families import bifurcation_page, life_page

WHEEL = {
    'title': 'wheel', 'mechanism': 'linkage',
    'links': {'ground': {'points': {'pin': [0.0, 0.0]}},
              'wheel': {'mass': 2.0, 'inertia': 1e-3, 'cog': '30 mm'}},
    'joints': {'axle': {'revolute': ['ground.pin', 'wheel'], 'clearance': {
        'radial': 1e-4, 'pin_radius': 8e-3, 'restitution': 0.0, 'profile': {'harmonics': 8},
        'wear': {'width': '10 mm', 'bushing': 1e-16}}}},
    'drive': {'coordinate': 'wheel', 'speed': 12.0}, 'gravity': [0.0, -9.81],
    'sensors': {'acc': {'link': 'wheel', 'at': '20 mm', 'axis': 'along', 'sample_rate': '1 kHz'}},
}  # fmt: skip


def chosen(page, member):
    """Move the slider to a run, as a hand does."""
    page.evaluate(
        """(member) => {
          const slider = document.getElementById('family');
          slider.value = member;
          slider.dispatchEvent(new Event('input', { bubbles: true }));
        }""",
        member,
    )
    return page.inner_text('#value')


def cursor(page, chart):
    """Position of the cursor of a chart along its axis."""
    return page.evaluate(
        """(chart) => {
          const plot = document.querySelector(`figure[data-chart="${chart}"] .plot`);
          const { xaxis } = plot._fullLayout;
          const at = Number(plot.querySelector('.cursor').style.transform.match(/[-\\d.]+/)[0]);
          return xaxis.p2l(at - xaxis._offset);
        }""",
        chart,
    )


def test_the_slider_over_a_diagram_plays_the_motion_there(tab, tmp_path):
    """The ball strikes once a period below the flip and at two speeds above it."""
    low, high = speed(1.45), speed(1.6)
    found = ms.bifurcation(
        ball(1.5), {'drive.speed': (low, high, 3)}, transient=150, keep=20,
    )  # fmt: skip
    file = tmp_path / 'ball.html'
    output.write_text(file, bifurcation_page(found))
    open_page(tab, file)
    page = tab.page
    values = page.get_attribute('#family', 'data-values').split('|')
    assert len(values) == len({(r.value, r.number) for r in found.responses})
    assert values[0].endswith('period 1')
    assert values[-1].endswith('period 2')
    page.locator('figure[data-chart="bifurcation"]').scroll_into_view_if_needed()
    page.wait_for_selector('figure[data-chart="bifurcation"] .cursor')
    for member, r in ((0, found.responses[0]), (len(values) - 1, found.responses[-1])):
        assert chosen(page, member) == values[member]
        assert cursor(page, 'bifurcation') == pytest.approx(found.scale * r.value, rel=1e-3)
    chosen(page, 0)
    # a point of the diagram chooses its run
    page.evaluate(
        """(x) => document.querySelector('figure[data-chart="bifurcation"] .plot')
          .emit('plotly_click', { points: [{ x, y: 0 }] })""",
        found.scale * high,
    )
    assert page.inner_text('#value') == values[-1]
    before = page.inner_text('#time')
    page.click('#play')
    page.wait_for_function('(before) => document.getElementById("time").textContent !== before',
                           arg=before)  # fmt: skip
    assert not tab.complaints
    assert not [r for r in tab.requests if not r.startswith('file:')]
    # on a phone the player is below the slider, no part of the page is hidden in another
    page.set_viewport_size({'width': 390, 'height': 844})
    assert page.evaluate(
        "(box => box.scrollHeight <= box.clientHeight)(document.getElementById('machine'))"
    )


@pytest.fixture(scope='module')
def worn():
    return ms.life(WHEEL, 'clearance > 0.13 mm', cycles=1e12, revolutions=8, skip=1)


@pytest.mark.slow
def test_the_lens_shows_what_has_worn_along_a_life(tab, tmp_path, worn):
    file = tmp_path / 'life.html'
    output.write_text(file, life_page(worn))
    open_page(tab, file)
    page = tab.page
    values = page.get_attribute('#family', 'data-values').split('|')
    assert len(values) == len(worn.stages)
    assert page.locator('#lens circle.bore').count() == 1  # round when new
    chosen(page, len(values) - 1)
    points = page.evaluate(
        """() => document.querySelector('#lens path.bore').getAttribute('d')
          .match(/-?[\\d.]+/g).map(Number)"""
    )
    x, y = np.array(points).reshape(-1, 2).T
    depths = worn.stages[-1].depths['axle'][0]
    scale = np.ptp(np.hypot(x, y)) / np.ptp(depths)
    assert np.hypot(x, y) - np.hypot(x, y).min() == pytest.approx(
        scale * (depths - depths.min()), abs=0.03 * scale * np.ptp(depths)
    )
    assert 'worn by' in page.inner_text('#lens .note')
    # loads of the bearing, and the signal of the accelerometer, of all stages
    assert page.locator('svg.curves').count() == 2
    assert page.locator('svg.curves').first.locator('.curve').count() == len(values)
    page.locator('figure[data-chart="profiles"]').scroll_into_view_if_needed()
    page.wait_for_selector('figure[data-chart="profiles"] .main-svg')
    tab.shoot('life')
    assert not tab.complaints
    assert not [r for r in tab.requests if not r.startswith('file:')]


def test_pages_are_html_and_of_one_key():
    for args, said in (
        (('--page', 'a.png', '--vary', 'drive.speed=100 rpm:200 rpm:2'), '--page'),
        (('--page', 'a.html', '--vary', 'drive.speed=100 rpm:200 rpm:2', '--vary',
          'links.rocker.mass=0.1:0.2:2'), 'does not apply to two keys'),
    ):  # fmt: skip
        done = run('bifurcation', 'four_bar_clearance', *args)
        assert done.returncode == 2
        assert said in done.stderr.splitlines()[-1]


@pytest.mark.slow
def test_another_run_is_shown_whole_or_enlarged_as_the_one_before(tab, tmp_path):
    """Symbols are larger on a larger machine, and so are the units of its drawing."""
    file = tmp_path / 'cranks.html'
    path = 'links.crank.length'
    page = ms.explore('four_bar_clearance', path, ['20 mm', '75 mm'], 'gap.coupler_rocker').page
    file.write_text(page, encoding='utf-8')
    open_page(tab, file)
    stage = tab.page.locator('#stage')
    whole = []
    for member in (0, 1, 0):
        chosen(tab.page, member)
        assert 'zoomed' not in stage.get_attribute('class')
        whole.append(stage.get_attribute('viewBox'))
    assert whole[0] == whole[2] != whole[1]
    box = stage.bounding_box()
    tab.page.mouse.move(box['x'] + 0.5 * box['width'], box['y'] + 0.5 * box['height'])
    tab.page.mouse.wheel(0.0, -800.0)
    pixels = []
    for member in (0, 1, 0):
        chosen(tab.page, member)
        assert 'zoomed' in stage.get_attribute('class')
        # of the same length in the world, as of the ground, which does not change
        pixels.append(tab.page.evaluate(
            """() => { const [a, b] = [...document.querySelectorAll(
                '#stage [data-kind=support]')].slice(0, 2).map(x => x.getBoundingClientRect());
                return Math.hypot(b.left - a.left, b.bottom - a.bottom); }"""))  # fmt: skip
    assert pixels == pytest.approx([pixels[0]] * 3, rel=0.03)
