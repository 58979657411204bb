"""Running nodes in this process, until they are done or are ended."""

from __future__ import annotations

import argparse
import ctypes
import gc
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from mechanism_sim import process_exit
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.nodes.arguments import Parser, split_ros_args
from mechanism_sim.nodes.described_node import DescribedNode
from mechanism_sim.nodes.middleware import (
    InvalidQosOverridesError,
    MiddlewareError,
    Parameter,
    ParameterException,
    SingleThreadedExecutor,
    init,
    leave,
    log_end,
    ok,
    remove_ros_args,
)
from mechanism_sim.terminal import print_error
from ros_interfaces.names import InvalidNameError

PATIENCE, _PATIENCE_AFTER_INTERRUPT, _PATIENCE_AFTER_FAILURE = 60.0, 0.5, 1.0
"""[s] that others get to take in what was published: at the end of a run, after a signal, and
those in this process after another has failed.
"""

_MALLOPT = {-3: 32 << 20, -1: 64 << 20}
"""[B] of glibc's M_MMAP_THRESHOLD, its largest, and M_TRIM_THRESHOLD."""


def run_nodes(
    make: Callable[[], Sequence[DescribedNode]],
    running: Callable[[], bool] | None = None,
    ros_args: Sequence[str] = (),
    stop: Callable[[int], None] | None = None,
) -> int:
    """Make nodes, run them until all are done, and destroy them in order.

    Parameters
    ----------
    make : function that makes the nodes, called after joining the network
    running : condition to continue, polled at 10 Hz; default: until all nodes are done
    ros_args : ``--ros-args ...``: names, remaps and parameters in the syntax of ROS
    stop : callback with the exit code at an early end, before leaving the network

    Returns
    -------
    Exit code: 0 done, 1 failed, 2 bad input, 130 interrupted. Errors are printed as one sentence.
    """
    nodes: list[DescribedNode] = []
    asked_to_end: list[int] = []
    leaving: list[bool] = []
    executors: list[SingleThreadedExecutor] = []

    def end(number: int, frame: Any) -> None:
        first = not asked_to_end
        asked_to_end.append(number)
        if not leaving and not (nodes and first):
            return process_exit.interrupt(number, frame)
        # An exception here could be raised, and be lost, in the middle of the middleware.
        process_exit.notice()
        if leaving and first:
            process_exit.later(_PATIENCE_AFTER_INTERRUPT, process_exit.quit_now)
        for executor in executors:
            # Wake the executor if it waits for messages.
            executor.wake()
        return None

    code = 0
    with _signals_to(end):
        try:
            init(list(ros_args))
            executor = SingleThreadedExecutor()
            executors.append(executor)
            nodes += make()
            for node in nodes:
                executor.add_node(node)
                node.name_strangers()
            if any(node.keeps for node in nodes):
                process_exit.allow(PATIENCE)
            gc.freeze()  # objects until now are permanent: excluded from garbage collection
            _keep_memory()
            while not asked_to_end and ok():
                if not (running() if running else not all(node.done for node in nodes)):
                    break
                executor.spin_once(timeout_sec=0.1)
        except KeyboardInterrupt:
            pass
        except (
            InputError,
            ParameterException,
            InvalidQosOverridesError,
            InvalidNameError,
        ) as error:
            code = _tell(nodes, error, 2)
        except (RunError, MiddlewareError) as error:
            code = _tell(nodes, error, 2 if isinstance(error, ValueError) else 1)
            for executor in executors:
                _keep(executor, nodes)
        finally:
            leaving.append(True)
            code = code or (process_exit.INTERRUPTED if asked_to_end else 0)
            if code and stop:
                stop(code)
            try:
                leave(nodes, _PATIENCE_AFTER_INTERRUPT if asked_to_end else PATIENCE)
            except MiddlewareError as error:
                code = code or print_error(error, 1)
            process_exit.allow()
    return code or (process_exit.INTERRUPTED if asked_to_end else 0)


def _keep_memory() -> None:
    """Let glibc keep freed memory, which pieces of motion would otherwise map again."""
    if mallopt := getattr(ctypes.CDLL(None), 'mallopt', None):
        for option, size in _MALLOPT.items():
            mallopt(option, size)


def _tell(nodes: Sequence[DescribedNode], error: Exception, code: int) -> int:
    """Print and log the reason of the end of a node; returns the exit code."""
    sayer = [n for n in nodes if str(error).startswith(f'{n.get_name()}: ')] or nodes
    if sayer and ok():
        log_end(sayer[0], str(error))
    return print_error(error, code)


@contextmanager
def _signals_to(handler: Callable[[int, Any], None]) -> Iterator[None]:
    """Handle signals, also SIGINT in the background, which shells ignore."""
    before = [signal.signal(number, handler) for number in process_exit.SIGNALS]
    try:
        yield
    finally:
        for number, usual in zip(process_exit.SIGNALS, before, strict=True):
            signal.signal(number, usual or signal.SIG_DFL)


def report_end(name: str, code: int, bag: Path | None = None) -> int:
    """Print the reason of a failed process unless it did; returns the exit code of this one.

    Parameters
    ----------
    bag : what the run is recorded in
    """
    if code < 0:
        kept = ''
        if bag and bag.is_file() and bag.stat().st_size:
            closed = f"; 'mechanism-sim bag recover {bag}' closes what it has recorded"
            kept = closed if name == 'recorder' else f'; what is recorded is in {bag}'
        said = f"'{name}' was killed by signal {-code}; the run ends{kept}"
        return print_error(RunError(said), 1)
    if code == process_exit.INTERRUPTED:
        return process_exit.report_signal(f"'{name}' was interrupted; the run ends")
    return code


def _keep(executor: SingleThreadedExecutor, nodes: Sequence[DescribedNode]) -> None:
    """Let recording nodes store messages published before a failure."""
    until = time.monotonic() + _PATIENCE_AFTER_FAILURE
    for node in nodes:
        if not node.keeps:
            executor.remove_node(node)
    with suppress(RunError, MiddlewareError):  # failures of partners have been printed
        while executor.get_nodes() and time.monotonic() < until:
            executor.spin_once(timeout_sec=0.1)


def main_of(node: Callable[[list[Parameter]], Any], args: Sequence[str] | None = None) -> None:
    """The main function of a node's executable: options become parameters of the node.

    Those after ``--ros-args``, such as ``-p scene:=NAME -r __ns:=/left``, are read as by any node
    of ROS.
    """
    parser = Parser(description=(node.__doc__ or '').strip().splitlines()[0])
    _add_node_options(parser)
    own, ros_args = split_ros_args(sys.argv[1:] if args is None else args)
    try:
        options, rest = parser.parse_known_args(own)
        if rest:
            parser.refuse(rest)
        remove_ros_args(ros_args)
    except (InputError, RuntimeError) as error:
        sys.exit(print_error(error, 2))

    def make() -> list[Any]:
        parameters = parameters_of(options)
        made = node(parameters)
        strange = [p.name for p in parameters if not made.has_parameter(p.name)]
        if strange:
            name = made.get_name()
            made.destroy_node()
            option = 'set' if strange[0] == 'overrides' else strange[0].replace('_', '-')
            raise InputError(f'--{option} does not apply to the node {name}')
        return [made]

    code = run_nodes(make, ros_args=ros_args)
    sys.exit(process_exit.report_signal() if code == process_exit.INTERRUPTED else code)


def _add_node_options(parser: argparse.ArgumentParser) -> None:
    """Add the options common to all nodes."""
    parser.add_argument('--scene', help='scene of the package, or path to a YAML file')
    parser.add_argument(
        '--set', action='append', metavar='PATH=VALUE', dest='overrides', help='override a value'
    )
    parser.add_argument('--duration', type=float, help='length of the run [s]')
    parser.add_argument('--partners', help='the other nodes of the run, separated by commas')
    parser.add_argument('--listeners', help='others that must receive all messages, likewise')
    parser.add_argument('--partner-timeout', type=float, help='how long to wait for them [s]')
    parser.add_argument('--lead', type=float, help='crank_drive: credit ahead of the slowest [s]')
    parser.add_argument(
        '--realtime-factor', type=float, help='crank_drive: simulated seconds per second'
    )
    parser.add_argument('--paused', action='store_true', help='crank_drive: begin paused')
    parser.add_argument('--hold', action='store_true', help='crank_drive: pause at the end')
    parser.add_argument('--force-scale', type=float, help='display: length of arrows [m/N]')
    parser.add_argument(
        '--clearance-magnification', type=float, help='display: magnification of clearances'
    )
    parser.add_argument('--port', type=int, help='view: of its page on this machine; 0: any')
    parser.add_argument('--open', action='store_true', help='view: open a browser')
    parser.add_argument('--file', help='recorder: the bag to write')
    parser.add_argument('--overwrite', action='store_true', help='recorder: replace the bag')


def parameters_of(options: argparse.Namespace) -> list[Parameter]:
    """Parameters from options of the command line."""
    given = {k: x for k, x in vars(options).items() if x is not None and x is not False}
    return [Parameter(key, value=value) for key, value in given.items()]
