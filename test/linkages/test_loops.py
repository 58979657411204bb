"""Four-bars and slider-cranks in mechanisms: found, and put together again from what was found."""

from __future__ import annotations

import numpy as np
import pytest
from running import one_of
from textbook import slider_position

import mechanism_sim as ms
from mechanism_sim.joints.slot.constraint import PinInSlot
from mechanism_sim.linkages.four_bar import four_bars, slider_cranks
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.configuration import Constraints
from mechanism_sim.planar.mechanism import Mechanism, Prismatic, Revolute
from mechanism_sim.planar.points import GROUND, rotate
from mechanism_sim.scene.check import check
from mechanism_sim.scene.motion_notes import motion_notes

O = (0.0, 0.0)  # noqa: E741


def mechanism(*joints):
    links = dict.fromkeys(x for j in joints for x in (j.first, j.second) if x != GROUND)
    return Mechanism(tuple(Body(x, 0.0, 0.0, O) for x in links), joints, ())


@pytest.mark.parametrize('seed', range(20))
def test_a_slider_crank_moves_by_the_dimensions_that_are_found(seed):
    """Guide at any angle, named either way round; pin and frame of the slider anywhere."""
    random = np.random.default_rng(seed)
    pivot, at, pin, point = (tuple(random.uniform(-0.3, 0.3, 2)) for _ in range(4))
    axis, angle = random.uniform(-3.0, 3.0, 2)
    ends = (GROUND, 'slider', at, point) if seed % 2 else ('slider', GROUND, point, at)
    guide = Prismatic('guide', *ends, axis, angle)
    crank_pin = Revolute('A', 'rod', 'crank', O, (0.0, 0.4))
    rod_end = Revolute('B', 'slider', 'rod', pin, (1.9, 0.6))
    machine = mechanism(Revolute('O', GROUND, 'crank', pivot, O), crank_pin, rod_end, guide)
    ((links, found),) = slider_cranks(machine).items()
    assert links == ('crank', 'rod', 'slider')
    assert (found.crank, found.rod) == pytest.approx((0.4, np.hypot(1.9, 0.6)))
    along = axis if seed % 2 else axis - angle  # the guide in the world
    turned = angle if seed % 2 else -angle  # the slider in the world
    for th2 in np.linspace(0.0, 6.0, 7):
        a = 0.4 * np.exp(1j * (along + th2)) + complex(*pivot)
        x = slider_position(found, th2)
        b = (x + 1j * found.offset) * np.exp(1j * along) + complex(*pivot)
        poses = {
            'crank': (*pivot, along + th2 - np.pi / 2.0),
            'rod': (a.real, a.imag, np.angle(b - a) - np.arctan2(0.6, 1.9)),
            'slider': (*(np.array([b.real, b.imag]) - rotate(pin, turned)), turned),
        }
        constraints = Constraints.of(machine)
        residual = constraints.linearise(np.array([poses[x] for x in constraints.links]))[0]
        assert np.abs(residual).max() < 1e-14


def test_four_bars_of_a_six_bar_with_a_ternary_rocker():
    """The driven link counts as crank; a ternary link is as long as its two joints are apart."""
    machine = mechanism(
        Revolute('O2', GROUND, 'rocker', (4.0, 0.0), O),
        Revolute('B', 'rocker', 'coupler', (3.0, 4.0), (6.0, 0.0)),
        Revolute('A', 'coupler', 'crank', O, (1.0, 0.0)),
        Revolute('O4', 'crank', GROUND, O, O),
        Revolute('C', 'rocker', 'rod', (0.0, 2.0), O),
        Revolute('D', 'rod', 'slider', (7.0, 0.0), O),
        Prismatic('guide', GROUND, 'slider', (4.0, 1.0), O),
    )
    ((links, found),) = four_bars(machine, ['crank']).items()
    assert links == ('crank', 'coupler', 'rocker')
    assert found.lengths == (4.0, 1.0, 6.0, 5.0)
    ((links, found),) = four_bars(machine).items()
    assert links == ('rocker', 'coupler', 'crank')
    assert found.lengths == (4.0, 5.0, 6.0, 1.0)
    ((links, found),) = slider_cranks(machine, ['crank']).items()
    assert links == ('rocker', 'rod', 'slider')
    assert (found.crank, found.rod, found.offset) == (2.0, 7.0, 1.0)


def test_loops_with_slots_or_joints_in_one_point_are_neither():
    scotch = mechanism(
        Revolute('O', GROUND, 'crank', O, O),
        PinInSlot('pin', 'crank', 'yoke', (1.0, 0.0), O, np.pi / 2.0),
        Prismatic('guide', GROUND, 'yoke', O, O),
    )
    assert not four_bars(scotch)
    assert not slider_cranks(scotch)
    turning_block = mechanism(
        Revolute('O', GROUND, 'crank', O, O),
        Revolute('A', 'crank', 'block', (1.0, 0.0), O),
        Prismatic('guide', 'arm', 'block', O, O),
        Revolute('B', 'arm', GROUND, O, (3.0, 0.0)),
    )
    assert not four_bars(turning_block)
    assert not slider_cranks(turning_block)


SLIDER_CRANK = """
title: Offset slider-crank
mechanism: linkage
links:
  ground: {{points: {{pivot: [0 mm, 0 mm], guide: [0 mm, {offset} mm]}}}}
  crank: {{length: 50 mm}}
  rod: {{length: {rod} mm}}
  piston: {{}}
joints:
  ground_crank: {{revolute: [ground.pivot, crank.start]}}
  crank_rod: {{revolute: [crank.end, rod.start]}}
  rod_piston: {{revolute: [rod.end, piston]}}
  piston_ground: {{prismatic: [ground.guide, piston]}}
drive: {{coordinate: crank, speed: 1 rad/s, start_angle: 30 deg}}
guess: {{rod: -10 deg, piston: 240 mm}}
duration: 10 ms
"""


def test_check_says_how_a_slider_crank_moves(tmp_path):
    def notes(offset, rod):
        path = tmp_path / 'scene.yaml'
        path.write_text(SLIDER_CRANK.format(offset=offset, rod=rod), encoding='utf-8')
        return check(ms.load_scene(str(path))).notes

    assert notes(0, 200)[:3] == [
        'mobility: 1, as Kutzbach counts',
        'slider-crank: the crank can turn fully, stroke 0.1 m',
        'transmission angle: 75.52 to 104.5 deg',
    ]
    # sqrt(250^2 - 20^2) - sqrt(150^2 - 20^2) mm
    assert 'stroke 0.100538 m, time ratio 1.03475' in notes(20, 200)[1]
    assert 'crank and the rod can turn fully, through change points' in notes(0, 50)[1]
    held = notes(20, 60)
    assert 'crank cannot turn fully: the sine of its angle to the guide stays between' in held[1]
    assert '-53.1301 and 90 deg' in held[1]
    assert 'within 30 deg of 0 or 180 the driven end moves little: it is hard to move' in held[2]


def test_notes_of_several_linkages_say_whose_they_are():
    cranks = ('one', 'two', 'three')
    joints = [
        j
        for x, link in enumerate(cranks)
        for j in (
            Revolute(f'ground_{link}', GROUND, link, (x, 0.0), O),
            Revolute(f'{link}_bar', link, 'bar', (0.5, 0.0), (x, 0.0)),
        )
    ]
    machine = mechanism(*joints)
    cut = Mechanism(machine.bodies, machine.joints, ('two_bar', 'three_bar'))
    found = motion_notes(cut, dict.fromkeys(cranks, 0.9) | {'bar': 0.0}, ['two'])
    every = ', '.join(j.name for j in joints)
    assert found[0] == f'mobility: 1, where Kutzbach counts 0; 1 redundant among {every}'
    assert found[1].startswith(f'{joints[-1].name} is redundant beside the joints named before')
    assert {x.split(':')[0] for x in found[2:]} == {
        'two, bar, one', 'two, bar, three', 'one, bar, three',
    }  # fmt: skip


TOGGLES = {
    'toggle_press': ('upper, lower, ram', 'crank, rod, upper', '24.3071'),
    'double_toggle_punch': ('upper_toggle, lower_toggle, punch', 'crank, coupler, upper_toggle',
                            '18.8183'),
}  # fmt: skip


@pytest.mark.parametrize('scene', one_of(2, ['toggle_press', 'double_toggle_punch']))
def test_of_a_toggle_check_says_how_it_is_swung_not_what_it_could_do_as_a_crank(scene):
    """The angle by a second route: extremes of the swung link over a turn."""
    toggle, by, through = TOGGLES[scene]
    machine = ms.load_scene(scene)
    (note,) = (n for n in check(machine).notes if n.startswith(toggle))
    link = by.split(', ')[-1]
    assert note == (
        f'{toggle}: slider-crank; the {link} is moved by {by}, and swings through at most '
        f'{through} deg'
    )
    if scene == 'double_toggle_punch':  # whose crank is prescribed
        t = np.linspace(0.0, machine.drive.period, 20001)
        angle = ms.simulate(machine, revolutions=1).sample(t[:-1], f'position.{link}')[
            f'position.{link}'
        ]
        assert np.degrees(np.ptp(angle)) == pytest.approx(float(through), abs=1e-4)


@pytest.mark.parametrize(
    'scene', ['toggle_press', 'double_toggle_punch', 'locking_pliers', 'punch']
)
def test_no_link_that_swings_is_said_to_turn_and_no_toggle_is_warned_of(scene):
    notes = '\n'.join(check(ms.load_scene(scene)).notes)
    assert 'turns fully' not in notes
    assert 'hard to move' not in notes.replace('hard to move, or presses hard, as in a toggle', '')


@pytest.mark.sample(1)
@pytest.mark.parametrize('scene', ['four_bar_nominal', 'quick_return'])
def test_a_slow_turn_has_a_bounded_number_of_pieces(scene):
    """A piece was a tenth of a second at most: a turn a day did not end."""
    fast, slow = (
        ms.simulate(ms.load_scene(scene, {'drive.speed': speed}), revolutions=1)
        for speed in ('300 rpm', '1e-6 rpm')
    )
    assert slow.stats.steps < 800
    ends = (run.view(run.duration).observed.position[1:] for run in (fast, slow))
    assert np.abs(np.subtract(*ends)).max() < 1e-9
