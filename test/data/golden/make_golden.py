#!/usr/bin/env python3
"""Maker of the golden logs of this folder.

    build/venv/bin/python3 test/data/golden/make_golden.py [NAME ...]

Each session below is a list of service calls, and of the operator's actions at the simulated controller. It runs
against the driver and simulated controllers of this checkout and is recorded with ``jaka_bag record``. A golden log
is made again only when the driver's behaviour has changed on purpose: look at the comparison with the old one first.

Needs ROS, and the messages of jaka_msgs (tools/dev setup).
"""
import argparse
import io
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence, Tuple

import yaml
from roslib.message import get_message_class, get_service_class

FOLDER = Path(__file__).resolve().parent
sys.path[:0] = [str(FOLDER.parents[2]), str(FOLDER.parents[2] / "tools")]

from jaka_bag.compare.runs.loading import load_run  # noqa: E402 - the checkout, wherever it is started from
from jaka_bag.compare.runs.run import Call  # noqa: E402
from jaka_bag.containers.mcap.writer import McapWriter  # noqa: E402
from jaka_bag.messages.connection import Connection  # noqa: E402
from jaka_regression.replay import Script, record_script  # noqa: E402
from jaka_regression.scenario import parse_scenario  # noqa: E402
from jaka_ros_driver.kinematics.arm_models import load_model  # noqa: E402
from jaka_ros_driver.kinematics.forward import forward  # noqa: E402
from jaka_ros_driver.kinematics.rotations import pose_from_transform, rotation_vector_from_rpy  # noqa: E402
from jaka_ros_driver.simulation.arm.plant import HOME  # noqa: E402
from jaka_ros_driver.units import all_m_to_mm  # noqa: E402

LICENCE = "CC0-1.0: made by a program, free for any use"
TOPICS = ("tool_position", "joint_position", "robot_states", "service_calls")
EPOCH_NS = 1700000000 * 10 ** 9


@dataclass(frozen=True)
class Step:
    """One call.

    Attributes:
        pause_s: After the call before has ended, or with ``overlaps`` after it has begun.
        service: Name below the node.
        fields: Fields of the request.
        lasts_s: About how long it takes.
        overlaps: The call before is still running.
        arm: Namespace.
        success: The expected success.
    """

    pause_s: float
    service: str
    fields: Dict[str, Any]
    lasts_s: float = 0.02
    overlaps: bool = False
    arm: str = ""
    success: bool = True


@dataclass(frozen=True)
class Session:
    """One golden log."""

    about: str
    steps: Tuple[Step, ...] = ()
    rest: Optional[Dict[str, Any]] = None
    duration_s: float = 0.0


TYPES = {"joint_move": "jaka_msgs/Move", "linear_move": "jaka_msgs/Move", "jog": "jaka_msgs/Move",
         "servo_move_enable": "jaka_msgs/ServoMoveEnable", "servo_j": "jaka_msgs/ServoMove",
         "servo_p": "jaka_msgs/ServoMove", "stop_move": "std_srvs/Empty", "clear_err": "jaka_msgs/ClearErr",
         "power": "std_srvs/SetBool", "enable": "std_srvs/SetBool", "set_io": "jaka_msgs/SetIO",
         "get_io": "jaka_msgs/GetIO"}


def joints(pause_s: float, change: Sequence[float], speed: float = 0.6, **further: Any) -> Step:
    """Return a joint move to HOME plus a change, rad."""
    pose = [round(a + b, 4) for a, b in zip(HOME, change)]
    return Step(pause_s, "joint_move", {"pose": pose, "mvvelo": speed, "mvacc": 1.5}, 1.5, **further)


def line(pause_s: float, shift_mm: Sequence[float], turn: Sequence[float] = (0.0, 0.0, 0.0)) -> Step:
    """Return a linear move to the pose of HOME plus a shift, mm, with a turn added to its rotation vector, rad."""
    model = load_model("zu7")
    pose = pose_from_transform(forward(model, HOME))
    vector = rotation_vector_from_rpy(pose.rpy)
    target = [round(a + b, 3) for a, b in zip(all_m_to_mm(pose.position), shift_mm)]
    target += [round(a + b, 5) for a, b in zip(vector, turn)]
    return Step(pause_s, "linear_move", {"pose": target, "mvvelo": 80.0, "mvacc": 300.0}, 1.5)


def jog(pause_s: float, index: int, speed: float, **further: Any) -> Step:
    """Return a jog of a joint, rad/s."""
    return Step(pause_s, "jog", {"mvvelo": speed, "coord_mode": 0, "index": index}, **further)


def _servo_stream() -> List[Step]:
    """Return a second and a half of joint targets every 32 ms: joint 1 to and fro on a smooth curve, and back to
    rest."""
    steps = [Step(0.5, "servo_move_enable", {"enable": True}, 0.1)]
    count = 48
    for number in range(1, count + 1):
        part = number / count
        smooth = 16.0 * part ** 2 * (1.0 - part) ** 2
        pose = [round(HOME[0] + 0.12 * smooth, 5)] + [round(value, 5) for value in HOME[1:]]
        steps.append(Step(0.3 if number == 1 else 0.032, "servo_j", {"pose": pose}, 0.002, overlaps=number > 1))
    return [*steps, Step(0.5, "servo_move_enable", {"enable": False}, 0.1)]


def both(step: Step) -> List[Step]:
    """Return the same step for two arms at once, mirrored."""
    fields = dict(step.fields, pose=[-step.fields["pose"][0]] + step.fields["pose"][1:])
    return [Step(step.pause_s, step.service, step.fields, step.lasts_s, False, "/left"),
            Step(0.05, step.service, fields, step.lasts_s, True, "/right")]


SESSIONS: Dict[str, Session] = {
    "boot": Session("The driver starts and powers and enables an arm that was off (auto_enable).", (), {
        "arms": [{"simulation": ["--start", "off", "--power-delay", "1", "--enable-delay", "1"]}]}, 7.0),
    "joint_moves": Session("Four joint moves, one after the other.", (
        joints(1.0, (0.5, -0.2, 0.3, 0.0, 0.1, 0.4)), joints(0.4, (-0.4, 0.1, -0.2, 0.3, -0.2, 0.0)),
        joints(0.4, (0.0, 0.3, 0.2, -0.3, 0.3, -0.5), 0.9), joints(0.4, (0.0,) * 6))),
    "linear_moves": Session("A rectangle of straight lines with a turn of the tool.", (
        line(1.0, (60.0, 0.0, 0.0)), line(0.4, (60.0, 80.0, 0.0), (0.0, 0.0, 0.1)),
        line(0.4, (0.0, 80.0, -40.0), (0.05, 0.0, 0.1)), line(0.4, (0.0, 0.0, 0.0)))),
    "jog_watchdog": Session("A jog that nobody ends: the driver stops it after 3 s. Then one that stop_move ends.", (
        jog(1.0, 0, 0.15), jog(4.0, 3, 0.15), Step(0.8, "stop_move", {}))),
    "servo_stream": Session("Servo mode and a stream of joint targets.", tuple(_servo_stream()), {
        "tolerances": {"states": {"timing_s": 0.5}}}),  # the controller tells of short rests between two targets
    "stop_in_mid_move": Session("stop_move while a joint move is under way; then the move again.", (
        joints(1.0, (0.8, 0.0, 0.0, 0.0, 0.0, 0.0), success=False), Step(0.7, "stop_move", {}, overlaps=True),
        joints(1.0, (0.8, 0.0, 0.0, 0.0, 0.0, 0.0)), joints(0.4, (0.0,) * 6))),
    "collision": Session("The arm is hit in the middle of a move; clear_err, and the move again.", (
        joints(1.0, (0.8, 0.2, 0.0, 0.0, 0.0, 0.0), success=False), Step(1.5, "clear_err", {}, 1.0),
        joints(0.8, (0.8, 0.2, 0.0, 0.0, 0.0, 0.0)), joints(0.4, (0.0,) * 6)), {
        "events": [{"after_call": 0, "delay_s": 0.7, "action": "hit", "force": 300}]}),
    "emergency_stop": Session(
        "The emergency stop button is pressed in the middle of a move and released; clear_err, power, enable, move.", (
            joints(1.0, (0.0, 0.0, 0.8, 0.0, 0.0, 0.0), success=False), Step(2.5, "clear_err", {}, 1.0),
            Step(0.3, "power", {"data": True}, 2.0), Step(0.3, "enable", {"data": True}, 2.0),
            joints(0.8, (0.0,) * 6)), {
        "arms": [{"simulation": ["--start", "enabled", "--power-delay", "1", "--enable-delay", "1"]}],
        "events": [{"after_call": 0, "delay_s": 0.7, "action": "press_emergency_stop"},
                   {"after_call": 0, "delay_s": 2.0, "action": "release_emergency_stop"}]}),
    "reconnect": Session("The controller closes all connections, refuses new ones for two seconds; moves around it.", (
        joints(1.0, (0.4, 0.0, 0.0, 0.2, 0.0, 0.0)), joints(5.0, (0.0,) * 6)), {
        "events": [{"after_call": 0, "delay_s": 2.5, "action": "refuse", "duration_ms": 2000},
                   {"after_call": 0, "delay_s": 2.55, "action": "close"}]}),
    "io_sequence": Session("Outputs are set and read back; an input changes and is read.", (
        Step(1.0, "set_io", {"signal": "digital", "type": 0, "index": 1, "value": 1.0}, 0.1),
        Step(0.3, "get_io", {"signal": "digital", "path": 1, "type": 0, "index": 1}, 0.1),
        Step(0.3, "set_io", {"signal": "analog", "type": 0, "index": 0, "value": 2.5}, 0.1),
        Step(0.3, "get_io", {"signal": "analog", "path": 1, "type": 0, "index": 0}, 0.1),
        Step(0.3, "get_io", {"signal": "digital", "path": 0, "type": 0, "index": 2}, 0.1),
        Step(1.5, "get_io", {"signal": "digital", "path": 0, "type": 0, "index": 2}, 0.1),
        Step(0.3, "set_io", {"signal": "digital", "type": 0, "index": 1, "value": 0.0}, 0.1)), {
        "events": [{"after_call": 4, "delay_s": 0.6, "action": "set_input", "index": 2, "value": 1}]}),
    "two_arms": Session("Two arms in namespaces of their own move at the same time.", tuple(
        step for pause, change in ((1.0, (0.5, -0.2, 0.0, 0.2, 0.0, 0.0)), (0.5, (0.0, 0.2, -0.3, 0.0, 0.2, 0.0)),
                                   (0.5, (0.0,) * 6)) for step in both(joints(pause, change))), {
        "arms": [{"namespace": "/left"}, {"namespace": "/right"}]}),
}


def serialised(message: Any) -> bytes:
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def calls_of(steps: Sequence[Step]) -> List[Call]:
    """Return the calls as a log would record them."""
    calls: List[Call] = []
    for step in steps:
        if not calls:
            start = step.pause_s
        elif step.overlaps:
            start = calls[-1].start + step.pause_s
        else:
            start = max(call.end for call in calls) + step.pause_s
        service = get_service_class(TYPES[step.service])
        request = service._request_class(**step.fields)
        calls.append(Call("", start, step.lasts_s, "%s/jaka_driver/%s" % (step.arm, step.service),
                          TYPES[step.service], service._md5sum, serialised(request), b"", step.success, "",
                          str(request), ""))
    return calls


def write_calls(path: Path, calls: Sequence[Call]) -> None:
    """Write a log of nothing but calls, for jaka_bag replay-commands."""
    kind = get_message_class("jaka_msgs/ServiceCall")
    with McapWriter(path) as writer:
        channel = writer.add_channel(Connection("/calls", kind._type, kind._md5sum, kind._full_text))
        for call in calls:
            message = kind(service=call.service, service_type=call.service_type, md5sum=call.md5sum,
                           request=call.request, request_text=call.request_text, duration=call.duration,
                           success=call.success)
            nanoseconds = EPOCH_NS + int(call.start * 1e9)
            message.header.stamp.secs, message.header.stamp.nsecs = divmod(nanoseconds, 10 ** 9)
            writer.add_message(channel, EPOCH_NS if call is calls[0] else nanoseconds, serialised(message))


def make(name: str, session: Session) -> Path:
    """Record one golden log, beside its YAML file."""
    rest = dict(session.rest or {})
    text = yaml.safe_dump({"about": session.about + " Made by make_golden.py of this folder, with the driver and the "
                           "simulated controller of this project.", "licence": LICENCE, **rest}, sort_keys=False,
                          width=110, allow_unicode=True)
    scenario = parse_scenario(text, name)
    topics = tuple("%s/jaka_driver/%s" % (arm.namespace, topic) for arm in scenario.arms for topic in TOPICS)
    calls = calls_of(session.steps)
    with tempfile.TemporaryDirectory(prefix="make_golden_") as place:
        log = None
        if calls:
            log = str(Path(place, "calls.mcap"))
            write_calls(Path(log), calls)
        duration = session.duration_s or max(call.end for call in calls) + 1.0
        try:
            candidate = record_script(Script(log, tuple(calls), duration, topics), Path(place), scenario)
        except Exception:
            for output in sorted(Path(place).glob("*.log")):
                print("--- %s\n%s" % (output.name, output.read_text(errors="replace")[-3000:]), file=sys.stderr)
            raise
        run = load_run(candidate)
        target = FOLDER / (name + ".mcap")
        target.write_bytes(candidate.read_bytes())
    (FOLDER / (name + ".yaml")).write_text(text, encoding="utf-8")
    print("%s: %.1f s, %d calls, %d failed, %.0f kB" % (
        target.name, run.duration, len(run.calls), sum(not call.success for call in run.calls),
        target.stat().st_size / 1e3), flush=True)
    return target


def main() -> int:
    """Make the named golden logs, or all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SESSIONS))
    names = parser.parse_args().names or list(SESSIONS)
    unknown = [name for name in names if name not in SESSIONS]
    if unknown:
        parser.error("no golden log %s; there are %s" % (unknown[0], ", ".join(SESSIONS)))
    for name in names:
        make(name, SESSIONS[name])
    return 0


if __name__ == "__main__":
    sys.exit(main())
