"""The cost of listeners: the driver beside a bare rospy publisher of the same three topics, in one run.

For each number of listeners, each of which reads all three topics: CPU, threads and memory of the publishing process,
and the round trip of stop_move beside them. Bare publisher and driver take turns. Then the driver alone, with the most
listeners and 100 clients that each call get_io ten times a second on a connection that stays. In the devel space:

    build/venv/bin/python3 test/benchmark/bench_listeners.py [SECONDS] [ROUNDS]   of each measurement, 8; pairs, 3

``--listeners N`` measures this number alone. ``--arms N`` measures, instead of all this, N simulated arms and drivers
beside each other with 5 listeners each: the rate of the slowest connection of each arm. It ends with 1 where one is
slower than 124 Hz.
"""
import argparse
import contextlib
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS / "support"), str(TESTS / "support" / "live"), str(TESTS / "ros"), str(TESTS / "benchmark")]

import rospy  # noqa: E402
from arm_bench import processes_with  # noqa: E402
from bench_driver import BARE_PUBLISHER, cpu_seconds, is_at_this_master, ms, print_row  # noqa: E402
from conftest import driven  # noqa: E402
from driver_bench import Arm, DriverProcess, SimulatorProcess, on  # noqa: E402
from figures import HostLoad, percentile  # noqa: E402
from ros_graph import master  # noqa: E402

from jaka_ros_driver.protocol.framing import ObjectStream  # noqa: E402
from jaka_ros_driver.wire.log import WireEvent, read_log  # noqa: E402

LISTENERS = (0, 1, 5, 20)
CLIENTS = 100
STOPS = 60
LISTENERS_OF_AN_ARM = 5
SETTLED_S = 12.0
"""Time, s, after which a process is measured: what it does once after its start is not what listeners cost."""
SLOWEST_HZ = 124.0
READERS = """
import selectors, socket, sys, time, xmlrpc.client
from rosgraph import Master
from rosgraph.network import encode_ros_handshake_header
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from jaka_msgs.msg import RobotMsg
selector, master, name_of_node = selectors.DefaultSelector(), Master("/readers"), sys.argv[2]
node = xmlrpc.client.ServerProxy(master.lookupNode(name_of_node))
sizes, read = {}, {}
def block(link):
    length = int.from_bytes(link.recv(4, socket.MSG_WAITALL), "little")
    return 4 + len(link.recv(length, socket.MSG_WAITALL))
for number in range(int(sys.argv[1])):
    for name, kind in (("tool_position", TwistStamped), ("joint_position", JointState), ("robot_states", RobotMsg)):
        topic, caller = name_of_node + "/" + name, "/reader_%d" % number
        while True:
            code, _, way = node.requestTopic(caller, topic, [["TCPROS"]])
            if code == 1:
                break
            time.sleep(0.1)
        link = socket.create_connection((way[1], way[2]))
        link.sendall(encode_ros_handshake_header({"topic": topic, "callerid": caller, "md5sum": kind._md5sum,
                                                  "type": kind._type, "tcp_nodelay": "1"}))
        block(link)
        sizes[link], read[link] = block(link), 0
        selector.register(link, selectors.EVENT_READ)
selector.register(sys.stdin, selectors.EVENT_READ)
print("ready", flush=True)
began = time.monotonic()
while True:
    for key, _ in selector.select():
        if key.fileobj is sys.stdin:
            sys.stdin.readline()
            now = time.monotonic()
            print(min(read[link] / sizes[link] for link in read) / (now - began) if read else 0.0, flush=True)
            began, read = now, dict.fromkeys(read, 0)
            continue
        data = key.fileobj.recv(1 << 16)
        read[key.fileobj] += len(data)
        if not data:
            sys.exit()
"""
CALLERS = """
import heapq, io, selectors, socket, struct, sys, time, xmlrpc.client
from rosgraph import Master
from rosgraph.network import encode_ros_handshake_header
from jaka_msgs.srv import GetIO, GetIORequest
host, port = Master("/callers").lookupService("/jaka_driver/get_io")[len("rosrpc://"):].rsplit(":", 1)
body = io.BytesIO()
GetIORequest("digital", 1, 0, 0).serialize(body)
request = struct.pack("<I", len(body.getvalue())) + body.getvalue()
selector, due, asked, took, count = selectors.DefaultSelector(), [], {}, [], int(sys.argv[1])
for number in range(count):
    link = socket.create_connection((host, int(port)))
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    link.sendall(encode_ros_handshake_header({"service": "/jaka_driver/get_io", "callerid": "/caller_%d" % number,
                                              "md5sum": GetIO._md5sum, "persistent": "1"}))
    length = int.from_bytes(link.recv(4, socket.MSG_WAITALL), "little")
    link.recv(length, socket.MSG_WAITALL)
    heapq.heappush(due, (time.monotonic() + 0.1 * number / count, number, link))
    selector.register(link, selectors.EVENT_READ)
selector.register(sys.stdin, selectors.EVENT_READ)
print("ready", flush=True)
while True:
    for key, _ in selector.select(max(0.0, due[0][0] - time.monotonic())):
        if key.fileobj is sys.stdin:
            sys.stdin.readline()
            took.sort()
            print(len(took), took[len(took) // 2], took[int(0.99 * len(took))], flush=True)
            took = []
            continue
        answer = key.fileobj.recv(1 << 16)
        assert answer[:1] == b"\\1", answer
        took.append(time.monotonic() - asked.pop(key.fileobj))
    while due[0][0] <= time.monotonic():
        at, number, link = heapq.heappop(due)
        heapq.heappush(due, (at + 0.1, number, link))
        if link not in asked:
            asked[link] = time.monotonic()
            link.sendall(request)
"""


@contextlib.contextmanager
def helper(script, *arguments):
    """Run a script; yield a function that returns the numbers that it has to say of the time since the last call."""
    process = subprocess.Popen([sys.executable, "-c", script, *map(str, arguments)], stdin=subprocess.PIPE,
                               stdout=subprocess.PIPE, text=True)

    def ask():
        process.stdin.write("\n")
        process.stdin.flush()
        return [float(word) for word in process.stdout.readline().split()]
    try:
        assert process.stdout.readline() == "ready\n"
        yield ask
    finally:
        process.kill()
        process.communicate()


def readers(count, node="/jaka_driver"):
    """Run a process that reads the three topics ``count`` times; asked, it tells the rate of the slowest, Hz."""
    return helper(READERS, count, node)


@contextlib.contextmanager
def callers(count):
    """Run a process of so many clients; asked, it tells the number of calls, and median and 99th percentile, s."""
    if not count:
        yield None
        return
    with helper(CALLERS, count) as ask:
        yield ask


def threads_of(pid):
    return len(list(Path("/proc/%d/task" % pid).iterdir()))


def memory_of(pid):
    """Return the memory that a process has in use, MB."""
    line = next(line for line in Path("/proc/%d/status" % pid).read_text().splitlines() if line.startswith("VmRSS:"))
    return int(line.split()[1]) / 1024.0


def measured(pid, duration):
    """Return the share of a core, and the threads."""
    began, cpu = time.monotonic(), cpu_seconds([pid])
    time.sleep(duration)
    return (cpu_seconds([pid]) - cpu) / (time.monotonic() - began), threads_of(pid)


def bare(count, duration):
    process = subprocess.Popen([sys.executable, "-c", BARE_PUBLISHER])
    try:
        time.sleep(2.0)  # it has its topics
        with readers(count):
            time.sleep(SETTLED_S)
            return measured(process.pid, duration)
    finally:
        process.kill()  # rospy's own shutdown may wait for ever for a thread that publishes
        process.wait()


class Measured:
    """The driver with its listeners and clients, as it was measured.

    Attributes:
        cpu: Share of a core.
        threads: Of its process.
        memory: In use before the first listener and at the end, MB.
        stops: How long calls of stop_move took, s.
        on_the_wire: How long after the call the controller had the stop, s.
        calls: What the other clients tell (``callers``); None where there were none.
    """

    def __init__(self, listeners, clients, duration):
        with tempfile.TemporaryDirectory() as folder:
            log = folder + "/wire.mcap"
            words = ["--log", log] if clients else []  # the log costs the simulated controller time
            with contextlib.closing(SimulatorProcess("--start", "enabled", *words)) as simulator:
                with driven(simulator) as arm:
                    called = self._measure(arm, listeners, clients, duration)
            stops = stops_in(log) if clients else []
        self.on_the_wire = [min(at for at in stops if at >= moment) - moment for moment in called] if stops else []

    def _measure(self, arm, listeners, clients, duration):
        arm.wait_until_ready()
        pid, = [pid for pid in processes_with("__name:=jaka_driver\0") if is_at_this_master(pid)]
        before, self.stops, called = memory_of(pid), [], []
        with readers(listeners), callers(clients) as ask:
            time.sleep(SETTLED_S)
            if ask:
                ask()
            self.cpu, self.threads = measured(pid, duration)
            for _ in range(STOPS):
                called.append(time.monotonic())
                with contextlib.suppress(rospy.ServiceException):  # a busy host shows the arm's rest too late
                    arm.call("stop_move")
                self.stops.append(time.monotonic() - called[-1])
                time.sleep(0.02)
            self.memory = before, memory_of(pid)
            self.calls = ask and ask()
        return called


def stops_in(log):
    """Return when the controller received each stop, monotonic time, s."""
    found, streams = [], {}
    for event in read_log(log):
        if isinstance(event, WireEvent) and (event.what, event.port) == ("in", "command"):
            for request in streams.setdefault(event.connection, ObjectStream()).feed(event.data):
                if request["cmdName"] == "stop_program":
                    found.append(event.time_ns * 1e-9)
    return found


def print_stops(what, seconds):
    return "%s p50 %s p95 %s" % (what, ms(percentile(seconds, 0.5)), ms(percentile(seconds, 0.95)))


def measure_pairs(count, duration, rounds):
    pairs = [(bare(count, duration), Measured(count, 0, duration)) for _ in range(rounds)]
    drivers = [driver for _, driver in pairs]
    ratios = [driver.cpu / cpu for (cpu, _), driver in pairs]
    print_row(
        "%d listeners" % count,
        "driver %.1f %% (%d threads)" % (100 * statistics.median(d.cpu for d in drivers), drivers[0].threads),
        "bare %.1f %% (%d)" % (100 * statistics.median(cpu for (cpu, _), _ in pairs), pairs[0][0][1]),
        "%.2f x (%.2f to %.2f)" % (statistics.median(ratios), min(ratios), max(ratios)),
        print_stops("stop_move", [took for driver in drivers for took in driver.stops]),
        "memory %.1f -> %.1f MB" % drivers[0].memory)


def measure_clients(count, duration, rounds):
    drivers = [Measured(count, CLIENTS, duration) for _ in range(rounds)]
    print_row(
        "%d listeners, %d clients" % (count, CLIENTS),
        "driver %.1f %% (%d threads)" % (100 * statistics.median(d.cpu for d in drivers), drivers[0].threads),
        "%d get_io p50 %s p99 %s" % (statistics.median(d.calls[0] for d in drivers),
                                     *[ms(statistics.median(d.calls[n] for d in drivers)) for n in (1, 2)]),
        print_stops("stop_move", [took for driver in drivers for took in driver.stops]),
        print_stops("on the wire", [took for driver in drivers for took in driver.on_the_wire]),
        "memory %.1f -> %.1f MB" % drivers[0].memory)


def measure_arms(count, duration):
    """Return whether every connection of each of so many arms had its rate."""
    with contextlib.ExitStack() as running:
        arms = []
        for number in range(1, count + 1):
            simulator = running.enter_context(contextlib.closing(SimulatorProcess("--start", "enabled")))
            running.enter_context(DriverProcess("jaka_driver", {"ROS_NAMESPACE": "/arm_%d" % number},
                                                **on(simulator, guard=False)))
            arms.append(Arm(simulator, "/arm_%d/jaka_driver" % number))
        for arm in arms:
            arm.wait_until_ready()
        asks = [running.enter_context(readers(LISTENERS_OF_AN_ARM, arm.name)) for arm in arms]
        pids = [pid for pid in processes_with("__name:=jaka_driver\0") if is_at_this_master(pid)]
        for ask in asks:
            ask()
        cpu, _ = cpu_seconds(pids), time.sleep(duration)
        cpu, rates = cpu_seconds(pids) - cpu, [ask()[0] for ask in asks]
        print_row("%d arms, %d listeners each" % (count, LISTENERS_OF_AN_ARM),
                  "slowest connection of each " + " ".join("%.1f" % rate for rate in rates) + " Hz",
                  "drivers %.1f %% of a core together" % (100 * cpu / duration))
        return min(rates) >= SLOWEST_HZ


def main(arguments):
    with master():
        host, is_good = HostLoad(), True
        if arguments.arms:
            is_good = measure_arms(arguments.arms, arguments.seconds)
        else:
            for count in arguments.listeners or LISTENERS:
                measure_pairs(count, arguments.seconds, arguments.rounds)
            if not arguments.listeners:
                measure_clients(max(LISTENERS), arguments.seconds, arguments.rounds)
        print_row("host meanwhile", str(host))
    return 0 if is_good else 1


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("seconds", type=float, nargs="?", default=8.0)
    parser.add_argument("rounds", type=int, nargs="?", default=3)
    parser.add_argument("--listeners", type=int, action="append")
    parser.add_argument("--arms", type=int)
    sys.exit(main(parser.parse_args()))
