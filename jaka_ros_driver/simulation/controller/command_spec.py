"""One row of the command table."""
import enum
from typing import Callable, NamedTuple, Optional, Union

from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.controller_state import ControllerState
from jaka_ros_driver.simulation.controller.replies import Reply

SIMULATED_ONLY = "simulated controllers only"


class Held(NamedTuple):
    """The handler's result where the reply is to be held back until ``until()`` is true.

    Attributes:
        until: When the reply is due.
        blocks: True where later requests of the same client wait, too; else only their replies do.
        refused: True, asked when the reply is due, where the command has failed meanwhile.
    """

    until: Callable[[], bool]
    blocks: bool = False
    refused: Callable[[], bool] = lambda: False


class Then(enum.Enum):
    """What follows the reply."""

    NOTHING = "nothing"
    CLOSE = "close the connection"
    SHUT_DOWN = "turn the cabinet off"


Handler = Callable[[ControllerState, Arguments], Union[None, Reply, Held]]


class CommandSpec(NamedTuple):
    """One command of the command port.

    Attributes:
        name: ``cmdName``.
        section: Where it is described: a section of docs/controller-protocol.md, or "sdk-client.md" and a section of
            docs/sdk-client.md; ``SIMULATED_ONLY`` where no real controller knows it.
        handler: Carries it out and returns the fields of the reply; raises Refused or BadParameter, or
            TargetRejected or InvalidCommand, which are answered as ``Refused()``.
        then: What follows the reply.
    """

    name: str
    section: str
    handler: Handler
    then: Then = Then.NOTHING


def plain(act: Callable[[ControllerState], Optional[Reply]]) -> Handler:
    """Make a handler of a function that takes no parameters; it returns the fields of the reply, None for none."""
    def handle(state: ControllerState, _arguments: Arguments) -> Optional[Reply]:
        return act(state)
    return handle
