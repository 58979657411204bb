"""First look at a step with steep formulas, in machine code: at its sixteenths.

`enclosure.reach_of` halves the parts of a step until all formulas are known in them. Mostly all
are known in its eighths, and the defect at their middles and ends tells how far it reaches: some
thousand operations, for which NumPy takes a third of a millisecond. Where it is not so, there is
no answer. Answers are places, those that `StepCheck` finds: of short steps the defect is rounding,
so both have it by the same operations.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.system import System
from mechanism_sim.numerics.complementarity import Indices
from mechanism_sim.numerics.enclosure import LITTLE
from mechanism_sim.numerics.kernel_code import call_code
from mechanism_sim.numerics.kernels import entry, foreign_code, kernel
from mechanism_sim.planar.steep_loads import SteepLoads, interpolant
from mechanism_sim.tolerances import TOLERANCES

_ENCLOSURE = TOLERANCES.enclosure
_GUARDS = TOLERANCES.guards
_MECHANISM = TOLERANCES.mechanism
_ROUNDING = TOLERANCES.rounding
_STEPS = TOLERANCES.steps

_PLACES = 16
_SOUND, _FAULTLESS, _FAULT = range(3)


class FirstLook(NamedTuple):
    """Functions of a check of steps, and workspace for them.

    The series, of v variables, and the argument are those of `step_check.StepMotion`.
    """

    addresses: Indices  #: (4,) machine code of functions, accelerations, guards, loads
    sizes: Indices  #: number of states, free coordinates, guards, functions, loads, their guards
    limits: Array  #: (r,) largest changes of rates by a defect
    nodes: Array  #: (m,) positions from 0 to 1 at which figures are taken
    powers: Array  #: (n, 16) powers of the places from the first on
    sloping: Array  #: (n, 16) their derivatives
    between: Array  #: (16 m, 17) interpolants from nodes to places, up to each place in turn
    series: Array  #: (v, n) Taylor series of the variables, with the step as unit of time
    given: Array  #: argument of the functions
    grown: Array  #: (rows, n) series of states and guards, with the step as unit of time
    state: Array  #: states, runtime parameters, time
    found: Array  #: results of machine code
    values: Array  #: (k, 17) functions at the places
    variables: Array  #: argument of the loads
    loads: Array  #: (l, 17) loads at the places
    known: Array  #: (l, m) loads at the nodes
    local: Array  #: (n,) overwritten


@kernel
def value_at(series: Array, x: float) -> float:
    """Value of a polynomial, by Horner."""
    found, n = 0.0, len(series)
    for k in range(n - 1, -1, -1):
        found = found * x + series[k]
    return found


@kernel
def sum_at(series: Array, powers: Array, place: int) -> float:
    """Value of a polynomial by a column of powers, term by term in their order."""
    found = 0.0
    for k in range(len(series)):
        found += series[k] * powers[k, place]
    return found


@kernel
def reach_about(series: Array, middle: float, radius: float, local: Array) -> float:
    """Radius of the range of a polynomial about `middle`; `local` (n,) is overwritten."""
    n, power, found = len(series), 1.0, 0.0
    local[:] = series
    for i in range(n - 1):
        for k in range(n - 2, i - 1, -1):
            local[k] += middle * local[k + 1]
    for k in range(1, n):
        power *= radius
        found += abs(local[k]) * power
    return found


@kernel
def defect_at(parameters: Array, g: FirstLook, tau: float, h: float, place: int) -> int:
    """`_SOUND`, `_FAULTLESS` or `_FAULT`, by the equations of motion at a place."""
    width, first, level = g.sizes[0], g.sizes[1], _SOUND
    for i in range(width):
        g.state[i] = sum_at(g.grown[i], g.powers, place - 1)
    g.state[len(g.state) - 1] = tau + h * (float(place) / float(_PLACES))
    call_code(g.addresses[1], g.found, g.state, parameters, g.found)
    for i in range(len(g.limits)):
        wanted = h * g.found[i]
        off = abs(sum_at(g.grown[first + i], g.sloping, place - 1) - wanted)
        off /= g.limits[i] + _ROUNDING.acceleration * abs(wanted)
        if not off <= _ENCLOSURE.sound:
            level = max(level, _FAULTLESS)
        if not off <= 1.0:
            level = _FAULT
    if g.sizes[2] > 0:
        call_code(g.addresses[2], g.found, g.state, parameters, g.found)
        for i in range(g.sizes[2]):
            guard, scale = g.found[i], h * _GUARDS.watch_scale
            if guard < -_STEPS.fallen:
                foretold = sum_at(g.grown[width + 1 + i], g.sloping, place - 1) / scale
                if guard < foretold - _STEPS.fallen:
                    level = _FAULT
    return level


@kernel
def enclose(parameters: Array, g: FirstLook, middle: float, radius: float) -> None:
    """Enclose the functions about a place: their middles, radii, weights in `g.found`."""
    n = len(g.series)
    for k in range(n):
        g.given[k] = value_at(g.series[k], middle)
        g.given[n + k] = reach_about(g.series[k], middle, radius, g.local) if radius > 0.0 else 0.0
    call_code(g.addresses[0], g.found, g.given, parameters, g.found)


@kernel
def are_enclosed(parameters: Array, g: FirstLook, h: float, last: int) -> bool:
    """True if no function goes beyond its samples in the parts up to a place, see `reach_of`.

    Of what is no number no halving tells more.
    """
    count, parts = g.sizes[3], _PLACES // 2
    for i in range(2 * parts + 1):
        enclose(parameters, g, float(i) / float(2 * parts), 0.0)
        for k in range(count):
            g.values[k, i] = g.found[k]
    for i in range((last + 1) // 2):
        enclose(parameters, g, (float(i) + 0.5) / float(parts), 0.5 / float(parts))
        for k in range(count):
            a, b, d = g.values[k, 2 * i], g.values[k, 2 * i + 1], g.values[k, 2 * i + 2]
            if not abs(a) + abs(b) + abs(d) < math.inf:
                continue
            lowest, highest = b, b
            for x in g.values[k]:
                if abs(x) < math.inf:
                    lowest, highest = min(lowest, x), max(highest, x)
            size, span = max(abs(lowest), abs(highest)), highest - lowest
            least, most = min(a, b, d), max(a, b, d)
            middle, radius = g.found[k], g.found[count + k]
            weight = g.found[2 * count + k] * (h / float(parts))
            steps = most - least if most - least > _ENCLOSURE.in_part * span else 0.0
            bend, few = abs(b - 0.5 * (a + d)), _ENCLOSURE.of_range * span
            few += _ENCLOSURE.of_size * size
            for off in (middle + radius - most, least - middle + radius, bend, steps):
                if not (off <= few or off * weight <= 1.0):
                    return False
    return True


@kernel
def add_loads(parameters: Array, g: FirstLook, place: float, loads: Array, at: int) -> bool:
    """Enter the loads at a place from 0 to 1 in a column; False if one is no number."""
    n, finite = len(g.series), True
    for k in range(n):
        g.variables[k] = value_at(g.series[k], place)
    call_code(g.addresses[3], g.found, g.variables, parameters, g.found)
    for k in range(g.sizes[4]):
        loads[k, at] = g.found[k]
        finite = finite and abs(g.found[k]) < math.inf
    return finite


@kernel
def are_resolved(parameters: Array, g: FirstLook, h: float, last: int) -> bool:
    """True if the nodes up to a place resolve the loads, which are known at the places."""
    m, count = len(g.nodes), g.sizes[4]
    for j in range(m):
        add_loads(parameters, g, float(last) / float(_PLACES) * g.nodes[j], g.known, j)
    first = len(g.given) - 1 - g.sizes[5] - count
    for k in range(count):
        size, most = 0.0, 0.0
        for x in g.known[k]:
            size = max(size, abs(x))
        for i in range(last + 1):
            off = g.loads[k, i]
            size = max(size, abs(off))
            for j in range(m):
                off -= g.known[k, j] * g.between[(last - 1) * m + j, i]
            if not abs(off) < math.inf:
                return False
            most = max(most, abs(off))
        if not most <= _MECHANISM.load * size + g.given[first + k] / h:
            return False
    return True


@kernel
def resolved(parameters: Array, g: FirstLook, h: float, last: int) -> int:
    """Number of the place up to which nodes resolve the loads, see `ResolvedLoads.longest`.

    0 if it is not one of them.
    """
    n = len(g.series)
    g.variables[n:] = g.given[2 * n : n + len(g.variables)]
    for i in range(last + 1):
        if not add_loads(parameters, g, float(i) / float(_PLACES), g.loads, i):
            return 0
    low, high, tried = 0, last + 1, last
    for _ in range(_PLACES):
        if high - low <= 1:
            break
        if are_resolved(parameters, g, h, tried):
            low = tried
        else:
            high = tried
        tried = (low + high) // 2
    return low


@kernel
def faulty(jets: Array, parameters: Array, g: FirstLook, now: Array, reach: Array) -> int:
    """Number of the place of the first fault, 0 without any; of the last sound one in `reach`."""
    tau, h, power, width = now[1], now[2], 1.0, g.sizes[0]
    for k in range(jets.shape[1]):
        for i in range(len(g.grown)):
            g.grown[i, k] = jets[i, k] * power
        power *= h
    g.state[width : width + len(parameters)] = parameters
    every = 4 if now[3] == LITTLE else 1
    reach[0] = 0.0
    for k in range(_PLACES // every):
        place = (k + 1) * every
        level = defect_at(parameters, g, tau, h, place)
        if level == _FAULT:
            return place
        if level == _SOUND:
            reach[0] = float(place)
    return 0


@entry
def look_first(jets: Array, parameters: Array, g: FirstLook, now: Array, reach: Array) -> int:
    """Reach of a step: 0 if it is whole, 1 if it is that in `reach`; -1 without an answer.

    Parameters
    ----------
    now : time at local zero [s], local start and length of the step [s], level of doubts
    reach : (2,) overwritten, see `enclosure.Reach`
    """
    h, fault = now[2], faulty(jets, parameters, g, now, reach)
    known = int(reach[0]) if fault > 0 else _PLACES
    reach[0], reach[1] = reach[0] / float(_PLACES), float(fault) / float(_PLACES)
    if now[3] != LITTLE:
        last = fault if fault > 0 else _PLACES
        if not are_enclosed(parameters, g, h, last):
            return -1
        share = resolved(parameters, g, h, last)
        if share == 0:
            return -1
        if share < known:
            reach[0] = reach[1] = float(share) / float(_PLACES)
            return 1
    return 1 if fault > 0 else 0


def powers_at(places: Array, count: int) -> tuple[Array, Array]:
    """Powers (count, N) of places (N,), and their derivatives."""
    powers = np.ones((count, len(places)))
    powers[1:] = places
    np.multiply.accumulate(powers, out=powers)
    return powers, np.arange(count)[:, None] * powers / places


class Made(NamedTuple):
    """Arrays of first looks, and what keeps the machine code in memory."""

    look: FirstLook
    codes: list[object]


def first_look(
    system: System, steep: SteepLoads, nodes: Array, limits: Array, series: Array, given: Array
) -> Made | None:
    """Functions and workspace of first looks; None if machine code is not available.

    Parameters
    ----------
    nodes, limits, series, given : see `FirstLook`
    """
    functions, enclosure = system.functions, steep.enclosure
    guards = len(system.guards)
    used: list[hy.cfunc_dbl] = [enclosure.enclosed, functions.accelerations]
    used += [functions.watch if guards else functions.accelerations, steep.compiled_loads]
    codes = [foreign_code(f.llvm_states[0].object_code, 'cfunc') for f in used]
    if None in codes:
        return None
    order, m, places = series.shape[1], len(nodes), np.arange(1.0 + _PLACES)
    between = np.zeros((_PLACES, m, 1 + _PLACES))
    for k in range(_PLACES):
        between[k, :, : k + 2] = interpolant(m, (places[: k + 2] / (k + 1)).tobytes())
    sizes = system.width, len(system.free), guards, enclosure.count, len(steep.loads)
    look = FirstLook(
        np.array([code.addresses[0] for code in codes if code]),
        np.array([*sizes, enclosure.guards]), limits, nodes,
        *powers_at(places[1:] / _PLACES, order), between.reshape(_PLACES * m, -1), series, given,
        np.zeros((system.width + 1 + guards, order)),
        np.zeros(system.width + len(system.parameters.values) + 1),
        np.zeros(max(f.nouts for f in used)),
        np.zeros((enclosure.count, 1 + _PLACES)), np.zeros(len(steep.variables)),
        np.zeros((len(steep.loads), 1 + _PLACES)), np.zeros((len(steep.loads), m)),
        np.zeros(order),
    )  # fmt: skip
    return Made(look, [*codes])
