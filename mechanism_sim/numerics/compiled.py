"""Compiled expressions, each compiled once in a process.

What varies between scenes of one kind are parameters, so that their expressions are equal. heyoka
keeps machine code in memory and on disk, but to find it there it builds the code anew: 10 to 70 ms
for a scene, against 1 ms for a copy.

Expressions share parts, but heyoka compares them as trees. Those too large for that are told apart
by a digest of what they are pickled to, which is no larger than what is computed.
"""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from functools import cached_property, lru_cache
from hashlib import sha256
from itertools import accumulate

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.memory import Reused, give_back
from mechanism_sim.numerics import symbolic
from mechanism_sim.numerics.code_cache import compiled
from mechanism_sim.numerics.machine_code import foreign

# a root that its search gives up on is looked for again by the event loop
hy.set_logger_level_error()

_LARGEST = 200_000  # number of nodes of expressions that are compared in a few milliseconds

_LONG = 2_000_000
"""Number of nodes of equations whose optimisation takes 10 s; at 500,000 it takes 4 s and pays."""

OPTIMISATION = 3
"""LLVM's level at most. Without any, code of the last bits of others is made in a quarter of the
time, which pays for runs of a second."""


_spent = [0.0, 0.0]
_crowded: list[Callable[[], bool]] = []


def spent() -> tuple[float, float]:
    """Wall-clock and CPU time [s] of this process for making or reading code so far."""
    wall, cpu = _spent
    return wall, cpu


@contextmanager
def _counted() -> Iterator[None]:
    wall, cpu = time.perf_counter(), time.process_time()
    yield
    _spent[0] += time.perf_counter() - wall
    _spent[1] += time.process_time() - cpu


def forget() -> None:
    """Release all compiled functions that are not referenced elsewhere."""
    _function.cache_clear()
    _integrator.cache_clear()
    foreign.cache_clear()
    symbolic.forget()
    give_back()


def forget_for_others(crowded: Callable[[], bool]) -> None:
    """Release code of other machines before a new integrator is compiled, if `crowded`.

    A machine of which only values changed needs no new one, and finds all that it needs.
    """
    _crowded[:] = [crowded]


def _digest(expressions: Sequence[hy.expression]) -> bytes:
    # in one expression shared parts are pickled once; a sum alone would forget the order
    terms = [hy.make_vars(f'slot {k}') * x for k, x in enumerate(expressions)]
    return sha256(pickle.dumps(hy.sum(terms))).digest()


class _KeyedTerms:
    """Expressions in their order.

    Attributes
    ----------
    large : True if LLVM's optimisation takes long: four times the compilation, for a gain of 1 to
        2 us in a call
    long : True if optimisation of equations takes so long that they are compiled compactly
    """

    def __init__(self, expressions: Sequence[hy.expression]) -> None:
        self.expressions = tuple(expressions)
        nodes = 0
        try:
            for x in expressions:
                nodes += len(x) or _LONG + 1  # 0: too many to count
                if nodes > _LONG:
                    break
        except OverflowError:
            nodes = _LONG + 1
        self.large, self.long = nodes > _LARGEST, nodes > _LONG
        self._key: object = self.expressions
        if self.large:
            # of these themselves: equal ones that are kept may share other parts
            self._key = symbolic.kept('digest', lambda *_: _digest(self.expressions), *expressions)
        self._hash = hash(self._key)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _KeyedTerms) and self._key == other._key


@lru_cache(maxsize=128)
def _function(
    terms: _KeyedTerms, variables: tuple[hy.expression, ...], level: int
) -> hy.cfunc_dbl:
    outputs, inputs = list(terms.expressions), list(variables)
    with _counted():
        return compiled(lambda: hy.cfunc(outputs, vars=inputs, opt_level=level))


def alike(some: Sequence[hy.expression], others: Sequence[hy.expression]) -> bool:
    """True if expressions, and so their code, differ in values of parameters only."""
    return _KeyedTerms(some) == _KeyedTerms(others)


def function(
    expressions: Sequence[hy.expression], variables: Sequence[hy.expression]
) -> hy.cfunc_dbl:
    """Values of the expressions as a function of the variables and parameters."""
    terms = _KeyedTerms(expressions)
    return _function(terms, tuple(variables), 0 if terms.large else OPTIMISATION)


@lru_cache(maxsize=16)
def _integrator(
    states: tuple[hy.expression, ...],
    terms: _KeyedTerms,
    tolerance: float,
    compact: bool,
    level: int,
    flag: int,
) -> tuple[hy.taylor_adaptive_dbl, Reused[hy.taylor_adaptive_dbl]]:
    """An integrator, and its copies in runs."""

    def marking(index: int) -> hy.callback:
        def fell(integrator: hy.taylor_adaptive_dbl, _direction: int) -> bool:
            integrator.pars[flag] = index + 1.0
            return False

        return fell

    count = len(states)
    events = [
        hy.t_event(g, direction=hy.event_direction.negative, cooldown=0.0, callback=marking(index))
        for index, g in enumerate(terms.expressions[count:])
    ]

    if _integrator.cache_info().currsize and any(crowded() for crowded in _crowded):
        forget()

    def make() -> hy.taylor_adaptive_dbl:
        return hy.taylor_adaptive(
            list(zip(states, terms.expressions[:count], strict=True)),
            [0.0] * count,
            pars=[0.0] * (flag + 1),
            tol=tolerance,
            t_events=events,
            compact_mode=compact,
            opt_level=level,
        )

    with _counted():
        return compiled(make), Reused(lambda _: _IDLE)


class TaylorEquations:
    """Equations and guards of an integrator, compared with others once.

    Parameters
    ----------
    equations : states and their derivatives
    guards : functions of state, time and parameters
    """

    def __init__(
        self,
        equations: Sequence[tuple[hy.expression, hy.expression]],
        guards: Sequence[hy.expression],
    ) -> None:
        self.states, rates = zip(*equations, strict=True)
        self.terms = _KeyedTerms([*rates, *guards])


def integrator(
    equations: TaylorEquations, tolerance: float, compact: bool, flag: int, owner: object
) -> hy.taylor_adaptive_dbl:
    """A Taylor integrator whose steps end where a guard falls through zero.

    Parameters
    ----------
    tolerance : tolerance of heyoka
    compact : compile slower but smaller code
    flag : the last parameter, which becomes 1 plus the index of the guard that ended a step; some
        equation must name it
    owner : object after whose end the integrator is reused: to copy one takes a millisecond
    """
    # of compact code the third level takes half as long again for nothing
    level = min(OPTIMISATION, 1 if compact else 3)
    first, copies = _integrator(equations.states, equations.terms, tolerance, compact, level, flag)
    found = copies.take(owner) or copies.lend(copy(first), owner)
    found.time, found.state[:], found.pars[:] = 0.0, 0.0, 0.0
    if found.with_events:
        found.reset_cooldowns()
    return found


_IDLE = 4  # number of integrators of one kind kept for later runs


COLUMNS = 1024
"""Number of columns evaluated at once, so that they stay in a processor's cache."""


class Evaluation:
    """A function whose parameters are the same for all columns, compiled when it is first called.

    heyoka wants the parameters of every column; they are repeated once and kept.

    Parameters
    ----------
    expressions : expressions of all groups, in their order
    variables : v symbols
    parameters : values of ``par[]``; unused ones may follow
    sizes : sizes of the groups of results
    """

    def __init__(
        self,
        expressions: Sequence[hy.expression],
        variables: Sequence[hy.expression],
        parameters: Sequence[float],
        sizes: Sequence[int],
    ) -> None:
        self._terms = expressions, variables
        self._parameters = np.array(parameters)[:, None]
        self._rows = sum(sizes)
        ends = list(accumulate(sizes))
        self._groups = [slice(e - size, e) for e, size in zip(ends, sizes, strict=True)]

    @cached_property
    def _compiled(self) -> tuple[hy.cfunc_dbl, Array]:
        made = function(*self._terms)
        return made, np.repeat(self._parameters[: made.nparams], COLUMNS, axis=1)

    def __call__(self, inputs: Array) -> list[Array]:
        """The groups of results, (size, N) each, at `inputs` (v, N)."""
        made, repeated = self._compiled
        count = inputs.shape[1]
        out = np.empty((self._rows, count))
        for first in range(0, count, COLUMNS):
            block = np.ascontiguousarray(inputs[:, first : first + COLUMNS])
            width, pars = block.shape[1], repeated
            # What is left over from whole vectors runs through other code, which rounds otherwise:
            # of an instant nothing is to depend on how many there are.
            if over := -width % made.batch_size:
                block = np.concatenate([block, np.repeat(block[:, -1:], over, axis=1)], axis=1)
            if block.shape[1] < COLUMNS:
                pars = np.repeat(repeated[:, :1], block.shape[1], axis=1)
            out[:, first : first + COLUMNS] = made(block, pars=pars)[:, :width]
        return [out[group] for group in self._groups]
