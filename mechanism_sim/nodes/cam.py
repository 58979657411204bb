"""The cams of a machine."""

from __future__ import annotations

from collections.abc import Sequence

from mechanism_sim.middleware import Parameter
from mechanism_sim.nodes.part import Part
from mechanism_sim.nodes.process import main_of


class Cam(Part):
    """Publishes ``cam_state`` of every cam and its follower."""

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('cam', parameters)


def main(args: list[str] | None = None) -> None:
    """Run this node by itself."""
    main_of(Cam, args)


if __name__ == '__main__':
    main()
