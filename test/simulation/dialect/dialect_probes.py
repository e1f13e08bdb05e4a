"""One probe for each dimension: a client's view of a controller, which must differ with each value."""
import json

from raw_client import RawClient

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S
from jaka_ros_driver.simulation.controller.executor import Controller, ReplyLine
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import LinkLoss, Options, Start
from jaka_ros_driver.simulation.simulated_controller import SimulatedController

HOME = [0.0, 90.0, -90.0, 90.0, 90.0, 0.0]
NEVER = 60.0


class Wire:
    """One client of a controller's core: it asks, waits, and looks at frames."""

    def __init__(self, dialect, start=Start.ENABLED, firmware="1.5.14"):
        self.controller = Controller(load_model("zu7"), FIRMWARES[firmware], Options(dialect, start))
        self.line = ReplyLine()
        self.time = 0.0

    def send(self, command, **parameters):
        self.line.add(self.controller.execute({"cmdName": command, **parameters}))

    def ask(self, command, **parameters):
        """Send a request, and return its reply after waiting for it."""
        self.send(command, **parameters)
        return self.until(self.replies)[-1]

    def replies(self):
        return [json.loads(result.due_reply()) for result in self.line.take_due()]

    def replies_within(self, seconds):
        """Return the replies while so much time passes; they are taken in every cycle, as by the server."""
        came = self.replies()
        for _ in range(round(seconds / CYCLE_TIME_S)):
            self.step()
            came += self.replies()
        return came

    def step(self, seconds=CYCLE_TIME_S):
        for _ in range(max(1, round(seconds / CYCLE_TIME_S))):
            self.controller.step(CYCLE_TIME_S)
            self.time += CYCLE_TIME_S

    def until(self, condition, timeout=NEVER):
        """Return the condition's value when it is true; None where it is not within the time."""
        end = self.time + timeout
        while self.time < end:
            value = condition()
            if value:
                return value
            self.step()
        return None

    def time_until(self, condition, timeout=NEVER):
        began = self.time
        return round(self.time - began, 3) if self.until(condition, timeout) else None

    def frame(self):
        return json.loads(self.controller.feed_frame.text())

    def joint(self):
        return self.frame()["joint_actual_position"][0]

    def is_moving(self):
        before = self.joint()
        self.step()
        return self.joint() != before

    def move(self, degrees=20.0, speed=20.0):
        return self.ask("joint_move", jointPosition=[degrees, *HOME[1:]], speed=speed, accel=200.0)

    def stream(self, count=30, step=0.1):
        self.ask("servo_move", relFlag=1)
        for number in range(count):
            self.send("servo_j", relFlag=1, jointPosition=[step, 0, 0, 0, 0, 0])
            if number > 1:
                self.step()


def reply_time(command, start=Start.ENABLED, **parameters):
    """Return when the reply comes, and whether the request has taken effect then."""
    def probe(dialect):
        wire = Wire(dialect, start)
        wire.send(command, **parameters)
        came = wire.time_until(wire.replies, 30.0)
        frame = wire.frame()
        return came, [frame.get(key) for key in ("powered_on", "enabled", "current_tool_id", "drag_status")]
    return probe


def effect_time(command, key, start=Start.ENABLED, **parameters):
    def probe(dialect):
        wire = Wire(dialect, start)
        before = wire.frame()[key]
        wire.send(command, **parameters)
        return wire.time_until(lambda: wire.frame()[key] != before)
    return probe


def behind_slow_reply(dialect):
    wire = Wire(dialect, Start.OFF)
    wire.send("power_on")
    if not wire.line.is_blocked:
        wire.send("set_payload", mass=1.0, centroid=[0, 0, 0])
    first = [reply["cmdName"] for reply in wire.replies()]
    return first, wire.controller.state.memory.payload.mass


def start_delay(dialect):
    wire = Wire(dialect)
    assert wire.move()["errorCode"] == "0"
    moved = wire.time_until(wire.is_moving)
    wire = Wire(dialect)
    assert wire.ask("jog", jog_mode=1, coord_map=1, jnum=0, jogvel=5.0)["errorCode"] == "0"
    assert wire.time_until(wire.is_moving) == moved
    return moved


def move_takes(dialect):
    wire = Wire(dialect)
    assert wire.move()["errorCode"] == "0"
    wire.time_until(wire.is_moving)
    return wire.time_until(lambda: not wire.is_moving())


def joint_blend(dialect):
    """Return how long two moves take: alike with a tolerance, without one, there and back, and the second slower."""
    took = []
    for tolerance, target, speed in ((5.0, 20.0, 20.0), (0.0, 20.0, 20.0), (5.0, 5.0, 20.0), (5.0, 20.0, 10.0)):
        wire = Wire(dialect)
        for place, rate, line in ((10.0, 20.0, 7), (target, speed, 8)):
            assert wire.ask("joint_move", jointPosition=[place, *HOME[1:]], speed=rate, accel=40.0, tol=tolerance,
                            executing_line_id=line)["errorCode"] == "0"
        wire.step(0.2)
        assert [wire.ask("get_motion_state")[key] for key in ("queue", "motion_line")] == [2, 7]
        took.append(wire.time_until(lambda: not wire.is_moving() and wire.frame()["inpos"]))  # noqa: B023
        assert abs(wire.joint() - target) < 1e-3 and wire.ask("get_motion_state")["motion_line"] == 8
    return took


def inpos(dialect):
    wire = Wire(dialect)
    wire.move()
    seen = []
    for _ in range(500):
        wire.step()
        seen.append(wire.frame()["inpos"])
        assert wire.ask("get_motion_state")["inpos"] is seen[-1]
    return seen


def stop_ends_jog(dialect):
    wire = Wire(dialect)
    wire.ask("jog", jog_mode=1, coord_map=1, jnum=0, jogvel=5.0)
    wire.step(0.5)
    assert wire.ask("stop_program")["errorCode"] == "0"
    wire.step(0.5)
    moves = wire.is_moving()
    wire.ask("jog", jog_mode=0, coord_map=1, jnum=0)
    wire.step(0.5)
    assert not wire.is_moving(), "the jog's own stop must end it"
    return moves


def stop_ends_servo(dialect):
    wire = Wire(dialect)
    wire.stream(60)
    for _ in range(20):
        wire.send("servo_j", relFlag=1, jointPosition=[0.1, 0, 0, 0, 0, 0])
    at = wire.joint()
    assert wire.ask("stop_program")["errorCode"] == "0"
    wire.step(1.0)
    ran_on = round(wire.joint() - at, 1) > 1.0
    wire.ask("servo_move", relFlag=0)
    wire.step(0.5)
    assert not wire.is_moving() and wire.ask("is_in_servomove")["in_servomove"] is False
    return ran_on


def stop_ends_program(dialect):
    wire = Wire(dialect)
    wire.ask("load_program", programName="abc.jks")
    wire.ask("play_program")
    wire.ask("stop_program")
    return wire.ask("get_program_state")["programState"]


def jog_stop_ends(dialect):
    wire = Wire(dialect)
    wire.ask("jog", jog_mode=1, coord_map=1, jnum=0, jogvel=5.0)
    wire.step(0.3)
    wire.ask("jog", jog_mode=0, coord_map=1, jnum=3)
    wire.step(0.5)
    return wire.is_moving()


def pause_pauses_moves(dialect):
    wire = Wire(dialect)
    wire.move()
    wire.step(0.3)
    wire.ask("pause_program")
    wire.step(0.3)
    return wire.is_moving()


def servo_leave_delay(dialect):
    wire = Wire(dialect)
    wire.ask("servo_move", relFlag=1)
    wire.ask("servo_move", relFlag=0)
    lasted = wire.time_until(lambda: wire.ask("is_in_servomove")["in_servomove"] is False)
    wire.ask("servo_move", relFlag=1)
    wire.ask("servo_move", relFlag=0)
    assert wire.ask("servo_j", jointPosition=HOME)["errorCode"] == "-1"
    assert (wire.move()["errorCode"] == "0") == (lasted == 0.0)
    return lasted


def starvation(dialect):
    wire = Wire(dialect)
    wire.stream(30)
    wire.step(0.5)
    return round(wire.joint(), 2), wire.ask("is_in_servomove")["in_servomove"], wire.is_moving()


def servo_queue(dialect):
    wire = Wire(dialect)
    wire.stream(5)
    at = wire.joint()
    for _ in range(60):
        wire.send("servo_j", relFlag=1, jointPosition=[0.1, 0, 0, 0, 0, 0])
    wire.step(1.0)
    return round((wire.joint() - at) / 0.1)


def stop_drops_frames(dialect):
    ran_on = []
    for stop in ({"command": "stop_program"}, {"command": "servo_move", "relFlag": 0}):
        wire = Wire(dialect)
        wire.stream(60)
        for _ in range(20):
            wire.send("servo_j", relFlag=1, jointPosition=[0.1, 0, 0, 0, 0, 0])
        at = wire.joint()
        assert wire.ask(**stop)["errorCode"] == "0"
        wire.step(1.0)
        assert not wire.is_moving()
        ran_on.append(wire.joint() - at > 1.9)
    assert ran_on[0] is ran_on[1]
    return ran_on


def refused_move_event(dialect):
    wire = Wire(dialect)
    assert wire.ask("moveL", cartPosition=[9000.0, 0, 0, 0, 0, 0], speed=10.0)["errorMsg"] == "call moveL failed"
    wire.step(0.1)
    shown = wire.frame()["errcode"]
    assert wire.move()["errorCode"] == "0" and wire.frame()["errcode"] == "0x0", "it must latch nothing"
    return shown


def disabled_note(dialect):
    wire = Wire(dialect)
    wire.ask("disable_robot")
    assert wire.frame()["errcode"] == "0x10f0005"
    wire.step(5.0)
    return wire.frame()["errcode"]


def is_served(client):
    try:
        return client.ask("get_version")["errorCode"] == "0"
    except OSError:
        return False


def second_client(dialect):
    with SimulatedController(dialect=dialect) as arm, RawClient(arm.command_port) as first:
        assert first.ask("get_version")["version"]
        with RawClient(arm.command_port) as second:
            return is_served(second), is_served(first)


def link_loss_notice(dialect):
    wire = Wire(dialect)
    wire.ask("set_network_exception_handle", timeLimit=300, motType=int(LinkLoss.ABORT))
    wire.move(80.0, 5.0)
    wire.step(0.5)
    wire.controller.state.client_lost()
    return wire.time_until(lambda: not wire.is_moving())


def missing_commands(dialect):
    wire = Wire(dialect)
    asked = {
        "set_network_exception_handle": {"timeLimit": 0, "motType": 0}, "emergency_stop_status": {},
        "get_motion_state": {}, "wait_complete": {}, "torque_control_enable": {"enable_flag": 0},
        "set_port10000_delay_ms": {"port10000_delay_ms": 20}}
    return [(command, "cmdName" in wire.ask(command, **parameters)) for command, parameters in asked.items()]


def error_code(dialect):
    wire = Wire(dialect)
    codes = [wire.ask("get_version")["errorCode"], wire.ask("no_such")["errorCode"],
             wire.ask("servo_j", jointPosition=HOME)["errorCode"]]
    assert [int(code) for code in codes] == [0, 1, -1]
    return codes


def unready_code(dialect):
    code = Wire(dialect, Start.OFF).move()["errorCode"]
    wire = Wire(dialect, Start.POWERED)
    codes = [code, wire.move()["errorCode"]]
    wire.controller.state.press_emergency_stop()
    return [*codes, wire.move()["errorCode"]]


def user_frame_key(dialect):
    wire = Wire(dialect)
    return [wire.ask("set_user_offsets", id=1, name="", **{key: [1, 2, 3, 0, 0, 0]})["errorCode"]
            for key in ("userffset", "useroffset")]


def io_index_base(dialect):
    wire = Wire(dialect)
    wire.ask("set_digital_output", type=0, index=3, value=1)
    return wire.frame()["dout"].index(1), wire.ask("get_digital_output", type=0, index=0)["errorCode"]


def feed_period_persists(dialect):
    wire = Wire(dialect)
    wire.ask("set_port10000_delay_ms", port10000_delay_ms=77)
    wire.controller.restart()
    return wire.ask("get_port10000_delay_ms")["port10000_delay_ms"]


def shortest_feed_period(dialect):
    wire = Wire(dialect)
    wire.ask("set_port10000_delay_ms", port10000_delay_ms=1)
    assert wire.ask("get_port10000_delay_ms")["port10000_delay_ms"] == 1
    return wire.controller.state.feed_period  # the server sends at this period, see the test of it


def frame_bytes(dialect):
    frame = Wire(dialect).controller.feed_frame.text()
    assert json.loads(frame)["len"] == len(frame) and (not dialect.frame_bytes or len(frame) <= 15000)
    return len(frame)


PROBES = {
    "power_delay": effect_time("power_on", "powered_on", Start.OFF),
    "power_reply": reply_time("power_on", Start.OFF),
    "power_reply_delay": reply_time("power_on", Start.OFF),
    "enable_delay": effect_time("enable_robot", "enabled", Start.POWERED),
    "enable_reply": reply_time("enable_robot", Start.POWERED),
    "enable_reply_delay": reply_time("enable_robot", Start.POWERED),
    "frame_delay": effect_time("set_tool_id", "current_tool_id", tool_id=2),
    "frame_reply": reply_time("set_tool_id", tool_id=2),
    "frame_reply_delay": reply_time("set_tool_id", tool_id=2),
    "drag_delay": effect_time("torque_control_enable", "drag_status", enable_flag=1),
    "drag_reply": reply_time("torque_control_enable", enable_flag=1),
    "drag_reply_delay": reply_time("torque_control_enable", enable_flag=1),
    "behind_slow_reply": behind_slow_reply,
    "start_delay": start_delay,
    "move_acceleration": move_takes,
    "move_jerk_time": move_takes,
    "joint_blend": joint_blend,
    "inpos": inpos,
    "stop_ends_jog": stop_ends_jog,
    "stop_ends_servo": stop_ends_servo,
    "stop_ends_program": stop_ends_program,
    "jog_stop_ends": jog_stop_ends,
    "pause_pauses_moves": pause_pauses_moves,
    "servo_leave_delay": servo_leave_delay,
    "starvation": starvation,
    "servo_queue": servo_queue,
    "stop_drops_frames": stop_drops_frames,
    "refused_move_event": refused_move_event,
    "disabled_note": disabled_note,
    "second_client": second_client,
    "link_loss_notice": link_loss_notice,
    "missing_commands": missing_commands,
    "error_code": error_code,
    "unready_code": unready_code,
    "robot_state": lambda dialect: sorted(Wire(dialect).ask("get_robot_state").items(), key=str),
    "sensitivity_key": lambda dialect: sorted(Wire(dialect).ask("get_clsn_sensitivity")),
    "user_frame_key": user_frame_key,
    "io_index_base": io_index_base,
    "unknown_reply_fields": lambda dialect: sorted(Wire(dialect).ask("get_joint_pos")),
    "feed_period": lambda dialect: Wire(dialect).ask("get_port10000_delay_ms")["port10000_delay_ms"],
    "shortest_feed_period": shortest_feed_period,
    "feed_period_persists": feed_period_persists,
    "frame_bytes": frame_bytes,
    "unknown_frame_fields": lambda dialect: list(Wire(dialect).frame()),
    "missing_frame_fields": lambda dialect: list(Wire(dialect).frame()),
}
CONTEXT = {  # what else a dialect must be for a dimension to show
    "drag_reply": {"drag_delay": 1.0},
    "behind_slow_reply": {"power_reply": "held"},
}
