"""A link of a measured four-bar: readings, reconstructions as in [SB] 7.2, and true motion.

Signals follow exactly from the motion through the sensors' measurement chain of the scene.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.analysis.record import Record
from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.errors import InputError
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.numerics.polynomials import TWO_PI, Nodes
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene import Machine
from mechanism_sim.scene.schema import SensorPart
from mechanism_sim.sensing.chain import Converter, Instrument, Noise
from mechanism_sim.sensing.channel import Channel, DirectSource, SensorSource
from mechanism_sim.thesis import reconstruction as angular
from mechanism_sim.thesis.reconstruction import Error, band_pass, both, error, fade, invert
from mechanism_sim.vibration.shaken_frame import VelocitySteps

LINKS = 'coupler', 'rocker'
_TOP = 0.45  # upper band limit, as a share of the sampling rate
MESHES = 1.0, 0.1
"""[deg] of the crank: steps over which an acceleration with impacts is averaged."""
_SEGMENTS = 2048


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A reconstruction of a quantity (N,), and the best possible one of the instrument."""

    values: Array
    #: (N,) true quantity through the same chain without noise, processed in the same way
    shown: Array
    truth: Array

    @property
    def error(self) -> Error:
        """Error relative to the truth."""
        return error(self.values, self.truth)

    @property
    def error_of_shown(self) -> Error:
        """Error relative to the best possible reconstruction."""
        return error(self.values, self.shown)


class Rebuilt:
    """Methods of reconstruction for a link.

    Parameters
    ----------
    linkage : the mechanism without clearance
    link : one of `LINKS`
    at : distances of one or two transverse sensors from its joint [m]
    gravity : gravity in the sensors' readings (2,) [m/s^2]
    instrument : chain of both sensors, without noise
    angle, speed : (3, N) of crank, coupler and rocker without clearance [rad, rad/s]
    """

    def __init__(
        self,
        linkage: FourBar,
        link: str,
        at: list[float],
        gravity: tuple[float, float],
        instrument: Instrument,
        angle: Array,
        speed: Array,
    ) -> None:
        self._at, self._gravity = at, gravity
        self._angle = angle[1 + LINKS.index(link)]
        self._joint = (
            angular.crank_pin(linkage.crank, angle[0], speed[0]) if link == 'coupler' else None
        )
        self._rate = rate = instrument.sample_rate
        self._crank = float(np.abs(speed[0]).mean()) / TWO_PI
        filtered = instrument.anti_alias.frequency if instrument.anti_alias else rate
        self._top = min(filtered, _TOP * rate)
        self._turn = max(2, round(rate / self._crank))
        band = band_pass(0.5 * self._crank, self._top, 0.25 * self._crank)
        self._undo = both(invert(instrument.transfer()), band)

    def accelerations(
        self, readings: list[Array], heard: Array, truth: Array
    ) -> dict[str, Reconstruction]:
        """Angular accelerations [rad/s^2] by method."""
        first = readings[0]
        faded = self._turn_by_turn(first)
        undone, best = self._undone(first), self._undone(heard)
        found = {
            'thesis': Reconstruction(self._one(faded, False), self._turn_by_turn(heard), truth),
            'corrected': Reconstruction(
                _swinging(self._one(faded, True)), self._turn_by_turn(heard), truth
            ),
            'undone': Reconstruction(_swinging(self._one(undone, True)), best, truth),
        }
        if len(readings) > 1:
            two = angular.by_two(first, readings[1], *self._at)
            found['two'] = Reconstruction(
                self._turn_by_turn(two), self._turn_by_turn(heard), truth
            )
            found['two, undone'] = Reconstruction(self._undone(two), best, truth)
        return found

    def velocities(
        self, accelerations: Mapping[str, Reconstruction], nominal: Array, truth: Array
    ) -> dict[str, Reconstruction]:
        """Angular velocities [rad/s] by method, from angular accelerations."""
        thesis = accelerations['thesis']
        best = accelerations.get('two, undone', accelerations['undone'])
        rate, low, mean = self._rate, 0.5 * self._crank, float(nominal.mean())

        def each(values: Array, closed: bool) -> Array:
            starts = range(0, len(values), self._turn)
            pieces = [
                angular.by_whole_cycles(part, rate, float(nominal[i : i + self._turn].mean()))
                if closed
                else angular.by_trapezoids(part, rate, nominal[i])
                for i in starts
                if len(part := values[i : i + self._turn])
            ]
            return np.concatenate(pieces)

        return {
            'thesis': Reconstruction(each(thesis.values, False), each(thesis.shown, False), truth),
            'closed': Reconstruction(each(thesis.values, True), each(thesis.shown, True), truth),
            'spectrum': Reconstruction(
                angular.by_spectrum(best.values, rate, low, mean),
                angular.by_spectrum(best.shown, rate, low, mean),
                truth,
            ),
            'filter': Reconstruction(
                angular.by_filter(best.values, rate, 0.4 * low, 2, mean),
                angular.by_filter(best.shown, rate, 0.4 * low, 2, mean),
                truth,
            ),
        }

    def _one(self, reading: Array, weighed: bool) -> Array:
        """Angular acceleration by the outermost sensor ([SB]); without gravity if `weighed`."""
        gravity = self._gravity if weighed else (0.0, 0.0)
        return angular.angular_acceleration(
            reading, self._at[0], self._angle, self._joint, gravity
        )

    def _turn_by_turn(self, values: Array) -> Array:
        """Values low-pass filtered under a rectangular window of one turn, as in [SB]."""
        return fade(values, self._rate, band_pass(0.0, self._top), self._turn)

    def _undone(self, values: Array) -> Array:
        """Values of the whole record with the instrument's gain and delay inverted."""
        return fade(values, self._rate, self._undo)


def _swinging(acceleration: Array) -> Array:
    """Acceleration without its mean, which is zero for a rocking link and not measured."""
    return np.asarray(acceleration - acceleration.mean())


class Severity(NamedTuple):
    """Roots of the mean squares of the deviation of an angular acceleration from the ideal one.

    An impact has no duration and an infinite acceleration. Charts show its mean over
    a step, which increases as the step decreases, or the response of a filter.
    """

    between: float  #: at the instants of samples, without impacts [rad/s^2]
    #: for means over the steps `MESHES` of the crank, impacts included [rad/s^2]
    by_mesh: tuple[float, ...]
    heard: float  #: at the output of the chain, without noise [rad/s^2]


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """A link in N samples of its sensor."""

    t: Array  #: times [s]
    angle: Array  #: crank angle [deg], from the first of these turns
    reading: Array  #: reading of the outermost sensor [m/s^2]
    #: number of clipped samples of all sensors of the link, from the start of the run
    overloads: int
    nominal: Array  #: (2, N) acceleration and velocity of the ideal mechanism [rad/s^2, rad/s]
    heard: Array  #: (N,) true acceleration through the chain, without noise [rad/s^2]
    #: reconstructions by method [rad/s^2, rad/s]
    accelerations: Mapping[str, Reconstruction]
    velocities: Mapping[str, Reconstruction]
    severity: Severity  #: severity in these turns
    severity_at_first: Severity  #: severity in the first turns from the first impact


def sensors_across(machine: Machine, link: str) -> dict[str, SensorPart]:
    """Up to two sensors of transverse accelerations of a link, the outermost first.

    Ideal sensors are used only if there are no others; the second one has the rate of the first,
    and reads gravity if the first does.
    """
    across = {
        name: sensor
        for name, sensor in machine.scene.sensors.items()
        if (sensor.link, sensor.axis, sensor.measures) == (link, 'across', 'acceleration')
        and _place_on(sensor)
    }
    real = {name: s for name, s in across.items() if s.chain().transfer().poles}
    found = sorted((real or across).items(), key=lambda item: -abs(_place_on(item[1])))
    if not found:
        raise InputError(
            f'{machine.name}: no sensor reads accelerations across the {link}; its scene needs '
            f"'sensors: NAME: {{link: {link}, axis: across, at: ...}}'"
        )
    first = found[0][1]
    others = [
        (name, sensor)
        for name, sensor in found[1:]
        if _place_on(sensor) != _place_on(first)
        and (sensor.sample_rate, sensor.gravity) == (first.sample_rate, first.gravity)
    ]
    return dict([found[0], *others[:1]])


def _place_on(sensor: SensorPart) -> float:
    """Distance of a sensor from the joint [m]; 0 if it is off the line of its link."""
    return 0.0 if isinstance(sensor.at, tuple) else float(sensor.at)


def swings(
    record: Record,
    nominal: Callable[[str, Instrument], Array],
    turns: tuple[int, int],
    first: tuple[int, int],
) -> dict[str, LinkMotion]:
    """Motion of both links in some turns of the crank.

    Parameters
    ----------
    nominal : function of link and instrument: samples of the ideal angular acceleration
        from the start of the run
    turns, first : first turn and end of the analysed turns, and of the first ones with impacts
    """
    rows = [record.machine.physics.coordinates.index(link) for link in LINKS]
    late, early = (_deviations(record, rows, within) for within in (turns, first))
    found = {}
    for k, link in enumerate(LINKS):
        signals = _signals(record, link, turns)
        beyond = signals.heard - nominal(link, signals.bare)
        instants = [_samples(record, within, signals.bare) for within in (turns, first)]
        severity = [
            Severity(
                _rms(_beyond_ideal(record, rows, chosen / signals.bare.sample_rate, 2)[k]),
                means[k],
                _rms(beyond[chosen]),
            )
            for chosen, means in zip(instants, (late, early), strict=True)
        ]
        angle, nominal_motion, accelerations, velocities = _rebuild(record, link, signals)
        found[link] = LinkMotion(
            signals.time,
            angle,
            signals.readings[0],
            signals.overloads,
            nominal_motion,
            signals.heard[signals.chosen],
            accelerations,
            velocities,
            *severity,
        )
    return found


def has_high_pass(machine: Machine) -> bool:
    """True if the amplifiers of all sensors across the links have a lower limit."""
    chains = [x.chain() for link in LINKS for x in sensors_across(machine, link).values()]
    return all(chain.amplifier.high_pass for chain in chains)


def under_limit(
    record: Record, turns: tuple[int, int], high_pass: float
) -> dict[str, tuple[Mapping[str, Reconstruction], Mapping[str, Reconstruction]]]:
    """Accelerations and velocities by link and method, for another lower limit of amplifiers.

    Parameters
    ----------
    high_pass : corner frequency of their high-pass [Hz]
    """
    return {
        link: _rebuild(record, link, _signals(record, link, turns, high_pass))[2:]
        for link in LINKS
    }


class _Signals(NamedTuple):
    """Signals of the sensors across a link."""

    bare: Instrument  #: chain of the outermost sensor, without noise
    places: list[float]  #: distances from the joint of the link [m], the outermost first
    gravity: tuple[float, float]
    chosen: NDArray[np.intp]  #: indices of the samples in the requested turns
    readings: list[Array]  #: these samples of each sensor
    overloads: int  #: number of clipped samples among all
    heard: Array  #: true angular acceleration through `bare`, from the start of the run

    @property
    def time(self) -> Array:
        """Times of the chosen samples [s]."""
        return np.asarray(self.chosen / self.bare.sample_rate)


def _signals(
    record: Record, link: str, turns: tuple[int, int], high_pass: float | None = None
) -> _Signals:
    machine, motion = record.machine, record.piece.motion
    sensors = sensors_across(machine, link)
    chains = {name: sensor.chain() for name, sensor in sensors.items()}
    if high_pass is not None:
        chains = {
            name: replace(c, amplifier=c.amplifier.model_copy(update={'high_pass': high_pass}))
            for name, c in chains.items()
        }
    bare = replace(next(iter(chains.values())), noise=Noise(), adc=Converter())
    chosen = _samples(record, turns, bare)
    read = [
        all_samples(sensors[name].source(machine), c, name, motion) for name, c in chains.items()
    ]
    return _Signals(
        bare,
        [_place_on(sensor) for sensor in sensors.values()],
        machine.mechanism.gravity if next(iter(sensors.values())).gravity else (0.0, 0.0),
        chosen,
        [samples[chosen] for samples, _ in read],
        sum(cut for _, cut in read),
        all_samples(TurningLink(machine.mechanism, link), bare, link, motion)[0],
    )


def _rebuild(
    record: Record, link: str, signals: _Signals
) -> tuple[Array, Array, Mapping[str, Reconstruction], Mapping[str, Reconstruction]]:
    """Reconstructions from the signals: accelerations and velocities by method.

    Before them the crank angle [deg], from the first of the turns, and the ideal
    mechanism's acceleration and velocity of the link (2, N).
    """
    machine, curve = record.machine, record.piece.motion.curve
    row = machine.physics.coordinates.index(link)
    k, dt = curve.find(signals.time)
    q, v, a = (curve.at(k, dt, d).T for d in (0, 1, 2))
    angle, speed, acceleration = machine.nominal.linkage.motion(q[0], v[0], np.zeros(len(dt)))
    rebuilt = Rebuilt(
        machine.nominal.linkage, link, signals.places, signals.gravity, signals.bare, angle, speed
    )
    accelerations = rebuilt.accelerations(signals.readings, signals.heard[signals.chosen], a[row])
    return (
        np.degrees(q[0] - TWO_PI * np.floor(q[0][0] / TWO_PI + 1e-9)),
        np.array([acceleration[row], speed[row]]),
        accelerations,
        rebuilt.velocities(accelerations, speed[row], v[row]),
    )


def _samples(record: Record, turns: tuple[int, int], instrument: Instrument) -> NDArray[np.intp]:
    """Indices of the samples in some turns of the crank."""
    window = record.times_at(np.array(turns, float))
    return np.arange(*np.ceil(window * instrument.sample_rate - 1e-9).astype(int))


def steps(record: Record, turns: tuple[int, int], mesh: float) -> Array:
    """Times [s] at steps of the crank of `mesh` [deg] in some turns, both ends included."""
    count = round((turns[1] - turns[0]) * 360.0 / mesh)
    return record.times_at(np.asarray(turns[0] + np.arange(count + 1) * (mesh / 360.0), float))


def _deviations(
    record: Record, rows: list[int], turns: tuple[int, int]
) -> list[tuple[float, ...]]:
    """Deviations (per row) of means over the steps `MESHES` in some turns [rad/s^2].

    The finest steps are evaluated; coarser ones are sums of these.
    """
    finest = min(MESHES)
    t = steps(record, turns, finest)
    beyond = _beyond_ideal(record, rows, t, 1)
    found = []
    for mesh in MESHES:
        every = round(mesh / finest)
        means = np.diff(beyond[:, ::every]) / np.diff(t[::every])
        found.append([_rms(row) for row in means])
    return list(zip(*found, strict=True))


def _beyond_ideal(record: Record, rows: list[int], t: Array, derivative: int) -> Array:
    """Deviation of angular velocity (1) or acceleration (2) of links (rows, N) from the ideal."""
    curve = record.piece.motion.curve
    k, dt = curve.find(t)
    q, v = (curve.at(k, dt, d).T for d in (0, 1))
    ideal = record.machine.nominal.linkage.motion(q[0], v[0], np.zeros(len(t)))
    own = v if derivative == 1 else curve.at(k, dt, derivative).T
    return np.asarray(own[rows] - ideal[derivative][rows])


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))


def all_samples(
    mount: SensorSource, instrument: Instrument, name: str, motion: Motion
) -> tuple[Array, int]:
    """All samples of an instrument from the start of the motion, and the number clipped."""
    channel = Channel(mount, replace(instrument, trigger=None), name)
    for part in motion.parts(_SEGMENTS):  # samples do not depend on the parts
        channel.take(part)
    blocks = channel.blocks(final=True)
    return np.concatenate([b.samples for b in blocks]), sum(b.overloads for b in blocks)


class TurningLink(DirectSource):
    """Exact source, impacts included, for `mechanism_sim.sensing.channel.Channel`.

    Parameters
    ----------
    mechanism : the machine
    link : one of its rotating links

    Raises
    ------
    ValueError
        If no coordinate is the angle of that link.
    """

    def __init__(self, mechanism: Mechanism, link: str) -> None:
        self._index = mechanism.coordinates.index(link)
        self._steps = VelocitySteps()

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Angular acceleration (1, N) [rad/s^2], as ``motion.curve.at(segments, dt, 2)``."""
        return np.asarray(motion.curve.local(segments, dt, 2).T[self._index][None])

    def impulses(self, motion: Motion) -> Array:
        """Steps (m, 1) [rad/s] of the angular velocity at the starts of the m following pieces."""
        return np.asarray(self._steps(motion.curve)[self._index][:, None])
