"""A machine with its equations of motion, compiled."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.observer import Observer
from mechanism_sim.hybrid.physics import DynamicPhysics, Physics
from mechanism_sim.hybrid.system import System
from mechanism_sim.linkages.nominal import NominalPhysics
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.configuration import converted
from mechanism_sim.planar.drive import DriveLaw, TorqueLaw
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.massless import inertial_motion, without_mass
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import ForceElement, Gap, Relation
from mechanism_sim.planar.switches import Table
from mechanism_sim.scene.clearances import gaps_and_films
from mechanism_sim.scene.nominal_model import Level, NominalModel

_BESIDE = 0.3
"""[rad, m] from the start, where it is looked whether links without mass make a difference."""

_COMPACT_FROM = 8
"""Free coordinates, contacts and closures from which on compact code pays: it compiles faster.

Four fifths of the start of large machines were LLVM's optimisation.
"""


class DynamicModel(NominalModel):
    """A machine whose equations can be evaluated."""

    @cached_property
    def system(self) -> System:
        """The compiled equations of motion."""
        mechanism = self.mechanism
        gaps, films = gaps_and_films(mechanism, self.clearances)
        frames = Frames(mechanism.coordinates, Parameters())
        for gap in gaps:
            if all(slope is None for slope in gap.value(frames).gradient.values()):
                raise InputError(
                    f'{self.name}: joints.{gap.joint} has a clearance that never opens nor '
                    'closes: its links move along it only; leave the joint out'
                )
        closing = closures(mechanism, [j for j in mechanism.cut if j not in self.clearances])
        return self._compiled(mechanism, gaps, closing, films)

    @cached_property
    def observer(self) -> Observer:
        """What is seen of `system` in a given state."""
        return Observer(self.system)

    @cached_property
    def ideal_observer(self) -> Observer:
        """The same of the mechanism without clearance."""
        ideal = self.plan.ideal
        return Observer(self._compiled(ideal, [], closures(ideal, ideal.cut), []))

    def torques(self, q: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Torques (k, N) of the first laws of the powered coordinates, all being at (n, N)."""
        rows, places = [], self.plan.ideal.coordinates
        for c in self.plan.powered:
            i, law = places.index(c), self.plan.laws[c][0]
            assert isinstance(law, TorqueLaw)  # noqa: S101 - it is powered
            constant, per_angle, per_speed = law.after(self.turned.get(c, 0))
            rows.append(constant + per_angle * q[i] + per_speed * v[i])
        return np.reshape(rows, (-1, q.shape[1]))

    def _compiled(
        self,
        mechanism: Mechanism,
        gaps: Sequence[Gap],
        closing: Sequence[Relation],
        films: Sequence[ForceElement],
    ) -> System:
        laws = [law for laws in self.plan.laws.values() for law in laws]
        degree = max(law.degree if isinstance(law, DriveLaw) else 1 for law in laws)
        if self.commands:
            degree = max(degree, 2)  # commanded speeds are joined by ramps
        elements = [*films, *self.plan.elements(mechanism)]
        prescribed, powered = self.plan.prescribed, self.plan.powered
        return System(
            mechanism, gaps, prescribed, degree, closing, powered, elements, self.plan.motors,
            self.plan.frictions(mechanism),
            self._lent(mechanism) if closing else 0.0,
        )  # fmt: skip

    def _lent(self, mechanism: Mechanism) -> float:
        """What closures are lent [kg] if free coordinates have no inertia by themselves."""
        prescribed, q = self.plan.prescribed, self.at_start(mechanism)
        free = [i for i, c in enumerate(mechanism.coordinates) if c not in prescribed]
        beside = np.random.default_rng(3).normal(0.0, _BESIDE, (3, len(q)))
        for shift in (np.zeros(len(q)), *beside):
            moved = inertial_motion(mechanism, q + shift)[:, free]
            if without_mass(moved, np.zeros((0, len(free)))).size:
                return sum(b.mass + b.inertia / mechanism.size**2 for b in mechanism.bodies)
        return 0.0

    def at_start(self, mechanism: Mechanism) -> NDArray[np.float64]:
        """Coordinates (n,) of the ideal mechanism, however it is cut, at the start."""
        at = self.assembly
        return converted(self.plan.ideal, mechanism, at.q, at.v)[0]

    @cached_property
    def physics(self) -> Physics:
        """What follows from a motion of this machine."""
        if self.dynamic:
            return DynamicPhysics(self.observer)
        forces = self.inverse_dynamics if self.level is Level.INVERSE_DYNAMICS else None
        return NominalPhysics(self.ideal, self.mechanism, forces)

    @property
    def _large(self) -> bool:
        """Whether the equations are so long that compact code pays."""
        system = self.system
        tabulated = any(isinstance(s, Table) for s in system.switches)
        many = len(system.free) + self._rows >= _COMPACT_FROM
        more = system.elements or system.lent or system.dynamics.rubs or self.mechanism.flexible
        return bool(more) or tabulated or many

    @property
    def _rows(self) -> int:
        """How many contacts and closures the equations of motion are solved for."""
        return len(self.system.dynamics.rows) + len(self.system.dynamics.relation)
