"""What the engine loads, where tests stand; imports of rooms are checked by import-linter."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest
from running import ROOT, run

PACKAGE = ROOT / 'mechanism_sim'


def test_numerics_knows_no_mechanics_and_physics_no_middleware():
    """Importing the engine loads nothing that carries or stores messages."""
    code = (
        'import sys, mechanism_sim.hybrid.event_loop, mechanism_sim.linkages.nominal; '
        'rooms = {m.split(".")[1] for m in sys.modules if m.startswith("mechanism_sim.")}; '
        'print(" ".join(sorted(rooms)))'
    )
    out = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=True,
        cwd=PACKAGE.parent,
    )  # fmt: skip
    assert set(out.stdout.split()) <= {
        'arrays', 'errors', 'numerics', 'units', 'planar', 'contact', 'hybrid', 'linkages',
        'output', 'memory', 'packages', 'terminal', 'tolerances',
        'strict_json', 'text_table',
    }  # fmt: skip


@pytest.mark.parametrize('command', [
    ('check', 'four_bar_nominal'),
    ('solve', 'four_bar_nominal', '--revolutions', '1'),
    ('report', 'four_bar_nominal', '--revolutions', '1', '-o', 'page.html'),
])  # fmt: skip
def test_opening_no_editor_loads_none_of_it(command, tmp_path):
    done = subprocess.run(
        [sys.executable, '-X', 'importtime', '-m', 'mechanism_sim', *command],
        capture_output=True, text=True, check=True, cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(PACKAGE.parent)},
    )  # fmt: skip
    assert 'mechanism_sim.joints.kinds' in done.stderr
    assert 'mechanism_sim.editor' not in done.stderr


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """A recorded run."""
    file = tmp_path_factory.mktemp('rooms') / 'run.mcap'
    done = run('run', 'four_bar_clearance', '--duration', '0.02', '--record', str(file))
    assert done.returncode == 0, done.stderr
    return file


@pytest.mark.network
@pytest.mark.parametrize(
    'words',
    [
        ('analyze', 'BAG'),
        ('report', 'BAG', '-o', 'page.html'),
        ('plot', 'BAG', 'velocity.rocker', '-o', 'plot.svg'),
        ('draw', 'four_bar_nominal', '-o', 'drawn.svg'),
    ],
    ids=lambda words: words[0],
)
def test_a_run_is_analysed_reported_and_drawn_without_a_network(words, bag, tmp_path):
    args = [str(bag) if word == 'BAG' else word for word in words]
    done = subprocess.run(
        [sys.executable, '-X', 'importtime', '-m', 'mechanism_sim', *args], cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(PACKAGE.parent)}, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    loaded = {line.rpartition('|')[2].strip() for line in done.stderr.splitlines()}
    assert 'mechanism_sim.cli.entry' in loaded
    roots = {module.partition('.')[0] for module in loaded}
    assert not roots & {'zenoh', 'zenoh_rclpy', 'rclpy'}


def test_tests_mirror_the_package_and_import_no_test():
    """What several tests use is a module of its own; folders are rooms, or those listed."""
    rooms = {path.name for path in PACKAGE.iterdir() if path.is_dir()}
    others = {
        'base',
        'benchmarks',
        'cases',
        'docs',
        'fuzz',
        'grid',
        'hard',
        'invariants',
        'network',
    }
    for file in (ROOT / 'test').rglob('test_*.py'):
        assert file.relative_to(ROOT).parts[1] in rooms | others, file
        assert not re.search(r'^\s*(from|import) test_', file.read_text('utf-8'), re.M), file
