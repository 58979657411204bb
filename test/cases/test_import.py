"""Machines of other programs: what they describe moves as it does there.

Right values: of the six-bar, PMKSWeb issue 92 and test/cases/inputs/six_bar.yaml; of pylinkage,
its own positions (version 1.3, `Mechanism.step`); of drawings, closed forms; of what this package
exports, the machine itself.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.catalogue import scene_names
from mechanism_sim.editor.document import Document
from mechanism_sim.errors import InputError
from mechanism_sim.export.mjcf import to_mjcf
from mechanism_sim.export.sdf import to_sdf
from mechanism_sim.export.urdf import to_urdf
from mechanism_sim.imports import import_machine
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene, find_scene, read_yaml

INPUTS = Path(__file__).parent / 'inputs'
SIX = """Joint ID,X,Y,Links,Joint Types,Ground,Angle,Input
A,-3.74,-2.41,AB,R,t,0,t
B,-2.72,0.91,AB|CBD,R,f,0,f
C,1.58,0.43,CBD|CFG,R,f,0,f
D,-0.24,4.01,DE|CBD,R,f,0,f
E,5.08,5.31,DE|FE,R,f,0,f
F,8.14,3.35,FE|CFG,R,f,0,f
G,7.32,-3.51,CFG,R,t,0,f
"""
ISSUE_92 = (
    'https://pmksplus.mech.website/?j=A,-3.74,-2.41,AB,R,t,0,0.1,t,%0AB,-2.72,0.91,AB%7CCBD,R,f,0,'
    '0.1,f,%0AC,1.58,0.43,CBD%7CCFG,R,f,0,0.1,f,%0AD,-0.24,4.01,DE%7CCBD,R,f,0,0.1,f,%0AE,5.08,'
    '5.31,DE%7CFE,R,f,0,0.1,f,%0AF,8.14,3.35,FE%7CCFG,R,f,0,0.1,f,%0AG,7.32,-3.51,CFG,R,t,0,0.1,f,'
    '%0A&l=AB,1,1,-3.2300000000000004,-0.75,A%7CB&f=&pp=&tp=&s=10,false,false,cm'
)


def machine(found, name='made', **overrides):
    """A machine of what was imported, with further keys of a scene."""
    return build(name, check_scene(name, {**found.data, **overrides}))


def places(machine, t, **points):
    """Points in the world (N, 2) [m] over a run, by name."""
    run = ms.simulate(machine, duration=float(t[-1]))
    found = {}
    for name, place in points.items():
        x, y = (
            run.sample(t, f'position.{place}.{axis}')[f'position.{place}.{axis}'] for axis in 'xy'
        )
        found[name] = np.stack([x, y], axis=1)
    return found


def saved(folder, text, name='machine.csv'):
    """A file in a folder."""
    file = folder / name
    file.write_text(text)
    return file


def test_the_six_bar_of_joint_coordinates_is_that_of_the_scene(tmp_path):
    """Between its limits; beyond them neither goes, and both at the same angle."""
    drive = {'profile': {'points': [['0 s', '10 rpm']]}}
    found = import_machine(saved(tmp_path, SIX))
    data = read_yaml(INPUTS / 'six_bar.yaml', 'scene')
    given = build('six_bar', check_scene('six_bar', {
        **data, 'duration': '0.08 s',
        'drive': {**drive, 'coordinate': 'ab', 'start_angle': '72.9215283451 deg'},
    }))  # fmt: skip
    made = machine(found, duration='0.08 s', drive={
        **drive, 'coordinate': 'AB', 'start_angle': found.data['drive']['start_angle'],
    })  # fmt: skip
    t = np.linspace(0.0, 0.08, 9)
    names = 'B', 'C', 'D', 'E', 'F'
    ends = 'ab.end', 'bcd.end', 'bcd.D', 'de.end', 'gcf.F'
    known = places(given, t, **dict(zip(names, ends, strict=True)))
    own = places(made, t, B='AB.B', C='CBD.C', D='CBD.D', E='DE.E', F='CFG.F')
    for name in names:
        assert own[name] == pytest.approx(known[name], abs=3e-12)
    scene = saved(tmp_path, found.text, 'six.yaml')
    limits = re.findall(r'[\d.]+(?= deg)', run_json('check', str(scene))['limits'][0])
    assert [float(x) for x in limits] == pytest.approx([67.2836, 78.2542], abs=1e-4)


def test_a_table_that_breaks_off_is_questioned():
    """Two rows of it, as a page of PMKS+ showed them."""
    found = import_machine(INPUTS / 'joints_six_bar.csv')
    assert [*found.data['links']] == ['ground', 'AB', 'CBD']
    assert 'link CBD has one joint, B: is the table complete?' in found.notes


def test_an_address_of_pmks_is_its_table(tmp_path):
    """The addresses of both ages; speeds in rpm, clockwise if it says so."""
    table, address = import_machine(saved(tmp_path, SIX)), import_machine(ISSUE_92)
    assert {**table.data, 'title': ''} == {**address.data, 'title': ''}
    assert table.data['drive']['speed'] == '10.0 rpm'
    clockwise = import_machine(ISSUE_92.replace('10,false', '12.5,true'))
    assert clockwise.data['drive']['speed'] == '-12.5 rpm'


def test_a_packed_address_of_pmks_is_read():
    """A slider-crank among its templates: joints in thousandths, 20 rpm clockwise."""
    found = import_machine(
        'https://app.pmksplus.com/?0P.TY.K,0.101.MA,A,0mA,0c,0.GB,B,0Yt,bK,0.GC,C,il,H-,0.LD,D,il,H-,'
        '0..YRAB,AB,Fe,Fe,0fW,IN,c5cae9,A,B,,.YRBC,BC,Fe,Fe,4y,Rf,303e9f,B,C,,.YPCD,CD,Fe,0,0,0,,C,'
        'D,,...JAe'
    )
    assert found.data['links']['ground']['points']['A'] == ['-3.082 cm', '-0.038 cm']
    assert found.data['drive']['speed'] == '-20.0 rpm'
    crank, rod = (float(found.data['links'][x]['points'][p][0].split()[0]) / 100.0
                  for x, p in (('AB', 'B'), ('BC', 'C')))  # fmt: skip
    t = np.linspace(0.0, 3.0, 7)
    slider = places(machine(found), t, C='BC.C')['C']
    at = np.array([-0.03082, -0.00038])
    pin = at + crank * np.exp(1j * (math.atan2(2.426, 0.851) - 2 * math.pi * t / 3)).view(
        float
    ).reshape(-1, 2)
    high = 0.01151 - pin[:, 1]
    assert slider[:, 0] == pytest.approx(pin[:, 0] + np.sqrt(rod**2 - high**2), abs=1e-13)
    assert slider[:, 1] == pytest.approx(0.01151, abs=1e-15)


def test_a_slot_on_a_link_is_that_of_pmks():
    """An inverted slider-crank of its gallery, closed form: the arm points at the crank's pin."""
    found = import_machine(
        'https://app.pmksplus.com/?2P.Fe.K,0.1011.MA,A,0,0,0.GB,B,0,Fe,0.KC,C,ku,0,0.GD,D,0RF,Oj,0.HP,'
        'P,0,Fe,0,CD,C,D..YRAB,AB,Fe,Fe,0,7q,c5cae9,A,B,,.YRCD,CD,Fe,Fe,9q,CN,303e9f,C,D,,.YPBP,BP,'
        'Fe,0,0,0,,B,P,,...N_r'
    )
    t = np.linspace(0.0, 3.0, 13)
    run = ms.simulate(machine(found), duration=3.0)
    turned = 0.5 * math.pi - 2.0 * math.pi * t / 3.0
    arm = np.unwrap(np.arctan2(np.sin(turned), np.cos(turned) - 3.0))
    angle = run.sample(t, 'position.CD')['position.CD']
    assert angle - angle[0] == pytest.approx(arm - arm[0], abs=1e-12)


@pytest.mark.parametrize(
    ('file', 'expected'),
    [
        ('pylinkage_fourbar.json', {
            'crank.coupler_0_crank_tip': (0.26749882862458735, 0.963558185417193),
            'coupler.coupler_1_rocker_0': (2.708382731844587, 2.7077157961283067),
        }),
        ('pylinkage_slider.json', {
            'crank.crank_tip_rod_0': (0.4535961214255775, 0.8912073600614353),
            'rod.rod_1': (-2.4656901587115554, 0.2),
        }),
    ],
)  # fmt: skip
def test_linkages_of_pylinkage_are_where_it_has_them(file, expected):
    """After eight steps of a second."""
    found = import_machine(INPUTS / 'import' / file)
    t = np.array([0.0, 8.0])
    for point, place in expected.items():
        assert places(machine(found), t, x=point)['x'][1] == pytest.approx(place, abs=1e-13)


def test_an_arc_of_pylinkage_is_a_swing_between_its_ends():
    """Half-way, after five of its ten steps, all is where pylinkage 1.3.0 has it."""
    found = import_machine(INPUTS / 'import' / 'pylinkage_arc.json')
    point = 'coupler.coupler_1_rocker_0'
    at = places(machine(found), np.array([0.0, 5.0, 15.0, 20.0]), x=point)['x']
    assert at[1] == pytest.approx((2.077388666251702, -2.302947168161395), abs=1e-13)
    assert at[2] == pytest.approx(at[1], abs=1e-13)
    assert at[3] == pytest.approx(at[0], abs=1e-13)
    swing = ms.cycle(machine(found), duration=20.0)['position.crank']
    assert [swing.min(), swing.max()] == pytest.approx([0.5, 1.5], abs=1e-12)
    assert any('crank swings as a cosine' in note for note in found.notes)


def arc(folder, **changed):
    """Machine of the file with other keys of the driven link."""
    data = json.loads((INPUTS / 'import' / 'pylinkage_arc.json').read_text())
    next(x for x in data['links'] if x['id'] == 'crank').update(changed)
    file = folder / 'arc.json'
    file.write_text(json.dumps(data))
    return import_machine(file)


@pytest.mark.parametrize(('speed', 'end'), [(0.1, 1.5), (-0.1, 0.5)])
def test_an_arc_of_pylinkage_begins_within_it_towards_its_speed(tmp_path, speed, end):
    """From the middle it is at one of its ends after five steps."""
    found = arc(tmp_path, initial_angle=1.0, angular_velocity=speed)
    at = ms.simulate(machine(found), duration=5.0).sample([0.0, 5.0])['position.crank']
    assert at == pytest.approx([1.0, end], abs=1e-12)


def test_an_arc_of_pylinkage_that_no_angle_begins_is_refused(tmp_path):
    last = arc(tmp_path, initial_angle=np.nextafter(1.5, 2.0))  # it is rounding
    at = ms.simulate(machine(last), duration=1.0).sample([0.0])['position.crank']
    assert at == pytest.approx([1.5], abs=1e-12)
    for wrong in ({'initial_angle': 2.0}, {'arc_end': 0.5}, {'arc_end': 0.4}):
        with pytest.raises(InputError, match=r'crank: its initial_angle .* is not within an arc'):
            arc(tmp_path, **wrong)


# --- what this package exports ------------------------------------------------------------------

EXPORTED = (
    'four_bar_nominal', 'slider_crank', 'hand_pump', 'ten_links', 'quick_return', 'scotch_yoke',
    'planetary', 'gear_box', 'pendulum',
)  # fmt: skip
KEPT = 'drive', 'drives', 'gravity', 'initial', 'loads', 'duration'
SAME = {
    ('four_bar_nominal', 'sdf'), ('four_bar_nominal', 'xml'), ('slider_crank', 'xml'),
    ('hand_pump', 'xml'), ('pendulum', 'sdf'), ('pendulum', 'xml'),
    *((name, 'urdf') for name in ('four_bar_nominal', 'slider_crank', 'hand_pump', 'quick_return',
                                  'scotch_yoke', 'pendulum')),
}  # fmt: skip
"""What has the same bits; else angles differ by whole turns, or numbers in their last digit."""


@pytest.mark.sample(4)
@pytest.mark.parametrize('ending', ['urdf', 'sdf', 'xml'])
@pytest.mark.parametrize('name', EXPORTED)
def test_what_is_exported_comes_back_equal(tmp_path, name, ending):
    """Drives, loads and gravity are those of the scene: not all formats have them."""
    original = ms.load_scene(name)
    text = {'urdf': to_urdf, 'sdf': to_sdf, 'xml': to_mjcf}[ending](original)
    found = import_machine(saved(tmp_path, text, f'{name}.{ending}'))
    raw = read_yaml(find_scene(name), 'scene')
    keys = {k: raw[k] for k in KEPT if k in raw}
    if ending == 'xml' and original.scene.drive and original.scene.drive.speed:
        assert found.data['drive']['speed'] == f'{original.scene.drive.speed.value!r} rad/s'
    made = machine(found, name, **keys)
    t = np.linspace(0.0, 0.1, 11)
    one, other = (ms.simulate(m, duration=0.1) for m in (original, made))
    for body in original.plan.bodies:
        again = made.mechanism.body(body.name)
        if body.mass:
            assert (again.mass, again.inertia) == (body.mass, body.inertia or again.inertia)
        for axis in 'xy':
            column = f'position.{body.name}.cog.{axis}'
            assert other.sample(t, column)[column] == pytest.approx(
                one.sample(t, column)[column], abs=1e-14
            )
    if (name, ending) in SAME:
        assert other.digest() == one.digest()


ROTORS = {'overhung_rotor', 'rotor_on_supports', 'rotor_run_up', 'two_disk_rotor'}
"""Disks that float in a URDF: it has no joints for bearings that give way."""


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', scene_names())
def test_every_scene_that_is_exported_is_a_scene_again(tmp_path, name):
    original = ms.load_scene(name)
    for ending, write in (('urdf', to_urdf), ('sdf', to_sdf), ('xml', to_mjcf)):
        try:
            text = write(original)
        except InputError:
            continue  # the format has no place for it
        if (name, ending) in {(rotor, 'urdf') for rotor in ROTORS}:
            with pytest.raises(InputError, match='there is no revolute joint'):
                import_machine(saved(tmp_path, text, f'{name}.{ending}'))
            continue
        made = import_machine(saved(tmp_path, text, f'{name}.{ending}')).data['links']
        assert {*original.scene.links} & {*made} - {'ground'}


# --- robots of others ---------------------------------------------------------------------------

CRANK_ROCKER = (0.1, 0.3, 0.25, 0.3)
"""Crank, coupler, rocker, ground [m]."""


def rocker_angle(crank):
    """Closed form of the open four-bar above."""
    a, b, c, d = CRANK_ROCKER
    pin = a * np.exp(1j * crank)
    away = d - pin
    inner = np.arccos((b**2 + abs(away) ** 2 - c**2) / (2.0 * b * abs(away)))
    return np.angle(pin + b * np.exp(1j * (np.angle(away) + inner)) - d)


def test_a_mujoco_four_bar_in_the_xz_plane(tmp_path):
    """Angles in degrees, hinges about -y, a loop by sites, masses in diaginertia; at 2 rad/s."""
    coupler = 0.3 * np.exp(1j * (np.angle(rocker_pin(0.0) - 0.1)))
    turn = -math.degrees(np.angle(coupler))
    swing = -math.degrees(rocker_angle(0.0))
    text = f"""<mujoco model="four bar"><default><joint axis="0 -1 0"/></default><worldbody>
      <body name="crank"><joint name="motor"/>
        <inertial pos="0.05 0 0" mass="0.2" diaginertia="1e-5 2e-4 2e-4"/>
        <body name="coupler" pos="0.1 0 0" euler="0 {turn!r} 0"><joint/>
          <inertial pos="0.15 0 0" mass="0.3" diaginertia="1e-5 3e-3 3e-3"/>
          <site name="there" pos="0.3 0 0"/></body></body>
      <body name="rocker" pos="0.3 0 0" euler="0 {swing!r} 0"><joint/>
        <inertial pos="0.1 0 0" mass="0.25" diaginertia="1e-5 2e-3 2e-3"/>
        <site name="here" pos="0.25 0 0"/></body></worldbody>
    <equality><connect name="pin" site1="there" site2="here"/></equality>
    <actuator><velocity name="m" joint="motor" kv="1"/></actuator>
    <keyframe><key ctrl="2"/></keyframe></mujoco>"""
    found = import_machine(saved(tmp_path, text, 'four_bar.xml'))
    assert not found.notes
    assert found.data['gravity'] == ['0.0 m/s^2', '-9.81 m/s^2']
    assert found.data['links']['coupler']['inertia'] == '0.003 kg m^2'
    t = np.linspace(0.0, 3.0, 9)
    run = ms.simulate(machine(found), duration=3.0)
    angle = run.sample(t, 'position.rocker')['position.rocker']
    assert np.exp(1j * angle) == pytest.approx(np.exp(1j * rocker_angle(2.0 * t)), abs=1e-12)


def rocker_pin(crank):
    """Of the four-bar above, in the complex plane."""
    return 0.3 + 0.25 * np.exp(1j * rocker_angle(crank))


def test_an_sdf_four_bar_of_drake(tmp_path):
    """As Drake's pull request 18829 has it: three links at their poses, a loop of four hinges."""
    along = float(np.angle(rocker_pin(0.0) - 0.1))
    poses = {'crank': (0.0, 0.0), 'coupler': (0.1, along), 'rocker': (0.3, rocker_angle(0.0))}
    links = ''.join(
        f'<link name="{name}"><pose>{x!r} 0 0 0 0 {float(angle)!r}</pose><inertial><mass>1</mass>'
        '</inertial></link>'
        for name, (x, angle) in poses.items()
    )
    joints = ''.join(
        f'<joint name="{parent}_{child}" type="revolute"><parent>{parent}</parent>'
        f'<child>{child}</child><pose>{at} 0 0 0 0 0</pose><axis><xyz>0 0 1</xyz></axis></joint>'
        for parent, child, at in (('world', 'crank', 0), ('crank', 'coupler', 0),
                                  ('world', 'rocker', 0), ('coupler', 'rocker', 0.25))
    )  # fmt: skip
    text = f'<sdf version="1.7"><model name="loop">{links}{joints}</model></sdf>'
    found = import_machine(saved(tmp_path, text, 'loop.sdf'), overrides=['drive.speed=2 rad/s'])
    run = ms.simulate(machine(found), duration=1.0)
    angle = run.sample(np.array([1.0]), 'position.rocker')['position.rocker']
    assert np.exp(1j * angle) == pytest.approx(np.exp(1j * rocker_angle(2.0)), abs=1e-12)


LINK = '<link name="{}">{}<inertial><mass>1</mass></inertial></link>'
JOINT = (
    '<joint name="{}" type="{}">{}<parent>{}</parent><child>{}</child><axis>{}{}</axis></joint>'
)  # fmt: skip
SLIDE = '<xyz{}>{!r} 0 {!r}</xyz>'
DYNAMICS = (
    '<dynamics><damping>0.2</damping><friction>0.1</friction><spring_stiffness>3</spring_stiffness>'
    '<spring_reference>0.5</spring_reference></dynamics><limit><lower>-1</lower></limit>'
)


def test_poses_of_an_sdf_mean_the_same_in_all_its_frames(tmp_path):
    """Plain, and by degrees, quaternions, joints, frames, axes of the model: SDF 1.9."""
    half, swing = 0.5 * math.pi / 3.0, -math.pi / 3.0
    x, z = 0.4 * math.cos(swing), 0.5 - 0.4 * math.sin(swing)
    plain = [
        LINK.format('arm', f'<pose>0 0 0.5 0 {swing!r} 0</pose>'),
        LINK.format('block', f'<pose>{x!r} 0 {z!r} 0 0.7 0</pose>'),
        JOINT.format('h', 'revolute', '', 'world', 'arm', '<xyz>0 1 0</xyz>', DYNAMICS),
        JOINT.format('s', 'prismatic', '', 'arm', 'block',
                     SLIDE.format('', math.cos(0.7), math.sin(0.7)), ''),
    ]  # fmt: skip
    related = [
        LINK.format('arm', '<pose relative_to="base" degrees="true">0 0 0 0 -60 0</pose>'),
        '<frame name="base"><pose>0 0 0.5 0 0 0</pose></frame>',
        '<frame name="tip" attached_to="arm"><pose>0.4 0 0 0 0 0</pose></frame>',
        LINK.format('block', '<pose relative_to="s">0 0 0 0 0.7 0</pose>'),
        JOINT.format('h', 'revolute', '<pose relative_to="base">0 0 0 0 0 0</pose>',
                     'world', 'arm', '<xyz>0 1 0</xyz>', DYNAMICS),
        JOINT.format('s', 'prismatic', '<pose relative_to="tip" rotation_format="quat_xyzw">'
                     f'0 0 0 0 {math.sin(half)!r} 0 {math.cos(half)!r}</pose>', 'tip', 'block',
                     SLIDE.format(' expressed_in="__model__"', 1.0, 0.0), ''),
    ]  # fmt: skip
    found = [
        import_machine(saved(tmp_path, f'<sdf version="1.9"><model name="m">{"".join(parts)}'
                                       '</model></sdf>', 'm.sdf'))
        for parts in (plain, related)
    ]  # fmt: skip
    texts, numbers = zip(*(read_numbers(x.text) for x in found), strict=True)
    assert texts[0] == texts[1]
    assert numbers[0] == pytest.approx(numbers[1], abs=1e-13)
    assert found[0].data['springs']['h_spring'] == {
        'between': ['arm', 'ground'], 'stiffness': '3.0 N m/rad', 'damping': '0.2 N m s/rad',
        'free_angle': f'{swing + 0.5!r} rad',  # turned by 0.5 about y, that is back in the plane
    }  # fmt: skip
    assert {x.split(':', 1)[1] for x in found[0].notes if x.startswith('h:')} == {
        ' its limits are left out: see `stops`',
        ' its friction is left out, which does not depend on its load',
    }


def read_numbers(text):
    """A text without its numbers, and those."""
    pattern = r'-?\d+\.\d+(?:e-?\d+)?'
    return re.sub(pattern, '#', text), [float(x) for x in re.findall(pattern, text)]


SHAPES = """<mujoco><compiler angle="degree"/><worldbody><body name="a">
<joint name="h" axis="0 1 0"/><geom size="0.06" pos="0.3 0 0" density="7800"/>
<geom type="box" size="0.1 0.02 0.3" pos="0.1 0 0.2" euler="0 30 0"/>
<geom type="cylinder" size="0.05 0.2" pos="0 0 0.1" mass="2"/>
<geom type="box" fromto="0 0 0 0.4 0 0.3" size="0.02"/>
<geom type="capsule" fromto="0.1 0 0 0.4 0 0.1" size="0.03"/></body></worldbody></mujoco>"""


def test_shapes_weigh_what_they_do_in_mujoco(tmp_path):
    """Mass, centre and inertia about y of its compiled model, version 4.0."""
    keys = import_machine(saved(tmp_path, SHAPES, 'shapes.xml')).data['links']['a']
    found = [float(keys[key].split()[0]) for key in ('mass', 'inertia')]
    assert found == pytest.approx([15.664484016474994, 0.5454182156721172], rel=1e-13)
    cog = [float(x.split()[0]) for x in keys['cog']]
    assert cog == pytest.approx([0.1920896141746692, 0.08492846062298305], rel=1e-13)


ARM = """<mujoco model="arm"><compiler angle="degree"/><default><joint axis="0 1 0"
damping="0.3"/><geom type="capsule" size="0.02"/><default class="heavy"><geom density="7800"/>
<default class="light"><geom density="300"/><joint stiffness="2" springref="30"/></default>
</default></default><worldbody><geom type="plane" size="1 1 .1"/><frame pos="0.1 0 1" euler="0
25 0" childclass="light"><body name="upper" pos="0 0 0.2"><joint name="j1" stiffness="4"
springref="12" damping="0.1" ref="7"/><geom class="heavy" fromto="0 0 0 0.4 0 0"/><geom
type="ellipsoid" size=".1 .05 .07" pos=".1 .02 .3" zaxis="1 0 .3"/><frame pos=".03 0 .02"
xyaxes="1 0 .2 0 1 0"><geom type="ellipsoid" size=".01" fromto="0 0 0 .2 0 .1" mass=".4"/><body
name="lower" pos="0.4 0 0" xyaxes="0 0 -1 0 1 0" childclass="main"><frame pos="0 0 .05" euler="0
10 0"><joint name="j2"/></frame><geom fromto="0 0 0 0.3 0 0" mass="0.7"/><body name="block"
zaxis="1 0 0" pos="0.1 0 0"><joint name="s" type="slide" axis="1 0 1" damping="2"
stiffness="300" springref="0.03" ref="0.01"/><geom type="box" size=".1 .02 .03" quat="1 0 .2
0"/></body></body></frame></body></frame></worldbody><keyframe><key qpos="0.5 -0.3 0.04"/>
</keyframe></mujoco>"""
IN_MUJOCO = {
    'upper': (0.33557671, 1.06981842, -22.92374505, -2.55469416, -3.46270178),
    'lower': (0.49251423, 0.78593489, 20.19130010, -3.58836834, -11.12330247),
    'block': (0.48132330, 0.81989726, math.nan, 5.32450400, -6.48996990),
}
"""Centre x, z [m], angular acceleration about -y [rad/s^2], and that of the centre [m/s^2]."""


def test_an_arm_of_classes_frames_and_springs_starts_as_in_mujoco(tmp_path):
    """Accelerations by its version 4.0 without contact, at the keyframe."""
    found = import_machine(saved(tmp_path, ARM, 'arm.xml'))
    assert [x for x in found.notes if 'defines no drive' not in x] == []
    run = ms.simulate(machine(found), duration=0.01)
    for link, expected in IN_MUJOCO.items():
        of = f'acceleration.{link}', f'acceleration.{link}.cog.x', f'acceleration.{link}.cog.y'
        names = f'position.{link}.cog.x', f'position.{link}.cog.y', *of
        columns = run.sample(np.zeros(1), *names)
        for name, value in zip(names, expected, strict=True):
            assert math.isnan(value) or columns[name][0] == pytest.approx(value, abs=2e-6), name


def test_masses_of_shapes_count_where_the_compiler_says_so(tmp_path):
    """`inertiafromgeom` over `inertial`, all of it scaled to `settotalmass`."""
    shape = '<inertial pos="0 0 0" mass="9" diaginertia="1 1 1"/><geom size="0.1" mass="{}"/>'
    bodies = ''.join(
        f'<body name="{name}"><joint axis="0 1 0"/>{shape.format(mass)}</body>'
        for name, mass in (('a', 2), ('b', 3))
    )
    for compiler, a in (('inertiafromgeom="true"', 2.0), ('', 9.0), ('settotalmass="4"', 2.0),
                        ('settotalmass="4" inertiafromgeom="true"', 1.6)):  # fmt: skip
        text = f'<mujoco><compiler {compiler}/><worldbody>{bodies}</worldbody></mujoco>'
        keys = import_machine(saved(tmp_path, text, 'two.xml')).data['links']['a']
        assert float(keys['mass'].split()[0]) == pytest.approx(a, rel=1e-15)


def test_springs_between_links_come_back_of_an_mjcf(tmp_path):
    """Torsion springs are tendons there; of guides alone a plane is known, too."""
    text = to_mjcf(ms.load_scene('torsional_shaft'))
    made = import_machine(saved(tmp_path, text, 'shaft.xml')).data['springs']
    assert made['front'] == {
        'between': ['motor', 'first'], 'stiffness': '800.0 N m/rad', 'damping': '0.2 N m s/rad',
        'free_angle': '0.0 rad',
    }  # fmt: skip
    text = to_mjcf(ms.load_scene('mass_on_spring'))
    found = import_machine(saved(tmp_path, text, 'mass.xml'))
    assert found.data['springs']['spring']['stiffness'] == '500.0 N/m'
    assert {'base', 'mass'} <= found.data['guess'].keys()


def test_springs_along_guides_come_back_of_an_mjcf(tmp_path):
    """Two on one guide, one along a guide of a moving link: it moves as it did."""
    tree = ms.load_scene({
        'mechanism': 'linkage',
        'links': {'sledge': {'mass': '2 kg'}, 'ram': {'mass': '0.5 kg'}},
        'joints': {
            'rail': {'prismatic': ['ground', 'sledge'], 'axis': '30 deg'},
            'bore': {'prismatic': ['ram', 'sledge'], 'axis': '70 deg'},
        },
        'gravity': ['0 m/s^2', '-9.81 m/s^2'],
        'initial': {'position': {'sledge': '40 mm', 'ram': '-30 mm'}},
        'springs': {
            'buffer': {'coordinate': 'sledge', 'stiffness': '300 N/m', 'damping': '2 N s/m',
                       'free_length': '25 mm'},
            'second': {'coordinate': 'sledge', 'stiffness': '100 N/m', 'free_length': '-10 mm'},
            'return': {'coordinate': 'ram', 'stiffness': '200 N/m', 'damping': '1 N s/m'},
        },
        'duration': '0.5 s',
    })  # fmt: skip
    text = to_mjcf(tree)
    assert 'left out' not in text
    found = import_machine(saved(tmp_path, text, 'guides.xml'))
    assert found.data['springs'] == {
        'buffer': {'coordinate': 'sledge', 'stiffness': '300.0 N/m', 'damping': '2.0 N s/m',
                   'free_length': '0.025 m'},
        'second': {'coordinate': 'sledge', 'stiffness': '100.0 N/m', 'free_length': '-0.01 m'},
        'return': {'coordinate': 'ram', 'stiffness': '200.0 N/m', 'damping': '1.0 N s/m',
                   'free_length': '0.0 m'},
    }  # fmt: skip
    t = np.linspace(0.0, 0.5, 6)
    known, own = (places(m, t, sledge='sledge.cog', ram='ram.cog') for m in (tree, machine(found)))
    for link, path in known.items():
        assert own[link] == pytest.approx(path, abs=1e-13)


def test_a_gear_of_an_actuator_divides_its_speed(tmp_path):
    text = ARM.replace(
        '</keyframe>', '</keyframe><actuator><velocity joint="j1" gear="2"/></actuator>'
    )
    text = text.replace('qpos=', 'ctrl="6" qpos=')
    found = import_machine(saved(tmp_path, text, 'arm.xml'))
    assert found.data['drive']['speed'] == '-3.0 rad/s'


def test_a_loop_that_a_urdf_closes_for_gazebo(tmp_path):
    """An SDF joint in the extension, as Gazebo's tutorial of kinematic loops has it."""
    along = float(np.angle(rocker_pin(0.0) - 0.1))
    text = '<robot name="loop"><link name="base"/>' + ''.join(
        f'<link name="{x}"><inertial><mass value="1"/></inertial></link>'
        for x in ('crank', 'coupler', 'rocker')
    )
    for parent, child, x, turn in (('base', 'crank', 0.0, 0.0), ('crank', 'coupler', 0.1, along),
                                   ('base', 'rocker', 0.3, float(rocker_angle(0.0)))):  # fmt: skip
        text += (
            f'<joint name="{parent}_{child}" type="continuous"><parent link="{parent}"/>'
            f'<child link="{child}"/><origin xyz="{x} 0 0" rpy="0 0 {turn!r}"/><axis xyz="0 0 1"/>'
            '</joint>'
        )
    text += (
        '<gazebo><joint name="pin" type="revolute"><parent>coupler</parent><child>rocker</child>'
        '<pose>0.25 0 0 0 0 0</pose><axis><xyz>0 0 1</xyz></axis></joint></gazebo></robot>'
    )
    found = import_machine(saved(tmp_path, text, 'loop.urdf'), overrides=['drive.speed=2 rad/s'])
    run = ms.simulate(machine(found), duration=1.0)
    angle = run.sample(np.array([1.0]), 'position.rocker')['position.rocker']
    assert np.exp(1j * angle) == pytest.approx(np.exp(1j * rocker_angle(2.0)), abs=1e-12)


def test_a_gripper_whose_fingers_mimic_each_other(tmp_path):
    """A URDF of two fingers: the second turns back by half, its pad rides along."""
    link = '<link name="{}"><inertial><mass value="1"/><inertia izz="0.01"/></inertial></link>'
    joint = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>{4}</joint>'
    text = '<robot name="gripper">' + ''.join([
        '<link name="base"/>', *(link.format(x) for x in ('left', 'right', 'pad')),
        joint.format('l', 'revolute', 'base', 'left', '<origin xyz="0 0.1 0" rpy="0 0 0.5"/>'
                     '<axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/>'
                     '<dynamics damping="0.5" friction="0.1"/>'),
        joint.format('r', 'continuous', 'base', 'right', '<origin xyz="0 -0.1 0"/>'
                     '<axis xyz="0 0 -1"/><mimic joint="l" multiplier="0.5" offset="0.2"/>'),
        joint.format('p', 'fixed', 'right', 'pad', '<origin xyz="0.2 0 0" rpy="0 0 1.5"/>'),
    ]) + '</robot>'  # fmt: skip
    found = import_machine(saved(tmp_path, text, 'gripper.urdf'), overrides={
        'drive.coordinate': 'left', 'drive.speed': '0.3 rad/s',
    })  # fmt: skip
    assert found.data['springs'] == {
        'l_spring': {'between': ['ground', 'left'], 'damping': '0.5 N m s/rad'},
    }
    assert 'l: its friction is left out, which does not depend on its load' in found.notes
    made = machine(found)
    body = made.mechanism.body('right')
    assert (body.mass, body.cog) == (2.0, pytest.approx((0.1, 0.0)))
    assert body.inertia == pytest.approx(0.02 + 2.0 * 0.1**2, rel=1e-12)
    run = ms.simulate(made, duration=1.0)
    turned = {x: run.sample(np.array([0.0, 1.0]), f'position.{x}')[f'position.{x}']
              for x in ('left', 'right')}  # fmt: skip
    assert np.diff(turned['right']) == pytest.approx(-0.5 * np.diff(turned['left']), abs=1e-13)


# --- drawings -----------------------------------------------------------------------------------

PLATES = """<svg xmlns="http://www.w3.org/2000/svg" width="30cm" viewBox="0 0 300 200">
<g id="ground"><circle cx="50" cy="150" r="5"/><circle cx="250" cy="150" r="5"/></g>
<g id="crank"><path d="M60 150V100a10 10 0 0 0-20 0v50A10 10 0 0 0 60 150Z"/>
<circle cx="50" cy="150" r="4"/><circle cx="50" cy="100" r="4"/></g>
<g id="coupler"><path d="M 40 90 h 220 v 20 h -220 z"/>
<circle cx="50" cy="100" r="4"/><circle cx="250" cy="100" r="4"/></g>
<g id="rocker" transform="translate(250,150) rotate(180)"><rect x="-10" y="-10" width="20"
height="70"/><circle cx="0" cy="0" r="4"/><circle cx="0" cy="50" r="4"/></g></svg>"""


def test_plates_of_a_drawing_are_links_with_masses(tmp_path):
    """An SVG of a parallelogram: holes are joints, areas by closed forms."""
    found = import_machine(
        saved(tmp_path, PLATES, 'plates.svg'), thickness='5 mm', density='2700 kg/m^3',
        overrides=['drive.speed=60 rpm'],
    )  # fmt: skip
    assert not found.notes
    assert len(found.data['joints']) == 4
    made = machine(found, outputs={'forces': False})
    plate, hole = 5e-3 * 2700.0, math.pi * 0.004**2
    crank = made.mechanism.body('crank')
    assert crank.mass == pytest.approx(plate * (0.05 * 0.02 + math.pi * 1e-4 - 2 * hole), rel=1e-5)
    rocker = made.mechanism.body('rocker')
    area, far = 0.02 * 0.07, (0.025 * 0.02 * 0.07 - 0.025 * 2 * hole) / (0.02 * 0.07 - 2 * hole)
    polar = area * (0.02**2 + 0.07**2) / 12 + area * (0.025 - far) ** 2 - sum(
        hole * (0.5 * 0.004**2 + (x - far) ** 2) for x in (0.0, 0.05)
    )  # fmt: skip
    assert rocker.inertia == pytest.approx(plate * polar, rel=1e-9)
    assert math.hypot(*rocker.cog) == pytest.approx(far, rel=1e-12)


def test_a_dxf_is_that_drawing(tmp_path):
    """Lines, arcs and polylines with bulges on layers, in inches by its header."""
    ezdxf = pytest.importorskip('ezdxf')
    document = ezdxf.new('R2010', units=1)
    space = document.modelspace()
    for layer, a, b in (('crank', 0.0, 2.0), ('GROUND', 0.0, 6.0), ('rocker', 6.0, 9.0),
                        ('coupler', 2.0, 9.0)):  # fmt: skip
        on = {'layer': layer}
        for x in (a, b):
            space.add_circle((x, 0.0), 0.25, dxfattribs=on)
        if layer == 'crank':
            space.add_lwpolyline(
                [(a, -1.0, 0.0), (b, -1.0, 1.0), (b, 1.0, 0.0), (a, 1.0, 1.0)],
                format='xyb', close=True, dxfattribs=on,
            )  # fmt: skip
        elif layer != 'GROUND':
            space.add_line((a, -1.0), (b, -1.0), dxfattribs=on)
            space.add_line((b, 1.0), (a, 1.0), dxfattribs=on)
            space.add_arc((b, 0.0), 1.0, -90.0, 90.0, dxfattribs=on)
            space.add_arc((a, 0.0), 1.0, 90.0, 270.0, dxfattribs=on)
    file = tmp_path / 'plates.dxf'
    document.saveas(file)
    found = import_machine(file, thickness='0.25 inch', overrides=['drive.speed=1 rpm'])
    assert found.data['links']['ground']['points'] == {'hole_2': ['6.0 inch', '0.0 inch']}
    area = {'crank': 2 * 2.0, 'coupler': 7 * 2.0, 'rocker': 3 * 2.0}
    for link, size in area.items():
        mass = (size + math.pi - 2.0 * math.pi / 16.0) * 0.25 * 0.0254**3 * 7850.0
        assert float(found.data['links'][link]['mass'].split()[0]) == pytest.approx(mass, rel=1e-5)


def test_a_machine_as_a_drawing_comes_back(tmp_path):
    """DXF in millimetres by the suffix; ten links, three of them in one place at the crank."""
    pytest.importorskip('ezdxf')
    file = tmp_path / 'ten_links.dxf'
    assert run('export', 'ten_links', '-o', str(file)).returncode == 0
    drive = {'coordinate': 'motor_crank', 'speed': '60 rpm', 'start_angle': '0 deg'}
    found = import_machine(file, overrides={'drive': drive})
    assert len(found.data['joints']) == 13
    t = np.linspace(0.0, 0.9, 7)
    original = ms.load_scene('ten_links', overrides={'outputs.forces': False})
    known = places(original, t, toe='foot.end', knee='shank.end')
    own = places(machine(found), t, toe='foot.hole_2', knee='shank.hole_2')
    for name, path in known.items():
        near = [np.abs(other - path).max() for other in own.values()]
        assert min(near) < 1e-9, name


def test_plates_for_a_printer_are_closed(tmp_path):
    """Each link a solid of its name whose volume, by Gauss' theorem, is that of its drawing.

    In millimetres, as programs for printers take numbers, and as the drawing has them.
    """
    ezdxf = pytest.importorskip('ezdxf')
    file, sheet = tmp_path / 'links.stl', tmp_path / 'links.dxf'
    done = run('export', 'four_bar_nominal', '-o', str(file))
    assert (done.returncode, done.stdout.strip()) == (0, str(file))
    assert 'its lengths are in mm' in done.stderr
    assert run_json('export', 'four_bar_nominal', '--format', 'stl')['unit'] == 'mm'
    assert run('export', 'four_bar_nominal', '-o', str(sheet)).returncode == 0
    drawn = ezdxf.readfile(sheet)
    assert drawn.units == ezdxf.units.MM
    solids = file.read_text().split('endsolid ')[:-1]
    assert {'crank', 'coupler', 'rocker'} <= {x.split('solid ')[1].split()[0] for x in solids}
    for text in solids:
        corners = np.array([x.split() for x in re.findall(r'vertex (.*)', text)], float)
        a, b, c = corners.reshape(-1, 3, 3).transpose(1, 0, 2)
        assert np.abs(np.cross(b - a, c - a).sum(axis=0)).max() < 1e-9  # without holes
        volume = (a * np.cross(b, c)).sum() / 6.0  # positive: counterclockwise from outside
        link = text.split('solid ')[1].split()[0]
        (curve,) = drawn.modelspace().query(f'LWPOLYLINE[layer=="{link.upper()}"]')
        x, y = np.array([point[:2] for point in curve]).T
        area = 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))
        assert volume == pytest.approx(area * np.ptp(a[:, 2]), rel=1e-6), link


@pytest.mark.slow
def test_an_imported_machine_turns_ten_thousand_times(tmp_path):
    """Of a URDF with its loop in an extension: the last turn ends where the first does."""
    text = to_urdf(ms.load_scene('four_bar_nominal'))
    found = import_machine(saved(tmp_path, text, 'm.urdf'), overrides=['drive.speed=10 rad/s'])
    made = machine(found, outputs={'forces': False})
    names, ends = [f'position.{c}' for c in made.plan.ideal.coordinates], []
    for turns in (1, 10_000):
        final = ms.stream(made, revolutions=turns).finish().final
        ends.append(np.concatenate([*catalogue(made).columns(names, final).values()]))
    assert np.exp(1j * ends[1]) == pytest.approx(np.exp(1j * ends[0]), abs=1e-10)


# --- one way for all ----------------------------------------------------------------------------


def test_the_command_writes_what_the_function_and_the_editor_have(tmp_path):
    table = saved(tmp_path, SIX.replace('8.14,3.35', '8.2,3.3'), 'six.csv')
    scene = tmp_path / 'six.yaml'
    done = run('import', str(table), '-o', str(scene), '--set', 'drive.speed=1 rpm')
    assert done.returncode == 0, done.stderr
    found = import_machine(table, overrides=['drive.speed=1 rpm'])
    assert scene.read_text() == found.text
    assert yaml.safe_load(found.text) == found.data
    assert Document.open(str(table)).text == import_machine(table).text
    told = run_json('import', str(table))
    assert told['text'] == import_machine(table).text
    again = run('import', str(table), '-o', str(tmp_path / 'x.json'))
    assert again.returncode == 2
    assert 'the ending must be .yaml or .yml' in again.stderr


@pytest.mark.slow
@pytest.mark.network
def test_an_imported_machine_runs_as_nodes(tmp_path):
    """Recorded and read back it has the digest of the scene that was exported."""
    urdf, scene, bag = (str(tmp_path / x) for x in ('m.urdf', 'm.yaml', 'm.mcap'))
    assert run('export', 'four_bar_nominal', '-o', urdf).returncode == 0
    original = ms.load_scene('four_bar_nominal')
    sets = [x for key, value in (('drive.speed', '36.6519 rad/s'), ('drive.start_angle', '0 deg'),
                                 ('gravity', '[0 m/s^2, -9.8145 m/s^2]'))
            for x in ('--set', f'{key}={value}')]  # fmt: skip
    assert run('import', urdf, '-o', scene, *sets).returncode == 0
    done = run('run', scene, '--duration', '0.2', '--record', bag)
    assert done.returncode == 0, done.stderr
    assert run_json('analyze', bag)['digest'] == ms.simulate(original, duration=0.2).digest()
