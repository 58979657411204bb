"""Expressions of the coordinates that carry their own derivatives (forward differentiation).

Written out by the chain rule, the derivatives share their factors and keep differences of nearly
equal terms together: fewer operations and less rounding than differentiating finished formulas.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import heyoka as hy

from mechanism_sim.numerics.symbolic import Term, add, dense, div, mul, neg

Number: TypeAlias = 'Jet | hy.expression | float'


@dataclass(frozen=True)
class Jet:
    """A function f of the coordinates q along a motion with rates v.

    Attributes
    ----------
    value : f
    gradient : derivatives by coordinate name; missing ones vanish
    rate : time derivative, ``gradient . v``
    curvature : second time derivative less ``gradient . a``
    """

    value: Term
    gradient: dict[str, Term]
    rate: Term
    curvature: Term

    def _names(self, other: Jet) -> list[str]:
        return list(dict.fromkeys((*self.gradient, *other.gradient)))

    def row(self, coordinates: tuple[str, ...]) -> list[Term]:
        """The gradient as a row (n,)."""
        return [self.gradient.get(name) for name in coordinates]

    def __add__(self, other: Number) -> Jet:
        o = lift(other)
        return Jet(
            add(self.value, o.value),
            {n: add(self.gradient.get(n), o.gradient.get(n)) for n in self._names(o)},
            add(self.rate, o.rate),
            add(self.curvature, o.curvature),
        )

    def __neg__(self) -> Jet:
        gradient = {n: neg(g) for n, g in self.gradient.items()}
        return Jet(neg(self.value), gradient, neg(self.rate), neg(self.curvature))

    def __sub__(self, other: Number) -> Jet:
        return self + -lift(other)

    def __mul__(self, other: Number) -> Jet:
        o = lift(other)
        cross = mul(self.rate, o.rate)
        return Jet(
            mul(self.value, o.value),
            {
                n: add(mul(self.gradient.get(n), o.value), mul(self.value, o.gradient.get(n)))
                for n in self._names(o)
            },
            add(mul(self.rate, o.value), mul(self.value, o.rate)),
            add(
                mul(self.curvature, o.value),
                mul(self.value, o.curvature),
                None if cross is None else 2.0 * cross,
            ),
        )

    def __truediv__(self, other: hy.expression | float) -> Jet:
        """Quotient by something that does not move."""
        o = dense(lift(other).value)
        gradient = {n: div(g, o) for n, g in self.gradient.items()}
        return Jet(div(self.value, o), gradient, div(self.rate, o), div(self.curvature, o))

    def chain(self, value: hy.expression, slope: Term, bend: Term) -> Jet:
        """``F(f)``, given its value and its first two derivatives there."""
        return Jet(
            value,
            {n: mul(slope, g) for n, g in self.gradient.items()},
            mul(slope, self.rate),
            add(mul(slope, self.curvature), mul(mul(bend, self.rate), self.rate)),
        )

    def across(self, other: Jet) -> Jet:
        """``f g' - g f'`` as a rate that belongs to no value: gradient, rate and curvature."""
        return Jet(
            None,
            {
                n: add(
                    mul(self.value, other.gradient.get(n)),
                    neg(mul(other.value, self.gradient.get(n))),
                )
                for n in self._names(other)
            },
            add(mul(self.value, other.rate), neg(mul(other.value, self.rate))),
            add(mul(self.value, other.curvature), neg(mul(other.value, self.curvature))),
        )

    def half_square(self) -> Jet:
        """f^2/2."""
        return Jet(
            mul(hy.expression(0.5), mul(self.value, self.value)),
            {n: mul(self.value, g) for n, g in self.gradient.items()},
            mul(self.value, self.rate),
            add(mul(self.value, self.curvature), mul(self.rate, self.rate)),
        )


def lift(x: Number) -> Jet:
    """A number or a parameter as a jet that does not move."""
    if isinstance(x, Jet):
        return x
    return Jet(x if isinstance(x, hy.expression) else hy.expression(float(x)), {}, None, None)
