"""A command that ends with whoever started it, even if that is killed: the run of a view."""

from __future__ import annotations

import os
import runpy
import sys
from threading import Thread


def main() -> None:
    """Run ``mechanism-sim`` with our arguments, as long as the other end of our input is open."""
    Thread(target=_end_with_input, daemon=True).start()
    runpy.run_module('mechanism_sim', run_name='__main__')


def _end_with_input() -> None:
    while os.read(sys.stdin.fileno(), 1):
        pass
    os._exit(1)


if __name__ == '__main__':
    main()
