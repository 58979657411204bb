"""The experiment of [SB] chapters 7 and 8 on recorded runs: what is measured, and what is true.

A four-bar, loose between coupler and rocker, carries accelerometers across these links. Its runs
differ in speed, clearance, restitution and friction.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mechanism_sim.analysis.angular_reconstruction import LINKS
from mechanism_sim.analysis.deviation import ideal_record
from mechanism_sim.analysis.record import Record, read_record
from mechanism_sim.analysis.roses import ImpactCycles, Rose, impact_cycles, impact_rose
from mechanism_sim.analysis.swing import MESHES, Swing, sensors_across, steps, swing
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.scene import Machine

JOINT = 'coupler_rocker'
MESH = MESHES[-1]
"""[deg] of the crank: what cycles are drawn with, and alpha is made of."""
_AT_FIRST = 4  # turns


class Condition(NamedTuple):
    """What differs between the runs of the experiment."""

    speed: float  #: of the crank [rad/s]
    radial: float  #: clearance [m]
    restitution: float
    friction: float


@dataclass(frozen=True, eq=False)
class Cycle:
    """A turn of the crank in steps of `MESH`.

    Attributes
    ----------
    angle : of the crank in the middle of the steps [deg]
    acceleration, velocity : of coupler and rocker (2, n), accelerations as means over the steps
    force : of the coupler on the rocker (2, n) [N], with impulses spread over their step
    torque : of the drive (n,) [N m], likewise
    nominal : all six of the ideal mechanism, in that order (7, n)
    """

    angle: Array
    acceleration: Array
    velocity: Array
    force: Array
    torque: Array
    nominal: Array

    @property
    def rows(self) -> Array:
        """Accelerations, velocities, force and torque: (7, n)."""
        return np.vstack([self.acceleration, self.velocity, self.force, self.torque])

    def modified(self, alpha: float) -> Array:
        """The same (7, n), deviations from the ideal divided by alpha ([SB] 8.1)."""
        return np.asarray(self.nominal + (self.rows - self.nominal) / alpha)


@dataclass(frozen=True, eq=False)
class Trial:
    """One run of the experiment, after its first turns.

    Attributes
    ----------
    turns : of the crank that are analysed: from, and up to
    at_first : the first turn with an impact, and up to which those that follow it are counted
    swings : by link
    rose, impacts : of these turns
    every : impacts of all turns, turn by turn
    first : the first turn with an impact
    """

    bag: str
    machine: Machine
    condition: Condition
    sample_rate: float
    turns: tuple[int, int]
    at_first: tuple[int, int]
    swings: Mapping[str, Swing]
    rose: Rose
    impacts: ImpactCycles
    every: ImpactCycles
    first: Cycle


def trial(bag: Path, skip: int | None = None) -> Trial:
    """The experiment on the run in a bag.

    Parameters
    ----------
    skip : whole turns of the crank that are left out; the first half of them unless told

    Raises
    ------
    InputError
        If it is another machine, its crank is not steady, or a link has no sensor across it.
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
    ideal = ideal_record(record)
    every = impact_cycles(record, impact_rose(record, JOINT))
    struck = first + int(np.argmax(every.count > 0))
    at_first = struck, min(struck + _AT_FIRST, last)
    try:
        swings = {
            link: swing(record, ideal.piece.motion, link, (begin, end), at_first) for link in LINKS
        }
    except InputError as error:
        raise InputError(f'{bag}: {error}') from error
    rose = impact_rose(record, JOINT, left_out)
    return Trial(
        bag.name,
        machine,
        condition,
        next(iter(sensors_across(machine, 'coupler').values())).sample_rate,
        (begin, end),
        at_first,
        swings,
        rose,
        impact_cycles(record, rose, left_out),
        every,
        _cycle(record, ideal, struck),
    )


def _condition(bag: Path, machine: Machine) -> Condition:
    if not machine.closed_form or JOINT not in machine.clearances:
        raise InputError(
            f'{bag}: the experiment is that of a four_bar of rigid links whose joint {JOINT} has '
            'clearance'
        )
    play = machine.clearances[JOINT]
    if len(machine.laws) > 1 or machine.torque_driven:
        raise InputError(f'{bag}: the experiment is that of a crank at constant speed')
    return Condition(machine.start_of_crank[1], play.radial, play.restitution, play.friction)


def _cycle(record: Record, ideal: Record, turn: int) -> Cycle:
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
    _, speed, acceleration = machine.linkage.motion(q[:, 0], v[:, 0], np.zeros(len(middle)))
    without = ideal.piece.sample(middle)
    nominal = np.vstack(
        [
            acceleration[rows],
            speed[rows],
            [without[f'reaction.{JOINT}.{axis}'] for axis in 'xy'],
            without['drive_torque'],
        ]
    )
    return Cycle(
        np.asarray((np.arange(len(middle)) + 0.5) * MESH, float),
        (np.diff(curve(edges, 1), axis=0) / width[:, None]).T[rows],
        v.T[rows],
        force,
        torque,
        nominal,
    )


@dataclass(frozen=True, eq=False)
class Experiment:
    """All runs of the experiment.

    The machine that is measured is that whose restitution and friction most of the runs have. It
    is compared with the others at the highest speed and, there, the largest clearance.
    """

    trials: Sequence[Trial]

    @cached_property
    def bearing(self) -> tuple[float, float]:
        """Restitution and friction of the machine that is measured."""
        counted = Counter((x.condition.restitution, x.condition.friction) for x in self.trials)
        return counted.most_common(1)[0][0]

    @cached_property
    def measured(self) -> dict[tuple[float, float], Trial]:
        """The runs of that machine by speed [rad/s] and clearance [m], in rising order."""
        chosen = {
            x.condition[:2]: x
            for x in self.trials
            if (x.condition.restitution, x.condition.friction) == self.bearing
        }
        return dict(sorted(chosen.items()))

    @property
    def speeds(self) -> list[float]:
        """At which it was run [rad/s]."""
        return sorted({speed for speed, _ in self.measured})

    @property
    def clearances(self) -> list[float]:
        """With which it was run [m]."""
        return sorted({radial for _, radial in self.measured})

    @property
    def reference(self) -> Trial:
        """The run at the highest speed, there with the largest clearance."""
        return self.measured[max(self.measured)]

    @property
    def bearings(self) -> list[Trial]:
        """The runs at its speed and clearance, restitution falling and friction rising."""
        here = self.reference.condition[:2]
        return sorted(
            (x for x in self.trials if x.condition[:2] == here),
            key=lambda x: (x.condition.friction, -x.condition.restitution),
        )

    @property
    def assumed(self) -> Trial:
        """Of these the one nearest to what [SB] assumes: no friction, restitution 1."""
        return self.bearings[0]

    @property
    def alpha(self) -> float:
        """What [SB] 8.1 would find between the two on the coupler.

        How many times as large the deviation of the assumed machine is in its first turns with
        impacts, as means over steps of `MESH`, as what the instrument shows of the measured one.
        """
        shown = self.reference.swings['coupler'].severity.heard
        return self.assumed.swings['coupler'].severity_at_first.by_mesh[-1] / shown


def bags_of(folder: Path) -> list[Path]:
    """The bags in a folder, by name.

    Raises
    ------
    InputError
        If there are none.
    """
    bags = sorted(folder.glob('*.mcap')) if folder.is_dir() else []
    if not bags:
        raise InputError(
            f"'{folder}' has no bags (*.mcap); 'mechanism-sim sweep thesis_measurement --bags "
            f"{folder}' makes those of the thesis"
        )
    return bags


def read_experiment(
    bags: Sequence[Path],
    skip: int | None = None,
    show: Callable[[int, int], None] | None = None,
) -> Experiment:
    """Some bags as an experiment.

    Parameters
    ----------
    skip : as for `trial`
    show : called with the number of bags read, and 0

    Raises
    ------
    InputError
        If two are of the same conditions, or as for `trial`.
    """
    trials: dict[Condition, Trial] = {}
    for n, bag in enumerate(bags, 1):
        found = trial(bag, skip)
        if found.condition in trials:
            raise InputError(
                f'{bag}: speed, clearance, restitution and friction are those of '
                f'{trials[found.condition].bag}, too'
            )
        trials[found.condition] = found
        if show:
            show(n, 0)
    return Experiment(list(trials.values()))
