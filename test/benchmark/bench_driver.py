"""The cost and speed of the driver, beside a bare rospy publisher of the same three topics, in one run.

Driver, simulated controller and this executable are processes of their own on one computer. Moments on the wire are
those of the simulated controller's byte log. In the devel space:

    build/venv/bin/python3 test/benchmark/bench_driver.py [SECONDS]        length of the rate measurement, 60
"""
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "test" / "support"), str(ROOT / "test" / "support" / "live"),
                str(ROOT / "test" / "ros")]
os.environ["ROS_IP"] = "127.0.0.1"

import conftest  # noqa: E402
import rospy  # noqa: E402
from arm_bench import processes_with  # noqa: E402
from driver_bench import HOME, TYPES, SimulatorProcess  # noqa: E402
from figures import HostLoad, percentile  # noqa: E402
from geometry_msgs.msg import TwistStamped  # noqa: E402
from ros_graph import master  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from waiting import InBackground, eventually  # noqa: E402

from jaka_msgs.msg import RobotMsg  # noqa: E402
from jaka_ros_driver.kinematics.arm_models import load_model  # noqa: E402
from jaka_ros_driver.kinematics.forward import forward  # noqa: E402
from jaka_ros_driver.kinematics.rotations import rpy_from_matrix  # noqa: E402
from jaka_ros_driver.protocol.framing import FrameStream, ObjectStream  # noqa: E402
from jaka_ros_driver.wire.log import WireEvent, read_log  # noqa: E402

_FLANGE = forward(load_model("zu7"), tuple(HOME))
HOME_POSE = [*_FLANGE[9:], *rpy_from_matrix(_FLANGE)]
TOPICS = {"tool_position": TwistStamped, "joint_position": JointState, "robot_states": RobotMsg}
STOPS = 30
BARE_PUBLISHER = """
import time, rospy
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from jaka_msgs.msg import RobotMsg
rospy.init_node("jaka_driver")
out = [rospy.Publisher("~" + n, t, queue_size=10, tcp_nodelay=True) for n, t in (
    ("tool_position", TwistStamped), ("joint_position", JointState), ("robot_states", RobotMsg))]
names = ["joint_%d" % n for n in range(1, 7)]
due = time.monotonic()
while not rospy.is_shutdown():
    stamp = rospy.Time.now()
    twist, joints = TwistStamped(), JointState(name=names, position=[0.0] * 6)
    twist.header.stamp = joints.header.stamp = stamp
    out[0].publish(twist), out[1].publish(joints), out[2].publish(RobotMsg())
    due += 0.008
    time.sleep(max(0.0, due - time.monotonic()))
"""


def cpu_seconds(pids):
    ticks = 0
    for pid in pids:
        fields = Path("/proc/%d/stat" % pid).read_text().rsplit(")", 1)[1].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def is_at_this_master(pid):
    """Return whether a process belongs to this master: another one of the same name may run here, and end at any
    time."""
    with contextlib.suppress(OSError):
        return ("ROS_MASTER_URI=%s\0" % os.environ["ROS_MASTER_URI"]).encode() in Path(
            "/proc/%d/environ" % pid).read_bytes()
    return False


def print_row(what, *figures):
    print("%-46s %s" % (what, "  ".join(figures)), flush=True)


def ms(seconds):
    return "%.2f ms" % (1e3 * seconds)


def measure_topics(name, pids, duration):
    """Measure rate and jitter of the three topics, and CPU of the processes meanwhile."""
    arrivals = {topic: [] for topic in TOPICS}
    subscribers = [rospy.Subscriber("/jaka_driver/" + topic, kind, queue_size=1000, tcp_nodelay=True,
                                    callback=lambda _, times=arrivals[topic]: times.append(time.monotonic()))
                   for topic, kind in TOPICS.items()]
    assert eventually(lambda: all(len(times) > 250 for times in arrivals.values()))
    for times in arrivals.values():
        times.clear()
    host, began, cpu = HostLoad(), time.monotonic(), cpu_seconds(pids)
    time.sleep(duration)
    cpu = (cpu_seconds(pids) - cpu) / (time.monotonic() - began)
    for subscriber in subscribers:
        subscriber.unregister()
    for topic, times in arrivals.items():
        gaps = [b - a for a, b in zip(times, times[1:])]
        print_row("%s: %s" % (name, topic), "%.2f Hz" % ((len(times) - 1) / (times[-1] - times[0])),
                  "jitter p99 " + ms(percentile([abs(gap - 0.008) for gap in gaps], 0.99)), "max gap " + ms(max(gaps)))
    print_row("%s: CPU" % name, "%.1f %% of a core" % (100 * cpu))
    print_row("%s: host meanwhile" % name, str(host))
    return cpu


def measure_latency(arm):
    """Return (joint angle in deg as the frame has it -> arrival here) of a slow move."""
    seen = {}
    subscriber = rospy.Subscriber("/jaka_driver/joint_position", JointState, lambda message: seen.setdefault(
        round(message.position[0] * 180 / 3.141592653589793, 5), time.monotonic()), queue_size=1000, tcp_nodelay=True)
    move = InBackground(arm.call, "joint_move", pose=[0.4] + HOME[1:], mvvelo=0.05, mvacc=1.0)
    move.join()
    subscriber.unregister()
    return seen


def measure_stops(arm):
    """Return when stop_move was called during blocking moves, replies delayed by 50 ms, and how long the calls took."""
    arm.simulator.operate("fault", kind="delay", port="command", count=None, delay_ms=50)
    calls, pending = [], []
    for index in range(STOPS):
        goal = [1.5 if index % 2 else -1.5] + HOME[1:]
        move = InBackground(arm.call, "joint_move", pose=goal, mvvelo=0.5, mvacc=4.0)
        assert eventually(arm.simulator.is_moving)
        time.sleep(0.1)
        called = time.monotonic()
        arm.call("stop_move")
        calls.append(called)
        reply = move.join()
        pending.append(time.monotonic() - called)
        assert reply.ret == 0 and "stopped" in reply.message, reply
        assert eventually(lambda: not arm.simulator.is_moving())
    arm.simulator.operate("clear_faults")
    arm.go_home()
    return calls, pending


def measure_servo(arm):
    """Print the calls a second flat out, of joints and of poses, and the share of 250 Hz calls that were in time."""
    for service, target in (("servo_p", HOME_POSE), ("servo_j", HOME)):
        assert arm.call("servo_move_enable", enable=True).ret == 1
        took, began = [], time.monotonic()
        while time.monotonic() - began < 5.0:
            start = time.monotonic()
            assert arm.call(service, pose=target).ret == 1
            took.append(time.monotonic() - start)
        print_row(service + ", persistent, back to back", "%.0f calls/s" % (len(took) / 5.0),
                  "p99 " + ms(percentile(took, 0.99)))
        if service == "servo_p":
            assert arm.call("servo_move_enable", enable=False).ret == 1
    for rate in (125, 250):
        due, late = time.monotonic(), []
        for _ in range(5 * rate):
            due += 1.0 / rate
            time.sleep(max(0.0, due - time.monotonic()))
            assert arm.call("servo_j", pose=HOME).ret == 1
            late.append(time.monotonic() - due)
        print_row("servo_j at %d Hz for 5 s" % rate, "accepted %d of %d" % (len(late), 5 * rate),
                  "reply after p50 %s p99 %s" % (ms(percentile(late, 0.5)), ms(percentile(late, 0.99))))
    assert arm.call("servo_move_enable", enable=False).ret == 1


def measure_services(arm):
    request = {"signal": "digital", "path": 1, "type": 0, "index": 0}
    took = []
    for _ in range(500):
        start = time.monotonic()
        arm.call("get_io", **request)
        took.append(time.monotonic() - start)
    print_row("get_io, persistent connection", "p50 " + ms(percentile(took, 0.5)), "p99 " + ms(percentile(took, 0.99)))
    took = []
    for _ in range(200):
        proxy = rospy.ServiceProxy("/jaka_driver/get_io", TYPES["get_io"])
        start = time.monotonic()
        proxy(**request)
        took.append(time.monotonic() - start)
    print_row("get_io, a connection each call", "p50 " + ms(percentile(took, 0.5)), "p99 " + ms(percentile(took, 0.99)))
    took = []
    for _ in range(5):
        start = time.monotonic()
        subprocess.run(["rosservice", "call", "/jaka_driver/get_io", json.dumps(request)], check=True,
                       stdout=subprocess.DEVNULL)
        took.append(time.monotonic() - start)
    print_row("get_io, program rosservice call", "p50 " + ms(percentile(took, 0.5)))


def judge_by_the_log(log_file, seen, stops, pending):
    """Compute latencies between the controller's log and what was seen or called here."""
    sent, received, commands, frames = {}, [], {}, {}
    for event in read_log(log_file):
        if not isinstance(event, WireEvent) or event.what not in ("in", "out"):
            continue
        if event.port == "status" and event.what == "out":
            for frame in frames.setdefault(event.connection, FrameStream()).feed(event.data):
                sent.setdefault(frame["joint_actual_position"][0], event.time_ns * 1e-9)
        elif event.port == "command" and event.what == "in":
            for request in commands.setdefault(event.connection, ObjectStream()).feed(event.data):
                received.append((event.time_ns * 1e-9, request["cmdName"]))
    latency = [arrival - sent[angle] for angle, arrival in seen.items() if angle in sent and arrival > sent[angle]]
    print_row("frame sent -> subscriber (%d frames)" % len(latency), "p50 " + ms(percentile(latency, 0.5)),
              "p95 " + ms(percentile(latency, 0.95)), "p99 " + ms(percentile(latency, 0.99)))
    wire = [next(at for at, name in received if name == "stop_program" and at >= called) - called for called in stops]
    print_row("stop_move called -> stop_program on the wire", "p50 " + ms(percentile(wire, 0.5)),
              "p95 " + ms(percentile(wire, 0.95)), "max " + ms(max(wire)),
              "(%d blocking moves, replies 50 ms late)" % STOPS)
    print_row("stop_move called -> pending move answered", "p95 " + ms(percentile(pending, 0.95)),
              "max " + ms(max(pending)))


def measure(duration, folder):
    bare = subprocess.Popen([sys.executable, "-c", BARE_PUBLISHER])
    bare_cpu = measure_topics("bare rospy publisher", [bare.pid], duration / 2)
    bare.kill()  # rospy's own shutdown may wait for ever for a thread that publishes
    bare.wait()
    log_file = folder + "/wire.mcap"
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--log", log_file)) as simulator:
        with conftest.driven(simulator) as arm:
            arm.wait_until_ready()
            driver = [pid for pid in processes_with("__name:=jaka_driver\0") if is_at_this_master(pid)]
            guard = processes_with("jaka_ros_driver.client.guard", "--port\0%d\0" % simulator.command_port)
            threads = threading.active_count()
            cpu = measure_topics("driver", driver, duration)
            print_row("driver: CPU beside the bare publisher's", "%.2f x" % (cpu / bare_cpu))
            guard_cpu = cpu_seconds(guard)
            seen = measure_latency(arm)
            print_row("guard: CPU", "%.2f %% of a core" % (100 * (cpu_seconds(guard) - guard_cpu) / 8.0))
            stops, pending = measure_stops(arm)
            measure_servo(arm)
            measure_services(arm)
            assert threading.active_count() < threads + 20
    judge_by_the_log(log_file, seen, stops, pending)


def main(duration):
    with master(), tempfile.TemporaryDirectory() as folder:
        measure(duration, folder)


if __name__ == "__main__":
    main(float((sys.argv[1:] or ["60"])[0]))
