"""The page of ideal motion: its own JavaScript against the engine, and in a browser."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browsing import Tab, boxes, open_page, overlapping, violations
from builders import made
from running import TIMEOUT, run

import mechanism_sim as ms
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.grashof import classify, crank_limits, crank_turns
from mechanism_sim.pages import ideal, ideal_sliders
from mechanism_sim.scene.files import check_scene
from mechanism_sim.scene.plan import ScenePlan

DRIVER = """
import { readFileSync } from 'node:fs';
import * as equations from 'equations';
import { IdealMotion } from 'ideal_motion';
const { data, values } = JSON.parse(readFileSync(0, 'utf8'));
const motion = new IdealMotion(data, equations);
const told = () => {
  const { low, high, full } = motion;
  return { low, high, full, places: motion.all() };
};
const seen = [{ closed: true, ...told() }];
for (const own of values) {
  const closed = motion.change({ ...motion.values, ...own });
  seen.push({ closed, ...told() });
}
process.stdout.write(JSON.stringify(seen));
"""

QUICK = ('four_bar_clearance',)
SMOOTH = (
    'loader', 'gear_four_bar',
    'slider_crank_offset', 'quick_return_shaper', 'ten_links', 'windshield_wiper', 'planetary',
    'belt_drive', 'rack_and_pinion', 'four_bar_triple_rocker', 'scotch_yoke_offset', 'wedge',
    'toggle_press', 'eccentric_cam', 'double_toggle_punch', 'punch', 'locking_pliers',
)  # fmt: skip
DIGITS = 1e-12
UNITS = {'µm': 1e6, 'mm': 1e3, 'm': 1.0}
BLIND = 1e-3  # independence of closures, below which rounding grows


def interpreter() -> str:
    """Node: that of this machine, or the one that comes with Playwright."""
    if found := shutil.which('node'):
        return found
    driver = pytest.importorskip('playwright._impl._driver')
    return str(driver.compute_driver_executable()[0])


class Page:
    """A page of ideal motion, and what its own modules compute."""

    def __init__(self, folder: Path, scene: str, sliders=None, **overrides) -> None:
        self.machine = ideal._ideal(ms.load_scene(scene, overrides))
        self.text, self.left_out = ideal.page(ms.load_scene(scene, overrides), sliders or {})
        self.data = json.loads(re.search(r'id="data">(.*?)</script>', self.text, re.S)[1])
        modules = json.loads(re.search(r'type="importmap">(.*?)</script>', self.text, re.S)[1])
        for name, address in modules['imports'].items():
            place = folder / 'node_modules' / name
            place.mkdir(parents=True)
            (place / 'index.js').write_bytes(base64.b64decode(address.partition(',')[2]))
            (place / 'package.json').write_text('{"type": "module", "main": "index.js"}')
        self._program = folder / 'driver.mjs'
        self._program.write_text(DRIVER, encoding='utf-8')

    def moved(self, *values: dict[str, float]) -> list[dict]:
        """The motion, as in the scene and at other values of sliders."""
        done = subprocess.run(
            [interpreter(), str(self._program)], text=True, capture_output=True, check=False,
            input=json.dumps({'data': self.data, 'values': values}), timeout=TIMEOUT,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    def random(self, rng: np.random.Generator, share: float) -> dict[str, float]:
        """Values of all sliders, within a share of their ranges."""
        found = {}
        for s in self.data['sliders']:
            away = rng.uniform(s['low'], s['high']) - s['value']
            found[s['path']] = s['si'] + share * away / s['scale']
        return found

    def at(self, values: dict[str, float]):
        """Plan of the same machine by the engine."""
        return ScenePlan(check_scene('page', self.machine.scene.to_document(), values))


def off(page: Page, values: dict[str, float], seen: dict) -> list[float]:
    """Largest differences from the engine: coordinates, rates, accelerations, places of links."""
    plan = page.at(values)
    kinematics, mechanism = plan.kinematics([*plan.laws]), plan.ideal
    q, v, a = (np.array([p[key] for p in seen['places']], float).T for key in 'qva')
    regular = kinematics.independence(q) > BLIND  # at its limits a drive moves links endlessly
    assert np.count_nonzero(~regular) < 8
    q, v, a = (x[:, regular] for x in (q, v, a))
    scale = kinematics.scale[:, None]
    found, left = kinematics.positions(q)
    assert not left.any()
    rates = kinematics.rates(q, v[kinematics.held])
    bends = kinematics.accelerations(q, rates, a[kinematics.held])
    poses = np.array([p['poses'] for p in seen['places']], float)[regular]

    fast = np.abs(v / scale).max()

    def apart(one, other, least=1.0):
        return (
            np.abs(one - other) / (np.abs(other).max(axis=-1, keepdims=True) + least * scale)
        ).max()

    places = []
    for i, body in enumerate(mechanism.bodies):
        path = mechanism.trace((body.name, (0.0, 0.0)), q, v, a).transpose(0, 2, 1)
        shown = poses[:, i].reshape(-1, 3, 3).transpose(1, 0, 2)
        size = np.abs(path).max(axis=(1, 2), keepdims=True) + mechanism.size
        places.append((np.abs(shown[:, :, :2] - path) / size).max())
        places.append(np.abs(shown[0, :, 2] - mechanism.angle_all(body.name, q)).max())
    return [
        (np.abs(found - q) / scale).max(),
        apart(v, rates),
        apart(a, bends, fast**2),
        max(places),
    ]


@pytest.mark.parametrize(('times', 'unit'), [(1.0, 'mm'), (1e-5, 'µm'), (100.0, 'm')])
def test_lengths_are_in_the_unit_of_the_machine(times, unit):
    sides = {'ground': 387.0, 'crank': 64.0, 'coupler': 309.0, 'rocker': 312.0}
    machine = made({
        'mechanism': 'four_bar',
        'links': {name: {'length': 1e-3 * times * x} for name, x in sides.items()},
        'drive': {'speed': '60 rpm'},
    })  # fmt: skip
    assert ideal.PageDrive(machine).to_json()['length'] == (unit, UNITS[unit])
    length = times * 64e-3
    told = ideal_sliders.Slider('x', length, 0.4 * length, 1.6 * length, 'm', {}).to_json()
    assert (told['unit'], told['scale']) == (unit, UNITS[unit])
    assert told['value'] == pytest.approx(length * UNITS[unit])


@pytest.mark.slow
@pytest.mark.parametrize(
    'scene', [*QUICK, *(pytest.param(x, marks=pytest.mark.slow) for x in SMOOTH)]
)
def test_the_page_moves_as_the_engine(scene, tmp_path):
    """Positions, rates, accelerations, over a turn and over random values of all sliders."""
    page, rng = Page(tmp_path, scene), np.random.default_rng(7)
    tried = [page.random(rng, share) for share in (0.1, 0.2, 0.4, 0.7)]
    seen = page.moved(*tried, {s['path']: s['si'] for s in page.data['sliders']})
    closed = [i for i, found in enumerate(seen) if found['closed']]
    assert {0, 1, 5} <= {*closed}
    for i in closed:
        values = tried[i - 1] if 0 < i < 5 else {}
        assert max(off(page, values, seen[i])) < DIGITS
    whatever = np.array([p['q'] for p in seen[5]['places']])
    begun = np.array([p['q'] for p in seen[0]['places']])
    np.testing.assert_allclose(whatever, begun, rtol=0.0, atol=1e-11)  # back as it was


@pytest.mark.slow
def test_a_four_bar_stays_on_its_branch_up_to_its_limits(tmp_path):
    """Against the closed form: how far the crank goes, and on which side the coupler is."""
    page, rng = Page(tmp_path, 'four_bar_nominal'), np.random.default_rng(3)
    tried = [page.random(rng, 0.9) for _ in range(40)]
    kinds: list[str] = []
    for values, seen in zip(tried, page.moved(*tried)[1:], strict=True):
        lengths = [values[f'links.{x}.length'] for x in ('ground', 'crank', 'coupler', 'rocker')]
        linkage = FourBar(*lengths)
        if not seen['closed']:
            assert classify(lengths) == 'no linkage'
            continue
        assert seen['full'] == crank_turns(linkage)
        kinds.append('full' if seen['full'] else 'limited')
        _, th3, th4 = np.array([p['q'] for p in seen['places']]).T
        assert (np.sin(th4 - th3)[1:-1] > 0.0).all()  # of the scene: open
        if not seen['full']:
            low, high = crank_limits(linkage)
            low, high = (-high, high) if low == 0.0 else (low, high)
            high = 2.0 * np.pi - low if high == np.pi else high
            apart = np.subtract([seen['low'], seen['high']], [low, high])
            assert np.abs(np.sin(0.5 * apart)).max() < 1e-8
    assert kinds.count('full') > 5
    assert kinds.count('limited') > 2


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ('scene', 'words'),
    [
        ('geneva', 'crank_wheel follows a different law in each part of a turn'),
        ('valve_train', 'contact follows a different law'),
        ('four_bar_elastic', 'coupler is elastic'),
        ('pendulum', 'nothing drives it'),
        ('differential', 'how carrier, left, right moves does not follow'),
    ],
)
def test_what_no_page_can_show_is_refused_before_anything_is_written(scene, words, tmp_path):
    done = run('export', scene, '-o', str(tmp_path / 'page.html'))
    assert done.returncode == 2
    assert f'{scene} cannot be a page of ideal motion: ' in done.stderr
    assert words in done.stderr
    assert f'mechanism-sim report {scene}' in done.stderr
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    ('slider', 'words'),
    [
        ('links.crank.lenth=1 mm:2 mm', "did you mean 'links.crank.length'?"),
        ('links.crank.length', 'write NAME=LOW:HIGH'),
        ('links.crank.length=50 mm:70 s', 'must be a low and a high value'),
        ('links.crank.length=70 mm:50 mm', 'must be a low and a high value'),
        ('links.crank.length=70 mm:90 mm', 'does not contain the value of the scene, 64 mm'),
        ('links.crank.length=-1 mm:90 mm', 'must be more than 0'),
        ('links.crank.mass=0.1 kg:2 kg', 'nothing of the ideal motion depends on it'),
    ],
)
def test_a_slider_that_cannot_be_is_said_in_a_sentence(slider, words, tmp_path):
    file = tmp_path / 'page.html'
    done = run('export', 'four_bar_nominal', '-o', str(file), '--slider', slider)
    assert done.returncode == 2
    assert words in done.stderr
    assert not file.exists()


@pytest.mark.parametrize('one', ['0', 'x'])
def test_a_component_of_a_point_goes_by_its_letter_or_its_number(one, tmp_path):
    """As in overrides, sweeps and searches."""
    path = f'links.ground.points.pivot.{one}'
    page = Page(tmp_path, 'five_bar', {path: ('200 mm', '300 mm')})
    (slider,) = page.data['sliders']
    assert (slider['path'], slider['value']) == (path, 250.0)
    assert slider['change']


def test_other_formats_have_no_sliders():
    done = run(
        'export', 'four_bar_nominal', '--format', 'urdf', '--slider', 'links.crank.length=1:2'
    )
    assert done.returncode == 2
    assert '--slider applies to --format html' in done.stderr


@pytest.fixture(scope='module')
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp('ideal') / 'page.html'
    scene, point = 'four_bar_coupler_curve', 'links.coupler.points.far.y=100 mm:200 mm'
    sliders = (f'links.{x}.length={low} mm:{high} mm' for x, low, high in (
        ('crank', 10, 90), ('rocker', 90, 400)))  # fmt: skip
    options = [x for text in (*sliders, point) for x in ('--slider', text)]
    assert run('export', scene, '-o', str(path), *options).returncode == 0
    return path


def slide(page, path, value):
    """Move a slider to a value in its unit."""
    page.locator(f'input[data-path="{path}"]').evaluate(
        """(input, share) => { input.value = share; for (const name of ['input', 'change'])
            input.dispatchEvent(new Event(name)); }""",
        value,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ('width', 'height', 'scheme'),
    [
        pytest.param(1440, 900, 'light', marks=pytest.mark.slow),
        pytest.param(390, 844, 'light', marks=pytest.mark.slow),
        pytest.param(1440, 900, 'dark', marks=pytest.mark.slow),
        (390, 844, 'dark'),
    ],
)
def test_sliders_move_the_machine_in_a_browser(browser, file, tmp_path, width, height, scheme):
    context = browser.new_context(
        viewport={'width': width, 'height': height}, color_scheme=scheme, bypass_csp=True
    )
    tab = Tab(context.new_page(), tmp_path)
    page = tab.page
    open_page(tab, file)
    page.check('#names')
    page.select_option('#quantity', 'rocker: angular acceleration')
    told, drawn = page.inner_text('#figures'), page.locator('#stage').inner_html()
    assert 'turns fully' in told
    assert '350 < 450 mm: crank and rocker' in told
    assert page.inner_text('#state') == ''
    slide(page, 'links.crank.length', 1000)
    assert '390 < 450 mm: crank and rocker' in page.inner_text('#figures')
    slide(page, 'links.rocker.length', 0)
    assert 'goes from' in page.inner_text('#state')
    assert page.locator('#stage').inner_html() != drawn
    tab.shoot(f'ideal-{width}-{scheme}')
    for selector in ('main > *', '.controls > *', '#stage .names text', '.slider', '#figures div'):
        assert overlapping(boxes(page, selector)) == []
    left, right = (
        max(x) for x in zip(*((-b[0], b[2]) for b in boxes(page, 'main *')), strict=True)
    )
    assert -left >= 0.0
    assert right <= width
    assert violations(page) == []
    page.keyboard.press('Escape')
    assert page.inner_text('#figures') == told
    assert tab.complaints == []
    assert tab.requests == [file.as_uri()]
    context.close()


@pytest.mark.slow
def test_a_slider_that_has_the_focus_has_its_keys(tab, file):
    """Home and End are its own, its text is the value with which the page computes."""
    page = tab.page
    open_page(tab, file)
    slider = page.locator('input[data-path="links.rocker.length"]')

    def sizes():
        """Length of the rocker as shown, and the sum of all links by Grashof's rule [mm]."""
        both = re.search(r'([\d.]+) [<>=] ([\d.]+) mm', page.inner_text('#figures'))
        shown = slider.get_attribute('aria-valuetext')
        assert page.locator('.slider', has=slider).locator('output').inner_text() == shown
        return np.array([shown.removesuffix(' mm'), *both.groups()], float) @ [
            [1, 0],
            [0, 1],
            [0, 1],
        ]

    rocker, total = sizes()
    slider.focus()
    for key, place in (('End', '1000'), ('ArrowLeft', ''), ('Home', '0'), ('ArrowRight', '')):
        page.keyboard.press(key)
        assert place in ('', slider.input_value())
        now, of_all = sizes()
        assert now != rocker
        assert of_all - total == pytest.approx(now - rocker, abs=0.02)
        rocker, total = now, of_all
    assert page.get_attribute('#scrub', 'aria-valuetext') == page.inner_text('#drive')
    assert tab.complaints == []


@pytest.mark.slow
def test_it_plays_there_and_back_between_limits(browser, file, tmp_path):
    tab = Tab(browser.new_page(), tmp_path)
    page = tab.page
    open_page(tab, file)
    slide(page, 'links.rocker.length', 0)
    slide(page, 'links.crank.length', 1000)
    page.select_option('#speed', '5')
    page.evaluate('document.activeElement.blur()')
    page.keyboard.press(' ')
    seen = page.evaluate(
        """() => new Promise(done => {
            const seen = [], scrub = document.getElementById('scrub');
            const look = () => {
                seen.push(Number(scrub.value));
                if (seen.length < 150) requestAnimationFrame(look);
                else done(seen);
            };
            look();
        })"""
    )
    page.keyboard.press(' ')
    rising = np.diff(seen)
    assert (rising > 0.0).any()
    assert (rising < 0.0).any()
    assert np.abs(rising).max() <= 0.26  # it does not jump: a picture is 0.1 s at most
    assert tab.complaints == []
    page.close()
