"""Long runs of the package's scenes: do they come to their end, and is the last turn as the first?

``python test/long_runs.py [SCENE ...] [--revolutions 10000] [--nodes]`` prints a line a scene: how
far it ran, how it ended, what it cost and, of ideal machines that repeat, by how much the figures
of the last revolution differ from those of the first one like it.

- Machines under a steady drive make so many revolutions, others run for an hour; those whose
  drive follows a profile or whose scene ends somewhere run as long as their scene says.
- What would take more than ``--budget`` [s] of processor time makes 100 revolutions, or runs for
  a minute, or as long as its scene says: that is told from its first part.
- Memory does not grow with the length of a run.

A quick part of it is in `test_length.py`.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.planar.drive import TWO_PI, DriveLaw
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.quantity import Shown
from mechanism_sim.results.run import Piece, prepare
from mechanism_sim.scene import Machine
from mechanism_sim.scene.validation import validate

Array = NDArray[np.float64]

HOUR, MINUTE, FEW = 3600.0, 60.0, 100.0  # [s], [s], revolutions
LONGEST_CYCLE = 240
"""Revolutions after which a machine must have come back to be one that repeats."""
PLACES = 64
"""Instants of a revolution that are compared."""
SAME = 1e-7  # [rad, or its size] what is so near to where it was a cycle ago has come back
WITH_TURNS = (
    'cam_angle', 'first_position', 'second_position', 'driver_angle', 'driven_position',
)  # fmt: skip
"""Readings of joints that count turns, as their coordinates do."""
SUMS = 'energy.drive_work', 'energy.dissipated'


def steady_speed(machine: Machine) -> Fraction | None:
    """Speed [rad/s] of a drive that turns evenly for ever and moves the machine alone."""
    law, one = machine.drive.law, len(machine.plan.laws) == 1 and len(machine.drive.laws) == 1
    if not (one and isinstance(law, DriveLaw) and law.degree == 1 and not law.straight):
        return None
    return Fraction(law.coefficients[1]) or None


def repeats(machine: Machine) -> bool:
    """True if the motion depends neither on the time nor on numbers of turns."""
    known = machine.nominal.inverse_dynamics.outside if machine.physics.has_forces else ()
    return not machine.level.dynamic and not known and steady_speed(machine) is not None


@dataclass
class Revolutions:
    """Keeps the first revolutions of a run, until it has come back to its start, and the last.

    Attributes
    ----------
    cycle : revolutions after which all is where it was; 0 while that is not known, or if it
        never is, as where a rack travels
    """

    machine: Machine
    last: int  #: number of the last revolution, counted from 0
    cycle: int = 0
    _first: list[Piece] = field(default_factory=list)
    _end: list[Piece] = field(default_factory=list)

    def __post_init__(self) -> None:
        speed = steady_speed(self.machine)
        assert speed is not None
        self._period = TWO_PI / abs(speed)  # exact

    def time(self, revolution: int) -> float:
        """Time at which a revolution begins [s]."""
        return float(revolution * self._period)

    def add(self, piece: Piece) -> None:
        """Keep what is needed of the piece that follows."""
        curve = piece.motion.curve
        if curve.start[0] <= self.time(LONGEST_CYCLE + 1) and not self._found(curve.start[0]):
            self._first.append(piece)
            self._look_for_cycle()
        if curve.end > self.time(self.last):
            self._end.append(piece)

    def _found(self, t: float) -> bool:
        return bool(self.cycle) and t > self.time(self.cycle + 1)

    def _look_for_cycle(self) -> None:
        """Compare whole turns with the start, of what is known so far."""
        if self.cycle:
            return
        physics = self.machine.physics
        slides = np.array([c in physics.displacements for c in physics.coordinates])
        most = min(LONGEST_CYCLE, int(self._first[-1].motion.curve.end / float(self._period)))
        start = self._at([0.0])[0]
        found = self._at([self.time(k) for k in range(1, most + 1)])
        for k, place in enumerate(found):
            way = place - start
            turned = np.remainder(way + math.pi, 2.0 * math.pi) - math.pi
            off = np.where(slides, way / self.machine.mechanism.size, turned)
            if np.abs(off).max() < SAME:
                self.cycle = k + 1
                return

    def _at(self, times: list[float]) -> list[Array]:
        found = []
        for t in times:
            piece = next(p for p in self._first if t <= p.motion.curve.end)
            curve = piece.motion.curve
            found.append(curve.local(*curve.find(np.array([max(t, curve.start[0])])))[0])
        return found

    def difference(self) -> tuple[str, float] | None:
        """The figure that differs most, and by which part of its size; None if none repeats."""
        if not self.cycle:
            return None
        first = self.last % self.cycle
        late = np.linspace(self.time(self.last), self.time(self.last + 1), PLACES + 2)[1:-1]
        # the early instants are those of the same angles, but for rounding of small times
        whole = (self.last - first) * self._period
        early = np.array([float(Fraction(t) - whole) for t in late.tolist()])
        one, two = (self._columns(*x) for x in ((self._first, early), (self._end, late)))
        worst = 'nothing', 0.0
        for name, size in self._sizes(one).items():
            off = two.get(name, np.zeros(PLACES)) - one[name]
            if name in SUMS:  # they go on growing: their growth repeats
                off -= off[0]
            if name.startswith('position.') and size == 2.0 * math.pi:
                off = np.remainder(off + math.pi, 2.0 * math.pi) - math.pi
            error = float(np.nanmax(np.abs(off), initial=0.0)) / size
            if not error <= worst[1]:
                worst = name, error
        return worst

    def _columns(self, pieces: list[Piece], times: Array) -> dict[str, Array]:
        """Columns (N,) at times which several pieces hold; angles without their whole turns."""
        parts = []
        for piece in pieces:
            curve = piece.motion.curve
            t = times[(times >= curve.start[0]) & (times < curve.end)]
            if not t.size:
                continue
            known = piece.catalogue
            names = [n for n in known.shown(Shown.PARTS) if known[n].kind not in WITH_TURNS]
            found = dict(piece.sample(t, *names))
            local = curve.local(*curve.find(t)).T
            for c, row in zip(self.machine.physics.coordinates, local, strict=True):
                found[f'position.{c}'] = row
            parts.append(found)
        names = sorted({n for x in parts for n in x} - {'t'})
        return {n: np.concatenate([x[n] for x in parts]) for n in names}

    def _sizes(self, columns: dict[str, Array]) -> dict[str, float]:
        """Scales of differences: the largest of a kind, if a quantity's own is but rounding."""
        largest: dict[str, float] = {}
        for name, x in columns.items():
            kind, size = name.partition('.')[0], float(np.nanmax(np.abs(x), initial=0.0))
            largest[kind] = max(largest.get(kind, 0.0), size)
        found, displacements = {}, self.machine.physics.displacements
        known = catalogue(self.machine)
        for name, x in columns.items():
            kind, _, c = name.partition('.')
            found[name] = max(float(np.nanmax(np.abs(x), initial=0.0)), 1e-6 * largest[kind])
            if kind == 'position' and c not in displacements:
                found[name] = 2.0 * math.pi
            if known[name].difference:
                found[name] = max(found[name], self.machine.mechanism.size)
        return {name: size for name, size in found.items() if size > 0.0}


def lengths(machine: Machine, revolutions: float) -> Iterator[tuple[str, float]]:
    """Lengths of a run in words and [s], the next one if the first is too costly."""
    if steady_speed(machine) is not None:
        try:
            validate(machine, machine.drive.time_of(1.0))
        except InputError:
            pass
        else:
            for count in (revolutions, min(FEW, revolutions)):
                yield f'{count:g} revolutions', machine.drive.time_of(count)
            return
    own = machine.scene.duration or 1.0
    for duration in (own,) if isinstance(machine.drive.law, DriveLaw) else (HOUR, MINUTE, own):
        yield f'{duration:g} s', duration


def run(name: str, revolutions: float, budget: float) -> dict[str, object]:
    """Run a scene; what there is to be said of it."""
    machine = ms.load_scene(name)
    said: dict[str, object] = {'scene': name, 'level': machine.level.value, 'ended': 'complete'}
    began = time.process_time()
    try:
        prepare(machine)
        began = time.process_time()
        wanted = [*lengths(machine, revolutions)]
        for words, end in wanted:
            said['length'] = words
            most = budget if words != wanted[-1][0] else math.inf
            if _runs_to(machine, words, end, most, said):
                break
    except (RunError, InputError) as error:
        said['ended'] = f'{type(error).__name__}: {error}'
    return said | {'cpu': time.process_time() - began}


def _runs_to(
    machine: Machine, words: str, end: float, budget: float, said: dict[str, object]
) -> bool:
    """Run a machine to an end [s] and tell what came of it; False where that is too dear."""
    began, motion, compare = time.process_time(), ms.stream(machine, duration=end), None
    if repeats(machine) and words.endswith('revolutions'):
        compare = Revolutions(machine, round(end / machine.drive.period) - 1)
    for piece in motion:
        if compare:
            compare.add(piece)
        spent = time.process_time() - began
        if spent > 2.0 and spent * end / motion.duration > budget:
            return False
    said['closure_error'] = motion.max_closure_error
    if motion.energy:
        e = motion.energy
        size = max(abs(e.initial), abs(e.final), abs(e.drive_work), abs(e.dissipated), 1e-12)
        said['missing_energy'] = abs(e.residual) / size
    if compare:
        said['difference'], said['cycle'] = compare.difference(), compare.cycle
    return True


def nodes(name: str, revolutions: float, budget: float) -> dict[str, object]:
    """Run a scene through its nodes, in one process as fast as possible, and compare digests."""
    machine = ms.load_scene(name)
    *dearer, (words, end) = lengths(machine, revolutions)
    began = time.process_time()
    for _ in ms.stream(machine, duration=end):
        pass
    cost = (time.process_time() - began) / end
    words, end = next((x for x in dearer if cost * x[1] < budget), (words, end))
    said: dict[str, object] = {'scene': name, 'level': machine.level.value, 'length': words}
    with tempfile.TemporaryDirectory() as folder:
        bag, span = str(Path(folder) / 'run.mcap'), ('--duration', f'{end!r}')
        command = [sys.executable, '-m', 'mechanism_sim']
        done = subprocess.run(
            [*command, 'run', name, *span, '--record', bag], capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        if done.returncode:
            return said | {'ended': done.stderr.strip().splitlines()[-1]}
        solved = subprocess.run(
            [*command, 'solve', name, *span, '--json'], capture_output=True, text=True, check=True
        )
        same = analyze(bag).digest == json.loads(solved.stdout)['digest']
    return said | {'ended': 'complete' if same else 'digests differ'}


def line(said: dict[str, object]) -> str:
    """One line for people."""
    more = []
    if 'closure_error' in said:
        more.append(f'closure {said["closure_error"]:.1e} m')
    if 'missing_energy' in said:
        more.append(f'energy {said["missing_energy"]:.1e}')
    if said.get('difference'):
        name, error = said['difference']
        more.append(f'last as first to {error:.1e} ({name}, cycle {said["cycle"]})')
    elif 'difference' in said:
        more.append(f'does not repeat within {LONGEST_CYCLE} revolutions')
    cost = f'{said["cpu"]:8.1f} s' if 'cpu' in said else ' ' * 10
    return (
        f'{said["scene"]:26s} {said["level"]:18s} {said["length"]:>18s} {cost}  '
        f'{said["ended"]}  {"  ".join(more)}'
    )


def main() -> None:
    """Run the scenes that are asked for, or all."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('scenes', nargs='*', metavar='SCENE')
    parser.add_argument('--revolutions', type=float, default=10_000.0)
    parser.add_argument('--budget', type=float, default=300.0, metavar='S')
    parser.add_argument('--nodes', action='store_true')
    parser.add_argument('--json', action='store_true')
    args = parser.parse_args()
    for name in args.scenes or ms.scene_names():
        said = (nodes if args.nodes else run)(name, args.revolutions, args.budget)
        print(json.dumps(said) if args.json else line(said), flush=True)


if __name__ == '__main__':
    main()
