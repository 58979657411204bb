"""Running the command line as users do: nodes in processes and on a network of their own."""

from __future__ import annotations

import contextlib
import io
import itertools
import json
import os
import resource
import socket
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from mechanism_sim import process_exit
from mechanism_sim.cli import main

ROOT = Path(__file__).parents[1]
"""The folder of the repository."""
TIMEOUT = 600.0
"""[s] for what has to happen: waited for in full only if it never does; machines may be busy."""
BACKENDS = ('zenoh', 'rclpy')
middleware = 'zenoh'
"""Of the processes that are started; the fixture `backend` sets it."""


def ros_found() -> bool:
    """True if rclpy is here, and this package built for it."""
    return all(find_spec(name) is not None for name in ('rclpy', 'mechanism_sim.msg'))


APART = {'edit', 'node', 'run', 'sweep', 'view'}
"""Commands that start processes, speak to others or take over signals."""


workers_apart = True
"""Whether workers are processes; the fixture `in_this_process` says no."""


def goes_apart(args: Sequence[str]) -> bool:
    """True if a command needs a process of its own: one with workers, too; one worker is none."""
    with_workers = '--fit' in args or args[:1] == ('sweep',)
    if with_workers:
        return workers_apart and ('--workers', '1') not in pairwise(args)
    return bool(APART.intersection(args[:1])) or tuple(args[:2]) == ('bag', 'play')


_worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0')[2:]) % 5
_ports = itertools.count(41 * os.getpid())


def free_port() -> int:
    """A TCP port nobody listens on, and none that the system gives to others before it is used.

    That is below its range for connections, and each worker has a range of its own.
    """
    for k in _ports:
        port = 12_000 + 4_000 * _worker + k % 4_000
        with socket.socket() as probe, suppress(OSError):
            probe.bind(('127.0.0.1', port))
            return port
    raise AssertionError


def one_of(count: int, values: Iterable[Any]) -> list[Any]:
    """Parameters of a test that costs much for each: of so many the first; the others are slow."""
    return [
        pytest.param(value, marks=[pytest.mark.slow] * (k % count > 0))
        for k, value in enumerate(values)
    ]


def environment() -> dict[str, str]:
    """Environment with a router port and a domain that nobody else uses."""
    port = free_port()
    return {
        **os.environ,
        'MECHANISM_SIM_MIDDLEWARE': middleware,
        'MECHANISM_SIM_ROUTER': f'tcp/127.0.0.1:{port}',
        'ROS_DOMAIN_ID': str(port % 200),
    }


def command(*args: str) -> list[str]:
    """The command line as a list of arguments."""
    return [sys.executable, '-m', 'mechanism_sim', *args]


Program = Callable[[Sequence[str]], None]


def run(
    *args: str, env: dict[str, str] | None = None, program: Program = main, refused: bool = False
) -> subprocess.CompletedProcess[str]:
    """Run a command to its end; `program` is another one than the package's, always run here.

    In this process where that makes no difference, as it makes none if the command is `refused`
    before it does anything: starting one costs more than most commands. An exception that gets
    out of it, or a warning that its user would see, fails the test. A node joins the network
    before it is refused: it has a process of its own where this one is on a network already.
    """
    joined = args[:1] == ('node',) and _on_network()
    if program is not main or (env is None and (refused or not goes_apart(args)) and not joined):
        return _here(program, args)
    return subprocess.run(
        command(*args), env=process_exit.owned(env or environment()), capture_output=True,
        text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip


def _on_network() -> bool:
    known = sys.modules.get('mechanism_sim.nodes.middleware')
    return known is not None and known.ok()


def _here(program: Program, args: Sequence[str]) -> subprocess.CompletedProcess[str]:
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter('error')
        for hidden in (DeprecationWarning, PendingDeprecationWarning, ResourceWarning):
            warnings.simplefilter('ignore', hidden)
        with pytest.raises(SystemExit) as ended:
            program(args)
    code = ended.value.code
    assert code is None or isinstance(code, int)
    return subprocess.CompletedProcess(args, code or 0, out.getvalue(), err.getvalue())


def run_json(*args: str, env: dict[str, str] | None = None, program: Program = main) -> Any:
    """Run a command with --json and give its result."""
    done = run(*args, '--json', env=env, program=program)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def start(*args: str, env: dict[str, str]) -> subprocess.Popen[str]:
    """Start a command in the background."""
    pipe = subprocess.PIPE
    return process_exit.start(command(*args), env=env, stdout=pipe, stderr=pipe, text=True)


FOLLOW = (
    f'import sys; sys.path.insert(1, {str(ROOT)!r})\n'
    f'from mechanism_sim.process_exit import follow; follow({os.getpid()})\n'
)
"""Beginning of a program that finds what is not installed, and ends with this process."""


def script(path: Path, text: str) -> Path:
    """Write a program of another process."""
    path.write_text(FOLLOW + text, encoding='utf-8')
    return path


@contextlib.contextmanager
def full_disk(left):
    """No file of this process grows beyond so many bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    sys.dont_write_bytecode = True  # Python keeps a module of which only a part was written
    resource.setrlimit(resource.RLIMIT_FSIZE, (left, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        sys.dont_write_bytecode = False
