"""Compliant contact as a level of scenes: the rigid model is its limit."""

from __future__ import annotations

import heyoka as hy
import numpy as np
import pytest
from builders import made
from compliant_impacts import impact_duration, true_restitution
from four_bars import TURN
from running import one_of, run_json
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import mechanism_sim as ms
from mechanism_sim.engine.contact.compliant import (
    Flores,
    Hertz,
    HuntCrossley,
    LankaraniNikravesh,
)
from mechanism_sim.engine.contact.film import JournalMotion, ShortBearing
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import InputError
from test.hard.bodies import GRAVITY, Floor, ThrownBody

CLEARANCE = 'joints.coupler_rocker.clearance'
C = 2.54e-4


def compliant(law='hertz', stiffness=6.6e10, **more):
    overrides = {f'{CLEARANCE}.contact': {'law': law, 'stiffness': stiffness}}
    return ms.load_scene('four_bar_clearance', overrides | more)


@pytest.mark.slow
def test_the_error_falls_with_the_stiffness_to_the_power_of_minus_two_thirds():
    """Following: the static depth is (F/K)^(2/3), and all that differs is in proportion to it."""
    t = np.linspace(0.05, 0.499, 300) * TURN
    rigid = ms.simulate(ms.load_scene('four_bar_clearance'), revolutions=0.5).sample(
        t, 'position.rocker'
    )
    stiffness = 10.0 ** np.arange(8, 15)
    errors = []
    for K in stiffness:
        soft = ms.simulate(compliant(stiffness=float(K)), revolutions=0.5)
        away = soft.sample(t, 'position.rocker')['position.rocker'] - rigid['position.rocker']
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
    found = solution.sample(end, 'position.coupler', 'position.rocker')
    assert found['position.coupler'][0] == pytest.approx(path.y[0, -1], abs=1e-8)
    assert found['position.rocker'][0] == pytest.approx(path.y[1, -1], abs=1e-8)
    touches = [m for m in solution.modes if m.mode == Mode.FOLLOWING]
    assert len(touches) >= 4


@pytest.mark.parametrize('law', [Hertz, HuntCrossley, LankaraniNikravesh, Flores])
def test_a_body_rebounds_from_a_compliant_floor_as_the_closed_form_says(law):
    made = law(1e9) if law is Hertz else law(1e9, 0.6)
    ball = ThrownBody(
        [Floor('body', 0.6, law=made)], (0.0, 0.0, 0.01), (0.0, 0.0, -1.0), gravity=(0.0, 0.0)
    )
    ball.until(0.02)
    assert [m.mode for m in ball.modes] == [Mode.FREE_FLIGHT, Mode.FOLLOWING, Mode.FREE_FLIGHT]
    assert ball.at(0.02, 1)[2] == pytest.approx(true_restitution(made), abs=1e-9)
    assert abs(ball.audit.energy.residual) < 1e-11
    loss = 0.5 * (1.0 - true_restitution(made) ** 2)
    assert ball.audit.energy.dissipated == pytest.approx(loss, abs=1e-9)


def test_a_disc_that_strikes_a_compliant_floor_slides_until_it_rolls():
    """The impulse that stops its slip is spent when it is deepest."""
    law, mu, r = Hertz(1e9), 0.3, 0.5
    disc = ThrownBody(
        [Floor('body', 0.6, mu, r, law=law)],
        (0.0, 0.0, r + 0.01),
        (0.0, 3.0 * mu, -1.0),
        gravity=(0.0, 0.0),
        inertia=0.5 * r * r,
    )
    disc.until(0.02)
    # where the force is next to nothing, so is what holds the disc: that counts as one instant
    (touch, _), (rolls, mode), *_, (leaves, last) = ((m.t, m.mode) for m in disc.modes[1:])
    assert (mode, last) == (Mode.STICKING, Mode.FREE_FLIGHT)
    assert all(abs(m.t - leaves) < 1e-10 for m in disc.modes[3:])
    duration = impact_duration(law, 1.0, 1.0)
    assert rolls - touch == pytest.approx(0.5 * duration, rel=1e-9)
    assert leaves - touch == pytest.approx(duration, rel=1e-9)
    assert disc.at(0.02, 1) == pytest.approx([-2.0 * mu / r, 2.0 * mu, 1.0], abs=1e-10)
    assert disc.audit.energy.dissipated == pytest.approx(1.5 * mu**2, abs=1e-11)


def test_a_block_that_bounces_in_its_contact_slides_down_only_while_it_is_light():
    """On a slope below the angle of friction, pressed by ``N = N0 (1 - 0.9 cos wt)``."""
    K, mu, slope = 1e6, 0.5, 0.3
    down, press = GRAVITY * np.sin(slope), GRAVITY * np.cos(slope)
    w, depth = np.sqrt(K), press / K
    block = ThrownBody(
        [Floor('body', 1.0, mu, law=Hertz(K, 1.0))],
        (0.0, 0.0, -0.1 * depth),
        (0.0, 0.0, 0.0),
        gravity=(down, -press),
        closed=True,
        longest=1e-3,
    )
    block.until(0.05)

    def speed(t, since):
        free = (down - mu * press) * (t - since)
        return free + 0.9 * mu * press * (np.sin(w * t) - np.sin(w * since)) / w

    expected, since, x = [], 0.0, 0.0
    light = np.arccos((1.0 - down / (mu * press)) / 0.9) / w  # until then it is, about each turn
    for k in range(1, 8):
        centre = 2.0 * np.pi * (k - 1) / w
        stops = brentq(speed, centre + light, centre + 2.0 * np.pi / w, (since,), xtol=1e-16)
        x += quad(speed, since, stops, (since,), epsabs=1e-16)[0]
        since = 2.0 * np.pi * k / w - light
        expected += [stops, since]
    found = [m.t for m in block.modes if 0.0 < m.t <= expected[-1] + 1e-9]
    np.testing.assert_allclose(found, expected, atol=1e-10)
    assert block.at(0.5 * (expected[-2] + expected[-1]), 0)[1] == pytest.approx(x, abs=1e-13)
    assert abs(block.audit.energy.residual) < 1e-12


def test_a_contact_that_parts_faster_than_it_presses_at_the_start_carries_no_force():
    """Seated, the pin leaves at the rate of the links' rates: it had been pressed into nowhere."""
    ball = ThrownBody(
        [Floor('body', 0.5, law=HuntCrossley(1e9, 0.5))],
        (0.0, 0.0, -1e-7),
        (0.0, 0.0, 1.0),
        gravity=(0.0, -GRAVITY),
        closed=True,
    )
    ball.until(0.05)
    assert [m.mode for m in ball.modes] == [Mode.RECOVERING, Mode.FREE_FLIGHT]
    flight = 0.05
    assert ball.at(flight, 0)[2] == pytest.approx(
        -1e-7 + flight - 0.5 * GRAVITY * flight**2, abs=1e-15
    )


def thesis_contact(machine, K, a, end):
    """Events of the textbook equations with ``max(0, K d^1.5 (1 + a d'/v0))``, by DOP853.

    v0 is the speed of the touch. The instants at which the pin touches, stops to press, presses
    again and is free of the bushing, and the rotations then.
    """
    SPEED, g = 36.6519, 9.8145
    IA3, IO4 = 2.950e-3 + 0.2439 * 0.185**2, 3.176e-3 + 0.2334 * 0.134**2

    def contact(t, y):
        u2, u3, u4 = (np.exp(1j * x) for x in (SPEED * t, y[0], y[1]))
        Q = 0.064 * u2 + 0.309 * u3 - 0.387 - 0.312 * u4
        V = 1j * (0.064 * SPEED * u2 + 0.309 * y[2] * u3 - 0.312 * y[3] * u4)
        return Q / abs(Q), abs(Q) - C, (Q.conjugate() * V).real / abs(Q)

    def rate(t, y, v0, presses):
        n, depth, closing = contact(t, y)
        F = -n * K * max(depth, 0.0) ** 1.5 * (1.0 + a * closing / v0) if presses else 0j
        v3, v4 = 1j * np.exp(1j * y[0]), 1j * np.exp(1j * y[1])
        a3 = 0.2439 * 0.185 * (0.064 * SPEED**2 * np.sin(SPEED * t - y[0]) - g * np.cos(y[0]))
        a3 = (a3 + 0.309 * (v3.real * F.real + v3.imag * F.imag)) / IA3
        a4 = -0.2334 * 0.134 * g * np.cos(y[1])
        a4 = (a4 - 0.312 * (v4.real * F.real + v4.imag * F.imag)) / IO4
        return [y[2], y[3], a3, a4]

    def crossing(function, direction):
        function.terminal, function.direction = True, direction
        return function

    t, v0, mode, events = 0.0, 1.0, Mode.FREE_FLIGHT, []
    y = np.array([*machine.initial_state().q, *machine.initial_state().v])
    how = {'method': 'DOP853', 'rtol': 1e-12, 'atol': 1e-15, 'max_step': 1e-4}
    while True:
        outside = crossing(
            lambda t, y, *_: contact(t, y)[1], 1.0 if mode == Mode.FREE_FLIGHT else -1.0
        )
        relief = crossing(
            lambda t, y, v0, _: 1.0 + a * contact(t, y)[2] / v0,
            -1.0 if mode == Mode.FOLLOWING else 1.0,
        )
        watched = [outside] if mode == Mode.FREE_FLIGHT else [outside, relief]
        args = (v0, mode == Mode.FOLLOWING)
        path = solve_ivp(rate, (t, end), y, events=watched, args=args, **how)
        if path.status != 1:
            return events
        t, y = path.t[-1], path.y[:, -1]
        if mode == Mode.FREE_FLIGHT:
            v0, mode = contact(t, y)[2], Mode.FOLLOWING
        elif len(path.t_events[0]):
            mode = Mode.FREE_FLIGHT
        else:
            mode = Mode.RECOVERING if mode == Mode.FOLLOWING else Mode.FOLLOWING
        events.append((t, mode))
        # beyond the event, lest it is found again
        args = (v0, mode == Mode.FOLLOWING)
        path = solve_ivp(rate, (t, t + 1e-9), y, args=args, **how)
        t, y = path.t[-1], path.y[:, -1]


@pytest.mark.slow
def test_contact_ends_where_the_force_falls_through_zero_as_integrated_by_scipy():
    """A Flores contact of e = 0.5: damped so much that the bodies part faster than it recovers."""
    machine = compliant('flores', 1e9, start='centred', **{f'{CLEARANCE}.restitution': 0.5})
    solution = ms.simulate(machine, revolutions=1.1)
    found = [(m.t, m.mode) for m in solution.modes[1:]]
    expected = thesis_contact(machine, 1e9, 1.6, 1.1 * TURN)
    assert [mode for _, mode in found] == [mode for _, mode in expected]
    assert sum(mode == Mode.RECOVERING for _, mode in expected) == 1
    np.testing.assert_allclose([t for t, _ in found], [t for t, _ in expected], atol=1e-9)
    assert abs(solution.energy.residual) < 1e-10


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('law', 'stiffness', 'e', 'start'),
    [
        ('hunt_crossley', 1e8, 0.5, 'seated'),
        ('hunt_crossley', 1e8, 0.5, 'centred'),
        ('flores', 1e9, 0.2, 'seated'),
        ('lankarani_nikravesh', 1e8, 0.3, 'centred'),
    ],
)
def test_no_long_contact_pulls(law, stiffness, e, start):
    machine = compliant(law, stiffness, start=start, **{f'{CLEARANCE}.restitution': e})
    solution = ms.simulate(machine, revolutions=6.0)
    force = solution.sample(
        np.linspace(0.0, solution.duration, 20000), 'normal_force.coupler_rocker'
    )
    assert force['normal_force.coupler_rocker'].min() > -1e-9
    assert abs(solution.energy.residual) < 1e-9
    assert solution.max_penetration < 1e-12


def test_a_contact_loaded_from_rest_is_damped_like_an_impact_of_the_speed_its_load_makes():
    """About the resting depth the damping ratio is ``a sqrt((n + 1)/8)/n``."""
    law = HuntCrossley(1e8, 0.8)
    depth = law.resting_depth(9.81)
    ball = ThrownBody(
        [Floor('body', 0.8, law=law)], (0.0, 0.0, -1.001 * depth), (0.0, 0.0, 0.0), closed=True
    )
    ball.until(0.05)
    omega = np.sqrt(1.5 * 9.81 / depth)
    ratio = law.damping * np.sqrt(2.5 / 8.0) / 1.5
    period = 2.0 * np.pi / (omega * np.sqrt(1.0 - ratio**2))
    away = [ball.at(k * period)[2] + depth for k in (0, 1)]
    assert away[1] / away[0] == pytest.approx(np.exp(-ratio * omega * period), rel=2e-3)
    assert not ball.impacts  # what the start presses is no touch


@pytest.mark.parametrize('made', [Hertz(1e9), HuntCrossley(1e9, 0.6), Flores(1e9, 0.3)])
def test_a_touch_is_recorded_as_the_free_impact_that_it_is(made):
    def thrown():
        return ThrownBody(
            [Floor('body', 0.6, law=made)], (0.0, 0.0, 0.01), (0.0, 0.0, -1.0), gravity=(0.0, 0.0)
        )

    (touch,) = thrown().until(0.02).impacts
    assert touch.approach_speed == pytest.approx(1.0, abs=1e-12)
    assert touch.rebound_speed == pytest.approx(true_restitution(made), abs=1e-9)
    assert touch.normal_impulse == pytest.approx(1.0 + true_restitution(made), abs=1e-9)
    assert touch.energy_loss == pytest.approx(0.5 * (1.0 - true_restitution(made) ** 2), abs=1e-9)
    assert touch.t - touch.duration == pytest.approx(0.01, abs=1e-12)
    assert touch.drive_impulse == touch.drive_work == touch.sudden_loss == 0.0

    def rate(_, y):
        return [y[1], made.normal_force(max(y[0], 0.0), y[1], 1.0) * -1.0]

    def over(_, y):
        return y[0]

    def hardest(_, y):
        force = made.stiffness * max(y[0], 0.0) ** 1.5
        slope = 1.5 * y[1] * (1.0 + made.damping * y[1])
        return slope + made.damping * -force * (1.0 + made.damping * y[1]) * y[0]

    over.terminal, over.direction, hardest.direction = True, -1.0, -1.0
    path = solve_ivp(
        rate, (0.0, 1.0), [1e-14, 1.0], 'DOP853', events=[over, hardest], rtol=1e-12, atol=1e-16
    )  # fmt: skip
    assert touch.duration == pytest.approx(path.t[-1], rel=1e-9)
    peak = made.normal_force(*path.y_events[1][0], 1.0)
    assert touch.peak_force == pytest.approx(peak, rel=1e-9)
    # however the run is cut, on the way and with a snapshot amid the touch
    cut = thrown()
    for t in np.linspace(0.0101, 0.011, 7):
        cut.until(float(t))
    (again,) = cut.until(0.02).impacts
    numbers = [[x for x in i if not isinstance(x, str)] for i in (again, touch)]
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-8)


@pytest.mark.slow
def test_touches_of_a_machine_add_up_to_what_was_lost_and_survive_a_snapshot():
    machine = compliant('hunt_crossley', 1e9, start='centred', **{f'{CLEARANCE}.friction': 0.1})
    solution = ms.simulate(machine, revolutions=1.0)
    last = solution.modes[-1]
    assert last.mode != Mode.FREE_FLIGHT or len(solution.impacts) > 3
    touched = [m.t for m in solution.modes if m.previous == Mode.FREE_FLIGHT]
    np.testing.assert_allclose(
        [i.t - i.duration for i in solution.impacts], touched[: len(solution.impacts)], atol=1e-15
    )
    lost = solution.sample([i.t for i in solution.impacts], 'energy.dissipated')[
        'energy.dissipated'
    ]
    sums = np.cumsum([i.energy_loss for i in solution.impacts])
    np.testing.assert_allclose(sums, lost, atol=1e-12)
    force = solution.sample(
        np.linspace(0.0, solution.impacts[0].t, 200001), 'normal_force.coupler_rocker'
    )
    sampled = force['normal_force.coupler_rocker'].max()
    assert 0.0 <= solution.impacts[0].peak_force - sampled < 1e-5 * sampled
    whole, first = machine.start(), machine.start()
    middle = solution.impacts[1].t - 0.5 * solution.impacts[1].duration
    whole.advance(0.1)
    first.advance(middle)
    before = first.drain()[1]
    first.advance(0.5 * (middle + solution.impacts[1].t))
    second = machine.resume(machine.snapshot(first))
    second.advance(0.1)
    assert before + second.drain()[1] == whole.drain()[1]


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    'law', one_of(3, ['hertz', 'hunt_crossley', 'lankarani_nikravesh', 'flores'])
)
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_film_carries_the_forces_of_the_ideal_mechanism():
    overrides = {f'{CLEARANCE}.contact': FILM, f'{CLEARANCE}.radial': 1e-4}
    solution = ms.simulate(ms.load_scene('four_bar_clearance', overrides), revolutions=0.6)
    assert abs(solution.energy.residual) < 1e-10
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
    motion = JournalMotion(*names)
    compiled = hy.cfunc([*film.force(motion), *film.moments(motion)], names, opt_level=0)
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
    found = ms.simulate(machine, duration=end).sample(end, 'position.coupler', 'position.rocker')
    assert found['position.coupler'][0] == pytest.approx(path.y[0, -1], abs=1e-8)
    assert found['position.rocker'][0] == pytest.approx(path.y[1, -1], abs=1e-8)


def test_a_film_needs_its_oil():
    with pytest.raises(InputError, match='viscosity'):
        compliant('film')


def test_a_brake_beside_a_compliant_pin_loses_what_its_torque_says():
    """Its rate passes zero, where it may hold: what it asks for then must be found in no time."""
    brake = 0.1
    content = {
        'mechanism': 'linkage',
        'links': {
            'crank': {'length': 0.064, 'mass': 0.6, 'inertia': 0.0026},
            'bob': {'length': 0.1, 'mass': 0.5, 'inertia': 5e-4, 'cog': 0.05},
        },
        'joints': {
            'bearing': {'revolute': ['ground', 'crank']},
            'pin': {
                'revolute': ['crank.end', 'bob'],
                'clearance': {
                    'radial': 1e-4, 'restitution': 1.0,
                    'contact': {'law': 'hertz', 'stiffness': 2e7},
                },
            },
        },
        'gravity': [0.0, -9.81],
        'drive': {'coordinate': 'crank', 'speed': 5.0},
        'loads': {'brake': {'at': 'bob', 'torque': f'-{brake}*sign(bob_rate)'}},
    }  # fmt: skip
    run = ms.simulate(made(content), duration=0.4)
    t = np.linspace(0.0, 0.4, 40001)
    turned = run.sample(t, 'position.bob')['position.bob']
    assert (np.diff(np.sign(np.diff(turned))) != 0).any()
    assert run.energy.dissipated == pytest.approx(brake * np.abs(np.diff(turned)).sum(), rel=1e-6)
    assert run.energy.share < 1e-9
