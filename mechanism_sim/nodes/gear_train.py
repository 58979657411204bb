"""The gears of a machine."""

from __future__ import annotations

from collections.abc import Sequence

from mechanism_sim.middleware import Parameter
from mechanism_sim.nodes.part import Part
from mechanism_sim.nodes.process import main_of


class GearTrain(Part):
    """Publishes ``gear_state`` of every pair of gears."""

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('gear_train', parameters)


def main(args: list[str] | None = None) -> None:
    """Run this node by itself."""
    main_of(GearTrain, args)


if __name__ == '__main__':
    main()
