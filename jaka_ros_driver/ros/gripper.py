"""A gripper on outputs: its description, and the decisions on goals, their ends and its position, without ROS.

One of two states is on digital outputs, one with a width on an analog output or a register.

Positions are those of the gripper's joint or its width, in the unit of its URDF: m, or rad.
"""
import math
import re
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

from jaka_ros_driver.commands import SetAnalogOutput, SetDigitalOutput
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.limits import ANALOG_LIMIT, IO_INDICES, REGISTERS
from jaka_ros_driver.state import Bank, FieldBus, IoBank, IoState

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*\Z")
_INPUT_BANKS: Dict[str, Bank] = {"cabinet": IoBank.CABINET, "tool": IoBank.TOOL, "modbus_slave": FieldBus.MODBUS_SLAVE}
_OUTPUT_BANKS: Dict[str, Bank] = {**_INPUT_BANKS, "extension": IoBank.EXTENSION}
_LARGEST_POSITION = 10.0
"""Largest position of the gripper's joint, m or rad; a larger one is in another unit."""
_LONGEST_STROKE_S = 60.0
"""Longest time, s, of a stroke and of gripping that is believed."""
_LONGEST_TIMEOUT_S = 120.0
"""Longest timeout, s, of a goal: two of the longest strokes."""
_DEFAULT_MARGIN_S = 2.0
"""Time, s, beyond the stroke after which a goal is given up by default."""
_BEYOND = 0.1
"""A goal or a reading may lie so far outside its range, as a share of it: names in a SRDF are rounded."""
_SAME_VALUE = 0.02
"""Largest difference, V, mA or of a register, of an analog output from what it was set to."""
_TOLERANCE = 0.05
"""Default of ``position_tolerance``, as a share of the stroke."""
_Fault = Tuple[bool, str]
"""A fault between two keys: True where it is there, and its text."""
GoalWatch = Callable[[Optional[IoState], float], Optional["GripperEnd"]]
"""The judge of a goal: of the terminals in a frame since the outputs were set, None without one, and the time since, s,
it returns the end, None while the goal runs. It raises InvalidCommand where the controller does not report an input."""


@dataclass(frozen=True)
class _Described:
    """The part of a description that each gripper has.

    Attributes:
        joint: Name of its joint in ``joint_states``, before the prefix.
        open_position: Position when open, m or rad.
        closed_position: Position when closed on nothing, m or rad.
        stroke_time: Time of a stroke, s.
        timeout: Longest wait for the inputs, s.
        controller: Namespace of the action, ``controller/gripper_cmd``.
        output_bank: Where its outputs are.
        input_bank: Where its inputs are.
    """

    joint: str
    open_position: float
    closed_position: float
    stroke_time: float
    timeout: float
    controller: str
    output_bank: Bank
    input_bank: Bank

    def require_valid(self, position: float, max_effort: float) -> None:
        """Raise InvalidCommand unless the position is in the range, and the effort a number that is not negative."""
        low, high = sorted((self.open_position, self.closed_position))
        beyond = _BEYOND * (high - low)
        if not math.isfinite(position) or not low - beyond <= position <= high + beyond:
            raise InvalidCommand("position is %g; valid: %g to %g" % (position, low, high))
        if not math.isfinite(max_effort) or max_effort < 0.0:
            raise InvalidCommand("max_effort is %g; valid: 0 or more (it has no effect on an output)" % max_effort)

    def _read(self, io: IoState, is_digital: bool, index: int) -> float:
        """Return an input's value; raise InvalidCommand where the controller does not report it."""
        held = io.values(self.input_bank, is_digital, False) or ()
        if index >= len(held):
            raise InvalidCommand("the controller does not report %s %s input %d of the gripper" % (
                self.input_bank.name.lower(), "digital" if is_digital else "analog", index))
        return held[index]


@dataclass(frozen=True)
class TwoStateGripper(_Described):
    """The description of a gripper that is open or closed; an output or input that is None does not exist.

    Attributes:
        open_output: Index of the output that is 1 to open it and 0 to close it.
        close_output: Index of the output that is 1 to close it and 0 to open it.
        open_input: Index of the input that is 1 while it is open.
        closed_input: Index of the input that is 1 while it is closed on nothing.
        gripped_input: Index of the input that is 1 while it holds a work piece.
        gripped_position: Position while it holds a work piece, m or rad; None without ``gripped_input``.
        threshold: Position that separates goals that open from goals that close, m or rad.
    """

    open_output: Optional[int]
    close_output: Optional[int]
    open_input: Optional[int]
    closed_input: Optional[int]
    gripped_input: Optional[int]
    gripped_position: Optional[float]
    threshold: float

    @property
    def has_inputs(self) -> bool:
        """True where at least one input shows its state."""
        return (self.open_input, self.closed_input, self.gripped_input) != (None, None, None)

    def aim(self, position: float, max_effort: float) -> float:
        """Return the position, m or rad, of the state that a goal asks for; raise as ``require_valid``."""
        self.require_valid(position, max_effort)
        is_closing = (position > self.threshold) is (self.closed_position > self.threshold)
        return self.closed_position if is_closing and position != self.threshold else self.open_position

    def commands(self, aim: float) -> List[SetDigitalOutput]:
        """Return the outputs to set, in their order: of two valves, the one that must rest goes to 0 first."""
        is_closing = aim == self.closed_position
        wanted = [(self.open_output, not is_closing), (self.close_output, is_closing)]
        return [SetDigitalOutput(self.output_bank, index, value)
                for index, value in sorted(wanted, key=lambda one: one[1]) if index is not None]

    def outputs_hold(self, io: IoState, aim: float) -> bool:
        """Return whether the outputs in the status feed are as commanded; an output that it lacks counts as such."""
        held = io.values(self.output_bank, True, True) or ()
        return all(bool(held[command.index]) is command.value for command in self.commands(aim)
                   if command.index < len(held))

    def read_inputs(self, io: IoState) -> "Inputs":
        """Return what the inputs show; raise InvalidCommand where the controller does not report one."""
        return Inputs(*[None if index is None else bool(self._read(io, True, index))
                        for index in (self.open_input, self.closed_input, self.gripped_input)])

    def position(self, io: IoState, assumed: Optional[float]) -> Optional[float]:
        """Return the position as ``position_of`` does; raise as ``read_inputs``."""
        return position_of(self, self.read_inputs(io), assumed)

    def watch(self, aim: float) -> GoalWatch:
        """Return the judge of a goal to that position."""
        return lambda io, elapsed: end_of_goal(
            self, aim == self.closed_position, None if io is None else self.read_inputs(io), elapsed)


@dataclass(frozen=True)
class WidthGripper(_Described):
    """The description of a gripper that goes to each position between open and closed, by an analog value.

    Attributes:
        analog_output: Index of the output.
        open_value: Its value for ``open_position``, V, mA or of a register; between the two ends it is linear.
        closed_value: Its value for ``closed_position``.
        analog_input: Index of the input that shows the position; None where there is none.
        open_reading: Its value at ``open_position``; between the two ends it is linear.
        closed_reading: Its value at ``closed_position``.
        position_tolerance: A position is reached where the input shows it so nearly, m or rad; without it 0.
        gripped_time: A closing gripper that stands still for so long on its way holds a work piece, s; None: never.
    """

    analog_output: int
    open_value: float
    closed_value: float
    analog_input: Optional[int]
    open_reading: float
    closed_reading: float
    position_tolerance: float
    gripped_time: Optional[float]

    def aim(self, position: float, max_effort: float) -> float:
        """Return the position, m or rad, that a goal asks for, led into the range; raise as ``require_valid``."""
        self.require_valid(position, max_effort)
        low, high = sorted((self.open_position, self.closed_position))
        return min(max(position, low), high)

    def commands(self, aim: float) -> List[SetAnalogOutput]:
        """Return the output to set."""
        share = (aim - self.open_position) / (self.closed_position - self.open_position)
        value = self.open_value + share * (self.closed_value - self.open_value)
        return [SetAnalogOutput(self.output_bank, self.analog_output,
                                float(round(value)) if isinstance(self.output_bank, FieldBus) else value)]

    def outputs_hold(self, io: IoState, aim: float) -> bool:
        """Return whether the output in the status feed is as commanded; one that it lacks counts as such."""
        held = io.values(self.output_bank, False, True) or ()
        return all(abs(held[command.index] - command.value) <= _SAME_VALUE for command in self.commands(aim)
                   if command.index < len(held))

    def position(self, io: IoState, assumed: Optional[float]) -> Optional[float]:
        """Return the position, m or rad: by the input where there is one, else the assumed one.

        None where it is not known: a reading far outside its range is none of a gripper, as of a wire that is off.

        Raises:
            InvalidCommand: The controller does not report the input.
        """
        if self.analog_input is None:
            return assumed
        reading = self._read(io, False, self.analog_input)
        share = (reading - self.open_reading) / (self.closed_reading - self.open_reading)
        if not -_BEYOND <= share <= 1.0 + _BEYOND:
            return None
        return self.open_position + share * (self.closed_position - self.open_position)

    def watch(self, aim: float) -> GoalWatch:
        """Return the judge of a goal to that position."""
        return _WidthWatch(self, aim).end


Gripper = Union[TwoStateGripper, WidthGripper]


class Inputs(NamedTuple):
    """The values of the inputs; None for one that the gripper does not have."""

    is_open: Optional[bool] = None
    is_closed: Optional[bool] = None
    is_gripped: Optional[bool] = None


class GripperEnd(NamedTuple):
    """The end of a goal.

    Attributes:
        is_success: Whether the gripper did what the goal asks: it arrived, or it holds a work piece.
        position: m or rad; None where it is not known.
        is_stalled: Whether it stopped on its way.
        reached_goal: Whether it is at the end of its stroke.
        text: What was seen.
    """

    is_success: bool
    position: Optional[float]
    is_stalled: bool
    reached_goal: bool
    text: str


class _WidthWatch:
    """The judge of one goal of a gripper with a width, by the positions that its input shows."""

    def __init__(self, gripper: WidthGripper, aim: float) -> None:
        self._gripper = gripper
        self._aim = aim
        self._began_at: Optional[float] = None
        self._still_at = math.inf
        self._still_since = 0.0

    def end(self, io: Optional[IoState], elapsed: float) -> Optional[GripperEnd]:
        """Return the end of the goal; see ``GoalWatch``."""
        gripper = self._gripper
        if gripper.analog_input is None:
            return None if elapsed < gripper.stroke_time else GripperEnd(
                True, self._aim, False, True, "at %g by the time of a stroke, %g s; no input shows it" % (
                    self._aim, elapsed))
        position = None if io is None else gripper.position(io, None)
        if position is not None:
            if self._began_at is None:
                self._began_at = position
            if abs(position - self._still_at) > gripper.position_tolerance:
                self._still_at, self._still_since = position, elapsed
            if abs(position - self._aim) <= gripper.position_tolerance:
                return GripperEnd(True, position, False, True, "the input shows %g" % position)
            if self._holds_a_part(position, elapsed - self._still_since):
                return GripperEnd(True, position, True, False,
                                  "it stands still at %g: it holds a work piece" % position)
        if elapsed < gripper.timeout:
            return None
        if position is None:
            return GripperEnd(False, None, False, False, "no input shows a position within %g s" % gripper.timeout)
        is_stalled = self._began_at is not None and abs(position - self._began_at) > gripper.position_tolerance
        return GripperEnd(False, position, is_stalled, False, "not at %g within %g s: the input shows %g" % (
            self._aim, gripper.timeout, position))

    def _holds_a_part(self, position: float, still: float) -> bool:
        """Return whether it stands, s long, on its way to close, and not where it is open: there it did not begin."""
        gripper = self._gripper
        is_closing = (self._aim - position) * (gripper.closed_position - gripper.open_position) > 0.0
        return (gripper.gripped_time is not None and still >= gripper.gripped_time and is_closing
                and abs(position - gripper.open_position) > gripper.position_tolerance)


def position_of(gripper: TwoStateGripper, inputs: Inputs, assumed: Optional[float]) -> Optional[float]:
    """Return the position, m or rad, by what the inputs show; None where it is not known.

    Args:
        gripper: The gripper.
        inputs: What its inputs show.
        assumed: The position by the end of the last goal, m or rad, None where that is not known. An input that would
            show it and is 0 contradicts it.
    """
    if inputs.is_open and (inputs.is_closed or inputs.is_gripped):
        return None
    if inputs.is_open:
        return gripper.open_position
    if inputs.is_closed:
        return gripper.closed_position
    if inputs.is_gripped:
        return gripper.gripped_position
    if assumed == gripper.open_position:
        return None if inputs.is_open is not None else assumed
    if assumed == gripper.closed_position:
        return None if inputs.is_closed is not None else assumed
    return None


def end_of_goal(gripper: TwoStateGripper, is_closing: bool, inputs: Optional[Inputs],
                elapsed: float) -> Optional[GripperEnd]:
    """Return the end of a goal; None while it runs.

    Args:
        gripper: The gripper.
        is_closing: Whether the goal closes it.
        inputs: What its inputs show since the outputs were set; None where no fresh frame shows them.
        elapsed: Time since the outputs were set, s.
    """
    target = gripper.closed_position if is_closing else gripper.open_position
    word = "closed" if is_closing else "open"
    if not gripper.has_inputs:
        return None if elapsed < gripper.stroke_time else GripperEnd(
            True, target, False, True, "%s by the time of a stroke, %g s; no input shows it" % (word, elapsed))
    if inputs is not None:
        arrived, other_end = (inputs.is_closed, inputs.is_open) if is_closing else (inputs.is_open, inputs.is_closed)
        elsewhere = other_end or (inputs.is_gripped and not is_closing)
        if not elsewhere:
            if arrived:
                return GripperEnd(True, target, False, True, "%s_input is 1" % word)
            if is_closing and inputs.is_gripped:
                return GripperEnd(True, gripper.gripped_position, True, False,
                                  "gripped_input is 1: it holds a work piece")
            if arrived is None and elapsed >= gripper.stroke_time:
                return GripperEnd(True, target, False, True, "%s by the time of a stroke, %g s: no input shows that "
                                                             "it is elsewhere" % (word, elapsed))
    if elapsed < gripper.timeout:
        return None
    if inputs is None:
        return GripperEnd(False, None, False, False, "the controller shows no inputs within %g s" % gripper.timeout)
    return GripperEnd(False, None, bool(other_end is False and not elsewhere), False, "not %s within %g s: %s" % (
        word, gripper.timeout, ", ".join("%s is %d" % (name, shown) for name, shown in zip(
            ("open_input", "closed_input", "gripped_input"), inputs) if shown is not None)))


# ---- the parameter ~gripper ----

def gripper_from(value: Any) -> Optional[Gripper]:
    """Return the gripper that the parameter describes; None for an empty one.

    Raises:
        ValueError: It names every key that is unknown, missing or wrong, with its value and what is valid.
    """
    if not isinstance(value, dict):
        raise ValueError("it must have keys")
    if not value:
        return None
    reader = _Reader(value)
    ends = [reader.number(name, -_LARGEST_POSITION, _LARGEST_POSITION) for name in ("open_position", "closed_position")]
    stroke_time = reader.number("stroke_time", 0.01, _LONGEST_STROKE_S)
    common = {
        "joint": reader.name("joint", None), "open_position": ends[0], "closed_position": ends[1],
        "stroke_time": stroke_time,
        "timeout": reader.number("timeout", stroke_time, _LONGEST_TIMEOUT_S, stroke_time + _DEFAULT_MARGIN_S),
        "controller": reader.name("controller", "jaka_gripper_controller"),
        "output_bank": reader.one_of("output_bank", _OUTPUT_BANKS),
        "input_bank": reader.one_of("input_bank", _INPUT_BANKS)}
    gripper, faults = (_width if "analog_output" in value else _two_states)(reader, common)
    wrong = reader.wrong_ones() or [text for is_wrong, text in (
        _both("open_position and closed_position", *ends), *faults) if is_wrong]
    if wrong:
        raise ValueError("; ".join(wrong))
    return gripper


def _both(names: str, one: float, other: float) -> _Fault:
    return one == other, "%s are both %g; they must differ" % (names, one)


def _two_states(reader: "_Reader", common: Dict[str, Any]) -> Tuple[Gripper, Sequence[_Fault]]:
    low, high = sorted((common["open_position"], common["closed_position"]))
    middle = 0.5 * (low + high)
    gripped = reader.number("gripped_position", low, high, middle) if reader.has("gripped_position") else None
    places: Dict[str, Any] = {name: reader.index(name) for name in (
        "open_output", "close_output", "open_input", "closed_input", "gripped_input")}
    gripper = TwoStateGripper(**common, **places, gripped_position=gripped,
                              threshold=reader.number("threshold", low, high, middle))
    used = [one for one in (gripper.open_input, gripper.closed_input, gripper.gripped_input) if one is not None]
    return gripper, (
        ((gripper.open_output, gripper.close_output) == (None, None),
         "close_output is missing; valid: one of open_output, close_output, analog_output"),
        (not low < gripper.threshold < high, "threshold is %g; valid: between %g and %g" % (
            gripper.threshold, low, high)),
        (gripper.open_output is not None and gripper.open_output == gripper.close_output,
         "open_output and close_output are both %s; they must differ" % gripper.open_output),
        (len(used) != len(set(used)), "two inputs have the same index"),
        ((gripper.gripped_input is None) != (gripped is None), "gripped_input and gripped_position need each other"))


def _width(reader: "_Reader", common: Dict[str, Any]) -> Tuple[Gripper, Sequence[_Fault]]:
    stroke = abs(common["open_position"] - common["closed_position"])

    def ends_of(word: str, bank: Bank, defaults: Sequence[Optional[float]]) -> Dict[str, Any]:
        low, high = REGISTERS if isinstance(bank, FieldBus) else (-ANALOG_LIMIT, ANALOG_LIMIT)
        return {end + word: reader.number(end + word, low, high, default)
                for end, default in zip(("open", "closed"), defaults)}

    index = reader.index("analog_input")
    values = ends_of("_value", common["output_bank"], (None, None))
    readings: Dict[str, Any] = {"open_reading": 0.0, "closed_reading": 1.0}
    tolerance, gripped = 0.0, None
    if index is not None:
        readings = ends_of("_reading", common["input_bank"], tuple(values.values()))
        tolerance = reader.number("position_tolerance", 1e-3 * stroke, stroke, _TOLERANCE * stroke)
        if reader.has("gripped_time"):
            gripped = reader.number("gripped_time", 0.1, _LONGEST_STROKE_S, 1.0)
    return WidthGripper(
        **common, **values, **readings, analog_output=reader.index("analog_output") or 0, analog_input=index,
        position_tolerance=tolerance, gripped_time=gripped), [
            _both(" and ".join(ends), *ends.values()) for ends in (values, readings)]


class _Reader:
    """The reader of the keys; it collects what is wrong and returns something valid in its place."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._left: Dict[Any, Any] = dict(values)
        self._wrong: List[str] = []

    def take(self, name: str, default: Any, is_valid: Callable[[Any], bool], valid: str,
             instead: Any = None) -> Any:
        """Return a key's value; ``default`` None makes it necessary."""
        if name not in self._left:
            if default is None:
                self._wrong.append("%s is missing; valid: %s" % (name, valid))
            return instead if default is None else default
        value = self._left.pop(name)
        if is_valid(value):
            return value
        self._wrong.append("%s is %r; valid: %s" % (name, value, valid))
        return instead if default is None else default

    def number(self, name: str, low: float, high: float, default: Optional[float] = None) -> float:
        """Return a number within the range."""
        return float(self.take(name, default, lambda number: type(number) in (int, float) and low <= number <= high,
                               "a number, %g to %g" % (low, high), low))

    def has(self, name: str) -> bool:
        """Return whether the key is there and not yet taken."""
        return name in self._left

    def one_of(self, name: str, banks: Mapping[str, Bank]) -> Bank:
        """Return a bank by its name; the tool where the key is left out."""
        taken: str = self.take(name, "tool", lambda text: isinstance(text, str) and text in banks,
                               ", ".join(sorted(banks)))
        return banks[taken]

    def index(self, name: str) -> Optional[int]:
        """Return the index of a terminal; None where there is none."""
        if name not in self._left:
            return None
        taken: int = self.take(name, None, lambda index: type(index) is int and 0 <= index <= IO_INDICES[1],
                               "a whole number, 0 to %d" % IO_INDICES[1], 0)
        return taken

    def name(self, name: str, default: Optional[str]) -> str:
        """Return a ROS name."""
        taken: str = self.take(name, default, lambda text: isinstance(text, str) and bool(_NAME.match(text)),
                               "a ROS name", "")
        return taken

    def wrong_ones(self) -> List[str]:
        """Return what is wrong, with the keys that nobody took."""
        return self._wrong + ["%s has no use beside the other keys" % name if name in KEYS else
                              "unknown key %s; known: %s" % (name, ", ".join(KEYS)) for name in self._left]


KEYS: Tuple[str, ...] = (
    "controller", "joint", "output_bank", "open_output", "close_output", "input_bank", "open_input", "closed_input",
    "gripped_input", "open_position", "closed_position", "gripped_position", "threshold", "stroke_time", "timeout",
    "analog_output", "open_value", "closed_value", "analog_input", "open_reading", "closed_reading",
    "position_tolerance", "gripped_time")
"""The keys of the parameter ``~gripper``."""
