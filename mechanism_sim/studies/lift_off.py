"""Lift-off speeds of followers from their cams, at which ideal contacts become tensile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import heyoka as hy
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.engine.physics import outside
from mechanism_sim.errors import InputError
from mechanism_sim.linkages.nominal import NominalPhysics
from mechanism_sim.numerics.extremes import ExtremeSearch
from mechanism_sim.numerics.symbolic import dense
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.scene import Machine

_FACTOR = 1.15  # ratio of successive trial speeds
_RANGE = 100.0  # times slower and faster than the scene's


@dataclass(frozen=True)
class LiftOff:
    """A cam that its follower can leave."""

    joint: str  #: name of the joint
    least_force: float  #: least force over a turn at the scene's speed [N]; negative if tensile
    least_force_at: float  #: angle of the drive there [rad]
    #: least drive speed with loss of contact [rad/s]; None: no loss at any speed tried
    lift_off_speed: float | None = None
    lift_off_at: float | None = None  #: angle of the drive where it is lost first [rad]


def lift_offs(machine: Machine, progress: Callable[[str], None] = lambda _: None) -> list[LiftOff]:
    """Least contact force of every cam without a groove, and its lift-off speed.

    The motion is that of the machine without any play; at other speeds rates scale with the speed
    and accelerations with its square. Speeds from a hundredth to a hundred times that of the scene
    are tried from below; the root is found to rounding. `progress` is called with the present cam.
    """
    # a follower on its cam has a wall on one side
    higher = (j for j in machine.plan.joints if isinstance(j, HigherPair))
    pairs = [j for j in higher if len(j.sides) == 1]
    if not pairs:
        raise InputError(f'{machine.name}: there is no cam with a follower that can lift off')
    drive = machine.drive
    slides = machine.plan.main in machine.mechanism.displacements
    if machine.torque_driven or slides or not drive.steady or not drive.fastest:
        raise InputError(
            f'{machine.name}: the lift-off speed is that of a drive that turns at a constant '
            "speed: give 'drive.speed'"
        )
    if not machine.plan.weighed:
        raise InputError(f'{machine.name}: forces need the mass of every link')
    for joint, why in machine.without_forces.items():
        raise InputError(f'{machine.name}: joints.{joint}.{why}')
    cycle = _Cycle(machine)
    found = []
    for pair in pairs:
        progress(pair.name)
        found.append(_lift_off(cycle, pair))
    return found


class _Cycle:
    """The motion of a machine without clearance over a turn of its drive, at any speed."""

    def __init__(self, machine: Machine) -> None:
        self.mechanism, self.period = machine.plan.ideal, machine.drive.period
        self.start, self.speed = machine.drive.start
        self._forces = machine.nominal.inverse_dynamics
        if 'time' in self._forces.outside:
            raise InputError(
                f'{machine.name}: loads that depend on the time have no lift-off speed'
            )
        laws = [laws[0] for laws in machine.plan.laws.values()]
        self._motion = machine.nominal.run(laws, loads=True).motion(self.period)
        self._physics = NominalPhysics(machine.nominal.motion, self.mechanism, None)

    def force(self, pair: HigherPair, factor: float) -> Callable[[Array], Array]:
        """The contact force (N,) at times (N,), the drive being `factor` times as fast."""
        frames = Frames(self.mechanism.coordinates, Parameters())
        unit = pair.closure(self.mechanism).wrench(frames, [hy.expression(1.0)])
        direction = SwitchedFunction(
            frames, [[dense(unit.x), dense(unit.y)]], [*frames.q.values()]
        )
        index = self.mechanism.joints.index(pair)

        def force(times: Array) -> Array:
            curve = self._motion.curve
            where = curve.find(times)
            o = self._physics.observe(self._motion, *where)
            turns = outside(self._forces.outside, self.mechanism.coordinates, curve, *where)
            v, a = factor * o.velocity, factor**2 * o.acceleration
            seen = self._forces(o.local, v, a, turns)
            (n,) = direction(o.local)
            pressed: Array = (seen.reaction[index] * n).sum(axis=0) / (n * n).sum(axis=0)
            return pressed

        return force

    def least(self, pair: HigherPair, factor: float) -> tuple[float, float]:
        """The least contact force of a turn [N], and the angle of the drive there [rad]."""
        force, search = self.force(pair, factor), ExtremeSearch(['force'])
        spans = self._motion.curve.spans(0.0, self.period)
        search.add(lambda t: force(t.ravel())[None], *spans)
        return float(search.least[0]), self.start + self.speed * float(search.least_time[0])


def _lift_off(cycle: _Cycle, pair: HigherPair) -> LiftOff:
    def force(factor: float) -> float:
        return cycle.least(pair, factor)[0]

    known = LiftOff(pair.name, *cycle.least(pair, 1.0))
    low = high = 1.0 / _RANGE
    if force(low) <= 0.0:
        return known
    while force(high) > 0.0:
        low, high = high, _FACTOR * high
        if high > _RANGE:
            return known
    factor = scipy.optimize.brentq(force, low, high, xtol=1e-15, rtol=1e-15)
    _, angle = cycle.least(pair, factor)
    return replace(known, lift_off_speed=factor * abs(cycle.speed), lift_off_at=angle)
