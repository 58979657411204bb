"""Drake as a peer: a multibody plant in continuous time, and the bearing a system beside it.

Drake's own contacts know no pin inside a bushing and no restitution, so the bearing is a leaf
system in Python that applies its force to the plant. The force is K d (1 + lambda v/v0) for an
overlap d growing at speed v, with the number lambda(e) that gives Newton's restitution (see
`exudyn.py`); a witness function finds when the pin touches, and its event keeps the speed v0.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, hypot, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from benchmarks.four_bar import LooseFourBar, Peer
from benchmarks.peers.exudyn import damping
from benchmarks.problem import Outcome, Run, missing

FLYWHEEL = 1e9  #: [kg m^2] of the crank: its speed stays the same to 1e-10 rad/s
ACCURACY = 1e-4  #: of the error control; a smaller one costs time and changes nothing
LONGEST_STEP = 1e-3  #: [s] so that no touch is stepped over
WITNESS_ACCURACY = 1e-8  #: of the instant of touch
SLOWEST_IMPACT = 70.0  #: [m/s sqrt(N/m)] slower ones, over lambda/sqrt(K), are taken as this fast


class Arms(NamedTuple):
    """The pin, from the centre of the bushing [m], its velocity [m/s], and the arms of a force."""

    x: float
    y: float
    vx: float
    vy: float
    crank: tuple[float, float]
    coupler: tuple[float, float]
    rocker: tuple[float, float]


def arms(bar: LooseFourBar, state: list[float]) -> Arms:
    """Geometry at angles and rates of crank, coupler (relative to the crank) and rocker."""
    a, b, c, va, vb, vc = state
    b, vb = a + b, va + vb
    xa, ya = bar.crank * cos(a), bar.crank * sin(a)
    xb, yb = bar.coupler * cos(b), bar.coupler * sin(b)
    xc, yc = bar.rocker * cos(c), bar.rocker * sin(c)
    x, y = xa + xb - bar.ground - xc, ya + yb - yc
    vx, vy = yc * vc - ya * va - yb * vb, xa * va + xb * vb - xc * vc
    return Arms(x, y, vx, vy, (xa, ya), (xb, yb), (xc, yc))


def bearing(bar: LooseFourBar, stiffness: float) -> Any:
    """The leaf system that makes generalized forces out of the state of the plant."""
    from pydrake.systems.framework import (  # noqa: PLC0415 - an optional package
        LeafSystem,
        UnrestrictedUpdateEvent,
        WitnessFunctionDirection,
    )

    number = damping(bar.restitution)
    slowest = max(SLOWEST_IMPACT * number / sqrt(stiffness), 1e-9)

    class Bearing(LeafSystem):  # type: ignore[misc]
        """Force of a bushing on its pin."""

        def __init__(self) -> None:
            super().__init__()
            self.plant = self.DeclareVectorInputPort('plant', 6)
            self.DeclareVectorOutputPort('forces', 3, self.forces)
            self.DeclareDiscreteState([0.0])  # speed at the last touch
            self.touch = self.MakeWitnessFunction(
                'touch',
                WitnessFunctionDirection.kPositiveThenNonPositive,
                self.gap,
                UnrestrictedUpdateEvent(self.keep_speed),
            )

        def DoGetWitnessFunctions(self, context: Any) -> list[Any]:
            return [self.touch]

        def geometry(self, context: Any) -> Arms:
            return arms(bar, self.plant.Eval(context).tolist())

        def gap(self, context: Any) -> float:
            at = self.geometry(context)
            return bar.clearance - hypot(at.x, at.y)

        def keep_speed(self, context: Any, event: Any, state: Any) -> None:
            at = self.geometry(context)
            speed = (at.x * at.vx + at.y * at.vy) / hypot(at.x, at.y)
            state.get_mutable_discrete_state().get_mutable_vector(0).SetFromVector([speed])

        def forces(self, context: Any, output: Any) -> None:
            at = self.geometry(context)
            r = hypot(at.x, at.y)
            overlap = r - bar.clearance
            if overlap <= 0.0:
                output.SetFromVector([0.0, 0.0, 0.0])
                return
            began = max(context.get_discrete_state_vector().value()[0], slowest)
            growth = (at.x * at.vx + at.y * at.vy) / r
            force = stiffness * overlap * (1.0 + number * growth / began) / r
            on_crank, on_coupler, on_rocker = (
                force * (y * at.x - x * at.y) for x, y in (at.crank, at.coupler, at.rocker)
            )
            output.SetFromVector([on_crank + on_coupler, on_coupler, -on_rocker])

    return Bearing()


def plant(bar: LooseFourBar) -> Any:
    """The three links on their hinges, the pin cut."""
    from pydrake.math import RigidTransform  # noqa: PLC0415 - an optional package
    from pydrake.multibody.plant import MultibodyPlant  # noqa: PLC0415
    from pydrake.multibody.tree import (  # noqa: PLC0415
        FixedOffsetFrame,
        RevoluteJoint,
        RotationalInertia,
        SpatialInertia,
    )

    machine = MultibodyPlant(time_step=0.0)
    machine.mutable_gravity_field().set_gravity_vector([0.0, -bar.gravity, 0.0])

    def link(name: str, mass: float, inertia: float, cog: float, parent: Any, x: float) -> Any:
        about_cog = RotationalInertia(inertia, inertia, inertia)
        body = machine.AddRigidBody(
            name, SpatialInertia.MakeFromCentralInertia(mass, [cog, 0.0, 0.0], about_cog)
        )
        hinge = FixedOffsetFrame(f'hinge of {name}', parent, RigidTransform([x, 0.0, 0.0]))
        frame = machine.AddFrame(hinge)
        machine.AddJoint(RevoluteJoint(name, frame, body.body_frame(), [0.0, 0.0, 1.0]))
        return body.body_frame()

    world = machine.world_frame()
    crank = link('crank', bar.crank_mass, FLYWHEEL, bar.crank_cog, world, 0.0)
    link('coupler', bar.coupler_mass, bar.coupler_inertia, bar.coupler_cog, crank, bar.crank)
    link('rocker', bar.rocker_mass, bar.rocker_inertia, bar.rocker_cog, world, bar.ground)
    machine.Finalize()
    return machine


def prepare(bar: LooseFourBar, setting: float) -> Run:
    """A run with a contact of stiffness `setting` [N/m]."""
    from pydrake.systems.analysis import (  # noqa: PLC0415 - an optional package
        ResetIntegratorFromFlags,
        Simulator,
    )
    from pydrake.systems.framework import DiagramBuilder  # noqa: PLC0415

    builder = DiagramBuilder()
    machine = builder.AddSystem(plant(bar))
    joint = builder.AddSystem(bearing(bar, setting))
    builder.Connect(machine.get_state_output_port(), joint.get_input_port())
    builder.Connect(joint.get_output_port(), machine.get_applied_generalized_force_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    context.SetAccuracy(WITNESS_ACCURACY)

    def run() -> Callable[[], Outcome]:
        ResetIntegratorFromFlags(simulator, 'runge_kutta3', LONGEST_STEP)
        integrator = simulator.get_mutable_integrator()
        integrator.set_target_accuracy(ACCURACY)
        context.SetTime(0.0)
        diagram.SetDefaultContext(context)
        of_machine = machine.GetMyMutableContextFromRoot(context)
        machine.SetPositions(
            of_machine,
            [bar.crank_angle, bar.coupler_angle - bar.crank_angle, bar.rocker_angle],
        )
        machine.SetVelocities(
            of_machine,
            [bar.crank_speed, bar.coupler_rate - bar.crank_speed, bar.rocker_rate],
        )
        simulator.Initialize()
        simulator.AdvanceTo(bar.duration)
        crank, coupler, rocker = machine.GetPositions(of_machine)
        steps = integrator.get_num_steps_taken()
        return lambda: Outcome(np.array([crank + coupler, rocker]), steps)

    return run


PEER = Peer(
    'Drake',
    (1e6, 1e7, 1e8, 1e9),
    'contact stiffness [N/m]',
    prepare,
    'MultibodyPlant in continuous time, the crank a flywheel; the bearing is a LeafSystem in '
    'Python whose force gives the restitution of Newton, its touch a witness function; '
    'Runge-Kutta 3 with error control. Drake has no contact in a bushing and no restitution of '
    'its own. Tried and slower at equal error: Radau 3, implicit Euler, tighter accuracies; '
    'Runge-Kutta 5 and, from 1e8 N/m, Bogacki-Shampine 3 failed.',
    lambda: missing('pydrake'),
    any_restitution=True,
)
