"""Calls of a master's or node's XML-RPC interface with a time limit, and the difference between the ways to fail.

The standard transport waits for ever for a process that was stopped (SIGSTOP) and for a firewall that drops.
"""
import http.client
from typing import Any
from xml.parsers.expat import ExpatError
from xmlrpc.client import Error as XmlRpcError
from xmlrpc.client import ServerProxy, Transport

_TIMEOUT_S = 1.0
"""Longest wait, s, for a master or a node; one that says nothing must not keep the caller."""
_OTHERWISE = (ConnectionError, XmlRpcError, http.client.HTTPException, ExpatError, ValueError, TypeError)


class NobodyThere(Exception):
    """The error that nothing listens at the address; its cause is the OSError."""


class Unanswered(Exception):
    """The error that what listens at the address does not answer."""


def ask(uri: str, method: str, *arguments: str) -> Any:
    """Return what a master or node answers, None where that is an error.

    Raises:
        NobodyThere: Nothing listens at the address.
        Unanswered: Something listens, and says nothing in time.
    """
    try:
        with ServerProxy(uri, transport=ShortTransport(_TIMEOUT_S)) as proxy:
            code, _, value = getattr(proxy, method)(*arguments)
        return value if code == 1 else None
    except _OTHERWISE:
        return None
    except OSError as error:  # a time limit that has passed: socket.timeout is no TimeoutError before Python 3.10
        raise Unanswered from error


class ShortTransport(Transport):
    """A transport whose every wait is at most ``seconds`` long."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self._seconds = seconds

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = self._seconds
        if connection.sock is None:
            try:
                connection.connect()
            except OSError as error:
                raise NobodyThere from error
        return connection
