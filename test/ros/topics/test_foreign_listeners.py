"""Listeners that are not ours: a roscpp node, rosbag record, and what rosnode and the bus statistics tell of them."""
import contextlib
import io
import re
import socket
import struct
import subprocess
from pathlib import Path
from xmlrpc.client import ServerProxy

import pytest
import rosgraph
import rospy
from geometry_msgs.msg import TwistStamped
from import_graph import ROOT
from ros_graph import SYSTEM_PYTHON
from rosgraph.network import encode_ros_handshake_header
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from waiting import WAIT, eventually

from jaka_msgs.msg import RobotMsg
from jaka_ros_driver.ros.direct_publisher import direct_publisher

TOPICS = {"tool_position": TwistStamped, "joint_position": JointState, "robot_states": RobotMsg}
GENCPP = "/usr/lib/gencpp/gen_cpp.py"
PACKAGES = {"jaka_msgs": ROOT / "jaka_msgs" / "msg", **{
    package: Path("/usr/share", package, "msg") for package in ("std_msgs", "geometry_msgs", "sensor_msgs")}}
GENERATED = ("geometry_msgs/Vector3", "geometry_msgs/Twist", "geometry_msgs/TwistStamped", "sensor_msgs/JointState",
             "jaka_msgs/RobotMsg")
SECONDS = 4.0
PLAIN = """
import rospy
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from jaka_msgs.msg import RobotMsg
rospy.init_node("plain_node")
out = [rospy.Publisher("~" + name, kind, queue_size=10, tcp_nodelay=True) for name, kind in (
    ("tool_position", TwistStamped), ("joint_position", JointState), ("robot_states", RobotMsg))]
while not rospy.is_shutdown():
    for publisher in out:
        publisher.publish()
    rospy.rostime.wallsleep(0.008)
"""
MANY = 60
LARGE = 200000


@pytest.fixture(scope="module")
def cpp_listener(tmp_path_factory):
    """Build a roscpp executable that listens to the three topics."""
    folder = tmp_path_factory.mktemp("cpp")
    paths = [word for package, path in PACKAGES.items() for word in ("-I", "%s:%s" % (package, path))]
    for kind in GENERATED:
        package, name = kind.split("/")
        headers = folder / "include" / package
        headers.mkdir(parents=True, exist_ok=True)
        run([SYSTEM_PYTHON, GENCPP, str(PACKAGES[package] / (name + ".msg")), "-p", package, "-o", str(headers),
             "-e", "/usr/share/gencpp", *paths])
    run(["g++", "-std=c++17", "-I", str(folder / "include"), "-o", str(folder / "count_states"),
         str(Path(__file__).parent / "cpp" / "count_states.cpp"),
         "-lroscpp", "-lrosconsole", "-lroscpp_serialization", "-lrostime", "-lcpp_common"])
    return folder / "count_states"


def run(command, timeout=240):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=timeout)
    assert done.returncode == 0, done.stdout
    return done.stdout


@contextlib.contextmanager
def heard(*names):
    """Subscribe this process to the three topics of these nodes, and wait until each has brought a message."""
    messages = {}
    subscribers = [rospy.Subscriber("%s/%s" % (name, topic), kind, lambda message, key=(name, topic):
                                    messages.__setitem__(key, message)) for name in names
                   for topic, kind in TOPICS.items()]
    try:
        assert eventually(lambda: len(messages) == len(subscribers))
        yield
    finally:
        for subscriber in subscribers:
            subscriber.unregister()


@pytest.fixture
def plain_node(arm):
    """Start a node that publishes the same topics by rospy alone, subscribe to it and to the driver, and yield its
    name.
    """
    process = subprocess.Popen([SYSTEM_PYTHON, "-c", PLAIN])
    try:
        with heard(arm.name, "/plain_node"):
            yield "/plain_node"
    finally:
        process.terminate()
        process.wait(WAIT)


def test_a_roscpp_node_hears_every_message_of_the_three_topics(arm, cpp_listener):
    arm.go_home()
    said = {line.split()[0]: line.split()[1:] for line in run(
        [str(cpp_listener), arm.name, str(SECONDS)], timeout=60 + SECONDS).splitlines()}
    counts = [int(said[topic][0]) for topic in TOPICS]
    assert min(counts) > 20 and max(counts) - min(counts) <= 5, "one of them lost messages: %s" % counts
    for topic in ("tool_position", "joint_position"):
        assert int(said[topic][1]) == 0, "a step of seq is not 1, or a stamp is not later"
    tool, joints = arm.listen("tool_position", 1)[0], arm.listen("joint_position", 1)[0]
    linear, angular = tool.twist.linear, tool.twist.angular
    assert said["tool_position"][2] == tool.header.frame_id == "base_link"
    assert [float(word) for word in said["tool_position"][3:]] == [
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
    assert said["joint_position"][2:8] == joints.name
    assert [float(word) for word in said["joint_position"][8:]] == list(joints.position)
    assert said["robot_states"][1:] == ["0", "1", "0", "0"]


def test_rosbag_record_gets_every_message_whole_and_in_order(arm, tmp_path):
    from rosbags.rosbag1 import Reader
    log = tmp_path / "log.bag"
    run(["rosbag", "record", "--duration=%d" % SECONDS, "-O", str(log), *["%s/%s" % (arm.name, topic)
                                                                         for topic in TOPICS]])
    run(["rosbag", "check", str(log)])
    found = {topic: [] for topic in TOPICS}
    with Reader(log) as reader:
        assert {connection.ext.callerid for connection in reader.connections} == {arm.name}
        for connection, _, data in reader.messages():
            topic = connection.topic.rsplit("/", 1)[1]
            message = TOPICS[topic]().deserialize(bytes(data))
            again = io.BytesIO()
            message.serialize(again)
            assert again.getvalue() == data
            found[topic].append(message)
    counts = [len(messages) for messages in found.values()]
    assert min(counts) > 100 * (SECONDS - 2.0), "it needs up to 2 s to connect: %s" % counts
    for topic in ("tool_position", "joint_position"):
        headers = [message.header for message in found[topic]]
        assert [header.seq for header in headers] == list(range(headers[0].seq, headers[0].seq + len(headers)))
        assert all(first.stamp < second.stamp for first, second in zip(headers, headers[1:]))


def connections_of(node, listener):
    """Return what rosnode says of the connections of the three topics, names of nodes and ports left out."""
    said = run(["rosnode", "info", node])
    assert all(" * %s/%s [%s]" % (node, topic, kind._type) in said for topic, kind in TOPICS.items())
    blocks = [re.sub(r"\d+", "N", block.replace(node + "/", "NODE/")) for block in re.split(r"\n \* topic: ", said)[1:]]
    return sorted(block.split("\n\n")[0].rstrip() for block in blocks if block.startswith(tuple(
        "NODE/%s\n    * to: %s\n" % (topic, re.sub(r"\d+", "N", listener)) for topic in TOPICS)))


def test_rosnode_tells_of_the_driver_what_it_tells_of_a_plain_node(arm, plain_node):
    ours, theirs = (connections_of(node, rospy.get_name()) for node in (arm.name, plain_node))
    assert ours == theirs and len(ours) == len(TOPICS)


def shape_of(value):
    """Return a value of XML-RPC with the types of its numbers and texts in their places."""
    return [shape_of(each) for each in value] if isinstance(value, list) else type(value).__name__


def bus_of(node):
    """Return (rows of getBusInfo, rows of getBusStats) of the three topics towards this process."""
    proxy = ServerProxy(rosgraph.Master("/asking").lookupNode(node))
    topics = ["%s/%s" % (node, topic) for topic in TOPICS]
    (code, _, info), (told, _, stats) = proxy.getBusInfo("/asking"), proxy.getBusStats("/asking")
    assert code == told == 1 and len(stats) == 3
    rows = sorted([row for row in info if row[4] in topics and row[1] == rospy.get_name()], key=lambda row: row[4])
    own = [row[0] for row in rows]
    return rows, [[topic, size, [one for one in ones if one[0] in own]]
                  for topic, size, ones in sorted(stats[0]) if topic in topics]


def test_the_bus_statistics_are_those_of_a_plain_node(arm, plain_node):
    ours, theirs = bus_of(arm.name), bus_of(plain_node)
    assert shape_of(ours) == shape_of(theirs) and [len(rows) for rows in ours] == [3, 3]
    assert [[row[2:4] + row[5:6], row[4].rsplit("/", 1)[1]] for row in ours[0]] == [
        [row[2:4] + row[5:6], row[4].rsplit("/", 1)[1]] for row in theirs[0]]
    size = 4 + 4 * 2  # a RobotMsg with its length
    for node, (_, before) in ((arm.name, ours), (plain_node, theirs)):
        assert eventually(lambda node=node, before=before: bus_of(node)[1][1][1] > before[1][1] + 100 * size)
        (_, sent, ((_, size_before, count_before, _),)), (name, sent_after, ((_, size_after, count, is_up),)) = (
            before[1], bus_of(node)[1][1])
        assert name == node + "/robot_states" and is_up is True and count > count_before
        assert size_after - size_before == size * (count - count_before)
        assert (sent_after - sent) % size == 0


def connect_to(topic, kind, caller, buffer=None):
    """Connect to a publisher of this process as a listener, by the wire's description alone; return the socket."""
    node = ServerProxy(rosgraph.Master("/asking").lookupNode(rospy.get_name()))
    code, _, way = node.requestTopic(caller, topic, [["TCPROS"]])
    assert code == 1
    link = socket.socket()
    link.settimeout(WAIT)
    if buffer is not None:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    link.connect((way[1], way[2]))
    link.sendall(encode_ros_handshake_header({"topic": topic, "callerid": caller, "md5sum": kind._md5sum,
                                              "type": kind._type, "tcp_nodelay": "1"}))
    return link


def blocks(link):
    """Yield the blocks of a connection: its header, then its messages."""
    with link.makefile("rb") as stream:
        for length in iter(lambda: stream.read(4), b""):
            yield stream.read(struct.unpack("<I", length)[0])


def test_beside_a_listener_that_stands_still_a_new_one_is_sent_the_latched_message(ros_node):
    topic = rospy.resolve_name("~latched")
    publisher = direct_publisher(topic, String, 3, latch=True)
    with contextlib.closing(connect_to(topic, String, "/stands_still", buffer=4096)) as standing:
        assert eventually(lambda: publisher.get_num_connections() == 1)
        for number in range(MANY):
            publisher.publish(String("%d " % number + "x" * LARGE))
        with contextlib.closing(connect_to(topic, String, "/newcomer")) as newcomer:
            told = blocks(newcomer)
            assert b"latching=1" in next(told)
            assert String().deserialize(next(told)).data.split()[0] == str(MANY - 1)
            publisher.publish(String("after"))
            assert String().deserialize(next(told)).data == "after"
        behind = blocks(standing)
        next(behind)
        numbers = []
        for data in behind:
            numbers.append(String().deserialize(data).data.split()[0])
            if numbers[-1] == "after":
                break
    assert len(numbers) < MANY, "nothing was dropped: the listener did not stand still"
    assert numbers[-3:] == [str(MANY - 2), str(MANY - 1), "after"]
    assert list(map(int, numbers[:-1])) == sorted(map(int, numbers[:-1]))
    publisher.unregister()
