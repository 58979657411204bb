"""Scenes: whatever is wrong is refused in one sentence that helps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from builders import PLAY, digest_of, read_scene
from four_bars import RADIAL, RESTITUTION, SPEED

import mechanism_sim as ms
from mechanism_sim import strict_json
from mechanism_sim.catalogue import config_folder
from mechanism_sim.errors import InputError
from mechanism_sim.scene import Level, Machine, span
from mechanism_sim.scene.check import check, render
from mechanism_sim.scene.files import check_scene
from mechanism_sim.scene.motion_notes import mobility_notes
from mechanism_sim.studies.parameters import parameters

LOOSE, FILE = 'four_bar_clearance', 'four_bar_clearance.yaml'


def refusal(overrides, scene=LOOSE):
    with pytest.raises(InputError) as caught:
        ms.load_scene(scene, overrides)
    text = str(caught.value)
    assert '\n' not in text
    assert 'pydantic' not in text.lower()
    assert text.startswith(scene)
    return text


@pytest.mark.parametrize(
    ('key', 'value', 'said'),
    [
        # unknown keys at every level, with the nearest known one
        ('drvie.speed', 1, ["key 'drvie'", "did you mean 'drive'?", 'allowed here: title']),
        ('links.crnak.length', 1, ["'links.crnak'", "'crank'?", 'ground, crank, coupler, rocker']),
        ('links.crank.lenght', 1, ["'links.crank.lenght'", "'length'?", 'mass, inertia, cog']),
        ('links.ground.mass', 1, ["unknown key 'links.ground.mass'", 'allowed here: length']),
        ('joints.coupler_roker.clearance', None, ["'joints.coupler_roker'", "'coupler_rocker'?"]),
        ('joints.coupler_rocker.clearance.radail', 1, ["'radial'?", 'radial, restitution']),
        ('initial.position.crnk', 1, ["'crank'?", 'crank, coupler, rocker']),
        ('initial.velocity.crank', 1, ['initial.velocity.crank is 1', 'leave one']),
        ('sensors.rocker_accelerometer.smaple_rate', 1, ["'sample_rate'?", 'kind, link, at, ']),
        ('sensors.mine.axes', 'along', ["unknown key 'sensors.mine.axes'", "'axis'?"]),
        ('outputs.force', True, ["'forces'?"]),
        ('solver.tol', 1e-9, ["unknown key 'solver.tol'", "'rtol'?"]),
        # quantities
        ('drive.speed', '350 rpq', ["unknown unit 'rpq'", "write for example '350 rpm'"]),
        ('drive.speed', '350 mm', ["'350 mm'", "which is not a unit of 'rad/s'"]),
        ('drive.speed', '350 Hz', ["which is not a unit of 'rad/s'"]),
        ('drive.speed', '600 s-1', ['is in s, not in rad/s or m/s; a power of a unit', "'s^-1'"]),
        ('sensors.rocker_accelerometer.noise.rms', '0.1 gn',
         ["unknown unit 'gn': write for example '9.81 m/s^2' or "]),
        ('drive.start_angle', '3.6e15 deg', ['rounded by 0.004 rad: take off whole turns']),
        ('initial.position.rocker', '-1e9 deg', ['rounded by 2e-09 rad: take off whole turns']),
        ('drive.speed', 'fast', ["drive.speed = 'fast' is not a number with a unit"]),
        ('drive.speed', None, ["'drive.speed' is missing"]),
        ('drive.speed', True, ['drive.speed = true is not a quantity']),
        ('drive.speed', float('nan'), ['drive.speed = nan', 'must be finite']),
        ('links.coupler.inertia', '2950 kg', ["which is not a unit of 'kg m^2'"]),
        ('links.crank.length', '60 g', ['links.crank.length', "write for example '64 mm'"]),
        ('gravity', ['0', '9 m/s'], ["gravity.1 = '9 m/s'", "not a unit of 'm/s^2'"]),
        ('gravity', '9.81 m/s^2', ['gravity', 'a list of two quantities']),
        ('gravity', [0, 0, 0], ['gravity', 'a list of two quantities']),
        (RESTITUTION, '0.5 mm', ["'mm' where a plain number belongs"]),
        # bounds
        (RESTITUTION, 1.5, ['1.5 is out of bounds', 'at most 1']),
        (RESTITUTION, -0.1, ['out of bounds', 'at least 0']),
        (RESTITUTION, float('nan'), ['out of bounds']),
        (RADIAL, '0 mm', ['out of bounds', 'more than 0', "'clearance: null'"]),
        ('links.crank.mass', '-1 kg', ["'-1 kg' is out of bounds", 'at least 0']),
        ('links.rocker.inertia', -1, ['links.rocker.inertia = -1 is out of bounds']),
        ('solver.rtol', 0.5, ['out of bounds', 'at most 0.0001']),
        ('solver.rtol', float('nan'), ['solver.rtol']),
        ('solver.atol', '-1 mm', ['solver.atol', 'at least 0']),
        ('outputs.joint_states', '0 Hz', ['more than 0']),
        # choices
        ('start', 'seeted', ["start = 'seeted' is not possible", "'seated'?"]),
        ('branch', 'upper', ["'open' or 'crossed'"]),
        ('drive.coordinate', 'rocker', ["allowed: 'crank'"]),
        ('sensors.rocker_accelerometer.link', 'ground', ["link 'ground'", 'coupler, rocker']),
        ('mechanism', 'fuor_bar', ["is 'fuor_bar'", "'four_bar'?", 'known are: four_bar']),
        ('mechanism', ['four_bar'], ['known are: four_bar']),
        # shape
        ('links', 5, ['links = 5', 'a list of keys with values']),
        ('drive', 'fast', ["drive = 'fast'", 'a list of keys with values; allowed here: coord']),
        ('drive', '300 rpm', ['keys with values: write {speed: 300 rpm}; allowed here: coord']),
        ('drive.motor', {'curve': [['0 rpm', '6 N m'], ['9 rpm', '0 N m']]},
         ['with values, not of values alone: write {points: [...]}; allowed here: points']),
        (RADIAL.rpartition('.')[0], '0.1 mm', ['with values: write {radial: 0.1 mm}; allowed']),
        ('springs.s', {'between': ['crank', 'ground'], 'damping': {'points': [[0, 1], [1, 2]]}},
         ['springs.s.damping is neither', "a table under 'tables', and its name here"]),
        ('sensors', 5, ['sensors = 5', 'a list of names']),
        ('title', 5, ['title = 5', 'must be text']),
        ('outputs.forces', 'maybe', ['true or false']),
        ('drive.speed.x', 4, ["'drive.speed.x' cannot be set, because 'speed' is a plain value"]),
        ('gravity.2', 4, ["'2' is none of 0 to 1 of a list"]),
        # what is missing
        ('links.coupler', {'length': 0.25, 'mass': 1.0}, ["needs 'inertia' and 'cog' too"]),
        ('links.coupler.mass', None, ["links.coupler needs 'mass' too", 'mass, inertia and cog']),
        ('joints.coupler_rocker.clearance', {'radial': '1 mm'}, ["restitution' is missing"]),
        ('sensors.mine', {'at': 0}, ["'sensors.mine.link' is missing"]),
        # geometry
        ('links.crank.length', '2 m', ['cannot be assembled', 'crank (2 m)', '(1.008 m)']),
        (RADIAL, '1e-9 mm', ['clearance.radial = 1e-12 m', 'allows for 1.1e-11 m or more']),
        (RADIAL, '100 mm', ['larger than the shortest link (0.064 m)']),
        ('joints.crank_coupler.clearance', {'radial': 0.1, 'restitution': 0},
         ['joints.crank_coupler.clearance.radial', 'larger than the shortest link']),
        ('joints.coupler_rocker.clearance.friction', 'rogh', ['friction', 'is not a number']),
        ('joints.coupler_rocker.clearance.friction', -0.1, ['at least 0']),
        ('joints.coupler_rocker.clearance.friction', 50, ["'friction: rough'"]),
        ('joints.coupler_rocker.clearance.pin_radius', '5 mm', ['no effect without friction']),
        ('joints.coupler_rocker.clearance.hypothesis', 'poison', ["did you mean 'poisson'?"]),
        ('drive.profile', {'points': [['1 s', 0], ['1 s', 1]]}, ['drive.speed', 'exclude']),
        ('drive.torque', {'constant': '1 N'}, ['torque.constant', "not a unit of 'N m'"]),
        ('drive', {'profile': {'points': [['1 s', 0], ['1 s', 1]]}}, ['times must increase']),
        ('drive', {'torque': {}, 'motor': {'stall_torque': 1, 'no_load_speed': 9}}, ['exclude']),
        ('drive', {'speed': 1, 'motor': {'stall_torque': 1, 'no_load_speed': 0}}, ['not be zero']),
        ('sensors.rocker_accelerometer.at', '100 m', ['lies far off the rocker']),
        ('sensors.my sensor', {'link': 'rocker', 'at': 0}, ["'my sensor'", 'letters, digits']),
    ],
)  # fmt: skip
def test_bad_input_is_refused_with_the_key_the_value_and_what_is_allowed(key, value, said):
    text = refusal({key: value})
    for part in said:
        assert part in text, text


def test_friction_may_be_varied_from_zero_on():
    """With no friction the pin has no arm: the motion is the same to the last bit."""
    rubbing = {f'{PLAY}.friction': 0.0, f'{PLAY}.pin_radius': '6 mm', 'start': 'centred'}
    assert digest_of(LOOSE, rubbing, 0.02) == digest_of(LOOSE, {'start': 'centred'}, 0.02)


def test_a_pressed_start_at_a_change_point_is_refused():
    """There the forces that press pins on bushings are not determined; beside it they are."""
    lengths = {'ground': 0.3, 'crank': 0.1, 'coupler': 0.3, 'rocker': 0.1}
    parallelogram = {f'links.{k}.length': v for k, v in lengths.items()}
    machine = ms.load_scene(LOOSE, parallelogram | {'drive.start_angle': 0.0})
    with pytest.raises(InputError, match='the start is a singular position'):
        machine.initial_state()
    ms.load_scene(LOOSE, parallelogram | {'drive.start_angle': 0.5}).initial_state()


def test_a_start_with_the_pin_outside_of_its_bushing_is_refused():
    machine = ms.load_scene(LOOSE, {'initial.position.coupler': '1.2 rad'})
    with pytest.raises(InputError, match=r'initial.position puts the pin of coupler_rocker 0\.0'):
        ms.simulate(machine)


def test_a_seated_start_without_a_force_asks_for_another_start():
    machine = ms.load_scene(LOOSE, {'drive.speed': 0, 'gravity': [0, 0]})
    with pytest.raises(InputError, match=r"no force presses the pin.*write 'start: centred'"):
        ms.simulate(machine, duration=1.0)


def test_a_scene_without_a_title_has_the_name_of_its_file(tmp_path):
    content = ms.load_scene('pendulum').scene.to_document()
    del content['title']
    file = tmp_path / 'my_pendulum.yaml'
    file.write_text(yaml.safe_dump(content))
    assert ms.load_scene(str(file)).scene.title == 'My pendulum'
    assert ms.load_scene(content, name='swing').scene.title == 'Swing'
    for blank in (None, '', ' '):
        assert ms.load_scene(content | {'title': blank}, name='swing').scene.title == 'Swing'


@pytest.mark.parametrize(
    ('content', 'said'),
    [
        ('a:\n\t- b\n', 'line 2 is not valid YAML'),
        ('title: [1, 2\n', 'is not valid YAML'),
        ('- a\n- b\n', 'a scene is a list of keys with values'),
        ('', 'a scene is a list of keys with values'),
        ('title: x\n', "'mechanism' is missing"),
        ('mechanism: four_bar\n', "'links' is missing"),
        ('x: !!python/object:os.system 1\n', 'is not valid YAML'),
        (b'title: \xff\n', 'cannot be read'),
    ],
)
def test_unreadable_files_are_refused_by_name_and_line(tmp_path, content, said):
    path = tmp_path / 'mine.yaml'
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as caught:
        ms.load_scene(str(path))
    assert said in str(caught.value)
    assert 'mine.yaml' in str(caught.value)


@pytest.mark.parametrize(
    ('name', 'said'),
    [
        ('four_bar_clearence', "did you mean 'four_bar_clearance'?"),
        ('nothing.yaml', "there is no scene file 'nothing.yaml'"),
        ('', 'there is no scene'),
        ('/', 'there is no scene'),
        ('/dev/null', 'is not a regular file'),
        ('x' * 400, 'there is no scene'),
        ('a\0b', 'there is no scene'),
    ],
)
def test_scenes_that_do_not_exist_are_refused_with_the_nearest(name, said):
    with pytest.raises(InputError) as caught:
        ms.load_scene(name)
    assert said in str(caught.value)


@pytest.mark.parametrize('text', ['drive.speed', '=4', ' =4', 'drive.speed=[1', 'x=!!python/x 3'])
def test_malformed_override_texts_are_refused(text):
    with pytest.raises(InputError, match='override'):
        ms.load_scene(LOOSE, [text])


@pytest.mark.slow
def test_every_scene_written_out_is_read_again_as_it_was():
    """As studies, sweeps, bags and nodes do: by values, by JSON, and with a number changed."""
    for name in ms.scene_names():
        machine = Machine(*read_scene(name))
        content = machine.scene.to_document()
        assert check_scene(name, content) == machine.scene
        assert check_scene(name, strict_json.loads(strict_json.dumps(content))) == machine.scene
        limits = {'solver.rtol': ('1e-13', '1e-10')}
        (found,) = parameters(machine, ['solver.rtol'], '', limits=limits)
        assert (found.low, found.high) == (1e-13, 1e-10)


def test_parts_of_scenes_are_written_out_by_one_method():
    """`Part.to_document`: what pydantic dumps by itself has the names of fields, not the keys."""
    folder = Path(ms.__file__).parent
    dumping = {p.name for p in folder.rglob('*.py') if '.model_dump(' in p.read_text('utf-8')}
    assert dumping == {'quantities.py'}


@pytest.mark.parametrize(
    ('overrides', 'said'),
    [
        (['drive.speed=1 rpm', 'drive.speed=2 rpm'],
         "drive.speed is set twice, to '1 rpm' and to '2 rpm': keep one"),
        (['drive.speed=1 rpm', 'drive={}'],
         "setting 'drive' would undo that of 'drive.speed' before it"),
        ({'drive.speed': 1.0, 'drive': {}},
         "setting 'drive' would undo that of 'drive.speed' before it"),
    ],
)  # fmt: skip
def test_an_override_never_undoes_another_in_silence(overrides, said):
    assert said in refusal(overrides)


def test_overrides_that_agree_or_change_parts_of_others_are_taken():
    twice = ['drive={speed: 1 rad/s}', 'drive.speed=2 rad/s', 'drive.speed=2 rad/s']
    assert read_scene(LOOSE, twice)[1].drive.speed.value == 2.0


def test_overrides_as_texts_and_as_values_are_the_same():
    texts = ms.load_scene(
        LOOSE, ['drive.speed=300 rpm', f'{RESTITUTION}=0.1', 'gravity=[0, -9.8]']
    )
    values = ms.load_scene(
        LOOSE, {'drive.speed': '300 rpm', RESTITUTION: 0.1, 'gravity': [0, -9.8]}
    )
    assert texts.scene == values.scene
    assert texts.scene.drive.speed.value == pytest.approx(10.0 * np.pi, rel=1e-15)
    assert texts.scene.gravity == (0.0, -9.8)


def test_overrides_do_not_stick_to_the_scene():
    ms.load_scene(LOOSE, {'drive.speed': 1.0})
    assert ms.load_scene(LOOSE).scene.drive.speed.value == SPEED


def test_a_scene_of_ones_own_may_live_anywhere(tmp_path):
    text = (config_folder() / FILE).read_text(encoding='utf-8')
    (tmp_path / 'mine.yaml').write_text(text, encoding='utf-8')
    mine = ms.load_scene(str(tmp_path / 'mine.yaml'))
    assert mine.name == 'mine'
    assert mine.scene == ms.load_scene(LOOSE).scene


def test_the_thesis_table_arrives_exactly_in_si():
    s = ms.load_scene(LOOSE).scene
    lengths = [s.links[k].length for k in ('ground', 'crank', 'coupler', 'rocker')]
    assert lengths == [0.387, 0.064, 0.309, 0.312]
    assert [s.links['crank'].inertia, s.links['coupler'].inertia] == [0.002645, 0.00295]
    assert s.joints['coupler_rocker'].clearance.radial == 0.000254
    assert s.gravity == (0.0, -9.8145)


@pytest.mark.parametrize(
    ('scene', 'overrides', 'level'),
    [
        (LOOSE, {}, Level.NONSMOOTH),
        (LOOSE, {'joints.coupler_rocker.clearance': None}, Level.INVERSE_DYNAMICS),
        ('four_bar_nominal', {}, Level.INVERSE_DYNAMICS),
        ('four_bar_nominal', {'outputs.forces': False}, Level.KINEMATIC),
        ('four_bar_crossed', {}, Level.KINEMATIC),
    ],
)
def test_the_cheapest_level_that_is_exact_is_chosen(scene, overrides, level):
    assert ms.load_scene(scene, overrides).level is level


@pytest.mark.sample(8)
@pytest.mark.parametrize('name', ms.scene_names())
def test_every_scene_of_the_package_loads_checks_and_runs(name):
    machine = ms.load_scene(name)
    report = check(machine)
    assert report.title == machine.scene.title
    solution = ms.simulate(machine, duration=0.1 * span(machine, None, None))
    assert solution.level == report.level == machine.level.value
    assert set(report.coordinates) == {*machine.mechanism.coordinates}
    assert report.level in render(report)


def test_check_says_what_the_model_contains_and_what_it_leaves_out():
    loose = check(ms.load_scene(LOOSE))
    assert loose.relations == []
    assert 'radial clearance 0.000254 m' in loose.gaps[0]
    assert 'restitution 0.5' in loose.gaps[0]
    assert any('friction' in x for x in loose.left_out)
    assert any('rtol 1e-12' in x for x in loose.notes)
    ideal = check(ms.load_scene('four_bar_nominal', {'gravity': [0, 0]}))
    assert ideal.gaps == []
    assert 'closes a loop' in ideal.relations[0]
    assert any('gravity: it is zero' in x for x in ideal.left_out)
    assert any('0.17 m less' in x for x in ideal.notes)  # 309 + 312 - 64 - 387 mm


@pytest.mark.parametrize(
    ('keys', 'said'),
    [
        ({'instrument': 'iepe'}, ['passes 5000 Hz to 20000 Hz', 'iepe samples at 51.2 kHz']),
        ({'instrument': 'iepe', 'sample_rate': '51.2 kHz'}, []),
        ({'anti_alias': {'frequency': '8 kHz'}}, ['10000 Hz folds below 5000 Hz']),
        ({'anti_alias': {'frequency': '4 kHz'}}, []),
    ],
)
def test_check_notes_a_filter_that_lets_through_what_the_sample_rate_folds(keys, said):
    given = {f'sensors.rocker_accelerometer.{key}': value for key, value in keys.items()}
    notes = [x for x in check(ms.load_scene(LOOSE, given)).notes if 'folds' in x]
    assert len(notes) == bool(said)
    assert all(words in notes[0] for words in said)


def four_bar(ground, crank, coupler, rocker, start):
    lengths = {'ground': ground, 'crank': crank, 'coupler': coupler, 'rocker': rocker}
    overrides = {f'links.{link}.length': f'{x} mm' for link, x in lengths.items()}
    overrides |= {'drive.torque': {'constant': '0.1 N m'}, 'drive.start_angle': start}
    return ms.load_scene('four_bar_nominal', overrides)


def test_check_says_how_a_four_bar_moves():
    def notes(*lengths, start='120 deg'):
        return '\n'.join(check(four_bar(*lengths, start)).notes)

    crank_rocker = notes(387, 64, 309, 312)
    assert 'mobility: 1, as Kutzbach counts\n' in crank_rocker
    assert 'Grashof: crank-rocker' in crank_rocker
    assert 'transmission angle: 62.68 to 93.14 deg\n' in crank_rocker
    assert 'cannot turn' not in crank_rocker
    triple = notes(400, 100, 700, 300)  # [V] Figure 2.11
    assert 'triple-rocker' in triple
    assert 'the crank cannot turn fully: it stays between 82.8192 and 277.181 deg' in triple
    span = 'transmission angle: 0 to 38.21 deg over all that the crank can do'
    assert f'{span}; within 30 deg of 0 or 180' in triple
    double = notes(400, 500, 100, 600, start='80 deg')
    assert 'Grashof: double-rocker' in double
    assert ', or -' in double
    parallel = notes(400, 100, 400, 100)
    assert 'Grashof: change point, the sum of shortest and longest link is equal' in parallel
    assert 'all links lie in one line at 0 and 180 deg between crank' in parallel
    assert 'or jam with a loose joint' in parallel
    assert 'mobility: 1, as Kutzbach counts\n' in parallel


def test_check_tells_a_singular_position_from_more_freedom():
    parallel = four_bar(400, 100, 400, 100, '120 deg').plan.ideal
    assert next(mobility_notes(parallel, dict.fromkeys(parallel.coordinates, 0.0))) == (
        'mobility: 1, as Kutzbach counts; 2 at the start, which is a singular position; '
        '1 redundant among ground_crank, crank_coupler, coupler_rocker, rocker_ground'
    )


@pytest.mark.parametrize(
    ('span', 'said'),
    [
        ({'revolutions': 1, 'duration': 1}, 'either revolutions or a duration'),
        ({'duration': -1}, 'must be positive and finite, not -1'),
        ({'revolutions': 0}, 'must be positive and finite, not 0'),
        ({'duration': float('nan')}, 'duration = nan is not a number'),
        ({'duration': float('inf')}, 'must be positive and finite'),
    ],
)
def test_a_run_of_no_length_is_refused(span, said):
    with pytest.raises(InputError, match=said):
        ms.simulate(ms.load_scene('four_bar_crossed'), **span)


def test_revolutions_of_a_crank_at_rest_are_refused():
    with pytest.raises(InputError, match='give a duration in seconds'):
        ms.simulate(ms.load_scene(LOOSE, {'drive.speed': 0}), revolutions=1)


def test_a_run_lasts_a_revolution_by_default_and_as_long_as_asked():
    machine = ms.load_scene('four_bar_crossed')
    assert ms.simulate(machine).duration == pytest.approx(2.0 * np.pi, rel=1e-15)
    assert ms.simulate(machine, duration=0.3).duration == 0.3
    assert ms.simulate(machine, revolutions=0.5).duration == pytest.approx(np.pi, rel=1e-15)


def test_angles_and_rates_of_the_start_can_be_set_outright():
    given = {'initial.position.crank': '90 deg', 'initial.velocity.rocker': '6 rad/s'}
    state = ms.load_scene(LOOSE, given | {'start': 'centred'}).initial_state()
    assert state.closed == (False,)
    assert state.q == pytest.approx([0.729165459, 2.096503057], abs=1e-8)
    assert state.v[1] == 6.0
    seated = ms.load_scene(LOOSE).initial_state()
    assert seated.closed == (True,)
    assert seated.q == pytest.approx([1.030945894142804, 2.124939981241757], abs=1e-12)


@pytest.mark.sample(1)
@pytest.mark.parametrize('scene', ['toggle_press', 'thesis_complete'])
def test_every_coordinate_that_check_lists_can_be_given_at_the_start(scene):
    """Those of links between loose joints, too: the seated start again, coordinate by coordinate.

    Deformations of elastic links are left as they are.
    """
    machine = ms.load_scene(scene)
    listed = [c for c in check(machine).coordinates if '.bend' not in c and c != machine.plan.main]
    assert any(c.endswith('.x') for c in listed)
    state, free = machine.initial_state(), machine.equations.system.free
    initial = {
        kind: {c: values[free.index(c)] for c in listed}
        for kind, values in (('position', state.q), ('velocity', state.v))
    }
    again = ms.load_scene(scene, {'initial': initial})
    found = again.initial_state()
    for kind, values in (('position', found.q), ('velocity', found.v)):
        assert {c: values[free.index(c)] for c in listed} == initial[kind]


def test_the_angle_of_a_block_in_a_loose_guide_can_be_given():
    """Without clearance it is a displacement by that name, and refused with the right key."""
    given = {'initial.position.slider': '0.1 mrad'}
    machine = ms.load_scene('slider_with_play', given)
    assert machine.initial_state().q[machine.equations.system.free.index('slider')] == 1e-4
    said = refusal_of_start({'initial.position.slider': '0.2 m'}, 'slider_with_play')
    assert 'what can be given of it is slider, an angle' in said


def refusal_of_start(overrides, scene):
    with pytest.raises(InputError) as caught:
        ms.load_scene(scene, overrides).initial_state()
    return str(caught.value)


@pytest.mark.parametrize(
    ('scene', 'overrides', 'said'),
    [
        ('four_bar_clearance', {'initial.position': {'rocker.x': '1 mm'}},
         "rocker hangs on a joint without clearance, so that its only coordinate is 'rocker'"),
        ('toggle_press', {'initial.position': {'lower.x': '1 rad'}}, 'in m'),
        ('toggle_press', {'guess': {'lower.x': '1 mm'}},
         "which is for 'initial' only: write 'lower'"),
        ('toggle_press', {'drive.coordinate': 'lower.x'},
         "which is for 'initial' only: write 'lower'"),
    ],
)  # fmt: skip
def test_places_of_links_where_they_have_no_meaning_name_the_right_key(scene, overrides, said):
    assert said in refusal(overrides, scene)


def test_reading_keeps_the_name_and_checks_nothing_mechanical():
    name, scene = read_scene(LOOSE, {'links.crank.length': '2 m'})
    assert name == LOOSE
    assert scene.links['crank'].length == 2.0


def test_a_key_written_twice_is_refused_with_its_line(tmp_path):
    file = tmp_path / 'twice.yaml'
    file.write_text('title: x\nmechanism: four_bar\ntitle: y\n')
    with pytest.raises(InputError, match=r"line 3 .*'title' is written twice"):
        read_scene(str(file))


@pytest.mark.parametrize('name', ['lever.yml', 'levr.yaml', 'lever'])
def test_a_file_with_another_ending_is_suggested(tmp_path, monkeypatch, name):
    (tmp_path / 'lever.yaml').write_text('links: {}', encoding='utf-8')
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"did you mean 'lever\.yaml'"):
        ms.load_scene(name)
