"""Runtime parameters of compiled equations: one table of indices into ``par[]``."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dynamics import Dynamics
from mechanism_sim.planar.frames import STATE
from mechanism_sim.planar.protocols import Gap


@dataclass(frozen=True, eq=False)
class RuntimeParameters:
    """Indices of the runtime parameters, and their initial values (n,)."""

    values: Array  #: initial values of all (n,), SI units
    #: flag of every gap that it is closed; of every gap with friction, flag that it sticks, and
    #: sign of its slip
    closed: list[int]
    sticks: list[int]
    slips: list[int]
    #: speed of initial contact [m/s] of every compliant contact, and flag that it carries force
    #: while closed
    approach: list[int]
    presses: list[int]
    margin: int | None  #: hysteresis [m/s] of force loss of compliant contacts; None without them
    stabilisation: int  #: rate of Baumgarte's method [1/s]
    #: components of a direction for every pin with friction, within about 120 deg of its force
    towards: list[int]
    sides: list[int]  #: sign of every normal force of friction in ideal joints
    switches: list[list[int]]  #: values of the present row of every switch
    #: coefficients of the law of every prescribed and every powered coordinate
    laws: list[list[int]]
    torques: list[list[int]]
    #: time of the base and whole turns that loads depend on, by their names
    outside: dict[str, int]
    fired: int  #: number of the guard that ended a step, counted from 1; the last parameter


def lay_out(dynamics: Dynamics, pins: int) -> RuntimeParameters:
    """Reserve the parameters that change in a run, for `pins` with friction, and find all.

    To be called after all others are reserved: the last parameter must be `fired`.
    """
    p, frames, gaps = dynamics.equations.parameters, dynamics.equations.frames, dynamics.gaps
    names, coefficients = p.names, range(dynamics.degree + 1)

    def reserve(key: str, value: float = 0.0) -> int:
        p.reserve(key, value)
        return names[key]

    sides = [i for name, i in names.items() if '.friction.side.' in name]
    laws = [[reserve(f'drives:{c}.law.{k}') for k in coefficients] for c in dynamics.prescribed]
    towards = [
        reserve(f'pins:{k}.towards.{axis}', float(axis == 'x'))
        for k in range(pins)
        for axis in 'xy'
    ]
    known = (name for name in frames.outside if not name.startswith(STATE))
    outside = {name: reserve(f'now:{name}') for name in known}
    switches = [
        [reserve(f'now:{name}.{k}') for k in range(len(s.symbols))]
        for name, s in frames.switches.items()
    ]
    fired = reserve('fired')

    def of(known: Iterable[Gap], what: str) -> list[int]:
        return [names[f'{gap.name}.{what}'] for gap in known]

    soft, rough = [gap for gap in gaps if gap.law], [gaps[i] for i in dynamics.contacts.frictional]
    return RuntimeParameters(
        np.array(p.values),
        of(gaps, 'closed'), of(rough, 'sticks'), of(rough, 'slips'),
        of(soft, 'approach'), of(soft, 'presses'), names.get('release.margin'),
        names['stabilisation'], towards, sides, switches, laws,
        [[names[f'drives:{c}.torque.{k}'] for k in range(3)] for c in dynamics.powered],
        outside, fired,
    )  # fmt: skip


def symbols(index: Iterable[int]) -> list[hy.expression]:
    """Expressions of the parameters of some indices."""
    return [hy.par[i] for i in index]
