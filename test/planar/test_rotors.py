"""Rotors on supports and shafts that give way, against closed forms and other formulations."""

import math
import random

import numpy as np
import pytest
from builders import made
from rotors import DiskRotor, Rotor, influence_coefficients
from running import run, run_json
from scipy.integrate import solve_ivp

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.report.vibrations import response_text
from mechanism_sim.results.quantity import Shown
from mechanism_sim.scene.check import check
from mechanism_sim.studies.harmonics import harmonics, unbalance_response
from mechanism_sim.studies.modes import campbell, critical_speeds, modes
from mechanism_sim.studies.response import read_source, response
from mechanism_sim.vibration.shafts import Bearing, condensed, shaft_rigidity

EXACT = {'rel': 1e-10, 'abs': 1e-13}
TURN = 2.0 * np.pi
E, D = 2.1e11, 0.02
EI = shaft_rigidity(E, D)
SHAFT = {'diameter': D, 'youngs_modulus': E}
MASS, POLAR = 8.0, 0.04


def rotor(speed=100.0, polar=POLAR, off=1e-4, drive=None, gravity=(0.0, 0.0), mass=MASS, **joint):
    return made({
        'title': 'Rotor',
        'links': {'disk': {'mass': mass, 'inertia': polar, 'cog': off}},
        'joints': {'shaft': {'rotor': ['ground', 'disk'], **joint}},
        'drive': {'coordinate': 'disk', **(drive or {'speed': speed}), 'start_angle': 0.0},
        'gravity': [*gravity],
    }, 'rotor')  # fmt: skip


def jeffcott(span=0.6, **given):
    """The disk in the middle of a shaft on two rigid supports."""
    ends = {'left': {'along': -span / 2}, 'right': {'along': span / 2}}
    relaxation = given.pop('relaxation', 0.0)
    return rotor(supports=ends, shaft={**SHAFT, 'relaxation': relaxation}, **given)


def overhung(length=0.3, diametral=0.021, **given):
    wall = {'wall': {'along': -length, 'clamped': True}}
    return rotor(supports=wall, shaft=SHAFT, diametral_inertia=diametral, **given)


def roots(machine, speed):
    """Frequencies [rad/s] at a speed."""
    (station,) = campbell(machine, np.array([speed]))
    return [TURN * m.frequency for m in station.modes]


def test_a_disk_between_two_supports_whirls_as_jeffcotts():
    """Amplitude, phase and self-centring of the closed form, [V] 6.14."""
    k, c = 48.0 * EI / 0.6**3, 150.0
    machine = jeffcott(external_damping=c)
    closed = Rotor(MASS, 1e-4, (k, k), (c, c))
    wn = math.sqrt(k / MASS)
    speeds = wn * np.array([0.3, 0.9, 1.0, 1.1, 20.0])
    found = unbalance_response(machine, [], speeds).amplitudes
    orbit = closed.whirl(speeds)
    assert found['position.disk.x'] == pytest.approx(orbit.x, **EXACT)
    assert found['position.disk.y'] == pytest.approx(orbit.y, **EXACT)
    # far beyond the critical speed the mass centre comes to rest on the axis
    assert found['position.disk.x'][-1] == pytest.approx(-1e-4, rel=6e-3)
    assert roots(machine, 50.0) == pytest.approx([wn, wn], **EXACT)


def quartic(length, diametral, polar, speed):
    """Whirl speeds of a disk at the end of a shaft (Stodola, Green), against the rotation < 0."""
    k, m, n = 12.0 * EI / length**3, 6.0 * EI / length**2, 4.0 * EI / length
    # (k - M w^2)(n + I_p W w - I_d w^2) - m^2
    first, second = [-MASS, 0.0, k], [-diametral, polar * speed, n]
    return np.sort(np.roots(np.polysub(np.polymul(first, second), [m**2])).real)


@pytest.mark.parametrize('diametral', [0.021, 0.06])
@pytest.mark.parametrize('speed', [0.0, 90.0, -400.0, 3000.0])
def test_an_overhung_disk_whirls_by_the_gyroscopic_quartic(diametral, speed):
    expected = quartic(0.3, diametral, POLAR, abs(speed))
    (station,) = campbell(overhung(diametral=diametral), np.array([speed]))
    found = [math.copysign(TURN * m.frequency, m.whirl or 1.0) for m in station.modes]
    if speed:
        assert [abs(m.whirl) for m in station.modes] == pytest.approx([1.0] * 4)
    else:
        found, expected = np.abs(found), np.abs(expected)
    assert np.sort(found) == pytest.approx(np.sort(expected), **EXACT)


@pytest.mark.parametrize('diametral', [0.021, 0.06])
def test_critical_speeds_of_an_overhung_disk(diametral):
    """A thin disk, I_p > I_d, has one forward critical speed, a thick one has two."""
    k, m, n = 12.0 * EI / 0.3**3, 6.0 * EI / 0.3**2, 4.0 * EI / 0.3
    expected = {}
    for way, stiff in (('forward', POLAR - diametral), ('backward', -POLAR - diametral)):
        squares = np.roots(np.polysub(np.polymul([-MASS, k], [stiff, n]), [m**2]))
        expected[way] = np.sqrt(np.sort(squares[squares > 0.0]))
    assert len(expected['forward']) == (1 if diametral < POLAR else 2)
    machine = overhung(diametral=diametral)
    found = critical_speeds(machine, campbell(machine, np.linspace(50.0, 2050.0, 21)))
    for way, sign in (('forward', 1.0), ('backward', -1.0)):
        speeds = [x.speed for x in found if x.whirl * sign > 0.0]
        assert speeds == pytest.approx(expected[way][expected[way] < 2050.0], **EXACT)


@pytest.mark.sample(1)
@pytest.mark.parametrize('damping', [4e3, 1.2e4, 1e5])
def test_critical_speeds_are_of_modes_that_oscillate(damping):
    """Dampers beside stiff supports: by the polynomials of the cylinder and the cone."""
    span, mass, stiff, diametral, c = 0.6, 3.0, 5e6, 0.02, 100.0
    one = {'stiffness': stiff, 'damping': damping, 'mass': mass}
    ends = {'left': {'along': -span / 2, **one}, 'right': {'along': span / 2, **one}}
    machine = rotor(supports=ends, shaft=SHAFT, external_damping=c, diametral_inertia=diametral)
    k, kt = 48.0 * EI / span**3, 12.0 * EI / span
    coupled = 2.0 * kt / span**2
    cylinder = np.polysub(
        np.polymul([MASS, c, k], [2.0 * mass, 2.0 * damping, 2.0 * stiff + k]), [k**2]
    )

    def oscillating(speed):
        cone = np.polysub(
            np.polymul([diametral, -1j * POLAR * speed, kt], [mass, damping, stiff + coupled]),
            [kt * coupled],
        )
        # x and y of the cylinder; the cone's roots are those of x + i y, turning either way
        roots = [*np.repeat(np.roots(cylinder), 2), *np.roots(cone), *np.roots(cone).conj()]
        return np.sort([abs(s) for s in roots if s.imag > 1e-7 * abs(s)])

    speeds = np.linspace(10.0, 3000.0, 7)
    found = [x.speed for x in critical_speeds(machine, campbell(machine, speeds))]
    expected = []
    for a, b in zip(fine := np.linspace(10.0, 3000.0, 801), fine[1:], strict=False):
        low, high = oscillating(a), oscillating(b)
        if len(low) == len(high):
            crossed = np.flatnonzero((low - a > 0.0) != (high - b > 0.0))
            expected += [(a + b) / 2.0 for _ in crossed]
    assert found == pytest.approx(expected, abs=2.0)
    for w in found:
        assert np.abs(oscillating(w) - w).min() < 1e-9 * w
    (station,) = campbell(machine, np.array([500.0]))
    assert len(station.oscillating) == len(oscillating(500.0)) < 10
    if damping == 1e5:  # four of the cylinder's motions are decays
        assert sum(len(m.roots) == 1 for m in station.modes) == 4


def test_a_table_over_speed_lists_what_oscillates():
    one = '{along: -0.3, stiffness: 5e6, damping: 1e5, mass: 3}'
    supports = f'joints.ground_disk.supports={{left: {one}, right: {one.replace("-", "")}}}'
    args = ['modes', 'overhung_rotor', '--speeds', '100 rpm:9000 rpm:3', '--set', supports]
    text = run(*args).stdout
    found = run_json(*args)
    listed = [[m['frequency'] for m in s['modes'] if m['oscillates']] for s in found['stations']]
    rows = text.splitlines()[1:4]
    for row, frequencies in zip(rows, listed, strict=True):
        numbers = [float(x) for x in row.split()[1:] if x[0].isdecimal()]
        assert numbers == pytest.approx(frequencies, rel=1e-5)
    (still,) = {sum(not m['oscillates'] for m in s['modes']) for s in found['stations']}
    assert f'{still} more do not oscillate' in text
    assert len(found['critical_damping_ratios']) == len(found['critical_speeds'])
    assert text.count('damping ratio') == len(found['critical_speeds']) > 0


def test_a_force_on_a_turning_disk_shakes_it_forward_and_backward():
    """Half of it turns with the rotation, half against it: the complex impedance of each."""
    k, m, n, diametral, turns = 12.0 * EI / 0.027, 6.0 * EI / 0.09, 4.0 * EI / 0.3, 0.021, 150.0
    machine, f = overhung(diametral=diametral), np.array([5.0, 30.0, 250.0])

    def receptance(w):
        tilt = n - diametral * w**2 + POLAR * turns * w
        return tilt / ((k - MASS * w**2) * tilt - m**2)

    forward, backward = (0.5 * receptance(sign * TURN * f) for sign in (1.0, -1.0))
    source = read_source(machine, force='disk', direction=0.0)
    asked = ['position.disk.x', 'position.disk.y']
    found = response(machine, source, asked, f, turns).amplitudes
    assert found[asked[0]] == pytest.approx(forward + backward, **EXACT)
    assert found[asked[1]] == pytest.approx(-1j * (forward - backward), **EXACT)


def test_a_rigid_rotor_between_springs_moves_in_cylinders_and_cones():
    k, arm, diametral, speed = 3e5, 0.2, 0.03, 200.0
    ends = {'left': {'along': -arm, 'stiffness': k}, 'right': {'along': arm, 'stiffness': k}}
    machine = rotor(supports=ends, diametral_inertia=diametral)
    cylinder = math.sqrt(2.0 * k / MASS)
    half = POLAR * speed / (2.0 * diametral)
    cone = math.sqrt(half**2 + 2.0 * k * arm**2 / diametral)
    expected = sorted([cylinder, cylinder, cone - half, cone + half])
    assert roots(machine, speed) == pytest.approx(expected, **EXACT)


def test_internal_damping_makes_a_rotor_unstable():
    """From W = wn (1 + c/c_i) on the forward whirl grows, whatever the unbalance."""
    k, c, relaxation = 48.0 * EI / 0.6**3, 60.0, 1e-4
    machine = jeffcott(external_damping=c, relaxation=relaxation, off=0.0)
    wn = math.sqrt(k / MASS)
    limit = wn * (1.0 + c / (relaxation * k))
    for speed, sign in ((0.999 * limit, 1.0), (1.001 * limit, -1.0)):
        (station,) = campbell(machine, np.array([speed]))
        assert {np.sign(m.damping_ratio) for m in station.modes if m.whirl > 0.0} == {sign}
    (station,) = campbell(machine, np.array([limit]))
    (forward,) = (m for m in station.modes if m.whirl > 0.0)
    assert forward.damping_ratio == pytest.approx(0.0, abs=1e-11)
    assert TURN * forward.frequency == pytest.approx(wn, **EXACT)


def test_supports_with_masses_and_dampers_in_series_with_the_shaft():
    """Two equal supports: the disk on a shaft of 48 EI/L^3 on one of twice their values."""
    k, b, c, kb = 48.0 * EI / 0.6**3, 3.0, 400.0, 5e6
    one = {'stiffness': kb, 'damping': c, 'mass': b}
    ends = {'left': {'along': -0.3, **one}, 'right': {'along': 0.3, **one}}
    machine = rotor(supports=ends, shaft={**SHAFT, 'relaxation': 1e-5})
    w = np.array([100.0, 250.0, 400.0, 1500.0])
    ground = 2.0 * (kb + 1j * w * c - w**2 * b)
    # no internal damping: a round whirl with the shaft does not flex it
    expected = MASS * 1e-4 * w**2 / (k * ground / (k + ground) - w**2 * MASS)
    found = unbalance_response(machine, ['position.disk.x', 'position.disk.left_y'], w)
    assert found.amplitudes['position.disk.x'] == pytest.approx(expected, **EXACT)
    left = -1j * expected * k / (k + ground)
    assert found.amplitudes['position.disk.left_y'] == pytest.approx(left, **EXACT)


def test_a_rotor_that_begins_to_whirl_moves_as_the_closed_form():
    machine = rotor(
        speed=60.0, off=1e-3,
        supports={'both': {'stiffness': [4e4, 9e4], 'damping': [80.0, 120.0]}},
    )  # fmt: skip
    t = np.linspace(0.0, 1.0, 50)
    solution = ms.simulate(machine, duration=1.0)
    seen = solution.sample(t)
    expected = Rotor(MASS, 1e-3, (4e4, 9e4), (80.0, 120.0)).motion(t, 60.0)
    size = np.abs(expected).max()
    for name, path in zip('xy', expected, strict=True):
        assert seen[f'position.disk.{name}'] == pytest.approx(path, abs=1e-10 * size)
    # what the drive supplies besides keeping the speed goes into dampers and the whirl
    energy = solution.energy
    left = energy.initial + energy.drive_work - energy.dissipated - energy.final
    assert abs(left) < 1e-12 * energy.final


def test_a_run_up_keeps_its_energy_balance_and_its_supports_carry_the_reaction():
    machine = ms.load_scene('rotor_run_up', {
        'joints.ground_disk.supports': {
            'left': {'along': '-250 mm'}, 'right': {'along': '150 mm'}}})  # fmt: skip
    solution = ms.simulate(machine, duration=4.0)
    energy = solution.energy
    left = energy.initial + energy.drive_work - energy.dissipated - energy.final
    assert abs(left) < 1e-10 * energy.drive_work
    seen = solution.sample(np.linspace(0.1, 3.9, 7), *solution.catalogue.shown(Shown.PARTS))
    for axis in 'xy':
        inertia = seen[f'acceleration.disk.{axis}']
        forces = [seen[f'bearing_force.ground_disk.{x}.{axis}'] for x in ('left', 'right')]
        # Newton's law of the disk about its eccentric centre of gravity
        angle, rate, change = (seen[f'{x}.disk'] for x in ('position', 'velocity', 'acceleration'))
        c, s = np.cos(angle), np.sin(angle)
        off = {'x': -c * rate**2 - s * change, 'y': -s * rate**2 + c * change}[axis]
        weight = 10.0 * 9.81 if axis == 'y' else 0.0
        damping = 100.0 * seen[f'velocity.disk.{axis}']
        expected = 10.0 * (inertia + 2e-4 * off) + weight + damping
        assert sum(forces) == pytest.approx(expected, rel=1e-9, abs=1e-7)


def test_supports_of_two_disks_carry_what_newton_and_euler_want():
    """Sums of forces, and of moments about the left support, gyroscopic ones among them."""
    machine = ms.load_scene('two_disk_rotor')
    solution = ms.simulate(machine, duration=0.05)
    seen = solution.sample(np.linspace(0.01, 0.05, 7), *solution.catalogue.shown(Shown.PARTS))
    m, diametral, polar, w = 19.2913424, 0.0793758, 0.1507136, 2000.0 * TURN / 60.0
    for axis, wheel, other, sign in (('x', np.cos, 'y', 1.0), ('y', np.sin, 'x', -1.0)):
        force, moment = 0.0, 0.0
        for disk, off, arm in (('', 35e-6, 0.325), ('second_', 46e-6, 0.675)):
            a = seen[f'acceleration.disk.{disk}{axis}'] - off * w**2 * wheel(w * seen['t'])
            push = m * a + 30.0 * seen[f'velocity.disk.{disk}{axis}']
            force, moment = force + push, moment + arm * push
            moment += diametral * seen[f'acceleration.disk.{disk}tilt_{axis}']
            moment += sign * polar * w * seen[f'velocity.disk.{disk}tilt_{other}']
        left, right = (seen[f'bearing_force.ground_disk.{x}.{axis}'] for x in ('left', 'right'))
        assert left + right == pytest.approx(force, rel=1e-9, abs=1e-7)
        assert 1.2 * right == pytest.approx(moment, rel=1e-9, abs=1e-7)


@pytest.mark.slow
def test_a_weak_motor_stays_at_the_critical_speed():
    """Sommerfeld's effect: half the torque ends below, although nothing brakes beyond."""
    ends = {}
    for share in (1.0, 0.5):
        torque = {'constant': 4.0 * share, 'per_speed': -8e-3 * share}
        machine = ms.load_scene('rotor_run_up', {'drive.torque': torque})
        seen = ms.simulate(machine, duration=30.0).sample(np.array([25.0, 30.0]), 'velocity.disk')
        ends[share] = seen['velocity.disk']
    assert ends[1.0][1] > 450.0
    assert (ends[0.5] < 350.0).all()


def test_the_drive_torque_of_a_steady_whirl_pays_for_its_damping():
    """c r^2 W^2 is lost, so the torque is c r^2 W."""
    k, c, speed = 48.0 * EI / 0.6**3, 150.0, 280.0
    orbit = Rotor(MASS, 1e-4, (k, k), (c, c)).whirl(speed)
    radius = abs(complex(orbit.x))
    machine = jeffcott(external_damping=c, speed=speed)
    solution = ms.simulate(machine, duration=6.0)
    seen = solution.sample(np.linspace(5.0, 6.0, 5), 'drive_torque')
    assert seen['drive_torque'] == pytest.approx([c * radius**2 * speed] * 5, rel=1e-6)


def test_a_shaft_is_as_stiff_as_influence_coefficients_say():
    """Random places: between supports and beyond them, on springs, equal ones and rigid ones."""
    rng = random.Random(5)
    for case in range(30):
        a, b = rng.uniform(0.05, 0.5), rng.uniform(0.05, 0.5)
        if case % 3 == 0:
            b = a
        stiff = [rng.choice([np.inf, 10.0 ** rng.uniform(4, 8)]) for _ in range(2)]
        if case % 4 == 0:
            stiff[1] = stiff[0]
        # shares of the two supports in a force at the disk, and what the bent shaft gives way
        if case % 2:
            places, shares = (-a, b), (b / (a + b), a / (a + b))
            give = float(influence_coefficients([a], a + b, EI)[0, 0])
        else:  # overhung: supports at a and a + b
            places, shares = (-a, -a - b), ((a + b) / b, -a / b)
            give = a**2 * (a + b) / (3.0 * EI)
        give += sum(s**2 / k for s, k in zip(shares, stiff, strict=True))
        bearings = [Bearing(z, k) for z, k in zip(places, stiff, strict=True)]
        K, rows = condensed(EI, bearings, [(0.0, False)])
        assert K[0, 0] == pytest.approx(1.0 / give, rel=1e-9)
        # what the supports do to the shaft: minus the force at the disk
        for row, share in zip(rows, shares, strict=True):
            assert row == pytest.approx(share / give, rel=1e-9)
        # with its slope kept, and left without a moment, it is the same
        K, _ = condensed(EI, bearings, [(0.0, True)])
        assert K[0, 0] - K[0, 1] ** 2 / K[1, 1] == pytest.approx(1.0 / give, rel=1e-8)


def disks_of_the_book(**given):
    """[V] 6.14.4: two disks on a shaft between two supports, their masses off to one side."""
    mass, polar = 7860 * math.pi * 0.25**2 / 4 * 0.05, 0.15
    second = {'along': 0.35, 'mass': mass, 'inertia': polar, 'cog': [0.0, 46e-6]}
    return made({
        'title': 'Two disks',
        'links': {'disk': {'mass': mass, 'inertia': polar, 'cog': 35e-6}},
        'joints': {'shaft': {
            'rotor': ['ground', 'disk'],
            'supports': {'left': {'along': -0.325}, 'right': {'along': 0.875}},
            'shaft': {'diameter': 0.05, 'youngs_modulus': 200e9},
            'disks': {'second': second | given},
            'external_damping': given.get('external_damping', 0.0),
        }},
        'drive': {'coordinate': 'disk', 'speed': 100.0, 'start_angle': 0.0},
        'gravity': [0.0, 0.0],
    }, 'book'), mass  # fmt: skip


def test_phases_over_speeds_are_those_before_the_cosine_from_the_start():
    """The unbalance turns from its direction at the start: along x as cos(w t + that)."""
    w = np.array([60.0, 140.0])
    direction = math.radians(30.0) + 0.5 * math.pi
    turned = {'drive.start_angle': '30 deg', 'links.disk.cog': ['0 mm', '0.1 mm']}
    plain, other = (ms.load_scene('overhung_rotor', x) for x in ({}, turned))
    straight = unbalance_response(plain, [], w).amplitudes
    for sense, words in ((1.0, 'counterclockwise'), (-1.0, 'clockwise')):
        found = unbalance_response(other, [], sense * w)
        x, y = (found.amplitudes[f'position.disk.{c}'] for c in 'xy')
        assert x == pytest.approx(straight['position.disk.x'] * np.exp(1j * sense * direction))
        assert y == pytest.approx(-1j * sense * x)
        shown = response_text(found).splitlines()[-1]
        assert (
            shown == f'{words} rotation of disk; phases before cos(w t), from its start at t = 0'
        )
    for span in ('-300 rpm:300 rpm:4', '0 rpm:300 rpm:4'):
        done = run('response', 'overhung_rotor', f'--speeds={span}')
        assert done.returncode == 2
        assert 'begin above 0, or end below it for a drive that turns clockwise' in done.stderr


def test_two_disks_have_the_critical_speeds_and_whirl_of_influence_coefficients():
    """[V] eqs. 6.253 to 6.278: amplitudes and phases of both disks, dampers at each."""
    damping = 50.0
    machine, mass = disks_of_the_book(external_damping=damping)
    K = np.linalg.inv(influence_coefficients([0.325, 0.675], 1.2, shaft_rigidity(200e9, 0.05)))
    off = np.array([35e-6, 46e-6j])
    closed = DiskRotor(np.full(2, mass), off, K, damping * np.eye(2))
    assert closed.critical_speeds == pytest.approx([241.5332, 1060.8119], rel=5e-8)
    undamped, _ = disks_of_the_book()
    assert roots(undamped, 300.0) == pytest.approx(closed.critical_speeds.repeat(2), **EXACT)
    w = np.array([100.0, 241.5, 600.0, 1060.8])
    expected = closed.amplitudes(w).T
    asked = ['position.disk.x', 'position.disk.second_x', 'position.disk.second_y']
    found = unbalance_response(machine, asked, w).amplitudes
    assert found[asked[0]] == pytest.approx(expected[0], rel=1e-9)
    assert found[asked[1]] == pytest.approx(expected[1], rel=1e-9)
    assert found[asked[2]] == pytest.approx(-1j * expected[1], rel=1e-9)


def test_disks_at_both_ends_of_a_shaft_held_in_its_middle_do_not_know_of_each_other():
    """Each whirls as an overhung disk, with gyroscopic moments of its own."""
    wall = {'wall': {'along': 0.3, 'clamped': True}}
    other = {'along': 0.6, 'mass': MASS, 'inertia': 0.5 * POLAR, 'diametral_inertia': 0.06}
    machine = rotor(supports=wall, shaft=SHAFT, diametral_inertia=0.021, disks={'b': other})
    (station,) = campbell(machine, np.array([400.0]))
    found = [math.copysign(TURN * m.frequency, m.whirl) for m in station.modes]
    expected = [quartic(0.3, 0.021, POLAR, 400.0), quartic(0.3, 0.06, 0.5 * POLAR, 400.0)]
    assert np.sort(found) == pytest.approx(np.sort(np.concatenate(expected)), **EXACT)


def test_disks_on_a_rigid_shaft_are_one_body():
    """Its centre of gravity and its moments of inertia by the parallel axis theorem."""
    springs = [(-0.2, 3e5), (0.3, 5e5)]

    def machine(shift, **given):
        ends = {
            n: {'along': z - shift, 'stiffness': k}
            for n, (z, k) in zip('ab', springs, strict=True)
        }
        return rotor(supports=ends, **given)

    other = {'along': 0.25, 'mass': 2.0, 'inertia': 0.01, 'diametral_inertia': 0.005}
    two = machine(0.0, diametral_inertia=0.03, disks={'c': other})
    shift = 2.0 * 0.25 / (MASS + 2.0)
    diametral = 0.035 + MASS * 2.0 / (MASS + 2.0) * 0.25**2
    one = machine(shift, mass=MASS + 2.0, polar=POLAR + 0.01, diametral_inertia=diametral)
    assert roots(two, 300.0) == pytest.approx(roots(one, 300.0), **EXACT)


def test_a_torque_spins_all_disks():
    wall = {'wall': {'along': 0.3, 'clamped': True}}
    other = {'along': 0.6, 'mass': MASS, 'inertia': 0.5 * POLAR}
    drive = {'speed': 0.0, 'torque': {'constant': 3.0}}
    machine = rotor(supports=wall, shaft=SHAFT, off=0.0, drive=drive, disks={'b': other})
    speed = ms.simulate(machine, duration=0.5).sample(np.array([0.5]), 'velocity.disk')[
        'velocity.disk'
    ]
    assert speed == pytest.approx([3.0 * 0.5 / (1.5 * POLAR)], rel=1e-12)


def test_a_shaft_of_two_diameters_and_many_disks_is_as_stiff_as_its_deflections_say():
    a, b, stiff = 0.2, 0.5, 16.0 * EI
    # clamped at b from the disk, thick from a on: moments of a unit load, by parts
    give = a**3 / (3.0 * EI) + (b**3 - a**3) / (3.0 * stiff)
    wall = [Bearing(b, clamped=True)]
    K, _ = condensed(EI, wall, [(0.0, False)], [(a, b + 1.0, stiff)])
    assert K[0, 0] == pytest.approx(1.0 / give, rel=1e-12)
    places = np.array([0.1, 0.25, 0.4, 0.7])
    ends = [Bearing(-0.1), Bearing(0.9)]
    K, _ = condensed(EI, ends, [(z - 0.1, False) for z in places])
    assert np.linalg.inv(K) == pytest.approx(influence_coefficients(places, 1.0, EI), rel=1e-9)


GRID = range(8)


@pytest.mark.sample(3)
@pytest.mark.parametrize('seed', GRID)
def test_random_rotors(seed):
    """Energy, and harmonics against the motion itself, degenerate cases among them."""
    rng = random.Random(seed)
    even, damped = seed % 2 == 0, seed % 4 != 1
    off = 0.0 if seed == 3 else 10.0 ** rng.uniform(-5, -3)

    def pair(low, high):
        x = 10.0 ** rng.uniform(low, high)
        return [x, x] if even else [x, x * rng.uniform(0.5, 2.0)]

    ends, right = {}, rng.uniform(0.1, 0.4)
    for name, place in (('left', -(right if even else rng.uniform(0.1, 0.4))), ('right', right)):
        ends[name] = {'along': place, 'stiffness': pair(5, 6), 'mass': rng.uniform(0.5, 2.0)}
        if damped:
            ends[name]['damping'] = pair(2, 2.5)
    given = {'supports': ends, 'diametral_inertia': rng.uniform(0.5, 1.5) * POLAR}
    if seed % 3:
        given['shaft'] = {**SHAFT, 'relaxation': 1e-6 * damped}
    if damped:
        given['external_damping'] = 200.0
    speed = rng.uniform(20.0, 60.0)
    machine = rotor(speed=speed, off=off, **given)
    (station,) = campbell(machine, np.array([speed]))
    assert all(m.damping_ratio > 0.0 if damped else abs(m.damping_ratio) < 1e-9
               for m in station.modes)  # fmt: skip
    solution = ms.simulate(machine, duration=3.0)
    energy = solution.energy
    left = energy.initial + energy.drive_work - energy.dissipated - energy.final
    assert abs(left) < 1e-10 * energy.final
    seen = solution.sample(np.linspace(2.5, 3.0, 40))
    if not off:
        assert not np.any(seen['position.disk.x'])
    elif damped:
        series = harmonics(machine, [], 1).series
        for name, one in series.items():
            size = abs(one.amplitudes[0])
            slowest = min(m.frequency * m.damping_ratio for m in station.modes)
            decayed = 30.0 * math.exp(-TURN * slowest * 2.5) * size + 1e-9 * size
            assert seen[name] == pytest.approx(one(seen['t']), abs=decayed)


def test_a_rotor_shakes_a_frame_by_the_reaction_of_its_supports():
    """The momentum of disk and supports, the tilt's inertia among them, and the joint's force."""
    content = ms.load_scene('rotor_run_up').scene.model_dump(exclude_unset=True)
    mount = {'stiffness': [1e6, 1e6]}
    content['oscillators'] = {
        name: {'mass': 100.0, 'mounts': {'one': mount}, **joints}
        for name, joints in (('all', {}), ('joint', {'joints': ['ground_disk']}))
    }
    machine = made(content, 'shaken')
    motion = ms.simulate(machine, duration=0.5).motion
    t = np.linspace(0.0, 0.5, 9)
    forces = [machine.oscillator(name).take(motion)(t).force[:2] for name in ('all', 'joint')]
    damped = machine.scene.joints['ground_disk'].external_damping
    assert damped  # the air takes it from the disk: both ways count it as the ground's
    assert forces[0] == pytest.approx(forces[1], rel=1e-9, abs=1e-9)


def test_the_frame_feels_the_momentum_of_a_spinning_disk_that_tilts():
    """A second route: Newton's and Euler's laws of a body in space, for any tilt."""
    diametral, spin, arm = 0.021, 150.0, 0.2
    stiffness = {'left': (2e5, 3e5), 'right': (3e5, 2.5e5)}
    ends = {'left': -arm, 'right': 0.7 * arm}
    machine = rotor(
        drive={'torque': {'constant': 0.0}}, off=0.0, diametral_inertia=diametral,
        supports={k: {'along': z, 'stiffness': [*stiffness[k]]} for k, z in ends.items()},
    ).scene.to_document(exclude_none=True)  # fmt: skip
    machine['initial'] = {
        'position': {'disk.x': 2e-5, 'disk.tilt_x': 1e-3, 'disk.tilt_y': -5e-4},
        'velocity': {'disk': spin, 'disk.y': 0.01, 'disk.tilt_y': 0.3},
    }
    t, name = np.linspace(0.0, 0.03, 61), 'shaking_moment'
    found = ms.simulate(made(machine), duration=0.03).sample(t, name)[name]

    def moments(state):  # of the supports, about the centre; and their sum of forces
        r, axis = state[:2], state[4:7]
        force, moment = np.zeros(2), np.zeros(3)
        for key, z in ends.items():
            push = -np.array(stiffness[key]) * (r + z * axis[:2])
            force += push
            moment += np.cross(z * axis, [*push, 0.0])
        return force, moment

    def rates(_, state):  # the centre, its velocity, the axis, the moment of momentum about it
        axis, momentum = state[4:7], state[7:]
        force, moment = moments(state)
        return [*state[2:4], *(force / MASS), *(np.cross(momentum, axis) / diametral), *moment]

    axis, turning = np.array([1e-3, -5e-4, 1.0]), np.array([0.0, 0.3, 0.0])
    axis /= np.linalg.norm(axis)
    turning -= axis * (axis @ turning)
    start = [2e-5, 0.0, 0.0, 0.01, *axis,
             *(diametral * np.cross(axis, turning) + POLAR * spin * axis)]  # fmt: skip
    state = solve_ivp(rates, (0.0, 0.03), start, 'DOP853', t, rtol=1e-9, atol=1e-13).y.T
    felt = []
    for x in state:  # what changes the moment of momentum about the origin of all of it
        force, moment = moments(x)
        felt.append(-(x[0] * force[1] - x[1] * force[0] + moment[2]))
    assert found == pytest.approx(np.array(felt), abs=1e-4 * np.abs(felt).max())


@pytest.mark.parametrize(
    ('scene', 'slides', 'damped'),
    [
        ('overhung_rotor', {}, {'': 40.0}),
        ('two_disk_rotor', {}, {'': 30.0, 'second_': 30.0}),
        ('rotor_run_up', {'left': 'left_', 'right': 'right_'}, {'': 100.0}),
    ],
)
def test_the_moment_on_the_frame_is_that_of_bearings_dampers_and_drive(scene, slides, damped):
    t = np.linspace(0.0, 0.3, 61)
    names = [f'{kind}.disk.{pair}{axis}' for kind in ('position', 'velocity')
             for pair in (*damped, *slides.values()) for axis in 'xy']  # fmt: skip
    names += [f'bearing_force.ground_disk.{key}.{axis}' for key in slides for axis in 'xy']
    seen = ms.simulate(scene, duration=0.3).sample(t, 'shaking_moment', 'drive_torque', *names)

    def about_the_axis(pair, what):
        (x, y), (fx, fy) = (
            [seen[f'{n}{a}'] for a in 'xy'] for n in (f'position.disk.{pair}', what)
        )
        return x * fy - y * fx

    moment = -seen['drive_torque']
    for pair, size in damped.items():
        moment += size * about_the_axis(pair, f'velocity.disk.{pair}')
    for key, pair in slides.items():
        moment -= about_the_axis(pair, f'bearing_force.ground_disk.{key}.')
    assert np.abs(moment).max() > 1e-3
    assert seen['shaking_moment'] == pytest.approx(moment, rel=1e-9, abs=1e-12)


WRONG = {
    'supports': ({'supports': {}}, 'supports is missing'),
    'soft only along x': ({'supports': {'a': {'stiffness': [1e5, 0.0]}}}, 'do not hold'),
    'one spring under a rotor that tilts': (
        {'supports': {'a': {'stiffness': 1e5}}, 'diametral_inertia': 0.03}, 'do not hold'),
    'one hinge': ({'supports': {'a': {'along': 0.2}}, 'shaft': SHAFT}, 'do not hold'),
    'a ball': (
        {'supports': {'a': {'stiffness': 1e5}}, 'diametral_inertia': 0.01}, 'at least half'),
    'no shaft': ({'supports': {'a': {}}}, "needs a 'stiffness'"),
    'a damper without mass': (
        {'supports': {'a': {'along': 0.1, 'stiffness': 1e5, 'damping': 1.0},
                      'b': {'along': -0.1}}, 'shaft': SHAFT}, "needs a 'mass'"),
    'twice at one place': (
        {'supports': {'a': {'along': 0.1}, 'b': {'along': 0.1}}, 'shaft': SHAFT}, 'at one place'),
    'clearance': (
        {'supports': {'a': {'stiffness': 1e5}}, 'clearance': {'radial': 1e-4, 'restitution': 1}},
        'clearance'),
    'a tilt without inertia': (
        {'supports': {'a': {'along': 0.1, 'stiffness': 1e5, 'damping': 1.0},
                      'b': {'along': -0.1, 'stiffness': 1e5}}}, 'diametral_inertia is missing'),
    'two disks of a name': (
        {'supports': {'a': {'along': 0.1, 'clamped': True}}, 'shaft': SHAFT,
         'disks': {'a': {'along': 0.2, 'mass': 1.0}}}, 'no other disk or support has it'),
    'two disks at one place': (
        {'supports': {'a': {'along': 0.1, 'clamped': True}}, 'shaft': SHAFT,
         'disks': {'b': {'along': 0.0, 'mass': 1.0}}}, 'at one place'),
    'a further disk that tilts nothing': (
        {'supports': {'a': {'along': 0.1, 'stiffness': 1e5}, 'b': {'stiffness': 1e5}},
         'disks': {'c': {'along': 0.2, 'mass': 1.0}}}, 'further disks on a rigid shaft'),
    'sections that overlap': (
        {'supports': {'a': {'along': 0.1, 'clamped': True}}, 'shaft': {**SHAFT, 'sections': {
            'p': {'begin': 0.0, 'end': 0.05, 'diameter': D},
            'q': {'begin': 0.04, 'end': 0.08, 'diameter': D}}}}, 'within the section p'),
    'unknown material': (
        {'supports': {'a': {'along': 0.1, 'clamped': True}},
         'shaft': {'diameter': D, 'material': 'cheese'}}, 'youngs_modulus'),
}  # fmt: skip


@pytest.mark.parametrize('case', WRONG)
def test_what_is_no_rotor_is_refused(case):
    given, says = WRONG[case]
    with pytest.raises((InputError, ValueError), match=says):
        rotor(**given)


def test_a_rotor_without_geometry_has_the_same_modes_everywhere():
    """Parallel supports at one place, or two that share their stiffness."""
    whole = rotor(supports={'a': {'stiffness': [2e5, 3e5]}})
    half = {'stiffness': [1e5, 1.5e5]}
    split = rotor(supports={'a': {'along': -0.1, **half}, 'b': {'along': 0.1, **half}})
    expected = [math.sqrt(k / MASS) for k in (2e5, 3e5)]
    for machine in (whole, split):
        assert [TURN * m.frequency for m in modes(machine)] == pytest.approx(expected, **EXACT)


def test_a_rigid_machine_has_no_shafts_that_give_way():
    rigid = ms.load_scene('overhung_rotor').rigid
    assert not rigid.plan.ideal.having(Rotor)
    assert not rigid.torque_driven


@pytest.mark.slow
def test_a_crank_on_supports_that_give_way_must_turn_as_on_rigid_ones():
    supports = {'both': {'stiffness': '10 N/um'}}
    crank = {'rotor': ['ground', 'crank'], 'supports': supports}
    content = ms.load_scene('slider_crank').scene.model_dump(exclude_unset=True)
    content['joints'] = content['joints'] | {'ground_crank': crank}
    machine = made(content, 'crank')
    assert check(machine).level == 'smooth dynamics'
    content['links']['rod']['length'] = 0.045  # shorter than the crank
    content['guess'] = {'rod': 0.0, 'piston': 0.09}
    short = made(content, 'short')
    rigid = ms.load_scene('slider_crank').scene.model_dump(exclude_unset=True)['joints']
    content['joints'] = content['joints'] | {'ground_crank': rigid['ground_crank']}
    limits = [check(machine).limits[0].partition(':')[0] for machine in (short, made(content))]
    assert limits[0] == limits[1]
    with pytest.raises(InputError, match='cannot follow its drive to crank'):
        ms.simulate(short, revolutions=1)


def test_a_mode_of_a_rotor_at_rest_has_no_sense_of_whirl():
    found = modes(overhung())
    assert [mode.whirl for mode in found] == [None] * 4
    # both axes alike: of two modes of the same frequency one is along x, one along y
    for mode, axis in zip(found, 'xyxy', strict=True):
        moving = {name for name, z in mode.shape.items() if abs(z) > 1e-9}
        assert moving == {f'disk.{axis}', f'disk.tilt_{axis}'}
