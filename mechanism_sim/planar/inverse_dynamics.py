"""Forces from motion: reactions and drive torques of a mechanism whose motion is known."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.evaluation import COLUMNS, Evaluation
from mechanism_sim.numerics.symbolic import dense
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import Relation
from mechanism_sim.planar.reactions import energies, generalized_forces, tree_reactions

Array = NDArray[np.float64]


class Observation(NamedTuple):
    """A machine at N instants: n coordinates, j joints of which m have clearance, p drives."""

    position: Array  #: (n, N) [rad]
    velocity: Array  #: (n, N) [rad/s]
    acceleration: Array  #: (n, N) [rad/s^2]
    gap: Array  #: (m, N) [m]
    normal_force: Array  #: (m, N) [N]
    friction_force: Array  #: (m, N) [N] on the first-named link, along the tangent
    friction_power: Array  #: (N,) [W] lost by sliding
    reaction: Array  #: (j, 2, N) [N] of the first-named on the second-named link
    drive_torque: Array  #: (p, N) [N m] prescribed drives first
    drive_power: Array  #: (N,) [W]
    kinetic_energy: Array  #: (N,) [J]
    potential_energy: Array  #: (N,) [J]


class Account(NamedTuple):
    """What books are kept of, at N instants: m joints with clearance."""

    normal_force: Array  #: (m, N) [N]
    friction_power: Array  #: (N,) [W] lost by sliding
    drive_power: Array  #: (N,) [W]
    closure_error: float  #: [m] largest distance that should be zero


class InverseDynamics:
    """Joint forces and drive torques of a mechanism with ideal joints.

    ``M a + bias = J^T lambda + torques`` is linear in the forces ``lambda`` of the joints that
    close loops and in the torques of the driven coordinates; the other joints follow link by link.

    Parameters
    ----------
    mechanism : the tree of links
    relations : its cut joints, two components each
    driven : names of the coordinates with a drive
    """

    def __init__(
        self, mechanism: Mechanism, relations: Sequence[Relation], driven: Sequence[str]
    ) -> None:
        self.mechanism = mechanism
        self.relations = tuple(relations)
        self._driven = [mechanism.coordinates.index(c) for c in driven]
        self._equations = Equations(mechanism, relations=relations)

    @cached_property
    def _functions(self) -> tuple[Evaluation, Evaluation]:
        """What must be supplied with the closure rows; and the joint forces from the closures'."""
        eq = self._equations
        a = dict(eq.frames.a)
        closing = {r.name: hy.make_vars(f'{r.name}_x', f'{r.name}_y') for r in self.relations}
        motion = [*eq.frames.q.values(), *eq.frames.v.values(), *eq.frames.a.values()]
        rows = [x for jet in eq.relation_jets for x in jet.row(eq.coordinates)]
        forces = [x for f in tree_reactions(eq, a, closing).values() for x in f]
        known = [*motion, *(x for pair in closing.values() for x in pair)]
        groups = (
            ([*generalized_forces(eq, a)], rows, motion),
            (forces, energies(eq), known),
        )
        first, second = (
            Evaluation(
                compiled.function([dense(x) for x in (*left, *right)], variables),
                eq.parameters.values,
                [len(left), len(right)],
            )
            for left, right, variables in groups
        )
        return first, second

    def __call__(self, q: Array, v: Array, a: Array) -> Observation:
        """Forces and energies at N instants.

        Parameters
        ----------
        q, v, a : (n, N) angles [rad], rates [rad/s], accelerations [rad/s^2]

        Raises
        ------
        numpy.linalg.LinAlgError
            At a singular position, where the forces are not determined.
        """
        n, count = q.shape
        if count > COLUMNS:
            blocks = [slice(i, i + COLUMNS) for i in range(0, count, COLUMNS)]
            parts = [self(q[:, b], v[:, b], a[:, b]) for b in blocks]
            return Observation(*(np.concatenate(x, axis=-1) for x in zip(*parts, strict=True)))
        first, second = self._functions
        closures = 2 * len(self.relations)
        motion = np.concatenate([q, v, a])
        supplied, rows = first(motion)
        matrix = np.zeros((count, n, closures + len(self._driven)))
        matrix[:, :, :closures] = rows.reshape(closures, n, count).transpose(2, 1, 0)
        for k, i in enumerate(self._driven):
            matrix[:, i, closures + k] = 1.0
        unknown = np.linalg.solve(matrix, supplied.T[:, :, None])[:, :, 0].T
        on_second = -unknown[:closures]
        forces, energy = second(np.concatenate([motion, on_second]))
        joints = len(self.mechanism.joints)
        none = np.zeros((0, count))
        torque = np.asarray(unknown[closures:], np.float64)
        return Observation(
            q,
            v,
            a,
            none,
            none,
            none,
            np.zeros(count),
            forces.reshape(joints, 2, count),
            torque,
            (torque * v[self._driven]).sum(axis=0),
            energy[0],
            energy[1],
        )
