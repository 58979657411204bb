"""Data that studies keep on disk when a signal ends them."""

from __future__ import annotations

import pytest
from running import run

from mechanism_sim import process_exit
from mechanism_sim.studies.journal import Journal

WEAR = {'pin_radius': '6 mm', 'wear': '{width: 10 mm, bushing: 1e-6 mm^3/(N m)}'}
SWEEP = (
    'scene: four_bar_nominal\nrevolutions: 1\ngrid: {drive.speed: [300 rpm, 310 rpm, 320 rpm]}\n'
)


@pytest.mark.usefixtures('in_this_process')
@pytest.mark.parametrize('command', ['find', 'life', 'sweep'])
def test_an_interrupted_study_says_what_is_kept(command, tmp_path, monkeypatch):
    """All that have a journal, in the same words."""
    file, table = tmp_path / 'three.yaml', tmp_path / 'rows.csv'
    file.write_text(SWEEP, encoding='utf-8')
    worn = (f'joints.coupler_rocker.clearance.{key}={value}' for key, value in WEAR.items())
    words = {
        'find': ('four_bar_nominal', '--vary', 'links.crank.length=55 mm:70 mm', '--minimise',
                 'rms(drive_torque)'),
        'life': ('four_bar_clearance', *(x for one in worn for x in ('--set', one)), '--skip', '1',
                 '--revolutions', '2'),
        'sweep': (str(file), '--workers', '1'),
    }[command]  # fmt: skip
    add = Journal.add

    def interrupt(journal, finished):
        if journal.rows:
            raise KeyboardInterrupt
        add(journal, finished)

    monkeypatch.setattr(process_exit, '_silent', False)
    monkeypatch.setattr(Journal, 'add', interrupt)
    done = run(command, *words, '-o', str(table))
    runs = '1 of 3 runs' if command == 'sweep' else '1 run'
    said = (
        f"interrupted after {runs}, kept in '{table}.journal'; the same command goes on from there"
    )
    assert (done.returncode, done.stderr) == (130, f'mechanism-sim: {said}\n')
