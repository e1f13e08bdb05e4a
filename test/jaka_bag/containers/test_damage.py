"""Logs cut at every byte and with every byte flipped: a clear error or a result that is right, never a traceback."""
import json
import os
import random

import pytest
from log_samples import START_NS, STATES, Sample, in_order, model, read, state_log, states, write

from jaka_bag.cli.main import main
from jaka_bag.containers.registry import open_log, read_index
from jaka_bag.errors import BagError, BagFormatError
from jaka_bag.operations.recover import recover

SMALL = [model(START_NS, "zu7")] + [states(START_NS + i * 1000, i, 1, 0, 0) for i in range(1, 6)]
FORMS = [(".bag", "none"), (".bag", "lz4"), (".mcap", "none"), (".mcap", "zstd")]


def small(path, codec):
    return write(path, SMALL, codec, chunk_size=25)


def places(whole, suffix):
    """Return every byte; of the padding of a bag's first record, which is all spaces, every 61st."""
    padding = range(150, 4100) if suffix == ".bag" else range(0)
    return [at for at in range(len(whole)) if at not in padding or at % 61 == 0]


def read_strictly(path):
    """Read everything, or raise the package's own error."""
    try:
        return read(path)
    except BagError as error:
        assert "\n" not in str(error) and len(str(error)) < 400
        return None


@pytest.mark.parametrize("suffix, codec", FORMS)
def test_cut_at_every_byte(tmp_path, suffix, codec):
    whole = small(tmp_path / ("whole" + suffix), codec).read_bytes()
    cut, target = tmp_path / ("cut" + suffix), tmp_path / ("recovered" + suffix)
    most = 0
    for size in places(whole, suffix):
        cut.write_bytes(whole[:size])
        assert read_strictly(cut) is None, "cut at byte %d is read as whole" % size
        try:
            result = recover(cut, target, overwrite=True)
        except BagFormatError:
            assert most == 0, "cut at byte %d gives less than a shorter file" % size
            continue
        found = read(target)
        assert found == SMALL[:len(found)] and len(found) == result.messages >= most
        most = max(most, len(found))
        assert cut.read_bytes() == whole[:size]
    assert most == len(SMALL)
    assert sorted(os.listdir(str(tmp_path))) == sorted([cut.name, target.name, "whole" + suffix])


@pytest.mark.parametrize("suffix, codec", [(".bag", "none"), (".mcap", "none"), (".mcap", "zstd")])
def test_every_byte_flipped(tmp_path, suffix, codec):
    whole = small(tmp_path / ("whole" + suffix), codec).read_bytes()
    bad, target = tmp_path / ("bad" + suffix), tmp_path / ("recovered" + suffix)
    dice = random.Random(5)
    for at in places(whole, suffix):
        flipped = bytearray(whole)
        flipped[at] ^= 1 << dice.randrange(8)
        bad.write_bytes(bytes(flipped))
        found = read_strictly(bad)
        if found is not None and suffix == ".mcap":  # what the CRCs cover must be as it was
            assert [(s.time, s.data) for s in found] == [(s.time, s.data) for s in SMALL], at
        try:
            read_index(bad)
        except BagError:
            pass
        try:
            recovered = recover(bad, target, overwrite=True)
            assert len(read(target)) == recovered.messages
        except BagFormatError:
            assert at < 16, "nothing was recovered with byte %d flipped" % at
        assert bad.read_bytes() == bytes(flipped)


@pytest.mark.parametrize("suffix, codec", [(".bag", "none"), (".bag", "lz4"), (".mcap", "none"), (".mcap", "zstd")])
def test_damage_in_the_middle_loses_little(tmp_path, suffix, codec):
    samples = state_log(4.0)
    path = write(tmp_path / ("log" + suffix), samples, codec, chunk_size=4096)
    chunks = read_index(path).chunks
    raw = bytearray(path.read_bytes())
    victim = chunks[len(chunks) // 2]
    for at in range(victim.position, victim.position + 30):
        raw[at] = 0xAA
    path.write_bytes(bytes(raw))
    result = recover(path, tmp_path / ("recovered" + suffix))
    found = read(tmp_path / ("recovered" + suffix))
    assert not result.is_whole and result.expected == len(samples)
    assert set(found) <= set(samples) and len(found) > len(samples) * 0.9
    assert any(loss.begin <= victim.position < loss.end for loss in result.losses)


def test_messages_around_a_damaged_record_of_an_uncompressed_bag_are_kept(tmp_path):
    samples = state_log(1.0)
    path = write(tmp_path / "log.bag", samples, "none", chunk_size=1 << 20)
    raw = path.read_bytes()
    at = raw.index(samples[100].data) - 30  # inside the header of that record
    path.write_bytes(raw[:at] + b"\xff\xff" + raw[at + 2:])
    result = recover(path, tmp_path / "kept.bag")
    found = read(tmp_path / "kept.bag")
    assert len(found) == len(samples) - 1 and not result.is_whole
    assert found == in_order(samples[:100] + samples[101:])


def test_an_unindexed_bag_is_recovered_whole(tmp_path):
    samples = state_log(1.0)
    path = write(tmp_path / "log.bag", samples, "lz4")
    raw = path.read_bytes()
    end = int.from_bytes(raw[raw.index(b"index_pos=") + 10:][:8], "little")
    at = raw.index(b"index_pos=") + 10
    active = tmp_path / "run.bag.active"
    active.write_bytes(raw[:at] + bytes(8) + raw[at + 8:end])
    assert main(["recover", str(active), "-q"]) == 0
    assert read(tmp_path / "run.bag") == in_order(samples)


def test_the_open_chunk_of_an_active_bag_is_read_to_its_last_whole_record(tmp_path):
    samples = state_log(1.0)
    raw = write(tmp_path / "log.bag", samples, "none", chunk_size=1 << 20).read_bytes()
    at = raw.index(b"index_pos=") + 10
    chunk = raw.index(b"compression=none") - 8
    size_at = raw.index(b"size=", chunk) + 5
    active = bytearray(raw[:at] + bytes(8) + raw[at + 8:])
    active[size_at:size_at + 4] = bytes(4)
    active[size_at + 4:size_at + 8] = bytes(4)  # the length of the data stands behind the last field
    cut = raw.index(samples[200].data) + 5
    path = tmp_path / "run.bag.active"
    path.write_bytes(bytes(active[:cut]))
    result = recover(path, tmp_path / "run.bag")
    assert read(tmp_path / "run.bag") == in_order(samples[:200])
    assert not result.is_whole and "cut off" in result.losses[-1].reason


@pytest.mark.parametrize("codec", ["none", "lz4", "bz2"])
@pytest.mark.parametrize("victim", [0, 1])
def test_a_chunk_without_sizes_does_not_swallow_those_behind_it(tmp_path, codec, victim):
    samples = [states(START_NS + i, i, 1, 0, 0) for i in range(30)]
    path = write(tmp_path / "log.bag", samples, codec, chunk_size=80)
    chunks = read_index(path).chunks
    assert len(chunks) == 3
    raw = bytearray(path.read_bytes())
    at = raw.index(b"size=", chunks[victim].position) + 5
    raw[at:at + 8] = bytes(8)  # the length of the data stands behind the last field
    index_position = raw.index(b"index_pos=") + 10
    raw[index_position:index_position + 8] = bytes(8)
    path.write_bytes(bytes(raw[:chunks[-1].end]))
    result = recover(path, tmp_path / "found.bag")
    found = read(tmp_path / "found.bag")
    if codec == "none":
        assert found == samples
    else:
        assert set(samples[:10 * victim] + samples[10 * victim + 10:]) <= set(found) <= set(samples)
        assert not result.is_whole


def test_recovering_tells_what_is_lost_and_exits_1(tmp_path, capsys):
    path = write(tmp_path / "log.mcap", state_log(1.0))
    path.write_bytes(path.read_bytes()[:-3000])
    assert main(["recover", str(path)]) == 1
    out, err = capsys.readouterr()
    assert "PARTIAL" in out and err.startswith("jaka_bag: lost: bytes ")
    assert main(["recover", str(path), "--json", "--force"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["losses"] and not document["is_whole"] and document["messages"] > 0


def test_a_log_of_which_nothing_can_be_read_gives_no_output(tmp_path, capsys):
    path = tmp_path / "bad.bag"
    path.write_bytes(small(tmp_path / "log.bag", "none").read_bytes()[:4200])
    assert main(["recover", str(path)]) == 1
    assert "no message could be read" in capsys.readouterr().err
    assert not (tmp_path / "bad.recovered.bag").exists()


def test_connections_described_behind_their_messages_are_found(tmp_path):
    from log_samples import RawBag, message_record
    bag = RawBag()
    bag.add_chunk(message_record(5, 9, bytes(8)), [(5, [(9, 0)])], 9, 9)
    bag.add_connection(5, STATES)
    raw = bytearray(bag.content())
    at = bytes(raw).index(b"index_pos=") + 10
    raw[at:at + 8] = bytes(8)
    path = tmp_path / "late.bag"
    path.write_bytes(bytes(raw))
    assert recover(path, tmp_path / "found.bag").messages == 1
    assert read(tmp_path / "found.bag") == [Sample(STATES, 9, bytes(8))]


def test_messages_of_a_connection_without_description_are_counted_as_lost(tmp_path):
    from log_samples import RawBag, message_record
    bag = RawBag()
    bag.add_chunk(message_record(5, 9, bytes(8)) + message_record(0, 9, bytes(8)), [(5, [(9, 0)])], 9, 9)
    bag.add_connection(0, STATES)
    (tmp_path / "lost.bag").write_bytes(bag.content())
    result = recover(tmp_path / "lost.bag", tmp_path / "found.bag")
    assert result.messages == 1 and "1 messages of connection 5" in result.losses[0].reason
    with pytest.raises(BagFormatError, match="index is damaged"):
        open_log(tmp_path / "lost.bag")


def test_attachments_and_metadata_are_recovered(tmp_path):
    from jaka_bag.containers.mcap.writer import McapWriter
    path = tmp_path / "log.mcap"
    with McapWriter(path) as writer:
        writer.add_metadata("facts", {"host": "cell"})
        writer.add_attachment("params", b"a: 1")
        writer.add_message(writer.add_channel(STATES), START_NS, bytes(8))
    path.write_bytes(path.read_bytes()[:-50])
    assert recover(path, tmp_path / "found.mcap").messages == 1
    with open_log(tmp_path / "found.mcap") as reader:
        assert [a.name for a in reader.index.attachments] == ["params"]
        assert reader.read_metadata(reader.index.metadata[0]) == {"host": "cell"}
