"""The codecs of both formats; each library is imported when it is first used, and releases the GIL at work.

``MissingDependency`` is raised where the library of a codec is not installed.
"""
import threading
from typing import Any, Callable, Dict, Optional, Tuple

from ..errors import BagError, BagFormatError, MissingDependency
from .index import Buffer

MCAP_CODECS = ("none", "lz4", "zstd")
BAG_CODECS = ("none", "lz4", "bz2")
ZSTD_LEVEL = 1
_MAX_UNCOMPRESSED = 1 << 32

_local = threading.local()


def _import(name: str, what: str) -> Any:
    try:
        return __import__(name, fromlist=["x"])
    except ImportError:
        raise MissingDependency("%s compression needs the Python package %s" % (what, name.split(".")[0])) from None


def check_codec(codec: str, allowed: Tuple[str, ...], container: str) -> None:
    """Refuse a codec that the container does not have, by ``BagError``."""
    if codec not in allowed:
        raise BagError("%s has no %s compression: choose one of %s" % (container, codec, ", ".join(allowed)))


def _zstd(level: int) -> Callable[[Any], bytes]:
    zstandard = _import("zstandard", "zstd")

    def compress(data: Any) -> bytes:
        cache: Dict[int, Any] = _local.__dict__.setdefault("zstd", {})
        if level not in cache:  # one context for each thread: they are not thread-safe
            cache[level] = zstandard.ZstdCompressor(level=level, write_content_size=True)
        result: bytes = cache[level].compress(data)
        return result
    return compress


def _lz4(level: int, for_bag: bool) -> Callable[[Any], bytes]:
    frame = _import("lz4.frame", "lz4")
    # roslz4 (ROS 1's own decoder) reads independent batches, no content size, and wants the content checksum.
    options = {"block_linked": False, "content_checksum": True, "store_size": False} if for_bag else {}

    def compress(data: Any) -> bytes:
        result: bytes = frame.compress(data, compression_level=level, block_size=frame.BLOCKSIZE_MAX4MB, **options)
        return result
    return compress


def compressor(codec: str, level: Optional[int] = None, for_bag: bool = False) -> Callable[[Any], bytes]:
    """A thread-safe function that compresses one chunk.

    Args:
        codec: ``none``, ``lz4``, ``zstd`` or ``bz2``.
        level: The codec's own level; None for the fast default.
        for_bag: Keep to the lz4 frames that ROS 1 can read.
    """
    if codec == "zstd":
        return _zstd(ZSTD_LEVEL if level is None else level)
    if codec == "lz4":
        return _lz4(0 if level is None else level, for_bag)
    if codec == "bz2":
        import bz2
        return lambda data: bz2.compress(data, 9 if level is None else level)
    return lambda data: data if isinstance(data, bytes) else bytes(data)


def decompress(codec: str, data: Buffer, size: int) -> Buffer:
    """The ``size`` bytes of one compressed chunk.

    Raises:
        BagFormatError: The data is damaged, or its size is not ``size``.
    """
    if not 0 <= size < _MAX_UNCOMPRESSED:
        raise BagFormatError("a chunk claims %d bytes" % size)
    result: Buffer
    try:
        if codec in ("none", ""):
            result = data
        elif codec == "zstd":
            decoder = _local.__dict__.setdefault("zstd_decoder", None) or _import(
                "zstandard", "zstd").ZstdDecompressor()
            _local.zstd_decoder = decoder
            result = decoder.decompress(data, max_output_size=max(size, 1))
        elif codec == "lz4":
            result = _import("lz4.frame", "lz4").decompress(data)
        elif codec == "bz2":
            import bz2
            result = bz2.decompress(data)
        else:
            raise BagFormatError("compression %r is not known" % codec)
    except BagError:
        raise
    except Exception as error:  # each library has error types of its own
        raise BagFormatError("a compressed chunk is damaged (%s)" % (
            str(error).strip() or "it claims too much memory")) from error
    if len(result) != size:
        raise BagFormatError("a chunk has %d bytes instead of %d" % (len(result), size))
    return result


def decompress_partly(codec: str, data: Buffer) -> bytes:
    """As many bytes from the start of a damaged or cut-off chunk as its codec gives back."""
    decoder: Any
    if codec in ("none", ""):
        return bytes(data)
    if codec == "zstd":
        decoder = _import("zstandard", "zstd").ZstdDecompressor().decompressobj()
    elif codec == "lz4":
        decoder = _import("lz4.frame", "lz4").LZ4FrameDecompressor()
    elif codec == "bz2":
        import bz2
        decoder = bz2.BZ2Decompressor()
    else:
        return b""
    parts = []
    step = 4096  # in steps: the decoders drop what they have when one call fails
    for start in range(0, len(data), step):
        try:
            parts.append(decoder.decompress(bytes(data[start:start + step])))
        except Exception:  # each library has error types of its own; the rest is lost
            break
    return b"".join(parts)
