"""The early end of a long run by Ctrl-C or SIGTERM: what was under way then is no finding."""
import signal
from types import FrameType
from typing import Optional


class EarlyEnd:
    """A watch for the first SIGINT or SIGTERM, which only sets ``number``; commands that run in this process go on.

    Attributes:
        number: The signal's number; 0 until one came.
    """

    def __init__(self) -> None:
        self.number = 0
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._take)

    def _take(self, number: int, frame: Optional[FrameType]) -> None:
        self.number = self.number or number

    @property
    def name(self) -> str:
        """The signal's name, ``SIGTERM``."""
        return signal.Signals(self.number).name

    @property
    def exit_code(self) -> int:
        """The exit code of a run that was ended early, as shells have it: neither success nor a finding."""
        return 128 + self.number
