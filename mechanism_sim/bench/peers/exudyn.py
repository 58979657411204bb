"""Exudyn as a peer: a sphere in a hollow one, elastic, damped so that Newton's law comes out.

Coupler and rocker are links of kinematic trees, so nothing is left but ordinary differential
equations. The force of contact is K d (1 + mu v) for an overlap d growing at speed v: the
contact law of Exudyn with mu = lambda/v0 from the speed v0 at which the impact began. Integrated
over an impact, it gives Newton's restitution e for every mass and speed if

    lambda (1 + e) = ln((1 + lambda)/(1 - e lambda)).

Exudyn approximates lambda(e); it is given the restitution for which its formula is exact.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from math import log, sqrt

import numpy as np
from scipy.optimize import brentq

from mechanism_sim.bench.four_bar import LooseFourBar, Peer
from mechanism_sim.bench.problem import Outcome, Run, without

FLYWHEEL = 1e9  #: [kg m^2] of the crank: its speed stays the same to 1e-10 rad/s
SLOWEST_IMPACT = 70.0  #: [m/s sqrt(N/m)] slower ones, over lambda/sqrt(K), are taken as this fast
STEPS_PER_VIBRATION = 0.5  #: [sqrt(m/N)] steps per revolution over the root of the stiffness


def damping(e: float) -> float:
    """The damping number lambda of a contact force that gives back the share `e` of the speed."""
    if e >= 1.0:
        return 0.0

    def excess(number: float) -> float:
        return number * (1.0 + e) - log((1.0 + number) / (1.0 - e * number))

    return float(brentq(excess, 1e-3 * (1.0 - e), (1.0 - 1e-15) / e))


def restitution_to_give(e: float) -> float:
    """The restitution for which Exudyn's impact model 2 takes the damping of the true `e`."""

    def of_exudyn(x: float) -> float:
        if x > 1.0 / 3.0:
            return 1.5 * (1.0 - x) * (11.0 - x) / (1.0 + 9.0 * x)
        return (1.0 - x * x) / x

    number = damping(e)
    return float(brentq(lambda x: of_exudyn(x) - number, 1e-6, 1.0))


def prepare(bar: LooseFourBar, setting: float) -> Run:
    """A run with a contact of stiffness `setting` [N/m] and as many steps as that needs."""
    sys.exudynFast = True  # type: ignore[attr-defined]  # its compiled core without range checks
    with redirect_stdout(sys.stderr):  # where it says so
        import exudyn as exu  # noqa: PLC0415 - an optional package
        from exudyn import itemInterface as items  # noqa: N813, PLC0415

    container = exu.SystemContainer()
    system = container.AddSystem()

    def tree(
        base: list[float],
        masses: list[float],
        inertias: list[float],
        cogs: list[float],
        angles: list[float],
        rates: list[float],
    ) -> int:
        """A chain of links on hinges at distances `base`, each from the one before."""
        n = len(masses)
        node = system.AddNode(
            items.NodeGenericODE2(
                numberOfODE2Coordinates=n,
                referenceCoordinates=[0.0] * n,
                initialCoordinates=angles,
                initialCoordinates_t=rates,
            )
        )
        return int(
            system.AddObject(
                items.ObjectKinematicTree(
                    nodeNumber=node,
                    jointTypes=[exu.JointType.RevoluteZ] * n,
                    linkParents=list(range(-1, n - 1)),
                    jointTransformations=exu.Matrix3DList([np.eye(3)] * n),
                    jointOffsets=exu.Vector3DList([[x, 0.0, 0.0] for x in base]),
                    linkInertiasCOM=exu.Matrix3DList([i * np.eye(3) for i in inertias]),
                    linkCOMs=exu.Vector3DList([[x, 0.0, 0.0] for x in cogs]),
                    linkMasses=masses,
                    gravity=[0.0, -bar.gravity, 0.0],
                )
            )
        )

    crank_and_coupler = tree(
        [0.0, bar.crank],
        [bar.crank_mass, bar.coupler_mass],
        [FLYWHEEL, bar.coupler_inertia],
        [bar.crank_cog, bar.coupler_cog],
        [bar.crank_angle, bar.coupler_angle - bar.crank_angle],
        [bar.crank_speed, bar.coupler_rate - bar.crank_speed],
    )
    rocker = tree(
        [bar.ground],
        [bar.rocker_mass],
        [bar.rocker_inertia],
        [bar.rocker_cog],
        [bar.rocker_angle],
        [bar.rocker_rate],
    )
    pin, bushing = (
        system.AddMarker(
            items.MarkerKinematicTreeRigid(
                objectNumber=chain, linkNumber=link, localPosition=[length, 0.0, 0.0]
            )
        )
        for chain, link, length in ((crank_and_coupler, 1, bar.coupler), (rocker, 0, bar.rocker))
    )
    radius = bar.clearance  # of the pin; only the difference of the radii counts
    system.AddObject(
        items.ObjectContactSphereSphere(
            markerNumbers=[pin, bushing],
            nodeNumber=system.AddNode(
                items.NodeGenericData(initialCoordinates=[0.0] * 4, numberOfDataCoordinates=4)
            ),
            spheresRadii=[radius, radius + bar.clearance],
            isHollowSphere1=True,
            contactStiffness=setting,
            restitutionCoefficient=restitution_to_give(bar.restitution),
            minimumImpactVelocity=SLOWEST_IMPACT * damping(bar.restitution) / sqrt(setting),
            impactModel=2,
        )
    )
    system.Assemble()

    steps = round(STEPS_PER_VIBRATION * sqrt(setting) * bar.revolutions)
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = steps
    settings.timeIntegration.endTime = bar.duration
    settings.timeIntegration.automaticStepSize = False
    settings.timeIntegration.minimumStepSize = 1e-15  # what rounding leaves for the last step
    settings.timeIntegration.explicit.computeEndOfStepAccelerations = False
    settings.solution.file.write = False
    settings.solution.sensors.active = False

    def run() -> Callable[[], Outcome]:
        system.SolveDynamic(settings, solverType=exu.DynamicSolverType.RK33)
        crank, coupler, rocker = system.systemData.GetODE2Coordinates()
        return lambda: Outcome(np.array([crank + coupler, rocker]), steps)

    return run


PEER = Peer(
    'Exudyn',
    (1e7, 1e8, 1e9, 1e10, 1e11),
    'contact stiffness [N/m]',
    prepare,
    'Kinematic trees, the crank a flywheel; the pin in its bushing is ObjectContactSphereSphere '
    'with a hollow sphere, linear stiffness and impact model 2, whose restitution is set so that '
    "Newton's comes out; RK33 in the fast core, as few steps as stay stable. Tried and slower at "
    'equal error: RK44, ODE23, DOPRI5, generalised alpha and trapezoidal rule.',
    lambda: without('exudyn'),
    any_restitution=True,
)
