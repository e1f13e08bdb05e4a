"""Defects put around a good core: the rule that each breaks must find it, or that rule finds nothing.

They work at the interface of core and shell: on the core's inputs, its actions and its answers about itself. More
defects, and the table of all, are in defects.py.
"""
import contextlib
import json
from typing import Any, Dict, List, Tuple

from sent_rules import requests_in

from jaka_ros_driver.client.core.actions import Answer, NotifyGuard, Open, Port, PublishState, Send
from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.witness import Witness
from jaka_ros_driver.errors import JakaError, MotionInterrupted

_MOTIONS = ("joint_move", "moveL", "jog")


class Wrapped:
    """A good core and hooks for its subclasses, each of which overrides what is to go wrong."""

    def __init__(self, settings: Any, model: Any) -> None:
        self.good = ArmCore(settings, model)
        self.settings = settings

    def __getattr__(self, name: str) -> Any:
        return getattr(self.good, name)

    def take_actions(self) -> List[Any]:
        """Return the good core's actions, each changed, left out or doubled."""
        return [made for action in self.good.take_actions() for made in self.change(action)]

    def change(self, action: Any) -> List[Any]:
        """Return the actions that take the place of this one."""
        return self.change_requests(action) if isinstance(action, Send) else [action]

    def change_requests(self, action: Send) -> List[Any]:
        """Return the requests of one Send, each changed or left out."""
        kept = [request for request in requests_in(action.data) if self.lets_pass(request)]
        return [Send(b"".join([json.dumps(request).encode() for request in kept]))] if kept else []

    def lets_pass(self, request: Dict[str, Any]) -> bool:
        """Return whether a request goes out; may change it."""
        return True


class FreeAtOnce(Wrapped):
    """Custody given away as soon as it is taken."""

    @property
    def is_free(self) -> bool:
        return True


class NeverFree(Wrapped):
    """Custody that never ends once it was taken."""

    has_begun = False

    @property
    def is_free(self) -> bool:
        self.has_begun = self.has_begun or not self.good.is_free
        return not self.has_begun


class StopsForCallsOnly(Wrapped):
    """Own stops (watchdog, link, feed, repetition) that are not sent and count as accepted."""

    is_in_call = False
    swallowed: Tuple[str, ...] = ()

    def stop(self, call: Any, now: float) -> None:
        self.is_in_call = True
        self.good.stop(call, now)

    def take_actions(self) -> List[Any]:
        actions = super().take_actions()
        self.is_in_call = False
        return actions

    def lets_pass(self, request: Dict[str, Any]) -> bool:
        is_stop = request["cmdName"] == "stop_program" or (request["cmdName"] == "jog" and not request["jog_mode"])
        if is_stop and self.swallows():
            self.swallowed += (request["cmdName"],)
            return False
        return True

    def swallows(self) -> bool:
        """Return whether this stop is not sent."""
        return not self.is_in_call

    def tick(self, now: float) -> None:
        swallowed, self.swallowed = self.swallowed, ()
        for name in swallowed:
            reply = {"errorCode": "0", "errorMsg": "", "cmdName": name}
            self.good.received(Port.COMMAND, json.dumps(reply).encode(), now)
        self.good.tick(now)


class StopsOnce(StopsForCallsOnly):
    """A refused or lost stop that is not repeated."""

    has_stopped = False

    def change(self, action: Any) -> List[Any]:
        if isinstance(action, NotifyGuard) and action.is_moving:
            self.has_stopped = False
        made = super().change(action)
        if isinstance(action, Send) and b"stop_program" in action.data:
            self.has_stopped = True
        return made

    def swallows(self) -> bool:
        return self.has_stopped and not self.is_in_call


class JogsOn(Wrapped):
    """A jog without watchdog: the driver itself repeats the jog call."""

    command: Any = None
    next_at = 0.0

    def jog(self, call: Any, command: Any, now: float) -> None:
        self.command, self.next_at = command, now + 0.5
        self.good.jog(call, command, now)

    def stop(self, call: Any, now: float) -> None:
        self.command = None
        self.good.stop(call, now)

    def tick(self, now: float) -> None:
        self.good.tick(now)
        if self.command is not None and now >= self.next_at and not self.good.is_free:
            self.next_at = now + 0.5
            self.good.jog(None, self.command, now)

    def change(self, action: Any) -> List[Any]:
        return [] if isinstance(action, Answer) and action.call is None else [action]


class StopsLater(Wrapped):
    """A stop that waits for the next turn of a loop."""

    waiting: Tuple[Any, ...] = ()

    def stop(self, call: Any, now: float) -> None:
        self.waiting += (call,)

    def tick(self, now: float) -> None:
        waiting, self.waiting = self.waiting, ()
        for call in waiting:
            self.good.stop(call, now)
        self.good.tick(now)


class SendsAgain(Wrapped):
    """Requests lost with a link that are sent again on the next one."""

    motion = b""

    def lets_pass(self, request: Dict[str, Any]) -> bool:
        if request["cmdName"] == "joint_move":
            self.motion = json.dumps(request).encode()
        return True

    def opened(self, port: Port, now: float) -> None:
        self.good.opened(port, now)
        if port is Port.COMMAND and self.motion:
            self.good.actions.add(NotifyGuard(True))
            self.good.actions.add(Send(self.motion))


class ForgetsStops(Wrapped):
    """A waiting move that outlives a stop: it is asked for again behind it."""

    def __init__(self, settings: Any, model: Any) -> None:
        super().__init__(settings, model)
        self.moves: Dict[Any, Any] = {}

    def move(self, call: Any, command: Any, wait: bool, now: float) -> None:
        self.moves[call] = command, wait, now
        self.good.move(call, command, wait, now)

    def take_actions(self) -> List[Any]:
        actions = []
        for action in super().take_actions():
            asked = self.moves.pop(action.call, None) if isinstance(action, Answer) else None
            if asked and isinstance(action.error, MotionInterrupted):
                self.good.move(action.call, asked[0], asked[1], asked[2])
            else:
                actions.append(action)
        return actions + self.good.take_actions()


class AnswersTwice(Wrapped):
    """Two answers to one call."""

    def change(self, action: Any) -> List[Any]:
        return [action] * 2 if isinstance(action, Answer) else [action]


class AnswersNever(Wrapped):
    """No answer to an interrupted move."""

    def change(self, action: Any) -> List[Any]:
        is_lost = isinstance(action, Answer) and isinstance(action.error, MotionInterrupted)
        return [] if is_lost else [action]


class AnswersGood(Wrapped):
    """An interrupted move that is reported as completed."""

    def change(self, action: Any) -> List[Any]:
        if isinstance(action, Answer) and isinstance(action.error, MotionInterrupted):
            return [Answer(action.call, None, None)]
        return [action]


class PowersAgain(Wrapped):
    """An arm that is enabled again by itself after a lost link."""

    connections = 0

    def opened(self, port: Port, now: float) -> None:
        self.good.opened(port, now)
        if port is Port.COMMAND:
            self.connections += 1
            if self.connections > 1:
                self.good.actions.add(Send(b'{"cmdName": "enable_robot"}'))


class JumpsInServo(Wrapped):
    """A servo frame now and then that is far from the one before."""

    count = 0

    def lets_pass(self, request: Dict[str, Any]) -> bool:
        if request["cmdName"] == "servo_j":
            self.count += 1
            if self.count % 50 == 0:
                request["jointPosition"][0] += 2.0
        return True


class StreamsOn(Wrapped):
    """Servo frames that repeat the last step when no target comes."""

    before: Any = None

    def lets_pass(self, request: Dict[str, Any]) -> bool:
        if request["cmdName"] == "servo_j":
            joints = request["jointPosition"]
            if self.before is not None and max([abs(a - b) for a, b in zip(joints, self.before)]) < 1e-9:
                joints[5] += 0.01
            else:
                self.before = list(joints)
        return True


class BesidePath(Wrapped):
    """Servo frames that lie a little beside their place."""

    def lets_pass(self, request: Dict[str, Any]) -> bool:
        if request["cmdName"] == "servo_j":
            request["jointPosition"][3] += 0.3
        return True


class LeavesSegmentsOut(StopsForCallsOnly):
    """A path segment now and then that is not sent and counts as accepted."""

    count = 0

    def lets_pass(self, request: Dict[str, Any]) -> bool:
        if self.good.path is not None and request["cmdName"] in _MOTIONS + ("movc",):
            self.count += 1
            if self.count % 3 == 2:
                self.swallowed += (request["cmdName"],)
                return False
        return True


class LeavesPrograms(Wrapped):
    """A running program that does not keep custody."""

    @property
    def is_free(self) -> bool:
        return self.good.is_free or self.good.motion_owner is MotionOwner.PROGRAM


class PausesNothing(Wrapped):
    """A pause that is answered as done while the trajectory goes on."""

    def run(self, call: Any, procedure: Any, now: float, exclusive: Any = None) -> None:
        if call is not None and call.command == ("pause", None):
            self.good.actions.answer(call, "paused")
        else:
            self.good.run(call, procedure, now, exclusive)


class ResumesStreams(Wrapped):
    """A stream of points that is taken again at once after it was ended."""

    def follow_point(self, call: Any, point: Any, stops: int, now: float) -> None:
        self.good._point_gate._closed_by = ""
        self.good.follow_point(call, point, stops, now)


class PassesLastPoint(Wrapped):
    """A stream of points that is followed beyond its last one."""

    def follow_point(self, call: Any, point: Any, stops: int, now: float) -> None:
        start = self.good.state.joint_position if self.good.state is not None else point.position
        farther = tuple([p + 0.1 * (p - s) for p, s in zip(point.position, start)])
        self.good.follow_point(call, point._replace(position=farther), stops, now)


class KeepsHold(Wrapped):
    """A velocity jog whose last message counts for ever."""

    message: Any = None

    def jog_velocity(self, message: Any, now: float) -> None:
        self.message = message
        self.good.jog_velocity(message, now)

    def tick(self, now: float) -> None:
        if self.message is not None and self.message.wish is not None and self.good.dead_man.is_held:
            with contextlib.suppress(JakaError):
                self.good.jog_velocity(self.message._replace(stamp_ns=int(1e9 * now), age=0.0, received_at=now), now)
        self.good.tick(now)


class NeedsNoRest(Wrapped):
    """A velocity jog that begins with any message, without rest before it."""

    def jog_velocity(self, message: Any, now: float) -> None:
        if message.wish is not None and not self.good.dead_man.is_held:
            with contextlib.suppress(JakaError):
                self.good.jog_velocity(message._replace(
                    stamp_ns=message.stamp_ns - 1, wish=message.wish._replace(velocity=(0.0,) * 6)), now)
        self.good.jog_velocity(message, now)


class LeavesLimits(Wrapped):
    """Targets that are not checked against the joint limits."""

    def lets_pass(self, request: Dict[str, Any]) -> bool:
        if request["cmdName"] == "joint_move":
            request["jointPosition"][2] = 300.0
        return True


class GoesIntoItself(Wrapped):
    """Targets that are within the joint limits and in the arm's own base."""

    def lets_pass(self, request: Dict[str, Any]) -> bool:
        if request["cmdName"] == "joint_move":
            request["jointPosition"] = [102.0, -49.6, -154.4, 21.8, 9.3, -180.0]
        return True


class ShowsOldAsNew(Wrapped):
    """Frames that are all shown as new."""

    def change(self, action: Any) -> List[Any]:
        return [PublishState(action.state, True)] if isinstance(action, PublishState) else [action]


class GuardIsNotTold(Wrapped):
    """A guard that is never notified that the arm moves."""

    def change(self, action: Any) -> List[Any]:
        return [] if isinstance(action, NotifyGuard) and action.is_moving else [action]


class GuardIsToldTooSoon(Wrapped):
    """A guard that is notified of rest when a stop is sent, not when the arm rests."""

    def change(self, action: Any) -> List[Any]:
        made = [action]
        if isinstance(action, Send) and b"stop_program" in action.data:
            made.append(NotifyGuard(False))
        return made


class _NoWitness(Witness):
    can_tell = property(lambda self: False)

    def ask(self, now: float) -> None:
        pass

    def distrust(self, why: str, counts_from: float) -> None:
        pass


class DoesNotSeeSilence(Wrapped):
    """A silent feed that goes unnoticed: its last frame is read again and again, and no witness is asked."""

    frame = b""
    fed_at = 0.0

    def __init__(self, settings: Any, model: Any) -> None:
        super().__init__(settings, model)
        self.good.links._witness.__class__ = _NoWitness

    def received(self, port: Port, data: bytes, now: float) -> None:
        if port is Port.STATUS:
            whole = data.rfind(b'{"len"')
            self.frame, self.fed_at = data[whole:] if data.endswith(b"}") and whole >= 0 else self.frame, now
        self.good.received(port, data, now)

    def tick(self, now: float) -> None:
        if self.frame and now - self.fed_at > 0.03:
            self.fed_at = now
            self.good.received(Port.STATUS, self.frame, now)
        self.good.tick(now)

    def change(self, action: Any) -> List[Any]:
        return [PublishState(action.state, False)] if isinstance(action, PublishState) else [action]


class ConnectsOnce(Wrapped):
    """A lost status port that is not connected again."""

    has_opened = False

    def change(self, action: Any) -> List[Any]:
        if isinstance(action, Open) and action.port is Port.STATUS:
            if self.has_opened:
                return []
            self.has_opened = True
        return [action]


class TalksToStrangers(Wrapped):
    """A version request that goes out before the controller has identified itself."""

    def opened(self, port: Port, now: float) -> None:
        self.good.opened(port, now)
        if port is Port.COMMAND:
            self.good.actions.add(Send(b'{"cmdName": "get_version"}'))


class Raises(Wrapped):
    """An error of the core's own that comes out of it."""

    def jog(self, call: Any, command: Any, now: float) -> None:
        raise KeyError("jog")


class SendsWithoutLink(Wrapped):
    """Bytes for a port that is closed."""

    def closed(self, port: Port, reason: str, now: float) -> None:
        self.good.closed(port, reason, now)
        if port is Port.COMMAND:
            self.good.actions.add(Send(b'{"cmdName": "stop_program"}'))
