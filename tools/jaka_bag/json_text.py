"""JSON of files and strangers, whose nesting is bounded before a parser recurses into it.

A plain parser recurses until Python stops it. Python 3.8 may abort the process there: a finaliser that runs at the edge
of the stack uses up the error, the parser goes on, and 50 calls further the interpreter gives up
(https://bugs.python.org/issue42500, mended in 3.9.2).
"""
import json
import re
from itertools import accumulate
from typing import Any, Union

DEEPEST = 500
"""Most levels of a text."""
_STRING = re.compile(r'"[^"\\]*(?:\\.[^"\\]*)*"?', re.DOTALL)
_BRACKET = re.compile(r"[][{}]")
_STEPS = {"[": 1, "{": 1, "]": -1, "}": -1}


def load_json(text: Union[str, bytes], **options: Any) -> Any:
    """Return what ``json.loads`` makes of a text, with its options.

    Raises:
        ValueError: It is no JSON, or has more than ``DEEPEST`` levels.
    """
    if not isinstance(text, str):
        text = text.decode(json.detect_encoding(text), "surrogatepass")
    if text.count("[") + text.count("{") > DEEPEST and depth_of(text) > DEEPEST:
        raise ValueError("deeper than %d levels" % DEEPEST)
    return json.loads(text, **options)


def depth_of(text: str) -> int:
    """Return how many levels a JSON text has, without recursing into it."""
    brackets = _BRACKET.findall(_STRING.sub("", text))
    return max(accumulate(map(_STEPS.__getitem__, brackets)), default=0)
