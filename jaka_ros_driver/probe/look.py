"""The stage that sends nothing: the status feed for a while, with a second client of it for the second half."""
import select
import time
from typing import Callable, FrozenSet, List, Optional, Sequence, Set

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.errors import FramingError, JakaError
from jaka_ros_driver.kinematics.arm_models import load_model, model_names
from jaka_ros_driver.kinematics.pose_check import deviation
from jaka_ros_driver.kinematics.rotations import IDENTITY, Transform, transform_from_pose
from jaka_ros_driver.probe.facts import Fact, Facts
from jaka_ros_driver.probe.recorded import ConnectionLog, KeptConnection, quantile
from jaka_ros_driver.protocol.framing import MAX_FRAME_BYTES, FrameStream
from jaka_ros_driver.protocol.status import parse_status
from jaka_ros_driver.simulation.dialect.dimension import Subset
from jaka_ros_driver.simulation.dialect.table import DIMENSIONS
from jaka_ros_driver.state import RobotState, are_still

_ENOUGH_FRAMES = 10
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
        on_state: Takes each state that could be read; None for nobody.
    """

    _KEPT = 50

    def __init__(self, connection: KeptConnection) -> None:
        self.connection = connection
        self._stream = FrameStream()
        self.times: List[float] = []
        self.states: List[RobotState] = []
        self.fields: Set[str] = set()
        self.lengths: List[int] = []
        self.damaged = 0
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


def listen(feeds: Sequence[HeardFeed], until: float) -> None:
    """Read these feeds until a moment of ``time.monotonic``, or until all are closed."""
    while time.monotonic() < until:
        open_feeds = {feed.connection: feed for feed in feeds if not feed.connection.is_closed}
        if not open_feeds:
            return
        ready, _, _ = select.select(list(open_feeds), [], [], max(0.0, until - time.monotonic()))
        for connection in ready:
            open_feeds[connection].read()


def look(record: ConnectionLog, facts: Facts, status_port: int, poll_port: int, seconds: float) -> Optional[HeardFeed]:
    """Listen to the status port, and see whether the polled port is open; send nothing.

    Args:
        record: Has the connections.
        facts: Takes what is found, also where this is interrupted.
        status_port: TCP port of the feed.
        poll_port: TCP port that the maker's SDK polls.
        seconds: How long to listen, s.

    Returns:
        What the client got that stays connected; None where there is none.
    """
    facts["polled_port"] = _polled_port(record, poll_port)
    try:
        first = HeardFeed(record.connect("status", status_port))
    except OSError as error:
        facts["feed_period"] = Fact(None, "the status port %d: %s" % (status_port, error))
        return None
    begun = time.monotonic()
    try:
        listen([first], begun + 0.5 * seconds)
        return _second_client(facts, first, record, status_port, begun + seconds)
    finally:
        facts.update(feed_facts(first, time.monotonic() - begun))
        facts["model"] = model_fact(first, None, None)


def _polled_port(record: ConnectionLog, number: int) -> Fact:
    try:
        record.connect("poll", number).close()
        return Fact("open", "port %d was connected and closed again" % number)
    except ConnectionRefusedError:
        return Fact("closed", "port %d: connection refused" % number)
    except OSError as error:
        return Fact(None, "port %d: %s" % (number, error))


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
            "feed_period", "feed_longest_gap", "frame_bytes", "frame_fields_missing", "frame_fields_unknown")}
    facts = {
        "feed_damage": Fact(feed.damaged, how),
        "frame_bytes": Fact(max(feed.lengths), how, "%d to %d" % (min(feed.lengths), max(feed.lengths))),
        "frame_fields_missing": Fact(sorted(OMITTED - feed.fields), how),
        "frame_fields_unknown": Fact(sorted(feed.fields - KNOWN), how)}
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


def model_fact(feed: Optional[HeardFeed], tools: Optional[Sequence[Pose]], users: Optional[Sequence[Pose]]) -> Fact:
    """Compare the controller's pose of the tool with that of each model, from the same joints.

    Args:
        feed: The newest states.
        tools: The controller's tools, in the flange, by id; None where they are not known: tool 0 is the flange.
        users: Its user frames, in the base, by id; None where they are not known: frame 0 is the base.
    """
    if feed is None or not feed.states:
        return Fact(None, _NEVER)
    state = feed.states[-1]
    if not are_still(feed.states):
        return Fact(None, "the arm moved: joints and pose of a frame may be of two cycles")
    tool, user = _frame(state.tool_id, tools), _frame(state.user_frame_id, users)
    compared = ((name, deviation(load_model(name), state, tool, user)) for name in model_names())
    found = {name: difference for name, difference in compared if difference is not None}
    if not found:
        return Fact(None, "tool %s and user frame %s: the pose of the flange is not known" % (
            state.tool_id, state.user_frame_id))
    fitting = [name for name, difference in found.items() if not difference.is_wrong]
    nearest = min(found, key=lambda name: found[name])
    how = "nearest is %s, %.2f mm and %.4f rad away, of %d models" % (
        nearest, found[nearest].distance * 1000.0, found[nearest].angle, len(found))
    return Fact(fitting, how)


def _frame(number: Optional[int], frames: Optional[Sequence[Pose]]) -> Optional[Transform]:
    if number == 0:
        return IDENTITY
    if number is None or frames is None or not 0 <= number < len(frames):
        return None
    return transform_from_pose(frames[number])


