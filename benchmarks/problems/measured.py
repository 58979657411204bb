"""The accelerometer of the thesis on a loose four-bar: samples behind its filters.

The motion is known and the same for all, polynomials and impacts; only measuring it is timed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.polynomial.polynomial import polyval
from scipy.integrate import solve_ivp
from scipy.signal import bilinear_zpk, lsim, sosfilt, zpk2sos

from benchmarks.accelerometer_chain import SENSOR, SensorRun
from benchmarks.problem import OURS, Method, Outcome, Problem, Run, run_once
from mechanism_sim.arrays import Array
from mechanism_sim.errors import RunError
from mechanism_sim.numerics.polynomials import Nodes, chebyshev_nodes, fit_powers
from mechanism_sim.sensing.channel import Channel

RUN = SensorRun(20)
NODES = Nodes(tuple(chebyshev_nodes(14).tolist()))


def run_samples(measure: Callable[[], Array]) -> Run:
    """A run whose answer are the samples."""
    return run_once(lambda: Outcome(measure()))


def ours(_: float) -> Run:
    """The channel that nodes, sweeps and the library use; and the motion, once for all."""
    motion = RUN.motion

    def measure() -> Array:
        channel = Channel(RUN.source(), RUN.instrument, SENSOR)
        channel.take(motion)
        return np.concatenate([block.samples for block in channel.blocks(final=True)])

    return run_samples(measure)


def oversample(factor: float, pulses: bool) -> tuple[Array, Array]:
    """Ideal acceleration at a multiple of the rate, and its times [s].

    With pulses, the two samples about each impact share its area, so that its instant is kept.
    """
    rate = factor * RUN.instrument.sample_rate
    t = np.arange(len(RUN.times) * int(factor)) / rate
    t = t[t < RUN.motion.curve.end]
    u = RUN.acceleration(t)
    if pulses:
        at, sizes = RUN.impacts
        before = np.minimum((at * rate).astype(int), len(u) - 2)
        later = at * rate - before
        np.add.at(u, before, sizes * rate * (1.0 - later))
        np.add.at(u, before + 1, sizes * rate * later)
    return u, t


def run_sosfilt(pulses: bool, factor: float) -> Run:
    """`sosfilt` with the chain made digital by the bilinear transform, by factor of the rate."""
    chain = RUN.instrument.transfer()
    rate = factor * RUN.instrument.sample_rate
    sections = zpk2sos(*bilinear_zpk(chain.zeros, chain.poles, chain.gain, rate))
    every = int(factor)
    return run_samples(lambda: sosfilt(sections, oversample(factor, pulses)[0])[::every])


def run_lsim(factor: float) -> Run:
    """`lsim` of the state equations, straight lines between samples, by factor of the rate."""
    A, B, C, D = RUN.state

    def measure() -> Array:
        u, t = oversample(factor, pulses=True)
        _, y, _ = lsim((A, B[:, None], C[None], D), u, t)
        return np.asarray(y[:: int(factor)])

    return run_samples(measure)


def run_solve_ivp(rtol: float) -> Run:
    """`solve_ivp` from piece to piece, by tolerance.

    Raises
    ------
    RunError
        If it fails.
    """
    A, B, C, _ = RUN.state
    curve, times, every = RUN.motion.curve, RUN.times, np.arange(len(RUN.motion))

    def measure() -> Array:
        source = RUN.source()
        steps = source.impulses(RUN.motion)[:, 0]
        u = source.read(RUN.motion, every, NODES)[0].reshape(len(every), -1)
        powers = fit_powers(u, 1.0)
        x, shown = np.zeros(len(A)), []
        for start, h, c, step in zip(curve.start, curve.duration, powers, steps, strict=True):
            due = times[np.searchsorted(times, start) : np.searchsorted(times, start + h)] - start
            solution = solve_ivp(
                lambda s, x, c=c, h=h: h * (A @ x + B * polyval(s, c)), (0.0, 1.0),
                x + step * B, 'DOP853', np.append(due / h, 1.0), rtol=rtol, atol=rtol,
            )  # fmt: skip
            if not solution.success:
                raise RunError(f'DOP853 failed: {solution.message}')
            shown.append(C @ solution.y[:, :-1])
            x = solution.y[:, -1]
        return np.concatenate(shown)

    return run_samples(measure)


FACTORS = (1.0, 4.0, 16.0, 64.0, 256.0)
OVER = 'times the sampling rate'
MEASURED = Problem(
    'measured',
    'Accelerometer of the thesis on the coupler, 20 revolutions',
    'revolution',
    RUN.revolutions,
    'm/s^2',
    'All samples, by power series of the state equations of the chain in steps of 10 microseconds '
    '(benchmarks/accelerometer_chain.py). The largest sample is 708 m/s^2.',
    RUN.error,
    (
        Method(
            OURS,
            (RUN.revolutions,),
            'revolutions',
            ours,
            'The channel of a scene: exact response to polynomials and impulses; no setting. The '
            'simulation stands in its preparation, though all methods use it.',
        ),
        Method(
            'SciPy sosfilt, no impacts',
            FACTORS,
            OVER,
            partial(run_sosfilt, False),
            'Ideal acceleration sampled at a multiple of the rate, sections by the bilinear '
            'transform, every n-th sample; impacts are not seen.',
        ),
        Method(
            'SciPy sosfilt, pulses',
            FACTORS,
            OVER,
            partial(run_sosfilt, True),
            'The same; two samples about an impact share its area, so that its instant is kept.',
        ),
        Method(
            'SciPy lsim, pulses',
            FACTORS[:4],
            OVER,
            run_lsim,
            'The same input to `lsim`, which is exact for straight lines between samples.',
        ),
        Method(
            'SciPy DOP853',
            (1e-3, 1e-6),
            'rtol',
            run_solve_ivp,
            '`solve_ivp` from piece to piece of the motion, with velocity jumps put in the state.',
        ),
    ),
    1e-6,
)
