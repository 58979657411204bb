"""The least that heyoka needs for this one mechanism: the yardstick of this package's engine.

Coupler and rocker angle, sine and cosine of the crank angle as a linear system, the contact force
in closed form with a flag s that opens and closes the gap, one event ``(1 - s) gap + s force``.
Impacts are a dozen lines of plain floats. Nothing is recorded, watched or stabilised.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import heyoka as hy
import numpy as np

from benchmarks.four_bar import LooseFourBar, Peer
from benchmarks.problem import Answer, Outcome, Run
from mechanism_sim.errors import RunError

FORCE = 1e-6  #: [m/N] what a force counts beside a gap in the event
NOT_ZERO = 1e-300  #: an event that is exactly zero where a step starts never fires
STEPS = 10_000  #: of one arc, far more than any needs


class BareLoop:
    """The integrator and what is done at events.

    Parameters
    ----------
    four_bar : the mechanism
    tol : of heyoka
    kept : where the steps go, as start, length and coefficients; nowhere if not given
    """

    def __init__(
        self,
        four_bar: LooseFourBar,
        tol: float,
        recording: list[tuple[float, float, Answer]] | None = None,
    ) -> None:
        self._recording = recording
        self._f = f = four_bar
        (self._I3, self._I4), (moment3, moment4) = f.inertias, f.moments
        self._swing = moment3 * f.crank * f.crank_speed**2 / self._I3
        self._fall3, self._fall4 = moment3 * f.gravity / self._I3, moment4 * f.gravity / self._I4
        self._height = max(tol * (1.0 - f.restitution), 8.0 * 2.3e-16) * f.ground
        self._hair = 4.0 * math.ulp(f.ground)
        self._ta = self._integrator(tol)
        self._state, self._flag = self._ta.state, self._ta.pars

    def _integrator(self, tol: float) -> hy.taylor_adaptive_dbl:
        f = self._f
        th3, th4, w3, w4, s2, c2 = hy.make_vars('th3', 'th4', 'w3', 'w4', 's2', 'c2')
        s = hy.par[0]
        s3, c3, s4, c4 = hy.sin(th3), hy.cos(th3), hy.sin(th4), hy.cos(th4)
        x = f.crank * c2 + f.coupler * c3 - f.rocker * c4 - f.ground
        y = f.crank * s2 + f.coupler * s3 - f.rocker * s4
        v2, v3, v4 = f.crank * f.crank_speed, f.coupler * w3, f.rocker * w4
        vx, vy = v4 * s4 - v3 * s3 - v2 * s2, v3 * c3 - v4 * c4 + v2 * c2
        k3, k4 = f.coupler * (y * c3 - x * s3), f.rocker * (y * c4 - x * s4)
        free3 = self._swing * (s2 * c3 - c2 * s3) - self._fall3 * c3
        free4 = -self._fall4 * c4
        q2, q3, q4 = v2 * f.crank_speed, v3 * w3, v4 * w4
        bend = (
            x * (q4 * c4 - q3 * c3 - q2 * c2) + y * (q4 * s4 - q3 * s3 - q2 * s2)
        )  # fmt: skip
        # (Q.Q)'' = 0 with Q'' = free part - force/c (k3^2/I3 + k4^2/I4)/c
        force = (vx * vx + vy * vy + bend + k3 * free3 - k4 * free4) / (
            k3 * k3 * (1.0 / self._I3) + k4 * k4 * (1.0 / self._I4)
        )  # over c, to be multiplied by c^2/c
        gap = (f.clearance**2 - x * x - y * y) * (0.5 / f.clearance)
        guard = (1.0 - s) * gap + (s * (FORCE * f.clearance)) * force + NOT_ZERO
        pressed = s * force
        return hy.taylor_adaptive(
            [
                (th3, w3),
                (th4, w4),
                (w3, free3 - pressed * k3 * (1.0 / self._I3)),
                (w4, free4 + pressed * k4 * (1.0 / self._I4)),
                (s2, f.crank_speed * c2),
                (c2, -f.crank_speed * s2),
            ],
            [0.0] * 6,
            pars=[0.0],
            tol=tol,
            t_events=[hy.t_event(guard, direction=hy.event_direction.negative)],
        )

    def _bearing(self, y: list[float]) -> tuple[float, float, float, float, float, float, float]:
        """Gap, normal and tangential rate, k3, k4, effective mass, gap acceleration in flight."""
        f = self._f
        th3, th4, w3, w4, s2, c2 = y
        s3, c3, s4, c4 = math.sin(th3), math.cos(th3), math.sin(th4), math.cos(th4)
        x = f.crank * c2 + f.coupler * c3 - f.rocker * c4 - f.ground
        z = f.crank * s2 + f.coupler * s3 - f.rocker * s4
        r = math.sqrt(x * x + z * z)
        x, z = x / r, z / r
        v2, v3, v4 = f.crank * f.crank_speed, f.coupler * w3, f.rocker * w4
        vx, vz = v4 * s4 - v3 * s3 - v2 * s2, v3 * c3 - v4 * c4 + v2 * c2
        k3, k4 = f.coupler * (z * c3 - x * s3), f.rocker * (z * c4 - x * s4)
        slide = vz * x - vx * z
        q2, q3, q4 = v2 * f.crank_speed, v3 * w3, v4 * w4
        bend = x * (q4 * c4 - q3 * c3 - q2 * c2) + z * (q4 * s4 - q3 * s3 - q2 * s2)
        free3 = self._swing * (s2 * c3 - c2 * s3) - self._fall3 * c3
        fall = k3 * free3 + k4 * self._fall4 * c4 + bend + slide * slide / r
        mass = 1.0 / (k3 * k3 / self._I3 + k4 * k4 / self._I4)
        return f.clearance - r, vx * x + vz * z, slide, k3, k4, mass, -fall

    def angles(self) -> Answer:
        """Coupler and rocker angle as the last run left them [rad]."""
        return np.array(self._state[:2])

    def _arc(self, first: float, end: float) -> tuple[hy.taylor_outcome, int]:
        """Integrate to the next event, or to the end [s]: the outcome, and its steps.

        The first step is not longer than `first` [s], which must not count as the end.
        """
        ta, success, steps = self._ta, hy.taylor_outcome.success, 0
        outcome = success
        if self._recording is None:
            if first < math.inf:
                outcome, _ = ta.step(min(first, end - ta.time))
                steps = 1
                if outcome == hy.taylor_outcome.time_limit and ta.time < end:
                    outcome = success
            if outcome == success:
                outcome, _, _, count, *_ = ta.propagate_until(end, max_steps=STEPS)
                steps += count
            return outcome, steps
        series, append, step = ta.tc, self._recording.append, ta.step
        while outcome == success:
            began = ta.time
            outcome, h = step(min(first, end - began), True)
            append((began, h, series.copy()))
            steps += 1
            if first < math.inf:
                first = math.inf
                if outcome == hy.taylor_outcome.time_limit and began + h < end:
                    outcome = success
        return outcome, steps

    def run(self) -> tuple[int, int]:
        """Run from the start to the end; returns steps and impacts. The state is left behind."""
        f, ta, state = self._f, self._ta, self._state
        e, I3, I4, end = f.restitution, self._I3, self._I4, f.duration
        ta.time = 0.0
        state[:] = [
            f.coupler_angle, f.rocker_angle, f.coupler_rate, f.rocker_rate,
            math.sin(f.crank_angle), math.cos(f.crank_angle),
        ]  # fmt: skip
        closed, impacts, steps = f.seated, 0, 0
        if self._recording is not None:
            self._recording.clear()
        self._flag[0] = float(closed)
        first = math.inf
        while True:
            ta.reset_cooldowns()
            outcome, count = self._arc(first, end)
            steps, first = steps + count, math.inf
            if outcome == hy.taylor_outcome.time_limit:
                return steps, impacts
            if int(outcome) != -1:
                raise RunError(f'heyoka stopped at t = {ta.time:.9g} s: {outcome}')
            y = state.tolist()
            gap, approach, _, k3, k4, mass, back = self._bearing(y)
            if closed:  # let go: to the open side by a hair, at no normal rate
                closed, impulse, push = False, mass * approach, self._hair - gap
            else:
                impacts += 1
                speed = e * approach
                closed = back < 0.0 and speed * speed <= -2.0 * back * self._height
                impulse, push = mass * approach, 0.0
                if closed:
                    push = -gap
                else:
                    impulse *= 1.0 + e
                    first = -200.0 * speed / back if back < 0.0 else math.inf
            push *= mass
            state[:4] = (
                y[0] - push * k3 / I3,
                y[1] + push * k4 / I4,
                y[2] - impulse * k3 / I3,
                y[3] + impulse * k4 / I4,
            )
            self._flag[0] = float(closed)


def prepare(four_bar: LooseFourBar, tol: float, record: bool = False) -> Run:
    """Compile; with `record` all steps are kept, which give the state at any instant."""
    loop = BareLoop(four_bar, tol, [] if record else None)

    def run() -> Callable[[], Outcome]:
        steps, impacts = loop.run()
        return lambda: Outcome(loop.angles(), steps, impacts)

    return run


PEER = Peer(
    'bare heyoka loop',
    (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13),
    'tol',
    prepare,
    'heyoka with the least for this mechanism alone: one integrator with a flag for contact, one '
    'event, impacts in plain Python, nothing recorded.',
    any_restitution=True,
)

RECORDING = Peer(
    'bare heyoka loop, steps kept',
    PEER.settings,
    'tol',
    partial(prepare, record=True),
    'The same step by step, with the polynomials of every step put into a list: what it takes to '
    'answer at any instant, as this package does.',
    any_restitution=True,
)
