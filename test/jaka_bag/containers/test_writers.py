"""Files from the package's writers, read by others: the mcap library, rosbags."""
import contextlib
import os
from pathlib import Path

import numpy as np
import pytest
from log_samples import JOINTS, MODEL, START_NS, STATES, state_log, write
from mcap.reader import make_reader

from jaka_bag.containers.bag.writer import BagWriter
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.containers.registry import FORMATS, create_log, open_log
from jaka_bag.containers.time_order import messages_of
from jaka_bag.errors import BagError, OutputExists, WriteFailed
from jaka_bag.messages.connection import Connection

SAMPLES = state_log(2.0)


@pytest.mark.parametrize("codec", ["none", "lz4", "zstd"])
def test_the_mcap_library_reads_an_mcap_and_every_crc_is_right(tmp_path, codec):
    path = write(tmp_path / "log.mcap", SAMPLES, codec)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros1"
        found = [(channel.topic, schema.name, schema.data.decode(), channel.metadata.get("md5sum"), message.log_time,
                  message.data) for schema, channel, message in reader.iter_messages(log_time_order=False)]
        statistics = reader.get_summary().statistics
    assert found == [(s.connection.topic, s.connection.datatype, s.connection.definition, s.connection.md5sum, s.time,
                      s.data) for s in SAMPLES]
    assert statistics.message_count == len(SAMPLES) and statistics.chunk_count > 3
    assert (statistics.message_start_time, statistics.message_end_time) == (START_NS, max(s.time for s in SAMPLES))


def test_the_summary_and_data_crcs_are_there(tmp_path):
    from mcap.records import DataEnd, Footer
    from mcap.stream_reader import StreamReader
    with write(tmp_path / "log.mcap", SAMPLES).open("rb") as stream:
        last = [r for r in StreamReader(stream, validate_crcs=True).records if isinstance(r, (DataEnd, Footer))]
    assert last[0].data_section_crc and last[1].summary_crc


def test_channels_of_the_ros1_profile_tell_md5_caller_and_latching(tmp_path):
    path = write(tmp_path / "log.mcap", SAMPLES)
    with path.open("rb") as stream:
        channels = make_reader(stream).get_summary().channels
    by_topic = {c.topic: c for c in channels.values()}
    assert by_topic["/model"].metadata == {"md5sum": MODEL.md5sum, "callerid": "/launch", "latching": "true"}
    assert by_topic[JOINTS.topic].metadata["latching"] == "false"
    assert all(c.message_encoding == "ros1" for c in channels.values())
    assert min(channels) == 1 and all(c.schema_id > 0 for c in channels.values())


def test_attachments_and_metadata_are_kept(tmp_path):
    with McapWriter(tmp_path / "log.mcap") as writer:
        writer.add_attachment("params.yaml", b"a: 1", "application/yaml", 5, 6)
        writer.add_metadata("facts", {"host": "cell"})
    with (tmp_path / "log.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        attachment = next(reader.iter_attachments())
        metadata = next(reader.iter_metadata())
    assert (attachment.name, attachment.data, attachment.log_time, attachment.create_time) == (
        "params.yaml", b"a: 1", 5, 6)
    assert (metadata.name, metadata.metadata) == ("facts", {"host": "cell"})
    with open_log(tmp_path / "log.mcap") as reader:
        assert reader.read_attachment(reader.index.attachments[0]) == b"a: 1"
        assert reader.read_metadata(reader.index.metadata[0]) == {"host": "cell"}


def test_publish_times_and_sequences_are_kept(tmp_path):
    with McapWriter(tmp_path / "log.mcap") as writer:
        channel = writer.add_channel(STATES)
        writer.add_message(channel, 50, bytes(8), publish_time=40, sequence=7)
        writer.add_message(channel, 60, bytes(8), 55, 8)
        writer.add_message(channel, 70, bytes(8), 65, 9)
        writer.add_message(channel, 80, bytes(8))
        assert writer.pending_messages == 4
    with (tmp_path / "log.mcap").open("rb") as stream:
        found = [(m.log_time, m.publish_time, m.sequence) for _, _, m in make_reader(stream).iter_messages()]
    assert found == [(50, 40, 7), (60, 55, 8), (70, 65, 9), (80, 80, 0)]


@pytest.mark.parametrize("codec", ["none", "lz4", "bz2"])
def test_rosbags_reads_a_bag(tmp_path, codec):
    from rosbags.rosbag1 import Reader
    path = write(tmp_path / "log.bag", SAMPLES, codec)
    with Reader(path) as reader:
        found = [(c.topic, time, bytes(data)) for c, time, data in reader.messages()]
        callers = {c.topic: (c.ext.callerid, c.ext.latching) for c in reader.connections}
    assert found == sorted(((s.connection.topic, s.time, s.data) for s in SAMPLES), key=lambda m: m[1])
    assert callers["/model"] == ("/launch", 1) and callers[JOINTS.topic] == ("/jaka_driver", 0)


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_an_equal_connection_is_declared_once(tmp_path, suffix):
    with create_log(tmp_path / ("log" + suffix)) as writer:
        first = writer.add_channel(STATES)
        assert writer.add_channel(Connection(*STATES)) == first
        assert writer.add_channel(MODEL) != first
    with open_log(tmp_path / ("log" + suffix)) as reader:
        assert reader.connections == [STATES, MODEL] and reader.message_count == 0




def test_a_refused_chunk_leaves_what_was_before_it_whole(tmp_path, monkeypatch):
    path = tmp_path / "log.mcap"
    writer = McapWriter(path, compression="none", chunk_size=1000)
    channel = writer.add_channel(STATES)
    real = writer._output.file

    class Full:
        def write(self, data):
            real.write(bytes(data)[:10])
            raise OSError(28, "No space left on device")

        def __getattr__(self, name):
            return getattr(real, name)

    for i in range(200):
        writer.add_message(channel, START_NS + i, bytes(8))
    writer.flush()
    written = writer.message_count
    writer.add_message(channel, START_NS + 1000, bytes(8))
    monkeypatch.setattr(writer._output, "file", Full())
    with pytest.raises(WriteFailed, match="No space left") as failure:
        writer.flush()
    assert failure.value.errno == 28
    monkeypatch.undo()
    writer.close()
    with path.open("rb") as stream:
        assert len(list(make_reader(stream, validate_crcs=True).iter_messages())) == written == 200


def test_what_a_format_cannot_hold_is_refused(tmp_path):
    with pytest.raises(BagError, match="none, lz4, zstd"):
        McapWriter(tmp_path / "log.mcap", compression="bz2")
    with pytest.raises(BagError, match="none, lz4, bz2"):
        BagWriter(tmp_path / "log.bag", compression="zstd")
    with BagWriter(tmp_path / "log.bag") as writer:
        with pytest.raises(BagError, match="ROS 1 messages only"):
            writer.add_channel(Connection("/x", "a/msg/B", encoding="cdr", schema_encoding="ros2msg"))
        number = writer.add_channel(STATES)
        writer.add_message(number, 2**33 * 10**9, bytes(8))
        with pytest.raises(BagError, match="does not fit"):
            writer.flush()
    with pytest.raises(BagError, match="ends in .bag or .mcap"):
        create_log(tmp_path / "log.txt")
    with pytest.raises(BagError, match="is a folder"):
        create_log(tmp_path / "log.mcap", as_rosbag2=True)


def test_a_time_that_a_bag_cannot_hold_is_told_as_it_is_shown(tmp_path):
    with McapWriter(tmp_path / "late.mcap") as writer:
        writer.add_message(writer.add_channel(STATES), 2**64 - 1, bytes(8))
    with open_log(tmp_path / "late.mcap") as reader:
        batch, = map(reader.load, reader.chunks)
        with pytest.raises(BagError, match="a message time of 18446744073709551615 ns .shown as -1 ns. does not fit"):
            with BagWriter(tmp_path / "late.bag") as writer:
                writer.encode(batch, np.array([writer.add_channel(STATES)]))


def test_more_connections_than_mcap_can_number_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("jaka_bag.containers.mcap.records.MAX_CHANNELS", 3)
    with McapWriter(tmp_path / "log.mcap") as writer:
        for i in range(3):
            writer.add_channel(Connection("/t%d" % i, "a/B"))
        with pytest.raises(BagError, match="at most 3"):
            writer.add_channel(Connection("/t3", "a/B"))


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_a_failed_or_refused_output_leaves_nothing(tmp_path, suffix):
    path = tmp_path / ("log" + suffix)
    with pytest.raises(ValueError), create_log(path) as writer:
        writer.add_message(writer.add_channel(STATES), START_NS, bytes(8))
        raise ValueError
    assert not os.listdir(str(tmp_path))
    write(path, SAMPLES)
    before = path.read_bytes()
    with pytest.raises(OutputExists):
        create_log(path)
    assert path.read_bytes() == before and os.listdir(str(tmp_path)) == [path.name]


def test_memory_stays_flat(tmp_path):
    import tracemalloc
    with McapWriter(tmp_path / "log.mcap", chunk_size=1 << 16) as writer:
        channel = writer.add_channel(STATES)
        tracemalloc.start()
        for i in range(2000):
            writer.add_message(channel, i, bytes(64))
        before = tracemalloc.get_traced_memory()[0]
        for i in range(40000):
            writer.add_message(channel, i, bytes(64))
        grown = tracemalloc.get_traced_memory()[0] - before
        tracemalloc.stop()
    assert grown < 300000


def test_latin_1_in_a_definition_survives(tmp_path):
    odd = Connection("/odd", "a/B", "0" * 32, b"int32 x # \xe4\xf6".decode("utf-8", "surrogateescape"))
    for name in ("log.bag", "log.mcap"):
        with create_log(tmp_path / name) as writer:
            writer.add_message(writer.add_channel(odd), 5, bytes(4))
        with open_log(tmp_path / name) as reader:
            assert reader.connections == [odd]
            assert Path(reader.path).name == name


@pytest.mark.parametrize("entry", [entry for entry in FORMATS if entry.writer], ids=lambda entry: entry.name)
def test_a_writer_keeps_what_it_declares_and_refuses_or_drops_the_rest(entry, tmp_path):
    path = tmp_path / ("log" + entry.suffix)
    with create_log(path) as writer:
        can = writer.capabilities
        writer.add_message(writer.add_channel(STATES), 50, bytes(8), publish_time=40, sequence=7)
        for add, is_kept in ((lambda: writer.add_attachment("a", b"1"), can.attachments),
                             (lambda: writer.add_metadata("m", {"k": "v"}), can.metadata)):
            with contextlib.nullcontext() if is_kept else pytest.raises(BagError, match="has no place for"):
                add()
    with open_log(path) as reader:
        (message,) = messages_of(reader)
        assert (message.publish_time == 40) == can.publish_times and (message.sequence == 7) == can.sequences
        assert (len(reader.index.attachments), len(reader.index.metadata)) == (can.attachments, can.metadata)
