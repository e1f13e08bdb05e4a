"""The server and unkind viewers: pages that are not trusted, garbage, silence, slow readers; others do not notice."""
import contextlib
import json
import signal
import socket
import struct
import time

import pytest
from foxglove_clients import OLD, SDK, RawViewer, Refused, data_of
from waiting import wait_until

from jaka_bag.errors import JakaBagError
from jaka_foxglove import server as servers
from jaka_foxglove.access import AccessRules
from jaka_foxglove.protocol import Channel, Parameter, Service, message_data
from jaka_foxglove.source import ChannelSource


class Toy(ChannelSource):
    """A source whose channels, service and messages the test makes."""

    def __init__(self, channels=2):
        super().__init__("toy")
        self.capabilities = ("parameters", "parametersSubscribe", "services", "connectionGraph")
        self.encodings = ("ros1",)
        self.channels = {n: Channel(n, "/c%d" % n, "ros1", "std_msgs/String", "string data\n", "ros1msg")
                         for n in range(1, channels + 1)}
        self.services = {1: Service(1, "/echo", "pkg/Echo", "string data\n", "string data\n")}
        self.wanted = frozenset()
        self.watched = (False, False)

    async def open(self):
        import asyncio
        self.loop = asyncio.get_running_loop()

    def want(self, channels):
        self.wanted = channels

    def watch(self, parameters, graph):
        self.watched = (parameters, graph)

    async def parameters(self, names):
        return [Parameter("/p", 1)]

    async def call(self, service, payload):
        import asyncio
        if payload == b"hang":
            await asyncio.sleep(1000)  # a service that never answers
        if payload == b"fail":
            raise JakaBagError("it failed")
        return payload[::-1]

    def publish(self, channel, number, payload=b""):
        self.loop.call_soon_threadsafe(self.audience.deliver, channel, number, payload)


def call(service, number, payload, encoding=b"ros1"):
    return b"\x02" + struct.pack("<III", service, number, len(encoding)) + encoding + payload


@pytest.fixture
def toy():
    return Toy()


def test_a_viewer_is_told_what_there_is_and_gets_what_it_wants(running, toy):
    server = running(toy)
    with RawViewer(server.port) as viewer:
        info = viewer.text("serverInfo")
        assert info["name"] == "toy" and info["supportedEncodings"] == ["ros1"] and info["sessionId"]
        assert [c["topic"] for c in viewer.text("advertise")["channels"]] == ["/c1", "/c2"]
        assert viewer.text("advertiseServices")["services"][0]["request"] == {
            "encoding": "ros1", "schemaName": "pkg/EchoRequest", "schemaEncoding": "ros1msg", "schema": "string data\n"}
        viewer.subscribe(2)
        wait_until(lambda: toy.wanted == {2}, "the source is told")
        toy.publish(1, 1, b"not wanted")
        toy.publish(2, 1 << 60, b"wanted")
        assert viewer.receive() == message_data(2, 1 << 60, b"wanted")
        viewer.send({"op": "unsubscribe", "subscriptionIds": [2]})
        wait_until(lambda: not toy.wanted, "the source is told")


@pytest.mark.parametrize("offered, chosen", [
    (SDK, SDK), (OLD, OLD), ("x, %s" % OLD, OLD), ("%s, %s" % (OLD, SDK), OLD)])
def test_both_subprotocols_are_spoken(running, toy, offered, chosen):
    with RawViewer(running(toy).port, offered) as viewer:
        assert viewer.headers["sec-websocket-protocol"] == chosen and viewer.text("serverInfo")


@pytest.mark.parametrize("subprotocols, headers, status", [
    (None, {}, 400), ("foxglove.websocket.v2", {}, 400), (SDK, {"Origin": "https://evil.example"}, 403),
    (SDK, {"Origin": "null"}, 403), (SDK, {"Origin": "file://"}, 403), (SDK, {"Origin": "http://localhost:8765"}, 403),
    (SDK, {"Host": "evil.example:8765"}, 403), (SDK, {"Host": "evil.example", "Origin": "http://evil.example"}, 403),
    (SDK, {"Upgrade": "h2c"}, 426)])
def test_who_may_not_connect_is_told_nothing(running, toy, subprotocols, headers, status):
    server = running(toy)
    with pytest.raises(Refused) as refused:
        RawViewer(server.port, subprotocols, headers)
    assert refused.value.args[0] == status and "/c1" not in refused.value.args[1]


def test_trusted_pages_connect_and_a_second_origin_does_not_help(running, toy):
    server = running(toy, AccessRules(["http://localhost:8080"]))
    for origin in ("https://app.foxglove.dev", "https://lichtblick-suite.github.io", "http://localhost:8080"):
        with RawViewer(server.port, headers={"Origin": origin}) as viewer:
            assert viewer.text("serverInfo")
    with pytest.raises(Refused):
        RawViewer(server.port, headers={"Origin": "https://app.foxglove.dev\r\nOrigin: https://evil.example"})


def test_too_many_viewers_are_refused_until_one_leaves(running, toy):
    server = running(toy, limits=servers.ViewerLimits(viewers=2))
    with RawViewer(server.port) as first:
        with RawViewer(server.port) as second:
            assert first.text("serverInfo") and second.text("serverInfo")
            with pytest.raises(Refused) as refused:
                RawViewer(server.port)
            assert refused.value.args[0] == 503
        wait_until(lambda: any("left" in line for line in server.notices), "it is noticed")
        with RawViewer(server.port) as third:
            assert third.text("serverInfo")


GARBAGE = [b"", b"\x00", b"\x09zz", b"\x03\x07", b"\x01\x00\x00\x00\x00x", "nonsense", "{}", '{"op":"zzz"}',
           "[" * 50000, '{"op":"subscribe","subscriptions":[{"id":1,"channelId":99}]}',
           '{"op":"advertise","channels":[]}',
           '{"op":"fetchAsset","uri":"package://x/y","requestId":1}', b"\x03\x00" + bytes(17),
           '{"op":"setParameters","parameters":[{"name":"/p","value":7}]}']


@pytest.mark.parametrize("message", GARBAGE, ids=lambda message: repr(message)[:40])
def test_garbage_is_answered_and_the_viewer_stays(running, toy, message):
    with RawViewer(running(toy).port) as viewer:
        viewer.send(message)
        assert viewer.text("status")["level"] == 2
        viewer.send({"op": "getParameters", "parameterNames": [], "id": "still here"})
        answer = {}
        while answer.get("id") != "still here":
            answer = viewer.text("parameterValues")
        assert answer["parameters"] == [{"name": "/p", "value": 1}]


def test_subscriptions_are_one_a_channel_and_numbers_are_used_once(running, toy):
    with RawViewer(running(toy).port) as viewer:
        viewer.subscribe(1)
        for subscription, channel in ((1, 2), (9, 1)):
            viewer.send({"op": "subscribe", "subscriptions": [{"id": subscription, "channelId": channel}]})
            assert "already" in viewer.text("status")["message"]


def ends_with(viewer, code):
    assert viewer.ended() and viewer.close_code == code
    return True


def test_a_viewer_that_sends_nothing_but_garbage_is_let_go_and_others_stay(running, toy):
    server = running(toy)
    with RawViewer(server.port) as other, RawViewer(server.port) as viewer:
        other.subscribe(1)
        with contextlib.suppress(OSError):  # the server may close it before all of it is sent
            for _ in range(100):
                viewer.send(b"\x09")
        assert ends_with(viewer, 1008)
        wait_until(lambda: toy.wanted == {1}, "it is subscribed")
        toy.publish(1, 5, b"x")
        assert other.until(data_of) == (1, 5, b"x")


@pytest.mark.parametrize("message", [
    {"op": "subscribe", "subscriptions": [{"id": n, "channelId": n} for n in range(20000)]},
    {"op": "subscribeParameterUpdates", "parameterNames": ["/p%d" % n for n in range(20000)]}],
    ids=["topics", "parameters"])
def test_huge_wishes_let_a_viewer_go(running, toy, message):
    with RawViewer(running(toy).port) as viewer:
        viewer.send(message)
        assert ends_with(viewer, 1008)


def test_a_message_that_is_too_large_ends_the_connection(running, toy):
    with RawViewer(running(toy).port) as viewer:
        with_size = viewer.frame(1, b"x" * ((1 << 20) + 1))
        try:
            viewer.socket.sendall(with_size)
        except OSError:
            pass  # it was closed while it was being sent
        assert viewer.ended()


@pytest.mark.parametrize("raw", [
    b"\xff" * 200, b"\x81\x05hello", bytes([0x91, 0x80]) + bytes(4), bytes([0x83, 0x80]) + bytes(4),
    bytes([0x89, 0xfe, 0x01, 0x00]) + bytes(4 + 256), bytes([0xc1, 0x80]) + bytes(4)],
    ids=["noise", "no mask", "reserved bit", "unknown opcode", "long ping", "compressed"])
def test_frames_that_are_none_end_one_connection(running, toy, raw):
    server = running(toy)
    with RawViewer(server.port) as other:
        with RawViewer(server.port) as viewer:
            assert viewer.text("serverInfo")
            viewer.socket.sendall(raw)
            viewer.socket.shutdown(socket.SHUT_WR)
            assert viewer.ended()
        assert other.text("serverInfo")


@pytest.mark.parametrize("raw", [b"", b"GET / HT", b"\x16\x03\x01 TLS", b"\x00" * 5000,
                                 b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n"])
def test_peers_that_speak_no_http_or_nothing_are_dropped(running, toy, raw, monkeypatch):
    monkeypatch.setattr(servers, "_HANDSHAKE_S", 0.3)
    server = running(toy)
    with socket.create_connection(("127.0.0.1", server.port)) as peer:
        peer.sendall(raw)
        peer.settimeout(30.0)
        try:
            while peer.recv(4096):
                pass
        except ConnectionError:
            pass
    with RawViewer(server.port) as viewer:
        assert viewer.text("serverInfo")
    assert not [line for line in server.notices if "\n" in line]


def test_crowds_of_silent_peers_do_not_keep_viewers_out(running, toy):
    server = running(toy, limits=servers.ViewerLimits(viewers=1))
    crowd = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(100)]
    with RawViewer(server.port) as viewer:
        assert viewer.text("serverInfo")

    def dropped(peer):
        peer.settimeout(0.0)
        try:
            return not peer.recv(1)
        except BlockingIOError:
            return False
        except ConnectionError:
            return True
    wait_until(lambda: sum(map(dropped, crowd)) >= 60, "most of them are dropped")
    for peer in crowd:
        peer.close()


def test_a_slow_reader_gets_the_newest_is_told_and_holds_up_nobody(running, toy):
    server = running(toy, limits=servers.ViewerLimits(waiting=2 << 20))
    with RawViewer(server.port, receive_buffer=4096) as slow, RawViewer(server.port) as fast:
        slow.subscribe(1)
        fast.subscribe(1)
        wait_until(lambda: all(v.channels for v in server._viewers) and len(server._viewers) == 2, "both subscribe")
        payload = bytes(100_000)
        for number in range(300):
            toy.publish(1, number, payload)
            assert fast.until(data_of)[1] == number
        viewers = list(server._viewers)
        assert max(viewer.outbox.size for viewer in viewers) < 3 << 20
        times, told = [], False
        while not times or times[-1] != 299:
            message = slow.receive()
            told = told or (isinstance(message, str) and "too slow" in message)
            if data_of(message):
                times.append(data_of(message)[1])
        assert told and times == sorted(times) and len(times) < 200 and times[-20:] == list(range(280, 300))
    wait_until(lambda: any("left out" in line for line in server.notices), "it is noticed")


def test_a_viewer_that_stops_reading_is_let_go(running, toy, monkeypatch):
    monkeypatch.setattr(servers, "_STUCK_S", 0.5)
    server = running(toy)
    with RawViewer(server.port, receive_buffer=4096) as viewer:
        viewer.subscribe(1)
        wait_until(lambda: toy.wanted, "it subscribes")
        for number in range(100):
            toy.publish(1, number, bytes(100_000))
        wait_until(lambda: not server._viewers, "it is let go")
        wait_until(lambda: not toy.wanted, "its subscriptions end")
    assert any("has read nothing" in line for line in server.notices)


def test_a_viewer_that_asks_and_never_reads_is_let_go(running, toy):
    server = running(toy)
    with RawViewer(server.port, receive_buffer=4096) as viewer:
        message = viewer.frame(1, json.dumps({"op": "getParameters", "parameterNames": [], "id": "x" * 5000}).encode())
        viewer.socket.settimeout(0.2)
        deadline = time.monotonic() + 60
        while server._viewers and time.monotonic() < deadline:
            try:
                viewer.socket.sendall(message)
            except OSError:
                pass
        assert not server._viewers


def test_services_are_called_side_by_side_and_failures_are_told(running, toy):
    with RawViewer(running(toy).port) as viewer:
        viewer.send(call(1, 1, b"hang"))
        viewer.send(call(1, 2, b"abc"))
        assert viewer.until(lambda m: m if isinstance(m, bytes) else None) == b"\x03" + struct.pack(
            "<III", 1, 2, 4) + b"ros1cba"
        for service, payload, encoding, text in ((1, b"fail", b"ros1", "it failed"), (7, b"", b"ros1", "no service 7"),
                                                 (1, b"", b"json", "not as 'json'")):
            viewer.send(call(service, 3, payload, encoding))
            failure = viewer.text("serviceCallFailure")
            assert text in failure["message"] and (failure["serviceId"], failure["callId"]) == (service, 3)
        for number in range(20):
            viewer.send(call(1, number, b"hang"))
        assert ends_with(viewer, 1008)


def test_channels_that_go_end_their_subscriptions(running, toy):
    server = running(toy)
    with RawViewer(server.port) as viewer:
        viewer.subscribe(1, 2)
        wait_until(lambda: toy.wanted == {1, 2}, "it subscribes")

        def go():
            del toy.channels[1]
            server.unadvertise([1])
        toy.loop.call_soon_threadsafe(go)
        assert viewer.text("unadvertise")["channelIds"] == [1]
        wait_until(lambda: toy.wanted == {2}, "the source is told")
        viewer.send({"op": "unsubscribe", "subscriptionIds": [1]})  # too late, and no mistake
        toy.publish(2, 3, b"y")
        assert viewer.receive() == message_data(2, 3, b"y")


def test_parameters_and_the_graph_are_told_to_those_who_watch(running, toy):
    server = running(toy)
    with RawViewer(server.port) as one, RawViewer(server.port) as two:
        one.send({"op": "subscribeParameterUpdates", "parameterNames": ["/a"]})
        two.send({"op": "subscribeConnectionGraph"})
        wait_until(lambda: toy.watched == (True, True), "the source is told")
        changed = {"/a": Parameter("/a", 1), "/b": Parameter("/b", 2)}
        toy.loop.call_soon_threadsafe(server.tell_parameters, changed)
        toy.loop.call_soon_threadsafe(server.tell_graph, '{"op":"connectionGraphUpdate"}')
        assert one.text("parameterValues")["parameters"] == [{"name": "/a", "value": 1}]
        assert two.text("connectionGraphUpdate")
    wait_until(lambda: toy.watched == (False, False), "the source is told")


def test_the_end_of_the_server_closes_in_order(running, toy):
    server = running(toy)
    with RawViewer(server.port) as viewer:
        assert viewer.text("serverInfo")
        server.stop()
        assert ends_with(viewer, 1001)


def test_a_port_that_is_taken_is_one_line(capsys):
    from jaka_bag.cli.main import main
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen(1)
        log = "test/data/golden/boot.mcap"
        before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
        assert main(["serve", log, "--port", str(taken.getsockname()[1])]) == 1
        for number, handler in zip((signal.SIGINT, signal.SIGTERM), before):
            signal.signal(number, handler)
    assert "cannot listen on 127.0.0.1" in capsys.readouterr().err
