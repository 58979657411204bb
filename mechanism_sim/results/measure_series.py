"""Sources of measures of events: impacts, changes of mode, samples of sensors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.hybrid.events import Impact, Mode
from mechanism_sim.numerics.expressions import numbers
from mechanism_sim.results.measure_text import Figure, as_row
from mechanism_sim.results.solution import IMPACT_UNITS, Piece
from mechanism_sim.results.time_integrals import EXACT
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.channel import Channel

_OF_EACH = ('mean', 'rms', 'percentile')  # which weigh events by number, not by time


class EventSeries:
    """Events and samples: their instants, and what is known of each."""

    def __init__(self, machine: Machine, figures: Sequence[Figure]) -> None:
        self._machine = machine
        names = list(dict.fromkeys(n for f in figures for n in f.names))
        self._parts = {name: self._resolve(name) for name in names}
        self._impacts: list[Impact] = []
        self._changes: list[tuple[float, str, bool]] = []
        self._channels: dict[str, Channel] = {
            joint: machine.channel(joint)
            for kind, joint, _ in self._parts.values()
            if kind == 'sensors' and joint
        }
        self._samples: dict[str, list[tuple[Array, Array]]] = {n: [] for n in self._channels}

    def _resolve(self, name: str) -> tuple[str, str | None, str]:
        """Kind, joint or sensor (None for all joints), and key of a name."""
        machine, (kind, *rest) = self._machine, name.split('.')
        if kind == 'sensors':
            sensors = list(machine.scene.sensors)
            if len(rest) != 1 or rest[0] not in sensors:
                named = '.'.join(rest)
                raise InputError(
                    f"{machine.name} has no sensor '{named}'{nearest(named, sensors)}; sensors: "
                    f'{", ".join(sensors) or "none"}'
                )
            return kind, rest[0], 'samples'
        joints = machine.physics.clearances
        joint = rest.pop(0) if rest and rest[0] in joints else None
        key = rest.pop(0) if rest else ''
        keys = list(IMPACT_UNITS) if kind == 'impacts' else ['t']
        if rest or (key and key not in keys):
            raise InputError(
                f"{machine.name}: there is no '{name}'"
                f'{nearest(key, [*joints, *keys])}; loose joints: {", ".join(joints) or "none"}; '
                f'of {kind} are known {", ".join(keys)}'
            )
        return kind, joint, key

    def unit(self, f: Figure) -> str:
        """The unit of what a figure is of."""
        return f.unit({name: self._unit_of(name) for name in f.names})

    def _unit_of(self, name: str) -> str:
        kind, joint, key = self._parts[name]
        if kind == 'sensors':
            return str(self._machine.scene.sensors[str(joint)].unit)
        return IMPACT_UNITS.get(key, '')

    def add(self, piece: Piece) -> None:
        """Enter what happened in the piece that follows."""
        if not self._parts:
            return
        self._impacts += piece.impacts
        for c in piece.modes:
            lost = c.mode == Mode.FREE_FLIGHT and c.previous > Mode.FREE_FLIGHT
            self._changes.append((c.t, c.joint, lost))
        for name, channel in self._channels.items():
            channel.take(piece.motion)
            self._take(name)

    def finish(self) -> None:
        """Let the channels give what they have left."""
        for name in self._channels:
            self._take(name, final=True)

    def _take(self, name: str, final: bool = False) -> None:
        channel = self._channels[name]
        rate = channel.instrument.sample_rate
        for block in channel.blocks(final):
            t = block.time + np.arange(len(block.samples)) / rate
            self._samples[name].append((t, block.samples))

    def values(self, f: Figure, since: float, until: float, last: bool) -> tuple[Array, Array]:
        """Instants (n,) and what the figure's expression is at each, within a window [s]."""
        kind, joint, _ = self._parts[f.names[0]]
        keys = {name: self._parts[name][2] for name in f.names}
        if kind == 'sensors':
            parts = self._samples[str(joint)]
            t, read = (np.concatenate([np.zeros(0), *(x[i] for x in parts)]) for i in (0, 1))
            known = dict.fromkeys(keys, read)
        elif kind == 'impacts':
            impacts = [i for i in self._impacts if joint in (None, i.joint)]
            t = np.array([i.t for i in impacts], float)
            known = {
                name: np.array([getattr(i, key) if key else 1.0 for i in impacts], float)
                for name, key in keys.items()
            }
        else:
            t = np.array([
                at for at, of, lost in self._changes
                if joint in (None, of) and (lost or kind == 'modes')
            ], float)  # fmt: skip
            known = {name: t if key else np.ones(len(t)) for name, key in keys.items()}
        x = as_row(numbers(f.tree, known), len(t))
        inside = (t >= since) & ((t <= until) if last else (t < until))
        return t[inside], x[inside]

    def note(self, f: Figure, count: int) -> str:
        """Of how many samples a figure is, or events if it weighs each of them alike."""
        kind, name, _ = self._parts[f.names[0]]
        if kind != 'sensors':
            return f'of {count} {kind}' if f.function in _OF_EACH else EXACT
        rate = self._machine.scene.sensors[str(name)].sample_rate
        return f'of {count} samples at {rate:g} Hz'
