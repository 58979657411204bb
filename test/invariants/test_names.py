"""Names are for people: what is called what makes no difference to any number.

A scene is run once with plain names and again with every symbol and key of the engine's own as
the name of a link or a joint; the digests of the motions are equal, bit by bit.
"""

from __future__ import annotations

import re
from dataclasses import replace
from string import Template

import pytest
import yaml
from builders import made

import mechanism_sim as ms
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.errors import InputError
from mechanism_sim.planar.gaps import is_stop, joint_of_gap
from mechanism_sim.results.catalogue import catalogue

LINKS = ('one', 'two', 'three', 'block', 'swing')
JOINTS = ('base', 'knee', 'ankle', 'hip', 'rail', 'slit', 'hook')
TEXT = Template("""
title: Two loose joints and all kinds of forces
mechanism: linkage
links:
  ground: {points: {pivot: [0.4 m, 0.1 m]}}
  $one: {length: 0.1 m, mass: 0.5 kg, inertia: 0.001 kg m^2, cog: 0.05 m}
  $two: {length: 0.4 m, mass: 0.6 kg, inertia: 0.01 kg m^2, cog: 0.2 m}
  $three: {length: 0.25 m, mass: 0.4 kg, inertia: 0.004 kg m^2, cog: 0.1 m}
  $block: {points: {top: [0 m, 0 m]}, mass: 0.3 kg}
  $swing: {length: 0.2 m, mass: 0.2 kg, inertia: 0.001 kg m^2, cog: 0.1 m}
joints:
  $base: {revolute: [ground, $one]}
  $knee: {revolute: [$one.end, $two], clearance: {radial: 0.4 mm, restitution: 0.6, friction: 0.1}}
  $ankle: {revolute: [$two.end, $three.end]}
  $hip: {revolute: [ground.pivot, $three]}
  $rail: {prismatic: [ground, $block]}
  $slit: {slot: [$one.end, $block.top], axis: 90 deg, clearance: {radial: 1 mm, restitution: 0.5}}
  $hook: {revolute: [$one.end, $swing]}
gravity: [0, -9.81 m/s^2]
start: centred
drive: {coordinate: $one, speed: 20 rad/s, start_angle: 1 rad}
drives: {$swing: {torque: {per_speed: -0.01 N m s/rad}}}
guess: {$two: 0.3 rad, $three: 1.6 rad}
springs: {$slit: {between: [$two.end, ground.pivot], stiffness: 200 N/m, damping: 1 N s/m}}
loads:
  $knee: {at: $three.end, force: [3, "0.2*vx"], torque: "0.1*${three}_rate + 0.01*$three*sin(t)",
          during: {coordinate: $one, from: 30 deg, to: 200 deg}}
""")
PLAIN = {name: name for name in (*LINKS, *JOINTS)}

ENGINES = """
watch now step_constant time run_time fired stabilisation gravity parameter_3 parameter3
flag0 q0 v1 a0 cos0 sin0 one_cos one_rate two_acceleration turns0 on0 row0_1 torque0
force0_1 impulse0 u_0 par loads springs links drives sin middle offset axis towards pin
centre law torque inertia coriolis weight centripetal cross energy position moment direction
ground_crank drive_torque closed slip slit_left
"""
"""What the engine calls, or has called, symbols, keys, columns and parts of them."""


def scene_of(names: dict[str, str]) -> ms.Machine:
    data = yaml.safe_load(TEXT.substitute(PLAIN | names))
    return made(data, 'named')


def digest_of(machine: ms.Machine) -> str:
    """Of a run, with its impacts under the numbers of the gaps."""
    solution = ms.simulate(machine, duration=0.1)
    gaps = [gap.name for gap in machine.equations.system.gaps]
    assert len({i.joint for i in solution.impacts}) == 3
    digest = MotionDigest()
    digest.add(
        solution.motion, [i._replace(joint=str(gaps.index(i.joint))) for i in solution.impacts]
    )
    return digest.hexdigest()


@pytest.fixture(scope='module')
def plain() -> ms.Machine:
    return scene_of({})


@pytest.mark.parametrize('all_of_them', [False, pytest.param(True, marks=pytest.mark.slow)])
def test_no_name_of_the_engine_means_anything_in_a_scene(
    plain: ms.Machine, all_of_them: bool
) -> None:
    """Its keys are read off the compiled scene, so that later ones are tried too."""
    expected = digest_of(plain)
    words = {
        *ENGINES.split(),
        *re.findall(r'[a-z]\w*', ' '.join(plain.equations.system.equations.parameters.names)),
    }
    words = sorted(words - {'ground', 'x', 'y', *PLAIN})
    if not all_of_them:  # as many as a scene takes
        words = words[:: len(words) // len(LINKS)][: len(LINKS)]
    used: set[str] = set()
    for first in range(0, len(words), len(LINKS)):
        some = (words + words)[first : first + len(LINKS)]
        # a joint may be called as a link is: they are told apart by where they stand
        names = dict(zip(LINKS, some, strict=True)) | dict(zip(JOINTS, some[::-1], strict=False))
        assert digest_of(scene_of(names)) == expected, names
        used |= {*some}
    assert used == {*words}


def test_joints_called_as_walls_are_kept_apart(plain: ms.Machine) -> None:
    machine = scene_of({'slit': 'pin', 'knee': 'pin_left', 'hook': 'pin_rod', 'base': 'pin_right'})
    assert digest_of(machine) == digest_of(plain)
    gaps = machine.equations.system.gaps
    assert len({gap.name for gap in gaps}) == len(gaps) == 3
    for gap in gaps:
        assert joint_of_gap(machine.mechanism, gap.name).name == gap.joint


def test_gaps_of_joints_called_as_each_others_gaps_are_kept_apart() -> None:
    """A guide's corners against the walls of a slot, and a bearing's end against a stop."""
    play = {'radial': 1e-3, 'restitution': 0.3}
    block = {'mass': 1.0, 'inertia': 0.01}
    machine = made({
        'links': {
            'ground': {'points': {'pin': [0.0, 1.0]}}, 'block': block,
            'rod': {'length': 0.5, **block},
        },
        'joints': {
            'guide': {'prismatic': ['ground', 'block'],
                      'clearance': {**play, 'length': 0.1, 'height': 0.05}},
            'guide_front': {'slot': ['rod', 'ground.pin'], 'clearance': play},
        },
        'gravity': [0.0, -9.81], 'duration': 0.1,
    })  # fmt: skip
    gaps = machine.equations.system.gaps
    assert len({gap.name for gap in gaps}) == len(gaps) == 6
    for gap in gaps:
        assert joint_of_gap(machine.mechanism, gap.name).name == gap.joint
    struck = {i.joint for i in ms.simulate(machine).impacts}
    assert {joint_of_gap(machine.mechanism, gap).name for gap in struck} >= {'guide'}
    corner, stop = (replace(machine.mechanism.joint('guide'), name=n) for n in ('x', 'x_stop'))
    assert is_stop(corner, 'x_stop_front')
    assert not is_stop(stop, 'x_stop_front')


@pytest.mark.parametrize(('slit', 'knee'), [('pin', 'pin_rod'), ('pin', 'pin_left'), ('a', 'a_a')])
def test_a_restitution_is_changed_in_the_joint_that_is_named(slit: str, knee: str) -> None:
    """Seen in the impacts themselves: only those of that joint rebound with the new one."""
    machine = scene_of({'slit': slit, 'knee': knee})
    run = machine.start()
    run.change_restitution(slit, 0.1)
    run.advance(0.1)
    _, impacts, _ = run.drain()
    own = {g.name for g in machine.equations.system.gaps if g.joint == slit}
    assert len(own) == 2
    for i in impacts:
        if not i.ends_chatter and i.approach_speed > 1e-6:
            e = 0.1 if i.joint in own else 0.6
            assert i.rebound_speed == pytest.approx(e * i.approach_speed, rel=1e-6, abs=1e-9)
    assert any(i.joint in own for i in impacts)
    assert not all(i.joint in own for i in impacts)
    with pytest.raises(KeyError):
        run.change_restitution('rail', 0.3)


def test_units_of_columns_do_not_depend_on_names() -> None:
    machine = scene_of({'one': 'moment', 'two': 'direction', 'three': 'torque'})
    known = catalogue(machine)
    assert known['position.moment'].unit == 'rad'
    assert known['velocity.direction'].unit == 'rad/s'
    assert known['position.direction'].part == known['velocity.moment'].part == ''
    assert known['reaction.base.y'].part == known['shaking_force.y'].part == 'y'


def test_a_name_that_a_formula_cannot_tell_apart_is_refused() -> None:
    with pytest.raises(InputError, match=r"'three_rate' in the formula .* may be the link"):
        scene_of({'two': 'three_rate'})
    with pytest.raises(InputError, match="the name 'vx' cannot be used"):
        scene_of({'two': 'vx'})
