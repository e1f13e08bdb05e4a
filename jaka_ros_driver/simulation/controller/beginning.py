"""The state that a simulated controller begins with: joints, frames, load, terminals, programs, as a file has them."""
import math
from typing import Any, Dict, Mapping, Sequence, Tuple

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.simulation.controller.commands_frames import MAX_COLLISION_LEVEL, MAX_MASS_KG
from jaka_ros_driver.simulation.controller.io_banks import BANK_NAMES
from jaka_ros_driver.simulation.controller.memory import FRAME_COUNT, Payload, StoredFrames
from jaka_ros_driver.simulation.controller.state import ControllerState
from jaka_ros_driver.state import Vector
from jaka_ros_driver.yaml_text import load_yaml, short

_KEYS = ("joints", "tool", "user_frame", "payload", "collision_level", "speed_override", "terminals", "programs")
_SIDES = {"digital_inputs": ("digital", False), "digital_outputs": ("digital", True),
          "analog_inputs": ("analog", False), "analog_outputs": ("analog", True)}


class Beginning:
    """The state that a controller begins with, in SI units; what is not told is as after a start.

    Keys: ``joints`` rad (6,); ``tool``, ``user_frame``: ``id`` 0 to 15 and ``offset`` (6,), m and rpy rad, in the
    flange and in the base; ``payload``: ``mass`` kg, ``centroid`` m (3,); ``collision_level`` 0 to 5;
    ``speed_override`` 0 to 1; ``terminals``: by bank (cabinet, tool, ...), by side (digital_inputs, ...), values by
    index from 0; ``programs``: names that are stored beside the usual ones, without suffix.

    Args:
        values: The keys told, with their values.

    Attributes:
        joint_position: Joints, rad (6,).

    Raises:
        InvalidCommand: A key is unknown, or a value is not one of its kind.
    """

    def __init__(self, values: Mapping[Any, Any]) -> None:
        _known(values, _KEYS, "the beginning")
        self.joint_position: Vector = _numbers(values.get("joints", HOME), 6, "joints")
        self._frames = {key: _frame(values[key], key) for key in ("tool", "user_frame") if key in values}
        self._payload = _payload(values["payload"]) if "payload" in values else None
        self._collision_level = None if "collision_level" not in values else int(_number(
            values["collision_level"], 0, MAX_COLLISION_LEVEL, "collision_level"))
        self._speed_override = None if "speed_override" not in values else _number(
            values["speed_override"], 0.0, 1.0, "speed_override")
        self._terminals = _terminals(values.get("terminals", {}))
        self._programs = _names(values.get("programs", ()), "programs")

    @classmethod
    def from_file(cls, path: str) -> "Beginning":
        """Read a YAML or JSON file.

        Raises:
            InvalidCommand: It cannot be read, a key is unknown, or a value is not one of its kind.
        """
        try:
            with open(path, encoding="utf-8") as file:
                values = load_yaml(file.read())
        except (OSError, UnicodeDecodeError, InvalidCommand) as error:
            raise InvalidCommand("beginning file %s: %s" % (path, error)) from error
        try:
            return cls(values)
        except InvalidCommand as error:
            raise InvalidCommand("beginning file %s: %s" % (path, error)) from error

    def apply(self, state: ControllerState) -> None:
        """Set everything in a controller that has just started with these joints.

        Raises:
            InvalidCommand: The joints are beyond its model's limits, or it has no such terminal.
        """
        for number, (value, (low, high)) in enumerate(zip(self.joint_position, state.model.joint_limits), 1):
            if not low <= value <= high:
                raise InvalidCommand("joints: joint %d is %g rad; it must be %g to %g" % (number, value, low, high))
        for key, table in (("tool", state.memory.tools), ("user_frame", state.memory.user_frames)):
            if key in self._frames:
                _store(table, *self._frames[key])
        state.apply_frames()
        state.memory.programs += self._programs
        if self._payload is not None:
            state.memory.payload = self._payload
        if self._collision_level is not None:
            state.memory.collision_level = self._collision_level
        if self._speed_override is not None:
            state.plant.set_rapid_rate(self._speed_override)
        for (bank, side, index), value in self._terminals.items():
            signal, is_output = _SIDES[side]
            state.io.set(signal, is_output, BANK_NAMES.index(bank), index, value)


def _store(table: StoredFrames, number: int, offset: Pose) -> None:
    if number:
        table.frames[number] = offset
    table.active = number


def _known(values: Any, names: Sequence[str], what: str) -> Mapping[Any, Any]:
    if not isinstance(values, Mapping):
        raise InvalidCommand("%s must hold keys and values" % what)
    for name in values:
        if name not in names:
            raise InvalidCommand("%s: %s is not known; these are: %s" % (what, short(name), ", ".join(names)))
    return values


def _number(value: Any, low: float, high: float, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise InvalidCommand("%s is %s; it must be %g to %g" % (what, short(value), low, high))
    return float(value)


def _numbers(values: Any, count: int, what: str) -> Vector:
    if not isinstance(values, (list, tuple)) or len(values) != count:
        raise InvalidCommand("%s is %s; it must be %d numbers" % (what, short(values), count))
    return tuple(_number(value, -1e4, 1e4, what) for value in values)


def _names(values: Any, what: str) -> Tuple[str, ...]:
    if not isinstance(values, (list, tuple)) or not all(isinstance(value, str) and value for value in values):
        raise InvalidCommand("%s is %s; it must be a list of names" % (what, short(values)))
    return tuple(values)


def _frame(value: Any, what: str) -> Tuple[int, Pose]:
    given = _known(value, ("id", "offset"), what)
    number = int(_number(given.get("id"), 0, FRAME_COUNT - 1, what + ".id"))
    offset = _numbers(given.get("offset", [0.0] * 6), 6, what + ".offset")
    if number == 0 and any(abs(part) > 1e-9 for part in offset):
        raise InvalidCommand("%s: id 0 is fixed, and has no offset" % what)
    if max([abs(angle) for angle in offset[3:]]) > 2.0 * math.pi:
        raise InvalidCommand("%s.offset is %s; its angles are rad" % (what, short(value)))
    return number, Pose(offset[:3], offset[3:])


def _payload(value: Any) -> Payload:
    given = _known(value, ("mass", "centroid"), "payload")
    return Payload(_number(given.get("mass"), 0.0, MAX_MASS_KG, "payload.mass"),
                   _numbers(given.get("centroid", [0.0] * 3), 3, "payload.centroid"))


def _terminals(value: Any) -> Dict[Tuple[str, str, int], float]:
    found: Dict[Tuple[str, str, int], float] = {}
    for bank, sides in _known(value, BANK_NAMES, "terminals").items():
        for side, levels in _known(sides, tuple(_SIDES), "terminals.%s" % bank).items():
            if not isinstance(levels, Mapping):
                raise InvalidCommand("terminals.%s.%s must hold values by index" % (bank, side))
            for index, level in levels.items():
                place = "terminals.%s.%s.%s" % (bank, side, index if isinstance(index, str) else short(index))
                try:
                    number = int(index)
                except (TypeError, ValueError, OverflowError):
                    raise InvalidCommand("%s: the index must be a whole number" % place) from None
                found[bank, side, number] = _number(int(level) if isinstance(level, bool) else level, -1e9, 1e9, place)
    return found
