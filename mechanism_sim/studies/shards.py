"""The windows of a run as a Parquet file, written during the run."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from mechanism_sim.errors import InputError
from mechanism_sim.numerics.polynomials import TWO_PI, PiecewisePolynomial
from mechanism_sim.results.measures import OVERLOADS
from mechanism_sim.results.run import Piece
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.schema import Scene
from mechanism_sim.sensing.channel import Channel
from mechanism_sim.studies.plan import SweepPlan
from mechanism_sim.studies.runs import file_errors
from mechanism_sim.studies.schema import WindowsPart
from mechanism_sim.studies.windows import Cutter, SampleWindow
from mechanism_sim.tables import field_type

_SIGNAL = 'signal'
_ROWS = 256  # rows of a row group
_DIGITAL = {'instrument', 'sample_rate', 'trigger', 'adc', 'noise'}
"""Keys of a sensor that its analogue part does not depend on, or that follow from others."""

Channels = dict[str, Channel]
"""Channels of one motion by all that their analogue parts follow from."""


@dataclass(frozen=True)
class Shard:
    """Input of a worker that writes the windows of a run."""

    file: Path
    #: whose sensors measure the motion; scenes that differ in nothing else share a motion
    scene: Scene
    windows: WindowsPart
    labels: Mapping[str, Any]  #: constant columns
    schema: pa.Schema  #: schema of the file

    @property
    def count(self) -> int:
        """Number of windows written until now."""
        return int(pq.read_metadata(self.file).num_rows) if self.file.exists() else 0

    def overloads(self) -> dict[str, int]:
        """Numbers of cut samples in the windows, by sensors that have a range."""
        if OVERLOADS not in self.schema.names or not self.file.exists():
            return {}
        table = pq.read_table(self.file, columns=['sensor', OVERLOADS])
        found: dict[str, int] = {}
        for sensor, cut in zip(*(column.to_pylist() for column in table.columns), strict=True):
            if cut is not None:
                found[sensor] = found.get(sensor, 0) + cut
        return found

    def writer(self, name: str, since: float, channels: Channels) -> ShardWriter:
        """Writer of its windows."""
        return ShardWriter(self, name, since, channels)


def shards(plan: SweepPlan, folder: Path) -> dict[int, Shard]:
    """The file of every run of a sweep with windows, by the number of the run."""
    assert plan.windows  # noqa: S101 - it has some
    columns, size = plan.labels(), plan.windows.samples
    kind = pa.list_(pa.from_numpy_dtype(np.dtype(plan.windows.type)), size)
    fields = [
        *(_field(c.name, field_type(pa, c.values) or pa.string(), c.unit) for c in columns),
        _field('sensor', pa.string()),
        _field('window', pa.int32(), '', 'number within the run and sensor'),
        _field('start', pa.float64(), 's', 'when the first sample is due'),
        _field('crank_angle', pa.float64(), 'rad', 'of the main drive at the start, 0 to 2 pi'),
        _field('crank_speed', pa.float64(), 'rad/s', 'of the main drive at the start'),
        _field('sample_rate', pa.float64(), 'Hz'),
        _field('quantity', pa.string(), '', 'acceleration [m/s^2] or what it was integrated to'),
        _field('seed', pa.uint32(), '', 'of the noise of this run'),
        *(
            [
                _field(
                    OVERLOADS, pa.int32(), '', 'samples cut at the end of the range, if it has one'
                )
            ]
            if any(
                run.scene.sensors[name].adc.range
                for run in plan.runs
                for name in plan.windows.sensors_of(run.scene)
            )
            else []
        ),
        _field(_SIGNAL, kind, 'SI', f'{size} consecutive samples'),
    ]
    schema = pa.schema(fields, {'sweep': plan.name, 'title': plan.title})

    found = {}
    for run in plan.runs:
        labels, file = {c.name: c.values[run.index] for c in columns}, f'{run.stem}.parquet'
        found[run.index] = Shard(folder / file, run.scene, plan.windows, labels, schema)
    return found


def _field(name: str, kind: Any, unit: str = '', meaning: str = '') -> Any:
    """A field of a table, with its unit and what it means as metadata."""
    about = {k: v for k, v in (('unit', unit), ('meaning', meaning)) if v}
    return pa.field(name, kind, metadata=about or None)


class ShardWriter:
    """Measures a motion with the sensors of a shard and writes its windows.

    The file appears when it is complete; one that is there already is replaced.

    Parameters
    ----------
    name : name of the scene
    since : [s] windows that begin earlier are left out
    channels : those of other shards of this motion, which may serve this one too; it adds its own
    """

    def __init__(self, shard: Shard, name: str, since: float, channels: Channels) -> None:
        self._shard, machine = shard, Machine(name, shard.scene)
        scene, windows = machine.scene, shard.windows
        self._main = machine.mechanism.coordinates.index(machine.plan.main)
        self._sensors = [
            _ShardSensor(shard, machine, n, since, channels) for n in windows.sensors_of(scene)
        ]
        self._rows: list[dict[str, Any]] = []
        self._signals: list[np.ndarray[Any, Any]] = []
        self._curves: list[PiecewisePolynomial] = []  # motion in which windows may begin
        self._part = shard.file.with_name(f'.{shard.file.name}.part')
        with file_errors(shard.file):
            self._part.unlink(missing_ok=True)  # left by an interrupted run
            self._stream = self._part.open('xb')
            self._parquet = pq.ParquetWriter(
                self._stream,
                shard.schema,
                compression='zstd',
                use_dictionary=[f.name for f in shard.schema if f.name != _SIGNAL],
                column_encoding={f'{_SIGNAL}.list.element': 'BYTE_STREAM_SPLIT'},
            )

    def add(self, piece: Piece) -> None:
        """Measure the piece that follows, and write the windows that it completes."""
        motion = piece.motion
        if len(motion):
            self._curves.append(motion.curve)
        for sensor in self._sensors:
            if not sensor.done:
                sensor.channel.take(motion)
        self._gather(final=False)
        reached = min(math.inf if s.done else s.cutter.next_start for s in self._sensors)
        self._curves = [curve for curve in self._curves if curve.end >= reached]

    def _gather(self, final: bool) -> None:
        for sensor in self._sensors:
            for window in sensor.windows(final):
                self._rows.append(sensor.row(window) | self._crank(window.start))
                self._signals.append(window.samples)
                if len(self._rows) == _ROWS:
                    self._flush()

    def finish(self) -> None:
        """Write what is left, and give the file its name."""
        self._gather(final=True)
        wanted = self._shard.windows.per_run or 1
        for sensor in self._sensors:
            if sensor.count < wanted:
                raise InputError(
                    f"sensor '{sensor.name}' gave {sensor.count} windows, not {wanted}: run "
                    'longer, or ask for fewer or shorter ones'
                )
        self._flush()
        with file_errors(self._shard.file):
            self._parquet.close()
            self._stream.flush()
            os.fsync(self._stream.fileno())
            self._stream.close()
            self._part.replace(self._shard.file)

    def _crank(self, t: float) -> dict[str, float]:
        curve = next(c for c in self._curves if t < c.end or c is self._curves[-1])
        k = min(max(int(curve.start.searchsorted(t, side='right')) - 1, 0), len(curve) - 1)
        dt = (t - float(curve.start[k])) - float(curve.start_low[k])
        # plain numbers, in the order of `PiecewisePolynomial.local`: far faster for one instant
        powers = curve.coefficients[k, self._main].tolist()
        angle = speed = 0.0
        for j in range(len(powers) - 1, -1, -1):
            angle = angle * dt + powers[j]
            if j:
                speed = speed * dt + j * powers[j]
        return {'crank_angle': angle % TWO_PI, 'crank_speed': speed}

    def _flush(self) -> None:
        if not self._rows:
            return
        schema = self._shard.schema
        flat = np.concatenate(self._signals).astype(self._shard.windows.type)
        columns = [
            pa.array([row[field.name] for row in self._rows], field.type)
            if field.name != _SIGNAL
            else pa.FixedSizeListArray.from_arrays(pa.array(flat), type=field.type)
            for field in schema
        ]
        with file_errors(self._shard.file):
            self._parquet.write_batch(pa.record_batch(columns, schema))
        self._rows, self._signals = [], []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_failure: object) -> None:
        if not self._stream.closed:  # the run failed, or the disk
            with suppress(OSError):
                self._parquet.close()
            with suppress(OSError):
                self._stream.close()
            self._part.unlink(missing_ok=True)


class _ShardSensor:
    """A sensor of a shard: its channel, its cutter, and the labels of its rows."""

    def __init__(
        self, shard: Shard, machine: Machine, name: str, since: float, channels: Channels
    ) -> None:
        scene = machine.scene.sensors[name]
        self.name, self.count = name, 0
        frames = machine.scene.model_dump_json(include={'oscillators'})
        key = f'{name} {scene.model_dump_json(exclude=_DIGITAL)} {frames}'
        self.channel = machine.channel(name, channels.get(key))
        channels.setdefault(key, self.channel)
        self._most = shard.windows.per_run or math.inf
        self.cutter = Cutter(shard.windows, scene.sample_rate, since)
        self._labels = {
            **shard.labels,
            'sensor': name,
            'sample_rate': scene.sample_rate,
            'quantity': scene.measures,
            'seed': scene.noise.seed,
        }

    @property
    def done(self) -> bool:
        """True if the requested number of windows is complete."""
        return self.count >= self._most

    def windows(self, final: bool) -> Iterator[SampleWindow]:
        """Yield the windows completed by now, until enough of them are made."""
        for window in self.cutter.cut(self.channel.blocks(final)):
            if not self.done:
                yield window
                self.count += 1

    def row(self, window: SampleWindow) -> dict[str, Any]:
        """All of a row but its signal and the crank."""
        cut = window.overloads if self.channel.instrument.adc.range else None
        return {**self._labels, 'window': self.count, 'start': window.start, OVERLOADS: cut}
