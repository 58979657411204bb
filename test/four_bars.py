"""The four-bars of the tests, their references, and what the tests ask of them again and again."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np

import benchmarks
import mechanism_sim as ms
from mechanism_sim.engine.audit import Audit
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.observer import Observer
from mechanism_sim.engine.physics import DynamicPhysics
from mechanism_sim.engine.system import System
from mechanism_sim.joints.revolute.bearing import BearingClearance
from mechanism_sim.planar.drive import DriveLaw

SPEED = 36.6519  # [rad/s]
TURN = 2.0 * np.pi / SPEED  # [s]
LINKS = ('crank', 'coupler', 'rocker')
RESTITUTION = 'joints.coupler_rocker.clearance.restitution'
RADIAL = 'joints.coupler_rocker.clearance.radial'


@cache
def reference(name):
    """A reference run, its columns of decimal strings as arrays of floats."""
    folders = Path(benchmarks.__file__).parent, Path(__file__).parent
    path = next(p for f in folders if (p := f / 'references' / f'{name}.json').exists())
    return _numbers(json.loads(path.read_text(encoding='utf-8')))


def _numbers(x):
    if isinstance(x, dict):
        return {k: v if k in ('provenance', 'printed') else _numbers(v) for k, v in x.items()}
    if isinstance(x, list) and all(isinstance(i, str) for i in x):
        try:
            return np.array(x, dtype=float)
        except ValueError:
            return x
    try:
        return float(x) if isinstance(x, str) else x
    except ValueError:
        return x


def loose(e=0.5, start='centred', rtol=1e-12, **more):
    """The loose four-bar of the thesis; further overrides with `__` for dots."""
    more = {key.replace('__', '.'): value for key, value in more.items()}
    overrides = {RESTITUTION: e, 'start': start, 'solver.rtol': rtol} | more
    return ms.load_scene('four_bar_clearance', overrides)


def with_pin_at(machine, Q, turning=(0.0, 0.0)):
    """The machine with its pin at Q (2,) [m] from the bushing centre, in flight.

    `turning` is added to the nominal rates of coupler and rocker [rad/s].
    """
    centred = machine.scene.model_copy(update={'start': 'centred'})
    state = type(machine)(machine.name, centred).initial_state()
    th2 = machine.drive.start[0]
    l = machine.nominal.linkage  # noqa: E741 - the lengths
    x, y = l.ground - l.crank * np.cos(th2) + Q[0], -l.crank * np.sin(th2) + Q[1]
    th3, th4 = (float(angle) for angle in l.close(np.array(x), np.array(y)))
    initial = {
        'position': {'coupler': th3, 'rocker': th4},
        'velocity': {
            name: v + dv
            for name, v, dv in zip(('coupler', 'rocker'), state.v, turning, strict=True)
        },
    }
    scene = type(centred).model_validate(centred.model_dump() | {'initial': initial})
    return type(machine)(machine.name, scene)


def event_loop(machine, laws=None, degree=None):
    """A run of a loose machine whose laws may have any degree, and its physics."""
    laws = laws or [machine.drive.law]
    clearance = machine.plan.clearances['coupler_rocker']
    gap = BearingClearance(
        'coupler_rocker',
        machine.mechanism,
        clearance.radial,
        restitution=clearance.restitution,
    )
    system = System(machine.mechanism, [gap], ['crank'], degree or laws[0].degree)
    run = EventLoop(
        system, laws, machine.initial_state(), machine.scene.solver.rtol, 0.0, TURN / 8.0
    )
    return run, DynamicPhysics(Observer(system))


def audited(physics, motion, impacts):
    """The energy balance of a motion."""
    audit = Audit(physics)
    audit.add(motion, impacts)
    return audit


def constant_speed(angle, speed, time=0.0):
    """The law of a crank at constant speed through `angle` at `time`."""
    return DriveLaw('crank', (angle, speed), time, time)


def as_bytes(motion):
    """All numbers of a motion."""
    c = motion.curve
    arrays = (c.start, c.start_low, c.duration, c.turns, c.coefficients, motion.modes)
    return [x.tobytes() for x in arrays]
