"""Measures and file names as nobody would write them: taken, or refused in one sentence.

A sample runs in the suite; ``FUZZ_EXAMPLES=20000 pytest test/fuzz/test_broken_texts.py`` more.
"""

import os
import random
import time
import warnings

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import mechanism_sim as ms
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.output import beside, check_path
from mechanism_sim.results.measure_text import FUNCTIONS, read_all
from mechanism_sim.results.measures import Measurement, check_measures
from mechanism_sim.scene.scene_writer import new_scene

EXAMPLES = int(os.environ.get('FUZZ_EXAMPLES', '60'))
SAMPLE = settings(max_examples=EXAMPLES, deadline=None, derandomize=EXAMPLES < 1000, database=None)
HANG = 5.0  # [s] of CPU

WORDS = (
    *FUNCTIONS, 'drive_torque', 'reaction.coupler_rocker', 'position.rocker', 'impacts', 'losses',
    'impacts.normal_impulse', 'sensors', 'energy.drive_work', 'no.such', 'from', 'to',
    'per revolution', '2 s', '1 revolution', '-1 s', '90 deg', '10 N m', '3 kg', 'nan', 'inf',
    '1e400', '9' * 400, '0', '(', ')', ',', '+', '-', '*', '/', '**', '<', '>', '==', 'and', 'not',
    'if', 'else', '=', 'sin(', 'sqrt(', '"', "'", '[', ']', '{', '}', ';', '\n', '\0', '\udc80',
    'é', '__import__', 'lambda x: x', '.', '..', ':', '#', '%', 'x' * 5000, '(' * 300,
)  # fmt: skip
SENSIBLE = (
    'largest(reaction.coupler_rocker)', 'rms(drive_torque, from 0.001 s)', 'count(impacts)',
    'percentile(velocity.rocker, 95)', 'peak = mean(abs(drive_torque)) / (1 N m)',
    'work(drive_torque.crank)', 'share(position.rocker > 100 deg)', 'sum(impacts.energy_loss)',
)  # fmt: skip


def measure(dice: random.Random) -> str:
    """A text: a sensible measure of which parts are cut, doubled or put in, or words by chance."""
    if dice.random() < 0.3:
        return ' '.join(dice.choices(WORDS, k=dice.randint(0, 12)))
    text = dice.choice(SENSIBLE)
    for _ in range(dice.randint(0, 4)):
        i, j = sorted(dice.randint(0, len(text)) for _ in range(2))
        part = dice.choice(('', text[i:j] * 2, dice.choice(WORDS), dice.choice(SENSIBLE)))
        text = text[:i] + part + text[j:]
    return text


@pytest.fixture(scope='module')
def solved():
    """A machine, and its motion for a moment."""
    machine = ms.load_scene('four_bar_clearance')
    return machine, ms.simulate(machine, duration=0.01)


def refused(action) -> str:
    """The sentence by which something is refused; '' if it is done, within seconds of CPU."""
    begun, said = time.process_time(), ''
    try:
        action()
    except (InputError, RunError) as error:
        said = str(error)
        assert 0 < len(said) < 2000
        said.encode('utf-8')
    assert time.process_time() - begun < HANG
    return said


@given(seed=st.integers(0, 1 << 40))
@SAMPLE
def test_a_measure_is_taken_or_refused_in_a_sentence(solved, seed):
    machine, solution = solved
    text = measure(random.Random(seed))

    def take():
        found = read_all([text], '--measure')
        check_measures(machine, [text], '--measure')
        taken = Measurement(machine, found, 0.0, 0.01)
        taken.add(solution)
        for figure in taken.found():
            float(figure.value)

    with warnings.catch_warnings():
        warnings.simplefilter('error')
        refused(take)


NAMES = (
    '', '.', '..', '/', '//', '~', '-', '--help', '.hidden', ' ', 'a b', 'a\nb', 'a\0b', 'a/b',
    '../a', 'no/such/folder', '/nowhere/x', '/dev/null', '/dev/full', '/proc/self/mem',
    '/etc/passwd/x', 'CON', 'x' * 252, 'x' * 256, 'x' * 5000, '\udc80', 'é', '日本', '=SUM(A1)',
    '$(true)', '`true`', 'a;b', 'folder', 'file', 'link', 'loop', 'fifo',
)  # fmt: skip
ENDINGS = '', '.yaml', '.csv', '.svg', '.YAML', '.', '.csv.csv'


@given(seed=st.integers(0, 1 << 40))
@example(seed=0)
@SAMPLE
def test_a_name_is_written_or_refused_and_nothing_else_is_touched(tmp_path_factory, seed):
    dice = random.Random(seed)
    outside = tmp_path_factory.mktemp('names')
    folder = outside / 'own'
    (folder / 'folder').mkdir(parents=True)
    (outside / 'kept').write_text('kept')
    (folder / 'file').write_text('file')
    (folder / 'link.csv').symlink_to(outside / 'kept')
    (folder / 'loop.csv').symlink_to(folder / 'loop.csv')
    os.mkfifo(folder / 'fifo.csv')
    name = dice.choice(NAMES) + dice.choice(ENDINGS)
    before, here = {x.name for x in outside.iterdir()}, os.getcwd()
    os.chdir(folder)
    try:
        if dice.random() < 0.5:
            refused(lambda: new_scene(name, 'four_bar_nominal'))
        else:
            refused(lambda: _write(name))
    finally:
        os.chdir(here)
    new = {x.name for x in outside.iterdir()} - before  # only what it was told to write there
    assert not new or (name.startswith('../a') and len(new) == 1)
    assert (outside / 'kept').read_text() == 'kept' or name == 'link.csv'  # a link is followed
    assert not list(outside.rglob('*.part'))


def _write(name: str) -> None:
    path = check_path('--output', name, '.csv')
    if path.name == 'fifo.csv':
        return  # whoever reads there is waited for, as by every program
    with beside(path) as part:
        part.write_text('a,b\n')
