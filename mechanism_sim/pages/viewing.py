"""View of a run until it is ended, with a run of its own that ends with it."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Sequence

from mechanism_sim import process_exit
from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.nodes.process import report_end, run_nodes
from mechanism_sim.pages.view import ViewNode, print_address


def view(
    parameters: Sequence[Parameter] = (),
    run: Sequence[str] = (),
    ros_args: Sequence[str] = (),
    opened: Callable[[str], None] | None = None,
) -> int:
    """Show a run until the view is ended.

    Parameters
    ----------
    run : arguments of ``mechanism-sim run``: a run of its own, which ends with the view
    opened : callback with the address of the page, instead of printing it

    Returns
    -------
    Exit code: that of the run if it ends first, and 0 if the view is ended.
    """
    signal.signal(signal.SIGTSTP, signal.SIG_IGN)  # a stopped process would block publishers
    runs: list[subprocess.Popen[bytes]] = []

    def make() -> list[ViewNode]:
        node = ViewNode(parameters, opened or print_address, bool(run))
        if run:  # now that there is a network to join
            command = [sys.executable, '-m', 'mechanism_sim', 'run', *run, '--json']
            runs.append(process_exit.start(command, stdout=subprocess.DEVNULL))
        return [node]

    def stop(_code: int) -> None:
        for process in runs:
            process.terminate()

    code = run_nodes(make, lambda: all(r.poll() is None for r in runs), ros_args, stop)
    ended = [r.wait() for r in runs]
    if code == process_exit.INTERRUPTED:
        return 0
    return code or (report_end('run', ended[0]) if ended else 0)
