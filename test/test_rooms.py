"""What the engine loads; that rooms import only what is below them is checked by import-linter."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / 'mechanism_sim'


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
        'output', 'packages', 'terminal',
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
    assert 'mechanism_sim.scene.kinds' in done.stderr
    assert 'mechanism_sim.editor' not in done.stderr
