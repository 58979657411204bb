"""Loads whose sizes are unknown: the drive's torque and motion are given ([V] chapter 3)."""

import json
import math

import numpy as np
import pytest
from builders import made

import mechanism_sim as ms
from mechanism_sim.cli import main
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.messages import JointReactions, deserialize
from mechanism_sim.nodes.publications import reactions
from mechanism_sim.numerics import compiled
from mechanism_sim.results.cycle import cycle
from mechanism_sim.scene import scene_names
from mechanism_sim.scene.frame_forces import forces_on
from mechanism_sim.scene.level import Level
from ros_interfaces.checks import objection

R2, R3, C2, C3 = 0.05, 0.2, 0.02, 0.08
MASS, INERTIA = {'crank': 1.0, 'rod': 0.5, 'piston': 2.0}, {'crank': 1e-3, 'rod': 2e-3}
M2, W = 12.0, 30.0
MOUNTS = {'left': {'at': [0.0, -0.1], 'stiffness': ['300 N/mm', '400 N/mm']},
          'right': {'at': [0.3, -0.1], 'stiffness': ['300 N/mm', '400 N/mm']}}  # fmt: skip
FRAME = {'mass': 20.0, 'inertia': 0.6, 'cog': [0.1, 0.0], 'mounts': MOUNTS}


def slider_crank(**changes):
    """[V] Figure 3.9: the crank's moment is given, the piston's resistance is not."""
    scene = {
        'title': 'slider-crank',
        'mechanism': 'linkage',
        'links': {
            'crank': {'length': R2, 'mass': 1.0, 'inertia': 1e-3, 'cog': C2},
            'rod': {'length': R3, 'mass': 0.5, 'inertia': 2e-3, 'cog': C3},
            'piston': {'mass': 2.0},
        },
        'joints': {
            'A': {'revolute': ['ground', 'crank']},
            'B': {'revolute': ['crank.end', 'rod']},
            'C': {'revolute': ['rod.end', 'piston']},
            'D': {'prismatic': ['ground', 'piston']},
        },
        'drive': {'coordinate': 'crank', 'speed': W, 'effort': M2},
        'loads': {'resistance': {'at': 'piston', 'force': [-2, 0], 'unknown': True}},
        'guess': {'piston': R3},
    }
    for path, value in changes.items():
        part, (*keys, last) = scene, path.split('__')
        for key in keys:
            part = part[key]
        part[last] = value
    return made(scene, 'slider_crank')


def test_the_slider_crank_of_the_book_without_inertia():
    """[V] 3.25, 3.30, 3.31, where M2 and the velocity have the signs of Figure 3.7."""
    found = cycle(slider_crank(), static=True, samples=36)
    inside = np.abs(np.sin(found['position.crank'])) > 1e-6
    th2, th3 = (found[f'position.{x}'][inside] for x in ('crank', 'rod'))
    F32 = M2 / (R2 * np.sin(th3 - th2))
    assert found['load.resistance'][inside] == pytest.approx(F32 * np.cos(th3), rel=1e-12)
    assert found['reaction.D.y'][inside] == pytest.approx(-F32 * np.sin(th3), rel=1e-12)


def newton_euler(th, dw, a_c2, a_c3, a_c4):
    """The eight equations of [V] Figure 3.9b: forces at A, B, C on links 2, 3, 4; N and P4."""
    (th2, th3), (dw2, dw3) = th, dw
    u2, u3 = (np.array([math.cos(x), math.sin(x)]) for x in (th2, th3))

    def moment(r):
        return np.array([-r[1], r[0]])

    A, b = np.zeros((8, 8)), np.zeros(8)
    one = np.eye(2)
    # x = F12, F23 (on 3), F34 (on 4), N (along y), P4 (along -x)
    A[0:2, 0:2], A[0:2, 2:4], b[0:2] = one, -one, MASS['crank'] * a_c2
    A[2, 0:2], A[2, 2:4] = moment(-C2 * u2), -moment((R2 - C2) * u2)
    b[2] = INERTIA['crank'] * dw2 - M2
    A[3:5, 2:4], A[3:5, 4:6], b[3:5] = one, -one, MASS['rod'] * a_c3
    A[5, 2:4], A[5, 4:6] = moment(-C3 * u3), -moment((R3 - C3) * u3)
    b[5] = INERTIA['rod'] * dw3
    A[6:8, 4:6], b[6:8] = one, MASS['piston'] * a_c4
    A[7, 6], A[6, 7] = 1.0, -1.0
    return np.linalg.solve(A, b)


def test_the_slider_crank_of_the_book_with_inertia():
    """[V] 3.5.2: every force of eight equations of equilibrium, link by link."""
    machine = slider_crank(
        links__crank__points={'c': [C2, 0]}, links__rod__points={'c': [C3, 0]}
    )  # fmt: skip
    found = cycle(machine, points=['crank.c', 'rod.c', 'piston.start'], samples=24)
    for k in [1, 5, 7, 11, 13, 20]:
        at = {name: x[k] for name, x in found.table().items()}
        places = [
            np.array([at[f'acceleration.{p}.{axis}'] for axis in 'xy'])
            for p in ('crank.c', 'rod.c', 'piston.start')
        ]
        th, dw = (
            [at[f'{kind}.{x}'] for x in ('crank', 'rod')] for kind in ('position', 'acceleration')
        )
        forces = newton_euler(th, dw, *places)
        seen = [at[f'reaction.{j}.{axis}'] for j in 'ABC' for axis in 'xy']
        assert [*seen, at['reaction.D.y'], at['load.resistance']] == pytest.approx(
            forces, rel=1e-9
        )
        assert at['drive_torque'] == M2
    assert found.solution.energy.residual == pytest.approx(0.0, abs=1e-9)


def test_dead_centres_where_the_resistance_does_no_work_are_named(capsys, tmp_path):
    """They are at 0 and 180 degrees; nothing else of the cycle is lost."""
    found = cycle(slider_crank())
    places = [(x.t, math.degrees(x.drive) % 360.0, x.loads) for x in found.no_limits]
    T = 2.0 * math.pi / W
    expected = [(0.0, 0.0), (0.5 * T, 180.0), (T, 0.0)]
    assert [x[:2] for x in places] == [pytest.approx(x, abs=1e-9) for x in expected]
    assert all(x[2] == ('resistance',) for x in places)
    assert np.flatnonzero(np.isnan(found['load.resistance'])).tolist() == [0, 180, 360]
    assert {'load.resistance', 'reaction.C.x'} <= found.unbounded
    assert np.isfinite(found['energy.dissipated']).all()
    # the load takes what the drive gives
    assert found['energy.dissipated'][-1] == pytest.approx(M2 * 2.0 * math.pi, rel=1e-9)
    path = tmp_path / 'press.yaml'
    path.write_text(json.dumps(slider_crank().scene.model_dump(exclude_none=True, by_alias=True)))
    with pytest.raises(SystemExit, match='0'):
        main(['cycle', str(path)])
    said = capsys.readouterr().out
    assert 'at crank = 180 deg' in said
    assert 'the unknown resistance does no work: its size is not determined' in said


def powers(machine, found, k, loads):
    """Sum of powers less the rate of kinetic energy [W] at a sample: loads, drives, weights."""
    total = 0.0
    for body in machine.mechanism.bodies:
        v, a = (
            np.array([found[f'{kind}.{body.name}.c.{axis}'][k] for axis in 'xy'])
            for kind in ('velocity', 'acceleration')
        )
        frame, _ = machine.mechanism.frame(body.name)
        w, dw = (
            (found[f'{kind}.{frame}'][k] for kind in ('velocity', 'acceleration'))
            if frame != 'ground'
            else (0.0, 0.0)
        )
        total += body.mass * v @ (np.array(machine.scene.gravity) - a) - body.inertia * w * dw
    for c in machine.plan.prescribed:
        name = f'drive_torque.{c}' if f'drive_torque.{c}' in found.table() else 'drive_torque'
        total += found[name][k] * found[f'velocity.{c}'][k]
    for name, (point, force) in loads.items():
        v = [found[f'velocity.{point}.{axis}'][k] for axis in 'xy']
        total += found[f'load.{name}'][k] * float(np.dot(v, force))
    return total


@pytest.mark.sample(1)
@pytest.mark.parametrize('seed', range(3))
def test_virtual_power_balance_of_a_five_bar_with_two_unknowns(seed):
    """[V] 3.17: two drives with given torques, two unknown forces, weights."""
    rng = np.random.default_rng(seed)
    lengths = {'a': 0.1, 'b': 0.3, 'c': 0.32, 'd': 0.12}
    base = {
        'title': 'five-bar',
        'gravity': [0, -9.81],
        'links': {
            'ground': {'points': {'right': [0.2, 0]}},
            **{
                n: {'length': x, 'mass': rng.uniform(0, 2), 'inertia': rng.uniform(0, 0.01),
                    'cog': 0.4 * x, 'points': {'c': [0.4 * x, 0], 'p': [0.7 * x, 0.05]}}
                for n, x in lengths.items()
            },
        },
        'joints': {
            'A': {'revolute': ['ground', 'a']}, 'B': {'revolute': ['a.end', 'b']},
            'C': {'revolute': ['b.end', 'c.end']}, 'D': {'revolute': ['d.end', 'c']},
            'E': {'revolute': ['ground.right', 'd']},
        },
        'drive': {'coordinate': 'a', 'speed': 10.0, 'effort': '3 + sin(2*a)'},
        'drives': {'d': {'speed': -10.0, 'effort': rng.uniform(-2, 2)}},
        'guess': {'b': 1.2, 'c': 1.9},
        'duration': 0.5,
    }  # fmt: skip
    t1, t2 = rng.uniform(0, 2 * math.pi, 2)
    f1, f2 = ((math.cos(t), math.sin(t)) for t in (t1, t2))
    base['loads'] = {
        'one': {'at': 'b.p', 'force': list(f1), 'unknown': True},
        'two': {'at': 'c.p', 'force': list(f2), 'unknown': True},
    }
    machine = made(base, 'five_bar')
    points = [f'{n}.{p}' for n in lengths for p in 'cp']
    found = cycle(machine, points=points, samples=40)
    loads = {'one': ('b.p', f1), 'two': ('c.p', f2)}
    assert found['drive_torque'] == pytest.approx(3.0 + np.sin(2.0 * found['position.a']))
    for k in range(1, 40, 3):
        size = sum(
            abs(found[f'load.{n}'][k]) * abs(found[f'velocity.{p}.{axis}'][k])
            for n, (p, _) in loads.items()
            for axis in 'xy'
        )
        assert powers(machine, found, k, loads) == pytest.approx(0.0, abs=1e-9 * (1.0 + size))


QUICK = ('scotch_yoke', 'four_bar_crank_rocker')


def back(name, seed):
    """The size of a load from the torques that it causes, at one instant of a package scene."""
    rng = np.random.default_rng(seed)
    machine = ms.load_scene(name)
    links = [b.name for b in machine.plan.bodies if b.name not in machine.plan.prescribed]
    count = len(machine.plan.prescribed)
    duration = machine.scene.duration or machine.drive.period
    t = float(rng.uniform(0.1, 0.9)) * duration
    known, unknown, sizes = {}, {}, {}
    for k in range(count):
        link, sizes[f'u{k}'] = str(rng.choice(links)), float(rng.uniform(10, 100))
        if rng.random() < 0.3 and link not in machine.mechanism.sliding:
            part = {'at': link, 'torque': sizes[f'u{k}']}
        else:
            way = rng.normal(size=2)
            way *= sizes[f'u{k}'] / math.hypot(*way)
            part = {'at': link, 'force': way.tolist(), 'frame': str(rng.choice(['world', 'link']))}
            x, y = rng.uniform(-0.1, 0.1, 2)
            known[f'points.{link}'] = [x, y]
            part['at'] = f'{link}.u{k}'
        known[f'u{k}'], unknown[f'u{k}'] = part, {**part, 'unknown': True}
    scene = machine.scene.model_dump(exclude_none=True, by_alias=True)
    for k in [n for n in known if n.startswith('points.')]:
        at = known.pop(k)
        link = k.removeprefix('points.')
        for u in sizes:
            scene['links'][link].setdefault('points', {})[u] = at
    scene['loads'] = scene.get('loads', {}) | known
    first = made(scene, name)
    seen = ms.simulate(first, duration=duration).view(t).observed
    torques = dict(zip(first.physics.driven, seen.drive_torque[:, 0].tolist(), strict=True))
    scene['loads'] |= unknown
    for c, torque in torques.items():
        own = scene['drive'] if c not in scene.get('drives', {}) else scene['drives'][c]
        own['effort'] = torque
    try:
        second = made(scene, name)
    except InputError as refused:
        if 'do no work' not in str(refused):
            raise
        return None
    try:
        run = ms.simulate(second, duration=duration)
    except RunError as locked:
        if 'friction locks' not in str(locked):
            raise
        return None
    found = run.view(t)
    work = second.physics.unknowns
    if np.isnan(found.observed.load).any():  # in a dwell
        assert any(x.rests for x in second.physics.no_limits(run.motion))
        return None
    return {n: (found.observed.load[i, 0], sizes[n]) for i, n in enumerate(work)}


@pytest.mark.parametrize('name', QUICK)
def test_sizes_come_back_from_the_torques_that_they_cause(name):
    for seed in range(2):
        found = back(name, seed)
        assert found is not None
        for size, expected in found.values():
            assert size == pytest.approx(expected, rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize('name', scene_names())
def test_sizes_come_back_in_every_scene(name):
    if ms.load_scene(name).level is not Level.INVERSE_DYNAMICS:
        pytest.skip('its drives do not prescribe the motion')
    for seed in range(3):
        found = back(name, seed)
        for size, expected in (found or {}).values():
            assert size == pytest.approx(expected, rel=1e-5)


def test_sizes_are_found_under_friction_in_the_joints():
    """The torque that a known resistance causes, friction included, gives it back."""
    load = {'at': 'piston', 'force': [-100.0, 0.0]}
    known = ms.load_scene('rubbing_compressor', {'loads': {'r': load}})
    t = 0.013
    torque = ms.simulate(known, duration=0.05).sample(t, 'drive_torque')['drive_torque'][0]
    smooth = ms.load_scene('slider_crank', {'loads': {'r': load}})
    assert (
        abs(
            torque
            - ms.simulate(smooth, duration=0.05).sample(t, 'drive_torque')['drive_torque'][0]
        )
        > 0.1
    )
    given = {'loads': {'r': load | {'unknown': True}}, 'drive.effort': float(torque)}
    found = ms.simulate(ms.load_scene('rubbing_compressor', given), duration=0.05).sample(
        t, 'load.r'
    )
    assert found['load.r'][0] == pytest.approx(100.0, rel=1e-9)


def test_the_frame_gets_what_a_load_between_it_and_a_link_does():
    """A cylinder that is braced on the ground shakes it; one that acts from outside does not."""
    seen = []
    for reaction in (None, 'ground'):
        load = {'at': 'piston', 'force': [-1, 0], 'unknown': True}
        machine = slider_crank(
            loads__resistance=load | ({'reaction': reaction} if reaction else {})
        )
        seen.append(cycle(machine, samples=24))
    outside, braced = seen
    inside = np.isfinite(outside['load.resistance'])
    difference = (braced['shaking_force.x'] - outside['shaking_force.x'])[inside]
    assert difference == pytest.approx(outside['load.resistance'][inside], rel=1e-9)


def test_a_frame_on_springs_is_shaken_by_unknown_loads_too():
    """As what is said of the shaking force itself, which counts them."""
    machine = slider_crank(oscillators={'frame': FRAME})
    run, t = ms.simulate(machine, duration=0.05), np.array([0.011, 0.023, 0.037])
    shaken = run.sample(t, 'shaking_force.x', 'load.resistance')
    assert np.abs(shaken['load.resistance']).min() > 0.1
    force = forces_on(machine, 'frame').read(run.motion, *run.motion.curve.find(t))
    np.testing.assert_allclose(force[0], shaken['shaking_force.x'], rtol=1e-9)


def test_steps_of_the_velocities_shake_a_frame_without_loads():
    """Loads of unknown size have no impulses: as much as without them."""
    step, found = np.array([[0.3], [-0.1], [0.02]]), []
    for changes in ({}, {'loads': {}, 'drive': {'coordinate': 'crank', 'speed': W}}):
        machine = slider_crank(oscillators={'frame': FRAME}, **changes)
        motion = ms.simulate(machine, duration=0.05).motion
        found.append(forces_on(machine, 'frame').impulses(motion, np.array([1]), step))
    assert np.abs(found[0]).max() > 1e-3
    np.testing.assert_allclose(*found, rtol=1e-12)


def test_nodes_publish_the_sizes():
    machine = slider_crank()
    view = ms.simulate(machine, duration=0.05).view(np.array([0.01, 0.02]))
    seen = view.observed
    messages = [deserialize(x, JointReactions) for x in reactions(machine, 'world')(view)]
    assert [list(m.loads) for m in messages] == [['resistance']] * 2
    assert [m.load_sizes[0] for m in messages] == seen.load[0].tolist()
    at_dead_centre = ms.simulate(machine, duration=0.05).view(0.0)
    (data,) = reactions(machine, 'world')(at_dead_centre)
    message = deserialize(data, JointReactions)
    assert np.isnan(message.load_sizes).all()
    assert objection(message) is None
    plain = ms.load_scene('slider_crank')
    (message,) = reactions(plain, 'world')(ms.simulate(plain, duration=0.05).view(0.01))
    assert list(deserialize(message, JointReactions).loads) == []


WAY = {'coordinate': 'crank', 'moving': 'forward'}
SILENT = {'at': 'piston', 'force': [-1, 0]}


@pytest.mark.parametrize(
    ('changes', 'said'),
    [
        ({'loads': {'r': SILENT}}, '1 too few are unknown'),
        ({'drive': {'coordinate': 'crank', 'speed': W}}, 'too many are unknown'),
        ({'loads': {n: SILENT | {'unknown': True} for n in 'ab'}}, '1 too many are unknown'),
        ({'loads__resistance__force': [0, 1]}, 'do no work'),
        ({'loads__resistance__force': [0, 0]}, 'it has none'),
        ({'loads__resistance__torque': 1.0}, 'it has both'),
        ({'loads__resistance__force': ['x', 0]}, 'not a formula'),
        ({'loads__resistance__during': WAY}, 'acts always'),
        ({'outputs': {'forces': False}}, 'this scene is one of kinematic'),
        ({'joints__B__clearance': {'radial': 1e-4, 'restitution': 0.5}}, 'one of nonsmooth'),
        ({'drive__effort': '3 N'}, 'an angle, in N m'),
        ({'drive__effort': '3*crnk'}, 'did you mean'),
        ({'drive__torque': {}}, 'exclude each other'),
    ],
)  # fmt: skip
def test_what_cannot_be_found_is_refused(changes, said):
    with pytest.raises(InputError, match=said):
        slider_crank(**changes)


def test_another_number_of_an_effort_or_a_direction_compiles_nothing():
    cycle(slider_crank(), samples=8)
    before = compiled._function.cache_info().misses
    found = cycle(slider_crank(drive__effort=5.0, loads__resistance__force=[-1, 1]), samples=8)
    assert compiled._function.cache_info().misses == before
    assert found['drive_torque'] == pytest.approx(5.0)
