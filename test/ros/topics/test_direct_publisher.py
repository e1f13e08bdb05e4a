"""Direct connections: a listener gets whole messages in order and the newest, and is never waited for."""
import contextlib
import random
import select
import socket
import struct
import threading
import types

import pytest
import rospy
from link_transport import LinkTransport
from rospy.exceptions import TransportTerminated
from rospy.impl.tcpros_base import TCPROSTransport
from std_msgs.msg import String
from waiting import eventually

from jaka_ros_driver.ros import direct_publisher as direct
from jaka_ros_driver.ros.direct_publisher import DirectConnection, direct_publisher

QUEUE = 10
SMALL_BUFFER = 4096


def message(number, size):
    body = struct.pack("<I", number) + bytes([number % 251]) * size
    return struct.pack("<I", len(body)) + body


def messages_in(data):
    """Return the numbers of the messages in these bytes, each of which must be whole and unharmed."""
    numbers = []
    while data:
        length, number = struct.unpack_from("<II", data)
        assert len(data) >= 4 + length and data[8:4 + length] == bytes([number % 251]) * (length - 4)
        numbers.append(number)
        data = data[4 + length:]
    return numbers


@pytest.fixture
def link():
    """Yield a connection and its listener's socket, between which little fits."""
    ours, theirs = socket.socketpair()
    ours.settimeout(60.0)  # as sockets of a process have them in which rospy has connected to a publisher
    theirs.settimeout(None)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SMALL_BUFFER)
    yield DirectConnection(LinkTransport(ours), QUEUE), theirs
    ours.close()
    theirs.close()


def read_all(connection, listener):
    """Return what comes until nothing waits any more."""
    data = []
    reader = threading.Thread(target=lambda: data.extend(iter(lambda: listener.recv(65536), b"")))
    reader.start()
    assert eventually(lambda: not slow_threads())
    connection.socket.shutdown(socket.SHUT_WR)
    reader.join(10.0)
    return b"".join(data)


def slow_threads():
    return [thread for thread in threading.enumerate() if thread.name == "slow listener"]


def test_what_the_listener_takes_is_sent_in_the_publishing_thread(link):
    connection, listener = link
    for number in range(5):
        assert connection.write_data(message(number, 100))
        assert messages_in(listener.recv(65536)) == [number]
    assert not slow_threads()
    assert connection.stat_num_msg == 5 and connection.stat_bytes == 5 * 108
    assert connection.endpoint_id == "/listener"


@pytest.mark.parametrize("seed", range(20))
def test_a_listener_that_stands_still_gets_whole_messages_in_order_and_the_newest(link, seed):
    connection, listener = link
    draw = random.Random(seed)
    last = draw.randint(50, 400)
    for number in range(last + 1):
        connection.write_data(message(number, draw.choice((0, 10, 700, 5000, 60000))))
    numbers = messages_in(read_all(connection, listener))
    assert numbers == sorted(set(numbers)) and numbers[-QUEUE:] == list(range(last - QUEUE + 1, last + 1))
    assert len(numbers) < last, "nothing was dropped: the listener did not stand still"
    assert connection.stat_num_msg == len(numbers)


def test_who_has_caught_up_is_written_to_directly_again(link):
    connection, listener = link
    for number in range(30):
        connection.write_data(message(number, 5000))
    assert slow_threads()
    listener.settimeout(0.1)
    with contextlib.suppress(socket.timeout):
        while True:
            listener.recv(65536)
    assert eventually(lambda: not slow_threads())
    connection.write_data(message(30, 10))
    assert messages_in(listener.recv(65536)) == [30] and not slow_threads()


def test_messages_that_come_while_the_listener_catches_up_keep_their_order(link):
    connection, listener = link
    data = []
    reader = threading.Thread(target=lambda: data.extend(iter(lambda: listener.recv(8192), b"")))
    reader.start()
    for number in range(3000):
        connection.write_data(message(number, 900))
    assert eventually(lambda: not slow_threads())
    connection.socket.shutdown(socket.SHUT_WR)
    reader.join(10.0)
    got = messages_in(b"".join(data))
    assert got == sorted(set(got)) and got[-QUEUE:] == list(range(2990, 3000))


@pytest.mark.parametrize("count", [1, 40], ids=["that reads", "that stands still"])
def test_a_listener_that_is_gone_ends_its_connection_alone(link, count):
    connection, listener = link
    for number in range(count):
        connection.write_data(message(number, 5000))
    listener.close()

    def is_refused():
        try:
            return not connection.write_data(message(99, 10))
        except TransportTerminated:
            return True
    assert eventually(is_refused)
    assert eventually(lambda: not slow_threads())


def test_a_connection_that_is_closed_while_its_listener_stands_still_leaves_no_thread(link):
    connection, _ = link
    for number in range(40):
        connection.write_data(message(number, 5000))
    assert slow_threads()
    connection.close()
    assert eventually(lambda: not slow_threads())
    with pytest.raises(TransportTerminated):
        connection.write_data(message(99, 10))


@pytest.mark.parametrize("is_before", [False, True])
@pytest.mark.parametrize("end", [lambda connection: connection.close(), lambda connection: connection.socket.close()],
                         ids=["as rospy does", "its socket alone"])
def test_a_connection_that_is_closed_while_or_before_its_thread_waits_is_no_error(link, monkeypatch, end, is_before):
    class Waiting:
        """A wait for a listener that takes nothing; like the kernel's, it knows no negative descriptors."""

        def __init__(self):
            if is_before:
                end(connection)

        def register(self, descriptor, _events):
            if descriptor < 0:
                raise ValueError("file descriptor cannot be a negative integer (-1)")

        def poll(self, _longest):
            end(connection)

    connection, _ = link
    failures = []
    monkeypatch.setattr(threading, "excepthook", failures.append)
    monkeypatch.setattr(direct, "select", types.SimpleNamespace(poll=Waiting, POLLOUT=select.POLLOUT))
    connection.write_data(message(1, 500000))
    assert eventually(lambda: not slow_threads()) and not failures


def test_a_listener_that_came_before_is_written_to_directly_too_and_one_of_this_process_is_not(monkeypatch):
    early, inside = TCPROSTransport.__new__(TCPROSTransport), object()
    early.socket = None
    impl = types.SimpleNamespace(c_lock=threading.RLock(), connections=[early, inside], queue_size=QUEUE)
    monkeypatch.setattr(rospy, "Publisher", lambda *_, **__: types.SimpleNamespace(impl=impl))
    direct_publisher("~early", String, QUEUE)
    assert isinstance(impl.connections[0], DirectConnection) and impl.connections[1] is inside
    assert impl.queue_size is None, "rospy puts no queue of its own before it"


def test_who_asks_for_the_number_of_listeners_waits_for_nobody_who_changes_it(monkeypatch):
    lock = threading.Lock()
    impl = types.SimpleNamespace(c_lock=lock, connections=[], queue_size=QUEUE)
    monkeypatch.setattr(rospy, "Publisher", lambda *_, **__: types.SimpleNamespace(impl=impl))
    publisher = direct_publisher("~heard", String, QUEUE)
    with lock:
        assert publisher.get_num_connections() == 0
        impl.connections = [object()]
        assert publisher.get_num_connections() == 1
