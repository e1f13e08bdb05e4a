"""The command jaka_bag play on a real master: subscribers get what is in the log, at its times or at any rate."""
import fcntl
import json
import os
import pty
import re
import signal
import termios
import threading
import types

import pytest
import ros_graph
import waiting
from live_samples import content, string_connection, string_frame, times, twist_connection, twist_frame

from jaka_bag.cli.main import load_command, main, parser_of
from jaka_bag.cli.play import limits_of
from jaka_bag.containers.bag.writer import BagWriter
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.containers.registry import create_log
from jaka_bag.live.names import NodeNames
from jaka_bag.live.subscriber import Subscriber
from jaka_bag.messages.connection import Connection

BASE = 1600000000 * 10**9
MS = 10**6
S = 10**9

LISTENER = """
import sys, rospy, hashlib
from std_msgs.msg import String
rospy.init_node("listener")
count = int(sys.argv[1])
heard = []
def hear(message):
    heard.append(message.data)
    if len(heard) == count: print("heard", heard[0], heard[-1], len(set(heard)), flush=True)
rospy.Subscriber(sys.argv[2], String, hear)
print("up", flush=True)
rospy.spin()
"""


def write_log(path, entries):
    """Write a log of (topic or connection, time in ms, frame); strings unless the connection says otherwise."""
    kind = McapWriter if str(path).endswith(".mcap") else BagWriter
    with kind(path, compression="none") as writer:
        for connection, at_ms, frame in entries:
            if isinstance(connection, str):
                connection = string_connection(connection)
            writer.add_message(writer.add_channel(connection), BASE + int(at_ms * MS), frame[4:])


class Listener:
    """A subscriber in this process: (topic, kernel receive time in ns, payload) of all messages, connections."""

    def __init__(self, *topics):
        self.heard = []
        self.connections = {}
        self._ending = threading.Event()
        self._transport = Subscriber(NodeNames("/listener_%d" % id(self)), self._take, self._open, lambda line: None,
                                       lambda reason: None)
        for topic in topics:
            self._transport.subscribe(topic)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _open(self, connection, publisher):
        self.connections[connection.topic] = connection
        return connection.topic

    def _take(self, topic, stamp, data):
        self.heard.append((topic, stamp, data))

    def _run(self):
        while not self._ending.is_set():
            self._transport.poll(0.05)

    def texts(self, topic):
        return [data[4:].decode() for heard, _, data in self.heard if heard == topic]

    def __enter__(self):
        return self

    def __exit__(self, *failure):
        self._ending.set()
        self._thread.join()
        self._transport.close()


def play(graph, *arguments, **options):
    return graph.jaka_bag("play", "--report", "play.json", *arguments, **options)


def report_of(graph):
    return json.loads((graph.folder / "play.json").read_text())


@pytest.mark.parametrize("suffix", ["bag", "mcap"])
def test_record_of_play_of_record_is_the_same_log(graph, suffix):
    # Topic, type, md5, definition, latching, order and bytes survive; the caller's name is the player's.
    latched = Connection("/fixed", "std_msgs/String", string_connection("/x").md5sum,
                         string_connection("/x").definition, "/author", True)
    entries = [(latched, 0, string_frame("once"))]
    for i in range(1, 301):
        entries += [(twist_connection("/a"), i, twist_frame(i)), ("/b", i + 0.5, string_frame("b%d" % i))]
    write_log(graph.folder / ("first." + suffix), entries)
    recorder = graph.record("/a", "/b", "/fixed", "-O", "second." + suffix)
    player = play(graph, "first." + suffix, "--wait-for-subscribers")
    assert player.wait() == 0, player.output
    assert recorder.stop() == 0
    assert content(graph.folder / ("second." + suffix)) == content(graph.folder / ("first." + suffix))
    report = report_of(graph)
    assert report["sent"] == 601
    assert report["topics"]["/a"]["sent"] == 300
    assert "all: 601 messages, late by p50" in player.output
    if suffix == "bag":
        check = graph.start("rosbag", "check", "second.bag")
        assert check.wait() == 0, check.output


def test_every_subscriber_gets_everything_at_unlimited_rate(graph):
    count = 20000
    write_log(graph.folder / "log.bag", [("/a", i / 10.0, string_frame("m%d" % i)) for i in range(count)])
    listener = graph.python(LISTENER, str(count), "/a")
    listener.wait_for_line("up")
    with Listener("/a") as own:
        player = play(graph, "-i", "-d", "2", "--wait-for-subscribers", "log.bag")
        assert player.wait() == 0, player.output
        assert own.texts("/a") == ["m%d" % i for i in range(count)]
    assert listener.wait_for_line("heard") == "heard m0 m%d %d" % (count - 1, count)
    assert report_of(graph)["sent"] == count


def test_rosbag_record_gets_everything_that_is_played(graph):
    write_log(graph.folder / "log.mcap", [("/a", 4 * i, string_frame("m%d" % i)) for i in range(200)])
    recorder = graph.start("rosbag", "record", "-O", "roscpp.bag", "/a")
    graph.subscribed("/a")
    assert play(graph, "--wait-for-subscribers", "-d", "1", "log.mcap").wait() == 0
    assert recorder.stop() == 0, recorder.output
    assert content(graph.folder / "roscpp.bag") == content(graph.folder / "log.mcap")


def test_a_subscriber_that_stands_still_is_named_and_loses_nothing(graph):
    frames = [string_frame("%d" % i + "x" * 1000000) for i in range(30)]
    listener = graph.python(LISTENER, str(len(frames)), "/a")
    listener.wait_for_line("up")
    notices = []
    with graph.publisher("/source", notices.append) as publisher:
        outlet = publisher.advertise("/a", string_connection("/a"), False)
        ros_graph.with_subscribers(publisher, outlet)
        listener.popen.send_signal(signal.SIGSTOP)
        sender = threading.Thread(target=lambda: [publisher.publish(outlet, frame) for frame in frames])
        sender.start()
        waiting.wait_until(lambda: notices, "it is said who holds the others up")
        listener.popen.send_signal(signal.SIGCONT)
        sender.join()
    assert notices == ["/listener does not read /a: waiting for it"]
    assert listener.wait_for_line("heard").startswith("heard 0x")


@pytest.mark.parametrize("rate", ["0.5", "1", "4"])
def test_intervals_follow_the_log_at_any_rate(graph, rate):
    write_log(graph.folder / "log.bag", [("/a", 20 * i, string_frame("%d" % i)) for i in range(40)])
    with Listener("/a") as listener:
        graph.subscribed("/a")
        assert play(graph, "-r", rate, "--wait-for-subscribers", "-q", "log.bag").wait() == 0
        stamps = [stamp for _, stamp, _ in listener.heard]
    assert len(stamps) == 40
    due = [stamps[0] + i * 20 * MS / float(rate) for i in range(40)]
    late = sorted(stamp - at for stamp, at in zip(stamps, due))
    assert abs(late[len(late) // 2]) < 20 * MS  # loose: the machine is shared; the benchmark looks closely
    assert stamps[-1] - stamps[0] >= 0.9 * 39 * 20 * MS / float(rate)


def test_start_duration_until_topics_regex_exclude_prefix_and_remapping_choose(graph):
    entries = [(topic, 100 * i, string_frame("%d" % i)) for i in range(20) for topic in ("/a", "/b", "/c")]
    write_log(graph.folder / "log.mcap", entries)
    for arguments, heard in [
            (["-s", "1", "-u", "0.25"], {"/a": ["10", "11", "12"], "/b": ["10", "11", "12"],
                                         "/c": ["10", "11", "12"]}),
            (["-s", "1s", "--until", "1.1s", "--topics", "/a"], {"/a": ["10", "11"]}),
            (["-u", "100ms", "-e", "/[ab]", "-x", "/b"], {"/a": ["0", "1"]}),
            (["-u", "0", "-p", "/old", "--topics", "/a"], {"/old/a": ["0"]}),
            (["-u", "0", "--topics", "/a", "--", "/a:=/elsewhere"], {"/elsewhere": ["0"]})]:
        topics = ["/a", "/b", "/c", "/old/a", "/elsewhere"]
        with Listener(*topics) as listener:
            player = play(graph, "--wait-for-subscribers", "log.mcap", *arguments)
            assert player.wait() == 0, player.output
            found = {topic: listener.texts(topic) for topic in topics if listener.texts(topic)}
        assert found == heard


def test_latched_messages_before_the_start_are_sent_and_late_subscribers_get_the_newest(graph):
    latched = Connection("/fixed", "std_msgs/String", string_connection("/x").md5sum,
                         string_connection("/x").definition, "/author", True)
    entries = [(latched, 0, string_frame("old")), (latched, 100, string_frame("new"))]
    entries += [("/a", 200 + i, string_frame("%d" % i)) for i in range(10)]
    write_log(graph.folder / "log.bag", entries)
    player = play(graph, "-s", "0.2", "-k", "log.bag")
    player.wait_for_line("playing 2 topics")
    waiting.wait_until(lambda: "the topics stay" in player.output, "all is played")
    with Listener("/fixed", "/a") as listener:
        waiting.wait_until(lambda: listener.texts("/fixed") == ["new"], "the latched message comes")
        assert listener.connections["/fixed"].latching is True
        waiting.wait_until(lambda: "/a" in listener.connections, "the other topic is there, and silent")
        assert listener.texts("/a") == []
    assert player.stop() == 0
    assert report_of(graph)["topics"]["/fixed"]["sent"] == 0
    assert report_of(graph)["topics"]["/a"]["sent"] == 10


def test_several_files_are_played_in_the_order_of_time(graph):
    write_log(graph.folder / "one.bag", [("/a", 2 * i, string_frame("%d" % (2 * i))) for i in range(50)])
    write_log(graph.folder / "two.mcap", [("/a", 2 * i + 1, string_frame("%d" % (2 * i + 1))) for i in range(50)])
    with Listener("/a") as listener:
        assert play(graph, "-i", "--wait-for-subscribers", "one.bag", "two.mcap").wait() == 0
        assert listener.texts("/a") == [str(i) for i in range(100)]


def test_clock_is_told_with_each_message_and_between(graph):
    write_log(graph.folder / "log.bag", [("/a", 0, string_frame("first")), ("/a", 300, string_frame("last"))])
    with Listener("/a", "/clock") as listener:
        player = play(graph, "--clock", "--hz", "100", "--wait-for-subscribers", "log.bag")
        assert player.wait() == 0
        heard = list(listener.heard)
    clocks = [int.from_bytes(data[:4], "little") * 10**9 + int.from_bytes(data[4:], "little")
              for topic, _, data in heard if topic == "/clock"]
    assert clocks == sorted(clocks)
    assert clocks[0] == BASE
    assert clocks[-1] == BASE + 300 * MS
    assert len(clocks) > 10
    assert "/use_sim_time is not true" in player.output
    assert listener.connections["/clock"].md5sum == "a9c97c1d230cfc112e270351a944ee47"


def test_two_types_on_one_topic_go_to_those_who_ask_for_them(graph):
    write_log(graph.folder / "log.mcap", [("/a", 0, string_frame("text")), (twist_connection("/a"), 1, twist_frame(1))])
    listener = graph.python(LISTENER, "1", "/a")
    listener.wait_for_line("up")
    graph.subscribed("/a")
    player = play(graph, "--wait-for-subscribers", "-d", "1", "log.mcap")
    assert player.wait() == 0
    assert "two types" in player.output
    assert listener.wait_for_line("heard") == "heard text text 1"


def test_gaps_are_skipped_where_asked(graph):
    write_log(graph.folder / "log.bag", [("/a", 0, string_frame("a")), ("/a", 3600000, string_frame("b"))])
    with Listener("/a") as listener:
        assert play(graph, "--skip-empty", "1", "--wait-for-subscribers", "log.bag").wait() == 0
        assert listener.texts("/a") == ["a", "b"]


def test_loop_goes_on_until_it_is_stopped(graph):
    write_log(graph.folder / "log.bag", [("/a", i, string_frame("%d" % i)) for i in range(3)])
    with Listener("/a") as listener:
        player = play(graph, "-l", "--wait-for-subscribers", "log.bag")
        waiting.wait_until(lambda: len(listener.heard) >= 9, "three rounds")
        assert player.stop(signal.SIGTERM) == 0
        texts = listener.texts("/a")
    assert texts[:9] == ["0", "1", "2"] * 3
    assert "SIGTERM" in player.output


class Terminal:
    """A pseudo terminal that a process has as its own."""

    def __init__(self):
        self.ours, self.theirs = pty.openpty()
        self.before = termios.tcgetattr(self.theirs)

    def options(self):
        def take():
            os.setsid()
            fcntl.ioctl(0, termios.TIOCSCTTY, 0)
        return {"stdin": self.theirs, "preexec_fn": take}

    def press(self, keys):
        os.write(self.ours, keys.encode())

    def close(self):
        os.close(self.ours)
        os.close(self.theirs)


def test_space_pauses_and_goes_on_s_steps_and_the_terminal_is_restored(graph):
    write_log(graph.folder / "log.bag", [("/a", 10 * i, string_frame("%d" % i)) for i in range(20)])
    terminal = Terminal()
    with Listener("/a") as listener:
        player = play(graph, "--pause", "--wait-for-subscribers", "log.bag", **terminal.options())
        player.wait_for_line("paused")
        assert listener.texts("/a") == []
        for step in range(1, 4):
            terminal.press("s")
            waiting.wait_until(lambda step=step: len(listener.heard) == step, "step %d" % step)
        assert listener.texts("/a") == ["0", "1", "2"]
        terminal.press(" ")
        assert player.wait() == 0, player.output
        assert listener.texts("/a") == [str(i) for i in range(20)]
    assert termios.tcgetattr(terminal.theirs) == terminal.before
    terminal.close()


def test_a_pause_in_mid_play_holds_the_rest_back(graph):
    write_log(graph.folder / "log.bag", [("/a", 10 * i, string_frame("%d" % i)) for i in range(300)])
    terminal = Terminal()
    with Listener("/a") as listener:
        player = play(graph, "--wait-for-subscribers", "log.bag", **terminal.options())
        waiting.wait_until(lambda: len(listener.heard) > 5, "it plays")
        terminal.press(" ")
        player.wait_for_line("paused")
        held = len(listener.heard)
        terminal.press("s")
        waiting.wait_until(lambda: len(listener.heard) > held, "a step")
        assert len(listener.heard) < 300
        assert player.stop(signal.SIGINT) == 0
    assert "SIGINT" in player.output
    assert termios.tcgetattr(terminal.theirs) == terminal.before
    terminal.close()


@pytest.mark.parametrize("arguments, code, reason", [
    ([], 2, "no FILE"), (["log.bag", "-i", "-r", "2"], 2, "-i has no rate"), (["log.bag", "-r", "0"], 2, "above 0"),
    (["missing.bag"], 1, "missing.bag"), (["log.bag", "--topics", "/nobody"], 2, "nothing to play.*no topic /nobody"),
    (["log.bag", "-e", "("], 1, "not a regular expression"), (["empty.bag"], 1, "empty.bag"),
    (["."], 1, "folder|directory")])
def test_bad_requests_are_one_line(tmp_path, monkeypatch, capsys, arguments, code, reason):
    write_log(tmp_path / "log.bag", [("/a", 0, string_frame("a"))])
    (tmp_path / "empty.bag").write_bytes(b"")
    monkeypatch.chdir(tmp_path)
    assert main(["play", *arguments]) == code
    said = capsys.readouterr().err
    assert re.search(reason, said)
    assert len(said.strip().splitlines()) == 1 or "usage" in said


@pytest.mark.parametrize("options, code, reason", [
    (["--clock"], 2, "after 2106"), ([], 1, "no ROS master"), (["--clock", "-u", "1s"], 1, "no ROS master")])
def test_a_time_that_a_clock_message_cannot_hold_is_refused(tmp_path, monkeypatch, capsys, options, code, reason):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    begin = ((1 << 32) - 2) * S
    log = create_log(tmp_path / "log.mcap", "none", None, False, chunk_size=1000)
    channel = log.add_channel(string_connection("/a"))
    for log_time in (begin, begin + 2 * S):
        log.add_message(channel, log_time, string_frame("a")[4:], log_time, 1)
    log.close()
    assert main(["play", str(tmp_path / "log.mcap"), *options]) == code
    assert reason in capsys.readouterr().err


def test_without_a_master_it_says_so(mortal_graph):
    graph = mortal_graph
    write_log(graph.folder / "log.bag", [("/a", 0, string_frame("a"))])
    graph.stop_master()
    player = graph.jaka_bag("play", "log.bag")
    assert player.wait() == 1
    assert "no answer from http" in player.output
    graph.start_master()


def test_a_player_is_found_at_a_master_that_came_back(mortal_graph):
    graph = mortal_graph
    write_log(graph.folder / "log.bag", [("/a", 100 * i, string_frame("%d" % i)) for i in range(600)])
    player = graph.jaka_bag("play", "log.bag")
    player.wait_for_line("playing")
    graph.stop_master()
    graph.start_master()
    player.wait_for_line("registered again")
    with Listener("/a") as listener:
        assert waiting.eventually(lambda: listener.texts("/a"))
    assert player.stop() == 0


def test_log_times_of_a_record_of_a_play_follow_the_first_log(graph):
    write_log(graph.folder / "log.bag", [("/a", 5 * i, string_frame("%d" % i)) for i in range(100)])
    recorder = graph.record("/a", "-O", "again")
    assert play(graph, "--wait-for-subscribers", "log.bag").wait() == 0
    assert recorder.stop() == 0
    again = [time for _, time in times(graph.folder / "again.mcap")]
    offsets = sorted(time - again[0] - 5 * i * MS for i, time in enumerate(again))
    assert abs(offsets[50]) < 20 * MS


@pytest.mark.parametrize("options, begin, end", [
    ([], 0, 1000), (["-s", "0.25"], 250, 1000), (["-s", "-100ms"], 900, 1000), (["-u", "0.2s"], 0, 200),
    (["-s", "0.5", "-u", "0:02"], 500, 1000), (["--until", "0.3"], 0, 300),
    (["-s", "0.1", "--end", "-0.1s"], 100, 900)])
def test_times_are_given_as_to_every_command(options, begin, end):
    source = types.SimpleNamespace(begin=BASE, end=BASE + 1000 * MS)
    parser = parser_of("play", load_command("play"), 98)
    args = parser.parse_intermixed_args(["log.bag", *options])
    assert limits_of(args, source) == (BASE + begin * MS, BASE + end * MS)


@pytest.mark.parametrize("options, reason", [
    (["-s", "1:00"], "starts behind the log's end"), (["--until", "200000000"], "ends before the log's start"),
    (["-s", "0.005", "--until", "0.001"], "before its start"), (["-t", "b", "log.bag"], "did you mean /b?")])
def test_nothing_is_played_by_mistake(tmp_path, monkeypatch, capsys, options, reason):
    write_log(tmp_path / "log.bag", [("/b", 0, string_frame("a")), ("/b", 10, string_frame("b"))])
    monkeypatch.chdir(tmp_path)
    assert main(["play", *options, *([] if "log.bag" in options else ["log.bag"])]) == 2
    assert reason in capsys.readouterr().err
