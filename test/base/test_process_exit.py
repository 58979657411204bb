"""Ends of programs: at signals, at any moment, and with the parent process. Real processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest
from middleware_network import eventually
from running import FOLLOW, TIMEOUT, environment

from mechanism_sim import process_exit

PROGRAM = """
import atexit, hashlib, os, sys, time
from mechanism_sim import process_exit
process_exit.begin()

def ready():
    print('ready', flush=True)

def wait():
    ready()
    time.sleep(300)

def held():
    with process_exit.signals_held():
        ready()
        end = time.monotonic() + 0.1
        while time.monotonic() < end:
            pass
        print('started', flush=True)
    time.sleep(300)

class Finalised:
    def __del__(self):
        wait()

try:
    with process_exit.working():
        {body}
except KeyboardInterrupt:
    sys.exit(process_exit.report_signal())
"""

MOMENTS = {
    'at work': 'wait()',
    'at work in C, for which no handler is called': (
        "ready(); hashlib.pbkdf2_hmac('sha256', b'', b'', 10**9)"
    ),
    'in an import that makes another error of it': (
        'sys.path.insert(0, sys.argv[1]); import odd; time.sleep(300)'
    ),
    'where Python cannot raise anything': 'Finalised(); time.sleep(300)',
    'when all is done, at exit': 'atexit.register(wait)',
    'while a process is being started': 'held()',
}  # fmt: skip

ODD = """
import __main__, time
try:
    __main__.ready()
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        pass
except KeyboardInterrupt:
    raise AttributeError('as heyoka does') from None
"""


@pytest.mark.sample(2)
@pytest.mark.parametrize('moment', MOMENTS)
def test_a_signal_ends_a_program_with_one_sentence(tmp_path, moment):
    (tmp_path / 'odd.py').write_text(ODD, encoding='utf-8')
    text = PROGRAM.format(body=MOMENTS[moment])
    for number in process_exit.SIGNALS:
        with subprocess.Popen(
            [sys.executable, '-c', FOLLOW + text, str(tmp_path)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        ) as process:  # fmt: skip
            assert process.stdout is not None
            assert process.stdout.readline() == 'ready\n'
            process.send_signal(number)
            started, said = process.communicate(timeout=TIMEOUT)
        assert (process.returncode, said) == (130, 'mechanism-sim: interrupted\n')
        assert (started == 'started\n') == ('started' in moment)


def test_a_program_under_nohup_outlives_its_terminal():
    text = PROGRAM.format(body='import signal; os.kill(os.getpid(), signal.SIGHUP)')
    nohup = ['sh', '-c', 'trap \'\' HUP; exec "$@"', 'sh']
    done = subprocess.run([*nohup, sys.executable, '-c', text], timeout=TIMEOUT, check=False)
    assert done.returncode == 0


@pytest.mark.parametrize(
    'work', ['wait()', MOMENTS['at work in C, for which no handler is called']]
)
def test_a_signal_says_what_is_kept_of_work(work):
    """As of a search that compiles, where Python raises no KeyboardInterrupt for a while."""
    text = PROGRAM.format(
        body="process_exit.say_when_interrupted(lambda: 'interrupted after 2 runs, \\udcff'); "
        + work
    )
    with subprocess.Popen(
        [sys.executable, '-c', FOLLOW + text],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == 'ready\n'
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, said) == (
        130,
        'mechanism-sim: interrupted after 2 runs, \\udcff\n',
    )


def handles(pid: int, number: int) -> bool:
    """True if a process has a handler of a signal."""
    with open(f'/proc/{pid}/status', encoding='utf-8') as status:
        return bool(int(status.read().split('SigCgt:')[1].split()[0], 16) >> (number - 1) & 1)


@pytest.mark.sample(1)
@pytest.mark.parametrize(('number', 'after'), [(signal.SIGTERM, 0.0), (signal.SIGINT, 0.5)])
def test_a_command_that_still_imports_ends_so_too(number, after):
    """At its first line, and while it imports what runs machines, or soon after."""
    text = f"{FOLLOW}import runpy; runpy.run_module('mechanism_sim', run_name='__main__')"
    args = [sys.executable, '-c', text, 'solve', 'four_bar_clearance', '--revolutions', '1e6']
    with subprocess.Popen(args, env=environment(), stderr=subprocess.PIPE, text=True) as process:
        while not handles(process.pid, signal.SIGTERM):
            assert process.poll() is None
        time.sleep(after)
        process.send_signal(number)
        _, said = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, said) == (130, 'mechanism-sim: interrupted\n')


def test_a_command_that_is_done_ends_at_once_but_for_who_still_works():
    """No teardown of imported modules; exit functions run, threads are waited for."""
    text = (
        f'{FOLLOW}import atexit, sys, threading; from mechanism_sim.__main__ import main\n'
        'class Kept:\n'
        '    def __del__(self): print("taken down")\n'
        'kept, late = Kept(), "late" in sys.argv[2:]\n'
        'atexit.register(print, "exit function")\n'
        'sys.stderr.write("half a line")\n'
        'def work(): threading.main_thread().join(); print("worked")\n'
        'if late: threading.Thread(target=work).start(); del sys.argv[2:]\n'
        'main()\n'
    )
    said = [
        subprocess.run(
            [sys.executable, '-c', text, '--version', *late],
            capture_output=True, text=True, check=True, timeout=TIMEOUT,
        ).stdout.split('\n')[1:]
        for late in ((), ('late',))
    ]  # fmt: skip
    assert said[0] == ['exit function', '']
    assert said[1][:2] == ['worked', 'exit function']


@pytest.mark.parametrize('how', ['run_module', 'main', 'profile'])
def test_a_program_that_runs_a_command_goes_on(how):
    """As notebooks, measurements of coverage, and profilers, which say what they found."""
    ways = {
        'run_module': 'import runpy\n'
        "try: runpy.run_module('mechanism_sim', run_name='__main__')\n"
        'except SystemExit as ended: print("function calls", ended.code)',
        'main': 'from mechanism_sim.__main__ import main\n'
        'def call():\n    main()\n'
        'try: call()\n'
        'except SystemExit as ended: print("function calls", ended.code)',
    }
    command = ['-c', ways[how]] if how in ways else ['-m', 'cProfile', '-m', 'mechanism_sim']
    done = subprocess.run(
        [sys.executable, *command, '--version'],
        capture_output=True, text=True, check=True, timeout=TIMEOUT,
    )  # fmt: skip
    assert 'function calls' in done.stdout


def test_a_program_whose_parent_is_gone_before_it_looks_ends_without_a_word():
    env = {**os.environ, process_exit.PARENT: str(os.getppid())}  # not who starts it
    done = subprocess.run(
        [sys.executable, '-c', PROGRAM.format(body='time.sleep(300)')],
        env=env, capture_output=True, text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (130, '')


def test_a_signal_that_somebody_else_handles_ends_nothing():
    """A timer's of the processor ended the process that it was to interrupt."""
    text = """
import os, select, signal
from mechanism_sim import process_exit
process_exit._patience = 0.0
process_exit.begin()
signal.signal(signal.SIGUSR1, lambda *_: None)
for _ in range(3):  # the next is taken out only if the one before was passed over
    os.kill(os.getpid(), signal.SIGUSR1)
    while select.select([process_exit.signals()], [], [], 0.0)[0]:
        pass
print('goes on')
"""
    done = subprocess.run(
        [sys.executable, '-c', text], capture_output=True, text=True, timeout=TIMEOUT, check=False
    )
    assert (done.returncode, done.stdout) == (0, 'goes on\n')


def runs(pid: int) -> bool:
    """True if a process exists and has not ended."""
    try:
        with open(f'/proc/{pid}/stat', encoding='utf-8') as stat:
            return stat.read().rpartition(')')[2].split()[0] != 'Z'
    except OSError:
        return False


def test_a_worker_ends_with_the_process_that_was_killed():
    text = (
        FOLLOW + 'import os, time\nfrom mechanism_sim import process_exit\n'
        'with process_exit.workers(1) as pool:\n'
        '    print(pool.submit(os.getpid).result(), flush=True)\n'
        '    time.sleep(300)\n'
    )
    args = [sys.executable, '-c', text]
    with subprocess.Popen(args, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        worker = int(process.stdout.readline())
        process.kill()
    assert eventually(lambda: not runs(worker))
