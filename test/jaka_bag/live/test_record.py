"""The command jaka_bag record on a real master: the file has what is published, by any publisher."""
import json
import os
import re
import signal
import struct
import threading

import live_samples
import pytest
import ros_graph
import waiting
from arm_bench import fill
from live_samples import content, string_connection, string_frame, twist_connection, twist_frame
from mcap.reader import make_reader
from ros_graph import all_read, with_subscribers

from jaka_bag.cli.main import main
from jaka_bag.live.publisher import frame_of
from jaka_bag.messages.connection import Connection

RATE_SCRIPT = """
import sys, rospy
from std_msgs.msg import String
rospy.init_node("talker")
publisher = rospy.Publisher("/talk", String, queue_size=1000, latch="latch" in sys.argv)
while publisher.get_num_connections() < 1: rospy.rostime.wallsleep(0.01)
for i in range(int(sys.argv[1])): publisher.publish("m%d" % i)
print("done", flush=True)
rospy.spin()
"""


def report_of(graph):
    return json.loads((graph.folder / "report.json").read_text())


def publish_numbers(publisher, outlet, numbers):
    for number in numbers:
        publisher.publish(outlet, twist_frame(number))


@pytest.mark.parametrize("suffix", ["mcap", "bag"])
def test_every_message_is_recorded_byte_by_byte(graph, suffix):
    recorder = graph.record("/a", "/b", "-O", "log." + suffix, "--report", "report.json")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        b = publisher.advertise("/b", string_connection("/b"), False)
        with_subscribers(publisher, a, b)
        for i in range(1, 501):
            publisher.publish(a, twist_frame(i))
            publisher.publish(b, string_frame("x" * i))
        publisher.publish(b, string_frame("y" * 3000000))  # arrives in many pieces
        assert recorder.stop() == 0, recorder.output
    log = content(graph.folder / ("log." + suffix))
    assert log["/a"] == [twist_frame(i)[4:] for i in range(1, 501)]
    assert log["/b"] == [string_frame("x" * i)[4:] for i in range(1, 501)] + [string_frame("y" * 3000000)[4:]]
    topics = report_of(graph)["topics"]
    assert (topics["/a"]["received"], topics["/a"]["missing"], topics["/a"]["lossy"]) == (500, 0, False)
    assert not (graph.folder / ("log.%s.active" % suffix)).exists()


def test_rospy_publishers_latched_and_not_are_recorded_with_their_header(graph):
    recorder = graph.record("/talk", "-O", "log")
    talker = graph.python(RATE_SCRIPT, "100", "latch")
    talker.wait_for_line("done")
    assert recorder.stop() == 0, recorder.output
    with open(str(graph.folder / "log.mcap"), "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = list(reader.iter_messages())
        assert len(found) == 100
        schema, channel, _ = found[0]
        assert schema.name == "std_msgs/String"
        assert channel.metadata["latching"] == "true"
        assert channel.metadata["callerid"] == "/talker"
        assert channel.metadata["md5sum"] == "992ce8a1687cec8c8bd883ec73ca41d1"
    assert "100 messages, nothing lost" in recorder.output


def test_roscpp_publisher_is_recorded_and_rosbag_reads_our_bag(graph):
    with graph.publisher("/source") as publisher:
        recorder = graph.record("/a", "-O", "first.bag", "--lz4")
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        for number in range(1, 301):
            publisher.publish(a, twist_frame(number))
            threading.Event().wait(0.003)  # rosbag play drops what comes in bursts
        assert recorder.stop() == 0, recorder.output
    second = graph.record("/a", "-O", "second.bag", "--report", "report.json")
    play = graph.start("rosbag", "play", "-q", "--wait-for-subscribers", "-d", "0.5", "first.bag")
    assert play.wait() == 0, play.output
    assert second.stop() == 0
    assert content(graph.folder / "second.bag") == content(graph.folder / "first.bag")
    for command in (["rosbag", "info", "first.bag"], ["rosbag", "check", "first.bag"]):
        reader = graph.start(*command)
        assert reader.wait() == 0, reader.output
    info = graph.start("rosbag", "info", "-y", "-k", "messages", "first.bag")
    assert info.wait() == 0
    assert info.output.strip() == "300"


def test_publishers_that_come_late_restart_or_share_a_topic(graph):
    recorder = graph.record("/a", "-O", "log", "--report", "report.json")
    for round_number in range(3):
        with graph.publisher("/source") as publisher:
            a = publisher.advertise("/a", twist_connection("/a"), False)
            with_subscribers(publisher, a)
            publish_numbers(publisher, a, range(1 + 10 * round_number, 11 + 10 * round_number))
    with graph.publisher("/one") as one, graph.publisher("/two") as two:
        first = one.advertise("/a", twist_connection("/a"), False)
        second = two.advertise("/a", twist_connection("/a"), False)
        with_subscribers(one, first)
        with_subscribers(two, second)
        for number in range(1, 51):
            one.publish(first, twist_frame(1000 + number))
            two.publish(second, twist_frame(2000 + number))
        assert recorder.stop() == 0
    log = content(graph.folder / "log.mcap")["/a"]
    expected = [twist_frame(n)[4:] for numbers in (range(1, 31), range(1001, 1051), range(2001, 2051))
                for n in numbers]
    assert sorted(log) == sorted(expected)
    account = report_of(graph)["topics"]["/a"]
    assert account["publishers"] == ["/one", "/source", "/two"]
    assert account["missing"] == 0


def test_types_that_conflict_are_both_recorded_and_said(graph):
    recorder = graph.record("/a", "-O", "log.bag")
    with graph.publisher("/one") as one, graph.publisher("/two") as two:
        first = one.advertise("/a", twist_connection("/a"), False)
        second = two.advertise("/a", string_connection("/a"), False)
        with_subscribers(one, first)
        with_subscribers(two, second)
        one.publish(first, twist_frame(1))
        two.publish(second, string_frame("other"))
        assert recorder.stop() == 0
    assert sorted(content(graph.folder / "log.bag")["/a"]) == sorted([twist_frame(1)[4:], string_frame("other")[4:]])
    assert "different types" in recorder.output
    assert "geometry_msgs/TwistStamped" in recorder.output


def test_nobody_reads_what_the_recorder_says_and_it_records_all_the_same(graph):
    reading, writing = os.pipe()
    recorder = graph.jaka_bag("record", "/a", "-O", "log.bag", stderr=writing)
    os.close(writing)
    with open(reading, encoding="utf-8", errors="replace") as said:
        assert "recording to" in said.readline()
        fill(said)
        with graph.publisher("/one") as one, graph.publisher("/two") as two:
            first = one.advertise("/a", twist_connection("/a"), False)
            with_subscribers(one, first)
            second = two.advertise("/a", string_connection("/a"), False)  # the recorder reports that
            with_subscribers(two, second)
            publish_numbers(one, first, range(1, 101))
            two.publish(second, string_frame("other"))
            all_read(one)
            all_read(two)
        recorder.popen.send_signal(signal.SIGINT)
        assert "both are recorded" in said.read()
    assert recorder.wait() == 0
    assert len(content(graph.folder / "log.bag")["/a"]) == 101


def test_skipped_sequence_numbers_are_counted_and_always_said(graph):
    recorder = graph.jaka_bag("record", "/a", "-q", "-O", "log", "--report", "report.json")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        publish_numbers(publisher, a, [1, 2, 3, 7, 8, 9, 20])
        assert recorder.stop() == 0
    account = report_of(graph)["topics"]["/a"]
    assert (account["received"], account["missing"], account["lossy"]) == (7, 13, True)
    assert "LOST on /a: 7 messages, 13 missing by header.seq" in recorder.output
    with open(str(graph.folder / "log.mcap"), "rb") as file:
        metadata = {record.name: record.metadata for record in make_reader(file).iter_metadata()}
    assert json.loads(metadata["jaka_bag.drops"]["/a"])["missing"] == 13
    assert metadata["jaka_bag.recording"]["log_time"] == "kernel"


def test_what_a_publisher_counts_beyond_what_came_is_said(graph):
    recorder = graph.record("/a", "-O", "log", "--report", "report.json")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        publish_numbers(publisher, a, range(1, 11))
        a.links[0].sent += 4  # as a publisher whose queue overflowed behind its counter
        assert recorder.stop() == 0
    assert report_of(graph)["topics"]["/a"]["undelivered"] == 4
    assert "4 sent but not received (publisher's bus statistics)" in recorder.output


def test_all_regex_and_exclude_choose_topics_that_appear_later(graph):
    recorders = [graph.record("-a", "-x", "/no.*", "-O", "all"), graph.record("-e", "/arm/.*", "-O", "regex")]
    with graph.publisher("/source") as publisher:
        outlets = [publisher.advertise(topic, twist_connection(topic), False)
                   for topic in ("/arm/a", "/arm/b", "/other", "/nothing")]
        with_subscribers(publisher, *outlets[:2], count=2)
        with_subscribers(publisher, outlets[2], count=1)
        for outlet in outlets:
            publish_numbers(publisher, outlet, range(1, 6))
        for recorder in recorders:
            assert recorder.stop() == 0
    assert sorted(content(graph.folder / "all.mcap")) == ["/arm/a", "/arm/b", "/other"]
    assert sorted(content(graph.folder / "regex.mcap")) == ["/arm/a", "/arm/b"]


def test_a_topic_that_never_comes_is_named_and_an_empty_recording_is_a_failure(graph):
    recorder = graph.record("/nothing", "/quiet", "-O", "empty")
    with graph.publisher("/source") as publisher:
        with_subscribers(publisher, publisher.advertise("/quiet", twist_connection("/quiet"), False))
        recorder.wait_for_line("nobody publishes /nothing yet")
        assert recorder.stop() == 1
    for line in ("no message on /nothing: nobody published it", "no message on /quiet: its publisher sent none",
                 "error: nothing was recorded, no message came"):
        assert line in recorder.output
    other = graph.record("/nothing", "/a", "-O", "some")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        publish_numbers(publisher, a, range(1, 6))
        assert other.stop() == 0
    assert "no message on /nothing: nobody published it" in other.output


def test_node_records_what_a_node_subscribes_to(graph):
    listener = graph.python("import rospy; from std_msgs.msg import String; rospy.init_node('listener'); "
                            "rospy.Subscriber('/heard', String, print); print('up', flush=True); rospy.spin()")
    listener.wait_for_line("up")
    recorder = graph.record("--node", "/listener", "-O", "log")
    with graph.publisher("/source") as publisher:
        heard = publisher.advertise("/heard", string_connection("/heard"), False)
        publisher.advertise("/unheard", string_connection("/unheard"), False)
        with_subscribers(publisher, heard, count=2)
        publisher.publish(heard, string_frame("hello"))
        assert recorder.stop() == 0
    assert content(graph.folder / "log.mcap") == {"/heard": [string_frame("hello")[4:]]}


def test_state_log_takes_the_driver_of_the_namespace_and_nothing_else(graph):
    recorder = graph.record("--state-log", "-O", "log", "__ns:=/left")
    own = ["/left/jaka_driver/" + name for name in ("tool_position", "joint_position", "robot_states",
                                                    "service_calls")]
    own += ["/left/joint_states", "/left/tf"]
    with graph.publisher("/left/jaka_driver") as left, graph.publisher("/right/jaka_driver") as right:
        outlets = [left.advertise(topic, twist_connection(topic), False) for topic in own + ["/tf", "/diagnostics"]]
        left.advertise("/left/camera", twist_connection("/left/camera"), False)
        foreign = [right.advertise(topic, twist_connection(topic), False)
                   for topic in ("/right/jaka_driver/tool_position", "/tf", "/diagnostics")]
        with_subscribers(left, *outlets)
        waiting.wait_until(lambda: right.admit() or all(o.links for o in foreign[1:]),
                                "it looks at the other driver")
        for publisher, chosen, number in ((left, outlets, 1), (right, foreign, 2)):
            publisher.admit()
            for outlet in chosen:
                publisher.publish(outlet, twist_frame(number))
        assert recorder.stop() == 0
    log = content(graph.folder / "log.mcap")
    assert log == {topic: [twist_frame(1)[4:]] for topic in own + ["/tf", "/diagnostics"]}


def test_limit_stops_each_topic_and_then_the_recording(graph):
    recorder = graph.record("/a", "/b", "-l", "5", "-O", "log")
    with graph.publisher("/source") as publisher:
        outlets = [publisher.advertise(topic, twist_connection(topic), False) for topic in ("/a", "/b")]
        with_subscribers(publisher, *outlets)
        for outlet in outlets:
            publish_numbers(publisher, outlet, range(1, 21))
        assert recorder.wait() == 0, recorder.output
    assert {topic: len(found) for topic, found in content(graph.folder / "log.mcap").items()} == {"/a": 5, "/b": 5}


@pytest.mark.parametrize("arguments, reason", [
    (["--duration", "1s"], "the time is over"), (["--size", "40k", "--no-compression"], "has the size asked for")])
def test_duration_and_size_end_a_recording(graph, arguments, reason):
    recorder = graph.record("/a", "-O", "log", *arguments)
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        publish_numbers(publisher, a, range(1, 1001))
        assert recorder.wait() == 0, recorder.output
    assert reason in recorder.output
    kept = content(graph.folder / "log.mcap")["/a"]
    # a busy computer may reach the limit before the last message
    assert 100 < len(kept) and kept == [twist_frame(number)[4:] for number in range(1, len(kept) + 1)]


def test_splits_number_their_files_keep_the_newest_and_repeat_what_is_latched(graph):
    recorder = graph.record("/a", "/fixed", "-O", "log", "--split", "--size", "20k", "--max-splits", "3",
                            "--repeat-latched", "--no-compression", "--chunksize", "4")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        fixed = publisher.advertise("/fixed", string_connection("/fixed"), True)
        with_subscribers(publisher, a, fixed)
        publisher.publish(fixed, string_frame("old"))
        publisher.publish(fixed, string_frame("newest"))
        publish_numbers(publisher, a, range(1, 2001))
        assert recorder.stop() == 0
    kept = sorted(graph.folder.glob("log_*.mcap"), key=lambda path: int(path.stem.split("_")[1]))
    assert len(kept) == 3
    assert kept[0].name != "log_0.mcap"
    numbers = []
    for path in kept:
        log = content(path)
        assert log["/fixed"] == [string_frame("newest")[4:]]
        numbers += log["/a"]
        with open(str(path), "rb") as file:
            channels = make_reader(file, validate_crcs=True).get_summary().channels.values()
        latched = {channel.topic: channel.metadata for channel in channels}["/fixed"]
        assert (latched["latching"], latched["callerid"]) == ("true", "/source")
    assert numbers == [twist_frame(n)[4:] for n in range(2001 - len(numbers), 2001)]


def test_split_by_duration_loses_nothing_between_files(graph):
    recorder = graph.record("/a", "-O", "log", "--split", "--duration", "300ms")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        for number in range(1, 201):
            publisher.publish(a, twist_frame(number))
            threading.Event().wait(0.005)
        assert recorder.stop() == 0
    files = sorted(graph.folder.glob("log_*.mcap"), key=lambda path: int(path.stem.split("_")[1]))
    assert len(files) >= 3
    found = [payload for path in files for payload in content(path)["/a"]]
    assert found == [twist_frame(n)[4:] for n in range(1, 201)]


def test_simulated_time_stamps_messages_with_the_clock(graph):
    graph.master().setParam("/use_sim_time", True)
    recorder = graph.record("/a", "-O", "log")
    clock_type = Connection("/clock", "rosgraph_msgs/Clock", "a9c97c1d230cfc112e270351a944ee47", "time clock\n")
    with graph.publisher("/source") as publisher:
        clock = publisher.advertise("/clock", clock_type, False)
        a = publisher.advertise("/a", string_connection("/a"), False)
        with_subscribers(publisher, clock, a)
        publisher.publish(a, string_frame("before"))
        ros_graph.all_read(publisher)
        for second in (100, 200):
            publisher.publish(clock, frame_of(struct.pack("<II", second, 500)))
            ros_graph.all_read(publisher)
            publisher.publish(a, string_frame("at %d" % second))
            ros_graph.all_read(publisher)
        assert recorder.stop() == 0
    assert live_samples.times(graph.folder / "log.mcap") == [
        ("/a", 100000000500), ("/a", 100000000500), ("/a", 200000000500)]
    assert "1 messages came before the first /clock" in recorder.output


def test_snapshot_keeps_the_past_in_memory_until_asked(graph):
    recorder = graph.record("/a", "-O", "log", "--snapshot", "60s")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        publish_numbers(publisher, a, range(1, 101))
        ros_graph.all_read(publisher)
        assert not list(graph.folder.glob("log*"))
        recorder.popen.send_signal(signal.SIGUSR1)
        recorder.wait_for_line("snapshot of 100 messages")
        publish_numbers(publisher, a, range(101, 121))
        ros_graph.all_read(publisher)
        recorder.popen.send_signal(signal.SIGUSR1)
        recorder.wait_for_line("snapshot of 20 messages")
        assert recorder.stop() == 0
    found = [content(path)["/a"] for path in graph.folder.glob("log_snapshot_*.mcap")]
    assert sorted(map(len, found)) == [20, 100]
    assert sorted(found, key=len)[1] == [twist_frame(n)[4:] for n in range(1, 101)]
    assert sorted(found, key=len)[0] == [twist_frame(n)[4:] for n in range(101, 121)]


def test_existing_and_cut_off_files_are_never_overwritten_unasked(graph):
    (graph.folder / "log.mcap").write_bytes(b"evidence")
    refused = graph.jaka_bag("record", "/a", "-O", "log")
    assert refused.wait() == 1
    assert "log.mcap exists" in refused.output
    assert (graph.folder / "log.mcap").read_bytes() == b"evidence"
    (graph.folder / "cut.mcap.active").write_bytes(b"evidence")
    refused = graph.jaka_bag("record", "/a", "-O", "cut")
    assert refused.wait() == 1
    assert "cut off" in refused.output
    assert (graph.folder / "cut.mcap.active").read_bytes() == b"evidence"
    forced = graph.record("/a", "-O", "log", "--force")
    assert forced.stop(signal.SIGTERM) == 1  # nothing was recorded
    assert (graph.folder / "log.mcap").read_bytes().startswith(b"\x89MCAP")


def test_parameters_are_attached_and_the_master_may_come_back(mortal_graph):
    graph = mortal_graph
    graph.master().setParam("/robot/model", "zu7")
    recorder = graph.record("/a", "-O", "log")
    graph.subscribed("/a")
    graph.stop_master()
    recorder.wait_for_line("recording goes on, waiting")
    graph.start_master()
    recorder.wait_for_line("registered again")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        publish_numbers(publisher, a, range(1, 11))
        assert recorder.stop() == 0
    assert len(content(graph.folder / "log.mcap")["/a"]) == 10
    with open(str(graph.folder / "log.mcap"), "rb") as file:
        attachments = list(make_reader(file).iter_attachments())
    assert {attachment.name for attachment in attachments} == {"rosparam.yaml"}
    assert all(json.loads(attachment.data)["robot"]["model"] == "zu7" for attachment in attachments)


def test_a_driver_that_starts_after_the_recorder_brings_its_parameters(graph):
    graph.master().setParam("/robot/model", "zu7")
    recorder = graph.record("/a", "-O", "log")
    graph.subscribed("/a")
    graph.master().setParam("/jaka_driver/model", "zu12")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        publish_numbers(publisher, a, range(1, 11))
        assert recorder.stop() == 0
    with open(str(graph.folder / "log.mcap"), "rb") as file:
        *first, last = [json.loads(attachment.data) for attachment in make_reader(file).iter_attachments()]
    for before in first:  # none where the file was begun, by its first message, after the driver was seen
        assert "jaka_driver" not in before and before["robot"] == {"model": "zu7"}
    assert last.get("jaka_driver") == {"model": "zu12"} and last["robot"] == {"model": "zu7"}, recorder.output


def test_rosnode_sees_and_ends_the_recorder(graph):
    recorder = graph.record("/a", "-O", "log", "__name:=evidence")
    graph.subscribed("/a")
    info = graph.start("rosnode", "info", "/evidence")
    assert info.wait() == 0
    assert "* /a [unknown type]" in info.output
    kill = graph.start("rosnode", "kill", "/evidence")
    assert kill.wait() == 0
    assert recorder.wait() == 1, recorder.output  # nobody published
    assert (graph.folder / "log.mcap").exists()


@pytest.mark.parametrize("arguments, reason", [
    ([], "nothing to record"), (["--state-log", "/a"], "chooses the topics itself"), (["-e"], "regular expressions"),
    (["/a", "--split"], "--split needs"), (["/a", "--max-splits", "2"], "needs --split"),
    (["/a", "--duration", "soon"], "not a duration"), (["/a", "--size", "-1"], "expected one argument|not a size"),
    (["/a", "--min-space", "much"], "not a size"), (["/a", "-l", "x"], "not a whole number")])
def test_bad_options_are_usage_errors(capsys, arguments, reason):
    assert main(["record", *arguments]) == 2
    assert re.search(reason, capsys.readouterr().err)


@pytest.mark.parametrize("arguments, reason", [
    (["-e", "("], "not a regular expression"), (["not a name"], "not a legal ROS name"),
    (["/a", "--bz2"], "compression"), (["/a", "-O", "nowhere/log"], "no folder")])
def test_what_cannot_be_recorded_is_one_line_and_code_1(graph, arguments, reason):
    refused = graph.jaka_bag("record", *arguments)
    assert refused.wait() == 1
    assert reason in refused.output
    assert "Traceback" not in refused.output
