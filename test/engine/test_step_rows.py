"""Rows of steps in machine code: the bits of steps one by one, and no event is passed over."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builders import made

import mechanism_sim as ms
from mechanism_sim.engine import event_stages, row_kernels, step_rows
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.row_kernels import end_of, stays

SLOW = pytest.mark.slow


def test_no_root_of_a_polynomial_is_passed_over():
    """By the roots that NumPy finds; most of those without any are known to have none."""
    rng = np.random.default_rng(3)
    kept = free = 0
    for _ in range(4000):
        p = rng.normal(size=rng.integers(3, 9)) * 0.7 ** np.arange(8)[: rng.integers(3, 9)].size
        p[0] = abs(p[0])
        h = rng.uniform(0.1, 1.5)
        roots = np.polynomial.polynomial.polyroots(p)
        real = roots[abs(roots.imag) < 1e-9].real
        some = ((real > 0.0) & (real <= h)).any()
        end = end_of(p, h, False, np.empty(len(p)))
        if end >= 0.0:
            assert not some
            assert end == pytest.approx(
                np.polynomial.polynomial.polyval(h, p), rel=1e-9, abs=1e-12
            )
        free += not some
        kept += end >= 0.0
    assert 0.9 * free < kept < 4000


def test_a_guard_that_begins_below_zero_may_only_rise_where_its_gap_is_open():
    rising, scaled = np.array([-1e-17, 2.0, 0.3, -0.1]), np.empty(4)
    assert end_of(rising, 0.5, True, scaled) == pytest.approx(1.0625)
    assert end_of(rising, 0.5, False, scaled) == -1.0
    assert end_of(np.array([-1e-9, 2.0, 0.3, -0.1]), 0.5, True, scaled) == -1.0
    assert end_of(np.array([-1e-17, -2.0, 9.0, 0.0]), 0.5, True, scaled) == -1.0
    assert end_of(np.array([1.0, math.nan, 0.0, 0.0]), 0.5, True, scaled) == -1.0


def test_what_begins_near_a_root_must_not_end_near_one():
    jets, shut, scaled = (
        np.array([[1e-15, 1.0, -1.0], [1.0, 0.0, 0.0]]),
        np.array([0, -1]),
        np.empty(3),
    )
    assert stays(jets, 0, shut, np.zeros(1), 0.5, scaled)
    assert not stays(jets, 0, shut, np.zeros(1), 1.0 - 1e-14, scaled)  # and falls just behind
    jets[0, 0] = 1e-3
    assert stays(jets, 0, shut, np.zeros(1), 1.0, scaled)


@pytest.mark.sample(1)
@pytest.mark.usefixtures('plain_kernels')
@pytest.mark.parametrize(
    'scene',
    [
        'four_bar_governed', 'gear_four_bar', 'gear_rattle', 'valve_train',
        pytest.param('watched_compressor', marks=SLOW),
    ],
)  # fmt: skip
def test_rows_have_the_bits_of_steps_one_by_one(scene, compiled_kernels, monkeypatch):
    """Loads in time, several gaps, friction; and where heyoka's code cannot be called."""
    machine = ms.load_scene(scene)
    long = {'duration': 0.1}
    one_by_one = ms.simulate(machine, **long)
    compiled_kernels()
    taken, take = [], step_rows.StepRows.take

    def noted(rows, tau, *others):
        end = take(rows, tau, *others)
        taken.append(end > tau)
        return end

    monkeypatch.setattr(step_rows.StepRows, 'take', noted)
    assert ms.simulate(machine, **long).digest() == one_by_one.digest()
    assert any(taken)
    for room in (step_rows.kernels, event_stages):
        monkeypatch.setattr(room, 'foreign_code', lambda *_: None)
    assert ms.simulate(machine, **long).digest() == one_by_one.digest()


@pytest.mark.usefixtures('plain_kernels')
def test_an_event_is_one_call(compiled_kernels, monkeypatch):
    """Once the functions of the state are known, Python evaluates none of them."""
    scene = ms.load_scene('four_bar_clearance', {'start': 'centred'})
    compiled_kernels()
    seen, see = [], event_stages.EventStages.see
    monkeypatch.setattr(event_stages.EventStages, 'see', lambda *x: seen.append(x[1]) or see(*x))
    found = ms.simulate(scene, revolutions=3.0)
    assert len(found.impacts) > 50
    assert len(seen) < 0.1 * len(found.impacts)
    assert row_kernels.run_row.codes


@pytest.mark.usefixtures('plain_kernels')
def test_events_and_changes_of_modes_do_not_end_a_row(compiled_kernels, monkeypatch):
    """Of what Python would do at an event, most is left; where a run is cut leaves it as it is."""
    machine = ms.load_scene('gear_rattle')
    plain = ms.simulate(machine, duration=0.5)
    assert len(plain.impacts) > 400
    assert len(plain.modes) > 20
    responses, respond_to = [], EventLoop._respond
    monkeypatch.setattr(EventLoop, '_respond', lambda *x: responses.append(x[1]) or respond_to(*x))
    compiled_kernels()
    found = ms.simulate(machine, duration=0.5)
    assert found.digest() == plain.digest()
    assert found.modes == plain.modes
    assert len(responses) < 0.1 * len(found.impacts)
    half = ms.simulate(machine, duration=0.2)
    both = MotionDigest()
    rest = ms.simulate(machine, duration=0.5, resume=half.snapshot)
    assert [i.t for i in rest.impacts] == [i.t for i in plain.impacts][-len(rest.impacts) :]
    both.add(rest.motion, rest.impacts)
    again = ms.simulate(machine, duration=0.5, resume=half.snapshot)
    other = MotionDigest()
    other.add(again.motion, again.impacts)
    assert both.hexdigest() == other.hexdigest()


@pytest.mark.usefixtures('plain_kernels')
def test_a_run_may_go_on_in_machine_code_anywhere(compiled_kernels):
    """Steps that Python took fill several blocks of memory before the first row."""
    machine = ms.load_scene('four_bar_clearance', {'start': 'centred'})
    digests = []
    for compiles in (False, True):
        engine, digest = machine.start(), MotionDigest()
        engine.advance(9.0, most=700)
        if compiles:
            compiled_kernels()
        engine.advance(0.5)
        motion, impacts, _ = engine.drain()
        assert len(motion) > 900
        digest.add(motion, impacts)
        digests.append(digest.hexdigest())
    assert digests[0] == digests[1]


REACHING = """
links:
  ground: {}
  arm: {length: 50 mm, mass: 1 kg, inertia: 0.001}
  block: {mass: 1 kg, inertia: 0.001}
  bob: {length: 0.1 m, mass: 0.5 kg, cog: 50 mm, inertia: 0.001}
joints:
  pivot: {revolute: [ground, arm]}
  guide: {prismatic: [arm, block]}
  pin: {revolute: [block, bob], clearance: {radial: 1 mm, restitution: 0.5}}
drives: {arm: {speed: 3 rad/s}, block: {speed: 0.5 m/s}}
gravity: [0, -9.81]
start: centred
"""


@pytest.mark.usefixtures('plain_kernels')
def test_rows_know_the_time_and_guards_that_are_of_no_gap(compiled_kernels):
    """A displacement in time beside an angle by its directions; a slot entered and left."""
    rack = ms.load_scene('linear_intermittent', {'drive': {'torque': '1 N m'}})
    runs = [(made(REACHING), 0.3), (rack, 0.1)]
    plain = [ms.simulate(machine, duration=t) for machine, t in runs]
    assert len(plain[0].impacts) > 10
    compiled_kernels()
    for (machine, t), run in zip(runs, plain, strict=True):
        assert ms.simulate(machine, duration=t).digest() == run.digest()
