"""Runs: pieces of motion as polynomials, events, energy; the one loop that makes and audits them.

Whoever needs a run reads its pieces or observes them: solutions, streams, nodes, sweeps, studies.
Nobody sees a piece that has not been audited, so that a run that fails does so everywhere alike;
nodes hand on pieces of few steps at once, and audit them together.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine import plotting
from mechanism_sim.engine.audit import Audit, Energy, Work
from mechanism_sim.engine.bending import BendWatch
from mechanism_sim.engine.dense_output import GrowingMotion, Motion
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.engine.energy_terms import EnergyTerms
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.events import Impact, Impacts, Mode, ModeChange, StopReason
from mechanism_sim.engine.physics import Physics
from mechanism_sim.engine.plotting import Rich
from mechanism_sim.engine.snapshot import Snapshot
from mechanism_sim.errors import InputError, RunError, RunWarning, check_known, quoted
from mechanism_sim.results.catalogue import Catalogue, catalogue, flat
from mechanism_sim.results.quantity import Shown, View
from mechanism_sim.scene import Machine
from mechanism_sim.scene.machine import Run
from mechanism_sim.tables import Table
from mechanism_sim.units import argument, durations

_SENSORS = 'sensors.'  # prefix of the name of a sensor, as in measures

IMPACT_UNITS = {
    't': 's', 'normal_impulse': 'N s', 'tangential_impulse': 'N s', 'approach_speed': 'm/s',
    'rebound_speed': 'm/s', 'normal_angle': 'rad', 'energy_loss': 'J', 'drive_impulse': 'N m s',
    'drive_work': 'J', 'chatter_time': 's', 'duration': 's', 'peak_force': 'N',
}  # fmt: skip
"""Units of the fields of an impact."""


@dataclass(frozen=True)
class Stats:
    """Cost of a run."""

    wall_time: float  #: wall-clock time [s] with the start of the run, without compilation
    cpu_time: float  #: CPU time of this process [s], without compilation
    compile_time: float  #: compilation time [s]; 0 where the process had all code
    steps: int
    switches: int  #: number of events: impacts and losses of contact


def seconds_of(t: Any) -> Array:
    """Times (N,) [s] of numbers, texts with units, or time differences of NumPy and pandas."""
    given = np.atleast_1d(np.asarray(t))
    if given.dtype.kind == 'm':
        return np.asarray(durations(given))
    if given.dtype.kind in 'US' or given.dtype == object:
        given = np.array([argument('t', x, 's') for x in given.ravel().tolist()])
    if given.dtype.kind not in 'iuf':
        raise InputError(f't: expected times [s], got {given.dtype}')
    if given.ndim > 1:
        raise InputError(f't: expected times (N,) [s], got an array of shape {given.shape}')
    return given.astype(float)


def signal_table(t: Array, sensor: str, samples: Array, unit: str) -> Table:
    """Samples (N,) of a sensor and their due times [s]."""
    name = _SENSORS + sensor if sensor == 't' else sensor
    return Table({'t': t, name: samples}, {'t': 's', name: unit})


@dataclass(frozen=True, eq=False)
class Piece(Rich):
    """A part of a run.

    Attributes
    ----------
    machine : machine of the motion
    motion : polynomials of all coordinates and the state of the gaps
    balance : work and losses of its segments, and before
    impacts, modes : events in the order of time
    """

    machine: Machine
    motion: Motion
    balance: EnergyTerms
    impacts: Impacts
    modes: list[ModeChange]

    def __post_init__(self) -> None:
        """Impacts may be given one by one."""
        object.__setattr__(self, 'impacts', Impacts.of(self.impacts))

    @staticmethod
    def joined(pieces: Iterable[Piece]) -> Piece:
        """Consecutive pieces of a run as one; each is released once it is joined."""
        motion, works = GrowingMotion(), list[Work]()
        impacts, changes = list[Sequence[Impact]](), list[ModeChange]()
        for piece in pieces:
            if not works:
                machine, before = piece.machine, piece.balance
            motion.add(piece.motion)
            works.append(piece.balance.work)
            impacts.append(piece.impacts)
            changes += piece.modes
        work = Work(*np.concatenate(works, axis=1))
        struck = Impacts.joined(impacts)
        balance = EnergyTerms(work, struck, before.drive_work, before.dissipated)
        return Piece(machine, motion.whole(), balance, struck, changes)

    def __repr__(self) -> str:
        curve = self.motion.curve
        span = f'{curve.start[0]:.6g} s to {curve.end:.6g} s' if len(curve) else 'no motion'
        return f'<Piece of a run: {span}, {len(curve)} steps, {len(self.impacts)} impacts>'

    def impact_table(self) -> Table:
        """The impacts as columns (n,), SI units."""
        columns = {n: self.impacts.column(n) for n in Impact._fields if n != 'joint'}
        return Table({'t': columns['t'], 'joint': self.impacts.names} | columns, IMPACT_UNITS)

    def digest(self) -> str:
        """SHA-256 of motion and impacts: equal for runs that are equal bit by bit."""
        digest = MotionDigest()
        digest.add(self.motion, self.impacts)
        return digest.hexdigest()

    @property
    def physics(self) -> Physics:
        """Equations of the machine."""
        return self.machine.physics

    @property
    def catalogue(self) -> Catalogue:
        """The quantities by name."""
        return catalogue(self.machine)

    def view(self, t: Array | float) -> View:
        """The machine at times `t` (N,) [s]."""
        times = seconds_of(t)
        return View.at(self.machine, self.motion, times, self.balance)

    def sample(self, t: Array | float, *names: str | Sequence[str]) -> Table:
        """Quantities at times `t` ([s], or texts with units), as arrays (N,) by name.

        Parameters
        ----------
        names : of the catalogue (``mechanism-sim quantities SCENE`` lists them), or all that begin
            so, as ``position``; without any: positions, velocities and accelerations of
            coordinates, gaps and contact forces, and where the scene has forces reactions of
            joints, efforts of drives and energies
        """
        known = self.catalogue
        chosen = known.choose(names) if names else known.shown(Shown.RUN)
        times = seconds_of(t)
        if len(times):
            return known.table(chosen, self.view(times))
        one = known.table(chosen, self.view(float(self.motion.curve.start[0])))
        return Table({name: x[:0] for name, x in one.items()}, one.units)

    def signal(self, sensor: str) -> Table:
        """Samples (N,) of a sensor of the scene, as of the node `sensors`, and their due times.

        The instrument is at rest at the start of the piece.

        Raises
        ------
        InputError
            If there is no such sensor, or it takes no sample.
        """
        known = self.machine.scene.sensors
        check_known(
            sensor, known, f'{self.machine.name} has no sensor {quoted(sensor)}', 'it has:'
        )
        channel = self.machine.channel(sensor)
        channel.take(self.motion)
        parts = list(channel.samples(final=True))
        channel.warn()
        if not parts:
            raise InputError(f'sensor {sensor} takes no sample in this run')
        t, samples, _ = (np.concatenate(x) for x in zip(*parts, strict=True))
        return signal_table(t, sensor, samples, known[sensor].unit)

    def to_frame(
        self,
        *names: str | Sequence[str],
        rate: float | str | None = None,
        library: str | None = None,
    ) -> Any:
        """A data frame of `sample`, evenly over the motion, or where a sensor takes samples.

        >>> import mechanism_sim as ms
        >>> solution = ms.simulate('slider_crank', duration='0.1 s')
        >>> frame = solution.to_frame('position', rate='20 Hz')
        >>> list(frame.columns), len(frame)
        (['t', 'position.crank', 'position.rod', 'position.piston'], 3)

        Parameters
        ----------
        names : as for `sample`; or sensors as well, ``acc`` or ``sensors.acc``, whose samples all
            are due at the same instants, at which the others are taken
        rate : samples a second; 1000 in all if not given; that of the sensors where there are some
        library : library, as for `Table.to_frame`
        """
        return self.framed(names, rate, self.signal).to_frame(library)

    def framed(
        self,
        names: Iterable[str | Sequence[str]],
        rate: float | str | None,
        signal: Callable[[str], Table],
    ) -> Table:
        """The columns of `to_frame`; `signal` gives those of a sensor."""
        asked = list(flat(names))
        sensors = {n: n.removeprefix(_SENSORS) for n in asked if self._is_sensor(n)}
        if sensors:
            # samples of sensors, and quantities when they are due
            if rate is not None:
                raise InputError(
                    f'rate: {next(iter(sensors.values()))} is sampled at a rate of its own'
                )
            signals = [signal(label) for label in sensors.values()]
            t, *others = (x['t'] for x in signals)
            for label, due in zip([*sensors.values()][1:], others, strict=True):
                if not np.array_equal(t, due):
                    raise InputError(
                        f'{label} is not sampled when {next(iter(sensors.values()))} is: make a '
                        'frame of each'
                    )
            quantities = [n for n in asked if n not in sensors]
            rest = self.sample(t, *quantities) if quantities else Table({}, {})
            columns, units = {'t': t}, {'t': 's'}
            for table in signals:
                label, unit = [*table.units.items()][1]
                key = _SENSORS + label if label in rest else label
                columns[key], units[key] = table[label], unit
            return Table(columns | dict(rest), units | dict(rest.units))
        first, last = float(self.motion.curve.start[0]), self.motion.curve.end
        own, t = argument('rate', rate, 'Hz'), np.linspace(first, last, 1000)
        if own is not None:
            if not 0.0 < own < math.inf:
                raise InputError(f'rate = {own:g} Hz: samples need a positive rate')
            count = int((last - first) * own * (1.0 + 1e-12)) + 1
            t = np.minimum(first + np.arange(count) / own, last)
        found = self.sample(t, *asked)
        return Table({'t': t, **found}, {'t': 's', **found.units})

    def _is_sensor(self, name: str) -> bool:
        """True for ``sensors.NAME``, and for the name of a sensor that is no quantity's."""
        known = self.catalogue
        own = name in self.machine.scene.sensors and not known.below(name)
        return own or name.startswith(_SENSORS)

    def plot(self, *names: str | Sequence[str], **how: Any) -> Any:
        """Plot quantities by the names of `sample`, or an overview; a Matplotlib figure.

        The keywords are those of `mechanism_sim.report.lines.plot`: ``against='angle'``, and
        ``start`` and ``end`` [s].
        """
        return plotting.plot(self, *names, **how)


@dataclass(frozen=True, eq=False)
class Solution(Piece):
    """A finished run, kept whole.

    Attributes
    ----------
    scene, level : names of the scene and of its level
    energy : the energy balance; ``None`` where masses are not part of the scene
    max_penetration, max_closure_error : largest violations of open gaps and of closures [m]
    snapshot : state from which a longer run continues, not later than the end
    derivatives : a `RunDerivative` by the path of each number of the scene that was asked for
    """

    scene: str
    level: str
    stats: Stats
    energy: Energy | None
    max_penetration: float
    max_closure_error: float
    stop_reason: StopReason
    snapshot: Snapshot
    derivatives: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return (
            f'<Solution of {self.scene} ({self.level}): {self.duration:.6g} s in '
            f'{len(self.motion)} steps, {len(self.impacts)} impacts>'
        )

    @property
    def duration(self) -> float:
        """Simulated time [s]."""
        return self.motion.curve.end


class Batch(NamedTuple):
    """Amount of integration between audits; motions do not depend on it."""

    steps: int
    stride: int  #: number of steps between checks of the time
    longest: float = math.inf  #: wall-clock time [s]


BATCH = Batch(8192, 8192)
"""Number of steps of a batch, which bounds the memory of a run."""


_MOST_STEPS = 1e11  # largest number of steps of a run: they take weeks

Observer = Callable[[Piece], object]
"""Function called with every piece of a run in order, such as ``digest.add``."""


class Runner:
    """A run of a machine, up to the last requested time.

    Parameters
    ----------
    engine : engine already started, instead of a new one
    resume : snapshot from which the run continues
    audited : True if its motion is that of the machine; a shooting method tries motions that may
        violate gaps, and asks for the audit of the one that it ends with
    together : steps that are audited at once where pieces have fewer: then work in pieces is not
        known before `balance` is asked for, and a run that fails does so some steps later
    """

    def __init__(
        self,
        machine: Machine,
        engine: Run | None = None,
        resume: Snapshot | None = None,
        audited: bool = True,
        together: int = 0,
    ) -> None:
        self.machine = machine
        #: integrator
        self.engine = engine or (machine.start() if resume is None else machine.resume(resume))
        self.audit = Audit(machine.physics)  #: energy balance of all pieces yielded so far
        #: time [s] up to which the motion is known, including a step held back
        self.known = self.engine.time
        #: True if further pieces follow the last one up to the requested time
        self.more = True
        self._audited, self._together = audited, together
        self._bends = BendWatch(machine.mechanism)
        self._entered: list[Piece] = []  # not audited yet
        self._judged = self.engine.steps  # when it was last judged
        self._balance = EnergyTerms(Work(*np.zeros((len(Work._fields), 0))), [])

    def to(
        self,
        until: float,
        observers: Iterable[Observer] = (),
        final: bool = True,
        batch: Batch | None = None,
        held: Callable[[], object] | None = None,
    ) -> Iterator[Piece]:
        """Run to a time [s]; yields at least one piece, which may be empty.

        Parameters
        ----------
        observers : called with every piece before it is handed on
        final : True if the last step is cut off there; else it is held back, for what comes later
            may need it whole
        batch : sizes of batches; default: `BATCH`
        held : called before the last step is cut off

        Raises
        ------
        InputError
            If it would take more steps than a computer does in weeks.
        RunError
            If the integration breaks down, or the motion violates a gap or the energy balance.
        """
        if isinstance(self.engine, EventLoop) and not math.isinf(until):  # steps have a length
            longest = self.engine.longest
            if (until - self.engine.time) / longest > _MOST_STEPS:
                raise InputError(
                    f'{self.machine.name}: {until:.6g} s take more than {_MOST_STEPS:.0e} steps, '
                    f'of {longest:.3g} s at most: give a shorter duration, or a faster drive'
                )
        self.more = True
        while self.more:
            # warn of a run that is long, as by an oil film, and end one that comes to no end
            engine = self.engine
            if isinstance(engine, EventLoop) and math.isfinite(until):
                # nodes ask for parts of a run, as far as laws are known
                horizon = until if final else max(until, self.machine.scene.duration or 0.0)
                if said := engine.films.look(engine.steps, horizon, final):
                    self._warn(said)
            whole = final and held is None
            with self._bent():
                more = self._integrate(until, whole, batch or BATCH)
                self.more = more and self.engine.time < until
                if held and not self.more:
                    held()
                    self.engine.advance(until, final)
                self.known = self.engine.time if self.more or final else until
                piece = self._piece(final and not self.more)
            for said in self._bends.look(piece.motion):
                self._warn(said)
            for observe in observers:
                observe(piece)
            yield piece

    def _warn(self, said: str) -> None:
        warnings.warn(f'{self.machine.name}: {said}', RunWarning, stacklevel=3)

    @contextmanager
    def _bent(self) -> Iterator[None]:
        """Describe earlier trouble of a run that fails, or too large a bending of its links."""
        try:
            yield
        except RunError as error:
            engine = self.engine
            if not isinstance(engine, EventLoop):
                raise
            self.machine.physics.check_directions(engine.drain()[0])
            known = dict(zip(self.machine.equations.system.free, engine.state.q, strict=True))
            q = [known.get(c, 0.0) for c in self.machine.mechanism.coordinates]
            if said := self._bends.now(np.array(q)):
                raise RunError(f'{error}; {said}') from error
            raise

    def _integrate(self, until: float, final: bool, batch: Batch) -> bool:
        """Take the steps of a batch; returns True if more follow."""
        engine, began = self.engine, time.monotonic()
        first = engine.steps
        while True:
            before = engine.steps
            engine.advance(until, final, batch.stride)
            if engine.steps - before < batch.stride:
                return False
            long = time.monotonic() - began > batch.longest
            if long or engine.steps - first >= batch.steps:
                return True

    def _piece(self, last: bool) -> Piece:
        """Piece of all steps since the last one, audited if due."""
        motion, impacts, changes = self.engine.drain()
        unknown = Work(*np.full((len(Work._fields), len(motion)), np.nan))
        piece = Piece(self.machine, motion, EnergyTerms(unknown, impacts), impacts, changes)
        if not self._audited:
            return piece
        self._entered.append(piece)
        waits = self._together and self.engine.steps - self._judged < self._together
        if waits and not last:
            return piece
        balance, self._judged = self.balance(), self.engine.steps
        self.audit.judge(allowed_penetration(self.machine))
        return replace(piece, balance=balance)

    def balance(self) -> EnergyTerms:
        """Work and losses of the last piece; audits it, and those before it that are not yet."""
        if not self._entered:
            return self._balance
        pieces, self._entered, first = self._entered, [], 0
        impacts = Impacts.joined(piece.impacts for piece in pieces)
        work = self.audit.add(Motion.joined([piece.motion for piece in pieces]), impacts)
        for piece in pieces:  # piece by piece, so that sums do not depend on what is audited when
            end = first + len(piece.motion)
            own = Work(*(x[first:end] for x in work))
            self._balance = EnergyTerms(own, piece.impacts, *self._balance.after)
            first = end
        return self._balance


def is_loss(change: ModeChange) -> bool:
    """True if a contact is lost; false of a mode that is announced when a run begins."""
    return change.mode == Mode.FREE_FLIGHT and change.previous > Mode.FREE_FLIGHT


def allowed_penetration(machine: Machine) -> float:
    """Violation of a gap [m] within tolerance or rounding; beyond it a run fails."""
    solver = machine.scene.solver
    allowed = max(1e3 * solver.rtol * machine.mechanism.size, solver.atol, 1e-12)
    return min([allowed, *(0.1 * c.radial for c in machine.plan.clearances.values() if c.radial)])


def run(
    machine: Machine,
    until: float,
    observers: Iterable[Observer] = (),
    *,
    resume: Snapshot | None = None,
) -> Iterator[Piece]:
    """A run up to a time [s], piece by piece; see `Runner` for one in several parts."""
    return Runner(machine, resume=resume).to(until, observers)


def prepare(machine: Machine) -> None:
    """Compile all that a run will need, so that it does not wait later."""
    runner = Runner(machine)
    if isinstance(runner.engine, EventLoop):
        runner.engine.compile()
    next(runner.to(1e-6 * min(machine.drive.period, 1.0), batch=Batch(1, 1)))


def part_of(
    first: float, last: float, start: float | str | None, end: float | str | None
) -> tuple[float, float]:
    """Start and end [s] of a part of a run from `first` to `last`; those where they are None."""
    start, end = argument('start', start, 's'), argument('end', end, 's')
    begin, finish = (first if start is None else start), (last if end is None else end)
    slack = 1e-9 * max(1.0, last)
    if not first - slack <= begin < finish <= last + slack:
        raise InputError(
            f'from {begin:g} s to {finish:g} s is not within the run, which goes from {first:g} s '
            f'to {last:g} s'
        )
    return max(begin, first), min(finish, last)


def instants(
    piece: Piece, start: float, end: float, density: Array | float, fewest: int, most: int,
    events: int | None = None, steps: bool = False,
) -> Array:  # fmt: skip
    """Times (N,) [s] from `start` to `end`, both included; none twice.

    Parameters
    ----------
    density : density of instants [1/s], uniform or (S + 1,) at the ends of steps
    fewest, most : limits of the number of instants beside those at events
    events : largest number of events, the hardest impacts first, then changes of mode
    steps : True if the ends of steps are included
    """
    curve = piece.motion.curve
    if isinstance(density, float):
        marks, dense = np.array([start, end]), np.full(2, density or 1.0)
    else:
        marks, dense = np.append(curve.start, curve.end), density
    passed = np.append(0.0, np.cumsum(0.5 * (dense[1:] + dense[:-1]) * np.diff(marks)))
    count = int(np.clip(int(passed[-1]) + 1, fewest, most))
    even = np.interp(np.linspace(0.0, passed[-1], count), passed, marks)
    hardest = np.argsort(-piece.impacts.column('normal_impulse'), kind='stable')
    at = np.append(piece.impacts.column('t')[hardest], [c.t for c in piece.modes])[:events]
    marked = np.concatenate([np.nextafter(at, -np.inf), at, *([curve.start] if steps else [])])
    t = np.union1d(even, marked[(marked > start) & (marked <= end)])
    return np.unique(np.clip(t, curve.start[0], curve.end))
