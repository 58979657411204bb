"""After how many turns of the drive all of a machine is as before, and what is computed then."""

from __future__ import annotations

import math
from itertools import count, islice
from typing import Any

import numpy as np
import pytest
import yaml
from builders import made
from running import run

import mechanism_sim as ms
from mechanism_sim.scene.load import span
from mechanism_sim.scene.remarks import plausibility_warnings

CAMSHAFT = """
mechanism: linkage
links:
  ground: {points: {c: [0 mm, 90 mm], g: [0 mm, 130 mm]}}
  crank: {mass: 1 kg, inertia: 100 kg mm^2}
  cam: {mass: 1 kg, inertia: 100 kg mm^2}
  follower: {mass: 0.2 kg}
gears:
  a: {at: crank, teeth: 20, module: 3 mm}
  b: {at: cam, teeth: 40, module: 3 mm}
joints:
  m: {revolute: [ground, crank]}
  c: {revolute: [ground.c, cam]}
  z: {mesh: [a, b]}
  g: {prismatic: [ground.g, follower], axis: 90 deg}
  k:
    cam: [cam, follower]
    follower: roller
    roller: 8 mm
    base_radius: 30 mm
    law:
      segments:
        - {from: 0 deg, to: 60 deg, rise: 8 mm, curve: cycloidal}
        - {from: 60 deg, to: 120 deg, rise: -8 mm, curve: cycloidal}
drive: {coordinate: crank, speed: 3000 rpm}
"""
CRANKS = """
mechanism: linkage
links:
  ground: {points: {b: [48 mm, 0 mm]}}
  crank: {length: 10 mm, mass: 1 kg, inertia: 500 kg mm^2}
  arm: {length: 10 mm, mass: 1 kg, inertia: 500 kg mm^2}
joints: {a: {revolute: [ground, crank]}, b: {revolute: [ground.b, arm]}}
drives: {crank: {speed: 60 rpm}, arm: {speed: 30 rpm}}
springs: {s: {between: [crank.end, arm.end], stiffness: 100 N/m, free_length: 30 mm}}
"""
#: of the law: 2 pi h (w/b)^2, w the speed of the cam and b the angle of a rise
RISE = 2.0 * np.pi * 8e-3 * (50.0 * np.pi / (np.pi / 3.0)) ** 2


RAMP = {'drive': {'coordinate': 'crank', 'speed': '600 rpm', 'acceleration': '1 rad/s^2'}}


def engine(span: str = '720 deg', force: str = 'gas(crank)', **more: Any) -> ms.Machine:
    """A slider-crank at 600 rpm with a load over an angle or the time."""
    middle = '50 ms' if span.endswith(' s') else '300 deg'
    points = [[f'0 {span.split()[1]}', '1 N'], [middle, '5 N'], [span, '1 N']]
    loads = {'gas': {'at': 'piston', 'force': [f'-{force}', 0]}}
    tables = {'tables.gas': {'points': points, 'periodic': True}}
    return ms.load_scene('slider_crank', tables | {'loads': loads} | more)


@pytest.mark.slow
def test_a_cam_at_half_speed_lifts_in_a_cycle_of_two_turns():
    machine = made(CAMSHAFT)
    assert machine.drive.repetition.turns == 2
    found = ms.cycle(machine)
    assert found.duration == pytest.approx(2.0 * machine.drive.period, rel=1e-12)
    assert found.extremes()['lift.k'].greatest.value == pytest.approx(8e-3, rel=1e-9)
    assert found.extremes()['acceleration.follower'].greatest.value == pytest.approx(RISE)
    assert len(found.t) == 721
    beside = ms.cycle(machine, start='400 deg')  # in the second turn
    assert beside['position.crank'][0] == pytest.approx(np.radians(400.0))
    found = ms.find(
        machine, 'drive.speed=500 rpm:3000 rpm', 'largest(acceleration.follower) = 500', samples=5
    )
    assert found.values['drive.speed'] == pytest.approx(100.0 * np.pi * np.sqrt(500.0 / RISE))


def test_a_table_of_two_turns_makes_runs_of_two():
    machine = engine()
    whole = ms.simulate(machine, revolutions=2.0)
    assert ms.simulate(machine).duration == whole.duration
    mean = ms.measure(machine, whole, 'mean(drive_torque)')[0].value
    assert ms.cycle(machine).mean('drive_torque') == pytest.approx(mean, rel=1e-9)


@pytest.mark.parametrize(
    ('machine', 'turns', 'last'),
    [
        (lambda: engine('360 deg'), 1, ''),
        (lambda: engine('1080 deg'), 3, 'gas(crank)'),
        (lambda: engine(force='gas(2*crank)'), 1, ''),
        (lambda: engine(force='gas(rod)'), 1, ''),  # a rod swings
        (lambda: engine('0.1 s', 'gas(t)'), 1, ''),
        (lambda: engine('0.2 s', 'gas(t)'), 2, 'gas(t)'),
        (lambda: engine('0.2 s', 'gas(0.5*t - 1)'), 4, 'gas(0.5*t - 1)'),
        (lambda: engine('360 deg', 'gas(crank + 62.83185307179586*t/3)'), 3,
         'gas(crank + 62.83185307179586*t/3)'),
        (lambda: engine('0.2 s', 'gas(t)', **RAMP), 1, ''),  # no turn lasts as long as the last
        (lambda: engine(force='3 N*sin(0.25*crank)'), 4, 'sin(0.25*crank)'),
        (lambda: engine(force='gas(crank/2)'), 4, 'gas(crank/2)'),
        (lambda: made(CAMSHAFT.replace('teeth: 40', 'teeth: 20'), **CLOSER), 1, ''),
        (lambda: ms.load_scene('gear_pair'), 1, ''),  # wheels are round
        (lambda: ms.load_scene('gear_pair', {'links.wheel.cog': '1 mm'}), 2, 'wheel'),
        (lambda: ms.load_scene('gear_pair', {'sensors': RIM}), 2, 'wheel'),
        (lambda: ms.load_scene('geneva'), 1, ''),  # the next slot is like the last
        (lambda: ms.load_scene('planetary'), 4, 'carrier'),
        (lambda: ms.load_scene('gear_four_bar'), 2, 'crank'),
        (lambda: ms.load_scene('pendulum'), 1, ''),
        (lambda: ms.load_scene('rack_and_pinion'), 1, ''),
        (lambda: made(CRANKS), 2, 'arm'),
        (lambda: made(CRANKS, **{'drives.arm.speed': '-60 rpm'}), 1, ''),
    ],
)  # fmt: skip
def test_turns_after_which_all_is_as_before(machine, turns, last):
    found = machine().drive.repetition
    assert (found.turns, found.last, found.found) == (turns, last, True)


CLOSER = {'links.ground.points.c': ['0 mm', '60 mm'], 'links.ground.points.g': ['0 mm', '100 mm']}
RIM = {'rim': {'kind': 'accelerometer', 'link': 'wheel', 'at': '20 mm', 'sample_rate': '1 kHz'}}


@pytest.mark.parametrize(
    ('span', 'table'), [('718 deg', 'gas(crank)'), ('720 deg', 'gas(t)'), ('0.19 s', 'gas(t)')]
)
def test_a_table_that_never_comes_again_leaves_one_turn_and_a_note(span, table):
    machine = engine(span, table)
    assert ms.cycle(machine).duration == pytest.approx(machine.drive.period, rel=1e-12)
    said = machine.drive.repetition.note('crank')
    assert f'{table} does not come again within 12 turns' in said


@pytest.mark.parametrize('factor', [1.0, 1.0 + 1e-6, 1.0 - 1e-6, 1.0 + 1e-5])
def test_what_comes_again_after_turns_is_not_asked_about(factor):
    """One tolerance for both: a table is another in every turn, or comes again after two."""
    machine = engine(force=f'gas({factor!r}*crank)')
    asked = any('another in every turn' in x for x in plausibility_warnings(machine))
    assert asked != machine.drive.repetition.found


@pytest.mark.slow
def test_commands_say_how_many_turns_they_take(tmp_path):
    scene = tmp_path / 'camshaft.yaml'
    scene.write_text(CAMSHAFT, encoding='utf-8')
    said = 'cam comes again after 2 turns of crank: 2 turns are computed'
    for command in ('cycle', 'solve'):
        done = run(command, str(scene))
        assert said in done.stderr, command
        assert done.stderr.count('turns') == 2
    assert said not in run('cycle', str(scene), '--revolutions', '1').stderr


@pytest.mark.slow
def test_a_crank_that_swings_asks_each_of_its_laws_once_for_all_its_turns(monkeypatch):
    """It turns by ``|2 sin(7 t)|``: 4/7 rad in each of its half periods."""
    drive = made({'links': {'crank': {}}, 'joints': {'shaft': {'revolute': ['ground', 'crank']}},
                  'drive': {'coordinate': 'crank', 'speed': '2*sin(7*t)'}}).drive  # fmt: skip
    one_by_one = [drive.time_of(k) for k in range(1, 6)]
    after, asked = type(drive.source).after, []
    monkeypatch.setattr(
        type(drive.source),
        'after',
        lambda own, law: asked.append(law.valid_from) or after(own, law),
    )
    found = [*islice(drive.times_of(count(1)), 5)]
    assert found == one_by_one
    assert len(asked) == len({*asked}) > 10
    halves, rest = divmod(2.0 * math.pi * np.arange(1, 6), 4.0 / 7.0)
    assert found == pytest.approx((math.pi * halves + np.arccos(1.0 - 3.5 * rest)) / 7.0, rel=1e-9)


POINTS = {'points': [['0 s', '0 deg'], ['0.3 s', '200 deg'], ['0.8 s', '0 deg']]}


@pytest.mark.parametrize(
    ('course', 'again', 'said'),
    [
        ({'position': '0.5 + 0.4*sin(3*t) + 0.1*cos(4.5*t)'}, 4.0 * math.pi / 3.0, True),
        ({'position': '3*pi*t + 0.3*sin(2*pi*t)'}, 2.0, True),
        ({'position': '2*pi*t + 0.3*sin(2*pi*t)'}, 1.0, False),
        ({'speed': '3*cos(2*t) + 2*sin(3*t)'}, 2.0 * math.pi, True),
        ({'position': {**POINTS, 'periodic': True}}, 0.8, True),
        ({'moves': {'speed': '4 rad/s', 'acceleration': '20 rad/s^2', 'repeat': True,
                    'steps': [{'by': '2 turn'}, {'dwell': '0.1 s'}]}}, None, True),
        ({'position': '0.3*t + 0.4*sin(3*t)'}, None, False),
        ({'position': '0.5 + 0.4*sin(3*t) + 0.1*cos(3.1415*t)'}, None, False),
        ({'position': '0.5 + 0.4*sin(3*t)*exp(-t/100)'}, None, False),
    ],
    ids=range(9),
)  # fmt: skip
def test_a_drive_that_repeats_itself_over_time_is_computed_so_long(course, again, said):
    arm = {'links': {'ground': {}, 'arm': {'length': '1 m'}},
           'joints': {'pivot': {'revolute': ['ground', 'arm']}}}  # fmt: skip
    machine = made({**arm, 'drive': {'coordinate': 'arm', **course}})
    if again is None and said:
        again = machine.drive.source.period
    note = machine.drive.repetition.note('arm')
    assert note == (f'arm comes again after {again:.9g} s: so long is computed' if said else '')
    if again:
        assert span(machine, None, None) == pytest.approx(again, rel=1e-12)
        ends = ms.simulate(machine, duration=again).sample([0.0, again])['position.arm']
        assert math.remainder(np.ptp(ends), 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_a_displacement_that_repeats_itself_needs_no_duration():
    block = {'links': {'ground': {}, 'block': {'mass': '1 kg'}},
             'joints': {'guide': {'prismatic': ['ground', 'block']}}}  # fmt: skip
    course = {'coordinate': 'block', 'position': '20 mm + 5 mm*sin(4 rad/s*t)'}
    assert span(made({**block, 'drive': course}), None, None) == pytest.approx(0.5 * math.pi)


@pytest.mark.parametrize(
    ('crank', 'arm', 'said', 'again'),
    [
        ({'speed': '60 rpm'}, {'position': {**POINTS, 'periodic': True}}, 'crank and arm', 4.0),
        ({'position': 'sin(2*pi*t)'}, {'position': 'cos(3*pi*t)'}, 'crank and arm', 2.0),
        ({'position': 'sin(2*pi*t)'}, {'speed': '90 rpm'}, 'crank and arm', 2.0),
        ({'position': 'sin(2*pi*t)'}, {'speed': '0 rpm'}, 'crank and arm', 1.0),
        ({'position': 'sin(2*pi*t)'}, {'position': 'cos(3*t)'}, '', None),
        ({'speed': '60 rpm'}, {'speed': {'points': [['0 s', '1 rad/s'], ['1 s', '0 rad/s']]}}, '',
         None),
    ],
    ids=range(6),
)  # fmt: skip
def test_drives_are_computed_until_all_come_again(crank, arm, said, again):
    scene = yaml.safe_load(CRANKS) | {'drives': {'crank': crank, 'arm': arm}}
    found = made(scene).drive.repetition
    assert found.duration == (pytest.approx(again) if again else None)
    assert found.note('crank').startswith(f'{said} come again' if said else '')
