"""An action server at the end of its node: rospy closes the topics before it reports its shutdown."""
import subprocess
import sys

import pytest

NODE = """
import sys, threading, time, rospy
from actionlib import ActionServer
from jaka_ros_driver.ros.action_server import QuietActionServer
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_msgs.msg import RecoverAction, RecoverFeedback, RecoverResult

rospy.init_node("ends", anonymous=True, disable_signals=True)
words = ("ends", RecoverAction, lambda handle: None, lambda handle: None)
server = QuietActionServer(*words, Recorder(None)) if sys.argv[1] == "quiet" else ActionServer(*words, auto_start=False)
server.start()
failures = []
threading.excepthook = lambda failure: failures.append(failure.exc_value)

def with_closed_topics(reason):
    assert not rospy.is_shutdown()
    end = time.monotonic() + {"quiet": 0.5, "plain": 20.0}[sys.argv[1]]
    while not failures and time.monotonic() < end:  # the server's timer comes five times a second
        time.sleep(0.01)
    for publish, rest in ((server.publish_feedback, RecoverFeedback()), (server.publish_result, RecoverResult())):
        try:
            publish(None, rest)
        except rospy.ROSException as error:
            failures.append(error)

rospy.core.add_preshutdown_hook(with_closed_topics)
rospy.signal_shutdown("the test ends it")
print("raised:", len(failures), failures)
"""


@pytest.mark.parametrize("kind, raised", [("plain", 3), ("quiet", 0)])
def test_nothing_is_raised_between_the_closing_of_the_topics_and_the_end(ros_node, kind, raised):
    ended = subprocess.run([sys.executable, "-c", NODE, kind], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                           text=True, timeout=60, check=True)
    assert "raised: %d " % raised in ended.stdout, ended.stdout


def test_a_closed_topic_is_an_error_while_the_node_lives(ros_node, tmp_path):
    script = NODE.split("rospy.core.add_preshutdown_hook")[0] + """
server.status_pub.unregister()
try:
    server.publish_status()
except rospy.ROSException:
    print("told")
rospy.signal_shutdown("the test ends it")
"""
    ended = subprocess.run([sys.executable, "-c", script, "quiet"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                           text=True, timeout=60, check=True)
    assert "told" in ended.stdout, ended.stdout


def test_all_action_servers_share_one_thread_and_none_ends_the_status_of_another(ros_node):
    script = NODE.split("server = ")[0] + """
servers = [QuietActionServer("ends_%d" % number, *words[1:], Recorder(None)) for number in range(3)]
for server in servers:
    server.start()
told = []

def publish(number):
    told.append(number)
    if number == 0:
        raise ValueError("a defect")

for number, server in enumerate(servers):
    server.publish_status_async = lambda event, number=number: publish(number)
end = time.monotonic() + 60.0
while told.count(2) < 10 and time.monotonic() < end:
    time.sleep(0.01)
timers = [each for each in threading.enumerate() if isinstance(each, rospy.Timer) or each.name == "errands"]
print("timers:", len(timers), "told:", told.count(0), told.count(1) >= 9, told.count(2) >= 10)
rospy.signal_shutdown("the test ends it")
"""
    ended = subprocess.run([sys.executable, "-c", script, "quiet"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                           text=True, timeout=120, check=True)
    assert "timers: 1 told: 1 True True" in ended.stdout, ended.stdout
