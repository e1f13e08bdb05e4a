"""Small files about a controller that last at most until the computer is switched off, for the next driver or guard.

Each is in a private folder and is replaced as a whole.
"""
import contextlib
import logging
import os
import re
import stat
import tempfile
from typing import Callable, Iterator, List, Optional, TypeVar

from jaka_ros_driver.client.transport import addresses_of
from jaka_ros_driver.protocol.ports import endpoint

_LOG = logging.getLogger(__name__)

_NAME = "jaka_ros_driver"
_LONGEST_FILE = 4096
"""Most characters that are read: what others put in place of the small file of a driver costs no memory."""
_OF_SESSIONS = "/run/user/"
"""Folders that logind removes when their user has logged out."""

T = TypeVar("T")


class RuntimeFile:
    """The file of one kind of one controller, whichever of its host names is used.

    Attributes:
        controller: The controller's address and command port.
    """

    def __init__(self, kind: str, host: str, command_port: int, folders: Optional[List[str]] = None) -> None:
        """Resolve the controller's name.

        Args:
            kind: The beginning of the file's name.
            host: The controller's address.
            command_port: Its command port.
            folders: Folders for the file; the first usable one receives it. None for the private runtime folder
                of the user, else a private one among temporary files. Of a folder that goes when its user logs out,
                while a driver of his goes on, the next one receives a copy.
        """
        try:
            address = min(addresses_of(host))
        except (OSError, UnicodeError):
            address = host.lower()
        self.controller = endpoint(address, command_port)
        self._name = "%s.%s_%d.json" % (kind, re.sub(r"[^A-Za-z0-9.-]", "_", address), command_port)
        self._folders = _runtime_folders() if folders is None else folders

    def write(self, text: str) -> None:
        """Replace the file; raise OSError where no folder takes it."""
        is_written, trouble = False, OSError("there is no folder for it")
        for folder in self._folders:
            try:
                _make_private(folder)
                _replace(os.path.join(folder, self._name), text)
                is_written = True
                if not folder.startswith(_OF_SESSIONS):
                    break
            except OSError as error:
                trouble = error
        if not is_written:
            raise trouble

    def remove(self) -> None:
        """Remove the file where there is one; raise OSError where that is not possible."""
        for folder in self._folders:
            with contextlib.suppress(FileNotFoundError, NotADirectoryError):
                os.unlink(os.path.join(folder, self._name))

    def read(self, content: Callable[[str], T]) -> List[Optional[T]]:
        """Return ``content`` of the text of each copy that is there; None for one that cannot be read or understood."""
        found: List[Optional[T]] = []
        for folder in self._folders:
            path = os.path.join(folder, self._name)
            try:
                os.lstat(path)
                _require_private(folder)
                found.append(content(_text_of(path)))
            except (FileNotFoundError, NotADirectoryError):
                continue
            except (OSError, ValueError, KeyError, TypeError) as error:
                _LOG.warning("%s is not read: %s", path, error)
                found.append(None)
        return found


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
