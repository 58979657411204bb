"""Wrong values of every key of scenes and sweeps: one sentence, and no word of a library."""

from __future__ import annotations

import re
from itertools import product
from typing import Any, get_args

import numpy as np
import pytest
import yaml
from pydantic import ValidationError
from pydantic_core.core_schema import ErrorType

import mechanism_sim as ms
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.joints.cam.keys import SegmentPart
from mechanism_sim.joints.contact_keys import Clearance, Friction
from mechanism_sim.joints.joint_keys import KINDS, JointKeys
from mechanism_sim.keys.quantities import Part
from mechanism_sim.scene.four_bar import FourBarScene
from mechanism_sim.scene.problems import sentence
from mechanism_sim.scene.schema import DrivePart, JointPart, LinkPart, Scene, SensorPart
from mechanism_sim.scene.sensors import SENSORS
from mechanism_sim.studies.schema import SweepFile

WRONG = {
    'text': 'xyz', 'unit': '3 K', 'no unit of any kind': '3 kg/furlong', 'sign': -1.0, 'zero': 0,
    'endless': float('inf'), 'no number': float('nan'), 'half': 2.5, 'truth': True, 'nothing': '',
    'list': [1, 2, 3], 'empty list': [], 'one in a list': ['2 mm'], 'lists': [[1, 2], [3]],
    'mixed': ['a', 1, None], 'keys': {'a': 1}, 'no keys': {}, 'keys in keys': {'a': {'b': [1]}},
    'number as key': {1: 2}, 'as JSON': ['x', ''], 'huge': 10**400,
}  # fmt: skip
FOREIGN = re.compile(
    r'Input should|pydantic|validat|[Vv]alue error|instance|dictionary|iterable|'
    r'\bstrings?\b|parse|'
    r'NoneType|\bNone\b|\bTrue\b|\bFalse\b|function-|type=|Error|np\.|float32|unhashable'
)
"""Words of Pydantic and of Python."""


def parts(kind: Any = (Scene, FourBarScene, SweepFile)) -> list[type[Part]]:
    """Every part of which a scene or a sweep is made."""
    found: list[type[Part]] = []
    waiting = [*kind]
    while waiting:
        one = waiting.pop()
        waiting += get_args(one)
        if isinstance(one, type) and issubclass(one, Part) and one not in found:
            found.append(one)
            waiting += [field.annotation for field in one.model_fields.values()]
    return found


@pytest.mark.parametrize('part', parts(), ids=lambda part: part.__name__)
def test_wrong_values_of_every_key_are_refused_in_a_sentence(part: type[Part]) -> None:
    for name, field in part.model_fields.items():
        key, refused = field.alias or name, 0
        for value in WRONG.values():
            data = {key: value}
            try:
                part.model_validate(data)
            except ValidationError as error:
                own = [p for p in error.errors() if key in (*p['loc'][:1], *p['msg'].split())]
                if not own:
                    continue
                refused += 1
                text = sentence(own, part, data)
                assert key in text, text
                plain = text.replace('float32', '')  # a choice of the element type of files
                assert not FOREIGN.search(plain), text
                assert '\n' not in text
                assert not re.search(r'\s\s|: *$|= *$|must be *$', text), text
            except InputError as error:  # of a part of the model that reads by itself
                refused, text = refused + 1, str(error)
                assert not FOREIGN.search(text), text
        assert refused, f'{part.__name__}.{key} takes anything'


def test_no_sort_of_problem_has_words_of_the_library() -> None:
    """Also those that no key has today."""
    for kind in get_args(ErrorType):
        if kind in ('value_error', 'assertion_error', 'literal_error'):
            continue
        context = {'gt': 1.0, 'ge': 1.0, 'lt': 1.0, 'le': 1.0, 'min_length': 2, 'max_length': 2}
        problem: Any = {'type': kind, 'loc': ('duration',), 'input': 'x', 'ctx': context}
        text = sentence([problem], Scene, {'duration': 'x'})
        assert 'duration' in text
        assert not FOREIGN.search(text.replace("'x'", '')), text


@pytest.mark.parametrize('kind', KINDS)
def test_an_unknown_key_of_a_joint_names_the_keys_of_its_kind(kind: str) -> None:
    with pytest.raises(InputError) as refused:
        JointPart(**{kind: ['a.b', 'c.d'], 'nonsense': 1})
    listed = str(refused.value).partition('allowed here: ')[2].split(', ')
    assert listed[0] == kind
    assert not {*listed} & {*KINDS} - {kind}
    assert {*listed} <= KINDS[kind].model_fields.keys()
    assert len(listed) < len(JointPart.model_fields)


def test_parts_that_are_made_in_python_are_refused_in_the_same_words() -> None:
    """Of all kinds that are public."""
    with pytest.raises(InputError, match=r"^LinkPart: length = '1 kg' has the unit 'kg', which"):
        LinkPart(length='1 kg')
    with pytest.raises(InputError, match=r"^DrivePart: unknown key 'sped'; did you mean"):
        DrivePart(sped=3)
    with pytest.raises(InputError, match=r"^Scene: unknown key 'links\.bar\.lenght'; did you"):
        Scene(title='a bar', links={'bar': {'lenght': 1.0}}, joints={})


@pytest.mark.parametrize('kind', SENSORS)
def test_an_unknown_key_of_a_sensor_names_the_keys_of_its_kind(kind: str) -> None:
    with pytest.raises(InputError) as refused:
        SensorPart(kind=kind, nonsense=1)
    assert {*str(refused.value).partition('allowed here: ')[2].split(', ')} == {
        *SENSORS[kind].model_fields
    }


@pytest.mark.parametrize(
    ('key', 'value', 'says'),
    [
        ('joints.rocker_ground.revolut', [], "did you mean 'revolute'?"),
        (
            'joints.rocker_ground',
            {'nonsense': 1},
            f'allowed here: {", ".join(sorted(KINDS)[:3])}, ',
        ),
        ('gravity', 3, 'gravity = 3: it must be a list of two quantities, for example [9.81'),
        ('drive.profile.points', [3], 'drive.profile.points.0 = 3: it must be a list of two q'),
        ('outputs.forces', 'xyz', "outputs.forces = 'xyz': it must be true or false"),
        ('sensors.a.instrument', [1], 'sensors.a has the unknown instrument [1]: known are adxl'),
        ('joints.rocker_ground.clearance', {'radial': True}, 'clearance.radial = true is not a q'),
        ('links.crank.mass', [1], 'links.crank.mass = [1] is not a quantity'),
    ],
)
def test_what_is_said_of_some_wrong_values(key: str, value: object, says: str) -> None:
    with pytest.raises(InputError) as refused:
        ms.load_scene('slider_crank_engine' if 'rocker' not in key else 'loader', {key: value})
    assert says in str(refused.value)


DRY = 'joints.crank_rod.friction.dry_torque'
CURVE = 'joints.contact.law.segments.0.curve'


@pytest.mark.parametrize(
    ('scene', 'key', 'value', 'says'),
    [
        ('rise_dwell_return', CURVE, 'simple_harmonic', "here that is 'harmonic';"),
        ('rise_dwell_return', CURVE, 'SHM', "here that is 'harmonic';"),
        ('rise_dwell_return', CURVE, 'Bestehorn-Sinoide', "here that is 'cycloidal';"),
        ('rise_dwell_return', CURVE, 'parabolic', "here that is 'constant_acceleration';"),
        ('rise_dwell_return', CURVE, '3-4-5', "here that is 'polynomial_345';"),
        ('rise_dwell_return', CURVE, 345, "here that is 'polynomial_345';"),
        ('rise_dwell_return', CURVE, '4-5-6-7', "here that is 'polynomial_4567';"),
        ('rise_dwell_return', CURVE, 'linear', "here that is 'polynomial' with 'conditions'"),
        ('slider_crank', 'joints.x.type', 'revolute', 'as in revolute: [LINK.POINT, LINK.POINT];'),
        ('slider_crank', 'brakes', {}, 'torque: -2 N m*sign(LINK_rate)}}'),
        ('slider_crank', 'joints.x.hinge', ['ground', 'crank'], "here that is 'revolute'"),
        ('slider_crank', 'joints.x.slider', ['ground', 'crank'], "here that is 'prismatic'"),
        ('slider_crank', 'joints.x.gear_pair', ['crank', 'rod'], "here that is 'mesh'"),
        ('slider_crank', 'joints.x.chain', ['crank', 'rod'], "here that is 'belt'"),
        ('slider_crank', 'joints.x.weld', ['crank', 'rod'], "here that is 'fixed'"),
        ('slider_crank', 'joints.crank_rod.play', '1 mm', 'clearance: {radial: 0.1 mm}'),
        ('slider_crank', 'joints.crank_rod.clearance.diametral', '1 mm', "'radial', half of it"),
        ('slider_crank', 'joints.crank_rod.clearance.mu', 0.1, "here that is 'friction'"),
        ('slider_crank', 'joints.crank_rod.clearance.e', 0.1, "here that is 'restitution'"),
        ('slider_crank', 'links.rod.I', '1 kg m^2', "here that is 'inertia'"),
        ('slider_crank', 'links.rod.J', '1 kg m^2', "here that is 'inertia'"),
        ('slider_crank', 'links.rod.m', '1 kg', "here that is 'mass'"),
        ('four_bar_nominal', 'links.crank.L', '1 m', "here that is 'length'"),
        ('slider_crank', 'drive.omega', 3, "here that is 'speed', as in 300 rpm"),
        ('slider_crank', 'drive.rpm', 300, "here that is 'speed', as in 300 rpm"),
        ('slider_crank', 'drive.n', 300, "here that is 'speed', as in 300 rpm"),
        ('slider_crank', 'drive.angular_velocity', 3, "here that is 'speed', as in 300 rpm"),
        ('slider_crank', 'drive.link', 'crank', "here that is 'coordinate'"),
        ('slider_crank', 'loads.push.moment', '1 N m', "here that is 'torque'"),
        ('slider_crank', 'loads.push.point', 'rod.end', "here that is 'at'"),
        ('slider_crank', 'springs.back.k', '1 N/m', "here that is 'stiffness'"),
        ('slider_crank', 'springs.back.rate', '1 N/m', "here that is 'stiffness'"),
        ('slider_crank', 'sensors.probe.body', 'rod', "here that is 'link'"),
        ('slider_crank', 'sensors.probe.rate', '1 kHz', "here that is 'sample_rate'"),
        ('slider_crank', 'sensors.probe.fs', '1 kHz', "here that is 'sample_rate'"),
        ('slider_crank', 'sensors.probe.odr', '1 kHz', "here that is 'sample_rate'"),
        ('slider_crank', 'sensors.probe.noise_density', '25 ug', "here that is 'noise.rms', the"),
        ('slider_crank', 'sensors.probe.resonance', '2 kHz', "'transducer.natural_frequency'"),
        ('slider_crank', 'sensors.probe.sensitivity', '100 mV/g', 'in the unit of what is meas'),
        ('slider_crank', 'drive.motor.torque_constant', '26 mNm/A', 'over resistance, and'),
        ('slider_crank', 'drive.motor.inductance', '0.1 mH', "here that is a current by 'states'"),
        ('slider_crank', 'drive.motor.rotor_inertia', '33 gcm^2', "here that is 'inertia'"),
        ('slider_crank', 'drive.motor.induction.poles', 4, "here that is 'synchronous_speed'"),
        ('slider_crank', 'joints.crank_rod.damping', '0.1 N m s/rad',
         'springs: {NAME: {between: [crank, rod], damping: 5 N m s/rad}}'),
        ('slider_crank', 'joints.ground_piston.stiffness', '1 N/mm',
         'springs: {NAME: {coordinate: piston, stiffness: 5 N/m}}'),
        ('slider_crank', 'g', 9.81, 'gravity: [0, -9.81 m/s^2]'),
        ('slider_crank', 'bodies', {}, "here that is 'links'"),
        ('slider_crank', 'constraints', {}, "here that is 'joints'"),
        ('rubbing_compressor', DRY, '1 Nm', 'a load: loads: {NAME: {at: LINK, torque: -0.5 N m*'),
    ],
)  # fmt: skip
def test_words_of_others_lead_to_what_is_written_here(scene, key, value, says):
    with pytest.raises(InputError) as refused:
        ms.load_scene(scene, {key: value})
    assert says in str(refused.value)


def test_a_design_has_samples():
    with pytest.raises(InputError, match=r"'design\.runs'; here that is 'samples'"):
        ms.sweep({'scene': 'slider_crank', 'revolutions': 1, 'design': {'runs': 5}})


def test_what_stands_for_other_words_is_known_here():
    """Names in quotes are allowed values, those in flow style are read."""
    for word, said in SegmentPart.other_words.items():
        for name in re.findall(r"^'(\w+)'$", said):
            assert name in get_args(SegmentPart.model_fields['curve'].annotation), word
    law = {'points': [['0 deg', 0], ['120 deg', '20 mm'], ['360 deg', 0]], 'degree': 1}
    ms.load_scene('rise_dwell_return', {'joints.contact.law': law})
    for load in (Friction.other_words['dry_torque'], Scene.other_words['brakes']):
        text = re.search(r'torque: ([^}]*)', load)[1].replace('LINK', 'crank')
        ms.load_scene('slider_crank', {'loads.brake': {'at': 'crank', 'torque': text}})
    turned = {'joints.ground_piston.prismatic': ['piston', 'ground']}
    joints = ('crank_rod', {}), ('ground_piston', {}), ('ground_piston', turned)
    for (joint, other), key in product(joints, ('stiffness', 'damping')):
        with pytest.raises(InputError) as refused:
            ms.load_scene('slider_crank', {f'joints.{joint}.{key}': 1.0, **other})
        written = str(refused.value).partition('here that is ')[2].replace('NAME', 'soft')
        part = yaml.safe_load(written)['springs']['soft']
        assert ms.load_scene('slider_crank', {'springs.soft': part}).scene.springs['soft']


def test_zeros_of_keys_of_other_kinds_are_as_good_as_left_out():
    """Files of scenes have all keys, with their units."""
    ms.load_scene('slider_crank', {'joints.crank_rod': {
        'revolute': ['crank.end', 'rod'], 'phase': '0 rad', 'pretension': '0 N', 'disks': {},
    }})  # fmt: skip
    with pytest.raises(InputError, match='pretension has no meaning in a revolute joint'):
        ms.load_scene('slider_crank', {'joints.crank_rod.pretension': '1 N'})


@pytest.mark.parametrize('key', ['restitution', 'hypothesis'])
def test_keys_of_a_clearance_beside_it_are_told_their_place(key):
    """Cams and gears have them themselves, so they are keys of joints."""
    change = {f'joints.crank_rod.{key}': 0.5}
    with pytest.raises(InputError, match=rf"did you mean 'clearance\.{key}' or 'stops\.{key}'"):
        ms.load_scene('slider_crank', change)


@pytest.mark.parametrize(
    ('key', 'says'),
    [
        (
            'joints.shaft.gear',
            "unknown key 'joints.shaft.gear'; here that is 'mesh'; allowed here: a",
        ),
        ('joints.shaft.clearance.nonsense', 'allowed here: radial, restitution, '),
        ('springs.damping.nonsense', 'allowed here: between, coordinate, '),
        ('links.rod.points.length', 'points.length = 1: it must be a list of two quantities, '),
        ('sensors.noise.adc.bit', "did you mean 'bits'?; allowed here: range"),
        ('springs.damping', 'springs.damping = 1: it must be a list of keys with values'),
    ],
)
def test_names_of_parts_may_be_those_of_keys(key, says):
    with pytest.raises(InputError) as refused:
        ms.load_scene('slider_crank', {key: 1})
    assert says in str(refused.value)


@pytest.mark.parametrize('points', [5, [], 'ground', ['ground']])
def test_keys_of_other_kinds_are_refused_beside_points_that_are_none(points):
    change = {'joints.crank_rod': {'revolute': points, 'stiffness': 3.0}}
    with pytest.raises(InputError, match=r'stiffness has no meaning in a revolute joint$'):
        ms.load_scene('slider_crank', change)


@pytest.mark.parametrize(
    ('scene', 'key', 'says'),
    [
        (
            'watched_compressor',
            'sensors.a.jitter',
            "'sensors.a.jitter'; did you mean 'adc.jitter'?",
        ),
        ('watched_compressor', 'sensors.a.range', "'sensors.a.range'; did you mean 'adc.range'?"),
        ('slider_crank', 'rtol', "'rtol'; did you mean 'solver.rtol'?"),
        ('slider_crank', 'module', "did you mean 'joints.NAME.module' or 'gears.NAME.module'?"),
        ('rise_dwell_return', 'joints.contact.law.rise', "did you mean 'segments.0.rise'?"),
        ('slider_crank', 'links.rod.nose', "'links.rod.nose'; allowed here"),
    ],
)
def test_a_key_of_a_part_of_the_part_is_suggested_with_its_path(scene, key, says):
    with pytest.raises(InputError) as refused:
        ms.load_scene(scene, {key: 1})
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ('key', 'value', 'says'),
    [
        ('drives', [{'coordinate': 'left', 'position': '30 deg'}], 'as left: {position: ...}'),
        ('links', [{'name': 'rod', 'length': '0.3 m'}], 'as rod: {length: ...}'),
        ('loads', [{'at': 'rod', 'force': [0, 0]}], 'as NAME: {at: ...}'),
        ('loads', [3], 'as NAME: {...}'),
        ('loads', [], 'as NAME: {...}'),
    ],
)
def test_a_list_in_the_place_of_names_is_shown_with_a_name(key, value, says):
    with pytest.raises(
        InputError, match='names with values, not a list: each entry needs a'
    ) as no:
        ms.load_scene('slider_crank', {key: value})
    assert str(no.value).endswith(says)


def test_an_example_of_a_key_is_given_beside_other_problems():
    with pytest.raises(InputError, match=r'write \{width: 0\.15 mm\}; allowed here: width'):
        ms.load_scene('gear_rattle', {'joints.mesh.backlash': '0.15 mm', 'sensors.a': 5})


@pytest.mark.parametrize(
    ('key', 'value', 'says'),
    [
        ('drive.motor.curve', 'motor.csv', 'write {file: motor.csv}; allowed here: points,'),
        ('drive.motor.curve.fiel', 'motor.csv', "did you mean 'file'?"),
        ('tables.gas', 'gas.CSV', 'write {file: gas.CSV}'),
        ('tables.gas', {'file': 'a.csv', 'period': True}, "gas.period'; did you mean 'periodic'"),
        ('drive.profile', 'pace.csv', 'write {file: pace.csv}'),
        ('joints.k.law', 'lift.csv', 'write {file: lift.csv}'),
        ('links.crank.points', 'crank.csv', 'a list of names with values'),
    ],
)  # fmt: skip
def test_files_in_the_place_of_points_are_named_by_a_key(key, value, says):
    with pytest.raises(InputError) as refused:
        ms.load_scene('slider_crank', {key: value})
    assert says in str(refused.value)


def test_words_that_are_far_from_each_other_are_not_suggested():
    far = [('simple_harmonic', 'half_harmonic'), ('parabolic', 'harmonic'), ('linear', 'spline')]
    far += [('jitter', 'integrator'), ('range', 'transducer'), ('seed', 'scene'), ('type', 'rope')]
    for word, known in [*far, ('brakes', 'tables')]:
        assert nearest(word, [known]) == ''
    for word, known in [
        ('drvie', 'drive'),
        ('tpo', 'top'),
        ('damping', 'damping_ratio'),
        ('x', 'X'),
    ]:
        assert nearest(word, [known]) == f"; did you mean '{known}'?"


def test_a_name_with_nothing_behind_it_is_left_out_but_of_a_link():
    """As any key is: `--set loads.brake=null` removes a load."""
    scene = ms.load_scene('watched_compressor').scene
    drive = {'coordinate': 'crank', 'speed': '60 rpm'}
    for section in ('sensors', 'joints', 'masses', 'springs', 'drives', 'tables', 'guess'):
        found = ms.load_scene(
            'watched_compressor', {f'{section}.none': None, 'drive': drive}
        ).scene
        assert getattr(found, section) == getattr(scene, section)
    first = next(iter(scene.sensors))
    without = ms.load_scene('watched_compressor', {f'sensors.{first}': None})
    assert first not in without.scene.sensors
    text = 'title: a bar\nmechanism: linkage\nlinks: {bar: }\n'
    text += 'joints: {pin: {revolute: [ground, bar]}}\ndrive: {coordinate: bar, speed: 1}'
    assert list(ms.load_scene(text).scene.links) == ['bar']
    points = {'a': np.array([0.1, 0.2]), 'b': None}
    assert ms.LinkPart(points=points).points == {'a': (0.1, 0.2)}


class Bare(JointKeys):
    """A kind of joint whose contacts do not rub."""


def test_friction_in_the_clearance_of_what_does_not_rub_is_refused() -> None:
    given = {'radial': '0.1 mm', 'restitution': 0.5}
    assert not Bare().clearance_objection(Clearance(**given))
    assert 'friction' in Bare().clearance_objection(Clearance(**given, friction=0.1))


def test_parts_that_were_made_stay_as_they_are() -> None:
    """Pydantic's own words have several lines."""
    scene = ms.load_scene('slider_crank').scene
    for part, key in ((scene, 'title'), (scene.links['crank'], 'length')):
        said = (
            rf'^\w+: {key} cannot be set, for parts of a scene stay as they are: make another one'
        )
        with pytest.raises(InputError, match=said):
            setattr(part, key, None)


def test_formulas_that_yaml_cut_at_their_commas_are_told_to_need_quotes(tmp_path):
    scene = tmp_path / 'ball.yaml'
    scene.write_text("""
mechanism: linkage
links: {arm: {length: 1 m, mass: 1 kg}}
joints: {pin: {revolute: [ground, arm]}}
loads: {drag: {at: arm.end, force: [-hypot(vx, vy)*vx, -hypot(vx, vy)*vy]}}
""")
    with pytest.raises(InputError, match='a formula with a comma needs quotes'):
        ms.load_scene(scene)


def test_a_start_by_values_of_coordinates_is_told_its_key():
    with pytest.raises(InputError, match=r"here that is 'initial', as in initial: {position"):
        ms.load_scene('pendulum', {'start': {'position': {'bar': '30 deg'}}})
