"""Trajectories on the running node: duration and path on the wire for each spacing of points, intervals, cancel, CPU.

Compared in one run: the driver's CPU at rest, with a servo stream by topic, and with a trajectory; and its intervals
with those of a bare Python loop of the same priority that only sleeps until 8 ms are over: the cost of the host
itself. The simulated controller, whose log has the time of each frame, has real-time priority. In the devel space,
quiet or beside other processes:

    build/venv/bin/python3 test/benchmark/bench_trajectory.py [ROUNDS [PRIORITY]]        2, the driver's priority 20
"""
import contextlib
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "test/support", "test/support/live")]

import rospy  # noqa: E402
from action_bench import START, Client, goal_of, joints_of, smooth  # noqa: E402
from driver_bench import LiveDriver  # noqa: E402
from ros_graph import master  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from wire_verdict import WireVerdict  # noqa: E402

SPACINGS_S = (0.1, 0.05, 0.02, 0.01, 0.008, 0.004)
DURATION_S = 4.0
WAY = 1.2
BARE_LOOP = """
import sys, time
from jaka_ros_driver import scheduling
priority = int(sys.argv[1])
scheduling.set_real_time(priority) if priority else scheduling.ask_for_short_slices()
due = time.monotonic()
moments = []
try:
    while True:
        due += 0.008
        time.sleep(max(0.0, due - time.monotonic()))
        moments.append(time.monotonic())
except KeyboardInterrupt:
    print(*moments)
"""


def cpu_of(pid):
    """Return the CPU time of a process, s."""
    fields = Path("/proc/%d/stat" % pid).read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def share(live, act):
    """Return the CPU of the driver while something is done, percent of a core."""
    before, begun = cpu_of(live.process.pid), time.monotonic()
    act()
    return 100.0 * (cpu_of(live.process.pid) - before) / (time.monotonic() - begun)


def home(live):
    assert live.arm.call("joint_move", pose=START, mvvelo=3.0, mvacc=12.0).ret == 1


def stream(live):
    """Stream servo targets by topic at 125 Hz."""
    publisher = rospy.Publisher(live.arm.name + "/servo_j_command", JointState, queue_size=1, tcp_nodelay=True)
    assert live.arm.call("servo_move_enable", enable=True).ret == 1
    time.sleep(0.5)
    rate, begun = rospy.Rate(125.0), time.monotonic()
    while time.monotonic() - begun < DURATION_S:
        place = 0.2 * math.sin(time.monotonic() - begun)
        publisher.publish(JointState(name=["joint_%d" % n for n in range(1, 7)], position=[place] + START[1:]))
        rate.sleep()
    assert live.arm.call("servo_move_enable", enable=False).ret == 1


def cancel_half_way(live, client):
    """Return when a goal was sent, and when it was cancelled in the middle."""
    home(live)
    sent = time.monotonic()
    handle = client.send(goal_of(smooth(WAY, DURATION_S, 0.05)))
    while time.monotonic() - sent < 0.5 * DURATION_S:
        time.sleep(0.005)
    cancelled = time.monotonic()
    handle.cancel()
    state, _ = client.end(handle)
    print("cancelled half-way: %s after %.0f ms" % (state, 1e3 * (time.monotonic() - cancelled)))
    return sent, cancelled


def report_cancel(cancelled, frames):
    """Print when the stream came to rest, and the largest acceleration of a joint."""
    path = [joints for _, joints in frames]
    last = max(i for i, joints in enumerate(path) if joints != path[-1])
    change = max(abs(c - 2.0 * b + a) for p, q, r in zip(path, path[1:], path[2:]) for a, b, c in zip(p, q, r))
    print("cancelled half-way: stream at rest after %.0f ms, at most %.2f rad/s2" % (
        1e3 * (frames[last + 1][0] - cancelled), change / 0.008 ** 2))


@contextlib.contextmanager
def bare_loop(priority):
    """Yield a list that has the moments at which the bare loop woke, s of time.monotonic(), once the context has
    ended."""
    process = subprocess.Popen([sys.executable, "-c", BARE_LOOP, str(priority)], stdout=subprocess.PIPE, text=True)
    moments = []
    try:
        yield moments
    finally:
        process.send_signal(signal.SIGINT)
        moments += map(float, process.communicate()[0].split())


def intervals_of(moments):
    return [b - a for a, b in zip(moments, moments[1:])]


def p99_ms(intervals):
    """Return the 99th percentile of intervals in s, in ms."""
    return 1e3 * sorted(intervals)[int(0.99 * len(intervals))]


def report(spacing, frames, bare):
    first = next(i for i, (_, joints) in enumerate(frames) if joints != frames[0][1])
    last = max(i for i, (_, joints) in enumerate(frames) if joints != frames[-1][1])
    path = frames[first - 1:last + 2]
    times = [at for at, _ in path]
    intervals = intervals_of(times)
    bare_intervals = intervals_of([at for at in bare if times[0] <= at <= times[-1]])
    square = 0.0
    for _, joints in path:  # each joint goes its share of the first one's way, whatever the clock does
        way = joints[0] - START[0]
        square += max(abs(joint - start - way / (n + 1)) for n, (joint, start) in enumerate(zip(joints, START))) ** 2
    print("%5.0f ms  duration %+7.2f ms  frames %4d  off the path, RMS %8.5f mrad  interval p99 %.2f max %.2f ms  "
          "bare p99 %.2f" % (
              1e3 * spacing, 1e3 * (path[-1][0] - path[0][0] - DURATION_S), len(path),
              1e3 * math.sqrt(square / len(path)), p99_ms(intervals), 1e3 * max(intervals), p99_ms(bare_intervals)))
    return intervals, bare_intervals


def main(rounds, priority):
    with tempfile.TemporaryDirectory() as folder, master(), LiveDriver(
            folder, name="jaka_driver", guard=True, simulator=("--realtime",), realtime_priority=priority) as live:
        live.arm.wait_until_ready()
        client, begun, cancels = Client(), [], []
        with bare_loop(priority) as bare:
            for _ in range(rounds):
                home(live)
                idle = share(live, lambda: time.sleep(DURATION_S))
                streaming = share(live, lambda: stream(live))
                for spacing in SPACINGS_S:
                    home(live)
                    begun.append((spacing, time.monotonic()))
                    running = share(live, lambda spacing=spacing: client.run(goal_of(smooth(WAY, DURATION_S, spacing))))
                cancels.append(cancel_half_way(live, client))
                print("CPU of the driver, percent of a core: at rest %.1f, servo stream %.1f, trajectory %.1f" % (
                    idle, streaming, running))
        code, said = live.end_driver()
        assert code == 0, said
        log = WireVerdict(live.log_file)
        sent = [(at, joints_of(request)) for at, request in log.received() if request["cmdName"] == "servo_j"]
        of_all = [report(spacing, [frame for frame in sent if since <= frame[0] < since + DURATION_S + 0.4], bare)
                  for spacing, since in begun]
        print("all of them: interval p99 %.2f ms, bare p99 %.2f ms" % tuple(
            p99_ms([interval for intervals in one for interval in intervals]) for one in zip(*of_all)))
        for since, cancelled in cancels:
            report_cancel(cancelled, [frame for frame in sent if since <= frame[0] < cancelled + 0.5])


if __name__ == "__main__":
    main(*map(int, (sys.argv[1:] + ["2", "20"][len(sys.argv) - 1:])[:2]))
