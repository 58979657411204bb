"""Kinds of springs, loads and the like: sections of a scene, whose parts make force elements.

A kind is a file in `mechanism_sim.scene.loads` with a section that `LOADS.add` makes known by its
one key; whatever lists kinds or keys finds it there. The place of a load is the key `at`, because
YAML 1.1 reads `on` as a truth value.
"""

from __future__ import annotations

from collections.abc import Callable

from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Part
from mechanism_sim.keys.registry import Registry
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import ForceElement

Elements = Callable[[Mechanism], list[ForceElement]]
"""Function from a tree of the mechanism to its force elements."""


class ElementKeys(Part):
    """The keys of a load of any kind."""

    def read(self, names: Names, name: str, tree: Mechanism) -> Elements:
        """Maker of its elements for any tree; refuses what does not fit together.

        Parameters
        ----------
        tree : the ideal mechanism; the displacements of its links are what formulas name
        """
        raise NotImplementedError


LOADS = Registry[type[Part]]()
"""Sections of a scene with one key, such loads by name, by that key."""


def read_loads(names: Names, tree: Mechanism) -> Elements:
    """Maker of the force elements of a scene for a tree of its mechanism, see `ElementKeys`."""
    makers: list[Elements] = [
        part.read(names, name, tree)
        for section in LOADS
        for name, part in getattr(names.scene, section).items()
    ]
    return lambda mechanism: [x for make in makers for x in make(mechanism)]
