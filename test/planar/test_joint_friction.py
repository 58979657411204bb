"""Coulomb friction in ideal joints, against closed forms and equations written out by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import made
from running import run, run_json
from tooth_forces import worm as worm_forces

import mechanism_sim as ms
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.joints.mesh.pair import Pair
from mechanism_sim.planar import joint_friction
from mechanism_sim.planar.joint_friction import solve_friction
from mechanism_sim.planar.switches import HOLDS
from mechanism_sim.report import cycle as report
from test.grid.case import variant

G = 9.81


def rotor(**more):
    return made({
        'links': {'rotor': {'cog': 0.0, 'mass': 2.0, 'inertia': 0.01}},
        'joints': {'shaft': {'revolute': ['ground', 'rotor'],
                             'friction': {'coefficient': 0.5, 'radius': 0.01}}},
        'gravity': [0.0, -G], **more,
    })  # fmt: skip


def test_a_shaft_runs_down_and_stands():
    """The weight is tangent to the friction circle: a constant torque, until it stands."""
    solution = ms.simulate(rotor(initial={'velocity': {'rotor': '10 rad/s'}}), duration=2.0)
    torque = 2.0 * G * 0.01 * math.sin(math.atan(0.5))
    stop = 10.0 * 0.01 / torque
    t = np.array([0.5 * stop, 0.99 * stop, stop, 2.0])
    seen = solution.sample(
        t, 'position.rotor', 'energy.dissipated', 'velocity.rotor', 'reaction.shaft.moment'
    )
    angle = np.where(t < stop, 10.0 * t - 0.5 * torque / 0.01 * t**2, 5.0 * stop)
    assert seen['position.rotor'] == pytest.approx(angle, abs=1e-11)
    assert np.abs(seen['reaction.shaft.moment'][:2] + torque).max() < 1e-13
    assert abs(seen['velocity.rotor'][3]) < 1e-11
    assert abs(seen['reaction.shaft.moment'][3]) < 1e-13
    assert seen['energy.dissipated'][3] == pytest.approx(0.5, rel=1e-11)
    assert HOLDS in solution.motion.acting


@pytest.mark.parametrize('share', [0.999, -0.999, 1.001, -1.001, 1e-3])
def test_a_shaft_at_rest_gives_way_where_the_torque_is_more_than_its_friction(share):
    bound = 2.0 * G * 0.01 * math.sin(math.atan(0.5))
    machine = rotor(loads={'push': {'at': 'rotor', 'torque': share * bound}})
    seen = ms.simulate(machine, duration=1.0).sample(
        np.array([1.0]), 'velocity.rotor', 'reaction.shaft.moment'
    )
    over = math.copysign(max(0.0, abs(share) - 1.0), share) * bound / 0.01
    assert seen['velocity.rotor'][0] == pytest.approx(over, abs=1e-10)
    held = -np.clip(share, -1.0, 1.0) * bound
    assert seen['reaction.shaft.moment'][0] == pytest.approx(held, abs=1e-12)


@pytest.mark.parametrize('start', [0.2, -0.35, 0.01])
def test_a_block_on_a_spring_comes_to_rest_off_the_middle(start):
    """Every half swing takes 2 mu m g/k off the amplitude; it sticks within mu m g/k."""
    mass, k, mu = 2.0, 200.0, 0.3
    machine = made({
        'links': {'block': {'mass': mass}},
        'joints': {'guide': {'prismatic': ['ground', 'block'], 'friction': {'coefficient': mu}}},
        'gravity': [0.0, -G], 'springs': {'s': {'between': ['ground', 'block'],
                                               'stiffness': f'{k} N/m'}},
        'initial': {'position': {'block': start}},
    })  # fmt: skip
    seen = ms.simulate(machine, duration=5.0).sample(
        np.array([5.0]), 'position.block', 'energy.dissipated'
    )
    off, rest = mu * mass * G / k, start
    while abs(rest) > off:
        rest = -rest + math.copysign(2.0 * off, rest)
    assert seen['position.block'][0] == pytest.approx(rest, abs=1e-11)
    assert seen['energy.dissipated'][0] == pytest.approx(
        0.5 * k * (start**2 - rest**2), rel=1e-10, abs=1e-10
    )


def tilted(mu, **keys):
    """A block that a force drags up a slope of 30 degrees."""
    return made({
        'links': {'block': {'mass': 3.0}},
        'joints': {'slope': {'prismatic': ['ground', 'block'], 'axis': '30 deg',
                             'friction': {'coefficient': mu, **keys}}},
        'gravity': [0.0, -G], 'initial': {'velocity': {'block': '0.5 m/s'}},
    })  # fmt: skip


@pytest.mark.parametrize('mu', [0.2, 0.9])
def test_a_block_slides_back_or_not(mu):
    """Up a slope it comes to rest; back down it goes only where tan 30 deg exceeds mu."""
    seen = ms.simulate(tilted(mu), duration=1.0).sample(
        np.array([1.0]), 'velocity.block', 'position.block'
    )
    s, c = math.sin(math.pi / 6.0), math.cos(math.pi / 6.0)
    stop = 0.5 / (G * (s + mu * c))
    back = G * max(0.0, s - mu * c) * (1.0 - stop)
    assert seen['velocity.block'][0] == pytest.approx(-back, abs=1e-11)
    assert seen['position.block'][0] == pytest.approx(
        0.25 * stop - 0.5 * back * (1.0 - stop), abs=1e-12
    )


def lifted(mu, way=1.0, load=1000.0):
    """Force on a wedge of 20 degrees that lifts or lowers a load, all three contacts rubbing."""
    tilt = math.radians(20.0) + way * math.atan(mu)
    face = load / (math.cos(tilt) - way * mu * abs(math.sin(tilt)))
    return face * (math.sin(tilt) + way * mu * math.cos(tilt))


@pytest.mark.parametrize('share', [0.99, 1.01])
def test_a_slot_is_a_clutch(share):
    """A shoe is pressed on a pin that is pushed along its slot: it comes along, or slips."""
    mu, F, M, m, end = 0.3, 200.0, 3.0, 2.0, 0.5
    push = share * mu * F * (M + m) / m
    machine = made({
        'links': {'driver': {'mass': M}, 'sled': {'mass': 0.5}, 'shoe': {'mass': m - 0.5}},
        'joints': {'rail': {'prismatic': ['ground', 'driver']},
                   'base': {'prismatic': ['ground', 'sled']},
                   'column': {'prismatic': ['sled', 'shoe'], 'axis': '90 deg'},
                   'clutch': {'slot': ['driver', 'shoe'], 'friction': {'coefficient': mu}}},
        'loads': {'press': {'at': 'shoe', 'force': [0.0, -F]},
                  'push': {'at': 'driver', 'force': [push, 0.0]}},
        'gravity': [0.0, 0.0], 'duration': end,
    })  # fmt: skip
    solution = ms.simulate(machine)
    x = solution.sample(np.array([0.0, end]))
    along = min(share, 1.0) * mu * F
    for link, a in (('driver', (push - along) / M), ('sled', along / m)):
        assert x[f'acceleration.{link}'] == pytest.approx(a, rel=1e-12)
        assert x[f'velocity.{link}'][1] == pytest.approx(a * end, rel=1e-12)
    slid = x['position.driver'][1] - x['position.sled'][1]
    work = push * (x['position.driver'][1] - x['position.driver'][0])
    assert solution.energy.dissipated + work == pytest.approx(mu * F * slid, abs=1e-9)
    assert (slid > 0.01) == (share > 1.0)


@pytest.mark.sample(2)
@pytest.mark.parametrize('mu', [0.0, 0.05, 0.1, 0.17])
def test_a_wedge_lifts_and_lowers_and_holds(mu):
    frictions = {f'joints.{n}.friction.coefficient': mu for n in ('bed', 'guide', 'face')}
    for speed in (0.02, -0.02):
        scene = variant('wedge', {**frictions, 'drive.speed': speed})
        cycle = ms.cycle(made(scene, 'wedge'), duration=1.0)
        way = math.copysign(1.0, speed)
        assert cycle['drive_torque'] == pytest.approx(lifted(mu, way), rel=1e-9)
        if mu and way > 0.0:
            frictionless = 1000.0 * math.tan(math.radians(20.0))
            assert cycle.efficiency == pytest.approx(frictionless / lifted(mu), rel=1e-9)
        elif mu == 0.0:
            assert cycle.efficiency is None
    # lowering takes a push as soon as friction holds the load by itself
    assert (lifted(mu, -1.0) < 0.0) == (mu > math.tan(math.radians(10.0)))


@pytest.mark.parametrize('mass', [0.0, 3.0])
@pytest.mark.parametrize('load', [1e-9, 1.0, 1e12])
def test_a_wedge_lifts_any_load_alike(load, mass):
    """Of links without mass or with mass, which creep and have no weight here."""
    scene = variant('wedge', {
        'loads.weight.force': [0.0, -load], 'drive.speed': 1e-6,
        'links.wedge.mass': mass, 'links.follower.mass': mass,
    })  # fmt: skip
    force = ms.cycle(made(scene, 'wedge'), duration=1.0)['drive_torque']
    assert force * (1000.0 / load) == pytest.approx(lifted(0.1), rel=1e-13)


@pytest.mark.slow
def test_a_slider_a_micrometre_long_rubs_however_slowly_it_moves():
    """At a turn in a week it slides by 1e-11 m/s; its friction goes by its force alone."""
    losses = []
    for size, speed in ((1e-6, '1e-5 rad/s'), (1.0, '1 rad/s')):
        rubs = {'coefficient': 0.2}
        machine = made({
            'links': {'crank': {'length': size, 'mass': 0.0},
                      'rod': {'length': 3.0 * size, 'mass': 0.0}, 'block': {'mass': 0.0}},
            'joints': {'ground_crank': {'revolute': ['ground', 'crank']},
                       'crank_rod': {'revolute': ['crank.end', 'rod']},
                       'rod_block': {'revolute': ['rod.end', 'block']},
                       'guide': {'prismatic': ['ground', 'block'], 'friction': rubs}},
            'loads': {'across': {'at': 'block', 'force': [0.0, -1.0]}},
            'drive': {'coordinate': 'crank', 'speed': speed}, 'gravity': [0.0, 0.0],
            'guess': {'rod': 0.0, 'block': 4.0 * size},
        })  # fmt: skip
        losses.append(ms.cycle(machine)['drive_torque'] / size)
    assert losses[0] == pytest.approx(losses[1], rel=1e-12, abs=1e-12)
    assert np.abs(losses[1]).max() > 0.1


def test_a_wedge_that_its_follower_drives_locks():
    """tan(20 deg) = 0.364 is the least friction of the face alone that does."""
    for mu, locks in ((0.35, False), (0.38, True)):
        scene = variant('wedge', {
            'joints.bed.friction.coefficient': 0.0, 'joints.guide.friction.coefficient': 0.0,
            'joints.face.friction.coefficient': mu,
            'drive': {'coordinate': 'follower', 'speed': -0.01, 'start_position': 0.0},
            'guess': {'wedge': 0.0},
            'loads.weight': {'at': 'wedge', 'force': [100.0, 0.0]},
        })  # fmt: skip
        machine = made(scene, 'wedge')
        if locks:
            with pytest.raises(RunError, match='friction locks the machine, follower at'):
                ms.cycle(machine, duration=1.0)
            continue
        tilt = math.radians(20.0) - math.atan(mu)
        force = ms.cycle(machine, duration=1.0)['drive_torque']
        assert force == pytest.approx(-100.0 / math.tan(tilt), rel=1e-9)


def test_a_drawer_jams():
    """A pin at a height y over the middle of a guide of length L moves it if 2 mu y < L."""
    length, mu, radius = 0.03, 0.35, 0.05
    scene = variant('scotch_yoke', {
        'joints.ground_yoke.friction': {'coefficient': mu, 'length': length},
        'gravity': [0.0, 0.0],
        'links.crank.length': radius, 'drive': {'speed': 1.0, 'start_angle': 0.0},
    })  # fmt: skip
    machine = made(scene, 'drawer')
    jam = math.asin(length / (2.0 * mu * radius))
    with pytest.raises(RunError, match='friction locks') as caught:
        ms.cycle(machine)
    at = float(str(caught.value).partition(' at ')[2].partition(' deg')[0])
    assert 0.0 < at - math.degrees(jam) < 1.1  # the first sample beyond
    before = ms.cycle(machine, duration=jam - 1e-3)
    assert before['drive_torque'][-1] > 30.0 * before['drive_torque'][10]


def by_hand(q, v, a, mu, radii, wall, load):
    """Torque of a slider-crank by the equations of each link, friction and all.

    Positions of crank, rod and piston with rates and accelerations; journals rub by
    ``mu r |R|/sqrt(1 + mu^2)``, the piston by its two ends.
    """
    (th, ph, _), (w, u, s), (dw, du, ds) = q, v, a
    r, L, g2, g3 = 0.05, 0.2, 0.015, 0.07
    e2, e3 = np.array([math.cos(th), math.sin(th)]), np.array([math.cos(ph), math.sin(ph)])
    n2, n3 = np.array([-e2[1], e2[0]]), np.array([-e3[1], e3[0]])
    a2 = g2 * (dw * n2 - w * w * e2)
    a3 = r * (dw * n2 - w * w * e2) + g3 * (du * n3 - u * u * e3)
    weight = np.array([0.0, -G])

    def cross(x, y):
        return x[0] * y[1] - x[1] * y[0]

    def left(z, frictions):
        R1, R2, R3, N, M, torque = z[:2], z[2:4], z[4:6], z[6], z[7], z[8]
        T1, T2, T3, F = frictions
        return np.array([
            *(R1 - R2 + 0.8 * weight - 0.8 * a2),
            T1 - T2 + torque + cross(-g2 * e2, R1) - cross((r - g2) * e2, R2) - 7e-4 * dw,
            *(R2 - R3 + 0.6 * weight - 0.6 * a3),
            T2 - T3 + cross(-g3 * e3, R2) - cross((L - g3) * e3, R3) - 2.8e-3 * du,
            R3[0] + F + load - 0.5 * ds, R3[1] + N - 0.5 * G, T3 + M,
        ])  # fmt: skip

    def friction_forces(z):
        ways, arms = np.sign([w, u - w, -u]), [mu / math.hypot(1.0, mu) * x for x in radii]
        T = [
            -x * s * np.hypot(*z[k : k + 2]) for x, s, k in zip(arms, ways, (0, 2, 4), strict=True)
        ]
        ends = abs(z[6] / 2 + z[7] / wall[1]) + abs(z[6] / 2 - z[7] / wall[1])
        return [*T, -wall[0] * ends * np.sign(s)]

    z = np.zeros(9)
    for _ in range(200):  # friction of the forces that friction changes
        frictions = friction_forces(z)
        none = left(np.zeros(9), frictions)
        matrix = np.array([left(unit, frictions) - none for unit in np.eye(9)]).T
        z = np.linalg.solve(matrix, -none)
    return z


@pytest.mark.slow
def test_a_compressor_by_the_equations_of_its_links():
    cycle = ms.cycle(ms.load_scene('rubbing_compressor'), samples=24)
    links = 'crank', 'rod', 'piston'
    for k in range(1, 24):
        if k in (6, 12, 18):
            continue  # the rod or the piston turns back
        state = [[cycle[f'{x}.{n}'][k] for n in links]
                 for x in ('position', 'velocity', 'acceleration')]  # fmt: skip
        load = -2000.0 if cycle['velocity.piston'][k] > 0.0 else 0.0
        z = by_hand(*state, 0.08, (0.02, 0.015, 0.01), (0.1, 0.06), load)
        assert cycle['drive_torque'][k] == pytest.approx(z[8], rel=1e-7, abs=1e-7)
        assert cycle['reaction.crank_rod.x'][k] == pytest.approx(z[2], rel=1e-7, abs=1e-6)
        assert cycle['reaction.ground_piston.moment'][k] == pytest.approx(z[7], abs=1e-7)


@pytest.mark.slow
def test_the_losses_are_what_the_drives_do_more():
    cycle = ms.cycle(ms.load_scene('rubbing_compressor'))
    ideal = variant('rubbing_compressor', {})
    for joint in ideal['joints'].values():
        joint.pop('friction')
    other = ms.cycle(made(ideal, 'ideal'))
    assert 1.0 - cycle.efficiency == pytest.approx(
        1.0 - other.mean_power / cycle.mean_power, rel=1e-6
    )
    lost = sum(cycle[n] for n in cycle.table() if n.startswith('friction_loss.'))
    assert (lost >= 0.0).all()
    power = cycle['drive_power'] - lost
    gas = np.where(cycle['velocity.piston'] > 0.0, -2000.0, 0.0) * cycle['velocity.piston']
    stored = sum(
        m * (cycle[f'velocity.{n}'] * cycle[f'acceleration.{n}']) * x
        for n, m, x in (('piston', 0.5, 1.0),)
    )
    turning = 2.8e-3 * cycle['velocity.rod'] * cycle['acceleration.rod']
    # of the rod's centre: A + 0.07 m along it
    th, ph = cycle['position.crank'], cycle['position.rod']
    w, u, du = cycle['velocity.crank'], cycle['velocity.rod'], cycle['acceleration.rod']
    vx, vy = (
        -0.05 * w * np.sin(th) - 0.07 * u * np.sin(ph),
        0.05 * w * np.cos(th) + 0.07 * u * np.cos(ph),
    )
    ax = -0.05 * w**2 * np.cos(th) - 0.07 * (du * np.sin(ph) + u**2 * np.cos(ph))
    ay = -0.05 * w**2 * np.sin(th) + 0.07 * (du * np.cos(ph) - u**2 * np.sin(ph))
    rod = 0.6 * (vx * ax + vy * ay) + 0.6 * G * vy
    crank = 0.8 * G * 0.015 * w * np.cos(th)
    kept = slice(1, 180)  # beyond the dead positions the gas sets in
    assert (power + gas)[kept] == pytest.approx((stored + turning + rod + crank)[kept], abs=1e-8)


@pytest.mark.slow
def test_forces_forwards_are_those_backwards():
    """A torque-driven run, and the torque that its own motion takes by the other solution."""
    drive = {'drive': {'coordinate': 'crank', 'speed': 40.0,
                       'torque': {'constant': 4.0, 'per_speed': -0.06}},
             'loads': {'gas': {'at': 'piston', 'force': ['-30*vx', 0.0]}}}  # fmt: skip
    scene = variant('rubbing_compressor', drive)
    solution = ms.simulate(made(scene, 'free'), duration=0.6)
    given = made({**scene, 'drive': {'speed': 1.0}}, 'given')
    t = np.linspace(0.003, 0.597, 100)
    seen = solution.sample(t)
    q, v, a = (
        np.array([seen[f'{x}.{n}'] for n in ('crank', 'rod', 'piston')])
        for x in ('position', 'velocity', 'acceleration')
    )
    back = given.nominal.inverse_dynamics(q, v, a)
    torque = 4.0 - 0.06 * seen['velocity.crank']
    assert back.drive_torque[0] == pytest.approx(torque, abs=1e-8)
    assert solution.energy.residual == pytest.approx(0.0, abs=1e-9 * seen['energy.dissipated'][-1])
    # rod and piston turn back, each at its own instants
    assert (np.diff(solution.motion.acting.astype(int), axis=0) != 0).any(axis=0)[2:].all()


@pytest.mark.slow
def test_a_pause_changes_nothing():
    """What presses and where forces point goes on with the rest, to the bit."""
    scene = variant('rubbing_compressor', {
        'drive': {'coordinate': 'crank', 'speed': 40.0, 'torque': {'constant': 4.0}}
    })  # fmt: skip
    machine = made(scene, 'free')
    whole, first = machine.start(), machine.start()
    whole.advance(0.2, final=True)
    first.advance(0.137)
    paused = replace(first.snapshot(), machine=machine.fingerprint)
    assert -1.0 in paused.rubbing
    rest = machine.resume(paused)
    rest.advance(0.2, final=True)
    assert rest.state == whole.state


@pytest.mark.slow
def test_a_tight_pin_is_the_limit_of_a_loose_one():
    """The loose pin's force is tangent to the same circle, but for its clearance.

    It swings about that place, undamped, from a start beside it by the angle of friction: what is
    lost in a turn differs by the square of that.
    """

    def turn(mu, **keys):
        scene = variant('slider_crank', {
            'drive.speed': '60 rpm', 'joints.crank_rod': {'revolute': ['crank.end', 'rod'], **keys}
        })  # fmt: skip
        scene |= {'start': 'seated'} if 'clearance' in keys else {}
        solution = ms.simulate(made(scene, 'pin'), revolutions=1)
        seen = solution.sample(
            np.linspace(0.0, 1.0, 11),
            'reaction.crank_rod.x',
            'reaction.crank_rod.y',
            'reaction.crank_rod.moment',
            'energy.dissipated',
        )
        force = np.hypot(seen['reaction.crank_rod.x'], seen['reaction.crank_rod.y'])
        arm = seen['reaction.crank_rod.moment'] / force / (0.01 * mu / math.hypot(1.0, mu))
        return arm, seen['energy.dissipated'][-1]

    for mu in (0.02, 0.2):
        arm, tight = turn(mu, friction={'coefficient': mu, 'radius': 0.01})
        assert arm == pytest.approx(np.ones(11), abs=1e-9)
        for radial in (1e-5, 1e-6):
            play = {'radial': radial, 'restitution': 0.0, 'friction': mu, 'pin_radius': 0.01}
            arm, loose = turn(mu, clearance=play)
            assert arm == pytest.approx(np.full(11, 1.0 + radial / 0.01), abs=1e-9)
            assert loose / tight == pytest.approx(1.0, abs=0.5 * mu**2 + 2.0 * radial / 0.01)


@pytest.mark.parametrize(
    ('change', 'sentence'),
    [
        ({'joints.ground_crank.friction': {'coefficient': 0.1}}, "friction needs a 'radius'"),
        ({'joints.ground_crank.friction': {'coefficient': 0.1, 'radius': 0.01, 'length': 1.0}},
         'length has no meaning in a revolute joint'),
        ({'joints.ground_piston.friction': {'coefficient': 0.1, 'radius': 0.01}},
         'radius has no meaning in a prismatic joint'),
        ({'joints.ground_piston.friction': {'coefficient': -0.1}}, 'coefficient'),
        ({'joints.crank_rod.clearance': {'radial': 1e-4, 'restitution': 0.5}},
         "the joint is loose: give the friction .* in its 'clearance'"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(change, sentence):
    with pytest.raises(InputError, match=sentence):
        made(variant('rubbing_compressor', change), 'wrong')


def rubbing(name, joint, **friction):
    scene = variant(name, {})
    keys = {k: x for k, x in scene['joints'][joint].items() if k != 'lift_off'}
    scene['joints'][joint] = {**keys, 'friction': friction}
    for link, given in scene['links'].items():
        if link != 'ground' and 'mass' not in given:
            given.update(mass=1.0, inertia=1e-3)
    return made(scene, name)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('name', 'pin'),
    [
        ('rise_dwell_return', None),
        ('eccentric_cam', None),
        pytest.param('valve_train', None, marks=pytest.mark.slow),
        ('offset_roller_cam', 1e-3),
    ],
)
def test_followers_rub_where_they_touch(name, pin):
    """By the speed of sliding that the shape of the cam has, from `joints.cam.touch`."""
    keys = ms.load_scene(name).scene.joints
    joint = next(n for n, j in keys.items() if j.kind == 'cam')
    mu = 0.1 * (pin / keys[joint].roller if pin else 1.0)
    cycle = ms.cycle(rubbing(name, joint, coefficient=0.1, **({'radius': pin} if pin else {})))
    force = np.hypot(cycle[f'reaction.{joint}.x'], cycle[f'reaction.{joint}.y'])
    normal = force / math.hypot(1.0, mu)
    lost = cycle[f'friction_loss.{joint}']
    assert lost == pytest.approx(mu * normal * np.abs(cycle[f'sliding_speed.{joint}']), abs=1e-9)
    assert lost.max() > 1e-5


@pytest.mark.slow
def test_a_roller_rubs_on_that_wall_of_its_groove_that_it_presses():
    """The groove is between two circles about the cam's middle; forces by sines and cosines."""
    mu, e, roller, pin = 0.2, 0.01, 0.008, 2e-3
    scene = variant('groove_cam', {})
    scene['joints']['contact'] |= {
        'groove': {'clearance': 0}, 'friction': {'coefficient': mu, 'radius': pin},
    }  # fmt: skip
    machine = made(scene, 'groove')
    cycle = ms.cycle(machine)
    angle, w = cycle['position.cam'], cycle['velocity.cam']
    pair = machine.mechanism.joint('contact')
    middle = e * np.array([np.cos(angle), np.sin(angle)])
    middle *= 1.0 if pair.profile(np.zeros((2, 1)))[0, 0] >= 0.0 else -1.0
    high = middle[1] + np.sqrt(0.04**2 - middle[0] ** 2)  # of the roller's middle
    other = -middle[1] + np.sqrt(0.04**2 - middle[0] ** 2)
    if np.ptp(high - cycle['position.follower']) > np.ptp(other - cycle['position.follower']):
        middle, high = -middle, other
    assert np.ptp(high - cycle['position.follower']) < 1e-12
    n = (np.array([np.zeros_like(high), high]) - middle) / 0.04
    force = np.array([cycle['reaction.contact.x'], cycle['reaction.contact.y']])
    N, T = (n * force).sum(axis=0), n[0] * force[1] - n[1] * force[0]
    assert (N > 5.0).sum() > 50 < (N < -5.0).sum()
    x, y = -np.sign(N) * roller * n + np.array([np.zeros_like(high), high])
    vx, vy = w * y, cycle['velocity.follower'] - w * x  # of the follower there, less the cam's
    slip = n[0] * vy - n[1] * vx
    share = mu * pin / roller
    assert pytest.approx(-share * np.abs(N) * np.sign(slip), abs=1e-6) == T
    lost = cycle['friction_loss.contact']
    assert lost == pytest.approx(share * np.abs(N * slip), abs=1e-6)


def test_a_rack_rubs_alike_in_every_slot():
    mu, r = 0.1, 0.04
    machine = rubbing('linear_intermittent', 'crank_rack', coefficient=mu)
    solution = ms.simulate(machine, revolutions=2.4)
    x = solution.sample(
        np.linspace(0.01, solution.duration, 200),
        'reaction.crank_rack.x',
        'position.crank',
        'velocity.crank',
        'reaction.crank_rack.y',
    )
    N, angle, w = x['reaction.crank_rack.x'], x['position.crank'], x['velocity.crank']
    along = -mu * np.abs(N) * np.sign(-w * r * np.cos(angle))
    assert x['reaction.crank_rack.y'] == pytest.approx(along, abs=1e-9)
    assert (np.abs(along[-50:]) > 0.01).any()


@pytest.mark.slow
def test_a_geneva_wheel_rubs_while_its_pin_is_in_a_slot():
    """The pin slides along the slot as its distance from the wheel's centre changes."""
    mu, r, d = 0.1, 0.05, 0.05 * math.sqrt(2.0)
    cycle = ms.cycle(rubbing('geneva', 'crank_wheel', coefficient=mu))
    angle, w = cycle['position.crank'], cycle['velocity.crank']
    away = np.sqrt(r * r + d * d - 2.0 * r * d * np.cos(angle))
    rate = np.where(away < r * (1.0 + 1e-9), r * d * np.sin(angle) * w / away, 0.0)
    force = np.hypot(cycle['reaction.crank_wheel.x'], cycle['reaction.crank_wheel.y'])
    lost = mu / math.hypot(1.0, mu) * force * np.abs(rate)
    assert cycle['friction_loss.crank_wheel'] == pytest.approx(lost, abs=1e-9)
    assert (lost > 0.0).sum() > 50


def test_teeth_lose_what_their_path_of_contact_says():
    mu = 1e-3
    machine = rubbing('gear_pair', 'mesh', coefficient=mu)
    lost = 1.0 - ms.cycle(machine).efficiency
    pair = Pair(*(wheel.gear for wheel in machine.mechanism.joint('mesh').wheels))
    assert lost == pytest.approx(1.0 - pair.efficiency(mu), rel=2.0 * mu)


@pytest.mark.parametrize(
    ('name', 'joint', 'friction', 'sentence'),
    [
        ('gear_pair', 'mesh', {'efficiency': 0.9}, "of a chain its 'efficiency'"),
        ('offset_roller_cam', None, {}, "friction needs a 'radius', that of the roller's pin"),
        ('rise_dwell_return', None, {'radius': 0.01}, 'is that of the pin of a roller'),
        ('groove_cam', None, {'radius': 0.001}, "friction of its walls in its 'clear"),
        ('gear_pair', 'mesh', {'length': 0.01}, 'length has no meaning in a mesh joint'),
    ],
)  # fmt: skip
def test_what_cannot_rub_is_refused(name, joint, friction, sentence):
    keys = variant(name, {})['joints']
    joint = joint or next(n for n, j in keys.items() if 'cam' in j)
    keys = {**keys[joint], 'friction': {'coefficient': 0.1, **friction}}
    with pytest.raises(InputError, match=sentence):
        made(variant(name, {f'joints.{joint}': keys}), name)


@pytest.mark.slow
def test_there_is_no_efficiency_where_loads_drive_the_machine_too():
    """Of a chain with 0.15 +- 4 N m on its wheel, which gives more than the drive; or none at all.

    A load that takes nothing leaves all to friction, but for rounding.
    """
    scene = {
        'mechanism': 'linkage',
        'links': {
            'ground': {'points': {'f': [0.4, 0.1]}},
            'a': {'mass': 2.0, 'inertia': 0.003},
            'b': {'mass': 6.0, 'inertia': 0.08},
        },
        'joints': {
            'sa': {'revolute': ['ground', 'a']},
            'sb': {'revolute': ['ground.f', 'b']},
            'belt': {
                'belt': ['a', 'b'], 'radii': [0.04, 0.1], 'friction': {'efficiency': 0.9},
            },
        },
        'drive': {'coordinate': 'a', 'speed': 30.0},
    }  # fmt: skip
    torque = {'l': {'at': 'b', 'torque': '0.15 + 4*sin(b*2.5)'}}
    driven = ms.cycle(scene | {'loads': torque})
    assert driven.efficiency is None
    assert 'loads drive the machine, too' in report.render(driven)
    assert ms.cycle(scene | {'loads': {'l': {'at': 'b', 'torque': -5.0}}}).efficiency == (
        pytest.approx(0.9, rel=1e-9)
    )
    alone = ms.cycle(
        ms.load_scene('slider_crank', {'joints.ground_piston.friction.coefficient': 0.2})
    )
    assert alone.efficiency == 0.0


def test_the_efficiency_is_said():
    assert 'efficiency 0.59578' in run('cycle', 'wedge').stdout
    assert run_json('cycle', 'wedge')['efficiency'] == pytest.approx(0.595783, abs=1e-6)


def test_the_equations_show_it():
    """The wedge with its pin pressed across the slot, and rubbing along it."""
    shown = ' '.join(run('check', 'wedge', '--equations').stdout.split())
    assert 'lambda1_face*nx_face + T_bed - T_face*ux_face + F_wedge' in shown
    assert '|T_guide| <= 0.1 times the force across guide' in shown


@pytest.mark.sample(1)
@pytest.mark.parametrize('hand', ['right', 'left'])
def test_a_worm_is_as_efficient_as_its_lead_angle_allows(hand):
    """``tan(lambda)/tan(lambda + phi)`` with ``tan phi = mu/cos(phi_n)``, either hand."""
    lead, press = math.radians(10.0), math.radians(20.0)
    torque = 20.0 if hand == 'left' else -20.0
    for mu in (0.02, 0.3):
        scene = variant('worm_drive', {
            'joints.pair.friction': {'coefficient': mu}, 'joints.pair.hand': hand,
            'loads.brake.torque': torque,
        })  # fmt: skip
        machine = made(scene, 'worm')
        cycle = ms.cycle(machine)
        expected = math.tan(lead) / math.tan(lead + math.atan(mu / math.cos(press)))
        assert cycle.efficiency == pytest.approx(expected, rel=1e-9)
        assert cycle['drive_torque'] == pytest.approx(20.0 / 15.0 / expected, rel=1e-9)
        pair = machine.mechanism.joint('pair').worm
        forces = worm_forces(pair, 20.0 / 15.0 / expected, mu)
        for gear, side in (('worm', forces.driver), ('wheel', forces.driven)):
            for part in ('tangential', 'radial', 'axial'):
                seen = np.abs(cycle[f'tooth_force.pair.{gear}.{part}'])
                assert seen == pytest.approx(getattr(side, part), rel=1e-7)


@pytest.mark.parametrize('speed', [0.0, 300.0])
def test_a_worm_locks_itself_from_its_friction_on(speed):
    """The wheel drives the worm where ``mu < cos(phi_n) tan(lambda)``; else it comes to rest."""
    locking = math.cos(math.radians(20.0)) * math.tan(math.radians(10.0))
    for mu, locks in ((0.99 * locking, False), (1.01 * locking, True)):
        scene = variant('worm_drive', {
            'joints.pair.friction': {'coefficient': mu},
            'drive': {'coordinate': 'worm', 'speed': speed, 'torque': {'constant': 0.0}},
        })  # fmt: skip
        solution = ms.simulate(made(scene, 'worm'), duration=0.3)
        end = solution.sample(np.array([0.3]), 'velocity.worm')['velocity.worm'][0]
        assert abs(end) < 1e-9 if locks else end < -20.0
        assert abs(solution.energy.residual) < 1e-10


def test_bevel_teeth_lose_what_their_virtual_spur_gears_do():
    """[V]'s loss along the path of contact, of the gears that roll like the cones' backs."""
    mu, press, teeth = 1e-3, math.radians(20.0), (20, 40)
    scene = variant('bevel_pair', {'joints.pair.friction': {'coefficient': mu}})
    lost = 1.0 - ms.cycle(made(scene, 'bevel')).efficiency
    cones = math.atan2(20, 40), math.atan2(40, 20)
    virtual = [n / math.cos(c) for n, c in zip(teeth, cones, strict=True)]
    reach = [
        math.sqrt((n / 2 + 1) ** 2 - (n / 2 * math.cos(press)) ** 2) - n / 2 * math.sin(press)
        for n in virtual
    ]
    pitch, s = math.pi * math.cos(press), np.linspace(-reach[1], reach[0], 400_001)
    touching = sum((s + k * pitch >= s[0]) & (s + k * pitch <= s[-1]) for k in range(-3, 4))
    integral = np.trapezoid(np.abs(s) / touching, s)
    expected = 2.0 * math.pi * mu / pitch**2 * sum(1.0 / n for n in virtual) * integral
    assert lost == pytest.approx(expected, rel=1e-3)


def test_a_force_that_friction_cancels_is_found_to_the_rounding_of_what_it_is_made_of():
    """Bounds of random T, chosen such that one component vanishes; then what it is without T."""
    random = np.random.default_rng(0)
    count, mu, resolution = 4000, 0.02, 1e-8
    ways = random.choice([-1.0, 1.0], (2, count))
    slopes = random.uniform(-5.0, 5.0, (2, 2, count))
    with_friction = np.array(
        [random.uniform(-30.0, 30.0, count), random.uniform(-1e-8, 1e-8, count)]
    )
    T = ways * mu * np.hypot(with_friction, resolution)
    start = with_friction - np.einsum('mcn,mn->cn', slopes, T)
    numbers = np.tile([[mu], [resolution]], (2, count))
    found, sound = solve_friction(start, slopes, numbers, ways, [[(1, 0)], [(1, 0)]])
    assert sound.all()
    assert found == pytest.approx(T, abs=1e-12)


def test_mild_friction_is_found_at_once_as_iteration_finds_it(monkeypatch):
    """Moments and forces of joints that load each other little: ``T = sign b(T)`` contracts."""
    bounds, asked = joint_friction._bounds, []
    monkeypatch.setattr(
        joint_friction, '_bounds', lambda *args: asked.append(args) or bounds(*args)
    )
    random = np.random.default_rng(3)
    count, sizes = 500, [[(2, 0)], [(2, 0), (1, 0)], [(1, 1)]]
    units = np.array([1e-3, 1.0, 1.0])  # [m] of the first T
    start = random.uniform(-50.0, 50.0, (6, count))
    slopes = random.uniform(-1.0, 1.0, (3, 6, count)) / units[:, None, None]
    ways = random.choice([-1.0, 1.0], (3, count))
    numbers = np.tile([[0.05], [1e-9]], (4, count))
    numbers[0] *= units[0]
    found, sound = solve_friction(start, slopes, numbers, ways, sizes)
    assert sound.all()
    assert len(asked) < 8
    T = np.zeros((3, count))
    for _ in range(100):
        components = start + np.einsum('mcn,mn->cn', slopes, T)
        T = ways * bounds(components, slopes, numbers, sizes)[0]
    assert found == pytest.approx(T, rel=1e-12, abs=1e-12)
