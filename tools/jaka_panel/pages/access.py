"""The rules of who may ask: a page of another site, open in the same browser, must neither read nor move anything.

Such a page can have the browser call this address (its Origin tells), or call its own name and let that name lead here
(its Host tells: DNS rebinding). There are no cookies; the token is in a message, which only our own page can send.
"""
import hmac
import ipaddress
import re
from typing import Mapping, Optional, Sequence

from aiohttp import web

from ..settings import Settings, is_loopback

CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; font-src 'self'; "
    "connect-src 'self'; manifest-src 'self'; worker-src 'self' blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'")
HEADERS = {
    "Content-Security-Policy": CONTENT_SECURITY_POLICY, "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY", "Referrer-Policy": "no-referrer", "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin", "Server": "jaka_panel",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()"}
TOKEN_MARK = "token."
"""The mark before the token where a page offers it as a subprotocol of its WebSocket."""
_HOST = re.compile(r"(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(?::([0-9]{1,5}))?", re.IGNORECASE)
"""``Host`` as browsers send it: a name or an address, and a port (RFC 9110, section 7.2)."""
_SAME = ("same-origin", "none")


class Access:
    """The rules of one server."""

    def __init__(self, settings: Settings) -> None:
        self._is_loopback = settings.is_loopback
        self._names = {name.lower() for name in settings.names}
        self._scheme = settings.scheme
        self._token = settings.token

    def refusal(self, headers: Mapping[str, str], is_socket: bool, is_page: bool = False) -> Optional[str]:
        """Return why a request is refused, None if it is not.

        Args:
            headers: Headers of the request, one value a name, whatever the case of the name.
            is_socket: True if it opens a WebSocket, or posts: then it must have an Origin.
            is_page: True if it asks for the page itself, to which a link of another site may lead.
        """
        host = headers.get("Host", "")
        name = _name_of(host)
        if name is None or not self._is_allowed(name):
            return "Host %.100r is not a name of this panel" % host
        origin = headers.get("Origin")
        if origin is None and is_socket:
            return "no Origin"
        if origin is not None and origin.lower() != "%s://%s" % (self._scheme, host.lower()):
            return "Origin %.100r is another site" % origin
        site = headers.get("Sec-Fetch-Site", "none")
        if site not in _SAME and not (is_page and headers.get("Sec-Fetch-Mode") == "navigate"):
            return "a page of another site asks"
        return None

    def _is_allowed(self, name: str) -> bool:
        if is_loopback(name) or name in self._names:
            return True
        if self._is_loopback:
            return False
        try:
            ipaddress.ip_address(name)  # no name server can lead an address elsewhere
        except ValueError:
            return False
        return True

    def is_token(self, given: object) -> bool:
        """Return whether ``given`` is the token, in a time that reveals nothing of it."""
        return isinstance(given, str) and hmac.compare_digest(given.encode("utf-8", "replace"), self._token.encode())

    def has_bearer(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request has the token in ``Authorization``."""
        kind, _, token = headers.get("Authorization", "").partition(" ")
        return kind.lower() == "bearer" and self.is_token(token.strip())

    def offers_token(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request for a WebSocket has the token, as ``token.TOKEN``, among its subprotocols."""
        offered = (one.strip() for one in headers.get("Sec-WebSocket-Protocol", "").split(","))
        return any(self.is_token(one[len(TOKEN_MARK):]) for one in offered if one.startswith(TOKEN_MARK))

    def has_token(self, head: bytes) -> bool:
        """Return whether the first request of a connection, as its bytes stand, has the token."""
        lines = (line.partition(":") for line in head.decode("latin-1").split("\r\n")[1:])
        headers = {name.strip().title().replace("Websocket", "WebSocket"): value.strip() for name, _, value in lines}
        return self.has_bearer(headers) or self.offers_token(headers)


def _name_of(host: str) -> Optional[str]:
    """Return the name or address in ``Host``, lower-case; None where it is anything else."""
    found = _HOST.fullmatch(host)
    if found is None or found.group(2) is not None and not 0 < int(found.group(2)) < 65536:
        return None
    return found.group(1).strip("[]").lower()


def sent_twice(request: web.Request, names: Sequence[str]) -> bool:
    """Return whether one of these headers, which decide, occurs more than once."""
    return any(len(request.headers.getall(name, [])) > 1 for name in names)
