"""Symbols of a mechanism's poses, and the constants behind them as runtime parameters."""

from __future__ import annotations

from dataclasses import dataclass, field

import heyoka as hy

from mechanism_sim.numerics.symbolic import Term, add, mul, neg
from mechanism_sim.planar.jet import Jet
from mechanism_sim.planar.mechanism import GROUND, Point, Vector2


@dataclass
class Parameters:
    """Numbers of a scene that compiled code reads at run time, so that a sweep never recompiles.

    Zeros and ones stay out: they shape the expressions.
    """

    names: dict[str, int] = field(default_factory=dict)
    values: list[float] = field(default_factory=list)

    def __call__(self, name: str, value: float) -> Term:
        """Expression of the parameter `name`; ``None`` for zero."""
        if value == 0.0:
            return None
        if name not in self.names:
            self.names[name] = len(self.values)
            self.values.append(float(value))
        return hy.par[self.names[name]]

    def reserve(self, name: str, value: float = 0.0) -> hy.expression:
        """Expression of a parameter that changes during a run and may be zero."""
        if name not in self.names:
            self.names[name] = len(self.values)
            self.values.append(float(value))
        return hy.par[self.names[name]]


class Frames:
    """Coordinates as symbols, and vectors that turn with the links.

    Attributes
    ----------
    q, v, a : dict
        Symbols of each coordinate, angle [rad] or displacement [m], its rate and acceleration.
    """

    def __init__(
        self,
        coordinates: tuple[str, ...],
        parameters: Parameters,
        displacements: tuple[str, ...] = (),
    ) -> None:
        self.parameters = parameters
        self.coordinates = coordinates
        self.displacements = displacements
        self.q = {n: hy.make_vars(n) for n in coordinates}
        self.v = {n: hy.make_vars(f'{n}_rate') for n in coordinates}
        self.a = {n: hy.make_vars(f'{n}_acceleration') for n in coordinates}

    def world(self, frame: str, x: Term, y: Term) -> tuple[Term, Term]:
        """Components in the ground's frame of a vector given in a link's frame."""
        if frame == GROUND:
            return x, y
        return _turned(hy.cos(self.q[frame]), hy.sin(self.q[frame]), x, y)

    def position(self, point: Point, label: str) -> tuple[Jet, Jet]:
        """World components [m] of a point; `label` names its parameters."""
        x: list[Jet] = []
        y: list[Jet] = []
        for frame, offset in point.items():
            names = (f'{label}.{frame}.x', f'{label}.{frame}.y')
            if frame in self.displacements:
                for component, name, u in zip((x, y), names, offset, strict=True):
                    slope = None if u == 0.0 else _direction(u, self.parameters, name)
                    s, v = self.q[frame], self.v[frame]
                    component.append(Jet(mul(slope, s), {frame: slope}, mul(slope, v), None))
                continue
            arm = tuple(map(self.parameters, names, offset))
            if frame == GROUND:
                x.append(Jet(arm[0], {}, None, None))
                y.append(Jet(arm[1], {}, None, None))
                continue
            wx, wy = self.world(frame, *arm)
            # arms come last in rates: all points share the products of rate and direction
            c, s, v = hy.cos(self.q[frame]), hy.sin(self.q[frame]), self.v[frame]
            vx, vy = _turned(v * c, v * s, *arm)
            ax, ay = mul(v, vx), mul(v, vy)
            x.append(Jet(wx, {frame: neg(wy)}, neg(vy), neg(ax)))
            y.append(Jet(wy, {frame: wx}, vx, neg(ay)))
        zero = Jet(None, {}, None, None)
        return sum(x, zero), sum(y, zero)

    def product(self, f: str, g: str, inner: Term, outer: Term) -> Term:
        """Scalar product of a in frame f and b in frame g.

        Given ``inner = a.b`` and ``outer = ax by - ay bx`` as if both frames were the same, it is
        ``inner cos(theta_g - theta_f) - outer sin(theta_g - theta_f)``.
        """
        if f == g:
            return inner
        if f == GROUND:
            c, s = hy.cos(self.q[g]), hy.sin(self.q[g])
        elif g == GROUND:
            c, s = hy.cos(self.q[f]), -hy.sin(self.q[f])
        else:
            cf, sf = hy.cos(self.q[f]), hy.sin(self.q[f])
            cg, sg = hy.cos(self.q[g]), hy.sin(self.q[g])
            c, s = cf * cg + sf * sg, sg * cf - cg * sf
        return add(mul(inner, c), neg(mul(outer, s)))


def _turned(c: Term, s: Term, x: Term, y: Term) -> tuple[Term, Term]:
    """``(c x - s y, s x + c y)``."""
    return add(mul(c, x), neg(mul(s, y))), add(mul(s, x), mul(c, y))


def _direction(u: float, parameters: Parameters, name: str) -> Term:
    return hy.expression(u) if abs(u) == 1.0 else parameters(name, u)


def rotate_quarter(v: Vector2) -> Vector2:
    """The vector turned by +90 degrees: the derivative of R(theta) v."""
    return -v[1], v[0]
