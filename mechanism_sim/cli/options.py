"""Common parts of commands: adding options, common options, quantities, output."""

from __future__ import annotations

import argparse
import atexit
import math
import os
import re
import tempfile
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from mechanism_sim import strict_json
from mechanism_sim.errors import InputError
from mechanism_sim.terminal import print_notice
from ros_interfaces.names import InvalidNameError, resolve_namespace

if TYPE_CHECKING:
    from mechanism_sim.results.measure_text import Measure
    from mechanism_sim.scene import Machine
    from mechanism_sim.studies.runs import Workers

    Options = argparse.ArgumentParser | argparse._ArgumentGroup

Result = TypeVar('Result')
Command = Callable[[str, Callable[[argparse.Namespace], int], str], argparse.ArgumentParser]
"""Adds a command: its name, what runs it and returns the exit code, its help."""

TABLES = 'a .npz, .csv, .parquet, .xlsx or .mat file'
"""Endings of tables."""


def option(parser: Options, flags: str, metavar: str, text: str, default: object = str) -> None:
    """Add an option with a value; `default` may be its type."""
    kind = default if isinstance(default, type) else type(default)
    value = None if default is kind else default
    parser.add_argument(*flags.split(), metavar=metavar, type=kind, default=value, help=text)


def time_option(
    parser: Options, flag: str, text: str, dest: str | None = None, default: float | None = None
) -> None:
    """Add an option for a time: in seconds, or with a unit."""
    own: dict[str, Any] = {'dest': dest} if dest else {}
    said, kind = f"{text} (in seconds, or as '20 ms')", partial(_in_unit, 's')
    parser.add_argument(flag, metavar='S', type=kind, default=default, help=said, **own)


def rate_option(parser: Options, flag: str, text: str, example: str = '1 kHz') -> None:
    """Add an option for a rate: in Hz, or with a unit."""
    said = f"{text} (in Hz, or as '{example}')"
    parser.add_argument(flag, metavar='HZ', type=partial(_in_unit, 'Hz'), help=said)


def _in_unit(unit: str, text: str) -> float:
    """A number in an SI unit, or a quantity."""
    from mechanism_sim.units import to_si  # noqa: PLC0415

    try:
        return to_si(text, unit)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"'{text}' {error}") from error


def several(parser: Options, flags: str, metavar: str, text: str, dest: str | None = None) -> None:
    """Add an option that may be repeated."""
    own: dict[str, Any] = {'dest': dest} if dest else {}
    parser.add_argument(
        *flags.split(), action='append', default=[], metavar=metavar, help=text, **own
    )  # fmt: skip


def flag(parser: Options, flags: str, text: str) -> None:
    """Add an option without a value."""
    parser.add_argument(*flags.split(), action='store_true', help=text)


def set_option(parser: Options) -> None:
    """Add the option that changes values of a scene."""
    text = "change a value of the scene, for example 'drive.speed=300 rpm'; several times"
    several(parser, '--set', 'PATH=VALUE', text, 'overrides')


def look_options(sub: argparse.ArgumentParser, labels: str) -> None:
    """Add the options for paths and names in a drawing."""
    several(sub, '--path', 'LINK.POINT', 'draw the path of this point; several times')
    shown = 'all', 'links', 'none'
    sub.add_argument('--labels', choices=shown, default=labels, help='names that are drawn')


def scene_options(
    sub: argparse.ArgumentParser,
    text: str = 'a scene of the package, or a YAML file',
    metavar: str = 'SCENE',
    count: Literal['?'] | None = None,
) -> None:
    """Add the common arguments of commands on a scene; with `count` '?' it is optional."""
    sub.add_argument('scene', metavar=metavar, help=text, nargs=count)
    set_option(sub)
    tables_option(sub)
    option(sub, '--rtol', 'R', 'relative tolerance of a step, for solver.rtol')
    option(sub, '--atol', 'A', 'absolute tolerance [m], for solver.atol')


def tables_option(sub: argparse.ArgumentParser) -> None:
    """Add the option for the folders of files to which scenes refer."""
    text = (
        'a further folder in which tables of a scene are looked for, after its own; several times'
    )
    several(sub, '--tables-from', 'DIR', text)


def length_options(sub: argparse.ArgumentParser, usual: str = '') -> None:
    """Add the options for the length of a run; `usual` describes the default."""
    time_option(sub, '--duration', 'length of the run')
    turns = 'length of the run in turns of the drive'
    option(sub, '--revolutions', 'N', f'{turns}; {usual}' if usual else turns, float)


def turns_of(options: argparse.Namespace, machine: Machine, usual: float) -> float:
    """The length of a run on a command line in revolutions of a steady drive."""
    if options.revolutions is not None and options.duration is not None:
        raise InputError('give either --revolutions or --duration, not both')
    turns = options.revolutions
    if options.duration is not None:
        period = machine.drive.period
        turns = options.duration / period if math.isfinite(period) else usual
    if turns is not None and not 0.0 < turns < math.inf:
        raise InputError(f'the length of a run must be positive and finite, not {turns:g} turns')
    return usual if turns is None else turns


def skip_option(sub: Options, more: str = '') -> None:
    """Add the option for the part left out at the beginning; `more` extends its help."""
    text = 'whole turns of the drive to leave out at the beginning'
    option(sub, '--skip', 'N', f'{text}; {more}' if more else text)


def skipped_turns(options: argparse.Namespace, usual: int = 0) -> int:
    """Number of whole turns that ``--skip`` leaves out; `usual` without it."""
    if options.skip is None:
        return usual
    if not options.skip.strip().isdecimal():
        raise InputError(
            f"--skip '{options.skip}': write a whole number of turns of at least 0, for example 5"
        )
    return int(options.skip)


def skipped_time(options: argparse.Namespace) -> float:
    """Time [s] that ``--skip`` leaves out of signals, which have no turns; 0 without it."""
    if options.skip is None:
        return 0.0
    skip = quantity('--skip', options.skip, 's')[0]
    if skip < 0.0:
        raise InputError(f"--skip '{options.skip}' must be at least 0 s")
    return skip


def measure_option(sub: argparse.ArgumentParser) -> None:
    """Add the option for user-defined measures."""
    text = "a measure, as 'rms(drive_torque, from 2 s)' or 'peak = largest(reaction.pin)'"
    several(sub, '--measure', 'TEXT', f'{text}; several times', 'measures')


def workers_options(sub: Options, usual: str = 'one for each core') -> None:
    """Add the options for the workers of a study."""
    option(sub, '--workers', 'N', f'number of processes; {usual} if not given', int)
    option(sub, '--dask', 'ADDRESS', 'run on the cluster of this Dask scheduler')


def read_workers(options: argparse.Namespace, usual: int | None = None) -> Workers:
    """The workers for the runs of a study, from the command line."""
    from mechanism_sim.studies.runs import Workers  # noqa: PLC0415

    count = usual if options.workers is None and not options.dask else options.workers
    return Workers(count, options.dask)


def read_measures(options: argparse.Namespace, machine: Machine) -> list[Measure]:
    """The measures of a scene, and those on a command line."""
    from mechanism_sim.results.measure_text import read_all  # noqa: PLC0415

    if not machine.scene.measures and not options.measures:
        return []
    given = machine.scene.measures
    asked = [text for text in options.measures if text not in given]
    return [*read_all(given, f'{machine.name}: measures'), *read_all(asked, '--measure')]


def overrides_of(options: argparse.Namespace) -> list[str]:
    """The overrides on a command line, tolerances among them."""
    tolerances = [
        f'solver.{name}={value}'
        for name, value in (('rtol', options.rtol), ('atol', options.atol))
        if value is not None
    ]
    return [*options.overrides, *tolerances]


def refuse_options(options: argparse.Namespace, names: Iterable[str], reason: str) -> None:
    """Refuse options that do not apply.

    Parameters
    ----------
    names : names of the options, as `pin-radius`
    reason : end of the sentence, as "needs --wear"
    """
    for name in names:
        if options.parser.is_given(options, name):
            raise InputError(f'--{name} {reason}')


def path_of(override: str) -> str:
    """The dotted path of an override ``PATH=VALUE``."""
    return override.partition('=')[0].strip()


def read_machine(options: argparse.Namespace, remarks: bool = True) -> Machine:
    """The scene on a command line, as a machine.

    Warnings of implausible units and of keys without effect go to standard error, but
    not if `remarks` is False.
    """
    from mechanism_sim.report import progress  # noqa: PLC0415

    with progress.busy('reading the scene', options.json):
        from mechanism_sim.scene import load_scene  # noqa: PLC0415
        from mechanism_sim.scene.validation import validate  # noqa: PLC0415

        machine = validate(load_scene(options.scene, overrides_of(options)))
    if remarks:
        from mechanism_sim.scene.remarks import plausibility_warnings, unused  # noqa: PLC0415

        for remark in (*plausibility_warnings(machine), *unused(machine)):
            print_notice(f'{machine.name}: {remark}')
    return machine


def say_turns(options: argparse.Namespace, machine: Machine, of_cycle: bool = False) -> None:
    """Print the number of turns on standard error if it is a default other than one.

    Parameters
    ----------
    of_cycle : count turns of a steady drive even if the scene has a duration
    """
    from mechanism_sim.results.cycle import is_steady  # noqa: PLC0415

    given = machine.scene.duration and not (of_cycle and is_steady(machine))
    if options.revolutions is not None or options.duration is not None or given:
        return
    if note := machine.drive.repetition.note(machine.plan.main):
        print_notice(f'{machine.name}: {note}')


def ros_args(options: argparse.Namespace) -> list[str]:
    """The ROS arguments of a command line, the namespace among them."""
    found = list(options.ros_args)
    if options.namespace is not None:
        try:
            space = resolve_namespace(options.namespace)
        except InvalidNameError as error:
            raise InputError(f'--namespace: {error}') from error
        # Parameters NODE:NAME:=VALUE are for nodes of any namespace; ROS applies them to none
        # but the root namespace, and otherwise needs a file of parameters.
        passed: list[str] = []
        for arg in found:
            rule = re.fullmatch(r'(\w+):([^:=*]+):=(.*)', arg, re.DOTALL)
            if rule is None or passed[-1:] not in (['-p'], ['--param']):
                passed.append(arg)
                continue
            node, name, value = rule.groups()
            handle, file = tempfile.mkstemp(prefix='parameters_', suffix='.yaml')
            atexit.register(Path(file).unlink, missing_ok=True)
            with os.fdopen(handle, 'w', encoding='utf-8') as stream:
                stream.write(f'/**/{node}:\n  ros__parameters:\n    {name}: {value}\n')
            passed[-1:] = ['--params-file', file]
        found = passed
        found += [*([] if found else ['--ros-args']), '-r', f'__ns:={space}']
    return found


PRINTED: list[bool] = []
"""Set once a result has been printed."""


def print_json(data: object) -> None:
    """Print a result as JSON."""
    print(strict_json.dumps(data, indent=2))
    PRINTED.append(True)


def print_result(
    options: argparse.Namespace,
    result: Result,
    to_json: Callable[[Result], object],
    render: Callable[[Result], object],
    write: Callable[[str], None] = print,
) -> int:
    """Print a result as JSON or as text, and return the exit code 0."""
    if options.json:
        print_json(to_json(result))
    else:
        write(str(render(result)))
    return 0


def print_either(options: argparse.Namespace, data: object, text: object) -> int:
    """Print a result given in both forms, and return the exit code 0."""
    return print_result(options, data, lambda _: data, lambda _: text)


def quantity(option: str, text: str, *units: str) -> tuple[float, str]:
    """Value of a quantity given to an option, and its unit among these SI units."""
    from mechanism_sim.units import EXAMPLES, argument, to_si  # noqa: PLC0415

    example = ' or '.join(f"'{EXAMPLES[unit]}'" for unit in units)
    for unit in units:
        try:
            value = to_si(text, unit)
        except ValueError:
            continue
        if value and not text.strip(' +-.0123456789eE'):
            break  # a bare number: in degrees, radians, seconds?
        return argument(option, text, unit), unit
    of = ' or '.join(repr(unit) for unit in units)
    raise InputError(
        f"{option} '{text}' is not a quantity with a unit of {of}: write for example {example}"
    )
