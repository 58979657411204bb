"""The life of bearings that wear: runs of a machine whose bearings change, over many cycles.

A run of some cycles tells how deep each place of bushing and pin wears in a cycle, by Archard's
law. The depths h follow ``dh/dn = R(h)`` over cycles n. A step takes R at its beginning and, with
half of it worn, at its middle; what a whole step and two halves differ by controls the step, and
both together give its end (step doubling with extrapolation, which is the midpoint rule). These
differences, and what R scatters from turn to turn, bound the life.

Where a pin has worn its own shape into a bushing, it touches along an arc. One that is rigid then
sinks as a whole: of the depths that leave room for it, those count that are nearest to what the
run would wear off (least squares). What they move over is the pressure along the arc; it keeps the
force, because ``h + h''`` of such a pressure has no first harmonic. Under a constant force the pin
sinks straight, ``h = (c + d) cos(phi) - c`` over the arc where it is positive, and its centre runs
into a corner. Runs have that corner rounded, as smooth functions of the gap need it: the same
projection with a least radius of 0.3 c makes their groove up to 11 % and 0.08 c less deep than
that which wears. This changes by as much where the pin is, not where and by which force it is
pressed against the wall.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

from mechanism_sim import strict_json
from mechanism_sim.arguments import check_options, listed, public
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError, check_known
from mechanism_sim.joints.contact_keys import Clearance, WearPart
from mechanism_sim.numerics.batch_means import batches
from mechanism_sim.results.bearing_wear import (
    IMPACT_SLIP,
    IMPACT_WORK,
    LOAD_SLIP,
    WORK,
    wear_sums,
)
from mechanism_sim.results.measure_text import read_all
from mechanism_sim.results.measures import Measurement
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine, Source, load_scene
from mechanism_sim.scene.build import rebuilt
from mechanism_sim.studies.columns import PER_TURN
from mechanism_sim.studies.goal import EQUAL, Goal, read_bound
from mechanism_sim.studies.journal import Journal
from mechanism_sim.studies.run_bag import RunBag
from mechanism_sim.studies.runs import Call, FinishedRows, Row, compute
from mechanism_sim.tables import Column, Tabular
from mechanism_sim.units import argument, to_si_like

PLACES = 180
"""Number of places of a surface, evenly from angle 0 on, whose depths are followed."""
OWN = {'clearance': 'm', 'depth': 'm'}
"""Figures of worn bearings that a condition may name, the largest of all or of one joint."""
_ROUNDEST = 0.3  # least radius of the pin centre's boundary in runs, over the clearance
_NOISE, _SLIGHT = 1.5, 0.01  # limits of smoothing, in standard errors and as a share of depths
_SIZES = 1.0, 820.0, 3e5, 0.1, 10.0, 0.01  # row scales for successive attempts of the solver
_GROWTH = 0.3  # largest growth of the clearance in a step, as a share
_FIRST = 0.1  # growth of the clearance in the first step, as a share
_AHEAD = 1.01  # last step, over the estimated remaining cycles
_SHORTEST = 2e-4  # least last step, over the cycles so far
_NEAR = 0.25  # tolerance of the limit, over the uncertainty of a clearance
_MOST_STEPS = 500
_LATE, _TRIES = 0.02, 4  # share of a step by which the last may be late; number of attempts


@dataclass(frozen=True)
class LifePlan:
    """Settings for the simulation of a life.

    Attributes
    ----------
    cycles : largest number of turns of the drive
    tolerance : allowed error of a step, as a share of the clearance's growth in it
    revolutions, skip : turns of a run that count, and those before them until it has settled
    """

    cycles: float = 1e7
    tolerance: float = 0.02
    revolutions: int = 40
    skip: int = 10


@dataclass(frozen=True, eq=False)
class LifeStage:
    """A machine at some time of its life.

    Attributes
    ----------
    cycles : number of cycles so far
    depths : (2, 180) worn off bushing and pin, by joint [m]
    clearance : (J,) largest of each bearing [m]
    error : (J,) of the clearance, by the steps and the places [m]
    scatter : (J,) of the clearance, half of a 95 % interval, by the runs [m]
    impacts : (J,) in a cycle
    figures : figures of the run at this stage, by name
    """

    cycles: float
    depths: dict[str, Array]
    clearance: Array
    error: Array
    scatter: Array
    impacts: Array
    figures: dict[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class Life(Tabular):
    """The life of a machine's bearings.

    Attributes
    ----------
    machine : machine as new
    cycles : number of cycles of the life; nan if longer than the plan
    low, high : limits of its interval
    stages : stages from the new machine to the end of life
    units : units of the stages' figures
    runs : number of runs
    note : why it could not be followed to the end, or why nothing wears
    """

    machine: Machine
    until: str
    plan: LifePlan
    cycles: float
    low: float
    high: float
    stages: tuple[LifeStage, ...]
    units: dict[str, str]
    runs: int
    note: str = ''

    @property
    def joints(self) -> tuple[str, ...]:
        """The bearings that wear."""
        return tuple(self.stages[0].depths)

    def scene(self, stage: LifeStage) -> dict[str, Any]:
        """The scene that is run at a stage, as a file gives it: with grooves that are rounded."""
        rounded = _roomy(self.machine.plan.clearances, stage.depths, _ROUNDEST)
        return worn_scene(self.machine.scene.to_document(), rounded)

    def columns(self) -> list[Column]:
        """A row for each stage."""
        stages = self.stages
        every = [Column('cycles', [s.cycles for s in stages], '', 'so far')]
        for k, joint in enumerate(self.joints):
            for name, values in (
                ('clearance', [s.clearance[k] for s in stages]),
                ('clearance_error', [s.error[k] + s.scatter[k] for s in stages]),
                ('bushing_depth', [s.depths[joint][0].max() for s in stages]),
                ('pin_depth', [s.depths[joint][1].max() for s in stages]),
            ):
                words = name.replace('_', ' ')
                every.append(Column(f'{name}.{joint}', [float(x) for x in values], 'm', words))
            counts = [float(s.impacts[k]) for s in stages]
            every.append(Column(f'impacts.{joint}', counts, PER_TURN, 'in a cycle'))
        for name, unit in self.units.items():
            every.append(Column(name, [s.figures[name] for s in stages], unit, 'of the run'))
        return every


class _Rates(NamedTuple):
    """Depths and figures that a run of a machine gives."""

    depths: dict[str, Array]  #: (2, 180) [m] in a cycle
    scatter: dict[str, Array]  #: (2, 180) [m], standard error
    impacts: Array  #: (J,) in a cycle
    figures: dict[str, float]


@public
def life(
    scene: Source,
    until: str = '',
    *,
    cycles: float = 1e7,
    measures: str | Sequence[str] = (),
    table: str | Path | None = None,
    restart: bool = False,
    bags: str | Path | None = None,
    show: Callable[[str], None] | None = None,
    **how: Any,
) -> Life:
    """Predict the life of a machine's bearings, and how they and its motion change until then.

    Each bearing with ``clearance.wear`` wears; a cycle is a turn of the drive.

    >>> import mechanism_sim as ms
    >>> bearing = 'joints.coupler_rocker.clearance'
    >>> worn = {f'{bearing}.wear': {'width': '10 mm', 'bushing': '1e-5 mm^3/(N m)'},
    ...         f'{bearing}.pin_radius': '6 mm', f'{bearing}.friction': 0.1,
    ...         f'{bearing}.profile': {'harmonics': 8}}
    >>> machine = ms.load_scene('four_bar_clearance', overrides=worn)
    >>> found = ms.life(machine, 'clearance > 0.2545 mm', revolutions=10, skip=1)
    >>> found.cycles > 0.0
    True

    Parameters
    ----------
    until : ``clearance > 0.5 mm``, ``depth.JOINT > 20 um``, or a measure of the run and its limit
    cycles : largest number of cycles
    measures : further figures of every stage
    table : a table that will be written; beside it the runs are kept, from which it goes on
    restart : forget those
    bags : folder for a bag of each stage
    how : ``tolerance``, ``revolutions``, ``skip`` of `LifePlan`
    """
    how = check_options(life, how, LifePlan)
    machine = load_scene(scene)
    most = argument('cycles', cycles, '')
    plan = LifePlan(cycles=LifePlan.cycles if most is None else most, **how)
    worn = _worn_bearings(machine, plan)
    ends = _end_of_life(until) if until else None
    asked = _asked(machine, worn, listed(measures, 'measures'), ends)
    content = machine.scene.to_document()
    print_of = strict_json.dumps([content, asked, plan.revolutions, plan.skip])
    with _kept(table, sha256(print_of.encode()).hexdigest(), restart) as rows:
        runs = _Runs(machine, content, worn, plan, asked, rows, show)
        found = _follow(runs, ends)
    result = Life(machine, until, plan, *found, runs.units, runs.count, runs.note)
    if bags:
        for k, stage in enumerate(result.stages):
            _record(machine.name, result.scene(stage), Path(bags) / f'stage_{k:02d}.mcap', plan)
    return result


def _kept(
    table: str | Path | None, plan: str, restart: bool
) -> AbstractContextManager[FinishedRows]:
    """Store of the rows of finished runs: a journal beside a table, or in memory only."""
    return Journal(Path(table), plan, restart, 'life') if table else nullcontext(FinishedRows())


def _end_of_life(text: str) -> Goal:
    """The condition that ends a life, such as ``clearance > 0.5 mm``."""
    refusal = (
        f"--until '{text}': write a figure and its limit, as 'clearance > 0.5 mm' or "
        "'rms(acceleration.rocker) > 50 rad/s^2'"
    )
    found = read_bound(text, refusal)
    if found.kind == EQUAL:
        raise InputError(refusal)
    return found


def _worn_bearings(machine: Machine, plan: LifePlan) -> dict[str, Clearance]:
    """The bearings that wear."""
    if not machine.drive.steady or not machine.drive.fastest:
        raise InputError(f'{machine.name}: life needs a drive at constant speed')
    for name, least in (('revolutions', 1), ('skip', 0)):
        if getattr(plan, name) < least:
            raise InputError(f'life: {name} must be at least {least}')
    if not (plan.cycles > 0.0 and 0.0 < plan.tolerance < 1.0):
        raise InputError('life: cycles must be above 0, and tolerance between 0 and 1')
    loose = machine.plan.clearances
    found = {n: c for n, c in loose.items() if isinstance(c, Clearance) and c.wear}
    if not found:
        known = ', '.join(loose) or 'none'
        raise InputError(
            f'{machine.name}: no bearing wears: give joints.NAME.clearance.wear, as '
            f'{{width: 10 mm, bushing: 1e-7 mm^3/(N m)}}; loose joints: {known}'
        )
    for name, c in found.items():
        if c.length:
            raise InputError(f'joints.{name}.clearance has wear and a length: leave it out')
        if not c.journal:
            raise InputError(f"joints.{name}.clearance.wear needs 'pin_radius'")
        if c.wear and c.wear.law == 'friction_work' and not c.friction:
            raise InputError(f"joints.{name}.clearance.wear.law = friction_work needs 'friction'")
    return found


def _asked(
    machine: Machine, worn: Mapping[str, Clearance], given: Sequence[str], ends: Goal | None
) -> list[str]:
    """Texts of the measures of every stage."""
    forces = [f'largest(normal_force.{joint})' for joint in worn]
    sensed = [
        f'rms(sensors.{name})'
        for name, sensor in machine.scene.sensors.items()
        if sensor.kind == 'accelerometer'
    ]
    asked = list(dict.fromkeys([*forces, *sensed, *machine.scene.measures.values(), *given]))
    if ends and ends.name.partition('.')[0] in OWN:
        joint = ends.name.partition('.')[2]
        if joint:
            check_known(
                joint, worn, f"--until: '{joint}' is not a bearing that wears", 'known are'
            )
    elif ends and ends.name not in asked:
        asked.append(ends.name)
    return asked


# --- runs ----------------------------------------------------------------------------------------


class _Runs:
    """Runs of a machine at given depths."""

    def __init__(
        self, machine: Machine, content: dict[str, Any], worn: Mapping[str, Clearance],
        plan: LifePlan, asked: list[str], rows: FinishedRows, show: Callable[[str], None] | None,
    ) -> None:  # fmt: skip
        self.machine, self.worn, self.plan = machine, worn, plan
        self._content, self._asked, self._rows, self._show = content, asked, rows, show
        self.units = Measurement(machine, read_all(asked, 'life')).units()
        self.count, self.note = 0, ''

    def rates(self, depths: dict[str, Array], cycles: float, last: Array) -> _Rates:
        """Rates of wear of the machine with these depths."""
        if self._show:
            self._show(
                f'{cycles:.3g} cycles, clearance {1e3 * last.max():.4g} mm, run {self.count}'
            )
        self.count += 1
        content = worn_scene(self._content, _roomy(self.worn, depths, _ROUNDEST))
        key = sha256(strict_json.dumps(content).encode()).hexdigest()
        if key not in self._rows.rows:
            names = tuple(self.worn)
            task = Call(key, wear_in, (self.machine.name, content, names, self.plan, self._asked))
            finished = compute(task)
            if finished.error:
                raise RunError(f'after {cycles:.4g} cycles: {finished.error}')
            self._rows.add(finished)
        row = self._rows.rows[key]
        found = {j: np.array(row['depths'][j]) for j in self.worn}
        scatter = {j: np.array(row['scatter'][j]) for j in self.worn}
        return _Rates(found, scatter, np.array(row['impacts']), row['figures'])


def wear_in(
    name: str, content: dict[str, Any], joints: tuple[str, ...], plan: LifePlan, asked: list[str]
) -> Row:
    """Depths that a run wears off in a cycle, by joint, as plain data."""
    machine = rebuilt(name, content)
    solution = simulate(machine, revolutions=plan.skip + plan.revolutions)
    count, size = batches(plan.revolutions)
    period = machine.drive.period
    first = plan.skip + plan.revolutions - count * size
    times = period * (first + size * np.arange(count + 1.0))
    times[-1] *= 1.0 + 1e-12  # includes events at the very end
    row: Row = {'depths': {}, 'scatter': {}, 'impacts': []}
    for joint in joints:
        spec = machine.plan.clearances[joint]
        assert isinstance(spec, Clearance) and spec.wear  # noqa: S101, PT018 - it wears
        sums = wear_sums(machine, solution, joint, PLACES, times, spec.journal) / size
        degree = spec.profile.harmonics if spec.profile else 16
        worn = [_smooth(_depth(s, spec, spec.wear, k), degree) for k, s in enumerate(sums)]
        row['depths'][joint], row['scatter'][joint] = np.transpose(worn, (1, 0, 2)).tolist()
        struck = sum(i.joint == joint and i.t >= times[0] for i in solution.impacts)
        row['impacts'].append(struck / (count * size))
    taken = Measurement(machine, read_all(asked, 'life'), since=float(times[0]))
    taken.add(solution)
    row['figures'] = {m.name: m.value for m in taken.found()}
    return row


def _depth(sums: Array, spec: Clearance, wear: WearPart, surface: int) -> Array:
    """Depths (B, 180) [m] worn off a surface (bushing 0, pin 1) in each part of a run."""
    rows = (LOAD_SLIP, IMPACT_SLIP) if wear.law == 'archard' else (WORK, IMPACT_WORK)
    volume = (wear.bushing, wear.pin)[surface] * (sums[rows[0]] + sums[rows[1]])
    radius = spec.journal + (0.0 if surface else spec.radial)
    width = wear.width or (spec.contact and spec.contact.width)
    assert width  # noqa: S101 - checked
    return np.asarray(volume * PLACES / (2.0 * math.pi * radius * width))


def _smooth(worn: Array, degree: int) -> tuple[Array, Array]:
    """The mean (180,) of the parts (B, 180) of a run, and its error, standard and by smoothing.

    It is spread as widely as the turns cannot tell from what they have without: by so many
    harmonics, or by twice as many, and so on, until means of all narrower ones are within their
    own noise (O. V. Lepskii, Theory Probab. Appl. 35 (1990) 454). A force in one direction stays
    in one place. Jackson's kernel is taken twice as K (2 - K), which keeps the first harmonic of
    what is wide, the force along an arc; no depth is negative, and the volume is kept.
    """
    count, k, found = len(worn), np.arange(PLACES // 2 + 1), []
    for n in [*(degree * 2**i + 1 for i in range(4) if degree * 2**i < PLACES // 2), 0]:
        kernel = np.ones(len(k))
        if n:
            turn = math.pi / n
            kernel = np.where(
                k < n, (n - k) * np.cos(turn * k) + np.sin(turn * k) / math.tan(turn), 0.0
            ) / n  # fmt: skip
        own = np.fft.irfft(kernel * (2.0 - kernel) * np.fft.rfft(worn), PLACES)
        error = own.std(axis=0, ddof=1) / math.sqrt(count) if count > 1 else 0.0 * own[0]
        found.append((own.mean(axis=0), error))
    slight = _SLIGHT * np.linalg.norm(found[-1][0])
    mean, error, narrower = next(
        (*both, found[i + 1 : i + 2] or [both]) for i, both in enumerate(found)
        if all(np.linalg.norm(both[0] - x) <= _NOISE * np.linalg.norm(e) + slight
               for x, e in found[i + 1 :])
    )  # fmt: skip
    error = np.hypot(error, mean - narrower[0][0])
    kept = np.maximum(mean, 0.0)
    return kept * (mean.sum() / (kept.sum() or 1.0)), error


def worn_scene(content: dict[str, Any], depths: Mapping[str, Array]) -> dict[str, Any]:
    """A scene, as a file gives it, with the depths (2, 180) [m] of bearings, by joint."""
    angles = 2.0 * np.pi / PLACES * np.arange(PLACES)
    worn = copy.deepcopy(content)
    for joint, both in depths.items():
        clearance = worn['joints'][joint]['clearance']
        profile = clearance['profile'] = dict(clearance.get('profile') or {})
        for kind, depth in zip(('bushing', 'pin'), both, strict=True):
            known = np.where(np.abs(depth) < 1e-15, 0.0, depth)
            points = np.transpose([angles, known]).tolist()
            if depth.any():
                profile[kind] = {'points': points}
            else:
                profile.pop(kind, None)
    return worn


def _record(name: str, content: dict[str, Any], file: Path, plan: LifePlan) -> None:
    """A bag of a run at a stage."""
    machine = rebuilt(name, content)
    solution = simulate(machine, revolutions=plan.skip + plan.revolutions)
    with RunBag(file, machine, solution.duration) as bag:
        bag.add(solution)


# --- steps ---------------------------------------------------------------------------------------


def room_for_pin(depths: Array, clearance: float, roundest: float = 0.0) -> Array:
    """The nearest depths (180,) that leave room for the pin everywhere, by least squares [m].

    With ``p = c + h`` the pin touches a place if ``p + p''`` is not negative there. This is the
    radius of curvature of what the pin's centre runs along, of which at least `roundest` of the
    clearance is kept. The multipliers of these conditions are found as non-negative least squares
    of the dual problem.
    """
    step = 2.0 * math.pi / PLACES
    p = 1.0 + depths / clearance - roundest  # of the clearance: the solver has absolute bounds
    # it has no value for the sine and cosine of the first harmonic: moved circles stay circles
    row = np.zeros(PLACES)
    row[[0, 1, -1]] = -2.0 * math.cos(step), 1.0, 1.0
    bends = scipy.linalg.circulant(row) / 4.0
    if (bends @ p >= -1e-12).all():
        return depths
    for size in _SIZES:  # SciPy's solver ends wrongly now and then, but not at every size
        rows = size * bends.T
        change = rows @ scipy.optimize.nnls(rows, -p, maxiter=50 * PLACES)[0]
        if (bends @ (p + change)).min() > -1e-9:
            return np.asarray(depths + clearance * change)
    raise RunError('no depths are found that leave room for the pin')


def _roomy(
    loose: Mapping[str, Any], depths: Mapping[str, Array], roundest: float = 0.0
) -> dict[str, Array]:
    """Depths of bearings by joint, with room for the pin beside each wall that wears."""
    found = {}
    for joint, both in depths.items():
        spec = loose[joint]
        assert isinstance(spec, Clearance) and spec.wear  # noqa: S101, PT018 - it wears
        rooms = [spec.reach + float(both[other].mean()) for other in (1, 0)]
        found[joint] = np.array(
            [
                room_for_pin(depth, room, roundest) if wears else depth
                for depth, room, wears in zip(
                    both, rooms, (spec.wear.bushing, spec.wear.pin), strict=True
                )
            ]
        )
    return found


def _moved(
    runs: _Runs, depths: dict[str, Array], rates: dict[str, Array], cycles: float
) -> dict[str, Array]:
    """Depths after a number of cycles at these rates."""
    return _roomy(runs.worn, {j: own + cycles * rates[j] for j, own in depths.items()})


def _clearances(runs: _Runs, depths: Mapping[str, Array]) -> Array:
    """The largest clearance of each bearing [m]."""
    worn = runs.worn.items()
    return np.array([c.radial + depths[j].max(axis=1).sum() for j, c in worn])


@dataclass(frozen=True)
class _End:
    """The condition that ends a life, with its limit in SI units."""

    until: Goal
    limit: float
    chosen: tuple[int, ...]  #: numbers of the joints that it is about

    @classmethod
    def of(cls, until: Goal, runs: _Runs) -> _End:
        name, _, joint = until.name.partition('.')
        unit = OWN.get(name) or runs.units[until.name]
        try:
            limit = to_si_like(until.wanted, unit)
        except ValueError as error:
            raise InputError(f'--until: the limit {until.wanted} {error}') from error
        chosen = tuple(k for k, j in enumerate(runs.worn) if name not in OWN or joint in ('', j))
        return cls(until, limit, chosen)

    @property
    def own(self) -> bool:
        """True if it is about the bearings, not about the motion."""
        return self.until.name.partition('.')[0] in OWN

    def past(self, stage: LifeStage) -> float:
        """Amount by which a stage exceeds the limit; negative before it."""
        name = self.until.name.partition('.')[0]
        depths = [*stage.depths.values()]
        if name == 'clearance':
            value = max(float(stage.clearance[k]) for k in self.chosen)
        elif name == 'depth':
            value = max(float(depths[k].max()) for k in self.chosen)
        else:
            value = stage.figures[self.until.name]
        return -self.until.sign * (value - self.limit)

    def ahead(self, runs: _Runs, now: LifeStage, rates: _Rates) -> float:
        """Cycles to the limit at the present rates, where they are known."""
        if not self.own:
            return math.inf
        size = _clearances(runs, now.depths)
        one = 1e-3 * float((size / np.maximum(_fastest(rates), 1e-300)).min())
        later = _moved(runs, now.depths, rates.depths, one)
        moved = self.past(replace(now, depths=later, clearance=_clearances(runs, later)))
        rate = (moved - self.past(now)) / one
        return (_NEAR * self.doubt(now) - self.past(now)) / rate if rate > 0.0 else math.inf

    def doubt(self, stage: LifeStage) -> float:
        """Uncertainty of a bearing's figure [m]; 0 of other figures."""
        doubts = (stage.error + stage.scatter)[list(self.chosen)]
        return float(doubts.max()) if self.own else 0.0

    def crossing(
        self, before: LifeStage, after: LifeStage
    ) -> tuple[float, float, float, LifeStage]:
        """The life between two stages, its interval by their errors, and the stage then."""
        low, high = self.past(before), self.past(after)
        share, span = low / (low - high), after.cycles - before.cycles
        cycles = before.cycles + share * span
        doubt = 0.5 * span
        if self.own:
            doubt = self.doubt(after) * span / (high - low)
        depths = {
            j: (1.0 - share) * before.depths[j] + share * after.depths[j] for j in before.depths
        }
        clearance = (1.0 - share) * before.clearance + share * after.clearance
        last = replace(after, cycles=cycles, depths=depths, clearance=clearance)
        return cycles, max(0.0, cycles - doubt), cycles + doubt, last


class _Step(NamedTuple):
    """An accepted step: its result, and the cycles of the next."""

    stage: LifeStage
    rates: _Rates
    next: float


def _follow(runs: _Runs, until: Goal | None) -> tuple[float, float, float, tuple[LifeStage, ...]]:
    """The life with its interval, and the stages."""
    plan, end = runs.plan, _End.of(until, runs) if until else None
    depths = {
        j: np.array(c.profile.depths(PLACES)) if c.profile else np.zeros((2, PLACES))
        for j, c in runs.worn.items()
    }
    size, none = _clearances(runs, depths), np.zeros(len(runs.worn))
    rates = runs.rates(depths, 0.0, size)
    stages = [LifeStage(0.0, depths, size, none, none, rates.impacts, rates.figures)]
    if end and end.past(stages[0]) >= 0.0:
        return 0.0, 0.0, 0.0, tuple(stages)
    fastest, most = _fastest(rates), (1.0 + _FIRST) * size
    if not fastest.any():  # what is not worn in a cycle moves on as it did
        runs.note = 'no wall of a bearing slides under a force, so that nothing wears'
        return math.nan, plan.cycles, math.inf, (*stages, replace(stages[0], cycles=plan.cycles))
    step, tries = _FIRST * float((size / np.maximum(fastest, 1e-300)).min()), 0
    # a pin that sinks wears over an arc: more slowly than where the force points at first
    while (_clearances(runs, _moved(runs, depths, rates.depths, 2.0 * step)) <= most).all():
        step *= 2.0
    while len(stages) < _MOST_STEPS:
        now = stages[-1]
        left = plan.cycles - now.cycles
        ahead = _AHEAD * end.ahead(runs, now, rates) + _SHORTEST * now.cycles if end else left
        try:
            found = _step(runs, now, rates, min(step, left, ahead))
        except RunError as error:  # the machine as it is worn then cannot be run
            runs.note = str(error)
            return math.nan, now.cycles, math.inf, tuple(stages)
        if end and (over := end.past(found.stage)) >= 0.0:
            share = over / (over - end.past(now))
            late = share > _LATE and over > 2.0 * _NEAR * end.doubt(found.stage)
            if late and tries < _TRIES:
                # again, not so far: the last stage has a run of its own
                tries += 1
                step = (found.stage.cycles - now.cycles) * (1.0 - share + 0.5 * _LATE)
                continue
            cycles, low, high, last = end.crossing(now, found.stage)
            return cycles, low, high, (*stages, last)
        stages.append(found.stage)
        step, rates = found.next, found.rates
        if found.stage.cycles >= plan.cycles:
            return math.nan, plan.cycles, math.inf, tuple(stages)
    raise RunError(
        f'the life has not ended after {_MOST_STEPS} steps, {stages[-1].cycles:.4g} cycles: give '
        'more tolerance, more revolutions, or fewer cycles'
    )


def _step(runs: _Runs, now: LifeStage, rates: _Rates, step: float) -> _Step:
    """A step of a number of cycles, or of fewer if these change the wear too much."""
    while True:
        whole = _moved(runs, now.depths, rates.depths, step)
        half = _moved(runs, now.depths, rates.depths, 0.5 * step)
        middle = runs.rates(half, now.cycles + 0.5 * step, _clearances(runs, half))
        halves = _clearances(runs, _moved(runs, half, middle.depths, 0.5 * step))
        off = np.abs(halves - _clearances(runs, whole))
        noise = 0.5 * step * np.hypot(_scatter(rates, half), _scatter(middle, half))
        wrong = np.maximum(off - noise, 0.0) / np.maximum(halves - now.clearance, 1e-300)
        share = float((wrong * (halves > now.clearance)).max()) / runs.plan.tolerance
        large = float(((halves - now.clearance) / now.clearance).max()) / _GROWTH
        if max(share, large) <= 1.2:
            break
        step *= max(0.2, 0.9 / max(share, large))
    depths = _moved(runs, now.depths, middle.depths, step)
    size, cycles = _clearances(runs, depths), now.cycles + step
    ahead = runs.rates(depths, cycles, size)
    scatter = np.hypot(now.scatter, 1.96 * step * _scatter(middle, depths))
    error = np.maximum(now.error, _between(depths)) + off
    stage = LifeStage(cycles, depths, size, error, scatter, ahead.impacts, ahead.figures)
    return _Step(stage, ahead, step * min(3.0, 0.9 / max(share, large, 0.1)))


def _fastest(rates: _Rates) -> Array:
    """The largest rates of both surfaces together, by joint [m]."""
    return np.array([both.max(axis=1).sum() for both in rates.depths.values()])


def _between(depths: Mapping[str, Array]) -> Array:
    """Bound on extra depth of each bearing beside its deepest sampled places [m].

    Twice the height of a parabola through three places.
    """
    found = []
    for both in depths.values():
        bends = np.abs(np.roll(both, 1, axis=1) - 2.0 * both + np.roll(both, -1, axis=1))
        found.append(0.25 * float(bends[[0, 1], both.argmax(axis=1)].sum()))
    return np.array(found)


def _scatter(rates: _Rates, depths: Mapping[str, Array]) -> Array:
    """Standard error of the rate of each clearance, where it is largest [m]."""
    found = [
        math.hypot(*(float(own[k, place]) for k, place in enumerate(depths[joint].argmax(axis=1))))
        for joint, own in rates.scatter.items()
    ]
    return np.array(found)
