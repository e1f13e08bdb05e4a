"""Custody on disk: a small file that exists while a driver moves the arm, for a guard or driver that starts later.

The file is in a private folder, is replaced as a whole, and is removed when custody ends. A file whose driver is dead
shows that the arm may have been left moving. It is a note, not a lock: where it cannot be written, the driver logs that
once and goes on.
"""
import contextlib
import json
import logging
import os
import re
import stat
import tempfile
import threading
import time
from typing import Any, Iterator, List, NamedTuple, Optional

from jaka_ros_driver.client.core.actions import NotifyGuard
from jaka_ros_driver.client.core.foreign_motion import LeftMotion
from jaka_ros_driver.client.process_state import start_of
from jaka_ros_driver.client.transport import addresses_of
from jaka_ros_driver.commands import JogFrame, JogStop

_LOG = logging.getLogger(__name__)

_NAME = "jaka_ros_driver"
_LONGEST_FILE = 4096
_FLUSH_TIMEOUT_S = 0.5


class Found(NamedTuple):
    """The content of a custody file.

    Attributes:
        left: The motion.
        is_alive: True where the process that has it in custody runs.
    """

    left: LeftMotion
    is_alive: bool


class CustodyFile:
    """The custody file of one controller, whichever of its host names is used."""

    def __init__(self, host: str, command_port: int, folders: Optional[List[str]] = None) -> None:
        """Resolve the controller's name.

        Args:
            host: The controller's address.
            command_port: Its command port.
            folders: Folders for the file; the first usable one receives it. None for the private runtime folder
                of the user, else a private one among temporary files.
        """
        try:
            address = min(addresses_of(host))
        except (OSError, UnicodeError):
            address = host.lower()
        self._controller = "%s:%d" % (address, command_port)
        self._name = "custody.%s_%d.json" % (re.sub(r"[^A-Za-z0-9.-]", "_", address), command_port)
        self._folders = _runtime_folders() if folders is None else folders

    def write(self, left: LeftMotion) -> None:
        """Replace the file; raise OSError where that is not possible."""
        jog = left.jog_stop
        text = json.dumps({
            "controller": self._controller, "moves": left.name, "since": left.since, "process": left.process,
            "process_start": start_of(left.process),
            "jog": None if jog is None else {"frame": jog.frame.name, "axis": jog.axis}})
        trouble = OSError("there is no folder for it")
        for folder in self._folders:
            try:
                _make_private(folder)
                _replace(os.path.join(folder, self._name), text)
                return
            except OSError as error:
                trouble = error
        raise trouble

    def remove(self) -> None:
        """Remove the file where there is one; raise OSError where that is not possible."""
        for folder in self._folders:
            with contextlib.suppress(FileNotFoundError, NotADirectoryError):
                os.unlink(os.path.join(folder, self._name))

    def remove_of(self, process: int) -> None:
        """Remove the file if this process wrote it. Raise nothing: at worst the next driver sends a needless stop."""
        found = self.read()
        if found is not None and found.left.process == process:
            with contextlib.suppress(OSError):
                self.remove()

    def read(self) -> Optional[Found]:
        """Return the content of the file; None where there is none that can be read."""
        for folder in self._folders:
            path = os.path.join(folder, self._name)
            try:
                _require_private(folder)
                return _found(_text_of(path))
            except FileNotFoundError:
                continue
            except (OSError, ValueError, KeyError, TypeError) as error:
                _LOG.warning("%s is not read: %s", path, error)
        return None


class CustodyKeeper:
    """The thread that writes the custody file whenever custody changes: the arm's loop waits for no disk."""

    def __init__(self, file: CustodyFile) -> None:
        self._file = file
        self._news = threading.Condition()
        self._wanted: Optional[LeftMotion] = None
        self._is_due = False
        self._is_closing = False
        self._has_trouble = False
        self._thread = threading.Thread(target=self._run, name="custody file", daemon=True)

    def start(self) -> None:
        """Start the writing thread."""
        self._thread.start()

    def note(self, tell: NotifyGuard) -> None:
        """Record that custody has begun or ended; never wait for the disk."""
        with self._news:
            self._wanted = LeftMotion(tell.name, tell.jog_stop, time.time(), os.getpid()) if tell.is_moving else None
            self._is_due = True
            self._news.notify()

    def close(self) -> None:
        """Write the pending change, if the disk takes it within 0.5 s, and end."""
        with self._news:
            self._is_closing = True
            self._news.notify()
        if self._thread.is_alive():
            self._thread.join(_FLUSH_TIMEOUT_S)

    def _run(self) -> None:
        for wanted in iter(self._next, self):
            assert not isinstance(wanted, CustodyKeeper)
            try:
                if wanted is None:
                    self._file.remove()
                else:
                    self._file.write(wanted)
                self._has_trouble = False
            except OSError as error:
                if not self._has_trouble:
                    self._has_trouble = True
                    _LOG.warning("what this driver moves cannot be noted on disk, for a driver that would have to "
                                 "stop it after this one's death: %s", error)

    def _next(self) -> Any:
        """Wait for the newest custody that was not written yet, and return it; return the keeper itself at the end."""
        with self._news:
            self._news.wait_for(lambda: self._is_due or self._is_closing)
            if not self._is_due:
                return self
            self._is_due = False
            return self._wanted


def _runtime_folders() -> List[str]:
    """Return the private folders for files that last as long as a process, best first.

    A driver that is started as a service may lack the variable that one from a shell has: both look at all of them.
    """
    return list(dict.fromkeys(_candidates()))


def _candidates() -> Iterator[str]:
    user = os.getuid()
    for folder in (os.environ.get("XDG_RUNTIME_DIR", ""), "/run/user/%d" % user):
        with contextlib.suppress(OSError):
            if os.path.isabs(folder) and os.stat(folder).st_uid == user:
                yield os.path.join(folder, _NAME)
    yield os.path.join(tempfile.gettempdir(), "%s-%d" % (_NAME, user))


def _make_private(folder: str) -> None:
    with contextlib.suppress(FileExistsError):
        os.mkdir(folder, 0o700)
    _require_private(folder)


def _require_private(folder: str) -> None:
    """Raise OSError unless nobody else can have put anything into the folder."""
    about = os.lstat(folder)
    if not stat.S_ISDIR(about.st_mode) or about.st_uid != os.getuid() or about.st_mode & 0o077:
        raise PermissionError("%s is not a private folder of this user" % folder)


def _replace(path: str, text: str) -> None:
    """Replace a file at once, so that a reader sees the old one or the new one."""
    new = "%s.%d.new" % (path, os.getpid())
    descriptor = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    try:
        with open(descriptor, "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(new, path)
    except OSError:
        with contextlib.suppress(OSError):
            os.unlink(new)
        raise


def _text_of(path: str) -> str:
    with open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK), encoding="utf-8") as file:
        return file.read(_LONGEST_FILE)


def _found(text: str) -> Found:
    fields = json.loads(text)
    jog, process = fields["jog"], int(fields["process"])
    start = fields["process_start"]
    stop = None if jog is None else JogStop(JogFrame[jog["frame"]], range(6)[jog["axis"]])
    left = LeftMotion(str(fields["moves"]), stop, float(fields["since"]), process)
    return Found(left, bool(start) and start_of(process) == start)
