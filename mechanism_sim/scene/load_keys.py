"""What every kind of load registers: its section of a scene, and the force elements it makes.

A kind is a file in `mechanism_sim.scene.loads`; whatever lists kinds or keys finds it there. The
place of a load is the key `at`, because YAML 1.1 reads `on` as a truth value.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import ForceElement
from mechanism_sim.scene.names import Names
from mechanism_sim.scene.quantities import Part

Elements = Callable[[Mechanism], list[ForceElement]]
"""From a tree of the mechanism to its force elements."""


@dataclass(frozen=True)
class LoadKind:
    """A kind of springs, loads and the like.

    Attributes
    ----------
    section : part of a scene with one key, that of the section: such loads by name
    read : from the names of a scene, the name and keys of a load and the ideal tree to what
        makes its elements for any tree; refuses what does not fit together
    """

    section: type[Part]
    read: Callable[[Names, str, Any, Mechanism], Elements]

    @property
    def name(self) -> str:
        """The key of the section."""
        (name,) = self.section.__annotations__
        return name


LOADS: dict[str, LoadKind] = {}
"""All kinds of loads by the key of their section."""


def register(kind: LoadKind) -> None:
    """Make a kind of loads known."""
    LOADS[kind.name] = kind


def read_loads(names: Names, tree: Mechanism) -> Elements:
    """What makes the force elements of a scene for a tree of its mechanism.

    Parameters
    ----------
    names : of the scene
    tree : the ideal mechanism; the displacements of its links are what formulas name
    """
    makers: Sequence[Elements] = [
        kind.read(names, name, part, tree)
        for kind in LOADS.values()
        for name, part in getattr(names.scene, kind.name).items()
    ]
    return lambda mechanism: [x for make in makers for x in make(mechanism)]
