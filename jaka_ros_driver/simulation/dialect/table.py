"""The table of open points, and ``Dialect``, one choice of a value for each.

A field of ``Dialect`` is a dimension: its name, values, meaning, evidence and default stand here and nowhere else.
Tags and sections are those of docs/controller-protocol.md; those that begin with sdk, of docs/sdk-client.md. Times are
simulated time.
"""
import dataclasses
from dataclasses import dataclass
from typing import Any, Dict, Mapping, Tuple

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.simulation.dialect.dimension import Choice, Dice, Dimension, Range, Subset, firmware_name
from jaka_ros_driver.yaml_text import load_yaml, short

_DIMENSION = "dimension"
EARLY, HELD = "early", "held"
"""Times of the reply to a slow command: at once, or when it is done."""
REPLACES, REFUSED, COEXISTS = "replaces", "refused", "coexists"
"""Fates of a second command client, or of the first because of it."""
EITHER = "either"


def _dimension(dimension: Dimension) -> Any:
    return dataclasses.field(metadata={_DIMENSION: dimension})


def _choice(meaning: str, evidence: str, values: Tuple[str, ...], *defaults: str) -> Any:
    return _dimension(Choice(meaning, evidence, defaults, values))


def _flag(meaning: str, evidence: str, *defaults: bool) -> Any:
    return _dimension(Choice(meaning, evidence, defaults))


def _range(meaning: str, evidence: str, low: float, high: float, unit: str, *defaults: float) -> Any:
    return _dimension(Range(meaning, evidence, defaults, low, high, unit))


def _subset(meaning: str, evidence: str, *names: str) -> Any:
    return _dimension(Subset(meaning, evidence, ((),), names))


@dataclass(frozen=True)
class Dialect:
    """One controller that could be real."""

    # --- replies to what takes time ---
    power_delay: float = _range(
        "from `power_on` to energised drives", "about 8 s [D?], clients wait 8 to 20 s [C]: 5.1", 0.0, 15.0, "s", 8.0)
    power_reply: str = _choice(
        "the reply to `power_on` comes at once, or when the drives have power",
        "1.5.14: power is there at the reply [O]; 1.7.2 and V3: two clients get it at once and poll [C]: 5.1",
        (EARLY, HELD), HELD, EARLY, EARLY)
    power_reply_delay: float = _range(
        "how much later than that it comes", "clients wait up to 10 s for it [C]; SDK calls block for more [D]: 5.1",
        0.0, 10.0, "s", 0.0)
    enable_delay: float = _range(
        "from `enable_robot` to released brakes", "3 to 15 s, mostly 4 [C]: 5.1", 0.0, 15.0, "s", 4.0)
    enable_reply: str = _choice(
        "the reply to `enable_robot` comes at once, or when the brakes are open", "as power_reply: 5.1",
        (EARLY, HELD), HELD, EARLY, EARLY)
    enable_reply_delay: float = _range("how much later than that it comes", "as power_reply_delay: 5.1",
                                       0.0, 10.0, "s", 0.0)
    frame_delay: float = _range(
        "from `set_tool_id`, `set_user_id` to the active frame", "asynchronous [D HDR], time not known: 5.7",
        0.0, 2.0, "s", 0.04)
    frame_reply: str = _choice("their reply comes at once, or when the frame is active", "not known: 5.7",
                               (EARLY, HELD), EARLY)
    frame_reply_delay: float = _range("how much later than that it comes", "SDK time-outs -55, -56 exist [D]: 5.7",
                                      0.0, 10.0, "s", 0.0)
    drag_delay: float = _range("from `torque_control_enable` to hand guiding, and back", "not known: 5.8",
                               0.0, 2.0, "s", 0.0)
    drag_reply: str = _choice("its reply comes at once, or when hand guiding is on (off)", "not known: 5.8",
                              (EARLY, HELD), EARLY)
    drag_reply_delay: float = _range("how much later than that it comes", "not known: 5.8", 0.0, 10.0, "s", 0.0)
    behind_slow_reply: str = _choice(
        "requests behind a reply that is not there yet: carried out, and answered after it (waits); not carried out "
        "before it (blocks); carried out and answered before it (overtakes)",
        "replies come in order of the requests [C]; whether requests wait is not known: 3.2, 5.1",
        ("waits", "blocks", "overtakes"), "waits")

    # --- motion ---
    start_delay: float = _range("from the acceptance of a move or jog, by an arm at rest, to its first motion",
                                "a reply says that a command was received, no more [D]: 2", 0.0, 20.0, "s", 0.0)
    move_acceleration: float = _range(
        "acceleration of a move, as a share of what it asks for",
        "`accel` is the acceleration [D*]; whether a controller keeps to it is not known [I]: 5.2",
        0.2, 4.0, "times", 1.0)
    move_jerk_time: float = _range("how long the acceleration of moves and jogs builds up, where the simulation has "
                                   "ruckig", "an S-curve exists [D HDR]; its jerk is not known [I]: 5.4.3",
                                   0.0, 0.2, "s", 0.05)
    joint_blend: bool = _flag(
        "`tol` of a `joint_move` is kept: the arm passes its target without a stop where the next one, which came in "
        "time, goes on along the same line at the same speed and acceleration",
        "the SDK sends it [O]; no source documents it on the wire: 5.2", False)
    inpos: str = _choice(
        "`inpos` is true at rest; already while the arm moves (early); 2 s after it rests (late); never",
        "early: may be since 1.5.13.8, 1.7.0.45, 1.7.1.7 [D], in which cases is not known; exact: clients end moves by "
        "it [C]: 6.2", ("exact", "early", "late", "never"), "exact")
    stop_ends_jog: bool = _flag("`stop_program` ends a jog", "clients send it for that [C], it is said of all motion "
                                "[D]; none shows it of a jog [I]: 5.4.4, 5.5", True)
    stop_ends_servo: bool = _flag("`stop_program` ends a servo stream",
                                  "a client leaves servo mode before it sends it [C]: 5.6.1", True)
    stop_ends_program: bool = _flag("`stop_program` ends a program that runs", "so named and used [C]: 5.4.4", True)
    jog_stop_ends: str = _choice("`jog` mode 0 ends the jog of any axis, or only that of the axis it names",
                                 "SDK: same axis, or -1 for all, which sends six requests [O]: 5.5",
                                 ("any", "its axis"), "any")
    pause_pauses_moves: bool = _flag("`pause_program` also pauses moves that no program asked for",
                                     "not known: 5.4.5", True)
    servo_leave_delay: float = _range(
        "from `servo_move` 0 to the end of servo mode; meanwhile `is_in_servomove` is true and moves are refused",
        "SDK 2.1.14 needs one poll, from 1 ms later on, that reads true, and public clients see success [O, C]: 5.6.1",
        0.0, 0.1, "s", 0.024)
    starvation: str = _choice(
        "a servo stream that runs dry: holds its last target, repeats its last increment, coasts to rest, or ends "
        "servo mode after 0.1 s (fault)", "hold [I]; one user measured repeat [C]; none saw an error: 5.6.5",
        ("hold", "repeat", "coast", "fault"), "hold")
    servo_queue: int = _dimension(Choice(
        "servo frames that wait behind the one for the next cycle; further ones are ignored",
        "sending faster than 8 ms is allowed on bad networks [D*, D], so that some wait, or are lost; the SDK has "
        "filters over max_buf points, the vendor's ROS driver asks for 15 [C]; how many wait is not known: 5.6.5, "
        "5.6.6",
        (49,), (0, 1, 4, 49)))
    stop_drops_frames: bool = _flag(
        "`stop_program` and `servo_move` 0 drop the servo frames that wait; else these run out first",
        "not known: 5.6.1", True)
    refused_move_event: bool = _flag(
        "`errcode` shows the event of a refused move until the next one is accepted",
        "0x0F0011, 17, 20, 38 are such events [D ERR]; on 1.5.14 a refusal left the feed clean [O]: 4.3, 4.4",
        False, True, True)
    disabled_note: str = _choice("the note 0x10f0005 after `disable_robot` stands until the drives are enabled, or 1 s",
                                 "its life time is not known: 4.4", ("until enabled", "brief"), "until enabled")

    # --- clients ---
    second_client: str = _choice(
        "a second command client replaces the first with its first request, is refused, or is served beside it",
        "it may replace the first [D]; is closed at once [C]; two public stacks open one for each request beside the "
        "SDK's own [C]: 1", (REPLACES, REFUSED, COEXISTS), COEXISTS)
    link_loss_notice: float = _range(
        "from the loss of a client to the controller's notice of it, beside the time that the client has set",
        "not known: 5.13", 0.0, 5.0, "s", 0.0)
    missing_commands: Tuple[str, ...] = _subset(
        "these commands are not known (error code 1)",
        "emergency_stop_status: code 1 on 1.5.14 [O], yet SDK 2.1.14 asks it there [O]; get_motion_state: from 1.7.2 "
        "[C]; wait_complete: deprecated [D]; the others not known: 5.4.6, 5.4.7, 5.8, 5.10, 5.13, 6.1",
        "set_network_exception_handle", "emergency_stop_status", "get_motion_state", "wait_complete",
        "torque_control_enable", "set_port10000_delay_ms")

    # --- what a reply and a request look like ---
    error_code: str = _choice("`errorCode` is a text or a number",
                              "text [O]; on V3 either [D*]; a number ends SDK 2.1.11 [O]: 4.3",
                              ("text", "number"), "text")
    unready_code: str = _choice(
        "a motion is refused, while the drives are not ready, with code 2, or with the SDK's code for it",
        "not observed [I]; negative codes are expected by one client [C CS1]: 4.3", ("2", "sdk"), "2")
    robot_state: str = _choice("`get_robot_state` answers texts, or numbers with `errcode`",
                               "texts: 1.5.14 [O]; numbers: 1.7 [D*]; the border is not known: 5.1",
                               ("texts", "numbers"), "texts", "numbers", "numbers")
    sensitivity_key: str = _choice("the key of the reply of `get_clsn_sensitivity`",
                                   "sensitivityLevel: SDK [O], LR [C]; sensitivityVal: CS2 [C]: 5.9",
                                   ("both", "sensitivityLevel", "sensitivityVal"), "both")
    user_frame_key: str = _choice("the key of `set_user_offsets` that is read", "userffset: SDK [O], CPPW, FMCV [C]; "
                                  "useroffset: LR [C]: 5.7", (EITHER, "userffset", "useroffset"), EITHER)
    io_index_base: int = _dimension(Choice(
        "index of the first terminal in commands; an index below is refused",
        "1: V3 page by a user's notes [D*], LRB on 1.7.2, a plant's client [C], SDK 2.1.14 adds 1 [O]; 0: WHI, LEX "
        "[C], SDK 2.1.11 adds nothing [O]: 5.11", (0, 1, 1), (0, 1)))
    unknown_reply_fields: bool = _flag("replies have fields that nobody asked for", "not known of newer versions: 4.3",
                                       False)

    # --- the status feed ---
    feed_period: float = _range("period before a client has set one", "30 ms on 1.5.14 [O]; 20 to 100 ms [C]: 6.1",
                                0.008, 0.1, "s", 0.03)
    shortest_feed_period: float = _range("shortest period that it really sends at, whatever it was asked for",
                                         "50 and 100 ms were used [C]; not known: 6.1", 0.001, 0.1, "s", 0.001)
    feed_period_persists: bool = _flag("`set_port10000_delay_ms` survives a restart", "it does not [C]: 6.1", False)
    frame_bytes: int = _range("frames are filled up with fields that nobody knows to this length",
                              "up to 8979 seen [C], near 15000 documented for V3 [D*]: 3.3", 0, 15000, "bytes", 0)
    unknown_frame_fields: bool = _flag("frames have fields that nobody knows", "1.7 has more than 1.5.14 [D*]: 6.2",
                                       False)
    missing_frame_fields: Tuple[str, ...] = _subset(
        "frames lack these fields", "the controller can be set up to leave fields out [D]: 6.1",
        "drag_status", "interp_state", "on_soft_limit", "paused", "rapidrate", "actual_position", "errmsg",
        "monitor_data", "torqsensor", "curr_tcp_trans_vel", "current_tool_id", "current_user_id", "task_state")

    @classmethod
    def default(cls, firmware: str) -> "Dialect":
        """Return the likeliest controller of this firmware; raise InvalidCommand for an unknown one."""
        name = firmware_name(firmware)
        return cls(**{key: dimension.default(name) for key, dimension in DIMENSIONS.items()})

    @classmethod
    def from_seed(cls, seed: int, firmware: str) -> "Dialect":
        """Draw every dimension. Each has dice of its own, so that a new one changes no other."""
        name = firmware_name(firmware)
        return cls(**{key: dimension.draw(Dice("%d %s %s" % (seed, name, key)), name)
                      for key, dimension in DIMENSIONS.items()})

    @classmethod
    def from_file(cls, path: str, firmware: str) -> "Dialect":
        """Read a YAML or JSON file with some of the dimensions; the others are the firmware's.

        Raises:
            InvalidCommand: The file cannot be read, a name is unknown, or a value is none of its dimension.
        """
        try:
            with open(path, encoding="utf-8") as file:
                values = load_yaml(file.read())
        except (OSError, UnicodeDecodeError, InvalidCommand) as error:
            raise InvalidCommand("dialect file %s: %s" % (path, error)) from error
        if not isinstance(values, dict):
            raise InvalidCommand("dialect file %s: it must hold names and values" % path)
        try:
            return cls.default(firmware).replaced(values)
        except InvalidCommand as error:
            raise InvalidCommand("dialect file %s: %s" % (path, error)) from error

    def replaced(self, values: Mapping[Any, Any]) -> "Dialect":
        """Return a copy with these values.

        Raises:
            InvalidCommand: A name is unknown, or a value is none of its dimension.
        """
        changes: Dict[str, Any] = {}
        for name, value in values.items():
            dimension = DIMENSIONS.get(name)
            if dimension is None:
                raise InvalidCommand("%s is no dimension; these are: %s" % (short(name), ", ".join(DIMENSIONS)))
            try:
                changes[name] = dimension.checked(value)
            except ValueError:
                raise InvalidCommand("%s is %s; it must be %s%s" % (
                    name, short(value), "one of " if isinstance(dimension, Choice) else "",
                    dimension.described())) from None
        return dataclasses.replace(self, **changes)

    def as_dict(self) -> Dict[str, Any]:
        """Return every dimension with its value, as JSON has it; ``from_file`` reads it."""
        return {name: list(value) if isinstance(value, tuple) else value
                for name, value in dataclasses.asdict(self).items()}

    def knows(self, command: str) -> bool:
        """Return whether a command is not one of ``missing_commands``."""
        return command not in self.missing_commands


DIMENSIONS: Dict[str, Dimension] = {field.name: field.metadata[_DIMENSION] for field in dataclasses.fields(Dialect)}
"""Every dimension by its name, in the order of the table."""
