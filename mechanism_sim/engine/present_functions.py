"""Compiled functions of the present state.

Their one argument is a vector: free coordinates, rates, states of first order, runtime parameters,
time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import heyoka as hy

from mechanism_sim.engine.run_expressions import RunExpressions
from mechanism_sim.numerics.symbolic import (
    Term,
    Vector,
    add,
    dense,
    dot,
    mul,
    neg,
    solve_symmetric,
    substitute,
)
from mechanism_sim.planar.reactions import energies


class PresentFunctions:
    """Functions that the event loop asks of the present state, compiled when first asked for.

    Parameters
    ----------
    run : expressions as they are in a run
    guards : gives those of the guards
    """

    def __init__(self, run: RunExpressions, guards: Callable[[], Sequence[hy.expression]]) -> None:
        self._run, self._guards = run, guards
        self._dynamics, self._forces = run.dynamics, run.set_valued

    def _compiled(self, terms: Sequence[Term]) -> hy.cfunc_dbl:
        """Compile terms for states that may be a rounding beyond a contact's depth zero."""
        return self._run.compile_now(self._run.unpulled(terms))

    @cached_property
    def holding_rates(self) -> hy.cfunc_dbl:
        """Rates of the functions of switches that may hold, then their parts; as `watch`."""
        rates = self._forces.rates(self._dynamics.stabilised.a)
        flags = (s.flag for s in self._forces.holding.values())
        return self._compiled(self._run.acted([*rates, *flags]))

    @cached_property
    def watch(self) -> hy.cfunc_dbl:
        """Values to be watched, at free coordinates, rates, states, parameters, time.

        The guards, the rates of the gaps, of compliant contacts their values, the places of the
        switches.
        """
        d, places = self._dynamics, (s.place for s in self._run.switches)
        values = (jet.value for jet in d.contacts.normal if d.contacts.compliant)
        rates = (jet.rate for jet in d.contacts.normal)
        return self._run.compile_now([*self._guards(), *rates, *values, *places])

    @cached_property
    def accelerations(self) -> hy.cfunc_dbl:
        """Accelerations of the free coordinates, as the integrator has them, and rates of states.

        Of the same vector as `watch`.
        """
        rates = [*self._dynamics.stabilised.a, *self._run.state_rates]
        return self._run.compile_now(self._run.acted(rates))

    @cached_property
    def supplied(self) -> hy.cfunc_dbl:
        """Torques of the drives that hold their law, then the kinetic energy; as `watch`."""
        d = self._dynamics
        torques = d.drive_torques(d.stabilised)
        return self._compiled(self._run.acted([*torques, energies(d.equations)[0]]))

    @cached_property
    def contact_function(self) -> hy.cfunc_dbl:
        """Terms of the gaps, as `contact.problem.problem_of` reads them; of `watch`'s vector."""
        d, rows = self._dynamics, self._dynamics.contacts.rows
        terms = [
            *(jet.value for jet in d.contacts.normal),
            *(jet.rate for jet in rows),
            *d.free_acceleration,
            *d.acceleration,
            *(x for W in d.reduced.contacts.response for x in W),
            *(x for row in d.reduced.contacts.compliance for x in row),
            *(x for row in d.reduced.contacts.drive_response for x in row),
            *self._run.normal_angles,
            *(d.relief(i) for i in range(len(d.gaps) if d.contacts.compliant else 0)),
        ]
        if d.frictional_joints:
            values = self._forces.acting(d.exact).values
            friction_forces = {joint.T: values[joint.T] for joint in d.frictional_joints}
            terms = substitute([dense(x) for x in terms], friction_forces)
        return self._compiled(terms)

    @cached_property
    def joint_friction_function(self) -> tuple[hy.cfunc_dbl, list[list[tuple[int, int]]]]:
        """`joint_friction_terms` of `watch`'s vector."""
        terms, sizes = self.joint_friction_terms
        return self._run.compile_now(terms), sizes

    @cached_property
    def joint_friction_terms(self) -> tuple[list[hy.expression], list[list[tuple[int, int]]]]:
        """Terms that `contact.joint_friction.joint_friction_problem` reads; sizes of all bounds.

        The latter are how many components each term of each bound has, and its wall.
        """
        d, frames = self._dynamics, self._dynamics.equations.frames
        unit = [hy.make_vars(f'struck{k}') for k in range(len(d.contacts.rows))]
        impulses = [*unit, *(joint.T for joint in d.frictional_joints)]
        carried = self._forces.reactions(d.struck(unit))
        bounds = [
            joint.friction.pressed(frames, carried[joint.friction.name])
            for joint in d.frictional_joints
        ]
        forces = [dense(c) for b in bounds for p in b for c in p.components]
        terms = [
            *(joint.slip.rate for joint in d.frictional_joints),
            *(x for w in d.reduced.joints.response for x in w),
            *(x for row in d.reduced.joints.compliance for x in row),
            *(x for row in d.reduced.joints.drive_response for x in row),
            *(hy.diff(force, x) for force in forces for x in impulses),
            *(p.coefficient for b in bounds for p in b),
        ]
        # flanks of teeth bear as they did before the impact
        none = dict.fromkeys(impulses, hy.expression(0.0))
        terms = substitute([dense(x) for x in terms], none)
        sizes = [[(len(p.components), p.wall) for p in b] for b in bounds]
        return terms, sizes

    @cached_property
    def pressing(self) -> hy.cfunc_dbl:
        """Normal forces of joints with friction [N], as `sides` has them; of `watch`'s vector."""
        return self._compiled(self._forces.acting(self._dynamics.exact).pressed)

    @cached_property
    def projection(self) -> hy.cfunc_dbl:
        """The state with loops and closed gaps brought to zero, in value and rate.

        Along M^-1 J^T; what sticks loses its tangential velocity too. Behind it come the distances
        of the closures from depending on each other. Of the same vector as `watch`.
        """
        d, frames = self._dynamics, self._dynamics.equations.frames
        closures, active = d.equations.relation_jets, d.contacts.active
        outputs: list[Term] = []
        for symbol, rows, quantity in (
            (frames.q, d.contacts.normal, 'value'),
            (frames.v, d.contacts.rows, 'rate'),
        ):
            shift = d.reduced.closing_shift([getattr(jet, quantity) for jet in closures])
            count = range(len(rows))
            K = [[self._kept(i, k) for k in count] for i in count]
            off = [
                add(getattr(jet, quantity), dot(row, shift))
                for jet, row in zip(rows, d.reduced.J, strict=False)
            ]
            impulses: Vector = []
            if rows:
                wanted = [neg(mul(a, x)) for a, x in zip(active, off, strict=False)]
                impulses = solve_symmetric(K, [wanted])[0]
            response = d.reduced.contacts.response[
                : len(rows)
            ]  # of positions only the normal rows
            outputs += [
                add(symbol[c], shift[i], *map(mul, (W[i] for W in response), impulses))
                for i, c in enumerate(d.free)
            ]
        return self._run.compile_now([*outputs, *(d.distances if closures else [])])

    def _kept(self, i: int, k: int) -> Term:
        """Compliance between rows that are kept, and the identity for others."""
        contacts, entry = self._dynamics.contacts, self._dynamics.reduced.contacts.compliance[i][k]
        if i == k and contacts.softness[i] is not None:
            entry = mul(entry, 1.0 + dense(contacts.softness[i]))
        entry = mul(mul(contacts.active[i], contacts.active[k]), entry)
        return add(entry, 1.0 - contacts.active[i] if i == k else None)

    @cached_property
    def pin_forces(self) -> hy.cfunc_dbl:
        """Components of the forces in pins with friction, one after the other; as `watch`."""
        carried = self._forces.acting(self._dynamics.stabilised).carried
        return self._compiled([c for pair in carried for c in pair])
