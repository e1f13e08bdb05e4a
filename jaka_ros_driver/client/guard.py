"""The driver's side of the guard, a separate process that guard_process.py describes.

Driver and guard watch each other: a guard that has died or does not answer is replaced.
"""
import logging
import os
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from typing import Callable, List, Optional, Tuple

from jaka_ros_driver.client import guard_process
from jaka_ros_driver.client.driver_pipe import FAREWELL, IDLE, MOVING
from jaka_ros_driver.client.guard_post import ANSWER_TIMEOUT_S, BEAT_PERIOD_S, START_TIMEOUT_S, GuardPost

_LOG = logging.getLogger(__name__)

HELD_UP_S = 0.3
"""Gap, s, between two beats above which the driver itself was held up, so the guard's silence is not counted."""
_EXIT_TIMEOUT_S = 2.0
"""Longest wait, s, for a guard that is to end; one that does not is killed, unless it is stopping the arm."""
_RESTART_PERIODS_S = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
"""The pauses, s, before another guard is started, by the number of failures before.

The first starts at once, because the arm may be moving; one that always fails is not started without end.
"""


@dataclass(frozen=True)
class GuardHealth:
    """The state of the guard process.

    Attributes:
        is_alive: True while it runs and answers; False before its first answer.
        replacements: How often it had to be replaced since the start.
        last_trouble: What went wrong last, empty for nothing.
    """

    is_alive: bool
    replacements: int
    last_trouble: str


class Guard:
    """The driver's supervisor of the guard process: it starts, notifies, replaces and ends it.

    It has no thread of its own: the driver's loop calls ``beat``. The other methods may be called from any thread.
    """

    def __init__(self, host: str, command_port: int, status_port: int,
                 clock: Callable[[], float] = time.monotonic) -> None:
        """Start the guard process.

        Args:
            host: Address of the controller.
            command_port: Its command port, on which the arm is stopped.
            status_port: Its status port, on which the guard sees whether the arm has stopped.
            clock: The clock of ``beat``, s.

        Raises:
            OSError: It could not be started.
        """
        self._command = [sys.executable, "-m", guard_process.__name__, "--host", host, "--port", str(command_port),
                         "--status-port", str(status_port), "--driver", str(os.getpid())]
        self._lock = threading.Lock()
        self._word = IDLE
        self._beat_at = clock()
        self._start_at = 0.0
        self._failures = 0
        self._replacements = 0
        self._trouble = ""
        self._is_closing = False
        self._starter: Optional[threading.Thread] = None
        self._dismissed: List[GuardPost] = []
        self._post: Optional[GuardPost] = GuardPost(clock())
        self._post.launch(self._command)

    def notify(self, is_moving: bool) -> None:
        """Notify the guard at once whether the driver moves the arm, before the first byte of a motion is sent."""
        with self._lock:
            self._word = MOVING if is_moving else IDLE
            if self._post is not None:
                self._post.send(self._word)

    def beat(self, now: float) -> None:
        """Send the guard the driver's heartbeat, and check that the guard answers; never wait.

        Call it every 20 ms; calls that come sooner have no effect.
        """
        with self._lock:
            gap = now - self._beat_at
            if gap < BEAT_PERIOD_S or self._is_closing:
                return
            self._beat_at = now
            news = self._attend(now, gap > HELD_UP_S)
        for level, text in news:
            _LOG.log(level, "guard process: %s", text)

    def health(self) -> GuardHealth:
        """Return the state of the guard process."""
        with self._lock:
            post = self._post
            return GuardHealth(post is not None and post.has_answered, self._replacements, self._trouble)

    def close(self) -> None:
        """End the guard; where the arm is left moving, send no farewell, so that the guard stops it."""
        with self._lock:
            self._is_closing = True
            post, self._post = self._post, None
        if self._starter is not None:
            self._starter.join(_EXIT_TIMEOUT_S)
        if self._word == MOVING:
            self._leave_the_arm_to(post)
        elif post is not None:
            _send_away(post)

    def _attend(self, now: float, was_held_up: bool) -> List[Tuple[int, str]]:
        """Send the driver's message and read the answer; return the lines to log."""
        post = self._post
        if post is None:
            return self._replace(now) if now >= self._start_at else []
        post.send(self._word)
        had_answered = post.has_answered
        has_taken_over = post.listen(now)
        if was_held_up:
            post.received_at = now
        silent = now - post.received_at
        if post.has_ended:
            return self._dismiss(post, "has ended", now)
        if silent > ANSWER_TIMEOUT_S and silent > post.silence_limit():
            return self._dismiss(post, "does not answer for %.1f s" % silent, now)
        if has_taken_over:
            self._trouble = "found this driver silent while the arm moved, and stopped the arm"
            return [(logging.ERROR, self._trouble)]
        if self._replacements and post.has_answered and not had_answered:
            return [(logging.INFO, "watches again")]
        return []

    def _dismiss(self, post: GuardPost, trouble: str, now: float) -> List[Tuple[int, str]]:
        """Have the guard replaced; after one that lived only briefly, the next one starts later."""
        post.kill()
        post.leave()
        self._dismissed.append(post)
        self._post = None
        self._trouble = trouble
        if now - post.began_at > START_TIMEOUT_S and post.has_answered:
            self._failures = 0
        self._start_at = now + _RESTART_PERIODS_S[min(self._failures, len(_RESTART_PERIODS_S) - 1)]
        self._failures += 1
        return [(logging.ERROR, trouble + ", and is replaced")] + (self._replace(now) if now >= self._start_at else [])

    def _replace(self, now: float) -> List[Tuple[int, str]]:
        """Start another guard in a thread, because starting a process takes longer than the driver's loop can wait."""
        post = None
        try:
            post = GuardPost(now)
            post.send(self._word)
            self._starter = threading.Thread(target=self._launch, args=(post, self._current_command(), self._dismissed),
                                             name="guard starter", daemon=True)
            self._starter.start()
        except (OSError, RuntimeError) as error:  # no more files, no more threads
            if post is not None:
                post.leave()
            self._start_at = now + _RESTART_PERIODS_S[-1]
            self._trouble = "cannot be started: %s" % error
            return [(logging.ERROR, self._trouble)]
        self._post = post
        self._dismissed = []
        self._replacements += 1
        return []

    def _current_command(self) -> List[str]:
        """Return the guard's command line, with whether the arm moves: the driver may die before its first message."""
        return self._command + (["--moving"] if self._word == MOVING else [])

    @staticmethod
    def _launch(post: GuardPost, command: List[str], dismissed: List[GuardPost]) -> None:
        try:
            post.launch(command)
        except (OSError, ValueError, subprocess.SubprocessError) as error:
            _LOG.error("guard process: cannot be started: %s", error)
        for old in dismissed:
            old.has_exited(_EXIT_TIMEOUT_S)

    def _leave_the_arm_to(self, post: Optional[GuardPost]) -> None:
        if post is None or not post.answers_now():
            if post is not None:
                post.kill()
                post.leave()
            try:
                post = GuardPost(0.0)
                post.launch(self._current_command())
            except OSError as error:
                _LOG.error("guard process: cannot be started, nobody stops the arm: %s", error)
                return
        post.leave()


def _send_away(post: GuardPost) -> None:
    post.send(FAREWELL)
    if post.has_exited(_EXIT_TIMEOUT_S):
        post.leave()
        return
    post.listen(0.0)
    if not post.is_stopping:  # one that is stopping the arm finishes that first
        post.kill()
        post.has_exited(_EXIT_TIMEOUT_S)
    post.leave()
