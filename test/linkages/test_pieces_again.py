"""Pieces of ideal motions that a steady drive comes by again: the same bits however it is run."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.linkages.ideal import LinkageMotion
from mechanism_sim.linkages.nominal import NominalRun

SCENES = (
    'slider_crank', 'geneva', 'planetary', 'quick_return', 'rack_and_pinion', 'measured_cam',
    'linear_intermittent',
)  # fmt: skip
CURVE = {'points': [['0 deg', 0], ['70 deg', 900], ['500 deg', -300], ['720 deg', 0]]}
VARIED = {
    'two turns': {
        'tables': {'p': CURVE | {'periodic': True}},
        'loads': {'gas': {'at': 'piston', 'force': ['p(crank)', 0]}},
    },
    'time': {
        'loads': {'gas': {'at': 'piston', 'force': ['9 N if sin(31 rad/s*t) > 0.3 else 0', 0]}}
    },
    'rate and time': {
        'loads': {
            'gas': {'at': 'piston', 'force': ['-2000 if piston_rate > 0 else 0', 0]},
            'pulse': {'at': 'piston', 'force': ['9 N if sin(31 rad/s*t) > 0.3 else 0', 0]},
        }
    },
    'slow': {'drive.speed': '17 rpm'},
}
"""Loads that a steady crank does not bring again with every turn, or that switch by a rate; and a
crank whose pieces are shorter than a sixteenth of a turn."""


def bits(*motions):
    return [
        np.concatenate([np.asarray(getattr(m.curve, name)) for m in motions]).tobytes()
        for name in ('start', 'start_low', 'duration', 'turns', 'coefficients')
    ]


@pytest.mark.sample(9)
@pytest.mark.parametrize('scene', [*SCENES, *VARIED])
def test_pieces_do_not_depend_on_how_a_run_is_advanced_or_taken_up(scene):
    machine = ms.load_scene('slider_crank' if scene in VARIED else scene, VARIED.get(scene))
    turn = machine.drive.period
    whole, parts, taken_up = machine.start(), machine.start(), machine.start()
    whole.advance(7.0 * turn)
    expected = whole.drain()[0]
    seen = []
    for share in np.cumsum([0.03, 0.9, 1.27, 0.01, 2.8, 1.99]):
        parts.advance(share * turn)
        seen.append(parts.drain()[0])
        parts.preview((share + 0.013) * turn)
    taken_up.restore(parts.snapshot())  # nothing is known to it of the turns before
    taken_up.advance(7.0 * turn)
    assert bits(*seen, taken_up.drain()[0]) == bits(expected)


def check_slider_crank(machine, curve):
    """Crank and rod of the package's slider-crank: x = r cos a + sqrt(l^2 - r^2 sin^2 a)."""
    r, rod = (machine.scene.links[name].length for name in ('crank', 'rod'))
    share = np.array([0.0, 0.31, 0.77, 1.0])
    segments = np.repeat(np.arange(len(curve)), len(share))
    dt = np.outer(curve.duration, share).ravel()
    names = machine.mechanism.coordinates
    q, v, a = (dict(zip(names, curve.local(segments, dt, d).T, strict=True)) for d in range(3))
    crank, w = q['crank'], v['crank']
    s, c = r * np.sin(crank), r * np.cos(crank)
    along = np.sqrt(rod**2 - s**2)
    slides = next(n for n in names if n in machine.mechanism.displacements)
    by = -s - s * c / along  # dx / d crank
    bend = -c - (c**2 - s**2) / along - (s * c) ** 2 / along**3
    assert q[slides] == pytest.approx(c + along, abs=1e-13)
    assert v[slides] == pytest.approx(w * by, abs=1e-11 * abs(w).max())
    assert a[slides] == pytest.approx(w**2 * bend, abs=1e-8 * abs(w).max() ** 2)


@pytest.mark.parametrize(
    'turns', [40, pytest.param(10_000, marks=pytest.mark.slow)], ids=['some', 'many']
)
def test_the_last_of_many_turns_is_as_its_closed_form(turns):
    machine = ms.load_scene('slider_crank')
    run = machine.start()
    for k in range(turns // 40):
        run.advance((k + 1) * 40 * machine.drive.period)
        motion = run.drain()[0]
    check_slider_crank(machine, motion.curve)


@pytest.mark.parametrize('far', [1e3, 1e9])
def test_a_run_far_from_its_start_is_as_its_closed_form(far):
    """A crank of 10 turns a second is where it was at the start after whole seconds, nearly."""
    machine = ms.load_scene('slider_crank')
    run = machine.start()
    run.restore(replace(run.snapshot(), base=Fraction(far)))
    run.advance(far + 2.0)
    curve = run.drain()[0].curve
    assert len(curve) == pytest.approx(320, abs=1)
    assert curve.start[0] == far
    check_slider_crank(machine, curve)


def test_a_load_a_thousandth_of_a_turn_wide_works_alike_in_every_turn():
    """The drive gives what the force takes on the way of the piston while it acts."""
    half, force = np.pi * 1e-3, 200.0
    kick = {
        'at': 'piston',
        'force': [f'{force} if cos(crank - 1) > {float(np.cos(half))!r} else 0', 0],
    }
    machine = ms.load_scene('slider_crank', {'loads': {'kick': kick}})
    r, rod = (machine.scene.links[name].length for name in ('crank', 'rod'))
    before, after = (
        r * np.cos(x) + np.sqrt(rod**2 - (r * np.sin(x)) ** 2) for x in (1.0 - half, 1.0 + half)
    )
    turns = 60
    run = ms.simulate(machine, revolutions=turns)
    ends = run.sample(machine.drive.period * np.arange(turns + 1.0))['energy.drive_work']
    assert np.diff(ends) == pytest.approx(force * (before - after), rel=1e-9)


@pytest.mark.sample(3)
@pytest.mark.parametrize('loads', ['none', 'two turns', 'time', 'slow'])
def test_closures_are_solved_in_the_first_turn_only(loads, monkeypatch):
    solved, follow = [], LinkageMotion.follow
    monkeypatch.setattr(
        LinkageMotion, 'follow', lambda *args: solved.append(args) or follow(*args)
    )
    machine = ms.load_scene('slider_crank', VARIED.get(loads))
    run = machine.start()
    assert isinstance(run, NominalRun)
    run.advance(3.0 * machine.drive.period)
    first = len(solved)
    run.advance(33.0 * machine.drive.period)
    assert run.steps > 500
    # a start that lies amid two places of the grid may fall on either
    assert len(solved) - first < 0.1 * run.steps
    check_slider_crank(machine, run.drain()[0].curve)


@pytest.mark.slow
@pytest.mark.parametrize('scene', ['rack_and_pinion', 'linear_intermittent'])
def test_a_rack_that_moves_on_comes_by_its_pieces_again(scene, monkeypatch):
    """Its load begins to act on the way of the third turn only."""
    solved, follow = [], LinkageMotion.follow
    monkeypatch.setattr(
        LinkageMotion, 'follow', lambda *args: solved.append(args) or follow(*args)
    )
    machine = ms.load_scene(scene)
    start = machine.assembly.q[machine.plan.ideal.coordinates.index('rack')]
    turn = {'rack_and_pinion': 0.02 * 2.0 * np.pi, 'linear_intermittent': 0.08}[scene]
    way, force, turns = 2.5 * turn, 7.0, 40
    load = {'push': {'at': 'rack', 'force': [f'{force} if abs(rack - {start}) > {way} else 0', 0]}}
    run = ms.simulate(machine, revolutions=turns)
    assert len(solved) < 0.1 * run.stats.steps
    other = ms.simulate(ms.load_scene(scene, {'loads': load}), revolutions=turns)
    t = machine.drive.period * np.arange(turns + 1.0)
    moved = run.sample(t, 'position.rack')['position.rack'] - start
    assert np.abs(moved) == pytest.approx(turn * np.arange(turns + 1.0), rel=1e-13, abs=1e-15)
    ends = [x.sample(t, 'energy.drive_work')['energy.drive_work'] for x in (run, other)]
    works = force * np.sign(moved[-1]) * np.maximum(np.abs(moved) - way, 0.0)
    assert ends[0] - ends[1] == pytest.approx(works, rel=1e-9, abs=1e-9)


def test_rates_that_switch_loads_are_those_of_pieces_that_are_known(monkeypatch):
    """Closures are followed once a piece, and where the piston turns back, to find when."""
    followed, follow = [], LinkageMotion.follow
    monkeypatch.setattr(
        LinkageMotion, 'follow', lambda *args: followed.append(args) or follow(*args)
    )
    gas = {'at': 'piston', 'force': ['-2000 if piston_rate > 0 else 0', 0]}
    machine = ms.load_scene('slider_crank', {'loads': {'gas': gas}})
    run = machine.start()
    followed.clear()
    run.advance(machine.drive.period, final=True)
    begun = run.drain()[0].curve.start / machine.drive.period
    assert len(begun) == 18  # the first and the last of 17 are halves, and one is cut
    assert np.abs(begun - 0.5).min() < 1e-10
    assert len(followed) <= run.steps + 10


def test_where_more_than_the_angle_counts_every_piece_is_its_own():
    """A load by the time: what began at the same angle a turn before is something else."""
    load = {'at': 'piston', 'force': ['10 N if sin(31 rad/s * t) > 0.3 else 0 N', 0]}
    machine = ms.load_scene('slider_crank', {'loads': {'pulse': load}})
    run = machine.start()
    run.advance(3.2 * machine.drive.period)
    ends = np.array([np.cumsum(run.drain()[0].curve.duration)]).T
    edges = (np.array([np.arcsin(0.3), np.pi - np.arcsin(0.3)]) + 2.0 * np.pi) / 31.0
    assert np.abs(ends - edges).min(axis=0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize('start', [0.0, 90.0, 200.0])
def test_a_switch_may_be_where_a_law_changes_or_a_run_ends(start):
    """The load begins where the drive begins to run up, or so near that rounding decides."""
    turned = 90.0  # deg, at 60 rpm after 0.25 s
    during = {'coordinate': 'wheel', 'from': f'{start + turned} deg', 'to': f'{start + 110} deg'}
    scene = {
        'title': 'wheel', 'mechanism': 'linkage',
        'links': {'wheel': {'mass': '1 kg', 'inertia': '1 kg m^2'}},
        'joints': {'axle': {'revolute': ['ground', 'wheel']}},
        'drive': {
            'coordinate': 'wheel', 'start_angle': f'{start} deg',
            'profile': {'ramp': 'linear', 'points': [['0.25 s', '60 rpm'], ['1.25 s', '120 rpm']]},
        },
        'loads': {'work': {'at': 'wheel', 'torque': '5', 'during': during}},
    }  # fmt: skip
    machine = ms.load_scene(scene)
    run = machine.start()
    run.advance(0.75, final=True)
    motion = run.drain()[0]
    assert motion.curve.end == 0.75
    torque = ms.simulate(machine, duration=0.75).sample(np.array([0.2, 0.26, 0.5]))
    assert torque['drive_torque'] == pytest.approx([0.0, 2.0 * np.pi - 5.0, 2.0 * np.pi], abs=1e-9)
    for end in (0.25, np.nextafter(0.25, 0.0), np.nextafter(0.25, 1.0)):
        other = machine.start()
        other.advance(end, final=True)
        assert other.time == end
