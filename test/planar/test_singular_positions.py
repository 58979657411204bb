"""Prescribed motions through change points, against closed forms of their branch."""

import json

import numpy as np
import pytest
from builders import made, without_work
from running import run_json

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.planar import branch
from mechanism_sim.report.cycle import render
from mechanism_sim.results.ranges import LoadPeaks

W = 2.0 * np.pi  # 60 rpm
BESIDE = np.array([-1e-2, -1e-4, -1e-7, -1e-12, 0.0, 4e-16, 1e-12, 1e-7, 1e-4, 1e-2])  # [rev]
PIN = {'mass': 0.5, 'inertia': 3e-4}


def revolute(*ends):
    return {'revolute': list(ends)}


def bars(ground, crank, coupler, rocker, start, guess, **more):
    """A four-bar as a general linkage."""
    links = {
        'ground': {'points': {'right': [ground, 0.0]}},
        'crank': {'length': crank, 'cog': 0.5 * crank, **PIN},
        'coupler': {'length': coupler, 'cog': 0.5 * coupler, 'mass': 1.0, 'inertia': 3e-3},
        'rocker': {'length': rocker, 'cog': 0.5 * rocker, **PIN},
    }
    joints = {
        'ground_crank': revolute('ground', 'crank'),
        'crank_coupler': revolute('crank.end', 'coupler'),
        'coupler_rocker': revolute('coupler.end', 'rocker.end'),
        'ground_rocker': revolute('ground.right', 'rocker'),
    }
    drive = {'coordinate': 'crank', 'speed': W, 'start_angle': start}
    return {
        'title': 'bars', 'mechanism': 'linkage', 'links': links, 'joints': joints, 'drive': drive,
        'guess': guess, 'gravity': [0, 0], **more,
    }  # fmt: skip


def parallelogram(start=0.5, **more):
    return bars(0.2, 0.08, 0.2, 0.08, start, {'coupler': 0.0, 'rocker': start}, **more)


def template(start=0.5, **more):
    lengths = {'ground': 0.2, 'crank': 0.08, 'coupler': 0.2, 'rocker': 0.08}
    overrides = {f'links.{link}.length': x for link, x in lengths.items()}
    overrides |= {'drive.speed': W, 'drive.start_angle': start, 'gravity': [0, 0], **more}
    return ms.load_scene('four_bar_nominal', overrides)


def seen(run, start, revolutions=2, singular=np.pi):
    """Samples all over a run, and at and beside its singular positions."""
    solution = ms.simulate(run, revolutions=revolutions)
    at = (np.arange(-4, 9) * singular - start) / (2.0 * np.pi)
    t = np.concatenate([np.linspace(0.0, revolutions, 240), (at[:, None] + BESIDE).ravel()])
    return solution.view(t[(t >= 0.0) & (t <= revolutions)]).observed


@pytest.mark.sample(2)
@pytest.mark.parametrize('start', [0.5, 0.0, np.pi])
@pytest.mark.parametrize('made', [lambda x: made(parallelogram(x)), template])
def test_a_parallelogram_stays_one(made, start):
    more = {'branch': 'crossed'} if made is template and start == np.pi else {}
    o = seen(made(start, **more), start)
    crank, coupler, rocker = o.position
    turned = np.array([coupler, rocker - crank])
    assert np.abs(np.angle(np.exp(1j * turned))).max() < 1e-13
    assert np.abs(o.velocity - [[W], [0.0], [W]]).max() < 1e-11 * W
    assert np.abs(o.acceleration).max() < 1e-9 * W**2


@pytest.mark.sample(1)
@pytest.mark.parametrize('start', [0.0, np.pi])
def test_the_template_names_the_branch_that_follows_a_change_point(start):
    """The antiparallelogram: tan(th4/2) = -(b + a)/(b - a) tan(th2/2)."""
    branch = 'crossed' if start == 0.0 else 'open'
    o = seen(template(start, branch=branch), start)
    k, half = 0.28 / 0.12, 0.5 * o.position[0]
    end = np.array([np.cos(half), -k * np.sin(half)])
    off = o.position[2] - 2.0 * np.arctan2(end[1], end[0])
    assert np.abs(np.angle(np.exp(1j * off))).max() < 1e-12
    size = (end**2).sum(axis=0)
    assert np.abs(o.velocity[2] / W + k / size).max() < 1e-10
    bend = k * (k * k - 1.0) * np.cos(half) * np.sin(half) / size**2
    assert np.abs(o.acceleration[2] / W**2 - bend).max() < 1e-8


def test_forces_of_a_parallelogram_have_limits_without_weights():
    """Coupler: m a shared by both pins, since its moment and the rocker's are zero."""
    o = seen(made(parallelogram(0.5)), 0.5)
    along = np.array([np.cos(o.position[0]), np.sin(o.position[0])])
    half = -0.5 * 0.08 * W**2 * along
    assert np.abs(o.reaction[1] - half).max() < 1e-9
    assert np.abs(o.reaction[2] + half).max() < 1e-9
    assert np.abs(o.drive_torque).max() < 1e-11


@pytest.mark.slow
def test_forces_without_a_limit_are_named_and_left_out(tmp_path):
    scene = parallelogram(0.5, gravity=[0, -9.81])
    bars = made(scene)
    cycle = ms.cycle(bars, 24, start=0.0)
    found = cycle.no_limits
    assert [round(x.drive / np.pi, 9) for x in found] == [2.0, 3.0, 4.0]
    assert all('coupler_rocker' in x.joints for x in found)
    assert 'reaction.coupler_rocker.x' in cycle.unbounded
    assert 'reaction.coupler_rocker.x' not in cycle.extremes()
    assert np.isnan(cycle['reaction.coupler_rocker.x'][[0, 12, 24]]).all()
    th = cycle['position.crank']
    assert cycle['reaction.coupler_rocker.y'][[0, 12, 24]] == pytest.approx(-0.5 * 9.81, abs=1e-8)
    lifted = 9.81 * (2 * 0.5 * 0.04 + 1.0 * 0.08)
    assert cycle['drive_torque'] == pytest.approx(lifted * np.cos(th), abs=1e-10)
    assert cycle.extremes()['drive_torque'].greatest.value == pytest.approx(lifted, rel=1e-10)
    # the frame bears what all links together need
    a = -(2 * 0.5 * 0.04 + 1.0 * 0.08) * W**2
    assert cycle['shaking_force.x'] == pytest.approx(-a * np.cos(th), abs=1e-8)
    assert cycle['shaking_force.y'] == pytest.approx(-a * np.sin(th) - 2 * 9.81, abs=1e-8)
    # beside it the force grows as the inverse of the distance: the rocker's and half the
    # coupler's weight about its pivot, over the arm of the coupler's pull
    solution = ms.simulate(bars, revolutions=1)
    off = 1e-6
    (x, _), t = solution.view((np.pi + off - 0.5) / W).observed.reaction[2, :, 0], off
    assert x == pytest.approx(-9.81 * (0.5 * 0.04 + 0.5 * 0.08) / (0.08 * t), rel=1e-5)
    file = tmp_path / 'bars.yaml'
    file.write_text(json.dumps(scene))
    data = run_json('solve', str(file), '--duration', repr((np.pi - 0.5) / W))
    assert data['final']['reactions']['coupler_rocker'][0] is None
    assert data['final']['drive_torque'] == pytest.approx(-lifted, abs=1e-10)
    assert data['no_limits'][0]['drive'] == pytest.approx(np.pi)
    said = render(cycle)
    assert 'at crank = 180 deg' in said
    assert 'tend to infinity' in said


@pytest.mark.slow
def test_solve_at_whole_and_half_turns(tmp_path):
    file = tmp_path / 'bars.yaml'
    file.write_text(json.dumps(parallelogram(0.0)))
    for turns in (0.5, 1.0):
        final = run_json('solve', str(file), '--revolutions', str(turns))['final']
        assert final['velocity']['rocker'] == pytest.approx(W, rel=1e-11)
        assert abs(final['acceleration']['rocker']) < 1e-9 * W**2
        force = 0.5 * 0.08 * W**2 * np.cos(2.0 * np.pi * turns)
        assert final['reactions']['coupler_rocker'] == pytest.approx([force, 0.0], abs=1e-9)


def three_bars(start, **more):
    scene = parallelogram(start, **more)
    scene['links']['ground']['points']['middle'] = [0.1, 0.0]
    scene['links']['coupler']['points'] = {'middle': [0.1, 0.0]}
    scene['links']['bar'] = {'length': 0.08, 'cog': 0.04, **PIN}
    scene['joints']['coupler_bar'] = revolute('coupler.middle', 'bar.end')
    scene['joints']['ground_bar'] = revolute('ground.middle', 'bar')
    scene['guess'] |= {'bar': start}
    return scene


def test_nearly_singular_positions_take_few_pieces():
    """Rounding grows as the inverse of independence there: no reason to halve a piece."""
    scene = bars(0.2, 0.08, 0.2, 0.08 * (1.0 + 1e-7), 2.5, {'coupler': 0.0, 'rocker': 2.5})
    solution = ms.simulate(made(scene), duration=0.2)
    assert solution.stats.steps < 100
    t = np.linspace(0.0, 0.2, 201)
    x = without_work(solution, t)
    closed = FourBar(0.2, 0.08, 0.2, 0.08 * (1.0 + 1e-7), 'open').positions(x['position.crank'])
    for name, exact in zip(('coupler', 'rocker'), closed, strict=True):
        off = np.exp(1j * x[f'position.{name}']) - np.exp(1j * exact)
        assert np.abs(off).max() < 1e-11


def test_a_flat_triangle_that_turns_as_one_has_no_branches_to_look_for(monkeypatch):
    """Forty revolutions took 87 s: polynomials were tried in every position, of any width."""
    links = {
        'crank': {'length': 0.3, 'points': {'middle': [0.1, 0.0]}, **PIN},
        'near': {'length': 0.10001, **PIN},
        'far': {'length': 0.10001, **PIN},
    }
    joints = {
        'pivot': revolute('ground', 'crank'),
        'inner': revolute('crank.middle', 'near'),
        'tip': revolute('near.end', 'far.end'),
        'outer': revolute('crank.end', 'far'),
    }
    scene = {
        'title': 'flat', 'mechanism': 'linkage', 'links': links, 'joints': joints,
        'drive': {'coordinate': 'crank', 'speed': W}, 'guess': {'near': 0.01, 'far': 3.13},
    }  # fmt: skip
    fits = []
    monkeypatch.setattr(branch, '_fitted', lambda *_: fits.append(1))
    q = ms.simulate(made(scene), revolutions=3).view(np.linspace(0.0, 3.0, 50)).observed.position
    assert not fits
    height = np.arccos(0.1 / 0.10001)
    turned = q[1:] - q[0] - [[height], [np.pi - height]]
    assert np.abs(np.angle(np.exp(1j * turned))).max() < 1e-11


@pytest.mark.parametrize('start', [0.5, 0.0])
def test_three_parallel_bars(start):
    o = seen(made(three_bars(start, outputs={'forces': False})), start)
    assert np.abs(o.position[2:] - o.position[0]).max() < 1e-13
    assert np.abs(o.velocity[2:] - W).max() < 1e-11 * W
    assert np.abs(o.acceleration).max() < 1e-9 * W**2


@pytest.mark.sample(1)
@pytest.mark.parametrize('start', [0.5, 0.0])
def test_what_is_redundant_everywhere_leaves_forces_open_and_not_the_torque(start):
    """Weights of three bars by their middles and of the coupler, through both change points."""
    machine = made(three_bars(start, gravity=[0.0, -9.81]))
    assert machine.nominal.undetermined_names == [
        f'reaction.{j}' for j in machine.plan.scene.joints
    ]
    solution = ms.simulate(machine, revolutions=1)
    x = solution.sample(np.linspace(0.0, 1.0, 101))
    weight = 9.81 * (3 * 0.5 * 0.04 + 1.0 * 0.08)
    exact = weight * np.cos(x['position.crank'])
    assert np.abs(x['drive_torque'] - exact).max() < 1e-11 * weight
    assert not any(name.startswith('reaction') for name in x)
    assert not machine.physics.no_limits(solution.motion)


def slider_crank(start):
    links = {
        'crank': {'length': 0.1, 'cog': 0.05, **PIN},
        'rod': {'length': 0.1, 'cog': 0.05, **PIN},
        'piston': {'mass': 0.4},
    }
    joints = {
        'ground_crank': revolute('ground', 'crank'),
        'crank_rod': revolute('crank.end', 'rod'),
        'rod_piston': revolute('rod.end', 'piston'),
        'ground_piston': {'prismatic': ['ground', 'piston']},
    }
    return {
        'title': 'equal arms', 'mechanism': 'linkage', 'links': links, 'joints': joints,
        'drive': {'coordinate': 'crank', 'speed': W, 'start_angle': start}, 'gravity': [0, 0],
        'guess': {'rod': -start, 'piston': 0.2 * np.cos(start)},
    }  # fmt: skip


@pytest.mark.parametrize('start', [0.4, 0.5 * np.pi])
def test_a_slider_crank_of_equal_arms_goes_through_its_pivot(start):
    """x = 2 l cos th, the rod at -th; the guide bears w^2 l (m + 2 m_p) sin th.

    With the rod's mass m in its middle: it turns steadily, so its ends pull it alike across.
    """
    o = seen(made(slider_crank(start)), start)
    th, rod, x = o.position
    assert np.abs(x - 0.2 * np.cos(th)).max() < 1e-14
    assert np.abs(np.angle(np.exp(1j * (rod + th)))).max() < 1e-13
    assert np.abs(o.velocity[2] + 0.2 * W * np.sin(th)).max() < 1e-12 * W
    assert np.abs(o.velocity[1] + W).max() < 1e-11 * W
    assert np.abs(o.acceleration[2] + 0.2 * W**2 * np.cos(th)).max() < 1e-10 * W**2
    guide = -0.1 * W**2 * np.sin(th) * (0.5 + 2 * 0.4)
    assert np.abs(o.reaction[3, 1] - guide).max() < 1e-9


def test_a_kite_stays_one():
    """The rocker's end mirrors the crank's pivot in the other diagonal, th4 = 2 arg d - pi."""
    start = 1.0
    guess = {'coupler': 0.5, 'rocker': 2.2}
    o = seen(made(bars(0.2, 0.08, 0.08, 0.2, start, guess)), start, 1)
    d = 0.08 * np.exp(1j * o.position[0]) - 0.2
    e, f = 1j * W * (d + 0.2), -(W**2) * (d + 0.2)
    assert np.abs(np.exp(1j * o.position[2]) + np.exp(2j * np.angle(d))).max() < 1e-13
    spin = (np.conj(d) * e).imag / np.abs(d) ** 2
    bend = (f / d - (e / d) ** 2).imag
    assert np.abs(o.velocity[2] - 2.0 * spin).max() < 1e-11 * W
    assert np.abs(o.acceleration[2] - 2.0 * bend).max() < 1e-9 * W**2
    assert np.isfinite(o.reaction).all()


def test_a_kite_whose_crank_is_as_long_as_its_frame():
    """The crank's pin comes to the rocker's pivot: th4 - th2/2 follows from the law of cosines."""
    a, b, start = 0.08, 0.2, 0.0
    o = seen(made(bars(a, a, b, b, start, {'coupler': 0.0, 'rocker': 0.0})), start, 2)
    th = o.position[0]
    out = a * np.cos(0.5 * th) + np.sqrt(b**2 - (a * np.sin(0.5 * th)) ** 2)
    end = out * np.exp(0.5j * th)  # on the axis of symmetry, from the crank's pivot
    assert np.abs(a + b * np.exp(1j * o.position[2]) - end).max() < 1e-13
    slope = -0.5 * a * np.sin(0.5 * th)
    slope -= 0.5 * a**2 * np.sin(0.5 * th) * np.cos(0.5 * th) / (out - a * np.cos(0.5 * th))
    rate = ((slope + 0.5j * out) * np.exp(0.5j * th) / (1j * (end - a))).real
    assert np.abs(o.velocity[2] / W - rate).max() < 1e-11


def test_a_drive_that_two_flat_triangles_hold_cannot_move_on():
    """Arms of 10 in, bars of 4 in, as a crank of 3 in about 3 in lets them meet at 6 in only."""
    sides = {'arm': (0.254, 0.1), 'lower_arm': (0.254, -0.1)}
    links = {'ground': {'points': {'Q': [0.0762, 0.0]}}, 'crank': {'length': 0.0762}}
    joints, guess = {'Q': revolute('ground.Q', 'crank')}, {}
    for arm, (long, above) in sides.items():
        links |= {arm: {'length': long}, f'bar_{arm}': {'length': 0.1016}}
        guess[f'{arm}.end'] = [0.24, above]
        joints |= {
            f'O_{arm}': revolute('ground', arm),
            f'B_{arm}': revolute('crank.end', f'bar_{arm}'),
            f'C_{arm}': revolute(f'{arm}.end', f'bar_{arm}.end'),
        }
    drive = {'coordinate': 'crank', 'position': 'sin(t)'}
    with pytest.raises(InputError, match='singular position from which crank cannot move on'):
        made({'links': links, 'joints': joints, 'drive': drive, 'guess': guess})


def test_a_guess_chooses_between_the_branches_at_the_start():
    scene = parallelogram(0.0)
    scene['guess'] = {'coupler': -0.13, 'rocker': -0.23}
    assert made(scene).assembly.v[2] == pytest.approx(-W * 0.28 / 0.12, rel=1e-10)
    scene['guess'] = {'coupler': 0.0, 'rocker': 0.1}
    assert made(scene).assembly.v[2] == pytest.approx(W, rel=1e-10)


def test_a_drive_may_rest_in_a_singular_position():
    """To 180 degrees, rest there, then on: the branch is kept, and the energy balance closes."""
    points = [[0, 0], [0.25, W], [0.5, 0], [0.7, 0], [0.95, W], [1.6, W]]
    scene = parallelogram(0.5 * np.pi, gravity=[0, -9.81], duration=1.6)
    scene['drive'] = {
        'coordinate': 'crank', 'start_angle': 0.5 * np.pi,
        'profile': {'points': [[f'{t} s', w] for t, w in points]},
    }  # fmt: skip
    run = made(scene)
    solution = ms.simulate(run)
    o = solution.view(np.linspace(0.0, 1.6, 321)).observed
    assert np.abs(o.position[2] - o.position[0]).max() < 1e-13
    assert np.abs(o.velocity[2] - o.velocity[0]).max() < 1e-11 * W
    assert np.abs(o.acceleration[2] - o.acceleration[0]).max() < 1e-9 * W**2
    assert abs(solution.energy.residual) < 1e-9
    found = run.physics.no_limits(solution.motion)
    assert [(round(x.t, 9), x.rests) for x in found] == [(0.5, True), (1.325, False)]


def test_a_run_goes_on_from_a_singular_position():
    run = made(parallelogram(0.0, outputs={'forces': False}))
    first = run.start()
    first.advance(0.5, final=True)
    second = run.resume(run.snapshot(first))
    second.advance(1.3, final=True)
    motion, *_ = second.drain()
    assert motion.curve(np.array([1.2]))[0] == pytest.approx([1.2 * W, 0.0, 1.2 * W], abs=1e-12)


def guided(friction=0.0, speed=0.1, length=0.0, **more):
    """Two blocks in three guides, which share a moment among them: each force is determined."""
    rubs = {'friction': {'coefficient': friction, **({'length': length} if length else {})}}
    joints = {
        'floor': {'prismatic': ['ground', 'low']},
        'slope': {'prismatic': ['low', 'high'], 'axis': '30 deg'},
        'wall': {'prismatic': ['ground', 'high'], 'axis': '90 deg'},
    }
    return made({
        'links': {'low': {'mass': 1.0}, 'high': {'mass': 2.0}}, 'gravity': [0.0, -9.81],
        'joints': {k: {**joint, **(rubs if friction else {})} for k, joint in joints.items()},
        'drive': {'coordinate': 'low', 'speed': speed}, 'duration': 1.0, **more,
    })  # fmt: skip


def test_a_moment_that_is_open_leaves_the_force_known_everywhere():
    """The weights of a wedge and what it lifts, resolved; among guides only a moment is open."""
    slope = np.radians(30.0)
    expected = {
        'floor': 3.0 * 9.81, 'slope': 2.0 * 9.81 / np.cos(slope),
        'wall': 2.0 * 9.81 * np.tan(slope),
    }  # fmt: skip
    cell = {'kind': 'load_cell', 'joint': 'slope', 'direction': '90 deg'}
    machine = guided(sensors={'cell': {**cell, 'sample_rate': 10.0}})
    assert set(machine.nominal.undetermined_names) == {f'reaction.{j}.moment' for j in expected}
    solution = ms.simulate(machine)
    cycle, peaks, view = ms.cycle(machine), LoadPeaks(machine), solution.view(np.array([0.5]))
    peaks.add(solution.motion)
    for joint, force in expected.items():
        assert cycle[f'reaction.{joint}.size'] == pytest.approx(force, rel=1e-12)
        assert peaks.forces[joint].value == pytest.approx(force, rel=1e-12)
        seen = view.joint(machine.mechanism.joint(joint))
        assert np.hypot(*seen.force) == pytest.approx(force, rel=1e-12)
        assert np.isnan(seen.moment).all()
    channel = machine.channel('cell')
    channel.take(solution.motion)
    for block in channel.blocks(final=True):  # on the plane, which carries the weight
        assert np.abs(block.samples) == pytest.approx(2.0 * 9.81, rel=1e-9)


def test_guides_that_share_a_moment_rub_by_their_forces():
    """The wedge that lifts through all of its angles of friction; a block's ends need more."""
    two = np.radians(30.0) + 2.0 * np.arctan(0.1)
    torque = ms.cycle(guided(0.1, -0.1))['drive_torque']
    assert -torque == pytest.approx(2.0 * 9.81 * np.tan(two) + 0.1 * 9.81, rel=1e-9)
    with pytest.raises(InputError, match=r'joints\.floor\.friction follows from its force, but'):
        guided(0.1, length=0.1)
