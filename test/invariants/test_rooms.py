"""Modules that the engine loads, and places of tests; import-linter checks the rooms."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest
from bags import write_bag
from builders import simulated
from running import ROOT

PACKAGE = ROOT / 'mechanism_sim'


def test_numerics_knows_no_mechanics_and_physics_no_middleware():
    """Importing the engine loads nothing that carries or stores messages."""
    code = (
        'import sys, mechanism_sim.engine.event_loop, mechanism_sim.linkages.nominal; '
        'rooms = {m.split(".")[1] for m in sys.modules if m.startswith("mechanism_sim.")}; '
        'print(" ".join(sorted(rooms)))'
    )
    out = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=True,
        cwd=PACKAGE.parent,
    )  # fmt: skip
    assert set(out.stdout.split()) <= {
        'arrays', 'errors', 'numerics', 'units', 'planar', 'engine', 'linkages',
        'output', 'memory', 'packages', 'terminal', 'tolerances',
        'strict_json', 'text_table',
    }  # fmt: skip


ALONE = (
    ('check', 'four_bar_nominal'),
    ('solve', 'four_bar_nominal', '--revolutions', '1'),
    ('report', 'four_bar_nominal', '--revolutions', '1', '-o', 'page.html'),
    ('draw', 'four_bar_nominal', '-o', 'drawn.svg'),
)
OF_BAGS = (
    ('analyze', 'run.mcap'),
    ('report', 'run.mcap', '-o', 'page.html'),
    ('plot', 'run.mcap', 'velocity.rocker', '-o', 'plot.svg'),
)
LOADED = """
import runpy, sys
for line in open(sys.argv[1]).read().splitlines():
    sys.argv[1:] = line.split()
    try:
        runpy.run_module('mechanism_sim', run_name='__main__', alter_sys=True)
    except SystemExit as ended:
        assert not ended.code, line
    print('LOADED', *sorted(sys.modules))
"""


def loaded_by(lines, folder):
    """Modules in a process after each command, one after the other."""
    (folder / 'commands').write_text('\n'.join(map(' '.join, lines)), encoding='utf-8')
    done = subprocess.run(
        [sys.executable, '-c', LOADED, 'commands'], capture_output=True, text=True, check=True,
        cwd=folder, env={**os.environ, 'PYTHONPATH': str(PACKAGE.parent)},
    )  # fmt: skip
    rows = [set(x.split()) for x in done.stdout.splitlines() if x.startswith('LOADED ')]
    return dict(zip(lines, rows, strict=True))


@pytest.fixture(scope='module')
def loaded(tmp_path_factory):
    """Modules that commands of a scene and then of a recorded run load."""
    folder = tmp_path_factory.mktemp('rooms')
    file = folder / 'run.mcap'
    write_bag(file, simulated('four_bar_clearance', duration=0.02))
    return loaded_by(ALONE + OF_BAGS, folder)


def needs_no_network(modules):
    assert 'mechanism_sim.cli.entry' in modules
    roots = {module.partition('.')[0] for module in modules}
    return not roots & {'zenoh', 'zenoh_rclpy', 'rclpy'}


@pytest.mark.parametrize('command', ALONE, ids=lambda words: words[0])
def test_opening_no_editor_loads_none_of_it_nor_a_network(loaded, command):
    assert 'mechanism_sim.joints.kinds' in loaded[command]
    assert not any(module.startswith('mechanism_sim.editor') for module in loaded[command])
    assert needs_no_network(loaded[command])


@pytest.mark.parametrize('command', OF_BAGS, ids=lambda words: words[0])
def test_a_run_is_analysed_reported_and_drawn_without_a_network(loaded, command):
    assert needs_no_network(loaded[command])


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
