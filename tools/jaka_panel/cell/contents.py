"""The contents of a cell's file: JSON text to data and back, with a check of every value.

Data are ``data[section][arm][name] = entry``. Units are m, rad, s, kg; rotations are rotation vectors. Nothing is
mended: what is not as it should be is an error that names the place.
"""
import json
import re
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from jaka_bag.json_text import depth_of

FORMAT, VERSION = "jaka-cell", 1
LARGEST = 256 * 1024
"""Most bytes of a cell's text."""
MOST_ENTRIES = 500
"""Most entries of a section: pages show them in one list, and all of a cell is 256 kB."""
MOST_STEPS = 200
"""Most steps of a motion list: as many as a plan takes (``plans.motion_list``)."""
_MOST_ARMS = 16
"""Most arms of a cell."""
_LONGEST_NAME = 60
"""Most characters of a name, which a page shows on a button."""
_LONGEST_TEXT = 200
"""Most characters of a note, which is one line."""
_LONGEST_NUMBER = 18
"""Most digits of a whole number: Python takes long for long ones, and 18 fit into 64 bits."""
_MOST_VALUES = 60
"""Most values of an object of a page's own making."""
_DEEPEST = 12
"""Most levels of a cell's JSON: its own sections have six, and Python's stack ends."""
_ARM = re.compile(r"(/[A-Za-z0-9_]+){1,8}\Z")
_TERMINAL = re.compile(r"[a-z_]{1,30}\.(di|do|ai|ao|r)\.[0-9]{1,4}\Z")
_KEY = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,59}\Z")
_FAR_M, _TURN_RAD, _JOINT_RAD, _HEAVY_KG, _LONG_S = 100.0, 100.0, 100.0, 1000.0, 3600.0
"""Largest numbers that are taken, beyond any arm or cell: they find other units, the driver has the limits."""
_FAST_M_S, _FAST_RAD_S = 10.0, 20.0
"""Largest speeds that are taken, for the same reason."""

Entries = Dict[str, Dict[str, Dict[str, Dict[str, Any]]]]
_Check = Callable[[Any, str], None]


class WrongCell(ValueError):
    """The error of data that cannot be a cell's; the text says where and why."""


class Change(NamedTuple):
    """One entry that is set, or removed where ``entry`` is None."""

    section: str
    arm: str
    name: str
    entry: Optional[Dict[str, Any]]


# ---- checks of values; each raises WrongCell with the place ----

def _number(low: float, high: float, unit: str) -> _Check:
    def check(value: Any, place: str) -> None:
        if type(value) not in (int, float) or not low <= value <= high:
            raise WrongCell("%s must be a number within %g to %g %s" % (place, low, high, unit))
    return check


def _whole(low: int, high: int) -> _Check:
    def check(value: Any, place: str) -> None:
        if type(value) is not int or not low <= value <= high:
            raise WrongCell("%s must be a whole number within %d to %d" % (place, low, high))
    return check


def _list(item: _Check, low: int, high: int) -> _Check:
    def check(value: Any, place: str) -> None:
        if not isinstance(value, list) or not low <= len(value) <= high:
            count = "%d" % low if low == high else "%d to %d" % (low, high)
            raise WrongCell("%s must be a list of %s" % (place, count))
        for number, one in enumerate(value, 1):
            item(one, "%s, %d" % (place, number))
    return check


def _object(needed: Mapping[str, _Check], free: Mapping[str, _Check]) -> _Check:
    def check(value: Any, place: str) -> None:
        if not isinstance(value, dict):
            raise WrongCell("%s must be an object" % place)
        for key in needed:
            if key not in value:
                raise WrongCell("%s has no %s" % (place, key))
        for key, one in value.items():
            known = needed.get(key) or free.get(key)
            if known is None:
                raise WrongCell("%s: %s is not known here" % (place, _short(key)))
            if one is not None or key in needed:
                known(one, "%s: %s" % (place, key))
    return check


def _text(value: Any, place: str) -> None:
    if not isinstance(value, str) or len(value) > _LONGEST_TEXT or not _is_printable(value):
        raise WrongCell("%s must be a text of one line, at most %d characters" % (place, _LONGEST_TEXT))


def _name(value: Any, place: str) -> None:
    if not isinstance(value, str) or not 1 <= len(value) <= _LONGEST_NAME or value != value.strip() or (
            value.startswith("__") or not _is_printable(value)):
        raise WrongCell("%s: %s is no name: 1 to %d printable characters, no space at the ends, no __ at the begin" % (
            place, _short(value), _LONGEST_NAME))


def _choice(*choices: str) -> _Check:
    def check(value: Any, place: str) -> None:
        if not isinstance(value, str) or value not in choices:
            raise WrongCell("%s must be one of %s" % (place, ", ".join(choices)))
    return check


def _value(value: Any, place: str) -> None:
    if type(value) is bool:
        return
    if isinstance(value, str):
        _text(value, place)
        return
    _number(-1e9, 1e9, "")(value, place)


def _is_printable(text: str) -> bool:
    return all(letter.isprintable() for letter in text)  # surrogates, which no file can hold, are not


def _short(value: Any) -> str:
    return ascii(value if len(str(value)) <= _LONGEST_NAME else str(value)[:_LONGEST_NAME] + "...")


_JOINTS = _list(_number(-_JOINT_RAD, _JOINT_RAD, "rad"), 6, 6)
_PLACE = _list(_number(-_FAR_M, _FAR_M, "m"), 3, 3)
_TURN = _list(_number(-_TURN_RAD, _TURN_RAD, "rad"), 3, 3)
_LENGTH = _number(0.0, _FAR_M, "m")
_SPEED_M_S, _SPEED_RAD_S = _number(1e-4, _FAST_M_S, "m/s"), _number(1e-4, _FAST_RAD_S, "rad/s")
_POSE = _object({"p": _PLACE, "r": _TURN}, {})
_TAKEN: Dict[str, _Check] = {"taken": _number(0.0, 1e11, "s since 1970"), "model": _text}
_FRAME_NUMBER = _whole(1, 11)
_BLEND = {"blend": _number(0.0, 1.0, "m")}
_STEPS: Dict[str, _Check] = {
    "joint": _object({"kind": _text, "point": _name, "speed": _SPEED_RAD_S}, _BLEND),
    "line": _object({"kind": _text, "point": _name, "speed": _SPEED_M_S}, _BLEND),
    "arc": _object({"kind": _text, "via": _name, "point": _name, "speed": _SPEED_M_S}, _BLEND),
    "wait": _object({"kind": _text, "s": _number(0.0, _LONG_S, "s")}, {}),
    "output": _object({"kind": _text, "signal": _choice("digital", "analog"), "index": _whole(0, 32767),
                       "bank": _choice("cabinet", "tool", "extension"), "value": _value}, {})}


def _step(value: Any, place: str) -> None:
    kind = value.get("kind") if isinstance(value, dict) else None
    _choice(*_STEPS)(kind, place + ": kind")
    _STEPS[str(kind)](value, place)


def _values(value: Any, place: str) -> None:
    if not isinstance(value, dict) or len(value) > _MOST_VALUES:
        raise WrongCell("%s must be an object of at most %d values" % (place, _MOST_VALUES))
    for key, one in value.items():
        if not _KEY.match(key):
            raise WrongCell("%s: %s is no key" % (place, _short(key)))
        _value(one, "%s: %s" % (place, key))


SECTIONS: Dict[str, _Check] = {
    "io": _object({"label": _text}, {}),
    "points": _object({"q": _JOINTS}, {
        "tool": _POSE, "flange": _POSE, "tool_number": _whole(0, 1000), "user_number": _whole(0, 1000), **_TAKEN}),
    "user_frames": _object({"p": _PLACE, "r": _TURN}, {
        "number": _FRAME_NUMBER, "residual": _LENGTH, "points": _list(_PLACE, 3, 20), **_TAKEN}),
    "tool_frames": _object({"p": _PLACE, "r": _TURN}, {
        "number": _FRAME_NUMBER, "residual": _LENGTH, "uncertainty": _LENGTH, "poses": _list(_POSE, 4, 20), **_TAKEN}),
    "payloads": _object({"mass": _number(0.0, _HEAVY_KG, "kg"), "centre": _PLACE}, {"tool": _FRAME_NUMBER}),
    "lists": _object({"steps": _list(_step, 1, MOST_STEPS)}, {}),
    "layout": _object({"values": _values}, {})}
"""The check of an entry, by section."""


def check_change(change: Any, number: int) -> Change:
    """Return one change as a page sends it: ``section``, ``arm``, ``name``, ``entry``; raise WrongCell."""
    if not isinstance(change, dict) or set(change) - {"section", "arm", "name", "entry"}:
        raise WrongCell("change %d must be an object of section, arm, name and entry" % number)
    section: Any = change.get("section")
    arm: Any = change.get("arm")
    name: Any = change.get("name")
    entry = change.get("entry")
    _choice(*SECTIONS)(section, "change %d: section" % number)
    _check_place(section, arm, name)
    if entry is not None:
        SECTIONS[section](entry, _place(section, arm, name))
    return Change(section, arm, name, entry)


def check_data(data: Any) -> Entries:
    """Return the data of a whole cell; raise WrongCell."""
    if not isinstance(data, dict):
        raise WrongCell("data must be an object")
    for section, arms in data.items():
        _choice(*SECTIONS)(section, "a section")
        if not isinstance(arms, dict) or len(arms) > _MOST_ARMS:
            raise WrongCell("%s must be an object of at most %d arms" % (section, _MOST_ARMS))
        for arm, entries in arms.items():
            if not isinstance(entries, dict) or len(entries) > MOST_ENTRIES:
                raise WrongCell("%s of %s must be an object of at most %d entries" % (
                    section, _short(arm), MOST_ENTRIES))
            for name, entry in entries.items():
                _check_place(section, arm, name)
                SECTIONS[section](entry, _place(section, arm, name))
    return data


def _check_place(section: str, arm: Any, name: Any) -> None:
    if section == "layout":
        if arm != "":
            raise WrongCell("layout: the arm must be empty: it is for all arms")
    elif not isinstance(arm, str) or len(arm) > _LONGEST_TEXT or not _ARM.match(arm):
        raise WrongCell("%s: %s is no name of a driver" % (section, _short(arm)))
    if section == "io":
        if not isinstance(name, str) or not _TERMINAL.match(name):
            raise WrongCell("io of %s: %s is no terminal, such as cabinet.di.3" % (arm, _short(name)))
    else:
        _name(name, "%s of %s" % (section, arm or "all arms"))


def _place(section: str, arm: str, name: str) -> str:
    return "%s, %s, %s" % (section, arm or "all arms", name)


def with_changes(data: Entries, changes: Sequence[Change]) -> Entries:
    """Return data with changes made; ``data`` itself stays as it is. Raise WrongCell where it becomes too much."""
    new = dict(data)
    for section, arm, name, entry in changes:
        arms = dict(new.get(section, {}))
        entries = dict(arms.get(arm, {}))
        if entry is None:
            entries.pop(name, None)
        else:
            entries[name] = entry
        if len(entries) > MOST_ENTRIES:
            raise WrongCell("%s of %s would have more than %d entries" % (section, arm or "all arms", MOST_ENTRIES))
        arms[arm] = entries
        if not entries:
            del arms[arm]
        if len(arms) > _MOST_ARMS:
            raise WrongCell("%s would be of more than %d arms" % (section, _MOST_ARMS))
        new[section] = arms
        if not arms:
            del new[section]
    return new


# ---- text ----

class CellData(NamedTuple):
    """The data of a cell as they stand in a file.

    Attributes:
        revision: Number of the change that made it; 0 before the first.
        saved: UTC of that change, ISO 8601.
        by: Name of the page that made it.
        data: The contents.
    """

    revision: int
    saved: str
    by: str
    data: Entries


EMPTY = CellData(0, "", "", {})


def text_of(cell: CellData) -> str:
    """Return a cell as JSON, one entry a line; raise WrongCell where it is longer than ``LARGEST`` bytes."""
    lines = ["{", ' "format": %s,' % _json(FORMAT), ' "version": %d,' % VERSION, ' "revision": %d,' % cell.revision,
             ' "saved": %s,' % _json(cell.saved), ' "by": %s,' % _json(cell.by), ' "data": {']
    lines += _joined(" ", [(section, ["{", *_joined("  ", [
        (arm, ["{", *_joined("   ", [(name, [_json(entry)]) for name, entry in entries.items()]), "   }"])
        for arm, entries in arms.items()]), "  }"]) for section, arms in cell.data.items()])
    text = "\n".join([*lines, " }", "}", ""])
    size = len(text.encode("utf-8"))
    if size > LARGEST:
        raise WrongCell("the data of the cell would be %d bytes; at most %d are kept" % (size, LARGEST))
    return text


def _joined(indent: str, members: List[Tuple[str, List[str]]]) -> List[str]:
    """Return the lines of an object's members, each given by its name and its value's lines."""
    lines: List[str] = []
    for number, (name, value) in enumerate(members):
        first = "%s %s: %s" % (indent, _json(name), value[0])
        comma = "," if number < len(members) - 1 else ""
        lines += [first, *value[1:-1], value[-1] + comma] if len(value) > 1 else [first + comma]
    return lines


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def cell_of(text: str) -> CellData:
    """Return the cell that a text holds; raise WrongCell."""
    if len(text.encode("utf-8", "replace")) > LARGEST:
        raise WrongCell("it is longer than %d bytes" % LARGEST)
    if depth_of(text) > _DEEPEST:
        raise WrongCell("it is no cell: nested too deep")
    try:
        whole = json.loads(text, parse_constant=_no_constant, parse_int=_integer, object_pairs_hook=_no_twin)
    except ValueError as error:
        if isinstance(error, WrongCell):
            raise
        raise WrongCell("it is no whole JSON: %s" % error) from None
    if not isinstance(whole, dict) or whole.get("format") != FORMAT:
        raise WrongCell("it is no file of a cell: its format is not %s" % FORMAT)
    if type(whole.get("version")) is not int or whole["version"] != VERSION:
        raise WrongCell("it is of version %s; this panel reads version %d" % (_short(whole.get("version")), VERSION))
    _object({"format": _text, "version": _whole(VERSION, VERSION), "revision": _whole(0, 10 ** 12), "saved": _text,
             "by": _text, "data": lambda value, place: None}, {})(whole, "the file")
    return CellData(whole["revision"], whole["saved"], whole["by"], check_data(whole["data"]))


def _no_constant(word: str) -> None:
    raise WrongCell("%s is no number" % word)


def _integer(digits: str) -> int:
    if len(digits) > _LONGEST_NUMBER:
        raise WrongCell("a number has %d digits" % len(digits))
    return int(digits)


def _no_twin(members: List[Tuple[str, Any]]) -> Dict[str, Any]:
    found: Dict[str, Any] = {}
    for name, value in members:
        if name in found:
            raise WrongCell("%s stands twice in one object" % _short(name))
        found[name] = value
    return found
