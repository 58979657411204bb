"""What a scene comes down to: its level, and what was left out and why."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from mechanism_sim.scene.machine import CLOSING_JOINT, Level, Machine

_WHY = {
    Level.KINEMATIC: 'the crank is prescribed, every joint is ideal, and forces are not asked for '
    'or masses not given: closed-form loop closure',
    Level.INVERSE_DYNAMICS: 'the crank is prescribed, every joint is ideal, and forces are asked '
    'for: closed-form loop closure and a linear solve for the forces',
    Level.NONSMOOTH: f'{CLOSING_JOINT} has clearance: equations of motion with a gap, and an '
    'event loop for free flight, impact and following',
}


@dataclass(frozen=True)
class Report:
    """The outcome of `check`."""

    scene: str
    title: str
    level: str
    why: str
    coordinates: dict[str, str]  #: name: prescribed, follows or free
    relations: list[str]
    gaps: list[str]
    left_out: list[str]
    notes: list[str]

    def to_json(self) -> dict[str, object]:
        """As a plain dictionary."""
        return asdict(self)


def check(machine: Machine) -> Report:
    """Look at a scene without running it.

    Raises
    ------
    InputError
        If the machine cannot start where it should; the rest was refused when it was built.
    """
    scene, level = machine.scene, machine.level
    loose = level is Level.NONSMOOTH
    if loose:
        machine.initial_state()
    rest = 'free (integrated)' if loose else 'follows from the closed loop'
    speed = scene.drive.speed
    coordinates = {'crank': f'prescribed, {speed:g} rad/s', 'coupler': rest, 'rocker': rest}
    relations, gaps = [], []
    clearance = scene.joints.coupler_rocker.clearance
    if clearance:
        gaps.append(
            f'{CLOSING_JOINT}: pin in bushing, radial clearance {clearance.radial:g} m, Newton '
            f'restitution {clearance.restitution:g}, start {scene.start}'
        )
    else:
        relations.append(f'{CLOSING_JOINT}: closes the loop, 2 equations')
    left_out = []
    if level is not Level.KINEMATIC and not any(scene.gravity):
        left_out.append('gravity: it is zero')
    if level is Level.KINEMATIC:
        left_out.append('masses, gravity and forces: nobody asks for them')
    if loose:
        left_out += ['friction and pin radius: none given', 'crank inertia: its speed is given']
        left_out.append('clearance in the other joints: none given')
    return Report(
        machine.name,
        scene.title,
        level.value,
        _WHY[level],
        coordinates,
        relations,
        gaps,
        left_out,
        _notes(machine),
    )


def _notes(machine: Machine) -> list[str]:
    linkage, scene = machine.linkage, machine.scene
    grashof = linkage.grashof()
    notes = [
        f'Grashof: the sum of shortest and longest link is {abs(grashof):.6g} m '
        f'{"less" if grashof > 0 else "more"} than that of the others'
    ]
    notes += [
        f'sensor {name}: {s.kind} on the {s.link}, {s.at:g} m from its proximal joint, {s.axis} '
        f'the link, {s.sample_rate:g} Hz'
        for name, s in scene.sensors.items()
    ]
    if machine.level is Level.NONSMOOTH:
        notes.append(f'rtol {scene.solver.rtol:g}, atol {scene.solver.atol:g} m')
    return notes


def render(report: Report) -> str:
    """The report as text for people."""
    lines = [f'{report.scene}: {report.title}', f'level: {report.level}', f'  {report.why}']
    lines.append('coordinates')
    lines += [f'  {name}: {what}' for name, what in report.coordinates.items()]
    for heading, items in (
        ('relations', report.relations),
        ('gaps', report.gaps),
        ('left out', report.left_out),
        ('notes', report.notes),
    ):
        if items:
            lines += [heading, *(f'  {item}' for item in items)]
    return '\n'.join(lines)
