"""Completion of names: a real bash asks, by the script that `completion bash` prints."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest
from running import ROOT, TIMEOUT, run

from mechanism_sim.cli.first import SHELLS

PROGRAM = f"""#!{sys.executable}
import os, sys

leave = os._exit

def end(code):
    heavy = {{'heyoka', 'numpy', 'pydantic', 'scipy', 'mechanism_sim.scene'}} & set(sys.modules)
    with open('heavy', 'a') as file:
        print(*heavy, file=file)
    leave(code)

os._exit = end
from mechanism_sim.cli import main
main()
"""

ASK = """
source script.bash
ask() {
  COMP_LINE="$1"; COMP_POINT=${#1}; COMP_TYPE=9; COMP_KEY=9; COMP_WORDBREAKS=$' \\t\\n"\\'><=;|&(:'
  read -ra COMP_WORDS <<< "$1"; [[ "$1" == *' ' ]] && COMP_WORDS+=('')
  COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); COMPREPLY=()
  _python_argcomplete mechanism-sim
  echo "${COMPREPLY[@]}"
}
"""

QUESTIONS = {
    'mechanism-sim so': {'solve'},
    'mechanism-sim solve four_bar_cl': {'four_bar_clearance'},
    'mechanism-sim solve four_bar_clearance --rev': {'--revolutions'},
    'mechanism-sim analyze r': {'run.mcap', 'recorded/'},
    'mechanism-sim check m': {
        'mine.yaml',
        'mass_on_spring',
        'material_handling',
        'measured_cam',
        'mesh_stiffness',
    },
    'mechanism-sim draw valve_train --profile ': {'bearing', 'guide', 'contact'},
    'mechanism-sim draw punch --path punch.': {'punch.start', 'punch.tip'},
    'mechanism-sim node ge': {'gear_train', 'geneva'},
    'mechanism-sim --completion f': {'fish'},
    'mechanism-sim sweep thesis_m': {'thesis_measurement'},
}


def test_a_bash_completes_names_without_waiting_for_mechanics(tmp_path):
    bash = shutil.which('bash')
    if bash is None:
        pytest.skip('there is no bash')
    program = tmp_path / 'bin' / 'mechanism-sim'
    program.parent.mkdir()
    program.write_text(PROGRAM)
    program.chmod(0o755)
    (tmp_path / 'run.mcap').touch()
    (tmp_path / 'run.txt').touch()
    (tmp_path / 'recorded').mkdir()
    (tmp_path / 'mine.yaml').touch()
    (tmp_path / 'script.bash').write_text(run('--completion', 'bash').stdout)
    script = ASK + '\n'.join(f"ask '{question}'" for question in QUESTIONS)
    path = f'{program.parent}{os.pathsep}{os.environ["PATH"]}'
    environment = {**os.environ, 'PATH': path, 'PYTHONPATH': str(ROOT)}
    asked = subprocess.run(
        [bash, '--norc', '-c', script], cwd=tmp_path, env=environment, capture_output=True,
        text=True, timeout=TIMEOUT, check=True,
    )  # fmt: skip
    assert asked.stderr == ''
    assert (tmp_path / 'heavy').read_text() == '\n' * len(QUESTIONS)
    answers = [set(line.split()) for line in asked.stdout.splitlines()]
    assert dict(zip(QUESTIONS, answers, strict=True)) == QUESTIONS


@pytest.mark.parametrize('shell', SHELLS)
def test_there_is_a_script_for_every_shell(shell):
    script = run('--completion', shell).stdout
    assert 'mechanism-sim' in script


def test_options_of_the_program_go_without_a_command():
    for option in (['--version'], ['--completion', 'bash']):
        done = run(*option, 'scenes')
        assert (done.returncode, done.stdout) == (2, '')
        assert done.stderr == (
            f"mechanism-sim: {option[0]} takes no command, but 'scenes' was given\n"
        )
