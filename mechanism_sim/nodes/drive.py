"""The drive of a run as its commands and services know it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

from mechanism_sim.nodes.simulation_node import SimulationNode


class Drive(SimulationNode):
    """A node that announces laws of motion and lets time go on, see `CrankDrive`.

    Attributes
    ----------
    announced : [s] up to which the law is promised: what is commanded now holds from then on
    playing : whether time goes on by itself
    final : whether the law is announced to the end of the run: nothing can be done any more
    spawning : the machines that follow this one, see `Spawning`
    """

    announced: float
    playing: bool
    final: bool
    spawning: Any

    @property
    @abstractmethod
    def law(self) -> Any:
        """The law that holds where it is announced to."""

    @property
    @abstractmethod
    def due(self) -> bool:
        """True if time is to go on: all partners have come to where the law is announced to."""

    @abstractmethod
    def take_over(self, laws: Sequence[Any]) -> None:
        """Let other laws take over, the first at `announced`."""

    @abstractmethod
    def promise(self, until: float, final: bool = False, again: bool = False) -> None:
        """Announce that the present law holds until then [s]; `final`, and that the run ends.

        If it was promised for that long before, the last joint states are published once more.
        """

    @abstractmethod
    def play(self) -> None:
        """Let time go on by itself."""

    @abstractmethod
    def pause(self) -> None:
        """Stop where the law is announced to; who waits for more waits for that."""

    @abstractmethod
    async def arrive(self, goal: float) -> bool:
        """Let a paused simulation go on to `goal` [s], and wait until all partners are there.

        False if it was paused again before.
        """

    @abstractmethod
    async def start_over(self) -> str:
        """Begin a new run at time 0, once what was announced of this one is done.

        Gives back why not, if a partner does not take the values of the scene that are asked for.
        """

    @abstractmethod
    def quit(self) -> None:
        """End the run where the law is announced to."""

    @abstractmethod
    async def on_leader(self) -> None:
        """The drive that this one follows has gone on, or begun anew."""

    @abstractmethod
    def on_spawned(self) -> None:
        """A machine that follows this one has gone on, or ended."""
