"""Standard streams of a program that was begun with some of them closed."""

import os
import sys


def open_streams() -> None:
    """Open those that are closed as if nothing were read from them, or read what they are told.

    Python has None in their place, and the next file that is opened gets their number.
    """
    for name, mode in (('stdin', 'r'), ('stdout', 'w'), ('stderr', 'w')):  # in this order
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding='utf-8'))  # noqa: SIM115 - to the end
