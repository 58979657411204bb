"""Observation of a system in a given state: accelerations, forces, energies, gaps.

The event loop needs none of it; functions are compiled when they are first called for.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import chain, islice
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.events import Mode
from mechanism_sim.engine.gap_geometry import GapGeometry
from mechanism_sim.engine.holding_parts import with_holding_parts
from mechanism_sim.engine.runtime_parameters import symbols
from mechanism_sim.engine.system import System
from mechanism_sim.errors import RunError
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg, substitute
from mechanism_sim.planar.closures import IndependentRows
from mechanism_sim.planar.inverse_dynamics import Account, Observation
from mechanism_sim.planar.joint_friction import with_friction
from mechanism_sim.planar.reactions import energies
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.tolerances import TOLERANCES

_JOINT_FRICTION = TOLERANCES.joint_friction


class Instants(NamedTuple):
    """States of a machine at N instants."""

    q: Array  #: (n, N) of all coordinates
    v: Array  #: (n, N)
    a_p: Array  #: (p, N) prescribed accelerations
    modes: NDArray[np.uint8]  #: (m, N) of the gaps
    torque: Array | None = None  #: (k, N) [N m] on the powered coordinates
    approach: Array | None = None  #: (m, N) [m/s] of the first touch of compliant contacts
    outside: Array | None = None  #: (k, N) what `Frames.outside` names
    rows: Array | None = None  #: (r, N) values of the switches, if not those at these places
    sides: Array | None = None  #: (k, N) signs of what presses on the lines that rub


class TouchTerms(NamedTuple):
    """The m compliant contacts at N instants."""

    normal_force: Array  #: (m, N) [N]
    friction_force: Array  #: (m, N) [N]
    loss: Array  #: (m, N) [W] by damping and friction
    rate: Array  #: (m, N) [m/s] of the gap
    normal_angle: Array  #: (m, N) [rad]


_OF_TOUCHES = 'contact_loss', 'gap_rate', 'normal_angle'
_OBSERVED = (
    'acceleration', 'gap', 'closure', 'normal_force', 'friction_force', 'friction_power',
    'drive_torque', 'reaction', 'moment', 'energy',
)  # fmt: skip


def _in_groups(
    found: Sequence[hy.expression], groups: Iterable[Sequence[Term]]
) -> list[list[hy.expression]]:
    """Terms made of all groups at once, in these again: one by one they would share no parts."""
    rest = iter(found)
    return [list(islice(rest, len(group))) for group in groups]


class Observer:
    """Functions of states of a system.

    Parameters
    ----------
    system : the equations

    Attributes
    ----------
    gaps : their geometry
    """

    def __init__(self, system: System) -> None:
        self.system = system
        self.gaps = GapGeometry(system)

    @cached_property
    def _terms(self) -> dict[str, list[Term]]:
        """The terms of `observe` and `account` as expressions."""
        eq, d = self.system.equations, self.system.dynamics
        solved = d.exact
        a, forces = d.accelerations(solved), self.system.set_valued
        reactions = with_friction(d.frictional_joints, forces.reactions(solved), eq.frames)
        friction = [
            neg(mul(solved.T[i], d.contacts.tangent[i].rate)) for i in d.contacts.frictional
        ]
        taken = add(*(element.power_lost(eq.frames) for element in self.system.elements))
        friction += [*(joint.power_lost for joint in d.frictional_joints), eq.strain_loss]
        kinetic, potential = energies(eq)
        potential = add(
            potential, *(element.energy(eq.frames) for element in self.system.elements)
        )
        forces_N = list(solved.N)
        losses: list[Term] = []
        for i, law in enumerate(d.contacts.laws):
            if law is not None:
                depth, rate, stretch = d.compressed(i)
                push = mul(solved.N[i], stretch)
                lost = push - d.flags.closed[i] * law.normal_force(depth, hy.expression(0.0), 1.0)
                friction.append(lost * rate)
                potential = add(potential, d.flags.closed[i] * law.elastic_energy(depth))
                forces_N[i] = push
                slides = (
                    mul(solved.T[i], d.contacts.tangent[i].rate)
                    if i in d.contacts.tangent
                    else None
                )
                losses.append(add(lost * rate, neg(slides)))
        frames = d.equations.frames
        following = [  # rows that follow from others must vanish with these
            jet
            for relation in d.relations
            if isinstance(relation, IndependentRows)
            for jet in relation.left_out(frames)
        ]
        terms: dict[str, list[Term]] = {
            'acceleration': [a[c] for c in self.system.coordinates],
            'gap': [jet.value for jet in d.contacts.normal],
            'closure': [jet.value for jet in [*d.equations.relation_jets, *following]],
            'normal_force': forces_N,
            'friction_force': list(solved.T),
            'friction_power': [add(*friction, taken)],
            'joint_loss': [add(*friction)],
            'load_power': [taken],
            'drive_torque': [*d.drive_torques(solved), *d.drives.torques],
            'reaction': [x for w in reactions.values() for x in (w.x, w.y)],
            'moment': [w.moment for w in reactions.values()],
            'energy': [kinetic, potential],
            'holding_rate': forces.rates(solved.a),
            'contact_loss': losses,
            'gap_rate': [
                dense(jet.rate) / gap.stretch(jet.value)
                for gap, jet in zip(self.system.gaps, d.contacts.normal, strict=True)
            ],
            'normal_angle': self.system.run.normal_angles,
        }
        if not d.frictional_joints:
            return terms
        acts, parts = forces.acting(solved), forces.parts(solved)
        terms['part'] = [s.flag for s in forces.holding.values()]
        found = substitute([dense(x) for x in chain.from_iterable(terms.values())], parts)
        groups = _in_groups(found, terms.values())
        return dict(zip(terms, groups, strict=True)) | {'residual': acts.residual}

    def _compiled(self, names: Sequence[str]) -> SwitchedFunction:
        """Compile the named terms as a function of the inputs that `_inputs` makes."""
        eq, d = self.system.equations, self.system.dynamics
        replace: dict[hy.expression, hy.expression] = {}
        flags = (
            *d.flags.closed,
            *d.flags.sticks.values(),
            *d.flags.slips.values(),
            *d.flags.approach,
            *d.flags.presses,
        )
        for k, flag in enumerate(flags):
            replace[flag] = hy.make_vars(f'flag{k}')
        variables = list(replace.values())
        sides = symbols(self.system.parameters.sides)
        for k in range(len(self.system.powered)):
            constant, *others = d.drives.coefficients[3 * k : 3 * k + 3]
            replace[constant] = hy.make_vars(f'torque{k}')
            variables.append(replace[constant])
            replace |= dict.fromkeys(others, hy.expression(0.0))
        for k, side in enumerate(sides):
            replace[side] = hy.make_vars(f'side{k}')
            variables.append(replace[side])
        terms = [self._terms[n] for n in names]
        whole = self.system.run.unpulled([*chain.from_iterable(terms)])
        groups = _in_groups(substitute(whole, replace), terms)
        frames = eq.frames
        state = [*frames.q.values(), *frames.v.values()]
        prescribed = [frames.a[c] for c in self.system.prescribed]
        variables = [*state, *prescribed, *variables, *frames.outside.values()]
        return SwitchedFunction(frames, groups, variables)

    @property
    def _has_joint_friction(self) -> bool:
        """True if ideal joints have friction, with which all that holds is found at once."""
        return bool(self.system.dynamics.frictional_joints)

    @cached_property
    def _holding_rates(self) -> SwitchedFunction:
        return self._compiled(['holding_rate'])

    def _with_parts(self, inputs: Array, rows: Array | None) -> Array | None:
        """The values (r, N) of the switches, with its part for each that holds."""
        flags, holds = self.system.set_valued.holding_rows
        if rows is None or self._has_joint_friction or not flags or not (rows[holds] > 0.0).any():
            return rows
        return with_holding_parts(self._holding_rates, inputs, rows, flags, holds)

    @cached_property
    def _observe(self) -> SwitchedFunction:
        return self._compiled([*_OBSERVED, *(['residual'] if self._has_joint_friction else [])])

    @cached_property
    def _account(self) -> SwitchedFunction:
        names = ['gap', 'closure', 'normal_force', 'joint_loss', 'drive_torque', 'energy']
        together = self.takes_power and not self.steep
        return self._compiled([*names, *(['load_power'] if together else [])])

    def observe(self, at: Instants) -> Observation:
        """Accelerations, forces and energies."""
        inputs = self._inputs(at)
        (
            a, gap, _, N, T, friction, drive_torque, reaction, moment, energy, *residual,
        ) = self._observe(inputs, self._with_parts(inputs, at.rows))  # fmt: skip
        if residual and np.abs(residual[0]).max(initial=0.0) > _JOINT_FRICTION.residual:
            raise RunError(
                'friction in ideal joints is not determined by their forces: it nearly jams; '
                'reduce the coefficient of friction or the radius'
            )
        with np.errstate(over='ignore'):  # of numbers near the largest
            drive_power = (drive_torque * at.v[self.system.driven_index]).sum(axis=0)
        return Observation(
            at.q,
            at.v,
            a,
            self.gaps.distances(gap),
            N,
            T,
            friction[0],
            reaction.reshape(-1, 2, at.q.shape[1]),
            moment,
            drive_torque,
            drive_power,
            energy[0],
            energy[1],
        )

    def account(self, at: Instants) -> Account:
        """Terms of the energy balance at the instants of `observe`; far cheaper."""
        inputs = self._inputs(at)
        gap, closure, N, friction, drive_torque, energy, *taken = self._account(
            inputs, self._with_parts(inputs, at.rows)
        )
        closed = np.where(at.modes > Mode.FREE_FLIGHT, gap, 0.0)
        ends = [closed.min(axis=1, initial=0.0), closed.max(axis=1, initial=0.0)]
        farthest = self.gaps.distances(np.array(ends).T)  # in any measure the ends are the ends
        left = max(np.abs(x).max(initial=0.0) for x in (farthest, closure))
        power = (drive_torque * at.v[self.system.driven_index]).sum(axis=0)
        load = taken[0][0] if taken else None
        return Account(N, friction[0], power, energy[0], energy[1], float(left), load)

    @cached_property
    def takes_power(self) -> bool:
        """True if springs, dampers, films or loads take any power."""
        frames = self.system.equations.frames
        return any(x.power_lost(frames) is not None for x in self.system.elements)

    @property
    def steep(self) -> bool:
        """True if loads or contacts may vary too steeply within a step for a Taylor series."""
        return self.system.compliant or self.system.steep is not None

    @cached_property
    def _load_power(self) -> SwitchedFunction:
        return self._compiled(['load_power'])

    def load_power(self, at: Instants) -> Array:
        """Power (N,) [W] that springs, dampers, films and loads take."""
        inputs = self._inputs(at)
        found: Array = self._load_power(inputs, self._with_parts(inputs, at.rows))[0][0]
        return found

    def parts(self, at: Instants) -> Array:
        """Parts (h, N) of the h switches that may hold, at the instants of `observe`."""
        inputs = self._inputs(at)
        if self._has_joint_friction:
            return self._compiled(['part'])(inputs, at.rows)[0]
        known = self._with_parts(inputs, at.rows)
        flags, _ = self.system.set_valued.holding_rows
        return np.zeros((len(flags), at.q.shape[1])) if known is None else known[flags]

    @cached_property
    def _touch(self) -> SwitchedFunction:
        return self._compiled(['normal_force', 'friction_force', *_OF_TOUCHES])

    def touch(self, at: Instants) -> TouchTerms:
        """Compliant contacts at the instants that `observe` would be given."""
        inputs = self._inputs(at)
        return TouchTerms(*self._touch(inputs, self._with_parts(inputs, at.rows)))

    def _inputs(self, at: Instants) -> Array:
        """One array of all inputs."""
        q, v, a_p, modes, torque, approach, outside, _, sides = at
        d, count = self.system.dynamics, q.shape[1]
        torque = np.zeros((len(self.system.powered), count)) if torque is None else torque
        flags: list[NDArray[Any]] = [modes > Mode.FREE_FLIGHT]
        if d.contacts.frictional:
            frictional = modes[d.contacts.frictional]
            forward = frictional == Mode.SLIDING_FORWARD
            backward = frictional == Mode.SLIDING_BACKWARD
            flags += [frictional == Mode.STICKING, forward * 1.0 - backward]
        if self.system.compliant:
            flags.append(np.ones_like(modes, float) if approach is None else approach)
            flags.append((modes > Mode.FREE_FLIGHT) & (modes < Mode.RECOVERING))
        given = np.zeros((len(self.system.outside), count)) if outside is None else outside
        known = np.ones((len(self.system.parameters.sides), count)) if sides is None else sides
        rows = (q, v, a_p, *(np.reshape(x, (-1, count)) for x in flags), torque, known, given)
        return np.concatenate(rows)
