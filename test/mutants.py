"""Changed signs and numbers of engine and joints, each to be caught by quick tests near it.

    python -m test.mutants [--only WORD] [--json]

Each is made in a copy of the repository, whose tests then run until one fails. A text that is no
longer in its file is an error: whoever moves a line moves it here, too.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
COPIED = (
    'mechanism_sim', 'ros_interfaces', 'zenoh_rclpy', 'benchmarks', 'test', 'config', 'docs',
    'examples', 'msg', 'launch', 'resource', 'include', 'pyproject.toml', 'package.xml',
    'setup.py', 'README.md', 'CHANGELOG.md', 'Makefile',
)  # fmt: skip


LONGEST = 240
"""[s] of CPU that a file may take: where nothing comes to its end something is wrong, too."""


class Mutant(NamedTuple):
    """A line that says something wrong, and the tests that notice."""

    file: str  #: in mechanism_sim/
    right: str  #: stands once in the file
    wrong: str
    tests: str  #: in test/


CONTACT, LOOP = 'engine/contact', 'engine'
MUTANTS = (
    # rows of steps and events
    Mutant(f'{LOOP}/step_roots.py', 'if _slope(guard, when) < 0.0:',
           'if _slope(guard, when) > 0.0:', 'engine/test_step_roots.py'),
    Mutant(f'{LOOP}/row_kernels.py', 'if when < end:', 'if when > end:',
           'engine/test_step_rows.py'),
    Mutant(f'{LOOP}/present_state.py', 'rate = rate * tau + k * law[k]',
           'rate = rate * tau - k * law[k]', 'engine/test_step_rows.py'),
    Mutant(f'{LOOP}/row_kernels.py', 'if h < reach or reach == longest:', 'if h < reach:',
           'engine/test_step_rows.py'),
    Mutant(f'{LOOP}/clock.py', '(rounded + twice) - rounded == twice',
           '(rounded + twice) - rounded != twice', 'engine/test_step_roots.py'),
    # laws of impact
    Mutant(f'{CONTACT}/impact.py', 'p = (1.0 + e) * -vn / A.nn', 'p = (1.0 - e) * -vn / A.nn',
           'engine/test_impact.py'),
    Mutant(f'{CONTACT}/impact.py', 'more = e * p - (1.0 + e) * turn / last.rise',
           'more = e * p + (1.0 + e) * turn / last.rise', 'engine/test_impact.py'),
    Mutant(f'{CONTACT}/impact.py', 'square = e * e * (turn * turn - last.rise * p * (vn + turn))',
           'square = e * (turn * turn - last.rise * p * (vn + turn))', 'engine/test_impact.py'),
    Mutant(f'{CONTACT}/impact.py', 'more = -slide.rise * slide.length / last.rise',
           'more = slide.rise * slide.length / last.rise', 'engine/test_frictional_shocks.py'),
    Mutant(f'{CONTACT}/impact.py', 'basis[m + i, i] = -friction[i] * slip[i]',
           'basis[m + i, i] = friction[i] * slip[i]', 'engine/test_frictional_shocks.py'),
    Mutant(f'{CONTACT}/problem.py', 'slid = -0.5 * (before[1] + after[1]) * q',
           'slid = -0.5 * (before[1] - after[1]) * q', 'engine/test_contact_problem.py'),
    Mutant(f'{CONTACT}/problem.py', 'row[LOSS] = -0.5 * (before[0] + after[0]) * p + slid',
           'row[LOSS] = -0.5 * (before[0] + after[0]) * p - slid',
           'engine/test_contact_problem.py'),
    Mutant(f'{CONTACT}/problem.py', 'return -2.0 * _CHATTER.flights * rebound / acceleration',
           'return -0.02 * _CHATTER.flights * rebound / acceleration', 'engine/test_contact.py'),
    Mutant(f'{CONTACT}/chatter.py',
           'return acceleration < 0.0 and rebound * rebound <= -2.0 * acceleration * height',
           'return acceleration < 0.0 and rebound * rebound <= -0.5 * acceleration * height',
           'engine/test_contact.py'),
    Mutant(f'{CONTACT}/chatter.py', 'return -2.0 * rebound / (acceleration * (1.0 - restitution))',
           'return -2.0 * rebound / (acceleration * (1.0 + restitution))',
           'engine/test_contact.py'),
    Mutant(f'{CONTACT}/joint_friction.py', 'if friction.walls[t] * force >= 0.0:',
           'if friction.walls[t] * force <= 0.0:', 'engine/test_joint_friction_impulses.py'),
    Mutant(f'{CONTACT}/compliant.py', 'return approach + self.damping * rate',
           'return approach - self.damping * rate', 'engine/test_compliant.py'),
    Mutant(f'{CONTACT}/compliant.py', 'return 1.5 * (1.0 - self.restitution)',
           'return 1.5 * (1.0 + self.restitution)', 'engine/test_compliant.py'),
    Mutant(f'{CONTACT}/film.py', 'return self.vx + mean * self.y, self.vy - mean * self.x',
           'return self.vx - mean * self.y, self.vy + mean * self.x',
           'engine/test_film_walls.py'),
    Mutant(f'{CONTACT}/film.py', 'return -couple - drag, -couple + drag',
           'return couple - drag, couple + drag', 'engine/test_film_walls.py'),
    # equations and events
    Mutant(f'{LOOP}/dynamics.py', 'sign = 2.0 * self.flags.presses[i] - 1.0',
           'sign = 1.0 - 2.0 * self.flags.presses[i]', 'engine/test_guards.py'),
    Mutant(f'{LOOP}/dynamics.py',
           'T[i] = neg(mul(self.flags.slips[i], mul(self.contacts.mu[i], force)))',
           'T[i] = mul(self.flags.slips[i], mul(self.contacts.mu[i], force))',
           'engine/test_deep_contacts.py'),
    Mutant(f'{LOOP}/reduction.py',
           'return mul(alpha, add(2.0 * jet.rate, mul(alpha, jet.value)))',
           'return mul(alpha, add(2.0 * jet.rate, neg(mul(alpha, jet.value))))',
           'engine/test_event_loop.py'),
    Mutant(f'{LOOP}/audit.py',
           'return self.final - self.initial - self.drive_work + self.dissipated',
           'return self.final - self.initial - self.drive_work - self.dissipated',
           'engine/test_energy_balance.py'),
    Mutant(f'{LOOP}/energy_terms.py', "passed = np.searchsorted(began, k, side='right')",
           "passed = np.searchsorted(began, k, side='left')", 'engine/test_solution.py'),
    Mutant(f'{LOOP}/gap_geometry.py', 'central, -2.0 * value * np.hypot(nx, ny),',
           'central, 2.0 * value * np.hypot(nx, ny),', 'engine/test_gap_geometry.py'),
    Mutant(f'{LOOP}/switching.py', 'below, above, *_ = self._rates_of(k)',
           'above, below, *_ = self._rates_of(k)', 'engine/test_switching.py'),
    Mutant(f'{LOOP}/guards.py', 'dense(push) - guard.friction * solved.T[gap]',
           'dense(push) + guard.friction * solved.T[gap]', 'engine/test_guards.py'),
    Mutant(f'{LOOP}/clock.py', 'return whole, float(Fraction(angle) - whole * TWO_PI)',
           'return whole, float(Fraction(angle) + whole * TWO_PI)', 'engine/test_clock.py'),
    Mutant(f'{LOOP}/peak_shapes.py', 'return self.end - self.begin',
           'return self.end + self.begin', 'engine/test_peak_shapes.py'),
    # joints
    Mutant('joints/belt/constraint.py', 'math.asin((r1 - s * r2) / math.hypot(*self.apart))',
           'math.asin((r1 + s * r2) / math.hypot(*self.apart))', 'joints/belt'),
    Mutant('joints/belt/constraint.py', 'slope = (r1 - s * r2) / d', 'slope = (r1 + s * r2) / d',
           'joints/belt'),
    Mutant('joints/cam/laws.py', 'turned = self.frequency * s + self.phase + order * np.pi / 2',
           'turned = self.frequency * s - self.phase + order * np.pi / 2',
           'joints/cam/test_cam_laws.py'),
    Mutant('joints/cam/followers.py',
           'curvature = cross(along, p2 + 2.0 * w * turned(p1) - w**2 * p) / speed**3',
           'curvature = cross(along, p2 - 2.0 * w * turned(p1) - w**2 * p) / speed**3',
           'joints/cam/test_cam_profiles.py'),
    Mutant('joints/cam/constraint.py',
           'start = sign * (offset + joint.arm_angle - joint.direction - math.pi)',
           'start = sign * (offset + joint.arm_angle - joint.direction + math.pi / 2)',
           'joints/cam/test_cam_pairs.py'),
    Mutant('joints/mesh/involute.py', 'return math.tan(angle) - angle',
           'return math.tan(angle) + angle', 'joints/mesh/test_gears.py'),
    Mutant('joints/mesh/involute.py',
           'height = self.shift + (-1 if self.internal else 1) * self.system.addendum',
           'height = self.shift + (1 if self.internal else -1) * self.system.addendum',
           'joints/mesh/test_gears.py'),
    Mutant('joints/mesh/constraint.py',
           "start = p(f'{self.name}.flank.{sign:g}', sign * e.lead - e.tooth)",
           "start = p(f'{self.name}.flank.{sign:g}', sign * e.lead + e.tooth)",
           'joints/mesh/test_gear_mesh.py'),
    Mutant('joints/geneva/constraint.py', 'crank = math.sqrt(d * d - mouth * mouth)',
           'crank = math.sqrt(d * d + mouth * mouth)', 'joints/geneva'),
    Mutant('joints/rack/constraint.py',
           'return self._read(view, engaged, centre, c * fx + s * fy)',
           'return self._read(view, engaged, centre, c * fx - s * fy)',
           'joints/rack'),
    Mutant('linkages/known_pieces.py', '[:, :-1] += off', '[:, :-1] -= off',
           'linkages/test_pieces_again.py'),
    Mutant('linkages/known_pieces.py', 'off * piece.switched, place[2])', 'off, piece.length)',
           'linkages/test_pieces_again.py'),
    Mutant('numerics/formula.py', 'x / size - _EMPTY', 'x / size + _EMPTY',
           'engine/test_roots_of_states.py'),
    Mutant('joints/rack/keys.py', '1 if across < 0.0 else -1', '-1 if across < 0.0 else 1',
           'joints/rack'),
    Mutant('joints/slot/constraint.py', 'slip = (nx * y - ny * x)', 'slip = (nx * y + ny * x)',
           'joints/slot'),
    Mutant('joints/prismatic/contact.py',
           "return width - height if self.side == 'left' else width + height",
           "return width + height if self.side == 'left' else width - height",
           'joints/prismatic'),
    Mutant('planar/gaps.py', 'return -2.0 * dense(value) / (1.0 + dense(self.stretch(value)))',
           'return 2.0 * dense(value) / (1.0 + dense(self.stretch(value)))',
           'engine/test_deep_contacts.py'),
    Mutant('planar/gaps.py', 'T, arm = mul(T, inverse.value), mul(arm, root.value)',
           'T, arm = mul(T, root.value), mul(arm, inverse.value)',
           'engine/test_deep_contacts.py'),
    Mutant('joints/revolute/worn_bearing.py', 'seen = ux * x + uy * y, ux * y - uy * x',
           'seen = ux * x + uy * y, ux * y + uy * x', 'joints/revolute'),
    Mutant('joints/worm/constraint.py', 'around, along = press * s + mu * c, press * c - mu * s',
           'around, along = press * s - mu * c, press * c + mu * s',
           'joints/mesh/test_gear_forces.py'),
    Mutant('joints/bevel/constraint.py',
           'force = np.array([-s * push - c * radial, c * push - s * radial, axial])',
           'force = np.array([-s * push + c * radial, c * push + s * radial, axial])',
           'joints/mesh/test_shafts.py'),
    Mutant('joints/worm/constraint.py', 'tangential * math.cos(lead) - self.hand * around',
           'tangential * math.cos(lead) + self.hand * around', 'joints/mesh/test_shafts.py'),
    Mutant('joints/transmission/constraint.py',
           'return -float(self.ratio) * second - lost, second',
           'return -float(self.ratio) * second + lost, second', 'joints/mesh/test_gear_scenes.py'),
    Mutant('joints/transmission/constraint.py',
           'rest = q * (b - c - joint.phase) + p * (a - c)',
           'rest = q * (b - c + joint.phase) + p * (a - c)', 'joints/mesh/test_gear_scenes.py'),
)  # fmt: skip


def copied(folder: Path) -> None:
    """Copy what tests need."""
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns('__pycache__'))
        else:
            shutil.copy2(source, folder / name)


def tested(tests: Collection[str], folder: Path) -> tuple[int, str, float]:
    """The exit code of pytest, the first failure or its last line, and the CPU time [s]."""
    command = [sys.executable, '-m', 'pytest', '-x', '-n', '0', '-p', 'no:cacheprovider']
    before, limit = resource.getrusage(resource.RUSAGE_CHILDREN), LONGEST * len(tests)
    done = subprocess.run(
        [*command, *(f'test/{x}' for x in tests)], cwd=folder, capture_output=True, text=True,
        env=os.environ | {'PYTHONPATH': str(folder)}, check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5)),
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    if done.returncode < 0:
        return done.returncode, f'took more than {limit} s of CPU', used
    if done.returncode not in (0, 1, 2):  # 2: its tests cannot even be collected
        raise SystemExit(f'{tests}: {done.stdout[-500:]}{done.stderr[-500:]}')
    lines = done.stdout.splitlines()
    failed = [line for line in lines if line.startswith(('FAILED', 'ERROR'))]
    return done.returncode, (failed or lines[-1:])[0], used


def caught(mutant: Mutant, folder: Path, number: int) -> dict[str, Any]:
    """`caught` if a test fails with it, `by` which, or pytest's last line, and `cpu` [s]."""
    file = folder / 'mechanism_sim' / mutant.file
    text = file.read_text(encoding='utf-8')
    if text.count(mutant.right) != 1:
        raise SystemExit(f'{mutant.file}: not once in it: {mutant.right}')
    file.write_text(text.replace(mutant.right, mutant.wrong), encoding='utf-8')
    os.utime(file, (time.time() + number, time.time() + number))  # no compiled file of another
    code, by, used = tested([mutant.tests], folder)
    file.write_text(text, encoding='utf-8')
    os.utime(file, (time.time() + number + 0.5, time.time() + number + 0.5))
    return {'caught': code != 0, 'by': by, 'cpu': round(used, 1)}


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(prog='python -m test.mutants', description=__doc__)
    parser.add_argument('--only', default='', help='WORD,...: of files with these in their names')
    parser.add_argument('--json', action='store_true')
    asked = parser.parse_args()
    chosen = [m for m in MUTANTS if any(word in m.file for word in asked.only.split(','))]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        copied(Path(folder))
        code, by, _ = tested(sorted({m.tests for m in chosen}), Path(folder))
        if code:
            raise SystemExit(f'the tests fail without any mutant: {by}')
        for number, mutant in enumerate(chosen, 1):
            row = mutant._asdict() | caught(mutant, Path(folder), 10 * number)
            rows.append(row)
            if not asked.json:
                word = 'caught' if row['caught'] else 'LIVES '
                print(f'{word} {row["cpu"]:5} s', *mutant[:3:2], '|', row['by'], flush=True)
    lives = sum(not row['caught'] for row in rows)
    if asked.json:
        print(json.dumps(rows, indent=1))
    else:
        print(f'{len(rows) - lives} of {len(rows)} caught')
    sys.exit(bool(lives))


if __name__ == '__main__':
    main()
