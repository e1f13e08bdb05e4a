"""Messages packed by a layout: the bytes of the generated classes, and the publishing of rospy, without a master."""
import io
import math
import random
import socket
import struct

import diagnostic_msgs.msg
import genpy
import pytest
import rospy
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from link_transport import LinkTransport
from rospy.msg import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float32, Float64, Float64MultiArray, String
from tf2_msgs.msg import TFMessage
from waiting import eventually

from jaka_msgs import msg as messages
from jaka_ros_driver.ros import convert, packed
from jaka_ros_driver.ros.direct_publisher import DirectConnection
from jaka_ros_driver.ros.other_messages import message_type
from jaka_ros_driver.ros.packed import PackedLayout, PackedTopic

TYPES = (TwistStamped, PoseStamped, WrenchStamped, JointState, Bool, Float64, Float64MultiArray, TFMessage, String,
         diagnostic_msgs.msg.DiagnosticArray, messages.RobotMsg, messages.IOStates, messages.MotionState,
         messages.ProgramState, messages.ServiceCall, *map(message_type, (
             "industrial_msgs/RobotStatus", "control_msgs/JointTrajectoryControllerState",
             "control_msgs/FollowJointTrajectoryFeedback", "visualization_msgs/MarkerArray")))
"""All types that the driver publishes."""
SHAPES, DRAWS = 100, 100
WHOLE = {"bool": (0, 1), "int8": (-2 ** 7, 2 ** 7 - 1), "byte": (-2 ** 7, 2 ** 7 - 1), "uint8": (0, 2 ** 8 - 1),
         "char": (0, 2 ** 8 - 1), "int16": (-2 ** 15, 2 ** 15 - 1), "uint16": (0, 2 ** 16 - 1),
         "int32": (-2 ** 31, 2 ** 31 - 1), "uint32": (0, 2 ** 32 - 1), "int64": (-2 ** 63, 2 ** 63 - 1),
         "uint64": (0, 2 ** 64 - 1)}
TIMES = {"time": (genpy.Time, "uint32"), "duration": (genpy.Duration, "int32")}
FLOATS = (0.0, -0.0, 1.0, math.nan, math.inf, -math.inf, 1e-40, -1.5e-30, 3e38)
TEXTS = ("", "base_link", "底座", "żółw\n", "x" * 3000, "\0")
LENGTHS = (0, 0, 1, 2, 3, 6, 7, 300)


def number(kind, draw):
    """Return a number of a field of this kind."""
    if kind in WHOLE:
        low, high = WHOLE[kind]
        value = draw.choice((low, high, draw.randint(low, high)))
        return bool(value) if kind == "bool" else value
    wide = (1e300, 5e-324) if kind == "float64" else ()
    return draw.choice(FLOATS + wide + (draw.uniform(-1e4, 1e4),))


def filled(kind, value, draw, numbers, is_new):
    """Return a value for a field, of the type's own layout; its numbers are drawn and noted.

    Texts and lengths are drawn where it is new, and else kept.
    """
    if kind in WHOLE or kind in ("float32", "float64"):
        numbers.append(number(kind, draw))
        return numbers[-1]
    if kind in TIMES:
        made, whole = TIMES[kind][0](), TIMES[kind][1]
        made.secs, made.nsecs = number(whole, draw), number(whole, draw)
        numbers += [made.secs, made.nsecs]
        return made
    if kind == "string":
        return draw.choice(TEXTS) if is_new else value
    if kind.endswith("]"):
        element, count = kind[:-1].split("[")
        length = int(count) if count else draw.choice(LENGTHS[:5] if "/" in element else LENGTHS) if is_new else len(
            value)
        old = [None] * length if is_new else value
        return [filled(element, one, draw, numbers, is_new) for one in old]
    message = nested(kind) if is_new else value
    for name, slot in zip(message.__slots__, message._slot_types):
        setattr(message, name, filled(slot, getattr(message, name), draw, numbers, is_new))
    return message


def nested(kind):
    """Return an empty message of a type: one that is generated here, or one of those that are published."""
    from roslib.message import get_message_class
    found = get_message_class(kind)
    return (message_type(kind) if found is None else found)()


def written(message, seq):
    """Return what rospy sends of a message."""
    buffer = io.BytesIO()
    serialize_message(buffer, seq, message)
    return buffer.getvalue()


def check(kind, seed, shapes=SHAPES, draws=DRAWS):
    """Compare drawn messages of a type with what rospy writes; return how many were compared."""
    draw, compared = random.Random(seed), 0
    for _ in range(shapes):
        numbers = []
        message = filled(kind._type, None, draw, numbers, is_new=True)
        layout = PackedLayout(message)
        for _ in range(draws):
            numbers = []
            filled(kind._type, message, draw, numbers, is_new=False)
            seq = draw.choice((0, 1, 2 ** 32 - 1, draw.randrange(2 ** 32)))
            if getattr(kind, "_has_header", False):
                del numbers[0]
            assert layout.pack(seq, tuple(numbers)) == written(message, seq)
            compared += 1
    return compared


@pytest.mark.parametrize("kind", TYPES, ids=lambda kind: kind._type)
def test_the_bytes_are_those_of_the_generated_class(kind):
    assert check(kind, kind._type) == SHAPES * DRAWS


@pytest.mark.parametrize("table, kind, code", [
    ("_CODES", "float64", "f"), ("_CODES", "int16", "H"), ("_CODES", "uint8", "b"), ("_CODES", "int32", "I"),
    ("_CODES", "bool", "h"), ("_TIMES", "time", "i"), ("_TIMES", "time", "Q")])
def test_a_wrong_layout_is_found(monkeypatch, table, kind, code):
    monkeypatch.setitem(getattr(packed, table), kind, code)
    found = 0
    for each in TYPES:
        try:
            check(each, 1, shapes=10, draws=10)
        except (AssertionError, genpy.SerializationError, OverflowError):
            found += 1
    assert found


def test_fields_in_another_order_are_found(monkeypatch):
    monkeypatch.setattr(messages.RobotMsg, "_slot_types", list(messages.RobotMsg._slot_types))
    monkeypatch.setattr(messages.RobotMsg, "__slots__", list(reversed(messages.RobotMsg.__slots__)))
    assert PackedLayout(messages.RobotMsg()).fields != convert.ROBOT_FIELDS


def error_of(function, *arguments):
    try:
        function(*arguments)
    except Exception as error:
        return type(error)
    return None


@pytest.mark.parametrize("kind, numbers", [
    (messages.RobotMsg, (2 ** 15, 0, 0, 0)), (messages.RobotMsg, (0, 0, 0, -2 ** 15 - 1)),
    (messages.RobotMsg, (0, "one", 0, 0)), (messages.RobotMsg, (0, None, 0, 0)), (messages.RobotMsg, (0, 1.5, 0, 0)),
    (Float64, ("one",)), (Float64, (None,)), (Bool, (-1,)), (Bool, (256,))])
def test_a_number_outside_its_range_is_the_same_kind_of_error(kind, numbers):
    message = kind()
    for name, value in zip(kind.__slots__, numbers):
        setattr(message, name, value)
    expected = error_of(written, message, 1)
    assert issubclass(expected, genpy.SerializationError)
    assert error_of(PackedLayout(kind()).pack, 1, numbers) is expected


def test_a_number_outside_a_float32_is_the_same_kind_of_error():
    expected = error_of(written, Float32(1e39), 1)
    assert expected is not None and error_of(PackedLayout(Float32()).pack, 1, (1e39,)) is expected


@pytest.mark.parametrize("numbers", [(), (0, 0, 0), (0, 0, 0, 0, 0)])
def test_too_few_or_too_many_numbers_are_refused(numbers):
    with pytest.raises(genpy.SerializationError, match="valid: 4"):
        PackedLayout(messages.RobotMsg()).pack(1, numbers)


# ---- topics ----

class Topics:
    """Publishers of rospy's that have one listener each, and what these have received."""

    def __init__(self, monkeypatch):
        monkeypatch.setattr(rospy.topics, "is_initialized", lambda: True)
        self._theirs = []

    def add(self, kind):
        publisher = rospy.Publisher.__new__(rospy.Publisher)
        publisher.name = publisher.resolved_name = "/topic"
        publisher.data_class = kind
        publisher.impl = rospy.topics._PublisherImpl("/topic", kind)
        self.listen(publisher)
        return publisher

    def listen(self, publisher):
        ours, theirs = socket.socketpair()
        self._theirs.append(theirs)
        publisher.impl.connections = [*publisher.impl.connections, DirectConnection(LinkTransport(ours), 10)]
        return theirs

    def received(self):
        """Return the bytes that each listener has received by now."""
        return [sock.recv(1 << 20) for sock in self._theirs]

    def close(self):
        for sock in self._theirs:
            sock.close()


@pytest.fixture
def topics(monkeypatch):
    made = Topics(monkeypatch)
    yield made
    made.close()


def joints(positions, velocity, seconds):
    message = JointState(name=["a", "b"], position=list(positions), velocity=list(velocity))
    message.header.stamp = rospy.Time(seconds, 5)
    return message


def test_a_packed_topic_sends_and_counts_what_rospy_sends_and_counts(topics):
    ours, theirs = topics.add(JointState), topics.add(JointState)
    topic = PackedTopic(ours, convert.JOINT_FIELDS)
    for number, velocity in enumerate([(), (), (0.5, 1.5), (0.25, 2.5), (), (3.0, math.nan)]):
        message = joints((number, -0.5), velocity, number)
        topic.publish(bool(velocity), lambda message=message: message, (number, 5, number, -0.5) + velocity)
        theirs.publish(message)
        if number == 2:  # whoever has the publisher may publish another one, which counts
            ours.publish(joints((7.0,), (), 1))
            theirs.publish(joints((7.0,), (), 1))
    first, second = topics.received()
    assert first == second and first
    counts = [(one.impl.seq, one.impl.message_data_sent, one.impl.connections[0].stat_num_msg,
               one.impl.connections[0].stat_bytes) for one in (ours, theirs)]
    assert counts[0] == counts[1] and counts[0][0] == 7


def test_a_message_is_made_only_where_its_shape_is_new(topics):
    made = []
    topic = PackedTopic(topics.add(JointState), convert.JOINT_FIELDS)
    for number, shape in enumerate(["a", "a", "a", "b", "b", "a"]):
        topic.publish(shape, lambda shape=shape: made.append(shape) or joints((), (), 0), (number, 5))
    assert made == ["a", "b", "a"]


def test_a_type_with_other_fields_is_published_as_rospy_does_it(topics):
    publisher = topics.add(JointState)
    topic = PackedTopic(publisher, convert.JOINT_FIELDS[:-1])
    for number in range(3):
        topic.publish(True, lambda number=number: joints((number,), (), 0), ())
    data, = topics.received()
    assert data == b"".join(written(joints((number,), (), 0), number + 1) for number in range(3))
    assert publisher.impl.seq == 3


def test_a_number_outside_its_range_costs_its_message_alone(topics):
    topic = PackedTopic(topics.add(messages.RobotMsg), convert.ROBOT_FIELDS)
    with pytest.raises(rospy.ROSSerializationException, match="/topic"):
        topic.publish(True, messages.RobotMsg, (0, 2 ** 15, 0, 0))
    with pytest.raises(rospy.ROSSerializationException):
        topics.add(messages.RobotMsg).publish(messages.RobotMsg(power_state=2 ** 15))
    topic.publish(True, messages.RobotMsg, (1, 2, 3, 4))
    assert topics._theirs[0].recv(100) == struct.pack("<I4h", 8, 1, 2, 3, 4)


def test_a_listener_that_is_gone_costs_the_others_nothing(topics):
    publisher = topics.add(messages.RobotMsg)
    topic, second = PackedTopic(publisher, convert.ROBOT_FIELDS), topics.listen(publisher)
    assert topic.is_heard()
    gone = publisher.impl.connections[0]
    gone.socket.close()
    for _ in range(2):
        topic.publish(True, messages.RobotMsg, (1, 2, 3, 4))
    assert eventually(lambda: gone.socket is None), "the connection was closed, not by this test"
    assert second.recv(100) == struct.pack("<I4h", 8, 1, 2, 3, 4) * 2


def test_a_topic_that_is_closed_at_the_nodes_end_publishes_nothing(topics):
    publisher = topics.add(messages.RobotMsg)
    topic = PackedTopic(publisher, convert.ROBOT_FIELDS)
    topic.publish(True, messages.RobotMsg, (1, 2, 3, 4))
    publisher.impl.close()
    topic.publish(True, messages.RobotMsg, (1, 2, 3, 4))
    assert not topic.is_heard() and publisher.impl.seq == 1
