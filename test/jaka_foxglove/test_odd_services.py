"""Services of the graph whose addresses or headers are odd: the others are shown, and the watch goes on."""
import asyncio
import contextlib
import socket
import struct
import sys
import threading
import time
import types
from types import SimpleNamespace

import pytest

from jaka_bag.errors import ProtocolError
from jaka_bag.live.names import NodeNames
from jaka_bag.live.subscriber import accept_all
from jaka_bag.live.tcpros import encode_header
from jaka_bag.live.topic_selection import TopicSelection
from jaka_foxglove import service_calls
from jaka_foxglove.live_topics import LiveOptions, LiveTopics
from jaka_foxglove.service_calls import ServiceCalls

PATIENCE_S = 20.0
GOOD = {"type": "cell_msgs/Switch", "md5sum": "0" * 32}


@pytest.fixture(autouse=True)
def installed(monkeypatch):
    """Install a package with one service type, as a workspace has them."""
    request = SimpleNamespace(_full_text="bool data")
    package, services = types.ModuleType("cell_msgs"), types.ModuleType("cell_msgs.srv")
    services.Switch = SimpleNamespace(_md5sum="0" * 32, _request_class=request, _response_class=request)
    monkeypatch.setitem(sys.modules, "cell_msgs", package)
    monkeypatch.setitem(sys.modules, "cell_msgs.srv", services)


@contextlib.contextmanager
def server_of(header, breaks=0):
    """Answer each probe with this header, but break the first links; yield the address."""
    broken = [None] * breaks
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    listener.listen(8)

    def serve():
        while True:
            try:
                link, _ = listener.accept()
            except OSError:
                return
            with link, contextlib.suppress(OSError):
                link.settimeout(PATIENCE_S)
                link.recv(struct.unpack("<I", link.recv(4))[0])
                if broken:
                    broken.pop()
                    continue
                link.sendall(encode_header(header))
    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield "rosrpc://127.0.0.1:%d" % listener.getsockname()[1]
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        thread.join()


class Master:
    """A master that knows these services, by name."""

    def __init__(self, services):
        self.services = services

    def call(self, method, *arguments):
        if method == "getSystemState":
            return [[], [], [[name, ["/node"]] for name in self.services]]
        return self.services[arguments[0]]


def shown(services):
    """Return the names of the services that are shown of these, once there are any."""
    return shown_by(ServiceCalls("/viewers", "/", lambda text: None), Master(services))


def shown_by(calls, master):
    """Look until something is told, and return the names that are shown then; no look may be held up."""
    found, until = [], time.monotonic() + PATIENCE_S
    while not found and time.monotonic() < until:
        since = time.monotonic()
        calls._due = 0.0
        calls.look(master, lambda by_number, frames: found.extend(sorted(one.name for one in by_number.values())))
        assert time.monotonic() - since < 4.0
    return found


@pytest.mark.parametrize("uri", ["rosrpc://host:70000", "rosrpc://[bad:1", "rosrpc://a..b:80", "rosrpc://host:x",
                                 "rosrpc://%s.b:80" % ("a" * 70), ""])
def test_a_service_without_an_address_leaves_the_others_shown(uri):
    with server_of(GOOD) as good:
        assert shown({"/a": uri, "/b": good}) == ["/b"]


def test_a_node_that_hangs_holds_up_neither_the_watch_nor_the_others():
    with socket.socket() as hung, server_of(GOOD) as good:
        hung.bind(("127.0.0.1", 0))
        hung.listen(8)  # it takes links, and never says a word
        silent = "rosrpc://127.0.0.1:%d" % hung.getsockname()[1]
        master = Master({"/a": silent, "/b": silent, "/c": good})
        calls = ServiceCalls("/viewers", "/", lambda text: None)
        assert shown_by(calls, master) == ["/c"]
        with server_of(GOOD) as later:
            master.services["/d"] = later
            assert shown_by(calls, master) == ["/c", "/d"]


def test_a_node_that_hangs_is_asked_by_one_thread_at_a_time(monkeypatch):
    monkeypatch.setattr(service_calls, "_CONNECT_TIMEOUT_S", 0.2)
    monkeypatch.setattr(service_calls, "_PATIENCE_S", 0.05)
    with socket.socket() as hung:
        hung.bind(("127.0.0.1", 0))
        hung.listen(99)
        silent = "rosrpc://127.0.0.1:%d" % hung.getsockname()[1]
        calls = ServiceCalls("/viewers", "/", lambda text: None)
        master = Master({"/%d" % number: silent for number in range(8)})
        before, most, until = set(threading.enumerate()), 0, time.monotonic() + 2.0
        while time.monotonic() < until:
            calls._due = 0.0
            calls.look(master, lambda by_number, frames: None)
            most = max(most, len(set(threading.enumerate()) - before))
            time.sleep(0.02)  # the period of the looks; how many threads they leave is the subject
    assert 1 <= most <= 2, "a thread that ends may be seen beside the next one"


@pytest.mark.filterwarnings("ignore")  # the thread ends by what nobody foresaw
def test_services_are_asked_again_where_the_asking_itself_failed(monkeypatch):
    real, failed = asyncio.run, []

    def fails_once(asking):
        if failed:
            return real(asking)
        failed.append(asking.close())
        raise OSError("too many open files")
    monkeypatch.setattr(asyncio, "run", fails_once)
    with server_of(GOOD) as good:
        assert shown({"/a": good}) == ["/a"] and failed


def test_a_service_whose_link_breaks_leaves_the_others_of_its_node_shown():
    with server_of(GOOD, breaks=1) as good:
        assert "/b" in shown({"/a": good, "/b": good})


@pytest.mark.parametrize("type_name", ["", "./x", "..", "cell_msgs/", "/", "cell_msgs/\0", "a b/c"])
def test_a_service_whose_type_is_none_leaves_the_others_shown(type_name):
    with server_of(dict(GOOD, type=type_name)) as odd, server_of(GOOD) as good:
        assert shown({"/a": odd, "/b": good}) == ["/b"]


def test_a_package_that_fails_while_it_is_imported_leaves_the_others_shown(tmp_path, monkeypatch):
    (tmp_path / "broken_msgs").mkdir()
    (tmp_path / "broken_msgs" / "__init__.py").write_text("")
    (tmp_path / "broken_msgs" / "srv.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    with server_of(dict(GOOD, type="broken_msgs/Any")) as odd, server_of(GOOD) as good:
        assert shown({"/a": odd, "/b": good}) == ["/b"]


@pytest.mark.parametrize("error", [RuntimeError("odd"), ProtocolError("odd")])
def test_the_watch_goes_on_after_what_nobody_foresaw(error, monkeypatch):
    notices, looks = [], []
    live = LiveTopics(NodeNames("/viewers"), LiveOptions(TopicSelection(everything=True), accept_all), notices.append,
                      notices.append)

    def look(master):
        looks.append(master)
        if len(looks) >= 3:
            live._stop.set()
        live._wake.set()
        raise error
    monkeypatch.setattr(live, "_look_at_topics", look)
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1/")
    since = time.monotonic()
    live._watch()
    assert len(looks) == 3 and time.monotonic() - since < PATIENCE_S
    assert len(notices) == 1 and "odd" in notices[0], "it is said once"
