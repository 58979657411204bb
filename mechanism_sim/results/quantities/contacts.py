"""Quantities of contacts, of readings of cams, gears, Geneva wheels, of force elements, states."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import get_type_hints

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.events import Mode
from mechanism_sim.linkages.springs import Elongation, TorsionSpring
from mechanism_sim.numerics.symbolic import Term, neg
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.planar.view import Told
from mechanism_sim.results.quantity import Quantity, Shown, View
from mechanism_sim.scene import Machine
from mechanism_sim.units import product


def of_contacts(machine: Machine) -> Iterator[Quantity]:
    """``gap.JOINT``, ``normal_force.``, ``friction_force.``, ``closed.``, ``mode.``."""
    for i, joint in enumerate(machine.physics.clearances):
        yield from _of_contact(i, joint)


def _of_contact(i: int, joint: str) -> Iterator[Quantity]:
    yield Quantity(
        f'gap.{joint}', 'm', f'gap in {joint}', joint, lambda view: view.observed.gap[i],
        difference=True,
    )  # fmt: skip
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
            if known or told.units[-1] not in ('N', 'N m'):  # of forces only where masses are
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


def of_states(machine: Machine) -> Iterator[Quantity]:
    """``state.NAME``, ``state_rate.NAME`` of the states of first order."""
    for number, state in enumerate(machine.plan.states):
        name, unit = state.label, state.unit
        yield Quantity(f'state.{name}', unit, f'state {name}', name, _state(number, 0))
        yield Quantity(
            f'state_rate.{name}', product(unit, 's', -1), f'rate of the state {name}', name,
            _state(number, 1), Shown.ASKED,
        )  # fmt: skip


def _state(number: int, derivative: int) -> Callable[[View], Array]:
    return lambda view: view.states(derivative)[number]


def of_force_elements(machine: Machine) -> Iterator[Quantity]:
    """``spring.NAME.force``, ``.length``; ``.torque``, ``.angle`` of a torsion spring; servos."""
    mechanism = machine.mechanism
    elements = [x for x in machine.plan.elements(mechanism) if isinstance(x, Elongation)]
    function = _ForceElements(machine, elements)
    for k, element in enumerate(elements):
        section, _, name = element.name.partition('.')
        turns = isinstance(element, TorsionSpring)
        own = (('torque', 'N m'), ('angle', 'rad')) if turns else (('force', 'N'), ('length', 'm'))
        for row, (kind, unit) in zip((2 * k, 2 * k + 1), own, strict=True):
            words = f'{kind} of the {section.removesuffix("s")} {name}'
            yield Quantity(
                f'{section.removesuffix("s")}.{name}.{kind}', unit, words, name,
                function.row(row), Shown.ASKED,
            )  # fmt: skip


def _effort(element: Elongation, frames: Frames) -> Term:
    """Pull of a spring, push of a servo."""
    pull = element.pull(frames)
    return neg(pull) if element.name.startswith('servos.') else pull


class _ForceElements:
    """Forces and lengths of springs, compiled when first needed."""

    def __init__(self, machine: Machine, elements: Sequence[Elongation]) -> None:
        self._machine, self._elements = machine, elements
        self._function: SwitchedFunction | None = None
        self._outside: tuple[str, ...] = ()

    def row(self, number: int) -> Callable[[View], Array]:
        """Forces and lengths in turn, of one element after the other."""
        return lambda view: view.once(('force elements',), lambda: self._rows(view))[number]

    def _rows(self, view: View) -> Array:
        if self._function is None:
            frames = Frames(self._machine.mechanism.coordinates, Parameters())
            terms = [
                x for e in self._elements for x in (_effort(e, frames), e.measured(frames)[0])
            ]
            self._outside = tuple(frames.outside)
            known = [*frames.q.values(), *frames.v.values(), *frames.outside.values()]
            self._function = SwitchedFunction(frames, [terms], known)
        o = view.observed
        (found,) = self._function(
            np.concatenate([o.local, o.velocity, view.outside(self._outside)])
        )
        return found
