"""The event loop: nothing missed, nothing held that should let go, nothing owed to its callers."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from four_bars import (
    LINKS,
    RADIAL,
    SPEED,
    TURN,
    as_bytes,
    audited,
    constant_speed,
    event_loop,
    loose,
    with_pin_at,
)
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf
from scipy.integrate import DOP853
from scipy.optimize import brentq

import mechanism_sim as ms
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.events import Mode
from mechanism_sim.engine.observer import Observer
from mechanism_sim.engine.physics import DynamicPhysics
from mechanism_sim.engine.singular import SingularPositions
from mechanism_sim.engine.snapshot import State
from mechanism_sim.engine.system import System
from mechanism_sim.errors import RunError
from mechanism_sim.joints.revolute.bearing import BearingClearance
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.frames import lift
from mechanism_sim.planar.mechanism import Mechanism, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.units import SMALLEST

C = 2.54e-4  # [m] radial clearance


def finish(run, until):
    run.advance(until, final=True)
    return run.drain()


def gaps(machine, motion, t):
    """The true gap c - |Q| [m] at times t, from the positions alone."""
    q = motion.curve(np.atleast_1d(t)).T
    Q = 0.064 * np.exp(1j * q[0]) + 0.309 * np.exp(1j * q[1]) - 0.387 - 0.312 * np.exp(1j * q[2])
    return machine.plan.clearances['coupler_rocker'].radial - np.abs(Q)


# --- who asks, and how, does not matter -------------------------------------------------------


def test_a_run_repeats_itself_to_the_last_bit():
    first, second = (finish(loose(1.0).start(), TURN) for _ in range(2))
    assert as_bytes(first[0]) == as_bytes(second[0])
    assert first[1:] == second[1:]


@pytest.mark.parametrize(('start', 'e'), [('centred', 1.0), ('centred', 0.5), ('seated', 0.5)])
def test_motion_does_not_depend_on_how_it_is_asked_for(start, e):
    whole = finish(loose(e, start).start(), 1.3 * TURN)
    run, parts = loose(e, start).start(), []
    rng, t = np.random.default_rng(3), 0.0
    while t < 1.3 * TURN:
        t = min(t + rng.choice([1e-9, 1e-5, 1e-3, 2e-2]), 1.3 * TURN)
        run.advance(t, final=t == 1.3 * TURN, most=rng.choice([1, 3, None]))
        if rng.random() < 0.5:
            parts.append(run.drain())
    run.advance(1.3 * TURN, final=True)
    parts.append(run.drain())
    assert as_bytes(type(whole[0]).joined([p[0] for p in parts])) == as_bytes(whole[0])
    assert [i for p in parts for i in p[1]] == whole[1]
    assert [m for p in parts for m in p[2]] == whole[2]


def test_where_a_run_is_cut_does_not_change_what_came_before():
    long, short = (finish(loose(1.0).start(), x * TURN)[0].curve for x in (0.6, 0.31))
    n = len(short) - 1
    np.testing.assert_array_equal(short.start, long.start[: n + 1])
    np.testing.assert_array_equal(short.coefficients, long.coefficients[: n + 1])
    np.testing.assert_array_equal(short.duration[:n], long.duration[:n])
    assert short.duration[n] < long.duration[n]
    assert short.end == pytest.approx(0.31 * TURN, rel=1e-16)


@pytest.mark.parametrize('end', [0.1 * TURN, 0.17142, 1.0 * TURN, 3.3 * TURN, 0.9999 * TURN])
def test_a_run_ends_at_the_very_time_asked_for(end):
    run = loose(rtol=1e-6).start()
    run.advance(end, final=True)
    assert run.time == end
    motion, _, _ = run.drain()
    assert motion.curve.end == pytest.approx(end, rel=2e-16)
    c = motion.curve
    ends = c.start[:-1] + (c.start_low[:-1] + c.duration[:-1])
    assert np.abs(ends - c.start[1:]).max() <= np.spacing(end)


def test_segments_join_without_a_jump_except_at_impacts():
    motion, impacts, _ = finish(loose(0.5, 'seated').start(), 1.3 * TURN)
    c, k = motion.curve, np.arange(len(motion) - 1)
    jump = np.abs(c.at(k + 1, np.zeros(len(k))) - c.at(k, c.duration[:-1]))
    assert jump.max() < 1e-14
    kick = np.abs(c.at(k + 1, np.zeros(len(k)), 1) - c.at(k, c.duration[:-1], 1))
    struck = np.isin(c.start[1:], [i.t for i in impacts])
    assert struck.sum() == len(impacts) > 20
    assert kick[~struck].max() < 1e-11
    assert kick[struck].max() > 1e-3


# --- laws of the drive ------------------------------------------------------------------------


def changed_law(announce, until=0.2):
    """A run whose crank runs by another law with the same motion from 0.07 s on."""
    run = loose(0.5, 'seated').start()
    t = 0.07
    law = DriveLaw('crank', (SPEED * t, SPEED), t, t)
    if announce == 'at once':
        run.change_law(law)
    elif announce == 'late':
        run.advance(0.9 * t)
        run.change_law(law)
    elif announce == 'last':
        while run.time < t:
            run.advance(t, most=1)
            if run._pending is not None:
                break
        run.change_law(law)
    else:
        for x in np.linspace(0.0, 0.99 * t, 23):
            run.advance(x, most=2)
            run.drain() if announce == 'never' else None
        run.change_law(law)
    return finish(run, until)


@pytest.mark.parametrize('announce', ['late', 'last', 'in pieces'])
def test_when_a_law_is_announced_does_not_matter(announce):
    known, other = changed_law('at once'), changed_law(announce)
    assert as_bytes(known[0]) == as_bytes(other[0])
    assert known[1:] == other[1:]


def test_a_law_that_changes_nothing_changes_nothing():
    changed = changed_law('at once')
    plain = finish(loose(0.5, 'seated').start(), 0.2)
    t = np.linspace(0.0, 0.2, 300)
    assert np.abs(changed[0].curve(t) - plain[0].curve(t)).max() < 1e-12
    assert len(changed[1]) == len(plain[1])
    for a, b in zip(changed[1], plain[1], strict=True):
        assert a.t == pytest.approx(b.t, abs=1e-10)
    assert [m.mode for m in changed[2]] == [m.mode for m in plain[2]]


def test_a_law_for_the_past_is_refused():
    run = loose().start()
    run.advance(0.05)
    with pytest.raises(ValueError, match=r'valid from 0.03 s comes too late.*known up to 0\.0'):
        run.change_law(constant_speed(0.0, SPEED, 0.03))


def test_a_law_of_higher_degree_than_compiled_for_is_refused():
    run = loose().start()
    with pytest.raises(ValueError, match='degree 2 needs equations compiled for it'):
        run.change_law(DriveLaw('crank', (0.0, SPEED, 3.0), 0.1, 0.1))


def test_laws_hold_in_the_order_of_their_times():
    t1, t2 = 0.03, 0.06
    laws = [
        DriveLaw('crank', (SPEED * t1, SPEED, 100.0), t1, t1),
        DriveLaw(
            'crank', (SPEED * t2 + 100.0 * (t2 - t1) ** 2, SPEED + 200.0 * (t2 - t1)), t2, t2
        ),
    ]
    motions = []
    for order in (laws, laws[::-1]):
        run, _ = event_loop(loose(0.5, 'seated'), degree=2)
        for law in order:
            run.change_law(law)
        motions.append(finish(run, 0.1)[0])
    assert as_bytes(motions[0]) == as_bytes(motions[1])
    speed = motions[0].curve(np.array([0.02, 0.045, 0.09]), 1)[:, 0]
    np.testing.assert_allclose(speed, [SPEED, SPEED + 3.0, SPEED + 6.0], rtol=1e-14)


def test_a_law_that_jumps_in_speed_is_refused_when_it_takes_over():
    run, _ = event_loop(loose(0.5, 'seated'), degree=2)
    run.change_law(DriveLaw('crank', (SPEED * 0.03, SPEED + 5.0), 0.03, 0.03))
    with pytest.raises(RunError, match=r'valid from 0.03 s jumps in angle or speed'):
        run.advance(0.1)
    assert run.time == pytest.approx(0.03, abs=1e-3)


def test_a_jump_is_refused_of_an_ideal_linkage_too():
    """Whose motion follows from its drives alone: its laws are those of any run."""
    run = ms.load_scene('slider_crank').start()
    run.change_law(DriveLaw('crank', (0.5, 20.0), 0.03, 0.03))
    with pytest.raises(RunError, match=r'valid from 0.03 s jumps in angle or speed'):
        run.advance(0.1, final=True)


def test_a_ramp_of_the_drive_keeps_its_books():
    """Law of degree 2 from 0.03 s to 0.05 s between two constant speeds."""
    t1, t2, a = 0.03, 0.05, 400.0
    run, physics = event_loop(loose(0.5, 'seated'), degree=2)
    th, w = SPEED * t2 + 0.5 * a * (t2 - t1) ** 2, SPEED + a * (t2 - t1)
    run.change_law(DriveLaw('crank', (SPEED * t1, SPEED, 0.5 * a), t1, t1))
    run.change_law(DriveLaw('crank', (th, w), t2, t2))
    motion, impacts, _ = finish(run, 0.2)
    audit = audited(physics, motion, impacts)
    assert len(impacts) > 20
    assert audit.energy.drive_work > 0.3
    assert abs(audit.energy.residual) < 1e-12
    end = motion.curve(np.array([0.2]))[0, 0]
    assert end == pytest.approx(th + w * (0.2 - t2), rel=1e-15)


def test_an_accelerated_crank_against_scipy():
    """Flight and impacts under a law of degree 3: DOP853, bisection, the book's equations."""
    law, e, until = (0.2, 20.0, 300.0, -2000.0), 0.8, 0.05
    machine = loose(e, drive__start_angle=0.2, drive__speed=20.0)
    run, _ = event_loop(machine, [DriveLaw('crank', law)])
    _, impacts, _ = finish(run, until)
    m3, S3, IA3, m4S4, IO4 = 0.2439, 0.185, 2.950e-3 + 0.2439 * 0.185**2, 0.2334 * 0.134, 0.0
    IO4 = 3.176e-3 + m4S4 * 0.134
    crank = np.polynomial.Polynomial(law)

    def fall(t, y):
        th2, w2, a2 = crank(t), crank.deriv()(t), crank.deriv(2)(t)
        a3 = m3 * S3 * (
            0.064 * (w2**2 * np.sin(th2 - y[0]) - a2 * np.cos(th2 - y[0])) - 9.8145 * np.cos(y[0])
        ) / IA3  # fmt: skip
        return np.array([y[2], y[3], a3, -m4S4 * 9.8145 * np.cos(y[1]) / IO4])

    def pin(t, y):
        u = np.exp(1j * np.array([crank(t), y[0], y[1]]))
        return 0.064 * u[0] + 0.309 * u[1] - 0.387 - 0.312 * u[2], u

    state, t, times = np.array([*machine.initial_state().q, *machine.initial_state().v]), 0.0, []
    while len(times) < 12:
        solver = DOP853(fall, t, state, 1.0, rtol=1e-13, atol=1e-15, max_step=4e-4)
        while True:
            solver.step()
            dense = solver.dense_output()
            if C - abs(pin(solver.t, solver.y)[0]) < 0.0:
                break
        low = max(solver.t_old, t + 1e-9)
        t = brentq(lambda x: C - abs(pin(x, dense(x))[0]), low, solver.t, xtol=1e-16)  # noqa: B023
        back = DOP853(fall, solver.t_old, dense.y_old, t, rtol=1e-13, atol=1e-15)
        while back.status == 'running':
            back.step()
        state = back.y
        Q, u = pin(t, state)
        n = Q / abs(Q)
        rate = 1j * (0.064 * crank.deriv()(t) * u[0] + 0.309 * state[2] * u[1]
                     - 0.312 * state[3] * u[2])  # fmt: skip
        k3 = 0.309 * (n.conj() * 1j * u[1]).real
        k4 = 0.312 * (n.conj() * 1j * u[2]).real
        p = (1.0 + e) * (n.conj() * rate).real / (k3**2 / IA3 + k4**2 / IO4)
        state = state + np.array([0.0, 0.0, -p * k3 / IA3, p * k4 / IO4])
        times.append((t, p))
    for (t, p), impact in zip(times, impacts, strict=False):
        assert impact.t == pytest.approx(t, abs=1e-11)
        assert impact.normal_impulse == pytest.approx(p, rel=1e-7)
    assert len(impacts) >= 12


# --- heyoka's traps: guards that start at zero, double roots, ends of steps ---------------------


class Floor:
    """A floor at height zero under the tip of an arm 1 m long: a ball, to all purposes."""

    name = 'floor'
    friction = 0.0
    hypothesis = 'newton'
    law = None

    def __init__(self, restitution):
        self.restitution = restitution

    def value(self, frames):
        return frames.position({('arm', None): (1.0, 0.0)}, 'tip')[1]

    def normal(self, _):
        return lift(0.0), lift(-1.0)

    def distance(self, value):
        return value


def arm_over_floor(e, angle, rate, gravity=9.81, longest=0.1):
    """An arm of 1 kg m^2 about its pivot whose tip strikes the floor at angle zero."""
    o = (0.0, 0.0)
    m = Mechanism(
        (Body('arm', 1.0, 0.75, (0.5, 0.0)),), (Revolute('pivot', GROUND, 'arm', o, o),), (),
        (0.0, -gravity),
    )  # fmt: skip
    state = State(Fraction(0), (0,), (angle,), (rate,), (False,))
    return EventLoop(System(m, [Floor(e)], (), 1), (), state, 1e-12, 0.0, longest)


def time_of_flight(rate, gravity=9.81):
    """From the floor up and back, by quadrature over the angle: w^2 = rate^2 - g sin(angle)."""
    top = np.arcsin(rate**2 / gravity)
    x, w = np.polynomial.legendre.leggauss(60)
    u = 0.5 * (x + 1.0)  # angle = top (1 - u^2) takes the root out of the integrand
    speed = np.sqrt(gravity * (np.sin(top) - np.sin(top * (1.0 - u**2))))
    return float(2.0 * (0.5 * w) @ (2.0 * top * u / speed))


@pytest.mark.parametrize('angle', [0.0, 1e-300, -1e-17])
@pytest.mark.parametrize('rate', [0.02, 1.0])
def test_a_ball_thrown_up_from_exact_zero_comes_back_to_the_floor(angle, rate):
    """A guard that starts at exact zero must still fire."""
    run = arm_over_floor(1.0, angle, rate)
    flight = time_of_flight(rate)
    motion, impacts, _ = finish(run, 20.5 * flight)
    assert len(impacts) == 20
    times = flight * np.arange(1, 21)
    np.testing.assert_allclose([i.t for i in impacts], times, rtol=1e-11)
    np.testing.assert_allclose([i.rebound_speed for i in impacts], rate, rtol=1e-11)
    assert motion.curve(np.linspace(0.0, 20.5 * flight, 5000)).min() > -1e-14


def test_a_ball_at_rest_on_the_floor_stays_and_one_thrown_down_bounces():
    _, impacts, modes = finish(arm_over_floor(0.5, 0.0, 0.0), 1.0)
    assert modes[-1].mode is Mode.FOLLOWING
    assert not impacts
    _, impacts, _ = finish(arm_over_floor(1.0, 0.0, -0.3), 1.0)
    assert impacts[0].t == 0.0
    assert impacts[0].rebound_speed == 0.3


def test_a_ball_that_rises_less_than_rounding_rests():
    """Rates of 1e-18 m/s are what is left of a difference; nobody waits for such a flight."""
    _, impacts, modes = finish(arm_over_floor(0.5, 0.0, 1e-18), 1.0)
    assert not impacts
    assert (modes[-1].mode, modes[-1].t) == (Mode.FOLLOWING, 0.0)


def test_a_ball_on_a_floor_without_gravity_flies_off_or_floats():
    _, impacts, modes = finish(arm_over_floor(0.5, 0.0, 0.0, gravity=-9.81), 0.1)
    assert modes[-1].mode is Mode.FREE_FLIGHT
    assert not impacts
    motion, impacts, _ = finish(arm_over_floor(0.5, 0.0, 0.0, gravity=0.0), 0.1)
    assert not impacts
    assert abs(motion.curve(np.array([0.1]))[0, 0]) < 1e-14


def test_a_ball_loses_its_bounces_in_a_geometric_series():
    """Restitution e: flights shrink by e, and their sum ends chatter at 2 v/a e/(1 - e)."""
    e, rate = 0.5, 0.02
    _, impacts, modes = finish(arm_over_floor(e, 0.0, -rate), 0.1)
    a = 0.5 * 9.81  # of the tip, for small angles
    limit = 2.0 * rate / a * e / (1.0 - e)
    assert modes[-1].mode is Mode.FOLLOWING
    assert modes[-1].t == pytest.approx(limit, rel=1e-3)
    speeds = np.array([i.approach_speed for i in impacts])
    np.testing.assert_allclose(speeds[1:] / speeds[:-1], e, rtol=1e-6)
    assert 10 <= len(impacts) <= 20


@pytest.mark.parametrize('e', [0.9, 0.99])
@pytest.mark.parametrize('longest', [0.1, 1e-4])
def test_bounces_far_shorter_than_a_step_are_not_lost(e, longest, monkeypatch):
    """Flights of 1e-7 s where a Taylor step may take 0.1 s: the root lies next to its start.

    None is lost even at first: the step after a bounce is not much longer than the flight.
    """
    monkeypatch.delattr(SingularPositions, 'return_to')
    run = arm_over_floor(e, 0.0, -0.001, longest=longest)
    motion, impacts, modes = finish(run, 0.05)
    limit = 2.0 * 0.001 / (0.5 * 9.81) * e / (1.0 - e)
    assert modes[-1].mode is Mode.FOLLOWING
    assert modes[-1].t == pytest.approx(limit, rel=2e-3)
    assert motion.curve(np.linspace(0.0, 0.05, 9001)).min() > -1e-14
    speeds = np.array([i.approach_speed for i in impacts])
    np.testing.assert_allclose(speeds[1:] / speeds[:-1], e, rtol=1e-5)


def test_a_thousand_bounces_do_not_tunnel():
    flight = time_of_flight(0.2)
    motion, impacts, _ = finish(arm_over_floor(1.0, 0.0, 0.2), 1000.5 * flight)
    assert len(impacts) == 1000
    assert impacts[-1].rebound_speed == pytest.approx(0.2, rel=1e-11)
    assert impacts[-1].t == pytest.approx(1000.0 * flight, rel=1e-11)
    assert len(motion) < 3000


def base_with_rates(machine, turning):
    """The machine with rates added to those it starts with."""
    given = machine.scene.initial.velocity
    velocity = {
        name: given[name]._replace(value=given[name].value + more)
        for name, more in zip(('coupler', 'rocker'), turning, strict=True)
    }
    initial = machine.scene.initial.model_copy(update={'velocity': velocity})
    return type(machine)(machine.name, machine.scene.model_copy(update={'initial': initial}))


@pytest.mark.parametrize('outside', [0.0, 1e-11, 1e-7])
def test_a_pin_that_starts_on_the_bushing_and_moves_outwards_strikes_at_once(outside):
    eta = 1.0
    n = np.array([np.cos(eta), np.sin(eta)])
    machine = with_pin_at(loose(0.5), (1.0 + outside) * C * n)
    q = machine.initial_state().q
    k3, k4 = 0.309 * n @ [-np.sin(q[0]), np.cos(q[0])], 0.312 * n @ [-np.sin(q[1]), np.cos(q[1])]
    machine = base_with_rates(machine, np.array([k3, -k4]) / (k3**2 + k4**2) * 0.2)
    motion, impacts, _ = finish(machine.start(), 0.02)
    assert impacts[0].t == 0.0
    assert impacts[0].approach_speed == pytest.approx(0.2, rel=1e-5)
    assert impacts[0].rebound_speed == pytest.approx(0.1, rel=1e-5)
    assert gaps(machine, motion, np.linspace(0.0, 0.02, 9001)).min() > -1.1 * outside * C - 1e-15


def test_a_pin_at_rest_on_the_bushing_stays_only_if_it_is_pressed():
    """Crank at rest; gravity presses the rocker's bushing on the pin, or takes it away."""
    seen = set()
    still = with_pin_at(loose(0.5, drive__speed=0, gravity=[0, 0]), C * np.array([0.0, 1.0]))
    for pull in (9.0, -9.0):
        scene = still.scene.model_copy(update={'gravity': (0.0, pull)})
        machine = type(still)(still.name, scene)
        q = machine.initial_state().q
        # gravity alone: do pin and bushing, falling freely, come closer along the normal (up)?
        a3 = 0.2439 * 0.185 * pull * np.cos(q[0]) / (2.950e-3 + 0.2439 * 0.185**2)
        a4 = 0.2334 * 0.134 * pull * np.cos(q[1]) / (3.176e-3 + 0.2334 * 0.134**2)
        pressed = 0.309 * a3 * np.cos(q[0]) - 0.312 * a4 * np.cos(q[1]) > 0.0
        _, impacts, modes = finish(machine.start(), 1e-4)
        assert modes[-1].mode is (Mode.FOLLOWING if pressed else Mode.FREE_FLIGHT)
        assert not [i for i in impacts if i.approach_speed > 1e-9]
        seen.add(bool(pressed))
    assert seen == {True, False}


def first_revolution(speed):
    """Seated run of the first 0.99 revolutions: times of losses, audit, impacts, modes."""
    machine = loose(0.5, 'seated', drive__speed=speed)
    motion, impacts, modes = finish(machine.start(), 0.99 * 2.0 * np.pi / speed)
    audit = audited(machine.physics, motion, impacts)
    return [m.t for m in modes if m.mode is Mode.FREE_FLIGHT], audit, impacts, modes


def lowest_force(speed):
    """Smallest contact force of the first 0.99 revolutions [N], by ever denser samples."""
    solution = ms.simulate(loose(0.5, 'seated', drive__speed=speed), revolutions=0.99)
    left, right = 0.0, solution.duration
    for _ in range(5):
        t = np.linspace(left, right, 2001)
        force = solution.sample(t, 'normal_force.coupler_rocker')['normal_force.coupler_rocker']
        k = int(force.argmin())
        left, right = t[max(k - 1, 0)], t[min(k + 1, 2000)]
    return force.min()


@pytest.mark.slow
def test_a_contact_force_that_dips_below_zero_inside_a_step_is_found_down_to_a_touch():
    """The speed at which contact is just lost: below it the force stays positive, to 1e-7 N.

    Just above it force falls below zero for a moment far shorter than a step, and the pin leaves
    the bushing and comes back within that step.
    """
    low, high = SPEED, 1.5 * SPEED
    assert not first_revolution(low)[0]
    assert first_revolution(high)[0]
    for _ in range(46):
        middle = 0.5 * (low + high)
        if first_revolution(middle)[0]:
            high = middle
        else:
            low = middle
    assert -1e-11 <= lowest_force(low) < 1e-7
    losses, audit, impacts, modes = first_revolution(high)
    # two crossings sqrt(1e-12) of a turn apart; then the pin is back
    assert modes[2].mode is Mode.FOLLOWING
    assert 0.0 < modes[2].t - losses[0] < 1e-3
    assert impacts[0].ends_chatter
    assert audit.max_penetration < 1e-15
    assert abs(audit.energy.residual) < 1e-12


@pytest.mark.slow
def test_a_pin_that_grazes_its_bushing_strikes_or_passes_but_never_crosses():
    """Bisect the start until the pin only just touches: a double root of the gap."""

    plain = loose(1.0)

    def graze(x):
        machine = with_pin_at(plain, C * np.array([x, 0.3]), (0.9, -0.7))
        motion, impacts, _ = finish(machine.start(), 0.004)
        return machine, motion, impacts

    counts = np.array([len(graze(x)[2]) for x in np.linspace(-0.9, 0.9, 37)])
    k = int(np.flatnonzero(np.diff(counts))[0])
    low, high = np.linspace(-0.9, 0.9, 37)[k : k + 2]
    fewer = min(counts[k], counts[k + 1])
    if counts[k] != fewer:
        low, high = high, low  # low: passes; high: strikes once more
    for _ in range(52):
        middle = 0.5 * (low + high)
        if len(graze(middle)[2]) > fewer:
            high = middle
        else:
            low = middle
    for x in (low, high):
        machine, motion, impacts = graze(x)
        t = np.linspace(0.0, 0.004, 40001)
        assert gaps(machine, motion, t).min() > -1e-14
        assert audited(machine.physics, motion, impacts).max_penetration < 1e-14
    slowest = min(i.approach_speed for i in impacts)
    at_the_end = abs(max(i.t for i in impacts) - 0.004) < 1e-9
    assert slowest < 1e-5 or at_the_end


@pytest.mark.sample(2)
@pytest.mark.parametrize('e', [0.9, 0.99, 0.9999, 1.0])
@pytest.mark.parametrize('rtol', [1e-4, 1e-6])
def test_coarse_steps_never_let_the_pin_through(e, rtol):
    """A step that ends within its error of an impact leaves the guard on the wrong side."""
    rng = np.random.default_rng(int(1e4 * e))
    for _ in range(12):
        clearance = 10.0 ** rng.uniform(-4.5, -3.3)
        speed = rng.uniform(10.0, 100.0)
        more = {RADIAL.replace('.', '__'): clearance, 'drive__start_angle': rng.uniform(0, 6.28)}
        machine = loose(e, rtol=rtol, drive__speed=speed, **more)
        solution = ms.simulate(machine, revolutions=0.3)
        assert solution.max_penetration < 0.1 * clearance


def test_the_pin_lost_at_the_end_of_a_coarse_step_is_found():
    """Its guard's polynomial had ended a hair above zero; the state was a hair below."""
    machine = ms.load_scene(
        'four_bar_clearance',
        {RADIAL: 0.0004171906029174734, 'joints.coupler_rocker.clearance.restitution': 0.999,
         'drive.speed': 27.127467039607136, 'drive.start_angle': 5.299017667696449,
         'solver.rtol': 1e-4, 'start': 'centred'},
    )  # fmt: skip
    s = ms.simulate(machine, revolutions=0.3)
    assert s.max_penetration < 5e-6
    assert len(s.impacts) > 10


@pytest.mark.parametrize('e', [0.0, 1e-12, 0.02])
def test_plastic_impacts_leave_nothing_to_bounce(e):
    s = ms.simulate(loose(e), revolutions=1.0)
    # with e = 0.02 rebounds fall by 2500 in height each, from 1e-7 m to 1e-13 m
    assert len(s.impacts) == (1 if e < 0.01 else 3)
    assert s.impacts[-1].ends_chatter
    assert s.impacts[-1].rebound_speed == 0.0
    assert [m.mode for m in s.modes] == [Mode.FREE_FLIGHT, Mode.FOLLOWING]
    assert abs(s.energy.residual) < 1e-13
    assert s.max_closure_error < 1e-15


# --- long runs --------------------------------------------------------------------------------


def test_a_law_keeps_its_digits_after_a_million_turns():
    law = constant_speed(0.25, SPEED)
    t = Fraction(171428.123456789)
    turns, (angle, speed) = law.about(t)
    with mp.workdps(60):
        exact = mpf(0.25) + mpf(SPEED) * mpf(t.numerator) / mpf(t.denominator)
        assert turns == int(mp.floor(exact / (2 * mp.pi)))
        assert angle == float(exact - 2 * mp.pi * turns)
    assert speed == SPEED


def test_a_run_that_starts_after_a_million_turns_is_the_run_that_starts_at_zero():
    """Time and angles are counted from bases: nothing of 171,000 s is left in the dynamics."""
    machine = loose(0.5, 'seated')
    start = machine.initial_state()
    runs = []
    for origin in (Fraction(0), Fraction(171428)):
        late = DriveLaw('crank', (0.0, SPEED), float(origin), float(origin))
        state = State(origin, (3, -5), start.q, start.v, start.closed)
        loop = EventLoop(machine.equations.system, [late], state, 1e-12, 0.0, TURN / 8.0)
        runs.append(finish(loop, float(origin) + 1.5 * TURN))
    early, late = (r[0].curve for r in runs)
    n = min(len(early), len(late)) - 1
    np.testing.assert_array_equal(late.coefficients[:n], early.coefficients[:n])
    exact_start = [Fraction(a) + Fraction(b) for a, b in zip(early.start, early.start_low)]  # noqa: B905
    exact_late = [Fraction(a) + Fraction(b) for a, b in zip(late.start, late.start_low)]  # noqa: B905
    for a, b in zip(exact_start[:n], exact_late[:n], strict=True):
        assert abs(float(b - a - 171428)) < 1e-17
    assert late.turns[0].tolist() == [0, 3, -5]
    assert len(runs[0][1]) == len(runs[1][1]) > 10


@pytest.mark.parametrize('n', [50, pytest.param(120, marks=pytest.mark.slow)])
def test_many_revolutions_neither_drift_nor_lose_the_crank_angle(n):
    machine = loose(0.5, 'seated', rtol=1e-9)
    run, worst, impacts = machine.start(), [], []
    for k in range(1, n + 1):
        run.advance(k * TURN, final=k == n)
        motion, struck, _ = run.drain()
        worst.append(audited(machine.physics, motion, struck))
        impacts += struck
    closure = [w.max_closure_error for w in worst]
    assert max(closure[n // 2 :]) < 2.0 * max(closure[: n // 2])
    assert max(closure) < 1e-12
    assert max(w.max_penetration for w in worst) < 1e-11
    # the crank's angle at the end of the last segment, by exact arithmetic
    c = motion.curve
    t = Fraction(c.start[-1]) + Fraction(c.start_low[-1]) + Fraction(c.duration[-1])
    with mp.workdps(50):
        exact = mpf(SPEED) * mpf(t.numerator) / mpf(t.denominator)
        exact -= 2 * mp.pi * int(c.turns[-1, 0])
    angle = c.at(np.array([len(c) - 1]), c.duration[-1:])[0, 0] - 2.0 * np.pi * c.turns[-1, 0]
    assert c.turns[-1, 0] == n - 1
    assert abs(angle - float(exact)) < 3e-14  # the 2 pi n above is rounded, not the motion
    assert abs(c.coefficients[-1, 0, 0]) < 7.0
    # the motion does not die down: some impacts in every ten revolutions
    per_ten = np.histogram([i.t / TURN for i in impacts], np.arange(10, n + 1, 10))[0]
    assert per_ten.min() > 50


@pytest.mark.sample(4)
@pytest.mark.parametrize('before', [1e-6, 1e-9, 1e-11, 1e-13, 1e-15, 1e-17, 0.0])
def test_contact_is_lost_wherever_the_steps_begin(before):
    """A loss of contact much nearer to the start of a step than to its end is not overlooked."""
    first = next(m.t for m in finish(loose(0.5, 'seated').start(), 1.04 * TURN)[2] if m.mode == 1)
    run = loose(0.5, 'seated').start()
    t = first - before
    run.change_law(constant_speed(SPEED * t, SPEED, t))
    motion, _, modes = finish(run, 1.04 * TURN)
    lost = next(m.t for m in modes if m.mode == 1)
    assert lost == pytest.approx(first, abs=1e-11)
    assert audited(run_physics(), motion, []).min_normal_force > -1e-9


def run_physics():
    return loose(0.5, 'seated').physics


# --- several gaps at once ---------------------------------------------------------------------


def six_bar(coupled, e):
    """A second coupler and rocker: on the same crank pin, or carried by the first coupler."""
    o = (0.0, 0.0)
    links = (('coupler', 'rocker'), ('coupler2', 'rocker2'))
    bodies = [Body('crank', 0.6095, 2.645e-3, (0.009, 0.0))]
    for pair in links:
        bodies.append(Body(pair[0], 0.2439, 2.950e-3, (0.185, 0.0)))
        bodies.append(Body(pair[1], 0.2334, 3.176e-3, (0.134, 0.0)))
    carrier, at = ('coupler', (0.05, 0.03)) if coupled else ('crank', (0.064, 0.0))
    pivot = (0.45, 0.05) if coupled else (0.387, 0.0)
    joints = (
        Revolute('ground_crank', GROUND, 'crank', o, o),
        Revolute('crank_coupler', 'crank', 'coupler', (0.064, 0.0), o),
        Revolute('loose', 'coupler', 'rocker', (0.309, 0.0), (0.312, 0.0)),
        Revolute('rocker_ground', 'rocker', GROUND, o, (0.387, 0.0)),
        Revolute('carrier', carrier, 'coupler2', at, o),
        Revolute('loose2', 'coupler2', 'rocker2', (0.309, 0.0), (0.312, 0.0)),
        Revolute('rocker2_ground', 'rocker2', GROUND, o, pivot),
    )
    m = Mechanism(tuple(bodies), joints, ('loose', 'loose2'), (0.0, -9.8145))
    gap = [
        BearingClearance(n, m, C, restitution=x)
        for n, x in zip(('loose', 'loose2'), e, strict=True)
    ]
    system = System(m, gap, ['crank'], 1)
    one = loose().initial_state()
    q, v = (*one.q, *one.q), (*one.v, *one.v)
    if coupled:
        near = 0.064 + (0.05 + 0.03j) * np.exp(1j * one.q[0])
        reach = 0.45 + 0.05j - near
        d, l3, l4 = abs(reach), 0.309, 0.312
        third = np.angle(reach) + np.arccos((d * d + l3 * l3 - l4 * l4) / (2.0 * d * l3))
        fourth = np.angle(l3 * np.exp(1j * third) - reach)
        q, v = (*one.q, float(third), float(fourth)), (*one.v, -3.0, -3.0)
    state = State(Fraction(0), (0,) * 4, q, v, (False, False))
    run = EventLoop(system, [constant_speed(0.0, SPEED)], state, 1e-12, 0.0, TURN / 8.0)
    return run, DynamicPhysics(Observer(system))


@pytest.mark.slow
def test_two_loose_loops_on_one_crank_do_not_know_of_each_other():
    """All of their impacts are simultaneous, and each is that of the four-bar alone."""
    run, physics = six_bar(coupled=False, e=(0.5, 0.5))
    motion, impacts, modes = finish(run, 0.3 * TURN)
    alone = finish(loose(0.5).start(), 0.3 * TURN)
    for joint in ('loose', 'loose2'):
        mine = [i for i in impacts if i.joint == joint]
        assert len(mine) == len(alone[1])
        for a, b in zip(mine, alone[1], strict=True):
            # the integrators of one and of two loops round differently: positions are known to
            # 2e-16 m, so that the instant of a slow touch is not
            assert a.t == pytest.approx(b.t, abs=1e-14 + 2e-16 / b.approach_speed)
            # nor its speed, by what the pin gains meanwhile
            gained = 1e3 * 2e-16 / b.approach_speed**2
            assert a.normal_impulse == pytest.approx(
                b.normal_impulse, rel=1e-6 + gained, abs=3e-11
            )
        assert [m.mode for m in modes if m.joint == joint] == [m.mode for m in alone[2]]
    end = np.array([0.29 * TURN])
    both, one = motion.curve(end)[0], alone[0].curve(end)[0]
    assert np.abs(both - [*one, *one[1:]]).max() < 1e-13
    assert abs(audited(physics, motion, impacts).energy.residual) < 1e-12


@pytest.mark.sample(1)
@pytest.mark.parametrize('e', [(1.0, 1.0), (0.5, 0.5), (0.0, 0.8), (0.9, 0.2), (0.0, 0.0)])
def test_two_gaps_that_shake_each_other_keep_the_energy_and_their_distance(e):
    run, physics = six_bar(coupled=True, e=e)
    motion, impacts, _ = finish(run, 0.25 * TURN)
    audit = audited(physics, motion, impacts)
    exchanged = sum(i.normal_impulse * i.approach_speed for i in impacts)
    assert len(impacts) > 8
    assert {i.joint for i in impacts} == {'loose', 'loose2'}
    assert abs(audit.energy.residual) < (1e-13 if e == (1.0, 1.0) else 3e-6) * exchanged
    # contacts that touch within the error of a step, rtol times the size, strike together
    assert audit.max_penetration < 1e-12 * 0.45
    assert audit.max_closure_error < 1e-14
    assert audit.min_normal_force > -1e-9
    assert all(i.energy_loss > -1e-15 for i in impacts)


def test_a_flight_that_begins_at_rest_and_ends_at_once_is_seen_to_end():
    """It rises 1e-14 m in 10 us, where a step would last 33 ms: the pin had left its bushing."""
    machine = ms.load_scene('four_bar_clearance', {
        'start': 'centred', 'solver.rtol': 1e-12,
        'drive': {'speed': -1.0471975511965976, 'start_angle': 0.15},
        'joints.coupler_rocker.clearance.radial': 1e-6,
        'joints.coupler_rocker.clearance.restitution': 0.0,
        'initial.position': {'coupler': 1.0005598553858905, 'rocker': 2.097769395423943},
        'initial.velocity': {'coupler': 0.24231425437919377, 'rocker': 0.18143025752084163},
    })  # fmt: skip
    solution = ms.simulate(machine, duration=0.15)
    assert solution.max_penetration < 1e-12
    assert abs(solution.energy.residual) < 1e-12


# --- whatever the start -----------------------------------------------------------------------


def number(least, most):
    """Numbers that a scene accepts: between bounds, and 0 instead of too small ones."""
    return st.floats(least, most).map(lambda x: x if abs(x) >= SMALLEST else 0.0)


@st.composite
def starts(draw):
    """A loose four-bar anywhere in its bushing, turning as it likes."""
    speed = draw(st.floats(10.0, 2500.0)) * np.pi / 30.0 * draw(st.sampled_from([1.0, -1.0]))
    c = 10.0 ** draw(st.floats(-6.0, -3.0))
    e = draw(st.one_of(st.sampled_from([0.0, 0.5, 0.99, 1.0]), number(0.0, 1.0)))
    machine = loose(
        e, drive__speed=float(speed), drive__start_angle=draw(number(0.0, 6.28)),
        **{RADIAL.replace('.', '__'): c},
    )  # fmt: skip
    if draw(st.booleans()):
        seated = machine.scene.model_copy(update={'start': 'seated'})
        return type(machine)(machine.name, seated)
    r, eta = draw(st.one_of(number(0.0, 1.0), st.just(1.0))), draw(number(0.0, 6.28))
    turning = draw(st.tuples(number(-1.0, 1.0), number(-1.0, 1.0)))
    Q = r * c * np.array([np.cos(eta), np.sin(eta)])
    return with_pin_at(machine, Q, np.array(turning) * abs(speed) / 10.0)


@given(starts())
@settings(suppress_health_check=[HealthCheck.too_slow])
def test_books_gaps_and_impacts_are_in_order_whatever_the_start(machine):
    clearance = machine.plan.clearances['coupler_rocker']
    run = machine.start()
    run.advance(machine.drive.period, final=True, most=1200)
    motion, impacts, modes = run.drain()
    audit = audited(machine.physics, motion, impacts)
    energy = audit.energy
    exchanged = sum(i.normal_impulse * i.approach_speed for i in impacts) + energy.initial
    assert abs(energy.residual) < 1e-9 * (exchanged + abs(energy.drive_work))
    assert audit.max_penetration < 1e-12
    assert audit.max_closure_error < 1e-12
    assert audit.min_normal_force > -1e-6
    assert energy.dissipated >= -1e-13 * exchanged
    for i in impacts:
        assert i.normal_impulse > 0.0
        assert i.approach_speed > 0.0
        rebound = 0.0 if i.ends_chatter else clearance.restitution * i.approach_speed
        assert i.rebound_speed == pytest.approx(rebound, rel=1e-12, abs=1e-15 * i.approach_speed)
        lost = 0.5 * i.normal_impulse * (i.approach_speed - i.rebound_speed)
        assert i.energy_loss == pytest.approx(lost, rel=1e-9, abs=1e-14 * exchanged)
    assert [i.t for i in impacts] == sorted(i.t for i in impacts)
    for a, b in pairwise(modes):
        assert a.mode is b.previous
        assert a.mode is not b.mode


@pytest.mark.parametrize('start', ['centred', 'seated'])
def test_the_mirror_image_of_a_machine_moves_as_its_mirror_image(start):
    """Mirrored in the frame line: crossed branch, crank backwards, gravity upwards."""
    e, until = 0.5, 0.3 * TURN
    here = loose(e, start, drive__start_angle=0.3)
    there = loose(
        e, start, drive__start_angle=-0.3, drive__speed=-SPEED, branch='crossed',
        gravity=[0, 9.8145],
    )  # fmt: skip
    (a, struck, modes), (b, struck_there, modes_there) = (
        finish(m.start(), until) for m in (here, there)
    )
    t = np.linspace(0.0, until, 100)
    mirrored = np.exp(1j * a.curve(t)) * np.exp(1j * b.curve(t))
    assert np.abs(mirrored - 1.0).max() < 1e-12
    assert len(struck) == len(struck_there)
    for i, j in zip(struck, struck_there, strict=True):
        assert i.t == pytest.approx(j.t, abs=1e-10)
        assert np.exp(1j * (i.normal_angle + j.normal_angle)) == pytest.approx(1.0, abs=1e-7)
    assert [m.mode for m in modes] == [m.mode for m in modes_there]


def test_a_crank_at_rest_lets_the_pin_come_to_rest_on_the_bushing():
    s = ms.simulate(loose(0.4, drive__speed=0), duration=2.0)
    assert s.modes[-1].mode is Mode.FOLLOWING
    assert s.energy.drive_work == 0.0
    assert abs(s.energy.residual) < 1e-14
    lost = s.energy.initial - s.energy.final
    assert lost == pytest.approx(s.energy.dissipated, rel=1e-9)
    names = [f'position.{k}' for k in LINKS]
    assert s.sample(0.0)[names[0]] == s.sample(2.0)[names[0]]


@pytest.mark.slow
def test_each_change_of_mode_goes_on_from_the_one_before():
    """Also where a load that steps lets contacts give way: these were entered twice."""
    solution = ms.simulate(
        ms.load_scene('four_bar_clearance', {
            'joints.coupler_rocker.clearance.friction': 0.2,
            'loads.brake': {'at': 'rocker.end', 'force': ['-20*sign(vx)', '0']},
        }),
        revolutions=1.0,
    )  # fmt: skip
    modes = solution.modes
    assert len(modes) > 10
    assert [change.previous for change in modes[1:]] == [change.mode for change in modes[:-1]]


@pytest.mark.slow
def test_a_run_whose_events_stand_still_says_so():
    """Two ends of a rough bearing in line jam against each other: no run came beyond 0.166 s."""
    tilt = {'stiffness': 126.0623777984497, 'damping': 0.05,
            'inertia': [0.00186462496098413, 0.0009573355487330264]}  # fmt: skip
    play = {'radial': 0.002, 'restitution': 0.0, 'friction': 3.0, 'length': 0.005682110394099747}
    machine = ms.load_scene('slider_crank', {
        'gravity': [0.0, 0.0], 'links.rod.tilt': tilt, 'start': 'seated',
        'joints.crank_rod.clearance': play,
        'drive': {'coordinate': 'crank', 'start_angle': -0.16083314017036265,
                  'speed': -9.61641285811463},
    })  # fmt: skip
    with pytest.raises(RunError, match=r'without progress in time \(t = 0\.16'):
        ms.simulate(machine, duration=0.2)
