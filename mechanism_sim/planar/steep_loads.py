"""Loads that may be steep somewhere, and what must be known of a motion to enclose them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import heyoka as hy
import numpy as np

from mechanism_sim.numerics.enclosure import Array, Enclosure
from mechanism_sim.numerics.symbolic import Term
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import ForceElement
from mechanism_sim.planar.switches import Switch


class SteepLoads:
    """Formulas, tables and characteristics of motors: what no series foretells.

    Parameters
    ----------
    elements : of which those count that `frames` knows as formulas
    torques : of motors [N m, N]

    Attributes
    ----------
    moving : derivative (0 or 1) and index of each coordinate that the loads depend on
    timed : whether they depend on the time, too
    outside : names of turns that they ask for
    symbols : (w,) indices of those of all switches that they depend on
    loads, variables : expressions; of what moves, of the time, of turns, and of switches
    parameters : values of ``par[]``
    inertia : of each load the least that it moves [kg m, kg m^2]
    """

    def __init__(
        self,
        mechanism: Mechanism,
        frames: Frames,
        elements: Iterable[ForceElement],
        torques: Sequence[Term] = (),
    ) -> None:
        light, slow = _least_inertia(mechanism)
        loads, scales = [*torques], [slow] * len(torques)
        for element in elements:
            if element.name not in frames.formulas:
                continue
            load = element.loads(frames)[0]
            loads += [*load.force, load.moment]
            scales += [light, light, slow]
        known = [(x, s) for x, s in zip(loads, scales, strict=True) if x is not None]
        own = {e.name.replace('.', ':', 1) for e in elements if e.name in frames.formulas}
        guards = [s.guard for name, s in frames.switches.items() if _is_of_formula(name, own)]
        expressions = [x for x, _ in known]
        named = {v for x in [*expressions, *guards] for v in hy.get_variables(x)}
        both = enumerate((frames.q, frames.v))
        moving = [
            (d, i, x) for d, of in both for i, x in enumerate(of.values()) if str(x) in named
        ]
        self.moving = [(d, i) for d, i, _ in moving]
        self.timed = str(frames.outside.get('time')) in named
        turns = {n: x for n, x in frames.outside.items() if n != 'time' and str(x) in named}
        self.outside = tuple(turns)
        every = [(s, x) for s in frames.switches.values() for x in s.symbols]
        used = [(k, s, x) for k, (s, x) in enumerate(every) if str(x) in named]
        self.symbols = np.array([k for k, _, _ in used], int)
        self._held = [
            (row, k + 1)
            for row, (k, s, x) in enumerate(used)
            if isinstance(s, Switch) and s.holds is not None and x == s.flag
        ]
        moves = [x for *_, x in moving] + ([frames.outside['time']] if self.timed else [])
        self.inertia = np.array([s for _, s in known])
        fixed = [*turns.values(), *(x for *_, x in used)]
        self.parameters = frames.parameters.values
        self.loads, self.variables = expressions, [*moves, *fixed]
        self.enclosure = Enclosure(expressions, guards, moves, fixed)

    def switched(self, symbols: Array) -> Array:
        """Values (w,) of the switches that the loads depend on, of those of all switches.

        Of a load that holds both branches count.
        """
        chosen: Array = symbols[self.symbols]
        for row, holds in self._held:
            if symbols[holds] > 0.0:
                chosen[row] = 0.5
        return chosen


def _is_of_formula(name: str, loads: set[str]) -> bool:
    """Whether a switch is a flag or a table of a formula, by its name."""
    load, *parts = name.split('.')
    while parts and load not in loads:
        load = f'{load}.{parts.pop(0)}'
    return bool({'flag', 'table'}.intersection(parts))


def _least_inertia(mechanism: Mechanism) -> tuple[float, float]:
    """The least that a force moves [kg m], and a torque [kg m^2], of all links by themselves."""
    bodies = mechanism.bodies
    mass = min((b.mass for b in bodies if b.mass > 0.0), default=1.0)
    turned = [b.inertia for b in bodies if b.inertia > 0.0]
    return mass * mechanism.size, min(turned, default=mass * mechanism.size**2)
