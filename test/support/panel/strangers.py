"""Visitors without a token that flood a panel: an executable, a process of its own as strangers are.

Arguments: the panel's port, how many, and what each sends as fast as it goes, one of ``KINDS``. Whoever is cut off
comes again at once. It runs until it is ended.
"""
import base64
import os
import socket
import sys
import threading

PING = b"\x89\x80" + bytes(4)
FRAGMENT = b"\x00\x80" + bytes(4)
KINDS = {"ping": PING * 10000, "fragments": b"\x01\x80" + bytes(4) + FRAGMENT * 10000,
         "messages": (b"\x81\x8c" + bytes(4) + b'{"t":"ping"}') * 3000, "connections": b""}
UPGRADE = ("GET /ws HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nOrigin: http://127.0.0.1:%d\r\nConnection: Upgrade\r\n"
           "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: %s\r\n\r\n")
HELLO = b'{"t":"hello","v":1,"token":null,"name":"stranger"}'


def connect(port):
    """Open a WebSocket and say hello; return the socket."""
    link = socket.create_connection(("127.0.0.1", port), 10.0)
    key = base64.b64encode(os.urandom(16)).decode()
    link.sendall((UPGRADE % (port, port, key)).encode())
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
    except OSError:
        return


def flood(port, data):
    while True:
        try:
            with connect(port) as link:
                threading.Thread(target=discard, args=(link,), daemon=True).start()
                while data:
                    link.sendall(data)
        except OSError:
            continue


if __name__ == "__main__":
    for _ in range(int(sys.argv[2])):
        threading.Thread(target=flood, args=(int(sys.argv[1]), KINDS[sys.argv[3]]), daemon=True).start()
    print("flooding", flush=True)
    threading.Event().wait()
