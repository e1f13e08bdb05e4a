"""One guard process as the driver sees it: the process and the pipes to and from it."""
import contextlib
import io
import os
import select
import signal
import subprocess
import threading
from typing import List, Optional, Tuple

from jaka_ros_driver.client.driver_pipe import MOVING, OUTLIVED, STOPPING
from jaka_ros_driver.client.process_state import waits_for_processor

BEAT_PERIOD_S = 0.02
"""Period, s, of the beats: a dozen must fail to come before a driver counts as frozen (``driver_pipe``)."""
ANSWER_TIMEOUT_S = 1.0
"""Silence, s, of a guard after which it is replaced."""
STARVED_ANSWER_TIMEOUT_S = 5.0
"""Silence, s, in place of ``ANSWER_TIMEOUT_S``, where the guard lives but gets no processor time."""
START_TIMEOUT_S = 10.0
"""Longest time, s, until the first answer: Python needs some time to start, more on a busy host."""
_READ_BYTES = 4096
"""Bytes of one read; an answer is one byte, and only the last one counts."""


class GuardPost:
    """One guard process and the pipes to it.

    The pipes are made first: messages wait in them until the process runs.

    Attributes:
        has_answered: True once it has answered.
        has_ended: True where it does not run any more, or could not be started.
        is_stopping: True where it is stopping the arm, by its last answer.
        began_at: When it was made, monotonic time, s.
        received_at: When it answered last, or was made, monotonic time, s.
    """

    def __init__(self, now: float) -> None:
        """Create the pipes; raise OSError where that is not possible."""
        self.has_answered = False
        self.has_ended = False
        self.is_stopping = False
        self.began_at = self.received_at = now
        self._process: Optional[subprocess.Popen[bytes]] = None
        self._is_given_up = False
        self._lock = threading.Lock()
        self._its_words, self._words = _pipe()
        try:
            self._answers, self._its_answers = _pipe()
        except OSError:
            self._its_words.close()
            self._words.close()
            raise
        os.set_blocking(self._words.fileno(), False)
        os.set_blocking(self._answers.fileno(), False)

    def launch(self, command: List[str]) -> None:
        """Start the process; raise OSError where that is not possible.

        It has a session of its own, so that a signal to the driver's process group does not end it first. The signals
        that it is to outlive wait for it until it ignores them, for Python needs some time to start.
        """
        before = signal.pthread_sigmask(signal.SIG_BLOCK, OUTLIVED)
        try:
            process = subprocess.Popen(command, stdin=self._its_words, stdout=self._its_answers,
                                       start_new_session=True)
        finally:  # where the start failed, the closed pipes tell it
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            self._its_words.close()
            self._its_answers.close()
        with self._lock:
            self._process = process
            if self._is_given_up:
                process.kill()

    def send(self, word: bytes) -> None:
        """Send a message; never wait. A guard that does not read is noticed by its silence."""
        with contextlib.suppress(OSError):
            self._words.write(word)

    def listen(self, now: float) -> bool:
        """Read the answers that have come; never wait. Return True where the guard has just begun to stop the arm."""
        answers = self._answers.read(_READ_BYTES)
        if answers is None:
            return False
        if not answers:
            self.has_ended = True
            return False
        has_begun = STOPPING in answers and not self.is_stopping
        self.has_answered = True
        self.is_stopping = answers[-1:] == STOPPING
        self.received_at = now
        return has_begun

    def silence_limit(self) -> float:
        """Return the longest silence that is allowed to the guard now, s."""
        if not self.has_answered:
            return START_TIMEOUT_S
        process = self._process
        return STARVED_ANSWER_TIMEOUT_S if process and waits_for_processor(process.pid) else ANSWER_TIMEOUT_S

    def answers_now(self) -> bool:
        """Ask the guard and wait for its answer, ``ANSWER_TIMEOUT_S`` at most. Return True also while the process
        starts.
        """
        self.listen(self.received_at)
        if not self.has_answered:
            return not self.has_ended
        for _ in range(int(ANSWER_TIMEOUT_S / BEAT_PERIOD_S)):
            self.send(MOVING)
            if select.select([self._answers], [], [], BEAT_PERIOD_S)[0]:
                self.listen(self.received_at)
                return not self.has_ended
        return False

    def kill(self) -> None:
        """Kill the process, now or as soon as it is started."""
        with self._lock, contextlib.suppress(OSError):
            self._is_given_up = True
            if self._process is not None:
                self._process.kill()

    def leave(self) -> None:
        """Close the driver's ends of the pipes."""
        self._words.close()
        self._answers.close()

    def has_exited(self, timeout: float) -> bool:
        """Wait for the end of the process, at most ``timeout`` s; return True where it has ended."""
        if self._process is not None:
            try:
                self._process.wait(timeout)
            except subprocess.TimeoutExpired:
                return False
        return True


def _pipe() -> Tuple[io.FileIO, io.FileIO]:
    reading, writing = os.pipe()
    return io.FileIO(reading, "rb"), io.FileIO(writing, "wb")
