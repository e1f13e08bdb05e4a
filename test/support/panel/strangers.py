"""Visitors without a token that flood a panel: an executable, a process of its own as strangers are.

Arguments: the panel's port, how many, what each sends as fast as it goes, one of ``KINDS``, and ``tls`` where the panel
speaks it. Whoever is cut off comes again at once. It runs until it is ended.
"""
import base64
import contextlib
import os
import socket
import ssl
import sys
import threading
from collections import deque

PING = b"\x89\x80" + bytes(4)
FRAGMENT = b"\x00\x80" + bytes(4)
KINDS = {"ping": PING * 10000, "fragments": b"\x01\x80" + bytes(4) + FRAGMENT * 10000,
         "messages": (b"\x81\x8c" + bytes(4) + b'{"t":"ping"}') * 3000, "connections": b"",
         "half begun": None}
UPGRADE = ("GET /ws HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nOrigin: http%s://127.0.0.1:%d\r\nConnection: Upgrade\r\n"
           "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: %s\r\n\r\n")
HELLO = b'{"t":"hello","v":1,"token":null,"name":"stranger"}'


HALF_BEGUN = 30
"""Connections, of each stranger, that wait half begun."""


def context():
    """Return the context of a client that takes any certificate."""
    made = ssl.create_default_context()
    made.check_hostname, made.verify_mode = False, ssl.CERT_NONE
    return made


def half_of_a_hello():
    """Return the first half of what begins a TLS handshake."""
    incoming, outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
    with contextlib.suppress(ssl.SSLWantReadError):
        context().wrap_bio(incoming, outgoing).do_handshake()
    hello = outgoing.read()
    return hello[:len(hello) // 2]


def connect(port, tls):
    """Open a WebSocket and say hello; return the socket."""
    link = socket.create_connection(("127.0.0.1", port), 10.0)
    if tls is not None:
        link = tls.wrap_socket(link)
    key = base64.b64encode(os.urandom(16)).decode()
    link.sendall((UPGRADE % (port, "s" if tls is not None else "", port, key)).encode())
    head = b""
    while b"\r\n\r\n" not in head:
        more = link.recv(4096)
        if not more:
            raise ConnectionError("refused")
        head += more
    link.sendall(bytes([0x81, 0x80 | len(HELLO)]) + bytes(4) + HELLO)
    return link


def discard(link):
    try:
        while link.recv(1 << 16):
            pass
    except (OSError, ValueError):  # the other thread has closed it
        return


def flood(port, data, tls):
    while True:
        try:
            with connect(port, tls) as link:
                threading.Thread(target=discard, args=(link,), daemon=True).start()
                while data:
                    link.sendall(data)
        except OSError:
            continue


def begin_by_half(port, tls):
    """Open connections that say half of what begins them, and wait."""
    half, links = half_of_a_hello() if tls is not None else b"GET / HTTP/1.1\r\nHost: 127", deque()
    while True:
        with contextlib.suppress(OSError):
            links.append(socket.create_connection(("127.0.0.1", port), 10.0))
            links[-1].sendall(half)
        if len(links) > HALF_BEGUN:
            links.popleft().close()


def main(port, count, kind, *more):
    tls = context() if more else None
    work, args = (flood, (port, KINDS[kind], tls)) if kind != "half begun" else (begin_by_half, (port, tls))
    for _ in range(count):
        threading.Thread(target=work, args=args, daemon=True).start()
    print("flooding", flush=True)
    threading.Event().wait()


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:])
