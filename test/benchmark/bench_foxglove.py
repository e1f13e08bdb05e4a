"""The cost of jaka_foxglove and the delay of its messages, beside a plain rospy subscriber, in one run.

Three topics of the driver's size at 125 Hz each, published with the time of sending in the header. For rospy the reader
is the program that is measured; jaka_foxglove is measured without its viewers, whose latency is that of the whole way.

    build/venv/bin/python3 test/benchmark/bench_foxglove.py
"""
import argparse
import statistics
import struct
import sys
import tempfile
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
for folder in ("tools", "test/support", "test/support/live", "test/support/logs"):
    sys.path.insert(0, str(ROOT / folder))

from command_places import command_of  # noqa: E402
from foxglove_clients import RawViewer, Served, data_of  # noqa: E402
from live_samples import twist_connection, twist_frame  # noqa: E402
from ros_graph import Graph, with_subscribers  # noqa: E402

RATE_HZ = 125
TOPICS = ("/a", "/b", "/c")
LAST = 1 << 30
"""Number of the message that ends a part. Messages before it can be missing: publishers drop what nobody takes."""
SUBSCRIBER = """
import sys, time, rospy
from geometry_msgs.msg import TwistStamped
rospy.init_node("plain")
late = []
def take(message):
    late.append(time.time() - message.header.stamp.to_sec())
for topic in ("/a", "/b", "/c"):
    rospy.Subscriber(topic, TwistStamped, take, queue_size=1000, tcp_nodelay=True)
print("ready", flush=True)
rospy.on_shutdown(lambda: (print(" ".join("%.6f" % value for value in late), flush=True)))
rospy.spin()
"""


def cpu_s(pid: int) -> float:
    fields = Path("/proc/%d/stat" % pid).read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / 100.0


def publish(publisher, outlets, seconds):
    begin = time.monotonic()
    for number in range(int(seconds * RATE_HZ)):
        time.sleep(max(0.0, begin + number / RATE_HZ - time.monotonic()))
        for outlet in outlets:
            publisher.publish(outlet, twist_frame(number, time.time_ns()))


def line(name, cpu, seconds, late):
    late = sorted(late)
    print("| %s | %.1f %% | %d | %.2f ms | %.2f ms |" % (
        name, 100 * cpu / seconds, len(late), 1e3 * statistics.median(late), 1e3 * late[int(0.99 * len(late))]))


def measured_rospy(graph, publisher, outlets, seconds):
    plain = graph.python(SUBSCRIBER)
    plain.wait_for_line("ready")
    with_subscribers(publisher, *outlets)
    before = cpu_s(plain.popen.pid)
    publish(publisher, outlets, seconds)
    cpu = cpu_s(plain.popen.pid) - before
    time.sleep(0.5)
    plain.stop()
    late = max(plain.lines, key=len).split()
    line("rospy subscriber", cpu, seconds, map(float, late))


def measured_foxglove(graph, publisher, outlets, seconds, viewers):
    served = Served(*command_of("jaka_foxglove"), "--port", "0", "-q", environment=graph.environment)
    late, threads, ready = [], [], threading.Barrier(viewers + 1)

    def watch():
        with RawViewer(served.port) as viewer:
            names = {}
            while not set(TOPICS) <= set(names):
                names.update((c["topic"], c["id"]) for c in viewer.text("advertise")["channels"])
            viewer.subscribe(*[names[topic] for topic in TOPICS])
            ready.wait()
            while True:
                _, _, payload = viewer.until(data_of)
                number, stamp_s, stamp_ns = struct.unpack_from("<III", payload)
                if number == LAST:
                    break
                late.append(time.time() - stamp_s - 1e-9 * stamp_ns)

    with served:
        for _ in range(viewers):
            threads.append(threading.Thread(target=watch))
            threads[-1].start()
        ready.wait()
        for outlet in outlets:
            outlet.links.clear()
        with_subscribers(publisher, *outlets)
        before = cpu_s(served.process.pid)
        publish(publisher, outlets, seconds)
        cpu = cpu_s(served.process.pid) - before
        while any(thread.is_alive() for thread in threads):
            publisher.publish(outlets[0], twist_frame(LAST, time.time_ns()))
            time.sleep(0.1)
        line("jaka_foxglove, %d viewer%s" % (viewers, "s" * (viewers > 1)), cpu, seconds, late)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="length of each part (default 20)")
    seconds = parser.parse_args().seconds
    print("| who, %d messages a second | of one core | messages | late by p50 | p99 |\n|---|---|---|---|---|"
          % (RATE_HZ * len(TOPICS)))
    with tempfile.TemporaryDirectory() as folder, Graph(Path(folder)) as graph:
        with graph.publisher("/source") as publisher:
            outlets = [publisher.advertise(topic, twist_connection(topic), False) for topic in TOPICS]
            measured_rospy(graph, publisher, outlets, seconds)
            for viewers in (1, 3):
                measured_foxglove(graph, publisher, outlets, seconds, viewers)


if __name__ == "__main__":
    main()
