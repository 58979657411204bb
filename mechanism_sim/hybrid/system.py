"""A mechanism with gaps, compiled: its flight and its contact in one set of machine code.

Which gaps are closed is a runtime flag s of each gap: ``s N`` stands in the equations and one
guard per gap, ``(1 - s) gap + s N``, falls through zero when an open gap touches and when a closed
one lets go.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics.symbolic import (
    Matrix,
    Term,
    Vector,
    add,
    dense,
    dot,
    mul,
    neg,
    solve_symmetric,
)
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import Gap
from mechanism_sim.planar.reactions import energies, generalized_forces, tree_reactions

Array = NDArray[np.float64]

TINY = 1.0625e-300
"""Keeps a guard off exact zero, from where the integrator would never fire it."""

FORCE_SCALE = 1e-6
"""[m/N] Makes forces in guards so small that they do not rule the size of the steps."""


class ContactTerms(NamedTuple):
    """The gaps at one state: m gaps, f free coordinates, p prescribed ones."""

    value: list[float]  #: (m,) [m]
    rate: list[float]  #: (m,) [m/s]
    free_acceleration: list[float]  #: (m,) second derivative while no gap carries force [m/s^2]
    response: list[list[float]]  #: (m, f) M^-1 J^T: rates gained per unit impulse
    compliance: list[list[float]]  #: (m, m) J M^-1 J^T: gap rates per unit impulse [1/kg]
    drive_response: list[list[float]]  #: (m, p) impulse of the drives per unit impulse
    normal_angle: list[float]  #: (m,) [rad]


class System:
    """Equations of a mechanism with gaps and prescribed coordinates, ready to run.

    Parameters
    ----------
    mechanism : the tree of links
    gaps : its joints with clearance
    prescribed : names of the coordinates whose law the drive gives
    degree : degree of these laws as polynomials in time

    Attributes
    ----------
    parameters : values of the runtime parameters ``par[]``, SI units
    flag_index : of every gap, which of them says that it is closed
    law_index : of every prescribed coordinate, which of them are its law's coefficients
    stabilisation_index : which of them is the rate of Baumgarte's method [1/s]
    """

    def __init__(
        self, mechanism: Mechanism, gaps: Sequence[Gap], prescribed: Sequence[str], degree: int
    ) -> None:
        self.mechanism = mechanism
        self.gaps = tuple(gaps)
        self.coordinates = mechanism.coordinates
        self.prescribed = tuple(prescribed)
        self.free = tuple(c for c in self.coordinates if c not in prescribed)
        self.prescribed_index = [self.coordinates.index(c) for c in self.prescribed]
        self.degree = degree
        self.equations = Equations(mechanism, gaps)
        p = self.equations.parameters
        self._flags = [p.reserve(f'{g.name}.closed') for g in self.gaps]
        self._stabilisation = p.reserve('stabilisation')
        self._laws = {
            c: [p.reserve(f'{c}.law.{k}') for k in range(degree + 1)] for c in self.prescribed
        }
        self._solve()
        self.parameters = np.array(p.values)
        self.flag_index = [p.names[f'{g.name}.closed'] for g in self.gaps]
        self.stabilisation_index = p.names['stabilisation']
        self.law_index = [
            [p.names[f'{c}.law.{k}'] for k in range(degree + 1)] for c in self.prescribed
        ]

    def _solve(self) -> None:
        """Accelerations and contact forces as expressions of state and flags."""
        eq, index = self.equations, self.coordinates.index
        f, p = [index(c) for c in self.free], [index(c) for c in self.prescribed]
        M_ff: Matrix = [[eq.M[i][j] for j in f] for i in f]
        a_p: Vector = [eq.frames.a[c] if self.degree > 1 else None for c in self.prescribed]
        rhs: Vector = [neg(add(eq.bias[i], dot([eq.M[i][j] for j in p], a_p))) for i in f]
        rows = [jet.row(self.coordinates) for jet in eq.gap_jets]
        J_f: Matrix = [[row[i] for i in f] for row in rows]
        J_p: Matrix = [[row[i] for i in p] for row in rows]
        solved = solve_symmetric(M_ff, [rhs, *J_f])
        a_0, self._W = solved[0], solved[1:]
        self._A: Matrix = [[dot(J_i, W_k) for W_k in self._W] for J_i in J_f]
        self._b: Vector = [
            add(dot(J_f[i], a_0), dot(J_p[i], a_p), jet.curvature)
            for i, jet in enumerate(eq.gap_jets)
        ]
        s = self._flags
        K = self._flagged_compliance()
        N = solve_symmetric(K, [[neg(mul(s[i], self._b[i])) for i in range(len(s))]])
        self._N: Vector = N[0] if s else []
        self._a_f = self._with_forces(a_0, self._N)
        # Closed gaps are drawn back to zero within about a step: Baumgarte's method with a rate
        # that the event loop sets to the reciprocal of the last step.
        alpha = self._stabilisation
        drawn = [
            neg(mul(s[i], add(b, mul(2.0 * alpha, j.rate), mul(alpha * alpha, j.value))))
            for i, (b, j) in enumerate(zip(self._b, eq.gap_jets, strict=True))
        ]
        N = solve_symmetric(K, [drawn])
        self._stabilised_N: Vector = N[0] if s else []
        self._stabilised_a_f = self._with_forces(a_0, self._stabilised_N)
        self._J_p, self._a_p = J_p, a_p
        self._drive_response: Matrix = [
            [add(dot([eq.M[i][j] for j in f], W), neg(J_p[k][p.index(i)]))
             for k, W in enumerate(self._W)]
            for i in p
        ]  # fmt: skip

    def _with_forces(self, a_0: Vector, N: Vector) -> Vector:
        return [
            add(a, *(mul(W[i], n) for W, n in zip(self._W, N, strict=True)))
            for i, a in enumerate(a_0)
        ]

    def _flagged_compliance(self) -> Matrix:
        """``S A S + 1 - S``: the compliance of closed gaps, the identity for open ones."""
        s, A = self._flags, self._A
        return [
            [
                add(mul(s[i], A[i][k]), 1.0 - s[i]) if i == k else mul(s[i] * s[k], A[i][k])
                for k in range(len(s))
            ]
            for i in range(len(s))
        ]

    def _symbols(self) -> list[hy.expression]:
        frames = self.equations.frames
        return [*frames.q.values(), *frames.v.values()]

    def integrator(
        self, rtol: float, scale: float = 1.0, compact: bool = False
    ) -> hy.taylor_adaptive_dbl:
        """Adaptive Taylor integrator with one terminal guard per gap.

        State: free coordinates, their rates, and a constant that only sets the step. heyoka ties
        its order p to its tolerance, ``tol = exp(-2 (p - 1))``, and steps so that the last term
        is about `tol` of the largest state variable. A quarter more than the order it would
        take for `rtol` makes fewer and cheaper steps; the constant, as the largest state variable,
        keeps the error where it should be.

        Parameters
        ----------
        rtol : wanted error of a step relative to `scale`
        scale : size of the largest rate [rad/s]
        compact : compile slower but smaller code (for many coordinates)
        """
        order = math.ceil(1.25 * (1.0 - 0.5 * math.log(rtol)))
        tolerance = math.exp(-2.0 * (order - 1.5))
        constant = hy.make_vars('step_constant')
        frames = self.equations.frames
        a = [dense(x) for x in self._stabilised_a_f]
        guards = [
            (1.0 - s) * dense(jet.value) + s * (FORCE_SCALE * dense(n)) + TINY
            for s, jet, n in zip(
                self._flags, self.equations.gap_jets, self._stabilised_N, strict=True
            )
        ]
        driven = self._driven([*a, *guards])
        a, guards = driven[: len(a)], driven[len(a) :]
        sys = [(frames.q[c], frames.v[c]) for c in self.free]
        sys += [(frames.v[c], a_c) for c, a_c in zip(self.free, a, strict=True)]
        events = [
            hy.t_event(g, direction=hy.event_direction.negative, cooldown=0.0) for g in guards
        ]
        return hy.taylor_adaptive(
            [*sys, (constant, hy.expression(0.0))],
            [0.0] * len(sys) + [scale * rtol / tolerance],
            pars=self.parameters,
            tol=tolerance,
            t_events=events,
            compact_mode=compact,
        )

    def _driven(self, expressions: Sequence[hy.expression]) -> list[hy.expression]:
        """The expressions with the laws of the prescribed coordinates put in."""
        frames = self.equations.frames
        replace: dict[str | hy.expression, hy.expression] = {}
        for name, c in self._laws.items():
            for symbol, d in ((frames.q, 0), (frames.v, 1), (frames.a, 2)):
                value: Term = None  # by Horner: a power of time has no Taylor series at zero
                for k in range(self.degree, d - 1, -1):
                    value = add(mul(value, hy.time), math.perm(k, d) * c[k])
                replace[symbol[name]] = dense(value)
        return list(hy.subs(list(expressions), replace))

    def _on_free_state(self, outputs: Sequence[Term]) -> hy.cfunc_dbl:
        """Compiled function of the integrator's state, parameters and time."""
        frames = self.equations.frames
        variables = [*(frames.q[c] for c in self.free), *(frames.v[c] for c in self.free)]
        return hy.cfunc(self._driven([dense(o) for o in outputs]), vars=variables)

    @cached_property
    def contact_function(self) -> hy.cfunc_dbl:
        """Terms of the gaps, to be read by `contact_terms`."""
        jets = self.equations.gap_jets
        normals = [gap.normal(self.equations.frames) for gap in self.gaps]
        return self._on_free_state(
            [
                *(jet.value for jet in jets),
                *(jet.rate for jet in jets),
                *self._b,
                *(x for row in self._W for x in row),
                *(x for row in self._A for x in row),
                *(row[k] for k in range(len(jets)) for row in self._drive_response),
                *(hy.atan2(dense(y.value), dense(x.value)) for x, y in normals),
            ]
        )

    def contact_terms(self, out: list[float]) -> ContactTerms:
        """The output of `contact_function` by name."""
        m, f, p = len(self.gaps), len(self.free), len(self.prescribed)
        if m == 1:
            value, rate, free = out[:3]
            compliance, drive, angle = [out[3 + f]], out[4 + f : 4 + f + p], out[4 + f + p :]
            return ContactTerms(
                [value], [rate], [free], [out[3 : 3 + f]], [compliance], [drive], angle
            )
        i = 3 * m + m * f
        j = i + m * m
        k = j + m * p
        return ContactTerms(
            out[:m],
            out[m : 2 * m],
            out[2 * m : 3 * m],
            [out[3 * m + r * f : 3 * m + (r + 1) * f] for r in range(m)],
            [out[i + r * m : i + (r + 1) * m] for r in range(m)],
            [out[j + r * p : j + (r + 1) * p] for r in range(m)],
            out[k:],
        )

    @cached_property
    def projection(self) -> hy.cfunc_dbl:
        """The state with closed gaps brought to zero, in value and rate, along M^-1 J^T."""
        frames, s = self.equations.frames, self._flags
        jets = self.equations.gap_jets
        K = self._flagged_compliance()
        shifts = solve_symmetric(
            K,
            [
                [neg(mul(flag, jet.value)) for flag, jet in zip(s, jets, strict=True)],
                [neg(mul(flag, jet.rate)) for flag, jet in zip(s, jets, strict=True)],
            ],
        )
        return self._on_free_state(
            [
                add(symbol[c], *(mul(W[i], x) for W, x in zip(self._W, shift, strict=True)))
                for symbol, shift in zip((frames.q, frames.v), shifts, strict=True)
                for i, c in enumerate(self.free)
            ]
        )

    @cached_property
    def _observe(self) -> hy.cfunc_dbl:
        eq = self.equations
        a: dict[str, Term] = dict(zip(self.free, self._a_f, strict=True))
        a |= dict(zip(self.prescribed, self._a_p, strict=True))
        normals = [gap.normal(eq.frames) for gap in self.gaps]
        cut = {
            gap.name: (mul(n, x.value), mul(n, y.value))
            for gap, n, (x, y) in zip(self.gaps, self._N, normals, strict=True)
        }
        reactions = tree_reactions(eq, a, cut)
        supplied = generalized_forces(eq, a)
        torques = [
            add(
                supplied[self.coordinates.index(c)],
                *(neg(mul(row[k], n)) for row, n in zip(self._J_p, self._N, strict=True)),
            )
            for k, c in enumerate(self.prescribed)
        ]
        outputs: list[Term] = [
            *(a[c] for c in self.coordinates),
            *(jet.value for jet in eq.gap_jets),
            *self._N,
            *torques,
            *(x for force in reactions.values() for x in force),
            *energies(eq),
        ]
        flags = [hy.make_vars(f'{g.name}.closed') for g in self.gaps]
        replace = dict(zip(self._flags, flags, strict=True))
        expressions = hy.subs([dense(o) for o in outputs], replace)
        variables = [*self._symbols(), *(eq.frames.a[c] for c in self.prescribed), *flags]
        return hy.cfunc(expressions, vars=variables)

    def observe(self, q: Array, v: Array, a_p: Array, closed: Array) -> Observation:
        """Accelerations, forces and energies at N instants.

        Parameters
        ----------
        q, v : (n, N) of all coordinates
        a_p : (p, N) prescribed accelerations
        closed : (m, N) 1.0 where a gap is closed
        """
        inputs = np.ascontiguousarray(np.concatenate([q, v, a_p, closed]))
        count = inputs.shape[1]
        pars = np.repeat(self._observe_parameters[:, None], count, axis=1)
        out = self._observe(inputs, pars=pars)
        n, m, p = len(self.coordinates), len(self.gaps), len(self.prescribed)
        ends = np.cumsum([n, m, m, p, 2 * len(self.mechanism.joints)])
        a, gap, force, torque, reaction, energy = np.split(out, ends)
        return Observation(
            q,
            v,
            a,
            np.array([g.distance(row) for g, row in zip(self.gaps, gap, strict=True)]),
            force,
            reaction.reshape(-1, 2, count),
            torque,
            (torque * v[self.prescribed_index]).sum(axis=0),
            energy[0],
            energy[1],
        )

    @cached_property
    def _gaps(self) -> hy.cfunc_dbl:
        frames = self.equations.frames
        values = [dense(jet.value) for jet in self.equations.gap_jets]
        return hy.cfunc(values, vars=list(frames.q.values()))

    def gap_values(self, q: Array) -> Array:
        """The gaps (m, N) [m] in their own measure at angles q (n, N)."""
        pars = np.repeat(self.parameters[: self._gaps.nparams, None], q.shape[1], axis=1)
        return np.asarray(self._gaps(np.ascontiguousarray(q), pars=pars))

    @cached_property
    def _observe_parameters(self) -> Array:
        return np.array(self.equations.parameters.values[: self._observe.nparams])
