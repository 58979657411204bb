"""Four-bars for positions of a body, transmission angles, timing and dwell, by second routes."""

import math
from pathlib import Path

import numpy as np
import pytest
from builders import made
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.grashof import time_ratio, transmission_range

LENGTHS = 0.2, 0.06, 0.22, 0.16
POINT, TURNED, PLACE = 0.1 + 0.08j, 0.4, 1.0 + 0.5j


def circles(angles, lengths=LENGTHS, side=1.0):
    """Crank pin and rocker pin, complex, by intersection of circles; ground along x."""
    ground, crank, coupler, rocker = lengths
    pin = crank * np.exp(1j * np.asarray(angles))
    way = ground - pin
    d = np.abs(way)
    along = (d**2 + coupler**2 - rocker**2) / (2.0 * d)
    with np.errstate(invalid='ignore'):
        across = side * np.sqrt(coupler**2 - along**2)
    return pin, pin + (along + 1j * across) * way / d


def poses(angles, side=1.0, lengths=LENGTHS):
    """Positions of a body on the coupler, turned and moved: x, y and orientation."""
    pin, end = circles(angles, lengths, side)
    unit = (end - pin) / lengths[2]
    z = (pin + POINT * unit) * np.exp(1j * TURNED) + PLACE
    return np.column_stack([z.real, z.imag, np.angle(unit) + TURNED + 0.7])


def missed(one, body):
    """By how much a solution misses positions, from its own lengths, at its best crank angles."""
    turned = body[:, 2] - one.orientation
    pin = body[:, 0] + 1j * body[:, 1] - complex(*one.point) * np.exp(1j * turned)
    angles = np.angle(pin - complex(*one.pivot)) - one.angle
    pin, end = circles(angles, one.lengths, 1.0 if one.branch == 'open' else -1.0)
    unit = (end - pin) / one.lengths[2] * np.exp(1j * one.angle)
    at = complex(*one.pivot) + pin * np.exp(1j * one.angle) + complex(*one.point) * unit
    way = np.abs(at - (body[:, 0] + 1j * body[:, 1])).max()
    return way, np.abs(np.angle(unit * np.exp(-1j * turned))).max(), angles


EVENLY = np.linspace(0.3, 5.3, 5)


def test_five_positions_are_taken_exactly_by_the_linkage_they_are_of_and_by_others():
    body = poses(EVENLY)
    found = ms.find_four_bars(body)
    assert any(one.lengths == pytest.approx(LENGTHS, rel=1e-9) for one in found)
    for one in found:
        way, turn, angles = missed(one, body)
        assert way < 1e-12
        assert turn < 1e-12
        steps = np.mod(np.diff(angles) * (1.0 if one.forward else -1.0), 2.0 * math.pi)
        assert steps.sum() < 2.0 * math.pi  # in their order, within one turn
        assert min(one.transmission[0], math.pi - one.transmission[1]) >= math.radians(20.0)


@pytest.mark.slow
@pytest.mark.parametrize('count', [3, pytest.param(4, marks=pytest.mark.slow)])
def test_fewer_positions_have_many_linkages(count):
    body = poses(EVENLY[:count])
    found = ms.find_four_bars(body)
    assert len(found) == 5
    assert max(max(missed(one, body)[:2]) for one in found) < 1e-9


@pytest.mark.slow
def test_many_positions_with_errors_are_fitted():
    rng = np.random.default_rng(1)
    body = poses(np.linspace(0.3, 5.3, 9)) + rng.normal(size=(9, 3)) * [1e-4, 1e-4, 1e-3]
    best = ms.find_four_bars(body)[0]
    assert best.lengths == pytest.approx(LENGTHS, rel=0.02)
    assert best.rms < 1.5e-4
    assert best.turned < 3e-3


@pytest.mark.parametrize(
    ('body', 'said'),
    [
        (np.vstack([poses(EVENLY)[:3], poses(EVENLY, -1.0)[3:]]), 'no four-bar with a turning'),
        (poses(EVENLY)[[0, 3, 1, 4, 2]], 'in another order'),
        (poses(np.linspace(-0.8, 0.8, 5), lengths=(0.2, 0.15, 0.17, 0.16)), 'no turning crank'),
        (poses(EVENLY)[:2], 'at least 3'),
        (np.array([[0.0, 0.0, x] for x in range(5)]), 'turn about one point'),
        (np.zeros((5, 4)), 'give points (n, 2)'),
    ],
)
def test_defects_are_told(body, said):
    with pytest.raises(InputError) as refused:
        ms.find_four_bars(body)
    assert said in str(refused.value)
    assert '\n' not in str(refused.value)


def test_the_command_writes_a_machine_that_takes_the_positions(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    body = poses(EVENLY)
    rows = [f'{1e3 * x!r},{1e3 * y!r},{math.degrees(a)!r}' for x, y, a in body.tolist()]
    text = '\n'.join(['x [mm],y [mm],orientation [deg]', *rows])
    (tmp_path / 'body.csv').write_text(text + '\n')
    found = run_json('find', '--path', 'body.csv', '-o', 'four.yaml')['four_bars'][0]
    assert Path('four.yaml').read_text().startswith('# masses, and forces by them, are assumed')
    cycle = ms.cycle('four.yaml')
    (told,) = ms.measure(cycle.machine, cycle.solution)
    assert told.value < 1e-9
    first = cycle.solution.sample(0.0, 'position.coupler')['position.coupler'][0]
    assert math.remainder(first + found['orientation'] - body[0, 2], 2.0 * math.pi) < 1e-9
    assert cycle.machine.scene.links['coupler'].mass == pytest.approx(found['lengths'][2])
    assert 'missed by' not in run('find', '--path', 'body.csv').stderr
    again = run('find', '--path', 'body.csv', '-o', 'again.yaml')
    assert again.stderr.count('bars of 1 kg per metre') == 1


def four_bar(**lengths):
    ground, crank, coupler, rocker = LENGTHS
    scene = {
        'title': 'four-bar',
        'links': {
            'ground': {'points': {'O': [0.0, 0.0], 'B': [ground, 0.0]}},
            'crank': {'length': crank}, 'coupler': {'length': coupler},
            'rocker': {'length': rocker},
        },
        'joints': {
            'A0': {'revolute': ['ground.O', 'crank']},
            'A': {'revolute': ['crank.end', 'coupler']},
            'B': {'revolute': ['coupler.end', 'rocker.end']},
            'B0': {'revolute': ['rocker', 'ground.B']},
        },
        'drive': {'coordinate': 'crank', 'speed': '60 rpm'},
        'guess': {'coupler': '40 deg', 'rocker': '100 deg'},
    }  # fmt: skip
    return made(scene | lengths, 'four_bar')


def measured(scene, *texts):
    one = ms.cycle(scene)
    return [x.value for x in ms.measure(one.machine, one.solution, *texts)]


def test_transmission_angles_are_those_of_the_extreme_triangles():
    low, high = transmission_range(FourBar(*LENGTHS))
    least = min(low, math.pi - high)
    assert measured(four_bar(), 'lowest(transmission_angle.B)') == pytest.approx([least])
    (slider,) = measured('slider_crank', 'lowest(transmission_angle.rod_piston)')
    assert slider == pytest.approx(math.acos(0.05 / 0.2), rel=1e-9)  # crank across the guide


def test_time_ratio_is_a_share_of_a_turn():
    share, swing = measured(four_bar(), 'share(velocity.rocker > 0)', 'range(position.rocker)')
    assert max(share, 1.0 - share) / min(share, 1.0 - share) == pytest.approx(
        time_ratio(FourBar(*LENGTHS)), rel=1e-8
    )
    angles = np.linspace(0.0, 2.0 * math.pi, 20001)
    pin = circles(angles)[1] - LENGTHS[0]
    assert swing == pytest.approx(np.ptp(np.unwrap(np.angle(pin))), rel=1e-6)


def test_a_dwell_is_a_range_in_a_part_of_a_turn():
    """Least travel of the rocker in a sixth of a turn, over where its pivot is."""
    dwell = 'range(position.rocker, from 0.2 revolutions to 0.3666 revolutions)'
    scene = four_bar(drive={'coordinate': 'crank', 'speed': '60 rpm', 'start_angle': '20 deg'})
    found = ms.find(scene, 'links.ground.points.B.x=150 mm:280 mm', minimise=dwell)
    turned = math.radians(20.0) + 2.0 * math.pi * np.linspace(0.2, 0.3666, 401)
    travel = {
        ground: np.ptp(np.unwrap(np.angle(circles(turned, (ground, *LENGTHS[1:]))[1] - ground)))
        for ground in np.linspace(0.15, 0.28, 1301)
    }
    best = min(travel, key=lambda ground: travel[ground])
    assert found.measures[dwell] == pytest.approx(travel[best], rel=1e-3)
    assert found.values['links.ground.points.B.x'] == pytest.approx(best, abs=2e-4)


def test_a_path_that_somebody_names_may_lie_anywhere(tmp_path, monkeypatch):
    """Only a scene, which may be another's, is kept to its folder."""
    (tmp_path / 'oval.csv').write_text('x [mm],y [mm]\n0,0\n10,5\n20,0\n10,-5\n5,-4\n')
    (tmp_path / 'else').mkdir()
    monkeypatch.chdir(tmp_path / 'else')
    monkeypatch.setenv('HOME', str(tmp_path))
    monkeypatch.setattr('mechanism_sim.studies.four_bars.path_four_bars', lambda path, _: [path])
    for file in (tmp_path / 'oval.csv', str(tmp_path / 'oval.csv'), '../oval.csv', '~/oval.csv'):
        (found,) = ms.find_four_bars(file)
        assert found.points[1] == pytest.approx((0.01, 0.005))
    with pytest.raises(InputError, match=r"'none.csv' cannot be read: No such file"):
        ms.find_four_bars('none.csv')
    done = run('find', '--path', str(tmp_path / 'oval.csv'), '-o', 'a.yaml')
    assert done.returncode == 2
    assert f"allow its folder by --tables-from '{tmp_path}'" in done.stderr
