"""The command line: commands are grouped by what they are about, each beside its options."""

from mechanism_sim.cli.entry import main
from mechanism_sim.cli.options import NODE_CLASSES, NODE_NAMES

__all__ = ['NODE_CLASSES', 'NODE_NAMES', 'main']
