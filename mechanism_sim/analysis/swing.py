"""A link of a measured four-bar: what its sensors say, what follows from it, and what is true.

The signals follow from the motion, exactly, through the chain that the scene gives the sensors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mechanism_sim.analysis.angular_reconstruction import Estimate, Rebuilt
from mechanism_sim.analysis.record import Record
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.scene import Machine
from mechanism_sim.scene.instruments import source
from mechanism_sim.scene.schema import SensorPart
from mechanism_sim.sensing.angular_acceleration import TurningLink
from mechanism_sim.sensing.chain import Converter, Instrument, Noise
from mechanism_sim.sensing.channel import Channel, Source

MESHES = 1.0, 0.1
"""[deg] of the crank: steps over which an acceleration with impacts is averaged."""


class Severity(NamedTuple):
    """Roots of the mean squares of the deviation of an angular acceleration from the ideal one.

    An impact is too short to be seen at any instant, and infinite. What is drawn of it is a mean
    over some step, the larger the smaller the step, or what a filter makes of it.

    Attributes
    ----------
    between : impacts, at the instants of the samples [rad/s^2]
    by_mesh : of means over the steps `MESHES` of the crank, impacts included
    heard : as the chain shows it, without noise
    """

    between: float
    by_mesh: tuple[float, ...]
    heard: float


@dataclass(frozen=True, eq=False)
class Swing:
    """A link in N samples of its sensor.

    Attributes
    ----------
    t : [s]
    angle : of the crank [deg], from the first of these turns on
    reading : what the outermost sensor says [m/s^2]
    overloads : samples of all sensors of the link, from the start of the run, cut at the range
    nominal : acceleration and velocity (2, N) of the ideal mechanism [rad/s^2, rad/s]
    heard : true acceleration through the chain, without noise
    accelerations, velocities : by method
    severity : in these turns
    severity_at_first : in the first turn with an impact and the three that follow
    """

    t: Array
    angle: Array
    reading: Array
    overloads: int
    nominal: Array
    heard: Array
    accelerations: Mapping[str, Estimate]
    velocities: Mapping[str, Estimate]
    severity: Severity
    severity_at_first: Severity


def sensors_across(machine: Machine, link: str) -> dict[str, SensorPart]:
    """Up to two sensors that read accelerations across a link, the outermost first.

    Ideal sensors are taken only if there are no others; the second one has the rate of the first,
    and feels gravity if that does.

    Raises
    ------
    InputError
        If there is none.
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
    """Distance from the joint [m]; 0 for a sensor beside the line of its link."""
    return 0.0 if isinstance(sensor.at, tuple) else float(sensor.at)


def swing(
    record: Record, ideal: Motion, link: str, turns: tuple[int, int], first: tuple[int, int]
) -> Swing:
    """A link in some turns of the crank.

    Parameters
    ----------
    ideal : the motion of the ideal mechanism
    turns, first : from and up to which turn: to be analysed, and the first with impacts

    Raises
    ------
    InputError
        If the link has no sensor across it.
    """
    machine, motion = record.machine, record.piece.motion
    mechanism, row = machine.mechanism, machine.physics.coordinates.index(link)
    sensors = sensors_across(machine, link)
    instruments = {name: sensor.chain() for name, sensor in sensors.items()}
    outermost = next(iter(instruments.values()))
    bare = replace(outermost, noise=Noise(), converter=Converter())
    heard, heard_nominal = (
        _all_samples(TurningLink(mechanism, link), bare, link, m)[0] for m in (motion, ideal)
    )
    read = [
        _all_samples(source(machine, name), x, name, motion) for name, x in instruments.items()
    ]

    def samples(within: tuple[int, int]) -> slice:
        window = record.times_at(np.array(within, float))
        return slice(*np.ceil(window * outermost.sample_rate - 1e-9).astype(int))

    def severity(within: tuple[int, int]) -> Severity:
        chosen = samples(within)
        t = np.arange(chosen.start, chosen.stop) / outermost.sample_rate
        between = _rms(_beyond_ideal(record, row, t, 2))
        meshes = []
        for mesh in MESHES:
            t = steps(record, within, mesh)
            meshes.append(_rms(np.diff(_beyond_ideal(record, row, t, 1)) / np.diff(t)))
        return Severity(between, tuple(meshes), _rms(heard[chosen] - heard_nominal[chosen]))

    chosen = samples(turns)
    t = np.arange(chosen.start, chosen.stop) / outermost.sample_rate
    k, dt = motion.curve.find(t)
    q, v, a = (motion.curve.at(k, dt, d).T for d in (0, 1, 2))
    angle, speed, acceleration = machine.linkage.motion(q[0], v[0], np.zeros(len(t)))
    places = [_place_on(sensor) for sensor in sensors.values()]
    felt = next(iter(sensors.values())).gravity
    gravity = mechanism.gravity if felt else (0.0, 0.0)
    rebuilt = Rebuilt(machine.linkage, link, places, gravity, bare, angle, speed)
    readings = [found[chosen] for found, _ in read]
    accelerations = rebuilt.accelerations(readings, heard[chosen], a[row])
    return Swing(
        t,
        np.degrees(q[0] - TWO_PI * np.floor(q[0][0] / TWO_PI + 1e-9)),
        readings[0],
        sum(cut for _, cut in read),
        np.array([acceleration[row], speed[row]]),
        heard[chosen],
        accelerations,
        rebuilt.velocities(accelerations, speed[row], v[row]),
        severity(turns),
        severity(first),
    )


def steps(record: Record, turns: tuple[int, int], mesh: float) -> Array:
    """Times [s] at steps of the crank of `mesh` [deg] in some turns, both ends included."""
    count = round((turns[1] - turns[0]) * 360.0 / mesh)
    return record.times_at(np.asarray(turns[0] + np.arange(count + 1) * (mesh / 360.0), float))


def _beyond_ideal(record: Record, row: int, t: Array, derivative: int) -> Array:
    """Angular velocity (1) or acceleration (2) of a link less that of the ideal mechanism."""
    curve = record.piece.motion.curve
    k, dt = curve.find(t)
    q, v = (curve.at(k, dt, d).T for d in (0, 1))
    ideal = record.machine.linkage.motion(q[0], v[0], np.zeros(len(t)))
    return np.asarray(curve.at(k, dt, derivative).T[row] - ideal[derivative][row])


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))


def _all_samples(
    mount: Source, instrument: Instrument, name: str, motion: Motion
) -> tuple[Array, int]:
    """All samples of an instrument, from the start of the motion on, and how many were cut."""
    channel = Channel(mount, replace(instrument, trigger=None), name)
    channel.take(motion)
    blocks = channel.blocks(final=True)
    return np.concatenate([b.samples for b in blocks]), sum(b.overloads for b in blocks)
