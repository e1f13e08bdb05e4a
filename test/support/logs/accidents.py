"""A stand-in for the driver that numbers what it publishes and has accidents; a black box beside it; the judgement."""
import contextlib
import json
import signal
import struct
import threading
import time
from pathlib import Path
from typing import Dict, Iterator, List, NamedTuple

from accident_samples import CALLS, DIAGNOSTICS, STATES, call, diagnostics, states
from live_samples import twist_connection, twist_frame
from ros_graph import Graph, Process, all_read, with_subscribers
from waiting import wait_until

from jaka_bag.containers.interface import Message
from jaka_bag.containers.registry import open_log, read_index, read_metadata
from jaka_bag.containers.time_order import messages_of
from jaka_bag.live.publisher import frame_of

NUMBERED = "/jaka_driver/tool_position"
MEASURE = twist_connection("/force")
CONDITION = "/force.twist.linear.x > 3"
PERIOD_S = 0.008
KINDS = ("error", "emergency_stop", "collision", "failed_call", "diagnostics", "expression", "service", "signal")


class Driver:
    """A publisher of numbered poses and states at 125 Hz, in a thread of its own until it is closed.

    Attributes:
        sent: Poses sent so far.
        sent_at: When each was sent, s since the epoch.
    """

    def __init__(self, publisher) -> None:
        self._publisher = publisher
        self._lock = threading.Lock()
        self.outlets = {connection.topic: publisher.advertise(connection.topic, connection, False)
                        for connection in (twist_connection(NUMBERED), STATES, CALLS, DIAGNOSTICS, MEASURE)}
        with_subscribers(publisher, *self.outlets.values())
        self.state = states(0, 1, 0, 0)
        self.sent = 0
        self.sent_at: List[float] = []
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def send(self, topic: str, data: bytes) -> None:
        with self._lock:
            self._publisher.publish(self.outlets[topic], frame_of(data))

    def _run(self) -> None:
        due = time.monotonic()
        while not self._ending.is_set():
            self.send_sample()
            due = max(due + PERIOD_S, time.monotonic() - 0.1)
            self._ending.wait(max(0.0, due - time.monotonic()))

    def send_sample(self) -> None:
        with self._lock:
            self.sent += 1
            self.sent_at.append(time.time())
            self._publisher.publish(self.outlets[NUMBERED], twist_frame(self.sent, time.time_ns()))
            self._publisher.publish(self.outlets[STATES.topic], frame_of(self.state))

    def close(self) -> None:
        self._ending.set()
        self._thread.join()
        with contextlib.suppress(OSError):  # a black box that was killed reads nothing more
            all_read(self._publisher)


def set_off(kind: str, driver: Driver, box: Process, graph: Graph) -> None:
    """Cause one trigger, and end its cause again."""
    before = driver.sent
    if kind in ("error", "emergency_stop", "collision"):
        driver.state = {"error": states(4, 1, 0, 0), "emergency_stop": states(2, 1, 0, 0),
                        "collision": states(3, 1, 0, 1)}[kind]
        wait_until(lambda: driver.sent > before + 2, "the state is sent")
        driver.state = states(0, 1, 0, 0)
    elif kind == "failed_call":
        driver.send(CALLS.topic, call("/jaka_driver/joint_move", False, "out of reach", time_ns=time.time_ns()))
    elif kind == "diagnostics":
        for level in (2, 0):
            driver.send(DIAGNOSTICS.topic, diagnostics({"jaka_driver: controller link": level}, time_ns=time.time_ns()))
    elif kind == "expression":
        for value in (9, 0):
            driver.send(MEASURE.topic, twist_frame(value, time.time_ns())[4:])
    elif kind == "service":
        answer = call_trigger(graph)
        assert answer[0] and answer[1].endswith(".mcap"), answer
    else:
        box.popen.send_signal(signal.SIGUSR1)


def call_trigger(graph: Graph):
    """Call the service of the black box as any client does; return its success and message."""
    import socket

    from jaka_bag.live.tcpros import decode_header, encode_header
    uri = graph.master().lookupService("/jaka_black_box/trigger")
    host, port = uri[len("rosrpc://"):].rsplit(":", 1)
    with socket.create_connection((host, int(port)), timeout=30) as link:
        link.sendall(encode_header({"callerid": "/test", "service": "/jaka_black_box/trigger", "md5sum": "*"}))
        stream = link.makefile("rb")
        header = decode_header(stream.read(struct.unpack("<I", stream.read(4))[0]))
        assert header["type"] == "std_srvs/Trigger", header
        link.sendall(struct.pack("<I", 0))
        assert stream.read(1) == b"\x01"
        body = stream.read(struct.unpack("<I", stream.read(4))[0])
        stream.close()
    return bool(body[0]), body[5:].decode()


class Account(NamedTuple):
    """The content of one file: its triggers, its messages, and what is missing in it.

    ``lost`` counts numbers that are skipped between the first and the last pose, and numbers of the recorder that are
    skipped on any topic; ``before_s`` and ``after_s`` are from the first message to the first trigger, and from the
    last trigger to the last message.
    """

    triggers: List[Dict[str, str]]
    messages: List[Message]
    poses: List[int]
    lost: int
    before_s: float
    after_s: float


def metadata_of(path: Path, name: str) -> List[Dict[str, str]]:
    index = read_index(path)
    return [read_metadata(index, entry) for entry in index.metadata if entry.name == name]


def account_of(path: Path) -> Account:
    """Read a finished file of the black box."""
    triggers = metadata_of(path, "jaka_bag.trigger")
    with open_log(path) as log:
        messages = list(messages_of(log))
    poses = [struct.unpack_from("<I", message.data)[0] for message in messages if message.connection.topic == NUMBERED]
    lost = (poses[-1] - poses[0] + 1 - len(poses)) if poses else 0
    numbers: Dict[str, List[int]] = {}
    for message in messages:
        numbers.setdefault(message.connection.topic, []).append(message.sequence)
    lost += sum(max(found) - min(found) + 1 - len(found) for found in numbers.values())
    times = [message.log_time for message in messages]
    return Account(triggers, messages, poses, lost, (int(triggers[0]["time_ns"]) - times[0]) / 1e9,
                   (times[-1] - int(triggers[-1]["time_ns"])) / 1e9)


@contextlib.contextmanager
def black_box(graph: Graph, *arguments: str, before: str = "2s", after: str = "0.5s") -> Iterator[Process]:
    """Run ``jaka_bag record --state-log --black-box box``, listening, until the context ends."""
    process = graph.record("--state-log", "--black-box", "box", "--before", before, "--after", after, "--report",
                           "report.json", "--trigger", CONDITION, *arguments)
    yield process
    if process.popen.poll() is None:
        assert process.stop() == 0, process.output


def files_of(graph: Graph) -> List[Path]:
    return sorted(graph.folder.glob("box/*.mcap"))


def report_of(graph: Graph):
    return json.loads((graph.folder / "report.json").read_text())
