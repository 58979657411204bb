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
    try:
        return ast.parse(text, mode='eval').body
    except SyntaxError as error:
        raise ValueError(f"'{text}' is not a formula: {error.msg}") from error


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


def expression(text: str, known: Mapping[str, hy.expression]) -> hy.expression:
    """A formula as an expression of what is known.

    Raises
    ------
    ValueError
        If it names or calls something else.
    """
    return hy.expression(0.0) + _build(parse(text), {'pi': hy.pi, **known}, text)


def _build(node: ast.expr, known: Mapping[str, Any], text: str) -> Any:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return hy.expression(float(node.value))
    if isinstance(node, ast.Name):
        if node.id in known:
            return known[node.id]
        raise ValueError(f"'{node.id}' in '{text}' is not known; known are {', '.join(known)}")
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        value = _build(node.operand, known, text)
        return -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        left, right = _build(node.left, known, text), _build(node.right, known, text)
        return _BINARY[type(node.op)](left, right)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
        exponent = node.right
        value = getattr(exponent, 'value', None)
        if value in _POWERS:
            return reduce(operator.mul, [_build(node.left, known, text)] * _POWERS[value])
        raise ValueError(f"the power in '{text}' must be 2, 3 or 4")
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and len(node.args) == 1:
        if node.func.id in FUNCTIONS:
            return FUNCTIONS[node.func.id](_build(node.args[0], known, text))
        raise ValueError(
            f"'{node.func.id}' in '{text}' is not a function known here; known are "
            f'{", ".join(FUNCTIONS)}'
        )
    raise ValueError(f"'{text}' is not a formula of numbers, names, + - * / and functions")
