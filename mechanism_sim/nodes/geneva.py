"""The Geneva wheels and slotted racks of a machine."""

from __future__ import annotations

from collections.abc import Sequence

from mechanism_sim.middleware import Parameter
from mechanism_sim.nodes.part import Part
from mechanism_sim.nodes.process import main_of


class Geneva(Part):
    """Publishes ``geneva_state`` of every Geneva wheel and slotted rack."""

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('geneva', parameters)


def main(args: list[str] | None = None) -> None:
    """Run this node by itself."""
    main_of(Geneva, args)


if __name__ == '__main__':
    main()
