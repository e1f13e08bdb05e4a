"""The stage that sends nothing: the status feed for a while, with a second client of it for the second half."""
import dataclasses
import select
import time
from typing import Callable, Dict, FrozenSet, List, Optional, Sequence, Set, Tuple, Union

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.errors import FramingError, JakaError
from jaka_ros_driver.kinematics.arm_models import load_model, model_names
from jaka_ros_driver.kinematics.pose_check import Deviation, deviation
from jaka_ros_driver.kinematics.rotations import IDENTITY, Transform, transform_from_pose
from jaka_ros_driver.probe.facts import Fact, Facts
from jaka_ros_driver.probe.fields import FrameFields
from jaka_ros_driver.probe.recorded import ConnectionLog, KeptConnection, quantile
from jaka_ros_driver.protocol.framing import MAX_FRAME_BYTES, FrameStream
from jaka_ros_driver.protocol.status import parse_status
from jaka_ros_driver.simulation.dialect.dimension import Subset
from jaka_ros_driver.simulation.dialect.table import DIMENSIONS
from jaka_ros_driver.state import RobotState, Vector, are_still
from jaka_ros_driver.units import deg_to_rad, m_to_mm, mm_to_m, rad_to_deg

_ENOUGH_FRAMES = 10
"""Fewest frames of which a period is told: with fewer one late frame decides."""
_REGULAR, _REGULAR_S, _MOST = 0.3, 0.002, 0.8
"""A feed has a period where so many of its pauses differ by no more than this share, or this time, from their mean."""
_NEVER = "no frame came"
_LEFT_OUT = DIMENSIONS["missing_frame_fields"]
OMITTED: FrozenSet[str] = frozenset(_LEFT_OUT.names if isinstance(_LEFT_OUT, Subset) else ())
"""Fields that a controller can be set up to leave out (docs/controller-protocol.md section 6.1), as far as the
simulated one can do so.
"""
KNOWN = OMITTED | frozenset((
    "len errcode joint_actual_position din dout ain aout tio_din tio_dout tio_ain homed task_mode enabled "
    "emergency_stop drag_near_limit funcdi powered_on inpos motion_mode protective_stop point_key netState "
    "joint_position position tio_key motion_line err_add_line instVel tio_rs_signals relay_io mb_slave_din "
    "mb_slave_dout mb_slave_ain mb_slave_aout pn_dev_din pn_dev_dout pn_dev_ain pn_dev_aout eip_adpt_din eip_adpt_dout "
    "eip_adpt_ain eip_adpt_aout extio").split())
"""Fields of frames that sources name (docs/controller-protocol.md sections 6.2 to 6.4)."""


class HeardFeed:
    """Frames of one client of the status port.

    Attributes:
        times: When each whole frame had come, monotonic s.
        states: The newest ones that could be read, oldest first.
        fields: The names of all fields.
        lengths: Of frames, bytes.
        damaged: Number of frames that were cut or wrong.
        kinds: Takes the fields of each whole frame; None where nobody asks for types and ranges.
        on_state: Takes each state that could be read; None for nobody.
    """

    _KEPT = 50
    """Newest states that are kept, for a look whether the arm is at rest: memory does not grow with the time of
    listening."""

    def __init__(self, connection: KeptConnection) -> None:
        self.connection = connection
        self._stream = FrameStream()
        self.times: List[float] = []
        self.states: List[RobotState] = []
        self.fields: Set[str] = set()
        self.lengths: List[int] = []
        self.damaged = 0
        self.kinds: Optional[FrameFields] = None
        self.on_state: Optional[Callable[[RobotState], None]] = None

    def read(self) -> None:
        """Take what has come."""
        for item in self._stream.feed(self.connection.receive_now()):
            now = time.monotonic()
            if isinstance(item, FramingError):
                self.damaged += 1
                continue
            length = item.get("len", 0)  # of several keys of this name JSON has the last one
            if type(length) is not int or not 0 <= length <= MAX_FRAME_BYTES:
                self.damaged += 1
                continue
            self.times.append(now)
            self.fields.update(item)
            self.lengths.append(length)
            if self.kinds is not None:
                self.kinds.take(item, now)
            try:
                self.states = [*self.states[1 - self._KEPT:], parse_status(item, now)]
            except JakaError:
                self.damaged += 1
                continue
            if self.on_state is not None:
                self.on_state(self.states[-1])

    @property
    def gaps(self) -> List[float]:
        """Times between frames, s."""
        return [later - before for before, later in zip(self.times, self.times[1:])]


class HeardPort:
    """The bytes that a port sends to a client that asks for nothing.

    Attributes:
        pieces: How many pieces came.
        size: Their bytes.
        frames: Whole frames among them.
    """

    def __init__(self, connection: KeptConnection) -> None:
        self.connection = connection
        self._stream = FrameStream()
        self.pieces = self.size = self.frames = 0

    def read(self) -> None:
        """Take what has come."""
        data = self.connection.receive_now()
        self.pieces += bool(data)
        self.size += len(data)
        self.frames += sum(not isinstance(item, FramingError) for item in self._stream.feed(data))

    def fact(self, seconds: float) -> Fact:
        """Return what it sent within this time, s."""
        how = "%d bytes in %d pieces within %.1f s, %d whole frames among them%s" % (
            self.size, self.pieces, seconds, self.frames,
            "; it closed the connection" if self.connection.is_closed else "")
        return Fact("frames" if self.frames else "bytes that are no frames" if self.size else "nothing", how)


def listen(feeds: Sequence[Union[HeardFeed, HeardPort]], until: float) -> None:
    """Read these feeds until a moment of ``time.monotonic``, or until all are closed."""
    while time.monotonic() < until:
        open_feeds = {feed.connection: feed for feed in feeds if not feed.connection.is_closed}
        if not open_feeds:
            return
        ready, _, _ = select.select(list(open_feeds), [], [], max(0.0, until - time.monotonic()))
        for connection in ready:
            open_feeds[connection].read()


def look(record: ConnectionLog, facts: Facts, status_port: int, poll_port: int, seconds: float) -> Optional[HeardFeed]:
    """Listen to the status port, and for the first half of the time to the polled port; send nothing.

    Args:
        record: Has the connections.
        facts: Takes what is found, also where this is interrupted.
        status_port: TCP port of the feed.
        poll_port: TCP port that the maker's SDK polls.
        seconds: How long to listen, s.

    Returns:
        What the client got that stays connected; None where there is none.
    """
    facts["polled_port"], polled = _polled_port(record, poll_port)
    try:
        first = HeardFeed(record.connect("status", status_port))
    except OSError as error:
        facts["feed_period"] = Fact(None, "the status port %d: %s" % (status_port, error))
        return None
    first.kinds = FrameFields(OMITTED | KNOWN)
    begun = time.monotonic()
    try:
        _listen_to_both(facts, first, polled, begun + 0.5 * seconds)
        return _second_client(facts, first, record, status_port, begun + seconds)
    finally:
        facts.update(feed_facts(first, time.monotonic() - begun))
        facts.update(kinematics_facts(first, None, None))
        first.kinds = None


def _polled_port(record: ConnectionLog, number: int) -> Tuple[Fact, Optional[HeardPort]]:
    try:
        heard = HeardPort(record.connect("poll", number))
        return Fact("open", "port %d was connected" % number), heard
    except ConnectionRefusedError:
        return Fact("closed", "port %d: connection refused" % number), None
    except OSError as error:
        return Fact(None, "port %d: %s" % (number, error)), None


def _listen_to_both(facts: Facts, first: HeardFeed, polled: Optional[HeardPort], until: float) -> None:
    """Listen to the status port and the polled port; then close the latter."""
    begun = time.monotonic()
    try:
        listen([first, *([polled] if polled is not None else [])], until)
    finally:
        if polled is not None:
            facts["polled_port_sends"] = polled.fact(time.monotonic() - begun)
            polled.connection.close()


def _second_client(facts: Facts, first: HeardFeed, record: ConnectionLog, port: int,
                   until: float) -> Optional[HeardFeed]:
    """Connect a second client, and see which of the two gets frames; return one that still does."""
    if first.connection.is_closed:
        facts["second_status_client"] = Fact(None, "the first connection was closed before a second one came")
        return None
    try:
        second = HeardFeed(record.connect("status", port))
    except OSError as error:
        facts["second_status_client"] = Fact("refused", "it could not connect: %s" % error)
        listen([first], until)
        return first
    before = len(first.times)
    listen([first, second], until)
    seen = "the first got %d frames meanwhile, the second %d" % (len(first.times) - before, len(second.times))
    if first.connection.is_closed and second.times:
        facts["second_status_client"] = Fact("replaces", "the first connection was closed; " + seen)
        return second
    if second.connection.is_closed and not second.times:
        facts["second_status_client"] = Fact("refused", "the second connection was closed; " + seen)
    elif second.times and len(first.times) > before:
        facts["second_status_client"] = Fact("coexists", seen)
        second.connection.close()
    else:
        facts["second_status_client"] = Fact(None, seen)
    return first if not first.connection.is_closed else None


def feed_facts(feed: HeardFeed, seconds: float) -> Facts:
    """Return what the frames of a feed say of it."""
    frames, gaps = len(feed.times), feed.gaps
    how = "%d frames in %.1f s" % (frames, seconds)
    if not frames:
        return {name: Fact(None, _NEVER) for name in (
            "feed_period", "feed_longest_gap", "frame_bytes", "frame_fields_missing", "frame_fields_unknown",
            "frame_fields", "frame_clock")}
    facts = {
        "feed_damage": Fact(feed.damaged, how),
        "frame_bytes": Fact(max(feed.lengths), how, "%d to %d" % (min(feed.lengths), max(feed.lengths))),
        "frame_fields_missing": Fact(sorted(OMITTED - feed.fields), how),
        "frame_fields_unknown": Fact(sorted(feed.fields - KNOWN), how)}
    if feed.kinds is not None:
        facts.update(feed.kinds.facts(how))
    if frames < _ENOUGH_FRAMES:
        facts["feed_period"] = Fact(None, how + ", too few")
        return facts
    mean = (feed.times[-1] - feed.times[0]) / len(gaps)
    spread = "98 of 100 pauses are %.4f to %.4f" % (quantile(gaps, 0.01), quantile(gaps, 0.99))
    regular = sum(abs(gap - mean) <= max(_REGULAR_S, _REGULAR * mean) for gap in gaps)
    facts["feed_period"] = Fact(round(mean, 5), "mean of " + how, spread) if regular >= _MOST * len(gaps) else Fact(
        None, "%s, irregularly: this computer or the network is busy; %s" % (how, spread))
    facts["feed_longest_gap"] = Fact(round(max(gaps), 4), how)
    return facts


_UNITS: Dict[str, Tuple[Callable[[float], float], Callable[[float], float]]] = {
    "deg and mm": (float, float), "rad and mm": (rad_to_deg, float), "deg and m": (float, m_to_mm),
    "rad and m": (rad_to_deg, m_to_mm)}
"""Units of angles and lengths, each with what makes a number in it one of degrees and of millimetres."""


def kinematics_facts(feed: Optional[HeardFeed], tools: Optional[Sequence[Pose]],
                     users: Optional[Sequence[Pose]]) -> Facts:
    """Compare the controller's pose of the tool with that of each model, from the same joints: which fits, in which
    units?

    Args:
        feed: The newest states.
        tools: The controller's tools, in the flange, by id; None where they are not known: tool 0 is the flange.
        users: Its user frames, in the base, by id; None where they are not known: frame 0 is the base.
    """
    if feed is None or not feed.states:
        return _not_compared(_NEVER)
    state = feed.states[-1]
    if not are_still(feed.states):
        return _not_compared("the arm moved: joints and pose of a frame may be of two cycles")
    tool, user = _frame(state.tool_id, tools), _frame(state.user_frame_id, users)
    found = {units: _deviations(_in_units(state, *convert), tool, user) for units, convert in _UNITS.items()}
    expected = found["deg and mm"]
    if not expected:
        return _not_compared("tool %s and user frame %s: the pose of the flange is not known" % (
            state.tool_id, state.user_frame_id))
    fitting = {units: [name for name, difference in rows.items() if not difference.is_wrong]
               for units, rows in found.items()}
    nearest = min(expected, key=lambda name: expected[name])
    how = "nearest is %s, %.2f mm and %.4f rad away, of %d models" % (
        nearest, expected[nearest].distance * 1000.0, expected[nearest].angle, len(expected))
    units = [one for one, names in fitting.items() if names]
    return {"model": Fact(fitting["deg and mm"], how), "units": Fact(
        units[0] if len(units) == 1 else None, "a model fits in %s of %s" % (
            " and in ".join(units) or "none", ", ".join(_UNITS)))}


def _not_compared(why: str) -> Facts:
    return {name: Fact(None, why) for name in ("model", "units")}


def _deviations(state: RobotState, tool: Optional[Transform], user: Optional[Transform]) -> Dict[str, Deviation]:
    compared = ((name, deviation(load_model(name), state, tool, user)) for name in model_names())
    return {name: difference for name, difference in compared if difference is not None}


def _in_units(state: RobotState, to_deg: Callable[[float], float], to_mm: Callable[[float], float]) -> RobotState:
    """Return a state, read as one in degrees and millimetres, as it is where its numbers are in other units."""
    def angles(values: Vector) -> Vector:
        return tuple(deg_to_rad(to_deg(rad_to_deg(value))) for value in values)
    return dataclasses.replace(
        state, joint_position=angles(state.joint_position),
        tcp_rpy=None if state.tcp_rpy is None else angles(state.tcp_rpy),
        tcp_position=None if state.tcp_position is None else tuple(
            mm_to_m(to_mm(m_to_mm(value))) for value in state.tcp_position))


def _frame(number: Optional[int], frames: Optional[Sequence[Pose]]) -> Optional[Transform]:
    if number == 0:
        return IDENTITY
    if number is None or frames is None or not 0 <= number < len(frames):
        return None
    return transform_from_pose(frames[number])


