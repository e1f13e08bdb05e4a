"""The codecs of both formats; each library is imported when it is first used, and releases the GIL at work.

``MissingDependency`` is raised where the library of a codec is not installed.
"""
import importlib
import os
import threading
from typing import IO, Any, Callable, Dict, List, Optional, Tuple

from ..errors import BagError, BagFormatError, LimitReached, MissingDependency, NotSupported
from .cut_blocks import cut_off_part, zstd_blocks
from .index import Buffer, read_at

MCAP_CODECS = ("none", "lz4", "zstd")
BAG_CODECS = ("none", "lz4", "bz2")
ZSTD_LEVEL = 1
"""Level of Zstandard, 1 to 22: the fastest of them, because a recorder has to keep up."""
_WINDOW = 256 << 20
"""Bytes that one chunk may unpack to: they are in memory at once, whatever the file's size."""
_BARREN_FLOOR, _BARREN_RATIO = 512 << 20, 10
"""Limit of what the chunks of a file may unpack to beyond their messages: byte, or a multiple of the file if larger.

It bounds the time for nothing. Messages have no such limit: they are what a log is read for, and pass one by one.
"""
MESSAGE_HEAD = 64
"""Bytes around a message's payload in a chunk, at most."""
_LIMIT_NAME = "JAKA_BAG_UNPACK_MB"
"""Environment variable, MB, that raises all limits for a file that is trusted."""

_PIECE = 4096
"""Bytes given to a decoder at first; what lies before damage is lost for no more than a piece."""
_STEP = 1 << 16
"""Bytes taken from a decoder at a time: it must not make a gigabyte of a kilobyte before it is stopped."""
_READ = 1 << 20
"""Bytes read at a time: memory stays bounded."""
_WHOLE_FLOOR, _WHOLE_RATIO = 1 << 30, 1000
"""The limit of what a file that is compressed as a whole may claim, which goes to the disk."""

_local = threading.local()


def _import(name: str, what: str) -> Any:
    try:
        return importlib.import_module(name)
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
    """Return a thread-safe function that compresses one chunk.

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


def unknown_codec(name: str) -> NotSupported:
    """Return the error about a codec that is none of this package's."""
    return NotSupported("the compression %r is not supported; the log is not damaged" % name[:20])


def is_readable(size: int) -> bool:
    """Return whether every reader unpacks a chunk to ``size`` bytes."""
    return size <= _WINDOW


def _limit(*limits: int) -> int:
    """Return the largest of some limits, byte, and of the one in the environment."""
    trusted = os.environ.get(_LIMIT_NAME, "")
    return max(*limits, int(trusted) * 1000000 if trusted.isdecimal() and len(trusted) < 10 else 0)


def _limit_reached(what: str, claimed: int, limit: int) -> LimitReached:
    return LimitReached("%s unpacked to %d MB; %s: up to %d MB are unpacked, and %d with %s=%d in the environment" % (
        what, claimed // 1000000, LimitReached.WORDS, limit // 1000000, claimed // 1000000 + 1, _LIMIT_NAME,
        claimed // 1000000 + 1))


class Allowance:
    """A limit for what the chunks of one file unpack to beyond their messages; thread-safe.

    Args:
        file_size: byte.
    """

    def __init__(self, file_size: int) -> None:
        self._most_barren = _limit(_BARREN_FLOOR, _BARREN_RATIO * file_size)
        self._barren: Dict[int, int] = {}
        self._total = 0
        self._lock = threading.Lock()

    def spend(self, position: int, size: int, messages: int, payload: int) -> None:
        """Count the chunk at a position of the file, which unpacked to ``size`` bytes; the same one counts once.

        Args:
            position: Its first byte.
            size: byte.
            messages: Messages that it gave.
            payload: Bytes of their payloads.
        """
        barren = size - payload - MESSAGE_HEAD * messages
        if barren > 0:
            with self._lock:
                self._total += barren - self._barren.get(position, 0)
                self._barren[position] = barren

    def check(self) -> None:
        """Check that another chunk may be unpacked.

        Raises:
            LimitReached: Those before gave too little for it.
        """
        self.check_barren(self._total)

    def check_barren(self, size: int) -> None:
        """Check the bytes that chunks unpacked to beyond their messages.

        Raises:
            LimitReached: They are too many for another chunk.
        """
        if size > self._most_barren:
            raise _limit_reached("what is no message in its chunks is", size, self._most_barren)


def _bounded(decoder: Any, data: Buffer, size: int) -> bytes:
    """Decompress at most ``size`` + 1 bytes of a chunk; one more shows that there is more than claimed."""
    result: bytes = decoder.decompress(data, max_length=size + 1)
    return result


def _decompress_streams(new_decoder: Callable[[], Any], data: Buffer, size: int, may_have_rest: bool) -> bytes:
    """Decompress the streams of a chunk; what follows its ``size`` bytes is more than claimed, or may be there.

    The first is given all, as there mostly is no other; further ones get pieces that grow, because a decoder copies all
    that follows its stream.
    """
    parts: List[bytes] = []
    total, rest, step = 0, memoryview(data), len(data)
    while len(rest) and total <= size and not (may_have_rest and parts and total == size):
        decoder = new_decoder()
        while not decoder.eof and total <= size:
            if decoder.needs_input and not len(rest):
                raise EOFError("it ends too early")
            piece = rest[:step] if decoder.needs_input else rest[:0]
            rest, step = rest[len(piece):], 2 * step
            parts.append(_bounded(decoder, piece, size - total))
            total += len(parts[-1])
        used = len(data) - len(rest) - len(decoder.unused_data or b"")
        rest, step = memoryview(data)[used:], _PIECE
    return parts[0] if len(parts) == 1 else b"".join(parts)


def _decompress_zstd(data: Buffer, size: int) -> bytes:
    zstandard = _import("zstandard", "zstd")
    if not size and not len(data):
        return b""
    decoder = _local.__dict__.setdefault("zstd_decoder", None) or zstandard.ZstdDecompressor()
    _local.zstd_decoder = decoder
    told = zstandard.frame_content_size(data)
    if told > size:
        raise BagFormatError("a chunk has %d bytes instead of %d" % (told, size))
    result: bytes = b""
    if told in (-1, size):
        result = decoder.decompress(data, max_output_size=max(size, 1))
    if len(result) < size:  # a chunk may be several frames
        with decoder.stream_reader(data, read_across_frames=True) as stream:
            result = stream.read(size + 1)
    return result


def check_chunk(size: int, stored: int) -> None:
    """Check the size that ``stored`` bytes of a chunk are unpacked to.

    Raises:
        LimitReached: It is too much.
    """
    most = _limit(_WINDOW)
    if size < 0 or size > most:
        raise _limit_reached("a chunk of %d bytes is" % stored, size, most)


def decompress(codec: str, data: Buffer, size: int) -> Buffer:
    """Decompress one chunk into its ``size`` bytes; never use more memory than that.

    Raises:
        BagFormatError: The data is damaged, or its size is not ``size``.
        LimitReached: It claims too much.
    """
    if size < 0 or codec not in ("none", ""):
        check_chunk(size, len(data))
    result: Buffer
    try:
        if codec in ("none", ""):
            result = data
        elif codec == "zstd":
            result = _decompress_zstd(data, size)
        elif codec == "lz4":
            result = _decompress_streams(_import("lz4.frame", "lz4").LZ4FrameDecompressor, data, size, True)
        elif codec == "bz2":
            import bz2
            result = _decompress_streams(bz2.BZ2Decompressor, data, size, False)
        else:
            raise unknown_codec(codec)
    except BagError:
        raise
    except Exception as error:  # each library has error types of its own
        raise BagFormatError("a compressed chunk is damaged (%s)" % (
            str(error).strip() or "it claims too much memory")) from error
    if len(result) != size:
        raise BagFormatError("a chunk has %d bytes instead of %d" % (len(result), size))
    return result


def unpack_file(descriptor: int, size: int, out: IO[bytes]) -> Tuple[int, str]:
    """Unpack a file that was compressed as a whole with zstd into another one, up to its first damage.

    Returns:
        The first byte of the file that is not unpacked, and the reason; an empty reason where all is.
    """
    zstandard = _import("zstandard", "zstd")
    decoder = zstandard.ZstdDecompressor().decompressobj()
    most = _limit(_WHOLE_FLOOR, _WHOLE_RATIO * size)
    at = 0
    try:
        for begin in range(0, size, _READ):
            raw = memoryview(read_at(descriptor, begin, _READ))
            for at in range(begin, begin + len(raw), _PIECE):  # where a piece is damaged, what it gives is lost
                out.write(decoder.decompress(raw[at - begin:at - begin + _PIECE]))
                if decoder.eof:
                    return size, ""
                if out.tell() > most:
                    return at, str(_limit_reached("it is", out.tell(), most))
    except zstandard.ZstdError as error:
        return at, str(error)
    finally:
        out.flush()
    return at, "it ends too early"


def decompress_partly(codec: str, data: Buffer, size: Optional[int] = None) -> bytes:
    """Decompress as many bytes from the start of a damaged or cut-off chunk as its codec returns.

    Args:
        codec: Name of the codec, as for ``decompress``.
        data: Bytes of the chunk that there are.
        size: Bytes at most; None where the chunk has no size.
    """
    most = _limit(_WINDOW)
    most = most if size is None else min(size, most)
    if codec in ("none", ""):
        return bytes(data) if size is None else bytes(data[:size])
    if codec == "zstd":
        zstd = _import("zstandard", "zstd").ZstdDecompressor().decompressobj()
        blocks = zstd_blocks(bytes(data))
        return _joined(lambda left: next((part for part in map(zstd.decompress, blocks) if part), b""), most)[:most]
    decoder: Any
    if codec == "lz4":
        decoder = _import("lz4.frame", "lz4").LZ4FrameDecompressor()
    elif codec == "bz2":
        import bz2
        decoder = bz2.BZ2Decompressor()
    else:
        return b""
    rest = memoryview(data)
    is_cut = False

    def step(left: int) -> bytes:
        nonlocal rest, is_cut
        part = b""
        while not part and not decoder.eof and (len(rest) or not decoder.needs_input):
            taken = bytes(rest[:_PIECE]) if decoder.needs_input else b""
            rest = rest[len(taken):]
            part = decoder.decompress(taken, max_length=min(_STEP, left))
        is_cut = not part and not decoder.eof
        return part

    whole = _joined(step, most)
    if codec == "lz4" and not decoder.eof and len(whole) < most:
        whole += cut_off_part(bytes(data), whole, most - len(whole), is_cut)
    return whole


def _joined(step: Callable[[int], bytes], most: int) -> bytes:
    """Return the output that a decoder gives in steps before its first error: decoders drop it when one call fails."""
    parts: List[bytes] = []
    left = most
    while left > 0:
        try:
            part = step(left)
        except Exception:  # each library has error types of its own; the rest is lost
            break
        if not part:
            break
        parts.append(part)
        left -= len(part)
    return b"".join(parts)
