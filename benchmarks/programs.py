"""Programs of one command beside the package: benchmarks, hard cases, the grid."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from mechanism_sim.cli.outcome import carry_out
from mechanism_sim.nodes.arguments import Parser


def run_program(
    parser: Parser, run: Callable[[argparse.Namespace], int], args: Sequence[str] | None = None
) -> NoReturn:
    """Run a program that is one command: read the words of its command line, run it and exit."""
    given = sys.argv[1:] if args is None else list(args)

    def work() -> int:
        options, rest = parser.parse_known_args(given)
        if rest:
            parser.refuse(rest)
        options.parser = parser
        return run(options)

    carry_out(work, given)
