"""One seed -> one scenario: which calls are made when, and which faults come around the driver.

A scenario is plain data, drawn before anything runs: leaving some of its events out gives another scenario, which is
how a long trace is made short. Numbers are chosen so that every motion can come to rest within 0.4 s.
"""
import random
from dataclasses import dataclass, field
from typing import Any, Callable, Dict, List, NamedTuple, Sequence, Tuple

from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.simulation.dialect.table import Dialect


class Event(NamedTuple):
    """One event: the name of a method ``do_<kind>`` of the world, its time and its arguments."""

    at: float
    kind: str
    args: Dict[str, Any]

    def __str__(self) -> str:
        return "%8.4f %s %s" % (self.at, self.kind, ", ".join("%s=%r" % item for item in self.args.items()))


@dataclass(frozen=True)
class Scenario:
    """The whole input of a world.

    Attributes:
        seed: Seed of the draws that are left to the world: latencies, pieces, lateness.
        length: s of virtual time until everything is well again.
        events: The events in order of time.
        settings: Settings of the driver that differ from its defaults.
        firmware: The controller's firmware.
        start: "off", "powered" or "enabled".
        dialect: The controller's behaviour on open points, where it differs from its firmware's default.
        full_frames: Frames have all fields; they cost ten times as much.
        latency: Shortest and longest latency of the wire, s.
        lateness: Longest lateness of the driver's timer, s.
        identity: The identity that the simulated controller reports; the settings may ask for another one.
        auto_enable: The driver powers and enables the arm at its start.
        has_turns: The driver's shell ticks the core after all that came from the wire, and acts only then.
        has_guard: A guard process runs beside the driver.
        ends: "close", "leave" or "close in trouble".
    """

    seed: int
    length: float
    events: Tuple[Event, ...]
    settings: Dict[str, Any] = field(default_factory=dict)
    firmware: str = "1.5.14"
    start: str = "enabled"
    dialect: Dict[str, Any] = field(default_factory=dict)
    full_frames: bool = False
    latency: Tuple[float, float] = (0.0001, 0.001)
    lateness: float = 0.0
    identity: str = ""
    auto_enable: bool = False
    has_turns: bool = False
    has_guard: bool = False
    ends: str = "close"


_Draw = Callable[[random.Random], Tuple[str, Dict[str, Any]]]
_Weighted = Sequence[Tuple[float, _Draw]]

SPEEDS = (0.01, 0.05, 0.2, 0.5, 1.0, 2.0, 3.0)
SIZES = (0.0, 1e-5, 0.005, 0.02, 0.1, 0.4, 1.0, 3.0)


def _log_uniform(chance: random.Random, low: float, high: float) -> float:
    return low * (high / low) ** chance.random()


# ---- calls ----

def _joint_move(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    size = chance.choice(SIZES)
    joint = chance.randrange(6)
    delta = [0.0] * 6
    delta[joint] = size * chance.choice((-1.0, 1.0))
    if chance.random() < 0.3:
        delta = [d + chance.uniform(-0.2, 0.2) * size for d in delta]
    speed = chance.choice(SPEEDS) if chance.random() < 0.3 else _log_uniform(chance, 0.2, 3.0)
    return "joint_move", {"delta": tuple(delta), "speed": speed, "acceleration": min(12.5, 4.0 + 4.0 * speed),
                          "wait": chance.random() < 0.6}


def _linear_move(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    size = chance.choice((0.0, 1e-5, 0.003, 0.02, 0.1, 0.3))
    shift = tuple(size * chance.uniform(-1.0, 1.0) for _ in range(3))
    turn = tuple(chance.choice((0.0, 0.0, 0.1)) * chance.uniform(-1.0, 1.0) for _ in range(3))
    speed = _log_uniform(chance, 0.01, 0.5)
    return "linear_move", {"shift": shift, "turn": turn, "speed": speed, "acceleration": 1.0 + 6.0 * speed,
                           "wait": chance.random() < 0.6}


def _queue(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    """Draw moves in one go, each to a place near the start; the same place may come twice."""
    places = [(chance.choice((0.0, 0.005, 0.1, 0.3)) * chance.choice((-1.0, 1.0))) for _ in range(2)]
    return "queue", {"joint": chance.randrange(6), "ways": tuple(chance.choice(places) for _ in range(
        chance.choice((2, 3, 4)))), "speed": _log_uniform(chance, 0.2, 2.0), "first_waits": chance.random() < 0.5,
        "apart": chance.choice((0.0, 0.05, 0.3))}


def _jogging(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    frame = chance.choice((JogFrame.JOINT, JogFrame.JOINT, JogFrame.BASE, JogFrame.TOOL))
    axis = chance.randrange(6)
    is_line = frame is not JogFrame.JOINT and axis < 3
    velocity = _log_uniform(chance, 0.005, 0.06 if is_line else 0.5) * chance.choice((-1.0, 1.0))
    return "jogging", {"frame": int(frame), "axis": axis, "velocity": velocity, "rate": chance.uniform(5.0, 20.0),
                       "duration": chance.choice((0.01, 0.5, 2.0, 5.0)),
                       "then_back": chance.random() < 0.3}


def _servo_mode(active: bool) -> _Draw:
    return lambda chance: ("servo_mode", {"active": active})


def _servo_stream(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    return "servo_stream", {
        "is_pose": chance.random() < 0.3, "relative": chance.random() < 0.25, "rate": chance.choice(
            (1.0, 10.0, 30.0, 125.0, 250.0)), "duration": chance.choice((0.2, 1.0, 3.0)),
        "speed": _log_uniform(chance, 0.01, 3.5), "form": chance.choice(("ramp", "turn back", "jump", "hold")),
        "axis": chance.randrange(6)}


def _servo_burst(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    return "servo_burst", {"count": 40, "within": 0.02, "step": chance.choice((0.1, 0.03, -0.1, 0.005)),
                           "axis": chance.randrange(6), "relative": chance.random() < 0.3}


def _servo_session(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    _, args = _servo_stream(chance)
    return "servo_session", dict(args, burst=chance.random() < 0.2, leaves=chance.random() < 0.6,
                                 pause=chance.choice((0.0, 0.05, 0.5)))


def _trajectory(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    """Draw points that most often can be followed; the same caller may replace, cancel or pause its trajectory."""
    count = chance.choice((1, 2, 3, 8))
    size = chance.choice((0.0, 0.01, 0.2, 0.6))
    return "trajectory", {
        "ways": tuple(tuple(size * chance.uniform(-1.0, 1.0) for _ in range(6)) for _ in range(count)),
        "apart": chance.choice((0.3, 0.6, 1.0)), "first_at": chance.choice((0.0, 0.5, 1.0)),
        "form": chance.choice(("rest", "rest", "straight", "flowing")), "delay": chance.choice((0.0, 0.0, 0.0, 0.3)),
        "build_time": chance.choice((0.0, 0.002, 0.004, 0.02)), "lead": 0.016,
        "then": chance.choice(("", "", "", "cancel", "replace", "replace", "pause", "speed", "stop before")),
        "then_after": chance.choice((0.0, 0.05, chance.uniform(0.0, 1.5)))}


def _velocity_jog(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    """Draw messages of one publisher that end in one of many ways."""
    frame, axis = chance.choice((JogFrame.JOINT, JogFrame.JOINT, JogFrame.BASE, JogFrame.TOOL)), chance.randrange(6)
    highest = 0.25 if frame is not JogFrame.JOINT and axis < 3 else 0.8
    return "velocity_jog", {
        "frame": int(frame), "axis": axis, "speed": _log_uniform(chance, 0.02, highest) * chance.choice((-1.0, 1.0)),
        "rate": chance.choice((10.0, 20.0, 50.0)), "duration": chance.choice((0.05, 0.5, 1.5)),
        "end": chance.choice(("rest", "silence", "frozen", "nonsense", "second", "stalled", "held")),
        "says_rest": chance.random() < 0.9}


def _point_stream(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    """Draw a stream of single points along one joint, as MoveIt Servo or a joystick sends them."""
    return "point_stream", {
        "rate": chance.choice((10.0, 30.0, 30.0, 100.0)), "ahead": chance.choice((1.0, 1.0, 2.0, 3.0)),
        "jitter": chance.choice((0.0, 0.0, 1.0)), "duration": chance.choice((0.05, 0.5, 2.0, 4.0)),
        "speed": _log_uniform(chance, 0.02, 1.0) * chance.choice((-1.0, 1.0)), "axis": chance.randrange(6),
        "turns": chance.random() < 0.5, "chance": chance.randrange(1000)}


def _path(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    """Draw segments around the last published place; the blend radii are mostly allowed."""
    return "path", {
        "segments": tuple((chance.choice(("joint", "line", "line", "arc")), tuple(
            chance.choice((0.02, 0.05, 0.1)) * chance.uniform(-1.0, 1.0) for _ in range(6))) for _ in range(
                chance.choice((1, 2, 3, 5)))),
        "radius": chance.choice((0.0, 0.0, 0.002, 0.01)), "speed": _log_uniform(chance, 0.03, 0.5),
        "then": chance.choice(("", "", "", "cancel", "pause", "stop")), "then_after": chance.choice(
            (0.0, 0.01, chance.uniform(0.0, 2.0)))}


def _program(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    """Draw a program that is played, and perhaps paused, resumed and stopped."""
    steps = [("play", 0.0)]
    for step in chance.choice((("stop",), ("pause", "resume", "stop"), ("pause", "stop"), ("resume",), ("load",), ())):
        steps.append((step, chance.choice((0.0, 0.1, 0.6))))
    return "program", {"steps": tuple(steps)}


def _stop(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    return "stop", {}


def _stop_with_move(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
    """Draw a stop and a new motion in the same instant."""
    kind, args = chance.choice((_joint_move, _joint_move, _linear_move, _jogging, _servo_mode(True)))(chance)
    return "stop_with", {"stop_first": chance.random() < 0.5, "kind": kind, "args": args}


def _procedure(name: str, *values: Any) -> _Draw:
    return lambda chance: ("procedure", {"name": name, "value": chance.choice(values)})


CALLS: _Weighted = (
    (12.0, _joint_move), (5.0, _linear_move), (2.0, _queue), (3.0, _jogging), (6.0, _servo_session),
    (9.0, _trajectory), (5.0, _velocity_jog), (12.0, _path), (1.5, _program),
    (0.5, _procedure("pause", None)), (0.7, _procedure("resume", None)),
    (0.5, _servo_mode(True)), (0.7, _servo_mode(False)), (1.5, _servo_stream), (0.5, _servo_burst), (2.5, _stop),
    (2.0, _stop_with_move),
    (0.5, _procedure("power", True, True, True, False)), (0.7, _procedure("enable", True, True, True, False)),
    (1.0, _procedure("clear_error", None)), (0.7, _procedure("recover", None)),
    (0.5, _procedure("hand_guiding", True, False, False)),
    (0.3, _procedure("tool_frame", 1, 2)), (0.3, _procedure("user_frame", 1, 2)), (0.3, _procedure("payload", 1.0)),
    (0.3, _procedure("query", None)))


LATER_CALLS: _Weighted = ((6.0, _point_stream),)
LATER = 1_000_000
"""The first seed that draws ``LATER_CALLS`` and the reserve of streams: those that are run with every change never
change themselves."""
_LATER_DIMENSIONS = ("servo_queue", "stop_drops_frames", "move_acceleration", "move_jerk_time", "joint_blend")


# ---- what goes wrong ----

def _with(kind: str, **choices: Any) -> _Draw:
    """Return the draw of an event's arguments: one of a list or tuple, or a number from a dict's ``low`` to
    ``high``."""
    def draw(chance: random.Random) -> Tuple[str, Dict[str, Any]]:
        args: Dict[str, Any] = {}
        for name, values in choices.items():
            if isinstance(values, dict):
                args[name] = _log_uniform(chance, values["low"], values["high"])
            else:
                args[name] = chance.choice(values)
        return kind, args
    return draw


_BRIEF = {"low": 0.02, "high": 3.0}

WIRE_FAULTS: _Weighted = (
    (4.0, _with("stall", port=("COMMAND", "STATUS", "both"), way=("to controller", "to driver", "both"),
                duration={"low": 0.01, "high": 4.0})),
    (4.0, _with("cut", port=("COMMAND", "STATUS", "both"), driver_learns=(True, True, False),
                controller_learns=(True, True, False))),
    (1.5, _with("refuse", port=("COMMAND", "STATUS", "both"), duration=_BRIEF)),
    (1.5, _with("unreachable", port=("COMMAND", "STATUS", "both"), duration=_BRIEF)),
    (1.0, _with("cut_and_refuse", port=("COMMAND", "STATUS", "both"), duration=_BRIEF)),
    (1.5, _with("slow_link", port=("STATUS", "STATUS", "COMMAND", "both"), carries=(0.5, 0.85, 0.93, 0.98),
                duration={"low": 1.0, "high": 20.0})),
    (0.7, _with("rival", step=(0.0, 0.2, -0.3), duration={"low": 0.1, "high": 8.0})),
    (1.0, _with("split", duration=_BRIEF)),
    (1.0, _with("noise", duration=_BRIEF)),
    (2.0, _with("lose_replies", count=(1, 1, 2, 5), command=("", "joint_move", "stop_program", "jog", "servo_move",
                                                              "moveL", "is_in_servomove", "movc", "kine_inverse",
                                                              "play_program"))))
FEED_FAULTS: _Weighted = (
    (4.0, _with("feed_shows", what=({"inpos": True}, {"inpos": True}, {"inpos": False}, {"enabled": False},
                                    {"powered_on": 0}, {"errcode": "0x020033"}, {"errcode": "0x7abcde"},
                                    {"errcode": "0xf0034"}, {"protective_stop": 1}, {"emergency_stop": 1},
                                    {"drag_status": True}, {"interp_state": 2}, {"interp_state": 3}),
                frames=(1, 1, 2, 5, 10))),
    (2.0, _with("feed_shows", what=({"inpos": True}, {"inpos": False}, {"errcode": "0x020033"},
                                    {"errcode": "0x7abcde"}), duration={"low": 0.1, "high": 20.0})),
    (1.0, _with("feed_drops", fields=(("inpos",), ("joint_actual_position",), ("actual_position",), ("enabled",),
                                      ("drag_status",), ("errcode",)), duration=_BRIEF)),
    (0.7, _with("feed_frozen", duration={"low": 0.1, "high": 5.0})),
    (0.7, _with("feed_repeats", frames=(1, 3, 10), age=(0.1, 0.5, 2.0))),
    (0.7, _with("feed_jumps", by=(2.0, 2.5, -2.0), frames=(1, 1, 5))),
    (1.5, _with("feed_silent", duration={"low": 0.05, "high": 5.0})),
    (2.0, _with("feed_mangled", how=("noise", "noise before", "cut off", "twice", "wrong byte"),
                frames=(1, 1, 3, 20))))
CONTROLLER_FAULTS: _Weighted = (
    (3.0, _with("refuse_stop", count=(1, 2, 5))),
    (1.0, _with("refuse_stop_for", duration={"low": 0.1, "high": 5.0})),
    (2.0, _with("refuse_command", command=("joint_move", "moveL", "jog", "servo_move", "servo_j", "power_on",
                                           "enable_robot", "is_in_servomove", "clear_error", "movc", "kine_inverse",
                                           "play_program", "resume_program"), duration=_BRIEF)),
    (3.0, _with("slow_replies", delay=(0.05, 0.3, 0.7, 1.5), duration=_BRIEF)),
    (4.0, _with("late_start", delay=(0.1, 0.5, 1.5), duration={"low": 0.5, "high": 8.0})),
    (0.7, _with("deny_servo_mode", duration={"low": 0.1, "high": 2.0})),
    (1.0, _with("restart", down=(0.3, 1.0, 3.0), silent=(True, False))),
    (1.5, _with("emergency_stop", held={"low": 0.1, "high": 3.0})),
    (2.0, _with("hit", force=(150.0,))),
    (2.0, _with("pendant_stop")),
    (0.7, _with("pendant_move", joint=(0, 3, 5), step=(0.1, -0.3))),
    (1.0, _with("push", joint=(0, 4), velocity=(0.2, -0.3), duration=(0.3, 2.0))),
    (0.5, _with("guide_at_arm", joint=(0, 4), velocity=(0.2, -0.3), duration=(0.3, 2.0))),
    (1.0, _with("pendant_pause", duration={"low": 0.1, "high": 5.0})),
    (0.5, _with("pendant_program", duration={"low": 0.1, "high": 5.0})),
    (1.0, _with("rapid_rate", rate=(0.0, 0.05, 0.3), duration={"low": 0.1, "high": 5.0})),
    (1.0, _with("lying_refusal", command=("joint_move", "moveL", "jog", "servo_move", "movc", "play_program"),
                duration=_BRIEF)))
DRIVER_FAULTS: _Weighted = ((1.0, _with("pause", duration={"low": 0.02, "high": 2.0})),
                            (0.05, _with("pause", duration={"low": 1.0, "high": 30.0})),
                            (0.15, _with("kill", restart_after={"low": 0.3, "high": 5.0})))


def _drawn(chance: random.Random, choices: _Weighted) -> Tuple[str, Dict[str, Any]]:
    weights = [weight for weight, _ in choices]
    return chance.choices([draw for _, draw in choices], weights)[0](chance)


def _takes(kind: str, args: Dict[str, Any], jog_timeout: float) -> float:
    """Return about how long a call has its effect where nothing disturbs it, s."""
    if kind == "jogging":
        return float(args["duration"]) * (1.5 if args["then_back"] else 1.0) + jog_timeout + 0.5
    if kind == "joint_move":
        return min(5.0, max(map(abs, args["delta"])) / args["speed"] + 0.5)
    if kind == "linear_move":
        return min(5.0, max(map(abs, args["shift"])) / args["speed"] + 0.5)
    if kind == "servo_session":
        return float(args["duration"]) + 1.0
    if kind in ("velocity_jog", "point_stream"):
        return float(args["duration"]) + 2.0
    if kind == "trajectory":
        return float(args["first_at"]) + float(args["apart"]) * len(args["ways"]) + 0.5
    if kind == "path":
        return min(5.0, 0.1 * len(args["segments"]) / args["speed"] + 0.5)
    if kind == "program":
        return 1.0 + sum(float(after) for _, after in args["steps"])
    return 1.0 if kind == "queue" else 0.1


def _aimed(chance: random.Random, events: Sequence[Event], jog_timeout: float) -> List[Event]:
    """Draw faults at the moments that matter: during a call, or when a jog is to end by itself."""
    aimed: List[Event] = []
    for event in events:
        if "caller" not in event.args or chance.random() > 0.15:
            continue
        faults = chance.choice((WIRE_FAULTS, FEED_FAULTS, CONTROLLER_FAULTS, CONTROLLER_FAULTS))
        at = event.at + chance.choice((0.0, chance.uniform(0.0, 0.01), chance.uniform(0.0, 0.2),
                                       chance.uniform(0.0, 2.0)))
        if event.kind == "jogging" and chance.random() < 0.7:
            at = event.at + event.args["duration"] + jog_timeout + chance.uniform(-0.3, 0.1)
        aimed.append(Event(at, *_drawn(chance, faults)))
    return aimed


_QUICK_DRIVES = {"power_delay": 0.5, "enable_delay": 0.3}
"""Times that quick drives take, s; where drives take 12 s, little else happens in a scenario."""
_CALMED: Dict[str, float] = {"start_delay": 0.75, "frame_bytes": 0.9, "missing_frame_fields": 0.5,
                             "missing_commands": 0.5}
"""Shares of scenarios in which a dimension keeps its default. An arm that begins seconds late is stopped each time, and
shows nothing else; frames of 15 kB cost ten times the time of others."""


def _dialect(chance: random.Random, seed: int, firmware: str) -> Dict[str, Any]:
    """Draw the controller's behaviour on every open point, where it differs from its firmware's default."""
    usual, drawn = Dialect.default(firmware), Dialect.from_seed(seed, firmware)
    values = {name: value for name, value in drawn.as_dict().items() if value != usual.as_dict()[name]}
    if seed < LATER:
        values = {name: value for name, value in values.items() if name not in _LATER_DIMENSIONS}
    if chance.random() < 0.7:
        values.update(_QUICK_DRIVES)
    calm = {name for name, share in _CALMED.items() if chance.random() < share}
    return {name: value for name, value in values.items() if name not in calm}


def dialect_of(scenario: Scenario) -> Dialect:
    """Return the controller's dialect."""
    return Dialect.default(scenario.firmware).replaced(scenario.dialect)


def generate(seed: int) -> Scenario:
    """Draw the scenario of a seed."""
    chance = random.Random(seed)
    length = chance.choice((8.0, 15.0, 25.0, 40.0))
    events: List[Event] = []
    favourites = list(CALLS) + (list(LATER_CALLS) if seed >= LATER else [])
    for _ in range(3):  # each seed has its taste: some jog most of the time, some stream, some stop
        index = chance.randrange(len(favourites))
        favourites[index] = (favourites[index][0] * chance.choice((0.0, 3.0, 8.0)) + 0.01, favourites[index][1])
    jog_timeout = chance.choice((3.0, 3.0, 1.0))
    for caller in range(chance.choice((1, 1, 1, 2, 2, 3, 4))):
        at, busy = chance.uniform(0.0, 1.0), chance.choice((0.3, 1.0, 2.5))
        patience = chance.choice((0.0, 0.7, 1.0))
        while at < length:
            kind, args = _drawn(chance, favourites)
            events.append(Event(at, kind, dict(args, caller=caller)))
            at += chance.expovariate(1.0 / busy)
            if chance.random() < patience:
                at += _takes(kind, args, jog_timeout)
    if chance.random() < 0.35:  # somebody with a hand on the stop button
        at = 0.0
        while at < length:
            at += chance.expovariate(1.0 / chance.choice((1.0, 4.0)))
            events.append(Event(at, "stop", {"caller": 9}))
    if chance.random() < 0.85:
        events.append(Event(0.5, "maintenance", {"every": chance.choice((0.7, 2.0)),
                                                 "recovers": chance.random() < 0.3}))
    for faults in (WIRE_FAULTS, FEED_FAULTS, CONTROLLER_FAULTS, DRIVER_FAULTS):
        apart = chance.choice((0.0, 0.0, 0.0, 0.0, 1.0, 2.5, 2.5, 6.0, 6.0, 6.0))
        at = chance.expovariate(1.0 / apart) if apart else length
        while at < length:
            events.append(Event(at, *_drawn(chance, faults)))
            at += chance.expovariate(1.0 / apart)
    if chance.random() < 0.5:
        events += _aimed(chance, events, jog_timeout)
    settings = {"feed_period": chance.choice((0.008, 0.03, 0.03, 0.03, 0.1, 0.1)),
                "reply_timeout": chance.choice((0.9, 0.9, 0.9, 0.4)),
                "motion_timeout": chance.choice((300.0, 20.0, 4.0)),
                "jog_timeout": jog_timeout,
                "servo_timeout": chance.choice((10.0, 2.0)),
                "link_loss_stop": chance.choice((0.3, 0.3, 0.0)),
                "power_timeout": chance.choice((30.0, 3.0)), "enable_timeout": chance.choice((30.0, 3.0))}
    if seed >= LATER:  # of a draw of its own, which changes no other
        settings["stream_ahead"] = random.Random("stream_ahead %d" % seed).choice((0, 0, 1, 2, 3, 4))
    is_simulator = chance.random() < 0.08
    if is_simulator:
        settings["simulator"] = chance.choice(("twin", "twin", "another"))
    is_foreign = settings.get("simulator") == "another"
    is_off = chance.random() < 0.15
    firmware = chance.choice(("1.5.14", "1.5.14", "1.7.1", "1.7.2"))
    return Scenario(
        seed, length, tuple(sorted(events, key=lambda event: event.at)), settings,
        firmware=firmware, start="off" if is_off else "enabled", dialect=_dialect(chance, seed, firmware),
        full_frames=chance.random() < 0.03,
        latency=chance.choice(((0.0001, 0.0005), (0.0001, 0.001), (0.0005, 0.005))),
        lateness=chance.choice((0.0, 0.0002, 0.002)), identity="twin" if is_simulator else "",
        auto_enable=is_off or chance.random() < 0.1, has_turns=chance.random() < 0.5, has_guard=chance.random() < 0.5,
        ends="close" if is_foreign else chance.choice(("close", "leave", "close in trouble")))
