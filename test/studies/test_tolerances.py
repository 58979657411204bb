"""Tolerances to first order, on machines whose measures have closed forms."""

from __future__ import annotations

import json

import numpy as np
import pytest
from running import run, run_json

from mechanism_sim.errors import InputError
from mechanism_sim.studies.plan import read_plan
from mechanism_sim.studies.tolerances import first_order

pytestmark = pytest.mark.usefixtures('in_this_process')

CRANK = {
    'scene': 'slider_crank',
    'vary': {
        'links.crank.length': '50 mm +- 0.3 mm',
        'links.rod.length': {'normal': ['200 mm', '0.4 mm']},
    },
    'measures': {'far': 'highest(position.piston)', 'stroke': 'range(position.piston)'},
    'revolutions': 1,
    'design': {'samples': 2},
}


def test_dead_centres_of_a_slider_crank():
    """Crank plus rod, and twice the crank: linear, with known shares."""
    found = first_order(read_plan(CRANK))
    far, stroke = found.stacks
    truncated = 0.9866 * 0.1e-3  # deviation of a normal distribution cut at three of its own
    assert far.nominal == pytest.approx(0.25)
    assert far.deviation == pytest.approx(np.hypot(truncated, 0.4e-3), rel=1e-4)
    assert [c.slope for c in far.contributions] == pytest.approx([1.0, 1.0])
    assert sum(c.share for c in far.contributions) == pytest.approx(1.0)
    assert far.contributions[1].share == pytest.approx(0.4e-3**2 / far.deviation**2, rel=1e-3)
    assert far.worst == pytest.approx((0.25 - 1.5e-3, 0.25 + 1.5e-3), rel=1e-5)
    assert far.corners == pytest.approx(far.worst)
    assert far.enough
    assert [c.share for c in stroke.contributions] == pytest.approx([1.0, 0.0], abs=1e-9)


@pytest.mark.slow
def test_monte_carlo_has_the_same_deviation():
    """A second route: draws of the closed form of the least transmission of forces."""
    given = CRANK | {'measures': {'swing': 'highest(position.rod)'}}
    (stack,) = first_order(read_plan(given)).stacks
    random = np.random.default_rng(1)
    crank = 0.05 + 1e-4 * np.clip(random.standard_normal(200_000), -3.0, 3.0)
    rod = 0.2 + 4e-4 * random.standard_normal(200_000)
    swing = np.arcsin(crank / rod)
    assert stack.nominal == pytest.approx(swing.mean(), rel=1e-4)
    assert stack.deviation == pytest.approx(swing.std(), rel=0.02)
    assert stack.enough


def test_a_bent_measure_is_not_left_to_first_order():
    """The square of a length about its zero has no slope there, and still varies."""
    given = {
        'scene': 'slider_crank',
        'vary': {'drive.start_angle': {'normal': ['0 deg', '20 deg']}},
        'design': {'samples': 2},
        'measures': {'start': 'initial(position.piston)'},
        'duration': '10 ms',
    }
    (stack,) = first_order(read_plan(given)).stacks
    assert not stack.enough
    (one,) = stack.contributions
    assert one.slope == pytest.approx(0.0, abs=1e-9)
    phi = np.radians(60.0)
    fall = 0.05 * np.cos(phi) + np.sqrt(0.2**2 - (0.05 * np.sin(phi)) ** 2) - 0.25
    assert (one.low, one.high) == pytest.approx((fall, fall), rel=1e-3)


def test_turns_of_another_speed_end_at_other_instants():
    """Torque at a constant speed grows by the square of the speed, however long a turn is."""
    given = CRANK | {
        'vary': {'drive.speed': ['590 rpm', '610 rpm']},
        'measures': {'torque': 'rms(drive_torque)'},
        'set': {'gravity': [0, 0]},
    }
    (stack,) = first_order(read_plan(given)).stacks
    (one,) = stack.contributions
    omega = 600.0 * np.pi / 30.0
    assert one.slope == pytest.approx(2.0 * stack.nominal / omega, rel=1e-3)
    assert stack.enough


@pytest.mark.slow
def test_the_worst_ends_of_a_speed_are_those_of_whole_turns():
    """At a fixed end of time this mean falls with the speed; over whole turns it grows."""
    given = CRANK | {
        'vary': {'drive.speed': ['590 rpm', '610 rpm'], 'links.crank.length': '50 mm +- 0.1 mm'},
        'measures': {'m': 'mean(acceleration.piston + 0.3*abs(acceleration.piston))'},
    }
    (stack,) = first_order(read_plan(given)).stacks
    speed = stack.contributions[0]
    assert speed.slope == pytest.approx(2.0 * stack.nominal / (600.0 * np.pi / 30.0), rel=1e-3)
    assert stack.worst[0] < stack.nominal < stack.worst[1]
    assert stack.corners == pytest.approx(stack.worst, rel=1e-3)
    assert stack.enough


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (
            {'grid': {'links.piston.mass': ['1 kg', '2 kg']}, 'design': {'samples': 2}},
            "without 'grid'",
        ),
        ({'vary': {}, 'runs': [{'links.piston.mass': '1 kg'}]}, "tolerances in 'vary'"),
        ({'measures': {}, 'design': {'samples': 2}}, "needs 'measures'"),
    ],
)
def test_other_sweeps_are_refused(change, words):
    with pytest.raises(InputError, match=words):
        first_order(read_plan({k: v for k, v in ({**CRANK, 'design': {}} | change).items() if v}))


@pytest.mark.slow
def test_the_command_writes_a_table_and_tornados(tmp_path):
    file = tmp_path / 'stack.yaml'
    file.write_text(json.dumps(CRANK), encoding='utf-8')
    table, plots = tmp_path / 'stack.csv', tmp_path / 'plots'
    options = ['--first-order', '--workers', '1', '-o', str(table), '--plots', str(plots)]
    shown = run('sweep', str(file), *options).stdout
    assert 'measures to first order' in shown
    assert 'not enough' not in shown
    assert len(table.read_text(encoding='utf-8').splitlines()) == 5
    assert {p.stem for p in plots.iterdir()} == {'tornado-far', 'tornado-stroke'}
    found = run_json('sweep', str(file), '--first-order', '--workers', '1')
    assert found['measures']['far']['enough']
    assert found['measures']['far']['contributions']['links.rod.length']['share'] > 0.9
    refused = run('sweep', str(file), '--first-order', '--effects', 'a.svg')
    assert refused.returncode == 2
    assert '--effects does not apply to --first-order' in refused.stderr
