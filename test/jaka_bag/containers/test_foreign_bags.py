"""Bags as other software wrote or mended them: padding, lying indexes, indexes that forgot chunks."""
import struct

import pytest
from log_samples import START_NS, STATES, TOOL, RawBag, Sample, connection, message_record, read, states, tool, write

from jaka_bag.cli.main import main
from jaka_bag.containers.bag import records as bag_format
from jaka_bag.containers.registry import open_log, read_index
from jaka_bag.errors import BagFormatError
from jaka_bag.live.log_source import LogSource
from jaka_bag.operations.recover import recover

SAMPLES = [states(START_NS + i * 1000, i, 1, 0, 0) for i in range(20)]


def with_index_at(raw, position):
    """Return the bag with another index position in its first record."""
    at = raw.index(b"index_pos=") + 10
    return raw[:at] + struct.pack("<Q", position) + raw[at + 8:]


def index_position(raw):
    return struct.unpack_from("<Q", raw, raw.index(b"index_pos=") + 10)[0]


def padded(raw):
    """Return the bag with 49 zero bytes in front of the index, 4 KiB of zeros behind the end."""
    at = index_position(raw)
    return with_index_at(raw[:at] + bytes(49) + raw[at:] + bytes(4096), at + 49)


def test_zeros_around_the_index_are_skipped_and_told(tmp_path, capsys):
    path = tmp_path / "padded.bag"
    path.write_bytes(padded(write(tmp_path / "log.bag", SAMPLES, chunk_size=60).read_bytes()))
    assert read(path) == SAMPLES
    assert main(["convert", str(path), "-o", str(tmp_path / "log.mcap")]) == 0
    told = capsys.readouterr().err
    assert "49 bytes at byte" in told and "4096 bytes at byte" in told and "are zero and were skipped" in told
    assert read(tmp_path / "log.mcap") == SAMPLES
    assert main(["info", "--freq", str(path)]) == 0
    assert "4096 bytes" in capsys.readouterr().out
    source = LogSource([str(path)])
    assert len(source.notes) == 2
    source.close()
    result = recover(path, tmp_path / "recovered.bag")
    assert result.is_whole and read(tmp_path / "recovered.bag") == SAMPLES


def test_an_index_of_a_chunk_that_claims_more_than_it_holds_costs_no_message(tmp_path):
    bag = RawBag()
    many = [(0, START_NS + i, bytes([i % 256]) * 8) for i in range(278)]
    few = [(1, START_NS + 1000 + i, TOOL_MESSAGE) for i in range(82)]
    for group in (many, few):
        content, entries = b"", []
        for number, time, data in group:
            entries.append((time, len(content)))
            content += message_record(number, time, data)
        bag.add_chunk(content, [(group[0][0], entries)], group[0][1], group[-1][1])
    bag.add_connection(0, STATES)
    bag.add_connection(1, TOOL)
    raw = bytearray(bag.content())
    right = struct.pack("<I", 278 * 12)
    at = raw.index(right, raw.index(b"count=" + struct.pack("<I", 278)))
    raw[at:at + 4] = struct.pack("<I", 278 * 20)
    path = tmp_path / "claims.bag"
    path.write_bytes(bytes(raw))
    assert len(read(path)) == 360
    for words in (["convert", path, "-o", tmp_path / "a.mcap"], ["filter", path, "-o", tmp_path / "b.bag", "-t",
                  STATES.topic], ["recover", path, tmp_path / "c.bag"], ["info", "--freq", path]):
        assert main([str(word) for word in words] + (["-q"] if words[0] != "info" else [])) == 0
    assert [len(read(tmp_path / name)) for name in ("a.mcap", "b.bag", "c.bag")] == [360, 278, 360]


TOOL_MESSAGE = tool(1, START_NS, [0.0] * 6).data


def forgetful(raw, kept):
    """Return the bag with an index that names only the first ``kept`` of its chunks, like ``rosbag reindex`` of a cut
    file."""
    at = index_position(raw)
    section = raw[at:]
    connections, infos = [], []
    for record in bag_format.whole_records(section):
        begin = sum(map(len, connections + infos))
        (connections if record.kind == bag_format.OP_CONNECTION else infos).append(section[begin:record.end])
    head = bag_format.MAGIC + bag_format.file_header(at, len(connections), kept)
    return head + raw[len(head):at] + b"".join(connections + infos[:kept])


@pytest.mark.parametrize("kept", [0, 2])
def test_chunks_that_the_index_forgot_are_an_error_that_names_recover(tmp_path, capsys, kept):
    path = tmp_path / "forgetful.bag"
    path.write_bytes(forgetful(write(tmp_path / "log.bag", SAMPLES, chunk_size=60).read_bytes(), kept))
    for words in (["info", path], ["convert", path, "-o", tmp_path / "a.mcap"],
                  ["merge", path, "-o", tmp_path / "b.bag"],
                  ["filter", path, "-o", tmp_path / "c.bag", "-t", STATES.topic]):
        assert main([str(word) for word in words]) == 1
        assert "does not name the chunk at byte" in capsys.readouterr().err
    assert main(["recover", str(path), str(tmp_path / "found.bag")]) == 0
    assert read(tmp_path / "found.bag") == SAMPLES


def test_a_second_bag_behind_the_first_is_not_passed_over(tmp_path):
    raw = write(tmp_path / "log.bag", SAMPLES).read_bytes()
    (tmp_path / "two.bag").write_bytes(raw + raw)
    with pytest.raises(BagFormatError, match="does not name the chunk"):
        open_log(tmp_path / "two.bag")


def test_recovering_a_bag_whose_chunks_are_gone_tells_how_many_there_were(tmp_path, capsys):
    raw = write(tmp_path / "log.bag", SAMPLES, chunk_size=60).read_bytes()
    chunks = len(read_index(tmp_path / "log.bag").chunks)
    first = len(bag_format.MAGIC) + len(bag_format.file_header(0, 0, 0))
    (tmp_path / "empty.bag").write_bytes(raw[:first])
    assert main(["recover", str(tmp_path / "empty.bag")]) == 1
    assert "tells of %d chunks, 0 were found" % chunks in capsys.readouterr().err
    second = read_index(tmp_path / "log.bag").chunks[1].position
    (tmp_path / "cut.bag").write_bytes(raw[:second])
    assert main(["recover", str(tmp_path / "cut.bag")]) == 1
    told = capsys.readouterr()
    assert "PARTIAL" in told.out and "tells of %d chunks, 1 were found" % chunks in told.err


def test_of_two_descriptions_the_intact_one_is_recovered(tmp_path):
    text = "# a comment, long enough to be hit\nint16 value\n"
    kind = connection("/value", "test_msgs/Value", text)
    raw = bytearray(write(tmp_path / "log.bag", [Sample(kind, START_NS + i, b"ab") for i in range(3)]).read_bytes())
    raw[raw.index(b"comment")] = 0xE9  # in the chunk; the index has it whole
    raw[raw.index(b"index_pos=") + 10 + 7] = 0
    (tmp_path / "bad.bag").write_bytes(bytes(raw))
    recover(tmp_path / "bad.bag", tmp_path / "found.bag")
    with open_log(tmp_path / "found.bag") as reader:
        assert reader.connections == [kind]
    assert b"\xe9" not in (tmp_path / "found.bag").read_bytes()[4117:]


def described_twice(path, inside, by_the_index):
    """Write a bag whose chunk describes its connections otherwise than its index section does."""
    bag = RawBag()
    content, entries = b"", {}
    for number, value in inside.items():
        content += bag_format.connection_record(number, value)
    for i in range(6):
        entries.setdefault(i % 2, []).append((START_NS + i, len(content)))
        content += message_record(i % 2, START_NS + i, b"\4\0\0\0" + (b"chat", b"STOP")[i % 2])
    bag.add_chunk(content, sorted(entries.items()), START_NS, START_NS + 5)
    for number, value in by_the_index.items():
        bag.add_connection(number, value)
    path.write_bytes(bag.content())
    return path


CHATTER = connection("/chatter/abc", "std_msgs/String", "string data\n")
STOP = connection("/safety/stop", "std_msgs/String", "string data\n")


@pytest.mark.parametrize("by_the_index, told", [
    ({0: STOP, 1: CHATTER}, "'/safety/stop'"),
    ({0: CHATTER, 1: STOP._replace(topic="/safety/rtop")}, "'/safety/rtop'"),
    ({0: CHATTER, 1: STOP._replace(datatype="std_msgs/Strong")}, "'std_msgs/Strong'"),
    ({0: CHATTER, 1: STOP._replace(md5sum="1" + STOP.md5sum[1:])}, "md5"),
    ({0: CHATTER, 1: STOP._replace(definition="string dada\n")}, "definition")])
def test_an_index_that_describes_a_connection_otherwise_than_the_chunk_is_told(tmp_path, capsys, by_the_index, told):
    path = described_twice(tmp_path / "twice.bag", {0: CHATTER, 1: STOP}, by_the_index)
    for words in (["cat", path], ["convert", path, "-o", tmp_path / "o.mcap"], ["filter", path, tmp_path / "f.bag"]):
        assert main([str(word) for word in words]) == 1
        answer = capsys.readouterr()
        assert "STOP" not in answer.out and "jaka_bag recover" in answer.err and answer.err.count("\n") == 1
        assert told in answer.err
    assert main(["doctor", str(path)]) == 1
    assert told in capsys.readouterr().out
    assert main(["recover", str(path), str(tmp_path / "r.bag")]) == 1
    assert "PARTIAL" in capsys.readouterr().out
    found = read(tmp_path / "r.bag")
    assert [(s.connection, s.data[4:]) for s in found] == [(CHATTER, b"chat"), (STOP, b"STOP")] * 3
    assert set(read_index(tmp_path / "r.bag").connections) == {CHATTER, STOP}


def test_a_lying_index_that_is_read_last_changes_no_topic(tmp_path, capsys):
    path = described_twice(tmp_path / "twice.bag", {0: CHATTER, 1: STOP}, {0: STOP, 1: CHATTER})
    path.write_bytes(with_index_at(path.read_bytes(), 0))
    assert main(["recover", str(path), str(tmp_path / "r.bag")]) == 1
    assert "connection 0" in capsys.readouterr().err
    assert [s.connection for s in read(tmp_path / "r.bag")] == [CHATTER, STOP] * 3


@pytest.mark.parametrize("inside", [{}, {1: STOP}, {1: STOP._replace(callerid="/other", latching=True)}])
def test_chunks_may_describe_some_connections_or_none(tmp_path, inside):
    path = described_twice(tmp_path / "some.bag", inside, {0: CHATTER, 1: STOP})
    assert [s.connection for s in read(path)] == [CHATTER, STOP] * 3
    assert recover(path, tmp_path / "r.bag").is_whole


def old_record(fields, data):
    return bag_format.pack_record(fields, data)


def bag_of_version_1_2(samples):
    """Return a bag ``#ROSRECORD V1.2``: a padded first record, definitions in front of their messages, an index for
    each topic."""
    out = b"#ROSRECORD V1.2\n" + old_record([("op", b"\x03"), ("index_pos", bytes(8))], b" " * 4000)
    defined = set()
    for sample in samples:
        kind = sample.connection
        about = [("topic", kind.topic.encode()), ("md5", kind.md5sum.encode()), ("type", kind.datatype.encode())]
        if kind.topic not in defined:
            out += old_record([("op", b"\x01"), *about, ("def", kind.definition.encode())], b"")
            defined.add(kind.topic)
        seconds, nanoseconds = divmod(sample.time, 10**9)
        out += old_record([("op", b"\x02"), *about, ("sec", struct.pack("<I", seconds)),
                           ("nsec", struct.pack("<I", nanoseconds)), ("latching", b"0"),
                           ("callerid", kind.callerid.encode())], sample.data)
    for topic in sorted(defined):
        out += old_record([("op", b"\x04"), ("ver", bytes(4)), ("topic", topic.encode()), ("count", bytes(4))], b"")
    return out


def test_bags_of_version_1_2_are_read_and_never_written(tmp_path, capsys):
    samples = SAMPLES + [tool(i, START_NS + 10**9 + i, [0.5] * 6) for i in range(5)]
    samples.append(Sample(STATES, START_NS + 2 * 10**9, bytes(2 << 20)))
    path = tmp_path / "old.bag"
    path.write_bytes(bag_of_version_1_2(samples))
    assert read(path) == samples
    assert main(["convert", str(path), "-o", str(tmp_path / "new.bag")]) == 0
    assert read(tmp_path / "new.bag") == samples and read_index(tmp_path / "new.bag").version == "2.0"
    assert main(["filter", str(path), "-o", str(tmp_path / "some.mcap"), "-t", TOOL.topic, "-q"]) == 0
    assert read(tmp_path / "some.mcap") == samples[20:25]
    capsys.readouterr()
    assert main(["info", "--freq", str(path)]) == 0
    assert "bag 1.2" in capsys.readouterr().out
    assert main(["convert", str(path), "-o", str(tmp_path / "nothing")]) == 1
    cut = tmp_path / "cut.bag"
    cut.write_bytes(path.read_bytes()[:-(2 << 20)])
    assert main(["info", str(cut)]) == 1
    assert main(["recover", str(cut), str(tmp_path / "found.bag")]) == 1
    assert read(tmp_path / "found.bag") == samples[:-1]
