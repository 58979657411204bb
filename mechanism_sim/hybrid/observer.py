"""Observation of a system in a given state: accelerations, forces, energies, gaps.

The event loop needs none of it; functions are compiled when they are first called for.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.errors import RunError
from mechanism_sim.hybrid.events import Mode
from mechanism_sim.hybrid.runtime_parameters import symbols
from mechanism_sim.hybrid.system import System
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.inverse_dynamics import Account, Observation
from mechanism_sim.planar.joint_friction import with_friction
from mechanism_sim.planar.reactions import energies, generalized_forces
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.tolerances import TOLERANCES

_CONTACTS = TOLERANCES.contacts
_JOINT_FRICTION = TOLERANCES.joint_friction


class Instants(NamedTuple):
    """Where a machine is at N instants."""

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


def _together(
    free: Array, jump: Array, held: NDArray[np.bool_]
) -> tuple[Array, NDArray[np.bool_]]:
    """Parts (h, N) of what holds that leave no rates, and where (N,) there are such of 0 to 1.

    Iteration may go to and fro for ever: what holds one rate may turn another one.

    Parameters
    ----------
    free : (h, N) rates of what is held, without any part
    jump : (h, h, N) what all of the first makes of the rate of the second
    held : (h, N) whether it holds
    """
    several = held.sum(axis=0) > 1
    both = held[:, None] & held[None]
    A = np.where(both, jump.transpose(1, 0, 2), np.eye(len(held))[..., None]).transpose(2, 0, 1)
    size = np.maximum(np.abs(A).max(axis=2, keepdims=True), TOLERANCES.rounding.least)
    A, b = A / size, -np.where(held, free, 0.0).T[..., None] / size
    several &= np.abs(np.linalg.det(A)) > _JOINT_FRICTION.dependent
    found = np.zeros(held.shape)
    found[:, several] = np.linalg.solve(A[several], b[several])[..., 0].T
    inside = (found >= 0.0) & (found <= 1.0)
    return found, several & inside.all(axis=0)


class Observer:
    """Functions of states of a system.

    Parameters
    ----------
    system : the equations
    """

    def __init__(self, system: System) -> None:
        self.system = system

    @cached_property
    def _terms(self) -> dict[str, list[Term]]:
        """The terms of `observe` and `account` as expressions."""
        eq, d = self.system.equations, self.system.dynamics
        solved = d.exact
        a, forces = d.accelerations(solved), self.system.set_valued
        reactions = with_friction(d.rubs, forces.reactions(solved), eq.frames)
        supplied = generalized_forces(eq, a)
        torques = [
            add(supplied[self.system.coordinates.index(c)], neg(d.on_prescribed(k, solved)))
            for k, c in enumerate(self.system.prescribed)
        ]
        friction = [
            neg(mul(solved.T[i], d.contacts.tangent[i].rate)) for i in d.contacts.frictional
        ]
        taken = add(*(element.power_lost(eq.frames) for element in self.system.elements))
        friction += [*(rub.power_lost for rub in d.rubs), eq.strain_loss]
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
        terms: dict[str, list[Term]] = {
            'acceleration': [a[c] for c in self.system.coordinates],
            'gap': [jet.value for jet in d.contacts.normal],
            'closure': [jet.value for jet in d.equations.relation_jets],
            'normal_force': forces_N,
            'friction_force': list(solved.T),
            'friction_power': [add(*friction, taken)],
            'joint_loss': [add(*friction)],
            'load_power': [taken],
            'drive_torque': [*torques, *d.drives.torques],
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
        if not d.rubs:
            return terms
        acts, parts = forces.acting(solved), forces.parts(solved)
        terms['part'] = [s.flag for s in forces.holding.values()]
        found = {
            name: list(hy.subs([dense(x) for x in group], parts)) for name, group in terms.items()
        }
        return found | {'residual': acts.residual}

    def _compiled(self, names: Sequence[str]) -> SwitchedFunction:
        """These terms as a function of what `_inputs` makes."""
        eq, d = self.system.equations, self.system.dynamics
        replace: dict[str | hy.expression, hy.expression] = {}
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
        groups = [self.system.run.unpulled(self._terms[name]) for name in names]
        if replace:
            groups = [list(hy.subs(group, replace)) for group in groups]
        frames = eq.frames
        state = [*frames.q.values(), *frames.v.values()]
        prescribed = [frames.a[c] for c in self.system.prescribed]
        variables = [*state, *prescribed, *variables, *frames.outside.values()]
        return SwitchedFunction(frames, groups, variables)

    @property
    def _rubs(self) -> bool:
        """True if ideal joints have friction, with which all that holds is found at once."""
        return bool(self.system.dynamics.rubs)

    @cached_property
    def _holding_rates(self) -> SwitchedFunction:
        return self._compiled(['holding_rate'])

    def _with_parts(self, inputs: Array, rows: Array | None) -> Array | None:
        """The values (r, N) of the switches, with its part for each that holds.

        Several that hold at once have those that leave no rates of what they hold; where these do
        not lie between 0 and 1, those of 0 to 1 that leave least, by projected Gauss-Seidel
        iteration.
        """
        flags, holds = self.system.set_valued.holding_rows
        if rows is None or self._rubs or not flags or not (held := rows[holds] > 0.0).any():
            return rows
        columns = np.flatnonzero(held.any(axis=0))
        held, now, inputs = held[:, columns], rows[:, columns], inputs[:, columns]
        now[flags] = np.where(held, 0.0, now[flags])
        (free,) = self._holding_rates(inputs, now)
        slopes = []
        for flag, own in zip(flags, held, strict=True):
            now[flag] += own
            slopes.append(self._holding_rates(inputs, now)[0] - free)
            now[flag] -= own
        parts, jump = np.zeros(held.shape), np.array(slopes)
        exact, alone = _together(free, jump, held)
        for _ in range(0 if alone.all() else _JOINT_FRICTION.sweeps):
            change = np.zeros(())
            for k, own in enumerate(held):
                acts = own & (jump[k, k] < 0.0)
                slope = np.where(acts, jump[k, k], -1.0)
                left = free[k] + (jump[:, k] * parts).sum(axis=0)
                part = np.where(acts, np.clip(parts[k] - left / slope, 0.0, 1.0), 0.0)
                change = np.maximum(change, np.abs(part - parts[k])[~alone].max())
                parts[k] = part
            if change < _JOINT_FRICTION.settled:
                break
        parts = np.where(alone, exact, parts)
        now[flags] = np.where(held, parts, now[flags])
        found = rows.copy()
        found[:, columns] = now
        return found

    @cached_property
    def _observe(self) -> SwitchedFunction:
        return self._compiled([*_OBSERVED, *(['residual'] if self._rubs else [])])

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
                'friction in ideal joints does not follow from their forces: it nearly jams; '
                'a smaller coefficient or radius runs'
            )
        return Observation(
            at.q,
            at.v,
            a,
            self.distances(gap),
            N,
            T,
            friction[0],
            reaction.reshape(-1, 2, at.q.shape[1]),
            moment,
            drive_torque,
            (drive_torque * at.v[self.system.driven_index]).sum(axis=0),
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
        farthest = self.distances(np.array(ends).T)  # in any measure the ends are the ends
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
        """True if loads or contacts may vary within a step in a way that no series foretells."""
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
        if self._rubs:
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

    def distances(self, values: Array) -> Array:
        """The gaps (m, N) [m] that belong to values in their own measure."""
        rows = [g.distance(row) for g, row in zip(self.system.gaps, values, strict=True)]
        return np.array(rows).reshape(values.shape)

    @cached_property
    def _gap_values(self) -> SwitchedFunction:
        frames = self.system.equations.frames
        values = [jet.value for jet in self.system.dynamics.contacts.normal]
        return SwitchedFunction(frames, [values], self._positions)

    @property
    def _positions(self) -> list[hy.expression]:
        return list(self.system.equations.frames.q.values())

    @cached_property
    def _distance(self) -> SwitchedFunction:
        return SwitchedFunction(
            self.system.equations.frames, [[self.system.dynamics.distance]], self._positions
        )

    def distance(self, q: Array) -> Array:
        """How far the closures are from depending on each other (N,) at coordinates q (n, N)."""
        found: Array = self._distance(q)[0][0]
        return found

    @cached_property
    def _gap_rates(self) -> SwitchedFunction:
        frames, normal = self.system.equations.frames, self.system.dynamics.contacts.normal
        groups = [
            [jet.rate for jet in normal],
            [g.stretch(jet.value) for g, jet in zip(self.system.gaps, normal, strict=True)],
            [jet.value for jet in normal],
            *([pair[k].rate for pair in self.system.run.normals] for k in (0, 1)),
        ]
        return SwitchedFunction(frames, groups, [*frames.q.values(), *frames.v.values()])

    def gap_rates(self, q: Array, v: Array) -> Array:
        """How fast the gaps open (m, N) [m/s] at coordinates and rates (n, N).

        From the centre of its bushing a pin comes nearer in every direction, as fast as it moves:
        there the normal Q/c turns with Q'/c, and the measure of the gap is c/2.
        """
        rates, stretch, value, nx, ny = self._gap_rates(np.concatenate([q, v]))
        # by rounding it may be the root of less than zero
        central = ~(stretch >= _CONTACTS.central)
        opening: Array = np.where(
            central, -2.0 * value * np.hypot(nx, ny), rates / np.where(central, 1.0, stretch)
        )
        return opening

    def gap_values(self, q: Array, rows: Array | None = None) -> Array:
        """The gaps (m, N) [m] in their own measure at coordinates q (n, N); `rows` as above."""
        return self._gap_values(q, rows)[0] if self.system.gaps else np.zeros((0, q.shape[1]))
