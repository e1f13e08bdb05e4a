"""ROS messages as values of JSON, bounded in depth, length and time.

So no content of a client's message holds up its call.
"""
import math
from typing import Any

_MOST_ITEMS = 32
"""Most entries, and bytes, of a value that are written: the audit log holds requests, not data."""
_LONGEST_TEXT = 500
"""Most characters of a text that are written; the line says how many there were."""
_DEEPEST = 8
"""Most entries of a list, characters of a text, and levels: no call makes a line of the log as long as it likes."""


def plain(value: Any, depth: int = 0) -> Any:
    """Return a value of JSON for a message, a time, a number, a text or an array.

    Of an array the first 32 entries are kept, and their number; of a text the first 500 characters. A number that JSON
    cannot represent is written as text.
    """
    if value is None or isinstance(value, (bool, int)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if isinstance(value, str):
        return value if len(value) <= _LONGEST_TEXT else "%s... (%d characters)" % (value[:_LONGEST_TEXT], len(value))
    if isinstance(value, (bytes, bytearray)):
        return "%s%s (%d bytes)" % (bytes(value[:_MOST_ITEMS]).hex(), "..." * (len(value) > _MOST_ITEMS), len(value))
    if depth >= _DEEPEST:
        return "..."
    if hasattr(value, "to_nsec"):
        return value.to_nsec() / 1e9
    if hasattr(value, "__slots__"):
        return {name: plain(getattr(value, name, None), depth + 1) for name in value.__slots__}
    if isinstance(value, dict):
        return {str(name)[:_LONGEST_TEXT]: plain(entry, depth + 1) for name, entry in list(value.items())[:200]}
    try:
        count = len(value)
        entries = [plain(entry, depth + 1) for entry in value[:_MOST_ITEMS]]
    except (TypeError, KeyError):
        return str(value)[:_LONGEST_TEXT]
    return entries if count <= _MOST_ITEMS else [*entries, "... (%d entries)" % count]
