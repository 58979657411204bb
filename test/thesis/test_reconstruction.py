"""Angular motion from readings, against the motion that the readings were made of."""

from __future__ import annotations

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.sensing.point import PointOnLink
from mechanism_sim.thesis import reconstruction as r

RATE = 2700.0
G = (0.0, -9.8145)
L2, L3, L4 = 0.064, 0.309, 0.312


class Run:
    """A loose four-bar whose crank speeds up, and samples of it."""

    def __init__(self, overrides=()):
        self.machine = ms.load_scene('four_bar_clearance', dict(overrides))
        self.solution = ms.simulate(self.machine, revolutions=3)
        self.curve = self.solution.motion.curve
        self.t = np.arange(0.0, self.curve.end, 1.0 / RATE)
        self.q, self.w, self.a = (self.curve(self.t, d).T for d in (0, 1, 2))

    def read(self, link, at):
        point = PointOnLink(self.machine.mechanism, link, at, 'across')
        return point.read(self.solution.motion, *self.curve.find(self.t))[0]

    @property
    def pin(self):
        return r.crank_pin(L2, self.q[0], self.w[0], self.a[0])


@pytest.fixture(scope='module')
def steady():
    return Run()


@pytest.fixture(scope='module')
def speeding():
    return Run({'drive': {'profile': {'points': [['0 s', '300 rpm'], ['1 s', '400 rpm']]}}})


@pytest.mark.parametrize('which', ['steady', 'speeding'])
def test_reconstruction_is_exact_for_an_ideal_sensor(which, request):
    run = request.getfixturevalue(which)
    coupler = r.angular_acceleration(run.read('coupler', L3), L3, run.q[1], run.pin)
    rocker = r.angular_acceleration(run.read('rocker', 0.2), 0.2)
    scale = np.abs(run.a).max()
    assert np.abs(coupler - run.a[1]).max() < 1e-9 * scale
    assert np.abs(rocker - run.a[2]).max() < 1e-9 * scale


def test_the_printed_equation_counts_the_reading_clockwise(steady):
    """[SB] eq. 7.2.1-6, with (a_B)_t of eq. 7.2.1-5."""
    th2, th3, w2 = steady.q[0], steady.q[1], steady.w[0]
    clockwise = -steady.read('coupler', L3)
    printed = (L2 * w2**2 * np.sin(th2 - th3) - clockwise) / L3
    assert np.abs(printed - steady.a[1]).max() < 1e-9 * np.abs(steady.a[1]).max()


def test_without_the_acceleration_of_the_crank_something_is_missing(speeding):
    """What [SB] leaves out, because its crank is steady."""
    steady = r.crank_pin(L2, speeding.q[0], speeding.w[0])
    found = r.angular_acceleration(speeding.read('coupler', L3), L3, speeding.q[1], steady)
    missing = L2 * speeding.a[0] * np.cos(speeding.q[0] - speeding.q[1]) / L3
    assert found - speeding.a[1] == pytest.approx(missing, abs=1e-9)
    assert np.abs(missing).max() > 1.0


def test_two_sensors_need_neither_crank_nor_angle_nor_gravity(speeding):
    weight = G[1] * np.cos(speeding.q[1])
    ends = [speeding.read('coupler', at) - weight for at in (0.05, L3)]
    found = r.by_two(*ends, 0.05, L3)
    assert np.abs(found - speeding.a[1]).max() < 1e-9 * np.abs(speeding.a[1]).max()


@pytest.mark.parametrize(('link', 'row', 'at'), [('coupler', 1, L3), ('rocker', 2, L4)])
def test_gravity_that_an_instrument_reads_is_taken_off(steady, link, row, at):
    angle = steady.q[row]
    reading = steady.read(link, at) - (-np.sin(angle) * G[0] + np.cos(angle) * G[1])
    joint = steady.pin if link == 'coupler' else None
    found = r.angular_acceleration(reading, at, angle, joint, G)
    assert np.abs(found - steady.a[row]).max() < 1e-9 * np.abs(steady.a[row]).max()


def test_the_angle_of_the_ideal_mechanism_costs_less_than_a_thousandth(steady):
    """As [SB] had to; the pin is nowhere farther than the clearance from where it would be."""
    th3, _ = steady.machine.nominal.linkage.positions(steady.q[0])
    found = r.angular_acceleration(steady.read('coupler', L3), L3, th3, steady.pin)
    off = r.error(found, steady.a[1])
    assert 1e-6 < off.relative < 1e-3


def swing(rate, cycles=4.0):
    """A velocity with three harmonics, its derivative, and the time between samples."""
    t = np.arange(0.0, cycles / 5.0, 1.0 / rate)
    w = 2.0 * np.pi * 5.0 * t
    velocity = np.sin(w) + 0.3 * np.sin(2.0 * w + 1.0) + 0.1 * np.cos(7.0 * w)
    derivative = 10.0 * np.pi * (np.cos(w) + 0.6 * np.cos(2.0 * w + 1.0) - 0.7 * np.sin(7.0 * w))
    return velocity, derivative


def test_trapezoids_are_of_second_order():
    errors = []
    for rate in (500.0, 1000.0, 2000.0, 4000.0):
        velocity, derivative = swing(rate)
        found = r.by_trapezoids(derivative, rate, velocity[0])
        errors.append(r.error(found, velocity).largest)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(2.0, abs=0.05)


def test_an_offset_drifts_unless_the_cycle_closes():
    velocity, derivative = swing(2000.0)
    drifting = r.by_trapezoids(derivative + 0.5, 2000.0, velocity[0])
    assert drifting[-1] - velocity[-1] == pytest.approx(0.5 * 0.8, rel=1e-2)
    assert r.error(r.by_whole_cycles(derivative + 0.5, 2000.0), velocity).largest < 2e-3
    assert r.error(r.by_whole_cycles(derivative + 0.5, 2000.0, 3.0), velocity + 3.0).largest < 2e-3


def test_integration_by_fft_is_exact_for_whole_cycles():
    velocity, derivative = swing(500.0)
    assert r.error(r.by_spectrum(derivative, 500.0), velocity).largest < 1e-12
    only = r.by_spectrum(derivative, 500.0, low=30.0)
    assert only == pytest.approx(0.1 * np.cos(70.0 * np.pi * np.arange(400) / 500.0), abs=1e-12)


def test_the_filter_stops_drift_in_a_record_of_no_whole_cycles():
    velocity, derivative = swing(2000.0, 20.37)
    noise = np.random.default_rng(3).normal(size=len(velocity))
    inner = slice(1500, -1500)
    found = r.by_filter(derivative + 0.5 + noise, 2000.0, 0.5)[inner]
    bare = r.by_trapezoids(derivative + 0.5 + noise, 2000.0, velocity[0])[inner]
    assert r.error(found, velocity[inner]).relative < 0.03
    assert r.error(bare, velocity[inner]).relative > 0.5


def test_errors_of_a_known_difference():
    truth = np.array([3.0, -4.0, 0.0, 5.0])
    off = r.error(truth + np.array([1.0, -1.0, 1.0, -1.0]), truth)
    assert off == (1.0, 1.0, pytest.approx(1.0 / np.sqrt(12.5)))
    assert r.error(truth, 0.0 * truth).relative == np.inf


@pytest.mark.parametrize(
    ('call', 'said'),
    [
        (lambda x: r.angular_acceleration(x, 0.0), 'in the joint'),
        (lambda x: r.by_two(x, x, 0.1, 0.1), 'same place'),
        (lambda x: r.by_filter(x, 100.0, 60.0), 'below half the sampling rate'),
    ],
)
def test_what_cannot_be_told_is_refused(call, said):
    with pytest.raises(InputError, match=said):
        call(np.zeros(10))
