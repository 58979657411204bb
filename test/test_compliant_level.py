"""Compliant contact as a level of scenes: the rigid model is its limit."""

from __future__ import annotations

import heyoka as hy
import numpy as np
import pytest
from four_bars import TURN
from running import run_json
from scipy.integrate import solve_ivp

import mechanism_sim as ms
from mechanism_sim.bench.hard.bodies import Floor, Thrown
from mechanism_sim.contact.compliant import (
    Flores,
    Hertz,
    HuntCrossley,
    LankaraniNikravesh,
    true_restitution,
)
from mechanism_sim.contact.film import ShortBearing
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.events import Mode

CLEARANCE = 'joints.coupler_rocker.clearance'
C = 2.54e-4


def compliant(law='hertz', stiffness=6.6e10, **more):
    overrides = {f'{CLEARANCE}.contact': {'law': law, 'stiffness': stiffness}}
    return ms.load_scene('four_bar_clearance', overrides | more)


def test_the_error_falls_with_the_stiffness_to_the_power_of_minus_two_thirds():
    """Following: the static depth is (F/K)^(2/3), and all that differs is in proportion to it."""
    t = np.linspace(0.05, 0.499, 300) * TURN
    rigid = ms.simulate(ms.load_scene('four_bar_clearance'), revolutions=0.5).sample(t)
    stiffness = 10.0 ** np.arange(8, 15)
    errors = []
    for K in stiffness:
        soft = ms.simulate(compliant(stiffness=float(K)), revolutions=0.5)
        away = soft.sample(t)['position.rocker'] - rigid['position.rocker']
        errors.append(np.abs(away).max())
        assert abs(soft.energy.residual) < 1e-9
    slopes = np.diff(np.log(errors)) / np.diff(np.log(stiffness))
    np.testing.assert_allclose(slopes, -2.0 / 3.0, atol=0.01)
    assert errors[-1] < 1e-8


def test_a_soft_bearing_moves_as_the_textbook_equations_integrated_by_scipy():
    """physics.md: moments of the coupler about A and of the rocker about O4, F = K depth^1.5."""
    K, SPEED, g = 1e9, 36.6519, 9.8145
    IA3, IO4 = 2.950e-3 + 0.2439 * 0.185**2, 3.176e-3 + 0.2334 * 0.134**2
    machine = compliant(stiffness=K, start='centred')
    solution = ms.simulate(machine, revolutions=0.15)
    state = machine.initial_state()

    def rate(t, y):
        th2, th3, th4 = SPEED * t, y[0], y[1]
        Q = 0.064 * np.exp(1j * th2) + 0.309 * np.exp(1j * th3) - 0.387 - 0.312 * np.exp(1j * th4)
        depth = max(abs(Q) - C, 0.0)
        F = -K * depth**1.5 * Q / abs(Q) if depth else 0j
        v3, v4 = 1j * np.exp(1j * th3), 1j * np.exp(1j * th4)
        a3 = 0.2439 * 0.185 * (0.064 * SPEED**2 * np.sin(th2 - th3) - g * np.cos(th3))
        a3 = (a3 + 0.309 * (v3.real * F.real + v3.imag * F.imag)) / IA3
        a4 = -0.2334 * 0.134 * g * np.cos(th4)
        a4 = (a4 - 0.312 * (v4.real * F.real + v4.imag * F.imag)) / IO4
        return [y[2], y[3], a3, a4]

    end = 0.15 * TURN
    start = [*state.q, *state.v]
    path = solve_ivp(rate, (0.0, end), start, 'DOP853', rtol=1e-11, atol=1e-13, max_step=1e-5)
    found = solution.sample(end)
    assert found['position.coupler'][0] == pytest.approx(path.y[0, -1], abs=1e-8)
    assert found['position.rocker'][0] == pytest.approx(path.y[1, -1], abs=1e-8)
    touches = [m for m in solution.modes if m.mode == Mode.FOLLOWING]
    assert len(touches) >= 4


@pytest.mark.parametrize('law', [Hertz, HuntCrossley, LankaraniNikravesh, Flores])
def test_a_body_rebounds_from_a_compliant_floor_as_the_closed_form_says(law):
    made = law(1e9) if law is Hertz else law(1e9, 0.6)
    ball = Thrown(
        [Floor('body', 0.6, law=made)], (0.0, 0.0, 0.01), (0.0, 0.0, -1.0), gravity=(0.0, 0.0)
    )
    ball.until(0.02)
    assert [m.mode for m in ball.modes] == [Mode.FREE_FLIGHT, Mode.FOLLOWING, Mode.FREE_FLIGHT]
    assert ball.at(0.02, 1)[2] == pytest.approx(true_restitution(made), abs=1e-9)
    assert abs(ball.audit.energy.residual) < 1e-11
    loss = 0.5 * (1.0 - true_restitution(made) ** 2)
    assert ball.audit.energy.dissipated == pytest.approx(loss, abs=1e-9)


@pytest.mark.parametrize('law', ['hertz', 'hunt_crossley', 'lankarani_nikravesh', 'flores'])
def test_books_and_snapshots_of_a_rattling_soft_bearing(law):
    machine = compliant(law, start='centred', **{f'{CLEARANCE}.friction': 0.1})
    solution = ms.simulate(machine, revolutions=1.0)
    assert abs(solution.energy.residual) < 1e-9
    assert solution.max_penetration < 1e-12
    assert 1e-7 < solution.max_closure_error < 2e-5  # how deep it was pressed
    first = machine.start()
    first.advance(0.04)
    second = machine.resume(machine.snapshot(first))
    for run in (first, second):
        run.advance(0.1)
    a, b = (run.drain()[0].curve for run in (first, second))
    np.testing.assert_array_equal(a.coefficients[-len(b) :], b.coefficients)


def test_the_stiffer_the_bearing_the_nearer_its_rebounds_to_rigid_ones():
    """Elastic: the first flights begin at the times of the rigid impacts."""
    rigid = ms.simulate(
        ms.load_scene('four_bar_clearance', {'start': 'centred', f'{CLEARANCE}.restitution': 1.0}),
        revolutions=0.05,
    )
    errors = []
    for K in (1e10, 1e12, 1e14):
        soft = ms.simulate(compliant(stiffness=K, start='centred'), revolutions=0.05)
        touch = [m.t for m in soft.modes if m.mode == Mode.FOLLOWING]
        errors.append(abs(touch[1] - rigid.impacts[1].t))
    order = np.polyfit(np.log([1e10, 1e12, 1e14]), np.log(errors), 1)[0]
    # an impact lasts in proportion to K^(-2/5)
    assert order == pytest.approx(-0.4, abs=0.03)


def test_level_refusals_and_command_line():
    assert compliant().level.value == 'compliant contact'
    two = {'joints.crank_coupler.clearance': {'radial': 1e-4, 'restitution': 0.5}}
    with pytest.raises(InputError, match='either all loose joints'):
        compliant(**two)
    with pytest.raises(InputError, match='Flores'):
        compliant('flores', **{f'{CLEARANCE}.restitution': 0.0})
    with pytest.raises(InputError, match='rigid contacts only'):
        compliant(**{f'{CLEARANCE}.friction': 'rough'})
    with pytest.raises(InputError, match="did you mean 'hertz'"):
        compliant('herz')
    found = run_json(
        'solve', 'four_bar_clearance', '--revolutions', '0.2',
        '--set', f'{CLEARANCE}.contact={{law: flores, stiffness: 6.6e10}}',
    )  # fmt: skip
    assert found['level'] == 'compliant contact'
    assert abs(found['energy']['residual']) < 1e-10


FILM = {'law': 'film', 'viscosity': 0.03, 'width': 0.02, 'radius': 0.01}


def test_a_film_carries_the_forces_of_the_ideal_mechanism():
    overrides = {f'{CLEARANCE}.contact': FILM, f'{CLEARANCE}.radial': 1e-4}
    solution = ms.simulate(ms.load_scene('four_bar_clearance', overrides), revolutions=0.6)
    assert abs(solution.energy.residual) < 1e-11
    assert solution.energy.dissipated > 1e-4
    ideal = ms.simulate(ms.load_scene('four_bar_nominal'), revolutions=0.6)
    t = np.linspace(0.2, 0.599, 60) * TURN
    mine, theirs = solution.sample(t), ideal.sample(t)
    for axis in 'xy':
        key = f'reaction.coupler_rocker.{axis}'
        assert np.abs(mine[key] - theirs[key]).max() < 0.02
    # the journal rides off its centre by less than the clearance, and not by nothing
    away = np.abs(mine['position.rocker'] - theirs['position.rocker']).max()
    assert 1e-6 < away < 1e-4 / 0.1


def test_a_film_moves_the_links_as_the_textbook_equations_integrated_by_scipy():
    SPEED, g = 36.6519, 9.8145
    IA3, IO4 = 2.950e-3 + 0.2439 * 0.185**2, 3.176e-3 + 0.2334 * 0.134**2
    names = hy.make_vars('x', 'y', 'vx', 'vy', 'journal', 'bushing')
    film = ShortBearing(0.03, 0.02, 0.01, 1e-4)
    compiled = hy.cfunc([*film.force(*names), *film.moments(*names)], vars=names)
    overrides = {f'{CLEARANCE}.contact': FILM, f'{CLEARANCE}.radial': 1e-4}
    machine = ms.load_scene('four_bar_clearance', overrides)
    state = machine.initial_state()

    def rate(t, y):
        th2, th3, th4, w3, w4 = SPEED * t, *y
        u2, u3, u4 = (np.exp(1j * th) for th in (th2, th3, th4))
        Q = 0.064 * u2 + 0.309 * u3 - 0.387 - 0.312 * u4
        V = 1j * (0.064 * SPEED * u2 + 0.309 * w3 * u3 - 0.312 * w4 * u4)
        fx, fy, on_pin, on_bushing = compiled([Q.real, Q.imag, V.real, V.imag, w3, w4])
        v3, v4 = 1j * u3, 1j * u4
        a3 = 0.2439 * 0.185 * (0.064 * SPEED**2 * np.sin(th2 - th3) - g * np.cos(th3))
        a3 += 0.309 * (v3.real * fx + v3.imag * fy) + on_pin
        a4 = -0.2334 * 0.134 * g * np.cos(th4)
        a4 += -0.312 * (v4.real * fx + v4.imag * fy) + on_bushing
        return [w3, w4, a3 / IA3, a4 / IO4]

    end = 0.02
    path = solve_ivp(rate, (0.0, end), [*state.q, *state.v], 'Radau', rtol=1e-9, atol=1e-11)
    found = ms.simulate(machine, duration=end).sample(end)
    assert found['position.coupler'][0] == pytest.approx(path.y[0, -1], abs=1e-8)
    assert found['position.rocker'][0] == pytest.approx(path.y[1, -1], abs=1e-8)


def test_a_film_needs_its_oil():
    with pytest.raises(InputError, match='viscosity'):
        compliant('film')
