"""The log tools by themselves: a wheel in a venv without ROS records from a roscore of the system and plays into it."""
import contextlib
import re
import signal
import socket
import subprocess

import pytest
from command_places import wheel_venv
from import_graph import ROOT
from ros_graph import SYSTEM_PYTHON, Process
from waiting import wait_until

PUBLISH = """
import rospy
from geometry_msgs.msg import TwistStamped
from std_msgs.msg import String
rospy.init_node("source")
label = rospy.Publisher("label", String, queue_size=10, latch=True)
label.publish("cell 7")
twist = rospy.Publisher("twist", TwistStamped, queue_size=100)
while twist.get_num_connections() < 1 or label.get_num_connections() < 1:
    rospy.sleep(0.02)
rospy.sleep(0.2)
message = TwistStamped()
for number in range(50):
    message.header.stamp = rospy.Time.now()
    message.twist.linear.x = number
    twist.publish(message)
    rospy.sleep(0.01)
rospy.sleep(0.5)
print("published", flush=True)
rospy.spin()
"""
LISTEN = """
import rospy
from geometry_msgs.msg import TwistStamped
from std_msgs.msg import String
rospy.init_node("sink")
rospy.Subscriber("label", String, lambda message: print("label", message.data, flush=True))
rospy.Subscriber("twist", TwistStamped, lambda message: print("x", message.twist.linear.x, flush=True))
print("listening", flush=True)
rospy.spin()
"""
READ = """
import sys, rosbag
for topic, message, time in rosbag.Bag(sys.argv[1]).read_messages():
    print(topic, message.data if topic == "/label" else message.twist.linear.x)
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Return the ``bin`` folder of a venv that has the wheel and what it needs, and nothing of the system."""
    return wheel_venv(tmp_path_factory.mktemp("wheel"), extras="") / "bin"


@pytest.fixture
def environment(tmp_path):
    """Return an environment with nothing of the test's shell, and a master that is not there yet, on a free port."""
    with contextlib.closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    return {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "ROS_HOME": str(tmp_path), "LANG": "C.UTF-8",
            "ROS_MASTER_URI": "http://127.0.0.1:%d" % port, "ROS_IP": "127.0.0.1", "PYTHONUNBUFFERED": "1"}


@pytest.fixture
def start(tmp_path, environment):
    """Return a function that starts commands, of which none outlives the test; the first is the roscore."""
    running = []

    def started(*command):
        running.append(Process([str(word) for word in command], environment, tmp_path))
        return running[-1]

    started("roscore", "-p", environment["ROS_MASTER_URI"].rsplit(":", 1)[1]).wait_for_line(r"started core service")
    yield started
    for process in reversed(running):
        process.stop()


def call(environment, *command):
    return subprocess.run([str(word) for word in command], env=environment, stdin=subprocess.DEVNULL, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=100)


def test_it_records_and_plays_without_ros(installed, start, environment, tmp_path):
    assert call(environment, installed / "python", "-c", "import rospy").returncode == 1
    recorder = start(installed / "jaka_bag", "record", "-O", "run.bag", "/label", "/twist")
    recorder.wait_for_line("recording to")
    source = start(SYSTEM_PYTHON, "-c", PUBLISH)
    source.wait_for_line("published")
    assert recorder.stop(signal.SIGINT) == 0, recorder.output
    source.stop()
    expected = ["/label cell 7"] + ["/twist %.1f" % number for number in range(50)]
    read = call(environment, SYSTEM_PYTHON, "-c", READ, tmp_path / "run.bag")
    assert sorted(read.stdout.splitlines()) == sorted(expected), read.stdout

    sink = start(SYSTEM_PYTHON, "-c", LISTEN)
    sink.wait_for_line("listening")
    played = call(environment, installed / "jaka_bag", "play", "--wait-for-subscribers", tmp_path / "run.bag")
    assert played.returncode == 0 and "51 messages" in played.stdout, played.stdout
    wait_until(lambda: sink.lines.count("x 49.0") == 1, "the last message comes")
    assert [line for line in sink.lines if line != "listening"] == ["label cell 7"] + [
        "x %.1f" % number for number in range(50)]


def test_every_subcommand_is_there(installed, environment):
    told = call(environment, installed / "jaka_bag", "--help").stdout
    commands = re.findall(r"^  ((?:dataset )?[a-z-]+) +\w", told, re.MULTILINE)
    assert len(set(commands)) == len(commands) == 27
    for command in commands:
        done = call(environment, installed / "jaka_bag", *command.split(), "--help")
        if command.startswith("replay"):
            assert done.returncode == 2
            assert "%s needs the Python package jaka_regression, which comes with the ROS package jaka_ros_driver" \
                % command in done.stdout
        else:
            assert done.returncode == 0 and "usage: jaka_bag %s" % command in done.stdout, done.stdout
    completion = call(environment, installed / "jaka_bag", "completion", "bash")
    assert completion.returncode == 0 and "replay-wire" not in completion.stdout


@pytest.mark.parametrize("program", ["jaka_bag", "jaka_foxglove"])
def test_a_spawned_worker_that_runs_the_program_again_does_nothing(installed, environment, program):
    again = "import runpy, sys; runpy.run_path(sys.argv[1], run_name='__mp_main__')"  # multiprocessing.spawn does it
    done = call(environment, installed / "python", "-c", again, installed / program)
    assert (done.returncode, done.stdout) == (0, "")


def test_the_package_is_typed_and_reads_logs(installed, environment):
    golden = ROOT / "test" / "data" / "golden" / "joint_moves.mcap"
    code = ("import jaka_bag, pathlib; assert pathlib.Path(jaka_bag.__file__).with_name('py.typed').exists(); "
            "topic = '/jaka_driver/joint_position'; "
            "print(jaka_bag.read_columns(%r)[topic].fields['position'].shape)" % str(golden))
    done = call(environment, installed / "python", "-c", code)
    assert done.returncode == 0 and re.fullmatch(r"\(\d+, 6\)\n", done.stdout), done.stdout
