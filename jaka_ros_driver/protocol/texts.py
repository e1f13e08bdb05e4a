r"""Sanitiser of the controller's texts for logs, messages and terminals.

A JSON text can contain a lone surrogate (``\ud800``), which cannot be written as UTF-8; control characters, which
change a terminal; and megabytes.
"""
from typing import Any

LONGEST_TEXT = 500
"""Largest number of characters of a text; the longest one of the controller's event list has about 200."""
_LONGEST_VALUE = 200
"""Most characters of a foreign value in a message: enough to recognise it, and a log stays readable."""


def printable(text: str, longest: int = LONGEST_TEXT) -> str:
    """Return the text, cut to ``longest`` characters, with blanks for white space and ``?`` for the unprintable."""
    if len(text) > longest:
        text = text[:longest - 3] + "..."
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else " " if c.isspace() else "?" for c in text)


def shown(value: Any, longest: int = _LONGEST_VALUE) -> str:
    """Return a JSON value for a message: its Python notation, made printable and cut to ``longest`` characters."""
    try:
        return printable(repr(value), longest)
    except (ValueError, RecursionError):  # an int with too many digits, or lists nested too deeply
        return "a %s that cannot be written" % type(value).__name__


def text_of(value: Any) -> str:
    """Return the value of a field that should be a text, made printable; of another type, its Python notation."""
    return printable(value) if isinstance(value, str) else shown(value)
