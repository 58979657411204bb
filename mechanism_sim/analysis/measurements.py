"""Signals of a sensor in bags, made ready for identification."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from mechanism_sim.analysis.collectors import Signal, SignalCollectors
from mechanism_sim.analysis.record import find_topics, machine_of
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.recording.reader import Bag, read_bag
from mechanism_sim.results.sensor_record import STRETCHES, SensorRecord
from mechanism_sim.scene import Machine, load_scene
from mechanism_sim.sensing.indicators import FEWEST


def signal_of(bag: Bag, sensor: str | None = None, namespace: str | None = None) -> Signal:
    """The signal of a sensor of a bag; of its only one, if none is named."""
    collectors = SignalCollectors()
    topics = find_topics(bag, namespace)['sensors']
    for _, message, _ in bag.messages(topics) if topics else ():
        collectors.add(message)
    known = ', '.join(sorted(collectors))
    if not collectors:
        raise InputError(f'{bag.path} holds no signal of a sensor')
    if sensor is None and len(collectors) > 1:
        raise InputError(f'{bag.path} holds several sensors ({known}): choose one by --sensor')
    name = sensor or known
    if name not in collectors:
        hint = nearest(name, collectors)
        raise InputError(f"{bag.path} holds no sensor '{name}'{hint}; it has: {known}")
    signal = collectors[name].signal()
    if signal is None:
        raise InputError(f'{bag.path}: sensor {name} has no samples')
    return signal


def measurements(
    bags: Sequence[Path | str],
    scenes: Sequence[str] = (),
    overrides: Iterable[str] = (),
    sensor: str | None = None,
    skip: float = 0.0,
) -> list[SensorRecord]:
    """Signals of bags, and the machines that they are taken for.

    Parameters
    ----------
    scenes : one for all bags, or one for each of them; without any, those the bags hold
    overrides : of every scene
    skip : samples before this time are left out [s]
    """
    if len(scenes) not in (0, 1, len(bags)):
        raise InputError(f'{len(bags)} bags need one --scene, as many, or none')
    given = list(overrides)
    if given and not scenes:
        raise InputError('--set goes with --scene: what a bag holds is not changed')
    found = []
    for k, path in enumerate(bags):
        bag = read_bag(path)
        machine = load_scene(scenes[k % len(scenes)], given) if scenes else machine_of(bag)
        signal = signal_of(bag, sensor).since(skip)
        found.append(_measurement(bag, machine, signal))
    return found


def _measurement(bag: Bag, machine: Machine, signal: Signal) -> SensorRecord:
    name, known = signal.sensor, machine.scene.sensors
    if name not in known:
        raise InputError(
            f"{machine.name} has no sensor '{name}'{nearest(name, known)}, which {bag.path} has: "
            'add it with its chain to the scene'
        )
    scene = known[name]
    if (scene.sample_rate, scene.measures) != (signal.rate, signal.quantity):
        raise InputError(
            f'{bag.path} has {signal.quantity} of {name} at {signal.rate:g} Hz, but '
            f'{machine.name} says {scene.measures} at {scene.sample_rate:g} Hz'
        )
    if len(signal.runs) > 1 or scene.trigger:
        raise InputError(
            f'{bag.path}: the signal of {name} has gaps or a trigger: identification needs '
            'samples without interruption'
        )
    measurement = SensorRecord(machine, name, signal.starts[0], signal.runs[0])
    needed = FEWEST * (1 if measurement.steady else STRETCHES)
    if len(measurement.samples) < needed:
        raise InputError(
            f'{bag.path}: {len(measurement.samples)} samples of {name} are too few: {needed} are '
            'needed'
        )
    return measurement
