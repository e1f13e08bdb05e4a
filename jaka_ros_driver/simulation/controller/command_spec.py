"""One row of the command table."""
import enum
from typing import Callable, List, NamedTuple, Optional, Union

from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.replies import Reply
from jaka_ros_driver.simulation.controller.state import ControllerState
from jaka_ros_driver.simulation.dialect.table import EARLY, HELD

_SAME_MOMENT_S = 1e-6
"""Rounding, s, of sums of cycles: far below a cycle (8 ms), far above what floats lose in a day."""
LINK_LOSS_COMMAND = "set_network_exception_handle"
"""The command that sets the reaction to the loss of the client that sends it (docs/sdk-client.md section 2)."""
SIMULATED_ONLY = "simulated controllers only"


class Held(NamedTuple):
    """The handler's result where the reply is to be held back until ``until()`` is true.

    Attributes:
        until: When the reply is due; asked in every cycle, as a reply that is late counts from what it saw first.
        blocks: True where later requests of the same client wait, too; else only their replies do.
        refused: True, asked when the reply is due, where the command has failed meanwhile.
        is_overtaken: True where replies to later requests of the same client do not wait for it.
    """

    until: Callable[[], bool]
    blocks: bool = False
    refused: Callable[[], bool] = lambda: False
    is_overtaken: bool = False


def slow_reply(state: ControllerState, kind: str, delay: float, is_done: Callable[[], bool],
               is_refused: Callable[[], bool] = lambda: False) -> Optional[Held]:
    """Return the reply to a command that takes time (docs/controller-protocol.md section 5.1); None for at once.

    kind: ``EARLY`` or ``HELD``. delay: How much later than that it comes, s of simulated time. is_refused: Asked when a
    held reply is due: True where the command has failed meanwhile.
    """
    if kind == EARLY and delay <= 0.0:
        return None
    due_at: List[float] = [state.now + delay] if kind == EARLY else []

    def until() -> bool:
        if not due_at and is_done():
            due_at.append(state.now + delay)
        return bool(due_at) and state.now >= due_at[0] - _SAME_MOMENT_S

    behind = state.dialect.behind_slow_reply
    return Held(until, behind == "blocks", is_refused if kind == HELD else lambda: False, behind == "overtakes")


class Then(enum.Enum):
    """The event that follows the reply."""

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
    """Return the handler of a function without parameters.

    The function returns the fields of the reply, or None for none.
    """
    def handle(state: ControllerState, _arguments: Arguments) -> Optional[Reply]:
        return act(state)
    return handle
