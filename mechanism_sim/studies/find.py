"""Values of numbers of a scene for which figures of its cycle are as wanted, or least."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from mechanism_sim import tables
from mechanism_sim.arguments import check_options, public
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.scene import Source, load_scene
from mechanism_sim.studies.goal import CycleTrial, Goal, read_goals
from mechanism_sim.studies.journal import Journal
from mechanism_sim.studies.optimum import Budget, Optimum, optimum
from mechanism_sim.studies.parameters import Limits, Parameter, parameters, read_limits
from mechanism_sim.studies.runs import FinishedRows, Show, Workers
from mechanism_sim.studies.trials import DIFFERENCES, Trials

_ROUNDING = 1e-12
_BESIDE = 1e-3  # share of an interval of samples: a count there equals that at one of them
_JUMP = 1e-6  # share of the figure's range: a larger residual at a solution is a step

_OF_CYCLE = {'duration': '', 'periods': 'int | None', 'start': ''}
"""Options that are handed on to `cycle`."""


@dataclass(frozen=True)
class _SearchOptions:
    """Options of a search.

    Differences cost a run for each key, exact slopes 11 to 28: half the cycles, thrice the time.
    """

    maximise: str | Sequence[str] | None = None
    samples: int = 17
    search: Literal['local', 'global'] = 'local'
    evaluations: int = 400
    file: str | Path | None = None
    restart: bool = False
    gradients: Literal['exact', 'differences'] = 'differences'


@dataclass(frozen=True)
class Found:
    """A value of the parameter, and the figure there.

    Attributes
    ----------
    jump : True if the figure jumps across the wanted value
    last : of all values from this one on that give the figure, as far as samples tell
    """

    value: float
    figure: float
    jump: bool = False
    last: float | None = None


@dataclass(frozen=True)
class Finding:
    """The value found, and the curve on the way, in SI units.

    Attributes
    ----------
    parameter, goal : varied parameter, and its goal
    unit : unit of the figure
    wanted : target value of the figure; None for the least, or the greatest
    curve : (value, figure) in the order of values, not a number where there is none
    found : all crossings of the wanted value by the curve, or the least
    failed : values at which the machine cannot be or run, and why
    evaluations : cycles that were computed
    """

    parameter: Parameter
    goal: Goal
    unit: str
    wanted: float | None
    curve: tuple[tuple[float, float], ...]
    found: tuple[Found, ...]
    failed: tuple[tuple[float, str], ...]
    evaluations: int

    @property
    def values(self) -> dict[str, float]:
        """The first value found, by path; empty if there is none."""
        return {self.parameter.path: self.found[0].value} if self.found else {}

    @property
    def successful(self) -> bool:
        """True if a value gives the wanted figure."""
        return bool(self.found)

    @property
    def measures(self) -> dict[str, float]:
        """The figure there, by the name of the measure."""
        return {self.goal.name: self.found[0].figure} if self.found else {}


@public
def find(
    scene: Source,
    vary: Mapping[str, Limits | str] | Sequence[str] | str,
    so_that: str | Sequence[str] | None = None,
    *,
    minimise: str | Sequence[str] | None = None,
    subject_to: str | Sequence[str] | None = None,
    workers: int | Workers | None = 1,
    show: Show | None = None,
    **how: Any,
) -> Finding | Optimum:
    """Vary numbers of a scene between limits until measures of its cycle are as wanted.

    With one number and one measure the measure is computed at `samples` values; every change of
    sign between neighbours is followed by Brent's method, and so is the least. Between two samples
    more may lie unseen. With several, or constraints, see `mechanism_sim.studies.optimum`.

    >>> import mechanism_sim as ms
    >>> rod = {'links.rod.length': ('0.2 m', '0.6 m')}
    >>> found = ms.find('slider_crank', rod, so_that='largest(position.piston) = 0.5 m', samples=5)
    >>> round(found.values['links.rod.length'], 9)
    0.45

    Parameters
    ----------
    vary : by dotted path the lowest and highest value, in SI units or with units, also as text
        ``'40 mm:60 mm'``; between whole numbers all of them; or a list of other than two values,
        text ``'40 mm,50 mm'`` or ``{'values': [...]}``; or texts ``PATH=LOW:HIGH``
    so_that : ``MEASURE = VALUE``, or several of them; or
    minimise : a measure; of several a front of Pareto
    subject_to : ``MEASURE < VALUE``, also with ``<=``, ``>``, ``>=`` or ``=``, or several of them
    workers : processes that compute cycles; a single one is this process, None one for each core
    show : callback with the numbers of cycles computed, and of failed ones
    how : ``maximise`` (a measure, or several); ``samples``, values or places that are tried first
        (17); ``search='global'``, differential evolution between all limits; ``evaluations``,
        cycles after which it ends, and so does a front (400); ``file``, a table of all that was
        tried, with a journal from which an interrupted search goes on; ``restart``, without it;
        ``gradients='differences'`` of cycles, which may take less time, also where there are exact
        ones; ``duration`` and ``periods`` of `cycle`

    Returns
    -------
    Both kinds have ``values`` by path, ``measures`` and the number of ``evaluations``.
    """
    how = check_options(find, how, _SearchOptions, _OF_CYCLE)
    asked = _SearchOptions(**{key: how.pop(key) for key in [*how] if key not in _OF_CYCLE})
    goals = read_goals(so_that, minimise, asked.maximise, subject_to)
    machine, samples = load_scene(scene), asked.samples
    if samples < 2:
        raise InputError('a search needs at least 2 values to begin with')
    limits = read_limits('vary', vary, lists=True)
    if not limits:
        raise InputError('a search varies at least one key: there is none')
    varied = parameters(machine, [*limits], '', limits=limits)
    if how.get('duration') is None:
        _check_speeds(varied, machine.plan.main)
    trial, file = CycleTrial.of(machine, goals, how), asked.file
    with ExitStack() as stack:
        rows = FinishedRows()
        if file:
            file = tables.check_file('-o', file)
            journal = Journal(file, trial.fingerprint, asked.restart, 'search')
            rows = stack.enter_context(journal)
        pool = stack.enter_context(Workers.of(workers))
        trials = Trials(trial, varied, goals, pool, rows, show)
        trials.never = asked.gradients == DIFFERENCES
        local = asked.search == 'local'
        found: Finding | Optimum
        if len(varied) == len(goals) == 1 and not varied[0].choices and local:
            found = _along(trials, samples)
        else:
            found = optimum(trials, Budget(samples, not local, asked.evaluations))
        if file:
            tables.write(file, trials.columns(), {'title': machine.scene.title})
    return found


def _check_speeds(varied: Sequence[Parameter], main: str) -> None:
    """Refuse speeds of the main drive about zero: its turns, over which cycles go, never end."""
    for p in varied:
        of_main = p.path in ('drive.speed', f'drives.{main}.speed')
        if of_main and not p.choices and p.low <= 0.0 <= p.high:
            raise InputError(
                f'{p.path}: its limits include standstill, in which a turn never ends; give '
                'limits on one side of zero, or a duration'
            )


def _along(trials: Trials, samples: int) -> Finding:
    """All crossings of a wanted value along one parameter, or the extreme."""
    (parameter,), (goal,) = trials.parameters, trials.goals
    places: Array = np.linspace(0.0, 1.0, samples)
    figures = trials.start(places[:, None])[:, 0]
    wanted, span = goal.value(trials.units[0]), float(np.nanmax(figures) - np.nanmin(figures))
    found = []
    if wanted is None:
        found.append(_extreme(trials, places, figures))
    else:
        known = np.isfinite(figures)
        off = np.array(
            [trials.off(x, wanted) if ok else np.nan for x, ok in zip(places, known, strict=True)]
        )
        for k in np.flatnonzero(off[:-1] * off[1:] < 0.0):
            exact = {'xtol': _ROUNDING * places[k + 1], 'rtol': 4 * _ROUNDING}
            root = scipy.optimize.brentq(
                lambda x: trials.figure(x) - wanted, places[k], places[k + 1], **exact
            )
            there = trials.figure(root)
            found.append(Found(parameter.at(root), there, abs(there - wanted) > _JUMP * span))
        found += _stretches(trials, places, off == 0.0, wanted)
    found.sort(key=lambda one: one.value)
    shown = [*zip(map(parameter.at, places), figures.tolist(), strict=True)]
    shown += [(one.value, one.figure) for one in found]
    failed = tuple((values[parameter.path], reason) for values, reason in trials.failed)
    return Finding(
        parameter, goal, trials.units[0], wanted, tuple(sorted(shown)), tuple(found), failed,
        len(trials.tried),
    )  # fmt: skip


def _stretches(
    trials: Trials, places: Array, hit: NDArray[np.bool_], wanted: float
) -> list[Found]:
    """Samples that give what is wanted; of neighbours, such as those of a count, the ends."""
    (parameter,), found = trials.parameters, []
    at = np.flatnonzero(hit)
    for group in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1) if len(at) else ():
        first, last = int(group[0]), int(group[-1])
        beside = places[first] + _BESIDE * np.array([-1.0, 1.0]) / len(places)
        if first == last and not any(_hits(trials, x, wanted) for x in beside if 0.0 < x < 1.0):
            found.append(Found(parameter.at(places[first]), wanted))
            continue
        low = _edge(trials, places[first - 1], places[first], wanted) if first else places[0]
        high = places[-1]
        if last < len(places) - 1:
            high = _edge(trials, places[last + 1], places[last], wanted)
        found.append(Found(parameter.at(low), wanted, last=parameter.at(high)))
    return found


def _edge(trials: Trials, outside: float, inside: float, wanted: float) -> float:
    """Last value on the way out that fulfils the goal, by bisection."""
    while abs(inside - outside) > _ROUNDING * max(abs(inside), _BESIDE):
        middle = 0.5 * (outside + inside)
        if _hits(trials, middle, wanted):
            inside = middle
        else:
            outside = middle
    return inside


def _hits(trials: Trials, place: float, wanted: float) -> bool:
    """True if a place gives what is wanted but for rounding; one that cannot run gives nothing."""
    with suppress(InputError, RunError):
        return trials.off(place, wanted) == 0.0
    return False


def _extreme(trials: Trials, places: Array, figures: Array) -> Found:
    """Value at which the figure is least or greatest, to about half of its digits."""
    (parameter,), sign = trials.parameters, trials.goals[0].sign
    k = int(np.nanargmin(sign * figures))
    best, figure = places[k], float(figures[k])
    ends = places[max(k - 1, 0)], places[min(k + 1, len(places) - 1)]
    with suppress(InputError, RunError):  # a cycle between them fails: what is known holds
        result = scipy.optimize.minimize_scalar(
            lambda x: sign * trials.figure(x), bounds=ends, method='bounded',
            options={'xatol': 1e-8 * (ends[1] - ends[0])},
        )  # fmt: skip
        if result.fun < sign * figure:
            best, figure = result.x, sign * float(result.fun)
    return Found(parameter.at(best), figure)
