"""The command line."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mechanism_sim.errors import InputError, RunError

if TYPE_CHECKING:
    from mechanism_sim.report.tables import Writer

NODE_NAMES = (
    'crank_drive', 'linkage', 'cam', 'gear_train', 'geneva', 'oscillator', 'accelerometer',
    'recorder',
)  # fmt: skip


def main(args: Sequence[str] | None = None) -> None:
    """Run a command; exit code 0 done, 1 failed run, 2 bad input."""
    parser = _parser()
    options, rest = parser.parse_known_args(args)
    if rest and options.command != 'node':
        options.parser.error(f'unrecognized arguments: {" ".join(rest)}')
    if options.command is None:
        parser.print_help()
        sys.exit(0)
    options.rest = rest
    try:
        code = options.run(options)
        sys.stdout.flush()
        sys.exit(code)
    except InputError as error:
        sys.exit(_tell(error, 2))
    except RunError as error:
        sys.exit(_tell(error, 1))
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        # Whoever read our output has had enough; Python must not complain while closing it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)


def _tell(error: Exception, code: int) -> int:
    print(f'mechanism-sim: {error}', file=sys.stderr)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='mechanism-sim',
        description='Simulator of real (loose, rattling, vibrating) planar machines.',
        epilog='Try: mechanism-sim run four_bar_clearance --revolutions 10 --record run.mcap',
    )
    commands = parser.add_subparsers(dest='command', metavar='COMMAND')

    def command(name: str, run: Any, text: str) -> argparse.ArgumentParser:
        # A node has options of its own, and its own help.
        sub = commands.add_parser(
            name, help=text, description=text, allow_abbrev=False, add_help=name != 'node'
        )
        sub.set_defaults(run=run, parser=sub)
        if name != 'node':
            sub.add_argument('--json', action='store_true', help='JSON to standard output')
        return sub

    command('scenes', _scenes, 'list the scenes of the package')
    sub = command('check', _check, 'say what a scene comes down to, without running it')
    _scene_options(sub)
    sub = command('equations', _equations, "write down a scene's own equations")
    _scene_options(sub)
    sub.add_argument('--rates', action='store_true', help='closures and gaps differentiated too')
    form = sub.add_mutually_exclusive_group()
    form.add_argument('--latex', action='store_true', help='a fragment of LaTeX')
    form.add_argument('--markdown', action='store_true', help='Markdown')
    sub.add_argument('-o', '--output', metavar='FILE', help='.tex, .md or .txt to write')
    sub = command('solve', _solve, 'run a scene in this process, without middleware')
    _scene_options(sub)
    _length_options(sub)
    sub.add_argument('--sample-rate', type=float, metavar='HZ', help='sample the solution at')
    sub.add_argument('--output', metavar='FILE', help='.npz, .csv or .parquet for the samples')
    sub.add_argument(
        '--no-events', action='store_true', help='JSON with the counts of events, not their lists'
    )
    sub.add_argument('--save', metavar='FILE', help='write what it takes to go on from the end')
    sub.add_argument(
        '--resume', metavar='FILE',
        help='go on from what --save wrote; lengths still count from the very beginning',
    )  # fmt: skip
    sub = command('run', _run, 'run a scene as nodes that publish and record')
    _scene_options(sub)
    _length_options(sub)
    sub.add_argument('--record', metavar='FILE', help='MCAP file to write')
    sub.add_argument('--overwrite', action='store_true', help='replace an existing bag')
    sub.add_argument('--realtime-factor', type=float, default=0.0, metavar='F', help='0: no limit')
    sub.add_argument('--processes', action='store_true', help='each node in its own process')
    sub = command('node', _node, 'run one node by itself; NAME --help lists its options')
    sub.add_argument('name', nargs='?', metavar='NAME', help=', '.join(NODE_NAMES))
    sub = command('info', _info, 'say what a bag holds')
    sub.add_argument('bag', metavar='BAG')
    sub = command('analyze', _analyze, 'say what happened in a recorded run')
    sub.add_argument('bag', metavar='BAG')
    sub.add_argument('--namespace', help='of the machine, where a bag holds several')
    _detail_options(sub)
    sub = command('sound', _sound, 'what the impacts of a run sound like, as a WAV file')
    _scene_options(sub, 'a scene, or a bag (.mcap) of a run')
    _length_options(sub)
    sub.add_argument('-o', '--output', metavar='FILE', help='.wav; SCENE.wav if not')
    sub.add_argument('--distance', default='1 m', metavar='R', help='of the listener')
    sub.add_argument(
        '--direction', default='0 deg', metavar='ANGLE', help='to the listener, from the x axis'
    )
    sub.add_argument('--pulse', metavar='T', help="how long impacts last, as '0.1 ms'")
    sub.add_argument('--slow', type=float, default=1.0, metavar='N', help='play N times slower')
    sub = command('periodic', _periodic, 'find the periodic response of a loose machine')
    _scene_options(sub)
    sub.add_argument('--longest', type=int, default=8, metavar='P', help='period to look for')
    sub.add_argument('--transient', type=int, default=60, metavar='N', help='revolutions to wait')
    sub = command('statistics', _statistics, 'figures per revolution, with confidence intervals')
    _scene_options(sub)
    sub.add_argument('--revolutions', type=int, default=200, metavar='N', help='to run')
    sub.add_argument('--skip', type=int, default=20, metavar='K', help='revolutions to leave out')
    sub = command('contact-loss', _contact_loss, 'criteria of contact loss, beside what happens')
    _scene_options(sub)
    sub.add_argument('--revolutions', type=float, default=3.0, metavar='N', help='to run')
    sub = command('lift-off', _lift_off, 'from which speed on followers leave their cams')
    _scene_options(sub)
    sub = command('starts', _starts, 'how long a seated pin follows, by start angle')
    _scene_options(sub)
    sub.add_argument('--angles', type=int, default=24, metavar='N', help='around the turn')
    sub.add_argument('--revolutions', type=float, default=3.0, metavar='N', help='to run each')
    sub = command('cycle', _cycle, 'tables, extremes and plots over a turn of the drive')
    _scene_options(sub)
    sub.add_argument('--samples', type=int, default=360, metavar='N', help='intervals in a cycle')
    sub.add_argument('--from', metavar='ANGLE', dest='start', help="begin at, as '30 deg'")
    sub.add_argument('--periods', type=int, default=1, metavar='N', help='turns of the drive')
    sub.add_argument('--duration', type=float, metavar='S', help='instead, in seconds')
    sub.add_argument(
        '--points', nargs='+', default=[], metavar='LINK.POINT', help='whose paths are wanted'
    )
    sub.add_argument('--local', action='store_true', help='forces along and across each link')
    sub.add_argument('--static', action='store_true', help='forces without those of inertia')
    sub.add_argument('--output', metavar='FILE', help='.npz, .csv or .parquet for the samples')
    sub.add_argument('--plots', metavar='DIR|FILE', help='folder, .pdf, .png or .svg')
    sub = command('draw', _draw, 'a picture of a mechanism')
    _scene_options(sub)
    sub.add_argument('-o', '--output', metavar='FILE', help='.svg, .png or .pdf; SCENE.svg if not')
    sub.add_argument('--at', metavar='ANGLE|TIME', help="as '30 deg' or '20 ms'; the start if not")
    sub.add_argument('--positions', type=int, default=1, metavar='K', help='this one and ghosts')
    sub.add_argument(
        '--path', action='append', default=[], metavar='LINK.POINT', help='draw the path of'
    )
    sub.add_argument('--duration', type=float, metavar='S', help='of a drive without a period')
    sub.add_argument(
        '--labels', choices=('all', 'links', 'none'), default='all', help='which names are written'
    )
    sub = command(
        'profile', _profile, 'figures and workshop drawing of a cam, or of gears in mesh'
    )
    _scene_options(sub)
    sub.add_argument('joint', metavar='JOINT', help='with a cam or teeth')
    sub.add_argument('-o', '--output', metavar='FILE', help='.svg or .dxf for the outlines')
    sub.add_argument('--gear', metavar='NAME', help='the outline of this gear only')
    sub.add_argument('--friction', type=float, default=0.05, metavar='MU', help='between teeth')
    sub = command('sweep', _sweep, 'run a grid or a list of scenes and write one table')
    sub.add_argument('file', metavar='FILE', help='a sweep of the package, or a YAML file')
    sub.add_argument('-o', '--output', metavar='TABLE', help='Parquet file; NAME.parquet if not')
    sub.add_argument(
        '--workers', type=int, metavar='N', help='processes; one for each core if not'
    )
    sub.add_argument('--dask', metavar='ADDRESS', help='run on the cluster of this Dask scheduler')
    sub.add_argument('--bags', metavar='DIR', help='also record every run there')
    sub.add_argument('--windows', metavar='DIR', help='where windows go; TABLE.windows if not')
    sub.add_argument('--restart', action='store_true', help='forget what is computed already')
    sub.add_argument('--plot', metavar='FILE', help='draw the figures over the last swept value')
    sub.add_argument('--over', metavar='PATH', help='draw them over this one')
    sub = command(
        'experiment', _experiment, "the thesis's figures and tables, from bags of a sweep"
    )
    sub.add_argument('folder', metavar='DIR', help='of bags, see sweep --bags')
    sub.add_argument('-o', '--output', metavar='DIR|FILE', help='for figures: folder, .pdf, .svg')
    sub.add_argument(
        '--skip', type=int, metavar='K', help='whole turns to leave out; the first half if not'
    )
    sub = command('teeth', _teeth, 'find numbers of teeth for a ratio, the best first')
    sub.add_argument('ratio', metavar='RATIO', help="of speeds, without sign, as 3.5 or '7/2'")
    sub.add_argument('--stages', type=int, default=1, metavar='N', help='pairs in series')
    sub.add_argument(
        '--tolerance', type=float, default=0.0, metavar='X', help='largest relative error'
    )
    sub.add_argument('--teeth', default='18:120', metavar='A:B', help='fewest and most of a gear')
    sub.add_argument(
        '--centre-distance', metavar='C', help="of every stage, as '60 mm'; with --modules"
    )
    sub.add_argument('--modules', metavar='M,...', help="to choose from, as '2 mm,2.5 mm'")
    sub = command('identify', _identify, "fit a bearing's parameters to an accelerometer's signal")
    sub.add_argument('bags', nargs='+', metavar='BAG', help='recorded or measured')
    sub.add_argument(
        '--scene', action='append', default=[], metavar='SCENE', dest='scenes',
        help='machine and chain, one for each bag or for all; those in the bag if not',
    )  # fmt: skip
    sub.add_argument(
        '--set', action='append', default=[], metavar='PATH=VALUE', dest='overrides',
        help='override a value of the scenes',
    )  # fmt: skip
    sub.add_argument(
        '--fit', default='restitution,friction,radial', metavar='NAME,...',
        help='what is to be found: these, noise, or dotted paths',
    )  # fmt: skip
    sub.add_argument(
        '--range', action='append', default=[], metavar='NAME=LOW:HIGH', dest='ranges',
        help="where it is looked for, for example 'radial=0.1 mm:0.4 mm'",
    )  # fmt: skip
    sub.add_argument('--joint', metavar='J', help='the loose joint, where there are several')
    sub.add_argument('--sensor', metavar='S', help='the sensor, where there are several')
    sub.add_argument('--skip', type=float, default=0.0, metavar='S', help='seconds to leave out')
    sub.add_argument('--seed', type=int, default=0, metavar='N', help='of the search')
    sub.add_argument(
        '--rounds', metavar='N,...', help='simulations of each round; 128,48,48,48 if not given'
    )
    sub.add_argument(
        '--workers', type=int, metavar='N', help='processes; one for each core if not'
    )
    sub = command('bench', _bench, 'measure speed against error beside peers, or the hard cases')
    sub.add_argument(
        'names', nargs='*', metavar='NAME',
        help='problems; scaling; hard, or names of hard cases; nothing lists what there is',
    )  # fmt: skip
    sub.add_argument('--output', metavar='DIR', help='write picture, JSON and table there')
    sub.add_argument('--repeats', type=int, default=7, metavar='N', help='of every run')
    sub.add_argument('--methods', metavar='NAME,...', help='only these')
    sub.add_argument('--tolerances', metavar='R,...', help='instead of the usual ones, for rtol')
    sub.add_argument('--markdown', metavar='FILE', help='write the hard cases for people')
    return parser


def _scene_options(
    sub: argparse.ArgumentParser, text: str = 'a scene of the package, or a YAML file'
) -> None:
    sub.add_argument('scene', metavar='SCENE', help=text)
    sub.add_argument(
        '--set', action='append', default=[], metavar='PATH=VALUE', dest='overrides',
        help="override a value, for example 'drive.speed=300 rpm'",
    )  # fmt: skip
    sub.add_argument('--rtol', metavar='R', help='relative tolerance')
    sub.add_argument('--atol', metavar='A', help='absolute tolerance [m]')


def _length_options(sub: argparse.ArgumentParser) -> None:
    sub.add_argument('--duration', type=float, metavar='S', help='length in seconds')
    sub.add_argument('--revolutions', type=float, metavar='N', help='length in crank revolutions')


def _detail_options(sub: argparse.ArgumentParser) -> None:
    more = sub.add_argument_group('instead of the summary; each may be given several times')
    for name, metavar, text in (
        ('spectrum', 'SENSOR', 'power spectral density'),
        ('orders', 'SENSOR', 'amplitudes over multiples of the speed of the drive'),
        ('envelope', 'SENSOR', 'spectrum of the squared envelope'),
        ('average', 'NAME', 'over a turn of the drive; a sensor, or as acceleration.LINK'),
        ('impacts-on', 'JOINT', 'by direction on pin and bushing, and turn by turn'),
        ('wear', 'JOINT', 'impulses and sliding by direction on pin and bushing'),
        ('deviation', 'NAME', 'from the machine without clearance'),
    ):
        more.add_argument(f'--{name}', action='append', default=[], metavar=metavar, help=text)
    how = sub.add_argument_group('how')
    how.add_argument('--against', metavar='BAG', help='divide deviations by those of this bag')
    how.add_argument('--band', metavar='A:B', help="of envelopes, as '500 Hz:2 kHz'")
    how.add_argument('--skip', type=int, default=0, metavar='N', help='whole turns to leave out')
    how.add_argument('--pin-radius', metavar='R', help="of wear, as '6 mm'; the scene's if not")
    how.add_argument('--plots', metavar='DIR|FILE', help='folder, .pdf, .png or .svg')


def _overrides(options: argparse.Namespace) -> list[str]:
    tolerances = [
        f'solver.{name}={value}'
        for name, value in (('rtol', options.rtol), ('atol', options.atol))
        if value is not None
    ]
    return [*options.overrides, *tolerances]


def _print_json(data: object) -> None:
    print(json.dumps(data, indent=2, allow_nan=False))


def _scenes(options: argparse.Namespace) -> int:
    from mechanism_sim.scene import load_scene, scene_names  # noqa: PLC0415

    machines = [load_scene(name) for name in scene_names()]
    rows = [{'name': m.name, 'title': m.scene.title, 'level': m.level.value} for m in machines]
    if options.json:
        _print_json(rows)
    else:
        width = max(len(row['name']) for row in rows)
        for row in rows:
            print(f'{row["name"]:{width}}  {row["title"]} ({row["level"]})')
    return 0


def _check(options: argparse.Namespace) -> int:
    from mechanism_sim.scene import load_scene  # noqa: PLC0415
    from mechanism_sim.scene.check import check, render  # noqa: PLC0415

    report = check(load_scene(options.scene, _overrides(options)))
    if options.json:
        _print_json(report.to_json())
    else:
        print(render(report))
    return 0


def _equations(options: argparse.Namespace) -> int:
    from mechanism_sim.scene import load_scene  # noqa: PLC0415

    try:
        from mechanism_sim.report import typeset  # noqa: PLC0415
        from mechanism_sim.report.derivation import derive  # noqa: PLC0415
    except ModuleNotFoundError as missing:
        if missing.name != 'sympy':
            raise
        raise InputError(
            "equations needs the package 'sympy': pip install 'mechanism_sim[equations]'"
        ) from missing
    machine = load_scene(options.scene, _overrides(options))
    setter = typeset.Typesetter(derive(machine, options.rates))
    if options.output:
        typeset.write(setter, options.output)
    if options.json:
        _print_json(setter.to_json())
    elif options.latex or options.markdown:
        print(setter.latex() if options.latex else setter.markdown(), end='')
    elif not options.output:
        print(setter.plain())
    return 0


def _solve(options: argparse.Namespace) -> int:
    from mechanism_sim.hybrid.digest import MotionDigest  # noqa: PLC0415
    from mechanism_sim.hybrid.events import Impact, ModeChange  # noqa: PLC0415
    from mechanism_sim.hybrid.snapshot import Snapshot  # noqa: PLC0415
    from mechanism_sim.report import progress, summary  # noqa: PLC0415
    from mechanism_sim.scene import load_scene, span, stream  # noqa: PLC0415

    if options.no_events and not options.json:
        raise InputError('--no-events goes with --json: without it no events are listed')
    machine = load_scene(options.scene, _overrides(options))
    end = span(machine, options.revolutions, options.duration)
    snapshot = Snapshot.load(options.resume) if options.resume else None
    digest = MotionDigest()
    impacts: list[Impact] = []
    modes: list[ModeChange] = []
    with _samples(options) as table, progress.bar('solve', end, quiet=options.json) as show:
        run = stream(machine, duration=end, progress=show, resume=snapshot)
        for piece in run:
            if table:
                table.add(piece)
            if options.json:
                digest.add(piece.motion, piece.impacts)
                if not options.no_events:
                    impacts += piece.impacts
                    modes += piece.modes
    if options.save:
        try:
            run.snapshot.save(options.save)
        except OSError as error:
            raise InputError(f"'{options.save}' cannot be written: {error.strerror}") from error
    if options.json:
        events = (None, None) if options.no_events else (impacts, modes)
        _print_json(summary.to_json(run, digest.hexdigest(), *events))
    else:
        print(summary.render(run))
    return 0


def _samples(options: argparse.Namespace) -> AbstractContextManager[Writer | None]:
    """Where `--output` goes; nothing if it is not asked for."""
    if not options.output:
        return nullcontext()
    from mechanism_sim.report import tables  # noqa: PLC0415

    tables.check_output(options.output)
    return tables.Writer(options.output, tables.check_rate(options.sample_rate))


def _run(options: argparse.Namespace) -> int:
    from mechanism_sim.nodes.run import Plan, run  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.scene import load_scene, span  # noqa: PLC0415

    overrides = _overrides(options)
    machine = load_scene(options.scene, overrides)
    end = span(machine, options.revolutions, options.duration)
    if options.realtime_factor < 0.0:
        raise InputError('--realtime-factor must be 0 (no limit) or positive')
    if options.record and Path(options.record).exists() and not options.overwrite:
        raise InputError(
            f"the bag '{options.record}' exists already; choose another name or give --overwrite"
        )
    plan = Plan(
        machine, options.scene, overrides, end, options.record, options.overwrite,
        options.realtime_factor,
    )  # fmt: skip
    with progress.bar('run', end, quiet=options.json) as show:
        outcome = run(plan, options.processes, show)
    if options.json:
        _print_json(outcome.to_json())
    elif outcome.code == 0:
        print(progress.render(outcome))
    return outcome.code


def _node(options: argparse.Namespace) -> int:
    from importlib import import_module  # noqa: PLC0415

    if options.name is None:
        options.parser.print_help()
        return 0
    if options.name not in NODE_NAMES:
        from mechanism_sim.scene.files import nearest  # noqa: PLC0415

        raise InputError(
            f"there is no node '{options.name}'{nearest(options.name, NODE_NAMES)}; known are: "
            f'{", ".join(NODE_NAMES)}'
        )
    import_module(f'mechanism_sim.nodes.{options.name}').main(options.rest)
    return 0


def _info(options: argparse.Namespace) -> int:
    from mechanism_sim.recording import info, render_info  # noqa: PLC0415

    found = info(options.bag)
    if options.json:
        _print_json(found.to_json())
    else:
        print(render_info(found))
    return 0


def _sound(options: argparse.Namespace) -> int:
    from mechanism_sim.analysis.record import read_record  # noqa: PLC0415
    from mechanism_sim.report import progress, sound  # noqa: PLC0415
    from mechanism_sim.scene import load_scene, simulate, span  # noqa: PLC0415
    from mechanism_sim.sensing.sound import Listener, strikes  # noqa: PLC0415

    listener = Listener(
        _quantity('--distance', options.distance, 'm')[0],
        _quantity('--direction', options.direction, 'rad')[0],
    )
    pulse = None if options.pulse is None else _quantity('--pulse', options.pulse, 's')[0]
    file = sound.check_file(options.output or f'{Path(options.scene).stem}.wav')
    if Path(options.scene).suffix == '.mcap':
        if _overrides(options) or options.duration or options.revolutions:
            raise InputError('a bag is heard as it was recorded: leave out --set and lengths')
        record = read_record(options.scene)
        machine, run = record.machine, record.piece
    else:
        machine = load_scene(options.scene, _overrides(options))
        end = span(machine, options.revolutions, options.duration)
        with progress.bar('sound', end, quiet=options.json) as show:
            run = simulate(machine, duration=end, progress=show)
    train = strikes(machine.mechanism, run.motion, run.impacts)
    written = sound.write(train, run.motion.curve.end, file, listener, pulse, options.slow)
    if options.json:
        _print_json(written.to_json())
    else:
        print(sound.render(written))
    return 0


def _periodic(options: argparse.Namespace) -> int:
    from mechanism_sim.report import study  # noqa: PLC0415
    from mechanism_sim.scene import load_scene  # noqa: PLC0415
    from mechanism_sim.study.periodic import find_periodic  # noqa: PLC0415

    if options.longest < 1 or options.transient < 1:
        raise InputError('--longest and --transient must be at least 1')
    machine = load_scene(options.scene, _overrides(options))
    response = find_periodic(machine, options.longest, options.transient)
    if options.json:
        _print_json(study.periodic_json(response))
    elif response is None:
        print(
            f'no response that repeats within {options.longest} revolutions after '
            f"{options.transient}; 'mechanism-sim statistics' says what it is like in the mean"
        )
    else:
        print(study.periodic(response))
    return 0


def _cycle(options: argparse.Namespace) -> int:
    from mechanism_sim.cycles.cycle import cycle  # noqa: PLC0415
    from mechanism_sim.report import cycle as report  # noqa: PLC0415
    from mechanism_sim.report import figures, tables  # noqa: PLC0415
    from mechanism_sim.scene import load_scene  # noqa: PLC0415

    plots = figures.check_picture('--plots', options.plots, True) if options.plots else None
    if options.output:
        tables.check_output(options.output)
    start = options.start and _quantity('--from', options.start, 'rad')[0]
    machine = load_scene(options.scene, _overrides(options))
    found = cycle(
        machine, options.samples, start, options.periods, options.duration, options.points,
        options.local, options.static,
    )  # fmt: skip
    if options.output:
        tables.write(options.output, found.table())
    if plots:
        from mechanism_sim.report.plots import draw  # noqa: PLC0415

        with figures.style():
            figures.save_all(draw(found), plots)
    if options.json:
        _print_json(report.to_json(found))
    else:
        print(report.render(found))
    return 0


def _draw(options: argparse.Namespace) -> int:
    from mechanism_sim.cycles.cycle import instant  # noqa: PLC0415
    from mechanism_sim.report import drawing, figures  # noqa: PLC0415
    from mechanism_sim.scene import load_scene  # noqa: PLC0415

    machine = load_scene(options.scene, _overrides(options))
    file = figures.check_picture('--output', options.output or f'{machine.name}.svg')
    if options.positions < 1:
        raise InputError('--positions must be at least 1')
    value, unit = _quantity('--at', options.at, 'rad', 's') if options.at else (None, '')
    found, t = instant(
        machine,
        value if unit == 'rad' else None,
        value if unit == 's' else None,
        options.duration,
        options.path,
        still=options.positions == 1 and not options.path,
    )
    with figures.style():
        picture = drawing.draw(found, t, options.positions, options.labels)
        figures.save(picture, file, cropped=True)
    if options.json:
        _print_json({'scene': machine.name, 'file': str(file), 't': t})
    else:
        print(file)
    return 0


def _profile(options: argparse.Namespace) -> int:
    from mechanism_sim.report import profile  # noqa: PLC0415
    from mechanism_sim.scene import load_scene  # noqa: PLC0415

    file = profile.check_file(options.output) if options.output else None
    machine = load_scene(options.scene, _overrides(options))
    sheet, outline = profile.profile(machine, options.joint, options.gear, options.friction)
    if file:
        profile.write(outline, file)
    if options.json:
        where = {'file': str(file)} if file else {}
        _print_json({'scene': machine.name, 'joint': options.joint, **sheet.to_json(), **where})
    else:
        print(sheet.render())
    return 0


def _quantity(option: str, text: str, *units: str) -> tuple[float, str]:
    """A quantity given to an option, and which of these SI units it is a quantity of."""
    from mechanism_sim.units import EXAMPLES, to_si  # noqa: PLC0415

    example = ' or '.join(f"'{EXAMPLES[unit]}'" for unit in units)
    for unit in units:
        try:
            value = to_si(text, unit)
        except ValueError:
            continue
        if value and text.strip()[-1] in '0123456789.':
            break  # a bare number: in degrees, radians, seconds?
        return value, unit
    raise InputError(
        f"{option} '{text}' is not a quantity with a unit: write for example {example}"
    )


def _statistics(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, study  # noqa: PLC0415
    from mechanism_sim.scene import load_scene  # noqa: PLC0415
    from mechanism_sim.study.statistics import statistics  # noqa: PLC0415

    machine = load_scene(options.scene, _overrides(options))
    end = options.revolutions * machine.period
    with progress.bar('statistics', end, quiet=options.json) as show:
        found = statistics(machine, options.revolutions, options.skip, show)
    if options.json:
        _print_json(study.statistics_json(found))
    else:
        print(study.statistics(found))
    return 0


def _lift_off(options: argparse.Namespace) -> int:
    from mechanism_sim.report import study  # noqa: PLC0415
    from mechanism_sim.scene import load_scene  # noqa: PLC0415
    from mechanism_sim.study.lift_off import lift_offs  # noqa: PLC0415

    found = lift_offs(load_scene(options.scene, _overrides(options)))
    if options.json:
        _print_json(study.lift_offs_json(found))
    else:
        print(study.lift_offs(found))
    return 0


def _contact_loss(options: argparse.Namespace) -> int:
    from mechanism_sim.report import study  # noqa: PLC0415
    from mechanism_sim.scene import load_scene  # noqa: PLC0415
    from mechanism_sim.study.losses import losses  # noqa: PLC0415

    found = losses(load_scene(options.scene, _overrides(options)), options.revolutions)
    if options.json:
        _print_json(study.losses_json(found))
    else:
        print(study.losses(found))
    return 0


def _starts(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, study  # noqa: PLC0415
    from mechanism_sim.scene import load_scene  # noqa: PLC0415
    from mechanism_sim.study.starts import starts  # noqa: PLC0415

    machine = load_scene(options.scene, _overrides(options))
    with progress.bar('starts', float(max(options.angles, 1)), quiet=options.json) as show:
        found = starts(machine, options.angles, options.revolutions, show)
    if options.json:
        _print_json(study.starts_json(found))
    else:
        print(study.starts(found))
    return 0


def _sweep(options: argparse.Namespace) -> int:
    import signal  # noqa: PLC0415

    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.report import sweep as report  # noqa: PLC0415
    from mechanism_sim.sweep.plan import read_plan  # noqa: PLC0415
    from mechanism_sim.sweep.run import Interrupted, sweep  # noqa: PLC0415

    plan = read_plan(options.file)
    table = Path(options.output or f'{plan.name}.parquet')
    chart = report.chart_of(plan, options.plot, options.over)
    # SIGINT too: a shell that starts us in the background has it ignored
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    try:
        with progress.count('sweep', plan.size, quiet=options.json) as show:
            summary, rows = sweep(
                plan, table, options.workers, options.dask, options.bags, options.windows,
                options.restart, show,
            )  # fmt: skip
    except Interrupted as interrupted:
        return _tell(interrupted, 130)
    if chart:
        report.draw(chart, plan, rows)
    if options.json:
        _print_json(summary.to_json())
    else:
        print(report.render(summary, plan, rows))
    return 0


def _experiment(options: argparse.Namespace) -> int:
    from mechanism_sim.analysis.experiment import bags_of, read_experiment  # noqa: PLC0415
    from mechanism_sim.report import experiment as report  # noqa: PLC0415
    from mechanism_sim.report import figures, progress  # noqa: PLC0415

    if options.skip is not None and options.skip < 0:
        raise InputError('--skip must be at least 0')
    place = figures.check_picture('--output', options.output, True) if options.output else None
    bags = bags_of(Path(options.folder))
    with progress.count('experiment', len(bags), quiet=options.json) as show:
        found = read_experiment(bags, options.skip, show)
    if place:
        from mechanism_sim.report.experiment_figures import draw  # noqa: PLC0415

        with figures.style():
            figures.save_all(draw(found), place)
    if options.json:
        _print_json(report.to_json(found))
    else:
        print(report.render(found))
    return 0


def _teeth(options: argparse.Namespace) -> int:
    from mechanism_sim.gears.teeth import choose, ratio_of  # noqa: PLC0415
    from mechanism_sim.report import teeth  # noqa: PLC0415

    fewest, colon, most = options.teeth.partition(':')
    if not (colon and fewest.isdecimal() and most.isdecimal()):
        raise InputError(f"--teeth '{options.teeth}': write for example 18:120")
    distance, modules = options.centre_distance, options.modules
    found = choose(
        ratio_of(options.ratio),
        stages=options.stages,
        tolerance=options.tolerance,
        teeth=(int(fewest), int(most)),
        centre_distance=_quantity('--centre-distance', distance, 'm')[0] if distance else None,
        modules=[_quantity('--modules', m, 'm')[0] for m in modules.split(',')] if modules else (),
    )
    if options.json:
        _print_json(teeth.to_json(found))
    else:
        print(teeth.render(found))
    return 0


def _bench(options: argparse.Namespace) -> int:
    from mechanism_sim.bench import choose  # noqa: PLC0415
    from mechanism_sim.bench.measure import machine, measure  # noqa: PLC0415
    from mechanism_sim.bench.scaling import scaling  # noqa: PLC0415
    from mechanism_sim.report import bench  # noqa: PLC0415

    if not options.names:
        listed = choose.listing()
        if options.json:
            _print_json(listed)
        else:
            print(bench.listing(listed))
        return 0
    problems, cases, costs = choose.choose(options.names)
    if cases:
        return _bench_hard(options, cases)
    methods = choose.methods(problems, options.methods)
    tolerances = choose.tolerances(options.tolerances)
    if options.repeats < 1:
        raise InputError('--repeats must be at least 1')
    here, content = machine(), bench.Pages(options.output)
    for problem in problems:
        found = measure(problem, options.repeats, methods, tolerances, _say)
        content.add(found, here)
        if not options.json:
            print(content.text[-1], flush=True)
    if costs:
        content.add_scaling(scaling(_say), here)
        if not options.json:
            print(content.text[-1], flush=True)
    if options.json:
        _print_json(content.to_json(here))
    return 1 if any(row.failure for m in content.found for row in m.rows) else 0


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _bench_hard(options: argparse.Namespace, cases: Sequence[Any]) -> int:
    from mechanism_sim.bench.hard import run  # noqa: PLC0415
    from mechanism_sim.report import hard  # noqa: PLC0415

    outcomes = []
    for outcome in run(tuple(cases)):
        outcomes.append(outcome)
        if not options.json:
            print(hard.render(outcome), flush=True)
    if options.markdown:
        Path(options.markdown).write_text(hard.markdown(outcomes), encoding='utf-8')
    if options.json:
        _print_json(hard.to_json(outcomes))
    return 0 if all(outcome.ok for outcome in outcomes) else 1


def _identify(options: argparse.Namespace) -> int:
    from mechanism_sim.analysis.measurements import measurements  # noqa: PLC0415
    from mechanism_sim.report import identification as report  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.study.identification import ROUNDS, Identification  # noqa: PLC0415
    from mechanism_sim.study.parameters import parameters, ranges  # noqa: PLC0415

    counts = options.rounds.split(',') if options.rounds else ROUNDS
    if not all(str(n).strip().isdecimal() and int(n) >= 16 for n in counts):
        raise InputError(f"--rounds '{options.rounds}': write numbers from 16 on, as 128,48,48,48")
    rounds = [int(n) for n in counts]
    workers = os.cpu_count() or 1 if options.workers is None else options.workers
    if workers < 1 or options.seed < 0:
        raise InputError('--workers must be at least 1, --seed at least 0')
    signals = measurements(
        options.bags, options.scenes, options.overrides, options.sensor, options.skip
    )
    first = signals[0]
    wanted = parameters(
        first.machine, options.fit.split(','), first.sensor, options.joint, ranges(options.ranges)
    )
    with progress.count('identify', sum(rounds), quiet=options.json) as show:
        found = Identification(signals, wanted, options.seed, workers, show).find(rounds)
    if options.json:
        _print_json(report.to_json(found))
    else:
        print(report.render(found))
    return 0


def _analyze(options: argparse.Namespace) -> int:
    from mechanism_sim.analysis import analyze, render  # noqa: PLC0415
    from mechanism_sim.analysis.details import Details, Wanted  # noqa: PLC0415
    from mechanism_sim.analysis.render_details import render_details  # noqa: PLC0415
    from mechanism_sim.report import figures  # noqa: PLC0415

    plots = figures.check_picture('--plots', options.plots, True) if options.plots else None
    wanted = Wanted(
        options.spectrum, options.orders, options.envelope, options.average, options.impacts_on,
        options.wear, options.deviation, _band(options.band), options.skip,
        _quantity('--pin-radius', options.pin_radius, 'm')[0] if options.pin_radius else None,
    )  # fmt: skip
    details: Details | None = None
    if wanted or plots or options.against:
        details = _details(options, wanted)
    if details and plots:
        from mechanism_sim.report.condition import draw  # noqa: PLC0415

        with figures.style():
            figures.save_all(draw(details), plots)
    if options.json:
        more = {'details': details.to_json()} if details else {}
        _print_json(analyze(options.bag, namespace=options.namespace).to_json() | more)
    elif details and wanted:
        print(render_details(details))
    else:
        print(render(analyze(options.bag, namespace=options.namespace)))
    return 0


def _details(options: argparse.Namespace, wanted: Any) -> Any:
    """What is asked of a bag, or everything that can be drawn."""
    from mechanism_sim.analysis.details import everything, find_details  # noqa: PLC0415
    from mechanism_sim.analysis.record import read_record  # noqa: PLC0415

    if options.skip < 0:
        raise InputError('--skip must be at least 0')
    if options.against and not wanted.deviations:
        raise InputError('--against goes with --deviation: it compares two deviations')
    record = read_record(options.bag, options.namespace)
    against = read_record(options.against, options.namespace) if options.against else None
    return find_details(record, wanted if wanted else everything(record, wanted), against)


def _band(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    low, colon, high = text.partition(':')
    if not colon:
        raise InputError(f"--band '{text}': write for example '500 Hz:2 kHz'")
    return _quantity('--band', low, 'Hz')[0], _quantity('--band', high, 'Hz')[0]
