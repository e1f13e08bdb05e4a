"""The TCP ports of a controller (docs/controller-protocol.md, "1. Channels")."""

PORTS = ("command", "status", "poll")
"""Names of the ports in this package: requests and replies; the status feed; status frames on request."""
PORT_NUMBERS = {"command": 10001, "status": 10000, "poll": 10004}
"""TCP port numbers on which a real controller listens."""


def endpoint(host: str, port: int) -> str:
    """Return host and port as one text, an IPv6 address in brackets."""
    return ("[%s]:%d" if ":" in host else "%s:%d") % (host, port)
