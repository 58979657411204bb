"""Runs of problems by the event loop of this package, and by SciPy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.problem import Answer, Method, Outcome, Run, run_once
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.events import Impacts
from mechanism_sim.numerics import kernels
from mechanism_sim.scene import Machine


def event_loop(machine: Machine, end: float, answer: Callable[[Motion, Impacts], Answer]) -> Run:
    """The event loop of `simulate` from the start to `end` [s]; `answer` is not timed.

    Kernels are machine code, as runs of a second or more let them be.

    Raises
    ------
    TypeError
        If the machine needs none.
    """
    loop, state = machine.start(), machine.initial_state()
    if not isinstance(loop, EventLoop):
        raise TypeError(f'{machine.name} has no equations of motion')
    kernels.compile_kernels()

    def run() -> Callable[[], Outcome]:
        loop.restart(state)
        loop.advance(end, final=True)

        def outcome() -> Outcome:
            motion, impacts, _ = loop.drain()
            count = len(impacts) if machine.physics.clearances else None
            return Outcome(answer(motion, impacts), loop.steps, count)

        return outcome

    return run


def positions(end: float) -> Callable[[Motion, Impacts], Answer]:
    """Function that takes the coordinates (n,) at the end [s] out of a motion."""
    return lambda motion, _: np.asarray(motion.curve(np.array([end]))[0])


def run_solve_ivp(
    rate: Callable[[float, Answer], Any], start: Sequence[float] | Answer, end: float, method: str,
    rtol: float, count: int,
) -> Run:  # fmt: skip
    """`solve_ivp` over the whole run; the answer are the first `count` values at its end."""

    def work() -> Outcome:
        found = solve_ivp(rate, (0.0, end), start, method, rtol=rtol, atol=0.1 * rtol)
        return Outcome(found.y[:count, -1], len(found.t) - 1)

    return run_once(work)


def solve_ivp_methods(
    run: Callable[[str, float], Run], names: Sequence[str], how: str
) -> Iterator[Method]:
    """Methods of `solve_ivp`: `run` takes the name and rtol."""
    for name in names:
        yield Method(f'SciPy {name}', (1e-6, 1e-8, 1e-10, 1e-12), 'rtol', partial(run, name), how)
