"""A simulated controller is recorded, by itself or by the proxy; a client then gets the same from the replayer."""
import contextlib
import json
import os
import signal
import socket
import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import pytest
from arm_bench import fill
from command_places import command_of
from raw_client import RawClient, RawFeed

from jaka_ros_driver.simulation.simulated_controller import SimulatedController
from jaka_ros_driver.wire import replayer
from jaka_ros_driver.wire.log import WireEvent, WireLog, clock_offset_ns, read_log
from jaka_ros_driver.wire.recorded_session import recorded_session
from jaka_ros_driver.wire.replayer import SessionReplayer

WAIT = 30
REQUESTS = ("get_robot_state", "get_version", "get_robot_state", "nonsense")


def talk(port, requests):
    """Return the replies to some requests, each after the one before."""
    with RawClient(port) as client:
        return [client.ask(request) for request in requests]


def listen(port, count):
    """Return so many bytes of a port's feed."""
    data = b""
    with socket.create_connection(("127.0.0.1", port), WAIT) as link:
        link.settimeout(WAIT)
        while len(data) < count:
            piece = link.recv(65536)
            if not piece:
                break
            data += piece
    return data


def talk_and_listen(served, count):
    """Return so many bytes of a replayer's feed, and its replies: both at once, for it ends with what was recorded."""
    with ThreadPoolExecutor(1) as pool:
        feed = pool.submit(listen, served.port_numbers["status"], count)
        replies = talk(served.port_numbers["command"], REQUESTS)
        return feed.result(WAIT), replies


@contextlib.contextmanager
def playing(path, speed=1.0, **options):
    heard = []

    def notice(event, **facts):
        heard.append((event, facts))

    served = SessionReplayer(recorded_session(read_log(str(path))), speed, {}, notice, **options)
    thread = threading.Thread(target=served.run)
    thread.start()
    try:
        yield served, heard
    finally:
        served.stop()
        thread.join(WAIT)


def sent(path, port):
    """Return all bytes that a log records as sent on a port."""
    return b"".join(event.data for event in read_log(str(path))
                    if isinstance(event, WireEvent) and event.port == port and event.what == "out")


@pytest.fixture
def recorded(tmp_path):
    path = tmp_path / "wire.mcap"
    with SimulatedController(log=str(path), start="enabled") as arm:
        replies = talk(arm.command_port, REQUESTS)
        frames = listen(arm.status_port, 20000)
    return path, replies, frames


@pytest.mark.parametrize("speed", [1.0, 5.0])
def test_the_replayer_gives_the_same_replies_and_the_same_feed(recorded, speed):
    path, replies, frames = recorded
    with playing(path, speed) as (served, _):
        heard, told = talk_and_listen(served, len(frames))
        assert told == replies
        assert heard == sent(path, "status")[:len(frames)] == frames


def test_the_end_is_told_with_what_was_answered(recorded):
    path, _, frames = recorded
    with playing(path, 10.0) as (served, heard):
        talk_and_listen(served, len(frames))
        wait = threading.Event()
        for _ in range(WAIT * 20):
            if len(heard) == 2:
                break
            wait.wait(0.05)
    assert [event for event, _ in heard] == ["begin", "end"]
    assert heard[1][1] == {"answered": 4, "repeated": 0, "unanswered": []}


def test_the_frame_that_caused_a_request_comes_before_time_stands_still_for_it(tmp_path):
    # This holds for a client whose connection for status was made later than in the log, too.
    path = str(tmp_path / "wire.mcap")
    log, second = WireLog(path), 10 ** 9
    for number, port in ((1, "command"), (2, "status")):
        log.event(0, port, number, "open", "127.0.0.1:1")
    log.bytes_out(int(0.2 * second), "status", 2, b"before")
    log.bytes_out(int(0.8 * second), "status", 2, b"collision")
    log.bytes_in(int(0.801 * second), "command", 1, b'{"cmdName": "stop_program"}')
    log.bytes_out(int(0.802 * second), "command", 1, b'{"cmdName": "stop_program", "errorCode": "0"}')
    log.bytes_out(int(0.9 * second), "status", 2, b"stopped")
    log.bytes_out(int(1.5 * second), "status", 2, b"end")
    log.close()
    with playing(path) as (served, _), RawClient(served.port_numbers["command"]) as client:
        time.sleep(0.1)  # later than in the log
        address = ("127.0.0.1", served.port_numbers["status"])
        with socket.create_connection(address, WAIT) as link:
            link.settimeout(replayer.PATIENCE_S - 2.0)
            heard = b""
            while not heard.endswith(b"collision"):
                heard += link.recv(100)
            assert client.code("stop_program") == "0"
            while not heard.endswith(b"end"):
                heard += link.recv(100)
    assert heard == b"beforecollisionstoppedend"


def test_a_log_tells_real_time(tmp_path):
    path = str(tmp_path / "wire.mcap")
    WireLog(path).close()
    assert clock_offset_ns(path) > 1_500_000_000_000_000_000


@contextlib.contextmanager
def proxy(path, arm, **options):
    process = subprocess.Popen(
        [*command_of("jaka_sim"), "proxy", "127.0.0.1", "--log", str(path),
         "--command-port", "0", "--status-port", "0", "--poll-port", "0",
         "--controller-command-port", str(arm.command_port), "--controller-status-port", str(arm.status_port),
         "--controller-poll-port", str(arm.poll_port)], stdout=subprocess.PIPE, **options)
    try:
        yield json.loads(process.stdout.readline())
    finally:
        process.send_signal(signal.SIGINT)
        process.stdout.close()
        assert process.wait(WAIT) == 0


def test_the_proxy_forwards_every_byte_and_logs_what_the_replayer_can_replay(tmp_path):
    own, seen = tmp_path / "own.mcap", tmp_path / "proxy.mcap"
    with SimulatedController(log=str(own), start="enabled") as arm, proxy(seen, arm) as ports:
        replies = talk(ports["command_port"], REQUESTS)
        frames = listen(ports["status_port"], 20000)
    assert len(frames) >= 20000
    assert sent(seen, "command") == sent(own, "command") == b"".join(json.dumps(reply).encode() for reply in replies)
    assert sent(own, "status").startswith(frames)
    assert sent(seen, "status").startswith(frames)
    with playing(seen, 5.0) as (served, _):
        assert talk(served.port_numbers["command"], REQUESTS) == replies


def test_the_proxy_ends_both_sides_when_one_ends(tmp_path):
    path = tmp_path / "proxy.mcap"
    with SimulatedController(start="enabled") as arm, proxy(path, arm) as ports:
        with socket.create_connection(("127.0.0.1", ports["command_port"]), WAIT) as link:
            link.sendall(b'{"cmdName":"get_robot_state"}\n')
            assert link.recv(10)
            arm.operate("close", port="command")
            link.settimeout(WAIT)
            while link.recv(4096):
                pass
    assert [event.what for event in read_log(str(path)) if event.what in ("open", "close")] == ["open", "close"]


def test_without_a_controller_a_client_is_turned_away(tmp_path):
    with SimulatedController(start="enabled") as arm:
        pass
    with proxy(tmp_path / "proxy.mcap", arm) as ports, \
            socket.create_connection(("127.0.0.1", ports["command_port"]), WAIT) as link:
        link.settimeout(WAIT)
        assert link.recv(10) == b""


@contextlib.contextmanager
def unanswered_port():
    """Open a port whose backlog is full: the system answers no further client."""
    with contextlib.ExitStack() as links:
        listener = links.enter_context(socket.create_server(("127.0.0.1", 0), backlog=0))
        for _ in range(4):
            link = links.enter_context(socket.socket())
            link.setblocking(False)
            link.connect_ex(listener.getsockname())
        yield listener.getsockname()[1]


def test_a_port_of_the_controller_that_does_not_answer_holds_up_no_other(tmp_path):
    with SimulatedController(start="enabled") as arm, unanswered_port() as silent:
        ports_of_arm = SimpleNamespace(command_port=arm.command_port, status_port=arm.status_port, poll_port=silent)
        with proxy(tmp_path / "proxy.mcap", ports_of_arm) as ports, \
                socket.create_connection(("127.0.0.1", ports["poll_port"]), WAIT) as link:
            for _ in range(3):
                assert len(talk(ports["command_port"], REQUESTS)) == len(REQUESTS)
            link.setblocking(False)
            with pytest.raises(BlockingIOError):  # that one still waits for the controller
                link.recv(10)
            link.settimeout(WAIT)
            assert link.recv(10) == b""


def test_nobody_reads_what_the_proxy_says_and_it_forwards_all_the_same(tmp_path):
    reading, writing = os.pipe()
    with open(reading, "rb") as said, SimulatedController(start="enabled") as arm, \
            proxy(tmp_path / "proxy.mcap", arm, stderr=writing) as ports:
        os.close(writing)
        fill(said)
        arm.operate("refuse", port="status", duration_ms=60000)
        with socket.create_connection(("127.0.0.1", ports["status_port"]), WAIT) as link:
            link.settimeout(WAIT)
            assert link.recv(10) == b""
        assert len(talk(ports["command_port"], REQUESTS)) == len(REQUESTS)


@pytest.fixture
def recorded_move(tmp_path):
    """Record a move of joint 1, begun half a second after the start."""
    path = tmp_path / "move.mcap"
    with SimulatedController(log=str(path), start="enabled") as arm:
        with RawFeed(arm.status_port) as feed, RawClient(arm.command_port) as client:
            first = feed.frame()["joint_actual_position"]
            threading.Event().wait(0.5)
            assert client.code("joint_move", jointPosition=[20.0, *first[1:]], speed=60) == "0"
            feed.until(lambda frame: frame["joint_actual_position"][0] > 19.9)
    return path


def test_the_arm_does_not_move_before_it_is_asked_to(recorded_move):
    with playing(recorded_move) as (served, _):
        with RawFeed(served.port_numbers["status"]) as feed, RawClient(served.port_numbers["command"]) as client:
            before, waited = [], time.monotonic() + 1.5
            while time.monotonic() < waited:
                before.append(feed.frame())
            assert max(frame["joint_actual_position"][0] for frame in before) < 0.5
            assert len(before) > 40, "the feed of an arm that waits goes on"
            assert client.code("joint_move", jointPosition=[20.0] + [0.0] * 5, speed=60) == "0"
            feed.until(lambda frame: frame["joint_actual_position"][0] > 19.9)


def test_a_request_that_does_not_come_is_not_waited_for_for_ever(recorded_move):
    with playing(recorded_move, patience_s=0.5) as (served, _), RawFeed(served.port_numbers["status"]) as feed:
        feed.until(lambda frame: frame["joint_actual_position"][0] > 19.9)
