"""The controller without sockets, threads and clock: it takes a request and returns the reply.

The argument of ``step`` is the time that passes.
"""
import dataclasses
import sys
import traceback
from typing import Any, List, Mapping, NamedTuple, Optional, Tuple, Union

from jaka_ros_driver.errors import FramingError, InvalidCommand
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.protocol.framing import JsonObject
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.command_spec import Held, Then
from jaka_ros_driver.simulation.controller.command_table import COMMANDS
from jaka_ros_driver.simulation.controller.firmware import Firmware
from jaka_ros_driver.simulation.controller.memory import Memory
from jaka_ros_driver.simulation.controller.replies import (
    BadParameter,
    CommandRefused,
    accepted,
    not_understood,
    refused,
)
from jaka_ros_driver.simulation.controller.state import ControllerState, Options, Start
from jaka_ros_driver.simulation.controller.status_frame import StatusFrame
from jaka_ros_driver.state import Vector


class RequestResult(NamedTuple):
    """The result of a request.

    Attributes:
        command: The command it named; None where it named none.
        reply: Bytes of the reply.
        held: Where not None, when the reply is due.
        reply_if_refused: Bytes of the reply instead, where the command fails before that.
        then: What follows the reply.
    """

    command: Optional[str]
    reply: bytes
    held: Optional[Held] = None
    reply_if_refused: bytes = b""
    then: Then = Then.NOTHING

    def is_due(self) -> bool:
        """Return whether the reply is to be sent now."""
        return self.held is None or self.held.until()

    def due_reply(self) -> bytes:
        """Return the reply as it is when it is due."""
        return self.reply_if_refused if self.held is not None and self.held.refused() else self.reply


class ReplyLine:
    """The replies of one connection that are not sent yet, in the order of its requests."""

    def __init__(self) -> None:
        self._waiting: List[RequestResult] = []

    @property
    def is_blocked(self) -> bool:
        """True while later requests of the client are not carried out."""
        return any(result.held is not None and result.held.blocks for result in self._waiting)

    def add(self, result: RequestResult) -> None:
        """Append the result of a request."""
        self._waiting.append(result)

    def take_due(self) -> List[RequestResult]:
        """Return those whose replies are to be sent now, in order, and forget them."""
        due: List[RequestResult] = []
        waiting: List[RequestResult] = []
        for result in self._waiting:
            must_wait = any(earlier.held is None or not earlier.held.is_overtaken for earlier in waiting)
            (due if result.is_due() and not must_wait else waiting).append(result)
        self._waiting = waiting
        return due


class Controller:
    """A simulated controller without its sockets.

    Attributes:
        state: The state that commands change.
        feed_frame: Builds the frames of the status feed.
        polled_frame: Builds the frames of the polled port.
        failures: Requests whose handling ended in a bug of the simulation.
    """

    def __init__(self, model: ArmModel, firmware: Firmware, options: Options, joint_position: Vector = HOME) -> None:
        self._firmware = firmware
        self._options = options
        self.failures = 0
        self.state = ControllerState(model, firmware, options, Memory(), joint_position)
        self._build_frames({}, ())

    def _build_frames(self, added: Mapping[str, Any], dropped: Tuple[str, ...]) -> None:
        self.feed_frame = StatusFrame(self.state)
        self.polled_frame = StatusFrame(self.state, polled=True)
        self.change_fields(added, dropped)

    def change_fields(self, added: Mapping[str, Any], dropped: Tuple[str, ...]) -> None:
        """Leave fields out of every frame and put others in, as a wire fault."""
        for frame in (self.feed_frame, self.polled_frame):
            frame.added, frame.dropped = dict(added), tuple(dropped)

    def restart(self) -> None:
        """Restart as after a power cut: no drive power, the arm where it stands, the stored settings."""
        old = self.state
        options = dataclasses.replace(self._options, start=Start.OFF)
        self.state = ControllerState(old.model, self._firmware, options, old.memory, old.plant.joint_position)
        self.state.force_sensor = old.force_sensor  # what it is loaded with does not depend on the cabinet
        if old.emergency_stop:
            self.state.press_emergency_stop()
        self._build_frames(self.feed_frame.added, self.feed_frame.dropped)

    def step(self, dt: float) -> None:
        """Let dt seconds of simulated time pass."""
        self.state.step(dt)

    def execute(self, request: Union[JsonObject, FramingError]) -> RequestResult:
        """Carry out one request. Every request gets a reply; one that is not understood changes nothing.

        An exception that a handler does not expect is answered with the controller's own "Exception:function call
        failed", and its traceback goes to stderr, so that other clients and the moving arm are still served.
        """
        name = request.get("cmdName") if isinstance(request, dict) else None
        spec = COMMANDS.get(name) if isinstance(name, str) else None
        dialect = self.state.dialect
        if spec is None or not dialect.knows(spec.name):
            return RequestResult(name if isinstance(name, str) else None, not_understood(dialect))
        try:
            fields = spec.handler(self.state, Arguments(request))  # type: ignore[arg-type]
            if isinstance(fields, Held):
                return RequestResult(spec.name, accepted(dialect, spec.name, {}), fields,
                                     refused(dialect, spec.name, CommandRefused()))
            return RequestResult(spec.name, accepted(dialect, spec.name, fields or {}), then=spec.then)
        except BadParameter:
            return RequestResult(spec.name, not_understood(dialect))
        except (CommandRefused, TargetRejected, InvalidCommand) as error:
            refusal = error if isinstance(error, CommandRefused) else CommandRefused()
            return RequestResult(spec.name, refused(dialect, spec.name, refusal))
        except Exception:
            self.failures += 1
            traceback.print_exc(file=sys.stderr)
            return RequestResult(spec.name, not_understood(dialect))
