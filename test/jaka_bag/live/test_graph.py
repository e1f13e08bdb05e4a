"""The XMLRPC side of a node: the questions of others, and what goes wrong."""
import contextlib
import gzip
import http.server
import os
import socket
import threading
import xmlrpc.client

import pytest

from jaka_bag.errors import ConnectionLost, ProtocolError
from jaka_bag.live.graph import RemoteNode, SlaveServer
from jaka_bag.live.names import NodeNames
from jaka_bag.live.subscriber import Subscriber


@contextlib.contextmanager
def answering(headers, body):
    """Answer each call so, at the URI that is given."""
    class Handler(http.server.BaseHTTPRequestHandler):
        def do_POST(self):
            self.rfile.read(int(self.headers["content-length"]))
            self.send_response(200)
            for name, value in {"Content-Type": "text/xml", "Content-Length": str(len(body)), **headers}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *arguments):
            pass

    with http.server.HTTPServer(("127.0.0.1", 0), Handler) as http_server:
        thread = threading.Thread(target=http_server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield "http://127.0.0.1:%d/" % http_server.server_address[1]
        finally:
            http_server.shutdown()
            thread.join()


@pytest.fixture
def server():
    told = []
    slave = SlaveServer("/recorder", "127.0.0.1", "127.0.0.1", lambda topic, uris: told.append((topic, uris)),
                        lambda reason: told.append(reason))
    slave.told = told
    yield slave
    slave.close()


@pytest.fixture
def peer(server):
    node = RemoteNode(server.uri, "/caller", 10.0)
    yield node
    node.close()


def test_the_master_reports_publishers_and_others_may_end_the_node(server, peer):
    assert peer.call("publisherUpdate", "/a", ["http://x/", "http://y/"]) == 0
    assert peer.call("shutdown", "enough") == 0
    assert server.told == [("/a", ["http://x/", "http://y/"]), "/caller: enough"]


_REPLY = "<?xml version='1.0'?><methodResponse><params><param>%s</param></params></methodResponse>"


@pytest.mark.parametrize("headers, body", [
    ({}, (_REPLY % "<value><struct><member><name>a</name></member></struct></value>").encode()),
    ({}, (_REPLY % "<value><dateTime.iso8601>x</dateTime.iso8601></value>").encode()), ({}, b""), ({}, b"<a/>"),
    ({}, (_REPLY % "<value><int>x</int></value>").encode()), ({}, b"<?xml version='1.0' encoding='x-none'?><a/>"),
    ({}, (_REPLY % "</value>").encode()), ({}, (_REPLY % "<value><base64>a</base64></value>").encode()),
    ({"Content-Encoding": "gzip"}, gzip.compress(b"<a/>" * 99)[:20]), ({"Content-Encoding": "gzip"}, b"no gzip"),
    ({"Content-Encoding": "gzip"}, gzip.compress(b"<a/>")[:10] + b"\xff" * 9),
    ({"Content-Encoding": "gzip"}, gzip.compress(b"")), ({}, b"<methodCall><methodName>x</methodName></methodCall>")],
    ids=map(str, range(13)))
def test_an_odd_reply_is_an_error_that_callers_foresee(headers, body):
    with answering(headers, body) as uri, RemoteNode(uri, "/caller", 10.0) as node, \
            pytest.raises((ProtocolError, ConnectionLost)):
        node.call("getPid")


@pytest.mark.parametrize("uri", ["", "x", "ftp://a/", "http://", "http://[", "http://a:b/", "http://\udc80:1/",
                                 "http://a b:1/", "http://%s:1/" % ("a" * 80), "http://a:99999999/"])
def test_an_odd_address_is_an_error_that_callers_foresee(uri):
    with pytest.raises((ProtocolError, ConnectionLost)), RemoteNode(uri, "/caller", 2.0) as node:
        node.call("getPid")


def test_a_shutdown_of_the_node_that_had_the_port_before_is_refused(server, peer):
    with pytest.raises(ProtocolError, match="this is /recorder"):
        peer.call("shutdown", "[/killed] Reason: new node registered with same name")
    assert server.told == []
    assert peer.call("shutdown", "[/recorder] Reason: new node registered with same name") == 0
    assert len(server.told) == 1


def test_the_node_answers_what_rosnode_asks(server, peer, monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", "http://master:1/")
    server.subscriptions = lambda: [["/a", "*"]]
    server.publications = lambda: [["/b", "std_msgs/String"]]
    assert peer.call("getPid") == os.getpid()
    assert peer.call("getName") == "/recorder"
    assert peer.call("getMasterUri") == "http://master:1/"
    assert peer.call("getSubscriptions") == [["/a", "*"]]
    assert peer.call("getPublications") == [["/b", "std_msgs/String"]]
    assert peer.call("getBusInfo") == []
    assert peer.call("getBusStats") == [[], [], []]
    assert peer.call("paramUpdate", "/p", 1) == 0


def test_a_topic_is_where_its_owner_says(server, peer):
    with pytest.raises(ProtocolError, match="not published here"):
        peer.call("requestTopic", "/a", [["TCPROS"]])
    server.topic_address = lambda topic: ("host", 5)
    assert peer.call("requestTopic", "/a", [["TCPROS"]]) == ["TCPROS", "host", 5]
    with pytest.raises(ProtocolError, match="not published here"):
        peer.call("requestTopic", "/a", [["UDPROS", "x"]])


def test_a_transport_that_is_closed_writes_to_nothing(monkeypatch, server, tmp_path):
    # Its wake-up pipe's number may long be that of the log file.
    monkeypatch.setenv("ROS_MASTER_URI", server.uri)
    monkeypatch.setenv("ROS_IP", "127.0.0.1")
    transport = Subscriber(NodeNames("/me"), lambda *message: None, lambda *link: None, str, str)
    transport.wake()
    transport.poll(1.0)
    transport.close()
    files = [open(str(tmp_path / str(i)), "wb") for i in range(20)]  # take the free numbers
    transport.wake()
    for file in files:
        file.close()
        assert (tmp_path / file.name).stat().st_size == 0


def test_an_unknown_method_is_a_protocol_error(peer):
    with pytest.raises(ProtocolError, match="noSuchMethod"):
        peer.call("noSuchMethod")


def test_nobody_there_is_a_lost_connection():
    with pytest.raises(ConnectionLost, match="no answer"):
        RemoteNode("http://127.0.0.1:1/", "/me").call("getPid")


def test_silence_is_a_lost_connection():
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        deaf.listen(1)
        with pytest.raises(ConnectionLost, match="no answer"):
            RemoteNode("http://127.0.0.1:%d/" % deaf.getsockname()[1], "/me", 0.1).call("getPid")


def test_what_is_no_uri_is_a_protocol_error():
    with pytest.raises(ProtocolError, match="no XMLRPC address"):
        RemoteNode("nonsense", "/me")


@pytest.mark.parametrize("answer, reason", [
    (b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\nhello", "failed at"),
    (b"HTTP/1.1 500 No\r\nContent-Length: 0\r\n\r\n", "failed at"),
    (b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n%s" % (len(xmlrpc.client.dumps((7,), methodresponse=True)),
                                                          xmlrpc.client.dumps((7,), methodresponse=True).encode()),
     "is not")])
def test_an_answer_that_is_none_is_a_protocol_error(answer, reason):
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen(1)

        def reply():
            connection, _ = listener.accept()
            with connection:
                request = b""
                while b"</methodCall>" not in request:
                    request += connection.recv(65536)
                connection.sendall(answer)
        thread = threading.Thread(target=reply)
        thread.start()
        with pytest.raises(ProtocolError, match=reason):
            RemoteNode("http://127.0.0.1:%d/" % listener.getsockname()[1], "/me", 10.0).call("getPid")
        thread.join()
