"""The command line: commands by subject, each beside its options."""

from mechanism_sim.cli.entry import main

__all__ = ['main']
