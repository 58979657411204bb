"""Expressions that people write, in loads, measures, conditions and goals: one grammar, one tree.

``-0.2*rate + 3*sin(20*t) if t > 2 else 0``: numbers, with units or in SI units; names, which may
have dots; ``+ - * /``, constant powers as ``^`` or ``**``; ``< <= > >=``, also in chains, ``and``,
``or``, ``not``; ``A if X else B``; functions. A unit stands behind its number and belongs to it
alone: ``1/2 s`` is 0.5 Hz, ``3 m^2`` an area. Nothing is executed. Python's own parser would not
do: it knows no units, takes ``^`` for another operation, and says little of what is wrong.

What differs from place to place are tables given to `parse`: functions, and figures of a whole run
with their windows. A tree is evaluated as numbers of NumPy (`numbers`) or made a heyoka expression
(`mechanism_sim.numerics.formula`); its unit follows from those of its names (`unit_of`).
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import reduce
from itertools import pairwise
from typing import Any, NamedTuple, NoReturn

import numpy as np

from mechanism_sim.errors import InputError, nearest, other_word, quoted
from mechanism_sim.units import alike, common, product, read_common, root

SMOOTH = 'sin', 'cos', 'tan', 'atan', 'exp', 'log', 'sqrt', 'tanh'
CORNERED = 'abs', 'sign', 'min', 'max'
"""Functions with a corner or a step."""

FUNCTIONS = {**dict.fromkeys((*SMOOTH, 'abs', 'sign'), 1), 'min': 2, 'max': 2, 'hypot': 2}
"""Functions everywhere: 1 where there is one argument, 2 where there are two or more."""

ALIASES = {'ln': 'log', 'arctan': 'atan'}
"""Other names of functions, which are understood where nothing else has them."""

_CHOICE = "'A if X > Y else B'"
OTHER_WORDS = {
    **dict.fromkeys(('where', 'ifelse', 'heaviside', 'step', 'unit_step'), f'a choice, {_CHOICE}'),
    **dict.fromkeys(('impact', 'bistop'), "a joint 'contact', or 'stops' of a joint"),
    'pow': "a power, as 'x^2'",
    'd': "'deg'",
}
"""Functions and units of other programs, and what stands here for them."""

_ELECTRICAL = 'V', 'mV', 'A', 'mA', 'ohm', 'Ohm', 'Ω', 'H', 'mH', 'uH', 'F'

LARGEST = 1e30
"""Limit of numbers in a text: products of larger ones may overflow."""
LONGEST = 1000
"""Characters of a text."""
_STEEPEST = 20  # largest exponent of a power
DEEPEST = 200
"""Largest depth of nested operations: that of a sum is its number of terms."""

_TOKEN = re.compile(
    r'\s*(?:(?P<number>(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)'
    r'|(?P<name>[^\W\d]\w*(?:\.\w+)*)|(?P<sign>\*\*|[<>=!]=|[-+*/^<>(),=])|(?P<other>\S))'
)
_LEVELS = {
    'if': 0, 'or': 1, 'and': 2, **dict.fromkeys(('<', '<=', '>', '>='), 4),
    '+': 5, '-': 5, '*': 6, '/': 6, '**': 8, '^': 8,
}  # fmt: skip
"""Precedence of operators; that of ``not`` is 3, that of a sign before a term 7."""
_WORDS = 'if', 'else', 'and', 'or', 'not'
_BETWEEN_UNITS = '/', '·', '⋅'
AFTER = (
    "after the expression in {} may stand 'from TIME', 'to TIME' and 'per revolution', each once"
)


@dataclass(frozen=True, slots=True)
class ExpressionNode:
    """An operation, a function or a leaf of an expression."""

    #: number, pi, name, call, figure, negative, ``+ - * / **``, compare, not, and, or; if, of a
    #: condition and two values
    kind: str
    args: tuple[ExpressionNode, ...] = ()  #: operands or arguments
    name: str = ''  #: text of a name, function or figure; the signs of a comparison
    value: float = 0.0  #: number in SI units; index of a figure in the text
    unit: str | None = None  #: unit of a number with one
    #: words after the expression of a figure, with their values
    window: tuple[tuple[str, str], ...] = ()
    text: str = field(default='', compare=False)  #: text as written

    def walk(self) -> Iterator[ExpressionNode]:
        """All nodes, each after its operands."""
        for x in self.args:
            yield from x.walk()
        yield self

    @property
    def names(self) -> list[str]:
        """The different names, in the order of their appearance."""
        return list(dict.fromkeys(n.name for n in self.walk() if n.kind == 'name'))


class _Token(NamedTuple):
    kind: str
    text: str
    start: int
    end: int


def _tokens(text: str) -> list[_Token]:
    found = [(m.lastgroup or '', m) for m in _TOKEN.finditer(text)]
    return [_Token(kind, m[kind], m.start(kind), m.end()) for kind, m in found]


class _ExpressionReader:
    """Reads a text from left to right, by the strength of its signs (Pratt's method).

    Parameters
    ----------
    figures : functions of a whole run by the names that are understood
    """

    def __init__(
        self, text: str, functions: Mapping[str, int], figures: Mapping[str, str]
    ) -> None:
        self._text, self._functions, self._figures = text, functions, figures
        self._tokens = [*_tokens(text), *[_Token('end', '', len(text), len(text))] * 2]
        self._at = self._deep = self._count = 0

    def tree(self) -> ExpressionNode:
        """The whole text."""
        found = self._expression(0)
        if self._now.kind != 'end':
            self._refuse()
        return found

    @property
    def _now(self) -> _Token:
        return self._tokens[self._at]

    def _take(self, *texts: str) -> str:
        """Take the next token if it is one of some; returns it, or nothing."""
        token = self._now
        if token.text not in texts or not token.text:
            return ''
        self._at += 1
        return token.text

    def _expect(self, text: str) -> None:
        if not self._take(text):
            self._refuse(text)

    def _refuse(self, wanted: str = 'something') -> NoReturn:
        """Refuse the next token with a reason."""
        text, token = quoted(self._text), self._now
        signs = [t.text for t in self._tokens]
        if token.text in ('==', '!='):
            raise InputError(
                f"a condition in {text} must be made of < and >, 'and', 'or' and 'not'"
            )
        if token.kind == 'other':
            raise InputError(
                f'{text} is not made of numbers with units, names, + - * / ^, comparisons with '
                f"< and >, 'and', 'or', 'not', {_CHOICE} and functions: "
                f'{quoted(token.text)} is none of them'
            )
        before = f"behind '{self._tokens[self._at - 1].text}'" if self._at else 'at the beginning'
        said = f"'{token.text}' cannot stand {before}"
        if token.kind == 'end':
            said = f'{wanted} is missing {before}'
        if token.kind == 'end' and signs.count('(') > signs.count(')'):
            said = "'(' was never closed"
        if token.text == 'if':
            said += f': write {_CHOICE}'
        raise InputError(f'{text} is not a formula: {said}')

    def _node(self, start: int, kind: str, *args: ExpressionNode, **more: Any) -> ExpressionNode:
        written = self._text[start : self._tokens[self._at - 1].end]
        return ExpressionNode(kind, args, text=' '.join(written.split()), **more)

    def _expression(self, level: int) -> ExpressionNode:
        """All that is joined by signs of at least this level."""
        self._deep += 1
        if self._deep > DEEPEST:
            raise RecursionError
        start = self._now.start
        if level <= 3 and self._take('not'):
            node = self._node(start, 'not', self._expression(3))
        elif sign := level <= 7 and self._take('+', '-'):
            node = self._expression(7)
            node = self._node(start, 'negative', node) if sign == '-' else node
        else:
            node = self._operand()
        while _LEVELS.get(sign := self._now.text, -1) >= level:
            node = self._joined(start, node, sign)
        self._deep -= 1
        return node

    def _joined(self, start: int, left: ExpressionNode, sign: str) -> ExpressionNode:
        """The operation of a sign on its left side and on all that it binds on its right."""
        level, args = _LEVELS[sign], [left]
        signs: list[str] = []
        if sign == 'if':
            self._at += 1
            test = self._expression(1)
            self._expect('else')
            return self._node(start, 'if', test, left, self._expression(0))
        chain = level in (1, 2, 4)  # and, or, comparisons
        while _LEVELS.get(self._now.text) == level and (chain or not signs):
            signs.append(self._take(self._now.text))
            args.append(self._expression(7 if level > 5 else level + 1))
        kind = {4: 'compare', 8: '**'}.get(level, sign)
        if level == 8:
            args[1] = self._exponent(args[1])
        return self._node(start, kind, *args, name=' '.join(signs))

    def _exponent(self, node: ExpressionNode) -> ExpressionNode:
        """A power as the number that it is."""
        own = {'number', 'pi', 'negative', '+', '-', '*', '/'}
        if any(x.kind not in own or x.unit for x in node.walk()):
            raise InputError(
                f'the power {quoted(node.text)} in {quoted(self._text)} must be a number, as in '
                'x^1.3: of others write exp(POWER*log(BASE))'
            )
        return self._node(self._now.start, 'number', value=float(numbers(node, {})))

    def _operand(self) -> ExpressionNode:
        token = self._now
        if self._take('('):
            node = self._expression(0)
            self._expect(')')
            return node
        if token.kind == 'number':
            return self._quantity()
        if token.kind != 'name' or token.text in _WORDS:
            self._refuse()
        self._at += 1
        if self._now.text == '(':
            return self._call(token)
        if token.text in ('pi', 'π'):
            return self._node(token.start, 'pi', value=math.pi)
        return self._node(token.start, 'name', name=token.text)

    def _quantity(self) -> ExpressionNode:
        """A number and the unit behind it, to which a power belongs that stands behind both."""
        number, unit, start = self._now.text.replace('_', ''), '', self._now.start
        self._at += 1
        while True:
            over = self._now.text if unit and self._now.text in _BETWEEN_UNITS else ''
            found, count = self._unit(self._at + bool(over))
            if not found:
                break
            unit += ('/' if over == '/' else ' ') + found
            self._at += bool(over) + count
            if self._take('^', '**'):
                unit += f'^{self._take("-")}{self._now.text}'
                self._at += self._now.kind == 'number' or self._refuse()
        behind, text = self._now.text, quoted(self._text)
        if self._now.kind == 'name' and behind not in _WORDS:
            as_product = f'a product is written {number}*{behind}'
            hint = other_word(behind, OTHER_WORDS) or f': {as_product}'
            if behind in _ELECTRICAL:
                said = 'those of electrical quantities are in SI units, without any'
                hint = f' of formulas: {said}; {as_product}'
            raise InputError(f"'{behind}' behind {number} in {text} is not a unit{hint}")
        if not unit:
            return self._node(start, 'number', value=float(number))
        try:
            value, si = read_common(number, unit.strip())
        except (ValueError, ArithmeticError) as error:
            raise InputError(f'{text}: {error}') from error
        return self._node(start, 'number', value=value, unit=si)

    def _unit(self, at: int) -> tuple[str, int]:
        """The unit that begins at a token, and its number of tokens; nothing of a function."""
        first, slash, last, behind = (self._tokens[at : at + 4] + [self._tokens[-1]] * 4)[:4]
        if slash.text == '/' and behind.text != '(' and not common(first.text):
            found = common(f'{first.text}/{last.text}')  # r/min
            return found, 3
        return '' if slash.text == '(' else common(first.text), 1

    def _call(self, token: _Token) -> ExpressionNode:
        """A function with its arguments; a figure also has words after them."""
        args: list[ExpressionNode] = []
        window: list[tuple[str, str]] = []
        self._at += 1
        while not self._take(')'):
            if args and not (self._take(',') or (window and self._now.text == 'to')):
                self._refuse(',')
            behind = self._tokens[self._at + 1]
            timed = args and behind.kind in ('number', 'name' if self._now.text == 'per' else '')
            if timed and (word := self._take('from', 'to', 'per')):
                window.append((word, self._time()))
            elif window or (args and behind.text == '='):
                raise InputError(AFTER.format(quoted(self._text)))
            elif self._now.text != ')':
                args.append(self._expression(0))
        name, text = token.text, quoted(self._text)
        inner = [n.name for x in args for n in x.walk() if n.kind == 'figure']
        several = name in self._functions and (len(args) > 1 or bool(inner))
        if name in self._figures and not several:
            if inner:
                raise InputError(
                    f"'{inner[0]}' in {text} is of a whole run and cannot stand in '{name}'"
                )
            self._count += 1
            return self._node(
                token.start, 'figure', *args, name=self._figures[name],
                value=self._count - 1, window=tuple(window),
            )  # fmt: skip
        if window and name in self._functions:
            raise InputError(f"'{window[0][0]}' in {text} stands in '{name}', which is of no run")
        name = name if name in self._functions else ALIASES.get(name, name)
        return self._node(token.start, 'call', *args, name=name)

    def _time(self) -> str:
        """The time of a window, a number and a word; or the word behind per."""
        first = self._now
        self._at += 1
        if first.kind == 'number' and self._now.kind == 'name' and self._now.text != 'to':
            self._at += 1
        return self._text[first.start : self._tokens[self._at - 1].end]


def tree_of(text: str) -> ExpressionNode:
    """Tree of heyoka's printed text: without limits, and with any functions."""
    return _ExpressionReader(text, FUNCTIONS, {}).tree()


def parse(
    text: str,
    functions: Mapping[str, int] | None = FUNCTIONS,
    figures: Mapping[str, str] | None = None,
) -> ExpressionNode:
    """The tree of a text; `InputError` with one sentence if it is none.

    Parameters
    ----------
    functions : allowed functions, as `FUNCTIONS`; any if None
    figures : functions of a whole run by the names that are understood
    """
    said = f'{quoted(text)} is not a formula'
    if len(text) > LONGEST:
        raise InputError(f'{said}: it is longer than {LONGEST} characters')
    try:
        bare = re.sub('#.*', '', text)  # without remarks
        tree = _ExpressionReader(
            bare, FUNCTIONS if functions is None else functions, figures or {}
        ).tree()
    except RecursionError:
        raise InputError(f'{said}: it is nested too deep') from None
    level, depth = [tree], 0
    while level := [x for node in level for x in node.args]:
        depth += 1
        if depth >= DEEPEST:
            raise InputError(f'{said}: it is nested deeper than {DEEPEST} levels')
    for node in tree.walk():
        if node.kind == 'number' and not node.value <= LARGEST:  # 1e400 is infinite
            raise InputError(f'a number in {quoted(text)} is larger than {LARGEST:g}')
        if node.kind == '**' and not abs(node.args[1].value) <= _STEEPEST:
            raise InputError(
                f'the power in {quoted(text)} must be from -{_STEEPEST} to {_STEEPEST}'
            )
        if node.kind == 'call' and functions is not None:
            _check_call(node, functions, figures or {}, text)
    return tree


def _check_call(
    node: ExpressionNode, functions: Mapping[str, int], figures: Mapping[str, str], text: str
) -> None:
    """Refuse a function that is not known, or not with so many arguments."""
    name, count = node.name, len(node.args)
    if name not in functions:
        hint = other_word(name, OTHER_WORDS) or nearest(name, [*figures, *functions])
        own = ', '.join(dict.fromkeys(figures.values()))
        within = f'functions: {own}; in them ' if own else ''
        raise InputError(
            f"'{name}' in {quoted(text)} is not a function known here{hint}; {within}known are "
            f'{", ".join(sorted(functions))}'
        )
    if functions[name] == 1 and count != 1:
        raise InputError(f'{name} in {quoted(text)} needs one argument, but has {count}')
    if functions[name] > count:
        raise InputError(f'{name} in {quoted(text)} needs at least two arguments')


def sides(text: str, *signs: str) -> tuple[str, str, str] | None:
    """Texts before and behind the only sign outside of brackets, and the sign.

    None if there is none, or more. The sign is ``=``, or one of some.
    """
    depth, found = 0, []
    for token in _tokens(text):
        depth += (token.text == '(') - (token.text == ')')
        found += [token] * (token.text in (signs or ('=',)) and depth == 0)
    if len(found) != 1:
        return None
    return text[: found[0].start].strip(), found[0].text, text[found[0].end :].strip()


def unit_hint(name: str) -> str:
    """Hint on an unknown name that is one of a unit; else empty."""
    said = ', a unit: it stands behind its number, as in 20 N m or 300 rpm'
    return said if common(name) else ''


# --- units ---------------------------------------------------------------------------------------


def unit_of(node: ExpressionNode, units: Mapping[Any, str | None], text: str) -> str | None:
    """The SI unit of an expression; None of bare numbers, which fit any.

    Parameters
    ----------
    units : of names, of figures by what stands before them, of further functions by ``NAME()``
    text : whole text, for messages
    """
    if node.kind in ('number', 'pi'):
        return node.unit
    if node.kind in ('name', 'figure'):
        return units[node.name if node.kind == 'name' else int(node.value)]
    found = [unit_of(x, units, text) for x in node.args]
    name, first = node.name if node.kind == 'call' else node.kind, found[0]
    if f'{name}()' in units:
        return units[f'{name}()']
    if name in _ALIKE:
        given = [u for u in found[name == 'if' :] if u is not None]
        for other in given[1:]:
            if not alike(given[0], other):
                a, b = (u or 'a plain number' for u in (given[0], other))
                done = f'{a} and {b} are {_ALIKE[name]} in {quoted(text)}'
                pair = (given[0], other), (other, given[0])
                weighed = any(x == 'kg' and alike(y, 'm/s^2') for x, y in pair)
                hint = '; g is gram here, standard gravity is g_0' if weighed else ''
                raise InputError(f'{done}: the units differ in kind{hint}')
        return '' if name == 'compare' else given[0] if given else None
    if name in ('*', '/'):
        power = 1 if name == '*' else -1
        return product(first or '', found[1] or '', power) if {*found} != {None} else None
    if name in ('negative', 'abs') or (first is None and name in ('**', 'sqrt')):
        return first
    if name == '**' and first is not None:
        return _unit_of_power(first, node.args[1].value, text)
    if name == 'sqrt' and first is not None:
        if (unit := root(first)) is None:
            raise InputError(f'the root of {first} in {quoted(text)} has no unit')
        return unit
    if name in SMOOTH and not alike(first or '', ''):
        raise InputError(f'{name} in {quoted(text)} needs a plain number, not one in {first}')
    return ''


def check_bare_numbers(node: ExpressionNode, units: Mapping[Any, str | None], text: str) -> None:
    """Refuse a number without a unit beside a quantity, which `unit_of` accepts.

    Zero needs none, nor does what stands beside an angle.
    """
    for part in node.walk():
        if (part.name if part.kind == 'call' else part.kind) not in _ALIKE:
            continue
        sides = part.args[part.kind == 'if' :]
        given = [u for x in sides if (u := unit_of(x, units, text)) and not alike(u, '')]
        for x in sides if given else ():
            own = {n.kind for n in x.walk()}
            if own <= _CONSTANT and unit_of(x, units, text) is None and numbers(x, {}) != 0.0:
                lone = own <= {'number', 'negative'}
                raise InputError(
                    f'{x.text} in {quoted(text)} has no unit beside what is in {given[0]}: write '
                    f'{x.text if lone else f"({x.text})*1"} {given[0]}'
                )


def _unit_of_power(unit: str, power: float, text: str) -> str:
    if not unit or power == int(power):
        return product('', unit, int(power))
    base = root(unit)
    if base is None or 2.0 * power != int(2.0 * power):
        raise InputError(
            f'the power {power:g} in {quoted(text)} needs a plain number, not one in {unit}'
        )
    return product('', base, int(2.0 * power))


_ALIKE = {
    '+': 'added', '-': 'added', 'if': 'chosen between', 'compare': 'compared', 'min': 'in min',
    'max': 'in max', 'hypot': 'in hypot',
}  # fmt: skip
"""Operations that need equal units, in words."""
_CONSTANT = {'number', 'pi', 'negative', '+', '-', '*', '/', '**'}


# --- numbers -------------------------------------------------------------------------------------

_OPERATIONS: dict[str, Callable[..., Any]] = {
    'negative': operator.neg, '+': operator.add, '-': operator.sub, '*': operator.mul,
    '/': np.divide, '<': np.less, '<=': np.less_equal, '>': np.greater, '>=': np.greater_equal,
    'and': np.logical_and, 'or': np.logical_or, 'min': np.minimum, 'max': np.maximum,
    **{name: getattr(np, name) for name in (*SMOOTH, 'abs', 'sign', 'hypot')},
}  # fmt: skip


def numbers(node: ExpressionNode, known: Mapping[Any, Any]) -> Any:
    """Value of an expression in numbers or arrays; conditions are 0 and 1, undefined is NaN.

    Parameters
    ----------
    known : values by name, and of figures by their index
    """
    with np.errstate(all='ignore'):
        return _numbers(node, known)


def _numbers(node: ExpressionNode, known: Mapping[Any, Any]) -> Any:
    if node.kind in ('number', 'pi'):
        return node.value
    if node.kind in ('name', 'figure'):
        return known[node.name if node.kind == 'name' else int(node.value)]
    args = [_numbers(x, known) for x in node.args]
    match node.kind:
        case '**':
            power = int(args[1]) if args[1] == int(args[1]) else args[1]
            return (np.float64(args[0]) if isinstance(args[0], float) else args[0]) ** power
        case 'not':
            return 1.0 - (args[0] != 0.0)
        case 'and' | 'or':
            return reduce(_OPERATIONS[node.kind], [np.asarray(x) != 0.0 for x in args]) * 1.0
        case 'compare':
            signs = zip(node.name.split(), pairwise(args), strict=True)
            return reduce(np.logical_and, [_OPERATIONS[s](*pair) for s, pair in signs]) * 1.0
        case 'if':
            return np.where(np.asarray(args[0]) != 0.0, args[1], args[2])
    operation = _OPERATIONS[node.name if node.kind == 'call' else node.kind]
    return reduce(operation, args) if len(args) > 1 else operation(*args)
