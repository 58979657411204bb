"""Guards: functions that fall through zero at events, and what each of them watches.

Every gap has one, ``(1 - s) gap + s N`` with the flag s that it is closed; contacts with friction
have two more, and all that steps (switches, friction in ideal joints) has its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import heyoka as hy

from mechanism_sim.engine.dynamics import Dynamics, Solved
from mechanism_sim.engine.run_expressions import RunExpressions
from mechanism_sim.engine.runtime_parameters import RuntimeParameters, symbols
from mechanism_sim.numerics.symbolic import dense, mul
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.switches import Switch
from mechanism_sim.tolerances import TOLERANCES

_GUARDS = TOLERANCES.guards
_IMPACTS = TOLERANCES.impacts
_SWITCHES = TOLERANCES.switches


class Guard(NamedTuple):
    """Subject of a guard: the normal direction of a gap, its friction, or a switch.

    For friction in ideal joints it is the sign of a normal force, or the direction of a pin force:
    after a large rotation that force may have vanished, where its magnitude has no Taylor series.
    A guard with none of these indices is that of the margin to a jam.
    """

    gap: int
    #: 0: impact or separation; +1: end of sliding, or onset of backward slip from sticking;
    #: -1: sliding that jams, or onset of forward slip from sticking
    friction: int
    switch: int | None = None
    side: int | None = None
    pin: int | None = None


def force_scale(mechanism: Mechanism) -> float:
    """Scale of forces in guards [m/N], larger for light links: in steps, to compile few scales."""
    force = mechanism.total_mass * (math.hypot(*mechanism.gravity) + mechanism.size)
    if not 0.0 < force < _GUARDS.light:
        return _GUARDS.force_scale
    return _GUARDS.force_scale * 1024.0 ** math.ceil(math.log(_GUARDS.light / force, 1024.0))


def guards_of(dynamics: Dynamics, index: RuntimeParameters) -> list[Guard]:
    """Guards of gaps, their friction, sides, pins and jams of ideal joints, switches."""
    guards = [Guard(i, 0) for i in range(len(dynamics.gaps))]
    guards += [Guard(i, sign) for i in dynamics.contacts.frictional for sign in (1, -1)]
    guards += [Guard(-1, 0, side=k) for k in range(len(index.sides))]
    guards += [Guard(-1, 0, pin=k) for k in range(len(index.towards) // 2)]
    guards += [Guard(-1, 0)] if dynamics.frictional_joints else []
    return guards + [Guard(-1, 0, k) for k in range(len(index.switches))]


def guard_functions(
    run: RunExpressions, guards: Sequence[Guard], solved: Solved
) -> list[hy.expression]:
    """Functions that fall through zero at events, in the order of `guards`, under `solved`."""
    result = []
    for guard in guards:
        if guard.switch is not None:
            known = run.switches[guard.switch]
            function = known.guard
            if isinstance(known, Switch) and known.holds is not None:
                function += known.holds * (known.held_guard - 1.0)
            result.append(function + _SWITCHES.margin)
        elif guard.gap < 0:
            result.append(_of_joint_friction(run, guard))
        elif guard.friction:
            result.append(_of_friction(run.dynamics, guard, solved))
        else:
            # positive while an open gap is open, and while a closed one carries compressive force;
            # one that has a rate only, see `Gap.value`, is open while that is positive
            d, gap = run.dynamics, guard.gap
            s, jet = d.flags.closed[gap], d.contacts.normal[gap]
            value = dense(jet.rate if jet.value is None else jet.value)
            scale = force_scale(d.equations.mechanism)
            force = d.held(gap) if d.contacts.compliant else scale * dense(solved.N[gap])
            result.append(value + s * (force - value) + _GUARDS.tiny)
    # what friction in ideal joints is by itself has been solved for already
    own = [k for k, g in enumerate(guards) if g.gap >= 0 or g.switch is not None]
    for k, function in zip(own, run.acted([result[k] for k in own]), strict=True):
        result[k] = function
    return result


def _of_friction(d: Dynamics, guard: Guard, solved: Solved) -> hy.expression:
    """Positive within the cone of friction while sticking; while sliding until it ends or jams."""
    gap, sign = guard.gap, d.flags.slips[guard.gap]
    z = d.flags.sticks[gap] if solved.sticks else None
    idle = 1.0 - sign * sign if z is None else 1.0 - z - sign * sign
    if guard.friction > 0:
        idle = idle + sign * (_GUARDS.slip_scale * dense(d.contacts.tangent[gap].rate))
    elif d.contacts.compliant:  # its normal force is known: nothing jams
        idle = idle + sign * sign
    else:
        margin = dense(solved.jam_margin)
        least = (
            _GUARDS.jammed_rough if d.contacts.friction[gap] == _IMPACTS.rough else _GUARDS.jammed
        )
        idle = idle + sign * sign * (_GUARDS.jam_scale * (margin * margin - least * least))
    if z is not None:
        push = mul(solved.N[gap], d.compressed(gap)[2]) if d.contacts.compliant else solved.N[gap]
        cone = (_GUARDS.hold * d.contacts.mu[gap]) * dense(push) - guard.friction * solved.T[gap]
        idle = z * (force_scale(d.equations.mechanism) * cone) + idle
    return idle + _GUARDS.tiny


def _of_joint_friction(run: RunExpressions, guard: Guard) -> hy.expression:
    """Positive until a normal force changes sign, a pin force rotates far, or a joint jams."""
    forces, index = run.set_valued, run.parameters
    found = forces.acting(run.dynamics.stabilised)
    scale = force_scale(run.dynamics.equations.mechanism)
    if guard.side is not None:
        side = hy.par[index.sides[guard.side]]
        return scale * (side * found.pressed[guard.side] + forces.least)
    if guard.pin is not None:
        x, y = found.carried[guard.pin]
        ux, uy = symbols(index.towards[2 * guard.pin : 2 * guard.pin + 2])
        size = hy.sqrt(x * x + y * y + forces.least * forces.least)
        return scale * (x * ux + y * uy + 0.5 * size + forces.least)
    return _GUARDS.jam_scale * (dense(found.jam_margin) - _GUARDS.joint_jammed) + _GUARDS.tiny
