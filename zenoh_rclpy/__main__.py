"""The program ``zros``, or ``python -m zenoh_rclpy``."""

import logging
import sys

from ros_interfaces.streams import open_streams
from zenoh_rclpy import commands


def main() -> None:
    """Run a command, and end with its exit code."""
    open_streams()
    logging.basicConfig(format='zros: %(message)s')  # notices of what waits for others
    sys.exit(commands.main())


if __name__ == '__main__':
    main()
