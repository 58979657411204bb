"""The engine's expressions in readable symbols; needs sympy.

A coordinate is ``theta_LINK`` or ``s_LINK``; sympy knows ``thetadot`` and ``thetaddot`` for its
derivatives. The runtime parameters ``par[i]`` become symbols with a name, a meaning and a value,
the value always positive: a sign belongs to the equation.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import heyoka as hy
import sympy
from sympy.simplify.fu import TR8

from mechanism_sim.linkages.formulas import FormulaState
from mechanism_sim.numerics.symbolic import Term, dense
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.frames import STATE
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.rotor import Rotor, disk_of
from mechanism_sim.planar.switches import SwitchTable
from mechanism_sim.planar.tilt import Tilt
from mechanism_sim.units import product

Expression: TypeAlias = Any
"""A sympy expression; sympy is not typed."""

_LATEX = {
    'theta': r'\theta', 'thetadot': r'\dot{\theta}', 'thetaddot': r'\ddot{\theta}',
    'sdot': r'\dot{s}', 'sddot': r'\ddot{s}', 'xdot': r'\dot{x}', 'xddot': r'\ddot{x}',
    'ydot': r'\dot{y}', 'yddot': r'\ddot{y}', 'tau': r'\tau', 'sigma': r'\sigma', 'Rsq': 'R^2',
    'Mz': 'M', 'zdot': r'\dot{z}', 'zddot': r'\ddot{z}',
    'xi': r'\xi', 'xidot': r'\dot{\xi}',
    'phi': r'\varphi', 'phidot': r'\dot{\varphi}', 'phiddot': r'\ddot{\varphi}',
}  # fmt: skip
"""Stems that LaTeX writes otherwise."""

_INDEXED = {
    'lambda': r'\lambda', 'Q': 'Q', 'Qdot': r'\dot{Q}', 'F': 'F', 'e': 'e', 'n': 'n',
    'theta': r'\theta', 'l': 'l', 'v': 'v',
}  # fmt: skip
"""Stems whose last letter is an index."""

_LARGE = 100  # operations from which on an expression is left as the engine has it


@dataclass(frozen=True)
class Symbol:
    """A symbol of the equations and its meaning."""

    symbol: Expression
    latex: str
    name: str  #: name in the engine
    meaning: str
    unit: str
    value: float | None = None  #: SI; none for what changes during a run


class Symbols:
    """Translation from heyoka to sympy for the equations of one machine."""

    def __init__(self, equations: Equations, states: Sequence[FormulaState] = ()) -> None:
        self.known: dict[str, Symbol] = {}  #: every symbol made so far, by its text
        self._equations = equations
        self._displacements = equations.mechanism.displacements
        self._variables: dict[Expression, Expression] = {}
        #: symbols by coordinate
        self.q: dict[str, Expression] = {}
        self.v: dict[str, Expression] = {}
        self.a: dict[str, Expression] = {}
        self.state_rates: list[Expression] = []  #: symbols of rates of states of first order
        frames = equations.frames
        for c in equations.coordinates:
            stem, subject, what, unit = self._kind(c)
            for own, engine, dots, name, words, per in (
                (self.q, frames.q, '', c, what, unit),
                (self.v, frames.v, 'dot', f'{c}_rate', f'rate of {c}', f'{unit}/s'),
                (
                    self.a,
                    frames.a,
                    'ddot',
                    f'{c}_acceleration',
                    f'acceleration of {c}',
                    f'{unit}/s^2',
                ),
            ):
                own[c] = self.make(stem + dots, (subject,), name, words, per)
                self._variables[_sympy_symbol(str(engine[c]))] = own[c]
        self.time = self.make('t', (), 'time', 'time', 's')
        for number, state in enumerate(states):
            self._variables[_sympy_symbol(str(frames.state(number)))] = self._state(state)
        for name, variable in frames.outside.items():
            known = self.time
            if name.startswith(STATE):
                continue
            if name != 'time':
                c = name.removesuffix('.turns')
                known = self.make('n', (c,), name, f'whole turns that theta_{c} leaves out', '')
            self._variables[_sympy_symbol(str(variable))] = known
        for name, switch in frames.switches.items():
            for k, symbol in enumerate(switch.symbols):
                meaning = f'1 where {bare(name)} acts, otherwise 0'
                known = self.make('sigma', (name,), f'{name}.on', meaning, '')
                if isinstance(switch, SwitchTable):
                    meaning = f'number {k} of the present row of the table {name}'
                    known = self.make(f'c{k}', (name,), f'{name}.row.{k}', meaning, '')
                self._variables[_sympy_symbol(str(symbol))] = known

    def _state(self, state: FormulaState) -> Expression:
        """The symbol of a state; that of its rate is noted."""
        name, unit, words = state.label, state.unit, f'state {state.label} of first order'
        per = product(unit, 's', -1)
        rate = self.make('xidot', (name,), f'{name}_rate', f'rate of the {words}', per)
        self.state_rates.append(rate)
        return self.make('xi', (name,), name, words, unit)

    def _kind(self, c: str) -> tuple[str, str, str, str]:
        """Stem, subject, meaning and unit of a coordinate."""
        link, _, axis = c.partition('.')
        mechanism = self._equations.mechanism
        if link in mechanism.having(Rotor) and axis:
            pair, _, way = axis.rpartition('_')
            if c not in self._displacements:
                disk = disk_of(pair)
                at = f'of {link} at its disk {disk}' if disk else f'of {link}'
                subject = ' '.join(x for x in (link, disk, way) if x)
                return 'phi', subject, f'slope of the axis {at} towards {way}', 'rad'
            where = f'its disk or support {pair}' if pair else 'its middle'
            subject, what = f'{link} {pair}'.strip(), f'{way} of the axis of {link} in {where}'
            return way, subject, f'{what}, from where it rests', 'm'
        if axis and link in mechanism.having(Tilt) and c not in self._displacements:
            way = axis[-1]
            return (
                'phi',
                f'{link} {way}',
                f'inclination of {link} along the {way} of its frame',
                'rad',
            )
        if link in mechanism.having(Tilt) and axis:
            return 'z', link, f'displacement of {link} along its axes', 'm'
        if c in mechanism.deformations:
            return axis, link, f'amplitude of the shape {axis} of the elastic link {link}', 'm'
        if c not in self._displacements:
            return 'theta', c, f'angle of the link {c} from the x axis', 'rad'
        if axis:
            return axis, link, f'{axis} of the centre of gravity of the link {link}', 'm'
        return 's', c, f'displacement of the link {c} along its guide', 'm'

    def unit_of_force(self, c: str) -> str:
        """Unit of the generalised force on a coordinate."""
        return 'N' if c in self._displacements else 'N m'

    def make(
        self,
        stem: str,
        subjects: tuple[str, ...],
        name: str,
        meaning: str,
        unit: str,
        value: float | None = None,
    ) -> Expression:
        """A new symbol ``stem_subject``, or the present one of the same quantity.

        The same is what has stem, subjects and value in common; of several values the later ones
        are numbered.
        """
        subjects = tuple(bare(s) for s in subjects)
        base = text = '_'.join([stem, *(re.sub(r'\W', '_', s) for s in subjects)])
        number = 1
        while text in self.known:
            if value is not None and self.known[text].value == value:
                return self.known[text].symbol
            number += 1
            text = f'{base}_{number}'
        labels = [*subjects, *([str(number)] if number > 1 else [])]
        symbol = _sympy_symbol(text)
        self.known[text] = Symbol(symbol, _latex(stem, labels), name, meaning, unit, value)
        return symbol

    def is_of_angle(self, joint: str, closure: Term) -> bool:
        """True if a closure is an angle, of which the engine makes a distance."""
        index = self._equations.parameters.names.get(f'{joint}.size')
        return index is not None and hy.par[index] in hy.get_params(dense(closure))

    def translate(self, term: Term) -> Expression:
        """A term of the engine in these symbols, lightly simplified."""
        found = hy.to_sympy(dense(term))
        exchange = {x: self._variables[x] for x in found.free_symbols if x in self._variables}
        parameters = [x for x in found.free_symbols if str(x).startswith('par[')]
        exchange |= {x: self._parameter(x) for x in sorted(parameters, key=_index)}
        exchange |= {x: _number(x) for x in found.atoms(sympy.Float)}
        return tidy(found.xreplace(exchange))

    def _parameter(self, par: Expression) -> Expression:
        if par not in self._variables:
            index, parameters = _index(par), self._equations.parameters
            name = next(n for n, i in parameters.names.items() if i == index)
            self._variables[par] = self._named(name, parameters.values[index])
        return self._variables[par]

    def _named(self, name: str, value: float) -> Expression:
        """The parameter `name` by a symbol of positive value."""
        if re.search(r'\.number\.\d+$', name):  # as it is written in a formula
            return _number(value)
        if name.endswith('.size'):  # with which the engine makes a distance of an angle
            return sympy.Integer(1)
        if name.endswith('.half_clearance'):
            return self._clearance(name, 2.0 * value) / 2
        if name.endswith('.minus_curvature'):
            return -1 / self._clearance(name, -1.0 / value)
        found, size = describe(name, self._equations), abs(value)
        sign = sympy.Integer(-1 if value < 0.0 else 1)
        if found.direction and size == 1.0:
            return sign
        constant = None if found.changes else size
        return sign * self.make(
            found.stem, found.subjects, name, found.meaning, found.unit, constant
        )

    def _clearance(self, name: str, value: float) -> Expression:
        joint = name.rpartition('.')[0]
        text = f'c_{joint}'
        if text in self.known:  # the two parameters are its half and its reciprocal
            return self.known[text].symbol
        return self.make('c', (joint,), f'{joint}.clearance', f'clearance of {joint}', 'm', value)

    def terms(self, expression: Expression) -> tuple[Expression, ...]:
        """Terms of which an expression is the sum, in the order of the coordinates in them."""
        rank = {s: i for own in (self.q, self.v, self.a) for i, s in enumerate(own.values())}

        def key(term: Expression) -> tuple[list[int], Any]:
            found = sorted({rank[s] for s in term.free_symbols if s in rank})
            return found or [len(rank)], sympy.default_sort_key(term)

        return tuple(sorted(sympy.Add.make_args(expression), key=key))

    def used(self, expressions: list[Expression]) -> Iterator[Symbol]:
        """The symbols that occur in expressions, in the order in which they were made."""
        found = set().union(*(x.free_symbols for x in expressions))
        for known in self.known.values():
            if known.symbol in found:
                yield known


def tidy(expression: Expression) -> Expression:
    """Equal expression, shorter: products of directions become directions of differences."""
    roots = any(not x.exp.is_Integer for x in expression.atoms(sympy.Pow))
    if roots or sympy.count_ops(expression) > _LARGE:
        return expression  # a law of force is best known by the form that it has
    expanded = sympy.expand(expression)
    turned = sympy.expand(TR8(expanded))
    forms = [expression, expanded, turned, *map(sympy.factor_terms, (expanded, turned))]
    forms.append(sympy.Add(*map(sympy.factor_terms, sympy.Add.make_args(expression))))
    return min(forms, key=_clumsiness)


def _number(value: Expression) -> Expression:
    """A number; as a fraction if it belongs to the form of an equation, as 1/2 does."""
    fraction = sympy.Rational(value)
    largest = 16 if fraction.q > 1 else 9999
    return fraction if fraction.q <= 8 and abs(fraction.p) <= largest else sympy.Float(value)


def _clumsiness(expression: Expression) -> int:
    """Operations, and some for a fraction in front of a sum."""
    operations = int(sympy.count_ops(expression))
    return operations + 3 if expression.is_Mul and expression.args[0].is_Rational else operations


def _index(par: Expression) -> int:
    """Index of a runtime parameter."""
    return int(str(par)[4:-1])


def _sympy_symbol(text: str) -> Expression:
    return sympy.Symbol(text, real=True)


def _latex(stem: str, subjects: list[str]) -> str:
    index = ''
    for indexed, written in _INDEXED.items():
        if re.fullmatch(f'{indexed}[xy012]', stem):
            stem, index = written, stem[-1]
    escaped = ', '.join(s.replace('_', r'\_') for s in subjects)
    labels = [index] * bool(index) + [rf'\mathrm{{{escaped}}}'] * bool(subjects)
    base = _LATEX.get(stem, stem)
    return f'{base}_{{{",".join(labels)}}}' if labels else base


class Description(NamedTuple):
    """Description of a parameter: symbol, meaning and unit."""

    stem: str  #: stem of its symbol
    subjects: tuple[str, ...]  #: indices of its symbol
    meaning: str
    unit: str
    direction: bool = False  #: True for a component of a unit vector
    changes: bool = False  #: True if it changes during a run


def describe(name: str, equations: Equations) -> Description:
    """Words for the parameter `name`; an unknown one is returned as it is."""
    for read in (_of_masses, _of_vectors):
        found = read(name, equations)
        if found:
            return found
    for pattern, stem, meaning, unit in _MEANINGS:
        if match := re.fullmatch(pattern, name):
            subjects = tuple(bare(x) for x in match.groups())
            said = meaning.format(*subjects)
            return Description(
                stem, subjects, said, unit, stem in ('ex', 'ey', 'ez'), stem in ('sigma', 'v0')
            )
    return Description('p', (bare(name),), name, '')


def bare(subject: str) -> str:
    """A name without the kind of thing it belongs to."""
    return re.sub(r'^(springs|loads)\.|^.*:', '', subject)


_MEANINGS = (
    (r'unknown:(.+)\.x', 'ex', 'x of the direction of {0}', ''),
    (r'unknown:(.+)\.y', 'ey', 'y of the direction of {0}', ''),
    (r'unknown:(.+)\.torque', 'ez', 'sense of {0}', ''),
    (r'(.+)\.slip:(.+)', 'r', 'arm of the friction in {0} on {1}', 'm'),
    (r'(.+)\.height', 'h', 'height of the wall of {0}', 'm'),
    (r'(.+)\.closed', 'sigma', '1 while {0} is closed, otherwise 0', ''),
    (
        r'(.+)\.approach',
        'v0',
        'speed at which {0} closed, or that its load gives it from rest',
        'm/s',
    ),
    (r'(.+)\.stiffness', 'k', 'stiffness of {0}', 'N/m or N m/rad'),
    (r'(.+)\.damping', 'd', 'damping of {0}', 'N s/m or N m s/rad'),
    (r'(.+)\.free_length', 'l0', 'length of {0} without force', 'm'),
    (r'(.+)\.stiffness\.(\d+)', 'k', 'stiffness against {0}, entry {1} of its row', 'N/m, N, N m'),
    (r'(.+)\.damping\.(\d+)', 'c', 'damping of {0}, entry {1} of its row', 'N s/m, N s, N m s'),
    (
        r'(.+)\.internal_damping\.(\d+)',
        'ci',
        'damping of {0} in the shaft, entry {1}',
        'N s/m, N s, N m s',
    ),
    (r'(.+)\.polar_inertia', 'Ip', 'polar moment of inertia of {0}', 'kg m^2'),
    (r'(.+)\.free_angle', 'theta0', 'angle of {0} without moment', 'rad'),
    (r'(.+)\.torque', 'Mz', 'torque of {0}', 'N m'),
    (r'(.+)\.entry', 'R', 'radius of the mouths of the slots of {0}', 'm'),
    (r'(.+)\.entry\.square', 'Rsq', 'square of the radius of the slots of {0}', 'm^2'),
    (r'(.+)\.towards', 'theta0', 'direction in which {0} is locked', 'rad'),
    (r'(.+)\.distance', 'D', 'distance of the centres of {0}', 'm'),
    (r'(.+)\.wave', 'K', 'angle by length of the slots of {0}', 'rad/m'),
    (r'(.+)\.(?:middle|offset|towards|axis)\.x', 'ex', 'x of the direction of {0}', ''),
    (r'(.+)\.(?:middle|offset|towards|axis)\.y', 'ey', 'y of the direction of {0}', ''),
    (r'(.+)\.lowest', 's0', 'place of the follower of {0} on the base circle', 'm or rad'),
    (r'(.+)\.offset', 'e', 'offset of the follower of {0}', 'm'),
    (r'(.+)\.pivot_distance', 'D', 'distance of the pivot of the follower of {0}', 'm'),
    (r'(.+)\.place', 'theta0', 'angle of the frame of {0}', 'rad'),
    (r'(.+)\.arm\.0', 'r1', 'radius of the first pulley of {0}', 'm'),
    (r'(.+)\.arm\.1', 'r2', 'radius of the second pulley of {0}', 'm'),
    (r'(.+)\.pull', 'r2', 'radius of the second pulley of {0}', 'm'),
    (r'(.+)\.stretched', 'z0', 'stretch of {0} by its pretension', 'm'),
    (r'(.+)\.apart', 'D', 'distance of the pulleys of {0}', 'm'),
    (r'(.+)\.motor\.ratio', 'i', 'turns of the motor of {0} in one of the link', ''),
    (r'(.+)\.motor\.pace', 'T0', 'reciprocal of the synchronous speed of {0}', 's/rad'),
    (r'(.+)\.motor\.slip', 'sk', 'slip of the motor of {0} at its breakdown torque', ''),
    (r'(.+)\.motor\.breakdown', 'Mk', 'breakdown torque of the motor of {0}', 'N m'),
    (r'(.+)\.arm', 'r', 'length of the follower of {0}', 'm'),
    (r'(.+)\.per_phase', 'b', 'displacement of the flanks of {0} by phase of the teeth', 'm/rad'),
    (r'(.+)\.phase', 'u0', 'phase of the teeth of {0} at the start', 'rad'),
    (r'(.+)\.play', 'c', 'play of {0} to either side', 'm'),
    (r'(.+)\.variation\.(\d+)', 'a', 'part {1} of the variation of the stiffness of {0}', ''),
    (r'(.+)\.error\.(\d+)', 'E', 'part {1} of the transmission error of {0}', 'm'),
    (r'(.+)\.(?:first\.)?lever', 'rb', 'arm of the line of action of {0}', 'm'),
    (r'(.+)\.narrow', 'w', 'reciprocal sine of a quarter of the part of the cycle of {0}', ''),
    (r'(.+)\.halfway\.x', 'hx', 'x of the direction at half the angle of {0}', ''),
    (r'(.+)\.halfway\.y', 'hy', 'y of the direction at half the angle of {0}', ''),
    (r'(.+)\.half', 'w', 'cosine of half the part of the cycle in which {0} acts', ''),
    (r'(.+)\.stop_radius', 'rs', 'radius at which {0} stops', 'm'),
    (r'(.+)\.stop_at', 's', 'limit at which {0} stops', 'rad or m'),
    (r'(.+)\.stop_half', 's', 'half of the angle between the stops of {0}', 'rad'),
    (r'(.+)\.stop_middle', 'sm', 'minus the angle in the middle between the stops of {0}', 'rad'),
    (r'(.+)\.stop_offset', 'sm', 'angle of the frames of {0} against each other', 'rad'),
    (r'(.+)\.reach', 'R', 'sum of the radii of {0}', 'm'),
    (
        r'(.+)\.across\.(\d+)',
        'rd',
        'difference of the radii at the ends of stretch {1} of {0}',
        'm',
    ),
    (r'(.+)\.radius\.(\d+)', 'r', 'radius of pulley {1} of {0}', 'm'),
    (r'(.+)\.length', 'L', 'length of {0}', 'm'),
    (r'(.+)\.bar_length', 'L', 'length of the bar of {0}', 'm'),
    (r'(.+)\.x', 'Fx', 'x of the force {0}', 'N'),
    (r'(.+)\.y', 'Fy', 'y of the force {0}', 'N'),
)
"""Pattern, stem, meaning, unit."""


def _of_masses(name: str, equations: Equations) -> Description | None:
    """Constants of mass matrix, velocity products and weight."""
    coordinates, straight = equations.coordinates, equations.mechanism.displacements
    kind, *rest = re.sub(r'(\.\d+)?(\.cross)?$', '', name).split(':')
    # on a guide that turns a displacement takes a metre off some of the constants
    plain = not any(
        slide and frame != GROUND
        for body in equations.mechanism.bodies
        for frame, slide in equations.mechanism.point(body.name, body.cog)
    )
    if kind == 'weight':
        (f,) = rest
        unit, arm = ('N', '') if f in straight else ('N m', ', times its arm')
        return Description('W', (f,), f'weight moved by {f}{arm}', unit if plain else '')
    if kind not in ('inertia', 'centripetal', 'coriolis'):
        return None
    f, g = rest[0], rest[-1]
    pair = tuple(sorted((f, g), key=coordinates.index))
    if kind == 'coriolis':
        return Description('C', pair, f'Coriolis term of {f}: masses times arms', '')
    unit = ('kg m^2', 'kg m', 'kg')[sum(c in straight for c in pair)] if plain else ''
    if f == g:
        stem = 'm' if f in straight else 'I'
        meaning = f'inertia of all that moves with {f}, reduced to it'
        return Description(stem, (f,), meaning, unit)
    # the constants of a pair come up in the mass matrix and in velocity products
    meaning = f'sum of masses times their arms on {pair[0]} and {pair[1]}'
    return Description('P', pair, meaning, unit)


def _of_vectors(name: str, equations: Equations) -> Description | None:
    """Components of the vectors of which a position is the sum, and of directions."""
    rest, _, axis = name.rpartition('.')
    label, *arm = rest.split('@')
    if not arm:
        return None
    frame, *slide = arm
    if slide:
        meaning = f'{axis} in the frame of {frame} of the direction of {slide[0]}'
        return Description(f'e{axis}', (slide[0],), meaning, '', direction=True)
    joint, _, part = label.removesuffix('.x').rpartition('.')
    joints = {joint.name for joint in equations.mechanism.joints}
    if joint in joints and part in ('normal', 'along', 'across', 'first', 'second'):
        meaning = f'{axis} in the frame of {frame} of a direction in {joint}'
        stem = {'normal': 'n', 'across': 'n', 'along': 'u'}.get(part, 'e')
        own = (joint, part) if stem == 'e' else (joint,)
        return Description(f'{stem}{axis}', own, meaning, '', direction=True)
    meaning = f'arm on {frame} towards {bare(label)}, {axis} in its frame'
    return Description('l' if axis == 'x' else 'h', (frame,), meaning, 'm')
