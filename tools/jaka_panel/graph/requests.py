"""The requests of pages to a driver, as calls of its services: from SI units to those of the driver's interface.

Poses of pages are x, y, z, m, and a rotation vector, rad.
"""
import contextlib
import json
import math
import threading
from typing import Any, Callable, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence

import numpy as np
import rospy
import yaml
from roslib import message as roslib_message
from rospy.exceptions import ROSInternalException

from ..record.hand_outputs import Key
from ..teach.rotations import FramePose, compose, invert
from .arms import Driver
from .rotations import rpy_from_vector, vector_from_rpy

BANKS = {"cabinet": 0, "tool": 1, "extension": 2}
SHORT_S, LONG_S, MOTION_S = 10.0, 60.0, 86400.0
"""Longest wait, s, for an answer: of a short call, of one that powers the arm, and of a motion."""
_COLLISION_VALUES = {1: 25, 2: 50, 3: 75, 4: 100}
_FAILURE = 9998.0
"""Value above which all numbers of a pose or joints are the driver's sign of a failure (9999)."""
_LONGEST_NAME = 100
"""Most characters of a name in a request."""
_READ_BACK = 1e-3
"""Largest difference, as a share or absolute, of an output that was read back: it has the driver's float32."""
_DEFAULT_JOINT_ACCELERATION = 2.0
"""Acceleration of a page's joint move, rad/s2: a sixth of the highest, so that a person sees what begins."""
_DEFAULT_ACCELERATION = 0.5
"""Acceleration of a page's linear move, m/s2."""
_SAME_M, _SAME_RAD = 0.0005, 0.005
"""Distances, m and rad, of two poses that are one (``is_same``): rounding on the wire, and the kinematics' own."""
Args = Mapping[str, Any]
"""The arguments of a page's request, by name, as its JSON has them."""


class WrongRequest(ValueError):
    """A request that cannot be understood; the text says what is valid."""


class CallResult(NamedTuple):
    """The end of a call: success and message of the driver, and what the page gets besides."""

    ok: bool
    message: str
    data: Optional[Dict[str, Any]] = None


class Request(NamedTuple):
    """A request that a page may make.

    Attributes:
        perform: Function that carries it out, in a thread that may wait; raises WrongRequest.
        timeout: Longest wait for the answer, s.
        needs_control: True if only the page in control may make it.
        is_motion: True if it moves the arm, which is stopped when its page goes away.
        begins: True if it lets the arm move: it is not sent after a stop that came later than it.
    """

    perform: Callable[[Driver, Args], CallResult]
    timeout: float = SHORT_S
    needs_control: bool = True
    is_motion: bool = False
    begins: bool = False


_here = threading.local()


@contextlib.contextmanager
def sent_unless(why_not: Callable[[], str]) -> Iterator[None]:
    """Let the calls that this thread makes in the block be sent only where ``why_not`` returns an empty text.

    It is called directly before a request is sent: the master and the connection may have taken their time, and a stop,
    which waits for neither, may have overtaken it.
    """
    _here.why_not = why_not
    try:
        yield
    finally:
        del _here.why_not


def _guarded(kind: Any) -> Any:
    """Return the class of requests that are packed, which is directly before they are sent, only where they may be."""
    class GuardedRequest(kind):  # type: ignore[misc]
        def serialize(self, buff: Any) -> None:
            why = _here.why_not()
            if why:
                raise WrongRequest(why)
            super().serialize(buff)
    return GuardedRequest


def _call(driver: Driver, name: str, kind: str, /, **fields: Any) -> Any:
    service = roslib_message.get_service_class(kind)
    if service is None:
        raise WrongRequest("the service type %s is not installed" % kind)
    kind_of_request = _guarded(service._request_class) if hasattr(_here, "why_not") else service._request_class
    try:
        return rospy.ServiceProxy("%s/%s" % (driver.node, name), service)(kind_of_request(**fields))
    except (rospy.ServiceException, rospy.ROSException, ROSInternalException, OverflowError) as error:
        raise WrongRequest("%s/%s: %s" % (driver.node, name, error)) from error


def _told(response: Any) -> CallResult:
    """Return the outcome of a response that has ret or success, and message."""
    ok = response.ret == 1 if hasattr(response, "ret") else bool(response.success)
    return CallResult(ok, str(response.message))


# ---- fields of a page's request ----

def number(args: Args, name: str, default: Optional[float] = None) -> float:
    """Return a finite number; raise WrongRequest for anything else."""
    value = args.get(name, default)
    if value is None or type(value) not in (int, float) or not math.isfinite(value):
        raise WrongRequest("%s must be a number" % name)
    return float(value)


def whole(args: Args, name: str, low: int = 0, high: int = 32767) -> int:
    """Return a whole number within a range; raise WrongRequest for anything else."""
    value = args.get(name)
    if type(value) is not int or not low <= value <= high:
        raise WrongRequest("%s must be a whole number within %d to %d" % (name, low, high))
    return value


def flag(args: Args, name: str) -> bool:
    """Return true or false; raise WrongRequest for anything else."""
    value = args.get(name)
    if type(value) is not bool:
        raise WrongRequest("%s must be true or false" % name)
    return value


def text(args: Args, name: str, choices: Optional[Sequence[str]] = None) -> str:
    """Return a text, one of the choices where there are some; raise WrongRequest for anything else."""
    value = args.get(name)
    if not isinstance(value, str) or len(value) > _LONGEST_NAME or (choices is not None and value not in choices):
        raise WrongRequest("%s must be %s" % (name, "one of " + ", ".join(choices) if choices is not None
                                              else "a text of at most %d characters" % _LONGEST_NAME))
    return value


def numbers(args: Args, name: str, count: int) -> List[float]:
    """Return ``count`` finite numbers; raise WrongRequest for anything else."""
    values = args.get(name)
    if not isinstance(values, list) or len(values) != count:
        raise WrongRequest("%s must be %d numbers" % (name, count))
    return [number({name: value}, name) for value in values]


def _pose(args: Args) -> List[float]:
    """Return x y z, mm, and a rotation vector, rad."""
    return [1000.0 * value for value in numbers(args, "p", 3)] + numbers(args, "r", 3)


# ---- what is asked for ----

def _switch(name: str) -> Callable[[Driver, Args], CallResult]:
    return lambda driver, args: _told(_call(driver, name, "std_srvs/SetBool", data=flag(args, "on")))


def _trigger(name: str) -> Callable[[Driver, Args], CallResult]:
    return lambda driver, args: _told(_call(driver, name, "std_srvs/Trigger"))


def _clear_err(driver: Driver, args: Args) -> CallResult:
    if roslib_message.get_service_class("jaka_msgs/ClearErr") is None:  # the maker's jaka_msgs; the driver takes both
        return _told(_call(driver, "clear_err", "jaka_msgs/ClearError", enable=True))
    return _told(_call(driver, "clear_err", "jaka_msgs/ClearErr"))


def _speed(driver: Driver, args: Args) -> CallResult:
    return _told(_call(driver, "set_speed_slider", "jaka_msgs/SetSpeedSlider",
                       speed_slider_fraction=number(args, "fraction")))


def _set_output(driver: Driver, args: Args) -> CallResult:
    signal, bank = text(args, "signal", ("digital", "analog")), BANKS[text(args, "bank", tuple(BANKS))]
    value = args.get("value")
    wanted = float(value) if type(value) is bool else number(args, "value")
    index = _terminal(driver, args)
    done = _told(_call(driver, "set_io", "jaka_msgs/SetIO", signal=signal, type=bank, index=index, value=wanted))
    read = _call(driver, "get_io", "jaka_msgs/GetIO", signal=signal, path=1, type=bank, index=index)
    if read.message.startswith("error:"):
        return CallResult(False, done.message if not done.ok else read.message)
    is_same = (read.value != 0.0) == (wanted != 0.0) if signal == "digital" else (
        abs(read.value - wanted) <= _READ_BACK * max(1.0, abs(wanted)))
    shown = bool(read.value) if signal == "digital" else round(read.value, 6)
    return CallResult(done.ok and is_same, done.message if is_same else "read back %s" % shown, {"value": shown})


def output_of(request_text: str) -> Key:
    """Return the output that a call of ``~set_io`` names, by its request as text."""
    request = yaml.safe_load(request_text)
    bank = next((name for name, number in BANKS.items() if number == request["type"]), str(request["type"]))
    return bank, str(request["signal"]), int(request["index"])


def _terminal(driver: Driver, args: Args) -> int:
    """Return the index of a terminal, which must mean the place at which the page shows it."""
    if driver.interface != "documented":
        raise WrongRequest("with interface %s the index of a terminal is the maker's, and may be one beside the one "
                           "that is shown: use set_io and get_io" % driver.interface)
    return whole(args, "index")


def _get_io(driver: Driver, args: Args) -> CallResult:
    signal = text(args, "signal", ("digital", "analog"))
    read = _call(driver, "get_io", "jaka_msgs/GetIO", signal=signal,
                 path=("input", "output").index(text(args, "direction", ("input", "output"))),
                 type=BANKS[text(args, "bank", tuple(BANKS))], index=_terminal(driver, args))
    if read.message.startswith("error:"):
        return CallResult(False, read.message)
    return CallResult(True, read.message, {"value": bool(read.value) if signal == "digital" else round(read.value, 6)})


def _tool_frame(driver: Driver, args: Args) -> CallResult:
    return _told(_call(driver, "set_toolframe", "jaka_msgs/SetTcpFrame", pose=_pose(args),
                       tool_num=whole(args, "number")))


def _user_frame(driver: Driver, args: Args) -> CallResult:
    return _told(_call(driver, "set_userframe", "jaka_msgs/SetUserFrame", pose=_pose(args),
                       user_num=whole(args, "number")))


def _payload(driver: Driver, args: Args) -> CallResult:
    x, y, z = (1000.0 * value for value in numbers(args, "centre", 3))
    return _told(_call(driver, "set_payload", "jaka_msgs/SetPayload", tool_num=whole(args, "tool"),
                       mass=number(args, "mass"), xc=x, yc=y, zc=z))


def _collision(driver: Driver, args: Args) -> CallResult:
    level = whole(args, "level", 0, 4)
    return _told(_call(driver, "set_collisionlevel", "jaka_msgs/SetCollision", is_enable=level > 0,
                       value=_COLLISION_VALUES.get(level, _COLLISION_VALUES[1])))


def _joint_move(driver: Driver, args: Args) -> CallResult:
    return _told(_call(driver, "joint_move", "jaka_msgs/Move", pose=numbers(args, "q", 6),
                       mvvelo=number(args, "speed"), mvacc=number(args, "acc", _DEFAULT_JOINT_ACCELERATION)))


def is_same(a: FramePose, b: FramePose) -> bool:
    """Return whether two poses are one, as near as a controller's kinematics tell the same one twice."""
    away = compose(invert(a), b)
    return bool(np.linalg.norm(away.position) <= _SAME_M and np.linalg.norm(away.rotation_vector) <= _SAME_RAD)


def _linear_move(driver: Driver, args: Args) -> CallResult:
    pose = _pose(args)
    if "q" in args:  # what was shown is where the arm would go, in the frames that are active now
        shown = _fk(driver, args)
        if not shown.ok or shown.data is None:
            return shown
        if not is_same(FramePose(shown.data["p"], shown.data["r"]), FramePose(args["p"], args["r"])):
            raise WrongRequest("tool or user frame are others than when the target was shown: look at it again")
    if driver.interface == "vendor":  # of 2024: ends at the inverse of the vector's rotation
        pose[3:] = [-value for value in pose[3:]]
    elif driver.interface == "vendor_2025":
        pose[3:] = rpy_from_vector(pose[3:])
    return _told(_call(driver, "linear_move", "jaka_msgs/Move", pose=pose, mvvelo=1000.0 * number(args, "speed"),
                       mvacc=1000.0 * number(args, "acc", _DEFAULT_ACCELERATION)))


def _failed(values: Sequence[float]) -> bool:
    return len(values) != 6 or not all(map(math.isfinite, values)) or all(value > _FAILURE for value in values)


def _fk(driver: Driver, args: Args) -> CallResult:
    response = _call(driver, "get_fk", "jaka_msgs/GetFK", joint=numbers(args, "q", 6))
    pose = list(response.cartesian_pose)
    if _failed(pose):
        return CallResult(False, str(response.message))
    return CallResult(True, str(response.message), {"p": [0.001 * value for value in pose[:3]],
                                                 "r": vector_from_rpy(pose[3:])})


def _ik(driver: Driver, args: Args) -> CallResult:
    pose = _pose(args)
    response = _call(driver, "get_ik", "jaka_msgs/GetIK", ref_joint=numbers(args, "near", 6),
                     cartesian_pose=pose[:3] + rpy_from_vector(pose[3:]))
    joints = list(response.joint)
    return CallResult(False, str(response.message)) if _failed(joints) else CallResult(
        True, str(response.message), {"q": joints})


def _program_load(driver: Driver, args: Args) -> CallResult:
    return _told(_call(driver, "program/load", "jaka_msgs/LoadProgram", name=text(args, "name")))


def _zones(driver: Driver, args: Args) -> CallResult:
    response = _call(driver, "set_workspace", "jaka_msgs/SetWorkspace", yaml="")  # empty: it only reads
    done = _told(response)
    return done._replace(data=yaml.safe_load(response.yaml)) if done.ok else done


def _settings(driver: Driver, args: Args) -> CallResult:
    if not driver.offers("get_settings"):
        raise WrongRequest("this driver does not offer get_settings, which reads them")
    done = _told(_call(driver, "get_settings", "std_srvs/Trigger"))
    return CallResult(True, "", json.loads(done.message)) if done.ok else done


REQUESTS: Dict[str, Request] = {
    "power": Request(_switch("power"), LONG_S), "enable": Request(_switch("enable"), LONG_S),
    "drag": Request(_switch("drag_mode")), "recover": Request(_trigger("recover"), LONG_S),
    "clear_err": Request(_clear_err), "pause": Request(_trigger("pause")),
    "resume": Request(_trigger("resume"), is_motion=True, begins=True),
    "zero_force": Request(_trigger("zero_ftsensor")),
    "speed": Request(_speed), "set_output": Request(_set_output), "get_io": Request(_get_io, needs_control=False),
    "tool_frame": Request(_tool_frame), "user_frame": Request(_user_frame), "payload": Request(_payload),
    "collision": Request(_collision), "settings": Request(_settings, needs_control=False),
    "joint_move": Request(_joint_move, MOTION_S, is_motion=True, begins=True),
    "linear_move": Request(_linear_move, MOTION_S, is_motion=True, begins=True),
    "fk": Request(_fk, needs_control=False), "ik": Request(_ik, needs_control=False),
    "program_load": Request(_program_load),
    "zones": Request(_zones, needs_control=False),
    "program_play": Request(_trigger("program/play"), begins=True),
    "program_pause": Request(_trigger("program/pause")),
    "program_resume": Request(_trigger("program/resume"), begins=True),
    "program_stop": Request(_trigger("program/stop"))}
"""Requests by the name that pages use."""
