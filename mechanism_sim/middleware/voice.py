"""What threads of Zenoh have a node say: its executor says it, for they must not wait."""

from mechanism_sim.middleware.inbox import Inbox
from mechanism_sim.middleware.logger import Logger
from mechanism_sim.middleware.session import Context


class Voice:
    """Warns by the logger of a node, in the thread that spins it."""

    def __init__(self, context: Context, logger: Logger) -> None:
        self._context, self._logger = context, logger
        self.inbox = Inbox(context, self)
        context.voices.append(self.warn)

    def warn(self, text: str) -> None:
        """Have the node warn of this; from any thread."""
        self.inbox.put(text)

    def execute(self) -> bool:
        """Say one thing; False if there is none."""
        text = self.inbox.take()
        if text is None:
            return False
        self._logger.warning(text)
        return True

    def destroy(self) -> None:
        """Say nothing any more."""
        self._context.voices.remove(self.warn)
        self.inbox.close()
