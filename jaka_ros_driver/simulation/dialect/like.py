"""A report of jaka_probe as the controller that it was made of: firmware, model, dialect, how late its replies come,
and how hard it brakes.
"""
import json
from typing import Any, Dict, NamedTuple, Optional, Tuple

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.simulation.dialect.dimension import firmware_name
from jaka_ros_driver.simulation.dialect.table import Dialect

REPORT_FORMAT = 1
LONGEST_REPORT = 1 << 20
"""Most bytes of a probe.json that is read."""
LONGEST_REPLY_DELAY_S = 3.0
"""Longest delay of a reply, s: whoever asks has given up by then."""


class LikeController(NamedTuple):
    """The controller that a report describes.

    Attributes:
        firmware: One of ``dimension.FIRMWARE_NAMES``.
        model: Name of the arm's model; "" where the report has none.
        dialect: Its choices; the points that were not settled are the firmware's.
        stop_deceleration: Of joint 6 in a stopped move, deg/s2; None where it was not measured.
        reply_delays: How long a reply takes, s, in the median and in 99 of 100 cases; 0 where it was not measured.
    """

    firmware: str
    model: str
    dialect: Dialect
    stop_deceleration: Optional[float]
    reply_delays: Tuple[float, float] = (0.0, 0.0)


def like_controller(path: str, firmware: Optional[str] = None) -> LikeController:
    """Read a probe.json.

    Args:
        path: Its path.
        firmware: Instead of the one that the report is nearest to; None for that one.

    Raises:
        InvalidCommand: It cannot be read, is no such report, or does not tell the firmware.
    """
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read(LONGEST_REPORT + 1)
        content: Any = json.loads(text) if len(text) <= LONGEST_REPORT else None
    except (OSError, ValueError, RecursionError) as error:
        raise InvalidCommand("%s: %s" % (path, error)) from error
    if not isinstance(content, dict) or content.get("format") != REPORT_FORMAT or not all(
            isinstance(content.get(key), dict) for key in ("dialect", "facts")):
        raise InvalidCommand("%s is no probe.json of format %d" % (path, REPORT_FORMAT))
    told = firmware or content.get("firmware")
    if type(told) is not str or not told:
        raise InvalidCommand("%s does not tell the firmware; name it" % path)
    try:
        told = firmware_name(told)
        dialect = Dialect.default(told).replaced(content["dialect"])
    except InvalidCommand as error:
        raise InvalidCommand("%s: %s" % (path, error)) from error
    models = _value(content["facts"], "model")
    model = models[0] if isinstance(models, list) and models and isinstance(models[0], str) else ""
    rate = _value(content["facts"], "stop_deceleration")
    is_rate = type(rate) in (int, float) and 0.0 < rate < 1e300  # JSON has numbers that no float holds
    usual = _delay(content["facts"], "reply_time")
    return LikeController(told, model, dialect, float(rate) if is_rate else None,
                          (usual, max(usual, _delay(content["facts"], "reply_time_p99"))))


def _delay(facts: Dict[str, Any], name: str) -> float:
    value = _value(facts, name)
    return float(value) if type(value) in (int, float) and 0.0 <= value <= LONGEST_REPLY_DELAY_S else 0.0


def _value(facts: Dict[str, Any], name: str) -> Any:
    row = facts.get(name)
    return row.get("value") if isinstance(row, dict) else None
