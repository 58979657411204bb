"""The experiment of [SB] chapters 7 and 8 on a recorded run: what is measured, and what is true.

A loose four-bar carries accelerometers across its coupler and its rocker. Their signals follow
from the recorded motion, exactly, through the chain that the scene gives them; angular
accelerations and velocities are reconstructed from these as [SB] did, and better.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.analysis.deviation import ideal_record
from mechanism_sim.analysis.record import Record, read_record
from mechanism_sim.analysis.roses import ImpactCycles, Rose, impact_cycles, impact_rose
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.tape import Motion
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.scene import Machine
from mechanism_sim.scene.schema import FourBarScene
from mechanism_sim.scene.sensor_keys import Sensor
from mechanism_sim.sensing import reconstruction as angular
from mechanism_sim.sensing.chain import Converter, Instrument, Noise
from mechanism_sim.sensing.channel import Channel, Source
from mechanism_sim.sensing.fading import both, fade, passing, undoing
from mechanism_sim.sensing.point import PointOnLink
from mechanism_sim.sensing.reconstruction import Error, error
from mechanism_sim.sensing.turning import TurningLink

Array = NDArray[np.float64]

JOINT = 'coupler_rocker'
LINKS = 'coupler', 'rocker'
MESHES = 1.0, 0.1
"""[deg] of the crank: steps over which an acceleration with impacts is averaged."""
MESH = 0.1
"""[deg] the one that figures are drawn with, and alpha is made of."""


class Condition(NamedTuple):
    """What differs between the runs of the experiment."""

    speed: float  #: of the crank [rad/s]
    radial: float  #: clearance [m]
    restitution: float
    friction: float


@dataclass(frozen=True, eq=False)
class Estimate:
    """A reconstruction of a quantity (N,), and the best that could have come of the instrument.

    Attributes
    ----------
    shown : (N,) the true quantity through the same chain without noise, and treated likewise
    """

    values: Array
    shown: Array
    truth: Array

    @property
    def error(self) -> Error:
        """Against the truth."""
        return error(self.values, self.truth)

    @property
    def error_of_shown(self) -> Error:
        """Against what the instrument could show at all."""
        return error(self.values, self.shown)


@dataclass(frozen=True, eq=False)
class Swing:
    """A link in N samples of its sensor.

    Attributes
    ----------
    reading : what the sensor says [m/s^2]
    nominal : acceleration and velocity (2, N) of the ideal mechanism [rad/s^2, rad/s]
    heard, heard_nominal : true and ideal acceleration through the chain, without noise
    accelerations, velocities : by method
    between : root of the mean square of the deviation between impacts [rad/s^2]
    by_mesh : the same of means over steps of the crank, impacts included, by `MESHES`
    """

    t: Array
    angle: Array
    reading: Array
    nominal: Array
    heard: Array
    heard_nominal: Array
    accelerations: Mapping[str, Estimate]
    velocities: Mapping[str, Estimate]
    between: float
    by_mesh: tuple[float, ...]

    @property
    def deviation_heard(self) -> float:
        """Root of the mean square of the deviation from the ideal, as the chain shows it."""
        return float(np.sqrt(np.mean((self.heard - self.heard_nominal) ** 2)))


@dataclass(frozen=True, eq=False)
class Cycle:
    """The last turn of the crank in steps of `MESH`.

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
    swings : by link
    """

    bag: str
    machine: Machine
    condition: Condition
    sample_rate: float
    turns: tuple[int, int]
    swings: Mapping[str, Swing]
    rose: Rose
    impacts: ImpactCycles
    cycle: Cycle


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
    begin, end = record.whole_turns(left_out)
    ideal = ideal_record(record)
    sensors = {link: _sensors(bag, machine, link) for link in LINKS}
    window = record.times_at(np.array([begin, end], float))
    meshes = np.array([_by_mesh(record, begin, end, mesh) for mesh in MESHES])
    swings = {
        link: _swing(record, ideal.piece.motion, link, sensors[link], window, meshes[:, i])
        for i, link in enumerate(LINKS)
    }
    rose = impact_rose(record, JOINT, left_out)
    return Trial(
        bag.name,
        machine,
        condition,
        next(iter(sensors['coupler'].values())).sample_rate,
        (begin, end),
        swings,
        rose,
        impact_cycles(record, rose, left_out),
        _cycle(record, ideal, end - 1),
    )


def _condition(bag: Path, machine: Machine) -> Condition:
    scene = machine.scene
    if not isinstance(scene, FourBarScene) or JOINT not in machine.clearances:
        raise InputError(
            f'{bag}: the experiment is that of a four_bar whose joint {JOINT} has clearance'
        )
    play = machine.clearances[JOINT]
    if len(machine.laws) > 1 or machine.torque_driven:
        raise InputError(f'{bag}: the experiment is that of a crank at constant speed')
    return Condition(machine.start_of_crank[1], play.radial, play.restitution, play.friction)


def _sensors(bag: Path, machine: Machine, link: str) -> dict[str, Sensor]:
    """The sensors across a link, the outermost first."""
    found = {
        name: sensor
        for name, sensor in machine.scene.sensors.items()
        if (sensor.link, sensor.axis, sensor.quantity) == (link, 'across', 'acceleration')
        and not isinstance(sensor.at, tuple)
        and sensor.at
    }
    if not found:
        raise InputError(
            f"{bag}: no sensor reads accelerations across the {link}; its scene needs 'sensors: "
            f"NAME: {{link: {link}, axis: across, at: ...}}'"
        )
    return dict(sorted(found.items(), key=lambda item: -abs(float(item[1].at))))  # type: ignore[arg-type]


def _heard(source: Source, instrument: Instrument, name: str, motion: Motion) -> Array:
    """All samples of an instrument, from the start of the motion on."""
    channel = Channel(source, replace(instrument, trigger=None), name)
    channel.take(motion)
    return np.concatenate([block.samples for block in channel.blocks(final=True)])


def _swing(
    record: Record,
    ideal: Motion,
    link: str,
    sensors: Mapping[str, Sensor],
    window: Array,
    by_mesh: Array,
) -> Swing:
    machine, motion = record.machine, record.piece.motion
    mechanism, row = machine.mechanism, machine.physics.coordinates.index(link)
    instruments = {name: sensor.chain() for name, sensor in sensors.items()}
    rate = next(iter(instruments.values())).sample_rate
    chosen = slice(*np.ceil(window * rate - 1e-9).astype(int))
    t = np.arange(chosen.start, chosen.stop) / rate
    bare = replace(next(iter(instruments.values())), noise=Noise(), converter=Converter())
    heard, heard_nominal = (
        _heard(TurningLink(mechanism, link), bare, link, m)[chosen] for m in (motion, ideal)
    )
    readings = [
        _heard(_place(machine, sensor), instruments[name], name, motion)[chosen]
        for name, sensor in list(sensors.items())[:2]
    ]
    k, dt = motion.curve.find(t)
    q, v, a = (motion.curve.at(k, dt, d).T for d in (0, 1, 2))
    angle, speed, acceleration = machine.linkage.motion(q[0], v[0], np.zeros(len(t)))
    nominal = np.array([acceleration[row], speed[row]])
    rebuilt = _Rebuilt(machine, link, list(sensors.values()), bare, angle, speed)
    accelerations = rebuilt.accelerations(readings, heard, a[row])
    velocities = rebuilt.velocities(accelerations, nominal[1], v[row])
    turned = np.degrees(q[0] - TWO_PI * np.floor(q[0][0] / TWO_PI))
    deviation = float(np.sqrt(np.mean((a[row] - nominal[0]) ** 2)))
    return Swing(
        t, turned, readings[0], nominal, heard, heard_nominal, accelerations, velocities,
        deviation, tuple(by_mesh.tolist()),
    )  # fmt: skip


def _place(machine: Machine, sensor: Sensor) -> PointOnLink:
    return PointOnLink(
        machine.mechanism,
        sensor.link,
        sensor.at,
        sensor.axis,
        sensor.gravity,
        sensor.transducer.transverse,
    )


class _Rebuilt:
    """The methods of `mechanism_sim.sensing.reconstruction` on one link."""

    def __init__(
        self,
        machine: Machine,
        link: str,
        sensors: list[Sensor],
        bare: Instrument,
        angle: Array,
        speed: Array,
    ) -> None:
        self._at = [float(sensor.at) for sensor in sensors[:2]]  # type: ignore[arg-type]
        self._gravity = machine.mechanism.gravity if sensors[0].gravity else (0.0, 0.0)
        self._angle = angle[LINKS.index(link) + 1]
        lengths = machine.linkage
        self._joint = (
            angular.crank_pin(lengths.crank, angle[0], speed[0]) if link == 'coupler' else None
        )
        self._rate = bare.sample_rate
        self._crank = float(np.abs(speed[0]).mean()) / TWO_PI
        top = bare.anti_alias.frequency if bare.anti_alias else 0.45 * self._rate
        self._top = min(top, 0.45 * self._rate)
        self._turn = max(2, round(self._rate / self._crank))
        transfer = bare.transfer()
        band = passing(0.5 * self._crank, self._top, 0.25 * self._crank)
        self._undo = both(undoing(transfer), band)

    def accelerations(
        self, readings: list[Array], heard: Array, truth: Array
    ) -> dict[str, Estimate]:
        """Angular accelerations [rad/s^2] by method."""
        first = readings[0]
        faded = self._turn_by_turn(first)
        undone, best = self._undone(first), self._undone(heard)
        found = {
            'thesis': Estimate(self._one(faded, False), self._turn_by_turn(heard), truth),
            'corrected': Estimate(
                _swinging(self._one(faded, True)), self._turn_by_turn(heard), truth
            ),
            'undone': Estimate(_swinging(self._one(undone, True)), best, truth),
        }
        if len(readings) > 1:
            two = angular.by_two(first, readings[1], *self._at)
            found['two'] = Estimate(self._turn_by_turn(two), self._turn_by_turn(heard), truth)
            found['two, undone'] = Estimate(self._undone(two), best, truth)
        return found

    def velocities(
        self, accelerations: Mapping[str, Estimate], nominal: Array, truth: Array
    ) -> dict[str, Estimate]:
        """Angular velocities [rad/s] by method, from the angular acceleration of another."""
        thesis = accelerations['thesis']
        best = accelerations.get('two, undone', accelerations['undone'])
        rate, low, mean = self._rate, 0.5 * self._crank, float(nominal.mean())

        def each(values: Array, closed: bool) -> Array:
            starts = range(0, len(values), self._turn)
            pieces = [
                angular.closing(part, rate, float(nominal[i : i + self._turn].mean()))
                if closed
                else angular.by_trapezoids(part, rate, nominal[i])
                for i in starts
                if len(part := values[i : i + self._turn])
            ]
            return np.concatenate(pieces)

        return {
            'thesis': Estimate(
                each(thesis.values, False), each(thesis.shown, False), truth
            ),
            'closed': Estimate(each(thesis.values, True), each(thesis.shown, True), truth),
            'spectrum': Estimate(
                angular.by_spectrum(best.values, rate, low, mean),
                angular.by_spectrum(best.shown, rate, low, mean),
                truth,
            ),
            'filter': Estimate(
                angular.by_filter(best.values, rate, 0.4 * low, 2, mean),
                angular.by_filter(best.shown, rate, 0.4 * low, 2, mean),
                truth,
            ),
        }

    def _one(self, reading: Array, weighed: bool) -> Array:
        """By the outermost sensor, as [SB]; gravity is taken off if `weighed`."""
        gravity = self._gravity if weighed else (0.0, 0.0)
        return angular.angular_acceleration(
            reading, self._at[0], self._angle, self._joint, gravity
        )

    def _turn_by_turn(self, values: Array) -> Array:
        """Faded above the band under a rectangular window of one turn, as [SB]."""
        return fade(values, self._rate, passing(0.0, self._top), 'boxcar', self._turn)

    def _undone(self, values: Array) -> Array:
        """Gain and delay of the instrument taken out of the whole record."""
        return fade(values, self._rate, self._undo)


def _swinging(acceleration: Array) -> Array:
    """The mean taken off: that of a link that rocks is zero, and no such chain passes it."""
    return np.asarray(acceleration - acceleration.mean())


def _steps(record: Record, begin: float, end: float, mesh: float) -> Array:
    """Times [s] at steps of the crank of `mesh` [deg] between two turns."""
    count = round((end - begin) * 360.0 / mesh)
    return record.times_at(begin + np.arange(count + 1) * (mesh / 360.0))


def _by_mesh(record: Record, begin: int, end: int, mesh: float) -> Array:
    """Root of the mean square of the deviation of means over steps, by link [rad/s^2]."""
    t = _steps(record, begin, end, mesh)
    curve = record.piece.motion.curve
    q, v = curve(t), curve(t, 1)
    nominal = record.machine.linkage.motion(q[:, 0], v[:, 0], np.zeros(len(t)))[1].T
    off = np.diff(v - nominal, axis=0) / np.diff(t)[:, None]
    rows = [record.machine.physics.coordinates.index(link) for link in LINKS]
    return np.asarray(np.sqrt(np.mean(off**2, axis=0))[rows])


def _cycle(record: Record, ideal: Record, turn: int) -> Cycle:
    machine, curve = record.machine, record.piece.motion.curve
    edges = _steps(record, turn, turn + 1, MESH)
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
        (np.arange(len(middle)) + 0.5) * MESH,
        (np.diff(curve(edges, 1), axis=0) / width[:, None]).T[rows],
        v.T[rows],
        force,
        torque,
        nominal,
    )
