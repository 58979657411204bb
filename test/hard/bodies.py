"""Bodies over a floor, and the thesis scene: what the hard cases are made of."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.audit import Audit, Energy
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.events import Impact, ModeChange
from mechanism_sim.engine.observer import Observer
from mechanism_sim.engine.physics import DynamicPhysics
from mechanism_sim.engine.snapshot import State
from mechanism_sim.engine.system import System
from mechanism_sim.numerics.symbolic import Term
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.frames import Frames, Jet, lift
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, Point
from mechanism_sim.planar.protocols import ForceLaw, Wrench, contact_wrench
from mechanism_sim.results.run import Solution
from mechanism_sim.scene import Machine, load_scene

THESIS = 'four_bar_clearance'
SPEED = 36.6519  # [rad/s] of its crank
TURN = 2.0 * np.pi / SPEED  # [s]
GRAVITY = 9.81  # [m/s^2]
SIZE = 0.1  # [m] of a thrown body: the scale of what may be left out


def thesis(**overrides: Any) -> Machine:
    """The thesis scene; keyword arguments are overrides with ``__`` for dots.

    `e`, `c`, `mu` and `law` stand for the keys of the clearance of the coupler-rocker joint.
    """
    short = {'e': 'restitution', 'c': 'radial', 'mu': 'friction', 'law': 'hypothesis'}
    keys: Mapping[str, Any] = {
        f'joints.coupler_rocker.clearance.{short[k]}' if k in short else k.replace('__', '.'): v
        for k, v in overrides.items()
    }
    return load_scene(THESIS, keys)


def residual(balance: Energy | None) -> float:
    """Energy residual [J]; infinite without an energy balance."""
    return balance.residual if balance else math.inf


def relative_residual(solution: Solution) -> float:
    """Residual over the energy at hand, from the drive and through impacts."""
    e = solution.energy or Energy(math.nan, 0.0, 0.0, math.inf)
    exchanged = sum(i.normal_impulse * i.approach_speed for i in solution.impacts)
    return e.residual / (abs(e.initial) + abs(e.drive_work) + exchanged)


@dataclass(frozen=True)
class Floor:
    """A floor at height zero under a point or a disc of a body, with a unit normal upwards."""

    body: str
    restitution: float
    friction: float = 0.0
    radius: float = 0.0  #: [m] of a disc about the centre of gravity
    at: tuple[float, float] | None = None  #: a corner of the body [m], not a disc
    hypothesis: str = 'newton'
    name: str = 'floor'
    law: ForceLaw | None = None

    def stretch(self, value: Term) -> Term:
        """The value is the distance."""
        return hy.expression(1.0)

    def depth(self, value: Term) -> Term:
        """The value is the distance."""
        return -value

    def _point(self, frames: Frames) -> tuple[Jet, Jet]:
        point: Point = {
            (GROUND, f'{self.body}.x'): (1.0, 0.0),
            (GROUND, f'{self.body}.y'): (0.0, 1.0),
        }
        if self.at:
            point[self.body, None] = self.at
        return frames.position(point, f'{self.name}.{self.body}')

    def value(self, frames: Frames) -> Jet:
        """Height of the lowest point [m]."""
        height = self._point(frames)[1]
        return height - self.radius if self.radius else height

    def slip(self, frames: Frames) -> Jet:
        """Horizontal velocity of the point that touches, to the left [m/s].

        The direction is that of the normal, which points down, turned by +90 degrees: to +x.
        """
        x = self._point(frames)[0]
        rate = Jet(None, x.gradient, x.rate, x.curvature)
        if self.radius:
            r = hy.expression(self.radius)
            rate += Jet(None, {self.body: r}, r * frames.v[self.body], None)
        return rate

    @property
    def joint(self) -> str:
        """There is no joint: the gap stands for itself."""
        return self.name

    def wrench(self, frames: Frames, N: Term, T: Term) -> Wrench:
        """On the ground."""
        return contact_wrench(self.normal(frames), N, T)

    def normal(self, _: Frames) -> tuple[Jet, Jet]:
        """The body presses downwards."""
        return lift(0.0), lift(-1.0)

    def distance(self, value: Array) -> Array:
        """The value is the distance."""
        return value


class ThrownBody:
    """A body of 1 kg over a floor, in a uniform field of gravity.

    Coordinates are its angle, x and y; the run is kept whole.
    """

    def __init__(
        self,
        floors: Sequence[Floor],
        q: tuple[float, float, float],
        v: tuple[float, float, float],
        rtol: float = 1e-12,
        gravity: tuple[float, float] = (0.0, -GRAVITY),
        inertia: float = 0.5,
        closed: bool = False,
        longest: float = 0.1,
    ) -> None:
        mechanism = Mechanism((Body('body', 1.0, inertia, (SIZE, 0.0)),), (), (), gravity)
        system = System(mechanism, floors, (), 1)
        state = State(Fraction(0), (0, 0, 0), q, v, (closed,) * len(floors))
        self.physics = DynamicPhysics(Observer(system))
        self.run = EventLoop(system, (), state, rtol, 0.0, longest)
        self.impacts: list[Impact] = []
        self.modes: list[ModeChange] = []
        self.parts: list[Motion] = []
        self.audit = Audit(self.physics)

    def until(self, t: float) -> ThrownBody:
        """Go on to time t [s]."""
        self.run.advance(t, final=True)
        motion, impacts, modes = self.run.drain()
        self.audit.add(motion, impacts)
        self.parts.append(motion)
        self.impacts += impacts
        self.modes += modes
        return self

    @property
    def motion(self) -> Motion:
        """All of the motion so far."""
        return Motion.joined(self.parts)

    def at(self, t: float, derivative: int = 0) -> Array:
        """Angle, x and y at time t, or their derivatives."""
        curve = self.motion.curve
        k = curve.locate(np.array([t]))
        return np.asarray(curve.at(k, np.array([t]) - curve.start[k], derivative)[0])
