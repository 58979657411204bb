"""The program: ``python -m test.hard``."""

import sys
from pathlib import Path

from mechanism_sim import process_exit

_ROOT = Path(__file__).resolve().parents[2]


def main() -> None:
    """The command line."""
    process_exit.begin()
    # Cases compare with the formulas of the books, which pytest finds by its own setting.
    sys.path.append(str(_ROOT / 'docs' / 'books'))
    from test.hard.command import main as command  # noqa: PLC0415 - a signal may come meanwhile

    command()


if __name__ == '__main__':
    main()
