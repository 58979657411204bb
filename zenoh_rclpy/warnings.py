"""Warnings from Zenoh's threads, logged by the executor of a node: those threads must not wait."""

from zenoh_rclpy.inbox import Inbox
from zenoh_rclpy.logger import Logger
from zenoh_rclpy.session import Context


class Warnings:
    """Queue of warnings for the logger of a node."""

    def __init__(self, context: Context, logger: Logger) -> None:
        self._context, self._logger = context, logger
        self.inbox = Inbox(context, self)
        context.warn_functions.append(self.put)

    def put(self, text: str) -> None:
        """Have the node log a warning; from any thread."""
        self.inbox.put(text)

    def execute(self) -> bool:
        """Log one warning; False if none waits."""
        text = self.inbox.take()
        if text is None:
            return False
        self._logger.warning(text)
        return True

    def destroy(self) -> None:
        """Log nothing any more."""
        self._context.warn_functions.remove(self.put)
        self.inbox.close()
