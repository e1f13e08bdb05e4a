"""One driver for one controller: the second one on this machine refuses to start.

A lock of the kernel's on a file named after the controller: it goes with the process that holds it, however that ends.
Whatever the controller is called, the name tells the address that is meant, and the network that it is in.
"""
import fcntl
import ipaddress
import os
import re
import socket
import tempfile

from jaka_ros_driver.errors import JakaError


class AlreadyDriven(JakaError):
    """Another driver on this machine has this controller."""


class DriverLock:
    """Held from its creation until ``release`` or the end of the process."""

    def __init__(self, host: str, port: int, holder: str, folder: str = "") -> None:
        """Take it.

        Args:
            host: The controller's address.
            port: Its command port.
            holder: Who takes it, for the message that the next one gets.
            folder: Where the lock files are; without, the system's folder for temporary files.

        Raises:
            AlreadyDriven: Somebody has it; the message says who.
            OSError: The file can be neither opened nor made.
        """
        name = "jaka_ros_driver.%s_%d%s.lock" % (re.sub(r"[^A-Za-z0-9.-]", "_", _address(host)), port, _network())
        path = os.path.join(folder or tempfile.gettempdir(), name)
        self._file = _open(path)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            other = os.pread(self._file, 200, 0).decode("utf-8", "replace").strip()
            os.close(self._file)
            raise AlreadyDriven("the controller %s:%d is already driven by %s; one controller, one driver (lock %s)"
                                % (host, port, other or "another driver", path)) from None
        self._note("%s (pid %d)\n" % (holder, os.getpid()))

    def release(self) -> None:
        """Give it back."""
        os.close(self._file)

    def _note(self, text: str) -> None:
        try:
            os.ftruncate(self._file, 0)
            os.pwrite(self._file, text.encode("utf-8"), 0)
        except OSError:
            return  # another user's file, open for reading: it locks as well, and only the name in it is missing


def _address(host: str) -> str:
    """One text for all names of a host; a name that nobody knows stands for itself."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError, ValueError):
        return host.lower()
    addresses = {_unmapped(str(entry[4][0])) for entry in found}
    if any(map(_is_here, addresses)):
        return "this_machine"
    return min(addresses)


def _unmapped(address: str) -> str:
    """An IPv4 address as such, also where it is written as IPv6."""
    try:
        mapped = ipaddress.IPv6Address(address).ipv4_mapped
    except ValueError:
        return address
    return address if mapped is None else str(mapped)


def _is_here(address: str) -> bool:
    """True for each address of this machine: loopback, "any", and every interface's, for only such can be bound."""
    try:
        known = ipaddress.ip_address(address)
        if known.is_loopback or known.is_unspecified:
            return True
    except ValueError:  # one with the name of an interface in it
        pass
    try:
        with socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind((address, 0))
    except OSError:
        return False
    return True


def _network() -> str:
    """Which network namespace this is: the same address is another controller in another one."""
    try:
        return "_net%d" % os.stat("/proc/self/ns/net").st_ino
    except OSError:
        return ""


def _open(path: str) -> int:
    """For writing where the file is ours; another user's can be opened for reading, which is enough for a lock."""
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o644)
    except PermissionError:
        return os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
