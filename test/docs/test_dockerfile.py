"""The image of the README: built, and a scene solved in it."""

from __future__ import annotations

import json
import shutil
import subprocess

import pytest
from running import ROOT

IMAGE = 'mechanism_sim_test'


def docker(*words: str) -> subprocess.CompletedProcess[str]:
    """A command of Docker, in the repository."""
    return subprocess.run(
        ['docker', *words], check=False, cwd=ROOT, capture_output=True, text=True
    )


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_image_solves_like_an_installation():
    if shutil.which('docker') is None or docker('info').returncode:
        pytest.skip('needs Docker')
    built = docker('build', '-t', IMAGE, '.')
    assert built.returncode == 0, built.stderr
    solved = docker('run', '--rm', IMAGE, 'solve', 'four_bar_clearance', '--json')
    assert solved.returncode == 0, solved.stderr
    assert json.loads(solved.stdout)['impacts']


def test_image_takes_no_more_than_is_needed():
    """What Git ignores is not copied into it."""
    left_out = (ROOT / '.dockerignore').read_text().split()
    assert {'.git', '.venv', 'build', 'runs'} <= set(left_out)
