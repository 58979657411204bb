"""Linear algebra on small matrices of heyoka expressions.

Structural zeros are ``None``, so that what a scene does not have is not compiled.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import perm
from typing import Any, TypeAlias

import heyoka as hy

Term: TypeAlias = Any
"""A heyoka expression, or None for a structural zero; heyoka itself is not typed."""

Vector: TypeAlias = list[Term]
Matrix: TypeAlias = list[list[Term]]


def add(*terms: Term) -> Term:
    """Sum that skips structural zeros."""
    present = [t for t in terms if t is not None]
    if len(present) <= 1:
        return present[0] if present else None
    return hy.sum(present)


def mul(a: Term, b: Term) -> Term:
    """Product; zero when either factor is."""
    return None if a is None or b is None else a * b


def neg(a: Term) -> Term:
    """The negative."""
    return None if a is None else -a


def div(a: Term, b: Term) -> Term:
    """Quotient; `b` must not be a structural zero."""
    if b is None:
        raise ZeroDivisionError('structurally singular matrix')
    return None if a is None else a / b


def dot(a: Sequence[Term], b: Sequence[Term]) -> Term:
    """Scalar product of two vectors of equal length."""
    return add(*(mul(x, y) for x, y in zip(a, b, strict=True)))


def dense(term: Term) -> hy.expression:
    """The expression, with a structural zero as the number 0."""
    return hy.expression(0.0) if term is None else term


def polynomial(coefficients: Sequence[Term], x: hy.expression, orders: int) -> list[hy.expression]:
    """A polynomial with rising powers and its derivatives, `orders` in all, by Horner."""
    found = []
    for order in range(orders):
        value: Term = None
        for k in range(len(coefficients) - 1, order - 1, -1):
            value = add(mul(value, x), float(perm(k, order)) * coefficients[k])
        found.append(dense(value))
    return found


def solve_symmetric(A: Matrix, columns: Sequence[Vector]) -> list[Vector]:
    """Solve ``A X = B`` for symmetric positive definite A by LDL^T.

    Parameters
    ----------
    A : n by n nested lists
        Only the lower triangle is read.
    columns : sequence of vectors of length n
        The right-hand sides.

    Returns
    -------
    One solution vector for each right-hand side.
    """
    L, D = factorise(A)
    return [backward(L, D, forward(L, b)) for b in columns]


def forward(L: Matrix, b: Sequence[Term]) -> Vector:
    """Solve ``L y = b``, with L as `factorise` gives it."""
    y: Vector = []
    for row, right in zip(L, b, strict=True):
        y.append(add(right, *(neg(mul(x, known)) for x, known in zip(row, y, strict=False))))
    return y


def backward(L: Matrix, D: Vector, y: Vector) -> Vector:
    """Solve ``D L^T x = y``, with L and D as `factorise` gives them."""
    n = len(D)
    x: Vector = [div(y[i], D[i]) for i in range(n)]
    for i in reversed(range(n)):
        x[i] = add(x[i], *(neg(mul(L[k][i], x[k])) for k in range(i + 1, n)))
    return x


def factorise(A: Matrix) -> tuple[Matrix, Vector]:
    """``A = L D L^T`` of a symmetric positive definite matrix.

    Returns
    -------
    L : (n, n) below its diagonal of ones
    D : (n,) pivots
    """
    n = len(A)
    L: Matrix = [[None] * n for _ in range(n)]
    D: Vector = [None] * n
    for j in range(n):
        D[j] = add(A[j][j], *(neg(mul(mul(L[j][k], L[j][k]), D[k])) for k in range(j)))
        for i in range(j + 1, n):
            s = add(A[i][j], *(neg(mul(mul(L[i][k], L[j][k]), D[k])) for k in range(j)))
            L[i][j] = div(s, D[j])
    return L, D


def cramer(A: Matrix, b: Vector) -> tuple[Vector, Term]:
    """Solve ``A x = b`` for a general matrix by Cramer's rule: no pivot can vanish, only det A.

    The minors of the first k rows and of some columns of ``[A b]`` are built up row by row. Their
    number doubles with each further row.

    Returns
    -------
    x and det A
    """
    n = len(A)
    rows = [[*row, right] for row, right in zip(A, b, strict=True)]
    minors: dict[tuple[int, ...], Term] = {(): hy.expression(1.0)}
    for k, row in enumerate(rows):
        minors = {
            columns: add(
                *(
                    mul(row[c], minors[columns[:i] + columns[i + 1 :]])
                    if (k + i) % 2 == 0
                    else neg(mul(row[c], minors[columns[:i] + columns[i + 1 :]]))
                    for i, c in enumerate(columns)
                )
            )
            for columns in combinations(range(n + 1), k + 1)
        }
    det = minors[tuple(range(n))]
    x: Vector = []
    for i in range(n):
        minor = div(minors[(*range(i), *range(i + 1, n + 1))], det)
        x.append(minor if (n - 1 - i) % 2 == 0 else neg(minor))
    return x, det


def eliminate(A: Matrix, b: Vector) -> tuple[Vector, Term]:
    """Result of `cramer`, by LU without pivoting; leading minors of A must not vanish."""
    n = len(A)
    L: Matrix = [[None] * n for _ in range(n)]
    U: Matrix = [[None] * n for _ in range(n)]
    for i in range(n):
        for j in range(n):
            left = add(A[i][j], *(neg(mul(L[i][k], U[k][j])) for k in range(min(i, j))))
            if i > j:
                L[i][j] = div(left, U[j][j])
            else:
                U[i][j] = left
    x = forward(L, b)
    for i in reversed(range(n)):
        x[i] = div(add(x[i], *(neg(mul(U[i][k], x[k])) for k in range(i + 1, n))), U[i][i])
    det: Term = hy.expression(1.0)
    for i in range(n):
        det = mul(det, U[i][i])
    return x, det
