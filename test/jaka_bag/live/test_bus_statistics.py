"""The publishers' own counts, in the words of both client libraries."""
import live_samples
import pytest
import ros_graph
import waiting

from jaka_bag.errors import ConnectionLost, ProtocolError
from jaka_bag.live.bus_statistics import ask_publisher, ask_publishers, sent_messages

BUS_INFO = [[1, "/rec", "o", "TCPROS", "/a", True, ""], [2, "/other", "o", "TCPROS", "/a", True, ""],
            [3, "/rec", "o", "TCPROS", "/b", True, ""], [4, "/rec", "i", "TCPROS", "/c", True, ""]]
ROSPY = [1, "", [[["/a", 900, [[1, 100, 7, True], [2, 100, 50, True]]], ["/b", 5, [[3, 10, 2, True]]]],
                 [["/c", [[4, 1, 99, -1, True]]]], []]]
ROSCPP = [[["/a", [[1, 100, 90, 7, 0], [2, 100, 90, 50, 0]]], ["/b", [[3, 10, 9, 2, 0]]]],
          [["/c", [[4, 1, -1, 0]]]], []]

TALKER = """
import rospy
from std_msgs.msg import String
rospy.init_node("talker")
publisher = rospy.Publisher("/talk", String, queue_size=100)
while publisher.get_num_connections() < 1: rospy.rostime.wallsleep(0.01)
for i in range(25): publisher.publish("x")
print("done", flush=True)
rospy.spin()
"""


@pytest.mark.parametrize("reply", [ROSPY, ROSCPP, [1, "ok", ROSCPP]])
def test_both_dialects_are_understood(reply):
    assert sent_messages("/rec", BUS_INFO, reply) == {"/a": 7, "/b": 2}
    assert sent_messages("/nobody", BUS_INFO, reply) == {}


@pytest.mark.parametrize("info, reply", [(BUS_INFO, 5), (BUS_INFO, [[["/a", [[1]]]], [], []]), (7, ROSPY),
                                         (BUS_INFO, [[["/a"]], [], []]), ([["x", "/rec", "o", "", "/a"]], ROSPY),
                                         ([[float("inf"), "/rec", "o", "", "/a"]], ROSPY),
                                         (BUS_INFO, [[["/a", [[1, 0, 0, float("inf"), 0]]], [], []]])])
def test_another_shape_is_a_protocol_error(info, reply):
    with pytest.raises(ProtocolError):
        sent_messages("/rec", info, reply)


def test_rospy_itself_is_understood(graph):
    recorder = graph.record("/talk", "-O", "log", "__name:=rec")
    talker = graph.python(TALKER)
    talker.wait_for_line("done")
    uri = graph.master().lookupNode("/talker")
    waiting.wait_until(lambda: ask_publisher(uri, "/rec").get("/talk") == 25, "all are sent")
    assert ask_publishers([uri, "http://127.0.0.1:1/"], "/rec", 5.0) == {(uri, "/talk"): 25}
    assert recorder.stop() == 0


def test_roscpp_itself_is_understood(graph):
    recorder = graph.record("/a", "-O", "first.bag")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", live_samples.twist_connection("/a"), False)
        ros_graph.with_subscribers(publisher, a)
        for number in range(1, 21):
            publisher.publish(a, live_samples.twist_frame(number))
        assert recorder.stop() == 0
    recorder = graph.record("/a", "-O", "second", "__name:=rec")
    play = graph.start("rosbag", "play", "-q", "-k", "-d", "1", "--wait-for-subscribers", "first.bag", "__name:=cpp")
    waiting.wait_until(lambda: graph.master().getSystemState()[0] and any(
        "/cpp" in nodes for _, nodes in graph.master().getSystemState()[0]), "it publishes")
    uri = graph.master().lookupNode("/cpp")
    waiting.wait_until(lambda: ask_publisher(uri, "/rec").get("/a") == 20, "all are sent")
    assert recorder.stop() == 0
    play.stop()


def test_nobody_there_is_a_lost_connection():
    with pytest.raises(ConnectionLost):
        ask_publisher("http://127.0.0.1:1/", "/rec")
