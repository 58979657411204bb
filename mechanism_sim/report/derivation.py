"""A machine's own equations: closures, gaps, forces and motion, from what the engine solves.

``M(q) q'' + h(q, q') = J_n^T N + J_t^T T + G^T lambda + Q + tau`` row by row, in the symbols of
`report.symbols`. Nothing is derived again: every term is one of `planar.equations`, of a gap, a
relation or a force element, so a new kind of those needs nothing here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import heyoka as hy
import sympy

from mechanism_sim.engine.system import System
from mechanism_sim.numerics import formula
from mechanism_sim.numerics.expressions import CORNERED
from mechanism_sim.numerics.formula import Words
from mechanism_sim.numerics.symbolic import Term, dense
from mechanism_sim.planar.drive import Law, TorqueLaw
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.frames import Jet
from mechanism_sim.planar.protocols import Gap
from mechanism_sim.planar.switches import Switch
from mechanism_sim.planar.virtual_work import generalised
from mechanism_sim.report.symbols import Expression, Symbol, Symbols
from mechanism_sim.scene import Level, Machine
from mechanism_sim.scene.drives import drive_of
from mechanism_sim.scene.motion_keys import MotionProfile, SpeedPart

_SHORT = 5  # nodes of an expression up to which a position needs no symbol of its own
_TIME = 'now'
_MOST_LAWS = 24  # laws of a drive, one after the other, that are written
_LONG = 30  # operations from which on forces are written with intermediate quantities


def derive(machine: Machine, rates: bool = False) -> MachineEquations:
    """The equations of a machine at its level.

    Parameters
    ----------
    rates : add the first and second derivatives of closures and gaps
    """
    return _Derivation(machine, rates).result()


class _Derivation:
    def __init__(self, machine: Machine, rates: bool) -> None:
        self._machine, self._rates = machine, rates
        self._system: System | None = machine.equations.system if machine.level.dynamic else None
        model = self._system or machine.nominal.inverse_dynamics
        self._equations = model.equations
        self._elements = () if machine.level is Level.KINEMATIC else model.elements
        ideal, plan = machine.plan.ideal, machine.plan
        self._unknowns = plan.unknowns(ideal)
        self._friction_laws: list[str] = []
        self._efforts = {c: effort(ideal) for c, effort in plan.efforts.items()}
        self._symbols = Symbols(self._equations, plan.states)
        self._vectors = Vectors(self._equations, self._symbols)
        self._in_symbols, self._terms = self._vectors.in_symbols, self._vectors.terms
        self._motors = {motor.coordinate: motor for motor in machine.plan.motors}
        self._forces: list[Equation] = []
        self._on: dict[str, list[Expression]] = {c: [] for c in self._equations.coordinates}

    def result(self) -> MachineEquations:
        """All parts that are not empty."""
        machine, symbols = self._machine, self._symbols
        closures = self._closures()
        gaps = self._gaps()
        self._load()
        self._drives()
        parts = [
            EquationGroup('drive_laws', 'Drive', self._laws()),
            EquationGroup('closures', 'Closures', closures[0]),
            EquationGroup('closure_rates', 'Closures, differentiated once', closures[1]),
            EquationGroup('closure_accelerations', 'Closures, differentiated twice', closures[2]),
            gaps[0],
            EquationGroup('gap_rates', 'Gaps, differentiated once', gaps[1]),
            EquationGroup('gap_accelerations', 'Gaps, differentiated twice', gaps[2]),
            EquationGroup('forces', 'Forces', self._abridged()),
            EquationGroup(
                'motion', 'Equations of motion', self._motion(), tuple(self._friction_laws)
            ),
            EquationGroup('states', 'States of first order', self._states()),
        ]
        parts.insert(1, EquationGroup('switches', 'Parts of the cycle', self._switches(parts)))
        used = _symbols_of(parts)
        vectors = tuple(e for e in self._vectors.equations if e.left[0] in used)
        parts.insert(1, EquationGroup('vectors', 'Vectors', vectors))
        shown = _all_terms(parts)
        derivatives = [(symbols.q[c], symbols.v[c], symbols.a[c]) for c in symbols.q]
        own = {x for triple in derivatives for x in triple}
        others = [s for s in symbols.used(shown) if s.symbol not in own]
        return MachineEquations(
            machine.name,
            machine.scene.title,
            machine.level.value,
            tuple(self._coordinate(*(symbols.known[x.name] for x in d)) for d in derivatives),
            tuple(s for s in others if s.value is not None),
            tuple(s for s in others if s.value is None),
            tuple(p for p in parts if p.equations),
        )

    def _coordinate(self, q: Symbol, v: Symbol, a: Symbol) -> tuple[Symbol, Symbol, Symbol]:
        """The symbols of a coordinate, the first with what moves it in its meaning."""
        plan = self._machine.plan
        role = 'free' if self._system else 'follows from the closures'
        if q.name in plan.prescribed:
            role = 'prescribed'
        elif q.name in plan.powered and not self._idle(q.name):
            role = 'moved by its drive'
        return replace(q, meaning=f'{q.meaning}; {role}'), v, a

    def _push(self, jet: Jet, force: Expression) -> None:
        """Count a force along a row among the generalised forces."""
        for c, slope in jet.gradient.items():
            if slope is not None:
                self._on[c].append(sympy.Mul(force, self._in_symbols(slope)))

    def _derivatives(self, jet: Jet) -> tuple[tuple[Expression, ...], tuple[Expression, ...]]:
        """First and second time derivative as terms; the latter with the accelerations."""
        second = [
            sympy.Mul(self._in_symbols(slope), self._symbols.a[c])
            for c, slope in jet.gradient.items()
            if slope is not None
        ]
        return self._terms(jet.rate), (*second, *self._terms(jet.curvature))

    def _closures(self) -> tuple[tuple[Equation, ...], ...]:
        """Closures and their derivatives, all of which vanish."""
        orders: tuple[list[Equation], ...] = ([], [], [])
        zero = (sympy.Integer(0),)
        jets = iter(self._equations.relation_jets)
        for relation in self._equations.relations:
            values = relation.values(self._vectors.frames)
            plain = values == [jet for pair in self._vectors.frames.seen.values() for jet in pair]
            if all(_is_trigonometric(self._symbols.translate(jet.value)) for jet in values):
                self._vectors.frames.seen.clear()  # it reads best by its arms and angles
            self._vectors.use_seen()
            for index, jet in zip('xy' if plain else '12', [next(jets) for _ in values]):  # noqa: B905
                joint = relation.name
                of_angle = self._symbols.is_of_angle(joint, jet.value)
                orders[0].append(Equation(joint, self._terms(jet.value), zero))
                if self._rates:
                    for line, terms in zip(orders[1:], self._derivatives(jet), strict=True):
                        line.append(Equation(joint, terms, zero))
                if self._machine.level is not Level.KINEMATIC:
                    where = 'on the first link of' if plain else 'along a closure of'
                    what, unit = ('moment', 'N m') if of_angle else ('force', 'N')
                    meaning = f'{what} {index} {where} {joint}'
                    force = self._symbols.make(f'lambda{index}', (joint,), joint, meaning, unit)
                    self._push(jet, force)
        return tuple(map(tuple, orders))

    def _gaps(self) -> tuple[EquationGroup, tuple[Equation, ...], tuple[Equation, ...]]:
        """Gaps with their forces; and their derivatives."""
        lines: tuple[list[Equation], ...] = ([], [], [])
        for i, gap in enumerate(self._equations.gaps):
            gap.value(self._vectors.frames)
            self._vectors.use_seen()
            joint, make = gap.name, self._symbols.make
            # the engine's jets, not equal ones: heyoka is slow to find that they are equal
            jet = self._equations.gap_jets[i]
            g = make('g', (joint,), joint, f'gap of {joint}, zero when closed', 'm')
            lines[0].append(Equation(joint, (g,), self._terms(jet.value)))
            short = {jet.value: g}
            if self._rates or gap.law:
                names = ('gdot', 'rate', 'm/s'), ('gddot', 'second derivative', 'm/s^2')
                derivatives = zip(lines[1:], self._derivatives(jet), names, strict=True)
                for line, terms, (stem, what, unit) in derivatives:
                    left = make(stem, (joint,), joint, f'{what} of g_{joint}', unit)
                    line.append(Equation(joint, (left,), terms))
                short[jet.rate] = lines[1][-1].left[0]
            forces = [make('N', (joint,), joint, f'normal force in {joint}', 'N')]
            self._push(jet, forces[0])
            if gap.friction and self._system:
                slip = self._system.dynamics.contacts.tangent[i]
                u = make('u', (joint,), joint, f'tangential velocity in {joint}', 'm/s')
                lines[0].append(Equation(joint, (u,), self._terms(slip.rate)))
                short[slip.rate] = u
                meaning = f'friction on the first link of {joint}, along its slip'
                forces.append(make('T', (joint,), joint, meaning, 'N'))
                self._push(slip, forces[1])
            if gap.law and self._system:
                dynamics = self._system.dynamics
                known = {term: hy.make_vars(str(symbol)) for term, symbol in short.items()}
                known |= dict.fromkeys(
                    (dynamics.flags.closed[i], dynamics.flags.presses[i]), hy.expression(1.0)
                )
                laws = [dense(dynamics.exact.N[i]), dense(dynamics.exact.T[i])]
                laws = hy.subs(hy.subs(laws, dynamics.depths), known)
                for force, law in zip(forces, laws, strict=False):
                    self._forces.append(Equation(joint, (force,), (self._in_symbols(law),)))
        if not self._rates:
            lines[2].clear()
        values, first, second = map(tuple, lines)
        notes = tuple(map(_condition, self._equations.gaps))
        return EquationGroup('gaps', 'Gaps', values, notes), first, second

    def _load(self) -> None:
        """Generalised forces of what needs no gap, and where it acts in the cycle."""
        mechanism = self._equations.mechanism
        for element in self._elements:
            loads = element.loads(self._vectors.frames)
            found = generalised(loads, self._vectors.frames, mechanism)
            self._vectors.use_seen()
            for c, term in found.items():
                meaning = f'force of {element.name} on {c}'
                unit = self._symbols.unit_of_force(c)
                Q = self._symbols.make('Q', (element.name, c), element.name, meaning, unit)
                self._on[c].append(Q)
                self._forces.append(Equation(element.name, (Q,), self._terms(term)))

        for friction in self._machine.plan.frictions(mechanism):
            found = generalised(
                friction.loads(self._vectors.frames, hy.expression(1.0)), self._vectors.frames,
                mechanism,
            )  # fmt: skip
            self._vectors.use_seen()
            name, unit = friction.label, friction.unit
            meaning = f'friction of {friction.name} on its second link, against its slip'
            T = self._symbols.make('T', (name,), f'{name}.friction', meaning, unit)
            for c, term in found.items():
                self._on[c].append(sympy.Mul(T, self._in_symbols(term)))
            self._friction_laws.append(
                f'{name}: {friction.law.format(f"T_{name}", friction.name)}.'
            )
        for load in self._unknowns:
            found = generalised(load.loads(self._vectors.frames), self._vectors.frames, mechanism)
            self._vectors.use_seen()
            meaning = f'size of the load {load.label}, which is unknown'
            size = self._symbols.make('f', (load.label,), load.name, meaning, load.unit)
            for c, term in found.items():
                self._on[c].append(sympy.Mul(size, self._in_symbols(term)))

    def _switches(self, parts: Sequence[EquationGroup]) -> tuple[Equation, ...]:
        """Equations of the switches of terms that act in a part of the cycle only."""
        lines, used = [], _symbols_of(parts)
        for name, switch in self._equations.frames.switches.items():
            flag = self._in_symbols(switch.symbols[0])
            if isinstance(switch, Switch) and flag in used:
                self._vectors.use(name)
                left = self._symbols.make('s', (name,), name, f'positive where {name} acts', '')
                note = f'{flag} is 1 where this is positive, otherwise 0'
                lines.append(Equation(name, (left,), self._terms(switch.inside), note))
        return tuple(lines)

    def _abridged(self) -> tuple[Equation, ...]:
        """The laws of force; long ones with intermediate quantities before them."""
        sums = [sympy.Add(*e.right) for e in self._forces]
        if all(sympy.count_ops(x) < _LONG for x in sums):
            return tuple(self._forces)
        names = sympy.numbered_symbols('z', start=1, real=True)
        steps, rest = sympy.cse(sums, names, order='none')
        return (
            *(Equation(str(symbol), (symbol,), (value,)) for symbol, value in steps),
            *(Equation(e.name, e.left, (x,)) for e, x in zip(self._forces, rest, strict=True)),
        )

    def _drives(self) -> None:
        """Force of a drive: that of a prescribed motion is among the unknowns."""
        for c in self._machine.plan.laws:
            if self._idle(c) or self._machine.level is Level.KINEMATIC:
                continue
            unit = self._symbols.unit_of_force(c)
            stem, what = ('tau', 'torque') if unit == 'N m' else ('F', 'force')
            meaning = f'{what} of the drive on {c}'
            self._on[c].append(self._symbols.make(stem, (c,), c, meaning, unit))

    def _laws(self) -> tuple[Equation, ...]:
        """Motion, with its acceleration where that counts, or force that drives give."""
        lines = []
        symbols = self._symbols
        for c, laws in self._machine.plan.laws.items():
            motor = self._motors.get(c)
            by_formula = self._formula(c)
            lines += by_formula
            for law in () if self._idle(c) or by_formula else laws[:_MOST_LAWS]:
                since = f'for t >= {law.valid_from!r} s' if len(laws) > 1 else ''
                if len(laws) > _MOST_LAWS and law is laws[_MOST_LAWS - 1]:
                    since += '; and so on'
                if isinstance(law, TorqueLaw):
                    factors = (sympy.Integer(1), symbols.q[c], symbols.v[c])
                    given = _sum(law, factors) if any(law.coefficients) or not motor else ()
                    if motor:
                        given = (*given, *self._terms(motor.torque(self._equations.frames)))
                    lines.append(Equation(c, (self._on[c][-1],), given, since))
                    continue
                t = symbols.time - law.reference_time if law.reference_time else symbols.time
                given = _sum(law, [t**k for k in range(law.degree + 1)])
                lines.append(Equation(c, (symbols.q[c],), given, since))
                if self._machine.level is not Level.KINEMATIC:
                    twice = sympy.diff(sympy.Add(*given), symbols.time, 2)
                    lines.append(Equation(c, (symbols.a[c],), (twice,), since))
            if c in self._efforts:
                given = self._terms(self._efforts[c].effort(self._vectors.frames))
                lines.append(Equation(c, (self._on[c][-1],), given or (sympy.Integer(0),)))
        return tuple(lines)

    def _states(self) -> tuple[Equation, ...]:
        """The rate of every state."""
        if not self._system:
            return ()
        rates = self._system.dynamics.state_rates
        known = zip(self._system.states, self._symbols.state_rates, rates, strict=True)
        return tuple(Equation(x.label, (rate,), self._terms(given)) for x, rate, given in known)

    def _formula(self, c: str) -> list[Equation]:
        """Motion of a drive by its own formula of the time, if it has one without conditions."""
        drive = drive_of(self._machine.plan, c)
        profile = drive and (drive.position or drive.profile or drive.speed)
        if not isinstance(profile, MotionProfile) or profile.formula is None:
            return []
        tree, symbols = profile.tree(), self._symbols
        if any(n.kind == 'if' or n.name in CORNERED for n in tree.walk()):
            return []
        value = symbols.translate(formula.of_tree(tree, Words({'t': hy.make_vars(_TIME)}), ''))
        value = value.xreplace({x: symbols.time for x in value.free_symbols if str(x) == _TIME})
        by_rate = isinstance(profile, SpeedPart)
        lines = [Equation(c, ((symbols.v if by_rate else symbols.q)[c],), (value,))]
        if self._machine.level is not Level.KINEMATIC:
            more = sympy.diff(value, symbols.time, 1 if by_rate else 2)
            lines.append(Equation(c, (symbols.a[c],), (more,)))
        return lines

    def _idle(self, c: str) -> bool:
        """True if law and motor of a coordinate leave it free."""
        laws = self._machine.plan.laws[c]
        still = all(isinstance(law, TorqueLaw) and not any(law.coefficients) for law in laws)
        return still and c not in self._motors

    def _motion(self) -> tuple[Equation, ...]:
        """One row for each coordinate."""
        if self._machine.level is Level.KINEMATIC:
            return ()
        eq, symbols = self._equations, self._symbols
        lines = []
        for c, row, bias in zip(eq.coordinates, eq.M, eq.bias, strict=True):
            entries = dict(zip(eq.coordinates, row, strict=True))
            left = [
                sympy.Mul(symbols.translate(entries[d]), symbols.a[d])
                for d in sorted(entries, key=lambda d: d != c)
                if entries[d] is not None
            ]
            if bias is not None:
                left += symbols.terms(symbols.translate(bias))
            zero = [sympy.Integer(0)]
            lines.append(Equation(c, tuple(left or zero), tuple(self._on[c] or zero)))
        return tuple(lines)


def _all_terms(parts: Sequence[EquationGroup]) -> list[Expression]:
    """All terms of all equations."""
    return [x for p in parts for e in p.equations for x in (*e.left, *e.right)]


def _symbols_of(parts: Sequence[EquationGroup]) -> set[Expression]:
    """All symbols in all equations."""
    return set().union(*(x.free_symbols for x in _all_terms(parts)))


def _is_trigonometric(expression: Expression) -> bool:
    """True if it is made of sums, products and directions."""
    functions = {type(x) for x in expression.atoms(sympy.Function)}
    powers = all(x.exp.is_Integer for x in expression.atoms(sympy.Pow))
    return powers and functions <= {sympy.sin, sympy.cos}


def _sum(law: Law, factors: Sequence[Expression]) -> tuple[Expression, ...]:
    """The terms of a law, which are its coefficients times these."""
    terms = [a * x for a, x in zip(law.coefficients, factors, strict=True) if a]
    return tuple(terms) or (sympy.Integer(0),)


def _condition(gap: Gap) -> str:
    """Conditions of a gap and its forces, in words."""
    j = gap.name
    if gap.law is not None:
        return (
            f'{j}: its forces are those below while g_{j} < 0 and N_{j} so found is positive, and '
            'zero otherwise.'
        )
    text = (
        f'{j}: g_{j} >= 0, N_{j} >= 0, and one of both is zero; impacts by '
        f"{gap.hypothesis.capitalize()}'s hypothesis with restitution {gap.restitution:g}"
    )
    if math.isinf(gap.friction):
        text += f'; while closed it never slips, u_{j} = 0'
    elif gap.friction:
        text += (
            f'; |T_{j}| <= {gap.friction:g} N_{j}, and where u_{j} is not zero T_{j} has this '
            'size and opposes it'
        )
    return text + '.'


class _Recorder:
    """Frames that record the requested vectors, by label."""

    def __init__(self, frames: Any) -> None:
        self._frames = frames
        self._made: dict[str, tuple[Jet, Jet]] = {}
        self.seen: dict[str, tuple[Jet, Jet]] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._frames, name)

    def position(self, point: Any, label: str) -> tuple[Jet, Jet]:
        if label not in self._made:
            self._made[label] = self._frames.position(point, label)
        self.seen[label] = self._made[label]
        return self._made[label]


class Vectors:
    """Terms in symbols, some of which stand for vectors."""

    def __init__(self, equations: Equations, symbols: Symbols) -> None:
        #: those of the equations; they remember the vectors they are asked for
        self.frames: Any = _Recorder(equations.frames)
        self.equations: list[Equation] = []  #: meanings of the symbols of vectors
        self._mechanism, self._symbols = equations.mechanism, symbols
        self._abbreviations: dict[str | hy.expression, hy.expression] = {}
        self._named: dict[str, dict[str | hy.expression, hy.expression]] = {}

    def in_symbols(self, term: Term) -> Expression:
        """A term in symbols, with those of the vectors in it."""
        expression = dense(term)
        if self._abbreviations:
            [expression] = hy.subs([expression], self._abbreviations)
        return self._symbols.translate(expression)

    def terms(self, term: Term) -> tuple[Expression, ...]:
        """Terms of its sum, in symbols."""
        return () if term is None else self._symbols.terms(self.in_symbols(term))

    def use_seen(self) -> None:
        """Set symbols for the vectors requested since the last call, and no others."""
        self._abbreviations = {}
        for label, pair in self.frames.seen.items():
            if label not in self._named:
                self._named[label] = self._named_vector(label, pair)
            self._abbreviations |= self._named[label]
        self.frames.seen.clear()

    def _named_vector(
        self, label: str, pair: tuple[Jet, Jet]
    ) -> dict[str | hy.expression, hy.expression]:
        """Symbols for a vector and its rate, if it is not as short as a symbol."""
        if all(jet.value is None or len(jet.value) <= _SHORT for jet in pair):
            return {}
        symbols, found = self._symbols, {}
        joints = {joint.name for joint in self._mechanism.joints}
        where = 'from the second to the first link at' if label in joints else 'of'
        for axis, jet in zip('xy', pair, strict=True):
            for stem, term, what, unit in (
                (f'Q{axis}', jet.value, '', 'm'),
                (f'Qdot{axis}', jet.rate, 'rate of ', 'm/s'),
            ):
                if term is None:
                    continue
                meaning = f'{what}{axis} {where} {label}'
                symbol = symbols.make(stem, (label,), label, meaning, unit)
                line = Equation(label, (symbol,), symbols.terms(symbols.translate(term)))
                self.equations.append(line)
                found[term] = hy.make_vars(str(symbol))
        return found

    def use(self, label: str) -> None:
        """Select the symbols of a single vector, if it has any."""
        self._abbreviations = self._named.get(label, {})


@dataclass(frozen=True)
class Equation:
    """``left = right``, each the sum of its terms in their order."""

    name: str
    left: tuple[Expression, ...]
    right: tuple[Expression, ...]
    note: str = ''


@dataclass(frozen=True)
class EquationGroup:
    """Equations of one kind."""

    name: str
    heading: str
    equations: tuple[Equation, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class MachineEquations:
    """All equations of a machine, and the symbols in them."""

    scene: str
    title: str
    level: str
    coordinates: tuple[tuple[Symbol, Symbol, Symbol], ...]  #: symbols with rate and acceleration
    parameters: tuple[Symbol, ...]  #: constants of the scene
    variables: tuple[Symbol, ...]  #: forces, gaps and what else follows from the motion
    parts: tuple[EquationGroup, ...]
