"""Editing by touch without a browser: texts, gestures, pictures, runs in the background."""

from __future__ import annotations

import copy
import difflib
import html
import math
import queue
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from editing import DRAWN_FOUR_BAR, Page

import mechanism_sim as ms
from mechanism_sim import documents, strict_json
from mechanism_sim.catalogue import config_folder, scene_names
from mechanism_sim.cli import main
from mechanism_sim.editor import palette
from mechanism_sim.editor.background import Background
from mechanism_sim.editor.document import Document
from mechanism_sim.editor.files_beside import FilesBeside
from mechanism_sim.editor.motion import INSTANTS, Turn
from mechanism_sim.editor.rounding import rounded
from mechanism_sim.editor.scene_text import renamed, with_value, without
from mechanism_sim.editor.sketch import Edit
from mechanism_sim.editor.tools import TOOLS as OF_KINDS
from mechanism_sim.errors import InputError
from mechanism_sim.export.urdf import to_urdf
from mechanism_sim.joints.kinds import KINDS
from mechanism_sim.keys.names import RESERVED
from mechanism_sim.scene import Machine, load_scene
from mechanism_sim.scene.loads import LOADS
from mechanism_sim.scene.sensors import SENSORS

TOOLS = [tool.name for tools in palette.GROUPS.values() for tool in tools]
FILES = sorted(config_folder().glob('**/*.yaml'))


def ended(*args: str) -> object:
    """Exit code of a command."""
    with pytest.raises(SystemExit) as end:
        main(list(args))
    return end.value.code


def leaves(data: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """All plain values of a document."""
    if isinstance(data, dict | list):
        items = data.items() if isinstance(data, dict) else enumerate(data)
        for key, inner in items:
            yield from leaves(inner, (*path, str(key)))
    else:
        yield path, data


def placed(data: Any, path: tuple[str, ...], value: Any) -> Any:
    """Data with another value at a path, by plain Python."""
    data = copy.deepcopy(data)
    here = data
    for part in path[:-1]:
        here = here[int(part)] if isinstance(here, list) else here.setdefault(part, {})
    here[int(path[-1]) if isinstance(here, list) else path[-1]] = value
    return data


def changed(old: str, new: str) -> list[str]:
    """Lines that are only in one of two texts."""
    return [x for x in difflib.ndiff(old.splitlines(), new.splitlines()) if x[0] in '+-']


@pytest.mark.sample(3)
@pytest.mark.parametrize('file', FILES, ids=lambda f: f.stem)
def test_a_value_changes_one_line_and_comes_back_as_yaml(file):
    text, rng = file.read_text(), random.Random(file.stem)
    data = documents.parse(text)
    values = [x for x in leaves(data) if x[0] != ('description',)]
    for path, _ in rng.sample(values, min(4, len(values))):
        new = rng.choice(['12.5 mm', 7, 0.25, 'a, b: [c'])
        got = with_value(text, path, new)
        assert documents.parse(got) == placed(data, path, new)
        assert len(changed(text, got)) == 2
        beside = (*path[:-1], 'new_key')
        if not isinstance(_inner(data, path[:-1]), list):
            for value in ('5 mm', {'a': {'b': 1}}):
                more = with_value(text, beside, value)
                assert documents.parse(more) == placed(data, beside, value)
                assert without(more, beside) == text


def _inner(data: Any, path: tuple[str, ...]) -> Any:
    for part in path:
        data = data[int(part)] if isinstance(data, list) else data[part]
    return data


def test_comments_order_quotes_and_breaks_stay():
    text = (
        '# head\ntitle: "T"  # why\nlinks:\n  a: {length: 1 m, # long\n      cog: 2 mm}\n'
        '  # between\n  b:   # own line\n    length: 3 m\n\n    mass: 1 kg  # heavy\njoints:\n'
    )
    got = with_value(text, ('links', 'b', 'length'), '4 m')
    assert got == text.replace('3 m', '4 m')
    got = with_value(text, ('links', 'a', 'mass'), '1 kg')
    assert got == text.replace('2 mm}', '2 mm, mass: 1 kg}')
    got = with_value(text, ('links', 'b', 'cog'), '1 mm')
    assert got == text.replace('# heavy\n', '# heavy\n    cog: 1 mm\n')
    got = with_value(text, ('joints', 'pin'), {'revolute': ['a', 'b']})
    assert got == text.replace('joints:\n', 'joints:\n  pin: {revolute: [a, b]}\n')
    assert without(text, ('links', 'b', 'mass')) == text.replace('    mass: 1 kg  # heavy\n', '')
    assert without(text, ('links', 'a', 'length')) == text.replace(
        'length: 1 m, # long\n      ', ''
    )
    assert without(text, ('links', 'c')) == renamed(text, ('links', 'c'), 'd') == text
    assert renamed(text, ('links', 'b'), 'rod') == text.replace('  b:', '  rod:')


def test_what_an_alias_repeats_is_not_changed_through_it():
    text = 'a: &x {b: 1}\nc: *x\n'
    with pytest.raises(InputError, match='alias'):
        with_value(text, ('c', 'b'), 2)
    with pytest.raises(InputError, match='plain value'):
        with_value(text, ('a', 'b', 'd'), 2)


def test_what_aliases_stand_for_is_changed_for_all_of_them_or_not_at_all():
    text = 'a: {l: &x 5 mm}\nb: {l: *x, p: &p {P: [1, 2]}}\nc: *p\n'
    got = with_value(text, ('a', 'l'), '6 mm')
    assert got == text.replace('5 mm', '6 mm')
    assert documents.parse(with_value(text, ('b', 'p'), {'Q': [3, 4]}))['c'] == {'Q': [3, 4]}
    for path in (('a', 'l'), ('a',), ('b',)):
        with pytest.raises(InputError, match=r"an alias elsewhere \('\*[xp]'\)"):
            without(text, path)


@pytest.mark.parametrize(
    ('path', 'value', 'old', 'new'),
    [
        (('b', 'm'), '1 kg', '{l: *x}', '{l: *x, m: 1 kg}'),
        (('b',), {'l': '5 mm', 'm': '1 kg'}, '{l: *x}', '{l: 5 mm, m: 1 kg}'),
        (('c', 'p', 'n'), 2, '    o: *p  # same\n', '    o: *p  # same\n    n: 2\n'),
        (('d', 'q'), None, ', q: 3}', '}'),
    ],
)
def test_what_stands_beside_an_alias_is_changed_there(path, value, old, new):
    """Not beside what the alias stands for, where the text between was taken for its value."""
    text = """\
a: {l: &x 5 mm, p: &p [1, 2]}
b: {l: *x}
c:
  p:
    o: *p  # same
d: {p: *p, q: 3}
"""
    assert text.count(old) == 1
    got = without(text, path) if value is None else with_value(text, path, value)
    assert got == text.replace(old, new)


def test_of_lists_and_parts_only_what_differs_is_written_anew():
    text = """\
points:
  A: [0 mm, 1.50]   # the pivot
  B:
    - "2 mm"  # from the left
    - 3 mm    # from below
  C: [4 mm, 5 mm]  # free
"""
    points = {'A': ['0 mm', 1.5], 'B': ['2 mm', '3 mm'], 'C': ['4 mm', '5 mm']}
    assert with_value(text, ('points',), points) == text
    moved = {**points, 'B': ['2 mm', '7 mm']}
    assert with_value(text, ('points',), moved) == text.replace('3 mm ', '7 mm ')
    more = {'A': ['1 mm', 1.5], 'B': points['B'], 'D': ['6 mm', '6 mm']}
    assert with_value(text, ('points',), more) == text.replace('[0 mm', '[1 mm').replace(
        'C: [4 mm, 5 mm]  # free', 'D: [6 mm, 6 mm]'
    )


@pytest.mark.parametrize(
    'text',
    ['two-stroke ' * 12 + 'end', f'sin({"+".join(["t"] * 99)})', 'one paragraph\n\n- another',
     'a  wide   space ' * 9 + 'end', ' of its own\nindent', '# no comment', '42', 'a: b'],
)  # fmt: skip
@pytest.mark.parametrize('path', [('description',), ('new',), ('loads', 'pull', 'note')])
def test_a_text_of_any_length_and_form_is_what_was_given(path, text):
    value = documents.parse(with_value('description: old\nloads:\n  pull: {}\n', path, text))
    for key in path:
        value = value[key]
    assert value.removesuffix('\n') == text


@pytest.mark.parametrize(
    'text', ['Press: "first" try', '[V] 2.6: a crank', 'No #1', '42', '{not} a: part', "it's"]
)
def test_titles_and_descriptions_are_any_text(text):
    page = Page('geneva')
    for key in ('title', 'description'):
        page.set(key, text)
        assert page.said == []
        assert documents.parse(page.text)[key].strip() == text
        assert page.state['problem'] == ''
        (row,) = [row for row in page.state['rows'] if row['name'] == key]
        assert row['text'] == text


def test_paragraphs_of_a_description_stay_where_a_word_of_it_is_changed():
    page = Page()
    page.set('description', 'One paragraph.\n\nAnother one.')
    page.set('description', page.state['rows'][1]['text'].replace('one', 'two'))
    assert documents.parse(page.text)['description'] == 'One paragraph.\n\nAnother two.\n'


def test_the_axis_of_a_sensor_is_a_word_or_an_angle():
    page = Page('four_bar_measured')
    name = next(iter(page.session.document.content()['sensors']))
    page.ask('select', path=['sensors', name])
    for text in ('30 deg', 'along'):
        page.set(f'sensors.{name}.axis', text)
        (row,) = [row for row in page.state['rows'] if row['name'] == 'axis']
        assert (row['text'], row['choices'], page.state['problem']) == (text, [], '')
    page.set(f'sensors.{name}.axis', '')
    (row,) = [row for row in page.state['rows'] if row['name'] == 'axis']
    assert row['default'] == 'across'


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', scene_names())
def test_every_scene_opens_and_a_number_changed_by_the_panel_is_one_line(name):
    page = Page(name)
    state = page.state
    assert state['problem'] == ''
    assert state['assembled']
    assert state['stage']['shapes']
    assert not state['changed']
    assert strict_json.dumps(state)
    before = page.text
    number = next(
        (path, value)
        for path, value in leaves(documents.parse(before))
        if path[0] not in ('title', 'description', 'measures', 'solver')
        and isinstance(value, str) and value.split()[0].replace('.', '').strip('0').isdigit()
    )  # fmt: skip
    path, value = number
    size, _, unit = value.partition(' ')
    page.ask('select', path=path[:2])
    page.set('.'.join(path), f'{float(size) * 1.001:.10g} {unit}')
    assert len(changed(before, page.text)) == 2
    assert page.state['changed']
    page.ask('undo')
    assert page.text == before
    assert not page.state['changed']
    assert page.said == []


@pytest.mark.parametrize('name', ['four_bar_coupler_curve', 'loader', 'slider_crank', 'ten_links'])
def test_a_curve_is_where_the_machine_goes(name):
    machine = load_scene(name)
    turn = Turn(Machine(name, machine.scene))
    assert turn.q.shape[1] == INSTANTS
    end = machine.scene.duration if machine.plan.main in machine.mechanism.displacements else None
    solution = ms.simulate(machine, duration=end or machine.drive.period)
    t = np.linspace(0.0, solution.duration, INSTANTS)
    run = solution.sample(t)
    for k, c in enumerate(turn.mechanism.coordinates):
        off = turn.q[k] - run[f'position.{c}']
        if c not in turn.mechanism.displacements:
            off = np.remainder(off + np.pi, 2.0 * np.pi) - np.pi
        assert np.abs(off).max() < 1e-8


@pytest.mark.parametrize(
    ('name', 'key'),
    [('four_bar_coupler_curve', 'coupler_rocker'), ('loader', 'lift_rod_arm'),
     ('four_bar_clearance', 'crank_coupler'), ('slider_crank', 'crank_rod')],
)  # fmt: skip
def test_a_joint_goes_where_it_is_dragged_and_all_others_stay(name, key):
    page = Page(name)
    if key not in {h['key'] for h in page.state['handles']}:
        key = next(h['key'] for h in page.state['handles'] if h['joint'] and not h['ground'])
    before = {h['key']: h['at'] for h in page.state['handles'] if h['joint']}
    left, _, right, _ = page.state['stage']['bounds']
    size = right - left
    step = 10.0 ** math.floor(math.log10(size / 500.0))
    x, y = before[key]
    to = x + 0.03 * size, y + 0.02 * size
    page.ask('drag', handle=key, x=to[0], y=to[1], step=step)
    assert page.heard[-1]['type'] == 'frame'
    assert page.heard[-1]['problem'] == ''
    dragged = {h['key']: h['at'] for h in page.heard[-1]['handles'] if h['joint']}
    page.drop(key, *to, step)
    assert page.said == []
    assert page.state['problem'] == ''
    for other, at in before.items():
        wanted = to if other == key else at
        for found in (dragged[other], page.at(other)):
            assert math.dist(found, wanted) < 4.0 * step
    page.ask('undo')
    assert page.at(key) == pytest.approx((x, y))


@pytest.mark.parametrize(
    ('name', 'key'),
    [('ten_links', 'strut_foot'), ('windshield_wiper', 'coupler_left_rocker'),
     ('film_advance', 'coupler_rocker')],
)  # fmt: skip
def test_a_drive_starts_where_it_did_when_a_joint_of_other_links_is_dragged(name, key):
    page = Page(name)
    before = page.session.document.content()['drive']
    left, _, right, _ = page.state['stage']['bounds']
    x, y = page.at(key)
    far = 0.01 * (right - left)
    page.drop(key, x + far, y + 0.6 * far, 10.0 ** math.floor(math.log10(0.2 * far)))
    assert page.said == []
    assert page.state['changed']
    assert page.session.document.content()['drive'] == before


def test_a_drag_that_is_not_dropped_goes_back():
    page = Page('four_bar_clearance')
    before = page.state
    x, y = page.at('coupler_rocker')
    page.ask('drag', handle='coupler_rocker', x=x + 0.02, y=y + 0.01, step=1e-3)
    assert page.heard[-1]['handles'] != before['handles']
    page.ask('select', path=[])
    assert page.text == before['text']
    assert page.at('coupler_rocker') == pytest.approx((x, y))
    assert page.session.number > before['number']  # which is run anew


def test_a_joint_that_is_dragged_to_the_other_side_stays_on_its_branch():
    page = Page('four_bar_clearance')
    x, y = page.at('coupler_rocker')
    page.drop('coupler_rocker', x, -y)
    assert page.at('coupler_rocker') == pytest.approx((x, -y), abs=3e-3)
    assert 'branch: crossed' in page.text


@pytest.mark.parametrize('tool', ['motor', 'drive'])
def test_a_four_bar_that_is_written_out_has_no_branch(tool):
    """Its guesses say how it is assembled: no other kind of mechanism has that key."""
    page = Page('four_bar_clearance')
    (x, y), (u, v) = page.at('crank_coupler'), page.at('coupler_rocker')
    page.draw(tool, (0.5 * (x + u), 0.5 * (y + v), 'coupler/'))
    content = page.session.document.content()
    assert content['mechanism'] == 'linkage'
    assert 'branch' not in content
    assert 'unknown key' not in page.state['problem']


def test_masses_of_links_that_have_them_are_refused_in_a_sentence():
    page = Page('four_bar_clearance')
    before = page.text
    page.draw('masses', (0.0, 0.0, ''))
    assert page.said == ['every link has a mass already']
    assert page.text == before


def four_bar() -> Page:
    """A four-bar drawn from nothing."""
    page = Page()
    page.draw('ground', (0.0, 0.0, ''))
    page.draw('ground', (0.2, 0.0, ''))
    page.draw('link', (0.0, 0.0, 'ground.p1'), (0.0, 0.05, ''))
    page.draw('link', (0.0, 0.05, 'link_1.end'), (0.15, 0.17, ''))
    page.draw('link', (0.2, 0.0, 'ground.p2'), (0.15, 0.17, 'link_2.end'))
    page.draw('drive', (0.0, 0.02, 'link_1/'))
    page.draw('point', (0.075, 0.11, 'link_2/'))
    return page


def test_a_four_bar_from_nothing_is_what_one_would_write():
    page = four_bar()
    assert documents.parse(page.text) == documents.parse(DRAWN_FOUR_BAR)
    assert page.said == []
    assert page.state['problem'] == ''
    # the lengths are those between the places, by Pythagoras
    assert round(math.hypot(150, 120)) == 192
    assert round(math.hypot(50, 170)) == 177
    assert set(page.state['curves']) == {'link_2.p1'}
    # the end of the crank goes round its pivot
    page.ask('select', path=['links', 'link_1'])
    assert page.state['tracks'] == [('link_1.start', False), ('link_1.end', False)]
    page.ask('trace', point='link_1.end')
    radii = np.hypot(*np.array(page.state['curves']['link_1.end']).T)
    assert radii == pytest.approx(np.full(INSTANTS, 0.05), abs=1e-6)
    page.ask('trace', point='link_2.p1')
    assert set(page.state['curves']) == {'link_1.end'}


def crank() -> Page:
    """A crank of 50 mm that turns about the origin."""
    page = Page()
    page.draw('ground', (0.0, 0.0, ''))
    page.draw('link', (0.0, 0.0, 'ground.p1'), (0.03, 0.04, ''))
    page.draw('drive', (0.01, 0.01, 'link_1/'))
    return page


def drawn(page: Page, *gestures: tuple[Any, ...]) -> dict[str, np.ndarray]:
    """Parts drawn one after the other; the coordinates over a turn of the machine, from zero."""
    for what, *ends in gestures:
        page.draw(what, *ends)
    assert page.said == []
    assert page.state['problem'] == ''
    turn = page.session._picture.turn
    assert turn is not None
    return {c: q - q[0] for c, q in zip(turn.mechanism.coordinates, turn.q, strict=True)}


WITHOUT_TOOL = (
    'arc_slot', 'bushings', 'contact', 'fixed', 'freewheel', 'ratchet', 'rope', 'servos', 'states',
)  # fmt: skip
"""Kinds that are written as text, not drawn."""

NO_KIND = 'links', 'drive', 'clearance', 'elastic', 'oscillators', 'stops'
"""Tools that are of parts of a scene or of a joint, not of a kind."""


def test_a_part_is_joined_to_what_the_page_had_not_seen_yet():
    """The next part is begun before the answer to the last one is there."""
    slow, fast = Page(), Page()
    seen = fast.state['number']
    for what, on, start, end in (
        ('link', '', (0.0, 0.0), (0.0, 0.05)),
        ('link', 'link_1.end', (0.0, 0.05), (0.15, 0.17)),
        ('link', 'link_1_link_2', (0.0, 0.05), (-0.1, 0.17)),  # whose point is a pin by now
        ('link', 'link_2/', (0.075, 0.11), (0.1, 0.0)),
        ('ground', 'link_1.start', (0.0, 0.0), (0.0, 0.0)),
        ('drive', 'link_1/', (0.0, 0.025), (0.0, 0.025)),
        ('spring', 'link_4.end', (0.1, 0.0), (0.2, 0.0)),
    ):
        slow.draw(what, (*start, on), (*end, ''))
        off = 0.001 if '_' in on and '/' not in on else 0.0  # a pointer beside a point
        near = start[0] + off, start[1] - off
        fast.draw(
            what, (*near, 'link_1.end' if on == 'link_1_link_2' else ''), (*end, ''), seen=seen
        )
    assert slow.said == fast.said == []
    assert 'link_2_link_4' in slow.text
    assert fast.text == slow.text


def test_tools_come_from_the_kinds_and_no_two_have_a_name_or_a_key_in_common():
    tools = [tool for tools in palette.GROUPS.values() for tool in tools]
    kinds = KINDS.keys() | LOADS.keys() | SENSORS.keys() | {*NO_KIND}
    missing = kinds - {*OF_KINDS, *WITHOUT_TOOL}
    assert not missing, 'give these a tool in editor/tools, or list them in WITHOUT_TOOL here'
    assert {*OF_KINDS, *WITHOUT_TOOL} == kinds
    for of_kind in OF_KINDS.values():
        assert of_kind
        assert set(of_kind) <= set(tools)
    for key in ('name', 'key'):
        assert len({getattr(tool, key) for tool in tools}) == len(tools)
    assert not {tool.key for tool in tools} & {'V', 'T', 'X', 'F'}  # of the hand, and to fit


@pytest.mark.slow
def test_gears_belts_and_racks_roll_as_their_radii_say():
    q = drawn(
        Page(), ('gears', (0.0, 0.0, ''), (0.06, 0.0, '')),
        ('gears', (0.06, 0.0, 'ground_wheel_2'), (0.15, 0.0, '')),
        ('belt', (0.0, 0.0, 'ground_wheel_1'), (0.0, 0.2, '')),
        ('rack', (0.0, 0.0, 'ground_wheel_1'), (0.0, -0.04, '')),
    )  # fmt: skip
    first = q['wheel_1']
    assert first[-1] == pytest.approx(2.0 * math.pi)
    # 20, 40 and 50 teeth of 2 mm: 2*90/2 - 40; pulleys of 30 and 50 mm; a pinion of 40 mm
    assert q['wheel_2'] == pytest.approx(-first / 2.0)
    assert q['wheel_3'] == pytest.approx(20.0 / 50.0 * first)
    assert q['pulley_1'] == pytest.approx(first * 30.0 / 50.0)
    assert np.abs(q['rack_1']) == pytest.approx(0.04 * first, abs=1e-9)
    sun = drawn(
        crank(), ('gears', (0.0, 0.0, 'ground_link_1'), (0.03, 0.04, 'link_1.end')),
    )  # fmt: skip
    # Willis: about a sun of 20 teeth that is held, a planet of 40 turns 1 + 20/40 times
    assert sun['wheel_1'] == pytest.approx(1.5 * sun['link_1'])


@pytest.mark.slow
def test_cams_rise_and_geneva_wheels_and_yokes_move_as_drawn():
    slides = drawn(Page(), ('cam', (0.0, 0.0, ''), (0.0, 0.06, '')))['follower_1']
    assert slides.max() == pytest.approx(0.015, abs=1e-9)  # a quarter of 60 mm
    assert slides.min() == pytest.approx(0.0, abs=1e-9)
    page = Page()
    page.draw('ground', (0.1, 0.02, ''))
    page.draw('link', (0.1, 0.02, 'ground.p1'), (0.02, 0.06, ''))
    swings = drawn(page, ('cam', (0.0, 0.0, ''), (0.02, 0.06, 'link_1.end')))['link_1']
    assert np.ptp(swings) == pytest.approx(math.radians(10.0), abs=1e-6)  # 63 mm/4 over 89 mm
    q = drawn(
        crank(), ('geneva', (0.03, 0.04, 'link_1.end'), (-0.07, 0.0, '')),
        ('stepper', (0.03, 0.04, 'link_1.end'), (0.0, -0.08, '')),
        ('slot', (0.03, 0.04, 'link_1.end'), (0.13, 0.04, '')),
    )  # fmt: skip
    assert abs(q['wheel_1'][-1]) == pytest.approx(0.5 * math.pi, abs=1e-6)  # four slots
    assert abs(q['rack_1'][-1]) == pytest.approx(0.1, abs=1e-6)  # twice the crank
    turned = math.atan2(4.0, 3.0) + q['link_1']
    assert q['yoke_1'] == pytest.approx(0.05 * (np.cos(turned) - np.cos(turned[0])), abs=1e-4)


def test_a_block_slides_on_a_link_and_a_pin_becomes_its_pin():
    page = crank()
    page.draw('ground', (0.0, -0.08, ''))
    page.draw('link', (0.0, -0.08, 'ground.p2'), (0.06, 0.16, ''))
    page.draw('link', (0.03, 0.04, 'link_1.end'), (0.04, 0.08, 'link_2/'))
    before = page.text
    page.draw('slider', (0.04, 0.08, 'link_2_link_3'), (0.05, 0.12, 'link_2/'))
    given = documents.parse(page.text)
    assert 'link_2_link_3' not in given['joints']
    assert given['joints']['link_2_slider_1']['prismatic'][1] == 'slider_1'
    assert given['joints']['link_3_slider_1'] == {'revolute': ['link_3.end', 'slider_1']}
    assert page.state['problem'] == ''
    page.ask('undo')
    assert page.text == before
    page = Page()
    page.draw('ground', (0.0, 0.0, ''))
    page.draw('link', (0.0, 0.0, 'ground.p1'), (0.1, 0.0, ''))
    page.draw('guide', (0.05, 0.0, 'link_1/'), (0.05, 0.04, ''))
    given = documents.parse(page.text)
    assert given['joints']['link_1_slider_1'] == {
        'prismatic': ['link_1.p1', 'slider_1'], 'axis': '90 deg',
    }  # fmt: skip
    assert given['guess']['slider_1'] == '40 mm'
    # two free motions: whatever point is pulled goes where it can
    page.ask('pull', handle='slider_1.start', x=0.0, y=0.09, step=1e-3)
    (x, y, angle), (u, v, _) = page.heard[-1]['poses']
    assert (u, v) == pytest.approx((0.0, 0.09), abs=1e-5)
    assert (x, y) == (0.0, 0.0)
    along = math.cos(angle) * u + math.sin(angle) * v
    assert along == pytest.approx(0.05, abs=1e-9)  # it stays on its rail


@pytest.mark.slow
def test_forces_and_sensors_are_put_on_links_and_leave_with_them():
    page = four_bar()
    page.draw('force', (0.075, 0.11, 'link_2.p1'), (0.075, 0.061, ''))
    page.draw('torque', (0.2, 0.0, 'ground_link_3'), (0.2, -0.123, ''))
    page.draw('accelerometer', (0.075, 0.11, 'link_2.p1'))
    page.draw('load_cell', (0.15, 0.17, 'link_2_link_3'))
    page.draw('probe', (0.15, 0.17, 'link_2_link_3'))
    page.draw('encoder', (0.2, 0.0, 'ground_link_3'))
    given = documents.parse(page.text)
    assert given['loads'] == {
        'force_1': {'at': 'link_2.p1', 'force': ['0 N', '-49 N']},
        'torque_1': {'at': 'link_3', 'torque': '-1.2 N m'},
    }
    assert given['sensors'] == {
        'accelerometer_1': {'link': 'link_2', 'at': 'link_2.p1'},
        'load_cell_1': {'kind': 'load_cell', 'joint': 'link_2_link_3'},
        'probe_1': {'kind': 'displacement_probe', 'joint': 'link_2_link_3'},
        'encoder_1': {'kind': 'encoder', 'link': 'link_3'},
    }
    assert given['joints']['link_2_link_3']['clearance']['radial'] == '0.1 mm'
    assert page.said == []
    assert page.state['problem'] == ''
    signs = {'.'.join(mark['path']): mark for mark in page.state['marks']}
    assert signs['loads.force_1']['arrow'] == [0.0, pytest.approx(-0.049)]
    assert signs['sensors.accelerometer_1']['at'] == pytest.approx([0.096, 0.0])
    assert len(signs) == 6
    drawn = page.text
    page.ask('rename', path=['joints', 'link_2_link_3'], name='pin')
    assert documents.parse(page.text)['sensors']['load_cell_1']['joint'] == 'pin'
    page.ask('undo')
    page.ask('remove', path=['links', 'link_3'])
    given = documents.parse(page.text)
    assert set(given['loads']) == {'force_1'}
    assert set(given['sensors']) == {'accelerometer_1'}
    page.ask('undo')
    assert page.text == drawn
    page = Page('gear_pair')
    page.ask('remove', path=['joints', 'mesh'])
    assert 'gears' not in documents.parse(page.text)
    page.ask('undo')
    page.ask('rename', path=['links', 'wheel'], name='disc')  # whose gear is a wheel, too
    assert page.state['problem'] == ''
    assert documents.parse(page.text)['joints']['mesh'] == {'mesh': ['pinion', 'wheel']}


@pytest.mark.parametrize(('name', 'key', 'far'), [
    ('gear_pair', 'wheel_shaft', (0.013, 0.02)), ('planetary', 'planet_pin', (0.01, 0.0)),
    ('geneva', 'ground_wheel', (0.02, 0.01)), ('linear_intermittent', 'crank.end', (0.01, 0.0)),
    ('rack_and_pinion', 'pinion_shaft', (0.0, 0.01)),
])  # fmt: skip
def test_what_must_fit_is_fitted_while_it_is_dragged(name, key, far):
    page = Page(name)
    x, y = page.at(key)
    to = x + far[0], y + far[1]
    page.ask('drag', handle=key, x=to[0], y=to[1], step=1e-3)
    assert page.heard[-1]['problem'] == ''
    page.drop(key, *to)
    assert page.state['problem'] == ''
    assert page.said == []
    Machine(name, page.session.document.scene()).assembly  # noqa: B018 - raises if it does not fit


def test_forces_that_follow_a_drag_are_those_of_newtons_law():
    page = Page('four_bar_nominal')
    page.session.pause()
    told = page.heard[-1]
    assert told['type'] == 'forces'
    x, y = page.at('coupler_rocker')
    page.ask('drag', handle='coupler_rocker', x=x + 0.01, y=y - 0.02, step=1e-3)
    frame, turn = page.heard[-1], page.session._picture.turn
    assert turn is not None
    forces, tree = turn.forces(), turn.mechanism
    assert forces is not None
    names = [joint['name'] for joint in forces.joints]
    assert frame['forces']['forces'][0] == [
        pytest.approx(f, rel=1e-3) for f in forces.forces[0].tolist()
    ]
    # of a link over a turn at constant speed: m a = F, by Fourier's series of its mass centre
    speed = turn.machine.plan.laws['crank'][0].coefficients[1]
    count = INSTANTS - 1
    order = np.fft.fftfreq(count, 1.0 / count)
    for link, ends in (('coupler', ('crank_coupler', 'coupler_rocker')),
                       ('rocker', ('coupler_rocker', 'rocker_ground'))):  # fmt: skip
        body = tree.body(link)
        at = tree.locate_all(link, turn.q, body.cog)[:, :-1]
        second = np.fft.ifft(-((speed * order) ** 2) * np.fft.fft(at)).real
        found = -body.mass * np.array(turn.machine.scene.gravity)[:, None] * np.ones(count)
        for name in ends:
            sign = 1.0 if tree.joint(name).second == link else -1.0
            found = found - sign * forces.forces[:-1, names.index(name)].T
        assert np.abs(found + body.mass * second).max() < 1e-6 * np.abs(forces.forces).max()


@pytest.mark.slow
@pytest.mark.parametrize('what', ['gears', 'rack', 'cam', 'belt', 'bevel', 'worm', 'ratio'])
@pytest.mark.parametrize('to', [(0.13, 0.07), (-0.031, 0.02), (0.0, -2.6), (0.003, 0.001)])
def test_a_pair_drawn_anywhere_runs_at_once(what, to):
    page = Page()
    step = 10.0 ** math.floor(math.log10(math.hypot(*to) / 60.0))
    page.draw(what, (0.0, 0.0, ''), (*to, ''), step=step)
    assert page.said == []
    machine = ms.scene.build.build('x', page.session.document.scene())
    assert ms.simulate(machine).duration == pytest.approx(1.0)


def test_clearance_comes_with_masses_and_goes_again():
    page = four_bar()
    before = page.text
    page.draw('clearance', (0.15, 0.17, 'link_2_link_3'))
    given = documents.parse(page.text)
    assert given['joints']['link_2_link_3']['clearance'] == {
        'radial': '0.1 mm',
        'restitution': 0.5,
    }
    assert all(given['links'][link]['mass'] for link in ('link_1', 'link_2', 'link_3'))
    ms.scene.build.build('x', page.session.document.scene())
    page.ask('undo')
    assert page.text == before


def test_a_slider_and_a_spring():
    page = Page()
    page.draw('ground', (0.0, 0.0, ''))
    page.draw('link', (0.0, 0.0, 'ground.p1'), (0.03, 0.04, ''))
    page.draw('link', (0.03, 0.04, 'link_1.end'), (0.15, 0.0, ''))
    page.draw('slider', (0.15, 0.0, 'link_2.end'), (0.3, 0.001, ''))
    page.draw('drive', (0.01, 0.01, 'link_1/'))
    assert page.said == []
    assert page.state['problem'] == ''
    assert documents.parse(page.text)['joints']['ground_slider_1'] == {
        'prismatic': ['ground', 'slider_1']
    }
    page.draw('spring', (0.25, 0.0, ''), (0.15, 0.0, 'link_2_slider_1'))
    spring = documents.parse(page.text)['springs']['spring_1']
    assert spring['between'] == ['ground.p2', 'slider_1']
    assert spring['free_length'] == '100 mm'
    assert page.said == []
    assert page.state['problem'] == ''


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ('what', 'at', 'path', 'given'),
    [
        ('motor', [(0.0, 0.025, 'link_1/')], 'drive.motor.ratio', 25),
        ('elastic', [(0.075, 0.11, 'link_2/')], 'links.link_2.elastic.material', 'steel'),
        ('frame', [(0.1, -0.1, '')], 'oscillators.frame.mounts.left.at', ['0 mm', '-100 mm']),
        ('stops', [(0.2, 0.0, 'ground_link_3')], 'joints.ground_link_3.stops.lower', '76.4 deg'),
        ('gas_spring', [(0.2, 0.1, ''), (0.15, 0.17, 'link_2_link_3')],
         'springs.gas_spring_1.gas.force', '100 N'),
        ('bump_stop', [(0.2, 0.1, ''), (0.15, 0.17, 'link_2_link_3')],
         'springs.bump_stop_1.acts', 'below'),
    ],
)  # fmt: skip
def test_motors_and_what_gives_way_or_stops_are_drawn_on_a_machine(what, at, path, given):
    page = four_bar()
    page.draw(what, *at)
    assert page.said == []
    assert page.state['problem'] == ''
    found = documents.parse(page.text)
    for key in path.split('.'):
        found = found[key]
    assert found == given
    ms.scene.build.build('x', page.session.document.scene())
    again = page.text
    page.draw(what, *at)  # springs may be many; a second one of the others is refused
    assert page.said or what in ('motor', 'gas_spring', 'bump_stop')
    if page.said:
        assert page.text == again


@pytest.mark.slow
def test_a_cam_on_a_block_slides_and_lifts_on_both_sides_of_where_it_is_drawn():
    page = Page()
    page.draw('ground', (0.0, 0.0, ''))
    page.draw('link', (0.0, 0.0, 'ground.p1'), (0.0, 0.05, ''))
    page.draw('link', (0.0, 0.05, 'link_1.end'), (0.2, 0.0, ''))
    page.draw('slider', (0.2, 0.0, 'link_2.end'), (0.3, 0.0, ''))
    page.draw('drive', (0.0, 0.02, 'link_1/'))
    page.draw('cam', (0.2, 0.0, 'slider_1/'), (0.2, 0.02, ''))
    assert page.said == []
    machine = ms.scene.build.build('x', page.session.document.scene())
    lift = ms.simulate(machine).sample(np.linspace(0.0, 1.0, 401), 'position.follower_1')[
        'position.follower_1'
    ]
    assert lift[0] == pytest.approx(0.02, abs=1e-12)
    assert lift.min() == pytest.approx(0.02, abs=1e-9)
    assert lift.max() == pytest.approx(0.028, abs=1e-9)


@pytest.mark.slow
def test_a_pin_wears_beside_the_run_that_is_drawn():
    """Figures of the worn machine are those of the scene with that clearance; the text stays."""
    page = Page('four_bar_nominal')
    before = page.text
    page.ask('wear', joint='ground', radial=1e-4)
    assert 'ground does not wear' in page.said[-1]
    page.ask('wear', joint='coupler_rocker', radial=3e-4)
    assert page.text == before
    assert page.state['wears'] == dict.fromkeys(
        ('ground_crank', 'crank_coupler', 'coupler_rocker', 'rocker_ground')
    )
    job = page.session.job()
    assert job is not None
    assert job.worn is not None
    found: queue.Queue[tuple[int, str, str]] = queue.Queue()
    runs = Background(lambda *x: found.put(x))
    try:
        runs.submit(job)
        while (news := found.get(timeout=120.0))[1] != 'worn':
            assert news[1] in ('checked', 'run', 'progress')
    finally:
        runs.close()
    worn = strict_json.loads(news[2])
    play = {'joints.coupler_rocker.clearance': {'radial': '0.3 mm', 'restitution': 0.5}}
    run = ms.simulate(load_scene('four_bar_nominal', play))
    assert (worn['joint'], worn['radial']) == ('coupler_rocker', 3e-4)
    assert ['impacts', '', len(run.impacts), '', None] in worn['figures']
    page.ask('wear', joint='coupler_rocker', radial=0.0)
    assert page.session.job().worn is None


def test_a_part_goes_with_what_cannot_be_without_it():
    page = four_bar()
    page.ask('remove', path=['links', 'link_3'])
    given = documents.parse(page.text)
    assert set(given['joints']) == {'ground_link_1', 'link_1_link_2'}
    assert given['guess'] == {'link_2': '38.7 deg'}
    page.ask('rename', path=['links', 'link_1'], name='crank')
    given = documents.parse(page.text)
    assert given['joints']['link_1_link_2']['revolute'] == ['crank.end', 'link_2']
    assert given['drive']['coordinate'] == 'crank'
    assert page.said == []


def test_no_link_gets_a_name_that_formulas_know_otherwise():
    page = four_bar()
    before = page.text
    for name in RESERVED:
        page.ask('rename', path=['links', 'link_1'], name=name)
        assert f"the name '{name}' cannot be used" in page.said[-1]
        assert page.text == before


def test_a_four_bar_in_short_is_written_out_for_what_it_cannot_say():
    page = Page('four_bar_clearance')
    digest = ms.simulate(load_scene('four_bar_clearance'), revolutions=0.2).digest()
    page.draw('ground', (0.5, 0.5, ''))
    given = documents.parse(page.text)
    assert given['mechanism'] == 'linkage'
    assert '# The mechanism of' in page.text
    assert given['joints']['coupler_rocker']['clearance']['radial'] == '0.254 mm'
    machine = ms.scene.build.build('four_bar_clearance', page.session.document.scene())
    assert ms.simulate(machine, revolutions=0.2).digest() == digest


@pytest.mark.parametrize(
    ('path', 'text', 'part'),
    [('links.crank.length', '-5 mm', 'more than 0'), ('links.crank.mass', '3 mm', 'mm'),
     ('joints.coupler_rocker.clearance.restitution', '2', 'at most 1'),
     ('drive.sped', '3', "did you mean 'speed'"), ('links.coupler.length', '2 m', 'shorter'),
     ('gravity', '[1, 2', 'not valid YAML')],
)  # fmt: skip
def test_what_is_wrong_is_said_by_the_sentence_of_check_in_its_place(
    path, text, part, capsys, tmp_path
):
    page = Page('four_bar_clearance')
    page.set(path, text)
    problem = page.state['problem'] or page.said[-1]
    assert part in problem
    if page.state['problem']:
        file = tmp_path / 'four_bar_clearance.yaml'
        file.write_text(page.text)
        assert ended('check', str(file)) == 2
        said = capsys.readouterr().err.strip().split(': ', 2)[2]
        assert problem.split(': ', 1)[1] == said
        if 'assembled' not in problem:
            assert page.state['place'] == path.split('.')
    else:
        assert page.text == Page('four_bar_clearance').text


def test_undo_and_redo_come_back_to_the_byte():
    rng, page = random.Random(5), Page('loader')
    texts = [page.text]
    for _ in range(14):
        handle = rng.choice(page.state['handles'])
        x, y = handle['at']
        kind = rng.choice(['drop', 'remove', 'set', 'draw'])
        if kind == 'drop':
            page.drop(handle['key'], x + rng.gauss(0, 0.1), y + rng.gauss(0, 0.1), 0.01)
        elif kind == 'remove':
            page.ask('remove', path=rng.choice(rng.choice(page.state['outline'])['parts']))
            if len(page.state['handles']) < 4:
                page.ask('undo')
                continue
        elif kind == 'set':
            page.set('gravity', f'[0, {rng.randint(-9, 9)} m/s^2]')
        else:
            page.draw('link', (x, y, handle['key']), (x + 1.0, y, ''), step=0.01)
        if page.text != texts[-1]:
            texts.append(page.text)
    assert len(texts) > 6
    for text in reversed(texts[:-1]):
        page.ask('undo')
        assert page.text == text
    for text in texts[1:]:
        page.ask('redo')
        assert page.text == text


@pytest.mark.parametrize('part', ['crank', 'rocker'])
def test_a_link_of_a_four_bar_in_short_gets_another_name(part):
    """The scene is written out for it, in one step that can be undone."""
    page = Page('four_bar_double_crank')
    before = page.text
    page.ask('rename', path=['links', part], name='arm')
    assert page.state['assembled']
    assert page.state['problem'] == ''
    assert 'mechanism: linkage' in page.text
    assert 'arm: {length' in page.text
    page.ask('undo')
    assert page.text == before


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', scene_names())
def test_whatever_is_done_to_a_scene_it_stays_one_that_can_be_undone(name):
    rng, page = random.Random(name), Page(name)
    before = page.text
    for k in range(10):
        handles, parts = (
            page.state['handles'],
            [p for o in page.state['outline'] for p in o['parts']],
        )
        if not parts:
            break
        left, _, right, _ = page.state['stage']['bounds']
        size = right - left
        step = 10.0 ** math.floor(math.log10(size / 500.0))
        if rng.random() < 0.4 and handles:
            handle = rng.choice(handles)
            x, y = (v + rng.gauss(0.0, 0.1 * size) for v in handle['at'])
            page.ask('drag', handle=handle['key'], x=x, y=y, step=step)
            page.drop(handle['key'], x, y, step)
        elif rng.random() < 0.6:
            page.draw(rng.choice(TOOLS), page.spot(rng), page.spot(rng), step=step)
        elif rng.random() < 0.5:
            page.ask('remove', path=rng.choice(parts))
        else:
            page.ask('rename', path=rng.choice(parts), name=f'other_{k}')
        for path in ([], rng.choice(parts)):
            page.ask('select', path=path)
            assert page.state['rows'] or path not in [
                p for o in page.state['outline'] for p in o['parts']
            ]
        assert isinstance(documents.parse(page.text), dict)
        assert 'that is not a command of this page' not in page.said
        assert all(strict_json.dumps(m) for m in page.heard)
        page.heard.clear()
    while page.state['undo']:
        page.ask('undo')
    assert page.text == before


def test_files_are_not_lost(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = Page('loader')
    page.ask('save', name='')
    assert Path('loader.yaml').read_bytes() == (config_folder() / 'loader.yaml').read_bytes()
    Path('other.yaml').write_text('mine')
    for name in ('other', '../out', '/tmp/out.yaml', '.hidden'):
        page.ask('save', name=name)
        assert 'saved' not in page.said[-1]
    assert Path('other.yaml').read_text() == 'mine'
    Path('loader.yaml').write_text('changed: 1\n')
    page.set('duration', '0.5 s')
    page.ask('save', name='loader.yaml')
    assert 'changed by another program' in page.said[-1]
    page.ask('save', name='mine')
    assert load_scene('mine.yaml').scene.duration == 0.5
    assert not page.state['changed']
    assert page.state['name'] == 'mine'
    own = Page('mine.yaml')
    own.set('duration', '0.6 s')
    own.ask('save', name='mine.yaml')
    assert load_scene('mine.yaml').scene.duration == 0.6


def test_strange_commands_do_no_harm():
    page = Page('four_bar_nominal')
    before = page.text
    for message in ({}, {'type': 'drag'}, {'type': 'set', 'path': 3, 'text': ''},
                    {'type': 'drop', 'handle': 'x', 'x': 0, 'y': 0, 'step': 1},
                    {'type': 'drop', 'handle': 'crank_coupler', 'x': 0, 'y': 0, 'step': 0},
                    {'type': 'drop', 'handle': 'crank_coupler', 'x': 'nan', 'y': 0, 'step': 1e-3},
                    {'type': 'open', 'name': '../x'}, {'type': 'draw', 'what': 'x'},
                    {'type': 'rename', 'path': ['links'], 'name': 'x'}):  # fmt: skip
        page.session.handle(message)
        assert page.text == before
    assert page.state['problem'] == ''


def test_a_length_is_rounded_to_what_can_be_seen():
    assert rounded(0.06437, 1e-3, 'mm') == '64 mm'
    assert rounded(0.06437, 1e-4, 'mm') == '64.4 mm'
    assert rounded(2.80449, 1e-2, 'm') == '2.8 m'
    assert rounded(-1e-9, 1e-3, 'mm') == '0 mm'
    assert rounded(1500.0, 10.0, 'm') == '1500 m'


@pytest.mark.slow
def test_runs_are_those_of_solve_and_the_newest_wins():
    found: queue.Queue[tuple[int, str, str]] = queue.Queue()
    runs = Background(lambda *x: found.put(x))
    page = Page('four_bar_nominal')
    try:
        for number, name in ((1, 'four_bar_clearance'), (2, 'four_bar_nominal')):
            job = Page(name).session.job()
            assert job is not None
            runs.submit(job._replace(number=number))
        kinds = []
        while (news := found.get(timeout=120.0))[:2] != (2, 'run'):
            kinds.append(news[:2])
        assert (1, 'run') not in kinds
        assert (2, 'checked') in kinds
        data = strict_json.loads(news[2])
        assert data['digest'] == ms.simulate(load_scene('four_bar_nominal')).digest()
        assert data['figures'][0][0] == 'force'
        page.set('links.rocker.length', '5 m')
        job = page.session.job()
        assert job is not None
        runs.submit(job._replace(number=3))
        number, kind, text = found.get(timeout=60.0)
        assert (number, kind) == (3, 'problem')
        assert 'cannot be assembled' in text
    finally:
        runs.close()


def test_bad_input_and_a_taken_port_are_one_sentence(capsys):
    import socket  # noqa: PLC0415

    with socket.create_server(('127.0.0.1', 0)) as taken:
        port = taken.getsockname()[1]
        for args in (['no_such_scene'], ['loader', '--port', str(port)], ['--port', '70000']):
            assert ended('edit', *args) == 2
            assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_yaml_of_a_scene_is_read_by_others():
    assert yaml.safe_load(four_bar().text)['drive']['speed'] == '60 rpm'


def test_a_link_drawn_anywhere_stays_there_until_it_is_held():
    page = Page()
    page.draw('link', (0.1, 0.05, ''), (0.15, 0.09, ''))
    page.draw('link', (0.3, 0.05, ''), (0.25, 0.19, ''))
    assert page.at('link_1.start') == pytest.approx((0.1, 0.05), abs=1e-9)
    assert page.at('link_2.end') == pytest.approx((0.25, 0.19), abs=1e-3)
    page.draw('link', (0.15, 0.09, 'link_1.end'), (0.25, 0.19, 'link_2.end'))
    before = {key: page.at(key) for key in ('link_1.start', 'link_1_link_3', 'link_2.start')}
    page.drop('link_1.start', 0.12, 0.03)
    assert page.at('link_1.start') == pytest.approx((0.12, 0.03))
    page.ask('rename', path=['links', 'link_3'], name='rod')
    assert page.at('link_1.start') == pytest.approx((0.12, 0.03))
    page.ask('undo')
    page.ask('undo')
    for key, place in before.items():
        assert page.at(key) == pytest.approx(place)
    # pivots come after: the four-bar is assembled where it was drawn
    page.draw('ground', (0.1, 0.05, 'link_1.start'))
    page.draw('ground', (0.3, 0.05, 'link_2.start'))
    assert page.state['assembled']
    assert page.at('ground_link_1') == pytest.approx((0.1, 0.05))
    assert page.at('link_1_link_3') == pytest.approx((0.15, 0.09), abs=1e-3)
    assert page.said == []


def test_the_next_step_of_a_machine_that_is_begun_is_a_hint():
    page = Page()
    assert page.state['hint'].startswith('Draw a link')
    page.draw('link', (0.1, 0.05, ''), (0.15, 0.09, ''))
    assert 'link_1 is not joined to the frame yet' in page.state['hint']
    page.draw('ground', (0.1, 0.05, 'link_1.start'))
    assert page.state['hint'] == page.state['problem'] == ''
    page.set('links.link_1.length', '-5 mm')  # that is wrong, and no step
    assert page.state['problem']
    assert page.state['hint'] == ''


def test_a_chart_over_the_turn_follows_the_drag():
    """By finite differences of the angles, and by the closed form of a slider-crank."""
    page = Page('slider_crank')
    known = page.state['quantities']
    assert {'piston: displacement', 'piston: acceleration', 'rod: angle'} <= {*known}
    page.ask('chart', quantity='piston: displacement')
    chart = page.state['chart']
    x = np.radians(chart['at'])
    machine = Machine('slider_crank', page.session.document.scene())
    crank, rod = (machine.plan.points[link]['end'][0] for link in ('crank', 'rod'))
    wanted = crank * np.cos(x) + np.sqrt(rod**2 - (crank * np.sin(x)) ** 2)
    np.testing.assert_allclose(chart['values'], 1e3 * wanted, rtol=1e-9)
    page.ask('chart', quantity='piston: velocity')
    rate = np.gradient(1e-3 * np.array(chart['values']), x) * machine.drive.start[1]
    fine = slice(1, -1)
    np.testing.assert_allclose(page.state['chart']['values'][fine], rate[fine], atol=2e-2)
    page.ask('chart', quantity='piston: displacement')
    page.ask('drag', handle='crank_rod', x=1.2 * crank, y=0.0, step=1e-3)
    longer = page.heard[-1]['chart']
    assert page.heard[-1]['type'] == 'frame'
    assert np.ptp(longer['values']) == pytest.approx(2.4e3 * crank, rel=1e-3)
    page.ask('chart', quantity='nothing')
    assert page.state['chart'] is None


def test_a_chart_of_a_micromachine_is_in_micrometres():
    page = Page()
    sides = {'ground': '3.87 um', 'coupler': '3.09 um', 'rocker': '3.12 um'}
    links = ', '.join(f'{name}: {{length: {size}}}' for name, size in sides.items())
    links += ', crank: {length: 0.64 um, points: {tip: [0.64 um, 0]}}'
    text = f'mechanism: four_bar\nlinks: {{{links}}}\ndrive: {{speed: 60 rpm}}\n'
    page.ask('text', text=text)
    page.ask('chart', quantity='crank.tip: x')
    chart = page.state['chart']
    assert chart['unit'] == 'µm'
    assert np.ptp(chart['values']) == pytest.approx(1.28, rel=1e-3)


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', scene_names())
def test_every_quantity_that_is_offered_can_be_charted(name):
    page = Page(name)
    for quantity in page.state['quantities']:
        page.ask('chart', quantity=quantity)
        chart = page.state['chart']
        assert len(chart['at']) == len(chart['values']) == INSTANTS
        assert np.isfinite(chart['values']).all()


def test_colours_stay_with_their_links():
    page = Page('four_bar_coupler_curve')
    before = page.state['stage']['colours']
    page.ask('remove', path=['links', 'crank'])
    left = page.state['stage']['colours']
    assert left == {link: before[link] for link in ('coupler', 'rocker')}
    page.ask('rename', path=['links', 'rocker'], name='arm')
    assert page.state['stage']['colours'] == {
        'coupler': before['coupler'],
        'arm': before['rocker'],
    }
    page.draw('link', (0.0, 0.0, ''), (0.1, 0.0, ''))
    assert page.state['stage']['colours']['link_1'] == before['crank']
    assert all(
        shape['colour'] == page.state['stage']['colours'].get(shape['link'], -1)
        for shape in page.state['stage']['shapes']
    )


def test_a_file_that_is_dropped_on_the_page_is_opened():
    page = Page()
    text = to_urdf(load_scene('four_bar_nominal'))
    page.ask('import', name='../machine_1.urdf', text=text)
    assert (page.state['name'], page.state['file']) == ('machine_1', 'machine_1.yaml')
    assert page.state['assembled']
    page.ask('import', name='mine.yaml', text=DRAWN_FOUR_BAR)
    assert page.text == DRAWN_FOUR_BAR
    for name, content, words in (
        ('a.docx', 'x', "'a.docx' is not a machine"),
        ('', '', 'is not a machine'),
        ('b.yaml', 'a: [', 'b.yaml'),
        ('c.csv', 'name,type,x,y', 'c.csv'),
    ):
        page.ask('import', name=name, text=content)
        assert words in page.said[-1]
        assert page.text == DRAWN_FOUR_BAR


@pytest.mark.slow
def test_a_page_that_is_made_names_its_scene_as_one_types_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    document, said = Document.open('slider_crank'), queue.SimpleQueue()
    document.save('my crank.yaml')
    files = FilesBeside(said.put)
    assert files.takes({'type': 'make', 'what': 'page with sliders'}, document)
    assert 'being written' in said.get()
    assert said.get() == f'saved: {tmp_path.resolve() / "my crank_sliders.html"}'
    page = html.unescape(Path('my crank_sliders.html').read_text())
    assert "<code>mechanism-sim report 'my crank.yaml'</code>" in page


@pytest.mark.slow
def test_a_table_that_is_made_finds_the_points_of_its_measures(tmp_path, monkeypatch):
    """They are in the folder where the editor runs, not beside the scene that is handed on."""
    monkeypatch.chdir(tmp_path)
    Path('points.csv').write_text('x [mm],y [mm]\n60,60\n70,70\n')
    document, said = Document.open('slider_crank'), queue.SimpleQueue()
    measures = {'away': 'distance(position.rod.end, points.csv)'}
    document.change([Edit(('measures',), measures)])
    document.save('measured.yaml')
    assert FilesBeside(said.put).takes({'type': 'make', 'what': 'CSV of a turn'}, document)
    assert 'being written' in said.get()
    assert said.get() == f'saved: {tmp_path.resolve() / "measured.csv"}'
