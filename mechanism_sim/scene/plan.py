"""What a scene's mechanism is, in whichever way it was written: the same structures for all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from mechanism_sim.errors import InputError
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.planar.drive import DriveLaw, Law, TorqueLaw, speed_profile
from mechanism_sim.planar.mechanism import (
    GROUND,
    Body,
    HigherPair,
    Joint,
    Mechanism,
    Revolute,
    Vector2,
    closing_joints,
)
from mechanism_sim.planar.protocols import ForceElement
from mechanism_sim.scene.schema import Commands, FourBarScene, Motor, Play

Elements = Callable[[Mechanism], list[ForceElement]]

POWERED = 'they are of speeds; a torque takes commands of effort without this key'


@dataclass(frozen=True)
class Plan:
    """Links, joints, drives and forces of a scene, in SI units.

    Attributes
    ----------
    bodies : the moving links; those without mass data are massless
    joints : between them
    closing : which of them are cut to make a tree if none is loose
    clearances : of the loose ones
    laws : of the driven coordinates, in the order in which they take over
    begins : of the coordinates moved by a torque or a force, value and rate at the start
    given : values and rates of coordinates that the scene sets outright
    assumed : of `begins`, the coordinates of whose values and of whose rates nobody said anything
    guess : rough values of coordinates
    points : named points of the links, in their frames [m]
    elements : springs, dampers and loads
    weighed : whether every link has the mass properties that forces need
    four_bar : the lengths, if it is one: it has a closed form
    """

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    closing: tuple[str, ...]
    gravity: Vector2
    clearances: dict[str, Play]
    laws: dict[str, tuple[Law, ...]]
    begins: dict[str, tuple[float, float]]
    given: tuple[dict[str, float], dict[str, float]] = field(default_factory=lambda: ({}, {}))
    assumed: tuple[frozenset[str], frozenset[str]] = (frozenset(), frozenset())
    guess: dict[str, float] = field(default_factory=dict)
    points: dict[str, dict[str, Vector2]] = field(default_factory=dict)
    elements: Elements = lambda _: []
    weighed: bool = True
    four_bar: FourBar | None = None

    def mechanism(self, cut: Sequence[str]) -> Mechanism:
        """The tree that is left when some joints are cut."""
        return Mechanism(self.bodies, self.joints, tuple(cut), self.gravity)

    @property
    def ideal(self) -> Mechanism:
        """The mechanism without clearance."""
        return self.mechanism(self.closing)

    @property
    def loose(self) -> Mechanism:
        """The mechanism cut at its loose joints, and where loops are left then."""
        if not self.clearances:
            return self.ideal
        links, cut = [body.name for body in self.bodies], [*self.clearances]
        straight = [c for c in self.laws if c in self.ideal.displacements]
        while True:
            found = self.mechanism(closing_joints(links, self.joints, cut, straight))
            # a link whose angle is driven must not be carried by a guide: it would lose its angle
            guides = [
                found.tree_joints[c].name
                for c in self.laws
                if c in found.displacements and c not in straight
            ]
            if not guides:
                return found
            cut += guides

    @property
    def elastic(self) -> list[str]:
        """The joints that have forces of their own instead of constraints."""
        return [j.name for j in self.joints if isinstance(j, HigherPair) and j.elastic]

    @property
    def rigid(self) -> dict[str, Play]:
        """The clearances of joints whose contacts the engine opens and closes."""
        return {name: c for name, c in self.clearances.items() if name not in self.elastic}

    @property
    def prescribed(self) -> list[str]:
        """The coordinates whose motion is given."""
        return [c for c, laws in self.laws.items() if isinstance(laws[0], DriveLaw)]

    @property
    def powered(self) -> list[str]:
        """The coordinates that a torque or a force moves."""
        return [c for c in self.laws if c not in self.prescribed]


def four_bar_plan(scene: FourBarScene) -> Plan:
    """The plan of the four-bar template."""
    links = scene.links
    moving = {'crank': links.crank, 'coupler': links.coupler, 'rocker': links.rocker}
    flywheel = {'crank': scene.drive.flywheel}
    bodies = tuple(
        Body(
            name,
            link.mass or 0.0,
            (link.inertia or 0.0) + flywheel.get(name, 0.0),
            (link.cog or 0.0, 0.0),
        )
        for name, link in moving.items()
    )
    origin = (0.0, 0.0)
    ends = {name: (link.length, 0.0) for name, link in moving.items()}
    ground = (links.ground.length, 0.0)
    joints = (
        Revolute('ground_crank', GROUND, 'crank', origin, origin),
        Revolute('crank_coupler', 'crank', 'coupler', ends['crank'], origin),
        Revolute('coupler_rocker', 'coupler', 'rocker', ends['coupler'], ends['rocker']),
        Revolute('rocker_ground', 'rocker', GROUND, origin, ground),
    )
    given = scene.joints
    clearances: dict[str, Play] = {
        j.name: c for j in joints if (c := getattr(given, j.name).clearance)
    }
    angle = scene.initial.position.crank
    start = scene.drive.start_angle if angle is None else angle
    laws, begin = _four_bar_laws(scene, start)
    values = {'coupler': scene.initial.position.coupler, 'rocker': scene.initial.position.rocker}
    rates = {'coupler': scene.initial.velocity.coupler, 'rocker': scene.initial.velocity.rocker}
    return Plan(
        bodies,
        joints,
        ('coupler_rocker',),
        scene.gravity,
        clearances,
        {'crank': laws},
        {'crank': begin},
        ({k: x for k, x in values.items() if x is not None},
         {k: x for k, x in rates.items() if x is not None}),
        points={
            name: {'start': origin, 'end': end} for name, end in {**ends, GROUND: ground}.items()
        },
        weighed=all(link.mass for link in moving.values()),
        four_bar=FourBar(
            links.ground.length, links.crank.length, links.coupler.length, links.rocker.length,
            scene.branch,
        ),
    )  # fmt: skip


def _four_bar_laws(
    scene: FourBarScene, start: float
) -> tuple[tuple[Law, ...], tuple[float, float]]:
    """The laws of the crank, and its angle and speed at the start."""
    drive = scene.drive
    begin = start, drive.speed or 0.0
    check_commands('drive', drive.commands, POWERED if drive.torque or drive.motor else '')
    if drive.torque:
        t = drive.torque
        return (TorqueLaw('crank', (t.constant, t.per_angle, t.per_speed)),), begin
    if drive.motor:
        return (motor_law('crank', drive.motor.stall_torque, drive.motor.no_load_speed),), begin
    if drive.profile:
        points, smooth = drive.profile.points, drive.profile.ramp == 'smooth'
        laws = tuple(speed_profile('crank', start, points, smooth))
        return laws, (start, laws[0].coefficients[1])
    return (DriveLaw('crank', (start, drive.speed or 0.0)),), begin


def check_times(where: str, points: Sequence[tuple[float, Any]]) -> None:
    """Refuse a profile whose times do not rise.

    Raises
    ------
    InputError
    """
    for (before, _), (after, _) in pairwise(points):
        if after <= before:
            raise InputError(f'{where}: times must rise, but {after:g} s follows {before:g} s')


def check_commands(where: str, commands: Commands | None, reason: str) -> None:
    """Refuse commands of speed for a drive that can take none, for a `reason` (empty: it can).

    Raises
    ------
    InputError
    """
    if commands and reason:
        raise InputError(f'{where}.commands: {reason}')


def check_motor(where: str, motor: Motor) -> None:
    """Refuse a motor that does not come to rest at a speed.

    Raises
    ------
    InputError
    """
    if motor.no_load_speed == 0.0:
        raise InputError(f'{where}.motor.no_load_speed must not be zero')
    if motor.stall_torque * motor.no_load_speed < 0.0:
        raise InputError(
            f'{where}.motor: stall_torque {motor.stall_torque:g} N m and no_load_speed '
            f'{motor.no_load_speed:g} rad/s have opposite signs: it would run away; give both the '
            'sign in which it turns'
        )


def motor_law(coordinate: str, stall_torque: float, no_load_speed: float) -> TorqueLaw:
    """The straight line of a direct-current motor."""
    return TorqueLaw(coordinate, (stall_torque, 0.0, -stall_torque / no_load_speed))
