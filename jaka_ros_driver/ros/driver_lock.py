"""A lock that lets only one driver of this network use a controller; a second driver refuses to start.

It is an abstract Unix socket, named after the controller's address, whichever of its host names is used. Such a name
belongs to the network namespace, as the controller's address does: no folder, user or container setting of the file
system leads around it. The kernel frees it when the process ends, however that happens.
"""
import contextlib
import errno
import hashlib
import ipaddress
import socket
import struct
import threading
import time
from typing import List, Set

from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.protocol.ports import endpoint

_ANSWER_TIMEOUT_S = 1.0
"""Longest wait, s, for the name of the driver that holds the lock; without it the refusal has no name."""
_RETRY_S = 0.1
"""Pause, s, where no descriptor is left to answer with: without it the loop would take the processor."""
_LONGEST_NAME = 80
"""Longest address, bytes, within a socket's name, which has 107."""
_UNNAMED = "another driver"
_CREDENTIALS = struct.Struct("3i")


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
        self._threads: List[threading.Thread] = []
        for address in sorted(_addresses(host)):
            name = _socket_name(address, port)
            taken = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            taken.settimeout(None)  # rospy gives new sockets a time limit, under which shutdown() wakes no accept()
            self._sockets.append(taken)
            try:
                taken.bind(name)
            except OSError as error:
                self.release()
                if error.errno != errno.EADDRINUSE:
                    raise
                raise AlreadyDriven("the controller %s is already driven by %s; one controller, one driver"
                                    % (endpoint(host, port), _holder_of(name) or _UNNAMED)) from None
            taken.listen(8)
            thread = threading.Thread(target=_answer, args=(taken, holder.encode("utf-8", "replace")),
                                      name="driver lock", daemon=True)
            thread.start()
            self._threads.append(thread)

    def release(self) -> None:
        """Free the names before returning."""
        for taken in self._sockets:
            with contextlib.suppress(OSError):  # not listening yet
                taken.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:  # one that is still in accept() would keep its name taken
            thread.join()
        for taken in self._sockets:
            taken.close()


def holder_of(host: str, port: int) -> str:
    """Return who on this machine drives a controller, "" where nobody does; the lock itself is not touched."""
    return next(filter(None, (_holder_of(_socket_name(address, port)) for address in sorted(_addresses(host)))), "")


def _socket_name(address: str, port: int) -> bytes:
    text = address.encode("utf-8", "replace")
    if len(text) > _LONGEST_NAME:
        text = hashlib.sha256(text).hexdigest().encode()
    return b"\0jaka_ros_driver/%s:%d" % (text, port)


def _answer(listening: socket.socket, holder: bytes) -> None:
    """Send the holder's name to everyone who connects, until the lock is released."""
    while True:
        try:
            connection, _ = listening.accept()
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.EBADF):
                return
            time.sleep(_RETRY_S)  # no descriptor is left; the lock holds all the same
            continue
        with connection, contextlib.suppress(OSError):
            connection.setblocking(False)
            connection.sendall(holder)


def _holder_of(name: bytes) -> str:
    """Return name and process id of the driver that holds a lock, as far as they are available; "" for nobody."""
    with contextlib.closing(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) as asking:
        asking.settimeout(_ANSWER_TIMEOUT_S)
        try:
            asking.connect(name)
            pid = _CREDENTIALS.unpack(asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))[0]
        except ConnectionRefusedError:
            return ""
        except OSError:
            return _UNNAMED
        try:
            holder = asking.recv(256).decode("utf-8", "replace").strip()
        except OSError:  # it is frozen
            holder = ""
    return "%s (pid %d)" % (holder or "another driver, which does not answer", pid)


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
