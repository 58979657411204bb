"""Linear algebra on small matrices of heyoka expressions.

Structural zeros are ``None``, so that what a scene does not have is not compiled.

Results of the same terms are the same objects: machines of which only values differ have the same
expressions, and heyoka compares those that share all their parts at once, others as trees.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from itertools import chain, combinations, product
from math import perm
from typing import Any, TypeAlias, TypeVar

import heyoka as hy

T = TypeVar('T')

Term: TypeAlias = Any
"""A heyoka expression, or None for a structural zero; heyoka itself is not typed."""

Vector: TypeAlias = list[Term]
Matrix: TypeAlias = list[list[Term]]


_MOST = 40_000  # expressions that are kept: a scene has some thousands
_SMALL = 20_000
"""Nodes of an expression made elsewhere that is compared with others: as trees, without end."""

_first: dict[hy.expression, hy.expression] = {}  # of all that are equal
_own: dict[int, hy.expression] = {}  # those that stand for themselves, by identity
_made: dict[tuple[object, ...], tuple[Any, tuple[Term, ...]]] = {}  # results, and terms as keys


def forget() -> None:
    """Release the stored expressions."""
    for known in (_first, _own, _made):
        known.clear()


def _same(x: Term) -> hy.expression:
    """First of equal expressions."""
    if id(x) in _own:
        return x
    x = x if isinstance(x, hy.expression) else hy.expression(float(x))
    if _is_small(x):
        x = _first.setdefault(x, x)
    _own[id(x)] = x
    return x


def _is_small(x: hy.expression) -> bool:
    try:
        return 0 < len(x) <= _SMALL  # 0: too many to count
    except OverflowError:
        return False


def kept(key: object, make: Callable[..., T], *terms: Term) -> T:
    """Result of a function of terms, of an earlier call if there was one.

    Parameters
    ----------
    key : hashable key of the result
    make : function of the terms, as expressions
    """
    if len(_own) > _MOST:
        forget()
    terms = tuple(map(_same, terms))
    full = (key, *map(id, terms))
    known = _made.get(full)
    if known is None:
        known = _made[full] = make(*terms), terms  # as long as these are kept, so are their ids
    found: T = known[0]
    return found


def _owned(*made: hy.expression) -> tuple[hy.expression, ...]:
    _own.update((id(x), x) for x in made)
    return made


def _one(*terms: Term, by: Callable[..., hy.expression]) -> Term:
    return kept(by, lambda *given: _owned(by(*given)), *terms)[0]


def _sum(*terms: hy.expression) -> hy.expression:
    return hy.sum(list(terms))


def add(*terms: Term) -> Term:
    """Sum that skips structural zeros."""
    present = [t for t in terms if t is not None]
    if len(present) <= 1:
        return present[0] if present else None
    return _one(*present, by=_sum)


def mul(a: Term, b: Term) -> Term:
    """Product; zero when either factor is."""
    return None if a is None or b is None else _one(a, b, by=operator.mul)


def neg(a: Term) -> Term:
    """The negative."""
    return None if a is None else _one(a, by=operator.neg)


def div(a: Term, b: Term) -> Term:
    """Quotient; `b` must not be a structural zero."""
    if b is None:
        raise ZeroDivisionError('structurally singular matrix')
    return None if a is None else _one(a, b, by=operator.truediv)


def substitute(
    terms: Sequence[hy.expression], replace: Mapping[hy.expression, hy.expression]
) -> list[hy.expression]:
    """The terms with others in the place of some."""
    if not terms or not replace:
        return list(terms)
    count = len(terms)

    def make(*given: hy.expression) -> tuple[hy.expression, ...]:
        pairs = dict(zip(given[count::2], given[count + 1 :: 2], strict=True))
        return _owned(*hy.subs(list(given[:count]), pairs))

    return list(kept(count, make, *terms, *chain.from_iterable(replace.items())))


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


class _Entry:
    """A number less products, summed up when its value is requested: few sums cost least."""

    def __init__(self, start: Term, products: tuple[Term, ...] = ()) -> None:
        self._start, self._products = start, products

    def less(self, a: Term, b: Term) -> _Entry:
        """Entry less the product ``a b``."""
        x = mul(a, b)
        return self if x is None else _Entry(self._start, (*self._products, x))

    @cached_property
    def value(self) -> Term:
        """The number."""
        total = add(*self._products)
        if total is None or self._start is None:
            return self._start if total is None else neg(total)
        return _one(self._start, total, by=operator.sub)


def solve_dragged(
    K: Matrix, b: Vector, drags: dict[int, Term], active: Vector, apart: dict[int, Vector]
) -> tuple[Vector, Term]:
    """Solve ``A x = b`` by LU without pivoting; leading minors must not vanish.

    A is symmetric K, but for some columns k: from each, its drag times column k - 1 is taken off.
    Where there is such a drag, row k - 1 must not be active. Or that column is given apart, where
    K is without it. Entries that are equal are one expression: of A and K those that no drag has
    reached, of either those across its diagonal.

    Parameters
    ----------
    K : (n, n) with its lower triangle read; large on the diagonal of inactive rows
    drags : drags by column
    active : (n,) flags 1 or 0
    apart : (n,) by column, factor of its drag if that is not column k - 1

    Returns
    -------
    x (n,), 0 where not active, where a drag is minus that times the next; det A over det K
    """
    n = len(K)
    half = [[_Entry(K[r][c]) for c in range(r + 1)] for r in range(n)]
    A = [[half[max(r, c)][min(r, c)] for c in range(n)] for r in range(n)]
    undragged, right = [list(row) for row in A], [_Entry(x) for x in b]
    for k, column in apart.items():
        for row, entry in zip(A, column, strict=True):
            row[k] = row[k].less(drags[k], entry)
    share: Term = hy.expression(1.0)
    before: Vector = []
    for k in range(n):
        if k in drags and k not in apart:
            for r in range(k, n):
                A[r][k] = A[r][k].less(drags[k], before[r])
        before = [row[k].value for row in A]
        if A[k][k] is not undragged[k][k]:
            share = share * (A[k][k].value / undragged[k][k].value)
        made: dict[tuple[int, ...], _Entry] = {}
        for M in (A, undragged):
            old, pivot = [list(row) for row in M], M[k][k]
            for r, c in product(range(k + 1, n), repeat=2):
                entry, left, above = old[r][c], old[r][k], old[k][c]
                key = (id(entry), id(pivot), *sorted((id(left), id(above))))
                if key not in made:
                    made[key] = entry.less(div(left.value, pivot.value), above.value)
                M[r][c] = made[key]
        for r in range(k + 1, n):
            right[r] = right[r].less(div(A[r][k].value, A[k][k].value), right[k].value)
    x: Vector = [None] * n
    for k in reversed(range(n)):
        for c in range(k + 1, n):
            right[k] = right[k].less(A[k][c].value, x[c])
        x[k] = mul(active[k], div(right[k].value, A[k][k].value))
        if k + 1 in drags and k + 1 not in apart:
            x[k] = add(x[k], neg(mul(drags[k + 1], x[k + 1])))
    return x, share
