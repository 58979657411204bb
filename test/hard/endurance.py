"""Long runs, repeated runs, interrupted runs, and runs that start a hair apart."""

from __future__ import annotations

import hashlib
import math
import resource
import tempfile
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np

from mechanism_sim.engine.audit import Audit
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.snapshot import Snapshot
from mechanism_sim.scene import Machine
from test.hard.bodies import TURN, thesis
from test.hard.case import Figure, hard_case
from test.hard.joints import JOINTS, loose


def _fingerprint(motion: Motion, since: float = -math.inf) -> str:
    """Of all segments that begin at or after a time [s]."""
    c = motion.curve
    keep = c.start + c.start_low >= since
    digest = hashlib.sha256()
    for x in (c.start, c.start_low, c.duration, c.turns, c.coefficients, motion.modes):
        digest.update(np.ascontiguousarray(x[keep]).tobytes())
    return digest.hexdigest()


@hard_case(
    '10,000 revolutions: memory, closure and penetration must not grow, and no digit of time or '
    'angle may get lost.',
    'The first thousand revolutions beside the last; the crank angle by exact arithmetic.',
)
def ten_thousand_revolutions() -> list[Figure]:
    """Growth of memory, of steps and of errors."""
    machine = thesis()
    run, audit = machine.start(), Audit(machine.physics)
    turns, impacts, steps, memory = 10_000, 0, [], []
    for n in range(1, turns + 1):
        run.advance(n * TURN)
        if n % 10 == 0:
            motion, struck, _ = run.drain()
            impacts += len(struck)
            if n % 50 == 0:  # a fifth of the motion is enough for the record of gaps
                Audit.add(audit, motion, [])
        if n in (1000, 2000, turns):
            steps.append(run.steps)
            memory.append(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    c = motion.curve
    end = Fraction(float(c.start[-1])) + Fraction(float(c.start_low[-1]))
    exact, local = machine.drive.laws[0].about(end)  # type: ignore[union-attr]
    angle = float(c.coefficients[-1, 0, 0]) - local[0]
    return [
        Figure('growth of memory from 1,000 to 10,000', memory[2] - memory[0], 8e6, 'B'),
        Figure('penetration', audit.max_penetration, 1e-12, 'm'),
        Figure('closure error', audit.max_closure_error, 1e-12, 'm'),
        Figure('error of whole turns', int(c.turns[-1, 0]) - exact, 0.0),
        Figure('error of the crank angle', angle, 1e-14, 'rad'),
        Figure(
            'steps per revolution, last 8,000 over first 1,000, less 1',
            (steps[2] - steps[1]) / 8.0 / steps[0] - 1.0,
            0.05,
        ),
        Figure('impacts per revolution', impacts / turns),
    ]


def _machines() -> dict[str, Callable[[], Machine]]:
    return {
        'one loose joint': thesis,
        'elastic': lambda: thesis(e=1.0, start='centred'),
        'friction': lambda: thesis(mu=0.1, joints__coupler_rocker__clearance__pin_radius=0.005),
        'torque': lambda: thesis(drive={'speed': 36.65, 'torque': {'constant': 0.1}}),
        'two loose joints': lambda: loose(JOINTS[:2]),
    }


@hard_case(
    'The same run twice, and after a snapshot: not one bit may differ.',
    'Hashes of every number of the motion, from the pause on.',
)
def to_the_last_bit() -> list[Figure]:
    """Runs that differ, of those repeated and of those paused at odd times and restored."""
    repeated = restored = count = 0
    end = 2.3 * TURN
    for make in _machines().values():
        machine = make()
        whole = machine.start()
        whole.advance(end)
        motion, impacts, _ = whole.drain()
        again = make().start()
        for k in range(1, 24):
            again.advance(k * 0.1 * TURN)
        motion_again, impacts_again, _ = again.drain()
        same = _fingerprint(motion) == _fingerprint(motion_again) and impacts == impacts_again
        repeated += not same
        for pause in (1e-9, 0.0137, 0.1781, 0.2903):
            first = machine.start()
            first.advance(pause)
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / 'snapshot.json'
                machine.snapshot(first).save(file)
                snapshot = Snapshot.load(file)
            second = make().resume(snapshot)
            second.advance(end)
            rest, struck, _ = second.drain()
            since = snapshot.time
            later = [i for i in impacts if i.t > since]
            same = _fingerprint(rest) == _fingerprint(motion, since) and (
                [i for i in struck if i.t > since] == later
            )
            restored += not same
            count += 1
    return [
        Figure('repeated runs that differ', repeated, 0.0),
        Figure('restored runs that differ', restored, 0.0),
        Figure('restored runs', count),
    ]


@hard_case(
    'A start 1e-15 rad off: impacts multiply it, and after a while only statistics mean anything.',
    'A 256-bit computation of the growth: 4e6 in half a revolution for e = 1 '
    '(benchmarks/references/four_bar_centred_e1.json).',
)
def divergence() -> list[Figure]:
    """Growth of a tiny change of the start."""
    machine = thesis(e=1.0, start='centred')
    q = machine.initial_state().q
    ends = []
    for change in (0.0, 1e-15, 1e-12):
        run = thesis(
            e=1.0,
            start='centred',
            initial__position__coupler=q[0],
            initial__position__rocker=q[1] + change,
        ).start()
        run.advance(0.5 * TURN, final=True)
        ends.append(run.drain()[0].curve(np.array([0.5 * TURN]))[0, 1:])
    small, large = (float(np.abs(end - ends[0]).max()) for end in ends[1:])
    return [
        Figure('growth of 1e-12 in half a revolution, decades', math.log10(large / 1e-12)),
        Figure('the same beside the reference, decades', math.log10(large / 1e-12 / 4e6), 1.0),
        Figure('what 1e-15 has become', small, 1e-7, 'rad'),
    ]


@hard_case(
    'Chaotic motion: single impacts depend on the last digit, but their statistics must not '
    'depend on the tolerance.',
    'Means over 1,000 revolutions at 1e-8, 1e-10 and 1e-12, in units of their standard errors by '
    'batches of fifty. At 1e-6 chatter is cut at up to 3 mm/s: its counts must be lower.',
)
def statistics_at_every_tolerance() -> list[Figure]:
    """Impacts faster than 1 mm/s and their impulse per revolution."""
    figures, means, errors = [], [], []
    for exponent in (6, 8, 10, 12):
        run = thesis(solver__rtol=10.0**-exponent).start()
        counts = np.zeros((1020, 2))
        for n in range(1020):
            run.advance((n + 1) * TURN)
            for i in run.drain()[1]:
                if i.approach_speed > 1e-3:
                    counts[min(int(i.t / TURN), 1019)] += (1.0, i.normal_impulse)
        batches = counts[20:].reshape(20, 50, 2).mean(axis=1)
        means.append(batches.mean(axis=0))
        errors.append(batches.std(axis=0, ddof=1) / math.sqrt(20.0))
        figures += [
            Figure(f'impacts a revolution, rtol 1e-{exponent}', means[-1][0]),
            Figure(f'impulse a revolution, rtol 1e-{exponent}', means[-1][1], unit='N s'),
        ]
    fine = np.array(means[1:])
    away = np.abs(fine - fine.mean(axis=0)) / np.array(errors[1:])
    figures.append(Figure('largest deviation in standard errors', float(away.max()), 4.0))
    return figures
