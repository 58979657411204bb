"""Formulas that people write, as expressions: ``-0.2*rate + 3*sin(20*t)``.

Only arithmetic and the functions below are read: nothing is executed.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import heyoka as hy

from mechanism_sim.errors import quoted

FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    'sin': hy.sin,
    'cos': hy.cos,
    'tan': hy.tan,
    'exp': hy.exp,
    'log': hy.log,
    'sqrt': hy.sqrt,
    'tanh': hy.tanh,
    'abs': lambda x: hy.sqrt(x * x),
}
LARGEST = 1e30
"""Of the numbers in a formula: beyond, products leave the range of floating-point numbers."""

LONGEST = 1000
"""Characters of a formula."""

DEEPEST = 200
"""Operations in each other: a sum of so many terms is as deep."""

_POWERS: dict[Any, int] = {2: 2, 3: 3, 4: 4}
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


def parse(text: str) -> ast.expr:
    """The tree of a formula.

    Raises
    ------
    ValueError
        One sentence: what cannot be read.
    """
    if len(text) > LONGEST:
        raise ValueError(f'{quoted(text)} is no formula: it is longer than {LONGEST} characters')
    try:
        tree = ast.parse(text, mode='eval').body
    except (SyntaxError, ValueError) as error:  # the latter of numbers with too many digits
        said = error.msg if isinstance(error, SyntaxError) else str(error)
        raise ValueError(f'{quoted(text)} is not a formula: {said}') from error
    except (RecursionError, MemoryError):
        raise ValueError(f'{quoted(text)} is not a formula: it is nested too deep') from None
    if _depth(tree) > DEEPEST:
        raise ValueError(
            f'{quoted(text)} is no formula: it is nested deeper than {DEEPEST} levels'
        )
    return tree


def _depth(tree: ast.expr) -> int:
    depth, level = 0, [tree]
    while level:
        depth += 1
        level = [
            c for node in level for c in ast.iter_child_nodes(node) if isinstance(c, ast.expr)
        ]
    return depth


def names(text: str) -> set[str]:
    """Names of the variables in a formula.

    Raises
    ------
    ValueError
        If it cannot be read.
    """
    tree = parse(text)
    called = [n.func for n in ast.walk(tree) if isinstance(n, ast.Call)]
    found = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and n not in called}
    return found - {'pi'}


def expression(
    text: str,
    known: Mapping[str, hy.expression],
    number: Callable[[float], hy.expression] = hy.expression,
) -> hy.expression:
    """A formula as an expression of what is known.

    Parameters
    ----------
    text : the formula
    known : expressions by the names that it may hold
    number : makes expressions of its numbers in the order in which they are written; zero, one
        and exponents, which shape the expression, are constants

    Raises
    ------
    ValueError
        If it names or calls something else.
    """
    return hy.expression(0.0) + _build(parse(text), {'pi': hy.pi, **known}, number, text)


def _build(
    node: ast.expr, known: Mapping[str, Any], number: Callable[[float], Any], text: str
) -> Any:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        if not abs(node.value) <= LARGEST:  # 1e400 is infinite to Python
            raise ValueError(f'a number in {quoted(text)} is larger than {LARGEST:g}')
        constant = hy.expression if node.value in (0, 1) else number
        return constant(float(node.value))
    if isinstance(node, ast.Name):
        if node.id in known:
            return known[node.id]
        raise ValueError(
            f"'{node.id}' in {quoted(text)} is not known; known are {', '.join(known)}"
        )
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        value = _build(node.operand, known, number, text)
        return -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        left, right = (_build(side, known, number, text) for side in (node.left, node.right))
        return _BINARY[type(node.op)](left, right)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
        exponent = node.right
        value = getattr(exponent, 'value', None)
        if value in _POWERS:
            return reduce(operator.mul, [_build(node.left, known, number, text)] * _POWERS[value])
        raise ValueError(f'the power in {quoted(text)} must be 2, 3 or 4')
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and len(node.args) == 1:
        if node.func.id in FUNCTIONS:
            return FUNCTIONS[node.func.id](_build(node.args[0], known, number, text))
        raise ValueError(
            f"'{node.func.id}' in {quoted(text)} is not a function known here; known are "
            f'{", ".join(FUNCTIONS)}'
        )
    raise ValueError(f'{quoted(text)} is not a formula of numbers, names, + - * / and functions')
