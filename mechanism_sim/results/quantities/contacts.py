"""Contacts of joints with clearance: gaps, forces, states."""

from __future__ import annotations

from collections.abc import Iterator

from mechanism_sim.hybrid.events import Mode
from mechanism_sim.results.quantity import Quantity
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
