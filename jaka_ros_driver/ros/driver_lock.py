"""A lock that lets only one driver of this network use a controller; a second driver refuses to start.

It is an abstract Unix socket, named after the controller's address, whichever of its host names is used. Such a name
belongs to the network namespace, as the controller's address does: no folder, user or container setting of the file
system leads around it. The kernel frees it when the process ends, however that happens, and lists the names in use:
the holder is told by a second one, so that nobody has to answer for a lock, and a frozen driver is named, too.
"""
import contextlib
import errno
import hashlib
import ipaddress
import os
import socket
from pathlib import Path
from typing import List, Set

from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.protocol.ports import endpoint

_LIST = Path("/proc/net/unix")
"""The names that are in use in this network namespace, each at the end of a line, with "@" for its first zero byte."""
_LONGEST_NAME = 80
"""Longest address, bytes, within a lock's name."""
_MOST_BYTES = 107
"""Longest name of a socket, bytes."""
_UNNAMED = "another driver"


class AlreadyDriven(JakaError):
    """The error that another driver on this machine has this controller."""


class DriverLock:
    """The lock, held from its creation until ``release`` or the end of the process."""

    def __init__(self, host: str, port: int, holder: str) -> None:
        """Acquire the lock.

        Args:
            host: The controller's address.
            port: Its command port.
            holder: Name of the driver, for the message to a second one.

        Raises:
            AlreadyDriven: Another driver holds it; the message names that.
            OSError: No socket can be created.
        """
        self._sockets: List[socket.socket] = []
        for address in sorted(_addresses(host)):
            name = _socket_name(address, port)
            try:
                self._take(name)
            except OSError as error:
                self.release()
                if error.errno != errno.EADDRINUSE:
                    raise
                raise AlreadyDriven("the controller %s is already driven by %s; one controller, one driver"
                                    % (endpoint(host, port), _holder_of(name) or _UNNAMED)) from None
            told = b"%s (pid %d)" % (holder.encode("utf-8", "replace"), os.getpid())
            with contextlib.suppress(OSError):  # the lock holds without it
                self._take(_prefix(name) + told[-(_MOST_BYTES - len(_prefix(name))):])

    def release(self) -> None:
        """Free the names before returning."""
        for taken in self._sockets:
            taken.close()

    def _take(self, name: bytes) -> None:
        taken = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._sockets.append(taken)
        taken.bind(name)


def holder_of(host: str, port: int) -> str:
    """Return who on this machine drives a controller, "" where nobody does; the lock itself is not touched."""
    return next(filter(None, (_holder_of(_socket_name(address, port)) for address in sorted(_addresses(host)))), "")


def _socket_name(address: str, port: int) -> bytes:
    text = address.encode("utf-8", "replace")
    if len(text) > _LONGEST_NAME:
        text = hashlib.sha256(text).hexdigest().encode()
    return b"\0jaka_ros_driver/%s:%d" % (text, port)


def _prefix(name: bytes) -> bytes:
    """Return how the name of the socket begins that tells the holder of a lock."""
    return b"\0" + hashlib.sha256(name).hexdigest()[:24].encode() + b" "


def _holder_of(name: bytes) -> str:
    """Return name and process id of the driver that holds a lock, as far as they are available; "" for nobody."""
    try:
        listed = [line.partition(b" @")[2] for line in _LIST.read_bytes().splitlines()]
    except OSError:
        return _UNNAMED
    if name[1:] not in listed:
        return ""
    prefix = _prefix(name)[1:]
    return next((each[len(prefix):].decode("utf-8", "replace") for each in listed if each.startswith(prefix)), _UNNAMED)


def _addresses(host: str) -> Set[str]:
    """Return a host's addresses, the same for all its names; the name itself where it is unknown."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError, ValueError):
        return {host.lower()}
    addresses = {_unmapped(str(entry[4][0])) for entry in found}
    return {"this_machine" if _is_here(address) else address for address in addresses}


def _unmapped(address: str) -> str:
    """Return the address; an IPv4 address that is written as IPv6 becomes IPv4."""
    try:
        mapped = ipaddress.IPv6Address(address).ipv4_mapped
    except ValueError:
        return address
    return address if mapped is None else str(mapped)


def _is_here(address: str) -> bool:
    """Return whether this is an address of this machine: loopback, "any", or one of its interfaces.

    Only such an address can be bound.
    """
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
