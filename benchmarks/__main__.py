"""The program: ``python -m benchmarks NAME...``."""

from mechanism_sim import process_exit


def main() -> None:
    """The command line."""
    process_exit.begin()
    from benchmarks.command import main as command  # noqa: PLC0415 - a signal may come meanwhile

    command()


if __name__ == '__main__':
    main()
