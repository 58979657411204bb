"""Signals of bags and of other files, made ready for identification."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mechanism_sim.analysis.collectors import Signal, SignalCollectors
from mechanism_sim.analysis.open_run import MessageRun
from mechanism_sim.analysis.record import RunOrder, find_topics, machine_of
from mechanism_sim.analysis.series import Series
from mechanism_sim.arrays import Array
from mechanism_sim.csv_tables import assume, named_unit
from mechanism_sim.errors import InputError, check_known, nearest
from mechanism_sim.recording.inventory import scene_text
from mechanism_sim.recording.reader import Bag, read_bag
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.measured import Measured, QuantityRecord, SensorRecord
from mechanism_sim.scene import Machine, load_scene
from mechanism_sim.sensing.chain import QUANTITIES
from mechanism_sim.signal_files import (
    ChannelSamples,
    checked,
    choose,
    is_signal_file,
    read_signals,
)
from mechanism_sim.units import counted

_ROTATIONS = 'rad', 'rad/s'  # units that files have otherwise as often, in deg and rpm
_EVEN = 0.01
"""Share of a sampling interval by which samples may be late in all to count as the sensor's."""
_FAR, _LONG = 1000.0, 10.0
"""A record that begins so many times later than it or the scene's run [s] is long, and than this
[s], counts from elsewhere, as from 1970: a run from 0 on would not come to its end."""


def _signal_of(bag: Bag, sensor: str | None, topics: Sequence[str]) -> Signal:
    """The signal of a sensor of a bag; of its only one, if none is named."""
    collectors, order = SignalCollectors(), RunOrder()
    for topic, message, _ in bag.messages(topics):
        if order.keeps(topic, 'sensors', message):
            collectors.add(message)
    order.warn(bag)
    known = ', '.join(sorted(collectors))
    if not collectors:
        raise _without_signal(bag)
    if sensor is None and len(collectors) > 1:
        raise InputError(f'{bag.path} holds several sensors ({known}): choose one by --sensor')
    name = sensor or known
    check_known(name, sorted(collectors), f"{bag.path} holds no sensor '{name}'", 'it has:')
    signal = collectors[name].signal()
    if signal is None:
        raise InputError(f'{bag.path}: sensor {name} has no samples')
    return signal


def _without_signal(bag: Bag) -> InputError:
    return InputError(f'{bag.path} holds no signal of a sensor')


def measurements(
    files: Sequence[Path | str | tuple[Path | str, str | None]],
    scenes: Sequence[str] = (),
    overrides: Iterable[str] = (),
    sensor: str | None = None,
    skip: float = 0.0,
    channel: str | None = None,
    full_scale: str = '',
    rate: str = '',
) -> list[Measured]:
    """Signals of files, and the machines that they are taken for.

    Parameters
    ----------
    files : bags, or files of `signal_files`; of a bag of several machines with the namespace of
        one, as ``('run.mcap', '/left')``
    scenes : one for all files, or one for each of them; default: those in the bags
    overrides : overrides of every scene
    sensor : name of a sensor of the scene, or of a quantity
    skip : samples before this time are left out [s]
    channel, full_scale, rate : as for `read_signals`; of a bag a path ``TOPIC.FIELD``. Without a
        channel all that are named like sensors or quantities of the scene, of a bag without
        sensors its joint states
    """
    if len(scenes) not in (0, 1, len(files)):
        raise InputError(f'{len(files)} bags need one --scene, as many, or none')
    given = list(overrides)
    if given and not scenes:
        raise InputError('--set needs --scene: the scene in a bag cannot be changed')
    found: list[Measured] = []
    for k, file in enumerate(files):
        path, namespace = file if isinstance(file, tuple) else (file, None)
        machine = load_scene(scenes[k % len(scenes)], given) if scenes else None
        if is_signal_file(path):
            if namespace:
                raise InputError(f'{path} is a file of signals: a namespace is one of a bag')
            channels = read_signals(path, full_scale, rate=rate)
            if machine is None:
                raise InputError(f'{path} holds no machine: give --scene')
        else:
            if full_scale or rate:
                option = 'full-scale is for a .wav' if full_scale else 'sample-rate is for a table'
                raise InputError(f'{path} is a bag: --{option} file')
            bag = read_bag(path)
            if not any(topic.count for topic in bag.topics.values()):
                raise _without_signal(bag)
            topics = find_topics(bag, namespace) if namespace or not (machine and channel) else {}
            if machine is None and scene_text(bag, namespace) is None:
                raise InputError(f'{path} does not hold its scene: give a machine by --scene')
            machine = machine or machine_of(bag, namespace)
            # signals of a sensor are what the bag gives, and not numbers of its messages
            sensed = sensor in machine.scene.sensors or sensor not in catalogue(machine)
            if not channel and sensed and topics['sensors']:
                signal = _signal_of(bag, sensor, topics['sensors'])
                found.append(_of_sensor(bag, machine, signal.since(skip)))
                continue
            channels = _channels_of(MessageRun(bag, namespace), channel)
        chosen = _chosen(path, machine, sensor, channel, channels)
        found += [_of_channel(path, machine, name, c, skip) for name, c in chosen.items()]
    return found


def _channels_of(run: MessageRun, path: str | None) -> dict[str, ChannelSamples]:
    """Joint states of a bag as ``position.JOINT`` and so on, or that to which a path leads."""
    found = {path: run.one(path)} if path else run.series
    if not found:
        raise InputError(f'{run.path} has no joint states: name numbers by --channel TOPIC.FIELD')
    return {name: samples_of(run.bag, x) for name, x in found.items()}


def samples_of(bag: Bag, x: Series) -> ChannelSamples:
    """Recorded values as samples of a channel; in the unit that ends the name of its field."""
    # of a joint nobody may say whether it turns or slides: numbers are SI all the same
    unit = '' if ' or ' in x.unit else x.unit
    if not x.unit and x.name.startswith('/'):
        field = x.name.rpartition('[')[0] if x.name.endswith(']') else x.name
        unit = named_unit(field.rpartition('.')[2])
    return checked(bag.path, ChannelSamples(x.name, x.t, x.values, unit))


def _chosen(
    path: Path | str,
    machine: Machine,
    sensor: str | None,
    channel: str | None,
    channels: Mapping[str, ChannelSamples],
) -> dict[str, ChannelSamples]:
    """Channels of a file by the sensor or quantity that each is of."""
    known = [*machine.scene.sensors, *catalogue(machine)]
    if channel or sensor:
        named = sensor or channel or ''
        if named not in known:  # check the name before the channel
            raise InputError(
                f"{machine.name} has neither a sensor nor a quantity '{named}'"
                f'{nearest(named, known)}: name it by --sensor'
            )
        return {named: choose(path, channels, channel or (named if named in channels else None))}
    found = {n: c for n, c in channels.items() if n in known}
    if not found:
        raise InputError(
            f'{path} has no channel that is named like a sensor or a quantity of {machine.name}: '
            'name one by --sensor, and its channel by --channel'
        )
    return found


def _of_channel(
    path: Path | str, machine: Machine, name: str, channel: ChannelSamples, skip: float
) -> Measured:
    later = channel.times >= max(skip, 0.0)
    if not later.any():
        raise InputError(f"{path}: channel '{channel.name}' has no samples after {skip:g} s")
    t = channel.times[later]
    first, last = channel.times[[0, -1]].tolist()
    if first > _FAR * max(last - first, machine.scene.duration or 0.0, _LONG):
        raise InputError(
            f"{path}: channel '{channel.name}' begins at {first:.12g} s, but runs of "
            f'{machine.name} begin at 0: count its times from the start of the run: subtract '
            f'{first:.12g} s if that is the first sample, else the time when the machine started'
        )
    if before := int((channel.times < 0.0).sum()):
        assume(
            f"{path}: {counted(before, 'sample')} of channel '{channel.name}' before 0 s left out"
        )
    keys = machine.scene.sensors.get(name)
    if keys is None:
        values = _in_unit(path, channel, catalogue(machine)[name].unit)
        return QuantityRecord(machine, name, t, values[later])
    if keys.trigger:
        raise InputError(f'{path}: {name} has a trigger: give its times, and take that away')
    y = _in_unit(path, channel, QUANTITIES[keys.measures])[later]
    late = np.abs(t - (t[0] + np.arange(len(t)) / keys.sample_rate)).max() * keys.sample_rate
    return SensorRecord(machine, name, float(t[0]), y, None if late < _EVEN else t)


def _in_unit(path: Path | str, channel: ChannelSamples, unit: str) -> Array:
    """Values (N,) of a channel in an SI unit; of angles without a unit it is said that they are.

    Joint states in a bag are in SI units, whatever their joints are called.
    """
    if is_signal_file(path) and not channel.unit:
        channel = replace(channel, unit=named_unit(channel.name, [unit]))
        if not channel.unit and unit in _ROTATIONS:
            assume(f"{path}: channel '{channel.name}' has no unit: it is read in {unit}")
    return channel.in_unit(unit)


def _of_sensor(bag: Bag, machine: Machine, signal: Signal) -> SensorRecord:
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
            f'{machine.name} has {scene.measures} at {scene.sample_rate:g} Hz'
        )
    if len(signal.runs) > 1 or scene.trigger:
        raise InputError(
            f'{bag.path}: the signal of {name} has gaps or a trigger: identification needs '
            'samples without interruption'
        )
    return SensorRecord(machine, name, signal.starts[0], signal.runs[0])
