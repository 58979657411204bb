"""A machine as its scene plans it: links, joints, drives, and where drives begin."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.plotting import Rich
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.drive import DriveLaw, Law, largest_speed, time_of_angle
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.mechanism import Mechanism, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.contact_keys import Play
from mechanism_sim.scene.plan import Plan, plan_of
from mechanism_sim.scene.schema import Commands, Scene


@dataclass(frozen=True)
class MachineModel(Rich):
    """What a scene says of a machine, before anything is put together.

    Attributes
    ----------
    name : of the scene
    scene : its content, in SI units
    questions : about what its file says and its content in SI units does not, as units
    """

    name: str
    scene: Scene
    questions: tuple[str, ...] = field(default=(), compare=False)

    def __repr__(self) -> str:
        return f'<{type(self).__name__} {self.name}: {self.scene.title}>'

    @cached_property
    def plan(self) -> Plan:
        """Links, joints, drives and forces."""
        return plan_of(self.name, self.scene)

    @property
    def links(self) -> dict[str, Any]:
        """The moving links as the scene has them."""
        return {name: link for name, link in self.scene.links.items() if name != GROUND}

    @property
    def clearances(self) -> dict[str, Play]:
        """The joints with clearance."""
        return self.plan.clearances

    @property
    def bearings(self) -> list[Revolute]:
        """The joints with a pin loose in a bushing."""
        joints = self.mechanism.joints
        return [j for j in joints if isinstance(j, Revolute) and j.name in self.clearances]

    @cached_property
    def mechanism(self) -> Mechanism:
        """Bodies and joints, cut where joints are loose; links without mass data are massless."""
        return self.plan.loose

    @property
    def main(self) -> str:
        """The coordinate whose revolutions count: the first that is driven."""
        return next(iter(self.plan.laws))

    @property
    def laws(self) -> tuple[Law, ...]:
        """The laws of the main drive, in the order in which they take over."""
        return self.plan.laws[self.main]

    @property
    def law(self) -> Law:
        """The first law of the main drive."""
        return self.laws[0]

    @property
    def start_of_crank(self) -> tuple[float, float]:
        """Angle [rad] and speed [rad/s] of the main drive's coordinate at time zero."""
        return self.plan.begins.get(self.main, (0.0, 0.0))

    @property
    def placed_outright(self) -> bool:
        """Whether the scene itself says where links start, beside the main drive."""
        given = self.plan.given
        return bool((given[0].keys() | given[1]) - {self.main}) or any(self.plan.floating)

    @cached_property
    def held(self) -> dict[str, tuple[float, float]]:
        """Values and rates at the start of the coordinates that drives move."""
        held = dict(self.plan.begins)
        for c in self.plan.prescribed:
            law = self.plan.laws[c][0]
            if isinstance(law, DriveLaw):
                _, local = law.about(Fraction(0))
                held[c] = (local[0], local[1] if len(local) > 1 else 0.0)
        return held

    @cached_property
    def turned(self) -> dict[str, int]:
        """Whole turns of angles at the start that `held` and `Plan.given` leave out."""
        laws = ((c, self.plan.laws[c][0]) for c in self.plan.prescribed)
        begun = {c: x.about(Fraction(0))[0] for c, x in laws if isinstance(x, DriveLaw)}
        return self.plan.turned | begun

    def outside_at_start(self, names: Sequence[str], t: float = 0.0) -> Array:
        """What `Frames.outside` names (k, 1), at the turns of the start."""
        found = [t if n == 'time' else self.turned.get(n.removesuffix('.turns'), 0) for n in names]
        return np.reshape(np.array(found, float), (-1, 1))

    def kinematics(self, held: Sequence[str]) -> Kinematics:
        """The closures of the mechanism without clearance, with some coordinates given."""
        ideal = self.plan.ideal
        return Kinematics(ideal, closures(ideal, ideal.cut), held)

    @property
    def commands(self) -> Commands | None:
        """What commands of speed the main drive takes, if any."""
        return self.scene.drive.commands if self.scene.drive else None

    @property
    def fastest(self) -> float:
        """Largest speed of the main drive that is known beforehand [rad/s]."""
        commanded = self.commands.fastest if self.commands else 0.0
        return max(abs(self.start_of_crank[1]), largest_speed(self.laws), commanded)

    @property
    def period(self) -> float:
        """Duration of a revolution at the largest speed [s]; infinite for a drive at rest."""
        straight = self.main in self.mechanism.displacements
        fastest = self.fastest / (self.mechanism.size if straight else 1.0)
        return 2.0 * math.pi / fastest if fastest else math.inf

    def time_of(self, revolutions: float) -> float:
        """When the main drive has turned so far [s]."""
        if not isinstance(self.law, DriveLaw):
            raise InputError(
                f'how fast {self.main} turns is not known beforehand: give a duration in seconds, '
                "not revolutions: --duration, or 'duration' in the scene"
            )
        if self.law.straight:
            raise InputError(
                f'{self.main} is driven straight, it makes no revolutions: give a duration in '
                "seconds: --duration, or 'duration' in the scene"
            )
        t = time_of_angle(self.laws, 2.0 * math.pi * revolutions)
        if t is None:
            raise InputError(
                f'{self.main} is at rest: give a duration in seconds, not revolutions: '
                "--duration, or 'duration' in the scene"
            )
        return t

    @property
    def allowed_penetration(self) -> float:
        """Violation of a gap [m] that tolerance or rounding explain; beyond it a run fails."""
        solver = self.scene.solver
        allowed = max(1e3 * solver.rtol * self.mechanism.size, solver.atol, 1e-12)
        played = [c.radial for c in self.clearances.values() if c.radial]
        return min([allowed, *(0.1 * radial for radial in played)])

    @cached_property
    def fingerprint(self) -> str:
        """Of all that rules the motion, in a few letters."""
        silent = {
            'title', 'description', 'duration', 'outputs', 'sensors', 'oscillators', 'measures',
        }  # fmt: skip
        content = self.scene.to_document(exclude=silent)
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]
