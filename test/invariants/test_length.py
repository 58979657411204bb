"""However long: the last of many revolutions is as the first, in every level and node."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from long_runs import Revolutions
from running import run_json

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.engine.audit import Audit
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.engine.energy_terms import EnergyTerms
from mechanism_sim.engine.snapshot import Snapshot
from mechanism_sim.numerics.formula import Words, expression
from mechanism_sim.results.quantity import Shown
from mechanism_sim.results.run import Piece, Runner
from mechanism_sim.scene import Machine
from mechanism_sim.scene.machine import Run
from mechanism_sim.scene.sensors.encoder import Encoder
from test.grid.length import LATE, OFTEN, far_from_start

ENDED_EARLY = (
    'gear_box', 'gear_pair', 'quick_return', 'geneva', 'ten_links', 'rack_and_pinion',
    'linear_intermittent', 'worm_drive', 'planetary', 'compound_planetary', 'helical_shafts',
    'rotary_engine', 'constant_velocity_slider',
)  # fmt: skip
"""After 17 to 400 revolutions, for closures were not closed to less than angles round."""

CUT = 'geneva', 'quick_return', 'measured_cam', 'linear_intermittent', 'offset_roller_cam'
"""Where switches cut pieces short: of these a preview had more than one."""


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', ENDED_EARLY)
def test_loops_close_after_days_and_many_turns(name):
    machine = ms.load_scene(name)
    run = far_from_start(machine)
    run.advance(run.time + 2.5 * machine.drive.period, final=True)
    motion, *_ = run.drain()
    audit = Audit(machine.physics)
    audit.add(motion, [])
    assert audit.max_closure_error < 1e-14


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ['gear_pair', 'rack_and_pinion'])
def test_many_revolutions_come_to_their_end(name):
    run = ms.stream(ms.load_scene(name), revolutions=60)
    pieces = sum(len(piece.motion) for piece in run)
    assert 16 * 60 <= pieces <= 16 * 60 + 2
    assert run.max_closure_error < 1e-13


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', CUT)
def test_a_run_in_small_parts_has_the_pieces_of_one_at_once(name):
    """Nodes advance as far as the law is known, and look ahead for their samples."""
    machine, digests = ms.load_scene(name), []
    end = 1.3 * machine.drive.period
    for parts in (1, 7, 61):
        run, digest = machine.start(), MotionDigest()
        for k in range(1, parts + 1):
            until = end if k == parts else end * k / parts
            run.advance(until, final=k == parts)
            motion, impacts, _ = run.drain()
            digest.add(motion, impacts)
            ahead = run.preview(until)
            if ahead is not None:
                assert ahead.curve.start[0] == run.time
                assert ahead.curve.end == pytest.approx(until, rel=1e-15)
        digests.append(digest.hexdigest())
    assert len({*digests}) == 1


@pytest.mark.slow
@pytest.mark.network
@pytest.mark.parametrize(
    'name', [CUT[0], *(pytest.param(x, marks=pytest.mark.slow) for x in CUT[1:])]
)
def test_nodes_in_their_own_time_move_as_one_run_does(name, tmp_path):
    bag, period = tmp_path / 'run.mcap', ms.load_scene(name).drive.period
    args = '--duration', str(1.3 * period)
    pace = str(4.0 * period)  # so that it takes a third of a second
    run_json('run', name, *args, '--record', str(bag), '--realtime-factor', pace)
    assert analyze(bag).digest == run_json('solve', name, *args)['digest']


IDEAL = (
    'geneva', 'gear_box', 'quick_return', 'measured_cam', 'compound_planetary', 'four_bar_nominal',
    'film_advance', 'five_bar', 'rotary_engine', 'ten_links', 'scotch_yoke', 'rubbing_compressor',
)  # fmt: skip
DYNAMIC = (
    'four_bar_clearance', 'valve_train', 'pendulum', 'torsional_shaft', 'overhung_rotor',
    'mesh_stiffness', 'elastic_slider_crank', 'slider_crank_engine', 'four_bar_governed',
    'groove_cam', 'slider_with_play', 'whole_machine', 'differential',
)  # fmt: skip
QUICK = 'geneva', 'gear_box', 'film_advance', 'four_bar_clearance', 'valve_train', 'pendulum'


def quick_and_deep(names):
    """Cases of which some are quick."""
    return [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in names]


#: Closed forms and integrated runs: exact times at which their pieces end lie between floats.
BOUNDED = *IDEAL, 'four_bar_clearance', 'valve_train', 'gear_rattle'


@pytest.mark.sample(4)
@pytest.mark.parametrize(
    ('name', 'count'),
    [
        *((name, 3) for name in BOUNDED if name in QUICK),
        *(pytest.param(name, 9, marks=pytest.mark.slow) for name in BOUNDED),
    ],
)
def test_a_run_that_ends_at_a_boundary_of_pieces_is_that_of_solve(name, count):
    """Nodes end a run as soon as its end is known; `simulate` comes to its end, and looks."""
    machine = ms.load_scene(name)
    whole = ms.simulate(machine, duration=2.2 * min(machine.drive.period, 1.0)).motion.curve.start
    for k in np.linspace(1, len(whole) - 1, count).astype(int):
        for end in (np.nextafter(whole[k], 0.0), whole[k], np.nextafter(whole[k], np.inf)):
            solution = ms.simulate(machine, duration=float(end))
            digest, noded = MotionDigest(), Runner(machine)
            for until in (0.37 * end, 0.8 * end, end):
                for piece in noded.to(float(until), final=until == end):
                    digest.add(piece.motion, piece.impacts)
                    assert piece.motion.curve.duration.min(initial=1.0) > 0.1 * np.spacing(end)
            assert digest.hexdigest() == solution.digest(), float(end)
            assert noded.engine.preview(float(end)) is None


def begun(machine: Machine, run: Run) -> Piece:
    """A turn of a run, or a moment, the length a number of which floats know all digits."""
    until = run.time + np.ceil(min(machine.drive.period, 0.2) * 2.0**20) / 2.0**20
    run.advance(until, final=True)
    motion, impacts, changes = run.drain()
    work = Audit(machine.physics).add(motion, impacts)
    return Piece(machine, motion, EnergyTerms(work, impacts), impacts, changes)


@pytest.mark.parametrize('name', quick_and_deep((*IDEAL, *DYNAMIC)))
def test_a_machine_moves_after_days_and_many_turns_as_at_first(name):
    """To the last bit; only the time and the turns that are told beside it differ."""
    machine = ms.load_scene(name)
    near, far = begun(machine, machine.start()), begun(machine, far_from_start(machine))
    a, b = near.motion.curve, far.motion.curve
    assert np.array_equal(a.coefficients, b.coefficients)
    assert np.array_equal(a.duration, b.duration)
    assert len(near.impacts) == len(far.impacts)
    angles = [c not in machine.mechanism.displacements for c in machine.physics.coordinates]
    assert (b.turns - a.turns == np.where(angles, OFTEN, 0)).all()
    t = np.round(np.linspace(0.0, a.end, 43)[1:-1] * 2.0**30) / 2.0**30
    names = near.catalogue.shown(Shown.PARTS)
    one, two = near.sample(t, *names), far.sample(t + float(LATE), *names)
    for column in one.keys() - {'t'}:
        kind = column.partition('.')[0]
        size = max(np.abs(x).max() for n, x in one.items() if n.partition('.')[0] == kind)
        off = two[column] - one[column]
        if one.units[column] == 'rad':  # it counts turns, which cost digits
            off, size = np.remainder(off + np.pi, 2.0 * np.pi) - np.pi, size + 0.1 * OFTEN
        assert np.abs(off).max() <= 1e-9 * size, column


@pytest.mark.parametrize('name', quick_and_deep(('geneva', 'gear_box', 'valve_train')))
def test_a_machine_that_starts_at_many_turns_is_the_same_machine(name):
    plain = ms.load_scene(name)
    start = 2.0 * np.pi * OFTEN + (plain.scene.drive.start_angle or 0.0)
    turned = ms.load_scene(name, overrides={'drive.start_angle': f'{start!r} rad'})
    length = {'duration': min(plain.drive.period, 0.2)}
    a, b = ms.simulate(plain, **length), ms.simulate(turned, **length)
    assert len(a.impacts) == len(b.impacts)
    t = np.linspace(0.0, a.duration, 30)
    main = f'position.{plain.plan.main}'
    off = b.sample(t)[main] - a.sample(t)[main]
    assert off == pytest.approx(2.0 * np.pi * OFTEN, rel=1e-12)
    for column in ('drive_torque', 'energy.kinetic'):
        x, y = a.sample(t, column)[column], b.sample(t, column)[column]
        # the angle itself is known to 6e-11 rad only
        assert y == pytest.approx(x, abs=1e-8 * np.abs(x).max() + 1e-15)


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', ['geneva', 'gear_box', 'rack_and_pinion'])
def test_slow_drives(name):
    machine = ms.load_scene(name, overrides={'drive.speed': '1e-4 rad/s'})
    run = far_from_start(machine, turns=3)
    run.advance(run.time + 30.0, final=True)
    motion, *_ = run.drain()
    plain = ms.load_scene(name)
    there = ms.simulate(plain, duration=0.003 / plain.drive.start[1]).motion.curve
    assert motion.curve.local(*motion.curve.find(np.array([run.time])))[0] == pytest.approx(
        there.local(*there.find(np.array([there.end])))[0], abs=1e-11
    )


@pytest.mark.parametrize('name', quick_and_deep(('geneva', 'gear_box', 'quick_return')))
def test_the_last_of_hundreds_of_revolutions_is_as_the_first(name):
    machine, count = ms.load_scene(name), 20 if name in QUICK else 300
    compared = Revolutions(machine, count - 1)
    for piece in ms.stream(machine, revolutions=count):
        compared.add(piece)
    assert compared.difference()[1] < 1e-11


def test_a_run_goes_on_from_a_snapshot_far_from_its_start(tmp_path):
    for name in ('geneva', 'four_bar_clearance'):
        machine = ms.load_scene(name)
        whole, digests = far_from_start(machine), []
        end = whole.time + 0.25 * machine.drive.period
        whole.advance(end)
        whole.drain()
        machine.snapshot(whole).save(tmp_path / name)
        for run in (whole, machine.resume(Snapshot.load(tmp_path / name))):
            run.advance(whole.time + machine.drive.period if run is whole else end, final=True)
            end, digest = run.time, MotionDigest()
            digest.add(*run.drain()[:2])
            digests.append(digest.hexdigest())
        assert digests[0] == digests[1]


@pytest.mark.slow
def test_a_block_that_rubs_on_two_corners_comes_to_rest_and_stays():
    """Its crank swings ever less, for 78 s; then one corner sticks, the other is at its bound."""
    machine = ms.load_scene('slider_with_play', overrides={
        'initial.velocity.crank': '0.2 rad/s', 'initial.position.crank': '-90 deg',
        'guess.slider': '265 mm', 'guess.rod': '30 deg',
    })  # fmt: skip
    run = ms.stream(machine, duration=60.0)
    for piece in run:
        last = piece
    assert np.abs(last.motion.curve(np.array([60.0]), 1)).max() < 1e-12


@pytest.mark.parametrize(
    ('text', 'whole'),
    [
        ('sin(60*a)', True),
        ('cos(2*(a - 0.3) + t) + tan(-a)', True),
        ('wave(a + 0.1)', True),
        ('sin(a/2)', False),
        ('sin(0.5*a)', False),
        ('sin(k*a)', False),
        ('sin(a*a)', False),
        ('a - sin(a)', False),
        ('line(a)', False),
    ],
)
def test_formulas_do_without_turns_where_they_repeat(text, whole):
    import heyoka as hy  # noqa: PLC0415

    a, t, k, total = hy.make_vars('a', 't', 'k', 'total')
    tables = {'wave': hy.cos, 'line': lambda x: 2.0 * x}
    words = Words({'t': t, 'k': k}, tables=tables, angles={'a': (a, lambda: total)},
                  cyclic={'wave': 1.0})  # fmt: skip
    named = hy.get_variables(expression(text, words))
    assert ('total' not in named) is whole


def test_encoders_count_whole_turns_in_whole_numbers():
    machine = ms.load_scene('gear_pair')
    motion = begun(machine, far_from_start(machine)).motion
    late = replace(motion, curve=replace(motion.curve, turns=motion.curve.turns + 10**9))
    k, dt = motion.curve.find(motion.curve.start[0] + np.linspace(0.0, 0.05, 50))
    counts = [Encoder(machine.mechanism, 'wheel', 'ground', 1024).read(m, k, dt)
              for m in (motion, late)]  # fmt: skip
    assert np.array_equal(*counts)
    steps = counts[0] / (2.0 * np.pi / 4096)
    assert steps == pytest.approx(np.round(steps), abs=1e-9)


def test_profiles_keep_their_turns_apart():
    machine = ms.load_scene('gear_pair', overrides={
        'drive': {'coordinate': 'pinion', 'profile': {
            'points': [['0 s', '10 rad/s'], ['1000000 s', '10 rad/s'], ['1000001 s', '20 rad/s']],
        }},
    })  # fmt: skip
    last = machine.drive.laws[-1]
    assert 0.0 <= last.coefficients[0] < 2.0 * np.pi
    total = 2.0 * np.pi * last.turns + last.coefficients[0]
    assert total == pytest.approx(10_000_015.0, rel=1e-15)
    assert last.about(Fraction(last.valid_from))[0] == last.turns
