"""From a scene to its machine, refusing what no machine can be."""

from __future__ import annotations

from mechanism_sim.errors import InputError
from mechanism_sim.scene.machine import CLOSING_JOINT, Level, Machine
from mechanism_sim.scene.schema import FourBarScene


def build(name: str, scene: FourBarScene) -> Machine:
    """The machine of a scene.

    Raises
    ------
    InputError
        If the geometry is impossible, or forces are wanted without masses.
    """
    machine = Machine(name, scene)
    linkage = machine.linkage
    lengths = {n: getattr(linkage, n) for n in ('ground', 'crank', 'coupler', 'rocker')}
    said = ', '.join(f'{n} {x:g} m' for n, x in lengths.items())
    longest = max(lengths, key=lambda n: lengths[n])
    others = sum(lengths.values()) - lengths[longest]
    if lengths[longest] >= others:
        raise InputError(
            f'{name}: the four-bar cannot be assembled: {longest} ({lengths[longest]:g} m) is '
            f'not shorter than the three other links together ({others:g} m)'
        )
    if not linkage.assembles_everywhere():
        raise InputError(
            f'{name}: the crank cannot make a full turn at constant speed ({said}): ground and '
            'crank in line must leave a triangle with coupler and rocker; shorten the crank'
        )
    if machine.level is not Level.NONSMOOTH:
        _check_initial(name, scene)
    _check_joints(name, scene, lengths)
    _check_masses(name, machine)
    for sensor, placed in scene.sensors.items():
        if not sensor.isidentifier():
            raise InputError(f"{name}: the sensor name '{sensor}' must be letters, digits and _")
        if abs(placed.at) > 10.0 * lengths[placed.link]:
            raise InputError(
                f'{name}: sensors.{sensor}.at = {placed.at:g} m lies far off the {placed.link} '
                f'({lengths[placed.link]:g} m long)'
            )
    return machine


def _check_joints(name: str, scene: FourBarScene, lengths: dict[str, float]) -> None:
    for joint in type(scene.joints).model_fields:
        clearance = getattr(scene.joints, joint).clearance
        if clearance is None:
            continue
        if joint != CLOSING_JOINT:
            raise InputError(
                f'{name}: joints.{joint}.clearance: only {CLOSING_JOINT} can have clearance yet'
            )
        shortest = min(lengths.values())
        if clearance.radial >= shortest:
            raise InputError(
                f'{name}: joints.{joint}.clearance.radial = {clearance.radial:g} m is larger than '
                f'the shortest link ({shortest:g} m)'
            )


def _check_initial(name: str, scene: FourBarScene) -> None:
    """Without clearance only the crank can be placed; the others follow."""
    for kind, part in (('position', scene.initial.position), ('velocity', scene.initial.velocity)):
        for coordinate in ('coupler', 'rocker'):
            if getattr(part, coordinate) is not None:
                raise InputError(
                    f'{name}: initial.{kind}.{coordinate} cannot be chosen: without clearance it '
                    'follows from the crank (drive.start_angle, drive.speed)'
                )


def _check_masses(name: str, machine: Machine) -> None:
    """Mass properties are given for every moving link, or, without dynamics, for none."""
    given = [
        (f'links.{key}.{part}', getattr(link, part))
        for key, link in machine.links.items()
        for part in ('mass', 'inertia', 'cog')
    ]
    missing = [key for key, value in given if value is None]
    if missing and (len(missing) < len(given) or machine.level is Level.NONSMOOTH):
        raise InputError(
            f"{name}: '{missing[0]}' is missing: forces and clearances need the mass, inertia and "
            'cog of every moving link'
        )
