"""Expressions as a run needs them: laws and switches as parameters, set-valued forces put in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import heyoka as hy

from mechanism_sim.engine.dynamics import Dynamics
from mechanism_sim.engine.runtime_parameters import lay_out, symbols
from mechanism_sim.engine.set_valued_forces import SetValuedForces
from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, substitute


class RunExpressions:
    """Expressions of the equations of motion in a run: laws and switches as parameters.

    Attributes
    ----------
    dynamics : the equations of motion
    normals : components of the normal of every gap, from bushing to pin
    set_valued : set-valued forces: loads against a motion, friction in ideal joints
    switches : switches of all loads, tables and frictions
    parameters : indices and values of the runtime parameters ``par[]``
    """

    def __init__(self, dynamics: Dynamics) -> None:
        self.dynamics = dynamics
        # all that is looked at in a run must have its parameters before they are counted
        self.normals = [gap.normal(dynamics.equations.frames) for gap in dynamics.gaps]
        self.set_valued = SetValuedForces(dynamics)
        self.switches = self.set_valued.switches
        self.parameters = lay_out(dynamics, self.set_valued.pins)

    @property
    def scaled_states(self) -> list[hy.expression]:
        """Symbols of the states of first order, over their scales."""
        return [hy.make_vars(f'scaled{k}') for k in range(len(self.dynamics.states))]

    @property
    def state_rates(self) -> list[hy.expression]:
        """Derivatives of `scaled_states`."""
        known = zip(self.dynamics.states, self.dynamics.state_rates, strict=True)
        return [rate * (1.0 / state.scale) for state, rate in known]

    @property
    def normal_angles(self) -> list[Term]:
        """Directions [rad] of the normals of the gaps, from bushing to pin."""
        return [hy.atan2(dense(y.value), dense(x.value)) for x, y in self.normals]

    @cached_property
    def _parts(self) -> dict[hy.expression, hy.expression]:
        """Set-valued forces in the integrator's equations, see `SetValuedForces.parts`."""
        return self.set_valued.parts(self.dynamics.stabilised)

    def acted(self, expressions: Sequence[Term]) -> list[hy.expression]:
        """The expressions with the set-valued forces of loads and joint friction put in."""
        terms = [dense(x) for x in expressions]
        return substitute(terms, self._parts)

    def driven(self, expressions: Sequence[hy.expression]) -> list[hy.expression]:
        """The expressions with the laws of prescribed coordinates and `Frames.outside` put in.

        Flags of switches that hold are parameters.
        """
        frames = self.dynamics.equations.frames
        expressions = substitute(expressions, self.dynamics.depths)
        replace: dict[hy.expression, hy.expression] = {}
        for name, index in zip(self.dynamics.prescribed, self.parameters.laws, strict=True):
            c = symbols(index)
            for symbol, d in ((frames.q, 0), (frames.v, 1), (frames.a, 2)):
                value: Term = None  # by Horner: a power of time has no Taylor series at zero
                for k in range(self.dynamics.degree, d - 1, -1):
                    value = add(mul(value, hy.time), math.perm(k, d) * c[k])
                replace[symbol[name]] = dense(value)
        for known, pars in zip(frames.switches.values(), self.parameters.switches, strict=True):
            replace |= {symbol: hy.par[i] for symbol, i in zip(known.symbols, pars, strict=True)}
        for name, i in self.parameters.outside.items():
            symbol = frames.outside[name]
            replace[symbol] = hy.par[i] + hy.time if name == 'time' else hy.par[i]
        for k, (state, y) in enumerate(zip(self.dynamics.states, self.scaled_states, strict=True)):
            replace[frames.state(k)] = state.scale * y
        return substitute(expressions, replace)

    def compile_now(self, outputs: Sequence[Term]) -> hy.cfunc_dbl:
        """Compiled function of one vector: free coordinates, rates, states, parameters and time.

        A call with parameters and time apart takes more than twice as long.
        """
        frames = self.dynamics.equations.frames
        replace = {
            hy.par[i]: hy.make_vars(f'parameter{i}') for i in range(len(self.parameters.values))
        }
        replace[hy.time] = hy.make_vars('now')
        state = [
            *(frames.q[c] for c in self.dynamics.free),
            *(frames.v[c] for c in self.dynamics.free),
            *self.scaled_states,
        ]
        expressions = self.driven([dense(o) for o in outputs])
        return compiled.function(substitute(expressions, replace), [*state, *replace.values()])

    def unpulled(self, terms: Sequence[Term]) -> list[hy.expression]:
        """The terms for states that may be a rounding beyond the depth zero of a contact.

        Depths are clipped at zero for real powers; a Taylor series allows no such clip.
        """
        found = [dense(x) for x in terms]
        if not self.dynamics.contacts.compliant:
            return found
        depths = self.dynamics.depths.items()
        return substitute(found, {symbol: hy.relu(depth) for symbol, depth in depths})
