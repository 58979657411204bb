"""Instruments at the ends of what can be: filters, impacts, cuts, triggers, long times."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from benchmarks.stages import (
    State,
    connect_in_series,
    integral,
    lag,
    lead,
    low_pass,
    resonator,
)
from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.numerics.polynomials import PiecewisePolynomial, exact_sum
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.mechanism import Mechanism, Prismatic
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import load_scene
from mechanism_sim.sensing.chain import (
    Amplifier,
    AntiAlias,
    Converter,
    Instrument,
    Integrator,
    Noise,
    Transducer,
    Trigger,
)
from mechanism_sim.sensing.channel import Block, Channel, LevelPassage
from mechanism_sim.sensing.point import PointOnLink
from mechanism_sim.units import QuantityValue
from test.hard.bodies import SPEED, TURN, thesis
from test.hard.case import Figure, hard_case

ROUNDING = 1e-16
RATE = 2000.0  # [Hz]
BLOCK = Mechanism(
    (Body('block', 1.0, 1.0, (0.0, 0.0)),),
    (Prismatic('guide', 'ground', 'block', (0.0, 0.0), (0.0, 0.0)),),
    (),
)


def block_motion(durations: ArrayLike, accelerations: ArrayLike, jumps: ArrayLike) -> Motion:
    """A block under an acceleration (m,) [m/s^2] in each piece, after a jump of its velocity."""
    h, a, jump = (np.asarray(x, float) for x in (durations, accelerations, jumps))
    m = len(h)
    gained = np.append(0.0, (a * h)[:-1])
    v = np.cumsum(gained + jump)
    x = np.append(0.0, np.cumsum(v * h + 0.5 * a * h * h)[:-1])
    start = np.append(0.0, np.cumsum(h)[:-1])
    curve = PiecewisePolynomial(
        start, np.zeros(m), h, np.zeros((m, 1), np.int64), np.stack([x, v, 0.5 * a], 1)[:, None]
    )
    return Motion(curve, np.zeros((m, 0), np.uint8), np.zeros((m, 0)), np.zeros((m, 0, 3)))


def samples(blocks: Iterable[Block]) -> Array:
    """Of all blocks."""
    return np.concatenate([block.samples for block in blocks])


def measure_block(instrument: Instrument, motion: Motion) -> Array:
    """All samples of the block's acceleration."""
    channel = Channel(PointOnLink(BLOCK, 'block', 0.0, 'along'), instrument, 'x')
    channel.take(motion)
    return samples(channel.blocks(final=True))


def step_response(
    stages: Sequence[State], count: int, jump: float, at: int, rate: float = RATE
) -> Array:
    """Output of stages in series for 1 m/s^2 from rest and a jump at a sample, by ``expm``."""
    A, B, C, D = connect_in_series(stages)
    n = len(A)
    step = expm(np.block([[A, B[:, None]], [np.zeros((1, n + 1))]]) / rate)
    x, out = np.append(np.zeros(n), 1.0), []
    for k in range(count):
        x[:n] += B * jump * (k == at)
        out.append(C @ x[:n] + D)
        x = step @ x
    return np.array(out)


def deviation(instrument: Instrument, stages: Sequence[State], last: float = 0.05) -> float:
    """Largest error of the answer to a push and a jump, over the largest sample."""
    rate = instrument.sample_rate
    count = round(last * rate)
    at = count // 4
    pieces = np.array([at, count // 3, count - at - count // 3]) / rate
    found = measure_block(instrument, block_motion(pieces, [1.0] * 3, [0.0, 0.3, 0.0]))
    wanted = step_response(stages, len(found), 0.3, at, rate)
    return float(np.abs(found - wanted).max() / np.abs(wanted).max())


def equal_stages(apart: float) -> list[tuple[int, Instrument, list[State]]]:
    """Chains of which m poles coincide at 100 Hz, or are a part of that apart."""
    f, g, h = 100.0, 100.0 * (1.0 + apart), 100.0 * (1.0 - apart)
    twice = [integral(f), integral(f)]
    both = Amplifier(high_pass=g, low_pass=h, low_pass_order=1)
    slow = Transducer(natural_frequency=f, damping_ratio=1.0 - apart)
    return [
        (2, Instrument(RATE, quantity='displacement', integrator=Integrator(high_pass=f)), twice),
        (
            3,
            Instrument(
                RATE,
                amplifier=Amplifier(high_pass=g),
                quantity='displacement',
                integrator=Integrator(high_pass=f),
            ),
            [lead(g), *twice],
        ),
        (
            4,
            Instrument(
                RATE, amplifier=both, quantity='displacement', integrator=Integrator(high_pass=f)
            ),
            [lead(g), lag(h), *twice],
        ),
        (
            7,
            Instrument(
                RATE,
                slow,
                both,
                'displacement',
                Integrator(high_pass=f),
                AntiAlias(frequency=f, order=1),
            ),
            [resonator(f, 1.0 - apart), lead(g), lag(h), *twice, lag(f)],
        ),
    ]


@hard_case(
    'All poles of a chain coincide, two to seven of them, or all but coincide: partial fractions '
    'do not exist, or their terms cancel.',
    'The state equations of the stages one behind the other, by a matrix exponential. m poles are '
    'moved so far that what this changes and what rounding costs are alike. A pair with others '
    'about it costs more, about 1e-6; seven, which take a critical '
    'transducer, three filters and two integrators of one frequency, more again.',
)
def coinciding_poles() -> list[Figure]:
    """Errors over the largest sample, and for exact coincidence over what is to be expected."""
    errors = np.array(
        [
            [deviation(instrument, stages) for _, instrument, stages in equal_stages(apart)]
            for apart in (0.0, *10.0 ** np.arange(-14.0, -0.9, 0.25))
        ]
    )
    return [
        *(Figure(f'error for {m} equal poles', float(e), 1e-6)
          for m, e in zip((2, 3, 4, 7), errors[0], strict=True)),
        Figure('1e-14 to 0.1 apart, up to four poles', float(errors[1:, :3].max()), 2e-6),
        Figure('1e-14 to 0.1 apart, seven poles', float(errors[1:, 3].max()), 1e-4),
    ]  # fmt: skip


@hard_case(
    'A transducer damped critically, or a hair less or more: two real poles meet and part as a '
    'pair.',
    'Its state equations, by a matrix exponential. Poles nearer than 1e-5 are moved that far, '
    'which changes the transfer function by 1e-10.',
)
def critical_transducer() -> list[Figure]:
    """Largest error over damping ratios on both sides of one."""
    apart = [0.0, *(s * 10.0**-k for k in range(1, 16) for s in (-1.0, 1.0))]
    errors = [
        deviation(
            Instrument(RATE, Transducer(natural_frequency=90.0, damping_ratio=1.0 + d)),
            [resonator(90.0, 1.0 + d)],
        )
        for d in apart
    ]
    return [Figure('largest error', max(errors), 1e-9)]


@hard_case(
    'A transducer whose natural frequency is 1e6 times the sampling rate, and one at a millionth '
    'of it: rings far between two samples, or not once in the run.',
    'Far below resonance it reads ``u`` after a push has died out, with an error of '
    '2 zeta w/wn; far above, ``wn^2`` times the displacement of the mount.',
)
def transducer_far_from_the_rate() -> list[Figure]:
    """Errors over the largest sample."""
    count, rest = 400, 50
    push = block_motion(np.array([rest, count - rest]) / RATE, [1.0, 2.0], [0.0, 0.0])
    fast = measure_block(
        Instrument(RATE, Transducer(natural_frequency=1e6 * RATE, damping_ratio=0.02)), push
    )
    wanted = np.where(np.arange(len(fast)) < rest, 1.0, 2.0)
    settled = np.arange(len(fast)) % rest > 0  # at the start of a push it has not moved yet
    slow = measure_block(
        Instrument(RATE, Transducer(natural_frequency=1e-6 * RATE, damping_ratio=0.0)), push
    )
    place = push.curve(np.arange(len(slow)) / RATE)[:, 0]
    reading = (2.0 * math.pi * 1e-6 * RATE) ** 2 * place
    # the next term of the series of a sine, -(wn t)^2/12, is what it is short of that
    short = (2.0 * math.pi * 1e-6 * RATE * count / RATE) ** 2
    return [
        Figure('error, 1e6 times the rate', float(np.abs(fast - wanted)[settled].max()), 1e-12),
        Figure(
            'error, a millionth of it, over (wn t)^2',
            float(np.abs(slow - reading).max() / reading.max() / short),
            0.1,
        ),
    ]


@hard_case(
    'Butterworth filters of order 12 with corners from 1e-4 of the sampling rate up to half of '
    'it.',
    'The same as six resonators in series, by a matrix exponential.',
)
def high_orders_and_low_corners() -> list[Figure]:
    """Largest error over the largest sample."""
    errors = []
    for corner, last in ((1e-4, 12.0), (1e-3, 3.0), (1e-2, 0.3), (0.5, 0.05)):
        f = corner * RATE
        errors.append(
            deviation(
                Instrument(RATE, anti_alias=AntiAlias(frequency=f, order=12)),
                low_pass(f, 12),
                last,
            )
        )
    return [Figure('largest error', max(errors), 1e-10)]


@hard_case(
    'Thousands of impacts in a chatter that ends, pulses much longer than the times between them, '
    'impacts exactly at sampling instants, and pieces of no length.',
    'Sums: once the last pulse is over the velocity has changed by all jumps; before that a pulse '
    'has given ``jump sin^2(pi t/2 T)``.',
)
def impacts_within_pulses() -> list[Figure]:
    """Errors of velocities over the sum of the sizes of all jumps."""
    n, pulse = 4000, 7.3e-4
    h = 1e-3 * 0.997 ** np.arange(n)
    h[100:3000:7] = 0.0
    h[:64] = 1.0 / RATE  # impacts at the samples themselves
    jumps = 0.3 * 0.998 ** np.arange(n) * np.where(np.arange(n) % 3, 1.0, -0.6)
    jumps[0] = 0.0
    h = np.append(h, 0.2)
    motion = block_motion(h, np.zeros(n + 1), np.append(jumps, 0.0))
    size, at = np.abs(jumps).sum(), motion.curve.start[:n]
    figures = []
    for T in (0.0, pulse):
        found = measure_block(Instrument(RATE, quantity='velocity', impact_pulse=T), motion)
        t = np.arange(len(found)) / RATE
        part = np.clip((t[:, None] - at) / T, 0.0, 1.0) if T else (t[:, None] >= at) * 1.0
        wanted = np.sin(0.5 * math.pi * part) ** 2 @ jumps
        name = f'pulses of {1e3 * T:g} ms' if T else 'no pulses'
        # each of n sums may round
        figures.append(
            Figure(f'velocity, {name}', float(np.abs(found - wanted).max() / size), n * ROUNDING)
        )
    figures.append(Figure('impacts within one pulse', float((at[-1] - at < pulse).sum())))
    return figures


@hard_case(
    'A displacement integrated twice without a lower limit for 1,000 s: everything that is wrong '
    'once stays for ever.',
    'The displacement of the motion itself. Both poles at zero are 1e-5 rad/s off it, so that '
    'after t the drift of a constant speed is short of (1e-5 t)^2/6.',
)
def long_double_integration() -> list[Figure]:
    """Drift of the displacement."""
    n, last = 4000, 1000.0
    h = np.full(n, last / n)
    push = block_motion(h, np.where(np.arange(n) % 2, -1.0, 1.0), np.zeros(n))
    found = measure_block(Instrument(10.0, quantity='displacement'), push)
    t = np.arange(len(found)) / 10.0
    away = np.abs(found - push.curve(t)[:, 0])
    place = float(np.abs(push.curve(t)[:, 0]).max())
    early = float(away[t <= 10.0].max())
    return [
        Figure(
            'drift over the way after 1,000 s', float(away.max()) / place, (1e-5 * last) ** 2 / 6
        ),
        Figure('error within 10 s', early, 1e-8, 'm'),
    ]


@hard_case(
    'A million revolutions later, at 1.7e5 s: the time has lost ten bits, the response must not.',
    'The same revolution at the start. A sample may lie off by the rounding of its time, 1.5e-11 '
    's, times the slope of the signal.',
)
def a_million_revolutions_later() -> list[Figure]:
    """Difference of two responses, one at the start and one later."""
    machine = load_scene('four_bar_clearance')
    motion = simulate(machine, revolutions=2).motion
    instrument = replace(
        CHAIN, trigger=Trigger(angle=1.0, samples=463), adc=Converter(), noise=Noise()
    )
    found = []
    for turns in (0, 10**6):
        c = motion.curve
        start, low = exact_sum(c.start, c.start_low, np.full(len(c), turns * TURN))
        moved = replace(c, start=start, start_low=low, turns=c.turns + turns)
        source = PointOnLink(machine.mechanism, 'coupler', 0.309, 'across')
        channel = Channel(source, instrument, 'x')
        channel.take(replace(motion, curve=moved))
        found.append(samples(channel.blocks(final=True)))
    spacing = float(np.spacing(1e6 * TURN))
    slope = 2.0 * math.pi * 1e3 * np.abs(found[0]).max()  # of what passes 1 kHz
    away = float(np.abs(found[1] - found[0]).max())
    return [
        Figure('difference over slope times rounding of time', away / (slope * spacing), 2.0),
        Figure('difference', away, unit='m/s^2'),
        Figure('largest sample', float(np.abs(found[0]).max()), unit='m/s^2'),
    ]


CHAIN = Instrument(
    2700.0,
    Transducer(natural_frequency=42e3),
    Amplifier(high_pass=2.0, high_pass_order=1, low_pass=1e3, low_pass_order=2),
    anti_alias=AntiAlias(frequency=1e3, order=8),
    impact_pulse=1e-4,
    adc=Converter(range=QuantityValue(512.0, 'm/s^2'), bits=24, jitter=1e-6),
    noise=Noise(rms=QuantityValue(0.3, 'm/s^2'), seed=1),
)


def part(motion: Motion, first: int, last: int) -> Motion:
    """Some pieces of a motion."""
    c, keep = motion.curve, slice(first, last)
    curve = PiecewisePolynomial(
        c.start[keep], c.start_low[keep], c.duration[keep], c.turns[keep], c.coefficients[keep]
    )
    return Motion(curve, motion.modes[keep], motion.approach[keep], motion.torques[keep])


@hard_case(
    'Motion comes in pieces of any size, beside other sensors or alone; not one bit of a block '
    'may depend on it, noise and jitter included.',
    'The same motion at once, alone.',
)
def cut_anywhere() -> list[Figure]:
    """Records that differ, over chains and cuts."""
    machine = thesis()
    motion = simulate(machine, revolutions=2).motion
    n, random, differ, count = len(motion), np.random.default_rng(7), 0, 0
    chains = {
        'whole': CHAIN,
        'triggered': replace(CHAIN, trigger=Trigger(angle=0.5, samples=None)),
        'twice': replace(CHAIN, quantity='displacement', adc=Converter()),
        'ideal': Instrument(2700.0),
    }

    def records(bounds: Sequence[int], names: Iterable[str]) -> dict[str, list[Block]]:
        source = {k: PointOnLink(machine.mechanism, 'coupler', 0.3, 'across') for k in names}
        channels = {k: Channel(source[k], chains[k], k) for k in source}
        found: dict[str, list[Block]] = {k: [] for k in source}
        for pair in itertools.pairwise(bounds):
            for name, channel in channels.items():
                channel.take(part(motion, *pair))
                found[name] += channel.blocks()
        return {k: found[k] + channels[k].blocks(final=True) for k in channels}

    alone = {name: records([0, n], [name])[name] for name in chains}
    cuts = [sorted({0, n, *random.integers(1, n, k)}) for k in (1, 2, 5, 20, 60, 200)]
    for bounds in ([0, n], list(range(n + 1)), *cuts):
        together = records(bounds, reversed(chains))
        for name, blocks in alone.items():
            found, count = together[name], count + 1
            differ += [(b.time, b.overloads, b.samples.tobytes()) for b in found] != [
                (b.time, b.overloads, b.samples.tobytes()) for b in blocks
            ]
    return [
        Figure('records that differ', differ, 0.0),
        Figure('records compared', count),
        Figure('pieces', n),
    ]


def passages(drive: dict[str, object], angle: float, last: float) -> Array:
    """Times at which the crank of the thesis, without loose bearings, passes an angle [s]."""
    machine = load_scene('four_bar_nominal', {'drive': drive})
    motion = simulate(machine, duration=last).motion
    index = machine.mechanism.coordinates.index(machine.plan.main)
    return np.array(LevelPassage(angle, {index: 1.0}).times(motion))


@hard_case(
    'A trigger angle that the crank has at the start, turning either way or at rest; and one that '
    'a drive passes by 1e-10 to 1e-2 rad before it turns back.',
    'Turns of a uniform drive; a parabola of one piece, passed at ``t0 -+ sqrt(2 d/alpha)``; a '
    'crank let go from rest, which by its energy comes back to where it began and no farther.',
)
def triggers_of_any_motion() -> list[Figure]:
    """Passages missed or too many, and errors of their times."""
    missed, error, away = 0, 0.0, 0.0
    for degrees in (0.0, 30.0, -71.0, 200.0):
        for speed in (SPEED, -SPEED):
            drive = {'speed': speed, 'start_angle': f'{degrees} deg'}
            found = passages(drive, math.radians(degrees), 2.5)
            wanted = np.arange(0.0, 2.5, TURN)
            missed += len(wanted) != len(found)
            error = max(error, float(np.abs(found[:15] - wanted[:15]).max()))
    rest = {'speed': 0.0, 'start_angle': '0 deg', 'torque': {'constant': 0.1}}
    missed += len(passages(rest, 0.0, 0.1)) != 1
    rocking = {'speed': 0.0, 'start_angle': '200 deg', 'torque': {'constant': 0.0}}
    up = block_motion([0.7, 0.3, 1.0], [-4.0, -4.0, -4.0], [2.0, 0.0, 0.0])  # turns back at 0.5 s
    for exponent in range(-10, -1):
        d = 10.0**exponent
        found = np.array(LevelPassage(0.5 - d, {0: 1.0}).times(up))
        missed += len(found) != 2 or len(LevelPassage(0.5 + d, {0: 1.0}).times(up))
        half = math.sqrt(0.5 * d)
        off = np.abs(found - 0.5 - half * np.array([-1.0, 1.0])).max()
        away = max(away, float(off) * half / ROUNDING)
        begin = math.radians(200.0)
        missed += len(passages(rocking, begin + d, 1.0)) != 3
        missed += len(passages(rocking, begin - d, 1.0))
    return [
        Figure('motions with passages missed or too many', missed, 0.0),
        Figure('error of the time of a uniform drive', error, 1e-13, 's'),
        Figure('error beside a turning point times its distance in time, in eps s^2', away, 10.0),
    ]
