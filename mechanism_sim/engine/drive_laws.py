"""The laws of the drives in a run: those that hold, those to come, and the base of their time."""

from __future__ import annotations

import math
from bisect import insort
from collections import deque
from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np

from mechanism_sim.engine.clock import base_at, horner, take_off_turns
from mechanism_sim.engine.present_state import PresentState
from mechanism_sim.errors import RunError
from mechanism_sim.planar.drive import DriveLaw, Law, LawSource


class LawSchedule:
    """Schedule of laws of drives: those in force, and the announced ones or those of sources.

    Attributes
    ----------
    laws, coming : laws that hold now, and announced ones in the order of time
    """

    def __init__(self, laws: Sequence[Law]) -> None:
        self.begin(laws)

    def begin(self, laws: Sequence[Law]) -> None:
        """Set the laws that hold from now on, and discard all announced ones."""
        self._sources: dict[str, LawSource] = {}
        self.restore(laws, ())

    def restore(self, laws: Sequence[Law], coming: Sequence[Law]) -> None:
        """Let laws hold and others follow, beside those of the sources."""
        self.laws, self.coming = list(laws), deque(coming)

    def announce(self, law: Law, known: float | Fraction) -> None:
        """Announce a law that replaces that of its coordinate from ``law.valid_from`` on.

        Parameters
        ----------
        known : time [s] up to which the motion is known

        Raises
        ------
        ValueError
            If the motion is already known beyond that time.
        """
        if law.valid_from < known:
            raise ValueError(
                f'a law valid from {law.valid_from:.9g} s comes too late: the motion is known '
                f'up to {float(known):.9g} s'
            )
        self._enter(law)

    def _enter(self, law: Law) -> None:
        insort(self.coming, law, key=lambda x: x.valid_from)

    def go_on_by(self, sources: Mapping[str, LawSource]) -> None:
        """Set sources of laws, by coordinate, for times without an announced law."""
        self._sources = dict(sources)
        for law in self.laws:
            self._continue(law)

    def _continue(self, law: Law) -> None:
        """Enter the law that follows one from its source, unless others are announced."""
        source = self._sources.get(law.coordinate)
        if source is None or any(x.coordinate == law.coordinate for x in self.coming):
            return
        if isinstance(law, DriveLaw) and (following := source.after(law)):
            self._enter(following)

    def switch(self) -> None:
        """Replace a law by the next announced one."""
        law = self.coming.popleft()
        index = [known.coordinate for known in self.laws].index(law.coordinate)
        before = self.laws[index]
        if isinstance(before, DriveLaw) and not (
            isinstance(law, DriveLaw) and law.continues(before)
        ):
            raise RunError(
                f'the law of {law.coordinate} valid from {law.valid_from:.9g} s jumps in angle or '
                'speed, which no drive can follow; join the laws by a ramp'
            )
        self.laws[index] = law
        self._continue(law)


class DriveLaws(LawSchedule):
    """Laws as coefficients of the integrator, counted from the present base.

    Parameters
    ----------
    present : the integrator's state, whose base is set
    laws : one for each prescribed coordinate, then one for each powered coordinate
    directions : cosines and sines of the steady drives among the integrator's states

    Attributes
    ----------
    next_base : local time [s] after which a new base is due
    next_change : local time [s] from which the next law holds; infinite if none is to come
    since : number of steps since the directions were computed from the angles
    """

    def __init__(
        self, present: PresentState, laws: Sequence[Law], directions: memoryview[float]
    ) -> None:
        super().__init__(laws)
        system = present.system
        self._present, self._system = present, system
        self.directions = directions
        self._turning = [system.prescribed.index(c) for c in system.turning]
        self.since = 0
        self.next_base, self.next_change = 0.0, math.inf

    def announce(self, law: Law, known: float | Fraction) -> None:
        """Announce a law; `ValueError` too if the system is not compiled for its degree."""
        if isinstance(law, DriveLaw) and law.degree > self._system.degree:
            raise ValueError(
                f'a law of degree {law.degree} needs equations compiled for it; these are for '
                f'degree {self._system.degree}'
            )
        super().announce(law, known)

    def _enter(self, law: Law) -> None:
        super()._enter(law)
        self._foresee()

    def _foresee(self) -> None:
        first = self.coming[0] if self.coming else None
        self.next_change = self._present.base.local(first.valid_from) if first else math.inf

    def switch(self) -> None:
        """Let the next law hold, and count time anew."""
        super().switch()
        self.rebase()

    def rebase(self) -> None:
        """Count time and turns anew from here, so that neither loses digits."""
        present, free = self._present, self._system.free
        turns = {c: present.base.turns[c] for c in free}
        for i, name in enumerate(free):
            if not self._system.angular[i]:
                continue
            whole, angle = take_off_turns(float(present.state[i]))
            if whole:
                turns[name] += whole
                present.state[i] = angle
        now = present.base.time + Fraction(present.integrator.time)
        present.integrator.time = 0.0
        self.count_from(now, turns)

    def count_from(self, time: Fraction, turns: Mapping[str, int]) -> None:
        """Set the base [s], with whole turns of the free coordinates, and the laws from there."""
        present, parameters = self._present, self._system.parameters
        present.base = base = base_at(time, self.laws, turns)
        self._foresee()
        for index, law in zip(parameters.laws, base.laws, strict=True):
            present.set(index, (*law, *[0.0] * len(index))[: len(index)])
        for index, torque in zip(parameters.torques, base.torques, strict=True):
            present.set(index, torque)
        for name, i in parameters.outside.items():
            present.pars[i] = base.high if name == 'time' else base.turns[name.rpartition('.')[0]]
        # a new base is due after a turn of the fastest drive, or at the present rates without one
        now = float(np.abs(present.v[list(self._system.angular)]).max(initial=0.0))
        fastest = max((abs(c[1]) for c in base.laws if len(c) > 1), default=now)
        self.next_base = min(2.0 * math.pi / fastest, 1.0) if fastest else 1.0

    def turn(self, tau: float) -> None:
        """Set cosine and sine of the steady drives, which drift by a rounding in each step."""
        for i, index in enumerate(self._turning):
            angle = horner(self._present.base.laws[index], tau)
            self.directions[2 * i], self.directions[2 * i + 1] = math.cos(angle), math.sin(angle)
        self.since = 0
