"""The command line: commands are grouped by what they are about, each beside its options."""

from mechanism_sim.cli.entry import main

__all__ = ['main']
