"""The checks of a controller: its ports, its status feed, its answers, the model against the arm.

The command port is connected only while ``ExaminedSystem.refusal`` has nothing against it.
"""
import errno
import socket
from typing import Any, Dict, Optional, Tuple

from jaka_ros_driver.client.core.procedures.session import io_index_base
from jaka_ros_driver.commands import Pose, Query
from jaka_ros_driver.doctor.findings import Examination, Observation, fault, good, skipped, warning
from jaka_ros_driver.doctor.questions import CONNECT_S
from jaka_ros_driver.doctor.subject import ExaminedSystem
from jaka_ros_driver.kinematics.pose_check import deviation
from jaka_ros_driver.kinematics.rotations import Transform, transform_from_pose
from jaka_ros_driver.protocol.ports import endpoint
from jaka_ros_driver.ros.frame_table import frame_of

_NOT_NAMED = skipped("no controller was named", "jaka_doctor ip:=ADDRESS")
_SLOW_SHARE = 0.8
"""Share of the rate that the driver will ask for, below which the page says so: a count over a second or two is no more
exact."""
_LATE_S = 0.1
"""Pause, s, between two frames that is worth a warning: one frame of the slowest feed (10 Hz)."""


def route(subject: ExaminedSystem) -> Observation:
    """Check that the controller's name has an address, and which address of this computer is used to reach it."""
    if not subject.has_controller:
        return _NOT_NAMED
    config = subject.config
    try:
        family, kind, _, _, address = socket.getaddrinfo(config.ip, config.status_port, type=socket.SOCK_DGRAM)[0]
        with socket.socket(family, kind) as probe:
            probe.connect(address)  # sends nothing
            own = probe.getsockname()[0]
    except (OSError, UnicodeError) as error:
        return fault("%s: %s" % (config.ip, error), "there is no way to the controller, or no such name",
                     "give this computer an address in the controller's network; correct ip")
    return good("%s is reached from %s" % (config.ip, own), "there is a way to the controller's network")


def status_port(subject: ExaminedSystem) -> Observation:
    """Check that the status port can be connected, and tell a refusal from silence."""
    if not subject.has_controller:
        return _NOT_NAMED
    error = subject.feed.error
    return (good("%s is connected" % endpoint(subject.config.ip, subject.config.status_port), "states can come")
            if error is None else _port_fault(subject.config.ip, subject.config.status_port, "~status_port", error))


def feed(subject: ExaminedSystem) -> Observation:
    """Check that usable states come in time from the status port."""
    if not subject.has_controller or subject.feed.error is not None:
        return skipped("the status port is not connected", "see status port")
    came, config = subject.feed, subject.config
    found = "%d states in %.1f s, %d damaged" % (len(came.states), came.seconds, came.damaged)
    if not came.states and came.damaged:
        return fault(found, "this is no status feed that the driver understands",
                     "is it the controller's status port (10000)? send the bundle")
    if len(came.states) < 2 or came.was_closed:
        return fault("%s%s" % (found, ", and the port was closed" if came.was_closed else ""),
                     "the driver moves nothing without states",
                     "is the controller still starting, or its feed switched off? restart it")
    times = [*(state.received_at for state in came.states), came.ended_at]
    gap = max((b - a for a, b in zip(times, times[1:])), default=0.0)
    rate = (len(came.states) - 1) / max(times[-2] - times[0], 1e-6)
    found = "%s, %.0f Hz, longest pause %.3f s" % (found, rate, gap)
    if came.damaged:
        return warning(found, "damaged frames are left out", "check cable and network")
    if gap > max(_LATE_S, 3.0 / rate):
        return warning(found, "states come irregularly: late ones may stop a motion",
                       "check load of this computer and of the network")
    if rate < _SLOW_SHARE * config.publish_rate:
        return good(found, "the driver asks for more at its start")
    return good(found, "states come as they should")


def command_port(subject: ExaminedSystem) -> Observation:
    """Check that the controller answers on its command port, and keeps the connection."""
    if not subject.has_controller:
        return _NOT_NAMED
    refusal = subject.refusal
    if refusal is not None:
        left_alone = "left alone: " + refusal.reason
        if refusal.is_driven_here:
            return good(left_alone, "the connection is the driver's")
        return skipped(left_alone, "try again when the arm rests, and the status port shows it")
    config, answers = subject.config, subject.answers
    where = endpoint(config.ip, config.command_port)
    if answers.error is not None:
        return _port_fault(config.ip, config.command_port, "~command_port", answers.error)
    if answers.was_closed:
        return fault("%s ends the connection" % where,
                     "another client has the controller: the arm obeys that one, and the driver gives way",
                     "end the other client: another driver, the maker's App or SDK, a PLC")
    if answers.is_silent:
        return fault("%s is connected and does not answer" % where, "nothing can be asked of the arm, not even a stop",
                     "is it the command port (10001)? does another client hold it? restart the controller")
    return good("%s answers and stays connected" % where, "no other client has taken it")


def firmware(subject: ExaminedSystem) -> Observation:
    """Check the controller's version, and how the driver counts its terminals for it."""
    answers, why = _answers(subject)
    if why is not None:
        return why
    version = answers.get(Query.VERSION, "")
    if not version:
        return warning("the controller does not tell its version", "the driver counts its terminals from 0",
                       "see ~io_index_base; try one output before you rely on it")
    config = subject.config
    base = config.sent_index_base if config.sent_index_base is not None else io_index_base(
        config.client_settings(), version)
    period = answers.get(Query.FEED_PERIOD)
    return good("version %s, feed period %s, servo mode %s; interface %s, terminals are counted from %d" % (
        version, "unknown" if period is None else "%.3f s" % period,
        "on" if answers.get(Query.SERVO_MODE) else "off", config.interface, base),
        "what the driver would use")


def model(subject: ExaminedSystem) -> Observation:
    """Compare the model with the arm, as the driver does: the pose of the tool that both compute from the joints."""
    if subject.wrong:
        return skipped("the parameters are wrong", "see parameters")
    answers, why = _answers(subject)
    if why is not None:
        return why
    state, arm = subject.feed.states[-1], subject.config.arm_model()
    found = None if not state.is_in_position else deviation(
        arm, state, frame_of(_frames(answers.get(Query.TOOL_FRAMES)), state.tool_id),
        frame_of(_frames(answers.get(Query.USER_FRAMES)), state.user_frame_id))
    if found is None:
        return skipped("the controller tells no pose, tool or user frame, or the arm moves")
    text = "model %s: the tool is %.1f mm and %.4f rad from where the controller has it" % (
        arm.name, found.distance * 1000.0, found.angle)
    if found.is_wrong:
        return fault(text, "limits and paths are computed for another arm than this one",
                     "set model to this arm; for a calibrated arm give its model file (dh_file)")
    return good(text, "the model is that of the arm")


def _answers(subject: ExaminedSystem) -> Tuple[Dict[Query, Any], Optional[Observation]]:
    """Return the controller's answers, and the finding in place of a check where there are none."""
    if not subject.has_controller:
        return {}, _NOT_NAMED
    if subject.refusal is not None or subject.answers.error is not None or not (
            subject.answers.values or subject.answers.refusals):
        return {}, skipped("the command port was not asked", "see command port")
    return subject.answers.values, None


def _frames(poses: Optional[Tuple[Pose, ...]]) -> Optional[Tuple[Transform, ...]]:
    return None if poses is None else tuple(map(transform_from_pose, poses))


def _port_fault(host: str, port: int, parameter: str, error: OSError) -> Observation:
    where = endpoint(host, port)
    if isinstance(error, ConnectionRefusedError):
        return fault("%s: connection refused" % where, "that computer is there, and nothing listens at this port",
                     "is it the controller? has it started? is %s right?" % parameter)
    if isinstance(error, socket.timeout) or error.errno == errno.ETIMEDOUT:
        return fault("%s: no answer in %.0f s" % (where, CONNECT_S),
                     "nobody is there, or a firewall drops what is sent without a word",
                     "power, cable, address ip; ping %s; a firewall here or between (nft list ruleset)" % host)
    return fault("%s: %s" % (where, error.strerror or error), "there is no way to the controller, or no such name",
                 "cable, this computer's address in the controller's network, ip")


CHECKS = (
    Examination("way to the controller", route),
    Examination("status port", status_port),
    Examination("status feed", feed),
    Examination("command port", command_port),
    Examination("firmware", firmware),
    Examination("model", model),
)
