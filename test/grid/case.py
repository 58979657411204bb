"""Cases of the grid, and what is asserted of their runs."""

from __future__ import annotations

import math
import re
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.errors import InputError, RunError
from mechanism_sim.results.run import Solution, allowed_penetration
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Level, Machine, run_length
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene, find_scene, overridden, read_yaml
from test.grid.jams import confirm_bending, confirm_jam, confirm_straight
from test.grid.length import defects

Random = np.random.Generator

Scene = dict[str, Any]
"""Keys and values of a scene, as a file has them."""

MOST_STEPS = 400_000
"""Of a run; one that needs more makes no progress."""

MOST_TIME = 90
"""Of the processor [s], for a case; a run that takes longer between two steps hangs."""

RESIDUAL = 1e-9
"""Energy residual over what was exchanged that a run may leave."""

_CLOSED = 1e-10  # of the machine's size: how far closed gaps and loops may be open
_NOTHING = 1e-15  # [J] less is what rounding makes of a machine at rest
_INSTANTS = 200  # at which every number is looked at


class Draft(NamedTuple):
    """A scene and how long it runs: in revolutions, or in seconds."""

    scene: Scene
    revolutions: float | None = None
    duration: float | None = None


@dataclass(frozen=True)
class Family:
    """Cases of one kind.

    Attributes
    ----------
    make : of a generator and the number of a case
    refusals : what `check` is right to refuse, parts of sentences; such a draft is no case
    structures : cases whose numbers are equal modulo this have equations of one structure; they
        are run one after the other, so that what is compiled is shared
    judge : compares a run with a second route, and gives figures; of a generator as that of `make`
    """

    name: str
    count: int
    make: Callable[[Random, int], Draft]
    refusals: tuple[str, ...] = ()
    structures: int = 1
    judge: Callable[[Random, int, Machine, Solution], dict[str, float]] | None = None


@dataclass(frozen=True)
class GridCase:
    """One case: a family, its number in it, and the seed of the grid."""

    family: Family
    number: int
    seed: int

    @property
    def name(self) -> str:
        """Of the family, with the number."""
        return f'{self.family.name}_{self.number:03d}'

    def draft(self) -> Draft:
        """Its scene; the same whatever else is run."""
        draft = self.family.make(self.random, self.number)
        return draft._replace(scene=_to_plain(draft.scene))

    @property
    def random(self) -> Random:
        """Its generator, at its beginning."""
        return np.random.default_rng((self.seed, *self.family.name.encode(), self.number))

    def judged(self, machine: Machine, solution: Solution) -> dict[str, float]:
        """Figures by which its run differs from a second route, if there is one."""
        judge = self.family.judge
        return judge(self.random, self.number, machine, solution) if judge else {}


@dataclass(frozen=True)
class Outcome:
    """A case that was run; `ok` is ``None`` for what was refused rightly and is no case.

    `kind` is the class of a failure, `reason` the sentence.
    """

    name: str
    family: str
    ok: bool | None
    kind: str = ''
    reason: str = ''
    figures: Mapping[str, float] = field(default_factory=dict)
    cpu_time: float = 0.0  #: [s]


class Failure(Exception):  # noqa: N818 - of a case, not of the program
    """A case that is not as it must be."""

    def __init__(self, kind: str, reason: str) -> None:
        super().__init__(reason)
        self.kind, self.reason = kind, reason


def run_case(case: GridCase) -> Outcome:
    """Run a case and judge it; nothing that goes wrong in it leaves this function."""
    began, name = time.process_time(), case.name
    figures: dict[str, float] = {}
    ok: bool | None = True
    kind = reason = ''
    try:
        draft = case.draft()
        try:
            machine = build(name, check_scene(name, draft.scene))
            run_length(machine, draft.revolutions, draft.duration)
        except InputError as error:
            if not any(re.search(text, str(error)) for text in case.family.refusals):
                raise Failure('refused', str(error)) from error
            ok, kind, reason = None, 'refused', str(error)
        else:
            figures, reason = _judge(case, machine, draft)
    except Failure as failure:
        ok, kind, reason = False, failure.kind, failure.reason
    except Exception as error:
        ok, kind = False, 'exception'
        reason = f'{type(error).__name__}: {error}{_where(error)}'
    spent = time.process_time() - began
    return Outcome(name, case.family.name, ok, kind, reason, figures, spent)


def _judge(case: GridCase, machine: Machine, draft: Draft) -> tuple[dict[str, float], str]:
    """Figures of a run that is as it must be, and why it ended before its end if it jammed."""

    def count_steps(at: float, _impacts: int) -> None:
        steps['now'] = steps['now'] + 1
        if steps['now'] * 8192 > MOST_STEPS:
            raise Failure('no progress', f'more than {MOST_STEPS} steps up to t = {at:.9g} s')

    steps = {'now': 0}
    try:
        with _limit_time():
            solution = simulate(machine, draft.revolutions, draft.duration, count_steps)
    except InputError as error:
        raise Failure('refused late', f'check accepts it, the run does not: {error}') from error
    except RunError as error:
        if confirm_jam(machine, error):
            return {}, f'jam, confirmed: {error}'
        if confirm_bending(machine, error):
            return {}, f'mass matrix singular, confirmed: {error}'
        if confirm_straight(machine, error):
            return {}, f'rope straight, confirmed: {error}'
        raise Failure('ended early', str(error)) from error
    end = machine.drive.time_of(draft.revolutions) if draft.revolutions else draft.duration
    if end is not None and not math.isclose(solution.duration, end, rel_tol=1e-12):
        raise Failure('ended early', f'it ended at {solution.duration:.9g} of {end:.9g} s')
    figures = _figures(machine, solution) | case.judged(machine, solution)
    with _limit_time():
        for reason in defects(machine, solution.duration):
            raise Failure('length', reason)
    return figures, ''


@contextmanager
def _limit_time() -> Iterator[None]:
    """Ends what is done within when it has used up `MOST_TIME` of the processor."""

    def hang(*_: object) -> None:
        raise Failure('no progress', f'more than {MOST_TIME} s of the processor')

    before = signal.signal(signal.SIGPROF, hang)
    signal.setitimer(signal.ITIMER_PROF, MOST_TIME)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def _figures(machine: Machine, solution: Solution) -> dict[str, float]:
    end = solution.duration
    values = solution.sample(np.linspace(0.0, end, _INSTANTS))
    for name, x in values.items():
        if not np.isfinite(x).all():
            at = end * float(np.argmin(np.isfinite(x))) / (_INSTANTS - 1)
            raise Failure('not finite', f'{name} at t = {at:.9g} s')
    found = {'penetration': solution.max_penetration, 'closure': solution.max_closure_error}
    if solution.max_penetration > allowed_penetration(machine):
        raise Failure('penetration', f'{solution.max_penetration:.3g} m')
    bound = _CLOSED * max(machine.mechanism.size, machine.mechanism.reach)
    if machine.level is not Level.COMPLIANT and solution.max_closure_error > bound:
        raise Failure('closure', f'{solution.max_closure_error:.3g} m, allowed {bound:.3g} m')
    if solution.energy is not None:
        exchanged = exchanged_energy(solution, values['energy.kinetic'])
        # of a machine that sticks there is nothing but the rounding of what it stores
        exchanged = max(exchanged, 1e-6 * float(np.abs(values['energy.potential']).max()))
        # or, where it stores none yet, that of its masses as the solution says it
        beyond = max(0.0, abs(solution.energy.residual) - solution.energy.rounding)
        found['residual'] = beyond / max(exchanged, _NOTHING)
        if not found['residual'] <= RESIDUAL:
            raise Failure(
                'energy',
                f'residual {solution.energy.residual:.3g} J of {exchanged:.3g} J exchanged',
            )
    return found


def exchanged_energy(solution: Solution, kinetic: NDArray[np.float64]) -> float:
    """Work of drives and losses, each by its amount, and the largest kinetic energy [J]."""
    work, impacts = solution.balance.work, solution.impacts
    return float(
        np.abs(work.drive).sum()
        + np.abs(work.friction).sum()
        + sum(abs(i.drive_work) + abs(i.energy_loss) for i in impacts)
        + kinetic.max()
    )


def _where(error: BaseException) -> str:
    """The line of this package in which an exception arose."""
    trace, place = error.__traceback__, ''
    while trace:
        code = trace.tb_frame.f_code
        if 'mechanism_sim' in code.co_filename:
            place = f' ({Path(code.co_filename).name}:{trace.tb_lineno} {code.co_name})'
        trace = trace.tb_next
    return place


def _to_plain(value: Any) -> Any:
    """Value without numbers of NumPy, as a file has it."""
    if isinstance(value, Mapping):
        return {k: _to_plain(x) for k, x in value.items()}
    if isinstance(value, (list, tuple)):
        return [_to_plain(x) for x in value]
    return value.item() if isinstance(value, np.generic) else value


@cache
def _content(name: str) -> Scene:
    return read_yaml(find_scene(name), 'scene')


def variant(name: str, overrides: Mapping[str, Any]) -> Scene:
    """A scene of the package with other values, by dotted path."""
    return overridden(name, _content(name), overrides)


def rotate(angle: float, v: Any) -> NDArray[np.float64]:
    """A vector turned by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1]])
