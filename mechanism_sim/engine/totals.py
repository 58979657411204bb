"""Events of a run so far, in numbers that do not grow with it."""

from __future__ import annotations

from collections.abc import Sequence

from mechanism_sim.engine.events import Impact, Impacts, Mode, ModeChange
from mechanism_sim.tolerances import TOLERANCES

_CONTACTS = TOLERANCES.contacts


class Totals:
    """Counts and sums of events, entered batch by batch.

    Attributes
    ----------
    impacts, mode_changes, losses_of_contact : numbers of events
    normal_impulse, largest_impulse : sum over all impacts, and largest value [N s]
    """

    def __init__(self) -> None:
        self.impacts = 0
        self.mode_changes = 0
        self.losses_of_contact = 0
        self.normal_impulse = 0.0
        self.largest_impulse = 0.0
        self._gains = 0
        self._made = 0.0
        self._instant = float('-inf')
        # at the last instant of impacts, which the next batch may go on with; and their works
        self._gain = self._work = 0.0

    def __repr__(self) -> str:
        return (
            f'<Totals: {self.impacts} impacts of {self.normal_impulse:.6g} N s, '
            f'{self.mode_changes} changes of mode, {self.losses_of_contact} losses of contact>'
        )

    def add(self, impacts: Sequence[Impact], changes: Sequence[ModeChange]) -> None:
        """Enter the events of a batch."""
        self.impacts += len(impacts)
        self.mode_changes += len(changes)
        self.losses_of_contact += sum(
            c.previous > Mode.FREE_FLIGHT and c.mode == Mode.FREE_FLIGHT for c in changes
        )
        known = Impacts.of(impacts)
        names = 't', 'normal_impulse', 'approach_speed', 'energy_loss'
        columns = (known.column(x).tolist() for x in names)
        for t, impulse, approach, loss in zip(*columns, strict=True):
            self.normal_impulse += impulse
            self.largest_impulse = max(self.largest_impulse, impulse)
            if t > self._instant:
                self._gains, self._made = self.gains
                self._instant, self._gain, self._work = t, 0.0, 0.0
            self._gain -= loss
            self._work += impulse * approach

    @property
    def gains(self) -> tuple[int, float]:
        """Number of instants at which impacts created energy, and how much in all [J].

        Contacts in one impact pass energy to each other; only their sum says what was made.
        """
        if self._gain > _CONTACTS.energy_gain * self._work:
            return self._gains + 1, self._made + self._gain
        return self._gains, self._made
