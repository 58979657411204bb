"""The programs: ``mechanism-sim``, ``python -m mechanism_sim``, executables of the nodes."""

import atexit
import gc
import os
import sys
import threading
from contextlib import suppress
from pathlib import PurePath
from types import FrameType

from mechanism_sim import process_exit
from ros_interfaces.streams import open_streams

_GARBAGE = 10_000
"""Objects between two looks for garbage: of the usual 700 a twentieth of a short command is."""

_CALLERS = '<module>', 'node', '_run_code', '_run_module_as_main'
"""Functions that call `main`: of executables, and of ``python -m``."""


def main() -> None:
    """The command line."""
    open_streams()
    process_exit.begin()
    process_exit.one_thread()
    gc.set_threshold(_GARBAGE, 10, 10)
    from mechanism_sim.cli import main as command  # noqa: PLC0415 - a signal may come meanwhile

    try:
        command()
    except SystemExit as ended:
        code = ended.code or 0
        others = {*threading.enumerate()} - {threading.main_thread()}
        idle = all(thread.daemon for thread in others)
        if isinstance(code, int) and idle and _is_program(sys._getframe(1)):
            # All is said and in order, and to take down what was imported takes long.
            atexit._run_exitfuncs()
            sys.stdout.flush()
            with suppress(OSError):  # nobody can be told
                sys.stderr.flush()
            os._exit(code)
        raise


def _is_program(frame: FrameType | None) -> bool:
    """False if a caller goes on after `main`: a profiler, a notebook, another program."""
    while frame is not None and frame.f_code.co_name in _CALLERS:
        frame = frame.f_back
    return frame is None


def node() -> None:
    """A node, by the name of the executable: ``linkage`` is ``mechanism-sim node linkage``."""
    sys.argv[1:1] = ['node', PurePath(sys.argv[0]).stem]
    main()


if __name__ == '__main__':
    main()
