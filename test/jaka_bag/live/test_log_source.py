"""Logs as the player reads them: in order, framed, ahead of time."""
import struct
import threading

import pytest
from live_samples import string_connection, string_frame

from jaka_bag.containers.bag.writer import BagWriter
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.errors import BagError, BagFormatError
from jaka_bag.live.log_source import LogSource
from jaka_bag.messages.connection import Connection


def write(path, entries, chunk_size=300):
    kind = McapWriter if path.suffix == ".mcap" else BagWriter
    with kind(path, compression="none", chunk_size=chunk_size) as writer:
        for connection, at, text in entries:
            if isinstance(connection, str):
                connection = string_connection(connection)
            writer.add_message(writer.add_channel(connection), at, string_frame(text)[4:])
    return str(path)


def played(source, begin=None, end=None):
    messages = source.play(begin, end)
    found = list(messages)
    messages.close()
    return [(source.connections[m.connection].topic, m.time, m.frame) for m in found]


def test_several_logs_are_one_in_the_order_of_time(tmp_path):
    one = write(tmp_path / "one.bag", [("/a", 1000 + 2 * i, "a%d" % i) for i in range(200)])
    two = write(tmp_path / "two.mcap", [("/a", 1001 + 2 * i, "A%d" % i) for i in range(200)] + [("/b", 1200, "b")])
    source = LogSource([one, two])
    assert [c.topic for c in source.connections] == ["/a", "/b"]
    assert (source.begin, source.end) == (1000, 1399)
    found = played(source)
    assert [at for _, at, _ in found] == sorted(at for _, at, _ in found)
    assert len(found) == 401
    assert found[0] == ("/a", 1000, string_frame("a0"))
    assert struct.unpack_from("<I", found[0][2])[0] == len(found[0][2]) - 4
    assert [at for _, at, _ in played(source, 1010, 1012)] == [1010, 1011, 1012]
    assert played(source) == found  # again, as a loop does
    source.close()


def test_choices_by_name_pattern_and_exclusion(tmp_path):
    log = write(tmp_path / "log.bag", [(topic, 5, topic) for topic in ("/a", "/ab", "/b")])
    for options, topics in [({"topics": ["/a"]}, {"/a"}), ({"patterns": ["/a.*"]}, {"/a", "/ab"}),
                            ({"exclude": ["/a"]}, {"/ab", "/b"}), ({"topics": ["/x"]}, set())]:
        source = LogSource([log], **options)
        assert {topic for topic, _, _ in played(source)} == topics
        assert {c.topic for c in source.connections} == topics
        source.close()


def test_the_newest_latched_messages_before_a_time(tmp_path):
    def latched(topic):
        return Connection(topic, "std_msgs/String", "m", "string data\n", "/n", True)
    log = write(tmp_path / "log.bag", [(latched("/map"), 1, "old"), (latched("/map"), 2, "new"), ("/a", 3, "x"),
                                       (latched("/late"), 9, "later"), (latched("/pose"), 4, "pose")])
    source = LogSource([log])
    found = [(source.connections[m.connection].topic, m.frame) for m in source.last_before(5)]
    assert found == [("/map", string_frame("new")), ("/pose", string_frame("pose"))]
    source.close()


def test_the_newest_of_several_connections_is_found_across_logs_chunks_and_their_order(tmp_path):
    entries = [(topic, at, "%s%d" % (topic, at)) for at in range(10, 400) for topic in ("/a", "/b")]
    entries += [("/rare", 11, "rare")] + [("/a", 50, "again at 50")]  # the last chunk begins before others end
    one = write(tmp_path / "one.bag", sorted(entries[:-1], key=lambda entry: entry[1]) + entries[-1:])
    two = write(tmp_path / "two.mcap", [("/b", 200, "B200")])
    source = LogSource([one, two], frame=bytes)
    topics = [connection.topic for connection in source.connections]

    def newest(time, *wanted):
        found = source.newest(time, [topics.index(topic) for topic in wanted])
        assert [m.time for m in found] == sorted(m.time for m in found)
        return {topics[m.connection]: (m.time, m.frame[4:].decode()) for m in found}

    assert newest(9, "/a", "/b", "/rare") == {}
    assert newest(300, "/a", "/rare") == {"/a": (300, "/a300"), "/rare": (11, "rare")}
    assert newest(50, "/a") == {"/a": (50, "again at 50")}
    assert newest(200, "/b")["/b"][0] == 200 and newest(10**9, "/b") == {"/b": (399, "/b399")}
    source.close()


def test_batches_are_polled_without_waiting(tmp_path):
    source = LogSource([write(tmp_path / "log.bag", [("/a", i, "x") for i in range(2000)])], frame=bytes)
    ahead, found, batch = source.play(500, None), [], None
    while batch != []:
        batch = ahead.poll()
        found += batch or []
    assert [m.time for m in found] == list(range(500, 2000)) and found[0].frame == string_frame("x")[4:]
    ahead.close()
    source.close()


def test_stopping_early_ends_the_reading_thread(tmp_path):
    log = write(tmp_path / "log.bag", [("/a", i + 1, "x" * 100) for i in range(20000)], 100000)
    source = LogSource([log])
    messages = source.play(None, None)
    assert next(iter(messages)).time == 1
    messages.close()
    source.close()
    assert not [thread for thread in threading.enumerate() if thread.name == "read-ahead"]


def test_damage_is_told_to_the_player(tmp_path):
    log = tmp_path / "log.mcap"
    write(log, [("/a", i + 1, "x" * 50) for i in range(200)])
    raw = bytearray(log.read_bytes())
    raw[len(raw) // 4:len(raw) // 4 + 8] = bytes(8)
    log.write_bytes(raw)
    source = LogSource([str(log)])
    with pytest.raises(BagFormatError, match="jaka_bag recover"):
        played(source)
    source.close()


def test_what_is_not_ros_1_is_refused(tmp_path):
    log = write(tmp_path / "log.mcap", [(Connection("/a", "std_msgs.String", encoding="protobuf",
                                                    schema_encoding="protobuf"), 5, "x")])
    with pytest.raises(BagError, match="only ROS 1 messages can be played"):
        LogSource([log])


def test_a_missing_log_closes_the_others(tmp_path):
    log = write(tmp_path / "log.bag", [("/a", 5, "x")])
    with pytest.raises(BagError):
        LogSource([log, str(tmp_path / "missing.bag")])
