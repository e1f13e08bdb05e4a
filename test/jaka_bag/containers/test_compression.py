import bz2
import os
import random
import time

import pytest
from log_samples import in_order, read, state_log, write
from lz4 import frame

from jaka_bag.containers.compression import (
    BAG_CODECS,
    MCAP_CODECS,
    check_codec,
    compressor,
    decompress,
    decompress_partly,
)
from jaka_bag.containers.registry import open_log
from jaka_bag.errors import BagError, BagFormatError
from jaka_bag.operations.recover import recover

CODECS = sorted(set(BAG_CODECS + MCAP_CODECS))
DATA = os.urandom(1000) + b"state log " * 200000


@pytest.mark.parametrize("codec", CODECS)
def test_what_is_compressed_comes_back(codec):
    assert decompress(codec, compressor(codec)(DATA), len(DATA)) == DATA


@pytest.mark.parametrize("codec", CODECS)
def test_another_size_than_told_is_an_error(codec):
    with pytest.raises(BagFormatError):
        decompress(codec, compressor(codec)(DATA), len(DATA) - 1)


@pytest.mark.parametrize("codec, count", [("lz4", 250000), ("bz2", 250000)])
def test_very_many_empty_frames_take_no_time_of_their_square(codec, count):
    plain = frame.compress(b"end") if codec == "lz4" else bz2.compress(b"end")
    empty = frame.compress(b"", store_size=False) if codec == "lz4" else bz2.compress(b"")
    begun = time.process_time()
    assert decompress(codec, empty * count + plain, 3) == b"end"
    assert time.process_time() - begun < 6.0


@pytest.mark.parametrize("codec", ["lz4", "bz2"])
@pytest.mark.parametrize("sizes", [(200000,), (1, 0, 65536, 65537, 300000), (3, 4)])
def test_frames_that_end_anywhere_are_read(codec, sizes):
    pack = compressor(codec)
    parts = [os.urandom(size) for size in sizes]
    raw, whole = b"".join(map(pack, parts)), b"".join(parts)
    assert decompress(codec, memoryview(raw), len(whole)) == whole
    for wrong in (raw[:-1], raw + pack(b"x") if codec == "bz2" else raw[:len(raw) // 2]):
        with pytest.raises(BagFormatError):
            decompress(codec, wrong, len(whole))


@pytest.mark.parametrize("codec", ["lz4", "zstd", "bz2"])
def test_damage_is_an_error(codec):
    damaged = bytearray(compressor(codec)(DATA))
    damaged[:8] = bytes(8)
    with pytest.raises(BagFormatError, match="damaged"):
        decompress(codec, bytes(damaged), len(DATA))


@pytest.mark.parametrize("codec", CODECS)
def test_the_start_of_a_cut_off_chunk_is_read(codec):
    part = decompress_partly(codec, compressor(codec)(DATA)[:-10])
    assert DATA.startswith(part)
    if codec in ("none", "zstd"):
        assert len(part) > 500000


def test_a_chunk_cannot_claim_all_memory():
    with pytest.raises(BagFormatError, match="a limit, not damage"):
        decompress("zstd", b"", 1 << 40)


def test_unknown_codecs_are_named():
    with pytest.raises(BagFormatError, match="'brotli'"):
        decompress("brotli", b"", 0)
    with pytest.raises(BagError, match="none, lz4, bz2"):
        check_codec("zstd", BAG_CODECS, "a .bag")
    assert decompress_partly("brotli", b"xyz") == b""


def test_zstd_frames_tell_their_size():
    import zstandard
    assert zstandard.frame_content_size(compressor("zstd")(DATA)) == len(DATA)


@pytest.mark.parametrize("is_linked", [True, False])
@pytest.mark.parametrize("block_size", [frame.BLOCKSIZE_MAX64KB, frame.BLOCKSIZE_MAX4MB])
def test_an_lz4_frame_gives_all_before_its_cut(is_linked, block_size):
    dice = random.Random(5)
    raw = b"".join(dice.choice([b"abc" * dice.randrange(90), bytes(dice.randrange(700)), DATA[:dice.randrange(50)]])
                   for _ in range(3000))
    stored = frame.compress(raw, block_linked=is_linked, block_size=block_size, block_checksum=is_linked)
    for cut in [dice.randrange(7, len(stored)) for _ in range(40)]:
        found = decompress_partly("lz4", stored[:cut])
        assert raw.startswith(found) and len(found) >= 0.8 * len(raw) * (cut / len(stored)) - 3000, cut
    assert decompress_partly("lz4", stored[:-20], 1000) == raw[:1000]


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_a_cut_lz4_chunk_loses_no_more_than_what_is_behind_the_cut(tmp_path, suffix):
    samples = state_log(20.0)
    path = write(tmp_path / ("log" + suffix), samples, "lz4", chunk_size=1 << 22)
    with open_log(path) as reader:
        assert len(reader.chunks) == 1
        chunk = reader.chunks[0]
    path.write_bytes(path.read_bytes()[:chunk.position + (chunk.end - chunk.position) * 4 // 5])
    result = recover(path, tmp_path / ("out" + suffix))
    assert result.messages > 0.7 * len(samples)
    assert read(tmp_path / ("out" + suffix)) == in_order(samples[:result.messages])
