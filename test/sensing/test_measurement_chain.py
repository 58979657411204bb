"""The chain of an instrument, against state equations written down and solved apart from it."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from measured import channel, measure, motion
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag, expm
from scipy.stats import kstest

import mechanism_sim as ms
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.numerics import kernels
from mechanism_sim.numerics.modal_filter import _OPERATION, ModalFilter, add_forced, pass_through
from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.numerics.rational import Modes
from mechanism_sim.sensing import channel as sampling
from mechanism_sim.sensing.chain import (
    Amplifier,
    AntiAlias,
    Converter,
    Hum,
    Instrument,
    Integrator,
    Noise,
    Transducer,
    Trigger,
)
from mechanism_sim.sensing.channel import Channel
from mechanism_sim.sensing.point import PointOnLink

RATE = 200e3
TURN = 2.0 * np.pi

# --- the second route: every stage as its differential equation -------------------------------


def through(*stages):
    """State space (A, B, C, D) of stages in series; without any it passes its input."""
    A, B, C, D = np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    for a, b, c, d in stages:
        n = len(A)
        A = block_diag(A, a)
        A[n:, :n] = np.outer(b, C)
        B, C, D = np.append(B, b * D), np.append(d * C, c), d * D
    return A, B, C, D


def resonator(frequency, damping):
    """``y'' + 2 zeta w y' + w^2 y = w^2 u``."""
    w = TURN * frequency
    a = np.array([[0.0, w], [-w, -2.0 * damping * w]])
    return a, np.array([0.0, w]), np.array([1.0, 0.0]), 0.0


def lag(frequency):
    """``y' = w (u - y)``."""
    w = TURN * frequency
    return np.array([[-w]]), np.array([w]), np.array([1.0]), 0.0


def lead(frequency):
    """A capacitor in series: what passes is the input less what it holds."""
    a, b, c, _ = lag(frequency)
    return a, b, -c, 1.0


def integral(frequency=0.0):
    """``y' = u - w y``."""
    return np.array([[-TURN * frequency]]), np.ones(1), np.ones(1), 0.0


def low_pass(frequency, order):
    """Butterworth: resonators of damping ``sin((2 k - 1) pi / 2 n)``, and a lag if n is odd."""
    pairs = [
        resonator(frequency, math.sin((2 * k - 1) * math.pi / (2 * order)))
        for k in range(1, order // 2 + 1)
    ]
    return [*pairs, *([lag(frequency)] if order % 2 else [])]


STAGES = {
    'transducer': (
        Instrument(RATE, Transducer(natural_frequency=9e3, damping_ratio=0.02)),
        [resonator(9e3, 0.02)],
    ),
    'overdamped transducer': (
        Instrument(RATE, Transducer(natural_frequency=5e3, damping_ratio=1.5)),
        [resonator(5e3, 1.5)],
    ),
    'critical transducer': (
        Instrument(RATE, Transducer(natural_frequency=5e3, damping_ratio=1.0)),
        [resonator(5e3, 1.0)],
    ),
    'high-pass': (Instrument(RATE, amplifier=Amplifier(high_pass=500.0)), [lead(500.0)]),
    'low-pass': (Instrument(RATE, amplifier=Amplifier(low_pass=1e3)), low_pass(1e3, 2)),
    'integrator': (Instrument(RATE, quantity='velocity'), [integral()]),
    'integrator with a lower limit': (
        Instrument(RATE, quantity='velocity', integrator=Integrator(high_pass=20.0)),
        [integral(20.0)],
    ),
    'two integrators': (Instrument(RATE, quantity='displacement'), [integral()] * 2),
    'two integrators with a lower limit': (
        Instrument(RATE, quantity='displacement', integrator=Integrator(high_pass=20.0)),
        [integral(20.0)] * 2,
    ),
    'anti-alias': (
        Instrument(RATE, anti_alias=AntiAlias(frequency=1e3, order=8)),
        low_pass(1e3, 8),
    ),
    'odd anti-alias': (
        Instrument(RATE, anti_alias=AntiAlias(frequency=2e3, order=5)),
        low_pass(2e3, 5),
    ),
    'equal filters': (
        Instrument(
            RATE, amplifier=Amplifier(low_pass=1e3), anti_alias=AntiAlias(frequency=1e3, order=2)
        ),
        low_pass(1e3, 2) * 2,
    ),
    'all': (
        Instrument(
            RATE,
            Transducer(natural_frequency=42e3, damping_ratio=0.02),
            Amplifier(high_pass=300.0, high_pass_order=1, low_pass=3e3, low_pass_order=2),
            'velocity',
            Integrator(high_pass=300.0),
            AntiAlias(frequency=1e3, order=8),
        ),
        [
            resonator(42e3, 0.02),
            lead(300.0),
            *low_pass(3e3, 2),
            integral(300.0),
            *low_pass(1e3, 8),
        ],
    ),
}
stages = pytest.mark.parametrize('name', STAGES)


def times(samples):
    return np.arange(len(samples)) / RATE


def close(found, wanted, tolerance=1e-6):
    scale = np.abs(wanted).max()
    assert np.abs(found - wanted).max() < tolerance * scale


@stages
def test_the_transfer_function_is_that_of_the_equations(name):
    instrument, apart = STAGES[name]
    A, B, C, D = through(*apart)
    s = 1j * TURN * np.geomspace(0.1, 1e5, 60)
    wanted = np.array([D + C @ np.linalg.solve(x * np.eye(len(A)) - A, B) for x in s])
    found = instrument.transfer()(s)
    assert np.abs(found / wanted - 1.0).max() < 1e-9
    modes = instrument.transfer().modes()
    fractions = modes.direct[0, 0] + (
        modes.residues[0, 0] / (s[:, None] - modes.poles)
    ).sum(axis=1)  # fmt: skip
    assert np.abs(fractions - wanted).max() < 1e-6 * np.abs(wanted).max()


@stages
def test_a_step_of_acceleration(name):
    instrument, apart = STAGES[name]
    A, B, C, D = through(*apart)
    # the input as one more state, which stays 1
    whole = np.block([[A, B[:, None]], [np.zeros((1, len(A) + 1))]])
    found = measure(instrument, motion(np.ones_like, np.array([1e-4, 1.3e-3, 2e-3, 5e-3])))
    step = expm(whole / RATE)
    x = np.append(np.zeros(len(A)), 1.0)
    wanted = []
    for _ in found:
        wanted.append(C @ x[:-1] + D)
        x = step @ x
    close(found, np.array(wanted))


@stages
def test_a_jump_of_velocity(name):
    """An impulse of acceleration: what passes directly is over at once, the rest remains."""
    instrument, apart = STAGES[name]
    A, B, C, _ = through(*apart)
    jump, at = 0.3, 3
    ends = np.array([1e-4, 2e-4, 5.0321e-4, 1e-3, 4e-3])
    found = measure(instrument, motion(np.zeros_like, ends, {at: jump}))
    since = times(found) - ends[at - 1]
    x, step = expm(A * since[since > 0.0][0]) @ B * jump, expm(A / RATE)
    wanted = np.zeros(len(found))
    for k in np.flatnonzero(since > 0.0):
        wanted[k], x = C @ x, step @ x
    close(found, wanted)


@pytest.mark.sample(5)
@stages
def test_a_sine_sweep(name):
    instrument, apart = STAGES[name]
    A, B, C, D = through(*apart)

    def chirp(t):
        """From 100 Hz to 6 kHz in 3 ms."""
        return np.sin(TURN * (100.0 * t + 0.5 * 5900.0 / 3e-3 * t**2))

    found = measure(instrument, motion(chirp, np.linspace(0.0, 3e-3, 61)[1:]))
    t = times(found)
    wanted = solve_ivp(
        lambda x, z: A @ z + B * chirp(x), (0.0, t[-1]), np.zeros(len(A)), 'DOP853', t,
        rtol=1e-10, atol=1e-16,
    )  # fmt: skip
    close(found, C @ wanted.y + D * chirp(t))


@pytest.mark.sample(4)
@pytest.mark.parametrize('frequency', [30.0, 700.0, 2000.0, 9000.0])
@pytest.mark.parametrize('name', ['transducer', 'high-pass', 'low-pass', 'anti-alias', 'all'])
def test_a_steady_tone_has_the_amplitude_of_the_formula(name, frequency):
    """By the textbook's magnitudes, which no part of the program uses."""
    instrument, _ = STAGES[name]
    f = frequency
    gain = {
        'transducer': 1.0 / math.hypot(1.0 - (f / 9e3) ** 2, 0.04 * f / 9e3),
        'high-pass': (f / 500.0) / math.hypot(1.0, f / 500.0),
        'low-pass': 1.0 / math.sqrt(1.0 + (f / 1e3) ** 4),
        'anti-alias': 1.0 / math.sqrt(1.0 + (f / 1e3) ** 16),
        'all': f / 300.0 / math.hypot(1.0, f / 300.0)
        / math.sqrt((1.0 + (f / 3e3) ** 4) * (1.0 + (f / 1e3) ** 16))
        / math.hypot(1.0 - (f / 42e3) ** 2, 0.04 * f / 42e3)
        / (TURN * math.hypot(f, 300.0)),
    }[name]  # fmt: skip
    last = 0.02 + 2.0 / f
    pieces = math.ceil(2.0 * f * last)
    found = measure(
        instrument,
        motion(lambda t: np.sin(TURN * f * t), np.linspace(0.0, last, pieces + 1)[1:]),
    )
    t = times(found)
    steady = t >= last - 1.5 / f
    basis = np.stack([np.sin(TURN * f * t), np.cos(TURN * f * t)], axis=1)[steady]
    amplitude = np.linalg.norm(np.linalg.lstsq(basis, found[steady], rcond=None)[0])
    assert amplitude == pytest.approx(gain, rel=1e-6, abs=1e-9)


# --- what a machine's motion becomes ----------------------------------------------------------


def test_an_impact_makes_the_seismic_mass_ring():
    """``y = jump w / sqrt(1 - z^2) e^(-z w t) sin(w sqrt(1 - z^2) t)`` after a velocity jump."""
    w, z, jump = TURN * 42e3, 0.02, -0.4
    moved = motion(np.zeros_like, np.array([1e-3, 2e-3]), {1: jump})
    found = measure(Instrument(1e6, Transducer(natural_frequency=42e3, damping_ratio=0.02)), moved)
    t = np.arange(len(found)) / 1e6 - 1e-3
    damped = w * math.sqrt(1.0 - z**2)
    wanted = jump * w / math.sqrt(1.0 - z**2) * np.exp(-z * w * t) * np.sin(damped * t)
    close(found, np.where(t > 0.0, wanted, 0.0), 1e-9)


def test_an_undamped_mass_is_struck_for_half_of_its_period():
    """In resonance half a sine leaves an amplitude of ``pi^2 jump / (4 T)``, for good."""
    pulse, jump = 1e-4, 0.3
    moved = motion(np.zeros_like, np.array([1e-3, 0.3]), {1: jump})
    found = measure(
        Instrument(
            RATE, Transducer(natural_frequency=0.5 / pulse, damping_ratio=0.0), impact_pulse=pulse
        ),
        moved,
    )
    since = times(found) - 1e-3 - pulse
    wanted = 0.25 * math.pi**2 * jump / pulse * np.cos(math.pi * since / pulse)
    later = since > 0.0
    close(found[later], wanted[later], 2e-3)
    early = later & (since < 4e-3)
    close(found[early], wanted[early])


SPRING_MASS = """
title: A block on a spring, at 2 kHz
mechanism: linkage
links: {block: {mass: 1 kg, inertia: 0.1 kg m^2}}
joints: {guide: {prismatic: [ground, block]}}
springs: {spring: {between: [ground, block], stiffness: 157913670.41742973 N/m, free_length: 0 m}}
initial: {position: {block: 1 um}}
sensors:
  without: {link: block, axis: along, sample_rate: 2.7 kHz}
  with: {link: block, axis: along, sample_rate: 2.7 kHz, anti_alias: {frequency: 1 kHz, order: 8}}
"""


def tone(samples, frequency, rate):
    """Complex amplitude of a tone by least squares, and what is left beside it."""
    t = np.arange(len(samples)) / rate
    basis = np.stack([np.cos(TURN * frequency * t), np.sin(TURN * frequency * t)], axis=1)
    found, *_ = np.linalg.lstsq(basis, samples, rcond=None)
    return np.hypot(*found), np.abs(samples - basis @ found).max()


def test_without_a_filter_2_khz_sampled_at_2_7_khz_are_700_hz(tmp_path):
    file = tmp_path / 'spring.yaml'
    file.write_text(SPRING_MASS, encoding='utf-8')
    machine = ms.load_scene(str(file))
    solution = ms.simulate(machine, duration=0.1)
    samples = {}
    for name in ('without', 'with'):
        measuring = machine.channel(name)
        measuring.take(solution.motion)
        samples[name] = np.concatenate([b.samples for b in measuring.blocks(final=True)])
    amplitude = 1e-6 * (TURN * 2000.0) ** 2
    n = np.arange(len(samples['without']))
    folded = -amplitude * np.cos(TURN * 700.0 * n / 2700.0)
    assert np.abs(samples['without'] - folded).max() < 1e-8 * amplitude
    spectrum = np.abs(np.fft.rfft(samples['without'][:270]))
    assert np.argmax(spectrum) == 70  # of 10 Hz each
    settled = samples['with'][-150:]
    height, rest = tone(settled, 700.0, 2700.0)
    assert height == pytest.approx(amplitude / math.sqrt(1.0 + 2.0**16), rel=1e-6)
    assert rest < 1e-6 * height


@pytest.fixture(scope='module')
def loose():
    """The loose four-bar, its motion, and a maker of its channels."""
    machine = ms.load_scene('four_bar_clearance')
    solution = ms.simulate(machine, revolutions=3)

    def samples(instrument, link='rocker', at=0.312, name='x', **place):
        source = PointOnLink(machine.mechanism, link, at, 'across', **place)
        measuring = Channel(source, instrument, name)
        measuring.take(solution.motion)
        blocks = measuring.blocks(final=True)
        return np.concatenate([block.samples for block in blocks]), blocks

    return machine, solution, samples


@pytest.mark.parametrize('pulse', [0.0, 1e-4])
def test_velocity_is_what_integration_of_all_impacts_leaves(loose, pulse):
    """On the rocker the tangential acceleration is ``L alpha``, its integral ``L (w - w0)``."""
    _, solution, samples = loose
    found, _ = samples(Instrument(20e3, quantity='velocity', impact_pulse=pulse))
    t = np.arange(len(found)) / 20e3
    w = solution.sample(t, 'velocity.rocker')['velocity.rocker']
    wanted = 0.312 * (w - w[0])
    impacts = np.array([i.t for i in solution.impacts])
    during = ((t[:, None] > impacts) & (t[:, None] < impacts + pulse)).any(axis=1)
    assert 0 <= during.sum() < 0.2 * len(t)
    # between pulses velocity is as if impacts were instants: they carry the same impulse
    close(found[~during], wanted[~during], 1e-10)


def test_displacement_is_the_second_integral(loose):
    _, solution, samples = loose
    found, _ = samples(Instrument(20e3, quantity='displacement'))
    t = np.arange(len(found)) / 20e3
    seen = solution.sample(t, 'position.rocker', 'velocity.rocker')
    angle, w = seen['position.rocker'], seen['velocity.rocker']
    close(found, 0.312 * (angle - angle[0] - w[0] * t), 1e-8)


def test_an_impact_lasts_as_long_as_it_is_told():
    """Half a sine of height ``pi jump / (2 T)``."""
    pulse, jump, rate = 1e-4, 0.3, 1e6
    moved = motion(np.zeros_like, np.array([1e-3, 2e-3]), {1: jump})
    found = measure(Instrument(rate, impact_pulse=pulse), moved)
    t = np.arange(len(found)) / rate - 1e-3
    shape = 0.5 * math.pi * jump / pulse * np.sin(math.pi * t / pulse)
    close(found, np.where((t > 0.0) & (t < pulse), shape, 0.0), 1e-8)
    assert found.sum() / rate == pytest.approx(jump, rel=1e-3)


def test_gravity_and_the_transverse_axis_are_read_where_they_are_wanted(loose):
    machine, solution, samples = loose
    ideal = Instrument(1e3)
    plain, _ = samples(ideal)
    felt, _ = samples(ideal, gravity=True)
    t = np.arange(len(plain)) / 1e3
    angle = solution.sample(t, 'position.rocker')['position.rocker']
    close(felt - plain, 9.8145 * np.cos(angle), 1e-12)
    both, _ = samples(ideal, transverse=0.04)
    source = PointOnLink(machine.mechanism, 'rocker', 0.312, 'along')
    # 90 degrees on from `across` is back along the link
    back = -source.read(solution.motion, *solution.motion.curve.find(t))[0]
    close(both - plain, 0.04 * back, 1e-12)


def test_blocks_begin_where_the_crank_passes_the_angle(loose):
    _, solution, samples = loose
    for angle, count in ((0.0, None), (1.0, 463), (-2.0, 100)):
        _, blocks = samples(Instrument(2.7e3, trigger=Trigger(angle=angle, samples=count)))
        assert len(blocks) >= 3
        at = solution.sample([b.time for b in blocks], 'position.crank')['position.crank']
        assert np.abs(np.remainder(at - angle + 1.0, TURN) - 1.0).max() < 1e-11
        if count:
            assert {len(b.samples) for b in blocks[:-1]} == {min(count, 463)}
        t = blocks[1].time + np.arange(50) / 2.7e3
        source, _ = samples(Instrument(2.7e3))
        assert len(source) > 50
        wanted = 0.312 * solution.sample(t, 'acceleration.rocker')['acceleration.rocker']
        close(blocks[1].samples[:50], wanted, 1e-10)


# --- the converter ----------------------------------------------------------------------------


def slope(t):
    return 1000.0 * t


def test_jitter_moves_the_samples_in_time():
    moved = motion(slope, np.array([2.0]))
    jitter = 3e-6
    found = measure(Instrument(10e3, adc=Converter(jitter=jitter), noise=Noise(seed=4)), moved)
    late = found / 1000.0 - np.arange(len(found)) / 10e3
    assert late[1:].std() == pytest.approx(jitter, rel=0.02)
    assert kstest(late[1:] / jitter, 'norm').pvalue > 1e-3
    assert np.diff(found).min() > 0.0  # none overtakes another


@pytest.mark.parametrize('k', [3, 7, 14, 28, 111])
def test_a_record_that_begins_at_the_instant_of_a_sample_has_it(k):
    """0.07 s times 100 Hz are more than 7 in floats."""
    moved = motion(slope, np.array([k / 100.0, 2.0]))
    later = channel(Instrument(100.0))
    _, rest = moved.parts(1)
    later.take(rest)
    (block,) = later.blocks(final=True)
    assert block.time == k / 100.0
    whole = measure(Instrument(100.0), moved)
    assert block.samples == pytest.approx(whole[k:], rel=1e-12)


def test_the_steps_of_the_converter_leave_an_even_error():
    moved = motion(lambda t: 3.0 * np.sin(40.0 * t), np.linspace(0.0, 2.0, 81)[1:])
    found = measure(Instrument(10e3, adc=Converter(range=4.0, bits=10)), moved)
    step = 8.0 / 2**10
    error = found - 3.0 * np.sin(40.0 * np.arange(len(found)) / 10e3)
    assert np.abs(found / step - np.round(found / step)).max() < 1e-9
    assert np.abs(error).max() <= 0.5 * step * (1.0 + 1e-9)
    assert error.std() == pytest.approx(step / math.sqrt(12.0), rel=0.02)
    assert kstest(error / step + 0.5, 'uniform').statistic < 0.01


def test_what_exceeds_the_range_is_cut_and_counted():
    moved = motion(lambda t: 3.0 * np.sin(40.0 * t), np.linspace(0.0, 2.0, 81)[1:])
    measuring = channel(Instrument(10e3, adc=Converter(range=2.0, bits=8)))
    measuring.take(moved)
    blocks = measuring.blocks(final=True)
    found = np.concatenate([b.samples for b in blocks])
    true = 3.0 * np.sin(40.0 * np.arange(len(found)) / 10e3)
    step = 4.0 / 2**8
    assert (found.min(), found.max()) == (-2.0, 2.0 - step)
    nearest = step * np.round(true / step)
    beyond = (nearest > 2.0 - step) | (nearest < -2.0)
    cut = [b.overloads for b in blocks]
    assert cut == [np.sum(beyond[k : k + 256]) for k in range(0, len(true), 256)]
    assert sum(cut) > 1000


def test_noise_is_of_the_size_and_of_the_seed():
    moved = motion(np.zeros_like, np.array([2.0]))
    made = [
        measure(Instrument(10e3, noise=Noise(rms=0.5, seed=seed)), moved, name)
        for seed, name in ((1, 'a'), (1, 'a'), (2, 'a'), (1, 'b'))
    ]
    assert np.array_equal(made[0], made[1])
    for other in made[2:]:
        assert abs(np.corrcoef(made[0], other)[0, 1]) < 0.03
    assert made[0].std() == pytest.approx(0.5, rel=0.02)
    hum = measure(Instrument(10e3, noise=Noise(hum=Hum(amplitude=0.1, frequency=60.0))), moved)
    height, rest = tone(hum, 60.0, 10e3)
    assert height == pytest.approx(0.1)
    assert rest < 1e-12


# --- blocks do not depend on how the motion comes ---------------------------------------------


def pieces(whole: Motion, cuts):
    c = whole.curve
    for a, b in zip([0, *cuts], [*cuts, len(c)], strict=True):
        yield Motion(
            PiecewisePolynomial(
                c.start[a:b], c.start_low[a:b], c.duration[a:b], c.turns[a:b], c.coefficients[a:b]
            ),
            whole.modes[a:b],
            whole.approach[a:b],
            whole.torques[a:b],
        )


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(3))
def test_blocks_are_the_same_to_the_last_bit_however_the_motion_is_cut(loose, seed):
    machine, solution, _ = loose
    full = Instrument(
        20e3,
        Transducer(natural_frequency=42e3, damping_ratio=0.02),
        Amplifier(high_pass=2.0, high_pass_order=1, low_pass=1e3, low_pass_order=2),
        anti_alias=AntiAlias(frequency=1e3),
        impact_pulse=1e-4,
        adc=Converter(range=500.0, bits=12, jitter=1e-6),
        noise=Noise(rms=0.5, seed=7),
    )
    random = np.random.default_rng(seed)
    n = len(solution.motion)
    cuts = np.sort(random.choice(np.arange(1, n), 9, replace=False)).tolist()
    made = []
    for parts in ([], cuts, list(range(1, n, 37))):
        measuring = Channel(
            PointOnLink(machine.mechanism, 'coupler', 0.309, 'across', gravity=True), full, 'tip'
        )
        blocks = []
        for piece in pieces(solution.motion, parts):
            measuring.take(piece)
            blocks += measuring.blocks()
        made.append([*blocks, *measuring.blocks(final=True)])
    for other in made[1:]:
        assert len(other) == len(made[0])
        for mine, theirs in zip(made[0], other, strict=True):
            assert mine.time == theirs.time
            assert mine.overloads == theirs.overloads
            assert np.array_equal(mine.samples, theirs.samples)


@pytest.mark.parametrize('trigger', [{}, {'angle': 1.0}, {'angle': 1.0, 'samples': 300}])
def test_samples_are_the_same_to_the_last_bit_however_many_are_taken_at_once(
    loose, trigger, monkeypatch
):
    machine, solution, _ = loose
    full = Instrument(
        20e3,
        amplifier=Amplifier(low_pass=1e3),
        trigger=Trigger(**trigger) if trigger else None,
        adc=Converter(jitter=2e-5),
    )
    made = []
    for count in (sampling._TOGETHER, 37):
        monkeypatch.setattr(sampling, '_TOGETHER', count)
        measuring = Channel(
            PointOnLink(machine.mechanism, 'coupler', 0.309, 'across'), full, 'tip'
        )
        for piece in pieces(solution.motion, [len(solution.motion) // 3]):
            measuring.take(piece)
        made.append([(b.time, *b.samples) for b in measuring.blocks(final=True)])
    assert made[0] == made[1]


def test_responses_do_not_depend_on_how_many_pieces_are_taken_at_once():
    """1,300 pieces, whole and cut, to the last bit."""
    machine = ms.load_scene('four_bar_measured')
    chain = machine.scene.sensors['coupler'].chain()
    modes = PointOnLink(machine.mechanism, 'coupler', 0.309, 'across').through(chain.transfer())
    rng = np.random.default_rng(2)
    durations, steps = rng.uniform(0.0, 3e-4, 1300), rng.normal(size=(1300, 1))
    inputs = rng.normal(size=(1300, 1, 20))
    whole = ModalFilter(modes).advance(durations, inputs, steps)
    other, cuts = ModalFilter(modes), [0, 100, 612, 613, 1300]
    parts = [other.advance(durations[a:b], inputs[a:b], steps[a:b]) for a, b in pairwise(cuts)]
    for name in ('terms', 'free'):
        cut = np.concatenate([getattr(x, name) for x in parts], axis=-1)
        assert np.array_equal(cut, getattr(whole, name))
    at = rng.uniform(0.0, 1.0, (7, 1300)) * durations
    for k, (part, (a, b)) in enumerate(zip(parts, pairwise(cuts), strict=True)):
        pieces = np.repeat(np.arange(b - a), 7)
        mine = part(pieces, at[:, a:b].T.ravel())
        assert np.array_equal(mine, whole(a + pieces, at[:, a:b].T.ravel())), k


def test_responses_as_machine_code_and_as_python_have_the_same_bits(compiled_kernels):
    """Two inputs of modes slow and fast on pieces so short and so long that both ways serve."""
    rng = np.random.default_rng(5)
    poles = np.array([-3.0, -40.0 + 9e3j, -40.0 - 9e3j, -1e5 + 3e5j, -1e5 - 3e5j])
    residues = rng.normal(size=(3, 2, 5)) + 0j
    modes = Modes(poles, residues, np.zeros((3, 2)))
    durations, steps = 10.0 ** rng.uniform(-6.0, -2.5, 60), rng.normal(size=(60, 2))
    inputs = rng.normal(size=(60, 2, 12))
    inputs[7] = 0.0
    pieces = np.repeat(np.arange(60), 3)
    t = rng.uniform(0.0, 1.0, 180) * durations[pieces]

    def outputs():
        system = ModalFilter(modes)
        response = system.advance(durations, inputs, steps)
        return response(pieces, t), system.state

    for k in (pass_through, add_forced):
        k.run = k.function
    plain = outputs()
    compiled_kernels()
    assert pass_through.is_compiled
    for mine, other in zip(outputs(), plain, strict=True):
        np.testing.assert_array_equal(mine, other)


@pytest.mark.usefixtures('plain_kernels', 'compiled_kernels')
def test_a_signal_has_machine_code_of_its_own_modes_only():
    """That of events takes seconds, so that runs with few events do without."""
    for k in kernels._KERNELS:
        k.spent = 0.0
    one = np.ones((1, 1, 1), complex)
    system = ModalFilter(Modes(-one[0, 0], one, np.zeros((1, 1))))
    piece = np.ones((1, 1, 20))
    system.advance(np.ones(1), piece, np.ones((1, 1)))
    assert not pass_through.is_compiled
    count = int(2.0 * kernels.ALONE / (20 * _OPERATION))
    system.advance(np.ones(count), np.repeat(piece, count, axis=0), np.ones((count, 1)))
    assert [k for k in kernels._KERNELS if k.is_compiled] == [pass_through]


def test_many_instants_are_read_at_once(loose, monkeypatch):
    """The coefficients of all pieces are gathered once, not for every few instants."""
    machine, solution, _ = loose
    source, calls = PointOnLink(machine.mechanism, 'coupler', 0.309, 'across'), []
    locals_of = PiecewisePolynomial.locals
    monkeypatch.setattr(
        PiecewisePolynomial, 'locals', lambda *args: calls.append(args) or locals_of(*args)
    )
    segments, dt = solution.motion.curve.find(np.linspace(0.0, solution.duration, 5000))
    read = source.read(solution.motion, segments, dt)
    assert len(calls) == 1
    some = slice(1234, 1244)
    few = source.read(solution.motion, segments[some], dt[some])
    assert read[:, some] == pytest.approx(few, rel=1e-12)


def test_a_motion_of_months_in_one_step_is_not_sampled_at_10_khz():
    moved = motion(slope, np.array([1e7]))
    with pytest.raises(ms.RunError, match=r'1e\+11 samples up to t = 1e\+07 s .* sample_rate'):
        measure(Instrument(10e3), moved)
