"""Scenarios that once broke a rule, shortened to what it took; each name describes the defect.

Unlike seeds they keep their meaning when the generator changes. Some failed by a fault of the judge.
"""
from typing import Any, Dict, Tuple

from generator import Event, Scenario


def _scenario(*events: Tuple[float, str, Dict[str, Any]], seed: int = 1, length: float = 8.0, ends: str = "leave",
              settings: Dict[str, Any], **more: Any) -> Scenario:
    return Scenario(seed, length, tuple(Event(*event) for event in events), settings, ends=ends, **more)


_SETTINGS = {"feed_period": 0.03, "motion_timeout": 20.0, "servo_timeout": 2.0}


def _joint_move(joint: int, way: float, speed: float, wait: bool, caller: int = 0) -> Dict[str, Any]:
    delta = tuple(way if index == joint else 0.0 for index in range(6))
    return {"caller": caller, "delta": delta, "speed": speed, "acceleration": 4.0 + 4.0 * speed, "wait": wait}


def _linear_move(shift: Tuple[float, ...], turn: Tuple[float, ...], speed: float, wait: bool, caller: int = 0
                 ) -> Dict[str, Any]:
    return {"caller": caller, "shift": shift, "turn": turn, "speed": speed, "acceleration": 1.0 + 6.0 * speed,
            "wait": wait}


def _jogging(duration: float) -> Dict[str, Any]:
    return {"caller": 0, "frame": 1, "axis": 0, "velocity": 0.3, "rate": 10.0, "duration": duration, "then_back": False}


def _servo(duration: float) -> Dict[str, Any]:
    return {"caller": 1, "is_pose": False, "relative": False, "rate": 125.0, "duration": duration, "speed": 0.1,
            "form": "hold", "axis": 3, "burst": False, "leaves": False, "pause": 0.05}


_LONG_JOG = {"caller": 1, "frame": 0, "axis": 1, "speed": 0.3, "rate": 50.0, "duration": 1.0, "end": "nonsense",
             "says_rest": True}
KEPT: Dict[str, Scenario] = {
    "a feed that is faster than asked for was never believed again after a pause": _scenario(
        (1.0, "pause", {"duration": 0.3}), (2.0, "joint_move", _joint_move(0, 0.3, 1.0, True)),
        settings=dict(_SETTINGS, feed_period=0.1), dialect={"missing_commands": ("set_port10000_delay_ms",)}),
    "beside a simulated controller a status port that was lost was not connected again": _scenario(
        (2.0, "cut", {"port": "COMMAND", "driver_learns": True, "controller_learns": True}),
        (4.0, "cut", {"port": "STATUS", "driver_learns": True, "controller_learns": True}),
        settings=dict(_SETTINGS, simulator="twin"), identity="twin"),
    "the first frame of a link that was held up while nobody read was shown as new": _scenario(
        (0.2972, "rival", {"step": -0.3, "duration": 3.03161211311278}),
        (3.2591, "pause", {"duration": 0.5716785262555913}),
        (3.6721, "stall", {"port": "STATUS", "way": "to driver", "duration": 0.23015470964758422}),
        (3.8062, "feed_silent", {"duration": 4.541754804062747}), seed=2475720466, length=15.0, ends="close",
        settings=dict(_SETTINGS, feed_period=0.1, reply_timeout=0.4, link_loss_stop=0.3, stream_ahead=1),
        dialect={"second_client": "replaces", "missing_commands": ("wait_complete", "set_port10000_delay_ms")}),
    "a queued move that began late found nobody in custody": _scenario(
        (1.5, "queue", {"caller": 0, "joint": 0, "ways": (0.1, 0.105), "speed": 1.0, "first_waits": False,
                        "apart": 0.05}),
        (1.52, "late_start", {"delay": 1.5, "duration": 8.0}), settings=_SETTINGS),
    "a queue that comes by its last target was taken for done": _scenario(
        (1.0, "late_start", {"delay": 1.5, "duration": 8.0}),
        (1.5, "queue", {"caller": 0, "joint": 0, "ways": (0.1, 0.3, 0.1), "speed": 2.0, "first_waits": False,
                        "apart": 0.0}), seed=3, settings=_SETTINGS),
    "a move that was stopped at the pendant was completed by the one behind it": _scenario(
        (1.0, "linear_move", _linear_move((0.0, 0.0, 0.0), (0.07, 0.0, 0.0), 0.023, True)),
        (1.085, "pendant_stop", {}),
        (1.31, "linear_move", _linear_move((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.06, False, caller=2)),
        settings=_SETTINGS),
    "a move that never began was completed while the feed did not tell the pose": _scenario(
        (1.0, "late_start", {"delay": 1.5, "duration": 8.0}),
        (1.5, "linear_move", _linear_move((0.02, 0.0, 0.0), (0.0, 0.0, 0.0), 0.04, True)),
        (2.0, "feed_drops", {"fields": ("actual_position",), "duration": 2.0}), seed=8, settings=_SETTINGS),
    "of a path whose end was left at the pendant before a slow feed could tell, the judge did not know": _scenario(
        (1.3003, "slow_link", {"port": "STATUS", "carries": 0.85, "duration": 2.31212}),
        (1.9638, "path", {
            "segments": (("line", (0.023956, 0.055963, 0.05221, 0.0284846, 0.0164061, 0.0481644)),), "radius": 0.002,
            "speed": 0.3587254, "then": "", "then_after": 1.5491473, "caller": 1}),
        (2.9795, "pendant_move", {"joint": 3, "step": -0.3}), seed=2021350, settings=_SETTINGS,
        dialect={"inpos": "late"}),
    "a move was told that it is stopped while every stop was refused": _scenario(
        (1.0, "refuse_stop_for", {"duration": 4.0}), (1.1, "joint_move", _joint_move(5, -3.0, 1.0, True)),
        (1.35, "stop", {"caller": 9}),
        settings=_SETTINGS),
    "a status port was asked for twice when its controller had said who it is": _scenario(
        (1.0, "cut", {"port": "both", "driver_learns": True, "controller_learns": True}),
        (1.05, "stall", {"port": "STATUS", "way": "both", "duration": 0.3}),
        settings=dict(_SETTINGS, simulator="twin"), identity="twin"),
    "of a paused move the time went on for its judge": _scenario(
        (1.4, "joint_move", _joint_move(2, 1.04, 2.0, True, caller=1)),
        (1.97, "procedure", {"caller": 0, "name": "pause", "value": None}), length=14.0, ends="close",
        settings={"feed_period": 0.1, "motion_timeout": 4.0, "servo_timeout": 2.0}, latency=(0.0005, 0.005)),
    "a call waited behind power_on for its reply, held by another one": _scenario(
        (0.78, "servo_mode", {"caller": 0, "active": False}), length=25.0, ends="close",
        settings={"feed_period": 0.008, "reply_timeout": 0.4, "jog_timeout": 1.0, "servo_timeout": 2.0},
        start="off", auto_enable=True, has_turns=True, lateness=0.002,
        dialect={"power_reply": "held", "power_delay": 8.0, "enable_reply": "held"}),
    "a call waited behind power_on after an emergency stop": _scenario(
        (0.5, "maintenance", {"every": 2.0}), (7.7147, "emergency_stop", {"held": 0.1185}),
        (8.8754, "servo_mode", {"caller": 0, "active": False}), length=15.0,
        settings={"feed_period": 0.03, "reply_timeout": 0.4, "enable_timeout": 3.0, "link_loss_stop": 0.0},
        has_turns=True, dialect={"power_reply": "held", "power_delay": 8.0, "enable_reply": "held"}),
    "a link was believed before its controller had said who it is": _scenario(
        (1.0, "jogging", _jogging(3.0)), (1.5, "refuse_stop", {"count": 1}), (1.6, "stop", {"caller": 9}),
        (1.63, "cut", {"port": "both", "driver_learns": True, "controller_learns": True}),
        (1.63, "lose_replies", {"count": 3, "command": "get_simulator_identity"}),
        settings=dict(_SETTINGS, simulator="twin"), identity="twin"),
    "a stream was begun by one frame, and the fault in it held against it": _scenario(
        (0.79, "joint_move", _joint_move(5, -0.005, 0.37, False)), (0.91, "stop", {"caller": 9}),
        (1.0968, "jogging", _jogging(1.0)), (1.1029, "feed_shows", {"what": {"errcode": "0xf0034"}, "frames": 2}),
        settings=dict(_SETTINGS, feed_period=0.1)),
    "a guard that had seen its driver wake up was not told again that the arm moves": _scenario(
        (1.0, "jogging", _jogging(4.0)), (1.5, "pause", {"duration": 0.4}), (2.0, "kill", {"restart_after": 0.5}),
        settings=_SETTINGS, has_guard=True),
    "a move could begin as late as it liked while inpos was false": _scenario(
        (1.0, "joint_move", _joint_move(0, 0.3, 0.5, True)), settings=_SETTINGS,
        dialect={"start_delay": 4.0, "inpos": "never"}),
    "a jog could begin as late as its watchdog let it": _scenario(
        (1.0, "jogging", _jogging(3.0)), settings=_SETTINGS, dialect={"start_delay": 4.0, "inpos": "never"}),
    "hand guiding ended no move": _scenario(
        (1.0, "joint_move", _joint_move(0, 1.0, 0.3, True)),
        (1.5, "feed_shows", {"what": {"drag_status": True}, "frames": 20}), settings=_SETTINGS),
    "a program that began at the pendant ended no move": _scenario(
        (1.0, "joint_move", _joint_move(0, 1.0, 0.3, True)),
        (1.5, "feed_shows", {"what": {"interp_state": 3}, "frames": 20}), settings=_SETTINGS),
    "a controller that said that servo mode was off was streamed to": _scenario(
        (1.0, "servo_session", _servo(3.0)), (2.0, "deny_servo_mode", {"duration": 1.0}), settings=_SETTINGS),
    "a stop ended only what its sender believed to be under way": _scenario(
        (1.0, "jogging", _jogging(1.0)), (1.5, "stop", {"caller": 9}), settings=_SETTINGS),
    "the guard ended servo mode and programs, not jogs": _scenario(
        (1.0, "jogging", _jogging(3.0)), (1.5, "kill", {"restart_after": 1.0}), settings=_SETTINGS, has_guard=True),
    "a path could begin 2.5 s late on a slow feed": _scenario(
        (1.0, "path", {"caller": 0, "segments": (("arc", (-0.046, -0.0346, 0.0289, -0.00144, 0.00934, 0.0428)),),
                       "radius": 0.002, "speed": 0.27, "then": "", "then_after": 0.0}),
        settings=dict(_SETTINGS, feed_period=0.1), dialect={"start_delay": 9.5}),
    "a queue of targets near each other was taken for run when one of them was": _scenario(
        (1.0, "late_start", {"delay": 0.5, "duration": 2.0}),
        (1.1, "queue", {"caller": 1, "joint": 4, "ways": (0.005, -0.0, 0.005, 0.005), "speed": 0.2,
                        "first_waits": True, "apart": 0.0}), seed=2, settings=dict(_SETTINGS, feed_period=0.1)),
    "a move that was held near its target was completed by an inpos that comes early": _scenario(
        (1.0, "joint_move", _joint_move(5, -0.019, 0.235, True)), (1.0596, "pendant_pause", {"duration": 3.0}),
        settings=_SETTINGS, dialect={"inpos": "early", "missing_frame_fields": ("paused",)}),
    "a move to where the arm is, before a queue, was judged as if it had led nowhere": _scenario(
        (0.229, "queue", {"caller": 0, "joint": 0, "ways": (-0.0, 0.3, 0.3), "speed": 1.46, "first_waits": True,
                          "apart": 0.3}),
        (0.394, "pendant_move", {"joint": 5, "step": -0.3}), settings=_SETTINGS, dialect={"inpos": "never"}),
    "a caller waited for its move as long as others queued moves behind it": _scenario(
        (1.0, "joint_move", _joint_move(0, 1.0, 1.0, True, caller=1)),
        *[(1.5 + 2.0 * n, "queue", {"caller": 2 + n, "joint": 1, "ways": ((-1) ** n * 0.3,), "speed": 0.2,
                                    "first_waits": False, "apart": 0.0}) for n in range(8)],
        length=20.0, settings=dict(_SETTINGS, motion_timeout=4.0)),
    "a move that began late was given more time by frames without joints": _scenario(
        (1.0, "joint_move", _joint_move(0, 0.005, 0.85, True)),
        (1.593, "feed_drops", {"fields": ("joint_actual_position",), "duration": 0.596}),
        settings=dict(_SETTINGS, feed_period=0.1), dialect={"start_delay": 4.8}),
    "a jog that began late was given more time by frames without joints": _scenario(
        (1.0, "jogging", _jogging(3.0)),
        (1.593, "feed_drops", {"fields": ("joint_actual_position",), "duration": 0.596}),
        settings=dict(_SETTINGS, feed_period=0.1), dialect={"start_delay": 4.8}),
    "frames of before a motion were taken for rest after its stop on a slow link": _scenario(
        (1.0, "slow_link", {"port": "STATUS", "carries": 0.5, "duration": 10.0}),
        (3.4, "joint_move", _joint_move(3, -0.1, 0.53, True)), (3.73, "stop", {"caller": 9}),
        (4.15, "servo_session", _servo(1.0)), settings=dict(_SETTINGS, feed_period=0.1)),
    "joints that jumped were believed, and a jog began from where they had jumped to": _scenario(
        (3.5431, "feed_jumps", {"by": -1.5, "frames": 5}),
        (3.6812, "velocity_jog", {"caller": 3, "frame": 2, "axis": 3, "speed": 0.1, "rate": 10.0, "duration": 0.05,
                                  "end": "second", "says_rest": True}),
        settings=_SETTINGS, dialect={"shortest_feed_period": 0.087}),
    "a feed that repeated itself on time was believed again on the next connection": _scenario(
        (1.0, "jogging", dict(_jogging(6.0), frame=0)), (1.5, "feed_frozen", {"duration": 5.0}), settings=_SETTINGS),
    "a backlog was not noticed behind an answer that was found in it late": _scenario(
        (1.0, "slow_link", {"port": "STATUS", "carries": 0.3, "duration": 6.0}),
        (1.2, "joint_move", _joint_move(3, 0.3, 0.2, False)), settings=dict(_SETTINGS, feed_period=0.1)),
    "a backlog was forgotten when the process stood still on top of it": _scenario(
        (1.0, "slow_link", {"port": "both", "carries": 0.5, "duration": 7.0}),
        (1.2, "joint_move", _joint_move(0, 0.6, 0.2, False)), (2.1, "pause", {"duration": 0.4}),
        settings=dict(_SETTINGS, feed_period=0.1)),
    "an arm that somebody moved after the stop was said to have come along its path": _scenario(
        (0.7086, "path", {"caller": 1, "segments": (
            ("joint", (0.0136, 0.0047, -0.0117, 0.0427, 0.0162, 0.0928)),
            ("line", (-0.0088, -0.0346, -0.0815, 0.0462, 0.0066, -0.0266))), "radius": 0.0, "speed": 0.1588,
                          "then": "pause", "then_after": 0.01}),
        (0.8305, "stop", {"caller": 9}), (0.9486, "pendant_move", {"joint": 0, "step": 0.1}),
        settings=dict(_SETTINGS, feed_period=0.1), has_turns=True),
    "a user frame that was active late ended no path, and was taken for progress on it": _scenario(
        (7.0708, "procedure", {"caller": 0, "name": "user_frame", "value": 1}),
        (8.523, "path", {"caller": 0, "segments": (("line", (-0.0095, -0.0175, 0.0011, 0.001, -0.0042, 0.0408)),),
                         "radius": 0.01, "speed": 0.1092, "then": "stop", "then_after": 1.6}),
        length=12.0, settings=dict(_SETTINGS, feed_period=0.1, reply_timeout=0.9),
        dialect={"frame_delay": 1.5, "frame_reply_delay": 10.0}),
    "a program that began when all was well had nobody to end it": _scenario(
        (13.605, "program", {"caller": 1, "steps": (("play", 0.0), ("load", 0.6))}), (13.6082, "stop", {"caller": 9}),
        (14.472, "program", {"caller": 2, "steps": (("play", 0.0), ("resume", 0.1))}), length=15.0,
        settings=_SETTINGS, dialect={"stop_ends_program": False}),
    "the end of a jog that was refused was sent again half a second later": _scenario(
        (2.0, "jogging", {"caller": 0, "frame": 2, "axis": 3, "velocity": 0.05, "rate": 8.0, "duration": 5.0,
                          "then_back": True}),
        (4.7, "refuse_command", {"command": "jog", "duration": 0.04}), (4.7, "stop", {"caller": 9}),
        settings=dict(_SETTINGS, feed_period=0.1), dialect={"stop_ends_jog": False}),
    "a jog that was not seen to begin was given more time by a feed that fell silent": _scenario(
        (1.0, "jogging", _jogging(3.0)), (1.7, "feed_silent", {"duration": 2.6}), settings=_SETTINGS,
        dialect={"start_delay": 19.9}),
    "a move that was not seen to begin was given more time by a feed that fell silent": _scenario(
        (1.0, "joint_move", _joint_move(0, 0.3, 0.85, True)), (1.7, "feed_silent", {"duration": 2.6}),
        settings=_SETTINGS, dialect={"start_delay": 19.9}),
    "a path that was not seen to begin was given more time by a feed that fell silent": _scenario(
        (1.0, "path", {"caller": 0, "segments": (("joint", (0.2, 0.0, 0.0, 0.0, 0.0, 0.0)),), "radius": 0.002,
                       "speed": 0.27, "then": "", "then_after": 0.0}),
        (1.7, "feed_silent", {"duration": 2.6}), settings=_SETTINGS, dialect={"start_delay": 19.9}),
    "stops went into a connection that was cut in silence while the reply to power_on was waited for": _scenario(
        (0.5, "maintenance", {"every": 0.7, "recovers": True}), (0.6606, "emergency_stop", {"held": 0.3}),
        (2.1342, "stop", {"caller": 0}),
        (2.1438, "cut", {"port": "COMMAND", "driver_learns": False, "controller_learns": True}),
        (11.085, "feed_jumps", {"by": 2.0, "frames": 1}), length=15.0,
        settings=dict(_SETTINGS, reply_timeout=0.9, power_timeout=30.0), firmware="1.7.1", start="enabled",
        dialect={"power_reply": "held"}, latency=(0.0001, 0.001), lateness=0.0002, has_turns=True, has_guard=False),
    "an answer that came late excused a backlog for as long as one that came at once": _scenario(
        (2.9305, "slow_link", {"port": "both", "carries": 0.5, "duration": 3.25}),
        (3.7596, "trajectory", {
            "ways": ((-0.00955, 0.00571, 0.00128, -0.00744, 0.00743, -0.00904),
                     (0.00151, -0.00991, 0.00956, 0.00983, 0.00549, 0.00343),
                     (0.00147, 0.00588, 0.00277, -0.00096, -0.00552, 0.0063)),
            "apart": 0.3, "first_at": 1.0, "form": "rest", "delay": 0.3, "build_time": 0.02, "lead": 0.016,
            "then": "replace", "then_after": 0.05, "caller": 0}), length=15.0,
        settings=dict(_SETTINGS, feed_period=0.1, reply_timeout=0.9, motion_timeout=300.0, enable_timeout=30.0),
        firmware="1.7.1", start="enabled", latency=(0.0005, 0.005), lateness=0.002, auto_enable=True, has_guard=False,
        seed=60001014),
    "a move to where the arm is was completed on a feed that stood still while the pendant moved the arm": _scenario(
        (0.0333, "feed_frozen", {"duration": 1.6}), (0.146, "pendant_move", {"joint": 0, "step": -0.3}),
        (0.7283, "joint_move", _joint_move(0, 0.0, 1.6, True, caller=1)),
        settings=dict(_SETTINGS, motion_timeout=4.0), start="enabled", latency=(0.0001, 0.0005), lateness=0.0002),
    "a driver that was started again knew nothing of moves that were accepted and had not begun": _scenario(
        (4.1274, "queue", {"joint": 0, "ways": (-0.3, 0.005, -0.3, 0.005), "speed": 0.2154, "first_waits": False,
                           "apart": 0.05, "caller": 1}),
        (4.2795, "kill", {"restart_after": 0.6597}), (5.1689, "joint_move", _joint_move(3, -1e-5, 0.5923, False)),
        length=15.0, settings=dict(_SETTINGS, reply_timeout=0.9, jog_timeout=1.0, servo_timeout=10.0,
        link_loss_stop=0.3),
        start="enabled",
        dialect={"start_delay": 1.445, "link_loss_notice": 5.0, "feed_period": 0.008},
        latency=(0.0005, 0.005), lateness=0.002, has_turns=True,
        has_guard=False, ends="close in trouble", firmware="1.7.2", seed=60000555),
    "joints that jumped behind damaged frames were believed, and a jog began from there": _scenario(
        (6.1765, "feed_mangled", {"how": "cut off", "frames": 20}), (8.0998, "feed_jumps", {"by": 2.0, "frames": 5}),
        (8.4343, "velocity_jog", {"caller": 0, "frame": 0, "axis": 1, "speed": -0.041, "rate": 50.0, "duration": 1.5,
                                  "end": "frozen", "says_rest": True}),
        length=20.0, settings=dict(_SETTINGS, motion_timeout=300.0, jog_timeout=1.0, link_loss_stop=0.3),
        dialect={"shortest_feed_period": 0.1}, latency=(0.0001, 0.001), lateness=0.002, start="enabled",
        seed=60006378),
    "the end of servo mode that was refused was not sent again": _scenario(
        (2.6239, "velocity_jog", {"caller": 1, "frame": 2, "axis": 3, "speed": 0.172, "rate": 20.0, "duration": 2.5,
                                  "end": "second", "says_rest": True}),
        (4.1, "refuse_command", {"command": "servo_move", "duration": 1.29}), (4.4, "stop", {"caller": 9}),
        settings=dict(_SETTINGS, link_loss_stop=0.3), dialect={"stop_ends_servo": False, "starvation": "repeat"},
        start="enabled", auto_enable=True, has_guard=False),
    "a frame of when the arm moved came twice, and servo mode began there": _scenario(
        (6.868, "joint_move", _joint_move(0, -3.0, 1.8224, False, caller=2)), (8.1124, "stop", {"caller": 2}),
        (8.1215, "servo_session", dict(_servo(0.2), is_pose=True, speed=0.036, axis=0, leaves=True)),
        (8.3253, "feed_repeats", {"frames": 3, "age": 0.5}), length=20.0,
        settings=dict(_SETTINGS, motion_timeout=4.0, link_loss_stop=0.0), firmware="1.7.2", start="enabled",
        latency=(0.0001, 0.0005), lateness=0.0, ends="close", seed=60007053),
    "a trajectory was said to be paused whose frames still waited at the controller": _scenario(
        (1.15, "pendant_program", {"duration": 2.69}),
        (2.485, "trajectory", {
            "ways": ((0.205, -0.023, 0.393, -0.502, 0.058, -0.359),), "apart": 0.6, "first_at": 1.0, "form": "rest",
            "delay": 0.0, "build_time": 0.02, "lead": 0.016, "then": "pause", "then_after": 0.0, "caller": 0}),
        (3.112, "trajectory", {
            "ways": ((0.526, 0.291, -0.252, 0.523, 0.512, -0.091), (-0.227, 0.018, -0.189, 0.118, 0.506, 0.305)),
            "apart": 1.0, "first_at": 0.0, "form": "straight", "delay": 0.0, "build_time": 0.004, "lead": 0.016,
            "then": "pause", "then_after": 1.057, "caller": 1}),
        (3.9876, "stall", {"port": "both", "way": "to controller", "duration": 0.28}),
        settings=dict(_SETTINGS, motion_timeout=4.0, servo_timeout=10.0, link_loss_stop=0.0), firmware="1.5.14",
        start="enabled", latency=(0.0001, 0.0005), lateness=0.0002, seed=60006063),
    "a feed that froze after the last answer showed rest while a slow stop still braked": _scenario(
        (0.0374, "linear_move", _linear_move((-0.238, 0.192, 0.256), (0.04, 0.0, 0.0), 0.415, False, caller=1)),
        (0.7203, "stop", {"caller": 2}), (0.8144, "feed_frozen", {"duration": 2.2}),
        settings=dict(_SETTINGS, servo_timeout=10.0, link_loss_stop=0.3), firmware="1.7.2", start="enabled",
        latency=(0.0001, 0.0005), lateness=0.0, has_turns=True, seed=1871404345),
    "a driver that was started on a frozen feed took its joints for those of the arm": _scenario(
        (1.4279, "kill", {"restart_after": 0.555}), (1.7837, "feed_frozen", {"duration": 1.336}),
        (1.9394, "jogging", dict(_jogging(0.01), axis=2, velocity=-0.0429, rate=7.047, then_back=True)),
        (2.1352, "jogging", dict(_jogging(2.0), frame=0, axis=4, velocity=-0.26, rate=8.517, caller=3)),
        (2.2624, "jogging", dict(_jogging(2.0), axis=4, velocity=-0.0924, rate=16.0, then_back=True)),
        (2.5869, "stop", {"caller": 0}),
        (2.6133, "velocity_jog", {"caller": 0, "frame": 0, "axis": 1, "speed": 0.605, "rate": 50.0, "duration": 0.5,
                                  "end": "nonsense", "says_rest": True}),
        length=20.0, settings=dict(_SETTINGS, link_loss_stop=0.3), firmware="1.7.2", start="enabled",
        latency=(0.0005, 0.005), lateness=0.0, auto_enable=True, has_turns=True, has_guard=False, seed=114133549),
    "frames that piled up behind a new connection were shown as new": _scenario(
        (0.7514, "feed_silent", {"duration": 0.94}), (1.5597, "rival", {"step": -0.3, "duration": 1.763}),
        (1.631, "stall", {"port": "both", "way": "both", "duration": 0.48}),
        settings=dict(_SETTINGS, feed_period=0.1, jog_timeout=3.0, servo_timeout=10.0, link_loss_stop=0.3),
        dialect={"shortest_feed_period": 0.09}, firmware="1.5.14", start="enabled", latency=(0.0005, 0.005),
        lateness=0.0, has_turns=True, ends="close", seed=70000273),
    "a move was resumed beside a paused program, which ran in nobody's custody": _scenario(
        (0.5246, "program", {"caller": 0, "steps": (("play", 0.0), ("pause", 0.6), ("stop", 0.6))}),
        (5.3803, "pause", {"duration": 17.4795}),
        (10.9999, "joint_move", {"delta": (0.0, -3.0, 0.0, 0.0, 0.0, 0.0), "speed": 0.2945, "acceleration": 5.178,
                                 "wait": False, "caller": 0}),
        (11.1238, "procedure", {"name": "resume", "value": None, "caller": 0}),
        length=40.0, settings=dict(_SETTINGS, feed_period=0.008, reply_timeout=0.9, link_loss_stop=0.3),
        dialect={"stop_ends_program": False, "second_client": "refused"}, firmware="1.5.14", start="enabled",
        latency=(0.0005, 0.005), lateness=0.0, has_turns=True, has_guard=True, seed=5302),
    "a move that led nowhere began when a jog had led the arm away": _scenario(
        (1.0, "late_start", {"delay": 1.5, "duration": 8.0}), (1.5, "joint_move", _joint_move(0, 0.0, 1.0, True)),
        (1.94, "velocity_jog", _LONG_JOG), seed=2, settings=_SETTINGS, length=12.0),
    "the last of a queue, which led nowhere, began when a jog had led the arm away": _scenario(
        (1.0, "late_start", {"delay": 1.5, "duration": 8.0}),
        (1.5, "queue", {"caller": 0, "joint": 0, "ways": (0.1, 0.1), "speed": 1.0, "first_waits": False,
                        "apart": 0.05}),
        (3.44, "velocity_jog", _LONG_JOG), seed=8, settings=_SETTINGS, length=12.0),
    "a feed that was a little old showed the rest before a move for that after its stop": _scenario(
        (20.8095, "slow_link", {"port": "STATUS", "carries": 0.98, "duration": 13.7425}),
        (21.6162, "feed_shows", {"what": {"errcode": "0x020033"}, "duration": 5.27}),
        (24.9414, "linear_move", {"shift": (0.0146, 0.0058, 0.0197), "turn": (0.0884, -0.0109, 0.0), "speed": 0.2715,
                                  "acceleration": 2.6292, "wait": False, "caller": 0}),
        (24.9858, "stop", {"caller": 9}),
        length=40.0, settings=dict(_SETTINGS, reply_timeout=0.9, motion_timeout=300.0, jog_timeout=1.0,
                                   link_loss_stop=0.3, power_timeout=3.0, enable_timeout=30.0),
        dialect={"unknown_frame_fields": True}, firmware="1.5.14", start="enabled", latency=(0.0001, 0.0005),
        lateness=0.0, has_turns=True, has_guard=True, seed=70001918),
    "a driver that had stood still sent the first servo frame to an arm that another had moved": _scenario(
        (0.4567, "servo_session", dict(_servo(0.2), caller=0, rate=30.0, speed=0.6172, axis=0)),
        (0.4581, "pause", {"duration": 0.7069}), (0.7388, "rival", {"step": 0.2, "duration": 0.2003}),
        length=15.0, settings=dict(_SETTINGS, servo_timeout=10.0, jog_timeout=3.0, link_loss_stop=0.3),
        firmware="1.7.1", start="enabled", latency=(0.0001, 0.0005), lateness=0.0002, has_guard=True,
        ends="close in trouble", seed=1763648202),
    "a path that was stopped counted the corner to which the arm was guided by hand": _scenario(
        (0.5, "maintenance", {"every": 0.7, "recovers": False}),
        (14.2095, "rapid_rate", {"rate": 0.0, "duration": 0.8192}),
        (14.5227, "path", {"segments": (
            ("line", (0.0431, 0.0457, 0.0706, -0.0112, 0.0046, 0.0173)),
            ("arc", (0.0262, -0.0484, -0.0077, -0.002, 0.0328, -0.0168)),
            ("line", (0.0088, -0.0295, 0.046, 0.0014, 0.0347, -0.0026)),
            ("line", (0.01, -0.0382, -0.0737, -0.0987, -0.0177, -0.0945)),
            ("joint", (0.0069, -0.0464, 0.0786, -0.0401, -0.0669, 0.0092))),
            "radius": 0.01, "speed": 0.1582, "then": "", "then_after": 0.0, "caller": 2}),
        (15.5182, "stop_with", {"stop_first": False, "kind": "linear_move", "caller": 0, "args": {
            "shift": (0.0, 0.0, 0.0), "turn": (0.0, 0.0, -0.0143), "speed": 0.0246, "acceleration": 1.1476,
            "wait": False}}),
        (15.8042, "guide_at_arm", {"joint": 0, "velocity": 0.2, "duration": 2.0}),
        length=25.0, ends="close", firmware="1.5.14", start="off", dialect={"power_delay": 0.5},
        settings={"feed_period": 0.1, "reply_timeout": 0.9, "motion_timeout": 300.0, "servo_timeout": 10.0,
                  "link_loss_stop": 0.3, "power_timeout": 30.0, "enable_timeout": 3.0},
        latency=(0.0001, 0.001), lateness=0.002, auto_enable=True, has_guard=True, seed=70001405),
    "a process that was killed in mid connection kept the controller's port": _scenario(
        (0.9112, "joint_move", {"delta": (0.0001, -0.0016, 0.0228, -0.003, -0.0008, 0.0027), "speed": 0.3552,
                                "acceleration": 5.4208, "wait": False, "caller": 0}),
        (1.804, "joint_move", {"delta": (-0.0008, 0.0001, 0.0, 0.0005, 0.0052, 0.0005), "speed": 0.8859,
                               "acceleration": 7.5435, "wait": True, "caller": 0}),
        (8.9775, "kill", {"restart_after": 2.2587}), (11.4601, "kill", {"restart_after": 2.106}),
        (13.5673, "pause", {"duration": 13.2843}), (24.5998, "kill", {"restart_after": 0.3732}),
        length=25.0, settings=dict(_SETTINGS, reply_timeout=0.9, motion_timeout=4.0, jog_timeout=3.0,
                                   servo_timeout=10.0, link_loss_stop=0.3, power_timeout=3.0, enable_timeout=3.0),
        firmware="1.5.14", start="off", dialect={"second_client": "refused"}, latency=(0.0001, 0.001), lateness=0.0,
        auto_enable=True, has_guard=False, seed=70002070),
    "a move that was ended by a stop was completed while the arm began it late": _scenario(
        (0.2274, "servo_burst", {"count": 40, "within": 0.02, "step": 0.005, "axis": 3, "relative": True,
                                 "caller": 0}),
        (0.8315, "linear_move", _linear_move((-0.1085, -0.1221, -0.0729), (-0.0938, 0.0, -0.0945), 0.0391, False,
                                             caller=1)),
        (1.0746, "joint_move", dict(_joint_move(2, 0.4, 2.0, False, caller=1), acceleration=12.0)),
        (1.3083, "hit", {"force": 150.0}), (2.2388, "procedure", {"name": "recover", "value": None, "caller": 3}),
        (2.3121, "late_start", {"delay": 1.5, "duration": 2.9298}),
        (2.4133, "velocity_jog", {"caller": 3, "frame": 0, "axis": 4, "speed": 0.0219, "rate": 20.0, "duration": 1.5,
                                  "end": "nonsense", "says_rest": True}),
        (3.6456, "stop", {"caller": 1}), (3.8592, "joint_move", _joint_move(4, 0.005, 0.05, True, caller=1)),
        length=15.0, settings=dict(_SETTINGS, feed_period=0.008, motion_timeout=4.0, link_loss_stop=0.3),
        dialect={"servo_leave_delay": 0.053, "missing_commands": ["set_network_exception_handle"]},
        firmware="1.5.14", start="enabled", latency=(0.0001, 0.001), lateness=0.0, has_turns=True, has_guard=True,
        seed=90000409),
    "a path whose arm came into sight before a corner had passed that corner": _scenario(
        (3.7562, "path", {"segments": (
            ("joint", (-0.0477, 0.0068, -0.0143, 0.0016, 0.0433, -0.0175)),
            ("joint", (-0.0176, 0.0026, -0.0363, 0.0075, -0.0881, 0.0917)),
            ("arc", (-0.034, -0.0331, 0.0215, 0.0101, -0.0601, -0.0089))),
            "radius": 0.0, "speed": 0.063, "then": "", "then_after": 0.01, "caller": 0}),
        (4.1711, "feed_drops", {"fields": ("joint_actual_position",), "duration": 1.2725}),
        settings=dict(_SETTINGS, reply_timeout=0.9, motion_timeout=300.0, link_loss_stop=0.0),
        dialect={"shortest_feed_period": 0.1}, firmware="1.7.1", start="enabled", latency=(0.0001, 0.0005),
        lateness=0.0002, has_turns=True, has_guard=True, seed=90000816),
    "a move to where the arm was seemed under way while the feed repeated an earlier motion": _scenario(
        (1.8832, "path", {"segments": (
            ("line", (0.0179, -0.0074, 0.0072, 0.0027, -0.0173, 0.0159)),
            ("line", (0.006, -0.0143, -0.0205, 0.0023, -0.0202, 0.0209)),
            ("line", (-0.075, -0.0008, -0.0055, 0.0016, -0.0396, 0.061))),
            "radius": 0.01, "speed": 0.1095, "then": "", "then_after": 0.01, "caller": 0}),
        (4.0811, "joint_move", dict(_joint_move(4, -1e-05, 1.094, True), acceleration=8.376)),
        (4.4092, "feed_repeats", {"frames": 10, "age": 2.0}),
        length=40.0, settings=dict(_SETTINGS, reply_timeout=0.9, link_loss_stop=0.3),
        dialect={"inpos": "never", "shortest_feed_period": 0.084}, firmware="1.5.14", start="enabled",
        latency=(0.0005, 0.005), lateness=0.0002, has_turns=True, has_guard=True, ends="close", seed=90001404),
    "a move was completed though the arm was guided away before its stop had come to rest": _scenario(
        (11.9111, "joint_move", _joint_move(1, 1e-05, 0.05, True)),
        (12.3955, "guide_at_arm", {"joint": 4, "velocity": 0.2, "duration": 2.0}),
        (12.5579, "emergency_stop", {"held": 0.8855}),
        length=40.0, settings=dict(_SETTINGS, feed_period=0.1, reply_timeout=0.9, link_loss_stop=0.3),
        dialect={"inpos": "never"}, firmware="1.7.2", start="enabled", latency=(0.0005, 0.005), lateness=0.0,
        has_guard=False, ends="close", seed=3735436829),
    "a stream whose points waited for the arm to rest counted as paused, and went on after a stop": _scenario(
        (0.4, "trajectory", {"ways": ((0.3, 0.1, -0.1, 0.0, 0.2, 0.1),), "apart": 0.6, "first_at": 1.0, "form": "rest",
                             "delay": 0.0, "build_time": 0.0, "lead": 0.016, "then": "", "then_after": 0.0,
                             "caller": 1}),
        (0.97, "point_stream", {"rate": 30.0, "ahead": 2.0, "jitter": 0.0, "duration": 2.0, "speed": -0.9, "axis": 3,
                                "turns": False, "chance": 912, "caller": 2}),
        (1.48, "stop", {"caller": 9}), settings=dict(_SETTINGS, reply_timeout=0.4),
        dialect={"servo_leave_delay": 0.1, "shortest_feed_period": 0.1}),
    "a reply that was lost counted as one that lets others pass": _scenario(
        (0.5, "maintenance", {"every": 0.7, "recovers": True}), (18.1908, "emergency_stop", {"held": 1.5873}),
        (24.7392, "stop", {"caller": 9}), (24.9116, "emergency_stop", {"held": 0.2725}),
        (24.981, "lose_replies", {"count": 1, "command": ""}), (32.1752, "servo_mode", {"active": False, "caller": 2}),
        length=40.0, settings=dict(_SETTINGS, feed_period=0.1, reply_timeout=0.4, motion_timeout=4.0, jog_timeout=3.0,
                                   link_loss_stop=0.3, power_timeout=3.0, enable_timeout=30.0),
        dialect={"power_delay": 0.0, "enable_delay": 15.0}, firmware="1.5.14", start="enabled",
        latency=(0.0001, 0.001), lateness=0.0, has_guard=False, ends="close in trouble", seed=2000045),
    "a point that waited for the arm to rest moved it after its stream had been ended": _scenario(
        (7.8019, "servo_session", {"is_pose": True, "relative": False, "rate": 10.0, "duration": 1.0, "speed": 2.3702,
                                   "form": "turn back", "axis": 5, "burst": False, "leaves": False, "pause": 0.5,
                                   "caller": 1}),
        (9.0128, "feed_silent", {"duration": 2.2815}),
        (10.6958, "feed_shows", {"what": {"protective_stop": 1}, "frames": 1}),
        (11.1482, "kill", {"restart_after": 0.3597}),
        (11.1956, "slow_link", {"port": "both", "carries": 0.5, "duration": 10.7214}),
        (11.7533, "feed_repeats", {"frames": 1, "age": 2.0}), (11.953, "pause", {"duration": 0.2278}),
        (12.1486, "point_stream", {"rate": 30.0, "ahead": 2.0, "jitter": 0.0, "duration": 0.05, "speed": 0.053,
                                   "axis": 2, "turns": True, "chance": 863, "caller": 1}),
        length=14.0, settings=dict(_SETTINGS, reply_timeout=0.4, servo_timeout=10.0, link_loss_stop=0.3),
        firmware="1.5.14", start="enabled", latency=(0.0005, 0.005), lateness=0.0002, has_turns=True, has_guard=False,
        ends="close", seed=977730060),
    "a stopped move was let go by a feed that lagged before its age was first compared": _scenario(
        (0.0586, "slow_link", {"port": "STATUS", "carries": 0.5, "duration": 5.5135}),
        (0.1636, "stop_with", {"stop_first": True, "kind": "joint_move", "args": {
            "delta": (0.0075, 0.0053, -0.0057, 0.0852, -0.0071, -0.0109), "speed": 1.7166, "acceleration": 10.8663,
            "wait": False}, "caller": 0}),
        (0.2138, "stop", {"caller": 9}),
        length=15.0, settings=dict(_SETTINGS, feed_period=0.008, reply_timeout=0.9, motion_timeout=300.0,
                                   servo_timeout=10.0, link_loss_stop=0.3, power_timeout=3.0, enable_timeout=30.0),
        firmware="1.5.14", start="enabled", latency=(0.0001, 0.001), lateness=0.0, has_turns=True, ends="close",
        seed=3002261),
    "an arm that went there and back was shown late by a feed that stood": _scenario(
        (6.474, "point_stream", {"rate": 30.0, "ahead": 2.0, "jitter": 1.0, "duration": 2.0, "speed": -0.3377,
                                 "axis": 3, "turns": False, "chance": 86, "caller": 1}),
        (6.8977, "slow_link", {"port": "STATUS", "carries": 0.5, "duration": 13.8671}),
        (7.2287, "trajectory", {"ways": ((0.3955, 0.2759, 0.1935, -0.0899, 0.5868, -0.5952),
                                         (0.1518, 0.0887, -0.4175, 0.0502, -0.5377, 0.3774)),
                                "apart": 1.0, "first_at": 1.0, "form": "rest", "delay": 0.0, "build_time": 0.004,
                                "lead": 0.016, "then": "replace", "then_after": 0.05, "caller": 1}),
        (7.7034, "stop", {"caller": 0}),
        (7.7954, "joint_move", {"delta": (0.0, 0.0, 0.0, 0.0, -0.02, 0.0), "speed": 1.449, "acceleration": 9.7961,
                                "wait": False, "caller": 1}),
        (7.9968, "joint_move", {"delta": (0.0, 0.0, -1e-05, 0.0, 0.0, 0.0), "speed": 1.1243, "acceleration": 8.4971,
                                "wait": False, "caller": 0}),
        length=40.0, settings=dict(_SETTINGS, reply_timeout=0.9, jog_timeout=3.0, servo_timeout=10.0,
                                   link_loss_stop=0.0, power_timeout=30.0, enable_timeout=3.0),
        firmware="1.5.14", start="enabled", latency=(0.0001, 0.001), lateness=0.002, has_turns=True, has_guard=False,
        ends="leave", seed=1001411),
    "joints that jumped in the first frames of a driver were believed, and a stream began from there": _scenario(
        (13.561, "kill", {"restart_after": 2.8372}), (13.733, "feed_jumps", {"by": 2.0, "frames": 5}),
        (14.863, "point_stream", {"rate": 10.0, "ahead": 3.0, "jitter": 0.0, "duration": 2.0, "speed": 0.3245,
                                  "axis": 5, "turns": True, "chance": 723, "caller": 1}),
        length=25.0, settings=_SETTINGS, latency=(0.0001, 0.0005), seed=4001805),
    "a controller dropped a segment of a path, which was reported to have ended": _scenario(
        (0.5, "path", {"segments": (
            ("arc", (0.0023, -0.047, -0.0149, -0.0494, -0.0026, -0.0265)),
            ("joint", (-0.0749, -0.0436, -0.0418, 0.0144, -0.0844, -0.0004))),
            "radius": 0.0, "speed": 0.1999, "then": "", "then_after": 0.0, "caller": 1}),
        (0.505, "pendant_stop", {}),
        length=8.0, settings=dict(_SETTINGS, feed_period=0.008, reply_timeout=0.9, motion_timeout=4.0),
        dialect={"inpos": "late"}, firmware="1.5.14", start="enabled", latency=(0.0001, 0.001), lateness=0.002,
        seed=4002283),
    "frames on their way moved the arm after its pause was answered": _scenario(
        (19.8492, "slow_link", {"port": "both", "carries": 0.85, "duration": 3.8488}),
        (20.8625, "path", {"segments": (
            ("line", (-0.0023, 0.0698, 0.0349, 0.0274, 0.0016, 0.0216)),
            ("line", (0.0722, 0.0145, -0.0098, -0.0038, 0.0909, -0.0596)),
            ("line", (0.0065, 0.0319, -0.025, 0.0137, 0.0294, -0.0014))),
            "radius": 0.002, "speed": 0.0433, "then": "", "then_after": 0.3604, "caller": 1}),
        (22.167, "servo_session", {"is_pose": False, "relative": True, "rate": 1.0, "duration": 0.2, "speed": 0.0229,
                                   "form": "turn back", "axis": 0, "burst": False, "leaves": False, "pause": 0.05,
                                   "caller": 0}),
        (22.739, "feed_repeats", {"frames": 10, "age": 0.1}),
        (23.9549, "feed_shows", {"what": {"errcode": "0xf0034"}, "frames": 1}),
        (24.0297, "servo_session", {"is_pose": True, "relative": True, "rate": 250.0, "duration": 3.0, "speed": 0.017,
                                    "form": "ramp", "axis": 0, "burst": True, "leaves": False, "pause": 0.05,
                                    "caller": 1}),
        (24.2538, "slow_link", {"port": "COMMAND", "carries": 0.5, "duration": 5.829}),
        (24.9902, "trajectory", {"ways": ((-0.0945, 0.1315, 0.0235, -0.0358, -0.0031, 0.1407),), "apart": 0.3,
                                 "first_at": 0.0, "form": "flowing", "delay": 0.3, "build_time": 0.0, "lead": 0.016,
                                 "then": "pause", "then_after": 0.0, "caller": 1}),
        length=25.0, settings=dict(_SETTINGS, feed_period=0.1, reply_timeout=0.4, jog_timeout=3.0, link_loss_stop=0.0,
                                   power_timeout=3.0, enable_timeout=30.0),
        dialect={"power_delay": 0.5, "power_reply_delay": 1.942, "start_delay": 13.195, "starvation": "repeat",
                 "second_client": "refused", "unknown_reply_fields": True},
        firmware="1.5.14", start="off", latency=(0.0001, 0.0005), lateness=0.0, auto_enable=True, has_guard=False,
        ends="close", seed=56998513),
    "a program that went on after its stop was let go on a feed that was behind": _scenario(
        (1.0, "slow_link", {"port": "STATUS", "carries": 0.5, "duration": 8.0}),
        (5.0, "program", {"caller": 0, "steps": (("play", 0.0), ("stop", 0.4))}), (5.4, "stop", {"caller": 9}),
        length=15.0, settings=_SETTINGS, dialect={"stop_ends_program": False}),
    "a stop that waited for its port and then for a lost reply was answered late": _scenario(
        (0.5351, "servo_session", {"is_pose": True, "relative": False, "rate": 1.0, "duration": 1.0, "speed": 1.8732,
                                   "form": "hold", "axis": 4, "burst": False, "leaves": False, "pause": 0.0,
                                   "caller": 0}),
        (0.5726, "lose_replies", {"count": 2, "command": "stop_program"}),
        (1.4396, "cut", {"port": "COMMAND", "driver_learns": True, "controller_learns": False}),
        (1.775, "stall", {"port": "both", "way": "to controller", "duration": 2.5522}),
        (4.4873, "stop", {"caller": 0}),
        length=15.0, settings=dict(_SETTINGS, feed_period=0.1, reply_timeout=0.9, motion_timeout=300.0,
                                   jog_timeout=3.0, servo_timeout=2.0, link_loss_stop=0.3),
        dialect={"second_client": "refused"}, firmware="1.7.1", start="enabled", latency=(0.0001, 0.001), lateness=0.0,
        has_guard=False, seed=3943280924),
    "a jog went on while its driver, which had closed the link, waited with a grown pause": _scenario(
        (0.5, "maintenance", {"every": 2.0, "recovers": False}),
        (7.5796, "restart", {"down": 0.3, "silent": True}), (8.6651, "feed_repeats", {"frames": 3, "age": 2.0}),
        (10.0218, "jogging", {"frame": 1, "axis": 4, "velocity": -0.01, "rate": 12.4813, "duration": 2.0,
                              "then_back": False, "caller": 0}),
        length=15.0, settings=dict(_SETTINGS, feed_period=0.008, reply_timeout=0.9, jog_timeout=1.0,
                                   servo_timeout=10.0, link_loss_stop=0.3, power_timeout=30.0, enable_timeout=3.0),
        dialect={"power_reply_delay": 0.9, "enable_reply_delay": 10.0,
                 "missing_commands": ["set_network_exception_handle"], "power_delay": 0.5, "enable_delay": 0.3},
        firmware="1.5.14", start="enabled", latency=(0.0001, 0.0005), lateness=0.002, has_guard=False, seed=9001222),
}
