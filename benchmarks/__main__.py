"""The program: ``python -m benchmarks NAME...``."""

from mechanism_sim import ending


def main() -> None:
    """The command line."""
    ending.begin()
    from benchmarks.command import main as command  # noqa: PLC0415 - a signal may come meanwhile

    command()


if __name__ == '__main__':
    main()
