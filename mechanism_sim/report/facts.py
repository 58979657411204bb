"""A run in facts: one description for the table of its page and for notebooks."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

from mechanism_sim.analysis.record import Record
from mechanism_sim.hybrid.events import Mode
from mechanism_sim.recording import realtime_factor
from mechanism_sim.results.solution import Solution


def facts(record: Record) -> Iterator[tuple[str, str]]:
    """Names and texts; errors are those of the finished run, or are read from its motion."""
    machine, piece = record.machine, record.piece
    tolerances = machine.scene.solver
    steps, span = len(piece.motion), record.end - record.start
    yield 'level of mechanics', machine.level.value
    yield 'relative tolerance', f'{tolerances.rtol:g}'
    yield 'absolute tolerance', f'{tolerances.atol:g}'
    yield 'simulated time', f'{span:.9g} s'
    if record.has_turns:
        yield f'turns of the {machine.main}', f'{abs(record.rate) * span:.6g}'
    yield 'steps', f'{steps:,}'
    yield 'mean step', f'{span / steps:.4g} s'
    yield 'shortest step', f'{piece.motion.curve.duration.min():.4g} s'
    yield 'impacts', f'{len(piece.impacts):,}'
    if piece.impacts:
        yield 'normal impulse', f'{math.fsum(i.normal_impulse for i in piece.impacts):.6g} N s'
    entered = Counter(c.mode for c in piece.modes if c.previous != Mode.UNKNOWN)
    for mode, count in sorted(entered.items()):
        yield f'changes to {mode.name.lower().replace("_", " ")}', f'{count:,}'
    judged = piece if isinstance(piece, Solution) else record.audited
    if machine.physics.clearances:
        yield 'largest penetration of an open gap', f'{judged.max_penetration:.3g} m'
    yield 'largest error of a closure', f'{judged.max_closure_error:.3g} m'
    if judged.energy and math.isfinite(judged.energy.residual):
        e = judged.energy
        yield 'work of drives', f'{e.drive_work:.6g} J'
        yield 'dissipated', f'{e.dissipated:.6g} J'
        yield 'energy missing at the end', f'{e.residual:.3g} J'
        yield 'energy exchanged', f'{e.exchanged:.3g} J'
        yield 'error of works, estimated', f'{e.error:.2g} J'
    if isinstance(piece, Solution):
        stats = piece.stats
        yield 'compilation', f'{stats.compile_time:.3g} s'
        yield 'CPU time', f'{stats.cpu_time:.3g} s'
        if stats.wall_time:
            yield 'real-time factor', f'{realtime_factor(span, stats.wall_time):.3g}'
    if factor := realtime_factor(span, record.wall_time):
        yield 'recorded in', f'{record.wall_time:.3g} s'
        yield 'real-time factor', f'{factor:.3g}'
    yield 'digest', record.digest()
