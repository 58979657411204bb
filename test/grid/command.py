"""The command line of the grid."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.programs import run_program
from mechanism_sim.cli.options import flag, option, print_json
from mechanism_sim.errors import InputError
from mechanism_sim.nodes.arguments import Parser
from mechanism_sim.report import progress
from test.grid import report
from test.grid.run import SEED, grid, write_scenes
from test.grid.shards import Shards


def main(args: Sequence[str] | None = None) -> None:
    """Run the grid; exit code 0 if no case failed, else 1; 2 bad input, 130 interrupted."""
    run_program(make_parser(), _run, args)


def make_parser() -> Parser:
    """The parser of its command line."""
    parser = Parser(
        prog='grid',
        usage='python -m test.grid [options]',
        description='Run over a thousand valid machines drawn from a seed; each must succeed.',
    )
    flag(parser, '--json', 'JSON to standard output')
    option(parser, '-o --output', 'DIR', 'folder for the scenes of the cases')
    option(parser, '--only', 'NAME,...', 'these families or cases')
    option(parser, '--sample', 'N', 'so many cases, drawn', int)
    option(parser, '--seed', 'K', 'of another grid', SEED)
    option(parser, '--workers', 'N', 'processes at a time; one for each core if not given', int)
    return parser


def _run(options: argparse.Namespace) -> int:
    only = [name.strip() for name in (options.only or '').split(',') if name.strip()]
    for name in ('sample', 'workers'):
        if getattr(options, name) is not None and getattr(options, name) < 1:
            raise InputError(f'--{name} must be at least 1')
    cases = grid(options.seed, only, options.sample)
    if options.output:
        write_scenes(cases, Path(options.output))
    shards = Shards(cases, options.workers or len(os.sched_getaffinity(0)))
    found, ended = {}, 0
    with progress.count('grid', len(cases), quiet=options.json) as show:
        for outcome in shards.outcomes():
            found[outcome.name] = outcome
            failed = sum(o.ok is False for o in found.values())
            show(len(found), failed)
            if outcome.ok is False:
                where = sys.stderr if options.json else sys.stdout
                print(report.render(outcome), file=where, flush=True)
            if shards.ended > ended and not sys.stderr.isatty():  # a line in a log
                ended = shards.ended
                print(f'grid: {len(found)} of {len(cases)} cases, {failed} failed, '
                      f'largest process {shards.peak_memory / 2**20:.0f} MiB',
                      file=sys.stderr, flush=True)  # fmt: skip
    outcomes = [found[case.name] for case in cases]
    if options.json:
        sizes = {'processes': shards.ended, 'peak_memory': shards.peak_memory}
        print_json(report.to_json(outcomes) | sizes)
    else:
        print(report.summary(outcomes))
        print(f'{shards.ended} processes, the largest of {shards.peak_memory / 2**20:.0f} MiB')
    return 0 if all(outcome.ok is not False for outcome in outcomes) else 1
