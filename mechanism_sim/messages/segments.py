"""Motion messages and the motion they carry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.planar.frames import STATE
from mechanism_sim.scene.machine import Machine
from ros_interfaces.classes import (
    float64_array,
    int64_array,
    message_class,
    uint8_array,
)
from ros_interfaces.stamps import stamp


@dataclass(frozen=True)
class Segments:
    """The m segments of one Motion message, in shape."""

    coordinates: tuple[str, ...]  #: n names
    joints: tuple[str, ...]  #: r names
    start: Array  #: (m,) [s]
    start_low: Array  #: (m,) [s]
    duration: Array  #: (m,) [s]
    turns: NDArray[np.int64]  #: (m, n)
    coefficients: Array  #: (m, n, d + 1) [rad/s^j]
    modes: NDArray[np.uint8]  #: (m, r)


def unpack(message: Any) -> Segments:
    """Return the segments of a Motion message. InputError: its arrays do not fit its counts."""
    m, n, r = int(message.segments), len(message.coordinates), len(message.joints)
    try:
        return Segments(
            coordinates=tuple(message.coordinates),
            joints=tuple(message.joints),
            start=np.asarray(message.start, np.float64).reshape(m),
            start_low=np.asarray(message.start_low, np.float64).reshape(m),
            duration=np.asarray(message.duration, np.float64).reshape(m),
            turns=np.asarray(message.turns, np.int64).reshape(m, n),
            coefficients=np.asarray(message.coefficients, np.float64).reshape(
                m, n, int(message.degree) + 1
            ),
            modes=np.asarray(message.modes, np.uint8).reshape(m, r),
        )
    except ValueError as error:
        raise InputError(f'a Motion message contradicts its own counts: {error}.') from error


def curve_of(segments: Segments) -> PiecewisePolynomial:
    """The polynomials of a message."""
    return PiecewisePolynomial(
        segments.start,
        segments.start_low,
        segments.duration,
        segments.turns,
        segments.coefficients,
    )


def motion_of(message: Any) -> Motion:
    """The motion of a message as the engine has it. InputError: as for `unpack`."""
    segments = unpack(message)
    m = len(segments.start)
    speeds = np.asarray(message.approach_speeds, np.float64)
    laws = np.asarray(message.torque_laws, np.float64)
    rows = np.asarray(message.load_switches, np.uint8)
    each = max(m, 1)  # a message may have no segments
    try:
        approach = speeds.reshape(m, len(speeds) // each)
        torques = laws.reshape(m, len(laws) // (3 * each), 3)
        acting = rows.reshape(m, len(rows) // each)
    except ValueError as error:
        raise InputError(f'a Motion message contradicts its own counts: {error}.') from error
    n = sum(not name.startswith(STATE) for name in segments.coordinates)
    curve, powers = curve_of(segments), segments.coefficients
    if n == len(segments.coordinates):
        return Motion(curve, segments.modes, approach, torques, acting)
    of_links = replace(curve, turns=segments.turns[:, :n], coefficients=powers[:, :n])
    return Motion(of_links, segments.modes, approach, torques, acting, powers[:, n:, :-1])


def row_names(machine: Machine) -> list[str]:
    """Names of the rows of its Motion messages: coordinates, then ``state:NAME`` of states."""
    states = (f'{STATE}{x.label}' for x in machine.plan.states)
    return [*machine.physics.coordinates, *states]


def foreign(message: Any, machine: Machine) -> str:
    """Reason why a Motion message cannot be of a machine's run; empty if it can."""
    joints = tuple(machine.physics.clearances)
    each = max(int(message.segments), 1)
    if list(message.coordinates) != row_names(machine):
        return 'it is of another machine'
    if tuple(message.joints) != joints or len(message.approach_speeds) not in {
        0,
        each * len(joints),
    }:
        return 'it is of a machine with other clearances'
    drives = 3 * each * len(machine.equations.system.powered) if machine.level.dynamic else 0
    if message.segments and machine.level.dynamic and len(message.torque_laws) != drives:
        return 'it is of a machine with other drives'
    return ''


def pack(
    motion: Motion,
    coordinates: Sequence[str],
    joints: Sequence[str],
    known: float,
    run: int = 0,
    after: float = 0.0,
) -> Any:
    """A Motion message of a motion of m segments; the names are those of its columns.

    Parameters
    ----------
    known : [s] up to which all that is settled is published with this message
    run : number of the run
    after : [s] end of the motion before, which stamps a message without segments
    """
    curve = motion.rows
    message = message_class('mechanism_sim/msg/Motion')(
        run=run,
        known_until=known,
        coordinates=list(coordinates),
        segments=len(curve),
        degree=curve.coefficients.shape[2] - 1,
        start=float64_array(curve.start),
        start_low=float64_array(curve.start_low),
        duration=float64_array(curve.duration),
        turns=int64_array(curve.turns.ravel()),
        coefficients=float64_array(curve.coefficients.ravel()),
        joints=list(joints),
        modes=uint8_array(motion.modes.ravel()),
        approach_speeds=float64_array(motion.approach.ravel()),
        torque_laws=float64_array(motion.torques.ravel()),
        load_switches=uint8_array(motion.acting.ravel()),
    )
    message.header.stamp = stamp(float(curve.start[0]) if len(curve) else after)
    return message
