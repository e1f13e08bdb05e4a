"""Plain sockets against the simulated controller, written from the protocol document; no code of the driver's
client."""
import json
import socket
import time
import zlib
from typing import Any, Callable, Dict, List

PATIENCE_S = 20.0
"""Longest wait for something that must come, s; never a measure of speed."""


class RawClient:
    """One TCP connection that cuts the replies apart by JSON's own grammar."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._text = ""

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def reply(self, timeout: float = PATIENCE_S) -> Dict[str, Any]:
        """Return the next reply; raise TimeoutError when none comes, ConnectionError when the link ends."""
        deadline = time.monotonic() + timeout
        while True:
            text = self._text.lstrip()
            try:
                value, end = json.JSONDecoder().raw_decode(text)
                self._text = text[end:]
                return value
            except ValueError:
                pass
            self.socket.settimeout(max(0.001, deadline - time.monotonic()))
            try:
                data = self.socket.recv(65536)
            except socket.timeout:
                raise TimeoutError("no reply; have %r" % self._text[:100]) from None
            if not data:
                raise ConnectionError("closed; have %r" % self._text[:100])
            self._text += data.decode("latin-1")

    def ask(self, command: str, **parameters: Any) -> Dict[str, Any]:
        self.send(json.dumps(dict(parameters, cmdName=command)).encode())
        return self.reply()

    def code(self, command: str, **parameters: Any) -> str:
        return self.ask(command, **parameters)["errorCode"]

    def is_silent(self, duration: float) -> bool:
        try:
            self.reply(duration)
        except (TimeoutError, socket.timeout):
            return True
        return False

    def is_closed(self, timeout: float = PATIENCE_S) -> bool:
        """Return whether the other side ends the link within the time; bytes before the end are dropped."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            self.socket.settimeout(max(0.001, deadline - time.monotonic()))
            try:
                if not self.socket.recv(65536):
                    return True
            except socket.timeout:
                return False
            except OSError:
                return True
        return False

    def close(self) -> None:
        self.socket.close()

    def __enter__(self) -> "RawClient":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class RawFeed(RawClient):
    """The status feed: frames cut by ``len``, each checked to be exactly as long as it states."""

    def __init__(self, port: int) -> None:
        super().__init__(port)
        self._bytes = b""

    def raw_frame(self, timeout: float = PATIENCE_S) -> bytes:
        deadline = time.monotonic() + timeout
        while True:
            if self._bytes.startswith(b'{"len": ') and b"," in self._bytes:
                length = int(self._bytes[8:self._bytes.index(b",")])
                if len(self._bytes) >= length:
                    frame, self._bytes = self._bytes[:length], self._bytes[length:]
                    return frame
            elif self._bytes[:8] not in (b"", b'{"len": '[:len(self._bytes[:8])]):
                raise AssertionError("no frame begins with %r" % self._bytes[:40])
            self.socket.settimeout(max(0.001, deadline - time.monotonic()))
            data = self.socket.recv(65536)
            if not data:
                raise ConnectionError("closed")
            self._bytes += data

    def frame(self, timeout: float = PATIENCE_S) -> Dict[str, Any]:
        return json.loads(self.raw_frame(timeout))

    def until(self, condition: Callable[[Dict[str, Any]], bool], timeout: float = PATIENCE_S) -> List[Dict[str, Any]]:
        """Return frames up to the first that fulfils the condition, that one included."""
        deadline, frames = time.monotonic() + timeout, []
        while True:
            frames.append(self.frame(max(0.001, deadline - time.monotonic())))
            if condition(frames[-1]):
                return frames


def poll(client: RawClient, timeout: float = PATIENCE_S) -> bytes:
    """Send one request of the maker's SDK to the polled port; return the inflated answer."""
    client.send(b'{"cmdName":"data_request"}')
    client.socket.settimeout(timeout)
    inflate = zlib.decompressobj()
    text = b""
    while not inflate.eof:
        data = client.socket.recv(65536)
        if not data:
            raise ConnectionError("closed")
        text += inflate.decompress(data)
    assert not inflate.unused_data
    return text
