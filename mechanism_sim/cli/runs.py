"""Runs of a scene, in this process or as nodes."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import reduce
from itertools import pairwise
from operator import or_
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from mechanism_sim import process_exit
from mechanism_sim.cli.options import (
    TABLES,
    Command,
    flag,
    length_options,
    measure_option,
    option,
    overrides_of,
    print_json,
    rate_option,
    read_machine,
    read_measures,
    refuse_options,
    ros_args,
    say_turns,
    scene_options,
)
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.nodes.classes import NODE_CLASSES, node_class
from mechanism_sim.terminal import echo, print_notice

if TYPE_CHECKING:
    from mechanism_sim.engine.snapshot import Snapshot
    from mechanism_sim.report.samples import SampleWriter
    from mechanism_sim.report.sections import Section
    from mechanism_sim.results.measures import Measured
    from mechanism_sim.results.run import Piece, Solution
    from mechanism_sim.scene import Machine

    Told: TypeAlias = tuple[dict[str, Any], list[Section]]
    Telling: TypeAlias = Callable[[Solution, Sequence[Measured]], Told]


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('solve', _solve, 'run a scene in this process, without middleware')
    scene_options(sub)
    length_options(sub)
    measure_option(sub)
    option(
        sub,
        '--derivatives',
        'PATHS',
        'derivatives of the final state, impacts and measures by numbers of the scene, as '
        'drive.speed,links.coupler.mass',
    )
    flag(sub, '--horizon', 'until when digits of the run hold, by exact derivatives along it')
    rate_option(sub, '--sample-rate', 'samples per second, for --output')
    option(sub, '-o --output', 'FILE', f'write samples of all quantities: {TABLES}')
    flag(sub, '--no-events', 'with --json: numbers of events instead of their lists')
    option(sub, '--save', 'FILE', 'write a snapshot of the end, from which --resume continues')
    option(
        sub,
        '--resume',
        'FILE',
        'continue from the snapshot of --save; lengths count from the start of the first run',
    )
    sub = command('run', _run, 'run a scene as nodes that publish and record')
    scene_options(sub)
    length_options(sub)
    option(sub, '--record', 'FILE', 'record the run in this MCAP file')
    flag(sub, '--overwrite', 'replace an existing bag')
    option(
        sub, '--realtime-factor', 'F', 'simulated seconds per second; 0: as fast as possible', 0.0
    )
    flag(sub, '--display', 'publish markers for RViz and Foxglove, too')
    flag(sub, '--processes', 'run each node in a process of its own')
    flag(sub, '--paused', 'begin paused, to be played or stepped')
    flag(sub, '--hold', 'pause at the end instead of ending')
    option(
        sub,
        '--listeners',
        'NAMES',
        'other nodes of yours that must receive all messages, or NODE:TOPIC; commas between',
        '',
    )
    option(sub, '--namespace', 'NS', 'namespace of all nodes and topics of the run')
    flag(sub, '--plan', 'print its nodes, parameters and topics as JSON, and run nothing')
    sub = command('node', _node, 'run one node by itself; NAME --help lists its options')
    sub.add_argument('name', nargs='?', metavar='NAME', help='one of ' + ', '.join(NODE_CLASSES))


def _solve(options: argparse.Namespace) -> int:
    from mechanism_sim.engine.digest import MotionDigest  # noqa: PLC0415
    from mechanism_sim.engine.events import Impact, ModeChange  # noqa: PLC0415
    from mechanism_sim.engine.snapshot import Snapshot  # noqa: PLC0415
    from mechanism_sim.report import measured, progress, summary  # noqa: PLC0415
    from mechanism_sim.report.sections import text  # noqa: PLC0415
    from mechanism_sim.results.measures import Measurement  # noqa: PLC0415
    from mechanism_sim.results.simulate import stream, whole  # noqa: PLC0415
    from mechanism_sim.results.turns import ImpactAccumulator  # noqa: PLC0415
    from mechanism_sim.scene import run_length  # noqa: PLC0415

    if options.no_events and not options.json:
        raise InputError('--no-events needs --json: without it no events are listed')
    if options.sample_rate is not None and not options.output:
        raise InputError('--sample-rate needs --output: it is that of the samples in the file')
    machine = read_machine(options)
    say_turns(options, machine)
    end = run_length(machine, options.revolutions, options.duration)
    taken = Measurement(machine, read_measures(options, machine))
    snapshot = Snapshot.load(options.resume) if options.resume else None
    asked = [*_derivatives(options, machine, end, snapshot), *_horizon(options, machine)]
    digest, turns = MotionDigest(), ImpactAccumulator(machine)
    pieces: list[Piece] = []
    impacts: list[Impact] = []
    modes: list[ModeChange] = []
    with _samples(options) as table, progress.bar('solve', end, quiet=options.json) as show:
        observers = [taken.add, turns.add, *([table.add] if table else [])]
        run = stream(machine, None, end, show, snapshot, observers)
        for piece in run:
            if asked:
                pieces.append(piece)
            if options.json:
                digest.add(piece.motion, piece.impacts)
                if not options.no_events:
                    impacts += piece.impacts
                    modes += piece.modes
    if options.save:
        run.snapshot.save(options.save)
    found = taken.found()
    told = [tell(whole(run, pieces), found) for tell in asked]
    if options.json:
        events = (None, None) if options.no_events else (impacts, modes)
        known = summary.to_json(run, digest.hexdigest(), turns, *events) | measured.to_json(found)
        print_json(reduce(or_, (keys for keys, _ in told), known))
    else:
        shown = [section for _, sections in told for section in sections]
        echo(text([*summary.sections(run, turns), *measured.section(found), *shown]))
    return 0


def _derivatives(
    options: argparse.Namespace, machine: Machine, end: float, snapshot: Snapshot | None
) -> Iterator[Telling]:
    """Derivatives of a run, if requested."""
    if options.derivatives:
        from mechanism_sim.report import derivatives  # noqa: PLC0415
        from mechanism_sim.results.derivatives import AskedDerivatives  # noqa: PLC0415

        paths = [p.strip() for p in options.derivatives.split(',')]
        asked = AskedDerivatives(machine, paths, end, snapshot)

        def tell(run: Solution, found: Sequence[Measured]) -> Told:
            by = asked.along(run)
            return derivatives.to_json(by, found), derivatives.sections(by, found)

        yield tell


def _horizon(options: argparse.Namespace, machine: Machine) -> Iterator[Telling]:
    """Yield the prediction horizon of a run, if requested."""
    if options.horizon:
        from mechanism_sim.report import studies  # noqa: PLC0415
        from mechanism_sim.studies.lyapunov import check_horizon, horizon  # noqa: PLC0415

        check_horizon(machine)

        def tell(run: Solution, _: Sequence[Measured]) -> Told:
            held = horizon(run)
            return studies.horizon_json(held), [studies.horizon_section(held)]

        yield tell


def _run(options: argparse.Namespace) -> int:
    from mechanism_sim.nodes.middleware import remove_ros_args  # noqa: PLC0415
    from mechanism_sim.nodes.run import MONITOR, NodePlan, run  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.scene import run_length  # noqa: PLC0415

    machine, overrides = read_machine(options), overrides_of(options)
    say_turns(options, machine)
    end = run_length(machine, options.revolutions, options.duration)
    if not 0.0 <= options.realtime_factor < math.inf:
        raise InputError('--realtime-factor must be 0 (no limit) or positive')
    if not options.record:
        refuse_options(options, ['overwrite'], 'needs --record')
    if options.record and Path(options.record).exists() and not options.overwrite:
        raise InputError(
            f"the bag '{options.record}' exists already; choose another name or give --overwrite"
        )
    plan = NodePlan(
        machine, options.scene, overrides, end, options.record, options.overwrite,
        options.realtime_factor, options.paused, options.hold, ros_args(options),
        options.display, tuple(name for name in options.listeners.split(',') if name),
    )  # fmt: skip
    try:
        remove_ros_args(plan.ros_args)
    except RuntimeError as error:
        raise InputError(str(error)) from error
    if options.plan:
        print_json(plan.to_json())
        return 0
    # ROS ignores parameters of nodes that are not in the run
    nodes = [*plan.nodes, MONITOR]
    for key, rule in pairwise(options.ros_args):
        node, colon, special = rule.partition(':=')[0].partition(':')
        name = node.rpartition('/')[2]
        apart = {node, special} & {'__node', '__name'} or special == '__ns'
        if key in {'-r', '--remap'} and apart:
            raise InputError(
                f'-r {rule}: nodes of a run find each other by their names in one namespace: it '
                'can rename topics and services, and the namespace of all, by __ns:=/left'
            )
        if key in {'-p', '--param'} and colon and '*' not in name and name not in nodes:
            print_notice(f"{rule}: the run has no node '{name}'{nearest(name, nodes)}")
    stopped = _stopped(options.record)
    process_exit.say_when_interrupted(stopped)
    with progress.bar('run', end, quiet=options.json) as show:
        outcome = run(plan, options.processes, show)
    if outcome.code == process_exit.INTERRUPTED:
        process_exit.report_signal(stopped(f' at {outcome.duration:.6g} s of {end:.6g} s'))
    if options.json:
        print_json(outcome.to_json())
    elif outcome.code == 0:
        echo(outcome.text())
    return process_exit.interrupted() if outcome.code == process_exit.INTERRUPTED else outcome.code


def _stopped(bag: str | None) -> Callable[..., str]:
    """Sentence on a run ended by a signal; without a bag before all nodes have started."""

    def state() -> tuple[int, int] | None:
        try:
            found = Path(bag or '').stat()
        except OSError:
            return None
        return (found.st_ino, found.st_mtime_ns) if found.st_size else None

    before = state()

    def words(when: str = '') -> str:
        if not bag or state() != before:
            return f'interrupted{when}'
        kept = 'is as it was' if before else 'is not written'
        return f"interrupted before all nodes were there: nothing is recorded, '{bag}' {kept}"

    return words


def _node(options: argparse.Namespace) -> int:
    from mechanism_sim.nodes.process import main_of  # noqa: PLC0415

    if options.name is None:
        options.parser.print_help()
        return 0
    if options.name not in NODE_CLASSES:
        raise InputError(
            f"there is no node '{options.name}'{nearest(options.name, NODE_CLASSES)}; known are: "
            f'{", ".join(NODE_CLASSES)}'
        )
    main_of(node_class(options.name), [*options.rest, *options.ros_args])
    return 0


def _samples(options: argparse.Namespace) -> AbstractContextManager[SampleWriter | None]:
    """Writer of samples for `--output`; a context of None without that option."""
    if not options.output:
        return nullcontext()
    from mechanism_sim import tables  # noqa: PLC0415
    from mechanism_sim.report.samples import SampleWriter, check_rate  # noqa: PLC0415

    tables.check_file('--output', options.output)
    return SampleWriter(options.output, check_rate(options.sample_rate))
