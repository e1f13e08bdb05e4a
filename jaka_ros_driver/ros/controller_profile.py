"""A report of jaka_probe as the driver's knowledge of its controller: what it settles, and what stays assumed."""
import json
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple

REPORT_FORMAT = 1
LONGEST_REPORT = 1 << 20
"""Most bytes of a probe.json that is read."""
_LINK_LOSS_COMMAND = "set_network_exception_handle"


class ControllerProfile(NamedTuple):
    """The facts of a report that the driver uses or shows; None for what was not settled.

    Attributes:
        path: Of the report.
        version: Of the controller that was probed.
        io_index_base: Index, in commands, of the first input and output.
        stop_ends_jog: True where ``stop_program`` ends a jog.
        jog_stop_ends: "any" or "its axis": whose jog the stop of a jog ends.
        feed_period: Period of the feed before a client has set one, s.
        start_delay: Time from the acceptance of a move to its beginning, s.
        missing_commands: Commands that the controller does not know, of those that were sent.
        link_loss_stops: True where it stops a move whose client is lost, having been asked to.
    """

    path: str
    version: Optional[str] = None
    io_index_base: Optional[int] = None
    stop_ends_jog: Optional[bool] = None
    jog_stop_ends: Optional[str] = None
    feed_period: Optional[float] = None
    start_delay: Optional[float] = None
    missing_commands: Optional[Tuple[str, ...]] = None
    link_loss_stops: Optional[bool] = None


class _Field(NamedTuple):
    """One fact: its name in the report, its check, and the values that it may have, in words."""

    fact: str
    is_valid: Callable[[Any], bool]
    valid: str


_FIELDS: Dict[str, _Field] = {
    "version": _Field("version", lambda value: type(value) is str and len(value) < 200, "a text"),
    "io_index_base": _Field("io_index_base", lambda value: type(value) is int and value in (0, 1), "0 or 1"),
    "stop_ends_jog": _Field("stop_ends_jog", lambda value: type(value) is bool, "true or false"),
    "jog_stop_ends": _Field("jog_stop_ends", lambda value: value in ("any", "its axis"), "any or its axis"),
    "feed_period": _Field("feed_period", lambda value: type(value) in (int, float) and 0.0005 <= value <= 60.0,
                          "0.0005 to 60 s"),
    "start_delay": _Field("start_delay", lambda value: type(value) in (int, float) and 0.0 <= value <= 30.0,
                          "0 to 30 s"),
    "missing_commands": _Field("commands_missing", lambda value: type(value) is list and all(
        type(name) is str for name in value), "a list of names"),
    "link_loss_stops": _Field("link_loss_stops", lambda value: type(value) is bool, "true or false"),
}


def profile_from(value: Any) -> Optional[ControllerProfile]:
    """Return the profile in a probe.json whose path this is; None for "".

    Raises:
        ValueError: It cannot be read, is no such report, or a fact in it is not valid; the text names them all.
    """
    if type(value) is not str:
        raise ValueError("it must be a path")
    if not value:
        return None
    try:
        with open(value, encoding="utf-8") as file:
            text = file.read(LONGEST_REPORT + 1)
        content: Any = json.loads(text) if len(text) <= LONGEST_REPORT else None
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(str(error)) from error
    facts = content.get("facts") if isinstance(content, dict) and content.get("format") == REPORT_FORMAT else None
    if not isinstance(facts, dict):
        raise ValueError("it is no probe.json of format %d" % REPORT_FORMAT)
    found: Dict[str, Any] = {}
    wrong: List[str] = []
    for name, field in _FIELDS.items():
        row = facts.get(field.fact, {"value": None})
        settled = row.get("value") if isinstance(row, dict) else row
        if settled is None:
            continue
        if not field.is_valid(settled):
            wrong.append("fact %s is %.100r; valid: %s" % (field.fact, settled, field.valid))
        found[name] = tuple(settled) if isinstance(settled, list) else settled
    if wrong:
        raise ValueError("; ".join(wrong))
    return ControllerProfile(value, **found)


def knowledge(profile: Optional[ControllerProfile], io_index_base: int, is_base_set: bool, link_loss_stop: float,
              told_period: Optional[float]) -> List[Tuple[str, str]]:
    """Return what the driver relies on of this controller, and whether that is known: points with words.

    Args:
        profile: None for none.
        io_index_base: The one in force.
        is_base_set: A parameter has set it.
        link_loss_stop: As the parameter, s.
        told_period: Period of the feed that the controller confirms, s; None where it does not.
    """
    seen = profile or ControllerProfile("")
    base = ("set" if is_base_set else "seen on this controller" if seen.io_index_base is not None
            else "assumed, by its version")
    jog = {None: "assumed: stop_program or its own stop ends it; both are sent",
           True: "seen on this controller: stop_program ends it; its own stop is sent, too",
           False: "seen on this controller: stop_program does not end it; its own stop is sent, too",
           }[seen.stop_ends_jog]
    if seen.jog_stop_ends is not None:
        jog += "; the stop of an axis ends the jog of %s" % seen.jog_stop_ends
    lost = "not asked for" if not link_loss_stop else (
        "seen on this controller: it does not know the command" if _LINK_LOSS_COMMAND in (seen.missing_commands or ())
        else "seen on this controller: it does not stop the arm" if seen.link_loss_stops is False
        else "%s: the controller stops the arm %g s after it has noticed the loss" % (
            "seen on this controller, of a closed connection" if seen.link_loss_stops else "assumed", link_loss_stop))
    period = "assumed: it follows what was asked for" if told_period is None else "known: told by the controller"
    if seen.feed_period is not None:
        period += "; %g ms before a client has set one, seen on this controller" % (1000.0 * seen.feed_period)
    begin = ("assumed: within 1 s of its acceptance" if seen.start_delay is None else
             "%g s after its acceptance, seen on this controller; one that is 1 s later is stopped" % seen.start_delay)
    return [("first terminal", "%d, %s" % (io_index_base, base)), ("stop of a jog", jog), ("begin of a motion", begin),
            ("loss of the link", lost), ("period of the feed", period)]
