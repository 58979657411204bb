"""Exudyn as a peer: a sphere in a hollow one, elastic, damped so that Newton's law comes out.

Links that carry each other are kinematic trees, so nothing is left but ordinary differential
equations, unless ideal joints close loops. The force of contact is K d (1 + mu v) for an overlap d
growing at speed v: the contact law of Exudyn with mu = lambda/v0 from the speed v0 at which the
impact began. Integrated over an impact, it gives Newton's restitution e for every mass and speed
if

    lambda (1 + e) = ln((1 + lambda)/(1 - e lambda)).

Exudyn approximates lambda(e); it is given the restitution for which its formula is exact.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from math import ceil, cos, inf, log, sin, sqrt
from typing import Any

import numpy as np
from scipy.optimize import brentq

from benchmarks.four_bar import Peer
from benchmarks.problem import Answer, Outcome, Run, missing
from benchmarks.tree import Link, Tree
from mechanism_sim.errors import RunError
from mechanism_sim.planar.points import GROUND, Vector2

SLOWEST_IMPACT = 70.0  #: [m/s sqrt(N/m)] slower ones, over lambda/sqrt(K), are taken as this fast
SLOWEST_SLIP = 10.0  #: [m/s sqrt(N/m)] slower ones, over the root of the stiffness, grip less
LONGEST_STEP = 1.65  #: times the root of mass over stiffness in an impact; RK33 is stable to 1.73
LONGEST_RUN = 20.0  #: [s] of CPU time where loops are closed
LONGEST_CONSTRAINED = 1.0  #: the same where loops are closed, by the trapezoidal rule


def damping(e: float) -> float:
    """The damping number lambda of a contact force that gives back the share `e` of the speed."""
    if e >= 1.0:
        return 0.0

    def excess(number: float) -> float:
        return number * (1.0 + e) - log((1.0 + number) / (1.0 - e * number))

    return float(brentq(excess, 1e-3 * (1.0 - e), (1.0 - 1e-15) / e))


def restitution_to_give(e: float) -> float:
    """The restitution for which Exudyn's impact model 2 takes the damping of the true `e`."""

    def exudyn_damping(x: float) -> float:
        if x > 1.0 / 3.0:
            return 1.5 * (1.0 - x) * (11.0 - x) / (1.0 + 9.0 * x)
        return (1.0 - x * x) / x

    number = damping(e)
    return float(brentq(lambda x: exudyn_damping(x) - number, 1e-6, 1.0))


def prepare_machine(tree: Tree, duration: float, setting: float) -> Run:
    """A run of loose contacts of stiffness `setting` [N/m], in as many steps as that needs.

    The answer are the coordinates of the tree's mechanism.
    """
    sys.exudynFast = True  # type: ignore[attr-defined]  # its compiled core without range checks
    with redirect_stdout(sys.stderr):  # where it says so
        import exudyn as exu  # noqa: PLC0415 - an optional package
        from exudyn import itemInterface as items  # noqa: N813, PLC0415

    container = exu.SystemContainer()
    system = container.AddSystem()
    gravity = [*tree.mechanism.gravity, 0.0]
    places: dict[str, tuple[int, int]] = {}  # of a link: its object, and the number there
    numbers: dict[str, tuple[Any, int]] = {}  # its node, and the coordinate there

    def chain(links: list[Link]) -> None:
        """Links that carry each other, as one kinematic tree."""
        joints: list[Any] = []
        parents, at, turns = [], [], []
        last: dict[str, int] = {GROUND: -1}
        masses, inertias, cogs, brakes = [], [], [], []
        for link in links:
            for axis in link.axes:
                first, final = axis == link.axes[0], axis == link.axes[-1]
                parents.append(last[link.parent] if first else len(joints) - 1)
                at.append([*link.at, 0.0] if first else [0.0] * 3)
                turns.append(rotation_about_z(link.turn) if first else np.eye(3))
                joints.append(getattr(exu.JointType, axis))
                masses.append(link.mass if final else 0.0)
                inertias.append((link.inertia + link.flywheel) * np.eye(3) * final)
                cogs.append([*link.cog, 0.0])
                brakes.append(link.damping * final)
            last[link.name] = len(joints) - 1
        n = len(joints)
        node = system.AddNode(
            items.NodeGenericODE2(
                numberOfODE2Coordinates=n,
                referenceCoordinates=[0.0] * n,
                initialCoordinates=[x for link in links for x in link.start],
                initialCoordinates_t=[x for link in links for x in link.rates],
            )
        )
        body = system.AddObject(
            items.ObjectKinematicTree(
                nodeNumber=node,
                jointTypes=joints,
                linkParents=parents,
                jointTransformations=exu.Matrix3DList(turns),
                jointOffsets=exu.Vector3DList(at),
                linkInertiasCOM=exu.Matrix3DList(inertias),
                linkCOMs=exu.Vector3DList(cogs),
                linkMasses=masses,
                gravity=gravity,
                jointPositionOffsetVector=[0.0] * n,
                jointVelocityOffsetVector=[0.0] * n,
                jointPControlVector=[0.0] * n,
                jointDControlVector=brakes,
            )
        )
        places.update({link.name: (int(body), last[link.name]) for link in links})
        numbers.update({link.name: (node, last[link.name]) for link in links})

    def single(link: Link) -> None:
        """A link that neither is carried nor carries another."""
        node = system.AddNode(
            items.NodeRigidBody2D(
                referenceCoordinates=[0.0] * 3,
                initialCoordinates=list(link.start),
                initialVelocities=list(link.rates),
            )
        )
        body = system.AddObject(
            items.ObjectRigidBody2D(
                nodeNumber=node,
                physicsMass=link.mass,
                physicsInertia=link.inertia + link.flywheel,
            )
        )
        system.AddLoad(
            items.LoadMassProportional(
                markerNumber=system.AddMarker(items.MarkerBodyMass(bodyNumber=body)),
                loadVector=gravity,
            )
        )
        places[link.name] = int(body), -1
        numbers[link.name] = node, 2

    roots: dict[str, list[Link]] = {}
    root = {GROUND: ''}
    for link in tree.links.values():
        root[link.name] = root[link.parent] or link.name
        roots.setdefault(root[link.name], []).append(link)
    for links in roots.values():
        if len(links) == 1 and len(links[0].axes) > 1 and not links[0].damping:
            single(links[0])
        else:
            chain(links)
    ground = system.AddObject(items.ObjectGround())

    def marker(link: str, point: Vector2) -> int:
        local = [*point, 0.0]
        body, number = places.get(link, (ground, -1))
        if number < 0:
            rigid = items.MarkerBodyRigid(bodyNumber=body, localPosition=local)
        else:
            rigid = items.MarkerKinematicTreeRigid(
                objectNumber=body, linkNumber=number, localPosition=local
            )
        return int(system.AddMarker(rigid))

    for pin, play in tree.loose.items():
        radius = play.pin_radius or play.radial  # without friction only their difference counts
        number = damping(play.restitution)
        system.AddObject(
            items.ObjectContactSphereSphere(
                markerNumbers=list(map(marker, pin.links, pin.points)),
                nodeNumber=system.AddNode(
                    items.NodeGenericData(initialCoordinates=[0.0] * 4, numberOfDataCoordinates=4)
                ),
                spheresRadii=[radius, radius + play.radial],
                isHollowSphere1=True,
                dynamicFriction=play.friction,
                frictionProportionalZone=SLOWEST_SLIP / sqrt(setting),
                contactStiffness=setting,
                restitutionCoefficient=restitution_to_give(play.restitution),
                minimumImpactVelocity=SLOWEST_IMPACT * number / sqrt(setting),
                impactModel=2,
            )
        )
    closing = [pin for pin in tree.pins if not pin.play]
    for pin in closing:
        system.AddObject(
            items.ObjectJointSpherical(
                markerNumbers=list(map(marker, pin.links, pin.points)),
                constrainedAxes=[1, 1, 0],
            )
        )

    def before_step(*_: Any) -> bool:
        """Set the forces along guides; whether to go on."""
        for link, (angles, force) in tree.pushes.items():
            at = np.array([coordinate(*numbers[name]) for name in angles])
            body, number = places[link]
            forces = [0.0] * (number + 1)
            (forces[number],) = force(at)
            system.SetObjectParameter(body, 'jointForceVector', forces)
        return time.process_time() < deadline

    def coordinate(node: Any, number: int) -> float:
        return float(system.GetNodeOutput(node, exu.OutputVariableType.Coordinates)[number])

    deadline = inf
    if tree.pushes or closing:  # where loops are closed, its iterations can take for ever
        system.SetPreStepUserFunction(before_step)
    system.Assemble()

    longest = LONGEST_CONSTRAINED if closing else LONGEST_STEP
    steps = ceil(duration * sqrt(setting / tree.lightest) / longest)
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = steps
    settings.timeIntegration.endTime = duration
    settings.timeIntegration.automaticStepSize = False
    settings.timeIntegration.minimumStepSize = 1e-25  # what rounding leaves for the last step
    settings.timeIntegration.explicit.computeEndOfStepAccelerations = False
    settings.timeIntegration.explicit.computeMassMatrixInversePerBody = True
    settings.solution.file.write = False
    settings.solution.sensors.active = False
    kinds = exu.DynamicSolverType
    solver = kinds.TrapezoidalIndex2 if closing else kinds.RK33  # nothing explicit closes loops
    order = [link for links in roots.values() for link in links]

    def run() -> Callable[[], Outcome]:
        nonlocal deadline
        deadline = time.process_time() + LONGEST_RUN
        try:
            system.SolveDynamic(settings, solverType=solver)
        except exu.SolverError as error:
            raise RunError(f'{error} at {setting:g} N/m') from error
        if time.process_time() >= deadline:
            raise RunError(f'stopped after {LONGEST_RUN:g} s at {setting:g} N/m')
        left = iter(system.systemData.GetODE2Coordinates())
        values = {link.name: tuple(next(left) for _ in link.axes) for link in order}
        q = tree.answer(values)
        return lambda: Outcome(q, steps)

    return run


def rotation_about_z(angle: float) -> Answer:
    """The matrix of a turn about z (3, 3)."""
    return np.array(
        [[cos(angle), -sin(angle), 0.0], [sin(angle), cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )


PEER = Peer(
    'Exudyn',
    (1e7, 1e8, 1e9, 1e10, 1e11),
    'contact stiffness [N/m]',
    lambda bar, setting: bar.run_as_tree(prepare_machine, setting),
    'Kinematic trees, the crank a flywheel; the pin in its bushing is ObjectContactSphereSphere '
    'with a hollow sphere, linear stiffness and impact model 2, whose restitution is set so that '
    "Newton's comes out; RK33 in the fast core, as few steps as stay stable. Tried and slower at "
    'equal error: RK44, ODE23, DOPRI5, generalised alpha and trapezoidal rule.',
    lambda: missing('exudyn'),
    any_restitution=True,
)
