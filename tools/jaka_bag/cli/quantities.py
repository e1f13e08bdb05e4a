"""Times, durations and sizes as users write them on the command line, the same in every command.

Each function raises ``argparse.ArgumentTypeError`` where the text is no such thing.
"""
import argparse
import math
import re
from decimal import Decimal

from ..messages.selection import TimePoint
from ..units import NS_PER_S

_NANOSECONDS = {"": NS_PER_S, "ms": NS_PER_S // 1000, "s": NS_PER_S, "m": 60 * NS_PER_S, "h": 3600 * NS_PER_S}
_LONGEST_S = 1 << 33
"""Largest time or duration, s: beyond it, in ns, none fits into the 64 bits of a log."""
_ABSOLUTE_FROM = 100000000
"""Seconds from here on are taken as seconds since the epoch (1973), below as offsets."""
_CLOCK = re.compile(r"^(?:([0-9]+):)?([0-9]+):([0-5]?[0-9](?:\.[0-9]+)?)$")
_AS_INFO_PRINTS = re.compile(r"^\(?([0-9]+\.[0-9]{9})\)?$")
_BYTES = {"": 1, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30}
_NUMBER = re.compile(r"^\s*([0-9]*\.?[0-9]+(?:e[+-]?[0-9]+)?)\s*([a-z]*)\s*$", re.IGNORECASE)


def given(text: str) -> str:
    """Return a text that is not empty: a variable of the shell that is not set must not be taken for no option."""
    if not text.strip():
        raise argparse.ArgumentTypeError("it is empty")
    return text


def nanoseconds(text: str) -> int:
    """Parse a duration, ns, 0 or more, from ``5``, ``500ms``, ``5s``, ``2m``, ``1h``, ``1:30`` or ``1:02:03.5``."""
    words = text.strip()
    clock = _CLOCK.match(words)
    match = _NUMBER.match(words)
    if clock:
        hours, minutes, seconds = (Decimal(part or 0) for part in clock.groups())
        value = (hours * 60 + minutes) * 60 + seconds
    elif match and match.group(2).lower() in _NANOSECONDS:
        value = Decimal(match.group(1)) * _NANOSECONDS[match.group(2).lower()] / NS_PER_S
    else:
        raise argparse.ArgumentTypeError("%r is not a duration (5, 500ms, 5s, 2m, 1h, 1:30)" % text)
    if value > _LONGEST_S:
        raise argparse.ArgumentTypeError("%r is too long a duration" % text)
    return int((value * NS_PER_S).to_integral_value())


def duration(text: str) -> float:
    """Parse a duration as ``nanoseconds`` does; return it in s."""
    return nanoseconds(text) / NS_PER_S


def positive_ns(text: str) -> int:
    """Parse a duration above 0 as ``nanoseconds`` does; return it in ns."""
    ns = nanoseconds(text)
    if not ns:
        raise argparse.ArgumentTypeError("%r is not a duration above 0" % text)
    return ns


def time_point(text: str) -> TimePoint:
    """Parse a moment in a log.

    A duration (``12.5``, ``1:30``) counts from the log's start, with a minus from its end. Absolute are numbers from
    1e8 on (s since the epoch), numbers with nine decimals as ``info`` prints them (``42.000000000``), and those behind
    an ``@``.
    """
    words = text.strip()
    printed = _AS_INFO_PRINTS.match(words)
    if printed:
        return TimePoint(nanoseconds(printed.group(1)), True)
    if words[:1] in ("-", "@"):
        ns = nanoseconds(words[1:])
        return TimePoint(ns, True) if words[0] == "@" else TimePoint(-ns, False)
    ns = nanoseconds(words)
    return TimePoint(ns, ns >= _ABSOLUTE_FROM * NS_PER_S)


def size(text: str) -> int:
    """Parse a size, byte, from ``1000``, ``64k``, ``64M`` or ``1G`` (powers of 1024)."""
    match = _NUMBER.match(text)
    unit = match.group(2).lower().rstrip("b") if match else ""
    if not match or unit not in _BYTES:
        raise argparse.ArgumentTypeError("%r is not a size (1000, 64k, 64M, 1G)" % text)
    return int(float(match.group(1)) * _BYTES[unit])


def megabytes(text: str) -> int:
    """Parse a size, byte, from a number of MB (1024 x 1024 byte), or with a unit as ``size`` takes it."""
    match = _NUMBER.match(text)
    return size(text + "M" if match and not match.group(2) else text)


def positive_number(text: str) -> float:
    """Parse a number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not value > 0 or math.isinf(value):
        raise argparse.ArgumentTypeError("%r is not a number above 0" % text)
    return value


def count(text: str) -> int:
    """Parse a whole number, 0 or more."""
    if not re.match(r"^[0-9]+$", text):
        raise argparse.ArgumentTypeError("%r is not a whole number" % text)
    return int(text)
