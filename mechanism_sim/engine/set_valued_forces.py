"""Set-valued forces: loads that step against a motion, dry friction in ideal joints and belts.

Each has a switch on a rate. Where the rate is zero they may hold it there, by a part between their
values at both sides (A. F. Filippov, Differential equations with discontinuous righthand sides,
1988); `holding.acting` solves for all at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import heyoka as hy
import numpy as np

from mechanism_sim.engine.dynamics import Dynamics, Solved
from mechanism_sim.engine.holding import Acting, acting
from mechanism_sim.numerics.symbolic import Term, dense
from mechanism_sim.planar.joint_friction import Pressed
from mechanism_sim.planar.protocols import JointForce, Wrench, together
from mechanism_sim.planar.reactions import tree_reactions
from mechanism_sim.planar.switches import Switch


class SetValuedForces:
    """The forces of a system that step, and what acts of them in a motion.

    Parameters
    ----------
    dynamics : the equations; parameters for signs of what presses are reserved in them
    """

    def __init__(self, dynamics: Dynamics) -> None:
        self._dynamics = dynamics
        self._known: dict[int, Acting] = {}
        self._bounds = {
            id(solved): self._bounds_by(solved) for solved in (dynamics.exact, dynamics.stabilised)
        }
        #: all of the frames, which grow with what was asked of them
        self.switches = list(dynamics.equations.frames.switches.values())
        bounds = self._bounds[id(dynamics.stabilised)].values()
        self.pins = sum(x.side is None for bound in bounds for x in bound)

    @cached_property
    def holding(self) -> dict[int, Switch]:
        """The switches of rates, which may hold a motion where they act against it."""
        return {
            k: switch
            for k, switch in enumerate(self.switches)
            if isinstance(switch, Switch) and switch.holds is not None
        }

    @cached_property
    def slipping(self) -> list[int]:
        """The switches of friction in joints, and of belts."""
        names = self._dynamics.equations.frames.switches
        return [k for k, name in enumerate(names) if name in self._dynamics.equations.frames.slips]

    @cached_property
    def holding_rows(self) -> tuple[list[int], list[int]]:
        """Indices of the flag and of the holding part, for each switch that may hold."""
        ends = np.cumsum([len(s.symbols) for s in self.switches]).tolist()
        return [ends[k] - 2 for k in self.holding], [ends[k] - 1 for k in self.holding]

    def rates(self, a: Sequence[Term]) -> list[hy.expression]:
        """Rates of the functions of the switches that may hold, under accelerations `a`."""
        return [self._rate(s.inside, a) for s in self.holding.values()]

    def parts(self, solved: Solved) -> dict[hy.expression, hy.expression]:
        """Parts of the switches of rates by their flags, and values of friction by its T."""
        found = self.acting(solved)
        flags = [s.flag for s in self.holding.values()]
        return dict(zip(flags, found.parts, strict=True)) | found.values

    def acting(self, solved: Solved) -> Acting:
        """Values of all that steps against the motion, by one of the solutions."""
        if id(solved) not in self._known:
            switches, known = [*self.holding.values()], self._bounds[id(solved)]
            forces = {joint.switch.flag: joint.T for joint in self._dynamics.frictional_joints}
            self._known[id(solved)] = acting(
                switches,
                self.rates(solved.a),
                [forces.get(s.flag) for s in switches],
                [known.get(s.flag, ()) for s in switches],
            )
        return self._known[id(solved)]

    @property
    def least(self) -> Term:
        """Half of the least normal force [N]: so far beyond zero a side changes."""
        return 0.5 * next(
            x.resolution for b in self._bounds[id(self._dynamics.stabilised)].values() for x in b
        )

    def _bounds_by(self, solved: Solved) -> dict[hy.expression, list[Pressed]]:
        """The terms of the bounds of all frictions, by the flags of their slips."""
        if not self._dynamics.frictional_joints:
            return {}
        carried, frames = self.reactions(solved), self._dynamics.equations.frames
        found: dict[hy.expression, list[Pressed]] = {}
        for joint in self._dynamics.frictional_joints:
            name = joint.friction.name
            key = f'{joint.friction.label}.friction.side'
            found[joint.switch.flag] = terms = []
            for i, x in enumerate(joint.friction.pressed(frames, carried[name])):
                if len(x.components) > 1:
                    terms.append(x)
                    continue
                side = self._dynamics.equations.parameters.reserve(f'{key}.{i}', 1.0)
                terms.append(x._replace(side=0.5 * (side + float(x.wall)) if x.wall else side))
        return found

    def reactions(self, solved: Solved) -> dict[str, Wrench]:
        """Loads of the first-named on the second-named link in every joint, without friction."""
        d, eq = self._dynamics, self._dynamics.equations
        a = d.accelerations(solved)
        cut: dict[str, Wrench] = {}
        for gap, N, T in zip(d.gaps, solved.N, solved.T, strict=True):
            pressed = gap.wrench(eq.frames, N, T)
            before = cut.get(gap.joint)
            cut[gap.joint] = together(before, pressed) if before else pressed
        loads = [load for joint in d.frictional_joints for load in joint.loads]
        for element in d.elements:
            if isinstance(element, JointForce):
                carried, before = element.wrench(eq.frames), cut.get(element.name)
                cut[element.name] = together(before, carried) if before else carried
                loads += element.loads(eq.frames)[2:]
            else:
                loads += element.loads(eq.frames)
        forces = list(solved.closing_forces)
        for relation in d.relations:
            count = len(relation.values(eq.frames))
            held, before = relation.wrench(eq.frames, forces[:count]), cut.get(relation.name)
            cut[relation.name] = together(before, held) if before else held
            forces = forces[count:]
        return tree_reactions(eq, a, cut, loads)

    def _rate(self, function: hy.expression, a: Sequence[Term]) -> hy.expression:
        """Time derivative of a function of coordinates, rates and time."""
        frames, rate = self._dynamics.equations.frames, [hy.expression(0.0)]
        accelerations: dict[str, Term] = dict(zip(self._dynamics.free, a, strict=True))
        if self._dynamics.degree > 1:
            accelerations |= {c: frames.a[c] for c in self._dynamics.prescribed}
        for c in self._dynamics.equations.coordinates:
            rate.append(hy.diff(function, frames.q[c]) * frames.v[c])
            rate.append(hy.diff(function, frames.v[c]) * dense(accelerations.get(c)))
        for number, own in enumerate(self._dynamics.state_rates):
            rate.append(hy.diff(function, frames.state(number)) * own)
        if 'time' in frames.outside:
            rate.append(hy.diff(function, frames.outside['time']))
        return hy.sum(rate)
