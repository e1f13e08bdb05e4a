"""The wire of TCPROS: cut anywhere, glued anyhow, broken in every way."""
import contextlib
import select
import socket
import struct
import time

import pytest

from jaka_bag.errors import ConnectionLost, ProtocolError
from jaka_bag.live.tcpros import PublisherLink, connection_of, decode_header, encode_header, resolve

HEADER = {"callerid": "/talker", "latching": "1", "md5sum": "abc", "message_definition": "string data\n# caf\u00e9",
          "type": "std_msgs/String", "topic": "/a", "tcp_nodelay": "0"}


class Wire:
    """A link, and the publisher's end of it in the test's hand."""

    def __init__(self):
        self._listener = socket.socket()
        self._listener.bind(("127.0.0.1", 0))
        self._listener.listen(1)
        self.heard = []
        self.link = PublisherLink("/me", "/a", "http://publisher/", self._listener.getsockname(), True,
                                  on_open=lambda link: link.connection.callerid)
        self.publisher, _ = self._listener.accept()
        select.select([], [self.link], [], 5.0)
        self.link.finish_connecting()
        size = struct.unpack("<I", self.publisher.recv(4))[0]
        self.request = decode_header(self.publisher.recv(size))

    def send(self, data):
        self.publisher.sendall(data)

    def read(self, until):
        deadline = time.monotonic() + 30
        while not until():
            assert time.monotonic() < deadline
            if select.select([self.link], [], [], 0.1)[0]:
                self.link.read(lambda tag, stamp, data: self.heard.append((tag, stamp, data)))

    def close(self):
        self.publisher.close()
        self.link.close()
        self._listener.close()


@pytest.fixture
def wire():
    with contextlib.closing(Wire()) as connected:
        yield connected


def test_headers_survive_the_wire():
    raw = encode_header(HEADER)
    assert struct.unpack_from("<I", raw)[0] == len(raw) - 4
    assert decode_header(raw[4:]) == HEADER


@pytest.mark.parametrize("cut", range(1, 14))
def test_a_header_cut_short_is_an_error(cut):
    raw = encode_header({"a": "1", "bc": "2"})[4:]
    if cut == 7:  # the end of the first field
        assert decode_header(raw[:cut]) == {"a": "1"}
        return
    with pytest.raises(ProtocolError):
        decode_header(raw[:cut] if cut < len(raw) else raw + b"\1")


def test_a_field_without_a_value_is_an_error():
    with pytest.raises(ProtocolError, match="without '='"):
        decode_header(struct.pack("<I", 3) + b"abc")


def test_a_connection_says_what_its_publisher_said():
    connection = connection_of("/a", HEADER)
    assert (connection.topic, connection.datatype, connection.md5sum) == ("/a", "std_msgs/String", "abc")
    assert (connection.callerid, connection.latching) == ("/talker", True)
    assert connection.definition == HEADER["message_definition"]
    assert connection.extra == (("tcp_nodelay", "0"),)


@pytest.mark.parametrize("fields, reason", [({"error": "no such topic"}, "no such topic"),
                                            ({"type": "a/B"}, "no type")])
def test_a_refusal_is_an_error(fields, reason):
    with pytest.raises(ProtocolError, match=reason):
        connection_of("/a", fields)


def test_the_request_asks_for_any_type(wire):
    assert wire.request == {"callerid": "/me", "topic": "/a", "type": "*", "md5sum": "*", "message_definition": "",
                            "tcp_nodelay": "1"}


@pytest.mark.parametrize("piece", [1, 2, 3, 5, 7, 64, 10**6])
def test_messages_are_whole_wherever_the_stream_is_cut(wire, piece):
    payloads = [b"", b"x", b"four", b"y" * 300, b"", b"z" * 20]
    stream = encode_header(HEADER) + b"".join(struct.pack("<I", len(p)) + p for p in payloads)
    for begin in range(0, len(stream), piece):
        wire.send(stream[begin:begin + piece])
        if piece < 10:
            select.select([wire.link], [], [], 5.0)
            wire.link.read(lambda tag, stamp, data: wire.heard.append((tag, stamp, data)))
    wire.read(lambda: len(wire.heard) == len(payloads))
    assert [data for _, _, data in wire.heard] == payloads
    assert {tag for tag, _, _ in wire.heard} == {"/talker"}


def test_large_messages_come_in_pieces(wire):
    payload = bytes(range(256)) * 20000
    wire.send(encode_header(HEADER))
    wire.publisher.setblocking(False)
    rest = memoryview(struct.pack("<I", len(payload)) + payload)

    def is_done():
        nonlocal rest
        with contextlib.suppress(BlockingIOError):
            while rest:
                rest = rest[wire.publisher.send(rest):]
        return bool(wire.heard)
    wire.read(is_done)
    assert wire.heard[0][2] == payload


def test_the_stamp_is_the_time_of_arrival_not_of_reading(wire):
    wire.send(encode_header(HEADER))
    wire.read(lambda: wire.link.connection is not None)
    for count in range(1, 21):  # the kernel begins to stamp a moment after the first socket has asked for it
        sent_at = time.time_ns()
        wire.send(struct.pack("<I", 3) + b"abc")
        arrived_by = time.time_ns()
        time.sleep(0.5)  # the reader is late
        wire.read(lambda count=count: len(wire.heard) == count)
        if wire.heard[-1][1] < arrived_by + 400000000:
            break
    assert sent_at <= wire.heard[-1][1] < arrived_by + 400000000


@pytest.mark.parametrize(("stamps", "told"), [
    ([5000000000, 4999999473, 5000000100], [5000000000, 5000000000, 5000000100]),  # as seen: 527 ns
    ([5000000000, 4872000001, 4872000001], [5000000000, 5000000000, 5000000000]),
    ([5000000000, 4872000000, 4872000500], [5000000000, 4872000000, 4872000500])])  # the clock was set back
def test_stamps_keep_the_order_of_one_link_until_the_clock_is_set(wire, stamps, told):
    wire.send(encode_header(HEADER))
    wire.read(lambda: wire.link.connection is not None)
    wire.link._stamp = 0
    arrivals = [(struct.pack("<I", 1) + bytes([n]), [(1, 35, struct.pack("@ll", *divmod(stamp, 10 ** 9)))], 0, None)
                for n, stamp in enumerate(stamps)]
    wire.link._receive = lambda size, control: arrivals.pop(0)
    for _ in stamps:
        wire.link.read(lambda tag, stamp, data: wire.heard.append((stamp, data)))
    assert wire.heard == [(stamp, bytes([n])) for n, stamp in enumerate(told)]


def test_a_publisher_that_closes_is_a_lost_connection(wire):
    wire.send(encode_header(HEADER))
    wire.publisher.close()
    with pytest.raises(ConnectionLost, match="closed the link"):
        wire.read(lambda: False)


@pytest.mark.parametrize("garbage", [b"GET / HTTP/1.1\r\n\r\n", b"\xff\xff\xff\xff",
                                     encode_header({"error": "go away"}), struct.pack("<II", 8, 99) + b"abcd"])
def test_what_is_not_tcpros_is_an_error(wire, garbage):
    wire.send(garbage)
    with pytest.raises(ProtocolError):
        wire.read(lambda: False)


def test_a_message_of_absurd_length_is_an_error(wire):
    wire.send(encode_header(HEADER) + b"\xff\xff\xff\x7f....")
    with pytest.raises(ProtocolError, match="not TCPROS"):
        wire.read(lambda: False)


def test_nobody_there_is_a_lost_connection():
    with contextlib.closing(socket.socket()) as unused:
        unused.bind(("127.0.0.1", 0))
        address = unused.getsockname()
        with contextlib.closing(PublisherLink("/me", "/a", "http://x/", address)) as link:
            select.select([], [link], [], 5.0)
            with pytest.raises(ConnectionLost, match="cannot reach"):
                link.finish_connecting()


def test_an_unknown_host_is_a_lost_connection():
    assert resolve("localhost", 5)[1] == 5
    with pytest.raises(ConnectionLost, match="cannot reach"):
        resolve("no-such-host.invalid", 1)
    with pytest.raises(ConnectionLost, match="cannot reach"):
        PublisherLink("/me", "/a", "http://x/", ("no-such-host.invalid", 1))
