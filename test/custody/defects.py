"""Defects that exist only inside the core, those of the guard, and the table of all planted defects.

Each must be found by the rule that it breaks, or that rule finds nothing.
"""
import contextlib
import json
import re
from typing import Any, Callable, Dict, List, NamedTuple, Tuple

from core_defects import (
    AnswersGood,
    AnswersNever,
    AnswersTwice,
    BesidePath,
    ConnectsOnce,
    DoesNotSeeSilence,
    ForgetsStops,
    FreeAtOnce,
    GoesIntoItself,
    GuardIsNotTold,
    GuardIsToldTooSoon,
    JogsOn,
    JumpsInServo,
    KeepsHold,
    LeavesLimits,
    LeavesPrograms,
    LeavesSegmentsOut,
    NeedsNoRest,
    NeverFree,
    PassesLastPoint,
    PausesNothing,
    PowersAgain,
    Raises,
    ResumesStreams,
    SendsAgain,
    SendsWithoutLink,
    ShowsOldAsNew,
    StopsForCallsOnly,
    StopsLater,
    StopsOnce,
    StreamsOn,
    TalksToStrangers,
    Wrapped,
)
from generator import LATER
from sent_rules import requests_in

from jaka_ros_driver.client.core.actions import Close, Open, Port, PublishState, Send
from jaka_ros_driver.client.core.phases import Event
from jaka_ros_driver.client.stopping import Step, Stopping


class StopsHalf(StopsForCallsOnly):
    """A stop that ends moves and programs only; the ends of jogs and servo mode count as accepted."""

    def change_requests(self, action: Send) -> List[Any]:
        requests = requests_in(action.data)
        if not any(request["cmdName"] == "stop_program" for request in requests):
            return [action]
        self.swallowed += tuple(request["cmdName"] for request in requests if request["cmdName"] != "stop_program")
        return [Send(b'{"cmdName": "stop_program"}')] * sum(
            request["cmdName"] == "stop_program" for request in requests)


class WaitsForStart(Wrapped):
    """A motion that does not begin and is waited for."""

    def __init__(self, settings: Any, model: Any) -> None:
        super().__init__(settings, model)
        stop = self.good.custody.stop

        def patient(outcome: Any, now: float, *more: Any, **others: Any) -> None:
            if "did not move" not in str(outcome) and "not seen to move" not in str(outcome):
                stop(outcome, now, *more, **others)
        self.good.custody.stop = patient  # type: ignore[method-assign]


class IgnoresFaults(Wrapped):
    """Stops, faults and de-energised drives that are not seen."""

    def received(self, port: Port, data: bytes, now: float) -> None:
        if port is Port.STATUS:
            data = data.replace(b'"enabled": false', b'"enabled": true ')
            data = data.replace(b'"powered_on": 0', b'"powered_on": 1')
            data = data.replace(b'"emergency_stop": 1', b'"emergency_stop": 0')
            data = data.replace(b'"protective_stop": 1', b'"protective_stop": 0')
            data = re.sub(rb'"errcode": "0x[0-9a-fA-F]+"',
                          lambda found: b'"errcode": "0x0"'.ljust(len(found.group())), data)
        self.good.received(port, data, now)


class IgnoresRefusedFrames(Wrapped):
    """Replies to servo frames that are not looked at."""

    def received(self, port: Port, data: bytes, now: float) -> None:
        if port is Port.COMMAND and b'"servo_' in data:
            with contextlib.suppress(ValueError):
                replies = requests_in(data)
                for reply in replies:
                    if isinstance(reply, dict) and reply.get("cmdName") in ("servo_j", "servo_p"):
                        reply["errorCode"] = "0"
                data = b"".join([json.dumps(reply).encode() for reply in replies])
        self.good.received(port, data, now)


class StreamsAfterStop(Wrapped):
    """One more servo frame behind a stop."""

    frame: Any = None

    def stop(self, call: Any, now: float) -> None:
        self.good.stop(call, now)
        if self.frame is not None and not self.good.is_free:
            self.good.actions.add(Send(json.dumps(self.frame).encode()))

    def lets_pass(self, request: Dict[str, Any]) -> bool:
        if request["cmdName"] == "servo_move":
            self.frame = None
        elif request["cmdName"] == "servo_j":
            self.frame = request
        return True


class SendsInBursts(Wrapped):
    """Servo frames that are kept and go out a dozen at a time."""

    kept: Tuple[Dict[str, Any], ...] = ()

    def change_requests(self, action: Send) -> List[Any]:
        requests = requests_in(action.data)
        if any(request["cmdName"] != "servo_j" for request in requests):
            self.kept = ()
            return [action]
        self.kept += tuple(requests)
        if len(self.kept) < 12:
            return []
        kept, self.kept = self.kept, ()
        return [Send(json.dumps(request).encode()) for request in kept]


class RecoversTwice(Wrapped):
    """Recovery steps that are each sent twice."""

    def change_requests(self, action: Send) -> List[Any]:
        is_step = any(request["cmdName"] in ("clear_error", "power_on", "enable_robot")
                      for request in requests_in(action.data))
        return [action] * 2 if is_step else [action]


class LeavesMoving(Wrapped):
    """A shutdown that gives custody up and stops nothing."""

    def close(self, now: float) -> None:
        self.good.close(now)
        if not self.good.custody.is_free:
            self.good.custody._enter(Event.AT_REST)
            self.good.custody._release(now)

    def lets_pass(self, request: Dict[str, Any]) -> bool:
        return not self.good._is_closing


class ForgetsOwedStop(Wrapped):
    """A refused stop that is not due again."""

    def tick(self, now: float) -> None:
        if self.good.custody.must_stop:
            self.good.custody._retry_at = float("inf")
        self.good.tick(now)


class KeepsBacklog(Wrapped):
    """A stale status connection that is kept, with all that waits in it, and believed."""

    is_kept = False

    def change(self, action: Any) -> List[Any]:
        if isinstance(action, Close) and action.port is Port.STATUS:
            self.is_kept = True
            return []
        if isinstance(action, Open) and action.port is Port.STATUS and self.is_kept:
            return []
        return [PublishState(action.state, True)] if isinstance(action, PublishState) else [action]

    def closed(self, port: Port, reason: str, now: float) -> None:
        self.is_kept = self.is_kept and port is not Port.STATUS
        self.good.closed(port, reason, now)

    def received(self, port: Port, data: bytes, now: float) -> None:
        if self.is_kept and port is Port.STATUS:
            self.is_kept = False
            self.good.opened(port, now)
        self.good.received(port, data, now)


class IsReadyOnce(Wrapped):
    """A driver that reports for ever after a lost link that it is not ready."""

    has_lost = False

    def closed(self, port: Port, reason: str, now: float) -> None:
        self.has_lost = True
        self.good.closed(port, reason, now)

    def is_ready(self, now: float) -> bool:
        return not self.has_lost and self.good.is_ready(now)


class ForgetsLeft(Wrapped):
    """A driver that starts without a look at what a dead one left moving."""

    def start(self, now: float, left: Any = None) -> None:
        self.good.start(now)


class BlindGuard(Stopping):
    """A guard that watches and does nothing."""

    def step(self, now: float, driver: Any) -> Step:
        return Step.WAIT


class GuardStopsOnce(Stopping):
    """A guard that sends one stop and ends."""

    has_sent = False

    def step(self, now: float, driver: Any) -> Step:
        if self.has_sent:
            return Step.FINISH
        step = super().step(now, driver)
        self.has_sent = step is Step.SEND
        return step


class Defect(NamedTuple):
    """A defective core, or guard.

    Attributes:
        make: Makes it.
        rule: The rule that must be found broken.
        also: Other rules, separated by blanks, that may be found broken on the way to it.
        is_guard: It decides how the guard stops an arm.
        first: The seed to try first, where those before it were seen to find nothing: they take time.
    """

    make: Callable[..., Any]
    rule: str
    also: str = ""
    is_guard: bool = False
    first: int = 1


DEFECTS: Tuple[Defect, ...] = (
    Defect(FreeAtOnce, "a"), Defect(NeverFree, "k"), Defect(StopsOnce, "m", "c e", first=157),
    Defect(StopsForCallsOnly, "j", "a c e h m q v late against left", first=114),
    Defect(JogsOn, "c", "b", first=19), Defect(StopsLater, "i"),
    Defect(SendsAgain, "b"), Defect(ForgetsStops, "b", first=9), Defect(AnswersTwice, "e"),
    Defect(AnswersNever, "e", "b t"), Defect(AnswersGood, "e"), Defect(PowersAgain, "d", "n"),
    Defect(JumpsInServo, "f"), Defect(StreamsOn, "f", "t", first=14),
    Defect(LeavesLimits, "f"), Defect(GoesIntoItself, "near"),
    Defect(ShowsOldAsNew, "g", "age", first=30), Defect(GuardIsNotTold, "h", "state"),
    Defect(GuardIsToldTooSoon, "state", "h"), Defect(DoesNotSeeSilence, "j", "contract f h k age", first=241),
    Defect(ConnectsOnce, "k", "contract l"),
    Defect(IsReadyOnce, "l"),
    Defect(TalksToStrangers, "n"), Defect(Raises, "contract"), Defect(SendsWithoutLink, "contract"),
    Defect(BesidePath, "t", "f"), Defect(PausesNothing, "p", first=8), Defect(KeepsHold, "v", "b"),
    Defect(NeedsNoRest, "v"),
    Defect(LeavesSegmentsOut, "q"), Defect(LeavesPrograms, "r", first=11), Defect(StopsHalf, "whole"),
    Defect(WaitsForStart, "late", first=34), Defect(IgnoresFaults, "against", "d v", first=7),
    Defect(IgnoresRefusedFrames, "against", first=12),
    Defect(StreamsAfterStop, "b"), Defect(SendsInBursts, "burst", "t f v e"),
    Defect(RecoversTwice, "recovery", first=11), Defect(LeavesMoving, "goodbye", "state", first=20),
    Defect(ForgetsOwedStop, "state"), Defect(KeepsBacklog, "age", "g k contract", first=526),
    Defect(ForgetsLeft, "left", "a h"),
    Defect(ResumesStreams, "stream", first=LATER + 6), Defect(PassesLastPoint, "stream", first=LATER + 9),
    Defect(BlindGuard, "guard", is_guard=True, first=138),
    Defect(GuardStopsOnce, "guard", is_guard=True, first=331))
