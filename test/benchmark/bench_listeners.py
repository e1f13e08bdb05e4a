"""The cost of listeners: the driver beside a bare rospy publisher of the same three topics, in one run.

For each number of listeners, each of which reads all three topics: CPU and threads of the publishing process, and the
round trip of stop_move beside them. Bare publisher and driver take turns. In the devel space:

    build/venv/bin/python3 test/benchmark/bench_listeners.py [SECONDS] [ROUNDS]   of each measurement, 8; pairs, 3
"""
import contextlib
import statistics
import subprocess
import sys
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS / "support"), str(TESTS / "support" / "live"), str(TESTS / "ros"), str(TESTS / "benchmark")]

from arm_bench import processes_with  # noqa: E402
from bench_driver import BARE_PUBLISHER, cpu_seconds, is_at_this_master, ms, print_row  # noqa: E402
from conftest import driven  # noqa: E402
from driver_bench import SimulatorProcess  # noqa: E402
from figures import HostLoad, percentile  # noqa: E402
from ros_graph import master  # noqa: E402

LISTENERS = (0, 1, 5, 20)
STOPS = 60
READERS = """
import selectors, socket, sys, time, xmlrpc.client
from rosgraph import Master
from rosgraph.network import encode_ros_handshake_header
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from jaka_msgs.msg import RobotMsg
selector, master = selectors.DefaultSelector(), Master("/readers")
node = xmlrpc.client.ServerProxy(master.lookupNode("/jaka_driver"))
for number in range(int(sys.argv[1])):
    for name, kind in (("tool_position", TwistStamped), ("joint_position", JointState), ("robot_states", RobotMsg)):
        topic, caller = "/jaka_driver/" + name, "/reader_%d" % number
        while True:
            code, _, way = node.requestTopic(caller, topic, [["TCPROS"]])
            if code == 1:
                break
            time.sleep(0.1)
        link = socket.create_connection((way[1], way[2]))
        link.sendall(encode_ros_handshake_header({"topic": topic, "callerid": caller, "md5sum": kind._md5sum,
                                                  "type": kind._type, "tcp_nodelay": "1"}))
        selector.register(link, selectors.EVENT_READ)
print("ready", flush=True)
while True:
    for key, _ in selector.select():
        if not key.fileobj.recv(1 << 16):
            sys.exit()
"""


@contextlib.contextmanager
def readers(count):
    """Run a process that reads the three topics ``count`` times."""
    process = subprocess.Popen([sys.executable, "-c", READERS, str(count)], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "ready\n"
        yield
    finally:
        process.kill()
        process.wait()


def threads_of(pid):
    return len(list(Path("/proc/%d/task" % pid).iterdir()))


def measured(pid, duration):
    """Return the share of a core, and the threads."""
    began, cpu = time.monotonic(), cpu_seconds([pid])
    time.sleep(duration)
    return (cpu_seconds([pid]) - cpu) / (time.monotonic() - began), threads_of(pid)


def bare(count, duration):
    process = subprocess.Popen([sys.executable, "-c", BARE_PUBLISHER])
    try:
        time.sleep(2.0)
        with readers(count):
            return measured(process.pid, duration)
    finally:
        process.terminate()
        process.wait()


def driver(count, duration):
    """Return the share of a core, the threads, and how long calls of stop_move took, s."""
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator, driven(simulator) as arm:
        arm.wait_until_ready()
        pid, = [pid for pid in processes_with("__name:=jaka_driver\0") if is_at_this_master(pid)]
        with readers(count):
            cpu, threads = measured(pid, duration)
            took = []
            for _ in range(STOPS):
                began = time.monotonic()
                arm.call("stop_move")
                took.append(time.monotonic() - began)
                time.sleep(0.02)
            return cpu, threads, took


def main(duration, rounds):
    with master():
        host = HostLoad()
        for count in LISTENERS:
            pairs = [(bare(count, duration), driver(count, duration)) for _ in range(rounds)]
            stops = [took for _, (_, _, all_took) in pairs for took in all_took]
            print_row(
                "%d listeners" % count,
                "driver %.1f %% (%d threads)" % (100 * statistics.median(d[0] for _, d in pairs), pairs[0][1][1]),
                "bare %.1f %% (%d)" % (100 * statistics.median(b[0] for b, _ in pairs), pairs[0][0][1]),
                "%.2f x (%.2f to %.2f)" % (statistics.median(d[0] / b[0] for b, d in pairs),
                                           min(d[0] / b[0] for b, d in pairs), max(d[0] / b[0] for b, d in pairs)),
                "stop_move p50 %s p95 %s" % (ms(percentile(stops, 0.5)), ms(percentile(stops, 0.95))))
        print_row("host meanwhile", str(host))


if __name__ == "__main__":
    main(float((sys.argv[1:] or ["8"])[0]), int((sys.argv[2:] or ["3"])[0]))
