"""Clients of Foxglove servers: two foreign ones, and a raw one for what no foreign client does."""
import base64
import contextlib
import fcntl
import json
import os
import queue
import shutil
import socket
import struct
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Tuple, Union

import pytest
from command_places import command_of
from import_graph import ROOT

PATIENCE_S = 60.0
_JS = ROOT / "test" / "jaka_foxglove" / "js"
SDK, OLD = "foxglove.sdk.v1", "foxglove.websocket.v1"


# ---- pymcap-cli ----

def pymcap_cli() -> str:
    program = Path(sys.executable).with_name("pymcap-cli")
    if not program.exists():
        pytest.skip("pymcap-cli is not installed (Python below 3.10)")
    return str(program)


class Recorder:
    """A process of ``pymcap-cli bridge record`` that records all topics until it has so many messages."""

    def __init__(self, port: int, output: Path, limit: int) -> None:
        self.output = output
        self._process = subprocess.Popen(
            [pymcap_cli(), "bridge", "record", "ws://127.0.0.1:%d" % port, "--all", "-o", str(output), "--limit",
             str(limit), "--no-progress"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
            universal_newlines=True)

    def wait(self) -> str:
        try:
            said = self._process.communicate(timeout=PATIENCE_S)[0]
        finally:
            self._process.kill()
        assert self._process.returncode == 0, said
        return said


# ---- @foxglove/ws-protocol ----

def _installed_js() -> Path:
    """Return a folder with the client and the packages of its lock file, made once."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("node and npm are not installed")
    folder = ROOT / "build" / "foxglove_js"
    folder.mkdir(parents=True, exist_ok=True)
    with open(str(folder / ".lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        wanted = (_JS / "package-lock.json").read_bytes()
        stamp = folder / "installed.json"
        if not stamp.exists() or stamp.read_bytes() != wanted:
            for name in ("package.json", "package-lock.json"):
                shutil.copy(str(_JS / name), str(folder / name))
            done = subprocess.run(["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund"], cwd=str(folder),
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=200,
                                  stdin=subprocess.DEVNULL)
            assert done.returncode == 0, done.stdout
            stamp.write_bytes(wanted)
        shutil.copy(str(_JS / "client.mjs"), str(folder / "client.mjs"))
    return folder


class Message(NamedTuple):
    """A message as a client received it; ``time`` is ns."""

    topic: str
    time: int
    data: bytes


class JsClient:
    """The client of npm's ``@foxglove/ws-protocol``, subscribed to everything.

    Attributes:
        events: All its events, in order: (event, value).
    """

    def __init__(self, port: int, subprotocol: str) -> None:
        folder = _installed_js()
        self.events: List[Tuple[str, Any]] = []
        self._changed = threading.Condition()
        self._process = subprocess.Popen(["node", "client.mjs", "ws://127.0.0.1:%d" % port, subprotocol],
                                         cwd=str(folder), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                         universal_newlines=True)
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            entry = json.loads(line)
            with self._changed:
                self.events.append((entry["event"], entry["value"]))
                self._changed.notify_all()
        with self._changed:
            self.events.append(("end", None))
            self._changed.notify_all()

    def values(self, event: str) -> List[Any]:
        return [value for name, value in list(self.events) if name == event]

    def wait(self, event: str, count: int = 1) -> List[Any]:
        """Wait until it has had so many of these events."""
        with self._changed:
            self._changed.wait_for(lambda: len(self.values(event)) >= count or self.values("end"), PATIENCE_S)
        found = self.values(event)
        assert len(found) >= count, self.events[:20]
        return found

    def messages(self, count: int) -> List[Message]:
        return [Message(topic, int(time), base64.b64decode(data)) for topic, time, data in self.wait("message", count)]

    def do(self, name: str, *values: Any) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"do": name, "with": values}) + "\n")
        self._process.stdin.flush()

    def __enter__(self) -> "JsClient":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        self._reader.join()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()


# ---- a raw one ----

class Refused(Exception):
    """An HTTP answer that is no WebSocket: status and text."""


class RawViewer:
    """A WebSocket by hand, which can be as unkind as a test wants.

    Args:
        port: The server's, on 127.0.0.1.
        subprotocols: As they stand in the header, None for no such header.
        headers: Further ones; ``Host`` replaces the usual one.
        receive_buffer: Bytes that the system takes for it; None for the usual.
    """

    def __init__(self, port: int, subprotocols: Optional[str] = SDK, headers: Optional[Dict[str, str]] = None,
                 receive_buffer: Optional[int] = None) -> None:
        self.socket = socket.socket()
        if receive_buffer is not None:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect(("127.0.0.1", port))
        fields = {"Host": "127.0.0.1:%d" % port, "Upgrade": "websocket", "Connection": "Upgrade",
                  "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": base64.b64encode(os.urandom(16)).decode()}
        if subprotocols is not None:
            fields["Sec-WebSocket-Protocol"] = subprotocols
        fields.update(headers or {})
        lines = ["GET / HTTP/1.1"] + ["%s: %s" % field for field in fields.items()]
        self.socket.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        self._stream = self.socket.makefile("rb")
        answer = self._stream.readline().split()
        self.headers = dict(line.decode().strip().lower().split(": ", 1)
                            for line in iter(self._stream.readline, b"\r\n") if b": " in line)
        if answer[1:2] != [b"101"]:
            text = self._stream.read(int(self.headers.get("content-length", "0"))).decode()
            self.close()
            raise Refused(int(answer[1]), text)

    def close(self) -> None:
        self._stream.close()
        self.socket.close()

    def __enter__(self) -> "RawViewer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def frame(self, opcode: int, payload: bytes, is_final: bool = True) -> bytes:
        size = len(payload)
        head = bytes([opcode | (128 if is_final else 0)])
        head += bytes([size | 128]) if size < 126 else struct.pack(">BH", 254, size) if size < 1 << 16 \
            else struct.pack(">BQ", 255, size)
        return head + bytes(4) + payload  # a mask of zeros

    def send(self, message: Union[bytes, str, Dict[str, Any]]) -> None:
        if isinstance(message, bytes):
            self.socket.sendall(self.frame(2, message))
        else:
            text = message if isinstance(message, str) else json.dumps(message)
            self.socket.sendall(self.frame(1, text.encode()))

    def subscribe(self, *channels: int) -> None:
        """Subscribe to channels, with the channel's number as that of the subscription."""
        self.send({"op": "subscribe", "subscriptions": [{"id": n, "channelId": n} for n in channels]})

    def receive(self) -> Union[bytes, str, None]:
        """Receive the next message; None where the connection ends, whose code is then in ``close_code``."""
        while True:
            head = self._stream.read(2)
            if len(head) < 2:
                return None
            size = head[1] & 127
            if size == 126:
                size = struct.unpack(">H", self._stream.read(2))[0]
            elif size == 127:
                size = struct.unpack(">Q", self._stream.read(8))[0]
            payload = self._stream.read(size)
            opcode = head[0] & 15
            if opcode == 8:
                self.close_code = struct.unpack(">H", payload[:2])[0]
                return None
            if opcode == 1:
                return payload.decode()
            if opcode == 2:
                return payload

    def until(self, wanted: Any) -> Any:
        """Receive until ``wanted`` makes something other than None of a message; return that. Messages before are
        lost."""
        while True:
            message = self.receive()
            assert message is not None, "the connection ended"
            found = wanted(message)
            if found is not None:
                return found

    def text(self, op: str) -> Dict[str, Any]:
        """Receive the next text message of an op."""
        def wanted(message: Union[bytes, str]) -> Optional[Dict[str, Any]]:
            if isinstance(message, str):
                value: Dict[str, Any] = json.loads(message)
                return value if value["op"] == op else None
            return None
        found: Dict[str, Any] = self.until(wanted)
        return found

    def ended(self) -> bool:
        """Read until the connection ends."""
        with contextlib.suppress(ConnectionError):
            while self.receive() is not None:
                pass
        return True


class State(NamedTuple):
    """A playback's state as it was received."""

    state: int
    time: int
    speed: float
    did_seek: bool
    request: str


def state_of(message: Union[bytes, str]) -> Optional[State]:
    if not isinstance(message, bytes) or message[0] != 5:
        return None
    state, time, speed, did_seek, size = struct.unpack_from("<BQfBI", message, 1)
    assert len(message) == 19 + size
    return State(state, time, speed, bool(did_seek), message[19:].decode())


def data_of(message: Union[bytes, str]) -> Optional[Tuple[int, int, bytes]]:
    """Return subscription, log time, ns, and payload of a message."""
    if not isinstance(message, bytes) or message[0] != 1:
        return None
    return (*struct.unpack_from("<IQ", message, 1), message[13:])  # type: ignore[return-value]


def control(is_playing: bool, speed: float = 1.0, seek: Optional[int] = None, request: str = "r") -> bytes:
    return struct.pack("<BBfBQI", 3, 0 if is_playing else 1, speed, seek is not None, seek or 0,
                       len(request)) + request.encode()


# ---- the command ----

class Served:
    """A server process that listens.

    Attributes:
        port: Its port.
        lines: Its output.
    """

    def __init__(self, *command: str, environment: Optional[Dict[str, str]] = None) -> None:
        self.lines: List[str] = []
        self._heard: queue.Queue[str] = queue.Queue()
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                        stdin=subprocess.DEVNULL, universal_newlines=True, env=environment)
        self._reader = threading.Thread(target=self._read)
        self._reader.start()
        self.port = int(self.wait_for("open ws://").split(" in Foxglove")[0].rsplit(":", 1)[1])

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n"))
            self._heard.put(line)
        self._heard.put("")

    def wait_for(self, text: str) -> str:
        """Wait for the next line with a text in it, and return it."""
        while True:
            line = self._heard.get(timeout=PATIENCE_S)
            assert line, "it ended: %s" % self.lines
            if text in line:
                return line.strip()

    def stop(self, number: int) -> int:
        """Send a signal; return the exit code."""
        self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)

    def __enter__(self) -> "Served":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._reader.join()
        assert self.process.stdout is not None
        self.process.stdout.close()


@contextlib.contextmanager
def serving(*arguments: str) -> Iterator[Served]:
    """Run ``jaka_bag serve`` on a free port."""
    with Served(*command_of("jaka_bag"), "serve", "--port", "0", *arguments) as served:
        yield served
