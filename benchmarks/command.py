"""The command line: what is measured, how often, and what becomes of the results."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from benchmarks import choose, report
from benchmarks.loose_joints import loose_joints, stretches
from benchmarks.measure import machine, measure
from benchmarks.middleware import middleware
from benchmarks.programs import run_program
from benchmarks.scaling import scaling
from mechanism_sim.cli.options import flag, option, print_json, print_result, refuse_options
from mechanism_sim.errors import InputError
from mechanism_sim.nodes.arguments import Parser
from mechanism_sim.report import progress

_OPTIONS = 'output', 'repeats', 'methods', 'tolerances'


def main(args: Sequence[str] | None = None) -> None:
    """Measure; exit code 0 done, 1 if a method failed, 2 bad input, 130 interrupted."""
    run_program(make_parser(), _measure, args)


def make_parser() -> Parser:
    """The parser of its command line."""
    parser = Parser(
        prog='benchmarks',
        usage='python -m benchmarks [NAME ...] [options]',
        description='Measure speed against error, beside other simulators and integrators.',
    )
    parser.add_argument(
        'names', nargs='*', metavar='NAME',
        help='problems; scaling; loose_joints; middleware; all; nothing lists them',
    )  # fmt: skip
    flag(parser, '--json', 'JSON to standard output')
    option(parser, '-o --output', 'DIR', 'folder for picture, JSON and table')
    option(parser, '--repeats', 'N', 'how often to repeat every run', 7)
    option(parser, '--methods', 'NAME,...', 'only these methods')
    option(parser, '--tolerances', 'R,...', 'relative tolerances, instead of the usual ones')
    return parser


def _measure(options: argparse.Namespace) -> int:
    if not options.names:
        refuse_options(options, _OPTIONS, 'needs names of what is measured')
        return print_result(options, choose.listing(), dict, report.listing)
    problems, tables = choose.choose(options.names)
    methods = choose.methods(problems, options.methods)
    tolerances = choose.tolerances(options.tolerances)
    if options.repeats < 1:
        raise InputError('--repeats must be at least 1')
    here, content = machine(), report.Pages(options.output)

    @contextmanager
    def entry() -> Iterator[Callable[[str], None]]:
        with progress.busy('benchmarks', options.json) as say:
            yield say
        if not options.json:
            print(content.text[-1], flush=True)

    for problem in problems:
        with entry() as say:
            content.add(measure(problem, options.repeats, methods, tolerances, say), here)
    if choose.SCALING in tables:
        with entry() as say:
            content.add_scaling(scaling(say), here)
    if choose.LOOSE_JOINTS in tables:
        with entry() as say:
            costs = loose_joints(options.repeats, say)
            content.add_loose_joints(costs, here, *stretches(options.repeats, say))
    if choose.MIDDLEWARE in tables:
        with entry() as say:
            content.add_middleware(middleware(options.repeats, say), here)
    if options.json:
        print_json(content.to_json(here))
    return 1 if any(row.failure for m in content.found for row in m.rows) else 0
