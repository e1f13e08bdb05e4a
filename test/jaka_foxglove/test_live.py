"""The bridge jaka_foxglove on a real master: foreign viewers receive messages, see parameters and the graph."""
import base64
import itertools
import json
import signal
import struct
import threading

import pytest
from command_places import command_of
from foxglove_clients import OLD, SDK, JsClient, RawViewer, Recorder, Refused, Served, data_of
from live_samples import STRING, TWIST_STAMPED, string_connection, string_frame, twist_connection, twist_frame
from mcap.reader import make_reader
from ros_graph import Graph, with_subscribers
from waiting import repeating, wait_until

from jaka_bag.live.names import NodeNames
from jaka_bag.live.subscriber import accept_all
from jaka_bag.live.topic_selection import TopicSelection, is_of_namespace, state_log_topics
from jaka_bag.messages.connection import Connection

TALKER = """
import rospy
from std_msgs.msg import String
from std_srvs.srv import SetBool
import threading
rospy.init_node("talker")
label = rospy.Publisher("/label", String, queue_size=10, latch=True)
label.publish("cell 7")
release = threading.Event()
def answer(request):
    if request.data:
        release.wait()
        return True, "released"
    if release.is_set():
        raise rospy.ServiceException("not twice")
    release.set()
    return False, "releases"
rospy.Service("/switch", SetBool, answer)
print("ready", flush=True)
rospy.spin()
"""
EVERYTHING = TopicSelection(everything=True)
CALL = struct.Struct("<BIII")


@pytest.fixture
def graph(tmp_path, monkeypatch):
    """Start a master; the environment points at it."""
    with Graph(tmp_path) as running:
        monkeypatch.setenv("ROS_MASTER_URI", running.environment["ROS_MASTER_URI"])
        monkeypatch.setenv("ROS_IP", "127.0.0.1")
        yield running


def program(graph, *arguments):
    """Start ``jaka_foxglove`` on a free port."""
    return Served(*command_of("jaka_foxglove"), "--port", "0", *arguments, environment=graph.environment)


@pytest.fixture
def shown(graph, running):
    """Serve the graph in this process; return the server."""
    from jaka_foxglove.live_topics import LiveOptions, LiveTopics

    def show(selection=EVERYTHING, accept=accept_all, **options):
        notices = []
        server = running(LiveTopics(NodeNames("/viewers"), LiveOptions(selection, accept, **options), notices.append,
                                    notices.append))
        server.notices = notices
        return server
    return show


class Viewer(RawViewer):
    """A viewer that subscribes to every channel, with all that it received.

    Attributes:
        topics: By number of the channel, which is also that of the subscription.
        messages: (topic, log time, ns, bytes).
        told: Text messages by op.
    """

    def __init__(self, server):
        super().__init__(server.port)
        self.topics, self.messages, self.told = {}, [], {}

    def receive(self):
        message = super().receive()
        data = data_of(message)
        if data is not None:
            self.messages.append((self.topics[data[0]], data[1], data[2]))
        elif isinstance(message, str):
            value = json.loads(message)
            self.told.setdefault(value["op"], []).append(value)
            if value["op"] == "advertise" and value["channels"]:
                self.topics.update((channel["id"], channel["topic"]) for channel in value["channels"])
                self.subscribe(*[channel["id"] for channel in value["channels"]])
        return message

    def has(self, condition):
        """Receive until the condition holds."""
        while not condition():
            assert self.receive() is not None, "the connection ended"
        return True

    def count(self, number):
        return self.has(lambda: len(self.messages) >= number)


def subscribers(graph, topic):
    return dict(graph.master().getSystemState()[1]).get(topic, [])


def numbers(published):
    return [struct.unpack_from("<I", data)[0] for _, _, data in published]


def test_pymcap_records_what_is_published_byte_by_byte(graph, tmp_path):
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        b = publisher.advertise("/b", string_connection("/b"), False)
        frames = {"/a": [twist_frame(i) for i in range(1, 301)],
                  "/b": [string_frame("x" * i) for i in range(1, 301)] + [string_frame("y" * 3_000_000)]}
        with program(graph) as served:
            recorder = Recorder(served.port, tmp_path / "out.mcap", 601)
            with_subscribers(publisher, a, b, count=2)  # the first one only learnt the type
            for one, other in zip(frames["/a"], frames["/b"]):
                publisher.publish(a, one)
                publisher.publish(b, other)
            publisher.publish(b, frames["/b"][300])
            recorder.wait()
            wait_until(lambda: not subscribers(graph, "/a"), "nobody is subscribed when nobody watches")
            assert served.stop(signal.SIGTERM) == 0
    with open(str(tmp_path / "out.mcap"), "rb") as file:
        found = [(schema, channel, message) for schema, channel, message in make_reader(file).iter_messages()]
    for topic, connection in (("/a", twist_connection("/a")), ("/b", string_connection("/b"))):
        assert [m.data for _, c, m in found if c.topic == topic] == [frame[4:] for frame in frames[topic]]
        schema, channel = next((s, c) for s, c, _ in found if c.topic == topic)
        assert (channel.message_encoding, schema.encoding, schema.name, schema.data.decode()) == (
            "ros1", "ros1msg", connection.datatype, connection.definition)
    moments = [message.log_time for _, channel, message in found if channel.topic == "/a"]
    assert moments == sorted(moments)


def test_the_client_of_ws_protocol_sees_latched_messages_parameters_and_who_publishes(graph, shown):
    graph.master().setParam("/cell/number", 7)
    talker = graph.python(TALKER)
    talker.wait_for_line("ready")
    served = shown()
    label = ("/label", string_frame("cell 7")[4:])
    for subprotocol in (SDK, OLD):
        with JsClient(served.port, subprotocol) as client:
            wait_until(lambda: label in [(m.topic, m.data) for m in client.messages(1)], "the latched message comes")
            channel = next(c for told in client.wait("advertise") for c in told if c["topic"] == "/label")
            assert (channel["schemaName"], channel["schema"]) == ("std_msgs/String", STRING)
            with Viewer(served) as late:  # subscribed already: the publisher is not asked again
                assert late.has(lambda: label in [(topic, data) for topic, _, data in late.messages])
            client.do("getParameters", ["/cell/number", "/cell/none"], "one")
            assert client.wait("parameterValues")[0] == {
                "op": "parameterValues", "id": "one", "parameters": [{"name": "/cell/number", "value": 7}]}
            client.do("setParameters", [{"name": "/cell/number", "value": 8}], "two")
            assert client.wait("parameterValues", 2)[1]["parameters"][0]["value"] == 7
            assert "read-only" in client.wait("status")[0]["message"]
            client.do("subscribeConnectionGraph")
            wait_until(lambda: {"name": "/label", "publisherIds": ["/talker"]} in [
                one for told in client.values("connectionGraphUpdate") for one in told["publishedTopics"]],
                "the graph is told")
    assert graph.master().getParam("/cell/number") == 7


def test_changes_of_parameters_are_told_and_services_are_not_shown_unless_allowed(graph, shown):
    graph.python(TALKER).wait_for_line("ready")
    with Viewer(shown()) as viewer:
        assert "services" not in viewer.text("serverInfo")["capabilities"]
        viewer.send(CALL.pack(2, 1, 1, 4) + b"ros1\0")
        assert "no service" in viewer.text("serviceCallFailure")["message"]
        viewer.send({"op": "subscribeParameterUpdates", "parameterNames": ["/speed"]})
        values = itertools.count(0.5, 0.5)
        with repeating(lambda: graph.master().setParam("/speed", next(values)), 0.2):
            told, = viewer.text("parameterValues")["parameters"]
        assert told["name"] == "/speed" and told["type"] == "float64"
        assert "advertiseServices" not in viewer.told


def test_services_are_called_side_by_side_where_the_user_allows_it(graph, shown):
    graph.python(TALKER).wait_for_line("ready")
    with JsClient(shown(has_calls=True, services="/sw").port, SDK) as client:
        switch, = client.wait("advertiseServices")[0]
        assert (switch["name"], switch["type"]) == ("/switch", "std_srvs/SetBool")
        assert switch["request"]["schema"].startswith("bool data")
        assert "string message" in switch["response"]["schema"]
        client.do("call", switch["id"], 1, base64.b64encode(b"\1").decode())  # waits for the other one
        client.do("call", switch["id"], 2, base64.b64encode(b"\0").decode())
        replies = {number: base64.b64decode(data) for number, data in client.wait("serviceCallResponse", 2)}
        assert replies == {1: b"\1" + string_frame("released")[4:], 2: b"\0" + string_frame("releases")[4:]}
        client.do("call", switch["id"], 3, base64.b64encode(b"\0").decode())
        failure = client.wait("serviceCallFailure")[0]
        assert failure["message"].startswith("/switch failed") and "not twice" in failure["message"]


def test_publishers_come_go_and_change_their_type(graph, shown):
    twist, string = twist_connection("/x"), string_connection("/x")
    with Viewer(shown(TopicSelection(("/x",)))) as viewer:
        ids = []
        for connection, frame in ((twist, twist_frame(5)), (string, string_frame("s")), (twist, twist_frame(6))):
            with graph.publisher("/source") as publisher:
                outlet = publisher.advertise("/x", connection, False)
                assert viewer.has(lambda: len(viewer.told.get("advertise", [])) == len(ids) + 2)
                with_subscribers(publisher, outlet, count=2)
                publisher.publish(outlet, frame)
                viewer.count(len(ids) + 1)
                assert viewer.messages[-1][2] == frame[4:]
            ids.append(viewer.told["advertise"][-1]["channels"][0]["id"])
            assert viewer.has(lambda: len(viewer.told.get("unadvertise", [])) == len(ids))
            # it is told before the subscription ends, which else is one of the two that the next publisher waits for
            wait_until(lambda: not subscribers(graph, "/x"), "the subscription ends with its publisher")
        assert ids[0] == ids[2] != ids[1], "an equal channel keeps its number"


def test_of_two_types_on_one_topic_the_first_is_shown_and_it_is_said(graph, shown):
    with graph.publisher("/one") as one, graph.publisher("/two") as two:
        first = one.advertise("/x", twist_connection("/x"), False)
        server = shown(TopicSelection(("/x",)))
        with Viewer(server) as viewer:
            assert viewer.has(lambda: viewer.topics)
            with_subscribers(one, first, count=2)
            two.advertise("/x", string_connection("/x"), False)
            wait_until(lambda: any("only the first is shown" in line for line in server.notices), "it is said")
            one.publish(first, twist_frame(9))
            viewer.count(1)
            assert viewer.messages[0][2] == twist_frame(9)[4:]


def test_a_state_log_is_one_arms(graph, shown):
    with graph.publisher("/left/jaka_driver") as left, graph.publisher("/right/jaka_driver") as right:
        joints = left.advertise("/left/jaka_driver/joint_position", twist_connection("/x"), False)
        tf = left.advertise("/tf", twist_connection("/tf"), False)
        other = right.advertise("/right/jaka_driver/joint_position", twist_connection("/x"), False)
        other_tf = right.advertise("/tf", twist_connection("/tf"), False)
        left.advertise("/left/camera", string_connection("/left/camera"), False)
        topics = TopicSelection(state_log_topics(NodeNames("/viewers", "/left")))
        with Viewer(shown(topics, is_of_namespace("/left"))) as viewer:
            assert viewer.has(lambda: set(viewer.topics.values()) == {"/left/jaka_driver/joint_position", "/tf"})
            with_subscribers(left, joints, tf, count=2)
            for number in range(10):
                right.publish(other_tf, twist_frame(100 + number))
                right.publish(other, twist_frame(200 + number))
                left.publish(tf, twist_frame(number))
                left.publish(joints, twist_frame(50 + number))
            viewer.count(20)
            assert sorted(numbers(viewer.messages)) == [*range(10), *range(50, 60)]
            assert len(viewer.topics) == 2


def test_with_simulated_time_times_are_those_of_the_clock(graph, shown):
    with graph.publisher("/source") as publisher:
        clock = publisher.advertise("/clock", Connection("/clock", "rosgraph_msgs/Clock", "*", "time clock\n"), False)
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with Viewer(shown(TopicSelection(("/a",)), is_simulated_time=True)) as viewer:
            assert "time" in viewer.text("serverInfo")["capabilities"]
            assert viewer.has(lambda: viewer.topics)
            with_subscribers(publisher, a, count=2)
            with_subscribers(publisher, clock)
            publisher.publish(clock, struct.pack("<III", 8, 12, 34))
            assert viewer.until(lambda m: m if m[:1] == b"\x02" else None)[1:] == struct.pack("<Q", 12 * 10**9 + 34)
            publisher.publish(a, twist_frame(1))
            viewer.count(1)
            assert viewer.messages[0][1] == 12 * 10**9 + 34


def test_a_restarted_master_is_joined_again(tmp_path, monkeypatch, running):
    from jaka_foxglove.live_topics import LiveOptions, LiveTopics

    with Graph(tmp_path, True) as graph:
        for name in ("ROS_MASTER_URI", "ROS_IP"):
            monkeypatch.setenv(name, graph.environment[name])
        with graph.publisher("/old") as old:
            a = old.advertise("/a", twist_connection("/a"), False)
            notices = []
            server = running(LiveTopics(NodeNames("/viewers"), LiveOptions(EVERYTHING, accept_all),
                                        notices.append, notices.append))
            with Viewer(server) as viewer:
                assert viewer.has(lambda: "/a" in viewer.topics.values())
                with_subscribers(old, a, count=2)
                graph.stop_master()
                wait_until(lambda: any("waiting for it" in line for line in notices), "it is noticed")
                old.publish(a, twist_frame(1))
                assert viewer.count(1), "links that stand go on"
                graph.start_master()
                with graph.publisher("/new") as new:
                    b = new.advertise("/b", twist_connection("/b"), False)
                    assert viewer.has(lambda: "/b" in viewer.topics.values())
                    with_subscribers(new, b, count=2)
                    new.publish(b, twist_frame(2))
                    assert viewer.count(2), "new topics are found"


def test_the_program_waits_for_a_master_and_ends_when_another_node_wants_it(tmp_path):
    graph = Graph(tmp_path)
    starter = threading.Timer(0.5, graph.start_master)
    starter.start()
    try:
        with program(graph, "__name:=viewers", "-e", "/a.*", "--allow-calls") as served:
            assert any("MOVE THE ARM" in line for line in served.lines)
            with pytest.raises(Refused):
                RawViewer(served.port, headers={"Origin": "https://evil.example"})
            with graph.publisher("/source") as publisher, Viewer(served) as viewer:
                publisher.advertise("/a", twist_connection("/a"), False)
                publisher.advertise("/b", twist_connection("/b"), False)
                assert viewer.has(lambda: viewer.topics)
                wait_until(lambda: "/viewers" in subscribers(graph, "/a"), "it is a node of the graph")
                assert viewer.told["advertise"][-1]["channels"][0]["schema"] == TWIST_STAMPED
                assert graph.start("rosnode", "kill", "/viewers").wait() == 0
                assert served.process.wait(30) == 0
                assert set(viewer.topics.values()) == {"/a"}
    finally:
        starter.join()
        graph.__exit__()
