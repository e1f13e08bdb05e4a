"""The base class of periodic tasks in the client's thread."""
from typing import Optional


class LoopTask:
    """A periodic task of the client's thread; see ``ArmClient.add_task``."""

    def due(self) -> Optional[float]:
        """Return when ``run`` is due, monotonic time, s; None while it is not."""
        raise NotImplementedError

    def run(self, now: float) -> None:
        """Run the task. It must not block."""
        raise NotImplementedError
