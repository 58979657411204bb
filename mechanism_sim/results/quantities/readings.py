"""Readings of cams, gears and Geneva wheels: the fields of their messages, as quantities."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_type_hints

from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.view import Told
from mechanism_sim.results.quantity import Quantity, Shown
from mechanism_sim.scene import Machine


def of_readings(machine: Machine) -> Iterator[Quantity]:
    """``FIELD.JOINT``, or ``FIELD.JOINT.x`` and ``.y`` of fields ``FIELD_x`` and ``FIELD_y``."""
    for joint in machine.mechanism.joints:
        if not isinstance(joint, HigherPair) or joint.reads is None:
            continue
        for field, hint in get_type_hints(joint.reads, include_extras=True).items():
            notes = getattr(hint, '__metadata__', ())
            if not (notes and isinstance(told := notes[0], Told)) or field in joint.untold:
                continue
            known = machine.physics.has_forces and joint.name not in machine.physics.undetermined
            if known or not told.is_force:
                yield _of_field(machine, joint, field, told)


def _of_field(machine: Machine, joint: HigherPair, field: str, told: Told) -> Quantity:
    link = joint.first if told.slides == 'first' else joint.second
    unit = told.units[-1] if joint.slides(link, machine.mechanism) else told.units[0]
    kind, _, axis = field.rpartition('_')
    part = axis if axis in ('x', 'y') else ''
    return Quantity(
        f'{kind}.{joint.name}.{part}' if part else f'{field}.{joint.name}', unit,
        told.words.format(first=joint.first, second=joint.second), joint.name,
        lambda view: view.reading(joint, field),
        Shown.ASKED if told.repeats else Shown.PARTS, part, counted=unit == '',
        difference=told.difference,
    )  # fmt: skip
