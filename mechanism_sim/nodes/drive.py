"""Interface of the drive of a run for its commands and services."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

from mechanism_sim.nodes.simulation_node import SimulationNode


class Drive(SimulationNode):
    """A node that announces laws of motion and advances time, see `CrankDrive`."""

    #: time [s] up to which the law is announced; new commands hold from then on
    announced: float
    playing: bool  #: True if time advances by itself
    final: bool  #: True if the law is announced to the end of the run, which is then unalterable
    spawning: Any  #: machines that follow this one, see `Spawning`

    @property
    @abstractmethod
    def law(self) -> Any:
        """The law at the time `announced`."""

    @property
    @abstractmethod
    def due(self) -> bool:
        """True if all partners have reached `announced`, so that time must advance."""

    @abstractmethod
    def take_over(self, laws: Sequence[Any]) -> None:
        """Replace the law by others, the first from `announced` on."""

    @abstractmethod
    def promise(self, until: float, final: bool = False, again: bool = False) -> None:
        """Announce that the present law holds until a time [s]; `final`: the run ends then.

        If that was announced before, the last joint states are published once more.
        """

    @abstractmethod
    def play(self) -> None:
        """Advance time continuously."""

    @abstractmethod
    def pause(self) -> None:
        """Stop at `announced`; pending `arrive` calls then wait for that time."""

    @abstractmethod
    async def arrive(self, goal: float) -> bool:
        """Advance a paused simulation to `goal` [s], and wait for all partners.

        False if it was paused before.
        """

    @abstractmethod
    async def start_over(self) -> str:
        """Begin a new run at time 0, after this one has been completed up to `announced`.

        Returns the reason of a refusal, if a partner rejects the requested values of the scene.
        """

    @abstractmethod
    def quit(self) -> None:
        """End the run at `announced`."""

    @abstractmethod
    async def on_leader(self) -> None:
        """Progress or restart of the drive that this one follows."""

    @abstractmethod
    def on_spawned(self) -> None:
        """Progress or end of a machine that follows this one."""
