"""The recovery up to the last whole record: around damage, and an account of each gap."""
import bz2
import random
import struct
import time
import zlib

import pytest
import zstandard
from hostile_logs import mcap_with_chunks
from log_samples import START_NS, STATES, Sample, read, states, write
from lz4 import frame
from mcap_variants import ATTACHMENT, CHANNEL, DATA_END, FOOTER, HEADER, MAGIC, MESSAGE, SCHEMA, record, text, text_map

from jaka_bag.cli.main import main
from jaka_bag.containers.compression import decompress_partly
from jaka_bag.containers.cut_blocks import zstd_blocks
from jaka_bag.containers.mcap.records import parse_chunk_head
from jaka_bag.containers.registry import open_log, read_index
from jaka_bag.operations.recover import recover

PERIOD = 10_000_000
SAMPLES = [states(START_NS + i * PERIOD, i, 1, 0, 0) for i in range(20)]
DESCRIBED = (record(SCHEMA, struct.pack("<H", 1) + text(STATES.datatype) + text("ros1msg") + text(STATES.definition))
             + record(CHANNEL, struct.pack("<HH", 1, 1) + text(STATES.topic) + text("ros1") + text_map(
                 {"md5sum": STATES.md5sum, "callerid": "/jaka_driver", "latching": "0"})))
ATTACHED = record(ATTACHMENT, struct.pack("<QQ", 0, 0) + text("notes") + text("text/plain") + struct.pack("<Q", 5)
                  + b"notes" + struct.pack("<I", 7))
VICTIM = 8


def message(sample):
    return record(MESSAGE, struct.pack("<HIQQ", 1, 0, sample.time, sample.time) + sample.data)


def unchunked(victim, begin=0):
    """Return an MCAP without chunks, summary or checksums, one message of which is replaced."""
    messages = [message(sample) for sample in SAMPLES]
    return (MAGIC + record(HEADER, text("ros1") + text("")) + DESCRIBED + b"".join(messages[begin:VICTIM]) + victim
            + b"".join(messages[VICTIM + 1:]) + record(DATA_END, bytes(4)) + record(FOOTER, bytes(20)) + MAGIC)


def changed(raw, at, value):
    return raw[:at] + value + raw[at + len(value):]


WHOLE = message(SAMPLES[VICTIM])
DAMAGES = {
    "kind_0": changed(WHOLE, 0, b"\0"), "kind_of_a_channel": changed(WHOLE, 0, bytes([CHANNEL])),
    "kind_of_the_end": changed(WHOLE, 0, bytes([DATA_END])), "kind_of_the_footer": changed(WHOLE, 0, bytes([FOOTER])),
    "kind_of_an_index": changed(WHOLE, 0, b"\7"), "unknown_kind": changed(WHOLE, 0, b"\x25"),
    "private_kind": changed(WHOLE, 0, b"\x85"), "header": changed(WHOLE, 0, bytes([HEADER])),
    "too_long": changed(WHOLE, 1, b"\xff"), "far_too_long": changed(WHOLE, 1, b"\xff\xff\xff\xff\xff\xff\xff\x7f"),
    "too_short": changed(WHOLE, 1, struct.pack("<Q", 3)), "a_little_short": changed(WHOLE, 1, struct.pack("<Q", 26)),
    "zeros": bytes(len(WHOLE)), "noise": bytes(random.Random(3).randrange(256) for _ in range(1000)),
    "cut": WHOLE[:20], "zeros_of_a_block": bytes(100000)}


@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_record_of_an_mcap_without_chunks_costs_that_record(tmp_path, name):
    path, target = tmp_path / "damaged.mcap", tmp_path / "kept.mcap"
    path.write_bytes(unchunked(DAMAGES[name]))
    result = recover(path, target)
    found = read(target)
    others = SAMPLES[:VICTIM] + SAMPLES[VICTIM + 1:]
    assert [s for s in found if s in others] == others and len(found) <= len(others) + (name == "a_little_short")
    assert len(result.losses) == 1 and not result.is_whole
    loss = result.losses[0]
    at = unchunked(b"").index(message(SAMPLES[VICTIM + 1]))
    assert loss.begin in range(at, at + len(WHOLE)) and loss.end == at + len(DAMAGES[name])
    assert loss.after in (SAMPLES[VICTIM - 1].time, SAMPLES[VICTIM].time) and loss.until == SAMPLES[VICTIM + 1].time
    with pytest.raises(Exception, match="byte"):  # whoever reads strictly is told
        read(path)


def test_an_attachment_with_a_wrong_checksum_costs_that_attachment(tmp_path):
    path = tmp_path / "damaged.mcap"
    path.write_bytes(unchunked(WHOLE + ATTACHED))
    result = recover(path, tmp_path / "kept.mcap")
    assert read(tmp_path / "kept.mcap") == SAMPLES
    assert [loss.reason for loss in result.losses] == ["the CRC of the attachment notes is wrong"]


def test_a_damaged_record_in_a_chunk_costs_that_record(tmp_path):
    for name, damage in DAMAGES.items():
        if name.startswith("kind_of") or name in ("unknown_kind", "private_kind", "header"):
            continue  # records of other kinds are skipped in a chunk: its CRC says that one is damaged
        for codec, pack in (("", bytes), ("zstd", zstandard.ZstdCompressor().compress)):
            path = tmp_path / ("%s%s.mcap" % (name, codec))
            raw = unchunked(damage)
            raw = raw[raw.index(DESCRIBED):-len(record(DATA_END, bytes(4)) + record(FOOTER, bytes(20)) + MAGIC)]
            path.write_bytes(mcap_with_chunks(codec, [pack(raw)], len(raw)))
            result = recover(path, tmp_path / "kept.mcap", overwrite=True)
            found = read(tmp_path / "kept.mcap")
            others = SAMPLES[:VICTIM] + SAMPLES[VICTIM + 1:]
            assert [s for s in found if s in others] == others, (name, codec)
            assert result.losses[0].until == SAMPLES[VICTIM + 1].time and "byte" in result.losses[0].reason


@pytest.mark.parametrize("codec", ["none", "lz4", "zstd"])
def test_a_chunk_with_a_damaged_head_gives_its_messages(tmp_path, codec):
    path = write(tmp_path / "log.mcap", SAMPLES, codec, chunk_size=40)
    raw = path.read_bytes()
    with open_log(path) as reader:
        chunks = reader.chunks
    for at in range(9 + 16):
        damaged = changed(raw, chunks[1].position + at, bytes([raw[chunks[1].position + at] ^ 0x24]))
        (tmp_path / "damaged.mcap").write_bytes(damaged)
        recover(tmp_path / "damaged.mcap", tmp_path / "kept.mcap", overwrite=True)
        assert read(tmp_path / "kept.mcap") == SAMPLES, at


def test_a_record_of_a_bag_that_swallows_others_costs_itself(tmp_path):
    path = write(tmp_path / "log.bag", SAMPLES, "none", chunk_size=1 << 20)
    raw = path.read_bytes()
    at = raw.index(SAMPLES[VICTIM].data) - 4
    path.write_bytes(changed(raw, at, struct.pack("<I", 8 + 25)))
    result = recover(path, tmp_path / "kept.bag")
    assert read(tmp_path / "kept.bag") == SAMPLES[:VICTIM] + SAMPLES[VICTIM + 1:]
    assert (result.losses[0].after, result.losses[0].until) == (SAMPLES[VICTIM - 1].time, SAMPLES[VICTIM + 1].time)


def _blocks(codec):
    """Return a chunk of several blocks, and for each the end of its stored bytes and of what it unpacks to."""
    dice = random.Random(1)
    if codec == "bz2":
        full = bytes(dice.choice(b"abcdefgh") for _ in range(250000))
        pieces = []
        for at in range(0, len(full), 100000):
            piece = full[at:at + 100000]
            # a block holds a little less than 100000 bytes
            pieces.append((len(bz2.compress(full[:at + 100000], 1)), at + len(piece) - 200 * (len(pieces) + 1)))
        return full, bz2.compress(full, 1), pieces[:-1]
    full = b"".join(dice.choice((b"%d " % dice.randrange(1000), b"abcdefghij" * 9)) for _ in range(9000))
    full += bytes(dice.randrange(256) for _ in range(200000)) + bytes(300000)
    data, ends, done = zstandard.ZstdCompressor(level=3).compress(full), [], 0
    decoder = zstandard.ZstdDecompressor().decompressobj()
    stored = 0
    for block in zstd_blocks(data):
        stored += len(block)
        done += len(decoder.decompress(block))
        ends.append((stored, done))
    assert done == len(full) and stored == len(data)
    return full, data, ends


@pytest.mark.parametrize("codec", ["zstd", "bz2"])
def test_the_whole_blocks_of_a_cut_chunk_are_unpacked(codec):
    full, data, ends = _blocks(codec)
    assert len(ends) >= 2
    for stored, unpacked in ends:
        for size in (stored, stored + 40 if codec == "bz2" else stored + 1, stored + 300):
            found = decompress_partly(codec, data[:size], len(full))
            assert full.startswith(found) and len(found) >= unpacked, (size, len(found), unpacked)


def test_the_blocks_before_a_damaged_one_are_unpacked():
    full, data, ends = _blocks("zstd")
    for (stored, unpacked), (end, _) in zip(ends, ends[1:]):
        found = decompress_partly("zstd", data[:stored] + b"\xff" * (end - stored) + data[end:], len(full))
        assert found[:unpacked] == full[:unpacked], stored


@pytest.mark.parametrize("linked", [False, True])
def test_a_damaged_block_of_lz4_gives_its_beginning(linked):
    full = _blocks("zstd")[0][:150000]
    data = frame.compress(full, block_size=frame.BLOCKSIZE_MAX64KB, block_linked=linked)
    noise = bytes(random.Random(4).randrange(256) for _ in range(700))
    for at in range(1000, len(data) - 1000, 97):
        behind = b"\xff\x00" * 300 + data[at + 600:] if at % 2 else noise[:at % 700] + data[at:]
        found = decompress_partly("lz4", data[:at] + behind, len(full))
        assert len(found) <= len(full)
        same = next((i for i, (a, b) in enumerate(zip(found, full)) if a != b), len(found))
        cut = len(decompress_partly("lz4", data[:at], len(full)))
        assert same >= cut - 70, (at, same, cut)


def test_a_stored_block_of_zstd_is_read_up_to_the_cut():
    noise = bytes(random.Random(2).randrange(256) for _ in range(100000))
    data = zstandard.ZstdCompressor().compress(noise)
    assert len(decompress_partly("zstd", data[:60000], len(noise))) > 59900


def test_each_gap_is_told_with_its_bytes_times_and_reason(tmp_path, capsys):
    path = tmp_path / "damaged.mcap"
    path.write_bytes(unchunked(DAMAGES["zeros"]))
    assert main(["recover", str(path)]) == 1
    told = capsys.readouterr().err
    begin = unchunked(b"").index(message(SAMPLES[VICTIM + 1]))
    assert told == ("jaka_bag: lost: bytes %d to %d, 0.020000 s between the messages of 1700000000.070000 and "
                    "1700000000.090000: a record is damaged or cut off\n" % (begin, begin + len(WHOLE)))
    with open_log(tmp_path / "damaged.recovered.mcap") as reader:
        entry = next(e for e in reader.index.metadata if e.name == "jaka_bag.recovery")
        values = reader.read_metadata(entry)
    assert values == {"source": "damaged.mcap", "messages": "19", "losses": "1",
                      "lost 1": told.split("lost: ")[1].strip()}


def test_many_bombs_end_at_a_limit_that_is_said(tmp_path):
    path = tmp_path / "bombs.mcap"
    stored = zstandard.ZstdCompressor().compress(bytes(128 << 20))
    bombs = mcap_with_chunks("zstd", [stored] * 300, 128 << 20)
    good = record(MESSAGE, struct.pack("<HIQQ", 1, 0, 5, 5) + bytes(8))
    path.write_bytes(bombs[:-len(record(DATA_END, bytes(4)) + record(FOOTER, bytes(20)) + MAGIC)] + DESCRIBED + good
                     + record(DATA_END, bytes(4)) + record(FOOTER, bytes(20)) + MAGIC)
    begin = time.process_time()
    result = recover(path, tmp_path / "kept.mcap")
    assert time.process_time() - begin < 8
    assert read(tmp_path / "kept.mcap") == [Sample(STATES, 5, bytes(8))]
    told = [loss.describe() for loss in result.losses if "a limit, not damage" in loss.reason]
    assert len(told) == 1 and "JAKA_BAG_UNPACK_MB" in told[0]
    assert sum("unpacked" in loss.reason for loss in result.losses) < 10


def test_messages_of_chunks_do_not_use_up_the_limit(tmp_path, monkeypatch):
    monkeypatch.setattr("jaka_bag.containers.compression._BARREN_FLOOR", 1 << 20)
    monkeypatch.setattr("jaka_bag.containers.compression._BARREN_RATIO", 0)
    samples = [Sample(STATES, START_NS + i, bytes(8)) for i in range(200000)]
    path = write(tmp_path / "log.mcap", samples, "zstd", chunk_size=1 << 16)
    assert recover(path, tmp_path / "kept.mcap").is_whole


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_the_advice_to_recover_is_given_only_where_something_can_be(tmp_path, capsys, suffix):
    raw = write(tmp_path / ("log" + suffix), SAMPLES, "lz4", chunk_size=10**6).read_bytes()
    at = raw.index(b"\x04\x22\x4d\x18")
    cut, lost = tmp_path / ("cut" + suffix), tmp_path / ("lost" + suffix)
    many = write(tmp_path / ("many" + suffix), SAMPLES, "lz4", chunk_size=40).read_bytes()
    cut.write_bytes(changed(many, many.rindex(b"\x04\x22\x4d\x18"), b"\xff" * 40))
    lost.write_bytes(changed(raw, at, b"\xff" * 40))
    for path in (cut, lost, tmp_path / ("short" + suffix)):
        if path.name.startswith("short"):
            path.write_bytes(raw[:at + 2])
        assert main(["cat", str(path)]) == 1
        told = capsys.readouterr().err
        is_advised = "(jaka_bag recover" in told
        assert is_advised == (path is cut) and ("no message of it can be read" in told) == (path is not cut), told
        assert main(["recover", str(path), str(tmp_path / ("kept" + suffix)), "--force"]) == 1
        assert ("no message could be read" in capsys.readouterr().err) == (path is not cut)
        assert main(["doctor", str(path)]) == 1
        assert ("damaged: no message can be read" in capsys.readouterr().out) == (path is not cut)


def test_a_damaged_message_index_refuses_nothing(tmp_path):
    raw = write(tmp_path / "log.mcap", SAMPLES, "zstd", chunk_size=40).read_bytes()
    with open_log(tmp_path / "log.mcap") as reader:
        chunk = reader.chunks[1]
        end = chunk.position + parse_chunk_head(raw[chunk.position:]).end
    path = tmp_path / "damaged.mcap"
    noted = 0
    for at in range(end, chunk.end):
        for bit in (0, 5, 7):
            path.write_bytes(changed(raw, at, bytes([raw[at] ^ 1 << bit])))
            assert read(path) == SAMPLES, (at - end, bit)
            noted += "CRC is wrong, and that of each chunk" in " ".join(read_index(path).notes)
    assert noted > 100  # that an offset is wrong is found, and put right, when the chunk is unpacked


def test_a_wrong_checksum_of_data_that_have_no_other_is_refused(tmp_path, capsys):
    raw = unchunked(WHOLE)
    begin = raw.index(record(DATA_END, bytes(4)))
    raw = changed(raw, begin, record(DATA_END, struct.pack("<I", zlib.crc32(raw[:begin]))))
    path = tmp_path / "log.mcap"
    path.write_bytes(raw)
    assert read(path) == SAMPLES
    at = raw.index(WHOLE) + len(WHOLE) - 3
    path.write_bytes(changed(raw, at, b"\x77"))
    assert main(["cat", str(path)]) == 1
    assert "the data section's CRC is wrong (jaka_bag recover keeps the rest)" in capsys.readouterr().err
    assert main(["doctor", str(path)]) == 1
    assert recover(path, tmp_path / "kept.mcap").messages == len(SAMPLES)
