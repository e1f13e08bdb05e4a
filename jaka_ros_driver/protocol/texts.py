r"""The controller's words, made fit for logs, messages and terminals where they enter.

JSON can hold what none of those can: a lone surrogate (``\ud800``) cannot be written as UTF-8, a control character
rewrites a terminal, and a text of a megabyte buries everything else.
"""
from typing import Any

LONGEST_TEXT = 500
"""Characters; the longest text of the controller's event list has about 200."""
_LONGEST_VALUE = 200


def printable(text: str, longest: int = LONGEST_TEXT) -> str:
    """The text with blanks for white space of any kind, ``?`` for what cannot be printed, and so long at most."""
    if len(text) > longest:
        text = text[:longest - 3] + "..."
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else " " if c.isspace() else "?" for c in text)


def shown(value: Any, longest: int = _LONGEST_VALUE) -> str:
    """Any JSON value for a message, as Python writes it, and so long at most."""
    try:
        return printable(repr(value), longest)
    except (ValueError, RecursionError):  # an int of too many digits, lists in lists in lists
        return "a %s that cannot be written" % type(value).__name__


def text_of(value: Any) -> str:
    """What stands where a text is due; of another type, it is shown."""
    return printable(value) if isinstance(value, str) else shown(value)
