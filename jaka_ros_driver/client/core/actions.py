"""The actions that the core returns to the shell around it: connect, send, answer a call, notify the guard."""
import enum
from typing import List, NamedTuple, Optional, Union

from jaka_ros_driver.commands import JogStop
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.state import RobotState

Token = Optional[object]
"""A call's identity: the core compares it and hands it back, and knows no more of it; None where nobody waits."""


class Port(enum.Enum):
    """The controller's two ports; the value is the name in messages."""

    COMMAND = "command port"
    STATUS = "status port"


class Open(NamedTuple):
    """The request to connect this port, to be answered with ``opened`` or ``failed``."""

    port: Port


class Close(NamedTuple):
    """The request to close the connection of this port, or to give up connecting; ``closed`` is not called for it."""

    port: Port
    reason: str


class Send(NamedTuple):
    """The request to send these bytes on the command port."""

    data: bytes


class Answer(NamedTuple):
    """The end of a call: a result, or an error.

    Attributes:
        call: The token with which it came, which is whatever the shell has chosen.
        result: Its result; None where there is an error.
        error: Why it failed; None where it did not.
    """

    call: Token
    result: object
    error: Optional[JakaError]


class NotifyGuard(NamedTuple):
    """The notification, for the guard and for the disk, whether this driver moves the arm; it precedes the first byte.

    Attributes:
        is_moving: True where it does.
        name: The motion, in words.
        jog_stop: The command that ends its jog; None where it is none.
    """

    is_moving: bool
    name: str = ""
    jog_stop: Optional[JogStop] = None


class PublishState(NamedTuple):
    """The request to publish a state; ``is_new`` is False where it shows a time that has passed: not to be published as
    new.
    """

    state: RobotState
    is_new: bool


class Log(NamedTuple):
    """The request to log a line, with a level of ``logging``."""

    level: int
    text: str


CoreAction = Union[Open, Close, Send, Answer, NotifyGuard, PublishState, Log]


class Actions:
    """The list of actions, in order, until the shell takes them."""

    def __init__(self) -> None:
        self._actions: List[CoreAction] = []

    def add(self, action: CoreAction) -> None:
        """Append an action."""
        self._actions.append(action)

    def log(self, level: int, text: str) -> None:
        """Append a line for the log."""
        self._actions.append(Log(level, text))

    def answer(self, call: Token, result: object = None, error: Optional[JakaError] = None) -> None:
        """Append the end of a call; None is a call that nobody waits for."""
        if call is not None:
            self._actions.append(Answer(call, result, error))

    def answer_all(self, calls: List[Token], error: Optional[JakaError] = None) -> None:
        """End several calls, and leave none in the list."""
        for call in calls:
            self.answer(call, None, error)
        calls.clear()

    def take(self) -> List[CoreAction]:
        """Return all actions, and leave none."""
        taken, self._actions = self._actions, []
        return taken
