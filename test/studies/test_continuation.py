"""Branches of periodic responses: of the impact oscillator, all of whose places are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy
from bouncing_ball import E, ball, speed
from impact_oscillator import (
    DAMPING,
    MASS,
    OSCILLATOR,
    STIFFNESS,
    WALL,
    discriminant,
    forced,
    strikes,
)
from running import run_json

import mechanism_sim as ms
from mechanism_sim.studies.periodic import PoincareMap


def found_between(low, high):
    found = ms.bifurcation(
        OSCILLATOR, {'drive.speed': (low, high, 2)}, of=['velocity.block'], transient=300, keep=20
    )
    return [branch for branch in ms.branches(found) if branch.period == 1]


def zero(f, low, high):
    return pytest.approx(scipy.optimize.brentq(f, low, high, xtol=1e-14), rel=1e-8)


@pytest.mark.slow
def test_a_flip_is_where_its_closed_form_has_it():
    (branch,) = found_between(9.58, 9.9)
    (event,) = branch.events
    flip = zero(lambda w: float((1.0 + strikes(w)[0][1]).prod().real), 9.0, 10.0)
    assert (event.kind, event.value) == ('flip', flip)
    for point in branch.points:
        _, multipliers = strikes(point.value)[0]
        assert np.sort(point.multipliers) == pytest.approx(np.sort(multipliers), abs=1e-7)
        assert point.stable == (point.value > event.value)
        assert point.impacts == 1


@pytest.mark.slow
def test_an_impact_comes_where_the_motion_without_reaches_the_wall():
    """From both sides: the response that strikes is unstable where it is born."""
    without, struck = found_between(7.0, 7.3)
    graze = zero(lambda w: abs(forced(w)) + WALL, 7.0, 7.5)
    assert [e for e in without.events if e.kind == 'grazing' and e.value == graze]
    assert [e for e in struck.events if e.kind == 'grazing' and e.value == graze]
    assert all(p.stable and not p.impacts for p in without.points)
    assert not any(p.stable for p in struck.points)


@pytest.mark.slow
def test_a_branch_folds_and_goes_back_to_where_it_grazes():
    """Two responses with one impact, a stable and an unstable one, meet at a fold."""
    struck, without = found_between(12.1, 16.5)
    assert [e.kind for e in struck.events] == ['fold', 'grazing']
    assert struck.events[0].value == zero(discriminant, 15.0, 16.0)
    graze = zero(lambda w: abs(forced(w)) + WALL, 12.0, 12.5)
    assert struck.events[1].value == graze
    assert (without.events[0].kind, without.events[0].value) == ('grazing', graze)
    # the point of the largest value may lie on either side of the fold
    stable = [p.stable for p in struck.points]
    assert stable == sorted(stable, reverse=True)
    for point in struck.points:
        _, multipliers = strikes(point.value)[-1 if point.stable else 0]
        size = np.abs(multipliers).max()
        assert np.abs(point.multipliers[0]) == pytest.approx(size, rel=1e-5)


@pytest.mark.parametrize('rpm', [150.0, 450.0])
def test_a_map_that_begins_in_contact_knows_how_its_start_moves_with_a_key(rpm):
    """At another speed the pin that follows its bushing has another velocity from the start on."""
    machine = ms.load_scene('four_bar_clearance', {'drive.speed': f'{rpm} rpm'})
    section, state = PoincareMap(machine, ['drive.speed']), machine.initial_state()
    assert state.closed == (True,)
    M, by, _ = section.sensitivity(state, 1)
    by += M @ section.seated(state)
    speed, step, ends = machine.drive.fastest, 1e-6, []
    for x in (speed + step, speed - step):
        other = PoincareMap(ms.load_scene(machine, {'drive.speed': x}))
        ends.append(other.map(other.start(state), 1)[0])
    # rates are over the speed of the section
    expected = section.difference(ends[1], ends[0]) / (2.0 * step)
    assert by[:, 0] == pytest.approx(expected, rel=1e-3, abs=1e-6 * np.abs(expected).max())


def test_branches_are_of_what_was_found():
    with pytest.raises(ms.InputError, match=r"what bifurcation.* found, got 'pendulum'"):
        ms.branches('pendulum')


@pytest.mark.slow
def test_the_command_draws_branches(tmp_path):
    scene, picture = tmp_path / 'oscillator.yaml', tmp_path / 'b.svg'
    scene.write_text(OSCILLATOR, encoding='utf-8')
    found = run_json(
        'bifurcation', str(scene), '--vary', 'drive.speed=12.4:12.5:2', '--continue',
        '--transient', '100', '--keep', '8', '--workers', '1', '--plot', str(picture),
    )  # fmt: skip
    assert [b['period'] for b in found['branches']] == [1]
    assert all(p['stable'] for p in found['branches'][0]['points'])
    assert 'stable' in picture.read_text(encoding='utf-8')


def test_a_load_a_thousandth_of_a_turn_wide_is_in_each_section():
    """A kick once a turn beside the table's motion, far from the wall: linear, in closed form."""
    force, width = 20.0, math.pi * 1e-3
    pushes = f'{force} if cos(crank - 1) > {math.cos(width)!r} else 0'
    kick = f'loads: {{kick: {{at: block, force: [0, "{pushes}"]}}}}'
    of = ['position.block', 'velocity.block']
    found = ms.bifurcation(
        OSCILLATOR + kick, {'drive.speed': (20.0, 20.5, 2)}, of=of, transient=400, keep=4
    )
    A = np.array([[0.0, 1.0], [-STIFFNESS / MASS, -DAMPING / MASS]])
    for response in found.responses:
        w, X = response.value, forced(response.value)
        angles = 2.0 * width, 2.0 * np.pi - 1.0 - width, 2.0 * np.pi
        over, after, turn = (scipy.linalg.expm(A * x / w) for x in angles)
        pushed = (over - np.eye(2)) @ np.linalg.solve(A, [0.0, force / MASS])
        kicked = np.linalg.solve(np.eye(2) - turn, after @ pushed)
        assert response.period == 1
        assert np.abs(kicked).max() > 1e-3
        assert response.points == pytest.approx(np.add(kicked, [[X.imag, w * X.real]]), abs=1e-7)


@pytest.mark.slow
def test_a_branch_on_which_many_starts_lie_is_followed_once():
    """A ball that comes to rest in each turn leaves the table where its acceleration is g.

    Sections of it are zero but for rounding, there.
    """
    rest = ball(2.0)[: ball(2.0).index('initial:')] + 'initial: {position: {ball: 1 um}}\n'
    found = ms.bifurcation(
        rest, {'drive.speed': (speed(1.03), speed(1.1), 3)}, transient=20, keep=8
    )
    assert {r.period for r in found.responses} == {1}
    assert len(ms.branches(found)) == 1


@pytest.mark.slow
def test_a_branch_is_followed_once_round_its_fold():
    """Flights are of a period from the stroke on that just throws the ball so high: a fold."""
    fold = math.pi * (1 - E) / (1 + E)
    found = ms.bifurcation(
        ball(1.01 * fold), {'drive.speed': (speed(0.995 * fold), speed(1.03 * fold), 3)},
        transient=60, keep=20,
    )  # fmt: skip
    bouncing = tuple(r for r in found.responses if r.impacts == 1.0)
    assert len(bouncing) == 2
    (branch,) = ms.branches(replace(found, responses=bouncing))
    assert [e.kind for e in branch.events] == ['fold']
    assert branch.events[0].value == pytest.approx(speed(fold), rel=1e-7)


@pytest.mark.slow
def test_a_branch_of_two_periods_ends_at_the_flip_that_it_comes_from():
    """Behind it the same branch follows once more, its turns exchanged: there are no folds.

    The flip is that of Tufillaro et al., see `test_bifurcation`.
    """
    flip = math.hypot(math.pi * (1 - E) / (1 + E), 2.0 * (1 + E**2) / (1 + E) ** 2)
    found = ms.bifurcation(
        ball(flip), {'drive.speed': (speed(flip - 0.04), speed(flip + 0.04), 3)},
        transient=200, keep=40,
    )  # fmt: skip
    events = {b.period: [(e.kind, e.value) for e in b.events] for b in ms.branches(found)}
    assert set(events) == {1, 2}
    for ((kind, value),) in events.values():
        assert kind == 'flip'
        assert value == pytest.approx(speed(flip), rel=1e-7)
