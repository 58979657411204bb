"""One validation: what `check` refuses no command runs, what it accepts all run."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import yaml
from builders import LINKAGE, made

import mechanism_sim as ms
from mechanism_sim.catalogue import config_folder
from mechanism_sim.cli import main
from mechanism_sim.errors import InputError
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.scene import run_length
from mechanism_sim.scene.check import check, render
from mechanism_sim.scene.validation import way_of

COMMANDS = (
    ['check'], ['solve', '--duration', '0.001'], ['cycle', '--duration', '0.001'], ['draw'],
    ['run', '--duration', '0.001'],
)  # fmt: skip


@pytest.mark.sample(2)
@pytest.mark.parametrize('slots', [3, 5, 8, 11])
@pytest.mark.parametrize('guess', [0.0, 0.5, 1.0, 1.5])
def test_a_wheel_of_any_number_of_slots_starts_with_a_slot_where_it_belongs(
    slots: int, guess: float
) -> None:
    """[V] 2.6: locked in the middle between two slots, wherever the guess is."""
    data = yaml.safe_load((config_folder() / 'geneva.yaml').read_text(encoding='utf-8'))
    distance = 0.05 / math.sin(math.pi / slots)
    data['links']['ground']['points']['wheel_centre'] = [distance, 0.0]
    data['joints']['crank_wheel']['slots'] = slots
    data['guess']['wheel'] = math.pi + guess * 2.0 * math.pi / slots
    machine = made(yaml.safe_dump(data))
    assert 'mobility: 1' in check(machine).notes[0]
    wheel = machine.assembly.q[1]
    off = math.remainder(wheel - math.pi - math.pi / slots, 2.0 * math.pi / slots)
    assert abs(off) < 1e-12
    turned = np.ptp(
        ms.simulate(machine, revolutions=1).sample([0.0, 0.5], 'position.wheel')['position.wheel']
    )
    assert turned == pytest.approx(2.0 * math.pi / slots, rel=1e-9)


@pytest.mark.parametrize(
    ('key', 'value', 'words'),
    [
        ('links.crank.length', '400 mm', 'turn at constant speed (ground 0.387 m'),
        ('initial.position.coupler', '1.2 rad', 'initial.position puts the pin'),
    ],
)
def test_what_check_refuses_no_command_runs(
    key: str, value: str, words: str, capsys: pytest.CaptureFixture[str], tmp_path: object
) -> None:
    for command, *options in COMMANDS:
        more = ['-o', f'{tmp_path}/out.svg'] if command == 'draw' else options
        # of a scene with a duration: without one it is for all positions between limits, too
        changes = ['--set', f'{key}={value}', '--set', 'duration=1 s']
        with pytest.raises(SystemExit) as ended:
            main([command, 'four_bar_clearance', *changes, *more])
        assert ended.value.code == 2, command
        assert words in capsys.readouterr().err, command


@pytest.mark.parametrize('speed', ['1e24 rad/s', '-1e-25 rad/s'])
@pytest.mark.filterwarnings('error')
def test_a_speed_whose_powers_are_no_numbers_is_refused(speed: str) -> None:
    with pytest.raises(InputError, match=r'drive\.speed = .* rad/s is out of bounds'):
        ms.load_scene('slider_crank', {'drive.speed': speed})


STUCK = LINKAGE.replace(', clearance: {radial: 2 mm, restitution: 0.5}', '').replace(
    'crank: {length: 64 mm', 'crank: {length: 250 mm'
)
"""Its crank cannot turn fully: coupler and rocker reach 621 mm, crank and ground 637 mm."""


def test_a_crank_that_cannot_go_the_way_asked_for_is_an_error() -> None:
    whole = made(STUCK, **{'drive.start_angle': '60 deg'})
    with pytest.raises(InputError, match='the crank cannot make a full turn'):
        run_length(whole, None, None)
    with pytest.raises(InputError, match='the crank cannot make a full turn'):
        ms.simulate(whole)
    # within limits it may go; the limits come first in what `check` prints
    short = made(STUCK, duration='20 ms', **{'drive.start_angle': '60 deg'})
    report = check(short)
    assert 'the crank cannot turn fully' in report.limits[0]
    assert report.limits[0] in report.notes
    assert render(report).splitlines()[1:3] == ['what limits the motion', f'  {report.limits[0]}']
    assert ms.simulate(short).duration == 0.02
    with pytest.raises(InputError, match='the crank cannot make a full turn'):
        run_length(short, 1.0, None)


def test_the_template_may_swing_within_its_limits() -> None:
    lengths = {'ground': 0.4, 'crank': 0.1, 'coupler': 0.7, 'rocker': 0.3}  # [V] Figure 2.11
    scene = {f'links.{k}.length': x for k, x in lengths.items()}
    swing = {'points': [['0 s', 0], ['1 s', '1 rad/s'], ['2 s', 0]]}
    drive = {'drive': {'profile': swing, 'start_angle': '100 deg'}, 'duration': '2 s'}
    machine = ms.load_scene('four_bar_nominal', scene | drive)
    assert ms.simulate(machine).duration == 2.0
    drive['drive']['start_angle'] = '240 deg'  # the limit is at 277 deg, the way is 57 deg
    with pytest.raises(InputError, match=r'keep it between 82\.8192 and 277\.181 deg'):
        ms.load_scene('four_bar_nominal', scene | drive)


def test_limits_are_told_from_the_turn_that_they_forbid() -> None:
    lengths = {'ground': 0.3, 'crank': 0.1, 'coupler': 0.299999999999, 'rocker': 0.1}
    scene = {f'links.{k}.length': x for k, x in lengths.items()}
    with pytest.raises(InputError, match=r'keep it between -179\.9997 and 179\.9997 deg'):
        ms.load_scene('four_bar_nominal', scene)


@pytest.mark.slow
def test_a_crank_may_swing_for_as_long_as_one_likes() -> None:
    """More laws than are looked at beforehand: the last of them is not the motion after it."""
    lengths = {'ground': 0.4, 'crank': 0.1, 'coupler': 0.7, 'rocker': 0.3}
    scene = {f'links.{k}.length': x for k, x in lengths.items()}
    machine = ms.load_scene(
        'four_bar_nominal', scene | {'drive': {'position': '170 deg + 80 deg*sin(10*t)'}}
    )
    assert run_length(machine, None, 1e4) == 1e4
    laws, end = machine.plan.laws_until('crank', 20.0, most=30)
    assert 10.0 < end < 20.0
    assert np.rad2deg(way_of(laws, end)) == pytest.approx((90.0, 250.0), rel=1e-12)
    every, whole = machine.plan.laws_until('crank', 20.0, most=None)
    assert (every[: len(laws)], every[len(laws)].valid_from, whole) == (laws, end, 20.0)


def test_the_way_of_a_profile_is_that_of_its_integral() -> None:
    points = {'points': [['0 s', 2], ['1 s', -4], ['3 s', 1]], 'ramp': 'smooth'}
    laws = ms.load_scene(
        'four_bar_nominal', {'drive': {'profile': points, 'start_angle': 0.3}}
    ).drive.laws
    t = np.linspace(0.0, 4.0, 400_001)
    s = np.clip([t, (t - 1.0) / 2.0], 0.0, 1.0)
    ramp = 3.0 * s**2 - 2.0 * s**3
    angle = (
        0.3
        + np.concatenate([[0.0], np.cumsum((2.0 - 6.0 * ramp[0] + 5.0 * ramp[1])[1:])]) * (t[1])
    )
    assert way_of(laws, 4.0) == pytest.approx((angle.min(), angle.max()), abs=1e-4)


def test_the_cost_of_the_gate_does_not_grow_with_the_length_of_the_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    steps: list[int] = []
    advance = ms.scene.validation.NominalRun.advance
    monkeypatch.setattr(
        'mechanism_sim.scene.validation.NominalRun.advance',
        lambda run, *a, **k: (advance(run, *a, **k), steps.append(run.steps)),
    )
    for speed, duration in (('10 rad/s', '1 s'), ('10 rad/s', '1e6 s'), ('1e-6 rad/s', '1e8 s')):
        ms.load_scene('slider_crank', {'drive.speed': speed, 'duration': duration})
    assert len(steps) == 3
    assert max(steps) < 1.5 * min(steps)


@pytest.mark.parametrize(
    ('scene', 'change', 'said', 'most'),
    [
        ('slider_crank', {'links.crank.length': '5 m'}, 'it may be at a dead point', 30_000),
        # followed for half a turn, up to where yoke and crank are in line
        pytest.param(
            'scotch_yoke',
            {'joints.crank_yoke.axis': '9e-5 deg'},
            r't = 0\.499',
            150_000,
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_cannot_be_followed_is_given_up_soon(
    monkeypatch: pytest.MonkeyPatch, scene: str, change: dict[str, str], said: str, most: int
) -> None:
    tried = 0
    closure = Kinematics.closure

    def counted(*args: Any) -> Any:
        nonlocal tried
        tried += 1
        return closure(*args)

    monkeypatch.setattr(Kinematics, 'closure', counted)
    with pytest.raises(InputError, match=said):
        run_length(ms.load_scene(scene, change), None, None)
    assert 10 < tried < most


@pytest.mark.parametrize('mass', ['1e-20 kg', '0 kg'])
def test_a_mass_that_is_lost_in_rounding_is_named(mass, capsys):
    """Beside the mass of the supports it adds nothing, as no mass at all: no traceback."""
    with pytest.raises(SystemExit) as ended:
        main(['check', 'rotor_run_up', '--set', f'links.disk.mass={mass}'])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert 'links.disk.mass' in line
    assert 'without moving any mass' in line
