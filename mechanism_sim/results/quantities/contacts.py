"""Contacts of joints with clearance: gaps, forces, states."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_type_hints

from mechanism_sim.hybrid.events import Mode
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.view import Told
from mechanism_sim.results.quantity import Quantity, Shown
from mechanism_sim.scene import Machine


def of_contacts(machine: Machine) -> Iterator[Quantity]:
    """``gap.JOINT``, ``normal_force.``, ``friction_force.``, ``closed.``, ``mode.``."""
    for i, joint in enumerate(machine.physics.clearances):
        yield from _of_contact(i, joint)


def _of_contact(i: int, joint: str) -> Iterator[Quantity]:
    yield Quantity(
        f'gap.{joint}',
        'm',
        f'gap in {joint}',
        joint,
        lambda view: view.observed.gap[i],
        difference=True,
    )
    yield Quantity(
        f'normal_force.{joint}', 'N', f'normal force in {joint}', joint,
        lambda view: view.observed.normal_force[i],
    )  # fmt: skip
    yield Quantity(
        f'friction_force.{joint}', 'N', f'friction force in {joint}', joint,
        lambda view: view.observed.friction_force[i],
    )  # fmt: skip
    yield Quantity(
        f'closed.{joint}', '', f'contact in {joint}: 1, or 0 in free flight', joint,
        lambda view: (view.modes[i] > Mode.FREE_FLIGHT).astype(float), counted=True,
    )  # fmt: skip
    yield Quantity(
        f'mode.{joint}', '', f'mode of contact in {joint}, a number of Mode', joint,
        lambda view: view.modes[i].astype(float), counted=True,
    )  # fmt: skip


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
