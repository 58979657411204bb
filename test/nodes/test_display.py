"""Displays of viewers: markers against other messages of a run, layouts against topics."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from functools import reduce
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from builders import without_work
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from running import environment, run_json

import mechanism_sim as ms
from mechanism_sim import cli
from mechanism_sim.analysis.preview import preview
from mechanism_sim.errors import InputError
from mechanism_sim.messages import seconds
from mechanism_sim.messages.topics import topics_of
from mechanism_sim.nodes.force_markers import SHORTEST, ForceMarkers
from mechanism_sim.planar.gaps import ENDS
from mechanism_sim.planar.mechanism import HigherPair, Revolute
from mechanism_sim.report.layouts import plots, to_foxglove, to_rviz
from ros_interfaces.definitions import field_descriptions

ARROW, CUBE, SPHERE, CYLINDER, STRIP, LINES, TRIANGLES = (
    0,
    1,
    2,
    3,
    4,
    5,
    11,
)  # of visualization_msgs/msg/Marker
ADD, DELETE = 0, 2
RATES = ('markers', 'joint_reactions', 'transforms')
HOMES = {'four_bar_clearance': '', 'whole_machine': '/left/shop'}
SIDES = 'left', 'right'
DURATIONS = {'four_bar_clearance': '0.3 s', 'whole_machine': '0.15 s'}


@pytest.fixture(
    scope='module',
    params=['four_bar_clearance', pytest.param('whole_machine', marks=pytest.mark.slow)],
)
def shown(request, tmp_path_factory) -> SimpleNamespace:
    """A bag of a run with a display, and by topic what a reader of other authors finds in it.

    Names of topics and frames are without the namespace and prefix, which one of the runs has.
    """
    scene, home = request.param, HOMES[request.param]
    bag = tmp_path_factory.mktemp('bags') / f'{scene}.mcap'
    same = [part for name in RATES for part in ('--set', f'outputs.{name}=100 Hz')]
    run_json(
        'run', scene, '--display', '--record', str(bag), *same,
        '--set', f'duration={DURATIONS[scene]}', *(['--namespace', home] if home else []),
        env={**environment(), 'ROS_PYTHON_CHECK_FIELDS': '1'},
    )  # fmt: skip
    found = defaultdict(list)
    with bag.open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        channels = {c.topic.removeprefix(home): c for c in reader.get_summary().channels.values()}
        for _, channel, _, message in reader.iter_decoded_messages():
            found[channel.topic.removeprefix(home)].append(message)
    flashes = [m for m in found['/force_markers'] if m.markers[0].ns == 'impacts']
    samples = {
        round(time_of(m), 9): {(x.ns, x.id): x for x in m.markers}
        for m in found['/force_markers']
        if m.markers[0].ns != 'impacts'
    }
    machine = ms.load_scene(scene, overrides={'duration': DURATIONS[scene]})
    return SimpleNamespace(
        machine=machine, topics=found, channels=channels, flashes=flashes, samples=samples,
        frames=[frames_of(m, home) for m in found['/tf']], home=home, prefix=prefix_of(home),
        seen=preview(machine),
    )  # fmt: skip


def time_of(array):
    return seconds(array.markers[0].header.stamp)


def prefix_of(home):
    return home.lstrip('/') + '/' if home else ''


def frames_of(message, home):
    """Origin (2,) [m] and angle [rad] of each link, by /tf."""
    prefix = prefix_of(home)
    frames = {f'{prefix}world': (np.zeros(2), 0.0)}
    for x in message.transforms:
        assert x.header.frame_id == f'{prefix}world'
        at, q = x.transform.translation, x.transform.rotation
        frames[x.child_frame_id] = (np.array([at.x, at.y]), 2.0 * np.arctan2(q.z, q.w))
    return frames


def in_world(shown, frames, frame, points):
    """Points (k, 2) of a frame, or of a link, in the world."""
    named = 'world' if frame == 'ground' else frame
    origin, a = frames[named if named in frames else f'{shown.prefix}{named}']
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    return np.atleast_2d(points) @ turn.T + origin


def place(p):
    return np.array([p.x, p.y])


@pytest.mark.slow
@pytest.mark.network
def test_markers_are_what_viewers_accept(shown):
    """Unit quaternions, visible colours, ids of their own, known frames, sizes, enough points."""
    arrays = shown.topics['/markers'] + shown.topics['/force_markers']
    assert len(shown.topics['/markers']) == 1
    links = set(shown.frames[0])
    points = {ARROW: lambda n: n == 2, STRIP: lambda n: n > 1}
    points[TRIANGLES] = lambda n: n and n % 3 == 0
    points[LINES] = lambda n: n and n % 2 == 0
    sized = {
        ARROW: 'xyz',
        SPHERE: 'xyz',
        CYLINDER: 'xyz',
        CUBE: 'xyz',
        STRIP: 'x',
        LINES: 'x',
        TRIANGLES: 'xyz',
    }
    for array in arrays:
        names = [(m.ns, m.id) for m in array.markers]
        assert len(set(names)) == len(names) > 0
        for m in array.markers:
            q = m.pose.orientation
            assert q.x**2 + q.y**2 + q.z**2 + q.w**2 == pytest.approx(1.0, abs=1e-15)
            assert m.action in (ADD, DELETE)
            assert m.color.a > 0.0
            assert m.header.frame_id in links
            assert all(getattr(m.scale, axis) > 0.0 for axis in sized[m.type])
            assert points.get(m.type, lambda n: n == 0)(len(m.points))
            numbers = [[p.x, p.y, p.z] for p in (*m.points, m.pose.position, m.scale)]
            assert np.isfinite(numbers).all()
    fixed = shown.topics['/markers'][0].markers
    assert all(m.frame_locked for m in fixed)
    kinds = {'links', 'pins', 'bushings', 'supports', 'centres_of_gravity', 'drives'}
    more = {'cams', 'wheels', 'sliders', 'guides'}
    wanted = kinds | more if shown.machine.name == 'whole_machine' else kinds
    assert {m.ns for m in fixed} == wanted
    assert shown.samples.keys() == {
        round(seconds(m.transforms[0].header.stamp), 9) for m in shown.topics['/tf']
    }


@pytest.mark.slow
@pytest.mark.network
def test_arrows_are_the_reactions_of_the_same_run(shown):
    """By their messages: length and direction, and that they start where the force acts."""
    machine, mechanism = shown.machine, shown.machine.mechanism
    solution = ms.simulate(machine, duration=shown.seen.found.duration)
    columns = without_work(solution, np.linspace(0.0, solution.duration, 20_001))
    forces = [(columns[f'reaction.{j.name}.x'], columns[f'reaction.{j.name}.y'])
              for j in mechanism.joints]  # fmt: skip
    largest = shown.seen.largest
    assert largest == pytest.approx(np.hypot(*np.swapaxes(forces, 0, 1)).max(), rel=1e-3)
    scale = 0.5 * shown.seen.skeleton.size / largest
    missing = 0
    for message, frames in zip(shown.topics['/joint_reactions'], shown.frames, strict=True):
        markers = shown.samples[round(seconds(message.header.stamp), 9)]
        assert list(message.joints) == [j.name for j in mechanism.joints]
        for k, joint in enumerate(mechanism.joints):
            arrow = markers['reactions', k]
            force = np.array([message.force_x[k], message.force_y[k]])
            if arrow.action == DELETE:
                assert scale * np.hypot(*force) <= SHORTEST * shown.seen.skeleton.size
                missing += 1
                continue
            foot, tip = map(place, arrow.points)
            assert tip - foot == pytest.approx(scale * force, abs=1e-12)
            (at,) = in_world(shown, frames, joint.second, joint.on_second)
            if isinstance(joint, HigherPair):
                (x, y), (fx, fy) = foot - at, force
                assert x * fy - y * fx == pytest.approx(message.moment[k], rel=1e-9, abs=1e-12)
                assert (foot - at) @ force == pytest.approx(0.0, abs=1e-12)
            else:
                assert foot == pytest.approx(at, abs=1e-12)
    assert missing  # in flight


@pytest.mark.network
def test_the_lens_shows_the_pin_where_it_is(shown):
    """By the frames of both links, by the gap that another message tells, and touching or not."""
    (joint,) = (
        j for j in shown.machine.mechanism.joints
        if j.name in shown.machine.plan.clearances and isinstance(j, Revolute)
    )  # fmt: skip
    play = shown.machine.plan.clearances[joint.name]
    seen = set()
    for state, frames in zip(shown.topics['/linkage_state'], shown.frames, strict=True):
        markers = shown.samples[round(seconds(state.header.stamp), 9)]
        lens, pin, dot = (markers[x] for x in (('lenses', 0), ('lenses', 1), ('contacts', 0)))
        magnification = 0.5 * (lens.scale.x - pin.scale.x) / play.radial
        assert lens.scale.x == pytest.approx(6.0 * magnification * play.radial)
        out = (place(pin.pose.position) - place(lens.pose.position)) / magnification
        (at,) = in_world(shown, frames, joint.second, joint.on_second)
        assert out == pytest.approx(
            in_world(shown, frames, joint.first, joint.on_first)[0] - at, abs=1e-14
        )
        k = list(state.joints).index(joint.name)
        assert np.hypot(*out) == pytest.approx(play.radial - state.gaps[k], abs=1e-12)
        closed = state.modes[k] > 1
        seen.add(closed)
        assert (dot.action == ADD) == closed
        if closed:
            touch = at + (1.0 + play.pin_radius / play.radial) * out
            assert place(dot.pose.position) == pytest.approx(touch, abs=1e-9)
        assert (pin.color.r > pin.color.b) == closed
    assert True in seen
    assert False in seen or shown.machine.name == 'whole_machine'


@pytest.mark.parametrize('scene', ['gear_rattle', 'valve_train', 'groove_cam'])
def test_lenses_of_other_plays_show_what_is_between_their_walls(scene):
    """Distances drawn, over the magnification, are the gaps of the run; the colour is contact."""
    machine = ms.load_scene(scene)
    seen = preview(machine)
    solution = ms.simulate(machine)
    t = np.linspace(0.0, solution.duration, 200)
    k, dt = solution.motion.curve.find(t)
    observed = machine.physics.observe(solution.motion, k, dt)
    told = solution.sample(t)
    picture = ForceMarkers(seen)
    arrays = picture.at(t, observed, solution.motion.modes[k].T)
    for i, array in enumerate(arrays):
        lenses = [m for m in array.markers if m.ns == 'lenses']
        for pair in seen.plays:
            walls = [lenses.pop(0) for _ in machine.physics.clearances if _.startswith(pair.name)]
            body = lenses.pop(0)
            assert [m.type for m in (*walls, body)] == [*[CUBE] * len(walls), TRIANGLES]
            half = max(p.x for p in body.points)
            assert {abs(p.x) for p in body.points} == {half}  # upright
            right = place(walls[-1].pose.position)[0] - 0.5 * walls[-1].scale.x
            drawn = [right - (place(body.pose.position)[0] + half)]
            gaps = [told[f'gap.{pair.name}' + ('_right' if len(walls) == 2 else '')][i]]
            if len(walls) == 2:
                left = place(walls[0].pose.position)[0] + 0.5 * walls[0].scale.x
                drawn.insert(0, place(body.pose.position)[0] - half - left)
                gaps.insert(0, told[f'gap.{pair.name}_left'][i])
            width = seen.widths[pair.name]
            magnification = 2.0 * 0.04 * seen.skeleton.size / width
            if sum(gaps) == pytest.approx(width, rel=1e-3) or len(walls) == 1:
                assert np.array(drawn) / magnification == pytest.approx(gaps, abs=2e-3 * width)
            modes = [told[n][i] for n in told if n.startswith(f'mode.{pair.name}')]
            assert (body.color.r > body.color.b) == any(mode > 1 for mode in modes)
        assert not lenses or machine.bearings
    assert seen.plays


@pytest.mark.slow
def test_a_block_with_play_is_where_its_corners_are_and_leans_as_they_do():
    """By the gaps that the solution has; as a marker, a corner that touches is at its wall."""
    machine = ms.load_scene('slider_with_play', {'links.slider.cog': ['15 mm', '10 mm']})
    stage, solution = preview(machine), ms.simulate(machine)
    t = np.linspace(0.0, solution.duration, 500)
    k, dt = solution.motion.curve.find(t)
    observed = machine.physics.observe(solution.motion, k, dt)
    frames, told = stage.frames(t, observed, solution.motion.modes[k].T), without_work(solution, t)
    assert [pair.name for pair in stage.plays] == ['guide']
    for n, side in enumerate(('left', 'right')):
        corners = [f'guide_{end}_{side}' for end in ('rear', 'front')]
        middle = np.mean([told[f'gap.{corner}'] for corner in corners], axis=0)
        assert frames.walls[:, 0, n] == pytest.approx(middle, abs=1e-15)
        closed = np.any([told[f'mode.{corner}'] > 1 for corner in corners], axis=0)
        assert ((frames.touching[:, 0] & (1 + n)) > 0).tolist() == closed.tolist()
        assert closed.any()
    assert stage.widths['guide'] == pytest.approx(2e-3, rel=1e-2)  # of a block that turns, too
    gaps = {x: told[f'gap.guide_{x}'] for x in (f'{e}_{s}' for e in ENDS for s in SIDES)}
    lean = gaps['rear_left'] - gaps['front_left']
    assert frames.off[:, 0, 1] == pytest.approx(lean, abs=1e-15)
    assert np.abs(lean).max() > 1e-4
    picture = ForceMarkers(preview(machine))
    made = picture.at(t, observed, solution.motion.modes[k].T)
    for i, array in enumerate(made):
        cubes = [m for m in array.markers if m.ns == 'lenses' and m.type == CUBE]
        (body,) = (m for m in array.markers if m.ns == 'lenses' and m.type == TRIANGLES)
        corners = [place(body.pose.position) + place(p) for p in body.points[:3]]
        rear, front = (
            corners[:2],
            [corners[2] - [np.ptp([c[0] for c in corners[:2]]), 0], corners[2]],
        )
        inner = [
            c.pose.position.x - s * 0.5 * c.scale.x for c, s in zip(cubes, (-1, 1), strict=True)
        ]
        times = (inner[1] - inner[0] - (rear[1] - rear[0])[0]) / stage.widths['guide']
        for end, (left, right) in (('rear', rear), ('front', front)):
            for side, gap in (('left', left[0] - inner[0]), ('right', inner[1] - right[0])):
                wanted = times * gaps[f'{end}_{side}'][i]
                assert gap == pytest.approx(wanted, abs=2e-5 * times)


@pytest.mark.network
def test_every_impact_flashes_once_at_its_joint(shown):
    impacts = shown.topics['/impacts']
    assert len(shown.flashes) == len(impacts) > 10
    by_index = {m.markers[0].id: m.markers[0] for m in shown.flashes}
    joints = {j.name: j for j in shown.machine.mechanism.joints}
    hardest = max((i.normal_impulse for i in shown.seen.found.solution.impacts), default=0.0)
    for impact in impacts:
        flash = by_index[impact.index]
        assert seconds(flash.header.stamp) == seconds(impact.header.stamp)
        assert flash.lifetime.sec == 0 < flash.lifetime.nanosec
        name = re.sub('_(left|right)$', '', impact.joint)
        joint = joints[name]
        link = 'world' if joint.second == 'ground' else joint.second
        assert flash.header.frame_id == f'{shown.prefix}{link}'
        assert tuple(place(flash.pose.position)) == joint.on_second
        hardest = max(hardest, impact.normal_impulse)
        share = max(impact.normal_impulse / hardest, 1e-3)
        assert flash.scale.x == pytest.approx(4.0 * shown.seen.skeleton.symbol * share ** (1 / 3))


@pytest.mark.network
def test_shapes_move_with_the_frames(shown):
    """Bushings around the pins of ideal joints, teeth at the tips, springs between their ends."""
    fixed = {(m.ns, m.id): m for m in shown.topics['/markers'][0].markers}
    mechanism = shown.machine.mechanism
    revolute = [j for j in mechanism.joints if isinstance(j, Revolute)]
    loose = [j for j in revolute if j.name in shown.machine.plan.clearances]
    rings = [m for (ns, _), m in sorted(fixed.items()) if ns == 'bushings' and m.type == LINES]
    assert len(rings) == len(loose)
    pins = [m for (ns, _), m in sorted(fixed.items()) if ns == 'pins' and m.type == LINES]
    assert len(pins) == len(revolute)
    for frames in shown.frames[:: len(shown.frames) // 3]:
        middles = [
            in_world(shown, frames, m.header.frame_id, [place(p) for p in m.points]).mean(axis=0)
            for m in pins
        ]
        for ring, joint in zip(rings, loose, strict=True):
            around = in_world(shown, frames, ring.header.frame_id, [place(p) for p in ring.points])
            apart = min(np.hypot(*(middle - around.mean(axis=0))) for middle in middles)
            assert apart < 1.001 * shown.machine.plan.clearances[joint.name].radial + 1e-9
    for k, joint in enumerate(j for j in mechanism.joints if hasattr(j, 'wheels')):
        wheels = [m for (ns, _), m in fixed.items() if ns == 'wheels' and m.type == LINES]
        tips = sorted(max(np.hypot(p.x, p.y) for p in m.points) for m in wheels)
        assert k == 0
        assert tips == pytest.approx(sorted(t.gear.tip_radius for t in joint.wheels), rel=1e-3)
    coils = [m for sample in shown.samples.values() for m in sample.values() if m.ns == 'springs']
    assert bool(coils) == (shown.machine.name == 'whole_machine')
    for coil, frames in zip(coils, shown.frames, strict=False):
        (spring,) = shown.seen.skeleton.springs
        for end, point in zip(spring, (coil.points[0], coil.points[-1]), strict=True):
            assert place(point) == pytest.approx(in_world(shown, frames, *end)[0], abs=1e-12)


@pytest.mark.network
def test_the_description_has_the_frames_of_the_links(shown):
    robot = ElementTree.fromstring(shown.topics['/robot_description'][0].data)
    assert set(shown.frames[0]) <= {link.get('name') for link in robot.iter('link')}


PATH = re.compile(r'(/[\w/]+)(?:\{(\w+)=="([^"]+)"\})?\.([\w.]+)(\[(?:\d+|:)\])?')


def layout(tmp_path, scene, viewer, *options) -> str:
    file = tmp_path / 'layout'
    with pytest.raises(SystemExit) as ended:
        cli.main(['export', scene, '--format', viewer, '-o', str(file), *options])
    assert not ended.value.code
    return file.read_text(encoding='utf-8')


def panels_of(tree) -> list[str]:
    if isinstance(tree, str):
        return [tree]
    return [*panels_of(tree['first']), *panels_of(tree['second'])]


@pytest.mark.network
def test_every_path_of_a_foxglove_layout_leads_somewhere_in_the_bag(shown):
    made = json.loads(to_foxglove(shown.seen, shown.home, shown.prefix))
    panels = made['configById']
    tabs = [x for tab in panels['Tab!plots']['tabs'] for x in panels_of(tab['layout'])]
    assert sorted([*panels_of(made['layout']), *tabs]) == sorted(panels)
    scene = panels['3D!machine']
    topics = [*scene['topics'], scene['layers']['robot']['topic']]
    topics += [p['topicPath'] for p in panels.values() if 'topicPath' in p]
    assert {name.removeprefix(shown.home) for name in topics} <= set(shown.topics)
    assert all(name.startswith(shown.home) for name in topics)
    assert {name.removeprefix('frame:') for name in scene['transforms']} < set(shown.frames[0])
    assert {scene['followTf'], scene['layers']['grid']['frameId']} == {f'{shown.prefix}world'}
    states = shown.topics['/linkage_state'][0]
    lines = [(p, line) for p in panels.values() for line in p.get('paths', ())]
    assert len(lines) > 20
    for panel, line in lines:
        assert re.search(r'\[(rad|m|N|J|N m|N s|rad/s|m/s|m/s\^2)\]', panel['title'])
        topic, key, name, field, index = PATH.fullmatch(line['value']).groups()
        topic = topic.removeprefix(shown.home)
        messages = shown.topics[topic]
        if key:
            assert topic != '/impacts' or name in states.joints
            messages = [m for m in messages if getattr(m, key) == name]
            if topic == '/impacts' and not messages:
                continue
        values = [reduce(getattr, field.split('.'), m) for m in messages]
        assert values
        if index is None or panel['xAxisVal'] == 'index':
            assert np.isfinite(np.hstack(values)).all()
        else:
            k = int(index[1:-1])
            assert all(np.isfinite(v[k]) for v in values)
            first = messages[0]
            names = getattr(first, 'name', None) or (
                first.joints if hasattr(first, 'force_x') or 'gap' in field or 'norm' in field
                else first.coordinates
            )  # fmt: skip
            assert names[k] == line['label']


@pytest.mark.network
def test_the_views_hold_the_machine(shown):
    """All origins of frames lie within what both viewers show."""
    origins = np.array([at for frames in shown.frames for at, _ in frames.values()])
    made = json.loads(to_foxglove(shown.seen, shown.home, shown.prefix))
    camera = made['configById']['3D!machine']['cameraState']
    away = np.abs(origins - camera['targetOffset'][:2])
    assert (away < 0.5 * camera['distance']).all()
    assert away.max() > 0.15 * camera['distance']
    view = yaml.safe_load(to_rviz(shown.seen, shown.home, shown.prefix))['Visualization Manager']
    current = view['Views']['Current']
    away = np.abs(origins - [current['X'], current['Y']]) * current['Scale']  # pixels
    assert (away < [400.0, 325.0]).all()
    assert away.max() > 100.0


@pytest.mark.network
def test_rviz_asks_for_topics_and_frames_of_the_bag(shown):
    made = yaml.safe_load(to_rviz(shown.seen, shown.home, shown.prefix))
    manager = made['Visualization Manager']
    displays = {d['Class'].partition('/')[2]: d for d in manager['Displays']}
    assert set(displays) == {'TF', 'MarkerArray', 'RobotModel'}
    assert set(displays['TF']['Frames']) - {'All Enabled'} == set(shown.frames[0])
    asked = [d.get('Topic') or d['Description Topic'] for d in manager['Displays'][1:]]
    for topic in asked:
        (offered,) = yaml.safe_load(
            shown.channels[topic['Value'].removeprefix(shown.home)].metadata[
                'offered_qos_profiles'
            ]
        )
        assert offered['reliability'] == topic['Reliability Policy'].lower()
        assert offered['durability'].replace('_', ' ') == topic['Durability Policy'].lower()
    assert manager['Global Options']['Fixed Frame'] == f'{shown.prefix}world'


def test_names_of_a_second_machine_have_its_namespace_and_prefix(tmp_path, capsys):
    options = '--namespace', 'left/shop', '--frame-prefix', 'left_'
    made = json.loads(layout(tmp_path, 'four_bar_nominal', 'foxglove', *options))['configById']
    paths = [x['value'] for p in made.values() for x in p.get('paths', ())]
    assert all(path.startswith('/left/shop/') for path in paths)
    frames = {f'frame:left_{link}' for link in ('crank', 'coupler', 'rocker')}
    assert set(made['3D!machine']['transforms']) == frames
    rviz = layout(tmp_path, 'four_bar_nominal', 'rviz', *options)
    assert rviz.count('/left/shop/') == 3
    with pytest.raises(SystemExit) as ended:
        cli.main(['export', 'four_bar_nominal', '--format', 'rviz', '--namespace', '1 2'])
    assert ended.value.code == 2
    assert "'1 2' is no namespace" in capsys.readouterr().err


@pytest.mark.parametrize(
    ('scene', 'group'),
    [('geneva', 'Geneva'), ('gear_housing', 'Oscillators'), ('oscillating_roller', 'Cam')],
)
def test_paths_of_other_parts_follow_the_definitions(scene, group):
    machine = ms.load_scene(scene)
    kinds = {f'/{t.name}': t.kind for t in topics_of(machine, display=True)}
    assert group in {plot.group for plot in plots(machine)}
    for plot in plots(machine):
        for path in plot.paths.values():
            topic, _, _, field, _ = PATH.fullmatch(path).groups()
            name = kinds[topic].__msgtype__
            assert field.split('.')[0] in {f for f, _ in field_descriptions(name)}


def test_without_masses_there_are_no_arrows():
    bare = preview(ms.load_scene('four_bar_nominal', overrides={'outputs.forces': False}))
    assert ForceMarkers(bare).empty
    assert not [p for p in plots(bare.machine) if p.group == 'Forces']


def test_sizes_are_the_users_to_choose():
    seen = preview(ms.load_scene('four_bar_clearance'))
    picture = ForceMarkers(seen, 'left/', force_scale=2e-3, magnification=400.0)
    solution, t = seen.found.solution, np.array([0.05])
    o = solution.view(t).observed
    (array,) = picture.at(t, o, solution.motion.modes_at(*solution.motion.curve.find(t)))
    markers = {(m.ns, m.id): m for m in array.markers}
    arrow = markers['reactions', 0]
    foot, tip = map(place, arrow.points)
    assert np.hypot(*(tip - foot)) == pytest.approx(2e-3 * np.hypot(*o.reaction[0, :, 0]))
    radial = seen.machine.plan.clearances['coupler_rocker'].radial
    lens, pin = (markers['lenses', k].scale.x for k in range(2))
    assert 0.5 * (lens - pin) == pytest.approx(400.0 * radial)
    assert pin > 0.0


@pytest.mark.parametrize('name', ['force_scale', 'magnification'])
def test_a_size_that_is_none_is_refused(name):
    seen = preview(ms.load_scene('four_bar_nominal'))
    for value in (-1.0, np.nan, np.inf):
        with pytest.raises(InputError, match=f'{name} must be finite and not negative'):
            ForceMarkers(seen, **{name: value})
