"""Durations and sizes as users write them on the command line.

Each function raises ``argparse.ArgumentTypeError`` where the text is no such thing.
"""
import argparse
import math
import re

_SECONDS = {"": 1.0, "ms": 1e-3, "s": 1.0, "m": 60.0, "h": 3600.0}
_BYTES = {"": 1, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30}
_NUMBER = re.compile(r"^\s*([0-9]*\.?[0-9]+(?:e[+-]?[0-9]+)?)\s*([a-z]*)\s*$", re.IGNORECASE)


def duration(text: str) -> float:
    """A duration in s from ``5``, ``500ms``, ``5s``, ``2m`` or ``1h``."""
    match = _NUMBER.match(text)
    if not match or match.group(2).lower() not in _SECONDS:
        raise argparse.ArgumentTypeError("%r is not a duration (5, 500ms, 5s, 2m, 1h)" % text)
    return float(match.group(1)) * _SECONDS[match.group(2).lower()]


def size(text: str) -> int:
    """A size in byte from ``1000``, ``64k``, ``64M`` or ``1G`` (powers of 1024)."""
    match = _NUMBER.match(text)
    unit = match.group(2).lower().rstrip("b") if match else ""
    if not match or unit not in _BYTES:
        raise argparse.ArgumentTypeError("%r is not a size (1000, 64k, 64M, 1G)" % text)
    return int(float(match.group(1)) * _BYTES[unit])


def megabytes(text: str) -> int:
    """A size in byte from a number of MB (1024 x 1024 byte), or with a unit as ``size`` takes it."""
    match = _NUMBER.match(text)
    return size(text + "M" if match and not match.group(2) else text)


def positive_number(text: str) -> float:
    """A number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not value > 0 or math.isinf(value):
        raise argparse.ArgumentTypeError("%r is not a number above 0" % text)
    return value


def count(text: str) -> int:
    """A whole number, 0 or more."""
    if not re.match(r"^[0-9]+$", text):
        raise argparse.ArgumentTypeError("%r is not a whole number" % text)
    return int(text)
