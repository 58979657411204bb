"""The thesis's accelerometer on the coupler: what its chain shows of motion and impacts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from benchmarks.problem import Answer
from benchmarks.stages import State, connect_in_series, lead, low_pass, resonator
from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.numerics.polynomials import chebyshev_nodes, fit_powers, shift_powers
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine, load_scene
from mechanism_sim.sensing.chain import Converter, Instrument, Noise
from mechanism_sim.sensing.channel import SensorSource

SCENE, SENSOR = 'four_bar_measured', 'coupler'
COUNT, STEP, TERMS = 14, 1e-5, 34
"""Nodes of the input, step [s] and terms of the power series of the reference: in one step the
fastest stage, of 42 kHz, comes to ``2.6^34 / 34! < 1e-20``."""


@dataclass(frozen=True)
class SensorRun:
    """A run whose motion is known, and the analogue chain of a sensor on it.

    Parameters
    ----------
    revolutions : of the crank
    """

    revolutions: int

    @cached_property
    def machine(self) -> Machine:
        """The scene."""
        return load_scene(SCENE)

    @cached_property
    def motion(self) -> Motion:
        """Motion of all links."""
        return simulate(self.machine, revolutions=self.revolutions).motion

    @property
    def instrument(self) -> Instrument:
        """The chain up to the converter, which takes samples from the start of the run on."""
        chain = self.machine.scene.sensors[SENSOR].chain()
        return replace(chain, trigger=None, adc=Converter(), noise=Noise())

    @property
    def times(self) -> Array:
        """Times of the samples [s]."""
        rate = self.instrument.sample_rate
        return np.arange(np.ceil(self.motion.curve.end * rate)) / rate

    def source(self) -> SensorSource:
        """Source of the sensor: the point on which it is mounted."""
        return self.machine.scene.sensors[SENSOR].source(self.machine)

    def acceleration(self, t: Array) -> Array:
        """Reading of an ideal sensor at times (N,) [s]: (N,) [m/s^2], without impacts."""
        return np.asarray(self.source().read(self.motion, *self.motion.curve.find(t))[0])

    @cached_property
    def impacts(self) -> tuple[Array, Array]:
        """Times [s] and sizes [m/s] of the steps of the velocity."""
        sizes = self.source().impulses(self.motion)[:, 0]
        struck = sizes != 0.0
        return self.motion.curve.start[struck], sizes[struck]

    @cached_property
    def state(self) -> State:
        """The chain as state equations."""
        transducer, amplifier = self.instrument.transducer, self.instrument.amplifier
        natural, low = transducer.natural_frequency, amplifier.low_pass
        if not (natural and low and amplifier.high_pass):
            raise TypeError('the sensor has a transducer and an amplifier with two filters')
        return connect_in_series(
            [
                resonator(natural, transducer.damping_ratio),
                lead(amplifier.high_pass),
                *low_pass(low, amplifier.low_pass_order),
            ]
        )

    @cached_property
    def reference(self) -> Array:
        """The samples, by power series of the state equations in steps of 10 microseconds."""
        curve, (A, B, C, _) = self.motion.curve, self.state
        sizes = self.source().impulses(self.motion)[:, 0]
        t, n = self.times, len(A)
        of_samples = curve.locate(t)
        knots = np.concatenate([curve.start, t])
        pieces = np.concatenate([np.arange(len(curve)), of_samples])
        order = np.lexsort((np.arange(len(knots)), knots))  # a piece begins before it is sampled
        knots, pieces = knots[order], pieces[order]
        h = np.diff(np.append(knots, curve.end))
        dt = np.maximum(knots - curve.start[pieces], 0.0)[:, None] + h[:, None] * chebyshev_nodes(
            COUNT
        )
        steps = max(1, int(np.ceil(h.max() / STEP)))
        width = h / steps
        u = self.source().read(self.motion, pieces, dt)[0].reshape(len(knots), COUNT)
        u = fit_powers(u, float(steps))  # by powers of the number of steps
        x = np.zeros((len(knots), n + 1, n))  # from rest, and from each state without input
        x[:, 1:] = np.eye(n)
        scaled = width[:, None, None] * A.T
        for _ in range(steps):
            term, total = x, x.copy()
            for j in range(TERMS):
                term = term @ scaled
                if j < COUNT:
                    term[:, 0] += (width * u[:, j])[:, None] * B
                term /= j + 1.0
                total += term
            x, u = total, shift_powers(u, np.ones(len(u)))
        begins = np.where(order < len(curve), sizes[pieces], 0.0)
        state, shown = np.zeros(n), []
        for (forced, *free), jump in zip(x, begins, strict=True):
            state = state + jump * B
            shown.append(C @ state)
            state = forced + state @ np.array(free)
        found = np.array(shown)
        # at impacts as after them, what passes directly is none: D is zero
        return found[order >= len(curve)]

    def error(self, answer: Answer) -> float:
        """Largest error of a sample [m/s^2]."""
        return float(np.abs(answer - self.reference).max())
