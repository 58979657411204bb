"""A drive that swings between the limits of its own linkage, written as a position over time."""

from __future__ import annotations

import math

from mechanism_sim.errors import InputError
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.motion_keys import PositionPart
from mechanism_sim.scene.schema import Scene
from mechanism_sim.units import QuantityValue

_MARGIN = 0.01
"""Of the way between the limits, at either: at a limit itself two ways lead on."""


def with_swing(scene: Scene) -> Scene:
    """The scene, with a formula of its position instead of `drive.swing`."""
    drive = scene.drive
    if any(x.swing for x in scene.drives.values()) or (scene.drives and drive and drive.swing):
        raise InputError("'swing' is for a machine with a single drive, 'drive'")
    if drive is None or drive.swing is None:
        return scene
    beside = [
        k for k in ('position', 'moves', 'profile', 'speed') if getattr(drive, k) is not None
    ]
    if beside:
        raise InputError(f'drive.swing and drive.{beside[0]} exclude each other: keep one')
    steady = drive.model_copy(update={'swing': None, 'speed': QuantityValue(1.0, '')})
    plain = Machine('', scene.model_copy(update={'drive': steady, 'duration': None})).rigid
    plan, c = plain.plan, plain.plan.main
    found = None if plain.torque_driven else plain.nominal.drive_range
    if found is None or not math.isfinite(found.high - found.low):
        raise InputError(f'drive.swing: {c} has no limits on both sides to swing between')
    unit = 'm' if c in plan.ideal.displacements else 'rad'
    turned = 2.0 * math.pi * plan.turned.get(c, 0)
    way, middle = found.high - found.low, turned + 0.5 * (found.low + found.high)
    margin = drive.swing.margin
    aside = _MARGIN * way
    if margin is not None:
        aside = plan.measure('drive.swing.margin', margin, unit == 'm', ('rad', 'm'))
    size, start = 0.5 * way - aside, turned + plan.held[c][0] - middle
    if not size > 0.0 or abs(start) > size:
        raise InputError(
            f'drive.swing: {c} starts at {start + middle:g} {unit}, which is not between '
            f'{middle - size:g} and {middle + size:g} {unit}, its limits with the margin'
        )
    phase, pace = math.asin(start / size), 2.0 * math.pi / drive.swing.period
    text = f'{middle!r} {unit} + {size!r} {unit}*sin({pace!r}*t + {phase!r})'
    position = PositionPart(formula=text.replace('+ -', '- '), points=None)
    update = {'swing': None, 'position': position, 'start_angle': None, 'start_position': None}
    return scene.model_copy(update={'drive': drive.model_copy(update=update)})
