"""The guard's end of the pipes to the driver: it receives the driver's messages and sends answers."""
import contextlib
import os
import select
import signal
import time
from typing import Callable, Optional

from jaka_ros_driver.client.process_state import waits_for_processor
from jaka_ros_driver.client.stopping import DriverCondition

MOVING, IDLE, FAREWELL = b"m", b"i", b"q"
"""The driver's messages: it moves the arm; it does not; it ends in good order."""
WATCHING, STOPPING = b".", b"!"
"""The guard's answers: it watches the driver; it is stopping the arm."""
OUTLIVED = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
"""Signals that ask a process to end, and that a guard outlives: it ends with its driver, whose pipe tells it so."""
SILENCE_TIMEOUT_S = 0.25
"""Silence, s, after which a driver that moves the arm is frozen: a dozen beats (``guard_post.BEAT_PERIOD_S``)."""
STARVED_TIMEOUT_S = 1.0
"""Longest silence, s, in place of ``SILENCE_TIMEOUT_S``, where the driver lives but gets no processor time."""
ANSWER_PERIOD_S = 0.1
"""Period, s, of the answers; a guard that misses ten of them is replaced (``guard_post.ANSWER_TIMEOUT_S``)."""
_STARVED_TURN_S = 0.05
"""Time, s, that a driver which waits for the processor is granted at once, before it is looked at again."""
_HELD_UP_S = 0.1
"""Lateness, s, of this process above which the whole host may have stood still, and the driver with it."""

LogText = Callable[[str], None]


class DriverPipe:
    """The receiver of the driver's messages, and the sender of answers.

    Attributes:
        is_moving: True where the driver moves the arm, by its last message.
        is_closed: True once the pipe is closed: no message can come any more.
        has_left: True once the driver has announced that it ends in good order.
        driver_process: The driver's process id.
    """

    def __init__(self, words: int, answers: int, driver: int, is_moving: bool) -> None:
        """Take the ends of the pipes.

        words, answers: file descriptors. driver: its process id. is_moving: it moves the arm already.
        """
        self._words = words
        self._answers = answers
        self.driver_process = driver
        self._received_at = time.monotonic()
        self._answered_at = -ANSWER_PERIOD_S
        self.is_moving = is_moving
        self.is_closed = False
        self.has_left = False
        self._answer = WATCHING

    def fileno(self) -> int:
        """Return the descriptor of the messages, for ``select``."""
        return self._words

    @property
    def is_over(self) -> bool:
        """True where the driver has ended, in good order or not."""
        return self.is_closed or self.has_left

    def wait(self, timeout: Optional[float]) -> bool:
        """Wait for a message, at most ``timeout`` s; return False where none came."""
        if not select.select([self], [], [], timeout)[0]:
            return False
        self.read()
        return True

    def read(self) -> None:
        """Read the messages that have come, and answer."""
        words = os.read(self._words, 4096)
        now = time.monotonic()
        self.is_closed = not words
        if self.is_closed:
            return
        self._received_at = now
        self.has_left = self.has_left or FAREWELL in words
        self.is_moving = words[-1:] == MOVING
        if now - self._answered_at >= ANSWER_PERIOD_S:
            self._send_answer(now)

    def answer(self, answer: bytes) -> None:
        """Answer this from now on, first at once, so that a driver that was frozen learns what was done."""
        self._answer = answer
        self._send_answer(time.monotonic())

    def _send_answer(self, now: float) -> None:
        if not select.select([], [self._answers], [], 0.0)[1]:
            return
        self._answered_at = now
        with contextlib.suppress(OSError):  # the driver has just died; the other pipe shows that
            os.write(self._answers, self._answer)

    def wait_for_silence(self) -> None:
        """Wait until the driver has ended, or is silent while it moves the arm."""
        limit = SILENCE_TIMEOUT_S
        was_held_up = False
        while not self.is_over:
            asked_at = time.monotonic()
            patience = max(0.0, self._received_at + limit - asked_at)
            if self.wait(patience if self.is_moving else None):
                limit = SILENCE_TIMEOUT_S
                was_held_up = False
                continue
            late = time.monotonic() - asked_at - patience
            if late > _HELD_UP_S and not was_held_up:
                was_held_up = True  # perhaps the driver was, too; it gets another chance to speak
                limit += late + SILENCE_TIMEOUT_S
            elif limit < STARVED_TIMEOUT_S and waits_for_processor(self.driver_process):
                limit = min(limit + _STARVED_TURN_S, STARVED_TIMEOUT_S)
            else:
                return

    def driver(self) -> DriverCondition:
        """Return what is known of the driver now."""
        if self.has_left:
            return DriverCondition.BACK
        if self.is_closed:
            return DriverCondition.DEAD
        is_back = time.monotonic() - self._received_at < SILENCE_TIMEOUT_S
        return DriverCondition.BACK if is_back else DriverCondition.SILENT

    def end_driver(self, log: LogText) -> None:
        """Kill the driver if it is still silent. It must still be the parent, or its id may be another process's."""
        if self.wait(0.0):
            return
        if os.getppid() != self.driver_process:
            log("the controller turns the guard away, and process %d is not the driver any more" % self.driver_process)
            return
        log("the controller turns the guard away while the frozen driver is connected: killing the driver, process %d"
            % self.driver_process)
        try:
            os.kill(self.driver_process, signal.SIGKILL)
        except OSError as error:
            log("the driver cannot be killed: %s" % error)
