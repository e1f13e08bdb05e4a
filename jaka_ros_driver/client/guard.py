"""A small process beside the driver that stops the arm when the driver dies or freezes in the middle of a motion.

The driver writes a byte every 20 ms into the guard's standard input: whether it moves the arm now, or that it leaves
in good order. When the pipe closes without a farewell, or no byte comes for 0.25 s (1 s where the host is so busy
that the driver gets no time), and the driver was moving the arm, the guard takes the command port over (the newest
client wins, controller protocol 1) and stops the arm.

What it cannot do: it needs this computer, its network and the controller. Against the loss of those only the
controller's own safety functions help.
"""
import argparse
import os
import select
import subprocess
import sys
import threading
import time
from typing import Callable, List, Optional

from jaka_ros_driver.client.arm_links import request_all
from jaka_ros_driver.client.transport import CommandLink
from jaka_ros_driver.commands import SetServoMode, Stop
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.voice import Voice

BEAT_PERIOD = 0.02
SILENCE_TIMEOUT = 0.25
STARVED_TIMEOUT = 1.0
"""s; on a busy host a live driver that gets no time is waited for so long."""
_MOVING, _IDLE, _FAREWELL = b"m", b"i", b"q"
_STOP_TRIES_FOR = 10.0
_TRY_PERIOD = 0.05
_EXIT_TIMEOUT = 2.0
_RESTART_PERIOD = 0.5
_SAY_TIMEOUT = 0.5


class Guard:
    """The driver's end: starts the guard process, keeps telling it what it does, and sends it away."""

    def __init__(self, host: str, port: int) -> None:
        self._host = host
        self._port = port
        self._lock = threading.Lock()
        self._word = _IDLE
        self._process = self._start_process()
        self._is_closing = threading.Event()
        self._thread = threading.Thread(target=self._beat, name="guard heartbeat", daemon=True)
        self._thread.start()

    @property
    def is_alive(self) -> bool:
        """The guard process runs."""
        return self._process.poll() is None

    def tell(self, is_moving: bool) -> None:
        """Tell at once, before the motion's first byte is on the wire."""
        self._word = _MOVING if is_moving else _IDLE
        self._say(self._word)

    def close(self) -> None:
        """Leave in good order; where the arm was left moving, without a farewell: then the guard stops it, alone."""
        self._is_closing.set()
        self._thread.join()
        is_moving = self._word == _MOVING
        if not is_moving:
            self._say(_FAREWELL)
        pipe = self._process.stdin
        if pipe is not None:
            pipe.close()
        if is_moving:
            return
        try:
            self._process.wait(_EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _start_process(self) -> "subprocess.Popen[bytes]":
        """In a session of its own, so that what ends the driver's process group does not end the guard first.

        One that replaces another knows from the start whether the arm moves: the driver may be dead before its first
        word.
        """
        command = [sys.executable, "-m", __name__, "--host", self._host, "--port", str(self._port)]
        if self._word == _MOVING:
            command.append("--moving")
        process = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True, bufsize=0)
        if process.stdin is not None:
            os.set_blocking(process.stdin.fileno(), False)
        self._started_at = time.monotonic()
        return process

    def _say(self, word: bytes) -> None:
        with self._lock:
            pipe = self._process.stdin
            try:
                if pipe is not None and not pipe.closed and pipe.write(word) is None:
                    self._process.kill()  # it does not read: frozen, and no guard
            except OSError:
                pass

    def _beat(self) -> None:
        while not self._is_closing.wait(BEAT_PERIOD):
            if not self.is_alive and time.monotonic() > self._started_at + _RESTART_PERIOD:
                with self._lock:
                    if self._process.stdin is not None:
                        self._process.stdin.close()
                    self._process = self._start_process()
            self._say(self._word)


def watch(pipe: int, host: str, port: int, driver: int, is_moving: bool, say: Callable[[str], None]) -> None:
    """The guard's whole life: read the words of the driver, a process id, until it leaves or dies."""
    while True:
        readable, _, _ = select.select([pipe], [], [], SILENCE_TIMEOUT)
        if not readable and waits_for_processor(driver):
            readable, _, _ = select.select([pipe], [], [], STARVED_TIMEOUT - SILENCE_TIMEOUT)
        words = os.read(pipe, 4096) if readable else None
        if words is not None and _FAREWELL in words:
            return
        if words:
            is_moving = words[-1:] == _MOVING
            continue
        if is_moving:
            say("the driver %s while the arm moves, stopping the arm" % ("has died" if words == b"" else "is silent"))
            stop_arm(host, port, say)
            is_moving = False
        if words == b"":
            return


def waits_for_processor(process: int) -> bool:
    """A thread of the process could run and gets no time: silent, but neither stopped nor hung. False where unknown."""
    try:
        threads = os.listdir("/proc/%d/task" % process)
    except OSError:
        return False
    for thread in threads:
        try:
            with open("/proc/%d/task/%s/stat" % (process, thread)) as file:
                if file.read().rpartition(")")[2].split()[0] == "R":
                    return True
        except (OSError, IndexError):
            continue
    return False


def stop_arm(host: str, port: int, say: Callable[[str], None]) -> bool:
    """Take the command port over and stop all motion; tries for 10 s. True when the controller accepted the stop."""
    give_up_at = time.monotonic() + _STOP_TRIES_FOR
    while time.monotonic() < give_up_at:
        try:
            link = CommandLink(host, port, 1.0, 1.0, lambda reason: None)
            try:
                request_all(link, [SetServoMode(False), Stop()])
            finally:
                link.close("guard is done")
            say("the controller accepted the stop")
            return True
        except JakaError as error:
            say(str(error))
            time.sleep(_TRY_PERIOD)
    say("the arm could not be stopped")
    return False


def main(argv: Optional[List[str]] = None) -> int:
    """The guard process; its words come on standard input."""
    parser = argparse.ArgumentParser(prog="jaka_guard", description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--host", required=True, help="address of the controller")
    parser.add_argument("--port", required=True, type=int, help="its command port")
    parser.add_argument("--moving", action="store_true", help="the driver moves the arm already")
    args = parser.parse_args(argv)
    voice = Voice("guard")
    watch(sys.stdin.fileno(), args.host, args.port, os.getppid(), args.moving, voice.say)
    voice.close(_SAY_TIMEOUT)
    return 0


if __name__ == "__main__":
    sys.exit(main())
