"""The motion of a machine without clearance as JavaScript: its closures, and where its links are.

All are heyoka's expressions of the coordinates, as the engine compiles them; dimensions stay
parameters, so that a page can change them. Needs sympy.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import heyoka as hy

from mechanism_sim.numerics.symbolic import Term, add, dense, mul
from mechanism_sim.packages import needed
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.frames import Frames, Jet, Parameters
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND

PURPOSE = 'export --format html'


class PageEquations:
    """Closures, and the places of all moving links, of a mechanism without clearance."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._frames = Frames(mechanism.coordinates, Parameters())
        self._relations = closures(mechanism, mechanism.cut)
        jets = [(x.name, jet) for x in self._relations for jet in x.values(self._frames)]
        self.rows = [name for name, _ in jets]  #: the joint of every closure
        self._closures = [jet for _, jet in jets]
        self._places = [x for body in mechanism.bodies for x in self._pose(body.name)]

    @property
    def switched(self) -> set[str]:
        """The joints whose closures change from one part of a turn to another."""
        return {name.partition(':')[0] for name in self._frames.switches}

    @property
    def parameters(self) -> dict[str, float]:
        """The numbers behind the expressions, by name; zeros are left out."""
        known = self._frames.parameters
        return {name: known.values[i] for name, i in known.names.items()}

    def is_like(self, other: PageEquations) -> bool:
        """True if the same expressions hold of another machine, with its own parameters."""
        own, its = (
            [dense(x.value) for x in (*each._closures, *each._places)] for each in (self, other)
        )
        return own == its and list(self.parameters) == list(other.parameters)

    def _pose(self, link: str) -> Iterator[Jet]:
        """Origin [m] and angle [rad] of a link's frame."""
        frames, label = self._frames, f'pose:{link}'
        yield from frames.position(self._mechanism.point(link), label)
        frame, offset = self._mechanism.frame(link)
        turned = Jet(frames.parameters(f'{label}.turn', offset), {}, None, None)
        yield turned if frame == GROUND else frames.angle(frame) + turned

    @cached_property
    def _functions(self) -> Mapping[str, tuple[str, list[Term]]]:
        """Arguments and results of each function of the page."""
        frames, c = self._frames, self._frames.coordinates
        rates = [jet.rate for jet in self._places]
        seconds = [
            add(jet.curvature, *(mul(x, frames.a[n]) for n, x in jet.gradient.items()))
            for jet in self._places
        ]
        slopes = [x for jet in self._closures for x in jet.row(c)]
        return {
            'closure': ('q', [*(jet.value for jet in self._closures), *slopes]),
            'curvature': ('qv', [jet.curvature for jet in self._closures]),
            'facing': ('q', [x for each in self._relations for x in each.facing(frames)]),
            'poses': ('qva', [*(jet.value for jet in self._places), *rates, *seconds]),
        }

    def to_javascript(self, order: Sequence[str]) -> str:
        """A module of pure functions of arrays; each gives one array.

        ``closure(q, par)`` the r values, then the rows of their Jacobian; ``curvature(q, v, par)``
        the r second time derivatives without accelerations; ``facing(q, par)`` what must be
        positive; ``poses(q, v, a, par)`` x, y and angle of each link, then their rates, then their
        accelerations.

        Parameters
        ----------
        order : of the parameters, which are all that there are, and perhaps more
        """
        places = {name: order.index(name) for name in self.parameters}
        symbols = {f'par[{i}]': f'par[{places[name]}]'
                   for name, i in self._frames.parameters.names.items()}  # fmt: skip
        return '\n'.join(
            self._function(name, arguments, results, symbols)
            for name, (arguments, results) in self._functions.items()
        )

    def _function(
        self, name: str, arguments: str, results: Sequence[Term], symbols: Mapping[str, str]
    ) -> str:
        sympy = needed('sympy', PURPOSE)
        terms = [hy.to_sympy(dense(x)) for x in results]
        exchange = {x: sympy.Symbol(symbols[x.name], real=True)
                    for term in terms for x in term.free_symbols if x.name in symbols}  # fmt: skip
        shared, rest = sympy.cse([x.xreplace(exchange) for x in terms], order='none')
        lines = [f'  const {x} = {_text(value)};' for x, value in shared]
        count = len(self._frames.coordinates)
        taken = (f'  const [{", ".join(f"{a}{i}" for i in range(count))}] = {a};'
                 for a in arguments)  # fmt: skip
        head = f'export function {name}({", ".join(arguments)}, par) {{'
        return '\n'.join([head, *taken, *lines, f'  return [{", ".join(map(_text, rest))}];', '}'])


def _text(expression: object) -> str:
    """An expression of sympy in JavaScript, numbers to their last digit."""
    printing = needed('sympy.printing.jscode', PURPOSE)

    class Printer(printing.JavascriptCodePrinter):  # type: ignore[name-defined,misc]
        def _print_Float(self, number: object) -> str:
            return repr(float(number))  # type: ignore[arg-type]

    return str(Printer().doprint(expression))
