"""Impulses in all joints, from steps of the velocities.

``M delta v = J^T lambda + J_n^T N + J_t^T T + torques`` with the impulses of closures, of contacts
(which only press) and their friction, and of drives that keep their speed as unknowns; the joints
of the tree follow link by link, as forces do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import heyoka as hy
import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import Gap, Relation, Wrench, together
from mechanism_sim.planar.reactions import generalized_forces, tree_reactions
from mechanism_sim.planar.switched_functions import SwitchedFunction


class JointImpulses:
    """Impulses of the first-named on the second-named link of every joint.

    Parameters
    ----------
    mechanism : the tree of links
    gaps : its joints with clearance
    relations : closures of loops
    prescribed : names of the coordinates whose motion is given

    Attributes
    ----------
    outside : names of inputs beside the position: ``time``, ``COORDINATE.turns``
    """

    def __init__(
        self,
        mechanism: Mechanism,
        gaps: Sequence[Gap],
        relations: Sequence[Relation],
        prescribed: Sequence[str],
    ) -> None:
        # without weight and at rest the equations of motion are those of impulses
        still = replace(mechanism, gravity=(0.0, 0.0), axial_gravity=0.0)
        eq = Equations(still, gaps, relations)
        frames, a = eq.frames, dict(eq.frames.a)
        slips = [(gap, gap.slip(frames)) for gap in gaps if gap.friction]
        jets = [*eq.gap_jets, *eq.relation_jets, *(slip for _, slip in slips)]
        self._presses = len(eq.gap_jets)
        sizes = [hy.make_vars(f'impulse{i}') for i in range(len(jets))]
        cut = {name: Wrench(None, None) for name in mechanism.cut}
        rubbing = sizes[len(jets) - len(slips) :]
        along = {gap.name: T for (gap, _), T in zip(slips, rubbing, strict=True)}
        for gap, N in zip(gaps, sizes, strict=False):
            pressed = gap.wrench(frames, N, along.get(gap.name))
            cut[gap.joint] = together(cut.get(gap.joint, Wrench(None, None)), pressed)
        closing = sizes[len(gaps) :]
        for relation in relations:
            count = len(relation.values(frames))
            held = relation.wrench(frames, closing[:count])
            cut[relation.name] = together(cut[relation.name], held)
            closing = closing[count:]
        wrenches = tree_reactions(eq, a, cut).values()
        self._driven = np.array([[c == d for d in prescribed] for c in eq.coordinates], float)
        self.outside = tuple(frames.outside)
        at = [*frames.q.values(), *frames.v.values(), *a.values(), *frames.outside.values()]
        rows = [x for jet in jets for x in jet.row(eq.coordinates)]
        self._equations = SwitchedFunction(frames, [generalized_forces(eq, a), rows], at)
        self._wrenches = SwitchedFunction(
            frames, [[x for w in wrenches for x in w[:3]]], [*at, *sizes]
        )

    def __call__(self, q: Array, step: Array, outside: Array) -> Array:
        """Impulses x, y [N s] and moments about the joint's point on the second link (j, 3, N).

        Parameters
        ----------
        q : (n, N) coordinates
        step : (n, N) steps of their rates
        outside : (k, N) values of the inputs `outside`
        """
        n, count = q.shape
        motion = np.concatenate([q, np.zeros_like(q), step, outside])
        gained, rows = self._equations(motion)
        rows = rows.reshape(-1, n, count)
        sizes = [self._solve(rows[:, :, i], gained[:, i]) for i in range(count)]
        return self._wrenches(np.concatenate([motion, np.array(sizes).T]))[0].reshape(-1, 3, count)

    def _solve(self, rows: Array, gained: Array) -> Array:
        """The impulses along the rows (r,)."""
        presses, free = rows[: self._presses].T, rows[self._presses :].T
        columns = np.concatenate([presses, free, self._driven, -free, -self._driven], axis=1)
        scale = np.linalg.norm(columns, axis=0)
        found = scipy.optimize.nnls(columns / scale, gained)[0] / scale
        k = self._presses + free.shape[1]
        result = found[:k]
        start = k + self._driven.shape[1]
        result[self._presses :] -= found[start : start + free.shape[1]]
        return np.asarray(result)
