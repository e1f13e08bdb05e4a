"""The access rules of a server: browsers connect only from trusted pages, and only under a name of this server.

A browser lets every web page open a WebSocket to any address, this machine included, and sends the page's origin in the
header ``Origin``, which the page cannot change. Clients that are no browser send none. A page may also have its own
host's name lead to this machine (DNS rebinding): then ``Host`` has that name.
"""
import ipaddress
from typing import FrozenSet, Iterable, Optional
from urllib.parse import urlsplit

from jaka_bag.errors import UsageError

KNOWN_ORIGINS = ("https://app.foxglove.dev", "https://lichtblick-suite.github.io")
"""The pages of Foxglove and Lichtblick."""


def _origin_of(text: str) -> str:
    """Return an origin in the form that browsers send; empty for an invalid one."""
    try:
        parts = urlsplit(text)
    except ValueError:
        return ""
    if not parts.scheme or parts.path not in ("", "/") or parts.query or parts.fragment or parts.username is not None:
        return ""
    if not parts.netloc:
        return "file://" if parts.scheme == "file" else ""
    return "%s://%s" % (parts.scheme, parts.netloc.lower())


def host_name(text: str) -> str:
    """Return the name or address in a ``Host`` header, lower-case, without the port; empty for an invalid header."""
    try:
        parts = urlsplit("//" + text)
        _ = parts.port  # raises for a port that is no number
    except ValueError:
        return ""
    is_plain = not (parts.path or parts.query or parts.fragment or parts.username is not None)
    return (parts.hostname or "").rstrip(".") if is_plain else ""


def is_address(host: str) -> bool:
    """Return whether a host is given as an IP address."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def is_loopback(host: str) -> bool:
    """Return whether a host is reachable from this machine only."""
    return host == "localhost" or (is_address(host) and ipaddress.ip_address(host).is_loopback)


class AccessRules:
    """The rules by which requests for a connection are accepted.

    Args:
        origins: Origins of further pages that are trusted, as ``http://localhost:8080``.
        names: Names of this machine under which viewers may ask for it, besides ``localhost`` and any address.

    Raises:
        UsageError: One of the origins is invalid.
    """

    def __init__(self, origins: Iterable[str] = (), names: Iterable[str] = ()) -> None:
        given = list(origins)
        for origin in given:
            if not _origin_of(origin):
                raise UsageError("%r is no origin (http://localhost:8080, file://)" % origin)
        self.origins: FrozenSet[str] = frozenset(map(_origin_of, [*KNOWN_ORIGINS, *given]))
        self.names: FrozenSet[str] = frozenset(["localhost", *(name.lower() for name in names)])

    def refusal(self, origin: Optional[str], host: Optional[str]) -> Optional[str]:
        """Return the reason why a request with these headers is refused; None where it is accepted."""
        name = host_name(host or "")
        if not is_address(name) and name not in self.names:
            return "this server is not called %.80r; --allow-host NAME adds a name" % (host or "")
        if origin is not None and _origin_of(origin) not in self.origins:
            return "pages of %.80r may not connect; --allow-origin ORIGIN trusts them" % origin
        return None
