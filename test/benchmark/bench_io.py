"""The delay from an edge at an input of the simulated controller to the message of ~io_states, and to its frame.

The frames are those of joint_position, whose stamps are those of the status feed. In the devel space, on a quiet host:

    build/venv/bin/python3 test/benchmark/bench_io.py [EDGES]        200
"""
import random
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "test/support", "test/support/live")]

import rospy  # noqa: E402
from driver_bench import LiveDriver, collecting  # noqa: E402
from figures import percentile  # noqa: E402
from ros_graph import master  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402

from jaka_msgs.msg import IOStates  # noqa: E402

PAUSE_S = (0.02, 0.06)
PATIENCE_S = 5.0


def main(count):
    random.seed(1)
    with tempfile.TemporaryDirectory() as folder, master(), LiveDriver(folder, name="edges", guard=False) as live:
        live.arm.wait_until_ready()
        with collecting(live.arm.name + "/io_states", IOStates) as edges, \
                collecting(live.arm.name + "/joint_position", JointState) as frames:
            while not edges or not frames:
                time.sleep(0.01)
            told = [edge(live, edges, n) for n in range(count)]
        stamps = sorted(message.header.stamp.to_sec() for _, message in frames)
    behind = [sum(1 for stamp in stamps if set_at < stamp < shown) for set_at, _, shown in told]
    delays = [1e3 * (came - set_at) for set_at, came, _ in told]
    print("%d edges: input set -> message at a subscriber, ms: p50 %.1f, p95 %.1f, max %.1f" % (
        count, percentile(delays, 0.5), percentile(delays, 0.95), max(delays)))
    print("frames since the edge that were published without it: none for %d edges, one for %d, more for %d" % (
        behind.count(0), behind.count(1), len(behind) - behind.count(0) - behind.count(1)))


def edge(live, edges, n):
    """Return (when the input was set, when the message came, its stamp), s."""
    time.sleep(random.uniform(*PAUSE_S))
    wanted, seen = n % 2 == 0, len(edges)
    live.arm.simulator.operate("set_input", index=7, value=int(wanted))
    set_at = rospy.get_time()
    limit = set_at + PATIENCE_S
    while rospy.get_time() < limit:
        for came, message in list(edges[seen:]):
            if message.cabinet.digital_inputs[7] is wanted:
                return set_at, came, message.header.stamp.to_sec()
        time.sleep(0.0005)
    raise AssertionError("edge %d was not published" % n)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
