"""One row of the command table."""
import enum
from typing import Any, Callable, Dict, NamedTuple, Optional, Union

from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.controller_state import ControllerState
from jaka_ros_driver.simulation.controller.replies import Reply

SIMULATED_ONLY = "simulated controllers only"


class Held(NamedTuple):
    """The handler's result where the reply is to be held back until ``until()`` is true."""

    until: Callable[[], bool]


class Then(enum.Enum):
    """What follows the reply."""

    NOTHING = "nothing"
    CLOSE = "close the connection"
    SHUT_DOWN = "turn the cabinet off"


Handler = Callable[[ControllerState, Arguments], Union[None, Dict[str, Any], Held]]


class CommandSpec(NamedTuple):
    """One command of the command port.

    Attributes:
        name: ``cmdName``.
        section: Where it is described: a section of docs/controller-protocol.md, or "sdk-client.md" and a section of
            docs/sdk-client.md; ``SIMULATED_ONLY`` where no real controller knows it.
        handler: Carries it out and returns the fields of the reply; raises Refused, BadParameter or TargetRejected,
            which is answered as ``Refused()``.
        modern_only: True where firmware 1.5.14 does not know it.
        then: What follows the reply.
    """

    name: str
    section: str
    handler: Handler
    modern_only: bool = False
    then: Then = Then.NOTHING


def plain(action: Callable[[ControllerState], None]) -> Handler:
    """Make a handler of an action that takes no parameters and has no fields for the reply."""
    def handle(state: ControllerState, _arguments: Arguments) -> Optional[Reply]:
        action(state)
        return None
    return handle


def query(answer: Callable[[ControllerState], Reply]) -> Handler:
    """Make a handler of a function that takes no parameters and returns the fields of the reply."""
    def handle(state: ControllerState, _arguments: Arguments) -> Optional[Reply]:
        return answer(state)
    return handle
