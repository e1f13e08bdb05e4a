"""Rules about what the driver puts on the command port: by whose wish, within which limits, and when.

Judged by the requests themselves and the calls that were made; not by the core's own account.
"""
import json
import math
from collections import deque
from typing import Any, Callable, Deque, Dict, List, Optional, Sequence, Tuple

from controller_room import STREAMED, ControllerRoom, is_motion
from driver_process import Call
from jog_rules import JogRules
from path_rules import sent_for_path
from point_rules import PointRules
from slacks import NEARER, NEARER_STILL
from trajectory_rules import TrajectoryRules
from verdict import RuleBroken

from jaka_ros_driver import commands as c
from jaka_ros_driver.clearance.guard import DEFAULT_MARGIN, MotionGuard
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.kinematics import limits
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.rotations import matrix_from_rpy, rotation_angle_between
from jaka_ros_driver.units import all_deg_to_rad, all_mm_to_m, deg_to_rad, mm_to_m

SERVO_CYCLE = 0.008
SERVO_SPEED_CEILING = math.pi
SPEED_SLACK = 1.001
"""Factor over a joint's largest step in one cycle, for rounding: from rad to degrees and back."""
FIRST_FRAME_NEAR = 0.05
"""Distance of a stream's first frame from the true arm, rad, at most.

It is 0.04 rad, by which the driver lets an arm differ from its stream (streaming.MAX_JOINT_DEVIATION), and 0.01 rad for
what the arm goes on to do behind the frame that it is based on."""
SERVO_LATENESS = 0.05
"""Time over ``servo_ahead`` until a stream rests on its last target, s: two turns of the driver's timer (0.02 s each)
and one cycle (0.008 s)."""
BURST_WINDOW = 0.04
"""Time, s, in which a stream has 5 cycles, a late frame at its begin, and one at each end."""
BURST_FRAMES = 8
"""Besides as many as are sent ahead: a reserve is filled, or filled again, at once."""
_CALLS_OF_POWER = tuple([(name, on) for name in ("power", "enable") for on in (True, False)] + [
    ("clear_error", None), ("recover", None)])
"""The calls that end ``auto_enable`` for good."""
_STEPS_OF_RECOVERY = ("clear_error", "power_on", "enable_robot")
_SAME = 1e-6
_WIRE_ROUNDING = 2e-6
_JOG_FRAMES = {0: c.JogFrame.BASE, 1: c.JogFrame.JOINT, 2: c.JogFrame.TOOL}
_DECODER = json.JSONDecoder()


def is_whole_stop(requests: Sequence[Dict[str, Any]]) -> bool:
    """Return whether these requests, sent at once, end a jog, servo mode, moves and programs."""
    halts = {(request["cmdName"], request.get("jog_mode", request.get("relFlag"))) for request in requests}
    return {("jog", 0), ("servo_move", 0), ("stop_program", None)} <= halts


def requests_in(data: bytes) -> List[Dict[str, Any]]:
    """Return the requests of one Send; each is whole."""
    text, position, found = data.decode("ascii"), 0, []
    while position < len(text):
        request, position = _DECODER.raw_decode(text, position)
        found.append(request)
    return found


class SentRules:
    """The judge of each request on its way to the controller.

    Attributes:
        last_motion: Number of the call that the newest motion was sent for.
        last_stop: Number of the newest stop call; nothing asked for before it is sent any more.
        is_closed: The driver is shutting down.
        knows_controller: Another request than that for the controller's identity has gone out on this connection.
        is_confirmed: On this connection the controller has reported the identity that was meant.
        open_calls: Unanswered calls by their numbers.
        stops_seen: The number of stops sent.
        jog: Rules about velocity jogs.
        asking: The call that the core is getting; None where it gets none.
    """

    def __init__(self, room: ControllerRoom, model: ArmModel, settings: ClientSettings, lateness: float,
                 identity: str) -> None:
        self._room, self._model, self._settings, self._lateness = room, model, settings, lateness
        self._motion_guard = MotionGuard(model, settings.workspace)
        self._is_foreign = bool(settings.simulator) and settings.simulator != identity
        self.knows_controller = False
        self.is_confirmed = not settings.simulator
        self._frames_at: Deque[float] = deque()
        self._steps: Dict[str, int] = {}
        self.last_motion = 0
        self.last_stop = 0
        self.is_closed = False
        self.open_calls: Dict[int, Call] = {}
        self.stops_seen = 0
        self._orders = 0
        self._alarm = 0
        self._power_wish = {"power_on": -1, "enable_robot": -1}
        self._recovery = -1
        self._auto: Optional[int] = None
        self._auto_acts = False
        self._servo_call = 0
        self._frame: Optional[Tuple[float, ...]] = None
        self._began: Tuple[float, ...] = ()
        self._kind = ""
        self._target: Any = None
        self._is_target_known = True
        self._began_at_distance = 0.0
        self._servo_mode_of: Tuple[Optional[Call], float] = (None, 0.0)
        self._target_at = 0.0
        self._judged_from = 0.0
        self.trajectory = TrajectoryRules()
        self.jog = JogRules(lateness)
        self.points = PointRules()
        self.asking: Optional[Call] = None

    # ---- what happens ----

    def called(self, call: Call) -> None:
        """Note a call that the core gets."""
        self._orders += 1
        if call.kind == "auto_enable":
            self._auto = self._orders
            return
        self.open_calls[call.number] = call
        if call.kind == "stop" or call.command in _CALLS_OF_POWER:
            self._auto = None  # whether the arm was seen before or not
        if call.kind == "point":
            self.points.came(call.command.position, call.given_at)
        if call.kind == "stop":
            self.last_stop = call.number
            self._recovery = -1  # a stop ends it
            self.points.disturbed()
        elif call.command == ("power", True):
            self._power_wish["power_on"] = self._orders
        elif call.command == ("enable", True):
            self._power_wish["enable_robot"] = self._orders
        elif call.command == ("recover", None):
            self._recovery = self._orders
            self._steps = {}

    def alarmed(self, is_fault: bool, is_standing: bool = False) -> None:
        """Note that the driver learns of a fault, a restart or a lost link.

        A fault that was shown before, ``is_standing``, is the one that a running recovery is there for.

        A link that is lost before auto_enable has begun to act does not count: it waits for the first sight of the arm.
        """
        goes_on = is_standing and self._recovery > self._alarm
        self.points.disturbed()
        self._orders += 1
        self._alarm = self._orders
        if goes_on:
            self._orders += 1
            self._recovery = self._orders
        if self._auto is not None and not self._auto_acts and not is_fault:
            self._auto = self._orders + 1

    def answered(self, call: Call, now: float) -> None:
        """Note the answer of a call."""
        self.open_calls.pop(call.number, None)
        asked, asked_at = self._servo_mode_of
        if call.kind == "point" and call.error is None and not call.was_sent and asked is not None and asked_at == now:
            asked.was_sent, call.was_sent = False, True  # the mode was this stream's, and not that of a call that waits
            self.last_motion = self._servo_call = call.number
            self.points.begin(True, now)
        if call.kind == "servo_target" and call.error is None:
            self._target_at = now
            self._target = self._next_target(call.command)
            self._is_target_known = self._target is not None

    def resumed(self, now: float) -> None:
        """Note that the process runs again after a pause, in which no frame could be sent."""
        self._judged_from = now

    # ---- what is sent ----

    def sends(self, data: bytes, is_told_moving: bool, now: float) -> List[Dict[str, Any]]:
        """Judge the bytes of one Send; return its requests."""
        requests = requests_in(data)
        if any(request["cmdName"] == "stop_program" for request in requests) and not is_whole_stop(requests):
            raise RuleBroken("whole", now, "a stop goes out that is only %s" % ", ".join(
                [request["cmdName"] for request in requests]))
        for request in requests:
            name = request["cmdName"]
            if name == "get_simulator_identity":
                continue
            self.knows_controller = True
            if not self.is_confirmed:
                raise RuleBroken("n", now, "%s is sent before the controller has reported its identity" % name)
            if name in _STEPS_OF_RECOVERY:
                self._recovers(name, now)
            if self._is_foreign:
                raise RuleBroken("n", now, "%s is sent to a controller that reports another identity" % name)
            if name == "stop_program":
                self.stops_seen += 1
            elif name in self._power_wish:
                self._energises(name, now)
            elif is_motion(request):
                if not is_told_moving:
                    raise RuleBroken("h", now, "%s is sent before the guard is notified" % name)
                self._motion(name, request, now)
        return requests

    def _recovers(self, name: str, now: float) -> None:
        """Judge a step of a recovery, where only that can be the reason for it."""
        wishes = [call.command for call in self.open_calls.values() if call.kind == "run"]
        others = [wish for wish in wishes if wish[0] in ("power", "enable", "clear_error")]
        if ("recover", None) not in wishes or others or (self._auto or 0) > self._alarm:
            self._steps = {}
            return
        self._steps[name] = self._steps.get(name, 0) + 1
        if self._steps[name] > 1:
            raise RuleBroken("recovery", now, "%s is sent twice in one recovery" % name)

    def _energises(self, name: str, now: float) -> None:
        if max(self._power_wish[name], self._recovery) > self._alarm:
            return
        if self._auto is not None and self._auto > self._alarm:
            self._auto_acts = True
            return
        raise RuleBroken("d", now, "%s is sent, and nobody asked for it since the last fault or lost link" % name)

    def _motion(self, name: str, request: Dict[str, Any], now: float) -> None:
        if self.is_closed:
            raise RuleBroken("b", now, "%s is sent after the driver began to shut down" % name)
        if name not in STREAMED:
            self.jog.begin(name == "servo_move" and self.asking is not None and self.asking.kind == "jog_message")
        if name == "play_program":
            self._wished(name, now, lambda call: call.kind == "program" and call.command == "play")
            return
        if name == "joint_move":
            self._within(self._model.joint_limits, name, all_deg_to_rad(request["jointPosition"]), now)
        path = sent_for_path(name, request, list(self.open_calls.values()), self.last_stop, now)
        if path is not None:
            self.last_motion = path.number
        elif self.jog.is_running and name == "servo_move":
            self.jog.may_begin(now)
            self._enters_servo_mode(self.asking)
        elif name == "joint_move":
            target = all_deg_to_rad(request["jointPosition"])
            self._wished(name, now, lambda call: isinstance(call.command, c.JointMove)
                         and _near(call.command.joint_position, target, _SAME))
        elif name == "movc":
            raise RuleBroken("b", now, "an arc is sent that no path asks for")
        elif name == "moveL":
            position = all_mm_to_m(request["cartPosition"][:3])
            self._wished(name, now, lambda call: isinstance(call.command, c.LinearMove)
                         and _near(call.command.target.position, position, _SAME))
        elif name == "jog":
            self._wished(name, now, lambda call: isinstance(call.command, c.Jog) and _is_jog(call.command, request))
        elif name == "servo_move":
            asked = self._wished(name, now, lambda call: call.kind in ("trajectory", "point") or (
                call.kind == "servo_mode" and call.command is True))
            self._servo_mode_of = asked, now
            self._enters_servo_mode(None)
            self.points.begin(asked.kind == "point", now)
        else:
            self._servo_frame(name, request, now)

    def _enters_servo_mode(self, jog_message: Optional[Call]) -> None:
        self.points.is_running = False
        if jog_message is not None:
            self.last_motion = jog_message.number
        self._servo_call = self.last_motion
        self._frame = self._target = None
        self.trajectory.begin()
        self._kind, self._is_target_known = "", True
        self._began_at_distance = self._distance_now()

    def _wished(self, name: str, now: float, asks: Callable[[Call], bool]) -> Call:
        """Return the unanswered call that asks for this motion, after the last stop; nothing is sent twice."""
        for call in self.open_calls.values():
            if not call.was_sent and asks(call):
                if (call if call.asked is None else call.asked).number < self.last_stop:
                    raise RuleBroken("b", now, "%s was asked for before the stop, and is sent after it" % call)
                call.was_sent = True
                self.last_motion = call.number
                return call
        raise RuleBroken("b", now, "%s is sent, and no call that is not answered yet asks for it" % name)

    def _within(self, ranges: limits.JointRanges, name: str, joints: Sequence[float], now: float) -> None:
        for index, (value, (low, high)) in enumerate(zip(joints, ranges)):
            if not low - _WIRE_ROUNDING <= value <= high + _WIRE_ROUNDING:
                raise RuleBroken("f", now, "%s takes joint %d to %.6f rad, outside its limits" % (
                    name, index + 1, value))
        nearest = self._motion_guard.nearest(tuple(joints)).distance
        if nearest < DEFAULT_MARGIN - NEARER:
            self._comes_nearer(name, nearest, self._distance_now(), now)

    def _distance_now(self) -> float:
        """Return the least distance, m, of the simulated arm from itself."""
        return self._motion_guard.nearest(self._room.controller.state.plant.joint_position).distance

    @staticmethod
    def _comes_nearer(name: str, nearest: float, before: float, now: float) -> None:
        if nearest < min(DEFAULT_MARGIN - NEARER, before - NEARER_STILL):
            raise RuleBroken("near", now, "%s takes the arm to where it is %.1f mm from itself" % (name, 1e3 * nearest))

    # ---- servo frames ----

    def _servo_frame(self, name: str, request: Dict[str, Any], now: float) -> None:
        if self._servo_call < self.last_stop:
            raise RuleBroken("b", now, "%s is sent in a servo mode that was asked for before the stop" % name)
        self._comes_in_a_burst(now)
        if request.get("relFlag"):
            raise RuleBroken("f", now, "%s is relative: what is lost on the way would move the arm elsewhere" % name)
        if name == "servo_j":
            values: Tuple[float, ...] = all_deg_to_rad(request["jointPosition"])
            self._joint_frame(values, int(request.get("stepNum", 1)), now)
            self.jog.sends(values, self._judged_from, now)
            self.points.sends(values, now)
        else:
            wire = request["catPosition"]
            # nobody but the controller knows the joints of a pose before it is there
            self._comes_nearer(name, self._distance_now(), self._began_at_distance, now)
            values = tuple(all_mm_to_m(wire[:3])) + tuple(all_deg_to_rad(wire[3:]))
        self._rests_on_target(name, values, now)
        self._frame, self._kind = values, name
        goals = [call for call in self.open_calls.values() if call.kind == "trajectory" and call.path is not None
                 and (call.was_sent or call.start.running is not None)]  # the others wait until the arm rests
        if goals:
            goals[-1].was_sent = True
            self.last_motion = max(self.last_motion, goals[-1].number)
        self.trajectory.sends(values, goals[-1] if goals else None, now)

    def _comes_in_a_burst(self, now: float) -> None:
        self._frames_at.append(now)
        while self._frames_at[0] < now - BURST_WINDOW:
            self._frames_at.popleft()
        if len(self._frames_at) > BURST_FRAMES + self._settings.stream_ahead:
            raise RuleBroken("burst", now, "%d servo frames within %.3f s" % (
                len(self._frames_at), now - self._frames_at[0]))

    def _joint_frame(self, joints: Tuple[float, ...], cycles: int, now: float) -> None:
        before = self._frame if self._kind == "servo_j" else None
        if before is None:
            self._began = joints
        # joints may stand beyond the range of streams where one begins
        self._within(limits.stream_limits(self._model, self._began), "servo_j", joints, now)
        if before is None:
            measured = self._room.controller.state.plant.joint_position
            if not _near(measured, joints, FIRST_FRAME_NEAR):
                raise RuleBroken("f", now, "the first servo frame is %.3f rad from the arm" % max(
                    [abs(a - b) for a, b in zip(measured, joints)]))
            return
        for index, (old, new, top) in enumerate(zip(before, joints, self._model.joint_max_speed)):
            reach = min(top, SERVO_SPEED_CEILING) * SERVO_CYCLE * cycles * SPEED_SLACK
            if abs(new - old) > reach:
                raise RuleBroken("f", now, "servo_j moves joint %d by %.5f rad in %d cycles" % (
                    index + 1, new - old, cycles))

    def _next_target(self, command: Any) -> Any:
        """Return the client's newest target as an absolute one, led inside as streams do; None where that is not known.

        It is not known for a relative one that comes before the first frame, nor for those that follow it.
        """
        if isinstance(command, c.ServoPose):
            return None if command.relative else command.target
        if not command.relative:
            return self._led(command.joint_position)
        if not self._is_target_known:
            return None
        start = self._target if isinstance(self._target, tuple) else (self._frame if self._kind == "servo_j" else None)
        return None if start is None else self._led(tuple([a + b for a, b in zip(start, command.joint_position)]))

    def _led(self, target: Tuple[float, ...]) -> Tuple[float, ...]:
        at = self._frame if self._kind == "servo_j" else self._room.controller.state.plant.joint_position
        return limits.led_inside(target, limits.stream_limits(self._model, at))[0]

    def _rests_on_target(self, name: str, values: Tuple[float, ...], now: float) -> None:
        """Judge that the stream repeats only its last target once that is old enough.

        Time in which the process stood still does not count, and a late timer leaves frames out.
        """
        due = max(self._target_at, self._judged_from) + self._settings.servo_ahead + SERVO_LATENESS + (
            8.0 * self._lateness)
        if self._target is None or now <= due:
            return
        if isinstance(self._target, c.Pose):
            turn = rotation_angle_between(matrix_from_rpy(values[3:]), matrix_from_rpy(self._target.rpy))
            is_there = name == "servo_p" and _near(values[:3], self._target.position, _WIRE_ROUNDING) and turn < 1e-5
        else:
            is_there = name == "servo_j" and _near(values, self._target, _WIRE_ROUNDING)
        if not is_there:
            raise RuleBroken("f", now, "the servo stream sends %s, %.3f s after its last target %s" % (
                _rounded(values), now - self._target_at, _rounded(
                    self._target.position + self._target.rpy if isinstance(self._target, c.Pose) else self._target)))


def _near(a: Sequence[float], b: Sequence[float], tolerance: float) -> bool:
    return max([abs(p - q) for p, q in zip(a, b)]) <= tolerance


def _rounded(values: Sequence[float]) -> Tuple[float, ...]:
    return tuple([round(value, 6) for value in values])


def _is_jog(command: c.Jog, request: Dict[str, Any]) -> bool:
    if command.axis != request["jnum"] or command.frame is not _JOG_FRAMES[request["coord_map"]]:
        return False
    is_line = command.frame is not c.JogFrame.JOINT and command.axis < 3
    velocity = (mm_to_m if is_line else deg_to_rad)(request["jogvel"])
    return abs(velocity - command.velocity) < _SAME
