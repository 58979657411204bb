"""The modes of a machine in steady rotation by a torque, about its periodic motion.

Over a turn of period T small changes of the motion grow by the Floquet multipliers m, eigenvalues
of the linear map from one turn to the next. ``ln(m)/T`` are the roots: their imaginary parts are
known but for multiples of ``2 pi/T``, of which the least are taken. One multiplier is 1, that of
going ahead on the same motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.derivatives.flow import Flows
from mechanism_sim.derivatives.numeric_keys import OFFSETS, WEIGHTS
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.snapshot import State
from mechanism_sim.errors import InputError
from mechanism_sim.results.run import Piece, Runner
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from mechanism_sim.scene.drives import read_drives
from mechanism_sim.scene.plan import restart
from mechanism_sim.studies.modes import NormalMode, Roots, Station, about, derivatives
from mechanism_sim.studies.periodic import flow_at_end, without_turns

_TURNS = 400  # largest number for settling
_NEAR = 1e-2  # change from turn to turn from which Newton's method takes over
_SETTLED = 1e-10
_SHORTEST = 1e-3  # least period, over the initial turn
_STEP = 2e-4  # step of third-order differences, over the size of coordinates
_FADED = 1e-7  # multipliers below it are rounding


class FloquetMap:
    """The map of a machine that a torque turns, from one state to the one a time later.

    States are those of k independent coordinates: their values and rates (2 k,), over `scale`.
    """

    def __init__(self, machine: Machine, state: State, speed: float) -> None:
        run = machine.start()
        assert isinstance(run, EventLoop)  # noqa: S101 - it has equations of motion
        self._machine, self._run, self._state = machine, run, state
        system, mechanism = machine.equations.system, machine.mechanism
        known = derivatives(machine)
        at = known.point(self._whole(machine, state), np.zeros(len(system.coordinates)))
        _, independent = known.basis(known(at).J)
        self.names = [system.coordinates[i] for i in independent]
        self._own = [system.free.index(c) for c in self.names]
        self._held = [machine.plan.held[c][0] for c in machine.plan.prescribed]
        self._kinematics = machine.plan.kinematics([*machine.plan.prescribed, *self.names])
        self._free = [system.coordinates.index(c) for c in system.free]
        self._guess = at.q
        size = [mechanism.size if c in mechanism.displacements else 1.0 for c in self.names]
        self.scale = np.concatenate([size, abs(speed) * np.array(size)])
        self.angles = np.array([c not in mechanism.displacements for c in self.names])

    @staticmethod
    def _whole(machine: Machine, state: State) -> Array:
        """All coordinates (n,)."""
        known = dict(zip(machine.equations.system.free, state.q, strict=True))
        known |= {c: machine.plan.held[c][0] for c in machine.plan.prescribed}
        return np.array([known[c] for c in machine.equations.system.coordinates])

    @property
    def start(self) -> Array:
        """The state to begin with (2 k,)."""
        q, v = np.array(self._state.q)[self._own], np.array(self._state.v)[self._own]
        return np.asarray(np.concatenate([q, v]) / self.scale)

    def place(self, x: Array) -> dict[str, float]:
        """All coordinates in a state."""
        q, _ = self._motion(x)
        return dict(zip(self._kinematics.coordinates, q.tolist(), strict=True))

    def _motion(self, x: Array) -> tuple[Array, Array]:
        """All coordinates and rates (n,) in a state."""
        k = len(self.names)
        z, rates = np.split(x * self.scale, [k])
        guess = self._guess.copy()
        guess[[self._kinematics.coordinates.index(c) for c in self.names]] = z
        q, _ = self._kinematics.positions(guess[:, None])
        still = np.zeros(len(self._held))
        v = self._kinematics.rates(q, np.concatenate([still, rates])[:, None])
        return np.asarray(q[:, 0]), np.asarray(v[:, 0])

    def change(self, x: Array, period: float, audited: bool = False) -> tuple[Array, list[Piece]]:
        """Change of a state (2 k,) in a time [s], whole turns left out, and the motion."""
        q, v = self._motion(x)
        begun = replace(
            self._state, q=tuple(q[self._free].tolist()), v=tuple(v[self._free].tolist())
        )
        restart(self._machine.plan, self._run, begun)
        pieces = list(Runner(self._machine, self._run, audited=audited).to(period))
        end = self._run.state
        moved = np.array(end.q)[self._own] + 2.0 * np.pi * np.array(end.turns)[self._own]
        moved = without_turns(moved - np.array(begun.q)[self._own], 2.0 * np.pi * self.angles)
        faster = np.array(end.v)[self._own] - np.array(begun.v)[self._own]
        return np.asarray(np.concatenate([moved, faster]) / self.scale), pieces

    def jacobian(self, x: Array, pieces: Sequence[Piece]) -> tuple[Array, Array]:
        """Derivatives (2 k, 2 k) of the later state, and by the time in which it is reached.

        Parameters
        ----------
        pieces : the motion from x on
        """
        motion = Motion.joined([piece.motion for piece in pieces])
        J, limits = self._flows.transition(motion, [])
        if ends := [limit for limit in limits if limit.ends]:
            raise InputError(f'{self._machine.name}: {ends[0]}')
        f, k, n = len(self._free), len(self._own), len(self._kinematics.coordinates)
        whole = [*self._free, *(n + i for i in self._free)]  # free coordinates, then their rates
        begun = np.zeros((len(J), 2 * k))
        for j, direction in enumerate(np.eye(2 * k)):
            for weight, offset in zip(WEIGHTS, OFFSETS, strict=True):
                q, v = self._motion(x + offset * _STEP * direction)
                begun[: 2 * f, j] += weight / _STEP * np.concatenate([q, v])[whole]
        rows = [*self._own, *(f + i for i in self._own)]
        flow = flow_at_end(motion, self._free)[rows] / self.scale
        return np.asarray((J @ begun)[rows] / self.scale[:, None]), np.asarray(flow)

    @cached_property
    def _flows(self) -> Flows:
        return Flows.by_state(self._machine, 0.0)


def applies(machine: Machine) -> bool:
    """True if a torque turns the main drive of a machine whose joints are ideal."""
    plan = machine.plan
    return (
        plan.main in read_drives(plan)
        and plan.main in plan.powered
        and plan.main not in plan.ideal.displacements
        and not machine.has_contacts
        and plan.weighed
        and not plan.frictions(plan.ideal)
    )


def station(machine: Machine, turning: bool = False) -> Station:
    """The modes of a machine about its own periodic motion.

    That is its static equilibrium, a steady rotation where all turns together, or else the motion
    that it repeats in each turn of its main drive.

    Parameters
    ----------
    turning : leave out the equilibrium
    """
    if turning and not applies(machine):
        raise InputError(
            f"{machine.name}: --turning needs a 'drive' whose torque or motor turns an angle, and "
            'ideal joints without friction'
        )
    try:
        return about(machine, turning)
    except InputError:
        if not applies(machine):
            raise
    return repeated(machine)


def repeated(machine: Machine) -> Station:
    """The modes about the motion that a machine repeats in each turn of its main drive."""
    moving = any(machine.plan.held[c][1] for c in machine.plan.prescribed)
    if 'time' in machine.equations.system.outside or moving:
        raise InputError(
            f'{machine.name}: loads or other drives depend on time, so that no turn is like the '
            'other: there are no modes; look at its motion by solve'
        )
    state, period, speed = _settled(machine)
    turns = FloquetMap(machine, state, speed)
    x, period, J = _repeated(machine, turns, period)
    values, vectors = np.linalg.eig(J)
    faded = np.abs(values) < _FADED
    kept = ~faded & (np.arange(len(values)) != int(np.abs(values - 1.0).argmin()))
    found = []
    for value, vector in zip(values[kept], vectors.T[kept], strict=True):
        if value.imag < 0.0:
            continue
        root = np.log(complex(value)) / period
        shape = vector[: len(turns.names)]
        amplitudes = shape / shape[np.abs(shape).argmax()] * turns.scale[: len(shape)]
        amplitudes /= turns.scale[np.abs(shape).argmax()]
        found.append(
            NormalMode(
                Roots.of(complex(root)), dict(zip(turns.names, amplitudes.tolist(), strict=True))
            )
        )
    found.sort(key=lambda mode: mode.roots.size)
    pace = math.copysign(2.0 * np.pi / period, speed)
    return Station(turns.place(x), pace, found, int(faded.sum()))


def _settled(machine: Machine) -> tuple[State, float, float]:
    """State near the periodic motion, duration of a turn [s], and speed."""
    free, main = machine.equations.system.free, machine.plan.main
    duration, turned = machine.scene.duration or 1.0, 0.0
    while turned < _TURNS:
        solution = simulate(machine, duration=duration)
        ends = solution.sample(np.array([0.0, duration]))
        way = ends[f'position.{main}'][1] - ends[f'position.{main}'][0]
        turned = abs(way) / (2.0 * np.pi)
        pace = abs(ends[f'velocity.{main}'][1])
        if turned < 2.0 and duration > (machine.scene.duration or 1.0):
            break
        back = 2.0 * np.pi / pace if pace else duration
        if turned >= 2.0 and 3.0 * back < duration:
            t = np.linspace(duration - 3.0 * back, duration, 2000)
            seen = solution.sample(t)
            angle = np.abs(seen[f'position.{main}'] - seen[f'position.{main}'][-1])
            marks = np.interp([2.0 * np.pi, 4.0 * np.pi], angle[::-1], t[::-1])
            at = solution.sample(np.array([duration, *marks]))
            v = np.array([at[f'velocity.{c}'] for c in free])
            if np.abs(v[:, 0] - v[:, 1]).max() <= _NEAR * np.abs(v).max():
                q = [at[f'position.{c}'][0] for c in free]
                state = replace(
                    machine.initial_state(), q=tuple(np.array(q).tolist()),
                    v=tuple(v[:, 0].tolist()), turns=(0,) * len(free),
                )  # fmt: skip
                period = float(duration - marks[0])
                return state, period, float(np.sign(way)) * 2.0 * np.pi / period
        duration *= 2.0
    raise InputError(
        f'{machine.name}: its torque does not keep it turning, or it has not settled to '
        f'repeating turns after {turned:.3g}: look at its motion by solve, or start nearer to it'
    )


def _repeated(machine: Machine, turns: FloquetMap, period: float) -> tuple[Array, float, Array]:
    """State and period of the periodic motion, by Newton's method.

    Returns
    -------
    Both, and the map (2 k, 2 k) of small changes in a turn
    """
    x, first = turns.start, period
    for _ in range(20):
        off, pieces = turns.change(x, period)
        J, flow = turns.jacobian(x, pieces)
        if np.abs(off).max() <= _SETTLED:
            turns.change(x, period, audited=True)
            return x, period, J
        # no step along the motion itself
        rows = np.vstack([np.column_stack([J - np.eye(len(J)), flow]), [*flow, 0.0]])
        step = np.linalg.lstsq(rows, -np.concatenate([off, [0.0]]))[0]
        x = x + step[:-1]
        period += step[-1]
        # unlimited acceleration resembles a period as turns become infinitely short
        if not (np.isfinite(x).all() and period > _SHORTEST * first):
            break
    raise InputError(
        f'{machine.name}: no motion was found that repeats itself with every turn of '
        f'{machine.plan.main}: look at its motion by solve'
    )
