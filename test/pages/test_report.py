"""Contents of a page by other formulas: places, forces, instants; and refusals."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from bags import write_bag
from builders import EVERY_KIND, ROUGH, simulated
from live_pages import unpacked
from running import run as command
from running import run_json
from scipy.interpolate import CubicHermiteSpline

import mechanism_sim as ms
from mechanism_sim.analysis.collectors import Signal
from mechanism_sim.analysis.record import Record, read_record
from mechanism_sim.errors import InputError
from mechanism_sim.export.stage import packed, stage_of
from mechanism_sim.pages import charts, report
from mechanism_sim.pages import recorded as frames
from mechanism_sim.planar.mechanism import Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.results.measures import Measurement


@pytest.fixture(scope='module')
def loose():
    """Three turns with impacts, sliding and following."""
    return simulated('four_bar_clearance', ROUGH, revolutions=3)


def at(poses, link, place):
    """A point of a link in the world, from the pose of the link alone."""
    if link == GROUND:
        return np.tile(place, (len(poses), 1))
    x, y, angle = poses[:, link].T
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([x + c * place[0] - s * place[1], y + s * place[0] + c * place[1]], axis=1)


@pytest.mark.sample(6)
@pytest.mark.parametrize('scene', EVERY_KIND)
def test_links_meet_at_their_joints(scene):
    """Poses of links that no coordinate names; what is loose is as far apart as its pin says."""
    record = simulated(scene, duration=0.05)
    t = np.linspace(0.0, record.end, 23)
    samples = record.piece.view(t)
    stage = stage_of(record.machine, samples.observed)
    found = stage.frames(t, samples.observed, samples.modes)
    told = stage.to_json()
    json.dumps(told, allow_nan=False)
    assert found.poses.shape == (len(t), len(told['links']), 3)
    assert (np.abs(found.poses[:, :, 2]) <= np.pi).all()
    number = {name: i for i, name in enumerate(told['links'])} | {GROUND: GROUND}
    bearings = [b['joint'] for b in told['bearings']]
    for joint in record.machine.mechanism.joints:
        if isinstance(joint, Revolute):
            first = at(found.poses, number[joint.first], joint.on_first)
            second = at(found.poses, number[joint.second], joint.on_second)
            apart = first - second
            if joint.name in bearings:
                apart -= found.pins[:, bearings.index(joint.name)]
            assert np.abs(apart).max() < 1e-11 * record.machine.mechanism.reach
    assert [s['kind'] for s in told['shapes']] == [s.kind for s in stage.skeleton.shapes]
    left, bottom, right, top = told['bounds']
    for shape in stage.skeleton.shapes:
        x, y = np.moveaxis(stage.skeleton.placed(shape.link, shape.hull, found.poses), -1, 0)
        assert (x > left).all(), shape
        assert (x < right).all(), shape
        assert (y > bottom).all(), shape
        assert (y < top).all(), shape


def test_arrows_stay_on_the_stage():
    """The catapult's are longest at its start, and point away from it."""
    record = simulated('catapult')
    samples = record.piece.view(np.linspace(record.start, record.end, 50))
    stage = stage_of(record.machine, samples.observed)
    found = stage.frames(samples.t, samples.observed, samples.modes)
    for k, joint in enumerate(stage.joints):
        if isinstance(joint, Revolute) and joint.second in stage.links:
            foot = at(found.poses, stage.links.index(joint.second), joint.on_second)
            tip = foot[0] + stage.force_scale * found.forces[0, k]
            assert (tip >= stage.low - 1e-9).all()
            assert (tip <= stage.high + 1e-9).all()


@pytest.mark.parametrize('scene', ['gear_rattle', 'groove_cam', 'valve_train', 'whole_machine'])
def test_plays_are_the_gaps_of_the_solution(scene):
    """By quantities of the solution: both walls of slots and teeth, the one that a cam is left."""
    record = simulated(scene, duration=0.2)
    t = np.linspace(record.start, record.end, 301)
    samples, told = record.piece.view(t), record.piece.sample(t)
    stage = stage_of(record.machine, samples.observed)
    found = stage.frames(t, samples.observed, samples.modes)
    plays = stage.to_json()['plays']
    assert [p['joint'] for p in plays] == [
        j.name for j in record.machine.mechanism.joints if j in stage.plays
    ]
    assert plays
    for k, play in enumerate(plays):
        left, right = found.walls[:, k].T
        name = play['joint']
        if play['walls'] == 2:
            np.testing.assert_array_equal(left, told[f'gap.{name}_left'])
            np.testing.assert_array_equal(right, told[f'gap.{name}_right'])
            assert left + right == pytest.approx(play['width'], rel=1e-9)
        else:
            np.testing.assert_array_equal(right, told[f'gap.{name}'])
            assert np.isnan(left).all()
            assert right.max() <= play['width'] * (1.0 + 1e-12)
            assert scene != 'valve_train' or right.max() == play['width']  # it lifts off
        apart = 1e-6 * play['width']
        assert (np.nan_to_num(left, nan=1.0)[found.touching[:, k] & 1 == 1] < apart).all()
        assert (right[found.touching[:, k] & 2 == 2] < apart).all()
        assert (right[found.touching[:, k] & 2 == 0] > -apart).all()
    json.dumps(found.packed(), allow_nan=False)


def test_rotors_can_be_seen_to_turn():
    """The differential's links are but axes."""
    record = simulated('differential', duration=0.1)
    stage = stage_of(record.machine, record.piece.view(np.linspace(0.0, 0.1, 9)).observed)
    lengths = [
        np.hypot(*np.ptp(shape.outline, axis=0))
        for shape in stage.skeleton.shapes
        if shape.kind == 'link'
    ]
    assert len(lengths) == len(set(lengths)) == 4
    assert min(lengths) > stage.skeleton.symbol


def test_forces_make_links_move_as_they_do():
    """Newton: what acts on each link in its joints, and weight, is mass times acceleration."""
    record = simulated('four_bar_nominal', revolutions=1)
    mechanism, h = record.machine.mechanism, 1e-4
    t = np.linspace(0.2, 0.8, 9) * record.end
    around = [record.piece.view(t + k * h) for k in (-1, 0, 1)]
    stage = stage_of(record.machine, around[1].observed)
    before, now, after = (stage.frames(s.t, s.observed, s.modes) for s in around)
    for i, body in enumerate(mechanism.bodies):
        a, b, c = (at(f.poses, i, body.cog) for f in (before, now, after))
        wanted = body.mass * ((a - 2.0 * b + c) / h**2 - mechanism.gravity)
        force = np.zeros_like(wanted)
        for k, joint in enumerate(stage.joints):
            sign = (joint.second == body.name) - (joint.first == body.name)
            force += sign * now.forces[:, k]
        assert force == pytest.approx(wanted, abs=2e-3 * np.abs(wanted).max())


def test_forces_of_teeth_act_where_they_touch():
    """On the line of action, which is tangent to both base circles ([V] 5.4)."""
    record = simulated('gear_pair', revolutions=1)
    t = np.linspace(0.1, 0.9, 7) * record.end
    samples = record.piece.view(t)
    stage = stage_of(record.machine, samples.observed)
    found = stage.frames(t, samples.observed, samples.modes)
    k = next(i for i, joint in enumerate(stage.joints) if 'foot' in stage.to_json()['joints'][i])
    mesh = stage.joints[k]
    force = found.forces[:, k]
    along = force / np.hypot(*force.T)[:, None]
    for teeth, (link, centre) in zip(mesh.wheels, mesh.points, strict=True):
        arm = found.feet[:, 0] - at(found.poses, stage.links.index(link), centre)
        lever = np.abs(arm[:, 0] * along[:, 1] - arm[:, 1] * along[:, 0])
        assert lever == pytest.approx(np.full(len(t), teeth.gear.base_radius), rel=1e-9)


def test_instants_of_a_run(loose):
    found = frames.recorded(loose)
    t = found.frames.t
    assert (np.diff(t) > 0.0).all()
    assert (t[0], t[-1]) == (loose.start, loose.end)
    angle = loose.piece.motion.curve(t)[:, 0]
    turns = (angle[-1] - angle[0]) / (2.0 * np.pi)
    assert np.diff(angle).max() < 2.0 * np.pi / frames.PER_TURN
    events = {impact.t for impact in loose.piece.impacts}
    assert events <= set(t.tolist())
    assert len(t) < 1.5 * frames.PER_TURN * turns + 300 + 2 * (
        len(events) + len(loose.piece.modes)
    )
    # before an impact the mode is the old one, from it on the new one
    change = next(c for c in loose.piece.modes if c.previous.name == 'FOLLOWING' or c.previous > 2)
    i = int(np.flatnonzero(t == change.t)[0])
    assert found.frames.modes[i - 1, 0] == change.previous
    assert found.frames.modes[i, 0] == change.mode
    told = found.to_json()
    for name, rows in told['frames'].items():
        own = getattr(found.frames, name)
        assert unpacked(rows) == pytest.approx(own, rel=1e-7, abs=1e-30), name
    assert unpacked(told['impacts']['t']).tolist() == [i.t for i in loose.piece.impacts]
    assert set(unpacked(told['impacts']['bearing']).tolist()) == {0}


def away(run, found):
    """Distances of a pin from its place at 2000 instants, in clearances of 0.254 mm.

    By the cubics through places and rates of another's formula, against the run.
    """
    t = np.sort(np.random.default_rng(1).uniform(0.0, run.end, 2000))
    i = np.searchsorted(found.t, t, side='right') - 1
    rough = run.piece.view(t)
    true = stage_of(run.machine, rough.observed).frames(t, rough.observed, rough.modes)
    off = []
    for k in set(i.tolist()):
        cubic = CubicHermiteSpline(
            found.t[k : k + 2], found.pins[k : k + 2, 0], found.pin_rates[k : k + 2, 0]
        )
        off += np.hypot(*(cubic(t[i == k]) - true.pins[i == k, 0]).T).tolist()
    return np.array(off) / 0.254e-3


def test_a_pin_keeps_its_place_between_instants(loose):
    found = frames.recorded(loose)
    assert away(loose, found.frames).max() < 1.1 * frames.NEAR
    assert found.away == 0.0
    assert '<dt>Instants</dt>' not in report.page(found)


@pytest.mark.parametrize('most', [30, 100, 200])
def test_a_page_says_how_often_its_instants_are_too_few(loose, monkeypatch, most):
    monkeypatch.setattr(frames, 'MOST', most)
    found = frames.recorded(loose)
    often = np.mean(away(loose, found.frames) > 0.05)
    assert found.away == pytest.approx(often, abs=0.03)
    said = re.search('<dt>Instants</dt><dd>([^<]*)', report.page(found))
    assert (said is not None) == (found.away > 0.02) == (most < 200)
    assert said is None or f'of the clearance for {100 * found.away:.0f} % of the time' in said[1]


def test_a_long_run_does_not_grow_the_page(loose, monkeypatch):
    """However many turns and impacts; the hardest impacts are kept."""
    monkeypatch.setattr(frames, 'MOST', 200)
    found = frames.recorded(loose)
    assert len(found.frames.t) <= 200 + 2 * (200 // 8)
    monkeypatch.setattr(frames, 'MOST', 5)
    found = frames.recorded(loose)
    hardest = sorted((i.normal_impulse for i in loose.piece.impacts), reverse=True)
    assert sorted((i.normal_impulse for i in found.impacts), reverse=True) == hardest[:5]
    assert found.left_out == len(hardest) - 5
    assert found.hardest == hardest[0]


@pytest.mark.parametrize('rows', [np.arange(3.0), np.ones((2, 3), np.uint8), np.zeros((0, 2))])
def test_arrays_are_written_as_plotly_writes_them(rows):
    assert unpacked(packed(rows)).tolist() == rows.tolist()


def test_a_part_of_a_run_is_what_the_whole_says(loose):
    a, b = 0.1234, 0.3456
    loose.signals['made'] = Signal('made', 'rocker', 'acceleration', 1000.0, (0.0,),
                                   (np.arange(500.0),))  # fmt: skip
    part = loose.between(a, b)
    assert (part.start, part.end) == (a, pytest.approx(b, abs=1e-16))
    t = np.linspace(a, b, 200)
    whole, own = loose.piece.sample(t), part.piece.sample(t)
    for name, column in whole.items():
        close = 1e-9 * max(1.0, float(np.abs(column).max()))
        assert own[name] == pytest.approx(column, rel=1e-9, abs=close), name
    assert [i.t for i in part.piece.impacts] == [i.t for i in loose.piece.impacts if a < i.t <= b]
    assert part.piece.modes[0].t == a
    (run,) = part.signals['made'].runs
    assert part.signals['made'].times[0] == pytest.approx(run / 1000.0)
    assert run.tolist() == list(range(124, 346))
    del loose.signals['made']
    assert loose.between() is loose


def test_the_page_holds_everything_and_asks_for_nothing(loose):
    nasty = "</script><script>alert('x')</script> & <b>"
    scene = loose.machine.scene.model_copy(update={'title': nasty})
    machine = type(loose.machine)(loose.machine.name, scene)
    page = report.page(frames.recorded(Record(machine, loose.piece, {})), (), 'run.mcap')
    assert nasty not in page
    assert '&lt;/script&gt;' in page
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert json.loads(data[1])['stage']['title'] == nasty
    assert not re.search(r'(?:src|href)="(?!data:|#)', page)
    assert "default-src 'none'" in page
    for words in ('run.mcap', 'rtol 1e-12', 'nonsmooth dynamics', loose.digest()):
        assert words in page


@pytest.mark.slow
def test_the_command_makes_pages_of_bags_and_scenes(loose, tmp_path, monkeypatch):
    monkeypatch.setattr(charts, 'sections', lambda _: [])
    monkeypatch.chdir(tmp_path)
    write_bag(tmp_path / 'one.mcap', loose)
    done = command('report', 'one.mcap', '--from', '0.1', '--to', '0.2', '--json')
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert (said['file'], said['start']) == ('one.html', 0.1)
    assert said['size'] == len((tmp_path / 'one.html').read_bytes())
    assert loose.digest() in (tmp_path / 'one.html').read_text()
    done = command('report', 'scotch_yoke', '--revolutions', '0.5', '-o', 'yoke.html')
    assert (done.returncode, done.stdout) == (0, 'yoke.html\n'), done.stderr


@pytest.mark.slow
def test_one_of_several_machines_is_chosen_by_its_namespace(loose, tmp_path, monkeypatch):
    monkeypatch.setattr(charts, 'sections', lambda _: [])
    several = write_bag(tmp_path / 'one.mcap', loose, ('/left', '/right'))
    assert read_record(several, '/left').digest() == loose.digest()
    page = str(tmp_path / 'left.html')
    assert command('report', str(several), '--namespace', '/left', '-o', page).returncode == 0
    refused = command('report', str(several), '-o', page)
    assert refused.returncode == 2
    assert 'several' in refused.stderr
    assert '/right' in refused.stderr


@pytest.mark.slow
def test_a_bag_that_was_cut_short_says_so_on_its_page(loose, tmp_path):
    bag = write_bag(tmp_path / 'cut.mcap', loose)
    whole = bag.read_bytes()
    bag.write_bytes(whole[: whole.rindex(b'\x89MCAP0') - 8])  # without the end of its footer
    done = command('report', str(bag), '-o', str(tmp_path / 'cut.html'))
    assert done.returncode == 0
    assert 'was cut short; what could be read is shown' in done.stderr
    assert 'cut.mcap, cut short' in (tmp_path / 'cut.html').read_text('utf-8')


@pytest.mark.slow
def test_a_folder_with_the_name_of_a_scene_does_not_hide_it(tmp_path, monkeypatch):
    """As `animate punch -o punch` makes one."""
    monkeypatch.chdir(tmp_path)
    Path('slider_crank').mkdir()
    assert command('report', 'slider_crank', '--duration', '0.1').returncode == 0


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (['-o', 'page.pdf'], 'the ending must be .html'),
        (['-o', 'nowhere/page.html'], 'there is no directory'),
        (['--from', '0.4', '--to', '0.2'], 'from 0.4 s to 0.2 s is not within the run'),
        (['--to', '99'], 'is not within the run, which goes from 0 s to'),
        (['--from', 'nan'], "--from: 'nan' is not a number"),
        (['--namespace', '/left'], 'has no machine in namespace /left'),
        (['--set', 'drive.speed=1 rpm'], 'as it was recorded'),
        (['--revolutions', '9'], 'turns from 0 s on, not 9'),
        (['--to', '0.1', '--duration', '0.1'], 'give only one of'),
    ],
)
def test_what_no_page_can_be_made_of_is_one_sentence(loose, tmp_path, options, words, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bag = write_bag(tmp_path / 'one.mcap', loose)
    done = command('report', str(bag), *options)
    assert done.returncode == 2
    assert words in done.stderr
    assert done.stderr.count('\n') == 1
    assert not list(tmp_path.glob('*.html'))


def test_a_namespace_is_for_bags(tmp_path):
    done = command('report', 'scotch_yoke', '--namespace', '/left', '-o', str(tmp_path / 'x.html'))
    assert done.returncode == 2
    assert 'applies to bags' in done.stderr


def test_a_part_outside_of_the_run_is_refused(loose):
    with pytest.raises(InputError, match='is not within the run'):
        loose.between(-1.0, 0.1)


@pytest.mark.slow
def test_measures_of_a_part_of_a_run_know_what_came_before(tmp_path):
    """Filters of a sensor remember: a part is measured as it is in the whole run."""
    asked = 'rms(sensors.rocker_accelerometer)', 'count(impacts)'
    run = ms.simulate('four_bar_clearance', revolutions=2)
    end = run.motion.curve.end
    whole = Measurement(run.machine, asked, 0.2, end)
    whole.add(run)
    given = [
        'report',
        'four_bar_clearance',
        '--from',
        '0.2',
        '--duration',
        f'{end - 0.2!r} s',
    ]
    given += [x for text in asked for x in ('--measure', text)]
    found = run_json(*given, '--json', '-o', str(tmp_path / 'x.html'))
    for m in whole.found():
        assert found['measures'][m.name]['value'] == pytest.approx(m.value, rel=1e-9)
        assert found['measures'][m.name]['resolution'] == m.resolution
