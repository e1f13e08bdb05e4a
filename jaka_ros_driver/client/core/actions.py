"""What the core asks of the shell around it: to connect, to send, to answer a call, to tell the guard."""
import enum
from typing import Any, List, NamedTuple, Optional, Union

from jaka_ros_driver.commands import JogStop
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.state import RobotState


class Port(enum.Enum):
    """The controller's two ports; the value is the name in messages."""

    COMMAND = "command port"
    STATUS = "status port"


class Open(NamedTuple):
    """Connect this port, and answer with ``opened`` or ``failed``."""

    port: Port


class Close(NamedTuple):
    """Drop the connection of this port, or the try to connect it; ``closed`` is not called for it."""

    port: Port
    reason: str


class Send(NamedTuple):
    """Put these bytes on the command port."""

    data: bytes


class Answer(NamedTuple):
    """The call that came with this token has ended: with a result, or with an error."""

    call: Any
    result: Any
    error: Optional[JakaError]


class Tell(NamedTuple):
    """The word for the guard, and for the disk: whether this driver moves the arm. It stands before the first byte.

    Attributes:
        is_moving: It does.
        name: What it moves, in words.
        jog_stop: The command that ends its jog; None where it is none.
    """

    is_moving: bool
    name: str = ""
    jog_stop: Optional[JogStop] = None


class Show(NamedTuple):
    """A state of the arm; ``is_new`` False where it tells of a time that has passed: not to be published."""

    state: RobotState
    is_new: bool


class Log(NamedTuple):
    """A line for the log, with a level of ``logging``."""

    level: int
    text: str


Action = Union[Open, Close, Send, Answer, Tell, Show, Log]


class Actions:
    """Collects actions, in order, until the shell takes them."""

    def __init__(self) -> None:
        self._actions: List[Action] = []

    def add(self, action: Action) -> None:
        """Put one at the end."""
        self._actions.append(action)

    def log(self, level: int, text: str) -> None:
        """Put a line for the log at the end."""
        self._actions.append(Log(level, text))

    def answer(self, call: Any, result: Any = None, error: Optional[JakaError] = None) -> None:
        """Put the end of a call at the end; None is a call that nobody waits for."""
        if call is not None:
            self._actions.append(Answer(call, result, error))

    def answer_all(self, calls: List[Any], error: Optional[JakaError] = None) -> None:
        """End several calls, and leave none in the list."""
        for call in calls:
            self.answer(call, None, error)
        calls.clear()

    def take(self) -> List[Action]:
        """All of them; none is left."""
        taken, self._actions = self._actions, []
        return taken
