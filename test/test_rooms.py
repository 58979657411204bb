"""What the engine loads; that rooms import only what is below them is checked by import-linter."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

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
