"""Equations of motion, contacts and switches with exact derivatives, compiled when needed.

heyoka differentiates the expressions that runs are made of. What changes in a run (flags, rows of
switches, torque laws) are parameters here as there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array, IndexArray
from mechanism_sim.derivatives.numeric_keys import WEIGHTS
from mechanism_sim.engine.dense_output import Motion, instants
from mechanism_sim.engine.events import Mode
from mechanism_sim.engine.physics import DynamicPhysics
from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.polynomials import Times
from mechanism_sim.numerics.symbolic import Term, add, dot, mul
from mechanism_sim.planar.switches import Switch


class Points(NamedTuple):
    """A machine at N instants of its motion."""

    q: Array  #: (n, N) all coordinates
    v: Array  #: (n, N) their rates
    a_p: Array  #: (p, N) prescribed accelerations
    outside: Array  #: (k, N) values of `Frames.outside`
    parameters: Array  #: (r, N) runtime parameters


class Slopes(NamedTuple):
    """Accelerations of the f free coordinates and rates of s states, and their derivatives."""

    rate: Array  #: (f + s, N) accelerations, then rates of states
    q: Array  #: (f + s, n, N) derivatives by coordinates
    v: Array  #: (f + s, n, N) derivatives by their rates
    a_p: Array  #: (f + s, p, N) derivatives by prescribed accelerations
    states: Array  #: (f + s, s, N) derivatives by states of first order
    parameters: Array  #: (f + s, c, N) derivatives by the chosen parameters
    built_in: dict[int, Array]  #: (f + s, N) derivatives by keys in the equations themselves


class Selected(NamedTuple):
    """Weights that select terms of contacts in N columns; each column is a weighted sum."""

    gap: Array  #: (m, N) values of the gaps
    row: Array  #: (r, N) rates of the rows
    left: Array  #: (r, N) left and
    right: Array  #: (r, N) right factor of the compliance
    free: Array  #: (f, N) rates of coordinates by the impulses `right`
    drive: Array  #: (p, N) impulses of drives by the impulses `right`
    angle: Array  #: (m, N) directions of normals
    switch: Array  #: (k, N) arguments of the switches

    @classmethod
    def none(cls, sizes: Sequence[int], count: int) -> Selected:
        """Zero weights in `count` columns."""
        return cls(*(np.zeros((size, count)) for size in sizes))


class LinearEquations:
    """Functions of the points of a motion.

    Parameters
    ----------
    physics : physics of the machine
    chosen : (c,) indices of the parameters of differentiation
    beside : equations at the values of `numeric_keys.OFFSETS`, over their step, by the columns of
        keys whose numbers stand in the equations: of such a number there are differences only
    """

    def __init__(
        self,
        physics: DynamicPhysics,
        chosen: Sequence[int],
        beside: Mapping[int, tuple[float, list[LinearEquations]]] = MappingProxyType({}),
    ) -> None:
        self._beside = beside
        self.physics, self.system = physics, physics.system
        self.chosen = [*chosen]
        frames = self.system.equations.frames
        self._frames, self._dynamics = frames, self.system.dynamics
        self.outside = tuple(frames.outside)
        self._known = [
            *frames.q.values(), *frames.v.values(),
            *(frames.a[c] for c in self.system.prescribed), *frames.outside.values(),
        ]  # fmt: skip
        self._states = [frames.state(k) for k in range(len(self.system.states))]
        self._pars = [hy.par[i] for i in self.chosen]

    # --- points -------------------------------------------------------------------------------

    def points(
        self, motion: Motion, segments: IndexArray, dt: Times, damped: bool = True
    ) -> Points:
        """The machine at instants of a motion, as `DynamicPhysics.inputs` takes them.

        Parameters
        ----------
        damped : True if variations that leave constraints decay within a step
        """
        at = self.physics.inputs(motion, segments, dt)
        index, d, count = self.system.parameters, self._dynamics, at.q.shape[1]
        pars = np.repeat(index.values[:, None], count, axis=1)
        closed = at.modes > Mode.FREE_FLIGHT
        pars[index.closed] = closed
        if rough := d.contacts.frictional:
            modes = at.modes[rough]
            pars[index.sticks] = modes == Mode.STICKING
            forward = (modes == Mode.SLIDING_FORWARD).astype(float)
            pars[index.slips] = forward - (modes == Mode.SLIDING_BACKWARD)
        if index.approach:
            pars[index.approach] = at.approach
            pars[index.presses] = closed & (at.modes < Mode.RECOVERING)
        if index.sides:
            pars[index.sides] = at.sides
        if at.rows is not None:
            pars[[i for own in index.switches for i in own]] = at.rows
        if index.torques:
            laws = motion.torques_at(segments, dt)
            powered = self.system.driven_index[len(self.system.prescribed) :]
            turns = np.repeat(motion.curve.turns[segments][:, powered], instants(dt), axis=0).T
            laws[:, 0] += laws[:, 1] * (2.0 * np.pi * turns)
            for k, own in enumerate(index.torques):
                pars[own] = laws[k]
        if damped:  # not faster than usual steps: shortest ones would make rates of roundings
            h = motion.curve.duration
            longest = np.maximum(h[segments], np.median(h))
            pars[index.stabilisation] = 1.0 / np.repeat(longest, instants(dt))
        none = np.zeros((0, count))
        return Points(at.q, at.v, at.a_p, none if at.outside is None else at.outside, pars)

    def _compiled(self, terms: Sequence[Term], more: Sequence[hy.expression]) -> hy.cfunc_dbl:
        """Terms as a function of points and other symbols."""
        found = self.system.run.unpulled(terms)
        if self._dynamics.depths:
            found = list(hy.subs(found, self._dynamics.depths))
        replace = {
            symbol: hy.par[i]
            for known, own in zip(
                self.system.switches, self.system.parameters.switches, strict=True
            )
            for symbol, i in zip(known.symbols, own, strict=True)
        }
        found = list(hy.subs(found, replace)) if replace else found
        wanted = [*self._wanted, *self._pars]
        tensors = hy.diff_tensors(found, diff_args=wanted, diff_order=1)
        every = [*found, *(x for _, x in tensors.get_derivatives(1))]
        return compiled.function(every, [*self._known, *more])

    def _differences(self, value: Callable[[LinearEquations], Array]) -> dict[int, Array]:
        """Derivatives of values by numbers that stand in the equations."""
        found = {}
        for column, (step, others) in self._beside.items():
            values = np.array([value(other) for other in others])
            found[column] = np.tensordot(np.array(WEIGHTS), values, 1) / step
        return found

    @property
    def _wanted(self) -> list[hy.expression]:
        """The symbols by which all terms are differentiated, before the parameters."""
        frames, moved = self._frames, self.system.prescribed
        time = [self._time]
        return [*frames.q.values(), *frames.v.values(), *(frames.a[c] for c in moved),
                *self._states, *time]  # fmt: skip

    @property
    def _time(self) -> hy.expression:
        return self._frames.outside.get('time', hy.make_vars('no_time'))

    @staticmethod
    def _call(function: hy.cfunc_dbl, at: Points, more: Array | None = None) -> Array:
        known = [at.q, at.v, at.a_p, at.outside, *([] if more is None else [more])]
        inputs = np.ascontiguousarray(np.concatenate(known))
        pars = np.ascontiguousarray(at.parameters[: function.nparams])
        found: Array = function(inputs, pars=pars)
        return found

    # --- smooth motion ------------------------------------------------------------------------

    @cached_property
    def _smooth(self) -> hy.cfunc_dbl:
        d = self._dynamics
        return self._compiled(self.system.run.acted([*d.stabilised.a, *d.state_rates]), [])

    def slopes(self, at: Points) -> Slopes:
        """Derivatives of smooth motion."""
        n, p, s = len(self.system.coordinates), len(self.system.prescribed), len(self._states)
        count = len(self.system.free) + s
        found = self._call(self._smooth, at)
        rates, slopes = found[:count], found[count:].reshape(count, -1, found.shape[1])
        ends = np.cumsum([n, n, p, s, 1]).tolist()
        q, v, a_p, states, _, pars = np.split(slopes, ends, axis=1)
        moved = self._differences(lambda other: other._call(other._smooth, at)[:count])
        return Slopes(rates, q, v, a_p, states, pars, moved)

    # --- events -------------------------------------------------------------------------------

    @property
    def sizes(self) -> list[int]:
        """Sizes of the parts of `Selected`."""
        s, rows = self.system, len(self._dynamics.contacts.rows)
        m = len(s.gaps)
        return [m, rows, rows, rows, len(s.free), len(s.prescribed), m, len(s.switches)]

    @cached_property
    def _contacts(self) -> hy.cfunc_dbl:
        d = self._dynamics
        groups = [
            [hy.make_vars(f'selected{k}_{i}') for i in range(size)]
            for k, size in enumerate(self.sizes)
        ]
        gap, row, left, right, free, drive, angle, switch = groups
        unit = d.reduced.contacts
        switched = [s.inside if isinstance(s, Switch) else s.guard for s in self.system.switches]
        total = add(
            dot(gap, [jet.value for jet in d.contacts.normal]),
            dot(row, [jet.rate for jet in d.contacts.rows]),
            dot(left, [dot(right, line) for line in unit.compliance]),
            dot(right, [dot(free, line) for line in unit.response]),
            dot(right, [dot(drive, line) for line in unit.drive_response]),
            dot(angle, self.system.run.normal_angles),
            add(*(mul(q, x) for q, x in zip(switch, switched, strict=True))),
        )
        return self._compiled([total], [x for group in groups for x in group])

    def selected(self, at: Points, chosen: Selected) -> tuple[Array, Array, dict[int, Array]]:
        """Values (E N,) of contact terms, point by point, and their derivatives (z, E N).

        By coordinates, rates, prescribed accelerations, states, time, parameters; and (E N,) by
        keys whose numbers stand in the equations.

        Parameters
        ----------
        at : E points
        """
        columns = np.concatenate(chosen)
        wide = Points(*(np.repeat(x, columns.shape[1], axis=1) for x in at))
        columns = np.tile(columns, at.q.shape[1])
        found = self._call(self._contacts, wide, columns)
        moved = self._differences(lambda other: other._call(other._contacts, wide, columns)[0])
        return found[0], found[1:], moved

    @cached_property
    def _joint_friction(self) -> hy.cfunc_dbl:
        terms, _ = self.system.functions.joint_friction_terms
        unit = [hy.make_vars(f'chosen{i}') for i in range(len(terms))]
        return self._compiled([dot(unit, terms)], unit)

    def joint_friction(self, at: Points) -> tuple[Array, Array, dict[int, Array]]:
        """Values (N,) of the terms of joint friction, and their derivatives as of `selected`."""
        columns = np.eye(len(self.system.functions.joint_friction_terms[0]))
        wide = Points(*(np.repeat(x, len(columns), axis=1) for x in at))
        found = self._call(self._joint_friction, wide, columns)
        moved = self._differences(
            lambda other: other._call(other._joint_friction, wide, columns)[0]
        )
        return found[0], found[1:], moved
