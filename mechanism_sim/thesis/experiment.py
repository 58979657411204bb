"""The experiment of [SB] chapters 7 and 8 on recorded runs: measured and true quantities.

A four-bar, loose between coupler and rocker, carries accelerometers across these links. Its runs
differ in speed, clearance and bearing, and in their start. Without friction or oil the motion is
chaotic: figures of a single run differ for another start, or another processor. So figures
are means over starts, with the confidence interval of Student's t.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.analysis.deviation import deviation, ideal_machine
from mechanism_sim.analysis.record import Record, read_record
from mechanism_sim.analysis.roses import ImpactCycles, Rose, impact_cycles, impact_rose
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.batch_means import quotient, ratio
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from mechanism_sim.scene.load import started_at
from mechanism_sim.sensing.chain import Instrument
from mechanism_sim.thesis.reconstruction import Error
from mechanism_sim.thesis.swing import (
    LINKS,
    MESHES,
    LinkMotion,
    Reconstruction,
    Severity,
    TurningLink,
    all_samples,
    has_high_pass,
    sensors_across,
    steps,
    swings,
    under_limit,
)

JOINT = 'coupler_rocker'
CONFIDENCE = 0.99
"""Of all intervals of the experiment.

Its tables hold some 600 of them, and each is held against those of other conditions and, on
another processor, of the same. Of two means with the same expectation the intervals of 95 % miss
one another in 5 of 1,000 cases, which are three figures of such a page; those of 99 % in 3 of
10,000.
"""
MESH = MESHES[-1]
"""[deg] of the crank: what cycles are drawn with, and alpha is made of."""
QUANTITIES = 'acceleration', 'velocity'
_AT_FIRST = 4  # turns from the first impact


class BearingContact(NamedTuple):
    """Contact between pin and bushing."""

    restitution: float
    friction: float
    viscosity: float = 0.0  #: viscosity of an oil film [Pa s]; 0 for a dry bearing

    def __str__(self) -> str:
        if self.viscosity:
            return f'oil film of {1e3 * self.viscosity:.4g} mPa s'
        return f'restitution {self.restitution:g}, friction {self.friction:g}'


def rpm(speed: float) -> str:
    """Format a speed [rad/s] in rpm, without unit."""
    return f'{speed * 30.0 / math.pi:.4g}'


def mm(radial: float) -> str:
    """Format a clearance [m] in mm, without unit."""
    return f'{1e3 * radial:.4g}'


class Condition(NamedTuple):
    """Condition of a run of the experiment, apart from its start."""

    speed: float  #: speed of the crank [rad/s]
    radial: float  #: radial clearance [m]
    bearing: BearingContact

    @property
    def place(self) -> str:
        """Speed and clearance in words."""
        return f'{rpm(self.speed)} rpm, clearance {mm(self.radial)} mm'

    def __str__(self) -> str:
        return f'{self.place}, {self.bearing}'


def pace(speed: float) -> tuple[float, float]:
    """Key that sorts speeds by their magnitude, clockwise before counterclockwise."""
    return abs(speed), speed


class Interval(NamedTuple):
    """A mean, and half of its confidence interval (`CONFIDENCE`); nan if undefined."""

    mean: float
    half_width: float

    @classmethod
    def over(cls, values: Sequence[float] | Array) -> Interval:
        """Interval of the mean of independent values; without width for a single value."""
        return cls.of_ratio(np.asarray(values, float), np.ones(len(values)))

    @classmethod
    def of_ratio(cls, x: Array, per: Array) -> Interval:
        """Interval of the ratio of the sums of paired values."""
        return cls(*ratio(x, per, CONFIDENCE))

    @classmethod
    def of_quotient(cls, x: Array, y: Array) -> Interval:
        """Interval of the ratio of the means of independent values."""
        return cls(*quotient(x, y, CONFIDENCE))

    @property
    def low(self) -> float:
        """Lower end of the interval."""
        return self.mean - self.half_width

    @property
    def high(self) -> float:
        """Upper end of the interval."""
        return self.mean + self.half_width

    def above(self, other: Interval) -> bool:
        """True if the whole interval is above another; False if either has no width."""
        return self.low > other.high


class Errors(NamedTuple):
    """Errors of a reconstruction, relative to the instrument's ideal reading and to the truth."""

    of_shown: Error
    of_truth: Error


@dataclass(frozen=True, eq=False)
class CrankTurn:
    """A turn of the crank in steps of `MESH`."""

    #: crank angle in the middle of the steps [deg], decreasing for clockwise rotation
    angle: Array
    #: (2, n) of coupler and rocker, accelerations as means over the steps
    acceleration: Array
    velocity: Array
    #: (2, n) force of the coupler on the rocker [N], with impulses spread over their step
    force: Array
    torque: Array  #: (n,) torque of the drive [N m], with impulses spread over their step
    nominal: Array  #: (7, n) all of these for the ideal mechanism, in this order

    @property
    def rows(self) -> Array:
        """Accelerations, velocities, force and torque: (7, n)."""
        return np.vstack([self.acceleration, self.velocity, self.force, self.torque])

    def modified(self, alpha: float) -> Array:
        """Rows (7, n) with deviations from the ideal divided by alpha ([SB] 8.1)."""
        return np.asarray(self.nominal + (self.rows - self.nominal) / alpha)


@dataclass(frozen=True, eq=False)
class Trial:
    """One run of the experiment, after its first turns."""

    bag: Path
    machine: Machine
    condition: Condition
    start: float  #: crank angle at the start [rad]
    sample_rate: float
    turns: tuple[int, int]  #: first analysed turn of the crank, and the end
    at_first: tuple[int, int]  #: first turn with an impact, and the end of the first turns from it
    #: severity by link, in `turns` and in `at_first`
    severity: Mapping[str, Severity]
    severity_at_first: Mapping[str, Severity]
    #: errors of angular accelerations and velocities, by (quantity, link) and method
    errors: Mapping[tuple[str, str], Mapping[str, Errors]]
    overloads: int  #: number of samples clipped at the range of their converters
    #: motion by link; only for the first of several starts, to save memory
    swings: Mapping[str, LinkMotion]
    #: impacts in `turns`
    rose: Rose
    impacts: ImpactCycles
    every: ImpactCycles  #: impacts of all turns, by turn
    first: CrankTurn  #: quantities of the first turn with an impact

    @property
    def turns_since_first(self) -> int:
        """Number of whole turns from the first one with an impact."""
        return len(self.every.count) - (self.at_first[0] - self.every.first)

    def since_first(self, turns: tuple[int, int]) -> TurnSums:
        """Impacts in some turns, counted from the first one with an impact."""
        offset = self.at_first[0] - self.every.first
        part = slice(offset + turns[0], offset + turns[1])
        return TurnSums(self.every.count[part], self.every.impulse[part])


@dataclass(frozen=True, eq=False)
class TurnSums:
    """Number of impacts and sum of their impulses [N s], by turn."""

    count: NDArray[np.int64]
    impulse: Array


class IdealRuns:
    """The mechanism without clearance, simulated once for all runs of a speed and a start."""

    def __init__(self) -> None:
        self._records: dict[tuple[str, float], Record] = {}
        self._samples: dict[tuple[str, float, str, Instrument], Array] = {}

    def record(self, of: Record) -> Record:
        """Run of the ideal mechanism over the duration of another run."""
        machine = ideal_machine(of.machine)
        key = machine.fingerprint, of.end
        if key not in self._records:
            self._records[key] = Record(machine, simulate(machine, duration=of.end), {})
        return self._records[key]

    def samples(self, ideal: Record, link: str, instrument: Instrument) -> Array:
        """Samples of a link's angular acceleration by an instrument, from the start of the run."""
        key = ideal.machine.fingerprint, ideal.end, link, instrument
        if key not in self._samples:
            mount = TurningLink(ideal.machine.mechanism, link)
            motion = ideal.piece.motion
            self._samples[key] = all_samples(mount, instrument, link, motion)[0]
        return self._samples[key]


def trial(bag: Path, skip: int | None = None, ideals: IdealRuns | None = None) -> Trial:
    """The experiment on the run in a bag.

    Parameters
    ----------
    skip : number of whole crank turns left out; default: the first half
    ideals : ideal runs of earlier trials, to avoid repeated simulations
    """
    record = read_record(bag)
    machine = record.machine
    condition = _condition(bag, machine)
    first, last = record.turns
    left_out = (last - first) // 2 if skip is None else skip
    try:
        begin, end = record.whole_turns(left_out)
    except InputError as error:
        raise InputError(f'{bag}: {error}') from error
    known = ideals or IdealRuns()
    ideal = known.record(record)
    every = impact_cycles(record, impact_rose(record, JOINT))
    struck = first + int(np.argmax(every.count > 0))
    at_first = struck, min(struck + _AT_FIRST, last)
    try:
        found = swings(
            record,
            lambda link, chain: known.samples(ideal, link, chain),
            (begin, end),
            at_first,
        )
    except InputError as error:
        raise InputError(f'{bag}: {error}') from error
    rose = impact_rose(record, JOINT, left_out)
    return Trial(
        bag,
        machine,
        condition,
        machine.drive.start[0],
        next(iter(sensors_across(machine, 'coupler').values())).sample_rate,
        (begin, end),
        at_first,
        {link: x.severity for link, x in found.items()},
        {link: x.severity_at_first for link, x in found.items()},
        _errors((link, x.accelerations, x.velocities) for link, x in found.items()),
        sum(x.overloads for x in found.values()),
        found,
        rose,
        impact_cycles(record, rose, left_out),
        every,
        _cycle(record, ideal, struck),
    )


def _errors(
    found: Iterable[tuple[str, Mapping[str, Reconstruction], Mapping[str, Reconstruction]]],
) -> dict[tuple[str, str], dict[str, Errors]]:
    return {
        (quantity, link): {n: Errors(e.error_of_shown, e.error) for n, e in estimates.items()}
        for link, *both in found
        for quantity, estimates in zip(QUANTITIES, both, strict=True)
    }


def _condition(bag: Path, machine: Machine) -> Condition:
    if not machine.assembly.loop or JOINT not in machine.plan.clearances:
        raise InputError(
            f'{bag}: the experiment is that of a four_bar of rigid links whose joint {JOINT} has '
            'clearance'
        )
    spec = machine.plan.clearances[JOINT]
    if machine.torque_driven or not machine.drive.steady:
        raise InputError(f'{bag}: the experiment is that of a crank at constant speed')
    viscosity = 0.0
    if spec.contact and spec.film:
        viscosity = spec.contact.viscosity or 0.0
    bearing = BearingContact(spec.restitution, spec.friction, viscosity)
    return Condition(machine.drive.start[1], spec.radial, bearing)


def _cycle(record: Record, ideal: Record, turn: int) -> CrankTurn:
    machine, curve = record.machine, record.piece.motion.curve
    edges = steps(record, (turn, turn + 1), MESH)
    middle, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    own = record.piece.sample(middle)
    rows = [machine.physics.coordinates.index(link) for link in LINKS]
    force = np.array([own[f'reaction.{JOINT}.{axis}'] for axis in 'xy'])
    torque = np.array(own['drive_torque'])
    for impact in record.piece.impacts:
        if edges[0] <= impact.t < edges[-1]:
            k = int(np.searchsorted(edges, impact.t, side='right')) - 1
            n = np.array([np.cos(impact.normal_angle), np.sin(impact.normal_angle)])
            pushed = impact.normal_impulse * n
            pushed -= impact.tangential_impulse * np.array([-n[1], n[0]])
            force[:, k] += pushed / width[k]
            torque[k] += impact.drive_impulse / width[k]
    q, v = curve(middle), curve(middle, 1)
    linkage = machine.nominal.linkage
    _, speed, acceleration = linkage.motion(q[:, 0], v[:, 0], np.zeros(len(middle)))
    without = ideal.piece.sample(middle)
    nominal = np.vstack(
        [
            acceleration[rows],
            speed[rows],
            [without[f'reaction.{JOINT}.{axis}'] for axis in 'xy'],
            without['drive_torque'],
        ]
    )
    travelled = np.asarray((np.arange(len(middle)) + 0.5) * MESH, float)
    return CrankTurn(
        travelled if record.sense > 0.0 else 360.0 - travelled,
        (np.diff(curve(edges, 1), axis=0) / width[:, None]).T[rows],
        v.T[rows],
        force,
        torque,
        nominal,
    )


@dataclass(frozen=True, eq=False)
class Repeats:
    """Runs of one condition with different starts."""

    trials: Sequence[Trial]

    @property
    def condition(self) -> Condition:
        """Common condition of the runs."""
        return self.trials[0].condition

    @property
    def first(self) -> Trial:
        """The first run, which is drawn."""
        return self.trials[0]

    def mean(self, figure: Callable[[Trial], float]) -> Interval:
        """Mean of a figure over the starts; without interval for a single start."""
        return Interval.over([figure(x) for x in self.trials])

    def shown(self, link: str = 'coupler') -> Interval:
        """Measured deviation of the angular acceleration of a link."""
        return self.mean(lambda x: x.severity[link].heard)

    def impacts(self, name: str, turns: tuple[int, int] | None = None) -> Interval:
        """``count`` or ``impulse`` a turn, or ``I_n``, in the turns analysed or in others.

        The interval is that over the starts; for a single start that over batches of turns.

        Parameters
        ----------
        turns : first turn and end, counted from the first turn with an impact
        """
        spans = [x.impacts if turns is None else x.since_first(turns) for x in self.trials]
        if len(spans) == 1 and turns is None:
            count, impulse = spans[0].count.astype(float), spans[0].impulse
        else:
            count, impulse = np.array([(x.count.mean(), x.impulse.mean()) for x in spans]).T
        if name == 'I_n':
            return Interval.of_ratio(impulse, count)
        return Interval.over(count if name == 'count' else impulse)

    def times(self, figure: Callable[[Trial], float], other: Repeats,
              of: Callable[[Trial], float]) -> Interval:  # fmt: skip
        """Ratio of the mean of a figure of these runs to that of a figure of other runs.

        Two figures of the same runs are paired; other runs are independent.
        """
        here, there = (
            np.array([f(x) for x in side.trials]) for side, f in ((self, figure), (other, of))
        )
        return (Interval.of_ratio if other is self else Interval.of_quotient)(here, there)


@dataclass(frozen=True, eq=False)
class Experiment:
    """All runs of the experiment.

    The measured machine is that with the bearing of most runs. It is compared with
    the others at the highest speed and, there, the largest clearance.
    """

    groups: Sequence[Repeats]  #: runs by condition
    #: errors by lower limit of the amplifiers [Hz] and condition, for each start: see
    #: `with_limits`
    limits: Mapping[tuple[float, Condition], Sequence[_LimitErrors]] | None = None
    #: alpha by multiple of the speed of the crank: see `with_orders`
    orders: Sequence[Interval] | None = None

    @property
    def trials(self) -> list[Trial]:
        """All runs, of all conditions."""
        return [x for group in self.groups for x in group.trials]

    @cached_property
    def counted(self) -> Counter[BearingContact]:
        """Numbers of runs by bearing."""
        return Counter(x.condition.bearing for x in self.trials)

    @cached_property
    def bearing(self) -> BearingContact:
        """Bearing with the most runs, taken as the measured one; the first read of equals."""
        return self.counted.most_common(1)[0][0]

    @cached_property
    def measured(self) -> dict[tuple[float, float], Repeats]:
        """Runs of the measured machine by speed [rad/s] and clearance [m], in ascending order."""
        return self.places(self.bearing)

    def places(self, bearing: BearingContact) -> dict[tuple[float, float], Repeats]:
        """Runs of a bearing by speed [rad/s] and clearance [m], in ascending order."""
        found = {x.condition[:2]: x for x in self.groups if x.condition.bearing == bearing}
        return dict(sorted(found.items(), key=lambda x: (*pace(x[0][0]), x[0][1])))

    @property
    def speeds(self) -> list[float]:
        """Speeds of the runs [rad/s], the slowest first."""
        return sorted({speed for speed, _ in self.measured}, key=pace)

    @property
    def clearances(self) -> list[float]:
        """Clearances of the runs [m]."""
        return sorted({radial for _, radial in self.measured})

    @property
    def reference(self) -> Repeats:
        """Runs of the measured machine at the highest speed, with the largest clearance."""
        return [*self.measured.values()][-1]

    @property
    def bearings(self) -> list[Repeats]:
        """Runs there by bearing: dry ones first, friction rising and restitution falling."""
        here = self.reference.condition[:2]
        return sorted(
            (x for x in self.groups if x.condition[:2] == here),
            key=lambda x: (
                x.condition.bearing.viscosity,
                x.condition.bearing.friction,
                -x.condition.bearing.restitution,
            ),
        )

    @property
    def assumed(self) -> Repeats:
        """Bearing nearest to the assumptions of [SB]: dry, no friction, restitution 1."""
        return self.bearings[0]

    def alpha(self, of: Repeats | None = None) -> Interval:
        """Factor alpha of [SB] 8.1 between the assumed and a measured machine on the coupler.

        Ratio of the deviation of the assumed machine in its first turns with
        impacts, as means over steps of `MESH`, to the deviation measured on the other.

        Parameters
        ----------
        of : the measured machine; `reference` by default
        """
        return self.assumed.times(
            lambda x: x.severity_at_first['coupler'].by_mesh[-1],
            of or self.reference,
            lambda x: x.severity['coupler'].heard,
        )


_LimitErrors = Mapping[tuple[str, str], Mapping[str, Errors]]
"""Errors by (quantity, link) and method."""

LIMITS = 2.0, 0.2
"""[Hz] lower limits of the Brüel & Kjær 2635 for acceleration. [SB] does not say which was set."""


def with_limits(found: Experiment, limits: Sequence[float] = LIMITS) -> Experiment:
    """The experiment, with errors of reconstructions for each lower limit of the amplifiers.

    At the lowest and the highest speed, with the largest clearance; nowhere if a sensor has
    no high-pass at all.
    """
    speeds = found.speeds
    chosen = {speed: max(c for s, c in found.measured if s == speed) for speed in
              (speeds[0], speeds[-1])}  # fmt: skip
    errors: dict[tuple[float, Condition], list[_LimitErrors]] = {}
    for place in chosen.items():
        group = found.measured[place]
        if not has_high_pass(group.first.machine):
            return found
        for one in group.trials:
            record = read_record(one.bag)
            for limit in limits:
                under = under_limit(record, one.turns, limit)
                errors.setdefault((limit, group.condition), []).append(
                    _errors((link, *both) for link, both in under.items())
                )
    return replace(found, limits=errors)


ORDERS = 12


def with_orders(found: Experiment) -> Experiment:
    """The experiment, with alpha in bands of one order, by the sensor on the coupler.

    For the assumed and the measured machine in the same turns; its scatter shows whether
    one response is a multiple of the other.
    """
    if found.assumed is found.reference:
        return found
    over, under = (
        np.array([_order_amplitudes(x) for x in group.trials]).T
        for group in (found.assumed, found.reference)
    )
    return replace(
        found, orders=[Interval.of_quotient(*pair) for pair in zip(over, under, strict=True)]
    )


def _order_amplitudes(of: Trial) -> Array:
    """Amplitudes (12,) of the deviation measured on the coupler, by order."""
    record = read_record(of.bag)
    sensor = next(iter(sensors_across(record.machine, 'coupler')))
    shown = deviation(record, sensor, skip=of.turns[0] - record.turns[0])
    return np.asarray(np.sqrt(shown.order_power(shown.segment)[:ORDERS]))


def bags_of(folders: Sequence[Path]) -> list[Path]:
    """The bags in some folders, by name."""
    found = []
    for folder in folders:
        bags = sorted(folder.glob('*.mcap')) if folder.is_dir() else []
        if not bags:
            raise InputError(
                f"'{folder}' has no bags (*.mcap); 'mechanism-sim sweep thesis_measurement --bags "
                f"{folder}' makes those of the thesis"
            )
        found += bags
    return found


def read_experiment(
    bags: Sequence[Path],
    skip: int | None = None,
    show: Callable[[int, int], None] | None = None,
) -> Experiment:
    """An experiment from bags; those of one condition are runs from several starts.

    Parameters
    ----------
    skip : number of turns left out, as for `trial`
    show : callback with the number of bags read, and 0
    """
    groups: dict[Condition, list[Trial]] = {}
    ideals = IdealRuns()
    for n, bag in enumerate(bags, 1):
        found = trial(bag, skip, ideals)
        here = groups.setdefault(found.condition, [])
        for other in here:
            # runs of a condition differ in their start only
            if found.machine.fingerprint == other.machine.fingerprint:
                raise InputError(
                    f'{bag}: the machine, its condition ({found.condition}) and its start are '
                    f'those of {other.bag}, too'
                )
            anywhere = [started_at(x.machine, 0.0).fingerprint for x in (found, other)]
            if anywhere[0] != anywhere[1]:
                raise InputError(
                    f'{bag}: speed, clearance and bearing are those of {other.bag} '
                    f'({found.condition}), but the machines differ in more than the angle of the '
                    'crank at the start: they are not runs of one experiment'
                )
        # curves are drawn for the first start only
        here.append(replace(found, swings={}) if here else found)
        if show:
            show(n, 0)
    return Experiment([Repeats(found) for found in groups.values()])
