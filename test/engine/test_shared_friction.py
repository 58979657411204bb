"""Friction that contacts share: how, nothing determines, but their sum moves what it should."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import mechanism_sim as ms
from mechanism_sim.engine.contact.compliant import HuntCrossley
from mechanism_sim.engine.physics import DynamicPhysics
from test.hard.bodies import Floor, ThrownBody

G = 9.81


def block(slope=0.0, push=(0.0, 0.0), feet=2, width=0.4, height=0.2, friction=0.5):
    """A block of 10 kg on feet on a slope [deg], pushed at the middle of its upper edge."""
    r, c, s = 1e-4, math.cos(math.radians(slope)), math.sin(math.radians(slope))
    places = np.linspace(-width / 2, width / 2, feet).tolist()
    return {
        'mechanism': 'linkage',
        'links': {
            'ground': {'points': {'far': [-2 * c, 2 * s], 'near': [2 * c, -2 * s]}},
            'block': {
                'mass': 10.0,
                'inertia': 10.0 * (width**2 + height**2) / 12,
                'points': {'top': [0, height / 2]}
                | {f'foot{k}': [x, r - height / 2] for k, x in enumerate(places)},
            },
        },
        'joints': {
            f'foot{k}': {
                'contact': [f'block.foot{k}', 'ground.far'], 'to': 'ground.near',
                'radii': [r, r], 'friction': {'coefficient': friction},
            }
            for k in range(feet)
        },
        'gravity': [0.0, -G],
        'loads': {'push': {'at': 'block.top', 'force': list(push)}},
        'initial': {
            'position': {
                'block': math.radians(-slope),
                'block.foot0': [-c * width / 2 + 2 * r * s, s * width / 2 + 2 * r * c],
            }
        },
        'duration': 1.0,
    }  # fmt: skip


@pytest.mark.parametrize(
    ('slope', 'feet'),
    [
        pytest.param(0.0, 2, marks=pytest.mark.slow), (0.0, 3),
        pytest.param(10.0, 2, marks=pytest.mark.slow), (20.0, 4), (30.0, 3),
    ],
)  # fmt: skip
def test_a_block_rests_on_its_feet_up_to_the_angle_of_friction(slope, feet):
    """Above, it slides by g (sin - mu cos), with the sum of the friction of all feet."""
    solution = ms.simulate(block(slope, feet=feet))
    at = solution.sample([0.0, 1.0])
    sine, cosine = math.sin(math.radians(slope)), math.cos(math.radians(slope))
    way = math.hypot(*(np.diff(at[f'position.block.{axis}'])[0] for axis in 'xy'))
    assert way == pytest.approx(0.5 * G * max(0.0, sine - 0.5 * cosine), abs=1e-10)
    held = sum(at[f'friction_force.foot{k}'][0] for k in range(feet))
    assert abs(held) == pytest.approx(10.0 * G * min(sine, 0.5 * cosine), abs=1e-7)
    # feet that carry nothing lie within rounding of the floor: they end no steps
    assert solution.stats.steps < 20


def test_what_rounding_exchanges_at_rest_is_not_resolved(monkeypatch):
    """Its work is known to a rounding of what gravity may exchange, and so is the balance."""
    seen, account = [], DynamicPhysics.account
    monkeypatch.setattr(
        DynamicPhysics, 'account', lambda *x: seen.append(len(x[2])) or account(*x)
    )
    solution = ms.simulate(block())
    assert sum(seen) <= 2 * len(solution.motion)
    assert abs(solution.energy.residual) <= solution.energy.rounding


@pytest.mark.parametrize('way', [1, -1])
def test_a_pushed_block_slides_when_the_feet_together_slide_and_tips_when_one_lifts(way):
    """Pushed at the top, by a force that grows: it tips at m g b/(2 h), or slides at mu m g."""
    for friction, width in ((1.0, 0.2), (0.2, 0.4)):
        scene = block(push=[f'{way}*30*t', 0], width=width, height=0.4, friction=friction)
        weight = 10.0 * G
        tips, slides = weight * width / 2 / 0.4 / 30.0, friction * weight / 30.0
        event = min(tips, slides)
        solution = ms.simulate(scene, duration=event + 0.2)
        at = solution.sample([0.0, event, event + 0.2])
        assert at['position.block.x'][1] == pytest.approx(at['position.block.x'][0], abs=1e-9)
        moved = at['position.block.x'][2] - at['position.block.x'][1]
        if slides < tips:
            assert way * moved == pytest.approx(30.0 * 0.2**3 / 6 / 10.0, rel=1e-6)
            assert at['position.block'][2] == pytest.approx(0.0, abs=1e-9)
        else:
            inertia, b, h = 10.0 * (width**2 + 0.4**2) / 3, width / 2, 0.4

            def about_a_foot(t, y, inertia=inertia, b=b, h=h, weight=weight):
                c, s = math.cos(y[0]), math.sin(y[0])
                moment = 30.0 * t * (h * c + b * s) - weight * (b * c - h / 2 * s)
                return [y[1], moment / inertia]

            own = solve_ivp(about_a_foot, (tips, tips + 0.2), [0.0, 0.0], rtol=1e-10, atol=1e-12)
            assert -way * at['position.block'][2] == pytest.approx(own.y[0, -1], rel=2e-3)
        assert abs(solution.energy.residual) < 1e-9 * max(solution.energy.exchanged, 1e-3)


@pytest.mark.parametrize('pads', [pytest.param(2, marks=pytest.mark.slow), 3])
def test_pads_of_a_brake_hold_a_drum_together(pads):
    """They give way at n mu N R, wherever they stand, and let it turn with what is over."""
    scene = {
        'mechanism': 'linkage',
        'links': {'drum': {'mass': 8.0, 'inertia': 0.2}}
        | {f'shoe{k}': {'mass': 1.5} for k in range(pads)},
        'joints': {'drum': {'revolute': ['ground', 'drum']}},
        'gravity': [0, 0],
        'loads': {'load': {'at': 'drum', 'torque': '60*t'}},
        'drive': {'coordinate': 'drum', 'torque': {}},
        'guess': {f'shoe{k}': 0.12 for k in range(pads)},
    }
    for k in range(pads):
        angle = math.tau / pads * k + 0.3
        scene['joints'][f'guide{k}'] = {'prismatic': ['ground', f'shoe{k}'], 'axis': angle}
        scene['joints'][f'pad{k}'] = {
            'arc_slot': [f'shoe{k}', 'drum'],
            'radius': 0.12,
            'clearance': {
                'radial': 2e-3, 'restitution': 0, 'friction': 0.25, 'pin_radius': 0.028,
            },
        }  # fmt: skip
        scene['loads'][f'press{k}'] = {
            'at': f'shoe{k}', 'force': [900 * math.cos(angle), 900 * math.sin(angle)],
        }  # fmt: skip
    slips = pads * 0.25 * 900 * 0.15 / 60.0
    solution = ms.simulate(scene, duration=slips + 0.5)
    at = solution.sample([0.1, slips, slips + 0.5])
    assert at['velocity.drum'][:2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert at['velocity.drum'][2] == pytest.approx(60.0 * 0.5**2 / 2 / 0.2, rel=1e-9)


def test_a_ladder_leaves_the_wall_at_two_thirds_of_its_height():
    """It starts where `initial` puts its ends, though its coordinates are those of its middle."""
    length, r, first = 4.0, 1e-6, math.radians(60.0)
    ends = {'corner': [0, 0], 'far': [10, 0], 'up': [0, 10]}
    scene = {
        'mechanism': 'linkage',
        'links': {
            'ground': {'points': ends},
            'ladder': {'length': length, 'mass': 10.0, 'inertia': 160.0 / 12, 'cog': 2.0},
        },
        'joints': {
            name: {'contact': [f'ladder.{end}', 'ground.corner'], 'to': f'ground.{to}',
                   'radii': [r, r]}
            for name, end, to in (('floor', 'start', 'far'), ('wall', 'end', 'up'))
        },
        'gravity': [0, -G],
        'initial': {
            'position': {
                'ladder.start': [length * math.cos(first) + 2 * r, 2 * r],
                'ladder.end': [2 * r, length * math.sin(first) + 2 * r],
            }
        },
    }  # fmt: skip
    solution = ms.simulate(scene, duration=1.0)
    (left,) = (x.t for x in solution.modes if x.joint == 'wall' and x.t > 0.0)
    last = math.asin(2.0 / 3.0 * math.sin(first))

    def pace(u):  # over the root of the angle fallen through, which is smooth at rest
        speed = 3 * G / length * (math.sin(first) - math.sin(first - u * u))
        return 2 * u / math.sqrt(speed) if u else 2 / math.sqrt(3 * G / length * math.cos(first))

    assert left == pytest.approx(quad(pace, 0, math.sqrt(first - last))[0], rel=1e-9)
    angle = solution.sample([left])['position.ladder'][0]
    assert math.sin(angle) == pytest.approx(2.0 / 3.0 * math.sin(first), rel=1e-9)


@pytest.mark.parametrize('slope', [0.0, 0.4])
@pytest.mark.parametrize('feet', [2, 3])
def test_soft_feet_at_the_same_depth_share_their_friction(slope, feet):
    """Their slips are one: both would stick by equations that are singular."""
    law, mu, speed = HuntCrossley(1e8, 0.3), 0.5, 0.3
    floors = [
        Floor('body', 0.3, mu, at=(x, 0.0), name=f'foot{x:+}', law=law)
        for x in np.linspace(-0.2, 0.2, feet).tolist()
    ]
    depth = law.resting_depth(G / feet)
    for v in (0.0, speed, -speed):
        body = ThrownBody(
            floors, (0.0, 0.0, -depth), (0.0, v, 0.0), gravity=(slope * G, -G), closed=True
        ).until(0.5)
        slows = mu * G - math.copysign(slope, v * slope) * G
        assert body.at(0.5) == pytest.approx([0.0, v * abs(v) / 2 / slows, -depth], abs=1e-12)
        assert body.at(0.5, 1) == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
        assert len(body.modes) < 30
        assert abs(body.audit.energy.residual) < 1e-12


@pytest.mark.parametrize('slope', [45.0, pytest.param(26.0, marks=pytest.mark.slow)])
def test_soft_feet_that_touch_from_the_start_carry(slope):
    """They begin some 1e-17 m inside, at rest: no guard falls through zero there."""
    scene = block(slope)
    law = {'law': 'hunt_crossley', 'stiffness': '1e8 N/m^1.5'}
    for joint in scene['joints'].values():
        joint |= {'compliance': law, 'restitution': 0.3}
        del joint['friction']
    at = ms.simulate(scene, duration=0.02).sample([0.0, 0.02])
    x, y = (np.diff(at[f'position.block.{axis}'])[0] for axis in 'xy')
    sine, cosine = math.sin(math.radians(slope)), math.cos(math.radians(slope))
    assert x * cosine - y * sine == pytest.approx(0.5 * G * sine * 0.02**2, rel=1e-3)
    assert abs(x * sine + y * cosine) < 2e-4  # the feet give way by 60 um at rest
