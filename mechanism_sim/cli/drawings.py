"""Cycles, pictures, cams and gears for the workshop, machines for other programs."""

from __future__ import annotations

import argparse
import sys

from mechanism_sim import output
from mechanism_sim.cli.options import (
    TABLES,
    Command,
    flag,
    measure_option,
    option,
    print_json,
    print_result,
    quantity,
    read_machine,
    read_measures,
    refuse_options,
    scene_options,
)
from mechanism_sim.errors import InputError


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('cycle', _cycle, 'tables, extremes and plots over a turn of the drive')
    scene_options(sub)
    option(sub, '--samples', 'N', 'intervals in a cycle', 360)
    sub.add_argument(
        '--from',
        metavar='ANGLE',
        dest='start',
        help="position of the drive to begin at, as '30 deg'",
    )
    option(sub, '--revolutions --periods', 'N', 'how many turns of the drive', 1)
    option(sub, '--duration', 'S', 'seconds, for a drive without a constant speed', float)
    sub.add_argument(
        '--points',
        nargs='+',
        action='extend',
        default=[],
        metavar='LINK.POINT',
        help='points whose paths are wanted',
    )
    flag(sub, '--local', 'add the forces along and across each link')
    flag(sub, '--static', 'leave out the forces of inertia')
    measure_option(sub)
    option(sub, '-o --output', 'FILE', f'write the samples: {TABLES}')
    option(sub, '--plots', 'DIR|FILE', 'draw them: a folder, .pdf, .png or .svg')
    sub = command('draw', _draw, 'a picture of a mechanism')
    scene_options(sub)
    option(sub, '-o --output', 'FILE', 'a .svg, .png or .pdf file; SCENE.svg if not given')
    option(
        sub,
        '--at',
        'ANGLE|TIME',
        "where to draw it, as '30 deg' of the drive or '20 ms'; the start if not given",
    )
    option(sub, '--positions', 'K', 'how many positions, all but one of them faint', 1)
    sub.add_argument(
        '--path',
        action='append',
        default=[],
        metavar='LINK.POINT',
        help='draw the path of this point; several times',
    )
    option(sub, '--duration', 'S', 'seconds, for a drive without a constant speed', float)
    sub.add_argument(
        '--labels', choices=('all', 'links', 'none'), default='all', help='which names are written'
    )
    option(sub, '--magnify', 'N', 'how much more elastic links bend; visibly if not given', 0.0)
    sub = command('layout', _layout, 'a layout for Foxglove, or a configuration for RViz')
    scene_options(sub)
    sub.add_argument(
        '--for', choices=('foxglove', 'rviz'), required=True, dest='viewer', help='which viewer'
    )
    option(sub, '-o --output', 'FILE', 'the file; SCENE.json or SCENE.rviz if not given')
    option(sub, '--namespace', 'NAME', 'namespace of the nodes', '')
    option(sub, '--frame-prefix', 'TEXT', 'what stands before names of links in /tf', '')
    sub = command(
        'profile', _profile, 'figures and workshop drawing of a cam, or of gears in mesh'
    )
    scene_options(sub)
    sub.add_argument('joint', metavar='JOINT', help='a joint with a cam or teeth')
    option(sub, '-o --output', 'FILE', 'draw the outlines to a .svg or .dxf file')
    option(sub, '--table', 'FILE', f'write a cam over its turn: {TABLES}')
    option(sub, '--gear', 'NAME', 'only the outline of this gear')
    option(
        sub, '--friction', 'MU', 'coefficient of friction between teeth; 0.05 if not given', float
    )
    sub = command('export', _export, 'a machine for viewers and for other simulators')
    scene_options(sub)
    sub.add_argument(
        '--format', required=True, choices=('urdf', 'mjcf', 'sdf'), help='of the description'
    )
    option(sub, '-o --output', 'FILE', 'the file; standard output if not given')
    option(sub, '--prefix', 'TEXT', 'before names of frames, in a URDF', '')
    sub = command('teeth', _teeth, 'find numbers of teeth for a ratio, the best first')
    sub.add_argument('ratio', metavar='RATIO', help="of speeds, without sign, as 3.5 or '7/2'")
    option(sub, '--stages', 'N', 'pairs of gears in series', 1)
    option(sub, '--tolerance', 'X', 'largest relative error of the ratio', 0.0)
    option(sub, '--teeth', 'A:B', 'fewest and most teeth of a gear', '18:120')
    option(sub, '--centre-distance', 'C', "of every stage, as '60 mm'; with --modules")
    option(sub, '--modules', 'M,...', "to choose from, as '2 mm,2.5 mm'")


def _cycle(options: argparse.Namespace) -> int:
    from mechanism_sim.cycles.cycle import cycle  # noqa: PLC0415
    from mechanism_sim.cycles.measures import Measurement  # noqa: PLC0415
    from mechanism_sim.report import cycle as report  # noqa: PLC0415
    from mechanism_sim.report import figures, measured, progress, tables  # noqa: PLC0415

    plots = figures.check_picture('--plots', options.plots, True) if options.plots else None
    if options.output:
        tables.check_output(options.output)
    start = options.start and quantity('--from', options.start, 'rad')[0]
    machine = read_machine(options)
    with progress.busy('cycle', options.json) as say:
        found = cycle(
            machine, options.samples, start, options.revolutions, options.duration, options.points,
            options.local, options.static,
        )  # fmt: skip
        if options.output:
            tables.write(options.output, found.table(), found.units())
        measures = read_measures(options, machine)
        taken = Measurement(machine, measures, float(found.t[0]), float(found.t[-1]))
        taken.add(found.solution)
        figures_found = taken.found()
        if plots:
            from mechanism_sim.report.plots import draw  # noqa: PLC0415

            say('plots')
            figures.save_all(draw(found), plots)
    return print_result(
        options,
        found,
        lambda c: report.to_json(c) | measured.to_json(figures_found),
        lambda c: '\n'.join([report.render(c), *measured.lines(figures_found)]),
    )


def _draw(options: argparse.Namespace) -> int:
    from mechanism_sim.cycles.cycle import instant  # noqa: PLC0415
    from mechanism_sim.report import drawing, figures, progress  # noqa: PLC0415

    machine = read_machine(options)
    if not machine.mechanism.deformations:
        refuse_options(options, ['magnify'], f'does not apply: {machine.name} has no elastic link')
    file = figures.check_picture('--output', options.output or f'{machine.name}.svg')
    if options.positions < 1:
        raise InputError('--positions must be at least 1')
    value, unit = quantity('--at', options.at, 'rad', 's') if options.at else (None, '')
    with progress.busy('draw', options.json), figures.style():
        found, t = instant(
            machine,
            value if unit == 'rad' else None,
            value if unit == 's' else None,
            options.duration,
            options.path,
            still=options.positions == 1 and not options.path,
        )
        picture = drawing.draw(found, t, options.positions, options.labels, options.magnify)
        figures.save(picture, file, cropped=True)
    if options.json:
        print_json({'scene': machine.name, 'file': str(file), 't': t})
    else:
        print(file)
    return 0


def _layout(options: argparse.Namespace) -> int:
    from pathlib import Path  # noqa: PLC0415

    from mechanism_sim.export.preview import preview  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.report.foxglove import to_foxglove  # noqa: PLC0415
    from mechanism_sim.report.rviz import to_rviz  # noqa: PLC0415

    machine = read_machine(options)
    to, ending = (to_foxglove, 'json') if options.viewer == 'foxglove' else (to_rviz, 'rviz')
    file = Path(options.output or f'{machine.name}.{ending}')
    with progress.busy('layout', options.json):
        text = to(preview(machine), options.namespace, options.frame_prefix)
    output.write_text(file, text)
    if options.json:
        print_json({'scene': machine.name, 'file': str(file)})
    else:
        print(file)
    return 0


def _profile(options: argparse.Namespace) -> int:
    from mechanism_sim.report import profile, tables  # noqa: PLC0415

    file = options.output and output.check_path('--output', options.output, *profile.WRITERS)
    if options.table:
        tables.check_output(options.table, '--table')
    machine = read_machine(options)
    if options.table:
        tables.write(options.table, profile.table(machine, options.joint))
    sheet, outline = profile.profile(machine, options.joint, options.gear, options.friction)
    if file:
        profile.write(outline, file)
    if options.json:
        where = {'file': str(file)} if file else {}
        print_json({'scene': machine.name, 'joint': options.joint, **sheet.to_json(), **where})
    else:
        print(sheet.render())
    return 0


def _export(options: argparse.Namespace) -> int:
    from mechanism_sim.export import mjcf, sdf, urdf  # noqa: PLC0415

    if options.prefix and options.format != 'urdf':
        raise InputError('--prefix is for --format urdf')
    machine = read_machine(options)
    if options.format == 'urdf':
        text, missing = urdf.to_urdf(machine, options.prefix), urdf.left_out(machine)
    elif options.format == 'mjcf':
        text, missing = mjcf.to_mjcf(machine), mjcf.left_out(machine)
    else:
        text, missing = sdf.to_sdf(machine), sdf.left_out(machine)
    for sentence in missing:
        print(f'mechanism-sim: {sentence}', file=sys.stderr)
    if options.output:
        output.write_text(options.output, text)
    if options.json:
        where = {'file': options.output} if options.output else {'text': text}
        print_json({'scene': machine.name, 'format': options.format, 'left_out': missing, **where})
    else:
        print(options.output or text.rstrip())
    return 0


def _teeth(options: argparse.Namespace) -> int:
    from mechanism_sim.gears.teeth import choose, just_outside, limits, ratio_of  # noqa: PLC0415
    from mechanism_sim.report import teeth  # noqa: PLC0415

    fewest, colon, most = options.teeth.partition(':')
    if not (colon and fewest.isdecimal() and most.isdecimal()):
        raise InputError(f"--teeth '{options.teeth}': write for example 18:120")
    count = int(fewest), int(most)
    distance = (
        quantity('--centre-distance', options.centre_distance, 'm')[0]
        if (options.centre_distance)
        else None
    )
    listed = options.modules.split(',') if options.modules else ()
    modules = [quantity('--modules', m, 'm')[0] for m in listed]
    ratio, stages, tolerance = ratio_of(options.ratio), options.stages, options.tolerance
    found = choose(
        ratio, stages=stages, tolerance=tolerance, teeth=count, centre_distance=distance,
        modules=modules,
    )  # fmt: skip
    search = teeth.Search(
        found,
        limits(count, stages, tolerance, distance, modules),
        just_outside(ratio, tolerance, count, distance, modules) if stages == 1 else None,
    )
    return print_result(options, search, teeth.to_json, teeth.render)
