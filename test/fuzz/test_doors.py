"""Doors of the editor and of tables: whatever comes in, a sentence comes out, and all goes on.

A sample runs in the suite; ``python test/fuzz/doors.py --messages 20000`` and
``FUZZ_EXAMPLES=5000 pytest test/fuzz/test_doors.py`` take an hour.
"""

from __future__ import annotations

import os
import random
import time
from types import SimpleNamespace

import doors
import pytest
from doors import RUNS, Saves, edit, memory_beyond, message, table
from hypothesis import given, settings
from hypothesis import strategies as st

from mechanism_sim.editor.document import Document
from mechanism_sim.editor.session import Session
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.scene.table_keys import TablePart, with_files

EXAMPLES = int(os.environ.get('FUZZ_EXAMPLES', '25'))
SAMPLE = settings(max_examples=EXAMPLES, deadline=None, derandomize=EXAMPLES < 1000, database=None)


@pytest.fixture(scope='module')
def edited(tmp_path_factory):
    return edit(tmp_path_factory.mktemp('doors') / 'editor', 16, 3, hang=60.0)


@pytest.mark.parametrize('count', [16, pytest.param(1000, marks=pytest.mark.slow)])
def test_no_message_of_a_page_ends_the_editor(count, edited, tmp_path):
    """On a small disk that is full now and then: nothing lost, nothing outside is touched."""
    found = edited if count == 16 else edit(tmp_path / 'editor', count, 3, hang=60.0)
    assert found.wrong == []
    assert found.counts['state'] > 0.3 * count


@pytest.mark.parametrize('seed', [
    1, 2, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(3, 40))
])  # fmt: skip
def test_no_message_ends_a_session(seed, tmp_path, monkeypatch):
    """Without a process between: nothing but sentences, whatever the state it is in."""
    monkeypatch.chdir(tmp_path)
    heard = []
    session, dice = Session(Document.open('four_bar_nominal'), heard.append), random.Random(seed)
    for _ in range(40):
        given = message(dice, session.greeting[0])
        if isinstance(given, dict):
            session.handle(given)
    assert all(0 < len(m['text']) < 2000 for m in heard if m['type'] == 'said')
    assert all(not x.name.endswith('.part') for x in tmp_path.rglob('*'))


@given(seed=st.integers(0, 1 << 40))
@SAMPLE
def test_a_table_is_read_or_refused_in_a_sentence(tmp_path_factory, seed):
    dice = random.Random(seed)
    folder = tmp_path_factory.getbasetemp()
    (folder / 'load.csv').write_bytes(table(dice))
    more = (
        {} if dice.random() < 0.7 else {'columns': dice.choice((['a', 'b'], ['a'], 5, [[], {}]))}
    )
    begun = time.process_time()
    try:
        content = with_files('s.yaml', folder, {'file': 'load.csv', **more})
        TablePart.model_validate(content)
        said = 'read'
    except (InputError, RunError, ValueError) as error:  # as `checked` takes it
        said = str(error)
    assert 0 < len(said.splitlines()[0]) < 2000
    assert time.process_time() - begun < 5.0


def state(text: str, path: str = '') -> dict:
    return {'type': 'state', 'text': text, 'changed': False, 'path': [path]}


def test_states_that_others_asked_for_are_not_taken_for_what_was_saved(tmp_path):
    """A run that ended has sent a state: all that follow are late by one."""
    saves, folder = Saves(tmp_path), tmp_path.resolve()
    (tmp_path / 'a.yaml').write_text('first\n')
    heard = state('older\n'), {'type': 'said', 'text': 'saved: a.yaml'}, state('first\n')
    for each in (*heard, state('newer\n')):
        saves.hear(each)
    saves.close()
    assert (saves.texts, saves.wrong) == ({folder / 'a.yaml': 'first\n'}, [])


@pytest.mark.parametrize('there', [None, '', 'firs', 'older\n'])
@pytest.mark.parametrize('late', [False, True])
def test_a_file_that_is_lost_is_noticed(there, late, tmp_path):
    saves, file = Saves(tmp_path), tmp_path / 'a.yaml'

    def lose() -> None:
        file.unlink(missing_ok=True)
        if there is not None:
            file.write_text(there)

    file.write_text('first\n')
    saves.hear({'type': 'said', 'text': 'saved: a.yaml'})
    if not late:
        lose()
    saves.hear(state('first\n'))
    if late:
        lose()
    saves.close()
    assert len(saves.wrong) == (1 if late else 2)
    assert "'a.yaml' is not what was saved" in saves.wrong[0]


def test_who_holds_too_much_memory_is_told_by_role(monkeypatch):
    """Who runs machines may take what `solve` takes of the same, and a tenth more."""
    needs = {'small': 100.0, 'large': 600.0}
    monkeypatch.setattr(doors, 'alone', needs.__getitem__)
    large = {1: (640.0, ['small', 'large']), 2: (670.0, ['large']), 3: (501.0, ['small'])}
    memory = {'server': 120.0, 'editor: draw': 510.0, RUNS: 670.0}
    assert [*memory_beyond(SimpleNamespace(memory=memory, large=large))] == [
        '510 MiB in editor: draw',
        '670 MiB in editor: run, where solve alone takes 600',
        '501 MiB in editor: run, where solve alone takes 100',
    ]


def test_roles_have_names_and_a_solve_takes_memory(edited):
    found = edited
    assert {'server', 'editor: draw'} <= set(found.memory)
    assert all(10.0 < found.memory[x] < doors.MEMORY for x in ('server', 'editor: draw'))
    assert 50.0 < doors.alone('title: nothing\n') < doors.MEMORY


LOSES = """
from mechanism_sim import output
write = output.write_text
def lose(path, text, devices=True):
    write(path, text[:-1] if path.suffix == '.yaml' else text, devices)
output.write_text = lose
"""


@pytest.mark.slow
def test_an_editor_that_loses_a_letter_is_noticed(tmp_path, monkeypatch):
    (tmp_path / 'sitecustomize.py').write_text(LOSES)
    monkeypatch.setenv('PYTHONPATH', f'{tmp_path}{os.pathsep}{os.environ.get("PYTHONPATH", "")}')
    found = edit(tmp_path / 'editor', 150, 0, hang=60.0)
    assert any('is not what was saved' in x for x in found.wrong)
