"""A gripper on digital outputs: its description, and the decisions on goals, their ends and its position, without ROS.

Positions are those of the gripper's joint or its width, in the unit of its URDF: m, or rad.
"""
import math
import re
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Tuple

from jaka_ros_driver.commands import SetDigitalOutput
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.limits import IO_INDICES
from jaka_ros_driver.state import IoBank, IoState

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*\Z")
_BANKS = {"cabinet": IoBank.CABINET, "tool": IoBank.TOOL}
_LARGEST_POSITION = 10.0
_LONGEST_STROKE_S = 60.0
_LONGEST_TIMEOUT_S = 120.0
_DEFAULT_MARGIN_S = 2.0
_BEYOND = 0.1
"""A goal may lie so far outside the range of positions, as a share of the stroke: names in a SRDF are rounded."""


@dataclass(frozen=True)
class Gripper:
    """The description of a gripper that is open or closed; an output or input that is None does not exist.

    Attributes:
        joint: Name of its joint in ``joint_states``, before the prefix.
        open_position: Position when open, m or rad.
        closed_position: Position when closed on nothing, m or rad.
        stroke_time: Time of a stroke, s.
        controller: Namespace of the action, ``controller/gripper_cmd``.
        output_bank: Where its outputs are.
        open_output: Index of the output that is 1 to open it and 0 to close it.
        close_output: Index of the output that is 1 to close it and 0 to open it.
        input_bank: Where its inputs are.
        open_input: Index of the input that is 1 while it is open.
        closed_input: Index of the input that is 1 while it is closed on nothing.
        gripped_input: Index of the input that is 1 while it holds a work piece.
        gripped_position: Position while it holds a work piece, m or rad; None without ``gripped_input``.
        threshold: Position that separates goals that open from goals that close, m or rad.
        timeout: Longest wait for the inputs, s.
    """

    joint: str
    open_position: float
    closed_position: float
    stroke_time: float
    controller: str
    output_bank: IoBank
    open_output: Optional[int]
    close_output: Optional[int]
    input_bank: IoBank
    open_input: Optional[int]
    closed_input: Optional[int]
    gripped_input: Optional[int]
    gripped_position: Optional[float]
    threshold: float
    timeout: float

    @property
    def has_inputs(self) -> bool:
        """True where at least one input shows its state."""
        return (self.open_input, self.closed_input, self.gripped_input) != (None, None, None)

    def closes(self, position: float, max_effort: float) -> bool:
        """Return whether a goal closes the gripper, False where it opens it.

        Raises:
            InvalidCommand: The position is no number or outside the range, or the effort is no number or negative.
        """
        low, high = sorted((self.open_position, self.closed_position))
        beyond = _BEYOND * (high - low)
        if not math.isfinite(position) or not low - beyond <= position <= high + beyond:
            raise InvalidCommand("position is %g; valid: %g to %g" % (position, low, high))
        if not math.isfinite(max_effort) or max_effort < 0.0:
            raise InvalidCommand("max_effort is %g; valid: 0 or more (it has no effect on an output)" % max_effort)
        return (position > self.threshold) is (self.closed_position > self.threshold) and position != self.threshold

    def commands(self, is_closing: bool) -> List[SetDigitalOutput]:
        """Return the outputs to set, in their order: of two valves, the one that must rest goes to 0 first."""
        wanted = [(self.open_output, not is_closing), (self.close_output, is_closing)]
        return [SetDigitalOutput(self.output_bank, index, value)
                for index, value in sorted(wanted, key=lambda one: one[1]) if index is not None]

    def outputs_hold(self, io: IoState, is_closing: bool) -> bool:
        """Return whether the outputs in the status feed are as commanded; an output that it lacks counts as such."""
        held = io.digital_outputs.get(self.output_bank, ())
        return all(bool(held[command.index]) is command.value for command in self.commands(is_closing)
                   if command.index < len(held))


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


def read_inputs(gripper: Gripper, io: IoState) -> Inputs:
    """Return what the inputs show in a status frame; raise InvalidCommand where the controller does not report one."""
    held = io.digital_inputs.get(gripper.input_bank, ())

    def read(index: Optional[int]) -> Optional[bool]:
        if index is None:
            return None
        if index >= len(held):
            raise InvalidCommand("the controller does not report %s digital input %d of the gripper"
                                 % (gripper.input_bank.name.lower(), index))
        return bool(held[index])
    return Inputs(read(gripper.open_input), read(gripper.closed_input), read(gripper.gripped_input))


def position_of(gripper: Gripper, inputs: Inputs, assumed: Optional[float]) -> Optional[float]:
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


def end_of_goal(gripper: Gripper, is_closing: bool, inputs: Optional[Inputs], elapsed: float) -> Optional[GripperEnd]:
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
    outputs, inputs = _bank(reader, "output_bank"), _bank(reader, "input_bank")
    open_output, close_output = reader.index("open_output"), reader.index("close_output")
    places = [reader.index(name) for name in ("open_input", "closed_input", "gripped_input")]
    ends = [reader.number(name, -_LARGEST_POSITION, _LARGEST_POSITION) for name in ("open_position", "closed_position")]
    low, high = min(ends), max(ends)
    middle = 0.5 * (low + high)
    gripped = reader.number("gripped_position", low, high, middle) if "gripped_position" in value else None
    stroke_time = reader.number("stroke_time", 0.01, _LONGEST_STROKE_S)
    gripper = Gripper(
        reader.name("joint", None), ends[0], ends[1], stroke_time, reader.name("controller", "jaka_gripper_controller"),
        outputs, open_output, close_output, inputs, places[0], places[1], places[2], gripped,
        reader.number("threshold", low, high, middle),
        reader.number("timeout", stroke_time, _LONGEST_TIMEOUT_S, stroke_time + _DEFAULT_MARGIN_S))
    wrong = reader.wrong_ones()
    used = [place for place in places if place is not None]
    if not wrong:
        for is_wrong, text in (
                (low == high, "open_position and closed_position are both %g; they must differ" % low),
                (not low < gripper.threshold < high, "threshold is %g; valid: between %g and %g" % (
                    gripper.threshold, low, high)),
                (open_output is None and close_output is None, "open_output or close_output is missing"),
                (open_output is not None and open_output == close_output,
                 "open_output and close_output are both %s; they must differ" % open_output),
                (len(used) != len(set(used)), "two inputs have the same index"),
                ((gripper.gripped_input is None) != (gripped is None),
                 "gripped_input and gripped_position need each other")):
            if is_wrong:
                wrong.append(text)
    if wrong:
        raise ValueError("; ".join(wrong))
    return gripper


def _bank(reader: "_Reader", name: str) -> IoBank:
    return _BANKS[reader.take(name, "tool", lambda text: isinstance(text, str) and text in _BANKS,
                              " or ".join(sorted(_BANKS)))]


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
        return self._wrong + ["unknown key %s; known: %s" % (name, ", ".join(KEYS)) for name in self._left]


KEYS: Tuple[str, ...] = (
    "controller", "joint", "output_bank", "open_output", "close_output", "input_bank", "open_input", "closed_input",
    "gripped_input", "open_position", "closed_position", "gripped_position", "threshold", "stroke_time", "timeout")
"""The keys of the parameter ``~gripper``."""
