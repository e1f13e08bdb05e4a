import os

import pytest

from jaka_bag.containers.compression import (
    BAG_CODECS,
    MCAP_CODECS,
    check_codec,
    compressor,
    decompress,
    decompress_partly,
)
from jaka_bag.errors import BagError, BagFormatError

CODECS = sorted(set(BAG_CODECS + MCAP_CODECS))
DATA = os.urandom(1000) + b"state log " * 200000


@pytest.mark.parametrize("codec", CODECS)
def test_what_is_compressed_comes_back(codec):
    assert decompress(codec, compressor(codec)(DATA), len(DATA)) == DATA


@pytest.mark.parametrize("codec", CODECS)
def test_another_size_than_told_is_an_error(codec):
    with pytest.raises(BagFormatError):
        decompress(codec, compressor(codec)(DATA), len(DATA) - 1)


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
