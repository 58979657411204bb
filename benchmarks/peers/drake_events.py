"""Drake as a peer that never lets the pin leave its bushing: a hybrid system with rigid impacts.

As in Drake's own example of the rimless wheel, one leaf system holds the equations of motion, and
witness functions find the instants of impact and of the loss of contact, where events reset the
state. The equations are written here and run in Python; integrators, their error control and the
search for events are Drake's.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, sin
from typing import Any, NamedTuple

import numpy as np

from benchmarks.four_bar import LooseFourBar, Peer
from benchmarks.problem import Outcome, Run, missing

LONGEST_STEP = 1e-3  #: [s] longer trial steps of the Runge-Kutta method leave its bounds
RETURN = 300.0  #: [1/s] at which an error of the closed gap is taken back
FINEST_SEARCH = 1e-8
"""Accuracy of the search for events. A finer one does not end where a slow pin moves less than the
rounding of the gap within the interval that is sought."""

START_OF_FLIGHT = 1e-15  #: [m] by which a witness function starts on its positive side


class Motion(NamedTuple):
    """Terms of the equations at an instant; the gap is (c^2 - r^2)/(2 c), smooth at r = 0."""

    flight: tuple[float, float]  #: accelerations without contact [rad/s^2]
    row: tuple[float, float]  #: of the gap, by coupler and rocker angle [m]
    gap: float  #: [m]
    rate: float  #: [m/s]
    acceleration: float  #: of the gap without contact [m/s^2]
    mass: float  #: that the contact feels [kg]


class Bar:
    """The equations of motion of the loose four-bar in coupler and rocker angle."""

    def __init__(self, bar: LooseFourBar) -> None:
        self.bar, self.inertia, self.moment = bar, bar.inertias, bar.moments

    def at(self, t: float, state: list[float]) -> Motion:
        """Motion at angles and rates of coupler and rocker [rad, rad/s]."""
        bar, (b, c, vb, vc) = self.bar, state
        a, va = bar.crank_angle + bar.crank_speed * t, bar.crank_speed
        xa, ya = bar.crank * cos(a), bar.crank * sin(a)
        xb, yb = bar.coupler * cos(b), bar.coupler * sin(b)
        xc, yc = bar.rocker * cos(c), bar.rocker * sin(c)
        x, y = xa + xb - bar.ground - xc, ya + yb - yc  # of the pin in its bushing
        vx, vy = yc * vc - ya * va - yb * vb, xa * va + xb * vb - xc * vc
        ax = xc * vc * vc - xa * va * va - xb * vb * vb  # without angular accelerations
        ay = yc * vc * vc - ya * va * va - yb * vb * vb
        (inertia_b, inertia_c), (moment_b, moment_c) = self.inertia, self.moment
        flight_b = (
            moment_b
            / inertia_b
            * (va * va * (ya * xb - xa * yb) / bar.coupler - bar.gravity * xb / bar.coupler)
        )
        flight_c = -moment_c / inertia_c * bar.gravity * xc / bar.rocker
        size = bar.clearance
        row_b, row_c = (x * yb - y * xb) / size, (y * xc - x * yc) / size
        return Motion(
            (flight_b, flight_c),
            (row_b, row_c),
            (size * size - x * x - y * y) / (2.0 * size),
            -(x * vx + y * vy) / size,
            row_b * flight_b + row_c * flight_c - (x * ax + y * ay + vx * vx + vy * vy) / size,
            1.0 / (row_b * row_b / inertia_b + row_c * row_c / inertia_c),
        )

    def accelerate(self, push: float, now: Motion) -> tuple[float, float]:
        """Angular accelerations (rates, angles) from a force (impulse, ...) on the gap."""
        return push * now.row[0] / self.inertia[0], push * now.row[1] / self.inertia[1]

    def seated(self, t: float, state: list[float]) -> list[float]:
        """The state with the pin moved back onto its bushing."""
        b, c, *rates = state
        for _ in range(3):
            now = self.at(t, [b, c, *rates])
            db, dc = self.accelerate(now.mass * (START_OF_FLIGHT - now.gap), now)
            b, c = b + db, c + dc
        return [b, c, *rates]


def hybrid_system(bar: LooseFourBar, accuracy: float) -> Any:
    """The leaf system with continuous state (2 angles, 2 rates) and a flag: pin on its bushing."""
    from pydrake.systems.framework import (  # noqa: PLC0415 - an optional package
        LeafSystem,
        UnrestrictedUpdateEvent,
        WitnessFunctionDirection,
    )

    equations = Bar(bar)
    height = accuracy * bar.clearance  # of a bounce that is the last

    class LooseBar(LeafSystem):  # type: ignore[misc]
        """The loose four-bar."""

        def __init__(self) -> None:
            super().__init__()
            self.DeclareContinuousState(2, 2, 0)
            self.DeclareDiscreteState([float(bar.seated)])
            self.impacts = 0
            falling = WitnessFunctionDirection.kPositiveThenNonPositive
            self.hit = self.MakeWitnessFunction(
                'impact', falling, self.gap, UnrestrictedUpdateEvent(self.impact)
            )
            self.loss = self.MakeWitnessFunction(
                'loss of contact', falling, self.force, UnrestrictedUpdateEvent(self.release)
            )

        def DoGetWitnessFunctions(self, context: Any) -> list[Any]:
            return [self.loss if self.follows(context) else self.hit]

        def follows(self, context: Any) -> bool:
            return bool(context.get_discrete_state_vector().value()[0])

        def state(self, context: Any) -> list[float]:
            values: list[float] = context.get_continuous_state_vector().CopyToVector().tolist()
            return values

        def now(self, context: Any) -> Motion:
            return equations.at(context.get_time(), self.state(context))

        def gap(self, context: Any) -> float:
            return self.now(context).gap

        def force(self, context: Any) -> float:
            return -self.now(context).acceleration

        def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
            state = self.state(context)
            now = equations.at(context.get_time(), state)
            b, c = now.flight
            if self.follows(context):
                error = 2.0 * RETURN * now.rate + RETURN**2 * now.gap
                db, dc = equations.accelerate(-now.mass * (now.acceleration + error), now)
                b, c = b + db, c + dc
            derivatives.SetFromVector([state[2], state[3], b, c])

        def set(self, state: Any, values: list[float], follows: bool) -> None:
            state.get_mutable_continuous_state().SetFromVector(values)
            flag = state.get_mutable_discrete_state().get_mutable_vector(0)
            flag.SetFromVector([float(follows)])

        def impact(self, context: Any, event: Any, state: Any) -> None:
            t = context.get_time()
            b, c, vb, vc = equations.seated(t, self.state(context))
            now = equations.at(t, [b, c, vb, vc])
            last = (bar.restitution * now.rate) ** 2 < -2.0 * now.acceleration * height
            rebound = 0.0 if last else bar.restitution
            db, dc = equations.accelerate(-(1.0 + rebound) * now.mass * now.rate, now)
            self.set(state, [b, c, vb + db, vc + dc], last)
            self.impacts += 1

        def release(self, context: Any, event: Any, state: Any) -> None:
            values = equations.seated(context.get_time(), self.state(context))
            self.set(state, values, follows=False)

    return LooseBar()


def prepare(bar: LooseFourBar, setting: float) -> Run:
    """A run to the accuracy `setting` of Drake's error control and search for events."""
    from pydrake.systems.analysis import (  # noqa: PLC0415 - an optional package
        ResetIntegratorFromFlags,
        Simulator,
    )

    system = hybrid_system(bar, setting)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    context.SetAccuracy(max(setting, FINEST_SEARCH))
    start = [bar.coupler_angle, bar.rocker_angle, bar.coupler_rate, bar.rocker_rate]

    def run() -> Callable[[], Outcome]:
        ResetIntegratorFromFlags(simulator, 'runge_kutta5', LONGEST_STEP)
        integrator = simulator.get_mutable_integrator()
        integrator.set_target_accuracy(setting)
        system.SetDefaultContext(context)
        system.impacts = 0
        context.SetTime(0.0)
        context.SetContinuousState(start)
        simulator.Initialize()
        simulator.AdvanceTo(bar.duration)
        angles = context.get_continuous_state_vector().CopyToVector()[:2]
        counts = integrator.get_num_steps_taken(), system.impacts
        return lambda: Outcome(np.asarray(angles, dtype=np.float64), *counts)

    return run


PEER = Peer(
    'Drake events',
    (1e-5, 1e-6, 1e-8, 1e-10),
    'accuracy',
    prepare,
    'One LeafSystem in Python after the example of the rimless wheel: two angles, witness '
    'functions for impact and loss of contact, unrestricted updates for the resets, Runge-Kutta 5 '
    'with error control; the closed gap is held by Baumgarte terms. Tried and slower at equal '
    'error: Runge-Kutta 3, other gains. The search for events at 1e-10 does not always end.',
    lambda: missing('pydrake'),
    any_restitution=True,
)
