"""From a scene to its machine, refusing what no machine can be."""

from __future__ import annotations

import math
from itertools import pairwise

from mechanism_sim.errors import InputError
from mechanism_sim.linkages.grashof import crank_turns
from mechanism_sim.scene.machine import Level, Machine
from mechanism_sim.scene.schema import Clearance, FourBarScene


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
    _check_drive(name, scene)
    if not machine.torque_driven and not crank_turns(linkage):
        raise InputError(
            f'{name}: the crank cannot make a full turn at constant speed ({said}): ground and '
            'crank in line must leave a triangle with coupler and rocker; shorten the crank'
        )
    if machine.level not in (Level.NONSMOOTH, Level.COMPLIANT):
        _check_initial(name, scene)
    _check_joints(machine, lengths)
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


def _check_drive(name: str, scene: FourBarScene) -> None:
    """One way of driving, and a speed where one is needed."""
    drive = scene.drive
    ways = [way for way in ('profile', 'torque', 'motor') if getattr(drive, way) is not None]
    if len(ways) > 1:
        raise InputError(
            f'{name}: drive.{ways[0]} and drive.{ways[1]} exclude each other: keep one'
        )
    if drive.profile:
        if drive.speed is not None:
            raise InputError(
                f'{name}: drive.speed and drive.profile exclude each other: a profile gives every '
                'speed, the first at its first point'
            )
        times = [t for t, _ in drive.profile.points]
        for before, after in pairwise(times):
            if after <= before:
                raise InputError(
                    f'{name}: drive.profile.points: times must rise, but {after:g} s follows '
                    f'{before:g} s'
                )
    elif drive.speed is None:
        raise InputError(
            f"{name}: 'drive.speed' is missing: the speed of the crank, or with a torque or a "
            "motor its speed at the start, for example '350 rpm'"
        )
    if drive.motor and drive.motor.no_load_speed == 0.0:
        raise InputError(f'{name}: drive.motor.no_load_speed must not be zero')


def _check_joints(machine: Machine, lengths: dict[str, float]) -> None:
    shortest = min(lengths.values())
    for joint, clearance in machine.clearances.items():
        where = f'{machine.name}: joints.{joint}.clearance'
        if clearance.radial >= shortest:
            raise InputError(
                f'{where}.radial = {clearance.radial:g} m is larger than the shortest link '
                f'({shortest:g} m)'
            )
        if clearance.contact is None and machine.level is Level.COMPLIANT:
            raise InputError(
                f"{where} has no 'contact', but another joint has: either all loose joints are "
                'compliant or none is'
            )
        _check_contact(where, clearance, machine)
        if clearance.contact and math.isinf(clearance.friction):
            raise InputError(f'{where}.friction = rough is for rigid contacts only')
        if clearance.contact and clearance.contact.law == 'flores' and not clearance.restitution:
            raise InputError(f'{where}: the law of Flores needs a restitution above 0')
        if clearance.pin_radius and not clearance.friction:
            raise InputError(
                f'{where}.pin_radius = {clearance.pin_radius:g} m has no effect without friction: '
                'give friction too, or leave it out'
            )
        if clearance.friction > 10.0 and not math.isinf(clearance.friction):
            raise InputError(
                f'{where}.friction = {clearance.friction:g} is more than 10: for contacts that '
                "never slip write 'friction: rough'"
            )


def _check_contact(where: str, clearance: Clearance, machine: Machine) -> None:
    """What each law of contact needs, and no more."""
    contact = clearance.contact
    if contact is None:
        return
    film = contact.law == 'film'
    for key in ('viscosity', 'width', 'radius') if film else ('stiffness',):
        if getattr(contact, key) is None:
            raise InputError(
                f"{where}.contact: '{key}' is missing: the law {contact.law} needs it"
            )
    if film and clearance.friction:
        raise InputError(f'{where}.friction has no meaning with a film: its oil has its own')
    films = [
        c.contact is not None and c.contact.law == 'film' for c in machine.clearances.values()
    ]
    if any(films) and not all(films):
        raise InputError(f'{where}: either all loose joints have a film or none has')


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
    if missing and (len(missing) < len(given) or machine.dynamic):
        raise InputError(
            f"{name}: '{missing[0]}' is missing: forces, torques and clearances need the mass, "
            'inertia and cog of every moving link'
        )
