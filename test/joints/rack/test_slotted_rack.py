"""A slotted rack that stands anywhere, against the closed form of its motion and of its push."""

import math

import numpy as np
import pytest
from builders import without_work

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.export.skeleton import skeleton_of

RADIUS, SPEED, MASS = 0.04, 2.0 * math.pi, 1.2


def test_a_rack_may_stand_anywhere():
    """It moves by ``r (1 - cos)`` in the half turn in which the pin is on its right."""
    axis = 2.2
    c, s = math.cos(axis), math.sin(axis)
    x, y = 0.3, -0.2
    below = [x + 0.06 * s, y - 0.06 * c]
    machine = ms.load_scene('linear_intermittent', {
        'links.ground': {'points': {'crank': [x, y], 'guide': below}},
        'joints.ground_crank.revolute': ['ground.crank', 'crank'],
        'joints.rack_ground': {
            'prismatic': ['ground.guide', 'rack'], 'axis': axis, 'angle': axis,
        },
        'drive.start_angle': axis + 0.5 * math.pi, 'gravity': [0.0, 0.0],
    })  # fmt: skip
    solution = ms.simulate(machine, revolutions=1)
    t = np.linspace(0.0, solution.duration, 99)[1:-1]
    seen = without_work(solution, t)
    turned = SPEED * t - 0.5 * math.pi  # since the pin has entered
    moving = (turned > 0.0) & (turned < math.pi)
    moved = RADIUS * np.where(moving, 1.0 - np.cos(turned), np.where(turned > 0.0, 2.0, 0.0))
    assert seen['position.rack'] == pytest.approx(moved - RADIUS, abs=1e-14)
    push = MASS * RADIUS * SPEED**2 * np.where(moving, np.cos(turned), 0.0)
    force = [seen[f'reaction.crank_rack.{k}'] for k in 'xy']
    assert force == pytest.approx(np.outer((c, s), push), abs=1e-12)
    effort = solution.sample(t, 'driven_effort.crank_rack')['driven_effort.crank_rack']
    assert effort == pytest.approx(push, abs=1e-12)


def mirrored(sign: int, clearance: bool = False, **places: float):
    """The package's rack with all y and turns times `sign`; its places, or others [mm]."""
    guide, slot = (places.get(k, own) for k, own in (('guide', -60.0), ('slot', 30.0)))
    play = {'radial': 1e-4, 'restitution': 0.3, 'friction': 0.1, 'pin_radius': 5e-3}
    return ms.load_scene('linear_intermittent', {
        'links.ground.points.guide': [0.0, sign * 1e-3 * guide],
        'links.rack.points.slot': [0.0, sign * 1e-3 * slot],
        'gravity': [0.0, -9.81 * sign],
        'drive': {'speed': sign * SPEED, 'start_angle': sign * 0.5 * math.pi},
        **({'joints.crank_rack.clearance': play, 'start': 'centred'} if clearance else {}),
    })  # fmt: skip


@pytest.mark.sample(1)
@pytest.mark.parametrize('clearance', [False, True])
def test_a_mirrored_rack_has_the_mirrored_motion(clearance):
    """Also with play in its slots, over impacts."""
    names = ['position.rack', 'velocity.rack', 'reaction.crank_rack.x', 'reaction.crank_rack.y']
    names = names[:2] if clearance else names
    seen = []
    for sign in (1, -1):
        solution = ms.simulate(mirrored(sign, clearance), duration=0.9)
        t = np.linspace(0.0, 0.9, 93)[1:]
        seen.append(np.array([solution.sample(t, *names)[name] for name in names]))
    if not clearance:
        seen[1][3] *= -1.0
    assert seen[1] == pytest.approx(seen[0], abs=1e-10)


def test_slots_are_drawn_on_the_side_of_the_rack():
    drawn = []
    for sign in (1, -1):
        cycle = ms.cycle(mirrored(sign), samples=24)
        q = cycle.solution.view(cycle.t).observed.position
        shapes = skeleton_of(cycle.machine, q).shapes
        drawn.append(np.array([s.outline for s in shapes if s.kind == 'slot']))
    assert drawn[1] == pytest.approx(drawn[0] * [1.0, -1.0], abs=1e-9)


@pytest.mark.parametrize(
    ('guide', 'slot', 'half'), [(-60, 30, -1), (60, 30, 1), (60, -30, 1), (-60, -30, -1)]
)
def test_a_rack_is_moved_on_its_side_of_the_crank(guide, slot, half):
    """The pin's height decides where the rack is at rest, whichever side that is."""
    t = np.linspace(0.0, 1.0, 48)[1:-1]
    seen = ms.simulate(mirrored(1, guide=guide, slot=slot), duration=1.0).sample(
        t, 'velocity.rack', 'engaged.crank_rack'
    )
    height = np.cos(SPEED * t)  # of the pin over the crank's centre: it starts on top
    assert (seen['engaged.crank_rack'] == (half * height > 0.0)).all()
    speed = np.where(half * height > 0.0, -RADIUS * SPEED * height, 0.0)
    assert seen['velocity.rack'] == pytest.approx(speed, abs=1e-12)


def test_a_rack_through_the_centre_of_its_crank_is_refused():
    with pytest.raises(InputError, match='neither half of a turn is on its side'):
        mirrored(1, slot=60.0)
