"""The ideal four-bar: closed form against other people's digits and against differences."""

from __future__ import annotations

from itertools import pairwise, permutations
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from builders import made
from four_bars import LINKS, SPEED, reference
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp, mpf

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.linkages.four_bar import FourBar, _loops
from mechanism_sim.linkages.grashof import crank_turns, excess
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.files import find_scene

THESIS = FourBar(0.387, 0.064, 0.309, 0.312)
TURN = np.linspace(0.0, 2.0 * np.pi, 97)


@st.composite
def crank_rockers(draw):
    """Four-bars whose crank turns fully, by Grashof's rule: crank shortest, s + l < p + q."""
    crank = draw(st.floats(0.05, 1.0))
    p, q = draw(st.floats(1.2, 4.0)) * crank, draw(st.floats(1.2, 4.0)) * crank
    low, high = max(p, q) * 1.0001, (p + q - crank) * 0.999
    longest = low + draw(st.floats(0.0, 1.0)) * max(high - low, 0.0)
    if high <= low:
        longest = max(p, q)
    lengths = draw(st.permutations([p, q, longest]))
    return FourBar(lengths[0], crank, *lengths[1:], draw(st.sampled_from(['open', 'crossed'])))


def loop_error(f, th2, th3, th4):
    z = f.crank * np.exp(1j * th2) + f.coupler * np.exp(1j * th3)
    return np.abs(z - f.ground - f.rocker * np.exp(1j * th4))


def wrapped(angle):
    return np.angle(np.exp(1j * angle))


def test_nominal_motion_agrees_with_the_multiprecision_reference():
    ref = reference('nominal')
    q, v, a = THESIS.motion(np.radians(ref['crank_angle']), SPEED, 0.0)
    for name, row, tolerance in (
        ('th3', q[1], 1e-15), ('th4', q[2], 1e-15), ('w3', v[1], 1e-14), ('w4', v[2], 1e-14),
        ('a3', a[1], 2e-12), ('a4', a[2], 2e-12),
    ):  # fmt: skip
        assert np.abs(row - ref[name]).max() < tolerance, name


def test_the_books_crossed_four_bar_to_all_printed_digits():
    """[V] appendix A.4.2; there the rocker points to the frame: its angle is ours less pi."""
    ref = reference('appendix_a4')['four_bar']
    book = FourBar(4.0, 1.0, 6.0, 5.0, 'crossed')
    th2 = np.pi / 10.0 * np.arange(20)
    th3, th4 = book.positions(th2)
    for ours, column in ((th3, ref['th3']), (th4 + np.pi, ref['th4'])):
        assert np.abs(wrapped(ours - column['computed'])).max() < 4e-15
        for x, printed in zip(wrapped(ours), column['printed'], strict=True):
            assert f'{x:.6g}' == f'{float(printed):.6g}'


def test_accelerating_crank_against_differences_in_multiprecision():
    """Closure by Newton in 40 digits, differentiated by central differences."""
    th2, w2, a2 = 0.7, SPEED, -250.0
    with mp.workdps(40):
        L = [mpf(x) for x in ('0.387', '0.064', '0.309', '0.312')]
        L = [mpf(float(x)) for x in L]

        def close(t):
            crank = mpf(th2) + mpf(w2) * t + mpf(a2) * t * t / 2

            def loop(x, y):
                return (
                    L[1] * mp.cos(crank) + L[2] * mp.cos(x) - L[3] * mp.cos(y) - L[0],
                    L[1] * mp.sin(crank) + L[2] * mp.sin(x) - L[3] * mp.sin(y),
                )

            return mp.findroot(loop, (0.8, 2.05), tol=1e-70)

        h = mpf('1e-11')
        before, now, after = close(-h), close(mpf(0)), close(h)
        first = [float((b - a) / (2 * h)) for a, b in zip(before, after, strict=True)]
        second = [
            float((a - 2 * n + b) / h**2) for a, n, b in zip(before, now, after, strict=True)
        ]
        exact = np.array([[float(x) for x in now], first, second])
    motion = THESIS.motion(np.array([th2]), np.array([w2]), np.array([a2]))
    np.testing.assert_allclose([row[1:, 0] for row in motion], exact, rtol=2e-14)


@given(crank_rockers())
def test_loops_close_and_turn_steadily_for_every_crank_rocker(f):
    assert crank_turns(f)
    assert excess(f.lengths) > 0.0
    q, v, a = f.motion(TURN, 1.0, 0.0)
    size = f.ground + f.crank + f.coupler + f.rocker
    assert loop_error(f, *q).max() < 1e-14 * size
    # A rate is the derivative of an angle: Fourier series of periodic angles are differentiated.
    sharpness = np.abs(np.sin(q[1] - q[2])).min()
    if sharpness < 0.2:
        return  # nearly a change point: no series resolves that
    n = 512
    th2 = 2.0 * np.pi * np.arange(n) / n
    q, v, a = f.motion(th2, 1.0, 0.0)
    k = 1j * np.fft.fftfreq(n, 1.0 / n)
    for i in (1, 2):
        angle = np.unwrap(q[i])
        rate = np.fft.ifft(k * np.fft.fft(angle)).real
        assert np.abs(rate - v[i]).max() < 1e-8 * (1.0 + np.abs(v[i]).max())
        second = np.fft.ifft(k * np.fft.fft(v[i])).real
        assert np.abs(second - a[i]).max() < 1e-6 * (1.0 + np.abs(a[i]).max())


@given(crank_rockers())
def test_branches_are_mirror_images_in_the_frame_line(f):
    other = FourBar(
        f.ground, f.crank, f.coupler, f.rocker, 'crossed' if f.branch == 'open' else 'open'
    )
    here, there = f.motion(TURN, 2.0, 3.0), other.motion(-TURN, -2.0, -3.0)
    # Beyond a dead centre both branches would coincide: conditioning goes with 1/sin.
    bend = np.abs(np.sin(here[0][1] - here[0][2])).min()
    assert np.abs(wrapped(here[0] + there[0])).max() < 1e-14 / bend
    for x, y in zip(here[1:], there[1:], strict=True):
        assert np.abs(x + y).max() < 1e-13 * np.abs(x).max() / bend**2


@given(crank_rockers())
def test_the_open_branch_has_its_pin_left_of_the_diagonal(f):
    """From crank pin to rocker pivot, the pin of the open branch lies on the left."""
    th3, _ = f.positions(TURN)
    crank_pin = f.crank * np.exp(1j * TURN)
    side = ((f.ground - crank_pin).conj() * f.coupler * np.exp(1j * th3)).imag
    assert (side > 0.0).all() if f.branch == 'open' else (side < 0.0).all()


def test_grashof_classifies_by_shortest_and_longest():
    assert excess((4.0, 1.0, 6.0, 5.0)) == pytest.approx(2.0)
    assert excess((3.0, 2.0, 2.5, 1.6)) < 0.0
    assert excess((0.3, 0.1, 0.3, 0.1)) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(
    ('lengths', 'turns'),
    [
        ((4.0, 1.0, 6.0, 5.0), True),  # crank-rocker
        ((1.0, 4.0, 5.0, 6.0), True),  # drag link: the ground is shortest
        ((4.0, 5.0, 6.0, 1.0), False),  # the rocker is shortest
        ((4.0, 5.0, 1.0, 6.0), False),  # the coupler is shortest: double rocker
        ((3.0, 2.0, 2.5, 1.6), False),  # no link turns
        ((0.3, 0.1, 0.3, 0.1), False),  # parallelogram: change points
        ((0.5, 0.1, 0.2, 0.4), False),  # change point at crank angle 180 degrees
        ((1.0, 9.0, 1.0, 1.0), False),  # cannot be assembled
    ],
)
def test_a_crank_turns_fully_only_as_crank_rocker_or_drag_link(lengths, turns):
    f = FourBar(*lengths)
    assert crank_turns(f) is turns
    th2 = np.linspace(0.0, 2.0 * np.pi, 721)
    sharp = np.abs(np.sin(np.subtract(*f.positions(th2))))
    assert bool(np.nan_to_num(sharp, nan=0.0).min() > 1e-7) is turns


def test_angles_that_cannot_close_are_nan_and_nothing_else():
    f = FourBar(3.0, 2.0, 2.5, 1.6)
    th3, th4 = f.positions(np.array([0.3, np.pi]))
    assert np.isfinite([th3[0], th4[0]]).all()
    assert np.isnan([th3[1], th4[1]]).all()


# --- the same as motion: polynomials of the closed form ---------------------------------------


@pytest.fixture(scope='module')
def nominal():
    return ms.simulate(ms.load_scene('four_bar_nominal'), revolutions=3.3)


def test_sampled_motion_is_the_closed_form(nominal):
    t = np.linspace(0.0, nominal.duration, 500)
    table = nominal.sample(t)
    q, v, a = THESIS.motion(SPEED * t, SPEED, 0.0)
    for i, name in enumerate(LINKS):
        assert np.abs(wrapped(table[f'position.{name}'] - q[i])).max() < 5e-15
        assert np.abs(table[f'velocity.{name}'] - v[i]).max() < 2e-13
        assert np.abs(table[f'acceleration.{name}'] - a[i]).max() < 2e-11


def test_published_polynomials_are_as_good_as_the_closed_form(nominal):
    """What other nodes see: only the polynomials, never the closed form behind them."""
    t = np.linspace(0.0, nominal.duration, 500)
    q, v, _ = THESIS.motion(SPEED * t, SPEED, 0.0)
    curve = nominal.motion.curve
    assert np.abs(wrapped(curve(t).T - q)).max() < 1e-14
    assert np.abs(curve(t, 1).T - v).max() < 1e-10
    assert nominal.max_closure_error < 1e-15


def test_pieces_join_without_a_jump_of_angle_or_rate(nominal):
    c = nominal.motion.curve
    k = np.arange(len(c) - 1)
    for d, tolerance in ((0, 2e-14), (1, 2e-10)):
        end, start = c.at(k, c.duration[:-1], d), c.at(k + 1, np.zeros(len(k)), d)
        assert np.abs(end - start).max() < tolerance * (SPEED if d else 1.0)


def test_forces_of_the_ideal_four_bar_agree_with_the_reference(nominal):
    ref = reference('nominal')
    t = np.radians(ref['crank_angle']) / SPEED
    table = nominal.sample(t)
    for column, name in (
        ('reaction.coupler_rocker.x', 'force_x'), ('reaction.coupler_rocker.y', 'force_y'),
        ('drive_torque', 'torque'),
    ):  # fmt: skip
        assert np.abs(table[column] - ref[name]).max() < 2e-13, name


def test_extreme_bearing_forces_of_a_turn_agree_with_the_reference(nominal):
    ref = reference('nominal')
    for key, least in (('smallest_bearing_force', True), ('largest_bearing_force', False)):
        near = np.radians(ref[key]['crank_angle']) / SPEED
        t = near + np.linspace(-2e-4, 2e-4, 401)
        table = nominal.sample(t, 'reaction.coupler_rocker.x', 'reaction.coupler_rocker.y')
        force = np.hypot(table['reaction.coupler_rocker.x'], table['reaction.coupler_rocker.y'])
        extreme = force.min() if least else force.max()
        assert extreme == pytest.approx(ref[key]['force'], rel=1e-8)


def test_energy_books_of_the_ideal_four_bar_close(nominal):
    assert abs(nominal.energy.residual) < 1e-14
    assert nominal.energy.dissipated == 0.0
    assert abs(nominal.energy.drive_work) > 1e-3


def test_drive_work_over_whole_turns_vanishes():
    s = ms.simulate(ms.load_scene('four_bar_nominal'), revolutions=2.0)
    assert abs(s.energy.drive_work) < 1e-13


def test_a_crank_that_runs_backwards_retraces_the_same_angles():
    forward = ms.simulate(ms.load_scene('four_bar_crossed'), revolutions=1.0)
    back = ms.simulate(
        ms.load_scene('four_bar_crossed', {'drive.speed': '-1 rad/s'}), revolutions=1.0
    )
    t = np.linspace(0.0, forward.duration, 50)
    a, b = forward.sample(t), back.sample(t[::-1])
    for name in LINKS:
        assert np.abs(wrapped(a[f'position.{name}'] - b[f'position.{name}'])).max() < 1e-13
        np.testing.assert_allclose(
            a[f'velocity.{name}'], -b[f'velocity.{name}'], rtol=1e-11, atol=1e-12
        )


def written_out(turns, guess, loose=True):
    """The thesis's four-bar with its links anyhow in their frames, and rough guesses."""
    data = yaml.safe_load(find_scene('four_bar_clearance').read_text('utf-8'))
    links = data['links']
    del data['branch']

    def along(link, key, turned):
        length = float(links[link].pop(key).split()[0]) * 1e-3
        return [length * np.cos(turned), length * np.sin(turned)]

    for name, turned in zip(('crank', 'coupler', 'rocker', 'ground'), turns, strict=True):
        links[name]['points'] = {'far': along(name, 'length', turned)}
        if name != 'ground':
            links[name]['cog'] = along(name, 'cog', turned)
    if not loose:
        del data['joints']['coupler_rocker']['clearance']
    data['joints'] = {
        'ground_crank': {'revolute': ['ground', 'crank']},
        'crank_coupler': {'revolute': ['crank.far', 'coupler']},
        'coupler_rocker': {
            'revolute': ['coupler.far', 'rocker.far'], **data['joints']['coupler_rocker'],
        },
        'rocker_ground': {'revolute': ['rocker', 'ground.far']},
    }  # fmt: skip
    frame = turns[-1]
    data['drive']['start_angle'] = frame - turns[0]
    data['gravity'] = [9.8145 * np.sin(frame), -9.8145 * np.cos(frame)]
    data |= {'mechanism': 'linkage', 'guess': guess}
    return made(data, 'written_out')


def test_a_four_bar_that_is_written_out_is_the_template_bit_by_bit():
    short = ms.load_scene('four_bar_clearance')
    found = written_out((0.0, 0.0, 0.0, 0.0), {'coupler': 0.8, 'rocker': 2.5})
    assert ms.simulate(found).digest() == ms.simulate(short).digest()
    crossed = written_out((0.0, 0.0, 0.0, 0.0), {'coupler': -0.8, 'rocker': -2.5})
    assert (found.nominal.linkage.branch, crossed.nominal.linkage.branch) == ('open', 'crossed')


@pytest.mark.sample(1)
@pytest.mark.parametrize('loose', [True, False])
def test_a_four_bar_is_known_by_its_loop_however_its_links_are_drawn(loose):
    a, b, c, frame = turns = 0.4, -1.1, 2.0, 0.7
    guess = {'coupler': 1.0 + frame - b, 'rocker': 2.1 + frame - c}
    changes = {} if loose else {'joints.coupler_rocker.clearance': None}
    short = ms.load_scene('four_bar_clearance', changes)
    drawn = written_out(turns, guess, loose)
    lengths = drawn.assembly.loop.linkage.lengths
    assert lengths == pytest.approx(short.nominal.linkage.lengths, rel=1e-15)
    with pytest.raises(InputError, match='joints on their x axes'):
        _ = drawn.nominal.linkage
    one, other = (ms.simulate(m, duration=0.08) for m in (short, drawn))
    t = np.linspace(0.0, 0.05 if loose else 0.08, 41)
    turned = np.array([frame - a, frame - b, frame - c])
    off = other.motion.curve(t) - turned - one.motion.curve(t)
    assert np.abs(wrapped(off)).max() < (1e-9 if loose else 1e-13)
    reactions = [
        np.hypot(
            *(
                s.sample(t, f'reaction.rocker_ground.{x}')[f'reaction.rocker_ground.{x}']
                for x in 'xy'
            )
        )
        for s in (one, other)
    ]
    assert reactions[1] == pytest.approx(reactions[0], rel=1e-6 if loose else 1e-11)


def test_loops_are_those_that_every_three_links_make():
    """Links of a parallelogram row, some joined twice: walking finds what trying all does."""
    order = [f'l{k}' for k in range(6)]
    pairs = [(GROUND, 'l0'), ('l0', 'l1'), ('l1', 'l2'), ('l2', GROUND), ('l2', 'l3'),
             ('l3', 'l4'), ('l4', GROUND), ('l1', 'l5'), ('l5', GROUND), ('l5', 'l4'),
             ('l3', 'l5'), ('l3', 'l5')]  # fmt: skip
    joints = [SimpleNamespace(first=a, second=b) for a, b in pairs]
    machine = SimpleNamespace(bodies=[SimpleNamespace(name=x) for x in order], joints=joints)
    driven = ['l4']
    ranked = sorted(order, key=lambda link: link not in driven)
    tried = []
    for links in permutations(ranked, 3):
        ring = (GROUND, *links, GROUND)
        own = [[j for j in joints if {j.first, j.second} == {*two}] for two in pairwise(ring)]
        if ranked.index(links[0]) < ranked.index(links[2]) and all(len(x) == 1 for x in own):
            tried.append((links, tuple(x[0] for x in own)))
    assert len(tried) > 3
    assert list(_loops(machine, driven)) == tried
