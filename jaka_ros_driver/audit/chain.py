"""A line of the audit log: a JSON object with its number, the hash of the line before it, and a checksum of itself.

The hash chains the lines. The checksum tells which line was damaged, also where no line follows.
"""
import hashlib
import json
import re
import zlib
from typing import Any, Dict, Mapping, NamedTuple, Optional

BEFORE_THE_FIRST = "0" * 64
"""The ``prev`` of a log's first line, which no line precedes."""
LONGEST_LINE = 16384
"""Longest line, bytes; longer fields are left out of their line, which records that."""
_CHECKSUM = re.compile(rb',"crc":"([0-9a-f]{8})"}\Z')


class ChainLink(NamedTuple):
    """The position of a line in the chain.

    Attributes:
        number: Of the line, from 1 on.
        sha256: Of the line's bytes without the line end, hexadecimal.
    """

    number: int
    sha256: str


START = ChainLink(0, BEFORE_THE_FIRST)


def encode(after: ChainLink, fields: Mapping[str, Any]) -> bytes:
    """Return the line that follows ``after``, without a line end.

    Where it would be longer than ``LONGEST_LINE`` only short fields are kept, and ``left_out`` names the others.

    Raises:
        ValueError, TypeError: A field cannot be written as JSON.
    """
    line = _encode(after, fields)
    if len(line) > LONGEST_LINE:
        short = {name: value for name, value in fields.items() if len(_json(value)) <= 256}
        short["left_out"] = "%s: %d bytes" % (", ".join(sorted(set(fields) - set(short)))[:500], len(line))
        line = _encode(after, short)
    return line


def link_of(line: bytes, number: int) -> ChainLink:
    """Return the place of an encoded line."""
    return ChainLink(number, hashlib.sha256(line).hexdigest())


def is_whole(line: bytes) -> bool:
    """Return whether the checksum at the end of a line is that of the rest of it."""
    found = _CHECKSUM.search(line)
    return found is not None and int(found.group(1), 16) == zlib.crc32(line[:found.start()])


def decode(line: bytes) -> Optional[Dict[str, Any]]:
    """Return the fields of a line without its line end; None where it is damaged or no line of a log."""
    if not is_whole(line):
        return None
    try:
        fields = json.loads(line.decode("utf-8"))
    except ValueError:
        return None
    is_line = isinstance(fields, dict) and type(fields.get("n")) is int and isinstance(fields.get("prev"), str)
    return fields if is_line else None


def _encode(after: ChainLink, fields: Mapping[str, Any]) -> bytes:
    body = _json({"n": after.number + 1, "prev": after.sha256, **fields})[:-1]
    return body + b',"crc":"%08x"}' % zlib.crc32(body)


def _json(value: Any) -> bytes:
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.encode("utf-8", "replace")
