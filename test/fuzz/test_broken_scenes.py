"""Whatever a file holds, the door says yes or says one sentence.

A sample runs in the suite; ``FUZZ_EXAMPLES=20000 pytest test/fuzz`` takes hours.
"""

import os
import re
import signal
from itertools import pairwise

import pytest
from broken_scenes import SCENES, SWEEPS, broken_file
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import mechanism_sim as ms
from mechanism_sim import documents
from mechanism_sim.errors import InputError
from mechanism_sim.studies.plan import read_plan

EXAMPLES = int(os.environ.get('FUZZ_EXAMPLES', '25'))
HANG = 60.0
"""[s] of CPU after which an example counts as a hang."""

BOMB = 'a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n' + ''.join(
    f'{b}: &{b} [{", ".join([f"*{a}"] * 10)}]\n' for a, b in pairwise('abcdefg')
)

SAMPLE = settings(max_examples=EXAMPLES, deadline=None, derandomize=EXAMPLES < 1000, database=None)


@pytest.fixture(autouse=True)
def no_hang():
    def give_up(*_):
        raise TimeoutError(f'no answer after {HANG:g} s of CPU')

    before = signal.signal(signal.SIGPROF, give_up)
    yield
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    signal.signal(signal.SIGPROF, before)


def answered(load, path):
    """True if a file is accepted; else it is refused in one printable sentence."""
    signal.setitimer(signal.ITIMER_PROF, HANG)
    try:
        load(str(path))
    except InputError as error:
        text = str(error)
        text.encode('utf-8')
        assert 0 < len(text) < 2000
        assert not re.search('\x1b|function-|Input should|validator', text)
        return False
    return True


@given(seed=st.integers(0, 1 << 40))
@example(seed=129)  # a centre of mass beyond all others
@example(seed=749)  # a motion that grows without end
@example(seed=5942)  # a link without inertia beside a prescribed one
@example(seed=7334)  # a name of 6,000 characters
@SAMPLE
@pytest.mark.filterwarnings('ignore')
def test_broken_scenes_are_taken_or_refused_in_a_sentence(tmp_path_factory, seed):
    path = tmp_path_factory.getbasetemp() / 'broken.yaml'
    path.write_bytes(broken_file(seed, SCENES))
    answered(ms.load_scene, path)


@given(seed=st.integers(0, 1 << 40))
@SAMPLE
@pytest.mark.filterwarnings('ignore')
def test_broken_sweeps_are_taken_or_refused_in_a_sentence(tmp_path_factory, seed):
    path = tmp_path_factory.getbasetemp() / 'broken_sweep.yaml'
    text = broken_file(seed, SWEEPS).replace(b'samples: 200', b'samples: 8')
    drawn = re.search(rb'samples: *(\d{3,})', text)
    assume(drawn is None)  # to look at hundreds of machines takes long, and is no hang
    path.write_bytes(text)
    answered(read_plan, path)


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        (BOMB, 'more than 30000 values'),
        ('a: &a [*a]', "alias '*a' is not known"),
        ('x: ' + '[' * 5000, 'more than 24 levels'),
        ('? [1, 2]\n: 3', 'keys must be text'),
        ('1: 2', 'must be text; put it in quotes'),
        ('x: !!binary AAAA', 'tags such as'),
        ('x: "\\ud800"', 'U+D800'),
        ('x: "\\U00110000"', 'out of range'),
        ('x: 1' + '0' * 400, 'below 1.7e308'),
        ('x: 1' + '0' * 6000, 'cannot be read'),
        ('x: 1\nx: 2', "the key 'x' is written twice"),
        ('k' * 200 + ': 1', 'longer than 100 characters'),
        ('x: ' + 'a' * 1_001, 'longer than 1000 characters'),
        ('description: ' + 'a' * 20_000, 'longer than 10000 characters'),
        ('x: ' + 'a ' * 200_000, 'larger than 262144 bytes'),
        ('--- 1\n--- 2', "more than one document"),
    ],
)  # fmt: skip
def test_what_yaml_knows_and_scenes_do_not_need_is_refused(text, said):
    with pytest.raises(documents.DocumentError) as caught:
        documents.parse(text)
    assert said in str(caught.value)
    assert len(str(caught.value)) < 200


def test_dates_are_text_and_merges_are_taken():
    assert documents.parse('x: 2001-01-01') == {'x': '2001-01-01'}
    text = 'a: &a {k: 1, l: 2}\nb: {<<: *a, k: 3}'
    assert documents.parse(text) == {'a': {'k': 1, 'l': 2}, 'b': {'k': 3, 'l': 2}}
