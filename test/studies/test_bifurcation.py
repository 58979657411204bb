"""Responses over a parameter: a ball that bounces on a table, whose periods are known exactly."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from bouncing_ball import E, G, ball, speed
from builders import made
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.engine.audit import Audit
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.pages import families
from mechanism_sim.report.bifurcation import basins_text, chart, render, to_json
from mechanism_sim.studies import bifurcation as study
from mechanism_sim.studies.parameters import read_counted
from mechanism_sim.studies.periodic import PoincareMap

FLIP = math.hypot(math.pi * (1 - E) / (1 + E), 2.0 * (1 + E**2) / (1 + E) ** 2)


def test_a_ball_on_a_table_doubles_its_period_where_theory_says():
    """N. B. Tufillaro et al., An Experimental Approach to Nonlinear Dynamics, 1992, section 1.2.

    With one bounce a period the ball strikes with ``g T / (1 + e)`` whatever the table's stroke;
    this is stable up to ``gamma^2 = (pi (1-e)/(1+e))^2 + (2 (1+e^2)/(1+e)^2)^2``.
    """
    assert 1.5 < FLIP < 1.55
    found = ms.bifurcation(
        ball(FLIP), {'drive.speed': (speed(FLIP - 0.04), speed(FLIP + 0.04), 2)},
        at_impacts='flight_lower', transient=200, keep=40,
    )  # fmt: skip
    periods = {(r.branch, r.value < speed(FLIP)): r.period for r in found.responses}
    assert periods == {('up', True): 1, ('up', False): 2, ('down', True): 1, ('down', False): 2}
    for response in found.responses:
        assert response.impacts == pytest.approx(1.0)
        strikes = response.points[:, 0]
        assert len(strikes) == response.period
        if response.period == 1:
            T = 2.0 * math.pi / response.value
            assert strikes[0] == pytest.approx(G * T / (1.0 + E), rel=1e-6)
        else:
            assert np.ptp(strikes) > 0.01 * strikes.mean()
    assert not found.coexisting


def aside(gamma: float, by: float = 0.02) -> str:
    """The scene of a ball that begins by so much [m/s] beside what repeats."""
    pace = re.compile(r'(?<=velocity: {ball: )[-+.e0-9]+')
    return pace.sub(lambda found: repr(float(found[0]) + by), ball(gamma))


@pytest.mark.slow
def test_what_dies_out_slowly_is_no_period_doubling():
    """Before the flip, a multiplier is nearly -1: turns alternate for long, and come together."""
    low, high = FLIP - 0.024, FLIP - 0.008
    found = ms.bifurcation(aside(low), {'drive.speed': (speed(low), speed(high), 3)})
    assert {(r.period, r.settled) for r in found.responses} == {(1, True)}
    assert not found.coexisting


def test_what_is_left_of_two_turns_beyond_the_flip_is_told():
    """There the period is two, however slowly it comes to that."""
    low, high = FLIP + 0.01, FLIP + 0.014
    found = ms.bifurcation(aside(low), {'drive.speed': (speed(low), speed(high), 2)})
    assert {(r.period, r.settled) for r in found.responses} == {(2, True)}
    assert not found.coexisting


def test_what_does_not_settle_is_told_so(monkeypatch):
    """At the flip it dies out as the root of the turns does: there is no end of it."""
    vary = {'drive.speed': (speed(FLIP - 1e-4), speed(FLIP + 1e-4), 2)}
    found = ms.bifurcation(aside(FLIP), vary)
    assert {(r.period, r.settled) for r in found.responses} == {(0, False)}
    assert not found.coexisting
    assert set(found.table()['settled']) == {0}
    shown, data = render((found, ())), to_json((found, ()))
    assert 'not settled' in shown
    assert 'several' not in shown
    assert {(r['period'], r['settled']) for r in data['responses']} == {(None, False)}
    lines = chart(found, 'ball').panels[0].curves
    assert {line.label for line in lines} == {'not settled, up', 'not settled, down'}
    members = []
    monkeypatch.setattr(families, 'family_page', lambda _, given, *__: members.extend(given))
    families.bifurcation_page(found)
    assert [member[0].split(', ')[1] for member in members] == ['not settled'] * 2


def test_two_responses_of_one_machine_are_kept_apart():
    """A ball that flies over two periods of the table, where another start goes to rest on it."""
    e, gamma = 0.85, 1.3 * 2.0 * math.pi * 0.15 / 1.85
    scene = ball(gamma, 2, e)
    limits = speed(gamma), speed(1.02 * gamma)
    found = ms.bifurcation(
        scene, {'drive.speed': (*limits, 2)}, at_impacts='flight_lower', transient=300, keep=40
    )
    assert {(r.period, round(r.impacts, 3)) for r in found.responses} == {(2, 0.5)}
    for response in found.responses:
        T = 4.0 * math.pi / response.value
        assert response.points[:, 0] == pytest.approx([G * T / (1.0 + e)], rel=1e-6)
    low = scene[: scene.index('initial:')] + 'initial: {position: {ball: 1 um}}\n'
    other = ms.bifurcation(
        low, {'drive.speed': (*limits, 2)}, at_impacts='flight_lower', transient=300, keep=40
    )
    assert all(r.period != 2 or r.impacts != 0.5 for r in other.responses)


@pytest.mark.slow
def test_hysteresis_of_the_loose_four_bar():
    """At 445 rpm a response of period 3 that comes from below, and one of 2 from above."""
    found = ms.bifurcation(
        'four_bar_clearance', {'drive.speed': ('435 rpm', '455 rpm', 5)}, transient=60, keep=60
    )
    periods = {(r.branch, round(r.value * 30.0 / math.pi)): r.period for r in found.responses}
    assert periods['up', 445] == 3
    assert periods['down', 445] == 2
    assert found.coexisting


def test_the_command_writes_a_table_and_a_picture(tmp_path):
    scene = tmp_path / 'ball.yaml'
    scene.write_text(ball(1.3), encoding='utf-8')
    args = (
        'bifurcation', str(scene), '--vary', 'drive.speed=340 rpm:360 rpm:2', '--transient', '4',
        '--keep', '4', '--workers', '1', '-o', str(tmp_path / 'b.csv'), '--plot',
        str(tmp_path / 'b.svg'),
    )  # fmt: skip
    found = run_json(*args)
    assert [r['branch'] for r in found['responses']] == ['up', 'down'] * 2
    assert {(p['branch'], p['of']) for p in found['points']} == {
        ('up', 'velocity.ball'), ('down', 'velocity.ball')
    }  # fmt: skip
    assert all({'value', 'measure', 'period', 'branch'} <= p.keys() for p in found['points'])
    assert (tmp_path / 'b.svg').stat().st_size > 1000
    head = (tmp_path / 'b.csv').read_text(encoding='utf-8').splitlines()[0]
    assert head.startswith('drive.speed [rpm],branch,period,response,velocity.ball')


@pytest.mark.parametrize(
    ('args', 'said'),
    [
        (('four_bar_clearance',), "--vary: write NAME=LOW:HIGH:N, as 'drive.speed=100 rpm"),
        (('four_bar_clearance', '--vary', 'drive.speed=1:2'), 'write NAME=LOW:HIGH:N'),
        (('four_bar_clearance', '--vary', 'drive.speed=1:2:1'), 'must be at least 2'),
        (('four_bar_clearance', '--vary', 'drive.speed=1:2:1000000000'),
         "'drive.speed=1:2:1000000000': 1000000000 values are too many: at most 100000"),
        (('four_bar_clearance', '--vary', 'drive.sped=1:2:3'), "'drive.sped'"),
        (('slider_crank', '--vary', 'drive.speed=1:2:3'), 'without a free motion'),
        (('four_bar_clearance', '--vary', 'drive.speed=1:2:3', '--keep', '0'), 'keep must be'),
        (('four_bar_clearance', '--vary', 'drive.speed=1:2:3', '--of', 'velocity.roker'),
         "there is no quantity 'velocity.roker'"),
        (('four_bar_clearance', '--vary', 'drive.speed=1:2:3', '--at-impacts', 'x'),
         "there is no loose joint 'x'"),
        (('mass_on_spring', '--vary', 'links.mass.mass=1:2:3'), 'a drive at constant speed'),
        (('four_bar_clearance', *['--vary', 'drive.speed=1:2:3'] * 2), 'two ranges of'),
    ],
)  # fmt: skip
def test_mistakes_get_one_sentence(args, said):
    done = run('bifurcation', *args)
    assert done.returncode == 2
    assert said in done.stderr.splitlines()[-1]
    assert 'Traceback' not in done.stderr


def test_basins_want_two_keys():
    done = run('basins', 'four_bar_clearance', '--vary', 'drive.speed=1:2:3')
    assert done.returncode == 2
    assert 'basins: --vary: give two keys; bifurcation takes one' in done.stderr


def test_more_runs_than_fit_are_refused_before_anything_is_made():
    wide = {'drive.speed': (100.0, 200.0, 1000), 'gravity': (1.0, 2.0, 1000)}
    said = r'^drive.speed, gravity: 1000 x 1000 = 1000000 values are too many: at most 100000$'
    with pytest.raises(InputError, match=said):
        ms.basins('four_bar_clearance', wide)
    with pytest.raises(InputError, match=r'^drive.speed: 100001 values are too many'):
        ms.bifurcation('four_bar_clearance', {'drive.speed': (100.0, 200.0, 100_001)})


def test_a_motion_that_fails_its_audit_is_told(monkeypatch):
    """What every run refuses is refused here, too."""

    def judge(*_: object) -> None:
        raise InputError('judged')

    monkeypatch.setattr(Audit, 'judge', judge)
    with pytest.raises(InputError, match='judged'):
        ms.bifurcation(ball(1.3), {'drive.speed': ('300 rpm', '310 rpm', 2)}, transient=1, keep=2)


def test_which_start_leads_to_which_response():
    """A ball that is highest over the table comes back for ever; one that lies on it stays."""
    e, gamma = 0.85, 1.3 * 2.0 * math.pi * 0.15 / 1.85
    scene = ball(gamma, 2, e)
    height, pace = (
        float(re.search(rf'{key}: {{ball: ([-+.e0-9]+)}}', scene)[1])
        for key in ('position', 'velocity')
    )
    found = ms.basins(
        scene,
        {
            'initial.position.ball': (0.0, height, 2),
            'initial.velocity.ball': (pace, 0.999 * pace, 2),
        },
        transient=300,
        keep=40,
    )
    kinds = {(x > 0.0, y == pace): k for x, y, _, k in found.cells}
    assert kinds[True, True] == kinds[True, False]
    assert kinds[False, True] != kinds[True, True]
    assert found.kinds[kinds[True, True]].period == 2
    table = found.table()
    assert len(table['response']) == 4
    assert repr(found) == f'<Basins: {table!r}>'
    assert found._repr_html_() == table._repr_html_()


def test_starts_that_cannot_be_are_a_kind_of_their_own():
    """A pin lies within a circle: a grid over where it begins has corners outside."""
    ends = ms.simulate('four_bar_clearance', duration=1e-4).sample([0.0], 'position.coupler',
                                                                   'position.rocker')  # fmt: skip
    coupler, rocker = (float(ends[f'position.{c}'][0]) for c in ('coupler', 'rocker'))
    near = 2e-3  # rad: twice of what lies in the play
    found = ms.basins(
        'four_bar_clearance',
        {
            'initial.position.coupler': (coupler - near, coupler + near, 3),
            'initial.position.rocker': (rocker - near, rocker + near, 3),
        },
        transient=1,
        keep=2,
    )
    refused = [(x, y) for x, y, r, _ in found.cells if 'puts the pin of coupler_rocker' in r.note]
    assert 0 < len(refused) < 9
    assert len({kind for *_, r, kind in found.cells if r.note}) == 1
    done = basins_text(found)
    assert 'no run' in done
    assert done.count('puts the pin of coupler_rocker') == 1
    far = {
        'initial.position.coupler': (coupler - near, coupler + near, 2),
        'initial.position.rocker': (rocker + 0.1, rocker + 0.2, 2),
    }
    with pytest.raises(InputError, match=r'initial\.position puts the pin of coupler_rocker'):
        ms.basins('four_bar_clearance', far)


def test_columns_of_basins_are_without_the_rounding_of_their_units():
    e = 'joints.coupler_rocker.clearance.restitution'
    found = ms.basins(
        'four_bar_clearance',
        {'drive.speed': ('90 rpm', '93 rpm', 4), e: (0.1, 0.4, 2)}, transient=1, keep=2,
    )  # fmt: skip
    speeds = [float(x) for x in found.table()['drive.speed']]
    assert speeds == [90.0, 90.0, 91.0, 91.0, 92.0, 92.0, 93.0, 93.0]
    assert found.written[0][1] * found.cells[2][0] != 91.0  # as it is computed


def test_a_run_that_fails_is_told_and_is_no_response(monkeypatch):
    """Where neither the state before nor the own start leads on: others go on, none coexists."""
    settled = study._settled

    def fails(machine, own, plan, state, seen):
        if machine.scene.drive.speed.value > speed(1.25):
            raise RunError('broken')
        return settled(machine, own, plan, state, seen)

    monkeypatch.setattr(study, '_settled', fails)
    low, high = speed(1.2), speed(1.3)
    found = ms.bifurcation(
        ball(1.2), {'drive.speed': (f'{low}rad/s', f'{high}rad/s', 2)}, transient=4, keep=4
    )
    assert [bool(r.note) for r in found.responses] == [False, False, True, True]
    assert all(len(c.x) for panel in chart(found, '').panels for c in panel.curves)
    assert not found.coexisting
    assert (found.unit, found.scale) == ('rad/s', pytest.approx(1.0))


@pytest.mark.slow
def test_responses_are_followed_over_speeds_where_turns_are_few():
    """A state moves with its machine: contacts of the neighbour do not strike at another speed."""
    found = ms.bifurcation(
        'four_bar_clearance', {'drive.speed': ('445 rpm', '447 rpm', 3)}, transient=12, keep=16,
        longest=3,
    )  # fmt: skip
    up, down = ([r.period for r in found.responses if r.branch == x] for x in ('up', 'down'))
    assert up[1:] == down[:-1] == [2, 2]


def test_a_direction_of_many_values_shares_its_turns():
    """Values of a dense diagram begin near to where they settle; what is asked for stays."""
    turns = []
    for count, asked in ((3, {}), (3, {'keep': 20}), (800, {}), (800, {'transient': 30})):
        plan, _, _ = study.section(ms.load_scene(ball(2.5)), (), None, asked)
        shared = study.paced(plan, count, asked)
        turns.append((shared.transient, shared.keep))
    assert turns == [(60, 60), (60, 20), (8, 16), (30, 16)]


@pytest.mark.slow
def test_a_branch_is_foretold(monkeypatch):
    """On the course of the responses before a run begins where it ends: few turns show it."""
    turns, found_of = [], study._SectionAccumulator.found

    def counted(accumulator, count, settled):
        turns.append(count)
        return found_of(accumulator, count, settled)

    monkeypatch.setattr(study._SectionAccumulator, 'found', counted)
    stable = {'drive.speed': (speed(FLIP - 0.20), speed(FLIP - 0.15), 11)}
    found = ms.bifurcation(
        ball(FLIP - 0.2), stable, at_impacts='flight_lower', transient=40, keep=40
    )
    assert {r.period for r in found.responses} == {1}
    for r in found.responses:
        strikes = G * 2.0 * math.pi / r.value / (1.0 + E)
        assert r.points[:, 0] == pytest.approx([strikes], rel=1e-6)
    assert np.median(turns) < 16  # 33 from where the one before came to


@pytest.mark.slow
def test_a_branch_that_is_foretold_flips_where_it_does():
    """Past a flip it leads on to what has become unstable: it is left as turns tell."""
    across = {'drive.speed': (speed(FLIP - 0.06), speed(FLIP + 0.04), 26)}
    found = ms.bifurcation(
        ball(FLIP - 0.06), across, at_impacts='flight_lower', transient=150, keep=40
    )
    up = [(r.value, r.period) for r in found.responses if r.branch == 'up']
    step = 0.1 / 25
    assert {p for v, p in up if v < speed(FLIP - 1.5 * step)} == {1}
    assert 1 not in {p for v, p in up if v > speed(FLIP + 0.5 * step)}
    assert {p for v, p in up if v > speed(FLIP + 2.5 * step)} == {2}


def test_responses_ten_thousand_turns_away_are_those_of_the_start():
    """So many turns of the crank are part of its angle only."""
    scene, found = ms.load_scene(ball(1.3)), []
    first = scene.drive.start[0]
    for turns in (0, 10_000):
        away = ms.load_scene(scene, {'drive.start_angle': first + 2.0 * math.pi * turns})
        found.append(
            ms.bifurcation(
                away, {'drive.speed': (speed(1.28), speed(1.3), 2)}, at_impacts='flight_lower',
                transient=200, keep=40,
            )
        )  # fmt: skip
    for near, far in zip(*(x.responses for x in found), strict=True):
        assert near.period == far.period == 1
        assert far.points == pytest.approx(near.points, rel=1e-9)


def test_a_crank_at_rest_is_told_and_has_no_response():
    limits = {'drive.speed': ('-100 rpm', '100 rpm', 3)}
    found = ms.bifurcation('four_bar_clearance', limits, transient=2, keep=2)
    assert {r.note for r in found.responses if r.value == 0.0} == {'the crank is at rest'}
    assert len(found.responses) == 6
    # a refused value is no branch: it has neither period nor impacts, and why stands below
    lines = [re.split(r' {2,}', line.strip()) for line in render((found, ())).splitlines()]
    for branch in ('up', 'down'):
        assert [branch, '0 rpm', '0 rpm', '1', 'no run', '-'] in lines
        assert [f'{branch}, 0 rpm: the crank is at rest'] in lines
    rows = to_json((found, ()))['responses']
    assert [row['impacts_per_turn'] is None for row in rows] == [x['value'] == 0.0 for x in rows]


def test_a_start_of_a_state_is_that_of_each_value():
    """An amplitude that is a state without a rate: ``x'' + 2 x' + x = A cos t`` has x' = A/2.

    Its scale is a power of two, so that values on both sides of one are told apart, too.
    """
    scene = made({
        'gravity': [0.0, 0.0],
        'links': {'block': {'mass': 1.0}, 'clock': {'mass': 1.0, 'inertia': 1.0}},
        'joints': {'guide': {'prismatic': ['ground', 'block']},
                   'axle': {'revolute': ['ground', 'clock']}},
        'drive': {'coordinate': 'clock', 'speed': 1.0},
        'states': {'A': {'start': 1.0, 'rate': '0*t'}},
        'loads': {'f': {'at': 'block', 'force': ['A*cos(clock) - 2*block_rate - block', 0.0]}},
    })  # fmt: skip
    found = ms.bifurcation(scene, {'states.A.start': (1.0, 5.0, 3)}, transient=8, keep=4)
    assert len(found.responses) == 6
    for r in found.responses:
        assert r.points[:, 0] == pytest.approx([0.5 * r.value] * len(r.points), rel=1e-9)


@pytest.mark.slow
def test_what_is_foretold_past_a_pitchfork_is_left():
    """A pendulum that swings alike to both sides, less damped no more: a multiplier passes +1.

    Near there the motion that is no longer stable is left by a hundredth a turn.
    """
    scene = made(
        {
            'gravity': [0.0, -1.0],
            'links': {
                'ground': {'points': {'far': [5.0, 0.0]}},
                'crank': {'mass': 1.0, 'inertia': 1.0},
                'bob': {'mass': 1.0, 'inertia': 1e-6, 'cog': [0.0, -1.0]},
            },
            'joints': {
                'shaft': {'revolute': ['ground', 'crank']},
                'pin': {'revolute': ['ground.far', 'bob']},
            },
            'drive': {'coordinate': 'crank', 'speed': 2.0 / 3.0},
            'springs': {'damper': {'coordinate': 'bob', 'damping': '0.54 N m s/rad'}},
            'loads': {'push': {'at': 'bob', 'torque': '1.05*cos(crank)'}},
        },
        'pendulum',
    )
    limits = {'springs.damper.damping': ('0.5275 N m s/rad', '0.54 N m s/rad', 6)}
    found = ms.bifurcation(scene, limits, of=['position.bob'], transient=200, keep=40)
    stable = []
    for r in (r for r in found.responses if r.branch == 'down'):
        machine = ms.load_scene(scene, {'springs.damper.damping': r.value})
        J, _ = PoincareMap(machine).growth(r.state, 1)
        stable.append((r.period, np.abs(np.linalg.eigvals(J)).max() < 1.0))
    assert stable[-1] == (1, True)
    assert all(still for period, still in stable if period == 1)
    assert 0 in [period for period, _ in stable]


def test_ranges_are_texts_or_tuples():
    """As those of `find` and of the commands; numbers of values may be NumPy's."""
    texts = 'drive.speed=100 rpm:110 rpm:2', ['drive.speed = 100 rpm:110 rpm:2']
    names = (
        {'drive.speed': '100 rpm:110 rpm:2'},
        {'drive.speed': ['100 rpm', '110 rpm', np.int8(2)]},
    )
    found = {str(read_counted('vary', given)) for given in (*texts, *names)}
    assert found == {"{'drive.speed': ('100 rpm', '110 rpm', 2)}"}
    for wrong, said in (
        ({'drive.speed': (1.0, 2.0)}, 'write (LOW, HIGH, NUMBER) or '),
        ({'drive.speed': (1.0, 2.0, 2.5)}, 'drive.speed: number = 2.5 is not a whole number'),
        ({'drive.speed': '1:2'}, 'write NAME=LOW:HIGH:N'),
        ({}, 'bifurcation: one key is varied, not 0'),
    ):
        with pytest.raises(InputError) as caught:
            ms.bifurcation('four_bar_clearance', wrong)
        assert said in str(caught.value)
