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
    """Indices of the runtime parameters, and the values (n,) with which a run begins.

    Attributes
    ----------
    values : of all, SI units
    closed, sticks, slips : of every gap the flag that it is closed; of those with friction, that
        it sticks, and the sign of its slip
    approach, presses : of every compliant contact, the speed of its touch [m/s] and whether it
        carries force while closed
    margin : [m/s] by which compliant contacts are late to let go; None without them
    stabilisation : the rate of Baumgarte's method [1/s]
    towards : of every pin that rubs, components of where its force points: 60 deg or more from its
        reverse
    sides : of every side of friction in ideal joints, its sign
    switches : of every switch, its present row
    laws, torques : of every prescribed and every powered coordinate the coefficients of its law
    outside : of the time of the base and of whole turns that loads ask for, by their names
    fired : the last, which guard ended a step, counted from 1
    """

    values: Array
    closed: list[int]
    sticks: list[int]
    slips: list[int]
    approach: list[int]
    presses: list[int]
    margin: int | None
    stabilisation: int
    towards: list[int]
    sides: list[int]
    switches: list[list[int]]
    laws: list[list[int]]
    torques: list[list[int]]
    outside: dict[str, int]
    fired: int


def lay_out(dynamics: Dynamics, pins: int) -> RuntimeParameters:
    """Reserve the parameters that change in a run, for `pins` with friction, and find all.

    All that is looked at in a run must have its own before: the last says which guard fired.
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
    """The parameters of some indices, as they stand in expressions."""
    return [hy.par[i] for i in index]
