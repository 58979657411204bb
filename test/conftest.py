"""Settings and fixtures of all tests."""

from __future__ import annotations

import gc
import math
import os
import signal
import sys

# Before NumPy is loaded, and for all processes that tests start: threads of BLAS in several
# processes on few cores wait for each other, ten times as long as the work takes.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
# Each of hundreds of processes would compile all modules anew, and pytest all tests.
os.environ.pop('PYTHONDONTWRITEBYTECODE', None)
# This process reads and compares without ROS; what runs on rclpy runs in processes of its own.
os.environ.setdefault('MECHANISM_SIM_MIDDLEWARE', 'zenoh')

from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import running
import sampling
from browsing import Tab, browsing
from hypothesis import settings
from middleware_network import Network, joined

from mechanism_sim.nodes import middleware
from mechanism_sim.numerics import code_cache, compiled, kernels

sys.dont_write_bytecode = False
# Wall time says nothing on a shared machine, and a test that fails must fail again.
EXAMPLES = int(os.environ.get('FUZZ_EXAMPLES', '30'))  # make test-all takes more
settings.register_profile('house', deadline=None, derandomize=True, max_examples=EXAMPLES)
settings.load_profile('house')

# Tests compile more than a user's cache holds, and open theirs once in a worker: heyoka's folder
# with its usual limit. To compile all anew would be most of the work of many tests.
code_cache.FOLDER, code_cache.LIMIT = 'heyoka', 20 * 2**30
# LLVM takes seconds of CPU in each worker, more than kernels cost here as they are.
kernels.COMPILING = math.inf


NEEDS = {'network': 'network', 'backend': 'network', 'ros': 'network', 'browser': 'browser'}
"""Marks of tests by the fixtures they use; what starts nodes by commands is marked itself."""


@pytest.hookimpl(tryfirst=True)  # before pytest collects
def pytest_collection(session: pytest.Session) -> None:
    """Begin with other modules than other workers: to rewrite the assertions of all takes long.

    Who comes to a module later finds that done.
    """
    count = int(os.environ.get('PYTEST_XDIST_WORKER_COUNT', '1'))
    if count == 1 or session.config.args != session.config.getini('testpaths'):
        return
    own = int(os.environ['PYTEST_XDIST_WORKER'].removeprefix('gw'))
    said_later = suppress(Exception, pytest.skip.Exception)  # when it is collected
    for path in sorted(Path(__file__).parent.glob('*/test_*.py'))[own::count]:
        if not path.with_name('__init__.py').exists():
            with pytest.MonkeyPatch.context() as patch, said_later:
                patch.syspath_prepend(path.parent)
                import_module(path.stem)


@pytest.hookimpl(tryfirst=True)  # before pytest chooses by marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Of broad tests a sample is quick; what needs a network or a browser is marked so."""
    sampling.mark(items)
    for item in items:
        for mark in {NEEDS[x] for x in getattr(item, 'fixturenames', ()) if x in NEEDS}:
            item.add_marker(mark)


_optimised: set[tuple[Path, str]] = set()


def _is_as_users(item: pytest.Item) -> bool:
    """True if runs of this process are compared with those of others, or with recorded bits.

    On a network of its own (the fixture) nodes are in this process, unless a test says otherwise.
    """
    alone = 'network' in getattr(item, 'fixturenames', ())
    return any(map(item.get_closest_marker, ['optimised'] if alone else ['network', 'optimised']))


def _parts(item: pytest.Item) -> set[tuple[Path, str]]:
    """A test, and what it shares with others of its module: fixtures that are made once."""
    module = item.nodeid.partition('::')[0]
    found = item._fixtureinfo.name2fixturedefs.items()
    shared = {n for n, (*_, x) in found if x.scope != 'function' and x.baseid == module}
    return {(item.path, name) for name in (item.name, *shared)}


def pytest_collection_finish(session: pytest.Session) -> None:
    """Thousands of tests stay until the end: not looked through again whenever garbage is."""
    _optimised.update(*map(_parts, filter(_is_as_users, session.items)))
    gc.freeze()
    gc.set_threshold(20_000)  # what a test makes is mostly gone by then


@pytest.hookimpl(tryfirst=True)  # before fixtures of modules
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Quick tests, of short runs, do without LLVM's optimisation, unless slow ones run, too."""
    quick = item.config.option.markexpr == 'not slow' and _optimised.isdisjoint(_parts(item))
    compiled.OPTIMISATION = 0 if quick else 3


@pytest.fixture
def compiled_kernels() -> Iterator[Callable[[], None]]:
    """Lets kernels be compiled, for one test."""
    before = {k: k.run for k in kernels._KERNELS}
    yield kernels.compile_kernels
    for k in kernels._KERNELS:  # others may have been imported meanwhile
        k.run = before.get(k, k.function)


@pytest.fixture
def plain_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels are functions of Python, whatever was compiled before: these can be replaced."""
    monkeypatch.setattr(kernels, '_spent', -math.inf)
    for k in kernels._KERNELS:
        monkeypatch.setattr(k, 'run', k.function)
        monkeypatch.setattr(k, 'spent', -math.inf)


ENDING = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}


@pytest.fixture(autouse=True)
def signals() -> None:
    """No signal is ignored, whoever started the tests and whatever a command did in this process.

    Processes inherit what is ignored: those of later tests could not be ended.
    """
    for number, usual in ENDING.items():
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)


@pytest.fixture(scope='module', params=running.BACKENDS)
def backend(request: pytest.FixtureRequest) -> Iterator[str]:
    """The middleware of the processes that a test starts: each that is found, one by one."""
    if request.param == 'rclpy' and not running.ros_found():
        pytest.skip('no ROS 2 here with this package built for it (docs/ros2.md)')
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(running, 'middleware', request.param)
        yield request.param


@pytest.fixture(scope='module')
def network() -> Iterator[Network]:
    """This process on a network of its own, for all tests of a module."""
    with joined() as network:
        yield network


@pytest.fixture
def node(network: Network) -> Iterator[middleware.Node]:  # noqa: ARG001
    """A node of this process."""
    node = middleware.Node('node')
    yield node
    node.destroy_node()


@pytest.fixture(scope='module')
def browser() -> Iterator[Any]:
    """A headless browser; not longer than a module: its event loop would be in others' way."""
    with browsing() as found:
        if found is None:
            pytest.skip('no Chromium here: install the package chromium')
        yield found


@pytest.fixture
def tab(browser: Any, tmp_path: Path) -> Iterator[Tab]:
    """A fresh page of 1200 by 800 pixels, without anything kept of others."""
    context = browser.new_context(viewport={'width': 1200, 'height': 800})
    yield Tab(context.new_page(), tmp_path)
    context.close()
