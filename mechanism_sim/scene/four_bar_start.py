"""Where a four-bar starts, from its closed form."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.system import Array
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.scene.seats import seats

if TYPE_CHECKING:
    from mechanism_sim.scene.machine import Machine


def four_bar(machine: Machine) -> tuple[dict[str, float], dict[str, float]]:
    """Values and rates of the coordinates of a four-bar at the start.

    Raises
    ------
    InputError
        If it cannot be assembled.
    """
    angle, speed = machine.start_of_crank
    acceleration = 0.0
    if isinstance(machine.law, DriveLaw):
        # turns are left out: only differences of angles count
        _, local = machine.law.about(Fraction(0))
        angle, speed, half, *_ = *local, 0.0, 0.0
        acceleration = 2.0 * half
    # In extended precision: after a few dozen impacts the last digit of the start counts.
    crank = np.array([[angle], [speed], [acceleration]], dtype=np.longdouble)
    q, v, a = (x.astype(float) for x in machine.linkage.motion(*crank))
    if machine.starts_singular:
        # at a change point: on the branch that a drive follows
        q, v = machine.assembly.q[:, None], machine.assembly.v[:, None]
        if not machine.torque_driven:
            driven = np.array([[speed]]), np.array([[acceleration]])
            q, v, a, _ = machine.ideal.motion(q, *driven, (v, np.zeros_like(v)))
    if np.isnan(q).any():
        raise InputError(
            f'{machine.name}: the mechanism cannot be assembled at drive.start_angle = {angle:g} '
            'rad: crank pin and rocker pivot are out of reach of coupler and rocker'
        )
    Q = {name: np.zeros(2) for name in machine.clearances}
    if machine.scene.start == 'seated' and machine.system.gaps:
        Q = seats(machine, q, v, a)
        q[1:, 0] = _displaced(machine, angle, q[1:, 0], np.sum([*Q.values()], axis=0))
    for i, name in enumerate(('coupler', 'rocker'), 1):
        for rows, given in zip((q, v), machine.plan.given, strict=True):
            rows[i, 0] = given.get(name, rows[i, 0])
    values = _coordinates(machine, q[:, 0], v[:, 0], Q)
    return {c: x for c, (x, _) in values.items()}, {c: w for c, (_, w) in values.items()}


def _displaced(machine: Machine, crank: float, near: Array, Q: Array) -> Array:
    """Angles of coupler and rocker with pins displaced by Q [m] in all."""
    l = machine.linkage  # noqa: E741 - the lengths
    angles = np.array(
        l.close(l.ground - l.crank * np.cos(crank) + Q[0], -l.crank * np.sin(crank) + Q[1])
    )
    if np.isnan(angles).any():
        raise InputError(
            f'{machine.name}: the mechanism cannot be assembled with the pins of '
            f'{", ".join(machine.clearances)} seated: the clearance is too large'
        )
    return angles + 2.0 * np.pi * np.round((near - angles) / (2.0 * np.pi))


def _coordinates(
    machine: Machine, q: Array, v: Array, Q: dict[str, Array]
) -> dict[str, tuple[float, float]]:
    """Value and rate of every coordinate, from the angles of the links and the pins' places."""
    links = tuple(machine.links)
    found = {name: (float(q[i]), float(v[i])) for i, name in enumerate(links)}
    mechanism, l = machine.mechanism, machine.linkage  # noqa: E741 - the lengths
    none = np.zeros(2)
    u, du = (np.array([np.cos(q), np.sin(q)]).T, np.array([-np.sin(q), np.cos(q)]).T)
    # the origins of the links, each in its proximal joint
    crank = -Q.get('ground_crank', none)
    coupler = crank + l.crank * u[0] - Q.get('crank_coupler', none)
    rocker = np.array([l.ground, 0.0]) + Q.get('rocker_ground', none)
    rates = {'crank': none, 'coupler': l.crank * v[0] * du[0], 'rocker': none}
    for i, (name, origin) in enumerate(zip(links, (crank, coupler, rocker), strict=True)):
        if name in mechanism.floating:
            arm = mechanism.body(name).cog[0]
            place, rate = origin + arm * u[i], rates[name] + arm * v[i] * du[i]
            for axis, x, w in zip('xy', place, rate, strict=True):
                found[f'{name}.{axis}'] = (float(x), float(w))
    return found
