"""A mechanism with gaps, compiled: its flight and its contact in one set of machine code.

Which gaps are closed is a runtime flag s of each gap: ``s N`` stands in the equations and one
guard per gap, ``(1 - s) gap + s N``, falls through zero when an open gap touches and when a closed
one lets go. A gap with friction has two more flags, whether it sticks and which way it slips.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.contact.problem import Layout
from mechanism_sim.hybrid.dynamics import ROUGH, Dynamics, Solved
from mechanism_sim.hybrid.holding import Acting, acting
from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg, solve_symmetric
from mechanism_sim.planar.joint_friction import JointFriction, Pressed
from mechanism_sim.planar.loads import Wrench, together
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.motor import Motor
from mechanism_sim.planar.protocols import ForceElement, Gap, JointForce, Relation
from mechanism_sim.planar.reactions import tree_reactions
from mechanism_sim.planar.steep_loads import SteepLoads
from mechanism_sim.planar.switched_functions import Edges
from mechanism_sim.planar.switches import SWITCH_MARGIN, Switch, by_level

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


RUB_JAMMED = 1e-3
"""`Acting.jam_margin` at which friction in ideal joints counts as jammed."""


class Guard(NamedTuple):
    """What a guard watches: the normal direction of a gap, its friction, or a switch.

    Or of friction in ideal joints the side on which a line presses, or whether the force of a pin
    has turned far: there it may have vanished, and its size has no Taylor series. And where it is
    none of all these, the margin to a jam.
    """

    gap: int
    #: 0: touching or letting go; +1: sliding that ends, or sticking that gives way backwards;
    #: -1: sliding that jams, or sticking that gives way forwards
    friction: int
    switch: int | None = None
    side: int | None = None
    pin: int | None = None


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
    motors : of powered coordinates, beside the drive's torque
    frictions : of ideal joints
    lent : [kg] to closures, see `Dynamics`

    Attributes
    ----------
    parameters : values of the runtime parameters ``par[]``, SI units
    guards : of the integrator, in the order of its events: gaps, friction, switches
    flag_index, stick_index, slip_index : of every gap, which of them say that it is closed, that
        it sticks, and the sign of its slip
    law_index : of every prescribed coordinate, which of them are its law's coefficients
    torque_index : of every powered coordinate, likewise
    switch_levels : how many times rows must be set until each follows from those before it
    towards_index : of every pin that rubs, where its force points: 60 deg or more from its reverse
    sides, side_index : of every side of friction in ideal joints, which of them is its sign
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
        motors: Sequence[Motor] = (),
        frictions: Sequence[JointFriction] = (),
        lent: float = 0.0,
    ) -> None:
        self.mechanism = mechanism
        self.lent = lent
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
        self.dynamics = Dynamics(
            mechanism,
            gaps,
            prescribed,
            degree,
            relations,
            powered,
            elements,
            motors,
            frictions,
            lent,
        )
        self.elements = tuple(elements)
        self._acting: dict[int, Acting] = {}
        self.equations = self.dynamics.equations
        frames = self.equations.frames
        # all that is looked at in a run must have its parameters before they are counted
        self.normals = [gap.normal(frames) for gap in self.gaps]
        self._bounds = {
            id(solved): self._bounds_by(solved)
            for solved in (self.dynamics.exact, self.dynamics.stabilised)
        }
        self.switches = list(frames.switches.values())
        self.switch_levels = len(by_level(self.switches))
        self.outside = tuple(frames.outside)
        names = self.equations.parameters.names
        self.side_index = [i for name, i in names.items() if '.friction.side.' in name]
        self.sides = [hy.par[i] for i in self.side_index]
        self._reserve()
        self.parameters = np.array(self.equations.parameters.values)
        self.fired_index = len(self.parameters) - 1
        self._find_parameters()
        self.guards = self._all_guards()

    def _reserve(self) -> None:
        """Parameters that change in a run; the last says which guard fired."""
        p = self.equations.parameters
        self._laws = {
            c: [p.reserve(f'drives:{c}.law.{k}') for k in range(self.degree + 1)]
            for c in self.prescribed
        }
        bounds = self._bounds[id(self.dynamics.stabilised)].values()
        pins = sum(x.side is None for bound in bounds for x in bound)
        self._towards = [
            [p.reserve(f'pins:{k}.towards.{axis}', float(axis == 'x')) for axis in 'xy']
            for k in range(pins)
        ]
        for name in self.outside:
            p.reserve(f'now:{name}')
        for name, s in self.equations.frames.switches.items():
            for k in range(len(s.symbols)):
                p.reserve(f'now:{name}.{k}')
        p.reserve('fired')

    def _find_parameters(self) -> None:
        """Indices of parameters, as the attributes of the class say."""
        names, d = self.equations.parameters.names, self.dynamics

        def of(gaps: Iterable[Gap], what: str) -> list[int]:
            return [names[f'{gap.name}.{what}'] for gap in gaps]

        def several(of_what: str, count: int) -> list[int]:
            return [names[f'{of_what}.{k}'] for k in range(count)]

        soft = [gap for gap in self.gaps if gap.law]
        rough = [self.gaps[i] for i in d.frictional]
        self.flag_index = of(self.gaps, 'closed')
        self.stick_index, self.slip_index = of(rough, 'sticks'), of(rough, 'slips')
        self.approach_index, self.presses_index = of(soft, 'approach'), of(soft, 'presses')
        self.margin_index = names.get('release.margin')
        self.stabilisation_index = names['stabilisation']
        self.towards_index = [i for name, i in names.items() if name.startswith('pins:')]
        self.outside_index = [names[f'now:{name}'] for name in self.outside]
        switches = self.equations.frames.switches.items()
        self.switch_index = [several(f'now:{name}', len(s.symbols)) for name, s in switches]
        self.law_index = [several(f'drives:{c}.law', self.degree + 1) for c in self.prescribed]
        self.torque_index = [several(f'drives:{c}.torque', 3) for c in self.powered]

    def _all_guards(self) -> list[Guard]:
        """Guards of gaps, their friction, sides, pins and jams of ideal joints, switches."""
        guards = [Guard(i, 0) for i in range(len(self.gaps))]
        guards += [Guard(i, sign) for i in self.dynamics.frictional for sign in (1, -1)]
        guards += [Guard(-1, 0, side=k) for k in range(len(self.sides))]
        guards += [Guard(-1, 0, pin=k) for k in range(len(self._towards))]
        guards += [Guard(-1, 0)] if self.dynamics.rubs else []
        return guards + [Guard(-1, 0, k) for k in range(len(self.switches))]

    @cached_property
    def steep(self) -> SteepLoads | None:
        """Loads that no series foretells, if there are any."""
        formulas, torques = self.equations.frames.formulas, self.dynamics.characteristics
        if not (formulas or torques):
            return None
        found = SteepLoads(self.mechanism, self.equations.frames, self.elements, torques)
        return found if found.enclosure.count else None

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
        # four orders more: 300 instead of 390 steps in a revolution of the thesis scene
        order = math.ceil(5.0 - 0.5 * math.log(rtol))
        tolerance = math.exp(-2.0 * (order - 1.5))
        constant = hy.make_vars('step_constant')
        frames = self.equations.frames
        a = [dense(x) for x in self.dynamics.stabilised.a]
        rates = [frames.v[c] for c in self.turning]
        near = [self.dynamics.distance] if self.relations else []
        known = [*self._acted(a), *self._guards, *near]
        driven = self._driven([*self._by_directions(known), *rates])
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
        for gap, friction, switch, side, pin in self.guards:
            if switch is not None:
                known = self.switches[switch]
                guard = known.guard
                if isinstance(known, Switch) and known.holds is not None:
                    guard += known.holds * (known.held_guard - 1.0)
                result.append(guard + SWITCH_MARGIN)
                continue
            if side is not None:
                pressed = self.acting(solved).pressed[side]
                result.append(FORCE_SCALE * (self.sides[side] * pressed + self._unpressed))
                continue
            if pin is not None:
                x, y = self.acting(solved).carried[pin]
                ux, uy = self._towards[pin]
                size = hy.sqrt(x * x + y * y + self._unpressed * self._unpressed)
                result.append(FORCE_SCALE * (x * ux + y * uy + 0.5 * size + self._unpressed))
                continue
            if gap < 0:
                margin = dense(self.acting(solved).jam_margin)
                result.append(JAM_SCALE * (margin - RUB_JAMMED) + TINY)
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
        # what friction in ideal joints is by itself has been solved for already
        own = [k for k, g in enumerate(self.guards) if g.gap >= 0 or g.switch is not None]
        for k, guard in zip(own, self._acted([result[k] for k in own]), strict=True):
            result[k] = guard
        return result

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
        names = self.equations.frames.switches
        return [k for k, name in enumerate(names) if name in self.equations.frames.slips]

    @cached_property
    def holding_rows(self) -> tuple[list[int], list[int]]:
        """Of each switch that may hold, where its flag and its holding are among all symbols."""
        ends = np.cumsum([len(s.symbols) for s in self.switches]).tolist()
        return [ends[k] - 2 for k in self.holding], [ends[k] - 1 for k in self.holding]

    def rates_of_holding(self, a: Sequence[Term]) -> list[hy.expression]:
        """Rates of the functions of the switches that may hold, under accelerations `a`."""
        return [self._rate(s.inside, a) for s in self.holding.values()]

    @cached_property
    def _parts(self) -> dict[hy.expression, hy.expression]:
        """What acts in the integrator's equations, as `acting` has it."""
        return self.parts(self.dynamics.stabilised)

    def parts(self, solved: Solved) -> dict[hy.expression, hy.expression]:
        """By the flag of each switch of rates its part, by the T of each friction its value."""
        found = self.acting(solved)
        flags = [s.flag for s in self.holding.values()]
        return dict(zip(flags, found.parts, strict=True)) | found.values

    def acting(self, solved: Solved) -> Acting:
        """What acts of all that steps against the motion, by one of the solutions."""
        if id(solved) not in self._acting:
            switches, known = [*self.holding.values()], self._bounds[id(solved)]
            forces = {rub.switch.flag: rub.T for rub in self.dynamics.rubs}
            self._acting[id(solved)] = acting(
                switches,
                self.rates_of_holding(solved.a),
                [forces.get(s.flag) for s in switches],
                [known.get(s.flag, ()) for s in switches],
            )
        return self._acting[id(solved)]

    @cached_property
    def pin_forces(self) -> hy.cfunc_dbl:
        """Components of the forces in pins that rub, one after the other; as `watch`."""
        carried = self.acting(self.dynamics.stabilised).carried
        return self._on_now(self.unpulled([c for pair in carried for c in pair]))

    @property
    def _unpressed(self) -> Term:
        """Half of the least force that rubs [N]: so far beyond zero a side turns over."""
        return 0.5 * next(
            x.resolution for b in self._bounds[id(self.dynamics.stabilised)].values() for x in b
        )

    def _bounds_by(self, solved: Solved) -> dict[hy.expression, list[Pressed]]:
        """The terms of the bounds of all frictions, by the flags of their slips."""
        if not self.dynamics.rubs:
            return {}
        carried, frames = self.reactions(solved), self.equations.frames
        found: dict[hy.expression, list[Pressed]] = {}
        for rub in self.dynamics.rubs:
            name = rub.friction.name
            key = f'{rub.friction.label}.friction.side'
            found[rub.switch.flag] = terms = []
            for i, x in enumerate(rub.friction.pressed(frames, carried[name])):
                if len(x.components) > 1:
                    terms.append(x)
                    continue
                side = self.equations.parameters.reserve(f'{key}.{i}', 1.0)
                terms.append(x._replace(side=0.5 * (side + float(x.wall)) if x.wall else side))
        return found

    def reactions(self, solved: Solved) -> dict[str, Wrench]:
        """What the first-named does to the second-named link in every joint, without friction."""
        eq = self.equations
        a: dict[str, Term] = dict(zip(self.free, solved.a, strict=True))
        a |= {c: eq.frames.a[c] if self.degree > 1 else None for c in self.prescribed}
        cut: dict[str, Wrench] = {}
        for gap, N, T in zip(self.gaps, solved.N, solved.T, strict=True):
            pressed = gap.wrench(eq.frames, N, T)
            before = cut.get(gap.joint)
            cut[gap.joint] = together(before, pressed) if before else pressed
        loads = [load for rub in self.dynamics.rubs for load in rub.loads]
        for element in self.elements:
            if isinstance(element, JointForce):
                carried, before = element.wrench(eq.frames), cut.get(element.name)
                cut[element.name] = together(before, carried) if before else carried
                loads += element.loads(eq.frames)[2:]
            else:
                loads += element.loads(eq.frames)
        forces = list(solved.closing_forces)
        for relation in self.relations:
            count = len(relation.values(eq.frames))
            cut[relation.name] = relation.wrench(eq.frames, forces[:count])
            forces = forces[count:]
        return tree_reactions(eq, a, cut, loads)

    def _rate(self, function: hy.expression, a: Sequence[Term]) -> hy.expression:
        """Time derivative of a function of coordinates, rates and time."""
        frames, rate = self.equations.frames, [hy.expression(0.0)]
        accelerations: dict[str, Term] = dict(zip(self.free, a, strict=True))
        if self.degree > 1:
            accelerations |= {c: frames.a[c] for c in self.prescribed}
        for c in self.coordinates:
            rate.append(hy.diff(function, frames.q[c]) * frames.v[c])
            rate.append(hy.diff(function, frames.v[c]) * dense(accelerations.get(c)))
        if 'time' in frames.outside:
            rate.append(hy.diff(function, frames.outside['time']))
        return hy.sum(rate)

    @cached_property
    def holding_rates(self) -> hy.cfunc_dbl:
        """Rates of the functions of switches that may hold, then their parts; as `watch`."""
        rates = self.rates_of_holding(self.dynamics.stabilised.a)
        flags = (s.flag for s in self.holding.values())
        return self._on_now(self.unpulled(self._acted([*rates, *flags])))

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

    def _acted(self, expressions: Sequence[Term]) -> list[hy.expression]:
        """The expressions with what acts of loads that hold, and of friction in ideal joints."""
        terms = [dense(x) for x in expressions]
        return list(hy.subs(terms, self._parts)) if self._parts else terms

    def _driven(self, expressions: Sequence[hy.expression]) -> list[hy.expression]:
        """The expressions with the laws of the prescribed coordinates, and what loads ask for.

        Flags of switches that hold are parameters.
        """
        frames = self.equations.frames
        if self.dynamics.depths:
            expressions = hy.subs(list(expressions), self.dynamics.depths)
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
        rates = (jet.rate for jet in d.normal)
        return self._on_now([*self._guards, *rates, *values, *places])

    @cached_property
    def accelerations(self) -> hy.cfunc_dbl:
        """Of the free coordinates, as the integrator has them; of the same vector as `watch`."""
        return self._on_now(self._acted(self.dynamics.stabilised.a))

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
            *self.normal_angles,
            *(d.relief(i) for i in range(len(self.gaps) if d.compliant else 0)),
        ]
        if d.rubs:
            values = self.acting(d.exact).values
            rubbed = {rub.T: values[rub.T] for rub in d.rubs}
            terms = list(hy.subs([dense(x) for x in terms], rubbed))
        return self._on_now(self.unpulled(terms))

    @cached_property
    def rub_function(self) -> tuple[hy.cfunc_dbl, list[list[tuple[int, int]]]]:
        """What `contact.rubbing.rubs_of` reads, of `watch`'s vector, and sizes of all bounds.

        The latter are how many components each term of each bound has, and its wall.
        """
        d, frames = self.dynamics, self.equations.frames
        unit = [hy.make_vars(f'struck{k}') for k in range(len(d.rows))]
        impulses = [*unit, *(rub.T for rub in d.rubs)]
        carried = self.reactions(d.struck(unit))
        bounds = [rub.friction.pressed(frames, carried[rub.friction.name]) for rub in d.rubs]
        forces = [dense(c) for b in bounds for p in b for c in p.components]
        terms = [
            *(rub.slip.rate for rub in d.rubs),
            *(x for w in d.rub_response for x in w),
            *(x for row in d.rub_compliance for x in row),
            *(x for row in d.rub_drive_response for x in row),
            *(hy.diff(force, x) for force in forces for x in impulses),
            *(p.coefficient for b in bounds for p in b),
        ]
        # flanks of teeth bear as they did before the impact
        terms = hy.subs([dense(x) for x in terms], dict.fromkeys(impulses, hy.expression(0.0)))
        return self._on_now(terms), [[(len(p.components), p.wall) for p in b] for b in bounds]

    @cached_property
    def pressing(self) -> hy.cfunc_dbl:
        """What presses on lines that rub [N], as `sides` has it; of `watch`'s vector."""
        return self._on_now(self.unpulled(self.acting(self.dynamics.exact).pressed))

    @property
    def normal_angles(self) -> list[Term]:
        """Directions [rad] of the normals of the gaps, from bushing to pin."""
        return [hy.atan2(dense(y.value), dense(x.value)) for x, y in self.normals]

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
                    add(mul(mul(d.active[i], d.active[k]),
                            mul(d.compliance[i][k], 1.0 + dense(d.softness[i]))
                            if i == k and d.softness[i] is not None else d.compliance[i][k]),
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

    def unpulled(self, terms: Sequence[Term]) -> list[hy.expression]:
        """The terms for states that may be a rounding beyond the depth zero of a contact.

        No power of a negative number is real; where a series is wanted, there is no such clip.
        """
        found = [dense(x) for x in terms]
        if not self.compliant:
            return found
        depths = [dense(self.dynamics.compressed(i)[0]) for i in range(len(self.gaps))]
        known = self.dynamics.depths
        return list(hy.subs(found, {x: hy.relu(known.get(x, x)) for x in depths}))
