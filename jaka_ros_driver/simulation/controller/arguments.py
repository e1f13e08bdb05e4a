"""The typed parameters of a request; wrong ones raise BadParameter (docs/controller-protocol.md section 4.3, code 1).

Keys that nobody asks for are ignored (docs/controller-protocol.md section 2).
"""
import math
from typing import Any, Optional

from jaka_ros_driver.protocol.framing import JsonObject
from jaka_ros_driver.simulation.controller.replies import BadParameter, CommandRefused
from jaka_ros_driver.state import Vector

MAX_TEXT = 256
"""Longest name stored, characters."""
MAX_NUMBER = 1e9
"""Largest absolute value accepted; no quantity of an arm is larger."""


class Arguments:
    """The parameters of one request, in wire units (mm, deg); one that is missing and has no default raises
    BadParameter.
    """

    def __init__(self, request: JsonObject) -> None:
        self._request = request

    def has(self, key: str) -> bool:
        return key in self._request

    def number(self, key: str, default: Optional[float] = None) -> float:
        """Return a finite number; raise BadParameter for anything else, Refused beyond ``MAX_NUMBER``."""
        if key not in self._request and default is not None:
            return default
        return _finite(key, self._request.get(key))

    def integer(self, key: str, default: Optional[int] = None) -> int:
        """Return a whole number, ``2.0`` and ``true`` among them; raise as ``number`` does."""
        value = self.number(key, None if default is None else float(default))
        if not value.is_integer():
            raise BadParameter("%s is not a whole number" % key)
        return int(value)

    def flag(self, key: str, default: Optional[bool] = None) -> bool:
        """Return 0, 1, false or true as a bool; raise BadParameter where it is missing without a default, or anything
        else.
        """
        value = self.integer(key, None if default is None else int(default))
        if value not in (0, 1):
            raise BadParameter("%s is neither 0 nor 1" % key)
        return bool(value)

    def text(self, key: str, default: Optional[str] = None) -> str:
        """Return a text of at most ``MAX_TEXT`` characters; raise BadParameter for anything else."""
        value = self._request.get(key, default)
        if not isinstance(value, str) or len(value) > MAX_TEXT:
            raise BadParameter("%s is not a text of at most %d characters" % (key, MAX_TEXT))
        return value

    def vector(self, key: str, count: int) -> Vector:
        """Return ``count`` numbers.

        Raises Refused for another length (docs/controller-protocol.md section 4.3, code 2).
        """
        values = self._request.get(key)
        if not isinstance(values, list):
            raise BadParameter("%s is not an array" % key)
        numbers = tuple(_finite(key, value) for value in values)
        if len(numbers) != count:
            raise CommandRefused()
        return numbers

    def first_of(self, *keys: str) -> str:
        """Return the first of these keys that the request has; ``keys[0]`` where it has none of them."""
        return next((key for key in keys if key in self._request), keys[0])

    def raw(self, key: str) -> Any:
        """Return the value as it came; raise BadParameter where it is missing."""
        if key not in self._request:
            raise BadParameter("%s is missing" % key)
        return self._request[key]


def _finite(key: str, value: Any) -> float:
    if not isinstance(value, (int, float)):
        raise BadParameter("%s is not a number" % key)
    try:
        number = float(value)
    except OverflowError:
        raise BadParameter("%s is too large" % key) from None
    if not math.isfinite(number):
        raise BadParameter("%s is not finite" % key)
    if abs(number) > MAX_NUMBER:
        raise CommandRefused()
    return number
