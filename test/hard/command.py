"""The command line of the hard cases."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from benchmarks.programs import run_program
from mechanism_sim import output
from mechanism_sim.cli.options import flag, option, print_json
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.nodes.arguments import Parser
from mechanism_sim.report import progress
from test.hard import report
from test.hard.case import Case, cases, run


def main(args: Sequence[str] | None = None) -> None:
    """Run hard cases; exit code 0 if all bounds are kept, else 1; 2 bad input, 130 interrupted."""
    run_program(make_parser(), _run, args)


def make_parser() -> Parser:
    """The parser of its command line."""
    parser = Parser(
        prog='hard',
        usage='python -m test.hard [CASE ...] [options]',
        description='Run the cases that break simulators of machines and of contact.',
    )
    parser.add_argument(
        'names', nargs='*', metavar='CASE', help='only these; all if none is named'
    )
    flag(parser, '--json', 'JSON to standard output')
    option(parser, '--markdown', 'FILE', 'write the cases as a page of Markdown')
    return parser


def _run(options: argparse.Namespace) -> int:
    chosen = _choose(options.names)
    if options.markdown and not Path(options.markdown).resolve().parent.is_dir():
        raise InputError(f'--markdown {options.markdown}: there is no such folder')
    outcomes = []
    for k, case in enumerate(chosen):
        with progress.busy(f'hard: case {k + 1} of {len(chosen)}', options.json) as say:
            say(case.name)
            (outcome,) = run((case,))
        outcomes.append(outcome)
        if not options.json:
            print(report.render(outcome), flush=True)
    if options.markdown:
        output.write_text(options.markdown, report.markdown(outcomes))
    if options.json:
        print_json(report.to_json(outcomes))
    return 0 if all(outcome.ok for outcome in outcomes) else 1


def _choose(names: Sequence[str]) -> list[Case]:
    """Cases by their names, all of them for none.

    Raises
    ------
    InputError
        For an unknown name, with the nearest.
    """
    known = {case.name: case for case in cases()}
    for name in names:
        if name not in known:
            raise InputError(
                f"there is no hard case '{name}'{nearest(name, known)}; known are: "
                f'{", ".join(known)}'
            )
    return [known[n] for n in dict.fromkeys(names)] or list(known.values())
