"""Tasks and rows: what fails, what is lost, and in which order."""

import os
import signal

import pytest

from mechanism_sim.errors import InputError, RunError
from mechanism_sim.studies.runs import Call, FileError, FinishedRows, Workers, file_errors


def odd(k):
    if k % 2:
        raise InputError(f'{k} is odd')
    return {'k': k}


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def write():
    with file_errors('here'):
        raise OSError(28, 'no space')


TASKS = [Call(str(k), odd, (k,)) for k in range(4)]


@pytest.mark.parametrize('count', [1, 2])
def test_rows_of_tasks_that_fail_hold_the_reason(count):
    rows, shown = FinishedRows(), []
    with Workers(count) as workers:
        found = workers.do(TASKS, rows, lambda *x: shown.append(x))
        assert workers.do([], rows) is found
        with pytest.raises(InputError, match='1 is odd'):
            workers.do_all(TASKS)
        assert workers.do_all([TASKS[2], TASKS[0]]) == [
            {'k': 2, 'status': 'done'}, {'k': 0, 'status': 'done'},
        ]  # fmt: skip
    assert found == {
        '0': {'k': 0, 'status': 'done'}, '1': {'status': '1 is odd'},
        '2': {'k': 2, 'status': 'done'}, '3': {'status': '3 is odd'},
    }  # fmt: skip
    with workers:  # others are started
        assert workers.do_all(TASKS[:1]) == [found['0']]
    assert rows.failed == 2
    assert shown[-1] == (4, 2)


def test_a_process_that_dies_ends_the_study_with_a_hint():
    with Workers(1, apart=True) as workers, pytest.raises(RunError, match='--workers 1 takes'):
        workers.do([Call('0', die, ())], FinishedRows())


def test_a_file_that_cannot_be_written_fails_no_run():
    with pytest.raises(FileError, match="'here' cannot be written: no space"):
        Workers(1).do([Call('0', write, ())], FinishedRows())


@pytest.mark.parametrize(('given', 'said'), [((0,), 'at least 1'), ((2, 'tcp://x'), 'exclude')])
def test_who_works_must_be_clear(given, said):
    with pytest.raises(InputError, match=said):
        Workers(*given)
