"""Everything about a machine over one cycle, as arrays by name.

A cycle is a revolution of the drive where it turns at constant speed, or as many as bring all
again, as two of a camshaft at half speed; otherwise it is as long as it is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from mechanism_sim.arguments import listed, public
from mechanism_sim.arrays import Array
from mechanism_sim.engine import plotting
from mechanism_sim.engine.peak_shapes import PeakShape, peak_shape
from mechanism_sim.engine.physics import each_instant
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.planar.inverse_dynamics import NoLimit
from mechanism_sim.planar.points import LinkPoint
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.measure_text import Measure
from mechanism_sim.results.measures import Measured, Measurement
from mechanism_sim.results.quantities.motion import RATES, choose_points
from mechanism_sim.results.quantity import Shown, View
from mechanism_sim.results.ranges import Extreme, Extremes, search
from mechanism_sim.results.run import Solution, seconds_of
from mechanism_sim.results.simulate import simulate
from mechanism_sim.results.strokes import Swing, find_swings, one_way_ends
from mechanism_sim.scene import Level, Machine, Source, load_scene, over_range, placed, span
from mechanism_sim.scene.load import has_place, without_clearance
from mechanism_sim.scene.plan import keeps_speed
from mechanism_sim.scene.validation import between_limits, turns_round
from mechanism_sim.tables import Table
from mechanism_sim.units import argument, for_people

_OF_MOTION = 'energy.kinetic', 'energy.drive_work', 'energy.dissipated'
_MOMENT = 1e-6  # duration [s] of a run of which only the start is used
_ROUNDED = 1e-9  # efficiency below which it counts as zero: works are sums of quadratures
_NEAR = 1e-4  # of the way between limits of a drive: what is so near to one is told by its growth

# eight instants, in steps, and the weights with which a polynomial through them gives what is
# between the middle ones, or one step before the first
_BESIDE = np.arange(-3.5, 4.0)
_BETWEEN = np.array([-5.0, 49.0, -245.0, 1225.0, 1225.0, -245.0, 49.0, -5.0]) / 2048.0
_BEYOND = np.array([8.0, -28.0, 56.0, -70.0, 56.0, -28.0, 8.0, -1.0])


@dataclass(frozen=True, eq=False)
class Cycle(plotting.Rich):
    """One cycle of a machine: ``cycle[name]`` is an array (N + 1,), both ends included.

    It goes over the names of its table.

    Any quantity of the machine can be asked for (``mechanism-sim quantities SCENE``). Its table
    has all but paths of points and forces in the frames of links, which are there on request: a
    point has ``position.LINK.POINT.x`` and so on, the force on a link along and across it is
    ``reaction.JOINT.LINK.along`` and ``.across`` ([V] ch. 3).

    Attributes
    ----------
    machine, solution : machine and its run
    t : (N + 1,) [s] evenly spaced
    repeats : True if it is a whole number of turns of a drive at constant speed
    static : True if inertia forces are left out
    ranges : True if it goes from one limit to the other of a drive that cannot turn round, which
        starts and stops there
    """

    machine: Machine
    solution: Solution
    t: Array
    repeats: bool
    points: Mapping[str, LinkPoint]
    local: bool
    static: bool = False
    ranges: bool = False
    _figures: dict[tuple[str, str], float] = field(default_factory=dict, init=False)

    def __repr__(self) -> str:
        span = f'{self.t[0]:.6g} s to {self.t[-1]:.6g} s'
        return f'<Cycle of {self.machine.name}: {len(self.t)} samples from {span}>'

    @cached_property
    def drive(self) -> str:
        """Coordinate of the first drive, whose position orders the cycle."""
        return self.machine.plan.main

    @property
    def drive_torques(self) -> list[str]:
        """Names of the columns of the drives' torques, or forces of sliding ones."""
        names = [name for name in self.names if name.startswith('drive_torque')]
        return names if len(names) < 2 else [name for name in names if '.' in name]

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return float(self.t[-1] - self.t[0])

    @cached_property
    def names(self) -> list[str]:
        """The columns of its table."""
        known = catalogue(self.machine)
        paths = {f'{kind}.{p}.{axis}' for p in self.points for kind in RATES for axis in 'xy'}
        own = ('along', 'across') if self.local else ()
        return [
            name
            for name, quantity in known.items()
            if (quantity.shown >= Shown.CYCLE or name in paths or quantity.part in own)
            and not (self.static and name in _OF_MOTION)  # of the motion as it is
        ]

    def __getitem__(self, name: str) -> Array:
        if name not in self.table():
            return self.at(self.t, [catalogue(self.machine).find(name).name]).popitem()[1]
        return self.table()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def table(self) -> Table:
        """All columns (N + 1,) by name, in SI units."""
        return self._table

    def units(self) -> dict[str, str]:
        """SI units of the columns by name, empty for numbers."""
        known = catalogue(self.machine)
        return {name: known[name].unit for name in self.names}

    @cached_property
    def _table(self) -> Table:
        return Table(self.at(self.t, self.names), self.units())

    def at(self, t: Array, names: str | Sequence[str] | None = None) -> dict[str, Array]:
        """Columns at any instants (K,) of the cycle.

        Where forces in joints have no limit they are NaN. What the frame gets from all of them
        has one, which comes from instants beside.

        Parameters
        ----------
        names : quantities of the machine; by default those of its table
        """
        names = self.names if names is None else listed(names, 'names')
        if self.static and (of_motion := [name for name in names if name in _OF_MOTION]):
            raise InputError(
                f"{self.machine.name}: '{of_motion[0]}' is a quantity of the motion, which "
                'static forces leave out: use a cycle that is not static'
            )
        t = seconds_of(t)
        columns = self._columns(t, names)
        if self.ranges:
            ends = (t <= self.t[0]) | (t >= self.t[-1])
            for name in self.unbounded.intersection(names):
                columns[name] = np.where(ends, np.nan, columns[name])
        on_frame = [name for name in names if name.startswith('shaking_')]
        lost = np.flatnonzero(np.isnan(columns[on_frame[0]])) if on_frame else np.zeros(0, int)
        if (
            lost.size and not self.machine.physics.unknowns
        ):  # those have none where they do no work
            step = 0.003 * (self.machine.drive.period if self.repeats else self.duration)
            curve, at = self.solution.motion.curve, t[lost, None]
            beside, weights = at + step * _BESIDE, np.tile(_BETWEEN, (len(lost), 1))
            for sign, outside in (
                (1.0, beside[:, 0] < curve.start[0]),
                (-1.0, beside[:, -1] > curve.end),
            ):
                beside[outside] = at[outside] + sign * step * np.arange(1.0, 9.0)
                weights[outside] = _BEYOND
            near = self._columns(beside.ravel(), on_frame)
            for name in on_frame:
                columns[name][lost] = (near[name].reshape(-1, 8) * weights).sum(axis=1)
        return columns

    def _columns(self, t: Array, names: Sequence[str]) -> dict[str, Array]:
        run = self.solution
        view = View.at(self.machine, run.motion, t, run.balance, self.static)
        return catalogue(self.machine).columns(names, view)

    def plot(self, *names: str, **how: Any) -> Any:
        """Plot columns by name, or an overview, over the angle of a steady drive.

        The keywords are those of `mechanism_sim.report.lines.plot`: ``against='time'``, and
        ``start`` and ``end`` [s]. A Matplotlib figure comes back.
        """
        return plotting.plot(self, *names, **how)

    def extremes(self) -> dict[str, Extremes]:
        """Least and greatest value of each column, with times: of the motion, not of samples."""
        return self._extremes

    @cached_property
    def no_limits(self) -> list[NoLimit]:
        """Instants of the cycle with unbounded forces, which are left out."""
        physics = self.machine.nominal.statics if self.static else self.machine.physics
        begin, end = self.t[0], self.t[-1]
        found = physics.no_limits(self.solution.motion)
        return [x for x in found if begin <= x.t <= end or x.is_at(begin) or x.is_at(end)]

    @cached_property
    def unbounded(self) -> set[str]:
        """Names of the columns without a value at some instant, and therefore without extremes.

        They are not finite there, or grow beyond all bounds towards a limit of the drive: halfway
        to it they have at least 1.6 times the value, and halfway again.
        """
        known = catalogue(self.machine)
        names = [name for name in self.names if not known[name].cumulative]
        if not self.ranges:
            at = np.clip([x.t for x in self.no_limits], self.t[0], self.t[-1])
            seen = self.at(at, names) if self.no_limits else {}
            return {name for name, x in seen.items() if not np.isfinite(x).all()}
        near, found = _NEAR * self.duration * np.array([1.0, 2.0, 4.0]), set()
        for t in (self.t[0] + near, self.t[-1] - near):
            for name, x in self._columns(t, names).items():
                first, second, third = np.abs(x)
                if first > 1.6 * second > 1.6**2 * third:
                    found.add(name)
        return found

    @cached_property
    def _extremes(self) -> dict[str, Extremes]:
        known = catalogue(self.machine)
        names = [n for n in self.names if known[n].has_extremes and n not in self.unbounded]
        motion, window = self.solution.motion, (float(self.t[0]), float(self.t[-1]))
        size, drive = self.machine.mechanism.size, f'position.{self.drive}'
        ends: dict[str, Extremes] = {}
        for cumulative in (False, True):
            own = [known[n] for n in names if known[n].cumulative == cumulative]
            if not own:
                continue
            found = search(
                partial(self.at, names=[q.name for q in own]), own, motion, window, size
            )
            low, high = (
                map(Extreme, values.tolist(), t.tolist(), self.at(t, [drive])[drive].tolist())
                for values, t in (
                    (found.least, found.least_time), (found.greatest, found.greatest_time)
                )
            )  # fmt: skip
            both = zip(low, high, (10.0 * found.rounding).tolist(), strict=True)
            ends |= {q.name: Extremes(*x) for q, x in zip(own, both, strict=True)}
        return {name: ends[name] for name in names}

    def peaks(self) -> dict[str, PeakShape]:
        """Durations and impulses of the largest peaks of forces and efforts, by column.

        Of the sizes of forces, normal forces of contacts, and efforts of drives.
        """
        return self._peaks

    @cached_property
    def _peaks(self) -> dict[str, PeakShape]:
        curve = self.solution.motion.between(float(self.t[0]), float(self.t[-1])).curve
        found = {}
        for name, ends in self.extremes().items():
            low, high = ends.least, ends.greatest
            top = low if -low.value > high.value else high
            if not _is_load(name) or ends.constant or not top.value:
                continue

            def size(k: NDArray[np.intp], dt: Array | Nodes, name: str = name) -> Array:
                t = curve.times(*each_instant(curve, k, dt))
                return np.asarray(np.abs(self.at(t, [name])[name]))

            found[name] = peak_shape(size, curve, top.t, abs(top.value))
        return found

    def swings(self) -> dict[str, Swing]:
        """Range and strokes of each coordinate, by coordinate."""
        names, found = self.machine.physics.coordinates, self.extremes()
        ends = [found[f'position.{name}'] for name in names]
        drive, all_ = self.machine.drive, self.machine.drive.repetition
        period = drive.period if self.repeats else None
        return find_swings(
            names,
            [name not in self.machine.physics.displacements for name in names],
            self.solution.motion.curve,
            (float(self.t[0]), float(self.t[-1])),
            [x.greatest.value - x.least.value if not x.constant else 0.0 for x in ends],
            period,
            bool(period and all_.found and round(self.duration / period) % all_.turns == 0),
        )

    def mean(self, name: str) -> float:
        """Mean of a column over time, by quadrature over every step of the motion."""
        return self._over_time('mean', name)

    def rms(self, name: str) -> float:
        """Root of the mean square of a column over time, by quadrature over every step."""
        return self._over_time('rms', name)

    def _over_time(self, function: str, name: str) -> float:
        """Mean or root mean square of a column; columns of one kind are computed together."""
        if (function, name) not in self._figures:
            kind = name.partition('.')[0]
            names = [n for n in self.names if n.partition('.')[0] == kind] or [name]
            texts = [f'{function}({n})' for n in names]
            found = zip(names, measures_of(self, texts), strict=True)
            self._figures.update({(function, n): x.value for n, x in found})
        return self._figures[function, name]

    @property
    def efficiency(self) -> float | None:
        """Efficiency: share of the work of drives and stored energy not lost in joint friction.

        It is 0 to 1; None where nothing rubs, where they give nothing on the whole, or less than
        friction takes, for loads drive the machine, too.
        """
        losses = [name for name in self.names if name.startswith('friction_loss.')]
        power = self.mean_power if losses else 0.0
        if power <= 0.0:
            return None
        if not self.static:
            # kinetic and potential energy at the begin, less those at the end [J]
            energies = ['energy.kinetic', 'energy.potential']
            ends = self.at(self.t[[0, -1]], energies)
            less_stored = -float(sum(np.diff(ends[energy])[0] for energy in energies))
            power += max(less_stored / self.duration, 0.0)
        left = 1.0 - sum(self.mean(name) for name in losses) / power
        if not left >= -_ROUNDED:
            return None
        return left if left > _ROUNDED else 0.0

    @property
    def mean_power(self) -> float:
        """Work of the drives over time [W], that of impacts included."""
        if self.static:
            return self.mean('drive_power')
        # both ends alone: a column takes a quadrature up to each of its samples
        begin, end = self.at(self.t[[0, -1]], 'energy.drive_work')['energy.drive_work'].tolist()
        return float(end - begin) / self.duration


@public
def cycle(
    scene: Source,
    samples: int = 360,
    start: float | str | None = None,
    periods: int | None = None,
    duration: float | str | None = None,
    points: str | Sequence[str] = (),
    local: bool = False,
    static: bool = False,
) -> Cycle:
    """Run a machine over a cycle.

    >>> import mechanism_sim as ms
    >>> one = ms.cycle('slider_crank', start='90 deg')
    >>> round(one.extremes()['position.piston'].greatest.value, 9)
    0.25

    Parameters
    ----------
    scene : any argument of `load_scene`
    samples : number of intervals between samples in a cycle
    start : position of the drive at the start of the cycle [rad]; by default that of the scene
    periods : turns of the drive; as many as bring all again if not given (`MainDrive.repetition`)
    duration : [s] instead, for a drive without constant speed; by default that of the scene
    points : points of requested paths, ``LINK.POINT``
    local : True if forces on each link along and across it are included
    static : forces without those of inertia ([V] 3.5.1): weights stay, and what loads, dampers and
        friction owe to the speed

    Raises
    ------
    InputError
        If forces are wanted of a machine that has none, static forces of one that is not ideal
        and driven, it is unknown how long the cycle is, or there is no such point.
    RunError
        If the run fails.
    """
    machine, start = load_scene(scene), argument('start', start, 'rad')
    if samples < 2 or (periods is not None and periods < 1):
        raise InputError('a cycle needs at least 2 samples and 1 period')
    if duration is not None and periods is not None:
        raise InputError('a cycle has a number of periods or a duration, not both')
    if local and not machine.physics.has_forces:
        raise InputError(
            f'{machine.name}: forces along and across links are not known: its level has no forces'
        )
    if static and machine.level is not Level.INVERSE_DYNAMICS:
        raise InputError(
            f'{machine.name}: static forces need masses, prescribed drives and no clearance; this '
            f'scene is one of {machine.level.value}'
        )
    chosen, whole = choose_points(machine, points), machine
    machine, begin, end = cycle_window(machine, start, periods, duration)
    steady = is_steady(machine)
    solution = simulate(machine, duration=end)
    turns = (periods or machine.drive.repetition.turns) if steady and duration is None else 1
    t = np.linspace(begin, end, samples * turns + 1)
    repeats = steady and duration is None
    return Cycle(machine, solution, t, repeats, chosen, local, static, machine is not whole)


def cycle_window(
    machine: Machine,
    start: float | None = None,
    periods: int | None = None,
    duration: float | str | None = None,
) -> tuple[Machine, float, float]:
    """The machine that runs in a cycle, and the instants [s] between which the cycle is."""
    ranged = over_range(machine) if duration is None and not machine.scene.duration else None
    machine = ranged or machine
    steady, begin = is_steady(machine), 0.0
    if start is not None and ranged is None:
        if not steady:
            raise InputError(f'{machine.name}: only a drive at constant speed has a start angle')
        angle, speed = machine.drive.start
        turns = machine.drive.repetition.turns
        begin = math.remainder(start - angle, 2.0 * math.pi * turns) / speed
        begin += turns * machine.drive.period if begin < 0.0 else 0.0
    if steady and duration is None:
        turns = periods or machine.drive.repetition.turns
        return machine, begin, begin + turns * machine.drive.period
    return machine, begin, begin + span(machine, periods, duration)


def measures_of(
    found: Cycle,
    measures: dict[str, str] | Sequence[str] | Sequence[Measure],
    since: float = -math.inf,
    until: float = math.inf,
    silent: bool = False,
) -> list[Measured]:
    """Measures of a cycle, without the run before it; see `Measurement.found`."""
    begin, end = float(found.t[0]), float(found.t[-1])
    window = max(since, begin), min(until, end)
    taken = Measurement(found.machine, measures, *window, static=found.static, begin=begin)
    taken.add(found.solution)
    return taken.found(silent)


def at_position(machine: Machine, value: float, found: Cycle) -> dict[str, float]:
    """Quantities by name when the drive is at a position [rad, m], also beside its cycle.

    Where a turn begins there, they are those of the run; else of a machine that is placed there,
    which without clearance follow from position and speed alone.
    """
    if not found.repeats:
        there, asked = placed(machine, value), ([*found.points], found.local, found.static)
        found = cycle(there, 2, None, None, _MOMENT, *asked)
    known = catalogue(found.machine)
    names = [name for name in found.names if name != 't' and not known[name].cumulative]
    return {name: float(x[0]) for name, x in found.at(found.t[:1], names).items()}


def instant(
    machine: Machine,
    angle: float | str | None = None,
    t: float | str | None = None,
    duration: float | str | None = None,
    points: str | Sequence[str] = (),
    still: bool = False,
) -> tuple[Cycle, float]:
    """A cycle, and the instant in it when the drive is at a position, or the clock at a time.

    Parameters
    ----------
    angle : of the drive [rad, m], or
    t : time [s]; without either the start
    duration : duration of the cycle [s], where the drive has no period
    points : as for `cycle`
    still : no more than the instant is wanted, so that a drive without a period needs no duration;
        but where all points of a link coincide it is the motion that shows how large it is
    """
    unit = 'm' if machine.plan.main in machine.mechanism.displacements else 'rad'
    angle, t = argument('angle', angle, unit), argument('t', t, 's')
    if t is not None and t < 0.0:
        raise InputError(f'a run begins at 0 s: there is nothing at {t:g} s')
    if duration is not None:
        duration = span(machine, None, duration)
    elif still and t is None and machine.plan.clearances and between_limits(machine):
        machine = without_clearance(machine)  # of which the limits are
    ranged = over_range(machine) if duration is None and t is None else None
    steady = is_steady(machine)
    if ranged or (angle is not None and not steady):
        at = machine.drive.start[0] if angle is None else angle
        if still and (ranged or has_place(machine)):
            return cycle(placed(machine, at), duration=_MOMENT, points=points), 0.0
        found = cycle(ranged or machine, duration=duration, points=points)
        return found, _time_at(found, at)
    if steady:
        if t is not None:
            duration = max(t, duration or machine.drive.period)
    elif still and duration is None:
        spread = machine.scene.duration if not machine.mechanism.longest else None
        duration = max(t or 0.0, spread or _MOMENT)
    elif duration := duration or machine.scene.duration:
        duration = max(t or 0.0, duration)
    found = cycle(machine, start=angle, duration=duration, points=points)
    return found, float(found.t[0]) if t is None else t


def _time_at(cycle: Cycle, value: float) -> float:
    """Time at which a drive is first at a position [rad, m]; whole turns do not count."""
    machine, name, motion = cycle.machine, f'position.{cycle.drive}', cycle.solution.motion
    curve = motion.between(float(cycle.t[0]), float(cycle.t[-1])).curve
    t = np.union1d(one_way_ends(curve, machine.physics.coordinates.index(cycle.drive)), cycle.t)
    t = np.clip(t, cycle.t[0], cycle.t[-1])
    way = cycle.at(t, [name])[name]
    low, high = float(way.min()), float(way.max())
    unit, scale = for_people('m', max(abs(low), abs(high)))
    slack = 1e-9 * max(abs(low), abs(high))
    if cycle.drive not in machine.mechanism.displacements:
        unit, scale = 'deg', 180.0 / math.pi
        value += 2.0 * math.pi * math.ceil((low - value) / (2.0 * math.pi) - 1e-9)

    def off(t: float) -> float:
        return float(cycle.at(np.array([t]), [name])[name][0]) - value

    if not low - slack <= value <= high + slack:
        raise InputError(
            f'{machine.name}: {cycle.drive} goes from {scale * low:.6g} to '
            f'{scale * high:.6g} {unit} in {cycle.duration:.6g} s, and is not at this position'
        )
    value = min(max(value, low), high)
    k = int(np.flatnonzero((way[:-1] - value) * (way[1:] - value) <= 0.0)[0])
    for end in (k, k + 1):  # where rounding may have it beyond
        if way[end] == value:
            return float(t[end])
    return float(scipy.optimize.brentq(off, t[k], t[k + 1]))


def is_steady(machine: Machine) -> bool:
    """True if the main drive turns at constant speed, so that there is a period.

    Other drives rest, or turn whole turns in the turns after which all is as before. A drive that
    cannot turn round, for as long as the scene says, has none.
    """
    plan = machine.plan
    if not all(keeps_speed(plan, c) for c in plan.laws):
        return False
    speeds = {c: plan.held[c][1] for c in plan.laws}
    if not speeds[plan.main] or any(speeds.get(c) for c in machine.mechanism.displacements):
        return False
    turns = machine.drive.repetition.turns
    ratios = [turns * speed / speeds[plan.main] for speed in speeds.values()]
    whole = all(abs(ratio - round(ratio)) < 1e-9 for ratio in ratios)
    return whole and (not machine.scene.duration or turns_round(machine))


def _is_load(name: str) -> bool:
    """True if a column is the magnitude of a force, or a drive's effort."""
    kind = name.partition('.')[0]
    sized = kind in ('reaction', 'shaking_force', 'bearing_force') and name.endswith('.size')
    return sized or kind in ('normal_force', 'drive_torque')
