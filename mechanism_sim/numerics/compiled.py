"""Compiled expressions, each compiled once in a process.

What varies between scenes of one kind are parameters, so that their expressions are equal. heyoka
keeps machine code in memory and on disk, but to find it there it builds the code anew: 10 to 70 ms
for a scene, against 1 ms for a copy.

Expressions share parts, but heyoka compares them as trees: those too large for that are not kept.
Nor are they optimised: that takes four times as long as to compile them, for 1 to 2 us in a call.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import lru_cache

import heyoka as hy

from mechanism_sim.numerics.code_cache import bound_cache

# a root that its search gives up on is looked for again by the event loop
hy.set_logger_level_error()

_LARGEST = 200_000
"""Nodes of expressions that are compared in a few milliseconds."""


def _kept(expressions: Sequence[hy.expression]) -> bool:
    try:
        nodes = [len(x) for x in expressions]  # 0: too many to count
    except OverflowError:
        return False
    return 0 not in nodes and sum(nodes) <= _LARGEST


@lru_cache(maxsize=128)
def _function(
    expressions: tuple[hy.expression, ...],
    variables: tuple[hy.expression, ...],
    optimisation: int = 3,
) -> hy.cfunc_dbl:
    bound_cache()
    return hy.cfunc(list(expressions), vars=list(variables), opt_level=optimisation)


def function(
    expressions: Sequence[hy.expression], variables: Sequence[hy.expression]
) -> hy.cfunc_dbl:
    """Values of the expressions as a function of the variables and parameters."""
    if _kept(expressions):
        return _function(tuple(expressions), tuple(variables))
    return _function.__wrapped__(tuple(expressions), tuple(variables), 0)


@lru_cache(maxsize=16)
def _integrator(
    equations: tuple[tuple[hy.expression, hy.expression], ...],
    guards: tuple[hy.expression, ...],
    tolerance: float,
    compact: bool,
    flag: int,
) -> hy.taylor_adaptive_dbl:
    def told(index: int) -> hy.callback:
        def fell(integrator: hy.taylor_adaptive_dbl, _direction: int) -> bool:
            integrator.pars[flag] = index + 1.0
            return False

        return fell

    bound_cache()
    events = [
        hy.t_event(g, direction=hy.event_direction.negative, cooldown=0.0, callback=told(index))
        for index, g in enumerate(guards)
    ]
    return hy.taylor_adaptive(
        list(equations),
        [0.0] * len(equations),
        pars=[0.0] * (flag + 1),
        tol=tolerance,
        t_events=events,
        compact_mode=compact,
        opt_level=2 if compact else 3,  # the third takes compact code a third longer for nothing
    )


def integrator(
    equations: Sequence[tuple[hy.expression, hy.expression]],
    guards: Sequence[hy.expression],
    tolerance: float,
    compact: bool,
    flag: int,
) -> hy.taylor_adaptive_dbl:
    """A Taylor integrator whose steps end where a guard falls through zero.

    Parameters
    ----------
    equations : states and their derivatives
    guards : functions of state, time and parameters
    tolerance : heyoka's
    compact : compile slower but smaller code
    flag : the last parameter, which becomes 1 plus the index of the guard that ended a step; some
        equation must name it
    """
    kept = _kept([*(right for _, right in equations), *guards])
    make = _integrator if kept else _integrator.__wrapped__
    return copy(make(tuple(equations), tuple(guards), tolerance, compact, flag))
