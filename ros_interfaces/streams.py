"""Standard streams of a program: closed, full, or without umlauts."""

import io
import os
import sys


def open_streams() -> None:
    """Open those that are closed as if nothing were read from them, or read what they are told.

    Python has None in their place, and the next file that is opened gets their number.
    """
    for name, mode in (('stdin', 'r'), ('stdout', 'w'), ('stderr', 'w')):  # in this order
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding='utf-8'))  # noqa: SIM115 - to the end
    if isinstance(sys.stdout, io.TextIOWrapper):  # one without umlauts gets them as \xfc
        sys.stdout.reconfigure(errors='backslashreplace')


def mute_output() -> None:
    """Redirect an output that is closed or full: Python would write to it again at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
