"""A mechanism with gaps, compiled: its flight and its contact in one set of machine code.

Which gaps are closed is a runtime flag s of each gap: ``s N`` stands in the equations and one
guard per gap, ``(1 - s) gap + s N``, falls through zero when an open gap touches and when a closed
one lets go. A gap with friction has two more flags, whether it sticks and which way it slips.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from itertools import islice

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.contact.problem import Layout
from mechanism_sim.engine.dynamics import AppliedForces, Dynamics, Solved
from mechanism_sim.engine.guards import guard_functions, guards_of
from mechanism_sim.engine.present_functions import PresentFunctions
from mechanism_sim.engine.run_expressions import RunExpressions
from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.symbolic import Term, dense, substitute
from mechanism_sim.planar.closures import IndependentRows
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import FirstOrderState, Gap, Relation
from mechanism_sim.planar.steep_loads import SteepLoads
from mechanism_sim.planar.switched_functions import Edges
from mechanism_sim.tolerances import TOLERANCES

_GUARDS = TOLERANCES.guards


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
    applied : forces that need no gap
    constraint_mass : [kg] mass added along closures, see `engine.reduction`

    Attributes
    ----------
    set_valued : set-valued forces: loads against a motion, friction in ideal joints
    parameters : indices and values of the runtime parameters ``par[]``
    guards : guards of the integrator, in the order of its events
    functions : functions of the present state, compiled when first called for
    """

    def __init__(
        self,
        mechanism: Mechanism,
        gaps: Sequence[Gap],
        prescribed: Sequence[str],
        degree: int,
        relations: Sequence[Relation] = (),
        powered: Sequence[str] = (),
        applied: AppliedForces = AppliedForces(),  # noqa: B008 - a tuple does not change
        constraint_mass: float = 0.0,
    ) -> None:
        self.mechanism = mechanism
        self.constraint_mass = constraint_mass
        self.gaps = tuple(gaps)
        # one without a row of its own holds nothing, but its joint is cut
        self.relations = tuple(
            r for r in relations if not isinstance(r, IndependentRows) or r.kept
        )
        self.coordinates = mechanism.coordinates
        self.prescribed = tuple(prescribed)
        self.powered = tuple(powered)
        self.free = tuple(c for c in self.coordinates if c not in prescribed)
        self.angular = tuple(c not in mechanism.displacements for c in self.free)
        self.degree = degree
        self.dynamics = Dynamics(
            mechanism, gaps, prescribed, degree, relations, powered, applied, constraint_mass
        )
        self.elements = self.dynamics.elements
        self.run = RunExpressions(self.dynamics)
        self.set_valued, self.switches = self.run.set_valued, self.run.switches
        self.parameters = self.run.parameters
        self.outside = tuple(self.equations.frames.outside)
        self.guards = guards_of(self.dynamics, self.parameters)
        self.functions = PresentFunctions(self.run, lambda: self.guard_functions)
        self._taylors: dict[bool, compiled.TaylorEquations] = {}

    @cached_property
    def states(self) -> tuple[FirstOrderState, ...]:
        """The states of first order."""
        return tuple(self.dynamics.states)

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the coordinates, then of the states of first order."""
        return (*self.coordinates, *(x.label for x in self.states))

    @property
    def width(self) -> int:
        """Number of state variables of a run."""
        return 2 * len(self.free) + len(self.states)

    @cached_property
    def prescribed_index(self) -> list[int]:
        """Indices of the prescribed among all coordinates."""
        return [self.coordinates.index(c) for c in self.prescribed]

    @cached_property
    def driven_index(self) -> list[int]:
        """Indices of the prescribed, then of the powered coordinates."""
        return [self.coordinates.index(c) for c in (*self.prescribed, *self.powered)]

    @property
    def equations(self) -> Equations:
        """The equations without contact forces."""
        return self.dynamics.equations

    @cached_property
    def rounding(self) -> float:
        """Two roundings [m] of a position of the mechanism."""
        return 2.0 * float(np.spacing(self.mechanism.reach))

    @cached_property
    def guard_functions(self) -> list[hy.expression]:
        """Functions that fall through zero at events, in the order of `guards`."""
        return guard_functions(self.run, self.guards, self.dynamics.stabilised)

    @cached_property
    def steep(self) -> SteepLoads | None:
        """Loads too steep for a Taylor series; None without any."""
        formulas, torques = self.equations.frames.formulas, self.dynamics.drives.characteristics
        if not (formulas or torques):
            return None
        found = SteepLoads(self.mechanism, self.equations.frames, self.elements, torques)
        return found if found.enclosure.count else None

    def fired(self, parameters: Array | memoryview[float]) -> int | None:
        """Guard that ended the last step, by these runtime parameters; reset when read."""
        guard = int(parameters[self.parameters.fired]) - 1
        parameters[self.parameters.fired] = 0.0
        return guard if guard >= 0 else None

    @cached_property
    def lone(self) -> bool:
        """True if there is a single gap, without friction: a faster loop serves this case."""
        alone = len(self.guards) == len(self.gaps) == 1
        return alone and not (self.compliant or any(self.rated))

    @cached_property
    def rated(self) -> tuple[bool, ...]:
        """Mask (m,) of the gaps that have a rate but no value, see `Gap.value`."""
        return tuple(jet.value is None for jet in self.dynamics.contacts.normal)

    @cached_property
    def compliant(self) -> bool:
        """True if contacts are compliant: a force law instead of a unilateral constraint."""
        return self.dynamics.contacts.compliant

    @cached_property
    def frictional(self) -> bool:
        """True if any gap has friction."""
        return bool(self.dynamics.contacts.frictional)

    @cached_property
    def slides(self) -> bool:
        """True if equations without sticking contacts hold most of the time, and cost less."""
        set_valued = self.dynamics.frictional_joints or self.set_valued.holding
        return self.frictional and not (self.compliant or set_valued)

    def integrator(
        self,
        rtol: float,
        scale: float = 1.0,
        compact: bool = False,
        owner: object = None,
        order: int | None = None,
        sticks: bool = True,
    ) -> hy.taylor_adaptive_dbl:
        """Adaptive Taylor integrator with the terminal guards of every gap.

        State: free coordinates, their rates, states of first order over their scales, a constant
        that only sets the step, states whose derivatives are the guards, with closures one whose
        derivative is the distance from singular positions, then cosine and sine of the angles in
        `turning`,
        which cost less as solutions of a linear equation than as functions. heyoka ties its order
        p to its tolerance, ``tol = exp(-2 (p - 1))``, and steps so that the last term is about
        `tol` of the largest state variable. Four orders more than it would take for `rtol` make
        fewer and cheaper steps; the constant, as the largest state variable, keeps the error
        where it should be.

        Parameters
        ----------
        rtol : error of a step relative to `scale`
        scale : size of the largest rate [rad/s]
        compact : compile slower but smaller code (for many coordinates)
        owner : object that steps with it; by default this system
        order : order of its series; by default from `rtol`
        sticks : True if contacts may stick
        """
        # four orders more: 300 instead of 390 steps in a revolution of the thesis scene
        # and not fewer than laws have: their polynomials stand beside its series
        order = order or max(math.ceil(5.0 - 0.5 * math.log(rtol)), self.degree)
        tolerance = math.exp(-2.0 * (order - 1.5))
        integrator = compiled.integrator(
            self.taylor(sticks), tolerance, compact, self.parameters.fired, owner or self
        )
        integrator.state[self.width] = scale * rtol / tolerance
        integrator.pars[:] = self.parameters.values
        return integrator

    def taylor(self, sticks: bool) -> compiled.TaylorEquations:
        """Equations and guards of `integrator`, over their variables; made once.

        Parameters
        ----------
        sticks : True if contacts may stick
        """
        if sticks not in self._taylors:
            self._taylors[sticks] = self._made(
                self.dynamics.stabilised if sticks else self.dynamics.sliding
            )
        return self._taylors[sticks]

    def _made(self, solved: Solved) -> compiled.TaylorEquations:
        constant = hy.make_vars('step_constant')
        frames = self.equations.frames
        a = [dense(x) for x in solved.a]
        guards = self.guard_functions
        if not solved.sticks:
            guards = guard_functions(self.run, self.guards, solved)
        rates = [frames.v[c] for c in self.turning]
        near = [self.dynamics.distance] if self.relations else []
        known = [*self.run.acted([*a, *self.run.state_rates]), *guards, *near]
        driven = iter(self.run.driven([*self._by_directions(known), *rates]))
        a, own, guards, near, rates = (
            list(islice(driven, len(x))) for x in (a, self.states, guards, near, rates)
        )
        motion = [(frames.q[c], frames.v[c]) for c in self.free]
        motion += [(frames.v[c], a_c) for c, a_c in zip(self.free, a, strict=True)]
        motion += zip(self.run.scaled_states, own, strict=True)
        # too small to matter: their Taylor series tell what they watch for nothing
        watch = [
            (hy.make_vars(f'watch{k}'), _GUARDS.watch_scale * g) for k, g in enumerate(guards)
        ]
        watch += [(hy.make_vars('singularity'), _GUARDS.watch_scale * x) for x in near]
        directions: list[tuple[hy.expression, hy.expression]] = []
        for (cosine, sine), rate in zip(self._direction_symbols, rates, strict=True):
            directions += [(cosine, -(rate * sine)), (sine, rate * cosine)]
        # the constant's rate, which is nothing, names the last parameter: heyoka wants no others
        equations = [
            *motion,
            (constant, _GUARDS.tiny * hy.par[self.parameters.fired]),
            *watch,
            *directions,
        ]
        return compiled.TaylorEquations(equations, guards)

    @cached_property
    def edges(self) -> Edges | None:
        """Finder of the changes of switch rows along a motion; None without switches."""
        return Edges(self.equations.frames) if self.switches else None

    @cached_property
    def turning(self) -> tuple[str, ...]:
        """The angles whose cosine and sine are states: prescribed, and turning steadily.

        They drift by a rounding in each step, which counts where contacts are stiff.
        """
        angles = [c for c in self.prescribed if c not in self.mechanism.displacements]
        return tuple(angles) if self.degree == 1 and self.lone else ()

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
        return substitute(expressions, replace)

    @cached_property
    def contact_layout(self) -> Layout:
        """Layout of the terms that ``functions.contact_function`` returns."""
        m, rows = len(self.gaps), len(self.dynamics.contacts.rows)
        compliant = m if self.compliant else 0
        return Layout(m, rows, len(self.free), len(self.prescribed), compliant)
