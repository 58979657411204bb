"""The programs: ``mechanism-sim``, ``python -m mechanism_sim``, executables of the nodes."""

import atexit
import gc
import os
import sys
import threading
from pathlib import PurePath

from mechanism_sim import ending
from ros_interfaces.streams import open_streams

_GARBAGE = 10_000
"""Objects between two looks for garbage: of the usual 700 a twentieth of a short command is."""


def main() -> None:
    """The command line."""
    open_streams()
    ending.begin()
    ending.one_thread()
    gc.set_threshold(_GARBAGE, 10, 10)
    from mechanism_sim.cli import main as command  # noqa: PLC0415 - a signal may come meanwhile

    try:
        command()
    except SystemExit as ended:
        code = ended.code or 0
        others = {*threading.enumerate()} - {threading.main_thread()}
        if isinstance(code, int) and all(thread.daemon for thread in others):
            # All is said and in order, and to take down what was imported takes long.
            atexit._run_exitfuncs()
            sys.stdout.flush()
            os._exit(code)
        raise


def node() -> None:
    """A node, by the name of the executable: ``linkage`` is ``mechanism-sim node linkage``."""
    sys.argv[1:1] = ['node', PurePath(sys.argv[0]).stem]
    main()


if __name__ == '__main__':
    main()
