"""A simulated controller inside another process: the whole product, in a thread of its own.

::

    with SimulatedController(model="zu7", time_scale=20.0, start="enabled") as arm:
        connect(arm.command_port, arm.status_port)
        arm.operate("hit", force=150.0)
"""
import dataclasses
import math
import re
import threading
import uuid
from typing import Any, Dict, Optional, Tuple, Type

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model, load_model_file
from jaka_ros_driver.protocol.ports import PORTS
from jaka_ros_driver.simulation.arm.moves import braking_share
from jaka_ros_driver.simulation.controller.beginning import Beginning
from jaka_ros_driver.simulation.controller.executor import Controller
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import Options, Start
from jaka_ros_driver.simulation.dialect.like import LONGEST_REPLY_DELAY_S
from jaka_ros_driver.simulation.dialect.table import COEXISTS, REFUSED, REPLACES, Dialect
from jaka_ros_driver.simulation.server import operator_actions
from jaka_ros_driver.simulation.server.cycle_clock import MIN_FEED_PERIOD_S
from jaka_ros_driver.simulation.server.event_loop import OPERATOR, ControllerServer
from jaka_ros_driver.wire.log import WireLog
from jaka_ros_driver.wire.sockets import LOOPBACK

SINGLE_CLIENT = {"replace": REPLACES, "refuse": REFUSED, "coexist": COEXISTS}
"""Spellings of the dimension ``second_client`` on the command line."""
MAX_TIME_SCALE = 100.0
"""Highest factor of time: 25 cycles are computed then at each tick of 2 ms (``cycle_clock``)."""
_IDENTITY = re.compile(r"[!-~]{1,256}\Z")


class SimulatedController:
    """A simulated controller: it listens as soon as it is made, and serves inside ``with``, or from start to close.

    Attributes:
        server: Its sockets; ``server.controller`` is what it serves. While it runs, use both only through ``operate``
            or ``server.call``.
        dialect: Its choices on the points that are open.
        command_port: Number of its TCP port, as status_port and poll_port.
        operator_port: Number of the operator port; None where it has none.
    """

    def __init__(self, model: str = "zu7", dh_file: Optional[str] = None, *, time_scale: float = 1.0,
                 firmware: str = "1.5.14", start: str = "off", dialect: Optional[Dialect] = None,
                 power_delay: Optional[float] = None, enable_delay: Optional[float] = None,
                 starvation: Optional[str] = None, single_client: Optional[str] = None, seed: int = 0,
                 log: Optional[str] = None, host: str = LOOPBACK, command_port: int = 0, status_port: int = 0,
                 poll_port: int = 0, operator_port: Optional[int] = 0, identity: Optional[str] = None,
                 io_index_base: Optional[int] = None, force_sensor: bool = False,
                 beginning: Optional[Beginning] = None, stop_deceleration: Optional[float] = None,
                 reply_delays: Tuple[float, float] = (0.0, 0.0), panel_port: Optional[int] = 0) -> None:
        """Listen on the ports.

        Args:
            model: Arm model, a name of the models data.
            dh_file: A file with one model of the user's own, instead.
            time_scale: Simulated seconds a wall second.
            firmware: "1.5.14", "1.7.1" or "1.7.2"; "1.7" is the latter.
            start: "off", "powered" or "enabled".
            dialect: Choices on the points that are open; None for the firmware's default.
            power_delay: Instead of the dialect's: from power_on to energised drives, s of simulated time.
            enable_delay: Instead of the dialect's: from enable_robot to released brakes, s of simulated time.
            starvation: Instead of the dialect's: reaction of the arm to a servo stream without more points.
            single_client: Instead of the dialect's second_client: "replace", "refuse" or "coexist".
            seed: Of the random generator of the wire faults.
            log: File for the wire log; None for none.
            host: Address for the three ports.
            command_port: TCP port, 0 for a free one.
            status_port: As command_port.
            poll_port: As command_port.
            operator_port: As command_port, for the operator port, on loopback; None for none.
            identity: Answer to ``get_simulator_identity``; None for a unique text.
            io_index_base: Instead of the dialect's: index of the first terminal in commands, 0 or 1.
            force_sensor: True for a force and torque sensor at the flange.
            beginning: Joints, tool, user frame, load and terminals at the start; None for the usual ones.
            stop_deceleration: Of joint 6 in a stop, rad/s2, which scales those of all joints; None, and what is more
                than the model allows: as the model allows.
            reply_delays: How much later than at once a reply comes, s of simulated time; the second is that of one of
                fifty, so that 99 of 100 come within it.
            panel_port: The former name of operator_port, which it replaces where it is not 0.

        Raises:
            InvalidCommand: A value is not one of those above.
            WireLogError: The log cannot be written.
            OSError: A port cannot be bound.
        """
        arm = load_model_file(dh_file) if dh_file else load_model(model)
        if not 0.0 < time_scale <= MAX_TIME_SCALE:
            raise InvalidCommand("time scale is %r; it must be above 0 and at most %g" % (time_scale, MAX_TIME_SCALE))
        if identity is None:
            identity = uuid.uuid4().hex
        if not _IDENTITY.match(identity):
            raise InvalidCommand("identity is %r; it must be 1 to 256 characters of ASCII without blanks" % identity)
        second = single_client and _one_of("single client", single_client, SINGLE_CLIENT)
        instead = {"starvation": starvation, "io_index_base": io_index_base, "second_client": second}
        delays = {"power_delay": power_delay, "enable_delay": enable_delay}
        if any(delay is not None and not 0.0 <= delay < math.inf for delay in delays.values()):
            raise InvalidCommand("delays must be finite and not negative")
        if not all(0.0 <= delay <= LONGEST_REPLY_DELAY_S for delay in reply_delays):
            raise InvalidCommand("reply delays are %r; each must be 0 to %g s" % (reply_delays, LONGEST_REPLY_DELAY_S))
        self.dialect = dataclasses.replace(
            (dialect or Dialect.default(firmware)).replaced(_given(instead)), **_given(delays))
        options = Options(self.dialect, _one_of("start", start, {s.value: s for s in Start}),
                          MIN_FEED_PERIOD_S * time_scale, identity, force_sensor,
                          braking_share(arm, stop_deceleration))
        begun = beginning or Beginning({})
        controller = Controller(arm, _one_of("firmware", firmware, FIRMWARES), options, begun.joint_position)
        begun.apply(controller.state)
        self._log = WireLog(log) if log else None
        ports = {"command": command_port, "status": status_port, "poll": poll_port}
        number = operator_port if panel_port == 0 else panel_port
        if number is not None:
            ports[OPERATOR] = number
        self._thread: Optional[threading.Thread] = None
        try:
            self.server = ControllerServer(
                controller, host, ports, time_scale=time_scale, seed=seed, log=self._log, reply_delays=reply_delays,
                operator_handler=lambda request: operator_actions.handle(self.server, request))
        except OSError:
            self._close_log()
            raise
        numbers = self.server.port_numbers
        self.command_port, self.status_port, self.poll_port = (numbers[port] for port in PORTS)
        self.operator_port = numbers.get(OPERATOR)

    @property
    def panel_port(self) -> Optional[int]:
        """The former name of ``operator_port``."""
        return self.operator_port

    def operate(self, action: str, **parameters: Any) -> Dict[str, Any]:
        """Carry out one action of the operator port.

        Raises:
            InvalidCommand: It is refused.
            ConnectionLost: Nothing runs.
        """
        request = {"action": action, **parameters}
        answer: Dict[str, Any] = self.server.call(lambda: operator_actions.handle(self.server, request))
        if not answer["ok"]:
            raise InvalidCommand("operator port: %s" % answer["error"])
        return answer

    panel = operate
    """The former name of ``operate``."""

    def state(self) -> Dict[str, Any]:
        """Return the true state of the arm, in wire units; see the operator port's action ``state``."""
        shown: Dict[str, Any] = self.operate("state")["state"]
        return shown

    def run(self) -> None:
        """Serve in this thread until ``stop``; then close every socket and the log."""
        try:
            self.server.run()
        finally:
            self._close_log()

    def stop(self) -> None:
        """End ``run``; from any thread or signal handler."""
        self.server.stop()

    def start(self) -> None:
        """Serve in a thread."""
        self._thread = threading.Thread(target=self.server.run, name="simulated-controller", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving, close every socket and the log; a second call has no effect."""
        if self._thread is not None:
            self.stop()
            self._thread.join()
            self._thread = None
        else:
            self.server.close()
        self._close_log()

    def _close_log(self) -> None:
        log, self._log = self._log, None
        if log:
            log.close()

    def __enter__(self) -> "SimulatedController":
        self.start()
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], error: object, trace: object) -> None:
        self.close()


def _given(values: Dict[str, Any]) -> Dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}


def _one_of(what: str, value: str, known: Dict[str, Any]) -> Any:
    if value not in known:
        raise InvalidCommand("%s is %r; it must be one of %s" % (what, value, ", ".join(known)))
    return known[value]
