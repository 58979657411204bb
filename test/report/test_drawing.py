"""Pictures of mechanisms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builders import made
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.catalogue import scene_names
from mechanism_sim.cli import main
from mechanism_sim.export.shapes import encloses
from mechanism_sim.export.skeleton import Skeleton, skeleton_of
from mechanism_sim.joints.geneva.constraint import Geneva
from mechanism_sim.joints.rack.constraint import SlottedRack
from mechanism_sim.joints.slot.constraint import PinInSlot
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.mechanism import Mechanism, Prismatic, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.report import drawing, figures
from mechanism_sim.results.cycle import instant

ORIGIN = (0.0, 0.0)

CROWDED = (
    'andrews_squeezer', 'double_toggle_punch', 'dump_truck', 'four_bar_clearance', 'gear_box',
    'geneva', 'hand_pump', 'loader', 'locking_pliers', 'planetary', 'quick_return_shaper',
    'rotary_engine', 'ten_links', 'valve_train', 'whole_machine', 'windshield_wiper',
)  # fmt: skip
"""Scenes with many names, or with names close together; the gallery has them all."""


def shapes(skeleton, kind):
    return [shape for shape in skeleton.shapes if shape.kind == kind]


def skeleton_at(found):
    return skeleton_of(found.machine, found.solution.view(found.t).observed.position)


def pose_at(found, skeleton, t):
    return skeleton.poses(found.solution.view(np.array([t])).observed.position)


def overlapping(figure):
    """Pairs of texts of a drawn figure whose boxes, turned as they are, have a place in common."""
    boxes = []
    for text in figure.axes[0].texts:
        turn = np.radians(text.get_rotation())
        text.set_rotation(0.0)
        box = text.get_window_extent()
        text.set_rotation(np.degrees(turn))
        middle = 0.5 * (box.min + box.max)
        if text.get_va() == 'center':
            middle = text.get_transform().transform(text.get_position())
        sides = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        boxes.append((text.get_text(), middle, 0.46 * box.size, sides))
    for i, (name, at, half, sides) in enumerate(boxes):
        for other, there, others, turned in boxes[:i]:
            apart = np.concatenate([sides, turned]) @ (there - at)
            reach = np.abs(np.concatenate([sides, turned]) @ sides.T) @ half
            reach += np.abs(np.concatenate([sides, turned]) @ turned.T) @ others
            if (np.abs(apart) < reach).all():
                yield name, other


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    'scene',
    [
        *CROWDED,
        *(pytest.param(x, marks=pytest.mark.slow) for x in scene_names() if x not in CROWDED),
    ],
)
def test_names_do_not_cover_each_other(scene):
    machine = ms.load_scene(scene)
    found, t = instant(machine, still=True)
    with figures.style():
        figure = drawing.draw(found, t)
    text = {x.get_text() for x in figure.axes[0].texts}
    assert machine.scene.title in text
    assert {b.name.replace('_', ' ') for b in machine.mechanism.bodies} <= text
    figure.canvas.draw()
    assert not list(overlapping(figure))


@pytest.mark.slow
def test_names_longer_than_their_bars_do_not_cover_each_other():
    """A hanging chain of twenty, to and fro."""
    rods = [f'connecting_rod_{k}' for k in range(20)]
    bar = {'length': '100 mm', 'cog': '50 mm', 'mass': '0.1 kg', 'inertia': 1e-4}
    ends = ['ground', *(f'{rod}.end' for rod in rods)]
    chain = {
        'title': 'Chain', 'mechanism': 'linkage', 'links': dict.fromkeys(rods, bar),
        'joints': {
            f'bearing_{k}': {'revolute': [ends[k], rod]} for k, rod in enumerate(rods)
        },
        'initial': {
            'position': {rod: f'{-60 - 60 * (k % 2)} deg' for k, rod in enumerate(rods)}
        },
        'duration': '0.1 s',
    }  # fmt: skip
    figure = ms.draw(made(chain))
    figure.canvas.draw()
    assert not list(overlapping(figure))


def test_bars_reach_from_joint_to_joint():
    machine = ms.load_scene('four_bar_nominal')
    found, t = instant(machine, angle=math.radians(50.0))
    pose = pose_at(found, skeleton := skeleton_at(found), t)
    links = {
        s.label: skeleton.placed(s.link, s.outline, pose)[0] for s in shapes(skeleton, 'link')
    }
    A = 0.064 * np.array([np.cos(np.radians(50.0)), np.sin(np.radians(50.0))])
    np.testing.assert_allclose(
        sorted(links['crank'].tolist()), sorted([[0, 0], A.tolist()]), atol=1e-12
    )
    B, O4 = links['rocker'][np.argsort(-links['rocker'][:, 1])]
    np.testing.assert_allclose(O4, [0.387, 0.0], atol=1e-12)
    assert np.hypot(*(B - A)) == pytest.approx(0.309, abs=1e-12)
    assert {s.label for s in shapes(skeleton, 'pin')} == {j.name for j in machine.mechanism.joints}
    assert len(shapes(skeleton, 'support')) == 2


def test_a_slider_has_a_rail_as_long_as_its_stroke():
    """An offset slider-crank, its guide inclined: crank 50 mm, rod 200 mm."""
    tilt = math.radians(30.0)
    mechanism = Mechanism(
        tuple(Body(name, 1.0, 1.0, ORIGIN) for name in ('crank', 'rod', 'piston')),
        (
            Revolute('ground_crank', GROUND, 'crank', ORIGIN, ORIGIN),
            Revolute('crank_rod', 'crank', 'rod', (0.05, 0.0), ORIGIN),
            Revolute('rod_piston', 'rod', 'piston', (0.2, 0.0), ORIGIN),
            Prismatic('piston_ground', GROUND, 'piston', ORIGIN, ORIGIN, tilt, tilt),
        ),
        ('rod_piston',),
    )
    crank = np.linspace(0.0, 2.0 * np.pi, 61)
    rod = -np.arcsin(0.25 * np.sin(crank))
    piston = 0.05 * np.cos(crank) + 0.2 * np.cos(rod)
    q = np.array([crank + tilt, rod + tilt, piston])
    skeleton = Skeleton(mechanism, q)
    (rail,), (box,) = shapes(skeleton, 'rail'), shapes(skeleton, 'slider')
    ends = rail.outline @ [math.cos(tilt), math.sin(tilt)]
    spare = 2.5 * skeleton.symbol
    np.testing.assert_allclose(ends, [0.15 - spare, 0.25 + spare], atol=1e-12)
    at = skeleton.placed(box.link, box.outline, skeleton.poses(q[:, :1]))[0]
    np.testing.assert_allclose(at.mean(axis=0), 0.25 * np.array([math.cos(tilt), math.sin(tilt)]))
    side = at[1] - at[0]
    assert math.atan2(side[1], side[0]) == pytest.approx(tilt)
    assert [len(s.outline) for s in shapes(skeleton, 'link') if s.label == 'piston'] == [1]


def test_a_slot_is_as_long_as_its_pin_needs_and_plates_have_all_their_corners():
    """A Scotch yoke: the pin of the crank in an upright slot of the yoke."""
    mechanism = Mechanism(
        tuple(Body(name, 1.0, 1.0, ORIGIN) for name in ('crank', 'yoke')),
        (
            Revolute('ground_crank', GROUND, 'crank', ORIGIN, ORIGIN),
            Prismatic('ground_yoke', GROUND, 'yoke', ORIGIN, (0.2, 0.0)),
            PinInSlot('crank_yoke', 'crank', 'yoke', (0.05, 0.0), ORIGIN, 0.5 * math.pi),
        ),
        ('crank_yoke',),
    )
    crank = np.linspace(0.0, 2.0 * np.pi, 61)
    q = np.array([crank, 0.2 + 0.05 * np.cos(crank)])
    skeleton = Skeleton(mechanism, q, {'yoke.mark': ('yoke', (0.1, 0.1))})
    (slot,) = shapes(skeleton, 'slot')
    spare = 2.5 * skeleton.symbol
    np.testing.assert_allclose(slot.outline, [[0, -0.05 - spare], [0, 0.05 + spare]], atol=1e-12)
    assert slot.link == 'yoke'
    yoke = next(s for s in shapes(skeleton, 'link') if s.label == 'yoke')
    assert len(yoke.outline) == 3  # where it slides, its mark, and the slot where it is nearest


@pytest.mark.parametrize('scene', ['geneva', 'linear_intermittent'])
def test_a_pin_that_indexes_is_in_a_slot_while_something_moves(scene):
    """In the open of the wheel, or in the inner curve of one of the rack's slots."""
    found = ms.cycle(ms.load_scene(scene), samples=120)
    driven = next(c for c in found.machine.mechanism.coordinates if c != found.drive)
    moving = np.abs(found[f'velocity.{driven}']) > 1e-6
    assert 10 < moving.sum() < 100
    skeleton = skeleton_at(found)
    poses = skeleton.poses(found.solution.view(found.t).observed.position)
    (pin,) = (s for s in shapes(skeleton, 'pin') if s.link == 'crank')
    at = skeleton.placed(pin.link, pin.outline, poses)[:, 0]
    slots = shapes(skeleton, 'slot') or [s for s in shapes(skeleton, 'wheel') if s.link == driven]
    assert slots
    for k in np.flatnonzero(moving):
        open_at = False
        for slot in slots:
            curves = [
                skeleton.placed(slot.link, c, poses[k : k + 1])[0] for c in slot.paths[-1][1]
            ]
            open_at |= encloses(curves[0], at[k]) == (slot.kind == 'slot')
        assert open_at
    if scene == 'geneva':  # and the disc of the crank is in the hollow while nothing moves
        (disc,) = (s for s in shapes(skeleton, 'wheel') if s.link == 'crank')
        for k in np.flatnonzero(~moving):
            (wheel,) = (skeleton.placed(driven, s.outline, poses[k : k + 1])[0] for s in slots)
            edge = skeleton.placed('crank', disc.outline, poses[k : k + 1])[0]
            assert not any(encloses(wheel, point) for point in edge)


@pytest.mark.parametrize('scene', ['geneva', 'linear_intermittent'])
def test_slots_are_as_deep_as_the_pin_goes_however_short_the_run(scene):
    """Also of an instant at which the pin is in none: the depth follows from the distances."""
    found = ms.cycle(ms.load_scene(scene), samples=60)
    q = found.solution.view(found.t).observed.position
    (pair,) = (j for j in found.machine.mechanism.joints if isinstance(j, Geneva | SlottedRack))
    for k in (0, 17, 31, 48):
        skeleton = skeleton_of(found.machine, q[:, k : k + 1])
        if scene == 'linear_intermittent':
            for slot in shapes(skeleton, 'slot'):
                long = np.hypot(*np.ptp(slot.outline, axis=0))
                assert long == pytest.approx(0.5 * pair.pitch + 3.0 * skeleton.symbol)
            continue
        (wheel,) = (s for s in shapes(skeleton, 'wheel') if s.link == pair.second)
        radii = np.hypot(*(wheel.outline - pair.on_second).T)
        crank = math.sqrt(pair.distance**2 - pair.entry**2)
        assert radii.max() == pytest.approx(pair.entry, rel=1e-3)
        assert radii.min() == pytest.approx(pair.distance - crank, abs=skeleton.symbol)


def test_from_python_in_one_line():
    machine = ms.load_scene('four_bar_nominal')
    figure = ms.draw(machine, math.radians(50.0), positions=3, points=['coupler.cog'])
    crank = machine.scene.links['crank'].length
    (pin,) = (x for x in figure.axes[0].patches if x.get_gid() == 'pin-crank_coupler')
    outline = (pin.get_transform() - figure.axes[0].transData).transform_path(pin.get_path())
    middle = outline.vertices[:-1].mean(axis=0)
    turn = np.radians(50.0)
    np.testing.assert_allclose(middle, [crank * np.cos(turn), crank * np.sin(turn)], atol=1e-12)
    assert figure._repr_png_()[0].startswith(b'\x89PNG')


def test_an_angle_and_the_time_of_it_give_the_same_picture(tmp_path):
    machine = ms.load_scene('four_bar_nominal')
    t = math.radians(50.0) / machine.drive.law.coefficients[1]
    files = [tmp_path / 'angle.svg', tmp_path / 'time.svg']
    for file, at in zip(files, ('50 deg', f'{t!r} s'), strict=True):
        found = run_json('draw', 'four_bar_nominal', '-o', str(file), '--at', at)
        assert found['t'] == pytest.approx(t, rel=1e-14)
    assert files[0].read_bytes() == files[1].read_bytes()


def test_ghosts_and_paths_are_drawn(tmp_path):
    file = tmp_path / 'picture.png'
    done = run(
        'draw', 'four_bar_nominal', '--output', str(file), '--positions', '6',
        '--path', 'coupler.cog', '--labels', 'none',
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(file)
    assert file.read_bytes().startswith(b'\x89PNG')


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('--path', 'cupler.cog'), "did you mean 'coupler.cog'"),
        (('--at', '50'), "write for example '30 deg' or '20 ms'"),
        (('--at', '-1 s'), 'a run begins at 0 s'),
        (('--positions', '0'), '--positions must be at least 1'),
        (('-o', 'picture.jpg'), 'the ending must be .png, .svg or .pdf'),
    ],
)
def test_bad_input_is_one_sentence(arguments, words, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(['draw', 'four_bar_nominal', *arguments])
    assert stopped.value.code == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count('\n') == 1


def test_a_motor_shows_in_which_sense_it_turns():
    for ratio, label in ((12.5, 'arc'), (-12.5, 'clockwise')):
        machine = ms.load_scene('toggle_press', {'drive.motor.ratio': ratio})
        rest = np.zeros((len(machine.mechanism.coordinates), 1))
        (arrow,) = shapes(skeleton_of(machine, rest), 'drive')
        assert arrow.label == label


@pytest.mark.parametrize('speed', [2.0, -2.0])
def test_the_arrow_of_a_drive_points_along_its_way_in_whichever_order_links_stand(speed):
    """As the motion itself goes, and on the frame, which rests; a crank's turns on its bearing."""
    guide = {'prismatic': ['ground', 'block'], 'axis': '30 deg', 'angle': '20 deg'}
    turned = {'prismatic': ['block', 'ground'], 'axis': '10 deg', 'angle': '-20 deg'}
    for joint in (guide, turned):
        machine = made({
            'links': {'block': {'mass': 1.0}}, 'joints': {'guide': joint},
            'drive': {'coordinate': 'block', 'speed': speed}, 'duration': 1.0,
        })  # fmt: skip
        solution = ms.simulate(machine)
        (arrow,) = shapes(skeleton_of(machine, solution.view([0.0]).observed.position), 'drive')
        assert arrow.link == GROUND
        seen = solution.sample([0.0, 1.0], 'position.block.start.x', 'position.block.start.y')
        gone = np.diff([seen['position.block.start.x'], seen['position.block.start.y']])[:, 0]
        assert np.diff(arrow.outline, axis=0)[0] == pytest.approx(gone / abs(speed), abs=1e-12)
    drawn = []
    for ends in (['ground', 'arm.end'], ['arm.end', 'ground']):
        machine = made({
            'links': {'arm': {'length': 0.3}}, 'joints': {'pin': {'revolute': ends}},
            'drive': {'coordinate': 'arm', 'speed': speed, 'start_angle': 3.5},
        })  # fmt: skip
        drawn += shapes(skeleton_of(machine, np.array([[3.5]])), 'drive')
    assert [arrow.link for arrow in drawn] == [GROUND, GROUND]
    assert drawn[0].outline == pytest.approx(drawn[1].outline)
    assert {arrow.label for arrow in drawn} == {'arc' if speed > 0.0 else 'clockwise'}


@pytest.mark.parametrize(
    ('scene', 'teeth'),
    [('bevel_pair', {'pinion': 20, 'wheel': 40}), ('worm_drive', {'wheel': 30})],
)
def test_gears_on_shafts_at_an_angle_have_their_teeth(scene, teeth):
    """As many as cross the circle on which they work; those of bevel gears lower by their cone."""
    machine = ms.load_scene(scene)
    skeleton = skeleton_of(machine, machine.assembly.q[:, None])
    (pair,) = (j for j in machine.mechanism.joints if j.name == 'pair')
    for shape in shapes(skeleton, 'wheel'):
        if shape.link in teeth:
            radius = pair.radii[(pair.first, pair.second).index(shape.link)]
            far = np.hypot(*shape.outline.T) - radius
            assert np.count_nonzero((far > 0.0) & (np.roll(far, 1) <= 0.0)) == teeth[shape.link]
            height = far.max() * teeth[shape.link] / (2.0 * radius)  # in modules
            cone = math.atan2(teeth[shape.link], 60 - teeth[shape.link])
            assert height == pytest.approx(math.cos(cone) if scene == 'bevel_pair' else 1.0)
