"""Messages of a run that are no samples: its scene, its laws and its events."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from typing import Any

import numpy as np

from mechanism_sim import strict_json
from mechanism_sim.engine.events import Impact as ImpactEvent
from mechanism_sim.engine.events import ModeChange as ModeChangeEvent
from mechanism_sim.errors import InputError
from mechanism_sim.planar.drive import DriveLaw as MotionLaw
from mechanism_sim.planar.drive import Law, TorqueLaw
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene
from mechanism_sim.scene.machine import Machine
from ros_interfaces.classes import float64_array, message_class
from ros_interfaces.layout import Layout
from ros_interfaces.stamps import stamp


def describe(machine: Machine) -> str:
    """The scene as JSON, in SI units, and which of its coordinates are displacements.

    `parse_description` makes the machine of it again.
    """
    displacements = machine.mechanism.displacements
    content = {'name': machine.name, 'scene': machine.scene.to_document()}
    return strict_json.dumps(content | {'displacements': displacements})


def parse_description(text: str, source: str) -> Machine:
    """The machine of such a description.

    Parameters
    ----------
    source : origin of the message, for errors
    """
    try:
        content = strict_json.loads(text)
        name, scene = str(content['name']), dict(content['scene'])
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(f'{source} does not hold its scene: its machine is unknown.') from error
    return build(name, check_scene(f'the scene in {source}', scene))


def drive_law(
    law: Law,
    law_id: int,
    until: float,
    final: bool,
    announced: float,
    run: int = 0,
    again: bool = False,
) -> Any:
    """DriveLaw message: a law that holds up to `until` [s], published at `announced` [s]."""
    kind = message_class('mechanism_sim/msg/DriveLaw')
    message = kind(
        run=run,
        coordinate=law.coordinate,
        kind=kind.PRESCRIBED if isinstance(law, MotionLaw) else kind.TORQUE,
        law_id=law_id,
        valid_from=law.valid_from,
        valid_until=until,
        final=final,
        again=again,
        reference_time=law.reference_time if isinstance(law, MotionLaw) else 0.0,
        turns=law.turns if isinstance(law, MotionLaw) else 0,
        coefficients=float64_array(list(law.coefficients)),
    )
    message.header.stamp = stamp(announced)
    return message


def law_of(message: Any, displacements: Container[str]) -> Law:
    """The law of the drive that a DriveLaw message announces."""
    name, since = message.coordinate, message.valid_from
    coefficients = [float(c) for c in message.coefficients]
    if message.kind == message_class('mechanism_sim/msg/DriveLaw').TORQUE:
        constant, per_angle, per_speed = coefficients
        return TorqueLaw(name, (constant, per_angle, per_speed), since)
    straight, reference = name in displacements, message.reference_time
    return MotionLaw(name, tuple(coefficients), reference, since, straight, int(message.turns))


def scene_change(path: str, value: float, time: float) -> Any:
    """SceneChange message: a value that holds from `time` [s] on."""
    message = message_class('mechanism_sim/msg/SceneChange')(time=time, path=path, value=value)
    message.header.stamp = stamp(time)
    return message


def impact(event: ImpactEvent, index: int, frame: str = '') -> Any:
    """Impact message; `frame` is that of the directions, of the ground link."""
    message = message_class('mechanism_sim/msg/Impact')(
        time=event.t, index=index, joint=event.joint, **_impact_fields(event)
    )
    message.header.stamp, message.header.frame_id = stamp(event.t), frame
    return message


def _impact_fields(event: ImpactEvent) -> dict[str, Any]:
    """Fields of an impact, or of many, whose values are arrays (N,) then."""
    return {
        'normal_angle': event.normal_angle,
        'approach_speed': event.approach_speed,
        'rebound_speed': event.rebound_speed,
        'normal_impulse': event.normal_impulse,
        'tangential_impulse': event.tangential_impulse,
        'energy_loss': event.energy_loss,
        'drive_impulse': event.drive_impulse,
        'ends_chatter': event.ends_chatter,
        'chatter_time': event.chatter_time,
        'duration': event.duration,
        'peak_force': event.peak_force,
    }


def mode_change(event: ModeChangeEvent) -> Any:
    """ModeChange message."""
    message = message_class('mechanism_sim/msg/ModeChange')(
        time=event.t, joint=event.joint, **_mode_fields(event)
    )
    message.header.stamp = stamp(event.t)
    return message


def _mode_fields(event: ModeChangeEvent) -> dict[str, Any]:
    """Fields of a change of mode, or of many."""
    return {'mode': event.mode, 'previous_mode': event.previous}


class EventWriter:
    """Serialises events in bulk: the same bytes as those of `impact` and `mode_change`."""

    def __init__(self, frame: str = '') -> None:
        self._frame = frame
        self._layouts: dict[tuple[type, str], Layout] = {}  # by class and joint

    def impacts(self, events: Sequence[ImpactEvent], first: int) -> list[bytes]:
        """Impact messages, counted from `first`."""
        if not events:
            return []
        many = ImpactEvent._make(map(np.array, zip(*events, strict=True)))
        columns = {**_impact_fields(many), 'index': np.arange(first, first + len(events))}
        return self._write(events, columns, lambda event: impact(event, 0, self._frame))

    def mode_changes(self, events: Sequence[ModeChangeEvent]) -> list[bytes]:
        """ModeChange messages."""
        if not events:
            return []
        many = ModeChangeEvent._make(map(np.array, zip(*events, strict=True)))
        return self._write(events, _mode_fields(many), mode_change)

    def _write(
        self, events: Sequence[Any], columns: dict[str, Any], make: Callable[[Any], Any]
    ) -> list[bytes]:
        made: list[bytes] = [b''] * len(events)
        t, joints = np.array([event.t for event in events]), [event.joint for event in events]
        for joint in dict.fromkeys(joints):
            which = [i for i, name in enumerate(joints) if name == joint]
            key = type(events[which[0]]), joint
            layout = self._layouts.get(key)
            if layout is None:
                layout = self._layouts[key] = Layout(make(events[which[0]]))
            chosen = {name: values[which] for name, values in columns.items()}
            for i, data in zip(which, layout.write(t[which], chosen), strict=True):
                made[i] = data
        return made
