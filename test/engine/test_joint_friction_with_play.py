"""Friction in ideal joints of machines whose other joints are loose."""

import math
import pickle

import heyoka as hy
import numpy as np
import pytest
from builders import made

import mechanism_sim as ms
from mechanism_sim.engine.observer import Observer
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.symbolic import dense
from test.grid.case import variant

M, m, PLAY, PUSH = 2.0, 0.5, 1e-3, 1e3
STRIKES = math.sqrt(2.0 * PLAY * m / PUSH)  # [s] when
SPEED = PUSH / m * STRIKES


def ball(angle, mu, block, length=None, cog=0.0, **clearance):
    """A ball in the hole of a block that slides with friction, pushed against its wall."""
    scene = {
        'title': 'ball', 'gravity': [0.0, 0.0], 'start': 'centred',
        'links': {'block': {'mass': M, 'cog': cog},
                  'ball': {'mass': m, 'inertia': 2e-5, 'cog': 0.0}},
        'joints': {'guide': {'prismatic': ['ground', 'block'],
                             'friction': {'coefficient': mu, 'length': length}},
                   'hole': {'revolute': ['ball', 'block'],
                            'clearance': {'radial': PLAY, **clearance}}},
        'loads': {'push': {'at': 'ball',
                           'force': [PUSH * math.cos(angle), PUSH * math.sin(angle)]}},
        'initial': {'velocity': {'block': block}},
    }  # fmt: skip
    return made(scene, 'ball')


def struck(angle, mu, e, block):
    """Impulse of the hole's wall, and speed of the block after it.

    The guide gives ``p |sin|``, and ``mu`` times that against the slip that is left: forwards,
    backwards, or none at all.
    """
    C, S = math.cos(angle), abs(math.sin(angle))
    for way in (1.0, -1.0):
        p = (1.0 + e) * SPEED / (1.0 / m + C * (C - way * mu * S) / M)
        after = block + (C - way * mu * S) * p / M
        if after * way > 0.0:
            return p, after
    return ((1.0 + e) * SPEED + C * block) * m, 0.0


CASES = [
    (0.7, 0.3, 0.5, 0.0), (0.7, 0.3, 0.5, 1.0), (2.6, 0.3, 0.5, 1.0), (2.6, 0.3, 0.5, 0.1),
    (1.5, 0.3, 0.5, 0.0), (1.5, 0.3, 0.9, 0.05), (-0.4, 0.8, 0.7, -0.2), (2.0, 2.0, 0.8, 0.3),
]  # fmt: skip


@pytest.mark.sample(1)
@pytest.mark.parametrize('hypothesis', ['newton', 'stronge'])
def test_an_impact_makes_friction_in_a_guide(hypothesis):
    for angle, mu, e, block in CASES:
        machine = ball(angle, mu, block, restitution=e, hypothesis=hypothesis)
        solution = ms.simulate(machine, duration=1.2 * STRIKES)
        p, after = struck(angle, mu, e, block)
        first = solution.impacts[0]
        assert first.normal_impulse == pytest.approx(p, rel=1e-12)
        seen = solution.sample(np.array([1.1 * STRIKES]), 'velocity.block')
        assert seen['velocity.block'][0] == pytest.approx(after, abs=1e-12)
        assert abs(solution.energy.residual) < 1e-14
        of_ball = np.array([math.cos(angle), math.sin(angle)])
        own = SPEED * of_ball + np.array([block, 0.0])
        left = own - p / m * of_ball
        lost = 0.5 * m * (own @ own - left @ left) + 0.5 * M * (block**2 - after**2)
        assert first.energy_loss == pytest.approx(lost, abs=1e-12)


def test_the_friction_of_an_impact_bears_on_what_makes_it():
    """The impulse of a block off its guide turns it against both ends, less by its own friction.

    There ``T = 2 mu M/L`` of ``M = h (p - T)``, as if the block had ``1 + 2 mu h/L`` of its mass.
    """
    mu, e, h, length = 0.4, 0.5, 0.3, 0.2
    machine = ball(0.0, mu, 0.2, length=length, cog=[0.0, h], restitution=e)
    solution = ms.simulate(machine, duration=1.2 * STRIKES)
    mass = M * (1.0 + 2.0 * mu * h / length)
    first = solution.impacts[0]
    p = (1.0 + e) * first.approach_speed / (1.0 / m + 1.0 / mass)
    assert first.normal_impulse == pytest.approx(p, rel=1e-9)
    seen = solution.sample(np.array([1.1 * STRIKES]), 'velocity.block')
    assert seen['velocity.block'][0] == pytest.approx(0.2 + p / mass, rel=1e-9)
    assert abs(solution.energy.residual) < 1e-12


@pytest.mark.sample(1)
@pytest.mark.parametrize('case', [CASES[1], CASES[4]])
def test_a_stiff_wall_makes_the_same_friction(case):
    """By forces that grow and fall, and the friction of each instant."""
    angle, mu, _, block = case
    p, after = struck(angle, mu, 1.0, block)
    errors = []
    for stiffness in (1e12, 1e15):
        contact = {'law': 'hertz', 'stiffness': stiffness}
        machine = ball(angle, mu, block, restitution=1.0, contact=contact)
        solution = ms.simulate(machine, duration=1.2 * STRIKES)
        assert abs(solution.energy.residual) < 1e-11
        seen = solution.sample(np.array([1.1 * STRIKES]), 'velocity.block')
        errors.append(abs(solution.impacts[0].normal_impulse / p - 1.0))
        assert seen['velocity.block'][0] == pytest.approx(after, abs=2e-2)
    assert errors[1] < 0.3 * errors[0] < 6e-3


PINS = {'ground_crank': 0.02, 'crank_rod': 0.015, 'rod_piston': 0.01}


def slider_crank(mu, clearance=None, **more):
    """Every joint of a slider-crank rubs; the pin of its rod may be loose instead."""
    scene = variant('slider_crank', {'drive.speed': '600 rpm', 'start': 'seated', **more})
    for name, joint in scene['joints'].items():
        radius = {'radius': PINS[name]} if name in PINS else {}
        joint['friction'] = {'coefficient': mu, **radius}
    if clearance:
        scene['joints']['crank_rod'].pop('friction')
        scene['joints']['crank_rod']['clearance'] = clearance
    else:
        scene.pop('start')
    return made(scene, 'rubbing')


@pytest.mark.slow
def test_a_tight_pin_beside_rubbing_joints_is_the_limit_of_a_loose_one():
    mu = 0.1
    tight = ms.simulate(slider_crank(mu), revolutions=0.6)
    for radial in (4e-5, 4e-6):
        play = {'radial': radial, 'restitution': 0.0, 'friction': mu, 'pin_radius': 0.015}
        loose = ms.simulate(slider_crank(mu, play), revolutions=0.6)
        assert abs(loose.energy.residual) < 1e-9
        dissipated = loose.energy.dissipated / tight.energy.dissipated
        assert dissipated == pytest.approx(1.0, abs=0.5 * mu**2 + 2.0 * radial / 0.015)


def residuals(solution, mu):
    """Residuals of Newton's, Euler's and Coulomb's laws of rod and piston, in N and N m."""
    t = np.linspace(0.0, solution.duration, 203)[1:-1]
    now = solution.sample(t)
    sizes = {n: np.hypot(now[f'reaction.{n}.x'], now[f'reaction.{n}.y']) for n in PINS}
    force = {
        n: np.array([now[f'reaction.{n}.x'], now[f'reaction.{n}.y']])
        for n in (*PINS, 'ground_piston')
    }
    ph, u, du = now['position.rod'], now['velocity.rod'], now['acceleration.rod']
    e, n = np.array([np.cos(ph), np.sin(ph)]), np.array([-np.sin(ph), np.cos(ph)])
    piston = np.array([now['acceleration.piston'], np.zeros_like(t)])
    centre = piston - 0.13 * (du * n - u * u * e)
    weight = np.array([[0.0], [-9.81]])
    found = [0.6 * (weight - centre) + force['crank_rod'] - force['rod_piston'],
             0.5 * (weight - piston) + force['rod_piston'] + force['ground_piston']]  # fmt: skip
    arm = {'rod_piston': mu / math.hypot(1.0, mu) * 0.01}
    rubbing = now['reaction.rod_piston.moment']
    found.append(rubbing + arm['rod_piston'] * sizes['rod_piston'] * np.sign(-u))
    wall = force['ground_piston']
    found.append(wall[0] + mu * np.abs(wall[1]) * np.sign(now['velocity.piston']))

    def cross(a, b):
        return a[0] * b[1] - a[1] * b[0]

    found.append(
        -2.8e-3 * du - rubbing + now.get('reaction.crank_rod.moment', 0.0)
        + cross(-0.07 * e, force['crank_rod']) - cross(0.13 * e, force['rod_piston'])
    )  # fmt: skip
    return np.abs(np.concatenate([np.atleast_2d(x) for x in found])), sizes['crank_rod']


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    'more', [{}, {'contact': {'law': 'lankarani_nikravesh', 'stiffness': 1e9}}]
)
def test_links_of_a_loose_machine_obey_newton_and_coulomb(more):
    """Bouncing or pressed, rigid or compliant: the equations of each link, written out."""
    mu, play = 0.15, {'radial': 2e-4, 'restitution': 0.6, **more}
    solution = ms.simulate(slider_crank(mu, play, start='centred'), revolutions=0.4)
    left, pressed = residuals(solution, mu)
    assert (pressed == 0.0).any() or more
    assert (pressed > 10.0).any()
    assert left.max() < 1e-8 * max(1.0, pressed.max())
    exchanged = abs(solution.energy.drive_work) + solution.energy.dissipated
    assert abs(solution.energy.residual) < 1e-10 * exchanged
    assert len(solution.impacts) > (0 if more else 10)


def test_load_cells_need_impacts_without_friction_of_ideal_joints():
    scene = variant('slider_crank', {
        'joints.ground_crank.friction': {'coefficient': 0.1, 'radius': 0.01},
        'joints.crank_rod.clearance': {'radial': 1e-4, 'restitution': 0.5},
        'sensors.cell': {'kind': 'load_cell', 'joint': 'rod_piston', 'sample_rate': '10 kHz'},
    })  # fmt: skip
    with pytest.raises(InputError, match='impulses'):
        ms.simulate(made(scene, 'cell'), revolutions=0.1)


def yoke(radial, **keys):
    """A Scotch yoke, its pin loose in its slot, or not."""
    play = {'radial': radial, 'restitution': 0.0, 'friction': 0.2, **keys}
    rub = {'clearance': play} if radial else {'friction': {'coefficient': 0.2}}
    start = {'start': 'seated'} if radial else {}
    scene = variant('scotch_yoke', start)
    scene['joints']['crank_yoke'] |= rub
    return ms.simulate(made(scene, 'yoke'), revolutions=1.0)


@pytest.mark.slow
def test_a_tight_slot_is_the_limit_of_a_loose_one():
    tight = yoke(0.0).energy.dissipated
    off = [yoke(radial).energy.dissipated / tight - 1.0 for radial in (1e-3, 1e-4, 1e-5)]
    assert 0.0 < off[2] < 0.15 * off[1] < 0.03 * off[0] < 0.01


LIMITS = (
    ('geneva', 'crank_wheel', {}, lambda x: {'clearance': {'radial': x}}),
    ('gear_pair', 'mesh', {}, lambda x: {'backlash': {'width': x}}),
    ('linear_intermittent', 'crank_rack', {}, lambda x: {'clearance': {'radial': x}}),
    ('groove_cam', 'contact', {'radius': 2e-3},
     lambda x: {'groove': {'clearance': x, 'pin_radius': 2e-3}}),
)  # fmt: skip


@pytest.mark.parametrize(
    ('name', 'joint', 'pin', 'loose'),
    [pytest.param(*x, marks=[pytest.mark.slow] * (k != 1)) for k, x in enumerate(LIMITS)],
    ids=[x[0] for x in LIMITS],
)
def test_tight_walls_are_the_limit_of_loose_ones(name, joint, pin, loose):
    """Wheels, teeth, racks and grooves: losses differ by the play."""

    def dissipated(keys):
        scene = variant(name, {})
        scene['joints'][joint] |= keys
        solution = ms.simulate(made(scene, name), revolutions=1.0)
        assert abs(solution.energy.residual) < 1e-9 * solution.energy.dissipated
        return solution.energy.dissipated

    ideal = {'groove': {'clearance': 0}} if name == 'groove_cam' else {}
    tight = dissipated({**ideal, 'friction': {'coefficient': 0.1, **pin}})
    off = []
    for play in (1e-4, 1e-5):
        ((key, given),) = loose(play).items()
        found = dissipated({key: {**given, 'restitution': 0.0, 'friction': 0.1}})
        off.append(abs(found / tight - 1.0))
    assert off[1] < 0.15 * off[0] < 0.01


@pytest.mark.slow
def test_a_pin_drags_either_wall_of_a_wheel_along():
    scene = variant('geneva', {})
    play = {'radial': 1e-5, 'restitution': 0.0, 'friction': 0.1}
    scene['joints']['crank_wheel']['clearance'] = play
    solution = ms.simulate(made(scene, 'geneva'), revolutions=1.0)
    x = solution.sample(
        np.linspace(0.01, solution.duration, 300),
        'position.crank',
        'velocity.crank',
        'reaction.crank_wheel.x',
        'reaction.crank_wheel.y',
    )
    angle, w = x['position.crank'], x['velocity.crank']
    pin = 0.05 * np.array([np.cos(angle), np.sin(angle)]) - [[0.05 * math.sqrt(2.0)], [0.0]]
    away = np.hypot(*pin)
    rate = 0.05 * w * (pin[1] * np.cos(angle) - pin[0] * np.sin(angle)) / away
    fx, fy = x['reaction.crank_wheel.x'], x['reaction.crank_wheel.y']
    along, across = (pin[0] * fx + pin[1] * fy) / away, (pin[0] * fy - pin[1] * fx) / away
    inside = (away < 0.0499) & (np.abs(rate) > 1e-3) & (np.abs(across) > 0.1)
    for wall in (across > 0.0, across < 0.0):
        seen = inside & wall
        assert seen.sum() > 10
        dragged = 0.1 * np.abs(across) * np.sign(rate)
        assert along[seen] == pytest.approx(dragged[seen], rel=0.01)


def test_a_pin_rubs_where_it_touches_its_slot():
    """It slides by ``R w cos`` along the slot, and rolls on the wall by its radius."""
    radius = 0.01
    solution = yoke(1e-4, pin_radius=radius)
    t = np.linspace(0.0, solution.duration, 400)
    now = solution.sample(
        t, 'reaction.crank_yoke.x', 'reaction.crank_yoke.y', 'position.crank', 'velocity.crank'
    )
    N = now['reaction.crank_yoke.x']
    pressed = np.abs(N) > 1.0
    crank = ms.load_scene('scotch_yoke').mechanism.joint('crank_yoke').on_first[0]
    angle, w = now['position.crank'], now['velocity.crank']
    # the yoke's slot stands across its motion; the wall is where the pin presses
    slip = crank * w * np.cos(angle) + radius * w * np.sign(N)
    friction = now['reaction.crank_yoke.y']
    assert pressed.sum() > 300
    assert friction[pressed] == pytest.approx((0.2 * np.abs(N) * np.sign(slip))[pressed], rel=1e-9)


@pytest.mark.slow
def test_a_wall_without_friction_beside_contacts_that_rub_is_the_limit_of_one_with_hardly_any():
    """Teeth with backlash, a loose pin and an ideal bearing that rub: three sorts of contact."""
    link = {'length': 0.064, 'mass': 0.6, 'inertia': 0.0026}
    content = {
        'mechanism': 'linkage',
        'links': {
            'ground': {'points': {'m': [-0.12, 0.0]}},
            'motor': {'mass': 0.4, 'inertia': 3e-4},
            'crank': link,
            'bob': {'length': 0.1, 'mass': 0.5, 'inertia': 5e-4, 'cog': 0.05},
        },
        'gears': {
            'pinion': {'at': 'motor', 'teeth': 40, 'module': 0.002},
            'wheel': {'at': 'crank', 'teeth': 80, 'module': 0.002},
        },
        'joints': {
            'motor_bearing': {'revolute': ['ground.m', 'motor']},
            'bearing': {
                'revolute': ['ground', 'crank'], 'friction': {'coefficient': 0.1, 'radius': 0.01},
            },
            'mesh': {'mesh': ['pinion', 'wheel'], 'backlash': {'width': 1e-4, 'restitution': 0.4}},
            'pin': {
                'revolute': ['crank.end', 'bob'],
                'clearance': {
                    'radial': 1e-4, 'restitution': 0.4, 'friction': 0.1, 'pin_radius': 0.005,
                },
            },
        },
        'gravity': [0.0, -9.81],
        'drive': {'coordinate': 'motor', 'speed': 20.0},
    }  # fmt: skip
    machine = made(content)
    hardly = ms.load_scene(machine, {'joints.mesh.backlash.friction': 1e-9})
    found = [ms.simulate(m, duration=0.03) for m in (machine, hardly)]
    places = [one.sample([0.01, 0.03], 'position') for one in found]
    assert found[0].impacts
    assert found[0].energy.share < 1e-10
    for name in ('position.crank', 'position.bob'):
        assert places[0][name] == pytest.approx(places[1][name], abs=1e-7)


@pytest.mark.slow
def test_a_side_that_turns_over_quickly_does_not_spoil_the_series_of_what_slides():
    """A pin rolls in its bushing: what presses in the guide goes through zero within 1e-8 s.

    What would hold the piston is a quotient by that, of no use while it slides.
    """
    scene = {
        'title': 'whirl', 'gravity': [0.0, 0.0], 'start': 'centred',
        'solver': {'rtol': 1e-13},
        'links': {'crank': {'length': 0.05, 'cog': 0.015, 'mass': 0.8, 'inertia': 7e-4},
                  'rod': {'length': 0.2, 'cog': 0.07, 'mass': 0.6, 'inertia': 2.8e-3},
                  'piston': {'mass': 0.5}},
        'joints': {'ground_crank': {'revolute': ['ground', 'crank'],
                                    'clearance': {'radial': 1e-5, 'restitution': 0.05,
                                                  'friction': 0.5, 'pin_radius': 0.015}},
                   'crank_rod': {'revolute': ['crank.end', 'rod']},
                   'rod_piston': {'revolute': ['rod.end', 'piston']},
                   'ground_piston': {'prismatic': ['ground', 'piston'],
                                     'friction': {'coefficient': 0.17}}},
        'drive': {'coordinate': 'crank', 'speed': -81.0},
        'guess': {'rod': 0.0, 'piston': 0.25},
    }  # fmt: skip
    solution = ms.simulate(made(scene, 'whirl'), duration=0.0012)
    assert solution.duration == 0.0012
    assert abs(solution.energy.residual) < 1e-9 * solution.energy.exchanged


def test_terms_of_all_groups_share_their_parts():
    """heyoka walks through equal parts apart, each anew: a fifth of a second for each function."""
    keys = {
        'joints.ground_piston.friction.coefficient': 0.2,
        'joints.crank_rod.clearance': {
            'radial': 1e-4, 'restitution': 0.4, 'friction': 0.1, 'pin_radius': 0.005,
        },
    }  # fmt: skip
    groups = Observer(ms.load_scene('slider_crank', keys).equations.system)._terms.values()

    def size(terms):
        slots = [hy.make_vars(f'slot {k}') * dense(x) for k, x in enumerate(terms)]
        return len(pickle.dumps(hy.sum(slots)))  # shared parts are pickled once

    assert size([x for group in groups for x in group]) < 1.5 * max(
        map(size, filter(None, groups))
    )
