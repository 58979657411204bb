"""The editor in a browser: machines built from nothing by the mouse, changed, saved and run."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path

import pytest
from browsing import Firefox, Tab, boxes, firefox, overlapping, violations
from editing import DRAWN_FOUR_BAR, Hand, editing
from middleware_network import PATIENCE
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import mechanism_sim as ms
from mechanism_sim import documents
from mechanism_sim.scene import load_scene

LOADER = """\
title: A new machine
mechanism: linkage
links:
  ground: {points: {p1: [0 mm, 0 mm], p2: [0 mm, -600 mm], p3: [300 mm, 300 mm]}}
  link_1: {length: 2500 mm, points: {p1: [1500 mm, 0 mm], p2: [1000 mm, 0 mm]},
           mass: 2.5 kg, inertia: 1.3 kg m^2, cog: 1250 mm}
  link_2: {length: 850 mm, points: {p1: [-480 mm, -140 mm]},
           mass: 0.85 kg, inertia: 0.0512 kg m^2, cog: 425 mm}
  link_3: {length: 640 mm, points: {p1: [550 mm, -840 mm]},
           mass: 0.64 kg, inertia: 0.0218 kg m^2, cog: 320 mm}
  link_4: {length: 950 mm, mass: 0.95 kg, inertia: 0.0714 kg m^2, cog: 475 mm}
  cylinder_1: {mass: 1 kg, inertia: 0.001 kg m^2}
  rod_1: {mass: 1 kg, inertia: 0.001 kg m^2}
  cylinder_2: {mass: 1 kg, inertia: 0.001 kg m^2}
  rod_2: {mass: 1 kg, inertia: 0.001 kg m^2}
joints:
  ground_link_1: {revolute: [ground.p1, link_1]}
  link_1_link_2: {revolute: [link_1.p1, link_2]}
  link_1_link_3: {revolute: [link_1.end, link_3]}
  link_2_link_4: {revolute: [link_2.p1, link_4]}
  link_3_link_4: {revolute: [link_3.end, link_4.end]}
  ground_cylinder_1: {revolute: [ground.p2, cylinder_1]}
  cylinder_1_rod_1: {prismatic: [cylinder_1, rod_1]}
  link_1_rod_1: {revolute: [link_1.p2, rod_1]}
  ground_cylinder_2: {revolute: [ground.p3, cylinder_2]}
  cylinder_2_rod_2: {prismatic: [cylinder_2, rod_2]}
  link_2_rod_2: {revolute: [link_2.end, rod_2]}
guess: {link_1: -36.9 deg, link_2: 110.6 deg, link_3: 51.3 deg, link_4: 18.4 deg,
        cylinder_1: 0 deg, cylinder_2: -33.8 deg}
drives:
  rod_1: {speed: 80 mm/s, start_position: 800 mm}
  rod_2: {speed: 70 mm/s, start_position: 730 mm}
duration: 1 s
gravity: [0, -9.81 m/s^2]
"""


CAM_TRAIN = """\
title: A new machine
mechanism: linkage
links:
  ground: {points: {p1: [0 mm, 0 mm], p2: [200 mm, 0 mm], p3: [200 mm, 90 mm]}}
  cam_1: {mass: 1 kg, inertia: 0.001 kg m^2}
  follower_1: {mass: 1 kg, inertia: 0.001 kg m^2}
  pulley_1: {mass: 1 kg, inertia: 0.001 kg m^2}
  wheel_1: {mass: 1 kg, inertia: 0.001 kg m^2}
gears:
  gear_1: {at: pulley_1, teeth: 20, module: 3 mm}
  gear_2: {at: wheel_1, teeth: 40, module: 3 mm}
joints:
  ground_cam_1: {revolute: [ground.p1, cam_1]}
  ground_follower_1: {prismatic: [ground.p1, follower_1], axis: 90 deg}
  cam_1_follower_1:
    cam: [cam_1, follower_1]
    follower: roller
    roller: 15 mm
    base_radius: 45 mm
    law:
      segments:
        - {from: 40 deg, to: 140 deg, rise: 15 mm}
        - {from: 220 deg, to: 320 deg, rise: -15 mm}
  ground_pulley_1: {revolute: [ground.p2, pulley_1]}
  cam_1_pulley_1: {belt: [cam_1, pulley_1], radii: [30 mm, 50 mm]}
  ground_wheel_1: {revolute: [ground.p3, wheel_1]}
  pulley_1_wheel_1: {mesh: [gear_1, gear_2]}
loads:
  force_1: {at: follower_1, force: [0 N, -40 N]}
sensors:
  accelerometer_1: {link: follower_1}
guess: {follower_1: 60 mm}
drive: {coordinate: cam_1, speed: 60 rpm}
"""


def same(hand: Hand, name: str, written: str, folder: Path) -> None:
    """Assert that a saved drawing equals a text by hand, with runs alike to the last bit."""
    hand.save(name)
    file = folder / 'written.yaml'
    file.write_text(written)
    assert documents.parse((folder / name).read_text()) == documents.parse(written)
    digest = ms.simulate(load_scene(str(file))).digest()
    assert ms.simulate(load_scene(str(folder / name))).digest() == digest == hand.ran()


def clean(hand: Hand) -> None:
    """Nothing was complained of, nobody else was asked."""
    assert hand.tab.complaints == []
    home = hand.address.partition('?')[0]
    assert all(request.startswith(home) for request in hand.tab.requests)


def train(hand: Hand) -> None:
    """A cam with its follower, a belt, gears, a force and a sensor, from nothing."""
    hand.tool('cam')
    hand.drag(0.0, 0.0, 0.0, 0.06)
    hand.tool('belt')
    hand.drag(0.0, 0.0, 0.2, 0.0)
    hand.tool('gears')
    hand.drag(0.2, 0.0, 0.2, 0.09)
    hand.tool('force')
    hand.drag(0.0, 0.06, 0.0, 0.02)
    hand.tool('accelerometer')
    hand.click(0.0, 0.06)


@pytest.mark.slow
def test_a_cam_a_belt_gears_a_force_and_a_sensor_are_drawn_dragged_and_played(
    tab, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    with editing() as address:
        hand = Hand(tab, address)
        train(hand)
        same(hand, 'drawn.yaml', CAM_TRAIN, tmp_path)
        assert hand.page.locator('.sign').count() == 2
        # every move of the mouse that the page answers is a frame, with forces, of gears that mesh
        before = hand.text
        hand.tool('move')
        arrows = hand.page.locator('#stage .forces path[d^="M"]')
        hand.until(lambda: arrows.count() >= 2)
        hand.mouse.move(*hand.at(0.2, 0.09))
        hand.mouse.down()
        for k in range(1, 6):
            hand.mouse.move(*hand.at(0.2 + 2e-3 * k, 0.09 - 2e-3 * k))
            hand.until(lambda k=k: int(hand.data('frames') or 0) >= k)
            assert arrows.count() >= 2
        hand.after(hand.mouse.up)
        assert hand.data('problem') == ''
        assert hand.text.count('module: 2.687419249 mm') == 2  # sqrt(80^2 + 10^2)/30
        hand.after(lambda: hand.page.keyboard.press('Control+z'))
        assert hand.text == before
        # by the keyboard: the force is chosen and removed
        hand.page.locator('[data-mark="loads.force_1"]').press('Enter')
        hand.page.locator('[name="loads.force_1.at"]').wait_for()
        hand.after(lambda: hand.page.keyboard.press('Delete'))
        assert 'force_1' not in hand.text
        hand.ran()
        hand.page.locator('#play').click()
        hand.until(lambda: float(hand.data('time') or 0.0) > 0.05)
        assert hand.tab.shoot('edit_train').stat().st_size > 10_000
        clean(hand)


@pytest.mark.slow
def test_it_is_drawn_by_the_keyboard_alone(tab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with editing() as address:
        hand = Hand(tab, address)
        press = hand.page.keyboard.press

        def go(right: int, up: int) -> None:
            """So many steps of the grid."""
            for key, count in (('Right', right), ('Left', -right), ('Up', up), ('Down', -up)):
                for _ in range(max(count, 0) // 10):
                    press(f'Shift+Arrow{key}')
                for _ in range(max(count, 0) % 10):
                    press(f'Arrow{key}')

        press('Tab')
        while hand.page.evaluate('document.activeElement.id') != 'over':
            press('Tab')
        x, y = map(float, hand.page.locator('#over').get_attribute('data-view').split()[:2])
        press('a')
        go(-round(1e3 * x), -round(1e3 * y))  # to the origin
        press('Enter')
        go(0, 60)
        hand.after(lambda: press('Enter'))
        press('b')
        go(0, -60)
        press('Enter')
        go(200, 0)
        hand.after(lambda: press('Enter'))
        press('e')
        press('Enter')
        go(0, 90)
        hand.after(lambda: press('Enter'))
        press('Shift+F')
        go(-200, -30)
        press('Enter')
        go(0, -40)
        hand.after(lambda: press('Enter'))
        press('Shift+A')
        go(0, 40)
        hand.after(lambda: press('Enter'))
        same(hand, 'drawn.yaml', CAM_TRAIN, tmp_path)
        clean(hand)


@pytest.mark.slow
@pytest.mark.parametrize('width', [390, 1440])
@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_what_is_drawn_is_accessible_and_overlaps_nowhere(
    width, scheme, browser, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path('train.yaml').write_text(CAM_TRAIN)
    with editing('train.yaml') as address:
        context = browser.new_context(
            viewport={'width': width, 'height': 900}, color_scheme=scheme, bypass_csp=True
        )
        hand = Hand(Tab(context.new_page(), tmp_path), address)
        hand.page.locator('[data-path="sensors.accelerometer_1"]').click()
        hand.page.locator('[name="sensors.accelerometer_1.link"]').wait_for()
        hand.ran()
        assert violations(hand.page) == []
        for chosen in ('header > h1, header .file > *', '#palette button, #palette h2',
                       '.tabs button', 'footer > *', '.zoom > *, .grid text',
                       '.sign circle'):  # fmt: skip
            assert overlapping(boxes(hand.page, chosen)) == []
        assert hand.page.evaluate('document.documentElement.scrollWidth') <= width
        names = hand.page.locator('#palette span')
        wide = names.evaluate_all(
            'all => all.filter(x => x.scrollWidth > x.parentElement.offsetWidth)'
            '.map(x => x.textContent)'
        )
        assert wide == []
        hand.tab.shoot(f'edit_train_{width}_{scheme}')
        clean(hand)
        context.close()


@pytest.mark.browser
@pytest.mark.slow
def test_firefox_drags_a_joint(tmp_path, tmp_path_factory, monkeypatch):
    if firefox() is None:
        pytest.skip('no Firefox here: install the package firefox-esr')
    monkeypatch.chdir(tmp_path)
    profile = tmp_path_factory.mktemp('profile')
    with editing('four_bar_clearance') as address, Firefox(profile) as found:
        found.goto(address)

        def until(text: str) -> None:
            end = time.monotonic() + 2.0 * PATIENCE
            while not found.evaluate(text):
                assert time.monotonic() < end, found.complaints
                time.sleep(0.02)

        until('Boolean(document.documentElement.dataset.run)')
        x, y = found.evaluate(
            """JSON.stringify((({x, y, width}) => [x + width / 2, y + width / 2])(
                document.querySelector('[data-handle="coupler_rocker"]').getBoundingClientRect()))"""
        )
        before = found.evaluate("JSON.stringify(document.getElementById('text').value)")
        found.drag([(x, y), *((x + k, y - k) for k in range(2, 31, 2))])
        until("document.getElementById('undo').disabled === false")
        after = found.evaluate("JSON.stringify(document.getElementById('text').value)")
        assert after != before
        assert found.evaluate('Number(document.documentElement.dataset.frames)') >= 1
        assert found.evaluate('JSON.stringify(document.documentElement.dataset.problem)') == ''
        until('document.documentElement.dataset.run === document.documentElement.dataset.number')
        found.shoot('edit_firefox')
        assert found.complaints == []


@pytest.mark.slow
def test_a_four_bar_is_built_from_nothing_dragged_and_played(tab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with editing() as address:
        hand = Hand(tab, address)
        hand.tool('ground')
        hand.click(0.0, 0.0)
        hand.click(0.2, 0.0)
        hand.tool('link')
        hand.drag(0.0, 0.0, 0.0, 0.05)
        hand.drag(0.0, 0.05, 0.15, 0.17)
        hand.drag(0.2, 0.0, 0.15, 0.17)
        hand.tool('drive')
        hand.click(0.0, 0.025)
        hand.tool('point')
        hand.click(0.075, 0.11)
        same(hand, 'drawn.yaml', DRAWN_FOUR_BAR, tmp_path)
        before = hand.text
        # every move of the mouse that the page answers is a frame with the machine assembled
        hand.tool('move')
        hand.drag(0.15, 0.17, 0.17, 0.18, steps=30)
        assert int(hand.data('frames')) >= 5
        assert hand.data('problem') == ''
        assert hand.text != before
        hand.after(lambda: hand.page.keyboard.press('Control+z'))
        assert hand.text == before
        hand.after(lambda: hand.page.keyboard.press('Control+Shift+Z'))
        assert hand.text != before
        hand.after(lambda: hand.page.locator('#undo').click())
        # the machine turns by hand, and nothing changes
        hand.tool('turn')
        hand.mouse.move(*hand.at(0.0, 0.05))
        hand.mouse.down()
        hand.mouse.move(*hand.at(-0.05, 0.0), steps=8)
        hand.until(lambda: int(hand.data('poses') or 0) > 2)
        hand.mouse.up()
        assert hand.text == before
        hand.ran()
        hand.page.locator('#play').click()
        hand.until(lambda: float(hand.data('time') or 0.0) > 0.05)
        assert hand.tab.shoot('edit_four_bar').stat().st_size > 10_000
        clean(hand)


@pytest.mark.slow
def test_escape_ends_a_drag_and_fields_hold_only_what_was_typed(tab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('m.yaml').write_text(DRAWN_FOUR_BAR)
    with editing('m.yaml') as address:
        hand = Hand(tab, address)
        hand.ran()
        (joint,) = boxes(hand.page, '[data-handle="link_2_link_3"]')
        hand.mouse.move(joint[0] + 8.0, joint[1] + 8.0)
        hand.mouse.down()
        hand.mouse.move(joint[0] + 40.0, joint[1] + 8.0, steps=4)
        hand.until(lambda: boxes(hand.page, '[data-handle="link_2_link_3"]') != [joint])
        hand.page.keyboard.press('Escape')
        hand.until(lambda: boxes(hand.page, '[data-handle="link_2_link_3"]') == [joint])
        hand.mouse.move(joint[0] + 80.0, joint[1] + 8.0, steps=4)
        hand.mouse.up()
        hand.ran()
        assert hand.text == DRAWN_FOUR_BAR
        # a field that has the focus shows what another page has made of it
        hand.page.locator('[data-path="links.link_1"]').click()
        length = hand.page.locator('[name="links.link_1.length"]')
        length.click()
        text = DRAWN_FOUR_BAR.replace('length: 50 mm', 'length: 51 mm')
        with connect(
            address.replace('http', 'ws').replace('/?', '/live?'), max_size=None
        ) as other:
            hand.after(lambda: other.send(json.dumps({'type': 'text', 'text': text})))
        assert length.input_value() == '51 mm'
        # undone from there, where nothing is being typed
        hand.after(lambda: hand.page.keyboard.press('Control+z'))
        assert hand.text == DRAWN_FOUR_BAR
        assert length.input_value() == '50 mm'
        clean(hand)


@pytest.mark.slow
def test_a_loader_is_built_from_nothing(tab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with editing() as address:
        hand = Hand(tab, address)
        for _ in range(11):
            hand.page.locator('#out').click()
        hand.shift(-230.0, -100.0)
        hand.tool('ground')
        for place in ((0.0, 0.0), (0.0, -0.6), (0.3, 0.3)):
            hand.click(*place)
        hand.tool('link')
        hand.drag(0.0, 0.0, 2.0, -1.5)  # the arm
        hand.drag(1.2, -0.9, 0.9, -0.1)  # the bellcrank
        hand.drag(2.0, -1.5, 2.4, -1.0)  # the bucket
        hand.tool('point')
        hand.click(1.05, -0.5)
        hand.click(2.2, -1.25)
        hand.tool('move')
        hand.drag(1.05, -0.5, 1.5, -1.3)
        hand.drag(2.2, -1.25, 3.0, -1.6)
        hand.tool('link')
        hand.drag(1.5, -1.3, 2.4, -1.0)
        hand.tool('cylinder')
        hand.drag(0.0, -0.6, 0.8, -0.6)
        hand.drag(0.3, 0.3, 0.9, -0.1)
        hand.after(lambda: hand.tool('masses'))
        hand.page.get_by_text('the whole scene').click()
        hand.page.locator('[name="gravity"]').wait_for()
        hand.fill('gravity', '[0, -9.81 m/s^2]')
        same(hand, 'drawn.yaml', LOADER, tmp_path)
        hand.page.locator('#tab-run').click()
        hand.page.locator('[data-figure="force"]').first.wait_for()
        hand.tab.shoot('edit_loader')
        clean(hand)


@pytest.mark.slow
def test_a_pump_jack_with_a_motor_from_nothing_to_a_report_of_its_wear(tab, tmp_path, monkeypatch):
    """Drawn by mouse alone, but for its data sheet: figures of a worn pin beside those before."""
    monkeypatch.chdir(tmp_path)
    with editing() as address:
        hand = Hand(tab, address)
        hand.tool('ground')
        hand.click(0.25, 0.0)
        hand.tool('link')
        hand.drag(0.25, 0.0, 0.25, 0.03)  # the crank
        hand.drag(-0.02, 0.13, 0.25, 0.13)  # the walking beam
        hand.drag(0.25, 0.03, 0.25, 0.13)  # the pitman
        hand.tool('point')
        hand.click(0.12, 0.13)
        hand.tool('ground')
        hand.click(0.12, 0.13)
        hand.tool('motor')
        hand.click(0.25, 0.015)
        hand.tool('force')
        hand.drag(-0.02, 0.13, -0.02, 0.08)  # the load of the rods
        hand.page.locator('[data-path="drive"]').click()
        for key, value in (
            ('rated_speed', '1435 rpm'), ('rated_torque', '12 Nm'), ('breakdown_torque', '31 Nm'),
        ):  # fmt: skip
            hand.fill(f'drive.motor.induction.{key}', value)
        hand.fill('drive.motor.ratio', '30')
        hand.page.locator('#tab-run').click()
        first = hand.ran()
        # a length of its own, in its field: no command line is spoken of
        field = hand.page.locator('#duration')
        assert '2 s' in (field.input_value(), field.get_attribute('placeholder'))
        field.fill('1.5 s')
        hand.after(lambda: field.press('Tab'))
        assert hand.ran() != first
        # the pin between pitman and beam wears
        hand.page.locator('#wear-joint').select_option('link_2_link_3')
        hand.until(lambda: hand.data('worn').startswith('link_2_link_3'))
        slider = hand.page.locator('#wear-radial')
        slider.focus()
        slider.press('End')
        hand.until(lambda: hand.data('worn').endswith(' 0.003'))
        row = hand.page.locator('[data-worn="force link_2_link_3"]')
        row.wait_for()
        before, after, ratio = row.locator('td').all_inner_texts()
        assert before.endswith('N')
        assert after.endswith('N')
        assert float(ratio.strip('× ')) != 1.0
        assert hand.page.locator('#time').inner_text() == '1.5 s'
        assert 'clearance' not in hand.text  # it is the run that is worn, not the document
        assert '--' not in hand.page.locator('body').inner_text()
        hand.tab.shoot('edit_pump_jack')
        hand.save('pump_jack.yaml')
        hand.page.locator('#make').select_option('report')
        hand.until(lambda: list(tmp_path.glob('*.html')))
        clean(hand)
    machine = load_scene(str(tmp_path / 'pump_jack.yaml'))
    assert machine.scene.drive.motor.ratio == 30.0


@pytest.mark.slow
def test_what_is_wrong_stands_beside_its_field(tab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with editing('four_bar_clearance') as address:
        hand = Hand(tab, address)
        hand.page.locator('#outline [data-path="links.crank"]').click()
        hand.page.locator('[name="links.crank.length"]').wait_for()
        said = hand.page.locator('#said')
        hand.page.locator('[name="rename"]').fill('a b')
        hand.page.keyboard.press('Enter')
        said.wait_for()
        assert "'a b' cannot be its name" in said.inner_text()
        hand.fill('links.crank.length', '-5 mm')
        said.wait_for(state='hidden')  # that was about something else
        wrong = hand.page.locator('.row.wrong')
        assert wrong.locator('label').inner_text() == 'length'
        sentence = wrong.locator('[role="alert"]').inner_text()
        assert sentence == hand.data('problem')
        assert "links.crank.length = '-5 mm' is out of bounds: it must be more than 0" in sentence
        hand.tab.shoot('edit_wrong')
        hand.fill('links.crank.length', '70 mm')
        assert hand.data('problem') == ''
        assert wrong.count() == 0
        # a sentence that comes while somebody is typing leaves what is typed
        field = hand.page.locator('[name="links.crank.mass"]')
        field.fill('0.7 k')
        hand.ran()
        assert field.input_value() == '0.7 k'
        hand.fill('links.crank.mass', '0.7 kg')
        clean(hand)
    assert list(tmp_path.glob('*.yaml')) == []


@pytest.mark.slow
def test_it_fits_windows_of_every_size_by_day_and_night(browser, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with editing('four_bar_coupler_curve') as address:
        for opened, width, height in ((390, 390, 844), (1440, 1440, 900), (1440, 400, 844)):
            for scheme in ('light', 'dark'):
                context = browser.new_context(
                    viewport={'width': opened, 'height': height}, color_scheme=scheme
                )
                hand = Hand(Tab(context.new_page(), tmp_path), address)
                hand.page.locator('#outline [data-path="links.coupler"]').click()
                hand.page.locator('[name="links.coupler.length"]').wait_for()
                hand.ran()
                hand.page.set_viewport_size({'width': width, 'height': height})
                hand.page.evaluate(
                    'new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)))'
                )
                wide = hand.page.evaluate('document.documentElement.scrollWidth')
                assert wide <= width
                sheet = hand.page.locator('#over').bounding_box()
                assert sheet['width'] >= 0.6 * width
                assert sheet['height'] >= 220
                places = hand.page.evaluate(
                    "[...document.querySelectorAll('.knob')].map((x) => x.getBoundingClientRect())"
                    '.map(({ x, y }) => [x - {x}, y - {y}])'.replace(
                        '{x}', str(sheet['x'])
                    ).replace('{y}', str(sheet['y']))
                )
                assert len(places) == 7
                fills = hand.page.evaluate(
                    "[...document.querySelectorAll('#stage .machine :is(.plate, .body)')]"
                    '.map((x) => getComputedStyle(x).fill)'
                )
                assert len(set(fills)) == 3  # of three links, each in its colour
                assert all(
                    0 <= x <= sheet['width'] and 0 <= y <= sheet['height'] for x, y in places
                )
                hand.tab.shoot(f'edit_{width}_{scheme}')
                clean(hand)
                context.close()


@pytest.mark.slow
def test_the_machine_is_drawn_where_it_is_grabbed(tab, tmp_path, monkeypatch):
    """Origins of links lie in their knobs, in every size of the window, zoomed and after a run."""
    origins = """Object.fromEntries([...document.querySelectorAll(
        '#stage .machine g[data-kind=link]')].map((g) => [g.dataset.link, g.getScreenCTM()])
        .map(([link, { e, f }]) => [link, [e, f]]))"""
    knobs = """Object.fromEntries([...document.querySelectorAll('.knob')].map((x) =>
        [x.dataset.handle, x.getBoundingClientRect()])
        .map(([key, { x, y, width, height }]) => [key, [x + width / 2, y + height / 2]]))"""
    monkeypatch.chdir(tmp_path)
    with editing('four_bar_clearance') as address:
        hand = Hand(tab, address)

        def apart():
            hand.page.evaluate(
                'new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)))'
            )
            drawn, grabbed = hand.page.evaluate(origins), hand.page.evaluate(knobs)
            return max(
                math.dist(drawn[link], grabbed[key])
                for link, key in (('crank', 'ground_crank'), ('coupler', 'crank_coupler'))
            )

        for width, height in ((1440, 900), (390, 844), (900, 600)):
            hand.page.set_viewport_size({'width': width, 'height': height})
            assert apart() < 1.0, (width, height)
        hand.page.locator('#in').click()
        assert apart() < 1.0
        hand.ran()
        hand.page.locator('#play').click()
        hand.page.keyboard.press('Escape')
        hand.page.set_viewport_size({'width': 1000, 'height': 700})
        assert apart() < 1.0
        hand.page.locator('#fit').click()
        assert apart() < 1.0


def test_nobody_gets_in_without_the_key_or_from_another_site(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with editing() as address:
        home, _, key = address.partition('?')
        door = home.replace('http', 'ws') + 'live'
        for where, origin in (
            (door, None),
            (f'{door}?key=x', None),
            (f'{door}?{key}', 'http://a'),
        ):
            with pytest.raises(InvalidStatus) as refused:
                connect(where, origin=origin)
            assert refused.value.response.status_code == 403
        with connect(f'{door}?{key}', origin=home.rstrip('/')) as socket:
            assert json.loads(socket.recv(PATIENCE))['type'] == 'state'
            socket.send('no JSON')
            with pytest.raises(ConnectionClosed, match='no JSON'):
                list(iter(lambda: socket.recv(PATIENCE), None))


@pytest.mark.slow
def test_a_link_drawn_anywhere_is_grounded_later_and_a_chart_follows_the_drag(
    tab, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    with editing() as address:
        hand = Hand(tab, address)
        state = hand.page.locator('#state')
        assert 'wrong' not in (state.get_attribute('class') or '')
        assert state.inner_text().startswith('Draw a link')
        hand.tool('link')
        hand.drag(0.02, 0.03, 0.02, 0.08)
        knob = hand.page.locator('[data-handle="link_1.start"]').bounding_box()
        x, y = hand.at(0.02, 0.03)
        assert abs(knob['x'] + 0.5 * knob['width'] - x) < 2.0
        assert abs(knob['y'] + 0.5 * knob['height'] - y) < 2.0
        assert 'not joined to the frame yet' in state.inner_text()
        hand.drag(0.22, 0.03, 0.17, 0.18)
        hand.drag(0.02, 0.08, 0.17, 0.18)
        for x in (0.02, 0.22):
            hand.tool('ground')
            hand.click(x, 0.03)
        hand.tool('drive')
        hand.click(0.02, 0.055)
        assert hand.data('problem') == ''
        hand.page.locator('#tab-chart').click()
        hand.page.select_option('#quantity', 'link_2: angle')
        hand.until(lambda: hand.data('charted') == 'link_2: angle')
        curve = hand.page.locator('#curves .chosen')
        before = curve.get_attribute('d')
        hand.tool('move')
        hand.mouse.move(*hand.at(0.02, 0.08))
        hand.mouse.down()
        hand.mouse.move(*hand.at(0.02, 0.09), steps=4)
        hand.until(lambda: curve.get_attribute('d') != before)
        hand.tab.shoot('edit_chart')
        hand.mouse.up()
        hand.ran()
        for width in (1440, 390):
            hand.page.set_viewport_size({'width': width, 'height': 860})
            hand.tab.shoot(f'edit_chart_{width}')
            assert overlapping(boxes(hand.page, '.tabs button')) == []
        clean(hand)


@pytest.mark.slow
def test_files_are_made_of_what_is_drawn(tab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with editing('slider_crank') as address:
        hand = Hand(tab, address)
        said = hand.page.locator('#said')
        made = {
            'PNG': ('.png', b'\x89PNG'), 'SVG': ('.svg', b'<?xml'), 'DXF': ('.dxf', b'  0'),
            'CSV of a turn': ('.csv', b't [s],'), 'report': ('.html', b'<!doctype'),
            'page with sliders': ('_sliders.html', b'<!doctype'),
        }  # fmt: skip
        for what, (end, start) in made.items():
            hand.page.select_option('#make', what)
            file = tmp_path.resolve() / f'slider_crank{end}'
            hand.until(lambda file=file: said.inner_text() == f'saved: {file}')
            assert file.read_bytes().startswith(start)
        hand.page.select_option('#make', 'PNG')
        hand.page.get_by_text('slider_crank_1.png').wait_for()  # nothing is written over
        hand.page.locator('#tab-yaml').click()
        hand.after(lambda: hand.page.fill('#text', 'title: Nothing'))
        hand.page.select_option('#make', 'PNG')
        hand.page.get_by_text("'mechanism' is missing").last.wait_for()
        clean(hand)


@pytest.mark.slow
def test_what_is_being_typed_is_saved_kept_and_asked_for(tab, tmp_path, monkeypatch):
    """Ctrl+S in a field takes it along; no text is lost that was typed for a second."""
    monkeypatch.chdir(tmp_path)
    file, kept = tmp_path / 'machine.yaml', tmp_path / '.machine.yaml.unsaved'
    file.write_text(DRAWN_FOUR_BAR)
    with editing('machine.yaml') as address:
        hand = Hand(tab, address)
        keys, said = hand.page.keyboard, hand.page.locator('#said')

        def saved(expected: str, what: str) -> None:
            said.evaluate('said => { said.textContent = "" }')
            keys.press('Control+s')
            hand.until(lambda: expected in said.inner_text())
            assert ('saved' in expected) == (what in file.read_text())

        hand.page.locator('#tab-yaml').click()
        hand.page.locator('#text').click()
        keys.press('Control+End')
        keys.type('# one\n')
        saved('saved: machine.yaml', '# one')
        # half a line: the picture is as it was, the caret where it was, and it is kept
        drawn = hand.page.locator('#stage').inner_html()
        hand.after(lambda: keys.type('gravity: [0, '))
        hand.until(lambda: 'gravity: [0, ' in (kept.read_text() if kept.exists() else ''))
        assert 'machine:' in hand.data('problem')
        assert hand.page.locator('#stage').inner_html() == drawn
        hand.after(lambda: keys.type('-9.81]\n'))
        assert hand.text.endswith('# one\ngravity: [0, -9.81]\n')
        hand.until(lambda: hand.data('problem') == '')
        asked: list[str] = []
        hand.page.once('dialog', lambda dialog: (asked.append(dialog.type), dialog.accept()))
        keys.type('# two\n')
        hand.page.reload()
        assert asked == ['beforeunload']
        hand.until(lambda: hand.text.endswith('-9.81]\n# two\n'))
        # the same in a field, also after a state has come amid it
        hand.page.locator('#tab-parts').click()
        hand.page.locator('#outline [data-path="links.link_1"]').click()
        field = hand.page.locator('[name="links.link_1.length"]')
        field.fill('60 mm')
        saved('saved: machine.yaml', 'length: 60 mm')
        field.fill('[70 mm')
        saved('links.link_1.length:', '70 mm')
        assert field.input_value() == '[70 mm'
        keys.press('Control+a')
        keys.type('80 m')
        hand.page.evaluate("document.getElementById('redo').disabled = false")
        hand.page.evaluate("document.getElementById('redo').click()")  # a state without news
        hand.until(lambda: hand.page.locator('#redo').is_disabled())
        assert field.input_value() == '80 m'
        assert '80 m' not in hand.text
        hand.after(lambda: field.press('Tab'))
        assert 'length: 80 m}' in hand.text
        clean(hand)


@pytest.mark.slow
def test_no_text_is_typed_before_the_scene_is_there(tab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with editing('four_bar_clearance') as address:
        page = tab.page
        page.route_web_socket('**/live*', lambda _: None)  # and nothing comes
        page.goto(address)
        page.locator('#tab-yaml').click()
        page.locator('#text').click()
        page.keyboard.type('title: Nothing')
        assert page.locator('#text').input_value() == ''
        page.unroute_all()
