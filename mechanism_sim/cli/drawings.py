"""Cycles, pictures, cams and gears for manufacture, machines for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from mechanism_sim import output, strict_json
from mechanism_sim.cli.options import (
    TABLES,
    Command,
    flag,
    look_options,
    measure_option,
    option,
    print_either,
    print_result,
    quantity,
    read_machine,
    read_measures,
    refuse_options,
    say_turns,
    scene_options,
    several,
    time_option,
)
from mechanism_sim.errors import InputError
from mechanism_sim.terminal import print_notice

if TYPE_CHECKING:
    from mechanism_sim.scene import Machine


FORMATS = {
    '.urdf': 'urdf', '.xml': 'mjcf', '.sdf': 'sdf', '.dxf': 'dxf', '.stl': 'stl',
    '.json': 'foxglove', '.rviz': 'rviz', '.html': 'html',
}  # fmt: skip
"""Formats of `export` by the endings of files."""


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('cycle', _cycle, 'tables, extremes and plots over a turn of the drive')
    scene_options(sub)
    option(sub, '--samples', 'N', 'intervals in a cycle', 360)
    option(
        sub, '--at', 'ANGLE|WAY',
        "all quantities at a position of the drive, as '30 deg' or '60 mm'; a turn begins there",
    )  # fmt: skip
    turns = 'number of turns of the drive (default: as many as bring all again)'
    option(sub, '--revolutions', 'N', turns, int)
    time_option(sub, '--duration', 'length, for a drive without a constant speed')
    sub.add_argument(
        '--points', nargs='+', action='extend', default=[], metavar='LINK.POINT',
        help='points whose paths are computed',
    )  # fmt: skip
    flag(sub, '--local', 'add the forces along and across each link')
    flag(sub, '--static', 'leave out inertia forces')
    measure_option(sub)
    option(sub, '-o --output', 'FILE', f'write the samples: {TABLES}')
    option(sub, '--plots', 'DIR|FILE', 'draw them: a folder, .pdf, .png or .svg')
    sub = command('draw', _draw, 'a picture of a mechanism')
    scene_options(sub)
    option(sub, '-o --output', 'FILE', 'a .svg, .png or .pdf file; SCENE.svg if not given')
    option(
        sub,
        '--at',
        'ANGLE|WAY|TIME',
        "where to draw it, as '30 deg' or '60 mm' of the drive, or '20 ms' (else its start)",
    )
    option(sub, '--positions', 'K', 'number of positions; all but one are drawn faint', 1)
    look_options(sub, 'all')
    time_option(sub, '--duration', 'length, for a drive without a constant speed')
    option(sub, '--magnify', 'N', 'magnification of bending; made visible if not given', 0.0)
    more = sub.add_argument_group('for manufacture')
    option(
        more, '--profile', 'JOINT',
        'instead of a picture: figures of this cam, or of these gears in mesh; --output: their '
        'outlines, a .svg or .dxf file',
    )  # fmt: skip
    option(more, '--table', 'FILE', f'write a cam over its turn: {TABLES}')
    option(more, '--gear', 'NAME', 'only the outline of this gear')
    option(
        more, '--friction', 'MU', 'coefficient of friction between teeth; 0.05 if not given', float
    )
    sub = command('export', _export, 'write a machine for viewers and other simulators')
    scene_options(sub)
    sub.add_argument(
        '--format', choices=(*dict.fromkeys(FORMATS.values()),),
        help='needed if the ending of --output does not determine it: a description of the '
        'machine, its links as a drawing or plates, what a viewer shows of its run, or a page '
        'of its ideal motion',
    )  # fmt: skip
    option(
        sub, '-o --output', 'FILE',
        'a .urdf, .sdf, .dxf, .stl, .rviz, .html file, .xml of MuJoCo, .json of Foxglove; '
        'standard output if not given',
    )  # fmt: skip
    option(sub, '--frame-prefix', 'TEXT', 'prefix of frame names, in a URDF and for viewers', '')
    option(sub, '--namespace', 'NS', 'namespace of the nodes, for viewers', '')
    text = 'for a page: a length or coordinate with a slider; several times'
    several(sub, '--slider', 'PATH=LOW:HIGH', text)


def _cycle(options: argparse.Namespace) -> int:
    from mechanism_sim import tables  # noqa: PLC0415
    from mechanism_sim.report import cycle as report  # noqa: PLC0415
    from mechanism_sim.report import figures, measured, progress  # noqa: PLC0415
    from mechanism_sim.report.sections import text  # noqa: PLC0415
    from mechanism_sim.results.cycle import (  # noqa: PLC0415
        at_position,
        cycle,
        is_steady,
        measures_of,
    )

    plots = figures.check_picture('--plots', options.plots, True) if options.plots else None
    if options.output:
        tables.check_file('--output', options.output)
    machine = read_machine(options)
    say_turns(options, machine, of_cycle=True)
    at = quantity('--at', options.at, _unit_of_drive(machine))[0] if options.at else None
    with progress.busy('cycle', options.json) as say:
        start = at if at is not None and is_steady(machine) else None
        found = cycle(
            machine, options.samples, start, options.revolutions, options.duration, options.points,
            options.local, options.static,
        )  # fmt: skip
        if options.output:
            tables.write(Path(options.output), found.table().columns())
        figures_found = measures_of(found, read_measures(options, machine))
        there = {} if at is None else at_position(machine, at, found)
        beside = {} if at is None else {'at': strict_json.plain(there)}
        if plots:
            from mechanism_sim.report.plots import charts  # noqa: PLC0415

            say('plots')
            figures.save_all(charts(found), plots)
    return print_result(
        options,
        found,
        lambda c: report.to_json(c) | measured.to_json(figures_found) | beside,
        lambda c: text(
            [
                *([] if at is None else [report.position(machine, at, there)]),
                *report.sections(c),
                *measured.section(figures_found),
            ]
        ),
    )


def _unit_of_drive(machine: Machine) -> str:
    """SI unit of the position of the main drive."""
    return 'm' if machine.plan.main in machine.plan.ideal.displacements else 'rad'


_PICTURE = 'at', 'positions', 'path', 'duration', 'labels', 'magnify'


def _draw(options: argparse.Namespace) -> int:
    if options.profile is not None:
        refuse_options(options, _PICTURE, 'does not apply to --profile')
        return _profile(options)
    refuse_options(options, ['table', 'gear', 'friction'], 'needs --profile')
    from mechanism_sim.report import drawing, figures, progress  # noqa: PLC0415
    from mechanism_sim.results.cycle import instant  # noqa: PLC0415

    machine = read_machine(options)
    if not machine.mechanism.deformations:
        refuse_options(options, ['magnify'], f'does not apply: {machine.name} has no elastic link')
    file = figures.check_picture('--output', options.output or f'{machine.name}.svg')
    if options.positions < 1:
        raise InputError('--positions must be at least 1')
    of_drive = _unit_of_drive(machine)
    value, unit = quantity('--at', options.at, of_drive, 's') if options.at else (None, '')
    with progress.busy('draw', options.json), figures.style():
        found, t = instant(
            machine,
            value if unit == of_drive else None,
            value if unit == 's' else None,
            options.duration,
            options.path,
            still=options.positions == 1 and not options.path,
        )
        picture = drawing.draw(found, t, options.positions, options.labels, options.magnify)
        figures.save(picture, file, cropped=True)
    return print_either(options, {'scene': machine.name, 'file': str(file), 't': t}, file)


def _profile(options: argparse.Namespace) -> int:
    from mechanism_sim import tables  # noqa: PLC0415
    from mechanism_sim.report import profile  # noqa: PLC0415

    file = options.output and output.check_path('--output', options.output, *profile.WRITERS)
    if options.table:
        tables.check_file('--table', options.table)
    machine = read_machine(options)
    if options.table:
        found = profile.table(machine, options.profile)
        tables.write(Path(options.table), found.columns())
    sheet = profile.profile(machine, options.profile, options.gear, options.friction)
    if file:
        profile.write(sheet.outline, file)
    head = {'scene': machine.name, 'joint': options.profile}
    data = head | profile.to_json(sheet) | ({'file': str(file)} if file else {})
    return print_result(options, sheet, lambda _: data, profile.render)


def _export(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress  # noqa: PLC0415

    viewers = ('foxglove', 'rviz')
    if not options.format:
        ending = Path(options.output or '').suffix
        if ending not in FORMATS:
            raise InputError(
                f'export: give --format, or a file that ends in {", ".join(FORMATS)}'
                f'{f", not {ending}" if ending else ""}'
            )
        options.format = FORMATS[ending]
    if options.format not in viewers:
        refuse_options(options, ['namespace'], f'applies to --format {" and ".join(viewers)}')
        if options.format != 'urdf':
            refuse_options(options, ['frame-prefix'], 'needs --format urdf, foxglove or rviz')
    if options.format != 'html':
        refuse_options(options, ['slider'], 'applies to --format html')
    machine = read_machine(options)
    with progress.busy('export', options.json):
        text, missing = _exported(options, machine)
    for sentence in missing:
        print_notice(sentence)
    if options.output:
        output.write_text(options.output, text)
    where = {'file': options.output} if options.output else {'text': text}
    if options.format == 'stl':  # the format has no unit
        print_notice('its lengths are in mm')
        where['unit'] = 'mm'
    data = {'scene': machine.name, 'format': options.format, 'left_out': missing, **where}
    return print_either(options, data, options.output or text.rstrip())


def _exported(options: argparse.Namespace, machine: Machine) -> tuple[str, list[str]]:
    """A machine in the requested format, and sentences on what the format leaves out."""
    if options.format in ('foxglove', 'rviz'):
        from mechanism_sim.analysis.preview import preview  # noqa: PLC0415
        from mechanism_sim.report.layouts import to_foxglove, to_rviz  # noqa: PLC0415

        to = to_foxglove if options.format == 'foxglove' else to_rviz
        return to(preview(machine), options.namespace, options.frame_prefix), []
    if options.format == 'html':
        from mechanism_sim.pages import ideal  # noqa: PLC0415
        from mechanism_sim.ranges import named_ranges  # noqa: PLC0415

        given = named_ranges('--slider', options.slider, 'links.crank.length=50 mm:80 mm')
        sliders = {path: (one.values[0], one.values[1]) for path, one in given.items()}
        return ideal.page(machine, sliders, options.scene)
    from mechanism_sim.export import mjcf, sdf, urdf  # noqa: PLC0415

    if options.format in ('dxf', 'stl'):
        from mechanism_sim.export import plates  # noqa: PLC0415

        return (plates.drawing if options.format == 'dxf' else plates.to_stl)(machine), []
    if options.format == 'urdf':
        return urdf.to_urdf(machine, options.frame_prefix), urdf.left_out(machine)
    if options.format == 'mjcf':
        return mjcf.to_mjcf(machine), mjcf.left_out(machine)
    return sdf.to_sdf(machine), sdf.left_out(machine)
