"""A lock that lets only one driver on this machine use a controller; a second driver refuses to start.

It is a kernel lock on a file that is named after the controller's address and network namespace, whichever of its host
names is used. The kernel releases it when the process ends, however that happens.
"""
import contextlib
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
    """The lock. It is held from its creation until ``release`` or the end of the process."""

    def __init__(self, host: str, port: int, holder: str, folder: str = "") -> None:
        """Take it.

        Args:
            host: The controller's address.
            port: Its command port.
            holder: Name of the driver, for the message to a second one.
            folder: Where the lock files are; None for the system's folder for temporary files.

        Raises:
            AlreadyDriven: Another driver holds it; the message says which.
            OSError: The file can be neither opened nor created.
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
        with contextlib.suppress(OSError):  # another user's file, open for reading: our name cannot be written into it
            os.ftruncate(self._file, 0)
            os.pwrite(self._file, ("%s (pid %d)\n" % (holder, os.getpid())).encode("utf-8"), 0)

    def release(self) -> None:
        os.close(self._file)


def _address(host: str) -> str:
    """The same text for all names of a host; an unknown name itself."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError, ValueError):
        return host.lower()
    addresses = {_unmapped(str(entry[4][0])) for entry in found}
    if any(map(_is_here, addresses)):
        return "this_machine"
    return min(addresses)


def _unmapped(address: str) -> str:
    """The address; an IPv4 address that is written as IPv6 is turned into IPv4."""
    try:
        mapped = ipaddress.IPv6Address(address).ipv4_mapped
    except ValueError:
        return address
    return address if mapped is None else str(mapped)


def _is_here(address: str) -> bool:
    """True for each address of this machine: loopback, "any", and those of its interfaces. Only such can be bound."""
    try:
        known = ipaddress.ip_address(address)
        if known.is_loopback or known.is_unspecified:
            return True
    except ValueError:  # it contains the name of an interface
        pass
    try:
        with socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind((address, 0))
    except OSError:
        return False
    return True


def _network() -> str:
    """Identifies the network namespace: the same address may be another controller in another namespace."""
    try:
        return "_net%d" % os.stat("/proc/self/ns/net").st_ino
    except OSError:
        return ""


def _open(path: str) -> int:
    """Open the file for writing, or another user's for reading, which is enough for a lock."""
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o644)
    except PermissionError:
        return os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
