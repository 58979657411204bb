"""Harmonics of periodic forces and of what they shake, against closed forms and quadratures."""

import math
import re

import numpy as np
import pytest
from builders import made
from running import run, run_json
from scipy.integrate import quad
from scipy.optimize import brentq

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.fourier import spectrum
from mechanism_sim.studies.harmonics import harmonics

TURN = 2.0 * np.pi
M, C, K = 3.0, 8.0, 2700.0
SPRING = {'stiffness': f'{K} N/m', 'damping': f'{C} N s/m'}


def answer(k, w):
    """Displacement of the mass per force in harmonics."""
    return 1.0 / (K + 1j * k * w * C - (k * w) ** 2 * M)


def shaken(force, speed=10.0, **more):
    """A mass on a spring that a force pushes along a level guide, beside a link that turns."""
    return made({
        'title': 'Shaken',
        'links': {'mass': {'mass': M}, 'wheel': {'mass': 1.0, 'inertia': 0.1}},
        'joints': {'guide': {'prismatic': ['ground', 'mass']},
                   'shaft': {'revolute': ['ground', 'wheel']}},
        'springs': {'s': {'between': ['ground', 'mass'], **SPRING,
                          'free_length': 1.0}},
        'loads': {'push': {'at': 'mass', 'force': [force, 0.0]}},
        'drive': {'coordinate': 'wheel', 'speed': speed, 'start_angle': 0.0},
        'initial': {'position': {'mass': 1.0}}, 'gravity': [0.0, 0.0], **more,
    }, 'shaken')  # fmt: skip


def test_spectrum_of_jumps_a_pulse_and_a_tone_above_the_last():
    """A square wave whose jumps no one tells, one pulse of a thousandth, and order 65 of 70."""
    k = np.arange(1, 41)
    found = spectrum(
        lambda t: np.array([
            np.sign(np.sin(t - 0.3)), np.exp(-(((t - 2.0) / 2e-3) ** 2)),
            np.cos(65.0 * t) + 0.5 * np.sin(3.0 * t),
        ]), np.linspace(0.0, TURN, 257), 40
    )  # fmt: skip
    square = np.where(k % 2, -4j / (np.pi * k), 0.0) * np.exp(-0.3j * k)
    pulse = 2e-3 / np.sqrt(np.pi) * np.exp(-((k * 1e-3) ** 2)) * np.exp(-2j * k)
    tones = np.where(k == 3, -0.5j, 0.0)
    assert np.abs(found.amplitudes - [square, pulse, tones]).max() < 1e-13
    assert found.mean == pytest.approx([0.0, 1e-3 / np.sqrt(np.pi), 0.0], abs=1e-14)
    power = np.array([1.0, 2e-3 * np.sqrt(np.pi / 2.0) / TURN, 0.625])
    power -= found.mean**2 + 0.5 * (np.abs([square, pulse, tones]) ** 2).sum(axis=1)
    assert found.rest == pytest.approx(np.sqrt(power), rel=1e-9)
    assert (np.abs(found.amplitudes - [square, pulse, tones]).max(axis=1) <= found.error).all()


def test_a_function_that_is_never_resolved_says_so():
    rng = np.random.default_rng(3)
    found = spectrum(lambda t: rng.normal(size=(1, len(t))), np.linspace(0.0, 1.0, 5), 3)
    assert found.error[0] > 1e-4


@pytest.mark.sample(1)
@pytest.mark.parametrize('phase', [0.0, 0.77])
def test_a_square_wave(phase):
    machine = shaken(f'5*sign(sin(wheel-{phase}))')
    k = np.arange(1, 42)
    force = np.where(k % 2, -1j * 20.0 / (np.pi * k), 0.0) * np.exp(-1j * k * phase)
    for order, name in enumerate(('position', 'velocity', 'acceleration')):
        series = harmonics(machine, [f'{name}.mass'], 41).series[f'{name}.mass']
        expected = force * answer(k, 10.0) * (10j * k) ** order
        assert np.abs(series.amplitudes - expected).max() < 1e-10 * np.abs(expected).max()
        high = np.arange(43.0, 200001.0, 2.0)
        rest = np.abs(20.0 / (np.pi * high) * answer(high, 10.0)) * (10.0 * high) ** order
        rest = np.sqrt((rest**2).sum() / 2.0)
        # of an acceleration nearly all of the bound is the mean square of the jumps beyond
        assert rest * (1.0 - 1e-6) <= series.rest <= 1.1 * rest
        assert 0.0 < series.error < 1e-10 * np.abs(expected).max()


def test_a_resonance_counts_only_where_it_is_excited():
    """Without damping, at 30 rad/s: order 3 of a square wave, which it has, or order 2 of 15."""
    free = {'stiffness': f'{K} N/m', 'between': ['ground', 'mass'], 'free_length': 1.0}
    machine = shaken('sign(sin(wheel))', springs={'s': free})
    with pytest.raises(InputError, match='resonance'):
        harmonics(machine, [], 3)
    few = harmonics(machine, [], 2).series['position.mass']
    assert np.isinf(few.rest)
    even = shaken('sign(sin(wheel))', speed=15.0, springs={'s': free})
    series = harmonics(even, [], 9).series['position.mass']
    k = np.arange(1, 10, 2)
    expected = -4j / (np.pi * k) / (K - (15.0 * k) ** 2 * M)
    assert series.amplitudes[::2] == pytest.approx(expected, rel=1e-10)
    assert not series.amplitudes[1::2].any()
    assert series.error < 1e-10 * abs(expected[0])
    assert series.rest < 0.01 * abs(expected[0])


def test_a_pulse_in_a_cyclic_table():
    """A triangle of 0.4 deg in a turn: all harmonics of the same size, but for its width."""
    half = np.radians(0.2)
    points = [[0, 0], [100, 0], [100.2, 7], [100.4, 0], [360, 0]]
    table = {'points': [[f'{a} deg', f'{f} N'] for a, f in points], 'cyclic': True}
    machine = shaken('pulse(wheel)', tables={'pulse': table})
    series = harmonics(machine, [], 30).series['position.mass']
    k = np.arange(1, 31)
    shape = half / np.pi * np.sinc(k * half / TURN) ** 2  # sinc(x) is sin(pi x)/(pi x)
    expected = 7.0 * shape * np.exp(-1j * k * np.radians(100.2)) * answer(k, 10.0)
    assert np.abs(series.amplitudes - expected).max() < 1e-10 * np.abs(expected).max()
    assert series.mean == pytest.approx(7.0 * half / TURN / K, rel=1e-10)


@pytest.mark.parametrize('width', [2e-4, 1e-8])
def test_a_pulse_of_a_formula_of_time(width):
    period = 0.5
    machine = shaken(f'3e3*exp(-((t-0.2)/{width})**2)', speed=0.0)
    series = harmonics(machine, [], 20, period).series['position.mass']
    k, w = np.arange(1, 21), TURN / period
    force = 6e3 / period * width * np.sqrt(np.pi) * np.exp(-((k * w * width / 2.0) ** 2))
    expected = force * np.exp(-1j * k * w * 0.2) * answer(k, w)
    assert np.abs(series.amplitudes - expected).max() < 1e-10 * np.abs(expected).max()


def two_drives(first, second):
    """Two rotors on a machine on springs; only the second is out of balance."""
    return made({
        'title': 'Two rotors',
        'links': {'machine': {'mass': 20.0}, 'a': {'mass': 1.0, 'inertia': 0.01},
                  'b': {'mass': 2.0, 'inertia': 0.01, 'cog': 5e-3}},
        'joints': {'guide': {'prismatic': ['ground', 'machine'], 'axis': '90 deg'},
                   'A': {'revolute': ['machine', 'a']}, 'B': {'revolute': ['machine', 'b']}},
        'springs': {'s': {'between': ['ground', 'machine'], 'stiffness': '20 N/mm',
                          'damping': '100 N s/m', 'free_length': 0.2}},
        'drive': {'coordinate': 'a', 'speed': first, 'start_angle': 0.0},
        'drives': {'b': {'speed': second, 'start_angle': 0.0}},
        'initial': {'position': {'machine': 0.2}}, 'gravity': [0.0, 0.0],
    }, 'two')  # fmt: skip


def test_two_drives_shake_at_their_own_harmonics():
    series = harmonics(two_drives(10.0, 650.0), [], 66).series['position.machine']
    w = 650.0
    expected = -1j * 2.0 * 5e-3 * w**2 / (2e4 + 100j * w - 23.0 * w**2)
    assert series.amplitudes[64] == pytest.approx(expected, rel=1e-10)
    assert np.abs(np.delete(series.amplitudes, 64)).max() == 0.0
    few = harmonics(two_drives(10.0, 650.0), [], 3).series['position.machine']
    assert np.abs(few.amplitudes).max() == 0.0
    assert few.rest == pytest.approx(abs(expected) / np.sqrt(2.0), rel=1e-9)


def test_a_period_holds_whole_turns_of_all_drives():
    with pytest.raises(InputError, match=r'in a turn of a, 0.62\d* s, b makes 1.2 turns') as wrong:
        harmonics(two_drives(10.0, 12.0), [], 3)
    common = float(str(wrong.value).partition("--period '")[2].partition(' s')[0])
    assert common == pytest.approx(np.pi, rel=1e-14)
    series = harmonics(two_drives(10.0, 12.0), [], 8, common).series['position.machine']
    w = 12.0
    expected = -1j * 2.0 * 5e-3 * w**2 / (2e4 + 100j * w - 23.0 * w**2)
    assert series.amplitudes[5] == pytest.approx(expected, rel=1e-10)
    with pytest.raises(InputError, match='no common period'):
        harmonics(two_drives(10.0, 10.0 * np.sqrt(2.0)), [], 3)


def test_forces_that_are_the_same_only_at_the_ends_have_another_period():
    with pytest.raises(InputError, match='are not what they were'):
        harmonics(shaken('sin(2.5*wheel)'), [], 3)


def cam_on_a_frame(mass, speed, segments):
    """A cam that moves a follower up and down, on a frame of 20 kg."""
    return made({
        'title': 'Cam on a frame',
        'links': {'ground': {}, 'cam': {'mass': 1.0, 'inertia': 1e-3},
                  'follower': {'mass': mass}},
        'joints': {'bearing': {'revolute': ['ground', 'cam']},
                   'guide': {'prismatic': ['ground', 'follower'], 'axis': '90 deg'},
                   'contact': {'cam': ['cam', 'follower'], 'follower': 'knife',
                               'base_radius': '60 mm', 'sense': 'clockwise',
                               'law': {'segments': segments}}},
        'drive': {'coordinate': 'cam', 'speed': -speed, 'start_angle': 0.0},
        'gravity': [0.0, 0.0],
        'oscillators': {'frame': {'mass': 20.0, 'mounts': {
            'm': {'at': [0.0, 0.0], 'stiffness': [3e5, 4e5], 'damping': [150.0, 200.0]}}}},
    }, 'cam')  # fmt: skip


@pytest.mark.slow
def test_a_frame_under_the_blows_of_a_cam():
    """Lift L (1 - |cos|) over half a turn: its rate jumps, and so an impulse shakes the frame."""
    mass, speed, lift = 0.4, 40.0, 8e-3
    segments = [{'from': f'{a} deg', 'to': f'{a + 90} deg', 'rise': rise, 'curve': 'half_harmonic'}
                for a, rise in ((0, lift), (90, -lift))]  # fmt: skip
    machine = cam_on_a_frame(mass, speed, segments)
    k = np.arange(1, 401)

    def part(n, wave, begin):
        ends = 0.5 * np.pi * begin, 0.5 * np.pi * (begin + 1)
        shape = lambda x: 1.0 - abs(np.cos(x))  # noqa: E731
        return quad(shape, *ends, weight=wave, wvar=n, epsabs=1e-13, limit=200)[0] / np.pi

    x = np.array([sum(part(n, 'cos', j) - 1j * part(n, 'sin', j) for j in (0, 1)) for n in k])
    force = mass * speed**2 * k**2 * lift * x
    for order, name in enumerate(('position.frame.y', 'velocity.frame.y')):
        series = harmonics(machine, [name], 30).series[name]
        expected = force / (4e5 + 200j * k * speed - 20.0 * (k * speed) ** 2)
        expected = expected * (1j * k * speed) ** order
        assert np.abs(series.amplitudes - expected[:30]).max() < 1e-9 * np.abs(expected).max()
        rest = np.sqrt((np.abs(expected[30:]) ** 2).sum() / 2.0)
        assert rest <= series.rest <= 1.5 * rest
    name = 'acceleration.frame.y'
    assert np.isinf(harmonics(machine, [name], 30).series[name].rest)


@pytest.mark.sample(1)
@pytest.mark.parametrize('curve', ['harmonic', 'cycloidal', 'polynomial_345'])
def test_a_frame_under_a_cam(curve):
    """The accelerations of the law by quadrature between its breaks, times mass and receptance."""
    mass, speed, lift = 0.4, 40.0, 8e-3
    segments = [{'from': '30 deg', 'to': '110 deg', 'rise': lift, 'curve': curve},
                {'from': '170 deg', 'to': '290 deg', 'rise': -lift, 'curve': curve}]  # fmt: skip
    machine = cam_on_a_frame(mass, speed, segments)
    shape = {
        'harmonic': lambda s: 0.5 * np.pi**2 * np.cos(np.pi * s),
        'cycloidal': lambda s: TURN * np.sin(TURN * s),
        'polynomial_345': lambda s: 60.0 * s - 180.0 * s**2 + 120.0 * s**3,
    }[curve]

    def part(n, wave, begin, width):
        def integrand(s):
            return shape(s) * wave(n * (begin + width * s))

        return quad(integrand, 0.0, 1.0, epsabs=1e-13, epsrel=1e-13, limit=200)[0]

    k = np.arange(1, 41)
    a = np.zeros(40, complex)
    for begin, width, rise in ((30, 80, lift), (170, 120, -lift)):
        turns = np.radians([begin, width])
        parts = [part(n, np.cos, *turns) - 1j * part(n, np.sin, *turns) for n in k]
        a += rise / turns[1] / np.pi * np.array(parts)
    force = -mass * speed**2 * a
    expected = force / (4e5 + 200j * k * speed - 20.0 * (k * speed) ** 2)
    series = harmonics(machine, ['position.frame.y'], 40).series['position.frame.y']
    assert np.abs(series.amplitudes - expected).max() < 1e-10 * np.abs(expected).max()
    shown = np.abs(expected) > 1e-7 * np.abs(expected).max()
    assert series.amplitudes[shown] == pytest.approx(expected[shown], rel=1e-6)
    less = harmonics(machine, ['position.frame.y'], 10).series['position.frame.y']
    tail = np.sqrt((np.abs(expected[10:]) ** 2).sum() / 2.0)
    assert tail <= less.rest <= 1.1 * tail


def test_loops_are_followed_between_their_nodes():
    """A four-bar whose rocker moves a mass by a spring: by many samples and their transform."""
    machine = made({
        'title': 'Shaken by a four-bar',
        'links': {'ground': {'points': {'o': [0.4, 0.0], 'wall': [1.5, 0.2],
                                        'far': [3.5, 0.2]}},
                  'crank': {'length': 0.1, 'mass': 0.2, 'inertia': 1e-3},
                  'coupler': {'length': 0.4, 'mass': 0.2, 'inertia': 1e-3},
                  'rocker': {'length': 0.3, 'mass': 0.2, 'inertia': 1e-3},
                  'slide': {'mass': M}},
        'joints': {'A': {'revolute': ['ground', 'crank']},
                   'B': {'revolute': ['crank.end', 'coupler']},
                   'C': {'revolute': ['coupler.end', 'rocker.end']},
                   'D': {'revolute': ['ground.o', 'rocker']},
                   'guide': {'prismatic': ['ground.wall', 'slide']}},
        'guess': {'coupler': '30 deg', 'rocker': '100 deg'},
        'springs': {'s': {'between': ['rocker.end', 'slide'], 'stiffness': f'{K} N/m',
                          'free_length': 0.7},
                    'g': {'between': ['ground.far', 'slide'], **SPRING,
                          'free_length': 1.0}},
        'drive': {'coordinate': 'crank', 'speed': 9.0, 'start_angle': 0.0},
        'initial': {'position': {'slide': 0.3}}, 'gravity': [0.0, 0.0],
    }, 'driven')  # fmt: skip
    with pytest.raises(InputError, match='not what they were'):
        harmonics(machine, [], 3, 0.5)
    series = harmonics(machine, ['position.slide'], 12).series['position.slide']

    def pull(turn, x):
        """On the slide, by the intersection of the circles of coupler and rocker."""
        pin, far = 0.1 * np.exp(1j * turn), 0.4
        d = abs(far - pin)
        along = (0.4**2 - 0.3**2 + d**2) / (2.0 * d)
        end = pin + (far - pin) / d * (along + 1j * np.sqrt(0.4**2 - along**2))
        dx, dy = end.real - (1.5 + x), end.imag - 0.2
        length = np.sqrt(dx**2 + dy**2)
        return K * (length - 0.7) * dx / length + K * (1.0 - x)

    place = brentq(lambda x: pull(np.zeros(1), x)[0], 0.0, 1.0, xtol=1e-15)
    h = 1e-5
    slope = (pull(np.zeros(1), place - h) - pull(np.zeros(1), place + h))[0] / (2.0 * h)
    samples = np.fft.rfft(pull(TURN * np.arange(2048) / 2048, place)) / 1024
    k = np.arange(1, 13)
    expected = samples[1:13] / (slope + 9j * k * C - (9.0 * k) ** 2 * M)
    assert np.abs(series.amplitudes - expected).max() < 1e-8 * np.abs(expected).max()
    assert series.mean == pytest.approx(0.5 * samples[0].real / slope, rel=1e-8)
    assert series.rest < 1e-3 * np.abs(series.amplitudes[0])


def test_text_and_json_say_what_is_left_out():
    found = run_json('response', 'four_bar_on_frame', 'position.frame.y', '--harmonics', '2')
    all_of = run_json('response', 'four_bar_on_frame', 'position.frame.y', '--harmonics', '60')
    a = np.array(all_of['amplitude']['position.frame.y'])
    tail = np.sqrt((a[2:] ** 2).sum() / 2.0)
    assert tail <= found['remainder']['position.frame.y'] <= 1.01 * tail
    assert found['error']['position.frame.y'] < 1e-9 * a[0]
    text = run('response', 'four_bar_on_frame', 'position.frame.y', '--harmonics', '2').stdout
    assert f'<= {found["remainder"]["position.frame.y"]:.3g}  ' in text
    assert '\nabove 2 ' in text


def test_a_drive_that_changes_its_speed_has_no_harmonics():
    profile = {'coordinate': 'wheel', 'profile': {'points': [[0.0, 10.0], [1.0, 20.0]]}}
    with pytest.raises(InputError, match='wheel does not turn at a steady speed'):
        harmonics(shaken('sin(wheel)', drive=profile), [], 3)


def test_play_is_no_prescribed_motion():
    with pytest.raises(InputError, match='joints count as without play here'):
        harmonics(ms.load_scene('four_bar_clearance'), [], 3)


def test_harmonics_of_a_prescribed_motion_are_measures_of_a_cycle():
    """The measure named gives those of x = r cos + sqrt(l^2 - r^2 sin^2), by quadrature."""
    with pytest.raises(InputError) as refused:
        harmonics(ms.load_scene('slider_crank'), ['acceleration.piston'], 5)
    text = re.search(r"--measure '(.*)'", str(refused.value))[1]
    (found,) = ms.measure(ms.simulate('slider_crank', revolutions=1), text)
    r, rod, speed, turn = 0.05, 0.2, 20.0 * math.pi, np.arange(512) * math.pi / 256.0
    place = r * np.cos(turn) + np.sqrt(rod**2 - (r * np.sin(turn)) ** 2)
    right = -((2.0 * speed) ** 2) * 2.0 * np.mean(place * np.cos(2.0 * turn))
    assert found.value == pytest.approx(right, rel=1e-10)
