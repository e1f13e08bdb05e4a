"""Calls of a master's or node's interface: what it answers, that it answers nothing, that nobody is there."""
import socket
import threading
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

import pytest

from jaka_ros_driver.ros import short_calls
from jaka_ros_driver.ros.short_calls import NobodyThere, Unanswered, ask


class Quiet(SimpleXMLRPCRequestHandler):
    """A handler that logs nothing."""

    def log_message(self, format, *arguments):
        pass


@pytest.fixture
def node():
    """Return the address of a node whose method ``answer`` gives the code that it is asked for, as ROS does."""
    with SimpleXMLRPCServer(("127.0.0.1", 0), Quiet) as server:
        server.register_function(lambda code: [int(code), "a text", "a value"], "answer")
        server.register_function(lambda: "no triple", "other")
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield "http://127.0.0.1:%d" % server.server_address[1]
        server.shutdown()
        thread.join()


def test_only_a_success_has_a_value(node):
    assert [ask(node, "answer", code) for code in ("1", "0", "-1", "2")] == ["a value", None, None, None]


def test_an_answer_that_is_none_of_ros_has_no_value(node):
    assert ask(node, "other") is None and ask(node, "unknown") is None


def test_nobody_and_nothing_are_different(monkeypatch):
    monkeypatch.setattr(short_calls, "_TIMEOUT_S", 0.1)
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        uri = "http://127.0.0.1:%d" % listener.getsockname()[1]
        with pytest.raises(NobodyThere):
            ask(uri, "answer", "1")
        listener.listen(1)
        with pytest.raises(Unanswered):
            ask(uri, "answer", "1")
