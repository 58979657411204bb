"""Springs, dampers and servos: their force and length; states of first order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.linkages.springs import Elongation, TorsionSpring
from mechanism_sim.numerics.symbolic import Term, neg
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.results.quantity import Quantity, Shown
from mechanism_sim.results.view import View
from mechanism_sim.scene import Machine
from mechanism_sim.units import product


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
    """Forces and lengths of springs, compiled when they are first asked for."""

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
