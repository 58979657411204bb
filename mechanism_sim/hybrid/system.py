"""A mechanism with gaps, compiled: its flight and its contact in one set of machine code.

Which gaps are closed is a runtime flag s of each gap: ``s N`` stands in the equations and one
guard per gap, ``(1 - s) gap + s N``, falls through zero when an open gap touches and when a closed
one lets go. A gap with friction has two more flags, whether it sticks and which way it slips.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.contact.problem import Layout
from mechanism_sim.hybrid.dynamics import ROUGH, Dynamics
from mechanism_sim.hybrid.events import Mode
from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg, solve_symmetric
from mechanism_sim.planar.inverse_dynamics import Account, Observation
from mechanism_sim.planar.loads import Wrench, together
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import ForceElement, Gap, JointForce, Relation
from mechanism_sim.planar.reactions import energies, generalized_forces, tree_reactions
from mechanism_sim.planar.switched_functions import Edges, SwitchedFunction
from mechanism_sim.planar.switches import SWITCH_MARGIN

Array = NDArray[np.float64]

TINY = 1.0625e-300
"""Keeps a guard off exact zero, from where the integrator would never fire it."""

FORCE_SCALE = 1e-6
"""[m/N] Makes forces in guards so small that they do not rule the size of the steps."""

HOLD = 1.0 + 1e-10
"""Times its friction, a contact that sticks gives way: beyond what rounding makes of forces."""

SLIP_SCALE = 1e-3
"""[s] The same for tangential velocities."""


WATCH_SCALE = 1e-30
"""Keeps what is integrated only to be watched out of the choice of steps."""

JAM_SCALE = 1e-6
"""[m] The same for the margin to jamming."""

JAMMED = 1e-4
"""Margin to jamming, or below, at which contacts count as jammed."""

JAMMED_ROUGH = 0.1
"""The same for rough contacts, which jam a little earlier than those of a large coefficient."""


class TouchTerms(NamedTuple):
    """The m compliant contacts at N instants."""

    normal_force: Array  #: (m, N) [N]
    friction_force: Array  #: (m, N) [N]
    loss: Array  #: (m, N) [W] by damping and friction
    rate: Array  #: (m, N) [m/s] of the gap
    normal_angle: Array  #: (m, N) [rad]


_OF_TOUCHES = 'contact_loss', 'gap_rate', 'normal_angle'


_CENTRAL = 1e-6
"""Of the clearance: a pin so near to the centre is in it, but for rounding."""


class Guard(NamedTuple):
    """What a guard watches: the normal direction of a gap, its friction, or a switch."""

    gap: int
    #: 0: touching or letting go; +1: sliding that ends, or sticking that gives way backwards;
    #: -1: sliding that jams, or sticking that gives way forwards
    friction: int
    switch: int | None = None


class System:
    """Equations of a mechanism with gaps, closures and drives, ready to run.

    Parameters
    ----------
    mechanism : the tree of links
    gaps : its joints with clearance
    prescribed : names of the coordinates whose law the drive gives
    degree : degree of these laws as polynomials in time
    relations : closures of loops
    powered : names of the coordinates on which a drive's torque acts
    elements : forces between links that need no gap

    Attributes
    ----------
    parameters : values of the runtime parameters ``par[]``, SI units
    guards : of the integrator, in the order of its events: gaps, friction, switches
    flag_index, stick_index, slip_index : of every gap, which of them say that it is closed, that
        it sticks, and the sign of its slip
    law_index : of every prescribed coordinate, which of them are its law's coefficients
    torque_index : of every powered coordinate, likewise
    switch_index : of every switch, which of them its present row is
    outside_index : of the time of the base and of whole turns that loads ask for, which of them
    stabilisation_index : which of them is the rate of Baumgarte's method [1/s]
    fired_index : which of them, the last, says which guard ended a step, counted from 1
    """

    def __init__(
        self,
        mechanism: Mechanism,
        gaps: Sequence[Gap],
        prescribed: Sequence[str],
        degree: int,
        relations: Sequence[Relation] = (),
        powered: Sequence[str] = (),
        elements: Sequence[ForceElement] = (),
    ) -> None:
        self.mechanism = mechanism
        self.gaps = tuple(gaps)
        self.relations = tuple(relations)
        self.coordinates = mechanism.coordinates
        self.prescribed = tuple(prescribed)
        self.powered = tuple(powered)
        self.free = tuple(c for c in self.coordinates if c not in prescribed)
        self.angular = tuple(c not in mechanism.displacements for c in self.free)
        self.prescribed_index = [self.coordinates.index(c) for c in self.prescribed]
        self.driven_index = [self.coordinates.index(c) for c in (*prescribed, *powered)]
        self.degree = degree
        self.dynamics = Dynamics(mechanism, gaps, prescribed, degree, relations, powered, elements)
        self.elements = tuple(elements)
        self.equations = self.dynamics.equations
        p = self.equations.parameters
        # all that is looked at in a run must have its parameters before they are counted
        self._normals = [gap.normal(self.equations.frames) for gap in self.gaps]
        self._laws = {
            c: [p.reserve(f'drives:{c}.law.{k}') for k in range(degree + 1)]
            for c in self.prescribed
        }
        d = self.dynamics
        self.guards = [Guard(i, 0) for i in range(len(gaps))]
        self.guards += [Guard(i, sign) for i in d.frictional for sign in (1, -1)]
        frames = self.equations.frames
        self.switches = list(frames.switches.values())
        self.guards += [Guard(-1, 0, k) for k in range(len(self.switches))]
        self.outside = tuple(frames.outside)
        for name in self.outside:
            p.reserve(f'now:{name}')
        for name, s in frames.switches.items():
            for k in range(len(s.symbols)):
                p.reserve(f'now:{name}.{k}')
        p.reserve('fired')
        self.parameters = np.array(p.values)
        self.fired_index = len(self.parameters) - 1
        self.flag_index = [p.names[f'{g.name}.closed'] for g in self.gaps]
        self.stick_index = [p.names[f'{self.gaps[i].name}.sticks'] for i in d.frictional]
        self.slip_index = [p.names[f'{self.gaps[i].name}.slips'] for i in d.frictional]
        self.switch_index = [
            [p.names[f'now:{name}.{k}'] for k in range(len(s.symbols))]
            for name, s in frames.switches.items()
        ]
        self.outside_index = [p.names[f'now:{name}'] for name in self.outside]
        self.stabilisation_index = p.names['stabilisation']
        self.approach_index = [p.names[f'{g.name}.approach'] for g in self.gaps if g.law]
        self.presses_index = [p.names[f'{g.name}.presses'] for g in self.gaps if g.law]
        self.margin_index = p.names.get('release.margin')
        self.law_index = [
            [p.names[f'drives:{c}.law.{k}'] for k in range(degree + 1)] for c in self.prescribed
        ]
        self.torque_index = [
            [p.names[f'drives:{c}.torque.{k}'] for k in range(3)] for c in self.powered
        ]

    def fired(self, parameters: Array | memoryview[float]) -> int | None:
        """The guard that ended the last step, by these runtime parameters; told once."""
        guard = int(parameters[self.fired_index]) - 1
        parameters[self.fired_index] = 0.0
        return guard if guard >= 0 else None

    @property
    def lone(self) -> bool:
        """Whether there is one gap, and no friction in it: the case that is made fastest."""
        return len(self.guards) == len(self.gaps) == 1 and not self.compliant

    @property
    def compliant(self) -> bool:
        """Whether contacts push back by a law of force instead of being kept closed."""
        return self.dynamics.compliant

    @property
    def frictional(self) -> bool:
        """Whether any gap has friction."""
        return bool(self.dynamics.frictional)

    def integrator(
        self, rtol: float, scale: float = 1.0, compact: bool = False
    ) -> hy.taylor_adaptive_dbl:
        """Adaptive Taylor integrator with the terminal guards of every gap.

        State: free coordinates, their rates, a constant that only sets the step, states whose
        derivatives are the guards, with closures one whose derivative is the distance from
        singular positions, then cosine and sine of the angles in `turning`,
        which cost less as solutions of a linear equation than as functions. heyoka ties its order
        p to its tolerance, ``tol = exp(-2 (p - 1))``, and steps so that the last term is about
        `tol` of the largest state variable. Four orders more than it would take for `rtol` make
        fewer and cheaper steps; the constant, as the largest state variable, keeps the error
        where it should be.

        Parameters
        ----------
        rtol : wanted error of a step relative to `scale`
        scale : size of the largest rate [rad/s]
        compact : compile slower but smaller code (for many coordinates)
        """
        order = math.ceil(5.0 - 0.5 * math.log(rtol))
        tolerance = math.exp(-2.0 * (order - 1.5))
        constant = hy.make_vars('step_constant')
        frames = self.equations.frames
        a = [dense(x) for x in self.dynamics.stabilised.a]
        rates = [frames.v[c] for c in self.turning]
        near = [self.dynamics.distance] if self.relations else []
        driven = self._driven([*self._by_directions([*a, *self._guards, *near]), *rates])
        n, m, k = len(a), len(self._guards), len(near)
        a, guards, near = driven[:n], driven[n : n + m], driven[n + m : n + m + k]
        rates = driven[n + m + k :]
        motion = [(frames.q[c], frames.v[c]) for c in self.free]
        motion += [(frames.v[c], a_c) for c, a_c in zip(self.free, a, strict=True)]
        # too small to matter: their Taylor series tell what they watch for nothing
        watch = [(hy.make_vars(f'watch{k}'), WATCH_SCALE * g) for k, g in enumerate(guards)]
        watch += [(hy.make_vars('singularity'), WATCH_SCALE * x) for x in near]
        directions: list[tuple[hy.expression, hy.expression]] = []
        for (cosine, sine), rate in zip(self._direction_symbols, rates, strict=True):
            directions += [(cosine, -(rate * sine)), (sine, rate * cosine)]
        # the constant's rate, which is nothing, names the last parameter: heyoka wants no others
        equations = [*motion, (constant, TINY * hy.par[self.fired_index]), *watch, *directions]
        integrator = compiled.integrator(equations, guards, tolerance, compact, self.fired_index)
        integrator.state[len(motion)] = scale * rtol / tolerance
        integrator.pars[:] = self.parameters
        return integrator

    @cached_property
    def _guards(self) -> list[hy.expression]:
        """Functions that fall through zero at events, in the order of `guards`."""
        d, solved = self.dynamics, self.dynamics.stabilised
        result = []
        for gap, friction, switch in self.guards:
            if switch is not None:
                result.append(self.switches[switch].guard + SWITCH_MARGIN)
                continue
            s = d.closed[gap]
            if not friction:
                value, force = dense(d.normal[gap].value), FORCE_SCALE * dense(solved.N[gap])
                if d.compliant:
                    force = d.held(gap)
                result.append(value + s * (force - value) + TINY)
                continue
            # off the cone of friction while sticking; while sliding until it ends
            z, mu = d.sticks[gap], d.mu[gap]
            push = mul(solved.N[gap], d.compressed(gap)[2]) if d.compliant else solved.N[gap]
            cone = (HOLD * mu) * dense(push) - friction * solved.T[gap]
            inside = z * (FORCE_SCALE * cone)
            sign = d.slips[gap]
            idle = 1.0 - z - sign * sign
            if friction > 0:
                idle = idle + sign * (SLIP_SCALE * dense(d.tangent[gap].rate))
            elif d.compliant:  # its normal force is known: nothing jams
                idle = idle + sign * sign
            else:
                margin = dense(d.jam_margin)
                least = JAMMED_ROUGH if d.friction[gap] == ROUGH else JAMMED
                idle = idle + sign * sign * (JAM_SCALE * (margin * margin - least * least))
            result.append(inside + idle + TINY)
        return result

    @cached_property
    def edges(self) -> Edges | None:
        """Where along a motion the rows of switches change; None if there are none."""
        return Edges(self.equations.frames) if self.switches else None

    @cached_property
    def turning(self) -> tuple[str, ...]:
        """The angles whose cosine and sine are states: prescribed, and turning steadily.

        They drift by a rounding in each step, which counts where contacts are stiff.
        """
        angles = [c for c in self.prescribed if c not in self.mechanism.displacements]
        return tuple(angles) if self.degree == 1 and self.lone else ()

    @property
    def timed(self) -> bool:
        """Whether the integrator's equations contain the time."""
        return (bool(self.prescribed) and not self.turning) or 'time' in self.outside

    @property
    def _direction_symbols(self) -> list[tuple[hy.expression, hy.expression]]:
        turning = range(len(self.turning))
        return [(hy.make_vars(f'cos{i}'), hy.make_vars(f'sin{i}')) for i in turning]

    def _by_directions(self, expressions: Sequence[Term]) -> list[hy.expression]:
        """Cosines and sines of the angles in `turning` replaced by their symbols."""
        replace: dict[hy.expression, hy.expression] = {}
        for c, (cosine, sine) in zip(self.turning, self._direction_symbols, strict=True):
            q = self.equations.frames.q[c]
            replace |= {hy.cos(q): cosine, hy.sin(q): sine}
        return list(hy.subs(list(expressions), replace))

    def _driven(self, expressions: Sequence[hy.expression]) -> list[hy.expression]:
        """The expressions with the laws of the prescribed coordinates, and what loads ask for."""
        frames = self.equations.frames
        replace: dict[str | hy.expression, hy.expression] = {}
        for name, c in self._laws.items():
            for symbol, d in ((frames.q, 0), (frames.v, 1), (frames.a, 2)):
                value: Term = None  # by Horner: a power of time has no Taylor series at zero
                for k in range(self.degree, d - 1, -1):
                    value = add(mul(value, hy.time), math.perm(k, d) * c[k])
                replace[symbol[name]] = dense(value)
        for known, pars in zip(frames.switches.values(), self.switch_index, strict=True):
            replace |= {symbol: hy.par[i] for symbol, i in zip(known.symbols, pars, strict=True)}
        for (name, symbol), index in zip(frames.outside.items(), self.outside_index, strict=True):
            replace[symbol] = hy.par[index] + hy.time if name == 'time' else hy.par[index]
        return list(hy.subs(list(expressions), replace))

    def _on_now(self, outputs: Sequence[Term]) -> hy.cfunc_dbl:
        """Compiled function of one vector: free coordinates, rates, parameters and time.

        A call with parameters and time apart takes more than twice as long.
        """
        frames = self.equations.frames
        replace = {hy.par[i]: hy.make_vars(f'parameter{i}') for i in range(len(self.parameters))}
        replace[hy.time] = hy.make_vars('now')
        state = [*(frames.q[c] for c in self.free), *(frames.v[c] for c in self.free)]
        expressions = self._driven([dense(o) for o in outputs])
        return compiled.function(hy.subs(expressions, replace), [*state, *replace.values()])

    @cached_property
    def watch(self) -> hy.cfunc_dbl:
        """What is to be watched, at free coordinates, rates, parameters, time.

        The guards, the rates of the gaps, of compliant contacts their values, the places of the
        switches.
        """
        d, places = self.dynamics, (s.place for s in self.switches)
        values = (jet.value for jet in d.normal if d.compliant)
        return self._on_now([*self._guards, *(jet.rate for jet in d.normal), *values, *places])

    @cached_property
    def accelerations(self) -> hy.cfunc_dbl:
        """Of the free coordinates, as the integrator has them; of the same vector as `watch`."""
        return self._on_now(self.dynamics.stabilised.a)

    @cached_property
    def contact_function(self) -> hy.cfunc_dbl:
        """Terms of the gaps, as `contact.problem.problem_of` reads them; of `watch`'s vector."""
        d, rows = self.dynamics, self.dynamics.rows
        terms = [
            *(jet.value for jet in d.normal),
            *(jet.rate for jet in rows),
            *d.free_acceleration,
            *d.acceleration,
            *(x for W in d.response for x in W),
            *(x for row in d.compliance for x in row),
            *(x for row in d.drive_response for x in row),
            *self._normal_angles,
            *(d.relief(i) for i in range(len(self.gaps) if d.compliant else 0)),
        ]
        return self._on_now(self._unpulled(terms))

    @property
    def _normal_angles(self) -> list[Term]:
        return [hy.atan2(dense(y.value), dense(x.value)) for x, y in self._normals]

    @cached_property
    def contact_layout(self) -> Layout:
        """Of the output of `contact_function`."""
        m, rows = len(self.gaps), len(self.dynamics.rows)
        compliant = m if self.compliant else 0
        return Layout(m, rows, len(self.free), len(self.prescribed), compliant)

    @cached_property
    def projection(self) -> hy.cfunc_dbl:
        """The state with loops and closed gaps brought to zero, in value and rate.

        Along M^-1 J^T; what sticks loses its tangential velocity too. Behind it come the distances
        of the closures from depending on each other. Of the same vector as `watch`.
        """
        d, frames = self.dynamics, self.equations.frames
        outputs: list[Term] = []
        for symbol, rows, quantity in (
            (frames.q, d.normal, 'value'),
            (frames.v, d.rows, 'rate'),
        ):
            shift = d.closing([getattr(jet, quantity) for jet in d.relation])
            count = len(rows)
            K = [
                [
                    add(mul(mul(d.active[i], d.active[k]), d.compliance[i][k]),
                        1.0 - d.active[i] if i == k else None)
                    for k in range(count)
                ]
                for i in range(count)
            ]  # fmt: skip
            off = [
                add(getattr(jet, quantity), d.along(row, shift))
                for jet, row in zip(rows, d.J, strict=False)
            ]
            impulses = solve_symmetric(
                K, [[neg(mul(a, x)) for a, x in zip(d.active, off, strict=False)]]
            )[0] if count else []  # fmt: skip
            outputs += [
                add(symbol[c], shift[i], *(mul(W[i], x) for W, x in zip(d.response, impulses)))  # noqa: B905 - of positions only the normal rows
                for i, c in enumerate(self.free)
            ]
        return self._on_now([*outputs, *(d.distances if d.relation else [])])

    @cached_property
    def _terms(self) -> dict[str, list[Term]]:
        """What `observe` and `account` say, as expressions."""
        eq, d = self.equations, self.dynamics
        solved = d.exact
        a: dict[str, Term] = dict(zip(self.free, solved.a, strict=True))
        a |= {c: eq.frames.a[c] if self.degree > 1 else None for c in self.prescribed}
        cut: dict[str, Wrench] = {}
        for gap, N, T in zip(self.gaps, solved.N, solved.T, strict=True):
            pressed = gap.wrench(eq.frames, N, T)
            before = cut.get(gap.joint)
            cut[gap.joint] = together(before, pressed) if before else pressed
        loads = []
        for element in self.elements:
            if isinstance(element, JointForce):
                cut[element.name] = element.wrench(eq.frames)
                loads += element.loads(eq.frames)[2:]
            else:
                loads += element.loads(eq.frames)
        forces = list(solved.closing_forces)
        for relation in self.relations:
            count = len(relation.values(eq.frames))
            cut[relation.name] = relation.wrench(eq.frames, forces[:count])
            forces = forces[count:]
        reactions = tree_reactions(eq, a, cut, loads)
        supplied = generalized_forces(eq, a)
        torques = [
            add(supplied[self.coordinates.index(c)], neg(d.on_prescribed(k, solved)))
            for k, c in enumerate(self.prescribed)
        ]
        friction = [neg(mul(solved.T[i], d.tangent[i].rate)) for i in d.frictional]
        friction += [element.power_lost(eq.frames) for element in self.elements]
        kinetic, potential = energies(eq)
        potential = add(potential, *(element.energy(eq.frames) for element in self.elements))
        forces_N = list(solved.N)
        losses: list[Term] = []
        for i, law in enumerate(d.laws):
            if law is not None:
                depth, rate, stretch = d.compressed(i)
                push = mul(solved.N[i], stretch)
                lost = push - d.closed[i] * law.normal_force(depth, hy.expression(0.0), 1.0)
                friction.append(lost * rate)
                potential = add(potential, d.closed[i] * law.elastic_energy(depth))
                forces_N[i] = push
                slides = mul(solved.T[i], d.tangent[i].rate) if i in d.tangent else None
                losses.append(add(lost * rate, neg(slides)))
        return {
            'acceleration': [a[c] for c in self.coordinates],
            'gap': [jet.value for jet in d.normal],
            'closure': [jet.value for jet in d.relation],
            'normal_force': forces_N,
            'friction_force': list(solved.T),
            'friction_power': [add(*friction)],
            'drive_torque': torques,
            'reaction': [x for w in reactions.values() for x in (w.x, w.y)],
            'moment': [w.moment for w in reactions.values()],
            'energy': [kinetic, potential],
            'contact_loss': losses,
            'gap_rate': [
                dense(jet.rate) / gap.stretch(jet.value)
                for gap, jet in zip(self.gaps, d.normal, strict=True)
            ],
            'normal_angle': self._normal_angles,
        }

    def _unpulled(self, terms: Sequence[Term]) -> list[hy.expression]:
        """The terms for states that may be a rounding beyond the depth zero of a contact.

        No power of a negative number is real; where a series is wanted, there is no such clip.
        """
        found = [dense(x) for x in terms]
        if not self.compliant:
            return found
        depths = [dense(self.dynamics.compressed(i)[0]) for i in range(len(self.gaps))]
        return list(hy.subs(found, {x: hy.relu(x) for x in depths}))

    def _compiled(self, names: Sequence[str]) -> SwitchedFunction:
        """These terms as a function of what `_inputs` makes."""
        eq, d = self.equations, self.dynamics
        replace: dict[str | hy.expression, hy.expression] = {}
        flags = (*d.closed, *d.sticks.values(), *d.slips.values(), *d.approach, *d.presses)
        for k, flag in enumerate(flags):
            replace[flag] = hy.make_vars(f'flag{k}')
        variables = list(replace.values())
        for k in range(len(self.powered)):
            constant, *others = d.torques[3 * k : 3 * k + 3]
            replace[constant] = hy.make_vars(f'torque{k}')
            variables.append(replace[constant])
            replace |= dict.fromkeys(others, hy.expression(0.0))
        groups = [self._unpulled(self._terms[name]) for name in names]
        if replace:
            groups = [list(hy.subs(group, replace)) for group in groups]
        frames = eq.frames
        symbols = [*frames.q.values(), *frames.v.values()]
        prescribed = [frames.a[c] for c in self.prescribed]
        variables = [*symbols, *prescribed, *variables, *frames.outside.values()]
        return SwitchedFunction(frames, groups, variables)

    @cached_property
    def _observe(self) -> SwitchedFunction:
        return self._compiled(list(self._terms)[: -len(_OF_TOUCHES)])

    @cached_property
    def _account(self) -> SwitchedFunction:
        return self._compiled(['gap', 'closure', 'normal_force', 'friction_power', 'drive_torque'])

    def observe(
        self,
        q: Array,
        v: Array,
        a_p: Array,
        modes: NDArray[np.uint8],
        torque: Array | None = None,
        approach: Array | None = None,
        outside: Array | None = None,
        rows: Array | None = None,
    ) -> Observation:
        """Accelerations, forces and energies at N instants.

        Parameters
        ----------
        q, v : (n, N) of all coordinates
        a_p : (p, N) prescribed accelerations
        modes : (m, N) of the gaps
        torque : (k, N) [N m] on the powered coordinates
        approach : (m, N) [m/s] of the first touch of compliant contacts
        outside : (k, N) what is named by the attribute `outside`
        rows : values of the switches, if not those at these places
        """
        inputs, torque = self._inputs(q, v, a_p, modes, torque, approach, outside)
        (
            a, gap, _, N, T, friction, prescribed, reaction, moment, energy,
        ) = self._observe(inputs, rows)  # fmt: skip
        drive_torque = np.concatenate([prescribed, torque])
        return Observation(
            q,
            v,
            a,
            self.distances(gap),
            N,
            T,
            friction[0],
            reaction.reshape(-1, 2, q.shape[1]),
            moment,
            drive_torque,
            (drive_torque * v[self.driven_index]).sum(axis=0),
            energy[0],
            energy[1],
        )

    def account(
        self,
        q: Array,
        v: Array,
        a_p: Array,
        modes: NDArray[np.uint8],
        torque: Array | None = None,
        approach: Array | None = None,
        outside: Array | None = None,
        rows: Array | None = None,
    ) -> Account:
        """Terms of the energy balance at the instants of `observe`; far cheaper."""
        inputs, torque = self._inputs(q, v, a_p, modes, torque, approach, outside)
        gap, closure, N, friction, prescribed = self._account(inputs, rows)
        drive_torque = np.concatenate([prescribed, torque])
        closed = np.where(modes > Mode.FREE_FLIGHT, gap, 0.0)
        ends = [closed.min(axis=1, initial=0.0), closed.max(axis=1, initial=0.0)]
        farthest = self.distances(np.array(ends).T)  # in any measure the ends are the ends
        left = max(np.abs(x).max(initial=0.0) for x in (farthest, closure))
        power = (drive_torque * v[self.driven_index]).sum(axis=0)
        return Account(N, friction[0], power, float(left))

    @cached_property
    def _touch(self) -> SwitchedFunction:
        return self._compiled(['normal_force', 'friction_force', *_OF_TOUCHES])

    def touch(
        self,
        q: Array,
        v: Array,
        a_p: Array,
        modes: NDArray[np.uint8],
        torque: Array | None = None,
        approach: Array | None = None,
        outside: Array | None = None,
        rows: Array | None = None,
    ) -> TouchTerms:
        """Compliant contacts at the instants that `observe` would be given."""
        inputs, _ = self._inputs(q, v, a_p, modes, torque, approach, outside)
        return TouchTerms(*self._touch(inputs, rows))

    def _inputs(
        self,
        q: Array,
        v: Array,
        a_p: Array,
        modes: NDArray[np.uint8],
        torque: Array | None,
        approach: Array | None,
        outside: Array | None,
    ) -> tuple[Array, Array]:
        """One array of all inputs, and the torques."""
        d, count = self.dynamics, q.shape[1]
        torque = np.zeros((len(self.powered), count)) if torque is None else torque
        flags: list[NDArray[Any]] = [modes > Mode.FREE_FLIGHT]
        if d.frictional:
            frictional = modes[d.frictional]
            forward = frictional == Mode.SLIDING_FORWARD
            backward = frictional == Mode.SLIDING_BACKWARD
            flags += [frictional == Mode.STICKING, forward * 1.0 - backward]
        if self.compliant:
            flags.append(np.ones_like(modes, float) if approach is None else approach)
            flags.append((modes > Mode.FREE_FLIGHT) & (modes < Mode.RECOVERING))
        given = np.zeros((len(self.outside), count)) if outside is None else outside
        rows = (q, v, a_p, *(np.reshape(x, (-1, count)) for x in flags), torque, given)
        return np.concatenate(rows), torque

    def distances(self, values: Array) -> Array:
        """The gaps (m, N) [m] that belong to values in their own measure."""
        rows = [g.distance(row) for g, row in zip(self.gaps, values, strict=True)]
        return np.array(rows).reshape(values.shape)

    @cached_property
    def _gap_values(self) -> SwitchedFunction:
        frames = self.equations.frames
        values = [jet.value for jet in self.dynamics.normal]
        return SwitchedFunction(frames, [values], self._positions)

    @property
    def _positions(self) -> list[hy.expression]:
        return list(self.equations.frames.q.values())

    @cached_property
    def _distance(self) -> SwitchedFunction:
        return SwitchedFunction(self.equations.frames, [[self.dynamics.distance]], self._positions)

    def distance(self, q: Array) -> Array:
        """How far the closures are from depending on each other (N,) at coordinates q (n, N)."""
        found: Array = self._distance(q)[0][0]
        return found

    @cached_property
    def _gap_rates(self) -> SwitchedFunction:
        frames, normal = self.equations.frames, self.dynamics.normal
        groups = [
            [jet.rate for jet in normal],
            [g.stretch(jet.value) for g, jet in zip(self.gaps, normal, strict=True)],
            [jet.value for jet in normal],
            *([pair[k].rate for pair in self._normals] for k in (0, 1)),
        ]
        return SwitchedFunction(frames, groups, [*frames.q.values(), *frames.v.values()])

    def gap_rates(self, q: Array, v: Array) -> Array:
        """How fast the gaps open (m, N) [m/s] at coordinates and rates (n, N).

        From the centre of its bushing a pin comes nearer in every direction, as fast as it moves:
        there the normal Q/c turns with Q'/c, and the measure of the gap is c/2.
        """
        rates, stretch, value, nx, ny = self._gap_rates(np.concatenate([q, v]))
        central = ~(stretch >= _CENTRAL)  # by rounding it may be the root of less than zero
        opening: Array = np.where(
            central, -2.0 * value * np.hypot(nx, ny), rates / np.where(central, 1.0, stretch)
        )
        return opening

    def gap_values(self, q: Array, rows: Array | None = None) -> Array:
        """The gaps (m, N) [m] in their own measure at coordinates q (n, N); `rows` as above."""
        return self._gap_values(q, rows)[0] if self.gaps else np.zeros((0, q.shape[1]))
