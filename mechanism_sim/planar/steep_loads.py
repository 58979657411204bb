"""Loads that may be steep somewhere, and the inputs for their enclosure along a motion."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property, lru_cache

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.enclosure import Enclosure, MotionSeries, Reach
from mechanism_sim.numerics.polynomials import chebyshev_coefficients
from mechanism_sim.numerics.symbolic import Term
from mechanism_sim.planar.frames import STATE, Frames
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import FirstOrderState, ForceElement
from mechanism_sim.planar.switches import Switch
from mechanism_sim.tolerances import TOLERANCES

_MECHANISM = TOLERANCES.mechanism

_CLOSE = 9  # places that are compared where a load falls right behind the start of a part


class SteepLoads:
    """Formulas, tables and characteristics of motors that are too steep for a Taylor series.

    Parameters
    ----------
    elements : force elements; those by formulas of `frames` count
    torques : torques of motors [N m, N]

    Attributes
    ----------
    moving : derivative (0 or 1) and index of each coordinate that the loads depend on, then of
        states of first order, which are counted after these
    timed : True if they depend on time, too
    outside : names of the whole turns that they depend on
    symbols : (w,) indices, among all switch symbols, of those that they depend on
    held : (q, 2) index of a flag in `symbols`, index of the symbol of its holding
    loads, variables : expressions; the latter of motion, time, turns and switches
    parameters : values of ``par[]``
    inertia : least inertia moved by each load [kg m, kg m^2]
    """

    def __init__(
        self,
        mechanism: Mechanism,
        frames: Frames,
        elements: Iterable[ForceElement],
        torques: Sequence[Term] = (),
    ) -> None:
        # the least that a force moves [kg m], and a torque [kg m^2], of all links by themselves
        bodies = mechanism.bodies
        mass = min((b.mass for b in bodies if b.mass > 0.0), default=1.0)
        turned = [b.inertia for b in bodies if b.inertia > 0.0]
        light = mass * mechanism.size
        slow = min(turned, default=mass * mechanism.size**2)
        loads, scales = [*torques], [slow] * len(torques)
        for element in elements:
            if element.name not in frames.formulas:
                continue
            for load in element.loads(frames)[:1]:
                loads += [*load.force, load.moment]
                scales += [light, light, slow]
            if isinstance(element, FirstOrderState):
                loads, scales = [*loads, element.rate(frames)], [*scales, element.scale]
        known = [(x, s) for x, s in zip(loads, scales, strict=True) if x is not None]
        own = {name.replace('.', ':', 1) for name in frames.formulas}
        guards = [s.guard for name, s in frames.switches.items() if _is_of_formula(name, own)]
        expressions = [x for x, _ in known]
        named = {v for x in [*expressions, *guards] for v in hy.get_variables(x)}
        both = enumerate((frames.q, frames.v))
        moving = [
            (d, i, x) for d, of in both for i, x in enumerate(of.values()) if str(x) in named
        ]
        states = [(n, x) for n, x in frames.outside.items() if n.startswith(STATE)]
        for n, x in (pair for pair in states if str(pair[1]) in named):
            moving.append((0, len(frames.q) + int(n.removeprefix(STATE)), x))
        self.moving = [(d, i) for d, i, _ in moving]
        self.timed = str(frames.outside.get('time')) in named
        others = {'time', *(n for n, _ in states)}
        turns = {n: x for n, x in frames.outside.items() if n not in others and str(x) in named}
        self.outside = tuple(turns)
        every = [(s, x) for s in frames.switches.values() for x in s.symbols]
        used = [(k, s, x) for k, (s, x) in enumerate(every) if str(x) in named]
        self.symbols = np.array([k for k, _, _ in used], int)
        held = [
            (row, k + 1)
            for row, (k, s, x) in enumerate(used)
            if isinstance(s, Switch) and s.holds is not None and x == s.flag
        ]
        self.held = np.array(held, int).reshape(-1, 2)
        moves = [x for *_, x in moving] + ([frames.outside['time']] if self.timed else [])
        self.inertia = np.array([s for _, s in known])
        fixed = [*turns.values(), *(x for *_, x in used)]
        self.parameters = frames.parameters.values
        self.loads, self.variables = expressions, [*moves, *fixed]
        self.enclosure = Enclosure(expressions, guards, moves, fixed)

    @cached_property
    def compiled_loads(self) -> hy.cfunc_dbl:
        """The loads as a function of the variables."""
        return compiled.function(self.loads, self.variables)

    def switched(self, symbols: Array) -> Array:
        """Values (w,) of the switches that the loads depend on, of those of all switches.

        The flag of a holding load is set to 0.5, so that both branches count.
        """
        chosen: Array = symbols[self.symbols]
        for row, holds in self.held:
            if symbols[holds] > 0.0:
                chosen[row] = 0.5
        return chosen


class ResolvedLoads:
    """Test of the share of a motion over which its nodes resolve all loads.

    Figures are taken at nodes. Where a load moves nothing, for a drive holds what it acts on, it
    is they alone that must see it.

    Parameters
    ----------
    steep : the loads
    nodes : (m,) nodes of the interpolants, from 0 to 1
    """

    def __init__(self, steep: SteepLoads, nodes: Array) -> None:
        self._steep, self._nodes = steep, nodes

    def longest(
        self, motion: MotionSeries, looked: Sequence[Array], reach: Reach, floor: Array
    ) -> float:
        """Largest of positions from 0 to 1 up to which the interpolant is accurate at all.

        Parameters
        ----------
        looked, reach : positions at which enclosures evaluated the loads, and their range
        floor : negligible magnitude of each load
        """
        places = np.sort(np.concatenate([[0.0], *looked]))
        if reach.fault is not None:
            places = places[places <= max(reach.fault, places[1])]
        values = self._values(motion, places)
        finite = np.asarray(np.isfinite(values).all(axis=0))
        if not finite[0]:  # whoever asks for forces there is told so
            return 1.0
        count = len(places) if finite.all() else int(finite.argmin())
        low, high = 1, count + 1
        tried = count  # mostly it is all of it
        while high - low > 1:
            if self._is_resolved(motion, places[:tried], values[:, :tried], floor):
                low = tried
            else:
                high = tried
            tried = (low + high) // 2
        if low > 1:
            return float(places[low - 1])
        # a load that falls steeply right behind the start: there nobody has looked yet
        end = 0.5 * float(places[1])
        while end > _MECHANISM.shortest_part:
            places = np.linspace(0.0, end, _CLOSE)
            if self._is_resolved(motion, places, self._values(motion, places), floor):
                return end
            end *= 0.5
        return _MECHANISM.shortest_part

    def _is_resolved(
        self, motion: MotionSeries, places: Array, values: Array, floor: Array
    ) -> bool:
        end = places[-1]
        known = self._values(motion, end * self._nodes)
        between = interpolant(len(self._nodes), (places / end).tobytes())
        size = np.maximum(np.abs(values).max(axis=1), np.abs(known).max(axis=1))
        off = np.abs(known @ between - values).max(axis=1)
        return bool((off <= _MECHANISM.load * size + floor).all())

    def _values(self, motion: MotionSeries, places: Array) -> Array:
        """The loads (l, N) at positions."""
        series, _, fixed, parameters = motion
        count, loads = len(places), self._steep.compiled_loads
        given = np.concatenate([
            series @ places ** np.arange(series.shape[1])[:, None],
            np.repeat(fixed[:, None], count, axis=1),
        ])  # fmt: skip
        known = np.repeat(parameters[: loads.nparams, None], count, axis=1)
        return np.asarray(loads(given, pars=known))


@lru_cache(maxsize=64)  # of whole pieces the places are always the same
def interpolant(count: int, places: bytes) -> Array:
    """Matrix (count, N) from values at Chebyshev's nodes to their interpolant at N positions."""
    at = np.polynomial.chebyshev.chebvander(2.0 * np.frombuffer(places) - 1.0, count - 1)
    return np.asarray(chebyshev_coefficients(np.eye(count)) @ at.T)


def _is_of_formula(name: str, loads: set[str]) -> bool:
    """True if a switch is a flag or a table of a formula, by its name."""
    load, *parts = name.split('.')
    while parts and load not in loads:
        load = f'{load}.{parts.pop(0)}'
    return bool({'flag', 'table'}.intersection(parts))
