"""Quantities of a machine in motion by name, and the view that evaluates them."""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.energy_terms import EnergyTerms, energy_so_far
from mechanism_sim.engine.physics import each_instant
from mechanism_sim.numerics.polynomials import TWO_PI, Nodes
from mechanism_sim.planar.frames import STATE
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.mechanism import HigherPair, Joint
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.joint_view import JointView
from mechanism_sim.vibration.shaken_frame import WholeMachine

T = TypeVar('T')
PARTS = 'x', 'y', 'size', 'direction', 'moment', 'along', 'across', 'axial'
"""Parts of a vector, as the last word of a name."""


class View:
    """A machine at N instants; values shared by quantities are computed once, when needed.

    All that is said of an instant belongs to one segment of the motion: where something changes,
    to that which begins there, and at the end of the motion to the last.

    Parameters
    ----------
    segments, dt : instants as those of ``motion.curve.at(segments, dt)``
    balance : energy terms of the motion for cumulative quantities, or a function for them
    t : times of the instants (N,) [s], if known
    static : True if inertia forces are left out
    """

    def __init__(
        self,
        machine: Machine,
        motion: Motion,
        segments: NDArray[np.intp],
        dt: Array | Nodes,
        balance: EnergyTerms | Callable[[], EnergyTerms] | None = None,
        t: Array | None = None,
        static: bool = False,
    ) -> None:
        self.machine, self._motion, self._balance = machine, motion, balance
        self._segments, self._dt, self._static = segments, dt, static
        self._physics = machine.nominal.statics if static else machine.physics
        self._known: dict[Hashable, Any] = {}
        if t is not None:
            self.t = t

    @classmethod
    def at(
        cls,
        machine: Machine,
        motion: Motion,
        t: Array,
        balance: EnergyTerms | Callable[[], EnergyTerms] | None = None,
        static: bool = False,
    ) -> Self:
        """The view at times (N,) [s]."""
        return cls(machine, motion, *motion.curve.find(t), balance, t, static)

    @cached_property
    def _instants(self) -> tuple[NDArray[np.intp], Array]:
        """The segment of each instant, and the time since its start [s]."""
        return each_instant(self._motion.curve, self._segments, self._dt)

    @cached_property
    def t(self) -> Array:
        """Times (N,) [s]."""
        return self._motion.curve.times(*self._instants)

    @cached_property
    def observed(self) -> Observation:
        """Accelerations, forces and energies."""
        return self._physics.observe(self._motion, self._segments, self._dt)

    def trajectory(self, derivatives: int) -> tuple[Array, ...]:
        """Coordinates (n, N) without whole turns and so many derivatives, at most two.

        The first needs no forces, which the second follows from.
        """
        if derivatives < 2 and not self.is_observed:
            return self._moved[: 1 + derivatives]
        o = self.observed
        return (o.local, o.velocity, o.acceleration)[: 1 + derivatives]

    @property
    def is_observed(self) -> bool:
        """True if accelerations or forces have been computed."""
        return 'observed' in self.__dict__

    @cached_property
    def _moved(self) -> tuple[Array, Array]:
        return self._physics.moved(self._motion, self._segments, self._dt)

    @cached_property
    def position(self) -> Array:
        """Coordinates (n, N), with their whole turns."""
        turns = self._motion.curve.turns_at(self._segments, self._dt).T
        (place,) = self.trajectory(0)
        return place + TWO_PI * turns if turns.any() else place

    def states(self, derivative: int = 0) -> Array:
        """The states of first order (k, N), or their rates."""
        curve = self._motion.state_curve
        if not curve.turns.shape[1]:
            return np.zeros((0, len(self.t)))
        return np.asarray(curve.local(self._segments, self._dt, derivative).T)

    def outside(self, names: Sequence[str]) -> Array:
        """Rows (k, N) of further inputs of loads, see `Frames.outside`."""
        turns = zip(self._physics.coordinates, self.observed.turns, strict=True)
        known = {'time': self.t, **{f'{c}.turns': n for c, n in turns}}
        known |= {f'{STATE}{k}': x for k, x in enumerate(self.states())}
        return np.reshape([known[name] for name in names], (len(names), len(self.t)))

    def on_frame(self, forces: WholeMachine) -> Array:
        """Force x, y [N] and moment [N m] (3, N) of a machine on its frame."""
        trajectory = self.observed.local, self.observed.velocity, self.observed.acceleration
        return forces.along(
            self._motion, self._segments, self._dt, trajectory, self.observed.load, self._static
        )

    @cached_property
    def modes(self) -> NDArray[np.uint8]:
        """States (m, N) of the gaps, see `mechanism_sim.engine.events.Mode`."""
        return self._motion.modes_at(self._segments, self._dt)

    @property
    def drive_work(self) -> Array:
        """Work (N,) [J] of the drives since the start of the run."""
        return self._so_far[0]

    @property
    def dissipated(self) -> Array:
        """Losses (N,) [J] since the start of the run."""
        return self._so_far[1]

    @cached_property
    def _so_far(self) -> tuple[Array, Array]:
        if self._balance is None:
            raise ValueError('the work up to this time is not known for this motion')
        balance = self._balance() if callable(self._balance) else self._balance
        return energy_so_far(self._physics, self._motion, balance, *self._instants)

    def joint(self, joint: Joint) -> JointView:
        """One of its joints."""
        return self.once(
            ('joint', joint.name),
            lambda: JointView(
                self.machine.mechanism, joint, self.machine.physics, self.observed, self.modes
            ),
        )

    def readings(self, pair: HigherPair) -> dict[str, NDArray[Any]]:
        """The readings (N,) of a cam, gears or a Geneva wheel, by field."""
        return self.once(('readings', pair.name), lambda: pair.reading(self.joint(pair))._asdict())

    def reading(self, pair: HigherPair, field: str) -> Array:
        """A field (N,) of them."""
        return np.asarray(self.readings(pair)[field], float)

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """Result of `make`, made once for all quantities that ask for this key."""
        if key not in self._known:
            self._known[key] = make()
        found: T = self._known[key]
        return found


class Shown(IntEnum):
    """Tables that contain a quantity by default."""

    ASKED = 0  #: in none; on request only
    CYCLE = 1  #: in those of a cycle
    PARTS = 2  #: also in charts and measures of a bag: contacts, teeth, bearings, elastic links
    RUN = 3  #: also in those of a run, `Piece.sample`


@dataclass(frozen=True, eq=False)
class Quantity:
    """A quantity of a machine."""

    name: str  #: ``KIND``, ``KIND.OF`` or ``KIND.OF.PART``
    unit: str  #: SI; empty for a number
    words: str  #: description, as in the title of a chart
    of: str  #: its coordinate, joint, link or point; empty for the whole machine
    #: function that returns its values (N,) in a view of N instants
    evaluate: Callable[[View], Array]
    shown: Shown = Shown.RUN  #: tables that contain it by default
    part: str = ''  #: component of a vector, one of `PARTS`; else empty
    counted: bool = False  #: True if it is a state or a count, without extremes
    #: True if it is a difference of lengths of the machine's size, with their rounding
    difference: bool = False
    #: True if it is an integral over the motion so far, at eight times the cost
    cumulative: bool = False

    @property
    def kind(self) -> str:
        """The first part of its name."""
        return self.name.partition('.')[0]

    @property
    def title(self) -> str:
        """Title of an axis: the words without the part, and without ``x`` or ``y``."""
        words = self.words.removesuffix(f', {self.part}')
        return re.sub(rf' (of|in|on) {re.escape(self.of)}(?![\w.])', '', words, count=1)

    @property
    def has_extremes(self) -> bool:
        """True if its least and greatest values are meaningful."""
        return not self.counted and self.part != 'direction'


def evaluated(quantities: Mapping[str, Quantity], view: View) -> dict[str, Array]:
    """Values (N,) by name: first those that need forces, which also serve the others."""
    last = 'position', 'velocity'
    found = {
        name: quantities[name].evaluate(view)
        for name in sorted(quantities, key=lambda name: quantities[name].kind in last)
    }
    return {name: found[name] for name in quantities}


def magnitude(
    name: str, unit: str, words: str, of: str, evaluate: Callable[[View], Array], shown: Shown
) -> Quantity:
    """Magnitude ``.size`` of a vector with components `evaluate` (2, N)."""
    return Quantity(
        f'{name}.size', unit, words, of, lambda view: np.hypot(*evaluate(view)), shown, 'size'
    )


def direction(
    name: str, words: str, of: str, evaluate: Callable[[View], Array], shown: Shown
) -> Quantity:
    """Direction ``.direction`` [rad] of a vector with components `evaluate` (2, N)."""
    return Quantity(
        f'{name}.direction', 'rad', f'direction of the {words}', of,
        lambda view: np.arctan2(*evaluate(view)[::-1]), shown, 'direction',
    )  # fmt: skip


def vector(
    name: str,
    unit: str,
    words: str,
    of: str,
    evaluate: Callable[[View], Array],
    shown: Shown = Shown.RUN,
) -> Iterator[Quantity]:
    """Components ``.x`` and ``.y`` of a vector, from `evaluate` (2, N)."""
    yield Quantity(
        f'{name}.x', unit, f'{words}, x', of, lambda view: evaluate(view)[0], shown, 'x'
    )
    yield Quantity(
        f'{name}.y', unit, f'{words}, y', of, lambda view: evaluate(view)[1], shown, 'y'
    )
